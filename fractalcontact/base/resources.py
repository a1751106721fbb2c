"""Memory and threads: how many bytes this process may take, what a call needs, and how many threads work.

The least of these counts: the limits of the process (`ulimit -v`, `ulimit -d`), those of its control groups
(version 1 or 2: a container, a job of a cluster) and the free memory of the machine. Pages of files that the
system keeps in memory count as free, for they are given up at need. A public function declares its peak
(`public_result(memory=...)`) in bytes for each cell of its largest array, or as a function of the grid and
the arguments. The numbers were measured as the growth of the resident memory of a process during a second
call; the peaks of whole scenes are tested (tests/resources).

The environment variable `FRACTALCONTACT_THREADS` sets the number of threads of the transforms and parallel
loops. Without it, it is the number of processors available to this process, limited by `OMP_NUM_THREADS` and
`NUMBA_NUM_THREADS` where they are set. `limit` changes it inside a `with` block. No result depends on it.
"""

from __future__ import annotations

import math
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

from fractalcontact.base.errors import TooLittleMemory, UnreadableFile

SMALL_FILE = 1 << 28  # bytes that any file may unpack to: about what the libraries take
PLANES = ("surface", "crack", "mask", "gap", "heights", "lower", "upper")  # arguments that have a grid
# arguments of several values, each of which gives a map
PATHS = ("closure", "normal_force", "nominal_pressure", "tangential_force", "shear", "direction")
SHARE = 32768  # elements worth a thread of their own: a transform takes 33 us, to hand it over 17 us
LIMITS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
NAME = "fractalcontact"  # of the threads that wait for bands
# matplotlib is not safe in threads: its parser of formulas is shared, and so are its settings
DRAWING_LOCK = threading.RLock()

_limit: ContextVar[int | None] = ContextVar("fractalcontact_threads", default=None)


class Free(NamedTuple):
    """Bytes that may still be taken, and what sets that limit."""

    size: float
    limit: str


@dataclass(frozen=True)
class Plane:
    """The grid on which a call works: points along (y, x), whether both wrap around, number of planes."""

    shape: tuple[int, ...]
    periodic: bool = False
    planes: int = 1

    @property
    def cells(self) -> float:
        """Number of cells of all planes."""
        return float(math.prod(self.shape)) * self.planes


# bytes for each cell, or a function of the grid and the arguments that returns bytes
Estimate = float | Callable[[Plane, Mapping[str, Any]], float]


def free_memory(root: Path = Path("/")) -> Free:
    """Return how much memory this process may still take; `root` is that of the file system."""
    limits = [_free_of_machine(root), *_free_of_process(root), *_free_of_groups(root)]
    least = min(limits, key=lambda free: free.size)
    return least._replace(size=max(0.0, least.size))


def _free_of_machine(root: Path) -> Free:
    """Return the free memory of the machine, all of it where the system does not say how much is free."""
    lines = numbers_in(root / "proc/meminfo")
    if "MemAvailable" in lines:
        return Free(1024.0 * (lines["MemAvailable"] + lines.get("SwapFree", 0)), "free memory of the machine")
    try:
        size = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        size = math.inf
    return Free(size, "memory of the machine")


def _free_of_process(root: Path) -> Iterator[Free]:
    """Yield what the limits of the process leave beside the libraries; below 0, these do not fit (Linux)."""
    status = numbers_in(root / "proc/self/status")
    if not status:
        return
    import resource

    for limit, used, option in (("RLIMIT_AS", "VmSize", "-v"), ("RLIMIT_DATA", "VmData", "-d")):
        most = resource.getrlimit(getattr(resource, limit))[0]
        if most != resource.RLIM_INFINITY and used in status:
            left = most - 1024.0 * status[used] - _libraries(option)
            yield Free(left, f"limit of the process, ulimit {option} {most >> 10}")


def _libraries(option: str) -> float:
    """Return the bytes that NumPy, SciPy, Numba and matplotlib take as they are loaded; 0 where they are.

    As `ulimit -v` (address space) and `ulimit -d` (data) count them, measured. OpenBLAS, of which NumPy and
    SciPy have a copy each, takes more for every further thread; where that does not fit, it ends the process
    or tries for ever.
    """
    if "numba" in sys.modules:
        return 0.0
    return (6.1e8 if option == "-v" else 2.3e8) + 8.4e7 * (openblas_threads() - 1)


def require_libraries() -> None:
    """Raise `TooLittleMemory` unless the libraries can be loaded within the limits of the process."""
    for free in _free_of_process(Path("/")):
        if free.size < 0.0:
            fewer = "" if openblas_threads() == 1 else " (less with OPENBLAS_NUM_THREADS=1)"
            expected = f"about {in_words(-free.size)} more to load NumPy, SciPy and Numba{fewer}"
            raise TooLittleMemory.of("fractalcontact", "memory", expected, f"the {free.limit}")


def _free_of_groups(root: Path) -> Iterator[Free]:
    """Yield what the control groups of the process and those above them leave."""
    mount = root / "sys/fs/cgroup"
    for line in _lines(root / "proc/self/cgroup"):
        folders: tuple[Path, ...]
        controllers, _, path = line.partition(":")[2].partition(":")
        if controllers == "":
            folders, names = (mount, mount / "unified"), ("memory.max", "memory.current", "")
        elif "memory" in controllers.split(","):
            folders, names = (mount / "memory",), ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_")
        else:
            continue
        for folder in folders:
            group = folder / path.lstrip("/")
            for place in (group, *group.parents):
                if place.is_relative_to(folder):
                    yield from _free_of_group(place, *names)


def _free_of_group(folder: Path, limit: str, used: str, prefix: str) -> Iterator[Free]:
    """Yield what a control group leaves, where it sets a limit."""
    words = [" ".join(_lines(folder / name)).strip() for name in (limit, used)]
    if all(word.isdecimal() for word in words):
        most, taken = (float(word) for word in words)
        pages = numbers_in(folder / "memory.stat")
        files = sum(pages.get(f"{prefix}{kind}_file", 0) for kind in ("active", "inactive"))
        yield Free(max(0.0, most - max(0.0, taken - files)), "limit of the control group (container or job)")


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []


def numbers_in(path: Path) -> dict[str, int]:
    """Return the whole numbers of a file of lines such as `VmSize:  1024 kB` by their names."""
    pairs = (line.replace(":", " ").split()[:2] for line in _lines(path))
    return {pair[0]: int(pair[1]) for pair in pairs if len(pair) == 2 and pair[1].isdecimal()}


def in_words(size: float) -> str:
    """Return a number of bytes with three digits."""
    return f"{size / 2**20:.3g} MiB" if size < 2**30 else f"{size / 2**30:.3g} GiB"


def require_memory(where: str, needed: float, what: str) -> None:
    """Raise `TooLittleMemory` unless `needed` bytes may be taken."""
    if needed <= 1 << 25:  # a look at the limits takes .5 ms
        return
    free = free_memory()
    if not needed <= free.size:
        expected = f"at most {in_words(free.size)} ({free.limit})"
        raise TooLittleMemory.of(where, "memory", expected, f"{what}: about {in_words(needed)}")


def has_blocks(value: Any) -> bool:
    """Return whether a value is a labelled array of dask, or of another kind in blocks.

    `chunks` of xarray tells that as well; for an array of NumPy it takes ten microseconds.
    """
    import numpy as np  # which the command line does without

    data = getattr(getattr(value, "variable", None), "_data", None)
    return not isinstance(data, np.ndarray) and bool(getattr(value, "chunks", None))


def loaded_bytes(arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the dask arrays among the arguments, once they are loaded: masks are bytes."""
    arrays = [arguments[name] for name in PLANES if has_blocks(arguments.get(name))]
    return float(sum((8 if value.dtype.kind == "f" else 1) * math.prod(value.shape) for value in arrays))


def plane_in(arguments: Mapping[str, Any]) -> Plane | None:
    """Return the grid of the array that a call is given, or is to make; None without one."""
    if "shape" in arguments:
        shape = arguments["shape"]
        sizes = (1, *(shape if hasattr(shape, "__len__") else (shape,)))[-2:]
        return Plane((int(sizes[0]), int(sizes[1])), planes=int(arguments.get("members") or 1))
    return next((plane_of(arguments[name]) for name in PLANES if name in arguments), None)


def bytes_on(estimate: Estimate, plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of an estimate on a grid, and of the maps that the call keeps.

    Planes are worked on one by one, and 8 bytes a cell kept.
    """
    maps = 2.0 * kept_bytes(arguments) * plane.cells  # those of the steps, and all of them stacked
    if callable(estimate):
        return float(estimate(plane, arguments)) + maps
    return estimate * math.prod(plane.shape) + 8.0 * (plane.planes - 1) * math.prod(plane.shape) + maps


def kept_bytes(arguments: Mapping[str, Any]) -> float:
    """Return the bytes of a cell of the maps in `keep`, one for each load, shear and direction."""
    import numpy as np  # which the command line does without

    names = arguments.get("keep")
    if names is None:
        return 0.0
    maps = math.prod(int(np.size(arguments[name])) for name in PATHS if name in arguments)
    return maps * sum(map_bytes(str(name)) for name in np.atleast_1d(names))


def map_bytes(name: str) -> float:
    """Return the bytes of a cell of a map with a name of the schema."""
    return {"state": 1.0, "slip_state": 1.0, "label": 4.0}.get(name, 8.0)


def plane_of(value: Any) -> Plane | None:
    """Return the grid of an array, of a labelled one or of a crack; None for anything else."""
    layout = getattr(value, "layout", None)
    if layout is not None:
        return Plane(tuple(layout.cells), all(layout.periodic))
    shape = getattr(value, "shape", None)
    if not isinstance(shape, tuple) or not shape:
        return None
    coords = getattr(value, "coords", None)
    periodic = coords is not None and all(
        dim in coords and "period" in coords.variables[dim].attrs for dim in ("y", "x")
    )
    sizes = (1, *shape)[-2:]
    return Plane((int(sizes[0]), int(sizes[1])), periodic, math.prod(shape[:-2]))


def unpacked_limit(size: int, ratio: int) -> int:
    """Return the number of bytes that a file of this size may unpack to."""
    return max(SMALL_FILE, ratio * size)


def require_unpacked(where: str, name: str, unpacked: int, limit: int) -> None:
    """Raise `UnreadableFile` if the bytes that a file unpacks to exceed its limit, or what is free."""
    if unpacked > limit:
        expected = f"at most {limit / 2**20:.0f} MiB when unpacked, for its size"
        raise UnreadableFile(where, [f"path: {name!r}: expected {expected}, got {unpacked / 2**20:.0f} MiB"])
    require_memory(where, unpacked, f"{name!r} when unpacked")


def thread_count() -> int:
    """Return the number of threads to use here."""
    chosen = _limit.get() or requested_count()
    if chosen is not None:
        return chosen
    limits = [_environment_count(name) for name in LIMITS]
    return min([_available_processors(), *(count for count in limits if count is not None)])


def requested_count() -> int | None:
    """Return the number in `FRACTALCONTACT_THREADS`; None if it is not set."""
    return _environment_count("FRACTALCONTACT_THREADS")


def openblas_threads(most: int = 64) -> int:
    """Return the number of threads that OpenBLAS has once NumPy or SciPy loads it, whose wheels have 64."""
    counts = (_environment_count(name) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"))
    chosen = next((count for count in counts if count is not None), most)
    return min(chosen, _available_processors(), most)


def _environment_count(name: str) -> int | None:
    """Return the positive integer in an environment variable; None if there is none.

    OpenMP allows a list with one entry for each level of nesting; the first one counts.
    """
    word = os.environ.get(name, "").partition(",")[0].strip()
    return int(word) if word.isdecimal() and int(word) > 0 else None


def _available_processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def most_workers() -> int:
    """Return the largest number of processes that a study may be shared between."""
    return max(8, 4 * (os.cpu_count() or 1))  # more would only wait: a slip of the keyboard


@contextmanager
def limit(threads: int) -> Iterator[None]:
    """Use this number of threads inside the block."""
    token = _limit.set(max(1, int(threads)))
    try:
        yield
    finally:
        _limit.reset(token)


def in_bands(function: Callable[..., None], count: int, work: int, *arguments: Any) -> None:
    """Call ``function(start, stop, *arguments)`` over bands of ``range(count)``, in parallel.

    The function must release the global interpreter lock, and its result must not depend on the bands: keep
    sums for each item and add them up afterwards. Unlike a `prange` loop of Numba this may be called from
    several threads at once and in a forked process, and it compiles fast. Where the system starts no
    threads, the calling thread does all the work.

    Parameters
    ----------
    function : callable
    count : int
        Number of items.
    work : int
        Number of elements processed; below `SHARE` elements for each thread, fewer threads are used.
    *arguments
        Further arguments of the function.
    """
    threads = min(count, work // SHARE)
    if threads > 1:  # only then: reading the environment takes as long as a small loop
        threads = min(threads, thread_count())
    queue = _worker_queue(threads - 1) if threads > 1 else None
    if queue is None:
        function(0, count, *arguments)
        return
    edges = [count * k // threads for k in range(threads + 1)]
    bands = [_Band(function, (edges[k], edges[k + 1], *arguments)) for k in range(1, threads)]
    for band in bands:
        queue.put(band)
    try:
        function(edges[0], edges[1], *arguments)
    finally:  # wait even after an error: the other bands still write into the arrays
        for band in bands:
            band.done.acquire()
    for band in bands:
        if band.error is not None:
            raise band.error


class _Band:
    """A call that one worker thread makes."""

    def __init__(self, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self.function, self.arguments = function, arguments
        self.error: BaseException | None = None
        self.done = threading.Lock()
        self.done.acquire()

    def run(self) -> None:
        """Call the function; an exception is stored for the calling thread."""
        try:
            self.function(*self.arguments)
        except BaseException as error:
            self.error = error
        self.done.release()


_queues: dict[int, SimpleQueue[_Band]] = {}  # by number of threads
_lock = threading.Lock()


def _worker_queue(count: int) -> SimpleQueue[_Band] | None:
    """Return the queue of `count` waiting threads, or of as many as can be started; None if none can.

    An executor of `concurrent.futures` takes longer: 119 ms for a press of 256 x 256 points, in place of 98.
    """
    with _lock:
        if count not in _queues:
            queue: SimpleQueue[_Band] = SimpleQueue()
            try:
                for _ in range(count):
                    threading.Thread(target=_work, args=(queue,), daemon=True, name=NAME).start()
                    _queues[count] = queue
            except RuntimeError:  # a limit of the system, or the interpreter is about to end
                return _queues.get(count)
        return _queues[count]


def _work(queue: SimpleQueue[_Band]) -> None:
    while True:
        queue.get().run()


def _forget_threads() -> None:
    """Start anew in a forked process: threads do not survive a fork, nor does the owner of the lock."""
    global _lock
    _lock = threading.Lock()
    _queues.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)
    os.register_at_fork(
        before=DRAWING_LOCK.acquire, after_in_parent=DRAWING_LOCK.release, after_in_child=DRAWING_LOCK.release
    )
