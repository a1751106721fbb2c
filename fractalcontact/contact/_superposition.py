"""Superposition of normal solutions along a path of tangential force (Ciavarella 1998; Jaeger 1998).

Under a constant normal force P a tangential force Q that grows from zero gives the traction

    q = mu [p(P) - p(P - Q/mu)],                                                                   (1)

where p(P) is the pressure under the force P: the contact at the force P - Q/mu sticks, the rest slips. With
lambda the ratio of tangential to normal compliance the displacement and the slip are

    delta_t = mu lambda [delta_n(P) - delta_n(P - Q/mu)],                                          (2)
    s = mu lambda gap(P - Q/mu)    inside the contact.                                             (3)

In (3) the gap appears because the surface displacement is closure less gap less initial gap. Where the
surfaces slip, q = mu p(P), so that the energy dissipated is mu p(P) s summed over the contact.

Lambda = (2 - nu)/(2 - 2 nu) is the mean over all directions of a ratio that is 1 under a wave of traction
along the force and 1/(1 - nu) under one across it. It is exact for round contacts and nearly so for isotropic
surfaces. Under a lay the displacement (2) is up to lambda times too great across the lay, and as little as
1 - nu/2 times of the true one along it; so is the dissipated energy.

The memory of the path is that of Masing (1926): a branch after a reversal is the curve of first loading,
twice as large: -2 times (1) to (3) for half of the change of the force. A branch that becomes longer than the
one before it closes a loop, which is forgotten.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from fractalcontact.base.compass import read_direction
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.schema import SLIP, STICK
from fractalcontact.contact._load_path import ScaledPath, Step, press_punch, solve_path
from fractalcontact.contact._problem import FORCE_ROUNDING
from fractalcontact.contact._tangential_operator import TangentialOperator

METHODS = ("superposition", "full")
# of the displacement, by `superposition_error`: isotropic surfaces of 64 x 64 to 256 x 256 nodes had .004
# (rms) at nu = .2 and .012 at .5, .036 at most; an anisotropy ratio of 2 had .036 at nu = .2
ACCEPTABLE_ERROR = 0.03


@dataclass(frozen=True)
class ShearPath:
    """A path of tangential forces (N) below sliding, towards the unit vector (x, y), and how it is solved.

    `method` is one of `METHODS`; None takes "full" where the superposition is off by more than
    `ACCEPTABLE_ERROR`.
    """

    forces: tuple[float, ...]
    unit: tuple[float, float]
    friction: float
    poisson: float
    method: str | None = None

    @classmethod
    def read(cls, forces: Any, direction: Any, friction: Any, poisson: Any, method: str | None) -> ShearPath:
        """Return it from valid arguments, with a direction as word or azimuth."""
        y, x = read_direction(direction).unit
        return cls(tuple(float_array(forces).tolist()), (x, y), float(friction), float(poisson), method)

    @property
    def compliance_ratio(self) -> float:
        """Tangential over normal compliance, lambda."""
        return (2 - self.poisson) / (2 - 2 * self.poisson)

    def slides(
        self,
        normal_force: float,
        *,
        distance: float = 1e-6,  # relative, from sliding, where the full displacement grows without bound
    ) -> bool:
        """Return whether a force reaches that of sliding, as far as the full method can tell."""
        return not max(map(abs, self.forces)) <= self.friction * normal_force * (1 - distance)


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
    """Loading history of a step: its branches, and the weights and forces L of the loops that have closed.

    `further` is the force L of the branch that a further step in the same sense follows: where a loop has
    just closed that is not the last one.
    """

    branches: tuple[Branch, ...]
    closed: tuple[tuple[float, float], ...]
    further: float


def superposition_error(normal: Step, shear: ShearPath) -> float:
    """Return the relative error of the displacement (2); above 0 it is too great.

    It is the work of the traction q = mu p(P) on its displacement by (2), over that on its true one, less 1.
    """
    pressure = normal.solution.pressure[normal.contact]
    # an even pressure on a periodic body moves nothing, but for rounding
    least = 1e-12 * normal.problem.local_compliance * float(np.sum(pressure)) ** 2
    if shear.poisson == 0 or not normal.solution.work > least:
        return 0.0
    operator = TangentialOperator(normal.path.body, normal.contact, shear.poisson)
    q = np.array(shear.unit)[:, None] * pressure
    return shear.compliance_ratio * normal.solution.work / float(np.sum(q * operator.apply(q))) - 1


def shear_states(forces: Sequence[float]) -> list[ShearState]:
    """Return the loading history of each step of a path of tangential forces.

    `points` holds 0, the reversals of loops still open, and the current force. Masing's rule: a branch that
    becomes longer than the one before it has closed a loop, which is discarded.
    """
    points, states = [0.0], []
    closed: list[tuple[float, float]] = []
    for value in forces:
        if value != points[-1]:
            if len(points) > 1 and (value > points[-1]) == (points[-1] > points[-2]):
                points[-1] = value
            else:
                discard_closed_loops(points, closed, at_closure=True)
                points.append(value)
            discard_closed_loops(points, closed)
        still_open = list(points)
        discard_closed_loops(still_open, [], at_closure=True)
        further = branches_between(still_open)
        states.append(
            ShearState(branches_between(points), tuple(closed), further[-1].force if further else 0.0)
        )
    return states


def branches_between(points: Sequence[float]) -> tuple[Branch, ...]:
    """Return the branches from zero through the reversals to the current force."""
    branches = []
    for number, (start, stop) in enumerate(pairwise(points)):
        weight = 2.0 if number else 1.0
        branches.append(Branch(math.copysign(1.0, stop - start), weight, abs(stop - start) / weight))
    return tuple(branches)


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
        if length <= limit * (1 + (-FORCE_ROUNDING if at_closure else FORCE_ROUNDING)):
            return
        closed.append((2.0 if first else 4.0, limit / 2))
        del points[-2 if first else -3 : -1]


def reduced_forces(
    states: Sequence[ShearState], normal: float, friction: float
) -> tuple[list[float], dict[float, int]]:
    """Return the normal forces P - L/mu of all branches, falling from P, and the number of each L.

    Forces that differ by rounding share one solution.
    """
    numbers, reduced = {0.0: 0}, [normal]
    used = {force for state in states for force in (state.further, *(b.force for b in state.branches))}
    for force in sorted(used - {0.0}):
        value = max(normal - force / friction, 0.0)
        if value <= FORCE_ROUNDING * normal:
            value = 0.0
        if reduced[-1] - value > FORCE_ROUNDING * normal:
            reduced.append(value)
        numbers[force] = len(reduced) - 1
    return reduced, numbers


def solve_reduced(
    path: ScaledPath, forces: Sequence[float], pressed: Step | None, tolerance: float
) -> Iterator[Step]:
    """Yield the normal solutions under falling forces (N), the first of which may have been solved."""
    path = replace(path, control="normal_force", values=tuple(forces))
    if pressed is None:
        yield from solve_path(path)
        return
    yield pressed
    path = replace(path, values=path.values[1:], tolerance=max(path.tolerance, tolerance))
    first = pressed.solution.pressure
    yield from solve_path(path, lambda force: first if force == path.values[0] else None)


class Superposition:
    """Sums of normal solutions, which arrive one by one under falling forces, the first under P.

    Only what is summed is kept of a solution, on the nodes in contact. `names` are the maps wanted; without
    `stiffness` that of the sticking contact is not computed.
    """

    def __init__(
        self,
        first: Step,
        states: Sequence[ShearState],
        numbers: dict[float, int],
        shear: ShearPath,
        cell_area: float,
        names: Sequence[str],
        *,
        stiffness: bool = True,
    ) -> None:
        self.states, self.numbers, self.names = states, numbers, names
        self.normal, self.contact = first, first.contact
        self.pressure = first.pressure[self.contact]
        self.shear, self.cell_area = shear, cell_area
        self.latest = [numbers[s.branches[-1].force] if s.branches else 0 for s in states]
        self.further = [numbers[s.further] for s in states]
        used = [{0, numbers[s.further], *(numbers[b.force] for b in s.branches)} for s in states]
        used = [u | {numbers[force] for _, force in s.closed} for u, s in zip(used, states, strict=True)]
        self.used = [sorted(u) for u in used]
        self.has_stiffness = stiffness
        self.rows: list[dict[str, float]] = []  # of the normal solutions
        self.sticks: dict[int, Array] = {}  # nodes in contact that stick, by number of the solution
        kinds = sorted({name[:-2] for name in names if name != "slip_state"})  # traction, slip
        self.fields = {kind: np.zeros((len(states), self.pressure.size)) for kind in kinds}  # (step, nodes)
        self.last_pressure: Array | None = None  # scaled

    def add(self, step: Step) -> None:
        """Take the next normal solution."""
        number = len(self.rows)
        pressure, gap = step.pressure[self.contact], step.gap[self.contact]
        stick = step.contact[self.contact]
        cells = int(np.count_nonzero(stick))
        punch = None
        if self.has_stiffness and number in self.further:
            last, this = self.last_pressure, step.solution.pressure
            punch = press_punch(step, None if last is None else np.maximum(last - this, 0.0))
        self.last_pressure = step.solution.pressure
        solutions = [step.solution] if punch is None else [step.solution, punch.solution]
        self.rows.append(
            {
                "closure": step.closure,
                "work": float(np.sum(self.pressure * gap)),  # of p(P) on the gap of P - L/mu
                "stick_cells": cells,
                "slip_cells": self.pressure.size - cells,
                "stiffness": 0.0 if punch is None else punch.stiffness,
                "residual": step.solution.residual,
                "converged": step.solution.reason == "converged",
                "iterations": sum(solution.iterations for solution in solutions),
                "transforms": sum(solution.transforms for solution in solutions),
                "run_time": step.run_time + (0.0 if punch is None else punch.run_time),
            }
        )
        if "slip_state" in self.names and number in self.latest:
            self.sticks[number] = stick
        change = {"traction": self.pressure - pressure, "slip": gap}
        for row, state_of_row in enumerate(self.states):
            factor = sum(b.sign * b.weight for b in state_of_row.branches if self.numbers[b.force] == number)
            if factor:
                for name, field in self.fields.items():
                    field[row] += factor * change[name]

    def columns(self) -> dict[str, Array]:
        """Return the scalars of all steps."""
        mu, ratio, cell = self.shear.friction, self.shear.compliance_ratio, self.cell_area
        closure, work = (np.array([row[name] for row in self.rows]) for name in ("closure", "work"))
        columns: dict[str, list[Any]] = {}
        first_use = [min(s for s, used in enumerate(self.used) if n in used) for n in range(len(self.rows))]
        for row, state in enumerate(self.states):
            branches = [(b.sign, b.weight, self.numbers[b.force]) for b in state.branches]
            displacement = sum(sign * weight * (closure[0] - closure[n]) for sign, weight, n in branches)
            dissipated = sum(weight * work[n] for _, weight, n in branches)
            dissipated += sum(weight * work[self.numbers[force]] for weight, force in state.closed)
            latest, used = self.rows[self.latest[row]], [self.rows[n] for n in self.used[row]]
            new = [self.rows[n] for n in self.used[row] if first_use[n] == row]
            values = {
                "tangential_displacement": mu * ratio * displacement,  # (2)
                "stick_area": latest["stick_cells"] * cell,
                "slip_area": latest["slip_cells"] * cell,
                "tangential_stiffness": self.rows[self.further[row]]["stiffness"] / ratio,
                "dissipated_energy": mu * mu * ratio * dissipated * cell,
                "residual": max(solution["residual"] for solution in used),
                "converged": all(solution["converged"] for solution in used),
            }
            for name in ("iterations", "transforms", "run_time"):
                values[name] = sum(solution[name] for solution in new)
            for name, value in values.items():
                columns.setdefault(name, []).append(value)
        return {name: np.array(column) for name, column in columns.items()}

    def traction(self) -> Array:
        """Return the traction along the force, (step, nodes), Pa."""
        return self.shear.friction * self.fields["traction"]

    def map(self, name: str) -> Array:
        """Return a map of all steps."""
        planes = np.zeros(
            (len(self.states), *self.contact.shape), dtype=np.int8 if name == "slip_state" else float
        )
        ratio = 1.0 if name.startswith("traction") else self.shear.compliance_ratio
        factor = self.shear.friction * ratio  # (1), (3)
        unit = self.shear.unit[name.endswith("y")]
        for row, plane in enumerate(planes):
            if name == "slip_state":
                plane[self.contact] = np.where(self.sticks[self.latest[row]], np.int8(STICK), np.int8(SLIP))
            else:
                plane[self.contact] = self.fields[name[:-2]][row] * factor * unit
        return planes
