"""The delta-surface: what separates the faces once the block has slid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import (
    block_coords,
    check_crack,
    check_shear,
    direction_coords,
    missing,
    resampling_errors,
)
from fractalcontact.joints._directions import Direction, is_one, several_directions
from fractalcontact.joints._sliding import heights_under

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints.crack import Crack

WHERE = "fractalcontact.joints.delta_surface"
Array = np.ndarray[Any, np.dtype[Any]]


@accounted()
def delta_surface(
    crack: Crack,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = "E",
) -> xr.DataArray:
    """Return the difference of the facing heights after the block has slid.

    In coordinates x of the block, delta(x) = lower(x + v) - upper(x), where the block moves by v towards
    `direction`. Pressing the sheared crack together is pressing this surface with a flat from above. A
    plane of slope m towards E adds m v to the delta-surface towards E and -m v towards W.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacement v >= 0, m, each once. Within 1e-6 of whole cells the shift is a copy, and exact.
        Else it is band-limited where the face wraps, and a quintic spline on a free axis.
    direction : str, float, or a sequence of them
        E, NE, N, NW, W, SW, S, SE (E is +x, N is +y), or the azimuth in degrees from E, anticlockwise.

    Returns
    -------
    DataArray `height`, shape (y, x), after (direction,) and (shear,) where sequences are given
        Metres, on the grid of the block. An axis is periodic where the block is a whole period of its face.
        The coordinate interpolation_error (m) is the rms error of the heights under the block: 0 for whole
        shifts; else that of the spline half way between two points, measured on the face where every second
        height is left out. NaN where the face has fewer than 40 points in a row.

    Raises
    ------
    InvalidInput
        The block would leave its face (the greatest travel is named), or heights are missing in its path.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 3.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        check_crack(crack, problems)
        towards = several_directions(direction, problems)
        shears = check_shear(shear, crack, towards, problems)
    planes = np.empty((len(towards), shears.size, *crack.layout.cells))
    for several, one in zip(planes, towards, strict=True):
        for plane, v in zip(several, shears, strict=True):
            plane[:] = delta_plane(crack, float(v), one, WHERE)
    coords: dict[str, Any] = {"shear": ("shear", shears), **block_coords(crack, crack.layout)}
    coords |= direction_coords(towards)
    coords["interpolation_error"] = ("direction", "shear"), resampling_errors(crack, shears, towards)
    dims = ("direction", "shear", "y", "x")
    result = xr.DataArray(planes, dims=dims, coords=coords, name="height")
    if np.ndim(shear) == 0:
        result = result.isel(shear=0)
    if is_one(direction):
        result = result.isel(direction=0)
    parameters = {"crack": crack.summary(), "shear": shears, "direction": [one.name for one in towards]}
    return stamp(label(result), WHERE, parameters, title="delta-surface of a sheared crack")


def delta_plane(crack: Crack, shear: float, towards: Direction, where: str) -> Array:
    """Return the heights of one delta-surface, shape (y, x) of the block."""
    lower, upper = crack.faces()
    under = heights_under(lower, crack.layout, crack.layout.shift(shear, towards.unit))
    plane = np.asarray(under - upper)
    if not np.isfinite(plane).all():
        raise missing(where, crack, towards, shear)
    return plane
