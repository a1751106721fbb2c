"""Dimension of the delta-surface against shear: what covering methods see, and what the spectrum sees."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.scaling import fit_line
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import check_crack, check_shear
from fractalcontact.joints._directions import one_direction
from fractalcontact.joints.crack import Crack
from fractalcontact.joints.sliding import delta_surface

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.delta_dimension"
WINDOW = (1.0, 16.0)  # cells
FLAT = "NaN where the delta-surface is flat: a plane has no exponent"
BEYOND = (
    "at scales above the shear the delta-surface is a difference quotient of the face, rougher than any "
    "fractal surface; a slope there may give more than 3, and falls to that of the face as the shear grows"
)
Array = np.ndarray[Any, np.dtype[Any]]


@accounted("not given: no interval of such a slope would be honest")
def delta_dimension(
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    direction: str | float = "E",
    window: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Return the dimension of the delta-surface against shear, by its area, its variogram and its spectrum.

    It grows with the shear or it falls, by the way it is measured. The area of the triangulated surface
    heeds how high the delta-surface is: it is 2 exactly for mated faces at no shear, grows while the heights
    grow, and levels. Variogram and spectrum heed only how heights are shared among the scales. Over lags
    longer than the shear v the delta-surface is v times a derivative of the face, with the spectrum 4
    sin^2(q.v/2) times that of the face, so that they begin near 3 or above and fall to the dimension of the
    face. Both are right; only the first says that shearing roughens a joint.

    Parameters
    ----------
    crack : Crack
        With equal spacings.
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str or float
        Direction in which the block slides.
    window : pair of float, optional
        Least and greatest scale of the fits, m: edge of the triangles, lag, or 2 pi over wavenumber. None: 1
        to 16 cells, and for the spectrum 4 to 64 cells, which hide less of the grid.

    Returns
    -------
    Dataset over shear
        covering_dimension, variogram_dimension, spectrum_dimension: slopes of straight lines through the
        logarithms, without an interval, for none would be honest; NaN with the `reason` where the
        delta-surface is flat. delta_height (m, rms) and run_time (s).

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, the spacings differ, or the window
        holds fewer than two scales.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 3.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        check_crack(crack, problems)
        towards = one_direction(direction, problems)
        shears = check_shear(shear, crack, (towards,), problems)
        if isinstance(crack, Crack):
            dy, dx = crack.layout.spacing
            problems.require(abs(dy - dx) <= UNIFORM * dx, "crack", "equal spacings along x and y", (dy, dx))
        if not problems.found:
            windows = _windows(window, dx, min(crack.block), problems)
    begun = time.perf_counter()
    planes = delta_surface(crack, shears, towards.azimuth)
    heights = np.asarray(planes.std(("y", "x")).values)
    largest = float(np.abs(np.asarray(crack.lower.values)[crack.layout.slices]).max())
    flat = heights <= 64.0 * np.finfo(float).eps * largest
    rows = [_dimensions(planes.isel(shear=i), windows, bool(flat[i])) for i in range(shears.size)]
    covering, variogram, spectrum = np.transpose(rows)
    result = xr.Dataset(
        {
            "covering_dimension": ("shear", covering),
            "variogram_dimension": ("shear", variogram),
            "spectrum_dimension": ("shear", spectrum),
            "delta_height": ("shear", heights),
            "run_time": time.perf_counter() - begun,
        },
        coords={"shear": ("shear", shears), "direction": towards.name, "azimuth": towards.azimuth},
    )
    parameters = {"crack": crack.summary(), "shear": shears, "direction": towards.name, "window": window}
    result = stamp(
        label(result), WHERE, parameters, title="dimension of the delta-surface", windows=list(windows)
    )
    for name in ("variogram_dimension", "spectrum_dimension"):
        result[name].attrs["comment"] = BEYOND
        if flat.any():
            result[name].attrs["reason"] = FLAT
    return result


Window = tuple[float, float]


def _windows(given: Any, spacing: float, edge: float, problems: Problems) -> tuple[Window, Window]:
    """Return the window of the lengths and that of the wavelengths."""
    if given is None:
        low, high = (spacing * part for part in WINDOW)
        return (low, min(high, edge / 4)), (4 * low, min(4 * high, edge))
    ends = problems.numbers("window", given, above=0)
    ascending = ends.size == 2 and ends[0] < ends[-1]
    problems.require(ascending, "window", "(least, greatest) scale in metres", given)
    found = (float(ends[0]), float(ends[-1]))
    return found, found


def _dimensions(plane: xr.DataArray, windows: tuple[Window, Window], flat: bool) -> tuple[float, ...]:
    """Return the dimensions by area, variogram and spectrum."""
    from fractalcontact import dimensions

    area = dimensions.covering(plane)
    by_area = 2.0 - _slope(area["cube_size"], area["covering_area"], windows[0])
    if flat:
        return 2.0, math.nan, math.nan
    increments = dimensions.variogram(plane, max_lag=windows[0][1])
    density = dimensions.spectrum(plane)
    by_lag = 3.0 - _slope(increments["lag"], increments["variogram"], windows[0]) / 2
    by_wave = 4.0 - _slope(density["wavelength"], density["power_spectral_density"], windows[1]) / 2
    return by_area, by_lag, by_wave


def _slope(scale: xr.DataArray, value: xr.DataArray, window: Window) -> float:
    lengths = np.asarray(scale.values, dtype=float)
    inside = (lengths >= window[0] * (1 - 1e-9)) & (lengths <= window[1] * (1 + 1e-9))
    with Problems(WHERE) as problems:
        count = int(inside.sum())
        problems.require(count > 1, "window", "at least two scales of the block", f"{count} in {window}")
    return fit_line(lengths[inside], np.asarray(value.values, dtype=float)[inside]).slope
