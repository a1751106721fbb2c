"""A polite stop: the first SIGINT or SIGTERM is noted and the work ends where it may; a second is obeyed."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
ECHO = 0.5  # seconds: `timeout` and terminals may send the same signal twice


class Stop:
    """Whether a stop was asked for; true from the first signal on.

    Attributes
    ----------
    number : int
        The signal, 0 while there was none.
    """

    def __init__(self) -> None:
        self.number = 0

    def __bool__(self) -> bool:
        """Say whether a signal came."""
        return self.number != 0


class Stopped(KeyboardInterrupt):
    """The work ended early, in good order, because a signal asked for it.

    Attributes
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int, told: str) -> None:
        self.number = number
        super().__init__(f"stopped by {signal.Signals(number).name}; {told}")


Handler = Callable[[int, FrameType | None], object]


@contextmanager
def noted(enabled: bool = True) -> Iterator[Stop]:
    """Note SIGINT and SIGTERM inside the block instead of obeying them.

    A second signal, half a second after the first or later, does what it did before the block. Outside the
    main thread, or if not `enabled`, signals are left alone.
    """
    stop, first = Stop(), 0.0

    def note(number: int, _: FrameType | None) -> None:
        nonlocal first
        if not stop:
            stop.number, first = number, time.monotonic()
        elif time.monotonic() - first > ECHO:
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
    """Set handlers and return those that stood before; outside the main thread there is nothing to set."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    # None stands for a handler that was not set from Python, and cannot be set again
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in handlers}
    for number, handler in handlers.items():
        signal.signal(number, handler)
    return before
