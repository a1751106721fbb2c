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
def cover(
    mask: Array,
    size: int,
    rows: Array,
    cut: Array,
    held: Array,
    columns: Array,
    prefix: Array,
    met: Array,
    lost: Array,
    count: Array,
    area: Array,
) -> None:
    """Add the boxes that meet the set in all bands of rows.

    `rows` lists the bands of rows by their start, then by their stop, `cut` the bands of columns that are
    cut by the edge. `met` and `lost` (size, positions) get for each whole band of columns the boxes met, and
    the rows that those of them lose that count by their part inside; `count` and `area` (size, size) the
    boxes cut in x and their area in cells.

    The others are zeros to work in, for the band and, where it is cut in y, for it with those beside it:
    `held` (2, 2) the rows summed up, `columns` (3, nx) the cells of the set in each column (and, last,
    none), `prefix` (2, at least nx + 1) how many columns left of each position hold any, or hold more than
    in the band; it goes round where longer.
    """
    ny, nx = mask.shape
    ahead = np.uint32(size)  # unsigned: no test for negatives
    for k in range(rows.shape[0]):
        first, end, offset = rows[k, 0], rows[k, 1], rows[k, 4]
        missing = size - (end - first)
        for w in range(2 if missing > 0 else 1):
            start, stop = rows[k, 2 * w], rows[k, 2 * w + 1]
            if stop < held[w, 1]:  # periodic: the remainder ends before the last whole band
                held[w, 0] = held[w, 1] = start
                for j in range(nx):
                    columns[w, j] = 0
            for i in range(held[w, 0], start):
                for j in range(nx):
                    columns[w, j] -= mask[i % ny, j]
            for i in range(held[w, 1], stop):
                for j in range(nx):
                    columns[w, j] += mask[i % ny, j]
            held[w, 0], held[w, 1] = start, stop
            total = 0
            for j in range(nx):
                total += columns[w, j] > columns[2 - 2 * w, j]
                prefix[w, j + 1] = total
            for j in range(nx + 1, prefix.shape[1]):
                prefix[w, j] = total + prefix[w, j - nx]
        if missing > 0:
            for j in range(met.shape[1]):
                inside = prefix[0, j + ahead] > prefix[0, j] and prefix[1, j + ahead] > prefix[1, j]
                lost[offset, j] += missing * inside
        for j in range(met.shape[1]):
            met[offset, j] += prefix[0, j + ahead] > prefix[0, j]
        for c in range(cut.shape[0]):
            left, right, column = cut[c, 0], cut[c, 1], cut[c, 4]
            here = prefix[0, right] - prefix[0, left]
            if here > 0:
                alone = prefix[0, cut[c, 3]] - prefix[0, cut[c, 2]] == here
                above = missing == 0 or prefix[1, right] == prefix[1, left]
                count[offset, column] += 1
                area[offset, column] += (size if alone else right - left) * (size if above else end - first)
