"""The iteration on a plane or on a window of it, first in single and then in double precision.

At n = 512 single precision first saves a quarter of the time, at n = 256 nothing: there the transforms fit
the caches either way. Each precision compiles all passes of the iteration once, so small faces, the usual
size of a block that is slid, take double precision alone and start in half the time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.contact._descent import Descent
from fractalcontact.contact._precondition import Preconditioner
from fractalcontact.contact._scaling import Control, Problem, Solution

Array = np.ndarray[Any, np.dtype[Any]]
Window = tuple[slice, slice]
WHOLE_PLANE = (slice(None), slice(None))

SINGLE_FROM = 384 * 384  # nodes from which single precision first saves time, and is worth being compiled
SINGLE_ENOUGH = 3e-5  # residual at which double precision takes over
SINGLE_RANGE = 1e20  # scaled pressures and closures up to which, and down to whose inverse, it may be used


def first_precision(problem: Problem, control: Control) -> Any:
    """Type of number for a first solution: single precision where it saves time and its range is enough."""
    if problem.gap.size < SINGLE_FROM:
        return np.float64
    load = control.value if control.total is None else control.value / problem.gap.size
    small = 1 / SINGLE_RANGE < load < SINGLE_RANGE
    bounded = problem.cap == np.inf or 1 / SINGLE_RANGE < problem.cap < SINGLE_RANGE
    return np.float32 if small and bounded else np.float64


def plane_descent(problem: Problem, kind: Any) -> Descent:
    """Return the iteration on the whole plane of a problem."""
    body = problem.body
    operator = body.operator(kind)
    precondition = Preconditioner(body, kind, getattr(operator, "wavenumbers", None))
    return Descent(problem.gap, problem.cap, operator, precondition, problem.local, kind)


class Plane:
    """The iteration on a window of the plane, first in single and then in double precision."""

    def __init__(self, problem: Problem, window: Window) -> None:
        self.window = window
        gap = problem.gap[window]
        body = replace(problem.body, shape=(gap.shape[0], gap.shape[1]))
        self.part = Problem(body, gap, problem.cap)
        self.local = problem.local
        self.kept: dict[Any, Descent] = {}

    def solve(self, handed: list[Array], control: Control, tolerance: float) -> Solution:
        """Solve from the pressure in `handed`, which is taken out: nobody else shall hold that array."""
        before = (0, 0)
        if first_precision(self.part, control) is np.float32 and tolerance < SINGLE_ENOUGH:
            rough = self.descent(np.float32).solve(handed.pop(), control, SINGLE_ENOUGH, certify=False)
            before = (rough.iterations, rough.transforms)
            handed.append(rough.pressure)
            del rough
        solution = self.descent(np.float64).solve(handed.pop(), control, tolerance)
        return replace(
            solution,
            iterations=solution.iterations + before[0],
            transforms=solution.transforms + before[1],
        )

    def descent(self, kind: Any) -> Descent:
        """Return the iteration in one precision; kept for a free body, whose kernel takes time to make."""
        if kind in self.kept:
            return self.kept[kind]
        descent = plane_descent(self.part, kind)
        descent.local = self.local
        if not self.part.body.periodic:
            self.kept[kind] = descent
        return descent
