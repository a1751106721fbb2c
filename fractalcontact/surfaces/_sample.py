"""Surfaces that are installed with the package."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.datasets import datasets_folder
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._from_array import labelled_heights
from fractalcontact.surfaces._read import file_content

NAMES = ("concrete_crack", "jacksboro_fault_dem")


def _check(problems: Problems, *, name: Any) -> None:
    problems.choice("name", name, NAMES)


@public_result(title="Sample surface", achieved_error="exact: heights as the file states them", check=_check)
def sample(name: str) -> xr.DataArray:
    """Return a surface that is installed with this package or with matplotlib.

    Parameters
    ----------
    name : str
        "concrete_crack": a synthetic crack face, 512 x 512 points 80 um apart; its script is in `datasets`.
        "jacksboro_fault_dem": a measured land surface of 344 x 403 points, about 93 m by 74 m apart, in
        integer metres, from matplotlib.

    Returns
    -------
    DataArray
        `height` with dims (y, x) in metres; y points north.

    Raises
    ------
    InvalidInput
        There is no such sample.

    Notes
    -----
    The grid of the land surface is given in degrees. It is converted to metres at its middle latitude with
    the series for the WGS 84 ellipsoid; over its 0.29 degrees of latitude the x spacing varies by 0.4 %.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> crack = fc.surfaces.sample("concrete_crack")
    >>> dict(crack.sizes), round(float(crack.x[1] - crack.x[0]), 9)
    ({'y': 512, 'x': 512}, 8e-05)
    """
    return _land_surface() if name == "jacksboro_fault_dem" else _concrete_crack()


def _concrete_crack() -> xr.DataArray:
    content = file_content(datasets_folder() / "concrete_crack.nc")
    surface = content.surface
    surface.attrs = {"title": "Synthetic crack face of concrete", "before": content.entries["before"]}
    return surface


def _land_surface() -> xr.DataArray:
    from matplotlib import cbook  # loads slowly, and the other samples do not need it

    content: Any = cbook.get_sample_data("jacksboro_fault_dem.npz")
    with content as file:
        heights = np.asarray(file["elevation"], dtype=np.float64)
        step_y, step_x = float(file["dy"]), float(file["dx"])
        latitude = np.deg2rad(0.5 * (float(file["ymin"]) + float(file["ymax"])))
    along_y, along_x = _metres_per_degree(latitude)
    # the first row of the file is the north
    surface = labelled_heights(heights[::-1], (step_y * along_y, step_x * along_x))
    surface.attrs = {"title": "Land surface at the Jacksboro fault", "source_file": "jacksboro_fault_dem.npz"}
    return surface


def _metres_per_degree(latitude: float) -> tuple[float, float]:
    """Return the length of a degree of latitude and one of longitude (WGS 84; latitude in rad)."""
    major, flattening = 6378137.0, 1.0 / 298.257223563
    eccentricity = flattening * (2.0 - flattening)
    reduced = 1.0 - eccentricity * np.sin(latitude) ** 2
    meridian = major * (1.0 - eccentricity) / reduced**1.5
    parallel = major / np.sqrt(reduced) * np.cos(latitude)
    return float(np.deg2rad(meridian)), float(np.deg2rad(parallel))
