"""Power spectral density: Parseval, single waves, tapers, tiles, scatter."""

import numpy as np
import pytest

import fractalcontact as fc


def surface_of(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


def test_parseval():
    """Parseval: the sum over all modes is the mean square of the tapered heights."""
    surface = fc.surfaces.spectral(
        (64, 48), (2e-3, 1e-3), hurst=0.7, rms_height=1e-5, short_cutoff=6e-3, rng=4
    )
    curve = fc.dimensions.spectrum(surface)
    total = float((curve.power_spectral_density * curve.mode_count).sum()) / (64 * 2e-3 * 48 * 1e-3)
    assert total == pytest.approx(1e-10, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "spacing"), [((12, 120), (1.0, 1.0)), ((60, 8), (1.0, 3.0)), ((31, 8), (5.0, 1.0))]
)
def test_slender_surface_keeps_longest_waves(shape, spacing):
    surface = fc.surfaces.spectral(shape, spacing, hurst=0.7, rms_height=1e-3, rng=4)
    curve = fc.dimensions.spectrum(surface)
    full = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n, s) for n, s in zip(shape, spacing, strict=True))))
    inside = (full > 0) & (full <= 0.5 / max(spacing) * (1 + 1e-9))
    assert int(curve.mode_count.sum()) == np.count_nonzero(inside)
    assert float(curve.wavenumber[0]) == pytest.approx(2 * np.pi * full[full > 0].min(), rel=1e-9)
    power = np.abs(np.fft.fft2(surface.values)).T ** 2 / np.prod(shape) ** 2
    total = float((curve.power_spectral_density * curve.mode_count).sum())
    assert total / np.prod(shape) / np.prod(spacing) == pytest.approx(power[inside].sum(), rel=1e-12)


def test_single_wave():
    n, k, amplitude = 64, 6, 3e-6
    wave = amplitude * np.cos(2 * np.pi * k * np.arange(n) / n)
    curve = fc.dimensions.spectrum(surface_of(np.tile(wave, (n, 1)), 1e-3, periodic=True))
    area = (n * 1e-3) ** 2
    total = float((curve.power_spectral_density * curve.mode_count).sum()) / area
    assert total == pytest.approx(0.5 * amplitude**2, rel=1e-12)
    top = int(np.argmax(curve.power_spectral_density.values))
    assert float(curve.wavenumber[top]) == pytest.approx(2 * np.pi * k / (n * 1e-3), rel=0.02)
    assert float(curve.wavelength[top]) == pytest.approx(n * 1e-3 / k, rel=0.02)
    assert float(curve.wavenumber.max()) <= np.pi / 1e-3 * (1 + 1e-9)


def test_profile_slope():
    surface = fc.surfaces.spectral(4096, 1e-3, hurst=0.4, rms_height=1e-5, rng=5)
    curve = fc.dimensions.spectrum(surface)
    assert float((curve.profile_power_spectral_density * curve.mode_count).sum()) / 4.096 == pytest.approx(
        1e-10
    )
    assert float(curve.local_slope[200:].median()) == pytest.approx(-1.8, abs=0.2)


def test_free_surface_is_tapered_and_levelled(rough):
    tilted = rough.copy(data=rough.values + 0.5 * np.arange(40) * 1e-3)
    first, second = fc.dimensions.spectrum(rough), fc.dimensions.spectrum(tilted)
    np.testing.assert_allclose(second.power_spectral_density, first.power_spectral_density, rtol=1e-8)
    bare = fc.dimensions.spectrum(rough, taper=None)
    assert not np.allclose(bare.power_spectral_density, first.power_spectral_density, rtol=0.1, atol=0)


def test_tiles_average_spectra():
    surface = fc.surfaces.fbm((96, 64), 1e-3, hurst=0.5, rms_increment=1e-5, rng=6)
    result = fc.dimensions.spectrum(surface, tile=32)
    parts = [
        fc.dimensions.spectrum(surface[j : j + 32, i : i + 32]).power_spectral_density
        for j in range(0, 65, 16)
        for i in range(0, 33, 16)
    ]
    np.testing.assert_allclose(result.power_spectral_density, np.mean(parts, axis=0), rtol=1e-10)


def test_scatter_equals_stated_error():
    profiles = fc.surfaces.spectral(
        256, 1e-3, hurst=0.7, rms_height=1e-5, normalise="expectation", members=400, rng=4
    )
    curve = fc.dimensions.spectrum(profiles)
    values = curve.profile_power_spectral_density
    ratio = values.std("member") / values.mean("member") / np.sqrt(2 / curve.mode_count)
    assert float(ratio.mean()) == pytest.approx(1.0, abs=0.03)
    assert "sqrt(2 / mode_count)" in curve.attrs["provenance"]


@pytest.mark.parametrize("shift", [0, 8])
def test_a_wave_along_a_periodic_axis_keeps_its_power(shift):
    heights = np.roll(np.sin(2 * np.pi * np.arange(32) / 32), shift)[:, None] * np.ones((1, 64))
    curve = fc.dimensions.spectrum(surface_of(heights, periodic=(True, False)), taper=None)
    total = float((curve.power_spectral_density * curve.mode_count).sum()) / (32 * 64 * 1e-6)
    assert total == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("shape", [(128, 96), (120, 90)])
def test_the_exponent_does_not_depend_on_the_unit_of_length(shape):
    """Modes on an edge of a ring fell to either side by rounding: H was .31 or .34, and .20 or .23."""
    heights = np.random.default_rng(0).standard_normal(shape).cumsum(axis=0).cumsum(axis=1)
    found = [
        fc.dimensions.estimate(fc.surfaces.from_array(heights * unit, 1e-5 * unit), "spectrum").hurst.item()
        for unit in (1.0, 7e-5, 1e9)
    ]
    assert found == pytest.approx([found[0]] * 3, rel=1e-7)
