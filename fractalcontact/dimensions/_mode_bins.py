"""Bins of the modes of a surface: which modes count, their mean power over a pilot, and its expectation.

Bins are a third of an octave wide; where aliases matter, the modes near the axes and near the diagonals
have bins of their own, because aliases and filters of the points differ there. Left out are modes whose
power is mostly that of the edges (they are correlated), or is taken by a filter but for a thousandth, and
those of single waves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel
from fractalcontact.dimensions._gaussian_mixture import FORMS, Bins, Lattice, spread_nodes, weights
from fractalcontact.dimensions._spectral_posterior import tail

Array = np.ndarray[Any, np.dtype[Any]]

PER_OCTAVE = 3  # bins: within one, the information on H that is lost is 2 %
LEAST = 8  # modes in a bin: the logarithm of their mean is then nearly normal
TAPERED = 0.25  # information of a mode under sin^2 along both axes, about (18/35)^2
_SAMPLE = 64  # modes of a bin over which an expectation is averaged: error below that of the pilot, .1 %
_MEDIAN_SAMPLE = 4096  # modes of which a median is taken: error of 2 %, below what waves or a lay must exceed
_LEAK = 0.5  # share of the edges in the expected power from which on neighbouring modes are correlated
_TAIL = 1e-3  # squared transfer function below which no form of a filter holds
_ALIASED = 0.25 * math.pi  # radians per point from which on aliases differ by azimuth by a per mille
_ISOTROPIC = math.pi / 3.0  # radians per point up to which they differ by less than 5 % for H above .1
_FALSE_ALARM = 0.01  # chance that a surface without single waves, or a lay, is corrected for them
_SECTORS = 9  # of azimuth, on a quarter of the plane; an odd number, so that no sector ends at the diagonal
_STRETCH = math.log(8.0)  # largest stretch that is looked for
_STRETCHES = 121  # steps of 3.5 %; in 128 x 128 points a stretch of 2 scatters by 5 %
_OCTAVE = math.log(2.0)


def expected_power(lattice: Lattice, theta: Array, form: int) -> tuple[Array, Array]:
    """Return the expected power of each mode, and that part of it that is not due to the edges."""
    weight = weights(theta[0], lattice.t)
    weight[-1] *= tail(theta[0], lattice.t[-1], theta[1], form, lattice.axes)
    powers = []
    for edges in (True, False):
        rows, columns = lattice.transforms(float(theta[1]), edges=edges)[form]
        power = (rows * weight[:, None]).T @ columns
        np.maximum(power, 1e-300, out=power)
        powers.append(power)
    if theta[3] > 0.0:
        corner = 2.0 * theta[5] * np.log(theta[3] / lattice.q)
        bend = np.exp((theta[4] - theta[0]) / theta[5] * np.logaddexp(0.0, corner))
        for power in powers:
            power *= bend
    for power in powers:
        power += theta[2] ** 2
    return powers[0], powers[1]


def clear_modes(total: Array, clean: Array, unblurred: Array) -> Array:
    """Return the modes that neither the edges nor a filter dominate; see `expected_power`."""
    return np.asarray((clean >= (1.0 - _LEAK) * total) & (clean > _TAIL * unblurred))


def whitened(lattice: Lattice, power: Array, pilot: Array, keep: Array) -> Array:
    """Return power over pilot, with the median of each half octave as expected of Gaussian heights."""
    number, count = _joined(*_classes(lattice, keep, 0.5 * _OCTAVE, math.inf))
    ratio = power / pilot
    factor = np.ones(count.size + 1)  # the last one of modes that do not count
    for octave, places in enumerate(_Sums(number, count, ratio, lattice, _MEDIAN_SAMPLE).places):
        values = ratio.ravel()[places[places >= 0]]
        factor[octave] = lattice.median / max(float(np.median(values)), 1e-300)
    for row, octaves in zip(ratio, number, strict=True):  # no second array of the size of the surface
        row *= factor[octaves]
    return ratio


def single_waves(lattice: Lattice, ratio: Array, keep: Array) -> Array:
    """Return the modes of single waves: boxes whose mean power is improbable for Gaussian heights."""
    from scipy.ndimage import maximum_filter, uniform_filter
    from scipy.special import chdtri

    size = (1, 3) if lattice.axes == 1 else (3, 3)
    degrees = lattice.degrees * math.prod(size)
    limit = float(chdtri(degrees, _FALSE_ALARM / ratio.size)) / degrees
    marked = np.zeros(ratio.shape, dtype=bool)
    for _ in range(3):  # what is left out no longer lifts its neighbours
        level = np.where(keep & ~marked, ratio, 1.0)
        found = uniform_filter(level, size, mode="constant") > limit
        if not (found & keep & ~marked).any():
            break
        marked |= maximum_filter(found, size)
    return marked


@dataclass(frozen=True)
class Levels:
    """Relative power by sector of azimuth, among the waves whose aliases and filters are alike.

    Attributes
    ----------
    sector : ndarray of int
        Of each mode.
    level, information : ndarray, shape (sectors,)
        Logarithm of the mean power over that expected, and the inverse of its variance; 0 without modes.
    keep : ndarray of bool
        Modes that were averaged.
    """

    sector: Array
    level: Array
    information: Array
    keep: Array


def stretch(lattice: Lattice, levels: Levels, unblurred: Array, *, information: float = 1.0) -> float:
    """Return the stretch of the lattice, as the levels by azimuth show it.

    The power of waves of one length is (cos^2 + sin^2 / a^2)^(k / 2) of their azimuth, where `unblurred`, the
    expected power without a blur, has the slope k. The stretch a, even in its logarithm, has the least chi
    square. The logarithm is shrunk as in `lay`. `information`: of a mode.
    """
    from scipy.special import chdtri

    level, weight = levels.level, levels.information
    if np.count_nonzero(weight) < 3:  # a profile has one
        return 1.0
    lnq = np.log(lattice.q[levels.keep])
    lnq -= lnq.mean()
    slope = lnq @ np.log(unblurred[levels.keep]) / (lnq @ lnq)
    azimuth = 0.5 * math.pi / _SECTORS * (np.arange(_SECTORS) + 0.5)
    logarithms = np.r_[np.linspace(-_STRETCH, _STRETCH, _STRETCHES), math.log(lattice.stretch)]
    squares = np.cos(azimuth) ** 2 + np.sin(azimuth) ** 2 * np.exp(-2.0 * logarithms[:, None])
    residual = level - 0.5 * slope * np.log(squares[:-1] / squares[-1])
    residual -= (residual @ weight / weight.sum())[:, None]
    square = np.square(residual) @ weight * information
    best = int(np.argmin(square))
    gain = float(square[_STRETCHES // 2] - square[best])
    by_chance = float(chdtri(1, _FALSE_ALARM))
    return math.exp(logarithms[best] * (1.0 - by_chance / gain)) if gain > by_chance else 1.0


def lay(levels: Levels) -> Array:
    """Return the relative power of the azimuth of each mode, shrunk to one as far as chance explains it.

    An anisotropic self-affine surface has a level of its own in each direction, and the same exponent. The
    factor is that of James and Stein (1961), Proc. 4th Berkeley Symp. 1, but for the chi square of a chance
    of `_FALSE_ALARM` in place of its mean: the levels of few long waves reach all short ones.
    """
    from scipy.special import chdtri

    square = float(levels.information @ np.square(levels.level))
    freedom = np.count_nonzero(levels.information) - 1
    by_chance = float(chdtri(freedom, _FALSE_ALARM)) if freedom > 0 else math.inf
    shrunk = 1.0 - by_chance / square if square > by_chance else 0.0
    return np.asarray(np.exp(shrunk * levels.level)[levels.sector])


def levels_by_azimuth(lattice: Lattice, ratio: Array, keep: Array) -> Levels:
    """Return the levels of some modes; `ratio` is their power over that expected."""
    from scipy.special import digamma, polygamma

    y, x = lattice.wavenumbers
    scale = 2.0 * _SECTORS / math.pi
    sector = np.minimum((np.arctan2(np.abs(y)[:, None], np.abs(x)) * scale).astype(np.int16), _SECTORS - 1)
    # aliases and filters of the points differ by azimuth among the shorter waves, and belong to the model
    keep = keep & (lattice.q * max(lattice.spacing) < _ISOTROPIC)
    count = np.bincount(sector[keep], minlength=_SECTORS)
    known = count > 0
    degrees = 0.5 * lattice.degrees * count[known]
    level, information = np.zeros(_SECTORS), np.zeros(_SECTORS)
    information[known] = 1.0 / polygamma(1, degrees)
    mean = np.bincount(sector[keep], ratio[keep], minlength=_SECTORS)[known] / count[known]
    values = np.log(np.maximum(mean, 1e-12)) + np.log(degrees) - digamma(degrees)
    level[known] = values - information[known] @ values / information.sum() if known.any() else 0.0
    return Levels(sector, level, information, keep)


def make_bins(
    lattice: Lattice,
    power: Array,
    pilot: Array,
    keep: Array,
    *,
    information: Array | float = 1.0,
    is_tapered: bool = False,
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
    """
    from scipy.special import digamma, polygamma

    width = _OCTAVE / PER_OCTAVE
    split = math.log(_ALIASED) if lattice.axes == 2 and not is_tapered else math.inf
    number, count = _joined(*_classes(lattice, keep, width, split))
    ratio = power / pilot
    sums = _Sums(number, count, ratio, lattice, _MEDIAN_SAMPLE if is_tapered else _SAMPLE)
    mean = sums.total / count
    if is_tapered:
        values = np.where(sums.places >= 0, ratio.ravel()[sums.places], np.nan)
        mean = np.nanmedian(values, axis=1) / lattice.median
    share = information
    if np.ndim(information) > 0:
        share = _Sums(number, count, np.asarray(information), lattice, 1).total / count
    degrees = 0.5 * lattice.degrees * count * share * (TAPERED if is_tapered else 1.0)
    level = np.log(np.maximum(mean, 1e-300)) + np.log(degrees) - digamma(degrees)
    # expectations of an even sample of each bin
    chosen = sums.places[:, :: max(1, sums.places.shape[1] // _SAMPLE)]
    bins, place = np.nonzero(chosen >= 0)[0], chosen[chosen >= 0]
    weight = 1.0 / (pilot.ravel()[place] * np.bincount(bins)[bins])
    rows, columns = np.divmod(place, pilot.shape[1])
    spreads, nodes = spread_nodes(max(1.0, lattice.shortest_edge / 12.0))
    tables = np.zeros((len(FORMS), spreads.size, count.size, lattice.t.size))
    for k, spread in enumerate(spreads):
        transforms = lattice.transforms(float(spread), edges=True)
        for table, (along_y, along_x) in zip(tables, transforms, strict=True):
            _average(weight, bins, rows, columns, along_y, along_x, table[k])
    return Bins(
        level=level,
        variance=np.asarray(polygamma(1, degrees)),
        tables=tables,
        spreads=spreads,
        nodes=nodes,
        t=lattice.t,
        white=np.bincount(bins, weight),
        lnq=sums.lnq / count,
        extent=lattice.longest,
        axes=lattice.axes,
    )


class _Sums:
    """Sums over the modes of each class, and an even sample of them.

    Attributes
    ----------
    total, lnq : ndarray, shape (classes,)
        Of the values and of the logarithms of the wavenumbers.
    places : ndarray of int, shape (classes, size)
        Flat indices of the sample, -1 where a class has fewer modes.
    """

    def __init__(self, number: Array, count: Array, values: Array, lattice: Lattice, size: int) -> None:
        self.total, self.lnq = np.zeros(count.size), np.zeros(count.size)
        self.places = np.full((count.size, size), -1)
        y, x = lattice.wavenumbers
        rank, filled = np.zeros(count.size), np.zeros(count.size, dtype=np.int64)
        _add(number, values, y, x, count, rank, filled, self.total, self.lnq, self.places)


def _classes(lattice: Lattice, keep: Array, width: float, split: float) -> tuple[Array, Array]:
    """Return the class of each mode, -1 of those that do not count, and the number of modes in each class.

    Rings of `width` in ln q; from ln q = `split` on, modes near a diagonal are a class of their own.
    """
    lowest = math.log(float(np.min(lattice.q, where=keep, initial=math.inf)))
    rings = int((math.log(float(lattice.q.max())) - lowest) / width) + 2
    number, count = np.full(keep.shape, -1, dtype=np.int16), np.zeros(2 * rings)
    y, x = lattice.wavenumbers
    _classify(y, x, lattice.spacing[0], keep, lowest, width, split, number, count)
    return number, count


def _joined(number: Array, count: Array) -> tuple[Array, Array]:
    """Join classes of few modes with the next."""
    joined, total, bins = np.zeros(count.size + 1, dtype=np.int16), 0.0, 0
    for k, modes in enumerate(count):
        joined[k] = bins
        total += modes
        if total >= LEAST:
            bins, total = bins + 1, 0.0
    joined = np.minimum(joined, max(bins - 1, 0))
    sums = np.bincount(joined[:-1], count)
    joined[-1] = -1
    return joined[number], sums


@kernel
def _classify(
    y: Array,
    x: Array,
    dy: float,
    keep: Array,
    lowest: float,
    width: float,
    split: float,
    number: Array,
    count: Array,
) -> None:
    """Fill the class of each mode, and count them; see `_classes`."""
    for r in range(y.size):
        for c in range(x.size):
            if not keep[r, c]:
                continue
            ring = int((0.5 * math.log(y[r] * y[r] + x[c] * x[c]) - lowest) / width + 1e-9)
            k = 2 * ring
            if lowest + width * ring > split:
                a, b = abs(y[r]) * dy, abs(x[c])
                k += (a if a < b else b) > math.tan(math.pi / 8.0) * (b if a < b else a)
            number[r, c] = k
            count[k] += 1.0


@kernel
def _add(
    number: Array,
    values: Array,
    y: Array,
    x: Array,
    count: Array,
    rank: Array,
    filled: Array,
    total: Array,
    lnq: Array,
    places: Array,
) -> None:
    """Add the values and ln q of the modes of each class; fill the sample. `rank` and `filled` are zero."""
    size = places.shape[1]
    for r in range(y.size):
        for c in range(x.size):
            k = number[r, c]
            if k < 0:
                continue
            total[k] += values[r, c]
            lnq[k] += 0.5 * math.log(y[r] * y[r] + x[c] * x[c])
            share = size / count[k]
            if rank[k] * (share if share < 1.0 else 1.0) >= filled[k]:
                places[k, filled[k]] = r * x.size + c
                filled[k] += 1
            rank[k] += 1.0


@kernel
def _average(
    weight: Array, number: Array, rows: Array, columns: Array, along_y: Array, along_x: Array, table: Array
) -> None:
    """Add the weighted products of the transforms of modes to their bins; table (bin, t)."""
    for j in range(table.shape[1]):
        for m in range(weight.size):
            table[number[m], j] += weight[m] * along_y[j, rows[m]] * along_x[j, columns[m]]
