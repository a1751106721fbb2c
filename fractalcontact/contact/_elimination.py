"""Elimination: the dense active set method of Borri-Brunetto, Carpinteri and Chiaia (1998).

It is the slow, readable reference for small surfaces. Under an imposed closure w the nodes of the trial set D
are displaced by w - h; the system K p = w - h on D is solved, nodes in tension leave D, and so on: D only
shrinks, and a few rounds suffice. For the kernels of a half-space a node that left never comes back; this is
verified at the end, and a node found to overlap is taken back.

An imposed force adds the closure as one more unknown to the system. A free body starts from the nodes of
smallest gap, more of them until the closure is below the gap of the rest. An imposed closure of a periodic
body, whose mean displacement is a rigid motion, is found by Newton's method on the force: on a fixed set the
two are affine in each other, so that it ends after finitely many steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import solve as solve_dense

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.numbers import Array
from fractalcontact.contact._problem import Control, Problem, Solution

# of one step: each round removes a node at least, and a dozen are usual; a step that takes more is reported
# as "iteration_limit"
MAX_ROUNDS = 1000


class Elimination:
    """The method on one problem; each step starts anew."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.problem, self.tolerance, self.matrix = problem, tolerance, InfluenceMatrix(problem)

    def solve(self, control: Control, guess: Array | None = None) -> Solution:  # noqa: ARG002
        """Solve one step of a path; it always starts from all nodes that may touch."""
        matrix = self.matrix
        if control.force is not None:
            balance = solve_force(matrix, control.force)
        else:
            balance = solve_closure(matrix, control.value)
        pressure = np.zeros(matrix.gap.size)
        pressure[balance.nodes] = balance.pressure
        displacement = matrix.displacement(balance.nodes, balance.pressure)
        gap = matrix.gap + displacement - balance.closure
        shape = self.problem.body.shape
        error = residual(pressure, displacement, gap, self.problem.body.spacing)
        reason = "converged" if error <= self.tolerance else "rounding"
        return Solution(
            pressure=pressure.reshape(shape),
            displacement=displacement.reshape(shape),
            closure=balance.closure,
            force=float(balance.pressure.sum()),
            iterations=balance.rounds,
            residual=error,
            reason=reason if balance.rounds <= MAX_ROUNDS else "iteration_limit",
            work=float(np.sum(pressure * displacement)),
            solver="elimination",
        )


class InfluenceMatrix:
    """The influence matrix of a body, built for the nodes that are asked for."""

    def __init__(self, problem: Problem) -> None:
        body = problem.body
        self.gap = problem.gap.ravel()
        self.shape = body.shape
        self.periodic = body.periodic
        if body.periodic:
            unit = np.zeros(body.shape)
            unit[0, 0] = 1.0
            self.table = body.operator().apply(unit)
        else:
            self.table = body.influence_table()

    def between(self, rows: Array, columns: Array) -> Array:
        """Return the displacement of the nodes `rows` under unit pressure on `columns` (flat indices)."""
        nx = self.shape[1]
        iy = np.abs(rows[:, None] // nx - columns[None, :] // nx)
        ix = np.abs(rows[:, None] % nx - columns[None, :] % nx)
        return np.asarray(self.table[iy, ix])

    def displacement(self, nodes: Array, pressure: Array) -> Array:
        """Return the displacement of every node."""
        all_nodes = np.arange(self.gap.size)
        # rows at once, so that no matrix of all pairs is made; 128 and 8192 gave the same bits
        parts = np.array_split(all_nodes, 1 + all_nodes.size // 1024)
        return np.concatenate([self.between(part, nodes) @ pressure for part in parts])


@dataclass(frozen=True)
class Balance:
    """A set of nodes without tension: their pressures, the closure, and d(closure)/d(sum of pressure)."""

    nodes: Array
    pressure: Array
    closure: float
    rate: float
    rounds: int


Solver = Callable[[Array], tuple[Array, float, float]]  # of a set of nodes: pressures, closure and rate


def solve_at_closure(influence: InfluenceMatrix, nodes: Array, closure: float) -> tuple[Array, float, float]:
    """Return pressures, closure and rate of all these nodes in contact, under an imposed closure."""
    right = np.stack([closure - influence.gap[nodes], np.ones(nodes.size)], axis=1)
    solution = solve_dense(influence.between(nodes, nodes), right, assume_a="pos", check_finite=False)
    return solution[:, 0], closure, 1.0 / float(solution[:, 1].sum())


def solve_at_force(influence: InfluenceMatrix, nodes: Array, force: float) -> tuple[Array, float, float]:
    """Return the same where the pressures add up to `force`; the closure is an unknown."""
    n = nodes.size
    matrix, right = np.ones((n + 1, n + 1)), np.zeros((n + 1, 2))
    matrix[:n, :n] = influence.between(nodes, nodes)
    matrix[:n, n], matrix[n, n] = -1.0, 0.0
    right[:n, 0], right[n] = -influence.gap[nodes], (force, 1.0)
    solution = solve_dense(matrix, right, check_finite=False)
    return solution[:n, 0], float(solution[n, 0]), float(solution[n, 1])


def eliminate_and_restore(influence: InfluenceMatrix, nodes: Array, solve_on: Solver) -> Balance:
    """Eliminate the nodes in tension, take back what overlaps by more than rounding, until nothing does."""
    rounds = 0
    while True:
        pressure, closure, rate = solve_on(nodes)
        rounds += 1
        if pressure.min() < 0 and rounds <= MAX_ROUNDS:
            nodes = nodes[pressure > 0]
            continue
        displacement = influence.displacement(nodes, pressure)
        gap = influence.gap + displacement - closure
        gap[nodes] = 0.0
        # 1e-15 and 1e-11 gave the same bits in 558 steps on random surfaces
        noise = 1e-13 * (abs(closure) + float(np.abs(displacement).max()))
        overlapping = np.flatnonzero(gap < -noise)
        if overlapping.size == 0 or rounds > MAX_ROUNDS:
            return Balance(nodes, pressure, closure, rate, rounds)
        nodes = np.union1d(nodes, overlapping)


def solve_force(influence: InfluenceMatrix, force: float) -> Balance:
    """Solve for an imposed sum of pressure."""
    order = np.argsort(influence.gap, kind="stable")
    # 16 to 256 first nodes, and 2 to 16 times more then, gave the same bits in 558 steps on random surfaces
    trial = influence.gap.size if influence.periodic else min(64, influence.gap.size)
    while True:
        check_size(trial)
        nodes = np.sort(order[:trial])
        balance = eliminate_and_restore(influence, nodes, partial(solve_at_force, influence, force=force))
        if trial == influence.gap.size or balance.closure <= influence.gap[order[trial]]:
            return balance
        trial = min(4 * trial, influence.gap.size)


def solve_closure(influence: InfluenceMatrix, closure: float) -> Balance:
    """Solve for an imposed closure."""
    if not influence.periodic:
        nodes = np.flatnonzero(influence.gap < closure)
        check_size(nodes.size)
        return eliminate_and_restore(influence, nodes, partial(solve_at_closure, influence, closure=closure))
    check_size(influence.gap.size)
    force = 0.5 * closure / float(influence.table[0, 0])  # .01 and 5 took 7 % more and 9 % fewer rounds
    nodes, rounds, last = np.arange(influence.gap.size), 0, np.inf
    while True:
        balance = eliminate_and_restore(influence, nodes, partial(solve_at_force, influence, force=force))
        rounds += balance.rounds
        same_set, miss = np.array_equal(nodes, balance.nodes), closure - balance.closure
        # 1e-14 gave the same bits in 18 steps, 1e-16 is not always reached; .25 and .9 gave the same bits
        rounded = abs(miss) <= 1e-15 * closure or (same_set and abs(miss) >= 0.5 * last)
        if rounded or rounds > MAX_ROUNDS:
            return replace(balance, rounds=rounds)
        nodes, last = balance.nodes, abs(miss)
        # near full contact the rate is almost 0; a quarter and a hundredth gave the same bits
        force = max(force + miss / balance.rate, force / 16)


def check_size(nodes: int, *, most: int = 8192) -> None:  # a matrix of half a gigabyte
    """Refuse a dense system that would not fit.

    `press` cannot check this beforehand: under an imposed force the number of nodes that may touch is known
    only once the closure is.
    """
    if nodes > most:
        problem = f"method: expected 'fast' for more than {most} nodes that may touch, got 'elimination' with"
        raise InvalidInput("fractalcontact.contact.press", [f"{problem} {nodes}"])


def residual(pressure: Array, displacement: Array, gap: Array, spacing: tuple[float, float]) -> float:
    """Return the scale-free residual of a pressure.

    It is step (2) of `_constrained_cg`, written a second time on purpose: a check of the fast method must
    not share its code.
    """
    force = float(pressure.sum())
    overlap = max(0.0, -float(np.min(gap, initial=0.0)))
    if force <= 0:
        return 0.0 if overlap == 0 else 1.0
    open_gap = float(np.sum(pressure * np.maximum(gap, 0.0))) / force
    weighted = float(np.sum(pressure * displacement)) / force
    local = force / pressure.size * float(np.sqrt(spacing[0] * spacing[1]))
    return (open_gap + overlap) / max(weighted, local)
