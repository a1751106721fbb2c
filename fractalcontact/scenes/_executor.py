"""Independent tasks, in this process or on the workers of a `concurrent.futures.Executor`.

Local processes, threads and a dask.distributed cluster (`client.get_executor()`) are used alike. A task keeps
its own finished parts: a worker that has access to the folder of the run writes them there; from any other
they return with the result of the task and are written here.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import uuid
from collections.abc import Callable, Collection, Generator, Iterator, Mapping
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from fractalcontact.base import resources, signals
from fractalcontact.base.errors import FractalContactError, InvalidInput
from fractalcontact.base.process import calls_in_two_processes, can_fork, end_with_parent
from fractalcontact.scenes._results_folder import MemoryStore, PartStore

R = TypeVar("R")
K = TypeVar("K")
Task = Callable[[PartStore, signals.Stop], R | None]

# points up to which a second process may press at the same time: `press` takes 206 MB for 1024 x 1024, and a
# copy is made where 1 GB is free; twice the edge is 822 MB
SMALL_SURFACE = 1 << 20
# seconds of work, from which on a second process takes part of it: to make one takes .01 s, and .09 s to send
# a result of 16 MB
WORTH_A_COPY = 0.5
PER_POINT = 2.5e-7  # seconds of a task: `describe` takes .16 for 768 x 768 points, an estimate or a closure 1
PAUSE = 0.2  # seconds between two checks whether a stop was requested: who stops a study does not notice it
RUNNING, STOPPING = "running", "stopping"
LOST = "the study on workers did not end; with a folder, finished parts are kept, and the same run resumes"


@dataclass(frozen=True)
class Workers:
    """An executor and the number of tasks that it runs at a time.

    Attributes
    ----------
    executor : Executor
    count : int
    local : bool
        The workers see the folders of this machine.
    """

    executor: futures.Executor
    count: int
    local: bool


def workers_of(client: Any) -> Workers | None:
    """Return the workers of a `distributed.Client` or of a `concurrent.futures.Executor`; None for None.

    Raises
    ------
    InvalidInput
        The client is something else.
    """
    if client is None:
        return None
    if hasattr(client, "get_executor") and hasattr(client, "nthreads"):
        return Workers(client.get_executor(pure=False), sum(client.nthreads().values()), local=False)
    if isinstance(client, futures.Executor):
        count = getattr(client, "_max_workers", None) or os.cpu_count() or 1
        return Workers(
            client, count, local=isinstance(client, (futures.ProcessPoolExecutor, futures.ThreadPoolExecutor))
        )
    expected = "a distributed.Client, a concurrent.futures.Executor or None"
    raise InvalidInput.of("fractalcontact.scenes.run", "client", expected, type(client).__name__)


@contextmanager
def worker_processes(count: int) -> Iterator[futures.Executor | None]:
    """Provide an executor of so many processes on this machine; none for 0.

    The processes start from a server that has imported the libraries, and not from a copy of this process,
    whose threads they would lack.
    """
    if count == 0:
        yield None
        return
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        context.set_forkserver_preload(["fractalcontact.scenes._worker"])
    executor = futures.ProcessPoolExecutor(count, mp_context=context, initializer=_start_worker)

    def start() -> None:
        for _ in range(count):
            executor.submit(os.getpid)  # starts a process; the first waits for the imports of the server

    # in a thread, so that the caller validates the scene meanwhile
    starting = threading.Thread(target=start, daemon=True)
    starting.start()
    try:
        yield executor
    finally:
        starting.join()
        executor.shutdown(cancel_futures=True)


def _start_worker() -> None:
    """Leave SIGINT to the process that runs the study, and end when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()


def run_tasks(
    tasks: Mapping[K, Task[R]],
    store: PartStore,
    stop: signals.Stop,
    workers: Workers | None = None,
    *,
    points: int,
    wide: Collection[K] = (),
    meanwhile: Callable[[], object] | None = None,
) -> Generator[tuple[K, R], None, None]:
    """Yield key and result of every task as it finishes; a task that a stop cut short is left out.

    Without workers a copy of this process shares the tasks of a surface of few `points`, where that is worth
    it by their number and the points, or by the time of the last task. Each process takes half of the
    threads, but all of them for a task that is `wide`: whose threads do not wait for each other. This process
    does what is needed later, `meanwhile`, before it waits for the copy.
    """
    if workers is not None:
        yield from _run_on_workers(tasks, store, stop, workers)
        return
    left, expected = dict(tasks), PER_POINT * points * len(tasks)
    for key, task in tasks.items():
        if len(left) > 1 and expected > WORTH_A_COPY and points <= SMALL_SURFACE and can_fork():
            break
        start = time.perf_counter()
        result = task(store, stop)
        del left[key]
        expected = (time.perf_counter() - start) * len(left)
        if result is not None:
            yield key, result
    keys, threads = list(left), resources.thread_count()

    def run_one(place: int) -> R | None:
        with resources.limit(threads if keys[place] in wide else threads // 2):
            return left[keys[place]](store, stop)

    for place, result in calls_in_two_processes(run_one, len(keys), meanwhile):
        if result is not None:
            yield keys[place], result


def _run_on_workers(
    tasks: Mapping[K, Task[R]], store: PartStore, stop: signals.Stop, workers: Workers
) -> Iterator[tuple[K, R]]:
    """Give every worker one task at a time; after a stop, running ones finish and no other starts."""
    waiting = iter(tasks.items())
    running: dict[futures.Future[Any], K] = {}
    with _mark(store) as mark:
        try:
            while True:
                while not stop and len(running) < workers.count and (entry := next(waiting, None)):
                    key, task = entry
                    kept = {} if workers.local else store.kept(getattr(task, "digests", ()))
                    running[workers.executor.submit(_run_here, task, store, kept, mark)] = key
                if not running:
                    return
                if stop and mark is not None:
                    mark.write_text(STOPPING, encoding="utf-8")
                done, _ = futures.wait(running, timeout=PAUSE, return_when=futures.FIRST_COMPLETED)
                for future in [future for future in running if future in done]:
                    key = running.pop(future)
                    result, added = _result(future)
                    for name, part in added.items():
                        store.put(name, part)
                    if result is not None:
                        yield key, result
        finally:
            for future in running:
                future.cancel()


@contextmanager
def _mark(store: PartStore) -> Iterator[Path | None]:
    """Provide a file by which workers with access to the folder detect that the run was stopped."""
    if store.folder is None:
        yield None
        return
    store.folder.mkdir(parents=True, exist_ok=True)
    mark = store.folder / f"run-{uuid.uuid4().hex}"
    mark.write_text(RUNNING, encoding="utf-8")
    try:
        yield mark
    finally:
        mark.unlink(missing_ok=True)


def _run_here(
    task: Task[R], store: PartStore, kept: Mapping[str, Any], mark: Path | None
) -> tuple[R | None, Mapping[str, Any]]:
    """Run a task on a worker; return its result, and its new parts if the worker does not see the folder.

    The worker may run as many tasks as it has threads: each uses one, unless the environment variable
    `FRACTALCONTACT_THREADS` sets more.
    """
    store = store if mark is None or mark.is_file() else MemoryStore(kept)
    with resources.limit(resources.requested_count() or 1):
        result = task(store, _MarkedStop(mark))
    return result, store.added if isinstance(store, MemoryStore) else {}


class _MarkedStop(signals.Stop):
    """Whether the process that runs the study has requested a stop."""

    def __init__(self, mark: Path | None) -> None:
        super().__init__()
        self.mark = mark

    def __bool__(self) -> bool:
        if self.mark is None or not self.mark.is_file():
            return False
        return self.mark.read_text(encoding="utf-8") == STOPPING


def _result(future: futures.Future[Any]) -> Any:
    """Return the result of a task; the loss of a worker becomes an error of this package."""
    try:
        return future.result()
    except futures.CancelledError as error:
        raise FractalContactError(f"{LOST}: the scheduler has cancelled the task") from error
    except futures.BrokenExecutor as error:
        raise FractalContactError(f"{LOST}: a worker process died (memory?)") from error
    except Exception as error:
        if type(error).__name__ == "KilledWorker":  # of dask.distributed, which may not be installed
            raise FractalContactError(f"{LOST}: workers died at it repeatedly (memory?)") from error
        raise
