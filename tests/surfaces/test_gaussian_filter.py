"""Gaussian filter against its transmission, its weights and its treatment of edges."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

CUTOFF = 12e-6


def surface_of(heights, spacing=1e-6, **options):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, **options)


@pytest.mark.parametrize("period", [6, 12, 24, 48])
@pytest.mark.parametrize("axis", [0, 1])
def test_transmission_of_a_wave(period, axis):
    """exp(-pi (a cutoff / wavelength)^2) with a^2 = ln 2 / pi: a power of two."""
    wave = np.cos(2 * np.pi * np.arange(96) / period)
    heights = np.tile(wave, (96, 1)) if axis else np.tile(wave[:, None], (1, 96))
    filtered = fc.surfaces.gaussian_filter(surface_of(heights, periodic=True), CUTOFF)
    assert float(filtered.max()) == pytest.approx(2.0 ** -((12 / period) ** 2), abs=1e-5)


@pytest.mark.parametrize("n", [3, 5, 8, 40])
@pytest.mark.parametrize("cutoff", [12, 60, 400])
def test_a_cutoff_beyond_a_periodic_edge_leaves_the_mean(n, cutoff):
    """The weights go on around the edge: cut off at it, they passed a twentieth of such a wave."""
    wave = 1.0 + np.cos(2 * np.pi * np.arange(n) / n)
    surface = surface_of(np.tile(wave[:, None], (1, 400)), periodic=True)
    filtered = fc.surfaces.gaussian_filter(surface, cutoff * 1e-6)
    exact = 1.0 + 2.0 ** -((cutoff / n) ** 2) * np.cos(2 * np.pi * np.arange(n) / n)
    np.testing.assert_allclose(filtered[:, 2], exact, atol=3e-5)


@pytest.mark.parametrize("cutoff", [4, 6, 12])
@pytest.mark.parametrize("period", [4, 6, 8, 16])
def test_stated_error_holds_from_four_spacings_on(cutoff, period):
    """For the shortest wave, which the statement leaves out, a cutoff of four spacings is 0.06 off."""
    wave = np.tile(np.cos(2 * np.pi * np.arange(96) / period), (96, 1))
    filtered = fc.surfaces.gaussian_filter(surface_of(wave, periodic=True), cutoff * 1e-6)
    assert "0.002 of the amplitude of waves of at least four spacings" in filtered.attrs["provenance"]
    assert float(filtered.max()) == pytest.approx(2.0 ** -((cutoff / period) ** 2), abs=2e-3)


def test_long_and_short_add_up():
    rough = fc.surfaces.fbm((40, 50), 1e-6, hurst=0.5, rms_increment=1e-7, rng=1)
    long, short = (fc.surfaces.gaussian_filter(rough, CUTOFF, waves=waves) for waves in ("long", "short"))
    np.testing.assert_allclose((long + short).values, rough.values, rtol=0, atol=1e-20)


def test_weights_at_an_edge_and_beside_a_gap():
    heights = np.random.default_rng(3).standard_normal((20, 23))
    heights[4, 5] = np.nan
    filtered = fc.surfaces.gaussian_filter(surface_of(heights), 6e-6)
    y, x = np.indices(heights.shape)
    alpha = np.sqrt(np.log(2) / np.pi)
    for row, column in ((0, 0), (4, 6), (10, 12)):
        near = (abs(y - row) <= 6) & (abs(x - column) <= 6) & np.isfinite(heights)
        weights = np.exp(-np.pi * ((y - row) ** 2 + (x - column) ** 2) / (alpha * 6) ** 2)[near]
        expected = weights @ heights[near] / weights.sum()
        assert float(filtered[row, column]) == pytest.approx(expected, rel=1e-9)
    assert np.isnan(filtered[4, 5])
    assert int(filtered.isnull().sum()) == 1


@pytest.mark.parametrize("spacing", [7e-6, 1.1e-4, 1.7e-3])
def test_a_cutoff_of_whole_spacings_does_not_depend_on_the_unit(spacing):
    """The last weight, at one cutoff, counts whichever way 5 spacings are rounded."""
    heights = np.random.default_rng(4).standard_normal((20, 23))
    expected = fc.surfaces.gaussian_filter(surface_of(heights, 1.0), 5.0)
    filtered = fc.surfaces.gaussian_filter(surface_of(heights, spacing), 5 * spacing)
    np.testing.assert_allclose(filtered, expected, rtol=0, atol=1e-12)


def test_constant_profile_stays():
    filtered = fc.surfaces.gaussian_filter(surface_of(np.full(40, 3.0)), CUTOFF)
    np.testing.assert_allclose(filtered, 3.0, rtol=1e-15)


@pytest.mark.parametrize("cutoff", [2e-6, 1.0])
def test_cutoff_outside_the_lengths_is_refused(cutoff):
    with pytest.raises(InvalidInput, match="four spacings"):
        fc.surfaces.gaussian_filter(surface_of(np.eye(30)), cutoff)
