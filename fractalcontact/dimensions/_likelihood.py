"""Hurst exponent of a measured surface: one model, one fit, one interval (method "likelihood").

1. A first fit to the modes of the tapered surface gives a pilot: the expected power of each cosine mode.
2. Modes that the edges, a filter or single waves dominate are left out; the lay is divided out; gaps are
   filled, and their effect on the power is corrected (`_mode_fit`). Under an oblique lay the Fourier modes of
   `_azimuths`, which have a metric, take the place of the cosine modes.
3. The bins of the modes that are left have one posterior (`_spectral_posterior`): its median is the
   estimate, its standard deviation the standard error, the shortest interval with a probability of 95 % the
   interval.

Whole periodic surfaces have Fourier modes; profiles are the case of one axis.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.units import quantity_text
from fractalcontact.dimensions._azimuths import NO_METRIC, fit_azimuths
from fractalcontact.dimensions._diagnosis import diagnose, rounding_noise
from fractalcontact.dimensions._gaussian_mixture import Bins
from fractalcontact.dimensions._mode_bins import FALSE_ALARM, LEAST, LEAST_BINS
from fractalcontact.dimensions._mode_fit import NEAR_ISOTROPY, FirstFit, first_fit
from fractalcontact.dimensions._records import CONSTANT, Estimate, joined, plane, smooth, undefined
from fractalcontact.dimensions._spectral_posterior import (
    CORNER,
    LONG_HURST,
    NOISE,
    SPREAD,
    Known,
    Posterior,
    decay,
    posterior,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._waves import without_waves

_PERIODIC_GAPS = (
    "a periodic surface with gaps, or with one periodic axis, is treated as free: the interval is for "
    "another kind of surface; see fractalcontact.surfaces.fill"
)
_MOSTLY_WAVES = "most of the power is in single waves: no random surface; see fractalcontact.dimensions.waves"
NO_MODES = "too few modes can be used: give more points, or a profile where heights vary along one axis alone"


def too_few_modes(scales: Scales) -> str:
    """Return why there is no exponent where too few modes are left, in a window of lengths in m if given."""
    return NO_MODES if scales is None else f"too few modes between {scales[0]:g} m and {scales[1]:g} m"


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
    if window is not None:
        window = window[0] / surface.spacing[1], window[1] / surface.spacing[1]
    known = Known.of(window is not None, None if psf is None else psf / surface.spacing[1], noise)
    first = first_fit(surface, known.spread)
    if first is None:
        return undefined(NO_MODES)
    increment = first.scale * surface.unit
    if noise and noise > increment:  # the rms increment of white noise is 1.4 times its height
        heights = f"heights with an rms increment of {quantity_text(increment, 'm')}"
        return undefined(f"white noise of {quantity_text(noise, 'm')} is not in {heights}: see `noise`")
    known = known.over(increment, rounding_noise(surface) / first.scale)
    turned = _of_azimuths(surface, first, window, known) if first.is_oblique else None
    estimate = turned or _of_modes(surface, first, window, known)
    if window is not None and scales is None and estimate.window:
        estimate = replace(estimate, window="all wavelengths that the points resolve")
    return replace(estimate, note=joined(marks, estimate.note))


def _of_azimuths(surface: Surface, first: FirstFit, window: Scales, known: Known) -> Estimate | None:
    """Return the estimate from Fourier modes, whose metric has any azimuth.

    None if they are too few, or if the log ratio of lengths is below `NEAR_ISOTROPY`. Where no metric
    describes the azimuths, as beside a step, twice that is the limit.
    """
    fit = fit_azimuths(first, window, known, least_log_ratio=NEAR_ISOTROPY)
    if fit is None:
        return None
    has_metric = not fit.p_values[1] < FALSE_ALARM
    if not has_metric and math.hypot(*fit.uv) < 2.0 * NEAR_ISOTROPY:
        return None
    estimate = _estimate(surface, first, fit.bins, fit.found, known)
    lag = float(fit.spectrum.metric[1, 1])  # of one x spacing, squared
    estimate = replace(estimate, rms_increment=estimate.rms_increment * lag ** (0.5 * estimate.hurst))
    return estimate if has_metric or estimate.reason else estimate.without_interval(NO_METRIC)


def _of_modes(surface: Surface, first: FirstFit, window: Scales, known: Known) -> Estimate:
    """Return the estimate from cosine modes, or from the Fourier modes of a periodic surface."""
    fit = first.modes
    if fit is None:
        return undefined(NO_MODES)
    keep = fit.keep & between(2.0 * np.pi / fit.lattice.q, window)
    number, least = int(np.count_nonzero(keep)), LEAST * LEAST_BINS
    if number < least:
        if window is None and not fit.lattice.periodic and keep.size > 4 * least:
            return smooth()
        which = "in the window of scales" if window else "beside those of edges, filters, waves or rounding"
        return undefined(f"{number} modes {which}, at least {least} are needed")
    if np.sum(fit.information * keep) < LEAST:  # a mode of a surface with gaps tells less
        return undefined(NO_MODES)
    bins = replace(fit.bins(keep), noise=known.total_noise)
    found = posterior(bins, known, pilot_spread=float(fit.theta[SPREAD]))
    estimate = _estimate(surface, first, bins, found, known)
    return estimate if estimate.reason or fit.waves < 0.5 else estimate.without_interval(_MOSTLY_WAVES)


def _estimate(surface: Surface, first: FirstFit, bins: Bins, found: Posterior, known: Known) -> Estimate:
    """Return the record of a posterior, with what was found in words."""
    low, middle, high, deviation = found.interval()
    dx, unit = surface.spacing[1], first.scale * surface.unit
    inside = np.exp(-bins.lnq[found.most_probable[1].inside]) * 2.0 * np.pi * dx
    amplitude = math.sqrt(max(_amplitude(bins, found), 0.0))
    spread = found.named(SPREAD) * dx
    height = amplitude * unit * found.named(NOISE) if known.noise is None else math.nan
    estimate = Estimate(
        hurst=middle,
        standard_error=deviation,
        ci_low=low,
        ci_high=high,
        scale_min=float(inside.min()),
        scale_max=float(inside.max()),
        rms_increment=amplitude * unit,
        noise_height=height if known.noise is None else known.noise * unit,
        blur_spread=spread if known.spread is None else known.spread * dx,
        misfit=_misfit(bins, found),
        window="asked for" if known.is_window else "all wavelengths that one model describes",
        note=joined(*_findings(found, bins, dx, spread, height)),
        posterior=found,
    )
    is_taken_as_free = any(surface.grid.periodic) and not first.lattice.periodic
    reason = _PERIODIC_GAPS if is_taken_as_free else diagnose(surface, is_window=known.is_window)
    return estimate if not reason else estimate.without_interval(reason)


def _findings(found: Posterior, bins: Bins, dx: float, spread: float, height: float) -> list[str]:
    """Return in words what the surface has beside an exponent."""
    _, discrepancy, theta = found.most_probable
    notes = []
    if np.isfinite(spread):
        notes.append(f"blur with a spread of {quantity_text(spread, 'm')}")
    if np.isfinite(height):
        notes.append(f"white noise with an rms height of {quantity_text(height, 'm')}")
    if theta[CORNER] > 0.0 and np.isfinite(found.named(CORNER)):
        length = quantity_text(2.0 * np.pi / theta[CORNER] * dx, "m")
        notes.append(f"waves longer than about {length} have another exponent, {theta[LONG_HURST]:.2f}")
    if not discrepancy.inside.all():
        lengths = 2.0 * np.pi * dx * np.exp(-bins.lnq[discrepancy.inside])
        ends = quantity_text(float(lengths.min()), "m"), quantity_text(float(lengths.max()), "m")
        notes.append(f"one exponent describes the waves from {ends[0]} to {ends[1]} only")
    elif discrepancy.is_filter:
        notes.append("a filter that is no Gaussian blur changes the short waves")
    elif discrepancy.scatter.max() > 0.0:
        share = 100.0 * float(discrepancy.scatter.max())
        notes.append(f"the spectrum differs from the model by about {share:.0f} %, which widens the interval")
    return notes


def _residuals(bins: Bins, found: Posterior) -> tuple[Array, Array]:
    """Return logarithms of the power of the bins that count over the model of the most probable hypothesis,
    with its filter, and their weights.
    """
    hypothesis, discrepancy, theta = found.most_probable
    residuals = bins.level - bins.log_power(theta[None], hypothesis.form)[0][0]
    residuals -= decay(bins, hypothesis, discrepancy, theta) * np.exp(bins.lnq)
    return residuals[discrepancy.inside], 1.0 / bins.variance[discrepancy.inside]


def _amplitude(bins: Bins, found: Posterior) -> float:
    """Return the square of the rms increment of the fractal over one spacing, over that of the heights."""
    if bins.noise > 0.0:
        return float(np.square(bins.noise / found.most_probable[2][NOISE]))
    residuals, weights = _residuals(bins, found)
    return math.exp(float(weights @ residuals / weights.sum()))


def _misfit(bins: Bins, found: Posterior) -> float:
    """Return z of chi square of the bins about the most probable spectrum, octave by octave and azimuth."""
    residuals, weights = _residuals(bins, found)
    residuals = residuals - weights @ residuals / weights.sum()
    freedom = residuals.size - 1 - sum(map(math.isnan, found.most_probable[0].theta))
    if freedom < 1:
        return math.nan
    return float((weights @ np.square(residuals) - freedom) / math.sqrt(2.0 * freedom))
