"""Heights out of NetCDF files, ours and others'."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import netcdf
from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import METRES, check_surface, plane_coords
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.surfaces._units import UNITS, in_metres

if TYPE_CHECKING:
    import xarray as xr


def read_netcdf(
    path: Path, channel: str | None, units: str | None, spacing: Sequence[float] | None, problems: Problems
) -> tuple[xr.DataArray, str | None]:
    """Return `height` of a NetCDF file, or the variable `channel`, with dims (..., y, x) in metres.

    The unit that the file states comes second.
    """
    array = _variable(netcdf.open(path), channel, problems, path.name)
    if array is None:
        import xarray as xr

        return xr.DataArray(np.zeros((3, 3)), dims=("y", "x")), None
    core = [dim for dim in ("y", "x") if dim in array.dims]
    array = array.transpose(..., *core)
    stated = array.attrs.get("units")
    unit = units or ("m" if stated in METRES else stated)
    if unit not in UNITS:
        problems.add(
            f"{array.name}.units", 'a unit of length, or give `units` ("m", "um" ...)', stated or "none"
        )
        unit = "m"
    array = array.copy(data=in_metres(np.asarray(array.values, dtype=np.float64), unit))
    array.attrs["units"] = "m"
    array = _coordinates(array, core, spacing)
    check_surface(array, problems, str(array.name), finite=False, smallest=2, leading=True, profile=True)
    array = array.drop_vars([name for name in array.coords if name not in QUANTITIES])
    return array.rename("height"), stated


def _variable(content: Any, channel: str | None, problems: Problems, name: str) -> xr.DataArray | None:
    """Return the variable asked for, or `height`, or the only plane there is."""
    import xarray as xr

    if isinstance(content, xr.DataArray):
        content = content.to_dataset(name="height" if content.name is None else str(content.name))
    groups = (
        [node.to_dataset() for node in content.subtree] if isinstance(content, xr.DataTree) else [content]
    )
    found: dict[str, xr.DataArray] = {
        str(key): array
        for group in reversed(groups)
        for key, array in group.data_vars.items()
        if "x" in array.dims and array.dtype.kind in "fiu"
    }
    if channel is not None or "height" in found or len(found) != 1:
        wanted = channel or "height"
        if wanted not in found:
            expected = f"one of {', '.join(map(repr, found))}" if found else "a variable with dims (y, x)"
            problems.add("channel", f"{expected} in {name!r}", wanted)
        return found.get(wanted)
    return next(iter(found.values()))


def _coordinates(array: xr.DataArray, core: Sequence[str], spacing: Sequence[float] | None) -> xr.DataArray:
    """Return ascending coordinates in metres: those of the file, or from `spacing`."""
    for dim in core:
        if dim not in array.coords:
            continue
        axis = array.coords[dim]
        unit = axis.attrs.get("units", "m")
        if unit not in METRES and unit in UNITS:
            attributes = dict(axis.attrs) | {"units": "m"}
            if "period" in attributes:
                attributes["period"] = in_metres(float(attributes["period"]), unit)
            array = array.assign_coords(
                {dim: (dim, in_metres(axis.values.astype(np.float64), unit), attributes)}
            )
        if axis.size > 1 and axis.values[0] > axis.values[-1]:
            array = array.isel({dim: slice(None, None, -1)})
    if spacing is not None:
        sizes = [array.sizes[dim] for dim in core]
        steps = [float(step) for step in np.broadcast_to(spacing, len(core))]
        array = array.assign_coords(plane_coords(sizes, steps, [False] * len(core), core))
    return array
