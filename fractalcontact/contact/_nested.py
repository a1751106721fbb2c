"""A start from nothing: the same problem on coarser grids, each the start of the next finer one.

Most iterations of a cold start on the fine grid would go into finding out which part of the surface touches
at all. On grids of half the points along each axis that is four times cheaper, and so on down.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.grid import UNIFORM
from fractalcontact.contact import _influence
from fractalcontact.contact._plane import plane_descent
from fractalcontact.contact._scaling import Body, Control, Problem

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 32  # points along an axis that is not halved any more
ENOUGH = 2e-2  # residual on a coarse grid


def cold_start(problem: Problem, control: Control, kind: Any) -> tuple[Array, float]:
    """Pressure to start from on the grid of `problem`, and about which closure to expect."""
    factors = tuple(2 if n >= 2 * SMALLEST else 1 for n in problem.body.shape)
    if factors == (1, 1):
        if control.closure is None:
            return np.ones(problem.body.shape, dtype=kind), float(problem.gap.max())
        return np.maximum(control.closure - problem.gap, 0.0).astype(kind), control.closure
    coarse = coarser(problem, factors)
    share = coarse.gap.size / problem.gap.size
    fewer = Control(None if control.total is None else control.total * share, control.closure)
    start = cold_start(coarse, fewer, kind)[0]
    solution = plane_descent(coarse, kind).solve(start, fewer, ENOUGH, certify=False)
    pressure = solution.pressure.astype(kind)
    ny, nx = problem.body.shape
    finer = np.repeat(np.repeat(pressure, factors[0], axis=0), factors[1], axis=1)[:ny, :nx]
    return finer, solution.closure


def coarser(problem: Problem, factors: tuple[int, ...]) -> Problem:
    """Mean gap over cells of `factors` nodes; the extent stays what it is."""
    body = problem.body
    shape = (-(-body.shape[0] // factors[0]), -(-body.shape[1] // factors[1]))
    spacing = (
        body.spacing[0] * body.shape[0] / shape[0],
        body.spacing[1] * body.shape[1] / shape[1],
    )
    gap = problem.gap
    for axis, factor in enumerate(factors):
        if factor > 1:
            starts = np.arange(0, gap.shape[axis], factor)
            members = np.diff(np.append(starts, gap.shape[axis]))
            gap = np.add.reduceat(gap, starts, axis=axis) / np.expand_dims(members, 1 - axis)
    return Problem(
        Body(shape, spacing, body.periodic, body.influence, _plate(body, spacing)), gap, problem.cap
    )


def _plate(body: Body, spacing: tuple[float, float]) -> float:
    """Radius of the plates on the coarse grid: second order where there is one, else touching."""
    if body.influence != "disc":
        return 0.0
    ratio = max(spacing) / min(spacing)
    second = ratio <= _influence.GREATEST_RATIO * (1 + UNIFORM)
    return _influence.disc_radius("second_order" if second else "inscribed", spacing)
