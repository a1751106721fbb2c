"""Fits of power laws to curves over scale, shared by the dimensions of this subpackage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fractalcontact.domains._mask_input import Array, Planes

DEVIATIONS = 2.5  # of the local slopes, to either side of a dimension
ROUNDING = 1e-14  # smallest half-width of an interval


def default_sizes(shape: Sequence[int]) -> Array:
    """Return the products of 2 and 3 up to the geometric mean of the cell and the extent, at least up to 9.

    Two sizes at a ratio of 2 or 3 give a local slope at the ratios by which most self-similar sets are
    built. No size exceeds the shorter side.
    """
    ny, nx = shape
    largest = min(max(int((ny * nx) ** 0.25 + 1e-9), 9), ny, nx)
    powers = (2**i * 3**j for i in range(largest.bit_length()) for j in range(largest.bit_length()))
    return np.array(sorted(size for size in powers if size <= largest), np.int64)


def fit_line(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the least-squares slope, the spread of the slopes from point to point, and d slope / d y.

    `y` has the points on its last axis; leading axes are free. Two points have no spread (NaN).
    """
    centred = x - x.mean()
    weights = centred / (centred @ centred)
    slope = ((y - y[..., :1]) * weights).sum(-1)  # no matrix product: same bits for a plane and for a stack
    steps = np.diff(x)
    local = np.diff(y, axis=-1) / steps
    if x.size < 3:
        return slope, np.full(slope.shape, np.nan), weights
    spread = np.sqrt(((local - slope[..., None]) ** 2 * (steps / steps.sum())).sum(-1))
    return slope, spread, weights


def fit_power_law(scales: Array, curves: Array, sign: float) -> tuple[Array, Array]:
    """Return the dimension of each curve (planes, scales), and the half-width of its interval.

    Least squares in logarithms; the half-width is `DEVIATIONS` standard deviations of the local slopes.
    `sign` is 1 for a mass that grows as s^D and -1 for an area that grows as s^(2 - D).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.where(curves > 0, np.log(curves), np.nan)
    if scales.size < 2:
        return np.full(len(curves), np.nan), np.full(len(curves), np.nan)
    slope, spread, _ = fit_line(np.log(scales / scales[0]), logs)
    return np.asarray((0.0 if sign > 0 else 2.0) + sign * slope), DEVIATIONS * spread + ROUNDING


def dimension_variables(
    planes: Planes, name: str, dimension: Array, half_width: Array, scales: Array
) -> dict[str, Any]:
    """Return a dimension, its interval and its window of scales; NaN in planes without a dimension."""
    has_value = np.isfinite(dimension)
    return {
        name: planes.variable(dimension),
        "ci_low": planes.variable(dimension - half_width),
        "ci_high": planes.variable(dimension + half_width),
        "scale_min": planes.variable(np.where(has_value, scales.min(), np.nan)),
        "scale_max": planes.variable(np.where(has_value, scales.max(), np.nan)),
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
