"""Circulant embedding: the variogram implied by its amplitudes, and the covariance on the torus."""

import numpy as np
import pytest

from fractalcontact.base import fft
from fractalcontact.surfaces import _circulant as circulant

EXPONENTS = (0.01, 0.1, 0.3, 0.5, 0.75, 0.76, 0.9, 0.99)


def implied_variogram(embedding):
    """Return lags (in diagonals) and the mean square increments implied by the amplitudes, each (ny, nx)."""
    axes = tuple(axis for axis, n in enumerate(embedding.amplitude.shape) if n > 1)
    covariance = fft.dct(embedding.amplitude**2, 1, axes) / np.prod(embedding.torus)
    covariance = covariance.T[: embedding.shape[0], : embedding.shape[1]]
    y, x = (np.arange(n) * step for n, step in zip(embedding.shape, embedding.step, strict=True))
    square = y[:, None] ** 2 + x**2
    return np.sqrt(square), 2.0 * (covariance[0, 0] - covariance) + embedding.drift**2 * square


def error_of_variogram(shape, spacing, hurst):
    lag, variogram = implied_variogram(circulant.embed(shape, spacing, hurst))
    exact = lag ** (2 * hurst)
    return np.abs(variogram / 2 - exact).max() / exact.max()


@pytest.mark.parametrize("hurst", EXPONENTS)
@pytest.mark.parametrize(
    ("shape", "spacing"),
    [
        ((129, 129), (1.0, 1.0)),
        ((3, 3), (1.0, 1.0)),
        ((31, 97), (1.0, 1.0)),
        ((5, 300), (2.0, 2.0)),
        ((40, 37), (1.0, 0.3)),
        ((13, 17), (1e-9, 1e-7)),
        ((1, 200), (1.0, 0.1)),
    ],
)
def test_implied_variogram_is_exact(shape, spacing, hurst):
    assert error_of_variogram(shape, spacing, hurst) < 3e-15


@pytest.mark.slow
@pytest.mark.parametrize("hurst", EXPONENTS)
def test_implied_variogram_is_exact_for_large_surfaces(hurst):
    embedding = circulant.embed((2048, 2048), (1.0, 1.0), hurst)
    lag, variogram = implied_variogram(embedding)
    assert np.abs(variogram / 2 - lag ** (2 * hurst)).max() < 3e-15
    assert embedding.smallest > -1e-14


def test_covariance_is_continuous_between_its_pieces():
    for hurst in (0.76, 0.9, 0.99):
        model = circulant.Stein.of(hurst)
        r = np.array([1 - 2e-6, 1 - 1e-6, 1 + 1e-6, 1 + 2e-6])
        value = model(r**2)
        assert abs(value[2] - value[1]) < 1e-5
        np.testing.assert_allclose((value[1] - value[0]), (value[3] - value[2]), rtol=1e-4)
        assert abs(model(np.array([model.radius**2]))[0]) == 0.0
