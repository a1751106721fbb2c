"""The running process: peak memory, a copy that shares its work, and what the command sets for itself alone.

No other module forks, changes the table of imported modules, or sets the garbage collector.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

from fractalcontact.base import resources
from fractalcontact.base.resources import free_memory

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

R = TypeVar("R")

# seconds without a sign of the copy, beyond those of ten calls, after which its calls are made here: for one
# that hangs (the end of one that dies is seen at once), also on a machine that others load
PATIENCE = 60.0
COPY_MEMORY = 1e9  # bytes that are free before this process is copied: the shipped study peaks at 422 MB
TOKEN, MOST_CALLS = 2, 1 << 15  # bytes of a number, and numbers that a pipe of 64 kB holds


def peak_memory() -> int:
    """Return the peak memory of this process in bytes; 0 where the system does not report it."""
    status = resources.numbers_in(Path("/proc/self/status"))
    if status:  # not getrusage: on Linux its peak starts with the memory of the parent process
        return status.get("VmHWM", 0) * 1024
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def block_dask_import() -> None:
    """Keep xarray, if it is not imported yet, from importing dask in this process.

    Only for the command line and its worker processes. Where dask is installed, xarray imports it, dask.array
    and distributed with its first operations and its first file, although no array is lazy. Measured for the
    scene `rigid_sliding`: 1.1 s of processor time and 143 MB with dask, 0.85 s and 115 MB without.
    xarray has no option for it; an entry None makes an import fail, which xarray takes for "not installed".
    """
    if "xarray" not in sys.modules:  # it looks for dask once, and fails later where dask has gone since
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]


def collect_rarely() -> None:
    """Let Python look for cycles of unreachable objects once for 50 000 new ones, not once for 700.

    Only for the command line, whose process ends with its study. The shipped study takes 13.7 s of processor
    time with it and 15.2 s without (medians of eight runs in turn on a busy machine, pairs 1.02 to 1.16),
    and 433 and 437 MB: imports and figures make many objects, and at its end the memory goes back as a whole.
    """
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)


def calls_in_two_processes(
    function: Callable[[int], R], count: int, meanwhile: Callable[[], object] | None = None
) -> Iterator[tuple[int, R]]:
    """Call ``function(n)`` for the numbers below `count`; yield n and result as a call ends.

    For calls that hold the interpreter lock. A forked copy of this process shares them: it needs no imports,
    no pickled arguments and no guard in a script. Its results and warnings come back pickled. Call 0, and
    calls that the copy does not end, for whatever reason, are made here. Before this process waits for the
    last call of the copy it does what is needed later, `meanwhile`.
    """
    if not 2 <= count <= MOST_CALLS or not can_fork():
        for number in range(count):
            yield number, function(number)
        return
    from multiprocessing import get_context

    context = get_context("fork")
    waiting, to_do = os.pipe()
    os.write(to_do, b"".join(number.to_bytes(TOKEN) for number in range(1, count)))
    os.close(to_do)
    receiver, sender = context.Pipe(duplex=False)
    copy = context.Process(target=_call_in_copy, args=(function, waiting, sender), daemon=True)
    left, longest = set(range(count)), 0.0
    try:
        with suppress(OSError), warnings.catch_warnings():  # a limit of the system
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads: `can_fork` looks at them
            copy.start()
        sender.close()  # now the receiver sees the end of the copy
        for number in chain((0,), _numbers_in(waiting)):
            start = time.perf_counter()
            result = function(number)
            longest = max(longest, time.perf_counter() - start)
            left.discard(number)
            yield number, result
            for number, result in _received(receiver, 0.0):
                left.discard(number)
                yield number, result
        if meanwhile is not None and left:
            meanwhile()
        for number, result in _received(receiver, PATIENCE + 10.0 * longest):
            left.discard(number)
            yield number, result
        for number in sorted(left):
            yield number, function(number)
    finally:
        for _ in _numbers_in(waiting):  # after an error: the copy ends its call, and finds no other
            pass
        os.close(waiting)
        receiver.close()
        if copy.pid is not None:
            copy.join(PATIENCE)
            copy.kill()
            copy.join()


def can_fork() -> bool:
    """Whether a copy of this process has a processor and memory, and no lock that another thread held.

    Threads of this package that wait for bands, and that of a progress bar, hold none that the copy needs.
    """
    from multiprocessing import parent_process

    own = threading.main_thread()
    if sys.platform != "linux" or threading.current_thread() is not own or resources.thread_count() < 2:
        return False
    if parent_process() is not None:  # a worker: the others use the processors
        return False
    others = (each for each in threading.enumerate() if each is not own and each.name != resources.NAME)
    is_alone = all(type(each).__name__ == "TMonitor" for each in others)
    return is_alone and free_memory().size > COPY_MEMORY


def end_with_parent() -> None:
    """Wait for the end of the process that started this one, then end this one at once."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _call_in_copy(function: Callable[[int], Any], waiting: int, sender: Connection) -> None:
    """Make calls in the copy until none waits or one fails; it is made again, and reported, by the parent."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # that of the parent
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=end_with_parent, daemon=True).start()
    ended: SimpleQueue[Any] = SimpleQueue()
    # the pipe holds little: without a thread of its own a result would wait until the parent reads it
    thread = threading.Thread(target=_send, args=(ended, sender))
    thread.start()
    with suppress(Exception):
        for number in _numbers_in(waiting):
            with warnings.catch_warnings(record=True) as caught:
                result = function(number)
            messages = [(each.message, each.category, each.filename, each.lineno) for each in caught]
            ended.put((number, result, messages))
    ended.put(None)
    thread.join()


def _send(ended: SimpleQueue[Any], sender: Connection) -> None:
    with suppress(OSError):  # the parent reads no more
        while (message := ended.get()) is not None:
            sender.send(message)


def _received(receiver: Connection, patience: float) -> Iterator[tuple[int, Any]]:
    """Yield numbers and results of the copy until none comes in this time; show its warnings again."""
    with suppress(EOFError, OSError):
        while receiver.poll(patience):
            number, result, messages = receiver.recv()
            for message in messages:
                warnings.warn_explicit(*message)
            yield number, result


def _numbers_in(pipe: int) -> Iterator[int]:
    """Yield the numbers that wait in a pipe; each is taken by one process."""
    while content := os.read(pipe, TOKEN):
        yield int.from_bytes(content)
