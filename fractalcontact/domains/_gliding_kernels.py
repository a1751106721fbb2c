"""Loops of the gliding box: sums of the mass in it, and of its square, over all positions.

Masks are uint8 (0 or 1), shape (ny, nx). Sums are kept per row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def glide(mask: Array, size: int, across: int, columns: Array, masses: Array, squares: Array) -> None:
    """Add up the mass in the box and its square along every row of `across` positions.

    `masses` (int64) and `squares` (int64, or float64 where it could overflow) hold one value per row of
    positions: ny of them, or ny - size + 1 where y is free. `columns` (nx + size) int32 is zeros to work in.
    """
    ny, nx = mask.shape
    for i in range(1 - size, masses.size):
        entering = (i + size - 1) % ny
        leaving = i - 1 if i > 0 else 0
        for j in range(nx):
            columns[j] = columns[j] + mask[entering, j] - (i > 0) * mask[leaving, j]
        if i < 0:
            continue
        for j in range(size):  # a periodic axis goes on
            columns[nx + j] = columns[j]
        inside, mass, square = 0, 0, squares[i]
        for j in range(size):
            inside += columns[j]
        for j in range(across):
            mass += inside
            square += inside * inside
            inside += columns[j + size] - columns[j]
        masses[i], squares[i] = mass, square


@kernel
def glide_observed(
    mask: Array,
    valid: Array,
    size: int,
    across: int,
    columns: Array,
    seen: Array,
    masses: Array,
    squares: Array,
    places: Array,
) -> None:
    """As `glide`, over the positions where every cell of the box was observed; `places` counts them.

    `seen` (nx + size) int32 is zeros to work in, too.
    """
    ny, nx = mask.shape
    for i in range(1 - size, masses.size):
        entering = (i + size - 1) % ny
        leaving = i - 1 if i > 0 else 0
        for j in range(nx):
            columns[j] = columns[j] + mask[entering, j] - (i > 0) * mask[leaving, j]
            seen[j] = seen[j] + valid[entering, j] - (i > 0) * valid[leaving, j]
        if i < 0:
            continue
        for j in range(size):
            columns[nx + j] = columns[j]
            seen[nx + j] = seen[j]
        inside, observed, square = 0, 0, squares[i]
        for j in range(size):
            inside += columns[j]
            observed += seen[j]
        for j in range(across):
            if observed == size * size:
                places[i] += 1
                masses[i] += inside
                square += inside * inside
            inside += columns[j + size] - columns[j]
            observed += seen[j + size] - seen[j]
        squares[i] = square


@kernel
def squares_from_pairs(pairs: Array, largest: int) -> Array:
    """Sum of squared masses for every size up to `largest` (index 0 is unused), both axes periodic.

    `pairs[u, v]` is the number of pairs of set cells u rows and v columns apart, on the torus. The sum of
    squares is that of (s - |u|)(s - |v|) pairs[u, v] over |u|, |v| < s, so a double sum of double sums.
    """
    ny, nx = pairs.shape
    total = np.zeros(largest + 1, pairs.dtype)
    column = np.zeros(largest, pairs.dtype)  # over |u| <= a, at v = +-b
    within = np.zeros(largest, pairs.dtype)  # over |v| <= b too, and summed over a
    for a in range(largest):
        back = (ny - a) % ny
        running = pairs.dtype.type(0)
        for b in range(largest):
            value = pairs[a % ny, b % nx]
            if b > 0:
                value += pairs[a % ny, nx - b]
            if a > 0:
                value += pairs[back, b % nx]
            if a > 0 and b > 0:
                value += pairs[back, nx - b]
            column[b] += value
            running += column[b]
            within[b] += running
        for b in range(a + 1):
            total[a + 1] += within[b]
    return total
