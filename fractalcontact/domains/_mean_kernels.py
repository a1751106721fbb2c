"""Loops for boxes of all sizes at once: the mean over all positions, and the halving of a grid.

Masks are uint8 (0 or 1), shape (ny, nx); `wrap` says that an axis is periodic. All sums are integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def _inside(mask: Array, largest: int, wrap_y: bool, wrap_x: bool) -> Array:
    """Positions of the box, wholly inside, at which it meets the set; by size.

    A box at (i, j) of size s meets the set if s >= d(i, j), and d is one more than the smallest of its three
    neighbours, or one on the set: the distance on the chessboard, looking one way only.
    """
    ny, nx = mask.shape
    histogram = np.zeros(largest + 2, np.int64)
    far = largest + 1
    distance = np.full(nx + 1, far, np.int32)
    rows = ny + (largest if wrap_y else 0)
    for i in range(rows - 1, -1, -1):
        row = mask[i % ny]
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
    return np.cumsum(histogram)[: largest + 1]


@kernel
def _from_edges(mask: Array) -> tuple[Array, Array, Array, Array]:
    """Cells from the top, bottom, left and right edge to the set; the whole line if it holds none."""
    ny, nx = mask.shape
    top, bottom = np.full(nx, ny, np.int64), np.full(nx, ny, np.int64)
    left, right = np.full(ny, nx, np.int64), np.full(ny, nx, np.int64)
    for i in range(ny):
        row = mask[i]
        for j in range(nx):
            if row[j]:
                top[j] = min(top[j], i)
                bottom[j] = ny - 1 - i
                left[i] = min(left[i], j)
                right[i] = nx - 1 - j
    return top, bottom, left, right


@kernel
def _hanging(first: Array, largest: int, wrap: bool, totals: Array) -> None:
    """Add the positions of boxes that hang over one edge, `first` cells away from the set in each column."""
    n = first.size
    nearest = first.copy()
    for size in range(2, largest + 1):
        last = n if wrap else n - size + 1
        for j in range(last):
            nearest[j] = min(nearest[j], first[(j + size - 1) % n])
            totals[size] += max(0, size - 1 - nearest[j])


@kernel
def _corner(first: Array, largest: int, totals: Array) -> None:
    """Add the positions of boxes that hang over two edges; `first` is the first column of each row."""
    nearest = np.int64(first.size + largest + 1)
    running = np.full(largest + 1, nearest)
    for a in range(1, largest):
        if a - 1 < first.size:
            nearest = min(nearest, first[a - 1])
        running[a] = nearest
    for size in range(2, largest + 1):
        for a in range(1, size):
            totals[size] += max(0, size - 1 - running[a])


@kernel
def mean_cover(mask: Array, largest: int, wrap_y: bool, wrap_x: bool) -> tuple[Array, Array]:
    """Positions at which a box meets the set, for all sizes up to `largest` (index 0 is unused).

    Divided by size^2 they are the number of boxes averaged over the offsets of the grid. The first array has
    every box that hangs over a free edge; in the second, boxes that hang over opposite edges by the same cut
    count once. No free axis is shorter than `largest`.
    """
    inside = _inside(mask, largest, wrap_y, wrap_x)
    whole, folded = inside.copy(), inside.copy()
    top, bottom, left, right = _from_edges(mask)
    if not wrap_y:
        _hanging(top, largest, wrap_x, whole)
        _hanging(bottom, largest, wrap_x, whole)
        _hanging(np.minimum(top, bottom), largest, wrap_x, folded)
    if not wrap_x:
        _hanging(left, largest, wrap_y, whole)
        _hanging(right, largest, wrap_y, whole)
        _hanging(np.minimum(left, right), largest, wrap_y, folded)
    if not wrap_y and not wrap_x:
        _corner(left, largest, whole)
        _corner(right, largest, whole)
        _corner(left[::-1].copy(), largest, whole)
        _corner(right[::-1].copy(), largest, whole)
        nearest = np.minimum(left, right)
        _corner(np.minimum(nearest, nearest[::-1]), largest, folded)
    return whole, folded


@kernel
def _halve(pairs: Array, coarse: Array) -> None:
    """Join two rows and, with two cells in each word, two columns."""
    ny = pairs.shape[0]
    for i in range(coarse.shape[0]):
        upper, lower = pairs[2 * i], pairs[min(2 * i + 1, ny - 1)]
        out = coarse[i]
        for j in range(pairs.shape[1]):
            both = upper[j] | lower[j]
            out[j] = np.uint8((both | (both >> np.uint16(8))) & np.uint16(1))


@kernel
def coarsen(mask: Array, factor: int) -> Array:
    """Mark the boxes of `factor` cells, on the grid from the first cell, that hold a cell of the set."""
    ny, nx = mask.shape
    coarse = np.zeros((-(-ny // factor), -(-nx // factor)), np.uint8)
    if factor == 2 and nx % 2 == 0:
        _halve(mask.view(np.uint16), coarse)
        return coarse
    band = np.empty(nx, np.uint8)
    for i in range(coarse.shape[0]):
        band[:] = mask[i * factor]
        for k in range(i * factor + 1, min((i + 1) * factor, ny)):
            row = mask[k]
            for j in range(nx):
                band[j] |= row[j]
        for j in range(nx):
            coarse[i, j // factor] |= band[j]
    return coarse
