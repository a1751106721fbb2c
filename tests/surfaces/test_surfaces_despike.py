"""Spikes put into a face are found again, and the face itself is left alone."""

import numpy as np
import pytest

import fractalcontact as fc


@pytest.fixture(scope="module")
def face():
    return fc.surfaces.fbm((120, 90), 3e-4, hurst=0.75, rms_increment=1e-4, rng=4)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_spikes_are_taken_out_and_nothing_else(face, seed):
    rng = np.random.default_rng(seed)
    spiked = face.copy(deep=True)
    places = rng.choice(face.size, 60, replace=False)
    spiked.values.ravel()[places] += rng.choice([-1, 1], 60) * rng.uniform(1.2e-3, 5e-3, 60)
    found = fc.surfaces.despike(spiked, threshold=8.0)
    taken = np.isnan(found.values)
    assert taken.ravel()[places].mean() > 0.95
    assert taken.sum() <= 65
    assert found.removed_points == taken.sum()
    np.testing.assert_array_equal(found.values[~taken], spiked.values[~taken])


def test_a_wide_spike_is_taken_from_its_edge_inwards(face):
    spiked = face.copy(deep=True)
    spiked.values[50:53, 40:43] += 3e-3
    spiked.values[70, 10] = np.nan
    taken = np.isnan(fc.surfaces.despike(spiked, window=7).values)
    assert taken[50:53, 40:43].all()
    assert taken[70, 10]


def test_a_slope_is_no_spike_and_units_do_not_matter(face):
    x = np.arange(90) * 3e-4
    tilted = face + 2.0 * x
    assert fc.surfaces.despike(tilted, threshold=9.0).removed_points == 0
    one, two = (fc.surfaces.despike(face * factor, threshold=4.0) for factor in (1.0, 2.0**20))
    assert one.removed_points > 0
    np.testing.assert_array_equal(np.isnan(one), np.isnan(two))
    flat = fc.surfaces.from_array(np.zeros((9, 9)), 1.0)
    assert fc.surfaces.despike(flat).removed_points == 0


def test_faults_are_named(face):
    with pytest.raises(ValueError, match=r"(?s)threshold.*window"):
        fc.surfaces.despike(face, threshold=0.0, window=4)
    with pytest.raises(ValueError, match="infinite"):
        fc.surfaces.despike(face.where(face > face.min(), np.inf))
    with pytest.raises(ValueError, match="surface: expected heights"):
        fc.surfaces.despike(face * np.nan)
