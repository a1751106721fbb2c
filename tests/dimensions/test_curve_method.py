"""Intervals of the spectrum and of the roughness in windows, by the covariance of their curves."""

import json

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc


def estimates(surfaces, method):
    """Return H, both ends of the interval and the standard error, (4, surfaces)."""
    results = [fc.dimensions.estimate(surface, method).isel(method=0) for surface in surfaces]
    names = ("hurst", "ci_low", "ci_high", "standard_error")
    return np.array([[float(result[name]) for result in results] for name in names])


def surfaces(family, hurst, number, n=64):
    for rng in range(number):
        if family == "free":
            yield fc.surfaces.fbm((n, n), 1e-4, hurst=hurst, rms_increment=1e-6, rng=rng)
        else:
            yield fc.surfaces.spectral((n, n), 1e-4, hurst=hurst, rms_height=1e-6, rng=rng)


@pytest.mark.parametrize(
    ("method", "family"), [("spectrum", "free"), ("spectrum", "periodic"), ("roughness_length", "free")]
)
@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_interval_holds_the_exponent(method, family, hurst):
    size = 128 if method == "roughness_length" else 64
    value, low, high, error = estimates(surfaces(family, hurst, 30, size), method)
    assert np.count_nonzero((low <= hurst) & (hurst <= high)) >= 25
    assert abs(value.mean() - hurst) < 4 * error.mean() / np.sqrt(30)
    assert 0.6 < value.std() / error.mean() < 1.5


@pytest.mark.parametrize(
    ("shape", "spacing"), [((50, 140), (1e-4, 1e-4)), ((140, 50), (1e-4, 1e-4)), ((64, 64), (2e-4, 1e-4))]
)
def test_interval_of_the_spectrum_of_a_rectangle(shape, spacing):
    """The rings follow the longer side: near the mean some hold modes along it only."""
    rectangles = (
        fc.surfaces.fbm(shape, spacing, hurst=0.4, rms_increment=1e-6, rng=rng) for rng in range(30)
    )
    value, low, high, error = estimates(rectangles, "spectrum")
    assert np.count_nonzero((low <= 0.4) & (high >= 0.4)) >= 25
    assert abs(value.mean() - 0.4) < 4 * error.mean() / np.sqrt(30)
    assert 0.6 < value.std() / error.mean() < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spectrum", "roughness_length"])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_coverage_is_near_95_percent(method, hurst):
    _, low, high, _ = estimates(surfaces("free", hurst, 300, 128), method)
    assert 0.90 <= np.mean((low <= hurst) & (hurst <= high)) <= 0.985


def test_bent_curve_widens_interval():
    rough, smooth = (
        fc.surfaces.fbm((256, 256), 1e-4, hurst=hurst, rms_increment=1e-6, rng=3) for hurst in (0.1, 0.95)
    )
    result = fc.dimensions.estimate(rough + 0.2 * smooth, "roughness_length").isel(method=0)
    assert "changes with scale" in result.hurst.attrs["comment"]
    assert float(result.ci_high - result.ci_low) > 4.5 * float(result.standard_error)


@pytest.mark.parametrize(("shape", "word"), [((32, 160), "too long for its width"), ((128,), "profile")])
def test_reason_where_the_covariance_is_not_known(shape, word):
    surface = fc.surfaces.fbm(shape, 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
    result = fc.dimensions.estimate(surface, "spectrum")
    assert np.isnan(result.ci_low).all()
    assert word in json.loads(result.ci_low.attrs["reason"])["spectrum"]


def test_small_surfaces_have_no_interval_of_roughness():
    surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
    result = fc.dimensions.estimate(surface, "roughness_length")
    assert np.isnan(result.ci_low).all()
    assert "too few" in result.ci_low.attrs["reason"]


def test_spectrum_of_free_rough_surfaces_is_not_biased():
    """The tail of the window once gave 0.05 to 0.1 less."""
    value = estimates(surfaces("free", 0.2, 20, 128), "spectrum")[0]
    assert abs(value.mean() - 0.2) < 0.04


@pytest.mark.parametrize("method", ["spectrum", "roughness_length"])
def test_interval_holds_the_exponent_where_the_heights_are_not_fractional_brownian(method):
    """A blur, a wave and offsets of rows: the curve alone has narrow intervals at 0.6 to 0.9, 0.3 and 0.2."""
    exact = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.3, rms_increment=1e-6, rng=3)
    y, x = np.mgrid[:128, :128]
    offsets = 1e-6 * np.random.default_rng(4).standard_normal((128, 1))
    wave = 1e-6 * np.sin(2.0 * np.pi * (0.06 * x + 0.04 * y))
    blurred = exact.copy(data=gaussian_filter(exact.values, 0.7))
    for surface in (blurred, exact + wave, exact + offsets):
        result = fc.dimensions.estimate(surface, method).isel(method=0)
        assert result.ci_low < 0.3 < result.ci_high
        assert "`likelihood`" in json.loads(result.hurst.attrs["comment"])[method]
    plain = fc.dimensions.estimate(exact, method).isel(method=0)
    assert float(plain.ci_high - plain.ci_low) < 0.3
    assert json.loads(plain.hurst.attrs["comment"]) == {}
