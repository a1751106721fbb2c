"""Files of instruments (SurfaceTopography) and rasters (rasterio), as (y, x), metres and NaN."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import UnreadableFile, require_library
from fractalcontact.base.files import NETCDF_LOCK
from fractalcontact.base.grid import METRES
from fractalcontact.base.numbers import Array, is_real
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.surfaces import _files
from fractalcontact.surfaces._files import Request
from fractalcontact.surfaces._from_array import surface_array

PROJECT = "project it to metres first, for example with `gdalwarp -t_srs EPSG:32632` or `pdal translate`"
ARRAYS = ("h5", "mat", "npz")  # arrays of (row, column), in metres as those of an npy file
PLAIN = ("asc", "h5", "hgt", "mat", "nc", "npy", "npz", "xyz")  # formats not specific to microscopes
# formats whose rows ascend with y, or plain arrays; the first row of all others is the top of the map. The
# rows of X3P (ISO 25178-72) have the coordinate y = offset + row * increment
FROM_BOTTOM = ("h5", "mat", "nc", "npy", "npz", "x3p", "xyz")
POINTS = "xyz"
UNKNOWN = "corrupt or of an unknown format"
PROFILERS = (b"X;Y;valid", b"Scan Parameters")  # heads of lists by profilers, HFM and Dektak
DATA_UNIT = re.compile(rb"^\W*data unit\s*[=:]\s*(\S+)", re.IGNORECASE | re.MULTILINE)


def read_instrument(request: Request) -> xr.DataArray:
    """Read one channel of an instrument's file; `.gz` is decompressed in memory.

    Raises
    ------
    MissingExtra
        SurfaceTopography is not installed.
    UnreadableFile
        Corrupt, of an unknown format, without a unit or a size, or not on a grid.
    """
    from importlib.metadata import version

    path, units, spacing = request.path, request.units, request.spacing
    require_library(f"reading {path.name!r}", "SurfaceTopography", "io")
    # some of the readers open NetCDF files, and filters of warnings are shared by all threads
    with NETCDF_LOCK, _quiet() as messages, _files.open_bytes(path) as file:
        _files.check_unpacked(path.name, file)
        reader, other_unit = _open(file, path)
        chosen = _channel(reader, request)
        name = str(reader.format())
        size, fallback = chosen.physical_sizes, units or ("m" if name in ARRAYS else None)
        lateral, vertical = chosen.unit if isinstance(chosen.unit, tuple) else (chosen.unit, chosen.unit)
        unit, lateral = fallback or other_unit or vertical, lateral or fallback
        _require_stated(chosen, size, unit, lateral, spacing)
        heights, periodic = _heights(reader, chosen, size, path.name)
    steps = _steps(heights.shape, size, lateral, spacing)
    row = request.first_row or ("bottom" if name in FROM_BOTTOM else "top")
    entries = {
        "format": name,
        "channel": str(chosen.name),
        "stated_unit": other_unit or (list(chosen.unit) if isinstance(chosen.unit, tuple) else chosen.unit),
        "stated_size": None if size is None else [float(edge) for edge in size],
        "reader": f"SurfaceTopography {version('SurfaceTopography')}",
        "reader_warnings": sorted({str(message.message) for message in messages}) or None,
        "first_row": row,
    }
    metres = from_bottom(in_metres(heights, str(unit)), row)
    return surface_array(metres, steps, (periodic,) * len(steps)).assign_attrs(entries)


def from_bottom(values: Array, first_row: str | None) -> Array:
    """Return heights with the first row at the smallest y."""
    return values[..., ::-1, :] if first_row == "top" and values.ndim > 1 else values


@contextmanager
def _quiet() -> Iterator[list[warnings.WarningMessage]]:
    """Record the library's warnings for the provenance, except those about imports and open files."""
    with warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", UserWarning)
        yield messages


def _open(file: Any, path: Path) -> tuple[Any, str | None]:
    """Return the library's reader of an open file, and the unit of its data if that is no length.

    Lists of points are read here: its own reader tries 600 times to skip rows, 40 s for 512 x 512 points.
    """
    from SurfaceTopography.IO import MAGIC_BUFFER_SIZE, open_topography, readers
    from SurfaceTopography.IO.Reader import MagicMatch

    head, suffix = file.read(MAGIC_BUFFER_SIZE), _files.file_suffix(path).lstrip(".")
    reasons, tried = [], 0
    for reader in readers:
        is_list = reader.format() == POINTS and not head.startswith(PROFILERS)
        if is_list or reader.can_read(head) == MagicMatch.NO:
            continue
        file.seek(0)
        try:
            return open_topography(file, format=reader.format()), _other_unit(head)
        except Exception as error:
            tried += 1
            if suffix == reader.format() or suffix in (reader._file_extensions or ()):
                lines = str(error).splitlines() or [type(error).__name__]
                reasons.append(f"{reader.__name__.removesuffix('Reader')} reader: {lines[0].strip()}")
    reason = "; ".join(reasons)[:300] or f"{tried} readers tried"
    raise UnreadableFile("", [f"path: {path.name!r} is {UNKNOWN} ({reason})"])


def _channel(reader: Any, request: Request) -> Any:
    """Return a channel by name or number; None stands for the default of the format, of arrays `height`."""
    channel = request.channel
    with _files.corrupt_named(request.path.name):
        channels = list(reader.channels)
        if channel is None and reader.format() not in ARRAYS:
            return reader.default_channel
    if reader.format() in ARRAYS:  # beside the heights there may be numbers, and coordinates in a row
        channels = [entry for entry in channels if min(entry.nb_grid_pts) > 1]
        channel = _files.array_name([str(entry.name) for entry in channels], request, "an array of heights")
    names = [str(entry.name) for entry in channels]
    if isinstance(channel, str) and channel in names:
        return channels[names.index(channel)]
    if is_real(channel) and isinstance(channel, (int, np.integer)) and 0 <= channel < len(channels):
        return channels[channel]
    allowed = ", ".join(f"{number} = {label!r}" for number, label in enumerate(names))
    raise UnreadableFile("", [f"channel: expected one of {allowed}, got {channel!r}"])


def _other_unit(head: bytes) -> str | None:
    """Return the unit of the data if a text header states one that is not a length.

    The library applies the conversion factor of such a header, a wavelength, although the data are phases.
    """
    match = DATA_UNIT.search(head)
    unit = match.group(1).decode("utf-8", "replace") if match else None
    return unit if unit not in UNITS else None


def _require_stated(
    chosen: Any, size: Any, unit: str | None, lateral: str | None, spacing: Sequence[float] | None
) -> None:
    """Raise `UnreadableFile` for what neither the file nor the caller states."""
    name = f"channel {chosen.name!r}"
    with Problems("", UnreadableFile) as problems:
        problems.require(bool(chosen.is_uniform), name, "points on a uniform grid", "scattered points")
        if unit not in UNITS:
            stated = NONE if unit is None else unit
            problems.add(f"{name}, unit", 'a unit of length; give `units` ("m", "um" ...)', stated)
        if spacing is None and size is None:
            problems.add(f"{name}, size", "a lateral size; give `spacing` in metres", NONE)
        elif spacing is None and lateral not in UNITS:
            problems.add(f"{name}, lateral unit", "a unit of length; give `spacing` in metres", lateral)


def _heights(reader: Any, chosen: Any, size: Any, name: str) -> tuple[Array, bool]:
    """Return the values of a channel as (y, x), masked ones as NaN, and whether they are periodic."""
    options: dict[str, Any] = {"channel_index": chosen.index}
    if size is None:
        options["physical_sizes"] = tuple(float(n) for n in np.atleast_1d(chosen.nb_grid_pts))
    with _files.corrupt_named(name):
        topography = reader.topography(**options)
        values = topography.heights()
    is_plane = not np.iscomplexobj(values) and values.ndim in (1, 2)
    got = f"shape {values.shape}"
    _files.require_readable(is_plane, f"channel {chosen.name!r}", "real heights", got)
    if reader.format() not in ARRAYS:  # the library has x first
        heights = np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)
        return np.ascontiguousarray(_observed(heights).T), bool(topography.is_periodic)
    heights = np.ma.getdata(values).astype(np.float64)  # without the mask of the library for infinite ones
    with Problems("", UnreadableFile) as problems:
        problems.not_infinite("path", heights)
    return np.ascontiguousarray(heights), bool(topography.is_periodic)


def _observed(heights: Array) -> Array:
    """Return heights with NaN in place of the infinite ones by which some formats mark a missing point."""
    return np.where(np.isfinite(heights), heights, np.nan)


def _steps(
    points: tuple[int, ...], size: Any, lateral: str | None, spacing: Sequence[float] | None
) -> tuple[float, ...]:
    """Return the spacing (y, x); the extent is n * spacing."""
    if spacing is not None:
        return tuple(float(step) for step in np.broadcast_to(spacing, len(points)))
    edges = [in_metres(float(edge), str(lateral)) for edge in np.atleast_1d(size)][::-1]
    return tuple(edge / n for edge, n in zip(edges, points, strict=True))


def read_raster(request: Request) -> xr.DataArray:
    """Read one band of a raster in projected coordinates."""
    path, channel, units, spacing = request.path, request.channel, request.units, request.spacing
    require_library(f"reading {path.name!r}", "rasterio", "geo")
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    band = 1 if channel is None else int(channel) + 1 if isinstance(channel, (int, np.integer)) else 0
    with _files.corrupt_named(path.name), warnings.catch_warnings(), _files.open_bytes(path) as stream:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        content = stream.read()
        with (
            rasterio.MemoryFile(content, filename=path.name.removesuffix(".gz")) as file,
            file.open() as raster,
        ):
            _check_raster(raster, band, request)
            heights = np.ma.filled(raster.read(band, masked=True).astype(np.float64), np.nan)
            heights = raster.scales[band - 1] * heights + raster.offsets[band - 1]  # of integers as a rule
            transform, system, stated = raster.transform, raster.crs, raster.units[band - 1]
    # without a reference system lengths are in the unit given, or metres
    factor = float(system.linear_units_factor[1]) if system else in_metres(1.0, units or "m")
    vertical = units or ("m" if stated in METRES else stated)
    heights = np.asarray(in_metres(heights, vertical) if vertical in UNITS else heights * factor)
    steps = np.array([abs(transform.e), abs(transform.a)]) * factor
    if spacing is not None:
        steps = np.broadcast_to(np.asarray(spacing, dtype=np.float64), 2)
    # the first row of most rasters is the northern one; an image without a position is no exception
    if transform.e < 0 or transform.is_identity:
        heights = heights[::-1]
    if transform.a < 0:
        heights = heights[:, ::-1]
    entries = {
        "format": "raster",
        "stated_unit": stated or (str(system.linear_units) if system else None),
        "projection": system.to_string() if system else None,
        "origin": [transform.c * factor, transform.f * factor],
        "reader": f"rasterio {rasterio.__version__}",
        "first_row": "bottom",
    }
    return surface_array(_observed(heights), steps.tolist(), (False, False)).assign_attrs(entries)


def _check_raster(raster: Any, band: int, request: Request) -> None:
    """Check for one band of real heights in projected coordinates, with rows along x."""
    transform = raster.transform
    with Problems("", UnreadableFile) as problems:
        problems.require(
            1 <= band <= raster.count, "channel", f"a band from 0 to {raster.count - 1}", request.channel
        )
        if 1 <= band <= raster.count:
            dtype, stated = raster.dtypes[band - 1], raster.units[band - 1]
            problems.require(np.dtype(dtype).kind in "fiu", "path", "real heights", dtype)
            # a system in feet has heights in its feet
            units = (None, "", *UNITS, *METRES, raster.crs.linear_units if raster.crs else None)
            is_unit = request.units is not None or stated in units
            problems.require(is_unit, "path", 'a unit of length; give `units` ("m", "mm" ...)', stated)
        expected = "None for a raster, which has its y, or the top of the image first"
        problems.require(request.first_row is None, "first_row", expected, request.first_row)
        is_degree = bool(raster.crs) and raster.crs.is_geographic
        problems.require(
            not is_degree, "path", f"projected coordinates; {PROJECT}", "longitudes and latitudes"
        )
        is_turned = transform.b != 0 or transform.d != 0
        problems.require(not is_turned, "path", "rows along x; resample it first", "a rotated raster")
        is_plain = transform.is_identity and not raster.crs
        expected = (
            "a raster with a position; give `spacing`, or read a mask with fractalcontact.domains.read_mask"
        )
        is_placed = not is_plain or request.spacing is not None
        problems.require(is_placed, "path", expected, "an image without one")
