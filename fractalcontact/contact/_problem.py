"""The contact problem: options and loads in SI units, and its scaled form, which the solvers take.

Lengths in the plane are measured in `Units.length`, heights, gaps and displacements in `Units.height`, both
powers of two, and pressures in contact modulus times height unit over length unit. A change of the units by
powers of two therefore changes no bit of the computation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.grid import UNIFORM, Grid, read_grid
from fractalcontact.base.numbers import Array, float_array, power_of_two
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.study import BORRI_BRUNETTO_1998, joined_references
from fractalcontact.base.validation import Problems, given_option
from fractalcontact.contact import _influence
from fractalcontact.contact._operator import (
    KEPT,
    SMALL,
    HalfSpaceOperator,
    ModesMemory,
    Operator,
    PeriodicOperator,
)

BOUNDARIES = ("free", "periodic")
INFLUENCES = ("disc", "square", "spectral")
METHODS = ("fast", "elimination")
CONTROL_UNITS = {"closure": "m", "normal_force": "N", "nominal_pressure": "Pa"}
CONTROLS = tuple(CONTROL_UNITS)
SOLVER_SOURCES = {
    "fast": "Polonsky and Keer, Wear 231:206 (1999); Bugnicourt et al., Tribol. Lett. 66:29 (2018)",
    "elimination": BORRI_BRUNETTO_1998,
}
INFLUENCE_SOURCES = {
    "disc": BORRI_BRUNETTO_1998,
    "square": "Love, Phil. Trans. R. Soc. A 228:377 (1929)",
    "spectral": "Stanley and Kato, J. Tribol. 119:481 (1997)",
}
HARDNESS = "Almqvist, Sahlin, Larsson and Glavatskih, Tribol. Int. 40:574 (2007) (hardness)"
YASTREBOV = "Yastrebov, Anciaux and Molinari, Tribol. Int. 114:161 (2017) (perimeter correction)"
# relative: a force of hardness times area, or of sliding, may miss it by so much, and forces that differ by
# less share one solution
FORCE_ROUNDING = 1e-12


@dataclass(frozen=True)
class ContactOptions:
    """How a contact problem is solved: boundary, influence coefficients, hardness and accuracy.

    The values are validated on construction. What depends on the surface is validated by `check_grid` and
    `check_load`.

    Parameters
    ----------
    boundary : {None, "periodic", "free"}
        None: periodic where both axes of the surface are periodic. A periodic surface may be declared free,
        never the reverse. Free: a half-space that continues, plane and without traction, around the surface;
        it has no side faces.
    influence : {None, "disc", "square", "spectral"}
        Influence coefficients, see `press`. None: "spectral" for periodic bodies, "disc" for free ones.
    disc_radius : {"second_order", "inscribed", "equal_area"}
        Radius of the circular plate of influence "disc".
    hardness : float, optional
        Largest pressure that the surface bears, in Pa. None: elastic.
    tolerance : float
        Bound on the scale-free residual of each step, between 0 and 1.
    method : {"fast", "elimination"}
        Constrained conjugate gradients, or the dense active set method.
    """

    boundary: str | None = None
    influence: str | None = None
    disc_radius: str = "second_order"
    hardness: float | None = None
    tolerance: float = DEFAULT_TOLERANCE
    method: str = "fast"

    def __post_init__(self) -> None:
        """Validate what does not depend on the surface."""
        with Problems("fractalcontact.contact.ContactOptions") as problems:
            problems.choice("boundary", self.boundary, BOUNDARIES, optional=True)
            problems.choice("influence", self.influence, INFLUENCES, optional=True)
            problems.choice("disc_radius", self.disc_radius, _influence.DISC_RADII)
            problems.number("hardness", self.hardness, above=0, optional=True)
            problems.number("tolerance", self.tolerance, above=0, below=1)
            if problems.choice("method", self.method, METHODS) and self.method == "elimination":
                expected = "None with method='elimination'"
                problems.require(self.hardness is None, "hardness", expected, self.hardness)
        for name in ("hardness", "tolerance"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else float(value))

    @classmethod
    def among(cls, arguments: Mapping[str, Any]) -> ContactOptions:
        """Return the options among the arguments of a call; others keep their defaults."""
        return cls(**{field.name: arguments[field.name] for field in fields(cls) if field.name in arguments})

    def references(self, grid: Grid) -> str:
        """Return the sources of the methods used on this grid."""
        sources = SOLVER_SOURCES[self.method], INFLUENCE_SOURCES[self.influence_on(grid)], YASTREBOV
        return joined_references(*sources, *([] if self.hardness is None else [HARDNESS]))

    def is_periodic(self, grid: Grid) -> bool:
        """Return whether the bodies on this grid are periodic."""
        return is_periodic(self.boundary, all(grid.periodic))

    def influence_on(self, grid: Grid) -> str:
        """Return the influence coefficients used on this grid."""
        if self.influence is not None:
            return self.influence
        return "spectral" if self.is_periodic(grid) else "disc"

    def stated_on(self, grid: Grid) -> dict[str, str]:
        """Return what is used on this grid, for the provenance of a result."""
        boundary = "periodic" if self.is_periodic(grid) else "free"
        return {"boundary": boundary, "influence": self.influence_on(grid)}

    def check_grid(self, grid: Grid, problems: Problems) -> bool:
        """Check boundary, influence and plate radius against shape, spacing and periodicity of a grid."""
        before = len(problems.messages)
        if self.boundary is None:
            mixed = any(grid.periodic) and not all(grid.periodic)
            expected = "'free' where one axis is periodic and the other is not"
            problems.require(not mixed, "boundary", expected, self.boundary)
        elif self.boundary == "periodic":
            expected = "periodic axes (attribute `period` of x and y equal to n * spacing), or 'free'"
            problems.require(all(grid.periodic), "boundary", expected, self.boundary)
        influence = self.influence_on(grid)
        if self.is_periodic(grid):
            problems.require(
                influence == "spectral", "influence", "'spectral' for periodic bodies", influence
            )
        else:
            expected = "'disc' or 'square' for free bodies"
            problems.require(influence in ("disc", "square"), "influence", expected, influence)
        if influence == "disc":
            ratio = max(grid.spacing) / min(grid.spacing)
            # beyond 2 there is no second-order radius, and with plates of equal area the elastic operator is
            # not positive: its least value over that of the half-space is .30 at 2, and -.09 at 2.5
            fits = self.disc_radius == "inscribed" or ratio <= 2.0 * (1 + UNIFORM)
            expected = "'square', or disc_radius='inscribed', for spacings in a ratio above 2"
            problems.require(fits, "influence", expected, f"'disc' with a ratio of {ratio:.4g}")
        else:
            expected = "'second_order', the default: other values are only valid with influence='disc'"
            problems.require(self.disc_radius == "second_order", "disc_radius", expected, self.disc_radius)
        return len(problems.messages) == before

    def check_load(self, load: LoadPath, nominal_area: float, problems: Problems) -> bool:
        """Check that the hardness bears the load on an area (m2)."""
        if self.hardness is None or load.control == "closure":
            return True
        largest = max(load.values)
        if load.control == "nominal_pressure":
            capacity, expected = self.hardness, f"a pressure of at most the hardness, {self.hardness:.6g} Pa"
        else:
            capacity = self.hardness * nominal_area
            expected = f"a force of at most hardness times area, {capacity:.6g} N"
        borne = largest <= capacity * (1 + FORCE_ROUNDING)
        return problems.require(borne, load.control, expected, f"{largest:.6g} {CONTROL_UNITS[load.control]}")


@dataclass(frozen=True)
class LoadPath:
    """What is imposed at each step: closures, forces or nominal pressures.

    Parameters
    ----------
    control : {"closure", "normal_force", "nominal_pressure"}
        The imposed quantity.
    values : float or sequence of float
        Its value at each step, not negative: m, N or Pa. The load may go up and down.
    """

    control: str
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        """Validate and turn the values into a tuple of float."""
        with Problems("fractalcontact.contact.LoadPath") as problems:
            if problems.choice("control", self.control, CONTROLS):
                problems.numbers(self.control, self.values, at_least=0)
        object.__setattr__(self, "values", tuple(float_array(self.values).tolist()))

    @classmethod
    def among(cls, arguments: Mapping[str, Any]) -> LoadPath:
        """Return the path among the arguments of a call, of which exactly one load is not None."""
        loads = {name: arguments[name] for name in CONTROLS if name in arguments}
        with Problems("fractalcontact.contact.LoadPath") as problems:
            problems.exactly_one(**loads)
        return cls(*given_option(**loads))

    def solver_values(self, nominal_area: float) -> tuple[str, Array]:
        """Return the control of the solver, "closure" (m) or "normal_force" (N), and its values."""
        values = float_array(self.values)
        if self.control != "nominal_pressure":
            return self.control, values
        with np.errstate(over="ignore"):  # what overflows is refused as out of proportion
            return "normal_force", values * nominal_area


def is_periodic(boundary: str | None, wraps: bool) -> bool:
    """Return whether the bodies are periodic, on a surface both axes of which are or are not."""
    return wraps if boundary is None else boundary == "periodic"


class ContactProblem(NamedTuple):
    """A contact problem in SI units but for its heights, as `solver.solve` takes it."""

    grid: Grid
    contact_modulus: float
    options: ContactOptions
    load: LoadPath


def check_problem(problems: Problems, *, leading: bool = False, **replaced: Any) -> ContactProblem | None:
    """Check surface, modulus, load and options of a call, or what replaces them; return them if valid."""
    given, arguments = problems.given, vars(problems.given) | replaced
    problems.boolean("progress")
    surface_is_valid = problems.surface("surface", leading=leading)
    problems.number("contact_modulus", above=0)
    options = problems.construct(ContactOptions.among, arguments)
    load = problems.construct(LoadPath.among, arguments)
    if not surface_is_valid or options is None:
        return None
    grid = read_grid(given.surface)
    options.check_grid(grid, problems)
    if load is None or problems.messages:
        return None
    problem = ContactProblem(grid, float(given.contact_modulus), options, load)
    heights = np.asarray(given.surface.values, np.float64)
    ranges = np.ptp(heights.reshape(-1, grid.shape[0] * grid.shape[1]), axis=1)
    for height_range in {float(ranges.min()), float(ranges.max())}:
        check_scale(problems, height_range, *problem)
    options.check_load(load, grid.nominal_area, problems)
    return problem


def check_scale(
    problems: Problems,
    height_range: float,
    grid: Grid,
    contact_modulus: float,
    options: ContactOptions,
    load: LoadPath,
    *,
    greatest_scale: float = 2.0**900,  # or least, its inverse, in SI units: doubles end near 2**1024
    greatest_ratio: float = 2.0**300,  # of load or hardness to its scale: a double holds products of three
) -> bool:
    """Check that heights, modulus, hardness and load are in proportion, so that no product overflows."""
    hardness = options.hardness
    control, values = load.solver_values(grid.nominal_area)
    units = make_units(grid, height_range, contact_modulus, load)
    scales = {
        "spacing": (units.length, "m"),
        "range of heights": (units.height, "m"),
        "modulus": (units.modulus, "Pa"),
        "modulus * heights / spacing": (units.pressure, "Pa"),
        "modulus * heights * spacing": (units.force, "N"),
        "modulus * heights^2 * spacing": (units.energy, "J"),
    }
    before = len(problems.messages)
    for product, (scale, unit_name) in scales.items():
        if not 1 / greatest_scale < scale < greatest_scale:
            expected = "spacing, heights and modulus whose products a double can hold"
            problems.add("surface / contact_modulus", expected, f"{product} = {scale:.3g} {unit_name}")
            return False
    if hardness is not None:
        low, high = units.pressure / greatest_ratio, units.pressure * greatest_ratio
        expected = f"None or between {low:.3g} and {high:.3g} Pa for this surface"
        problems.require(low < hardness < high, "hardness", expected, f"{hardness:g} Pa")
    unit = units.height if control == "closure" else units.force
    scale = unit / (grid.nominal_area if load.control == "nominal_pressure" else 1.0)
    low, high, unit_name = scale / greatest_ratio, scale * greatest_ratio, CONTROL_UNITS[load.control]
    expected = f"0 or between {low:.3g} and {high:.3g} {unit_name} for this surface and modulus"
    for imposed, value in zip(load.values, values, strict=True):
        in_range = value == 0 or unit / greatest_ratio < value < unit * greatest_ratio
        problems.require(in_range, load.control, expected, f"{imposed:g} {unit_name}")
    return len(problems.messages) == before


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
            return kept_operator(self).rounded(dtype, ModesMemory())
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


@lru_cache(maxsize=KEPT)
def kept_operator(body: Body) -> HalfSpaceOperator:
    """Return the operator of a small free body, see `SMALL`."""
    return HalfSpaceOperator(body.influence_table())


def make_units(grid: Grid, height_range: float, modulus: float, load: LoadPath) -> Units:
    """Return the scales of a problem; a flat surface is measured by its largest closure or force."""
    length, height = length_unit(grid), height_range
    if height == 0:
        control, values = load.solver_values(grid.nominal_area)
        largest = float(values.max())
        height = largest if control == "closure" else largest / modulus / length
    cell_area = (grid.spacing[0] / length) * (grid.spacing[1] / length)
    return Units(length, power_of_two(height), modulus, cell_area)


def scaled_body(grid: Grid, options: ContactOptions) -> Body:
    """Return the scaled body of a grid under valid options."""
    (ny, nx), unit = grid.shape, length_unit(grid)
    spacing, influence = (grid.spacing[0] / unit, grid.spacing[1] / unit), options.influence_on(grid)
    radius = _influence.disc_radius(options.disc_radius, spacing) if influence == "disc" else 0.0
    return Body((ny, nx), spacing, options.is_periodic(grid), influence, radius)


def length_unit(grid: Grid) -> float:
    """Return the power of two in which lengths of the plane are measured."""
    return power_of_two(max(grid.spacing))


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
