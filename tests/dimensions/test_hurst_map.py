"""Map of the Hurst exponent: each window as a surface of its own, two exponents, gaps, dask, limits."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

SPACING = 1e-4


def brownian(shape, hurst, seed, **options):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=1e-6, rng=seed, **options)


def share_held(result, hurst):
    """Share of all windows whose interval holds the exponent."""
    return float(((result.ci_low < hurst) & (result.ci_high > hurst)).mean())


def test_windows_agree_with_estimates_of_their_parts():
    surface = brownian((128, 160), 0.6, 1)
    result = fc.dimensions.hurst_map(surface, 64 * SPACING, step=32 * SPACING)
    assert result.hurst.shape == (3, 4)
    np.testing.assert_allclose(result.fractal_dimension, 3.0 - result.hurst)
    for row, column in ((0, 0), (2, 3), (1, 2)):
        part = surface.isel(y=slice(32 * row, 32 * row + 64), x=slice(32 * column, 32 * column + 64))
        alone = fc.dimensions.estimate(part).sel({"method": "default"})
        here = result.isel(y=row, x=column)
        # alone, a blur or noise that are not there cannot be excluded as well
        assert abs(float(here.hurst - alone.hurst)) < float(alone.standard_error)
        assert float(here.x) == pytest.approx(float(part.x.mean()))
        assert float(here.y) == pytest.approx(float(part.y.mean()))


def test_one_window_is_the_estimate_of_the_surface():
    for hurst in (0.3, 0.7):
        surface = brownian((96, 96), hurst, 3)
        whole = fc.dimensions.estimate(surface).sel({"method": "default"})
        window = fc.dimensions.hurst_map(surface, 96 * SPACING).squeeze()
        assert float(window.hurst) == pytest.approx(float(whole.hurst), abs=0.3 * float(whole.standard_error))
        width = float(window.ci_high - window.ci_low) / float(whole.ci_high - whole.ci_low)
        assert width == pytest.approx(1.0, abs=0.25)


def test_unit_of_height_does_not_matter():
    surface = brownian((64, 64), 0.5, 8)
    first, second = (fc.dimensions.hurst_map(s, 32 * SPACING) for s in (surface, surface * 2.0**-40))
    np.testing.assert_array_equal(first.hurst, second.hurst)


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


@pytest.mark.parametrize(("spread", "noise", "gaps"), [(0.7, 0.0, 0.0), (1.0, 0.0, 0.1), (0.7, 0.05, 0.0)])
def test_intervals_hold_under_blur_noise_and_gaps(spread, noise, gaps):
    stream = np.random.default_rng(5)
    heights = gaussian_filter(brownian((144, 144), 0.5, 6).values, spread)[8:-8, 8:-8]
    heights += noise * 1e-6 * stream.standard_normal(heights.shape)
    heights[stream.random(heights.shape) < gaps] = np.nan
    result = fc.dimensions.hurst_map(fc.surfaces.from_array(heights, SPACING), 32 * SPACING)
    assert share_held(result, 0.5) > 0.9
    assert float((result.ci_high - result.ci_low).median()) < 0.5


def test_lengths_in_metres_are_those_of_unequal_spacings():
    heights = brownian((128, 256), 0.5, 6)
    fine = gaussian_filter(brownian((280, 280), 0.5, 6).values, 0.7)[12:-12, 12:-12]
    blurred = np.ascontiguousarray(fine[::2])
    result = fc.dimensions.hurst_map(fc.surfaces.from_array(blurred, (2.0 * SPACING, SPACING)), 64 * SPACING)
    assert share_held(result, 0.5) > 0.9
    longer = fc.dimensions.hurst_map(heights, 64 * SPACING, scales=(6 * SPACING, 32 * SPACING))
    assert share_held(longer, 0.5) > 0.9


def test_waves_are_taken_out_of_all_windows():
    y, x = np.mgrid[:128, :128]
    marked = brownian((128, 128), 0.5, 6) + 1e-6 * np.sin(2.0 * np.pi * (0.13 * x + 0.09 * y) + 1.0)
    result = fc.dimensions.hurst_map(marked, 32 * SPACING)
    assert "wave" in result.hurst.attrs["comment"]
    assert share_held(result, 0.5) > 0.85


def test_a_step_widens_the_windows_that_it_crosses():
    """An oblique step of 30 rms increments; one along an axis is in modes that are not used."""
    y, x = np.mgrid[:128, :128]
    surface = brownian((128, 128), 0.5, 8)
    result = fc.dimensions.hurst_map(surface + 3e-5 * (3 * x + y > 180), 32 * SPACING)
    width = (result.ci_high - result.ci_low).values
    assert width[2:4, 1:3].min() > 2.0 * np.median(width[:, -2:])
    assert share_held(result, 0.5) > 0.85
    along_axis = fc.dimensions.hurst_map(surface + 3e-5 * (x > 70), 32 * SPACING)
    np.testing.assert_allclose(
        along_axis.hurst, fc.dimensions.hurst_map(surface, 32 * SPACING).hurst, atol=1e-3
    )


def test_interpolated_heights_have_no_interval_and_the_reason():
    heights = brownian((64, 64), 0.5, 8).values
    between = 0.5 * (heights[:, 1:] + heights[:, :-1])
    doubled = np.empty((64, 127))
    doubled[:, ::2], doubled[:, 1::2] = heights, between
    result = fc.dimensions.hurst_map(fc.surfaces.from_array(doubled, SPACING), 32 * SPACING)
    assert np.isnan(result.ci_low).all()
    assert "interpolated" in result.ci_low.attrs["reason"]


def test_planes_and_constant_windows():
    heights = brownian((64, 64), 0.5, 9).values.copy()
    heights[:32, :32] = 1e-6
    heights[32:, 32:] = 1e-7 * np.arange(32.0)
    result = fc.dimensions.hurst_map(
        fc.surfaces.from_array(heights, SPACING), 32 * SPACING, step=32 * SPACING
    )
    assert np.isnan(result.hurst[0, 0])
    assert float(result.hurst[1, 1]) == 1.0
    assert np.isnan(result.ci_low.values[[0, 1], [0, 1]]).all()
    flat = fc.dimensions.hurst_map(fc.surfaces.from_array(np.ones((32, 32)), SPACING), 16 * SPACING)
    assert np.isnan(flat.hurst).all()
    assert "constant" in flat.ci_low.attrs["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_coverage_of_exact_surfaces(hurst):
    held = [
        share_held(fc.dimensions.hurst_map(brownian((128, 128), hurst, k), 32 * SPACING), hurst)
        for k in range(30)
    ]
    assert 0.92 < np.mean(held) < 0.985


def test_no_unit_of_length_moves_a_window():
    """A window of 20.5 points has 20 in every unit, and a step of 8.5 has 8."""
    rough = fc.surfaces.fbm((97, 60), 1.0, hurst=0.6, rms_increment=1e-2, rng=1).values
    shapes = {
        fc.dimensions.hurst_map(
            fc.surfaces.from_array(unit * rough, unit), 20.5 * unit, step=8.5 * unit
        ).hurst.shape
        for unit in (1.0, 1e-3, 7e-5, 0.07, 1.1)
    }
    assert len(shapes) == 1


@pytest.mark.parametrize("scales", [(4e-3, 1e-2), (1e-4, 1.5e-4)])
def test_scales_without_modes_are_named(scales):
    """Once "give more points", and of the exponent that heights do not vary."""
    rough = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.6, rms_increment=1e-6, rng=1)
    windows = fc.dimensions.hurst_map(rough, 3.2e-3, scales=scales)
    directions = fc.dimensions.directions(rough, scales=scales)
    named = f"too few modes between {scales[0]:g} m and {scales[1]:g} m"
    for result, names in (
        (windows, ("hurst", "ci_low", "fractal_dimension")),
        (directions, ("hurst", "ci_low")),
    ):
        for name in names:
            assert np.isnan(result[name]).all()
            assert result[name].attrs["reason"] == named
