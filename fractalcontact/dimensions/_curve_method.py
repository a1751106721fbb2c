"""An estimate of H from a straight line through a curve, with the interval of its sampling covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fractalcontact.base.power_law import fit_line
from fractalcontact.dimensions._curve import Curve
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    joined,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, between

Array = np.ndarray[Any, np.dtype[Any]]

_CORRELATED = "the points of the curve are correlated, so the scatter about a straight line gives no interval"
_INCOMPLETE = (
    "points are missing: the covariance, from which the interval follows, is known for complete heights only"
)
_LOWEST, _HIGHEST = 0.02, 0.98  # H at which the covariance is taken


@dataclass(frozen=True)
class CurveMethod:
    """A straight line through a curve in log-log scale.

    Attributes
    ----------
    measure : callable
        From a surface (and the longest lag, with `has_lags`) to its curve.
    to_hurst : callable
        From slope and number of axes to H.
    power : float or None
        Weights of the points, scale^power; None: their counts.
    window : callable
        From a surface to the shortest scale, the longest scale and the rule in words.
    as_wavelength : bool
        The scales of the curve are wavenumbers.
    equal_octaves : bool
        Give every octave of a free surface the same weight: a measured surface leaves its power law at the
        short end first, where most of the modes are. Counts are right for a periodic one.
    ignores_plane : bool
        The curve does not change when a plane is added.
    has_lags : bool
        The curve can be measured up to a longest lag.
    unit_note : str
        Note of a method that depends on the unit of height.
    expected : callable, optional
        From a surface, its curve and H to the curve expected of a fractional Brownian surface, up to a
        factor; None where it is a power law, or for this surface. H is that at which the measured curve over
        the expected one is flat.
    covariance : callable, optional
        From a surface, its curve and H to the covariance of the logarithms of the curve, or to the reason why
        there is none.
    """

    measure: Callable[..., Curve]
    to_hurst: Callable[[float, int], float]
    power: float | None
    window: Callable[[Surface], tuple[float, float, str]]
    as_wavelength: bool = False
    equal_octaves: bool = False
    ignores_plane: bool = False
    has_lags: bool = False
    unit_note: str = ""
    expected: Callable[[Surface, Curve, float], Array | None] | None = None
    covariance: Callable[[Surface, Curve, float], Array | str] | None = None

    def __call__(self, surface: Surface, scales: Scales, noise: bool) -> Estimate:
        """Measure the curve, choose the window, fit."""
        if self.ignores_plane and surface.is_plane:
            return undefined(CONSTANT) if surface.is_constant else plane()
        if surface.is_constant and not self.unit_note:
            return undefined(CONSTANT)
        low, high, rule = self.window(surface) if scales is None else (*scales, "asked for")
        if surface.finest_scale and scales is None:
            low, high = max(low, surface.finest_scale), max(high, 4.0 * surface.finest_scale)
            rule = f"{rule}; not below the shortest wavelength that the points resolve"
        longest = (high,) if self.has_lags and (scales is not None or surface.finest_scale) else ()
        # slopes do not depend on the unit of height, except for methods with a natural scale
        overflows = not self.unit_note and surface.squares_overflow
        curve = self.measure(surface.in_own_unit() if overflows else surface, *longest)
        lengths = 2.0 * np.pi / curve.scale if self.as_wavelength else curve.scale
        inside = between(lengths, (low, high)) & (curve.value > 0)
        if np.count_nonzero(inside) < 2:
            return undefined(f"fewer than two points of the curve between {low:g} m and {high:g} m")
        x, y = curve.scale[inside], curve.value[inside]
        y = y / y[0]  # a constant curve has slope 0 to the last bit
        power = -1.0 if self.equal_octaves and not all(surface.grid.periodic) else self.power
        weights = curve.count[inside].astype(float) if power is None else (x / x[0]) ** power
        line = _Line(self, surface, curve, inside, weights)
        hurst = line.hurst(y)
        estimate = Estimate(
            hurst,
            scale_min=float(lengths[inside].min()),
            scale_max=float(lengths[inside].max()),
            window=rule,
            reason=_CORRELATED,
            note="noise is not in the model of this method" if noise else self.unit_note,
        )
        if self.covariance is None or not np.isfinite(hurst):
            return estimate
        if noise:
            return replace(estimate, reason="noise is not in the model of this method")
        if surface.finest_scale or not surface.is_complete:
            return replace(estimate, reason=_INCOMPLETE)
        return line.with_interval(estimate, y)


@dataclass(frozen=True)
class _Line:
    """The line of a method through the points `inside` of a curve."""

    method: CurveMethod
    surface: Surface
    curve: Curve
    inside: Array
    weights: Array
    _evaluated: dict[float, Array | None] = field(default_factory=dict)  # the expected curve by H

    @property
    def scale(self) -> Array:
        return np.asarray(self.curve.scale[self.inside])

    @property
    def is_corrected(self) -> bool:
        """Whether the expected curve is no power law."""
        return self._at(0.5) is not None

    def hurst(self, values: Array, part: slice = slice(None)) -> float:
        """Return H of values at the points, or at a part of them."""
        x, y, weights = self.scale[part], values[part], self.weights[part]
        slope = fit_line(x, y, weights).slope
        uncorrected = self.method.to_hurst(slope, self.surface.axes)
        if not self.is_corrected:
            return uncorrected
        from scipy.optimize import brentq

        def excess_slope(hurst: float) -> float:
            return fit_line(x, y / self._expected(hurst)[part], weights).slope

        low, high = 1e-3, 0.999
        at_low, at_high = excess_slope(low), excess_slope(high)
        direction = np.sign(at_low - at_high)
        if not direction * at_low > 0.0 > direction * at_high:
            return uncorrected
        return float(brentq(excess_slope, low, high, xtol=1e-6))

    def _expected(self, hurst: float) -> Array:
        values = self._at(hurst)
        return np.ones(self.scale.size) if values is None else values

    def _at(self, hurst: float) -> Array | None:
        """Return the expected curve at the points, evaluated once for each H; None of a power law."""
        if hurst not in self._evaluated:
            expected = self.method.expected
            values = None if expected is None else expected(self.surface, self.curve, hurst)
            self._evaluated[hurst] = None if values is None else values[self.inside]
        return self._evaluated[hurst]

    def with_interval(self, estimate: Estimate, values: Array) -> Estimate:
        """Return the estimate with its interval, widened where the curve is bent."""
        assert self.method.covariance is not None
        covariance = self.method.covariance(
            self.surface, self.curve, float(np.clip(estimate.hurst, _LOWEST, _HIGHEST))
        )
        if isinstance(covariance, str):
            return replace(estimate, reason=covariance)
        covariance = covariance[np.ix_(self.inside, self.inside)]
        # the logarithm of a mean is too low by half its variance
        values = values * np.exp(0.5 * np.diag(covariance))
        hurst = self.hurst(values)
        x = np.log(self.scale / self.scale[0])
        weights = self.weights / self.weights.sum()
        centred = x - weights @ x
        of_slope = weights * centred / (weights @ centred**2)
        error = float(np.sqrt(of_slope @ covariance @ of_slope)) / abs(self._sensitivity(hurst))
        low, high = normal_interval(hurst, error)
        note = estimate.note
        if x.size > 3 and abs(z := self._bend(values, hurst, covariance, x)) > SIGNIFICANT:
            middle = int(np.searchsorted(x, 0.5 * (x[0] + x[-1])))
            middle = min(max(middle, 2), x.size - 2)
            halves = [self.hurst(values, part) for part in (slice(None, middle + 1), slice(middle, None))]
            low, high = min(low, *halves), max(high, *halves)
            note = joined(
                note,
                f"the exponent changes with scale ({z:+.1f} standard deviations): the interval holds the "
                "exponents of both halves of the curve",
            )
        return replace(
            estimate, hurst=hurst, standard_error=error, ci_low=low, ci_high=high, reason="", note=note
        )

    def _sensitivity(self, hurst: float) -> float:
        """Return the change of the slope with H."""
        step = 1e-3
        if not self.is_corrected:
            axes = self.surface.axes
            return 1.0 / (self.method.to_hurst(1.0, axes) - self.method.to_hurst(0.0, axes))
        middle = float(np.clip(hurst, 2.0 * step, 1.0 - 2.0 * step))
        ends = [middle - step, middle + step]
        first, second = (fit_line(self.scale, self._expected(h), self.weights).slope for h in ends)
        return (second - first) / (ends[1] - ends[0])

    def _bend(self, values: Array, hurst: float, covariance: Array, x: Array) -> float:
        """Return z of the curvature of the points about the expected curve."""
        y = np.log(values / self._expected(float(np.clip(hurst, 2e-3, 0.998))))
        root = np.sqrt(self.weights / self.weights.sum())
        design = np.stack([np.ones(x.size), x, x * x], axis=1)
        contrast = np.linalg.pinv(root[:, None] * design)[2] * root
        variance = float(contrast @ covariance @ contrast)
        return float(contrast @ y) / float(np.sqrt(variance)) if variance > 0.0 else 0.0
