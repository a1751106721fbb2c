"""Mean squares of first and second differences over one, two and four points, of a surface and its blocks.

Twelve kinds of increments, in the order of `_kernels.increment_sums`: along x the first differences over 1,
2 and 4 times the stride, then the second differences; the same six along y.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

LAGS = (1, 2, 4)
REACH = 2 * LAGS[-1]  # rows of the next slab that an increment needs, in strides
KINDS = 12
_BLOCKS = 4  # blocks along an axis
_BLOCK_EDGE, _BLOCK_LENGTH = 12, 48  # smallest edge of a block, and length of a block of a profile, strides


@dataclass(frozen=True)
class Moments:
    """Mean squares of the twelve increments.

    Attributes
    ----------
    means, counts : ndarray, shape (12,)
        Mean squares and numbers of increments.
    shape : (ny, nx) or (nx,)
    stride : int
        Shortest lag in points.
    observed : ndarray of bool, shape (ny, nx), or None
        Where heights were observed; None if everywhere.
    blocks : pair of ndarray, shape (blocks, 12), or None
        Mean squares and numbers of equal blocks; None if the surface is too small to be cut.
    """

    means: Array
    counts: Array
    shape: tuple[int, ...]
    stride: int
    observed: Array | None
    blocks: tuple[Array, Array] | None = None


def increment_moments(slabs: Iterable[tuple[Array, int]], shape: tuple[int, ...], stride: int = 1) -> Moments:
    """Collect the mean squares from slabs of rows in one pass.

    Parameters
    ----------
    slabs : iterable of (heights, rows)
        Consecutive rows, each slab with up to `REACH` * `stride` rows of the next; `rows` is how many of
        its rows increments start from. A profile has one row.
    shape : (ny, nx) or (nx,)
    stride : int
        Shortest lag in points.
    """
    from fractalcontact.base.threads import in_bands
    from fractalcontact.dimensions._kernels import gapped_increment_sums, increment_sums

    block_rows, block_columns = _block_edges(shape, stride)
    row_sums, row_counts, masks = [], [], []
    for heights, rows in slabs:
        sums = np.zeros((rows, block_columns.size - 1, KINDS))
        in_bands(increment_sums, rows, KINDS * rows * heights.shape[1], heights, stride, block_columns, sums)
        counts = _complete_counts(heights.shape, rows, block_columns, stride)
        mask = None
        if np.isnan(sums).any():
            # a row without gaps keeps its sum, so that it does not matter which slab it was read with
            gapped, counts = np.zeros(sums.shape), np.zeros(sums.shape, dtype=np.int64)
            place = heights, stride, block_columns
            in_bands(gapped_increment_sums, rows, KINDS * rows * heights.shape[1], *place, gapped, counts)
            sums = np.where(np.isnan(sums), gapped, sums)
            mask = np.isfinite(heights[:rows])
        row_sums.append(sums)
        row_counts.append(counts)
        masks.append(mask)
    sums, counts = np.concatenate(row_sums), np.concatenate(row_counts)
    # added row after row, so that neither slabs nor threads change a bit
    total, number = np.cumsum(np.cumsum(sums, axis=0)[-1], axis=0)[-1], counts.sum(axis=(0, 1))
    blocks = None
    if (block_rows.size - 1) * (block_columns.size - 1) > 1:
        block_sums = np.add.reduceat(sums, block_rows[:-1], axis=0).reshape(-1, KINDS)
        block_counts = np.add.reduceat(counts, block_rows[:-1], axis=0).reshape(-1, KINDS)
        blocks = (_ratio(block_sums, block_counts), block_counts)
    observed = None
    if any(mask is not None for mask in masks):
        observed = np.concatenate(
            [
                np.ones((len(sums), shape[-1]), dtype=bool) if mask is None else mask
                for mask, sums in zip(masks, row_sums, strict=True)
            ]
        )
    return Moments(_ratio(total, number), number, shape, stride, observed, blocks)


def _block_edges(shape: tuple[int, ...], stride: int) -> tuple[Array, Array]:
    """Return the rows and the columns at which a surface is cut into blocks, the last edge included."""
    ny, nx = (1, *shape)[-2:]
    if ny == 1:
        down, across = 1, max(1, min(_BLOCKS**2, nx // (_BLOCK_LENGTH * stride)))
    else:
        down, across = (max(1, min(_BLOCKS, n // (_BLOCK_EDGE * stride))) for n in (ny, nx))
    return tuple(np.arange(k + 1) * n // k for n, k in ((ny, down), (nx, across)))  # type: ignore[return-value]


def _ratio(sums: Array, counts: Array) -> Array:
    return np.asarray(np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0))


def _complete_counts(shape: tuple[int, ...], rows: int, edges: Array, stride: int) -> Array:
    """Count the increments of every row and block of a complete surface: (rows, blocks, 12)."""
    ny, nx = shape
    counts = np.empty((rows, edges.size - 1, KINDS), dtype=np.int64)
    for k, reach in enumerate(stride * lag for lag in (1, 2, 4, 2, 4, 8)):
        counts[..., k] = np.diff(np.minimum(edges, max(nx - reach, 0)))
        counts[..., 6 + k] = np.diff(edges) * (np.arange(rows) + reach < ny)[:, None]
    return counts
