"""Power-law fits of scaling curves: weighted lines through logarithms, and local slopes.

A slope is d ln value / d ln scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Line:
    """A straight line through ln value against ln scale.

    `standard_error` assumes independent errors. Points of a scaling curve are correlated, so it gives no
    confidence interval by itself.
    """

    slope: float
    intercept: float
    standard_error: float
    points: int


def fit_line(scale: Array, value: Array, weights: Array | None = None) -> Line:
    """Fit ln value = intercept + slope * ln scale over the finite, positive points.

    Parameters
    ----------
    scale, value : ndarray, shape (n,)
    weights : ndarray, shape (n,), optional
        Inverse variances of ln value, up to a factor.

    Returns
    -------
    Line
        NaN if fewer than two points can be used.
    """
    scale, value = np.asarray(scale, float), np.asarray(value, float)
    weights = np.ones(scale.shape) if weights is None else np.asarray(weights, float)
    (x, x_unit), (y, y_unit) = logarithm(scale), logarithm(value)
    usable = np.isfinite(x) & np.isfinite(y) & (weights > 0)
    x, y, w = x[usable], y[usable], weights[usable]
    if x.size < 2 or np.ptp(x) == 0:
        return Line(np.nan, np.nan, np.nan, int(x.size))
    w = w / w.sum()
    x_mean, y_mean = float(w @ x), float(w @ y)
    spread = float(w @ (x - x_mean) ** 2)
    slope = float(w @ ((x - x_mean) * (y - y_mean))) / spread
    residual = y - y_mean - slope * (x - x_mean)
    error = np.sqrt(float(w @ residual**2) / spread / (x.size - 2)) if x.size > 2 else np.nan
    intercept = y_mean - slope * x_mean + (y_unit.item() - slope * x_unit.item()) * np.log(2.0)
    return Line(slope, float(intercept), float(error), int(x.size))


def local_slope(scale: Array, value: Array) -> Array:
    """Return d ln value / d ln scale at every point (centred; one-sided at the ends).

    `value` has the scale on its last axis and any leading axes. NaN where the value is not positive.
    """
    scale, value = np.asarray(scale, float), np.asarray(value, float)
    if scale.size < 2:
        return np.full(value.shape, np.nan)
    y = logarithm(value)[0]
    return np.asarray(np.gradient(np.where(np.isfinite(y), y, np.nan), logarithm(scale)[0], axis=-1))


def logarithm(values: Array) -> tuple[Array, Array]:
    """Return ln(values / 2^k) and k, so that the unit of the values changes no bit of a slope.

    Each curve, along the last axis, has its own k, which has shape (..., 1).
    """
    positive = np.isfinite(values) & (values > 0)
    lowest = np.min(values, axis=-1, keepdims=True, initial=np.inf, where=positive)
    highest = np.max(values, axis=-1, keepdims=True, initial=0.0, where=positive)
    # a value of rounding beside large ones must not make these overflow: float64 ends at 2^1024
    lowest = np.maximum(lowest, np.ldexp(highest, -1000))
    unit = np.frexp(np.where(np.isfinite(lowest), lowest, 0.5))[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.ldexp(values, -unit)), unit
