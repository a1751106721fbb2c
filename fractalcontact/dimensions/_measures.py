"""The curve of one face by each method, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import spectra
from fractalcontact.base.scaling import logarithm
from fractalcontact.dimensions import _covers, _lags
from fractalcontact.dimensions._faces import Face

Array = np.ndarray[Any, np.dtype[Any]]

_STEEP = 2.0**300
SMALLEST = {"roughness_length": 5, "variation": 3, "cube_counts": 3, "covering": 3}


@dataclass(frozen=True)
class Curve:
    """Scales in m (rad m-1 for a spectrum), ascending, with the value and the count at each.

    `factor` is what the heights were multiplied by, where that matters; `edges` (k, 2) are the edges of
    windows in points, along y and x.
    """

    scale: Array
    value: Array
    count: Array
    factor: float = np.nan
    edges: Array | None = None


def spectrum(face: Face, window: str, tile: int | None = None) -> Curve:
    """Return the ring averages of the power spectral density; see `curves.spectrum`."""
    axes, spacing = face.axes, face.grid.spacing
    shape = face.grid.shape if tile is None else (tile,) * axes
    wraps = face.grid.periodic if tile is None else (False,) * axes
    tapers = tuple("hann" if window == "hann" or (window == "auto" and not wrap) else None for wrap in wraps)
    powers: Array = np.zeros(1)
    number = 0
    for part in _tiles(face, tile):
        heights = without_trend(part, plane=not all(wraps))
        power, _ = spectra.periodogram(heights if axes == 2 else heights[0], spacing, tapers)
        powers = powers + power
        number += 1
    power = powers / number
    if axes == 2:
        q, mean, count = spectra.radial_average(power, shape, spacing)
    else:
        q, mean = spectra.half_wavenumbers(shape, spacing)[0][1:], power[1:]
        count = spectra.half_weights(shape[0])[1:].astype(np.int64)
    return Curve(q, mean * (face.unit**2 if tile is None else 1.0), count)


def _tiles(face: Face, tile: int | None) -> Iterator[Array]:
    """Yield the whole face in scaled heights, or its tiles in metres."""
    if tile is None:
        yield face.heights
        return
    ny, nx = face.shape
    edge_y = min(tile, ny)
    for j in range(0, ny - edge_y + 1, max(edge_y // 2, 1)):
        if face.is_lazy and face.axes == 2:
            strip = np.asarray(face.source.isel(y=slice(j, j + edge_y)).values, dtype=np.float64)
        else:
            strip = face.raw[j : j + edge_y]
        for i in range(0, nx - tile + 1, tile // 2):
            yield strip[:, i : i + tile]


def without_trend(heights: Array, *, plane: bool) -> Array:
    """Return complete heights without their mean, or without the plane of least squares."""
    heights = heights - heights.mean()
    if not plane:
        return heights
    ny, nx = heights.shape
    x, y = np.arange(nx) - 0.5 * (nx - 1), np.arange(ny) - 0.5 * (ny - 1)
    # on a full rectangle the two slopes are independent
    tilt = np.sum(heights.sum(axis=0) * x) / (ny * np.sum(x * x)) * x
    rise = np.sum(heights.sum(axis=1) * y) / (nx * np.sum(y * y)) * y if ny > 1 else np.zeros(1)
    return np.asarray(heights - tilt - rise[:, None])


def wide_slope(scale: Array, value: Array, count: Array) -> Array:
    """Return the local slope of a line through the points within a factor of sqrt 2, weighted by counts."""
    (x, _), (y, _) = logarithm(scale), logarithm(value)
    good = np.isfinite(y)
    weights = np.where(good, count, 0.0)
    y = np.where(good, y, 0.0)
    sums = np.stack([weights, weights * x, weights * y, weights * x * x, weights * x * y])
    sums = np.concatenate([np.zeros((5, 1)), np.cumsum(sums, axis=1)], axis=1)
    low = np.searchsorted(scale, scale / np.sqrt(2.0) * (1 - 1e-9))
    high = np.searchsorted(scale, scale * np.sqrt(2.0) * (1 + 1e-9))
    # the lowest wavenumbers have no neighbour that near
    low, high = (
        np.minimum(low, np.arange(x.size) - 1).clip(0),
        np.maximum(high, np.arange(x.size) + 2).clip(max=x.size),
    )
    w, wx, wy, wxx, wxy = sums[:, high] - sums[:, low]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (w * wxy - wx * wy) / (w * wxx - wx * wx)
    return np.where(good & np.isfinite(slope), slope, np.nan)


def variogram(face: Face, longest: float | None = None) -> Curve:
    """Return half the mean square increment; `longest` in m."""
    lazy = face.is_lazy
    if longest is None:
        longest = 4.0 * max(face.grid.spacing) if lazy else 0.5 * min(face.grid.extent)
    longest = min(longest, float(np.linalg.norm(face.grid.extent)))
    steps = _farthest(face, longest, 1)
    offsets = _lags.near_offsets(steps, face.spacing, longest)
    wide = max(face.grid.spacing)
    if lazy or len(offsets) <= _lags.FEW:
        return _pooled(face, offsets, _lags.SQUARE, 0.5, wide, longest)
    squares, counts = _lags.transformed(face.heights, face.periodic)
    vectors = _lags.lag_vectors(face.shape, face.periodic)
    nominal = _lags.nominal_counts(np.moveaxis(vectors, 0, -1), face.shape, face.periodic)
    distance = np.hypot(vectors[0] * face.spacing[0], vectors[1] * face.spacing[1])
    # a lag along y alone stands there with both its signs, and so does one of half a period
    twice = (vectors[1] == 0) | (face.periodic[1] & (2 * vectors[1] == face.shape[1]))
    share = np.where(twice, 1, 2)
    lag, mean, pairs = _lags.rings(
        distance.ravel(), squares.ravel(), (share * counts).ravel(), (share * nominal).ravel(), wide, longest
    )
    return Curve(lag, 0.5 * face.unit**2 * mean, pairs // 2)


def madogram(face: Face, longest: float | None = None) -> Curve:
    """Return half the mean absolute increment; `longest` in m."""
    return _along_axes(face, longest, _lags.ABSOLUTE, 0.5, 0.25)


def second_variogram(face: Face, longest: float | None = None) -> Curve:
    """Return the mean square second difference; `longest` in m."""
    return _along_axes(face, longest, _lags.SECOND, 1.0, 0.125)


def _along_axes(face: Face, longest: float | None, kind: int, factor: float, share: float) -> Curve:
    reach = 2 if kind == _lags.SECOND else 1
    if longest is None:
        least = max(face.grid.spacing)
        longest = 4.0 * least if face.is_lazy else max(share * min(face.grid.extent), least)
    longest = min(longest, max(face.grid.extent))
    offsets = _lags.axis_offsets(face.shape, _farthest(face, longest, reach))
    return _pooled(face, offsets, kind, factor, min(face.grid.spacing), longest)


def _farthest(face: Face, longest: float, reach: int) -> tuple[int, int]:
    """Return the largest steps in y and x: within the face, or half a period, beyond which lags come back."""
    y, x = (
        min(int(longest / step * (1 + 1e-9)), n // 2 if wraps and not face.is_lazy else (n - 1) // reach)
        for n, step, wraps in zip(face.shape, face.spacing, face.periodic, strict=True)
    )
    return y, x


def _pooled(face: Face, offsets: Array, kind: int, factor: float, width: float, longest: float) -> Curve:
    """Sum pairs directly and pool the lag vectors of equal length."""
    reach = 2 if kind == _lags.SECOND else 1
    periodic = face.periodic
    if face.is_lazy:
        periodic = (False, False)  # the far side of a periodic face would have to be read for every slab
        slabs, columns = face.slabs(reach * int(offsets[:, 0].max(initial=0))), (0, face.shape[1])
    else:
        heights, columns = _lags.wrapped(face.heights, periodic, offsets, reach)
        slabs = iter([(heights, face.shape[0])])
        factor *= face.unit ** (1 if kind == _lags.ABSOLUTE else 2)  # slabs above are in metres
    mean, counts = _lags.direct(slabs, columns, offsets, kind)
    nominal = _lags.nominal_counts(offsets, face.shape, periodic, reach)
    distance = np.hypot(offsets[:, 0] * face.spacing[0], offsets[:, 1] * face.spacing[1])
    # along the axes alone every lag is kept apart
    width = width if kind == _lags.SQUARE else longest
    lag, value, pairs = _lags.rings(distance, mean, counts, nominal, width, longest)
    return Curve(lag, factor * value, pairs)


def roughness_length(face: Face) -> Curve:
    """Return the mean rms height in windows about their planes."""
    edges = np.concatenate(
        [_covers.sizes(face.shape, face.spacing, smallest=first, share=0.25) for first in (4.0, 6.0)]
    )
    if not len(edges):
        edges = _covers.sizes(face.shape, face.spacing, smallest=4.0, share=1.0)
    edges = edges[np.argsort(edges[:, 1])]
    means, numbers = _covers.roughness(face.heights, edges)
    return Curve(_edge_lengths(face, edges), means * face.unit, numbers, edges=edges)


def variation(face: Face) -> Curve:
    """Return the mean range of the heights over stretches of the rows and of the columns."""
    edges = _covers.sizes(face.shape, face.spacing)
    means, numbers = _covers.mean_ranges(face.heights, edges)
    return Curve(_edge_lengths(face, edges), means * face.unit, numbers)


def cube_counts(face: Face, vertical_scale: float | str = "range") -> Curve:
    """Return the mean number of cubes that meet the face."""
    edges = _covers.sizes(face.shape, face.spacing)
    lengths = _edge_lengths(face, edges)
    area = float(np.prod([(n - 1) * s for n, s in zip(face.grid.shape, face.grid.spacing, strict=True)]))
    heights = face.heights
    if vertical_scale == "range":
        span = float(np.nanmax(heights) - np.nanmin(heights))
        factor = area ** (1.0 / face.axes) / span if span > 0 else 1.0
    else:
        factor = float(vertical_scale) * face.unit
    counts = _covers.cube_counts(heights * factor, edges, lengths, area, face.axes)
    return Curve(lengths, counts, np.ones(lengths.shape, dtype=np.int64), factor / face.unit)


def covering(face: Face, vertical_scale: float = 1.0) -> Curve:
    """Return the area of the triangulated face."""
    edges = _covers.sizes(face.shape, face.spacing)
    longest = max(face.spacing)
    # slopes are what counts, and they are formed in scaled lengths
    steps = (face.spacing[0] / longest, face.spacing[1] / longest)
    factor = face.unit / longest * vertical_scale
    shown = min(factor, _STEEP)  # beyond it an area is proportional to the heights
    ratios = _covers.area_ratios(face.heights * shown, edges, steps) * (factor / shown)
    areas = ratios * face.grid.nominal_area
    return Curve(_edge_lengths(face, edges), areas, np.ones(len(edges), dtype=np.int64), vertical_scale)


def _edge_lengths(face: Face, edges: Array) -> Array:
    """Return the edges in m: the mean of those along y and x, which differ by rounding on unequal grids."""
    along = edges[:, 1] * face.spacing[1]
    return np.asarray(along if face.axes == 1 else np.sqrt(along * edges[:, 0] * face.spacing[0]))


MEASURES: dict[str, Callable[..., Curve]] = {
    "variogram": variogram,
    "madogram": madogram,
    "second_variogram": second_variogram,
    "roughness_length": roughness_length,
    "variation": variation,
    "cube_counts": cube_counts,
    "covering": covering,
}
