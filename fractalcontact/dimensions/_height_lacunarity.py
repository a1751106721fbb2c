"""Lacunarity of heights (grey values): how unevenly mass or roughness is spread, by size of window."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, Curve, curve_dataset
from fractalcontact.dimensions._surface_input import Surface, check_surface
from fractalcontact.dimensions._windows import running_range, square_windows

Array = np.ndarray[Any, np.dtype[Any]]

SOURCE = (
    "Plotnick, Gardner, Hargrove, Prestegaard and Perlmutter, Phys. Rev. E 53 (1996) 5461-5468; Dong, "
    "International Journal of Geographical Information Science 14 (2000) 845-865"
)


def _check(problems: Problems, *, surface: Any, mass: Any) -> None:
    problems.choice("mass", mass, ("range", "sum"))
    reserved = ("lacunarity", "window_size", "pair_count", *ALWAYS)
    check_surface(problems, surface, squares=True, reserved=reserved)


@public_result(
    title="Lacunarity of heights",
    references=SOURCE,
    achieved_error="exact to rounding: a mean over all windows",
    check=_check,
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
    return curve_dataset(
        surface,
        lambda single: lacunarity_curve(single, mass),
        "window_size",
        "lacunarity",
        count="pair_count",
    )


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
