"""Compass directions of sliding, read from words or azimuths (degree; E is +x, N is +y, anticlockwise)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.numbers import is_real
from fractalcontact.base.validation import GIVEN, Problems

AZIMUTHS = {name: 45.0 * i for i, name in enumerate(("E", "NE", "N", "NW", "W", "SW", "S", "SE"))}
COMPASS = ("E", "N", "W", "S")
WORDS = {"east": "E", "north": "N", "west": "W", "south": "S"}
WORDS |= {word.title(): name for word, name in WORDS.items()}
EXPECTED = f"one of {', '.join(AZIMUTHS)}, or an azimuth in degrees"
LARGEST_AZIMUTH = 1e9  # degree; beyond it a double has no digits left below 360
# along an axis the other component is exactly zero, so that shifts by whole cells stay whole
_AXES = {0.0: (0.0, 1.0), 90.0: (1.0, 0.0), 180.0: (0.0, -1.0), 270.0: (-1.0, 0.0)}


@dataclass(frozen=True)
class Direction:
    """A direction of sliding: its name, its azimuth (degree) and its unit vector (y, x)."""

    name: str
    azimuth: float
    unit: tuple[float, float]


def check_direction(problems: Problems, argument: str = "direction", value: Any = GIVEN) -> bool:
    """Check for one compass word or azimuth in degrees, by default that of the argument `direction`."""
    value = problems.given.direction if value is GIVEN else value
    if isinstance(value, str):
        valid = WORDS.get(value, value) in AZIMUTHS
    else:
        valid = is_real(value) and bool(abs(value) < LARGEST_AZIMUTH)  # False for NaN
    return problems.require(valid, argument, EXPECTED, value)


def check_directions(problems: Problems, argument: str = "direction", value: Any = GIVEN) -> bool:
    """Check for one direction or a sequence of them in which each occurs once, as `check_direction` does."""
    value = problems.given.direction if value is GIVEN else value
    if not is_single(value) and not isinstance(value, (list, tuple, np.ndarray)):
        return problems.require(False, argument, f"{EXPECTED}, or a list of them", value)
    values = [value] if is_single(value) else list(value)
    if not values:
        return problems.require(False, argument, EXPECTED, "an empty sequence")
    valid = [check_direction(problems, argument, item) for item in values]
    if not all(valid):
        return False
    names = [direction.name for direction in read_directions(value)]
    repeated = sorted({name for name in names if names.count(name) > 1})
    got = f"{', '.join(repeated)} several times"
    return problems.require(not repeated, argument, "every direction once", got)


def read_directions(value: Any) -> tuple[Direction, ...]:
    """Return one or several directions that passed `check_directions`."""
    return tuple(read_direction(item) for item in ([value] if is_single(value) else value))


def read_direction(value: str | float) -> Direction:
    """Return a direction that passed `check_direction`."""
    azimuth = AZIMUTHS[WORDS.get(value, value)] if isinstance(value, str) else float(value) % 360.0
    names = {angle: name for name, angle in AZIMUTHS.items()}
    angle = math.radians(azimuth)
    unit = _AXES.get(azimuth, (math.sin(angle), math.cos(angle)))
    return Direction(names.get(azimuth, f"{azimuth:g}"), azimuth, unit)


def direction_text(name: Any) -> str:
    """Return the name of a direction as text: that of an azimuth has its unit, `37.5°`."""
    return str(name) if str(name).isalpha() or not str(name) else f"{name}°"


def is_single(value: Any) -> bool:
    """Return whether one direction is meant, not a sequence of them."""
    return isinstance(value, (str, bytes, dict)) or not np.iterable(value)


def direction_coords(directions: Sequence[Direction]) -> dict[str, Any]:
    """Return the coordinates `direction` and `azimuth` over the dim `direction`."""
    return {
        "direction": ("direction", np.array([direction.name for direction in directions])),
        "azimuth": ("direction", np.array([direction.azimuth for direction in directions])),
    }
