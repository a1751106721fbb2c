"""Loops of the gliding box: sums of the mass in it, and of its square, over all positions.

Masks are uint8 (0 or 1), shape (ny, nx); `wrap` says that an axis is periodic. Sums are kept per row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import inner_loop, kernel

Array = np.ndarray[Any, np.dtype[Any]]


@inner_loop
def _slide(columns: Array, leaving: Array, entering: Array) -> None:
    for j in range(columns.size):
        columns[j] += np.int32(entering[j]) - np.int32(leaving[j])


@inner_loop
def _first_band(mask: Array, size: int, columns: Array) -> None:
    for k in range(size):
        for j in range(columns.size):
            columns[j] += np.int32(mask[k, j])


@kernel
def glide(mask: Array, size: int, wrap_x: bool, columns: Array, masses: Array, squares: Array) -> None:
    """Add up the mass in the box and its square along every row of positions.

    `masses` (int64) and `squares` (int64, or float64 where it could overflow) hold one value per row of
    positions: ny of them, or ny - size + 1 where y is free. `columns` (nx) int32 is zeros to work in.
    """
    ny, nx = mask.shape
    last = nx if wrap_x else nx - size + 1
    inner = nx - size  # positions after which the box does not yet go round
    _first_band(mask, size, columns)
    for i in range(masses.size):
        inside = np.int64(0)
        for j in range(size):
            inside += columns[j]
        mass = np.int64(0)
        square = squares[i]
        for j in range(min(inner, last)):
            mass += inside
            square += inside * inside
            inside += columns[j + size] - columns[j]
        for j in range(inner, last):
            mass += inside
            square += inside * inside
            inside += columns[(j + size) % nx] - columns[j]
        masses[i] = mass
        squares[i] = square
        if i + 1 < masses.size:
            _slide(columns, mask[i], mask[(i + size) % ny])


@kernel
def glide_observed(
    mask: Array,
    valid: Array,
    size: int,
    wrap_x: bool,
    columns: Array,
    seen: Array,
    masses: Array,
    squares: Array,
    places: Array,
) -> None:
    """As `glide`, over the positions where every cell of the box was observed; `places` counts them.

    `seen` (nx) int32 is zeros to work in, too.
    """
    ny, nx = mask.shape
    last = nx if wrap_x else nx - size + 1
    _first_band(mask, size, columns)
    _first_band(valid, size, seen)
    for i in range(masses.size):
        inside, observed = np.int64(0), np.int64(0)
        for j in range(size):
            inside += columns[j]
            observed += seen[j]
        square = squares[i]
        for j in range(last):
            if observed == size * size:
                places[i] += 1
                masses[i] += inside
                square += inside * inside
            beyond = (j + size) % nx
            inside += columns[beyond] - columns[j]
            observed += seen[beyond] - seen[j]
        squares[i] = square
        if i + 1 < masses.size:
            _slide(columns, mask[i], mask[(i + size) % ny])
            _slide(seen, valid[i], valid[(i + size) % ny])


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
