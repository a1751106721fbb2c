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
from functools import reduce

import numpy as np

from fractalcontact.domains._masks import Array, Planes

LEAST_LOG = -700.0  # of a probability: float64 ends at exp(-745), and the product of two is 0
# Pairs of boxes along an axis: the cells of one, of the other, the cells they share, and the number of pairs.
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
        self.cells, self.observed = cells, observed
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

        Two boxes are missed together a little less often than if they were independent, by about the product
        of their cells over the number of empty cells.
        """
        region, share = contents.cells, contents.share
        alone = self.miss(region)
        coupling = self.cells / (self.observed * max(self.observed - self.cells, 1.0))
        independent = share @ (alone * (1.0 - alone)) / contents.boxes
        return max(float(independent - coupling * (share @ (region * alone)) ** 2), 0.0)

    def expected_counts(self, contents: Sequence[BoxContents]) -> Array:
        """Return the boxes of each size that meet the set."""
        met = [of.measure * (of.share @ (1.0 - self.miss(of.cells))) for of in contents]
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
    return np.full(cells.size, a), np.full(cells.size, b), cells, number * (n / (first * second))


def aligned(n: int, first: int, second: int) -> Pairs:
    """Pair the boxes of two sizes on the grids that start at the first cell; the last ones are cut."""
    start = np.union1d(np.arange(0, n, first), np.arange(0, n, second))  # of the part in one box of each
    shared = np.diff(start, append=n)
    a, b = (np.minimum(size, n - start // size * size) for size in (first, second))
    of_one, of_other = ([(size, n // size), (n % size, int(n % size > 0))] for size in (first, second))
    counts = Counter(zip(a.tolist(), b.tolist(), shared.tolist(), strict=True))
    for (one, boxes), (other, others) in itertools.product(of_one, of_other):
        if boxes * others > 0:
            counts[one, other, 0] = boxes * others - int(np.sum((a == one) & (b == other)))
    *pairs, number = np.array([(*pair, number) for pair, number in counts.items()]).T
    return (*pairs, number.astype(float))


def count_covariance(
    null: RandomCells,
    shape: Sequence[int],
    sizes: Array,
    contents: Sequence[BoxContents],
    pairs_of: Callable[[int, int, int], Pairs] = any_place,
    *,
    never_empty: float = -60.0,  # ln q: 10^6 boxes have a standard deviation of 10^-7 at most
) -> Array:
    """Covariance of the counts at all pairs of sizes; of counts averaged over the offsets with `any_place`.

    Exact on a periodic plane and on aligned grids of planes without gaps. Where boxes of one size hold
    different numbers of observed cells, at free edges or in gaps, the covariances of full boxes are scaled by
    what that changes in the variances on one grid. Free edges then change the deviation of a dimension by
    less than 10 %; where .4 of the cells are not observed, in patches, it is .6 to 1.7 times the true one.
    """
    share = null.observed / float(np.prod(shape))
    areas = np.array([np.prod(np.minimum(size, shape)) for size in sizes])
    scatters = null.log_miss(areas) > never_empty
    covariance = np.zeros((sizes.size, sizes.size))
    for i, first in enumerate(sizes.tolist()):
        for j, second in enumerate(sizes[: i + 1].tolist()):
            if not (pairs_of is aligned or (scatters[i] and scatters[j])):
                continue
            axes = [pairs_of(n, first, second) for n in shape]
            a, b, shared, number = (reduce(np.multiply.outer, parts) for parts in zip(*axes, strict=True))
            value = float(np.sum(number * null.both_empty(a, b, shared)))
            if share < 1.0:
                # as many pairs overlap for each observed cell, and fewer are apart
                apart = float(null.both_empty(areas[i], areas[j], np.zeros((), int)))
                value = share * (value + (share - 1.0) * number.sum() * apart)
            covariance[i, j] = covariance[j, i] = value
    if pairs_of is aligned and share == 1.0:
        return covariance
    ratio = np.ones(sizes.size)
    for i, (of, area) in enumerate(zip(contents, areas, strict=True)):
        full = null.share_variance(replace(of, cells=np.array([area]), share=np.ones(1)))
        if full > 0.0:
            ratio[i] = np.sqrt(null.share_variance(of) / full)
    return np.asarray(covariance * ratio[:, None] * ratio)


def dimension_deviation(
    dimension: Callable[[Array], float], sizes: Array, counts: Array, knots: Array, covariance: Array
) -> float:
    """Return the standard deviation of the dimension that a fit finds in realisations of the null.

    `covariance` is that of the counts at the sizes of index `knots`; between them deviations of ln N are
    interpolated over ln s. The fit is made one standard deviation to either side along each principal axis
    of the deviations: the weights of a fit may depend on the counts themselves.
    """
    expected = counts[knots]
    variances, axes = np.linalg.eigh(covariance / np.multiply.outer(expected, expected))
    deviations = axes.T * np.sqrt(np.maximum(variances, 0.0))[:, None]
    half_differences = []
    for deviation in deviations:
        ratio = np.exp(np.interp(np.log(sizes), np.log(sizes[knots]), deviation))
        half_differences.append(0.5 * (dimension(counts * ratio) - dimension(counts / ratio)))
    return float(np.linalg.norm(half_differences))


def differs_from_null(
    mean_counts: Array,
    null: Array,
    covariance: Array,
    *,
    deviations: float = 3.3,  # about one null in a thousand lies further out at a given size
) -> bool:
    """Return whether the mean counts of boxes of a few cells lie outside the range of the null.

    A departure must exceed so many standard deviations and one box: where hardly two cells of the null are
    neighbours, one pair of neighbours is not significant.
    """
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return bool(np.any(np.abs(mean_counts - null) > deviations * deviation + 1.0))


def box_contents(planes: Planes, sizes: Array, cover: str) -> list[dict[int, BoxContents]]:
    """Return the contents of boxes by size, for all planes together or, with `valid`, for each plane of it.

    Boxes longer than half the shorter side are taken to be full or, with `valid`, to hold as many times more
    cells than the longest of the others as they are larger.
    """
    longest = max(1, min(planes.sides) // 2)
    if planes.valid is None:
        return [{size: _full_contents(planes, size, longest, cover) for size in sizes.tolist()}]
    result = []
    for valid, observed in zip(planes.valid, planes.observed.tolist(), strict=False):
        usable = np.unique(np.minimum(sizes, longest)).tolist()
        values = valid if planes.rank == 2 else valid[0]
        counts = {size: count_observed(values, size, planes.periodic) for size in usable}
        contents = {}
        for size in sizes.tolist():
            counted, area = min(size, longest), float(size) ** planes.rank
            numbers = np.flatnonzero(counts[counted][1:]) + 1
            boxes = counts[counted][numbers]
            total = float(max(boxes.sum(), 1))
            contents[size] = BoxContents(
                np.rint(numbers * (size / counted) ** planes.rank).astype(np.int64),
                boxes / total,
                total / area,
                observed / area,
            )
        result.append(contents)
    return result


def _full_contents(planes: Planes, size: int, longest: int, cover: str) -> BoxContents:
    """Return the contents of the boxes of a plane that was observed completely."""
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
            cut = np.arange(1, 1 if wraps or size > longest else size)
            lengths.append(np.append(size, 2 * cut))
            numbers.append(np.append(n - cut.size, np.ones(cut.size)))
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
