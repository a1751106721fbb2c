"""Roughness of a surface along each direction, and tests of isotropy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_directions, read_directions
from fractalcontact.base.grid import read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._azimuths import (
    IMPROBABLE,
    LARGEST,
    LARGEST_SPACINGS,
    NO_METRIC,
    AzimuthFit,
    fit_azimuths,
)
from fractalcontact.dimensions._diagnosis import diagnose, rounding_noise
from fractalcontact.dimensions._likelihood import likelihood, too_few_modes
from fractalcontact.dimensions._metric_spectrum import LARGEST_LOG_RATIO, squared_length
from fractalcontact.dimensions._mode_fit import first_fit
from fractalcontact.dimensions._records import CONSTANT, NORMAL, Estimate, joined, plane, smooth, undefined
from fractalcontact.dimensions._spectral_posterior import HIGHEST, LOWEST, Known
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    middle_slices,
    read_scales,
    read_surfaces,
)
from fractalcontact.dimensions._waves import without_waves

SMALLEST = 16  # points along each axis
_DIRECTIONS = 8
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
_AWAY_FROM_ISOTROPY = 2.447746830680816  # root of the 95 % quantile of chi square, two degrees of freedom
_WHITE, _STANDARD_ERRORS = 0.05, 3.0  # exponent above which heights are correlated, also in standard errors
_NO_VARIATION = "the heights do not vary along this direction"
_LEAST_SHARE = 1e-4  # of a maximum of the posterior that counts
_UNCORRELATED = "heights without correlation have no anisotropy ratio"
_FILLED = "the surface is smooth, and filling its gaps made shorter waves than it has: give a complete part"
_RIDGES = (
    "the anisotropy is stronger than any ratio that the fit can find: ridges continue along the azimuth, or "
    "spikes stand out"
)


def _check(problems: Problems) -> None:
    if problems.given.direction is not None:
        check_directions(problems)
    is_valid = check_surface(problems, smallest=SMALLEST, profile=False, reserved=_NAMES)
    if is_valid:
        spacing, most = read_grid(problems.given.surface).spacing, LARGEST_SPACINGS
        ratio = max(spacing) / min(spacing)
        problems.require(ratio <= most, "surface", f"spacings within {most:.0f} to 1", f"{ratio:.3g} to 1")
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
        Heights in m, dims (..., y, x), at least 16 points along each axis; of more than 2048 the middle
        ones are measured. NaN marks missing points.
    direction : str, float, or a sequence of them, optional
        Compass words, or degrees anticlockwise from E, modulo 180. Default: eight over the half-circle.
    scales : (low, high), optional
        Wavelengths in m of the waves that are fitted, as they are. Default: all that one model describes.

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
        A profile, wrong axes or scales, a surface too small or entirely NaN, spacings beyond 32 to 1.

    Notes
    -----
    The model is that of `estimate`: all directions have the same blur, noise and bend, which widen their
    intervals. An exponent is that of the waves that run along a direction, weighted by the sixteenth power
    of the cosine of their angle to it. Single waves are taken out first. Intervals of a gridded surface hold
    what gridding may add to the exponent, as in `estimate`.
    Models and tests: page `theory_dimensions`; measured size, power, coverage: page `estimator_accuracy`.

    References
    ----------
    Davies and Hall (1999), J. R. Stat. Soc. B 61; Sykulski, Olhede, Guillaumin, Lilly and Early (2019),
    Biometrika 106; Richard (2018), Journal of Mathematical Imaging and Vision 60.

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
    cuts = middle_slices(surface.shape[-2:], LARGEST)
    surface = surface.isel(dict(zip(surface.dims[-2:], cuts, strict=True)))
    surfaces = read_surfaces(surface)
    window = surfaces[0].resolved(read_scales(scales))
    azimuths = np.arange(_DIRECTIONS) * 180.0 / _DIRECTIONS
    if direction is not None:
        azimuths = np.unique([towards.azimuth % 180.0 for towards in read_directions(direction)])
    results = [_of_surface(single, azimuths, window) for single in surfaces]
    return _with_reasons(_dataset(surface, surfaces[0], azimuths, results), results)


@dataclass(frozen=True)
class _Anisotropy:
    """Tests of isotropy of a surface, and its anisotropy ratio; fields as in `directions`.

    `reason`: why there is no ratio; empty if there is one.
    """

    isotropy_p_value: float
    anisotropy_ratio: float
    anisotropy_ratio_low: float
    anisotropy_ratio_high: float
    anisotropy_azimuth: float
    anisotropy_p_value: float
    reason: str = ""

    @classmethod
    def of(cls, fit: AzimuthFit) -> _Anisotropy:
        """Convert the two components of the log ratio, with their covariance, to ratio and azimuth."""
        uv, nan = fit.uv, np.nan
        interval = fit.found.interval()
        hurst, error = interval.median, interval.deviation
        isotropy_p_value, anisotropy_p_value = fit.p_values
        azimuth = float(np.degrees(0.5 * np.arctan2(uv[1], uv[0])) % 180.0)
        size = float(np.hypot(*uv))
        if np.isnan(isotropy_p_value):
            return cls(nan, nan, nan, nan, nan, nan, _FILLED)
        if size > 0.99 * LARGEST_LOG_RATIO:
            return cls(isotropy_p_value, nan, nan, nan, azimuth, anisotropy_p_value, _RIDGES)
        if not hurst > max(_WHITE, _STANDARD_ERRORS * error):
            return cls(isotropy_p_value, nan, nan, nan, nan, nan, _UNCORRELATED)
        unit = uv / max(size, 1e-300)
        # the modes determine the log ratio times 1 + H
        variance = float(unit @ fit.covariance @ unit) + (size * error / (1.0 + hurst)) ** 2
        return cls(
            isotropy_p_value,
            anisotropy_ratio=float(np.exp(size)),
            anisotropy_ratio_low=float(np.exp(max(size - _AWAY_FROM_ISOTROPY * variance**0.5, 0.0))),
            anisotropy_ratio_high=float(np.exp(size + NORMAL * variance**0.5)),
            anisotropy_azimuth=azimuth,
            anisotropy_p_value=anisotropy_p_value,
        )


@dataclass(frozen=True)
class _Directional:
    """Estimates of one surface by direction, and its anisotropy, or the reason why there is none."""

    estimates: list[Estimate]
    anisotropy: _Anisotropy | None
    reason: str = ""


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
    topothesies = [[record.topothesy(spacing) for record in result.estimates] for result in results]
    data["topothesy"] = by_direction(topothesies)
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


def _of_surface(surface: Surface, azimuths: Array, scales: Scales) -> _Directional:
    """Measure a surface, without its single waves."""
    if surface.is_constant or surface.is_plane:
        record = (undefined(CONSTANT) if surface.is_constant else plane()).limited()
        return _Directional([record] * azimuths.size, None, record.note)
    for dim, ridge in (("x", 0.0), ("y", 90.0)):
        if not np.diff(surface.heights, axis=("y", "x").index(dim)).any():
            return _of_ridges(surface, dim, ridge, azimuths, scales)
    surface, note = without_waves(surface)
    dx, known = surface.spacing[1], Known.of(scales is not None)
    lengths = None if scales is None else (scales[0] / dx, scales[1] / dx)
    first = first_fit(surface, known.spread)
    background = 0.0 if first is None else rounding_noise(surface) / first.scale
    fit = None if first is None else fit_azimuths(first, lengths, known.over(1.0, background))
    if first is None or fit is None:
        too_smooth = smooth() if surface.is_complete else undefined(_FILLED)
        few = undefined(too_few_modes(None if first is None else scales))
        record = (too_smooth if scales is None else few).limited()
        return _Directional([record] * azimuths.size, None, record.note)
    anisotropy = _Anisotropy.of(fit)
    reason = diagnose(surface)
    if anisotropy.reason == _FILLED:
        reason = _FILLED
    elif anisotropy.reason == _RIDGES or fit.p_values[1] < IMPROBABLE:
        reason = NO_METRIC
    every, *each = fit.classes.along(fit.spectrum, azimuths)
    records = [
        _along(fit, a, along, every, first.scale * surface.unit, reason)
        for a, along in zip(azimuths, each, strict=True)
    ]
    shortest = np.nan if scales is None else scales[0]
    records = [replace(record, note=joined(note, record.note), scale_min=shortest) for record in records]
    records = [record.gridded(surface.finest_scale).limited() for record in records]
    return _Directional(records, anisotropy, anisotropy.reason)


def _of_ridges(surface: Surface, dim: str, ridge: float, azimuths: Array, scales: Scales) -> _Directional:
    """Measure a surface that varies across its ridges alone, as a profile."""
    profile = surface.source.isel({dim: 0}, drop=True)
    line = read_surfaces(profile.rename(y="x") if dim == "x" else profile)[0]
    across = likelihood(line, scales, None).gridded(surface.finest_scale)
    records = []
    for azimuth in azimuths:
        share = abs(np.sin(np.radians(azimuth - ridge)))
        increment = across.rms_increment * share**across.hurst
        along = replace(across, rms_increment=increment, posterior=None).limited()
        records.append(along if share > 0.0 else undefined(_NO_VARIATION))
    anisotropy = _Anisotropy(0.0, np.nan, np.nan, np.nan, ridge, 0.0, _RIDGES)
    return _Directional(records, anisotropy, _RIDGES)


def _along(fit: AzimuthFit, azimuth: float, along: Array, every: Array, unit: float, reason: str) -> Estimate:
    """Return the estimate of one direction, from those of `Classes.along`; no interval if `reason`."""
    from scipy.special import ndtr

    # of the posterior the scatter of the modes is replaced by that of the modes along the direction
    found, span = fit.found, HIGHEST - LOWEST
    is_probable = found.share > _LEAST_SHARE
    share, u, scale = (values[is_probable] for values in (found.share, found.centre, found.scale))
    slope = span * np.exp(-0.5 * u * u) / np.sqrt(2.0 * np.pi)
    centre = LOWEST + span * ndtr(u) + along[1] - every[1]
    deviation = np.sqrt(np.maximum(np.square(scale * slope) - every[2], 1e-16) + along[2])
    places = np.linspace((centre - 5.0 * deviation).min(), (centre + 5.0 * deviation).max(), 2001)
    below = share @ ndtr((places - centre[:, None]) / deviation[:, None]) / share.sum()
    low, hurst, high = np.interp((0.025, 0.5, 0.975), below, places).tolist()
    angle = np.radians(azimuth)
    lag = float(squared_length(fit.spectrum.metric, np.sin(angle), np.cos(angle)))
    increment = float(np.sqrt(np.exp(along[0]) * lag**hurst))
    estimate = Estimate(hurst, (high - low) / (2.0 * NORMAL), low, high, rms_increment=increment * unit)
    return estimate.without_interval(reason) if reason else estimate
