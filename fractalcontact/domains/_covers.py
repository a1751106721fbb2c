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

    def fewest(task: tuple[Array, int]) -> tuple[int, int]:
        count, area = every_offset(task[0], task[1], planes.grid.periodic)
        return int(count.min()), int(area.min())

    tasks = [(cells, int(size)) for cells in planes.cells for size in sizes]
    found = np.array(together(fewest, tasks), np.int64).reshape(planes.count, sizes.size, 2)
    return Curve(sizes, found[..., 0], found[..., 1].astype(float))


def every_offset(cells: Array, size: int, periodic: Sequence[bool]) -> tuple[Array, Array]:
    """Return the boxes that meet the set, and their area in cells, for every offset of the grid (y, x)."""
    from fractalcontact.domains._kernels import cover

    nx = cells.shape[1]
    rows, across = (bands(n, size, wraps) for n, wraps in zip(cells.shape, periodic, strict=True))
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]  # each follows from the one before
    whole = across[:, 1] - across[:, 0] == size
    count, area = np.zeros((2, size, size), np.int64)
    held = np.zeros((2, 2), np.int64)
    columns = np.zeros((3, nx), np.int32)
    prefix = np.zeros((2, nx + 1 + (2 * size if periodic[1] else 0)), np.int32)
    met, lost = np.zeros((2, size, int(whole.sum())), np.int32)
    cover(cells, size, rows, across[~whole], held, columns, prefix, met, lost, count, area)
    count += _by_offset(met, size)
    area += size * (size * _by_offset(met, size) - _by_offset(lost, size))
    return count, area


def _by_offset(values: Array, size: int) -> Array:
    """Add up the positions of boxes that belong to the same offset in x."""
    ends = -values.shape[1] % size
    padded = np.pad(values, ((0, 0), (0, ends)))
    return np.asarray(padded.reshape(size, -1, size).sum(1, dtype=np.int64))


def bands(n: int, size: int, wraps: bool) -> Array:
    """Cut an axis of n cells into bands of `size`, for every offset of the grid.

    Each row is (start, stop, start and stop with the bands beside it, offset). Whole bands come first, in
    order. On a free axis the bands at the ends are cut; on a periodic one there is a remainder between the
    last band and the first, where starts and stops may lie beyond n. Neighbours are given for cut bands only.
    """
    start = np.arange(n // size * size if wraps else n - size + 1)
    whole = np.stack([start, start + size, 0 * start, 0 * start, start % size], axis=-1)
    if wraps:
        offset = np.arange(size)
        start, stop = offset + n // size * size, offset + n
        beyond = size if n >= size else 0
        ends = np.stack([start, stop, start - beyond, stop + beyond, offset], axis=-1)[start < stop]
    else:
        cut = np.arange(1, size)  # cells of the band at the low end, or of that at the high end
        top = np.stack([0 * cut, cut, 0 * cut, cut + size, cut], axis=-1)
        bottom = np.stack([n - cut, 0 * cut + n, n - cut - size, 0 * cut + n, (n - cut) % size], axis=-1)
        ends = np.concatenate([top, bottom[cut <= n]])
        ends[:, :4] = np.clip(ends[:, :4], 0, n)
    return np.concatenate([whole, ends]).astype(np.int64)


def mean_cover(planes: Planes, sizes: Array) -> Curve:
    """Number of boxes averaged over all offsets of the grid.

    The mean has a measure of its own: boxes that hang over opposite edges by the same cut count once.
    """
    largest = int(sizes.max())
    pairs = together(lambda cells: every_position(cells, largest, planes.grid.periodic), planes.cells)
    whole, folded = (np.array([pair[kind][sizes] for pair in pairs], float) for kind in (0, 1))
    return Curve(sizes, whole / sizes.astype(float) ** 2, folded)


def every_position(cells: Array, largest: int, periodic: Sequence[bool]) -> tuple[Array, Array]:
    """Return the positions at which a box meets the set, for all sizes up to `largest` (index 0 is unused).

    Divided by size^2 they are the number of boxes averaged over the offsets of the grid. The first array has
    every box that hangs over a free edge; in the second, boxes that hang over opposite edges by the same cut
    count once. No free axis is shorter than `largest`.
    """
    from fractalcontact.domains._mean_kernels import nearest_ahead

    ny, nx = cells.shape
    ahead = [(0, largest if wraps else 0) for wraps in periodic]
    distance = np.full(nx + ahead[1][1] + 1, largest + 1, np.int32)
    histogram = np.zeros(largest + 2, np.int64)
    nearest_ahead(np.pad(cells, ahead, mode="wrap"), ny, nx, distance, histogram)
    whole = np.cumsum(histogram)[: largest + 1]  # with the boxes that hang over the far edges
    folded = whole.copy()
    free = {axis: _from_edges(cells, axis, largest) for axis in (0, 1) if not periodic[axis]}
    for axis, (low, high) in free.items():
        hanging = _over_edge(np.stack([low, high, np.minimum(low, high)]), largest, periodic[1 - axis])
        whole += hanging[0]
        folded += hanging[2] - hanging[1]
    if len(free) == 2:
        left, right = free[1]
        nearer = np.minimum(left, right)
        nearer = np.minimum(nearer, nearer[::-1])
        corners = _over_corner(np.stack([left, right, left[::-1], right[::-1], nearer]), largest)
        whole += corners[:3].sum(axis=0)
        folded += corners[4] - corners[3]
    return whole, folded


def _from_edges(cells: Array, axis: int, reach: int) -> Array:
    """Return the cells from both ends of each line along `axis` to the set, `reach` where there are more."""
    lines = np.moveaxis(cells.view(np.bool_), axis, 0)
    ends = np.stack([lines[:reach], lines[: -reach - 1 : -1]])
    return np.where(ends.any(axis=1), ends.argmax(axis=1), reach)


def _over_edge(first: Array, largest: int, wrap: bool) -> Array:
    """Count the positions of boxes of all sizes that hang over one edge and meet the set, (edges, sizes).

    `first` (edges, n) is how far from the edge each line of cells across it meets the set.
    """
    n = first.shape[1]
    totals = np.zeros((len(first), largest + 1), np.int64)
    following = np.pad(first, ((0, 0), (0, largest - 1)), mode="wrap") if wrap else first
    nearest = following
    for size in range(2, largest + 1):
        last = n if wrap else n - size + 1
        nearest = np.minimum(nearest[:, :last], following[:, size - 1 : size - 1 + last])
        totals[:, size] = np.maximum(size - 1 - nearest, 0).sum(axis=1)
    return totals


def _over_corner(first: Array, largest: int) -> Array:
    """Count the positions of boxes of all sizes that hang over two edges and meet the set, (corners, sizes).

    `first` (corners, n) is how far from one edge each line of cells meets the set, from the other edge
    inwards.
    """
    nearest = np.minimum.accumulate(first[:, :largest], axis=1)
    needed = np.maximum(np.arange(nearest.shape[1]), nearest) + 2  # the size from which on they meet it
    places = np.minimum(needed, largest + 1) + (largest + 2) * np.arange(len(first))[:, None]
    number, less = (
        np.bincount(places.ravel(), weight, len(first) * (largest + 2)).reshape(len(first), -1).cumsum(axis=1)
        for weight in (None, nearest.ravel())
    )
    totals = (np.arange(largest + 2) - 1) * number - less
    return np.asarray(totals[:, : largest + 1], np.int64)


def observed_in_boxes(valid: Array, size: int, periodic: Sequence[bool]) -> Array:
    """Count the positions of the box by the observed cells it holds, (size^2 + 1,).

    On a free axis boxes that hang over opposite edges by the same cut count once, with the cells of both;
    no axis is shorter than `2 size`.
    """
    held = valid.astype(np.int32)
    for axis, (n, wraps) in enumerate(zip(valid.shape, periodic, strict=True)):
        total = np.insert(np.cumsum(held, axis), 0, 0, axis)
        cut = np.arange(1, size)
        low = np.take(total, cut, axis)
        high = np.take(total, [n], axis) - np.take(total, cut + n - size if wraps else n - cut, axis)
        inside = np.take(total, np.arange(size, n + 1), axis) - np.take(total, np.arange(n - size + 1), axis)
        held = np.concatenate([inside, low + high], axis)
    return np.bincount(held.ravel(), minlength=size * size + 1)


def aligned_cover(planes: Planes, sizes: Array) -> Curve:
    """Boxes of the one grid that starts at the first cell."""

    def counts(cells: Array) -> list[int]:
        levels = {1: cells}
        for size in map(int, sizes):
            finest = max(known for known in levels if size % known == 0)
            levels[size] = levels[finest] if finest == size else coarsen(levels[finest], size // finest)
        return [int(np.count_nonzero(levels[int(size)].view(np.bool_))) for size in sizes]

    found = np.array(together(counts, planes.cells), np.int64).reshape(planes.count, sizes.size)
    return Curve(sizes, found, found * sizes.astype(float) ** 2)


def coarsen(cells: Array, factor: int) -> Array:
    """Mark the boxes of `factor` cells, on the grid from the first cell, that hold a cell of the set."""
    from fractalcontact.domains._mean_kernels import halve

    ny, nx = cells.shape
    if factor == 2 and nx % 2 == 0:
        coarse = np.empty((-(-ny // 2), nx // 2), np.uint8)
        halve(cells.view(np.uint16), coarse)
        return coarse
    rows = np.bitwise_or.reduceat(cells, np.arange(0, ny, factor), axis=0)
    return np.bitwise_or.reduceat(rows, np.arange(0, nx, factor), axis=1)


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
    slope = ((y - y[..., :1]) * weights).sum(-1)  # no matrix product: the same for a plane and for a stack
    steps = np.diff(x)
    local = np.diff(y, axis=-1) / steps
    if x.size < 3:
        return slope, np.full(slope.shape, np.nan), weights
    spread = np.sqrt(((local - slope[..., None]) ** 2 * (steps / steps.sum())).sum(-1))
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


def deviations(sizes: Array) -> float:
    """Return how many standard deviations of the local slopes make 95 %: Student's t, of the sizes less 2."""
    from scipy.special import stdtrit

    return float(stdtrit(max(sizes.size - 2, 1), 0.975))


APART = 0.02  # of the difference of two covers that counts for the interval


def estimate(sizes: Array, fewest: Array, mean: Array, cover: str) -> tuple[float, float]:
    """Return the dimension and the half-width of its interval, from the areas of both covers.

    The fewest boxes are exact for sets on a lattice and rise too fast, towards small sizes, for curves that
    lie across it; the mean number errs the other way and less. Where the mean is the steadier of the two
    both count alike, elsewhere the fewest boxes by their steadiness. Slopes that swing little may still be
    off together: what the two covers differ by counts too, up to a limit, as the mean is far off for sets on
    a lattice. The limit was set on some thousand sets of known dimension (see `counting.box_dimension`).
    """
    first, second = steady(sizes, fewest), steady(sizes, mean)
    if not (np.isfinite(first.dimension) and np.isfinite(second.dimension)):
        return first.dimension if cover == "minimum" else second.dimension, np.nan
    variance = first.spread**2, max(first.spread, second.spread) ** 2
    both, spread, _ = blend((first.dimension, second.dimension), variance)
    apart = abs(first.dimension - second.dimension)
    if cover == "minimum":
        return both, deviations(sizes) * spread + min(apart, APART + 0.5 * spread)
    deviation = float(np.hypot(second.spread, second.dimension - both))
    return second.dimension, deviations(sizes) * deviation + min(apart, APART + deviation)
