"""Files of numbers: opening (with gzip), text tables and npy arrays."""

from __future__ import annotations

import gzip
import io
import math
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from fractalcontact.base.errors import FractalContactError, UnreadableFile
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import require_unpacked, unpacked_limit
from fractalcontact.base.units import UNITS
from fractalcontact.base.validation import NONE, Problems

RATIO = 50  # unpacked over packed size; that of measured surfaces is below 20

COMMENTS = ("//", "%")
DECIMAL = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")
HEADED = re.compile(r"(?P<name>[^\s\[(][^\[(\s]*(?: [^\[(\s]+)*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?(?=\s|$)")
NUMPY = {"npy": np.lib.format.MAGIC_PREFIX, "npz": b"PK"}  # how these files start
MISSING = ("", "nan", "na", "n/a", "null", "none", "--", "-nan")


def file_suffix(path: Path) -> str:
    """Return the suffix of the format in lower case, without .gz."""
    inner = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return inner.suffix.lower()


def open_bytes(path: Path) -> IO[bytes]:
    """Open a file for reading bytes; a gzip file is decompressed in memory, up to a multiple of its size."""
    if path.suffix.lower() != ".gz":
        return path.open("rb")
    limit = unpacked_limit(path.stat().st_size, RATIO)
    content = io.BytesIO()
    # in blocks, so that no more is unpacked than the limit and one of them
    with corrupt_named(path.name), gzip.open(path) as file:
        while content.tell() <= limit and (block := file.read(1 << 22)):
            content.write(block)
    require_unpacked("", path.name, content.tell(), limit)
    content.seek(0)
    return content


@contextmanager
def corrupt_named(name: str) -> Iterator[None]:
    """Raise `UnreadableFile` for whatever a library raises in the block, but for errors of the system."""
    try:
        yield
    except Exception as error:
        of_system = isinstance(error, OSError) and error.errno is not None
        if of_system or isinstance(error, (FractalContactError, MemoryError)):
            raise
        reason = str(error)[:300] or type(error).__name__
        raise UnreadableFile("", [f"path: {name!r} is corrupt ({reason})"]) from error


def require_readable(condition: bool, argument: str, expected: str, got: object = NONE) -> None:
    """Raise `UnreadableFile` unless a condition of a file holds."""
    with Problems("", UnreadableFile) as problems:
        problems.require(condition, argument, expected, got)


def check_unpacked(name: str, file: IO[bytes]) -> None:
    """Refuse an archive (zip: npz, x3p), HDF5 or MATLAB file that unpacks to far more than its size."""
    head = file.read(10)
    limit, unpacked = unpacked_limit(file.seek(0, io.SEEK_END), RATIO), 0
    file.seek(0)
    with corrupt_named(name):
        if head.startswith(b"PK"):
            with zipfile.ZipFile(file) as archive:
                unpacked = sum(entry.file_size for entry in archive.infolist())
        elif head.startswith((b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3")):
            unpacked = _hdf5_size(file)
        elif head.startswith(b"MATLAB"):
            from scipy.io import whosmat

            unpacked = sum(8 * math.prod(shape) for _, shape, _ in whosmat(file))
    file.seek(0)
    require_unpacked("", name, unpacked, limit)


def _hdf5_size(file: IO[bytes]) -> int:
    """Return the sum of the sizes of all arrays in an HDF5 file."""
    import h5py  # comes with SurfaceTopography

    sizes = [0]
    with h5py.File(file) as content:
        content.visititems(lambda _, node: sizes.append(int(getattr(node, "nbytes", 0))))
    return sum(sizes)


@dataclass(frozen=True)
class Request:
    """A file, and what the caller states of it: the arguments of `surfaces.read`."""

    path: Path
    channel: str | int | None = None
    units: str | None = None
    spacing: Any = None
    first_row: str | None = None
    columns: Sequence[str | int] | None = None
    plane: Any = None

    @property
    def suffix(self) -> str:
        """The suffix of the format."""
        return file_suffix(self.path)


def array_name(names: Sequence[str], request: Request, kind: str) -> str:
    """Return the name of the only array, of that called `channel` or with its number, or `height`."""
    channel, default = request.channel, names[0] if len(names) == 1 else "height"
    name = names[channel] if isinstance(channel, int) and 0 <= channel < len(names) else channel or default
    expected = f"one of {', '.join(map(repr, names))}" if names else kind
    got = NONE if channel is None else channel
    require_readable(name in names, "channel", f"{expected} in {request.path.name!r}", got)
    return str(name)


class NotATable(ValueError):
    """A text is not a table of numbers; the message names the line and the column."""


class EmptyTable(NotATable):
    """A text file has no numbers."""


@dataclass(frozen=True)
class Table:
    """Numbers of a text file, one row per line, and what its header states.

    Attributes
    ----------
    values : ndarray, shape (rows, columns)
    names, units : tuple of str
        One for each column, as in the header; empty where there is none.
    is_named : bool
        The first line has names, not numbers.
    decimal_comma : bool
    comment : str
        The last comment before the numbers.
    """

    values: Array
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    is_named: bool = False
    decimal_comma: bool = False
    comment: str = ""


def read_table(path: Path) -> Table:
    """Return the numbers of a text file, one row per line.

    Values are separated by semicolons, tabs, commas or blanks, with or without quotes; `#`, `//` or `%` start
    a comment; a separator at the end of every line is ignored. Cells that are empty or one of `MISSING` are
    NaN. A first line without any number has the names of the columns; so may the last comment before the
    numbers. Numbers between semicolons, tabs or blanks may have decimal commas. The number of rows on a line
    of its own before them (PTS) is left out.

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
    lines, comment = _content_lines(text)
    if not lines:
        raise EmptyTable("no numbers in it")
    if len(lines) > 1 and lines[0][1].isdigit() and int(lines[0][1]) == len(lines) - 1:
        lines = lines[1:]
    first = lines[0][1]
    delimiter = next((mark for mark in ";\t," if mark in first), None)
    is_named = len(lines) > 1 and _has_no_number(first.split(delimiter))
    rows = lines[1:] if is_named else lines
    comma = _has_decimal_comma(next((content for _, content in rows if "," in content), ""))
    if comma:
        delimiter = None if delimiter == "," else delimiter
        pointed = next((number for number, content in rows if "." in content), 0)
        if pointed:
            fault = f"line {pointed}: expected decimal commas as in the lines before, got a decimal point"
            raise NotATable(fault)
        rows = [(number, content.replace(",", ".")) for number, content in rows]
    try:
        # the fast path, for a table without missing cells
        contents = [content for _, content in rows]
        values = np.loadtxt(contents, delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        values = _parsed(rows, delimiter)
    names, units = _header(first if is_named else comment, delimiter, values.shape[1])
    return Table(values, names, units, is_named, comma, comment)


def _content_lines(text: str) -> tuple[list[tuple[int, str]], str]:
    """Return number and content of the lines that are not empty, and the last comment before them."""
    lines: list[tuple[int, str]] = []
    comment = ""
    for number, line in enumerate(text.splitlines(), 1):
        content = line.partition("#")[0].strip(" \r\n")
        if not lines and (not content or content.startswith(COMMENTS)):
            comment = line.strip(" \r\n#/%") or comment
        elif content and not content.startswith(COMMENTS):
            lines.append((number, content))
    return lines, comment


def _has_no_number(cells: list[str]) -> bool:
    """Return whether every cell has letters, and none is a number or stands for a missing one."""
    words = [cell.strip().strip("\"'").strip() for cell in cells]
    filled = [word for word in words if word]
    return (
        bool(filled)
        and all(word[0].isalpha() or word[0] == "_" for word in filled)
        and not any(word.lower() in (*MISSING, "inf", "infinity") for word in filled)
    )


def _has_decimal_comma(line: str) -> bool:
    """Return whether the commas of a line of numbers are decimal commas."""
    if "," not in line or "." in line:
        return False
    mark = next((mark for mark in ";\t" if mark in line), None)
    cells = [cell.strip() for cell in line.split(mark) if cell.strip()]
    return (mark is not None or len(cells) > 1) and all(
        DECIMAL.fullmatch(cell) or cell.lower() in MISSING for cell in cells
    )


def _header(line: str, delimiter: str | None, columns: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the columns; none where their number is another than that of the columns."""
    parts = line.split(delimiter) if delimiter else [match.group() for match in HEADED.finditer(line)]
    while len(parts) > columns and not parts[-1].strip():
        parts.pop()
    matches = [match for part in parts if (match := HEADED.fullmatch(part.strip().strip("\"'").strip()))]
    if not len(matches) == len(parts) == columns:
        return (), ()
    headed = [_name_and_unit(match["name"].strip(), match["unit"]) for match in matches]
    return tuple(name for name, _ in headed), tuple(unit for _, unit in headed)


def _name_and_unit(name: str, unit: str | None) -> tuple[str, str]:
    """Return name and unit of a column; a unit may be the last word without brackets."""
    first, _, last = name.rpartition(" ")
    return (first, last) if unit is None and first and last in UNITS else (name, unit or "")


def _parsed(lines: list[tuple[int, str]], delimiter: str | None) -> Array:
    """Convert the cells one by one, to name the place of a wrong one."""
    rows = [(number, content.split(delimiter)) for number, content in lines]
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
        fault = f"line {line}, column {column}: expected a number, got {word[:40]!r}{hint}"
        raise NotATable(fault) from None


def read_npy(path: Path) -> Array:
    """Return the array of an npy file; raise an error if it is damaged, of another format or has objects.

    Its header is compared with the length of the file before memory for the array is taken.
    """
    with open_bytes(path) as file:
        content = io.BytesIO(file.read())
    _require_format(content, "npy")
    npy = np.lib.format
    is_first = npy.read_magic(content) == (1, 0)
    shape, _, dtype = (npy.read_array_header_1_0 if is_first else npy.read_array_header_2_0)(content)
    stated, there = math.prod(shape) * dtype.itemsize, len(content.getbuffer()) - content.tell()
    if not dtype.hasobject and stated > there:
        raise ValueError(f"it states {stated} bytes of numbers and has {there}")
    content.seek(0)
    return np.asarray(npy.read_array(content, allow_pickle=False))


def _require_format(file: IO[bytes], name: str) -> None:
    """Raise ValueError for a numpy file of the other format, which `numpy.load` reads as what it is."""
    head = file.read(max(map(len, NUMPY.values())))
    file.seek(0)
    for other, start in NUMPY.items():
        if other != name and head.startswith(start):
            raise ValueError(f"expected an {name} file, got an {other} file")


def read_npz(path: Path) -> dict[str, Array]:
    """Return the arrays of an npz file by name; raise an error if it is damaged or has no numbers."""
    with open_bytes(path) as file:
        _require_format(file, "npz")
        check_unpacked(path.name, file)
        with np.load(file, allow_pickle=False) as archive:
            return {name: np.asarray(archive[name]) for name in archive.files}
