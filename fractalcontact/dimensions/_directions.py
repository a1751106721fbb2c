"""Roughness of a surface along each direction, and tests of isotropy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.numbers import float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions import _cosine_modes, _mode_blocks
from fractalcontact.dimensions import _spectral_sectors as sectors
from fractalcontact.dimensions._anisotropy import (
    LEAST_LAGS,
    RIDGES,
    SMOOTH,
    Anisotropy,
    directional_fit,
    fit_anisotropy,
)
from fractalcontact.dimensions._blur import CLEAR, fit_blurred
from fractalcontact.dimensions._filled_points import filled_points, with_gaps
from fractalcontact.dimensions._free_edges import LARGE
from fractalcontact.dimensions._height_gaps import without_height_gaps
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._mode_blocks import Frame
from fractalcontact.dimensions._periodic_modes import PeriodicModes, band
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    joined,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._second_differences import (
    DIRECTIONS,
    EqualLags,
    LatticeDirection,
    MiddlePairs,
    SecondDifferences,
    lattice_directions,
)
from fractalcontact.dimensions._second_exponent import Explanations, several_exponents
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    read_scales,
    read_surfaces,
)
from fractalcontact.dimensions._transfer_functions import NONE, Window
from fractalcontact.dimensions._waves import without_waves
from fractalcontact.dimensions._whittle import LEAST_MODES, fit_interval

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
_BENT = 2.0  # standard deviations of the curvature from which on blur and noise are looked for
_FAR_BENT = 10.0  # the same from which on the lags give no anisotropy ratio
_LEFT = 0.1  # of a mean square difference, which noise must leave
_NO_VARIATION = "the heights do not vary along this direction"
_NO_MODEL = "the surface does not fit the model, anisotropic fractional Brownian: the scatter is unknown"
_BLURRED = (
    "over the lags there is no power law, as with blur, and the ratio would be wrong: give longer `scales`"
)
_FITTED = ("hurst", "standard_error")
_FEW_LAGS = "fewer than two lags of this direction fit into the surface, or into the scales asked for"


def _check(problems: Problems, *, surface: Any, azimuth: Any, scales: Any) -> None:
    problems.numbers("azimuth", azimuth, optional=True)
    is_valid = check_surface(problems, surface, smallest=SMALLEST, profile=False, reserved=_NAMES)
    check_scales(problems, scales, surface if is_valid else None)


@public_result(
    title="Roughness by direction",
    references="Davies and Hall, Fractal analysis of surface roughness by using spatial data, Journal "
    "of the Royal Statistical Society B 61 (1999) 3-37",
    check=_check,
)
def directions(
    surface: xr.DataArray,
    azimuth: float | Sequence[float] | None = None,
    *,
    scales: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent along each direction, and test whether the surface is isotropic.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), at least 16 points along each axis. NaN marks missing points.
    azimuth : float or sequence of float, optional
        Degrees anticlockwise from E, modulo 180; on free edges the nearest lattice directions are used.
        Default: eight over the half-circle.
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
    Free edges: second differences over equal lengths along lattice directions, without the blur and noise
    that the modes of a complete surface show. Periodic: sectors of the spectrum. Models and tests: page
    `theory_dimensions`; their measured size, power and coverage: page `estimator_accuracy`.

    References
    ----------
    Davies and Hall (1999), J. R. Stat. Soc. B 61; Chan and Wood (2000), Annals of Statistics 28; Richard
    (2018), Journal of Mathematical Imaging and Vision 60.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> ground = fc.surfaces.spectral(
    ...     (128, 128), 1e-4, hurst=0.7, rms_height=1e-6, anisotropy_ratio=2.0, azimuth=30.0, rng=1
    ... )
    >>> result = fc.dimensions.directions(ground)
    >>> print(
    ...     f"ratio {float(result.anisotropy_ratio):.1f} along {float(result.anisotropy_azimuth):.0f} degrees"
    ... )
    ratio 2.0 along 30 degrees
    """
    surfaces = read_surfaces(surface)
    window = surfaces[0].resolved(read_scales(scales))
    chosen = None if azimuth is None else np.unique(np.mod(float_array(azimuth), 180.0))
    is_periodic = all(surfaces[0].grid.periodic) and all(single.is_complete for single in surfaces)
    if is_periodic:
        azimuths = np.arange(DIRECTIONS) * 180.0 / DIRECTIONS if chosen is None else chosen
        results = [_periodic_surface(single, azimuths, window) for single in surfaces]
    else:
        lattice = set(lattice_directions(chosen, surfaces[0].plane_spacing))
        ordered = sorted(lattice, key=lambda direction: direction.azimuth)
        azimuths = np.array([direction.azimuth for direction in ordered])
        results = [_free_surface(single, ordered, window, is_default=scales is None) for single in surfaces]
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

    def beside(self, by_modes: Estimate, note: str) -> _Directional:
        """Return the estimates with intervals that hold that of the likelihood, where it finds more.

        Without a model of the blur, the lags of a blurred surface give no anisotropy ratio.
        """
        known = [record for record in self.estimates if np.isfinite(record.ci_low)]
        hurst, error = (float(np.mean([getattr(r, name) for r in known or [by_modes]])) for name in _FITTED)
        found = by_modes.found_beside(hurst, error)
        records = [replace(record, note=joined(note, record.note)) for record in self.estimates]
        result = replace(self, estimates=[r.beside_modes(by_modes, found).limited() for r in records])
        anisotropy = self.anisotropy
        if anisotropy is None or anisotropy.reason or abs(anisotropy.curvature_z) < _FAR_BENT:
            return result
        return replace(result, anisotropy=replace(anisotropy, reason=_BLURRED).defined(), reason=_BLURRED)


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
    coords: dict[str, Any] = dict(leading_coords(surface, leading, taken=(*data, "run_time")))
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


def _free_surface(
    surface: Surface, directions: Sequence[LatticeDirection], scales: Scales, *, is_default: bool
) -> _Directional:
    """Measure a surface with free edges by its second differences, without its single waves.

    The intervals hold that of the likelihood, where it finds other than fractional Brownian heights.
    """
    if surface.is_constant or surface.is_plane:
        record = (undefined(CONSTANT) if surface.is_constant else plane()).limited()
        return _Directional([record] * len(directions), None, record.note)
    filled = filled_points(surface)
    without, note = with_gaps(surface if filled is None else without_waves(surface)[0], filled)
    without, limited = without_height_gaps(without)
    if note := joined(note, limited):
        surface = without
        result = _by_differences(surface, directions, scales)
        return replace(result, estimates=[replace(r, note=joined(note, r.note)) for r in result.estimates])
    if not (is_default and surface.is_complete and surface.heights.size <= LARGE):
        return _by_differences(surface, directions, scales)
    without, waves_note = without_waves(surface)
    result = _by_differences(without, directions, scales)
    by_modes = likelihood(without, None, False)
    return result.beside(by_modes, waves_note)


def _by_differences(surface: Surface, directions: Sequence[LatticeDirection], scales: Scales) -> _Directional:
    """Measure a surface by its second differences."""
    equal = EqualLags.of(surface, directions, scales)
    differences, owner = SecondDifferences.at(surface, directions, [equal.multiples(d) for d in directions])
    every = lattice_directions(None, surface.plane_spacing)
    compared = _compared(surface, SecondDifferences.of(surface, every, scales)[0])
    limit = _ROUNDING * max(differences.means.max(initial=0.0), compared.means.max(initial=0.0))
    varied = compared.part(compared.means > limit)
    has_constant_direction = bool((compared.means <= limit).any())
    anisotropy, is_beyond_model = None, False
    instrument = None
    if len(varied.vectors) > LEAST_LAGS and np.linalg.matrix_rank(varied.vectors) == 2:
        anisotropy = fit_anisotropy(varied, _middle_pairs(surface, varied))
        # where the power law bends, the waves decide: the lags of the lattice differ in length
        is_bent = abs(anisotropy.curvature_z) > SIGNIFICANT
        if abs(anisotropy.curvature_z) > _BENT and surface.is_complete and scales is None:
            instrument = _Instrument.of(surface)
        if instrument is not None:
            varied, differences = instrument.removed(varied), instrument.removed(differences)
            anisotropy = fit_anisotropy(varied, _middle_pairs(surface, varied))
        by_lags = anisotropy.anisotropy_p_value
        if surface.is_complete:
            anisotropy = _tested_by_waves(surface, anisotropy, scales, is_straight=not is_bent)
        is_beyond_model = not is_bent and by_lags < _IMPROBABLE
        is_beyond_model = is_beyond_model or anisotropy.reason in (RIDGES, SMOOTH)
        if has_constant_direction:
            anisotropy = replace(anisotropy, isotropy_p_value=0.0, anisotropy_p_value=0.0, reason=RIDGES)
        is_beyond_model = is_beyond_model or anisotropy.anisotropy_p_value < _IMPROBABLE
    estimates = []
    for index, direction in enumerate(directions):
        part = differences.part(owner == index)
        weights = equal.weights(part, direction)
        if (part.means <= limit).any():
            estimates.append(undefined(_NO_VARIATION))
        elif len(weights) < 2:
            estimates.append(undefined(_FEW_LAGS))
        else:
            reason = _NO_MODEL if is_beyond_model else ""
            estimates.append(_along(surface, part, weights, anisotropy, reason, instrument))
    if anisotropy is None:
        return _Directional(estimates, None, "too few lags fit into the surface to compare directions")
    return _Directional.of(estimates, anisotropy)


def _compared(surface: Surface, differences: SecondDifferences) -> SecondDifferences:
    """Return the lags whose second differences span at most a third of the surface, for the tests."""
    inside = np.all(2 * np.abs(differences.vectors) < _SHARE_COMPARED * np.array(surface.shape), axis=1)
    return differences.part(inside)


def _middle_pairs(surface: Surface, differences: SecondDifferences) -> MiddlePairs:
    return MiddlePairs.of(surface.heights, surface.is_complete, differences.vectors, differences.numbers)


@dataclass(frozen=True)
class _Instrument:
    """Blur and noise of a surface, as the likelihood of its modes finds them.

    Attributes
    ----------
    frame : Frame
        Blocks of modes.
    sharp, blurred : ndarray, shape (blocks,)
        Their expected power without blur and with it.
    noise : float
        Mean square of white noise.
    standard_error : float
        Of the exponent of the likelihood: most of it is that blur and noise are not known exactly.
    """

    frame: Frame
    sharp: Array
    blurred: Array
    noise: float
    standard_error: float

    @classmethod
    def of(cls, surface: Surface) -> _Instrument | None:
        """Return blur and noise of a complete surface; None where they do not explain its modes."""
        frame = _mode_blocks.frame(surface.heights.shape, surface.plane_spacing)
        power = _cosine_modes.mode_power(surface.heights)
        fit = fit_blurred(power, frame)
        if fit is None or not (fit.is_good and fit.gain > CLEAR[2] and fit.hurst < 1.0):
            return None
        means = frame.mean(power)
        if several_exponents(Explanations.likelier(fit, means, frame), surface) is not None:
            return None
        every = Window(frame, np.ones(frame.count.size, dtype=bool), means)
        sharp, blurred = (every.signal(form, fit.hurst, fit.spread**2)[0] for form in (NONE, fit.form))
        return cls(frame, sharp, blurred, float(np.nan_to_num(fit.noise)), fit.standard_error)

    def removed(self, differences: SecondDifferences) -> SecondDifferences:
        """Return the mean squares that the surface has without blur and noise."""
        frame = self.frame
        images = [frame.waves, frame.waves[::-1]] if frame.is_mirrored else [frame.waves]
        ratios = []
        for y, x in differences.lags:
            phases = [along_y * y + sign * along_x * x for along_y, along_x in images for sign in (-1, 1)]
            weights = frame.count * np.sum([(1.0 - np.cos(phase)) ** 2 for phase in phases], axis=0)
            ratios.append(np.sum(weights * self.blurred) / np.sum(weights * self.sharp))
        without_noise = differences.means - 6.0 * self.noise  # 1 + 4 + 1 heights with independent noise
        means = np.maximum(without_noise, _LEFT * differences.means) / np.array(ratios)
        return replace(differences, means=means)


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
    instrument: _Instrument | None,
) -> Estimate:
    """Return the estimate of one direction; `weights` interpolate its lags.

    Where the power law bends over the length more than chance allows, the interval also holds the exponents
    between the shorter and between the longer lags.
    """
    hurst, metric = (None, np.eye(2)) if anisotropy is None else (anisotropy.hurst, anisotropy.metric)
    pairs = _middle_pairs(surface, differences)
    exponent, error, second = directional_fit(differences, pairs, weights, hurst, metric)
    note = ""
    if instrument is not None:
        error = float(np.hypot(error, instrument.standard_error))
        note = "corrected for the blur and noise that `estimate` finds"
    low, high = normal_interval(exponent, error)
    if anisotropy is not None and abs(anisotropy.curvature_z) > SIGNIFICANT:
        for start in range(len(weights) - 1):
            fit = directional_fit(differences, pairs, weights[start : start + 2], hurst, metric)
            part_low, part_high = normal_interval(*fit[:2])
            low, high = min(low, part_low), max(high, part_high)
        note = (
            f"the exponent changes with the lag ({anisotropy.curvature_z:+.1f} standard deviations): the "
            "interval holds the exponents of the shorter and of the longer lags"
        )
    # a second difference over one lag has 4 - 4^H times the mean square of a first one
    first = second / (4.0 - 4.0**exponent) if exponent < 1.0 else np.nan
    increment = float(np.sqrt(first)) * surface.unit
    if reason:
        error = low = high = np.nan
        note = ""
    return Estimate(exponent, error, low, high, rms_increment=increment, reason=reason, note=note).limited()


def _periodic_surface(surface: Surface, azimuths: Array, scales: Scales) -> _Directional:
    """Measure a periodic surface by the waves that run along each direction."""
    if surface.is_constant:
        return _Directional([undefined(CONSTANT)] * azimuths.size, None, CONSTANT)
    every = sectors.PlaneModes.of(surface.heights, surface.plane_spacing)
    extent = max(surface.grid.extent)
    low, high = band(every.modes) if scales is None else (extent / scales[1], extent / scales[0])
    modes = every.between(low, high)
    gaps = np.diff(azimuths, append=azimuths[:1] + 180.0)
    half_width = min(sectors.WIDEST, 0.5 * float(gaps.min())) if azimuths.size > 1 else sectors.WIDEST
    increments = sectors.directional_increments(surface.heights, surface.plane_spacing, azimuths)
    estimates = []
    for azimuth, increment in zip(azimuths, increments * surface.unit, strict=True):
        sector = modes.sector(float(azimuth), half_width)
        if np.sum(sector.weights) < 2 * LEAST_MODES or not _differ_in_length(sector):
            estimates.append(undefined("too few waves of the band run along this direction"))
            continue
        _, record = fit_interval(sector, 0.5, noise=False)
        estimates.append(replace(record, rms_increment=float(increment)).limited())
    if modes.weights.sum() < sectors.LEAST or not _differ_in_length(modes.modes):
        return _Directional(estimates, None, "too few waves in the band to compare directions")
    start = modes.modes.fit(0.5, noise=False).hurst
    return _Directional.of(estimates, sectors.fit_spectral_anisotropy(modes, start))


def _differ_in_length(modes: PeriodicModes) -> bool:
    return bool(modes.wavenumber.max() > 1.2 * modes.wavenumber.min())
