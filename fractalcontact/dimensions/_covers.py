"""Curves over the size of a window: cubes, triangulated area, roughness inside windows."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


def sizes(
    shape: tuple[int, int], steps: tuple[float, float], *, smallest: float = 1.0, share: float = 0.5
) -> Array:
    """Return edges of square windows, doubling from `smallest` coarse spacings to `share` of the face.

    Parameters
    ----------
    shape : (ny, nx)
        A profile has ny = 1.
    steps : (dy, dx)

    Returns
    -------
    ndarray of int, shape (k, 2)
        Edges in points along y and x, as nearly square as the grid allows.
    """
    axes = [axis for axis in (0, 1) if shape[axis] > 1]
    coarse = max(steps[axis] for axis in axes)
    largest = share * min((shape[axis] - 1) * steps[axis] for axis in axes) / coarse
    if largest < smallest:
        return np.empty((0, 2), dtype=int)
    edges = smallest * 2.0 ** np.arange(int(np.log2(largest / smallest) + 1e-9) + 1)
    points = np.zeros((edges.size, 2), dtype=int)
    for axis in axes:
        points[:, axis] = np.maximum(np.rint(edges * coarse / steps[axis]), 1)
    return points


def cube_counts(heights: Array, edges: Array, lengths: Array, extent: float, axes: int) -> Array:
    """Count the cubes that meet a face, on average over all positions of their grid.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        In the unit of `lengths`; NaN where nothing was observed.
    edges : ndarray of int, shape (k, 2)
        Edges in points.
    lengths : ndarray, shape (k,)
        Edges in the unit of heights.
    extent : float
        Area of the face, or length of a profile, in powers of the same unit.

    Returns
    -------
    ndarray, shape (k,)
        A column of cubes that spans heights of range R meets R / length + 1 of them on average over the
        vertical position of the grid.
    """
    counts = np.empty(len(edges))
    for k, ((ey, ex), length) in enumerate(zip(edges, lengths, strict=True)):
        high = _running(heights, ey + 1, ex + 1, np.maximum)
        low = _running(heights, ey + 1, ex + 1, np.minimum)
        spread = high - low
        spread = spread[np.isfinite(spread)]
        mean = float(np.sum(spread / length)) / spread.size + 1.0 if spread.size else np.nan
        counts[k] = mean * extent / length**axes
    return counts


def mean_ranges(heights: Array, edges: Array) -> tuple[Array, Array]:
    """Return the mean range of the heights over stretches of the rows and of the columns, and their number.

    Stretches are `edges` (k, 2) spacings long along y and x, one more point than that, in every position.
    """
    means, numbers = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        total = 0.0
        for size_y, size_x in ((1, ex + 1), (ey + 1, 1)) if ey else ((1, ex + 1),):
            spread = _running(heights, size_y, size_x, np.maximum)
            spread -= _running(heights, size_y, size_x, np.minimum)
            spread = spread[np.isfinite(spread)]
            total += float(np.sum(spread))
            numbers[k] += spread.size
        if numbers[k]:
            means[k] = total / numbers[k]
    return means, numbers


def _running(heights: Array, size_y: int, size_x: int, extreme: Any) -> Array:
    """Return the extreme over every window, by doubling (van Herk needs no less work for these sizes)."""
    for axis, size in ((0, size_y), (1, size_x)):
        width = 1
        while 2 * width <= size:
            heights = _both(heights, axis, width, extreme)
            width *= 2
        if width < size:
            heights = _both(heights, axis, size - width, extreme)
    return heights


def _both(heights: Array, axis: int, shift: int, extreme: Any) -> Array:
    first, second = [slice(None)] * 2, [slice(None)] * 2
    first[axis], second[axis] = slice(None, -shift), slice(shift, None)
    return np.asarray(extreme(heights[tuple(first)], heights[tuple(second)]))


def area_ratios(heights: Array, edges: Array, steps: tuple[float, float]) -> Array:
    """Return the area of the triangulated face over that of its plan, for each edge of the triangles.

    The triangular prisms of Clarke (1986), on every cell of every position of the grid; for a profile (one
    row) the length of the chords over that of their plan.
    """
    from fractalcontact.base.jit import use_threads
    from fractalcontact.dimensions._kernels import prism_sums

    use_threads()
    ratios = np.empty(len(edges))
    flat = heights.shape[0] == 1
    for k, (ey, ex) in enumerate(edges):
        if flat:
            slope = (heights[0, ex:] - heights[0, :-ex]) / (ex * steps[1])
            ratios[k] = _mean(np.sqrt(1.0 + slope * slope))
            continue
        sums = np.zeros(heights.shape[0] - ey)
        counts = np.zeros(sums.size, dtype=np.int64)
        prism_sums(heights, ey, ex, ey * steps[0], ex * steps[1], sums, counts)
        ratios[k] = np.cumsum(sums)[-1] / counts.sum() if counts.any() else np.nan
    return ratios


def roughness(heights: Array, edges: Array) -> tuple[Array, Array]:
    """Return the mean rms deviation from a plane in windows, and how many windows there were.

    Windows overlap by half; their edge in points is that of `edges`, at least one point along y.
    """
    from fractalcontact.base.jit import use_threads
    from fractalcontact.dimensions._kernels import roughness_sums

    use_threads()
    means, numbers = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        size_y, size_x = max(int(ey), 1), int(ex)
        rows = np.arange(0, heights.shape[0] - size_y + 1, max(size_y // 2, 1))
        columns = np.arange(0, heights.shape[1] - size_x + 1, max(size_x // 2, 1))
        sums, counts = np.zeros(rows.size), np.zeros(rows.size, dtype=np.int64)
        roughness_sums(heights, size_y, size_x, rows, columns, sums, counts)
        numbers[k] = counts.sum()
        if numbers[k]:
            means[k] = np.cumsum(sums)[-1] / numbers[k]
    return means, numbers


def expected_roughness(edges: Array, steps: tuple[float, float], hurst: float) -> Array:
    """Return what `roughness` is expected to be for a fractional Brownian surface of unit rms increment.

    The root of the mean square about a plane in windows of few points: half the sum over all pairs of points
    of the projection on the plane times distance^(2 hurst), over the number of points.
    """
    found = np.empty(len(edges))
    for k, (ey, ex) in enumerate(edges):
        (flat_y, tilt_y), (flat_x, tilt_x) = _overlaps(max(int(ey), 1)), _overlaps(int(ex))
        weights = np.outer(flat_y + tilt_y, flat_x) + np.outer(flat_y, tilt_x)
        y, x = np.arange(flat_y.size) * steps[0], np.arange(flat_x.size) * steps[1]
        square = np.sum(weights * (y[:, None] ** 2 + x**2) ** hurst)
        found[k] = np.sqrt(0.5 * square / (max(int(ey), 1) * int(ex)))
    return found


def _overlaps(n: int) -> tuple[Array, Array]:
    """Return how a constant and a tilt of n points, of norm one, overlap with themselves at each lag."""
    places = np.arange(n) - 0.5 * (n - 1)
    norm = np.sqrt(np.sum(places**2))
    lines = np.full(n, n**-0.5), places / norm if n > 1 else np.zeros(1)
    found = [np.correlate(line, line, "full")[n - 1 :] for line in lines]
    for one in found:
        one[1:] *= 2.0  # lags of both signs
    return found[0], found[1]


def _mean(values: Array) -> float:
    values = values[np.isfinite(values)]
    return float(np.sum(values)) / values.size if values.size else float("nan")
