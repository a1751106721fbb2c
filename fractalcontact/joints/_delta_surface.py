"""The delta-surface: the difference of the facing heights once the block has slid, and its dimension.

Shifts are counted in cells, (y, x). A whole shift is a copy and exact. A fractional shift along an axis that
wraps is band-limited (Fourier) and exact for what the grid resolves. Along a free axis it is a quintic spline
through the heights, whose error for a wave of wavenumber k falls as (k * spacing)^6.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.compass import (
    Direction,
    direction_coords,
    is_single,
    read_direction,
    read_directions,
)
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.numbers import Array, float_array, is_within
from fractalcontact.base.regression import fitted_slope, rounding_of
from fractalcontact.base.resources import Plane
from fractalcontact.base.results import public_result
from fractalcontact.base.study import BORRI_BRUNETTO_1998
from fractalcontact.base.validation import Problems, Words, require
from fractalcontact.joints._crack import FILL, Block, Crack, Pair, block_coords, check_sliding

DEGREE = 5  # of the spline; 3 and 7 change the heights of a fractal face by 2 and 1 % of their greatest


def _memory(plane: Plane, arguments: Mapping[str, Any], working: float = 42.0) -> float:
    """Return the bytes of all delta-surfaces, and of the work on one of them."""
    count = np.size(arguments.get("shear", 0.0)) * np.size(arguments.get("direction", "E"))
    return (working + 8.0 * count) * plane.cells


@public_result(
    title="delta-surface of a sheared crack",
    references=BORRI_BRUNETTO_1998,
    check=check_sliding,
    memory=_memory,
)
def delta_surface(
    crack: Crack, shear: float | Sequence[float] | Array, direction: str | float | Sequence[str | float] = "E"
) -> xr.DataArray:
    """Return the difference of the facing heights after the block has slid.

    In coordinates x of the block, delta(x) = lower(x + v) - upper(x), where the block moves by v towards
    `direction`. Pressing the sheared crack together is the same as pressing this surface with a flat from
    above. A plane of slope m towards E adds m v to the delta-surface towards E and -m v towards W.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacement v >= 0, m, each once. Within 1e-6 of whole cells the shift is a copy, and exact.
        Otherwise it is band-limited where the face wraps, and a quintic spline on a free axis.
    direction : str, float, or a sequence of them
        E, NE, N, NW, W, SW, S, SE (E is +x, N is +y), or degrees anticlockwise from E.

    Returns
    -------
    DataArray `height`, shape (y, x), after (direction,) and (shear,) where sequences are given
        Metres, on the grid of the block. An axis is periodic where the block is a whole period of its face.
        The coordinate interpolation_error (m) is the rms error of the heights under the block: 0 for whole
        shifts; otherwise that of the spline half way between two points, measured on the face by leaving out
        every second height. NaN where the face has fewer than 40 points in a row.

    Raises
    ------
    InvalidInput
        The block would leave its face (the greatest travel is named), or heights are missing in its path.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 3.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> plane = fc.surfaces.from_array(0.1 * np.arange(20.0) * np.ones((20, 1)), 1.0)
    >>> crack = fc.joints.Crack(plane, young=30e9, poisson=0.2, block=10)
    >>> delta = fc.joints.delta_surface(crack, shear=[0, 4], direction="W")
    >>> delta.mean(("y", "x")).values.round(12).tolist()
    [0.0, -0.4]
    """
    directions, shears = read_directions(direction), float_array(shear)
    heights = np.empty((len(directions), shears.size, *crack.layout.cells))
    for i, towards in enumerate(directions):
        for j, v in enumerate(shears):
            heights[i, j] = delta_heights(crack, float(v), towards)
    coords: dict[str, Any] = {"shear": ("shear", shears), **block_coords(crack)}
    coords |= direction_coords(directions)
    coords["interpolation_error"] = ("direction", "shear"), interpolation_errors(crack, shears, directions)
    result = xr.DataArray(heights, dims=("direction", "shear", "y", "x"), coords=coords, name="height")
    if np.ndim(shear) == 0:
        result = result.isel(shear=0)
    if is_single(direction):
        result = result.isel(direction=0)
    return result


def delta_heights(crack: Crack, shear: float, direction: Direction) -> Array:
    """Return the heights of one delta-surface, shape (y, x) of the block."""
    lower, upper = crack.faces()
    under = heights_under(lower, crack.layout, crack.layout.shift(shear, direction.unit))
    heights = np.asarray(under - upper)
    if not np.isfinite(heights).all():
        raise missing_heights(crack, direction, shear)
    return heights


def missing_heights(crack: Crack, direction: Direction, shear: float) -> InvalidInput:
    """Return the error for heights that are missing in the path of the block."""
    under = heights_under(crack.faces()[0], crack.layout, crack.layout.shift(shear, direction.unit))
    count = int(np.count_nonzero(~np.isfinite(under)))
    expected = f"crack.lower: expected finite heights under the block ({FILL})"
    got = f"{count} missing at a shear of {shear:g} m towards {direction.name}"
    return InvalidInput("", [f"{expected}, got {got}"])


def interpolation_errors(crack: Crack, shears: Array, directions: Sequence[Direction]) -> Array:
    """Return the rms error (m) of the heights under the block, shape (direction, shear).

    Zero for whole shifts, and along axes that wrap, where a shift is exact for what the grid resolves;
    otherwise that of the spline half way between two points.
    """
    layout, face = crack.layout, crack.faces()[0]

    @functools.cache
    def between_points(axis: int) -> float:
        return spline_error(face, axis)

    def error(shear: float, direction: Direction) -> float:
        shift = layout.shift(shear, direction.unit)
        inexact = [axis for axis in (0, 1) if shift[axis] % 1.0 != 0.0 and not layout.wraps[axis]]
        return math.sqrt(sum(between_points(axis) ** 2 for axis in inexact))

    return np.array([[error(float(shear), direction) for shear in shears] for direction in directions])


def heights_under(face: Array, block: Block, shift: Pair) -> Array:
    """Return the heights of the face under the block after a shift.

    Parameters
    ----------
    face : ndarray, shape (ny, nx)
        May contain NaN; the result is NaN where such a height was needed.
    block : Block
    shift : pair of float
        Cells (y, x), inside the travel.

    Returns
    -------
    ndarray, shape block.cells
        A view of `face` where nothing had to be interpolated.
    """
    part = face
    # whole shifts first: they crop, and leave less to interpolate
    for axis in sorted((0, 1), key=lambda a: shift[a] != math.floor(shift[a])):
        part = _shift_axis(part, axis, block, shift[axis])
    return part


def _shift_axis(part: Array, axis: int, block: Block, shift: float) -> Array:
    n, size = block.face_cells[axis], block.cells[axis]
    first = block.start[axis] + math.floor(shift)
    fraction = shift - math.floor(shift)
    if fraction and block.wraps[axis]:
        part, fraction = _fourier_shift(part, axis, fraction), 0.0
    if fraction:
        return _spline_shift(part, axis, first + fraction, size)
    if 0 <= first <= n - size:
        cells = slice(first, first + size)
        return part[cells] if axis == 0 else part[:, cells]
    return np.take(part, np.arange(first, first + size) % n, axis=axis)


def _fourier_shift(part: Array, axis: int, fraction: float) -> Array:
    """Shift periodic lines by a fraction of a cell; the ambiguous Nyquist wave keeps its real part."""
    lines = np.ascontiguousarray(np.moveaxis(part, axis, -1))
    n = lines.shape[-1]
    phase = np.exp(1j * fft.wavenumbers(n, 1.0, real=True) * fraction)
    if n % 2 == 0:
        phase[-1] = phase[-1].real
    return np.moveaxis(fft.irfft(fft.rfft(lines) * phase, n), -1, axis)


def _spline_shift(part: Array, axis: int, first: float, size: int) -> Array:
    from scipy.interpolate import make_interp_spline

    low, high = math.floor(first), math.floor(first) + size  # nodes next to the ends of the block
    low, high = _spline_window(part, axis, low, high)
    nodes = np.arange(low, high + 1)
    degree = min(DEGREE, nodes.size - 1 if nodes.size % 2 == 0 else nodes.size - 2)
    values = np.take(part, nodes, axis=axis)
    spline = make_interp_spline(nodes - low, values, k=degree, axis=axis, check_finite=False)
    return np.asarray(spline(first - low + np.arange(size)))


def _spline_window(part: Array, axis: int, low: int, high: int, reach: int = 48) -> tuple[int, int]:
    """Widen the nodes low..high by the reach of the spline, but not across missing heights.

    A height further away no longer changes a quintic spline (0.43^48 = 3e-18).
    """
    n = part.shape[axis]
    missing = np.flatnonzero(~np.isfinite(part).all(axis=1 - axis))
    before, after = missing[missing < low], missing[missing > high]
    lowest = before[-1] + 1 if before.size else 0
    highest = after[0] - 1 if after.size else n - 1
    return int(max(lowest, low - reach)), int(min(highest, high + reach))


def spline_error(face: Array, axis: int, most: int = 256, shortest: int = 40) -> float:
    """Return the rms error of the spline half way between the points of a face, along one axis.

    Splines through every second and every fourth point are compared with the heights between them. The ratio
    of the two errors extrapolates to a spline through all points: it is 2^H on a self-affine face of Hurst
    exponent H, up to 2^6 on a smooth one. It is measured on `most` lines: 64 change it by .2 %, 1024 by none.
    NaN where the face has no line of the shortest number of points without gaps, of which every fourth
    leaves 10 nodes with 5 points between them that count.
    """
    lines = np.moveaxis(face, axis, -1)
    lines = lines[np.isfinite(lines).all(axis=1)]
    lines = lines[:: max(1, len(lines) // most)]
    if lines.size == 0 or lines.shape[-1] < shortest:
        return math.nan
    second, fourth = (_midpoint_error(lines, step) for step in (2, 4))
    return second * min(max(second / fourth, 2.0**-6), 1.0) if fourth > 0 else second


def _midpoint_error(lines: Array, step: int, margin: int = 2) -> float:
    """Return the rms error of a spline through every `step`-th point at the points half way between.

    So many of them are left out at either end: with 0 and 5 it changes by .3 and .02 %.
    """
    from scipy.interpolate import make_interp_spline

    nodes, middles = lines[:, ::step], lines[:, step // 2 :: step]
    spline = make_interp_spline(np.arange(nodes.shape[1]), nodes, k=DEGREE, axis=1, check_finite=False)
    inside = slice(margin, min(nodes.shape[1] - 1, middles.shape[1]) - margin)
    places = np.arange(nodes.shape[1])[inside] + 0.5
    return float(np.sqrt(np.mean((np.asarray(spline(places)) - middles[:, inside]) ** 2)))


Window = tuple[float, float]

FLAT = "NaN where the delta-surface is flat: a plane has no exponent"
DIFFERENCE_QUOTIENT = (
    "at scales above the shear the delta-surface is a difference quotient of the face, rougher than any "
    "fractal surface; a slope there may give more than 3, and falls to that of the face as the shear grows"
)


def _check_window(problems: Problems) -> None:
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
    references=BORRI_BRUNETTO_1998,
    achieved_error="not given: an interval of such a slope would have no stated coverage",
    reasons=dict.fromkeys(("variogram_dimension", "spectrum_dimension"), FLAT),
    check=_check_window,
    memory=functools.partial(_memory, working=300.0),
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
    variables = {
        "covering_dimension": ("shear", covering),
        "variogram_dimension": ("shear", variogram, {"comment": DIFFERENCE_QUOTIENT}),
        "spectrum_dimension": ("shear", spectrum, {"comment": DIFFERENCE_QUOTIENT}),
        "delta_height": ("shear", heights),
    }
    coords = {"shear": ("shear", shears), "direction": towards.name, "azimuth": towards.azimuth}
    return xr.Dataset(variables, coords, {"windows": list(windows)})


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
    inside = is_within(lengths, *window)
    count = int(inside.sum())
    require(count >= 2, "window", "at least two scales of the block", Words(f"{count} in {window}"))
    return fitted_slope(lengths[inside], np.asarray(value.values, dtype=float)[inside])
