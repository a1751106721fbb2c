"""Header of a NetCDF file: content without arrays, read without xarray so that the command starts fast."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fractalcontact.base.content_checksum import DAMAGED, require_checksum
from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.netcdf_lock import NETCDF_LOCK
from fractalcontact.base.validation import Problems, reading


@dataclass(frozen=True)
class Header:
    """Header of a group: its attributes, sizes and attributes of each variable, and some values."""

    attrs: dict[str, Any]
    variables: dict[str, tuple[dict[str, int], dict[str, Any]]]
    numbers: dict[str, Any]


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
                if getattr(variable.dtype, "kind", "O") in "biuf" and read(str(name))
            },
        )
        for name, child in group.groups.items():
            walk(child, f"{name_of_group}/{name}")

    with reading(where, source):
        require_checksum(where, source)
    try:
        with NETCDF_LOCK, netCDF4.Dataset(source) as file:
            walk(file, "")
    except (OSError, RuntimeError) as error:
        raise UnreadableFile(where, [f"path: {source.name!r} {DAMAGED}"]) from error
    return groups


def _sizes(variable: Any) -> dict[str, int]:
    """Return dims and lengths, without the dim of the characters of a string."""
    sizes = dict(zip(variable.dimensions, map(int, variable.shape), strict=True))
    return {
        dim: size for dim, size in sizes.items() if not (variable.dtype == "S1" and dim.startswith("string"))
    }
