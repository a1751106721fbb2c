"""Faults of a labelled result that is an argument: dims, types and units other than those of the schema.

A result may come from a file or from a user's own arithmetic, which can drop units, turn numbers into
objects or select nothing along a dim.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import xarray as xr

from fractalcontact.base.grid import METRES, Fault, axis_faults
from fractalcontact.base.schema import CORE_DIMS, QUANTITIES, Quantity

PATH_DIMS = (
    *("member", "direction", "shear", "step", "axis", "method", "azimuth", "wavelength", "structure_size"),
    *CORE_DIMS,
)


def tree_faults(value: Any, argument: str) -> Iterator[Fault]:
    """Yield a fault where a value is not the DataTree of a study."""
    if not isinstance(value, xr.DataTree):
        yield argument, "a DataTree, from fractalcontact.scenes.run or fractalcontact.open", value


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
        if quantity.units is not None and not _is_unit_of(units, quantity):
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
