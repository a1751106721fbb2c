"""Files and folders: those installed with the package, those of a pattern, output, files written as a whole.

Nothing here needs NumPy, so that the command starts fast.
"""

from __future__ import annotations

import errno
import os
import re
import sys
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import glob
from pathlib import Path
from types import TracebackType
from typing import Any

from fractalcontact.base.errors import InvalidInput, UnreadableFile

SCHEMA = "fractalcontact.schema.json"  # of scenes, for editors
WILDCARD = re.compile(r"\*\*/|\*|\?|\[[^\]]+\]")
GROUPS = {"**/": "((?:.*/)?)", "*": "([^/]*)", "?": "([^/])"}
RESULT, PARTIAL_RESULT = "result.nc", "partial.nc"
WHERE = "fractalcontact run"
PARTIAL = ".partial"  # end of a temporary name
DAMAGED = "is damaged, or is not a complete NetCDF file"
_MARK = b"\nCRC-32 of the bytes before this line: "
_LENGTH = len(_MARK + b"00000000\n")


def datasets_folder() -> Path:
    """Return the folder: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    installed = package / "datasets"
    return installed if installed.is_dir() else package.parent / "datasets"


def is_pattern(name: Any, folder: Path = Path()) -> bool:
    """Return whether a name is a pattern and not that of a file."""
    return isinstance(name, str) and bool(WILDCARD.search(name)) and not (folder / name).is_file()


def files_of(pattern: str, folder: Path = Path()) -> dict[str, str]:
    """Return the files of a pattern, sorted, by what its wildcards stand for; relative ones from `folder`."""
    name = os.path.expandvars(pattern)
    pattern = Path(os.path.normpath(folder.absolute() / name)).as_posix()  # the folder may not exist yet
    paths = glob(pattern, recursive=True)  # noqa: PTH207 `Path.glob` takes no absolute one
    names = sorted(Path(path).as_posix() for path in paths if Path(path).is_file())
    groups = (GROUPS.get(part, f"({part.replace('[!', '[^')})") for part in WILDCARD.findall(pattern))
    fixed = [re.escape(text) for text in WILDCARD.split(pattern)]
    expression = re.compile("".join(text for pair in zip(fixed, [*groups, ""], strict=True) for text in pair))
    files = {}
    for path in names:
        match = expression.fullmatch(path)
        key = "_".join(filter(None, match.groups())) if match else path
        files[key] = path if Path(name).is_absolute() else Path(os.path.relpath(path, folder)).as_posix()
    return files


def output_folder(out: str | os.PathLike[str]) -> Path:
    """Return the output folder, created if necessary and without temporary files of interrupted runs."""
    from fractalcontact.base.validation import Problems  # loads NumPy

    with Problems(WHERE) as problems:
        problems.path("out", out, what="the path of a folder")
    out = Path(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        clear_partial(out)
        if not os.access(out, os.W_OK):
            raise PermissionError(errno.EACCES, "no permission to write")
    except OSError as error:
        got = f"{out.name!r}: {error.strerror}"
        raise InvalidInput.of(WHERE, "out", "a folder to write in", got) from error
    return out


@contextmanager
def locked(folder: Path | None) -> Iterator[None]:
    """Lock a folder against other runs; the lock ends with the process, however it ends."""
    try:
        import fcntl
    except ImportError:  # a system without such locks
        folder = None
    if folder is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                got = f"{folder.name!r}: another run is writing in it"
                raise InvalidInput.of(WHERE, "out", "a folder of its own", got) from None
        yield
    finally:
        os.close(descriptor)


class _NetcdfLock:
    """A lock of this process that one thread may take several times.

    It includes the lock under which xarray reads lazy arrays. xarray cannot be called with a file of its own
    while that is held, as its lock may be taken only once; arrays of such files are loaded before.
    """

    def __init__(self) -> None:
        self._own = threading.RLock()
        self._depth = 0
        self._of_xarray: Any = None

    def acquire(self, blocking: bool = True) -> bool:
        """Take the lock; return whether it was taken."""
        if not self._own.acquire(blocking):
            return False
        if self._depth == 0:
            # not imported here: the header of a file is read without xarray, which is slow to import
            backend = sys.modules.get("xarray.backends.netCDF4_")
            self._of_xarray = getattr(backend, "NETCDF4_PYTHON_LOCK", None)
            if self._of_xarray is not None and not self._of_xarray.acquire(blocking=blocking):
                self._own.release()
                return False
        self._depth += 1
        return True

    def release(self) -> None:
        """Give the lock back."""
        self._depth -= 1
        if self._depth == 0 and self._of_xarray is not None:
            self._of_xarray.release()
        self._own.release()

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


NETCDF_LOCK = _NetcdfLock()

if hasattr(os, "register_at_fork"):
    # a process is not forked while another thread is inside the library, whose state the fork would keep
    os.register_at_fork(
        before=NETCDF_LOCK.acquire,
        after_in_parent=NETCDF_LOCK.release,
        after_in_child=NETCDF_LOCK.release,
    )


@contextmanager
def written_whole(target: Path) -> Iterator[Path]:
    """Yield a temporary name to write to; the file gets its own name when it is complete."""
    temporary = _unfinished(target)
    try:
        yield temporary
        temporary.replace(target)
    finally:
        if target.parent.is_dir():
            temporary.unlink(missing_ok=True)


def _unfinished(target: Path) -> Path:
    """Return the temporary name under which this thread of this process writes a file."""
    place = f"{_machine()}.{threading.get_native_id()}.{os.getpid()}"
    return target.with_name(f".{target.name}.{place}{PARTIAL}")


def clear_partial(folder: Path) -> None:
    """Remove the temporary files of processes of this machine that have ended."""
    for leftover in folder.glob(f".*.{_machine()}.*{PARTIAL}"):
        number = leftover.name.removesuffix(PARTIAL).rpartition(".")[2]
        if number.isdigit() and int(number) != os.getpid() and not _alive(int(number)):
            leftover.unlink(missing_ok=True)


def _machine() -> str:
    """Return the name of this machine: process numbers of machines that share a folder may coincide."""
    import platform  # loads slowly, and the command does without

    return "".join(letter for letter in platform.node() if letter.isalnum() or letter == "-") or "here"


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it belongs to another user
        return True
    return True


def append_checksum(path: Path) -> None:
    """Write the checksum of a complete file behind its content.

    NetCDF has a checksum for compressed arrays only, and none for single numbers. The HDF5 library ignores
    what follows its content, and cuts it off when it changes a file: a copy has the checksum, a changed file
    has none. Tried in its place: the filter `fletcher32` on every array. Of 3000 bits flipped in a file of
    two load steps, two then changed a single number without a word; a small result takes 30 kB more, and
    plain xarray warns where it is opened in blocks of one step.
    """
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
            value = zlib.crc32(file.read(min(left, 1 << 20)), value)  # 2^16 to 2^22: as fast
    return _MARK + f"{value:08x}\n".encode()
