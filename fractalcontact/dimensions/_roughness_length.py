"""Root mean square height inside windows against their edge, and its expectation for fBm surfaces."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset, window_slope
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces
from fractalcontact.dimensions._windows import edge_lengths, window_edges

Array = np.ndarray[Any, np.dtype[Any]]


def _check(problems: Problems, *, surface: Any) -> None:
    reserved = ("roughness", "window_size", "pair_count", *ALWAYS)
    check_surface(problems, surface, smallest=5, squares=True, reserved=reserved)


@public_result(
    title="Roughness inside windows of a surface",
    references=METHODS["roughness_length"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
)
def roughness_length(surface: xr.DataArray) -> xr.Dataset:
    """Return the mean rms height inside square windows against their edge.

    The heights of each window are taken about its own least-squares plane.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); windows that contain NaN are left out.

    Returns
    -------
    Dataset over `window_size` (m)
        `roughness` (m), `pair_count` (of windows) and `local_slope`, which is H for a self-affine surface.
        Windows overlap by half; their edge grows by sqrt 2 from 4 points to a quarter of the surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or an axis has fewer than 5 points.

    References
    ----------
    Malinverno (1990), Geophysical Research Letters 17.

    Examples
    --------
    A tilt adds no roughness:

    >>> import numpy as np, fractalcontact as fc
    >>> tilted = fc.surfaces.from_array(np.add.outer(np.arange(32.0), np.arange(32.0)), 1.0)
    >>> bool(fc.dimensions.roughness_length(tilted).roughness.max() < 1e-6)
    True
    """
    surfaces = read_surfaces(surface)
    curves = [roughness_length_curve(single) for single in surfaces]
    slopes = [window_slope(curve) for curve in curves]
    return curve_dataset(
        surface, surfaces, "window_size", curves, slopes, value="roughness", count="pair_count"
    )


def roughness_length_curve(surface: Surface) -> Curve:
    """Return the mean rms height in windows about their planes of one surface."""
    edges = np.concatenate(
        [window_edges(surface.shape, surface.spacing, smallest=size, share=0.25) for size in (4.0, 6.0)]
    )
    if not len(edges):
        edges = window_edges(surface.shape, surface.spacing, smallest=4.0, share=1.0)
    edges = edges[np.argsort(edges[:, 1])]
    means, numbers = _mean_roughness(surface.heights, edges)
    return Curve(edge_lengths(surface, edges), means * surface.unit, numbers, edges=edges)


def _mean_roughness(heights: Array, edges: Array) -> tuple[Array, Array]:
    """Return the mean rms deviation from a plane in windows, and the number of windows.

    Windows overlap by half; their edge in points is that of `edges`, at least one point along y.
    """
    from fractalcontact.base.threads import in_bands
    from fractalcontact.dimensions._kernels import roughness_sums

    means, numbers = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        size_y, size_x = max(int(ey), 1), int(ex)
        rows = np.arange(0, heights.shape[0] - size_y + 1, max(size_y // 2, 1))
        columns = np.arange(0, heights.shape[1] - size_x + 1, max(size_x // 2, 1))
        sums, counts = np.zeros(rows.size), np.zeros(rows.size, dtype=np.int64)
        work = rows.size * columns.size * size_y * size_x
        windows = (size_y, size_x, rows, columns)
        in_bands(roughness_sums, rows.size, work, heights, *windows, sums, counts)
        numbers[k] = counts.sum()
        if numbers[k]:
            means[k] = np.cumsum(sums)[-1] / numbers[k]
    return means, numbers


def expected_roughness(edges: Array, spacing: tuple[float, float], hurst: float) -> Array:
    """Return the roughness expected of a fractional Brownian surface of unit rms increment.

    The root of the mean square about a plane in windows of few points: half the sum over all pairs of
    points of the projection on the plane times distance^(2 hurst), divided by the number of points.
    """
    roughness = np.empty(len(edges))
    for k, (ey, ex) in enumerate(edges):
        (flat_y, tilt_y), (flat_x, tilt_x) = _autocorrelations(max(int(ey), 1)), _autocorrelations(int(ex))
        weights = np.outer(flat_y + tilt_y, flat_x) + np.outer(flat_y, tilt_x)
        y, x = np.arange(flat_y.size) * spacing[0], np.arange(flat_x.size) * spacing[1]
        square = np.sum(weights * (y[:, None] ** 2 + x**2) ** hurst)
        roughness[k] = np.sqrt(0.5 * square / (max(int(ey), 1) * int(ex)))
    return roughness


@lru_cache(maxsize=64)  # more than the windows of one surface
def _autocorrelations(n: int) -> tuple[Array, Array]:
    """Return the autocorrelation at each lag of a constant and of a tilt of n points, both of norm one.

    They do not depend on H and are the larger part of the work.
    """
    positions = np.arange(n) - 0.5 * (n - 1)
    norm = np.sqrt(np.sum(positions**2))
    constant, tilt = np.full(n, n**-0.5), positions / norm if n > 1 else np.zeros(1)
    flat, tilted = (np.correlate(line, line, "full")[n - 1 :] for line in (constant, tilt))
    flat[1:] *= 2.0  # lags of both signs
    tilted[1:] *= 2.0
    flat.flags.writeable = tilted.flags.writeable = False  # shared by all calls
    return flat, tilted


# Variance of the logarithm of the mean roughness in windows of some points, times the number of windows side
# by side that the surface holds; rows: H .1 .3 .5 .7 .9. Its correlation between windows of two lengths falls
# with their ratio; columns: powers of sqrt 2. Measured on 160 surfaces of 256 x 256 points, and on 1500
# profiles of 2048.
_HURST = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
_POINTS = np.array([4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0])
_VARIANCES = {
    2: np.array(
        [
            [0.041, 0.017, 0.010, 0.0050, 0.0030, 0.0030, 0.0020],
            [0.039, 0.022, 0.015, 0.012, 0.011, 0.012, 0.012],
            [0.042, 0.032, 0.026, 0.024, 0.024, 0.024, 0.026],
            [0.049, 0.046, 0.038, 0.038, 0.037, 0.038, 0.041],
            [0.055, 0.054, 0.053, 0.058, 0.062, 0.069, 0.072],
        ]
    ),
    1: np.array(
        [
            [0.237, 0.121, 0.084, 0.052, 0.038, 0.026, 0.021],
            [0.228, 0.122, 0.090, 0.064, 0.052, 0.044, 0.041],
            [0.221, 0.127, 0.102, 0.082, 0.072, 0.069, 0.071],
            [0.214, 0.135, 0.117, 0.101, 0.095, 0.095, 0.101],
            [0.200, 0.154, 0.139, 0.128, 0.120, 0.117, 0.119],
        ]
    ),
}
_CORRELATIONS = {
    2: np.array(
        [
            [1.0, 0.883, 0.753, 0.587, 0.465, 0.386],
            [1.0, 0.842, 0.669, 0.467, 0.322, 0.233],
            [1.0, 0.849, 0.675, 0.466, 0.315, 0.203],
            [1.0, 0.868, 0.710, 0.510, 0.365, 0.227],
            [1.0, 0.905, 0.790, 0.625, 0.501, 0.369],
        ]
    ),
    1: np.array(
        [
            [1.0, 0.901, 0.835, 0.727, 0.632, 0.537],
            [1.0, 0.838, 0.725, 0.557, 0.419, 0.300],
            [1.0, 0.821, 0.689, 0.504, 0.356, 0.235],
            [1.0, 0.825, 0.684, 0.495, 0.342, 0.218],
            [1.0, 0.840, 0.690, 0.496, 0.337, 0.208],
        ]
    ),
}


def roughness_covariance(edges: Array, shape: tuple[int, int], hurst: float) -> Array:
    """Return the covariance of the logarithms of the mean roughness in windows of some edges.

    Parameters
    ----------
    edges : ndarray of int, shape (k, 2)
        In points along y and x; one row of points for a profile.
    shape : (ny, nx)
    hurst : float
    """
    axes = 2 if shape[0] > 1 else 1
    return windowed_covariance(
        edges[:, 2 - axes :], shape[2 - axes :], hurst, _VARIANCES[axes], _CORRELATIONS[axes]
    )


def windowed_covariance(
    edges: Array, shape: tuple[int, ...], hurst: float, variances: Array, correlations: Array
) -> Array:
    """Interpolate a covariance in tables over H and points, and over H and powers of sqrt 2."""
    row = float(np.interp(hurst, _HURST, np.arange(_HURST.size)))
    low = min(int(row), _HURST.size - 2)
    variance, correlation = (
        table[low] + (row - low) * (table[low + 1] - table[low]) for table in (variances, correlations)
    )
    length = np.exp(np.log(edges).mean(axis=1))
    number = np.prod(np.asarray(shape) / edges, axis=1)
    deviation = np.sqrt(np.interp(np.log(length), np.log(_POINTS), variance) / number)
    steps = 2.0 * np.abs(np.log2(length[:, None] / length))
    last = correlation.size - 1
    # beyond the table it goes on falling by the same factor
    fall = np.clip(correlation[last] / correlation[last - 2], 0.0, 1.0) ** 0.5
    shared = np.interp(steps, np.arange(last + 1), correlation) * fall ** np.maximum(steps - last, 0.0)
    return np.asarray(shared * np.outer(deviation, deviation))
