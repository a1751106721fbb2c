"""Loops over pairs of cells at short lags: how many of them differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def _compare(here: Array, there: Array, seen: Array, seen_there: Array) -> tuple[np.int32, np.int32]:
    """Count the pairs of two stretches of cells that were observed, and those that differ."""
    observed, differing = np.int32(0), np.int32(0)
    for j in range(here.size):
        both = seen[j] & seen_there[j]
        observed += np.int32(both)
        differing += np.int32(both & (here[j] ^ there[j]))
    return observed, differing


@kernel
def switches(
    mask: Array, valid: Array, offsets: Array, wrap_y: bool, wrap_x: bool, pairs: Array, differing: Array
) -> None:
    """Count observed pairs and differing pairs for every offset, in blocks of the plane.

    `offsets` is (lags, 2), rows (>= 0) and columns down and right; `pairs` and `differing` are
    (blocks, blocks, lags) int64. A pair belongs to the block of its first cell.
    """
    ny, nx = mask.shape
    blocks = pairs.shape[0]
    for lag in range(offsets.shape[0]):
        down, right = offsets[lag, 0], offsets[lag, 1]
        for i in range(ny if wrap_y else ny - down):
            here, seen = mask[i], valid[i]
            there, seen_there = mask[(i + down) % ny], valid[(i + down) % ny]
            row = i * blocks // ny
            for column in range(blocks):
                start, stop = -(-column * nx // blocks), -(-(column + 1) * nx // blocks)
                low, high = max(start, -right, 0), max(min(stop, nx - right), max(start, -right, 0))
                count, changed = _compare(
                    here[low:high],
                    there[low + right : high + right],
                    seen[low:high],
                    seen_there[low + right : high + right],
                )
                pairs[row, column, lag] += count
                differing[row, column, lag] += changed
                if not wrap_x:
                    continue
                for j in range(start, stop):
                    if j + right < 0 or j + right >= nx:
                        beyond = (j + right) % nx
                        both = seen[j] & seen_there[beyond]
                        pairs[row, column, lag] += both
                        differing[row, column, lag] += both & (here[j] ^ there[beyond])
