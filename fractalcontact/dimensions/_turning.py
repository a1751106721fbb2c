"""Exponents by direction and tests of isotropy of one face, from its second differences or its waves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _periodic, _rays, _sectors
from fractalcontact.dimensions._estimates import CONSTANT, Estimate, normal_interval, plane, undefined
from fractalcontact.dimensions._faces import Face
from fractalcontact.dimensions._fitting import LEAST_MODES, PeriodicModes, fitted
from fractalcontact.dimensions._scatter import Pairs

Array = np.ndarray[Any, np.dtype[Any]]

_STRANGE = 1e-3  # chance below which no stretch explains the face
_BENT = 3.3  # curvature of the power law, in standard errors, beyond which an interval is widened
_COMPARED = 1 / 3  # of the face, that a second difference may span in a test
_UNVARIED = 1e-22  # of the largest mean square: the heights do not vary along that direction
_MODELLESS = (_rays.RIDGES, _rays.SMOOTH)
_SMOOTH = "the heights do not vary along this direction"
_BEYOND = "the face is no stretched fractional Brownian one, and no model tells how the estimates scatter"
_FEW = "fewer than two lags of this direction fit into the face, or into the scales asked for"


@dataclass(frozen=True)
class Turned:
    """The estimates of one face by direction, and what tells it from an isotropic one."""

    estimates: list[Estimate]
    isotropy: _rays.Isotropy | None
    note: str = ""


def turned(face: Face, rays: Sequence[_rays.Ray], scales: tuple[float, float] | None) -> Turned:
    """Measure a face with free edges."""
    if face.is_constant or face.is_plane:
        one = undefined(CONSTANT) if face.is_constant else plane()
        return Turned([one.limited() if np.isfinite(one.hurst) else one] * len(rays), None, one.note)
    means, owner = _rays.Means.of(face, rays, scales)
    every = _rays.rays(None, face.plane_steps)
    around = _compared(face, means if list(rays) == every else _rays.Means.of(face, every, scales)[0])
    level = _UNVARIED * max(means.means.max(initial=0.0), around.means.max(initial=0.0))
    varied, smooth = around.part(around.means > level), bool((around.means <= level).any())
    enough = np.linalg.matrix_rank(varied.vectors) == 2 and len(varied.vectors) > _rays.LEAST_LAGS
    isotropy = _rays.isotropy(varied, _pairs(face, varied)) if enough else None
    strange = isotropy is not None and (isotropy.stretched_p_value < _STRANGE or isotropy.note in _MODELLESS)
    if isotropy is not None and face.complete:
        isotropy = _by_waves(face, isotropy, scales)
    if smooth and isotropy is not None:
        isotropy = replace(isotropy, p_value=0.0, stretched_p_value=0.0, note=_rays.RIDGES)
    beyond = strange or (isotropy is not None and isotropy.stretched_p_value < _STRANGE)
    estimates = []
    for place in range(len(rays)):
        own = means.part(owner == place)
        if (own.means <= level).any():
            estimates.append(undefined(_SMOOTH))
        elif len(own.means) < 2:
            estimates.append(undefined(_FEW))
        else:
            estimates.append(_along(face, own, isotropy, _BEYOND if beyond else ""))
    note = "" if isotropy is not None else "too few lags fit into the face to compare directions"
    return Turned(estimates, *_known(isotropy, note))


def _compared(face: Face, means: _rays.Means) -> _rays.Means:
    """Keep the lags by which directions are compared: differences span a third of the face at most."""
    inside = np.all(2 * np.abs(means.vectors) < _COMPARED * np.array(face.shape), axis=1)
    return means.part(inside)


def _pairs(face: Face, means: _rays.Means) -> Pairs:
    return Pairs.of(face.heights, face.complete, means.vectors, means.numbers)


def _known(isotropy: _rays.Isotropy | None, note: str) -> tuple[_rays.Isotropy | None, str]:
    """Leave out a stretch that means nothing; ridges keep their azimuth."""
    if isotropy is None or not isotropy.note:
        return isotropy, note
    azimuth = isotropy.azimuth if isotropy.note == _rays.RIDGES else np.nan
    chance = isotropy.stretched_p_value if isotropy.note == _rays.SMOOTH else np.nan
    blank = replace(
        isotropy, stretch=np.nan, low=np.nan, high=np.nan, azimuth=azimuth, stretched_p_value=chance
    )
    return blank, isotropy.note


def _by_waves(face: Face, found: _rays.Isotropy, scales: tuple[float, float] | None) -> _rays.Isotropy:
    """Take the chances from the waves of a complete face, if it is large enough: they know no family.

    Where the power law of the lags is straight, they are asked too: they feel narrow ridges better.
    """
    low, high = (0.0, np.inf) if scales is None else scales
    window = low / face.spacing[1], high / face.spacing[1]

    waves = _sectors.Tapered.of(face.heights, face.plane_steps, window)

    def chance(form: Array, free: int, otherwise: float) -> float:
        value = waves.test(form, found.hurst, free=free)
        if not np.isfinite(value):
            return otherwise
        return min(2.0 * min(value, otherwise), 1.0) if abs(found.bend) < _BENT else value

    return replace(
        found,
        p_value=chance(np.eye(2), 0, found.p_value),
        stretched_p_value=chance(np.linalg.inv(found.form), 2, found.stretched_p_value),
    )


def _along(face: Face, own: _rays.Means, isotropy: _rays.Isotropy | None, reason: str) -> Estimate:
    """Return the estimate of one direction.

    Where the power law bends over the length more than chance allows, the interval also holds the exponents
    between the shorter and between the longer lags.
    """
    hurst, form = (None, np.eye(2)) if isotropy is None else (isotropy.hurst, isotropy.form)
    exponent, error, second = _rays.slope(own, _pairs(face, own), hurst, form)
    low, high = normal_interval(exponent, error)
    note = ""
    if isotropy is not None and abs(isotropy.bend) > _BENT:
        for start in range(len(own.means) - 1):
            part = own.part(np.arange(start, start + 2))
            ends = normal_interval(*_rays.slope(part, _pairs(face, part), hurst, form)[:2])
            low, high = min(low, ends[0]), max(high, ends[1])
        note = (
            f"the exponent changes with the lag ({isotropy.bend:+.1f} standard deviations): the interval "
            "holds those between the shorter and between the longer lags"
        )
    # a second difference over one lag has 4 - 4^H times the mean square of a first one
    first = second / (4.0 - 4.0**exponent) if exponent < 1.0 else np.nan
    increment = float(np.sqrt(first)) * face.unit
    if reason:
        error = low = high = np.nan
        note = ""
    return Estimate(exponent, error, low, high, increment=increment, not_given=reason, note=note).limited()


def sectored(face: Face, azimuths: Array, scales: tuple[float, float] | None) -> Turned:
    """Measure a periodic face."""
    if face.is_constant:
        return Turned([undefined(CONSTANT)] * azimuths.size, None, CONSTANT)
    whole = _sectors.Plane.of(face.heights, face.plane_steps)
    extent = max(face.grid.extent)
    low, high = _periodic.band(whole.modes) if scales is None else (extent / scales[1], extent / scales[0])
    modes = whole.inside(low * (1 - 1e-9), high * (1 + 1e-9))
    gaps = np.diff(azimuths, append=azimuths[:1] + 180.0)
    half = min(_sectors.WIDEST, 0.5 * float(gaps.min())) if azimuths.size > 1 else _sectors.WIDEST
    increments = _sectors.increments(face.heights, face.plane_steps, azimuths) * face.unit
    estimates = []
    for azimuth, increment in zip(azimuths, increments, strict=True):
        sector = modes.sector(float(azimuth), half)
        if np.sum(sector.modes.weights) < 2 * LEAST_MODES or not _spread(sector):
            estimates.append(undefined("too few waves of the band run along this direction"))
            continue
        _, estimate = fitted(sector, 0.5, noise=False)
        estimates.append(replace(estimate, increment=float(increment)).limited())
    if modes.weights.sum() < _sectors.LEAST or not _spread(PeriodicModes(modes.modes)):
        return Turned(estimates, None, "too few waves in the band to compare directions")
    start = PeriodicModes(modes.modes).fit(0.5, noise=False).hurst
    return Turned(estimates, *_known(_sectors.isotropy(modes, start), ""))


def _spread(modes: PeriodicModes) -> bool:
    """Tell whether the waves differ in length."""
    waves = modes.modes.wavenumber
    return bool(waves.max() > 1.2 * waves.min())
