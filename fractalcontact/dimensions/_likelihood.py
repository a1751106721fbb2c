"""Hurst exponent of a measured surface: one model, one fit, one interval (method "likelihood").

1. A first fit to the modes of the tapered surface gives a pilot: the expected power of each cosine mode.
2. Modes that the edges, a filter or single waves dominate are left out; the lay is divided out; gaps are
   filled, and their effect on the power is corrected.
3. The bins of the modes that are left have one posterior (`_spectral_posterior`): its median is the
   estimate, its standard deviation the standard error, the shortest interval with a probability of 95 % the
   interval.

Whole periodic surfaces have Fourier modes; profiles are the case of one axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base.regression import detrended
from fractalcontact.base.spectra import window_weights
from fractalcontact.base.units import quantity_text
from fractalcontact.dimensions._azimuths import LARGEST, NO_METRIC, fit_azimuths
from fractalcontact.dimensions._diagnosis import diagnose, rounding_noise, unevenness
from fractalcontact.dimensions._gaussian_mixture import Bins, Lattice
from fractalcontact.dimensions._mode_bins import (
    FALSE_ALARM,
    LEAST,
    LEAST_BINS,
    TAPERED,
    clear_modes,
    expected_power,
    fill,
    filling_ratio,
    is_oblique,
    lay,
    levels_by_azimuth,
    make_bins,
    rms_increment,
    single_waves,
    stretch,
    whitened,
)
from fractalcontact.dimensions._records import CONSTANT, Estimate, joined, plane, smooth, undefined
from fractalcontact.dimensions._spectral_posterior import (
    CORNER,
    HURST,
    LONG_HURST,
    LOWEST,
    NOISE,
    SPREAD,
    Posterior,
    posterior,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, middle_slices
from fractalcontact.dimensions._waves import LARGEST_CROP, without_waves

Array = np.ndarray[Any, np.dtype[Any]]

_PERIODIC_GAPS = (
    "a periodic surface with gaps, or with one periodic axis, is treated as free: the interval is for "
    "another kind of surface; see fractalcontact.surfaces.fill"
)
NO_MODES = (
    "too few modes that vary along both axes: give more points, or a profile where heights vary along one"
)
WIDEST = 0.85  # width of an interval that says nothing: the prior has .95
_SEEN = 0.8  # probability from which on a nuisance is named
_EMPTY = 1e-14  # power over the pilot of modes that hold only rounding, as beyond the band of a synthesis


@dataclass(frozen=True)
class ModeFit:
    """Modes of a surface and their first fit.

    Attributes
    ----------
    lattice : Lattice
    scale : float
        Rms increment over one x spacing, in scaled heights: unit of the modes.
    power : ndarray
        Squared modes, corrected for gaps and for the lay.
    pilot : ndarray
        Expected power of the first fit.
    keep : ndarray of bool
        Modes that count.
    information : float or ndarray
    theta : ndarray
    form : int
    is_oblique : bool
        The lay is oblique to the axes, and cosine modes do not know the sign of an azimuth.
    """

    lattice: Lattice
    scale: float
    power: Array
    pilot: Array
    keep: Array
    information: Array | float
    theta: Array
    form: int
    is_oblique: bool

    def bins(self, keep: Array | None = None) -> Bins:
        """Return the bins of the modes that count, or of some of them."""
        chosen = self.keep if keep is None else keep
        return make_bins(self.lattice, self.power, self.pilot, chosen, information=self.information)


def likelihood(surface: Surface, scales: Scales, noise: float | None, psf: float | None = None) -> Estimate:
    """Estimate the exponent of one surface.

    `noise`: rms height of white noise in m; None: estimated. `psf`: spread of a known point spread function
    in m.
    """
    if surface.is_constant:
        return undefined(CONSTANT)
    if surface.is_plane:
        return plane()
    surface, marks = without_waves(surface)
    window = surface.resolved(scales)
    if window is not None:  # the exponent of these waves as they are
        psf, noise = psf or 0.0, noise or 0.0
    spread = None if psf is None else psf / surface.spacing[1]
    fit = fitted_modes(surface, spread)
    if fit is None:
        return undefined(NO_MODES)
    keep = fit.keep
    if window is not None:
        wavelength = 2.0 * np.pi / fit.lattice.q * surface.spacing[1]
        keep = keep & (wavelength >= window[0] * (1.0 - 1e-9)) & (wavelength <= window[1] * (1.0 + 1e-9))
    number = int(np.count_nonzero(keep))
    if number < LEAST * LEAST_BINS and window is None and keep.size > 4 * LEAST * LEAST_BINS:
        return smooth()
    if number < LEAST * LEAST_BINS:
        what = (
            "in the window of scales"
            if window is not None
            else "that the edges of the surface do not dominate"
        )
        return undefined(f"{number} modes {what}, at least {LEAST * LEAST_BINS} are needed")
    if fit.is_oblique and not fit.lattice.periodic:
        turned = _of_azimuths(surface, fit, window, noise, psf)
        if turned is not None:
            return replace(turned, note=joined(marks, turned.note))
    unit = fit.scale * surface.unit
    background = rounding_noise(surface) / fit.scale
    bins = fit.bins(keep)
    known = 0.0 if not noise else math.hypot(noise / unit, background)
    bins = replace(bins, noise=known)
    found = posterior(
        bins,
        spread=spread,
        noise=None if noise is None else noise > 0.0,
        background=background,
        is_window=window is not None,
        pilot_spread=float(fit.theta[SPREAD]) if spread is None else 0.0,
    )
    estimate = _estimate(surface, fit, bins, found, window, unit, noise, psf)
    return replace(estimate, note=joined(marks, estimate.note))


def _of_azimuths(
    surface: Surface,
    fit: ModeFit,
    window: Scales,
    noise: float | None,
    psf: float | None,
    *,
    near_isotropy: float = 0.4,
) -> Estimate | None:
    """Return the estimate from Fourier modes, whose metric has any azimuth.

    None if they are too few, or if no metric describes them and lengths hardly differ: a step, or lines of a
    scanner, are not a lay. Of more than `LARGEST` points along an axis those in the middle are used.

    Parameters
    ----------
    surface, fit, window, noise, psf
    near_isotropy : float
        Logarithm of the ratio of lengths up to which cosine modes serve under an oblique lay: with 1.5 to 1
        all of 24 intervals hold H, with 2 to 1 at 15 degrees the rms error is .34 (256 x 256 points, H = .8).
    """
    dx = surface.spacing[1]
    azimuths = fit_azimuths(
        surface.with_heights(surface.heights[middle_slices(surface.shape, LARGEST)]),
        None if window is None else (window[0] / dx, window[1] / dx),
        spread=None if psf is None else psf / dx,
        noise=None if noise is None else noise / surface.unit,
    )
    if azimuths is None:
        return None
    has_metric = not azimuths.p_values[1] < FALSE_ALARM
    if not has_metric and math.hypot(*azimuths.uv) < near_isotropy:
        return None
    unit = azimuths.scale * surface.unit
    estimate = _estimate(surface, fit, azimuths.bins, azimuths.found, window, unit, noise, psf)
    lag = float(azimuths.spectrum.metric[1, 1])  # of one x spacing, squared
    estimate = replace(estimate, rms_increment=estimate.rms_increment * lag ** (0.5 * estimate.hurst))
    return estimate if has_metric or estimate.reason else estimate.without_interval(NO_METRIC)


def fitted_modes(surface: Surface, spread: float | None = None, corrections: int = 1) -> ModeFit | None:
    """Return the modes of a surface and their first fit; None if it has too few.

    `spread` is that of a known blur, in spacings. `corrections` for a stretch and gaps: a second one moved no
    rms error by more than .0005.
    """
    heights = _without_rim(surface.heights)
    observed = np.isfinite(heights)
    is_complete = bool(observed.all())
    is_periodic = all(surface.grid.periodic) and is_complete
    lattice = Lattice((heights.shape[0], heights.shape[1]), surface.plane_spacing, is_periodic)
    if min(heights.shape[-surface.axes :]) < 4:
        return None
    heights = heights - heights[observed].mean() if is_periodic else _without_plane(heights)
    scale = rms_increment(heights)
    heights /= scale
    filled = fill(heights)
    theta, form, ratio_of_lags, turned = _first_fit(filled, lattice, spread, is_complete)
    lattice = replace(lattice, stretch=ratio_of_lags)
    if theta[HURST] < LOWEST:  # no density is finite, as where the spacings differ by orders
        return None
    modes = lattice.power(filled)
    correction: Array | float = 1.0
    information: Array | float = 1.0
    for rounds in range(corrections, -1, -1):
        pilot, clean = (expected_power(lattice, theta, form, edges=edges) for edges in (True, False))
        sharp = theta.copy()
        sharp[SPREAD] = 0.0
        unblurred = expected_power(lattice, sharp, form, edges=False) if theta[SPREAD] > 0.0 else clean
        keep = clear_modes(pilot, clean, unblurred)
        if not is_complete:
            correction = filling_ratio(lattice, pilot, observed)
            information = float(np.mean(observed)) ** 2 * np.minimum(1.0, correction)
        power = modes if is_complete else modes / correction
        keep &= power > _EMPTY * pilot
        if not keep.any():
            return None
        ratio = whitened(lattice, power, pilot, keep)
        keep &= ~single_waves(lattice, ratio, keep)
        levels = levels_by_azimuth(lattice, ratio, keep)
        level = lay(lattice, levels)
        if not rounds:
            break
        ratio_of_lags = stretch(lattice, levels, unblurred)
        if is_complete and lattice.stretch == ratio_of_lags == 1.0:
            break
        if not is_complete and np.count_nonzero(keep) >= LEAST * LEAST_BINS:
            bins = make_bins(lattice, power / level, pilot, keep, information=information, is_pilot=True)
            hypothesis, _, theta = posterior(bins, spread=spread, is_pilot=True).most_probable
            form = hypothesis.form
        lattice = replace(lattice, stretch=ratio_of_lags)
    information = information / unevenness(heights)
    power /= level
    return ModeFit(lattice, scale, power, pilot, keep, information, theta, form, turned)


def _first_fit(
    heights: Array, lattice: Lattice, spread: float | None, is_complete: bool
) -> tuple[Array, int, float, bool]:
    """Return theta, form, stretch, and whether the lay is oblique, of the tapered surface or its middle.

    Its edges do not leak into short waves.
    """
    edge = LARGEST_CROP ** (3 - lattice.axes)
    is_part = is_complete and max(heights.shape) > edge
    if is_part:
        heights = heights[middle_slices(heights.shape, edge)]
    is_periodic = lattice.periodic and not is_part
    torus = Lattice((heights.shape[0], heights.shape[1]), lattice.spacing, True)
    if lattice.axes == 2 and not is_periodic:  # offsets of rows and columns are in none of the modes
        heights = heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True)
    tapers = [window_weights(n, None if n == 1 or is_periodic else "hann") for n in heights.shape]
    power = torus.power(heights * (tapers[0][:, None] * tapers[1]))
    pilot = torus.q ** (-1.0 - torus.axes)
    inside = power > _EMPTY * float(np.max(power / pilot)) * pilot
    keep = inside & (torus.q > 4.0 * 2.0 * np.pi / torus.longest)
    if np.count_nonzero(keep) < LEAST * LEAST_BINS:
        keep = inside if np.count_nonzero(inside) >= LEAST * LEAST_BINS else np.ones(keep.shape, dtype=bool)
    ratio = whitened(torus, power, pilot, keep)
    levels = levels_by_azimuth(torus, ratio, keep)
    turned = lattice.axes == 2 and is_oblique(torus, ratio, levels, 1.0 if is_periodic else TAPERED)
    torus = replace(torus, stretch=stretch(torus, levels, pilot, information=TAPERED))
    y, x = torus.wavenumbers
    pilot = np.hypot(y[:, None] / torus.stretch, x) ** (-1.0 - torus.axes)
    bins = make_bins(torus, power, pilot, keep, is_tapered=not is_periodic, is_pilot=True)
    hypothesis, _, theta = posterior(bins, spread=spread, is_pilot=True).most_probable
    return theta, hypothesis.form, torus.stretch, turned


def _without_plane(heights: Array) -> Array:
    """Return heights less their plane, or those of a profile less their line."""
    if heights.shape[0] == 1:
        return detrended(heights[0], 1)[0][None]
    return detrended(heights, 1)[0]


def _without_rim(heights: Array) -> Array:
    """Return heights without the outer rows and columns of which nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def _estimate(
    surface: Surface,
    fit: ModeFit,
    bins: Bins,
    found: Posterior,
    window: Scales,
    unit: float,
    noise: float | None,
    psf: float | None,
) -> Estimate:
    """Return the record of a posterior, with what was found in words."""
    low, middle, high, deviation = found.interval()
    discrepancy = found.most_probable[1]
    dx = surface.spacing[1]
    inside = np.exp(-bins.lnq[discrepancy.inside]) * 2.0 * np.pi * dx
    amplitude = math.sqrt(max(_amplitude(bins, found), 0.0))
    is_noisy = noise is None and found.probability("is_noisy") > _SEEN
    is_blurred = psf is None and found.probability("is_blurred") > _SEEN
    spread = found.mean(SPREAD, "is_blurred") * dx if is_blurred else math.nan
    height = amplitude * unit * found.mean(NOISE, "is_noisy") if is_noisy else math.nan
    estimate = Estimate(
        hurst=middle,
        standard_error=deviation,
        ci_low=low,
        ci_high=high,
        scale_min=float(inside.min()),
        scale_max=float(inside.max()),
        rms_increment=amplitude * unit,
        noise_height=height if noise is None else noise,
        blur_spread=spread if psf is None else psf,
        misfit=_misfit(bins, found),
        window="asked for" if window is not None else "all wavelengths that one model describes",
        note=joined(*_findings(found, bins, dx, spread, height)),
        posterior=found,
    )
    reason = diagnose(surface, is_window=window is not None)
    if any(surface.grid.periodic) and not fit.lattice.periodic:
        reason = _PERIODIC_GAPS
    if not reason and high - low > WIDEST:
        reason = f"the heights do not determine the exponent: {low:.2f} to {high:.2f} is as likely"
    return estimate if not reason else estimate.without_interval(reason)


def _findings(found: Posterior, bins: Bins, dx: float, spread: float, height: float) -> list[str]:
    """Return in words what the surface has beside an exponent."""
    _, discrepancy, theta = found.most_probable
    notes = []
    if np.isfinite(spread):
        notes.append(f"blur with a spread of {quantity_text(spread, 'm')}")
    if np.isfinite(height):
        notes.append(f"white noise with an rms height of {quantity_text(height, 'm')}")
    if theta[CORNER] > 0.0 and found.probability("is_bent") > _SEEN:
        length = quantity_text(2.0 * np.pi / theta[CORNER] * dx, "m")
        notes.append(f"waves longer than about {length} have another exponent, {theta[LONG_HURST]:.2f}")
    if not discrepancy.inside.all():
        lengths = 2.0 * np.pi * dx * np.exp(-bins.lnq[discrepancy.inside])
        ends = quantity_text(float(lengths.min()), "m"), quantity_text(float(lengths.max()), "m")
        notes.append(f"one exponent describes the waves from {ends[0]} to {ends[1]} only")
    elif discrepancy.scatter.max() > 0.0:
        share = 100.0 * float(discrepancy.scatter.max())
        notes.append(f"the spectrum differs from the model by about {share:.0f} %, which widens the interval")
    return notes


def _residuals(bins: Bins, found: Posterior) -> Array:
    """Return logarithms of the power over the model of the most probable hypothesis."""
    hypothesis, _, theta = found.most_probable
    return np.asarray(bins.level - bins.log_power(theta[None], hypothesis.form)[0][0])


def _amplitude(bins: Bins, found: Posterior) -> float:
    """Return the square of the rms increment of the fractal over one spacing, over that of the heights."""
    _, discrepancy, theta = found.most_probable
    if bins.noise > 0.0:
        return float(np.square(bins.noise / theta[NOISE]))
    inside = discrepancy.inside
    residuals, weights = _residuals(bins, found)[inside], 1.0 / bins.variance[inside]
    return math.exp(float(weights @ residuals / weights.sum()))


def _misfit(bins: Bins, found: Posterior) -> float:
    """Return z of chi square of the bins about the most probable spectrum, octave by octave and azimuth."""
    hypothesis, discrepancy, _ = found.most_probable
    residuals = _residuals(bins, found)[discrepancy.inside]
    weights = 1.0 / bins.variance[discrepancy.inside]
    residuals = residuals - weights @ residuals / weights.sum()
    freedom = residuals.size - 1 - sum(math.isnan(value) for value in hypothesis.theta)
    if freedom < 1:
        return math.nan
    return float((weights @ np.square(residuals) - freedom) / math.sqrt(2.0 * freedom))
