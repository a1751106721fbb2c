"""Expected power of blocks of modes against sums over the covariance matrix."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._block_modes import BlockModes
from fractalcontact.dimensions._cosine_modes import Lattice, expected_power
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


@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.95])
def test_expected_power_of_blocks_is_the_mean_of_their_modes(hurst):
    """A power of one in each mode that is expected there gives blocks that the model equals exactly."""
    shape, spacing = (90, 131), (1.5, 1.0)
    power = expected_power(Lattice.of(shape, spacing), hurst)
    blocks = BlockModes.of(power.copy(), spacing, None)
    np.testing.assert_allclose(blocks.model(hurst), blocks.power, rtol=1e-9)
    assert blocks.count.max() > 20


@pytest.mark.parametrize("hurst", [0.3, 0.85])
def test_large_surface_with_gaps_is_estimated_by_blocks(hurst):
    surface = fc.surfaces.fbm((370, 362), 1e-4, hurst=hurst, rms_increment=1e-6, rng=2)
    complete = fc.dimensions.estimate(surface).isel(method=0)
    gapped = surface.where(np.random.default_rng(3).random(surface.shape) > 0.02)
    gapped[60:140, 200:] = np.nan
    result = fc.dimensions.estimate(gapped).isel(method=0)
    error = float(complete.standard_error)
    assert float(result.hurst) == pytest.approx(float(complete.hurst), abs=error)
    missing = float(gapped.isnull().mean())
    assert float(result.standard_error) == pytest.approx(error / np.sqrt(1.0 - missing), rel=0.01)
    assert float(result.rms_increment) == pytest.approx(1e-6, rel=0.03)
    noisy = gapped + 3e-7 * np.random.default_rng(4).standard_normal(gapped.shape)
    noisy.attrs = gapped.attrs
    with_noise = fc.dimensions.estimate(noisy, noise=True).isel(method=0)
    assert float(with_noise.ci_low) < hurst < float(with_noise.ci_high)
    assert float(with_noise.noise_height) == pytest.approx(3e-7, rel=0.15)


def test_error_with_half_of_a_large_surface_missing():
    surface = fc.surfaces.fbm((364, 364), 1e-4, hurst=0.5, rms_increment=1e-6, rng=5)
    surface[100:330, :182] = np.nan
    surface[:, 250:320] = np.nan
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert float(result.standard_error) == pytest.approx(
        1.1 / np.sqrt(float(surface.notnull().sum())), rel=0.1
    )
    assert float(result.ci_low) < 0.5 < float(result.ci_high)
