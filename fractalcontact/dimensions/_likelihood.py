"""Maximum likelihood estimate of H, for the family that the surface belongs to (method "likelihood").

Surfaces with free edges: fractional Brownian heights, by their cosine modes. Periodic surfaces: a power-law
spectrum between cut-offs. Profiles with free ends: the exact likelihood of their increments.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _cosine_modes, _mode_blocks, _periodic_modes, _profile_likelihood
from fractalcontact.dimensions._blur import BlurredFit, fit_blurred
from fractalcontact.dimensions._exponent_by_scale import (
    Blocks,
    alternatives,
    frame_blocks,
    longest_run,
    octaves,
    run_estimate,
    several_exponents,
)
from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import Moments, increment_moments
from fractalcontact.dimensions._increments import closed_form, without_steps
from fractalcontact.dimensions._mode_blocks import LOWEST
from fractalcontact.dimensions._periodic_modes import PeriodicModes
from fractalcontact.dimensions._quantisation import quantisation, quantisation_note
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    joined,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._transfer_functions import FORMS, NONE
from fractalcontact.dimensions._waves import without_waves
from fractalcontact.dimensions._whittle import (
    LEAST_MODES,
    UNEVEN,
    WhittleFit,
    allowing_noise,
    fit_interval,
    holding_sectors,
)

Array = np.ndarray[Any, np.dtype[Any]]
SurfaceModes = _cosine_modes.FreeModes | _mode_blocks.BlockModes

_CLEAR = {1: 9.0, 2: 4.0}  # decrease of the penalised deviance from which blur or noise is seen, by axes
_BEYOND = 4.0  # spreads: increments over so many are little changed by a blur
_WEAK = 2.0  # the same from which the interval of a profile allows for blur and noise
_WEAK_NOISE = 0.05  # of the rms increment: noise that the interval of a surface allows for
# misfits below and above which the interval of a surface allows for blur, noise and a second exponent: noise
# and a rougher second surface make it positive, and are seen later than a blur
_SLIGHT = -2.5, 1.5
_VAGUE = 1.0  # width of an interval that says nothing
_VAGUE_RUN = 0.7  # the same of the longest run of octaves
_LEAST_POINTS = 64  # of a profile whose blur is looked for
_LONGEST_MODES, _NEIGHBOURS = 16, 8  # longest waves of a profile, and neighbours of a single shorter one
_SINGLE = 0.9  # share of the power beyond the longest that these may hold
_LARGE = 1 << 20  # points of a surface beyond which modes are taken in blocks
_ROUNDING = 1e-26  # relative rounding of the mean square in transforms
_PERIODIC_WINDOW = "all modes of the band: cut-offs and roll-off found from the spectrum"
_FREE_WINDOW = "all modes that vary along both axes"
_BLURRED_WINDOW = "the modes that a model of blur and noise fits"
_ASKED = "asked for"
_INTERPOLATED = 0.01  # share of heights on a line with their neighbours
_LINEAR = (
    "many heights lie exactly on lines between their neighbours: they were interpolated, and the short waves "
    "are those of the interpolation; grid the points with fractalcontact.surfaces.from_points, or give "
    "`scales` from eight distances of the points on"
)
_FEW_GAPS = 0.002  # share of the heights that may be filled without an effect on the waves
_SMALL_GAPS = 0.05  # share of the cells of a gridded surface
_RESOLVED_WINDOW = "all wavelengths that the points of the gridded surface resolve"
_PERIODIC_FAMILY = "periodic family: power law between cut-offs"
_PERIODIC_GAPS = (
    "a periodic surface with gaps, or with one periodic axis, is treated as free, and the interval is for "
    "another family than its own: see fractalcontact.surfaces.fill"
)
_OF_SECTORS = (
    "a few waves hold more than their share: a lay, a step or a pattern; the interval holds the exponents of "
    "sectors of azimuth, each fitted alone"
)
_OR_SECOND = (
    "a second, smaller exponent of the shorter waves explains them nearly as well: the interval holds it; "
    "give `noise=True` where it is noise"
)
_CUT_OFF_BELOW_NOISE = (
    "a cut-off that is below the noise looks like another exponent: give `scales` inside the power law of a "
    "surface; the modes of a profile are too few"
)
_NEGATIVE_NOISE = (
    "the fitted noise is negative and reported as 0: there is none, or short waves were smoothed away"
)


def likelihood(surface: Surface, scales: Scales, noise: bool, psf: float | None = None) -> Estimate:
    """Fit the periodic family where every axis is periodic, otherwise fractional Brownian heights.

    Single waves are removed first. `psf` is the spread of a known point spread function in m.
    """
    if surface.is_constant:
        return undefined(CONSTANT)
    if surface.is_plane:
        return plane()
    is_interpolated = scales is None and not surface.finest_scale and surface.linear_share > _INTERPOLATED
    surface, wave_note = without_waves(surface)
    estimate = _fitted(surface, scales, noise, psf)
    estimate = replace(estimate, note=joined(wave_note, estimate.note))
    if is_interpolated and not estimate.reason:
        return replace(estimate.without_interval(_LINEAR), note=joined(_LINEAR, estimate.note))
    return estimate


def _fitted(surface: Surface, scales: Scales, noise: bool, psf: float | None) -> Estimate:
    """Fit the family of a surface without single waves."""
    if all(surface.grid.periodic) and surface.is_complete:
        return _periodic_surface(surface, scales, noise)
    if surface.finest_scale and scales is None:
        resolved = _fitted(surface, surface.resolved(scales), noise, psf)
        return replace(resolved, window=_RESOLVED_WINDOW)
    spread = None if psf is None else psf / surface.spacing[1]
    family = _profile if surface.axes == 1 else _free_surface
    estimate = family(surface, scales, noise, spread)
    if not any(surface.grid.periodic) or estimate.reason:
        return estimate
    return estimate.without_interval(_PERIODIC_GAPS)


def _free_surface(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit the cosine modes of a surface with free edges; `spread` in spacings is that of a known blur."""
    heights = _cropped(surface.heights)
    if surface.finest_scale:
        heights = _without_small_gaps(heights, surface.plane_spacing)
    dx = surface.spacing[1]
    pilot = _pilot(heights, surface.plane_spacing)
    window = None if scales is None else (scales[0] / dx, scales[1] / dx)
    modes = _modes(heights, surface.plane_spacing, window, pilot)
    if modes.number < LEAST_MODES:
        return undefined(f"{modes.number:.0f} modes in the window, at least {LEAST_MODES} are needed")
    centred = heights - np.nanmean(heights)
    if float(modes.power.mean()) * modes.number <= _ROUNDING * float(np.nansum(centred * centred)):
        return undefined(
            "the heights vary along one axis only, or are a sum f(x) + g(y), which no surface of one "
            "exponent is: estimate profiles, or see `directions`"
        )
    fit = modes.fit(pilot, noise)
    levelled, stride, hurst = _without_offsets(heights), _stride(scales, max(surface.spacing)), fit.hurst
    blocks = heterogeneity(_moments(levelled, stride), surface.plane_spacing, hurst)
    if blocks.note and scales is None and spread is None and not noise and not surface.finest_scale:
        ground = without_steps(heights, surface.plane_spacing, hurst)
        if ground is not None:
            return replace(
                ground,
                scale_min=min(surface.spacing),
                scale_max=4.0 * max(surface.spacing),
                rms_increment=ground.rms_increment * surface.unit,
                misfit=fit.misfit,
            )
    other = None
    # unequal parts count for fewer modes
    is_bent = abs(fit.misfit) > SIGNIFICANT * blocks.widening
    is_bent &= not surface.finest_scale  # gridding has removed short waves, as a blur does
    # blur and noise together may be as straight as a smooth surface; unequal parts are neither
    is_odd = is_bent or (noise and fit.noise < 0.0)
    is_odd |= not blocks.note and (fit.hurst > 1.0 or modes.scatter(fit) < -UNEVEN)
    if modes.gapped is None and (spread is not None or (is_odd and not surface.finest_scale)):
        frame = _mode_blocks.frame(heights.shape, surface.plane_spacing)
        power = _cosine_modes.mode_power(heights)
        other, is_even = _with_blur(power, frame, surface, scales, noise, spread)
        if other is None and is_bent and scales is None:
            other = _longest_run(modes, heights, frame_blocks(power, frame), surface, is_even=is_even)
    elif is_bent and scales is None and spread is None and not noise:
        other = _run_beside_gaps(heights, surface)
    if other is not None:
        estimate, stride, hurst = *other, other[0].hurst
        blocks = heterogeneity(_moments(levelled, stride), surface.plane_spacing, hurst)
        longest = float(np.fmin(modes.order.max() * dx, estimate.scale_max))
        estimate = replace(estimate, scale_max=longest, misfit=fit.misfit)
    else:
        fit, estimate = fit_interval(modes, pilot, noise, fit)
        noise_height = float(np.sqrt(max(fit.noise, 0.0))) * surface.unit if noise else np.nan
        estimate = replace(
            estimate,
            scale_min=float(modes.order.min()) * dx,
            scale_max=float(modes.order.max()) * dx,
            rms_increment=_rms_increment(fit) * surface.unit,
            noise_height=noise_height,
            window=_FREE_WINDOW if scales is None else _ASKED,
            note=joined(_NEGATIVE_NOISE if noise and fit.noise < 0 else "", estimate.note),
        )
        if not noise and modes.gapped is None and abs(fit.misfit) <= SIGNIFICANT:
            estimate = _allowing_noise(estimate, modes, fit)
            is_slight = not _SLIGHT[0] < fit.misfit < _SLIGHT[1]
            is_slight &= not blocks.note and heights.size <= _LARGE
            if is_slight and scales is None and not surface.finest_scale and fit.hurst < 1.0:
                estimate = _allowing_scales(estimate, heights, surface, fit.misfit)
    low, high = blocks.widened(hurst, estimate.ci_low, estimate.ci_high)
    rounding_note = "" if noise else _quantisation_note(heights, estimate.standard_error)
    if rounding_note and other is None:
        with_noise = fit_interval(modes, pilot, True)[1]
        low, high = float(np.fmin(low, with_noise.ci_low)), float(np.fmax(high, with_noise.ci_high))
    periodic_note = "a periodic surface with gaps is treated as free" if all(surface.grid.periodic) else ""
    return replace(
        estimate,
        standard_error=estimate.standard_error * blocks.widening,
        ci_low=low,
        ci_high=high,
        note=joined(periodic_note, estimate.note, blocks.note, rounding_note),
    )


def _modes(heights: Array, spacing: tuple[float, float], scales: Scales, pilot: float) -> SurfaceModes:
    """Return the modes of a surface, those of a large complete one in blocks; `scales` in spacings of x."""
    if heights.size > _LARGE and np.isfinite(heights.min()):
        return _mode_blocks.BlockModes.of(heights, spacing, scales)
    lattice = _cosine_modes.Lattice.of((heights.shape[0], heights.shape[1]), spacing)
    chosen = between(_cosine_modes.wavelengths(lattice), scales)
    return _cosine_modes.FreeModes.of(heights, lattice, chosen, pilot)


def _allowing_noise(estimate: Estimate, modes: SurfaceModes, fit: WhittleFit) -> Estimate:
    """Widen the interval by the exponents of noise that is too weak to be seen."""
    if not fit.hurst < 1.0:
        return estimate
    interval = estimate.ci_low, estimate.ci_high
    low, high = allowing_noise(
        interval, modes.power, fit, (_WEAK_NOISE * _rms_increment(fit)) ** 2, modes.count
    )
    return replace(estimate, ci_low=low, ci_high=high)


def _allowing_scales(estimate: Estimate, heights: Array, surface: Surface, misfit: float) -> Estimate:
    """Widen the interval by what blur, noise or a second exponent would give that cannot be excluded."""
    frame = _mode_blocks.frame(heights.shape, surface.plane_spacing)
    power = _cosine_modes.mode_power(heights)
    fit = fit_blurred(power, frame)
    if fit is None:
        return estimate
    low, high = alternatives(fit, frame_blocks(power, frame), is_bent=False)
    note = (
        f"the exponent may change with scale ({misfit:+.1f} standard deviations): the interval holds those "
        "that blur, noise or a second exponent would give"
    )
    low, high = min(estimate.ci_low, low), max(estimate.ci_high, high)
    return replace(estimate, ci_low=low, ci_high=high, note=joined(estimate.note, note))


def _with_blur(
    power: Array,
    frame: _mode_blocks.Frame,
    surface: Surface,
    scales: Scales,
    noise: bool,
    spread: float | None,
) -> tuple[tuple[Estimate, int] | None, bool]:
    """Return the estimate with blur and noise, and a lag beyond the blur; None where they are not seen.

    The second result is whether no few waves dominate the modes.
    """
    fit = fit_blurred(power, frame, noise=noise, spread=spread, chosen=_chosen(frame, surface, scales))
    if fit is None or not _is_seen(fit, surface.axes, spread):
        return None, fit is None or fit.is_even
    if scales is None and spread is None and not noise:
        several = several_exponents(fit, frame_blocks(power, frame), surface)
        if several is not None:
            return (several, max(1, round(0.5 * several.scale_min / max(surface.spacing)))), True
    estimate = _blurred_estimate(fit, surface, fit.amplitude / max(1.0 - fit.hurst, 1e-9))
    if scales is None and spread is None and not noise:
        estimate = _allowing_second(estimate, fit, frame_blocks(power, frame))
    stride = max(_stride(scales, max(surface.spacing)), round(_BEYOND * fit.spread))
    return (replace(estimate, window=_BLURRED_WINDOW if scales is None else _ASKED), stride), True


def _allowing_second(estimate: Estimate, fit: BlurredFit, blocks: Blocks) -> Estimate:
    """Widen the interval of a fit of blur and noise by a second exponent that cannot be excluded."""
    low, high = alternatives(fit, blocks, is_bent=True)
    if low >= estimate.ci_low and high <= estimate.ci_high:
        return estimate
    low, high = min(estimate.ci_low, low), max(estimate.ci_high, high)
    return replace(estimate, ci_low=low, ci_high=high, note=joined(estimate.note, _OR_SECOND))


def _chosen(frame: _mode_blocks.Frame, surface: Surface, scales: Scales) -> Array:
    """Return the blocks of modes inside the window."""
    return between(2.0 * np.pi / np.sqrt(frame.squares) * surface.spacing[1], scales)


def _is_seen(fit: BlurredFit, axes: int, spread: float | None) -> bool:
    """Return whether blur or noise agrees with the modes better than the surface alone, or is given."""
    if spread is not None:
        return True
    return fit.is_good and fit.gain > _CLEAR[axes] and fit.high - fit.low < _VAGUE


def _blurred_estimate(fit: BlurredFit, surface: Surface, amplitude: float) -> Estimate:
    """Return the estimate of a fit of blur and noise; `amplitude` is half the squared increment, (1 - H)."""
    has_noise = np.isfinite(fit.noise)
    parts = []
    if fit.form != NONE:
        spread = f" with a spread of {fit.spread:.2g} spacings" if fit.spread > 0.0 else ""
        parts = [FORMS[fit.form] + spread]
    parts += ["white noise"] if has_noise else []
    fractal = fit.hurst < 1.0
    return Estimate(
        fit.hurst,
        fit.standard_error,
        fit.low if fit.low > _mode_blocks.LOWEST else 0.0,
        fit.high,
        scale_min=fit.shortest * surface.spacing[1],
        rms_increment=float(np.sqrt(2.0 * amplitude)) * surface.unit if fractal else np.nan,
        noise_height=float(np.sqrt(fit.noise)) * surface.unit if has_noise else np.nan,
        blur_spread=fit.spread * surface.spacing[1] if fit.form != NONE else np.nan,
        note=f"the surface shows {' and '.join(parts)}, which is in the model" if parts else "",
    )


def _longest_run(
    modes: SurfaceModes, heights: Array, blocks: Blocks, surface: Surface, *, is_even: bool
) -> tuple[Estimate, int] | None:
    """Return the estimate of the longest run of octaves with one exponent, and a lag inside it.

    None if there is no run, or if few waves dominate it. Where they dominate the surface (`is_even` is False)
    the interval also holds the exponents of sectors of azimuth.
    """
    run = longest_run(octaves(blocks))
    if not run.last > run.first or not LOWEST < run.fit.hurst < 1.0:
        return None
    inside = between(modes.order, (run.low, run.high))
    if modes.is_uneven(inside, run.fit.hurst):
        return None
    estimate, stride = run_estimate(run, surface), max(1, round(0.5 * run.low))
    if is_even:
        return estimate, stride
    part = _modes(heights, surface.plane_spacing, (run.low, run.high), run.fit.hurst)
    low, high = holding_sectors((estimate.ci_low, estimate.ci_high), part, run.fit.hurst)
    if not high - low < _VAGUE_RUN:
        return None
    return replace(estimate, ci_low=low, ci_high=high, note=joined(estimate.note, _OF_SECTORS)), stride


def _run_beside_gaps(heights: Array, surface: Surface) -> tuple[Estimate, int] | None:
    """Return `_longest_run` of a surface with few gaps, which are filled; None if they are many."""
    if surface.finest_scale:
        return None
    filled = _without_small_gaps(heights, surface.plane_spacing, _FEW_GAPS)
    if np.isnan(filled).any():
        return None
    frame = _mode_blocks.frame(filled.shape, surface.plane_spacing)
    power = _cosine_modes.mode_power(filled)
    fit = fit_blurred(power, frame)
    is_even = fit is not None and fit.is_even
    modes = _modes(filled, surface.plane_spacing, None, _pilot(filled, surface.plane_spacing))
    return _longest_run(modes, filled, frame_blocks(power, frame), surface, is_even=is_even)


def _periodic_surface(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Fit a power law to the modes of a periodic surface or profile."""
    heights = surface.heights if surface.axes == 2 else surface.heights[0]
    modes = PeriodicModes.of(heights, surface.relative_spacing)
    unit = max(surface.grid.extent)
    has_rolloff = surface.axes == 1 and scales is None and not noise
    if has_rolloff:
        low, high = _periodic_modes.cut_offs(modes)
    elif scales is None:
        low, high = _periodic_modes.band(modes)
    else:
        low, high = unit / scales[1], unit / scales[0]
    modes = modes.between(low, high)
    if modes.weights.sum() < LEAST_MODES:
        return undefined(f"{modes.weights.sum():.0f} modes in the band, at least {LEAST_MODES} are needed")
    if has_rolloff:
        modes, fit, estimate = _with_rolloff(modes)
    else:
        fit, estimate = fit_interval(modes, 0.5, noise)
    if noise and (surface.axes == 1 or (scales is None and abs(fit.misfit) > SIGNIFICANT)):
        estimate = estimate.without_interval(_CUT_OFF_BELOW_NOISE)
    rounding_note = "" if noise else _quantisation_note(surface.heights, estimate.standard_error)
    if rounding_note:
        with_noise = fit_interval(modes, 0.5, True)[1]
        estimate = replace(
            estimate,
            ci_low=min(estimate.ci_low, with_noise.ci_low),
            ci_high=max(estimate.ci_high, with_noise.ci_high),
        )
    jumps = np.diff(heights, append=heights[..., :1], axis=-1)
    cell = float(np.prod(surface.relative_spacing))
    noise_note = _NEGATIVE_NOISE if noise and fit.noise < 0 else ""
    return replace(
        estimate,
        scale_min=unit / float(modes.wavenumber.max()),
        scale_max=unit / float(modes.wavenumber.min()),
        rms_increment=float(np.sqrt(np.mean(jumps * jumps))) * surface.unit,
        noise_height=float(np.sqrt(max(fit.noise / cell, 0.0))) * surface.unit if noise else np.nan,
        window=_PERIODIC_WINDOW if scales is None else _ASKED,
        note=joined(_PERIODIC_FAMILY, noise_note, estimate.note, rounding_note),
    )


def _with_rolloff(modes: PeriodicModes) -> tuple[PeriodicModes, WhittleFit, Estimate]:
    """Fit a profile with a roll-off at any wavelength; return its modes beyond the corner as well."""
    rolloff = _periodic_modes.fit_rolloff(modes)
    modes = modes.between(rolloff.corner, np.inf)
    fit, estimate = fit_interval(modes, float(np.clip(rolloff.hurst, 0.01, 1.5)), False)
    low, high = rolloff.low, rolloff.high
    if estimate.note:  # the modes do not follow one power law
        low, high = min(low, estimate.ci_low), max(high, estimate.ci_high)
    estimate = replace(
        estimate,
        hurst=rolloff.hurst,
        standard_error=rolloff.standard_error,
        ci_low=low,
        ci_high=high,
    )
    return modes, fit, estimate


def _profile(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit a profile with its exact likelihood, or with that of its modes where it is blurred."""
    heights, dx = surface.heights[0], surface.spacing[1]
    weak = np.nan, np.nan
    if np.isfinite(heights).all() and heights.size >= _LEAST_POINTS and not surface.finest_scale:
        estimate, weak = _profile_modes(surface, scales, noise, spread)
        if estimate is not None:
            return estimate
    stride = 1 if scales is None else max(1, int(np.ceil(scales[0] / dx * (1 - 1e-9))))
    heights = heights[::stride]
    largest = _profile_likelihood.CHUNK
    longest = largest if scales is None else int(scales[1] / (dx * stride) * (1 + 1e-9)) + 1
    chunk = min(longest, largest, int(np.isfinite(heights).sum()))
    smallest = _profile_likelihood.SMALLEST
    if chunk < smallest:
        return undefined(f"{chunk} points, at least {smallest} are needed")
    fit = _profile_likelihood.fit_profile(heights, noise=noise, chunk=chunk)
    window: dict[str, Any] = {
        "scale_min": stride * dx,
        "scale_max": (chunk - 1) * stride * dx,
        "window": "exact likelihood of all increments" if scales is None else _ASKED,
    }
    if fit.low > 1.0:
        return Estimate(fit.hurst, ci_low=fit.low, ci_high=fit.high, **window)
    moments = increment_moments([(heights[None], 1)], (heights.size,))
    blocks = heterogeneity(moments, (1.0,), fit.hurst)
    low, high = blocks.widened(fit.hurst, fit.low, fit.high)
    low, high = float(np.fmin(low, weak[0])), float(np.fmax(high, weak[1]))
    noise_note = ""
    if not noise:
        low, high, noise_note = closed_form(moments, (1.0,)).widened_for_noise(low, high)
    rounding_note = "" if noise else _quantisation_note(heights[None], fit.standard_error)
    if rounding_note:
        with_noise = _profile_likelihood.fit_profile(heights, noise=True, chunk=chunk)
        low, high = min(low, with_noise.low), max(high, with_noise.high)
    return Estimate(
        fit.hurst,
        fit.standard_error * blocks.widening,
        low,
        high,
        rms_increment=fit.rms_increment * float(stride) ** -fit.hurst * surface.unit,
        noise_height=float(np.sqrt(fit.noise)) * surface.unit if noise else np.nan,
        note=joined(noise_note, blocks.note, rounding_note),
        **window,
    )


def _profile_modes(
    surface: Surface, scales: Scales, noise: bool, spread: float | None
) -> tuple[Estimate | None, tuple[float, float]]:
    """Return the estimate of a profile that is no fractional Brownian one, by its modes; None if it is one.

    The second result is an interval that allows for weak blur or noise; NaN where the modes show none.
    """
    heights, dx, none = surface.heights[0], surface.spacing[1], (np.nan, np.nan)
    frame = _mode_blocks.frame((heights.size,), (1.0,))
    modes = _mode_blocks.profile_modes(heights) ** 2
    if (share := _largest_share(modes)) > _SINGLE:
        reason = f"a single wave holds {100.0 * share:.0f} % of the shorter waves: no fractal"
        return undefined(reason), none
    blocks = frame_blocks(modes, frame)
    fit = fit_blurred(modes, frame, noise=noise, spread=spread, chosen=_chosen(frame, surface, scales))
    if fit is not None and _is_seen(fit, surface.axes, spread):
        if scales is None and spread is None and not noise:
            several = several_exponents(fit, blocks, surface)
            if several is not None:
                return several, none
        amplitude = fit.amplitude * heights.size ** (-2.0 * fit.hurst)
        estimate = _blurred_estimate(fit, surface, amplitude / max(1.0 - fit.hurst, 1e-9))
        longest = heights.size * dx if scales is None else scales[1]
        window = _BLURRED_WINDOW if scales is None else _ASKED
        return replace(estimate, scale_max=longest, window=window), none
    record = octaves(blocks)
    run = longest_run(record)
    if scales is None and 0 < run.last - run.first < len(record) and LOWEST < run.fit.hurst < 1.0:
        return run_estimate(run, surface), none
    if fit is None or noise or not (fit.is_good and fit.gain > _WEAK and fit.hurst < 1.0):
        return None, none
    return None, (max(fit.low, 0.0), min(fit.high, 1.0))


def _largest_share(power: Array) -> float:
    """Return the share of the shorter waves of a profile that one of them and its neighbours hold."""
    shorter = power[_LONGEST_MODES:]
    strongest = int(np.argmax(shorter))
    if strongest < _NEIGHBOURS or not shorter[strongest] > 0.0:
        return 0.0
    inside = slice(strongest - _NEIGHBOURS, strongest + _NEIGHBOURS + 1)
    return float(shorter[inside].sum() / shorter.sum())


def _quantisation_note(heights: Array, error: float) -> str:
    """Return a note where the heights were rounded so coarsely that it matters; empty otherwise."""
    share = quantisation(heights)[1]
    return quantisation_note(share, "that of a fit with white noise") if share > 0.5 * error else ""


def _without_offsets(heights: Array) -> Array:
    """Subtract an offset of each row and each column, which the modes are insensitive to."""
    if np.isnan(heights).any():
        return heights
    return np.asarray(heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True) + heights.mean())


def _moments(heights: Array, stride: int) -> Moments:
    """Return the mean square increments of levelled heights and of their blocks."""
    return increment_moments([(heights, len(heights))], heights.shape, stride)


def _stride(scales: Scales, spacing: float) -> int:
    """Return the stride whose second differences resolve the shortest waves of the window."""
    return 1 if scales is None else max(1, round(0.5 * scales[0] / spacing))


def _pilot(heights: Array, spacing: tuple[float, float]) -> float:
    """Return a first estimate of H."""
    moments = increment_moments([(heights, heights.shape[0])], heights.shape)
    hurst = closed_form(moments, spacing, error=False).hurst
    return float(np.clip(hurst, 0.03, 0.98)) if np.isfinite(hurst) else 0.5


def _rms_increment(fit: WhittleFit) -> float:
    """Return the rms increment over one x spacing that corresponds to the amplitude."""
    return float(np.sqrt(2.0 * fit.amplitude / (1.0 - fit.hurst))) if fit.hurst < 1.0 else float("nan")


def _without_small_gaps(heights: Array, spacing: tuple[float, float], most: float = _SMALL_GAPS) -> Array:
    """Fill the gaps of a gridded surface by harmonic interpolation, unless they are many.

    The model of the gaps has the short waves that gridding has removed; with it one fit in six of surfaces
    of H 0.9 did not converge. Only waves longer than most gaps are used. Nearest heights would meet in steps
    inside a larger hole, whose power falls as that of H = 0.5: with a hole of 3 % of the area they lowered H
    from 0.9 to 0.84.
    """
    observed = np.isfinite(heights)
    if not 0 < np.count_nonzero(~observed) <= most * heights.size:
        return heights
    values = heights[observed]
    return _cosine_modes.Filling(observed, spacing)(values - values.mean())


def _cropped(heights: Array) -> Array:
    """Remove the rows and columns at the border where nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
