"""Checks and coordinates that several functions of this room share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.joints._directions import Direction
from fractalcontact.joints._sliding import WHOLE, Block, heights_under, spline_error
from fractalcontact.joints.crack import FILL, Crack

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.base.checks import Problems

Array = np.ndarray[Any, np.dtype[Any]]


def check_crack(crack: Any, problems: Problems) -> None:
    """Note it if `crack` is not a Crack."""
    if not isinstance(crack, Crack):
        problems.add("crack", "a fractalcontact.joints.Crack", type(crack).__name__)


def is_nothing(keep: Any) -> bool:
    """Say whether no map is to be kept."""
    return keep is None or (np.ndim(keep) > 0 and len(keep) == 0)


def check_shear(shear: Any, crack: Any, directions: Sequence[Direction], problems: Problems) -> Array:
    """Return the shears (m) as an array; each comes once and keeps the block on its face."""
    shears = problems.numbers("shear", shear, at_least=0)
    values, counts = np.unique(shears, return_counts=True)
    if (counts > 1).any():
        twice = ", ".join(f"{value:g} m" for value in values[counts > 1][:5])
        problems.add("shear", "every shear once", f"{twice} several times")
    if not isinstance(crack, Crack) or problems.found:
        return shears
    longest = float(shears.max())
    for direction in directions:
        travel = crack.layout.travel(direction.unit)
        slack = WHOLE * min(crack.layout.spacing)
        if longest > travel + slack:
            expected = (
                f"at most {travel:g} m towards {direction.name}, where the block meets the edge of the face"
            )
            if travel == 0:
                expected += " (give the Crack a smaller `block`, or periodic faces)"
            problems.add("shear", expected, longest)
    return shears


def missing(where: str, crack: Crack, direction: Direction, shear: float) -> InvalidInput:
    """Return the error for heights that are missing in the path of the block."""
    under = heights_under(crack.faces()[0], crack.layout, crack.layout.shift(shear, direction.unit))
    count = int(np.count_nonzero(~np.isfinite(under)))
    return InvalidInput(
        where,
        [
            f"crack.lower: expected finite heights under the block ({FILL}), got {count} missing "
            f"at a shear of {shear:g} m towards {direction.name}"
        ],
    )


def resampling_errors(crack: Crack, shears: Array, directions: Sequence[Direction]) -> Array:
    """Return the rms error (m) of the heights under the block, shape (direction, shear).

    Zero for whole shifts, and along axes that wrap, where a shift is exact for what the grid resolves; else
    that of the spline half way between two points.
    """
    layout, face = crack.layout, crack.faces()[0]
    squares: dict[int, float] = {}
    found = np.zeros((len(directions), shears.size))
    for i, direction in enumerate(directions):
        for j, shear in enumerate(shears):
            for axis, cells in enumerate(layout.shift(float(shear), direction.unit)):
                if cells == np.floor(cells) or layout.wraps[axis]:
                    continue
                if axis not in squares:
                    squares[axis] = spline_error(face, axis) ** 2
                found[i, j] += squares[axis]
    return np.sqrt(found)


def block_coords(crack: Crack, layout: Block) -> dict[str, xr.DataArray]:
    """Return the block's own x and y; an axis along which the block is a whole period keeps it."""
    import xarray as xr

    coords = {}
    for axis, dim in enumerate(("y", "x")):
        values = np.asarray(crack.lower[dim].values, dtype=np.float64)[layout.slices[axis]]
        attributes = {"period": float(layout.edges[axis])} if layout.periodic[axis] else {}
        coords[dim] = xr.DataArray(values, dims=dim, attrs=attributes)
    return coords


def direction_coords(directions: Sequence[Direction]) -> dict[str, Any]:
    """Return the coordinates `direction` and `azimuth` over the dim `direction`."""
    return {
        "direction": ("direction", np.array([direction.name for direction in directions])),
        "azimuth": ("direction", np.array([direction.azimuth for direction in directions])),
    }
