"""Single waves near the limit of detection: the matched filter in the modes of a whitened surface.

The cosine modes of a rough surface are nearly independent. Divided by the root of their expected power and
transformed back they are a white surface, all of whose modes are exponential numbers of mean one, without a
taper. The power of the strongest, over all frequencies, is the likelihood ratio of a single wave. Each octave
of wavelength has the same share of the false alarms, so that a long wave is tested among few.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._wave_peaks import (
    ALONG,
    CLIPPED,
    FALSE_ALARM,
    LINE,
    NEIGHBOURS,
    ROUNDING,
    Peak,
    least_beside,
)

Array = np.ndarray[Any, np.dtype[Any]]

_PADDED = 2  # frequencies for each mode of the transform
_FIRST = 0.65  # of the limit: a wave between the frequencies of the padded transform keeps 0.66 of its power
_WIDTHS = 0.3, 0.15, 0.05  # modes between the frequencies that are compared where the largest is sought
_FIRST_RING = 3  # modes of longer waves are left out
_CLIPPED = 12.0  # times the expected power: cosine modes count up to here
_DEGREE = 4  # of the logarithm of the power in that of the wavenumber
_STEPS = 4  # of its fit
_AGREE = 3.0  # mean square of the deviations of the rings from it, over their variance
_APART = 1.5  # modes between two waves
_LOBES = 4.0  # times the envelope of what a wave shows beside itself: modes below it wait for its removal
_SHORTEST = 2.05  # spacings: the power of shorter waves is not that of a ring, for aliases and blur
_UNEVEN = 5.0  # standard deviations by which the modes may differ from exponential numbers
_FEWEST = 40  # modes of which that can be told
_ON_RIDGES = 8  # modes of ridges that may be taken for a wave
_MOST = 48  # modes above the first limit; more are those of a surface that is not white
_LEAST = 1e-280  # power of a mode: that of a constant is zero
_LARGEST = 600.0  # logarithm of the expected power
_EDGE = np.log(2.0)  # largest fall of the logarithm of the power between rings: a band may end inside a ring


@dataclass(frozen=True)
class Rings:
    """Rings of equal wavenumber of the modes of one shape.

    Attributes
    ----------
    ring : ndarray of int
        Of each mode.
    logs : ndarray
        Logarithm of the wavenumber of each mode, over that of the last ring.
    used : ndarray of int
        Rings that are fitted.
    number, count : ndarray, shape (rings,)
        Modes in each ring, and real numbers in them.
    design, normal : ndarray
        Powers of the logarithm of the wavenumber of the used rings, and the inverse of their information.
    """

    ring: Array
    logs: Array
    used: Array
    number: Array
    count: Array
    design: Array
    normal: Array

    @classmethod
    def of(cls, radius: Array, numbers: int) -> Rings:
        """Sort modes by their wavenumber in steps of the shortest extent; `numbers` are real ones a mode."""
        ring = np.rint(radius).astype(np.int64).ravel()
        number = np.bincount(ring).astype(float)
        mean = np.bincount(ring, radius.ravel()) / np.maximum(number, 1.0)
        used = np.flatnonzero((np.arange(number.size) >= _FIRST_RING) & (number > 0.0))
        largest = float(np.log(mean[used[-1]]))
        design = np.vander(np.log(mean[used]) / largest, _DEGREE + 1)
        count = number * numbers
        normal = np.linalg.pinv(design.T @ (design * count[used, None]))
        return cls(
            ring,
            np.log(np.maximum(radius, 1.0)) / largest,
            used,
            np.maximum(number, 1.0),
            count,
            design,
            normal,
        )

    def expected(self, power: Array) -> Array:
        """Return the expected power of the modes: smooth in the wavenumber if the rings agree."""
        clipped = power
        for _ in range(2):  # single waves raise the power of their ring, unless they are clipped
            expected = self._smooth(np.bincount(self.ring, clipped.ravel()) / self.number)
            clipped = np.minimum(power, _CLIPPED * expected)
        return expected

    def _smooth(self, level: Array) -> Array:
        level = np.maximum(level, np.finfo(float).tiny)
        there = level[self.used] > ROUNDING * level[self.used].max()
        count = self.count[self.used]
        logs = np.log(level[self.used])
        coefficients = self.normal @ (self.design.T @ (count * logs))
        for _ in range(_STEPS):
            excess = np.exp(np.clip(logs - self.design @ coefficients, -30.0, 3.0)) - 1.0
            coefficients = coefficients + self.normal @ (self.design.T @ (count * excess))
        excess = np.exp(np.clip(logs - self.design @ coefficients, -30.0, 30.0)) - 1.0
        if not there.all() or float(np.mean(0.5 * count * excess**2)) > _AGREE:
            beside = np.maximum(np.append(logs[1:], logs[-1]), np.append(logs[0], logs[:-1]))
            logs = np.maximum(logs, beside - _EDGE)
            return np.asarray(np.exp(np.interp(self.logs, self.design[:, -2], logs)))
        result = np.full_like(self.logs, coefficients[0])
        for coefficient in coefficients[1:]:
            result *= self.logs
            result += coefficient
        np.minimum(result, _LARGEST, out=result)  # a fit to few rings runs away in the long modes before them
        np.exp(result, out=result)
        return result


@lru_cache(maxsize=1)
def _rings(shape: tuple[int, int], spacing: tuple[float, float], is_periodic: bool) -> Rings:
    axes = _axes(shape)
    extent = min(n * d for n, d in zip(shape[-axes:], spacing[-axes:], strict=True))
    if is_periodic:
        y, x = np.fft.fftfreq(shape[0]), np.arange(shape[1] // 2 + 1) / shape[1]
    else:
        y, x = (0.5 * np.arange(n) / n for n in shape)
    return Rings.of(np.hypot(y[:, None] / spacing[0], x / spacing[1]) * extent, 2 if is_periodic else 1)


@dataclass(frozen=True)
class WhiteSurface:
    """A surface whose modes all have the expected power one.

    Attributes
    ----------
    white : ndarray, shape (ny, nx)
    factor : ndarray
        By which each mode was multiplied.
    spacing : (dy/dx, 1)
    is_periodic : bool
        Whether it has the modes of a transform without a taper, otherwise cosine modes.
    """

    white: Array
    factor: Array
    spacing: tuple[float, float]
    is_periodic: bool

    @classmethod
    def of(cls, heights: Array, spacing: tuple[float, float], *, is_periodic: bool) -> WhiteSurface:
        """Whiten heights without a trend; a profile has one row."""
        modes = _modes(heights, is_periodic)
        power = modes.real**2 + modes.imag**2 if is_periodic else modes * modes
        rings = _rings((heights.shape[0], heights.shape[1]), spacing, is_periodic)
        expected = np.maximum(rings.expected(power), max(ROUNDING * float(power.max()), _LEAST))
        factor = np.sqrt(heights.size * (1.0 if is_periodic else 2.0 ** _axes(heights.shape)) / expected)
        factor[(power <= ROUNDING * power.max()) | (rings.ring < _FIRST_RING).reshape(power.shape)] = 0.0
        modes *= factor
        return cls(_heights(modes, heights.shape, is_periodic), factor, spacing, is_periodic)

    def whiten(self, heights: Array) -> Array:
        """Return other heights, multiplied as those of the surface."""
        modes = _modes(heights, self.is_periodic) * self.factor
        return _heights(modes, heights.shape, self.is_periodic)

    def wave(self, carrier: Array) -> tuple[float, float, float]:
        """Return the amplitudes of the cosine and the sine of a wave exp(i phase), and its power.

        Least squares of the white surface: the shape of the wave there includes what the edges do to it.
        """
        columns = np.stack(
            [self.whiten(np.ascontiguousarray(part)).ravel() for part in (carrier.real, carrier.imag)]
        )
        products = columns @ self.white.ravel()
        cosine, sine = np.linalg.pinv(columns @ columns.T) @ products
        return float(cosine), float(sine), 0.5 * float(cosine * products[0] + sine * products[1])

    def power(self) -> Array:
        """Return the power of the modes of the padded transform."""
        (py, px), (ny, nx) = self._padded, self.white.shape
        plane = self.white
        if px > 1:
            plane = np.zeros((py * ny, px * nx))
            plane[:ny, :nx] = self.white
        modes = fft.rfft2(plane)
        power = modes.real**2
        power += modes.imag**2
        power /= self.white.size
        return np.asarray(power)

    @property
    def _padded(self) -> tuple[int, int]:
        px = 1 if self.is_periodic else _PADDED
        return (px if self.white.shape[0] > 1 else 1), px

    def peaks(self, longest: float, related: Sequence[Array] = ()) -> list[Peak]:
        """Return the modes that stand out, the strongest first; `related` are cycles tested among themselves.

        `longest` is the least wavenumber, in steps of the shortest extent.
        """
        power = self.power()
        search = _search(self.white.shape, self.spacing, self._padded, longest)
        rows, columns = np.nonzero(power > search.limit)
        places = [(int(row), int(column), 0) for row, column in zip(rows, columns, strict=True)]
        places += self._near_related(power, related, search)
        if not places or not self._is_white(power, search):
            return []
        found: list[Peak] = []
        done: list[tuple[Array, float]] = []
        for row, column, count in sorted(places, key=lambda place: -power[place[0], place[1]]):
            width = self._padded[1] * self.white.shape[1]
            start = np.array([(row / power.shape[0] + 0.5) % 1.0 - 0.5, column / width])
            if any(self._hides(other, ratio, start, float(power[row, column])) for other, ratio in done):
                continue
            if len(done) == _MOST:
                return []
            cycles, ratio = (start, float(power[row, column])) if self.is_periodic else self._refined(start)
            done.append((cycles, ratio))
            number = count or search.number(cycles)
            p_value = _probability(number, ratio, self._continuous)
            if p_value >= FALSE_ALARM:
                continue
            mean, least = self.around(power, cycles)
            p_value = _probability(number, ratio / max(1.0, mean), self._continuous)
            if p_value < FALSE_ALARM and (count or ratio > least):
                found.append(Peak(ratio, p_value, (float(cycles[0]), float(cycles[1]))))
        return found

    @property
    def _continuous(self) -> int:
        return 0 if self.is_periodic else _axes(self.white.shape)

    def _is_white(self, power: Array, search: Search) -> bool:
        """Return whether the modes are exponential numbers of one mean, as without lay or ridges.

        The mean of their logarithm is then 0.5772 below the logarithm of their mean, with the variance
        pi^2 / 6 - 1 over their number.
        """
        (py, px), inside = self._padded, np.isfinite(search.limit)
        inside[:, 0] = False
        modes = power[::py, ::px][inside[::py, ::px]]
        modes = np.minimum(modes[modes > 0.0], CLIPPED)
        if modes.size < _FEWEST:
            return False
        flatness = float(np.log(modes).mean() - np.log(modes.mean())) + np.euler_gamma
        return bool(flatness > -_UNEVEN * np.sqrt((np.pi**2 / 6.0 - 1.0) / modes.size))

    def _near_related(
        self, power: Array, related: Sequence[Array], search: Search
    ) -> list[tuple[int, int, int]]:
        """Return the strongest mode next to each of some cycles, and the number of all such modes."""
        py, px = self._padded
        ny, nx = self.white.shape
        reach_y, reach_x = (py if ny > 1 else 0), px
        count = max(1, len(related) * (1 if ny == 1 else 3) * 3)
        least = _FIRST * _limit(np.array(float(count)), self._continuous)
        result = []
        for cycles in related:
            sign = 1.0 if cycles[1] >= 0.0 else -1.0
            row, column = round(sign * cycles[0] * py * ny), round(sign * cycles[1] * px * nx)
            rows = (row + np.arange(-reach_y, reach_y + 1)) % power.shape[0]
            columns = np.clip(column + np.arange(-reach_x, reach_x + 1), 0, power.shape[1] - 1)
            part = power[np.ix_(rows, columns)]
            j, i = np.unravel_index(int(np.argmax(part)), part.shape)
            if part[j, i] > least and np.isfinite(search.limit[rows[j], columns[i]]):
                result.append((int(rows[j]), int(columns[i]), count))
        return result

    def _hides(self, other: Array, ratio: float, cycles: Array, power: float) -> bool:
        """Return whether a mode is a wave that was done, or may be what this shows beside itself."""
        for distance in distances(cycles, other, self.white.shape):
            if distance.max() < _APART:
                return True
            lobes = np.prod(np.minimum(1.0, 1.0 / (np.pi * np.maximum(distance, 1e-9)) ** 2))
            if not self.is_periodic and power < _LOBES * ratio * lobes:
                return True
        return False

    def _refined(self, start: Array) -> tuple[Array, float]:
        """Return the cycles per point of the largest power near some, and that power."""
        (ny, nx), best = self.white.shape, start.copy()
        steps = np.array([-1.0, 0.0, 1.0])
        for width in _WIDTHS:
            y = best[0] + (steps if ny > 1 else np.zeros(1)) * width / ny
            p = self._power_at(y, best[1] + steps * width / nx)
            middle = len(y) // 2
            for axis, line in enumerate((p[:, 1], p[middle])):
                if line.size == 3:
                    bend = line[0] - 2.0 * line[1] + line[2]
                    shift = 0.5 * (line[0] - line[2]) / bend if bend < 0.0 else np.sign(line[2] - line[0])
                    best[axis] += np.clip(shift, -2.0, 2.0) * width / self.white.shape[axis]
        return best, float(self._power_at(best[:1], best[1:])[0, 0])

    def _power_at(self, y: Array, x: Array) -> Array:
        ny, nx = self.white.shape
        angle = 2.0 * np.pi * np.outer(np.arange(nx), x)
        right = self.white @ np.cos(angle) - 1j * (self.white @ np.sin(angle))
        modes = np.exp(-2j * np.pi * np.outer(y, np.arange(ny))) @ right
        return np.asarray((modes.real**2 + modes.imag**2) / self.white.size)

    def around(self, power: Array, cycles: Array) -> tuple[float, float]:
        """Return the mean power of the modes around one, and the power that a wave needs there."""
        (py, px), (ny, nx) = self._padded, self.white.shape
        modes = power[::py, ::px]
        centre = np.rint(cycles * (ny, nx)).astype(np.int64)

        def at(rows: Array, columns: Array) -> Array:
            rows, columns = np.broadcast_arrays(rows % ny, columns % nx)
            mirrored = columns > nx // 2
            return np.asarray(
                modes[np.where(mirrored, -rows % ny, rows), np.where(mirrored, nx - columns, columns)]
            )

        wide, narrow = (NEIGHBOURS if ny > 1 else ALONG), LINE
        reach = np.arange(-(wide // 2), wide // 2 + 1)
        rows, columns = (reach if ny > 1 else np.zeros(1, dtype=np.int64))[:, None], reach
        outside = (np.abs(rows) > narrow // 2) | (np.abs(columns) > narrow // 2)
        values = at(centre[0] + rows, centre[1] + columns)[outside]
        values = values[values > 0.0]
        mean = float(np.minimum(values, CLIPPED * values.mean()).mean()) if values.size else 1.0
        bound = 0.5 * power.max()
        least = least_beside(
            lambda rows, columns: np.minimum(at(rows, columns), bound),
            cycles * (ny, nx),
            np.array([ny * self.spacing[0] if ny > 1 else 0.0, nx * self.spacing[1]]),
            _ON_RIDGES,
            anywhere=False,
        )
        return mean, least


@dataclass(frozen=True)
class Search:
    """Modes that are searched.

    Attributes
    ----------
    limit : ndarray
        Power above which a mode of the padded transform is looked at closely; infinite where none is.
    total : float
        Places among which a wave of the wavenumber one would be tested; they grow as its power `axes`.
    unit : (y, x)
        Steps of the wavenumber for one cycle per point.
    axes : int
    longest : float
        Least wavenumber, in steps.
    """

    limit: Array
    total: float
    unit: tuple[float, float]
    axes: int
    longest: float

    def number(self, cycles: Array) -> float:
        """Return among how many places a wave is tested."""
        radius = float(np.hypot(cycles[0] * self.unit[0], cycles[1] * self.unit[1]))
        return self.total * max(radius, self.longest) ** self.axes


@lru_cache(maxsize=1)
def _search(
    shape: tuple[int, int], spacing: tuple[float, float], padded: tuple[int, int], longest: float
) -> Search:
    axes = _axes(shape)
    extent = min(n * d for n, d in zip(shape[-axes:], spacing[-axes:], strict=True))
    unit = extent / spacing[0], extent / spacing[1]
    (py, px), (ny, nx) = padded, shape
    y, x = np.fft.fftfreq(py * ny), np.arange(px * nx // 2 + 1) / (px * nx)
    radius = np.hypot(y[:, None] * unit[0], x * unit[1])
    inside = (radius >= longest) & (radius <= extent / (_SHORTEST * max(spacing[-axes:])))
    share = np.zeros(radius.shape)
    share[inside] = radius[inside] ** -float(axes)
    share[:, 0] *= 0.5
    total = float(share.sum()) / (py * px)
    limit = np.full(radius.shape, np.inf)
    limit[inside] = _FIRST * _limit(total * radius[inside] ** axes, axes if px > 1 else 0)
    return Search(limit, total, unit, axes, longest)


def _limit(number: Array, continuous: int) -> Array:
    """Return the power above which the probability of one is `FALSE_ALARM`; see `_probability`."""
    logs = np.log(np.maximum(number / FALSE_ALARM, 30.0))
    limit = logs
    for _ in range(_STEPS):
        limit = logs + 0.5 * continuous * np.log(np.pi / 3.0 * limit)
    return np.asarray(limit)


def _probability(number: float, ratio: float, continuous: int) -> float:
    """Return the probability that the largest of some exponential numbers is at least `ratio`.

    Along each axis of continuous frequencies there are sqrt(pi ratio / 3) times as many maxima (Rice 1944).
    """
    return float(min(1.0, number * np.exp(-ratio) * max(1.0, np.pi / 3.0 * ratio) ** (0.5 * continuous)))


def distances(cycles: Array, other: Array, shape: tuple[int, ...]) -> Iterator[Array]:
    """Yield the distance of two waves in modes along (y, x), as they are and with one of them reversed."""
    for sign in (1.0, -1.0):
        yield np.abs((sign * other - cycles + 0.5) % 1.0 - 0.5) * shape


def _axes(shape: tuple[int, ...]) -> int:
    return 1 if shape[0] == 1 else 2


def _modes(heights: Array, is_periodic: bool) -> Array:
    return fft.rfft2(heights) if is_periodic else fft.dct(heights, 2, (-2, -1)[2 - _axes(heights.shape) :])


def _heights(modes: Array, shape: tuple[int, ...], is_periodic: bool) -> Array:
    if is_periodic:
        return fft.irfft2(modes, (shape[0], shape[1]))
    axes = _axes(shape)
    result = fft.dct(modes, 3, (-2, -1)[2 - axes :])
    result /= 2.0**axes * shape[0] * shape[1]
    return result
