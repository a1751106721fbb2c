"""Checksum of the content of a file, at its end, so that damage is found when the file is read.

NetCDF has a checksum for compressed arrays only, and none for single numbers. The HDF5 library ignores what
follows its content, and cuts it off when it changes a file: a copy has the checksum, a changed file has none.
"""

from __future__ import annotations

import zlib
from pathlib import Path

from fractalcontact.base.errors import UnreadableFile

DAMAGED = "is damaged, or is not a complete NetCDF file"
_MARK = b"\nCRC-32 of the bytes before this line: "
_LENGTH = len(_MARK) + 9  # eight digits and the end of the line
_LEAST = 8  # bytes of the line by which one that was cut off is known
_BLOCK = 1 << 20  # bytes


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
    start = written.rfind(_MARK[:_LEAST])
    is_whole = start == 0 and written.startswith(_MARK)
    if start > 0 or (is_whole and written != _line(path, size)):  # cut off in the line, or other bytes
        fault = "is damaged: its bytes differ from those that were written (checksum)"
        raise UnreadableFile(where, [f"path: {path.name!r} {fault}"])


def _line(path: Path, size: int) -> bytes:
    """Return the line for the first `size` bytes of a file."""
    value = 0
    with path.open("rb") as file:
        for start in range(0, size, _BLOCK):
            value = zlib.crc32(file.read(min(_BLOCK, size - start)), value)
    return _MARK + f"{value:08x}\n".encode()
