"""Numbers of boxes that meet a set, and the dimension fitted to them; arrays in and out.

Two numbers are kept for every size. The count is of whole boxes. The measure, which is what is fitted,
counts a box cut by the edge of the mask by the part that lies inside, where the set runs on; so that a set
that fills the mask has n/s boxes along each axis and not the next whole number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fractalcontact.domains._masks import Array, Planes, together

RATIOS = (2, 3)
COVERS = ("minimum", "mean", "aligned")


def default_sizes(shape: Sequence[int]) -> Array:
    """Return the products of 2 and 3 up to the geometric mean of the cell and the extent, at least up to 9.

    Any two of them at a ratio of 2 or 3 give a local slope. None is longer than the shorter side.
    """
    ny, nx = shape
    largest = min(max(int((ny * nx) ** 0.25 + 1e-9), 9), ny, nx)
    powers = (2**i * 3**j for i in range(largest.bit_length()) for j in range(largest.bit_length()))
    return np.array(sorted(size for size in powers if size <= largest), np.int64)


@dataclass(frozen=True)
class Curve:
    """Count and measure of the boxes, each of shape (planes, sizes)."""

    sizes: Array
    count: Array
    area: Array  # of the boxes that meet the set, in cells

    @property
    def measure(self) -> Array:
        """Boxes that meet the set, those cut by the edge by their part inside."""
        return np.asarray(self.area / self.sizes.astype(float) ** 2)


def minimum_cover(planes: Planes, sizes: Array) -> Curve:
    """Fewest boxes over all offsets of the grid."""
    from fractalcontact.domains._kernels import cover

    wraps = planes.grid.periodic

    def smallest(task: tuple[Array, int]) -> tuple[int, int]:
        cells, size = task
        count, _, area, _ = cover(cells, size, *wraps)
        return count, area

    tasks = [(cells, int(size)) for cells in planes.cells for size in sizes]
    found = np.array(together(smallest, tasks), np.int64).reshape(planes.count, sizes.size, 2)
    return Curve(sizes, found[..., 0], found[..., 1].astype(float))


def mean_cover(planes: Planes, sizes: Array) -> Curve:
    """Number of boxes averaged over all offsets of the grid.

    The mean has a measure of its own: boxes that hang over opposite edges by the same cut count once.
    """
    from fractalcontact.domains import _mean_kernels

    wraps = planes.grid.periodic
    largest = int(sizes.max())
    pairs = together(lambda cells: _mean_kernels.mean_cover(cells, largest, *wraps), planes.cells)
    whole, folded = (np.array([pair[kind][sizes] for pair in pairs], float) for kind in (0, 1))
    return Curve(sizes, whole / sizes.astype(float) ** 2, folded)


def aligned_cover(planes: Planes, sizes: Array) -> Curve:
    """Boxes of the one grid that starts at the first cell."""
    from fractalcontact.domains._mean_kernels import coarsen

    def counts(cells: Array) -> list[int]:
        levels = {1: cells}
        for size in map(int, sizes):
            finest = max(known for known in levels if size % known == 0)
            levels[size] = levels[finest] if finest == size else coarsen(levels[finest], size // finest)
        return [int(np.count_nonzero(levels[int(size)].view(np.bool_))) for size in sizes]

    found = np.array(together(counts, planes.cells), np.int64).reshape(planes.count, sizes.size)
    return Curve(sizes, found, found * sizes.astype(float) ** 2)


def curve(planes: Planes, sizes: Array, cover: str) -> Curve:
    """Return the curve of the named cover, its measure made up for cells that were not observed.

    The measure is divided by the share of the boxes' area that was observed, where the boxes are those that
    hold an observed cell; a set that fills what was observed then has the dimension 2.
    """
    by_name = {"minimum": minimum_cover, "mean": mean_cover, "aligned": aligned_cover}
    found = by_name[cover](planes, sizes)
    if planes.valid is None:
        return found
    everything = Planes(planes.valid, None, planes.grid, (), (), {}, {})
    seen = by_name[cover](everything, sizes).area
    return Curve(
        sizes, found.count, found.area * everything.occupied[:, None] / np.where(seen > 0, seen, np.nan)
    )


@dataclass(frozen=True)
class Fit:
    """A dimension, the standard deviation of the local slopes it rests on, and d dimension / d ln N."""

    dimension: float
    spread: float
    weights: Array


def regression(sizes: Array, measure: Array) -> Fit:
    """Ordinary least squares of ln N on ln s; the spread is that of the slopes between neighbouring sizes."""
    if sizes.size < 2 or not np.all(measure > 0):
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    slope, spread, weights = line(np.log(sizes), np.log(measure))
    return Fit(0.0 - float(slope), float(spread), -weights)


def line(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the least-squares slope, the spread of the slopes from point to point, and d slope / d y.

    `y` has the points on its last axis; leading axes are free. Two points have no spread (NaN).
    """
    centred = x - x.mean()
    weights = centred / (centred @ centred)
    slope = (y - y[..., :1]) @ weights
    steps = np.diff(x)
    local = np.diff(y, axis=-1) / steps
    if x.size < 3:
        return slope, np.full(slope.shape, np.nan), weights
    spread = np.sqrt((local - slope[..., None]) ** 2 @ (steps / steps.sum()))
    return slope, spread, weights


def steady(sizes: Array, area: Array) -> Fit:
    """Mean local slope over a fixed ratio of sizes, for the ratio over which it is steadiest.

    A set built by a fixed ratio has counts that swing about their power law with that period; over the
    ratio itself, and over it alone, the local slope does not swing. The slopes of each ratio weigh by the
    inverse square of their variance. `area` is that of the boxes, N s^2, so that whole slopes are exact.
    """
    if not np.all(area > 0):
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    place = {int(size): index for index, size in enumerate(sizes)}
    slopes, variances, weights = [], [], []
    for ratio in RATIOS:
        pairs = [(i, place[ratio * size]) for size, i in place.items() if ratio * size in place]
        if pairs:
            low, high = np.array(pairs).T
            local = np.log(ratio**2 * area[low] / area[high]) / np.log(ratio)
            slopes.append(float(local.mean()))
            variances.append(float(local.var()))
            weight = np.zeros(sizes.size)
            np.add.at(weight, low, 1.0 / (np.log(ratio) * low.size))
            np.add.at(weight, high, -1.0 / (np.log(ratio) * low.size))
            weights.append(weight)
    if not slopes:
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    dimension, spread, share = blend(slopes, variances)
    return Fit(dimension, spread, share @ np.array(weights))


def blend(slopes: Sequence[float], variances: Sequence[float]) -> tuple[float, float, Array]:
    """Average estimates by the inverse square of their variances; return mean, spread and shares."""
    slope, variance = np.array(slopes), np.array(variances)
    relative = (variance + TINY) / (variance + TINY).min()
    share = relative**-2.0
    share = share / share.sum()
    mean = float(slope[0] + share @ (slope - slope[0]))
    return mean, float(np.sqrt(share @ (variance + (slope - mean) ** 2))), share


TINY = 1e-24  # variance of slopes that differ by rounding alone


def estimate(sizes: Array, fewest: Array, mean: Array, cover: str) -> tuple[float, float]:
    """Return the dimension and the half-width of its interval, from the areas of both covers.

    The fewest boxes are exact for sets on a lattice and rise too fast, towards small sizes, for curves that
    lie across it; the mean number errs the other way and less. Where the mean is the steadier of the two
    both count alike, elsewhere the fewest boxes by their steadiness.
    """
    first, second = steady(sizes, fewest), steady(sizes, mean)
    if not (np.isfinite(first.dimension) and np.isfinite(second.dimension)):
        return first.dimension if cover == "minimum" else second.dimension, np.nan
    variance = first.spread**2, max(first.spread, second.spread) ** 2
    both, spread, _ = blend((first.dimension, second.dimension), variance)
    if cover == "minimum":
        return both, 2.0 * spread
    return second.dimension, 2.0 * float(np.hypot(second.spread, second.dimension - both))
