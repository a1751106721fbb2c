"""Maximum likelihood: families, invariances, and cases without an interval."""

import json

import numpy as np
import pytest

import fractalcontact as fc


def estimate(*arguments, **options):
    return fc.dimensions.estimate(*arguments, **options)


def estimate_one(surface, method=None, **options):
    return estimate(surface, method, **options).isel(method=0)


def noisy_surface(seed, noise):
    """Surface of H = 0.4 with white noise, given in rms increments."""
    surface = fc.surfaces.fbm((128, 128), 1e-6, hurst=0.4, rms_increment=1e-7, rng=seed)
    return surface + noise * 1e-7 * np.random.default_rng(seed).standard_normal((128, 128))


def surface_of(heights, spacing=1e-3):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((96, 80), 1e-4, hurst=0.7, rms_increment=2e-6, rng=21)


def test_tilt_row_offsets_and_mirror(rough):
    rng = np.random.default_rng(29)
    offset = rough.copy(data=rough.values + 1e-5 * rng.standard_normal((96, 1)) + 1e-3 * np.arange(80))
    # another pilot estimate, and with it other nodes of interpolation
    np.testing.assert_allclose(estimate_one(offset).hurst, estimate_one(rough).hurst, rtol=2e-5)
    np.testing.assert_allclose(
        estimate_one(rough.copy(data=rough.values[::-1])).hurst, estimate_one(rough).hurst, rtol=1e-9
    )


def test_periodic_surface_with_gaps_has_no_interval():
    for shape in (256, (32, 40)):
        surface = fc.surfaces.spectral(shape, 1e-3, hurst=0.6, rms_height=1e-5, short_cutoff=4e-3, rng=35)
        gapped = estimate_one(surface.where(surface.x != surface.x[7]))
        assert np.isfinite(float(gapped.hurst))
        assert np.isnan([float(gapped[name]) for name in ("standard_error", "ci_low", "ci_high")]).all()
        assert "fill" in json.loads(gapped.ci_low.attrs["reason"])["default"]


def test_periodic_profile():
    profile = fc.surfaces.spectral(2048, 1e-3, hurst=0.6, rms_height=1e-5, rng=32)
    result = estimate_one(profile)
    assert float(result.ci_low) < 0.6 < float(result.ci_high)


def test_corrugations_have_no_exponent():
    result = estimate(surface_of(np.tile(np.sin(0.7 * np.arange(40)), (40, 1))))
    assert np.isnan(result.hurst).all()
    assert "profile" in result.hurst.attrs["comment"]


def test_noise_of_periodic_profile_gives_no_interval():
    profile = fc.surfaces.spectral(2048, 1.0, hurst=0.6, rms_height=30.0, rolloff=128.0, rng=14)
    noisy = profile + np.random.default_rng(15).standard_normal(2048)
    result = fc.dimensions.estimate(noisy, noise=True)
    assert result.noise_height.item() == pytest.approx(1.0, abs=0.25)
    assert result.hurst.item() == pytest.approx(0.6, abs=0.15)
    assert np.isnan(result.ci_low.item())
    assert "noise" in result.ci_low.attrs["reason"]


def test_cut_off_below_noise_gives_no_interval():
    surface = fc.surfaces.spectral((64, 64), 1.0, hurst=0.5, rms_height=10.0, short_cutoff=4.0, rng=16)
    noisy = surface + 0.3 * np.random.default_rng(17).standard_normal(surface.shape)
    assert "scales" in fc.dimensions.estimate(noisy, noise=True).ci_low.attrs["reason"]
    limited = fc.dimensions.estimate(noisy, noise=True, scales=(5.0, 100.0))
    assert limited.ci_low.item() < 0.5 < limited.ci_high.item()


def test_short_rolloff_of_profile():
    surfaces = fc.surfaces.spectral(
        512, 1.0, hurst=0.5, rms_height=1.0, rolloff=64.0, short_cutoff=4.0, rng=5, members=30
    )
    result = fc.dimensions.estimate(surfaces)
    covered = (result["ci_low"] <= 0.5) & (result["ci_high"] >= 0.5)
    assert float(covered.mean()) > 0.85
    assert abs(float(result["hurst"].mean()) - 0.5) < 0.04


@pytest.mark.parametrize("noise", [False, True])
def test_profile_smoother_than_fractal_has_no_interval(noise):
    places = np.arange(200)
    for heights in (np.sin(0.05 * places), (places - 80.0) ** 2):
        result = estimate_one(surface_of(heights), noise=noise)
        assert float(result.hurst) == 1.0
        assert float(result.fitted_hurst) > 1.0
        assert np.isnan([float(result[name]) for name in ("standard_error", "ci_low", "ci_high")]).all()
        assert "no fractal" in result.ci_low.attrs["reason"]


def test_smoothest_fractal_profiles_keep_their_interval():
    profiles = fc.surfaces.fbm(256, 1e-3, hurst=0.95, rms_increment=1e-6, rng=8, members=10)
    result = estimate(profiles)
    assert (result.fitted_hurst < 1.0).all()
    assert int(((result.ci_low <= 0.95) & (result.ci_high >= 0.95)).sum()) >= 8


def test_checkerboard_is_no_fractal_of_a_narrow_interval():
    """Modes without any power once ended in a division by zero."""
    y, x = np.mgrid[:64, :64]
    surface = fc.surfaces.from_array(1e-6 * ((x + y) % 2), 1e-5)
    result = estimate_one(surface)
    assert "few waves hold more than their share" in result.hurst.attrs["comment"]
    assert not float(result.ci_high - result.ci_low) < 0.1


def test_interval_holds_noise_that_is_hardly_seen():
    held = []
    for seed in range(8):
        result = fc.dimensions.estimate(noisy_surface(seed, 0.2))
        held.append(result.ci_low.item() < 0.4 < result.ci_high.item())
    assert sum(held) >= 7  # 4 where noise beyond 0.08 rms increments is left out
