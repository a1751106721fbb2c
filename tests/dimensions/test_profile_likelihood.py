"""Exact likelihood of a profile against dense linear algebra."""

import numpy as np
import pytest

from fractalcontact.base import threads
from fractalcontact.dimensions import _profile_increments


def test_deviance_equals_dense_algebra():
    rng = np.random.default_rng(9)
    heights = np.cumsum(rng.standard_normal(60))
    heights[[3, 4, 20, 41]] = np.nan
    places = np.flatnonzero(np.isfinite(heights)).astype(float)
    jumps, gaps = np.diff(heights[np.isfinite(heights)]), np.diff(places)

    def dense(hurst, noise):
        rise = -0.5 * np.abs(places[:, None] - places) ** (2 * hurst) + noise * np.eye(places.size)
        covariance = np.diff(np.diff(rise, axis=0), axis=1)
        inverse = np.linalg.inv(covariance)
        own = gaps @ inverse @ gaps
        square = jumps @ inverse @ jumps - (jumps @ inverse @ gaps) ** 2 / own
        freedom = jumps.size - 1
        return np.linalg.slogdet(covariance)[1] + np.log(own) + freedom * np.log(square / freedom)

    increments = _profile_increments.ProfileIncrements(heights)
    for hurst, noise in ((0.2, 0.0), (0.7, 0.3), (0.95, 0.0)):
        assert increments.solve(hurst, noise)[0] == pytest.approx(dense(hurst, noise), rel=1e-10)


def test_regular_chunks_share_factorisation():
    heights = np.cumsum(np.random.default_rng(10).standard_normal(600))
    complete = _profile_increments.ProfileIncrements(heights)
    assert complete.positions.shape == (3, 200)
    assert complete.is_regular
    deviance, amplitude = complete.solve(0.6, 0.1)
    complete.is_regular = False
    again = complete.solve(0.6, 0.1)
    assert (deviance, amplitude) == pytest.approx(again, rel=1e-12)


def test_threads_change_no_bit():
    heights = np.cumsum(np.random.default_rng(11).standard_normal(1100))
    heights[::97] = np.nan
    result = []
    for count in (1, 2):
        with threads.limit(count):
            result.append(_profile_increments.fit_profile(heights))
    assert result[0] == result[1]


def test_deviance_of_smooth_profile_equals_dense_contrasts():
    """Second differences with weights that vanish on a straight line, of heights with the covariance r^2H."""
    heights = np.cumsum(np.cumsum(np.random.default_rng(12).standard_normal(50)))
    places = np.arange(50.0)
    contrasts = np.diff(np.eye(50), 2, axis=0)
    increments = _profile_increments.ProfileIncrements(heights)

    def dense(hurst):
        covariance = contrasts @ np.abs(places[:, None] - places) ** (2 * hurst) @ contrasts.T
        covariance *= 0.5 / (hurst - 1.0)
        values = contrasts @ heights
        square = values @ np.linalg.solve(covariance, values)
        return np.linalg.slogdet(covariance)[1] + values.size * np.log(square / values.size)

    known = dense(1.2) - increments.solve(1.2, 0.0)[0]  # a constant: another choice of contrasts
    for hurst in (1.05, 1.5, 1.85):
        assert dense(hurst) - increments.solve(hurst, 0.0)[0] == pytest.approx(known, abs=1e-5)


@pytest.mark.parametrize(("hurst", "square"), [(0.3, 0.3), (0.7, 2.0)])
def test_deviance_of_blurred_profile_equals_dense_algebra(hurst, square):
    """The variogram of blurred heights, by quadrature; that of filtered ones by the filter as a matrix."""
    heights = np.cumsum(np.random.default_rng(13).standard_normal(30))
    increments = _profile_increments.ProfileIncrements(heights)
    jumps, lags = np.diff(heights), np.arange(30.0)
    u = np.linspace(-9.0, 9.0, 180001) * np.sqrt(2.0 * square)
    weights = np.exp(-(u**2) / (4.0 * square)) / np.exp(-(u**2) / (4.0 * square)).sum()
    blurred = [np.sum(weights * (np.abs(lag + u) ** (2 * hurst) - np.abs(u) ** (2 * hurst))) for lag in lags]
    k = np.arange(-12, 13)
    taps = np.exp(-(k**2) / (2.0 * square)) / np.exp(-(k**2) / (2.0 * square)).sum()
    both = np.add.outer(k, k)
    filtered = [
        taps @ (np.abs(lag + both) ** (2 * hurst) - np.abs(both) ** (2 * hurst)) @ taps for lag in lags
    ]
    for of_samples, variogram in ((False, blurred), (True, filtered)):
        rise = -0.5 * np.array(variogram)[np.abs(np.subtract.outer(np.arange(30), np.arange(30)))]
        covariance = np.diff(np.diff(rise + 0.05 * np.eye(30), axis=0), axis=1)
        inverse, gaps = np.linalg.inv(covariance), np.ones(29)
        own = gaps @ inverse @ gaps
        mean_square = (jumps @ inverse @ jumps - (jumps @ inverse @ gaps) ** 2 / own) / 28
        dense = np.linalg.slogdet(covariance)[1] + np.log(own) + 28 * np.log(mean_square)
        result = increments.solve(hurst, 0.05, square, of_samples=of_samples)[0]
        assert result == pytest.approx(dense, abs=1e-3)
