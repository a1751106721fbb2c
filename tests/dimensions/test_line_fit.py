"""Estimates by a line through a curve: intervals by the covariance of the curve, and when there is none."""

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
    ("shape", "spacing"), [((50, 140), (1e-4, 1e-4)), ((140, 50), (1e-4, 1e-4)), ((96, 96), (2e-4, 1e-4))]
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


@pytest.mark.parametrize("method", ["spectrum", "roughness_length", "variogram", "cube_counts", "increments"])
def test_noise_that_is_not_in_the_model_changes_no_exponent(method):
    rough = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.6, rms_increment=1e-6, rng=1)
    plain, noisy = (fc.dimensions.estimate(rough, method, noise=noise).squeeze() for noise in (None, 1e-7))
    assert float(noisy.hurst) == float(plain.hurst)
    assert np.isnan(noisy.ci_low)
    assert "noise" in str(noisy.reason.values) + str(noisy.note.values)
    assert str(plain.note.values) in str(noisy.note.values)


def test_no_interval_where_the_curve_is_bent():
    rough, smooth = (
        fc.surfaces.fbm((256, 256), 1e-4, hurst=hurst, rms_increment=1e-6, rng=3) for hurst in (0.1, 0.95)
    )
    result = fc.dimensions.estimate(rough + 0.2 * smooth, "roughness_length").isel(method=0)
    assert np.isfinite(result.hurst)
    assert np.isnan(result.ci_low)
    assert "one exponent does not fit" in result.reason.item()
    assert float(result.misfit) > 3.3
    plain = fc.dimensions.estimate(rough, "roughness_length").isel(method=0)
    assert plain.ci_low < 0.1 < plain.ci_high


@pytest.mark.parametrize("defect", ["blur", "wave", "noise", "roll-off"])
def test_no_interval_of_the_spectrum_where_the_heights_are_not_fractional_brownian(defect):
    exact = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.6, rms_increment=1e-6, rng=3)
    y, x = np.mgrid[:256, :256]
    surface = {
        "blur": exact.copy(data=gaussian_filter(exact.values, 1.0)),
        "wave": exact + 2e-6 * np.sin(2.0 * np.pi * (0.06 * x + 0.04 * y)),
        "noise": exact + 2e-6 * np.random.default_rng(4).standard_normal(exact.shape),
        "roll-off": exact.copy(data=exact.values - gaussian_filter(exact.values, 4.0)),
    }[defect]
    result = fc.dimensions.estimate(surface, "spectrum").isel(method=0)
    assert np.isnan(result.ci_low)
    assert "one exponent does not fit" in result.reason.item()
    plain = fc.dimensions.estimate(exact, "spectrum").isel(method=0)
    assert plain.ci_low < 0.6 < plain.ci_high
    assert plain.note.item() == plain.reason.item() == ""


@pytest.mark.parametrize(
    ("method", "surface", "word"),
    [
        ("spectrum", {"shape": (64, 64), "scales": (2e-4, 32e-4)}, "mixed by its window"),
        ("roughness_length", {"shape": (64, 64)}, "fewer than 8 points"),
        ("higuchi", {"shape": (64, 64)}, "single profile"),
        ("variogram", {"shape": (64, 64)}, "correlated"),
        ("increments", {"shape": (64, 64), "noise": 1e-7}, "noise is not in the model"),
        ("spectrum", {"shape": (64, 64), "noise": 1e-7}, "noise is not in the model"),
    ],
)
def test_reason_where_there_is_no_interval(method, surface, word):
    rough = fc.surfaces.fbm(surface.pop("shape"), 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
    result = fc.dimensions.estimate(rough, method, **surface).isel(method=0)
    assert np.isnan(result.ci_low)
    assert np.isfinite(result.hurst)
    assert word in result.reason.item()
    no_noise = fc.dimensions.estimate(rough, "increments", noise=0.0)
    assert np.isfinite(no_noise.ci_low).all()


@pytest.mark.parametrize("method", ["roughness_length", "increments", "higuchi"])
def test_periodic_surfaces_are_not_fractional_brownian(method):
    shape = (256,) if method == "higuchi" else (160, 160)
    surface = fc.surfaces.spectral(shape, 1e-4, hurst=0.6, rms_height=1e-6, rng=2)
    result = fc.dimensions.estimate(surface, method).isel(method=0)
    assert np.isnan(result.ci_low)
    assert "periodic" in result.reason.item()


def test_spectrum_of_free_rough_surfaces_is_not_biased():
    """The tail of the window once gave 0.05 to 0.1 less."""
    value = estimates(surfaces("free", 0.2, 20, 128), "spectrum")[0]
    assert abs(value.mean() - 0.2) < 0.04


@pytest.mark.parametrize("hurst", [0.02, 0.97])
def test_estimates_go_on_beyond_the_range_of_fractals(hurst):
    """Beyond it the estimate once was that of the uncorrected curve: a jump of up to 0.1."""
    value = [
        fc.dimensions.estimate(surface, "spectrum").fitted_hurst.item()
        for surface in surfaces("free", hurst, 30, 64)
    ]
    assert (min(value) < 0.0) if hurst < 0.5 else (max(value) > 1.0)
    assert abs(np.mean(value) - hurst) < 0.1  # 0.08 too high at 0.97 on 64 x 64 points, 0.03 on 128 x 128


@pytest.mark.parametrize("factor", [1.0, 1e-6])
def test_parabola_gives_no_warning(factor):
    """Powers of rounding beside large ones once overflowed; a warning is an error here."""
    heights = factor * (np.arange(31.0) - 15) ** 2 * np.ones((31, 1))
    for is_periodic in (False, True):
        surface = fc.surfaces.from_array(heights, 1e-3, periodic=is_periodic)
        assert np.isfinite(fc.dimensions.estimate(surface, ["spectrum", "increments"]).fitted_hurst).any()
        fc.dimensions.spectrum(surface)


def test_band_limited_surface_is_fitted_inside_its_band():
    surface = fc.surfaces.spectral((160, 160), 1e-3, hurst=0.6, rms_height=1e-5, short_cutoff=0.008, rng=23)
    result = fc.dimensions.estimate(surface, "spectrum").isel(method=0)
    assert float(result.scale_min) > 0.0079
    assert float(result.ci_low) < 0.6 < float(result.ci_high)
