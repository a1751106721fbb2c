"""Random midpoint displacement on a square of 2^k + 1 points, arrays only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
Points = Sequence[tuple[float, float]]


def displaced(
    levels: int, spacing: tuple[float, float], hurst: float, rng: np.random.Generator, *, additions: bool
) -> Array:
    """Return heights aimed at E[(z(a) - z(b))^2] = r^(2H), shape (2^levels + 1,) * 2.

    Each point is the mean of its neighbours of the coarser grid plus a normal number, as strong as the
    difference of a fractional Brownian surface from that mean; what the neighbours' neighbours know is
    forgotten, and that is the error of the method. `additions` displaces all points at each stage (Saupe
    1988).
    """
    n = (1 << levels) + 1
    heights = np.zeros((n, n))
    step = n - 1
    heights[::step, ::step] = _corners((step * spacing[0], step * spacing[1]), hurst, rng)
    while step > 1:
        half = step // 2
        reach = (half * spacing[0], half * spacing[1])
        _centres(heights, step, reach, hurst, rng, additions=additions)
        _edges(heights, step, reach, hurst, rng, additions=additions)
        step = half
    return heights


def _corners(edges: tuple[float, float], hurst: float, rng: np.random.Generator) -> Array:
    """Draw four exact corners; the first is at height 0."""
    places = np.array([(0.0, edges[1]), (edges[0], 0.0), edges])
    far = np.hypot(*places.T) ** (2 * hurst)
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) ** (2 * hurst)
    factor = np.linalg.cholesky(0.5 * (far[:, None] + far - apart))
    return np.array([0.0, *(factor * rng.standard_normal(3)).sum(axis=1)]).reshape(2, 2)


def _centres(
    heights: Array,
    step: int,
    reach: tuple[float, float],
    hurst: float,
    rng: np.random.Generator,
    *,
    additions: bool,
) -> None:
    """Give the centre of each square the mean of its corners, displaced."""
    corners = heights[::step, ::step]
    mean = 0.25 * (corners[:-1, :-1] + corners[:-1, 1:] + corners[1:, :-1] + corners[1:, 1:])
    y, x = reach
    deviation = _deviation([(-y, -x), (-y, x), (y, -x), (y, x)], hurst, additions=additions)
    heights[step // 2 :: step, step // 2 :: step] = mean + deviation * rng.standard_normal(mean.shape)
    if additions:
        corners += deviation * rng.standard_normal(corners.shape)


def _edges(
    heights: Array,
    step: int,
    reach: tuple[float, float],
    hurst: float,
    rng: np.random.Generator,
    *,
    additions: bool,
) -> None:
    """Give the middle of each edge the mean of its two ends and of the centres beside it, displaced."""
    half = step // 2
    y, x = reach
    corners, centres = heights[::step, ::step], heights[half::step, half::step]
    whole = [(0.0, -x), (0.0, x), (-y, 0.0), (y, 0.0)]
    inside = _deviation(whole, hurst, additions=additions)
    for axis in (0, 1):
        ends = np.moveaxis(corners, axis, 0)  # edges run along `axis`
        beside = np.moveaxis(centres, axis, 0)
        total = ends[:-1] + ends[1:]
        total[:, :-1] += beside
        total[:, 1:] += beside
        total[:, 1:-1] *= 0.25
        total[:, [0, -1]] /= 3.0
        deviation = np.full(total.shape[1], inside)
        along = [(-y, 0.0), (y, 0.0)] if axis == 0 else [(0.0, -x), (0.0, x)]
        deviation[[0, -1]] = _deviation(
            [*along, (0.0, x) if axis == 0 else (y, 0.0)], hurst, additions=additions
        )
        total += deviation * rng.standard_normal(total.shape)
        rows, columns = (slice(half, None, step), slice(None, None, step))
        np.moveaxis(heights, axis, 0)[rows, columns] = total
    if additions:
        corners += inside * rng.standard_normal(corners.shape)
        centres += inside * rng.standard_normal(centres.shape)


def _deviation(neighbours: Points, hurst: float, *, additions: bool) -> float:
    """Return the standard deviation of the displacement of a point at the origin.

    Without additions it is that of a fractional Brownian surface about the mean of these neighbours. With
    them, the nearest neighbour is displaced as well, and the two together make up the variogram between it
    and the point.
    """
    places = np.array(neighbours)
    away = np.hypot(*places.T) ** (2 * hurst)
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) ** (2 * hurst)
    if not additions:
        return math.sqrt(away.mean() - 0.5 * apart.mean())
    nearest = int(np.argmin(away))
    known = float(apart[nearest].mean() - 0.5 * apart.mean())
    return math.sqrt(max(0.0, 0.5 * (float(away[nearest]) - known)))
