"""The running process: its peak memory, a copy that shares its work, and two adjustments of its libraries.

No other module forks, or changes the garbage collector or the table of imported modules.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from fractalcontact.base import threads

# allocations between two garbage collections: with Python's 700 they take 5 % of the run time of a study
GC_THRESHOLD = 10_000
PATIENCE = 60.0  # seconds without a sign of the copy, after which its calls are made here


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


def calls_in_two_processes(function: Callable[[int], None], count: int) -> Iterator[int]:
    """Call ``function(n)`` for the numbers below `count` (at most 255), and yield each as its call ends.

    For calls that hold the interpreter lock and have an effect outside this process, such as a file. A forked
    copy of this process shares them: it needs no imports, no pickled data and no guard in a script. Calls
    that it does not end, for whatever reason, are made here.
    """
    if count < 2 or not _can_fork():
        for number in range(count):
            function(number)
            yield number
        return
    from multiprocessing import get_context

    (waiting, to_do), (done, ended) = os.pipe(), os.pipe()
    os.write(to_do, bytes(range(count)))
    os.close(to_do)
    copy = get_context("fork").Process(target=_call_in_copy, args=(function, waiting, ended), daemon=True)
    left = set(range(count))
    try:
        with suppress(OSError), warnings.catch_warnings():  # a limit of the system
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads: `_can_fork` looks at them
            copy.start()
        os.close(ended)
        for number in _bytes_of(waiting):
            function(number)
            left.discard(number)
            yield number
        for number in _bytes_of(done, PATIENCE):
            left.discard(number)
            yield number
        for number in sorted(left):
            function(number)
            yield number
    finally:
        for _ in _bytes_of(waiting):  # after an error: the copy ends its call, and finds no other
            pass
        if copy.pid is not None:
            copy.join(PATIENCE)
            copy.kill()
            copy.join()
        os.close(waiting)
        os.close(done)


def _can_fork() -> bool:
    """Whether a copy of this process has a processor of its own, and no lock that another thread held.

    Threads of this package that wait for bands, and that of a progress bar, hold none that the copy needs.
    """
    own = threading.main_thread()
    if sys.platform != "linux" or threading.current_thread() is not own or threads.thread_count() < 2:
        return False
    others = (each for each in threading.enumerate() if each is not own and each.name != threads.NAME)
    return all(type(each).__name__ == "TMonitor" for each in others)


def _call_in_copy(function: Callable[[int], None], waiting: int, ended: int) -> None:
    """Make calls in the copy until none waits or one fails; it is made again, and reported, by the parent."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # that of the parent
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with suppress(Exception):
        for number in _bytes_of(waiting):
            function(number)
            os.write(ended, bytes([number]))


def _bytes_of(pipe: int, patience: float | None = None) -> Iterator[int]:
    """Yield the bytes in a pipe, until all its writers have closed it or, with patience, none comes."""
    from select import select

    while patience is None or select([pipe], [], [], patience)[0]:
        content = os.read(pipe, 1)
        if not content:
            return
        yield content[0]
