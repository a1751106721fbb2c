"""The crack: two facing rough faces, the block that slides, and the material of both."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_direction, check_directions, read_direction, read_directions
from fractalcontact.base.grid import DECADES, UNIFORM, Grid, distinct, read_grid
from fractalcontact.base.numbers import Array, as_array, float_array
from fractalcontact.base.provenance import plain
from fractalcontact.base.tables import html_table
from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import NONE, Problems

Pair = tuple[float, float]

WHERE = "fractalcontact.joints.Crack"
# cells: a shift this close to whole cells is rounded to them; sums of 20 000 steps, of five spacings, missed
# them by up to 7e-9
SHIFT_ROUNDING = 1e-6
MATERIAL = ("young", "poisson")
FILL = "see fractalcontact.surfaces.fill"


@dataclass(frozen=True)
class Block:
    """The sliding block in cells of its face; all pairs are (y, x).

    `face_cells` is the shape of the face, `cells` that of the block, `start` the first cell of the block,
    `spacing` in metres; `wraps` marks the axes along which the face repeats.
    """

    face_cells: tuple[int, int]
    cells: tuple[int, int]
    start: tuple[int, int]
    spacing: Pair
    wraps: tuple[bool, bool]

    @property
    def edges(self) -> Pair:
        """Edge lengths in metres."""
        return self.cells[0] * self.spacing[0], self.cells[1] * self.spacing[1]

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Whether the block is a whole period of its face, along y and x."""
        (ny, nx), (by, bx) = self.face_cells, self.cells
        return self.wraps[0] and by == ny, self.wraps[1] and bx == nx

    @property
    def slices(self) -> tuple[slice, slice]:
        """The cells of the block in its face, before any shear."""
        return tuple(slice(a, a + b) for a, b in zip(self.start, self.cells, strict=True))  # type: ignore[return-value]

    def travel(self, unit: Pair) -> float:
        """Return the greatest shear (m) towards the unit vector (y, x) that keeps the block on its face."""
        travel = math.inf
        for axis, component in enumerate(unit):
            if self.wraps[axis] or component == 0:
                continue
            before = self.start[axis]
            margin = self.face_cells[axis] - self.cells[axis] - before if component > 0 else before
            travel = min(travel, margin * self.spacing[axis] / abs(component))
        return travel

    def shift(self, shear: float, unit: Pair) -> Pair:
        """Return the shift in cells (y, x), rounded where it is whole within `SHIFT_ROUNDING`."""
        return _rounded(shear * unit[0] / self.spacing[0]), _rounded(shear * unit[1] / self.spacing[1])


def _rounded(cells: float) -> float:
    nearest = float(math.floor(cells + 0.5))
    return nearest if abs(cells - nearest) <= SHIFT_ROUNDING else cells


@dataclass(frozen=True, eq=False, repr=False)
class Crack:
    """A crack between two elastic half-spaces of one material or of two.

    The upper body carries a block that lies on the lower face, slides over it and is pressed against it.
    A periodic axis wraps: the lower face repeats, and the block may slide any distance. On a free axis the
    block must stay on the face.

    Parameters
    ----------
    lower : DataArray, shape (y, x)
        Heights (m) of the lower face, up positive; they may be missing (NaN) outside the path of the block.
    upper : DataArray, shape (y, x), optional
        Heights (m) of the lower face of the upper body in the same frame and on the same grid: the aperture
        is upper - lower. None: the faces match perfectly.
    young : float or pair (lower, upper), optional
        Young's modulus, Pa. One value holds for both bodies; none is needed where nothing elastic is wanted.
        One body of a pair may be rigid, ``(30e9, numpy.inf)``.
    poisson : float or pair (lower, upper), optional
        Poisson's ratio, above -1 and at most 0.5.
    block : float or pair (y, x), optional
        Edge length of the sliding block, m, rounded to an integer number of cells; its first cell is
        (n - b)//2 of `lower`. None: the whole face.
    basic_friction_angle : float
        Friction angle of smooth faces of the material, degree.

    Attributes
    ----------
    block : pair of float
        Edge lengths (y, x) in use, m.
    layout : Block
        The block in cells.
    nominal_area : float
        Area of the block, m2.
    contact_modulus : float
        E* of the pair, Pa: 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2.
    contact_poisson : float
        Poisson's ratio of two equal bodies that are as compliant, see `contact.effective_poisson`.

    Raises
    ------
    InvalidInput
        Lists all problems of the faces, the material and the block.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=5e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> round(crack.travel("W") * 1e3, 3), round(crack.contact_modulus / 1e9, 3)
    (1.6, 15.625)
    """

    lower: xr.DataArray
    upper: xr.DataArray | None = None
    _: KW_ONLY
    young: float | Pair | None = None
    poisson: float | Pair | None = None
    block: Any = None
    basic_friction_angle: float = 35.0
    layout: Block = field(init=False)

    def __post_init__(self) -> None:
        with Problems(WHERE) as problems:
            expected, young = "one value or (lower, upper)", _elastic_young(problems, self.young)
            _check_one_or_two(problems, "young", young, expected, above=0)
            _check_one_or_two(problems, "poisson", self.poisson, expected, above=-1, at_most=0.5)
            problems.number("basic_friction_angle", self.basic_friction_angle, at_least=0, below=90)
            layout = _check_faces(problems, self.lower, self.upper, self.block)
        for name in MATERIAL:
            object.__setattr__(self, name, _one_or_two(getattr(self, name)))
        object.__setattr__(self, "basic_friction_angle", float(self.basic_friction_angle))
        assert layout is not None
        object.__setattr__(self, "layout", layout)
        object.__setattr__(self, "block", layout.edges)

    def __repr__(self) -> str:
        """One line: the faces, the block and the material."""
        return f"Crack({', '.join(f'{name}: {value}' for name, value in self._facts())})"

    def _repr_html_(self) -> str:
        """Return a table of the faces, the block and the material, which a notebook shows."""
        return html_table("Crack", self._facts())

    def _facts(self) -> list[tuple[str, str]]:
        """Return what defines the crack, in words."""
        (ny, nx), (by, bx) = self.layout.face_cells, self.layout.cells
        dy, dx = (quantity_text(step, "m") for step in self.layout.spacing)
        faces = "mated faces" if self.upper is None else "two faces"
        edges = " x ".join(quantity_text(edge, "m") for edge in self.block)
        facts = [
            ("faces", f"{faces} of {ny} x {nx} cells, {dy} x {dx} apart"),
            ("block", f"{by} x {bx} cells, {edges}"),
        ]
        for name, value, units in (("young", self.young, "Pa"), ("poisson", self.poisson, "1")):
            facts += [] if value is None else [(name, _words(value, units))]
        return [*facts, ("basic_friction_angle", quantity_text(self.basic_friction_angle, "degree"))]

    @property
    def nominal_area(self) -> float:
        """Area of the block, m2."""
        return float(self.block[0] * self.block[1])

    @property
    def contact_modulus(self) -> float:
        """E* of the two half-spaces, Pa."""
        from fractalcontact.contact import effective_modulus  # a study of rigid faces loads no contact solver

        return float(effective_modulus(*self._bodies()))

    @property
    def contact_poisson(self) -> float:
        """Poisson's ratio of two equal half-spaces that are as compliant."""
        from fractalcontact.contact import effective_poisson

        return float(effective_poisson(*self._bodies()))

    def _bodies(self) -> tuple[float, float, float, float]:
        """Return young and poisson of the lower body, then of the upper one."""
        with Problems(WHERE) as problems:
            check_elastic(problems, self)
        young, poisson = (np.broadcast_to(float_array(getattr(self, name)), 2) for name in MATERIAL)
        return float(young[0]), float(poisson[0]), float(young[1]), float(poisson[1])

    def travel(self, direction: str | float = "E") -> float:
        """Return the greatest shear towards `direction`, m; infinite where the face wraps."""
        with Problems(f"{WHERE}.travel") as problems:
            check_direction(problems, value=direction)
        return self.layout.travel(read_direction(direction).unit)

    def faces(self) -> tuple[Array, Array]:
        """Return the heights of the whole lower face and of the face of the block, as float64 arrays."""
        lower = np.asarray(self.lower.values, dtype=np.float64)
        upper = lower if self.upper is None else np.asarray(self.upper.values, dtype=np.float64)
        return lower, upper[self.layout.slices]

    def summary(self) -> dict[str, Any]:
        """Return the description of the crack in the provenance of a result, in plain types.

        Faces that are not in memory are loaded for their checksum, by which cracks are told apart.
        """
        return {
            "lower": plain(self.lower.compute()),
            "upper": "mated" if self.upper is None else plain(self.upper.compute()),
            "young": plain(self.young),
            "poisson": plain(self.poisson),
            "block": list(self.block),
            "block_cells": list(self.layout.cells),
            "basic_friction_angle": self.basic_friction_angle,
        }


def _check_one_or_two(problems: Problems, name: str, value: Any, expected: str, **bounds: Any) -> bool:
    """Check for one number, two numbers, or None."""
    valid = problems.numbers(name, value, optional=True, **bounds)
    if not valid or value is None:
        return valid
    return problems.require(float_array(value).size <= 2, name, expected, value)


def _elastic_young(problems: Problems, young: Any) -> Any:
    """Return Young's modulus with any number for that of a rigid body, and check that one body is elastic."""
    values = as_array(young)
    if values is None or values.dtype.kind != "f" or not np.isposinf(values).any():
        return young
    is_rigid = np.isposinf(values)
    expected = "an elastic body, or neither young nor poisson where both are rigid"
    problems.require(not np.all(is_rigid), "young", expected, young)
    return np.where(is_rigid, 1.0, values)


def _one_or_two(value: Any) -> float | Pair | None:
    """Return a property of both bodies as one number, or as (lower, upper)."""
    if value is None:
        return None
    numbers = float_array(value)
    return float(numbers[0]) if numbers.size == 1 else (float(numbers[0]), float(numbers[1]))


def _words(value: float | Pair, units: str) -> str:
    if isinstance(value, tuple):
        lower, upper = ("rigid" if math.isinf(each) else quantity_text(each, units) for each in value)
        return f"{lower} (lower), {upper} (upper)"
    return quantity_text(value, units)


def _check_faces(problems: Problems, lower: Any, upper: Any, block: Any) -> Block | None:
    """Check faces and block; return the block in cells unless it is not valid."""
    expected = "one edge length or (y, x), in metres"
    block_is_valid = _check_one_or_two(problems, "block", block, expected, above=0, at_most=10.0**DECADES)
    layout = None
    lower_is_valid = problems.surface("lower", lower, finite=False)
    if lower_is_valid and block_is_valid:
        layout = _layout(problems, block, read_grid(lower))
    if layout is not None:
        _check_heights(problems, "lower", lower, layout)
    if upper is not None and problems.surface("upper", upper, finite=False) and lower_is_valid:
        _check_upper(problems, upper, lower, layout)
    return layout


def _layout(problems: Problems, block: Any, grid: Grid, fewest: int = 3) -> Block | None:
    """Return the block in cells, None where it does not fit its face or has fewer cells than a surface."""
    face, spacing = (grid.shape[0], grid.shape[1]), (grid.spacing[0], grid.spacing[1])
    cells = face
    if block is not None:
        edges = np.broadcast_to(float_array(block), 2)
        cells = (math.floor(edges[0] / spacing[0] + 0.5), math.floor(edges[1] / spacing[1] + 0.5))
    fits = True
    for name, b, n, step in zip(("y", "x"), cells, face, spacing, strict=True):
        expected = f"{fewest * step:g} to {n * step:g} m along {name} ({fewest} to {n} cells)"
        fits &= problems.require(fewest <= b <= n, "block", expected, f"{b * step:g} m ({b} cells)")
    start = ((face[0] - cells[0]) // 2, (face[1] - cells[1]) // 2)
    return Block(face, cells, start, spacing, (grid.periodic[0], grid.periodic[1])) if fits else None


def _check_heights(problems: Problems, argument: str, face: xr.DataArray, layout: Block) -> None:
    values = np.asarray(face.values, dtype=np.float64)
    infinite = int(np.count_nonzero(np.isinf(distinct(values))))
    problems.require(infinite == 0, argument, "no infinite heights", f"{infinite} of them")
    problems.finite(f"{argument} inside the block", values[layout.slices], remedy=FILL)


def _check_upper(problems: Problems, upper: xr.DataArray, lower: xr.DataArray, layout: Block | None) -> None:
    grid = read_grid(lower)
    expected = f"the shape of lower, {grid.shape}"
    if not problems.require(upper.shape == grid.shape, "upper", expected, upper.shape):
        return
    aligned = True
    for axis, name in enumerate(("y", "x")):
        distance = np.abs(upper[name].values - lower[name].values).max()
        allowed = UNIFORM * grid.spacing[axis] + 4.0 * np.spacing(np.abs(lower[name].values).max())
        expected, got = f"the positions of lower.{name}", f"up to {distance:g} m off"
        aligned &= problems.require(bool(distance <= allowed), f"upper.{name}", expected, got)
    if aligned and layout is not None:
        _check_heights(problems, "upper", upper, layout)


def check_crack(problems: Problems) -> bool:
    """Check the argument `crack`."""
    crack = problems.given.crack
    got = f"an object of type {type(crack).__name__}"
    return problems.require(isinstance(crack, Crack), "crack", "a fractalcontact.joints.Crack", got)


def check_elastic(problems: Problems, crack: Crack) -> None:
    """Check that the bodies of a crack have the constants of elasticity."""
    for name in MATERIAL:
        problems.require(getattr(crack, name) is not None, f"crack.{name}", "a value: bodies deform", NONE)


def check_sliding(problems: Problems, *, single: bool = False, has_slid: bool = False) -> None:
    """Check crack, shears (m, each once) and directions, and that the block stays on its face.

    With `single` there is one direction, not a sequence of them; with `has_slid` no shear is zero.
    """
    crack, shear, direction = problems.given.crack, problems.given.shear, problems.given.direction
    bounds: dict[str, Any] = {"above": 0} if has_slid else {"at_least": 0}
    valid = [
        check_crack(problems),
        check_direction(problems) if single else check_directions(problems),
        problems.numbers("shear", **bounds),
    ]
    if not valid[2]:
        return
    values, counts = np.unique(float_array(shear), return_counts=True)
    repeated = ", ".join(f"{value:g} m" for value in values[counts > 1][:5])
    problems.require(not repeated, "shear", "every shear once", f"{repeated} several times")
    if not all(valid):
        return
    greatest = float(values[-1])
    for item in read_directions(direction):
        travel = crack.layout.travel(item.unit)
        expected = f"at most {travel:g} m towards {item.name}, where the block meets the edge of the face"
        if travel == 0:
            expected += " (give the Crack a smaller `block`, or periodic faces)"
        slack = SHIFT_ROUNDING * min(crack.layout.spacing)
        problems.require(greatest <= travel + slack, "shear", expected, greatest)


def block_coords(crack: Crack) -> dict[str, xr.DataArray]:
    """Return x and y of the block; an axis along which the block is a whole period keeps its period."""
    layout = crack.layout
    coords = {}
    for axis, dim in enumerate(("y", "x")):
        values = np.asarray(crack.lower[dim].values, dtype=np.float64)[layout.slices[axis]]
        attributes = {"units": "m"} | ({"period": float(layout.edges[axis])} if layout.periodic[axis] else {})
        coords[dim] = xr.DataArray(values, dims=dim, attrs=attributes)
    return coords
