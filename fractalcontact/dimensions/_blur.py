"""Fit of the Hurst exponent to the modes of a surface that an instrument has blurred.

The squared transfer function of the instrument is exp(-s^2 q^2 + b q^4) at the wavenumber q: s is the spread
of a Gaussian point spread function, and b leaves room for another form and for aliasing before or after the
blur.
Only modes are used on which the transfer function has not fallen below a third or so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

_NODES = np.array([0.03, 0.12, 0.3, 0.55, 0.8, 1.0, 1.3])  # exponents between which ln E is interpolated
_LARGEST = (0.75 * np.pi) ** 2  # squared wavenumber: waves near the Nyquist one depend on aliasing
_LARGEST_FALL, _FALL = 1.6, 1.2  # logarithm of the squared transfer function at the end of the window
_MOST_MODES, _LEAST_MODES = 1 << 20, 100
_WINDOWS, _STEPS, _LONGEST_STEP = 6, 60, 0.15
_CORRELATION = 1.03  # of the standard error, for the modes are slightly correlated


@dataclass(frozen=True)
class BlurredFit:
    """Exponent, its standard error, and the spread of the blur in spacings (0 where the fit is negative)."""

    hurst: float
    standard_error: float
    spread: float


def fit_blurred(power: Array, model: Callable[[float], Array], wavelength: Array) -> BlurredFit | None:
    """Fit H, the amplitude and the blur; None if the search does not end.

    Parameters
    ----------
    power : ndarray, shape (modes,)
        Squared modes.
    model : callable
        Hurst exponent to the expected power without blur.
    wavelength : ndarray, shape (modes,)
        In spacings.
    """
    squares = (2.0 * np.pi / wavelength) ** 2
    largest = min(_LARGEST, 4.0 * np.pi * _MOST_MODES / power.size)
    chosen = squares <= largest
    logs = np.stack([np.log(model(hurst)[chosen]) for hurst in _NODES])
    power, squares = power[chosen], squares[chosen]
    fit, fall = None, 0.0
    for _ in range(_WINDOWS):
        inside = squares <= largest
        if np.count_nonzero(inside) < _LEAST_MODES:
            return None
        fit, fall = _fit(power[inside], logs[:, inside], squares[inside] / largest)
        if fit is not None and fall <= _LARGEST_FALL:
            break
        largest *= 0.5 if fit is None else max(_FALL / fall, 0.1)
    else:
        return None
    return BlurredFit(*fit, float(np.sqrt(max(fall, 0.0) / largest)))


def _fit(power: Array, logs: Array, squares: Array) -> tuple[tuple[float, float] | None, float]:
    """Return H with its standard error, and the fall of the logarithm of the power over the window."""
    hurst, fall, bend = 0.5, 0.0, 0.0
    for _ in range(_STEPS):
        weights, slopes = _weights(hurst)
        ratio = power * np.exp(fall * squares - bend * squares**2 - weights @ logs)
        columns = np.stack([np.ones_like(squares), slopes @ logs, -squares, squares**2])
        information = 0.5 * columns @ columns.T
        step = np.linalg.solve(information, 0.5 * columns @ (ratio / ratio.mean() - 1.0))
        step *= min(1.0, _LONGEST_STEP / max(abs(step[1]), 1e-12))
        previous = hurst
        hurst = float(np.clip(hurst + step[1], _NODES[0], _NODES[-1]))
        fall, bend = fall + step[2], bend + step[3]
        if abs(hurst - previous) < 1e-6 and abs(step[2]) < 1e-4:
            error = _CORRELATION * np.sqrt(np.linalg.inv(information)[1, 1])
            return (hurst, float(error)), float(fall)
    return None, 0.0


def _weights(hurst: float) -> tuple[Array, Array]:
    """Return the weights of polynomial interpolation between the nodes, and their derivatives."""
    powers = np.arange(_NODES.size)
    inverse = np.linalg.inv(_NODES[:, None] ** powers)
    return hurst**powers @ inverse, powers * hurst ** np.maximum(powers - 1.0, 0.0) @ inverse
