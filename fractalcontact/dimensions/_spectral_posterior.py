"""Posterior distribution of the Hurst exponent, given the mean power of bins of modes.

The expected power of a bin b is

    E_b = A { B(q) U_b + B(q_a) (S_b - U_b) + nu^2 W_b },    S_b = sum_j w_j(H) M_bj(s, form),  (1)
    B(q) = (1 + (q_0 / q)^(2 p))^((H_2 - H) / p),    p = k min(|H_2 - H|, 1)

with the Gaussians j of `_gaussian_mixture`. U is that part of S whose waves are longer than two points;
the others, aliases, have about the bend at the mean wavenumber q_a of the nearest ones. H is the exponent,
s the spread of a blur, nu white noise over the rms increment, q_0 the wavenumber beyond which long waves
have the exponent H_2, k the sharpness of that corner: 1 where two surfaces were added and of a Matern
covariance, large of a sudden plateau. The amplitude A has a flat prior in ln A, or is (n / nu)^2
where the height n of the noise is known; the others have those of the constants below. Heights were
sampled after the blur, before it, or without waves shorter than two points. The logarithms of the bins are
normal, and

    y_b = ln E_b + delta_b + eps_b,      eps: scatter of the modes in the bin                    (2)

where delta is what (1) does not hold: nothing; a process of standard deviation tau, correlated over an
octave; the fourth order in q of a filter that is no Gaussian; its first order, as that of a lens or of a
point spread with long tails, -a q, where a has a normal prior with the deviation of one spacing; or a cut q_c
beyond which the bins say nothing, with a process that grows to it as (q / q_c)^2 (short waves) or (q_c / q)^2
(long waves).

Noise, a blur, a corner, sampling without aliases, a process, a first order and a cut are departures from an
exact surface, independent of each other. They have the same prior probability, but for noise, which has more,
and a first order, of which the half with a < 0, stronger short waves, is impossible.

For each combination of nuisances and each kind of discrepancy the maximum is found by Gauss-Newton steps in
unit normal variables u (the maxima, where the model holds), and Laplace's method gives its evidence and a
normal distribution of u. The posterior of H is the sum of these normal distributions: no sampling, and
continuous in the heights.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.dimensions._gaussian_mixture import FILTERED, FORMS, UNALIASED, Bins

HURST, SPREAD, NOISE, CORNER, LONG_HURST, SHARPNESS = range(6)  # theta
LOWEST, HIGHEST = 0.005, 0.995  # H: at 0 and 1 no sum of Gaussians has increments
LEVEL = 0.95  # probability of an interval, and from which on a nuisance is named

# Priors. Probability of each departure from an exact surface: blur, corner, no aliases, process, first order
# of a filter, cut.
# Intervals of 10800 surfaces of 33 kinds, 128 x 128 points, hold H in .960, .968, .973, .978 and .984 with
# .06, .08, .1, .12 and .15 (noise alike); fewer than .9 in 14, 12, 9, 6 and 5 of 96 cells; widths .85 to 1
DEPARTURE = 0.1
# Of noise, which any instrument adds. Where it is just not seen intervals hold H in .70, .78, .85 and .93
# with .1, .2, .3 and .5 (noise of .05, H = .9, 256 x 256 points); those of exact surfaces, 128 x 128, are 2
# to 9 and 6 to 19 % wider with .3 and .5 than with .2. With .3 `directions` gives white noise H = .5
_NOISY = 0.2
# Deviation of the logarithm of a positive number of which nothing else is known: a factor of e
_DEVIATION = 1.0
# Normal in ln nu (of the rms increment), ln s (spacings) and ln k. 95 % of instruments add noise of 1 to
# 50 %: with a median of .05 the intervals of `directions` missed H = .7 in one of six surfaces with noise of
# .3, with .1 exact intervals of H = .5 are 1.1 times as wide. 95 % of ratios, as k and those of lengths, are
# 1 / 4 to 4: with a factor of e in place of 2 white noise is taken for a wide bend
RATIO_DEVIATION = math.log(2.0)
_PRIOR_NOISE, _PRIOR_SPREAD = (math.log(0.07), _DEVIATION), (0.0, _DEVIATION)
_PRIOR_SHARPNESS = 0.0, RATIO_DEVIATION
# From power that falls towards long waves as q on. A plateau, -1, lies inside: as the end of the prior,
# intervals beside slow roll-offs at 6 and 8 spacings held H = .9 in 61 of 80, with -1.5 and -2 in 70. Means
# of 3 x 3 points hold .2 and .5 in 75, 71 and 70 of 80
_LONG_HURSTS = -1.5, 1.0
_TAUS = 0.02, 0.05, 0.12, 0.3, 0.8  # geometric, from 2 % to a factor; the last one at a cut
_OCTAVE = math.log(2.0)


@dataclass(frozen=True)
class Known:
    """What is known of a surface before its spectrum is fitted; None where it is estimated.

    Attributes
    ----------
    spread : float, optional
        Of the blur of the instrument, x spacings.
    noise : float, optional
        Rms height of white noise over the rms increment; 0 for none.
    background : float
        The same of noise that is there in any case, as of rounding.
    is_window : bool
        The waves were chosen beforehand: without corners and cuts.
    """

    spread: float | None = None
    noise: float | None = None
    background: float = 0.0
    is_window: bool = False

    @classmethod
    def of(cls, is_window: bool, spread: float | None = None, noise: float | None = None) -> Known:
        """Return what is known; waves that were chosen beforehand have neither unless it is told."""
        return cls(spread or 0.0, noise or 0.0, 0.0, True) if is_window else cls(spread, noise)

    def over(self, increment: float, background: float) -> Known:
        """Return the same, with the noise over an rms increment, and a background."""
        noise = None if self.noise is None else self.noise / increment
        return replace(self, noise=noise, background=background)

    @property
    def total_noise(self) -> float:
        """Height of known noise with the background; 0 where there is none, or it is estimated."""
        return math.hypot(self.noise, self.background) if self.noise else 0.0


@dataclass(frozen=True)
class Hypothesis:
    """Which nuisances are there.

    Attributes
    ----------
    form : int
        Of the sampling and the blur.
    theta : tuple of float
        Fixed values of theta, NaN where it is free.
    log_prior : float
    """

    form: int
    theta: tuple[float, ...]
    log_prior: float

    def fits(self, parameter: int) -> bool:
        """Return whether a parameter of theta is fitted: whether a blur, noise or a corner is there."""
        return math.isnan(self.theta[parameter])


@dataclass(frozen=True)
class Discrepancy:
    """What the model does not hold: standard deviation of each bin, and the bins that count.

    Attributes
    ----------
    scatter : ndarray, shape (bins,)
    inside : ndarray of bool, shape (bins,)
    prior : float
    is_filter : bool
        Of first order: one number times the scatter, in place of a process correlated over an octave.
    """

    scatter: Array
    inside: Array
    prior: float
    is_filter: bool = False


class Interval(NamedTuple):
    """Ends of an interval of H, and median and standard deviation of its distribution."""

    low: float
    median: float
    high: float
    deviation: float


@dataclass(frozen=True)
class Posterior:
    """Sum of normal distributions of u = Phi^-1((H - LOWEST) / (HIGHEST - LOWEST)), hypotheses by
    maxima.

    Attributes
    ----------
    share, centre, scale : ndarray, shape (hypotheses, maxima)
    theta : ndarray, shape (hypotheses, maxima, 6)
    hypotheses : list
    discrepancies : list
        Of each maximum: the first kind has several.
    """

    share: Array
    centre: Array
    scale: Array
    theta: Array
    hypotheses: list[Hypothesis]
    discrepancies: list[Discrepancy]

    def interval(self) -> Interval:
        """Return the shortest interval of H with a probability of 95 %."""
        some = self.share > 1e-12
        return mixture_interval(*(each[some] for each in (self.share, self.centre, self.scale)))

    def log_density(self, u: Array) -> Array:
        """Return the logarithm of the density of u."""
        some = self.share > 1e-12
        share, centre, scale = (each[some][:, None] for each in (self.share, self.centre, self.scale))
        density = np.exp(-0.5 * np.square((u - centre) / scale)) / scale
        return np.asarray(np.log((share * density).sum(axis=0) + 1e-300) - 0.5 * math.log(2.0 * math.pi))

    @property
    def most_probable(self) -> tuple[Hypothesis, Discrepancy, Array]:
        """Hypothesis, discrepancy and theta of the largest share."""
        return self.peak(int(np.argmax(self.share.max(axis=1))))

    def peak(self, m: int) -> tuple[Hypothesis, Discrepancy, Array]:
        """Return the hypothesis m, with the discrepancy and theta of its largest share."""
        k = int(np.argmax(self.share[m]))
        return self.hypotheses[m], self.discrepancies[k], self.theta[m, k]

    def named(self, parameter: int) -> float:
        """Return the mean of a parameter of theta that is there with a probability of 95 %, else NaN."""
        fits = np.array([hypothesis.fits(parameter) for hypothesis in self.hypotheses])
        share, theta = self.share[fits], self.theta[fits, :, parameter]
        return float(np.sum(share * theta) / share.sum()) if share.sum() > LEVEL else math.nan


def decay(bins: Bins, hypothesis: Hypothesis, discrepancy: Discrepancy, theta: Array) -> float:
    """Return -a of a filter of first order beside a maximum, 0 without one."""
    if not discrepancy.is_filter:
        return 0.0
    residual = bins.level - bins.log_power(theta[None], hypothesis.form)[0][0]
    return float(np.polyfit(np.exp(bins.lnq), residual, 1, w=bins.variance**-0.5)[0])


def mixture_interval(
    share: Array, centre: Array, scale: Array, *, points: int = 161, rounds: int = 4
) -> Interval:
    """Return the interval of H of a sum of normal distributions of u.

    Each round takes `points` where the one before expects equal steps of a normal distribution. Four find a
    deviation of .0005 of u. The intervals of 150 surfaces of 34 kinds were up to 1 % wider than the
    shortest (.05 % in the median).
    """
    from scipy.special import ndtr

    wanted = np.r_[0.0, ndtr(np.linspace(-4.0, 4.0, points)), 1.0]
    u, below = np.array([-8.0, 8.0]), np.array([0.0, 1.0])
    for _ in range(rounds):
        u = np.interp(wanted, below, u)
        below = np.r_[0.0, ndtr((u[1:-1, None] - centre) / scale) @ share, 1.0]
    return _shortest(u, below)


def joint_interval(posteriors: Sequence[Posterior], *, points: int = 4001, zooms: int = 5) -> Interval:
    """Return the interval of the H that independent surfaces have in common.

    Each has nuisances of its own. Their product has the prior of u, the unit normal distribution, once. The
    grid of `points` is narrowed `zooms` times to where its logarithm is within 20 of the highest.
    """
    low, high = -8.0, 8.0
    for _ in range(zooms):
        u = np.linspace(low, high, points)
        log = sum(each.log_density(u) for each in posteriors) + 0.5 * (len(posteriors) - 1) * np.square(u)
        near = np.flatnonzero(log > log.max() - 20.0)
        low, high = u[max(near[0] - 1, 0)], u[min(near[-1] + 1, u.size - 1)]
    density = np.exp(log - log.max())
    below = np.r_[0.0, np.cumsum(density[1:] + density[:-1])]
    return _shortest(u, below / below[-1])


def _shortest(u: Array, below: Array, probability: float = LEVEL) -> Interval:
    """Return the shortest interval of H with the probability; `below` is that of less than u.

    A parabola through three starts lets the ends move evenly.
    """
    from scipy.special import ndtr

    hurst = LOWEST + (HIGHEST - LOWEST) * ndtr(u)
    starts = hurst[below <= 1.0 - probability]
    ends = np.interp(below[: starts.size] + probability, below, hurst)
    k = int(np.argmin(ends - starts))
    low = starts[k]
    if 0 < k < starts.size - 1:
        near = slice(k - 1, k + 2)
        second, first, _ = np.polyfit(starts[near] - low, (ends - starts)[near], 2)
        low += np.clip(-0.5 * first / second, *(starts[near] - low)[[0, 2]]) if second > 0.0 else 0.0
    high = np.interp(np.interp(low, hurst, below) + probability, below, hurst)
    # without the outermost 3e-5 at each end, whose cells are wide
    middle, share = 0.5 * (hurst[2:-1] + hurst[1:-2]), np.diff(below[1:-1])
    deviation = math.sqrt(share @ np.square(middle - share @ middle / share.sum()) / share.sum())
    return Interval(float(low), float(np.interp(0.5, below, hurst)), float(high), deviation)


def hypotheses(known: Known) -> list[Hypothesis]:
    """Return the combinations of nuisances; what is known is not fitted."""
    spread, noise = known.spread, known.noise
    found = []
    for form, is_blurred, is_noisy, is_bent in itertools.product(range(FORMS), *[(False, True)] * 3):
        if (is_blurred and spread is not None) or (noise is not None and is_noisy != (noise > 0.0)):
            continue
        has_blur = is_blurred or bool(spread)
        # in a window that was chosen there is no corner; without a blur FILTERED is ALIASED
        if (is_bent and known.is_window) or (form == FILTERED and not has_blur):
            continue
        # what is known gives all hypotheses the same factor, which changes no share
        log_prior = math.log(_NOISY if is_noisy else 1.0 - _NOISY)
        for is_there in (form == UNALIASED, is_blurred, is_bent):
            log_prior += math.log(DEPARTURE if is_there else 1.0 - DEPARTURE)
        if has_blur and form != UNALIASED:
            log_prior -= math.log(2.0)  # a blur before sampling is as probable as one after it
        blur = math.nan if is_blurred else spread or 0.0
        white = math.nan if is_noisy else known.background
        bend = (math.nan,) * 3 if is_bent else (0.0, 0.0, 1.0)
        found.append(Hypothesis(form, (math.nan, blur, white, *bend), log_prior))
    return found


def posterior(
    bins: Bins,
    known: Known = Known(),
    *,
    pilot_spread: float = 0.0,
    is_pilot: bool = False,
    attempts: tuple[int, int] = (5, 2),
) -> Posterior:
    """Return the posterior of H.

    Parameters
    ----------
    bins : Bins
        With the height of known noise.
    known : Known
        By default everything is estimated.
    pilot_spread : float
        A first estimate of the spread, for the scatter of the fourth order.
    is_pilot : bool
        For a first estimate of the spectrum: with fewer kinds of discrepancy.
    attempts : (int, int)
        Maxima that are looked for without a discrepancy, and of a pilot.
    """
    chosen = hypotheses(known)
    kinds = _discrepancies(bins, pilot_spread if known.spread is None else None)
    if known.is_window:
        kinds = [kind for kind in kinds if kind.inside.all()]
    if is_pilot:
        kinds = [kind for kind in kinds if kind.inside[0] and kind.scatter[0] in (0.0, _TAUS[2])]
    # an octave of waves, of two to four of the smaller spacings, is shorter than a corner, and shows H
    corners = math.log(0.5 * np.pi / bins.extent), math.log(0.5 * np.pi / bins.finest)
    ranges = (LOWEST, HIGHEST), _PRIOR_SPREAD, _PRIOR_NOISE, corners, _LONG_HURSTS, _PRIOR_SHARPNESS
    prior = np.array(ranges).T
    whitening, constants = map(np.stack, zip(*(_whitening(kind, bins) for kind in kinds), strict=True))
    forms, thetas = (np.array(each) for each in zip(*((h.form, h.theta) for h in chosen), strict=True))
    fit = _Fit(bins, prior, forms, thetas)
    # the first kind of discrepancy has several maxima, each other kind the one near its best start, or near
    # the best of the first kind
    first = attempts[is_pilot]
    starts = np.where(np.isnan(fit.fixed)[:, None], _starting_points(), 0.0)
    residual = fit.residual(starts)
    several = fit.maxima(_best(starts, residual, whitening[:1], first), whitening[:1], constants[:1])
    best = np.take_along_axis(several[0], np.argmin(several[1], axis=1)[:, None, None], 1)
    starts = np.concatenate([starts, best], axis=1)
    residual = np.concatenate([residual, fit.residual(best)], axis=1)
    others = fit.maxima(_best(starts, residual, whitening[1:], 1), whitening[1:], constants[1:])
    u, objective, hessian = (np.concatenate(pair, axis=1) for pair in zip(several, others, strict=True))
    of_kind = np.r_[np.zeros(first, dtype=int), 1 : len(kinds)]
    found = [kinds[k] for k in of_kind]
    prior_of = np.array([hypothesis.log_prior for hypothesis in chosen])[:, None] + constants[of_kind]
    evidence = prior_of - 0.5 * objective - 0.5 * np.linalg.slogdet(hessian)[1]
    for k in np.flatnonzero([kind.is_filter for kind in found]):
        evidence[:, k] += _log_weakening(bins, fit.residual(u[:, [k]])[:, 0])
    # two attempts within one standard deviation of the prior are one maximum: with .1 and 2 widths are the
    # same within 6 %
    distance = np.square(u[:, :first, None] - u[:, None, :first]).sum(axis=3)
    evidence[:, :first][np.tril(distance < 1.0, -1).any(axis=2)] = -np.inf
    scale = np.sqrt(np.linalg.inv(hessian)[:, :, HURST, HURST])
    share = np.exp(evidence - evidence.max())
    share /= share.sum()
    return Posterior(share, u[:, :, HURST], scale, fit.theta(u), chosen, found)


def _discrepancies(
    bins: Bins, pilot_spread: float | None, *, room: float = 3.0, fourth_order: float = 0.125
) -> list[Discrepancy]:
    """Return the kinds of discrepancy with their prior probabilities, which sum to one.

    Parameters
    ----------
    bins : Bins
    pilot_spread : float, optional
        None where the blur is known, and with it the filter.
    room : float
        Octaves that a cut leaves, to tell an exponent from a corner, and that are at most beyond it: filters
        of up to eight points, a levelled eighth of the extent.
    fourth_order : float
        Of (s q)^4: that of a mean over three points.
    """
    octaves = bins.lnq / _OCTAVE
    everything = np.ones(octaves.size, dtype=bool)
    lowest, highest = float(octaves.min()), float(octaves.max())
    # between rings of bins; those of one ring differ by less than a tenth of an octave
    ends = np.sort(octaves)
    ends = ends[np.flatnonzero(np.diff(ends) > 0.1)]
    short_cuts = ends[ends > max(lowest + room, highest - room)]
    long_cuts = ends[ends < min(highest - room, lowest + room)][::2]
    cuts = [(_TAUS[-1] * 4.0 ** (octaves - cut), octaves <= cut) for cut in short_cuts]
    cuts += [(_TAUS[-1] * 4.0 ** (cut - octaves), octaves > cut) for cut in long_cuts]
    cuts = [(scatter, inside) for scatter, inside in cuts if inside.sum() >= 4 and not inside.all()]
    q = np.exp(bins.lnq)
    fourth = fourth_order * np.minimum((pilot_spread or 0.0) * q, 3.0) ** 4
    has_fourth = bool(fourth.max() > 0.01)
    uncut = 1.0 - DEPARTURE if cuts else 1.0
    first_order = DEPARTURE * (pilot_spread is not None)
    smooth = uncut * (1.0 - DEPARTURE)
    holds = smooth * (1.0 - first_order) * (0.5 if has_fourth else 1.0)
    kinds = [Discrepancy(np.zeros(octaves.size), everything, holds)]
    kinds += [
        Discrepancy(np.full(octaves.size, tau), everything, uncut * DEPARTURE / len(_TAUS)) for tau in _TAUS
    ]
    if first_order:
        kinds.append(Discrepancy(q, everything, smooth * first_order, is_filter=True))
    if has_fourth:
        kinds.append(Discrepancy(fourth, everything, holds))
    return kinds + [Discrepancy(scatter, inside, (1.0 - uncut) / len(cuts)) for scatter, inside in cuts]


def _whitening(kind: Discrepancy, bins: Bins, flat: float = 1e4) -> tuple[Array, float]:
    """Return the matrix that makes the bins of (2) white, zero for those that do not count, and its log
    density.

    A bin beyond a cut has the expected logarithm of the density of the deviation `_DEVIATION`. `flat` is
    the variance of ln A: two deviations are a factor of e^200. Known noise determines A.
    """
    octaves = bins.lnq / _OCTAVE
    inside = np.ix_(kind.inside, kind.inside)
    correlation = 1.0 if kind.is_filter else np.exp(-np.abs(octaves[:, None] - octaves))
    covariance = np.diag(bins.variance) + bins.shared + np.outer(kind.scatter, kind.scatter) * correlation
    lower = np.linalg.cholesky(covariance[inside] + (0.0 if bins.noise > 0.0 else flat))
    whitening = np.zeros(covariance.shape)
    # above the diagonal the library leaves zeros or rounding, in one process not as in another
    whitening[inside] = np.tril(np.linalg.inv(lower))
    outside = bins.variance[~kind.inside] + _DEVIATION**2
    density = -np.log(np.diag(lower)).sum() - 0.5 * np.sum(np.log(outside) + 1.0)
    return whitening, math.log(kind.prior) + float(density)


def _log_weakening(bins: Bins, residual: Array) -> Array:
    """Return the logarithm of the probability that a filter of first order weakens waves.

    That it strengthens them is impossible, so that its prior probability is half of a departure. With all of
    it means over the area of a point scatter by .129 about H = .9, with half by .095, a quarter .080.
    """
    from scipy.special import log_ndtr

    q, weight = np.exp(bins.lnq), 1.0 / bins.variance
    weight = weight * (q - weight @ q / weight.sum())
    precision = 1.0 + weight @ q
    return np.asarray(log_ndtr(-residual @ weight / math.sqrt(precision)))


@lru_cache
def _starting_points(number: int = 64) -> Array:
    """Return points that fill the prior evenly, up to 2 standard deviations.

    They are the multiples of g^-1 ... g^-6 modulo one, g^7 = g + 1 (Roberts 2018, quasirandom sequences).
    """
    from scipy.special import ndtri

    root = 1.0
    for _ in range(40):
        root = (1.0 + root) ** (1.0 / 7.0)
    steps = root ** -np.arange(1.0, 7.0)
    return np.asarray(ndtri(np.clip((0.5 + np.outer(np.arange(number), steps)) % 1.0, 0.02, 0.98)))


def _best(starts: Array, residual: Array, whitening: Array, number: int) -> Array:
    """Return the points with the least sums of squares, shape (hypotheses, kinds x number, 6).

    Parameters
    ----------
    starts : ndarray, shape (hypotheses, points, 6)
    residual : ndarray, shape (hypotheses, points, bins)
    whitening : ndarray, shape (kinds, bins, bins)
    number : int
        Of each kind of discrepancy.
    """
    white = residual @ whitening[:, None].transpose(0, 1, 3, 2)
    squares = np.square(white).sum(axis=3) + np.square(starts).sum(axis=2)
    best = np.argsort(squares, axis=2)[:, :, :number].transpose(1, 0, 2).reshape(len(starts), -1)
    return np.take_along_axis(starts, best[:, :, None], 1)


@dataclass(frozen=True)
class _Fit:
    """Some bins under several hypotheses, at points u whose six numbers have unit normal priors.

    Attributes
    ----------
    bins : Bins
    prior : ndarray, shape (2, 6)
        Ends of each of theta, or mean and deviation of its logarithm.
    form : ndarray of int, shape (hypotheses,)
    fixed : ndarray, shape (hypotheses, 6)
        Values of theta, NaN where it is free.
    """

    bins: Bins
    prior: Array
    form: Array
    fixed: Array

    def theta(self, u: Array) -> Array:
        """Return theta of points u, shape (hypotheses, points, 6)."""
        from scipy.special import ndtr

        low, high = self.prior
        theta = low + (high - low) * ndtr(u)
        theta[..., CORNER] = np.exp(theta[..., CORNER])
        for k in (SPREAD, NOISE, SHARPNESS):
            theta[..., k] = np.exp(low[k] + high[k] * u[..., k])
        theta = np.where(np.isnan(self.fixed[:, None]), theta, self.fixed[:, None])
        # p of (1). Of a corner with .2 the slope turns over 16 octaves; wider ones, with .01, gave 2 of 16
        # surfaces of white noise an exponent above .08
        difference = np.minimum(np.abs(theta[..., LONG_HURST] - theta[..., HURST]), 1.0)
        theta[..., SHARPNESS] = np.hypot(theta[..., SHARPNESS] * difference, 0.2)
        # a corner below half of 1 / s: an octave of waves between corner and blur shows H
        theta[..., CORNER] /= 1.0 + 2.0 * theta[..., SPREAD] * theta[..., CORNER]
        return theta

    def residual(self, u: Array) -> Array:
        """Return the logarithms of the bins less those expected, shape (hypotheses, points, bins)."""
        theta = self.theta(u)
        model = self.bins.log_power(theta.reshape(-1, theta.shape[-1]), self.form.repeat(u.shape[1]))[0]
        return np.asarray((self.bins.level - model).reshape(*u.shape[:2], -1))

    def linearised(self, u: Array, *, step: float = 1e-4) -> Array:
        """Return the residual and the derivatives of the expected logarithms by u, for a point u of each
        hypothesis, shape (hypotheses, 7, bins).

        The derivatives by theta are exact; those of theta by u are differences over a `step`.
        """
        points = self.theta(u[:, None] + step * np.eye(7, 6, -1))
        theta = points[:, 0]
        model, slopes = self.bins.log_power(theta, self.form, slopes=True)
        change = (points[:, 1:] - points[:, :1]) / step
        change[..., CORNER] /= np.maximum(theta[:, CORNER], 1e-300)[:, None]
        return np.concatenate([(self.bins.level - model)[:, None], change @ slopes], axis=1)

    def maxima(
        self,
        start: Array,
        whitening: Array,
        constants: Array,
        *,
        evaluations: int = 30,
        least_gain: float = 1e-3,
        longest: float = 2.0,
    ) -> tuple[Array, Array, Array]:
        """Return the maxima of the posterior near some starting points u, shape (hypotheses, points, 6).

        Damped Gauss-Newton steps (Levenberg and Marquardt), of all points together. Returned are u, the sum
        of the squares of the white residuals and of u, and half its second derivatives, without those of the
        model.

        Parameters
        ----------
        start : ndarray
            As many points for each kind of discrepancy, those of a kind beside each other.
        whitening, constants : ndarray, shape (kinds, bins, bins) and (kinds,)
            See `_whitening`.
        evaluations, least_gain : int, float
            Of a point; expected gain, times the share it would have, below which a point rests. With 150 and
            1e-6 in their place the ends of 306 intervals move by .01 of their width (median; .2 in one of
            100).
        longest : float
            Of a step.
        """
        shape, identity = start.shape, np.eye(start.shape[2])
        hypothesis, place = np.indices(shape[:2]).reshape(2, -1)
        kind = place // (shape[1] // len(whitening))
        trial = start.reshape(-1, shape[2])
        u, objective, active = trial.copy(), np.full(len(trial), np.inf), np.arange(len(trial))
        hessian, gradient = np.empty((*u.shape, shape[2])), np.empty(u.shape)
        damping, rejected = np.zeros(len(u)), np.zeros(len(u), dtype=np.int64)
        for _ in range(evaluations):
            at = hypothesis[active]
            rows = replace(self, form=self.form[at], fixed=self.fixed[at]).linearised(trial)
            rows = rows @ whitening[kind[active]].transpose(0, 2, 1)
            residual, jacobian = rows[:, 0], rows[:, 1:]
            total = np.square(residual).sum(axis=1) + np.square(trial).sum(axis=1)
            gain = objective[active] - total
            better = gain > 0.0
            now = active[better]
            u[now], objective[now] = trial[better], total[better]
            hessian[now] = jacobian[better] @ jacobian[better].transpose(0, 2, 1) + identity
            gradient[now] = (jacobian[better] @ residual[better, :, None])[:, :, 0] - trial[better]
            damping[active] = np.where(better, 0.2 * damping[active], np.maximum(0.1, 5.0 * damping[active]))
            rejected[active] = np.where(better, 0, rejected[active] + 1)
            active = active[rejected[active] < 6]
            damped = hessian[active] * (1.0 + damping[active, None, None] * identity)
            move = np.linalg.solve(damped, gradient[active][:, :, None])[:, :, 0]
            gain = (move * gradient[active]).sum(axis=1)
            evidence = constants[kind] - 0.5 * objective
            share = np.exp(np.minimum(evidence[active] - evidence.max() + gain, 0.0))
            is_far = gain * share > least_gain
            active, move = active[is_far], move[is_far]
            if active.size == 0:
                break
            move *= longest / np.maximum(np.abs(move).max(axis=1, keepdims=True), longest)
            trial = u[active] + move
        return u.reshape(shape), objective.reshape(shape[:2]), hessian.reshape(*shape, shape[2])
