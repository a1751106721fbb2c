"""Bins of the modes of a surface: which modes count, their mean power over a pilot, and its expectation.

Bins are a third of an octave wide; where aliases matter, the modes near the axes and near the diagonals
have bins of their own, because aliases and filters of the points differ there. Left out are modes whose
power is mostly that of the edges (they are correlated), or is taken by a filter but for a thousandth, and
those of single waves.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel
from fractalcontact.dimensions._gaussian_mixture import FORMS, Bins, Lattice, spread_nodes, weights
from fractalcontact.dimensions._spectral_posterior import tail

Array = np.ndarray[Any, np.dtype[Any]]

PER_OCTAVE = 3  # bins: within one, the information on H that is lost is 2 %
LEAST = 8  # modes in a bin: the logarithm of their mean is then nearly normal
_SAMPLE = 64  # modes of a bin over which an expectation is averaged: error below that of the pilot, .1 %
_LEAK = 0.5  # share of the edges in the expected power from which on neighbouring modes are correlated
_TAIL = 1e-3  # squared transfer function below which no form of a filter holds
_ALIASED = (
    0.25 * math.pi
)  # radians per point from which on aliases differ by azimuth by more than a per mille
_ISOTROPIC = math.pi / 3.0  # radians per point up to which they differ by less than 5 % for H above .1
_FALSE_ALARM = 0.01  # chance that a surface without single waves loses a mode to them
_SECTORS = 8  # of azimuth, on a quarter of the plane
_OCTAVE = math.log(2.0)


def expected_power(lattice: Lattice, theta: Array, form: int) -> tuple[Array, Array]:
    """Return the expected power of each mode, and that part of it that is not due to the edges."""
    weight = weights(theta[0], lattice.t)
    weight[-1] *= tail(theta[0], lattice.t[-1], theta[1], form, lattice.axes)
    powers = []
    for edges in (True, False):
        rows, columns = lattice.transforms(float(theta[1]), edges=edges)[form]
        powers.append(np.maximum((rows * weight[:, None]).T @ columns, 1e-300))
    if theta[3] > 0.0:
        corner = 2.0 * theta[5] * np.log(theta[3] / lattice.q)
        bend = np.exp((theta[4] - theta[0]) / theta[5] * np.logaddexp(0.0, corner))
        powers = [power * bend for power in powers]
    noise = theta[2] ** 2
    return powers[0] + noise, powers[1] + noise


def clear_modes(total: Array, clean: Array, unblurred: Array) -> Array:
    """Return the modes that neither the edges nor a filter dominate; see `expected_power`."""
    return np.asarray((clean >= (1.0 - _LEAK) * total) & (clean > _TAIL * unblurred))


def whitened(lattice: Lattice, power: Array, pilot: Array, keep: Array) -> Array:
    """Return power over pilot, with the median of each half octave as expected of Gaussian heights."""
    ratio = power / pilot
    half = np.floor(2.0 / _OCTAVE * np.log(lattice.q / lattice.q.min())).astype(np.int16)
    for octave in range(int(half.max()) + 1):
        chosen = half == octave
        known = chosen & keep
        if np.count_nonzero(known) >= LEAST:
            ratio[chosen] *= lattice.median / max(float(np.median(ratio[known])), 1e-300)
    return ratio


def single_waves(lattice: Lattice, ratio: Array, keep: Array) -> Array:
    """Return the modes of single waves: boxes whose mean power is improbable for Gaussian heights."""
    from scipy.ndimage import maximum_filter, uniform_filter
    from scipy.stats import chi2

    size = (1, 3) if lattice.axes == 1 else (3, 3)
    degrees = lattice.degrees * math.prod(size)
    limit = float(chi2.isf(_FALSE_ALARM / ratio.size, degrees)) / degrees
    marked = np.zeros(ratio.shape, dtype=bool)
    for _ in range(3):  # what is left out no longer lifts its neighbours
        level = np.where(keep & ~marked, ratio, 1.0)
        found = uniform_filter(level, size, mode="constant") > limit
        if not (found & keep & ~marked).any():
            break
        marked |= maximum_filter(found, size)
    return marked


def lay(lattice: Lattice, ratio: Array, keep: Array) -> Array:
    """Return the relative power of the azimuth of each mode, shrunk to one as far as chance explains it.

    An anisotropic self-affine surface has a level of its own in each direction, and the same exponent. The
    factor is that of James and Stein (1961), Proc. 4th Berkeley Symp. 1.
    """
    if lattice.axes == 1:
        return np.ones(ratio.shape)
    y, x = lattice.wavenumbers
    scale = 2.0 * _SECTORS / math.pi
    sector = np.minimum((np.arctan2(np.abs(y)[:, None], np.abs(x)) * scale).astype(np.int16), _SECTORS - 1)
    # aliases and filters of the points differ by azimuth among the shorter waves, and belong to the model
    keep = keep & (lattice.q * max(lattice.spacing) < _ISOTROPIC)
    count = np.maximum(np.bincount(sector[keep], minlength=_SECTORS), 1.0)
    level = np.log(np.maximum(np.bincount(sector[keep], ratio[keep], minlength=_SECTORS) / count, 1e-12))
    information = 0.5 * lattice.degrees * count
    level -= information @ level / information.sum()
    square = float(information @ np.square(level))
    shrunk = max(0.0, 1.0 - (_SECTORS - 3) / square) if square > 0.0 else 0.0
    return np.asarray(np.exp(shrunk * level)[sector])


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

    rows, columns = (place.astype(np.int32) for place in np.nonzero(keep))
    lnq = np.log(lattice.q[keep])
    number = _bin_numbers(lattice, rows, columns, lnq, is_tapered)
    bins = int(number.max()) + 1
    count = np.bincount(number, minlength=bins).astype(float)
    inverse = 1.0 / pilot[keep]
    ratio = power[keep] * inverse
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(count).astype(int)
    if is_tapered:
        groups = np.split(ratio[order], ends[:-1])
        level = np.log(np.maximum([np.median(group) for group in groups], 1e-300) / lattice.median)
    else:
        level = np.log(np.maximum(np.bincount(number, ratio, minlength=bins) / count, 1e-300))
    share = (
        information
        if np.ndim(information) == 0
        else np.bincount(number, np.asarray(information)[keep], minlength=bins) / count
    )
    degrees = 0.5 * lattice.degrees * count * share * (0.25 if is_tapered else 1.0)
    level += np.log(degrees) - digamma(degrees)
    # an even sample of each bin
    first = np.repeat(ends - count.astype(int), count.astype(int))
    every = np.maximum(count / _SAMPLE, 1.0)[number[order]]
    rank = np.arange(order.size) - first
    sample = order[np.floor((rank + 1) / every) > np.floor(rank / every)]
    spreads, nodes = spread_nodes(max(1.0, lattice.shortest_edge / 12.0))
    tables = np.zeros((len(FORMS), spreads.size, bins, lattice.t.size))
    weight = inverse[sample] / np.bincount(number[sample], minlength=bins)[number[sample]]
    for k, spread in enumerate(spreads):
        for table, (along_y, along_x) in zip(
            tables, lattice.transforms(float(spread), edges=True), strict=True
        ):
            _average(weight, number[sample], rows[sample], columns[sample], along_y, along_x, table[k])
    return Bins(
        level=level,
        variance=np.asarray(polygamma(1, degrees)),
        tables=tables,
        spreads=spreads,
        nodes=nodes,
        t=lattice.t,
        white=np.bincount(number, inverse, minlength=bins) / count,
        lnq=np.bincount(number, lnq, minlength=bins) / count,
        extent=lattice.longest,
        axes=lattice.axes,
    )


def _bin_numbers(lattice: Lattice, rows: Array, columns: Array, lnq: Array, is_tapered: bool) -> Array:
    """Return the bin of each mode; bins of few modes are joined with the next."""
    width = _OCTAVE / PER_OCTAVE
    lowest = float(lnq.min())
    ring = ((lnq - lowest) / width + 1e-9).astype(np.int64)
    number = 2 * ring
    if lattice.axes == 2 and not is_tapered:
        y, x = (np.abs(q) * d for q, d in zip(lattice.wavenumbers, lattice.spacing, strict=True))
        y, x = y[rows], x[columns]
        is_diagonal = np.minimum(y, x) > math.tan(math.pi / 8.0) * np.maximum(y, x)
        number += is_diagonal & (lowest + width * ring > math.log(_ALIASED))
    count = np.bincount(number)
    joined, total, bins = np.zeros(count.size, dtype=np.int64), 0, 0
    for k, modes in enumerate(count):
        joined[k] = bins
        total += modes
        if total >= LEAST:
            bins, total = bins + 1, 0
    return np.minimum(joined, max(bins - 1, 0))[number]


@kernel
def _average(
    weight: Array, number: Array, rows: Array, columns: Array, along_y: Array, along_x: Array, table: Array
) -> None:
    """Add the weighted products of the transforms of modes to their bins; table (bin, t)."""
    for j in range(table.shape[1]):
        for m in range(weight.size):
            table[number[m], j] += weight[m] * along_y[j, rows[m]] * along_x[j, columns[m]]
