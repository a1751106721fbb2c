"""Reading a mask, and putting results back on its leading dims.

A mask is boolean, or integer flags where contact means value > 0, with dims (..., y, x). Every study of this
room works on a stack of planes and gives back what the leading dims of the mask were.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.grid import Grid, grid_of, resolve_periodic
from fractalcontact.base.schema import CORE_DIMS, QUANTITIES, label
from fractalcontact.base.threads import thread_count

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]
S = TypeVar("S")
R = TypeVar("R")

TAKEN = ("axis", "box_size", "island", "link", "moment_order", "radius")  # dims that results add
EXPECTED = "a boolean DataArray or integer flags (contact where value > 0) with dims (..., y, x)"


@dataclass(frozen=True)
class Planes:
    """The planes of a mask, their grid, and the dims they came in.

    `cells` is uint8 of 0 and 1, shape (planes, ny, nx), C order. `valid` is None, or uint8 of shape
    (1 or planes, ny, nx): cells that were not observed are 0 there, and 0 in `cells`.
    """

    cells: Array
    valid: Array | None
    grid: Grid
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    coords: dict[str, xr.Variable]
    plane_coords: dict[str, xr.Variable]

    @property
    def count(self) -> int:
        """Number of planes."""
        return int(self.cells.shape[0])

    @cached_property
    def observed(self) -> Array:
        """Observed cells of each plane, int64."""
        ny, nx = self.grid.shape
        if self.valid is None:
            return np.full(self.count, ny * nx, np.int64)
        seen = [np.count_nonzero(plane) for plane in self.valid.view(np.bool_)]
        return np.array(np.broadcast_to(seen, self.count), np.int64)

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
        """Edge in metres of a square as large as one cell; NaN without coordinates."""
        return float(np.sqrt(self.grid.cell_area)) if self.grid.known else float("nan")

    def valid_of(self, plane: int) -> Array | None:
        """Return the observed cells of one plane, or None if all of them are."""
        return None if self.valid is None else self.valid[min(plane, self.valid.shape[0] - 1)]

    def variable(self, values: Any, *new: str) -> tuple[tuple[str, ...], Array]:
        """Return (dims, values) with the first axis of `values` spread over the leading dims."""
        values = np.asarray(values)
        return (*self.dims, *new), values.reshape(self.shape + values.shape[1:])


def read_mask(
    mask: Any,
    problems: Problems,
    *,
    valid: Any = None,
    periodic: bool | None = None,
    argument: str = "mask",
) -> Planes:
    """Check a mask and what was observed of it; lay the planes out."""
    import xarray as xr

    stand_in = Planes(
        np.zeros((1, 1, 1), np.uint8), None, Grid((1, 1), (1.0, 1.0), (False, False)), (), (), {}, {}
    )
    if not isinstance(mask, xr.DataArray):
        problems.add(argument, EXPECTED, mask)
        return stand_in
    if mask.dtype.kind not in "biu":
        problems.add(
            argument, f"{EXPECTED}; compare numbers first, as in `pressure > 0`", f"type {mask.dtype}"
        )
        return stand_in
    if tuple(mask.dims[-2:]) != CORE_DIMS or min(mask.shape, default=0) < 1:
        problems.add(argument, EXPECTED + ", none of them empty", f"sizes {dict(mask.sizes)}")
        return stand_in
    if set(TAKEN) & set(mask.dims):
        problems.add(f"{argument}.dims", f"leading dims other than {', '.join(TAKEN)}", mask.dims)
        return stand_in
    grid = _grid(mask, problems, argument)
    wraps = resolve_periodic(periodic, grid, problems, "periodic")
    grid = Grid(grid.shape, grid.spacing, (wraps[0], wraps[1]), grid.known)
    cells = _flags(mask).view(np.uint8).reshape(-1, *grid.shape)
    observed = _observed(valid, mask, problems)
    if observed is not None:
        cells = cells * observed
    return Planes(
        cells,
        observed,
        grid,
        tuple(str(dim) for dim in mask.dims[:-2]),
        tuple(mask.shape[:-2]),
        leading_coords(mask, mask.dims[:-2], TAKEN),
        {dim: mask.coords[dim].variable for dim in CORE_DIMS} if grid.known else {},
    )


def _flags(mask: xr.DataArray) -> Array:
    """Return where the mask is set, as a C-ordered array; a chunked mask is read chunk by chunk."""
    if mask.chunks is None:
        values = np.ascontiguousarray(mask.values)
        return values if values.dtype.kind == "b" else np.asarray(values > 0)
    flags = np.empty(mask.shape, bool)
    stops = [np.cumsum(lengths) for lengths in mask.chunks]
    for block in np.ndindex(*(len(each) for each in stops)):
        where = tuple(
            slice(int(stop[k]) - lengths[k], int(stop[k]))
            for stop, lengths, k in zip(stops, mask.chunks, block, strict=True)
        )
        np.greater(mask[where].values, 0, out=flags[where])
    return flags


def _grid(mask: xr.DataArray, problems: Problems, argument: str) -> Grid:
    if any(dim in mask.coords for dim in CORE_DIMS):
        return grid_of(mask, problems, argument)
    shape = (int(mask.sizes["y"]), int(mask.sizes["x"]))
    return Grid(shape, (1.0, 1.0), (False, False), known=False)


def _observed(valid: Any, mask: xr.DataArray, problems: Problems) -> Array | None:
    """Return the observed cells as (1 or planes, ny, nx), or None if nothing is said."""
    import xarray as xr

    if valid is None:
        return None
    dims = tuple(valid.dims) if isinstance(valid, xr.DataArray) else None
    ny, nx = mask.shape[-2:]
    if dims is None or valid.dtype.kind != "b" or dims not in (CORE_DIMS, tuple(mask.dims)):
        problems.add("valid", f"a boolean DataArray with dims (y, x) or {tuple(mask.dims)}", valid)
        return None
    if valid.shape != mask.shape[-valid.ndim :]:
        problems.add("valid", f"the shape of the mask, {mask.shape[-valid.ndim :]}", f"shape {valid.shape}")
        return None
    for dim in dims:
        if dim in mask.coords and dim in valid.coords:
            here, there = mask.coords[dim].values, valid.coords[dim].values
            expected, got = (np.array2string(values, threshold=6) for values in (here, there))
            problems.require(_same_places(here, there), f"valid.{dim}", f"that of the mask, {expected}", got)
    return _flags(valid).view(np.uint8).reshape(-1, ny, nx)


def _same_places(here: Array, there: Array) -> bool:
    """Return whether two coordinates are the same, numbers to a millionth of their step."""
    if here.dtype.kind not in "iuf" or there.dtype.kind not in "iuf":
        return bool(np.array_equal(here, there))
    step = np.abs(np.diff(here)).min() if here.size > 1 else 0.0
    return bool(np.all(np.abs(here - there) <= 1e-6 * step))


def assemble(
    planes: Planes,
    variables: dict[str, Any],
    coords: dict[str, Any] | None = None,
    *,
    on_plane: bool = False,
    notes: dict[str, dict[str, str]] | None = None,
    rows: tuple[str, Array] | None = None,
) -> xr.Dataset:
    """Build a labelled Dataset from variables (dims, values) on the dims of the mask.

    `notes` gives further attributes by name, or other units and meanings than those of the schema. `rows` is
    the dim of a table and the plane that each of its rows is about.
    """
    import xarray as xr

    known, unknown = _row_coords(planes, *rows) if rows else ({}, {})
    used = {dim for dims, _ in variables.values() for dim in dims}
    told = {
        name: values
        for name, values in planes.coords.items()
        if name not in variables and (name in QUANTITIES or name in used)
    }
    there = {**told, **(planes.plane_coords if on_plane else {}), **known, **(coords or {})}
    dataset = label(xr.Dataset(variables, coords=there))
    for name, values in unknown.items():
        dataset.coords[name] = values
        dataset.coords[name].encoding["_FillValue"] = None
    for name, attributes in (notes or {}).items():
        dataset[name].attrs.update(attributes)
    return dataset


def _row_coords(planes: Planes, row: str, plane: Array) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return where along every leading dim the plane of each row of a table lies.

    The coordinates are called after the row and the dim, as in `island_step`. Dims that the schema does not
    know come second, with the index.
    """
    known: dict[str, Any] = {}
    unknown: dict[str, Any] = {}
    places = np.unravel_index(plane, planes.shape) if planes.dims else ()
    for dim, length, index in zip(planes.dims, planes.shape, places, strict=True):
        if f"{row}_{dim}" in QUANTITIES:
            values = planes.coords[dim].values if dim in planes.coords else np.arange(length)
            known[f"{row}_{dim}"] = (row, values[index])
        else:
            attributes = {"units": "1", "long_name": f"index of the {row} along {dim}"}
            unknown[f"{row}_{dim}"] = (row, index, attributes)
    return known, unknown


def together(function: Callable[[S], R], items: Iterable[S]) -> list[R]:
    """Apply a function that holds no Python lock to all items, on the threads of this process, in order."""
    items = list(items)
    threads = min(thread_count(), len(items))
    if threads < 2:
        return [function(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, items))


def box_sizes(sizes: Any, default: Array, problems: Problems, argument: str, *, longest: int) -> Array:
    """Return edges of boxes in cells: whole numbers, ascending, each once."""
    if sizes is None:
        return default
    values = problems.numbers(argument, sizes, at_least=1, at_most=longest)
    whole = np.rint(values)
    if not np.array_equal(whole, values):
        problems.add(argument, "whole numbers of cells", values[whole != values][0])
    return np.unique(whole.astype(np.int64))
