"""Modes of a surface: a first fit to the tapered surface, and the cosine modes that count.

The tapered surface, or its middle, has Fourier modes into which no edge leaks. Their posterior is the pilot,
the expected power of each mode. Their levels by azimuth show by which metric increments count lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import detrended
from fractalcontact.base.spectra import window_weights
from fractalcontact.dimensions._diagnosis import unevenness
from fractalcontact.dimensions._gaussian_mixture import Bins, Lattice
from fractalcontact.dimensions._metric_spectrum import LARGEST_LOG_RATIO, metric_of, squared_length
from fractalcontact.dimensions._mode_bins import (
    EMPTY,
    FALSE_ALARM,
    LEAST,
    LEAST_BINS,
    SETTLED,
    TAPERED,
    Filling,
    Levels,
    clear_modes,
    expected_power,
    filling_ratio,
    lay,
    levels_by_azimuth,
    make_bins,
    rms_increment,
    significant_share,
    single_waves,
    whitened,
)
from fractalcontact.dimensions._spectral_posterior import (
    HURST,
    LOWEST,
    RATIO_DEVIATION,
    SPREAD,
    Known,
    posterior,
)
from fractalcontact.dimensions._surface_input import Surface, middle_slices
from fractalcontact.dimensions._waves import LARGEST_CROP

# Log ratio of lengths up to which cosine modes serve under an oblique lay. With 1.5 to 1 (.41) intervals hold
# H, with two to five times the error of the metric; with 2 to 1 at 15 degrees they miss H = .8 by .34. The
# scan lines of a map of an AFM have .24
NEAR_ISOTROPY = 0.3


@dataclass(frozen=True)
class FirstFit:
    """First fit to a surface.

    Attributes
    ----------
    heights, filled : ndarray
        Without a plane and an unobserved rim, in rms increments over one x spacing; without gaps.
    filling : Filling, optional
        What filled the gaps, if there are any.
    scale : float
        Rms increment of the scaled heights of the surface.
    lattice : Lattice
        Of the cosine modes, or of the Fourier modes of a whole periodic surface.
    spread : float, optional
        Of a known blur, in x spacings.
    theta : ndarray
        Parameters of the model, `_spectral_posterior`.
    form : int
        Of the sampling and the blur.
    log_ratio : ndarray, shape (2,)
        Components (u, v) of `metric_of`; the stretch of the lattice is exp(u).
    is_oblique : bool
        The lay is oblique to the axes: cosine modes do not know the sign of an azimuth.
    exact : ndarray
        Parameters of the most probable exact surface: without departures, but with a known blur, of the form
        ALIASED.
    """

    heights: Array
    filled: Array
    filling: Filling | None
    scale: float
    lattice: Lattice
    spread: float | None
    theta: Array
    form: int
    log_ratio: Array
    is_oblique: bool
    exact: Array

    @cached_property
    def modes(self) -> ModeFit | None:
        """Cosine modes, or Fourier modes of a periodic surface; None if too few count.

        A stretch is corrected until the last correction was less than a factor of 1.2, mostly once. Where the
        spacings differ errors of H are then .01 to .06 (.01 to .12 with 1.8 in its place). Gaps are corrected
        until the correction is `SETTLED`: once or twice with 10 % of points missing, with 70 % four to six
        times.
        """
        lattice, theta, form = self.lattice, self.theta, self.form
        if theta[HURST] < LOWEST:  # no density is finite, as where the spacings differ by orders
            return None
        filling, modes = self.filling, lattice.power(self.filled)
        correction: Array | float = 1.0
        information: Array | float = 1.0
        pilot, is_settled = expected_power(lattice, theta, form), False
        for left in range(12, 0, -1):  # up to 7 were needed
            clean = expected_power(lattice, theta, form, edges=False)
            sharp = np.where(np.arange(theta.size) == SPREAD, 0.0, theta)
            unblurred = expected_power(lattice, sharp, form, edges=False) if theta[SPREAD] > 0.0 else clean
            keep = clear_modes(pilot, clean, unblurred)
            if filling is not None and not is_settled:
                correction = filling_ratio(lattice, pilot, filling)
                information = float(np.mean(filling.observed)) ** 2 * np.minimum(1.0, correction)
            power = modes if filling is None else modes / correction
            keep &= power > EMPTY * pilot
            if not keep.any():
                return None
            ratio, clear = whitened(lattice, power, pilot, keep), keep
            keep = clear & ~single_waves(lattice, ratio, clear)
            levels = levels_by_azimuth(lattice, ratio, keep)
            level = lay(lattice, levels)
            if is_settled or not keep.any():  # of a narrow band single waves may be all
                break
            now = np.array([math.log(lattice.stretch), 0.0])
            uv, _, share = log_ratio(levels, now, levels.slope(unblurred), deviation=RATIO_DEVIATION)
            stretch = math.exp(share * uv[0])
            if filling is None and lattice.stretch == stretch == 1.0:
                break
            if filling is not None and np.count_nonzero(keep) >= LEAST * LEAST_BINS:
                bins = make_bins(lattice, power / level, pilot, keep, information=information, is_pilot=True)
                hypothesis, _, theta = posterior(bins, Known(self.spread), is_pilot=True).most_probable
                form = hypothesis.form
            # below `SETTLED` up to a factor of 1.2
            stretched = abs(math.log(stretch / lattice.stretch)) / 6.0
            lattice = lattice if stretch == lattice.stretch else replace(lattice, stretch=stretch)
            before, pilot = pilot, expected_power(lattice, theta, form)
            change = np.log(pilot / before)
            change = (change - change[keep].mean()) * np.log(correction)
            is_settled = left == 2 or bool(max(stretched, np.abs(change[keep]).max()) < SETTLED)
        information = information / unevenness(self.heights)
        waves = 1.0 - float(ratio[keep].sum() / ratio[clear].sum())
        return ModeFit(lattice, power / level, pilot, keep, information, theta, form, waves)


@dataclass(frozen=True)
class ModeFit:
    """Modes of a surface and their first fit.

    Attributes
    ----------
    lattice : Lattice
    power : ndarray
        Squared modes, in squared rms increments, corrected for gaps and for the lay.
    pilot : ndarray
        Expected power of the first fit.
    keep : ndarray of bool
        Modes that count.
    information : float or ndarray
    theta : ndarray
    form : int
    waves : float
        Share of the power over the pilot that is in single waves.
    """

    lattice: Lattice
    power: Array
    pilot: Array
    keep: Array
    information: Array | float
    theta: Array
    form: int
    waves: float

    def bins(self, keep: Array) -> Bins:
        """Return the bins of some of the modes."""
        return make_bins(self.lattice, self.power, self.pilot, keep, information=self.information)


def first_fit(surface: Surface, spread: float | None = None) -> FirstFit | None:
    """Fit the tapered surface, or its middle; None if it has too few points. `spread`: of a known blur."""
    from scipy.special import chdtri

    heights = _without_rim(surface.heights)
    observed = np.isfinite(heights)
    filling = None if observed.all() else Filling(observed)
    if min(heights.shape[-surface.axes :]) < 4:
        return None
    lattice = Lattice(observed.shape, surface.plane_spacing, all(surface.grid.periodic) and filling is None)
    if lattice.periodic:
        heights = heights - heights[observed].mean()
    else:
        heights = detrended(heights, 1)[0]
    scale = rms_increment(heights)
    heights /= scale
    filled = heights if filling is None else filling(heights)
    torus, power = _tapered(filled, lattice, observed)
    information = 1.0 if torus is lattice else TAPERED
    pilot = torus.q ** (-1.0 - torus.axes)
    inside = power > EMPTY * float(np.max(power / pilot)) * pilot
    keep = inside & (torus.q > 4.0 * 2.0 * np.pi / torus.longest)
    if np.count_nonzero(keep) < LEAST * LEAST_BINS:
        keep = inside if np.count_nonzero(inside) >= LEAST * LEAST_BINS else np.ones(keep.shape, dtype=bool)
    levels = levels_by_azimuth(torus, whitened(torus, power, pilot, keep), keep)
    uv, variance, share = log_ratio(levels, np.zeros(2), -1.0 - torus.axes, information)
    shrunk = share * uv
    torus = replace(torus, stretch=math.exp(shrunk[0]))
    y, x = torus.wavenumbers
    pilot = np.hypot(y[:, None] / torus.stretch, x) ** (-1.0 - torus.axes)
    bins = make_bins(torus, power, pilot, keep, is_tapered=information == TAPERED, is_pilot=True)
    found = posterior(bins, Known(spread), is_pilot=True)
    hypothesis, _, theta = found.most_probable
    # levels follow the log ratio times the slope, which was assumed
    of_slope = 0.5 * (1.0 + torus.axes) / (1.0 + theta[HURST])
    shrunk *= min(of_slope, LARGEST_LOG_RATIO / max(math.hypot(*shrunk), 1e-300))
    is_off_axes = bool(uv[1] ** 2 > float(chdtri(1, FALSE_ALARM)) * variance[1, 1])
    is_oblique = is_off_axes and not lattice.periodic and of_slope * math.hypot(*uv) > NEAR_ISOTROPY
    lattice = replace(lattice, stretch=torus.stretch)
    _, _, exact = found.peak(0)
    return FirstFit(
        heights, filled, filling, scale, lattice, spread, theta, hypothesis.form, shrunk, is_oblique, exact
    )


def _tapered(heights: Array, lattice: Lattice, observed: Array) -> tuple[Lattice, Array]:
    """Return the lattice of the Fourier modes of the tapered surface, or of its middle, and their power.

    The middle of a large surface serves if most of it was observed. A whole periodic surface needs no taper.
    """
    middle = middle_slices(heights.shape, LARGEST_CROP ** (3 - lattice.axes))
    is_part = observed[middle].size < observed.size and bool(observed[middle].mean() > 0.5)
    if lattice.periodic and not is_part:
        return lattice, lattice.power(heights)
    heights = heights[middle] if is_part else heights
    if lattice.axes == 2:  # offsets of rows and columns are in none of the modes
        heights = heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True)
    tapers = [window_weights(n, None if n == 1 else "hann") for n in heights.shape]
    torus = Lattice((heights.shape[0], heights.shape[1]), lattice.spacing, True)
    return torus, torus.power(heights * (tapers[0][:, None] * tapers[1]))


def log_ratio(
    levels: Levels, before: Array, slope: float, information: float = 1.0, *, deviation: float = math.inf
) -> tuple[Array, Array, float]:
    """Return the log ratio of lengths (u, v) that levels by azimuth show.

    The power of waves of one length is (q' M^-1 q)^(slope / 2) of their azimuth, M being `metric_of` (u, v).
    Gauss-Newton steps find the least chi square, that of the prior included. Cosine modes leave v at zero.

    Parameters
    ----------
    levels : Levels
    before : ndarray, shape (2,)
        Log ratio of the spectrum by which the power was divided.
    slope : float
        Of the logarithm of the power over that of the wavenumber.
    information : float
        Of a mode.
    deviation : float
        Of the prior of u and v. Where the slope is small, as on a plateau, levels tell little of lengths. The
        first fit, of an assumed slope, has none: with one `directions` called 3 in place of 1 of 6 isotropic
        surfaces without short waves anisotropic.

    Returns
    -------
    log_ratio : ndarray, shape (2,)
    variance : ndarray, shape (2, 2)
        Its covariance.
    share : float
        By which it is to be shrunk, as its gain in chi square is beyond chance.
    """
    weight, prior = information * levels.information, deviation**-2.0
    known = weight > 0.0
    free = 1 + bool(np.any(levels.azimuth[known] < 0.0))
    uv, variance = before.copy(), np.zeros((2, 2))
    if np.count_nonzero(known) <= free + 1:  # a profile has one
        return np.zeros(2), variance, 0.0

    sine, cosine = np.sin(levels.azimuth), np.cos(levels.azimuth)

    def logs(uv: Array) -> Array:
        values = 0.5 * slope * np.log(squared_length(metric_of(*-uv), sine, cosine))
        return np.asarray(values - weight @ values / weight.sum())

    target = levels.level + logs(before)
    for _ in range(30):  # 2 to 10 are needed; of 64 x 64 points under a lay of 8 to 1 some do not end
        here = logs(uv)
        columns = np.stack([(logs(uv + move) - here) / 1e-4 for move in 1e-4 * np.eye(2)[:free]], axis=1)
        curvature = (weight[:, None] * columns).T @ columns
        variance[:free, :free] = np.linalg.pinv(curvature + prior * np.eye(free))
        step = variance[:, :free] @ (columns.T @ (weight * (target - here)) - prior * uv[:free])
        uv = uv + step / max(1.0, math.hypot(*step))
        uv = uv / max(1.0, math.hypot(*uv) / LARGEST_LOG_RATIO)
        if math.hypot(*step) < 1e-4:
            break
    gain = float(weight @ (np.square(target) - np.square(target - logs(uv))) - prior * uv @ uv)
    return uv, variance, significant_share(gain, free)


def _without_rim(heights: Array) -> Array:
    """Return heights without the outer rows and columns of which nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
