"""Number of cubes that meet a surface, and area of its triangulation, against the edge (Clarke 1986)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, check_surface
from fractalcontact.dimensions._windows import running_range, square_windows


def _check(problems: Problems) -> None:
    given = problems.given
    check_surface(problems, reserved=("cube_count", "cube_size", "pair_count", "vertical_scale", *ALWAYS))
    if not (isinstance(given.vertical_scale, str) and given.vertical_scale == "range"):
        problems.number("vertical_scale", above=0, at_least=1e-50, at_most=1e50)


@public_result(
    title="Cube counts of a surface",
    references=METHODS["cube_counts"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
    memory=48.0,
)
def cube_counts(surface: xr.DataArray, *, vertical_scale: float | str = "range") -> xr.Dataset:
    """Count the cubes that meet a surface, averaged over all positions of the grid of cubes.

    The count depends on the unit of height: where heights are small compared with the cubes, it is that of
    a plane. `vertical_scale` states how the heights were scaled and is part of the result.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); columns of cubes that contain NaN are left out.
    vertical_scale : "range" or float
        "range" scales the heights so that their range equals the extent of the surface (geometric mean of
        its edges); a number multiplies them, 1 being natural scale.

    Returns
    -------
    Dataset over `cube_size` (m)
        `cube_count` (not an integer: a mean over positions), `local_slope`, which is -D for a fractal
        surface, and `vertical_scale`. Edges double from one spacing to half the surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or `vertical_scale` is not positive.

    Notes
    -----
    Measured influence of the unit: an fBm surface of 512 x 512 points with H = 0.6 (D = 2.4) and an rms
    increment of a tenth of the spacing gives D = 2.00, 2.02, 2.14, 2.30 and 2.34 as its heights are
    multiplied by 0.1, 1, 10, 100 and 1000. Extremes of sampled heights miss what lies between the points,
    so that D is too low for rough surfaces, by 0.2 to 0.3 where H is small.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998); Clarke (1986), Computers and Geosciences 12.

    Examples
    --------
    A flat surface of 32 x 32 spacings is covered by (32 / edge)^2 cubes:

    >>> import numpy as np, fractalcontact as fc
    >>> flat = fc.surfaces.from_array(np.zeros((33, 33)), 1.0)
    >>> fc.dimensions.cube_counts(flat).cube_count.values
    array([1024.,  256.,   64.,   16.,    4.])
    """
    factor = vertical_scale if isinstance(vertical_scale, str) else float(vertical_scale)
    return curve_dataset(
        surface, lambda single: cube_count_curve(single, None, factor), "cube_size", "cube_count", count=None
    )


def cube_count_curve(surface: Surface, window: Scales = None, vertical_scale: float | str = "range") -> Curve:
    """Return the mean number of cubes that meet one surface."""
    edges, lengths = square_windows(surface, window)
    grid = surface.grid
    area = float(np.prod([(n - 1) * spacing for n, spacing in zip(grid.shape, grid.spacing, strict=True)]))
    heights = surface.heights
    if vertical_scale == "range":
        height_range = float(np.nanmax(heights) - np.nanmin(heights))
        factor = area ** (1.0 / surface.axes) / height_range if height_range > 0 else 1.0
    else:
        factor = float(vertical_scale) * surface.unit
    counts = _mean_counts(heights * factor, edges, lengths, area, surface.axes)
    return Curve(lengths, counts, np.ones(lengths.shape, dtype=np.int64), factor / surface.unit)


def _mean_counts(heights: Array, edges: Array, lengths: Array, area: float, axes: int) -> Array:
    """Count cubes of edge `lengths` (k,), of `edges` (k, 2) points, averaged over all positions.

    A column of cubes over heights of range R meets R / length + 1 of them, averaged over the vertical
    position of the grid. `area` is the length of a profile.
    """
    counts = np.empty(len(edges))
    for k, ((ey, ex), length) in enumerate(zip(edges, lengths, strict=True)):
        spread = running_range(heights, ey + 1, ex + 1)
        spread = spread[np.isfinite(spread)]
        mean = float(np.sum(spread / length)) / spread.size + 1.0 if spread.size else np.nan
        counts[k] = mean * area / length**axes
    return counts


_NAMES = {2: "covering_area", 1: "covering_length"}  # by number of axes
_STEEP = 2.0**300  # slope beyond which the area is proportional to the heights


def _check_covering(problems: Problems) -> None:
    check_surface(problems, reserved=(*_NAMES.values(), "cube_size", "pair_count", "vertical_scale", *ALWAYS))
    problems.number("vertical_scale", above=0, at_least=1e-50, at_most=1e50)


@public_result(
    title="Area of the covering of a surface",
    references=METHODS["covering"].references,
    achieved_error=EXACT_MEAN,
    check=_check_covering,
)
def covering(surface: xr.DataArray, *, vertical_scale: float = 1.0) -> xr.Dataset:
    """Return the area of the triangulated surface against the edge of the triangles.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for the length of a profile; cells with NaN at a corner
        are left out.
    vertical_scale : float
        Multiplies the heights; 1 is natural scale. The area of a surface of small slopes hardly depends on
        the edge: its dimension by this method is then 2, and exactly 2 for a plane.

    Returns
    -------
    Dataset over `cube_size` (m)
        `covering_area` (m2, of the nominal area), or `covering_length` (m) of a profile; `local_slope`,
        which is 2 - D (1 - D of a profile); and `vertical_scale`. Edges double from one spacing to half
        the surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or `vertical_scale` is not positive.

    Notes
    -----
    Each cell is covered by the four triangles between its corners and their mean (triangular prisms).

    References
    ----------
    Clarke (1986), Computers and Geosciences 12.

    Examples
    --------
    A zigzag of slope 1 has the length sqrt(2) per unit length; at twice the edge it is a straight line:

    >>> import numpy as np, fractalcontact as fc
    >>> zigzag = fc.surfaces.from_array(np.arange(65.0) % 2, 1.0)
    >>> (fc.dimensions.covering(zigzag).covering_length[:2] / 65.0).round(3).values
    array([1.414, 1.   ])
    """
    factor = float(vertical_scale)
    name = _NAMES[2 if "y" in surface.dims else 1]
    return curve_dataset(
        surface, lambda single: covering_curve(single, None, factor), "cube_size", name, count=None
    )


def covering_curve(surface: Surface, window: Scales = None, vertical_scale: float = 1.0) -> Curve:
    """Return the area of one triangulated surface."""
    edges, lengths = square_windows(surface, window)
    longest = max(surface.spacing)
    # only slopes matter, and they are formed in scaled lengths
    spacing = (surface.spacing[0] / longest, surface.spacing[1] / longest)
    factor = surface.unit / longest * vertical_scale
    limited = min(factor, _STEEP)  # beyond it an area is proportional to the heights
    ratios = _area_ratios(surface.heights * limited, edges, spacing) * (factor / limited)
    areas = ratios * surface.grid.nominal_area
    return Curve(lengths, areas, np.ones(len(edges), dtype=np.int64), vertical_scale)


def _area_ratios(heights: Array, edges: Array, spacing: tuple[float, float]) -> Array:
    """Return the area of the triangulated surface over that of its plan, for each edge.

    Cells of every position are used. For a profile (one row): the length of the chords over that of their
    plan.
    """
    from fractalcontact.base.resources import in_bands
    from fractalcontact.dimensions._kernels import prism_sums

    ratios = np.empty(len(edges))
    is_profile = heights.shape[0] == 1
    for k, (ey, ex) in enumerate(edges):
        if is_profile:
            slope = (heights[0, ex:] - heights[0, :-ex]) / (ex * spacing[1])
            stretch = np.sqrt(1.0 + slope * slope)
            stretch = stretch[np.isfinite(stretch)]
            ratios[k] = stretch.mean() if stretch.size else np.nan
            continue
        sums = np.zeros(heights.shape[0] - ey)
        counts = np.zeros(sums.size, dtype=np.int64)
        cell = (ey, ex, ey * spacing[0], ex * spacing[1])
        in_bands(prism_sums, sums.size, heights.size, heights, *cell, sums, counts)
        ratios[k] = np.cumsum(sums)[-1] / counts.sum() if counts.any() else np.nan
    return ratios
