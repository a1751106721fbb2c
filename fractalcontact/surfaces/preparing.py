"""What is done to measured heights before anything else: levelling, and filling small gaps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import polynomial, provenance, schema
from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import familiar
from fractalcontact.base.grid import check_surface
from fractalcontact.surfaces import _gaps

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]
SHAPES = ("mean", "plane", "quadric")


@provenance.accounted("rounding")
def level(surface: xr.DataArray, order: int = 1) -> xr.DataArray:
    """Remove the mean, the mean plane or the mean quadric.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). Missing points (NaN) are left out of the fit and
        stay missing.
    order : {0, 1, 2}
        Total degree of the least-squares polynomial that is removed: mean, plane, quadric.

    Returns
    -------
    DataArray
        `height` like the input, each plane levelled for itself. A levelled surface (order 1 or 2) no longer
        fits its own other side, so its axes are free.

    Raises
    ------
    InvalidInput
        The observed points do not fix the polynomial: none, too few, or all on one line.

    Notes
    -----
    The fit uses orthogonal polynomials of the index, scaled heights and a second pass, so that an offset
    of 1e9 in heights or coordinates loses no more digits than the numbers themselves have lost.
    """
    with Problems("fractalcontact.surfaces.level") as problems:
        grid = check_surface(surface, problems, finite=False, smallest=2, leading=True, profile=True)
        degree = problems.integer("order", order, at_least=0, at_most=2)
        if not problems.found:
            planes = _planes(problems, surface, len(grid.shape))
            parts = [
                polynomial.detrended(plane, degree) if _any(plane) else (plane, False) for plane in planes
            ]
            lost = sum(not fixed for _, fixed in parts)
            where = "" if len(parts) == 1 else f" ({lost} of {len(parts)} planes)"
            problems.require(
                lost == 0,
                "surface",
                f"observed points that fix a {SHAPES[degree]}",
                f"too few of them{where}",
            )
    levelled = surface.copy(data=np.stack([plane for plane, _ in parts]).reshape(surface.shape))
    if degree > 0:
        _set_free(levelled)
    return _finished(levelled, surface, "level", {"order": degree}, "Levelled surface")


@provenance.accounted("not known: nothing was measured at filled points")
def fill(surface: xr.DataArray, *, at_most: float = 0.25) -> xr.DataArray:
    """Fill small gaps (NaN) with the smoothest surface through what is around them.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x).
    at_most : float
        Largest fraction of missing points that is accepted. What is filled was not measured: beyond a
        small part, crop the surface or use a method that bears gaps. Time and memory grow with the
        largest gap: about 2 s for one of 300 x 300 points, 10 s and 1.5 GiB for 600 x 600.

    Returns
    -------
    DataArray
        `height` without NaN; the scalar coordinate `filled_points` tells how many points were filled
        (along the leading dims, if there are any).

    Raises
    ------
    InvalidInput
        More points are missing than `at_most`, or those that are there do not span a plane.

    Notes
    -----
    The filled points minimise the bending energy of a thin plate, the sum of the squares of the second
    differences in x, y and xy, each over its spacings; observed points are kept. A plane is continued
    without any error, the unit of height or length does not matter, and a periodic axis is continued
    across its edge.

    References
    ----------
    Briggs (1974), Machine contouring using minimum curvature, Geophysics 39, 39-48.
    """
    with Problems("fractalcontact.surfaces.fill") as problems:
        grid = check_surface(surface, problems, finite=False, smallest=2, leading=True, profile=True)
        share = problems.number("at_most", at_most, at_least=0, at_most=1)
        if not problems.found:
            planes = _planes(problems, surface, len(grid.shape))
            missing = np.count_nonzero(np.isnan(planes), axis=tuple(range(1, planes.ndim)))
            most = int(missing.max())
            size = planes[0].size
            if problems.require(
                most <= share * size,
                "surface",
                f"at most {100 * share:g} % missing points (see `at_most`)",
                f"{most} of {size} NaN",
            ):
                spans = all(_gaps.spans_plane(~np.isnan(plane)) for plane in planes[missing > 0])
                problems.require(spans, "surface", "observed points that span a plane", "too few of them")
    filled = np.stack([_gaps.filled(plane, grid.spacing, grid.periodic) for plane in planes])
    result = surface.copy(data=filled.reshape(surface.shape))
    leading = surface.dims[: surface.ndim - len(grid.shape)]
    counts = missing.astype(np.int64).reshape(surface.shape[: len(leading)])
    result = result.assign_coords(filled_points=(leading, counts))
    return _finished(
        result, surface, "fill", {"at_most": share}, "Surface with gaps filled", filled_points=counts
    )


def _planes(problems: Problems, surface: xr.DataArray, axes: int) -> Array:
    """Return the heights as float64 with shape (planes, ...); infinite heights are a problem."""
    values = np.array(surface.values, dtype=np.float64)
    infinite = int(np.count_nonzero(np.isinf(values)))
    problems.require(infinite == 0, "surface", "finite heights, or NaN where missing", f"{infinite} infinite")
    return values.reshape(-1, *values.shape[values.ndim - axes :])


def _any(plane: Array) -> bool:
    return bool(np.isfinite(plane).any())


def _set_free(surface: xr.DataArray) -> None:
    for dim in ("y", "x"):
        if dim in surface.coords:
            surface.coords[dim].attrs.pop("period", None)


def _finished(
    result: xr.DataArray,
    surface: xr.DataArray,
    call: str,
    parameters: dict[str, Any],
    title: str,
    **facts: Any,
) -> xr.DataArray:
    """Return the result with its labels and where it comes from."""
    result = schema.label(familiar(result.rename("height")))
    parameters = {"surface": surface, **parameters}
    return provenance.stamp(result, f"fractalcontact.surfaces.{call}", parameters, title=title, **facts)
