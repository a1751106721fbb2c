"""Files of numbers: opening (with gzip), text tables and npy arrays."""

from __future__ import annotations

import gzip
import io
import math
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from fractalcontact.base.errors import UnreadableFile

Array = np.ndarray[Any, np.dtype[Any]]
MISSING = ("", "nan", "na", "n/a", "null", "none", "--", "-nan")


def file_suffix(path: Path) -> str:
    """Return the suffix of the format in lower case, without .gz."""
    inner = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return inner.suffix.lower()


def open_bytes(path: Path) -> IO[bytes]:
    """Open a file for reading bytes; a gzip file is decompressed in memory."""
    if path.suffix.lower() != ".gz":
        return path.open("rb")
    try:
        return io.BytesIO(gzip.decompress(path.read_bytes()))
    except (OSError, EOFError, zlib.error) as error:
        message = f"path: {path.name!r} is corrupt ({error})"
        raise UnreadableFile("fractalcontact.surfaces.read", [message]) from error


class NotATable(ValueError):
    """A text is not a table of numbers; the message names the line and the column."""


class EmptyTable(NotATable):
    """A text file has no numbers."""


def read_table(path: Path) -> Array:
    """Return the numbers of a text file, one row per line.

    Values are separated by semicolons, tabs, commas or blanks, with or without quotes; `#` starts a comment;
    a separator at the end of every line is ignored. Cells that are empty or one of `MISSING` are NaN.

    Raises
    ------
    NotATable
        A cell is not a number, or the lines differ in length.
    """
    with open_bytes(path) as file:
        try:
            text = file.read().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise NotATable(f"it is not text: byte {error.start} is not UTF-8") from error
    lines = [
        (number, content)
        for number, line in enumerate(text.splitlines(), 1)
        if (content := line.partition("#")[0].strip(" \r\n"))
    ]
    if not lines:
        raise EmptyTable("no numbers in it")
    delimiter = next((mark for mark in ";\t," if mark in lines[0][1]), None)
    try:
        # the fast path, for a table without missing cells
        return np.loadtxt([content for _, content in lines], delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        return _parsed([(number, content.split(delimiter)) for number, content in lines], delimiter)


def _parsed(rows: list[tuple[int, list[str]]], delimiter: str | None) -> Array:
    """Convert the cells one by one, to name the place of a wrong one."""
    if delimiter and all(len(cells) > 1 and not cells[-1].strip() for _, cells in rows):
        rows = [(number, cells[:-1]) for number, cells in rows]
    (first, head), values = rows[0], []
    for number, cells in rows:
        if len(cells) != len(head):
            raise NotATable(f"line {number} has {len(cells)} values, line {first} has {len(head)}")
        values.append([_number(cell, number, column) for column, cell in enumerate(cells, 1)])
    return np.array(values)


def _number(cell: str, line: int, column: int) -> float:
    word = cell.strip().strip("\"'").strip()
    if word.lower() in MISSING:
        return math.nan
    try:
        return float(word.replace("_", "?"))
    except ValueError:
        hint = ", a decimal comma" if "," in word else ""
        raise NotATable(f"line {line}, column {column}: expected a number, got {word[:40]!r}{hint}") from None


def read_npy(path: Path) -> Array:
    """Return the array of an npy file; raise ValueError if it is damaged or has no numbers."""
    with open_bytes(path) as file:
        try:
            return np.asarray(np.load(io.BytesIO(file.read()), allow_pickle=False))
        except (OSError, EOFError, KeyError) as error:
            raise ValueError(str(error) or "it ends too early") from error
