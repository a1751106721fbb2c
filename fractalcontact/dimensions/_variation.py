"""Range of heights over windows (variation), and how unevenly it is spread (lacunarity of heights)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.numbers import Array, nearest_whole
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, check_surface
from fractalcontact.dimensions._windows import edge_lengths, running_range, square_windows


def _check(problems: Problems) -> None:
    given = problems.given
    is_valid = check_surface(problems, reserved=("variation", "window_size", "pair_count", *ALWAYS))
    problems.choice("windows", among=("segments", "squares"))
    problems.choice("mean", among=("arithmetic", "geometric"))
    if given.window_sizes is not None and problems.numbers("window_sizes", above=0) and is_valid:
        grid = read_grid(given.surface, core_dims(given.surface))
        shortest = max(grid.spacing)
        longest = min(d * (n - 1) for d, n in zip(grid.spacing, grid.shape, strict=True))
        values = np.atleast_1d(np.asarray(given.window_sizes, dtype=np.float64))
        is_inside = values.min() >= shortest * (1 - 1e-9) and values.max() <= longest * (1 + 1e-9)
        expected = f"lengths from {shortest:.3g} m (a spacing) to {longest:.3g} m (the surface)"
        problems.require(bool(is_inside), "window_sizes", expected)


@public_result(
    title="Range of heights over windows of a surface",
    references=METHODS["variation"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
    memory=40.0,
)
def variation(
    surface: xr.DataArray, window_sizes: Any = None, *, windows: str = "segments", mean: str = "arithmetic"
) -> xr.Dataset:
    """Return the mean range of the heights over windows against their length.

    The boxes that a profile meets in a segment are as high as its range there: this is what box counting
    measures, without a grid of boxes and without a unit of height.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); windows that contain NaN are left out.
    window_sizes : sequence of float, optional
        Edges of the windows in m, rounded to whole spacings. By default they double from one spacing to half
        the surface.
    windows : {"segments", "squares"}
        Segments of rows and of columns, or square windows, as the height range of ecologists. A profile has
        segments only.
    mean : {"arithmetic", "geometric"}
        Mean of the ranges. Windows of equal heights, which have no logarithm, are left out of the geometric
        one.

    Returns
    -------
    Dataset over `window_size` (m)
        `variation` (m), `pair_count` (of windows) and `local_slope`, which is H for a self-affine surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or a size is outside the surface.

    Notes
    -----
    Over one spacing it is the mean absolute increment, twice the madogram. Hall and Wood (1993) use the
    difference of the two ends of a segment as its range, over one and two spacings: that is
    ``estimate(surface, "madogram", scales=(dx, 2 * dx))``. The range uses more of the segment but misses
    the heights between the points, so that its slope is too high where H is small.

    References
    ----------
    Dubuc, Quiniou, Roques-Carmes, Tricot and Zucker (1989), Physical Review A 39; Hall and Wood (1993),
    Biometrika 80.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ramp = fc.surfaces.from_array(0.5 * np.arange(33.0), 1.0)
    >>> curve = fc.dimensions.variation(ramp)
    >>> bool(np.allclose(curve.variation, 0.5 * curve.window_size))
    True
    >>> fc.dimensions.variation(ramp, [2.0, 5.0], mean="geometric").variation.values.round(9).tolist()
    [1.0, 2.5]
    """
    lengths = None if window_sizes is None else np.sort(np.atleast_1d(np.asarray(window_sizes, dtype=float)))

    def measured(single: Surface) -> Curve:
        edges = None if lengths is None else _edges_of(single, lengths)
        return variation_curve(single, None, edges, windows == "squares", mean == "geometric")

    return curve_dataset(surface, measured, "window_size", "variation")


def _edges_of(surface: Surface, sizes: Array) -> Array:
    """Return the edges (k, 2) in spacings of windows of given lengths, without repetition."""
    edges = np.zeros((sizes.size, 2), dtype=int)
    for axis in range(2 - surface.axes, 2):
        most = surface.shape[axis] - 1
        edges[:, axis] = np.clip(nearest_whole(sizes / surface.spacing[axis]), 1, most)
    return np.unique(edges, axis=0)


def variation_curve(
    surface: Surface,
    window: Scales = None,
    edges: Array | None = None,
    squares: bool = False,
    geometric: bool = False,
) -> Curve:
    """Return the mean range of the heights of one surface, by default over segments that double in length."""
    if edges is None:
        edges = square_windows(surface, window)[0]
    means, numbers = _mean_ranges(surface.heights, edges, squares, geometric)
    return Curve(edge_lengths(surface, edges), means * surface.unit, numbers)


def _mean_ranges(heights: Array, edges: Array, squares: bool, geometric: bool) -> tuple[Array, Array]:
    """Return the mean range over windows, and the number of windows.

    A window of `edges` (k, 2) spacings has one more point along each axis, and takes every position.
    """
    means, numbers = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        shapes = ((1, ex + 1), (ey + 1, 1)) if ey else ((1, ex + 1),)
        if squares and ey:
            shapes = ((ey + 1, ex + 1),)
        total = 0.0
        for size_y, size_x in shapes:
            spread = running_range(heights, size_y, size_x)
            spread = spread[np.isfinite(spread) & (spread > 0.0 if geometric else True)]
            total += float(np.sum(np.log(spread) if geometric else spread))
            numbers[k] += spread.size
        if numbers[k]:
            means[k] = np.exp(total / numbers[k]) if geometric else total / numbers[k]
    return means, numbers


SOURCE = (
    "Plotnick, Gardner, Hargrove, Prestegaard and Perlmutter, Phys. Rev. E 53 (1996) 5461-5468; Dong, "
    "International Journal of Geographical Information Science 14 (2000) 845-865"
)


def _check_lacunarity(problems: Problems) -> None:
    problems.choice("mass", among=("range", "sum"))
    check_surface(problems, reserved=("lacunarity", "window_size", "pair_count", *ALWAYS))


@public_result(
    title="Lacunarity of heights",
    references=SOURCE,
    achieved_error="exact to rounding: a mean over all windows",
    check=_check_lacunarity,
)
def height_lacunarity(surface: xr.DataArray, *, mass: str = "range") -> xr.Dataset:
    """Return the lacunarity of the heights of a surface (grey values) by gliding windows.

    A window moves over the surface point by point; M is its mass, and the lacunarity is <M^2> / <M>^2 over
    all positions: 1 for an even surface, more for one whose parts differ at the size of the window.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); windows that contain NaN are left out.
    mass : {"range", "sum"}
        The range of the heights in the window (Dong 2000), which does not depend on the level; or the sum of
        the heights above the lowest of the surface (Plotnick et al. 1996).

    Returns
    -------
    Dataset over `window_size` (m)
        `lacunarity`, `pair_count` (of windows) and `local_slope`. The edge of the windows doubles from one
        point (for the range two) to half the surface. NaN where all masses vanish.

    Raises
    ------
    InvalidInput
        An axis is not uniform, or nothing was observed.

    References
    ----------
    Plotnick et al. (1996), Phys. Rev. E 53; Dong (2000), Int. J. Geogr. Inf. Sci. 14.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ramp = fc.surfaces.from_array(np.add.outer(np.arange(16.0), np.arange(16.0)), 1.0)
    >>> fc.dimensions.height_lacunarity(ramp).lacunarity.values.tolist()
    [1.0, 1.0]
    """
    return curve_dataset(surface, lambda single: lacunarity_curve(single, mass), "window_size", "lacunarity")


def lacunarity_curve(surface: Surface, mass: str) -> Curve:
    """Return the lacunarity of one surface; the edges of windows are in points."""
    edges, lengths = square_windows(surface, smallest=(2.0 if mass == "range" else 1.0,))
    values, counts = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        size = (max(int(ey), 1), int(ex))
        masses = running_range(surface.heights, *size) if mass == "range" else _sums(surface.heights, *size)
        masses = masses[np.isfinite(masses)]
        counts[k] = masses.size
        mean = float(masses.mean()) if masses.size else 0.0
        if mean > 0.0:
            ratio = masses / mean
            values[k] = float(np.mean(ratio * ratio))
    return Curve(lengths, values, counts)


def _sums(heights: Array, size_y: int, size_x: int) -> Array:
    """Return the sum of the heights in every window; NaN where one is missing."""
    for axis, size in ((0, size_y), (1, size_x)):
        lines = np.moveaxis(heights, axis, -1)
        observed = np.isfinite(lines)
        zero = np.zeros((len(lines), 1))
        total = np.concatenate([zero, np.cumsum(np.where(observed, lines, 0.0), axis=1)], axis=1)
        missing = np.concatenate([zero, np.cumsum(~observed, axis=1)], axis=1)
        part = total[:, size:] - total[:, :-size]
        part[missing[:, size:] > missing[:, :-size]] = np.nan
        heights = np.moveaxis(part, -1, axis)
    return heights
