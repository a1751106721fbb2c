"""How many threads the transforms and the parallel loops may use: one number, decided here; and their pool.

The environment variable `FRACTALCONTACT_THREADS` sets it; otherwise it is the number of processors that
this process may run on. `limit` changes it for a `with` block.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from queue import SimpleQueue
from typing import Any

_limit: ContextVar[int | None] = ContextVar("fractalcontact_threads", default=None)


def thread_count() -> int:
    """Return the number of threads in force here."""
    chosen = _limit.get() or asked()
    if chosen is not None:
        return chosen
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def asked() -> int | None:
    """Return the number that the environment asks for, None if it asks for none."""
    word = os.environ.get("FRACTALCONTACT_THREADS", "")
    return int(word) if word.isdigit() and int(word) > 0 else None


@contextmanager
def limit(threads: int) -> Iterator[None]:
    """Use at most this many threads inside the block."""
    token = _limit.set(max(1, int(threads)))
    try:
        yield
    finally:
        _limit.reset(token)


def in_bands(function: Callable[..., None], count: int, work: int, *arguments: Any) -> None:
    """Call what holds no Python lock as ``function(start, stop, *arguments)`` over bands of ``range(count)``.

    The bands run on the threads of `base.threads` when there is enough `work` (elements) to share; which
    band does what must not change a bit of the result, so that sums are kept per item and added up later.
    Unlike a `prange` loop this may be called from several threads at once, and it compiles fast.
    """
    threads = min(thread_count(), count, max(1, work // SHARE))
    if threads <= 1:
        function(0, count, *arguments)
        return
    edges = [count * k // threads for k in range(threads + 1)]
    shares = [_Share(function, (edges[k], edges[k + 1], *arguments)) for k in range(1, threads)]
    helpers = _helpers(threads - 1)
    for share in shares:
        helpers.put(share)
    try:
        function(edges[0], edges[1], *arguments)
    finally:  # nothing is written any more once this returns
        for share in shares:
            share.done.acquire()
    for share in shares:
        if share.error is not None:
            raise share.error


SHARE = 32768  # elements that are worth a thread


class _Share:
    """What one helper is to do."""

    def __init__(self, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self.function, self.arguments = function, arguments
        self.error: BaseException | None = None
        self.done = threading.Lock()
        self.done.acquire()

    def carry_out(self) -> None:
        """Call the function; what it raises is kept for the caller."""
        try:
            self.function(*self.arguments)
        except BaseException as error:
            self.error = error
        self.done.release()


_queues: dict[tuple[int, int], SimpleQueue[_Share]] = {}
_lock = threading.Lock()


def _helpers(count: int) -> SimpleQueue[_Share]:
    """Return the queue of so many waiting threads: a hand-over takes a third of what an executor's does."""
    key = (os.getpid(), count)  # threads do not survive a fork
    with _lock:
        if key not in _queues:
            _queues[key] = SimpleQueue()
            for _ in range(count):
                threading.Thread(target=_help, args=(_queues[key],), daemon=True).start()
        return _queues[key]


def _help(queue: SimpleQueue[_Share]) -> None:
    while True:
        queue.get().carry_out()
