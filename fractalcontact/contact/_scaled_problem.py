"""The contact problem in scaled form: lengths, heights and pressures near 1, scales powers of two.

Lengths in the plane are measured in `Units.length`, heights, gaps and displacements in `Units.height`, both
powers of two, and pressures in contact modulus times height unit over length unit. A change of the units by
powers of two therefore changes no bit of the computation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.contact import _influence
from fractalcontact.contact._operator import SMALL, HalfSpaceOperator, Operator, PeriodicOperator


@dataclass(frozen=True)
class Units:
    """Scales of a problem: length and height (m, powers of two), contact modulus (Pa), scaled cell area."""

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
        """Energy (J) of a scaled sum of pressure times displacement of 1."""
        return self.force * self.height


@dataclass(frozen=True)
class Body:
    """A pair of half-spaces on a grid: shape (ny, nx), scaled spacing, boundary, influence coefficients."""

    shape: tuple[int, int]
    spacing: tuple[float, float]
    periodic: bool
    influence: str
    radius: float

    @property
    def cell_area(self) -> float:
        """Scaled area of a cell."""
        return self.spacing[0] * self.spacing[1]

    @property
    def is_small(self) -> bool:
        """Whether tables of this body are kept for the next call."""
        return self.shape[0] * self.shape[1] <= SMALL

    def influence_table(self) -> Array:
        """Return the displacement at offset (i, j) from a cell under unit pressure; free bodies only."""
        if self.influence == "disc":
            return _influence.disc_coefficients(self.shape, self.spacing, self.radius) * self.cell_area
        return _influence.square_coefficients(self.shape, self.spacing) * self.cell_area

    def operator(self, dtype: Any = np.float64) -> Operator:
        """Return the elastic operator, displacement from pressure."""
        if self.periodic:
            return PeriodicOperator(self.shape, self.spacing)
        if self.is_small:
            return kept_operator(self).rounded(dtype)
        return HalfSpaceOperator(self.influence_table(), dtype)


@dataclass(frozen=True)
class Problem:
    """A body, the gap h above its undeformed surface at first touch, and the largest pressure; all scaled."""

    body: Body
    gap: Array
    p_max: float = np.inf

    @property
    def local_compliance(self) -> float:
        """Nominal pressure times grid spacing for a unit sum of pressure: the least scale of the error."""
        return float(np.sqrt(self.body.spacing[0] * self.body.spacing[1])) / self.gap.size


@dataclass(frozen=True)
class Control:
    """What is imposed on a step: the force, which is the sum of the scaled pressure, or the closure."""

    force: float | None = None
    closure: float | None = None

    @property
    def value(self) -> float:
        """The imposed number."""
        return float(self.force if self.force is not None else self.closure or 0.0)


@dataclass
class Solution:
    """Scaled solution of one step, and how it was found."""

    pressure: Array
    displacement: Array
    closure: float
    force: float
    iterations: int = 0
    transforms: int = 0
    residual: float = 0.0
    reason: str = ""  # why the solution stopped, a key of `STOP_REASONS`
    work: float = 0.0  # sum of pressure times displacement: twice the elastic energy
    solver: str = "closed_form"  # or "elimination", or one of the three of `_window_solver`


@lru_cache(maxsize=16)
def kept_operator(body: Body) -> HalfSpaceOperator:
    """Return the operator of a small free body; its table takes as long as a solution."""
    return HalfSpaceOperator(body.influence_table())


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
    shape: tuple[int, int], spacing: tuple[float, float], periodic: bool, influence: str, disc_radius: str
) -> Body:
    """Return the scaled body of a grid, from valid options in SI units."""
    unit = length_unit(spacing)
    scaled = (spacing[0] / unit, spacing[1] / unit)
    if influence != "disc":
        return Body(shape, scaled, periodic, influence, 0.0)
    return Body(shape, scaled, periodic, influence, _influence.disc_radius(disc_radius, scaled))


def length_unit(spacing: tuple[float, float]) -> float:
    """Return the power of two in which lengths of the plane are measured."""
    return power_of_two(max(spacing))


def power_of_two(value: float) -> float:
    """Return the power of two next above `value`; 1 for zero."""
    return float(np.ldexp(1.0, int(np.frexp(value)[1]))) if value > 0 else 1.0


def strips(
    first: int,
    stop: int,
    columns: int,
    *,
    nodes: int = 1 << 17,  # they stay in the cache; threads that take fewer wait for each other's calls
) -> Iterator[slice]:
    """Yield slices of some rows of a plane, of so many nodes."""
    rows = max(1, nodes // columns)
    for row in range(first, stop, rows):
        yield slice(row, min(row + rows, stop))


def sum_by_rows(plane: Array) -> float:
    """Sum each row, then the row sums, in double precision: the same bits for any number of threads."""
    return float(np.sum(np.sum(plane, axis=-1, dtype=np.float64)))


def mean_by_rows(plane: Array) -> float:
    """Return the mean, summed as in `sum_by_rows`."""
    return sum_by_rows(plane) / plane.size
