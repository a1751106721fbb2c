"""A path of load: one step after the other, each from the solution of the one before.

An elastic surface has no memory. One with a hardness has: where a node yields, the overlap of the bodies is
indentation, which stays. The next step starts from the lowered surface, with the same pressure in balance;
unloading is elastic, and the surface that is left is the one that the last step of yielding made.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fractalcontact.contact._flat import flat_block
from fractalcontact.contact._scaling import (
    Body,
    Control,
    Problem,
    Solution,
    Units,
    serial_mean,
    serial_sum,
)

if TYPE_CHECKING:
    from fractalcontact.contact._elimination import Elimination
    from fractalcontact.contact._fast import Fast

Array = np.ndarray[Any, np.dtype[Any]]

ROWS = 64  # of a plane, at a time
BALANCE = 1e-9  # greatest share of a given force that the pressures may miss


@dataclass(frozen=True)
class Path:
    """Everything a solver needs: scaled gap and body, and the controlled values in SI units."""

    body: Body
    units: Units
    gap: Array
    control: str
    values: tuple[float, ...]
    hardness: float
    tolerance: float
    method: str


@dataclass(frozen=True)
class Past:
    """What a surface remembers, scaled: where it has yielded, and what that has cost."""

    indentation: Array | float = 0.0  # depth (ny, nx)
    touch: float = 0.0  # closure at which the bodies touch now
    work: float = 0.0


@dataclass(frozen=True)
class Step:
    """One step in SI units; the maps are made when they are asked for."""

    solution: Solution
    problem: Problem
    path: Path
    closure: float
    force: float
    run_time: float
    past: Past

    @property
    def contact(self) -> Array:
        """Nodes under pressure, which includes one that is not determined (NaN)."""
        return np.asarray(~(self.solution.pressure <= 0))

    @property
    def yielded(self) -> Array:
        """Nodes at the hardness."""
        return np.asarray(self.solution.pressure >= self.problem.cap)

    @property
    def pressure(self) -> Array:
        """Pressure in Pa."""
        pressure = self.solution.pressure * self.path.units.pressure
        if self.problem.cap == np.inf:
            return pressure
        below = np.nextafter(self.path.hardness, 0.0)
        return np.where(self.yielded, self.path.hardness, np.minimum(pressure, below))

    @property
    def displacement(self) -> Array:
        """Settlement in m."""
        return self.solution.settlement * self.path.units.height

    @property
    def gap(self) -> Array:
        """Gap in m: zero in contact, never negative."""
        scaled = self.problem.gap + self.solution.settlement - self.solution.closure
        return np.where(self.contact, 0.0, np.maximum(scaled, 0.0)) * self.path.units.height

    @cached_property
    def overlap(self) -> Array | None:
        """Scaled overlap of the bodies at yielded nodes, which this step adds to the indentation."""
        if self.problem.cap == np.inf:
            return None
        yielded = self.yielded
        if not yielded.any():
            return None
        overlap = self.solution.closure - self.problem.gap - self.solution.settlement
        return np.where(yielded, np.maximum(overlap, 0.0), 0.0)

    @property
    def past_and_this(self) -> Past:
        """What the surface remembers after this step."""
        if self.overlap is None:
            return self.past
        indentation = self.past.indentation + self.overlap
        work = self.past.work + self.problem.cap * serial_sum(self.overlap)
        return Past(indentation, float((self.path.gap + indentation).min()), work)

    @property
    def indentation(self) -> Array:
        """Depth in m by which the surface has been lowered for good, since the start of the path."""
        depth = self.past_and_this.indentation * self.path.units.height
        return np.broadcast_to(depth, self.problem.gap.shape)

    @property
    def plastic_work(self) -> float:
        """Plastic work in J since the start of the path."""
        return self.past_and_this.work * self.path.units.energy

    @property
    def mean_gap(self) -> float:
        """Mean gap in m."""
        found, gap, total = self.solution, self.problem.gap, []
        for first in range(0, gap.shape[0], ROWS):  # a whole plane of it would be one more array
            part = slice(first, first + ROWS)
            apart = gap[part] + found.settlement[part] - found.closure
            total.append(np.sum(np.maximum(apart, 0.0), axis=1, where=found.pressure[part] <= 0))
        return float(np.sum(np.concatenate(total))) / gap.size * self.path.units.height

    @property
    def elastic_energy(self) -> float:
        """Elastic energy in J."""
        return 0.5 * self.solution.work * self.path.units.energy


def solve_path(path: Path) -> Iterator[Step]:
    """Yield the steps of a path as they are solved."""
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    solver: Fast | Elimination | None = None
    past = Past()
    for value in path.values:
        begun = perf_counter()
        control = _control(path, value, past.touch)
        solution = _without_solver(problem, control)
        if solution is None:
            solver = solver or _solver(problem, path)
            solution = solver.step(control)
        carried = solution.total * path.units.force
        found = (solution.closure + past.touch) * path.units.height
        closure, force = (value, carried) if path.control == "closure" else (found, value)
        if abs(carried - force) > BALANCE * force:
            solution = replace(solution, reason="force_missed")
        step = Step(solution, problem, path, closure, force, perf_counter() - begun, past)
        yield step
        if step.overlap is not None:
            past = step.past_and_this
            problem = replace(problem, gap=path.gap + past.indentation - past.touch)
            if solver is not None:
                cast("Fast", solver).indent(problem.gap)  # elimination knows no hardness


def _without_solver(problem: Problem, control: Control) -> Solution | None:
    """Solve what has a closed form: no contact, flat faces, and what no elastic body can do."""
    if control.value <= 0:
        nothing = np.zeros(problem.body.shape)
        return Solution(nothing, nothing, control.closure or 0.0, 0.0)
    rigid = control.closure is not None and problem.body.periodic and problem.cap == np.inf
    if rigid and control.value >= serial_mean(problem.gap):
        return _beyond(problem, control.value)
    if not problem.gap.any():
        return _flat(problem, control)
    return None


def _control(path: Path, value: float, touch: float) -> Control:
    if path.control == "closure":
        return Control(closure=value / path.units.height - touch)
    greatest = path.hardness / path.units.pressure * path.gap.size  # a rounding above it is no more force
    return Control(total=min(value / path.units.force, greatest))


def _beyond(problem: Problem, closure: float) -> Solution:
    """A periodic body closed to its mean plane or further: everything touches, under a force unknown."""
    unknown = np.full(problem.body.shape, np.nan)
    return Solution(
        unknown, unknown, closure, np.nan, residual=np.nan, reason="beyond_full_contact", work=np.nan
    )


def _flat(problem: Problem, control: Control) -> Solution | None:
    """A face of zero range: closure = force / stiffness, with the stiffness of `flat_stiffness`.

    Returns None where some nodes yield and others do not.
    """
    block = flat_block(problem.body)
    stiffness = 1.0 / block.compliance if block.compliance > 0 else np.inf
    total = control.closure * stiffness if control.closure is not None else control.value
    if problem.body.periodic:  # uniform pressure; any closure makes it yield, no force more than touch
        pressure = np.full(problem.body.shape, min(total / problem.gap.size, problem.cap))
        total = float(pressure[0, 0]) * problem.gap.size
        return Solution(pressure, block.settlement, control.closure or 0.0, total)
    if block.pressure.max() * total > problem.cap:
        return None
    return Solution(
        block.pressure * total,
        block.settlement * total,
        total / stiffness if control.closure is None else control.closure,
        total,
        block.iterations,
        block.transforms,
        block.residual,
        work=block.compliance * total * total,
    )


def _solver(problem: Problem, path: Path) -> Fast | Elimination:
    """Return the method asked for, ready to be called step after step."""
    if path.method == "elimination":
        from fractalcontact.contact._elimination import Elimination

        return Elimination(problem, path.tolerance)
    from fractalcontact.contact._fast import Fast

    return Fast(problem, path.tolerance)
