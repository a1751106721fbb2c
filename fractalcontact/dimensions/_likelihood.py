"""Maximum likelihood estimate of H, for the family that the surface belongs to (method "likelihood").

Surfaces with free edges: fractional Brownian heights, by their cosine modes. Periodic surfaces: a power-law
spectrum between cut-offs. Profiles with free ends: the exact likelihood of their increments.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fractalcontact.dimensions._exponent_by_scale import exponents_within
from fractalcontact.dimensions._filled_points import filled_points, with_gaps
from fractalcontact.dimensions._height_gaps import without_height_gaps
from fractalcontact.dimensions._periodic_modes import periodic_likelihood
from fractalcontact.dimensions._profile_increments import gapped_profile
from fractalcontact.dimensions._profile_likelihood import profile_likelihood
from fractalcontact.dimensions._records import CONSTANT, Estimate, joined, plane, undefined
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._surface_likelihood import surface_likelihood
from fractalcontact.dimensions._waves import MOST_REPEATED, without_waves

_INTERPOLATED = 0.01  # share of heights on a line with their neighbours
_LINEAR = (
    "many heights lie exactly on lines between their neighbours: they were interpolated, and the short waves "
    "are those of the interpolation; grid the points with fractalcontact.surfaces.from_points, or give "
    "`scales` from eight distances of the points on"
)
_RESOLVED_WINDOW = "all wavelengths that the points of the gridded surface resolve"
_REPEATED = (
    "many rows or columns repeat their neighbours: the surface was enlarged, and the short waves are those "
    "of its blocks; remove the repeated ones, or give `scales` from eight blocks on"
)
_PERIODIC_GAPS = (
    "a periodic surface with gaps, or with one periodic axis, is treated as free: the interval is for "
    "another kind of surface; see fractalcontact.surfaces.fill"
)


def likelihood(surface: Surface, scales: Scales, noise: bool, psf: float | None = None) -> Estimate:
    """Fit the periodic family where every axis is periodic, otherwise fractional Brownian heights.

    Single waves are removed first. `psf` is the spread of a known point spread function in m.
    """
    if surface.is_constant:
        return undefined(CONSTANT)
    if surface.is_plane:
        return plane()
    made = ""
    if scales is None and not surface.finest_scale:
        made = _LINEAR if surface.linear_share > _INTERPOLATED else ""
        made = _REPEATED if surface.repeated_share > MOST_REPEATED else made
    filled = None if made else filled_points(surface)
    surface, wave_note = without_waves(surface)
    surface, gap_note = with_gaps(surface, filled)
    surface, limit_note = without_height_gaps(surface)
    estimate = _fitted(surface, scales, noise, psf)
    if scales is not None and not noise and psf is None:
        estimate = _within_scales(estimate, surface, scales)
    estimate = replace(estimate, note=joined(wave_note, gap_note, limit_note, estimate.note))
    if made and not estimate.reason:
        return replace(estimate.without_interval(made), note=joined(made, estimate.note))
    return estimate


def _within_scales(estimate: Estimate, surface: Surface, scales: Scales) -> Estimate:
    """Return an estimate whose interval holds both exponents of a given window that has more than one."""
    if not surface.is_complete or surface.finest_scale or np.isfinite(estimate.blur_spread):
        return estimate
    low, high = exponents_within(surface, scales)
    if low > high:
        return estimate
    note = (
        "the exponent changes within the scales asked for (see `scaling`): the interval holds those of the "
        "shorter and of the longer waves"
    )
    return estimate.holding(low, high, note)


def _fitted(surface: Surface, scales: Scales, noise: bool, psf: float | None) -> Estimate:
    """Fit the family of a surface without single waves."""
    if all(surface.grid.periodic) and surface.is_complete:
        return periodic_likelihood(surface, scales, noise)
    if surface.finest_scale and scales is None:
        resolved = _fitted(surface, surface.resolved(scales), noise, psf)
        return replace(resolved, window=_RESOLVED_WINDOW)
    spread = None if psf is None else psf / surface.spacing[1]
    of_profile = profile_likelihood if surface.is_complete else gapped_profile
    family = of_profile if surface.axes == 1 else surface_likelihood
    estimate = family(surface, scales, noise, spread)
    if not any(surface.grid.periodic) or estimate.reason:
        return estimate
    return estimate.without_interval(_PERIODIC_GAPS)
