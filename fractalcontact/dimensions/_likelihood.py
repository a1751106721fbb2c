"""The default estimator: maximum likelihood for the family that the face belongs to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _exact, _increments, _modes, _periodic, _whittle
from fractalcontact.dimensions._estimates import CONSTANT, Estimate, plane, undefined
from fractalcontact.dimensions._faces import Face
from fractalcontact.dimensions._fitting import LEAST_MODES, FreeModes, PeriodicModes, fitted

Array = np.ndarray[Any, np.dtype[Any]]
Scales = tuple[float, float] | None

_ROUNDING = 1e-26  # share of the mean square that transforms lose
_PERIODIC = "all modes of the band: cut-offs and plateau found from the spectrum"
_FAMILY = "periodic family: power law between cut-offs"
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
    return _profile(face, scales, noise) if face.axes == 1 else _free_face(face, scales, noise)


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
    as_free = "a periodic face with gaps is taken as free" if all(face.grid.periodic) else ""
    smooth = _SMOOTHED if noise and fit.noise < 0 else ""
    return replace(
        estimate,
        scale_min=float(lengths[chosen].min()),
        scale_max=float(lengths[chosen].max()),
        increment=_increment(fit) * face.unit,
        noise=float(np.sqrt(max(fit.noise, 0.0))) * face.unit if noise else np.nan,
        window=_FREE if scales is None else _ASKED,
        note="; ".join(part for part in (as_free, smooth, estimate.note) if part),
    )


def _periodic_face(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit a power law to the modes of a periodic face."""
    heights = face.heights if face.axes == 2 else face.heights[0]
    modes = _periodic.modes(heights, face.steps)
    unit = max(face.grid.extent)
    low, high = _periodic.band(modes) if scales is None else (unit / scales[1], unit / scales[0])
    modes = modes.inside(low * (1 - 1e-9), high * (1 + 1e-9))
    if modes.weights.sum() < LEAST_MODES:
        return undefined(f"{modes.weights.sum():.0f} modes in the band, at least {LEAST_MODES} are needed")
    fit, estimate = fitted(PeriodicModes(modes), 0.5, noise)
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
            part for part in (_FAMILY, _SMOOTHED if noise and fit.noise < 0 else "", estimate.note) if part
        ),
    )


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
    return Estimate(
        fit.hurst, fit.standard_error, fit.low, fit.high,
        scale_min=every * dx,
        scale_max=(chunk - 1) * every * dx,
        increment=fit.increment * float(every) ** -fit.hurst * face.unit,
        noise=float(np.sqrt(fit.noise)) * face.unit if noise else np.nan,
        window="exact likelihood of all increments" if scales is None else _ASKED,
    )  # fmt: skip


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
