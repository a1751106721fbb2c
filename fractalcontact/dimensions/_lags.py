"""Curves over the lag: mean increments of a face, summed in one pass or by transforms."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

SQUARE, ABSOLUTE, SECOND = 0, 1, 2
FEW = 64  # lag vectors up to which sums over pairs are faster than transforms
_SEPARATE = 4.5  # spacings up to which every distance is a point of the curve


def near_offsets(steps: tuple[int, int], spacing: tuple[float, float], longest: float) -> Array:
    """Return every lag vector of a half-plane up to a length: shape (k, 2), at most `steps` in y and x."""
    y, x = np.meshgrid(np.arange(steps[0] + 1), np.arange(-steps[1], steps[1] + 1), indexing="ij")
    half = ((y > 0) | (x > 0)) & (np.hypot(y * spacing[0], x * spacing[1]) <= longest * (1 + 1e-9))
    return np.stack([y[half], x[half]], axis=1)


def axis_offsets(shape: tuple[int, int], largest: tuple[int, int]) -> Array:
    """Return lag vectors along y and x, about five for each doubling, up to `largest` steps."""
    found = []
    for axis in (0, 1):
        steps = np.unique(
            np.rint(2.0 ** np.arange(0.0, np.log2(max(largest[axis], 1)) + 1e-9, 0.2)).astype(int)
        )
        steps = steps[steps < shape[axis]]
        found.append(np.stack([steps, 0 * steps], axis=1)[:, :: 1 if axis == 0 else -1])
    return np.concatenate(found)


def direct(
    slabs: Iterable[tuple[Array, int]], columns: tuple[int, int], offsets: Array, kind: int
) -> tuple[Array, Array]:
    """Return the mean of an increment for each lag vector, and the number of increments.

    Parameters
    ----------
    slabs : iterable of (heights, rows)
        Consecutive rows, with as many of the next as the offsets reach, and how many increments start from.
    columns : pair of int
        First and one past the last column that increments start from.
    offsets : ndarray of int, shape (k, 2)
    kind : int
        `SQUARE`, `ABSOLUTE` or `SECOND`.
    """
    from fractalcontact.base.jit import use_threads
    from fractalcontact.dimensions._kernels import pair_sums

    use_threads()
    rows_of_sums, counts = [], np.zeros(len(offsets), dtype=np.int64)
    for heights, rows in slabs:
        sums = np.zeros((rows, len(offsets)))
        number = np.zeros((rows, len(offsets)), dtype=np.int64)
        pair_sums(heights, rows, np.array(columns), offsets, kind, sums, number)
        rows_of_sums.append(sums)
        counts += number.sum(axis=0)
    total = np.cumsum(np.concatenate(rows_of_sums), axis=0)[-1]
    return np.divide(total, counts, out=np.full(len(offsets), np.nan), where=counts > 0), counts


def wrapped(
    heights: Array, periodic: tuple[bool, bool], offsets: Array, reach: int
) -> tuple[Array, tuple[int, int]]:
    """Repeat a periodic face beyond its edges as far as the offsets reach.

    Returns the heights and the columns that increments start from; rows are those of the face.
    """
    far = reach * np.abs(offsets).max(axis=0)
    pad = ((0, int(far[0]) if periodic[0] else 0), (int(far[1]) if periodic[1] else 0,) * 2)
    return np.pad(heights, pad, mode="wrap"), (pad[1][0], pad[1][0] + heights.shape[1])


def transformed(heights: Array, periodic: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the mean square increment at every lag of a half-plane, and the number of pairs.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where nothing was observed (Marcotte 1996, Computers and Geosciences 22).

    Returns
    -------
    squares, counts : ndarray, shape (my, mx)
        Lags along y are in the order of a transform of my points, lags along x run from 0 upwards.
    """
    ny, nx = heights.shape
    torus = (
        ny if periodic[0] else fft.fast_length(2 * ny),
        nx if periodic[1] else fft.fast_length(2 * nx),
    )
    seen = np.isfinite(heights)
    centred = np.where(seen, heights - heights[seen].mean(), 0.0)
    planes = []
    for plane in (seen.astype(float), centred, centred * centred):
        padded = np.zeros(torus)
        padded[:ny, :nx] = plane
        planes.append(fft.rfft2(padded))
    mask, value, square = planes
    counts = np.rint(fft.irfft2(mask * np.conj(mask), torus))
    both = np.conj(mask) * square
    pairs = fft.irfft2(both + np.conj(both) - 2.0 * (value * np.conj(value)), torus)
    columns = nx // 2 + 1 if periodic[1] else nx
    pairs, counts = pairs[:, :columns], counts[:, :columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(counts > 0, np.maximum(pairs, 0.0) / counts, np.nan), counts.astype(np.int64)


def lag_vectors(shape: tuple[int, int], periodic: tuple[bool, bool]) -> Array:
    """Return the steps in y and x of the result of `transformed`: shape (2, my, mx)."""
    ny, nx = shape
    my = ny if periodic[0] else fft.fast_length(2 * ny)
    y = np.arange(my)
    y = np.where(y > my // 2, y - my, y)
    x = np.arange(nx // 2 + 1 if periodic[1] else nx)
    return np.stack(np.meshgrid(y, x, indexing="ij"))


def nominal_counts(
    vectors: Array, shape: tuple[int, int], periodic: tuple[bool, bool], reach: int = 1
) -> Array:
    """Return how many increments a complete face has for each lag vector (last axis: y, x)."""
    sides = [
        np.full(vectors.shape[:-1], n) if wraps else np.maximum(n - reach * np.abs(vectors[..., i]), 0)
        for i, (n, wraps) in enumerate(zip(shape, periodic, strict=True))
    ]
    return np.asarray(sides[0] * sides[1])


def rings(
    distance: Array, value: Array, counts: Array, nominal: Array, width: float, longest: float
) -> tuple[Array, Array, Array]:
    """Average over lag vectors of about equal length, each counting by its pairs.

    Up to `_SEPARATE` times `width` every distance is a ring of its own; beyond, rings are one `width` wide.

    Parameters
    ----------
    distance, value, counts : ndarray, shape (vectors,)
    nominal : ndarray, shape (vectors,)
        Pairs of a complete face; they decide the lag of a ring, whatever is missing.
    width, longest : float
        In the unit of `distance`.

    Returns
    -------
    lag, mean : ndarray, shape (k,)
        The mean is NaN where no pair was observed.
    pairs : ndarray of int64, shape (k,)
    """
    kept = (distance > 0) & (distance <= longest * (1 + 1e-9)) & (nominal > 0)
    distance, counts, nominal = distance[kept], counts[kept], nominal[kept]
    value = np.where(counts > 0, value[kept], 0.0)
    # relative to the width, so that the unit of length decides nothing
    rounded = np.round(distance / width, 9)
    key = np.where(rounded <= _SEPARATE, rounded, np.floor(rounded + 0.5) + 1e-3)
    _, ring = np.unique(key, return_inverse=True)
    pairs = np.bincount(ring, counts)
    total = np.bincount(ring, counts * value)
    mean = np.divide(total, pairs, out=np.full(total.shape, np.nan), where=pairs > 0)
    return np.bincount(ring, nominal * distance) / np.bincount(ring, nominal), mean, pairs.astype(np.int64)
