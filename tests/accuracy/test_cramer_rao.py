"""The Cramer-Rao bounds against tables, direct sums and a simulation."""

import numpy as np
import pytest

from fractalcontact.accuracy import _cramer_rao as cramer_rao
from fractalcontact.base.spectra import aliased_power_law


def test_brownian_bound_matches_the_table():
    table = {0.05: 0.356, 0.1: 0.512, 0.3: 0.856, 0.5: 1.029, 0.7: 1.130, 0.9: 1.194}
    for hurst, value in table.items():
        assert cramer_rao.brownian_bound(hurst, 100) * 100 == pytest.approx(value, rel=5e-3)


def test_bound_without_aliases_is_that_of_a_power_law():
    """n times the bound of a square band is 1.383 for every exponent."""
    for hurst in (0.2, 0.8):
        assert cramer_rao.brownian_bound(hurst, 100, aliases=False) * 100 == pytest.approx(1.383, rel=0.01)


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_bound_of_a_profile_is_that_of_its_increments(hurst):
    """Fisher information of Gaussian increments with their exact covariance and an unknown amplitude."""
    n, step = 400, 1e-5
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))).astype(float)

    def covariance(h):
        return 0.5 * (np.abs(lag + 1) ** (2 * h) + np.abs(lag - 1) ** (2 * h) - 2 * lag ** (2 * h))

    change = (covariance(hurst + step) - covariance(hurst - step)) / (2 * step)
    relative = np.linalg.solve(covariance(hurst), change)
    information = 0.5 * (np.trace(relative @ relative) - np.trace(relative) ** 2 / n)
    # near H = 1 a short profile does better: 4.6 % at 0.8
    assert cramer_rao.brownian_bound(hurst, n, axes=1) == pytest.approx(information**-0.5, rel=0.05)


@pytest.mark.parametrize(("hurst", "share"), [(0.5, 0.89), (0.9, 0.63)])
def test_exact_bound_of_a_small_surface_is_less(hurst, share):
    """Fisher information of heights above one of them, with their covariance and an unknown amplitude."""
    n, step = 16, 1e-4
    y, x = np.indices((n, n)).reshape(2, -1)
    lag, first = np.hypot(np.subtract.outer(y, y), np.subtract.outer(x, x)), np.hypot(y, x)

    def covariance(h):
        return (np.add.outer(first ** (2 * h), first ** (2 * h)) - lag ** (2 * h))[1:, 1:]

    change = (covariance(hurst + step) - covariance(hurst - step)) / (2 * step)
    relative = np.linalg.solve(covariance(hurst), change)
    information = 0.5 * (np.trace(relative @ relative) - np.trace(relative) ** 2 / len(change))
    assert information**-0.5 == pytest.approx(share * cramer_rao.brownian_bound(hurst, n), rel=0.01)


def test_aliased_density_matches_a_sum_over_many_more_images():
    hurst = 0.4
    w = (np.arange(cramer_rao.BOUND_POINTS) + 0.5) / cramer_rao.BOUND_POINTS * np.pi
    j = np.arange(-400, 401)
    corner = (
        np.sum(((w[-1] + 2 * np.pi * j[:, None]) ** 2 + (w[-1] + 2 * np.pi * j) ** 2) ** (-1 - hurst))
        + 2 * np.pi * (801 * np.pi) ** (-2 * hurst) / (2 * hurst) / (2 * np.pi) ** 2
    )
    assert aliased_power_law((w[-1], w[-1]), hurst)[-1] == pytest.approx(corner, rel=2e-3)


def test_band_bound_of_all_modes_tends_to_the_closed_form():
    """All modes of a periodic grid: n times the bound tends to 1.383."""
    n = 512
    assert cramer_rao.band_bound((n, n), 0.0, np.inf) * n == pytest.approx(1.383, rel=0.01)


def test_band_bound_is_reached_by_regression_on_the_modes():
    n, hurst = 32, 0.5
    rng = np.random.default_rng(3)
    q = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n), indexing="ij"))
    half = np.zeros((n, n), bool)
    half[1 : n // 2] = True
    half[0, 1 : n // 2] = True
    band = half & (q >= 1 / n * (1 - 1e-9)) & (q <= 0.25 * (1 + 1e-9))
    logs = np.log(q[band])
    estimates = []
    for _ in range(800):
        power = q[band] ** (-2 - 2 * hurst) * rng.standard_exponential(band.sum())
        estimate = hurst
        for _ in range(8):  # scoring: each independent mode is two real numbers
            scaled = power * q[band] ** (2 + 2 * estimate)
            centred = logs - logs.mean()
            estimate -= 0.5 * np.sum(centred * (scaled / scaled.mean() - 1)) / np.sum(centred**2)
        estimates.append(estimate)
    assert np.std(estimates) == pytest.approx(cramer_rao.band_bound((n, n), 4.0, float(n)), rel=0.08)
