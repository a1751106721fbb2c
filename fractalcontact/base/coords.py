"""Coordinates of an input that its result keeps.

An array of the user's own may have coordinates of any name. Those along leading dims stay with the result,
because they distinguish its planes; of the others, only names of `base.schema` do.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Any

import xarray as xr
from xarray.indexes import PandasMultiIndex

from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.validation import Problems


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
