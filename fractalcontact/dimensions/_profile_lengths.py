"""Lengths of profiles: with dividers (compass method), and over growing lags (Higuchi)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array, nearest_whole
from fractalcontact.base.results import public_result
from fractalcontact.dimensions._curve import EXACT_MEAN, Curve, curve_dataset, no_profile, surface_check
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, between


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
    return curve_dataset(surface, divider_curve, "divider", "divider_length")


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


@public_result(
    title="Higuchi lengths of a profile",
    references=METHODS["higuchi"].references,
    achieved_error=EXACT_MEAN,
    check=surface_check("higuchi_length", "lag", smallest=5),
)
def higuchi(surface: xr.DataArray) -> xr.Dataset:
    """Return the length of a profile by Higuchi's method against the lag.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., x); of a surface (..., y, x) the mean over its rows and columns. Increments
        that need a missing point are left out.

    Returns
    -------
    Dataset over `lag` (m)
        `higuchi_length` (m): the mean absolute increment over a lag of k points, times (n - 1) / k^2, with n
        of the shorter edge and k in points of the coarser axis; `pair_count` (of increments); and
        `local_slope`, which is -D, D the dimension of the profile. Lags grow by about sqrt 2 from one spacing
        to a quarter of the profile.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or an axis has fewer than 5 points.

    References
    ----------
    Higuchi (1988), Physica D 31.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ramp = fc.surfaces.from_array(0.5 * np.arange(33.0), 1.0)
    >>> curve = fc.dimensions.higuchi(ramp)
    >>> curve.higuchi_length.values[:3].tolist(), round(float(curve.local_slope[1]), 6)
    ([16.0, 8.0, 5.333333333333333], -1.0)
    """
    return curve_dataset(surface, higuchi_curve, "lag", "higuchi_length")


def higuchi_curve(surface: Surface, window: Scales = None) -> Curve:
    """Return the mean Higuchi length of the rows and columns of one surface."""
    axes = [axis for axis in (0, 1) if surface.shape[axis] > 1]
    shortest = min(surface.shape[axis] for axis in axes)
    coarse = max(surface.spacing[axis] for axis in axes)
    most = max(2, int(0.25 * (shortest - 1)))
    lags = np.rint(2.0 ** (np.arange(int(2.0 * np.log2(most) + 1e-9) + 1) / 2.0)).astype(np.int64)
    lags = np.unique(np.append(lags[lags <= most], [1, 2]))
    lags = lags[between(lags * coarse, window)]
    sums, counts = np.zeros(lags.size), np.zeros(lags.size, dtype=np.int64)
    for axis in axes:
        lines = np.moveaxis(surface.heights, axis, -1)
        steps = np.maximum(nearest_whole(lags * coarse / surface.spacing[axis]), 1)
        for k, step in enumerate(steps):
            if step >= lines.shape[-1]:
                continue
            jumps = np.abs(lines[:, step:] - lines[:, :-step])
            jumps = jumps[np.isfinite(jumps)]
            sums[k] += float(jumps.sum())
            counts[k] += jumps.size
    mean = np.divide(sums, counts, out=np.full(lags.size, np.nan), where=counts > 0)
    return Curve(lags * coarse, mean * surface.unit * (shortest - 1) / lags.astype(float) ** 2, counts)


def higuchi_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    """Return the covariance of the logarithms of the lengths of a fractional Brownian profile, or a reason.

    The covariance of the absolute values of two normal variables of correlation r and unit variance is
    (2 / pi) (sqrt(1 - r^2) + r arcsin r - 1); it is summed over all pairs of increments.
    """
    if reason := no_profile(surface):
        return reason
    if hurst > 0.75:  # the limit of Guyon and Leon (1989), Annales de l'IHP 25
        return "above H = 0.75 mean increments are not normally distributed, however long the profile"
    lags, points = np.rint(curve.scale / surface.spacing[1]).astype(np.int64), surface.shape[1]
    result = np.empty((lags.size, lags.size))
    shifts = np.arange(-points, points + 1).astype(float)
    longest = int(lags.max())
    powers = np.abs(np.arange(-points - longest, points + longest + 1.0)) ** (2.0 * hurst)

    def power(ahead: int) -> Array:
        """Return |shift + ahead|^(2 H) of every shift."""
        return np.asarray(powers[longest + ahead : longest + ahead + shifts.size])

    for i, k in enumerate(lags):
        for j, m in enumerate(lags[: i + 1]):
            first, second = points - k, points - m
            pairs = np.maximum(np.minimum(first, second - shifts) - np.maximum(0.0, -shifts), 0.0)
            product = 0.5 * (power(m) + power(-k) - power(0) - power(m - k))
            r = np.clip(product / float(k * m) ** hurst, -1.0, 1.0)
            absolute = (2.0 / np.pi) * (np.sqrt(1.0 - r * r) + r * np.arcsin(r) - 1.0)
            relative = float(np.sum(pairs * absolute)) / (first * second) * np.pi / 2.0
            result[i, j] = result[j, i] = relative
    return result
