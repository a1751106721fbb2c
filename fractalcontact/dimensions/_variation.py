"""Range of the heights over segments of rows and columns against their length."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset, window_slope
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces
from fractalcontact.dimensions._windows import edge_lengths, running_range, window_edges

Array = np.ndarray[Any, np.dtype[Any]]


def _check(problems: Problems, *, surface: Any) -> None:
    check_surface(
        problems, surface, squares=True, reserved=("variation", "window_size", "pair_count", *ALWAYS)
    )


@public_result(
    title="Range of heights over segments of a surface",
    references=METHODS["variation"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
)
def variation(surface: xr.DataArray) -> xr.Dataset:
    """Return the mean range of the heights over segments of rows and columns against their length.

    The boxes that a profile meets in a segment are as high as its range there: this is what box counting
    measures, without a grid of boxes and without a unit of height.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); segments that contain NaN are left out.

    Returns
    -------
    Dataset over `window_size` (m)
        `variation` (m), `pair_count` (of segments) and `local_slope`, which is H for a self-affine surface.
        Lengths double from one spacing to half the surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, or nothing was observed.

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
    """
    surfaces = read_surfaces(surface)
    curves = [variation_curve(single) for single in surfaces]
    slopes = [window_slope(curve) for curve in curves]
    return curve_dataset(
        surface, surfaces, "window_size", curves, slopes, value="variation", count="pair_count"
    )


def variation_curve(surface: Surface) -> Curve:
    """Return the mean range of the heights of one surface."""
    edges = window_edges(surface.shape, surface.spacing)
    means, numbers = _mean_ranges(surface.heights, edges)
    return Curve(edge_lengths(surface, edges), means * surface.unit, numbers)


def _mean_ranges(heights: Array, edges: Array) -> tuple[Array, Array]:
    """Return the mean range over segments of rows and of columns, and the number of segments.

    A segment of `edges` (k, 2) spacings has one more point than that, and takes every position.
    """
    means, numbers = np.full(len(edges), np.nan), np.zeros(len(edges), dtype=np.int64)
    for k, (ey, ex) in enumerate(edges):
        total = 0.0
        for size_y, size_x in ((1, ex + 1), (ey + 1, 1)) if ey else ((1, ex + 1),):
            spread = running_range(heights, size_y, size_x)
            spread = spread[np.isfinite(spread)]
            total += float(np.sum(spread))
            numbers[k] += spread.size
        if numbers[k]:
            means[k] = total / numbers[k]
    return means, numbers
