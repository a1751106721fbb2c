"""Fitting an expected spectrum to squared modes: Whittle's likelihood, solved by scoring.

Every mode is taken as a Gaussian number of expected power

    amplitude * (E_k(H) + noise),

uncorrelated with the others. The amplitude is solved in closed form; H, and the noise if it is asked for,
by Fisher scoring. E_k is evaluated at three Hurst exponents and interpolated between them, so that a
large face costs three evaluations (Whittle 1954, Biometrika 41; Sykulski et al. 2019, Biometrika 106).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
Model = Callable[[float], Array]

LOWEST, HIGHEST = 1e-4, 1.9  # where the exponent of the lattice covariance makes sense
_BEYOND = 1.97  # nodes stay below
_WIDTH = 0.06  # half the distance of the nodes, in ln H: interpolation is then good to 1e-5
_WIDE = 0.24  # the same while the search is far from its end
_ROUNDS, _STEPS = 40, 60


@dataclass(frozen=True)
class WhittleFit:
    """What was fitted to the modes.

    Attributes
    ----------
    hurst : float
        Not limited to (0, 1).
    standard_error : float
        That of independent modes without gaps.
    amplitude, noise : float
        What multiplies the expected power, and the power of white noise in the unit of the data.
    columns : ndarray, shape (parameters, modes)
        Relative change of the expected power with ln amplitude, H and noise / amplitude.
    bread : ndarray, shape (parameters, parameters)
        Expected change of the score with the same parameters, gaps included.
    total : ndarray, shape (modes,)
        Expected power of the complete data for unit amplitude, noise included.
    misfit : float
        Departure from the model in standard deviations: how much the slope of the spectrum changes with
        scale more than that of the model.
    converged : bool
    """

    hurst: float
    standard_error: float
    amplitude: float
    noise: float
    columns: Array
    bread: Array
    total: Array
    misfit: float
    converged: bool


@dataclass(frozen=True)
class _Local:
    """Expected power around one Hurst exponent: ln E is quadratic in x = (ln H - centre) / width.

    `excess` (two arrays, constant and linear) is what the data have on top of E because of gaps.
    """

    centre: float
    width: float
    level: Array
    slope: Array
    bend: Array
    excess: tuple[Array, Array] | None
    white_excess: Array | None

    @classmethod
    def around(
        cls, model: Model, gaps: Model | None, centre: float, width: float, white_excess: Array | None
    ) -> _Local:
        """Evaluate the models at the nodes; the excess is small enough for a straight line."""
        low, level, high = (np.log(model(float(np.exp(centre + i * width)))) for i in (-1, 0, 1))
        excess = None
        if gaps is not None:
            left, right = (gaps(float(np.exp(centre + i * width))) for i in (-1, 1))
            excess = (0.5 * (left + right), 0.5 * (right - left))
        return cls(centre, width, level, 0.5 * (high - low), 0.5 * (high + low) - level, excess, white_excess)

    def at(self, x: float, noise: float | None) -> tuple[Array, Array, Array]:
        """Return the total power, the columns of its relative changes, and those of the mean of the data.

        Changes are with ln amplitude, x and, if it is fitted, the noise.
        """
        signal = np.exp(self.level + x * (self.slope + x * self.bend))
        total = signal if noise is None else signal + noise
        rate = (self.slope + 2.0 * x * self.bend) * signal
        changes = [total, rate] if noise is None else [total, rate, np.ones_like(total)]
        columns = np.stack(changes) / total
        if self.excess is None:
            return total, columns, columns
        flat, tilt = self.excess
        changes[0] = changes[0] + flat + x * tilt
        changes[1] = changes[1] + tilt
        if noise is not None and self.white_excess is not None:
            changes[0] = changes[0] + noise * self.white_excess
            changes[2] = changes[2] + self.white_excess
        return total, columns, np.stack(changes) / total


def fit(
    power: Array,
    model: Model,
    start: float,
    *,
    noise: float | None = None,
    gaps: Model | None = None,
    white_excess: Array | None = None,
    weights: Array | None = None,
) -> WhittleFit:
    """Fit H, the amplitude and, where `noise` gives a start, white noise.

    Parameters
    ----------
    power : ndarray, shape (modes,)
        Squared modes.
    model : callable
        Hurst exponent to the expected power of the complete data for unit amplitude, shape (modes,).
    start : float
        Where to begin.
    noise : float, optional
        First guess of the noise over the amplitude; None: no noise is fitted. The estimate may be
        negative: a limit at zero would spoil the interval of H.
    gaps : callable, optional
        Hurst exponent to what gaps add to the expected power.
    white_excess : ndarray, optional
        Excess of the expected power of white noise.
    weights : ndarray, shape (modes,), optional
        How many real numbers each mode stands for; default one.
    """
    half = 0.5 if weights is None else 0.5 * weights
    position = float(np.log(np.clip(start, 0.01, 1.5)))
    width, done = _WIDTH, False
    for _ in range(_ROUNDS):
        width = min(width, np.log(_BEYOND) - position)
        local = _Local.around(model, gaps, position, width, white_excess)
        x, noise, inside = _climb(local, power, noise, half)
        moved = position + x * width
        position = float(np.clip(moved, np.log(LOWEST), np.log(HIGHEST)))
        done = inside and width <= _WIDTH
        if done or position != moved:
            break
        width = _WIDTH if inside else _WIDE
    total, columns, means = local.at(x, noise)
    hurst = float(np.exp(position))
    scale = np.array([1.0, 1.0 / (width * hurst), 1.0])[: len(columns)]
    columns, means = columns * scale[:, None], means * scale[:, None]
    information = (half * columns) @ columns.T
    amplitude = _amplitude(power, total, means, half)
    return WhittleFit(
        hurst=hurst,
        standard_error=float(np.sqrt(inverse(information)[1, 1])),
        amplitude=amplitude,
        noise=0.0 if noise is None else noise * amplitude,
        columns=columns,
        bread=(half * columns) @ means.T,
        total=total,
        misfit=_misfit(columns, power / (amplitude * total) - means[0], half),
        converged=done,
    )


def _climb(
    local: _Local, power: Array, noise: float | None, half: float | Array
) -> tuple[float, float | None, bool]:
    """Score from the centre; stop inside |x| <= 1, or where the nodes must be moved."""
    x = 0.0
    floor = -0.9 * float(np.exp(local.level.min()))
    for _ in range(_STEPS):
        total, columns, means = local.at(x, noise)
        misfit = power / (_amplitude(power, total, means, half) * total) - means[0]
        step = inverse((half * columns) @ columns.T) @ ((half * columns) @ misfit)
        x_step = float(np.clip(step[1], -2.0, 2.0))
        x += x_step
        if noise is not None:
            share = x_step / step[1] if step[1] else 1.0
            noise = max(noise + share * float(step[2]), floor)
        if abs(x) > 4.0:
            return float(np.clip(x, -5.0, 5.0)), noise, False
        if abs(x_step) < 1e-7:
            break
    return x, noise, abs(x) <= 1.0


def _amplitude(power: Array, total: Array, means: Array, half: float | Array) -> float:
    """Return the amplitude at which its own score vanishes."""
    return float(np.sum(half * (power / total)) / np.sum(half * means[0]))


def _misfit(columns: Array, misfit: Array, half: float | Array) -> float:
    """Score of a change of H with scale, the fitted parameters being free, over its standard deviation."""
    bend = columns[1] ** 2
    bend = bend - columns.T @ (inverse((half * columns) @ columns.T) @ ((half * columns) @ bend))
    spread = float(np.sum(half * bend * bend))
    return float(np.sum(half * bend * misfit)) / np.sqrt(spread) if spread > 0 else 0.0


def inverse(information: Array) -> Array:
    """Invert a symmetric matrix whose columns have very different scales."""
    scale = 1.0 / np.sqrt(np.diag(information))
    return np.asarray(np.linalg.pinv(information * np.outer(scale, scale)) * np.outer(scale, scale))
