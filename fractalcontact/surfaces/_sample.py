"""Surfaces that are installed with the package, and measured ones in a folder of the user."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.files import datasets_folder
from fractalcontact.base.provenance import file_checksum
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, Words
from fractalcontact.surfaces._files import Request, require_readable
from fractalcontact.surfaces._from_array import labelled_heights
from fractalcontact.surfaces._read import file_content

FOLDER = "FRACTALCONTACT_DATA"  # environment variable: folder of the measured surfaces
GNEISS = (
    "https://github.com/g9cunha/Advancements-in-coupled-processes-numerical-models-upscaling-using-"
    "spatial-continuity at 5951a01, MIT; Cunha et al. 2024, iScience 27, 111094"
)
INSTRUMENTS = "https://github.com/ContactEngineering/SurfaceTopography at 119cb66, MIT"


@dataclass(frozen=True)
class Measured:
    """A measured surface in a file `NAME.npy`: title, spacing (m), SHA-256, and where it is from."""

    title: str
    spacing: float
    sha256: str
    source: str


MEASURED = {
    "freiberg_gneiss_side_a": Measured(
        "Lower face of a fracture in gneiss",
        3e-4,
        "ffeebb77fe00b5f6ea83ab544f50f4ea383e192a5d416f262f46ade4568afc60",
        f"Extracted M CNL_SideA_bottom.txt of {GNEISS}",
    ),
    "freiberg_gneiss_side_b": Measured(
        "Upper face of a fracture in gneiss",
        3e-4,
        "a5339085cacaccfdd3aec1ad92a2096eec6bd2b9435197eda278741c3716b03d",
        f"Extracted M CNL_SideB of {GNEISS}",
    ),
    "afm_10um_di3": Measured(
        "Rough film, atomic force microscope",
        3.90625e-8,
        "e60ef22b1156e9aae80cabbcae46b80de889d019eb274cf4278ef5069b5f226e",
        f"test/file_format_examples/di-3.di of {INSTRUMENTS}",
    ),
    "wli_126um_opd1": Measured(
        "Polished surface, white-light interferometer",
        1.9673303177114576e-7,
        "6caaa1b86682bc9a7506afc6d3bb9d2b751b4c3a2330e5721a8d2610957cb10a",
        f"test/file_format_examples/opd-1.opd of {INSTRUMENTS}",
    ),
}
NAMES = ("concrete_crack", "jacksboro_fault_dem", *MEASURED)


def _check(problems: Problems) -> None:
    problems.choice("name", among=NAMES)


@public_result(title="Sample surface", achieved_error="exact: heights as the file states them", check=_check)
def sample(name: str) -> xr.DataArray:
    """Return a surface that is installed with this package or with matplotlib, or a measured one.

    Parameters
    ----------
    name : str
        "concrete_crack": a synthetic crack face, 512 x 512 points 80 um apart; its script is in `datasets`.
        The scene of that name makes a smoother face of its own.
        "jacksboro_fault_dem": a measured land surface of 344 x 403 points, about 93 m by 74 m apart, in
        integer metres, from matplotlib.
        "freiberg_gneiss_side_a", "freiberg_gneiss_side_b", "afm_10um_di3", "wli_126um_opd1": measured
        surfaces, read from the folder that the environment variable FRACTALCONTACT_DATA names. The page
        `measured_surfaces` of the documentation has their sources and licences.

    Returns
    -------
    DataArray
        `height` with dims (y, x) in metres; y points north.

    Raises
    ------
    InvalidInput
        There is no such sample.
    UnreadableFile
        The file of a measured surface is not there, or is another one than that of its checksum.

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
    if name in MEASURED:
        return _measured(name)
    return _land_surface() if name == "jacksboro_fault_dem" else _concrete_crack()


def _measured(name: str) -> xr.DataArray:
    entry, folder = MEASURED[name], os.environ.get(FOLDER, "")
    path = Path(folder) / f"{name}.npy"
    if not folder or not path.is_file():
        expected = f"the file {path.name} in the folder that the environment variable {FOLDER} names"
        raise UnreadableFile("", [f"name: expected {expected}; made from {entry.source}"])
    checksum = file_checksum(path)
    expected = f"{path.name} with the SHA-256 {entry.sha256}"
    require_readable(checksum == entry.sha256, "name", expected, Words(checksum))
    surface = labelled_heights(np.load(path, allow_pickle=False), entry.spacing)
    source = f"{path.name}: {entry.source}"
    surface.attrs = {"title": entry.title, "source_file": source, "file_sha256": checksum}
    return surface


def _concrete_crack() -> xr.DataArray:
    surface = file_content(Request(datasets_folder() / "concrete_crack.nc"))
    surface.attrs = {"title": "Synthetic crack face of concrete", "before": surface.attrs["before"]}
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
