"""Range of the heights over segments of rows and columns, or over squares, against their length."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, check_surface
from fractalcontact.dimensions._windows import edge_lengths, running_range, square_windows

Array = np.ndarray[Any, np.dtype[Any]]


def _check(problems: Problems, *, surface: Any, sizes: Any, windows: Any, mean: Any) -> None:
    is_valid = check_surface(
        problems, surface, squares=True, reserved=("variation", "window_size", "pair_count", *ALWAYS)
    )
    problems.choice("windows", windows, ("segments", "squares"))
    problems.choice("mean", mean, ("arithmetic", "geometric"))
    if sizes is not None and problems.numbers("sizes", sizes, above=0) and is_valid:
        grid = read_grid(surface, core_dims(surface))
        shortest, longest = (
            max(grid.spacing),
            min(d * (n - 1) for d, n in zip(grid.spacing, grid.shape, strict=True)),
        )
        values = np.atleast_1d(np.asarray(sizes, dtype=np.float64))
        is_inside = values.min() >= shortest * (1 - 1e-9) and values.max() <= longest * (1 + 1e-9)
        expected = f"lengths from {shortest:.3g} m (a spacing) to {longest:.3g} m (the surface)"
        problems.require(bool(is_inside), "sizes", expected, sizes)


@public_result(
    title="Range of heights over windows of a surface",
    references=METHODS["variation"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
    memory=40.0,
)
def variation(
    surface: xr.DataArray, sizes: Any = None, *, windows: str = "segments", mean: str = "arithmetic"
) -> xr.Dataset:
    """Return the mean range of the heights over windows against their length.

    The boxes that a profile meets in a segment are as high as its range there: this is what box counting
    measures, without a grid of boxes and without a unit of height.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); windows that contain NaN are left out.
    sizes : sequence of float, optional
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
    lengths = None if sizes is None else np.sort(np.atleast_1d(np.asarray(sizes, dtype=float)))

    def measured(single: Surface) -> Curve:
        edges = None if lengths is None else _edges_of(single, lengths)
        return variation_curve(single, None, edges, windows == "squares", mean == "geometric")

    return curve_dataset(surface, measured, "window_size", "variation", count="pair_count")


def _edges_of(surface: Surface, sizes: Array) -> Array:
    """Return the edges (k, 2) in spacings of windows of given lengths, without repetition."""
    edges = np.zeros((sizes.size, 2), dtype=int)
    for axis in range(2 - surface.axes, 2):
        most = surface.shape[axis] - 1
        edges[:, axis] = np.clip(np.rint(sizes / surface.spacing[axis]), 1, most)
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
            spread = (
                spread[np.isfinite(spread) & (spread > 0.0)] if geometric else spread[np.isfinite(spread)]
            )
            total += float(np.sum(np.log(spread) if geometric else spread))
            numbers[k] += spread.size
        if numbers[k]:
            means[k] = np.exp(total / numbers[k]) if geometric else total / numbers[k]
    return means, numbers
