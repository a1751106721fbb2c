"""The paper's own method: a dense system on the nodes that may touch, tension nodes dropped in turns.

It is the slow, readable reference for small faces. Under an imposed closure w the nodes of the trial set D
settle by w - gap; the system K f = w - gap on D is solved, nodes in tension leave D, and so on: D only
shrinks, and a few rounds do. For the kernels of a half-space a node that left never comes back; this is
verified at the end, and a node found to overlap is taken back.

A wanted force borders the system with the closure as one more unknown; a free body starts from the nodes
of smallest gap, more of them until the closure found is below the gap of the rest. A wanted closure of a
periodic body, whose mean settlement is a rigid motion, is found by Newton's method on the force: on a fixed
set the two are affine in each other, so that it ends after finitely many steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve as solve_dense

from fractalcontact.base.errors import InvalidInput
from fractalcontact.contact._optimality import residual
from fractalcontact.contact._scaling import Control, Problem, Solution

Array = np.ndarray[Any, np.dtype[Any]]

LARGEST = 8192  # nodes of the dense system: half a gigabyte
GREATEST_ROUNDS = 1000


class Dense:
    """The influence matrix of a body, made for the nodes that are asked for."""

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
            self.table = body.table()

    def matrix(self, rows: Array, columns: Array) -> Array:
        """Settlement of the nodes `rows` under unit pressure on the nodes `columns` (flat indices)."""
        nx = self.shape[1]
        iy = np.abs(rows[:, None] // nx - columns[None, :] // nx)
        ix = np.abs(rows[:, None] % nx - columns[None, :] % nx)
        return np.asarray(self.table[iy, ix])

    def settlement(self, nodes: Array, pressure: Array) -> Array:
        """Settlement of every node."""
        every = np.arange(self.gap.size)
        parts = np.array_split(every, 1 + every.size // 1024)
        return np.concatenate([self.matrix(part, nodes) @ pressure for part in parts])


@dataclass(frozen=True)
class Balance:
    """A set without tension: its nodes, their pressures, and d(closure)/d(sum of pressure)."""

    nodes: Array
    pressure: Array
    closure: float
    rate: float
    rounds: int


def at_closure(dense: Dense, nodes: Array, closure: float) -> Balance:
    """Drop tension nodes from `nodes` under an imposed closure."""
    rounds = 0
    while True:
        rounds += 1
        right = np.stack([closure - dense.gap[nodes], np.ones(nodes.size)], axis=1)
        both = solve_dense(dense.matrix(nodes, nodes), right, assume_a="pos", check_finite=False)
        pressure = both[:, 0]
        if pressure.min() >= 0:
            break
        nodes = nodes[pressure > 0]
    return Balance(nodes, pressure, closure, 1.0 / float(both[:, 1].sum()), rounds)


def at_force(dense: Dense, nodes: Array, total: float) -> Balance:
    """Drop tension nodes from `nodes` while their pressures add up to `total`."""
    rounds = 0
    while True:
        rounds += 1
        n = nodes.size
        matrix = np.ones((n + 1, n + 1))
        matrix[:n, :n] = dense.matrix(nodes, nodes)
        matrix[:n, n], matrix[n, n] = -1.0, 0.0
        right = np.zeros((n + 1, 2))
        right[:n, 0], right[n] = -dense.gap[nodes], (total, 1.0)
        both = solve_dense(matrix, right, check_finite=False)
        pressure = both[:n, 0]
        if pressure.min() >= 0:
            break
        nodes = nodes[pressure > 0]
    return Balance(nodes, pressure, float(both[n, 0]), float(both[n, 1]), rounds)


def verified(dense: Dense, nodes: Array, drop: Callable[[Array], Balance]) -> Balance:
    """Drop from `nodes`, take back what overlaps by more than rounding, until nothing does."""
    rounds = 0
    while True:
        balance = drop(nodes)
        rounds += balance.rounds
        settled = dense.settlement(balance.nodes, balance.pressure)
        gap = dense.gap + settled - balance.closure
        gap[balance.nodes] = 0.0
        noise = 1e-13 * (abs(balance.closure) + float(np.abs(settled).max()))
        overlapping = np.flatnonzero(gap < -noise)
        if overlapping.size == 0 or rounds > GREATEST_ROUNDS:
            return replace(balance, rounds=rounds)
        nodes = np.union1d(balance.nodes, overlapping)


def solve_force(dense: Dense, total: float) -> Balance:
    """Solve for a wanted sum of pressure."""
    order = np.argsort(dense.gap, kind="stable")
    trial = dense.gap.size if dense.periodic else min(64, dense.gap.size)
    while True:
        check_size(trial)
        balance = verified(dense, np.sort(order[:trial]), lambda nodes: at_force(dense, nodes, total))
        if trial == dense.gap.size or balance.closure <= dense.gap[order[trial]]:
            return balance
        trial = min(4 * trial, dense.gap.size)


def solve_closure(dense: Dense, closure: float) -> Balance:
    """Solve for a wanted closure."""
    if not dense.periodic:
        nodes = np.flatnonzero(dense.gap < closure)
        check_size(nodes.size)
        return verified(dense, nodes, lambda nodes: at_closure(dense, nodes, closure))
    check_size(dense.gap.size)
    total = 0.5 * closure / float(dense.table[0, 0])
    nodes, rounds, last = np.arange(dense.gap.size), 0, np.inf
    while True:
        aim = total
        balance = verified(dense, nodes, lambda nodes: at_force(dense, nodes, aim))  # noqa: B023
        rounds += balance.rounds
        same, miss = np.array_equal(nodes, balance.nodes), closure - balance.closure
        rounded = abs(miss) <= 1e-15 * closure or (same and abs(miss) >= 0.5 * last)
        if rounded or rounds > GREATEST_ROUNDS:
            return replace(balance, rounds=rounds)
        nodes, last = balance.nodes, abs(miss)
        total = max(total + miss / balance.rate, total / 16)


def check_size(nodes: int) -> None:
    """Refuse a dense system that would not fit."""
    if nodes > LARGEST:
        expected = f"'fast' for more than {LARGEST} nodes that may touch"
        raise InvalidInput(
            "fractalcontact.contact.press", [f"method: expected {expected}, got 'elimination' with {nodes}"]
        )


class Elimination:
    """The method on one problem; each step starts anew."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.problem, self.tolerance, self.dense = problem, tolerance, Dense(problem)

    def step(self, control: Control) -> Solution:
        """Solve one step of a path."""
        dense = self.dense
        if control.total is not None:
            balance = solve_force(dense, control.total)
        else:
            balance = solve_closure(dense, control.value)
        pressure = np.zeros(dense.gap.size)
        pressure[balance.nodes] = balance.pressure
        settlement = dense.settlement(balance.nodes, balance.pressure)
        gap = dense.gap + settlement - balance.closure
        shape = self.problem.body.shape
        error = residual(pressure, settlement, gap, self.problem.body.spacing)
        reason = "rounding" if balance.rounds <= GREATEST_ROUNDS else "iteration_limit"
        return Solution(
            pressure=pressure.reshape(shape),
            settlement=settlement.reshape(shape),
            closure=balance.closure,
            total=float(balance.pressure.sum()),
            iterations=balance.rounds,
            residual=error,
            reason="converged" if error <= self.tolerance else reason,
            work=float(np.sum(pressure * settlement)),
        )
