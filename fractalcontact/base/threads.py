"""Number of threads of the transforms and parallel loops, and the thread pool of `in_bands`.

The environment variable `FRACTALCONTACT_THREADS` sets the number. Without it, it is the number of
processors available to this process, limited by `OMP_NUM_THREADS` and `NUMBA_NUM_THREADS` where they are
set. `limit` changes it inside a `with` block. No result depends on it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from queue import SimpleQueue
from typing import Any

SHARE = 32768  # elements worth a thread of their own: a transform takes 33 us, to hand it over 17 us
LIMITS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
NAME = "fractalcontact"  # of the threads that wait for bands
# matplotlib is not safe in threads: its parser of formulas is shared, and so are its settings
DRAWING_LOCK = threading.RLock()

_limit: ContextVar[int | None] = ContextVar("fractalcontact_threads", default=None)


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
    return max(8, 4 * (os.cpu_count() or 1))


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
    if threads <= 1:
        function(0, count, *arguments)
        return
    edges = [count * k // threads for k in range(threads + 1)]
    bands = [_Band(function, (edges[k], edges[k + 1], *arguments)) for k in range(1, threads)]
    queue = _worker_queue(threads - 1)
    if queue is None:
        function(0, count, *arguments)
        return
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
