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


class NoNumbers(ValueError):
    """A text file is empty."""


def read_table(path: Path) -> Array:
    """Return the numbers of a text file, one row to a line; raise ValueError where it is not such a table.

    Values stand between blanks, tabs, commas or semicolons; empty cells and words like "nan" are missing; `#`
    starts a comment.
    """
    with opened(path) as file:
        text = file.read().decode("utf-8-sig")
    first = next((line for line in text.splitlines() if line.split("#")[0].strip()), "")
    delimiter = next((mark for mark in ",;\t" if mark in first), None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # an empty file
        table = np.loadtxt(
            io.StringIO(text), delimiter=delimiter, converters=_number, ndmin=2, encoding="utf-8"
        )
    if table.size == 0:
        raise NoNumbers("no numbers in it")
    return np.asarray(table)


def _number(cell: str) -> float:
    word = cell.strip()
    return math.nan if word.lower() in MISSING else float(word)


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
