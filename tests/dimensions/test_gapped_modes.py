"""The effect of gaps on cosine modes, against dense linear algebra."""

import numpy as np
import pytest
import scipy.fft

from fractalcontact.dimensions import _cosine_modes, _gapped_modes
from fractalcontact.dimensions._harmonic_interpolation import Filling


def squared_distances(observed):
    """Of all pairs of points, observed or not."""
    y, x = (p.ravel() for p in np.indices(observed.shape))
    return (y[:, None] - y) ** 2.0 + (x[:, None] - x) ** 2


def dense_operator(filling):
    """Columns: cosine modes of the filled surface for unit heights at each point, zero for missing points."""
    units = np.eye(filling.observed.size).reshape(-1, *filling.observed.shape)
    return np.array([_cosine_modes.cosine_modes(filling(unit)).ravel() for unit in units]).T


def test_gapped_modes_equal_dense_algebra(holes):
    hurst = 0.6
    lattice = _cosine_modes.Lattice.of(holes.shape, (1.0, 1.0))
    gapped = _gapped_modes.GappedModes(lattice, holes, 0.5, probes=500)
    filling = Filling(holes, (1.0, 1.0))
    operator = dense_operator(filling)
    dense = operator @ (-(squared_distances(holes) ** hurst) / (1 - hurst)) @ operator.T
    complete = _cosine_modes.expected_power(lattice, hurst).ravel()
    reference = gapped.reference_power().ravel()
    excess = gapped.excess(hurst)[0].ravel()
    assert np.sum((np.diag(dense) - complete) / reference) == pytest.approx(
        np.sum(excess / reference), rel=0.04
    )
    white = np.sum(operator**2, axis=1) - 1.0
    assert np.sum(white / reference) == pytest.approx(
        np.sum(gapped.white_excess().ravel() / reference), rel=0.04
    )
    weights = np.random.default_rng(8).standard_normal((2, *gapped.reference_power().shape))
    scaled = dense / np.sqrt(np.outer(reference, reference))
    exact = [[2 * np.sum(a.ravel()[:, None] * scaled * b.ravel() * scaled) for b in weights] for a in weights]
    result = gapped.score_covariance(weights, hurst)
    np.testing.assert_allclose(np.diag(result), np.diag(exact), rtol=0.05)
    assert abs(result[0, 1] - exact[0][1]) < 0.1 * np.sqrt(exact[0][0] * exact[1][1])


def test_relative_excess_equals_dense_algebra(holes):
    """Without the scatter of the left-out points, few probes are as good as many of `GappedModes`."""
    hurst = 0.6
    lattice, filling = _cosine_modes.Lattice.of(holes.shape, (1.0, 1.0)), Filling(holes, (1.0, 1.0))
    operator = dense_operator(filling)
    dense = operator @ (-(squared_distances(holes) ** hurst) / (1 - hurst)) @ operator.T
    complete = _cosine_modes.expected_power(lattice, hurst).ravel()
    excess = _gapped_modes.relative_excess(lattice, filling, hurst, 300).ravel()
    np.testing.assert_allclose(excess.sum(), np.sum(np.diag(dense) / complete - 1.0), rtol=0.01)
    assert np.abs(excess - (np.diag(dense) / complete - 1.0)).max() < 0.12
    white = _gapped_modes.relative_white_excess(filling, 300).ravel()
    np.testing.assert_allclose(white.sum(), np.sum(operator**2) - white.size, rtol=0.03)
    assert np.abs(white - (np.sum(operator**2, axis=1) - 1.0)).max() < 0.12


def test_excess_of_independent_modes_equals_dense_algebra(holes):
    """Modes along one axis are independent, too, with a power that continues that of the others."""
    lattice, filling = _cosine_modes.Lattice.of(holes.shape, (2.0, 1.0)), Filling(holes, (2.0, 1.0))
    power = _cosine_modes.expected_power(lattice, 0.6)
    whole = _gapped_modes.with_lines(power, (2.0, 1.0), 0.6)
    np.testing.assert_array_equal(whole[1:, 1:], power)
    assert whole[0, 0] == 0.0
    assert (np.diff(whole[1:, :3], axis=1) < 0.0).all()
    basis = scipy.fft.idctn(np.eye(holes.size).reshape(-1, *holes.shape), axes=(1, 2), norm="ortho")
    covariance = np.einsum("k,kij,klm->ijlm", whole.ravel(), basis, basis).reshape(holes.size, -1)
    operator = dense_operator(filling)
    dense = np.einsum("ki,ij,kj->k", operator, covariance, operator)
    excess = _gapped_modes.approximate_excess(whole, filling, 300).ravel()
    exact = dense / power.ravel() - 1.0
    np.testing.assert_allclose(excess.sum(), exact.sum(), rtol=0.01)
    assert np.abs(excess - exact).max() < 0.12
