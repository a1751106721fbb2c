"""Connected cells of a plane, joined across periodic edges, and their measures; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fractalcontact.base.grid import Grid
from fractalcontact.domains._masks import Array

STRUCTURES = {1: ndimage.generate_binary_structure(2, 1), 2: ndimage.generate_binary_structure(2, 2)}
BAND = 2**24  # cells that are labelled at a time where no map is kept
FAR = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Labels:
    """Islands of one plane.

    The connected parts of each band of rows are numbered from 1 (0 outside). Part k belongs to island
    `island[k]` (numbered from 1 in the order of their first cells) and lies `shift[k]` periods (y, x) from
    where it continues the rest of it. `closes[i]` says whether island i goes round (y, x). `sums`, `sides`
    and `box` are what `_island_kernels.measure` counted of every part. `ends` are the parts at the first and
    last row and column; `parts` is the map of parts, (ny, nx) int32, or None where it was not kept.
    """

    island: Array
    shift: Array
    closes: Array
    sums: Array
    sides: Array
    box: Array
    ends: tuple[Array, Array, Array, Array]
    parts: Array | None

    @property
    def count(self) -> int:
        """Number of islands."""
        return int(self.closes.shape[0]) - 1

    @property
    def sizes(self) -> Array:
        """Number of cells of every island."""
        return self.gather(self.sums[:, 0])

    @property
    def map(self) -> Array:
        """Number of the island at every cell, (ny, nx) int32."""
        if self.parts is None:
            raise ValueError("the map of the islands was not kept")
        return np.asarray(self.island.astype(np.int32)[self.parts])

    def gather(self, values: Array) -> Array:
        """Sum a count of the parts over every island."""
        total = np.zeros(self.count + 1, np.int64)
        np.add.at(total, self.island, values)
        return total[1:]

    def crosses(self, axis: int, wraps: bool) -> bool:
        """Return whether an island goes round a periodic axis, or touches both ends of a free one."""
        if wraps:
            return bool(self.closes[1:, axis].any())
        first, last = (np.unique(self.island[end[end > 0]]) for end in self.ends[2 * axis : 2 * axis + 2])
        return bool(np.intersect1d(first, last).size)


def label_plane(cells: Array, connectivity: int, periodic: Sequence[bool], *, keep: bool = True) -> Labels:
    """Find and measure the islands of a plane; connectivity 1 joins 4 neighbours, 2 joins 8.

    Without `keep` no map is made, and the plane is gone through in bands of rows.
    """
    from fractalcontact.domains._island_kernels import join, measure

    wrap_y, wrap_x = periodic
    ny, nx = cells.shape
    height = ny if keep else max(1, BAND // nx)
    steps = (0,) if connectivity == 1 else (-1, 0, 1)
    count, links, counts, columns = 0, [], [], []
    rows: list[Array] = []
    for start in range(0, ny, height):
        parts, found = ndimage.label(cells[start : start + height], STRUCTURES[connectivity])
        measured = _blank(found + 1)
        measure(parts, cells, start, wrap_y, wrap_x, *measured)
        parts[parts > 0] += count
        links += [_pairs(rows[-1], parts[0], step, wrap_x, down=0) for step in steps if rows]
        rows += [parts[0].copy(), parts[-1].copy()]
        counts.append([values[1:] for values in measured])
        columns.append(parts[:, [0, -1]].copy())
        count += found
    left, right = np.concatenate(columns).T
    ends = (rows[0], rows[-1], left, right)
    links += [_pairs(rows[-1], rows[0], step, wrap_x, down=1) for step in steps if wrap_y]
    links += [_pairs(right, left, step, wrap_y, down=1)[:, [0, 1, 3, 2]] for step in steps if wrap_x]
    root, shift = np.arange(count + 1), np.zeros((count + 1, 2), np.int64)
    closes = np.zeros((count + 1, 2), bool)
    join(np.concatenate([np.empty((0, 4), np.int64), *links]), root, shift, closes)
    roots, island = np.unique(root, return_inverse=True)
    blank = _blank(1)
    sums, sides, box = (np.concatenate([blank[k], *(each[k] for each in counts)]) for k in range(3))
    return Labels(island, shift, closes[roots], sums, sides, box, ends, parts if keep else None)


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


def table(labels: Labels, grid: Grid, origin: Sequence[float]) -> dict[str, Array]:
    """Return cells, area, perimeter, centroid and bounding box of every island, in metres.

    `origin` holds the first cell centres (y, x). The perimeter is along sides of cells, towards open cells
    inside the extent. An island that goes round a period has no centroid along it (NaN), and spans it.
    """
    size = labels.sizes
    dy, dx = grid.spacing
    perimeter = labels.gather(labels.sides[:, 0]) * dx + labels.gather(labels.sides[:, 1]) * dy
    out = {"cells": size, "area": size * grid.cell_area, "perimeter": perimeter}
    for axis, name in enumerate(("y", "x")):
        n, spacing, around = grid.shape[axis], grid.spacing[axis], labels.closes[1:, axis]
        first = origin[axis] - 0.5 * spacing
        shift = labels.shift[1:, axis] * n
        low, high = np.full(labels.count + 1, FAR), np.full(labels.count + 1, -FAR)
        np.minimum.at(low, labels.island[1:], labels.box[1:, 2 * axis] + shift)
        np.maximum.at(high, labels.island[1:], labels.box[1:, 2 * axis + 1] + shift + 1)
        low, high = low[1:], high[1:]
        turn = low // n * n  # back to where the first cell lies inside the extent
        place = labels.sums[:, axis + 1] + labels.sums[:, 0] * labels.shift[:, axis] * n
        centre = labels.gather(place) / size + 0.5
        out[f"centroid_{name}"] = np.where(around, np.nan, first + centre % n * spacing)
        out[f"{name}_min"] = first + np.where(around, 0, low - turn) * spacing
        out[f"{name}_max"] = first + np.where(around, n, high - turn) * spacing
    return out


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
