"""Expected power of blocks of modes against sums over the covariance matrix."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._mode_blocks import frame, node_weights, profile_modes


def cosines(n):
    """Orthonormal cosine modes 1 to n - 1."""
    k, i = np.arange(1, n)[:, None], np.arange(n)
    return np.sqrt(2.0 / n) * np.cos(np.pi * k * (i + 0.5) / n)


@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.85])
@pytest.mark.parametrize(("shape", "spacing"), [((12, 12), (1.0, 1.0)), ((10, 15), (2.0, 1.0))])
def test_power_of_surfaces(shape, spacing, hurst):
    y, x = (np.arange(n) * d for n, d in zip(shape, spacing, strict=True))
    lag = np.hypot((y[:, None] - y)[:, None, :, None], (x[:, None] - x)[None, :, None, :])
    along_y, along_x = cosines(shape[0]), cosines(shape[1])
    covariance = -(lag ** (2 * hurst)) / (1 - hurst)
    power = np.einsum("ki,lj,ijmn,km,ln->kl", along_y, along_x, covariance, along_y, along_x, optimize=True)
    blocks = frame(shape, spacing)
    np.testing.assert_allclose(np.exp(node_weights(hurst)[0] @ blocks.logs), blocks.mean(power), rtol=2e-3)


@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.85])
def test_power_of_profiles_without_tilt(hurst):
    n = 20
    operator = np.stack([profile_modes(row) for row in np.eye(n)], axis=1)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / n
    power = np.einsum("ki,ij,kj->k", operator, -(lag ** (2 * hurst)) / (1 - hurst), operator)
    blocks = frame((n,), (1.0,))
    np.testing.assert_allclose(np.exp(node_weights(hurst)[0] @ blocks.logs), blocks.mean(power), rtol=2e-3)
    np.testing.assert_allclose(operator @ np.arange(n), 0.0, atol=1e-12)


def test_large_surface_is_estimated_by_blocks():
    surface = fc.surfaces.fbm((1040, 1030), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    result = fc.dimensions.estimate(surface).isel(method=0)
    bound = 1.13 / 1035
    assert float(result.hurst) == pytest.approx(0.7, abs=4 * bound)
    assert float(result.standard_error) == pytest.approx(bound, rel=0.1)
    assert float(result.rms_increment) == pytest.approx(1e-6, rel=0.01)
    long_waves = fc.dimensions.estimate(surface, scales=(1e-3, 2e-2)).isel(method=0)
    assert float(long_waves.ci_low) < 0.7 < float(long_waves.ci_high)
    assert float(long_waves.scale_min) >= 1e-3
