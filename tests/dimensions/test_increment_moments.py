"""Mean square increments against numpy."""

import numpy as np
import pytest

from fractalcontact.base import threads
from fractalcontact.dimensions import _increment_moments


def plain_squares(heights, step=1):
    """Mean squares and numbers of the twelve increments, by numpy, NaN left out."""
    means, numbers = [], []
    for axis in (1, 0):
        for order in (1, 2):
            for lag in (1, 2, 4):
                d = heights
                for _ in range(order):
                    n, m = d.shape[axis], lag * step
                    d = d.take(range(m, n), axis) - d.take(range(max(n - m, 0)), axis) if n > m else d[:0]
                d = d[np.isfinite(d)]
                means.append(np.mean(d**2) if d.size else np.nan)
                numbers.append(d.size)
    return np.array(means), np.array(numbers)


@pytest.mark.parametrize("shape", [(40, 37), (9, 9), (6, 25), (1, 50)])
@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("gaps", [False, True])
def test_sums_equal_numpy(shape, step, gaps):
    rng = np.random.default_rng(1)
    heights = rng.standard_normal(shape).cumsum(axis=1)
    if gaps:
        heights[rng.random(shape) < 0.1] = np.nan
    means, numbers = plain_squares(heights, step)
    result = _increment_moments.increment_moments([(heights, shape[0])], shape, step)
    np.testing.assert_array_equal(result.counts, numbers)
    np.testing.assert_allclose(result.means, means, rtol=1e-12)


@pytest.mark.parametrize("gaps", [False, True])
def test_slabs_and_threads_change_no_bit(gaps):
    heights = np.random.default_rng(2).standard_normal((70, 40))
    if gaps:
        heights[33, 5] = np.nan
    complete = _increment_moments.increment_moments([(heights, 70)], (70, 40))
    parts = [(heights[a : a + 15 + _increment_moments.REACH], min(15, 70 - a)) for a in range(0, 70, 15)]
    for count in (1, 2):
        with threads.limit(count):
            sliced = _increment_moments.increment_moments(parts, (70, 40))
        np.testing.assert_array_equal(sliced.means, complete.means)
        np.testing.assert_array_equal(sliced.counts, complete.counts)
    assert (complete.observed is not None) is gaps
