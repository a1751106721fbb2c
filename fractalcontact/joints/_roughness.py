"""Roughness of a joint: the coefficient JRC from the slope of profiles, and the facets that face a shear."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.compass import Direction, check_directions, direction_coords, read_directions
from fractalcontact.base.grid import DECADES, Grid, core_dims, read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import ROUNDING, detrended, rounding_of, slopes
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.validation import NONE, Problems, Words
from fractalcontact.joints._criteria import LARGEST_JRC, REGRESSIONS, SAMPLE_LENGTH, scaled_roughness

OUTSIDE = "outside 0 to 20, the scale of standard profiles, it is an extrapolation (see scale_position)"
STRAIGHT = "NaN where the profiles are straight lines: the regression takes the logarithm of their slope"
FEW_PROFILES = "NaN where fewer than 20 profiles are long enough, or some are straight lines"
REFERENCES = (
    "Tse, R. and Cruden, D. M., Estimating joint roughness coefficients, Int. J. Rock Mech. Min. Sci. 16 "
    "(1979); Yu, X. and Vayssade, B., Joint profiles and their roughness parameters, Int. J. Rock Mech. Min. "
    "Sci. 28 (1991); Tatone, B. S. A. and Grasselli, G., A new 2D discontinuity roughness parameter and its "
    "correlation with JRC, Int. J. Rock Mech. Min. Sci. 47 (2010)"
)


def _check(problems: Problems) -> tuple[Any, float]:
    """Return directions and lag, those of the call or the defaults."""
    given = problems.given
    direction = given.direction
    directions_are_valid = given.direction is None or check_directions(problems)
    lag_is_valid = problems.number("lag", above=0, at_most=10.0**DECADES, optional=True)
    lag_is_valid = problems.choice("regression", among=REGRESSIONS) and lag_is_valid
    problems.number("length", at_least=SAMPLE_LENGTH, at_most=10.0**DECADES, optional=True)
    if not problems.surface("surface", finite=False, profile=True):
        return direction, math.nan
    is_observed = bool(np.isfinite(given.surface.values).any())
    problems.require(is_observed, "surface", "observed heights", Words("nothing but NaN"))
    if not (directions_are_valid and lag_is_valid):
        return direction, math.nan
    grid = read_grid(given.surface, core_dims(given.surface))
    interval = REGRESSIONS[given.regression][0].interval if given.lag is None else float(given.lag)
    if direction is None:
        direction = ("E", "N")[: len(grid.shape)]
    for towards in read_directions(direction):
        if len(grid.shape) == 1 and towards.unit[0] != 0.0:
            problems.add("direction", "E or W for a profile", towards.name)
            continue
        cells = _lag_cells(grid.spacing, towards, interval)
        fits = all(abs(n) < size for n, size in zip(cells, grid.shape, strict=True))
        problems.require(fits, "surface", f"heights {interval:g} m apart towards {towards.name}", NONE)
    return direction, interval


@public_result(
    title="joint roughness coefficient",
    references=REFERENCES,
    achieved_error="that of the correlation with the slope, which is empirical",
    reasons={
        "roughness_coefficient": STRAIGHT,
        "roughness_coefficient_low": FEW_PROFILES,
        "roughness_coefficient_high": FEW_PROFILES,
    },
    check=_check,
    memory=50.0,
)
@takes_checked
def roughness_coefficient(
    checked: tuple[Any, float],
    /,
    surface: xr.DataArray,
    *,
    direction: str | float | Sequence[str | float] | None = None,
    regression: str = "tse_cruden",
    lag: float | None = None,
    length: float | None = None,
) -> xr.Dataset:
    """Return the joint roughness coefficient JRC of a surface or profile from the slope Z2 of its profiles.

    Z2 is the root mean square slope along a direction between readings one lag apart, after removal of the
    mean plane (of a profile: the mean line), which has no slope along a periodic axis. On a fractal surface
    Z2 grows as the lag decreases. A regression is therefore only valid at the sampling interval to which it
    was fitted, which is the default lag.

    Parameters
    ----------
    surface : DataArray, shape (y, x) or (x,)
        Heights, m; missing ones (NaN) are left out.
    direction : str, float, or a sequence of them
        Directions of the profiles: compass words, or degrees anticlockwise from E. Opposite ones give the
        same. Default: E and N; E for a profile.
    regression : {"tse_cruden", "yu_vayssade", "tatone_grasselli"}
        Regression of JRC over Z2, with the sampling intervals to which it was fitted: 0.508 mm; 0.25, 0.5
        and 1 mm; 0.5 and 1 mm. The one whose interval is nearest to the lag in use is taken.
    lag : float, optional
        Interval between the readings, m; it is rounded to whole cells (y, x), at least one, which turns it
        where these are few. Default: 0.508 mm for "tse_cruden", otherwise 0.5 mm.
    length : float, optional
        Length of a joint, m, at least 0.1, to which the coefficient is scaled as well.

    Returns
    -------
    Dataset over direction
        roughness_coefficient, the JRC of `strength_envelope`; a value outside 0 to 20 is an
        extrapolation, which scale_position reports. roughness_coefficient_low and _high, between which 95 %
        of the single profiles of the surface lie, NaN of fewer than 20. profile_slope Z2; lag (m) and
        lag_azimuth (degree) in use, of whole cells; regression_interval (m). With `length`
        scaled_roughness_coefficient.

    Raises
    ------
    InvalidInput
        `surface` is no surface, is shorter than the lag or has no pair of heights one lag apart, or an
        argument is wrong.

    Notes
    -----
    The two limits describe the scatter of profiles as long as the surface. They are no confidence interval
    of the coefficient.

    References
    ----------
    Tse and Cruden (1979), Int. J. Rock Mech. Min. Sci. 16:303; Yu and Vayssade (1991), Int. J. Rock Mech.
    Min. Sci. 28:333; Tatone and Grasselli (2010), Int. J. Rock Mech. Min. Sci. 47:1391; Barton and Bandis
    (1982), 23rd US Symposium on Rock Mechanics.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> teeth = 0.1e-3 * (np.arange(40) % 2) * np.ones((40, 1))  # slope 0.1 mm over 0.5 mm
    >>> surface = fc.surfaces.from_array(teeth, 0.5e-3)
    >>> jrc = fc.joints.roughness_coefficient(surface, direction="E").roughness_coefficient
    >>> jrc.values.round(1).tolist()  # 32.2 + 32.47 log10(0.2)
    [9.5]
    >>> result = fc.joints.roughness_coefficient(surface, direction="E", regression="yu_vayssade")
    >>> result.roughness_coefficient.values.round(1).tolist()  # 61.79 * 0.2 - 3.47
    [8.9]
    """
    (direction, interval), grid = checked, read_grid(surface, core_dims(surface))
    directions = read_directions(direction)
    heights = detrended(np.asarray(surface.values, dtype=np.float64), 1, grid.periodic)[0]
    rows, limits = [], np.full((2, len(directions)), np.nan)
    with Problems("") as problems:
        for i, towards in enumerate(directions):
            cells = _lag_cells(grid.spacing, towards, interval)
            y, x = [0.0, *np.multiply(cells, grid.spacing)][-2:]
            used, azimuth = math.hypot(y, x), math.degrees(math.atan2(y, x)) % 360.0
            slope, of_profiles = _profile_slopes(heights, grid, cells, used)
            fitted = min(REGRESSIONS[regression], key=lambda law: abs(math.log(law.interval / used)))
            rows.append((fitted.coefficient(slope), slope, used, azimuth, fitted.interval))
            # JRC grows with Z2: the quantiles correspond. Below 20 profiles the low one is beyond all but one
            if of_profiles.size >= 20:
                limits[:, i] = fitted.coefficient(np.quantile(of_profiles, (0.025, 0.975)))
            expected = f"heights {interval:g} m apart towards {towards.name}"
            problems.require(math.isfinite(slope), "surface", expected, NONE)
    coefficient, slopes, lags, azimuths, intervals = np.transpose(rows)
    position = (coefficient > LARGEST_JRC).astype(np.int8) - (coefficient < 0)
    limits[:, ~np.isfinite(limits).all(axis=0)] = np.nan
    variables = {
        "roughness_coefficient": np.where(np.isfinite(coefficient), coefficient, np.nan),
        "roughness_coefficient_low": limits[0],
        "roughness_coefficient_high": limits[1],
        "scale_position": position,  # -1 below, 1 above
        "profile_slope": slopes,
        "lag": lags,
        "lag_azimuth": azimuths,
        "regression_interval": intervals,
    }
    if length is not None:
        variables["scaled_roughness_coefficient"] = scaled_roughness(
            np.where(coefficient >= 0, coefficient, np.nan), float(length)
        )
    result = xr.Dataset(
        {name: ("direction", values) for name, values in variables.items()},
        coords=direction_coords(directions),
        attrs={"parameters": {"direction": direction, "lag": interval}},
    )
    _add_notes(result)
    return result


def _add_notes(result: xr.Dataset, tolerance: float = 0.1, largest_turn: float = 5.0) -> None:
    """Say which values are extrapolated, and where the lag is not that of the regression or the direction.

    At H = 0.7 a lag that is off by the tolerance changes the result by 0.4. At 30 degrees to straight ridges
    5 degrees change Z2 by 15 %.
    """
    comments = []
    if result["scale_position"].any():
        comments.append(OUTSIDE)
    off = np.abs(result["lag"].values / result["regression_interval"].values - 1.0) > tolerance
    if off.any():
        comments.append("the lag in use is not the sampling interval of the regression")
    turned = (result["lag_azimuth"].values - result["azimuth"].values + 180.0) % 360.0 - 180.0
    if (np.abs(turned) > largest_turn).any():
        comments.append("the lag in use, of whole cells, has another azimuth: see lag_azimuth")
    if comments:
        result["roughness_coefficient"].attrs["comment"] = "; ".join(comments)


def _lag_cells(spacing: Sequence[float], towards: Direction, lag: float) -> list[int]:
    """Return the lag in cells along each axis, at least one cell along the longer component."""
    unit = towards.unit[-len(spacing) :]
    cells = [round(lag * part / step) for part, step in zip(unit, spacing, strict=True)]
    if not any(cells):
        axis = max(range(len(unit)), key=lambda i: (abs(unit[i]), i))
        cells[axis] = 1 if unit[axis] > 0 else -1
    return cells


def _profile_slopes(heights: Array, grid: Grid, cells: Sequence[int], lag: float) -> tuple[float, Array]:
    """Return the rms slope of all profiles (NaN without any), and of each profile.

    Slopes are between heights some cells apart, the `lag` (m), and profiles the lines of cells along it.
    Those with less than half of the readings of the longest are left out: a short one scatters more.
    """
    axes = list(zip(cells, grid.periodic, strict=True))
    heights = np.pad(heights, [(max(-n, 0), max(n, 0)) if w else (0, 0) for n, w in axes], mode="wrap")
    ahead = tuple(slice(max(n, 0), size + min(n, 0)) for n, size in zip(cells, heights.shape, strict=True))
    behind = tuple(slice(max(-n, 0), size + min(-n, 0)) for n, size in zip(cells, heights.shape, strict=True))
    squares = (heights[ahead] - heights[behind]) ** 2
    observed = np.isfinite(squares)
    if not observed.any():
        return math.nan, np.empty(0)
    line = _line_numbers(squares.shape, cells, grid.spacing)[observed]
    squares = squares[observed]
    counts = np.bincount(line)
    long_enough = (counts > 0) & (2 * counts >= counts.max())
    means = np.bincount(line, weights=squares)[long_enough] / counts[long_enough]
    return math.sqrt(np.mean(squares)) / lag, np.sqrt(means) / lag


def _line_numbers(shape: Sequence[int], cells: Sequence[int], spacing: Sequence[float]) -> Array:
    """Return the number of the line along the lag, one cell wide, on which each pair of heights lies."""
    if len(shape) == 1:
        return np.zeros(shape, dtype=np.int64)
    lag_y, lag_x = (n * step for n, step in zip(cells, spacing, strict=True))
    y, x = (np.arange(n) * step for n, step in zip(shape, spacing, strict=True))
    across = (x * lag_y - y[:, None] * lag_x) / (math.hypot(lag_y, lag_x) * min(spacing))
    numbers = np.rint(across).astype(np.int64)
    return np.asarray(numbers - numbers.min())


EVERY_5_DEGREES = tuple(5.0 * i for i in range(72))

FACET_BYTES = 220.0  # of a cell: rises and area of four triangles, and what they are made from
NO_FACET = "NaN where no facet faces the shear"
FACET_REFERENCES = (
    "Grasselli, G., Wirth, J. and Egger, P., Quantitative three-dimensional description of a rough surface "
    "and parameter evolution with shearing, Int. J. Rock Mech. Min. Sci. 39 (2002); Tatone, B. S. A. and "
    "Grasselli, G., A method to evaluate the three-dimensional roughness of fracture surfaces in brittle "
    "geomaterials, Rev. Sci. Instrum. 80 (2009)"
)


def _check_facets(problems: Problems) -> None:
    given = problems.given
    check_directions(problems)
    if problems.surface("surface", finite=False):
        complete = np.isfinite(given.surface.values)
        complete = complete[1:, 1:] & complete[1:, :-1] & complete[:-1, 1:] & complete[:-1, :-1]
        problems.require(bool(complete.any()), "surface", "four neighbouring heights", "none")


@public_result(
    title="directional roughness",
    references=FACET_REFERENCES,
    achieved_error="exact to rounding, but for shape and roughness_metric, which are a fit",
    reasons={"shape": NO_FACET},
    check=_check_facets,
    memory=FACET_BYTES,
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
    where no facet is level. A periodic axis has no mean slope, and the cells that close it count. On a
    fractal surface the dips, and theta_max most of all, grow as the spacing decreases: compare surfaces of
    equal spacing.

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
    facets = _facets(np.asarray(surface.values, dtype=np.float64), read_grid(surface))
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


def _facets(heights: Array, grid: Grid) -> Facets:
    """Return the triangles of a plane: four of each cell, two for either diagonal, with half their area.

    With the normal n of a triangle and the normal N of the mean plane the rise along a shear t in that plane
    is -(n t)/(n N); it is linear in t.
    """
    dy, dx = grid.spacing
    plane_y, plane_x = slopes(heights, grid.spacing, grid.periodic)
    rounding = rounding_of(heights) / min(grid.spacing)
    heights = detrended(heights, 1, grid.periodic)[0]
    heights = np.pad(heights, [(0, int(wraps)) for wraps in grid.periodic], mode="wrap")
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
    search ends beyond the largest C; 1e3 gave the same on four rough faces.
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
    return float(brentq(derivative, 0.0, high)) if derivative(high) > 0.0 else high
