"""The contact problem in scaled form: lengths, heights and pressures near 1, scales powers of two.

Lengths in the plane are measured in `length_unit`, heights and settlements in `height_unit`, both powers of
two, and pressures in contact modulus times height over length unit. A change of unit by a power of two
therefore leaves every number of the computation as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.contact import _influence
from fractalcontact.contact._operator import FreeOperator, Operator, PeriodicOperator

Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Body:
    """A pair of half-spaces on a grid: shape (ny, nx), scaled spacing, boundary and influence."""

    shape: tuple[int, int]
    spacing: tuple[float, float]
    periodic: bool
    influence: str
    radius: float

    @property
    def cell_area(self) -> float:
        """Scaled area of a cell."""
        return self.spacing[0] * self.spacing[1]

    def table(self, shape: tuple[int, int] | None = None) -> Array:
        """Settlement at offset (i, j) under unit pressure on one cell of a free body."""
        shape = shape or self.shape
        if self.influence == "disc":
            return _influence.disc_coefficients(shape, self.spacing, self.radius) * self.cell_area
        return _influence.square_coefficients(shape, self.spacing) * self.cell_area

    def operator(self, kind: Any = np.float64) -> Operator:
        """Return the settlement under a plane of pressure."""
        if self.periodic:
            return PeriodicOperator(self.shape, self.spacing)
        return FreeOperator(self.table(), kind)


@dataclass(frozen=True)
class Units:
    """Scales of a problem: two powers of two, and the modulus."""

    length: float
    height: float
    modulus: float
    cell_area: float

    @property
    def pressure(self) -> float:
        """Pressure (Pa) of a scaled pressure of 1."""
        return self.modulus * (self.height / self.length)

    @property
    def force(self) -> float:
        """Force (N) of a scaled sum of pressure of 1."""
        return self.modulus * self.cell_area * (self.height * self.length)

    @property
    def energy(self) -> float:
        """Energy (J) of a scaled sum of pressure times settlement of 1."""
        return self.force * self.height


@dataclass(frozen=True)
class Problem:
    """A body and the gap above its surface at first touch, scaled."""

    body: Body
    gap: Array
    cap: float = np.inf

    @property
    def local(self) -> float:
        """Nominal pressure times grid spacing for unit sum of pressure: a length the error is measured in."""
        return float(np.sqrt(self.body.spacing[0] * self.body.spacing[1])) / self.gap.size


@dataclass(frozen=True)
class Control:
    """What is imposed: the sum of the pressure (force), or the closure."""

    total: float | None = None
    closure: float | None = None

    @property
    def value(self) -> float:
        """The imposed number."""
        return float(self.total if self.total is not None else self.closure or 0.0)


@dataclass
class Solution:
    """State of one step, scaled."""

    pressure: Array
    settlement: Array
    closure: float
    total: float
    iterations: int = 0
    transforms: int = 0
    residual: float = 0.0
    reason: str = "converged"
    work: float = 0.0  # sum of pressure times settlement


def serial_sum(plane: Array) -> float:
    """Sum by rows, then over the rows, in double: the same bits for any number of threads."""
    return float(np.sum(np.sum(plane, axis=-1, dtype=np.float64)))


def serial_mean(plane: Array) -> float:
    """Mean by rows, then over the rows."""
    return serial_sum(plane) / plane.size


def power_of_two(value: float) -> float:
    """Return the power of two next above `value`; 1 for zero."""
    return float(np.ldexp(1.0, int(np.frexp(value)[1]))) if value > 0 else 1.0


def length_unit(spacing: tuple[float, float]) -> float:
    """Power of two in which lengths of the plane are measured."""
    return power_of_two(max(spacing))


def make_units(
    spacing: tuple[float, float], height_range: float, modulus: float, control: str, largest: float
) -> Units:
    """Return the scales of a problem; a flat surface is measured by its largest closure or force."""
    length = length_unit(spacing)
    height = height_range
    if height == 0:
        height = largest if control == "closure" else largest / modulus / length
    cell_area = (spacing[0] / length) * (spacing[1] / length)
    return Units(length, power_of_two(height), modulus, cell_area)


def scaled_body(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    periodic: bool,
    influence: str,
    disc_radius: str | float,
) -> Body:
    """Return the scaled body of a grid, from valid options in SI units."""
    unit = length_unit(spacing)
    scaled = (spacing[0] / unit, spacing[1] / unit)
    if influence != "disc":
        return Body(shape, scaled, periodic, influence, 0.0)
    choice = disc_radius if isinstance(disc_radius, str) else disc_radius / unit
    return Body(shape, scaled, periodic, influence, _influence.disc_radius(choice, scaled))
