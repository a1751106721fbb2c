"""The random null of a set: complete spatial randomness at equal coverage.

The null places the k cells of the set at random on the A observed cells. A region of m cells is then missed
by the set with the probability C(A - m, k) / C(A, k). Expected box counts, and their covariance over the
sizes of the box, follow in closed form. The curves of the null of the other measures stand with the measures:
`_lacunarity.py`, `_minkowski.py` and `_correlation.py`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from fractalcontact.domains._masks import Array, Planes


@dataclass(frozen=True)
class BoxContents:
    """How many observed cells the boxes of one size hold.

    `cells` are the numbers that occur, `share` the share of boxes that hold so many, and `boxes` the number
    of boxes on one grid that hold any.
    """

    cells: Array
    share: Array
    boxes: float


def miss_probability(
    cells: float,
    observed: float,
    region: Array,
    *,
    few: int = 64,  # a product of factors is exact to 1e-15; the series is off by 8e-12 (10^6 cells)
    many: int = 1000,  # Stirling's series serves: its next term, 1 / (360 n^3), is below 3e-12
) -> Array:
    """Probability that none of `cells` cells out of `observed` lies in a region of so many cells."""
    region = np.asarray(region, float)
    left = observed - cells - region
    inside = np.where(left > 0.0, region, 0.0)
    if cells <= few:
        order = np.arange(int(cells))
        log = np.sum(np.log1p(-inside[..., None] / (observed - order)), axis=-1)
    elif observed - cells > many:
        log = inside * np.log1p(-cells / observed) - _tail(observed - cells, inside) + _tail(observed, inside)
        log = np.where(left > many, log, _log_ratio(cells, observed, inside))
    else:
        log = _log_ratio(cells, observed, inside)
    return np.where(
        left > 0.0,
        np.exp(np.minimum(log, 0.0)),
        np.where(left == 0.0, _fill_probability(cells, observed), 0.0),
    )


def _tail(n: float, m: Array) -> Array:
    """Return m ln n - m - ln(n! / (n - m)!), by Stirling's series."""
    rest = n - m
    return np.asarray((rest + 0.5) * np.log1p(-m / n) + m + (1.0 / rest - 1.0 / n) / 12.0)


def _log_ratio(cells: float, observed: float, region: Array) -> Array:
    """Return ln of C(A - m, k) / C(A, k) by log-gamma functions."""
    rest = np.maximum(observed - cells - region, 0.0)
    high = gammaln(observed - cells + 1.0) - gammaln(rest + 1.0)
    return np.asarray(high - gammaln(observed + 1.0) + gammaln(observed - region + 1.0))


def _fill_probability(cells: float, observed: float) -> float:
    """Probability that the set fills exactly the cells outside the region."""
    return float(np.exp(gammaln(cells + 1.0) + gammaln(observed - cells + 1.0) - gammaln(observed + 1.0)))


def expected_counts(cells: float, observed: float, areas: Array, contents: Sequence[BoxContents]) -> Array:
    """Boxes of each area that meet the null, out of observed / area boxes that hold an observed cell."""
    shares = [of.share @ (1.0 - miss_probability(cells, observed, of.cells)) for of in contents]
    return np.asarray(observed / areas.astype(float) * np.array(shares, float))


def count_covariance(cells: float, observed: float, areas: Array, contents: Sequence[BoxContents]) -> Array:
    """Covariance of the counts at all pairs of sizes, on one grid, each small box inside a large one.

    Where boxes hold different numbers of observed cells, the variances are theirs and the correlations
    between sizes are those of full boxes.
    """
    area = areas.astype(float)
    boxes = observed / area
    alone = miss_probability(cells, observed, area)
    small, large = np.minimum(area[:, None], area), np.maximum(area[:, None], area)
    few = observed / large
    many = observed / small
    product = alone[:, None] * alone
    nested = many * (miss_probability(cells, observed, large) - product)
    apart = (many * few - many) * (miss_probability(cells, observed, small + large) - product)
    limit = np.sqrt(boxes[:, None] * boxes) * 0.25  # the greatest variance of empty or not
    of_full_boxes = np.clip(nested + apart, -limit, limit)
    if all(of.share.size == 1 for of in contents):
        return np.asarray(of_full_boxes)
    variance = np.array([_share_variance(cells, observed, of) for of in contents]) * boxes**2
    full_variance = np.diag(of_full_boxes)
    positive = full_variance > 0.0
    ratio = np.sqrt(np.where(positive, variance / np.where(positive, full_variance, 1.0), 0.0))
    return np.asarray(of_full_boxes * ratio[:, None] * ratio)


def _share_variance(cells: float, observed: float, contents: BoxContents) -> float:
    """Variance of the share of boxes that meet the null, where boxes hold different numbers of cells.

    Two boxes are missed together a little less often than if they were independent, by about the product of
    their cells over the number of empty cells.
    """
    region, share = contents.cells, contents.share
    alone = miss_probability(cells, observed, region)
    coupling = cells / (observed * max(observed - cells, 1.0))
    independent = share @ (alone * (1.0 - alone)) / contents.boxes
    return max(float(independent - coupling * (share @ (region * alone)) ** 2), 0.0)


def fit_deviation(
    cells: float,
    observed: float,
    areas: Array,
    contents: Sequence[BoxContents],
    counts: Array,
    weights: Array,
) -> float:
    """Return the standard deviation of sum(weights * ln N) over realisations of the null."""
    relative = weights / counts
    variance = float(relative @ count_covariance(cells, observed, areas, contents) @ relative)
    return math.sqrt(max(variance, 0.0))


def differs_from_null(
    cells: float,
    observed: float,
    areas: Array,
    mean_counts: Array,
    contents: Sequence[BoxContents],
    *,
    deviations: float = 3.3,  # about one null in a thousand lies further out at a given size
) -> bool:
    """Return whether the mean counts of boxes of a few cells lie outside the range of the null.

    A departure must exceed so many standard deviations and one box: where hardly two cells of the null are
    neighbours, one pair of neighbours is not significant.
    """
    if areas.size == 0:
        return False
    null = expected_counts(cells, observed, areas, contents)
    deviation = np.sqrt(np.maximum(np.diag(count_covariance(cells, observed, areas, contents)), 0.0))
    return bool(np.any(np.abs(mean_counts - null) > deviations * deviation + 1.0))


def box_contents(planes: Planes, sizes: Array) -> list[dict[int, BoxContents]]:
    """Return the contents of boxes by size, for all planes together or, with `valid`, for each plane of it.

    Boxes longer than half the shorter side are taken to hold as many times more cells than the longest of the
    others as they are larger.
    """
    if planes.valid is None:
        cells = float(np.prod(planes.grid.shape))
        areas = [(size, float(size) ** planes.rank) for size in sizes.tolist()]
        return [{size: BoxContents(np.array([area]), np.ones(1), cells / area) for size, area in areas}]
    longest = max(1, min(planes.sides) // 2)
    result = []
    for valid in planes.valid:
        usable = np.unique(np.minimum(sizes, longest)).tolist()
        values = valid if planes.rank == 2 else valid[0]
        counts = {size: count_observed(values, size, planes.periodic) for size in usable}
        contents = {}
        for size in sizes.tolist():
            counted = min(size, longest)
            numbers = np.flatnonzero(counts[counted][1:]) + 1
            boxes = counts[counted][numbers]
            total = float(max(boxes.sum(), 1))
            contents[size] = BoxContents(
                numbers * (size / counted) ** planes.rank, boxes / total, total / float(size) ** planes.rank
            )
        result.append(contents)
    return result


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
