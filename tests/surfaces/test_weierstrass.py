"""Weierstrass surfaces: the sum of waves written out, their height and variogram."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, TooLittleMemory


def weierstrass(shape=(9, 14), spacing=1e-3, *, hurst=0.6, rms_height=1e-6, rng=1, **options):
    return fc.surfaces.weierstrass(shape, spacing, hurst=hurst, rms_height=rms_height, rng=rng, **options)


def test_rms_height_is_exact():
    for shape in ((40, 50), 64):
        surface = weierstrass(shape, rms_height=3.0)
        assert surface.values.std() == pytest.approx(3.0, rel=1e-13)
        assert abs(surface.values.mean()) < 1e-14


def test_heights_are_the_sum_of_waves():
    shape, spacing, hurst, ratio, ridges = (12, 20), (1e-3, 2e-3), 0.7, 1.7, 3
    heights = weierstrass(shape, spacing, hurst=hurst, ratio=ratio, ridges=ridges, rms_height=1.0).values
    stream = np.random.default_rng(1)
    first = stream.random()
    longest = 20 * 2e-3
    waves = 1 + int(np.floor(np.log(longest / 4e-3) / np.log(ratio)))
    phases = 2 * np.pi * stream.random(waves * ridges).reshape(waves, ridges)
    x, y = np.meshgrid(np.arange(20) * 2e-3, np.arange(12) * 1e-3)
    total = np.zeros(shape)
    for n in range(waves):
        for m in range(ridges):
            azimuth = np.pi * (m + first) / ridges
            along = x * np.cos(azimuth) + y * np.sin(azimuth)
            total += ratio ** (-hurst * n) * np.cos(2 * np.pi * ratio**n * along / longest + phases[n, m])
    total -= total.mean()
    np.testing.assert_allclose(heights, total / total.std(), atol=1e-11)


def test_variogram_follows_the_exponent():
    heights = weierstrass((256, 256), 1.0, hurst=0.6, rms_height=1.0, members=20).values
    lags = np.array([4, 8, 16, 32])
    squares = [np.mean((heights[:, :, lag:] - heights[:, :, :-lag]) ** 2) for lag in lags]
    slope = np.polyfit(np.log(lags), np.log(squares), 1)[0]
    assert slope == pytest.approx(1.2, abs=0.15)


@pytest.mark.parametrize(
    ("options", "problem"),
    [({"ratio": 1.0}, "ratio"), ({"ridges": 0}, "ridges"), ({"rms_height": -1.0}, "rms_height")],
)
def test_invalid_arguments_are_refused(options, problem):
    with pytest.raises(InvalidInput, match=problem):
        weierstrass(**options)


@pytest.mark.parametrize("shape", [(9, 14), 20])
def test_more_waves_than_fit_into_memory_are_refused(shape):
    with pytest.raises(TooLittleMemory, match=r"waves at 2\d places along the axes: about"):
        weierstrass(shape, ratio=1 + 1e-12)
