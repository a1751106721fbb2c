"""Single waves of a surface, such as machining marks: named and removed.

Modes of the tapered surface are compared with the modes around them. A single wave stands out against the
modes in a box about it, and against those on every line through it: a step, or ridges, put their power on a
line. Modes of a rough surface are exponential numbers; over the mean of n others one exceeds u with the
probability (1 + u / n)^-n, the statistic of Fisher (1929). What is found is fitted, removed, and the search
repeated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import detrended
from fractalcontact.base.results import public_result
from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._surface_input import Surface, check_surface, middle_slices, read_surfaces

SMALLEST = 16  # points along an axis
LARGEST_CROP = 1024  # points along an axis of the part that is searched: a wave runs through all of it
FALSE_ALARM = 1e-3  # probability of a wave in a surface that has none
MOST = 32  # sets of marks, and searches; more are a pattern
_HIGHEST = 24  # multiple that is named with its wave
_LONGEST = {1: 7.0, 2: 4.0}  # least wavenumber tested, in steps, by number of axes: longer waves are the form
_FIRST_RING = 2  # steps: longer waves are those of the trend
_MARGIN = 12  # modes on either side of one that are compared with it
_TAPER_REACH = 2  # modes on either side that a taper correlates with one
_OF_LINE = 8.0  # independent modes of a line: with 12, waves in 9 of 80 surfaces with ridges, not in 4
_NAMES = ("wavelength", "wave_azimuth", "wave_amplitude", "wave_p_value", "run_time", "wave")


def _check(problems: Problems) -> None:
    check_surface(problems, smallest=SMALLEST, gaps=False, reserved=_NAMES)


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
    seventh of a profile). Among N points a wave is found from an amplitude of about 11 sqrt(S / N) on, S
    being the power spectral density at its wavelength over the area of a cell. At 128 x 128 points that is
    0.15 rms increments at 6 spacings, 0.45 at 12 and 2 at 24 (H = 0.5); at 256 x 256 half of it or less.
    Of more than 1024 points along an axis the middle ones are searched. Multiples of a wave that are shorter
    than two spacings are listed at their aliases. `estimate` removes what is found. Detection and its limits:
    pages `theory_dimensions` and `estimator_accuracy`.

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
    return _dataset(surface, [find_waves(single)[0] for single in read_surfaces(surface)])


@dataclass(frozen=True, eq=False)
class Wave:
    """One wave of a surface.

    Attributes
    ----------
    wavelength, azimuth, amplitude : float
        In m, degrees, and m.
    p_value : float
    cycles : ndarray, (y, x)
        Per point.
    phasor : complex
        Amplitude in the unit of the scaled heights, with the phase at the first point.
    """

    wavelength: float
    azimuth: float
    amplitude: float
    p_value: float
    cycles: Array
    phasor: complex

    @classmethod
    def of(cls, surface: Surface, cycles: Array, phasor: complex, p_value: float) -> Wave:
        """Return a wave in the units of a surface."""
        y, x = np.asarray(cycles) / np.array(surface.spacing)
        azimuth = float(np.degrees(np.arctan2(y, x)) % 180.0)
        return cls(float(1.0 / np.hypot(y, x)), azimuth, abs(phasor) * surface.unit, p_value, cycles, phasor)

    def heights(self, shape: tuple[int, ...]) -> Array:
        """Return the scaled heights of the wave."""
        row, column = (np.exp(2j * np.pi * f * np.arange(n)) for f, n in zip(self.cycles, shape, strict=True))
        row *= self.phasor
        return np.asarray(np.outer(row.real, column.real) - np.outer(row.imag, column.imag))


def without_waves(
    surface: Surface, *, few: int = 3, few_left: float = 0.05, none_left: float = 1e-8
) -> tuple[Surface, str]:
    """Return a surface without its single waves, and a note that names them; itself if it has none.

    Where little is left, or the wavelengths are in geometric progression, the waves are the surface itself,
    as the terms of a Weierstrass function are. Little are `none_left` of the mean square increment, or
    `few_left` beside more than a `few` sets of waves.
    """
    if min(surface.grid.shape) < SMALLEST or surface.is_constant or not surface.is_complete:
        return surface, ""
    found, rest = find_waves(surface)
    if not found:
        return surface, ""
    before = detrended(surface.heights, 1, [all(surface.grid.periodic)] * 2)[0]
    left = _mean_square_increment(rest) / _mean_square_increment(before)
    sets = _sets(found, surface.shape)
    if left < (few_left if len(sets) > few else none_left) or _is_progression(found, few):
        return surface, ""
    named = ", ".join(map(_name, sets[:few]))
    more = f" and {len(sets) - few} weaker ones" if len(sets) > few else ""
    count = f"{len(sets)} single waves" if len(sets) > 1 else "a single wave"
    return surface.with_heights(rest), f"{count} removed: {named}{more}"


def _name(members: Sequence[Wave]) -> str:
    first = members[0]
    others = f" and {len(members) - 1} of its multiples" if len(members) > 1 else ""
    return (
        f"{quantity_text(first.wavelength, 'm')} at {round(first.azimuth) % 180} degrees with the amplitude "
        f"{quantity_text(first.amplitude, 'm', 2)}{others}"
    )


def _is_progression(found: Sequence[Wave], few: int) -> bool:
    """Return whether more than a few wavelengths have one ratio from each to the next."""
    ratios = np.diff(np.log(np.sort([wave.wavelength for wave in found])))
    return len(found) > few and bool(np.ptp(ratios) < 0.02 * ratios.mean())


def _sets(found: Sequence[Wave], shape: tuple[int, ...]) -> list[list[Wave]]:
    """Sort waves by the one whose multiples they are, which comes first; the strongest set first."""
    left, sets = sorted(found, key=lambda wave: -wave.wavelength), []
    while left:
        multiples = np.outer(np.arange(1.0, _HIGHEST + 1.0), left[0].cycles)
        members = [wave for wave in left if _beside(wave.cycles, multiples, shape, 1.0).any()]
        left = [wave for wave in left if wave not in members]
        sets.append(members)
    return sorted(sets, key=lambda members: -max(wave.amplitude for wave in members))


def find_waves(surface: Surface) -> tuple[list[Wave], Array]:
    """Return the single waves of a complete surface or profile, the strongest first, and what else it has.

    The heights without the waves are also without their mean plane. More than a few dozen waves are none, and
    the heights are then returned as they are. Blocks of equal heights are periodic, but no waves.
    """
    shape = surface.shape
    crop = middle_slices(shape, LARGEST_CROP)
    is_part = max(shape) > LARGEST_CROP
    is_periodic = all(surface.grid.periodic) and not is_part
    part = detrended(surface.heights[crop], 1, [is_periodic] * 2)[0]
    search = _search((part.shape[0], part.shape[1]), surface.plane_spacing, is_periodic)
    peaks = [] if surface.is_enlarged else search.peaks(part)
    if not 0 < len(peaks) <= MOST * _HIGHEST:
        return [], surface.heights
    rest = detrended(surface.heights, 1, [is_periodic] * 2)[0]
    part = rest[crop]  # a view: it changes with the rest
    found: list[Wave] = []
    for _ in range(MOST):
        is_new = False
        for at, p_value in peaks:
            # what a wave has left of itself: it is fitted again
            near = _beside(at, [wave.cycles for wave in found], part.shape)
            again = [found[k] for k in np.flatnonzero(near)]
            for wave in again:
                rest += wave.heights(shape)
                found.remove(wave)
            start = again[0].cycles if again else at
            if is_part and not again:
                start = _fitted(part, start, is_periodic)[0]
            least = min([p_value, *(wave.p_value for wave in again)])
            wave = Wave.of(surface, *_fitted(rest, start, is_periodic), least)
            rest -= wave.heights(shape)
            found.append(wave)
            is_new |= not again
        if len(_sets(found, shape)) > MOST:
            return [], surface.heights
        peaks = search.peaks(part) if is_new else []
        if not peaks:
            break
    return sorted(found, key=lambda wave: -wave.amplitude), rest


def _fitted(heights: Array, start: Array, is_periodic: bool) -> tuple[Array, complex]:
    """Return cycles per point and phasor of a wave, fitted by least squares under the taper.

    The frequency is that of the largest power near `start`; of a periodic surface it is `start`.
    """
    tapers = [_taper(n, is_periodic) for n in heights.shape]

    def modes(y: Array, x: Array) -> Array:
        carrier = tapers[1][:, None] * np.exp(-2j * np.pi * np.outer(np.arange(heights.shape[1]), x))
        right = heights @ carrier.real + 1j * (heights @ carrier.imag)
        return np.asarray(tapers[0] * np.exp(-2j * np.pi * np.outer(y, np.arange(heights.shape[0]))) @ right)

    cycles = np.array(start)
    # modes between frequencies whose parabola has the largest power
    for width in () if is_periodic else (0.5, 0.2, 0.08, 0.03):
        steps = [width / n * np.arange(-1.0, 2.0) if n > 1 else np.zeros(1) for n in heights.shape]
        logs = np.log(np.abs(modes(cycles[0] + steps[0], cycles[1] + steps[1])) + 1e-300)
        middle = logs.shape[0] // 2
        for axis, line in enumerate((logs[:, 1], logs[middle])):
            if line.size == 3:
                bend = line[0] - 2.0 * line[1] + line[2]
                shift = 0.5 * (line[0] - line[2]) / bend if bend < 0.0 else np.sign(line[2] - line[0])
                cycles[axis] += float(np.clip(shift, -2.0, 2.0)) * width / heights.shape[axis]
    mode = complex(modes(cycles[:1], cycles[1:])[0, 0])
    total = math.prod(float(taper.sum()) for taper in tapers)
    double = math.prod(
        complex(taper @ np.exp(-4j * np.pi * f * np.arange(taper.size)))
        for f, taper in zip(cycles, tapers, strict=True)
    )
    # the mode is that of the wave and of its mirror image: 2 M = p S(0) + p* S(2 f); at two spacings there is
    # no sine
    both = np.array([[total, double], [double.conjugate(), total]])
    phasors = np.linalg.lstsq(both, np.array([2.0 * mode, 2.0 * mode.conjugate()]), rcond=1e-3)[0]
    return cycles, complex(phasors[0])


@dataclass(frozen=True)
class Search:
    """Search for waves among the tapered modes of one shape, on the half-plane of x wavenumbers.

    Attributes
    ----------
    tapers : (y, x)
    order, ends : ndarray of int
        Modes sorted by the ring of wavenumbers that has their level, and the end of each ring.
    log_ring, log_q : ndarray
        Logarithms of the wavenumber of each ring and of each mode, in steps.
    number : ndarray
        Modes among which each is tested: every octave of wavelength has the same share of the false alarms.
        Infinite where none is tested.
    box, gap : tuple of int
        Shape of the box of modes about one, and of its gap.
    """

    tapers: tuple[Array, Array]
    order: Array
    ends: Array
    log_ring: Array
    log_q: Array
    number: Array
    box: tuple[int, int]
    gap: tuple[int, int]

    def peaks(self, heights: Array) -> list[tuple[Array, float]]:
        """Return cycles per point and probability of modes that stand out, the strongest first."""
        from scipy.ndimage import maximum_filter

        ny, nx = heights.shape
        modes = fft.rfft2(heights * self.tapers[0][:, None] * self.tapers[1])
        power = modes.real**2 + modes.imag**2
        if not power.any():
            return []
        y, x = np.fft.fftfreq(ny), np.arange(nx // 2 + 1) / nx
        ratio = self._ratio(power)
        tail = self._tail(ratio)
        is_high = np.log(self.number / FALSE_ALARM) < tail
        rows, columns = np.nonzero(is_high)
        above = ratio[rows, columns + _MARGIN] / _line_level(ratio, rows, columns + _MARGIN)
        limit = math.log(max(1, rows.size) / FALSE_ALARM)
        is_high[rows, columns] = _OF_LINE * np.log1p(above / _OF_LINE) > limit
        is_high &= power >= maximum_filter(power, self.gap, mode=("wrap", "nearest"))
        found: list[tuple[Array, float]] = []
        for row, column in np.argwhere(is_high)[np.argsort(-power[is_high])]:
            cycles = np.array([y[row], x[column]])
            if not _beside(cycles, [other for other, _ in found], heights.shape).any():
                found.append((cycles, float(self.number[row, column] * np.exp(-tail[row, column]))))
        return found

    def _ratio(self, power: Array, rounding: float = 1e-14) -> Array:
        """Return modes over the level of their ring, with `_MARGIN` more columns on either side.

        `rounding`: of the strongest mode; the running sums of the boxes keep two digits beside it.
        """
        from scipy.ndimage import maximum_filter1d

        rings = [np.sort(ring) for ring in np.split(power.ravel()[self.order], self.ends)]
        medians = 0.5 * np.array([ring[(ring.size - 1) // 2] + ring[ring.size // 2] for ring in rings])
        logs = np.log(np.maximum(medians / math.log(2.0), rounding * float(power.max())))
        # the level falls by half from ring to ring, at most: a band may end inside a ring
        logs = np.maximum(logs, maximum_filter1d(logs, 3) - math.log(2.0))
        ratio = power / np.exp(np.interp(self.log_q, self.log_ring, logs))
        ratio[self.log_q < math.log(_FIRST_RING - 0.5)] = 1.0
        nx = self.tapers[1].size
        columns = np.arange(-_MARGIN, ratio.shape[1] + _MARGIN) % nx
        is_mirrored = columns > nx // 2
        wide = ratio[:, np.where(is_mirrored, nx - columns, columns)]
        wide[:, is_mirrored] = wide[np.ix_(-np.arange(ratio.shape[0]) % ratio.shape[0], is_mirrored)]
        return np.asarray(wide)

    def _tail(self, ratio: Array) -> Array:
        """Return minus the logarithm of the probability of each mode, from those in the box about it."""
        from scipy.ndimage import uniform_filter

        box, gap = (
            uniform_filter(ratio, size, mode=("wrap", "nearest")) * math.prod(size)
            for size in (self.box, self.gap)
        )
        around = math.prod(self.box) - math.prod(self.gap)
        # modes under a taper are correlated: so many of them are independent
        freedom = around * math.prod(float(np.mean(t**2) ** 2 / np.mean(t**4)) for t in self.tapers)
        # the level of the ring is 1 and the least: beyond the end of a band are no modes
        level = np.maximum((box - gap) / around, 1.0)
        tail = freedom * np.log1p(ratio / (level * freedom))
        return np.asarray(tail[:, _MARGIN:-_MARGIN])


@lru_cache(maxsize=2)  # of a surface and its parts
def _search(
    shape: tuple[int, int], spacing: tuple[float, float], is_periodic: bool, in_ring: int = 24
) -> Search:
    """Prepare the search: rings have `in_ring` modes at least, whose median scatters by 40 %."""
    ny, nx = shape
    axes = 1 if ny == 1 else 2
    extent = min(n * d for n, d in zip(shape[-axes:], spacing[-axes:], strict=True))
    y, x = np.fft.fftfreq(ny) * extent / spacing[0], np.arange(nx // 2 + 1) / nx * extent / spacing[1]
    q = np.hypot(y[:, None], x)
    # rings are a step wide, or wider until they have enough modes
    step = np.rint(q).astype(np.int64)
    count = np.bincount(step.ravel())
    count[:_FIRST_RING] = 0
    ring = np.where(step < _FIRST_RING, -1, (np.cumsum(count) // in_ring)[step]).ravel()
    order = np.argsort(ring, kind="stable")[np.count_nonzero(ring < 0) :]
    ends = np.flatnonzero(np.diff(ring[order])) + 1
    log_q = np.log(np.maximum(q, 1.0))
    log_ring = np.array([part.mean() for part in np.split(log_q.ravel()[order], ends)])
    is_tested = q >= _LONGEST[axes]
    share = np.where(is_tested, np.maximum(q, 1.0) ** -float(axes), 0.0)
    share[:, 0] *= 0.5  # each of these modes is there twice
    number = np.where(is_tested, share.sum() * q**axes, np.inf)
    box, gap = ((1 if axes == 1 else edge, edge) for edge in (2 * _MARGIN + 1, 2 * _TAPER_REACH + 1))
    tapers = _taper(ny, is_periodic), _taper(nx, is_periodic)
    return Search(tapers, order, ends, log_ring, log_q, number, box, gap)


def _taper(n: int, is_periodic: bool) -> Array:
    # along each axis a sine taper divides the power of a wave by 1.23, a Hann taper by 1.5
    return np.ones(n) if is_periodic or n == 1 else np.sin(np.pi * (np.arange(n) + 0.5) / n)


def _line_level(ratio: Array, rows: Array, columns: Array, outlying: float = 8.0) -> Array:
    """Return the largest mean of the modes on lines through some modes, in many directions.

    The ray of ridges that are drawn with steps is folded at two spacings, and keeps its direction. Modes of
    more than `outlying` times the median of a line count as that: they may be multiples.
    """
    ny = ratio.shape[0]
    number = 2 * _MARGIN if ny > 1 else 1  # at the ends of the lines they are 1.6 modes apart
    angles: list[Any] = [np.pi * k / number for k in range(number)]
    if ny > 1:
        angles.append(np.arctan2((rows + ny // 2) % ny - ny // 2, columns - _MARGIN)[:, None])
    level = np.ones(rows.size)
    steps = np.arange(_TAPER_REACH + 1, _MARGIN + 1)
    steps = np.r_[-steps[::-1], steps]
    for angle in angles:
        along_y, along_x = (np.rint(steps * f(angle)).astype(np.int64) for f in (np.sin, np.cos))
        modes = ratio[(rows[:, None] + along_y) % ny, columns[:, None] + along_x]
        most = outlying * np.median(modes, axis=1, keepdims=True)
        np.maximum(level, np.minimum(modes, most).mean(axis=1), out=level)
    return level


def _beside(
    cycles: Array, others: Array | list[Array], shape: tuple[int, ...], apart: float = _TAPER_REACH + 0.5
) -> Array:
    """Return for other waves whether they, as they are or reversed, are nearer than some modes to a wave."""
    both = np.multiply.outer([1.0, -1.0], np.reshape(others, (-1, 2)))
    distance = np.abs((both - cycles + 0.5) % 1.0 - 0.5) * shape
    return np.asarray(distance.max(axis=2).min(axis=0) < apart)


def _mean_square_increment(heights: Array) -> float:
    """Return the sum of the mean square increments along both axes."""
    return sum(float(np.mean(np.diff(heights, axis=k) ** 2)) for k in (0, 1) if heights.shape[k] > 1)


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
    coords = leading_coords(surface, leading, taken=(*data, "run_time"))
    return xr.Dataset(data, coords=coords | {"wave": np.arange(most)})
