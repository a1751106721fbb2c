"""Stiffness of a contact: that of the flat punch whose base is the contact domain (Barber 2003).

A node at the edge of a contact bears no pressure, so that nodes that come into contact add nothing to the
force at first. The derivative of the force by the closure is therefore the stiffness of a punch with the
present contact as its base.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.contact._load_path import Step, solve_path

Array = np.ndarray[Any, np.dtype[Any]]

STIFFNESS_TOLERANCE = 0.03  # of the punch; the error of its stiffness is the square of that of its pressure


def press_punch(step: Step, guess: Array | None, *, tolerance: float = STIFFNESS_TOLERANCE) -> Step | None:
    """Press a punch with the contact of `step` as its base, from a pressure; None where there is no contact.

    Away from the base the gap is more than the punch can close: its closure is at most that of `step`, whose
    stiffness grows with the load. Yielded nodes are part of the base: the stiffness is that of unloading.
    """
    if not step.force > 0:
        return None
    depth = 4 * step.solution.closure + 1.0
    path = replace(
        step.path,
        gap=np.where(step.contact, 0.0, depth),
        control="normal_force",
        values=(step.force,),
        hardness=np.inf,
        tolerance=max(step.path.tolerance, tolerance),
    )
    return next(solve_path(path, lambda _: guess))


def stiffness_of(punch: Step) -> float:
    """Return force over closure, in N/m: infinite in full contact of a periodic body."""
    return punch.force / punch.closure if punch.closure > 0 else math.inf
