"""The least error that any unbiased estimate of the Hurst exponent can have (Cramer and Rao)."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.spectra import aliased_power_law, half_weights, radial_wavenumber

Array = np.ndarray[Any, np.dtype[Any]]

_POINTS, _STEP = 128, 1e-4


def fractional_brownian(hurst: float, n: int) -> float:
    """Return the least standard deviation of H from n x n points, the amplitude being unknown.

    It is sqrt(2 / var(d ln f / dH)) / n for large n, f being the spectral density as sampled, all its
    aliases included, and the variance being over all wavevectors of the grid. At H near 1 a small face does
    better by up to a fifth, because no exponent beyond 1 is allowed there.
    """
    low, high = max(hurst - _STEP, 1e-6), hurst + _STEP
    slope = (np.log(_aliased(high)) - np.log(_aliased(low))) / (high - low)
    return float(np.sqrt(2.0 / np.var(slope)) / n)


def band_limited(shape: tuple[int, int], low: float, high: float) -> float:
    """Return the least standard deviation of H from the independent modes of a periodic power law.

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


def _aliased(hurst: float) -> Array:
    """Return the spectral density of the sampled surface on a quarter of its wavevectors."""
    w = (np.arange(_POINTS) + 0.5) / _POINTS * np.pi
    return aliased_power_law((w[:, None], w), hurst)
