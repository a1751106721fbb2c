"""Roughness of a surface along each direction, and tests of isotropy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_directions, read_directions
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions import _spectral_sectors as sectors
from fractalcontact.dimensions._anisotropy import (
    LEAST_LAGS,
    RIDGES,
    SMOOTH,
    Anisotropy,
    directional_fit,
    fit_anisotropy,
)
from fractalcontact.dimensions._diagnosis import diagnose
from fractalcontact.dimensions._records import CONSTANT, Estimate, joined, normal_interval, plane, undefined
from fractalcontact.dimensions._second_differences import (
    DIRECTIONS,
    EqualLags,
    LatticeDirection,
    MiddlePairs,
    SecondDifferences,
    lattice_directions,
)
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    read_scales,
    read_surfaces,
)
from fractalcontact.dimensions._waves import without_waves

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 16  # points along each axis
_BY_DIRECTION = ("hurst", "fitted_hurst", "standard_error", "ci_low", "ci_high", "rms_increment")
_OF_SURFACE = (
    "isotropy_p_value",
    "anisotropy_ratio",
    "anisotropy_ratio_low",
    "anisotropy_ratio_high",
    "anisotropy_azimuth",
    "anisotropy_p_value",
)
_NAMES = (*_BY_DIRECTION, *_OF_SURFACE, "topothesy", "run_time", "azimuth", "increment_lag")
_IMPROBABLE = 1e-3  # p value below which no anisotropy ratio describes the surface
_SHARE_COMPARED = 1 / 3  # of the surface, which a second difference may span in a test
_ROUNDING = 1e-22  # of the largest mean square: the heights do not vary along that direction
_BENT = 3.3  # standard deviations of the curvature of the power law: one exact surface in a thousand
_NO_VARIATION = "the heights do not vary along this direction"
_NO_MODEL = "the surface does not fit the model, anisotropic fractional Brownian: the scatter is unknown"
_FEW_LAGS = "fewer than two lags of this direction fit into the surface, or into the scales asked for"


def _check(problems: Problems) -> None:
    if problems.given.direction is not None:
        check_directions(problems)
    is_valid = check_surface(problems, smallest=SMALLEST, profile=False, reserved=_NAMES)
    check_scales(problems, is_valid=is_valid)


@public_result(
    title="Roughness by direction",
    references="Davies and Hall, Fractal analysis of surface roughness by using spatial data, Journal "
    "of the Royal Statistical Society B 61 (1999) 3-37",
    check=_check,
)
def directions(
    surface: xr.DataArray,
    direction: str | float | Sequence[str | float] | None = None,
    *,
    scales: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent along each direction, and test whether the surface is isotropic.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), at least 16 points along each axis. NaN marks missing points.
    direction : str, float, or a sequence of them, optional
        Compass words, or degrees anticlockwise from E, modulo 180; on free edges the nearest lattice
        directions are used. Default: eight over the half-circle.
    scales : (low, high), optional
        Lengths in m: lags on free edges, wavelengths on periodic ones and for the tests. Default: the
        shortest lags that all directions have, or the band of the spectrum.

    Returns
    -------
    Dataset over the leading dims and `azimuth` (degree, ascending, 0 ... 180)
        Along each direction `hurst`, `standard_error`, `ci_low`, `ci_high`, `fitted_hurst`,
        `rms_increment` and `topothesy`, as in `estimate`. Of the surface: `isotropy_p_value` (probability
        that an isotropic surface differs as much between directions); `anisotropy_ratio` of the
        correlation lengths along and across `anisotropy_azimuth`, with its 95 % interval
        (`anisotropy_ratio_low`, `anisotropy_ratio_high`); `anisotropy_p_value` (the same probability for a
        surface of that ratio). The attribute `reason` states why a value is NaN.

    Raises
    ------
    InvalidInput
        A profile, wrong axes or scales, a surface too small or entirely NaN.

    Notes
    -----
    Free edges: second differences over equal lengths along lattice directions. Periodic: sectors of the
    spectrum. Single waves are taken out first. Where one power law does not describe the lags or the
    wavelengths, as with blur or noise, there is no interval and no anisotropy ratio: give longer `scales`.
    Models and tests: page `theory_dimensions`; measured size, power, coverage: page `estimator_accuracy`.

    References
    ----------
    Davies and Hall (1999), J. R. Stat. Soc. B 61; Chan and Wood (2000), Annals of Statistics 28; Richard
    (2018), Journal of Mathematical Imaging and Vision 60.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> ground = fc.surfaces.spectral(
    ...     (128, 128), 1e-4, hurst=0.7, rms_height=1e-6, anisotropy_ratio=2.0, direction=30.0, rng=1
    ... )
    >>> result = fc.dimensions.directions(ground)
    >>> print(
    ...     f"ratio {float(result.anisotropy_ratio):.1f} along {float(result.anisotropy_azimuth):.0f} degrees"
    ... )
    ratio 2.0 along 30 degrees
    """
    surfaces = read_surfaces(surface)
    window = surfaces[0].resolved(read_scales(scales))
    chosen = None
    if direction is not None:
        chosen = np.unique([towards.azimuth % 180.0 for towards in read_directions(direction)])
    is_periodic = all(surfaces[0].grid.periodic) and all(single.is_complete for single in surfaces)
    if is_periodic:
        azimuths = np.arange(DIRECTIONS) * 180.0 / DIRECTIONS if chosen is None else chosen
        results = [_periodic_surface(single, azimuths, window) for single in surfaces]
    else:
        lattice = set(lattice_directions(chosen, surfaces[0].plane_spacing))
        ordered = sorted(lattice, key=lambda direction: direction.azimuth)
        azimuths = np.array([direction.azimuth for direction in ordered])
        results = [_free_surface(single, ordered, window) for single in surfaces]
    return _with_reasons(_dataset(surface, surfaces[0], azimuths, results), results)


@dataclass(frozen=True)
class _Directional:
    """Estimates of one surface by direction, and its anisotropy, or the reason why there is none."""

    estimates: list[Estimate]
    anisotropy: Anisotropy | None
    reason: str = ""

    @classmethod
    def of(cls, estimates: list[Estimate], anisotropy: Anisotropy) -> _Directional:
        return cls(estimates, anisotropy.defined(), anisotropy.reason)


def _dataset(
    surface: xr.DataArray, first: Surface, azimuths: Array, results: Sequence[_Directional]
) -> xr.Dataset:
    leading = surface.dims[: surface.ndim - 2]
    shape = [surface.sizes[dim] for dim in leading]
    spacing = first.spacing[1]

    def by_direction(values: list[list[float]]) -> tuple[Any, Array]:
        return (*leading, "azimuth"), np.reshape(values, (*shape, -1))

    data = {
        name: by_direction([[getattr(record, name) for record in result.estimates] for result in results])
        for name in _BY_DIRECTION
    }
    data["topothesy"] = by_direction(
        [[record.topothesy(spacing) for record in result.estimates] for result in results]
    )
    for name in _OF_SURFACE:
        values = [np.nan if r.anisotropy is None else getattr(r.anisotropy, name) for r in results]
        data[name] = (leading, np.reshape(values, shape))
    coords = leading_coords(surface, leading, taken=(*data, "run_time"))
    return xr.Dataset(data, coords=coords | {"azimuth": azimuths, "increment_lag": spacing})


def _with_reasons(result: xr.Dataset, results: Sequence[_Directional]) -> xr.Dataset:
    """Add the reasons of missing values to the variables."""

    def collected(texts: Sequence[str]) -> str:
        return "; ".join(dict.fromkeys(text for text in texts if text))

    records = [record for each in results for record in each.estimates]
    for name in ("standard_error", "ci_low", "ci_high"):
        result[name].attrs["reason"] = collected([record.reason for record in records])
    result["hurst"].attrs["reason"] = collected([record.note for record in records])
    for name in _OF_SURFACE:
        result[name].attrs["reason"] = collected([each.reason for each in results])
    return result


def _free_surface(surface: Surface, directions: Sequence[LatticeDirection], scales: Scales) -> _Directional:
    """Measure a surface with free edges by its second differences, without its single waves."""
    if surface.is_constant or surface.is_plane:
        record = (undefined(CONSTANT) if surface.is_constant else plane()).limited()
        return _Directional([record] * len(directions), None, record.note)
    surface, note = without_waves(surface)
    result = _by_differences(surface, directions, scales)
    return replace(result, estimates=[replace(r, note=joined(note, r.note)) for r in result.estimates])


def _by_differences(surface: Surface, directions: Sequence[LatticeDirection], scales: Scales) -> _Directional:
    """Measure a surface by its second differences."""
    equal = EqualLags.of(surface, directions, scales)
    differences, owner = SecondDifferences.at(surface, directions, [equal.multiples(d) for d in directions])
    every = lattice_directions(None, surface.plane_spacing)
    compared = _compared(surface, SecondDifferences.of(surface, every, scales)[0])
    limit = _ROUNDING * max(differences.means.max(initial=0.0), compared.means.max(initial=0.0))
    varied = compared.part(compared.means > limit)
    has_constant_direction = bool((compared.means <= limit).any())
    anisotropy, reason = None, ""
    if len(varied.vectors) > LEAST_LAGS and np.linalg.matrix_rank(varied.vectors) == 2:
        anisotropy = fit_anisotropy(varied, _middle_pairs(surface, varied))
        is_bent = abs(anisotropy.curvature_z) > _BENT
        by_lags = anisotropy.anisotropy_p_value
        if surface.is_complete:
            # where the power law bends, the waves decide: the lags of the lattice differ in length
            anisotropy = _tested_by_waves(surface, anisotropy, scales, is_straight=not is_bent)
        is_beyond_model = anisotropy.reason in (RIDGES, SMOOTH) or (not is_bent and by_lags < _IMPROBABLE)
        if has_constant_direction:
            anisotropy = replace(anisotropy, isotropy_p_value=0.0, anisotropy_p_value=0.0, reason=RIDGES)
        if is_beyond_model or anisotropy.anisotropy_p_value < _IMPROBABLE:
            reason = _NO_MODEL
        elif is_bent:
            reason = _bent_reason(anisotropy.curvature_z, "lag")
            anisotropy = replace(anisotropy, reason=anisotropy.reason or reason)
    reason = reason or diagnose(surface)
    estimates = []
    for index, direction in enumerate(directions):
        part = differences.part(owner == index)
        weights = equal.weights(part, direction)
        if (part.means <= limit).any():
            estimates.append(undefined(_NO_VARIATION))
        elif len(weights) < 2:
            estimates.append(undefined(_FEW_LAGS))
        else:
            estimates.append(_along(surface, part, weights, anisotropy, reason))
    if anisotropy is None:
        return _Directional(estimates, None, "too few lags fit into the surface to compare directions")
    return _Directional.of(estimates, anisotropy)


def _bent_reason(z: float, what: str) -> str:
    return (
        f"the exponent changes with the {what} ({z:+.1f} standard deviations), as with blur or noise: "
        "give longer `scales`, that one exponent describes"
    )


def _compared(surface: Surface, differences: SecondDifferences) -> SecondDifferences:
    """Return the lags whose second differences span at most a third of the surface, for the tests."""
    inside = np.all(2 * np.abs(differences.vectors) < _SHARE_COMPARED * np.array(surface.shape), axis=1)
    return differences.part(inside)


def _middle_pairs(surface: Surface, differences: SecondDifferences) -> MiddlePairs:
    return MiddlePairs.of(surface.heights, surface.is_complete, differences.vectors, differences.numbers)


def _tested_by_waves(
    surface: Surface, anisotropy: Anisotropy, scales: Scales, *, is_straight: bool
) -> Anisotropy:
    """Take the p values from the waves of a complete surface that is large enough: they need no family.

    Where the power law of the lags is straight, the smaller of both p values counts, doubled: second
    differences are more sensitive to narrow ridges.
    """
    low, high = (0.0, np.inf) if scales is None else scales
    window = low / surface.spacing[1], high / surface.spacing[1]
    waves = sectors.TaperedModes.of(surface.heights, surface.plane_spacing, window)

    def combined(metric: Array, fitted: int, by_lags: float) -> float:
        by_waves = waves.test(metric, anisotropy.hurst, fitted=fitted)
        if not np.isfinite(by_waves):
            return by_lags
        return min(2.0 * min(by_waves, by_lags), 1.0) if is_straight else by_waves

    return replace(
        anisotropy,
        isotropy_p_value=combined(np.eye(2), 0, anisotropy.isotropy_p_value),
        anisotropy_p_value=combined(np.linalg.inv(anisotropy.metric), 2, anisotropy.anisotropy_p_value),
    )


def _along(
    surface: Surface,
    differences: SecondDifferences,
    weights: Array,
    anisotropy: Anisotropy | None,
    reason: str,
) -> Estimate:
    """Return the estimate of one direction; `weights` interpolate its lags. No interval if `reason`."""
    hurst, metric = (None, np.eye(2)) if anisotropy is None else (anisotropy.hurst, anisotropy.metric)
    pairs = _middle_pairs(surface, differences)
    exponent, error, second = directional_fit(differences, pairs, weights, hurst, metric)
    # a second difference over one lag has 4 - 4^H times the mean square of a first one
    first = second / (4.0 - 4.0**exponent) if exponent < 1.0 else np.nan
    increment = float(np.sqrt(first)) * surface.unit
    estimate = Estimate(exponent, error, *normal_interval(exponent, error), rms_increment=increment)
    return (estimate.without_interval(reason) if reason else estimate).limited()


def _periodic_surface(surface: Surface, azimuths: Array, scales: Scales) -> _Directional:
    """Measure a periodic surface by the waves that run along each direction."""
    if surface.is_constant:
        return _Directional([undefined(CONSTANT)] * azimuths.size, None, CONSTANT)
    surface, note = without_waves(surface)
    extent = max(surface.grid.extent)
    low, high = (0.0, np.inf) if scales is None else (extent / scales[1], extent / scales[0])
    modes = sectors.PlaneModes.of(surface.heights, surface.plane_spacing).between(low, high)
    gaps = np.diff(azimuths, append=azimuths[:1] + 180.0)
    half_width = min(sectors.WIDEST, 0.5 * float(gaps.min())) if azimuths.size > 1 else sectors.WIDEST
    increments = sectors.directional_increments(surface.heights, surface.plane_spacing, azimuths)
    every = modes.power_law()
    reason = _bent_reason(every.curvature_z, "wavelength") if abs(every.curvature_z) > _BENT else ""
    reason = reason or diagnose(surface)
    estimates = []
    for azimuth, increment in zip(azimuths, increments * surface.unit, strict=True):
        law = modes.sector(float(azimuth), half_width).power_law()
        if not np.isfinite(law.hurst):
            estimates.append(undefined("too few waves run along this direction"))
            continue
        interval = normal_interval(law.hurst, law.error)
        estimate = Estimate(law.hurst, law.error, *interval, rms_increment=float(increment), note=note)
        estimates.append((estimate.without_interval(reason) if reason else estimate).limited())
    if modes.weights.sum() < sectors.LEAST or not np.isfinite(every.hurst):
        return _Directional(estimates, None, "too few waves in the band to compare directions")
    anisotropy = sectors.fit_spectral_anisotropy(modes, every.hurst)
    if np.linalg.matrix_rank(modes.wavevectors) < 2:  # ridges across the only direction of the waves
        y, x = modes.wavevectors[0]
        across = float(np.degrees(np.arctan2(x, -y)) % 180.0)
        anisotropy = replace(anisotropy, isotropy_p_value=0.0, anisotropy_p_value=0.0, reason=RIDGES)
        anisotropy = replace(anisotropy, anisotropy_azimuth=across)
    return _Directional.of(estimates, anisotropy)
