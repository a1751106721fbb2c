"""Exponent by octave, and the window of scales that has one exponent."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from tests.dimensions.test_likelihood import noisy_surface

SPACING = 1e-4


def brownian(hurst, step, rng, shape=(256, 256)):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=step, rng=rng).values


def scaling(heights):
    return fc.dimensions.scaling(fc.surfaces.from_array(heights, SPACING))


def test_fractional_brownian_surface_has_one_window():
    result = scaling(brownian(0.6, 1e-6, 1))
    assert result.in_window.all()
    assert float(result.window_ci_low) < 0.6 < float(result.window_ci_high)
    assert ((result.ci_low < 0.6) & (result.ci_high > 0.6)).mean() > 0.7
    assert int(result.mode_count.sum()) == 255**2
    assert float(result.scale_min) < 2 * SPACING < float(result.scale_max)


def test_white_noise_has_no_window():
    noise = np.random.default_rng(1).standard_normal((256, 256))
    result = scaling(1e-6 * noise)
    assert float(result.hurst[0]) == pytest.approx(0.0, abs=0.05)  # sampled without limit of the band
    assert (result.hurst[1:5] < 0.0).all()
    assert np.isnan(result.window_hurst)
    assert not result.in_window.any()


def test_sum_of_two_surfaces_shows_the_exponent_of_each_end():
    rough, smooth = brownian(0.2, 1e-6, 3), brownian(0.9, 3e-7, 2)
    result = scaling(rough + smooth)
    assert float(result.hurst[0]) < 0.35
    assert float(result.hurst[3:].mean()) > 0.5
    assert not result.in_window.all()


def test_periodic_surface_with_rolloff():
    surface = fc.surfaces.spectral(
        (256, 256), SPACING, hurst=0.7, rms_height=1e-6, rolloff=32 * SPACING, rng=2
    )
    result = fc.dimensions.scaling(surface)
    assert float(result.window_hurst) == pytest.approx(0.7, abs=0.03)
    assert float(result.scale_max) == pytest.approx(32 * SPACING, rel=0.01)


def test_crop_of_a_periodic_surface_is_measured_without_aliases():
    """Once .9 for .3 in the shortest octave, and .37 for .3 in a window from 3 spacings on."""
    whole = fc.surfaces.spectral(
        (320, 320), SPACING, hurst=0.3, rms_height=1e-6, rolloff=20 * SPACING, rng=2, members=4
    )
    crops = fc.surfaces.from_array(whole.values[:, :160, :160], SPACING)
    result = fc.dimensions.scaling(crops)
    assert (result.in_window[:, :2]).all()
    assert ((result.ci_low < 0.3) & (result.ci_high > 0.3))[:, :2].mean() > 0.7
    window = fc.dimensions.estimate(crops, scales=(3 * SPACING, 16 * SPACING)).isel(method=0)
    assert ((window.ci_low < 0.3) & (window.ci_high > 0.3)).sum() >= 3
    assert float((window.ci_high - window.ci_low).max()) < 0.1
    assert "no waves shorter than two spacings" in window.hurst.attrs["comment"]


@pytest.mark.parametrize("tilt", [0.0, 1e-6])
def test_profile_is_not_changed_by_a_tilt(tilt):
    heights = brownian(0.5, 1e-6, 2, (1000,))
    result = scaling(heights + tilt * np.arange(1000))
    assert float(result.window_hurst) == pytest.approx(0.5, abs=0.06)
    np.testing.assert_allclose(result.hurst, scaling(heights).hurst, atol=1e-6)


def test_coverage_of_octaves():
    rng = np.random.default_rng(5)
    surfaces = fc.surfaces.fbm((64, 64), SPACING, hurst=0.4, rms_increment=1e-6, members=100, rng=rng)
    result = fc.dimensions.scaling(surfaces)
    held = (result.ci_low < 0.4) & (result.ci_high > 0.4)
    assert (held[:, :3].mean("member") > 0.88).all()
    assert result.in_window.all("wavelength").mean() > 0.95


def test_many_gaps_are_refused():
    heights = brownian(0.5, 1e-6, 1, (32, 32)).copy()
    heights[:, :17] = np.nan
    with pytest.raises(ValueError, match="at least half of the heights"):
        scaling(heights)
    with pytest.raises(ValueError, match="fill"):
        fc.dimensions.scaling(fc.surfaces.from_array(heights, SPACING).isel(y=0))


def test_estimate_reports_the_window_of_a_surface_with_two_exponents():
    heights = brownian(0.2, 1e-6, 3) + brownian(0.9, 2e-7, 2)
    result = fc.dimensions.estimate(fc.surfaces.from_array(heights, SPACING)).isel(method=0)
    window = scaling(heights)
    if "no single exponent" in result.hurst.attrs["comment"]:
        assert float(result.hurst) == pytest.approx(float(window.window_hurst))
    assert float(result.ci_high - result.ci_low) < 0.7


def test_window_beside_a_blur_holds_the_exponent():
    """Without the octave that the blur still bends: with it no interval holds 0.5."""
    inside = 0
    for seed in range(12):
        surface = fc.surfaces.fbm((160, 160), 1e-4, hurst=0.5, rms_increment=1e-6, rng=300 + seed)
        blurred = surface.copy(data=gaussian_filter(surface.values, 1.2))[16:-16, 16:-16]
        result = fc.dimensions.scaling(blurred)
        assert not bool(result.in_window[0])
        inside += float(result.window_ci_low) <= 0.5 <= float(result.window_ci_high)
    assert inside >= 9


def test_blur_is_not_taken_for_missing_aliases():
    """A filter of half a spacing looks like a crop of a periodic surface with an exponent .04 larger."""
    inside = 0
    for seed in range(4):
        surface = fc.surfaces.fbm((144, 144), 1e-4, hurst=0.3, rms_increment=1e-6, rng=400 + seed)
        blurred = surface.copy(data=gaussian_filter(surface.values, 0.5))[8:-8, 8:-8]
        result = fc.dimensions.scaling(blurred)
        assert float(result.hurst[0]) > 0.7
        inside += float(result.window_ci_low) <= 0.3 <= float(result.window_ci_high)
    assert inside >= 3


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_steps_and_levelled_rows_that_octaves_do_not_show(hurst):
    y, x = np.mgrid[:128, :128]
    across = np.linspace(-1.0, 1.0, 128)
    columns = np.vander(across, 3)
    for seed in (1, 2):
        surface = fc.surfaces.fbm((128, 128), 1e-6, hurst=hurst, rms_increment=1e-7, rng=seed)
        step = surface + 5e-7 * (0.6 * x + 0.8 * y > 85)
        parabolas = columns @ np.linalg.lstsq(columns, surface.values.T, rcond=None)[0]
        for marked, word in ((step, "steps"), (surface - parabolas.T, "levelled")):
            result = fc.dimensions.scaling(marked)
            assert result.window_ci_low.item() < hurst < result.window_ci_high.item()
            assert word in result.window_hurst.attrs["comment"]


def test_the_interval_holds_noise_that_no_octave_shows():
    held = []
    for seed in range(8):
        result = fc.dimensions.scaling(noisy_surface(seed, 0.3))
        held.append(result.window_ci_low.item() < 0.4 < result.window_ci_high.item())
    assert sum(held) >= 7
