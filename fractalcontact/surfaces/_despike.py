"""Removal of spikes: single heights of a scan far from those around them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fractalcontact.base.grid import read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import detrended
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.surfaces._height_stack import with_heights

ROUSSEEUW = "Rousseeuw and Croux, Journal of the American Statistical Association 88 (1993) 1273-1283"


def _check(problems: Problems) -> None:
    given = problems.given
    problems.number("threshold", above=0)
    largest = None
    if problems.surface("surface", finite=False):
        largest = min(read_grid(given.surface).shape)
        infinite = int(np.count_nonzero(np.isinf(given.surface.values)))
        problems.require(infinite == 0, "surface", "no infinite heights", f"{infinite}")
        problems.require(bool(np.isfinite(given.surface.values).any()), "surface", "heights", NONE)
    if problems.integer("window", at_least=3, at_most=largest):
        problems.require(given.window % 2 == 1, "window", "an odd number of cells")


@public_result(
    title="Surface without spikes",
    references=ROUSSEEUW,
    achieved_error="exact: the heights that remain are unchanged",
    check=_check,
    memory=34.0,
)
def despike(surface: xr.DataArray, *, threshold: float = 6.0, window: int = 5) -> xr.DataArray:
    """Remove isolated outliers from a scan.

    Dust, reflections and undercut edges leave single wrong heights in optical scans. Closure and friction
    depend on the highest points, so a few outliers change them. A spike becomes a missing height
    (NaN), to be filled (`fill`) or left out.

    Parameters
    ----------
    surface : DataArray, dims (y, x)
        Heights in metres; missing ones (NaN) stay missing.
    threshold : float
        Largest distance of a height from the median around it, in robust standard deviations of that
        distance over the whole surface. A sharp edge of a rough surface may exceed it too: look at the
        removed points, and test whether the results depend on them.
    window : int
        Odd edge, in cells, of the square whose median is taken; 3 or more. It removes spikes up to half as
        wide.

    Returns
    -------
    DataArray
        `height` with NaN in place of the spikes; the scalar coordinate `removed_points` counts them. The
        provenance has the robust standard deviation (m).

    Raises
    ------
    InvalidInput
        The surface is not a plane of heights, or an argument is wrong.

    References
    ----------
    Rousseeuw and Croux (1993), Journal of the American Statistical Association 88, 1273-1283.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
    >>> surface[20, 30] += 1e-3
    >>> clean = fc.surfaces.despike(surface)
    >>> int(clean.removed_points), bool(clean[20, 30].isnull())
    (1, True)
    """
    heights = np.asarray(surface.values, dtype=np.float64)
    is_spike, deviation = _spikes(heights, int(window), float(threshold))
    count = int(is_spike.sum())
    result = with_heights(surface, np.where(is_spike, np.nan, heights)).assign_coords(removed_points=count)
    result.attrs = {"removed_points": count, "robust_standard_deviation": deviation}
    return result


def _spikes(heights: Array, window: int, threshold: float) -> tuple[Array, float]:
    """Return the mask of the spikes and the robust standard deviation of the residual.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where missing.
    window : int
        Odd edge of the square, in cells, whose median a point is compared with.
    threshold : float
        In robust standard deviations.

    Notes
    -----
    Flagged points are left out of the medians of the next pass, so that a spike of several points is removed
    from its edge inwards. The scale of the residual is that of the first pass.
    """
    # without this a slope would flag the points beside a missing one
    heights = detrended(heights, 1)[0]
    flagged = np.zeros(heights.shape, dtype=bool)
    residual = np.abs(heights - _medians(heights, window))
    # of a Gaussian, from a quantile; the median called a third of a coin and of heights of a few steps spikes
    deviation = 0.6080 * float(np.nanquantile(residual, 0.9))
    while deviation > 0 and (new := (residual > threshold * deviation) & ~flagged).any():
        flagged |= new
        residual = np.abs(heights - _medians(np.where(flagged, np.nan, heights), window))
    return flagged, deviation


def _medians(heights: Array, window: int) -> Array:
    """Return the median of the square about every point; the edge is padded by odd reflection."""
    half = window // 2
    padded = np.pad(heights, half, mode="reflect", reflect_type="odd")
    medians = np.empty(heights.shape)
    for i in range(heights.shape[0]):  # row by row, to bound the memory
        band = np.lib.stride_tricks.sliding_window_view(padded[i : i + window], window, axis=1)
        medians[i] = _row_medians(np.moveaxis(band, 0, 1).reshape(heights.shape[1], -1))
    return medians


def _row_medians(values: Array) -> Array:
    """Return the median of every row without its NaN; NaN for a row of NaN."""
    ordered = np.sort(values, axis=1)  # NaN last
    count = np.count_nonzero(np.isfinite(ordered), axis=1)
    rows, last = np.arange(len(ordered)), np.maximum(count - 1, 0)
    middle = 0.5 * (ordered[rows, last // 2] + ordered[rows, (last + 1) // 2])
    return np.where(count > 0, middle, np.nan)
