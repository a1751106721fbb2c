"""Tasks carried out one after the other here, or side by side on the workers of a dask client.

A task keeps its own finished parts. A worker writes them into the folder of the run where that is within its
reach; from elsewhere they come back with the result and are written here.
"""

from __future__ import annotations

import ctypes
import importlib.util
import logging
import queue
import signal
import uuid
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from fractalcontact.base import signals, threads
from fractalcontact.base.errors import FractalContactError, MissingExtra
from fractalcontact.scenes.keeping import Carried, Store

R = TypeVar("R")
Task = Callable[[Store, signals.Stop], R | None]

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of malloc.h
PAUSE = 0.2  # seconds between two looks at whether a stop was asked for
_stopped: set[str] = set()  # on a worker: the runs that are to stop


def carried_out(
    tasks: Mapping[int, Task[R]], store: Store, stop: signals.Stop, client: Any = None
) -> Iterator[tuple[int, R]]:
    """Yield number and result of every task as it is done; a task that a stop has cut short is left out."""
    if client is not None:
        yield from _side_by_side(tasks, store, stop, client)
        return
    for number, task in tasks.items():
        result = task(store, stop)
        if result is not None:
            yield number, result


def _side_by_side(
    tasks: Mapping[int, Task[R]], store: Store, stop: signals.Stop, client: Any
) -> Iterator[tuple[int, R]]:
    """Hand all tasks to the workers; once a stop is asked for they end what they are at and begin nothing."""
    run = uuid.uuid4().hex
    near = store.folder is None or _within_reach(store.folder, client)
    sent = [
        _Sent(task, store if near else Carried(store.kept(getattr(task, "digests", ()))), run)
        for task in tasks.values()
    ]
    futures = dict(zip(client.map(_Sent.__call__, sent, pure=False), tasks, strict=True))
    done: queue.SimpleQueue[Any] = queue.SimpleQueue()
    for future in futures:
        future.add_done_callback(done.put)
    try:
        while futures:
            if stop:  # said again and again: a worker that was lost is replaced by one that does not know
                client.run(_note_stop, run, on_error="ignore")
            try:
                future = done.get(timeout=PAUSE)
            except queue.Empty:
                continue
            result, kept = _result(future)
            number = futures.pop(future)
            for key, part in kept.items():
                store.put(key, part)
            if result is not None:
                yield number, result
    finally:
        for future in futures:
            future.cancel()


class _Sent:
    """A task as a worker gets it."""

    def __init__(self, task: Task[Any], store: Store, run: str) -> None:
        self.task, self.store, self.run = task, store, run

    def __call__(self) -> tuple[Any, Mapping[str, Any]]:
        """Return the result, and what was kept if it is not in the folder of the run.

        The worker may be at as many tasks as it has threads: each uses one, unless `FRACTALCONTACT_THREADS`
        says otherwise.
        """
        _keep_freed_memory()
        with threads.limit(threads.requested_count() or 1):
            result = self.task(self.store, _StopAfar(self.run))
        return result, getattr(self.store, "added", {})


@cache
def _keep_freed_memory() -> None:
    """Let the C library keep what arrays have freed for the next ones, as it does by itself.

    Dask has it give back every page at once, which makes a study of many small arrays half as slow again.
    """
    with suppress(OSError, AttributeError):  # a system with another C library
        library = ctypes.CDLL(None)
        for option, size in (_MMAP_THRESHOLD, 1 << 25), (_TRIM_THRESHOLD, 1 << 26):
            library.mallopt(option, size)


class _StopAfar(signals.Stop):
    """Whether a stop was asked for where the run was started."""

    def __init__(self, run: str) -> None:
        super().__init__()
        self.run = run

    def __bool__(self) -> bool:
        return self.run in _stopped


@contextmanager
def hired(count: int) -> Iterator[Any]:
    """Give a client of so many workers on this machine, of one thread each; of none, no client.

    Raises
    ------
    MissingExtra
        The library that runs them is not installed.
    """
    if count == 0:
        yield None
        return
    if importlib.util.find_spec("distributed") is None:
        raise MissingExtra("a study on several workers", "dask.distributed", "dask")
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(_ignore_interrupts)
        yield client


def _ignore_interrupts() -> None:
    """Leave it to the run to end in good order: what comes from the keyboard reaches its workers too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _result(future: Any) -> Any:
    """Return what a task gave; a worker that was lost is told in our words."""
    try:
        return future.result()
    except CancelledError as error:
        raise FractalContactError(f"{_LOST}: the scheduler has let go of the work") from error
    except Exception as error:
        if type(error).__name__ == "KilledWorker":  # of a library that need not be there
            raise FractalContactError(f"{_LOST}: workers died at it again and again (memory?)") from error
        raise


_LOST = "a study on workers did not end; with a folder, what is finished is kept, and the same run goes on"


def _note_stop(run: str) -> None:
    _stopped.add(run)


def _within_reach(folder: Path, client: Any) -> bool:
    """Whether all workers see a folder; of one that is lost while it is asked, nobody knows."""
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / f".{uuid.uuid4().hex}"
    mark.touch()
    try:
        seen = client.run(Path.is_file, mark, on_error="return")
    finally:
        mark.unlink()
    return bool(seen) and all(answer is True for answer in seen.values())
