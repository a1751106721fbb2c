"""Covariance of second differences along lattice directions."""

import numpy as np
import pytest
from scipy.linalg import expm

import fractalcontact as fc
from fractalcontact.dimensions import _second_differences

SPACING = 1e-4


def brownian(n, hurst, seed, spacing=SPACING, **options):
    return fc.surfaces.fbm((n, n), spacing, hurst=hurst, rms_increment=1e-6, rng=seed, **options)


def _pairs(shape, vectors):
    """Middle pairs of a complete surface."""
    return _second_differences.MiddlePairs(shape, np.prod(np.array(shape) - 2.0 * np.abs(vectors), axis=1))


@pytest.mark.parametrize(("hurst", "missing"), [(0.2, 0.0), (0.8, 0.0), (0.2, 0.2)])
def test_covariance_equals_scatter(hurst, missing):
    """A variance from a thousand small surfaces has a standard error of 4.5 %."""
    n = 40
    directions = _second_differences.lattice_directions(None, (1.0, 1.0))[:4]
    vectors = np.array([(m * direction.dy, m * direction.dx) for direction in directions for m in (1, 2)])
    is_missing = np.random.default_rng(19).random((n, n)) < missing
    logs = []
    for heights in brownian(n, hurst, 18, members=1000).values:
        heights[is_missing] = np.nan
        means = []
        for dy, dx in vectors:
            middle, far = heights[dy : n - dy, dx : n - dx], heights[2 * dy :, 2 * dx :]
            means.append(np.nanmean((heights[: n - 2 * dy, : n - 2 * dx] - 2 * middle + far) ** 2))
        logs.append(np.log(means))
    seen = ~is_missing
    numbers = [
        np.count_nonzero(
            seen[: n - 2 * dy, : n - 2 * dx] & seen[dy : n - dy, dx : n - dx] & seen[2 * dy :, 2 * dx :]
        )
        for dy, dx in vectors
    ]
    pairs = _second_differences.MiddlePairs.of(heights, missing == 0, vectors, np.array(numbers, float))
    expected = _second_differences.covariance(vectors, pairs, hurst, np.eye(2))
    result = np.cov(np.transpose(logs))
    assert np.diag(result) == pytest.approx(np.diag(expected), rel=0.17)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert result / scale == pytest.approx(expected / scale, abs=0.17)


def test_covariance_does_not_depend_on_reach():
    """Shifts beyond those summed one by one, and the coarse lattice of long lags, against a longer sum."""
    vectors = np.array([(0, 2), (3, 4), (8, 0), (6, -6)])
    shape, metric = (300, 200), expm([[0.3, 0.2], [0.2, -0.3]])
    line = np.stack([np.ones(3), np.arange(3)], axis=1)  # a slope along one direction
    for hurst, error in ((0.1, 1e-3), (0.6, 5e-3), (0.95, 0.02)):
        result = _second_differences.covariance(vectors, _pairs(shape, vectors), hurst, metric)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_second_differences, "REACH", 120)
            longer = _second_differences.covariance(vectors, _pairs(shape, vectors), hurst, metric)
        assert result == pytest.approx(longer, rel=error, abs=error * longer.max())
        far = np.array([(0, 12), (0, 24), (0, 48)])
        coarse = _second_differences.covariance(far, _pairs(shape, far), hurst, metric)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_second_differences, "LONG", 48)
            fine = _second_differences.covariance(far, _pairs(shape, far), hurst, metric)
        errors = [np.linalg.inv(line.T @ np.linalg.solve(spread, line))[1, 1] for spread in (coarse, fine)]
        assert errors[0] == pytest.approx(errors[1], rel=0.06)


def test_pairs_with_gaps_are_counted():
    heights = np.random.default_rng(22).standard_normal((20, 23))
    heights[np.random.default_rng(23).random(heights.shape) < 0.2] = np.nan
    vectors = np.array([(0, 1), (1, -2), (3, 2)])
    middles = [
        {
            (y, x)
            for y in range(dy, 20 - dy)
            for x in range(abs(dx), 23 - abs(dx))
            if np.isfinite([heights[y, x], heights[y - dy, x - dx], heights[y + dy, x + dx]]).all()
        }
        for dy, dx in vectors
    ]
    numbers = np.array([len(each) for each in middles])
    pairs = _second_differences.MiddlePairs.of(heights, False, vectors, numbers)
    for i, j in ((0, 0), (1, 0), (2, 1)):
        for y, x in ((0, 0), (0, 1), (1, -2), (3, 2), (4, 0), (2, -7)):
            expected = sum((a + y, b + x) in middles[i] for a, b in middles[j])
            assert pairs.counts[j][i - j, y, 24 + x] == pytest.approx(expected, abs=1e-3)
