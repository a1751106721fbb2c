"""From checked arguments to a scaled problem."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import UNIFORM
from fractalcontact.contact import _influence
from fractalcontact.contact._scaling import Body, length_unit

Array = np.ndarray[Any, np.dtype[Any]]

INFLUENCES = ("disc", "square", "spectral")
POINT = 1e-9  # of the spacing: a plate that is smaller is a point, which has no stiffness


def make_body(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    periodic: bool,
    influence: str | None,
    radius: str | float,
    problems: Problems,
) -> Body:
    """Scaled body with its influence chosen; notes what does not go together."""
    usual = "spectral" if periodic else "disc"
    chosen = problems.choice("influence", usual if influence is None else influence, INFLUENCES)
    allowed = ("spectral",) if periodic else ("disc", "square")
    bodies = "periodic" if periodic else "free"
    problems.require(chosen in allowed, "influence", f"{' or '.join(allowed)} for {bodies} bodies", chosen)
    unit = length_unit(spacing)
    scaled = (spacing[0] / unit, spacing[1] / unit)
    if chosen != "disc":
        default = isinstance(radius, str) and radius == "second_order"
        problems.require(default, "disc_radius", "nothing but with influence='disc'", radius)
        return Body(shape, scaled, periodic, chosen, 0.0)
    return Body(shape, scaled, periodic, chosen, _checked_radius(radius, scaled, unit, problems))


def _checked_radius(
    choice: str | float, spacing: tuple[float, float], unit: float, problems: Problems
) -> float:
    """Scaled radius of the plate; it must leave the operator positive."""
    ratio = max(spacing) / min(spacing)
    if isinstance(choice, str):
        word = problems.choice("disc_radius", choice, _influence.DISC_RADII)
        if word == "second_order" and ratio > _influence.GREATEST_RATIO * (1 + UNIFORM):
            expected = "spacings in a ratio of at most 2 for the second-order disc (use influence='square')"
            problems.add("influence", expected, f"'disc' with a ratio of {ratio:.4g}")
            return 1.0
        radius = _influence.disc_radius(word, spacing)
    else:
        known = len(problems.found)
        radius = problems.number("disc_radius", choice, above=0, at_least=POINT * min(spacing) * unit) / unit
        if len(problems.found) > known:
            return 1.0
    least = _symbol(radius / float(np.sqrt(spacing[0] * spacing[1])), ratio)
    problems.require(
        least > 0,
        "disc_radius",
        "plates small enough for a positive operator (or influence='square')",
        f"radius {radius * unit:.4g} m, symbol down to {least:.3g} of the half-space's",
    )
    return radius


@lru_cache(maxsize=64)
def _symbol(radius: float, ratio: float) -> float:
    return _influence.least_symbol(radius, ratio)
