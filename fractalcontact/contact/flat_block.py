"""Stiffness of the block with perfectly mating faces."""

from __future__ import annotations

import math

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.contact._setup import length_unit, make_body


def flat_stiffness(
    shape: tuple[int, int],
    spacing: float | tuple[float, float],
    *,
    contact_modulus: float,
    boundary: str = "free",
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    settlement: str = "rigid",
) -> float:
    """Force per closure of two perfectly mating faces, in N/m.

    The bulk part of a closure is force / stiffness; `press` returns exactly that for a face of zero range.

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
    settlement : {"rigid", "uniform"}
        "rigid": the faces approach by the same amount everywhere, as rigid flats would make them; "uniform":
        the pressure is the same everywhere, and the closure is its mean settlement.

    Returns
    -------
    float
        Stiffness in N/m, solved to 1e-13; infinite for periodic bodies, whose mean settlement is not a
        property of their surface.

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call.

    Notes
    -----
    A square of edge L has 1.15230 E* L (rigid; the capacitance of the unit square, Read 1997) or
    E* L/0.9464020 (uniform) in the limit of small spacing.
    """
    from fractalcontact.contact import _flat

    with Problems("fractalcontact.contact.flat_stiffness") as problems:
        modulus = problems.number("contact_modulus", contact_modulus, above=0)
        problems.choice("boundary", boundary, ("free", "periodic"))
        problems.choice("settlement", settlement, ("rigid", "uniform"))
        if problems.require(np.shape(shape) == (2,), "shape", "(ny, nx)", shape):
            for n in shape:
                problems.integer("shape", n, at_least=3)
        steps = problems.numbers("spacing", spacing, above=0, at_most=1e100)
        problems.require(steps.size in (1, 2), "spacing", "one length or (dy, dx)", spacing)
        pair = (float(steps[0]), float(steps[-1]))
        if not problems.found:
            size = (int(shape[0]), int(shape[1]))
            body = make_body(size, pair, boundary == "periodic", influence, disc_radius, problems)
    compliance = (
        _flat.flat_block(body).compliance if settlement == "rigid" else _flat.uniform_compliance(body)
    )
    return math.inf if compliance == 0 else modulus * length_unit(pair) * body.cell_area / compliance
