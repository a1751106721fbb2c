"""Cramer-Rao bounds: the least standard error of an unbiased estimate of the Hurst exponent."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.spectra import aliased_power_law, half_weights, radial_wavenumber

Array = np.ndarray[Any, np.dtype[Any]]

POINTS = 128  # wavevectors along an edge of the quarter plane
STEP = 1e-4  # of the derivative by H


def brownian_bound(hurst: float, n: int) -> float:
    """Return the bound for n x n points of a fractional Brownian surface of unknown amplitude.

    Whittle's information gives sqrt(2 / var(d ln f / dH)) / n for large n: f is the spectral density as
    sampled, with all its aliases, and the variance is over all wavevectors of the grid. At H near 1 a small
    surface does better by up to a fifth, because no exponent beyond 1 is allowed there.
    """
    low, high = max(hurst - STEP, 1e-6), hurst + STEP
    slope = (np.log(aliased_density(high)) - np.log(aliased_density(low))) / (high - low)
    return float(np.sqrt(2.0 / np.var(slope)) / n)


def aliased_density(hurst: float) -> Array:
    """Return the spectral density of the sampled surface on a quarter of its wavevectors."""
    w = (np.arange(POINTS) + 0.5) / POINTS * np.pi
    return aliased_power_law((w[:, None], w), hurst)


def band_bound(shape: tuple[int, int], low: float, high: float) -> float:
    """Return the bound for the independent modes of a periodic power law.

    Parameters
    ----------
    shape : (ny, nx)
        Of a grid with spacing 1.
    low, high : float
        Shortest and longest wavelength of the band, in spacings, both known; 0 and inf for all modes.
    """
    wave = radial_wavenumber(shape, (1.0, 1.0))
    weights = np.broadcast_to(half_weights(shape[1]), wave.shape)
    length = np.divide(2.0 * np.pi, wave, out=np.zeros_like(wave), where=wave > 0)
    inside = (length > 0) & (length >= low * (1 - 1e-9)) & (length <= high * (1 + 1e-9))
    logs, weights = np.log(wave[inside]), weights[inside]
    spread = float(np.sum(weights * (logs - np.average(logs, weights=weights)) ** 2))
    # a mode has the power q^(-2 - 2 H): d ln power / dH = -2 ln q, and each is one real Gaussian number
    return float(1.0 / np.sqrt(2.0 * spread))
