"""Texture of a surface after ISO 25178-2: correlation lengths, and the core of the heights."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.labelled import check_leading
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import shifted
from fractalcontact.base.results import public_result
from fractalcontact.base.spectra import lagged_products
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._from_array import check_stack, height_stack, labelled_rows

DECAY = 0.2  # of the autocorrelation at the lengths (ISO 25178-2, default of Sal and Str)
NO_LENGTH = (
    f"the autocorrelation does not fall to {DECAY} within half the surface in every direction, or all "
    "heights are equal"
)
_LEAST = 8  # observed points: fewer have no curve of heights of which 40 % are a line
_CORRELATION = ("autocorrelation_length", "texture_aspect_ratio")
_CORE = (
    "core_height",
    "reduced_peak_height",
    "reduced_valley_depth",
    "peak_material_ratio",
    "valley_material_ratio",
)


def _check(problems: Problems) -> None:
    given = problems.given
    if check_stack(problems):
        check_leading(given.surface, (*_CORRELATION, *_CORE, "run_time"), problems)


@public_result(
    title="Texture of a surface",
    references="ISO 25178-2 (2021), Surface texture: areal; terms, definitions and parameters",
    achieved_error="exact to rounding for the core; a hundredth of a spacing for the lengths",
    check=_check,
    memory=110.0,
    reasons=dict.fromkeys(_CORRELATION, NO_LENGTH)
    | dict.fromkeys(_CORE, f"fewer than {_LEAST} points were observed"),
)
def texture(surface: xr.DataArray) -> xr.Dataset:
    """Return the correlation lengths of a surface and the core of its height distribution (ISO 25178-2).

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). They are neither levelled nor filtered first: see
        `level` and `gaussian_filter`. Missing points (NaN) are left out.

    Returns
    -------
    Dataset
        Over the leading dims, if there are any (symbols of ISO 25178-2 in brackets):

        - autocorrelation_length (Sal, m): the shortest distance at which the autocorrelation of the heights
          about their mean has fallen to 0.2; NaN if a direction along which it has not ends before that
        - texture_aspect_ratio (Str): that distance over the longest; 1 for an isotropic surface, near 0 for a
          lay. NaN if the autocorrelation does not fall to 0.2 within half the surface in every direction.
        - core_height (Sk, m), reduced_peak_height (Spk, m), reduced_valley_depth (Svk, m),
          peak_material_ratio (Smr1) and valley_material_ratio (Smr2) of the curve of material ratio
        - run_time

        A parameter that does not exist is NaN and has the reason in its attribute `reason`.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or infinite heights.

    Notes
    -----
    The autocorrelation is the mean product of all pairs of points at a distance, over the mean square. The
    line of the core is the least-squares line through the 40 % of the curve where its secant is flattest.
    A fractal surface has no correlation length of its own: there it grows with the extent.

    References
    ----------
    ISO 25178-2 (2021), Surface texture: areal, terms, definitions and surface texture parameters.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> x = 2 * np.pi * np.arange(64) / 32
    >>> heights = 1e-6 * np.add.outer(np.cos(x), np.cos(x))
    >>> result = fc.surfaces.texture(fc.surfaces.from_array(heights, 1e-5, periodic=True))
    >>> print(f"{float(result.autocorrelation_length):.2e} m, {float(result.texture_aspect_ratio):.2f}")
    9.86e-05 m, 0.87
    """
    grid = read_grid(surface, core_dims(surface))
    stack = height_stack(surface)
    rows = [_correlation(heights, grid.spacing, grid.periodic) + _core(heights) for heights in stack]
    names = (*_CORRELATION, *_CORE)
    result = labelled_rows(surface, [dict(zip(names, row, strict=True)) for row in rows], names)
    if len(grid.shape) == 1:
        result["texture_aspect_ratio"].attrs["reason"] = "a profile has one direction"
    return result


def _correlation(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> list[float]:
    """Return the shortest distance at which the autocorrelation has fallen, and its ratio to the longest."""
    rows = np.atleast_2d(heights)
    observed = np.isfinite(rows)
    if np.count_nonzero(observed) < _LEAST or np.ptp(rows[observed]) == 0.0:
        return [math.nan, math.nan]
    values = shifted(rows)[0]
    values = np.where(observed, values - values[observed].mean(), 0.0)
    steps = (spacing[-1] if heights.ndim == 1 else spacing[0], spacing[-1])
    acf, reach = _autocorrelation(values, observed, (False, *periodic)[-2:])
    rays = 360  # over the half circle; 1440 change lengths by 2e-5 and the aspect ratio by 6e-5
    angles = np.zeros(1) if heights.ndim == 1 else np.arange(rays) * np.pi / rays
    lengths, fallen = np.transpose([_decay(acf, reach, steps, float(angle)) for angle in angles])
    # a ray along which it has not fallen may fall just beyond its end
    shortest = float(lengths.min()) if fallen[np.argmin(lengths)] else math.nan
    return [shortest, shortest / float(lengths.max()) if heights.ndim == 2 and fallen.all() else math.nan]


def _autocorrelation(
    values: Array, observed: Array, periodic: Sequence[bool]
) -> tuple[Array, tuple[int, int]]:
    """Return the autocorrelation up to half of each axis, the lag 0 in the middle, and the largest lags."""
    shape = values.shape
    reach = tuple(min(n - 1, max(n // 2, 1)) if n > 1 else 0 for n in shape)
    number = np.rint(lagged_products(observed, reach, periodic))
    products = lagged_products(values, reach, periodic)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(number > 0, products / number, np.nan)
    return mean / mean[reach[0], reach[1]], (reach[0], reach[1])


def _decay(
    acf: Array, reach: tuple[int, int], steps: tuple[float, float], angle: float
) -> tuple[float, bool]:
    """Return the distance along a ray at which the autocorrelation falls to `DECAY`, or the end and False."""
    from scipy.ndimage import map_coordinates

    unit = np.sin(angle) / steps[0], np.cos(angle) / steps[1]  # points per metre
    # not of the axis across a ray along the other; 1e-12 and 1e-6 gave the same bits
    limits = [lag / abs(u) for lag, u in zip(reach, unit, strict=True) if abs(u) > 1e-9 * max(map(abs, unit))]
    longest = min(limits)
    per_point = 4  # values in a spacing along the ray; 16 change lengths by .2 %, 1 by 1.5 %
    number = 2 + int(per_point * longest * max(map(abs, unit)))
    distance = np.linspace(0.0, longest, number)
    places = [lag + u * distance for lag, u in zip(reach, unit, strict=True)]
    # rounding puts the end of a ray beyond the edge
    coarse = map_coordinates(acf, places, order=1, mode="nearest")
    below = np.flatnonzero(coarse <= DECAY)
    if not below.size:
        return longest, False
    # a cubic through the points near the crossing; the margin leaves 6e-6 of the length, one of 2 leaves 3e-5
    near = slice(max(int(below[0]) - 2 * per_point, 0), int(below[0]) + 2 * per_point)
    low = [max(int(place[near].min()) - 4, 0) for place in places]
    high = [int(place[near].max()) + 6 for place in places]
    part = acf[low[0] : high[0], low[1] : high[1]]
    fine = map_coordinates(
        part, [place[near] - first for place, first in zip(places, low, strict=True)], order=3, mode="nearest"
    )
    where = distance[near]
    crossed = np.flatnonzero(fine <= DECAY)
    if not crossed.size or crossed[0] == 0:
        return float(where[0]) if crossed.size else float(distance[below[0]]), True
    k = int(crossed[0])
    share = (fine[k - 1] - DECAY) / (fine[k - 1] - fine[k])
    return float(where[k - 1] + share * (where[k] - where[k - 1])), True


def _core(heights: Array) -> list[float]:
    """Return Sk, Spk, Svk, Smr1 and Smr2 of the heights."""
    observed = heights[np.isfinite(heights)]
    if observed.size < _LEAST:
        return [math.nan] * len(_CORE)
    values, _, scale = shifted(observed)
    curve = np.sort(values)[::-1]
    ratio = (np.arange(curve.size) + 0.5) / curve.size
    width = max(2, round(0.4 * curve.size))  # under the secant of the core (ISO 25178-2)
    drop = curve[: curve.size - width + 1] - curve[width - 1 :]
    # rounding; 1e-14 and 1e-9 gave the same bits, for the tolerance below 1e-12 and 1e-6
    flattest = np.flatnonzero(drop <= drop.min() + 1e-12 * (curve[0] - curve[-1]))
    start = int(flattest[0])
    part, at = curve[start : start + width], ratio[start : start + width]
    middle = at.mean()
    slope = float(np.sum((at - middle) * part) / np.sum((at - middle) ** 2))
    upper = float(part.mean() - slope * middle)
    lower = upper + slope
    above, below = np.maximum(curve - upper, 0.0), np.maximum(lower - curve, 0.0)
    # a straight curve crosses its own line by rounding only
    tolerance = 1e-9 * (curve[0] - curve[-1])
    peak, valley = (float(np.count_nonzero(part > tolerance)) / curve.size for part in (above, below))
    heights_of = [
        2.0 * float(part.mean()) / share if share > 0.0 else 0.0
        for part, share in ((above, peak), (below, valley))
    ]
    return [-slope * scale, heights_of[0] * scale, heights_of[1] * scale, peak, 1.0 - valley]
