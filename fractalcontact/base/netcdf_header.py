"""Header and checksum of a NetCDF file, read without xarray so that the command starts fast.

NetCDF has a checksum for compressed arrays only, and none for single numbers, so a file has one of its whole
content behind its end. The HDF5 library ignores what follows its content, and cuts it off when it changes a
file: a copy has the checksum, a changed file has none. Tried in its place: the filter `fletcher32` on every
array. Of 3000 bits flipped in a file of two load steps, two then changed a single number without a word; a
small result takes 30 kB more, and plain xarray warns where it is opened in blocks of one step.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.netcdf_lock import NETCDF_LOCK
from fractalcontact.base.validation import Problems, reading

DAMAGED = "is damaged, or is not a complete NetCDF file"
_MARK = b"\nCRC-32 of the bytes before this line: "
_LENGTH = len(_MARK + b"00000000\n")


@dataclass(frozen=True)
class Header:
    """Header of a group: its attributes, sizes and attributes of each variable, and some values."""

    attrs: dict[str, Any]
    variables: dict[str, tuple[dict[str, int], dict[str, Any]]]
    values: dict[str, Any]


def read_headers(path: str | os.PathLike[str], read: Callable[[str], bool]) -> dict[str, Header]:
    """Return the header of every group of a file, with the values of the variables selected by `read`.

    Raises
    ------
    UnreadableFile
        The file does not exist, is truncated or damaged, or is not NetCDF.
    """
    import netCDF4  # loads slowly

    where = "fractalcontact.open"
    with Problems(where, UnreadableFile) as problems:
        problems.file("path", path)
    source = Path(path)
    groups: dict[str, Header] = {}

    def walk(group: Any, name_of_group: str) -> None:
        groups[name_of_group or "/"] = Header(
            dict(group.__dict__),
            {
                str(name): (_sizes(variable), dict(variable.__dict__))
                for name, variable in group.variables.items()
            },
            {
                str(name): variable[...]
                for name, variable in group.variables.items()
                if getattr(variable.dtype, "kind", "O") in "biufOS" and read(str(name))
            },
        )
        for name, child in group.groups.items():
            walk(child, f"{name_of_group}/{name}")

    with reading(where, source):
        require_checksum(where, source)
    try:
        with NETCDF_LOCK, netCDF4.Dataset(source) as file:
            walk(file, "")
    except (OSError, RuntimeError, ValueError) as error:  # the last for names that are not UTF-8
        raise UnreadableFile(where, [f"path: {source.name!r} {DAMAGED}"]) from error
    return groups


def _sizes(variable: Any) -> dict[str, int]:
    """Return dims and lengths, without the dim of the characters of a string."""
    sizes = dict(zip(variable.dimensions, map(int, variable.shape), strict=True))
    return {
        dim: size for dim, size in sizes.items() if not (variable.dtype == "S1" and dim.startswith("string"))
    }


def append_checksum(path: Path) -> None:
    """Write the checksum of a complete file behind its content."""
    line = _line(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(line)


def require_checksum(where: str, path: Path) -> None:
    """Raise `UnreadableFile` if a file has a checksum that its content does not match."""
    size = path.stat().st_size - _LENGTH
    with path.open("rb") as file:
        file.seek(max(size, 0))
        written = file.read(_LENGTH)
    start = written.rfind(_MARK[:8])  # of a line that was cut off: eight arbitrary bytes are never these
    is_whole = start == 0 and written.startswith(_MARK)
    if start > 0 or (is_whole and written != _line(path, size)):  # cut off in the line, or other bytes
        fault = "is damaged: its bytes differ from those that were written (checksum)"
        raise UnreadableFile(where, [f"path: {path.name!r} {fault}"])


def _line(path: Path, size: int) -> bytes:
    """Return the line for the first `size` bytes of a file."""
    value = 0
    with path.open("rb") as file:
        while left := size - file.tell():
            value = zlib.crc32(file.read(min(left, 1 << 20)), value)
    return _MARK + f"{value:08x}\n".encode()
