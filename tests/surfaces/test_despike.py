"""Despiking: inserted spikes are removed, and the surface itself is unchanged."""

import numpy as np
import pytest

import fractalcontact as fc


@pytest.fixture(scope="module")
def surface():
    return fc.surfaces.fbm((120, 90), 3e-4, hurst=0.75, rms_increment=1e-4, rng=4)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_spikes_are_removed_and_nothing_else(surface, seed):
    rng = np.random.default_rng(seed)
    spiked = surface.copy(deep=True)
    places = rng.choice(surface.size, 60, replace=False)
    spiked.values.ravel()[places] += rng.choice([-1, 1], 60) * rng.uniform(1.2e-3, 5e-3, 60)
    clean = fc.surfaces.despike(spiked, threshold=8.0)
    removed = np.isnan(clean.values)
    assert removed.ravel()[places].mean() > 0.95
    assert removed.sum() <= 65
    assert clean.removed_points == removed.sum()
    np.testing.assert_array_equal(clean.values[~removed], spiked.values[~removed])


def test_wide_spike_is_removed_from_its_edge_inwards(surface):
    spiked = surface.copy(deep=True)
    spiked.values[50:53, 40:43] += 3e-3
    spiked.values[70, 10] = np.nan
    removed = np.isnan(fc.surfaces.despike(spiked, size=7).values)
    assert removed[50:53, 40:43].all()
    assert removed[70, 10]


def test_slope_is_not_removed_and_units_do_not_matter(surface):
    x = np.arange(90) * 3e-4
    tilted = surface + 2.0 * x
    assert fc.surfaces.despike(tilted, threshold=9.0).removed_points == 0
    first, second = (fc.surfaces.despike(surface * factor, threshold=3.0) for factor in (1.0, 2.0**20))
    assert first.removed_points > 0
    np.testing.assert_array_equal(np.isnan(first), np.isnan(second))
    flat = fc.surfaces.from_array(np.zeros((9, 9)), 1.0)
    assert fc.surfaces.despike(flat).removed_points == 0


def test_profile():
    profile = fc.surfaces.fbm(512, 1e-5, hurst=0.7, rms_increment=1e-6, rng=1)
    assert fc.surfaces.despike(profile).removed_points == 0
    spiked = profile.copy()
    spiked[[1, 200, 201]] += 1e-4
    clean = fc.surfaces.despike(spiked)
    assert clean.dims == ("x",)
    assert np.flatnonzero(clean.isnull()).tolist() == [1, 200, 201]
    np.testing.assert_array_equal(clean.fillna(profile), profile)
    with pytest.raises(ValueError, match="size: expected an integer >= 3 and <= 512"):
        fc.surfaces.despike(spiked, size=513)


def test_invalid_arguments_are_refused(surface):
    with pytest.raises(ValueError, match=r"(?s)threshold.*size"):
        fc.surfaces.despike(surface, threshold=0.0, size=4)
    with pytest.raises(ValueError, match="infinite"):
        fc.surfaces.despike(surface.where(surface > surface.min(), np.inf))
    with pytest.raises(ValueError, match="surface: expected heights"):
        fc.surfaces.despike(surface * np.nan)


def test_heights_of_a_few_steps_are_no_spikes():
    rng = np.random.default_rng(3)
    steps = np.zeros((120, 120))
    for _ in range(60):  # plateaus with sharp edges: most residuals are zero, those at edges are not
        y, x = rng.integers(0, 100, 2)
        steps[y : y + 20, x : x + 20] += 1e-6
    heights = fc.surfaces.from_array(steps + 1e-9 * rng.standard_normal(steps.shape), 1e-5)
    assert int(fc.surfaces.despike(heights).removed_points) < 0.05 * heights.size


def test_spikes_of_a_smooth_surface_do_not_grow():
    """Beside a hole the median is one-sided: two thirds of this surface were taken, from ridges outwards."""
    smooth = fc.surfaces.spectral(
        (260, 260), 8e-5, hurst=0.78, rms_height=1e-4, rolloff=8e-3, short_cutoff=4e-3, rng=4
    )
    spiked = smooth.copy(deep=True)
    spiked.values[100:106, 200:206] += 1e-3
    removed = np.isnan(fc.surfaces.despike(spiked).values)
    assert removed[100:106, 200:206].all()
    assert removed.sum() < 0.01 * smooth.size
