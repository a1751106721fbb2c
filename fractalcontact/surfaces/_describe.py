"""Statistics of heights, slopes and curvature."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.coords import check_leading, leading_coords
from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.polynomial import shifted, slopes
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems

NAYAK = "Nayak, Random process model of rough surfaces, Journal of Lubrication Technology 93 (1971) 398-407"
Array = np.ndarray[Any, np.dtype[Any]]

HEIGHT_STATISTICS = (
    "mean_height",
    "rms_height",
    "mean_absolute_height",
    "peak_height",
    "valley_depth",
    "peak_to_valley",
    "skewness",
    "kurtosis",
)


def _check(problems: Problems, *, surface: Any) -> None:
    valid = problems.surface("surface", surface, finite=False, leading=True, profile=True)
    if isinstance(surface, xr.DataArray):
        check_leading(surface, _result_names(len(core_dims(surface))), problems)
    if valid:
        infinite = int(np.count_nonzero(np.isinf(surface.values)))
        expected = "finite heights, or NaN where missing"
        problems.require(infinite == 0, "surface", expected, f"{infinite} infinite")


@public_result(
    title="Statistics of a surface",
    references=NAYAK,
    achieved_error="exact to rounding, for the points as they are",
    check=_check,
    memory=116.0,
)
def describe(surface: xr.DataArray) -> xr.Dataset:
    """Return statistics of the heights, slopes and curvature of a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). They are not levelled first. Missing points (NaN)
        are left out, and so are the differences that need them.

    Returns
    -------
    Dataset
        Over the leading dims, if there are any (symbols of ISO 25178-2 in brackets):

        - mean_height (m), and about it rms_height (Sq), mean_absolute_height (Sa), peak_height (Sp),
          valley_depth (Sv), peak_to_valley (Sz); skewness (Ssk), kurtosis (Sku, 3 if Gaussian)
        - rms_slope (Sdq: of the gradient, both components), rms_slope_x, rms_slope_y
        - mean_slope_x, mean_slope_y of the least-squares plane
        - rms_curvature (m-1) of the mean curvature, half the Laplacian (of z'' for a profile)
        - nayak_parameter, m0 m4 / m2^2 of the profiles of an isotropic surface
        - developed_area_ratio, area over that of the plane (length for a profile); developed_area_excess
          (Sdr), the same less one, without loss of digits for small slopes
        - missing_points, run_time

        A statistic that does not exist is NaN and has the reason in its attribute `reason`.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or infinite heights.

    Notes
    -----
    A complete periodic surface is differentiated by its Fourier modes: its mean square slope is the sum of
    q^2 C. Any other uses differences of neighbours, which reduce the shortest wavelengths a little. The
    developed area is that of triangles between neighbours. ISO 25178-2 levels and filters first; use `level`.

    References
    ----------
    ISO 25178-2 (2021), Surface texture: areal, terms, definitions and surface texture parameters.
    Nayak (1971), Random process model of rough surfaces, Journal of Lubrication Technology 93, 398-407.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> heights = np.tile(1e-6 * np.sin(2 * np.pi * np.arange(64) / 64), (64, 1))
    >>> statistics = fc.surfaces.describe(fc.surfaces.from_array(heights, 1e-6, periodic=True))
    >>> print(f"{float(statistics.rms_height):.3e} m, {float(statistics.rms_slope_x):.4f}")
    7.071e-07 m, 0.0694
    """
    grid = read_grid(surface, core_dims(surface))
    leading = surface.dims[: surface.ndim - len(grid.shape)]
    planes = np.asarray(surface.values, dtype=np.float64).reshape(-1, *grid.shape)
    rows = [_statistics(plane, grid.spacing, grid.periodic) for plane in planes]
    lengths = surface.shape[: len(leading)]
    values = {name: np.array([row[name] for row in rows]).reshape(lengths) for name in rows[0]}
    values["missing_points"] = values["missing_points"].astype(np.int64)
    by_modes = all(grid.periodic) and not np.isnan(planes).any()
    result = xr.Dataset(
        {name: (leading, value) for name, value in values.items()},
        coords=leading_coords(surface, leading, _result_names(len(grid.shape))),
        attrs={"derivatives": "modes" if by_modes else "differences"},
    )
    _explain_missing(result, planes)
    return result


def _result_names(axes: int) -> list[str]:
    """Return the names of all variables of the result for a plane (2 axes) or a profile."""
    return [*HEIGHT_STATISTICS, "missing_points", *_gradient_names(axes), "run_time"]


def _explain_missing(result: xr.Dataset, planes: Array) -> None:
    """Set the attribute `reason` of every statistic that is NaN."""
    empty = bool(np.isnan(planes).all(axis=tuple(range(1, planes.ndim))).any())
    flat = bool((result["peak_to_valley"] == 0).any())
    for name in ("skewness", "kurtosis", "nayak_parameter"):
        if flat:
            result[name].attrs["reason"] = "all heights of a surface are equal"
    for variable in result.data_vars.values():
        if "reason" not in variable.attrs and bool(np.isnan(variable).any()):
            reason = "no point was observed" if empty else "too few neighbouring points were observed"
            variable.attrs["reason"] = reason


def _statistics(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> dict[str, float]:
    """Return the statistics of a plane (ny, nx) or a profile (nx,); NaN where one is undefined.

    A complete periodic plane is differentiated by its Fourier modes; any other by differences of neighbours.
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
    excess = _developed_excess(values, [step / ratio for step in steps], periodic)
    result["developed_area_ratio"] = 1.0 + excess
    result["developed_area_excess"] = excess
    return result


def _gradient_names(axes: int) -> list[str]:
    names = ["rms_slope", "rms_curvature", "nayak_parameter", "developed_area_ratio", "developed_area_excess"]
    return names + [
        f"{statistic}_slope_{dim}" for dim in ("y", "x")[2 - axes :] for statistic in ("rms", "mean")
    ]


def _heights(heights: Array) -> dict[str, float]:
    """Return the statistics of the distribution of heights."""
    observed = heights[~np.isnan(heights)]
    result = dict.fromkeys(HEIGHT_STATISTICS, math.nan) | {
        "missing_points": float(heights.size - observed.size)
    }
    if observed.size == 0:
        return result
    values, reference, scale = shifted(observed)
    mean = float(values.mean())
    values -= mean
    squares = values * values  # higher powers as products: numpy takes ten times as long for values**3
    variance = float(np.mean(squares))
    result["mean_height"] = reference + scale * mean
    result["rms_height"] = scale * math.sqrt(variance)
    result["mean_absolute_height"] = scale * float(np.mean(np.abs(values)))
    result["peak_height"] = scale * float(values.max())
    result["valley_depth"] = -scale * float(values.min())
    result["peak_to_valley"] = float(observed.max() - observed.min())
    if result["peak_to_valley"] > 0.0:
        result["skewness"] = float(np.mean(squares * values)) / variance**1.5
        result["kurtosis"] = float(np.mean(squares * squares)) / variance**2
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
    observed = values[~np.isnan(values)]
    return float(np.mean(observed**2)) if observed.size else math.nan


def _developed_excess(values: Array, steps: Sequence[float], periodic: Sequence[bool]) -> float:
    """Return the mean of sqrt(1 + gradient^2) - 1 over chords, or over triangles of cells cut both ways."""
    if values.ndim == 1:
        slope = _step(values, 0, periodic[0]) / steps[0]
        excess = _excess(slope**2)
        return float(np.nanmean(excess)) if np.isfinite(excess).any() else math.nan
    across = _step(values, 1, periodic[1]) / steps[1]
    along = _step(values, 0, periodic[0]) / steps[0]
    rows = (across, np.roll(across, -1, 0)) if periodic[0] else (across[:-1], across[1:])
    columns = (along, np.roll(along, -1, 1)) if periodic[1] else (along[:, :-1], along[:, 1:])
    excess = np.mean([_excess(row**2 + column**2) for row in rows for column in columns], axis=0)
    observed = excess[np.isfinite(excess)]
    return float(observed.mean()) if observed.size else math.nan


def _excess(square: Array) -> Array:
    """Return sqrt(1 + square) - 1 without loss of digits for small slopes."""
    return np.asarray(square / (1.0 + np.sqrt(1.0 + square)))
