"""The words of a measurement: an experiment, and the contest that several of them enter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

POINTS, TOLERANCE = "points along an edge", "tolerance"


@dataclass(frozen=True)
class Experiment:
    """One method, turned up along its knob.

    Attributes
    ----------
    method : str
        Unique in its room.
    knobs : sequence of float
        Settings in the order of growing cost.
    prepare : callable
        Knob to the input, untimed.
    solve : callable
        Input to the result, timed.
    error : callable
        Result and knob to the true error, untimed.
    knob : str
        What the knob is.
    """

    method: str
    knobs: Sequence[float]
    prepare: Callable[[float], Any]
    solve: Callable[[Any], Any]
    error: Callable[[Any, float], float]
    knob: str = POINTS


@dataclass(frozen=True)
class Contest:
    """Methods that are after the same truth, so that their errors compare.

    Attributes
    ----------
    name, error, truth : str
        What it is about, what its error is, and what that is measured against.
    experiments : tuple of Experiment
    given : bool
        The knob is the size of what is given, and not chosen: methods are compared at the same knob only.
    """

    name: str
    error: str
    truth: str
    experiments: tuple[Experiment, ...]
    given: bool = False
