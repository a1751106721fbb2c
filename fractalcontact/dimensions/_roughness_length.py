"""Rms height in windows about planes, of profiles about lines (DFA), and its expectation for fBm heights."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.numbers import Array, nearest_whole
from fractalcontact.base.results import public_result
from fractalcontact.dimensions._curve import (
    EXACT_MEAN,
    PERIODIC,
    Curve,
    curve_dataset,
    no_profile,
    surface_check,
)
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._windows import square_windows


@public_result(
    title="Roughness inside windows of a surface",
    references=METHODS["roughness_length"].references,
    achieved_error=EXACT_MEAN,
    check=surface_check("roughness", "window_size", smallest=5),
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
        Windows start every quarter of their edge, counted from every corner; the edge grows by about sqrt 2
        from 4 points to a quarter of the surface.

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
    return curve_dataset(surface, roughness_length_curve, "window_size", "roughness")


def roughness_length_curve(surface: Surface, window: Scales = None) -> Curve:
    """Return the mean rms height in windows about their planes of one surface."""
    is_small = min(n for n in surface.shape if n > 1) < 17  # a quarter of it is less than 4 points
    share = 1.0 if is_small else 0.25
    edges, lengths = square_windows(surface, window, smallest=(4.0, 6.0), share=share)
    sums, counts = np.zeros(lengths.size), np.zeros(lengths.size, dtype=np.int64)
    for k, (size_y, size_x) in enumerate(np.maximum(edges, 1)):
        sums[k], counts[k] = window_sums(surface.heights, size_y, size_x, is_square=False)
    means = np.divide(sums, counts, out=np.full(lengths.size, np.nan), where=counts > 0)
    return Curve(lengths, means * surface.unit, counts, parts=np.maximum(edges, 1))


def window_sums(heights: Array, size_y: int, size_x: int, *, is_square: bool) -> tuple[float, int]:
    """Return the sum of the rms heights about planes in windows, or of their squares, and their number."""
    from fractalcontact.base.resources import in_bands
    from fractalcontact.dimensions._kernels import roughness_sums

    rows, columns = _starts(heights.shape[0], size_y), _starts(heights.shape[1], size_x)
    sums, counts = np.zeros(rows.size), np.zeros(rows.size, dtype=np.int64)
    work = rows.size * size_y * heights.shape[1]
    in_bands(roughness_sums, rows.size, work, heights, size_y, size_x, rows, columns, is_square, sums, counts)
    return float(np.cumsum(sums)[-1]) if rows.size else 0.0, int(counts.sum())


def _starts(points: int, size: int) -> Array:
    """Return where windows start: every quarter of their size, counted from both ends."""
    starts = np.arange(0, points - size + 1, max(size // 4, 1))
    return np.union1d(starts, points - size - starts)


def expected_roughness(surface: Surface, curve: Curve, hurst: float) -> Array:
    """Return the roughness expected of a fractional Brownian surface of unit rms increment.

    The root of the mean square about a plane in windows of few points: half the sum over all pairs of
    points of the projection on the plane times distance^(2 hurst), divided by the number of points.
    """
    assert curve.parts is not None
    roughness = []
    for edges in curve.parts:
        weights, y, x = _projection(edges, surface)
        roughness.append(np.sqrt(0.5 * np.sum(weights * (y[:, None] ** 2 + x**2) ** hurst)))
    return np.array(roughness)


def roughness_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    """Return the covariance of the logarithms of the roughness of a fractional Brownian surface, or a reason.

    A mean square over windows at all positions is the sum over all modes of their power S times W, one less
    the transform of the projection on a plane. For normal modes the covariance of two such means is twice the
    sum of S^2 W W', over as many independent surfaces as the positions hold; that of the logarithms of roots
    is a quarter of the relative one. Modes of a torus of four times the largest window are enough.
    """
    assert curve.parts is not None
    if any(surface.grid.periodic):
        return PERIODIC
    if surface.axes == 2 and curve.parts.min() < 8:
        return "windows of fewer than 8 points are biased: too small a surface"
    torus = 4.0 * curve.parts.max(axis=0)
    nodes, widths = zip(*(_half_line(n) for n in torus), strict=True)
    y, x = (2.0 * np.pi * k / (n * d) for k, n, d in zip(nodes, torus, surface.plane_spacing, strict=True))
    if surface.axes == 2:
        with np.errstate(divide="ignore"):
            power = spectra.aliased_power_law((y[:, None], x), hurst, images=2, spacing=surface.plane_spacing)
        number = np.outer(*widths)
    else:
        y, power, number = y[:1], spectra.aliased_line_power_law(x, hurst)[None], widths[1][None]
    power[0, 0] = 0.0
    transferred = []
    for edges in curve.parts:
        weights, at_y, at_x = _projection(edges, surface)
        transform = np.cos(np.outer(y, at_y)) @ weights @ np.cos(np.outer(at_x, x))
        transferred.append((power * (1.0 - transform)).ravel())
    modes = np.array(transferred)
    totals = modes @ number.ravel()
    lengths = np.array(surface.shape) - 0.5 * curve.parts
    surfaces = np.prod((np.maximum(lengths[:, None], lengths) / torus)[..., 2 - surface.axes :], axis=2)
    return np.asarray(0.5 * (modes * number.ravel()) @ modes.T / np.outer(totals, totals) / surfaces)


def _half_line(torus: float) -> tuple[Array, Array]:
    """Return numbers of modes from 0 to half of a torus, and how many modes of both signs each stands for.

    One by one up to 24, and in blocks that grow by a tenth beyond: twice as many change no standard error by
    more than 1 %.
    """
    edges = [*np.arange(0.5, min(24.0, 0.5 * torus))]
    while edges[-1] < 0.5 * torus:
        edges.append(min(0.5 * torus, max(edges[-1] + 1.0, 1.1 * edges[-1])))
    ends = np.array(edges)
    return np.append(0.0, 0.5 * (ends[1:] + ends[:-1])), np.append(1.0, 2.0 * np.diff(ends))


def _projection(edges: Array, surface: Surface) -> tuple[Array, Array, Array]:
    """Return the projection on a plane summed over the pairs of points at each lag, over their number.

    With the lags along y and x, in spacings of x; lags of other signs are added to them.
    """
    (flat_y, tilt_y), (flat_x, tilt_x) = (_autocorrelations(int(edge)) for edge in edges)
    weights = np.outer(flat_y + tilt_y, flat_x) + np.outer(flat_y, tilt_x)
    y, x = (np.arange(n) * d for n, d in zip(weights.shape, surface.plane_spacing, strict=True))
    return weights / weights.size, y, x


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
    return curve_dataset(surface, detrended_fluctuation_curve, "window_size", "fluctuation")


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
            size = max(3, int(nearest_whole(edge * coarse / surface.spacing[axis])))
            total, number = window_sums(lines, 1, size, is_square=True)
            sums[k] += total
            counts[k] += number
    means = np.divide(sums, counts, out=np.full(edges.size, np.nan), where=counts > 0)
    points = np.stack([np.ones_like(edges), edges], axis=1)
    return Curve(edges * coarse, np.sqrt(means) * surface.unit, counts, parts=points)


def fluctuation_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    """Return the covariance of the logarithms of the fluctuation of a profile, or the reason why not."""
    return no_profile(surface) or roughness_covariance(surface, curve, hurst)
