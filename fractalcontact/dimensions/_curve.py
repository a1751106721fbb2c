"""Curves over scale, their labelled Dataset, and H from a straight line through one in log-log scale.

With y the logarithm of the curve at scales s, m(H) that of the curve expected (a power law: a H ln s, a the
slope for H = 1) and w weights that add up to one:

1. H makes the slope of y - m(H) against x = ln s zero: l'(y - m(H)) = 0, l = w (x - w'x) / (w'(x - w'x)^2).
2. C is the covariance of y at that H. The logarithm of a mean is too low by half its variance, diag(C) / 2,
   which is added.
3. The variance of H is l'Cl / (l'dm/dH)^2.
4. Misfit: chi square of the best line under C, r'C^-1 r with as many degrees of freedom as points less two,
   as a normal z (Wilson and Hilferty 1931).

Where z says that one exponent does not fit, there is no interval.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._methods import Method, function
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    joined,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, between, check_surface, read_surfaces

ALWAYS = ("local_slope", "run_time")  # variables of every curve
EXACT_MEAN = "exact to rounding: a mean over all pairs or windows, without its sampling scatter"

PERIODIC = "a periodic surface is not fractional Brownian, for which the covariance of the curve is known"


@dataclass(frozen=True)
class Curve:
    """A quantity at ascending scales.

    Attributes
    ----------
    scale : ndarray, shape (k,)
        Lengths in m, or wavenumbers in rad/m.
    value, count : ndarray, shape (k,)
        Mean value at each scale, and the number of pairs, modes or windows averaged.
    height_factor : float
        Factor by which the heights were multiplied; NaN where it does not matter.
    parts : ndarray, shape (k, ...), optional
        What each point was measured with, such as the edges of windows in points along y and x.
    power : float
        Weight of a point in a fit: scale^power.
    has_wavenumbers : bool
    """

    scale: Array
    value: Array
    count: Array
    height_factor: float = np.nan
    parts: Array | None = None
    power: float = 0.0
    has_wavenumbers: bool = False

    @property
    def length(self) -> Array:
        """Scales in m, wavenumbers as wavelengths."""
        return np.asarray(2.0 * np.pi / self.scale) if self.has_wavenumbers else self.scale

    @property
    def weight(self) -> Array:
        """Weights of the points in a fit."""
        return np.asarray((self.scale / self.scale[0]) ** self.power)

    def part(self, inside: Array) -> Curve:
        """Return some of the points."""
        parts = None if self.parts is None else self.parts[inside]
        return replace(
            self, scale=self.scale[inside], value=self.value[inside], count=self.count[inside], parts=parts
        )


def no_profile(surface: Surface) -> str:
    """Return why the covariance of the curve of a free profile does not hold; empty where it does."""
    if surface.axes == 2:
        return "the covariance of the curve is known for a single profile, not for the rows of a surface"
    return PERIODIC if any(surface.grid.periodic) else ""


def surface_check(*names: str, smallest: int = 3) -> Callable[..., None]:
    """Return the check of a curve that takes a surface only; `names` are the variables of its result."""

    def check(problems: Problems) -> None:
        reserved = (*names, "pair_count", *ALWAYS)
        check_surface(problems, smallest=smallest, reserved=reserved)

    return check


def curve_dataset(
    surface: xr.DataArray,
    measure: Callable[[Surface], Curve] | Sequence[Curve],
    dim: str,
    value: str,
    *,
    count: str | None = "pair_count",
    slope: Callable[[Curve], Array] | None = None,
) -> xr.Dataset:
    """Measure the curves of all surfaces and stack them along the leading dims of the input.

    Parameters
    ----------
    surface : DataArray
    measure : callable or sequence of Curve
        From a `Surface` to its curve, or the curves.
    dim, value, count : str
        Names of the scale, the value and the number of pairs, modes or windows.
    slope : callable, optional
        The local slopes of a curve. Default: `window_slope`.
    """
    surfaces = read_surfaces(surface)
    curves = [measure(single) for single in surfaces] if callable(measure) else measure
    leading = surface.dims[: surface.ndim - surfaces[0].axes]
    sizes = [surface.sizes[d] for d in leading]

    def stacked(values: Sequence[Array]) -> tuple[tuple[Any, ...], Array]:
        return (*leading, dim), np.stack(values).reshape(*sizes, -1)

    data: dict[str, Any] = {value: stacked([curve.value for curve in curves])}
    if count is not None:
        data[count] = stacked([curve.count for curve in curves])
    if np.isfinite(curves[0].height_factor):
        data["vertical_scale"] = (leading, np.reshape([curve.height_factor for curve in curves], sizes))
    data["local_slope"] = stacked([(slope or window_slope)(curve) for curve in curves])
    coords = {**leading_coords(surface, leading, (*data, dim, "wavelength", *ALWAYS)), dim: curves[0].scale}
    if curves[0].has_wavenumbers:
        coords["wavelength"] = (dim, curves[0].length)
    axes = zip(surface.dims[-surfaces[0].axes :], surfaces[0].grid.periodic, strict=True)
    periodic = " ".join(str(axis) for axis, is_periodic in axes if is_periodic) or "none"
    return xr.Dataset(data, coords, {"periodic_axes": periodic})


def window_slope(curve: Curve) -> Array:
    """Return the local slope; relative to the first value, a constant curve has slope 0 to the last bit."""
    return local_slope(curve.scale, curve.value / (curve.value[:1] if (curve.value > 0).all() else 1.0))


_CORRELATED = "the points of the curve are correlated, so the scatter about a straight line gives no interval"
_INCOMPLETE = (
    "points are missing: the covariance, from which the interval follows, is known for complete heights only"
)
NO_NOISE = "noise is not in the model of this method"
LOWEST, HIGHEST = 0.02, 0.98  # H of expected curves and covariances: at 0 and 1 they are singular
STEP = 1e-3  # of H in differences
_UNIT = "depends on the unit of height: see the curve's vertical_scale"


def fit(method: Method, surface: Surface, scales: Scales, noise: float | None) -> Estimate:
    """Estimate H of one surface by the curve of a method, over its own window or over `scales`."""
    if surface.is_constant and not method.natural_scale:
        return undefined(CONSTANT)
    if method.ignores_plane and surface.is_plane:
        return plane()
    window, rule = _window(method, surface, scales)
    curve: Curve = function(method.curve)(surface, window)
    inside = between(curve.length, window) & (curve.value > 0)
    if np.count_nonzero(inside) < 2:
        return undefined(f"fewer than two points of the curve between {window[0]:g} m and {window[1]:g} m")
    curve = curve.part(inside)
    x = np.log(curve.scale / curve.scale[0])
    y = np.log(curve.value / curve.value[0])  # a constant curve has slope 0 to the last bit
    line = _slope_of(x, curve.weight)
    a, b, c = method.slope

    def expected(hurst: float) -> Array:
        if not method.expected:
            return np.asarray((a * hurst + b * surface.axes + c) * x)
        return np.asarray(np.log(function(method.expected)(surface, curve, hurst)))

    def exponent(y: Array) -> float:
        if not method.expected:
            return (float(line @ y) - b * surface.axes - c) / a
        return _crossing(lambda hurst: float(line @ (y - expected(hurst))))

    hurst = exponent(y)
    estimate = Estimate(
        hurst,
        scale_min=float(curve.length.min()),
        scale_max=float(curve.length.max()),
        window=rule,
        reason=_CORRELATED,
        note=joined(NO_NOISE if noise else "", _UNIT if method.natural_scale else ""),
    )
    if not method.covariance:
        return estimate
    if surface.finest_scale or not surface.is_complete:
        return replace(estimate, reason=NO_NOISE if noise else _INCOMPLETE)
    covariance = function(method.covariance)(surface, curve, float(np.clip(hurst, LOWEST, HIGHEST)))
    if isinstance(covariance, str):
        return replace(estimate, reason=covariance)
    y = y + 0.5 * np.diag(covariance)
    hurst = exponent(y)
    middle = float(np.clip(hurst, LOWEST, HIGHEST))
    change = float(line @ (expected(middle + STEP) - expected(middle - STEP))) / (2.0 * STEP)
    error = float(np.sqrt(line @ covariance @ line)) / abs(change)
    low, high = normal_interval(hurst, error)
    estimate = replace(estimate, hurst=hurst, standard_error=error, ci_low=low, ci_high=high, reason="")
    estimate = replace(estimate, misfit=_misfit(x, y - expected(middle), covariance))
    reason = NO_NOISE if noise else misfit_reason(estimate) if estimate.misfit > SIGNIFICANT else ""
    return estimate.without_interval(reason) if reason else estimate


def misfit_reason(estimate: Estimate) -> str:
    """Return why an estimate whose curve does not fit has no interval."""
    return (
        f"one exponent does not fit from {estimate.scale_min:.3g} m to {estimate.scale_max:.3g} m (goodness "
        f"of fit: z = {estimate.misfit:.1f}): choose `scales`, or use the method `likelihood`"
    )


def _window(method: Method, surface: Surface, scales: Scales) -> tuple[tuple[float, float], str]:
    """Return the lengths to fit, and the rule in words."""
    if scales is not None:
        return scales, "asked for"
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    points = extent / spacing * (1 + 1e-9)
    is_periodic = any(surface.grid.periodic)
    window = next(row for row in method.windows if points >= row.points and is_periodic >= row.periodic)
    low, high = window.shortest * spacing, max(window.share * extent, window.least * spacing)
    finest = surface.finest_scale
    if not finest:
        return (low, high), window.rule
    rule = f"{window.rule}; not below the shortest wavelength that the points resolve"
    return (max(low, finest), max(high, 4.0 * finest)), rule


def _slope_of(x: Array, weights: Array) -> Array:
    """Return l of the module's first step: the slope of y is l'y."""
    weights = weights / weights.sum()
    centred = x - weights @ x
    return np.asarray(weights * centred / (weights @ centred**2))


def _crossing(slope: Callable[[float], float]) -> float:
    """Return H at which a slope vanishes; beyond the range of expected curves that of its tangent does."""
    low, high = slope(LOWEST), slope(HIGHEST)
    if low * high < 0.0:
        from scipy.optimize import brentq

        return float(brentq(slope, LOWEST, HIGHEST, xtol=1e-7))
    end, value = (LOWEST, low) if abs(low) < abs(high) else (HIGHEST, high)
    return end - value * 2.0 * STEP / (slope(end + STEP) - slope(end - STEP))


def _misfit(x: Array, y: Array, covariance: Array) -> float:
    """Return z of the residual of the line of least chi square; NaN for two points."""
    if x.size < 3:
        return float("nan")
    design = np.stack([np.ones(x.size), x], axis=1)
    inverse = np.linalg.inv(covariance)
    residual = y - design @ np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ y)
    return chi_square_z(float(residual @ inverse @ residual) / (x.size - 2), x.size - 2)


def chi_square_z(ratio: float, freedom: float) -> float:
    """Return chi square, given over its degrees of freedom, as a normal z (Wilson and Hilferty 1931)."""
    variance = 2.0 / (9.0 * freedom)
    return float((ratio ** (1.0 / 3.0) - 1.0 + variance) / np.sqrt(variance))
