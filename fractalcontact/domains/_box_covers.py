"""Numbers of boxes that meet a set, for three covers: fewest, mean and aligned; arrays in and out.

Two numbers are kept for every size. The count is of whole boxes. The measure, which the fit uses, counts a
box cut by the edge of the mask by its part inside, where the set continues in the next box; a set that fills
the mask then has n/s boxes along each axis and not the next integer. The boxes of a profile stand in a row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fractalcontact.base.jit import kernel
from fractalcontact.domains._aligned_boxes import joined_boxes
from fractalcontact.domains._masks import Array, Planes, parallel_map

COVERS = ("minimum", "mean", "aligned")
ROW = np.array(
    [[0, 1, 0, 1, 0]]
)  # the band of rows of a profile, see `_bands`: cut, and continued by nothing


@dataclass(frozen=True)
class Curve:
    """Count and measure of the boxes, each of shape (planes, sizes)."""

    sizes: Array
    count: Array
    area: Array  # of the boxes that meet the set, in cells; of a profile, of the squares that stand on it

    @property
    def measure(self) -> Array:
        """Boxes that meet the set, those cut by the edge by their part inside."""
        return np.asarray(self.area / self.sizes.astype(float) ** 2)


def cover_curve(planes: Planes, sizes: Array, cover: str) -> Curve:
    """Return the curve of the named cover, its measure corrected for cells that were not observed.

    The measure is divided by the share of the boxes' area that was observed, where the boxes are those that
    hold an observed cell; a set that fills what was observed then has the dimension 2.
    """
    by_name: dict[str, Callable[[Planes, Array], Curve]]
    by_name = {"minimum": _minimum_cover, "mean": _mean_cover, "aligned": _aligned_cover}
    curve = by_name[cover](planes, sizes)
    if planes.valid is None:
        return curve
    everything = replace(planes, cells=planes.valid, valid=None)
    seen = by_name[cover](everything, sizes).area / sizes.astype(float) ** (2 - planes.rank)
    return Curve(
        sizes, curve.count, curve.area * everything.occupied[:, None] / np.where(seen > 0, seen, np.nan)
    )


def _minimum_cover(planes: Planes, sizes: Array) -> Curve:
    """Fewest boxes over all offsets of the grid; boxes of a profile have one offset across it."""
    axes = tuple(zip(planes.grid.shape, planes.grid.periodic, strict=True))
    bands = {size: [_bands(n, size, wraps) for n, wraps in axes] for size in map(int, sizes)}
    if planes.rank == 1:
        bands = {size: [ROW, columns] for size, (_, columns) in bands.items()}

    def fewest(task: tuple[Array, int]) -> tuple[int, int]:
        cells, size = task
        return _fewest_boxes(cells, size, *bands[size], wrap_x=planes.grid.periodic[1])

    tasks = [(cells, size) for cells in planes.cells for size in bands]
    values = np.array(parallel_map(fewest, tasks, planes.plane_size), np.int64).reshape(
        planes.count, sizes.size, 2
    )
    return Curve(sizes, values[..., 0], values[..., 1].astype(float))


def _fewest_boxes(
    cells: Array, size: int, row_bands: Array, column_bands: Array, *, wrap_x: bool
) -> tuple[int, int]:
    """Return the fewest boxes that meet the set, and their least area in cells, over all offsets of the grid.

    The bands are those of `_bands` for the rows and for the columns.
    """
    offsets = int(row_bands[:, 4].max()) + 1
    # ascending, so that the column sums of a band follow from those of the band before it
    row_bands = row_bands[np.lexsort((row_bands[:, 1], row_bands[:, 0]))]
    is_full = column_bands[:, 1] - column_bands[:, 0] == size
    count, area = np.zeros((offsets, size), np.int32), np.zeros((offsets, size), np.int64)
    beyond = 2 * size if wrap_x else 0
    positions = int(is_full.sum())
    folded = 1 << 13  # positions of boxes that are kept apart: with fewer, loops are too short
    fold = size * max(1, -(-min(positions, folded) // size))  # of a whole number of boxes
    met, lost = np.zeros((2, offsets, fold), np.int32)
    nx = cells.shape[1]
    work = np.zeros((2, 2), np.int64), np.zeros((3, nx), np.int32), np.zeros((2, nx + 1 + beyond), np.int32)
    cut = column_bands[~is_full]
    count_boxes_in_bands(cells, size, row_bands, cut, positions, *work, met, lost, count, area)
    fewest, least = [], []
    # sums that are added up at a time: those of a large plane take gigabytes
    step = max(1, (1 << 22) // fold)
    for start in range(0, offsets, step):
        rows = slice(start, start + step)
        full, cut = (v[rows].reshape(-1, fold // size, size).sum(1, dtype=np.int64) for v in (met, lost))
        fewest.append(int((count[rows] + full).min()))
        least.append(int((area[rows] + size * (size * full - cut)).min()))
    return min(fewest), min(least)


def _bands(n: int, size: int, wraps: bool) -> Array:
    """Cut an axis of n cells into bands of `size`, for every offset of the grid.

    Each row is (start, stop, start and stop including the neighbouring bands, offset). Full bands come first,
    in order. On a free axis the bands at the ends are cut; on a periodic one there is a remainder between the
    last band and the first, where starts and stops may lie beyond n. Neighbours are given for cut bands only.
    """
    start = np.arange(n // size * size if wraps else n - size + 1)
    full = np.stack([start, start + size, 0 * start, 0 * start, start % size], axis=-1)
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
    return np.concatenate([full, ends]).astype(np.int64)


def _mean_cover(planes: Planes, sizes: Array) -> Curve:
    """Number of boxes averaged over all offsets of the grid.

    The mean has a measure of its own: boxes that hang over opposite edges by the same cut count once. A box
    on a profile stands at one place across it, as if the profile had a period of one cell there.
    """
    largest = int(sizes.max())
    periodic = planes.grid.periodic if planes.rank == 2 else (True, *planes.periodic)
    positions = planes.map(lambda cells, _: _positions_that_meet(cells, largest, periodic))
    every, folded = (np.array([pair[k][sizes] for pair in positions], float) for k in (0, 1))
    length = sizes.astype(float)
    return Curve(sizes, every / length**planes.rank, folded * length ** (2 - planes.rank))


def _positions_that_meet(cells: Array, largest: int, periodic: Sequence[bool]) -> tuple[Array, Array]:
    """Return the positions at which a box meets the set, for all sizes up to `largest` (index 0 is unused).

    Divided by size^2 they are the number of boxes averaged over the offsets of the grid. The first array has
    every box that hangs over a free edge; in the second, boxes that hang over opposite edges by the same cut
    count once. No free axis is shorter than `largest`.
    """
    ny, nx = cells.shape
    ahead = [(0, largest if wraps and n > 1 else 0) for n, wraps in zip(cells.shape, periodic, strict=True)]
    continued = np.pad(cells, ahead, mode="wrap") if np.any(ahead) else cells
    # with the boxes that hang over the far edges
    distance, histogram = np.full(continued.shape[1] + 1, largest + 1, np.int32), np.zeros(largest + 2, int)
    nearest_ahead(continued, ny, nx, distance, histogram)
    every = np.cumsum(histogram)[:-1]
    folded = every.copy()
    free = {axis: _from_edges(cells, axis, largest) for axis in (0, 1) if not periodic[axis]}
    for axis, (low, high) in free.items():
        hanging = _over_edge(np.stack([low, high, np.minimum(low, high)]), largest, periodic[1 - axis])
        every += hanging[0]
        folded += hanging[2] - hanging[1]
    if len(free) == 2:
        left, right = free[1]
        nearer = np.minimum(left, right)
        nearer = np.minimum(nearer, nearer[::-1])
        corners = _over_corner(np.stack([left, right, left[::-1], right[::-1], nearer]), largest)
        every += corners[:3].sum(axis=0)
        folded += corners[4] - corners[3]
    return every, folded


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


def _aligned_cover(planes: Planes, sizes: Array) -> Curve:
    """Boxes of the one grid that starts at the first cell."""

    def counts(cells: Array) -> list[int]:
        levels = joined_boxes(cells, sizes, np.bitwise_or)
        return [int(np.count_nonzero(level.view(np.bool_))) for level in levels]

    values = np.array(planes.map(lambda cells, _: counts(cells)), np.int64).reshape(-1, sizes.size)
    return Curve(sizes, values, values * sizes.astype(float) ** 2)


@kernel
def count_boxes_in_bands(
    mask: Array,
    size: int,
    rows: Array,
    cut: Array,
    positions: int,
    summed_rows: Array,
    columns: Array,
    prefix: Array,
    met: Array,
    lost: Array,
    count: Array,
    area: Array,
) -> None:
    """Add the boxes that meet the set in all bands of rows; `mask` is uint8 (0 or 1), shape (ny, nx).

    `rows` lists the bands of rows by their start, then by their stop, `cut` the bands of columns that are
    cut by the edge (see `_bands`). `met` and `lost` (size, multiple of size) get for the full bands of
    columns, one at each of `positions`, by their position modulo that multiple, the boxes met, and the rows
    that those of them lose that count by their part inside; `count` and `area`
    (size, size) the boxes cut in x and their area in cells. All sums are integers, so that no result depends
    on their order.

    Zeros to work in, of the band and, where it is cut in y, of it with its neighbours: `summed_rows` (2, 2),
    the range of rows that are summed, `columns` (3, nx), their cells of the set in each column (and, last,
    none), and `prefix` (2, nx + 1), how many columns left of each position hold any, or hold more than in the
    band. What is longer in `prefix` continues a periodic x.
    """
    ny, nx = mask.shape
    ahead = np.uint32(size)  # unsigned: no test for negative indices
    for k in range(rows.shape[0]):
        first, end, offset = rows[k, 0], rows[k, 1], rows[k, 4]
        missing = size - (end - first)
        for w in range(2 if missing > 0 else 1):
            start, stop = rows[k, 2 * w], rows[k, 2 * w + 1]
            if stop < summed_rows[w, 1]:  # periodic: the remainder ends before the last full band
                summed_rows[w, 0] = summed_rows[w, 1] = start
                for j in range(nx):
                    columns[w, j] = 0
            for i in range(summed_rows[w, 0], start):
                for j in range(nx):
                    columns[w, j] -= mask[i % ny, j]
            for i in range(summed_rows[w, 1], stop):
                for j in range(nx):
                    columns[w, j] += mask[i % ny, j]
            summed_rows[w, 0], summed_rows[w, 1] = start, stop
            total = 0
            for j in range(nx):
                total += columns[w, j] > columns[2 - 2 * w, j]
                prefix[w, j + 1] = total
            for j in range(nx + 1, prefix.shape[1]):
                prefix[w, j] = total + prefix[w, j - nx]
        for low in range(0, positions, met.shape[1]):
            inner, outer = prefix[0, low:], prefix[1, low:]
            width = min(met.shape[1], positions - low)
            if missing > 0:
                for j in range(width):
                    inside = inner[j + ahead] > inner[j] and outer[j + ahead] > outer[j]
                    lost[offset, j] += missing * inside
            for j in range(width):
                met[offset, j] += inner[j + ahead] > inner[j]
        for c in range(cut.shape[0]):
            left, right, column = cut[c, 0], cut[c, 1], cut[c, 4]
            here = prefix[0, right] - prefix[0, left]
            if here > 0:
                alone = prefix[0, cut[c, 3]] - prefix[0, cut[c, 2]] == here
                above = missing == 0 or prefix[1, right] == prefix[1, left]
                count[offset, column] += 1
                area[offset, column] += (size if alone else right - left) * (size if above else end - first)


@kernel
def nearest_ahead(cells: Array, rows: int, columns: int, distance: Array, histogram: Array) -> None:
    """Count the positions in the first `rows` and `columns` by the size from which on a box meets the set.

    A box at (i, j) of size s meets the set if s >= d(i, j), where d is one on the set and elsewhere one more
    than the smallest d of the three neighbours ahead: a one-sided chessboard distance. Beyond an edge the set
    is empty; a periodic axis is continued for the largest box. Of the counts, `histogram` (largest + 2),
    which are zero before, the last is of positions where no box does. `distance` (nx + 1) is larger than that
    box.
    """
    nx = cells.shape[1]
    far = distance[nx]
    for i in range(cells.shape[0] - 1, -1, -1):
        beyond, corner = far, far  # values at j + 1, in this row and in the row below
        for j in range(nx - 1, -1, -1):
            below = distance[j]
            nearest = corner if corner < below else below
            nearest = beyond if beyond < nearest else nearest
            beyond = 1 if cells[i, j] else nearest + 1
            corner = below
            distance[j] = beyond
        if i < rows:
            for j in range(columns):
                histogram[distance[j] if distance[j] < far else far] += 1
