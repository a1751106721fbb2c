"""Expected power of the cosine modes of a self-affine surface, from a scale mixture of Gaussians.

The covariance of fractional Brownian heights is a sum of Gaussians over octaves of t,

    -r^(2 H) = const + c(H) sum_j t_j^(-H) exp(-t_j r^2),   t_j = 2^j,

the trapezoid rule in ln t of an integral of Mellin; its error is exp(-pi^2 / ln 2) = 7e-7. A Gaussian is a
product of one-dimensional ones, and it stays one under a Gaussian blur of the spread s,

    exp(-t r^2)  ->  (1 + 4 t s^2)^(-d/2) exp(-t r^2 / (1 + 4 t s^2)),

so that the expected power of each mode is a sum over j of products of two one-dimensional transforms, in
which sampling (aliases), free edges, unequal spacings and the blur are exact. A profile is the case d = 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array

HIGHEST = 12  # log2 of the largest t: beyond, a Gaussian is white on the lattice, the sum a geometric series
# how heights were sampled: blurred before; blurred afterwards, by Gaussian weights of the neighbours; without
# waves that are shorter than two points, as a part of a synthetic periodic surface
FORMS = 3
ALIASED, FILTERED, UNALIASED = range(FORMS)
_SUM_OF_WAVES = 1.0  # spread from which on the sum over waves is the shorter one, exact to 3e-7
# ln(H / (1 - H)) of the exponents of a table; between them the logarithms of bins are off by less than 1e-4
_LOGITS = np.linspace(-5.3, 5.3, 43)
# of the cubics that are one at -1, 0, 1 or 2, and zero at the others: coefficients of the powers, by column
_CUBICS = np.array([[0, 6, 0, 0], [-2, -3, 6, -1], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0
# of the spreads of a table: of a first fit, and of the posterior. Near the axes the power of a blur ends at
# that of the edges, where a cubic needs short steps
_SPREAD_STEPS = 0.25, 0.1
# Exponent below which a Gaussian does not count: far below rounding, yet no product of two is denormal. Such
# numbers doubled the time of transforms
FADED = -100.0
FIRST_SPREAD = 0.3  # spacings; the spreads of a table are even in asinh(s / FIRST_SPREAD)
_NODES = 4  # Gaussians an octave of what free ends add to profiles: power off by 4e-5, the first mode by .003


def mixture(longest: float) -> Array:
    """Return the scales t of the Gaussians, from one of eight edges `longest` on, in squared x spacings."""
    return 2.0 ** np.arange(-2 * math.ceil(math.log2(8.0 * longest)) - 2, HIGHEST)


def weights(
    hurst: Array | float, t: Array, form: int, axes: int, spread: Array | float = 0.0, terms: int = 40
) -> Array:
    """Return the weights of the Gaussians for heights of unit rms increment over one x spacing, (..., t).

    The last one holds all shorter Gaussians, of which `terms` are summed and the others form a geometric
    series.
    """
    h = np.asarray(hurst)[..., None]
    ratio, blur = 2.0**-h, 4.0 * t[-1] * np.square(spread)[..., None]
    weight = t**-h
    longer = t[0] ** (1.0 - h) * 2.0 ** (h - 1.0) / (1.0 - 2.0 ** (h - 1.0))
    shorter = weight[..., -1:] * ratio / (1.0 - ratio)
    unit = longer + (weight * -np.expm1(-t)).sum(axis=-1, keepdims=True) + shorter
    # over its own term: without aliases a Gaussian counts by its density, 2^(-d / 2) of the one before
    number = np.arange(terms + 1.0)
    if form == UNALIASED:
        share, falls = 2.0 ** (-0.5 * axes * number), np.full(1, 0.5 * axes)
    else:
        blur = np.zeros_like(blur) if form == FILTERED else blur
        share = ((1.0 + blur) / (1.0 + blur * 2.0**number)) ** (0.5 * axes)
        falls = np.where(blur > 0.0, 0.5 * axes, 0.0)
    series = ratio**number * share
    rest = series[..., -1:] / (1.0 - 2.0 ** -(h + falls))
    last = series[..., :-1].sum(axis=-1, keepdims=True) + rest
    return np.asarray(0.5 * np.where(np.arange(t.size) < t.size - 1, weight, weight * last) / unit)


def log_bend(squares: Array, theta: Array) -> Array:
    """Return the logarithm of the factor of a corner at squared wavenumbers; theta: see `Bins.log_power`."""
    hurst, _, _, corner, long_hurst, sharpness = theta
    bend = np.logaddexp(0.0, sharpness * np.log(corner**2 / np.maximum(squares, 1e-30)))
    return np.asarray((long_hurst - hurst) / sharpness * bend)


@lru_cache
def _point_weights(spread: float) -> Array:
    """Return Gaussian weights exp(-u^2 / (2 w^2)) of u = 1 ... 8 that have a standard deviation, at most
    `_SUM_OF_WAVES`.
    """
    u, widths = np.arange(9.0), np.geomspace(0.1, _SUM_OF_WAVES + 0.1, 300)
    weights = np.exp(-0.5 * np.square(u / widths[:, None]))
    variances = weights @ np.square(u) / (weights.sum(axis=1) - 0.5)
    width = np.interp(spread, np.sqrt(variances), widths)
    return np.asarray(np.exp(-0.5 * np.square(u[1:] / width)))


def alias_logs(y: Array, x: Array, dy: float, axes: int) -> Array:
    """Return the mean logarithm of the wavenumbers of the nearest aliases of waves, weighted by their power
    q^(-1 - axes).

    Wavenumbers are in radians per x spacing; `dy` is the other spacing.
    """
    down, across = 2.0 * np.pi * np.mgrid[1 - axes : axes, -1:2].reshape(2, -1, 1)
    aliases = np.delete(np.square(y + down / dy) + np.square(x + across), 3**axes // 2, axis=0)
    power = aliases ** (-0.5 * (1.0 + axes))
    return np.asarray(0.5 * (power * np.log(aliases)).sum(axis=0) / power.sum(axis=0))


class AxisBlur:
    """Blurs along one axis: their transfer functions at some wavenumbers.

    Parameters
    ----------
    q : ndarray
        Wavenumbers, radians per point.
    """

    def __init__(self, q: Array) -> None:
        self.waves = q + np.array([0.0, -2.0 * np.pi, 2.0 * np.pi])[:, None]
        self.cosines = chebvander(np.cos(q), 8).T[1:]  # of 1 ... 8 points

    def transfers(self, spread: float) -> tuple[Array, Array]:
        """Return the transfer functions of a Gaussian blur and of Gaussian weights of points, `spread` in
        points.

        The first is that of the wavenumbers and their nearest aliases, shape (3, q). The second is a sum over
        points, which equals one over waves (Poisson): the shorter of the two is used.
        """
        blur = np.exp(-0.5 * np.square(spread * self.waves))
        if spread > _SUM_OF_WAVES:
            return blur, blur.sum(axis=0) / (1.0 + 2.0 * math.exp(-0.5 * (2.0 * np.pi * spread) ** 2))
        weights = _point_weights(spread)
        return blur, (1.0 + 2.0 * weights @ self.cosines) / (1.0 + 2.0 * weights.sum())


class AxisModes:
    """Modes along one axis, and the spectral density of Gaussians on a lattice without the effect of edges.

    Parameters
    ----------
    t : ndarray
        Scales of the Gaussians, per squared point.
    q : ndarray
        Wavenumbers, radians per point.
    """

    def __init__(self, t: Array, q: Array) -> None:
        self.t, self.blur = t, AxisBlur(q)
        root, inverse = np.sqrt(np.pi / t)[:, None], -0.25 / t[:, None]
        self.images = [root * np.exp(np.square(wave) * inverse) for wave in self.blur.waves]
        self.sampled = self.densities(0.0)[ALIASED]  # without a blur

    def densities(self, spread: float) -> tuple[Array, Array, Array]:
        """Return the densities after a blur for each form, shape (t, q); `spread` in points."""
        blurs, weights = (np.square(transfer) for transfer in self.blur.transfers(spread))
        unaliased, left, right = (image * blur for image, blur in zip(self.images, blurs, strict=True))
        aliased = unaliased + left + right
        # for narrow Gaussians the sum over the points is shorter than that over the waves
        wider = 1.0 + 4.0 * self.t * spread**2
        narrow = self.t >= wider
        shares = np.exp(-np.outer((self.t / wider)[narrow], np.square(np.arange(1.0, 5.0))))
        aliased[narrow] = (1.0 + 2.0 * shares @ self.blur.cosines[:4]) / np.sqrt(wider[narrow])[:, None]
        return aliased, weights * (self.sampled if spread > 0.0 else aliased), unaliased


def free_power(n: int, t: Array, detrended: bool) -> Array:
    """Return the expected squared cosine modes 1 ... n - 1 of n points with free ends, shape (t, n - 1).

    `detrended`: of the heights less their straight line.
    """
    u = np.arange(n + 1)
    c = np.exp(np.maximum(np.outer(-t, np.square(u)), FADED))
    # the sums of (n - u) c cos and of n c sin are the even and the odd part of one transform of 2 n points
    both = np.concatenate([c * (2.0 * n - u), c[:, n - 1 : 0 : -1] * -u[n - 1 : 0 : -1]], axis=1)
    both[:, 0], both[:, n] = n, 0.0
    modes = fft.rfft(both)[:, 1:n]
    power = (modes.real + modes.imag / (n * np.sin(np.pi * u[1:n] / n))) / n
    if detrended:  # modes of z less its line v (v z): E - 2 g (F C v) + g^2 v C v
        v = np.arange(n) - 0.5 * (n - 1)
        v /= np.sqrt(v @ v)
        g = fft.dct(v[None], 2, (1,))[0, 1:] / math.sqrt(2.0 * n)
        both = np.concatenate([c, c[:, n - 1 : 0 : -1]], axis=1)
        cv = fft.irfft(fft.rfft(both) * fft.rfft(np.pad(v, (0, n))), 2 * n)[:, :n]
        power += -2.0 * g * fft.dct(cv, 2, (1,))[:, 1:] / math.sqrt(2.0 * n) + g * g * (cv @ v)[:, None]
    return np.asarray(np.maximum(power, 1e-14 * c.sum(axis=1, keepdims=True)))


@dataclass(frozen=True)
class Bins:
    """Mean power of bins of modes over a pilot, and its expectation for each form, spread and Gaussian.

    Attributes
    ----------
    level, variance : ndarray, shape (bins,)
        Logarithm of the mean of power / pilot, without the bias of the logarithm, and its variance.
    tables : ndarray, shape (forms, spreads, bins, t)
    nodes : ndarray
        Of the table: FIRST_SPREAD and the step of asinh(s / FIRST_SPREAD), in x spacings.
    t : ndarray
    white : ndarray, shape (bins,)
        Mean of 1 / pilot.
    lnq : ndarray, shape (bins,)
        Mean logarithm of the wavenumber, radians per x spacing.
    ln_alias : ndarray, shape (bins,)
        The same of aliases, see `alias_logs`.
    extent, finest : float
        Of the longer edge, and the smaller spacing, in x spacings.
    axes : int
    noise : float
        Rms height of white noise, if it is known: the amplitude of the surface is then this over the noise
        of theta, in place of free.
    shared : ndarray, shape (bins, bins), or 0
        Covariance of an error that the bins share, as that of a metric.
    """

    level: Array
    variance: Array
    tables: Array
    nodes: Array
    t: Array
    white: Array
    lnq: Array
    ln_alias: Array
    extent: float
    finest: float
    axes: int
    noise: float = 0.0
    shared: Array | float = 0.0

    @cached_property
    def _logs(self) -> Array:
        """Logarithms of the power of a surface at nodes (forms, spreads, exponents, bins).

        Before the spreads stands the second one: the power is even in the spread.
        """
        spread = self.nodes[0] * np.sinh(self.nodes[1] * np.arange(self.tables.shape[1]))[:, None]
        hurst = 1.0 / (1.0 + np.exp(-_LOGITS))
        # where a blur leaves nothing, a slope that no surface has
        least = 1e-200 * np.exp(-np.clip(40.0 * self.lnq, -160.0, 160.0))
        logs = np.empty((len(self.tables), len(spread) + 1, _LOGITS.size, self.lnq.size))
        for form, table in enumerate(self.tables):
            # only the weights of a surface that was blurred before it was sampled depend on the spread
            weight = weights(hurst, self.t, form, self.axes, spread if form == ALIASED else 0.0)
            logs[form, 1:] = np.log(weight @ table.transpose(0, 2, 1) + least)
        logs[:, 0] = logs[:, 2]
        return logs

    @cached_property
    def _unaliased_logs(self) -> Array:
        """Logarithms of that part of the power whose waves are longer than two points."""
        unaliased = self._logs[UNALIASED]
        filtered = self._logs[FILTERED] + (unaliased - self._logs[ALIASED])[1]  # without a blur
        return np.asarray(np.minimum([unaliased, filtered, unaliased], self._logs))

    def _bend(self, theta: Array, share: Array) -> tuple[Array, Array, Array]:
        """Return the logarithm of the factor of a corner, (points, bins), and its derivatives.

        They are those by theta, see `log_power`, and by the logarithm of `share`, that of the waves longer
        than two points. The rest are aliases, which have about the factor of their mean wave: power of a
        Matern roll-off at 16 spacings (H = .2) is then off by .0009 (rms, apart from its level), with the
        factor of the waves themselves by .0049; with spacings of 1 and 4 by .006.
        """
        from scipy.special import expit

        hurst, _, _, corner, long_hurst, p = theta.T[:, :, None]
        lnq = np.stack([self.lnq, self.ln_alias])[:, None]
        x, difference = 2.0 * p * (np.log(corner) - lnq), long_hurst - hurst
        bend = np.logaddexp(0.0, x)
        powers = np.exp(difference / p * bend)
        weight = np.stack([share, 1.0 - share]) * powers
        factor = weight.sum(axis=0)
        weight /= factor
        mean, turned = (weight * bend).sum(axis=0) / p, weight * expit(x)
        slopes = np.zeros((len(theta), theta.shape[1], share.shape[1]))
        slopes[:, 0], slopes[:, 4] = -mean, mean
        slopes[:, 3] = 2.0 * difference * turned.sum(axis=0)
        slopes[:, 5] = difference / p * ((turned * x).sum(axis=0) / p - mean)
        return np.log(factor), slopes, share * (powers[0] - powers[1]) / factor

    def log_power(self, theta: Array, form: Array | int, *, slopes: bool = False) -> tuple[Array, Array]:
        """Return the logarithm of the expected power of each bin, and its derivatives.

        That of the surface is a cubic between the exponents and the spreads of a table.

        Parameters
        ----------
        theta : ndarray, shape (points, 6)
            Exponent, spread of a blur, noise, corner (0: none), exponent of the long waves, sharpness p.
        form : int or ndarray of int, shape (points,)
        slopes : bool
            Whether derivatives are wanted, else there are none.

        Returns
        -------
        log_power : ndarray, shape (points, bins)
        slopes : ndarray, shape (points, 6, bins)
            By each of theta, by the logarithm of the corner.
        """
        logs, step = self._logs, _LOGITS[1] - _LOGITS[0]
        _, spreads, exponents, bins = logs.shape
        hurst, spread, noise = theta.T[:3, :, None]
        logit, place = np.log(theta[:, 0] / (1.0 - theta[:, 0])), np.arcsinh(theta[:, 1] / self.nodes[0])
        place = 1.0 + place / self.nodes[1]
        first_h, share_h, slope_h = _cubic((logit - _LOGITS[0]) / step, exponents)
        first_s, share_s, slope_s = _cubic(np.minimum(place, spreads - 2.0), spreads)
        rows = (form * spreads + first_s)[:, None] + np.arange(4)
        nodes = rows[:, :, None] * exponents + (first_h[:, None] + np.arange(4))[:, None]
        nodes = nodes.reshape(-1, 16)
        pairs = ((share_s, share_h), (share_s, slope_h), (slope_s, share_h))[: 3 if slopes else 1]
        shares = np.stack([(s[:, :, None] * h[:, None]).reshape(-1, 16) for s, h in pairs], axis=1)
        values = shares @ logs.reshape(-1, bins)[nodes]
        bent = np.flatnonzero(theta[:, 3] > 0.0)
        unaliased = shares[bent] @ self._unaliased_logs.reshape(-1, bins)[nodes[bent]] - values[bent]
        factor, of_bend, of_share = self._bend(theta[bent], np.exp(np.minimum(unaliased[:, 0], 0.0)))
        values[bent, 0] += factor
        values[bent, 1:] += of_share[:, None] * unaliased[:, 1:]
        power, white = np.exp(np.maximum(values[:, 0], -600.0)), np.square(noise) * self.white  # not zero
        total = power + white
        amplitude = 2.0 * np.log(self.noise / noise) if self.noise > 0.0 else 0.0
        found = np.zeros((theta.shape[0], 6 if slopes else 0, bins))
        if slopes:
            found[:, 0] = values[:, 1] / (hurst * (1.0 - hurst) * step)
            found[:, 1] = values[:, 2] / (self.nodes[1] * np.hypot(spread, self.nodes[0]))
            found[place >= spreads - 2.0, 1] = 0.0
            found[bent] += of_bend
            found *= (power / total)[:, None]
            found[:, 2] = 2.0 * noise * self.white / total
            if self.noise > 0.0:
                found[:, 2] -= 2.0 / noise
        return np.log(total) + amplitude, found


def _cubic(place: Array, size: int) -> tuple[Array, Array, Array]:
    """Return the first of four nodes about each place, and the shares of their values and slopes there."""
    first = np.minimum(np.maximum(place.astype(np.int64) - 1, 0), size - 4)
    powers = (place - first - 1.0)[:, None] ** np.arange(4)
    return first, powers @ _CUBICS, (powers[:, :3] * np.arange(1.0, 4.0)) @ _CUBICS[1:]


def spread_nodes(shortest_edge: float, *, is_pilot: bool) -> tuple[Array, Array]:
    """Return the spreads of a table, and (FIRST_SPREAD, step of asinh(s / FIRST_SPREAD)), in x spacings.

    They reach a twelfth of the shortest edge, or one spacing.
    """
    step = _SPREAD_STEPS[not is_pilot]
    number = math.ceil(math.asinh(max(1.0, shortest_edge / 12.0) / FIRST_SPREAD) / step) + 3
    return FIRST_SPREAD * np.sinh(step * np.arange(number)), np.array([FIRST_SPREAD, step])


@dataclass(frozen=True)
class Lattice:
    """Modes of a rectangle of heights, or of a profile, shape (1, n).

    Attributes
    ----------
    shape : (ny, nx)
    spacing : (dy/dx, 1)
    periodic : bool
        Fourier modes of a periodic surface in place of cosine modes.
    stretch : float
        Lag along x over that along y of equal increments, without a blur.
    columns : ndarray of int, optional
        Modes of a profile that are used. Default: all.
    leaks : ndarray, optional
        What free ends add to the densities of these modes: of the Gaussians of `_free_ends`.
    """

    shape: tuple[int, int]
    spacing: tuple[float, float]
    periodic: bool = False
    stretch: float = 1.0
    columns: Array | None = None
    leaks: Array | None = None

    @property
    def axes(self) -> int:
        return 1 if self.shape[0] == 1 else 2

    @property
    def degrees(self) -> float:
        """Real Gaussian numbers in a mode."""
        return 2.0 if self.periodic else 1.0

    @cached_property
    def orders(self) -> list[Array]:
        """Half waves along y and x of the modes that are used: those that vary along both axes."""
        y, x = (np.zeros(1) if n == 1 else np.arange(1.0, n) for n in self.shape)
        if self.periodic:
            ny, (rows, columns) = self.shape[0], self._waves
            y, x = 2.0 * np.where(rows > ny // 2, rows - ny, rows), 2.0 * columns
        return [y, x if self.columns is None else x[self.columns]]

    @property
    def _waves(self) -> tuple[Array, Array]:
        """Rows and columns of the Fourier modes: without those of two spacings, of which some are real."""
        ny, nx = self.shape
        rows = np.zeros(1, dtype=int) if ny == 1 else np.r_[1 : (ny + 1) // 2, ny // 2 + 1 : ny]
        return rows, np.arange(1, (nx + 1) // 2)

    @cached_property
    def wavenumbers(self) -> list[Array]:
        """Along y and x, radians per x spacing."""
        return [np.pi * o / (n * d) for o, n, d in zip(self.orders, self.shape, self.spacing, strict=True)]

    @cached_property
    def q(self) -> Array:
        """Wavenumber of each mode, radians per x spacing."""
        return np.hypot(self.wavenumbers[0][:, None], self.wavenumbers[1])

    @property
    def longest(self) -> float:
        """Length of the longer edge, in x spacings."""
        return max(n * d for n, d in zip(self.shape, self.spacing, strict=True))

    @property
    def steps(self) -> tuple[float, float]:
        """Spacings along y and x over which increments count."""
        return self.spacing[0] * self.stretch, self.spacing[1]

    @property
    def median(self) -> float:
        """Median of a squared mode over its expectation."""
        return math.log(2.0) if self.periodic else 0.454936423119572

    @cached_property
    def t(self) -> Array:
        """Scales of the Gaussians: from one of eight extents on."""
        return mixture(max(n * d for n, d in zip(self.shape, self.steps, strict=True)))

    def spread_nodes(self, *, is_pilot: bool) -> tuple[Array, Array]:
        """Return the spreads of a table, see the function of this name."""
        edges = [n * d for n, d in zip(self.shape, self.spacing, strict=True) if n > 1]
        return spread_nodes(min(edges), is_pilot=is_pilot)

    def transforms(self, spread: float, *, edges: bool) -> list[list[Array]]:
        """Return for each form the transforms (t, modes) of each Gaussian along y and x.

        With `edges` those of free ends, as in the expected power; without, the density alone.
        """
        columns = self._transform(1, spread, edges and not self.periodic)
        is_square = self.shape[0] == self.shape[1] and self.spacing[0] == self.spacing[1]
        is_alike = is_square and self.stretch == 1.0 and not self.periodic
        rows = columns if is_alike else self._transform(0, spread, edges and not self.periodic)
        return [[along_y, along_x] for along_y, along_x in zip(rows, columns, strict=True)]

    @cached_property
    def _lines(self) -> list[AxisModes]:
        """Modes along y and x."""
        axes = zip(self.steps, self.spacing, self.wavenumbers, strict=True)
        return [AxisModes(self.t * step * step, q * d) for step, d, q in axes]

    def _transform(self, axis: int, spread: float, edges: bool) -> list[Array]:
        n, s = self.shape[axis], spread / self.spacing[axis]
        if n == 1:
            return [np.ones((self.t.size, 1))] * FORMS
        line = self._lines[axis]
        aliased, *others = line.densities(s)
        if not edges:
            return [aliased, *others]
        wider = 1.0 + 4.0 * line.t * s**2
        if self.leaks is None:
            power = free_power(n, line.t / wider, self.axes == 1) / np.sqrt(wider)[:, None]
        else:
            first, share, _ = _cubic(_NODES * (np.log2(self.t / self.t[0] / wider) + 1.0), len(self.leaks))
            leaks = self.leaks[first[:, None] + np.arange(4)]
            leak = np.einsum("tk,tkq->tq", share / np.sqrt(wider)[:, None], leaks)
            power = np.maximum(aliased + leak, 0.0)
        # the edges feel long waves alone, which are alike in all forms
        leak, least = power - aliased, 1e-14 * power
        return [power, *(np.maximum(leak + clean, least) for clean in others)]

    @cached_property
    def _free_ends(self) -> tuple[Array, Array]:
        """Scales of some Gaussians an octave, of these without a blur or of narrower ones with one, and the
        power of the modes of free ends of each.
        """
        t = self.t[0] * 2.0 ** np.arange(-1.0, np.log2(self.t[-1] / self.t[0]) + 1.0, 1.0 / _NODES)
        # each by itself: less memory
        return t, np.array([free_power(self.shape[1], s, True)[0] for s in t[:, None]])

    def with_columns(self, columns: Array) -> Lattice:
        """Return the same lattice of some of the modes of a profile."""
        chosen = replace(self, columns=columns)
        if self.periodic:
            return chosen
        t, power = self._free_ends
        return replace(chosen, leaks=power[:, columns] - AxisModes(t, chosen.wavenumbers[1]).sampled)

    def power(self, heights: Array) -> Array:
        """Return the squared modes of complete heights."""
        z = heights - heights.mean()
        if self.periodic:
            rows, columns = self._waves
            modes = fft.rfft2(z)[rows, 1 : 1 + columns.size]
            return np.asarray((np.square(modes.real) + np.square(modes.imag)) / z.size)
        if self.axes == 1:
            x = np.arange(z.size) - 0.5 * (z.size - 1)
            z = z - (z @ x)[:, None] / (x @ x) * x
            return np.asarray(np.square(fft.dct(z, 2, (1,))[:, 1:]) / (2.0 * z.size))
        power = np.square(fft.dct(z, 2, (0, 1))[1:, 1:])
        power /= 4.0 * z.size
        return np.asarray(power)
