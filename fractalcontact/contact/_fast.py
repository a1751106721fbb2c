"""The fast method along a path: on which nodes each step is solved, from where, and in which precision.

A periodic body is solved on its plane. A free body touches only where the gap at first touch is less than
the closure, for its settlement is positive everywhere: few such nodes are solved by sums over pairs, more of
them on the window that holds them. Under force control the closure is not known before; solving on too few
nodes overestimates it, so that what it finds either verifies the nodes or names all that are needed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.contact._descent import Descent
from fractalcontact.contact._nested import cold_start
from fractalcontact.contact._nodes import NodePreconditioner, PairSum, stiffness_table
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._plane import WHOLE_PLANE, Plane, Window, first_precision
from fractalcontact.contact._scaling import Control, Problem, Solution

Array = np.ndarray[Any, np.dtype[Any]]

GREATEST_REACH = 2.0  # extrapolation along the path, in steps
FEW_NODES = 1000  # candidates up to which sums over pairs are faster than transforms
FIRST_NODES = 256  # candidates to begin with
WHOLE = 0.75  # part of the extent from which a window is not worth having
TRIAL = 1e-2  # residual at which a closure is known well enough to tell the candidates
DUST = 1e-13  # part of the greatest pressure that is rounding
ROOM = 1.1  # candidates for this much more than the expected closure


class Fast:
    """Solver of one problem, kept along a path."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.problem, self.tolerance = problem, tolerance
        self.known: list[tuple[float, float, Array]] = []  # the last two steps: control, closure, pressure
        self.plane: Plane | None = None
        self.spent = (0, 0)

    @cached_property
    def ordered(self) -> Array:
        """Gaps at first touch, ascending."""
        return np.sort(self.problem.gap.ravel())

    @cached_property
    def tables(self) -> tuple[Array, Array]:
        """Influence and stiffness between nodes, by distance."""
        return self.problem.body.table(), stiffness_table(self.problem.body)

    @cached_property
    def operator(self) -> Operator:
        """The operator on the whole extent."""
        return self.problem.body.operator()

    def indent(self, gap: Array) -> None:
        """Go on with another gap, where yielded nodes have been lowered."""
        self.problem, self.plane = replace(self.problem, gap=gap), None
        self.__dict__.pop("ordered", None)

    def step(self, control: Control) -> Solution:
        """Solve one step of the path."""
        self.spent = (0, 0)
        if self.problem.body.periodic:
            solution = self.on_plane(control, WHOLE_PLANE, self.guess(control))
        else:
            solution = self.on_nodes(control) or self.on_window(control)
        solution = self.without_dust(solution)
        self.known = [*self.known[-1:], (control.value, solution.closure, solution.pressure)]
        return replace(solution, iterations=self.spent[0], transforms=self.spent[1])

    def without_dust(self, solution: Solution) -> Solution:
        """Open the nodes that bear no more than rounding and are apart: left by an extrapolation, say."""
        pressure = solution.pressure
        dust = (pressure > 0) & (pressure <= DUST * pressure.max(initial=0.0))
        if not dust.any():
            return solution
        apart = self.problem.gap + solution.settlement > solution.closure
        return replace(solution, pressure=np.where(dust & apart, 0.0, pressure))

    def count(self, solution: Solution) -> Solution:
        """Add up the work of the attempts of a step."""
        self.spent = (self.spent[0] + solution.iterations, self.spent[1] + solution.transforms)
        return solution

    def guess(self, control: Control) -> Array | None:
        """Pressure extrapolated from the last two steps, linearly in the logarithm of the control."""
        if not self.known:
            return None
        value, _, pressure = self.known[-1]
        if len(self.known) == 2 and self.known[0][0] != value:
            reach = np.log(control.value / value) / np.log(value / self.known[0][0])
            if abs(reach) <= GREATEST_REACH:
                return np.asarray(np.maximum(pressure + reach * (pressure - self.known[0][2]), 0.0))
        return np.asarray(pressure * (control.value / value))

    def expected_closure(self, control: Control) -> float | None:
        """Closure given, or extrapolated as a power of the force."""
        if control.closure is not None:
            return control.closure
        if not self.known:
            return None
        value, closure, _ = self.known[-1]
        power = 1.0
        if len(self.known) == 2 and self.known[0][0] != value:
            power = np.log(closure / self.known[0][1]) / np.log(value / self.known[0][0])
        return float(closure * (control.value / value) ** min(max(power, 0.0), 1.0))

    # few nodes

    def on_nodes(self, control: Control) -> Solution | None:
        """Solve by sums over pairs; None where there are too many candidates."""
        if np.count_nonzero(self.problem.gap <= self.least_closure(control)) > FEW_NODES:
            return None
        count = self.first_count(control)
        start = self.guess(control)
        while 0 < count <= FEW_NODES:
            chosen = np.flatnonzero(self.problem.gap.ravel() <= self.ordered[count - 1])
            if chosen.size > FEW_NODES or not self.bears(chosen.size, control):  # a plateau, or too few
                break
            solution = self.count(self.solve_nodes(chosen, control, start, TRIAL))
            start = self.embedded_pressure(solution, chosen)
            needed = self.candidates(solution.closure * (1 + TRIAL))
            if control.closure is not None or needed <= chosen.size:
                solution = self.count(self.solve_nodes(chosen, control, start, self.tolerance))
                return self.everywhere(replace(solution, pressure=self.embedded_pressure(solution, chosen)))
            count = min(needed, 4 * chosen.size)
        return None

    def least_closure(self, control: Control) -> float:
        """Closure given, or that of a flat plate around the whole extent, which no contact undercuts."""
        if control.total is None:
            return float(control.value)
        body = self.problem.body
        across = np.hypot(body.shape[0] * body.spacing[0], body.shape[1] * body.spacing[1])
        return control.value * body.cell_area / float(across)

    def bears(self, nodes: int, control: Control) -> bool:
        """Whether so many nodes can carry the force under the cap, with some to spare."""
        return control.total is None or nodes * self.problem.cap > 2 * control.total

    def first_count(self, control: Control) -> int:
        """Number of candidates to begin with."""
        if control.closure is not None:
            return self.candidates(control.closure)
        closure = self.expected_closure(control)
        if closure is None:
            return min(FIRST_NODES, self.ordered.size)
        likely = self.candidates(closure * ROOM)
        return max(1, likely if likely <= FEW_NODES else min(likely, 4 * self.candidates(self.known[-1][1])))

    def candidates(self, closure: float) -> int:
        """Nodes whose gap at first touch is below a closure."""
        return int(np.searchsorted(self.ordered, closure))

    def solve_nodes(self, chosen: Array, control: Control, start: Array | None, tolerance: float) -> Solution:
        """Solve on the nodes `chosen` alone."""
        nx = self.problem.body.shape[1]
        iy, ix = chosen // nx, chosen % nx
        operator, precondition = PairSum(self.tables[0], iy, ix), NodePreconditioner(self.tables[1], iy, ix)
        gap = self.problem.gap.reshape(1, -1)[:, chosen]
        first = np.ones(gap.shape) if start is None else start.reshape(1, -1)[:, chosen]
        descent = Descent(gap, self.problem.cap, operator, precondition, self.problem.local, np.float64)
        return descent.solve(first if first.any() else np.ones(gap.shape), control, tolerance)

    def embedded_pressure(self, solution: Solution, chosen: Array) -> Array:
        """Pressure on the whole extent."""
        pressure = np.zeros(self.problem.body.shape)
        pressure.ravel()[chosen] = solution.pressure.ravel()
        return pressure

    def everywhere(self, solution: Solution) -> Solution:
        """Settlement on the whole extent."""
        self.spent = (self.spent[0], self.spent[1] + 1)
        return replace(solution, settlement=self.operator.apply(solution.pressure))

    # a window of the plane

    def on_window(self, control: Control) -> Solution:
        """Solve on the window that holds every candidate."""
        start, closure = self.guess(control), self.expected_closure(control)
        if start is None:
            start, expected = cold_start(self.problem, control, first_precision(self.problem, control))
            closure = expected if closure is None else closure
        window = self.window(ROOM * float(closure or 0.0))
        if not self.bears(self.problem.gap[window].size, control):
            window = WHOLE_PLANE
        while True:
            solution = self.on_plane(control, window, start)
            if window == WHOLE_PLANE:
                return solution
            outside = np.ones(self.problem.body.shape, dtype=bool)
            outside[window] = False
            pressure = np.zeros(self.problem.body.shape)
            pressure[window] = solution.pressure
            if control.closure is not None or not (self.problem.gap[outside] < solution.closure).any():
                return self.everywhere(replace(solution, pressure=pressure))
            start, window = pressure, self.window(solution.closure)

    def window(self, closure: float) -> Window:
        """Box of the nodes whose gap is below `closure`; the whole plane where that is not much more."""
        near = self.problem.gap < closure
        box = []
        for axis, n in enumerate(near.shape):
            hit = np.flatnonzero(near.any(axis=1 - axis))
            first, last = (int(hit[0]), int(hit[-1]) + 1) if hit.size else (0, n)
            step = max(1, n // 16)
            box.append(slice(first // step * step, min(n, -(-last // step) * step)))
        size = (box[0].stop - box[0].start) * (box[1].stop - box[1].start)
        if size > WHOLE * near.size or min(s.stop - s.start for s in box) < 3:
            return WHOLE_PLANE
        return box[0], box[1]

    def on_plane(self, control: Control, window: Window, start: Array | None) -> Solution:
        """Solve on a window of the plane."""
        if start is None:
            start = cold_start(self.problem, control, first_precision(self.problem, control))[0]
        if self.plane is None or self.plane.window != window:
            self.plane = Plane(self.problem, window)
        handed = [start if window == WHOLE_PLANE else start[window]]
        del start
        return self.count(self.plane.solve(handed, control, self.tolerance))
