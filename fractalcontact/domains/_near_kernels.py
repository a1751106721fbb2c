"""Loops that look for the cell of a set nearest to every cell, as far as a reach.

Cells are uint8 (0 or 1), shape (ny, nx); `wrap` says that an axis is periodic.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def above_and_below(cells: Array, reach: int, wrap: bool, down: Array) -> None:
    """Find the rows from the nearest cell of the set in each column; reach + 1 where there is none.

    Positive from a cell of a lower row, which has precedence.
    """
    ny, nx = cells.shape
    far = reach + 1
    over = reach if wrap else 0
    last = np.full(nx, far, down.dtype)
    for i in range(-over, ny):
        row = cells[i % ny]
        for j in range(nx):
            last[j] = 0 if row[j] else min(last[j] + 1, far)
        if i >= 0:
            down[i] = last
    last[:] = far
    for i in range(ny + over - 1, -1, -1):
        row = cells[i % ny]
        for j in range(nx):
            last[j] = 0 if row[j] else min(last[j] + 1, far)
        if i < ny:
            for j in range(nx):
                if last[j] < down[i, j]:
                    down[i, j] = -last[j]


@kernel
def count_offsets(
    down: Array, valid: Array, above: Array, right: Array, wrap_y: bool, wrap_x: bool, counts: Array
) -> None:
    """Count cells by how many rows and columns the nearest cell of the set is away.

    `down` is that of `above_and_below`; `above` and `right` are the squares of distances of so many rows and
    columns, and `counts` (rows, columns) int64 is added to. Columns are tried from the nearest on, the right
    before the left, until none can be nearer. Unobserved cells do not count; a cell of which the mirror
    image about the nearest cell of the set lies outside, or was not observed, counts twice.
    """
    ny, nx = down.shape
    for i in range(ny):
        row = down[i]
        for j in range(nx):
            if valid[i, j] == 0:
                continue
            if row[j] == 0:
                counts[0, 0] += 1
                continue
            best = np.inf
            rows, columns = 0, 0
            for step in range(right.size):
                if right[step] >= best:
                    break
                for side in (1, -1):
                    other = j + side * step
                    if other < 0 or other >= nx:
                        if not wrap_x:
                            continue
                        other %= nx
                    height = abs(row[other])
                    if height < above.size and above[height] + right[step] < best:
                        best = above[height] + right[step]
                        rows, columns = row[other], -side * step
            if best == np.inf:
                continue
            y, x = i - 2 * rows, j - 2 * columns
            there = (wrap_y or 0 <= y < ny) and (wrap_x or 0 <= x < nx) and valid[y % ny, x % nx] != 0
            counts[abs(rows), abs(columns)] += 1 if there else 2
