"""Surfaces in numbers."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base import provenance, schema
from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import check_leading, leading_coords
from fractalcontact.base.grid import check_surface
from fractalcontact.surfaces import _moments

if TYPE_CHECKING:
    import xarray as xr

NAYAK = "Nayak, Random process model of rough surfaces, Journal of Lubrication Technology 93 (1971) 398-407"


def describe(surface: xr.DataArray) -> xr.Dataset:
    """Return heights, slopes and curvature of a surface in numbers.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x), as they are: level them first if need be. Missing
        points (NaN) are left out, and so are the differences that would need them.

    Returns
    -------
    Dataset
        Over the leading dims, if there are any:

        - mean_height (m), and about it rms_height (Sq), mean_absolute_height (Sa), peak_height (Sp),
          valley_depth (Sv), peak_to_valley (Sz); skewness (Ssk), kurtosis (Sku, 3 if Gaussian)
        - rms_slope (Sdq: of the gradient, both components), rms_slope_x, rms_slope_y
        - mean_slope_x, mean_slope_y of the least-squares plane
        - rms_curvature (m-1) of the mean curvature, half the Laplacian (of z'' for a profile)
        - nayak_parameter, m0 m4 / m2^2 of the profiles of an isotropic surface
        - developed_area_ratio, area over area of the plane (length over length for a profile), and
          developed_area_excess (Sdr), the same less one, which keeps its digits where slopes are small
        - missing_points, run_time

        A statistic that does not exist is NaN and says why in its attribute `reason`.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or infinite heights.

    Notes
    -----
    A surface that is periodic and complete is differentiated by its Fourier modes: its slopes are the sums
    of q^2 C. Any other uses differences of neighbouring points, which see a little less of the shortest
    wavelengths. The developed area is always that of triangles between neighbours. The symbols in brackets
    are those of ISO 25178-2 (Rq, Ra ... for a profile), which levels and filters before: here that is left to
    `level`.

    References
    ----------
    ISO 25178-2 (2021), Surface texture: areal, terms, definitions and surface texture parameters.
    Nayak (1971), Random process model of rough surfaces, Journal of Lubrication Technology 93, 398-407.
    """
    import xarray as xr

    with Problems("fractalcontact.surfaces.describe") as problems:
        grid = check_surface(surface, problems, finite=False, leading=True, profile=True)
        taken = (*_moments.names(len(grid.shape)), "run_time")
        check_leading(surface, taken, problems)
        if not problems.found:
            infinite = int(np.count_nonzero(np.isinf(surface.values)))
            problems.require(
                infinite == 0, "surface", "finite heights, or NaN where missing", f"{infinite} infinite"
            )
    start = time.perf_counter()
    axes = len(grid.shape)
    leading = surface.dims[: surface.ndim - axes]
    planes = np.asarray(surface.values, dtype=np.float64).reshape(-1, *grid.shape)
    found = [_moments.statistics(plane, grid.spacing, grid.periodic) for plane in planes]
    elapsed = time.perf_counter() - start
    lengths = surface.shape[: len(leading)]
    values = {name: np.array([one[name] for one in found]).reshape(lengths) for name in found[0]}
    values["missing_points"] = values["missing_points"].astype(np.int64)
    result = xr.Dataset(
        {name: (leading, value) for name, value in values.items()} | {"run_time": elapsed},
        coords=leading_coords(surface, leading, taken),
    )
    result = schema.label(result)
    _explain(result, planes)
    method = "modes" if all(grid.periodic) and not np.isnan(planes).any() else "differences"
    return provenance.stamp(
        result,
        "fractalcontact.surfaces.describe",
        {"surface": surface},
        title="Statistics of a surface",
        references=NAYAK,
        derivatives=method,
        achieved_error="rounding, of the points as they are",
        run_time=elapsed,
    )


def _explain(result: xr.Dataset, planes: np.ndarray) -> None:
    """Say of every statistic that is NaN why it is."""
    empty = bool(np.isnan(planes).all(axis=tuple(range(1, planes.ndim))).any())
    flat = bool((result["peak_to_valley"] == 0).any())
    for name in ("skewness", "kurtosis", "nayak_parameter"):
        if flat:
            result[name].attrs["reason"] = "all heights of a surface are equal"
    for variable in result.data_vars.values():
        if "reason" not in variable.attrs and bool(np.isnan(variable).any()):
            reason = "no point was observed" if empty else "too few neighbouring points were observed"
            variable.attrs["reason"] = reason
