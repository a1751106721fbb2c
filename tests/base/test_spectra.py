"""Power spectra: Parseval, weights, windows, rings, moments."""

import itertools

import numpy as np
import pytest

from fractalcontact.base import fft, spectra


def plane(shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize(
    ("shape", "spacing"),
    [((8, 6), (2.0, 0.5)), ((7, 9), (1e-9, 3e-9)), ((5, 8), (1.0, 1.0)), ((9,), (0.1,)), ((8,), (2.0,))],
)
def test_sum_over_modes_is_the_mean_square(shape, spacing):
    heights = plane(shape)
    psd, weights = spectra.periodogram(heights, spacing)
    extent = np.prod(np.multiply(shape, spacing))
    assert np.sum(psd * weights) / extent == pytest.approx(np.mean(heights**2), rel=1e-13)


def test_leading_axes_are_kept():
    heights = plane((3, 2, 6, 8))
    psd, _ = spectra.periodogram(heights, (1.0, 2.0), "hann")
    assert psd.shape == (3, 2, 6, 5)
    np.testing.assert_allclose(
        psd[1, 1], spectra.periodogram(heights[1, 1], (1.0, 2.0), "hann")[0], rtol=1e-13
    )


def test_a_window_keeps_the_level_of_white_noise():
    heights = plane((400, 32, 32))
    plain, _ = spectra.periodogram(heights, (1.0, 1.0))
    for window in ("hann", (None, "hann"), ("hann", None)):
        tapered, _ = spectra.periodogram(heights, (1.0, 1.0), window)
        assert tapered.mean() == pytest.approx(plain.mean(), rel=0.01)
    with pytest.raises(ValueError, match="window"):
        spectra.periodogram(heights, (1.0, 1.0), "triangle")


def test_one_wave_has_one_mode():
    n, step, amplitude = 16, 0.5, 3.0
    x = np.arange(n) * step
    heights = np.tile(amplitude * np.cos(2 * np.pi * 3 * x / (n * step)), (n, 1))
    psd, weights = spectra.periodogram(heights, (step, step))
    assert psd[0, 3] * weights[3] / (n * step) ** 2 == pytest.approx(amplitude**2 / 2)
    assert np.count_nonzero(psd > 1e-20) == 1


def test_rings_count_every_mode_of_the_whole_plane_once():
    shape, spacing = (12, 15), (1.0, 0.7)
    full = np.hypot(
        2 * np.pi * np.fft.fftfreq(shape[0], spacing[0])[:, None],
        2 * np.pi * np.fft.fftfreq(shape[1], spacing[1]),
    )
    edges = np.array([0.0, 0.9, 1.7, 3.3])
    density = full[:, : shape[1] // 2 + 1] ** 2
    q, mean, counts = spectra.radial_average(density, shape, spacing, edges)
    nyquist = np.pi / max(spacing) * (1 + 1e-12)
    for ring, (low, high) in enumerate(itertools.pairwise(edges)):
        inside = (full >= low) & (full < high) & (full <= nyquist) & (full > 0)
        assert counts[ring] == np.count_nonzero(inside)
        assert q[ring] == pytest.approx(full[inside].mean())
        assert mean[ring] == pytest.approx((full[inside] ** 2).mean())


def test_default_rings_end_at_the_nyquist_wavenumber():
    shape, spacing = (32, 32), (0.5, 0.5)
    psd, _ = spectra.periodogram(plane((4, *shape)), spacing)
    q, mean, counts = spectra.radial_average(psd, shape, spacing)
    assert mean.shape == (4, q.size)
    assert q[-1] <= np.pi / 0.5
    assert counts[0] == 8  # (1, 0) and (1, 1) with their mirrors
    np.testing.assert_allclose(q[1:-1] / q[1:-1][0] * 2, np.arange(2, q.size), rtol=0.1)


def test_radial_average_is_invariant_under_mirrors():
    heights = plane((16, 16))
    averages = [
        spectra.radial_average(spectra.periodogram(face, (1.0, 1.0))[0], (16, 16), (1.0, 1.0))[1]
        for face in (heights, heights[:, ::-1], heights.T)
    ]
    np.testing.assert_allclose(averages[1], averages[0], rtol=1e-12)
    np.testing.assert_allclose(averages[2], averages[0], rtol=1e-12)


def test_moments_of_two_waves():
    n, step, a, b = 32, 0.25, 2.0, 0.5
    y, x = np.meshgrid(np.arange(n) * step, np.arange(n) * step, indexing="ij")
    kx, ky = 2 * np.pi * 3 / (n * step), 2 * np.pi * 5 / (n * step)
    psd, _ = spectra.periodogram(7.0 + a * np.sin(kx * x) + b * np.cos(ky * y), (step, step))
    moments = spectra.spectral_moments(psd, (n, n), (step, step))
    assert moments.rms_height == pytest.approx(np.sqrt(a**2 / 2 + b**2 / 2))
    assert moments.rms_slope == pytest.approx(np.sqrt((a * kx) ** 2 / 2 + (b * ky) ** 2 / 2))
    assert moments.rms_curvature == pytest.approx(0.5 * np.sqrt((a * kx**2) ** 2 / 2 + (b * ky**2) ** 2 / 2))
    along = spectra.directional_slopes(psd, (n, n), (step, step))
    np.testing.assert_allclose(along, [b * ky / np.sqrt(2), a * kx / np.sqrt(2)], rtol=1e-12)


def test_nayak_parameter_of_a_ring_and_of_a_wave():
    # an isotropic ring of one wavelength has 1.5, a profile of one wavelength has 1, and no slope has none
    assert spectra.Moments(2.0, 2.0 * 9, 2.0 * 81).nayak == pytest.approx(1.5)
    assert spectra.Moments(2.0, 2.0 * 9, 2.0 * 81, axes=1).nayak == pytest.approx(1.0)
    assert np.isnan(spectra.Moments(1.0, 0.0, 0.0).nayak)


@pytest.mark.parametrize("library", ["scipy", "ducc0"])
def test_transforms_against_the_plain_sum(monkeypatch, library):
    if library == "ducc0":
        pytest.importorskip("ducc0")
    monkeypatch.setenv("FRACTALCONTACT_FFT", library)
    corner = plane((5, 4))
    even = np.pad(corner, ((0, 3), (0, 2)), mode="reflect")
    np.testing.assert_allclose(fft.dct(corner, 1, (0, 1)), np.fft.fft2(even).real[:5, :4], atol=1e-13)
    np.testing.assert_allclose(fft.dct(corner, 1, (1,)), np.fft.fft(even[:5]).real[:, :4], atol=1e-13)
    modes = plane((3, 6)) + 1j * plane((3, 6), 1)
    np.testing.assert_allclose(fft.ifft(modes), np.fft.ifft(modes), atol=1e-15)


def test_aliased_density_of_a_lattice():
    """The images of a power law, summed over many more of them."""
    offsets = 2 * np.pi * np.arange(-300, 301)
    near = np.sum(((1.0 + offsets[:, None]) ** 2 + (-2.0 + offsets) ** 2) ** (-1 - 0.6))
    assert spectra.aliased_power_law((1.0, -2.0), 0.6) == pytest.approx(near, rel=2e-4)


@pytest.mark.parametrize("shape", [(8, 8), (9, 12), (12, 9), (7, 7)])
def test_radial_average_is_the_mean_over_the_whole_plane(shape):
    spacing = (0.5, 0.4)
    power = np.abs(np.fft.fft2(np.random.default_rng(4).normal(size=shape))) ** 2
    edges = np.array([0.5, 2.0, 3.5, 5.0])
    q, mean, counts = spectra.radial_average(power[:, : shape[1] // 2 + 1], shape, spacing, edges)
    waves = [2 * np.pi * np.fft.fftfreq(n, step) for n, step in zip(shape, spacing, strict=True)]
    radius = np.hypot(waves[0][:, None], waves[1])
    rings = [
        (radius >= low) & (radius < high) & (radius <= np.pi / 0.5) for low, high in itertools.pairwise(edges)
    ]
    np.testing.assert_array_equal(counts, [ring.sum() for ring in rings])
    np.testing.assert_allclose(mean, [power[ring].mean() for ring in rings], rtol=1e-12)
    np.testing.assert_allclose(q, [radius[ring].mean() for ring in rings], rtol=1e-12)
