"""Expected power of cosine modes, beside dense covariance matrices and simulation."""

import numpy as np
import pytest
from scipy.fft import dctn
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.dimensions._gaussian_mixture import ALIASED, FILTERED, Lattice
from fractalcontact.dimensions._mode_bins import expected_power


def dense_power(shape, spacing, hurst):
    """Return the expected squared cosine modes from the covariance -d^2H / 2 of all pairs of points."""
    y, x = np.meshgrid(*(np.arange(n) * d for n, d in zip(shape, spacing, strict=True)), indexing="ij")
    points = np.stack([y.ravel(), x.ravel()])
    distance = np.hypot(*(points[:, :, None] - points[:, None, :]))
    covariance = -0.5 * distance ** (2.0 * hurst)
    basis = np.stack(
        [dctn(unit.reshape(shape), norm="ortho").ravel() for unit in np.eye(covariance.shape[0])], axis=1
    )
    return np.einsum("ki,ij,kj->k", basis, covariance, basis).reshape(shape)


def theta(hurst, spread=0.0):
    return np.array([hurst, spread, 0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("hurst", [0.05, 0.3, 0.5, 0.8, 0.95])
@pytest.mark.parametrize(("shape", "spacing"), [((12, 12), (1.0, 1.0)), ((9, 16), (1.7, 1.0))])
def test_power_of_surface_is_that_of_dense_covariance(shape, spacing, hurst):
    lattice = Lattice(shape, spacing)
    total = expected_power(lattice, theta(hurst), ALIASED)
    clean = expected_power(lattice, theta(hurst), ALIASED, edges=False)
    expected = dense_power(shape, spacing, hurst)[1:, 1:]
    # Gaussians longer than eight extents are left out: the lowest mode of H near 1 feels them
    np.testing.assert_allclose(total, expected, rtol=3e-5 if hurst < 0.8 else 1e-3)
    assert np.all(clean > 0.0)


@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.9])
def test_power_of_detrended_profile_is_that_of_dense_covariance(hurst):
    n = 40
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n))).astype(float)
    covariance = -0.5 * distance ** (2.0 * hurst)
    x = np.arange(n) - 0.5 * (n - 1)
    line = x / np.sqrt(x @ x)
    project = np.eye(n) - np.outer(line, line)
    basis = np.stack([dctn(unit, norm="ortho") for unit in np.eye(n)], axis=1)
    expected = np.diag(basis @ project @ covariance @ project @ basis.T)[1:]
    total = expected_power(Lattice((1, n), (1.0, 1.0)), theta(hurst), ALIASED)
    np.testing.assert_allclose(total[0], expected, rtol=2e-4)


@pytest.mark.parametrize("form", [ALIASED, FILTERED])
@pytest.mark.parametrize("hurst", [0.05, 0.5, 0.95])
def test_power_of_some_modes_of_profile_is_that_of_all_modes(hurst, form):
    columns = np.unique(np.geomspace(1, 255, 40).astype(int) - 1)
    profile = Lattice((1, 256), (1.0, 1.0))
    some = profile.with_columns(columns)
    for spread in (0.0, 0.5, 4.0):
        expected = expected_power(profile, theta(hurst, spread), form)[:, columns]
        clean = expected_power(profile, theta(hurst, spread), form, edges=False)[:, columns]
        power = expected_power(some, theta(hurst, spread), form)
        counts = (clean > 0.5 * expected) & (clean > 1e-4 * clean.max())
        assert counts.sum() > 5
        np.testing.assert_allclose(power[counts], expected[counts], rtol=2e-4)


@pytest.mark.parametrize("spread", [0.5, 1.0])
def test_power_of_filtered_points_is_that_of_surfaces(spread):
    lattice, members, margin = Lattice((32, 48), (1.0, 1.0)), 400, 8
    rough = fc.surfaces.fbm(
        (32 + 2 * margin, 48 + 2 * margin), 1.0, hurst=0.6, rms_increment=1.0, members=members, rng=4
    ).values
    inner = slice(margin, -margin)
    power = np.mean([lattice.power(gaussian_filter(z, spread)[inner, inner]) for z in rough], axis=0)
    weights = gaussian_filter(np.eye(1, 65, 32)[0], spread)
    deviation = float(np.sqrt(weights @ np.square(np.arange(65) - 32)))
    total = expected_power(lattice, theta(0.6, deviation), FILTERED)
    clean = expected_power(lattice, theta(0.6, deviation), FILTERED, edges=False)
    kept = clean > 0.5 * total
    for low, high in ((0.0, 0.5), (0.5, 1.5), (1.5, 2.5)):
        ring = kept & (lattice.q > low) & (lattice.q <= high)
        error = np.sqrt(2.0 / members / ring.sum())
        assert abs(np.mean(power[ring] / total[ring]) - 1.0) < 5.0 * error + 0.005


def test_noise_of_unit_increments_has_unit_power_of_each_mode():
    lattice = Lattice((24, 24), (1.0, 1.0))
    quiet = expected_power(lattice, theta(0.5), ALIASED)
    noisy = expected_power(lattice, np.array([0.5, 0.0, 0.3, 0.0, 0.0, 1.0]), ALIASED)
    np.testing.assert_allclose(noisy - quiet, 0.09, rtol=1e-9)
