"""Filling gaps by least bending, arrays only."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fractalcontact.base.polynomial import shifted

Array = np.ndarray[Any, np.dtype[Any]]


def spans_plane(observed: Array) -> bool:
    """Tell whether the observed points fix a plane (two points a line, on a profile)."""
    index = np.argwhere(observed)
    if index.shape[0] <= observed.ndim:
        return False
    return int(np.linalg.matrix_rank((index - index[0])[1:].astype(np.float64))) == observed.ndim


def filled(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> Array:
    """Return heights, shape (ny, nx) or (nx,), with NaN replaced by the surface of least bending."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    from scipy.sparse.linalg import splu

    values, reference, scale = shifted(heights)
    values[missing] = 0.0
    rows = _bending(missing, spacing, periodic)
    unknown = rows[:, missing.ravel()].tocsc()
    # positive definite: no pivoting, which would only fill the factors
    factors = splu(
        (unknown.T @ unknown).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    for _ in range(2):  # the second pass takes out what rounding left in the first
        values[missing] -= factors.solve(unknown.T @ (rows @ values.ravel()))
    result = heights.copy()
    result[missing] = reference + scale * values[missing]
    return result


def _bending(missing: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> Any:
    """Return the second differences that see a missing point, one to a row of a sparse matrix."""
    from scipy.sparse import coo_array

    index = np.arange(missing.size).reshape(missing.shape)
    unit = math.ldexp(1.0, math.frexp(min(spacing))[1])
    steps = [step / unit for step in spacing]
    row_parts, column_parts, weight_parts, count = [], [], [], 0
    for offsets, weights in _stencils(steps):
        points = [_moved(index, offset, offsets, periodic) for offset in offsets]
        points = [part.ravel() for part in points]
        seen = np.any([missing.ravel()[part] for part in points], axis=0)
        number = int(np.count_nonzero(seen))
        for part, weight in zip(points, weights, strict=True):
            row_parts.append(count + np.arange(number))
            column_parts.append(part[seen])
            weight_parts.append(np.full(number, weight))
        count += number
    entries = (np.concatenate(weight_parts), (np.concatenate(row_parts), np.concatenate(column_parts)))
    return coo_array(entries, shape=(count, missing.size)).tocsr()


Stencil = tuple[tuple[tuple[int, ...], ...], tuple[float, ...]]


def _stencils(steps: Sequence[float]) -> Iterator[Stencil]:
    """Yield the offsets and weights of each second difference; the mixed one counts twice in the energy."""
    axes = len(steps)
    for axis, step in enumerate(steps):
        offsets = tuple(tuple(k if own == axis else 0 for own in range(axes)) for k in range(3))
        yield offsets, (1.0 / step**2, -2.0 / step**2, 1.0 / step**2)
    if axes == 2:
        weight = math.sqrt(2.0) / (steps[0] * steps[1])
        yield ((0, 0), (0, 1), (1, 0), (1, 1)), (weight, -weight, -weight, weight)


def _moved(
    index: Array, offset: tuple[int, ...], offsets: tuple[tuple[int, ...], ...], periodic: Sequence[bool]
) -> Array:
    """Return the numbers of the points at this offset from every place where the stencil fits."""
    for axis, wraps in enumerate(periodic):
        reach = max(own[axis] for own in offsets)
        if wraps:
            index = np.roll(index, -offset[axis], axis=axis)
        else:
            stop = index.shape[axis] - reach
            index = np.take(index, np.arange(offset[axis], offset[axis] + max(stop, 0)), axis=axis)
    return index
