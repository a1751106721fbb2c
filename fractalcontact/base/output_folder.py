"""Output folder of a run: created if necessary, and locked for one run at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.netcdf import clear_partial
from fractalcontact.base.validation import Problems

RESULT, PARTIAL_RESULT = "result.nc", "partial.nc"
WHERE = "fractalcontact run"


def output_folder(out: str | os.PathLike[str]) -> Path:
    """Return the output folder, created if necessary and without temporary files of interrupted runs."""
    with Problems(WHERE) as problems:
        problems.path("out", out, what="the path of a folder")
    out = Path(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        clear_partial(out)
        if not os.access(out, os.W_OK):
            raise PermissionError(13, "no permission to write")
    except OSError as error:
        raise InvalidInput(
            WHERE, [f"out: expected a folder to write in, got {out.name!r}: {error.strerror}"]
        ) from error
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
                raise InvalidInput(WHERE, [f"out: expected a folder of its own, got {got}"]) from None
        yield
    finally:
        os.close(descriptor)
