"""Surfaces that every user has without a download."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.datasets import datasets_folder

if TYPE_CHECKING:
    import xarray as xr

NAMES = ("concrete_crack", "jacksboro_fault_dem")


def sample(name: str) -> xr.DataArray:
    """Return a surface that comes with this package or with matplotlib.

    Parameters
    ----------
    name : str
        "concrete_crack": a synthetic crack face, 512 x 512 points 80 um apart, made by a script beside it.
        "jacksboro_fault_dem": a measured land surface of 344 x 403 points, about 93 m by 74 m apart, in
        whole metres, which matplotlib installs.

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
    The grid of the land surface is given in degrees. It is turned into metres at its middle latitude with
    the series for the WGS 84 ellipsoid; over its 0.29 degrees of latitude the x spacing varies by 0.4 %.
    """
    with Problems("fractalcontact.surfaces.sample") as problems:
        problems.choice("name", name, NAMES)
    return _land() if name == "jacksboro_fault_dem" else _crack()


def _crack() -> xr.DataArray:
    from fractalcontact.surfaces.measured import read

    return read(datasets_folder() / "concrete_crack.nc")


def _land() -> xr.DataArray:
    from matplotlib import cbook

    from fractalcontact.surfaces.measured import from_array

    content: Any = cbook.get_sample_data("jacksboro_fault_dem.npz")
    with content as file:
        heights = np.asarray(file["elevation"], dtype=np.float64)
        step_y, step_x = float(file["dy"]), float(file["dx"])
        latitude = np.deg2rad(0.5 * (float(file["ymin"]) + float(file["ymax"])))
    along_y, along_x = _metres_per_degree(latitude)
    # the first row of the file is the north
    return from_array(heights[::-1], (step_y * along_y, step_x * along_x))


def _metres_per_degree(latitude: float) -> tuple[float, float]:
    """Return the length of a degree of latitude and one of longitude (WGS 84; latitude in rad)."""
    major, flattening = 6378137.0, 1.0 / 298.257223563
    eccentricity = flattening * (2.0 - flattening)
    squeezed = 1.0 - eccentricity * np.sin(latitude) ** 2
    meridian = major * (1.0 - eccentricity) / squeezed**1.5
    parallel = major / np.sqrt(squeezed) * np.cos(latitude)
    return float(np.deg2rad(meridian)), float(np.deg2rad(parallel))
