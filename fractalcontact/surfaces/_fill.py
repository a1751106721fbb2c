"""Filling of small gaps by least bending energy."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import drop_unknown_coords
from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.polynomial import shifted
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._height_planes import check_planes, height_planes

Array = np.ndarray[Any, np.dtype[Any]]
BRIGGS = "Briggs, Machine contouring using minimum curvature, Geophysics 39 (1974) 39-48"


def _check(problems: Problems, *, surface: Any, at_most: Any) -> None:
    valid = check_planes(problems, surface)
    if not (problems.number("at_most", at_most, at_least=0, at_most=1) and valid):
        return
    observed = ~np.isnan(height_planes(surface))
    size = observed[0].size
    most = max(size - int(np.count_nonzero(plane)) for plane in observed)
    expected = f"at most {100 * float(at_most):g} % missing points (see `at_most`)"
    if problems.require(most <= at_most * size, "surface", expected, f"{most} of {size} NaN"):
        spans = all(_spans_plane(plane) for plane in observed if not plane.all())
        problems.require(spans, "surface", "observed points that span a plane", "too few of them")


@public_result(
    title="Surface with gaps filled",
    references=BRIGGS,
    achieved_error="unknown: nothing was measured at the filled points",
    check=_check,
    memory=104.0,
)
def fill(surface: xr.DataArray, *, at_most: float = 0.25) -> xr.DataArray:  # noqa: ARG001 (used by _check)
    """Fill small gaps (NaN) with the smoothest surface through the points around them.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x).
    at_most : float
        Largest accepted fraction of missing points. Filled heights were not measured: with more than a few,
        crop the surface, or use a method that allows gaps. `dimensions.estimate` counts them as missing.

    Returns
    -------
    DataArray
        `height` without NaN; the coordinate `filled_points` counts the filled points (along the leading
        dims, if there are any).

    Raises
    ------
    InvalidInput
        More points are missing than `at_most`, or the observed ones do not span a plane.

    Notes
    -----
    The filled points minimise the bending energy of a thin plate, the sum of the squares of the second
    differences in x, y and xy, each over its spacings; observed points do not change. A plane is continued
    exactly, and a periodic axis across its edge. Time and memory grow with the largest gap: about 2 s for
    one of 300 x 300 points, 10 s and 1.5 GiB for 600 x 600.

    References
    ----------
    Briggs (1974), Machine contouring using minimum curvature, Geophysics 39, 39-48.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> heights = 1e-3 * np.add.outer(np.arange(6.0), np.arange(8.0))
    >>> heights[2:4, 3] = np.nan
    >>> filled = fc.surfaces.fill(fc.surfaces.from_array(heights, 1e-3))
    >>> int(filled.filled_points), round(float(filled[2, 3]), 9)
    (2, 0.005)
    """
    grid = read_grid(surface, core_dims(surface))
    planes = height_planes(surface)
    filled = np.stack([_filled(plane, grid.spacing, grid.periodic) for plane in planes])
    leading = surface.dims[: surface.ndim - len(grid.shape)]
    missing = np.count_nonzero(np.isnan(planes), axis=tuple(range(1, planes.ndim))).astype(np.int64)
    missing = missing.reshape(surface.shape[: len(leading)])
    result = drop_unknown_coords(surface.copy(data=filled.reshape(surface.shape)).rename("height"))
    result = result.assign_coords(filled_points=(leading, missing))
    result.attrs = {"filled_points": missing}
    return result


def _spans_plane(observed: Array) -> bool:
    """Return whether the observed points determine a plane (for a profile, a line)."""
    index = np.argwhere(observed)
    if index.shape[0] <= observed.ndim:
        return False
    return int(np.linalg.matrix_rank((index - index[0])[1:].astype(np.float64))) == observed.ndim


def _filled(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> Array:
    """Return heights, shape (ny, nx) or (nx,), with NaN replaced by the minimum of the bending energy."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    from scipy.sparse.linalg import splu  # loads slowly, and few surfaces have gaps

    values, reference, scale = shifted(heights)
    values[missing] = 0.0
    rows = _bending(missing, spacing, periodic)
    unknown = rows[:, missing.ravel()].tocsc()
    # positive definite: pivoting is not needed and would add fill-in to the factors
    factors = splu(
        (unknown.T @ unknown).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    for _ in range(2):  # the second pass removes the rounding error of the first
        values[missing] -= factors.solve(unknown.T @ (rows @ values.ravel()))
    result = heights.copy()
    result[missing] = reference + scale * values[missing]
    return result


def _bending(missing: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> Any:
    """Return the second differences that involve a missing point, one in each row of a sparse matrix."""
    from scipy.sparse import coo_array

    index = np.arange(missing.size).reshape(missing.shape)
    unit = math.ldexp(1.0, math.frexp(min(spacing))[1])
    steps = [step / unit for step in spacing]
    row_parts, column_parts, weight_parts, count = [], [], [], 0
    for offsets, weights in _stencils(steps):
        points = [_offset_index(index, offset, offsets, periodic) for offset in offsets]
        points = [part.ravel() for part in points]
        involved = np.any([missing.ravel()[part] for part in points], axis=0)
        number = int(np.count_nonzero(involved))
        for part, weight in zip(points, weights, strict=True):
            row_parts.append(count + np.arange(number))
            column_parts.append(part[involved])
            weight_parts.append(np.full(number, weight))
        count += number
    entries = (np.concatenate(weight_parts), (np.concatenate(row_parts), np.concatenate(column_parts)))
    return coo_array(entries, shape=(count, missing.size)).tocsr()


Stencil = tuple[tuple[tuple[int, ...], ...], tuple[float, ...]]


def _stencils(steps: Sequence[float]) -> Iterator[Stencil]:
    """Yield offsets and weights of the second differences; the mixed one counts twice in the energy."""
    axes = len(steps)
    for axis, step in enumerate(steps):
        offsets = tuple(tuple(k if own == axis else 0 for own in range(axes)) for k in range(3))
        yield offsets, (1.0 / step**2, -2.0 / step**2, 1.0 / step**2)
    if axes == 2:
        weight = math.sqrt(2.0) / (steps[0] * steps[1])
        yield ((0, 0), (0, 1), (1, 0), (1, 1)), (weight, -weight, -weight, weight)


def _offset_index(
    index: Array, offset: tuple[int, ...], offsets: tuple[tuple[int, ...], ...], periodic: Sequence[bool]
) -> Array:
    """Return the indices of the points at this offset from every position where the stencil fits."""
    for axis, wraps in enumerate(periodic):
        reach = max(own[axis] for own in offsets)
        if wraps:
            index = np.roll(index, -offset[axis], axis=axis)
        else:
            stop = index.shape[axis] - reach
            index = np.take(index, np.arange(offset[axis], offset[axis] + max(stop, 0)), axis=axis)
    return index
