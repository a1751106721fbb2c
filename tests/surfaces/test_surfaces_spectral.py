"""Periodic self-affine surfaces: exact moments, the spectrum they follow, cut-offs, anisotropy."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import spectra, threads
from fractalcontact.base.errors import InvalidInput
from fractalcontact.surfaces._filtering import Band, filtered_modes


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
def test_this_surface_has_the_rms_asked_for(shape, spacing):
    surface = spectral(shape, spacing, rms_height=2.0)
    assert surface.values.std() == pytest.approx(2.0, rel=1e-14)
    assert abs(surface.values.mean()) < 1e-15
    assert slope_by_modes(spectral(shape, spacing, rms_slope=0.1)) == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize("slope", [False, True])
@pytest.mark.parametrize("shape", [(6, 8), (5, 7), (6, 7), (1, 8)])
def test_expected_energy_is_exact(covariance_of, shape, slope):
    # the covariance of the modes is exact, so its trace is the expectation without any statistics
    band = Band((0.6, 0.6), 0.0, 1.0, np.inf, axes=2 if shape[0] > 1 else 1)
    spacing = (1.0, 0.5)

    def heights(stream):
        modes, _ = filtered_modes(shape, spacing, band, stream, slope=slope, expected=True)
        return np.fft.irfft2(modes, s=shape)

    covariance = covariance_of(heights)
    _, energy = filtered_modes(shape, spacing, band, np.random.default_rng(1), slope=slope, expected=True)
    if not slope:
        np.testing.assert_allclose(np.diag(covariance), energy, rtol=1e-13)
        return
    qy = 2 * np.pi * np.fft.fftfreq(shape[0], spacing[0])[:, None]
    qx = 2 * np.pi * np.fft.fftfreq(shape[1], spacing[1])
    power = np.fft.fft2(covariance[0].reshape(shape)).real / covariance[0].size
    assert np.sum((qx**2 + qy**2) * power) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize(
    "band",
    [
        Band((0.6, 0.6), 0.0, 1.0, np.inf),
        Band((0.6, 0.6), 0.9, 2.0, 5.0),
        Band((0.4, 0.9), 0.0, 1.0, np.inf),
        Band((0.6, 0.6), 0.0, 1.0, np.inf, 3.0, 0.4),
    ],
)
@pytest.mark.parametrize("shape", [(6, 8), (5, 8), (6, 7)])
def test_every_mode_has_its_density(covariance_of, shape, band):
    spacing = (1.0, 0.5)

    def heights(stream):
        return np.fft.irfft2(
            filtered_modes(shape, spacing, band, stream, slope=False, expected=False)[0], s=shape
        )

    covariance = covariance_of(heights).reshape(*shape, *shape)
    # stationary: the covariance depends on the offset alone, wrapped
    for y in range(shape[0]):
        moved = np.roll(covariance[y, 2], (-y, -2), axis=(0, 1))
        np.testing.assert_allclose(moved, covariance[0, 0], atol=1e-14)
    found = np.fft.fft2(covariance[0, 0]).real
    qy = 2 * np.pi * np.fft.fftfreq(shape[0], spacing[0])[:, None]
    qx = 2 * np.pi * np.fft.fftfreq(shape[1], spacing[1])
    wanted = _density(band, qy, qx)
    # a Nyquist mode stands for two waves: it has the mean of their densities
    doubtful = np.zeros(shape, bool)
    for axis, q in enumerate((qy, qx)):
        if shape[axis] % 2 == 0:
            doubtful |= np.isclose(np.abs(q), np.pi / spacing[axis])
    wanted = np.where(doubtful, 0.5 * (wanted + _density(band, -qy, qx)), wanted)
    wanted[0, 0] = 0.0
    scale = wanted.sum() / found.sum()
    np.testing.assert_allclose(found * scale, wanted, atol=1e-13 * wanted.max())


def test_a_profile_falls_as_a_section_of_the_surface(covariance_of):
    surface = _spectrum_of_profile(covariance_of, 0.7)
    k = np.arange(1, 16)
    np.testing.assert_allclose(surface[k] / surface[1], k ** (-1 - 2 * 0.7), rtol=1e-11)


def _spectrum_of_profile(covariance_of, hurst):
    def heights(stream):
        band = Band((hurst, hurst), 0.0, 1e-6, np.inf, axes=1)
        modes, _ = filtered_modes((1, 32), (1.0, 1.0), band, stream, slope=False, expected=False)
        return np.fft.irfft2(modes, s=(1, 32))

    return np.fft.fft(covariance_of(heights)[0]).real


def _density(band, qy, qx):
    """Return the density written out, up to a factor."""
    mean = 2 / (1 / band.hurst[0] + 1 / band.hurst[1])
    along = (qx * np.cos(band.azimuth) + qy * np.sin(band.azimuth)) * np.sqrt(band.anisotropy_ratio)
    across = (qy * np.cos(band.azimuth) - qx * np.sin(band.azimuth)) / np.sqrt(band.anisotropy_ratio)
    if band.hurst[0] != band.hurst[1]:
        along = band.corner * np.abs(qx / band.corner) ** (band.hurst[1] / mean)
        across = band.corner * np.abs(qy / band.corner) ** (band.hurst[0] / mean)
    q = np.hypot(along, across)
    density = (np.maximum(q, band.corner) / band.corner) ** (-2 - 2 * mean)
    return np.where((q >= band.low * (1 - 1e-9)) & (q <= band.high * (1 + 1e-9)), density, 0.0)


def test_cutoffs_hold_and_their_edges_are_inside():
    n, spacing = 64, 1e-6
    surface = spectral((n, n), spacing, long_cutoff=n * spacing / 4, short_cutoff=4 * spacing)
    modes = np.abs(np.fft.fft2(surface.values))
    waves = np.hypot(np.fft.fftfreq(n, 1 / n)[:, None], np.fft.fftfreq(n, 1 / n))
    inside = (waves >= 4) & (waves <= n / 4)
    assert modes[~inside].max() < 1e-12 * modes.max()
    assert modes[inside].min() > 0


def test_plateau_is_flat_and_the_tail_falls_as_it_should():
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
    band = Band((hurst, hurst), 2 * np.pi / long, 2 * np.pi / (rolloff or long), 2 * np.pi / short)
    energies = [
        filtered_modes(
            (n, n), (spacing, spacing), band, np.random.default_rng(0), slope=slope, expected=True
        )[1]
        for slope in (False, True)
    ]
    found = 1e-7 * np.sqrt(energies[1] / energies[0])
    # the sum and the integral differ by the modes on the edges of the band
    assert found == pytest.approx(exact.moments().rms_slope, rel=0.02)
    assert exact.moments().rms_height == pytest.approx(1e-7, rel=1e-12)


def test_stretch_lengthens_along_its_azimuth():
    surface = spectral(
        (128, 128), 1.0, hurst=0.8, rms_height=1.0, rolloff=32.0, anisotropy_ratio=4.0, azimuth=0.0
    )
    slope = fc.surfaces.describe(surface)
    assert float(slope.rms_slope_y / slope.rms_slope_x) > 2.0
    turned = fc.surfaces.describe(
        spectral((128, 128), 1.0, hurst=0.8, rms_height=1.0, rolloff=32.0, anisotropy_ratio=4.0, azimuth=90.0)
    )
    assert float(turned.rms_slope_x / turned.rms_slope_y) > 2.0


def test_two_exponents_make_two_slopes_of_the_spectrum():
    heights = spectral((128, 128), 1.0, hurst=(0.3, 0.9), rms_height=1.0, members=60).values
    power = np.mean(np.abs(np.fft.fft2(heights)) ** 2, axis=0)
    k = np.arange(4, 60)
    mean = 2 / (1 / 0.3 + 1 / 0.9)
    found = [np.polyfit(np.log(k), np.log(line[k]), 1)[0] for line in (power[:, 0], power[0])]
    # along an axis C falls as q^(-(2 + 2 H) H_axis / H)
    np.testing.assert_allclose(found, [-(2 + 2 * mean) * own / mean for own in (0.3, 0.9)], rtol=0.04)


def test_axes_are_periodic_and_the_surface_has_no_seam():
    surface = spectral((64, 64), 1e-6, rms_height=1.0, short_cutoff=1.6e-5)
    assert surface.x.attrs["period"] == pytest.approx(64e-6, rel=1e-14)
    seam = np.abs(surface.values[0] - surface.values[-1]).max()
    inner = np.abs(np.diff(surface.values, axis=0)).max()
    assert seam < 1.5 * inner


def test_expectation_leaves_each_realisation_its_own_rms():
    heights = spectral((16, 16), rms_height=2.0, normalise="expectation", members=2000).values
    mean_squares = np.mean(heights**2, axis=(1, 2))
    assert mean_squares.std() > 0.1
    assert mean_squares.mean() == pytest.approx(4.0, abs=4 * mean_squares.std() / np.sqrt(2000))


def test_units_by_powers_of_two_change_no_bit():
    for wanted, factor in (({"rms_height": 1e-7}, 1.0), ({"rms_slope": 0.1}, 2.0**-30)):
        base = spectral(spacing=(1e-3, 3e-3), short_cutoff=1e-2, **wanted)
        moved = spectral(spacing=(1e-3 * 2.0**-30, 3e-3 * 2.0**-30), short_cutoff=1e-2 * 2.0**-30, **wanted)
        np.testing.assert_array_equal(moved.values, base.values * factor)


def test_any_number_of_threads_gives_the_same_bits():
    surfaces = []
    for count in (1, 2, 3):
        with threads.limit(count):
            surfaces.append(spectral((150, 140)).values)
    np.testing.assert_array_equal(surfaces[0], surfaces[1])
    np.testing.assert_array_equal(surfaces[0], surfaces[2])


def test_members_have_streams_of_their_own():
    few, many = spectral(members=2), spectral(members=4)
    np.testing.assert_array_equal(few.values, many.values[:2])
    assert json.loads(few.attrs["provenance"])["random"]["entropy"] == "5"


def test_every_problem_is_told_at_once():
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
        ({"shape": (4, 4), "long_cutoff": 2.7e-6, "short_cutoff": 2.1e-6}, "at least one mode"),
        ({"rms_height": 0.0}, "rms_height"),
        ({"hurst": (0.4, 0.8), "anisotropy_ratio": 2.0}, "anisotropy_ratio"),
        ({"shape": 64, "anisotropy_ratio": 2.0}, "anisotropy_ratio"),
        ({"shape": 64, "hurst": (0.5, 0.6)}, "hurst"),
    ],
)
def test_what_cannot_be_made_is_refused(options, word):
    with pytest.raises(InvalidInput, match=word):
        spectral(**options)
