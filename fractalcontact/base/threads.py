"""How many threads the transforms and the parallel loops may use: one number, decided here.

The environment variable `FRACTALCONTACT_THREADS` sets it; otherwise it is the number of processors that
this process may run on. `limit` changes it for a `with` block.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

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
