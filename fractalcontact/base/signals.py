"""Signals of long work: a bar of its progress, and SIGINT and SIGTERM.

The first signal finishes the current task, a second one stops at once.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

T = TypeVar("T")


def track(
    items: Iterable[T], enabled: bool, description: str, *, unit: str = "step", total: int | None = None
) -> Iterable[T]:
    """Iterate over `items`; show a bar if `enabled` and the loop takes longer than a second."""
    if not enabled:
        return items
    from tqdm import tqdm

    return tqdm(items, desc=description, unit=unit, total=total, dynamic_ncols=True, delay=1.0, leave=False)


SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stop:
    """State of a stop request; true from the first signal on.

    Attributes
    ----------
    number : int
        The signal; 0 before any.
    """

    def __init__(self) -> None:
        self.number = 0

    def __bool__(self) -> bool:
        """Return whether a signal was received."""
        return self.number != 0


class Stopped(KeyboardInterrupt):
    """The work ended early, after its current task, because of a signal.

    Attributes
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int, message: str) -> None:
        self.number = number
        super().__init__(f"stopped by {signal.Signals(number).name}; {message}")


Handler = Callable[[int, FrameType | None], object]


@contextmanager
def noted(enabled: bool = True, *, echo: float = 0.5) -> Iterator[Stop]:
    """Record SIGINT and SIGTERM inside the block instead of acting on them.

    A second signal has its usual effect, unless it comes within `echo` seconds of the first: `timeout` and
    terminals may send one twice. Outside the main thread, or if not `enabled`, signals keep their handlers.
    """
    stop, first = Stop(), 0.0

    def note(number: int, _: FrameType | None) -> None:
        nonlocal first
        if not stop:
            stop.number, first = number, time.monotonic()
        elif time.monotonic() - first > echo:
            _set(before)
            signal.raise_signal(number)

    before = _set(dict.fromkeys(SIGNALS, note)) if enabled else {}
    try:
        yield stop
    finally:
        _set(before)


@contextmanager
def leaving(handler: Handler) -> Iterator[None]:
    """Call `handler` on SIGINT and SIGTERM inside the block."""
    before = _set(dict.fromkeys(SIGNALS, handler))
    try:
        yield
    finally:
        _set(before)


def _set(handlers: Mapping[signal.Signals, Any]) -> dict[signal.Signals, Any]:
    """Set handlers and return the previous ones; outside the main thread nothing is set."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    # None stands for a handler that was not set from Python and cannot be restored
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in handlers}
    for number, handler in handlers.items():
        signal.signal(number, handler)
    return before
