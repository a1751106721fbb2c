"""Loops over the cells of a mask: covers by boxes, gliding boxes, increments.

Masks are uint8 (0 or 1), shape (ny, nx). `wrap` says that an axis is periodic. All sums are integers, so that
no result depends on the order in which they are made.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def _add_row(columns: Array, row: Array, sign: np.int32) -> None:
    for j in range(row.size):
        columns[j] += sign * np.int32(row[j])


@kernel
def _occupied_before(columns: Array, prefix: Array, nx: int) -> None:
    """Number of columns that hold a cell, left of each position; goes round where prefix is longer."""
    total = np.int32(0)
    prefix[0] = 0
    for j in range(nx):
        total += np.int32(columns[j] > 0)
        prefix[j + 1] = total
    for j in range(nx + 1, prefix.size):
        prefix[j] = total + prefix[j - nx]


@kernel
def _part(
    prefix: Array, start: int, stop: int, near: int, near_stop: int, far: int, far_stop: int, size: int
) -> int:
    """Width that a box cut in x counts: its own if a box beside it is met, else a whole one; 0 if empty."""
    if prefix[stop] == prefix[start]:
        return 0
    if prefix[near_stop] > prefix[near] or prefix[far_stop] > prefix[far]:
        return stop - start
    return size


@kernel
def _height(beside: Array, start: int, stop: int, height: int, size: int) -> int:
    """Height that a box counts: its own if the box beside it in y is met, else a whole one."""
    return height if beside[stop] > beside[start] else size


@kernel
def _cut_columns(
    prefix: Array, beside: Array, height: int, size: int, nx: int, wrap: bool, count: Array, measure: Array
) -> None:
    """Add the boxes of one band of rows that are cut in x, for every offset in x."""
    for offset in range(size):
        if wrap:
            whole = nx // size
            start, stop = offset + whole * size, offset + nx
            if start == stop:
                continue
            near, far = (start - size, offset) if whole > 0 else (start, start)
            width = _part(prefix, start, stop, near, start, far, far + size if whole > 0 else far, size)
            if width > 0:
                count[offset] += 1
                measure[offset] += width * _height(beside, start, stop, height, size)
            continue
        stop = min(offset, nx)
        start = 0
        width = _part(prefix, start, stop, stop, min(stop + size, nx), stop, stop, size)
        if width > 0:
            count[offset] += 1
            measure[offset] += width * _height(beside, start, stop, height, size)
        start = offset + (nx - offset) // size * size
        if offset <= nx and start < nx:
            width = _part(prefix, start, nx, max(start - size, 0), start, start, start, size)
            if width > 0:
                count[offset] += 1
                measure[offset] += width * _height(beside, start, nx, height, size)


@kernel
def _cut_band(
    prefix: Array,
    beside: Array,
    height: int,
    size: int,
    nx: int,
    wrap: bool,
    positions: int,
    count: Array,
    measure: Array,
) -> None:
    """Add all boxes of a band of rows that is itself cut in y."""
    for j in range(positions):
        if prefix[j + size] > prefix[j]:
            count[j % size] += 1
            measure[j % size] += size * _height(beside, j, j + size, height, size)
    _cut_columns(prefix, beside, height, size, nx, wrap, count, measure)


@kernel
def _whole_bands(
    mask: Array,
    size: int,
    bands: int,
    wrap: bool,
    positions: int,
    prefix: Array,
    count: Array,
    measure: Array,
) -> None:
    """Add the boxes of all bands of rows that are not cut in y."""
    ny, nx = mask.shape
    columns = np.zeros(nx, np.int32)
    met = np.zeros((size, max(positions, 0)), np.int32)
    for k in range(size):
        _add_row(columns, mask[k % ny], np.int32(1))
    for i in range(bands):
        _occupied_before(columns, prefix, nx)
        row = met[i % size]
        for j in range(positions):
            row[j] += np.int32(prefix[j + size] > prefix[j])
        _cut_columns(prefix, prefix, size, size, nx, wrap, count[i % size], measure[i % size])
        if i + 1 < bands:
            _add_row(columns, mask[i % ny], np.int32(-1))
            _add_row(columns, mask[(i + size) % ny], np.int32(1))
    for oy in range(size):
        for j in range(positions):
            count[oy, j % size] += met[oy, j]
            measure[oy, j % size] += met[oy, j] * size * size


@kernel
def _band(mask: Array, start: int, stop: int, columns: Array) -> None:
    columns[:] = 0
    for k in range(start, stop):
        _add_row(columns, mask[k % mask.shape[0]], np.int32(1))


@kernel
def _cut_top(
    mask: Array,
    size: int,
    wrap_x: bool,
    positions: int,
    prefix: Array,
    beside: Array,
    count: Array,
    measure: Array,
) -> None:
    """Bands [0, cut), with the next one below beside them."""
    ny, nx = mask.shape
    columns, below = np.zeros(nx, np.int32), np.zeros(nx, np.int32)
    _band(mask, 0, min(size, ny), below)
    for offset in range(1, size):
        if offset <= ny:
            _add_row(columns, mask[offset - 1], np.int32(1))
            _add_row(below, mask[offset - 1], np.int32(-1))
            if offset - 1 + size < ny:
                _add_row(below, mask[offset - 1 + size], np.int32(1))
            _occupied_before(columns, prefix, nx)
            _occupied_before(below, beside, nx)
        cut = min(offset, ny)
        _cut_band(prefix, beside, cut, size, nx, wrap_x, positions, count[offset], measure[offset])


@kernel
def _cut_bottom(
    mask: Array,
    size: int,
    wrap_x: bool,
    positions: int,
    prefix: Array,
    beside: Array,
    count: Array,
    measure: Array,
) -> None:
    """Bands [start, ny), with the one above beside them."""
    ny, nx = mask.shape
    columns, above = np.zeros(nx, np.int32), np.zeros(nx, np.int32)
    _band(mask, max(ny - size, 0), ny, above)
    for cut in range(1, min(size - 1, ny) + 1):
        start = ny - cut
        _add_row(columns, mask[start], np.int32(1))
        _add_row(above, mask[start], np.int32(-1))
        if start - size >= 0:
            _add_row(above, mask[start - size], np.int32(1))
        _occupied_before(columns, prefix, nx)
        _occupied_before(above, beside, nx)
        offset = start % size
        _cut_band(prefix, beside, cut, size, nx, wrap_x, positions, count[offset], measure[offset])


@kernel
def _remainders(
    mask: Array,
    size: int,
    wrap_x: bool,
    positions: int,
    prefix: Array,
    beside: Array,
    count: Array,
    measure: Array,
) -> None:
    """Bands left over between the last and the first whole one of a periodic axis."""
    ny, nx = mask.shape
    whole = ny // size
    if whole * size == ny:
        return
    columns, others = np.zeros(nx, np.int32), np.zeros(nx, np.int32)
    for offset in range(size):
        start = offset + whole * size
        _band(mask, start, offset + ny, columns)
        others[:] = 0
        if whole > 0:
            for k in range(size):
                _add_row(others, mask[(start - size + k) % ny], np.int32(1))
                _add_row(others, mask[(offset + k) % ny], np.int32(1))
        _occupied_before(columns, prefix, nx)
        _occupied_before(others, beside, nx)
        height = ny - whole * size
        _cut_band(prefix, beside, height, size, nx, wrap_x, positions, count[offset], measure[offset])


@kernel
def cover(mask: Array, size: int, wrap_y: bool, wrap_x: bool) -> tuple[int, int, int, int]:
    """Boxes of one size that meet the set, on the grids of all offsets.

    Returns the number of boxes, smallest and summed over the offsets, and the same of their measure, in
    parts 1/size^2 of a box (see `counting.box_dimension`).
    """
    ny, nx = mask.shape
    count = np.zeros((size, size), np.int64)
    measure = np.zeros((size, size), np.int64)
    prefix = np.zeros(nx + 1 + (size if wrap_x else 0), np.int32)
    beside = np.zeros_like(prefix)
    positions = nx // size * size if wrap_x else nx - size + 1
    bands = ny // size * size if wrap_y else ny - size + 1
    if bands > 0:
        _whole_bands(mask, size, bands, wrap_x, positions, prefix, count, measure)
    if wrap_y:
        _remainders(mask, size, wrap_x, positions, prefix, beside, count, measure)
    else:
        _cut_top(mask, size, wrap_x, positions, prefix, beside, count, measure)
        _cut_bottom(mask, size, wrap_x, positions, prefix, beside, count, measure)
    return count.min(), count.sum(), measure.min(), measure.sum()
