"""Square windows on a grid: their edges, and the extremes of the heights inside them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.numbers import ROUNDED, Array, nearest_whole
from fractalcontact.dimensions._surface_input import Scales, Surface, between


def square_windows(
    surface: Surface, window: Scales = None, *, smallest: tuple[float, ...] = (1.0,), share: float = 0.5
) -> tuple[Array, Array]:
    """Return edges of square windows, doubling from `smallest` coarse spacings to `share` of the surface.

    Parameters
    ----------
    surface : Surface
    window : (low, high), optional
        Leave out edges outside, in m.
    smallest : tuple of float
        The edges double from each of these.

    Returns
    -------
    edges : ndarray of int, shape (k, 2)
        In points along y (0 for a profile) and x, as nearly square as the grid allows.
    lengths : ndarray, shape (k,)
        In m: the geometric mean of those along y and x, which differ on unequal grids.
    """
    axes = [axis for axis in (0, 1) if surface.shape[axis] > 1]
    coarse = max(surface.spacing[axis] for axis in axes)
    shortest = min((surface.shape[axis] - 1) * surface.spacing[axis] for axis in axes)
    largest = share * shortest / coarse * ROUNDED
    numbers = [int(np.log2(largest / first)) + 1 if largest >= first else 0 for first in smallest]
    edges = [first * 2.0 ** np.arange(number) for first, number in zip(smallest, numbers, strict=True)]
    sizes = np.sort(np.concatenate(edges))
    points = np.zeros((sizes.size, 2), dtype=int)
    for axis in axes:
        points[:, axis] = np.maximum(nearest_whole(sizes * coarse / surface.spacing[axis]), 1)
    lengths = edge_lengths(surface, points)
    inside = between(lengths, window)
    return points[inside], lengths[inside]


def edge_lengths(surface: Surface, edges: Array) -> Array:
    """Return edges (k, 2) in points as lengths in m."""
    along_x = edges[:, 1] * surface.spacing[1]
    return np.asarray(along_x if surface.axes == 1 else np.sqrt(along_x * edges[:, 0] * surface.spacing[0]))


def running_range(heights: Array, size_y: int, size_x: int) -> Array:
    """Return the range of the heights in windows of size_y x size_x points at every position."""
    spread = _running(heights, size_y, size_x, np.maximum)
    spread -= _running(heights, size_y, size_x, np.minimum)
    return spread


def _running(heights: Array, size_y: int, size_x: int, extreme: Any) -> Array:
    """Return the extreme over every window by doubling; van Herk's algorithm saves nothing at these sizes."""
    for axis, size in ((0, size_y), (1, size_x)):
        width = 1
        while 2 * width <= size:
            heights = _pairwise(heights, axis, width, extreme)
            width *= 2
        if width < size:
            heights = _pairwise(heights, axis, size - width, extreme)
    return heights


def _pairwise(heights: Array, axis: int, shift: int, extreme: Any) -> Array:
    first, second = [slice(None)] * 2, [slice(None)] * 2
    first[axis], second[axis] = slice(None, -shift), slice(shift, None)
    return np.asarray(extreme(heights[tuple(first)], heights[tuple(second)]))
