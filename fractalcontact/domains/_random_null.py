"""The random null of a set: complete spatial randomness at equal coverage.

The null places the k cells of the set at random on the A observed cells. A region of m cells is then missed
by the set with the probability q(m) = C(A - m, k) / C(A, k), and two regions of a and b cells that share o of
them with the probability q(a + b - o). Expected box counts, and their covariance over the sizes of the box,
are sums of these over the boxes and over all pairs of boxes. The curves of the null of the other measures
stand with the measures: `_lacunarity.py`, `_minkowski.py` and `_correlation.py`.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce

import numpy as np

from fractalcontact.domains._aligned_boxes import joined_boxes
from fractalcontact.domains._masks import Array, Planes

LEAST_LOG = -700.0  # of a probability: float64 ends at exp(-745), and the product of two is 0
# pairs of boxes: the observed cells of one, of the other, those they share, and the number of such pairs
Pairs = tuple[Array, Array, Array, Array]


@dataclass(frozen=True)
class BoxContents:
    """How many observed cells the boxes of one size hold.

    `cells` are the numbers that occur, `share` the share of boxes that hold so many, `boxes` the number of
    boxes on one grid that hold any, and `measure` what all of them count as in `box_measure`.
    """

    cells: Array
    share: Array
    boxes: float
    measure: float


class RandomCells:
    """k cells at random on A observed ones, and the probability q(m) that a region of m of these has none."""

    def __init__(self, cells: float, observed: float, largest: float) -> None:
        """Tabulate ln q(m) for m = 0, 1, ... up to the cells of the `largest` region.

        The region is filled cell by cell: the next one is empty with 1 - k / (A - m). A sum of these
        logarithms keeps the digits of q(a + b) - q(a) q(b), a small difference of which there is one for each
        pair of boxes.
        """
        # of boxes that are apart, q(a + b) - q(a) q(b) is about -a q(a) b q(b) times this
        self.coupling = cells / max(observed * (observed - cells), observed, 1.0)
        # ln q(m) <= -k m / A, so that further values are below `LEAST_LOG`
        count = np.ceil(min(largest, observed, -LEAST_LOG * observed / max(cells, 1.0)))
        left = observed - np.arange(count)
        steps = np.log1p(-cells / left, out=np.full(left.size, LEAST_LOG), where=left > cells)
        self._log = np.maximum(np.insert(np.cumsum(steps), 0, 0.0), LEAST_LOG)
        self._miss = np.exp(self._log)

    def miss(self, region: Array) -> Array:
        """Return q of regions of so many cells, integers."""
        return np.asarray(self._miss[np.minimum(region, self._miss.size - 1)])

    def log_miss(self, region: Array) -> Array:
        """Return ln q of regions of so many cells, integers."""
        return np.asarray(self._log[np.minimum(region, self._log.size - 1)])

    def both_empty(self, first: Array, second: Array, shared: Array) -> Array:
        """Return the covariance of two regions being empty, q(a + b - o) - q(a) q(b)."""
        apart = self.log_miss(first) + self.log_miss(second)
        return np.asarray(np.exp(apart) * np.expm1(self.log_miss(first + second - shared) - apart))

    def share_variance(self, contents: BoxContents) -> float:
        """Return the variance of the share of boxes of one grid that meet the set.

        Two boxes are missed together a little less often than if they were independent, see `coupling`.
        """
        region, share = contents.cells, contents.share
        alone = self.miss(region)
        independent = np.sum(share * alone * (1.0 - alone)) / contents.boxes
        return max(float(independent - self.coupling * np.sum(share * region * alone) ** 2), 0.0)

    def expected_counts(self, contents: Sequence[BoxContents]) -> Array:
        """Return the boxes of each size that meet the set."""
        # no product of vectors, the last digits of which depend on the threads of BLAS
        met = [of.measure * np.sum(of.share * (1.0 - self.miss(of.cells))) for of in contents]
        return np.array(met, float)


def miss_probability(cells: float, observed: float, region: Array) -> Array:
    """Probability that none of `cells` cells out of `observed` lies in a region of so many cells."""
    return RandomCells(cells, observed, float(region.max())).miss(region)


def any_place(n: int, first: int, second: int) -> Pairs:
    """Pair the boxes of two sizes at all places of an axis that is closed to a circle, once for each grid."""
    a, b = min(first, n), min(second, n)
    ahead = np.arange(n)  # of the second box
    shared = np.maximum(np.minimum(a, ahead + b) - ahead, 0) + np.maximum(ahead + b - n, 0).clip(max=a)
    cells, number = np.unique(shared, return_counts=True)
    return np.array(a), np.array(b), cells, number * (n / (first * second))


def aligned(n: int, first: int, second: int) -> Pairs:
    """Pair the boxes of two sizes on the grids that start at the first cell; the last ones are cut."""
    start = np.union1d(np.arange(0, n, first), np.arange(0, n, second))  # of the part in one box of each
    shared = np.diff(start, append=n)
    a, b = (np.minimum(size, n - start // size * size) for size in (first, second))
    of_first, of_second = ([(size, n // size), (n % size, int(n % size > 0))] for size in (first, second))
    counts = Counter(zip(a.tolist(), b.tolist(), shared.tolist(), strict=True))
    for (a_cells, a_boxes), (b_cells, b_boxes) in itertools.product(of_first, of_second):
        if a_boxes * b_boxes > 0:
            counts[a_cells, b_cells, 0] = a_boxes * b_boxes - int(np.sum((a == a_cells) & (b == b_cells)))
    *pairs, number = np.array([(*pair, number) for pair, number in counts.items()]).T
    return (*pairs, number.astype(float))


class PairsInGaps:
    """Overlapping boxes of two sizes on a plane (ny, nx) with gaps: those of aligned grids, or some for all.

    Of boxes at all places, on the plane closed to a torus, `of_each` stand for all that hold as many observed
    cells, in `most_numbers` classes at most. Beside each the other box stands at `most_offsets` along an
    axis. On 8 planes with .3 or .4 of their cells missing, in patches or one by one, at coverages of .02 to
    .7, the deviation of the dimension was .99 to 1.20 times that of 300 realisations, .90 to 1.34 with free
    edges (once 1.6), and .94 to 1.35 on aligned grids.
    """

    most_offsets, most_numbers, of_each = 9, 40, 8
    most_places = 1 << 16  # of larger planes so many are drawn, always the same

    def __init__(self, valid: Array, rank: int, longest: int) -> None:
        self.shape, self.rank = valid.shape, rank
        continued = np.pad(valid, [(0, edge) for edge in self._box(longest)], mode="wrap")
        self._sums = np.pad(continued.astype(np.int32).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
        self._chosen = cache(self._choose)

    def _box(self, size: int) -> tuple[int, int]:
        ny, nx = self.shape
        return min(size, ny) if self.rank == 2 else 1, min(size, nx)

    def _observed(self, low: Sequence[Array], high: Sequence[Array]) -> Array:
        """Return the observed cells of regions from `low` up to `high`, (y, x), which may begin anywhere."""
        (y, x), (ny, nx) = low, self.shape
        top, left = y % ny, x % nx
        bottom, right = top + np.maximum(high[0] - y, 0), left + np.maximum(high[1] - x, 0)
        sums = self._sums
        return np.asarray(sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left])

    def aligned(self, first: int, second: int) -> Pairs:
        """Return the pairs of boxes of the grids that start at the first cell."""
        box, other, starts = self._box(first), self._box(second), []
        for n, edges in zip(self.shape, zip(box, other, strict=True), strict=True):
            starts.append(np.union1d(*(np.arange(0, n, edge) for edge in edges)))
        ends = [np.append(start[1:], n) for start, n in zip(starts, self.shape, strict=True)]
        low, high = np.meshgrid(*starts, indexing="ij"), np.meshgrid(*ends, indexing="ij")
        a, b = (self._observed(*self._box_around(low, edges)) for edges in (box, other))
        return _overlapping(a, b, self._observed(low, high), np.ones(low[0].shape))

    def _box_around(self, low: Sequence[Array], edges: tuple[int, int]) -> tuple[list[Array], list[Array]]:
        begin = [start // edge * edge for start, edge in zip(low, edges, strict=True)]
        end = [np.minimum(at + e, n) for at, e, n in zip(begin, edges, self.shape, strict=True)]
        return begin, end

    def any_place(self, first: int, second: int) -> Pairs:
        """Return the pairs of a box at any place and a box that is no larger."""
        box, other = self._box(first), self._box(second)
        y, x, stands_for = (values[:, None, None] for values in self._chosen(box))
        (dy, many_y), (dx, many_x) = map(self._offsets, box, other)
        top, left = y + dy[:, None], x + dx
        a = self._observed((y, x), (y + box[0], x + box[1]))
        b = self._observed((top, left), (top + other[0], left + other[1]))
        low = np.maximum(y, top), np.maximum(x, left)
        high = np.minimum(y + box[0], top + other[0]), np.minimum(x + box[1], left + other[1])
        grids = float(np.prod(box) * np.prod(other))  # offsets of both grids
        return _overlapping(a, b, self._observed(low, high), stands_for * (many_y * many_x / grids))

    def _choose(self, box: tuple[int, int]) -> tuple[Array, Array, Array]:
        """Return y and x of some boxes, and how many each stands for."""
        total = self.shape[0] * self.shape[1]
        places = np.arange(total)
        if total > self.most_places:
            places = np.random.default_rng(0).integers(total, size=self.most_places)
        y, x = np.divmod(places, self.shape[1])
        numbers, kind = np.unique(self._observed((y, x), (y + box[0], x + box[1])), return_inverse=True)
        group = (np.arange(numbers.size) * min(self.most_numbers, numbers.size) // numbers.size)[kind]
        order, members = np.argsort(group, kind="stable"), np.bincount(group)
        first, some = np.cumsum(members) - members, np.minimum(members, self.of_each)
        parts = [order[at + np.arange(k) * n // k] for at, n, k in zip(first, members, some, strict=True)]
        chosen = np.concatenate(parts)
        stands_for = np.repeat(members / some, some) * (total / places.size)
        return y[chosen], x[chosen], stands_for

    def _offsets(self, edge: int, other: int) -> tuple[Array, float]:
        """Return the offsets of the other box at which it overlaps, and how many each stands for."""
        every = np.arange(1 - other, edge)
        if every.size <= self.most_offsets:
            return every, 1.0
        places = (np.arange(self.most_offsets) + 0.5) * every.size / self.most_offsets
        return every[places.astype(np.int64)], every.size / self.most_offsets


def _overlapping(a: Array, b: Array, shared: Array, number: Array) -> Pairs:
    pairs = np.broadcast_arrays(a, b, shared, number)
    a, b, shared, number = (values[pairs[2] > 0] for values in pairs)
    return a, b, shared, number


def dimension_deviation(
    dimension: Callable[[Array], float], sizes: Array, counts: Array, knots: Array, covariance: Array
) -> float:
    """Return the standard deviation of the dimension that a fit finds in realisations of the null.

    `covariance` is that of the counts at the sizes of index `knots`; between them deviations of ln N are
    interpolated over ln s. The fit is made one standard deviation away along each principal axis of the
    deviations: the weights of a fit may depend on the counts themselves.
    """
    expected = counts[knots]
    variances, axes = np.linalg.eigh(covariance / np.multiply.outer(expected, expected))
    deviations = axes.T * np.sqrt(np.maximum(variances, 0.0))[:, None]
    undisturbed, differences = dimension(counts), []
    for deviation in deviations:
        ratio = np.exp(np.interp(np.log(sizes), np.log(sizes[knots]), deviation))
        differences.append(dimension(counts * ratio) - undisturbed)
    return float(np.linalg.norm(differences))


def differs_from_null(mean_counts: Array, null: Array, covariance: Array) -> bool:
    """Return whether the mean counts of boxes of a few cells lie outside the range of the null.

    A departure must exceed some standard deviations and one box: where hardly two cells of the null are
    neighbours, one pair of neighbours is not significant.
    """
    deviations = 3.3  # about one null in a thousand lies further out at a given size
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return bool(np.any(np.abs(mean_counts - null) > deviations * deviation + 1.0))


class NullBoxes:
    """The boxes of a cover on one plane, whatever the cells of the null: contents by size, and pairs."""

    def __init__(self, planes: Planes, plane: int, sizes: Array, cover: str) -> None:
        self.sides, self.has_gaps, is_aligned = planes.sides, planes.valid is not None, cover == "aligned"
        self.of_full_boxes = not (is_aligned or self.has_gaps)  # at free edges boxes at any place are cut
        longest = max(1, min(planes.sides) // 2)
        along = cache(aligned if is_aligned else any_place)

        def on_all_axes(first: int, second: int) -> Pairs:
            axes = [along(n, first, second) for n in self.sides]
            a, b, shared, number = (reduce(np.multiply.outer, values) for values in zip(*axes, strict=True))
            return a, b, shared, number

        if planes.valid is None:
            contents = [_full_contents(planes, size, longest, cover) for size in sizes.tolist()]
            self.pairs = on_all_axes
        else:
            valid, observed = planes.valid[plane], int(planes.observed[plane])
            if is_aligned:
                contents = _aligned_contents_in_gaps(valid, planes.rank, observed, sizes)
            else:
                contents = _contents_in_gaps(valid, planes.periodic, observed, sizes, longest)
            in_gaps = PairsInGaps(valid, planes.rank, int(sizes.max(initial=1)))
            self.pairs = cache(in_gaps.aligned if is_aligned else in_gaps.any_place)
        self.contents = dict(zip(sizes.tolist(), contents, strict=True))

    def expected_counts(self, null: RandomCells, sizes: Array) -> Array:
        """Return the boxes of each size that meet the null."""
        return null.expected_counts([self.contents[size] for size in sizes.tolist()])

    def covariance(self, null: RandomCells, sizes: Array) -> Array:
        """Return the covariance of the counts at all pairs of ascending sizes.

        Exact without gaps on a periodic plane and on aligned grids. At free edges, where boxes at any place
        hold different numbers of cells, the covariances of full boxes are scaled by what that changes in the
        variances on one grid; the deviation of a dimension is then off by less than 10 %. In gaps boxes that
        do not overlap are taken together, see `coupling`.
        """
        contents = [self.contents[size] for size in sizes.tolist()]
        areas = np.array([np.prod(np.minimum(size, self.sides)) for size in sizes], np.int64)
        scatters = null.log_miss(areas) > -60.0  # else 10^6 boxes have a standard deviation of 10^-7 at most
        sums = [of.boxes * float(np.sum(of.share * of.cells * null.miss(of.cells))) for of in contents]
        covariance = np.zeros((sizes.size, sizes.size))
        for i, first in enumerate(sizes.tolist()):
            for j, second in enumerate(sizes[: i + 1].tolist()):
                if self.of_full_boxes and not (scatters[i] and scatters[j]):
                    continue
                a, b, shared, number = self.pairs(first, second)
                value = np.sum(number * null.both_empty(a, b, shared))
                if self.has_gaps:
                    overlapping = np.sum(number * (a * null.miss(a) * b * null.miss(b)))
                    value -= null.coupling * (sums[i] * sums[j] - overlapping)
                covariance[i, j] = covariance[j, i] = value
        scale = np.array([of.measure / of.boxes for of in contents])
        if self.of_full_boxes:
            for i, (of, area) in enumerate(zip(contents, areas, strict=True)):
                full = null.share_variance(replace(of, cells=np.array([area]), share=np.ones(1)))
                scale[i] = np.sqrt(null.share_variance(of) / full) if full > 0.0 else 1.0
        return np.asarray(covariance * scale[:, None] * scale)


def _contents_in_gaps(
    valid: Array, periodic: Sequence[bool], observed: int, sizes: Array, longest: int
) -> list[BoxContents]:
    """Return the contents of the boxes of each size.

    Boxes longer than `longest` are taken to hold as many times more cells than those as they are larger.
    """
    rank = len(periodic)
    values = valid if rank == 2 else valid[0]
    contents = []
    for size in sizes.tolist():
        counted, area = min(size, longest), float(size) ** rank
        counts = count_observed(values, counted, periodic)
        numbers = np.flatnonzero(counts[1:]) + 1
        total = float(max(counts[numbers].sum(), 1))
        cells = np.rint(numbers * (size / counted) ** rank).astype(np.int64)
        contents.append(BoxContents(cells, counts[numbers] / total, total / area, observed / area))
    return contents


def _aligned_contents_in_gaps(valid: Array, rank: int, observed: int, sizes: Array) -> list[BoxContents]:
    """Return the contents of the boxes of each size on the grid that starts at the first cell."""
    contents = []
    for size, inside in zip(sizes.tolist(), joined_boxes(valid.astype(np.int64), sizes, np.add), strict=True):
        counts = np.bincount(inside.ravel())
        cells = np.flatnonzero(counts[1:]) + 1
        boxes = float(max(counts[cells].sum(), 1))
        contents.append(BoxContents(cells, counts[cells] / boxes, boxes, observed / float(size) ** rank))
    return contents


def _full_contents(planes: Planes, size: int, longest: int, cover: str) -> BoxContents:
    """Return the contents of boxes where all was observed; those longer than `longest` count as full."""
    most = 64  # cuts that stand for all: counts of boxes of 65 to 250 cells change by up to 4e-4
    if cover == "aligned":
        places = [np.arange(0, n, size) for n in planes.sides]
        cells = [np.minimum(size, n - start) for n, start in zip(planes.sides, places, strict=True)]
        inside = reduce(np.multiply.outer, cells).ravel()
        number = np.ones(inside.size)
        measure = float(inside.size)
    else:
        lengths, numbers = [], []
        for n, wraps in zip(planes.sides, planes.periodic, strict=True):
            # at a free edge boxes that hang over opposite edges by the same cut count once
            cuts = 0 if wraps or size > longest else size - 1
            cut = np.arange(1, cuts + 1)
            if cuts > most:
                cut = np.unique(np.rint(np.geomspace(1, cuts, most))).astype(np.int64)
            # each stands for those that are nearest to it
            ends = np.concatenate([[0], (cut[1:] + cut[:-1]) // 2, [cuts]]) if cuts else [0]
            lengths.append(np.append(size, 2 * cut))
            numbers.append(np.append(n - cuts, np.diff(ends)))
        inside, number = (reduce(np.multiply.outer, values).ravel() for values in (lengths, numbers))
        measure = float(np.prod(planes.sides)) / float(size) ** planes.rank
    by_cells = np.bincount(inside, number)
    occurring = np.flatnonzero(by_cells)
    return BoxContents(occurring, by_cells[occurring] / number.sum(), measure, measure)


def count_observed(valid: Array, size: int, periodic: Sequence[bool]) -> Array:
    """Count the positions of the box by the observed cells it holds, (cells of the box + 1,).

    On a free axis boxes that hang over opposite edges by the same cut count once, with the cells of both;
    no axis is shorter than `2 size`.
    """
    sums = valid.astype(np.int32)
    for axis, (n, wraps) in enumerate(zip(valid.shape, periodic, strict=True)):
        total = np.insert(np.cumsum(sums, axis), 0, 0, axis)
        cut = np.arange(1, size)
        low = np.take(total, cut, axis)
        high = np.take(total, [n], axis) - np.take(total, cut + n - size if wraps else n - cut, axis)
        inside = np.take(total, np.arange(size, n + 1), axis) - np.take(total, np.arange(n - size + 1), axis)
        sums = np.concatenate([inside, low + high], axis)
    return np.bincount(sums.ravel(), minlength=size**valid.ndim + 1)
