"""Boundary dimension: level sets of exact Brownian surfaces, smooth edges, unobserved cells, limits."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import (
    DIMENSION,
    GENERATORS,
    aggregate,
    as_mask,
    fractal_percolation,
    koch_raster,
    lattice_set,
    level_set,
    percolating_cluster,
    random_lattice_set,
    random_null,
    ratio_of,
)

import fractalcontact as fc


def brownian_level_set(n, hurst, rng, coverage=0.5):
    heights = fc.surfaces.fbm((n, n), 1.0, hurst=hurst, rms_increment=1.0, rng=rng).values
    return heights > np.quantile(heights, 1 - coverage)


OFFSETS = [(0, 1), (1, 0), (1, 1), (1, -1)]


def differing_share(cells, valid, wraps, down, right):
    """Compare a plane with itself, shifted: the share of the observed pairs that differ."""
    ny, nx = cells.shape
    other, other_valid = (np.roll(plane, (-down, -right), (0, 1)) for plane in (cells, valid))
    pairs = valid & other_valid
    y, x = np.indices(cells.shape)
    pairs &= wraps[0] | (y + down < ny)
    pairs &= wraps[1] | ((x + right < nx) & (x + right >= 0))
    return (pairs & (other != cells)).sum() / pairs.sum()


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_dimension_and_sides_match_shifted_planes(wraps):
    rng = np.random.default_rng(1)
    for shape in ((26, 34), (32, 18), (30, 31)):
        # blocks of cells, so that set and complement have an interior
        blocks = np.kron(rng.random((6, 6)) < 0.4, np.ones((6, 6), bool))
        valid = rng.random(shape) < 0.9
        cells = blocks[: shape[0], : shape[1]] & valid
        single, double = (
            np.array(
                [differing_share(cells, valid, wraps, lag * down, lag * right) for down, right in OFFSETS]
            )
            for lag in (1, 2)
        )
        weights = single**-3.0
        slope = (weights * np.log2(double / single)).sum() / weights.sum()
        mask, observed = as_mask(cells, periodic=wraps), as_mask(valid, periodic=wraps)
        result = fc.domains.boundary_dimension(mask, valid=observed)
        assert float(result.boundary_dimension) == pytest.approx(2 - slope, rel=1e-12)
        down, right = (np.roll(cells, -1, axis) != cells for axis in (0, 1))
        both_down, both_right = (np.roll(valid, -1, axis) & valid for axis in (0, 1))
        rows, columns = slice(None if wraps[0] else -1), slice(None if wraps[1] else -1)
        sides = (down & both_down)[rows].sum() + (right & both_right)[:, columns].sum()
        assert int(result.boundary_sides) == sides


def sets_without_interior(n, rng):
    """Yield sets whose interior is empty: the pairs of cells measure them, and not a boundary."""
    for name in GENERATORS:
        yield lattice_set(name, int(np.log(n) / np.log(ratio_of(name))))
    yield koch_raster(n, rng)
    yield percolating_cluster(n, rng)
    yield aggregate(n, rng)
    for ratio, keeps in ((2, (2, 3)), (3, (4, 6, 7, 8)), (4, (5, 8, 11, 14)), (5, (8, 13, 18, 22))):
        for keep in keeps:
            yield random_lattice_set(keep, ratio, int(np.log(n) / np.log(ratio)), rng)
    for ratio, keep in ((2, 0.7), (2, 0.85), (3, 0.6)):
        yield fractal_percolation(keep, ratio, int(np.log(n) / np.log(ratio)), rng)
    yield random_null(n, n * n // 10, rng)


def test_sets_without_interior_are_refused_with_the_reason():
    assert DIMENSION["cantor_dust"] < 1.3  # measured as 2.7 from pairs at one and two steps
    rng = np.random.default_rng(9)
    for cells in sets_without_interior(300, rng):
        for part in (cells, ~np.asarray(cells, bool)):
            result = fc.domains.boundary_dimension(as_mask(part))
            assert np.isnan(result.boundary_dimension)
            assert np.isnan(result.ci_low)
            assert np.isnan(result.scale_min)
            assert "no interior" in result.boundary_dimension.attrs["comment"]
            assert int(result.boundary_sides) > 0


def test_sets_with_interior_are_measured_within_zero_and_two():
    rng = np.random.default_rng(10)
    planes = [brownian_level_set(192, h, rng, c) for h in (0.1, 0.3, 0.6, 0.9) for c in (0.5, 0.25)]
    result = fc.domains.boundary_dimension(as_mask(np.array(planes)))
    assert np.isfinite(result.boundary_dimension.values).all()
    for name in ("boundary_dimension", "ci_low", "ci_high"):
        assert result[name].min() >= 0
        assert result[name].max() <= 2


def test_unobserved_and_wrapping_cells_do_not_break_an_interior():
    y, x = np.indices((96, 96))
    disc = np.hypot(y - 48, x - 48) < 30
    rng = np.random.default_rng(11)
    valid = rng.random(disc.shape) < 0.8
    gappy = fc.domains.boundary_dimension(as_mask(disc & valid), valid=as_mask(valid))
    assert np.isfinite(gappy.boundary_dimension)
    corner = np.roll(np.hypot(y - 48, x - 48) < 3, (48, 48), (0, 1))  # four pieces without a 3 x 3 block
    pieces = [corner[:48, :48], corner[48:, :48]]
    assert max(piece.sum() for piece in pieces) < 20
    wrapped = fc.domains.boundary_dimension(as_mask(corner, periodic=(True, True)))
    assert np.isfinite(wrapped.boundary_dimension)


def test_boundary_sides_match_the_perimeter_of_islands():
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


def test_complement_and_mirror_have_the_same_dimension():
    cells = level_set(64, 0.5, 0.3, np.random.default_rng(3))
    values = [
        float(fc.domains.boundary_dimension(as_mask(c)).boundary_dimension)
        for c in (cells, ~cells, cells[:, ::-1], cells.T)
    ]
    assert values == pytest.approx([values[0]] * 4, rel=1e-14)


@pytest.mark.parametrize(("hurst", "allowed"), [(0.3, 0.012), (0.5, 0.02), (0.8, 0.06)])
def test_dimension_of_brownian_level_sets(hurst, allowed):
    rng = np.random.default_rng(4)
    for _ in range(3):
        result = fc.domains.boundary_dimension(as_mask(brownian_level_set(512, hurst, rng)))
        assert abs(float(result.boundary_dimension) - (2 - hurst)) <= 2 * allowed
        assert float(result.ci_high) - float(result.ci_low) <= 8 * allowed


@pytest.mark.slow
@pytest.mark.parametrize(("hurst", "allowed"), [(0.3, 0.0075), (0.4, 0.009), (0.5, 0.0115), (0.8, 0.033)])
def test_rms_error_on_brownian_level_sets(hurst, allowed):
    rng = np.random.default_rng(5)
    planes = np.array([brownian_level_set(512, hurst, rng) for _ in range(200)])
    error = fc.domains.boundary_dimension(as_mask(planes)).boundary_dimension.values - (2 - hurst)
    # a smooth surface has a tilt that its level line follows, so the error has heavy tails for H near 1
    assert np.sqrt((error**2).mean()) <= allowed


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.1, 0.3, 0.5, 0.7, 0.8, 0.9])
def test_interval_coverage_on_brownian_level_sets(hurst):
    rng = np.random.default_rng(6)
    planes = np.array([brownian_level_set(192, hurst, rng, c) for c in (0.5, 0.2) for _ in range(150)])
    result = fc.domains.boundary_dimension(as_mask(planes))
    has_interval = np.isfinite(result.ci_low.values)
    inside = (result.ci_low <= 2 - hurst) & (result.ci_high >= 2 - hurst)
    assert has_interval.mean() > 0.9
    assert 0.92 <= inside.values[has_interval].mean() <= 0.995


def test_unobserved_cells_change_the_dimension_little():
    rng = np.random.default_rng(7)
    cells = brownian_level_set(256, 0.5, rng)
    complete = fc.domains.boundary_dimension(as_mask(cells))
    valid = rng.random((256, 256)) < 0.9
    gappy = fc.domains.boundary_dimension(as_mask(cells ^ ~valid), valid=as_mask(valid))
    assert float(gappy.boundary_dimension) == pytest.approx(float(complete.boundary_dimension), abs=0.03)


def test_missing_or_short_boundary_is_nan_with_a_reason():
    planes = np.zeros((3, 30, 30), bool)
    planes[1] = planes[2, 9:13, 9:13] = True
    result = fc.domains.boundary_dimension(as_mask(planes))
    assert np.isnan(result.boundary_dimension.values[:2]).all()
    assert "no boundary (2 planes)" in result.boundary_dimension.attrs["comment"]
    assert np.isfinite(result.boundary_dimension[2])
    assert np.isnan(result.ci_low[2])
    assert "one of the 16 blocks" in result.ci_low.attrs["comment"]


def test_interval_of_a_short_boundary_covers_the_dimension():
    rng = np.random.default_rng(8)
    inside = []
    for hurst in (0.5, 0.7, 0.9):
        for _ in range(40):
            result = fc.domains.boundary_dimension(as_mask(brownian_level_set(32, hurst, rng)))
            if result.boundary_sides < 200 and np.isfinite(result.ci_low):
                inside.append(float(result.ci_low) <= 2 - hurst <= float(result.ci_high))
    assert len(inside) > 50
    assert np.mean(inside) >= 0.9


def test_cells_that_alternate_have_no_interior():
    y, x = np.indices((60, 60))
    for cells in ((x + y) % 2, x % 2):
        result = fc.domains.boundary_dimension(as_mask(cells))
        assert np.isnan(result.boundary_dimension)
        assert int(result.boundary_sides) > 1000
        comment = result.boundary_dimension.attrs["comment"]
        assert "no interior" in comment
        assert "no boundary (" not in comment


def test_unequal_spacings():
    heights = fc.surfaces.fbm((256, 256), (1.0, 2.0), hurst=0.5, rms_increment=1.0, rng=8)
    mask = heights > float(heights.median())
    assert isinstance(mask, xr.DataArray)
    assert float(fc.domains.boundary_dimension(mask).boundary_dimension) == pytest.approx(1.5, abs=0.06)


def test_surface_with_one_short_axis_beside_a_periodic_one():
    heights = np.random.default_rng(1).random((8, 64))
    mask = fc.surfaces.from_array(heights, 1.0, periodic=(False, True)) > 0.1
    turned = fc.surfaces.from_array(heights.T.copy(), 1.0, periodic=(True, False)) > 0.1
    one, other = (float(fc.domains.boundary_dimension(each).boundary_dimension) for each in (mask, turned))
    assert one == pytest.approx(other, nan_ok=True)
