"""The null of a set: as many cells thrown at random on what was observed.

With A observed cells, k of them in the set, a region of m cells is missed by the set with the probability
C(A - m, k) / C(A, k). Expected box counts, and their covariance over sizes, follow in closed form.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.special import gammaln

from fractalcontact.domains._masks import Array

LOOK = (2, 3, 4)  # small sizes at which a set is told from a dust
DEVIATIONS = 3.3  # about one dust in a thousand lies further out at a given size


def missed(cells: float, observed: float, region: Array) -> Array:
    """Probability that none of `cells` cells out of `observed` lies in a region of so many cells."""
    region = np.asarray(region, float)
    left = observed - cells - region
    inside = np.where(left > 0.0, region, 0.0)
    if cells <= FEW:
        order = np.arange(int(cells))
        log = np.sum(np.log1p(-inside[..., None] / (observed - order)), axis=-1)
    elif observed - cells > MANY:
        log = inside * np.log1p(-cells / observed) - _tail(observed - cells, inside) + _tail(observed, inside)
        log = np.where(left > MANY, log, _exact(cells, observed, inside))
    else:
        log = _exact(cells, observed, inside)
    return np.where(
        left > 0.0, np.exp(np.minimum(log, 0.0)), np.where(left == 0.0, _last(cells, observed), 0.0)
    )


FEW, MANY = 64, 1000


def _tail(n: float, m: Array) -> Array:
    """Return m ln n - m - ln(n! / (n - m)!), by Stirling's series."""
    rest = n - m
    return np.asarray((rest + 0.5) * np.log1p(-m / n) + m + (1.0 / rest - 1.0 / n) / 12.0)


def _exact(cells: float, observed: float, region: Array) -> Array:
    rest = np.maximum(observed - cells - region, 0.0)
    high = gammaln(observed - cells + 1.0) - gammaln(rest + 1.0)
    return np.asarray(high - gammaln(observed + 1.0) + gammaln(observed - region + 1.0))


def _last(cells: float, observed: float) -> float:
    """Probability that the set fills exactly what is outside the region."""
    return float(np.exp(gammaln(cells + 1.0) + gammaln(observed - cells + 1.0) - gammaln(observed + 1.0)))


# observed cells in a box, the share of boxes that hold so many, and the boxes on one grid that hold any
Held = tuple[Array, Array, float]


def expected(cells: float, observed: float, sizes: Array, held: Sequence[Held]) -> Array:
    """Boxes of each size that meet the dust, out of observed / size^2 boxes that hold an observed cell."""
    shares = [share @ (1.0 - missed(cells, observed, region)) for region, share, _ in held]
    return np.asarray(observed / sizes.astype(float) ** 2 * np.array(shares, float))


def covariance(cells: float, observed: float, sizes: Array, held: Sequence[Held]) -> Array:
    """Covariance of the counts at all pairs of sizes, on one grid, each small box inside a large one.

    Where boxes hold different numbers of cells the variances are theirs, and the correlations of sizes those
    of whole boxes.
    """
    area = sizes.astype(float) ** 2
    boxes = observed / area
    alone = missed(cells, observed, area)
    small, large = np.minimum(area[:, None], area), np.maximum(area[:, None], area)
    few = observed / large
    many = observed / small
    product = alone[:, None] * alone
    nested = many * (missed(cells, observed, large) - product)
    apart = (many * few - many) * (missed(cells, observed, small + large) - product)
    limit = np.sqrt(boxes[:, None] * boxes) * 0.25
    whole = np.clip(nested + apart, -limit, limit)
    if all(share.size == 1 for _, share, _ in held):
        return np.asarray(whole)
    variance = np.array([_variance(cells, observed, *one) for one in held]) * boxes**2
    least = np.diag(whole)
    ratio = np.sqrt(np.where(least > 0.0, variance / np.where(least > 0.0, least, 1.0), 0.0))
    return np.asarray(whole * ratio[:, None] * ratio)


def _variance(cells: float, observed: float, region: Array, share: Array, boxes: float) -> float:
    """Variance of the share of boxes that meet the dust, which hold different numbers of cells.

    Two boxes are missed together a little less often than by chance, by about the product of their cells
    over those left open.
    """
    alone = missed(cells, observed, region)
    away = cells / (observed * max(observed - cells, 1.0))
    return max(float(share @ (alone * (1.0 - alone)) / boxes - away * (share @ (region * alone)) ** 2), 0.0)


def spread(
    cells: float, observed: float, sizes: Array, held: Sequence[Held], counts: Array, weights: Array
) -> float:
    """Return the standard deviation of sum(weights * ln N) over dusts."""
    relative = weights / counts
    variance = float(relative @ covariance(cells, observed, sizes, held) @ relative)
    return math.sqrt(max(variance, 0.0))


def differs(cells: float, observed: float, sizes: Array, mean_counts: Array, held: Sequence[Held]) -> bool:
    """Return whether the mean counts at the smallest sizes are out of reach for a dust.

    A departure must exceed 3.3 standard deviations and one box: where hardly two cells of a dust meet,
    one pair of neighbours is no rarity.
    """
    small = np.isin(sizes, LOOK)
    if not small.any():
        return False
    sizes, mean_counts, held = sizes[small], mean_counts[small], list(itertools.compress(held, small))
    null = expected(cells, observed, sizes, held)
    deviation = np.sqrt(np.maximum(np.diag(covariance(cells, observed, sizes, held)), 0.0))
    return bool(np.any(np.abs(mean_counts - null) > DEVIATIONS * deviation + 1.0))
