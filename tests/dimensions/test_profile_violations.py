"""Profiles that instruments filter, sample and round: the interval holds the exponent, or there is none."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import fractalcontact as fc

SPACING, STEP = 1e-4, 1e-6


def profile(points, hurst, rng, margin=0):
    """Exact fractional Brownian profile with unit increments, and `margin` points beyond either end."""
    shape = (points + 2 * margin,)
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=STEP, rng=rng).values / STEP


def interval(heights):
    result = fc.dimensions.estimate(fc.surfaces.from_array(STEP * heights, SPACING)).isel(method=0)
    return float(result.ci_low), float(result.ci_high), result.hurst.attrs.get("comment", "")


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_moving_mean_is_no_gaussian_filter(hurst):
    """Of a Gaussian filter, by which the exponent was 0.1 too small, with an interval of 0.15."""
    for rng in range(3):
        heights = np.convolve(profile(2048, hurst, rng, 2), np.full(5, 0.2), "valid")
        low, high, note = interval(heights)
        assert low < hurst < high < low + 0.45
        assert "Gaussian" in note


@pytest.mark.parametrize("kind", ["points", "block"])
def test_gaps_beside_noise_or_blur(kind):
    random = np.random.default_rng([3, 7])
    noisy = profile(512, 0.7, 7) + 0.3 * random.standard_normal(512)
    blurred = gaussian_filter1d(profile(512, 0.7, 7, 8), 1.0)[8:-8]
    for heights in (noisy, blurred):
        missing = random.permutation(512)[:26] if kind == "points" else np.arange(200, 300)
        heights[missing] = np.nan
        low, high, _ = interval(heights)
        assert low < 0.7 < high < low + 0.6


@pytest.mark.parametrize("noise", [False, True])
def test_known_blur_beside_gaps(noise):
    """As a filter of fractional Brownian heights, and not as heights smoother than these."""
    heights = gaussian_filter1d(profile(512, 0.7, 7, 8), 1.0)[8:-8]
    heights[200:300] = np.nan
    surface = fc.surfaces.from_array(STEP * heights, SPACING)
    result = fc.dimensions.estimate(surface, psf=SPACING, noise=noise).isel(method=0)
    assert result.ci_low < 0.7 < result.ci_high < result.ci_low + 0.5
    assert result.blur_spread == pytest.approx(SPACING)
    within = fc.dimensions.estimate(surface, psf=SPACING, noise=noise, scales=(SPACING, 2e-3)).isel(method=0)
    assert np.isnan([within.ci_low, within.ci_high]).all()
    assert "leave out `psf`" in within.ci_low.attrs["reason"]


def test_step_of_a_profile_is_taken_out():
    heights = profile(512, 0.3, 4)
    heights[200:] += 50.0
    low, high, note = interval(heights)
    assert low < 0.3 < high < low + 0.45
    assert "1 increments beyond" in note


def test_coarsely_rounded_profile_has_no_interval():
    heights = 6.0 * np.rint(profile(512, 0.7, 5) / 6.0)
    low, high, note = interval(heights)
    assert np.isnan([low, high]).all()
    assert "rounded to steps larger" in note


@pytest.mark.parametrize("method", ["higuchi", "detrended_fluctuation"])
def test_other_methods_allow_for_what_a_profile_does_not_show(method):
    """Noise of 0.3 increments is not seen in this profile, and lowers its exponent."""
    noisy = profile(512, 0.7, 8) + 0.3 * np.random.default_rng(8).standard_normal(512)
    surface = fc.surfaces.from_array(STEP * noisy, SPACING)
    result = fc.dimensions.estimate(surface, ["likelihood", method])
    low, high = result.ci_low.values, result.ci_high.values
    assert low[1] <= low[0]
    assert high[1] >= high[0] > 0.7


def test_roughness_profile_between_two_gaussian_filters():
    """ISO 16610-21: waves from 5 spacings to an 8th of the length; the exponent was 0.2 too small."""
    for rng in range(2):
        heights = gaussian_filter1d(profile(512, 0.7, rng, 130), 0.1874 * 5.0, truncate=6.0)
        low, high, note = interval(
            (heights - gaussian_filter1d(heights, 0.1874 * 64.0, truncate=6.0))[130:-130]
        )
        assert low < 0.7 < high
        assert "high-pass filter" in note
