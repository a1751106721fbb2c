"""Lineage of islands: a table by hand, and its agreement with the events of `evolution`."""

import numpy as np
from domains.sets import as_mask, level_set, row_path

import fractalcontact as fc


def test_lineage_of_a_small_path():
    cells = row_path(
        ".#...#..#.",
        ".#..##.##.",
        ".######.#.",
        ".##..#....",
    )
    result = fc.domains.lineage(as_mask(cells))
    names = result.event.attrs["flag_meanings"].split()
    rows = [
        (int(step), int(before), int(after), int(common), names[event])
        for step, before, after, common, event in zip(
            result.link_step,
            result.island_before,
            result.island_after,
            result.common_cells,
            result.event.values,
            strict=True,
        )
    ]
    assert rows == [
        (1, 1, 1, 2, "continuation"),
        (1, 2, 2, 2, "continuation"),
        (1, 3, 3, 2, "continuation"),
        (2, 1, 1, 2, "merge"),
        (2, 2, 1, 4, "merge"),
        (2, 3, 2, 2, "continuation"),
        (3, 1, 1, 4, "split"),
        (3, 1, 2, 2, "split"),
        (3, 2, 0, 0, "death"),
    ]
    # every character of the rows stands for two cells
    assert result.cells_before.values.tolist() == [2, 2, 2, 2, 4, 4, 12, 12, 2]
    assert result.cells_after.values.tolist() == [2, 4, 4, 12, 12, 2, 4, 2, 0]
    births = fc.domains.lineage(as_mask(np.concatenate([0 * cells[:1], cells[:1]])))
    assert births.event.values.tolist() == [1, 1, 1]
    assert births.island_before.values.tolist() == [0, 0, 0]
    assert fc.domains.lineage(as_mask(cells[:1])).sizes["link"] == 0


def test_lineage_and_evolution_agree():
    rng = np.random.default_rng(9)
    planes = np.array([[level_set(48, 0.4, c, rng) for c in (0.2, 0.25, 0.2)] for _ in range(2)])
    mask = as_mask(planes, periodic=(True, True), dims=("shear", "step", "y", "x"))
    mask = mask.assign_coords(shear=[1e-3, 2e-3])
    counts = fc.domains.evolution(mask)
    table = fc.domains.lineage(mask)
    for i, shear in enumerate(mask.shear.values):
        for step in (1, 2):
            rows = table.isel(link=np.flatnonzero((table.link_shear == shear) & (table.link_step == step)))
            assert (rows.event == 1).sum() == counts.births[i, step]
            assert (rows.event == 2).sum() == counts.deaths[i, step]
            merged = rows.island_after.values[np.isin(rows.event, (3, 5))]
            parted = rows.island_before.values[np.isin(rows.event, (4, 5))]
            assert np.unique(merged).size == counts.merges[i, step]
            assert np.unique(parted).size == counts.splits[i, step]
            after = rows.island_after.values
            assert np.unique(after[after > 0]).size == counts.n_islands[i, step]
