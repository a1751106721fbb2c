"""Loops that look for the cell of a set nearest to every cell, as far as a reach.

Cells are uint8 (0 or 1), shape (ny, nx); `wrap` says that an axis is periodic.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def above_and_below(cells: Array, reach: int, wrap: bool, above: Array, below: Array) -> None:
    """Find the rows to the nearest cell of the set in each column, up and down; reach + 1 where none is."""
    ny, nx = cells.shape
    far = reach + 1
    over = reach if wrap else 0
    last = np.full(nx, far, above.dtype)
    for i in range(-over, ny):
        row = cells[i % ny]
        for j in range(nx):
            last[j] = 0 if row[j] else min(last[j] + 1, far)
        if i >= 0:
            above[i] = last
    last[:] = far
    for i in range(ny + over - 1, -1, -1):
        row = cells[i % ny]
        for j in range(nx):
            last[j] = 0 if row[j] else min(last[j] + 1, far)
        if i < ny:
            below[i] = last


@kernel
def count_offsets(
    above: Array,
    below: Array,
    valid: Array,
    high: Array,
    wide: Array,
    wrap_y: bool,
    wrap_x: bool,
    counts: Array,
) -> None:
    """Count cells by how many rows and columns the nearest cell of the set is away.

    `above` and `below` are those of `above_and_below`; `high` and `wide` are the squares of distances of so
    many rows and columns, and `counts` (rows, columns) int64 is added to. Columns are tried from the nearest
    on, until none can be as near. Unobserved cells do not count; a cell counts twice if its mirror images
    about the nearest cells of the set all lie outside, or were not observed.
    """
    ny, nx = above.shape
    for i in range(ny):
        for j in range(nx):
            if valid[i, j] == 0:
                continue
            if above[i, j] == 0:
                counts[0, 0] += 1
                continue
            best = np.inf
            rows, columns, there = 0, 0, False
            for step in range(wide.size):
                if wide[step] > best:
                    break
                for side in (1, -1):
                    other = j + side * step
                    if other < 0 or other >= nx:
                        if not wrap_x:
                            continue
                        other %= nx
                    height = min(above[i, other], below[i, other])
                    if height >= high.size or high[height] + wide[step] > best:
                        continue
                    if high[height] + wide[step] < best:
                        best = high[height] + wide[step]
                        rows, columns, there = height, step, False
                    x = j + 2 * side * step
                    if there or not (wrap_x or 0 <= x < nx):
                        continue
                    up, down = i - 2 * height, i + 2 * height
                    if above[i, other] == height and (wrap_y or up >= 0):
                        there |= valid[up % ny, x % nx] != 0
                    if below[i, other] == height and (wrap_y or down < ny):
                        there |= valid[down % ny, x % nx] != 0
            if best < np.inf:
                counts[rows, columns] += 1 if there else 2
