"""A load path: one step after the other, each from the solution of the step before.

An elastic surface has no history. One with a hardness has: where a node yields, the overlap of the bodies
becomes indentation, which stays. The next step starts from the lowered surface, with the same pressure in
balance. Unloading is elastic, and the surface that remains is that of the last step of yielding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, cast

import numpy as np

from fractalcontact.base.grid import Grid
from fractalcontact.base.numbers import Array
from fractalcontact.contact._flat_block import flat_block
from fractalcontact.contact._problem import (
    Body,
    ContactOptions,
    Control,
    LoadPath,
    Problem,
    Solution,
    Units,
    make_units,
    mean_by_rows,
    scaled_body,
    strips,
    sum_by_rows,
)

if TYPE_CHECKING:
    from fractalcontact.contact._elimination import Elimination
    from fractalcontact.contact._window_solver import WindowSolver


@dataclass(frozen=True)
class ScaledPath:
    """Everything a solver needs: body, units, scaled gap, and the imposed values in SI units."""

    body: Body
    units: Units
    gap: Array
    control: str
    values: tuple[float, ...]
    hardness: float
    tolerance: float
    method: str

    @property
    def disc_radius(self) -> float | None:
        """Radius of the circular plates in m; None for other influence coefficients."""
        return self.body.radius * self.units.length if self.body.influence == "disc" else None


@dataclass(frozen=True)
class PlasticHistory:
    """What yielding has left, scaled: indentation (ny, nx), closure at which the bodies touch now, work."""

    indentation: Array | float = 0.0
    first_touch: float = 0.0
    work: float = 0.0


@dataclass(frozen=True)
class Step:
    """One step in SI units; the maps are computed when they are asked for."""

    solution: Solution
    problem: Problem
    path: ScaledPath
    closure: float
    force: float
    run_time: float
    history: PlasticHistory

    @property
    def contact(self) -> Array:
        """Nodes under pressure, which includes one that is not determined (NaN)."""
        return np.asarray(~(self.solution.pressure <= 0))

    @property
    def yielded(self) -> Array:
        """Nodes at the hardness."""
        return np.asarray(self.solution.pressure >= self.problem.p_max)

    @property
    def pressure(self) -> Array:
        """Pressure in Pa."""
        pressure = self.solution.pressure * self.path.units.pressure
        if self.problem.p_max == np.inf:
            return pressure
        below = np.nextafter(self.path.hardness, 0.0)
        return np.where(self.yielded, self.path.hardness, np.minimum(pressure, below))

    @property
    def displacement(self) -> Array:
        """Displacement in m, down."""
        return self.solution.displacement * self.path.units.height

    @property
    def gap(self) -> Array:
        """Gap in m: zero in contact, never negative."""
        scaled = self.problem.gap + self.solution.displacement - self.solution.closure
        return np.where(self.contact, 0.0, np.maximum(scaled, 0.0)) * self.path.units.height

    @cached_property
    def new_indentation(self) -> Array | None:
        """Scaled overlap of the bodies at yielded nodes, which becomes indentation; None without."""
        if self.problem.p_max == np.inf:
            return None
        yielded = self.yielded
        if not yielded.any():
            return None
        overlap = self.solution.closure - self.problem.gap - self.solution.displacement
        return np.where(yielded, np.maximum(overlap, 0.0), 0.0)

    @property
    def history_after(self) -> PlasticHistory:
        """The plastic history with this step."""
        if self.new_indentation is None:
            return self.history
        indentation = self.history.indentation + self.new_indentation
        work = self.history.work + self.problem.p_max * sum_by_rows(self.new_indentation)
        return PlasticHistory(indentation, float((self.path.gap + indentation).min()), work)

    @property
    def indentation(self) -> Array:
        """Depth in m by which the surface has been lowered for good, since the start of the path."""
        depth = self.history_after.indentation * self.path.units.height
        return np.broadcast_to(depth, self.problem.gap.shape)

    @property
    def plastic_work(self) -> float:
        """Plastic work in J since the start of the path."""
        return self.history_after.work * self.path.units.energy

    @property
    def mean_gap(self) -> float:
        """Mean gap in m."""
        solution, gap, row_sums = self.solution, self.problem.gap, []
        for rows in strips(0, *gap.shape):  # the gap of the whole plane would be one more array
            scaled = gap[rows] + solution.displacement[rows] - solution.closure
            is_open = solution.pressure[rows] <= 0
            row_sums.append(np.sum(np.maximum(scaled, 0.0), axis=1, where=is_open))
        return float(np.sum(np.concatenate(row_sums))) / gap.size * self.path.units.height

    @property
    def stiffness(self) -> float:
        """Force over closure of a step of `press_punch`, N/m: infinite in full contact of a periodic body.

        As the base of the punch is flat and stays, this is the derivative; of any other step it is a secant.
        """
        return self.force / self.closure if self.closure > 0 else math.inf

    @property
    def elastic_energy(self) -> float:
        """Elastic energy in J."""
        return 0.5 * self.solution.work * self.path.units.energy


def scaled_path(
    heights: Array, grid: Grid, contact_modulus: float, options: ContactOptions, load: LoadPath
) -> ScaledPath:
    """Return the scaled problem with its load path."""
    control, values = load.solver_values(grid.nominal_area)
    gap = heights.max() - heights
    units = make_units(grid, float(gap.max()), contact_modulus, load)
    gap /= units.height
    hardness = np.inf if options.hardness is None else options.hardness
    imposed, body = tuple(values.tolist()), scaled_body(grid, options)
    return ScaledPath(body, units, gap, control, imposed, hardness, options.tolerance, options.method)


def solve_path(
    path: ScaledPath,
    guess: Callable[[float], Array | None] | None = None,
    *,
    force_tolerance: float = 1e-9,  # the most in 656 steps on random surfaces was 5e-16: more is a failure
) -> Iterator[Step]:
    """Yield the steps of a path as they are solved.

    `guess` returns the scaled pressure from which the fast method starts under an imposed value; without it,
    or where it returns None, that is extrapolated from the steps before.
    """
    problem = Problem(path.body, path.gap, path.hardness / path.units.pressure)
    step_solver: WindowSolver | Elimination | None = None
    history = PlasticHistory()
    for value in path.values:
        start = perf_counter()
        control = scaled_control(path, value, history.first_touch)
        solution = closed_form(problem, control, path.tolerance)
        if solution is None:
            step_solver = step_solver or make_solver(problem, path)
            solution = step_solver.solve(control, None if guess is None else guess(value))
        force = solution.force * path.units.force
        if path.control == "closure":
            closure, imposed = value, force
        else:
            closure, imposed = (solution.closure + history.first_touch) * path.units.height, value
        if abs(force - imposed) > force_tolerance * imposed:
            solution = replace(solution, reason="force_missed")
        step = Step(solution, problem, path, closure, imposed, perf_counter() - start, history)
        yield step
        if step.new_indentation is not None:
            history = step.history_after
            problem = replace(problem, gap=path.gap + history.indentation - history.first_touch)
            if step_solver is not None:  # only the fast method has a hardness, see `ContactOptions`
                cast("WindowSolver", step_solver).set_gap(problem.gap)


def scaled_control(path: ScaledPath, value: float, first_touch: float) -> Control:
    """Return what is imposed, scaled; the closure counts from the touch of the surface as it is now."""
    if path.control == "closure":
        return Control(closure=value / path.units.height - first_touch)
    largest = path.hardness / path.units.pressure * path.gap.size  # rounding must not ask for more than that
    return Control(force=min(value / path.units.force, largest))


def make_solver(problem: Problem, path: ScaledPath) -> WindowSolver | Elimination:
    """Return the solver of the method asked for; only that one is imported."""
    if path.method == "elimination":
        from fractalcontact.contact._elimination import Elimination

        return Elimination(problem, path.tolerance)
    from fractalcontact.contact._window_solver import WindowSolver

    return WindowSolver(problem, path.tolerance)


def closed_form(problem: Problem, control: Control, tolerance: float) -> Solution | None:
    """Return the solution where there is a closed form: no load, a flat surface, beyond full contact."""
    if control.value <= 0:
        zero = np.zeros(problem.body.shape)
        return Solution(zero, zero, control.closure or 0.0, 0.0, reason="converged")
    elastic = problem.body.periodic and problem.p_max == np.inf
    if elastic and control.closure is not None and control.value >= mean_by_rows(problem.gap):
        # full contact, and an unknown force
        unknown = np.full(problem.body.shape, np.nan)
        reason = "beyond_full_contact"
        return Solution(unknown, unknown, control.value, np.nan, residual=np.nan, reason=reason, work=np.nan)
    if not problem.gap.any():
        return flat_contact(problem, control, tolerance)
    return None


def flat_contact(problem: Problem, control: Control, tolerance: float) -> Solution | None:
    """Return the solution of a flat surface: closure = force / stiffness, as `flat_stiffness` has it.

    None where some nodes yield and others do not.
    """
    block = flat_block(problem.body)
    stiffness = 1.0 / block.closure if block.closure > 0 else np.inf
    force = control.closure * stiffness if control.closure is not None else control.value
    if problem.body.periodic:
        # a periodic flat body has no compliance: a positive closure loads it to p_max, a force leaves the
        # closure at 0
        pressure = np.full(problem.body.shape, min(force / problem.gap.size, problem.p_max))
        force = float(pressure[0, 0]) * problem.gap.size
        return Solution(pressure, block.displacement, control.closure or 0.0, force, reason="converged")
    if block.pressure.max() * force > problem.p_max:
        return None
    missed = "rounding" if block.reason == "converged" else block.reason  # the block is solved to rounding
    return replace(
        block,
        pressure=block.pressure * force,
        displacement=block.displacement * force,
        closure=force / stiffness if control.closure is None else control.closure,
        force=force,
        reason="converged" if block.residual <= tolerance else missed,
        work=block.work * force * force,
    )


def press_punch(
    step: Step,
    rise: Array | None,
    *,
    # on rough surfaces of 128 x 128 nodes the stiffness is off by up to 2e-5; .03 left 4e-4 for 3 % fewer
    # transforms of a partial slip, .003 3e-6 for 2 % more
    tolerance: float = 1e-2,
) -> Step | None:
    """Press a punch with the contact of `step` as its base; None where there is no contact.

    It starts from the `rise` of the pressure over one step, roughly the derivative of the pressure.
    Its stiffness is that of the contact (Barber 2003): a node at the edge of a contact bears no pressure, so
    that nodes that come into contact add nothing to the force at first. Away from the base the gap is more
    than the punch can close: its closure is at most that of `step`, whose stiffness grows with the load, and
    a periodic body bulges by less than the range of heights, 1. Yielded nodes are part of the base: the
    stiffness is that of unloading.
    """
    if not step.force > 0:
        return None
    # 1.1 and 100 closures moved the stiffness by 3e-5, as the tolerance does; with .001 in place of 1 four of
    # 656 punches came into full contact
    depth = 4 * step.solution.closure + 1.0
    path = replace(
        step.path,
        gap=np.where(step.contact, 0.0, depth),
        control="normal_force",
        values=(step.force,),
        hardness=np.inf,
        tolerance=max(step.path.tolerance, tolerance),
    )
    guess = None if rise is None else np.where(step.contact, rise, 0.0)
    return next(solve_path(path, lambda _: guess))
