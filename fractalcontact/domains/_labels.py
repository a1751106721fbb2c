"""Connected cells of a plane, joined across periodic edges, and their measures; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fractalcontact.base.grid import Grid
from fractalcontact.domains._masks import Array

STRUCTURES = {1: ndimage.generate_binary_structure(2, 1), 2: ndimage.generate_binary_structure(2, 2)}


@dataclass(frozen=True)
class Labels:
    """Islands of one plane.

    `parts` numbers the connected parts inside the extent from 1 (0 outside), (ny, nx) int32. Part k belongs
    to island `island[k]` (numbered from 1 in the order of their first cells) and lies `shift[k]` periods
    (y, x) from where it continues the rest of it. `closes[i]` says whether island i goes round (y, x).
    """

    parts: Array
    island: Array
    shift: Array
    closes: Array

    @property
    def count(self) -> int:
        """Number of islands."""
        return int(self.closes.shape[0]) - 1

    @property
    def map(self) -> Array:
        """Number of the island at every cell, (ny, nx) int32."""
        return np.asarray(self.island[self.parts], np.int32)


def label_plane(cells: Array, connectivity: int, periodic: Sequence[bool]) -> Labels:
    """Find the islands of a plane; connectivity 1 joins 4 neighbours, 2 joins 8."""
    parts, count = ndimage.label(cells, STRUCTURES[connectivity])
    if not any(periodic) or count == 0:
        none = np.zeros((count + 1, 2), np.int64)
        return Labels(parts, np.arange(count + 1), none, none.astype(bool))
    from fractalcontact.domains._island_kernels import join

    links = np.concatenate([*_links(parts, connectivity, periodic), np.empty((0, 4), np.int64)])
    root, shift, closes = join(count + 1, np.ascontiguousarray(links))
    roots, island = np.unique(root, return_inverse=True)
    return Labels(parts, island, shift, closes[roots])


def sizes(labels: Labels) -> Array:
    """Return the number of cells of every island."""
    of_parts = np.bincount(labels.parts.ravel(), minlength=labels.island.size)[1:]
    return np.bincount(labels.island[1:], weights=of_parts, minlength=labels.count + 1)[1:].astype(np.int64)


def _links(parts: Array, connectivity: int, periodic: Sequence[bool]) -> list[Array]:
    """Pairs of parts that touch across a seam, with the periods from the first to the second (y, x)."""
    wrap_y, wrap_x = periodic
    sideways = (0,) if connectivity == 1 else (-1, 0, 1)
    found = []
    if wrap_y:
        found += [_pairs(parts[-1], parts[0], step, wrap_x, across_rows=True) for step in sideways]
    if wrap_x:
        found += [_pairs(parts[:, -1], parts[:, 0], step, wrap_y, across_rows=False) for step in sideways]
    return found


def _pairs(edge: Array, facing: Array, step: int, wraps: bool, *, across_rows: bool) -> Array:
    """Links from cell k of one edge to cell k + step of the edge it faces."""
    n = edge.size
    place = np.arange(n)
    target = place + step
    inside = np.ones(n, bool) if wraps else (target >= 0) & (target < n)
    around = target // n
    one, other = edge, facing[target % n]
    good = inside & (one > 0) & (other > 0)
    over = np.ones(n, np.int64)
    down, right = (over, around) if across_rows else (around, over)
    return np.unique(np.stack([one, other, down, right], axis=-1)[good].astype(np.int64), axis=0)


def table(labels: Labels, grid: Grid, origin: Sequence[float]) -> dict[str, Array]:
    """Measure every island: cells, area, perimeter, centroid and bounding box, in metres.

    `origin` holds the first cell centres (y, x). The perimeter is along sides of cells, towards open cells
    inside the extent. An island that goes round a period has no centroid along it (NaN), and spans it.
    """
    from fractalcontact.domains._island_kernels import measure

    sums = np.zeros((labels.count + 1, 3), np.int64)
    sides = np.zeros((labels.count + 1, 2), np.int64)
    far = np.iinfo(np.int64).max
    box = np.tile(np.array([far, -far, far, -far]), (labels.count + 1, 1))
    wrap_y, wrap_x = grid.periodic
    measure(labels.parts, labels.island, labels.shift, wrap_y, wrap_x, sums, sides, box)
    sums, sides, box = sums[1:], sides[1:], box[1:]
    dy, dx = grid.spacing
    out = {"cells": sums[:, 0], "area": sums[:, 0] * grid.cell_area, "perimeter": sides @ np.array([dx, dy])}
    for axis, name in enumerate(("y", "x")):
        n, spacing, around = grid.shape[axis], grid.spacing[axis], labels.closes[1:, axis]
        first = origin[axis] - 0.5 * spacing
        low, high = box[:, 2 * axis], box[:, 2 * axis + 1] + 1
        turn = low // n * n  # back to where the first cell lies inside the extent
        centre = sums[:, axis + 1] / sums[:, 0] + 0.5
        out[f"centroid_{name}"] = np.where(around, np.nan, first + centre % n * spacing)
        out[f"{name}_min"] = first + np.where(around, 0, low - turn) * spacing
        out[f"{name}_max"] = first + np.where(around, n, high - turn) * spacing
    return out


def euler_number(cells: Array, connectivity: int, periodic: Sequence[bool]) -> int:
    """Return the number of islands less that of holes, from counts of cells, sides and corners."""
    inside = cells > 0
    for axis, wraps in enumerate(periodic):
        last = np.take(inside, [-1], axis) if wraps else np.zeros_like(np.take(inside, [0], axis))
        end = [] if wraps else [np.zeros_like(last)]
        inside = np.concatenate([last, inside, *end], axis)
    a, b, c, d = inside[:-1, :-1], inside[:-1, 1:], inside[1:, :-1], inside[1:, 1:]
    faces = np.count_nonzero(cells)
    if connectivity == 2:  # closed cells: every side and corner they touch
        sides = np.count_nonzero(b | d) + np.count_nonzero(c | d)
        return int(np.count_nonzero(a | b | c | d) - sides + faces)
    sides = np.count_nonzero(b & d) + np.count_nonzero(c & d)
    return int(np.count_nonzero(a & b & c & d) - sides + faces)
