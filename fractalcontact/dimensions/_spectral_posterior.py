"""Posterior distribution of the Hurst exponent, given the mean power of bins of modes.

The expected power of a bin b is

    E_b = A { B_b sum_j w_j(H) M_bj(s, form) + nu^2 W_b },                                       (1)
    B = (1 + (q_0 / q)^(2 p))^((H_2 - H) / p),    p = k |H_2 - H|

with the Gaussians j of `_gaussian_mixture`: H is the exponent, s the spread of a blur, nu white noise over
the rms increment, q_0 the wavenumber beyond which long waves have the exponent H_2, k the sharpness of that
corner: 1 where two surfaces were added, 1 / (1 + H) of a Matern covariance, large of a sudden plateau. The
amplitude A has a flat prior in ln A, the others those of the constants below. Noise is absent with the
probability .5, a blur with .85, a corner with .88; blur and sampling take one of three forms
(`_gaussian_mixture.FORMS`). The logarithms of the bins are normal, and

    y_b = ln E_b + delta_b + eps_b,      eps: scatter of the modes in the bin                    (2)

where delta is what (1) does not hold: nothing; a process of standard deviation tau, correlated over an
octave; the fourth order in q of a filter that is no Gaussian; or a cut q_c beyond which the bins say
nothing, with a process that grows to it as (q / q_c)^2 (short waves) or (q_c / q)^2 (long waves). Each has a
prior probability (`_discrepancies`).

For each combination of nuisances and each kind of discrepancy the maximum is found by Gauss-Newton steps in
unit normal variables u (the maxima, where the model holds), and Laplace's method gives its evidence and a
normal distribution of u. The posterior of H is the sum of these normal distributions: no sampling, and
continuous in the heights.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base.jit import inner_kernel, kernel
from fractalcontact.dimensions._gaussian_mixture import FILTERED, FORMS, UNALIASED, Bins

Array = np.ndarray[Any, np.dtype[Any]]

HURST, SPREAD, NOISE, CORNER, LONG_HURST, SHARPNESS = range(6)  # theta
LOWEST, HIGHEST = 0.005, 0.995  # H

# Priors. Normal in ln nu: 95 % of instruments add .7 to 36 % of the rms increment over one spacing.
# With .8 in place of 1 the error under noise of 50 % is .12, not .02 (H = .8, 128 x 128 points);
# with 1.2 an exact interval of H = .5 is 1.4 times as wide.
_PRIOR_NOISE = math.log(0.05), 1.0
_PRIOR_SPREAD = 0.0, 0.8  # normal in ln s, spacings: instruments sample a blur at .2 to 5 spacings
_BLURRED = 0.15  # probability of a blur: with .5, 3 of 40 exact surfaces of 64 x 64 points were 5 bounds off
_LONG_HURSTS = -1.5, 1.2  # a Gaussian high-pass filter, a plateau (-1), any other self-affine surface
_PRIOR_SHARPNESS = 0.0, 0.7  # normal in ln k, about the sum of two surfaces: 95 % are .25 to 4
_SHORTEST_CORNER = 4.0  # spacings: two bins of waves beyond it show H
# probability of a corner. Of 160 sums each that are equal at a lag of 3 and of 8 spacings 124 and 138
# intervals hold H with .1, 130 and 141 with .12, 137 and 148 with .15; 40 exact intervals each at H .2, .5
# and .9 are .028, .041 and .061 wide with .1, .029 .042 .063 with .12, .032 .044 .065 with .15
_BENT = 0.12
_TAUS = 0.02, 0.05, 0.12, 0.3, 0.8  # geometric, from 2 % to a factor
_OCTAVE = math.log(2.0)


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

    @property
    def is_blurred(self) -> bool:
        """Whether the spread of a blur is fitted."""
        return math.isnan(self.theta[SPREAD])

    @property
    def is_noisy(self) -> bool:
        """Whether white noise is fitted."""
        return math.isnan(self.theta[NOISE])

    @property
    def is_bent(self) -> bool:
        """Whether long waves have another exponent."""
        return math.isnan(self.theta[CORNER])


@dataclass(frozen=True)
class Discrepancy:
    """What the model does not hold: standard deviation of each bin, and the bins that count.

    Attributes
    ----------
    scatter : ndarray, shape (bins,)
    inside : ndarray of bool, shape (bins,)
    prior : float
    """

    scatter: Array
    inside: Array
    prior: float


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

    def quantile(self, share: float) -> float:
        """Return a quantile of H."""
        return float(
            mixture_quantile(share, *(each.ravel() for each in (self.share, self.centre, self.scale)))
        )

    def log_density(self, u: Array) -> Array:
        """Return the logarithm of the density of u."""
        share, centre, scale = (each.ravel()[:, None] for each in (self.share, self.centre, self.scale))
        density = np.exp(-0.5 * np.square((u - centre) / scale)) / scale
        return np.asarray(np.log((share * density).sum(axis=0) + 1e-300) - 0.5 * math.log(2.0 * math.pi))

    @property
    def most_probable(self) -> tuple[Hypothesis, Discrepancy, Array]:
        """Hypothesis, discrepancy and theta of the largest share."""
        m, k = np.unravel_index(int(np.argmax(self.share)), self.share.shape)
        return self.hypotheses[m], self.discrepancies[k], self.theta[m, k]

    def probability(self, name: str) -> float:
        """Return the probability of a property of the hypotheses, as "is_blurred"."""
        return float(
            sum(s.sum() for s, h in zip(self.share, self.hypotheses, strict=True) if getattr(h, name))
        )

    def mean(self, parameter: int, name: str) -> float:
        """Return the mean of a parameter over the hypotheses with the property."""
        chosen = np.array([getattr(h, name) for h in self.hypotheses])
        return float(
            np.sum(self.share[chosen] * self.theta[chosen, :, parameter]) / np.sum(self.share[chosen])
        )


def mixture_quantile(share: float, shares: Array, centre: Array, scale: Array) -> Array:
    """Return a quantile of H whose u has a sum of normal distributions, those along the last axis."""
    from scipy.special import ndtr

    low, high = np.full(centre.shape[:-1], -8.0), np.full(centre.shape[:-1], 8.0)  # of u
    for _ in range(50):
        middle = 0.5 * (low + high)
        below = np.sum(shares * ndtr((middle[..., None] - centre) / scale), axis=-1)
        low, high = np.where(below < share, middle, low), np.where(below < share, high, middle)
    return np.asarray(LOWEST + (HIGHEST - LOWEST) * ndtr(low))


def joint_quantiles(
    posteriors: Sequence[Posterior], shares: Sequence[float], points: int = 2001, zooms: int = 5
) -> list[float]:
    """Return quantiles of the H that independent surfaces have in common, each with nuisances of its own.

    Their product has the prior of u, the unit normal distribution, once. The grid of `points` is narrowed
    `zooms` times to where its logarithm is within 20 of the highest.
    """
    from scipy.special import ndtr

    low, high = -8.0, 8.0
    for _ in range(zooms):
        u = np.linspace(low, high, points)
        log = sum(each.log_density(u) for each in posteriors) + 0.5 * (len(posteriors) - 1) * np.square(u)
        near = np.flatnonzero(log > log.max() - 20.0)
        low, high = u[max(near[0] - 1, 0)], u[min(near[-1] + 1, u.size - 1)]
    density = np.exp(log - log.max())
    found = np.interp(np.asarray(shares) * density.sum(), np.cumsum(density) - 0.5 * density, u)
    return [LOWEST + (HIGHEST - LOWEST) * float(ndtr(each)) for each in found]


def hypotheses(spread: float | None, noise: float | None, background: float) -> list[Hypothesis]:
    """Return the combinations of nuisances; known values of `spread` (spacings) and `noise` are not fitted.

    `background` is the noise that is known to be there, as of rounding, over the rms increment.
    """
    nan = math.nan
    found = []
    for form, is_blurred, is_noisy, is_bent in itertools.product(FORMS, *[(False, True)] * 3):
        if (is_blurred and spread is not None) or (is_noisy and noise is not None):
            continue
        prior = FORMS[form].prior_blurred if is_blurred or spread else FORMS[form].prior
        if prior == 0.0:
            continue
        if spread is None:
            prior *= _BLURRED if is_blurred else 1.0 - _BLURRED
        prior *= 1.0 if noise is not None else 0.5
        prior *= _BENT if is_bent else 1.0 - _BENT
        blur = nan if is_blurred else spread or 0.0
        white = nan if is_noisy else math.hypot(noise or 0.0, background)
        bend = (nan, nan, nan) if is_bent else (0.0, 0.0, 1.0)
        found.append(Hypothesis(form, (nan, blur, white, *bend), math.log(prior)))
    return found


def posterior(
    bins: Bins,
    *,
    spread: float | None = None,
    noise: float | None = None,
    background: float = 0.0,
    pilot_spread: float = 0.0,
    is_pilot: bool = False,
    is_window: bool = False,
    attempts: int = 5,
) -> Posterior:
    """Return the posterior of H.

    Parameters
    ----------
    bins : Bins
    spread, noise : float, optional
        Of a known point spread function (spacings), of known white noise (rms increments).
    background : float
        See `hypotheses`.
    pilot_spread : float
        A first estimate of the spread, for the scatter of the fourth order.
    is_pilot : bool
        For a first estimate of the spectrum: with fewer kinds of discrepancy.
    is_window : bool
        The waves were chosen beforehand: without corners and cuts.
    attempts : int
        Maxima that are looked for without a discrepancy.
    """
    chosen = hypotheses(spread, noise, background)
    kinds = _discrepancies(bins, pilot_spread)
    if is_window:
        kinds = [kind for kind in kinds if kind.inside.all()]
        chosen = [hypothesis for hypothesis in chosen if not hypothesis.is_bent]
    if is_pilot:
        kinds = [kind for kind in kinds if kind.inside[0] and kind.scatter[0] in (0.0, _TAUS[2])]
    corners = math.log(0.5 * np.pi / bins.extent), math.log(2.0 * np.pi / _SHORTEST_CORNER)
    ranges = (LOWEST, HIGHEST), _PRIOR_SPREAD, _PRIOR_NOISE, corners, _LONG_HURSTS, _PRIOR_SHARPNESS
    prior = np.array(ranges).T
    whitening, constants = zip(*(_whitening(kind, bins) for kind in kinds), strict=True)
    of_kind = np.r_[np.zeros(attempts - 1, dtype=int), np.arange(len(kinds))]
    shape = len(chosen), of_kind.size
    evidence, centre, scale = np.full(shape, -np.inf), np.zeros(shape), np.ones(shape)
    theta = np.zeros((*shape, len(ranges)))
    _maxima(
        _starting_points(),
        np.array([hypothesis.form for hypothesis in chosen]),
        np.array([hypothesis.theta for hypothesis in chosen]),
        prior,
        bins.tables,
        bins.nodes,
        bins.axes,
        bins.t,
        bins.white,
        bins.lnq,
        bins.level,
        np.stack(whitening),
        of_kind,
        evidence,
        centre,
        scale,
        theta,
    )
    evidence += (
        np.array([hypothesis.log_prior for hypothesis in chosen])[:, None] + np.array(constants)[of_kind]
    )
    share = np.exp(evidence - evidence.max())
    return Posterior(share / share.sum(), centre, scale, theta, chosen, [kinds[k] for k in of_kind])


def _discrepancies(
    bins: Bins,
    pilot_spread: float,
    *,
    holds: float = 0.8,
    uncut: float = 0.8,
    at_cut: float = 0.5,
    least_octaves: float = 2.5,
    most_octaves: float = 3.5,
    fourth_order: float = 0.1,
) -> list[Discrepancy]:
    """Return the kinds of discrepancy with their prior probabilities, which sum to one.

    Parameters
    ----------
    bins : Bins
    pilot_spread : float
    holds : float
        Probability that (1) holds without a process; with .8 exact intervals are as narrow as without sums.
    uncut : float
        Probability that there is no cut: of .5 and .8, for both, the narrower interval of a blur of 1.
    at_cut : float
        Standard deviation of the logarithm of the power at a cut.
    least_octaves : float
        Octaves between cuts, to tell an exponent from a corner.
    most_octaves : float
        Octaves beyond a cut: filters of up to ten points, a levelled tenth of the extent.
    fourth_order : float
        Of (s q)^4: the fourth cumulant of a mean over a box has .125.
    """
    octaves = bins.lnq / _OCTAVE
    everything = np.ones(octaves.size, dtype=bool)
    lowest, highest = float(octaves.min()), float(octaves.max())
    cuts: list[tuple[Array, Array]] = []
    # between rings of bins; those of one ring differ by less than a tenth of an octave
    ends = np.sort(octaves)
    ends = ends[np.flatnonzero(np.diff(ends) > 0.1)]
    short_cuts = ends[ends > max(lowest + least_octaves, highest - most_octaves)]
    cuts += [(at_cut * 4.0 ** (octaves - cut), octaves <= cut) for cut in short_cuts]
    for cut in ends[ends < min(highest - least_octaves, lowest + most_octaves)][::2]:
        cuts.append((at_cut * 4.0 ** (cut - octaves), octaves > cut))
    cuts = [(scatter, inside) for scatter, inside in cuts if inside.sum() >= 4 and not inside.all()]
    fourth = fourth_order * np.minimum(pilot_spread * np.exp(bins.lnq), 3.0) ** 4
    no_cut = uncut if cuts else 1.0
    has_fourth = bool(fourth.max() > 0.01)
    none = holds * (0.5 if has_fourth else 1.0)
    kinds = [Discrepancy(np.zeros(octaves.size), everything, no_cut * none)]
    kinds += [
        Discrepancy(np.full(octaves.size, tau), everything, no_cut * (1.0 - holds) / len(_TAUS))
        for tau in _TAUS
    ]
    if has_fourth:
        kinds.append(Discrepancy(fourth, everything, no_cut * none))
    return kinds + [Discrepancy(scatter, inside, (1.0 - uncut) / len(cuts)) for scatter, inside in cuts]


def _whitening(kind: Discrepancy, bins: Bins, flat: float = 1e3) -> tuple[Array, float]:
    """Return the matrix that makes the bins of (2) white, zero for those that do not count, and its log
    density.

    A bin beyond a cut has the expected logarithm of the density of a deviation of a factor of e. `flat` is
    the variance of ln A: two deviations are a factor of e^63.
    """
    octaves = bins.lnq / _OCTAVE
    inside = np.ix_(kind.inside, kind.inside)
    correlation = np.exp(-np.abs(octaves[:, None] - octaves))
    covariance = np.diag(bins.variance) + np.outer(kind.scatter, kind.scatter) * correlation
    lower = np.linalg.cholesky(covariance[inside] + flat)
    whitening = np.zeros(covariance.shape)
    # above the diagonal the library leaves zeros or rounding, in one process not as in another
    whitening[inside] = np.tril(np.linalg.inv(lower))
    outside = bins.variance[~kind.inside] + 1.0
    density = -np.log(np.diag(lower)).sum() - 0.5 * np.sum(np.log(outside) + 1.0)
    return whitening, math.log(kind.prior) + float(density)


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


# numba caches a kernel by its own file, so those that call each other stand in one


@kernel
def tail(hurst: float, t: float, spread: float, form: int, axes: int) -> float:
    """Return the sum of all Gaussians from the last t on, over its own term."""
    if form == UNALIASED:
        return float(1.0 / (1.0 - 2.0 ** -(hurst + 0.5 * axes)))
    if form == FILTERED or spread == 0.0:
        return float(1.0 / (1.0 - 2.0**-hurst))
    blur = 4.0 * t * spread**2
    total, weight, ratio, narrower = 0.0, 1.0, 2.0**-hurst, 1.0
    for _ in range(40):
        term = weight * ((1.0 + blur) / (1.0 + blur * narrower)) ** (0.5 * axes)
        total += term
        if term < 1e-12:
            break
        weight *= ratio
        narrower *= 2.0
    return total


@kernel
def bin_power(
    theta: Array,
    form: int,
    axes: int,
    table: Array,
    nodes: Array,
    t: Array,
    white: Array,
    lnq: Array,
    out: Array,
) -> None:
    """Fill the logarithm of the expected power of each bin, (1); table (spread, bin, t)."""
    hurst, bins = theta[0], out.size
    last = t.size - 1
    ratio = 2.0**-hurst
    # weights of unit rms increment over one spacing, and their last one with all shorter Gaussians
    unit = t[0] ** (1.0 - hurst) * 2.0 ** (hurst - 1.0) / (1.0 - 2.0 ** (hurst - 1.0))
    weight = t[0] ** -hurst
    for j in range(t.size):
        unit += weight * -math.expm1(-t[j])
        weight *= ratio
    unit += weight / (1.0 - ratio)
    weights = np.empty(t.size)
    weight = 0.5 * t[0] ** -hurst / unit
    for j in range(t.size):
        weights[j] = weight
        weight *= ratio
    weights[last] *= tail(hurst, t[last], theta[1], form, axes)
    # between the spreads of the table the logarithm is a cubic; the power is even in s
    place, last_place = math.asinh(theta[1] / nodes[0]) / nodes[1], table.shape[0] - 2.0
    place = place if place < last_place else last_place
    i = int(place) if place < last_place - 1.0 else table.shape[0] - 3
    f = place - i
    a0, a1 = -f * (f - 1.0) * (f - 2.0) / 6.0, (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0
    a2, a3 = -(f + 1.0) * f * (f - 2.0) / 2.0, (f + 1.0) * f * (f - 1.0) / 6.0
    below, here, above, beyond = table[abs(i - 1)], table[i], table[i + 1], table[i + 2]
    for b in range(bins):
        p0, p1, p2, p3 = 0.0, 0.0, 0.0, 0.0
        if theta[1] == 0.0:
            for j in range(t.size):
                p1 += weights[j] * here[b, j]
            power = p1
        else:
            for j in range(t.size):
                p0 += weights[j] * below[b, j]
                p1 += weights[j] * here[b, j]
                p2 += weights[j] * above[b, j]
                p3 += weights[j] * beyond[b, j]
            # where a blur leaves nothing, a slope that no surface has
            least = 1e-200 * math.exp(-40.0 * lnq[b])
            logarithm = a0 * math.log(p0 + least) + a1 * math.log(p1 + least)
            power = math.exp(logarithm + a2 * math.log(p2 + least) + a3 * math.log(p3 + least))
        if theta[3] > 0.0:
            x = 2.0 * theta[5] * (math.log(theta[3]) - lnq[b])
            bend = x if x > 30.0 else math.log1p(math.exp(x))
            power *= math.exp((theta[4] - hurst) / theta[5] * bend)
        out[b] = math.log(power + theta[2] * theta[2] * white[b])


@inner_kernel
def _parameters(u: Array, fixed: Array, prior: Array, theta: Array) -> None:
    """Fill theta from unit normal numbers, where it is not fixed."""
    low, high = prior[0], prior[1]
    for k in range(u.size):
        if not math.isnan(fixed[k]):
            theta[k] = fixed[k]
        elif k == 1 or k == 2 or k == 5:
            theta[k] = math.exp(low[k] + high[k] * u[k])
        else:
            value = low[k] + (high[k] - low[k]) * 0.5 * math.erfc(-u[k] / math.sqrt(2.0))
            theta[k] = math.exp(value) if k == 3 else value
    p = theta[5] * abs(theta[4] - theta[0])  # of (1)
    theta[5] = p if p > 0.01 else 0.01
    if theta[3] > 0.0 and theta[1] > 0.0:  # an octave of waves between corner and blur shows the exponent H
        theta[3] = 0.5 / theta[1] if 0.5 / theta[1] < theta[3] else theta[3]


@inner_kernel
def _whitened(whitening: Array, level: Array, model: Array, out: Array) -> float:
    """Fill the white residuals of the bins; return the sum of their squares."""
    total = 0.0
    for a in range(level.size):
        value = 0.0
        for b in range(level.size):
            value += whitening[a, b] * (level[b] - model[b])
        out[a] = value
        total += value * value
    return total


@inner_kernel
def _factorise(matrix: Array, lower: Array) -> float:
    """Fill the Cholesky factor; return its log determinant, half of that of the matrix."""
    logarithm = 0.0
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, j] = math.sqrt(1e-300 if value < 1e-300 else value)
            else:
                lower[i, j] = value / lower[j, j]
        logarithm += math.log(lower[i, i])
    return logarithm


@inner_kernel
def _solve(lower: Array, right: Array, out: Array) -> None:
    """Solve with a Cholesky factor."""
    size = right.size
    for i in range(size):
        value = right[i]
        for k in range(i):
            value -= lower[i, k] * out[k]
        out[i] = value / lower[i, i]
    for i in range(size - 1, -1, -1):
        value = out[i]
        for k in range(i + 1, size):
            value -= lower[k, i] * out[k]
        out[i] = value / lower[i, i]


@inner_kernel
def _product(a: Array, b: Array) -> float:
    """Return the scalar product."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@inner_kernel
def _copy(source: Array, target: Array) -> None:
    """Copy the elements."""
    for i in range(source.size):
        target[i] = source[i]


@inner_kernel
def _misfit(
    u: Array,
    theta: Array,
    model: Array,
    residual: Array,
    whitening: Array,
    level: Array,
    fixed: Array,
    prior: Array,
    form: int,
    axes: int,
    table: Array,
    nodes: Array,
    t: Array,
    white: Array,
    lnq: Array,
) -> float:
    """Fill theta, the logarithms of the bins and their white residuals; return the sum of squares with u."""
    _parameters(u, fixed, prior, theta)
    bin_power(theta, form, axes, table, nodes, t, white, lnq, model)
    return _whitened(whitening, level, model, residual) + _product(u, u)


# Loops over elements in place of assignments, sums and extremes of arrays: with those Numba compiles the
# texts of their error messages too, and the first estimate took twice the processor time.
@kernel
def _maxima(
    starts: Array,
    forms: Array,
    fixed: Array,
    prior: Array,
    tables: Array,
    nodes: Array,
    axes: int,
    t: Array,
    white: Array,
    lnq: Array,
    level: Array,
    whitening: Array,
    kinds: Array,
    evidence: Array,
    centre: Array,
    scale: Array,
    theta: Array,
) -> None:
    """Fill for each hypothesis and maximum the log evidence, mean and deviation of u_0, and theta.

    `kinds`: of discrepancy of each maximum; the first one has several, those of the others lie near its best.
    """
    p, bins, steps = fixed.shape[1], level.size, 12
    values = np.empty(p)
    models = np.empty((starts.shape[0], bins))
    model, shifted, residual, trial_residual = np.empty(bins), np.empty(bins), np.empty(bins), np.empty(bins)
    jacobian = np.empty((p, bins))
    hessian, lower, damped = np.empty((p, p)), np.empty((p, p)), np.empty((p, p))
    gradient, move, u, trial = np.empty(p), np.empty(p), np.empty(p), np.empty(p)
    before, totals, optima = np.empty(p), np.empty(starts.shape[0]), np.empty((kinds.size, p))
    for m in range(fixed.shape[0]):
        held, table, form, free = fixed[m], tables[forms[m]], forms[m], 0
        problem = (held, prior, form, axes, table, nodes, t, white, lnq)
        for i in range(p):
            free += math.isnan(held[i])
        number = starts.shape[0] if free > 1 else starts.shape[0] // 4
        for d in range(number):
            _parameters(starts[d], held, prior, values)
            bin_power(values, form, axes, table, nodes, t, white, lnq, models[d])
        best = math.inf
        for c in range(kinds.size):
            k = kinds[c]
            if k == 0 and c > 0 and free <= 2:
                continue
            white_k = whitening[k]
            for d in range(number if c == 0 or k > 0 else 0):  # each start once among those of the first kind
                totals[d] = math.inf
                if k == 0 or d % 4 == 0:
                    totals[d] = _whitened(white_k, level, models[d], residual)
            start = 0
            for d in range(number):
                if totals[d] < totals[start]:
                    start = d
            totals[start] = math.inf
            damping, objective = 0.0, math.inf
            for attempt in range(2 if k > 0 else 1):
                for i in range(p):
                    trial[i] = starts[start, i] if math.isnan(held[i]) else 0.0
                if attempt == 1:
                    _copy(before, trial)
                total = _misfit(trial, values, shifted, trial_residual, white_k, level, *problem)
                if attempt == 0 or total < objective:
                    objective = total
                    _copy(trial, u)
                    _copy(shifted, model)
                    _copy(trial_residual, residual)
            for _step in range(steps):
                for i in range(p):
                    for b in range(bins):
                        jacobian[i, b] = 0.0
                    if math.isnan(held[i]):
                        _copy(u, trial)
                        trial[i] += 1e-4
                        _parameters(trial, held, prior, values)
                        bin_power(values, form, axes, table, nodes, t, white, lnq, shifted)
                        _whitened(white_k, shifted, model, jacobian[i])
                        for b in range(bins):
                            jacobian[i, b] *= 1e4
                for i in range(p):
                    gradient[i] = _product(jacobian[i], residual) - u[i]
                    for j in range(p):
                        hessian[i, j] = _product(jacobian[i], jacobian[j]) + (1.0 if i == j else 0.0)
                gain = 0.0
                for _ in range(6):
                    for i in range(p):
                        for j in range(p):
                            damped[i, j] = hessian[i, j] * (1.0 + damping if i == j else 1.0)
                    _factorise(damped, lower)
                    _solve(lower, gradient, move)
                    longest = 0.7
                    for i in range(p):
                        if abs(move[i]) > longest:
                            longest = abs(move[i])
                    for i in range(p):
                        trial[i] = u[i] + move[i] * (0.7 / longest)
                    total = _misfit(trial, values, shifted, trial_residual, white_k, level, *problem)
                    if total < objective:
                        gain = objective - total
                        objective = total
                        _copy(trial, u)
                        _copy(shifted, model)
                        _copy(trial_residual, residual)
                        damping *= 0.2
                        break
                    damping = max(0.1, 5.0 * damping)
                if gain < 1e-3:
                    break
            half_log = _factorise(hessian, lower)
            for i in range(p):
                gradient[i] = 1.0 if i == 0 else 0.0
            _solve(lower, gradient, move)
            evidence[m, c] = -0.5 * objective - half_log
            centre[m, c], scale[m, c] = u[0], math.sqrt(move[0])
            _parameters(u, held, prior, theta[m, c])
            _copy(u, optima[c])
            for other in range(c if k == 0 else 0):  # found before
                distance = 0.0
                for i in range(p):
                    distance += (optima[other, i] - u[i]) ** 2
                if distance < 1.0:  # one maximum: with .1 and 2 widths are the same within 6 %
                    evidence[m, c] = -math.inf
            if k > 0 or objective < best:
                best = objective
                _copy(u, before)
