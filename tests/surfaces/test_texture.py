"""Correlation lengths and core parameters against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

import fractalcontact as fc


def surface_of(heights, spacing=1e-6, **options):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, **options)


def test_core_of_gaussian_heights():
    """The line of the core is the regression of the normal quantiles on the ratios 0.3 to 0.7."""
    heights = norm.ppf((np.arange(40000) + 0.5) / 40000)
    np.random.default_rng(1).shuffle(heights)
    result = fc.surfaces.texture(surface_of(heights.reshape(200, 200) * 1e-6))
    core = quad(lambda p: (p - 0.5) * norm.ppf(p), 0.3, 0.7)[0] / (0.4**3 / 12)
    assert float(result.core_height) == pytest.approx(core * 1e-6, rel=1e-6)
    share = norm.sf(0.5 * core)
    assert float(result.peak_material_ratio) == pytest.approx(share, abs=1e-4)
    assert float(result.valley_material_ratio) == pytest.approx(1.0 - share, abs=1e-4)
    above = norm.pdf(0.5 * core) - 0.5 * core * share
    for name in ("reduced_peak_height", "reduced_valley_depth"):
        assert float(result[name]) == pytest.approx(2.0 * above / share * 1e-6, rel=2e-3)


def test_core_of_evenly_distributed_heights_is_their_range():
    heights = np.random.default_rng(2).permutation(np.linspace(0.0, 1.0, 2500)).reshape(50, 50)
    result = fc.surfaces.texture(surface_of(heights))
    assert float(result.core_height) == pytest.approx(1.0, rel=1e-3)
    assert float(result.reduced_peak_height) == float(result.reduced_valley_depth) == 0.0
    assert float(result.peak_material_ratio) == 0.0
    assert float(result.valley_material_ratio) == 1.0


def test_plateau_with_pits():
    """A tenth of the area is a pit of a depth far beyond the plateau."""
    heights = np.random.default_rng(2).permutation(np.linspace(0.0, 1.0, 10000))
    heights[np.random.default_rng(3).choice(10000, 1000, replace=False)] = -9.0
    result = fc.surfaces.texture(surface_of(heights.reshape(100, 100)))
    assert float(result.valley_material_ratio) == pytest.approx(0.9, abs=0.02)
    assert float(result.reduced_valley_depth) > 15.0  # a triangle of the area of the pits
    assert float(result.reduced_peak_height) < 0.05


def test_lengths_of_crossed_waves():
    """cos x + cos y is correlated as (cos u + cos v) / 2: 0.2 at 0.308 periods diagonally, 0.352 along x."""
    phase = 2 * np.pi * np.arange(96) / 48
    result = fc.surfaces.texture(surface_of(np.add.outer(np.cos(phase), np.cos(phase)), periodic=True))
    shortest, longest = np.sqrt(2) * np.arccos(0.2), np.arccos(-0.6)
    period = 48e-6 / (2 * np.pi)
    assert float(result.autocorrelation_length) == pytest.approx(shortest * period, rel=1e-3)
    assert float(result.texture_aspect_ratio) == pytest.approx(shortest / longest, rel=1e-3)


@pytest.mark.parametrize("ratio", [1, 3])
def test_aspect_ratio_of_stretched_texture(ratio):
    """Filtered white noise: the correlation is Gaussian, with 2 ln 5 spreads squared at 0.2."""
    rng = np.random.default_rng(4)
    n, spread = 512, 6.0
    waves = 2 * np.pi * np.fft.fftfreq(n)
    transfer = np.exp(-0.5 * spread**2 * ((ratio * waves[:, None]) ** 2 + waves**2))
    heights = np.fft.ifft2(np.fft.fft2(rng.standard_normal((n, n))) * transfer).real
    result = fc.surfaces.texture(surface_of(heights, 1e-6, periodic=True))
    expected = 2.0 * spread * np.sqrt(np.log(5.0))
    assert float(result.autocorrelation_length) == pytest.approx(expected * 1e-6, rel=0.12)
    assert float(result.texture_aspect_ratio) == pytest.approx(1.0 / ratio, rel=0.25)


def test_a_lay_has_no_aspect_ratio_but_a_length():
    heights = np.tile(np.sin(2 * np.pi * np.arange(64) / 16), (64, 1))
    result = fc.surfaces.texture(surface_of(heights, periodic=True))
    assert float(result.autocorrelation_length) == pytest.approx(
        16e-6 * np.arccos(0.2) / (2 * np.pi), rel=0.02
    )
    assert np.isnan(result.texture_aspect_ratio)
    assert "every direction" in result.texture_aspect_ratio.attrs["reason"]


def test_gaps_change_little():
    rough = fc.surfaces.spectral((128, 128), 1e-6, hurst=0.7, rms_height=1e-7, rolloff=2e-5, rng=3)
    holes = rough.where(np.random.default_rng(5).random(rough.shape) > 0.2)
    whole, gapped = fc.surfaces.texture(rough), fc.surfaces.texture(holes)
    for name in ("autocorrelation_length", "core_height", "reduced_valley_depth"):
        assert float(gapped[name]) == pytest.approx(float(whole[name]), rel=0.1)


@pytest.mark.parametrize("factor", [1e-9, 1e6])
def test_units_of_height_do_not_matter(factor):
    rough = fc.surfaces.fbm((48, 48), 1e-6, hurst=0.5, rms_increment=1e-6, rng=3)
    first, second = fc.surfaces.texture(rough), fc.surfaces.texture(rough * factor)
    assert float(second.core_height) == pytest.approx(factor * float(first.core_height), rel=1e-9)
    assert float(second.autocorrelation_length) == pytest.approx(
        float(first.autocorrelation_length), rel=1e-9
    )


def test_constant_and_empty_surfaces_have_a_reason():
    flat = fc.surfaces.texture(surface_of(np.ones((8, 8))))
    assert np.isnan(flat.autocorrelation_length)
    assert "equal" in flat.autocorrelation_length.attrs["reason"]
    assert float(flat.core_height) == 0.0
    empty = fc.surfaces.texture(surface_of(np.full((8, 8), np.nan)))
    assert np.isnan(empty.core_height)
    assert "observed" in empty.core_height.attrs["reason"]


def two_waves(ny, nx):
    """Waves of 120 points along y and of 300 along x: rays across a narrow strip end before they fall."""
    waves = (np.cos(2 * np.pi * np.arange(n) / period) for n, period in ((ny, 120), (nx, 300)))
    return np.add.outer(*waves)


def test_a_ray_that_ends_at_the_edge_has_not_fallen():
    """Rounding puts the end of a ray beyond the last lag, where the correlation is not zero."""
    strip = two_waves(40, 800)
    ratios = [fc.surfaces.texture(surface_of(z)).texture_aspect_ratio for z in (strip, strip.T)]
    lengths = [fc.surfaces.texture(surface_of(z)).autocorrelation_length for z in (strip, strip.T)]
    np.testing.assert_allclose(*map(float, lengths), rtol=1e-9)
    assert np.isnan(ratios).all()


def test_no_length_is_the_shortest_where_a_shorter_ray_has_not_fallen():
    """Across the strip the correlation falls at 31 points; half of the strip are 20, along it are 81."""
    strip = two_waves(40, 800)
    result = fc.surfaces.texture(surface_of(strip))
    assert np.isnan(result.autocorrelation_length)
    assert "every direction" in result.autocorrelation_length.attrs["reason"]
    whole = fc.surfaces.texture(surface_of(two_waves(800, 800)))
    assert float(whole.autocorrelation_length) == pytest.approx(
        120e-6 * np.arccos(-0.6) / (2 * np.pi), rel=0.1
    )
