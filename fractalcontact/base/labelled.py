"""Labelled arrays of users: which coordinates a result keeps, and surfaces in any usual form.

An array of the user's own may have coordinates of any name. Those along leading dims stay with the result,
because they distinguish its planes; of the others, only names of `base.schema` do. The argument `surface` of
a public function may be a Dataset with one height, have its axes in another order or descending, be in other
units of length, or be a plain array with `spacing=` beside it. What was done is said in the `history` of the
result.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Any

import numpy as np
import xarray as xr
from xarray.indexes import PandasMultiIndex

from fractalcontact.base.errors import InvalidInput, ScaleWarning, warn
from fractalcontact.base.grid import METRES, plane_coords
from fractalcontact.base.numbers import float_array
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import Problems

SURFACE, SPACING = "surface", "spacing"
MASK, VALID = "mask", "valid"
MASK_DIMS = ("step", "y", "x")  # of a plain array; of one row of cells (x,)


def leading_coords(
    array: xr.DataArray | xr.Dataset, outer: Collection[Hashable], taken: Collection[str] = ()
) -> dict[str, Any]:
    """Return the coordinates of the dims `outer`, and those of known names that have no other dims.

    Names in `taken` and `run_time` are left out, because the result has its own values under them; so are
    multi-level indexes, which NetCDF cannot store.
    """
    levels = _levels(array)
    return {
        str(name): xr.Variable(coordinate.dims, coordinate.values, coordinate.attrs)
        for name, coordinate in array.coords.variables.items()
        if set(coordinate.dims) <= set(outer)
        and (name in outer or name in QUANTITIES)
        and not (name in outer and name in levels)
        and name not in taken
        and name != "run_time"
    }


def drop_unknown_coords(array: xr.DataArray) -> xr.DataArray:
    """Return an array with the coordinates of its dims and those with names of `base.schema` only."""
    levels = _levels(array)
    unknown = [
        name for name in array.coords if name in levels or not (name in QUANTITIES or name in array.dims)
    ]
    return array.drop_vars(unknown)


def check_leading(
    array: xr.DataArray, taken: Collection[str], problems: Problems, argument: str = "surface"
) -> None:
    """Check that no leading dim has the name of a dim or variable of the result."""
    repeated = [str(dim) for dim in getattr(array, "dims", ()) if dim in taken]
    if repeated:
        names = ", ".join(repeated)
        problems.add(f"{argument}.dims", f"leading dims not called as the results are, {names}", array.dims)


def _levels(array: xr.DataArray | xr.Dataset) -> set[Hashable]:
    """Return the names of multi-level indexes and of their levels."""
    return {name for name, index in array.xindexes.items() if isinstance(index, PandasMultiIndex)}


def usual_arguments(where: str, arguments: dict[str, Any], spacing: Any = None) -> str:
    """Bring surface and masks among the arguments of a call into the usual form, in place.

    Return what was done to the surface; `spacing` is that of a plain array. A function with an argument
    `spacing` of its own takes any array as its surface.
    """
    for name in (MASK, VALID) if MASK in arguments else ():
        if name in arguments:
            arguments[name] = labelled_mask(arguments[name])
    if SURFACE not in arguments or SPACING in arguments:
        return ""
    arguments[SURFACE], notes = usual_form(where, arguments[SURFACE], spacing)
    return ", ".join(notes)


def labelled_mask(value: Any) -> Any:
    """Return a plain array of True and False as a mask without coordinates; other values as they are."""
    if not isinstance(value, np.ndarray) or value.dtype.kind != "b" or value.ndim == 0:
        return value
    outer = tuple(f"dim_{k}" for k in range(value.ndim - len(MASK_DIMS)))
    return xr.DataArray(value, dims=outer + MASK_DIMS[max(len(MASK_DIMS) - value.ndim, 0) :])


def usual_form(where: str, value: Any, spacing: Any = None) -> tuple[Any, list[str]]:
    """Return heights with dims (..., y, x), ascending and in metres; other values as they are."""
    notes: list[str] = []
    if spacing is not None:
        return _labelled(where, value, spacing), [f"labelled with the spacing {spacing}"]
    if isinstance(value, xr.Dataset) and (height := _only_height(value)) is not None:
        value, notes = height, [f"variable {height.name!r} taken"]
    if not isinstance(value, xr.DataArray) or "x" not in value.dims:
        return value, notes
    core = tuple(dim for dim in ("y", "x") if dim in value.dims)
    if value.dims[-len(core) :] != core:
        value = value.transpose(..., *core)
        notes.append(f"transposed to ({', '.join(map(str, value.dims))})")
    _warn_of_unit(where, value, core)
    for dim in core:
        value, done = _ascending_metres(value, dim)
        notes += done
    unit = value.attrs.get("units")
    if isinstance(unit, str) and unit in UNITS and unit not in METRES and value.dtype.kind in "fiu":
        value = in_metres(value.astype(np.float64), unit).assign_attrs(value.attrs | {"units": "m"})
        notes.append(f"heights converted from {unit}")
    return value, notes


def _warn_of_unit(where: str, value: xr.DataArray, core: tuple[str, ...]) -> None:
    """Warn where coordinates without a unit, which count as metres, look like millimetres."""
    for dim in core:
        axis = value.coords.variables.get(dim)
        if axis is None or "units" in axis.attrs or axis.dtype.kind not in "fiu" or axis.size < 2:
            continue
        extent = abs(float(axis.values[-1]) - float(axis.values[0]))
        if 20.0 < extent < np.inf:  # m: a wider surface may be in millimetres
            message = (
                f"{where}: {dim} extends over {extent:.3g} and states no unit, so it is taken as metres; if "
                f"it is in millimetres, set surface.{dim}.attrs['units'] = 'mm' (also of the heights), else "
                "'m'"
            )
            warn(message, ScaleWarning)
            return


def _only_height(dataset: xr.Dataset) -> xr.DataArray | None:
    """Return the variable `height`, or the only numeric one along x; None if there is none."""
    maps = [
        str(name)
        for name, array in dataset.data_vars.items()
        if "x" in array.dims and array.dtype.kind in "fiu"
    ]
    name = "height" if "height" in maps else maps[0] if len(maps) == 1 else None
    if name is None:
        return None
    array = dataset[name]
    provenance = dataset.attrs.get("provenance")
    return array if provenance is None else array.assign_attrs(provenance=provenance)


def _ascending_metres(array: xr.DataArray, dim: str) -> tuple[xr.DataArray, list[str]]:
    """Return an array with a coordinate in metres that ascends, and what was done."""
    axis = array.coords.variables.get(dim)  # not coords[dim], a DataArray, which takes longer
    if axis is None or axis.dtype.kind not in "fiu" or array.sizes[dim] < 2:
        return array, []
    notes = []
    unit = axis.attrs.get("units")
    if isinstance(unit, str) and unit in UNITS and unit not in METRES:
        attributes = dict(axis.attrs) | {"units": "m"}
        if isinstance(attributes.get("period"), (int, float, np.number)):
            attributes["period"] = in_metres(float(attributes["period"]), unit)
        centres = in_metres(axis.values.astype(np.float64), unit)
        array = array.assign_coords({dim: (dim, centres, attributes)})
        notes.append(f"{dim} converted from {unit}")
    if axis.values[0] > axis.values[-1]:
        array = array.isel({dim: slice(None, None, -1)})
        notes.append(f"{dim} reversed")
    return array, notes


def _labelled(where: str, value: Any, spacing: Any) -> xr.DataArray:
    """Return a plain array as heights in metres on a uniform grid."""
    with Problems(where) as problems:
        is_plain = not isinstance(value, (xr.DataArray, xr.Dataset))
        expected = "none beside labelled heights, which have coordinates"
        problems.require(is_plain, SPACING, expected, spacing)
        axes = np.ndim(value) if is_plain else 2
        problems.require(axes in (1, 2), SURFACE, "an array of shape (ny, nx) or (nx,)", value)
        if problems.numbers(SPACING, spacing, above=0):
            size = float_array(spacing).size
            problems.require(size in (1, axes), SPACING, "one length in metres, or (y, x)", spacing)
    try:
        heights = np.ma.filled(np.ma.asarray(value, dtype=np.float64), np.nan)
    except (TypeError, ValueError) as error:
        raise InvalidInput.of(where, SURFACE, "an array of real numbers", f"{value!r:.60}") from error
    core = ("y", "x")[2 - heights.ndim :]
    steps = np.broadcast_to(float_array(spacing), heights.ndim)
    coords = plane_coords(heights.shape, steps.tolist(), (False,) * heights.ndim, core)
    return xr.DataArray(heights, coords, core, name="height")
