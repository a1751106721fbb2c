"""Connected components of a plane, joined across periodic edges by union-find, and their measures.

Each band of rows is labelled by `scipy.ndimage.label`. Union-find with displacements then joins the labelled
parts across the borders of the bands and across periodic edges, so that islands that wrap around a period
are recognised; arrays in and out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fractalcontact.base.grid import Grid
from fractalcontact.base.jit import inner_kernel, kernel
from fractalcontact.base.validation import Problems
from fractalcontact.domains._masks import Array, Planes, check_mask

BAND_CELLS = 2**22  # cells that are labelled at a time where no map is kept: 16 MB of labels
# of a plane, above which only their cells are measured by default: the nine measures take 302 MB here
MANY_ISLANDS = 2**22
INT64_MAX = np.iinfo(np.int64).max

PLAIN_COLUMNS = ("cells", "area")
PROFILE_COLUMNS = ("cells", "length", "centroid_x", "x_min", "x_max")
SHAPE_COLUMNS = ("orientation", "eccentricity", "gyration_radius", "solidity")
COLUMNS = (*PLAIN_COLUMNS, "perimeter", "centroid_x", "centroid_y", "x_min", "x_max", "y_min", "y_max")


NOTHING = np.array([0, 0, 0, 0, 0, INT64_MAX, -INT64_MAX, INT64_MAX, -INT64_MAX])  # in `measure_parts`


@dataclass(frozen=True)
class Components:
    """Islands of one plane.

    The connected parts of each band of rows are numbered from 1 (0 outside). The part `merged[k]` (ascending)
    belongs to the island that begins with the part `root[k]`, and is displaced by `shift[k]` periods (y, x)
    from where it continues the rest of it; every other part begins an island of its own. The island that
    begins with the part `wrapping[k]` wraps around the period along the axes (y, x) where `wraps[k]` is True.
    `cells` counts those of every part, and `details` (parts, 9) has its other measures where they were
    requested (see `measure_parts`).
    `ends` are the parts at the first and last row and column; `parts` is the map of parts, (ny, nx) int32, or
    None where it was not kept.
    """

    merged: Array
    root: Array
    shift: Array
    wrapping: Array
    wraps: Array
    cells: Array
    details: Array | None
    ends: tuple[Array, Array, Array, Array]
    parts: Array | None

    @property
    def count(self) -> int:
        """Number of islands."""
        return int(self.cells.size - self.merged.size)

    @property
    def sizes(self) -> Array:
        """Number of cells of every island."""
        return self.reduce(self.cells)

    @property
    def wraps_by_island(self) -> Array:
        """Whether each island wraps around the period, (islands, 2) for (y, x)."""
        wraps = np.zeros((self.count, 2), bool)
        wraps[self.number(self.wrapping) - 1] = self.wraps
        return wraps

    @property
    def map(self) -> Array:
        """Number of the island at every cell, (ny, nx) int32."""
        if self.parts is None:
            raise ValueError("the map of the islands was not kept")
        return np.asarray(self.number(np.arange(self.cells.size + 1)).astype(np.int32)[self.parts])

    def number(self, parts: Array) -> Array:
        """Return the islands, numbered from 1 in the order of their first cells, that parts belong to."""
        first_part = parts.copy()
        is_merged = np.isin(parts, self.merged)
        first_part[is_merged] = self.root[np.searchsorted(self.merged, parts[is_merged])]
        return first_part - np.searchsorted(self.merged, first_part)

    def reduce(self, values: Array, ufunc: np.ufunc = np.add) -> Array:
        """Reduce a measure of the parts over every island."""
        if self.merged.size == 0:
            return values
        total = values.copy()
        ufunc.at(total, self.root - 1, values[self.merged - 1])
        return np.delete(total, self.merged - 1)

    def part_shift(self, axis: int) -> Array:
        """Return the shift of every part along an axis, in periods."""
        shift = np.zeros(self.cells.size, np.int64)
        shift[self.merged - 1] = self.shift[:, axis]
        return shift

    def percolates(self, axis: int, periodic: bool) -> bool:
        """Return whether an island wraps around a periodic axis, or touches both ends of a free one."""
        if periodic:
            return bool(self.wraps[:, axis].any())
        first, last = (np.unique(self.number(end[end > 0])) for end in self.ends[2 * axis : 2 * axis + 2])
        return bool(np.intersect1d(first, last).size)


def check_connected(problems: Problems, *, profiles: bool = False) -> bool:
    """Check a mask, also of a profile where those are allowed, and the neighbours of its cells."""
    is_number = problems.integer("connectivity", at_least=1, at_most=2)
    return check_mask(problems, profiles=profiles) and is_number


def label_planes(
    planes: Planes, connectivity: int, *, keep: bool = True, detailed: bool | None = False
) -> list[Components]:
    """Find the islands of every plane; see `label_plane`."""
    periodic = planes.grid.periodic
    return planes.map(
        lambda cells, _: label_plane(cells, connectivity, periodic, keep=keep, detailed=detailed)
    )


def label_plane(
    cells: Array, connectivity: int, periodic: Sequence[bool], *, keep: bool, detailed: bool | None = False
) -> Components:
    """Find the islands of a plane; connectivity 1 joins 4 neighbours, 2 joins 8.

    Without `keep` no map is made, and the plane is labelled in bands of rows. `detailed` measures more than
    cells; None does so for at most `MANY_ISLANDS`.
    """
    wrap_y, wrap_x = periodic
    ny, nx = cells.shape
    height = ny if keep else max(1, BAND_CELLS // nx)
    steps = (0,) if connectivity == 1 else (-1, 0, 1)
    neighbours = ndimage.generate_binary_structure(2, connectivity)
    count_dtype = np.int32 if cells.size < 2**31 else np.int64
    measures = detailed is not False
    count, links, counts, columns = 0, [], [], []
    rows: list[Array] = []
    details: list[Array] = []
    for start in range(0, ny, height):
        parts, number = ndimage.label(cells[start : start + height], neighbours)
        counts.append(_part_sizes(parts, number).astype(count_dtype))
        measures &= detailed is not None or count + number <= MANY_ISLANDS
        if measures:
            of_parts = np.tile(NOTHING, (number + 1, 1))
            measure_parts(parts, cells, start, wrap_y, wrap_x, of_parts)
            details.append(of_parts[1:])
        else:
            details.clear()
        if count:
            parts[parts > 0] += count
        links += [_links(rows[-1], parts[0], step, wrap_x, down=0) for step in steps if rows]
        rows += [parts[0].copy(), parts[-1].copy()]
        columns.append(parts[:, [0, -1]].copy())
        count += number
    left, right = np.concatenate(columns).T
    ends = (rows[0], rows[-1], left, right)
    links += [_links(rows[-1], rows[0], step, wrap_x, down=1) for step in steps if wrap_y]
    links += [_links(right, left, step, wrap_y, down=1)[:, [0, 1, 3, 2]] for step in steps if wrap_x]
    joined = _join(np.concatenate([np.empty((0, 4), np.int64), *links]))
    measured = np.concatenate(details) if measures else None
    return Components(*joined, np.concatenate(counts), measured, ends, parts if keep else None)


def _part_sizes(parts: Array, number: int) -> Array:
    """Return the cells of every part, from its runs of equal labels: `bincount` takes as long as to label."""
    line = parts.reshape(-1)
    ends = np.append(np.flatnonzero(line[1:] != line[:-1]), line.size - 1)
    if ends.size > line.size // 8:  # from runs of 50 cells it is 3.6 times as fast; 4 and 16: the same
        return np.asarray(np.bincount(line, minlength=number + 1)[1:])
    lengths = np.diff(ends, prepend=-1)
    return np.asarray(np.bincount(line[ends], lengths, minlength=number + 1)[1:])


def _join(links: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Join parts by links; return `merged`, `root`, `shift`, `wrapping` and `wraps` of `Components`."""
    linked, places = np.unique(links[:, :2], return_inverse=True)
    parent, shift = np.arange(linked.size), np.zeros((linked.size, 2), np.int64)
    wraps = np.zeros((linked.size, 2), bool)
    if linked.size:  # else the kernel is not compiled: .5 s
        union_find(np.concatenate([places.reshape(-1, 2), links[:, 2:]], axis=1), parent, shift, wraps)
    is_root = parent == np.arange(linked.size)
    wrapping = is_root & wraps.any(1)
    return linked[~is_root], linked[parent[~is_root]], shift[~is_root], linked[wrapping], wraps[wrapping]


def _links(edge: Array, facing: Array, step: int, wraps: bool, *, down: int) -> Array:
    """Return links (part, part, periods y, periods x) from cell k of an edge to cell k + step of the next."""
    n = edge.size
    target = np.arange(n) + step
    inside = np.ones(n, bool) if wraps else (target >= 0) & (target < n)
    other = facing[target % n]
    good = inside & (edge > 0) & (other > 0)
    links = np.stack([edge, other, np.full(n, down), target // n], axis=-1)[good]
    return np.unique(links.astype(np.int64), axis=0)


def component_table(
    components: Components, grid: Grid, origin: Sequence[float], columns: Sequence[str]
) -> dict[str, Array]:
    """Return columns out of `COLUMNS` for every island, in metres.

    `origin` holds the first cell centres (y, x). The perimeter is along sides of cells, towards open cells
    inside the extent. An island that wraps around a period has no centroid along it (NaN), and spans it.
    """
    size = components.sizes
    table: dict[str, Array] = {}
    if "cells" in columns:
        table["cells"] = size.astype(np.int64)
    for name in ("area", "length"):  # that of a cell of a profile is its length
        if name in columns:
            table[name] = size * grid.cell_area
    shape = {name for name in columns if name in SHAPE_COLUMNS}
    if shape:
        table |= _shapes(components, grid, with_hull="solidity" in shape)
    if components.details is None:
        return {name: table[name] for name in columns}
    cells, rows, across, sides_y, sides_x, *ends = components.details.T
    dy, dx = grid.spacing
    table["perimeter"] = components.reduce(sides_y) * dx + components.reduce(sides_x) * dy
    for axis, (name, total) in enumerate({"y": rows, "x": across}.items()):
        n, spacing, wraps = grid.shape[axis], grid.spacing[axis], components.wraps_by_island[:, axis]
        first = origin[axis] - 0.5 * spacing
        shift = components.part_shift(axis) * n
        low = components.reduce(ends[2 * axis] + shift, np.minimum)
        high = components.reduce(ends[2 * axis + 1] + shift + 1, np.maximum)
        turn = low // n * n  # back to where the first cell lies inside the extent
        centre = components.reduce(total + cells * shift) / size + 0.5
        table[f"centroid_{name}"] = np.where(wraps, np.nan, first + centre % n * spacing)
        table[f"{name}_min"] = first + np.where(wraps, 0, low - turn) * spacing
        table[f"{name}_max"] = first + np.where(wraps, n, high - turn) * spacing
    return {name: table[name] for name in columns}


def _shapes(components: Components, grid: Grid, *, with_hull: bool) -> dict[str, Array]:
    """Return the columns of the shape of every island; NaN where it wraps around a period.

    The ellipse of equal second moments and the hull are those of skimage.measure.regionprops.
    """
    parts, count = components.parts, components.count
    assert parts is not None
    cells = np.nonzero(parts)
    part = parts[cells]
    island = components.number(np.arange(components.cells.size + 1))[part] - 1
    places = [
        (cells[axis] + components.part_shift(axis)[part - 1] * grid.shape[axis]) * grid.spacing[axis]
        for axis in (0, 1)
    ]
    size = np.maximum(np.bincount(island, minlength=count), 1)
    centred = [each - (np.bincount(island, each, count) / size)[island] for each in places]
    yy, yx, xx = (
        np.bincount(island, a * b, count) / size
        for a, b in ((centred[0], centred[0]), (centred[0], centred[1]), (centred[1], centred[1]))
    )
    spread = np.hypot((yy - xx) / 2.0, yx)
    long, short = (yy + xx) / 2.0 + spread, np.maximum((yy + xx) / 2.0 - spread, 0.0)
    is_equal = np.isclose(yy, xx, rtol=1e-12, atol=0.0)  # rounding: skimage compares exactly
    angle = np.where(is_equal, np.where(yx > 0, 45.0, -45.0), np.rad2deg(0.5 * np.arctan2(2.0 * yx, yy - xx)))
    with np.errstate(divide="ignore", invalid="ignore"):
        eccentricity = np.where(long > 0, np.sqrt(1.0 - short / long), 0.0)
    shapes = {"orientation": angle, "eccentricity": eccentricity, "gyration_radius": np.sqrt(yy + xx)}
    if with_hull:
        shapes["solidity"] = _solidity(island, places, grid, count)
    wraps = components.wraps_by_island.any(1)
    return {name: np.where(wraps, np.nan, values) for name, values in shapes.items()}


def _solidity(island: Array, places: Sequence[Array], grid: Grid, count: int) -> Array:
    """Return the cells of every island over those of its convex hull."""
    from skimage.morphology import convex_hull_image

    order = np.argsort(island, kind="stable")
    rows, columns = (
        np.rint(each[order] / spacing).astype(np.int64)
        for each, spacing in zip(places, grid.spacing, strict=True)
    )
    ends = np.cumsum(np.bincount(island, minlength=count))
    solidity = np.ones(count)
    for k in range(count):
        here = slice(ends[k - 1] if k else 0, ends[k])
        y, x = rows[here] - rows[here].min(), columns[here] - columns[here].min()
        image = np.zeros((y.max() + 1, x.max() + 1), bool)
        image[y, x] = True
        if min(image.shape) > 1:  # the hull of a row or a column is full
            solidity[k] = y.size / np.count_nonzero(convex_hull_image(image))
    return solidity


def euler_number(cells: Array, connectivity: int, periodic: Sequence[bool]) -> int:
    """Return the number of islands less that of holes, from counts of cells, sides and corners."""
    wrap_y, wrap_x = periodic
    ny, nx = cells.shape
    corners = ny if wrap_y else ny + 1  # rows of corners, each between a row of cells and the one before
    height = max(1, BAND_CELLS // nx)
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


@inner_kernel
def _find_root(parent: Array, shift: Array, part: int) -> int:
    """Follow a part to the root of its island; its shift becomes that from the root."""
    root = part
    down, right = 0, 0
    while parent[root] != root:
        down += shift[root, 0]
        right += shift[root, 1]
        root = parent[root]
    while parent[part] != root and part != root:  # path compression
        above = parent[part]
        step_down, step_right = shift[part, 0], shift[part, 1]
        parent[part] = root
        shift[part, 0], shift[part, 1] = down, right
        down -= step_down
        right -= step_right
        part = above
    return root


@kernel
def union_find(links: Array, parent: Array, shift: Array, wraps: Array) -> None:
    """Join parts by links (part, part, periods y, periods x), the displacement of the second part.

    `parent` (parts), each at first its own, gets the root of every part; `shift` (parts, 2) its displacement
    in periods (y, x) from the root; `wraps` (parts, 2), for every root, whether the island closes on itself
    along y and along x: two paths between its parts then differ in their displacement.
    """
    for link in range(links.shape[0]):
        first, second = links[link, 0], links[link, 1]
        root, other_root = _find_root(parent, shift, first), _find_root(parent, shift, second)
        down = shift[first, 0] + links[link, 2] - shift[second, 0]
        right = shift[first, 1] + links[link, 3] - shift[second, 1]
        if root == other_root:
            wraps[root, 0] |= down != 0
            wraps[root, 1] |= right != 0
        else:
            top, under = (root, other_root) if root < other_root else (other_root, root)
            sign = 1 if top == root else -1
            parent[under] = top
            shift[under, 0], shift[under, 1] = sign * down, sign * right
            wraps[top, 0] |= wraps[under, 0]
            wraps[top, 1] |= wraps[under, 1]
    for part in range(parent.size):
        _find_root(parent, shift, part)


@kernel
def measure_parts(
    parts: Array, cells: Array, start: int, wrap_y: bool, wrap_x: bool, measures: Array
) -> None:
    """Measure the parts of a band of rows that begins at row `start` of the plane.

    `measures` (parts, 9), at first `NOTHING`, gets the sums of the cells, of their rows and of their columns,
    the sides across y and across x that face open cells, the first and last row, and the first and last
    column.
    """
    ny, nx = cells.shape
    for k in range(parts.shape[0]):
        i = start + k
        for j in range(nx):
            if parts[k, j] == 0:
                continue
            part = measures[parts[k, j]]
            part[0] += 1
            part[1] += i
            part[2] += j
            part[3] += (i > 0 or wrap_y) and cells[i - 1, j] == 0
            part[3] += (i < ny - 1 or wrap_y) and cells[(i + 1) % ny, j] == 0
            part[4] += (j > 0 or wrap_x) and cells[i, j - 1] == 0
            part[4] += (j < nx - 1 or wrap_x) and cells[i, (j + 1) % nx] == 0
            part[5] = min(part[5], i)
            part[6] = max(part[6], i)
            part[7] = min(part[7], j)
            part[8] = max(part[8], j)
