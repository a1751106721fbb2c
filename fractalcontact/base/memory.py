"""What this process holds: its memory, and a library that it can do without."""

from __future__ import annotations

import sys
from pathlib import Path


def most_memory() -> int:
    """Return the most memory (bytes) that this process has held, 0 where the system does not tell."""
    status = _lines(Path("/proc/self/status"))
    if status:
        # the kernel's usage of resources would begin with what the parent held when it started this process
        return int(status.get("VmHWM", "0 kB").split()[0]) * 1024
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _lines(path: Path) -> dict[str, str]:
    if not path.is_file():
        return {}
    lines = (line.partition(":") for line in path.read_text(encoding="utf-8").splitlines())
    return {key: value for key, _, value in lines}


def leave_dask() -> None:
    """Keep dask out of a process that shares no work: wherever it is installed xarray would load it."""
    sys.modules.setdefault("dask", None)  # type: ignore[arg-type]
