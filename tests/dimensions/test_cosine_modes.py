"""Cosine modes of free surfaces against dense linear algebra."""

import numpy as np
import pytest
import scipy.fft
import scipy.stats

from fractalcontact.dimensions import _cosine_modes
from fractalcontact.dimensions._harmonic_interpolation import Filling


def squares(shape, steps, observed=None):
    y, x = (p.ravel() for p in np.indices(shape))
    if observed is not None:
        y, x = y[observed.ravel()], x[observed.ravel()]
    return (steps[0] * (y[:, None] - y)) ** 2 + (steps[1] * (x[:, None] - x)) ** 2


def orthonormal_modes(shape):
    """Rows: orthonormal cosine modes that vary along both axes."""
    points = np.eye(shape[0] * shape[1]).reshape(-1, *shape)
    return scipy.fft.dctn(points, axes=(1, 2), norm="ortho")[:, 1:, 1:].reshape(points.shape[0], -1).T


@pytest.fixture(scope="module")
def holes():
    rng = np.random.default_rng(5)
    observed = rng.random((12, 14)) > 0.15
    observed[4:7, 0:4] = False
    observed[0, -1] = observed[-1, 0] = observed[0, 0] = observed[-1, -1] = True
    return observed


@pytest.mark.parametrize("shape", [(9, 9), (8, 13), (3, 20)])
@pytest.mark.parametrize("ratio", [1.0, 2.5])
@pytest.mark.parametrize("hurst", [0.05, 0.5, 0.9])
def test_expected_power_equals_dense_covariance(shape, ratio, hurst):
    lattice = _cosine_modes.Lattice.of(shape, (ratio, 1.0))
    modes = orthonormal_modes(shape)
    dense = -(squares(shape, (ratio, 1.0)) ** hurst) / (1.0 - hurst)
    expected = np.einsum("ki,ij,kj->k", modes, dense, modes)
    np.testing.assert_allclose(_cosine_modes.expected_power(lattice, hurst).ravel(), expected, rtol=1e-10)


def test_expected_power_is_smooth_at_one():
    lattice = _cosine_modes.Lattice.of((16, 16), (1.0, 1.0))
    below, at, above = (_cosine_modes.expected_power(lattice, h) for h in (1 - 1e-5, 1.0, 1 + 1e-5))
    assert (at > 0).all()
    np.testing.assert_allclose(0.5 * (below + above), at, rtol=1e-7)


def test_power_ignores_planes_rows_and_columns():
    rng = np.random.default_rng(1)
    heights = rng.standard_normal((12, 15))
    expected = (orthonormal_modes((12, 15)) @ heights.ravel()) ** 2
    np.testing.assert_allclose(_cosine_modes.mode_power(heights).ravel(), expected, rtol=1e-10, atol=1e-14)
    moved = heights + rng.standard_normal((12, 1)) + rng.standard_normal(15) + 3.0 * np.arange(15)
    np.testing.assert_allclose(_cosine_modes.mode_power(moved).ravel(), expected, rtol=1e-8, atol=1e-12)


def test_wavelengths_along_diagonal():
    lengths = _cosine_modes.wavelengths(_cosine_modes.Lattice.of((10, 20), (2.0, 1.0)))
    assert lengths.shape == (9, 19)
    assert lengths[0, 0] == pytest.approx(1.0 / np.hypot(1 / 40, 1 / 40))


def test_filling_of_plane_and_transpose(holes):
    filling = Filling(holes, (2.0, 1.0))
    y, x = np.indices(holes.shape)
    plane = 0.3 * y - 0.1 * x + 5.0
    assert np.abs(filling(plane[holes])).max() < 1e-12
    rng = np.random.default_rng(6)
    surface, values = rng.standard_normal(holes.shape), rng.standard_normal(holes.sum())
    assert np.sum(filling(values) * surface) == pytest.approx(values @ filling.transpose(surface), rel=1e-12)


@pytest.mark.parametrize("ratio", [1.0, 1.3])
def test_large_gaps_are_harmonic(ratio):
    """Each missing height is the weighted mean of its neighbours, whichever solver is used."""
    rng = np.random.default_rng(9)
    observed = rng.random((260, 301)) > 0.05
    observed[20:230, 40:240] = False  # 2^15 points and more are not eliminated
    observed[:, -30:-20] = False
    observed[100:104, 100:104] = True
    filling = Filling(observed, (ratio, 1.0))
    values = np.cumsum(rng.standard_normal(observed.shape), axis=1)[observed]
    filled = np.pad(filling(values), 1, mode="edge")  # the border has no neighbour beyond it
    vertical = filled[2:, 1:-1] + filled[:-2, 1:-1] - 2.0 * filled[1:-1, 1:-1]
    along = filled[1:-1, 2:] + filled[1:-1, :-2] - 2.0 * filled[1:-1, 1:-1]
    assert np.abs((vertical / ratio**2 + along)[~observed]).max() < 1e-6 * np.std(values)
    surface = rng.standard_normal(observed.shape)
    assert np.sum(filling(values) * surface) == pytest.approx(values @ filling.transpose(surface), rel=1e-7)


def test_filling_without_gaps_removes_plane():
    observed = np.ones((5, 6), dtype=bool)
    values = np.random.default_rng(7).standard_normal(30)
    filled = Filling(observed, (1.0, 1.0))(values)
    columns = np.stack([np.ones(30), *(p.ravel() for p in np.indices((5, 6)))], axis=1)
    rest = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    np.testing.assert_allclose(filled.ravel(), rest, atol=1e-13)


def test_gapped_modes_equal_dense_algebra(holes):
    hurst = 0.6
    lattice = _cosine_modes.Lattice.of(holes.shape, (1.0, 1.0))
    gapped = _cosine_modes.GappedModes(lattice, holes, 0.5, probes=500)
    filling = Filling(holes, (1.0, 1.0))
    operator = np.array([_cosine_modes.cosine_modes(filling(e)).ravel() for e in np.eye(holes.sum())]).T
    dense = operator @ (-(squares(holes.shape, (1, 1), holes) ** hurst) / (1 - hurst)) @ operator.T
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
    operator = np.array([_cosine_modes.cosine_modes(filling(e)).ravel() for e in np.eye(holes.sum())]).T
    dense = operator @ (-(squares(holes.shape, (1, 1), holes) ** hurst) / (1 - hurst)) @ operator.T
    complete = _cosine_modes.expected_power(lattice, hurst).ravel()
    excess = _cosine_modes.relative_excess(lattice, filling, hurst, 300).ravel()
    np.testing.assert_allclose(excess.sum(), np.sum(np.diag(dense) / complete - 1.0), rtol=0.01)
    assert np.abs(excess - (np.diag(dense) / complete - 1.0)).max() < 0.12
    white = _cosine_modes.relative_white_excess(filling, 300).ravel()
    np.testing.assert_allclose(white.sum(), np.sum(operator**2) - white.size, rtol=0.03)
    assert np.abs(white - (np.sum(operator**2, axis=1) - 1.0)).max() < 0.12


@pytest.mark.parametrize("shape", [(9, 9), (40, 31)])
@pytest.mark.parametrize("ratio", [1.0, 2.5])
@pytest.mark.parametrize("hurst", [1.11, 1.5, 1.95])
def test_expected_power_of_smooth_surface_equals_dense_covariance(shape, ratio, hurst):
    lattice = _cosine_modes.Lattice.of(shape, (ratio, 1.0))
    modes = orthonormal_modes(shape)
    dense = squares(shape, (ratio, 1.0)) ** hurst / (hurst - 1.0)
    expected = np.einsum("ki,ki->k", modes @ dense, modes)
    np.testing.assert_allclose(_cosine_modes.expected_power(lattice, hurst).ravel(), expected, rtol=2e-6)


@pytest.mark.parametrize("shape", [(800, 800), (1024, 1024), (1025, 1131)])
def test_expected_power_of_large_smooth_surface(shape):
    """Short waves have a power that does not depend on the size, the longest one as size^(2 H + 2)."""
    small, large = (
        _cosine_modes.expected_power(_cosine_modes.Lattice.of(s, (1.0, 1.0)), 1.95) for s in ((65, 65), shape)
    )
    assert large[-1, -1] == pytest.approx(small[-1, -1], rel=0.02)
    square = _cosine_modes.expected_power(_cosine_modes.Lattice.of((shape[0] // 8,) * 2, (1.0, 1.0)), 1.95)
    larger = _cosine_modes.expected_power(
        _cosine_modes.Lattice.of((shape[0] // 8 * 8,) * 2, (1.0, 1.0)), 1.95
    )
    assert larger[0, 0] / square[0, 0] == pytest.approx(8.0**5.9, rel=0.01)
    assert (large > 0.0).all()


@pytest.mark.parametrize("spacing", [(1e4, 1.0), (1e-4, 1.0)])
def test_expected_power_where_spacings_differ(spacing):
    """Short waves along the shorter spacing: those of independent profiles, power 1D / (1 - H) of each."""
    n, hurst = 200, 0.9
    for value in (0.99999999, 1.05):
        assert (_cosine_modes.expected_power(_cosine_modes.Lattice.of((n, n), spacing), value) > 0.0).all()
    power = _cosine_modes.expected_power(_cosine_modes.Lattice.of((n, n), spacing), hurst)
    power = power if spacing[0] > 1.0 else power.T
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * min(spacing)
    modes = scipy.fft.dct(np.eye(n), axis=1, norm="ortho")[:, 1:].T
    profile = np.einsum("ki,ij,kj->k", modes, -(lag ** (2 * hurst)) / (1 - hurst), modes)
    np.testing.assert_allclose(power[:, -20:].mean(axis=0), profile[-20:], rtol=0.02)
