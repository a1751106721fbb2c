"""The flat block: two perfectly mating surfaces pressed together, and their stiffness.

The pressure under a unit force is solved once for each geometry and kept, because the bulk part of the
closure of every surface of that extent needs it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base.grid import DECADES, Grid
from fractalcontact.base.numbers import as_array, float_array
from fractalcontact.base.validation import Problems
from fractalcontact.contact._problem import (
    BOUNDARIES,
    Body,
    ContactOptions,
    Control,
    Problem,
    Solution,
    length_unit,
    mean_by_rows,
    scaled_body,
)


def flat_stiffness(
    shape: tuple[int, int],
    spacing: float | tuple[float, float],
    *,
    contact_modulus: float,
    boundary: str = "free",
    influence: str | None = None,
    disc_radius: str = "second_order",
    loading: str = "rigid",
) -> float:
    """Stiffness of a block with two perfectly mating surfaces: force per closure.

    The bulk part of a closure is force / stiffness; `press` returns exactly that for a flat surface.

    Parameters
    ----------
    shape : (ny, nx)
        Points along each axis.
    spacing : float or (dy, dx)
        Spacing in m.
    contact_modulus : float
        E* of the pair in Pa.
    boundary, influence, disc_radius
        As for `press`.
    loading : {"rigid", "uniform"}
        "rigid": the closure is the same everywhere, as between rigid flats; "uniform": the pressure is the
        same everywhere, and the closure is the mean displacement.

    Returns
    -------
    float
        Stiffness in N/m, solved to 1e-13; infinite for periodic bodies, whose mean displacement is a rigid
        motion.

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call.

    Notes
    -----
    A square of edge L has 1.15230 E* L (rigid; the capacitance of the unit square, Read 1997) or
    E* L/0.9464020 (uniform) in the limit of small spacing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> round(fc.contact.flat_stiffness((64, 64), 1 / 64, contact_modulus=1.0, loading="uniform"), 3)
    1.056
    """
    with Problems("fractalcontact.contact.flat_stiffness") as problems:
        problems.number("contact_modulus", contact_modulus, above=0)
        has_boundary = problems.choice("boundary", boundary, BOUNDARIES)
        problems.choice("loading", loading, ("rigid", "uniform"))
        is_pair = getattr(as_array(shape), "shape", None) == (2,)
        has_shape = problems.require(is_pair, "shape", "(ny, nx)", shape)
        has_shape = has_shape and all(problems.integer("shape", n, at_least=3) for n in shape)
        has_spacing = problems.numbers("spacing", spacing, above=0, at_most=10.0**DECADES)
        if has_spacing:
            one_or_two = float_array(spacing).size in (1, 2)
            has_spacing = problems.require(one_or_two, "spacing", "one length or (dy, dx)", spacing)
        # without the boundary, which is checked above: here it may not be None
        options = problems.construct(ContactOptions, influence=influence, disc_radius=disc_radius)
        if has_boundary and has_shape and has_spacing and options is not None:
            replace(options, boundary=boundary).check_grid(_grid(shape, spacing, boundary), problems)
    options = ContactOptions(boundary, influence, disc_radius)
    return block_stiffness(_grid(shape, spacing, boundary), float(contact_modulus), options, loading)


def block_stiffness(
    grid: Grid, contact_modulus: float, options: ContactOptions, loading: str = "rigid"
) -> float:
    """Return the stiffness (N/m) of the flat block on a grid, see `flat_stiffness`."""
    body = scaled_body(grid, options)
    compliance = flat_block(body).closure if loading == "rigid" else uniform_compliance(body)
    if compliance == 0:
        return math.inf
    return float(contact_modulus * length_unit(grid) * body.cell_area / compliance)


def _grid(shape: Any, spacing: Any, boundary: str) -> Grid:
    steps, periodic = float_array(spacing), boundary == "periodic"
    pair = (float(steps[0]), float(steps[-1]))
    return Grid((int(shape[0]), int(shape[1])), pair, (periodic, periodic))


@lru_cache(maxsize=4)  # each holds two planes
def flat_block(body: Body) -> Solution:
    """Return the solution under a unit force: that of a contact whose gap at first touch is zero everywhere.

    Its closure is the compliance of the block; a periodic body has none.
    """
    uniform = np.full(body.shape, 1.0 / (body.shape[0] * body.shape[1]))
    if body.periodic:
        return Solution(uniform, np.zeros(body.shape), 0.0, 1.0, reason="converged")
    from fractalcontact.contact._constrained_cg import ConstrainedCG, ContactSystem

    system = ContactSystem.on_plane(Problem(body, np.zeros(body.shape)), np.float64)
    # 15 iterations are usual, 109 for a spacing 1000 times the other one; rounding leaves up to 9e-15
    return ConstrainedCG(system, Control(force=1.0), uniform).solve(1e-14)


@lru_cache
def uniform_compliance(body: Body) -> float:
    """Return the mean displacement under a uniform pressure that adds up to 1."""
    if body.periodic:
        return 0.0
    return mean_by_rows(body.operator().apply(np.full(body.shape, 1.0 / (body.shape[0] * body.shape[1]))))
