"""Measured heights: arrays of your own, and files."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import provenance, schema
from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import MissingExtra, ScaleWarning, UnreadableFile
from fractalcontact.surfaces import _arguments, _files
from fractalcontact.surfaces._units import UNITS, in_metres

if TYPE_CHECKING:
    import os

    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]


@provenance.accounted("none: heights as given")
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
    surface = _arguments.heights_of(in_metres(values, units), steps, wraps, leading)
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
        for name in leading:
            problems.require(
                name in schema.QUANTITIES, "heights.dims", "leading dims such as 'member', 'shear'", name
            )
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


NETCDF = (".nc", ".nc4", ".cdf", ".netcdf")
TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc")


@provenance.accounted("none: heights as the file states them")
def read(
    path: str | os.PathLike[str],
    *,
    channel: str | int | None = None,
    units: str | None = None,
    spacing: float | Sequence[float] | None = None,
    first_row: str = "bottom",
) -> xr.DataArray:
    """Read a measured surface.

    Parameters
    ----------
    path : path-like
        NetCDF (`.nc`): the variable `height`. numpy (`.npy`) or a table of numbers in text (`.csv`, `.txt`
        ..., between semicolons, tabs, commas or blanks): rows are y, and `spacing` must be given. Cells that
        are empty, or one of nan, na, n/a, null, none, --, are missing; any other that is no number is an
        error, which names its line and column; a line of names is not skipped. Anything else, and text
        without `spacing`: an instrument's file, read by SurfaceTopography (extra `io`). Files packed with
        gzip (`.gz`) are unpacked on the fly.
    channel : str or int, optional
        Channel of an instrument's file, or variable of a NetCDF file. Default: the first height channel.
    units : str, optional
        Unit of the heights, "m", "mm", "um", "nm" ...; needed where a file states none. `.npy` and tables
        are in metres unless it says otherwise. Where a file states another one, yours is taken, with a
        warning.
    spacing : float, or (y, x), optional
        Distance between points in metres; takes the place of what the file says.
    first_row : {"bottom", "top"}
        Whether the first row of an `.npy` file or a table is the smallest y, or the top of an image: then
        it is flipped. An instrument's file stays as its reader hands it on, and is flipped too if "top" is
        asked for. A NetCDF file knows itself.

    Returns
    -------
    DataArray
        `height` with dims (y, x) in metres, y ascending, heights up, NaN where missing. The provenance
        keeps the name of the file, its unit and size as stated, and what read it.

    Raises
    ------
    UnreadableFile
        The file is corrupt, of an unknown format, states no unit or size, or is not a uniform grid.
    MissingExtra
        An instrument's file, and SurfaceTopography is not installed.

    Warns
    -----
    ScaleWarning
        The range of the heights over the extent lies outside 1e-6 ... 10, or a microscope's file is more
        than 1 m wide: some files, and some readers, are wrong by factors of 1000.
    """
    if not isinstance(path, (str, os.PathLike)):
        told = f"path: expected the name of a file, got {type(path).__name__}"
        raise UnreadableFile("fractalcontact.surfaces.read", [told])
    source = Path(path)
    with Problems("fractalcontact.surfaces.read", UnreadableFile) as problems:
        problems.require(source.is_file(), "path", "an existing file", source.name)
        steps = None if spacing is None else _arguments.plane_spacing(problems, spacing, np.size(spacing))
        if units is not None:
            problems.choice("units", units, UNITS)
        problems.choice("first_row", first_row, ("bottom", "top"))
        suffix = _files.kind(source)
        table = suffix == ".npy" or (suffix in TABLES and spacing is not None)
        if suffix in NETCDF:
            problems.require(
                first_row == "bottom", "first_row", "'bottom' for a NetCDF file, which has its y", first_row
            )
    if suffix in NETCDF:
        surface, facts, microscope = _netcdf(source, channel, units, steps)
    else:
        surface, facts, microscope = (
            _table(source, suffix, channel, units, steps, first_row)
            if table
            else _instrument(source, channel, units, steps, first_row)
        )
    stated = facts["stated_unit"]
    if units is not None and stated in UNITS and in_metres(1.0, units) != in_metres(1.0, stated):
        message = f"{source.name}: the file states {stated!r} and is read in {units!r}, as `units` says"
        warnings.warn(message, ScaleWarning, stacklevel=2)
    axes = 2 if "y" in surface.dims else 1
    extent = tuple(
        n * _step(surface, dim) for dim, n in zip(surface.dims[-axes:], surface.shape[-axes:], strict=True)
    )
    _files.check_scale(surface.values, extent, source.name, microscope=microscope)
    parameters = {
        "path": source,
        "channel": channel,
        "units": units,
        "spacing": steps,
        "first_row": first_row,
    }
    return provenance.stamp(
        surface, "fractalcontact.surfaces.read", parameters, title=f"Surface read from {source.name}", **facts
    )


Read = tuple["xr.DataArray", dict[str, Any], bool]


def _table(
    path: Path,
    suffix: str,
    channel: str | int | None,
    units: str | None,
    spacing: tuple[float, ...] | None,
    first_row: str,
) -> Read:
    """Read an array of numbers; a text that is none may be the file of an instrument that states its size."""
    try:
        values = _files.read_npy(path) if suffix == ".npy" else _files.read_table(path)
    except ValueError as error:
        if isinstance(error, _files.NoTable) and not isinstance(error, _files.NoNumbers):
            with contextlib.suppress(UnreadableFile, MissingExtra):
                found = _instrument(path, channel, units, spacing, first_row)
                # lists of points have a size too, whatever the lines are
                if found[1]["stated_size"] is not None and found[1]["format"] != "xyz":
                    return found
        kind = "is corrupt" if suffix == ".npy" else "is no table of numbers"
        raise UnreadableFile(
            "fractalcontact.surfaces.read", [f"path: {path.name!r} {kind} ({error})"]
        ) from error
    with Problems("fractalcontact.surfaces.read", UnreadableFile) as problems:
        problems.require(
            spacing is not None, "spacing", f"the spacing in metres, which {path.name!r} has not", None
        )
        infinite = int(np.count_nonzero(np.isinf(values))) if values.dtype.kind == "f" else 0
        problems.require(
            infinite == 0, "path", "finite heights, or NaN where missing", f"{infinite} infinite"
        )
        if suffix != ".npy":
            problems.require(
                min(values.shape) > 1, "path", "a grid of heights, one row to a line", f"shape {values.shape}"
            )
        if suffix != ".npy" and values.shape[1] == 3 and values.shape[0] > 9:
            problems.add(
                "path",
                "a grid of heights, one row to a line",
                "three columns, which look like x, y, z points",
            )
    return (
        from_array(_upwards(values, first_row), spacing or 1.0, units=units or "m"),
        {"stated_unit": None},
        False,
    )


def _upwards(values: Array, first_row: str) -> Array:
    """Return heights with the first row at the smallest y."""
    return values[..., ::-1, :] if first_row == "top" and values.ndim > 1 else values


def _instrument(
    path: Path,
    channel: str | int | None,
    units: str | None,
    spacing: tuple[float, ...] | None,
    first_row: str,
) -> Read:
    from fractalcontact.surfaces.instruments import read_instrument

    try:
        reading = read_instrument(path, channel, units, spacing)
    except MissingExtra:
        if _files.kind(path) in TABLES and spacing is None:
            message = (
                f"spacing: expected the spacing in metres, for {path.name!r} as a table of heights, got None"
            )
            raise UnreadableFile("fractalcontact.surfaces.read", [message]) from None
        raise
    periodic = (reading.periodic,) * len(reading.spacing)
    return (
        _arguments.heights_of(_upwards(reading.heights, first_row), reading.spacing, periodic),
        reading.facts,
        reading.microscope,
    )


def _netcdf(
    path: Path, channel: str | int | None, units: str | None, spacing: tuple[float, ...] | None
) -> Read:
    from fractalcontact.surfaces._labelled_files import read_netcdf

    with Problems("fractalcontact.surfaces.read", UnreadableFile) as problems:
        problems.require(not isinstance(channel, int), "channel", "the name of a variable", channel)
        surface, stated = read_netcdf(
            path, None if channel is None else str(channel), units, spacing, problems
        )
    before = surface.attrs.get("provenance")
    facts = {"stated_unit": stated, "before": json.loads(before) if before else None}
    return schema.label(surface), facts, False


def _step(surface: xr.DataArray, dim: Any) -> float:
    axis = surface.coords[dim]
    return float(axis[-1] - axis[0]) / (int(axis.size) - 1)
