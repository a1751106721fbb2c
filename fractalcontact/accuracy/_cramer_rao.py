"""Cramer-Rao bounds: the least standard error of an unbiased estimate of the Hurst exponent."""

from __future__ import annotations

import numpy as np

from fractalcontact.base.numbers import Array, is_within
from fractalcontact.base.spectra import (
    aliased_line_power_law,
    aliased_power_law,
    half_weights,
    radial_wavenumber,
)

BOUND_POINTS = 128  # wavevectors along an edge of the quarter plane: 1024 change a bound by up to 1.3 %
BOUND_STEP = 1e-4  # of the derivative by H: 1e-5 and 1e-3 change a bound by 5e-6 and 2e-4 of it


def brownian_bound(hurst: float, n: int, blur: float = 0.0, *, axes: int = 2, aliases: bool = True) -> float:
    """Return the bound for n points along each axis of fractional Brownian heights of unknown amplitude.

    Whittle's information gives sqrt(2 / var(d ln f / dH)) / n of a surface for large n: f is the spectral
    density as sampled, with all its aliases, and the variance is over all wavevectors of the grid. The
    information of a small surface, from the covariance of all its heights, is larger: with 16, 32 and 64
    points along an edge the exact bound is .63, .81 and .91 of this one at H = .9, and .89, .94 and .97 at
    H = .5. With a Gaussian blur of the spread `blur`, in spacings, only the wavevectors count on which its
    squared transfer function is above one half. Without `aliases` the density is the power law itself.
    """
    low, high = hurst - BOUND_STEP, hurst + BOUND_STEP
    w = (np.arange(BOUND_POINTS) + 0.5) / BOUND_POINTS * np.pi
    lower, upper = (
        aliased_power_law((w[:, None], w), each) if axes == 2 else aliased_line_power_law(w, each)
        for each in (low, high)
    )
    slope = (np.log(upper) - np.log(lower)) / (high - low)
    squares = w[:, None] ** 2 + w**2 if axes == 2 else w**2
    if not aliases:
        slope = -np.log(squares)
    inside = blur**2 * squares < np.log(2.0)
    return float(np.sqrt(2.0 / (np.var(slope[inside]) * inside.mean() * n**axes)))


def rolloff_bound(hurst: float, n: int, corner: float, blur: float = 0.0) -> float:
    """Return the bound of a surface with a slow roll-off, whose corner and amplitude are unknown."""
    points = min(n, 2 * BOUND_POINTS)
    w = (np.arange(points) + 0.5) / points * np.pi
    turns = 2.0 * np.pi * np.arange(-2, 3)[:, None]
    squares = (w + turns)[:, None, :, None] ** 2 + (w + turns)[None, :, None, :] ** 2

    def logs(exponent: float, length: float) -> Array:
        """Far aliases do not feel the corner."""
        rolled = (squares + (2.0 * np.pi / length) ** 2) ** (-1.0 - exponent) - squares ** (-1.0 - exponent)
        return np.asarray(np.log(aliased_power_law((w[:, None], w), exponent) + rolled.sum(axis=(0, 1))))

    step = BOUND_STEP
    low, high = hurst - step, hurst + step
    slope = (logs(high, corner) - logs(low, corner)) / (high - low)
    bend = logs(hurst, corner * (1.0 + step)) - logs(hurst, corner)
    inside = blur**2 * (w[:, None] ** 2 + w**2) < np.log(2.0)
    slope, bend = (part[inside] - part[inside].mean() for part in (slope, bend))
    unexplained = slope - bend * (slope @ bend) / (bend @ bend)
    return float(np.sqrt(2.0 / np.sum(unexplained**2)) * points / n)


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
    inside = (length > 0) & is_within(length, low, high)
    logs, weights = np.log(wave[inside]), weights[inside]
    spread = float(np.sum(weights * (logs - np.average(logs, weights=weights)) ** 2))
    # a mode has the power q^(-2 - 2 H): d ln power / dH = -2 ln q, and each is one real Gaussian number
    return float(1.0 / np.sqrt(2.0 * spread))
