"""Moments of the mass in a gliding box, by blocks of positions, and the jackknife over these blocks.

A box of any height and width moves over the plane cell by cell. Of its mass M (the cells of the set in it, or
the sum of a field) the number of positions with M > 0, the sum of M and the sum of M^2 are added up in 4 x 4
blocks of positions. Hit probability, lacunarity and everything made of them are functions of such sums, so
leaving out one block after the other gives their standard errors (Quenouille 1956; Kunsch 1989 for blocks).
On a free axis only positions inside the plane count, with gaps only those at which every cell was observed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from fractalcontact.base.jit import kernel, sum_kernel
from fractalcontact.domains._masks import Array

BLOCKS = 4  # along each axis: 16 give 15 degrees of freedom, and each is still wider than a box of L/8
LARGEST_INT32 = 2**31 - 1
LARGEST_INT64 = 2**63 - 1


@dataclass(frozen=True)
class BoxSums:
    """Sums over the positions of each box, all of shape (boxes, blocks)."""

    places: Array
    hits: Array
    masses: Array
    squares: Array

    def leaving_out(self) -> BoxMoments:
        """Return the moments over all positions, then those without each of the blocks in turn."""
        parts = (self.places, self.hits, self.masses, self.squares)
        places, hits, masses, squares = (
            np.concatenate([part.sum(1)[None], part.sum(1)[None] - part.T]) for part in parts
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            lacunarity = np.where(masses > 0, places * squares / masses**2, np.nan)
            return BoxMoments(hits / places, lacunarity)


@dataclass(frozen=True)
class BoxMoments:
    """Share of positions that meet the set, and lacunarity <M^2> / <M>^2, each (1 + blocks, boxes)."""

    hit: Array
    lacunarity: Array


def box_sums(cells: Array, valid: Array | None, boxes: Array, periodic: Sequence[bool]) -> BoxSums:
    """Return the sums of one plane for all boxes.

    Parameters
    ----------
    cells : ndarray, shape (ny, nx)
        uint8 of 0 and 1, or a field of float64, at least 0 and 0 where nothing was observed.
    valid : ndarray of uint8, shape (ny, nx), or None
        Observed cells; None: all of them.
    boxes : ndarray of int64, shape (boxes, 2)
        Height and width of each in cells; NaN where one is longer than a free axis.
    periodic : pair of bool
        Whether the box wraps around in y and in x.
    """
    (ny, nx), (wrap_y, wrap_x) = cells.shape, periodic
    parts = np.zeros((4, len(boxes), BLOCKS if ny == 1 else BLOCKS * BLOCKS))
    observed = np.zeros((0, 0), np.uint8) if valid is None else valid
    for box, (height, width) in enumerate(boxes.tolist()):
        rows, across = ny if wrap_y else ny - height + 1, nx if wrap_x else nx - width + 1
        if rows < 1 or across < 1:
            continue
        # masses are exact integers; their squares along a row too, unless the box is longer than 2^14 cells
        is_exact = cells.dtype == np.uint8 and (height * width) ** 2 * across <= LARGEST_INT64
        dtype = np.int32 if is_exact and nx * height <= LARGEST_INT32 else np.float64
        columns, seen = np.zeros(nx, dtype), np.zeros(nx if valid is not None else 0, np.int32)
        prefix, seen_prefix = np.zeros(nx + width + 1, dtype), np.zeros(nx + width + 1, np.int32)
        glide(cells, observed, height, width, rows, across, columns, seen, prefix, seen_prefix, parts[:, box])
    return BoxSums(*parts)


def jackknife_error(replicates: Array) -> Array:
    """Return the standard error from an estimate and its values without each block, on axis 1."""
    leave = replicates[:, 1:]
    n = leave.shape[1]
    with np.errstate(invalid="ignore"):  # logarithms of nothing
        deviations = leave - leave.mean(1, keepdims=True)
    return np.asarray(np.sqrt((n - 1) / n * (deviations**2).sum(1)))


def half_width(replicates: Array) -> Array:
    """Return the half-width of the 95 % interval (Student's t; blocks less one degrees of freedom)."""
    return np.asarray(stdtrit(replicates.shape[1] - 2, 0.975) * jackknife_error(replicates))


@kernel
def add_row(columns: Array, entering: Array, leaving: Array, leaves: bool) -> None:
    """Move the sums over a column of the box on by one row."""
    if leaves:
        for j in range(columns.size):
            columns[j] += entering[j]
            columns[j] -= leaving[j]
    else:
        for j in range(columns.size):
            columns[j] += entering[j]


@kernel
def add_up(columns: Array, prefix: Array, count: int) -> None:
    """Add up columns from the left, `count` of them; a periodic axis continues."""
    total = prefix[0]
    for j in range(min(count, columns.size)):
        total += columns[j]
        prefix[j + 1] = total
    for j in range(columns.size, count):
        total += columns[j - columns.size]
        prefix[j + 1] = total


@sum_kernel
def glide(
    cells: Array,
    valid: Array,
    height: int,
    width: int,
    rows: int,
    across: int,
    columns: Array,
    seen: Array,
    prefix: Array,
    seen_prefix: Array,
    sums: Array,
) -> None:
    """Add up positions, hits, masses and squared masses, `sums` (4, blocks), over rows x across positions.

    `valid` is empty where everything was observed. The others are zeros to work in: `columns` (nx) and
    `prefix` (nx + width + 1) of the type in which masses and squares are exact, int32 or float64; `seen` and
    `seen_prefix` alike for observed cells, int32.
    """
    ny = cells.shape[0]
    blocks = 4
    has_gaps = valid.size > 0
    area = height * width
    for i in range(1 - height, rows):
        entering = (i + height - 1) % ny
        add_row(columns, cells[entering], cells[max(i - 1, 0)], i > 0)
        if has_gaps:
            add_row(seen, valid[entering], valid[max(i - 1, 0)], i > 0)
        if i < 0:
            continue
        add_up(columns, prefix, across + width - 1)
        if has_gaps:
            add_up(seen, seen_prefix, across + width - 1)
        for block in range(blocks):
            start, stop = -(-block * across // blocks), -(-(block + 1) * across // blocks)
            left, right = prefix[start:stop], prefix[start + width : stop + width]
            places, hits = 0, 0
            mass, square = np.int64(0) * prefix[0], 0.0
            if has_gaps:
                seen_left, seen_right = seen_prefix[start:stop], seen_prefix[start + width : stop + width]
                for j in range(left.size):
                    inside = prefix.dtype.type(right[j] - left[j])
                    if seen_right[j] - seen_left[j] < area:
                        inside = prefix.dtype.type(0)
                    else:
                        places += 1
                    hits += inside > 0
                    mass += inside
                    square += np.float64(inside) * np.float64(inside)
            else:
                places = left.size
                for j in range(left.size):
                    inside = prefix.dtype.type(right[j] - left[j])
                    hits += inside > 0
                    mass += inside
                    square += np.float64(inside) * np.float64(inside)
            target = i * blocks // rows * blocks + block
            sums[0, target] += places
            sums[1, target] += hits
            sums[2, target] += mass
            sums[3, target] += square
