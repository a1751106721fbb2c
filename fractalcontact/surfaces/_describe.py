"""Statistics of heights, slopes and curvature."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.coords import check_leading
from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.polynomial import scaled_slopes, shifted
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._height_planes import check_planes, labelled_rows

NAYAK = "Nayak, Random process model of rough surfaces, Journal of Lubrication Technology 93 (1971) 398-407"

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


def _check(problems: Problems) -> None:
    surface = problems.given.surface
    check_planes(problems, smallest=3)
    if isinstance(surface, xr.DataArray):
        check_leading(surface, _result_names(len(core_dims(surface))), problems)


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
    planes = np.asarray(surface.values, dtype=np.float64).reshape(-1, *grid.shape)
    result = labelled_rows(surface, [_statistics(plane, grid.spacing, grid.periodic) for plane in planes])
    by_modes = all(grid.periodic) and not np.isnan(planes).any()
    result.attrs["derivatives"] = "modes" if by_modes else "differences"
    _explain_missing(result, planes)
    return result


def _result_names(axes: int) -> list[str]:
    """Return the names of all variables of the result for a plane (2 axes) or a profile."""
    return [*HEIGHT_STATISTICS, "missing_points", *_gradient_names(axes), "run_time"]


def _explain_missing(result: xr.Dataset, planes: Array) -> None:
    """Set the attribute `reason` of every statistic that is NaN."""
    variables = {name: result.variables[name] for name in result.data_vars}
    undefined = [name for name, variable in variables.items() if np.isnan(variable.values).any()]
    if not undefined:
        return
    empty = bool(np.isnan(planes).all(axis=tuple(range(1, planes.ndim))).any())
    flat = bool((variables["peak_to_valley"].values == 0).any())
    for name in undefined:
        reason = "no point was observed" if empty else "too few neighbouring points were observed"
        if flat and name in ("skewness", "kurtosis", "nayak_parameter"):
            reason = "all heights of a surface are equal"
        variables[name].attrs["reason"] = reason


def _statistics(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> dict[str, float]:
    """Return the statistics of a plane (ny, nx) or a profile (nx,); NaN where one is undefined.

    A complete periodic plane is differentiated by its Fourier modes; any other by differences of neighbours.
    """
    complete = not np.isnan(heights.min())
    if not complete and np.isnan(heights).all():
        result = dict.fromkeys(HEIGHT_STATISTICS, math.nan) | {"missing_points": heights.size}
        return result | dict.fromkeys(_gradient_names(heights.ndim), math.nan)
    values, reference, scale = shifted(heights)
    result = _heights(values if complete else values[~np.isnan(values)], reference, scale)
    result["missing_points"] = 0 if complete else int(np.count_nonzero(np.isnan(values)))
    unit = math.ldexp(1.0, math.frexp(max(spacing))[1])
    steps = [step / unit for step in spacing]
    ratio = scale / unit
    squares, laplacian_square, excess = _neighbours(values, steps, periodic, ratio)
    if all(periodic) and complete:
        psd, _ = spectra.periodogram(values, steps)
        moments = spectra.spectral_moments(psd, values.shape, steps)
        along = spectra.directional_slopes(psd, values.shape, steps)
    else:
        height = (result["rms_height"] / scale) ** 2
        moments = spectra.Moments(height, sum(squares), laplacian_square, values.ndim)
        along = tuple(math.sqrt(square) for square in squares)
    mean = scaled_slopes(values, spacing)
    result["rms_slope"] = moments.rms_slope * ratio
    result["rms_curvature"] = moments.rms_curvature * ratio / unit
    result["nayak_parameter"] = moments.nayak
    for name, rms, slope in zip(("y", "x")[2 - heights.ndim :], along, mean, strict=True):
        result[f"rms_slope_{name}"] = rms * ratio
        result[f"mean_slope_{name}"] = scale * slope
    result["developed_area_ratio"] = 1.0 + excess
    result["developed_area_excess"] = excess
    return result


def _gradient_names(axes: int) -> list[str]:
    names = ["rms_slope", "rms_curvature", "nayak_parameter", "developed_area_ratio", "developed_area_excess"]
    return names + [
        f"{statistic}_slope_{dim}" for dim in ("y", "x")[2 - axes :] for statistic in ("rms", "mean")
    ]


def _heights(values: Array, reference: float, scale: float) -> dict[str, float]:
    """Return the statistics of the distribution of heights reference + scale * values."""
    result = dict.fromkeys(HEIGHT_STATISTICS, math.nan)
    mean = float(values.mean())
    highest, lowest = float(values.max()), float(values.min())
    deviation = values.ravel() - mean
    squares = deviation * deviation  # higher powers as products: numpy takes ten times as long for values**3
    variance = float(squares.mean())
    result["mean_height"] = reference + scale * mean
    result["rms_height"] = scale * math.sqrt(variance)
    result["mean_absolute_height"] = scale * float(np.abs(deviation).mean())
    result["peak_height"] = scale * (highest - mean)
    result["valley_depth"] = scale * (mean - lowest)
    result["peak_to_valley"] = scale * (highest - lowest)
    if highest > lowest:
        result["skewness"] = float(squares @ deviation) / deviation.size / variance**1.5
        result["kurtosis"] = float(squares @ squares) / deviation.size / variance**2
    return result


def _neighbours(
    values: Array, steps: Sequence[float], periodic: Sequence[bool], ratio: float
) -> tuple[list[float], float, float]:
    """Return means over neighbours: squares of the slopes and of the Laplacian, and excess of area over plan.

    They are in scaled heights and steps; `ratio` is the unit of height over that of length.
    """
    plane, spacing = np.atleast_2d(values), (1.0, *steps)[-2:]
    wraps = [int(wrap) for wrap in (False, *periodic)[-2:]]
    onward = np.pad(plane, [(0, wrap) for wrap in wraps], mode="wrap")  # each point and the next
    slopes = [np.diff(onward, axis=axis) / step for axis, step in enumerate(spacing)]
    own = slopes[0][:, : plane.shape[1]], slopes[1][: plane.shape[0]]
    squares = [_observed_mean(slope**2) for slope in own[2 - values.ndim :]]
    around = np.pad(plane, [(wrap, wrap) for wrap in wraps], mode="wrap")
    bends = [np.diff(around, 2, axis=axis) / step**2 for axis, step in enumerate(spacing)]
    laplacian = bends[1] if values.ndim == 1 else bends[0][:, 1:-1] + bends[1][1:-1]
    laplacian_square = _observed_mean(laplacian**2)
    along, across = ((ratio * slope) ** 2 for slope in slopes)
    if values.ndim == 1:
        return squares, laplacian_square, _observed_mean(_excess(across))
    # of a cell, the mean over its corners, at each of which two of its edges meet
    corners = (_excess(x + y) for x in (across[:-1], across[1:]) for y in (along[:, :-1], along[:, 1:]))
    return squares, laplacian_square, _observed_mean(0.25 * sum(corners, np.zeros(1)))


def _observed_mean(values: Array) -> float:
    """Return the mean of the observed values; NaN without any."""
    observed = values[np.isfinite(values)]
    return float(observed.mean()) if observed.size else math.nan


def _excess(square: Array) -> Array:
    """Return sqrt(1 + square) - 1 without loss of digits for small slopes."""
    return np.asarray(square / (1.0 + np.sqrt(1.0 + square)))
