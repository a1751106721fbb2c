"""Closed-form estimate of H from increments over one, two and four points (method "increments").

For a fractional Brownian surface the mean square increment over m points is m^2H times that over one, for
first and for second differences alike. Second differences keep the rate 1/n for every H < 1; first
differences lose less where H is small (Zhu and Stein 2002, J. Agric. Biol. Environ. Stat. 7; Chan and Wood
2000, Ann. Stat. 28). H is the slope of a line through the logarithms, with one level per axis. Their exact
covariance at a pilot estimate gives the weights and the standard error. One pass over the heights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._heterogeneity import Heterogeneity, heterogeneity, step_cells
from fractalcontact.dimensions._increment_covariance import (
    NODES,
    complete_covariance,
    covariance_of_logs,
    gapped_pairs,
)
from fractalcontact.dimensions._increment_moments import LAGS, REACH, Moments, increment_moments
from fractalcontact.dimensions._quantisation import quantisation, quantisation_note
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    joined,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import LARGEST_UNIT, SMALLEST_UNIT, Scales, Surface

Array = np.ndarray[Any, np.dtype[Any]]

FIRST_BELOW = 0.45  # first differences where the pilot estimate is below, second differences above
_UNLIKELY = (np.inf, 10.83, 13.82, 16.27)  # 99.9 % quantile of chi square, 0 to 3 degrees of freedom
_SMALLEST_HURST = 0.02
_CHOSEN = 0.04  # largest error of H, and more, measured where the roughest blocks are left out


def increments(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Estimate H of one surface by the closed form, with its interval and notes."""
    coarse = max(surface.grid.spacing)
    stride, lags = 1, len(LAGS)
    scales, asked = surface.resolved(scales), scales
    if scales is not None:
        stride = max(1, int(np.ceil(scales[0] / coarse * (1 - 1e-9))))
        lags = sum(lag * stride * coarse <= scales[1] * (1 + 1e-9) for lag in LAGS)
        if lags < 2:
            return undefined(
                f"two lags m and 2 m spacings are needed between {scales[0]:g} m and {scales[1]:g} m"
            )
    moments, unit = _moments(surface, stride)
    first, second = moments.means[[0, 6]], moments.means[[3, 9]]
    if not np.nansum(first) > 0:
        return undefined(CONSTANT)
    window: dict[str, Any] = {
        "scale_min": stride * min(surface.grid.spacing),
        "scale_max": stride * LAGS[lags - 1] * coarse,
        "window": "the shortest lags, which carry nearly all information on H"
        if asked is None
        else "asked for",
    }
    rounding = 0.0 if surface.is_lazy else 4.0 * np.spacing(abs(float(surface.raw[0, 0]))) / unit
    if not np.nansum(second) > max(1e-22 * np.nansum(first), rounding**2):
        return replace(plane(), **window)
    fit = closed_form(moments, surface.relative_spacing, lags=lags)
    if not np.isfinite(fit.hurst):
        return undefined(
            "increments over at least two of the lags 1, 2 and 4 times "
            f"{stride * surface.spacing[1]:g} m are needed"
        )
    reason = _no_interval(surface, noise)
    if reason:
        return Estimate(fit.hurst, rms_increment=fit.rms_increment * unit, reason=reason, **window)
    blocks = heterogeneity(moments, surface.relative_spacing, fit.hurst)
    if surface.axes == 2 and asked is None and blocks.levels_differ and not surface.is_lazy:
        ground = without_steps(surface.heights, surface.plane_spacing, fit.hurst)
        if ground is not None:
            return replace(ground, rms_increment=ground.rms_increment * surface.unit, **window)
    error, low, high, note = _interval(surface, moments, unit, fit, blocks, lags)
    increment = fit.rms_increment * unit
    return Estimate(
        fit.hurst, error, low, high, rms_increment=increment, misfit=fit.noise_z, note=note, **window
    )


def without_steps(heights: Array, spacing: tuple[float, float], full_hurst: float) -> Estimate | None:
    """Return the estimate of the ground between steps or scratches; None where there are none.

    Leaving the roughest blocks out also leaves out some that are rough by chance: the interval reaches half
    of the way to `full_hurst`, the exponent of the whole surface, up to a limit. None as well where the rest
    does not follow one power law.
    """
    if np.isnan(heights).any() or (cells := step_cells(heights)) is None:
        return None
    ground = np.where(cells, np.nan, heights)
    moments = increment_moments([(ground, len(ground))], (ground.shape[0], ground.shape[1]))
    fit = closed_form(moments, spacing)
    if not 0.0 < fit.hurst < 1.0 or fit.inflation > 1.0 or abs(fit.noise_z) > SIGNIFICANT:
        return None
    if heterogeneity(moments, spacing, fit.hurst).note:
        return None
    allowance = min(0.5 * abs(fit.hurst - full_hurst), _CHOSEN)
    low, high = normal_interval(fit.hurst, fit.standard_error)
    return Estimate(
        fit.hurst,
        fit.standard_error,
        low - allowance,
        high + allowance,
        rms_increment=fit.rms_increment,
        window="increments over 1, 2 and 4 spacings that cross no step",
        note=f"steps, scratches or spikes cross {100.0 * float(cells.mean()):.0f} % of the surface and "
        f"are left out; with them the exponent is {full_hurst:.2f}",
    )


def _interval(
    surface: Surface, moments: Moments, unit: float, fit: ClosedForm, blocks: Heterogeneity, lags: int
) -> tuple[float, float, float, str]:
    """Return standard error, interval and notes, widened where the surface does not fit the model."""
    error = fit.standard_error * fit.inflation
    low, high = blocks.widened(fit.hurst, *normal_interval(fit.hurst, error))
    low, high, noise_note = fit.widened_for_noise(low, high)
    rounding_note = ""
    if not surface.is_lazy:
        interval, rounding_note = _without_quantisation(surface, moments, unit, lags, error)
        low, high = float(np.fmin(low, interval[0])), float(np.fmax(high, interval[1]))
    disagreement = (
        "the lags disagree on the exponent, and the interval is widened accordingly"
        if fit.inflation > 1.0
        else ""
    )
    note = joined(disagreement, noise_note, blocks.note, rounding_note)
    return error * blocks.widening, low, high, note


def _moments(surface: Surface, stride: int) -> tuple[Moments, float]:
    """Return the mean squares and their unit of height: 1 m unless they over- or underflow."""
    overlap = REACH * stride
    moments = increment_moments(surface.slabs(overlap), surface.grid.shape, stride)
    largest = float(np.nanmax(moments.means, initial=0.0))
    if surface.is_lazy or SMALLEST_UNIT**2 < largest < LARGEST_UNIT**2:
        return moments, 1.0
    return increment_moments(surface.slabs(overlap, surface.unit), surface.grid.shape, stride), surface.unit


def _without_quantisation(
    surface: Surface, moments: Moments, unit: float, lags: int, error: float
) -> tuple[tuple[float, float], str]:
    """Return the interval of the mean squares less those of rounding, and a note, where that matters."""
    step, share = quantisation(surface.raw / unit if unit != 1.0 else surface.raw)
    if not share > 0.5 * error:
        return (np.nan, np.nan), ""
    square = step**2
    means = moments.means - np.tile(np.repeat([square / 6.0, square / 2.0], 3), 2)
    fit = closed_form(replace(moments, means=means), surface.relative_spacing, lags=lags)
    interval = normal_interval(fit.hurst, fit.standard_error * fit.inflation)
    if not np.isfinite(fit.hurst):
        interval = (np.nan, 1.0)
    return interval, quantisation_note(share, "the exponent without the contribution of rounding")


def _no_interval(surface: Surface, noise: bool) -> str:
    """Return why the interval for fractional Brownian heights would not be valid; empty if it is."""
    if any(surface.grid.periodic):
        return (
            "a periodic surface is not fractional Brownian, and its shortest increments do not scale with H"
        )
    return "noise is not in the model of this method" if noise else ""


@dataclass(frozen=True)
class ClosedForm:
    """Estimate of H from the increments.

    Attributes
    ----------
    hurst, standard_error : float
    order : int
        1 or 2: first or second differences.
    rms_increment : float
        Rms first difference over one x spacing.
    inflation : float
        Factor by which the lags scatter about the line more than expected (Birge 1932); 1 where chance
        gives as much once in a thousand times.
    noise_z : float
        z of a bend of the curve as white noise causes it.
    with_noise : pair of float
        Estimate with such noise fitted, and its standard error.
    """

    hurst: float = np.nan
    standard_error: float = np.nan
    order: int = 2
    rms_increment: float = np.nan
    inflation: float = np.nan
    noise_z: float = 0.0
    with_noise: tuple[float, float] = (np.nan, np.nan)

    def widened_for_noise(self, low: float, high: float) -> tuple[float, float, str]:
        """Widen an interval to hold the fit with noise, where the bend is significant; with a note."""
        if abs(self.noise_z) <= SIGNIFICANT:
            return low, high, ""
        noise_low, noise_high = normal_interval(*self.with_noise)
        note = (
            f"the exponent changes with the lag ({self.noise_z:+.1f} standard deviations): the interval also "
            f"holds the exponent with white noise fitted, {self.with_noise[0]:.2f}"
        )
        return min(low, noise_low), max(high, noise_high), note


def closed_form(
    moments: Moments, spacing: tuple[float, ...], *, lags: int = 3, error: bool = True
) -> ClosedForm:
    """Estimate H; NaN where the increments vanish.

    Parameters
    ----------
    moments : Moments
    spacing : (dy/dx, 1), or (1,) for a profile
    lags : 2 or 3
        How many of the lags are used.
    error : bool
        Where points are missing, False skips the standard error and uses the weights of a complete surface.
    """
    fit = _weighted_fit(moments, spacing, 2, 0.5, lags, error=False)
    if np.isfinite(fit.hurst):
        order = 1 if fit.hurst < FIRST_BELOW else 2
        fit = _weighted_fit(moments, spacing, order, fit.hurst, lags, error=error)
    # second differences over one lag have 4 - 4^H times the mean square of first differences
    square = moments.means[0] if fit.order == 1 else moments.means[3] / (4.0 - 4.0 ** min(fit.hurst, 0.999))
    return replace(fit, rms_increment=float(np.sqrt(square) * float(moments.stride) ** -fit.hurst))


def _weighted_fit(
    moments: Moments, spacing: tuple[float, ...], order: int, pilot: float, lags: int, *, error: bool
) -> ClosedForm:
    """Fit the line with the weights of a surface of exponent `pilot`."""
    axes = len(spacing)
    columns = np.array(
        [3 * (order - 1) + i + 6 * (axes == 2 and axis == 0) for axis in range(axes) for i in range(3)]
    )
    means = moments.means[columns]
    # logarithms of numbers near one: the unit of height changes no bit
    means = means / np.ldexp(1.0, np.frexp(np.nanmax(means, initial=0.0))[1])
    usable = np.isfinite(means) & (means > 0) & (np.arange(3 * axes) % 3 < lags)
    design = np.zeros((3 * axes, axes + 1))
    for axis in range(axes):
        design[3 * axis : 3 * axis + 3, axis] = 1.0
    design[:, axes] = np.tile(2.0 * np.log(LAGS), axes)
    for axis in range(axes):
        of_axis = slice(3 * axis, 3 * axis + 3)
        usable[of_axis] &= np.count_nonzero(usable[of_axis]) > 1
    if not usable.any():
        return ClosedForm(order=order)
    if moments.observed is None or not error:
        covariance = complete_covariance(pilot, moments.shape, spacing, order, moments.stride)
    else:
        pairs = gapped_pairs(moments.observed, order, axes, moments.stride)
        pilot = float(np.clip(pilot, NODES[0], NODES[-1]))  # a smooth or a white surface lies outside
        covariance = covariance_of_logs(pilot, spacing, order, pairs, moments.stride)
    fit = _line(design[usable], np.log(means[usable]), covariance[np.ix_(usable, usable)])
    return replace(fit, order=order)


def _line(design: Array, values: Array, covariance: Array) -> ClosedForm:
    """Fit the line by generalised least squares; the last column of the design is that of H."""
    design = design[:, np.any(design != 0, axis=0)]
    coefficients, inverse, chi_square = _least_squares(design, values, covariance)
    freedom = values.size - design.shape[1]
    inflation = np.sqrt(chi_square / freedom) if chi_square > _UNLIKELY[freedom] else 1.0
    fit = ClosedForm(float(coefficients[-1]), float(np.sqrt(inverse[-1, -1])), inflation=float(inflation))
    if freedom <= design.shape[1] - 2:  # no axis has three lags
        return fit
    # white noise adds the same to every lag; at H = 0 it cannot be distinguished from the level
    noise = np.exp(-max(fit.hurst, _SMALLEST_HURST) * design[:, -1])
    coefficients, inverse, _ = _least_squares(np.column_stack([noise, design]), values, covariance)
    return replace(
        fit,
        noise_z=float(coefficients[0] / np.sqrt(inverse[0, 0])),
        with_noise=(float(coefficients[-1]), float(np.sqrt(inverse[-1, -1]))),
    )


def _least_squares(design: Array, values: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Return the coefficients, their covariance, and chi square of the residual."""
    weighted = np.linalg.solve(covariance, design)
    inverse = np.linalg.inv(design.T @ weighted)
    coefficients = inverse @ (weighted.T @ values)
    residual = values - design @ coefficients
    return coefficients, inverse, float(residual @ np.linalg.solve(covariance, residual))
