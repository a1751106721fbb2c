"""Joint roughness coefficient (JRC) of a measured surface from the slope of its profiles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import read_grid
from fractalcontact.base.polynomial import detrended
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints._directions import Direction, check_directions, direction_coords, read_directions

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.joints.roughness_coefficient"
LAG = 1.27e-3  # m: the interval of the readings to which the correlation was fitted
LARGEST_JRC = 20.0
OUTSIDE = "NaN where the law gives less than 0 or more than 20, the ends of the scale of standard profiles"
REFERENCES = (
    "Tse, R. and Cruden, D. M., Estimating joint roughness coefficients, Int. J. Rock Mech. Min. Sci. 16 "
    "(1979)"
)


def _check(problems: Problems, *, surface: Any, direction: Any, lag: Any) -> None:
    directions_are_valid = check_directions(problems, direction)
    lag_is_valid = problems.number("lag", lag, above=0, at_most=1e100)
    if not (problems.surface("surface", surface, finite=False) and directions_are_valid and lag_is_valid):
        return
    grid = read_grid(surface)
    for towards in read_directions(direction):
        cells = _lag_cells(grid.spacing, towards, float(lag))
        fits = all(abs(n) < size for n, size in zip(cells, grid.shape, strict=True))
        problems.require(fits, "surface", f"heights {lag:g} m apart towards {towards.name}", "none")


@public_result(
    title="joint roughness coefficient",
    references=REFERENCES,
    achieved_error="that of the correlation with the slope, which is empirical",
    check=_check,
)
def roughness_coefficient(
    surface: xr.DataArray,
    *,
    direction: str | float | Sequence[str | float] = ("E", "N"),
    lag: float = LAG,
) -> xr.Dataset:
    """Return the joint roughness coefficient JRC of a measured surface, JRC = 32.2 + 32.47 log10(Z2).

    Z2 is the root mean square slope of the profiles along a direction, between readings one lag apart, after
    removal of the mean plane. On a fractal surface Z2 grows as the lag decreases. The correlation is
    therefore only valid at the lag of the standard profiles, 1.27 mm, which is the default.

    Parameters
    ----------
    surface : DataArray, shape (y, x)
        Heights, m; missing ones (NaN) are left out.
    direction : str, float, or a sequence of them
        Directions of the profiles: compass words, or azimuths in degrees. Opposite ones give the same.
    lag : float
        Interval between the readings, m; it is rounded to whole cells (y, x), at least one.

    Returns
    -------
    Dataset over direction
        roughness_coefficient, the `roughness` of `barton_choubey_strength`, NaN with the `reason` outside 0
        to 20; profile_slope Z2; lag (m) in use.

    Raises
    ------
    InvalidInput
        `surface` is no surface, is shorter than the lag or has no pair of heights one lag apart, or an
        argument is wrong.

    References
    ----------
    Tse and Cruden (1979), Int. J. Rock Mech. Min. Sci. 16:303; Barton and Choubey (1977), Rock Mechanics
    10:1.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> teeth = 0.2e-3 * (np.arange(40) % 2) * np.ones((40, 1))  # slope 0.2 mm over 1.27 mm
    >>> surface = fc.surfaces.from_array(teeth, 1.27e-3)
    >>> jrc = fc.joints.roughness_coefficient(surface, direction="E").roughness_coefficient
    >>> jrc.values.round(1).tolist()  # 32.2 + 32.47 log10(0.2 / 1.27)
    [6.1]
    """
    grid = read_grid(surface)
    directions = read_directions(direction)
    plane = detrended(np.asarray(surface.values, dtype=np.float64), 1)[0]
    slopes, lags = np.empty(len(directions)), np.empty(len(directions))
    with Problems(WHERE) as problems:
        for i, towards in enumerate(directions):
            slopes[i], lags[i] = _rms_slope(plane, grid.spacing, towards, float(lag))
            expected = f"heights {lag:g} m apart towards {towards.name}"
            problems.require(math.isfinite(slopes[i]), "surface", expected, "none")
    with np.errstate(divide="ignore"):
        coefficient = 32.2 + 32.47 * np.log10(slopes)
    inside = (coefficient >= 0) & (coefficient <= LARGEST_JRC)
    result = xr.Dataset(
        {
            "roughness_coefficient": ("direction", np.where(inside, coefficient, np.nan)),
            "profile_slope": ("direction", slopes),
            "lag": ("direction", lags),
        },
        coords=direction_coords(directions),
    )
    if not inside.all():
        result["roughness_coefficient"].attrs["reason"] = OUTSIDE
    return result


def _lag_cells(spacing: Sequence[float], towards: Direction, lag: float) -> list[int]:
    """Return the lag in cells (y, x), at least one cell along the longer component."""
    cells = [round(lag * part / step) for part, step in zip(towards.unit, spacing, strict=True)]
    if not any(cells):
        axis = int(abs(towards.unit[1]) >= abs(towards.unit[0]))
        cells[axis] = 1 if towards.unit[axis] > 0 else -1
    return cells


def _rms_slope(plane: Array, spacing: Sequence[float], towards: Direction, lag: float) -> tuple[float, float]:
    """Return the rms slope between heights one lag apart (NaN without any), and the lag in use."""
    cells = _lag_cells(spacing, towards, lag)
    ahead = tuple(slice(max(n, 0), size + min(n, 0)) for n, size in zip(cells, plane.shape, strict=True))
    behind = tuple(slice(max(-n, 0), size + min(-n, 0)) for n, size in zip(cells, plane.shape, strict=True))
    length = math.hypot(*(n * step for n, step in zip(cells, spacing, strict=True)))
    rise = plane[ahead] - plane[behind]
    rise = rise[np.isfinite(rise)]
    return (math.sqrt(np.mean(rise**2)) / length if rise.size else math.nan), length
