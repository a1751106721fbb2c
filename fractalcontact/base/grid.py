"""Uniform grids: cell centres, spacing, periodicity, and the faults of a surface, mask or result.

The coordinate of an axis holds the centres of its cells, ascending and uniform, in metres; the extent is
n * spacing. A periodic axis has the attribute `period` in metres. It counts as periodic only while
period = n * spacing, so that a crop is not periodic. A result may come from a file or from a user's own
arithmetic, which can drop units, turn numbers into objects or select nothing along a dim.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array, is_real
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.schema import CORE_DIMS, QUANTITIES, Quantity, in_cells, is_in_cells

# largest distance of a centre from its place on a uniform axis, in spacings: a height is then off by 1e-6 of
# its increment
UNIFORM = 1e-6
DECADES = 100  # squares and cubes of lengths between 1e-100 and 1e100 m can be represented
_LENGTHS = f"1e-{DECADES} to 1e{DECADES} m"
# share of a cell by which each edge of `contact_edges` makes the counted area too large (Yastrebov, Anciaux
# and Molinari 2017)
EXCESS_PER_EDGE = (math.pi - 1.0 + math.log(2.0)) / 24.0
METRES = ("m", "meter", "metre", "meters", "metres")
PATH_DIMS = (
    *("member", "direction", "shear", "step", "axis", "method", "azimuth", "wavelength", "structure_size"),
    *CORE_DIMS,
)
Fault = tuple[str, str, object]  # argument, what is expected, what is given


@dataclass(frozen=True)
class Grid:
    """Shape (ny, nx), spacing (dy, dx) in metres, and which axes are periodic, (y, x).

    A profile has one entry in each. A mask without coordinates has a spacing of one cell and no lengths in
    metres; `has_coordinates` is then False.
    """

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    periodic: tuple[bool, ...]
    has_coordinates: bool = True

    @property
    def extent(self) -> tuple[float, ...]:
        """Edge lengths n * spacing in metres."""
        return tuple(n * s for n, s in zip(self.shape, self.spacing, strict=True))

    @property
    def length_unit(self) -> str:
        """Unit of lengths."""
        return "m" if self.has_coordinates else "cells"

    @property
    def cell_area(self) -> float:
        """Area of one cell in m2."""
        return float(np.prod(self.spacing))

    @property
    def nominal_area(self) -> float:
        """Area of the extent in m2."""
        return float(np.prod(self.extent))


def core_dims(array: xr.DataArray) -> tuple[str, ...]:
    """Return the dims of one plane or profile of the array: (y, x), or (x,) where there is no y."""
    return ("y", "x") if "y" in array.dims else ("x",)


def read_grid(array: xr.DataArray, dims: Sequence[str] = ("y", "x")) -> Grid:
    """Return the grid of an array whose `dims` passed `Problems.surface` or `Problems.grid`."""
    spacing, periodic = [], []
    for dim in dims:
        coordinate = array.coords.variables[dim]  # several times as fast as coords[dim]
        centres = np.asarray(coordinate.values, dtype=np.float64)
        n, period = centres.size, coordinate.attrs.get("period")
        if n < 2:  # one point along the axis: its extent is the period
            spacing.append(float(period))
            periodic.append(True)
            continue
        step = float(centres[-1] - centres[0]) / (n - 1)
        spacing.append(step)
        periodic.append(period is not None and abs(float(period) - n * step) <= UNIFORM * float(period))
    return Grid(tuple(int(array.sizes[dim]) for dim in dims), tuple(spacing), tuple(periodic))


def periodic_axes(choice: bool | None, grid: Grid) -> tuple[bool, ...]:
    """Return which axes are periodic: those of the grid for None, otherwise all or none.

    `Problems.periodic` checks the choice.
    """
    return grid.periodic if choice is None else (bool(choice),) * len(grid.shape)


def plane_coords(
    shape: Sequence[int], spacing: Sequence[float], periodic: Sequence[bool], dims: Sequence[str] = ("y", "x")
) -> dict[str, xr.Variable]:
    """Return coordinates with their period for a plane or profile that starts at the origin."""
    coords = {}
    for dim, n, step, wraps in zip(dims, shape, spacing, periodic, strict=True):
        attributes = {"units": "m"} | ({"period": float(n * step)} if wraps else {})
        coords[dim] = xr.Variable((dim,), (np.arange(int(n)) + 0.5) * float(step), attributes)
    return coords


def contact_edges(mask: Array, periodic: Sequence[bool] = (False, False)) -> Array:
    """Count the changes between set and open cells along columns and rows.

    Parameters
    ----------
    mask : ndarray of bool, shape (..., ny, nx)
    periodic : pair of bool
        Count the changes across the periodic edges of y and of x as well.

    Returns
    -------
    ndarray of int64, shape (..., 2)
        Changes along columns (between neighbours in y) and along rows (neighbours in x). Times the spacing
        of the other axis they give the perimeter.
    """
    mask = np.asarray(mask, dtype=bool)
    counts = []
    for axis, wraps in zip((-2, -1), periodic, strict=True):
        changes = np.count_nonzero(np.diff(mask, axis=axis), axis=(-2, -1))  # True where two cells differ
        if wraps and mask.shape[axis] > 1:
            edge = np.take(mask, 0, axis=axis) != np.take(mask, -1, axis=axis)
            changes = changes + np.count_nonzero(edge, axis=-1)
        counts.append(np.asarray(changes, dtype=np.int64))
    return np.stack(counts, axis=-1)


def grid_faults(array: Any, argument: str, dims: Sequence[str] = ("y", "x")) -> Iterator[Fault]:
    """Yield what keeps `dims` from being the last dims of an array, with uniform coordinates in metres."""
    if tuple(array.dims[-len(dims) :]) != tuple(dims):
        yield f"{argument}.dims", f"(..., {', '.join(dims)})", array.dims
        return
    for dim in dims:
        yield from axis_faults(array, dim, f"{argument}.{dim}")


def axis_faults(array: xr.DataArray | xr.Dataset, dim: str, name: str) -> Iterator[Fault]:
    """Yield what keeps a dim from having a uniform coordinate of ascending centres in metres."""
    expected = "a coordinate of cell centres in metres (see fractalcontact.surfaces.from_array)"
    if dim not in array.coords:
        yield name, expected, "no coordinate"
        return
    coordinate = array.coords.variables[dim]  # several times as fast as coords[dim]
    yield from _units_faults(coordinate.attrs, name)
    period = coordinate.attrs.get("period")
    if period is not None and not is_length(period):
        yield f"{name}.period", "one length in metres", period
    if coordinate.dims != (dim,) or coordinate.dtype.kind not in "iuf":
        yield name, expected, f"dims {coordinate.dims} and type {coordinate.dtype}"
        return
    centres = np.asarray(coordinate.values, dtype=np.float64)
    n = centres.size
    if n < 1 or (n < 2 and period is None):
        yield name, "at least 2 points, or a period", f"{n}"
        return
    if not np.isfinite(centres).all():
        yield name, "finite, ascending cell centres", f"{centres[0]:g} ... {centres[-1]:g}"
        return
    if n < 2:
        return
    spacing = (float(centres[-1]) - float(centres[0])) / (n - 1)
    if not 0 < spacing < np.inf:
        yield name, "finite, ascending cell centres", f"{centres[0]:g} ... {centres[-1]:g}"
    elif not _within(spacing):
        yield name, f"a spacing of {_LENGTHS}", f"{spacing:g}"
    else:
        distance = np.abs(centres - (centres[0] + spacing * np.arange(n))).max()
        # far from the origin places are rounded: as given, as computed, and at both ends, for the spacing
        if not distance <= UNIFORM * spacing + 4.0 * np.spacing(np.abs(centres).max()):
            expected = "uniform spacing (see fractalcontact.surfaces.from_points)"
            yield name, expected, f"centres up to {distance / spacing:.3g} spacings off their place"


def _units_faults(attributes: Mapping[Any, Any], name: str) -> Iterator[Fault]:
    units = attributes.get("units", "m")
    if not (isinstance(units, str) and units in METRES):
        yield f"{name}.units", "'m'", units


def is_length(value: Any) -> bool:
    """Return whether an attribute is one positive length in metres that float64 holds."""
    return is_real(value) and _within(value)


def surface_faults(
    surface: Any,
    argument: str,
    *,
    finite: bool = True,
    smallest: int = 3,
    leading: bool = False,
    profile: bool = False,
) -> Iterator[Fault]:
    """Yield what keeps an array from being a surface, heights in metres on a uniform grid.

    Parameters
    ----------
    surface : DataArray
        Dims (..., y, x), or (..., x) where `profile` allows one.
    argument : str
        Its name in messages.
    finite : bool
        Refuse NaN and infinite heights.
    smallest : int
        Smallest number of points along each axis.
    leading : bool
        Allow dims before (y, x).
    profile : bool
        Allow a profile, dims (..., x) without y.
    """
    if not isinstance(surface, xr.DataArray):
        expected = "a DataArray of heights (see fractalcontact.surfaces.from_array)"
        # any function with an argument of this name takes a plain array beside `spacing`
        expected += ", or give spacing= (m)" if argument == "surface" else ""
        yield argument, expected, type(surface).__name__
        return
    dims = core_dims(surface) if profile else ("y", "x")
    yield from grid_faults(surface, argument, dims)
    if not leading and surface.ndim > len(dims):
        yield f"{argument}.dims", f"({', '.join(dims)}) alone", surface.dims
    for dim in surface.dims[: -len(dims)] if leading else ():
        if surface.sizes[dim] == 0:
            yield f"{argument}.{dim}", "at least one entry", "none"
    yield from _units_faults(surface.attrs, argument)
    if surface.dtype.kind not in "iuf":
        yield argument, "real numbers", f"type {surface.dtype}"
    else:
        if finite:
            yield from missing_faults(surface.values, argument)
        in_memory = not has_blocks(surface)
        if in_memory:
            yield from _size_faults(surface.values, argument)
        if in_memory and not finite and np.isinf(distinct(surface.values)).any():
            yield argument, "heights that are finite or NaN", "infinite heights"
    if surface.dims[-len(dims) :] == dims:
        for dim in dims:
            if surface.sizes[dim] < smallest:
                yield f"{argument}.{dim}", f"at least {smallest} points", surface.sizes[dim]


def distinct(values: Array) -> Array:
    """Return a view of an array without the repetitions along its broadcast axes, to check all its values.

    The flat surface that stands for a large one while a scene is validated is one such value.
    """
    return values[tuple(slice(0, 1) if stride == 0 else slice(None) for stride in values.strides)]


def missing_faults(
    values: Array, argument: str, remedy: str = "see fractalcontact.surfaces.fill"
) -> Iterator[Fault]:
    """Yield how many values are not finite, if any."""
    values = distinct(values)
    missing = values.size - int(np.count_nonzero(np.isfinite(values)))
    if missing:
        expected = "finite values" + (f" ({remedy})" if remedy else "")
        yield argument, expected, f"{missing} of {values.size} NaN or infinite"


def _size_faults(heights: Array, argument: str) -> Iterator[Fault]:
    """Yield finite heights, or a range of them, whose powers float64 cannot represent."""
    if heights.size == 0:
        return
    heights = distinct(heights)
    low, high = float(heights.min()), float(heights.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        observed = heights[np.isfinite(heights)]
        low, high = (float(observed.min()), float(observed.max())) if observed.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    for size, quantity in ((largest, "heights"), (high / 2.0 - low / 2.0, "a range of heights")):
        if size and not _within(size):
            yield argument, f"{quantity} of 0 or of {_LENGTHS}", f"{size:g} m"
            return


def _within(length: float) -> bool:
    rounded = 1.0 + UNIFORM  # a spacing is computed from centres
    return length * rounded >= 10.0**-DECADES and length <= rounded * 10.0**DECADES


def result_faults(data: Any, argument: str) -> Iterator[Fault]:
    """Yield the faults of the variables whose names the schema has; others are not looked at."""
    if not isinstance(data, xr.Dataset):
        yield argument, "a Dataset, the result of a public function", data
        return
    for dim in PATH_DIMS:
        if data.sizes.get(dim) == 0:
            yield f"{argument}.{dim}", "at least one entry", "none"
    for name, variable in data.variables.items():
        quantity = QUANTITIES.get(str(name))
        if quantity is None or name in CORE_DIMS:
            continue
        expected, kinds = ("words", "USO") if quantity.units is None else ("real numbers", "biuf")
        if variable.dtype.kind not in kinds:
            yield f"{argument}.{name}", expected, f"type {variable.dtype}"
        units = variable.attrs.get("units", quantity.units)
        is_counted = bool(in_cells(str(name))) and is_in_cells(variable.attrs)
        if quantity.units is not None and not (is_counted or _is_unit_of(units, quantity)):
            yield f"{argument}.{name}.units", repr(quantity.units), units
        if not isinstance(variable.attrs.get("long_name", ""), str):
            yield f"{argument}.{name}.long_name", "words", variable.attrs["long_name"]
    for dim in CORE_DIMS:
        if dim in data.dims and dim in data.coords and data.sizes[dim] > 1:
            yield from axis_faults(data, dim, f"{argument}.{dim}")


def _is_unit_of(units: Any, quantity: Quantity) -> bool:
    if not isinstance(units, str):
        return False
    return units in (quantity.units, *quantity.other_units) or (quantity.units == "m" and units in METRES)
