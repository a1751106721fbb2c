"""Fits to data: polynomials of heights with gaps, power laws, means of values that scatter, outliers.

A slope of a power law is d ln value / d ln scale. Values that scatter more than their errors say have random
effects (meta-analysis): every one is x_i = mu + b_i + e_i, the scatter between the measured objects has
Var b = tau^2, the known error within each Var e_i = s_i^2.

References
----------
Paule and Mandel (1982), J. Res. Natl. Bur. Stand. 87, 377: tau^2.
Hartung and Knapp (2001), Stat. Med. 20, 3875; Sidik and Jonkman (2002), Stat. Med. 21, 3153: the interval.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fractalcontact.base.numbers import Array, power_of_two

# smallest singular value over the largest for which the points fix the polynomial: it is 6e-17 of a plane
# through one line, 2e-6 through two neighbouring rows of 512 points, 6e-8 of 4096
RANK = 1e-10
# of the greatest height: up to which the residual of a plane is rounding; that of 800 random planes was at
# most 3.4 eps
ROUNDING = 64.0 * np.finfo(np.float64).eps


def shifted(heights: Array) -> tuple[Array, float, float]:
    """Return (heights - reference) / scale, the reference (an observed height), and the scale (a power of 2).

    Subtracting an observed height loses no digits of heights that are close to each other. Scaled values are
    within -1 and 1; NaN stays. At least one height is observed.
    """
    low, high = float(heights.min()), float(heights.max())
    if np.isfinite(low) and np.isfinite(high):
        reference = float(heights.flat[heights.size // 2])
    else:
        observed = heights[np.isfinite(heights)]
        reference = float(observed[observed.size // 2])
        low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    offset = heights - reference
    largest = max(high - reference, reference - low)
    scale = power_of_two(largest)
    offset /= scale
    return offset, reference, scale


def rounding_of(heights: Array) -> float:
    """Return up to which residual the heights, NaN where missing, may be those of a plane."""
    return float(ROUNDING * np.nanmax(np.abs(heights)))


def detrended(heights: Array, order: int, wraps: Sequence[bool] = ()) -> tuple[Array, bool]:
    """Return the heights minus their least-squares polynomial, and whether the points determine it.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx) or (nx,)
        NaN where missing; at least one value is finite.
    order : int
        Total degree of the polynomial.
    wraps : sequence of bool
        Axes along which the heights are periodic: they come back to their height, and have no slope. Nor has
        an axis of one point.
    """
    wraps = [w or n == 1 for w, n in zip(wraps or (False,) * heights.ndim, heights.shape, strict=True)]
    values, _, scale = shifted(heights)
    observed = np.isfinite(values)
    is_complete = bool(observed.all())
    if not is_complete:
        values[~observed] = 0.0
    basis = _basis(heights.shape, order, wraps)
    gram = _gram(basis, observed)
    if gram is None:
        return heights, False
    for _ in range(2):  # the second pass removes the rounding error of the first
        right = np.array([_project(values, functions) for functions in basis])
        _subtract(values, basis, np.linalg.solve(gram, right))
        if not is_complete:
            values[~observed] = 0.0
    values *= scale
    if not is_complete:
        values[~observed] = np.nan
    return values, True


def slopes(heights: Array, spacing: Sequence[float], wraps: Sequence[bool] = ()) -> tuple[float, ...]:
    """Return the slope of the mean plane along each axis, y first; NaN if it is undetermined.

    It is 0 along an axis that wraps.
    """
    if not np.isfinite(heights).any():
        return (math.nan,) * heights.ndim
    values, _, scale = shifted(heights)
    return tuple(scale * slope for slope in scaled_slopes(values, spacing, wraps))


def scaled_slopes(values: Array, spacing: Sequence[float], wraps: Sequence[bool] = ()) -> tuple[float, ...]:
    """Return the slopes of heights that `shifted` has scaled; they are not changed."""
    observed = np.isfinite(values)
    if not observed.all():
        values = np.where(observed, values, 0.0)
    basis = _basis(values.shape, 1, wraps)
    gram = _gram(basis, observed)
    if gram is None:
        return (math.nan,) * values.ndim
    weights = np.linalg.solve(gram, np.array([_project(values, functions) for functions in basis]))
    # the basis is 1, then each axis that does not wrap in half-extents, x before y
    rises = iter(weights[:0:-1])
    halves = [0.5 * (n - 1) * step for n, step in zip(values.shape, spacing, strict=True)]
    wraps = wraps or (False,) * values.ndim
    return tuple(0.0 if w else float(next(rises)) / half for w, half in zip(wraps, halves, strict=True))


def _basis(shape: tuple[int, ...], order: int, wraps: Sequence[bool]) -> list[tuple[Array, ...]]:
    """Return products of Legendre polynomials on -1 ... 1 for each axis, ordered by degree, then y power.

    They are constant along an axis that wraps.
    """
    axes = [np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, n), order).T for n in shape]
    highest = [0 if w else order for w in wraps or (False,) * len(shape)]
    powers = itertools.product(*(range(power + 1) for power in highest))
    chosen = sorted((p for p in powers if sum(p) <= order), key=lambda p: (sum(p), p))
    return [tuple(axis[power] for axis, power in zip(axes, p, strict=True)) for p in chosen]


def _gram(basis: list[tuple[Array, ...]], observed: Array) -> Array | None:
    """Return the sums of products of the basis over the observed points; None if they are too few."""
    complete = bool(observed.all())
    weight = np.ones(1) if complete else observed.astype(np.float64)
    gram = np.empty((len(basis), len(basis)))
    for (i, first), (j, second) in itertools.combinations_with_replacement(enumerate(basis), 2):
        functions = tuple(a * b for a, b in zip(first, second, strict=True))
        total = math.prod(float(f.sum()) for f in functions) if complete else _project(weight, functions)
        gram[i, j] = gram[j, i] = total
    singular = np.linalg.svd(gram, compute_uv=False)
    return None if singular[-1] < RANK * singular[0] else gram


def _project(values: Array, functions: tuple[Array, ...]) -> float:
    """Return the sum of values times the product of one function for each axis."""
    lines = np.einsum("...j,j->...", values, functions[-1])
    return float(lines if len(functions) == 1 else np.einsum("i,i->", lines, functions[0]))


def _subtract(values: Array, basis: list[tuple[Array, ...]], weights: Array) -> None:
    """Subtract the weighted sum of the basis, a few rows at a time: a second array would be slower."""
    lines = values.reshape(-1, values.shape[-1])
    across = np.array(
        [w * np.ones(1) if len(f) == 1 else w * f[0] for w, f in zip(weights, basis, strict=True)]
    )
    along = np.array([f[-1] for f in basis])
    few = 16  # of 2048 x 2048 points; 32 to 256 take as long, 1 and 1024 two to three times as long
    for first in range(0, len(lines), few):
        lines[first : first + few] -= np.einsum("ky,kx->yx", across[:, first : first + few], along)


def fitted_slope(scale: Array, value: Array) -> float:
    """Return the slope of the line through ln value against ln scale; NaN of fewer than two usable points.

    Points are usable where both are finite and positive; all of them have one weight.
    """
    x, y = (logarithm(np.asarray(each, float)) for each in (scale, value))
    usable = np.isfinite(x) & np.isfinite(y)
    x, y = x[usable], y[usable]
    if x.size < 2 or np.ptp(x) == 0:
        return float("nan")
    weights = np.full(x.size, 1.0 / x.size)
    x, y = x - float(weights @ x), y - float(weights @ y)
    return float(weights @ (x * y)) / float(weights @ x**2)


def local_slope(scale: Array, value: Array) -> Array:
    """Return d ln value / d ln scale at every point (centred; one-sided at the ends).

    `value` has the scale on its last axis and any leading axes. NaN where the value is not positive.
    """
    scale, value = np.asarray(scale, float), np.asarray(value, float)
    if scale.size < 2:
        return np.full(value.shape, np.nan)
    y = logarithm(value)
    return np.asarray(np.gradient(np.where(np.isfinite(y), y, np.nan), logarithm(scale), axis=-1))


def logarithm(values: Array) -> Array:
    """Return ln(values / 2^k), of each curve along the last axis with its own k.

    The unit of the values then changes no bit of a slope.
    """
    positive = np.isfinite(values) & (values > 0)
    lowest = np.min(values, axis=-1, keepdims=True, initial=np.inf, where=positive)
    highest = np.max(values, axis=-1, keepdims=True, initial=0.0, where=positive)
    # a value of rounding beside large ones must not make these overflow: float64 ends at 2^1024
    lowest = np.maximum(lowest, np.ldexp(highest, -1000))
    unit = np.frexp(np.where(np.isfinite(lowest), lowest, 0.5))[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(np.ldexp(values, -unit)))


@dataclass(frozen=True)
class RandomEffects:
    """Mean with its interval, scatter between (tau) and mean error within, share of tau^2, and the number."""

    mean: float
    low: float
    high: float
    between: float
    within: float
    heterogeneity: float
    count: int


def student_quantile(freedom: float, level: float = 0.95) -> float:
    """Return the half-width of an interval of Student's t, in standard errors."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + level / 2))


def random_effects(values: ArrayLike, errors: ArrayLike = 0.0, level: float = 0.95) -> RandomEffects:
    """Return the random-effects mean of values with the standard errors of each, of those that are finite.

    Values without errors have the mean and the interval of Student. One value alone has the interval of its
    error, if it has one.
    """
    from scipy.special import ndtri

    x, s = np.broadcast_arrays(np.asarray(values, dtype=float), np.asarray(errors, dtype=float))
    is_finite = np.isfinite(x) & np.isfinite(s)
    x, variance = x[is_finite], s[is_finite] ** 2
    count = x.size
    if count < 2:
        mean = float(x[0]) if count else np.nan
        half = ndtri(0.5 + level / 2) * np.sqrt(variance[0]) if count and variance[0] > 0 else np.nan
        within = float(s[is_finite].mean()) if count else np.nan
        return RandomEffects(mean, mean - half, mean + half, np.nan, within, np.nan, count)
    tau2, within = _between(x, variance), float(np.sqrt(variance.mean()))
    total = variance + tau2
    if not total.all():  # equal values, some without errors
        return RandomEffects(float(x[0]), float(x[0]), float(x[0]), 0.0, within, 0.0, count)
    weight = 1.0 / total
    mean = float(weight @ x / weight.sum())
    # the q of Hartung and Knapp, at least 1: otherwise values that agree by chance have too short an interval
    q = max(1.0, float(weight @ (x - mean) ** 2) / (count - 1))
    half = student_quantile(count - 1, level) * float(np.sqrt(q / weight.sum()))
    return RandomEffects(
        mean, mean - half, mean + half, float(np.sqrt(tau2)), within, tau2 / (tau2 + within**2), count
    )


def _between(x: np.ndarray, variance: np.ndarray) -> float:
    """Return tau^2, for which the weighted squares about the mean add up to n - 1; 0 if they are less."""
    from scipy.optimize import brentq

    def excess(tau2: float) -> float:
        weight = 1.0 / (variance + tau2)
        return float(weight @ (x - weight @ x / weight.sum()) ** 2) - (x.size - 1)

    spread = float(x.var(ddof=1))
    if spread == 0.0 or (variance.min() > 0 and excess(0.0) <= 0.0):
        return 0.0
    # above 0 where some have no error; 1e-15 moved means and ends of 120 sets by up to 1e-5, 1e-9 by 4e-4
    lowest = 0.0 if variance.min() > 0 else 1e-12 * spread
    # with tau^2 of n times the variance of the values, their weighted squares add up to less than n - 1
    highest = x.size * spread
    # the default tolerance moves the same means and ends by 2e-11
    return float(brentq(excess, lowest, highest, xtol=1e-12 * spread)) if excess(lowest) > 0 else lowest


def is_far(values: NDArray[np.float64], limit: float = 3.5) -> NDArray[np.bool_]:
    """Return which of the values lie far from all others: a modified z beyond 3.5; none of a few values.

    z is 0.6745 times the distance from the median over the median distance, which is 0.6745 of a normal
    distribution (Iglewicz and Hoaglin 1993, How to detect and handle outliers).
    """
    is_finite = np.isfinite(values)
    if is_finite.sum() < 5:  # of fewer, one that lies apart may well be half of them
        return np.zeros(values.shape, dtype=bool)
    distance = np.abs(values - np.median(values[is_finite]))
    return np.asarray(is_finite & (0.6745 * distance > limit * np.median(distance[is_finite])))
