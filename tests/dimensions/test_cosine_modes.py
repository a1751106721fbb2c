"""Cosine modes of free surfaces against dense linear algebra."""

import numpy as np
import pytest
import scipy.fft
import scipy.stats

from fractalcontact.dimensions import _cosine_modes
from fractalcontact.dimensions._free_edges import without_levelling


def squares(shape, steps):
    y, x = (p.ravel() for p in np.indices(shape))
    return (steps[0] * (y[:, None] - y)) ** 2 + (steps[1] * (x[:, None] - x)) ** 2


def orthonormal_modes(shape):
    """Rows: orthonormal cosine modes that vary along both axes."""
    points = np.eye(shape[0] * shape[1]).reshape(-1, *shape)
    return scipy.fft.dctn(points, axes=(1, 2), norm="ortho")[:, 1:, 1:].reshape(points.shape[0], -1).T


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


def test_steep_spectra_are_not_taken_for_levelled_rows():
    """Two of sixty blurred surfaces once were: a few strong modes decided."""
    rng = np.random.default_rng(1)
    ny, nx = np.meshgrid(np.arange(1, 100), np.arange(1, 100), indexing="ij")
    for _ in range(40):
        power = rng.chisquare(1, ny.shape) * (ny**2 + nx**2) ** -4.0
        assert without_levelling(power, (1.0, 1.0), 0.7)[1] == ""
        power[:, :2] *= 1e-3
        assert without_levelling(power, (1.0, 1.0), 0.7)[1] == "the rows were levelled one by one"
