"""Map of the Hurst exponent: each window as a surface of its own, two exponents, gaps, dask, limits."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

SPACING = 1e-4


def brownian(shape, hurst, seed, **options):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=1e-6, rng=seed, **options)


def test_each_window_is_estimated_as_a_surface():
    surface = brownian((64, 80), 0.6, 1)
    result = fc.dimensions.hurst_map(surface, 32 * SPACING, step=16 * SPACING)
    assert result.hurst.shape == (3, 4)
    for row, column in ((0, 0), (2, 3), (1, 2)):
        part = surface.isel(y=slice(16 * row, 16 * row + 32), x=slice(16 * column, 16 * column + 32))
        alone = fc.dimensions.estimate(part, "increments").sel({"method": "increments"})
        here = result.isel(y=row, x=column)
        for name in ("hurst", "ci_low", "ci_high", "fractal_dimension"):
            assert float(here[name]) == pytest.approx(float(alone[name]), rel=1e-12)
        assert float(here.x) == pytest.approx(float(part.x.mean()))
        assert float(here.y) == pytest.approx(float(part.y.mean()))


def test_two_exponents_side_by_side():
    rough, smooth = brownian((64, 64), 0.2, 2), brownian((64, 64), 0.8, 3)
    both = fc.surfaces.from_array(np.concatenate([rough.values, smooth.values], axis=1), SPACING)
    hurst = fc.dimensions.hurst_map(both, 32 * SPACING, step=32 * SPACING).hurst.values
    assert hurst[:, :2].mean() == pytest.approx(0.2, abs=0.06)
    assert hurst[:, 2:].mean() == pytest.approx(0.8, abs=0.06)


def test_gaps_are_nan_and_dask_gives_the_same():
    surface = brownian((64, 64), 0.5, 4)
    surface[:40, :40] = np.nan
    result = fc.dimensions.hurst_map(surface, 32 * SPACING)
    assert np.isnan(result.hurst.values[0, 0])
    assert np.isfinite(result.hurst.values[-1, -1])
    pytest.importorskip("dask")
    chunked = fc.dimensions.hurst_map(surface.chunk({"y": 24, "x": 24}), 32 * SPACING)
    np.testing.assert_array_equal(chunked.hurst.values, result.hurst.values)


def test_stack_and_limits():
    stack = brownian((32, 32), 0.5, 5, members=2)
    result = fc.dimensions.hurst_map(stack, 16 * SPACING)
    assert result.hurst.dims == ("member", "y", "x")
    alone = fc.dimensions.hurst_map(stack.isel(member=1), 16 * SPACING)
    np.testing.assert_array_equal(result.hurst.values[1], alone.hurst.values)
    for window in (8 * SPACING, 64 * SPACING, -1.0):
        with pytest.raises(InvalidInput, match="window"):
            fc.dimensions.hurst_map(stack, window)


def test_blurred_windows_have_no_interval_and_the_reason():
    rng = np.random.default_rng(5)
    sharp = brownian((128, 128), 0.5, 6)
    blurred = sharp.copy(data=gaussian_filter(sharp.values, 0.7))
    result = fc.dimensions.hurst_map(blurred, 32 * SPACING)
    assert np.isnan(result.ci_low).all()
    assert "scales" in result.ci_low.attrs["reason"]
    # lags beyond the blur have an interval, which holds the exponent in most windows
    longer = fc.dimensions.hurst_map(blurred, 64 * SPACING, scales=(8 * SPACING, 32 * SPACING))
    inside = (longer.ci_low < 0.5) & (longer.ci_high > 0.5)
    assert inside.mean() > 0.8
    # a single wave is taken out of all windows, and named
    y, x = np.mgrid[:128, :128]
    marked = sharp + 1e-6 * np.sin(2.0 * np.pi * (0.13 * x + 0.09 * y) + rng.uniform(0.0, 6.0))
    result = fc.dimensions.hurst_map(marked, 32 * SPACING)
    assert "wave" in result.hurst.attrs["comment"]
    assert ((result.ci_low < 0.5) & (result.ci_high > 0.5)).mean() > 0.85
    exact = fc.dimensions.hurst_map(sharp, 32 * SPACING)
    assert "reason" not in exact.ci_low.attrs


def test_noise_that_no_window_shows_bends_all_of_them():
    """With intervals for fractional Brownian heights, .6 of the windows hold the exponent."""
    surface = brownian((128, 128), 0.7, 1)
    noisy = surface + 3e-7 * np.random.default_rng(1).standard_normal((128, 128))
    result = fc.dimensions.hurst_map(noisy, 32 * SPACING)
    # each window judges its own lags: those that see the noise have no interval
    assert np.isnan(result.ci_low).any() or ((result.ci_low < 0.7) & (result.ci_high > 0.7)).mean() > 0.5
