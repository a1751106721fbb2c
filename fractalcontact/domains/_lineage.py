"""Lineage of islands: which island of one plane of a path overlaps which island of the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._mask_input import Array, build_dataset, plane_shape, read_planes

SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components)"
CONTINUATION, BIRTH, DEATH, MERGE, SPLIT, MERGE_AND_SPLIT = range(6)  # the flags of `event` in the schema


def check_path(problems: Problems, *, mask: Any, connectivity: Any, periodic: Any, valid: Any) -> None:
    """Check a mask with a leading dim along which its planes follow each other."""
    check_connected(problems, mask=mask, connectivity=connectivity, periodic=periodic, valid=valid)
    if isinstance(mask, xr.DataArray) and plane_shape(mask)[0] <= mask.size:
        expected = "at least one leading dim for the path, as in (step, y, x)"
        problems.require(mask.ndim > 2, "mask.dims", expected, "(y, x)")


@public_result(title="Lineage of islands", references=SOURCE, achieved_error="exact", check=check_path)
def lineage(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Table of the fate of every island: which island of one plane overlaps which of the next.

    Every plane is compared with the one before it along the last leading dim (the steps of a load path, a
    shear displacement ...); earlier leading dims are separate paths. Two islands are the same if they share
    cells.

    Parameters
    ----------
    mask : DataArray, dims (..., path, y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands continue across the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; the others are in no island.

    Returns
    -------
    Dataset
        Over `link`, one row for each pair of islands that overlap, each birth and each death:
        `island_before` and `island_after`, the numbers of `islands` (0: none); `common_cells`; `event` (int8
        flags): continuation, birth, death, merge (the island after overlaps several before), split (the
        island before overlaps several after), or merge_and_split. The coordinates `link_<dim>` give, for
        every leading dim, the later of the two planes.

    Raises
    ------
    InvalidInput
        The mask has no leading dim, or the mask, `connectivity`, `periodic` or `valid` is not as described.

    Examples
    --------
    Two islands grow together:

    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> cells = np.array([[[1, 0, 0, 1]], [[1, 1, 1, 1]]])
    >>> result = fc.domains.lineage(xr.DataArray(cells, dims=("step", "y", "x")))
    >>> result.island_before.values.tolist(), result.island_after.values.tolist()
    ([1, 2], [1, 1])
    >>> [result.event.flag_meanings.split()[event] for event in result.event.values]
    ['merge', 'merge']
    """
    planes = read_planes(mask, valid=valid, periodic=periodic)
    components = label_planes(planes, connectivity)
    later = [plane for plane in range(planes.count) if plane % planes.shape[-1]]
    tables = [event_table(components[plane - 1], components[plane]) for plane in later]
    empty = {name: values[:0] for name, values in event_table(components[0], components[0]).items()}
    columns = {name: np.concatenate([empty[name], *(table[name] for table in tables)]) for name in empty}
    rows = np.repeat(np.array(later, np.int64), [table["event"].size for table in tables])
    variables = {name: ("link", values) for name, values in columns.items()}
    return build_dataset(planes, variables, rows=("link", rows))


@dataclass(frozen=True)
class Overlaps:
    """Pairs of islands, one of each of two planes, that share cells, and how many cells each pair shares."""

    before: Array
    after: Array
    cells: Array
    ancestors: Array  # number of islands before that each island after overlaps
    heirs: Array  # number of islands after that each island before overlaps

    @property
    def event_counts(self) -> tuple[int, int, int, int]:
        """Births, deaths, merges and splits."""
        events = (self.ancestors == 0, self.heirs == 0, self.ancestors > 1, self.heirs > 1)
        births, deaths, merges, splits = (int(np.count_nonzero(event)) for event in events)
        return births, deaths, merges, splits


def island_overlaps(before: Components, after: Components) -> Overlaps:
    """Return which islands of two planes share cells."""
    old, new = before.map, after.map
    both = (old > 0) & (new > 0)
    codes = old[both].astype(np.int64) * (after.count + 1) + new[both]
    codes, cells = np.unique(codes, return_counts=True)
    island_before, island_after = codes // (after.count + 1), codes % (after.count + 1)
    ancestors = np.bincount(island_after, minlength=after.count + 1)[1:]
    heirs = np.bincount(island_before, minlength=before.count + 1)[1:]
    return Overlaps(island_before, island_after, cells, ancestors, heirs)


def event_table(before: Components, after: Components) -> dict[str, Array]:
    """Return one row for each overlap, birth and death: island before and after (0: none), cells, event."""
    overlaps = island_overlaps(before, after)
    born, dead = np.flatnonzero(overlaps.ancestors == 0) + 1, np.flatnonzero(overlaps.heirs == 0) + 1
    merges = overlaps.ancestors[overlaps.after - 1] > 1
    splits = overlaps.heirs[overlaps.before - 1] > 1
    event = np.select([merges & splits, merges, splits], [MERGE_AND_SPLIT, MERGE, SPLIT], CONTINUATION)
    zero_born, zero_dead = np.zeros(born.size, np.int64), np.zeros(dead.size, np.int64)
    return {
        "island_before": np.concatenate([overlaps.before, zero_born, dead]),
        "island_after": np.concatenate([overlaps.after, born, zero_dead]),
        "common_cells": np.concatenate([overlaps.cells, zero_born, zero_dead]),
        "event": np.concatenate([event, zero_born + BIRTH, zero_dead + DEATH]).astype(np.int8),
    }
