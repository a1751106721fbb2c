"""Defects of a scan: removal of spikes, single heights far from those around them, and filling of small gaps.

Gaps are filled by least bending energy, within the heights around each of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.base.regression import detrended, shifted
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.surfaces._from_array import check_stack, height_stack, with_heights

ROUSSEEUW = "Rousseeuw and Croux, Journal of the American Statistical Association 88 (1993) 1273-1283"
BRIGGS = "Briggs, Machine contouring using minimum curvature, Geophysics 39 (1974) 39-48"


def _check_size(problems: Problems) -> None:
    given = problems.given
    problems.number("threshold", above=0)
    largest = None
    if check_stack(problems, smallest=3, is_one=True):
        largest = min(given.surface.shape)
        problems.require(bool(np.isfinite(given.surface.values).any()), "surface", "heights", NONE)
    if problems.integer("size", at_least=3, at_most=largest):
        problems.require(given.size % 2 == 1, "size", "an odd number of cells")


@public_result(
    title="Surface without spikes",
    references=ROUSSEEUW,
    achieved_error="exact: the heights that remain are unchanged",
    check=_check_size,
    memory=34.0,
)
def despike(surface: xr.DataArray, *, threshold: float = 6.0, size: int = 5) -> xr.DataArray:
    """Remove isolated outliers from a scan.

    Dust, reflections and undercut edges leave single wrong heights in optical scans. Closure and friction
    depend on the highest points, so a few outliers change them. A spike becomes a missing height
    (NaN), to be filled (`fill`) or left out.

    Parameters
    ----------
    surface : DataArray, dims (y, x) or (x,)
        Heights in metres; missing ones (NaN) stay missing.
    threshold : float
        Largest distance of a height from the median around it, in robust standard deviations of that
        distance over the whole surface (0.608 times its 90 % quantile). A sharp edge of a rough surface may
        exceed it too: look at the removed points, and test whether the results depend on them.
    size : int
        Odd edge, in cells, of the square whose median is taken, of a profile the interval; 3 or more. It
        removes spikes up to half as wide; the ends of a profile stay.

    Returns
    -------
    DataArray
        `height` with NaN in place of the spikes; the scalar coordinate `removed_points` counts them. The
        provenance has the robust standard deviation (m).

    Raises
    ------
    InvalidInput
        The surface is no single plane or profile of heights, or an argument is wrong.

    References
    ----------
    Rousseeuw and Croux (1993), Journal of the American Statistical Association 88, 1273-1283.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
    >>> surface[20, 30] += 1e-3
    >>> clean = fc.surfaces.despike(surface)
    >>> int(clean.removed_points), bool(clean[20, 30].isnull())
    (1, True)
    """
    heights = np.atleast_2d(np.asarray(surface.values, dtype=np.float64))
    is_spike, deviation = _spikes(heights, int(size), float(threshold))
    count = int(is_spike.sum())
    result = with_heights(surface, np.where(is_spike, np.nan, heights)).assign_coords(removed_points=count)
    result.attrs = {"removed_points": count, "robust_standard_deviation": deviation}
    return result


def _spikes(heights: Array, size: int, threshold: float) -> tuple[Array, float]:
    """Return the mask of the spikes and the robust standard deviation of the residual.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where missing.
    size : int
        Odd edge of the square, in cells, whose median a point is compared with.
    threshold : float
        In robust standard deviations.

    Notes
    -----
    Flagged points have the median around them in the next pass, so that a spike of several points is removed
    from its edge inwards. Without any height there the medians beside them were one-sided, and the tilt of a
    smooth surface made two thirds of it spikes. The scale of the residual is that of the first pass.
    """
    # without this a slope would flag the points beside a missing one
    heights = detrended(heights, 1)[0]
    flagged = np.zeros(heights.shape, dtype=bool)
    medians = _medians(heights, size)
    # of a Gaussian, from a quantile; the median called a third of a coin and of heights of a few steps spikes
    deviation = 0.6080 * float(np.nanquantile(np.abs(heights - medians), 0.9))
    while deviation > 0 and (new := (np.abs(heights - medians) > threshold * deviation) & ~flagged).any():
        flagged |= new
        medians = _medians(np.where(flagged, medians, heights), size)
    return flagged, deviation


def _medians(heights: Array, size: int) -> Array:
    """Return the median of the square about every point; the edge is padded by odd reflection."""
    half = size // 2
    padded = np.pad(heights, half, mode="reflect", reflect_type="odd")
    medians = np.empty(heights.shape)
    for i in range(heights.shape[0]):  # row by row, to bound the memory
        band = np.lib.stride_tricks.sliding_window_view(padded[i : i + size], size, axis=1)
        medians[i] = _row_medians(np.moveaxis(band, 0, 1).reshape(heights.shape[1], -1))
    return medians


def _row_medians(values: Array) -> Array:
    """Return the median of every row without its NaN; NaN for a row of NaN."""
    ordered = np.sort(values, axis=1)  # NaN last
    count = np.count_nonzero(np.isfinite(ordered), axis=1)
    rows, last = np.arange(len(ordered)), np.maximum(count - 1, 0)
    middle = 0.5 * (ordered[rows, last // 2] + ordered[rows, (last + 1) // 2])
    return np.where(count > 0, middle, np.nan)


def _check_gaps(problems: Problems) -> None:
    given = problems.given
    valid = check_stack(problems)
    if not (problems.number("at_most", at_least=0, at_most=1) and valid):
        return
    observed = ~np.isnan(height_stack(given.surface))
    size = observed[0].size
    most = max(size - int(np.count_nonzero(each)) for each in observed)
    expected = f"at most {100 * float(given.at_most):g} % missing points (see `at_most`)"
    if problems.require(most <= given.at_most * size, "surface", expected, f"{most} of {size} NaN"):
        spans = all(_spans_plane(each) for each in observed if not each.all())
        problems.require(spans, "surface", "observed points that span a plane", "too few of them")


@public_result(
    title="Surface with gaps filled",
    references=BRIGGS,
    achieved_error="unknown: nothing was measured at the filled points",
    check=_check_gaps,
    memory=104.0,
)
def fill(surface: xr.DataArray, *, at_most: float = 0.25) -> xr.DataArray:  # noqa: ARG001 (used by _check_gaps)
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
    differences in x, y and xy, each over its spacings; observed points do not change. A plate can rise above
    all heights around a gap, or sink below them: such a gap is filled by a stretched membrane (least sum of
    the squares of the slopes), which cannot. So no filled height exceeds the observed ones beside its gap. A
    plane is continued exactly, except at an edge towards which it rises or falls, and a periodic axis across
    its edge. Time and memory grow with the largest gap: about 2 s for one of 300 x 300 points, 10 s and 1.5
    GiB for 600 x 600.

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
    stack = height_stack(surface)
    filled = np.stack([_filled(heights, grid.spacing, grid.periodic) for heights in stack])
    leading = surface.dims[: surface.ndim - len(grid.shape)]
    missing = np.count_nonzero(np.isnan(stack), axis=tuple(range(1, stack.ndim))).astype(np.int64)
    missing = missing.reshape(surface.shape[: len(leading)])
    result = with_heights(surface, filled).assign_coords(filled_points=(leading, missing))
    result.attrs = {"filled_points": missing}
    return result


def _spans_plane(observed: Array) -> bool:
    """Return whether the observed points determine a plane (for a profile, a line)."""
    index = np.argwhere(observed)
    if index.shape[0] <= observed.ndim:
        return False
    return int(np.linalg.matrix_rank((index - index[0])[1:].astype(np.float64))) == observed.ndim


def _filled(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> Array:
    """Return heights, shape (ny, nx) or (nx,), with NaN replaced by plates, or by membranes."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    values, reference, scale = shifted(heights)
    gaps = _gaps(missing, periodic)
    low, high = _rims(values, gaps, periodic)
    unit = power_of_two(min(spacing))
    steps = [step / unit for step in spacing]
    plates = missing.copy()
    while plates.any():
        values = _least_energy(values, plates, list(_second_differences(steps)), periodic)
        outside = plates & ((values < low) | (values > high))
        membranes = plates & np.isin(gaps, gaps[outside])
        if not membranes.any():
            break
        # the plates beside a new membrane move with it, so all are solved again
        plates &= ~membranes
        values = _least_energy(values, membranes, list(_first_differences(steps)), periodic)
    result = heights.copy()
    # a membrane exceeds its rim by rounding at most
    result[missing] = reference + scale * np.clip(values, low, high)[missing]
    return result


def _gaps(missing: Array, periodic: Sequence[bool]) -> Array:
    """Return the number of the gap at each missing point, 0 elsewhere; diagonal neighbours are of one gap."""
    from scipy.ndimage import label
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    wrapped = np.pad(missing, [(1, 1) if wraps else (0, 0) for wraps in periodic], mode="wrap")
    numbers, count = label(wrapped, np.ones((3,) * missing.ndim))
    inner = numbers[tuple(slice(1, -1) if wraps else slice(None) for wraps in periodic)]
    # a point of the border and the point that it repeats belong to one gap
    repeated = np.pad(inner, [(1, 1) if wraps else (0, 0) for wraps in periodic], mode="wrap")
    pairs = np.unique(np.stack([numbers[wrapped], repeated[wrapped]]), axis=1)
    graph = coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(count + 1, count + 1))
    return np.asarray(np.where(missing, connected_components(graph, directed=False)[1][inner] + 1, 0))


def _rims(values: Array, gaps: Array, periodic: Sequence[bool]) -> tuple[Array, Array]:
    """Return the lowest and the highest observed height beside the gap of each missing point."""
    from scipy import ndimage

    modes = ["wrap" if wraps else "nearest" for wraps in periodic]
    numbers = np.arange(gaps.max() + 1)
    observed = gaps == 0
    low = ndimage.minimum_filter(np.where(observed, values, np.inf), 3, mode=modes)
    high = ndimage.maximum_filter(np.where(observed, values, -np.inf), 3, mode=modes)
    return (
        np.asarray(ndimage.minimum(low, gaps, numbers))[gaps],
        np.asarray(ndimage.maximum(high, gaps, numbers))[gaps],
    )


Stencil = tuple[Array, tuple[float, ...]]  # offsets (points, axes) and weights of a difference


def _least_energy(
    values: Array, unknown: Array, differences: Sequence[Stencil], periodic: Sequence[bool]
) -> Array:
    """Return values whose unknown points minimise the sum of the squared differences."""
    from scipy.sparse.linalg import splu  # loads slowly, and few surfaces have gaps

    values = np.where(unknown, 0.0, values)
    rows = _difference_matrix(unknown, differences, periodic)
    columns = rows[:, unknown.ravel()].tocsc()
    # positive definite: pivoting is not needed and would add fill-in to the factors
    factors = splu(
        (columns.T @ columns).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    for _ in range(2):  # the second pass removes the rounding error of the first
        values[unknown] -= factors.solve(columns.T @ (rows @ values.ravel()))
    return values


def _difference_matrix(unknown: Array, differences: Sequence[Stencil], periodic: Sequence[bool]) -> Any:
    """Return the differences that involve an unknown point, one in each row of a sparse matrix."""
    from scipy.sparse import coo_array, vstack

    axes, blocks = tuple(range(unknown.ndim)), []
    for offsets, weights in differences:
        involved = np.any([np.roll(unknown, -offset, axes) for offset in offsets], axis=0)
        for axis, (wraps, reach) in enumerate(zip(periodic, offsets.max(axis=0), strict=True)):
            if not wraps and reach:
                np.moveaxis(involved, axis, 0)[-reach:] = False
        places = np.moveaxis(np.argwhere(involved)[:, None] + offsets, -1, 0)
        columns = np.ravel_multi_index(tuple(places), unknown.shape, mode="wrap")
        rows = np.repeat(np.arange(len(columns)), len(offsets))
        entries = np.tile(weights, len(columns)), (rows, columns.ravel())
        blocks.append(coo_array(entries, shape=(len(columns), unknown.size)))
    return vstack(blocks).tocsr()


def _first_differences(steps: Sequence[float]) -> Iterator[Stencil]:
    """Yield the slope along each axis: their squares are the energy of a membrane."""
    for axis, step in zip(np.eye(len(steps), dtype=int), steps, strict=True):
        yield np.outer(range(2), axis), (-1.0 / step, 1.0 / step)


def _second_differences(steps: Sequence[float]) -> Iterator[Stencil]:
    """Yield the second differences: their squares are the energy of a plate, the mixed one counted twice."""
    for axis, step in zip(np.eye(len(steps), dtype=int), steps, strict=True):
        yield np.outer(range(3), axis), (1.0 / step**2, -2.0 / step**2, 1.0 / step**2)
    if len(steps) == 2:
        weight = math.sqrt(2.0) / (steps[0] * steps[1])
        yield np.array([(0, 0), (0, 1), (1, 0), (1, 1)]), (weight, -weight, -weight, weight)
