"""Roughness of a measured face in the words of rock mechanics: the joint roughness coefficient."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import check_surface
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import direction_coords
from fractalcontact.joints._directions import Direction, several_directions

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.roughness_coefficient"
LAG = 1.27e-3  # m: the interval of the readings to which the law was fitted
ROUGHEST = 20.0
OUTSIDE = "NaN where the law gives less than 0 or more than 20, the ends of the scale of standard profiles"
REFERENCES = (
    "Tse, R. and Cruden, D. M., Estimating joint roughness coefficients, Int. J. Rock Mech. Min. Sci. 16 "
    "(1979)"
)
Array = np.ndarray[Any, np.dtype[Any]]


@accounted("that of the correlation with the slope, which is empirical")
def roughness_coefficient(
    face: xr.DataArray,
    *,
    direction: str | float | Sequence[str | float] = ("E", "N"),
    lag: float = LAG,
) -> xr.Dataset:
    """Return the joint roughness coefficient JRC of a measured face, JRC = 32.2 + 32.47 log10(Z2).

    Z2 is the root mean square slope of the profiles along a direction, each from its mean plane, between
    readings one lag apart. On a fractal face it grows as the lag falls, so the coefficient means something
    only at the lag of the standard profiles, 1.27 mm, which is the default.

    Parameters
    ----------
    face : DataArray, shape (y, x)
        Heights, m; missing ones (NaN) are left out.
    direction : str, float, or a sequence of them
        Directions of the profiles: compass words, or azimuths in degrees. Opposite ones give the same.
    lag : float
        Interval between the readings, m; the nearest whole cells (y, x) are taken and their distance is kept.

    Returns
    -------
    Dataset over direction
        roughness_coefficient, to be given to `barton_choubey_strength` and its like, NaN with the `reason`
        outside 0 to 20; profile_slope Z2; lag (m) in use.

    Raises
    ------
    InvalidInput
        The face is no surface, is shorter than the lag or sees no pair of heights, or an argument is wrong.

    References
    ----------
    Tse and Cruden (1979), Int. J. Rock Mech. Min. Sci. 16:303; Barton and Choubey (1977), Rock Mechanics
    10:1.
    """
    import xarray as xr

    from fractalcontact.base.polynomial import detrended

    with Problems(WHERE) as problems:
        grid = check_surface(face, problems, "face", finite=False)
        towards = several_directions(direction, problems)
        length = problems.number("lag", lag, above=0, at_most=1e100)
        if not problems.found:
            plane = detrended(np.asarray(face.values, dtype=np.float64), 1)[0]
            spacing = (grid.spacing[0], grid.spacing[1])
            found = [_slope(plane, spacing, one, length) for one in towards]
            for one, (slope, _) in zip(towards, found, strict=True):
                expected = f"heights {length:g} m apart towards {one.name}"
                problems.require(math.isfinite(slope), "face", expected, "none")
    slopes, lags = (np.array(column) for column in zip(*found, strict=True))
    with np.errstate(divide="ignore"):
        coefficient = 32.2 + 32.47 * np.log10(slopes)
    inside = (coefficient >= 0) & (coefficient <= ROUGHEST)
    result = xr.Dataset(
        {
            "roughness_coefficient": ("direction", np.where(inside, coefficient, np.nan)),
            "profile_slope": ("direction", slopes),
            "lag": ("direction", lags),
        },
        coords=direction_coords(towards),
    )
    parameters = {"face": face, "direction": [one.name for one in towards], "lag": lag}
    result = stamp(
        label(result), WHERE, parameters, title="joint roughness coefficient", references=REFERENCES
    )
    if not inside.all():
        result["roughness_coefficient"].attrs["reason"] = OUTSIDE
    return result


def _slope(plane: Array, spacing: tuple[float, float], towards: Direction, lag: float) -> tuple[float, float]:
    """Return the rms slope between heights one lag apart, and the lag in use."""
    cells = [round(lag * part / step) for part, step in zip(towards.unit, spacing, strict=True)]
    if not any(cells):  # at least one cell along the longer component
        axis = int(abs(towards.unit[1]) >= abs(towards.unit[0]))
        cells[axis] = 1 if towards.unit[axis] > 0 else -1
    if any(abs(n) >= size for n, size in zip(cells, plane.shape, strict=True)):
        return math.nan, math.nan
    ahead = tuple(slice(max(n, 0), size + min(n, 0)) for n, size in zip(cells, plane.shape, strict=True))
    behind = tuple(slice(max(-n, 0), size + min(-n, 0)) for n, size in zip(cells, plane.shape, strict=True))
    used = math.hypot(*(n * step for n, step in zip(cells, spacing, strict=True)))
    rise = plane[ahead] - plane[behind]
    rise = rise[np.isfinite(rise)]
    return (math.sqrt(np.mean(rise**2)) / used if rise.size else math.nan), used
