"""Faces that belong to no family: their interval is widened or withheld, and it is said why."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments
from fractalcontact.dimensions._quantisation import quantisation

SIZE, SPACING, STEP = 96, 1e-4, 1e-5


def brownian(hurst, rng, shape=(SIZE, SIZE)):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=STEP, rng=rng).values


def rounded(heights, levels):
    step = np.ptp(heights) / levels
    return np.round((heights - heights.min()) / step) * step


def with_spikes(heights, rng):
    spiked = heights.copy()
    places = np.random.default_rng(rng).integers(0, SIZE, (2, 5))
    spiked[tuple(places)] += 50 * STEP
    return spiked


def oblique_step(heights):
    y, x = np.indices(heights.shape)
    return heights + 20 * STEP * (x + 0.37 * y > 0.6 * SIZE)


def of(heights, method, **options):
    found = fc.dimensions.estimate(fc.surfaces.from_array(heights, SPACING), method, **options)
    found = found.isel(method=0)
    return (
        float(found.hurst),
        float(found.ci_low),
        float(found.ci_high),
        json.loads(found.hurst.attrs["comment"]).get(method, ""),
    )


FACES = {
    "an oblique step": (0.7, lambda s: oblique_step(brownian(0.7, s)), "parts|share"),
    "outliers": (0.7, lambda s: with_spikes(brownian(0.7, s), s), "parts"),
    "8 bits": (0.9, lambda s: rounded(brownian(0.9, s), 255), "rounded to steps"),
    "5 bits": (0.7, lambda s: rounded(brownian(0.7, s), 31), "rounded to steps"),
}


@pytest.mark.parametrize("method", ["likelihood", "increments"])
@pytest.mark.parametrize("name", FACES)
def test_what_was_done_to_a_brownian_face_widens_the_interval_to_its_exponent(name, method):
    hurst, make, words = FACES[name]
    for seed in (1, 3):
        found, low, high, note = of(make(seed), method)
        assert abs(found - hurst) > 0.02  # the estimate itself is wrong ...
        assert low - 0.05 <= hurst <= high + 0.05  # ... and its interval is not that of one that is right
        assert any(word in note for word in words.split("|"))


@pytest.mark.parametrize("method", ["likelihood", "increments"])
def test_two_faces_side_by_side_have_no_single_exponent(method):
    half = (SIZE, SIZE // 2)
    rough, smooth = brownian(0.3, 4, half), brownian(0.8, 5, half)
    heights = np.concatenate([rough, smooth - smooth[:, :1] + rough[:, -1:]], axis=1)
    _, low, high, note = of(heights, method)
    assert low < 0.35
    assert high > 0.62
    assert "differs from part to part" in note


@pytest.mark.parametrize("method", ["likelihood", "increments"])
def test_patches_of_unequal_roughness_count_for_fewer_points(method):
    """The scatter of the estimate on lognormal faces, and the width of its interval."""
    found = [of(np.exp(brownian(0.5, s) / (5 * STEP)), method)[:3] for s in range(8)]
    hurst, low, high = np.array(found).T
    half = 0.5 * (high - low)
    assert np.std(hurst) < np.mean(half) < 8 * np.std(hurst)
    assert np.mean(half) > 3 * 1.96 * 0.008


@pytest.mark.parametrize("periodic", [False, True])
def test_a_stretched_face_is_told_by_the_share_of_its_waves(periodic):
    face = fc.surfaces.spectral(
        (SIZE, SIZE), SPACING, hurst=0.7, rms_height=STEP, anisotropy_ratio=2.0, azimuth=30.0, rng=6
    )
    found = fc.dimensions.estimate(face if periodic else fc.surfaces.from_array(face.values, SPACING))
    assert "more than their share" in found.hurst.attrs["comment"]
    if periodic:
        assert float(found.ci_low[0]) < 0.7 < float(found.ci_high[0])


def test_a_band_limited_periodic_face_is_of_the_family():
    for seed in range(5):
        face = fc.surfaces.spectral(
            (SIZE, SIZE), SPACING, hurst=0.7, rms_height=STEP, rolloff=2e-3, short_cutoff=4e-4, rng=seed
        )
        assert "share" not in fc.dimensions.estimate(face).hurst.attrs["comment"]


@pytest.mark.parametrize(
    ("shape", "steps"), [((40, 40), (1.0, 1.0)), ((24, 90), (3.0, 1.0)), ((1, 400), (1.0,))]
)
@pytest.mark.parametrize("gaps", [0.0, 0.15])
def test_faces_of_the_family_are_even(shape, steps, gaps):
    size = shape if len(steps) == 2 else shape[1]
    spacing = steps if len(steps) == 2 else 1.0
    for hurst in (0.1, 0.5, 0.9):
        faces = fc.surfaces.fbm(size, spacing, hurst=hurst, rms_increment=1.0, members=40, rng=7).values
        missing = np.random.default_rng(8).random(shape) < gaps
        alarms = []
        for face in faces:
            heights = np.where(missing, np.nan, face.reshape(shape))
            moments = increment_moments([(heights, len(heights))], shape[-len(steps) :])
            assert len(moments.blocks[0]) > 1
            alarms.append(bool(heterogeneity(moments, steps, hurst).note))
        assert sum(alarms) <= 1


def test_profiles_that_were_rounded_or_are_uneven_say_so():
    heights = brownian(0.8, 9, 300)
    _, low, high, note = of(rounded(heights, 63), "likelihood")
    assert low < 0.8 < high
    assert "rounded to steps" in note
    _, _, _, note = of(heights * np.where(np.arange(300) < 100, 8.0, 1.0), "likelihood")
    assert "not equally rough" in note


@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (1e-9, 0.0), (1e6, 3e6), (25.4e-3, -1.0)])
def test_the_step_of_rounded_heights_is_found_in_any_unit(factor, offset):
    heights = np.round(6 * np.random.default_rng(10).standard_normal((64, 64)).cumsum(axis=1))
    step, share = quantisation(heights * factor + offset)
    assert step == pytest.approx(factor, rel=1e-6)
    bend = np.mean(np.diff(heights[::4], 2, axis=1) ** 2)
    assert share == pytest.approx(0.5 / bend, rel=0.1)


def test_heights_that_were_not_rounded_have_no_step():
    assert quantisation(brownian(0.6, 11)) == (0.0, 0.0)
    assert quantisation(np.zeros((20, 20))) == (0.0, 0.0)
    assert quantisation(np.full((20, 20), np.nan)) == (0.0, 0.0)
    assert quantisation(np.arange(9.0)[None]) == (0.0, 0.0)


def test_noise_that_was_asked_for_explains_the_rounding():
    _, low, high, note = of(rounded(brownian(0.9, 12), 255), "likelihood", noise=True)
    assert low < 0.9 < high
    assert "rounded" not in note


@pytest.mark.parametrize("method", ["increments", "likelihood"])
@pytest.mark.parametrize("rng", [1, 2, 3])
def test_noise_that_nobody_asked_for_is_told_and_the_interval_holds_what_is_under_it(method, rng):
    heights = brownian(0.9, rng, (128, 128))
    noise = np.random.default_rng(rng).standard_normal(heights.shape)
    hurst, low, high, note = of(heights + np.sqrt(0.05) * STEP * noise, method)
    assert "changes with" in note
    assert "white noise" in note
    assert hurst < 0.85
    assert low < 0.9 < high


def test_noise_on_a_profile_is_told_too():
    heights = brownian(0.9, 4, 4096)
    noise = np.random.default_rng(4).standard_normal(heights.shape)
    hurst, low, high, note = of(heights + np.sqrt(0.05) * STEP * noise, "likelihood")
    assert "white noise" in note
    assert hurst < 0.85
    assert low < 0.9 < high
