"""Lacunarity: how unevenly a set or a field fills the plane, by the size of a box.

Below it, the moments of the mass in a gliding box, by blocks of positions, and the jackknife over these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.jit import inner_kernel, sum_kernel
from fractalcontact.base.regression import student_quantile
from fractalcontact.base.resources import Plane
from fractalcontact.base.results import ARRAYS, public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._aligned_boxes import joined_boxes
from fractalcontact.domains._masks import Array, Planes

SOURCE = (
    "Allain and Cloitre, Phys. Rev. A 44:3552 (1991); Plotnick et al., Phys. Rev. E 53:5461 (1996) "
    "(gliding box); Lantuejoul, J. Microsc. 161:387 (1991) (integral range)"
)
BLOCKS = 4  # along each axis: 16 give 15 degrees of freedom, and each is still wider than a box of L/8
LARGEST_INT32, LARGEST_INT64 = (np.iinfo(dtype).max for dtype in (np.int32, np.int64))
BOXES = ("gliding", "fixed", "along_x", "along_y")


def _check(problems: Problems) -> None:
    problems.choice("boxes", among=BOXES)
    support = _masks.check_measure(problems, profiles=True)
    _masks.check_box_sizes(problems, min(_masks.mask_sides(support)))


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of a call: boxes glide over a set row by row."""
    is_field = getattr(arguments.get("mask"), "dtype", np.dtype(bool)).kind == "f"
    glides = arguments.get("boxes") != "fixed" and not is_field
    return (2.0 if glides else ARRAYS) * plane.cells


@public_result(
    title="Lacunarity", references=SOURCE, achieved_error="exact to rounding", check=_check, memory=_memory
)
def lacunarity(
    mask: xr.DataArray,
    box_sizes: Any = None,
    *,
    boxes: str = "gliding",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Lacunarity of a set of cells, or of a field such as the contact pressure, by gliding boxes.

    A box of r x r cells moves over the plane cell by cell; M is the mass in it, the number of cells of the
    set or the sum of the field, and the lacunarity is <M^2> / <M>^2 over all positions: 1 for an even set,
    more for a set with gaps at the size of the box.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        A set: boolean, or integer flags where contact means value > 0. Or a measure: finite numbers, none
        negative.
    box_sizes : sequence of int, optional
        Edges of the box in cells; by default the powers of two up to half the shorter side.
    boxes : {"gliding", "along_x", "along_y", "fixed"}
        All positions of a square; of a row of 1 x r cells along x, or of a column along y; or the squares of
        the one grid that starts at the first cell, on which sets built by a fixed rule have the lacunarity
        (L/r)^(2 - D) exactly.
    periodic : bool, optional
        Whether the box wraps around the edges; by default along periodic axes. True needs periodic axes. On a
        free axis only positions inside the plane count.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells; only boxes of observed cells count.

    Returns
    -------
    Dataset
        Over the leading dims and `box_size` (cells; `box_length` in m): `lacunarity`, with `lacunarity_low`,
        `lacunarity_high`, its 95 % interval from the jackknife over 16 blocks of positions;
        `null_lacunarity`, 1 + (1 - p) / (p r^2) (of a row p r) for independent cells;
        `normalised_lacunarity`, (lacunarity - 1) p / (1 - p); of squares `integral_range` (m2),
        (lacunarity - 1) p s^2, the area of an independent patch. Over the leading dims: `coverage`, the share
        of cells in the set. Of a field, p is <f>^2 / <f^2>, which of a set is its coverage.

    Raises
    ------
    InvalidInput
        The mask, a size, `boxes`, `periodic` or `valid` is not as described.

    Notes
    -----
    At one cell the lacunarity is 1 / p. NaN where the set is empty or no box was fully observed, with the
    reason in `comment`; the normalised one also where the set is full; the interval also for fixed boxes, and
    for more than 24 sizes of a periodic plane, which are computed by one transform.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> chequerboard = xr.DataArray(np.indices((16, 16)).sum(0) % 2, dims=("y", "x"))
    >>> result = fc.domains.lacunarity(chequerboard, [1, 2, 4], periodic=True)
    >>> result.lacunarity.values.tolist()
    [2.0, 1.0, 1.0]
    """
    planes = _masks.read_planes(_masks.support_of(mask), valid=valid, periodic=periodic)
    return analyse(planes, box_sizes, boxes=boxes, field=_masks.measure_of(mask, planes))


def analyse(
    planes: Planes, box_sizes: Any = None, *, boxes: str = "gliding", field: Array | None = None
) -> xr.Dataset:
    """Return the result of `lacunarity` for planes, or a field (planes, ny, nx), without labels."""
    half = max(1, min(planes.sides) // 2)
    sizes = _masks.read_box_sizes(box_sizes, 2 ** np.arange(half.bit_length(), dtype=np.int64))
    cells = planes.cells if field is None else field
    values, low, high = _with_interval(planes, cells, sizes, boxes)
    p = planes.coverage
    if field is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            p = field.sum((1, 2)) ** 2 / ((field**2).sum((1, 2)) * planes.observed)
    is_square = planes.rank == 2 and boxes in ("gliding", "fixed")
    area = sizes.astype(float) ** (2 if is_square else 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.where(p > 0, (1.0 - p) / p, np.nan)
        normalised = (values - 1.0) / np.where(spread > 0, spread, np.nan)[:, None]
    variables = {
        "coverage": planes.variable(planes.coverage),
        "lacunarity": planes.variable(values, "box_size"),
        "lacunarity_low": planes.variable(low, "box_size"),
        "lacunarity_high": planes.variable(high, "box_size"),
        "null_lacunarity": planes.variable(1.0 + spread[:, None] / area, "box_size"),
        "normalised_lacunarity": planes.variable(normalised, "box_size"),
    }
    if is_square:
        patch = (values - 1.0) * p[:, None] * area * planes.grid.cell_area
        variables["integral_range"] = planes.variable(patch, "box_size")
    return planes.dataset(variables, planes.box_coords(sizes), notes=_notes(planes, values, boxes))


def _with_interval(planes: Planes, cells: Array, sizes: Array, boxes: str) -> tuple[Array, Array, Array]:
    """Return <M^2> / <M>^2 and the ends of its interval, each (planes, sizes); NaN where undefined."""
    many = 24  # above so many sizes one transform is cheaper than a sum for each
    all_positions = planes.valid is None and all(planes.grid.periodic) and cells.dtype == np.uint8
    if boxes == "fixed":
        values = _fixed_lacunarity(planes, cells, sizes)
    elif boxes == "gliding" and all_positions and sizes.size > many:
        values = np.array([_lacunarity_from_pairs(plane, sizes) for plane in cells])
    else:
        shapes = np.stack([sizes if boxes != "along_x" else 0 * sizes + 1, sizes], axis=-1)
        if boxes == "along_y":
            shapes[:, 1] = 1
        elif planes.rank == 1:
            shapes[:, 0] = 1
        replicates = box_moments(planes, shapes, cells)[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            width = np.exp(half_width(np.log(replicates - 1.0)))
        excess = replicates[:, 0] - 1.0
        return replicates[:, 0], 1.0 + excess / width, 1.0 + excess * width
    nothing = np.full(values.shape, np.nan)
    return values, nothing, nothing


def _lacunarity_from_pairs(cells: Array, sizes: Array) -> Array:
    """All sizes at once from the numbers of pairs of cells at every distance (Wiener-Khinchin)."""
    ny, nx = cells.shape
    mass = int(np.count_nonzero(cells))
    if mass == 0:
        return np.full(sizes.size, np.nan)
    modes = fft.rfft2(cells.astype(np.float64))
    power = (modes.real**2 + modes.imag**2).astype(np.complex128)
    pairs = fft.irfft2(power, (ny, nx), overwrite=True)
    squares = squares_from_pairs(np.rint(pairs, out=pairs), int(sizes.max()))
    return np.array([ny * nx * squares[s - 1] / float(mass * s**2) ** 2 for s in sizes.tolist()])


def _fixed_lacunarity(planes: Planes, cells: Array, sizes: Array) -> Array:
    """Return <M^2> / <M>^2 over the fully observed boxes inside, of the grid from the first cell."""

    def lacunarity(valid: Array | None, plane: Array) -> list[float]:
        observed = np.ones(plane.shape) if valid is None else valid.astype(float)
        areas, sums = (joined_boxes(each, sizes, np.add) for each in (observed, plane.astype(float)))
        boxes = zip(sizes, areas, sums, strict=True)
        masses = [mass[area == size**planes.rank] for size, area, mass in boxes]
        return [
            float(mass.size * (mass**2).sum() / total**2) if (total := mass.sum()) > 0 else np.nan
            for mass in masses
        ]

    return np.array(planes.map(lambda _, valid, plane: lacunarity(valid, plane), cells))


def _notes(planes: Planes, values: Array, boxes: str) -> dict[str, dict[str, str]]:
    empty = planes.occupied == 0
    reasons = []
    if empty.any():
        reasons.append(f"the set is empty ({int(empty.sum())} planes)")
    if np.isnan(values[~empty]).any():
        reasons.append("no box was wholly observed, or none of those holds a cell")
    names = {"fixed": "fixed grid of boxes", "along_x": "boxes along x", "along_y": "boxes along y"}
    attributes = {"long_name": f"lacunarity ({names[boxes]})"} if boxes in names else {}
    if reasons:
        attributes["comment"] = "NaN where " + " or where ".join(reasons)
    notes = {"lacunarity": attributes}
    if (planes.coverage == 1).any():
        notes["normalised_lacunarity"] = {
            "comment": "NaN where the set is full or empty: its normalisation is undefined"
        }
    return notes


def squares_from_pairs(pairs: Array, largest: int) -> list[Any]:
    """Return the sum of squared masses for every size from 1 to `largest`, both axes periodic.

    `pairs[u, v]` is the number of pairs of set cells u rows and v columns apart, on the torus. The sum of
    squares is that of (s - |u|)(s - |v|) pairs[u, v] over |u|, |v| < s, so a double sum of double sums.
    """
    size = pairs.size
    for axis in (0, 1):  # both signs of each distance
        lines = np.moveaxis(pairs, axis, 0)
        both = lines[:largest].copy()
        both[1:] += lines[:-largest:-1]
        pairs = np.moveaxis(both, 0, axis)
    sums = pairs.astype(np.int64 if size * largest**4 <= LARGEST_INT64 else np.float64)
    for axis in (0, 0, 1, 1):
        np.cumsum(sums, axis, out=sums)
    return list(sums.diagonal().tolist())


def box_moments(planes: Planes, boxes: Array, masses: Array | None = None) -> tuple[Array, Array]:
    """Return the share of positions that meet the set, and the lacunarity <M^2> / <M>^2, by box.

    A box of any height and width moves over the plane cell by cell. Of its mass M (the cells of the set in
    it, or the sum of a field) the number of positions with M > 0, the sum of M and the sum of M^2 are added
    up in 4 x 4 blocks of positions. Hit probability, lacunarity and everything made of them are functions of
    such sums, so leaving out one block after the other gives their standard errors (Quenouille 1956; Kunsch
    1989 for blocks). On a free axis only positions inside the plane count, with gaps only those at which
    every cell was observed.

    Parameters
    ----------
    planes : Planes
    boxes : ndarray of int64, shape (boxes, 2)
        Height and width of each in cells; NaN where one is longer than a free axis.
    masses : ndarray of float64, shape (planes, ny, nx), optional
        A field, at least 0 and 0 where nothing was observed; by default the cells of the set.

    Returns
    -------
    hit, lacunarity : ndarray, shape (planes, 1 + blocks, boxes)
        Over all positions, then without each of the blocks in turn.
    """
    blocks = np.array(
        planes.map(
            lambda _, valid, mass: _box_sums(mass, valid, boxes, planes.grid.periodic),
            planes.cells if masses is None else masses,
            passes=len(boxes),
        )
    )
    total = blocks.sum(-1)[..., None]
    sums = np.concatenate([total, total - blocks], axis=-1).swapaxes(-1, -2)
    places, hits, mass, squares = np.moveaxis(sums, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return hits / places, np.where(mass > 0, places * squares / mass**2, np.nan)


def _box_sums(cells: Array, valid: Array | None, boxes: Array, periodic: Sequence[bool]) -> Array:
    """Return positions, hits, masses and squared masses of one plane for all boxes, (4, boxes, blocks)."""
    (ny, nx), (wrap_y, wrap_x) = cells.shape, periodic
    sums = np.zeros((len(boxes), 4, BLOCKS if ny == 1 else BLOCKS * BLOCKS))
    observed = np.zeros((0, 0), np.uint8) if valid is None else valid
    for box, (height, width) in enumerate(boxes.tolist()):
        rows, across = ny if wrap_y else ny - height + 1, nx if wrap_x else nx - width + 1
        if rows < 1 or across < 1:
            continue
        # masses are exact integers; their squares along a row too, unless the box is longer than 2^14 cells
        is_exact = cells.dtype == np.uint8 and (height * width) ** 2 * across <= LARGEST_INT64
        exact = np.int32 if is_exact and nx * height <= LARGEST_INT32 else np.float64
        columns, prefix = np.zeros(nx, exact), np.zeros(nx + width + 1, exact)
        seen, seen_prefix = np.zeros(nx, np.int32), np.zeros(nx + width + 1, np.int32)
        work = columns, prefix, seen, seen_prefix
        glide(cells, observed, height, width, rows, across, *work, sums[box])
    return sums.swapaxes(0, 1)


def half_width(replicates: Array) -> Array:
    """Return the half-width of the 95 % interval of an estimate from its values without each block, axis 1.

    Student's t, of as many degrees of freedom as there are blocks, less one.
    """
    leave = replicates[:, 1:]
    n = leave.shape[1]
    with np.errstate(invalid="ignore"):  # logarithms of nothing
        deviations = leave - leave.mean(1, keepdims=True)
    error = np.sqrt((n - 1) / n * (deviations**2).sum(1))
    return np.asarray(student_quantile(n - 1) * error)


@inner_kernel
def add_row(columns: Array, entering: Array, leaving: Array, leaves: bool) -> None:
    """Move the sums over a column of the box on by one row."""
    if leaves:
        for j in range(columns.size):
            columns[j] += entering[j]
            columns[j] -= leaving[j]
    else:
        for j in range(columns.size):
            columns[j] += entering[j]


@inner_kernel
def add_up(columns: Array, prefix: Array, count: int) -> None:
    """Add up columns from the left, `count` of them; a periodic axis continues."""
    total = prefix[0]
    for j in range(min(count, columns.size)):
        total += columns[j]
        prefix[j + 1] = total
    for j in range(columns.size, count):
        total += columns[j - columns.size]
        prefix[j + 1] = total


@sum_kernel
def glide(
    cells: Array,
    valid: Array,
    height: int,
    width: int,
    rows: int,
    across: int,
    columns: Array,
    prefix: Array,
    seen: Array,
    seen_prefix: Array,
    sums: Array,
) -> None:
    """Add up positions, hits, masses and squared masses, `sums` (4, blocks), over rows x across positions.

    `valid` is empty where everything was observed. Zeros to work in: `columns` (nx) and `prefix`
    (nx + width + 1), of the type in which masses and squares are exact, int32 or float64; `seen` and
    `seen_prefix`, of the same sizes.
    """
    ny, blocks = len(cells), BLOCKS
    has_gaps = valid.size > 0
    area = height * width
    for i in range(1 - height, rows):
        entering = (i + height - 1) % ny
        add_row(columns, cells[entering], cells[max(i - 1, 0)], i > 0)
        if has_gaps:
            add_row(seen, valid[entering], valid[max(i - 1, 0)], i > 0)
        if i < 0:
            continue
        add_up(columns, prefix, across + width - 1)
        if has_gaps:
            add_up(seen, seen_prefix, across + width - 1)
        for block in range(blocks):
            start, stop = -(-block * across // blocks), -(-(block + 1) * across // blocks)
            left, right = prefix[start:stop], prefix[start + width : stop + width]
            seen_left, seen_right = seen_prefix[start:stop], seen_prefix[start + width : stop + width]
            places, hits = 0, 0
            mass, square = np.int64(0) * prefix[0], 0.0
            for j in range(left.size):
                inside = prefix.dtype.type(right[j] - left[j])
                if has_gaps and seen_right[j] - seen_left[j] < area:
                    inside = prefix.dtype.type(0)
                else:
                    places += 1
                hits += inside > 0
                mass += inside
                square += np.float64(inside) * np.float64(inside)
            target = i * blocks // rows * blocks + block
            sums[0, target] += places
            sums[1, target] += hits
            sums[2, target] += mass
            sums[3, target] += square
