"""Covariance of mean square increments against dense linear algebra."""

import numpy as np
import pytest

from fractalcontact.dimensions import _increment_covariance

STENCILS = {1: np.array([-1.0, 1.0]), 2: np.array([1.0, -2.0, 1.0])}


def dense_covariance(shape, steps, order, hurst, observed=None):
    """Covariance of the logarithms of the mean squares, from the covariance of all increments."""
    axes = len(shape)
    index = np.arange(np.prod(shape)).reshape(shape)
    positions = np.stack([p.ravel() * s for p, s in zip(np.indices(shape), steps, strict=True)])
    distance = np.sqrt(((positions[:, :, None] - positions[:, None, :]) ** 2).sum(axis=0))
    generalised = -0.5 * distance ** (2 * hurst)
    rows = []
    for axis in range(axes):
        for lag in (1, 2, 4):
            parts = [
                index.take(range(i * lag, shape[axis] - (order - i) * lag), axis).ravel()
                for i in range(order + 1)
            ]
            complete = np.ones(parts[0].size, dtype=bool)
            if observed is not None:
                for part in parts:
                    complete &= observed.ravel()[part]
            operator = np.zeros((parts[0].size, index.size))
            for part, weight in zip(parts, STENCILS[order], strict=True):
                operator[np.arange(part.size), part] = weight
            rows.append(operator[complete])
    own = [np.mean(np.einsum("ij,jk,ik->i", a, generalised, a)) for a in rows]
    return np.array(
        [
            [2 * np.mean((a @ generalised @ b.T) ** 2) / (own[i] * own[j]) for j, b in enumerate(rows)]
            for i, a in enumerate(rows)
        ]
    )


@pytest.mark.parametrize(
    ("shape", "steps"), [((14, 13), (1.0, 1.0)), ((13, 12), (2.0, 1.0)), ((60,), (1.0,))]
)
@pytest.mark.parametrize(("order", "hurst"), [(1, 0.2), (2, 0.7)])
def test_covariance_equals_dense_algebra(shape, steps, order, hurst):
    overlap = _increment_covariance.complete_pairs(shape, order, 1)
    result = _increment_covariance.covariance_of_logs(hurst, steps, order, overlap, 1)
    exact = dense_covariance(shape, steps, order, hurst)
    np.testing.assert_allclose(result, exact, rtol=0.02, atol=2e-3 * exact.max())


def test_covariance_with_gaps_equals_dense_algebra():
    rng = np.random.default_rng(3)
    observed = rng.random((14, 13)) > 0.15
    observed[5:8, 5:9] = False
    overlap = _increment_covariance.gapped_pairs(observed, 2, 2, 1)
    result = _increment_covariance.covariance_of_logs(0.6, (1.0, 1.0), 2, overlap, 1)
    exact = dense_covariance((14, 13), (1.0, 1.0), 2, 0.6, observed)
    np.testing.assert_allclose(result, exact, rtol=0.03, atol=3e-3 * exact.max())
