"""Maximum likelihood estimate of H, for the family that the surface belongs to (method "likelihood").

Surfaces with free edges: fractional Brownian heights, by their cosine modes. Periodic surfaces: a power-law
spectrum between cut-offs. Profiles with free ends: the exact likelihood of their increments.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _cosine_modes, _periodic_modes, _profile_likelihood
from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments
from fractalcontact.dimensions._increments import closed_form
from fractalcontact.dimensions._periodic_modes import PeriodicModes
from fractalcontact.dimensions._quantisation import quantisation, quantisation_note
from fractalcontact.dimensions._records import CONSTANT, SIGNIFICANT, Estimate, joined, plane, undefined
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._waves import without_waves
from fractalcontact.dimensions._whittle import LEAST_MODES, WhittleFit, fit_interval

Array = np.ndarray[Any, np.dtype[Any]]

_ROUNDING = 1e-26  # relative rounding of the mean square in transforms
_PERIODIC_WINDOW = "all modes of the band: cut-offs and roll-off found from the spectrum"
_FREE_WINDOW = "all modes that vary along both axes"
_ASKED = "asked for"
_SMALL_GAPS = 0.05  # share of the cells of a gridded surface
_RESOLVED_WINDOW = "all wavelengths that the points of the gridded surface resolve"
_PERIODIC_FAMILY = "periodic family: power law between cut-offs"
_PERIODIC_GAPS = (
    "a periodic surface with gaps, or with one periodic axis, is treated as free, and the interval is for "
    "another family than its own: see fractalcontact.surfaces.fill"
)
_CUT_OFF_BELOW_NOISE = (
    "a cut-off that is below the noise looks like another exponent: give `scales` inside the power law of a "
    "surface; the modes of a profile are too few"
)
_NEGATIVE_NOISE = (
    "the fitted noise is negative and reported as 0: there is none, or short waves were smoothed away"
)


def likelihood(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Fit the periodic family where every axis is periodic, otherwise fractional Brownian heights.

    Single waves are removed first.
    """
    if surface.is_constant:
        return undefined(CONSTANT)
    if surface.is_plane:
        return plane()
    surface, wave_note = without_waves(surface)
    estimate = _fitted(surface, scales, noise)
    return replace(estimate, note=joined(wave_note, estimate.note))


def _fitted(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    if all(surface.grid.periodic) and surface.is_complete:
        return _periodic_surface(surface, scales, noise)
    if surface.finest_scale and scales is None:
        return replace(likelihood(surface, surface.resolved(scales), noise), window=_RESOLVED_WINDOW)
    estimate = (
        _profile(surface, scales, noise) if surface.axes == 1 else _free_surface(surface, scales, noise)
    )
    if not any(surface.grid.periodic) or estimate.reason:
        return estimate
    return replace(estimate, standard_error=np.nan, ci_low=np.nan, ci_high=np.nan, reason=_PERIODIC_GAPS)


def _free_surface(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Fit the cosine modes of a surface with free edges."""
    heights = _cropped(surface.heights)
    if surface.finest_scale:
        heights = _without_small_gaps(heights)
    dx = surface.spacing[1]
    lattice = _cosine_modes.Lattice.of(heights.shape, (surface.spacing[0] / dx, 1.0))
    lengths = _cosine_modes.wavelengths(lattice) * dx
    chosen = _between(lengths, scales)
    if np.count_nonzero(chosen) < LEAST_MODES:
        return undefined(f"{np.count_nonzero(chosen)} modes in the window, at least {LEAST_MODES} are needed")
    pilot = _pilot(heights, lattice.spacing)
    modes = _cosine_modes.FreeModes.of(heights, lattice, chosen, pilot)
    centred = heights - np.nanmean(heights)
    if float(modes.power.sum()) <= _ROUNDING * float(np.nansum(centred * centred)):
        return undefined(
            "the heights vary along one axis only, or are a sum f(x) + g(y), which no surface of one "
            "exponent is: estimate profiles, or see `directions`"
        )
    fit, estimate = fit_interval(modes, pilot, noise)
    levelled = _without_offsets(heights)
    stride = _stride(scales, max(surface.spacing))
    moments = increment_moments([(levelled, len(levelled))], levelled.shape, stride)
    blocks = heterogeneity(moments, lattice.spacing, fit.hurst)
    low, high = blocks.widened(fit.hurst, estimate.ci_low, estimate.ci_high)
    rounding_note = "" if noise else _quantisation_note(heights, estimate.standard_error)
    if rounding_note:
        with_noise = fit_interval(modes, pilot, True)[1]
        low, high = float(np.fmin(low, with_noise.ci_low)), float(np.fmax(high, with_noise.ci_high))
    periodic_note = "a periodic surface with gaps is treated as free" if all(surface.grid.periodic) else ""
    noise_note = _NEGATIVE_NOISE if noise and fit.noise < 0 else ""
    return replace(
        estimate,
        standard_error=estimate.standard_error * blocks.widening,
        ci_low=low,
        ci_high=high,
        scale_min=float(lengths[chosen].min()),
        scale_max=float(lengths[chosen].max()),
        rms_increment=_rms_increment(fit) * surface.unit,
        noise_height=float(np.sqrt(max(fit.noise, 0.0))) * surface.unit if noise else np.nan,
        window=_FREE_WINDOW if scales is None else _ASKED,
        note=joined(periodic_note, noise_note, estimate.note, blocks.note, rounding_note),
    )


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
        estimate = replace(
            estimate, standard_error=np.nan, ci_low=np.nan, ci_high=np.nan, reason=_CUT_OFF_BELOW_NOISE
        )
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


def _profile(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Fit a profile with its exact likelihood."""
    heights, dx = surface.heights[0], surface.spacing[1]
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


def _quantisation_note(heights: Array, error: float) -> str:
    """Return a note where the heights were rounded so coarsely that it matters; empty otherwise."""
    share = quantisation(heights)[1]
    return quantisation_note(share, "that of a fit with white noise") if share > 0.5 * error else ""


def _without_offsets(heights: Array) -> Array:
    """Subtract an offset of each row and each column, which the modes are insensitive to."""
    if np.isnan(heights).any():
        return heights
    return np.asarray(heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True) + heights.mean())


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


def _between(lengths: Array, scales: Scales) -> Array:
    if scales is None:
        return np.ones(lengths.shape, dtype=bool)
    return np.asarray((lengths >= scales[0] * (1 - 1e-9)) & (lengths <= scales[1] * (1 + 1e-9)))


def _without_small_gaps(heights: Array) -> Array:
    """Fill the gaps of a gridded surface with the nearest heights, unless they are many.

    The model of the gaps has the short waves that gridding has removed; with it one fit in six of surfaces
    of H 0.9 did not converge. Only waves longer than most gaps are used.
    """
    missing = np.isnan(heights)
    if not 0 < np.count_nonzero(missing) <= _SMALL_GAPS * heights.size:
        return heights
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(heights[tuple(nearest)])


def _cropped(heights: Array) -> Array:
    """Remove the rows and columns at the border where nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
