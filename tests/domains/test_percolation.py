"""Percolation: plain shapes, spirals, duality with the complement, published numbers of site percolation."""

import numpy as np
import pytest
from domains.sets import as_mask

import fractalcontact as fc


def test_percolation_of_rows_and_columns():
    row, gap = np.zeros((9, 9), bool), np.zeros((9, 9), bool)
    row[4] = gap[4] = True
    gap[4, 4] = False
    for wraps in ((False, False), (True, True)):
        result = fc.domains.percolation(as_mask(np.array([row, row.T, gap, row & False]), periodic=wraps))
        assert result.percolates.values.tolist() == [
            [True, False],
            [False, True],
            [False, False],
            [False, False],
        ]
    assert result.axis.values.tolist() == ["x", "y"]
    assert result.largest_share.values[:3].tolist() == [1, 1, 1]
    assert np.isnan(result.largest_share[3])


def test_percolation_depends_on_connectivity():
    diagonal = as_mask(np.eye(7))
    assert not fc.domains.percolation(diagonal).percolates.any()
    result = fc.domains.percolation(diagonal, connectivity=2)
    assert result.percolates.all()
    assert "8 neighbours" in result.percolates.attrs["long_name"]


def test_touching_both_ends_is_not_wrapping():
    cells = np.zeros((9, 9), bool)
    cells[0:4, 2] = cells[6:, 2] = True
    assert not fc.domains.percolation(as_mask(cells, periodic=(True, True))).percolates.any()


@pytest.mark.parametrize(("turns_y", "turns_x"), [(1, 2), (2, 1), (3, 2), (1, 6)])
def test_spirals_wrap_around_both_axes(turns_y, turns_x):
    n = 60
    cells = np.zeros((n, n), bool)
    along = np.arange(n * max(turns_y, turns_x) * 4)
    y, x = (np.floor(along * turns / along.size * n).astype(int) for turns in (turns_y, turns_x))
    cells[y % n, x % n] = True
    result = fc.domains.percolation(as_mask(cells, periodic=(True, True)), connectivity=2)
    assert result.percolates.all()
    assert int(fc.domains.islands(as_mask(cells, periodic=(True, True)), connectivity=2).n_islands) == 1


def test_crossing_separates_the_complement():
    rng = np.random.default_rng(3)
    for _ in range(30):
        cells = rng.random((12, 12)) < 0.55
        across = fc.domains.percolation(as_mask(cells)).percolates.values[0]
        is_separated = not fc.domains.percolation(as_mask(~cells), connectivity=2).percolates.values[1]
        assert across == is_separated


def test_site_percolation_threshold():
    rng = np.random.default_rng(4)
    shares = [
        np.mean(
            [fc.domains.percolation(as_mask(rng.random((128, 128)) < p)).percolates[0] for _ in range(10)]
        )
        for p in (0.55, 0.64)
    ]
    assert shares == [0, 1]


def test_published_wrapping_probabilities_and_cluster_numbers():
    # wrapping: Newman and Ziff, Phys. Rev. Lett. 85:4104 (2000), from Pinson (1994); number of clusters:
    # Ziff, Finch and Adamchik, Phys. Rev. Lett. 79:3447 (1997)
    rng = np.random.default_rng(5)
    n, planes = 32, 400
    mask = as_mask(rng.random((planes, n, n)) < 0.59274605, periodic=(True, True))
    along = fc.domains.percolation(mask).percolates.values
    for share, published in (
        (along[:, 0].mean(), 0.521058290),
        (along[:, 1].mean(), 0.521058290),
        (along.any(-1).mean(), 0.690473725),
        (along.all(-1).mean(), 0.351642855),
    ):
        assert share == pytest.approx(published, abs=4 * np.sqrt(published * (1 - published) / planes))
    counts = fc.domains.islands(mask, keep=()).n_islands.values
    published = 0.0275981 * n**2 + 0.8835
    assert counts.mean() == pytest.approx(published, abs=4 * counts.std() / np.sqrt(planes))
