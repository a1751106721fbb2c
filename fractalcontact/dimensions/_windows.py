"""Square windows on a grid: their edges, and the extremes of the heights inside them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]


def window_edges(
    shape: tuple[int, int], spacing: tuple[float, float], *, smallest: float = 1.0, share: float = 0.5
) -> Array:
    """Return edges of square windows, doubling from `smallest` coarse spacings to `share` of the surface.

    Parameters
    ----------
    shape : (ny, nx)
        A profile has ny = 1.
    spacing : (dy, dx)

    Returns
    -------
    ndarray of int, shape (k, 2)
        Edges in points along y and x, as nearly square as the grid allows.
    """
    axes = [axis for axis in (0, 1) if shape[axis] > 1]
    coarse = max(spacing[axis] for axis in axes)
    largest = share * min((shape[axis] - 1) * spacing[axis] for axis in axes) / coarse
    if largest < smallest:
        return np.empty((0, 2), dtype=int)
    edges = smallest * 2.0 ** np.arange(int(np.log2(largest / smallest) + 1e-9) + 1)
    points = np.zeros((edges.size, 2), dtype=int)
    for axis in axes:
        points[:, axis] = np.maximum(np.rint(edges * coarse / spacing[axis]), 1)
    return points


def edge_lengths(surface: Surface, edges: Array) -> Array:
    """Return the edges in m: the geometric mean of those along y and x, which differ on unequal grids."""
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
