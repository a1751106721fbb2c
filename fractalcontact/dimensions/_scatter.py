"""How the mean square second differences of a free face scatter together.

Second differences of fractional Brownian heights are normal and stationary. The covariance of two means of
their squares is twice the sum, over all shifts between two middle points, of the squared covariance of the
differences, each shift as often as two middle points so far apart were seen. On a complete face that number
is known; where points are missing the pairs are counted, for differences with points in common are seen
together more often than by chance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

_REACH = 24  # shifts along each axis that are summed one by one, or three times the longest lag
_MOST = 3.0  # times as many of a stretched surface
_FARTHER = 1.4  # shifts beyond those are about so many times as long
_LONG = 32  # lags beyond which shifts and lags are taken on a coarser lattice
_TILE, _TILES = 64, 32  # edge of the parts in which pairs are counted, and the most of them
_LEAST = 1e-6  # of the largest eigenvalue of a covariance: less is what counting left out


@dataclass(frozen=True)
class Pairs:
    """How many pairs of middle points were seen at each shift.

    Attributes
    ----------
    shape : (ny, nx)
        Of the face.
    numbers : ndarray, shape (k,)
        Middle points of each lag vector.
    counts : list of ndarray, or None
        Entry j, shape (k - j, reach_y + 1, 2 reach_x + 1): pairs of a middle point of vector j and one of
        vector i >= j, at shifts (0 ... reach_y, -reach_x ... reach_x). None on a complete face, and where
        lags are long: differences with common points are few among their pairs.
    """

    shape: tuple[int, int]
    numbers: Array
    counts: list[Array] | None = None

    @classmethod
    def of(cls, heights: Array, complete: bool, vectors: Array, numbers: Array) -> Pairs:
        """Count the pairs of a face for lag vectors (k, 2), each seen as often as `numbers` say."""
        shape = (heights.shape[0], heights.shape[1])
        if complete or np.abs(vectors).max(initial=0) > _LONG:
            return cls(shape, numbers)
        return cls(shape, numbers, _counted(np.isfinite(heights), vectors, numbers))


def _reach(vectors: Array, stretch: float = 1.0) -> Array:
    """Return how many shifts along y and x are summed one by one; more where correlations are stretched."""
    near = np.maximum(_REACH, 3 * np.abs(vectors).max(axis=0))
    return np.asarray(np.ceil(near * min(max(stretch / 2.0, 1.0), _MOST)), dtype=np.int64)


def _counted(seen: Array, vectors: Array, numbers: Array) -> list[Array]:
    """Count pairs of middle points, on a large face in some tiles of it that stand for all.

    A second difference was seen if its middle point and those one lag away on either side were.
    """
    k, (ny, nx) = len(vectors), seen.shape
    far, reach = np.abs(vectors).max(axis=0), _reach(vectors)
    edge = min(_TILE, ny), min(_TILE, nx)
    window = edge[0] + int(reach[0]), edge[1] + 2 * int(reach[1])
    torus = fft.fast_length(window[0]), fft.fast_length(window[1])
    padded = np.pad(seen, [(f + r, f + r + e) for f, r, e in zip(far, reach, edge, strict=True)])
    corners = [(y, x) for y in range(0, ny, edge[0]) for x in range(0, nx, edge[1])]
    # drawn, so that they keep no step with a pattern of the gaps
    drawn = np.random.default_rng(0).permutation(len(corners))[:_TILES]
    first, second = np.tril_indices(k)
    total = np.zeros((first.size, torus[0], torus[1] // 2 + 1), dtype=np.complex64)
    for corner in drawn:
        y, x = corners[corner][0] + far[0] + reach[0], corners[corner][1] + far[1]

        def part(dy: int, dx: int, y: int = y, x: int = x) -> Array:
            return padded[y + dy : y + dy + window[0], x + dx : x + dx + window[1]]

        middles = np.zeros((2, k, *torus), dtype=np.float32)
        for place, (dy, dx) in enumerate(vectors):
            both = part(0, 0) & part(-dy, -dx) & part(dy, dx)
            middles[0, place, : window[0], : window[1]] = both
            middles[1, place, : edge[0], : edge[1]] = both[: edge[0], reach[1] : reach[1] + edge[1]]
        around, inside = fft.rfft2(middles)
        for place in range(k):
            total[first == place] += around[place] * np.conj(inside[: place + 1])
    found = np.maximum(fft.irfft2(total, torus), 0.0)[:, : reach[0] + 1, : 2 * reach[1] + 1]
    own = found[first == second, 0, reach[1]]
    scale = np.sqrt(np.divide(numbers, own, out=np.zeros(k), where=own > 0.5))
    found = found * (scale[first] * scale[second])[:, None, None]
    return [found[second == j] for j in range(k)]


def covariance(
    vectors: Array, pairs: Pairs, hurst: float, form: Array, steps: tuple[float, float] = (1.0, 1.0)
) -> Array:
    """Return the covariance of the logarithms of mean square second differences: shape (k, k).

    Parameters
    ----------
    vectors : ndarray of int, shape (k, 2)
    pairs : Pairs
        Of these vectors.
    hurst : float
    form : ndarray, shape (2, 2)
        Matrix M, y first: the mean square increment over h is (h' M h)^hurst.
    steps : pair of float
        Length of a cell along y and x.
    """
    # long lags and the shifts between them are taken on a coarser lattice
    coarse = np.maximum(-(-np.abs(vectors).max(axis=0) // _LONG), 1)
    sides = (np.array(pairs.shape) - 2.0 * np.abs(vectors)) / coarse
    seen = pairs.numbers / np.prod(sides * coarse, axis=1)
    vectors = np.rint(vectors / coarse).astype(np.int64)
    values = np.linalg.eigvalsh(form)
    reach = _reach(vectors, float(np.sqrt(values[1] / values[0])) if pairs.counts is None else 1.0)
    once = _differences(vectors, reach, hurst, form, np.array(steps) * coarse)
    far = np.abs(vectors).max(axis=0)
    rows, columns = far[0] + np.arange(reach[0] + 1)[:, None], far[1] + np.arange(2 * reach[1] + 1)
    spread = np.zeros((len(vectors), len(vectors)))
    power = np.zeros(len(vectors))
    for j, (dy, dx) in enumerate(vectors):
        part = once[j:]
        squares = (
            part[:, rows - dy, columns - dx] + part[:, rows + dy, columns + dx] - 2 * part[:, rows, columns]
        ) ** 2
        power[j] = squares[0, 0, reach[1]]
        near, beyond, whole = _summed(squares, sides[j:], sides[j], reach, hurst)
        if pairs.counts is None:
            spread[j:, j] = seen[j:] * seen[j] * (near + beyond) * np.prod(coarse) ** 2
        else:
            counts = pairs.counts[j]
            twice = 2.0 * np.einsum("kyx,kyx->k", squares[:, 1:], counts[:, 1:])
            near = twice + np.einsum("kx,kx->k", squares[:, 0], counts[:, 0])
            share = 2.0 * counts[:, 1:].sum(axis=(1, 2)) + counts[:, 0].sum(axis=1)
            spread[j:, j] = near + beyond * share / whole
    spread *= 2.0 / np.sqrt(np.outer(power, power)) / np.outer(pairs.numbers, pairs.numbers)
    spread = np.tril(spread) + np.tril(spread, -1).T
    values, basis = np.linalg.eigh(spread)
    if values[0] > _LEAST * values[-1]:
        return spread
    return np.asarray((basis * np.maximum(values, _LEAST * values[-1])) @ basis.T)


def _differences(vectors: Array, reach: Array, hurst: float, form: Array, steps: Array) -> Array:
    """Return the second difference of the variogram over each lag vector, at shifts up to `reach` and beyond.

    Shape (k, reach_y + 1 + 2 far_y, 2 reach_x + 1 + 2 far_x), far being the longest lag along an axis.
    """
    far = np.abs(vectors).max(axis=0)
    y = steps[0] * np.arange(-2 * far[0], reach[0] + 2 * far[0] + 1)[:, None]
    x = steps[1] * np.arange(-reach[1] - 2 * far[1], reach[1] + 2 * far[1] + 1)
    square = form[0, 0] * y * y + 2.0 * form[0, 1] * y * x + form[1, 1] * x * x
    variogram = np.asarray(np.maximum(square, 0.0) ** hurst)
    tall, wide = (n - 2 * f for n, f in zip(variogram.shape, far, strict=True))

    def moved(dy: int, dx: int) -> Array:
        return variogram[far[0] + dy : far[0] + dy + tall, far[1] + dx : far[1] + dx + wide]

    return np.stack([moved(-dy, -dx) + moved(dy, dx) - 2.0 * moved(0, 0) for dy, dx in vectors])


def _summed(
    squares: Array, sides: Array, side: Array, reach: Array, hurst: float
) -> tuple[Array, Array, Array]:
    """Sum squared covariances (k, y, x) over the pairs of a complete face.

    Far from its middle a covariance goes as the shift to the power 2 hurst - 4; what lies beyond the shifts
    summed follows from those along their edge.

    Returns
    -------
    near, beyond, whole : ndarray, shape (k,)
        The sums up to `reach` and beyond it, and the number of pairs up to `reach`.
    """
    shifts = np.arange(reach[0] + 1.0), np.abs(np.arange(-reach[1], reach[1] + 1.0))

    def overlaps(farther: float) -> tuple[Array, Array]:
        """Return the lengths that middle points of both share along y, both ways, and along x."""
        one, other = sides[:, :, None], side[:, None]
        y, x = (
            np.maximum(
                np.minimum(np.minimum(one, other), 0.5 * (one + other) - farther * shift)[:, axis], 0.0
            )
            for axis, shift in enumerate(shifts)
        )
        y[:, 1:] *= 2.0
        return y, x

    y, x = overlaps(1.0)
    near = np.matmul(np.matmul(y[:, None, :], squares), x[:, :, None])[:, 0, 0]
    whole = y.sum(axis=1) * x.sum(axis=1)
    y, x = overlaps(_FARTHER)
    top = (reach[0] + 0.5) * np.sum(squares[:, -1] * x, axis=1) * y[:, -1]
    ends = (reach[1] + 0.5) * np.sum((squares[:, :, 0] + squares[:, :, -1]) * y, axis=1) * x[:, -1]
    return near, (top + ends) / (6.0 - 4.0 * hurst), whole
