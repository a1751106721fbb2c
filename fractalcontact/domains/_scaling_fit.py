"""Fits of power laws to curves over scale, shared by the dimensions of this subpackage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.numbers import ROUNDED
from fractalcontact.base.regression import student_quantile
from fractalcontact.domains._masks import Array, Planes

# of the local slopes, to either side of a dimension: of 130 sets of known dimension .923 of the intervals of
# the Minkowski and all of the correlation dimension hold; with 2 .815 and .985, with 3 .969 and all
DEVIATIONS = 2.5
ROUNDING = 1e-14  # smallest half-width of an interval: dimensions of exact sets are off by some 1e-15


def default_sizes(shape: Sequence[int]) -> Array:
    """Return the products of 2 and 3 up to the geometric mean of the cell and the extent, at least up to 9.

    Two sizes at a ratio of 2 or 3 give a local slope at the ratios by which most self-similar sets are
    built; up to 9 there are 7. No size exceeds the shorter side. `shape` has one length for each axis.
    """
    extent = float(np.prod(shape)) ** (1.0 / len(shape))
    largest = min(max(int(extent**0.5 * ROUNDED), 9), *shape)
    powers = (2**i * 3**j for i in range(largest.bit_length()) for j in range(largest.bit_length()))
    return np.array(sorted(size for size in powers if size <= largest), np.int64)


def longer_sizes(shape: Sequence[int]) -> Array:
    """Return the default sizes, continued by 2^i and 3 2^i up to a quarter of the shorter side."""
    sizes = default_sizes(shape)
    quarter = min(shape) // 4
    further = [size for i in range(quarter.bit_length()) for size in (2**i, 3 * 2**i)]
    more = [size for size in further if sizes[-1] < size <= quarter]
    return np.array(sorted([*sizes.tolist(), *more]), np.int64)


def fit_line(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the least-squares slope, and the spread of the slopes from point to point.

    `y` has the points on its last axis; leading axes are free. Two points have no spread (NaN).
    """
    centred = x - x.mean()
    weights = centred / (centred @ centred)
    slope = ((y - y[..., :1]) * weights).sum(-1)  # no matrix product: same bits for a plane and for a stack
    steps = np.diff(x)
    local = np.diff(y, axis=-1) / steps
    if x.size < 3:
        return slope, np.full(slope.shape, np.nan)
    spread = np.sqrt(((local - slope[..., None]) ** 2 * (steps / steps.sum())).sum(-1))
    return slope, spread


def fit_power_law(scales: Array, curves: Array, sign: float) -> tuple[Array, Array]:
    """Return the dimension of each curve (planes, scales), and the half-width of its interval.

    Least squares in logarithms; the half-width is `DEVIATIONS` standard deviations of the local slopes.
    `sign` is 1 for a mass that grows as s^D and -1 for an area that grows as s^(2 - D).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.where(curves > 0, np.log(curves), np.nan)
    if scales.size < 2:
        return np.full(len(curves), np.nan), np.full(len(curves), np.nan)
    slope, spread = fit_line(np.log(scales / scales[0]), logs)
    return np.asarray((0.0 if sign > 0 else 2.0) + sign * slope), DEVIATIONS * spread + ROUNDING


@dataclass(frozen=True)
class Fit:
    """A dimension, and the standard deviation of the local slopes it rests on."""

    dimension: float
    spread: float


def fit_regression(sizes: Array, measure: Array) -> Fit:
    """Ordinary least squares of ln N on ln s; the spread is that of the slopes between neighbouring sizes."""
    if sizes.size < 2 or not np.all(measure > 0):
        return Fit(np.nan, np.nan)
    slope, spread = fit_line(np.log(sizes), np.log(measure))
    return Fit(0.0 - float(slope), float(spread))


def _slopes_by_ratio(sizes: Array, area: Array) -> list[tuple[Array, Array]]:
    """Return the smaller sizes of all pairs of a ratio and the local dimensions between them, for each ratio.

    Ratios that no two sizes have are left out, and all of them where an area is not positive.
    """
    if not np.all(area > 0):
        return []
    index_of = {int(size): index for index, size in enumerate(sizes)}
    result = []
    # those of the default sizes. With 2 alone the error of 194 sets of known dimension is .125 in place of
    # .089, with 4 and 5 too .041 (sets built by these), but .974 of their intervals hold in place of all
    for ratio in (2, 3):
        pairs = [(i, index_of[ratio * size]) for size, i in index_of.items() if ratio * size in index_of]
        if pairs:
            low, high = np.array(pairs).T
            local = np.log(ratio**2 * area[low] / area[high]) / np.log(ratio)
            result.append((sizes[low], local))
    return result


def fit_steady_ratio(sizes: Array, area: Array) -> Fit:
    """Mean local slope over a fixed ratio of sizes, for the ratio over which it varies least.

    A set built by a fixed ratio has counts that oscillate about their power law with that period in ln s;
    over the ratio itself, and only over it, the local slope does not oscillate. The slopes of each ratio are
    weighted by the inverse square of their variance. `area` is that of the boxes, N s^2, so that integer
    slopes are exact.
    """
    slopes = [local for _, local in _slopes_by_ratio(sizes, area)]
    if not slopes:
        return Fit(np.nan, np.nan)
    return Fit(*weighted_mean([local.mean() for local in slopes], [local.var() for local in slopes]))


def weighted_mean(slopes: Sequence[float], variances: Sequence[float]) -> tuple[float, float]:
    """Average estimates by the inverse square of their variances; return mean and spread."""
    slope, variance = np.array(slopes), np.array(variances)
    tiny = 1e-24  # variance of slopes that differ by rounding alone
    relative = (variance + tiny) / (variance + tiny).min()
    share = relative**-2.0
    share = share / share.sum()
    mean = float(slope[0] + share @ (slope - slope[0]))
    return mean, float(np.sqrt(share @ (variance + (slope - mean) ** 2)))


def deviations_of_95_percent(sizes: Array) -> float:
    """Return how many standard deviations of the local slopes make 95 %: Student's t, of the sizes less 2."""
    return student_quantile(max(sizes.size - 2, 1))


def ratio_slopes(sizes: Array, area: Array) -> tuple[Array, Array]:
    """Return ln s and the local dimensions between sizes of the ratio 2 or 3, whichever vary less."""
    best = np.zeros(0), np.zeros(0)
    for smaller, local in _slopes_by_ratio(sizes, area):
        if best[1].size < 2 or (local.size > 1 and local.var() < best[1].var()):
            best = np.log(smaller), local
    return best


def drift_of(slopes: tuple[Array, Array]) -> float:
    """Return by how much the local slopes rise or fall over the window, as a straight line through them."""
    x, y = slopes
    if x.size < 3:
        return 0.0
    return float(abs(fit_line(x, y)[0]) * np.ptp(x))


def steadiest_window(sizes: Array, areas: Array, longest: float, shape: Sequence[int], limit: int) -> slice:
    """Return the window of sizes of the fit of all planes: the usual one, or a steadier one of longer boxes.

    `areas` is (planes, sizes). No window holds more than the first `limit` sizes, or six if those are more:
    further boxes are saturated, and their slopes, all 2, would be the steadiest of all.

    The usual window reaches from one cell to the geometric mean of the cell and the extent. The counts of a
    cluster that grew on the lattice rise too slowly at boxes of a few cells. Windows of at least six sizes
    that span a ratio of at least 8, up to a quarter of the set (`longest`), are compared by the spread of
    their local slopes over their length in ln s, averaged over the planes. The best replaces the usual one if
    it is steadier by far and its dimension is higher: slopes that fall from 2 with the size are those of
    islands, which are resolved.
    """
    # on 194 sets of known dimension a ratio of 4 has an error of .075 and widths of .53 in place of .33, of
    # 16 .105; 4 sizes change nothing, 9 have wider intervals (.35)
    least_ratio, least_sizes = 8, 6
    # of the unsteadiness of the usual window: if never, the error is .113 (width .63); from .3 on .093 (.33),
    # .7 .087 (.37), 1 .082 (.41)
    steadier = 0.5
    usual = default_sizes(shape).max()
    most = max(limit, least_sizes)
    count = min(most, int(np.searchsorted(sizes, max(longest, usual), side="right")))
    chosen = slice(0, min(most, int(np.searchsorted(sizes, usual, side="right"))))
    dimension, unsteadiness = _mean_fit(sizes[chosen], areas[:, chosen])
    if not np.isfinite(dimension):
        return chosen
    lowest = steadier * unsteadiness
    for stop in range(chosen.stop, count + 1):
        for start in range(1, stop - least_sizes + 1):
            part = slice(start, stop)
            if sizes[stop - 1] < least_ratio * sizes[start]:
                break
            higher, score = _mean_fit(sizes[part], areas[:, part])
            if score < lowest and higher > dimension:
                chosen, lowest = part, score
    return chosen


def _mean_fit(sizes: Array, areas: Array) -> tuple[float, float]:
    """Return the mean dimension of all planes, and the spread of local slopes over the length in ln s."""
    fits = [fit_steady_ratio(sizes, area) for area in areas]
    length = np.log(sizes[-1] / sizes[0]) if sizes.size > 1 else np.inf
    steady = 3e-3  # below it a longer window is better than a steadier one; .001 to .01 are alike
    spread = np.mean([np.hypot(fit.spread, steady) for fit in fits])
    return float(np.mean([fit.dimension for fit in fits])), float(spread / length)


def dimension_variables(
    planes: Planes,
    name: str,
    dimension: Array,
    half_width: Array,
    scales: Array,
    windows: Sequence[slice] | None = None,
) -> dict[str, Any]:
    """Return a dimension, its interval and its window of scales; NaN in planes without a dimension.

    A set in the plane has a dimension from 0 to 2, on a line from 0 to 1. A value beyond is limited to it
    before its interval is, which then still has a width. `windows` are the scales used in each plane, all by
    default.
    """
    has_value = np.isfinite(dimension)
    dimension = np.clip(dimension, 0.0, planes.rank)
    used = [scales[window] for window in windows or [slice(0, scales.size)] * planes.count]
    smallest, largest = (np.array([end(scale) for scale in used]) for end in (np.min, np.max))
    return {
        name: planes.variable(dimension),
        "ci_low": planes.variable(np.clip(dimension - half_width, 0.0, planes.rank)),
        "ci_high": planes.variable(np.clip(dimension + half_width, 0.0, planes.rank)),
        "scale_min": planes.variable(np.where(has_value, smallest, np.nan)),
        "scale_max": planes.variable(np.where(has_value, largest, np.nan)),
    }


def interval_notes(interval: str) -> dict[str, dict[str, str]]:
    """Return the attributes of the ends of an interval."""
    return {
        "ci_low": {"long_name": f"lower end of the {interval}"},
        "ci_high": {"long_name": f"upper end of the {interval}"},
    }


def window_notes(smallest: str, largest: str) -> dict[str, dict[str, str]]:
    """Return the attributes of a window of scales, which are in cells and not in metres."""
    return {
        "scale_min": {"units": "1", "long_name": f"{smallest}, in cells"},
        "scale_max": {"units": "1", "long_name": f"{largest}, in cells"},
    }


def fit_notes(name: str, dimension: Array, scales: int, scale_name: str) -> dict[str, dict[str, str]]:
    """Return the attributes of a dimension from `fit_power_law` and of the variables beside it."""
    words = name.replace("_", " ").capitalize().replace("Correlation", "correlation")
    interval = f"interval of the {words} ({DEVIATIONS:g} standard deviations of the local slopes)"
    notes = {
        **interval_notes(interval),
        **window_notes(f"smallest {scale_name} of the fit", f"largest {scale_name} of the fit"),
        "null_dimension": {"long_name": f"{words} of the random null of equal coverage"},
    }
    if scales < 2:
        notes[name] = {"comment": "NaN: one scale gives no slope"}
    elif np.isnan(dimension).any():
        notes[name] = {"comment": f"NaN where the set is empty ({int(np.isnan(dimension).sum())} planes)"}
    return notes
