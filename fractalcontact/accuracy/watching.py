"""Calls in a process of their own, which is ended when one of them takes too long."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from fractalcontact.accuracy.catalogue import cases
from fractalcontact.accuracy.examination import LONGEST, Finding, examine
from fractalcontact.base.progress import track
from fractalcontact.base.signals import Stop

K = TypeVar("K")
V = TypeVar("V")
LONGEST_LARGE = 15 * LONGEST


def examine_apart(
    names: list[str], *, progress: bool = False, stop: Stop | None = None
) -> dict[str, list[Finding]]:
    """Examine cases of the catalogue; one that hangs, or ends the process, is a finding and not the end.

    Once `stop` is true, the cases that were done by then are returned.
    """
    limits = {name: LONGEST_LARGE if cases[name].large else 2 * LONGEST for name in names}
    found: dict[str, list[Finding]] = {}
    for name, got in track(
        watched(examine_named, limits), progress, "extremes", unit="case", total=len(names)
    ):
        if not isinstance(got, Lost):
            found[name] = got
        elif not stop:  # a signal from the terminal ends the other process too
            found[name] = [Finding("the whole case", None, str(got), False, limits[name])]
        if stop:
            break
    return found


def examine_named(name: str) -> list[Finding]:
    """Examine one case of the catalogue."""
    return examine(cases[name])


class Lost(str):
    """Why a call gave nothing."""

    __slots__ = ()


def watched(work: Callable[[K], V], limits: Mapping[K, float]) -> Iterator[tuple[K, V | Lost]]:
    """Yield each key with ``work(key)``, done in another process; `Lost` past its limit in seconds.

    The process serves one key after another; after one that was lost a fresh one goes on.
    """
    context = multiprocessing.get_context("spawn")
    process: Any = None
    try:
        for key, limit in limits.items():
            if process is None:
                here, there = context.Pipe()
                process = context.Process(target=_serve, args=(there, work), daemon=True)
                process.start()
                there.close()
                here.recv()  # it is up: its start does not count
            here.send(key)
            result: V | Lost
            try:
                result = here.recv() if here.poll(limit) else Lost(f"hung: ended after {limit:g} s")
            except EOFError:
                process.join()
                result = Lost(f"its process ended with code {process.exitcode}")
            if isinstance(result, Lost):
                process.kill()
                process.join()
                process = None
            yield key, result
    finally:
        if process is not None:
            process.kill()


def _serve(pipe: Connection, work: Callable[[K], V]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe.send(None)
    while True:
        pipe.send(work(pipe.recv()))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
