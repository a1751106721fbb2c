"""The random null beside the box dimension: exact probabilities, realisations, its power against islands."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set, random_null
from scipy import ndimage
from scipy.stats import hypergeom

import fractalcontact as fc


@pytest.mark.parametrize("sets", [100, pytest.param(300, marks=pytest.mark.slow)])
def test_null_counts_match_exact_fractions(sets):
    rng = np.random.default_rng(11)
    for _ in range(sets):
        size = int(rng.integers(1, 9))
        ny, nx = (size * int(n) for n in rng.integers(2, 64 // size, 2))  # of whole boxes
        observed = ny * nx
        cells, region = int(rng.integers(0, observed + 1)), size**2
        mask = as_mask((rng.permutation(observed) < cells).reshape(ny, nx))
        result = fc.domains.box_dimension(mask, box_sizes=[size], cover="aligned")
        missed = 1.0 - float(result.null_count[0]) * region / observed
        exact = float(Fraction(comb(observed - region, cells), comb(observed, cells)))
        assert missed == pytest.approx(exact, rel=1e-11, abs=1e-14)


def test_aligned_null_counts_in_gaps_match_a_sum_over_boxes():
    """Boxes of one grid that are cut by the edge, or hold gaps, are missed more often than full ones."""
    rng = np.random.default_rng(14)
    valid, sizes, cells = rng.random((33, 50)) < 0.7, [1, 4, 9, 16], 40
    places = rng.choice(np.flatnonzero(valid), cells, replace=False)
    mask = np.isin(np.arange(valid.size), places).reshape(valid.shape)
    result = fc.domains.box_dimension(as_mask(mask), box_sizes=sizes, cover="aligned", valid=as_mask(valid))
    observed = int(valid.sum())
    for size, count in zip(sizes, result.null_count.values, strict=True):
        starts = np.arange(0, 33, size), np.arange(0, 50, size)
        held = np.add.reduceat(np.add.reduceat(valid.astype(int), starts[0], 0), starts[1], 1)
        held = held[held > 0]
        met = 1.0 - hypergeom(observed, cells, held).pmf(0)
        assert count == pytest.approx(observed / size**2 * met.mean(), rel=1e-9)


def test_null_counts_and_spread_match_realisations():
    rng = np.random.default_rng(12)
    planes = np.array([random_null(64, 200, rng) for _ in range(400)])
    scales = [1, 2, 4, 8, 16]
    result = fc.domains.box_dimension(as_mask(planes), box_sizes=scales, cover="aligned")
    measured = result.box_count.values
    error = measured.std(0) / 20
    assert np.all(np.abs(measured.mean(0) - result.null_count.values[0]) <= 4 * error + 1e-4)
    assert float(result.null_spread[0]) == pytest.approx(result.box_dimension.values.std(), rel=0.15)
    assert float(result.null_dimension[0]) == pytest.approx(
        result.box_dimension.values.mean(), abs=4 * float(result.null_spread[0]) / 20
    )


@pytest.mark.parametrize("cover", ["mean", "aligned"])
def test_null_of_planes_with_as_many_cells_is_that_of_each_alone(cover):
    """The null is fitted once for planes with as many cells in the same window, here in one of their own."""
    rng = np.random.default_rng(35)
    planes = (
        np.array([random_null(64, 900, rng), level_set(64, 0.9, 900 / 4096, rng), np.zeros((64, 64))]) > 0
    )
    planes[2, 10:40, 20:50] = True
    assert (planes.sum((1, 2)) == 900).all()
    together = fc.domains.box_dimension(as_mask(planes), cover=cover, window="each")
    assert np.unique(together.window_high).size > 1
    for k, plane in enumerate(planes):
        alone = fc.domains.box_dimension(as_mask(plane), cover=cover, window="each")
        for name in ("null_count", "null_dimension", "null_spread", "differs_from_random"):
            assert np.array_equal(together[name][k], alone[name]), (name, k)


CASES = [  # cells a side, coverage, sizes, cover; the expected counts must scatter, not be one or all
    (40, 0.2, None, "mean"),
    (64, 0.01, [1, 2, 3, 5, 8], "mean"),
    (45, 0.1, [1, 2, 3, 5, 8], "aligned"),
    (40, 0.05, None, "aligned"),
    (40, 0.05, None, "mean"),
    (64, 0.2, None, "mean"),
    (64, 0.05, None, "aligned"),
    *[(96, coverage, None, "mean") for coverage in (0.005, 0.05, 0.2, 0.5)],
    *[(96, coverage, [1, 2, 3, 4, 6, 9, 14], "mean") for coverage in (0.005, 0.02, 0.5)],
    *[(96, coverage, [2, 5, 7, 11], "aligned") for coverage in (0.005, 0.05, 0.2)],
]


@pytest.mark.parametrize(
    ("n", "coverage", "sizes", "cover"),
    [pytest.param(*case, marks=[] if k < 4 else pytest.mark.slow) for k, case in enumerate(CASES)],
)
@pytest.mark.parametrize("wraps", [False, True])
def test_null_spread_is_the_scatter_of_realisations(n, coverage, sizes, cover, wraps):
    rng = np.random.default_rng(31)
    planes = np.array([random_null(n, int(coverage * n * n), rng) for _ in range(400)])
    masks = as_mask(planes, periodic=(wraps, wraps))
    result = fc.domains.box_dimension(masks, box_sizes=sizes, cover=cover)
    spread = float(result.null_spread[0])
    # the scatter of 400 has an error of 3.5 %
    assert result.box_dimension.values.std(ddof=1) == pytest.approx(spread, rel=0.12)
    assert float(result.box_dimension.mean()) == pytest.approx(
        float(result.null_dimension[0]), abs=spread / 5
    )


@pytest.mark.parametrize("cover", ["mean", "aligned"])
@pytest.mark.parametrize("coverage", [0.1, pytest.param(0.3, marks=pytest.mark.slow)])
def test_null_spread_with_single_cells_missing_is_the_scatter_of_realisations(coverage, cover):
    rng = np.random.default_rng(33)
    valid = rng.random((60, 60)) < 0.7
    places = np.flatnonzero(valid)
    planes = np.zeros((150, 60 * 60), bool)
    for plane in planes:
        plane[rng.choice(places, int(coverage * places.size), replace=False)] = True
    wraps = (True, True)
    masks, seen = as_mask(planes.reshape(-1, 60, 60), periodic=wraps), as_mask(valid, periodic=wraps)
    result = fc.domains.box_dimension(masks, cover=cover, valid=seen)
    # the scatter of 150 has an error of 5.8 %
    assert float(result.null_spread[0]) == pytest.approx(result.box_dimension.values.std(ddof=1), rel=0.2)


@pytest.mark.parametrize("cover", ["minimum", "mean", "aligned"])
def test_observed_everywhere_is_without_gaps(cover):
    mask = as_mask(random_null(50, 300, np.random.default_rng(34)), periodic=(False, True))
    seen = fc.domains.box_dimension(mask, cover=cover, valid=xr.ones_like(mask, bool))
    xr.testing.assert_equal(
        seen.drop_vars("run_time"), fc.domains.box_dimension(mask, cover=cover).drop_vars("run_time")
    )


def test_null_spread_of_many_sizes_is_the_scatter_of_realisations():
    """The covariance of 63 sizes is interpolated from that of 20."""
    rng = np.random.default_rng(32)
    planes = np.array([random_null(128, 200, rng) for _ in range(300)])
    result = fc.domains.box_dimension(as_mask(planes), box_sizes=range(1, 64), cover="mean")
    assert result.box_dimension.values.std(ddof=1) == pytest.approx(float(result.null_spread[0]), rel=0.14)


def test_one_cell_more_on_a_large_plane_scatters_as_pairs_do():
    """Of k cells on A, boxes of two cells a side miss the count k by the pairs that are neighbours."""
    planes = np.zeros((1, 1000, 1000), bool)
    planes[0, 0, :100] = True
    result = fc.domains.box_dimension(as_mask(planes, periodic=(True, True)), box_sizes=[1, 2], cover="mean")
    # a pair at a distance of (1, 0) costs half a box, one at (1, 1) a quarter; 4950 pairs on 10^6 cells
    variance = 4950 / 1e6 * (4 * 0.5**2 + 4 * 0.25**2)
    expected = np.sqrt(variance) / 100 / np.log(2)
    assert float(result.null_spread[0]) == pytest.approx(expected, rel=0.01)


def test_null_of_one_cell_and_of_all_cells():
    planes = np.zeros((2, 50, 50), bool)
    planes[0, 7, 7] = planes[1] = True
    result = fc.domains.box_dimension(as_mask(planes))
    assert result.null_dimension.values == pytest.approx([0, 2], abs=1e-12)


@pytest.mark.parametrize("coverage", [0.003, 0.02, 0.06, 0.2, 0.4])
def test_level_sets_differ_from_the_null(coverage):
    rng = np.random.default_rng(13)
    for hurst in (0.3, 0.8):
        result = fc.domains.box_dimension(as_mask(level_set(256, hurst, coverage, rng)))
        assert bool(result.differs_from_random)
        if coverage < 0.1:
            assert float(result.box_dimension) > float(result.null_dimension) + 5 * float(result.null_spread)


@pytest.mark.parametrize(
    "cells", [5, 800, *(pytest.param(cells, marks=pytest.mark.slow) for cells in (2, 20, 100, 2000, 3900))]
)
def test_realisations_of_the_null_rarely_differ_from_it(cells):
    rng = np.random.default_rng(14)
    planes = np.array([random_null(64, cells, rng) for _ in range(100)])
    assert fc.domains.box_dimension(as_mask(planes)).differs_from_random.values.mean() <= 0.02


@pytest.mark.slow
def test_about_one_null_in_a_thousand_differs_at_a_size():
    rng = np.random.default_rng(15)
    alarms = 0
    for cells in (200, 800, 2000):
        planes = np.array([random_null(64, cells, rng) for _ in range(3000)])
        alarms += int(fc.domains.box_dimension(as_mask(planes)).differs_from_random.values.sum())
    # three sizes, which are correlated, and a margin of one box: .0005 to .002 of 9000
    assert 1 <= alarms <= 25


WRAPS = (False, False), (True, False), (True, True)
UNOBSERVED = [(coverage, wraps) for coverage in (0.02, 0.3, 0.7) for wraps in WRAPS]


@pytest.mark.parametrize(
    ("coverage", "wraps"),
    # each coverage and each kind of edge once
    [pytest.param(*case, marks=[] if n % 4 == 0 else pytest.mark.slow) for n, case in enumerate(UNOBSERVED)],
)
def test_null_with_unobserved_cells_matches_realisations(wraps, coverage):
    rng = np.random.default_rng(12)
    n, sizes = 60, [1, 2, 3, 4, 6]
    valid = ndimage.gaussian_filter(rng.random((n, n)), 2, mode="wrap") > 0.49
    places = np.flatnonzero(valid)
    planes = np.zeros((150, n * n), bool)
    for plane in planes:
        plane[rng.choice(places, int(coverage * places.size), replace=False)] = True
    masks = as_mask(planes.reshape(-1, n, n), periodic=wraps)
    seen = as_mask(valid, periodic=wraps)
    result = fc.domains.box_dimension(masks, box_sizes=sizes, cover="mean", valid=seen)
    counts, null = result.box_measure.values, result.null_count.values[0]
    error = counts.std(0, ddof=1) / np.sqrt(len(counts))
    assert np.all(np.abs(counts.mean(0) - null) <= 4 * error + 1e-9)
    assert result.differs_from_random.values.mean() <= 0.01
    deviation = result.box_dimension.values.std(ddof=1)
    assert 0.8 * deviation <= float(result.null_spread[0]) <= 1.5 * deviation  # of some of the boxes
    clustered = ndimage.gaussian_filter(rng.random((n, n)), 1, mode="wrap")
    clusters = as_mask(clustered > np.quantile(clustered[valid], 1 - coverage), periodic=wraps)
    assert fc.domains.box_dimension(clusters, valid=seen).differs_from_random
