"""The default estimator: maximum likelihood for the family that the face belongs to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _exact, _increments, _modes, _periodic, _plateaus, _whittle
from fractalcontact.dimensions._estimates import CONSTANT, STRANGE, Estimate, plane, undefined
from fractalcontact.dimensions._evenness import evenness
from fractalcontact.dimensions._faces import Face
from fractalcontact.dimensions._fitting import LEAST_MODES, FreeModes, PeriodicModes, fitted
from fractalcontact.dimensions._rounding import quantum, told

Array = np.ndarray[Any, np.dtype[Any]]
Scales = tuple[float, float] | None

_ROUNDING = 1e-26  # share of the mean square that transforms lose
_PERIODIC = "all modes of the band: cut-offs and plateau found from the spectrum"
_FAMILY = "periodic family: power law between cut-offs"
_TORN = (
    "a periodic face with gaps, or with one periodic axis, is taken as free, and the interval is for another "
    "family than its own: see fractalcontact.surfaces.fill"
)
_DROWNED = (
    "a cut-off that is under the noise looks like another exponent: give `scales` inside the power law of a "
    "surface; the modes of a profile are too few"
)
_FREE = "all modes that vary along both axes"
_SMOOTHED = "the fitted noise is below zero and told as 0: there is none, or short waves were smoothed away"
_ASKED = "asked for"


def likelihood(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit the periodic family where every axis is periodic, else fractional Brownian heights."""
    if face.is_constant:
        return undefined(CONSTANT)
    if face.is_plane:
        return plane()
    if all(face.grid.periodic) and face.complete:
        return _periodic_face(face, scales, noise)
    found = _profile(face, scales, noise) if face.axes == 1 else _free_face(face, scales, noise)
    if not any(face.grid.periodic) or found.not_given:
        return found
    return replace(found, standard_error=np.nan, low=np.nan, high=np.nan, not_given=_TORN)


def _free_face(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit the cosine modes of a face with free edges."""
    heights = _cropped(face.heights)
    dx = face.spacing[1]
    lattice = _modes.Lattice.of(heights.shape, (face.spacing[0] / dx, 1.0))
    lengths = _modes.wavelengths(lattice) * dx
    chosen = _between(lengths, scales)
    if np.count_nonzero(chosen) < LEAST_MODES:
        return undefined(f"{np.count_nonzero(chosen)} modes in the window, at least {LEAST_MODES} are needed")
    pilot = _pilot(heights, lattice.steps)
    modes = FreeModes.of(heights, lattice, chosen, pilot)
    centred = heights - np.nanmean(heights)
    if float(modes.power.sum()) <= _ROUNDING * float(np.nansum(centred * centred)):
        return undefined(
            "the heights vary along one axis only, or are a sum f(x) + g(y), which no surface of one "
            "exponent is: estimate profiles, or see `directions`"
        )
    fit, estimate = fitted(modes, pilot, noise)
    every = _stride(scales, max(face.spacing))
    level = _without_offsets(heights)
    parts = evenness(_increments.moments([(level, len(level))], level.shape, every), lattice.steps, fit.hurst)
    low, high = parts.applied(fit.hurst, estimate.low, estimate.high)
    rounded = "" if noise else _rounded(heights, estimate.standard_error)
    if rounded:
        loud = fitted(modes, pilot, True)[1]
        low, high = float(np.fmin(low, loud.low)), float(np.fmax(high, loud.high))
    as_free = "a periodic face with gaps is taken as free" if all(face.grid.periodic) else ""
    smooth = _SMOOTHED if noise and fit.noise < 0 else ""
    return replace(
        estimate,
        standard_error=estimate.standard_error * parts.widening,
        low=low,
        high=high,
        scale_min=float(lengths[chosen].min()),
        scale_max=float(lengths[chosen].max()),
        increment=_increment(fit) * face.unit,
        noise=float(np.sqrt(max(fit.noise, 0.0))) * face.unit if noise else np.nan,
        window=_FREE if scales is None else _ASKED,
        note="; ".join(part for part in (as_free, smooth, estimate.note, parts.note, rounded) if part),
    )


def _periodic_face(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit a power law to the modes of a periodic face."""
    heights = face.heights if face.axes == 2 else face.heights[0]
    modes = _periodic.modes(heights, face.steps)
    unit = max(face.grid.extent)
    bent = face.axes == 1 and scales is None and not noise
    if bent:
        low, high = _periodic.cut_offs(modes)
    else:
        low, high = _periodic.band(modes) if scales is None else (unit / scales[1], unit / scales[0])
    modes = modes.inside(low * (1 - 1e-9), high * (1 + 1e-9))
    if modes.weights.sum() < LEAST_MODES:
        return undefined(f"{modes.weights.sum():.0f} modes in the band, at least {LEAST_MODES} are needed")
    if bent:
        modes, fit, estimate = _beyond_plateau(modes)
    else:
        fit, estimate = fitted(PeriodicModes(modes), 0.5, noise)
    if noise and (face.axes == 1 or (scales is None and abs(fit.misfit) > STRANGE)):
        estimate = replace(estimate, standard_error=np.nan, low=np.nan, high=np.nan, not_given=_DROWNED)
    rounded = "" if noise else _rounded(face.heights, estimate.standard_error)
    if rounded:
        loud = fitted(PeriodicModes(modes), 0.5, True)[1]
        estimate = replace(estimate, low=min(estimate.low, loud.low), high=max(estimate.high, loud.high))
    step = np.diff(heights, append=heights[..., :1], axis=-1)
    cell = float(np.prod(face.steps))
    return replace(
        estimate,
        scale_min=unit / float(modes.wavenumber.max()),
        scale_max=unit / float(modes.wavenumber.min()),
        increment=float(np.sqrt(np.mean(step * step))) * face.unit,
        noise=float(np.sqrt(max(fit.noise / cell, 0.0))) * face.unit if noise else np.nan,
        window=_PERIODIC if scales is None else _ASKED,
        note="; ".join(
            part
            for part in (_FAMILY, _SMOOTHED if noise and fit.noise < 0 else "", estimate.note, rounded)
            if part
        ),
    )


def _beyond_plateau(modes: _periodic.Modes) -> tuple[_periodic.Modes, _whittle.WhittleFit, Estimate]:
    """Fit a profile with a plateau of any length; return its modes beyond that as well."""
    found = _plateaus.fit(modes)
    modes = modes.inside(found.corner, np.inf)
    fit, estimate = fitted(PeriodicModes(modes), float(np.clip(found.hurst, 0.01, 1.5)), False)
    low, high = found.low, found.high
    if estimate.note:  # the modes do not follow one power law
        low, high = min(low, estimate.low), max(high, estimate.high)
    estimate = replace(estimate, hurst=found.hurst, standard_error=found.standard_error, low=low, high=high)
    return modes, fit, estimate


def _profile(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit a profile with its exact likelihood."""
    heights, dx = face.heights[0], face.spacing[1]
    every = 1 if scales is None else max(1, int(np.ceil(scales[0] / dx * (1 - 1e-9))))
    heights = heights[::every]
    longest = _exact.CHUNK if scales is None else int(scales[1] / (dx * every) * (1 + 1e-9)) + 1
    chunk = min(longest, _exact.CHUNK, int(np.isfinite(heights).sum()))
    if chunk < _exact.SMALLEST:
        return undefined(f"{chunk} points, at least {_exact.SMALLEST} are needed")
    fit = _exact.fit_profile(heights, noise=noise, chunk=chunk)
    moments = _increments.moments([(heights[None], 1)], (heights.size,))
    parts = evenness(moments, (1.0,), fit.hurst)
    low, high = parts.applied(fit.hurst, fit.low, fit.high)
    turned = ""
    if not noise:
        low, high, turned = _increments.closed_form(moments, (1.0,)).quieted(low, high)
    rounded = "" if noise else _rounded(heights[None], fit.standard_error)
    if rounded:
        loud = _exact.fit_profile(heights, noise=True, chunk=chunk)
        low, high = min(low, loud.low), max(high, loud.high)
    return Estimate(
        fit.hurst, fit.standard_error * parts.widening, low, high,
        scale_min=every * dx,
        scale_max=(chunk - 1) * every * dx,
        increment=fit.increment * float(every) ** -fit.hurst * face.unit,
        noise=float(np.sqrt(fit.noise)) * face.unit if noise else np.nan,
        window="exact likelihood of all increments" if scales is None else _ASKED,
        note="; ".join(part for part in (turned, parts.note, rounded) if part),
    )  # fmt: skip


def _rounded(heights: Array, error: float) -> str:
    """Return what to say of heights that were rounded to steps that matter; nothing otherwise."""
    share = quantum(heights)[1]
    return told(share, "that of a fit with white noise") if share > 0.5 * error else ""


def _without_offsets(heights: Array) -> Array:
    """Take off what the modes do not see, an offset of each row and each column."""
    if np.isnan(heights).any():
        return heights
    return np.asarray(heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True) + heights.mean())


def _stride(scales: Scales, spacing: float) -> int:
    """Return the step of points whose second differences see the shortest waves that are asked for."""
    return 1 if scales is None else max(1, round(0.5 * scales[0] / spacing))


def _pilot(heights: Array, steps: tuple[float, float]) -> float:
    """Return a quick estimate to start from."""
    moments = _increments.moments([(heights, heights.shape[0])], heights.shape)
    hurst = _increments.closed_form(moments, steps, error=False).hurst
    return float(np.clip(hurst, 0.03, 0.98)) if np.isfinite(hurst) else 0.5


def _increment(fit: _whittle.WhittleFit) -> float:
    """Return the rms increment over one x spacing that goes with the amplitude."""
    return float(np.sqrt(2.0 * fit.amplitude / (1.0 - fit.hurst))) if fit.hurst < 1.0 else float("nan")


def _between(lengths: Array, scales: Scales) -> Array:
    if scales is None:
        return np.ones(lengths.shape, dtype=bool)
    return np.asarray((lengths >= scales[0] * (1 - 1e-9)) & (lengths <= scales[1] * (1 + 1e-9)))


def _cropped(heights: Array) -> Array:
    """Cut off the rows and columns at the border where nothing was observed."""
    seen = np.isfinite(heights)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
