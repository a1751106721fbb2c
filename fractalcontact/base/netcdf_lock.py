"""The lock around every access to the NetCDF library, which is not safe in threads."""

from __future__ import annotations

import os
import sys
import threading
from types import TracebackType
from typing import Any


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
