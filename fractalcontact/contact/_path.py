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

from fractalcontact.base.jit import in_bands
from fractalcontact.contact._flat import flat_block
from fractalcontact.contact._problem import Body, Control, Problem, Solution, serial_mean, serial_sum
from fractalcontact.contact._setup import Units

if TYPE_CHECKING:
    from fractalcontact.contact._elimination import Elimination
    from fractalcontact.contact._fast import Fast

Array = np.ndarray[Any, np.dtype[Any]]

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
class Step:
    """One step in SI units; the maps are made when they are asked for."""

    solution: Solution
    problem: Problem
    path: Path
    force: float
    run_time: float
    before: Array | None = None  # scaled indentation before the step
    spent: float = 0.0  # scaled plastic work before the step

    @property
    def closure(self) -> float:
        """Closure in m."""
        return self.solution.closure * self.path.units.height

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
        yielded = self.yielded
        if not yielded.any():
            return None
        overlap = self.solution.closure - self.problem.gap - self.solution.settlement
        return np.where(yielded, np.maximum(overlap, 0.0), 0.0)

    @property
    def indentation(self) -> Array:
        """Depth in m by which the surface has been lowered for good, since the start of the path."""
        parts = [part for part in (self.before, self.overlap) if part is not None]
        return np.asarray(sum(parts, np.zeros(self.problem.gap.shape)) * self.path.units.height)

    @property
    def dissipated(self) -> float:
        """Scaled plastic work since the start of the path."""
        return self.spent + (0.0 if self.overlap is None else self.problem.cap * serial_sum(self.overlap))

    @property
    def plastic_work(self) -> float:
        """Plastic work in J since the start of the path."""
        return self.dissipated * self.path.units.energy

    @property
    def mean_gap(self) -> float:
        """Mean gap in m."""
        from fractalcontact.contact._kernels import open_gap

        solution, gap = self.solution, self.problem.gap
        rows = np.empty(gap.shape[0])
        closure = np.float64(solution.closure)
        in_bands(open_gap, rows.size, gap.size, gap, solution.settlement, solution.pressure, closure, rows)
        return float(np.sum(rows)) / gap.size * self.path.units.height

    @property
    def elastic_energy(self) -> float:
        """Elastic energy in J."""
        return 0.5 * self.solution.work * self.path.units.energy


def solve_path(path: Path) -> Iterator[Step]:
    """Yield the steps of a path as they are solved."""
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    solver: Fast | Elimination | None = None
    before, spent = None, 0.0
    for value in path.values:
        begun = perf_counter()
        solution = _without_solver(problem, path, value)
        if solution is None:
            solver = solver or _solver(problem, path)
            solution = solver.step(_control(path, value))
        carried = solution.total * path.units.force
        force = carried if path.control == "closure" else value
        if abs(carried - force) > BALANCE * force:
            solution = replace(solution, reason="force_missed")
        step = Step(solution, problem, path, force, perf_counter() - begun, before, spent)
        yield step
        if step.overlap is not None:
            before = step.overlap if before is None else before + step.overlap
            spent = step.dissipated
            problem = replace(problem, gap=path.gap + before)
            if solver is not None:
                cast("Fast", solver).indent(problem.gap)  # elimination knows no hardness


def _without_solver(problem: Problem, path: Path, value: float) -> Solution | None:
    """Solve what has a closed form: no contact, flat faces, and what no elastic body can do."""
    first, nothing = float(problem.gap.min()), np.zeros(problem.body.shape)
    if path.control == "closure" and value <= first * path.units.height:
        return Solution(nothing, nothing, value / path.units.height, 0.0)
    if value == 0:
        return Solution(nothing, nothing, first, 0.0)
    if path.control == "closure" and problem.body.periodic and problem.cap == np.inf:
        closure = value / path.units.height
        if closure >= serial_mean(problem.gap):
            return _beyond(problem, closure)
    if problem.gap.max() == first:
        flat = _flat(path, value, first)
        if flat.pressure.max() <= problem.cap:
            return flat
        if problem.body.periodic:
            return _saturated(problem, value / path.units.height)
    return None


def _control(path: Path, value: float) -> Control:
    if path.control == "closure":
        return Control(closure=value / path.units.height)
    greatest = path.hardness / path.units.pressure * path.gap.size  # a rounding above it is no more force
    return Control(total=min(value / path.units.force, greatest))


def _beyond(problem: Problem, closure: float) -> Solution:
    """A periodic body closed to its mean plane or further: everything touches, under a force unknown."""
    unknown = np.full(problem.body.shape, np.nan)
    return Solution(
        unknown, unknown, closure, np.nan, residual=np.nan, reason="beyond_full_contact", work=np.nan
    )


def _saturated(problem: Problem, closure: float) -> Solution:
    """A flat periodic face under an imposed closure: it yields everywhere."""
    pressure = np.full(problem.body.shape, problem.cap)
    return Solution(pressure, np.zeros_like(pressure), closure, problem.cap * pressure.size)


def _flat(path: Path, value: float, first: float) -> Solution:
    """A face of zero range: closure = force / stiffness, with the stiffness of `flat_stiffness`.

    `first` is the scaled closure at which it touches, where an indentation has lowered it.
    """
    block = flat_block(path.body)
    stiffness, touch = np.inf, first * path.units.height
    if block.compliance > 0:
        stiffness = path.units.modulus * path.units.length * path.body.cell_area / block.compliance
    if path.control == "closure":
        force, closure = (value - touch) * stiffness, value
    else:
        force, closure = value, value / stiffness + touch
    total = force / path.units.force
    return Solution(
        block.pressure * total,
        block.settlement * total,
        closure / path.units.height,
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

        return Elimination(problem)
    from fractalcontact.contact._fast import Fast

    return Fast(problem, path.tolerance)
