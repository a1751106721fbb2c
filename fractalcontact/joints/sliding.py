"""The delta-surface: what separates the faces once the block has slid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import block_coords, check_crack, check_shear, missing
from fractalcontact.joints._directions import Direction, one_direction
from fractalcontact.joints._sliding import heights_under, is_whole

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints.crack import Crack

WHERE = "fractalcontact.joints.delta_surface"
Array = np.ndarray[Any, np.dtype[Any]]


def delta_surface(
    crack: Crack, shear: float | Sequence[float] | Array, direction: str | float = "E"
) -> xr.DataArray:
    """Return the difference of the facing heights after the block has slid.

    In coordinates x of the block, delta(x) = lower(x + v) - upper(x), where the block moves by v towards
    `direction`. Pressing the sheared crack together is pressing this surface with a flat from above. A
    plane of slope m towards E adds m v to the delta-surface towards E and -m v towards W.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacement v >= 0, m. Within 1e-6 of whole cells the shift is a copy, and exact. Else it is
        band-limited where the face wraps, and a quintic spline on a free axis; the provenance then holds an
        `interpolation_error` (m, the largest difference from a cubic spline), which is large where the
        grid does not resolve the surface.
    direction : str or float
        E, NE, N, NW, W, SW, S, SE (E is +x, N is +y), or the azimuth in degrees from E, anticlockwise.

    Returns
    -------
    DataArray `height`, shape (y, x), or (shear, y, x) for a sequence of shears
        Metres, on the grid of the block. An axis is periodic where the block is a whole period of its face.

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
        towards = one_direction(direction, problems)
        shears = check_shear(shear, crack, (towards,), problems)
    planes, error = _planes(crack, shears, towards)
    alone = np.ndim(shear) == 0
    coords: dict[str, Any] = dict(block_coords(crack, crack.layout))
    coords |= {"shear": shears[0] if alone else ("shear", shears)}
    coords |= {"direction": towards.name, "azimuth": towards.azimuth}
    dims = ("y", "x") if alone else ("shear", "y", "x")
    result = xr.DataArray(planes[0] if alone else planes, dims=dims, coords=coords, name="height")
    parameters = {"crack": crack.summary(), "shear": shears, "direction": towards.name}
    facts: dict[str, Any] = {} if error is None else {"interpolation_error": error}
    return stamp(label(result), WHERE, parameters, title="delta-surface of a sheared crack", **facts)


def _planes(crack: Crack, shears: Array, towards: Direction) -> tuple[Array, float | None]:
    """Return the delta-surfaces and, where a spline was needed, the largest difference from a cubic one."""
    layout, (lower, upper) = crack.layout, crack.faces()
    planes = np.empty((shears.size, *layout.cells))
    error = None
    for plane, shear in zip(planes, shears, strict=True):
        plane[:] = delta_plane(crack, float(shear), towards, WHERE)
        shift = layout.shift(float(shear), towards.unit)
        if not is_whole(shift) and not all(layout.wraps):
            cubic = heights_under(lower, layout, shift, degree=3) - upper
            error = max(error or 0.0, float(np.abs(cubic - plane).max()))
    return planes, error


def delta_plane(crack: Crack, shear: float, towards: Direction, where: str) -> Array:
    """Return the heights of one delta-surface, shape (y, x) of the block."""
    lower, upper = crack.faces()
    under = heights_under(lower, crack.layout, crack.layout.shift(shear, towards.unit))
    plane = np.asarray(under - upper)
    if not np.isfinite(plane).all():
        raise missing(where, crack, towards, shear)
    return plane
