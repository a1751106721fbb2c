"""Statistics of one plane of heights, with or without gaps, arrays only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fractalcontact.base import spectra
from fractalcontact.base.polynomial import shifted, slopes

Array = np.ndarray[Any, np.dtype[Any]]

_OF_HEIGHTS = (
    "mean_height",
    "rms_height",
    "mean_absolute_height",
    "peak_height",
    "valley_depth",
    "peak_to_valley",
    "skewness",
    "kurtosis",
)


def statistics(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> dict[str, float]:
    """Return the statistics of a plane (ny, nx) or a profile (nx,); NaN where there is nothing to say.

    A plane that is periodic and complete is differentiated by its modes; any other by differences of
    neighbours.
    """
    result = _heights(heights)
    if math.isnan(result["mean_height"]):
        return result | dict.fromkeys(_gradient_names(heights.ndim), math.nan)
    values, _, scale = shifted(heights)
    unit = math.ldexp(1.0, math.frexp(max(spacing))[1])
    steps = [step / unit for step in spacing]
    if all(periodic) and not np.isnan(values).any():
        psd, _ = spectra.periodogram(values, steps)
        moments = spectra.spectral_moments(psd, values.shape, steps)
        along = spectra.directional_slopes(psd, values.shape, steps)
    else:
        moments, along = _differences(values, steps, periodic, (result["rms_height"] / scale) ** 2)
    ratio = scale / unit
    mean = slopes(heights, spacing)
    result["rms_slope"] = moments.rms_slope * ratio
    result["rms_curvature"] = moments.rms_curvature * ratio / unit
    result["nayak_parameter"] = moments.nayak
    for name, rms, slope in zip(("y", "x")[2 - heights.ndim :], along, mean, strict=True):
        result[f"rms_slope_{name}"] = rms * ratio
        result[f"mean_slope_{name}"] = slope
    excess = _developed(values, [step / ratio for step in steps], periodic)
    result["developed_area_ratio"] = 1.0 + excess
    result["developed_area_excess"] = excess
    return result


def names(axes: int) -> list[str]:
    """Return the names of all statistics of a plane (2 axes) or a profile."""
    return [*_OF_HEIGHTS, "missing_points", *_gradient_names(axes)]


def _gradient_names(axes: int) -> list[str]:
    names = ["rms_slope", "rms_curvature", "nayak_parameter", "developed_area_ratio", "developed_area_excess"]
    return names + [f"{kind}_slope_{dim}" for dim in ("y", "x")[2 - axes :] for kind in ("rms", "mean")]


def _heights(heights: Array) -> dict[str, float]:
    """Return what the heights alone tell."""
    observed = heights[~np.isnan(heights)]
    result = dict.fromkeys(_OF_HEIGHTS, math.nan) | {"missing_points": float(heights.size - observed.size)}
    if observed.size == 0:
        return result
    values, reference, scale = shifted(observed)
    mean = float(values.mean())
    values -= mean
    variance = float(np.mean(values**2))
    result["mean_height"] = reference + scale * mean
    result["rms_height"] = scale * math.sqrt(variance)
    result["mean_absolute_height"] = scale * float(np.mean(np.abs(values)))
    result["peak_height"] = scale * float(values.max())
    result["valley_depth"] = -scale * float(values.min())
    result["peak_to_valley"] = float(observed.max() - observed.min())
    if result["peak_to_valley"] > 0.0:
        result["skewness"] = float(np.mean(values**3)) / variance**1.5
        result["kurtosis"] = float(np.mean(values**4)) / variance**2
    return result


def _differences(
    values: Array, steps: Sequence[float], periodic: Sequence[bool], height: float
) -> tuple[spectra.Moments, tuple[float, ...]]:
    """Return the moments from differences of neighbours, and the rms slope along each axis."""
    squares = []
    laplacian: Array = np.zeros_like(values)
    for axis, (step, wraps) in enumerate(zip(steps, periodic, strict=True)):
        squares.append(_mean_square(_step(values, axis, wraps) / step))
        laplacian = laplacian + _second(values, axis, wraps) / step**2
    moments = spectra.Moments(height, sum(squares), _mean_square(laplacian), values.ndim)
    return moments, tuple(float(math.sqrt(square)) for square in squares)


def _step(values: Array, axis: int, wraps: bool) -> Array:
    if wraps:
        return np.roll(values, -1, axis) - values
    return np.diff(values, axis=axis)


def _second(values: Array, axis: int, wraps: bool) -> Array:
    """Return second differences on all points, NaN where a neighbour is missing."""
    second = np.roll(values, -1, axis) - 2.0 * values + np.roll(values, 1, axis)
    if not wraps:
        edge = [slice(None)] * values.ndim
        for end in (0, -1):
            edge[axis] = slice(end, end + 1 or None)
            second[tuple(edge)] = np.nan
    return second


def _mean_square(values: Array) -> float:
    there = values[~np.isnan(values)]
    return float(np.mean(there**2)) if there.size else math.nan


def _developed(values: Array, steps: Sequence[float], periodic: Sequence[bool]) -> float:
    """Return the mean of sqrt(1 + gradient^2) - 1: over chords, or over triangles cut both ways."""
    if values.ndim == 1:
        slope = _step(values, 0, periodic[0]) / steps[0]
        excess = _stretch(slope**2)
        return float(np.nanmean(excess)) if np.isfinite(excess).any() else math.nan
    across = _step(values, 1, periodic[1]) / steps[1]
    along = _step(values, 0, periodic[0]) / steps[0]
    rows = (across, np.roll(across, -1, 0)) if periodic[0] else (across[:-1], across[1:])
    columns = (along, np.roll(along, -1, 1)) if periodic[1] else (along[:, :-1], along[:, 1:])
    excess = np.mean([_stretch(row**2 + column**2) for row in rows for column in columns], axis=0)
    there = excess[np.isfinite(excess)]
    return float(there.mean()) if there.size else math.nan


def _stretch(square: Array) -> Array:
    """Return sqrt(1 + square) - 1, which small slopes do not lose to rounding."""
    return np.asarray(square / (1.0 + np.sqrt(1.0 + square)))
