"""Loops for boxes of all sizes at once: the mean over all positions, and the halving of a grid.

Cells are uint8 (0 or 1), shape (ny, nx); `wrap` says that an axis is periodic. All sums are integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def inside(cells: Array, largest: int, wrap_y: bool, wrap_x: bool, distance: Array, histogram: Array) -> None:
    """Count the positions of the box, wholly inside, by the size from which on it meets the set.

    A box at (i, j) of size s meets the set if s >= d(i, j), and d is one more than the smallest of its three
    neighbours, or one on the set: the distance on the chessboard, looking one way only. `distance` (nx + 1)
    int32 holds largest + 1 everywhere, `histogram` (largest + 2) zeros.
    """
    ny, nx = cells.shape
    far = largest + 1
    rows = ny + (largest if wrap_y else 0)
    for i in range(rows - 1, -1, -1):
        row = cells[i % ny]
        beyond = np.int32(far)  # value at j + 1 in this row
        corner = distance[nx]  # value at j + 1 in the row below
        if wrap_x:
            for j in range(min(largest, nx) - 1, -1, -1):  # the start of the row, seen from its end
                below = distance[j]
                beyond = np.int32(1) if row[j] else min(below, corner, beyond) + np.int32(1)
                corner = below
            corner = distance[0]
        room = far if wrap_y else ny - i
        for j in range(nx - 1, -1, -1):
            below = distance[j]
            beyond = np.int32(1) if row[j] else min(below, corner, beyond, far - 1) + np.int32(1)
            corner = below
            distance[j] = beyond
        if i >= ny:
            continue
        for j in range(nx):
            histogram[distance[j]] += 1
        last = nx if wrap_x else max(0, nx - largest)
        for j in range(0 if room <= largest else last, nx):
            limit = min(room, far if wrap_x else nx - j)
            if limit <= largest:  # from here on the box hangs over the edge
                histogram[max(limit + 1, distance[j])] -= 1


@kernel
def from_edges(cells: Array, top: Array, bottom: Array, left: Array, right: Array) -> None:
    """Find the cells from each edge to the set; where a line holds none the values stay as they are."""
    ny, nx = cells.shape
    for i in range(ny):
        row = cells[i]
        for j in range(nx):
            if row[j]:
                top[j] = min(top[j], i)
                bottom[j] = ny - 1 - i
                left[i] = min(left[i], j)
                right[i] = nx - 1 - j


@kernel
def hanging(first: Array, largest: int, wrap: bool, nearest: Array, totals: Array) -> None:
    """Add the positions of boxes that hang over one edge, `first` cells away from the set in each column.

    `nearest` is a copy of `first` to work in.
    """
    n = first.size
    for size in range(2, largest + 1):
        last = n if wrap else n - size + 1
        for j in range(last):
            nearest[j] = min(nearest[j], first[(j + size - 1) % n])
            totals[size] += max(0, size - 1 - nearest[j])


@kernel
def corner(nearest: Array, totals: Array) -> None:
    """Add the positions of boxes that hang over two edges.

    `nearest` is the first column of the set in the first row, in the first two, and so on.
    """
    for size in range(2, totals.size):
        for a in range(size - 1):
            totals[size] += max(0, size - 1 - nearest[a])


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
