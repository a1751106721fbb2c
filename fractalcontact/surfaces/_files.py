"""What every file reader shares: opening, tables of numbers, and the check of scale."""

from __future__ import annotations

import gzip
import io
import math
import warnings
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from fractalcontact.base.errors import ScaleWarning, UnreadableFile

Array = np.ndarray[Any, np.dtype[Any]]
MISSING = ("", "nan", "na", "n/a", "null", "none", "--", "-nan")
RELIEF = (1e-6, 10.0)  # plausible height range over lateral extent
WIDEST = 1.0  # m: no microscope sees more


def kind(path: Path) -> str:
    """Return the suffix that tells the format, without .gz, in lower case."""
    inner = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return inner.suffix.lower()


def opened(path: Path) -> IO[bytes]:
    """Open a file for reading bytes; one packed with gzip is unpacked into memory."""
    if path.suffix.lower() != ".gz":
        return path.open("rb")
    try:
        return io.BytesIO(gzip.decompress(path.read_bytes()))
    except (OSError, EOFError, zlib.error) as error:
        message = f"path: {path.name!r} is corrupt ({error})"
        raise UnreadableFile("fractalcontact.surfaces.read", [message]) from error


class NoTable(ValueError):
    """A text is no table of numbers; the message names the line and the column."""


class NoNumbers(NoTable):
    """A text file is empty."""


def read_table(path: Path) -> Array:
    """Return the numbers of a text file, one row to a line; raise NoTable where it is not such a table.

    Values stand between semicolons, tabs, commas or blanks, with or without quotes; `#` starts a comment; a
    mark at the end of every line stands for nothing. Cells that are empty or one of `MISSING` are NaN.
    """
    with opened(path) as file:
        try:
            text = file.read().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise NoTable(f"it is no text: byte {error.start} is not UTF-8") from error
    lines = [
        (number, content)
        for number, line in enumerate(text.splitlines(), 1)
        if (content := line.partition("#")[0].strip(" \r\n"))
    ]
    if not lines:
        raise NoNumbers("no numbers in it")
    delimiter = next((mark for mark in ";\t," if mark in lines[0][1]), None)
    try:
        # the fast way, for a table in which nothing is missing
        return np.loadtxt([content for _, content in lines], delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        return _parsed([(number, content.split(delimiter)) for number, content in lines], delimiter)


def _parsed(rows: list[tuple[int, list[str]]], delimiter: str | None) -> Array:
    """Turn the cells of each line into numbers, one after the other."""
    if delimiter and all(len(cells) > 1 and not cells[-1].strip() for _, cells in rows):
        rows = [(number, cells[:-1]) for number, cells in rows]
    (first, head), found = rows[0], []
    for number, cells in rows:
        if len(cells) != len(head):
            raise NoTable(f"line {number} has {len(cells)} values, line {first} has {len(head)}")
        found.append([_number(cell, number, column) for column, cell in enumerate(cells, 1)])
    return np.array(found)


def _number(cell: str, line: int, column: int) -> float:
    word = cell.strip().strip("\"'").strip()
    if word.lower() in MISSING:
        return math.nan
    try:
        return float(word.replace("_", "?"))
    except ValueError:
        hint = ", a decimal comma" if "," in word else ""
        raise NoTable(f"line {line}, column {column}: expected a number, got {word[:40]!r}{hint}") from None


def read_npy(path: Path) -> Array:
    """Return the array of an npy file; raise ValueError where it is damaged or holds no numbers."""
    with opened(path) as file:
        try:
            return np.asarray(np.load(io.BytesIO(file.read()), allow_pickle=False))
        except (OSError, EOFError, KeyError) as error:
            raise ValueError(str(error) or "it ends too early") from error


def check_scale(heights: Array, extent: tuple[float, ...], name: str, *, microscope: bool) -> None:
    """Warn where heights and extent do not go together, or where a microscope would be too wide.

    Parameters
    ----------
    heights : ndarray
        In metres.
    extent : tuple of float
        In metres.
    name : str
        Of the file.
    microscope : bool
        The format is that of a microscope or a profiler, not of land surfaces or plain tables.
    """
    widest = max(extent)
    found = []
    if microscope and widest > WIDEST:
        found.append(f"the field is {widest:g} m wide, which no microscope sees")
    there = heights[np.isfinite(heights)]
    relief = float(there.max() - there.min()) / widest if there.size else 0.0
    if relief > 0 and not RELIEF[0] <= relief <= RELIEF[1]:
        expected = f"{RELIEF[0]:g} ... {RELIEF[1]:g}"
        found.append(f"heights span {relief:.1g} of the extent of {widest:.3g} m, a ratio outside {expected}")
    if found:
        message = f"{name}: {'; '.join(found)}; if the unit in the file is wrong, give `units` or `spacing`"
        warnings.warn(message, ScaleWarning, stacklevel=3)
