"""Dimension of the boundary: level sets of exact Brownian surfaces, smooth edges, gaps, the limits."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set

import fractalcontact as fc
from fractalcontact.domains import _boundary as _edges


def brownian_level_set(n, hurst, rng, coverage=0.5):
    heights = fc.surfaces.fbm((n, n), 1.0, hurst=hurst, rms_increment=1.0, rng=rng).values
    return heights > np.quantile(heights, 1 - coverage)


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_pairs_against_shifted_planes(wraps):
    rng = np.random.default_rng(1)
    cells, valid = rng.random((13, 17)) < 0.4, rng.random((13, 17)) < 0.9
    from fractalcontact.base.grid import Grid

    grid = Grid((13, 17), (1.0, 1.0), wraps)
    seen = (cells & valid).astype(np.uint8)
    pairs, differing = _edges.count_pairs(seen, valid.astype(np.uint8), grid)
    for place, (down, right) in enumerate(_edges.OFFSETS):
        other, known = (np.roll(a, (-down, -right), (0, 1)) for a in (cells & valid, valid))
        both = valid & known
        y, x = np.indices(cells.shape)
        both &= wraps[0] | (y + down < 13)
        both &= wraps[1] | ((x + right < 17) & (x + right >= 0))
        assert pairs[:, place].sum() == both.sum()
        assert differing[:, place].sum() == (both & (other != (cells & valid))).sum()


def test_sides_are_those_of_the_islands():
    cells = level_set(50, 0.5, 0.3, np.random.default_rng(2))
    for wraps in ((False, False), (True, True)):
        mask = as_mask(cells, (1.0, 1.0), wraps)
        sides = int(fc.domains.boundary_dimension(mask).boundary_sides)
        assert sides == fc.domains.islands(mask).perimeter.sum()


def test_smooth_boundaries_have_dimension_one():
    y, x = np.indices((400, 400)) - 200
    planes = np.array([np.hypot(y, x) < 150, y < 30, x + 0.3 * y < 10])
    result = fc.domains.boundary_dimension(as_mask(planes))
    assert result.boundary_dimension.values == pytest.approx([1, 1, 1], abs=0.02)


def test_periodic_stripes_are_exact():
    cells = np.zeros((64, 64))
    cells[16:48] = 1
    assert (
        float(fc.domains.boundary_dimension(as_mask(cells, periodic=(True, True))).boundary_dimension) == 1.0
    )


def test_complement_and_mirror_have_the_same_boundary():
    cells = level_set(64, 0.5, 0.3, np.random.default_rng(3))
    values = [
        float(fc.domains.boundary_dimension(as_mask(c)).boundary_dimension)
        for c in (cells, ~cells, cells[:, ::-1], cells.T)
    ]
    assert values == pytest.approx([values[0]] * 4, rel=1e-14)


@pytest.mark.parametrize(("hurst", "allowed"), [(0.3, 0.012), (0.5, 0.02), (0.8, 0.06)])
def test_level_sets_of_brownian_surfaces(hurst, allowed):
    rng = np.random.default_rng(4)
    for _ in range(3):
        result = fc.domains.boundary_dimension(as_mask(brownian_level_set(512, hurst, rng)))
        assert abs(float(result.boundary_dimension) - (2 - hurst)) <= 2 * allowed
        assert float(result.ci_high) - float(result.ci_low) <= 8 * allowed


@pytest.mark.slow
@pytest.mark.parametrize(("hurst", "allowed"), [(0.3, 0.0075), (0.4, 0.009), (0.5, 0.0115), (0.8, 0.033)])
def test_error_on_level_sets_of_brownian_surfaces(hurst, allowed):
    rng = np.random.default_rng(5)
    planes = np.array([brownian_level_set(512, hurst, rng) for _ in range(200)])
    error = fc.domains.boundary_dimension(as_mask(planes)).boundary_dimension.values - (2 - hurst)
    # a smooth surface has a tilt that its level line follows, so the error has heavy tails for H near 1
    assert np.sqrt((error**2).mean()) <= allowed


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.1, 0.3, 0.5, 0.7, 0.8, 0.9])
def test_intervals_cover_the_truth(hurst):
    rng = np.random.default_rng(6)
    planes = np.array([brownian_level_set(192, hurst, rng, c) for c in (0.5, 0.2) for _ in range(150)])
    result = fc.domains.boundary_dimension(as_mask(planes))
    known = np.isfinite(result.ci_low.values)
    inside = (result.ci_low <= 2 - hurst) & (result.ci_high >= 2 - hurst)
    assert known.mean() > 0.9
    assert 0.92 <= inside.values[known].mean() <= 0.995


def test_gaps_leave_the_dimension_where_it_was():
    rng = np.random.default_rng(7)
    cells = brownian_level_set(256, 0.5, rng)
    whole = fc.domains.boundary_dimension(as_mask(cells))
    valid = rng.random((256, 256)) < 0.9
    gappy = fc.domains.boundary_dimension(as_mask(cells ^ ~valid), valid=as_mask(valid))
    assert float(gappy.boundary_dimension) == pytest.approx(float(whole.boundary_dimension), abs=0.03)


def test_without_a_boundary_or_with_little_of_it():
    planes = np.zeros((3, 30, 30), bool)
    planes[1] = planes[2, 10:20, 10:20] = True
    result = fc.domains.boundary_dimension(as_mask(planes))
    assert np.isnan(result.boundary_dimension.values[:2]).all()
    assert "no boundary (2 planes)" in result.boundary_dimension.attrs["comment"]
    assert np.isfinite(result.boundary_dimension[2])
    assert np.isnan(result.ci_low[2])
    assert "fewer than 200" in result.ci_low.attrs["comment"]


def test_unequal_spacings_are_no_trouble():
    heights = fc.surfaces.fbm((256, 256), (1.0, 2.0), hurst=0.5, rms_increment=1.0, rng=8)
    mask = heights > float(heights.median())
    assert isinstance(mask, xr.DataArray)
    assert float(fc.domains.boundary_dimension(mask).boundary_dimension) == pytest.approx(1.5, abs=0.06)
