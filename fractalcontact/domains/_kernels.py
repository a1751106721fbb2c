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
def _occupied_before(columns: Array, prefix: Array) -> None:
    """Number of columns that hold a cell, left of each position; goes round where prefix is longer."""
    nx = columns.size
    total = np.int32(0)
    prefix[0] = 0
    for j in range(nx):
        total += np.int32(columns[j] > 0)
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
    `columns` (2, nx) and `prefix` (2, at least nx + 1) are zeros to work in: of the band, and of the bands
    beside one that is cut in y.
    """
    positions = met.shape[1]
    last = last_stop = last_near = last_near_stop = 0
    for k in range(rows.shape[0]):
        start, stop, near, near_stop = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]
        far, far_stop, offset = rows[k, 4], rows[k, 5], rows[k, 6]
        _slide(mask, columns[0], last, last_stop, start, stop)
        _occupied_before(columns[0], prefix[0])
        last, last_stop = start, stop
        missing = size - (stop - start)
        here, beside = prefix[0], prefix[1]
        if missing == 0:
            for j in range(positions):
                met[offset, j] += np.int32(here[j + size] > here[j])
        else:
            _slide(mask, columns[1], last_near, last_near_stop, near, near_stop)
            last_near, last_near_stop = near, near_stop
            for i in range(far, far_stop):
                for j in range(mask.shape[1]):
                    columns[1, j] += mask[i % mask.shape[0], j]
            _occupied_before(columns[1], beside)
            for i in range(far, far_stop):
                for j in range(mask.shape[1]):
                    columns[1, j] -= mask[i % mask.shape[0], j]
            for j in range(positions):
                inside = here[j + size] > here[j]
                met[offset, j] += np.int32(inside)
                lost[offset, j] += np.int32(missing * (inside and beside[j + size] > beside[j]))
        for c in range(cut.shape[0]):
            left, right = cut[c, 0], cut[c, 1]
            if here[right] > here[left]:
                width, height = size, size
                if here[cut[c, 3]] > here[cut[c, 2]] or here[cut[c, 5]] > here[cut[c, 4]]:
                    width = right - left
                if missing > 0 and beside[right] > beside[left]:
                    height = stop - start
                count[offset, cut[c, 6]] += 1
                area[offset, cut[c, 6]] += width * height
