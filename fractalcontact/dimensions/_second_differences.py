"""Mean square second differences along lattice directions of a surface, and their covariance.

Second differences of fractional Brownian heights are normal and stationary. The covariance of two means of
their squares is twice the sum, over all shifts between two middle points, of the squared covariance of the
differences, weighted by how often two middle points at that shift were observed. On a complete surface that
number is known; where points are missing the pairs are counted, because differences with points in common
are observed together more often than by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._variogram import SECOND, mean_increments

Array = np.ndarray[Any, np.dtype[Any]]

DIRECTIONS = 8
LAG_MULTIPLES = (1, 2, 4)
_LARGEST_COMPONENT = 8  # of a lattice direction that is near a given azimuth
_NEAR = 2.5  # degrees within which the shorter of two lattice directions is preferred
REACH = 24  # shifts along each axis that are summed one by one, or three times the longest lag
_MOST = 3.0  # largest factor on it for an anisotropic surface
_BEYOND = 1.4  # shifts beyond are about this many times as long
LONG = 32  # lags beyond which shifts and lags are taken on a coarser lattice
_TILE, _TILES = 64, 32  # edge of the tiles in which pairs are counted, and their largest number
_NEARLY = 1.25  # times the longest lag measured: lengths to which its power law is continued
_SMALLEST = 1e-6  # of the largest eigenvalue of a covariance: less is an artefact of counting


@dataclass(frozen=True)
class LatticeDirection:
    """A direction of the lattice: steps in y (not negative) and x without common divisor.

    `azimuth` is in degrees, `length` in x spacings.
    """

    dy: int
    dx: int
    azimuth: float
    length: float


def lattice_directions(azimuths: Array | None, spacing: tuple[float, float]) -> list[LatticeDirection]:
    """Return the lattice directions nearest to the azimuths (degree), or eight over the half-circle.

    `spacing` is (dy/dx, 1).
    """
    targets = np.arange(DIRECTIONS) * 180.0 / DIRECTIONS if azimuths is None else np.mod(azimuths, 180.0)
    near = 90.0 / DIRECTIONS if azimuths is None else _NEAR
    ratio = max(spacing) / min(spacing)
    limits = [int(np.ceil(_LARGEST_COMPONENT * min(max(spacing) / d, ratio))) for d in spacing]
    y, x = np.meshgrid(np.arange(limits[0] + 1), np.arange(-limits[1], limits[1] + 1), indexing="ij")
    is_direction = (np.gcd(y, x) == 1) & ((y > 0) | (x > 0))
    y, x = y[is_direction], x[is_direction]
    length = np.hypot(y * spacing[0], x * spacing[1])
    azimuth = np.degrees(np.arctan2(y * spacing[0], x * spacing[1]))
    directions = []
    for target in targets:
        angle = np.abs((azimuth - target + 90.0) % 180.0 - 90.0)
        close = angle <= max(near, angle.min()) * (1 + 1e-9)
        order = np.lexsort((np.round(angle[close], 6), np.round(length[close], 6)))
        best = np.flatnonzero(close)[order[0]]
        directions.append(
            LatticeDirection(int(y[best]), int(x[best]), float(azimuth[best]), float(length[best]))
        )
    return directions


@dataclass(frozen=True)
class SecondDifferences:
    """Mean square second differences at lag vectors.

    Attributes
    ----------
    vectors : ndarray of int, shape (k, 2)
        Lags in points along y and x.
    means, numbers : ndarray, shape (k,)
        Mean squares, and the number of differences of each.
    spacing : (dy/dx, 1)
    """

    vectors: Array
    means: Array
    numbers: Array
    spacing: tuple[float, float]

    @classmethod
    def of(
        cls, surface: Surface, directions: Sequence[LatticeDirection], scales: Scales
    ) -> tuple[SecondDifferences, Array]:
        """Measure the lags of some directions; return them with the index of the direction of each.

        Lags are 1, 2 and 4 times the step of the lattice, or of its smallest multiple inside `scales` (m),
        as far as two of them, one difference, fit into the surface.
        """
        low, high = _in_spacings(surface, scales)
        multiples = []
        for direction in directions:
            lags = _least_multiple(direction, low) * np.array(LAG_MULTIPLES)
            multiples.append(lags[lags * direction.length <= high * (1 + 1e-9)])
        return cls.at(surface, directions, multiples)

    @classmethod
    def at(
        cls, surface: Surface, directions: Sequence[LatticeDirection], multiples: Sequence[Array]
    ) -> tuple[SecondDifferences, Array]:
        """Measure multiples of the lattice step of each direction; return them with the index of it."""
        vectors = np.concatenate(
            [
                multiple[:, None] * np.array([[direction.dy, direction.dx]])
                for direction, multiple in zip(directions, multiples, strict=True)
            ]
        ).astype(np.int64)
        owners = np.repeat(np.arange(len(directions)), [multiple.size for multiple in multiples])
        inside = (2 * np.abs(vectors) < np.array(surface.shape)).all(axis=1)
        vectors, owner = vectors[inside], owners[inside]
        slabs = iter([(np.ascontiguousarray(surface.heights), surface.shape[0])])
        means, counts = mean_increments(slabs, (0, surface.shape[1]), vectors, SECOND)
        observed = counts > 0
        differences = cls(
            vectors[observed], means[observed], counts[observed].astype(float), surface.plane_spacing
        )
        return differences, owner[observed]

    def part(self, chosen: Array) -> SecondDifferences:
        """Return some of the lag vectors."""
        return SecondDifferences(self.vectors[chosen], self.means[chosen], self.numbers[chosen], self.spacing)

    @property
    def lags(self) -> Array:
        """Lag vectors in x spacings, shape (k, 2)."""
        return np.asarray(self.vectors * np.array(self.spacing))


@dataclass(frozen=True)
class EqualLags:
    """Lags of the same lengths along several directions, between those of the lattice.

    Over 1, 2 and 4 steps of the lattice a surface with noise or blur, whose power law bends, would have
    another exponent in each direction. The logarithm of the mean square at a length is interpolated, linearly
    in that of the lag, between the lattice lags on either side; a power law is reproduced exactly.

    Attributes
    ----------
    lengths : ndarray, shape (t,)
        In x spacings.
    """

    lengths: Array

    @classmethod
    def of(cls, surface: Surface, directions: Sequence[LatticeDirection], scales: Scales) -> EqualLags:
        """Return 1, 2 and 4 times the longest step of the directions, inside `scales` (m).

        The eight default directions are always among them, so that a subset of them gives the same values.
        """
        low, high = _in_spacings(surface, scales)
        every = [*directions, *lattice_directions(None, surface.plane_spacing)]
        first = max(_least_multiple(direction, low) * direction.length for direction in every)
        lengths = first * np.array(LAG_MULTIPLES, dtype=float)
        return cls(lengths[lengths <= high * (1 + 1e-9)])

    def multiples(self, direction: LatticeDirection) -> Array:
        """Return the multiples of the lattice step that enclose the lengths."""
        position = self.lengths / direction.length
        enclosing = np.floor(position * (1 + 1e-9)), np.ceil(position * (1 - 1e-9))
        return np.unique(np.concatenate(enclosing)).astype(np.int64)

    def weights(self, differences: SecondDifferences, direction: LatticeDirection) -> Array:
        """Return the weights of the measured multiples in the logarithm at each length, (t, k).

        Lengths that no two multiples enclose are left out, unless the longest is nearly as long.
        """
        multiples = np.rint(np.hypot(*differences.lags.T) / direction.length)
        rows = []
        for position in self.lengths / direction.length:
            above = int(np.searchsorted(multiples, position * (1 - 1e-9)))
            row = np.zeros(multiples.size)
            if above < multiples.size and abs(multiples[above] / position - 1.0) < 1e-9:
                row[above] = 1.0
            elif 0 < above < multiples.size or (above > 1 and position < _NEARLY * multiples[-1]):
                above = min(above, multiples.size - 1)
                low, high = np.log(multiples[above - 1 : above + 1])
                row[above] = (np.log(position) - low) / (high - low)
                row[above - 1] = 1.0 - row[above]
            else:
                continue
            rows.append(row)
        return np.array(rows).reshape(len(rows), multiples.size)


def _in_spacings(surface: Surface, scales: Scales) -> tuple[float, float]:
    low, high = (0.0, np.inf) if scales is None else scales
    return low / surface.spacing[1], high / surface.spacing[1]


def _least_multiple(direction: LatticeDirection, low: float) -> int:
    return max(1, int(np.ceil(low / direction.length * (1 - 1e-9))))


@dataclass(frozen=True)
class MiddlePairs:
    """Number of pairs of middle points of second differences at each shift.

    Attributes
    ----------
    shape : (ny, nx)
        Of the surface.
    numbers : ndarray, shape (k,)
        Middle points of each lag vector.
    counts : list of ndarray, or None
        Entry j, shape (k - j, reach_y + 1, 2 reach_x + 1): pairs of a middle point of vector j and one of
        vector i >= j, at shifts (0 ... reach_y, -reach_x ... reach_x). None on a complete surface, and where
        lags are long: differences with common points are then few among their pairs.
    """

    shape: tuple[int, int]
    numbers: Array
    counts: list[Array] | None = None

    @classmethod
    def of(cls, heights: Array, is_complete: bool, vectors: Array, numbers: Array) -> MiddlePairs:
        """Count the pairs of a surface for lag vectors (k, 2) with `numbers` of differences each."""
        shape = (heights.shape[0], heights.shape[1])
        if is_complete or np.abs(vectors).max(initial=0) > LONG:
            return cls(shape, numbers)
        return cls(shape, numbers, _counted(np.isfinite(heights), vectors, numbers))


def _reach(vectors: Array, ratio: float = 1.0) -> Array:
    """Return how many shifts along y and x are summed one by one; more at a large anisotropy ratio."""
    near = np.maximum(REACH, 3 * np.abs(vectors).max(axis=0))
    return np.asarray(np.ceil(near * min(max(ratio / 2.0, 1.0), _MOST)), dtype=np.int64)


def _counted(observed: Array, vectors: Array, numbers: Array) -> list[Array]:
    """Count pairs of middle points; on a large surface in a random sample of its tiles.

    A second difference was observed if its middle point and those one lag away on either side were.
    """
    k, (ny, nx) = len(vectors), observed.shape
    far, reach = np.abs(vectors).max(axis=0), _reach(vectors)
    edge = min(_TILE, ny), min(_TILE, nx)
    window = edge[0] + int(reach[0]), edge[1] + 2 * int(reach[1])
    torus = fft.fast_length(window[0]), fft.fast_length(window[1])
    padded = np.pad(observed, [(f + r, f + r + e) for f, r, e in zip(far, reach, edge, strict=True)])
    corners = [(y, x) for y in range(0, ny, edge[0]) for x in range(0, nx, edge[1])]
    # a random sample, which cannot be in phase with a pattern of the gaps
    sample = np.random.default_rng(0).permutation(len(corners))[:_TILES]
    first, second = np.tril_indices(k)
    total = np.zeros((first.size, torus[0], torus[1] // 2 + 1), dtype=np.complex64)
    for corner in sample:
        y, x = corners[corner][0] + far[0] + reach[0], corners[corner][1] + far[1]

        def part(dy: int, dx: int, y: int = y, x: int = x) -> Array:
            return padded[y + dy : y + dy + window[0], x + dx : x + dx + window[1]]

        middles = np.zeros((2, k, *torus), dtype=np.float32)
        for index, (dy, dx) in enumerate(vectors):
            is_middle = part(0, 0) & part(-dy, -dx) & part(dy, dx)
            middles[0, index, : window[0], : window[1]] = is_middle
            middles[1, index, : edge[0], : edge[1]] = is_middle[: edge[0], reach[1] : reach[1] + edge[1]]
        around, inside = fft.rfft2(middles)
        for index in range(k):
            total[first == index] += around[index] * np.conj(inside[: index + 1])
    counts = np.maximum(fft.irfft2(total, torus), 0.0)[:, : reach[0] + 1, : 2 * reach[1] + 1]
    sampled = counts[first == second, 0, reach[1]]
    scale = np.sqrt(np.divide(numbers, sampled, out=np.zeros(k), where=sampled > 0.5))
    counts = counts * (scale[first] * scale[second])[:, None, None]
    return [counts[second == j] for j in range(k)]


def covariance(
    vectors: Array, pairs: MiddlePairs, hurst: float, metric: Array, spacing: tuple[float, float] = (1.0, 1.0)
) -> Array:
    """Return the covariance of the logarithms of mean square second differences: shape (k, k).

    Parameters
    ----------
    vectors : ndarray of int, shape (k, 2)
    pairs : MiddlePairs
        Of these vectors.
    hurst : float
    metric : ndarray, shape (2, 2)
        Matrix M, y first: the mean square increment over h is (h' M h)^hurst.
    spacing : pair of float
        Edge of a cell along y and x.
    """
    # long lags and the shifts between them are taken on a coarser lattice
    coarse = np.maximum(-(-np.abs(vectors).max(axis=0) // LONG), 1)
    sides = (np.array(pairs.shape) - 2.0 * np.abs(vectors)) / coarse
    share_observed = pairs.numbers / np.prod(sides * coarse, axis=1)
    vectors = np.rint(vectors / coarse).astype(np.int64)
    values = np.linalg.eigvalsh(metric)
    reach = _reach(vectors, float(np.sqrt(values[1] / values[0])) if pairs.counts is None else 1.0)
    once = _variogram_differences(vectors, reach, hurst, metric, np.array(spacing) * coarse)
    far = np.abs(vectors).max(axis=0)
    rows, columns = far[0] + np.arange(reach[0] + 1)[:, None], far[1] + np.arange(2 * reach[1] + 1)
    result = np.zeros((len(vectors), len(vectors)))
    variance = np.zeros(len(vectors))
    for j, (dy, dx) in enumerate(vectors):
        part = once[j:]
        squares = (
            part[:, rows - dy, columns - dx] + part[:, rows + dy, columns + dx] - 2 * part[:, rows, columns]
        ) ** 2
        variance[j] = squares[0, 0, reach[1]]
        near, beyond, total = _complete_sums(squares, sides[j:], sides[j], reach, hurst)
        if pairs.counts is None:
            result[j:, j] = share_observed[j:] * share_observed[j] * (near + beyond) * np.prod(coarse) ** 2
        else:
            counts = pairs.counts[j]
            twice = 2.0 * np.einsum("kyx,kyx->k", squares[:, 1:], counts[:, 1:])
            near = twice + np.einsum("kx,kx->k", squares[:, 0], counts[:, 0])
            counted = 2.0 * counts[:, 1:].sum(axis=(1, 2)) + counts[:, 0].sum(axis=1)
            result[j:, j] = near + beyond * counted / total
    result *= 2.0 / np.sqrt(np.outer(variance, variance)) / np.outer(pairs.numbers, pairs.numbers)
    result = np.tril(result) + np.tril(result, -1).T
    values, basis = np.linalg.eigh(result)
    if values[0] > _SMALLEST * values[-1]:
        return result
    return np.asarray((basis * np.maximum(values, _SMALLEST * values[-1])) @ basis.T)


def _variogram_differences(
    vectors: Array, reach: Array, hurst: float, metric: Array, spacing: Array
) -> Array:
    """Return the second difference of the variogram over each lag vector at all shifts needed.

    Shape (k, reach_y + 1 + 2 far_y, 2 reach_x + 1 + 2 far_x), where far is the longest lag along an axis.
    """
    far = np.abs(vectors).max(axis=0)
    y = spacing[0] * np.arange(-2 * far[0], reach[0] + 2 * far[0] + 1)[:, None]
    x = spacing[1] * np.arange(-reach[1] - 2 * far[1], reach[1] + 2 * far[1] + 1)
    square = metric[0, 0] * y * y + 2.0 * metric[0, 1] * y * x + metric[1, 1] * x * x
    variogram = np.asarray(np.maximum(square, 0.0) ** hurst)
    tall, wide = (n - 2 * f for n, f in zip(variogram.shape, far, strict=True))

    def shifted(dy: int, dx: int) -> Array:
        return variogram[far[0] + dy : far[0] + dy + tall, far[1] + dx : far[1] + dx + wide]

    return np.stack([shifted(-dy, -dx) + shifted(dy, dx) - 2.0 * shifted(0, 0) for dy, dx in vectors])


def _complete_sums(
    squares: Array, sides: Array, side: Array, reach: Array, hurst: float
) -> tuple[Array, Array, Array]:
    """Sum squared covariances (k, y, x) over the pairs of a complete surface.

    Far from its middle a covariance decays as the shift to the power 2 hurst - 4; the sum beyond the reach
    follows from the values along its edge.

    Returns
    -------
    near, beyond, total : ndarray, shape (k,)
        The sums up to `reach` and beyond it, and the number of pairs up to `reach`.
    """
    shifts = np.arange(reach[0] + 1.0), np.abs(np.arange(-reach[1], reach[1] + 1.0))

    def overlaps(factor: float) -> tuple[Array, Array]:
        """Return the lengths that the middle points of both share along y, for both signs, and along x."""
        ours, theirs = sides[:, :, None], side[:, None]
        y, x = (
            np.maximum(
                np.minimum(np.minimum(ours, theirs), 0.5 * (ours + theirs) - factor * shift)[:, axis], 0.0
            )
            for axis, shift in enumerate(shifts)
        )
        y[:, 1:] *= 2.0
        return y, x

    y, x = overlaps(1.0)
    near = np.matmul(np.matmul(y[:, None, :], squares), x[:, :, None])[:, 0, 0]
    total = y.sum(axis=1) * x.sum(axis=1)
    y, x = overlaps(_BEYOND)
    top = (reach[0] + 0.5) * np.sum(squares[:, -1] * x, axis=1) * y[:, -1]
    ends = (reach[1] + 0.5) * np.sum((squares[:, :, 0] + squares[:, :, -1]) * y, axis=1) * x[:, -1]
    return near, (top + ends) / (6.0 - 4.0 * hurst), total
