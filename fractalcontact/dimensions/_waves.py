"""Single waves of a surface, such as machining marks: found in the spectrum, named and removed.

A mode of a Gaussian surface over the mean of its neighbours is an exponential number; a single wave stands
far above them. This is the test of Fisher (1929) with the mean of the ring of equal wavenumber, corrected by
that of the modes around, in place of the mean of all modes: the spectrum may have any form, and a lay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.results import public_result
from fractalcontact.base.spectra import window_weights
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._spectrum import without_trend
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 16  # points along an axis
FALSE_ALARM = 1e-3  # probability of a wave in a surface that has none
LARGEST_CROP = 1024  # points along an axis of the part that is searched: a wave runs through all of it
MOST = 32  # waves; more are a pattern
_LONGEST = {1: 12.0, 2: 4.0}  # wavenumber steps: longer waves are not told from the form, by number of axes
# a longer wave of a profile is found if it runs through it so often, and is so many times above the limit
_FEW_WAVES, _STRONG = 7.0, 3.0
_NEIGHBOURS, _LINE = (
    13,
    5,
)  # edges of the squares of modes around one: its neighbours, and itself with its taper
_ALONG = 41  # neighbours of a mode of a profile
_RADIAL = np.arange(
    3, 13
)  # modes from one along the ray through it that are compared with it, on either side
_ABOVE_RAY = 15.0  # times their mean: a step or ridges put much power on a ray, and no wave
_LEAST_SHARE = 1e-5  # of the mean square increment: less changes no estimate
_CLIPPED = 8.0  # times the mean: neighbours count up to here, for there may be other waves
_FREEDOM = {1: 9.0, 2: 30.0}  # independent neighbours, by the number of axes; fewer than modes, for the taper
_ROUNDS, _PASSES = 3, 3
_ROUNDING = 1e-22  # of the strongest mode
_LEFT = 0.05  # of the mean square increment, below which many waves are all there is
_NONE_LEFT = 1e-8
_NAMED = 3  # waves in a note
_MULTIPLES = 12  # of a wave that are looked for at their own places
_MULTIPLE_WIDTH, _LEAST_RAY = 2.0, 5  # modes beside a multiple that it changes, and modes that must be left
_FEW = 3
_NAMES = ("wavelength", "wave_azimuth", "wave_amplitude", "wave_p_value", "run_time", "wave")


def _check(problems: Problems, *, surface: Any) -> None:
    check_surface(problems, surface, smallest=SMALLEST, gaps=False, reserved=_NAMES)


@public_result(
    title="Single waves of a surface",
    achieved_error="at most one surface in 1000 without a wave shows one",
    references="Fisher, Proceedings of the Royal Society A 125 (1929) 54-59",
    check=_check,
    memory=88.0,
)
def waves(surface: xr.DataArray) -> xr.Dataset:
    """Find the single waves of a surface, such as marks of machining, in any direction.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for a profile, without gaps; at least 16 points along each
        axis.

    Returns
    -------
    Dataset over the leading dims and `wave`, the strongest first
        `wavelength` (m), `wave_azimuth` (degree anticlockwise from E, 0 ... 180, the direction across the
        crests), `wave_amplitude` (m, from the mean to a crest) and `wave_p_value`, the probability that a
        surface without single waves has one that stands out as much. NaN beyond the last wave.

    Raises
    ------
    InvalidInput
        Wrong axes, a surface too small, or gaps.

    Notes
    -----
    Found where the probability is below 0.001; wavelengths from two spacings to a quarter of the extent (a
    seventh of a profile). At 128 x 128 points waves of one rms increment are always found, of 0.3 in a third
    to two thirds of the surfaces, of 0.1 never. The default method of `estimate` removes what is found.
    Detection, false alarms and accuracy: page `theory_dimensions`.

    References
    ----------
    Fisher (1929), Proc. R. Soc. A 125.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ground = fc.surfaces.fbm((128, 128), 1e-5, hurst=0.7, rms_increment=1e-7, rng=1)
    >>> marks = 1e-7 * np.cos(2 * np.pi * (0.6 * ground.x + 0.8 * ground.y) / 5e-5)
    >>> result = fc.dimensions.waves(ground + marks)
    >>> print(f"{float(result.wavelength[0]):.1e} m at {float(result.wave_azimuth[0]):.0f} degrees")
    5.0e-05 m at 53 degrees
    """
    found = [find_waves(single) for single in read_surfaces(surface)]
    return _dataset(surface, found)


@dataclass(frozen=True)
class Wave:
    """One wave of a surface.

    Attributes
    ----------
    wavelength, azimuth, amplitude : float
        In m, degrees, and m.
    p_value : float
    cycles : (y, x)
        Per point.
    cosine, sine : float
        Amplitudes in the unit of the scaled heights, with the phase 0 at the first point.
    """

    wavelength: float
    azimuth: float
    amplitude: float
    p_value: float
    cycles: tuple[float, float]
    cosine: float
    sine: float


def without_waves(surface: Surface) -> tuple[Surface, str]:
    """Return a surface without its single waves, and a note that names them; itself if it has none.

    Where little is left, or the wavelengths are in geometric progression, the waves are the surface itself,
    as the terms of a Weierstrass function are.
    """
    if min(surface.grid.shape) < SMALLEST or surface.is_constant or not surface.is_complete:
        return surface, ""
    found = find_waves(surface)
    if not found:
        return surface, ""
    heights = _subtracted(surface.heights, found)
    left = _mean_square_increment(heights) / _mean_square_increment(surface.heights)
    if left < (_LEFT if len(found) > _FEW else _NONE_LEFT) or _is_progression(found):
        return surface, ""
    named = ", ".join(
        f"{wave.wavelength:.3g} m at {wave.azimuth:.0f} degrees with the amplitude {wave.amplitude:.2g} m"
        for wave in found[:_NAMED]
    )
    more = f" and {len(found) - _NAMED} weaker ones" if len(found) > _NAMED else ""
    count = f"{len(found)} single waves" if len(found) > 1 else "a single wave"
    without = Surface(surface.stack, surface.grid, surface.index, surface.unit, heights)
    return without, f"{count} removed: {named}{more}"


def _is_progression(found: Sequence[Wave]) -> bool:
    """Return whether more than a few wavelengths have one ratio from each to the next."""
    ratios = np.diff(np.log(np.sort([wave.wavelength for wave in found])))
    return len(found) > _FEW and bool(np.ptp(ratios) < 0.02 * ratios.mean())


def find_waves(surface: Surface) -> list[Wave]:
    """Return the single waves of a complete surface or profile, the strongest first.

    Waves are searched in rounds, as a strong one hides others; none if there are more than a few dozen. The
    multiples of a wave, which the cusps of a turned surface have, are few places, and stand on its ray.
    """
    heights = surface.heights
    window = tuple(
        slice((n - size) // 2, (n - size) // 2 + size)
        for n, size in ((n, min(n, LARGEST_CROP)) for n in heights.shape)
    )
    is_periodic = all(surface.grid.periodic) and max(heights.shape) <= LARGEST_CROP
    found: list[Wave] = []
    for _ in range(_ROUNDS):
        part = without_trend(heights[window], plane=not is_periodic)
        tapers = [window_weights(n, None if is_periodic or n == 1 else "hann") for n in part.shape]
        multiples = _multiples(found, part.shape, surface.axes)
        tapered = part * tapers[0][:, None] * tapers[1]
        peaks = _peaks(tapered, surface.plane_spacing, surface.axes, multiples)
        if len(found) + len(peaks) > MOST:
            return []
        new = [
            _measured(heights, cycles, p_value, surface, is_periodic=is_periodic) for cycles, p_value in peaks
        ]
        if not new:
            break
        found += new
        heights = _subtracted(heights, new)
    return sorted(found, key=lambda wave: -wave.amplitude)


def _multiples(found: Sequence[Wave], shape: tuple[int, ...], axes: int) -> Array:
    """Mark the modes at the multiples of waves, and those next to them."""
    marked = np.zeros(shape, dtype=bool)
    near = [(row, column) for row in ((0,) if axes == 1 else (-1, 0, 1)) for column in (-1, 0, 1)]
    for wave in found:
        for multiple in range(2, _MULTIPLES + 1):
            cycles = multiple * np.array(wave.cycles)
            if float(np.abs(cycles).max()) > 0.5:
                break
            for side in (-1, 1):
                place = np.rint(side * cycles * shape).astype(np.int64)
                for step in near:
                    marked[tuple((place + step) % shape)] = True
    return marked


def _peaks(
    tapered: Array, spacing: tuple[float, float], axes: int, multiples: Array
) -> list[tuple[tuple[float, float], float]]:
    """Return the cycles per point (y, x) and the p value of the modes that stand out.

    Those of `multiples` are tested among themselves, and not against the ray through them.
    """
    from scipy.ndimage import maximum_filter, uniform_filter

    ny, nx = tapered.shape
    half = fft.rfft2(tapered)
    right = half.real**2 + half.imag**2
    columns = np.arange(nx)
    mirrored = columns > nx // 2
    # the whole plane of modes, which has period (ny, nx)
    power = np.empty((ny, nx))
    power[:, ~mirrored] = right
    power[:, mirrored] = right[-np.arange(ny) % ny][:, nx - columns[mirrored]]
    y, x = np.fft.fftfreq(ny), np.fft.fftfreq(nx)
    extent = min(n * d for n, d in zip((ny, nx)[-axes:], spacing[-axes:], strict=True))
    radius = np.hypot(y[:, None] / spacing[0], x / spacing[1]) * extent
    # beyond a cut-off there is only rounding, which is no neighbour of a wave
    power[power <= _ROUNDING * power.max()] = 0.0
    white = _whitened(power, radius, axes)
    wide, narrow = ((_NEIGHBOURS, _LINE), (_ALONG, _LINE))[axes == 1]
    sizes = [(1, edge) if axes == 1 else (edge, edge) for edge in (wide, narrow)]
    clipped = np.minimum(white, _CLIPPED * uniform_filter(white, sizes[0], mode="wrap"))

    def around(values: Array) -> Array:
        outer, inner = (uniform_filter(values, size, mode="wrap") * float(np.prod(size)) for size in sizes)
        return np.asarray(outer - inner)

    number, total = around((power > 0.0).astype(float)), around(clipped)
    is_surrounded = (number > 0.1 * np.prod(sizes[0])) & (total > np.finfo(float).tiny)
    ratio = np.where(is_surrounded, white * number / np.where(is_surrounded, total, 1.0), 0.0)
    # a long wave of a profile has its mirror image among the modes around it: the shorter ones are taken,
    # whose power law is not known so well, and only a strong wave is told from it
    longer = (radius >= _FEW_WAVES) & (radius < _LONGEST[axes])
    for row, column in np.argwhere(longer & ~mirrored):
        shorter = white[row, column + _RADIAL[0] : column + _ALONG // 2]
        ratio[row, column] = white[row, column] / max(float(shorter.mean()), np.finfo(float).tiny)
    allowed = (longer | (radius >= _LONGEST[axes])) & ~mirrored
    freedom = _FREEDOM[axes]
    among = max(1, int(np.count_nonzero(multiples)))
    count = 0.5 * np.where(multiples, among, power.size)
    least = freedom * ((count / FALSE_ALARM) ** (1.0 / freedom) - 1.0)
    least = np.where(longer, _STRONG * least, least)
    places = np.argwhere(allowed & (ratio > least) & (power == maximum_filter(power, sizes[1], mode="wrap")))
    share = power * (2.0 - np.cos(2.0 * np.pi * y)[:, None] - np.cos(2.0 * np.pi * x))
    places = places[share[tuple(places.T)] > _LEAST_SHARE * share.sum()]
    on_edge = (places[:, 1] == 0) | (2 * places[:, 1] == nx)  # both signs of y are the same wave there
    places = places[~on_edge | (y[places[:, 0]] >= 0.0)]
    rays = np.stack([y[places[:, 0]] * ny, x[places[:, 1]] * nx], axis=1)
    places = places[multiples[tuple(places.T)] | _above_rays(white, places, rays)]
    return [
        (
            (float(y[row]), float(x[column])),
            float(min(1.0, count[row, column] * (1.0 + ratio[row, column] / freedom) ** -freedom)),
        )
        for row, column in places
    ]


def _whitened(power: Array, radius: Array, axes: int) -> Array:
    """Return the modes over the mean of their ring; those of a profile over a power law."""
    if axes == 1:
        return np.asarray(power * (radius / radius.max()) ** 2)
    ring = np.rint(radius).astype(np.int64).ravel()
    number = np.maximum(np.bincount(ring, (power > 0.0).ravel()), 1)
    clipped, white = power, power
    for _ in range(_PASSES):  # a wave raises the mean of its ring, unless it is clipped
        level = np.maximum(np.bincount(ring, clipped.ravel()) / number, np.finfo(float).tiny)
        expected = np.exp(np.interp(radius, np.arange(level.size), np.log(level)))
        white = power / expected
        clipped = np.minimum(white, _CLIPPED) * expected
    return np.asarray(white)


def _above_rays(white: Array, places: Array, rays: Array) -> Array:
    """Return which modes stand above both parts of the ray through them; `rays` are their mode numbers.

    The multiples of a mode, as those of cusps, are left out of its ray, unless little of it would be left.
    """
    if not len(places):
        return np.zeros(0, dtype=bool)
    peaks = white[tuple(places.T)]
    distance = np.hypot(*rays.T)[:, None]
    along = rays / distance
    beyond = np.abs(_RADIAL - distance * np.maximum(np.rint(_RADIAL / distance), 1.0)) > _MULTIPLE_WIDTH
    beyond |= np.count_nonzero(beyond, axis=1, keepdims=True) < _LEAST_RAY
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) * (min(white.shape) > 1)
    means = []
    for side in (-1, 1):
        at = places[:, None, None] + side * _RADIAL[:, None, None] * along[:, None, None]
        at = np.rint(at + np.arange(-1, 2)[:, None] * across[:, None, None]).astype(np.int64)
        ray = white[at[..., 0] % white.shape[0], at[..., 1] % white.shape[1]]
        if side > 0:
            ray = ray * beyond[:, :, None]
        number = np.maximum(np.count_nonzero(ray, axis=(1, 2)), 1)
        means.append(np.minimum(ray, 0.25 * peaks[:, None, None]).sum(axis=(1, 2)) / number)
    return np.asarray(peaks > _ABOVE_RAY * np.maximum(*means))


def _measured(
    heights: Array, cycles: tuple[float, float], p_value: float, surface: Surface, *, is_periodic: bool
) -> Wave:
    """Return the wave near a frequency: the largest tapered mode between those of the transform."""
    shape = heights.shape
    tapers = [window_weights(n, None if is_periodic or n == 1 else "hann") for n in shape]
    centred = heights - heights.mean()
    best = np.array(cycles)

    def mode(at: Array) -> complex:
        row, column = (
            taper * np.exp(-2j * np.pi * frequency * np.arange(n))
            for taper, frequency, n in zip(tapers, at, shape, strict=True)
        )
        return complex(row @ (centred @ column))

    axes = [] if is_periodic else [axis for axis in (0, 1) if shape[axis] > 1]
    crops = [min(n, LARGEST_CROP) for n in shape]
    # the peak of a tapered mode is nearly a parabola in its logarithm; first on the crop's steps
    for width in (0.5 * max(shape) / max(crops), 0.5, 0.2, 0.1, 0.05):
        for axis in axes:
            step = np.zeros(2)
            step[axis] = width / shape[axis]
            low, middle, high = (np.log(abs(mode(best + sign * step))) for sign in (-1, 0, 1))
            bend = low - 2.0 * middle + high
            shift = np.clip(0.5 * (low - high) / bend, -2.0, 2.0) if bend < 0 else np.sign(high - low)
            best = best + shift * step
    value = 2.0 * mode(best) / float(np.prod([taper.sum() for taper in tapers]))
    waves_per_metre = best / np.array(surface.spacing)
    return Wave(
        wavelength=float(1.0 / np.hypot(*waves_per_metre)),
        azimuth=float(np.degrees(np.arctan2(*waves_per_metre)) % 180.0),
        amplitude=abs(value) * surface.unit,
        p_value=p_value,
        cycles=(float(best[0]), float(best[1])),
        cosine=value.real,
        sine=-value.imag,
    )


def _subtracted(heights: Array, found: Sequence[Wave]) -> Array:
    """Return heights without some waves."""
    y, x = (np.arange(n) for n in heights.shape)
    result = heights.copy()
    for wave in found:
        row, column = (
            np.exp(2j * np.pi * frequency * place)
            for frequency, place in zip(wave.cycles, (y, x), strict=True)
        )
        row = row * complex(wave.cosine, -wave.sine)
        result -= np.outer(row.real, column.real) - np.outer(row.imag, column.imag)
    return result


def _mean_square_increment(heights: Array) -> float:
    steps = np.diff(heights, axis=1)
    return float(np.mean(steps * steps))


def _dataset(surface: xr.DataArray, found: Sequence[Sequence[Wave]]) -> xr.Dataset:
    """Return the waves of all surfaces, padded with NaN to the largest number of them."""
    axes = 2 if "y" in surface.dims else 1
    leading = surface.dims[: surface.ndim - axes]
    most = max(len(each) for each in found)
    shape = [*(surface.sizes[dim] for dim in leading), most]
    data: dict[str, Any] = {}
    for name, field in zip(_NAMES, ("wavelength", "azimuth", "amplitude", "p_value"), strict=False):
        values = np.full((len(found), most), np.nan)
        for row, each in enumerate(found):
            values[row, : len(each)] = [getattr(wave, field) for wave in each]
        data[name] = (*leading, "wave"), values.reshape(shape)
    coords: dict[str, Any] = dict(leading_coords(surface, leading, taken=(*data, "run_time")))
    return xr.Dataset(data, coords=coords | {"wave": np.arange(most)})
