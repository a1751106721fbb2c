"""Directional roughness after Grasselli: the slopes of a surface that face a shear, for each azimuth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_directions, read_directions
from fractalcontact.base.grid import read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import ROUNDING, detrended, rounding_of, slopes
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems

EVERY_5_DEGREES = tuple(5.0 * i for i in range(72))

NO_FACET = "NaN where no facet faces the shear"
REFERENCES = (
    "Grasselli, G., Wirth, J. and Egger, P., Quantitative three-dimensional description of a rough surface "
    "and parameter evolution with shearing, Int. J. Rock Mech. Min. Sci. 39 (2002); Tatone, B. S. A. and "
    "Grasselli, G., A method to evaluate the three-dimensional roughness of fracture surfaces in brittle "
    "geomaterials, Rev. Sci. Instrum. 80 (2009)"
)


def _check(problems: Problems) -> None:
    given = problems.given
    check_directions(problems)
    if problems.surface("surface", finite=False):
        complete = np.isfinite(given.surface.values)
        complete = complete[1:, 1:] & complete[1:, :-1] & complete[:-1, 1:] & complete[:-1, :-1]
        problems.require(bool(complete.any()), "surface", "four neighbouring heights", "none")


@public_result(
    title="directional roughness",
    references=REFERENCES,
    achieved_error="exact to rounding, but for shape and roughness_metric, which are a fit",
    reasons={"shape": NO_FACET},
    check=_check,
)
def directional_roughness(
    surface: xr.DataArray, *, direction: str | float | Sequence[str | float] = EVERY_5_DEGREES
) -> xr.Dataset:
    """Return the directional roughness of a surface after Grasselli, from its facets that face the shear.

    The apparent dip of a facet is the angle, in the vertical plane along the shear, by which it rises towards
    the shear, above the mean plane. The share of the area with an apparent dip of at least theta follows
    A(theta) = A0 (1 - theta/theta_max)^C, which is fitted for C.

    Parameters
    ----------
    surface : DataArray, shape (y, x)
        Heights, m; cells beside a missing height (NaN) are left out.
    direction : str, float, or a sequence of them
        Directions in which the block above the surface slides: compass words, or degrees anticlockwise from
        E. Default: every 5 degrees.

    Returns
    -------
    Dataset over azimuth
        area_fraction A0; theta_max, degree; shape C; roughness_metric theta_max/(C+1), degree; mean_dip,
        the area-weighted mean of the apparent dips that face the shear, degree, which equals the metric where
        the law is exact.

    Raises
    ------
    InvalidInput
        `surface` is no surface or has no four neighbouring heights, or a direction is wrong.

    Notes
    -----
    Every cell between four heights is divided into two triangles by either of its diagonals, with half the
    weight each, so that a mirrored surface gives the mirrored result. A0 of opposite azimuths add up to 1
    where no facet is level. On a fractal surface the dips, and theta_max most of all, grow as the spacing
    decreases: compare surfaces of equal spacing.

    References
    ----------
    Grasselli, Wirth and Egger (2002), Int. J. Rock Mech. Min. Sci. 39:789; Tatone and Grasselli (2009), Rev.
    Sci. Instrum. 80:125110.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> x = np.arange(401) % 20
    >>> teeth = np.minimum(x, (20 - x) / 3) * np.ones((5, 1))  # rise by 45 degrees, fall by atan(1/3)
    >>> surface = fc.surfaces.from_array(1e-3 * teeth, 1e-3)
    >>> result = fc.joints.directional_roughness(surface, direction=["E", "W"])
    >>> result.roughness_metric.values.round(1).tolist()
    [45.0, 18.4]
    >>> result.area_fraction.values.round(3).tolist()  # 5 sqrt(2) and 15 sqrt(10/9) of each tooth
    [0.309, 0.691]
    """
    directions = read_directions(direction)
    facets = _facets(np.asarray(surface.values, dtype=np.float64), read_grid(surface).spacing)
    measures = np.array([_facing(facets, towards.unit) for towards in directions])
    names = ("area_fraction", "theta_max", "shape", "roughness_metric", "mean_dip")
    return xr.Dataset(
        {name: ("azimuth", values) for name, values in zip(names, measures.T, strict=True)},
        coords={"azimuth": [towards.azimuth for towards in directions]},
    )


class Facets(NamedTuple):
    """Rise along y and x over the mean plane, and area, of every triangle; slopes (y, x) of that plane.

    `rounding` is the greatest rise that is only rounding.
    """

    rise_y: Array
    rise_x: Array
    area: Array
    mean_slopes: tuple[float, float]
    rounding: float


def _facets(heights: Array, spacing: Sequence[float]) -> Facets:
    """Return the triangles of a plane: four of each cell, two for either diagonal, with half their area.

    With the normal n of a triangle and the normal N of the mean plane the rise along a shear t in that plane
    is -(n t)/(n N); it is linear in t.
    """
    dy, dx = spacing
    plane_y, plane_x = slopes(heights, spacing)
    rounding = rounding_of(heights) / min(spacing)
    heights = detrended(heights, 1)[0]
    along_x, along_y = np.diff(heights, axis=1) / dx, np.diff(heights, axis=0) / dy
    south, north = along_x[:-1], along_x[1:]  # edges of the cells
    west, east = along_y[:, :-1], along_y[:, 1:]
    # a triangle has two edges of its cell; each pair of neighbouring edges occurs once
    slope_y = np.stack([west, east, west, east])
    slope_x = np.stack([south, south, north, north])
    complete = np.isfinite(west + east + south + north)
    slope_y, slope_x = slope_y[:, complete].ravel(), slope_x[:, complete].ravel()
    area = 0.25 * np.sqrt(1.0 + (slope_y + plane_y) ** 2 + (slope_x + plane_x) ** 2)
    square = plane_y**2 + plane_x**2
    if square > 0.0:
        share = math.sqrt(1.0 + square) / (1.0 + square + plane_y * slope_y + plane_x * slope_x)  # 1 / (n N)
        slope_y, slope_x = slope_y * share, slope_x * share
    return Facets(slope_y, slope_x, area, (plane_y, plane_x), rounding)


def _facing(
    facets: Facets,
    unit: tuple[float, float],
    thresholds: int = 200,  # of dip, at which the law is fitted; 100 and 400 change C by less than 0.1 %
    size: int = 1 << 15,  # facets at a time: 2^15 to 2^18 take 0.7 of the time of all of 512 x 512 points
) -> tuple[float, float, float, float, float]:
    """Return A0, theta_max, C, theta_max/(C+1) and the mean dip (degree) of the facets facing the shear.

    tan theta* = -tan theta cos alpha, with the dip theta of the facet from the mean plane and the angle alpha
    between the shear and the direction in which it dips (Grasselli et al. 2002): the rise along the shear.
    """
    along = unit[0] * facets.mean_slopes[0] + unit[1] * facets.mean_slopes[1]  # of the mean plane
    unit_y, unit_x = (each / math.sqrt(1.0 + along**2) for each in unit)
    parts = [slice(start, start + size) for start in range(0, facets.area.size, size)]

    def rise_of(part: slice) -> Array:
        return unit_y * facets.rise_y[part] + unit_x * facets.rise_x[part]

    steepest = max(float(rise_of(part).max()) for part in parts)
    if steepest <= facets.rounding:
        return 0.0, 0.0, math.nan, 0.0, 0.0
    theta_max = float(np.arctan(steepest))
    # area of each class of dips 0 <= theta <= theta_max, and sum of area times dip
    areas, moment = np.zeros(thresholds), 0.0
    for part in parts:
        rise = rise_of(part)
        area = np.where(rise > facets.rounding, facets.area[part], 0.0)
        dip = np.arctan(np.maximum(rise, 0.0))
        bins = np.minimum((dip * (thresholds / theta_max)).astype(np.int64), thresholds - 1)
        areas += np.bincount(bins, weights=area, minlength=thresholds)
        moment += float(np.sum(area * dip))
    facing_area = float(areas.sum())
    share = np.cumsum(areas[::-1])[::-1] / facing_area
    shape = _fitted_shape(1.0 - np.arange(thresholds) / thresholds, share)
    return (
        facing_area / float(np.sum(facets.area)),
        math.degrees(theta_max),
        shape,
        math.degrees(theta_max) / (shape + 1.0),
        math.degrees(moment / facing_area),
    )


def _fitted_shape(remainder: Array, share: Array, largest: float = 1e6) -> float:
    """Return C >= 0 for which remainder^C is nearest to share, by least squares.

    The derivative of the sum of squares over C is zero. Where all dips but the greatest are nearly zero, the
    search ends beyond the largest C.
    """
    from scipy.optimize import brentq  # a scene reads the arguments of all joint functions

    log = np.log(remainder)

    def derivative(shape: float) -> float:
        power = remainder**shape
        return float(np.sum(power * log * (power - share)))

    if derivative(0.0) >= -ROUNDING * log.size:  # all facets have the same dip
        return 0.0
    high = 1.0
    while derivative(high) < 0.0 and high < largest:
        high *= 2.0
    return float(brentq(derivative, 0.0, high, xtol=1e-12)) if derivative(high) > 0.0 else high
