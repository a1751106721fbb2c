"""Points of clouds and meshes, read from files."""

from __future__ import annotations

import io
import os
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import MissingExtra, UnreadableFile, require_library
from fractalcontact.base.numbers import Array
from fractalcontact.base.provenance import file_checksum
from fractalcontact.base.resources import require_unpacked, unpacked_limit
from fractalcontact.base.results import public_result
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import Problems, reading
from fractalcontact.surfaces import _files
from fractalcontact.surfaces._files import NotATable, Table
from fractalcontact.surfaces._instruments import PROJECT

MESHES = (".ply", ".stl", ".obj", ".off")
CLOUDS = (".las", ".laz")
LISTS = (".xyz", ".pts", ".csv", ".txt", ".tsv", ".dat", ".asc")
ALWAYS_POINTS = (".xyz", ".pts")  # suffixes of lists whose further columns are colours and the like
LEAST_POINTS = 4  # rows of a table of two or three columns that is a list of points, and of a plane
X = ("x", "points:0", "easting", "east", "e")
Y = ("y", "points:1", "northing", "north", "n")
Z = ("z", "points:2", "height", "elevation", "altitude", "h")
DEGREES = ("lon", "long", "longitude", "lat", "latitude")


def check_columns(problems: Problems) -> None:
    """Check for the names or numbers of the columns of x, y, z or x, z."""
    columns = problems.given.columns
    if columns is None:
        return
    is_list = (
        isinstance(columns, Sequence) and not isinstance(columns, (str, bytes)) and len(columns) in (2, 3)
    )
    valid = is_list and all(
        isinstance(name, str)
        or (isinstance(name, (int, np.integer)) and not isinstance(name, bool) and name >= 0)
        for name in columns
    )
    problems.require(valid, "columns", "names or numbers (from 0) of x, y, z or of x, z", columns)


def _check(problems: Problems) -> None:
    given = problems.given
    problems.choice("units", among=UNITS, optional=True)
    check_columns(problems)
    if not problems.path("path"):
        return
    source = Path(given.path)
    problems.file("path")
    suffixes = (*MESHES, *CLOUDS, *LISTS)
    is_readable = _files.file_suffix(source) in suffixes
    problems.require(is_readable, "path", f"a file of points: {', '.join(suffixes)}", source.name)


@public_result(
    title="Points read from a file",
    achieved_error="exact: positions as the file states them",
    check=_check,
    error=UnreadableFile,
)
def read_points(
    path: str | os.PathLike[str], *, units: str | None = None, columns: Sequence[str | int] | None = None
) -> xr.Dataset:
    """Read the points of a cloud or mesh, to select a part of them or to fit a plane.

    Parameters
    ----------
    path : path-like
        A list of points in text (`.xyz`, `.pts`, `.csv`, `.txt`, `.tsv`, `.dat`, `.asc`), a mesh or cloud
        (`.ply`, `.stl`, `.obj`, `.off`, `.las`, `.laz`; extra `mesh`), or one of them with `.gz`.
    units : str, optional
        Unit of the coordinates: "m", "mm", "um" ... Default: those of the header, one for all columns or
        one for each, or metres.
    columns : sequence of str or int, optional
        Names or numbers (from 0) of the columns of x, y, z, or of x, z of a profile. Default: those called
        so, or the first ones.

    Returns
    -------
    Dataset
        `position` (m) with dims (point, point_axis); of a mesh also `triangles` with dims (triangle, corner),
        the numbers of the points that each triangle joins. `from_points` grids it.

    Raises
    ------
    UnreadableFile
        The file is corrupt, its columns cannot be told apart, or it has longitudes and latitudes.
    MissingExtra
        A mesh or a LAS file, and the library that reads it is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import fractalcontact as fc
    >>> path = Path(tempfile.mkdtemp()) / "scan.csv"
    >>> size = path.write_text("x [mm],y [mm],z [mm]" + chr(10) + "0,1,2" + chr(10) + "3,4,5" + chr(10))
    >>> points = fc.surfaces.read_points(path)
    >>> points.position.sel(point_axis="z").values.tolist()
    [0.002, 0.005]
    """
    source = Path(path)
    with reading("", source):
        points, digest = point_content(source, columns), file_checksum(source)
        position = in_metres(points["position"], unit_of(points, units))
    facts = {"parameters": {"path": source.name}, "file_sha256": digest, **points.attrs}
    return points.assign(position=position).assign_attrs(facts)


def unit_of(points: xr.Dataset, units: str | None) -> str:
    """Return the unit of coordinates: that given, else that of the file, else metres."""
    expected = "None, as each column states its unit"
    _files.require_readable(units is None or "stated_units" not in points.attrs, "units", expected, units)
    return units or points.attrs["stated_unit"] or "m"


def labelled_points(
    position: Array, unit: str | None, entries: dict[str, Any], triangles: Array | None = None
) -> xr.Dataset:
    """Return points, shape (n, 2) or (n, 3), in the unit of their file, with entries of the provenance.

    The triangles, shape (m, 3), are those of a mesh.
    """
    axes = ["x", "y", "z"] if position.shape[1] == 3 else ["x", "z"]
    points = xr.Dataset({"position": (("point", "point_axis"), position)}, {"point_axis": axes})
    if triangles is not None and len(triangles):
        points["triangles"] = ("triangle", "corner"), triangles
    return points.assign_attrs(entries, stated_unit=unit)


def point_content(path: Path, columns: Sequence[str | int] | None) -> xr.Dataset:
    """Read a file of points with the reader of its format."""
    suffix = _files.file_suffix(path)
    if suffix in (*MESHES, *CLOUDS):
        expected = f"None for {suffix}, which states what is x, y and z"
        _files.require_readable(columns is None, "columns", expected, columns)
    if suffix in MESHES:
        return _mesh(path, suffix)
    if suffix in CLOUDS:
        return _las(path)
    try:
        table = _files.read_table(path)
    except NotATable as error:
        raise UnreadableFile("", [f"path: {path.name!r} is not a table of numbers ({error})"]) from error
    return listed_points(table, path, columns)


def is_list(table: Table, path: Path, columns: Sequence[str | int] | None) -> bool:
    """Return whether a table is a list of points and not a grid of heights."""
    rows, number = table.values.shape
    names = [name.lower() for name in table.names]
    return (
        columns is not None
        or _files.file_suffix(path) in ALWAYS_POINTS
        or (number in (2, 3) and rows >= LEAST_POINTS)
        or (bool(names) and _place(names, X) is not None and _place(names, Z) is not None)
    )


def listed_points(table: Table, path: Path, columns: Sequence[str | int] | None) -> xr.Dataset:
    """Return the points of a table."""
    chosen = _columns(table, path, columns)
    values, units = table.values[:, chosen], [table.units[k] for k in chosen] if table.units else []
    stated = set(filter(None, units))
    with Problems("", UnreadableFile) as problems:
        names = [name for name in table.names if name.lower() in DEGREES]
        expected = f"coordinates in a unit of length; {PROJECT}"
        problems.require(
            not names and not stated & {"deg", "degree", "degrees", "°"}, "columns", expected, names
        )
        unknown = sorted(stated.difference(UNITS))
        problems.require(not unknown, "columns", "coordinates in a unit of length", unknown)
        expected = "the unit of every coordinate, where they have several"
        problems.require(len(stated) <= 1 or all(units), "columns", expected, units)
        problems.not_infinite("path", values, "coordinates")
    entries: dict[str, Any] = {"format": "list of points", "columns": chosen}
    if table.names:
        entries["columns"] = [table.names[k] for k in chosen]
    if len(stated) > 1:  # all in that of x, as a profilometer writes x in mm and z in um
        factors = [in_metres(1.0, unit) / in_metres(1.0, units[0]) for unit in units]
        values, stated, entries["stated_units"] = values * factors, {units[0]}, units
    if table.decimal_comma:
        entries["decimal_mark"] = ","
    return labelled_points(values, next(iter(stated), None), entries)


def _columns(table: Table, path: Path, columns: Sequence[str | int] | None) -> list[int]:
    """Return the numbers of the columns of x, y, z or x, z."""
    number, names = table.values.shape[1], [name.lower() for name in table.names]
    problem = ""
    if columns is not None:
        wanted = [names.index(c.lower()) if isinstance(c, str) and c.lower() in names else c for c in columns]
        if all(not isinstance(k, str) and k < number for k in wanted):
            expected = "a different column for each coordinate"
            _files.require_readable(len(set(wanted)) == len(wanted), "columns", expected, list(columns))
            return [int(k) for k in wanted]
        choices = ", ".join(map(repr, table.names)) or f"numbers from 0 to {number - 1}"
        problem = f"columns: expected some of {choices}, got {list(columns)!r}"
    elif number < 2:
        problem = f"path: expected two or three columns in {path.name!r}, got {number}"
    elif names and _place(names, X) is not None and _place(names, Z) is not None:
        places = [_place(names, group) for group in (X, Y, Z)]
        return [place for place in places if place is not None]
    elif number == 2:
        return [0, 1]
    elif not (names and table.is_named) and (number == 3 or _files.file_suffix(path) in ALWAYS_POINTS):
        return [0, 1, 2]
    else:
        label = f"called {', '.join(map(repr, table.names))}" if names else f"without names, {number} of them"
        problem = (
            f"columns: expected the names or numbers of those of x, y, z; {path.name!r} has columns {label}"
        )
    raise UnreadableFile("", [problem])


def _place(names: list[str], group: Sequence[str]) -> int | None:
    """Return the number of the column whose first word is one of a group."""
    words = [name.partition(" ")[0] for name in names]
    return next((words.index(name) for name in group if name in words), None)


def _mesh(path: Path, suffix: str) -> xr.Dataset:
    """Read a mesh, or a cloud of points in the format of a mesh."""
    require_library(f"reading {path.name!r}", "trimesh", "mesh")
    import trimesh

    with _files.corrupt_named(path.name):
        with _files.open_bytes(path) as file:
            mesh = trimesh.load(file, file_type=suffix.lstrip("."), process=False)
        if isinstance(mesh, trimesh.Scene):
            mesh = mesh.to_mesh() if mesh.geometry else trimesh.Trimesh()
        position = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.array(getattr(mesh, "faces", np.empty((0, 3))), dtype=np.int64).reshape(-1, 3)
    _files.require_readable(len(position) > 0, "path", f"points in {path.name!r}")
    entries = {"format": suffix.lstrip("."), "reader": f"trimesh {trimesh.__version__}"}
    return labelled_points(position, None, entries, triangles)


def _las(path: Path) -> xr.Dataset:
    """Read a LAS or LAZ file; longitudes and latitudes are refused."""
    require_library(f"reading {path.name!r}", "laspy", "mesh")
    import laspy

    if _files.file_suffix(path) == ".laz" and not laspy.LazBackend.detect_available():
        raise MissingExtra(f"reading {path.name!r}", "lazrs", "mesh")
    with _files.corrupt_named(path.name), _files.open_bytes(path) as file:
        _check_las_size(file, path)
        cloud = laspy.read(file)
        position = np.array(cloud.xyz, dtype=np.float64)
    system = _reference_system(cloud.header.vlrs)
    with Problems("", UnreadableFile) as problems:
        expected = f"projected coordinates; {PROJECT}"
        problems.require(system != "degree", "path", expected, "longitudes and latitudes")
        problems.require(system != "foot", "path", "coordinates in metres; convert it first", "feet")
        problems.require(len(position) > 0, "path", f"points in {path.name!r}", "none")
    entries = {"format": path.suffix.lstrip("."), "reader": f"laspy {laspy.__version__}"}
    return labelled_points(position, "m" if system == "metre" else None, entries)


def _check_las_size(file: IO[bytes], path: Path) -> None:
    """Refuse a file that states more points or records than it can hold: the library would make them all.

    The places of the counts are those of the ASPRS LAS specification 1.4.
    """
    import laspy

    # places in the header (ASPRS, LAS 1.4 R15)
    size = file.seek(0, io.SEEK_END)
    counts = {"records": _unpacked("<I", file, 100)}
    if _unpacked("<BB", file, 24) >= (1, 4):
        counts["extended records"] = _unpacked("<I", file, 243)
    for what, (count,) in counts.items():
        if count * 54 > size:  # bytes of a record without content
            raise ValueError(f"it states {count} {what} in {size} bytes")
    file.seek(0)
    header = laspy.LasHeader.read_from(file)
    stated = header.point_count * header.point_format.size
    require_unpacked("", path.name, stated, unpacked_limit(size, _files.RATIO))
    if header.are_points_compressed:
        (table,) = _unpacked("<q", file, header.offset_to_point_data)
        if table == -1:  # written to a stream: the place of the table ends the file
            (table,) = _unpacked("<q", file, size - 8)
        _, chunks = _unpacked("<II", file, table)
        if chunks > size:
            raise ValueError(f"it states {chunks} chunks in {size} bytes")
    file.seek(0)


def _unpacked(form: str, file: IO[bytes], place: int) -> tuple[int, ...]:
    file.seek(place)
    return struct.unpack(form, file.read(struct.calcsize(form)))


def _reference_system(records: Any) -> str:
    """Return the unit of the coordinates that the records of a LAS file state: "" if none does."""
    for record in records:
        text = str(getattr(record, "string", "")).upper()
        if "GEOG" in text and "PROJ" not in text:
            return "degree"
        if units := re.findall(r'UNIT\s*\[\s*"([^"]*)"', text):
            return "foot" if any("FOOT" in unit or "FEET" in unit for unit in units) else "metre"
        keys = [(key.id, key.value_offset) for key in getattr(record, "geo_keys", ())]
        if (1024, 2) in keys:  # of a GeoTIFF directory: the model is latitude and longitude
            return "degree"
        lengths = {number for key, number in keys if key in (3076, 4099)}  # units of x and y, of z
        if lengths & {9002, 9003}:  # EPSG: the international foot and that of the US survey; 9001 the metre
            return "foot"
        if lengths == {9001}:
            return "metre"
    return ""
