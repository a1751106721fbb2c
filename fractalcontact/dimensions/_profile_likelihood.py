"""Likelihood of a profile: exact where it is a fractional Brownian one, otherwise that of its cosine modes.

Blur and noise, a high-pass filter, a roll-off and several exponents are compared with one exponent. The modes
of a profile are few: the interval holds the exponents of all explanations that are nearly as likely as the
likeliest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _blur_fit, _mode_blocks
from fractalcontact.dimensions._blur import (
    CLEAR,
    BlurredFit,
    blurred_estimate,
    chosen_blocks,
    fit_blurred,
    is_seen,
)
from fractalcontact.dimensions._exponent_by_scale import (
    Blocks,
    fit_power_law,
    frame_blocks,
    interval_of_run,
    longest_run,
    octaves,
    run_estimate,
)
from fractalcontact.dimensions._mode_blocks import HIGH_PASS, LOWEST, SLOW, SUDDEN
from fractalcontact.dimensions._profile_increments import by_increments, without_jumps
from fractalcontact.dimensions._quantisation import quantisation
from fractalcontact.dimensions._records import Estimate, joined, undefined
from fractalcontact.dimensions._rolloff import ALIKE, LEAST_EXPONENT, fit_rolloff, rolloff_estimate
from fractalcontact.dimensions._second_exponent import (
    DECISIVE,
    NO_ALIASES,
    Explanations,
    fit_knee,
    fit_two_exponents,
    knee_estimate,
    penalised_deviance,
    two_estimate,
)
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._transfer_functions import NONE, TRANSFER, Window, edge_power
from fractalcontact.dimensions._whittle import QUANTILE

Array = np.ndarray[Any, np.dtype[Any]]

_LEAST_POINTS = 64  # of a profile whose blur is looked for
_LONGEST_MODES, _NEIGHBOURS = 16, 8  # longest waves of a profile, and neighbours of a single shorter one
_LEAST_CROSSOVER = 4.0  # spacings: two exponents must share an octave
_OR_ONE = (
    "a single exponent at all scales is not excluded: the exponent is averaged over both fits, and the "
    "interval holds both"
)
_OTHERS = "other explanations are nearly as likely: the interval holds their exponents"
_WIDEST = 0.25  # half-width of the exponent of the rougher of two profiles
_FLAT = -0.5  # exponent of white noise: longer waves are no weaker
_EVEN, _SURE = 13.0, 17.4  # decrease of the penalised deviance with half the weight, and with all of it
_EXCESS = 4.0  # z of the power of waves shorter than those of a blur
_LEAST_RATIO, _MOST_RATIO = 2.0, 1e3  # of their power over that of the model
_ALIKE_FALL = 1.0  # logarithm of the squared transfer function up to which filters are alike
_SHORTEST_ALIKE = 2.0  # wavenumber of such waves, rad per spacing
# deviance of octaves without aliases over that of one exponent, beyond which no aliases are missing
_HOPELESS = 2.0
_PRESENT = 0.25  # exponent of the longest waves that no filter has removed
_LEAST_SPREAD = 0.3  # of a blur beside a high-pass filter, as a first guess
_LITTLE_NOISE, _LEAST_ALIKE = 0.1, 14.0  # of the power of a wave; modes of such waves
# standard errors from which the interval holds their exponent, and from which it holds that alone
_DIFFERENT = 0.5, 2.5
_OR_LONGER = "the longer waves have another exponent, which the interval holds: it may be no Gaussian filter"
_NOT_GAUSSIAN = "a filter of another form than the Gaussian: the exponent is that of the longer waves"
_NO_WAVES = "a filter of another form than the Gaussian leaves too few waves for an exponent"
_MOST_ROUNDED = 0.5  # share of the mean square second difference that steps of rounding make
_COARSE = (
    "heights are rounded to steps larger than their increments, which is not white noise: store them with "
    "more digits, or give `scales` of waves higher than many steps"
)
_SINGLE = 0.9  # share of the power beyond the longest that these may hold


def profile_likelihood(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit a profile with its exact likelihood, or by its modes where it is no fractional Brownian one.

    Where that is not certain, the exponent is the mean of both.
    """
    if scales is None and not surface.finest_scale:
        if quantisation(surface.heights)[1] > _MOST_ROUNDED:
            return undefined(_COARSE)
        surface, jump_note = without_jumps(surface)
        if jump_note:
            estimate = profile_likelihood(surface, scales, noise, spread)
            return replace(estimate, note=joined(jump_note, estimate.note))
    heights, other, held, gain = surface.heights[0], None, (np.nan, np.nan), np.inf
    if np.isfinite(heights).all() and heights.size >= _LEAST_POINTS and not surface.finest_scale:
        other, held, gain = _profile_modes(surface, scales, noise, spread)
    if other is not None and gain > _SURE:
        return other
    exact = by_increments(surface, scales, noise, held)
    if other is None or not exact.hurst < 1.0:
        return exact if other is None else other
    share = 1.0 / (1.0 + float(np.exp(0.5 * (gain - _EVEN))))
    return other.averaged(exact, share, _OR_ONE)


def _profile_modes(
    surface: Surface, scales: Scales, noise: bool, spread: float | None
) -> tuple[Estimate | None, tuple[float, float], float]:
    """Return the estimate of a profile that is no fractional Brownian one, by its modes; None if it is one.

    The second result is an interval that the modes do not exclude of a fractional Brownian profile, NaN where
    there is none; the third the decrease of the penalised deviance by the estimate, infinite if it was asked
    for.
    """
    heights, dx, none = surface.heights[0], surface.spacing[1], (np.nan, np.nan)
    frame = _mode_blocks.frame((heights.size,), (1.0,))
    modes = _mode_blocks.profile_modes(heights) ** 2
    if (share := _largest_share(modes)) > _SINGLE:
        reason = f"a single wave holds {100.0 * share:.0f} % of the power of the shorter waves: not a fractal"
        return undefined(reason), none, np.inf
    fit = fit_blurred(modes, frame, noise=noise, spread=spread, chosen=chosen_blocks(frame, surface, scales))
    blurred, is_blurred = None, fit is not None and is_seen(fit, surface.axes, spread)
    if fit is not None and (fit.is_good or is_blurred):
        amplitude = fit.amplitude * heights.size ** (-2.0 * fit.hurst)
        longest = heights.size * dx if scales is None else scales[1]
        blurred = blurred_estimate(fit, surface, scales, amplitude, longest)
    if scales is None and spread is None and not noise:
        means = frame.mean(modes)
        if fit is not None and blurred is not None:
            blurred = _beyond_filter(blurred, fit, Window(frame, np.ones(means.size, dtype=bool), means), dx)
        return _likeliest(frame_blocks(means, frame), surface, fit, blurred)
    if is_blurred:
        return blurred, none, np.inf
    if blurred is None or noise or blurred.hurst > 1.0:
        return None, none, 0.0
    return None, (max(blurred.ci_low, 0.0), min(blurred.ci_high, 1.0)), 0.0


def _beyond_filter(blurred: Estimate, fit: BlurredFit, every: Window, dx: float) -> Estimate:
    """Return the estimate of a Gaussian blur, compared with the waves that all filters change alike.

    To the second order in the wavenumber all filters are Gaussian. Those of another form have another
    exponent in these longer waves, or more power in the shorter ones than a Gaussian leaves to them, with the
    jump of the slope at the ends and noise: then the exponent is that of the longer waves.
    """
    square, squares, noise = fit.spread**2, every.squares, float(np.nan_to_num(fit.noise))
    if fit.form == NONE or square == 0.0:
        return blurred
    signal = fit.amplitude * every.signal(fit.form, fit.hurst, square)[0]
    most = signal * (1.0 + edge_power(every.frame, fit.hurst, square)) + noise
    beyond = squares > squares[fit.inside].max()
    count, ratio = every.count[beyond], np.minimum(every.power / most, _MOST_RATIO)[beyond]
    excess = float(count @ (ratio - 1.0)) / float(np.sqrt(2.0 * max(count.sum(), 1.0)))
    is_gaussian = fit.is_good and (excess < _EXCESS or float(count @ ratio) < _LEAST_RATIO * count.sum())
    alike = fit.inside & (squares < min(_ALIKE_FALL / square, _SHORTEST_ALIKE**2))
    alike &= noise < _LITTLE_NOISE * signal
    if every.count[alike].sum() < _LEAST_ALIKE:
        return blurred if is_gaussian else blurred.holding(0.0, 1.0, _NO_WAVES)
    quiet = np.maximum(every.power - noise, 0.5 * every.power)
    window = Window(every.frame, alike, quiet)
    longer = _blur_fit.fit(window, _blur_fit.Fit(TRANSFER, fit.hurst, square))
    error = _blur_fit.error(window, longer)
    difference = abs(longer.hurst - fit.hurst) / np.sqrt(max(error**2 - fit.standard_error**2, 1e-9))
    if is_gaussian and difference < _DIFFERENT[0]:
        return blurred
    low, high = _blur_fit.interval(window, longer, QUANTILE * longer.correlation)
    if is_gaussian and (noise > 0.0 or difference < _DIFFERENT[1]):
        return blurred.holding(low, high, _OR_LONGER)
    return replace(
        blurred,
        hurst=longer.hurst,
        standard_error=error,
        ci_low=low,
        ci_high=high,
        scale_min=2.0 * np.pi / float(np.sqrt(squares[alike].max())) * dx,
        note=joined(blurred.note, _NOT_GAUSSIAN),
    )


def _likeliest(
    blocks: Blocks, surface: Surface, fit: BlurredFit | None, blurred: Estimate | None
) -> tuple[Estimate | None, tuple[float, float], float]:
    """Compare one exponent, blur and noise, and several exponents; return the same as `_profile_modes`.

    The interval holds those of all explanations that are nearly as likely as the likeliest: the modes of a
    profile are few.
    """
    everywhere = np.ones(blocks.count.size, dtype=bool)
    plain = fit_power_law(blocks, everywhere).deviance + 4.0
    ranked = _several(blocks, everywhere, surface, plain) + _high_passed(blocks, fit, surface)
    if fit is not None and blurred is not None:
        ranked.append((Explanations(fit, blocks, has_aliases=False).reference, blurred))
    ranked.sort(key=lambda pair: pair[0])
    least = min([plain, *(penalised for penalised, _ in ranked)])
    near = [estimate for penalised, estimate in ranked if penalised <= least + ALIKE]
    low = min((each.ci_low for each in near), default=np.nan)
    high = max((each.ci_high for each in near), default=np.nan)
    if plain - least < CLEAR[1]:
        return None, (max(low, 0.0), min(high, 1.0)), 0.0
    return near[0].holding(low, high, _OTHERS if len(near) > 1 else ""), (np.nan, np.nan), plain - least


def _several(
    blocks: Blocks, everywhere: Array, surface: Surface, plain: float
) -> list[tuple[float, Estimate]]:
    """Return the estimates of roll-offs and second exponents, with their penalised deviances.

    `plain` is that of one exponent.
    """
    result = []
    assert blocks.frame is not None
    for part in (blocks, frame_blocks(blocks.power, blocks.frame.unaliased)):
        found, record = [], octaves(part)
        if part is not blocks and sum(octave.fit.deviance for octave in record) > plain + _HOPELESS:
            break
        for is_sharp in (False, True):
            rolloff = fit_rolloff(part, everywhere, shape=SUDDEN if is_sharp else SLOW)
            if rolloff is not None and rolloff.law.hurst > LEAST_EXPONENT and rolloff.law.low < 1.0:
                found.append((rolloff.penalised, rolloff_estimate(rolloff, part, surface)))
            # without aliases a sum is like a corner
            has_two = is_sharp or part is blocks
            two = fit_two_exponents(part, everywhere, is_sharp=is_sharp) if has_two else None
            if two is not None and two.rough.hurst > LEAST_EXPONENT and two.crossover > _LEAST_CROSSOVER:
                estimate = two_estimate(two, record[0], part, surface)
                low, high = two.held(_WIDEST)
                found.append((two.penalised, replace(estimate, ci_low=low, ci_high=high)))
        knee = fit_knee(record, everywhere)
        if knee is not None and LOWEST < knee.run.fit.hurst < 1.0 and knee.longer.high > _FLAT:
            found.append((knee.penalised, knee_estimate(knee, record, surface)))
        run = longest_run(record)
        if run.last - run.first > 1 and LOWEST < run.fit.hurst < 1.0:
            low, high = interval_of_run(run, record)
            estimate = replace(run_estimate(run, surface), ci_low=low, ci_high=high)
            found.append((penalised_deviance(record, run, everywhere), estimate))
        if part is not blocks:
            found = [(cost, replace(each, note=joined(each.note, NO_ALIASES))) for cost, each in found]
        result += [(cost + DECISIVE, each) for cost, each in found]
    return result


def _high_passed(blocks: Blocks, fit: BlurredFit | None, surface: Surface) -> list[tuple[float, Estimate]]:
    """Return estimates of a Gaussian high-pass filter, perhaps with a blur and noise, and their deviances.

    Octaves of waves shorter than those of the blur have their own law.
    """
    record = octaves(blocks)
    longest, inside = record[-1].fit, np.ones(blocks.count.size, dtype=bool)
    if 0.5 * (longest.hurst + longest.high) > _PRESENT:
        return []
    blurs = [(NONE, 0.0)]
    if fit is not None and fit.form != NONE:
        inside = blocks.wavelength >= blocks.wavelength[fit.inside].min()
        blurs.append((fit.form, max(fit.spread, _LEAST_SPREAD)))
    parts = [part for part in (octave.inside & ~inside for octave in record) if np.any(part)]
    rest = sum(fit_power_law(blocks, part).deviance + 4.0 for part in parts)
    fits = [
        fit_rolloff(blocks, inside, shape=HIGH_PASS, blur=blur, noise=noise)
        for blur in blurs
        for noise in (False, True)
    ]
    found = [each for each in fits if each is not None and each.law.hurst > LOWEST and each.law.low < 1.0]
    return [(each.penalised + rest, rolloff_estimate(each, blocks, surface)) for each in found]


def _largest_share(power: Array) -> float:
    """Return the share of the shorter waves of a profile that one of them and its neighbours hold."""
    shorter = power[_LONGEST_MODES:]
    strongest = int(np.argmax(shorter))
    if strongest < _NEIGHBOURS or not shorter[strongest] > 0.0:
        return 0.0
    inside = slice(strongest - _NEIGHBOURS, strongest + _NEIGHBOURS + 1)
    return float(shorter[inside].sum() / shorter.sum())
