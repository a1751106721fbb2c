"""Cold start by nested iteration: the same problem on coarser grids, coarse to fine.

Most iterations of a cold start on the fine grid would be spent on finding out which part of the surface
touches at all. On a grid of half the points along each axis that is four times cheaper, and so on down. The
solution of each grid is the start on the next finer one: nested iteration in the multigrid literature, and
for contact the cascade multi-resolution of Bemporad and Paggi (2015), "Optimization algorithms for the
solution of the frictionless normal contact between rough surfaces", Int. J. Solids Struct. 69-70:94-105.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.grid import UNIFORM
from fractalcontact.contact import _influence
from fractalcontact.contact._constrained_cg import ConstrainedCG
from fractalcontact.contact._contact_system import ContactSystem
from fractalcontact.contact._scaled_problem import Body, Control, Problem

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 64  # points along an axis that is not halved any more: below, a coarser grid costs what it saves
# of the area, over nominal pressure / (E* rms slope): theories have 1.6 to 2.5 (page theory_contact)
# and 1 and 9 took 3 % more transforms
CONTACT_SHARE = 3.0
COARSE_TOLERANCE = 0.1  # residual on a coarse grid: from 0.2 on the finest grid takes more iterations


def cold_start(problem: Problem, control: Control, dtype: Any) -> tuple[Array, float]:
    """Return a pressure to start from on the grid of `problem`, and roughly the closure to expect."""
    factors = tuple(2 if n >= 2 * SMALLEST else 1 for n in problem.body.shape)
    if factors == (1, 1):
        if control.closure is None:
            return bearing_start(problem, float(control.value), dtype)
        return np.maximum(control.closure - problem.gap, 0.0).astype(dtype), control.closure
    coarse = coarsen(problem, factors)
    share = coarse.gap.size / problem.gap.size
    coarse_control = Control(None if control.force is None else control.force * share, control.closure)
    start = cold_start(coarse, coarse_control, dtype)[0]
    system = ContactSystem.on_plane(coarse, dtype)
    solution = ConstrainedCG(system, coarse_control, start).solve(COARSE_TOLERANCE, certify=False)
    pressure = solution.pressure.astype(dtype)
    ny, nx = problem.body.shape
    finer = np.repeat(np.repeat(pressure, factors[0], axis=0), factors[1], axis=1)[:ny, :nx]
    return finer, solution.closure


def bearing_start(problem: Problem, force: float, dtype: Any) -> tuple[Array, float]:
    """Return the root of the overlap with a plane that cuts off the area of a rough contact, and that plane.

    Theories have a real contact area proportional to the pressure over modulus and rms slope; the root is the
    profile of a contact of Hertz. From uniform pressure a solution takes a quarter to a half more transforms.
    """
    gap, size = problem.gap, problem.gap.size
    square = sum(
        float(np.mean(np.square(np.diff(gap, axis=axis) / spacing)))
        for axis, spacing in enumerate(problem.body.spacing)
    )
    share = CONTACT_SHARE * force / size / np.sqrt(square) if square > 0 else 1.0
    count = max(1, int(min(share, 1.0) * (size - 1)))
    plane = float(np.partition(gap, count, axis=None)[count])
    pressure = np.sqrt(np.maximum(plane - gap, 0.0)).astype(dtype)
    return pressure if pressure.any() else np.ones(gap.shape, dtype=dtype), plane


def coarsen(problem: Problem, factors: tuple[int, ...]) -> Problem:
    """Return the problem of the mean gap over cells of `factors` nodes; the extent stays what it is.

    A last node without neighbour is its own mean.
    """
    body, (fy, fx) = problem.body, factors
    padded = np.pad(problem.gap, [(0, -n % f) for n, f in zip(body.shape, factors, strict=True)], mode="edge")
    ny, nx = padded.shape[0] // fy, padded.shape[1] // fx
    gap = padded.reshape(ny, fy, nx, fx).mean(axis=1).mean(axis=2)
    spacing = (body.spacing[0] * body.shape[0] / ny, body.spacing[1] * body.shape[1] / nx)
    coarse = Body((ny, nx), spacing, body.periodic, body.influence, coarse_radius(body, spacing))
    return Problem(coarse, gap, problem.p_max)


def coarse_radius(body: Body, spacing: tuple[float, float]) -> float:
    """Return the plate radius on a coarse grid: of second order where there is one, else inscribed."""
    if body.influence != "disc":
        return 0.0
    ratio = max(spacing) / min(spacing)
    second_order = ratio <= _influence.GREATEST_RATIO * (1 + UNIFORM)
    return _influence.disc_radius("second_order" if second_order else "inscribed", spacing)
