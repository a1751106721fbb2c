"""Surfaces read from files: NetCDF, npy, tables of numbers and instrument formats."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import netcdf
from fractalcontact.base.errors import MissingExtra, ScaleWarning, UnreadableFile, warn
from fractalcontact.base.grid import METRES, UNIFORM, axis_faults, core_dims, plane_coords, read_grid
from fractalcontact.base.labelled import usual_form
from fractalcontact.base.numbers import Array, is_real
from fractalcontact.base.provenance import file_checksum
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.study import provenance_of
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import NONE, Problems, Words, reading
from fractalcontact.surfaces import _files, _read_points
from fractalcontact.surfaces._files import EmptyTable, NotATable, Request, array_name, require_readable
from fractalcontact.surfaces._fit_plane import check_frame
from fractalcontact.surfaces._from_array import axis_spacing, check_heights, check_spacing, labelled_heights
from fractalcontact.surfaces._instruments import PLAIN, UNKNOWN, from_bottom, read_instrument, read_raster

WHERE = "fractalcontact.surfaces.read"
NETCDF = (".nc", ".nc4", ".cdf", ".netcdf")
TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc", *_read_points.ALWAYS_POINTS)
RASTERS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"ncols", b"NCOLS", b"DSAA", b"DSBB", b"DSRB")
SPACING_NEEDED = "the spacing in metres (on the command line `--spacing 0.3mm`)"
IMAGES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"BM")


def _check(problems: Problems) -> None:
    given = problems.given
    _read_points.check_columns(problems)
    check_frame(problems)
    if given.spacing is not None:
        check_spacing(problems)
    problems.choice("units", among=UNITS, optional=True)
    is_row = problems.choice("first_row", among=("bottom", "top"), optional=True)
    is_number = is_real(given.channel) and isinstance(given.channel, (int, np.integer))
    is_channel = given.channel is None or isinstance(given.channel, str) or is_number
    problems.require(is_channel, "channel", "the name or the number of a channel")
    if not problems.file("path"):
        return
    source = Path(given.path)
    if is_row and _files.file_suffix(source) in NETCDF:
        expected = "'bottom' for a NetCDF file, which has its y"
        problems.require(given.first_row in (None, "bottom"), "first_row", expected)
        problems.require(
            given.channel is None or isinstance(given.channel, str), "channel", "the name of a variable"
        )


@public_result(
    title="Surface read from a file",
    achieved_error="exact: heights as the file states them",
    check=_check,
    error=UnreadableFile,
)
def read(
    path: str | os.PathLike[str],
    *,
    channel: str | int | None = None,
    units: str | None = None,
    spacing: float | Sequence[float] | None = None,
    first_row: str | None = None,
    columns: Sequence[str | int] | None = None,
    plane: str | xr.Dataset | xr.DataArray | None = None,
) -> xr.DataArray:
    """Read a measured surface from a file.

    Parameters
    ----------
    path : path-like
        NetCDF (`.nc`), numpy (`.npy`, `.npz`), text (`.csv`, `.txt` ...) with a table of heights, whose rows
        are y, or with points (two or three columns, `.xyz`, `.pts`), a mesh or cloud (`.ply`, `.stl`, `.obj`,
        `.las`; extra `mesh`), a raster (GeoTIFF, ESRI ASCII, Surfer; extra `geo`), an instrument's file
        (extra `io`), or one of these with `.gz`. `.npy` and tables of heights need `spacing`, `.npz` needs it
        or arrays `x` and `y`; points, in `.npy` an array of two or three columns too, are gridded by
        `from_points`.
    channel : str or int, optional
        Channel of an instrument's file or band of a raster (by its number, from 0), variable of a NetCDF
        file, or array of an `.npz`, `.mat` or `.h5` file. Default: the first height channel, `height`, or the
        only one.
    units : str, optional
        Unit of the heights, and of all coordinates of points: "m", "mm", "um", "nm" ... Default: that of the
        file; metres for tables, points, rasters and arrays without one. A unit other than that of the file
        replaces it, with a warning.
    spacing : float, or (y, x), optional
        Distance between points in metres; replaces that of the file, whose periodic axes stay so. Of points:
        that of the cells.
    first_row : {"bottom", "top"}, optional
        Whether the first row of the file has the smallest y, or is the top of the map, which is flipped.
        Default: "top" for an instrument's file (its reader orders the rows as an image), "bottom" for `.npy`
        and tables. NetCDF files, rasters and points have their own y.
    columns, plane : optional
        Of points: see `read_points` and `from_points`.

    Returns
    -------
    DataArray
        `height` with dims (y, x) in metres, y ascending, heights up, NaN where missing. The provenance has
        name and checksum of the file, its unit and size as stated, and the library that read it.

    Raises
    ------
    UnreadableFile
        The file is corrupt, of an unknown format or no uniform grid, or a spacing is missing, or the unit of
        a NetCDF or instrument's file.
    MissingExtra
        The library that reads the format is not installed.

    Warns
    -----
    ScaleWarning
        The range of the heights over the extent is outside 1e-6 ... 10, a microscope's field is wider than
        1 m, or points without a unit extend over more than 20 m: factors of 1000 are common.

    Notes
    -----
    The formats of tables are described in the documentation, "Theory: surfaces".

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import fractalcontact as fc
    >>> path = Path(tempfile.mkdtemp()) / "scan.csv"
    >>> size = path.write_text("0.0, 1.5, 0.5; 0.2, nan, 0.1".replace(";", chr(10)))
    >>> surface = fc.surfaces.read(path, spacing=1e-6, units="um")
    >>> surface.sizes["x"], float(surface[0, 1]), int(surface.isnull().sum())
    (3, 1.5e-06, 1)
    """
    source = Path(path)
    with reading("", source):
        surface = file_content(Request(source, channel, units, spacing, first_row, columns, plane))
        for name, value in {"columns": columns, "plane": plane}.items():
            is_used = value is None or "gridding" in surface.attrs
            require_readable(is_used, name, f"None for heights, as those of {source.name!r}", value)
        sizes = [surface.sizes[dim] for dim in core_dims(surface)]
        require_readable(min(sizes) > 1, "path", "at least 2 points along each axis", sizes)
        digest = file_checksum(source)
    stated = surface.attrs["stated_unit"]
    if units is not None and stated in UNITS and in_metres(1.0, units) != in_metres(1.0, stated):
        message = f"{source.name}: the file states {stated!r} and is read in {units!r}, the argument `units`"
        warn(message, ScaleWarning)
    _warn_of_scale(surface, source.name)
    if "gridding" not in surface.attrs:  # the heights of points were looked at before they were gridded
        unit = units or stated
        _warn_of_missing(surface.values, source.name, "cells", unit if unit in UNITS else "m")
    surface.attrs = {
        "title": f"Surface read from {source.name}",
        "parameters": {"path": source.name},
        "file_sha256": digest,
        **surface.attrs,
    }
    if not str(surface.attrs.get("gridding", "none")).startswith("none"):
        surface.attrs["achieved_error"] = "between the points nothing was measured: see finest_scale"
    return surface


def file_content(request: Request) -> xr.DataArray:
    """Read a file with the reader of its format."""
    path, suffix = request.path, request.suffix
    if suffix in NETCDF:
        return _netcdf_content(request)
    if suffix in (*_read_points.MESHES, *_read_points.CLOUDS):
        return _gridded_points(_read_points.point_content(path, request.columns), request)
    if suffix == ".npy":
        with _files.corrupt_named(path.name):
            values = _files.read_npy(path)
        return _array_content(values, request)
    if suffix == ".npz":
        return _archive_content(request)
    with _files.open_bytes(path) as file:
        head = file.read(8)  # the longest of the signatures
    require_readable(bool(head), "path", "data", Words(f"the empty file {path.name!r}"))
    if head.startswith(RASTERS):
        return read_raster(request)
    expected = "heights; fractalcontact.domains.read_mask reads the mask of an image"
    require_readable(not head.startswith(IMAGES), "path", expected, path.name)
    return _text_content(request) if suffix in TABLES else read_instrument(request)


def _text_content(request: Request) -> xr.DataArray:
    """Read text: a list of points, a table of heights, or the file of an instrument."""
    path = request.path
    try:
        table = _files.read_table(path)
    except NotATable as error:
        is_points = request.columns is not None or request.suffix in _read_points.ALWAYS_POINTS
        if not (is_points or isinstance(error, EmptyTable)):
            if request.spacing is None:
                return _instrument_or_table(request, str(error))
            if (surface := _headed_content(request)) is not None:
                return surface
        fault = f"is not a table of numbers ({error})"
        raise UnreadableFile("", [f"path: {path.name!r} {fault}"]) from error
    if _read_points.is_list(table, path, request.columns):
        return _gridded_points(_read_points.listed_points(table, path, request.columns), request)
    rows, number = table.values.shape
    if table.is_named:
        first = table.names[0] if table.names else "words"
        fault = f"is not a table of numbers (line 1, column 1: expected a number, got {first!r})"
        raise UnreadableFile("", [f"path: {path.name!r} {fault}"])
    expected = "a grid of heights, or `columns`, the names or numbers of those of x, y, z"
    is_tall = number < 12 and rows > 20 * number  # as a list of points is, not a map
    require_readable(not is_tall, "path", expected, f"{rows} rows of {number} columns")
    if request.spacing is None:
        return _instrument_or_table(request)
    if table.comment and (surface := _headed_content(request)) is not None:
        return surface
    expected = "a grid of heights, one row to a line"
    require_readable(min(table.values.shape) > 1, "path", expected, f"shape {table.values.shape}")
    expected = "heights alone, as `spacing` states where they are"
    got = Words("coordinates in the first row and column")
    require_readable(not _has_coordinates(table.values), "path", expected, got)
    return _heights_content(table.values, request)


def _has_coordinates(values: Array) -> bool:
    """Return whether first row and column of a table are evenly spaced beside an empty corner."""
    steps = np.diff(values[0, 1:]), np.diff(values[1:, 0])
    # thirds that are written with three digits differ by .3 %
    are_even = [each.size > 1 and bool(np.ptp(each) < 0.01 * abs(each[0])) for each in steps]
    return bool(np.isnan(values[0, 0])) and all(are_even)


def _headed_content(request: Request) -> xr.DataArray | None:
    """Read text whose header states its size as the file of an instrument; None of other text."""
    with contextlib.suppress(UnreadableFile, MissingExtra):
        surface = read_instrument(request)
        if surface.attrs["stated_size"] is not None:  # any text has numbers to some reader
            return surface
    return None


def _instrument_or_table(request: Request, fault: str = "") -> xr.DataArray:
    """Read text without a spacing as the file of an instrument; with a fault it is no table of numbers."""
    try:
        return read_instrument(request)
    except (MissingExtra, UnreadableFile) as error:
        if isinstance(error, UnreadableFile):
            if UNKNOWN not in str(error):
                raise
            if fault:
                problem = f"{error.problems[0]}, and is not a table of numbers ({fault})"
                raise UnreadableFile("", [problem]) from error
        expected = f"{SPACING_NEEDED}, for {request.path.name!r} as a table of heights"
        raise UnreadableFile("", [f"spacing: expected {expected}, got None"]) from None


def _gridded_points(points: xr.Dataset, request: Request) -> xr.DataArray:
    """Grid the points of a file."""
    from fractalcontact.surfaces._from_points import from_points, grid_points  # loads numba

    units, spacing, stated = request.units, request.spacing, points.attrs["stated_unit"]
    require_readable(request.channel is None, "channel", "None for points", request.channel)
    require_readable(request.first_row is None, "first_row", "None for points", request.first_row)
    _warn_of_missing(points["position"].values[..., -1], request.path.name, "points")
    require_readable(np.size(spacing) == 1 or spacing is None, "spacing", "one length for points", spacing)
    step = None if spacing is None else float(np.atleast_1d(spacing)[0])
    options = {"units": _read_points.unit_of(points, units), "plane": request.plane}
    with Problems("", UnreadableFile):  # its problems are those of the file
        from_points.validate(points, step, **options)
        surface = grid_points(points, step, None, **options, largest_gap=None)
    widest = max(float(np.ptp(surface[dim].values)) for dim in surface.dims)
    if units is None and stated is None and widest > 20.0:  # or it is a scan of a dam
        message = (
            f"{request.path.name}: the points extend over {widest:.3g} m and the file states no unit: if "
            "they are in millimetres, give units='mm'; else units='m'"
        )
        warn(message, ScaleWarning)
    return surface.assign_attrs(points.attrs)


def _archive_content(request: Request) -> xr.DataArray:
    """Return an array of an npz file: the only one of heights, or that called `channel`.

    One-dimensional arrays called x and y are the coordinates, in the unit of the heights.
    """
    spacing = request.spacing
    with _files.corrupt_named(request.path.name):
        arrays = _files.read_npz(request.path)
    heights = {
        key: array for key, array in arrays.items() if array.dtype.kind in "fiu" and array.ndim in (2, 3)
    }
    name = array_name(list(heights), request, "an array of heights")
    values, request = heights[name], replace(request, channel=None)
    axes = [arrays.get(dim, np.empty(0)) for dim in ("y", "x")]
    axes = [axis.ravel().astype(np.float64) if axis.dtype.kind in "iuf" else np.empty(0) for axis in axes]
    stated, shape = [axis.size for axis in axes], list(values.shape[-2:])
    if spacing is None and stated == shape:
        expected = "'bottom' beside an array y, which places the rows"
        require_readable(request.first_row in (None, "bottom"), "first_row", expected, request.first_row)
        steps = [np.diff(in_metres(axis, request.units or "m")) for axis in axes]
        for dim, step in zip(("y", "x"), steps, strict=True):
            is_even = bool(np.ptp(step) <= UNIFORM * abs(step[0])) and step[0] != 0
            require_readable(is_even, dim, "evenly spaced coordinates", "uneven ones")
        values = values[..., :: int(np.sign(steps[0][0])), :: int(np.sign(steps[1][0]))]
        spacing = [float(abs(step).mean()) for step in steps]
        # heights, even if three columns look like points
        return _heights_content(values, replace(request, spacing=spacing))
    expected = f"dims (y, x), as of the arrays y and x {tuple(stated)}"
    require_readable(spacing is not None or stated != shape[::-1], name, expected, tuple(shape))
    return _array_content(values, request)


def _array_content(values: Array, request: Request) -> xr.DataArray:
    """Return an array of a numpy file: heights, or points in two or three columns."""
    path, columns = request.path, request.columns
    if values.ndim == 2 and values.dtype.kind in "iuf":
        table = _files.Table(values.astype(np.float64))
        if _read_points.is_list(table, path, columns):
            return _gridded_points(_read_points.listed_points(table, path, columns), request)
    return _heights_content(values, request)


def _heights_content(values: Array, request: Request) -> xr.DataArray:
    """Return an array of heights without coordinates as a surface."""
    spacing = request.spacing
    with Problems("", UnreadableFile) as problems:
        expected = f"{SPACING_NEEDED}, which {request.path.name!r} does not state"
        problems.require(spacing is not None, "spacing", expected, None)
        expected = f"None for {request.path.name!r}, which has one array of heights"
        problems.require(request.channel is None, "channel", expected, request.channel)
        if values.dtype.kind == "f":
            problems.not_infinite("path", values)
        if not problems.messages:
            check_spacing(problems, check_heights(problems, values), spacing)
    heights = labelled_heights(from_bottom(values, request.first_row), spacing, units=request.units or "m")
    return heights.assign_attrs(stated_unit=None)


def _netcdf_content(request: Request) -> xr.DataArray:
    """Read `height` of a NetCDF file, or the variable `channel`, with dims (..., y, x)."""
    spacing = request.spacing
    candidates = _height_variables(netcdf.open(request.path))
    name = array_name(list(candidates), request, "a variable with dims (y, x)")
    array = candidates[name]
    stated = array.attrs.get("units")
    unit = request.units or stated
    with Problems("", UnreadableFile) as problems:
        expected = 'a unit of length, or give `units` ("m", "um" ...)'
        is_unit = isinstance(unit, str) and unit in (*UNITS, *METRES)
        problems.require(is_unit, f"{name}.units", expected, NONE if stated is None else stated)
        array = usual_form(WHERE, array.assign_attrs(units=unit))[0].astype(np.float64)
        array.attrs["units"] = "m"
        if spacing is not None and check_spacing(problems, len(core_dims(array)), spacing):
            core = core_dims(array)
            steps, sizes = axis_spacing(spacing, len(core)), [array.sizes[dim] for dim in core]
            is_periodic = [
                not any(axis_faults(array, dim, dim)) and read_grid(array, (dim,)).periodic[0] for dim in core
            ]
            array = array.assign_coords(plane_coords(sizes, steps, is_periodic, core))
        problems.surface(name, array, finite=False, smallest=2, leading=True, profile=True)
    stated = stated if stated is None else str(stated)
    others = [coord for coord in array.coords if coord not in QUANTITIES]
    surface: xr.DataArray = array.drop_vars(others).rename("height")
    surface.attrs = {"stated_unit": stated, "before": provenance_of(candidates[name]) or None}
    return surface


def _height_variables(content: Any) -> dict[str, xr.DataArray]:
    """Return the numeric variables with a dim x; those of the root group replace others of the same name."""
    if isinstance(content, xr.DataArray):
        content = content.to_dataset(name="height" if content.name is None else str(content.name))
    is_tree = isinstance(content, xr.DataTree)
    groups = [node.to_dataset() for node in content.subtree] if is_tree else [content]
    return {
        str(name): array
        for group in reversed(groups)
        for name, array in group.data_vars.items()
        if "x" in array.dims and array.dtype.kind in "fiu"
    }


def _warn_of_missing(heights: Array, name: str, what: str, unit: str = "m") -> None:
    """Warn where the lowest or the highest height is that of several cells or points, far from all others.

    A number for "no data" is. Heights that an instrument cuts off lie at the end of the others, not 10 times
    their range away; a step between two flats has no range beside it.
    """
    heights = heights[np.isfinite(heights)]
    for extreme in (heights.min(), heights.max()) if heights.size else ():
        count = int(np.count_nonzero(heights == extreme))
        others = heights[heights != extreme] if 1 < count < heights.size else heights[:1]
        width = float(np.ptp(others))
        if width > 0 and float(np.abs(others - extreme).min()) > 10.0 * width:
            shown = f"{extreme / in_metres(1.0, unit):.7g}"
            message = f"{name}: {count} {what} hold {shown}, far from all others: missing heights?"
            warn(f"{message} If so, write nan in their place", ScaleWarning)


def _warn_of_scale(surface: xr.DataArray, name: str) -> None:
    """Warn where heights and extent do not fit each other, or a microscope's field is too wide."""
    heights, widest = surface.values, max(read_grid(surface, core_dims(surface)).extent)
    faults = []
    is_microscope = "channel" in surface.attrs and surface.attrs["format"] not in PLAIN
    if is_microscope and widest > 1.0:
        faults.append(f"the field is {widest:g} m wide, more than any microscope has")
    observed = heights[np.isfinite(heights)]
    relief = float(observed.max() - observed.min()) / widest if observed.size else 0.0
    # four files of instruments have .02 to .27, a fifth one in a wrong unit 2e-8
    if relief > 0 and not 1e-6 <= relief <= 10.0:
        faults.append(
            f"heights span {relief:.1g} of the extent of {widest:.3g} m, a ratio outside 1e-06 ... 10"
        )
    if faults:
        message = f"{name}: {'; '.join(faults)}; if the unit in the file is wrong, give `units` or `spacing`"
        warn(message, ScaleWarning)
