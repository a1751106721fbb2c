"""Bins of the modes of a surface: which modes count, their mean power over a pilot, and its expectation.

Bins are a third of an octave wide; where aliases matter, the modes near the axes and near the diagonals
have bins of their own, because aliases and filters of the points differ there. Left out are modes whose
power is mostly that of the edges (they are correlated), or is taken by a filter but for a thousandth, and
those of single waves.

Gaps are filled, which lowers the power of short waves. Surfaces of Gaussian modes with the expected power of
a pilot get the same gaps and the same filling; the ratio of their power after and before, in bins, corrects
that of the surface. One treatment serves points, blocks, rims and lines of gaps.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.jit import kernel
from fractalcontact.base.numbers import Array
from fractalcontact.dimensions._gaussian_mixture import FORMS, Bins, Lattice, alias_logs, log_bend, weights

PER_OCTAVE = 3  # bins: within one, the information on H that is lost is 2 %
LEAST = 8  # modes in a bin: the logarithm of their mean is then nearly normal
EMPTY = 1e-14  # power over the pilot of modes that hold only rounding, as beyond the band of a synthesis
# Change of the logarithm of a pilot, times that of the correction for gaps, that needs no other one. With
# 70 % of points missing H is off by .03 to .09 (.06 to .18 after two rounds), with .015 by .02 to .08
SETTLED = 0.03
LEAST_BINS = 3  # an amplitude, an exponent, and one that can contradict them
TAPERED = 0.25  # information of a mode under sin^2 along both axes, about (18/35)^2
# Modes of a bin in a table of a first fit, and of the posterior. With the first number, and its steps of the
# spread, the power is off by 7 % (1024 x 1024 points: chi square of 235, with the second .6; for another form
# than the pilot 18, 1.6)
_SAMPLES = 64, 256
_MEDIAN_SAMPLE = 4096  # modes of which a median is taken: error of 2 %, below what waves or a lay must exceed
# Radians per point of their axis: aliases of longer waves differ by azimuth by less than 5 % for H above .1
_ALIASED = math.pi / 3.0
FALSE_ALARM = 0.01  # chance that a surface without single waves, or a lay, is corrected for them
_SECTORS = 9  # of azimuth in a quarter of the plane: an odd number, so that no sector ends at the diagonal
_OCTAVE = math.log(2.0)


def expected_power(lattice: Lattice, theta: Array, form: int, *, edges: bool = True) -> Array:
    """Return the expected power of each mode, or that part of it that is not due to the edges."""
    weight = weights(theta[0], lattice.t, form, lattice.axes, theta[1])
    rows, columns = lattice.transforms(float(theta[1]), edges=edges)[form]
    power = block_product((rows * weight[:, None]).T, columns)
    np.maximum(power, 1e-300, out=power)
    if theta[3] > 0.0:  # of aliases, too, unlike in `Bins`: there this power divides out
        power *= np.exp(log_bend(np.square(lattice.q), theta))
    power += theta[2] ** 2
    return np.asarray(power)


def block_product(left: Array, right: Array, *, edge: int = 512, work: int = 1 << 18) -> Array:
    """Return the matrix product, in blocks that BLAS leaves to one thread: more would change last digits."""
    product = np.empty((left.shape[0], right.shape[1]))
    edge = min(edge, max(1, work // (2 * len(right))))  # two rows at least
    for column in range(0, right.shape[1], edge):
        part = right[:, column : column + edge]
        rows = max(2, work // part.size)
        for row in range(0, len(left), rows):
            product[row : row + rows, column : column + edge] = left[row : row + rows] @ part
    return product


def clear_modes(
    total: Array, clean: Array, unblurred: Array, *, leak: float = 0.5, least_transfer: float = 1e-3
) -> Array:
    """Return the modes that neither the edges nor a filter dominate; see `expected_power`.

    `leak`: share of the edges from which on neighbouring modes are correlated. `least_transfer`:
    squared transfer function below which no form of a filter holds.
    """
    clear = np.empty(total.shape, dtype=bool)
    for rows in _blocks(len(total)):
        clear[rows] = clean[rows] >= (1.0 - leak) * total[rows]
        clear[rows] &= clean[rows] > least_transfer * unblurred[rows]
    return clear


def _blocks(number: int, size: int = 32) -> Iterator[slice]:
    """Yield so many rows at a time, which the cache holds."""
    for start in range(0, number, size):
        yield slice(start, start + size)


def whitened(lattice: Lattice, power: Array, pilot: Array, keep: Array) -> Array:
    """Return power over pilot, with the median of each half octave as expected of Gaussian heights."""
    classes = _classes(lattice, keep, 0.5 * _OCTAVE, math.inf)
    ratio = power / pilot
    # the last one of modes that do not count
    factor = np.append(1.0 / np.maximum(_medians(classes, ratio, lattice), 1e-300), 1.0)[classes.joined]
    for rows in _blocks(len(ratio)):  # no second array of the size of the surface
        ratio[rows] *= factor[classes.number[rows]]
    return ratio


def _medians(classes: _Classes, values: Array, lattice: Lattice) -> Array:
    """Return the median of each class, over that of the squared modes of unit power."""
    places = _sums(classes, values, lattice, _MEDIAN_SAMPLE)[2]
    return np.array([np.median(values.ravel()[chosen[chosen >= 0]]) for chosen in places]) / lattice.median


def single_waves(lattice: Lattice, ratio: Array, keep: Array) -> Array:
    """Return the modes of single waves: boxes whose mean power is improbable for Gaussian heights."""
    from scipy.special import chdtri

    size = 3**lattice.axes
    limit = float(chdtri(lattice.degrees * size, FALSE_ALARM / ratio.size)) / lattice.degrees
    marked = np.zeros(ratio.shape, dtype=bool)
    for rows in _blocks(len(ratio)):
        near = slice(max(rows.start - 1, 0), rows.stop + 1)
        level = np.where(keep[near], ratio[near], 1.0)
        level = np.pad(level, ((int(rows.start == 0), int(rows.stop >= len(ratio))), (1, 1)))
        level = level[:-2] + level[1:-1] + level[2:]
        for row, column in np.argwhere(level[:, :-2] + level[:, 1:-1] + level[:, 2:] > limit):
            row += rows.start
            marked[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = True
    return marked


@dataclass(frozen=True)
class Levels:
    """Relative power by sector of azimuth, among the waves whose aliases and filters are alike.

    Attributes
    ----------
    level, information : ndarray, shape (sectors,)
        Logarithm of the mean power over that expected, and the inverse of its variance; 0 without modes.
    lnq : ndarray
        Logarithms of the wavenumbers of the modes that were averaged, less their mean.
    rows, columns : ndarray of int
        Of these modes.
    """

    level: Array
    information: Array
    lnq: Array
    rows: Array
    columns: Array

    def slope(self, power: Array) -> float:
        """Return the slope of the logarithm of a power of all modes over that of the wavenumber."""
        square = max(float(self.lnq @ self.lnq), 1e-300)
        return float(self.lnq @ np.log(power[self.rows, self.columns])) / square

    @property
    def azimuth(self) -> Array:
        """Of the middle of each sector, radians from the x axis."""
        return np.asarray((np.arange(0.5, self.level.size) / self.level.size - 0.5) * math.pi)


def significant_share(square: float, freedom: int) -> float:
    """Return the share of levels that chance does not explain, 0 where it explains their chi square.

    The factor is that of James and Stein (1961), Proc. 4th Berkeley Symp. 1, but for the chi square of a
    chance of `FALSE_ALARM` in place of its mean: the levels of few long waves reach all short ones.
    """
    from scipy.special import chdtri

    return max(0.0, 1.0 - float(chdtri(freedom, FALSE_ALARM)) / max(square, 1e-300)) if freedom > 0 else 0.0


def lay(lattice: Lattice, levels: Levels) -> Array | float:
    """Return the relative power of the azimuth of each mode, shrunk to one as far as chance explains it.

    An anisotropic self-affine surface has a level of its own in each direction, and the same exponent.
    """
    square = float(levels.information @ np.square(levels.level))
    share = significant_share(square, int(np.count_nonzero(levels.information)) - 1)
    if share == 0.0:
        return 1.0
    y, x = lattice.wavenumbers
    return np.asarray(np.exp(share * levels.level)[_sectors(y[:, None], x)])


def levels_by_azimuth(lattice: Lattice, ratio: Array, keep: Array) -> Levels:
    """Return the levels of some modes; `ratio` is their power over that expected."""
    y, x = lattice.wavenumbers
    # aliases and filters of the points differ by azimuth among the shorter waves, and belong to the model
    by_y, by_x = (along * step for along, step in zip((y, x), lattice.spacing, strict=True))
    near_y, near_x = (np.flatnonzero(np.abs(by) < _ALIASED) for by in (by_y, by_x))
    is_near = np.hypot(by_y[near_y, None], by_x[near_x]) < _ALIASED
    rows, columns = np.nonzero(keep[np.ix_(near_y, near_x)] & is_near)
    rows, columns = near_y[rows], near_x[columns]
    sector = _sectors(y[rows], x[columns])
    count = np.bincount(sector, minlength=2 * _SECTORS)
    known = count > 0
    level, information = np.zeros(count.size), np.zeros(count.size)
    mean = np.bincount(sector, ratio[rows, columns], minlength=count.size)[known] / count[known]
    values, variance = log_means(np.maximum(mean, 1e-12), 0.5 * lattice.degrees * count[known])
    information[known] = 1.0 / variance
    level[known] = values - information[known] @ values / information.sum() if known.any() else 0.0
    lnq = np.log(np.hypot(y[rows], x[columns]))
    return Levels(level, information, lnq - lnq.sum() / max(lnq.size, 1), rows, columns)


def log_means(mean: Array, degrees: Array) -> tuple[Array, Array]:
    """Return the logarithms of mean powers, without their bias, and their variances.

    `degrees`: half the real Gaussian numbers in a mean.
    """
    from scipy.special import digamma, polygamma

    logs = np.log(mean) + np.log(degrees) - digamma(degrees)
    return np.asarray(logs), np.asarray(polygamma(1, degrees))


def _sectors(y: Array, x: Array) -> Array:
    """Return the sector of azimuth of wavenumbers: those of cosine modes are in the upper half."""
    sector = (np.arctan2(y, x) * (2.0 * _SECTORS / math.pi) + _SECTORS).astype(np.int16)
    return np.clip(sector, 0, 2 * _SECTORS - 1)


def make_bins(
    lattice: Lattice,
    power: Array,
    pilot: Array,
    keep: Array,
    *,
    information: Array | float = 1.0,
    is_tapered: bool = False,
    is_pilot: bool = False,
) -> Bins:
    """Average modes in bins, and the Gaussians of the mixture likewise.

    Parameters
    ----------
    lattice : Lattice
    power, pilot : ndarray
        Of each mode.
    keep : ndarray of bool
    information : float or ndarray
        Of a mode, over that of a mode without gaps.
    is_tapered : bool
        Modes of a tapered surface: neighbours are correlated, and bins take the median, which withstands
        marks.
    is_pilot : bool
        For a first estimate of the spectrum: with a coarser table.
    """
    classes = _bin_classes(lattice, keep, is_tapered=is_tapered)
    ratio, count = power / pilot, classes.count
    total, lnq, chosen = _sums(classes, ratio, lattice, _SAMPLES[not is_pilot])
    mean = total / count
    if is_tapered:
        mean = _medians(classes, ratio, lattice)
    share = information
    if np.ndim(information) > 0:
        share = _sums(classes, np.asarray(information), lattice, 1)[0] / count
    degrees = 0.5 * lattice.degrees * count * share * (TAPERED if is_tapered else 1.0)
    level, variance = log_means(np.maximum(mean, 1e-300), degrees)
    # expectations of an even sample of each bin
    bins, place = np.nonzero(chosen >= 0)[0], chosen[chosen >= 0]
    weight = 1.0 / (pilot.ravel()[place] * np.bincount(bins)[bins])
    rows, columns = np.divmod(place, pilot.shape[1])
    y, x = lattice.wavenumbers
    aliases = alias_logs(y[rows], x[columns], lattice.spacing[0], lattice.axes)
    ends = np.cumsum(np.bincount(bins))
    if lattice.axes == 1:
        some, columns = np.unique(columns, return_inverse=True)
        lattice = lattice.with_columns(some)
    spreads, nodes = lattice.spread_nodes(is_pilot=is_pilot)
    tables = np.zeros((FORMS, spreads.size, count.size, lattice.t.size))
    for k, spread in enumerate(spreads):
        transforms = lattice.transforms(float(spread), edges=True)
        for table, (along_y, along_x) in zip(tables, transforms, strict=True):
            by_mode = np.ascontiguousarray(along_y.T), np.ascontiguousarray(along_x.T)
            _average(weight, ends, rows, columns, *by_mode, table[k])
    return Bins(
        level=level,
        variance=variance,
        tables=tables,
        nodes=nodes,
        t=lattice.t,
        white=np.bincount(bins, weight),
        lnq=lnq / count,
        ln_alias=np.bincount(bins, aliases) / np.bincount(bins),
        extent=lattice.longest,
        finest=min(lattice.spacing[-lattice.axes :]),
        axes=lattice.axes,
    )


def bin_numbers(lattice: Lattice, keep: Array) -> Array:
    """Return the bin of each mode, -1 of those that do not count."""
    classes = _bin_classes(lattice, keep, is_tapered=False)
    return np.asarray(classes.joined[classes.number])


def _bin_classes(lattice: Lattice, keep: Array, *, is_tapered: bool) -> _Classes:
    split = math.log(_ALIASED) if lattice.axes == 2 and not is_tapered else math.inf
    return _classes(lattice, keep, _OCTAVE / PER_OCTAVE, split)


def rms_increment(heights: Array) -> float:
    """Return the rms increment over one spacing along x, or along y if there is none."""
    for axis in (1, 0):
        steps = np.diff(heights, axis=axis).ravel()
        steps = steps if np.isfinite(steps.sum()) else steps[np.isfinite(steps)]
        # not `steps @ steps`, whose last digits depend on the threads of BLAS
        square = float(np.einsum("i,i->", steps, steps))
        if square > 0.0:
            return math.sqrt(square / steps.size)
    return 1.0


class Filling:
    """Fill gaps with the mean of their surroundings, of the pyramid of 2 x 2 means.

    From coarse to fine a missing mean is interpolated from the next coarser ones, then moved to the mean of
    its four neighbours some times. The fill has no steps, whose power would be that of short waves. It
    differs from the harmonic fill by 7 % (rms) in a hole of 50 x 50 points, and by .02 % at single points.
    Gaps of a profile are filled by straight lines.

    Parameters
    ----------
    observed : ndarray of bool
    """

    def __init__(self, observed: Array) -> None:
        self.observed, weights = observed, [observed.astype(float)]
        while weights[-1].size > 1 and not weights[-1].all():
            weights.append(_halved(weights[-1]))
        self.levels = [(np.maximum(weight, 1.0), *np.nonzero(weight == 0.0)) for weight in weights]

    def __call__(self, heights: Array) -> Array:
        """Return heights without gaps."""
        if len(heights) == 1:
            places, seen = np.arange(heights.size), self.observed[0]
            return np.asarray(np.interp(places, places[seen], heights[0, seen])[None])
        return self._means(np.where(self.observed, heights, 0.0))

    def _means(self, sums: Array, level: int = 0, sweeps: int = 4) -> Array:
        """Return sums over weights; where there are none, what the sums of 2 x 2 points fill in."""
        weight, y, x = self.levels[level]
        mean = np.ascontiguousarray(sums / weight)  # `ravel` is a view
        if level + 1 == len(self.levels):
            return mean
        coarse = self._means(_halved(sums), level + 1)
        # the four nearest coarser means, with the weights of a bilinear interpolation
        sides = [((0.75, n // 2), (0.25, n // 2 + n % 2 * 2 - 1)) for n in (y, x)]
        pairs = itertools.product(*sides)
        mean[y, x] = sum(u * v * coarse.take(_places(coarse, i, j)) for (u, i), (v, j) in pairs)
        near = [_places(mean, y + i, x + j) for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1))]
        flat, missing = mean.ravel(), _places(mean, y, x)
        for _ in range(sweeps):
            flat[missing] = 0.25 * sum(flat[places] for places in near)
        return mean


def _places(values: Array, y: Array, x: Array) -> Array:
    """Return the numbers of points of an array; those beyond an edge are its points."""
    return np.ravel_multi_index((y, x), values.shape, mode="clip")


def _halved(values: Array) -> Array:
    """Return the sums of 2 x 2 points."""
    ny, nx = (n // 2 for n in values.shape)
    rows = values[::2].copy()
    rows[:ny] += values[1::2]
    sums = rows[:, ::2].copy()
    sums[:, :nx] += rows[:, 1::2]
    return sums


def filling_ratio(lattice: Lattice, pilot: Array, filling: Filling) -> Array:
    """Return the power of modes after filling over that before, for Gaussian modes of the pilot."""
    before, after = np.zeros_like(pilot), np.zeros_like(pilot)
    for modes, heights in gaussian_surfaces(lattice, pilot):
        before += modes**2
        after += lattice.power(filling(heights))
    classes = _classes(lattice, np.ones(pilot.shape, dtype=bool), _OCTAVE / PER_OCTAVE, -math.inf)
    filled, complete = (_sums(classes, power / pilot, lattice, 1)[0] for power in (after, before))
    ratio = np.divide(filled, complete, out=np.ones_like(filled), where=complete > 0.0)
    return np.asarray(np.maximum(ratio, 1e-12)[classes.joined[classes.number]])


def gaussian_surfaces(
    lattice: Lattice, pilot: Array, simulated: int = 1 << 18
) -> Iterator[tuple[Array, Array]]:
    """Yield the modes and the heights of some Gaussian surfaces of the expected power `pilot`.

    With `simulated` modes, of eight surfaces at most, a correction scatters by a fifth of the error of H.
    """
    stream = np.random.default_rng(1)
    inner = (slice(None), slice(1, None)) if lattice.axes == 1 else (slice(1, None), slice(1, None))
    axes = (1,) if lattice.axes == 1 else (0, 1)
    size = math.prod(lattice.shape[-lattice.axes :])
    for _ in range(max(1, min(8, math.ceil(simulated / pilot.size)))):
        modes = np.zeros(lattice.shape)
        modes[inner] = np.sqrt(pilot) * stream.standard_normal(pilot.shape)
        yield modes[inner], fft.dct(modes, 3, axes) / math.sqrt(2.0**lattice.axes * size)


@dataclass(frozen=True)
class _Classes:
    """Classes of modes.

    Attributes
    ----------
    number : ndarray of int
        Of each mode, -1 of those that do not count.
    joined : ndarray of int
        Class that a number is joined with; -1 for the last.
    count : ndarray, shape (classes,)
        Modes in each class.
    """

    number: Array
    joined: Array
    count: Array


def _classes(lattice: Lattice, keep: Array, width: float, split: float) -> _Classes:
    """Return the classes of modes: rings of `width` in ln q, those of few modes joined with the next.

    From ln q = `split` on, modes near a diagonal are a class of their own.
    """
    y, x = lattice.wavenumbers
    first = keep.argmax(axis=1)
    lowest = math.log(float(np.min(np.hypot(y, x[first]), where=keep.any(axis=1), initial=math.inf)))
    highest = math.log(math.hypot(np.abs(y).max(), np.abs(x).max()))
    rings = int((highest - lowest) / width) + 2
    ends = np.exp(2.0 * (lowest + width * (np.arange(1.0, rings + 1.0) - 1e-9)))
    number, counts = np.full(keep.shape, -1, dtype=np.int16), np.zeros(2 * rings)
    _classify(y, x, lattice.spacing[0], keep, ends, (split - lowest) / width, number, counts)
    joined = joined_classes(counts)
    return _Classes(number, np.append(joined, np.int16(-1)), np.bincount(joined, counts))


def joined_classes(counts: Array) -> Array:
    """Return for each class of modes the one that it is joined with: those of few modes with the next."""
    joined, total, number = np.zeros(counts.size, dtype=np.int16), 0.0, 0
    for k, modes in enumerate(counts):
        joined[k] = number
        total += modes
        if total >= LEAST:
            number, total = number + 1, 0.0
    return np.minimum(joined, max(number - 1, 0))


def _sums(classes: _Classes, values: Array, lattice: Lattice, size: int) -> tuple[Array, Array, Array]:
    """Return the sums over each class of the values and of ln q, and an even sample of its modes.

    The sample has about `size` modes of each class: their flat indices, then -1. They form a lattice: each
    row is moved by the golden section of the step against the row before.
    """
    count = classes.count
    total, lnq = np.zeros(count.size), np.zeros(count.size)
    places, filled = np.full((count.size, 2 * size), -1), np.zeros(count.size, dtype=np.int64)
    y, x = lattice.wavenumbers
    steps = np.ceil(count / size).astype(np.int64)
    _add(classes.number, classes.joined, values, y, x, steps, filled, total, lnq, places)
    return total, lnq, places


@kernel
def _classify(
    y: Array, x: Array, dy: float, keep: Array, ends: Array, split: float, number: Array, count: Array
) -> None:
    """Fill the class of each mode, and count them; x ascends. `ends` are squared wavenumbers of the rings."""
    for r in range(y.size):
        ring = 0
        for c in range(x.size):
            square = y[r] * y[r] + x[c] * x[c]
            while square >= ends[ring]:
                ring += 1
            if not keep[r, c]:
                continue
            k = 2 * ring
            if ring > split:
                a, b = abs(y[r]) * dy, abs(x[c])
                k += (a if a < b else b) > math.tan(math.pi / 8.0) * (b if a < b else a)
            number[r, c] = k
            count[k] += 1.0


@kernel
def _add(
    number: Array,
    joined: Array,
    values: Array,
    y: Array,
    x: Array,
    steps: Array,
    filled: Array,
    total: Array,
    lnq: Array,
    places: Array,
) -> None:
    """Add the values and ln q of the modes of each class; fill the sample. `filled` is zero."""
    size = places.shape[1]
    for r in range(y.size):
        for c in range(x.size):
            if number[r, c] < 0:
                continue
            k = joined[number[r, c]]
            total[k] += values[r, c]
            lnq[k] += 0.5 * math.log(y[r] * y[r] + x[c] * x[c])
            if (c + int(0.6180339887498949 * r * steps[k])) % steps[k] == 0 and filled[k] < size:
                places[k, filled[k]] = r * x.size + c
                filled[k] += 1


@kernel
def _average(
    weight: Array, ends: Array, rows: Array, columns: Array, along_y: Array, along_x: Array, table: Array
) -> None:
    """Add the weighted products of the transforms (modes, t) of each bin; table (bin, t) is zero."""
    m = 0
    for b in range(ends.size):
        sums = table[b]
        while m < ends[b]:
            # rows by themselves, whose products the compiler does several at a time: a quarter of the time
            y, x, w = along_y[rows[m]], along_x[columns[m]], weight[m]
            for j in range(sums.size):
                sums[j] += w * y[j] * x[j]
            m += 1
