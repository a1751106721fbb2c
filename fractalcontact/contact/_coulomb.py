"""Coulomb friction under a given pressure, with the tangential displacements of both directions coupled.

At the nodes in contact the traction q = (q_x, q_y) minimises

    f(q) = q K q / 2 + q s0,    |q| <= b = mu p,    sum q = Q,                                     (1)

s0 the slip before the step. That is one implicit step of Coulomb's law: with the displacement delta of the
upper body, the multiplier of the sum, the gradient g = K q + s0 - delta is zero where the surfaces stick, and
-g, the slip of the step, is parallel to q where they slip. The minimum is unique. The residual is

    sum (g q + b |g|),                                                                             (2)

the gap between (1) and its dual, which bounds the error of f; it is zero for the solution only.

Each iteration is a step of Newton's method on the sets of sticking and slipping nodes of the last one, a
semismooth Newton method or primal-dual active set (Hintermueller, Ito and Kunisch 2003, SIAM J. Optim.
13:865; for friction Alart and Curnier 1991, Comput. Methods Appl. Mech. Eng. 92:353):

    (3)  sticking nodes are free, slipping ones move along their circle, which adds the compliance |g|/b;
         the linear system is solved by conjugate gradients, only as well as the step deserves
    (4)  a node slips next if q - g/(compliance of a node) is outside of its circle
    (5)  traction beyond the circles is put back on them; a constant times b restores the sum

It starts from the superposition, in later steps from its change, whose sets are nearly right, and takes five
to eight iterations (in large contacts sometimes more, while sets of nodes change slowly) with two or
three conjugate gradients each. Where a step of (3) hardly lowers the residual, a quarter of it is tried.
Where no constant restores the sum, the traction is projected onto the bounds and the sum: 6927 steps on 1350
random contacts (nu -.5 to .5, up to .99999 of sliding) all converged. Shorter steps in its place, and in the
end one along the gradient (4 in 2352), took 3 % more transforms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.schema import SLIP, STICK
from fractalcontact.contact._load_path import Step
from fractalcontact.contact._tangential_operator import TangentialOperator, TangentialPreconditioner

# relative distance from the circle at which a node is on it; 1e-14 gave the same bits on rough contacts
AT_BOUND = 1e-12
# relative determinant from which all slipping nodes move along one line; 1e-14 and 1e-9 gave the same bits
PARALLEL = 1e-12


@dataclass
class CoulombState:
    """Traction q and displacement u of the surface (2, nodes), that of the upper body, and what they miss."""

    q: Array
    u: Array
    g: Array
    slips: Array
    displacement: Array
    objective: float
    residual: float
    iterations: int = 0
    converged: bool = False

    @property
    def direction(self) -> Array:
        """Direction of the traction where it slips, zero where it sticks."""
        return np.where(self.slips, self.q / np.where(self.slips, np.hypot(*self.q), 1.0), 0.0)

    @property
    def compliance(self) -> Array:
        """The compliance |g|/b that a circle adds across the traction (3)."""
        outward = -np.sum(self.g * self.direction, axis=0)
        return np.where(self.slips, outward / np.where(self.slips, np.hypot(*self.q), 1.0), 0.0)

    @property
    def slip(self) -> Array:
        """Slip in the step: exactly zero where it sticks, and nowhere against the traction."""
        return np.where(self.slips, -self.g, 0.0)


class CoulombSolver:
    """Solves (1) step by step on one contact; residuals are (2) over `scale`."""

    def __init__(self, operator: TangentialOperator, bound: Array, scale: float, tolerance: float) -> None:
        self.operator, self.bound, self.scale, self.tolerance = operator, bound, scale, tolerance
        self.node_stiffness = operator.node_stiffness

    def step(
        self,
        slip: Array,
        force: Array,
        start: Array,
        *,
        max_iterations: int = 100,  # 192 steps on rough contacts took 22 conjugate gradients at most in all
    ) -> CoulombState:
        """Minimise (1) with the slip before the step, from a traction `start`."""
        q = project(start, self.bound, force)
        state, iterations = self.evaluate(q, self.operator.apply(q), slip), 0
        for _ in range(max_iterations):
            if state.residual <= self.tolerance:
                break
            better, inner = self.newton_step(state, slip, force)
            iterations += inner
            if better is None:
                break
            state = better
        state.iterations, state.converged = iterations, state.residual <= self.tolerance
        return state

    def evaluate(self, q: Array, u: Array, slip: Array) -> CoulombState:
        """Return the state of a traction that meets the bounds, with its sets and residual."""
        v = u + slip
        size = np.hypot(*q)
        on_circle = size >= self.bound * (1 - AT_BOUND)
        slips = on_circle
        for _ in range(2):  # a node on its circle that is drawn inwards sticks; once: .3 % more transforms
            direction = np.where(slips, q / np.where(slips, size, 1.0), 0.0)
            displacement = multiplier(v, self.bound, direction)
            g = v - displacement[:, None]
            slips = on_circle & (np.sum(g * q, axis=0) < 0)
        residual = float(np.sum(g * q) + np.sum(self.bound * np.hypot(*g))) / self.scale
        objective = float(np.sum(q * (u / 2 + slip)))
        return CoulombState(q, u, g, slips, displacement, objective, residual)

    def newton_step(
        self,
        state: CoulombState,
        slip: Array,
        force: Array,
        *,
        forcing: float = 0.1,  # with .3 and more some steps fail and cost more
        forcing_growth: float = 100.0,  # faster than linear convergence; 10 took 3 % more transforms
        last_share: float = 0.3,  # .1 took 2 % more, .9 took 3 % less
        slow: float = 0.7,  # .4 and .95 took the same transforms
        max_cuts: int = 3,  # 1 and 5 took the same transforms on rough contacts
    ) -> tuple[CoulombState | None, int]:
        """Take a step of (3) to (5); None if no share of it is better. Also the conjugate gradients.

        (3) leaves the part `forcing` of the residual, less once that is small, and the part `last_share` of
        the tolerance. While the residual stays above `slow` of the last one a quarter of the step is tried.
        """
        part = min(forcing, forcing_growth * state.residual)
        goal = max(part * state.residual, last_share * self.tolerance) * self.scale
        direction = state.direction
        system = TangentSystem(self.operator, direction, state.compliance)
        d, moved, inner = system.solve(-state.g, np.eye(2), lambda r, _: self.size(r) <= goal)
        share = 1.0
        best: CoulombState | None = None
        for _ in range(max_cuts + 1):
            y, v = state.q + share * d, state.u + slip + share * moved
            g = v - multiplier(v, self.bound, direction)[:, None]
            z = y - share * self.node_stiffness * g
            size = np.hypot(*z)
            slips = size > self.bound  # (4)
            y = np.where(slips & ~state.slips, z * (self.bound / np.where(slips, size, 1.0)), y)
            q = restore_sum(y, self.bound, force, slips)  # (5)
            trial = self.evaluate(q, self.operator.apply(q), slip)
            # by more than the rounding of the sum over the nodes; 0 and 1e-11 took the same steps
            lower = trial.objective < state.objective - 1e-14 * abs(state.objective)
            if best is not None and not trial.residual < best.residual:
                break
            if lower or trial.residual < state.residual:
                best = trial
            if trial.residual < slow * state.residual:
                break
            share /= 4
        return best, inner

    def size(self, r: Array) -> float:
        """Return the part of the residual that an error r of the displacement makes."""
        return float(np.sum(self.bound * np.hypot(*r)))

    def stiffness(
        self,
        state: CoulombState,
        unit: Array,
        *,
        forcing: float = 0.01,  # of the root of its error; .001 took 7 % more transforms, .1 took 8 % less
    ) -> float:
        """Return the increment of force along `unit` over that of displacement, without force across.

        The sticking nodes move as one, and the slipping ones along their circles.
        """
        system = TangentSystem(self.operator, state.direction, state.compliance)
        across = np.array([[-unit[1]], [unit[0]]])
        right = unit[:, None] * np.ones_like(state.q)
        d, _, _ = system.solve(right, across, lambda _, fall: fall <= forcing)
        return float(d.sum(1) @ unit)


class TangentSystem:
    """K + C on the changes of traction across `direction` where it is not zero, and on all others."""

    def __init__(self, operator: TangentialOperator, direction: Array, compliance: Array) -> None:
        self.operator, self.direction, self.compliance = operator, direction, compliance
        self.preconditioner = TangentialPreconditioner(operator, direction, compliance)

    def solve(
        self,
        right: Array,
        fixed: Array,
        is_solved: Any,
        *,
        max_iterations: int = 40,  # 7 at most in the same 192 steps: it ends what does not converge
    ) -> tuple[Array, Array, int]:
        """Solve (K + C) d = right by preconditioned conjugate gradients; return d, K d and the iterations.

        The columns of `fixed` (2, n) are the directions in which the sum of d is zero. Stops once
        `is_solved(r, fall)`, with the residual r and its fall in the norm of the preconditioner. Symbols are
        those of `_constrained_cg`: t search direction, z preconditioned residual, tau step length.
        """
        direction, operator = self.direction, self.operator
        # K + C is symmetric and positive, but a step has two constraints: no change along the traction of a
        # slipping node, and none of the sum. Projection P of every vector keeps both exactly, so that CG runs
        # on P (K + C) P. A constant c, less its part along the slipping directions, sums to `gram` c; that
        # gives the c which takes a sum away.
        gram = np.eye(2) * direction.shape[1] - _products(direction, direction)
        inverse = fixed @ np.linalg.pinv(fixed.T @ gram @ fixed) @ fixed.T

        def project_out(v: Array) -> Array:
            v = v - direction * np.sum(direction * v, axis=0)
            c = (inverse @ v.sum(1))[:, None]
            return np.asarray(v - (c - direction * np.sum(direction * c, axis=0)))

        d, moved = np.zeros_like(right), np.zeros_like(right)
        r = project_out(right)
        z = project_out(self.preconditioner.apply(r))
        t, rz = z, float(np.sum(r * z))
        first = rz
        for iteration in range(max_iterations):
            if rz <= 0:  # nothing is left but rounding
                return d, moved, iteration
            kt = operator.apply(t)
            ht = project_out(kt + self.compliance * t)
            tau = rz / float(np.sum(t * ht))
            d += tau * t
            moved += tau * kt  # K d comes with it, and saves a transform of both planes
            r = r - tau * ht
            if is_solved(r, math.inf):  # before the preconditioner, which costs as much as the operator
                return d, moved, iteration + 1
            z = project_out(self.preconditioner.apply(r))
            rz, old = float(np.sum(r * z)), rz
            if is_solved(r, math.sqrt(max(rz, 0.0) / first)):
                return d, moved, iteration + 1
            t = z + rz / old * t
        return d, moved, max_iterations


def multiplier(v: Array, bound: Array, direction: Array) -> Array:
    """Return the displacement delta that v should have where nodes stick, and across the slipping ones.

    The mean weighted by the bound. Where all slip along one line, the displacement along it is the greatest
    of the nodes, so that all of them slip forward.
    """
    gram = np.eye(2) * bound.sum() - _products(direction * bound, direction)
    right = (bound * (v - direction * np.sum(direction * v, axis=0))).sum(1)
    if np.linalg.det(gram) > PARALLEL * bound.sum() ** 2:
        return np.asarray(np.linalg.solve(gram, right))
    line = direction.sum(1) / np.hypot(*direction.sum(1))
    across = np.array([-line[1], line[0]])
    mean = float((bound * (across @ v)).sum() / bound.sum())
    return np.asarray(line * float((line @ v).max()) + across * mean)


def restore_sum(y: Array, bound: Array, force: Array, slips: Array) -> Array:
    """Return traction on the circles where it slips and inside elsewhere, with the sum `force` (5).

    y + b c, put on the circles or clipped to them, c after Newton; the projection of y where there is no such
    c near zero.
    """
    c, start = np.zeros(2), y / bound
    goal = 1e-15 * float(bound.sum())  # rounding of the sum; 1e3 times as much is still far below a tolerance
    for _ in range(20):  # Newton's method from a sum that is nearly right; 10 gave the same bits, 5 not
        x = start + c[:, None]
        size = np.hypot(*x)
        on_circle = slips | (size > 1)
        factor = bound / np.where(on_circle & (size > 0), size, 1.0)
        q = factor * x
        miss = q.sum(1) - force
        if np.abs(miss).max() <= goal:
            return np.asarray(q)
        unit = np.where(on_circle & (size > 0), x / np.where(size > 0, size, 1.0), 0.0)
        jacobian = np.eye(2) * factor.sum() - _products(factor * unit, unit)
        if not np.linalg.det(jacobian) > PARALLEL * bound.sum() ** 2:
            break
        c = c - np.linalg.solve(jacobian, miss)
        if not np.abs(c).max() < 1:  # far from a sum that is nearly right; .1 and 10 took .6 and 2 % more
            break
    return np.asarray(q) if np.abs(miss).max() <= 1e3 * goal else project(y, bound, force)


def project(y: Array, bound: Array, force: Array) -> Array:
    """Return the nearest traction with |q| <= bound and the sum `force`: clip(y + c), c after Newton."""
    c = np.zeros(2)
    value, q, jacobian = _clipped(y, c, bound, force)
    # rounding of the sum; on 8 rough contacts 1e-13 took the same transforms, 1e-16 is not reached. 20 steps
    # and 1000, and steps down to 1e-5 and to 1e-14, gave the same bits
    goal = 1e-15 * max(float(np.abs(force).max()), float(bound.sum()))
    for _ in range(100):
        miss = q.sum(1) - force
        if np.abs(miss).max() <= goal:
            break
        jacobian[0, 0] += 1e-12 * bound.size  # it is singular where all are clipped; 1e-15 and 1e-9 took as
        jacobian[1, 1] += 1e-12 * bound.size  # many transforms
        move = -np.linalg.solve(jacobian, miss)
        step = 1.0
        while True:
            trial = _clipped(y, c + step * move, bound, force)
            # the sufficient decrease of Nocedal and Wright (2006), sec. 3.1; 1e-2 gave the same bits
            falls = trial[0] <= value + 1e-4 * step * float(miss @ move)
            # near the root rounding hides the fall of the potential, not that of its gradient
            if falls or np.hypot(*(trial[1].sum(1) - force)) < np.hypot(*miss) / 2 or step < 1e-10:
                break
            step /= 2
        if step < 1e-10:
            break
        c = c + step * move
        value, q, jacobian = trial
    return q


def _clipped(y: Array, c: Array, bound: Array, force: Array) -> tuple[float, Array, Array]:
    """Return the potential whose gradient is sum clip(y + c) - force, the clipped traction, the Jacobian."""
    z = y + c[:, None]
    size = np.hypot(*z)
    outside = size > bound
    factor = np.where(outside, bound / np.where(outside, size, 1.0), 1.0)
    potential = np.where(outside, bound * size - bound**2 / 2, size**2 / 2).sum() - float(c @ force)
    unit = z / np.where(size > 0, size, 1.0) * outside
    jacobian = np.diag([factor.sum()] * 2) - _products(factor * unit, unit)
    return float(potential), z * factor, jacobian


def _products(a: Array, b: Array) -> Array:
    """Return a b^T, summed by numpy: the bits of a library product may depend on the number of threads."""
    return np.array([[np.sum(row * column) for column in b] for row in a])


def shifted_start(last: CoulombState | None, starts: Array, bound: Array, unit: Array, force: Array) -> Array:
    """Return the last traction, changed as the superposition is from one row of `starts` to the next.

    A node at its bound in the superposition stays on its circle. In the first step the superposition itself.
    """
    if last is None:
        return np.asarray(unit[:, None] * starts[-1])
    moved = last.q + unit[:, None] * (starts[1] - starts[0])
    slips = np.abs(starts[1]) >= bound * (1 - AT_BOUND)
    return restore_sum(moved, bound, force, slips)


def coulomb_path(
    normal: Step,
    operator: TangentialOperator,
    forces: Array,
    starts: Array,
    friction: float,
    unit: Array,
    columns: dict[str, Array],
    maps: dict[str, Array],
) -> None:
    """Solve a path of tangential forces (N) along `unit` and write its columns and maps (step, ny, nx).

    `starts` (step, nodes) is the traction along `unit` to start from, in Pa; `columns` are those of the
    solutions that it took, to which the work of this method is added.
    """
    contact, units = normal.contact, normal.path.units
    bound = friction * normal.solution.pressure[contact]
    force, poisson = normal.solution.force, operator.poisson
    mean_displacement = max(normal.solution.work / force, force * normal.problem.local_compliance)
    # that of the normal solution, times mu^2 and the ratio of the compliances
    scale = friction * friction * (2 - poisson) / (2 - 2 * poisson) * force * mean_displacement
    solver = CoulombSolver(operator, bound, scale, normal.path.tolerance)
    slip, dissipated = np.zeros((2, bound.size)), 0.0
    cell, state = units.cell_area * units.length**2, None
    for row, tangential in enumerate(forces.tolist()):
        start, transforms = perf_counter(), operator.transforms
        if state is not None and tangential == forces[row - 1]:  # a pause is no step
            state = replace(state, iterations=0)
        else:
            target = unit * (tangential / units.force)
            near = starts[max(row - 1, 0) : row + 1] / units.pressure
            guess = shifted_start(state, near, bound, unit, target)
            state = solver.step(slip, target, guess)
            dissipated += float(np.sum(state.q * state.slip))
            slip = slip + state.slip
        all_stick = contact.all() and not state.slips.any()
        rigid = operator.body.periodic and all_stick
        stiffness = math.inf if rigid else solver.stiffness(state, unit) * units.force / units.height
        slip_area = np.count_nonzero(state.slips) * cell
        for name, value in (
            ("tangential_displacement", float(state.displacement @ unit) * units.height),
            ("tangential_stiffness", stiffness),
            ("slip_area", slip_area),
            ("stick_area", state.slips.size * cell - slip_area),
            ("dissipated_energy", dissipated * units.energy),
            ("residual", max(normal.solution.residual, state.residual)),
            ("converged", normal.solution.reason == "converged" and state.converged),
            ("iterations", columns["iterations"][row] + state.iterations),
            ("transforms", columns["transforms"][row] + operator.transforms - transforms),
            ("run_time", columns["run_time"][row] + perf_counter() - start),
        ):
            columns[name][row] = value
        fields = {"traction": state.q * units.pressure, "slip": slip * units.height}
        for name, planes in maps.items():
            if name == "slip_state":
                planes[row][contact] = np.where(state.slips, np.int8(SLIP), np.int8(STICK))
            else:
                planes[row][contact] = fields[name[:-2]][int(name.endswith("y"))]
