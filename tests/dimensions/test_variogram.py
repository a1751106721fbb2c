"""Variogram, madogram and second variogram against loops over pairs."""

import numpy as np
import pytest

import fractalcontact as fc


def surface_of(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


def pairs(heights, spacing, periodic, longest):
    """Distance, squared increment of every pair of points within reach, by loops over lags."""
    ny, nx = heights.shape
    result = {}
    for dy in range(-ny + 1, ny):
        for dx in range(-nx + 1, nx):
            h = np.hypot(dy * spacing[0], dx * spacing[1])
            if not 0 < h <= longest or (dy, dx) < (0, 0):
                continue
            moved = np.roll(heights, (-dy, -dx), axis=(0, 1))
            keep = np.ones(heights.shape, dtype=bool)
            if not periodic:
                keep[max(ny - dy, 0) :], keep[: max(-dy, 0)] = False, False
                keep[:, max(nx - dx, 0) :], keep[:, : max(-dx, 0)] = False, False
            d = (moved - heights)[keep]
            d = d[np.isfinite(d)]
            key = round(h / max(spacing), 9)
            total, number = result.get(key, (0.0, 0))
            result[key] = (total + np.sum(d**2), number + d.size)
    return result


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("longest", [2.5e-3, None])
def test_variogram_equals_loop_over_pairs(periodic, longest):
    rng = np.random.default_rng(2)
    heights = rng.standard_normal((20, 17)).cumsum(axis=0)
    heights[rng.random(heights.shape) < 0.1] = np.nan
    spacing = (1e-3, 5e-4)
    curve = fc.dimensions.variogram(surface_of(heights, spacing, periodic), max_lag=longest)
    assert float(curve.lag.max()) <= (longest or 0.5 * min(20e-3, 8.5e-3)) * (1 + 1e-9)
    direct = pairs(heights, spacing, periodic, min(float(curve.lag.max()), 4e-3) * 1.0001)
    for lag in curve.lag.values[curve.lag.values <= 4e-3]:
        total, number = direct[round(lag / 1e-3, 9)]
        at = curve.sel(lag=lag)
        assert float(at.variogram) == pytest.approx(0.5 * total / number, rel=1e-11)
        assert int(at.pair_count) == number


def test_direct_sums_equal_transforms(rough):
    complete = fc.dimensions.variogram(rough)
    short = fc.dimensions.variogram(rough, max_lag=6e-3)
    same = complete.sel(lag=short.lag.values, method="nearest", tolerance=1e-9)
    np.testing.assert_allclose(same.variogram, short.variogram, rtol=1e-10)
    np.testing.assert_array_equal(same.pair_count, short.pair_count)


def test_variogram_of_plane_wave_and_plane():
    n, k = 64, 5
    x = np.arange(n) / n
    wave = surface_of(np.tile(np.cos(2 * np.pi * k * x), (n, 1)), 1.0 / n, periodic=True)
    curve = fc.dimensions.variogram(wave, max_lag=1.0 / n)
    # the lag of one spacing stands for (1, 0) and (0, 1), and along the crests nothing changes
    assert float(curve.variogram[0]) == pytest.approx(0.25 * (1 - np.cos(2 * np.pi * k / n)), rel=1e-12)
    y = np.arange(30)
    plane = fc.dimensions.variogram(surface_of(np.add.outer(0.2 * y, 0.1 * y), 1.0), max_lag=1.0)
    assert float(plane.variogram[0]) == pytest.approx(0.25 * (0.04 + 0.01), rel=1e-12)
    tilted = fc.dimensions.variogram(surface_of(np.add.outer(0.0 * y, 0.1 * y), 1.0))
    np.testing.assert_allclose(tilted.local_slope[:3], 2.0, atol=0.35)


@pytest.mark.parametrize(("increments", "name"), [("absolute", "madogram"), ("second", "second_variogram")])
@pytest.mark.parametrize("periodic", [False, True])
def test_increments_along_axes_equal_numpy(increments, name, periodic):
    rng = np.random.default_rng(3)
    heights = rng.standard_normal((33, 41))
    heights[rng.random(heights.shape) < 0.05] = np.nan
    curve = fc.dimensions.variogram(surface_of(heights, 1e-3, periodic), increments=increments)
    order = 2 if name == "second_variogram" else 1
    for lag in (1, 2, 3):
        values = []
        for axis in (0, 1):
            d = heights
            for _ in range(order):
                n = d.shape[axis]
                moved = np.roll(d, -lag, axis)
                d = moved - d if periodic else (moved - d).take(range(n - lag), axis)
            values.append(d[np.isfinite(d)])
        values = np.concatenate(values)
        expected = np.mean(values**2) if order == 2 else 0.5 * np.mean(np.abs(values))
        at = curve.sel(lag=lag * 1e-3, method="nearest")
        assert float(at[name]) == pytest.approx(expected, rel=1e-12)
        assert int(at.pair_count) == values.size


@pytest.mark.parametrize("increments", ["square", "absolute", "second"])
def test_periodic_lags_end_at_half_period(increments):
    surface = fc.surfaces.spectral(60, 1e-3, hurst=0.6, rms_height=1e-5, rng=3)
    curve = fc.dimensions.variogram(surface, increments=increments, max_lag=0.05)
    assert 0.02 < float(curve.lag.max()) <= 0.03 * (1 + 1e-9)


def test_pairs_half_a_period_apart_count_once():
    """A lag of half a period along y is its own opposite, and (6, 3) is the opposite of (6, -3)."""
    heights = np.random.default_rng(8).standard_normal((12, 17)).cumsum(0)
    for surface in (surface_of(heights, 1e-3, (True, True)), surface_of(heights.T, 1e-3, (True, True))):
        curve = fc.dimensions.variogram(surface)  # few lags are summed directly
        values = surface.values if surface.sizes["y"] == 12 else surface.values.T
        lags = [(y, x) for y in range(7) for x in range(-8, 9) if (y, x) > (0, 0) and np.hypot(y, x) <= 6.0]
        squares = {}
        for y, x in lags:
            numbers = np.arange(values.size).reshape(values.shape)
            ahead = np.roll(numbers, (-y, -x), (0, 1))
            ring = np.hypot(y, x) if np.hypot(y, x) <= 4.5 else float(np.floor(np.hypot(y, x) + 0.5))
            pairs = np.sort(np.stack([numbers.ravel(), ahead.ravel()], axis=1), axis=1)
            squares.setdefault(round(ring, 9), []).append(pairs)
        for lag, (_, pairs) in enumerate(sorted(squares.items())):
            distinct = np.unique(np.concatenate(pairs), axis=0)
            difference = values.ravel()[distinct[:, 1]] - values.ravel()[distinct[:, 0]]
            assert int(curve.pair_count[lag]) == len(distinct)
            assert float(curve.variogram[lag]) == pytest.approx(0.5 * np.mean(difference**2), rel=1e-9)


def test_slender_surface_uses_all_pairs():
    heights = np.random.default_rng(5).standard_normal((6, 80)).cumsum(axis=1)
    curve = fc.dimensions.variogram(surface_of(heights), max_lag=0.06)
    assert float(curve.lag.max()) > 0.059
    squares, number = 0.0, 0
    for dy in range(6):
        for dx in range(-79, 80):
            if 0 < np.hypot(dx, dy) <= 60 and (dy > 0 or dx > 0):
                here = heights[dy:, max(dx, 0) : 80 + min(dx, 0)]
                there = heights[: 6 - dy, max(-dx, 0) : 80 - max(dx, 0)]
                squares, number = squares + np.sum((here - there) ** 2), number + here.size
    assert int(curve.pair_count.sum()) == number
    assert float((2 * curve.variogram * curve.pair_count).sum()) == pytest.approx(squares, rel=1e-10)


def test_second_differences_ignore_plane(rough):
    tilted = rough + 0.3 * rough.x - 0.2 * rough.y
    tilted.attrs = rough.attrs
    first, second = (fc.dimensions.variogram(z, increments="second") for z in (rough, tilted))
    np.testing.assert_allclose(second.second_variogram, first.second_variogram, rtol=1e-8)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("n", [200, 201])
def test_many_complete_profiles_against_sums_over_pairs(periodic, n):
    lines = np.random.default_rng(1).normal(size=(3, n)).cumsum(axis=1) * [[1e-6], [1.0], [1e3]] + 7.0
    single = fc.surfaces.from_array(lines[0], 0.5, periodic=periodic)
    stack = single.expand_dims(line=3).copy(data=lines)
    curve = fc.dimensions.variogram(stack)
    steps = np.arange(1, n // 2 + 1)
    np.testing.assert_allclose(curve.lag, 0.5 * steps, rtol=1e-14)
    for line, values in zip(lines, curve.variogram.values, strict=True):
        for h, value in zip(steps, values, strict=True):
            ahead = np.roll(line, -h) if periodic else line[h:]
            expected = 0.5 * np.mean((ahead - (line if periodic else line[:-h])) ** 2)
            assert value == pytest.approx(expected, rel=1e-9)
    pairs = np.full(steps.size, n) if periodic else n - steps
    pairs = np.where(periodic & (2 * steps == n), n // 2, pairs)
    np.testing.assert_array_equal(curve.pair_count.values, np.broadcast_to(pairs, curve.pair_count.shape))
    gap = stack.copy(data=np.where(np.arange(n) == 5, np.nan, lines))
    alone = [fc.dimensions.variogram(gap.isel(line=k)).variogram.values for k in range(3)]
    np.testing.assert_allclose(fc.dimensions.variogram(gap).variogram.values, alone, rtol=1e-12)
