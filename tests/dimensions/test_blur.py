"""Blurred and noisy surfaces and profiles: exponent and interval are those before the blur."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.dimensions._blur import fit_blurred
from fractalcontact.dimensions._cosine_modes import mode_power
from fractalcontact.dimensions._mode_blocks import frame

SPACING, STEP = 1e-4, 1e-6


def blurred(hurst, spread, noise=0.0, seed=1, shape=(128, 128), between=1):
    """Heights blurred beyond the edge too, as by an instrument; with points between those of the scan."""
    rng = np.random.default_rng([seed, int(100 * hurst), int(10 * spread)])
    margin = int(5 * spread) + 2
    wide = tuple((n + 2 * margin) * between for n in shape)
    heights = fc.surfaces.fbm(
        wide, SPACING, hurst=hurst, rms_increment=STEP * between**-hurst, rng=rng
    ).values
    inside = (slice(margin * between, -margin * between, between),) * len(shape)
    heights = gaussian_filter(heights, spread * between)[inside]
    return fc.surfaces.from_array(heights + noise * STEP * rng.standard_normal(heights.shape), SPACING)


def estimated(surface, **options):
    return fc.dimensions.estimate(surface, **options).isel(method=0)


# points between those of the surface when it is blurred: none, or three; wide blurs are the same for both
@pytest.mark.parametrize(("between", "spread"), [(1, 0.5), (1, 1.0), (1, 2.0), (4, 0.5), (4, 1.0)])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.9])
def test_exponent_before_blur(hurst, spread, between):
    result = estimated(blurred(hurst, spread, 0.01, between=between))
    # one of twenty intervals misses, by little
    margin = 0.25 * float(result.ci_high - result.ci_low)
    assert float(result.ci_low) - margin <= hurst <= float(result.ci_high) + margin
    assert float(result.blur_spread) == pytest.approx(spread * SPACING, rel=0.15)
    # half the bound of the modes on which the squared transfer function is above one half, times four
    assert float(result.hurst) == pytest.approx(hurst, abs=4 * 1.6 * spread / 0.265 / 128)
    assert "in the model" in result.hurst.attrs["comment"]


def test_blur_of_a_large_surface_is_seen():
    """The modes of a block are not equally strong, which shows where there are many."""
    result = estimated(blurred(0.7, 1.0, shape=(1024, 1024)))
    margin = 0.25 * float(result.ci_high - result.ci_low)
    assert float(result.ci_low) - margin <= 0.7 <= float(result.ci_high) + margin
    assert float(result.ci_high - result.ci_low) < 0.04
    assert float(result.blur_spread) == pytest.approx(SPACING, rel=0.05)


def test_model_of_blur_agrees_with_no_lay():
    ground = fc.surfaces.fbm((128, 128), 1.0, hurst=0.5, rms_increment=1.0, rng=1).values
    y, x = np.indices(ground.shape)
    blocks = frame(ground.shape, (1.0, 1.0))
    exact = fit_blurred(mode_power(ground), blocks)
    assert exact.is_good
    assert exact.is_even
    for seed in (3, 4):
        profile = fc.surfaces.fbm((200,), 1.0, hurst=0.5, rms_increment=10.0, rng=seed).values
        lay = np.interp(x + 0.4 * y, np.arange(200), profile)
        fit = fit_blurred(mode_power(ground + lay), blocks)
        assert not fit.is_even
        assert not fit.is_good


def test_noise_after_blur_is_measured():
    result = estimated(blurred(0.5, 1.0, 0.05))
    assert float(result.noise_height) == pytest.approx(0.05 * STEP, rel=0.05)
    assert float(result.ci_low) <= 0.5 <= float(result.ci_high)


def test_known_spread_narrows_the_interval():
    surface = blurred(0.5, 1.0)
    free, known = estimated(surface), estimated(surface, psf=SPACING)
    assert float(known.blur_spread) == pytest.approx(SPACING)
    assert float(known.ci_low) <= 0.5 <= float(known.ci_high)
    assert float(known.standard_error) < 0.7 * float(free.standard_error)


def test_crop_of_a_surface_without_aliases():
    for hurst in (0.3, 0.8):
        periodic = fc.surfaces.spectral((256, 256), SPACING, hurst=hurst, rms_height=STEP, rng=2)
        result = estimated(periodic[:128, :128])
        assert float(result.ci_low) <= hurst <= float(result.ci_high)
        assert float(result.hurst) == pytest.approx(hurst, abs=0.06)
        assert "band limit" in result.hurst.attrs["comment"]


def test_unblurred_surface_is_not_noted():
    surface = fc.surfaces.fbm((128, 128), SPACING, hurst=0.5, rms_increment=STEP, rng=4)
    result = estimated(surface)
    assert np.isnan(result.blur_spread)
    assert "in the model" not in result.hurst.attrs["comment"]
    assert float(result.ci_high - result.ci_low) < 0.05


@pytest.mark.parametrize("spread", [1.0, 2.0])
def test_blurred_profile(spread):
    result = estimated(blurred(0.5, spread, 0.01, shape=(4096,)))
    margin = 0.25 * float(result.ci_high - result.ci_low)
    assert float(result.ci_low) - margin <= 0.5 <= float(result.ci_high) + margin
    assert float(result.hurst) == pytest.approx(0.5, abs=0.15)
    assert float(result.blur_spread) == pytest.approx(spread * SPACING, rel=0.2)


def test_single_wave_is_no_fractal_profile():
    heights = STEP * np.sin(2 * np.pi * np.arange(4000) / 40)
    result = estimated(fc.surfaces.from_array(heights, SPACING))
    assert np.isnan(result.hurst)
    assert "single wave" in result.hurst.attrs["reason"]


@pytest.mark.parametrize("value", [-1e-4, "wide", np.nan])
def test_spread_is_checked(value):
    surface = fc.surfaces.fbm((32, 32), SPACING, hurst=0.5, rms_increment=STEP, rng=4)
    with pytest.raises(ValueError, match="psf"):
        fc.dimensions.estimate(surface, psf=value)


def without_points(surface, kind):
    """Return a surface without a twentieth of its points: scattered ones, or a block."""
    missing = np.zeros(surface.shape, dtype=bool)
    if kind == "block":
        missing[30:59, 50:79] = True
    else:
        missing |= np.random.default_rng(3).random(surface.shape) < 0.05
    return surface.where(~missing)


@pytest.mark.parametrize("kind", ["block", "scattered"])
@pytest.mark.parametrize(("hurst", "spread", "noise"), [(0.3, 0.7, 0.0), (0.7, 1.0, 0.05), (0.5, 2.0, 0.0)])
def test_blur_beside_gaps_is_in_the_model(hurst, spread, noise, kind):
    """Once 1.00 [0.95, 1.00] for 0.3: the exponent of a smooth surface."""
    surface = blurred(hurst, spread, noise)
    complete, gapped = estimated(surface), estimated(without_points(surface, kind))
    assert gapped.ci_low < hurst < gapped.ci_high
    assert abs(gapped.hurst - complete.hurst) < 0.5 * (complete.ci_high - complete.ci_low)
    assert gapped.ci_high - gapped.ci_low < 1.5 * (complete.ci_high - complete.ci_low)
    assert float(gapped.blur_spread) / SPACING == pytest.approx(spread, abs=0.3)


def test_scaling_beside_gaps_equals_that_of_the_complete_surface():
    surface = blurred(0.5, 1.0)
    complete, gapped = (fc.dimensions.scaling(each) for each in (surface, without_points(surface, "block")))
    error = (complete.ci_high - complete.ci_low) / 3.92
    assert (abs(gapped.hurst - complete.hurst) < 2.0 * error)[1:].all()
    assert (gapped.hurst[:2] > 1.2).all()
    assert gapped.hurst[2] < 1.0
    with pytest.raises(ValueError, match="at least half of the heights"):
        fc.dimensions.scaling(surface.where(surface.x < surface.x[50]))
