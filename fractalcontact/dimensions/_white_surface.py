"""White surfaces: modes divided by their expected power, in which a single wave stands out.

The cosine modes of a rough surface are nearly independent. Divided by the root of the mean of their ring of
equal wavenumber and transformed back they are a white surface, whose modes are exponential numbers without a
taper. Their mean still varies over the plane where the surface has a lay. It is that of the modes around,
shrunk to one as far as chance explains its variation w (the share that chance does not):

    R = |mode|^2 / level,   ln level = w ln(mean around),   P(R > u) = (1 + u / nu)^-nu,   1 / nu ~ w

which is the statistic of Fisher (1929) for w = 1, and the likelihood ratio of a single wave for w = 0. Each
octave of wavelength has the same share of the false alarms, so that a long wave is tested among few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.spectra import window_weights

Array = np.ndarray[Any, np.dtype[Any]]

FALSE_ALARM = 1e-3  # probability of a wave in a surface that has none
LONGEST = {1: 7.0, 2: 4.0}  # wavenumber steps: longer waves are not told from the form, by number of axes
MOST = 96  # peaks; more are those of a pattern
_PADDED = 2  # frequencies for each mode of the transform
_FIRST = 0.65  # of the limit: a wave between the frequencies of the padded transform keeps 0.66 of its power
_WIDTHS = 0.3, 0.15, 0.05  # modes between the frequencies that are compared where the largest is sought
_FIRST_RING = 3  # modes of longer waves are left out
_DEGREE = 4  # of the logarithm of the power in that of the wavenumber
_STEPS = 4  # of iterations that converge fast
# of the clipping of a ring: each pass brings its level nearer by the factor of the clip
_PASSES, _SAME_LEVEL = 8, 0.02
# mean square of the deviations of rings over their variance up to which they agree; largest that counts
_AGREE, _OUTSTANDING = 3.0, 6.0
_APART, _APART_TAPERED = 1.5, 2.5  # modes between two waves
_CORRELATED = 35.0 / 18.0  # modes along an axis for one that is independent, under a Hann taper
# times the envelope of the lobes of a wave, and its power: weaker modes wait for its removal
_LOBES, _SHADOW = 4.0, 0.02
_SHORTEST = 2.05  # spacings: the power of shorter waves is not that of a ring, for aliases and blur
_LEAST = 1e-280  # power of a mode: that of a constant is zero
_LARGEST = 600.0  # logarithm of the expected power
_EDGE = np.log(2.0)  # largest fall of the logarithm of the power between rings: a band may end inside a ring
_WIDE, _NARROW = {1: 41, 2: 13}, 5  # edges of the modes around one, by number of axes, and next to it
_CLIPPED = 12.0  # times the expected power: modes count up to here, for there may be waves among them
_CLIPPED_TAPERED = 3.0  # the same under a taper, where a wave may be a third of its ring
_SURROUNDED = 0.6  # share of the modes around one that must be there
_ROUNDING = 1e-22  # of the strongest mode
_BESIDE = np.arange(
    3, 13
)  # modes from one on either side, on the lines through it, that are compared with it
_SIDES = np.arange(-1, 2)  # lines of modes side by side
_ARC = 1.2  # radians on either side: further on is the mirror image of a mode
_DIRECTIONS = np.pi * np.arange(24) / 24
# modes on a line count up to so many times their third decile: there may be other waves, as its multiples
_DECILE, _OUTLYING = 0.3, 8.0
_ABOVE_LINE = 8.0  # least power of a wave, times the mean of the strongest line of a surface without ridges
_LINE, _RIDGE = 1.75, 3.0  # mean of the strongest line: of any surface, and of a ridge
_FREEDOM_OF_LINE = 6.0  # of the mean of its modes
_ON_RIDGES = 8  # modes of ridges that may be taken for a wave, at least
_MULTIPLE_WIDTH, _LEAST_RAY = 1.6, 2  # modes beside a multiple that it changes, and modes that must be left
# times the variance by chance: where edges correlate the modes, and where their level is not even
_BY_CHANCE, _INFLATED = 2.0, 4.0
_UNEVEN = 0.5  # share of the variation of the level from which on waves are searched under the taper alone
_ALMOST_SINGULAR = 1e-3  # of the larger singular value: cosine and sine near two spacings
_FIT_ERROR = 0.05  # of the standard error of the frequency of a wave, .55 modes over the root of its power


@dataclass(frozen=True)
class Peak:
    """A mode that may be a wave: power over the expected one, probability, cycles per point (y, x)."""

    ratio: float
    p_value: float
    cycles: Array


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

    def expected(self, power: Array, clip: float) -> Array:
        """Return the expected power of the modes: smooth in the wavenumber if the rings agree."""
        level, clipped = np.zeros(self.number.size), power
        for _ in range(_PASSES):  # single waves raise the power of their ring, unless they are clipped
            before, level = level, np.bincount(self.ring, clipped.ravel()) / self.number
            expected = self._smooth(level)
            if np.all(np.abs(level - before) <= _SAME_LEVEL * level):
                break
            clipped = np.minimum(power, clip * expected)
        return expected

    def _smooth(self, level: Array) -> Array:
        level = np.maximum(level, np.finfo(float).tiny)
        there = level[self.used] > _ROUNDING * level[self.used].max()
        count = self.count[self.used]
        logs = np.log(level[self.used])
        coefficients = self.normal @ (self.design.T @ (count * logs))
        for _ in range(_STEPS):
            excess = np.exp(np.clip(logs - self.design @ coefficients, -30.0, 3.0)) - 1.0
            coefficients = coefficients + self.normal @ (self.design.T @ (count * excess))
        excess = np.exp(np.clip(logs - self.design @ coefficients, -30.0, 30.0)) - 1.0
        # one wave is no reason to leave the polynomial, which its ring does not follow
        excess = np.minimum(excess, _OUTSTANDING / np.sqrt(count))
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


@lru_cache(maxsize=2)  # with a taper and without
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
    """A surface whose modes all have the expected power one, ring by ring.

    Attributes
    ----------
    white : ndarray, shape (ny, nx)
    factor : ndarray
        By which each mode was multiplied.
    spacing : (dy/dx, 1)
    is_periodic : bool
        Whether its own modes are those of the Fourier transform; otherwise cosine modes are whitened.
    taper : ndarray, optional
        By which the heights were multiplied: the edges of a strong wave then hide no others, and Fourier
        modes are whitened.
    """

    white: Array
    factor: Array
    spacing: tuple[float, float]
    is_periodic: bool
    taper: Array | None

    @classmethod
    def of(
        cls, heights: Array, spacing: tuple[float, float], *, is_periodic: bool, is_tapered: bool
    ) -> WhiteSurface:
        """Whiten heights without a trend; a profile has one row."""
        shape, taper = (heights.shape[0], heights.shape[1]), None
        if is_tapered:
            rows, columns = (window_weights(n, None if n == 1 else "hann") for n in shape)
            taper = rows[:, None] * columns
        is_fourier = is_periodic or is_tapered
        modes = _modes(heights if taper is None else heights * taper, is_fourier)
        power = modes.real**2 + modes.imag**2 if is_fourier else modes * modes
        rings = _rings(shape, spacing, is_fourier)
        expected = np.maximum(
            rings.expected(power, _CLIPPED_TAPERED if is_tapered else _CLIPPED),
            max(_ROUNDING * float(power.max()), _LEAST),
        )
        factor = np.sqrt(heights.size * (1.0 if is_fourier else 2.0 ** _axes(shape)) / expected)
        factor[(power <= _ROUNDING * power.max()) | (rings.ring < _FIRST_RING).reshape(power.shape)] = 0.0
        modes *= factor
        return cls(_heights(modes, shape, is_fourier), factor, spacing, is_periodic, taper)

    @property
    def _is_fourier(self) -> bool:
        return self.is_periodic or self.taper is not None

    @property
    def axes(self) -> int:
        """Number of axes."""
        return _axes(self.white.shape)

    def whiten(self, heights: Array) -> Array:
        """Return other heights, multiplied as those of the surface."""
        tapered = heights if self.taper is None else heights * self.taper
        modes = _modes(tapered, self._is_fourier) * self.factor
        return _heights(modes, heights.shape, self._is_fourier)

    def wave(self, cycles: Array) -> tuple[float, float, float]:
        """Return the amplitudes of the cosine and the sine of a wave, and its power, at fixed frequency.

        Least squares of the white surface: the shape of the wave there includes what the edges do to it.
        """
        wave = carrier(self.white.shape, cycles)
        columns = np.stack([self.whiten(part).ravel() for part in (wave.real.copy(), wave.imag.copy())])
        products = columns @ self.white.ravel()
        cosine, sine = np.linalg.pinv(columns @ columns.T, rcond=_ALMOST_SINGULAR) @ products
        return float(cosine), float(sine), 0.5 * float(cosine * products[0] + sine * products[1])

    def fitted(self, cycles: Array, ratio: float) -> tuple[Array, Array]:
        """Return the frequency of a wave of the power `ratio`, and the amplitudes of cosine and sine."""
        amplitudes = np.array(self.wave(cycles)[:2])
        for _ in range(0 if self.is_periodic else _STEPS):
            shift = self.step(cycles, amplitudes)[0]
            cycles = cycles + shift
            amplitudes = np.array(self.wave(cycles)[:2])
            if np.abs(shift * self.white.shape).max() < _FIT_ERROR * 0.55 / np.sqrt(ratio):
                break
        return cycles, amplitudes

    def power_of(self, cycles: Array, amplitudes: Array) -> float:
        """Return the power of a wave over the expected one."""
        wave = carrier(self.white.shape, cycles)
        return 0.5 * float(np.sum(self.whiten(amplitudes[0] * wave.real + amplitudes[1] * wave.imag) ** 2))

    def step(self, cycles: Array, amplitudes: Array) -> tuple[Array, Array]:
        """Return the change of frequency and the amplitudes of a Gauss-Newton step of least squares."""
        shape, wave = np.array(self.white.shape), carrier(self.white.shape, cycles)
        axes = [axis for axis in (0, 1) if shape[axis] > 1 and not self.is_periodic]
        places = np.arange(shape[0])[:, None], np.arange(shape[1])
        slope = 2.0 * np.pi * (amplitudes[1] * wave.real - amplitudes[0] * wave.imag)
        parts = [wave.real.copy(), wave.imag.copy(), *(slope * places[axis] for axis in axes)]
        columns = np.stack([self.whiten(part).ravel() for part in parts])
        # columns that vanish, as those of the sine and the frequency at two spacings, stay small
        size = np.sqrt(float(np.max(np.sum(columns[:2] ** 2, axis=1))))
        slopes = 2.0 * np.pi / 3.0**0.5 * float(np.hypot(*amplitudes)) * shape[axes]
        scale = max(size, 1e-150) * np.concatenate([np.ones(2), np.maximum(slopes, 1e-150)])
        columns /= scale[:, None]
        values = (
            np.linalg.pinv(columns @ columns.T, rcond=_ALMOST_SINGULAR)
            @ (columns @ self.white.ravel())
            / scale
        )
        shift = np.zeros(2)
        shift[axes] = values[2:]
        return np.clip(shift, -0.5 / shape, 0.5 / shape), values[:2]

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
        px = 1 if self._is_fourier else _PADDED
        return (px if self.white.shape[0] > 1 else 1), px

    def level(self) -> Level:
        """Return the level of the modes."""
        return Level.of(self.power(), self, self._search)

    @property
    def _search(self) -> Search:
        shortest = _SHORTEST if self.taper is None else 0.0
        return _search(self.white.shape, self.spacing, self._padded, LONGEST[self.axes], shortest)

    def peaks(self, related: Sequence[Array] = ()) -> list[Peak]:
        """Return the modes that stand out, the strongest first; `related`: tested among themselves."""
        power = self.power()
        search = self._search
        level = Level.of(power, self, search)
        if not self._is_fourier and level.share > _UNEVEN:
            return []  # ridges, a lay: their modes are correlated without a taper
        relative = power / level.padded(power.shape, self._padded)
        least = level.limit(np.array(search.number(np.zeros(2))), self._continuous)  # of the longest waves
        rows, columns = np.nonzero(relative > _FIRST * least)
        limits = level.limit(search.number_of_modes[rows, columns], self._continuous)
        is_above = relative[rows, columns] > _FIRST * limits
        rows, columns = rows[is_above], columns[is_above]
        places = [(int(row), int(column), 0) for row, column in zip(rows, columns, strict=True)]
        places += self._near_related(relative, related, search, level)
        strongest = max((power[place[:2]] for place in places), default=0.0)
        places = [place for place in places if power[place[:2]] > _SHADOW * strongest]
        found: list[Peak] = []
        done: list[tuple[Array, float]] = []
        ridges = max(_ON_RIDGES, len(places) // (4 if self._padded[0] > 1 else 2))
        for row, column, count in sorted(places, key=lambda place: -power[place[0], place[1]]):
            width = self._padded[1] * self.white.shape[1]
            start = np.array([(row / power.shape[0] + 0.5) % 1.0 - 0.5, column / width])
            if any(self._hides(other, ratio, start, float(power[row, column])) for other, ratio in done):
                continue
            if len(done) == MOST:
                break
            cycles, ratio = (start, float(power[row, column])) if self._is_fourier else self.refined(start)
            done.append((cycles, ratio))
            ratio /= level.at(cycles)
            p_value = level.probability(count or search.number(cycles), ratio, self._continuous)
            if p_value < FALSE_ALARM and (count or ratio > self._beside(level, cycles, ridges)):
                found.append(Peak(ratio, p_value, cycles))
        return found

    @property
    def _continuous(self) -> int:
        return 0 if self._is_fourier else self.axes

    def _near_related(
        self, relative: Array, related: Sequence[Array], search: Search, level: Level
    ) -> list[tuple[int, int, int]]:
        """Return the strongest mode next to each of some cycles, and the number of all such modes."""
        py, px = self._padded
        ny, nx = self.white.shape
        reach_y, reach_x = (py if ny > 1 else 0), px
        count = max(1, len(related) * (1 if ny == 1 else 3) * 3)
        least = _FIRST * level.limit(np.array(float(count)), self._continuous)
        result = []
        for cycles in related:
            sign = 1.0 if cycles[1] >= 0.0 else -1.0
            row, column = round(sign * cycles[0] * py * ny), round(sign * cycles[1] * px * nx)
            rows = (row + np.arange(-reach_y, reach_y + 1)) % relative.shape[0]
            columns = np.clip(column + np.arange(-reach_x, reach_x + 1), 0, relative.shape[1] - 1)
            part = relative[np.ix_(rows, columns)]
            j, i = np.unravel_index(int(np.argmax(part)), part.shape)
            if part[j, i] > least and np.isfinite(search.number_of_modes[rows[j], columns[i]]):
                result.append((int(rows[j]), int(columns[i]), count))
        return result

    def _hides(self, other: Array, ratio: float, cycles: Array, power: float) -> bool:
        """Return whether a mode is a wave that was done, or may be what this shows beside itself."""
        for distance in distances(cycles, other, self.white.shape):
            if distance.max() < (_APART if self.taper is None else _APART_TAPERED):
                return True
            lobes = np.prod(np.minimum(1.0, 1.0 / (np.pi * np.maximum(distance, 1e-9)) ** 2))
            if not self._is_fourier and power < _LOBES * ratio * lobes:
                return True
        return False

    def refined(self, start: Array, first: float = 1.0) -> tuple[Array, float]:
        """Return the cycles per point of the largest power near some, and that power.

        `first` is the largest distance from it, over that to the next mode of the padded transform.
        """
        (ny, nx), best = self.white.shape, start.copy()
        steps = np.array([-1.0, 0.0, 1.0])
        for width in (*((first * _WIDTHS[0],) if first > 1.0 else ()), *_WIDTHS):
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

    def _beside(self, level: Level, cycles: Array, ridges: int) -> float:
        """Return the power that a wave needs beside the lines of modes through it."""
        ny, nx = self.white.shape
        here = level.at(cycles)
        bound = 0.25 * float(level.modes.max())
        extent = np.array([ny * self.spacing[0] if ny > 1 else 0.0, nx * self.spacing[1]])
        return least_beside(
            lambda rows, columns: np.minimum(level.modes[rows % ny, columns % nx], bound) / here,
            cycles * (ny, nx),
            extent,
            ridges,
        )


@dataclass(frozen=True)
class Level:
    """Mean power of the modes of a white surface around each, as far as chance does not explain it.

    Attributes
    ----------
    modes, mean : ndarray, shape (ny, nx)
        Power of the modes, and the level.
    freedom : float
        Of the power over the level; infinite where the level is one.
    share : float
        Of the variation of the level that chance does not explain.
    """

    modes: Array
    mean: Array
    freedom: float
    share: float

    @classmethod
    def of(cls, power: Array, surface: WhiteSurface, search: Search) -> Level:
        """Return the level of a white surface; `power` is that of the padded transform."""
        from scipy.ndimage import uniform_filter

        (py, px), (ny, nx) = surface._padded, surface.white.shape
        right = power[::py, ::px]
        last = nx // 2
        modes = np.empty((ny, nx))  # the whole plane, which has period (ny, nx)
        modes[:, : last + 1] = right[:, : last + 1]
        modes[0, last + 1 :] = right[0, nx - last - 1 : 0 : -1]
        modes[1:, last + 1 :] = right[:0:-1, nx - last - 1 : 0 : -1]
        counts = modes > 1e-9
        sizes = [(1, edge) if ny == 1 else (edge, edge) for edge in (_WIDE[surface.axes], _NARROW)]

        def around(values: Array) -> Array:
            outer, inner = (uniform_filter(values, size, mode="wrap") * np.prod(size) for size in sizes)
            return np.asarray(outer - inner)

        most = float(np.prod(sizes[0]) - np.prod(sizes[1]))
        number = most if counts.all() else np.maximum(around(counts.astype(float)), 1.0)
        mean = uniform_filter(modes, sizes[0], mode="wrap")
        mean *= _CLIPPED
        mean = around(np.minimum(modes, mean, out=mean)) / number
        values = np.log(np.maximum(mean, 1e-12))
        values[number < _SURROUNDED * np.prod(sizes[0])] = np.inf  # beside a cut-off nothing is compared
        by_chance = (1.0 if surface.taper is None else _CORRELATED**surface.axes) / most
        inside = np.isfinite(search.number_of_modes[::py, ::px][:, : last + 1])
        tested = values[:, : last + 1][inside]
        tested = tested[np.isfinite(tested)]
        square = float(np.mean(np.square(tested))) if tested.size else 0.0
        share = max(0.0, 1.0 - _BY_CHANCE * by_chance / max(square, 1e-12))
        if surface.taper is not None:
            share = 1.0  # a strong wave may be most of its ring, which then says nothing of the level
        freedom = 1.0 / (share * by_chance * _INFLATED) if share > 0.0 else np.inf
        mean = np.where(np.isinf(values), np.inf, np.exp(share * np.minimum(values, 600.0)))
        return cls(modes, mean, freedom, share)

    def padded(self, shape: tuple[int, ...], factors: tuple[int, int]) -> Array:
        """Return the level of the modes of a padded transform."""
        rows, columns = (np.arange(n) // factor for n, factor in zip(shape, factors, strict=True))
        return np.asarray(self.mean[np.ix_(rows, columns)])

    def at(self, cycles: Array) -> float:
        """Return the level at some cycles per point."""
        row, column = np.rint(cycles * self.mean.shape).astype(np.int64) % self.mean.shape
        return float(self.mean[row, column])

    def limit(self, number: Array, continuous: int) -> Array:
        """Return the power above which the probability of one is `FALSE_ALARM`; see `probability`."""
        limit = logs = np.log(np.maximum(number / FALSE_ALARM, 30.0))
        for _ in range(_STEPS):
            logs_of_maxima = logs + 0.5 * continuous * np.log(np.pi / 3.0 * limit) if continuous else logs
            limit = logs_of_maxima
            if np.isfinite(self.freedom):
                limit = self.freedom * np.expm1(logs_of_maxima / self.freedom)
        return np.asarray(limit)

    def probability(self, number: float, ratio: float, continuous: int) -> float:
        """Return the probability that the largest of some modes is at least `ratio`.

        Along each axis of continuous frequencies there are sqrt(pi ratio / 3) times as many maxima (Rice
        1944).
        """
        tail = -ratio if np.isinf(self.freedom) else -self.freedom * np.log1p(ratio / self.freedom)
        return float(min(1.0, number * np.exp(tail) * max(1.0, np.pi / 3.0 * ratio) ** (0.5 * continuous)))


@dataclass(frozen=True)
class Search:
    """Modes that are searched.

    Attributes
    ----------
    number_of_modes : ndarray
        Places among which a wave at each mode of the padded transform is tested; infinite where none is.
    total : float
        The same at the wavenumber one; they grow as its power `axes`.
    unit : (y, x)
        Steps of the wavenumber for one cycle per point.
    axes : int
    longest : float
        Least wavenumber, in steps.
    """

    number_of_modes: Array
    total: float
    unit: tuple[float, float]
    axes: int
    longest: float

    def number(self, cycles: Array) -> float:
        """Return among how many places a wave is tested."""
        radius = float(np.hypot(cycles[0] * self.unit[0], cycles[1] * self.unit[1]))
        return self.total * max(radius, self.longest) ** self.axes


@lru_cache(maxsize=2)  # with a taper and without
def _search(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    padded: tuple[int, int],
    longest: float,
    shortest: float,
) -> Search:
    axes = _axes(shape)
    extent = min(n * d for n, d in zip(shape[-axes:], spacing[-axes:], strict=True))
    unit = extent / spacing[0], extent / spacing[1]
    (py, px), (ny, nx) = padded, shape
    y, x = np.fft.fftfreq(py * ny), np.arange(px * nx // 2 + 1) / (px * nx)
    radius = np.hypot(y[:, None] * unit[0], x * unit[1])
    inside = (radius >= longest) & (radius * shortest <= extent / max(spacing[-axes:]))
    share = np.zeros(radius.shape)
    share[inside] = radius[inside] ** -float(axes)
    share[:, 0] *= 0.5
    total = float(share.sum()) / (py * px)
    number = np.full(radius.shape, np.inf)
    number[inside] = total * radius[inside] ** axes
    return Search(number, total, unit, axes, longest)


def least_beside(modes_at: Callable[[Array, Array], Array], mode: Array, extent: Array, places: int) -> float:
    """Return the power that a wave needs, from the modes on lines through it: ridges and arcs are no waves.

    Parameters
    ----------
    modes_at : callable
        Power of the modes at rows and columns, over the mean of those around the wave.
    mode : ndarray, (row, column)
        Of the wave, with signs.
    extent : ndarray, (y, x)
        Of the surface; 0 along y of a profile.
    places : int
        Among which this is one: all modes of ridges are exponential numbers of the mean of their line.

    Notes
    -----
    The ray of a ridge that is drawn with steps is folded at two spacings, and no longer runs through the
    wavenumber zero: lines in all directions are looked at.
    """
    distance = float(np.hypot(*mode))
    along = mode / distance
    other = np.abs(_BESIDE - distance * np.maximum(np.rint(_BESIDE / distance), 1.0)) > _MULTIPLE_WIDTH
    other |= np.count_nonzero(other) < _LEAST_RAY
    both = np.concatenate([-_BESIDE, _BESIDE])
    lines = [-_BESIDE[:, None] * along, _BESIDE[other, None] * along]
    is_surface = extent[0] > 0.0
    if is_surface:
        turned = mode[::-1] * extent / extent[::-1] * (1.0, -1.0)
        angles = both / np.hypot(*turned)
        angles = angles[np.abs(angles) < _ARC, None]
        if len(angles) > len(_BESIDE):  # a shorter arc is that of a long wave
            lines.append(mode * (np.cos(angles) - 1.0) + turned * np.sin(angles))
        lines += [both[:, None] * (np.sin(angle), np.cos(angle)) for angle in _DIRECTIONS]
    mean = max(_mean_on_line(modes_at, mode, line, is_surface) for line in lines)
    above_ridge = _FREEDOM_OF_LINE * ((places / FALSE_ALARM) ** (1.0 / _FREEDOM_OF_LINE) - 1.0)
    return mean * float(np.interp(mean, (_LINE, _RIDGE), (_ABOVE_LINE, above_ridge)))


def _mean_on_line(
    modes_at: Callable[[Array, Array], Array], mode: Array, steps: Array, is_surface: bool
) -> float:
    """Return the mean power at some steps from a mode, near ones with more weight; or beside."""
    distance = np.hypot(*steps.T)[:, None]
    across = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / distance * np.sign(steps @ steps[-1])[:, None]
    sides = _SIDES if is_surface else _SIDES[1:2]
    places = np.rint(mode + steps + sides[:, None, None] * across).astype(np.int64)
    power = modes_at(places[..., 0], places[..., 1])
    low = np.partition(power, int(_DECILE * power.shape[1]), axis=1)[:, int(_DECILE * power.shape[1]), None]
    power = np.minimum(power, np.where(low > 0.0, _OUTLYING * low, np.inf))
    weights = (power > 0.0) / distance[:, 0]
    return float(((power * weights).sum(axis=1) / np.maximum(weights.sum(axis=1), 1e-9)).max())


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


def carrier(shape: tuple[int, ...], cycles: Sequence[float] | Array) -> Array:
    """Return exp(i phase) of a wave."""
    row, column = (np.exp(2j * np.pi * f * np.arange(n)) for f, n in zip(cycles, shape, strict=True))
    return np.asarray(row[:, None] * column)


def is_beside(cycles: Array, other: Array, shape: tuple[int, ...]) -> bool:
    """Return whether two waves are nearer than a mode and a half."""
    return any(distance.max() < _APART for distance in distances(cycles, other, shape))
