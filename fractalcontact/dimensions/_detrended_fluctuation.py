"""Fluctuation of profiles about straight lines in windows (DFA), against the length of the windows."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.dimensions._curve import EXACT_MEAN, Curve, curve_dataset, no_profile, surface_check
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._roughness_length import roughness_covariance, window_sums
from fractalcontact.dimensions._surface_input import Scales, Surface, between

Array = np.ndarray[Any, np.dtype[Any]]


@public_result(
    title="Detrended fluctuation of a profile",
    references=METHODS["detrended_fluctuation"].references,
    achieved_error=EXACT_MEAN,
    check=surface_check("fluctuation", "window_size", smallest=8),
)
def detrended_fluctuation(surface: xr.DataArray) -> xr.Dataset:
    """Return the rms height of a profile about straight lines in windows against their length (DFA).

    The heights are taken as the profile of the method, which it otherwise makes by adding up a series: the
    slope is H, not H + 1.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., x); of a surface (..., y, x) the mean over its rows and columns. Windows that
        contain NaN are left out.

    Returns
    -------
    Dataset over `window_size` (m)
        `fluctuation` (m), `pair_count` (of windows) and `local_slope`, which is H for a self-affine profile.
        Windows start every quarter of their length, counted from both ends; the length grows by about sqrt 2
        from 4 points to a quarter of the profile.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or an axis has fewer than 8 points.

    References
    ----------
    Peng, Buldyrev, Havlin, Simons, Stanley and Goldberger (1994), Physical Review E 49.

    Examples
    --------
    A tilt adds no fluctuation:

    >>> import numpy as np, fractalcontact as fc
    >>> tilted = fc.surfaces.from_array(np.arange(64.0), 1.0)
    >>> bool(fc.dimensions.detrended_fluctuation(tilted).fluctuation.max() < 1e-12)
    True
    """
    return curve_dataset(
        surface, detrended_fluctuation_curve, "window_size", "fluctuation", count="pair_count"
    )


def detrended_fluctuation_curve(surface: Surface, window: Scales = None) -> Curve:
    """Return the rms deviation from lines in the windows of the rows and columns of one surface."""
    axes = [axis for axis in (0, 1) if surface.shape[axis] > 1]
    coarse = max(surface.spacing[axis] for axis in axes)
    shortest = min(int(surface.shape[axis] * surface.spacing[axis] / coarse + 1e-9) for axis in axes)
    number = int(2.0 * np.log2(max(shortest // 4, 5) / 4.0) + 1e-9) + 1
    edges = np.unique(np.rint(4.0 * 2.0 ** (np.arange(number) / 2.0)).astype(np.int64))
    edges = np.array([4, 5]) if edges.size < 2 else edges
    edges = edges[between(edges * coarse, window)]
    sums, counts = np.zeros(edges.size), np.zeros(edges.size, dtype=np.int64)
    for axis in axes:
        lines = np.ascontiguousarray(np.moveaxis(surface.heights, axis, -1))
        for k, edge in enumerate(edges):
            size = max(3, round(edge * coarse / surface.spacing[axis]))
            total, number = window_sums(lines, 1, size, is_square=True)
            sums[k] += total
            counts[k] += number
    means = np.divide(sums, counts, out=np.full(edges.size, np.nan), where=counts > 0)
    points = np.stack([np.ones_like(edges), edges], axis=1)
    return Curve(edges * coarse, np.sqrt(means) * surface.unit, counts, parts=points)


def fluctuation_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    """Return the covariance of the logarithms of the fluctuation of a profile, or the reason why not."""
    return no_profile(surface) or roughness_covariance(surface, curve, hurst)
