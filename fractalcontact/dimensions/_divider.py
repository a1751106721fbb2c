"""Length of profiles measured with dividers of growing opening (compass method)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.dimensions._curve import Curve, curve_dataset, surface_check
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, between

Array = np.ndarray[Any, np.dtype[Any]]


@public_result(
    title="Divider lengths of a profile",
    references=METHODS["divider"].references,
    achieved_error="exact to rounding for straight lines between the points",
    check=surface_check("divider_length", "divider", smallest=5),
)
def divider(surface: xr.DataArray) -> xr.Dataset:
    """Return the length of a profile measured with dividers against their opening (compass method).

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., x); of a surface (..., y, x) the mean over its rows and columns. Lines with
        missing points are left out.

    Returns
    -------
    Dataset over `divider` (m)
        `divider_length` (m), the whole steps along the lines between the points and the rest, per profile;
        `pair_count` (of steps); and `local_slope`, 1 - D. Openings double from one spacing to an eighth of
        the profile.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or an axis has fewer than 5 points.

    Notes
    -----
    Heights count as they are, so that the slope depends on their size: a profile whose increments are small
    against the opening has D = 1, one of steep increments 1 / H (Brown 1987). Stretch the heights first, or
    use a method of self-affine profiles.

    References
    ----------
    Mandelbrot (1967), Science 156; Brown (1987), Geophysical Research Letters 14.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ramp = fc.surfaces.from_array(0.75 * np.arange(33.0), 1.0)
    >>> fc.dimensions.divider(ramp).divider_length.values.round(9).tolist()
    [40.0, 40.0, 40.0]
    """
    return curve_dataset(surface, divider_curve, "divider", "divider_length", count="pair_count")


def divider_curve(surface: Surface, window: Scales = None) -> Curve:
    """Return the mean length of the rows and columns of one surface."""
    from fractalcontact.dimensions._kernels import walk

    axes = [axis for axis in (0, 1) if surface.shape[axis] > 1]
    coarse = max(surface.spacing[axis] for axis in axes)
    shortest = min((surface.shape[axis] - 1) * surface.spacing[axis] for axis in axes)
    number = max(2, int(np.log2(shortest / 8.0 / coarse) + 1e-9) + 1)
    openings = coarse * 2.0 ** np.arange(number)
    openings = openings[between(openings, window)]
    lengths, steps = np.zeros(openings.size), np.zeros(openings.size, dtype=np.int64)
    lines = 0
    for axis in axes:
        heights = np.moveaxis(surface.heights, axis, -1) * surface.unit
        heights = np.ascontiguousarray(heights[np.isfinite(heights).all(axis=1)])
        lines += len(heights)
        for k, opening in enumerate(openings):
            total, count = walk(heights, surface.spacing[axis], float(opening))
            lengths[k] += total
            steps[k] += int(min(count, 1e15))  # more cannot be counted in a number of 53 bits
    return Curve(openings, lengths / lines if lines else np.full(openings.size, np.nan), steps)
