"""Surfaces that were filtered by something else than a Gaussian: once a confident wrong exponent."""

import numpy as np
import pytest
from scipy import ndimage

import fractalcontact as fc

SPACING, STEP, SIZE = 1e-4, 1e-6, 128
TEXT = "a filter that is no Gaussian blur"


def ball(radius):
    """Depth of a ball below its lowest point, around it."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    with np.errstate(invalid="ignore"):
        depth = np.sqrt(radius**2 - x**2.0 - y**2.0) - radius
    return STEP * np.where(np.isnan(depth), -np.inf, depth)


FILTERS = {
    "mean of 2 by 2": lambda heights: ndimage.uniform_filter(heights, 2),
    "mean of 3 by 3": lambda heights: ndimage.uniform_filter(heights, 3),
    "mean of 5 by 5": lambda heights: ndimage.uniform_filter(heights, 5),
    "bilinear shift": lambda heights: ndimage.shift(heights, 0.5, order=1),
    "bicubic shift": lambda heights: ndimage.shift(heights, 0.5, order=3),
    "bilinear by 1.1": lambda heights: ndimage.zoom(heights, 1.1, order=1),
    "bicubic by 1.5": lambda heights: ndimage.zoom(heights, 1.5, order=3),
    "nearest by 1.1": lambda heights: ndimage.zoom(heights, 1.1, order=0),
    "nearest, turned": lambda heights: ndimage.rotate(heights, 30.0, order=0, reshape=False),
    "median of 3 by 3": lambda heights: ndimage.median_filter(heights, 3),
    "ball": lambda heights: ndimage.grey_dilation(heights, structure=ball(3)),
    "along x": lambda heights: ndimage.gaussian_filter1d(heights, 0.7, axis=1),
}


def filtered(name, hurst, seed, size=SIZE):
    """The middle of a filtered surface."""
    wide = fc.surfaces.fbm((int(1.5 * size),) * 2, SPACING, hurst=hurst, rms_increment=STEP, rng=seed).values
    heights = FILTERS[name](wide)
    first = (len(heights) - size) // 2
    return fc.surfaces.from_array(heights[first : first + size, first : first + size], SPACING)


# half of the filters each
@pytest.mark.parametrize(
    ("name", "hurst"), [(name, (0.3, 0.7)[place % 2]) for place, name in enumerate(FILTERS)]
)
def test_exponent_before_filter(name, hurst):
    result = fc.dimensions.estimate(filtered(name, hurst, 3)).isel(method=0)
    low, high = float(result.ci_low), float(result.ci_high)
    # one of twenty intervals misses, by little
    assert low - 0.25 * (high - low) <= hurst <= high + 0.25 * (high - low)
    assert high - low < (0.85 if name in ("mean of 5 by 5", "ball") else 0.7)
    assert TEXT in result.hurst.attrs["comment"]
    assert float(result.scale_min) > 3.9 * SPACING


def test_filter_of_all_waves_has_no_interval_and_a_reason():
    heights = fc.surfaces.fbm((120, 120), SPACING, hurst=0.7, rms_increment=STEP, rng=0).values
    surface = fc.surfaces.from_array(ndimage.uniform_filter(heights, 7)[10:-10, 10:-10], SPACING)
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert np.isnan(float(result.ci_low))
    assert "nearly all waves" in result.ci_low.attrs["reason"]


@pytest.mark.parametrize("spread", [0.0, 0.5, 1.0, 2.0])
def test_gaussian_blur_is_no_other_filter(spread):
    """Of 360 exact, blurred and noisy surfaces of 128 by 128 points one interval was another."""
    heights = fc.surfaces.fbm((160, 160), SPACING, hurst=0.5, rms_increment=STEP, rng=5).values
    blurred = ndimage.gaussian_filter(heights, spread)[16:-16, 16:-16]
    comment = fc.dimensions.estimate(fc.surfaces.from_array(blurred, SPACING)).hurst.attrs.get("comment", "")
    assert TEXT not in comment


def test_rounded_and_cut_heights_were_not_resampled():
    """Equal neighbours, but few values."""
    heights = fc.surfaces.fbm((SIZE, SIZE), SPACING, hurst=0.7, rms_increment=STEP, rng=1).values
    for changed in (np.round(heights / STEP) * STEP, np.minimum(heights, np.quantile(heights, 0.8))):
        result = fc.dimensions.estimate(fc.surfaces.from_array(changed, SPACING))
        assert TEXT not in result.hurst.attrs.get("comment", "")
