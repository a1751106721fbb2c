"""Heights that were filled in count as missing: of any shape of gap, spacing and offset; and no others do."""

import json

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc


def brownian(shape, hurst, seed, spacing=1e-4):
    return fc.surfaces.fbm(shape, spacing, hurst=hurst, rms_increment=1e-6, rng=seed)


def comment(result):
    return json.loads(result.hurst.attrs["comment"]).get("default", "")


@pytest.mark.parametrize("gaps", ["points", "patches"])
@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_a_filled_surface_has_the_estimate_of_the_one_with_gaps(gaps, hurst):
    rng = np.random.default_rng(8)
    field = rng.standard_normal((96, 96))
    field = gaussian_filter(field, 3.0) if gaps == "patches" else field
    missing = field > np.quantile(field, 0.9)
    surface = brownian((96, 96), hurst, 9, (2e-4, 1e-4)) + 1.0
    surface.values[missing] = np.nan
    expected = fc.dimensions.estimate(surface)
    result = fc.dimensions.estimate(fc.surfaces.fill(surface))
    for name in ("hurst", "ci_low", "ci_high"):
        assert float(result[name][0]) == pytest.approx(float(expected[name][0]), rel=1e-6)
    assert "9.9 % of the heights were filled in" in comment(result) or "10 %" in comment(result)


def test_directions_and_maps_count_them_as_missing():
    surface = brownian((96, 96), 0.3, 3)
    surface.values[np.random.default_rng(4).random((96, 96)) < 0.1] = np.nan
    filled = fc.surfaces.fill(surface)
    expected, result = fc.dimensions.directions(surface), fc.dimensions.directions(filled)
    np.testing.assert_allclose(result.hurst.values, expected.hurst.values, rtol=1e-6)
    expected, result = (fc.dimensions.hurst_map(s, 3.2e-3) for s in (surface, filled))
    np.testing.assert_allclose(result.hurst.values, expected.hurst.values, rtol=1e-6)
    assert "filled in" in result.hurst.attrs["comment"]


def test_profiles_and_large_surfaces():
    profile = brownian(512, 0.5, 5)
    profile.values[np.random.default_rng(6).random(512) < 0.05] = np.nan
    assert "filled in" in comment(fc.dimensions.estimate(fc.surfaces.fill(profile)))
    large = brownian((300, 300), 0.5, 7)
    large.values[150:220, 30:40] = np.nan
    assert "filled in" in comment(fc.dimensions.estimate(fc.surfaces.fill(large)))


def test_measured_heights_are_not_taken_for_filled_ones():
    exact = brownian((96, 96), 0.6, 10)
    smooth = exact.copy(data=gaussian_filter(exact.values, 3.0))
    step = float(np.ptp(exact.values)) / 4096.0
    rounded = exact.copy(data=step * np.rint(exact.values / step))
    y, x = np.mgrid[:96, :96]
    curved = exact + 1e-6 * (x**2 + x * y)
    for surface in (exact, smooth, rounded, curved):
        assert "filled" not in comment(fc.dimensions.estimate(surface))
