"""Memory of a contact with friction: the reversals of the tangential force that still matter (Masing 1926).

The first loading gives the curve of force and displacement; a branch after a reversal is that curve, twice as
large. A branch that becomes longer than the one before it closes a loop, which is forgotten.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Branch:
    """A part of the path in one sense: its sign, its weight, and the force L of the curve of first loading.

    The first branch is that curve: weight 1, L the force reached. Every later one has the weight 2, and as L
    half of the change of the force.
    """

    sign: float
    weight: float
    force: float


@dataclass(frozen=True)
class ShearState:
    """Loading history of a step: its branches, and the weights and forces L of the loops that have closed."""

    branches: tuple[Branch, ...]
    closed: tuple[tuple[float, float], ...]


def shear_states(forces: Array) -> list[ShearState]:
    """Return the loading history of each step of a path of tangential forces.

    `points` holds 0, the reversals of loops still open, and the current force. Masing's rule: a branch that
    becomes longer than the one before it has closed a loop, which is discarded.
    """
    points, states = [0.0], []
    closed: list[tuple[float, float]] = []
    for value in forces.tolist():
        if value != points[-1]:
            if len(points) > 1 and (value > points[-1]) == (points[-1] > points[-2]):
                points[-1] = value
            else:
                discard_closed_loops(points, closed, at_closure=True)
                points.append(value)
            discard_closed_loops(points, closed)
        branches = []
        for number, (start, stop) in enumerate(pairwise(points)):
            weight = 2.0 if number else 1.0
            branches.append(Branch(math.copysign(1.0, stop - start), weight, abs(stop - start) / weight))
        states.append(ShearState(tuple(branches), tuple(closed)))
    return states


def discard_closed_loops(
    points: list[float], closed: list[tuple[float, float]], *, at_closure: bool = False
) -> None:
    """Take the reversals of closed loops out of `points` and note the loops in `closed`.

    A loop that has just closed is discarded with `at_closure` only: up to there its stick set is that of its
    own last branch. A loop of two branches dissipates as 4 first branches of its length do. The first branch
    together with the part of the second that mirrors it is like a first branch the other way, and dissipates
    2 more.
    """
    while len(points) > 2:
        length = abs(points[-1] - points[-2])
        first = len(points) == 3
        limit = 2 * abs(points[1]) if first else abs(points[-2] - points[-3])
        if not (length > limit or (at_closure and length == limit)):
            return
        closed.append((2.0 if first else 4.0, limit / 2))
        del points[-2 if first else -3 : -1]
