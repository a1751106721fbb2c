"""Loops for boxes of all sizes at once: the mean over all positions, and the halving of a grid.

Cells are uint8 (0 or 1), shape (ny, nx). All sums are integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def nearest_ahead(cells: Array, rows: int, columns: int, distance: Array, histogram: Array) -> None:
    """Count the positions in the first `rows` and `columns` by the size from which on a box meets the set.

    A box at (i, j) of size s meets the set if s >= d(i, j), and d is one more than the smallest of its three
    neighbours, or one on the set: the distance on the chessboard, looking one way only. Beyond an edge there
    is nothing; a periodic axis goes on for the longest box. `distance` (nx + 1) int32 holds largest + 1
    everywhere, `histogram` (largest + 2) zeros.
    """
    nx = cells.shape[1]
    far = distance[nx]
    for i in range(cells.shape[0] - 1, -1, -1):
        beyond, corner = far, far  # values at j + 1, in this row and in the row below
        for j in range(nx - 1, -1, -1):
            below = distance[j]
            nearest = corner if corner < below else below
            nearest = beyond if beyond < nearest else nearest
            beyond = 1 if cells[i, j] else nearest + 1
            corner = below
            distance[j] = beyond
        if i < rows:
            for j in range(columns):
                histogram[distance[j] if distance[j] < far else far] += 1


@kernel
def halve(pairs: Array, coarse: Array) -> None:
    """Join two rows and, with two cells in each word, two columns."""
    ny = pairs.shape[0]
    for i in range(coarse.shape[0]):
        upper, lower = pairs[2 * i], pairs[min(2 * i + 1, ny - 1)]
        out = coarse[i]
        for j in range(pairs.shape[1]):
            both = upper[j] | lower[j]
            out[j] = np.uint8((both | (both >> np.uint16(8))) & np.uint16(1))
