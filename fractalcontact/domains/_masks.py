"""Masks of contact: their validation, their planes as plain arrays, and datasets on their leading dims.

A mask is boolean, or integer flags where contact means value > 0, with dims (..., y, x), or (..., x) for the
contact of a profile. Every analysis works on a stack of planes; its results carry the leading dims of the
mask. A profile is a plane of one row with the rank 1: what depends on the rank is measured along the row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from fractalcontact.base.grid import UNIFORM, Grid, periodic_axes, read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array as Array
from fractalcontact.base.numbers import float_array, is_within, power_of_two
from fractalcontact.base.resources import has_blocks, thread_count
from fractalcontact.base.schema import CORE_DIMS, QUANTITIES, in_cells
from fractalcontact.base.validation import GIVEN, LARGEST_INTEGER, Problems

S = TypeVar("S")
R = TypeVar("R")

# dims that results add
RESULT_DIMS = ("axis", "box_size", "island", "link", "moment_order", "radius", "scale", "side")
EXPECTED = "a boolean DataArray or integer flags (contact where value > 0) with dims (..., y, x)"
EXPECTED_MEASURE = f"{EXPECTED}; or finite numbers, none negative"
PROFILE_DIMS = ("x",)
PROFILE_FUNCTIONS = "box_dimension, box_counts, correlation_dimension, lacunarity, islands and describe"


@dataclass(frozen=True)
class Planes:
    """The planes of a mask, their grid, and the leading dims they came from.

    `cells` is uint8 of 0 and 1, shape (planes, ny, nx), C order. `valid` is None, or uint8 of shape
    (1 or planes, ny, nx): cells that were not observed are 0 there, and 0 in `cells`. `rank` is the number
    of dims of a mask, 2 for a plane and 1 for a profile, which is a row here: ny is 1, and the spacing of y.
    """

    cells: Array
    valid: Array | None
    grid: Grid
    dims: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    rank: int = 2
    coords: dict[str, xr.Variable] = field(default_factory=dict)
    plane_coords: dict[str, xr.Variable] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of planes."""
        return int(self.cells.shape[0])

    @property
    def plane_size(self) -> int:
        """Number of cells of a plane."""
        return int(self.cells[0].size) if self.count else 0

    @property
    def sides(self) -> tuple[int, ...]:
        """Numbers of cells along the axes of the mask, (ny, nx) or (nx,)."""
        return self.grid.shape[-self.rank :]

    @property
    def periodic(self) -> tuple[bool, ...]:
        """Which axes of the mask are periodic, (y, x) or (x,)."""
        return self.grid.periodic[-self.rank :]

    @cached_property
    def observed(self) -> Array:
        """Observed cells of each plane, int64."""
        ny, nx = self.grid.shape
        if self.valid is None:
            return np.full(self.count, ny * nx, np.int64)
        counts = [np.count_nonzero(plane) for plane in self.valid.view(np.bool_)]
        return np.array(np.broadcast_to(counts, self.count), np.int64)

    @cached_property
    def occupied(self) -> Array:
        """Cells of the set in each plane, int64."""
        return np.array([np.count_nonzero(plane) for plane in self.cells.view(np.bool_)], np.int64)

    @property
    def coverage(self) -> Array:
        """Share of the observed cells in the set; NaN where nothing was observed."""
        return np.where(self.observed > 0, self.occupied / np.maximum(self.observed, 1), np.nan)

    @property
    def side(self) -> float:
        """Edge of a square with the area of one cell, or its length: in metres, 1 without coordinates."""
        return float(np.sqrt(self.grid.cell_area) if self.rank == 2 else self.grid.spacing[1])

    def valid_of(self, plane: int) -> Array | None:
        """Return the observed cells of one plane, or None if all of them are."""
        return None if self.valid is None else self.valid[min(plane, self.valid.shape[0] - 1)]

    def box_coords(self, sizes: Array) -> dict[str, Any]:
        """Return the coordinates of curves over sizes of boxes, in cells and in metres."""
        return {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * self.side)}

    def variable(self, values: Any, *new_dims: str) -> tuple[tuple[str, ...], Array]:
        """Return (dims, values) with the first axis of `values` spread over the leading dims."""
        values = np.asarray(values)
        return (*self.dims, *new_dims), values.reshape(self.shape + values.shape[1:])

    def spread(self, coordinate: xr.Variable) -> Array:
        """Return a coordinate of leading dims for each plane, (planes,)."""
        sizes = dict(zip(self.dims, self.shape, strict=True))
        spread: xr.Variable = coordinate.set_dims(sizes)  # type: ignore[no-untyped-call]
        return np.asarray(spread.transpose(*self.dims).values.reshape(-1))

    def map(self, function: Callable[..., R], *columns: Iterable[Any], passes: int = 1) -> list[R]:
        """Apply a function that makes so many passes over a plane to each.

        Its arguments are cells, observed cells, and the entries of further columns.
        """
        valid = map(self.valid_of, range(self.count))
        planes = zip(self.cells, valid, *columns, strict=True)
        return parallel_map(lambda plane: function(*plane), planes, self.plane_size * passes)

    def dataset(
        self,
        variables: dict[str, Any],
        coords: dict[str, Any] | None = None,
        *,
        on_plane: bool = False,
        notes: dict[str, dict[str, str]] | None = None,
        rows: tuple[str, Array] | None = None,
    ) -> xr.Dataset:
        """Build a Dataset from variables (dims, values), with the coordinates of the leading dims.

        `on_plane` adds the coordinates x and y. `notes` gives attributes by name, which replace those of the
        schema. `rows` names the dim of a table and gives the plane that each of its rows belongs to.
        """
        used = {dim for dims, _ in variables.values() for dim in dims}
        leading = {
            name: values
            for name, values in self.coords.items()
            if name not in variables and (name in QUANTITIES or name in used)
        }
        on_grid = self.plane_coords if on_plane else {}
        of_rows = _row_coords(self, *rows) if rows else {}
        dataset = xr.Dataset(variables, {**leading, **on_grid, **of_rows, **(coords or {})})
        if not self.grid.has_coordinates:  # lengths and areas are in cells
            own = [name for name in dataset.variables if name not in leading and name not in of_rows]
            for name in own:
                dataset.variables[name].attrs.update(in_cells(str(name)))
        for name, attributes in (notes or {}).items():
            present = dataset.variables[name].attrs
            comments = [present.get("comment"), attributes.get("comment")]
            present.update(attributes)
            if any(comments):
                present["comment"] = "; ".join(filter(None, comments))
        return dataset


def check_mask(
    problems: Problems, mask: Any = GIVEN, *, argument: str = "mask", profiles: bool = False
) -> bool:
    """Check a mask, and beside it the arguments `valid` and `periodic`; `read_planes` then reads them.

    `profiles` allows masks of profiles, with dims (..., x).
    """
    given = problems.given
    mask = given.mask if mask is GIVEN else mask
    valid, periodic = getattr(given, "valid", None), getattr(given, "periodic", None)
    is_choice = problems.boolean("periodic", periodic, optional=True)
    is_mask = _check_cells(problems, mask, argument, profiles=profiles)
    is_valid = valid is None or _check_valid(problems, valid, mask if is_mask else None)
    if is_mask and any(dim in mask.coords for dim in mask_dims(mask)):
        is_mask = problems.grid(argument, mask, dims=mask_dims(mask))
    if is_mask and is_choice and periodic is not None:
        is_choice = problems.periodic(mask_grid(mask))
    return is_mask and is_valid and is_choice


def check_measure(problems: Problems, *, profiles: bool = False) -> Any:
    """Check a mask, or a measure of finite numbers, none negative; return its support."""
    mask = problems.given.mask
    if not isinstance(mask, xr.DataArray) or mask.dtype.kind not in "biuf":
        problems.add("mask", EXPECTED_MEASURE)
        mask = None
    elif mask.dtype.kind == "f":
        values = mask.values
        wrong = values.size - int(np.count_nonzero(np.isfinite(values) & (values >= 0)))
        got = f"{wrong} of {values.size} NaN, infinite or negative"
        problems.require(wrong == 0, "mask", EXPECTED_MEASURE, got)
    support = support_of(mask)
    if support is not None:
        check_mask(problems, support, profiles=profiles)
    else:
        problems.boolean("periodic", getattr(problems.given, "periodic", None), optional=True)
        if problems.given.valid is not None:
            _check_valid(problems, problems.given.valid, None)
    return support


def support_of(mask: Any) -> Any:
    """Return the mask of the cells where a measure is positive; a mask as it is."""
    return mask > 0 if isinstance(mask, xr.DataArray) and mask.dtype.kind == "f" else mask


def measure_of(mask: xr.DataArray, planes: Planes) -> Array | None:
    """Return a measure as (planes, ny, nx) float64, zero where nothing was observed; None of a mask.

    Its unit is a power of two near the largest value: no result depends on it, and no square overflows.
    """
    if mask.dtype.kind != "f":
        return None
    values = np.asarray(mask.values.reshape(planes.cells.shape) * planes.cells, np.float64)
    return values / power_of_two(float(values.max()))


def mask_dims(mask: xr.DataArray) -> tuple[str, ...]:
    """Return the dims of one mask: (y, x), or (x,) for the contact of a profile."""
    is_profile = tuple(mask.dims[-1:]) == PROFILE_DIMS and "y" not in mask.dims
    return PROFILE_DIMS if is_profile else CORE_DIMS


def _check_cells(problems: Problems, mask: Any, argument: str, *, profiles: bool) -> bool:
    """Check the type, the dims and the size of a mask."""
    expected = f"{EXPECTED} or (..., x)" if profiles else EXPECTED
    is_profile = isinstance(mask, xr.DataArray) and mask_dims(mask) == PROFILE_DIMS
    if not isinstance(mask, xr.DataArray):
        problems.add(argument, expected, mask)
    elif mask.dtype.kind not in "biu":
        expected = f"{expected}; compare numbers first, as in `pressure > 0`"
        problems.add(argument, expected, f"type {mask.dtype}")
    elif is_profile and not profiles:
        alternative = f"; for the contact of a profile, dims (..., x), there are {PROFILE_FUNCTIONS}"
        problems.add(argument, expected + alternative, f"sizes {dict(mask.sizes)}")
    elif not (is_profile or tuple(mask.dims[-2:]) == CORE_DIMS) or min(mask.shape, default=0) < 1:
        problems.add(argument, expected + ", none of them empty", f"sizes {dict(mask.sizes)}")
    elif set(RESULT_DIMS) & set(mask.dims):
        problems.add(f"{argument}.dims", f"leading dims other than {', '.join(RESULT_DIMS)}", mask.dims)
    else:
        units = mask.attrs.get("units", "1")
        return problems.require(isinstance(units, str), f"{argument}.units", "a string, or none", units)
    return False


def _check_valid(problems: Problems, valid: Any, mask: xr.DataArray | None) -> bool:
    """Check that the observed cells lie on the same grid, and on the same leading dims, as a valid mask."""
    core, every = (CORE_DIMS, CORE_DIMS) if mask is None else (mask_dims(mask), tuple(mask.dims))
    dims = tuple(valid.dims) if isinstance(valid, xr.DataArray) else None
    if dims is None or valid.dtype.kind != "b" or (mask is not None and dims not in (core, every)):
        got = f"type {valid.dtype}" if dims is not None and valid.dtype.kind != "b" else valid
        problems.add("valid", f"a boolean DataArray with dims ({', '.join(core)}) or {every}", got)
        return False
    if mask is None:
        return True
    expected_shape = mask.shape[-valid.ndim :]
    if valid.shape != expected_shape:
        problems.add("valid", f"the shape of the mask, {expected_shape}", f"shape {valid.shape}")
        return False
    matches = True
    for dim in dims:
        if dim in mask.coords and dim in valid.coords:
            own, other = mask.coords[dim].values, valid.coords[dim].values
            # of more than 6 centres both ends
            expected, got = (np.array2string(values, threshold=6) for values in (own, other))
            expected = f"that of the mask, {expected}"
            matches &= problems.require(_same_coordinates(own, other), f"valid.{dim}", expected, got)
    return matches


def _same_coordinates(first: Array, second: Array) -> bool:
    """Return whether two coordinates agree; numbers may differ by a millionth of their spacing."""
    if first.dtype.kind not in "iuf" or second.dtype.kind not in "iuf":
        return bool(np.array_equal(first, second))
    spacing = np.abs(np.diff(first)).min() if first.size > 1 else 0.0
    return bool(np.all(np.abs(first - second) <= UNIFORM * spacing))


def plane_shape(mask: Any) -> tuple[int, int]:
    """Return (ny, nx) of a mask with dims (..., y, x); of anything else, the largest there could be."""
    if not isinstance(mask, xr.DataArray) or tuple(mask.dims[-2:]) != CORE_DIMS or mask.size == 0:
        return LARGEST_INTEGER, LARGEST_INTEGER
    return int(mask.shape[-2]), int(mask.shape[-1])


def mask_sides(mask: Any) -> tuple[int, ...]:
    """Return the numbers of cells along the axes of a mask as `plane_shape`, (nx,) for that of a profile."""
    if isinstance(mask, xr.DataArray) and mask_dims(mask) == PROFILE_DIMS and mask.size > 0:
        return (int(mask.shape[-1]),)
    return plane_shape(mask)


def mask_grid(mask: xr.DataArray) -> Grid:
    """Return the grid of a mask that passed `check_mask`; without coordinates its unit is one cell."""
    dims = mask_dims(mask)
    if any(dim in mask.coords for dim in dims):
        return read_grid(mask, dims)
    shape = tuple(int(mask.sizes[dim]) for dim in dims)
    return Grid(shape, (1.0,) * len(dims), (False,) * len(dims), has_coordinates=False)


def read_planes(
    mask: xr.DataArray, *, valid: xr.DataArray | None = None, periodic: bool | None = None
) -> Planes:
    """Return the planes of a mask that passed `check_mask`."""
    grid, dims = mask_grid(mask), mask_dims(mask)
    wraps = periodic_axes(periodic, grid)
    if dims == PROFILE_DIMS:  # a plane of one row
        grid = Grid((1, *grid.shape), (1.0, *grid.spacing), (False, *wraps), grid.has_coordinates)
    else:
        grid = Grid(grid.shape, grid.spacing, wraps, grid.has_coordinates)
    cells = _flags(mask).view(np.uint8).reshape(-1, *grid.shape)
    observed = None
    if valid is not None:
        observed = _flags(valid).view(np.uint8).reshape(-1, *grid.shape)
        cells = cells * observed
        observed = None if observed.all() else observed  # without gaps sums are exact that are not with them
    return Planes(
        cells,
        observed,
        grid,
        tuple(str(dim) for dim in mask.dims[: -len(dims)]),
        tuple(mask.shape[: -len(dims)]),
        len(dims),
        leading_coords(mask, mask.dims[: -len(dims)], RESULT_DIMS),
        {dim: mask.coords.variables[dim] for dim in dims} if grid.has_coordinates else {},
    )


def _flags(mask: xr.DataArray) -> Array:
    """Return where the mask is set, as a C-ordered array; a chunked mask is read chunk by chunk."""
    if has_blocks(mask):
        flags = np.empty(mask.shape, bool)
        (mask.data > 0).store(flags)
        return flags
    values = np.ascontiguousarray(mask.values)
    return values if values.dtype.kind == "b" else np.asarray(values > 0)


def continued(cells: Array, reach: int, periodic: Sequence[bool]) -> Array:
    """Return a plane with so many cells more beyond each edge: its own around a period, else none."""
    around = np.pad(cells, reach)
    for axis, (n, wraps) in enumerate(zip(cells.shape, periodic, strict=True)):
        if wraps:
            beyond = np.append(np.arange(-reach, 0), n + np.arange(reach))
            lines = np.moveaxis(around, axis, 0)
            lines[reach + beyond] = lines[reach + beyond % n]
    return around


def _row_coords(planes: Planes, row: str, plane: Array) -> dict[str, Any]:
    """Return where along every leading dim the plane of each row of a table lies.

    The coordinates are named after the row and the dim, as in `island_step`. A dim that is not in the
    schema gives its index.
    """
    coords: dict[str, Any] = {}
    places = np.unravel_index(plane, planes.shape) if planes.dims else ()
    for dim, length, index in zip(planes.dims, planes.shape, places, strict=True):
        if f"{row}_{dim}" in QUANTITIES:
            values = planes.coords[dim].values if dim in planes.coords else np.arange(length)
            coords[f"{row}_{dim}"] = (row, values[index])
        else:
            attributes = {"units": "1", "long_name": f"index of the {row} along {dim}"}
            coords[f"{row}_{dim}"] = (row, index, attributes)
    return coords


def parallel_map(function: Callable[[S], R], items: Iterable[S], cells: int) -> list[R]:
    """Apply a function that releases the interpreter lock to all items, in order.

    Each item takes a pass over so many cells. On several threads where that is worth their start, some items
    at a time: to hand over one takes as long as a pass over a thousand cells.
    """
    items = list(items)
    cells_per_thread = 1 << 18  # a pass over so many takes as long as to start a pool of threads
    threads = min(thread_count(), len(items), len(items) * cells // cells_per_thread)
    if threads < 2:
        return [function(item) for item in items]
    size = max(1, min(len(items) // (4 * threads), cells_per_thread // max(1, cells)))
    chunks = [items[start : start + size] for start in range(0, len(items), size)]
    with ThreadPoolExecutor(threads) as pool:
        results = pool.map(lambda chunk: [function(item) for item in chunk], chunks)
        return [result for chunk in results for result in chunk]


def check_box_sizes(problems: Problems, longest: int) -> bool:
    """Check edges of boxes in cells: None, or integers from 1 to `longest`."""
    return problems.numbers("box_sizes", at_least=1, at_most=longest, integral=True, optional=True)


def check_along(problems: Problems) -> bool:
    """Check the leading dim that is the path, or None; of what is no mask, that it is a word."""
    mask, along = problems.given.mask, problems.given.along
    if along is None:
        return True
    if plane_shape(mask)[0] == LARGEST_INTEGER:
        return problems.require(isinstance(along, str), "along", "a leading dim of the mask")
    return problems.choice("along", among=[str(dim) for dim in mask.dims[:-2]])


def check_window(problems: Problems, *, has_mask: bool) -> None:
    """Check a window, (low, high) in metres, of which the longest box must fit into half a valid mask."""
    window = problems.given.window
    if window is None or not problems.numbers("window", above=0.0):
        return
    values = float_array(window)
    is_pair = values.shape == (2,) and values[0] < values[-1]
    if problems.require(is_pair, "window", "two lengths, (low, high)") and has_mask:
        grid = mask_grid(problems.given.mask)
        longest = min(grid.extent) / 2.0
        ends = f"{max(grid.spacing):g} to {longest:g} {grid.length_unit}"
        expected = f"from a cell to half the extent, {ends}"
        problems.require(bool(is_within(values, max(grid.spacing), longest).all()), "window", expected)


def read_box_sizes(sizes: Any, default: Array) -> Array:
    """Return edges of boxes that passed `check_box_sizes`, ascending and without repetition, int64."""
    return default if sizes is None else np.unique(float_array(sizes).astype(np.int64))
