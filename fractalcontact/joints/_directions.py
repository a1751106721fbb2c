"""Directions of sliding: compass words and azimuths (E is +x, N is +y, anticlockwise from E)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fractalcontact.base.checks import Problems

AZIMUTHS = {"E": 0.0, "NE": 45.0, "N": 90.0, "NW": 135.0, "W": 180.0, "SW": 225.0, "S": 270.0, "SE": 315.0}
_AXES = {0.0: (0.0, 1.0), 90.0: (1.0, 0.0), 180.0: (0.0, -1.0), 270.0: (-1.0, 0.0)}
EXPECTED = f"one of {', '.join(AZIMUTHS)}, or an azimuth in degrees"


@dataclass(frozen=True)
class Direction:
    """A direction of sliding: its name, its azimuth (degree) and its unit vector (y, x)."""

    name: str
    azimuth: float
    unit: tuple[float, float]


def one_direction(value: Any, problems: Problems, argument: str = "direction") -> Direction:
    """Read a compass word or an azimuth in degrees."""
    if isinstance(value, str):
        if value in AZIMUTHS:
            return _direction(AZIMUTHS[value])
    elif isinstance(value, (int, float, np.integer, np.floating)) and _is_azimuth(value):
        return _direction(float(value) % 360.0)
    problems.add(argument, EXPECTED, value)
    return _direction(0.0)


def _is_azimuth(value: Any) -> bool:
    """Say whether a number is an angle, and not a truth, NaN or one without any digits below 360."""
    return not isinstance(value, bool) and bool(abs(value) < 1e9)


def several_directions(value: Any, problems: Problems, argument: str = "direction") -> tuple[Direction, ...]:
    """Read one direction or a sequence of them, in which each comes once."""
    given = [value] if is_one(value) else list(value)
    if not given:
        problems.add(argument, EXPECTED, "an empty sequence")
        return (_direction(0.0),)
    before = len(problems.found)
    found = tuple(one_direction(item, problems, argument) for item in given)
    names = [direction.name for direction in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice and len(problems.found) == before:
        problems.add(argument, "every direction once", f"{', '.join(twice)} several times")
    return found


def is_one(value: Any) -> bool:
    """Say whether one direction is meant, and not a sequence of them."""
    return isinstance(value, str) or np.ndim(value) == 0


def _direction(azimuth: float) -> Direction:
    names = {angle: name for name, angle in AZIMUTHS.items()}
    angle = math.radians(azimuth)
    # along an axis the other component is exactly zero, so that whole shifts stay whole
    unit = _AXES.get(azimuth, (math.sin(angle), math.cos(angle)))
    return Direction(names.get(azimuth, f"{azimuth:g}"), azimuth, unit)
