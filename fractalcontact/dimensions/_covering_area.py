"""Area of the triangulated surface against the edge of the triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Scales, Surface, check_surface
from fractalcontact.dimensions._windows import square_windows

Array = np.ndarray[Any, np.dtype[Any]]

_NAMES = {2: "covering_area", 1: "covering_length"}  # by number of axes
_STEEP = 2.0**300  # slope beyond which the area is proportional to the heights


def _check(problems: Problems, *, surface: Any, vertical_scale: Any) -> None:
    reserved = (*_NAMES.values(), "cube_size", "pair_count", "vertical_scale", *ALWAYS)
    check_surface(problems, surface, squares=True, reserved=reserved)
    problems.number("vertical_scale", vertical_scale, above=0, at_least=1e-50, at_most=1e50)


@public_result(
    title="Area of the covering of a surface",
    references=METHODS["covering"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
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
    return curve_dataset(surface, lambda single: covering_curve(single, None, factor), "cube_size", name)


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
    from fractalcontact.base.threads import in_bands
    from fractalcontact.dimensions._kernels import prism_sums

    ratios = np.empty(len(edges))
    is_profile = heights.shape[0] == 1
    for k, (ey, ex) in enumerate(edges):
        if is_profile:
            slope = (heights[0, ex:] - heights[0, :-ex]) / (ex * spacing[1])
            ratios[k] = _mean(np.sqrt(1.0 + slope * slope))
            continue
        sums = np.zeros(heights.shape[0] - ey)
        counts = np.zeros(sums.size, dtype=np.int64)
        cell = (ey, ex, ey * spacing[0], ex * spacing[1])
        in_bands(prism_sums, sums.size, heights.size, heights, *cell, sums, counts)
        ratios[k] = np.cumsum(sums)[-1] / counts.sum() if counts.any() else np.nan
    return ratios


def _mean(values: Array) -> float:
    """Return the mean of the finite values."""
    values = values[np.isfinite(values)]
    return float(np.sum(values)) / values.size if values.size else float("nan")
