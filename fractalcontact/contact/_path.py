"""A path of load: one step after the other, each from the solution of the one before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from fractalcontact.base.jit import in_bands
from fractalcontact.contact._flat import flat_block
from fractalcontact.contact._problem import Body, Control, Problem, Solution
from fractalcontact.contact._setup import Units

Array = np.ndarray[Any, np.dtype[Any]]
Solver = Callable[[Control], Solution]

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
    units: Units
    force: float
    run_time: float
    converged: bool

    @property
    def closure(self) -> float:
        """Closure in m."""
        return self.solution.closure * self.units.height

    @property
    def contact(self) -> Array:
        """Nodes under pressure."""
        return np.asarray(self.solution.pressure > 0)

    @property
    def yielded(self) -> Array:
        """Nodes at the hardness."""
        return np.asarray(self.solution.pressure >= self.problem.cap)

    @property
    def pressure(self) -> Array:
        """Pressure in Pa."""
        return self.solution.pressure * self.units.pressure

    @property
    def displacement(self) -> Array:
        """Settlement in m."""
        return self.solution.settlement * self.units.height

    @property
    def gap(self) -> Array:
        """Gap in m: zero in contact, never negative."""
        scaled = self.problem.gap + self.solution.settlement - self.solution.closure
        return np.where(self.solution.pressure > 0, 0.0, np.maximum(scaled, 0.0)) * self.units.height

    @property
    def mean_gap(self) -> float:
        """Mean gap in m."""
        from fractalcontact.contact._kernels import open_gap

        solution, gap = self.solution, self.problem.gap
        rows = np.empty(gap.shape[0])
        closure = np.float64(solution.closure)
        in_bands(open_gap, rows.size, gap.size, gap, solution.settlement, solution.pressure, closure, rows)
        return float(np.sum(rows)) / gap.size * self.units.height

    @property
    def elastic_energy(self) -> float:
        """Elastic energy in J."""
        return 0.5 * self.solution.work * self.units.energy


def solve_path(path: Path) -> Iterator[Step]:
    """Yield the steps of a path as they are solved."""
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    flat = not path.gap.any()
    solver: Solver | None = None
    for value in path.values:
        begun = perf_counter()
        control = _control(path, value)
        if value == 0:
            solution = _touching(problem)
        elif flat and _bears(problem, _flat(path, value)):
            solution = _flat(path, value)
        else:
            solver = solver or _solver(problem, path)
            solution = solver(control)
        carried = solution.total * path.units.force
        force = carried if path.control == "closure" else value
        if abs(carried - force) > BALANCE * force:
            solution = replace(solution, reason="the pressures do not carry the force")
        converged = solution.reason == "converged"
        yield Step(solution, problem, path.units, force, perf_counter() - begun, converged)


def _control(path: Path, value: float) -> Control:
    if path.control == "closure":
        return Control(closure=value / path.units.height)
    return Control(total=value / path.units.force)


def _touching(problem: Problem) -> Solution:
    """First touch: no pressure anywhere."""
    nothing = np.zeros(problem.body.shape)
    return Solution(nothing, nothing, 0.0, 0.0)


def _flat(path: Path, value: float) -> Solution:
    """A face of zero range: closure = force / stiffness, with the stiffness of `flat_stiffness`."""
    block = flat_block(path.body)
    stiffness = np.inf
    if block.compliance > 0:
        stiffness = path.units.modulus * path.units.length * path.body.cell_area / block.compliance
    force, closure = (value * stiffness, value) if path.control == "closure" else (value, value / stiffness)
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


def _bears(problem: Problem, solution: Solution) -> bool:
    """Whether no node would yield."""
    return bool(solution.pressure.max() <= problem.cap)


def _solver(problem: Problem, path: Path) -> Solver:
    """Return the method asked for, ready to be called step after step."""
    if path.method == "elimination":
        from fractalcontact.contact._elimination import Elimination

        return Elimination(problem).step
    from fractalcontact.contact._fast import Fast

    return Fast(problem, path.tolerance).step
