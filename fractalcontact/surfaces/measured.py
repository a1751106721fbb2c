"""Measured heights: arrays of your own, and files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import provenance
from fractalcontact.base.checks import Problems
from fractalcontact.surfaces import _arguments
from fractalcontact.surfaces._units import UNITS, in_metres

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]


def from_array(
    heights: Any,
    spacing: float | Sequence[float],
    *,
    periodic: bool | Sequence[bool] = False,
    units: str = "m",
) -> xr.DataArray:
    """Return heights on a uniform grid as a surface.

    Parameters
    ----------
    heights : array-like, shape (ny, nx), (nx,) for a profile, or (members, ny, nx)
        Row 0 is the smallest y: flip an image first (`heights[::-1]`). NaN and masked values are missing
        points. A dask array stays lazy. A DataArray must end in dims (y, x) and keeps its leading dims.
    spacing : float, or (y, x)
        Distance between points, always in metres.
    periodic : bool, or (y, x)
        Whether the surface continues beyond its edge with its other side.
    units : str
        Unit of `heights`: "m", "mm", "um", "nm" ...; the result is in metres.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, float64, the first cell starting at the origin.

    Raises
    ------
    InvalidInput
        The heights are not real numbers or infinite, the spacing is not positive, the unit is unknown.
    """
    with Problems("fractalcontact.surfaces.from_array") as problems:
        values, leading, axes = _values(problems, heights)
        steps = _arguments.plane_spacing(problems, spacing, axes)
        wraps = _flags(problems, periodic, axes)
        problems.choice("units", units, UNITS)
    surface = _arguments.heights_of(in_metres(values, units), steps, wraps, tuple(leading))
    for name, coordinate in leading.items():
        if coordinate is not None:
            surface = surface.assign_coords({name: coordinate})
    return provenance.stamp(
        surface,
        "fractalcontact.surfaces.from_array",
        {"spacing": steps, "periodic": wraps, "units": units},
        title="Surface heights",
    )


def _values(problems: Problems, heights: Any) -> tuple[Any, dict[str, Any], int]:
    """Return float64 values with NaN for missing ones, the leading dims, the plane's axes."""
    leading: dict[str, Any] = {}
    dims = getattr(heights, "dims", None)
    if dims is not None:
        axes = 2 if "y" in dims else 1
        problems.require(
            tuple(dims[-axes:]) == ("y", "x")[2 - axes :], "heights.dims", "(..., y, x) or (..., x)", dims
        )
        leading = {str(dim): heights.coords.get(dim) for dim in dims[:-axes]}
        values = heights.data
    else:
        values = heights
    lazy = hasattr(values, "dask")
    try:
        values = values if lazy else np.ma.asanyarray(values)
        if values.dtype.kind not in "fiu":
            raise TypeError
        values = values.astype(np.float64)
        values = values if lazy else np.ma.filled(values, np.nan)
    except (TypeError, ValueError):
        problems.add("heights", "an array of real numbers", heights)
        return np.zeros((3, 3)), {}, 2
    if dims is None:
        axes = min(values.ndim, 2)
        problems.require(
            values.ndim in (1, 2, 3), "heights", "shape (ny, nx), (nx,) or (members, ny, nx)", values
        )
        leading = {"member": None} if values.ndim == 3 else {}
    for name, n in zip(("y", "x")[2 - axes :], values.shape[-axes:] if axes else (), strict=False):
        problems.require(n >= 2, f"heights ({name})", "at least 2 points", n)
    if not lazy:
        infinite = int(np.count_nonzero(np.isinf(values)))
        problems.require(
            infinite == 0, "heights", "finite values, or NaN where missing", f"{infinite} infinite"
        )
    return values, leading, axes if axes else 2


def _flags(problems: Problems, periodic: Any, axes: int) -> tuple[bool, ...]:
    flags = np.asarray(periodic)
    if flags.dtype != np.bool_ or flags.shape not in ((), (axes,)):
        problems.add("periodic", "True or False" + (", or (y, x)" if axes == 2 else ""), periodic)
        return (False,) * axes
    return tuple(bool(flag) for flag in np.broadcast_to(flags, axes))
