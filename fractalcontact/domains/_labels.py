"""Connected cells of a plane, joined across periodic edges, and their measures; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fractalcontact.base.grid import Grid
from fractalcontact.domains._masks import Array

STRUCTURES = {1: ndimage.generate_binary_structure(2, 1), 2: ndimage.generate_binary_structure(2, 2)}
BAND = 2**22  # cells that are labelled at a time where no map is kept
MANY = 2**22  # islands of a plane up to which all of them are measured unasked
FAR = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Details:
    """What `_island_kernels.measure` counted of every part; part k stands at k - 1."""

    sums: Array
    sides: Array
    box: Array


@dataclass(frozen=True)
class Labels:
    """Islands of one plane.

    The connected parts of each band of rows are numbered from 1 (0 outside). The part `merged[k]` (ascending)
    belongs to the island that begins with the part `root[k]`, and lies `shift[k]` periods (y, x) from where
    it continues the rest of it; every other part begins an island of its own. The island that begins with the
    part `closing[k]` goes round (y, x) where `around[k]` says so. `cells` are those of every part, and
    `details` the rest of its measures where they were wanted. `ends` are the parts at the first and last row
    and column; `parts` is the map of parts, (ny, nx) int32, or None where it was not kept.
    """

    merged: Array
    root: Array
    shift: Array
    closing: Array
    around: Array
    cells: Array
    details: Details | None
    ends: tuple[Array, Array, Array, Array]
    parts: Array | None

    @property
    def count(self) -> int:
        """Number of islands."""
        return int(self.cells.size - self.merged.size)

    @property
    def sizes(self) -> Array:
        """Number of cells of every island."""
        return self.gather(self.cells)

    @property
    def closes(self) -> Array:
        """Whether each island goes round (y, x)."""
        closes = np.zeros((self.count, 2), bool)
        closes[self.number(self.closing) - 1] = self.around
        return closes

    @property
    def map(self) -> Array:
        """Number of the island at every cell, (ny, nx) int32."""
        if self.parts is None:
            raise ValueError("the map of the islands was not kept")
        return np.asarray(self.number(np.arange(self.cells.size + 1)).astype(np.int32)[self.parts])

    def number(self, parts: Array) -> Array:
        """Return the islands, numbered from 1 in the order of their first cells, that parts belong to."""
        begins = parts.copy()
        there = np.isin(parts, self.merged)
        begins[there] = self.root[np.searchsorted(self.merged, parts[there])]
        return begins - np.searchsorted(self.merged, begins)

    def gather(self, values: Array, reduce: np.ufunc = np.add) -> Array:
        """Reduce a measure of the parts over every island."""
        if self.merged.size == 0:
            return values
        total = values.copy()
        reduce.at(total, self.root - 1, values[self.merged - 1])
        return np.delete(total, self.merged - 1)

    def moved(self, axis: int) -> Array:
        """Return the shift of every part along an axis, in periods."""
        shift = np.zeros(self.cells.size, np.int64)
        shift[self.merged - 1] = self.shift[:, axis]
        return shift

    def crosses(self, axis: int, wraps: bool) -> bool:
        """Return whether an island goes round a periodic axis, or touches both ends of a free one."""
        if wraps:
            return bool(self.around[:, axis].any())
        first, last = (np.unique(self.number(end[end > 0])) for end in self.ends[2 * axis : 2 * axis + 2])
        return bool(np.intersect1d(first, last).size)


def label_plane(
    cells: Array, connectivity: int, periodic: Sequence[bool], *, keep: bool, detailed: bool | None = False
) -> Labels:
    """Find the islands of a plane; connectivity 1 joins 4 neighbours, 2 joins 8.

    Without `keep` no map is made, and the plane is gone through in bands of rows. `detailed` measures more
    than cells; None does unless there are more than `MANY`.
    """
    from fractalcontact.domains._island_kernels import measure

    wrap_y, wrap_x = periodic
    ny, nx = cells.shape
    height = ny if keep else max(1, BAND // nx)
    steps = (0,) if connectivity == 1 else (-1, 0, 1)
    short = np.int32 if cells.size < 2**31 else np.int64
    wanted = detailed is not False
    count, links, counts, columns = 0, [], [], []
    rows: list[Array] = []
    measured: list[tuple[Array, ...]] = []
    for start in range(0, ny, height):
        parts, found = ndimage.label(cells[start : start + height], STRUCTURES[connectivity])
        counts.append(np.bincount(parts.ravel(), minlength=found + 1)[1:].astype(short))
        wanted &= detailed is not None or count + found <= MANY
        if wanted:
            blank = _blank(found + 1)
            measure(parts, cells, start, wrap_y, wrap_x, *blank)
            measured.append(tuple(values[1:] for values in blank))
        else:
            measured.clear()
        parts[parts > 0] += count
        links += [_pairs(rows[-1], parts[0], step, wrap_x, down=0) for step in steps if rows]
        rows += [parts[0].copy(), parts[-1].copy()]
        columns.append(parts[:, [0, -1]].copy())
        count += found
    left, right = np.concatenate(columns).T
    ends = (rows[0], rows[-1], left, right)
    links += [_pairs(rows[-1], rows[0], step, wrap_x, down=1) for step in steps if wrap_y]
    links += [_pairs(right, left, step, wrap_y, down=1)[:, [0, 1, 3, 2]] for step in steps if wrap_x]
    details = Details(*(np.concatenate(each) for each in zip(*measured, strict=True))) if wanted else None
    joined = _joined(np.concatenate([np.empty((0, 4), np.int64), *links]))
    return Labels(*joined, np.concatenate(counts), details, ends, parts if keep else None)


def _joined(links: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Join parts by links; return `merged`, `root`, `shift`, `closing` and `around` of the islands."""
    from fractalcontact.domains._island_kernels import join

    linked, places = np.unique(links[:, :2], return_inverse=True)
    parent, shift = np.arange(linked.size), np.zeros((linked.size, 2), np.int64)
    closes = np.zeros((linked.size, 2), bool)
    join(np.concatenate([places.reshape(-1, 2), links[:, 2:]], axis=1), parent, shift, closes)
    own = parent == np.arange(linked.size)
    closing = own & closes.any(1)
    return linked[~own], linked[parent[~own]], shift[~own], linked[closing], closes[closing]


def _blank(parts: int) -> tuple[Array, Array, Array]:
    box = np.tile(np.array([FAR, -FAR, FAR, -FAR]), (parts, 1))
    return np.zeros((parts, 3), np.int64), np.zeros((parts, 2), np.int64), box


def _pairs(edge: Array, facing: Array, step: int, wraps: bool, *, down: int) -> Array:
    """Links from cell k of one edge to cell k + step of the edge it faces: part, part, periods (y, x)."""
    n = edge.size
    target = np.arange(n) + step
    inside = np.ones(n, bool) if wraps else (target >= 0) & (target < n)
    other = facing[target % n]
    good = inside & (edge > 0) & (other > 0)
    links = np.stack([edge, other, np.full(n, down), target // n], axis=-1)[good]
    return np.unique(links.astype(np.int64), axis=0)


PLAIN = ("cells", "area")
COLUMNS = (*PLAIN, "perimeter", "centroid_x", "centroid_y", "x_min", "x_max", "y_min", "y_max")


def table(labels: Labels, grid: Grid, origin: Sequence[float], columns: Sequence[str]) -> dict[str, Array]:
    """Return columns out of `COLUMNS` for every island, in metres.

    `origin` holds the first cell centres (y, x). The perimeter is along sides of cells, towards open cells
    inside the extent. An island that goes round a period has no centroid along it (NaN), and spans it.
    """
    size = labels.sizes
    out: dict[str, Array] = {}
    if "cells" in columns:
        out["cells"] = size.astype(np.int64)
    if "area" in columns:
        out["area"] = size * grid.cell_area
    if labels.details is None:
        return out
    dy, dx = grid.spacing
    sides = labels.details.sides
    out["perimeter"] = labels.gather(sides[:, 0]) * dx + labels.gather(sides[:, 1]) * dy
    for axis, name in enumerate(("y", "x")):
        out |= _places(labels, labels.details, size, grid, origin, axis, name)
    return {name: out[name] for name in columns}


def _places(
    labels: Labels, details: Details, size: Array, grid: Grid, origin: Sequence[float], axis: int, name: str
) -> dict[str, Array]:
    """Return centroid and ends of every island along an axis."""
    n, spacing, around = grid.shape[axis], grid.spacing[axis], labels.closes[:, axis]
    first = origin[axis] - 0.5 * spacing
    shift = labels.moved(axis) * n
    low = labels.gather(details.box[:, 2 * axis] + shift, np.minimum)
    high = labels.gather(details.box[:, 2 * axis + 1] + shift + 1, np.maximum)
    turn = low // n * n  # back to where the first cell lies inside the extent
    centre = labels.gather(details.sums[:, axis + 1] + details.sums[:, 0] * shift) / size + 0.5
    return {
        f"centroid_{name}": np.where(around, np.nan, first + centre % n * spacing),
        f"{name}_min": first + np.where(around, 0, low - turn) * spacing,
        f"{name}_max": first + np.where(around, n, high - turn) * spacing,
    }


def euler_number(cells: Array, connectivity: int, periodic: Sequence[bool]) -> int:
    """Return the number of islands less that of holes, from counts of cells, sides and corners."""
    wrap_y, wrap_x = periodic
    ny, nx = cells.shape
    corners = ny if wrap_y else ny + 1  # rows of corners, each between a row of cells and the one before
    height = max(1, BAND // nx)
    total = int(np.count_nonzero(cells))
    for start in range(0, corners, height):
        rows = np.arange(start - 1, min(start + height, corners))
        inside = cells[rows % ny] > 0
        if not wrap_y:
            inside[(rows < 0) | (rows >= ny)] = False
        before = inside[:, -1:] if wrap_x else np.zeros_like(inside[:, :1])
        inside = np.concatenate([before, inside, *([] if wrap_x else [before])], axis=1)
        total += _corners_less_sides(inside, connectivity)
    return total


def _corners_less_sides(inside: Array, connectivity: int) -> int:
    """Count at every corner of four cells: the corner, less the side after it and the side below it."""
    a, b, c, d = inside[:-1, :-1], inside[:-1, 1:], inside[1:, :-1], inside[1:, 1:]
    if connectivity == 2:  # closed cells: every side and corner they touch
        return int(np.count_nonzero(a | b | c | d) - np.count_nonzero(b | d) - np.count_nonzero(c | d))
    return int(np.count_nonzero(a & b & c & d) - np.count_nonzero(b & d) - np.count_nonzero(c & d))
