"""Maximum likelihood estimate of a surface with free edges, by its cosine modes.

One exponent, blur and noise, several exponents, a roll-off, a filter of unknown form: the likeliest of these
gives the estimate, and the interval holds what the others would give where they cannot be excluded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from fractalcontact.dimensions import _cosine_modes
from fractalcontact.dimensions._blur import (
    BLUR_WINDOW,
    CLEAR,
    LEAST_AGREEMENT,
    BlurredFit,
    blurred_estimate,
    chosen_blocks,
    fit_blurred,
    is_seen,
)
from fractalcontact.dimensions._blur_fit import Comparison, agreement, compare
from fractalcontact.dimensions._exponent_by_scale import (
    frame_blocks,
    interval_of_run,
    is_smooth,
    longest_run,
    octaves,
    run_estimate,
    window_of,
    with_or_without_aliases,
)
from fractalcontact.dimensions._free_edges import (
    FREE_WINDOW,
    LARGE,
    FreeEdges,
    SurfaceModes,
    cropped,
    first_exponent,
    is_separable,
    without_form,
    without_levelling,
    without_offsets,
    without_small_gaps,
)
from fractalcontact.dimensions._heterogeneity import Heterogeneity, heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments
from fractalcontact.dimensions._increments import without_steps
from fractalcontact.dimensions._mode_blocks import LOWEST
from fractalcontact.dimensions._quantisation import rounding_note
from fractalcontact.dimensions._records import ASKED, SIGNIFICANT, Estimate, joined, undefined
from fractalcontact.dimensions._rounded_heights import rounded_estimate
from fractalcontact.dimensions._second_exponent import (
    NO_ALIASES,
    Explanations,
    alternatives,
    fit_knee,
    several_exponents,
)
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._transfer_functions import Window
from fractalcontact.dimensions._unknown_filter import unfiltered_estimate
from fractalcontact.dimensions._whittle import LEAST_MODES, WhittleFit, fit_interval

_PLAIN = 10.0  # decrease of the penalised deviance from which blur and noise are taken, if one is to be
_DOUBT = 4.4  # below it, from which on the interval holds blur and noise beside neither
_EVEN = 13.0  # decrease at which both have half the weight in their mean; neither a tenth 4.4 above
_BEYOND = 4.0  # spreads: increments over so many are little changed by a blur
# misfits below and above which the interval of a surface allows for blur, noise and a second exponent: noise
# and a rougher second surface make it positive, and are harder to see than a blur
_SLIGHT = -2.5, 1.5
_WEAK_NOISE = 0.08  # of the rms increment: noise that the interval of a surface allows for
# chi square of a transfer function of another form, of three parameters, from which it may be there, and is
_MAYBE_OTHER, _OTHER_FORM = 9.0, 14.0
_REACHES = 0.95  # of the shortest wave of a run of octaves, from which a filter of unknown form changes it
_EQUAL = 0.01  # share of heights that equal a neighbour: the nearest of other points, or a median
_LEAST_NUMBER = 200  # modes of a surface whose blur is looked for
_SEPARABLE = (
    "the heights vary along one axis only, or are a sum f(x) + g(y), as no fractal surface is: estimate "
    "profiles, or see `directions`"
)
_OR_PLAIN = (
    "blur, noise or a second exponent is uncertain: the exponent is averaged over the fits with and "
    "without it, and the interval holds both"
)
_OR_FILTER = (
    "a filter that is no Gaussian blur may have changed the surface: the interval holds its exponent then"
)
_OR_SECOND = (
    "a second, smaller exponent of the shorter waves explains them nearly as well: the interval holds it; "
    "give `noise=True` where it is noise"
)


def surface_likelihood(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit the cosine modes of a surface with free edges; `spread` in spacings is that of a known blur."""
    heights = cropped(surface.heights)
    if surface.finest_scale:
        heights = without_small_gaps(heights, surface.plane_spacing)
    power = _cosine_modes.mode_power(heights) if np.isfinite(heights).all() else None
    if power is not None and is_separable(power, heights):
        return undefined(_SEPARABLE)
    form_note = levelling_note = ""
    if power is not None and not surface.finest_scale:
        heights, power, form_note = without_form(heights, power)
    levelled, spacing = without_offsets(heights), surface.plane_spacing
    moments = cache(lambda stride: increment_moments([(levelled, len(levelled))], levelled.shape, stride))
    compared_parts = cache(lambda hurst, stride: heterogeneity(moments(stride), spacing, hurst))
    pilot = first_exponent(moments(1), spacing)
    if power is not None:
        power, levelling_note = without_levelling(power, spacing, pilot)
    free = FreeEdges(surface, heights, power, scales, noise, spread, pilot)
    estimate = rounded_estimate(free, compared_parts)
    if estimate is None:
        estimate = _explained(free if free.is_large else free.restored(), compared_parts)
    return replace(estimate, note=joined(form_note, levelling_note, estimate.note))


def _explained(
    free: FreeEdges,
    compared_parts: Callable[[float, int], Heterogeneity],
    plain: tuple[SurfaceModes, WhittleFit] | None = None,
) -> Estimate:
    """Return the estimate of the likeliest explanation of the modes.

    `compared_parts` compares the blocks of the surface, given an exponent and a stride; `plain` is the fit of
    one exponent, if it was made. The modes beside the gaps of a large surface are restored only where one
    exponent does not describe them.
    """
    surface, scales, noise, spread = free.surface, free.scales, free.noise, free.spread
    stride = _stride(scales, max(surface.spacing))
    if window := _window_without_aliases(free):
        return window
    comparison, blurred = _comparison(free), None
    if comparison is not None:
        hurst = comparison.plain.hurst
        parts = compared_parts(hurst, stride)
        if ground := _ground(free, parts, hurst, comparison.misfit):
            return ground
        if spread is not None or _shows_blur(free, comparison, parts):
            blurred = _blurred_fit(free, comparison)
    if comparison is not None and free.is_default and surface.equal_share > _EQUAL:
        estimate, lag = _unfiltered(free, comparison.window)
    elif comparison is not None and blurred is not None and is_seen(blurred, surface.axes, spread):
        estimate, lag = _with_blur(free, comparison, blurred)
        estimate = _allowing_rounding(estimate, comparison, free)
        estimate = _or_neither(estimate, free, comparison, parts)
    elif comparison is not None and (several := _several(free, comparison, blurred, parts)):
        estimate, lag = several
    else:
        modes = free.modes() if plain is None else plain[0]
        if modes.number < LEAST_MODES:
            return undefined(f"{modes.number:.0f} modes in the window, at least {LEAST_MODES} are needed")
        fit = modes.fit(free.pilot, noise) if plain is None else plain[1]
        parts = compared_parts(fit.hurst, stride)
        # a slight bend of a very large surface changes nothing
        low, high = _SLIGHT if free.heights.size <= LARGE else (-SIGNIFICANT, SIGNIFICANT)
        if free.power is None and not low < fit.misfit < high:
            restored = free.restored()
            if restored.power is not None:
                return _explained(restored, compared_parts, (modes, fit))
        if ground := _ground(free, parts, fit.hurst, fit.misfit):
            return ground
        is_even = blurred is None or blurred.is_even
        estimate, lag = _without_blur(free, modes, fit, parts, comparison, is_even=is_even)
    parts = compared_parts(estimate.hurst, max(stride, lag))
    low, high = parts.widened(estimate.hurst, estimate.ci_low, estimate.ci_high)
    rounding = "" if noise else rounding_note(free.heights, estimate.standard_error)
    periodic_note = "a periodic surface with gaps is treated as free" if all(surface.grid.periodic) else ""
    return replace(
        estimate,
        standard_error=estimate.standard_error * parts.widening,
        ci_low=low,
        ci_high=high,
        note=joined(periodic_note, estimate.note, parts.note, rounding),
    )


def _ground(free: FreeEdges, parts: Heterogeneity, hurst: float, misfit: float) -> Estimate | None:
    """Return the estimate of the ground between steps; None where there are none, or not by default."""
    if not free.is_default or not (parts.note or free.has_seams):
        return None
    surface = free.surface
    ground = without_steps(free.heights, surface.plane_spacing, hurst)
    if ground is None:
        return None
    return replace(
        ground,
        scale_min=min(surface.spacing),
        scale_max=4.0 * max(surface.spacing),
        rms_increment=ground.rms_increment * surface.unit,
        misfit=misfit,
    )


def _comparison(free: FreeEdges) -> Comparison | None:
    """Compare the surface with one that is blurred and noisy; None where that is not known.

    With many gaps, with few modes, and where gridding has removed short waves, as a blur does.
    """
    if free.power is None or free.power.size < _LEAST_NUMBER or free.surface.finest_scale:
        return None
    frame = free.frame
    inside = chosen_blocks(frame, free.surface, free.scales)
    if frame.count[inside].sum() < _LEAST_NUMBER:
        return None
    return compare(Window(frame, inside, frame.mean(free.power)), free.pilot, noise=free.noise)


def _shows_blur(free: FreeEdges, comparison: Comparison, parts: Heterogeneity) -> bool:
    """Return whether blur or noise is to be fitted; unequal parts count for fewer modes, and look like it."""
    gain, least = comparison.gain / parts.widening**2, _PLAIN - (_DOUBT if free.is_default else 0.0)
    if abs(comparison.misfit) > SIGNIFICANT * parts.widening:
        return gain > least
    return not parts.note and gain > (least if comparison.plain.hurst < 1.0 else CLEAR[2])


def _blurred_fit(free: FreeEdges, comparison: Comparison) -> BlurredFit | None:
    """Fit blur and noise in the largest window that a model of them fits; None if it has too few modes."""
    assert free.power is not None  # it was compared
    window = comparison.window
    return fit_blurred(
        free.power,
        window.frame,
        noise=free.noise,
        spread=free.spread,
        chosen=window.inside,
        first=comparison.best,
    )


def _with_blur(free: FreeEdges, comparison: Comparison, fit: BlurredFit) -> tuple[Estimate, int]:
    """Return the estimate of a surface on which blur or noise is seen, and a lag beyond the blur."""
    surface, window = free.surface, comparison.window
    longest = 2.0 * np.pi / float(np.sqrt(window.squares.min())) * surface.spacing[1]
    estimate = blurred_estimate(fit, surface, free.scales, fit.amplitude, longest)
    if free.is_default:
        explained = Explanations.likelier(fit, window.power, window.frame)
        several = several_exponents(explained, surface)
        is_filter = free.is_filtered_locally or (fit.other_form > _OTHER_FORM and is_smooth(explained.record))
        if several is not None and not is_filter:
            return several, _lag(several, surface)
        # blur and noise do not explain all octaves, or what they leave is no fractal
        if not (fit.is_good and fit.low < 1.0) and (run := _longest_run(free, window)):
            return run
        if is_filter or fit.other_form > _OTHER_FORM:
            return _unfiltered(free, window)
        if fit.other_form > _MAYBE_OTHER:
            unfiltered, _ = _unfiltered(free, window)
            estimate = estimate.holding(unfiltered.ci_low, unfiltered.ci_high, _OR_FILTER)
        low, high = alternatives(explained, is_bent=True)
        if low < estimate.ci_low or high > estimate.ci_high:
            estimate = estimate.holding(low, high, _OR_SECOND)
    return estimate, round(_BEYOND * fit.spread)


def _several(
    free: FreeEdges, comparison: Comparison, fit: BlurredFit | None, parts: Heterogeneity
) -> tuple[Estimate, int] | None:
    """Return the estimate of several exponents of a surface on which no blur is seen, and a lag; or None.

    `fit` is that of blur and noise. It is made, if it is not there, where one exponent does not agree with
    the modes. With aliases a run of octaves is left to `_longest_run`; its interval holds a slow roll-off.
    """
    window = comparison.window
    if not free.is_default or parts.note:
        return None
    if abs(comparison.misfit) < SIGNIFICANT and agreement(window, comparison.plain) > LEAST_AGREEMENT:
        return None
    fit = _blurred_fit(free, comparison) if fit is None else fit
    if fit is None:
        return None
    explained = Explanations.likelier(fit, window.power, window.frame)
    if explained.has_aliases and not explained.is_rolloff:
        run = _longest_run(free, window) if fit.is_even and abs(comparison.misfit) > SIGNIFICANT else None
        return None if run is None else (explained.beside_rolloff(run[0], explained.run_excess), run[1])
    several = several_exponents(explained, free.surface)
    return None if several is None else (several, _lag(several, free.surface))


def _window_without_aliases(free: FreeEdges) -> Estimate | None:
    """Return the estimate of a given window of a surface without aliases, if one exponent fits it."""
    if free.scales is None or free.power is None or free.surface.finest_scale:
        return None
    if free.noise or free.spread is not None:
        return None
    frame = free.frame
    inside = chosen_blocks(frame, free.surface, free.scales)
    blocks = frame_blocks(frame.mean(free.power), frame)
    unaliased = with_or_without_aliases(blocks)
    if unaliased is blocks or frame.count[inside].sum() < LEAST_MODES:
        return None
    run = window_of(unaliased, inside)
    if run is None:
        return None
    return replace(run_estimate(run, free.surface), window=ASKED, note=NO_ALIASES)


def _lag(estimate: Estimate, surface: Surface) -> int:
    """Return a lag inside the window of an estimate."""
    return round(0.5 * estimate.scale_min / max(surface.spacing))


def _or_neither(
    estimate: Estimate, free: FreeEdges, comparison: Comparison, parts: Heterogeneity
) -> Estimate:
    """Return the mean of an estimate with blur or noise and that with neither, where both are likely."""
    gain = comparison.gain / parts.widening**2
    is_doubtful = _PLAIN - _DOUBT <= gain <= _EVEN + _DOUBT
    if not (free.is_default and is_doubtful) or comparison.plain.hurst >= 1.0:
        return estimate
    modes = free.modes()
    fit = modes.fit(free.pilot, noise=False)
    neither = _without_blur(free, modes, fit, parts, comparison, is_even=True)[0]
    if estimate.window == BLUR_WINDOW and neither.window == FREE_WINDOW:
        share = 1.0 / (1.0 + float(np.exp(0.5 * (gain - _EVEN))))
        if share > 0.5:
            return neither.averaged(estimate, 1.0 - share, _OR_PLAIN)
        return estimate.averaged(neither, share, _OR_PLAIN)
    return estimate if gain > _PLAIN else neither.holding(estimate.ci_low, estimate.ci_high, _OR_PLAIN)


def _allowing_rounding(estimate: Estimate, comparison: Comparison, free: FreeEdges) -> Estimate:
    """Return an estimate with blur; where heights are rounded, its interval holds that of noise alone."""
    if not free.noise and rounding_note(free.heights, estimate.standard_error):
        estimate = estimate.holding(*comparison.interval(np.inf, blur=False))
    return replace(estimate, misfit=comparison.misfit)


def _without_blur(
    free: FreeEdges,
    modes: SurfaceModes,
    fit: WhittleFit,
    parts: Heterogeneity,
    comparison: Comparison | None,
    *,
    is_even: bool,
) -> tuple[Estimate, int]:
    """Return the estimate of a surface on which no blur is seen, and a lag inside its window.

    `is_even` states that no few waves dominate the modes.
    """
    is_bent = abs(fit.misfit) > SIGNIFICANT * parts.widening
    run = None
    is_default = free.scales is None and free.spread is None
    if is_bent and is_default and comparison is not None and fit.misfit < 0.0:
        run = _unfiltered(free, comparison.window) if free.is_filtered_locally else None
    if run is None and is_bent and is_default and comparison is not None and (is_even or fit.hurst >= 1.0):
        run = _longest_run(free, comparison.window, is_even=is_even)
    if run is not None:
        estimate, lag = run
        return replace(estimate, misfit=fit.misfit), lag
    if parts.note:
        comparison = None  # unequal parts look like blur or noise
    estimate = _plain(free, modes, fit, comparison)
    is_slight = not _SLIGHT[0] < fit.misfit < _SLIGHT[1] and abs(fit.misfit) <= SIGNIFICANT
    if comparison is not None and free.is_default and is_slight and fit.hurst < 1.0:
        estimate = _allowing_scales(estimate, free, comparison.window, fit.misfit)
    elif comparison is not None and free.is_default and fit.hurst < 1.0:
        window = comparison.window
        knee = fit_knee(octaves(frame_blocks(window.power, window.frame)), window.inside)
        estimate = estimate if knee is None else estimate.holding(*knee.held)
    return estimate, 1


def _plain(free: FreeEdges, modes: SurfaceModes, fit: WhittleFit, comparison: Comparison | None) -> Estimate:
    """Return the estimate of one exponent at all scales of the window."""
    surface, scales, noise = free.surface, free.scales, free.noise
    dx = surface.spacing[1]
    fit, estimate = fit_interval(modes, free.pilot, noise, fit)
    low, high = estimate.ci_low, estimate.ci_high
    if not noise and rounding_note(surface.heights, estimate.standard_error):
        with_noise = fit_interval(modes, free.pilot, True)[1]
        low, high = float(np.fmin(low, with_noise.ci_low)), float(np.fmax(high, with_noise.ci_high))
    if comparison is not None:
        ends = comparison.interval(_WEAK_NOISE, blur=scales is None)
        is_whole = free.share is None and not estimate.note
        low, high = ends if is_whole else (min(low, ends[0]), max(high, ends[1]))
    return replace(
        estimate,
        ci_low=low,
        ci_high=high,
        scale_min=float(modes.order.min()) * dx,
        scale_max=float(modes.order.max()) * dx,
        rms_increment=_rms_increment(fit) * surface.unit,
        noise_height=float(np.sqrt(max(fit.noise, 0.0))) * surface.unit if noise else np.nan,
        window=FREE_WINDOW if scales is None else ASKED,
        note=joined(fit.noise_note, estimate.note),
    )


def _allowing_scales(estimate: Estimate, free: FreeEdges, window: Window, misfit: float) -> Estimate:
    """Widen the interval by what blur, noise or a second exponent would give that cannot be excluded."""
    if free.power is None or free.heights.size > LARGE:
        return estimate
    fit = fit_blurred(free.power, window.frame)
    if fit is None:
        return estimate
    explained = Explanations(fit, frame_blocks(window.power, window.frame))
    low, high = alternatives(explained, is_bent=False)
    note = (
        f"the exponent may change with scale ({misfit:+.1f} standard deviations): the interval holds the "
        "exponents that blur, noise or a second exponent would give"
    )
    return estimate.holding(low, high, note)


def _unfiltered(free: FreeEdges, window: Window) -> tuple[Estimate, int]:
    """Return the estimate of waves that an unknown filter leaves nearly alone, and a lag among them."""
    estimate = unfiltered_estimate(window.power, window.frame, window.inside, free.surface.spacing[1])
    return estimate, _lag(estimate, free.surface) if estimate.scale_min > 0.0 else 1


def _longest_run(free: FreeEdges, window: Window, *, is_even: bool = True) -> tuple[Estimate, int] | None:
    """Return the estimate of the longest run of octaves with one exponent, and a lag inside it.

    None if there is no run. Where few waves dominate the run, None as well, unless they dominate all modes
    (`is_even` is false); its interval then holds the exponents of sectors of azimuth.
    """
    record = octaves(frame_blocks(window.power, window.frame))
    run = longest_run(record)
    if run.first > 0 and free.is_filtered_locally:
        return _unfiltered(free, window)
    if not run.last > run.first or not LOWEST < run.fit.hurst < 1.0:
        return None
    dx = free.surface.spacing[1]
    part = replace(free, scales=(run.low * dx, run.high * dx), pilot=run.fit.hurst).modes()
    estimate = run_estimate(run, free.surface).holding(*interval_of_run(run, record))
    if run.first > 0 and is_smooth(record):
        unfiltered, _ = _unfiltered(free, window)
        if unfiltered.scale_min > _REACHES * estimate.scale_min:
            estimate = estimate.holding(unfiltered.ci_low, unfiltered.ci_high, _OR_FILTER)
    if part.is_uneven(np.ones(part.order.shape, dtype=bool), run.fit.hurst):
        if is_even:
            return None
        sectors = fit_interval(part, run.fit.hurst, False)[1]
        estimate = estimate.holding(sectors.ci_low, sectors.ci_high, sectors.note)
    return estimate, max(1, round(0.5 * run.low))


def _stride(scales: Scales, spacing: float) -> int:
    """Return the stride whose second differences resolve the shortest waves of the window."""
    return 1 if scales is None else max(1, round(0.5 * scales[0] / spacing))


def _rms_increment(fit: WhittleFit) -> float:
    """Return the rms increment over one x spacing that corresponds to the amplitude."""
    return float(np.sqrt(2.0 * fit.amplitude / (1.0 - fit.hurst))) if fit.hurst < 1.0 else float("nan")
