"""The running process: its peak memory, and two measured adjustments of its libraries.

No other module changes the garbage collector or the table of imported modules.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path

# allocations between two garbage collections: with Python's 700 they take 5 % of the run time of a study
GC_THRESHOLD = 10_000


def peak_memory() -> int:
    """Return the peak memory of this process in bytes; 0 where the system does not report it."""
    status = Path("/proc/self/status")
    if status.is_file():
        # not getrusage: on Linux its peak starts with the memory of the parent process
        lines = (line.partition(":") for line in status.read_text(encoding="utf-8").splitlines())
        values = {name: value for name, _, value in lines}
        return int(values.get("VmHWM", "0 kB").split()[0]) * 1024
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def block_dask_import() -> None:
    """Keep xarray, if it is not imported yet, from importing dask in this process.

    Only for the command line and its worker processes. Where dask is installed, xarray imports it, dask.array
    and distributed with its first operations and its first file, although no array is lazy. Measured for a
    surface of 64 x 64 points, generated and saved: 2.2 s and 145 MB with dask, 0.9 s and 104 MB without.
    xarray has no option for it; an entry None makes an import fail, which xarray takes for "not installed".
    """
    if "xarray" not in sys.modules:  # it looks for dask once, and fails later where dask has gone since
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]


def collect_garbage_less_often() -> None:
    """Raise the threshold of the garbage collector; only for the command line, which owns its process."""
    gc.set_threshold(GC_THRESHOLD)
