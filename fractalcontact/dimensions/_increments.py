"""Closed-form estimate of H from increments over one, two and four points (method "increments").

For a fractional Brownian surface the mean square increment over m points is m^2H times that over one, for
first and for second differences alike. Second differences keep the rate 1/n for every H < 1; first
differences lose less where H is small (Zhu and Stein 2002, J. Agric. Biol. Environ. Stat. 7; Chan and Wood
2000, Ann. Stat. 28). H is the slope of a line through the logarithms, with one level per axis, by
generalised least squares: their exact covariance at a pilot estimate gives the weights, the standard error,
and chi square of the residual. One pass over the heights.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._increment_covariance import (
    NODES,
    complete_covariance,
    covariance_of_logs,
    gapped_pairs,
)
from fractalcontact.dimensions._increment_moments import LAGS, REACH, Moments, increment_moments
from fractalcontact.dimensions._line_fit import NO_NOISE, chi_square_z, misfit_reason
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import LARGEST_UNIT, SMALLEST_UNIT, Scales, Surface

Array = np.ndarray[Any, np.dtype[Any]]

# first differences where the pilot estimate is below, second differences above: their standard errors are
# equal at H = 0.53 on 256 x 256 points and 0.43 on 1024 x 1024
_FIRST_BELOW = 0.45


def increments(surface: Surface, scales: Scales, noise: float | None) -> Estimate:
    """Estimate H of one surface by the closed form, with its interval."""
    coarse = max(surface.grid.spacing)
    stride, lags = 1, len(LAGS)
    asked, scales = scales, surface.resolved(scales)
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
    rule = "the shortest lags, which carry nearly all information on H" if asked is None else "asked for"
    window: dict[str, Any] = {
        "scale_min": stride * min(surface.grid.spacing),
        "scale_max": stride * LAGS[lags - 1] * coarse,
        "window": rule,
    }
    rounding = 0.0 if surface.is_lazy else 4.0 * np.spacing(abs(float(surface.raw[0, 0]))) / unit
    if not np.nansum(second) > max(1e-22 * np.nansum(first), rounding**2):
        return replace(plane(), **window)
    pilot = _line(replace(moments, observed=None), surface.relative_spacing, 2, 0.5, lags)
    if not np.isfinite(pilot.hurst):
        step = stride * surface.spacing[1]
        return undefined(f"increments over at least two of the lags 1, 2 and 4 times {step:g} m are needed")
    order = 1 if pilot.hurst < _FIRST_BELOW else 2
    estimate = replace(_line(moments, surface.relative_spacing, order, pilot.hurst, lags), **window)
    # second differences over one lag have 4 - 4^H times the mean square of first differences
    square = first[0] if order == 1 else second[0] / (4.0 - 4.0 ** min(estimate.hurst, 0.999))
    rms = float(np.sqrt(square) * float(stride) ** -estimate.hurst)
    estimate = replace(estimate, rms_increment=rms * unit)
    if any(surface.grid.periodic):
        return estimate.without_interval(
            "a periodic surface is not fractional Brownian, and its shortest increments do not scale with H"
        )
    if noise:
        return estimate.without_interval(NO_NOISE)
    if estimate.misfit > SIGNIFICANT:
        return estimate.without_interval(misfit_reason(estimate))
    parts = _difference_of_parts(moments, surface.relative_spacing, estimate.hurst)
    if parts > SIGNIFICANT:
        return replace(estimate, misfit=parts).without_interval(
            f"parts of the surface are not equally rough (z = {parts:.1f}), as beside a step or a patch: its "
            "points tell less of H than those of a Gaussian surface"
        )
    return estimate


def _moments(surface: Surface, stride: int) -> tuple[Moments, float]:
    """Return the mean squares and their unit of height: 1 m unless they over- or underflow."""
    overlap = REACH * stride
    with np.errstate(over="ignore", invalid="ignore"):  # they are measured again below
        moments = increment_moments(surface.slabs(overlap), surface.grid.shape, stride)
    largest = float(np.nanmax(moments.means, initial=0.0))
    if surface.is_lazy or SMALLEST_UNIT**2 < largest < LARGEST_UNIT**2:
        return moments, 1.0
    return increment_moments(surface.slabs(overlap, surface.unit), surface.grid.shape, stride), surface.unit


def _line(moments: Moments, spacing: tuple[float, ...], order: int, pilot: float, lags: int) -> Estimate:
    """Fit the line through differences of an order with the weights of a surface of exponent `pilot`."""
    axes = len(spacing)
    along = [6, 0][2 - axes :]  # y, then x, of the columns of the moments
    means = np.concatenate([moments.means[start + 3 * (order - 1) :][:3] for start in along])
    # logarithms of numbers near one: the unit of height changes no bit
    means = means / np.ldexp(1.0, np.frexp(np.nanmax(means, initial=0.0))[1])
    usable = np.isfinite(means) & (means > 0) & (np.arange(3 * axes) % 3 < lags)
    by_axis = usable.reshape(axes, 3)
    by_axis &= np.count_nonzero(by_axis, axis=1, keepdims=True) > 1
    if not usable.any():
        return undefined("")
    levels = np.repeat(np.eye(axes)[:, by_axis.any(axis=1)], 3, axis=0)
    design = np.column_stack([levels, np.tile(2.0 * np.log(LAGS), axes)])[usable]
    if moments.observed is None:
        covariance = complete_covariance(pilot, moments.shape, spacing, order, moments.stride)
    else:
        pairs = gapped_pairs(moments.observed, order, axes, moments.stride)
        pilot = float(np.clip(pilot, NODES[0], NODES[-1]))  # a smooth or a white surface lies outside
        covariance = covariance_of_logs(pilot, spacing, order, pairs, moments.stride)
    inverse = np.linalg.inv(covariance[np.ix_(usable, usable)])
    information = design.T @ inverse @ design
    y = np.log(means[usable])
    coefficients = np.linalg.solve(information, design.T @ inverse @ y)
    residual = y - design @ coefficients
    freedom = y.size - design.shape[1]
    misfit = chi_square_z(float(residual @ inverse @ residual) / freedom, freedom) if freedom else np.nan
    hurst, error = float(coefficients[-1]), float(np.sqrt(np.linalg.inv(information)[-1, -1]))
    low, high = normal_interval(hurst, error)
    return Estimate(hurst, error, low, high, misfit=misfit)


def _difference_of_parts(moments: Moments, spacing: tuple[float, ...], hurst: float) -> float:
    """Return z of the scatter of the logarithms of mean squares between equal blocks of a surface.

    The level of a block is the mean over the lags of its second differences, which are nearly independent
    of those of other blocks: chi square of the levels. NaN for a surface without blocks, infinite beside flat
    ones.
    """
    axes = len(spacing)
    if moments.blocks is None:
        return float("nan")
    columns = np.concatenate([start + np.arange(3, 6) for start in [6, 0][2 - axes :]])
    means, counts = (values[:, columns] for values in moments.blocks)
    shares = np.min(counts / np.maximum(counts.max(axis=0), 1), axis=1)
    is_full = shares > 0.5
    if np.count_nonzero(is_full) < 2:
        return float("nan")
    covariance = len(means) * complete_covariance(hurst, moments.shape, spacing, 2, moments.stride)
    with np.errstate(divide="ignore"):
        levels = np.log(means[is_full]).mean(axis=1)
    if not np.isfinite(levels).all():
        return float("inf")
    weights = shares[is_full] / covariance.mean()
    residual = levels - weights @ levels / weights.sum()
    freedom = levels.size - 1
    return chi_square_z(float(weights @ residual**2) / freedom, freedom)
