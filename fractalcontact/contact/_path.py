"""A path of load: one step after the other, each from the solution of the one before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from fractalcontact.contact._flat import flat_block
from fractalcontact.contact._problem import Body, Problem, Solution, serial_mean, serial_sum
from fractalcontact.contact._setup import Units

Array = np.ndarray[Any, np.dtype[Any]]


BALANCE = 1e-6  # greatest share of a given force that the pressures may miss


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
    def elastic_energy(self) -> float:
        """Elastic energy in J."""
        return 0.5 * serial_sum(self.solution.pressure * self.solution.settlement) * self.units.energy


def solve_path(path: Path) -> Iterator[Step]:
    """Yield the steps of a path as they are solved."""
    solver = _rough_steps if path.gap.any() else _flat_steps
    yield from solver(path)


def _rough_steps(path: Path) -> Iterator[Step]:
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    advance = _eliminator(problem) if path.method == "elimination" else _descender(problem, path.tolerance)
    for value in path.values:
        begun = perf_counter()
        if value == 0:
            solution = _touching(problem)
        elif path.control == "closure":
            solution = advance(None, value / path.units.height)
        else:
            solution = advance(value / path.units.force, None)
        carried = solution.total * path.units.force
        force = carried if path.control == "closure" else value
        if abs(carried - force) > BALANCE * force:
            solution = replace(solution, reason="the pressures do not carry the force")
        converged = solution.reason == "converged"
        yield Step(solution, problem, path.units, force, perf_counter() - begun, converged)


def _flat_steps(path: Path) -> Iterator[Step]:
    """A face of zero range: closure = force / stiffness, with the stiffness of `flat_stiffness`."""
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    stiffness = _stiffness(path)
    for value in path.values:
        begun = perf_counter()
        force = value * stiffness if path.control == "closure" else value
        total = force / path.units.force
        flat = flat_block(path.body)
        closure = (value if path.control == "closure" else force / stiffness) / path.units.height
        solution = Solution(
            flat.pressure * total,
            flat.settlement * total,
            closure,
            total,
            flat.iterations,
            flat.transforms,
            flat.residual,
        )
        yield Step(solution, problem, path.units, force, perf_counter() - begun, True)


def _stiffness(path: Path) -> float:
    compliance = flat_block(path.body).compliance
    return path.units.modulus * path.units.length * path.body.cell_area / compliance if compliance else np.inf


def _touching(problem: Problem) -> Solution:
    nothing = np.zeros(problem.body.shape)
    return Solution(nothing, nothing, 0.0, 0.0)


def _eliminator(problem: Problem):  # type: ignore[no-untyped-def]
    from fractalcontact.contact import _elimination

    dense = _elimination.Dense(problem)
    return lambda total, closure: _elimination.solve(problem, dense, total=total, closure=closure)


def _descender(problem: Problem, tolerance: float):  # type: ignore[no-untyped-def]
    from fractalcontact.contact._descent import Control
    from fractalcontact.contact._fast import Fast

    fast = Fast(problem, tolerance)
    return lambda total, closure: fast.step(Control(total, closure))
