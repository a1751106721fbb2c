"""Filters: removal of the mean, a plane or a quadric, and separation of long and short wavelengths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.numbers import ROUNDED, Array, is_within
from fractalcontact.base.regression import detrended, rounding_of
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, require
from fractalcontact.surfaces._from_array import check_stack, height_stack, with_heights

POLYNOMIALS = ("mean", "plane", "quadric")


def _check_order(problems: Problems) -> None:
    check_stack(problems)
    problems.integer("order", at_least=0, at_most=2)


@public_result(title="Levelled surface", achieved_error="exact to rounding", check=_check_order, memory=34.0)
def level(surface: xr.DataArray, order: int = 1) -> xr.DataArray:
    """Remove the mean, the mean plane or the mean quadric.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). Missing points (NaN) are left out of the fit and
        stay missing.
    order : {0, 1, 2}
        Total degree of the least-squares polynomial that is removed: mean, plane, quadric.

    Returns
    -------
    DataArray
        `height` like the input, each plane levelled by itself. With order 1 or 2 the axes are no longer
        periodic, because opposite edges no longer match.

    Raises
    ------
    InvalidInput
        The observed points do not determine the polynomial: none, too few, or all on one line.

    Notes
    -----
    The fit uses orthogonal polynomials of the index, scaled heights and a second pass. An offset of 1e9 in
    heights or coordinates then costs no digits beyond those that the input has lost.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> tilted = fc.surfaces.from_array(0.1 * np.add.outer(np.arange(5.0), np.arange(6.0)), 1.0)
    >>> levelled = fc.surfaces.level(tilted)
    >>> float(abs(levelled).max()) == 0
    True
    """
    stack = height_stack(surface)
    fits = [detrended(each, int(order)) if np.isfinite(each).any() else (each, False) for each in stack]
    failed = sum(not determined for _, determined in fits)
    where = "" if len(fits) == 1 else f" ({failed} of {len(fits)} planes)"
    expected = f"observed points that fix a {POLYNOMIALS[order]}"
    require(not failed, "surface", expected, f"too few of them{where}")
    for each, (residual, _) in zip(stack, fits, strict=True):  # no rounded numbers are left of a plane
        residual *= np.nanmax(np.abs(residual)) > rounding_of(each)
    levelled = with_heights(surface, np.stack([residual for residual, _ in fits]))
    if order > 0:
        for dim in {"y", "x"} & set(levelled.coords):
            levelled.coords[dim].attrs.pop("period", None)
    return levelled


def _check_cutoff(problems: Problems) -> None:
    given = problems.given
    is_valid = check_stack(problems)
    problems.choice("waves", among=("long", "short"))
    if problems.number("cutoff", above=0) and is_valid:
        grid = read_grid(given.surface, core_dims(given.surface))
        # a shorter kernel has too few points for its transmission: see the achieved error
        least, most = 4 * max(grid.spacing), max(grid.extent)
        expected = f"{least:.3g} m (four spacings) to {most:.3g} m (the extent)"
        problems.require(is_within(float(given.cutoff), least, most), "cutoff", expected)


@public_result(
    title="Filtered surface",
    references="ISO 16610-61 (2015), Linear areal Gaussian filters; ISO 16610-28 (2016), End effects",
    achieved_error="below 0.002 of the amplitude of waves of at least four spacings, away from the edges",
    check=_check_cutoff,
    memory=42.0,
)
def gaussian_filter(surface: xr.DataArray, cutoff: float, *, waves: str = "long") -> xr.DataArray:
    """Keep the wavelengths beyond a cutoff, or those below it, with the Gaussian filter of ISO 16610.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). Missing points (NaN) have no weight and stay missing.
    cutoff : float
        Wavelength in m at which half the amplitude passes (nesting index); four spacings to the extent.
    waves : {"long", "short"}
        "long" returns the weighted mean, as an S-filter of ISO 25178-3 that removes short waves, or the
        waviness; "short" returns the heights less that mean, as an L-filter, or the roughness.

    Returns
    -------
    DataArray
        `height` like the input.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or a cutoff outside these lengths.

    Notes
    -----
    Weights exp(-pi (r / (a cutoff))^2), a^2 = ln 2 / pi, up to a distance of one cutoff. At free edges and
    gaps the weights inside are divided by their sum (ISO 16610-28); periodic axes are continued.

    References
    ----------
    ISO 16610-61 (2015), Geometrical product specifications: linear areal filters, Gaussian filters.

    Examples
    --------
    A wave as long as the cutoff keeps half its amplitude:

    >>> import numpy as np, fractalcontact as fc
    >>> wave = 1e-6 * np.cos(2 * np.pi * np.arange(64) / 16)
    >>> surface = fc.surfaces.from_array(np.tile(wave, (64, 1)), 1e-5, periodic=True)
    >>> print(f"{float(fc.surfaces.gaussian_filter(surface, 1.6e-4).max()):.3e} m")
    5.000e-07 m
    """
    grid = read_grid(surface, core_dims(surface))
    stack = height_stack(surface)
    long = np.stack([weighted_mean(each, float(cutoff), grid.spacing, grid.periodic) for each in stack])
    return with_heights(surface, long if waves == "long" else stack - long)


def weighted_mean(heights: Array, cutoff: float, spacing: Sequence[float], periodic: Sequence[bool]) -> Array:
    """Return the Gaussian weighted mean of heights (ny, nx) or (nx,); NaN where they are missing."""
    from scipy.ndimage import convolve1d

    observed = np.isfinite(heights)
    reference = float(heights[observed].mean()) if observed.any() else 0.0
    total, weight = np.where(observed, heights - reference, 0.0), observed.astype(float)
    for axis, (n, step, wraps) in enumerate(zip(heights.shape, spacing, periodic, strict=True)):
        # in points; of a periodic axis a cutoff of five periods leaves the mean, and 3e-8 of the longest wave
        length = min(cutoff / step, 5.0 * n) if wraps else cutoff / step
        deviation = math.sqrt(math.log(2.0) / 2.0) / math.pi * length  # a cutoff/sqrt(2 pi), a^2 = ln 2/pi
        # the weights have fallen to 1e-6 there
        reach = int((length if wraps else min(length, n)) * ROUNDED)
        weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / deviation))
        weights /= weights.sum()
        mode = "wrap" if wraps else "constant"
        total, weight = (convolve1d(values, weights, axis=axis, mode=mode) for values in (total, weight))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(observed, reference + total / weight, np.nan)
