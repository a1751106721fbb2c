"""Dimension of the delta-surface against shear, by its area, its variogram and its spectrum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import read_direction
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.regression import fit_line, rounding_of
from fractalcontact.base.results import public_result
from fractalcontact.base.study import PAPER
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Crack, check_sliding
from fractalcontact.joints._delta_surface import delta_surface

Window = tuple[float, float]

WHERE = "fractalcontact.joints.delta_dimension"

FLAT = "NaN where the delta-surface is flat: a plane has no exponent"
DIFFERENCE_QUOTIENT = (
    "at scales above the shear the delta-surface is a difference quotient of the face, rougher than any "
    "fractal surface; a slope there may give more than 3, and falls to that of the face as the shear grows"
)


def _check(problems: Problems) -> None:
    given = problems.given
    check_sliding(problems, single=True)
    if problems.numbers("window", above=0, optional=True) and given.window is not None:
        ends = float_array(given.window)
        ascending = ends.size == 2 and ends[0] < ends[-1]
        problems.require(ascending, "window", "(least, greatest) scale in metres")
    if isinstance(given.crack, Crack):
        dy, dx = given.crack.layout.spacing
        problems.require(abs(dy - dx) <= UNIFORM * dx, "crack", "equal spacings along x and y", (dy, dx))


@public_result(
    title="dimension of the delta-surface",
    references=PAPER,
    achieved_error="not given: an interval of such a slope would have no stated coverage",
    reasons=dict.fromkeys(("variogram_dimension", "spectrum_dimension"), FLAT),
    check=_check,
)
def delta_dimension(
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    direction: str | float = "E",
    window: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Return the dimension of the delta-surface against shear, by its area, variogram and spectrum.

    The three methods disagree. By the area of the triangulated surface the dimension starts at exactly 2 for
    mated faces, grows while the heights grow, and levels. By variogram and spectrum it starts near 3 or
    above and falls to the dimension of the face. Only the first indicates that shearing roughens a joint.

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
        to 16 cells, and for the spectrum 4 to 64 cells, which are less affected by the grid.

    Returns
    -------
    Dataset over shear
        covering_dimension, variogram_dimension, spectrum_dimension: slopes of straight lines through the
        logarithms, without an interval; NaN with the `reason` where the delta-surface is flat. delta_height
        (m, rms) and run_time (s).

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, the spacings differ, or the window
        holds fewer than two scales.

    Notes
    -----
    The area depends on how high the delta-surface is. Variogram and spectrum depend only on the distribution
    of the heights over the scales: at scales longer than the shear v the delta-surface is v times a
    derivative of the face, and its spectrum is 4 sin^2(q.v/2) times that of the face.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.spectral((128, 128), 1e-4, hurst=0.8, rms_slope=1.0, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2)
    >>> result = fc.joints.delta_dimension(crack, shear=[0, 1e-4, 4e-4])
    >>> result.covering_dimension.values.round(2).tolist()
    [2.0, 2.07, 2.13]
    """
    towards, shears = read_direction(direction), float_array(shear)
    windows = _windows(window, crack.layout.spacing[1], min(crack.block))
    deltas = delta_surface(crack, shears, towards.azimuth)
    heights = np.asarray(deltas.std(("y", "x")).values)
    flat = heights <= rounding_of(np.asarray(crack.lower.values)[crack.layout.slices])
    rows = [_dimensions(deltas.isel(shear=i), windows, bool(flat[i])) for i in range(shears.size)]
    covering, variogram, spectrum = np.transpose(rows)
    result = xr.Dataset(
        {
            "covering_dimension": ("shear", covering),
            "variogram_dimension": ("shear", variogram),
            "spectrum_dimension": ("shear", spectrum),
            "delta_height": ("shear", heights),
        },
        coords={"shear": ("shear", shears), "direction": towards.name, "azimuth": towards.azimuth},
        attrs={"windows": list(windows)},
    )
    for name in ("variogram_dimension", "spectrum_dimension"):
        result[name].attrs["comment"] = DIFFERENCE_QUOTIENT
    return result


def _windows(
    window: Any,
    spacing: float,
    edge: float,
    cells: Window = (1.0, 16.0),  # 8 for 16 and 2 for 1 change the dimensions by up to 5 and 7 %
) -> tuple[Window, Window]:
    """Return the window of lengths and that of wavelengths, m."""
    if window is None:
        low, high = (spacing * number for number in cells)
        return (low, min(high, edge / 4)), (4 * low, min(4 * high, edge))
    ends = float_array(window)
    return (float(ends[0]), float(ends[1])), (float(ends[0]), float(ends[1]))


def _dimensions(delta: xr.DataArray, windows: tuple[Window, Window], flat: bool) -> tuple[float, ...]:
    """Return the dimensions by area, variogram and spectrum."""
    from fractalcontact import dimensions

    area = dimensions.covering(delta)
    by_area = 2.0 - _slope(area["cube_size"], area["covering_area"], windows[0])
    if flat:
        return 2.0, math.nan, math.nan
    increments = dimensions.variogram(delta, max_lag=windows[0][1])
    density = dimensions.spectrum(delta)
    by_lag = 3.0 - _slope(increments["lag"], increments["variogram"], windows[0]) / 2
    by_wavelength = 4.0 - _slope(density["wavelength"], density["power_spectral_density"], windows[1]) / 2
    return by_area, by_lag, by_wavelength


def _slope(scale: xr.DataArray, value: xr.DataArray, window: Window) -> float:
    """Return the slope of a straight line through the logarithms inside the window."""
    lengths = np.asarray(scale.values, dtype=float)
    inside = (lengths >= window[0] * (1 - 1e-9)) & (lengths <= window[1] * (1 + 1e-9))
    count = int(inside.sum())
    if count < 2:
        raise InvalidInput(
            WHERE, [f"window: expected at least two scales of the block, got {count} in {window}"]
        )
    return fit_line(lengths[inside], np.asarray(value.values, dtype=float)[inside]).slope
