"""Whittle's likelihood: fit an expected spectrum to squared modes by Fisher scoring, with an interval.

Every mode is a Gaussian number of expected power

    amplitude * (E_k(H) + noise),

uncorrelated with the others. The amplitude is solved in closed form; H, and the noise if it is fitted, by
Fisher scoring. E_k is evaluated at three Hurst exponents and interpolated between them, so that a large
surface costs three evaluations (Whittle 1954, Biometrika 41; Sykulski et al. 2019, Biometrika 106).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fractalcontact.dimensions._records import SIGNIFICANT, Estimate, normal_interval

Array = np.ndarray[Any, np.dtype[Any]]
Model = Callable[[float], Array]
Excess = Callable[[tuple[float, ...]], list[Array]]

LEAST_MODES = 12
LOWEST, HIGHEST = 1e-4, 1.9  # range of H where the lattice covariance is defined
_LARGEST_NODE = 1.97
_WIDTH = 0.06  # half the distance of the nodes, in ln H: the interpolation error is then 1e-5
_WIDE = 0.24  # the same while the search is far from its end
_ROUNDS, _STEPS = 40, 60
QUANTILE = 3.841458820694124  # 95 % quantile of chi square with one degree of freedom
UNEVEN = 4.0  # -z of the scatter of the modes beyond which the interval is widened
_NEGATIVE_NOISE = (
    "the fitted noise is negative and reported as 0: there is none, or short waves were smoothed away"
)

# mean logarithm of a squared mode over its expected power, and the variance left once the mean is known
CHI_SQUARE = (-np.euler_gamma - np.log(2.0), 0.5 * np.pi**2 - 2.0)
EXPONENTIAL = (-np.euler_gamma, np.pi**2 / 6.0 - 1.0)


class Modes(Protocol):
    """Squared modes of a surface and the model of their expected power."""

    @property
    def order(self) -> Array:
        """A length for each mode, by which long waves are separated from short ones."""

    @property
    def sector(self) -> Array:
        """A number for each mode, the same for modes of neighbouring azimuths."""

    def scatter(self, fit: WhittleFit) -> float:
        """Return z of the flatness of the modes: negative where few modes carry too much power."""

    def part(self, chosen: Array) -> Modes:
        """Return some of the modes."""

    def fit(self, start: float, noise: bool) -> WhittleFit:
        """Fit the model."""

    def error(self, fit: WhittleFit) -> float:
        """Return the standard error of H."""


def fit_interval(
    modes: Modes, start: float, noise: bool, result: WhittleFit | None = None
) -> tuple[WhittleFit, Estimate]:
    """Fit modes, and return the estimate with its interval; `result` is the fit if it was made before.

    Where the exponent changes with scale more than chance allows, the interval also holds the exponents
    of the longer and of the shorter half of the modes, each fitted alone; where the modes scatter more than
    those of Gaussian heights, those of sectors of azimuth.
    """
    result = modes.fit(start, noise) if result is None else result
    error = modes.error(result)
    interval = normal_interval(result.hurst, error)
    notes = [] if result.converged else ["the fit stopped at the limit of its range"]
    if abs(result.misfit) > SIGNIFICANT:
        median = float(np.median(modes.order))
        interval = _holding_groups(interval, modes, modes.order > median, result.hurst, noise)
        noise_note = ""
        if not noise and (with_noise := modes.fit(start, True)).converged:
            interval = _holding(interval, modes, with_noise)
            noise_note = ", and that of a fit with white noise"
        notes.append(
            f"the exponent changes with scale ({result.misfit:+.1f} standard deviations): "
            f"the interval holds the exponents of the longer and of the shorter half of the modes{noise_note}"
        )
    scatter = modes.scatter(result)
    if scatter < -UNEVEN:
        interval = _holding_groups(interval, modes, modes.sector, result.hurst, noise)
        notes.append(
            f"a few waves hold more than their share ({-scatter:.1f} standard deviations): a lay, a step or "
            "a pattern; the interval holds the exponents of sectors of azimuth, each fitted alone"
        )
    low, high = interval
    return result, Estimate(result.hurst, error, low, high, misfit=result.misfit, note="; ".join(notes))


def _holding_groups(
    interval: tuple[float, float], modes: Modes, groups: Array, start: float, noise: bool
) -> tuple[float, float]:
    """Widen an interval until it holds those of groups of modes, each fitted alone."""
    for group in np.unique(groups):
        chosen = groups == group
        if np.count_nonzero(chosen) >= LEAST_MODES:
            part = modes.part(chosen)
            interval = _holding(interval, part, part.fit(start, noise))
    return interval


def _holding(interval: tuple[float, float], modes: Modes, other: WhittleFit) -> tuple[float, float]:
    """Widen an interval until it holds that of another fit."""
    low, high = normal_interval(other.hurst, modes.error(other))
    return min(interval[0], low), max(interval[1], high)


def flatness(ratio: Array, expected: tuple[float, float]) -> float:
    """Return z of the mean logarithm of power over expected power.

    Negative where a few modes carry more than their share. `expected` is `CHI_SQUARE` for real modes,
    `EXPONENTIAL` for complex ones.
    """
    if ratio.size < LEAST_MODES:
        return 0.0
    logs = np.log(np.maximum(ratio / ratio.mean(), 1e-12))
    return float((logs.mean() - expected[0]) * np.sqrt(ratio.size / expected[1]))


@dataclass(frozen=True)
class WhittleFit:
    """Parameters fitted to the modes.

    Attributes
    ----------
    hurst : float
        Not limited to (0, 1).
    standard_error : float
        That of independent modes without gaps.
    amplitude, noise : float
        Factor on the expected power, and the power of white noise in the unit of the data.
    columns : ndarray, shape (parameters, modes)
        Relative change of the expected power with ln amplitude, H and noise / amplitude.
    bread : ndarray, shape (parameters, parameters)
        Expected change of the score with the same parameters, gaps included.
    total : ndarray, shape (modes,)
        Expected power of the complete data for unit amplitude, noise included.
    misfit : float
        Goodness of fit: z of the change of the slope of the spectrum with scale beyond that of the model.
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

    @property
    def noise_note(self) -> str:
        """A note where the fitted noise is negative; empty otherwise."""
        return _NEGATIVE_NOISE if self.noise < 0 else ""


@dataclass(frozen=True)
class _Local:
    """Expected power around one Hurst exponent: ln E is quadratic in x = (ln H - centre) / width.

    `excess` (two arrays, constant and linear) is what gaps add to the expected power of the data.
    """

    centre: float
    width: float
    level: Array
    slope: Array
    curvature: Array
    excess: tuple[Array, Array] | None
    white_excess: Array | None

    @classmethod
    def expanded(
        cls, model: Model, gaps: Excess | None, centre: float, width: float, white_excess: Array | None
    ) -> _Local:
        """Evaluate the models at the nodes; the excess is small enough for a straight line."""
        low, level, high = (np.log(model(float(np.exp(centre + i * width)))) for i in (-1, 0, 1))
        excess = None
        if gaps is not None:
            left, right = gaps((float(np.exp(centre - width)), float(np.exp(centre + width))))
            excess = (0.5 * (left + right), 0.5 * (right - left))
        return cls(centre, width, level, 0.5 * (high - low), 0.5 * (high + low) - level, excess, white_excess)

    def at(self, x: float, noise: float | None) -> tuple[Array, Array, Array]:
        """Return the total power and its relative derivatives, for complete data and for the data with gaps.

        Derivatives are with respect to ln amplitude, x and, if it is fitted, the noise.
        """
        signal = np.exp(self.level + x * (self.slope + x * self.curvature))
        total = signal if noise is None else signal + noise
        rate = (self.slope + 2.0 * x * self.curvature) * signal
        derivatives = [total, rate] if noise is None else [total, rate, np.ones_like(total)]
        columns = np.stack(derivatives) / total
        if self.excess is None:
            return total, columns, columns
        constant, linear = self.excess
        derivatives[0] = derivatives[0] + constant + x * linear
        derivatives[1] = derivatives[1] + linear
        if noise is not None and self.white_excess is not None:
            derivatives[0] = derivatives[0] + noise * self.white_excess
            derivatives[2] = derivatives[2] + self.white_excess
        return total, columns, np.stack(derivatives) / total


def fit_power(
    power: Array,
    model: Model,
    start: float,
    *,
    noise: float | None = None,
    gaps: Excess | None = None,
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
        First guess of H.
    noise : float, optional
        First guess of the noise over the amplitude; None: no noise is fitted. The estimate may be
        negative: a limit at zero would bias the interval of H.
    gaps : callable, optional
        Hurst exponents to the excess of the expected power that gaps cause at each of them.
    white_excess : ndarray, optional
        Excess of the expected power of white noise.
    weights : ndarray, shape (modes,), optional
        How many real numbers each mode stands for; default one.
    """
    half_weights = 0.5 if weights is None else 0.5 * weights
    position = float(np.log(np.clip(start, 0.01, 1.5)))
    width, converged = _WIDTH, False
    for _ in range(_ROUNDS):
        width = min(width, np.log(_LARGEST_NODE) - position)
        local = _Local.expanded(model, gaps, position, width, white_excess)
        x, noise, is_inside = _score_steps(local, power, noise, half_weights)
        new_position = position + x * width
        position = float(np.clip(new_position, np.log(LOWEST), np.log(HIGHEST)))
        converged = is_inside and width <= _WIDTH
        if converged or position != new_position:
            break
        width = _WIDTH if is_inside else _WIDE
    total, columns, means = local.at(x, noise)
    hurst = float(np.exp(position))
    scale = np.array([1.0, 1.0 / (width * hurst), 1.0])[: len(columns)]
    columns, means = columns * scale[:, None], means * scale[:, None]
    information = (half_weights * columns) @ columns.T
    amplitude = _amplitude(power, total, means, half_weights)
    return WhittleFit(
        hurst=hurst,
        standard_error=float(np.sqrt(inverse(information)[1, 1])),
        amplitude=amplitude,
        noise=0.0 if noise is None else noise * amplitude,
        columns=columns,
        bread=(half_weights * columns) @ means.T,
        total=total,
        misfit=misfit(columns, power / (amplitude * total) - means[0], half_weights),
        converged=converged,
    )


def fit_from_starts(power: Array, model: Model, start: float, noise: bool, **options: Any) -> WhittleFit:
    """Fit from a pilot estimate; with noise from two starts, of which the better end is returned."""
    if not noise:
        return fit_power(power, model, start, **options)
    # noise lowers the pilot estimate, so that the search must come from both sides
    fits = [
        fit_power(power, model, hurst, noise=level, **options) for hurst, level in ((0.7, 0.05), (0.3, 0.02))
    ]
    # a search that ended outside its range may have left negative powers
    valid = [fit for fit in fits if fit.converged and fit.total.min() > 0.0]
    if not valid:
        return fits[0]
    weights = options.get("weights")
    weight: float | Array = 1.0 if weights is None else weights
    return min(valid, key=lambda fit: float(np.sum(weight * np.log(fit.amplitude * fit.total))))


def _score_steps(
    local: _Local, power: Array, noise: float | None, half_weights: float | Array
) -> tuple[float, float | None, bool]:
    """Take scoring steps from the centre; return x, the noise, and whether |x| <= 1 (else move the nodes)."""
    x = 0.0
    least = -0.9 * float(np.exp(local.level.min()))
    for _ in range(_STEPS):
        total, columns, means = local.at(x, noise)
        residual = power / (_amplitude(power, total, means, half_weights) * total) - means[0]
        step = inverse((half_weights * columns) @ columns.T) @ ((half_weights * columns) @ residual)
        x_step = float(np.clip(step[1], -2.0, 2.0))
        x += x_step
        if noise is not None:
            share = x_step / step[1] if step[1] else 1.0
            noise = max(noise + share * float(step[2]), least)
        if abs(x) > 4.0:
            return float(np.clip(x, -5.0, 5.0)), noise, False
        if abs(x_step) < 1e-7:
            break
    return x, noise, abs(x) <= 1.0


def _amplitude(power: Array, total: Array, means: Array, half_weights: float | Array) -> float:
    """Return the amplitude at which its own score vanishes."""
    return float(np.sum(half_weights * (power / total)) / np.sum(half_weights * means[0]))


def misfit(columns: Array, residual: Array, half_weights: float | Array) -> float:
    """Return z of the score of a change of H with scale, orthogonal to the fitted parameters."""
    bend = columns[1] ** 2
    bend = bend - columns.T @ (
        inverse((half_weights * columns) @ columns.T) @ ((half_weights * columns) @ bend)
    )
    variance = float(np.sum(half_weights * bend * bend))
    return float(np.sum(half_weights * bend * residual)) / np.sqrt(variance) if variance > 0 else 0.0


def inverse(information: Array) -> Array:
    """Invert a symmetric matrix whose columns have very different scales."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-280))
    return np.asarray(np.linalg.pinv(information * np.outer(scale, scale)) * np.outer(scale, scale))


def minimum(
    function: Callable[[float], float], low: float, high: float, tolerance: float = 1e-5, points: int = 9
) -> float:
    """Return where a function of one variable, which may have several minima, is least."""
    from scipy.optimize import minimize_scalar

    # a coarse grid first: the bounded search alone may end in a local minimum
    grid = np.linspace(low, high, points)
    k = int(np.argmin([function(g) for g in grid]))
    bounds = (grid[max(k - 1, 0)], grid[min(k + 1, points - 1)])
    return float(minimize_scalar(function, bounds=bounds, method="bounded", options={"xatol": tolerance}).x)


def crossing(function: Callable[[float], float], inside: float, limit: float, beyond: float) -> float:
    """Return where a function that is negative at `inside` vanishes; `beyond` if not up to the limit."""
    from scipy.optimize import brentq

    if function(limit) < 0:
        return beyond
    return float(brentq(function, inside, limit, xtol=1e-5))
