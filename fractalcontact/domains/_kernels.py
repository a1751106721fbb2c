"""Loops over bands of rows of a mask: the boxes of one size that meet a set, for every offset of the grid.

Masks are uint8 (0 or 1), shape (ny, nx). All sums are integers, so that no result depends on the order in
which they are made. Bands along both axes are listed by `_covers.bands`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def _slide(mask: Array, columns: Array, start: int, stop: int, new_start: int, new_stop: int) -> None:
    """Change the number of cells in each column from rows [start, stop) to rows [new_start, new_stop)."""
    ny, nx = mask.shape
    if new_start < start or new_start >= stop or new_stop < stop:
        for j in range(nx):
            columns[j] = 0
        start = stop = new_start
    for i in range(start, new_start):
        row = mask[i % ny]
        for j in range(nx):
            columns[j] -= row[j]
    for i in range(stop, new_stop):
        row = mask[i % ny]
        for j in range(nx):
            columns[j] += row[j]


@kernel
def _occupied_before(columns: Array, less: Array, prefix: Array) -> None:
    """Number of columns that hold more cells than `less`, left of each position; goes round where longer."""
    nx = columns.size
    total = np.int32(0)
    prefix[0] = 0
    for j in range(nx):
        total += np.int32(columns[j] > less[j])
        prefix[j + 1] = total
    for j in range(nx + 1, prefix.size):
        prefix[j] = total + prefix[j - nx]


@kernel
def cover(
    mask: Array,
    size: int,
    rows: Array,
    cut: Array,
    columns: Array,
    prefix: Array,
    met: Array,
    lost: Array,
    count: Array,
    area: Array,
) -> None:
    """Add the boxes that meet the set in all bands of rows.

    `rows` lists the bands of rows, `cut` those of columns that are cut by the edge. `met` and `lost` (size,
    positions) get for each whole band of columns the boxes met, and the rows that those of them lose that
    count by their part inside; `count` and `area` (size, size) the boxes cut in x and their area in cells.
    `columns` (3, nx) and `prefix` (2, at least nx + 1) are zeros to work in: of the band, of a band that is
    cut in y with those beside it, and nothing.
    """
    positions = met.shape[1]
    none: Any = np.int64(0)  # a literal would have `_slide` compiled twice
    last = last_stop = last_wide = last_wide_stop = none
    here, beside = prefix[0], prefix[1]
    for k in range(rows.shape[0]):
        start, stop, wide, wide_stop, offset = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4]
        _slide(mask, columns[0], last, last_stop, start, stop)
        _occupied_before(columns[0], columns[2], here)
        last, last_stop = start, stop
        missing = size - (stop - start)
        if missing > 0:
            _slide(mask, columns[1], last_wide, last_wide_stop, wide, wide_stop)
            _occupied_before(columns[1], columns[0], beside)
            last_wide, last_wide_stop = wide, wide_stop
            for j in range(positions):
                inside = here[j + size] > here[j] and beside[j + size] > beside[j]
                lost[offset, j] += np.int32(missing * inside)
        for j in range(positions):
            met[offset, j] += np.int32(here[j + size] > here[j])
        for c in range(cut.shape[0]):
            left, right, column = cut[c, 0], cut[c, 1], cut[c, 4]
            inside = here[right] - here[left]
            if inside > 0:
                width, height = size, size
                if here[cut[c, 3]] - here[cut[c, 2]] > inside:
                    width = right - left
                if missing > 0 and beside[right] > beside[left]:
                    height = stop - start
                count[offset, column] += 1
                area[offset, column] += width * height
