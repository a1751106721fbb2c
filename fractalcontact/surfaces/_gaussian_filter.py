"""Gaussian filter of ISO 16610: separation of long and short wavelengths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._height_stack import check_stack, height_stack, with_heights


def _check(problems: Problems) -> None:
    given = problems.given
    is_valid = check_stack(problems)
    problems.choice("keep", among=("long", "short"))
    if problems.number("cutoff", above=0) and is_valid:
        grid = read_grid(given.surface, core_dims(given.surface))
        # a shorter kernel has too few points for its transmission: see the achieved error
        least, most = 4 * max(grid.spacing), max(grid.extent)
        expected = f"{least:.3g} m (four spacings) to {most:.3g} m (the extent)"
        is_inside = least * (1 - 1e-9) <= float(given.cutoff) <= most * (1 + 1e-9)
        problems.require(is_inside, "cutoff", expected)


@public_result(
    title="Filtered surface",
    references="ISO 16610-61 (2015), Linear areal Gaussian filters; ISO 16610-28 (2016), End effects",
    achieved_error="below 0.002 of the amplitude of waves of at least four spacings, away from the edges",
    check=_check,
    memory=42.0,
)
def gaussian_filter(surface: xr.DataArray, cutoff: float, *, keep: str = "long") -> xr.DataArray:
    """Keep the wavelengths beyond a cutoff, or those below it, with the Gaussian filter of ISO 16610.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). Missing points (NaN) have no weight and stay missing.
    cutoff : float
        Wavelength in m at which half the amplitude passes (nesting index); at least four spacings.
    keep : {"long", "short"}
        "long" returns the weighted mean, as an S-filter of ISO 25178-3 that removes short waves, or the
        waviness; "short" returns the heights less that mean, as an L-filter, or the roughness.

    Returns
    -------
    DataArray
        `height` like the input.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or a cutoff outside its lengths.

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
    return with_heights(surface, long if keep == "long" else stack - long)


def weighted_mean(heights: Array, cutoff: float, spacing: Sequence[float], periodic: Sequence[bool]) -> Array:
    """Return the Gaussian weighted mean of heights (ny, nx) or (nx,); NaN where they are missing."""
    from scipy.ndimage import convolve1d

    observed = np.isfinite(heights)
    reference = float(heights[observed].mean()) if observed.any() else 0.0
    total, weight = np.where(observed, heights - reference, 0.0), observed.astype(float)
    deviation = math.sqrt(math.log(2.0) / 2.0) / math.pi * cutoff  # a cutoff/sqrt(2 pi), a^2 = ln 2/pi
    for axis, (step, wraps) in enumerate(zip(spacing, periodic, strict=True)):
        reach = min(int(cutoff / step), heights.shape[axis])  # the weights have fallen to 1e-6 there
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / deviation) ** 2)
        weights /= weights.sum()
        mode = "wrap" if wraps else "constant"
        total, weight = (convolve1d(values, weights, axis=axis, mode=mode) for values in (total, weight))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(observed, reference + total / weight, np.nan)
