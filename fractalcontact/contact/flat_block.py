"""Stiffness of the block with perfectly mating faces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fractalcontact.base.grid import Grid
from fractalcontact.base.validation import Problems, float_array
from fractalcontact.contact._options import BOUNDARIES, ContactOptions
from fractalcontact.contact._scaling import length_unit, scaled_body


def flat_stiffness(
    shape: tuple[int, int],
    spacing: float | tuple[float, float],
    *,
    contact_modulus: float,
    boundary: str = "free",
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    loading: str = "rigid",
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
    loading : {"rigid", "uniform"}
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
        problems.number("contact_modulus", contact_modulus, above=0)
        known_boundary = problems.choice("boundary", boundary, BOUNDARIES)
        problems.choice("loading", loading, ("rigid", "uniform"))
        has_shape = problems.require(_has_two_entries(shape), "shape", "(ny, nx)", shape)
        has_shape = has_shape and all(problems.integer("shape", n, at_least=3) for n in shape)
        has_spacing = problems.numbers("spacing", spacing, above=0, at_most=1e100) and problems.require(
            float_array(spacing).size in (1, 2), "spacing", "one length or (dy, dx)", spacing
        )
        word = boundary if known_boundary else None
        options = problems.construct(ContactOptions, word, influence, disc_radius)
        if known_boundary and has_shape and has_spacing and options is not None:
            options.check_grid(_grid(shape, spacing, boundary), problems)
    options, grid = ContactOptions(boundary, influence, disc_radius), _grid(shape, spacing, boundary)
    cells, pair = (grid.shape[0], grid.shape[1]), (grid.spacing[0], grid.spacing[1])
    body = scaled_body(cells, pair, boundary == "periodic", options.influence_on(grid), options.disc_radius)
    compliance = _flat.flat_block(body).compliance if loading == "rigid" else _flat.uniform_compliance(body)
    return (
        math.inf
        if compliance == 0
        else float(contact_modulus) * length_unit(pair) * body.cell_area / compliance
    )


def _has_two_entries(shape: Any) -> bool:
    try:
        return bool(np.shape(shape) == (2,))
    except ValueError:  # a ragged sequence
        return False


def _grid(shape: Any, spacing: Any, boundary: str) -> Grid:
    steps, periodic = float_array(spacing), boundary == "periodic"
    pair = (float(steps[0]), float(steps[-1]))
    return Grid((int(shape[0]), int(shape[1])), pair, (periodic, periodic))
