"""Periodic self-affine surfaces: exact moments, the spectrum they follow, cut-offs, anisotropy."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import resources, spectra
from fractalcontact.base.errors import InvalidInput
from fractalcontact.surfaces import SelfAffine


def spectral(shape=(24, 30), spacing=1e-6, hurst=0.7, rng=5, **options):
    if "rms_slope" not in options:
        options.setdefault("rms_height", 1e-7)
    return fc.surfaces.spectral(shape, spacing, hurst=hurst, rng=rng, **options)


def slope_by_modes(surface):
    """Return the rms gradient the plain way, by full complex transforms."""
    heights = np.atleast_2d(surface.values)
    dx = float(surface.x[1] - surface.x[0])
    dy = float(surface.y[1] - surface.y[0]) if "y" in surface.dims else 1.0
    qy = 2 * np.pi * np.fft.fftfreq(heights.shape[0], dy)[:, None]
    qx = 2 * np.pi * np.fft.fftfreq(heights.shape[1], dx)
    modes = np.fft.fft2(heights) / heights.size
    return np.sqrt(np.sum((qx**2 + qy**2) * np.abs(modes) ** 2))


SHAPES = [
    ((16, 16), 1e-6),
    ((15, 16), (1e-6, 3e-6)),
    ((16, 15), 2.0),
    ((5, 7), 1.0),
    ((3, 3), 1e-9),
    (64, 1e-3),
]


@pytest.mark.parametrize(("shape", "spacing"), SHAPES)
def test_realisation_has_the_exact_rms(shape, spacing):
    surface = spectral(shape, spacing, rms_height=2.0)
    assert surface.values.std() == pytest.approx(2.0, rel=1e-14)
    assert abs(surface.values.mean()) < 1e-15
    assert slope_by_modes(spectral(shape, spacing, rms_slope=0.1)) == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize("target", ["rms_height", "rms_slope"])
@pytest.mark.parametrize("shape", [(6, 8), (5, 7), (6, 7), 8])
def test_expected_rms_is_exact(covariance_of, shape, target):
    # the covariance is exact, so its trace is the expectation without any statistics
    spacing = (1.0, 0.5) if np.ndim(shape) else 0.5
    options = {"hurst": 0.6, "rolloff": 2 * np.pi, "normalise": "expectation", target: 1.0}
    covariance = covariance_of(lambda rng: spectral(shape, spacing, rng=rng, **options).values)
    if target == "rms_height":
        np.testing.assert_allclose(np.diag(covariance), 1.0, rtol=1e-13)
        return
    shape = shape if np.ndim(shape) else (1, shape)
    qy = 2 * np.pi * np.fft.fftfreq(shape[0], 1.0)[:, None]
    qx = 2 * np.pi * np.fft.fftfreq(shape[1], 0.5)
    power = np.fft.fft2(covariance[0].reshape(shape)).real / covariance[0].size
    assert np.sum((qx**2 + qy**2) * power) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    "band",
    [
        {"hurst": (0.6, 0.6), "corner": 1.0},
        {"hurst": (0.6, 0.6), "low": 0.9, "corner": 2.0, "high": 5.0},
        {"hurst": (0.4, 0.9), "corner": 1.0},
        {"hurst": (0.6, 0.6), "corner": 1.0, "anisotropy_ratio": 3.0, "azimuth": 0.4},
    ],
)
@pytest.mark.parametrize("shape", [(6, 8), (5, 8), (6, 7)])
def test_every_mode_has_its_density(covariance_of, shape, band):
    spacing = (1.0, 0.5)
    wavenumbers = {"long_cutoff": "low", "rolloff": "corner", "short_cutoff": "high"}
    options = {name: 2 * np.pi / band[wave] for name, wave in wavenumbers.items() if wave in band}
    if "azimuth" in band:
        options |= {"anisotropy_ratio": band["anisotropy_ratio"], "direction": np.rad2deg(band["azimuth"])}
    covariance = covariance_of(
        lambda rng: spectral(shape, spacing, band["hurst"], rng, normalise="expectation", **options).values
    ).reshape(*shape, *shape)
    scale = covariance[0, 0, 0, 0]
    # stationary: the covariance depends only on the offset, modulo the period
    for y in range(shape[0]):
        shifted = np.roll(covariance[y, 2], (-y, -2), axis=(0, 1))
        np.testing.assert_allclose(shifted, covariance[0, 0], atol=1e-14 * scale)
    power = np.fft.fft2(covariance[0, 0]).real
    qy = 2 * np.pi * np.fft.fftfreq(shape[0], spacing[0])[:, None]
    qx = 2 * np.pi * np.fft.fftfreq(shape[1], spacing[1])
    expected = _density(band, qy, qx)
    # a Nyquist mode stands for two waves: it has the mean of their densities
    is_nyquist = np.zeros(shape, bool)
    for axis, q in enumerate((qy, qx)):
        if shape[axis] % 2 == 0:
            is_nyquist |= np.isclose(np.abs(q), np.pi / spacing[axis])
    expected = np.where(is_nyquist, 0.5 * (expected + _density(band, -qy, qx)), expected)
    expected[0, 0] = 0.0
    power *= expected.sum() / power.sum()
    np.testing.assert_allclose(power, expected, atol=1e-13 * expected.max())


def _density(band, qy, qx):
    """Return the density written out, up to a factor."""
    (hurst_y, hurst_x), corner = band["hurst"], band["corner"]
    ratio, azimuth = band.get("anisotropy_ratio", 1.0), band.get("azimuth", 0.0)
    low, high = band.get("low", 0.0), band.get("high", np.inf)
    mean = 2 / (1 / hurst_y + 1 / hurst_x)
    along = (qx * np.cos(azimuth) + qy * np.sin(azimuth)) * np.sqrt(ratio)
    across = (qy * np.cos(azimuth) - qx * np.sin(azimuth)) / np.sqrt(ratio)
    if hurst_y != hurst_x:
        along = corner * np.abs(qx / corner) ** (hurst_x / mean)
        across = corner * np.abs(qy / corner) ** (hurst_y / mean)
    q = np.hypot(along, across)
    density = (np.maximum(q, corner) / corner) ** (-2 - 2 * mean)
    return np.where((q >= low * (1 - 1e-9)) & (q <= high * (1 + 1e-9)), density, 0.0)


def test_profile_spectrum_falls_as_that_of_a_section(covariance_of):
    hurst = 0.7
    covariance = covariance_of(
        lambda rng: spectral(32, 1.0, hurst, rng, rolloff=2e6 * np.pi, normalise="expectation").values
    )
    power = np.fft.fft(covariance[0]).real
    k = np.arange(1, 16)
    np.testing.assert_allclose(power[k] / power[1], k ** (-1 - 2 * hurst), rtol=1e-11)


def test_cutoffs_include_their_edges():
    n, spacing = 64, 1e-6
    surface = spectral((n, n), spacing, long_cutoff=n * spacing / 4, short_cutoff=4 * spacing)
    modes = np.abs(np.fft.fft2(surface.values))
    waves = np.hypot(np.fft.fftfreq(n, 1 / n)[:, None], np.fft.fftfreq(n, 1 / n))
    inside = (waves >= 4) & (waves <= n / 4)
    assert modes[~inside].max() < 1e-12 * modes.max()
    assert modes[inside].min() > 0


def test_plateau_and_tail():
    heights = spectral((128, 128), 1.0, hurst=0.5, rms_height=1.0, rolloff=16.0, members=40).values
    psd, _ = spectra.periodogram(heights, (1.0, 1.0))
    edges = 2 * np.pi / 128 * np.array([1.5, 4, 7.9, 16, 24, 32, 48])
    q, mean, counts = spectra.radial_average(psd.mean(axis=0), (128, 128), (1.0, 1.0), edges)
    # a mean of m independent exponential numbers is known to 1/sqrt(m)
    sigma = np.sqrt(2 / (40 * counts))
    assert abs(mean[1] / mean[0] - 1) < 5 * np.hypot(*sigma[:2])
    slopes = np.diff(np.log(mean[3:])) / np.diff(np.log(q[3:]))
    np.testing.assert_allclose(slopes, -3.0, atol=0.15)


@pytest.mark.parametrize("rolloff", [None, 3e-5])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8, 1.0])
def test_closed_form_moments_agree_with_the_sum_over_modes(hurst, rolloff):
    n, spacing = 512, 1e-6
    long, short = n * spacing / 8, 4 * spacing
    exact = SelfAffine.scaled(hurst, long, rolloff or long, short, rms_height=1e-7)
    options = {"long_cutoff": long, "rolloff": rolloff or long, "short_cutoff": short}
    by_height, by_slope = (
        spectral((n, n), spacing, hurst, 0, normalise="expectation", **options, **target)
        for target in ({"rms_height": 1e-7}, {"rms_slope": 1.0})
    )
    # the same noise: the surfaces differ by the factor between expected height and expected slope
    rms_slope = float(by_height.std() / by_slope.std())
    # the sum and the integral differ by the modes on the edges of the band
    assert rms_slope == pytest.approx(exact.moments().rms_slope, rel=0.02)
    assert exact.moments().rms_height == pytest.approx(1e-7, rel=1e-12)


def test_anisotropy_lengthens_along_its_azimuth():
    surface = spectral(
        (128, 128), 1.0, hurst=0.8, rms_height=1.0, rolloff=32.0, anisotropy_ratio=4.0, direction=0.0
    )
    slope = fc.surfaces.describe(surface)
    assert float(slope.rms_slope_y / slope.rms_slope_x) > 2.0
    turned = fc.surfaces.describe(
        spectral(
            (128, 128), 1.0, hurst=0.8, rms_height=1.0, rolloff=32.0, anisotropy_ratio=4.0, direction=90.0
        )
    )
    assert float(turned.rms_slope_x / turned.rms_slope_y) > 2.0


def test_two_exponents_give_two_spectral_slopes():
    heights = spectral((128, 128), 1.0, hurst=(0.3, 0.9), rms_height=1.0, members=60).values
    power = np.mean(np.abs(np.fft.fft2(heights)) ** 2, axis=0)
    k = np.arange(4, 60)
    mean = 2 / (1 / 0.3 + 1 / 0.9)
    slopes = [np.polyfit(np.log(k), np.log(line[k]), 1)[0] for line in (power[:, 0], power[0])]
    # along an axis C falls as q^(-(2 + 2 H) H_axis / H)
    np.testing.assert_allclose(slopes, [-(2 + 2 * mean) * own / mean for own in (0.3, 0.9)], rtol=0.04)


def test_surface_is_periodic_without_a_seam():
    surface = spectral((64, 64), 1e-6, rms_height=1.0, short_cutoff=1.6e-5)
    assert surface.x.attrs["period"] == pytest.approx(64e-6, rel=1e-14)
    seam = np.abs(surface.values[0] - surface.values[-1]).max()
    inner = np.abs(np.diff(surface.values, axis=0)).max()
    assert seam < 1.5 * inner


def test_rms_scatters_about_its_expectation():
    heights = spectral((16, 16), rms_height=2.0, normalise="expectation", members=500).values
    mean_squares = np.mean(heights**2, axis=(1, 2))
    assert mean_squares.std() > 0.1
    assert mean_squares.mean() == pytest.approx(4.0, abs=4 * mean_squares.std() / np.sqrt(500))


def test_units_by_powers_of_two_change_no_bit():
    for target, factor in (({"rms_height": 1e-7}, 1.0), ({"rms_slope": 0.1}, 2.0**-30)):
        base = spectral(spacing=(1e-3, 3e-3), short_cutoff=1e-2, **target)
        moved = spectral(spacing=(1e-3 * 2.0**-30, 3e-3 * 2.0**-30), short_cutoff=1e-2 * 2.0**-30, **target)
        np.testing.assert_array_equal(moved.values, base.values * factor)


def test_thread_count_changes_no_bit():
    surfaces = []
    for count in (1, 2, 3):
        with resources.limit(count):
            surfaces.append(spectral((150, 140)).values)
    np.testing.assert_array_equal(surfaces[0], surfaces[1])
    np.testing.assert_array_equal(surfaces[0], surfaces[2])


def test_members_have_their_own_streams():
    few, many = spectral(members=2), spectral(members=4)
    np.testing.assert_array_equal(few.values, many.values[:2])
    assert json.loads(few.attrs["provenance"])["random"]["entropy"] == "5"


def test_all_problems_are_reported_together():
    with pytest.raises(InvalidInput) as caught:
        fc.surfaces.spectral(
            (8, 8),
            1.0,
            hurst=1.5,
            rms_height=1.0,
            rms_slope=0.1,
            normalise="both",
            short_cutoff=1.0,
            anisotropy_ratio=0,
        )
    for word in ("hurst", "rms_height / rms_slope", "normalise", "short_cutoff", "anisotropy_ratio"):
        assert any(problem.startswith(word) for problem in caught.value.problems)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"rolloff": 1e-3, "long_cutoff": 1e-4}, "rolloff"),
        ({"short_cutoff": 1e-5, "rolloff": 5e-6}, "short_cutoff"),
        (
            {"short_cutoff": 1.0},
            "short_cutoff: expected at most .* m, where the density begins to fall, got 1",
        ),
        ({"shape": (4, 4), "long_cutoff": 2.7e-6, "short_cutoff": 2.1e-6}, "at least one mode"),
        ({"rms_height": 0.0}, "rms_height"),
        ({"hurst": (0.4, 0.8), "anisotropy_ratio": 2.0}, "anisotropy_ratio"),
        ({"shape": 64, "anisotropy_ratio": 2.0}, "anisotropy_ratio"),
        ({"shape": 64, "hurst": (0.5, 0.6)}, "hurst"),
    ],
)
def test_invalid_arguments_are_refused(options, word):
    with pytest.raises(InvalidInput, match=word):
        spectral(**options)
