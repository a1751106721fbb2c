"""The crack: two facing rough faces, the block that slides, and the material of both."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import UNIFORM, Grid, check_surface
from fractalcontact.base.provenance import plain
from fractalcontact.joints._sliding import Block, centred

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.Crack"
SMALLEST = 3  # cells along an edge of the block
FILL = "see fractalcontact.surfaces.fill"


@dataclass(frozen=True, eq=False, repr=False)
class Crack:
    """A crack between two elastic half-spaces of the same material.

    The upper body carries a block that lies on the lower face, slides over it and is pressed against it.
    An axis that is periodic wraps: the lower face repeats, and the block may slide as far as it likes. On a
    free axis the block must stay on the face.

    Parameters
    ----------
    lower : DataArray, shape (y, x)
        Heights (m) of the lower face, up positive. It may miss heights (NaN) where the block never goes.
    upper : DataArray, shape (y, x), optional
        Heights (m) of the lower face of the upper body in the same frame and on the same grid: the aperture
        is upper - lower. None: the faces match perfectly.
    young : float
        Young's modulus of both bodies, Pa.
    poisson : float
        Poisson's ratio of both bodies, above -1 and below 0.5.
    block : float or pair (y, x), optional
        Edge length of the sliding block, m, rounded to the nearest whole number of cells; its first cell is
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
        E* of the pair, young / (2 (1 - poisson^2)), Pa.

    Raises
    ------
    InvalidInput
        Lists everything that is wrong with the faces, the material and the block.

    Examples
    --------
    >>> crack = Crack(face, young=30e9, poisson=0.2, block=0.02)  # doctest: +SKIP
    >>> crack.travel("W")  # doctest: +SKIP
    0.01048
    """

    lower: xr.DataArray
    upper: xr.DataArray | None = None
    _: KW_ONLY
    young: float
    poisson: float
    block: Any = None
    basic_friction_angle: float = 35.0
    layout: Block = field(init=False)

    def __post_init__(self) -> None:
        with Problems(WHERE) as problems:
            young = problems.number("young", self.young, above=0)
            poisson = problems.number("poisson", self.poisson, above=-1, below=0.5)
            angle = problems.number("basic_friction_angle", self.basic_friction_angle, at_least=0, below=90)
            grid = check_surface(self.lower, problems, "lower", finite=False)
            layout = _layout(self.block, grid, problems)
            if not problems.found:
                _check_heights(self.lower, layout, problems, "lower")
            if self.upper is not None:
                _check_upper(self.upper, self.lower, grid, layout, problems)
        for name, value in (("young", young), ("poisson", poisson), ("basic_friction_angle", angle)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "layout", layout)
        object.__setattr__(self, "block", layout.edges)

    def __repr__(self) -> str:
        """One line: the faces, the block and the material."""
        (ny, nx), (by, bx) = self.layout.face, self.layout.cells
        faces = "mated faces" if self.upper is None else "two faces"
        block = f"block of {by} x {bx} cells, {self.block[0]:g} x {self.block[1]:g} m"
        material = f"young={self.young:g}, poisson={self.poisson:g}"
        friction = f"basic_friction_angle={self.basic_friction_angle:g}"
        return f"Crack({faces} of {ny} x {nx}, {block}, {material}, {friction})"

    @property
    def nominal_area(self) -> float:
        """Area of the block, m2."""
        return float(self.block[0] * self.block[1])

    @property
    def contact_modulus(self) -> float:
        """E* of two half-spaces of this material, Pa."""
        from fractalcontact.contact import effective_modulus

        return float(effective_modulus(self.young, self.poisson))

    def travel(self, direction: str | float = "E") -> float:
        """Return the greatest shear towards `direction`, m; infinite where the face wraps."""
        from fractalcontact.joints._directions import one_direction

        with Problems(f"{WHERE}.travel") as problems:
            towards = one_direction(direction, problems)
        return self.layout.travel(towards.unit)

    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the heights of the whole lower face and of the block's own face, as float64 arrays."""
        lower = np.asarray(self.lower.values, dtype=np.float64)
        upper = lower if self.upper is None else np.asarray(self.upper.values, dtype=np.float64)
        return lower, upper[self.layout.slices]

    def summary(self) -> dict[str, Any]:
        """Return what a result says about its crack, in plain types."""
        return {
            "lower": plain(self.lower),
            "upper": "mated" if self.upper is None else plain(self.upper),
            "young": self.young,
            "poisson": self.poisson,
            "block": list(self.block),
            "block_cells": list(self.layout.cells),
            "basic_friction_angle": self.basic_friction_angle,
        }


def _layout(block: Any, grid: Grid, problems: Problems) -> Block:
    face = (grid.shape[0], grid.shape[-1])
    spacing = (grid.spacing[0], grid.spacing[-1])
    cells = face
    if block is not None:
        before = len(problems.found)
        edges = problems.numbers("block", block, above=0, at_most=1e100)
        if edges.size > 2:
            problems.add("block", "one edge length or (y, x), in metres", block)
        if len(problems.found) > before:
            return Block(face, face, (0, 0), spacing, (grid.periodic[0], grid.periodic[-1]))
        pair = (float(edges[0]), float(edges[min(1, edges.size - 1)]))
        cells = tuple(math.floor(edge / step + 0.5) for edge, step in zip(pair, spacing, strict=True))  # type: ignore[assignment]
    for name, b, n, step in zip(("y", "x"), cells, face, spacing, strict=True):
        if not SMALLEST <= b <= n:
            expected = f"{SMALLEST} to {n} cells along {name}, {SMALLEST * step:g} to {n * step:g} m"
            problems.add("block", expected, f"{b} cells")
    return Block(face, cells, centred(face, cells), spacing, (grid.periodic[0], grid.periodic[-1]))


def _check_heights(face: xr.DataArray, layout: Block, problems: Problems, argument: str) -> None:
    values = np.asarray(face.values, dtype=np.float64)
    infinite = int(np.count_nonzero(np.isinf(values)))
    problems.require(infinite == 0, argument, "no infinite heights", f"{infinite}")
    problems.finite(f"{argument} inside the block", values[layout.slices], remedy=FILL)


def _check_upper(upper: Any, lower: Any, grid: Grid, layout: Block, problems: Problems) -> None:
    before = len(problems.found)
    own = check_surface(upper, problems, "upper", finite=False)
    if len(problems.found) > before or not hasattr(lower, "coords"):
        return
    if own.shape != grid.shape:
        problems.add("upper", f"the shape of lower, {grid.shape}", own.shape)
        return
    for axis, name in enumerate(("y", "x")):
        if name not in lower.coords:
            continue
        apart = np.abs(upper[name].values - lower[name].values).max()
        allowed = UNIFORM * grid.spacing[axis] + 4.0 * np.spacing(np.abs(lower[name].values).max())
        if not apart <= allowed:
            problems.add(f"upper.{name}", f"the positions of lower.{name}", f"up to {apart:g} m off")
    if not problems.found:
        _check_heights(upper, layout, problems, "upper")
