"""Spikes of a scan taken out: points that stand out from all around them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base import provenance, schema
from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import familiar
from fractalcontact.base.grid import check_surface
from fractalcontact.surfaces._spikes import spikes

if TYPE_CHECKING:
    import xarray as xr


@provenance.accounted("none: heights that stay are as given")
def despike(surface: xr.DataArray, *, threshold: float = 6.0, window: int = 5) -> xr.DataArray:
    """Take out the points of a scan that stand out from all around them.

    Dust, glitter and edges that hide their foot leave single wrong heights in optical scans. Two faces are
    held apart by their highest points alone, so that a handful of them decides closure and friction. Nothing
    is put in the place of a spike: it becomes a missing height, to be filled (`fill`) or left out.

    Parameters
    ----------
    surface : DataArray, dims (y, x)
        Heights in metres; missing ones (NaN) stay missing.
    threshold : float
        How far from the median around it a height may lie, in robust standard deviations of that distance
        over the whole face. A true, sharp edge of a rough face stands out too: look at what is taken, and
        ask whether the results depend on it.
    window : int
        Odd edge of the square, in cells, of which the median is taken; 3 or more. A spike may be up to half
        as wide.

    Returns
    -------
    DataArray
        `height` with NaN in the place of the spikes; the scalar coordinate `removed_points` counts them. The
        provenance keeps the robust standard deviation (m).

    Raises
    ------
    InvalidInput
        The surface is no plane of heights, or an argument is wrong.

    References
    ----------
    Rousseeuw and Croux (1993), J. Am. Stat. Assoc. 88:1273 (median absolute deviation).
    """
    with Problems("fractalcontact.surfaces.despike") as problems:
        grid = check_surface(surface, problems, finite=False)
        least = problems.number("threshold", threshold, above=0)
        width = problems.integer("window", window, at_least=3, at_most=min(grid.shape))
        problems.require(width % 2 == 1, "window", "an odd number of cells", window)
        if not problems.found:
            heights = np.asarray(surface.values, dtype=np.float64)
            infinite = int(np.count_nonzero(np.isinf(heights)))
            problems.require(infinite == 0, "surface", "no infinite heights", f"{infinite}")
            problems.require(bool(np.isfinite(heights).any()), "surface", "heights", "none")
    flagged, usual = spikes(heights, width, least)
    result = familiar(surface.copy(data=np.where(flagged, np.nan, heights)).rename("height"))
    result = schema.label(result.assign_coords(removed_points=int(flagged.sum())))
    parameters = {"surface": surface, "threshold": least, "window": width}
    return provenance.stamp(
        result,
        "fractalcontact.surfaces.despike",
        parameters,
        title="Surface with spikes taken out",
        removed_points=int(flagged.sum()),
        usual_distance=usual,
    )
