"""Waves of a surface by direction: sectors of the spectrum, and score tests of isotropy.

The modes of a periodic Gaussian surface are independent. Divided by the mean of their ring they are
exponential numbers of mean one if the surface is isotropic, whatever its spectrum; harmonics of their
direction, in level and in slope, then vanish except for chance (score test). An anisotropy ratio is fitted
by likelihood. A surface with free edges is tapered and tested by its long waves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.spectra import half_wavenumbers, periodogram, window_weights
from fractalcontact.dimensions._anisotropy import (
    LARGEST_LOG_RATIO,
    Anisotropy,
    harmonics,
    log_square_derivatives,
    log_squares,
    metric_of,
    squared_length,
)
from fractalcontact.dimensions._second_differences import DIRECTIONS
from fractalcontact.dimensions._spectrum import without_trend

Array = np.ndarray[Any, np.dtype[Any]]

WIDEST = 90.0 / DIRECTIONS  # half the angle of a sector, degrees
LEAST = 100  # modes needed to estimate the harmonics of their directions
LEAST_OF_LAW = 24  # real numbers in the modes of a power law
_DIFFERENT = 1.2  # ratio of the lengths of its waves
_LEAST_TAPERED = 600  # the same in the whole plane of a tapered surface
_LONGEST, _SHORTEST = 3.5, 6.0  # wavenumber steps and spacings that limit the waves of a tapered surface
_TAPER_REACH = 2  # modes on either side that the taper correlates with one
_RINGS, _CUT_OFF = (
    4,
    2e-3,
)  # the power of a tapered surface falls so far within so many rings only at a cut-off
_ROUNDING = 1e-20  # of the strongest mode
_ROUNDS = 40
_LIMITS = (
    [-0.99, -LARGEST_LOG_RATIO, -LARGEST_LOG_RATIO],
    [3.0, LARGEST_LOG_RATIO, LARGEST_LOG_RATIO],
)  # of H and of the components of the log ratio


@dataclass(frozen=True)
class PowerLaw:
    """Exponent of some waves, its standard error, and z of the curvature of their spectrum."""

    hurst: float
    error: float
    curvature_z: float


@dataclass(frozen=True)
class PlaneModes:
    """Modes of a periodic surface by their wavevector.

    Attributes
    ----------
    power : ndarray, shape (modes,)
    wavevectors : ndarray, shape (modes, 2)
        y first, in units of the lowest wavenumber along the longest axis.
    weights : ndarray, shape (modes,)
        Real numbers that a mode stands for.
    extent : float
        Longest extent in x spacings.
    """

    power: Array
    wavevectors: Array
    weights: Array
    extent: float

    @classmethod
    def of(cls, heights: Array, spacing: tuple[float, float]) -> PlaneModes:
        """Transform a surface with relative spacings (dy/dx, 1)."""
        power, columns = periodogram(heights - heights.mean(), spacing)
        extent = max(n * d for n, d in zip(heights.shape, spacing, strict=True))
        qy, qx = half_wavenumbers(heights.shape, spacing)
        wavevectors = np.stack(np.broadcast_arrays(qy[:, None], qx), axis=-1).reshape(-1, 2)
        wavevectors = wavevectors * extent / (2 * np.pi)
        weights = np.broadcast_to(columns, power.shape).ravel()
        varies = wavevectors.any(axis=1)
        return cls(power.ravel()[varies], wavevectors[varies], weights[varies], extent)

    def between(self, low: float, high: float) -> PlaneModes:
        """Return the modes with low <= wavenumber <= high that are not rounding errors."""
        radius = np.hypot(*self.wavevectors.T)
        low, high = low * (1 - 1e-9), high * (1 + 1e-9)
        return self._part((radius >= low) & (radius <= high) & (self.power > _ROUNDING * self.power.max()))

    def sector(self, azimuth: float, half_width: float) -> PlaneModes:
        """Return the waves whose direction is within `half_width` degrees of an azimuth."""
        angle = np.degrees(np.arctan2(*self.wavevectors.T))
        # an edge belongs to the sector that begins with it
        from_edge = (angle - azimuth + half_width) % 180.0
        return self._part(np.round(from_edge, 9) < 2.0 * half_width)

    def power_law(self) -> PowerLaw:
        """Fit a power law by Whittle's likelihood; NaN where the waves are few, or of nearly one length."""
        radius = np.hypot(*self.wavevectors.T)
        if self.weights.sum() < LEAST_OF_LAW or not radius.max() > _DIFFERENT * radius.min():
            return PowerLaw(np.nan, np.nan, np.nan)
        logs = np.log(radius)
        information = 0.5 * self.weights
        logs -= information @ logs / information.sum()
        slope = 0.0
        for _ in range(_ROUNDS):  # Fisher scoring, at the best amplitude
            ratio = self.power * np.exp(slope * logs)
            ratio /= information @ ratio / information.sum()
            step = -float(information @ (logs * (ratio - 1.0)) / (information @ np.square(logs)))
            slope += float(np.clip(step, -1.0, 1.0))
            if abs(step) < 1e-9:
                break
        error = 0.5 / np.sqrt(information @ np.square(logs))
        curve = np.square(logs)
        design = np.stack([np.ones(logs.size), logs], axis=1)
        curve -= design @ np.linalg.solve(
            (information[:, None] * design).T @ design, design.T @ (information * curve)
        )
        scores = information * curve * (ratio - 1.0)  # of the modes; a lay lets them scatter more
        return PowerLaw(0.5 * slope - 1.0, float(error), float(scores.sum() / np.sqrt(scores @ scores)))

    def _part(self, chosen: Array) -> PlaneModes:
        return PlaneModes(self.power[chosen], self.wavevectors[chosen], self.weights[chosen], self.extent)


def directional_increments(heights: Array, spacing: tuple[float, float], azimuths: Array) -> Array:
    """Return the rms increment over one x spacing along each azimuth (degree), from all modes."""
    plane = PlaneModes.of(heights, spacing)
    area = float(np.prod([n * d for n, d in zip(heights.shape, spacing, strict=True)]))
    squares = []
    for azimuth in np.radians(azimuths):
        unit = np.array([np.sin(azimuth), np.cos(azimuth)])
        phase = plane.wavevectors @ unit * (2.0 * np.pi / plane.extent)
        squares.append(np.sum(plane.weights * plane.power * (2.0 - 2.0 * np.cos(phase))) / area)
    return np.asarray(np.sqrt(squares))


def fit_spectral_anisotropy(plane: PlaneModes, hurst: float) -> Anisotropy:
    """Test an isotropic spectrum, fit an anisotropic power law starting from `hurst`, and test that one."""
    isotropy_p_value = _score_test(plane, np.eye(2), hurst, fitted=0)
    u = v = 0.0
    half_weights = 0.5 * plane.weights
    for _ in range(_ROUNDS):  # Fisher scoring
        metric = np.linalg.inv(metric_of(u, v))
        logs = log_squares(plane.wavevectors, metric)
        derivatives = log_square_derivatives(plane.wavevectors, -u, -v)
        design = np.stack(
            [np.ones(logs.size), -logs, (1.0 + hurst) * derivatives[0], (1.0 + hurst) * derivatives[1]],
            axis=1,
        )
        scaled = plane.power * np.exp((1.0 + hurst) * (logs - logs.mean()))
        scaled /= np.sum(half_weights * scaled) / np.sum(half_weights)
        errors = np.linalg.pinv((half_weights[:, None] * design).T @ design)
        step = np.clip(errors @ (design.T @ (half_weights * (scaled - 1.0))), -0.5, 0.5)
        hurst, u, v = np.clip(np.array([hurst, u, v]) + step[1:], *_LIMITS).tolist()
        if np.abs(step[1:]).max() < 1e-7:
            break
    anisotropy_p_value = _score_test(plane, np.linalg.inv(metric_of(u, v)), hurst, fitted=2)
    exponent = (1.0 + hurst, errors[1, 1])
    return Anisotropy.of(isotropy_p_value, anisotropy_p_value, hurst, exponent, (u, v), errors[2:, 2:])


@dataclass(frozen=True)
class TaperedModes:
    """Long waves of a complete surface with free edges, under a Hann taper.

    Only waves longer than six spacings and shorter than a third of the extent are compared: shorter ones
    contain aliases, which follow the grid, and longer ones are changed by the taper.

    Attributes
    ----------
    power : ndarray, shape (my, mx)
        Both signs of the wavevector, in ascending order, and two modes more at either end.
    wavevectors : ndarray, shape (my, mx, 2)
        y first, over 2 pi.
    low, high : float
        The band.
    """

    power: Array
    wavevectors: Array
    low: float
    high: float

    @classmethod
    def of(
        cls, heights: Array, spacing: tuple[float, float], scales: tuple[float, float] = (0.0, np.inf)
    ) -> TaperedModes:
        """Transform a surface; `scales` are wavelengths in x spacings."""
        ny, nx = heights.shape
        tapered = without_trend(heights, plane=True)
        tapered *= window_weights(ny, "hann")[:, None]
        tapered *= window_weights(nx, "hann")
        extents = [n * d for n, d in zip((ny, nx), spacing, strict=True)]
        high = 1.0 / max(_SHORTEST * max(spacing), scales[0])
        y, x = (
            np.arange(-m, m + 1)
            for m in (int(high * extent * (1 + 1e-9)) + _TAPER_REACH for extent in extents)
        )
        half = fft.rfft2(tapered)[:, : x[-1] + 1][y]
        right = half.real**2 + half.imag**2
        power = np.concatenate([right[::-1, :0:-1], right], axis=1)
        wavevectors = np.stack(np.meshgrid(y / extents[0], x / extents[1], indexing="ij"), axis=-1)
        return cls(power, wavevectors, max(_LONGEST / min(extents), 1.0 / scales[1]), high)

    def test(self, metric: Array, hurst: float, *, fitted: int) -> float:
        """Return the p value of the score test; NaN if there are too few waves.

        `metric` measures wavevectors; the first `fitted` harmonics were fitted.
        """
        radius = np.sqrt(squared_length(self.wavevectors, metric))
        narrow = float(np.sqrt(np.linalg.eigvalsh(metric)[-1]))
        low, high = self.low * narrow, self.high / narrow
        chosen = (radius >= low * (1 - 1e-9)) & (radius <= high * (1 + 1e-9))
        ring = np.rint(np.round(radius * (_LONGEST / low), 9)).astype(int)
        mean = np.bincount(ring[chosen], self.power[chosen]) / np.maximum(np.bincount(ring[chosen]), 1)
        chosen &= ring <= _last_before_cut_off(mean)
        if np.count_nonzero(chosen) < _LEAST_TAPERED:
            return float("nan")
        y, x = (self.wavevectors[chosen] @ np.linalg.cholesky(metric)).T
        excess, centred = _ring_excess(
            self.power[chosen], radius[chosen] * (_LONGEST / low), np.arctan2(y, x), np.ones(y.size), hurst
        )
        covariance = []
        for column in centred.T:
            neighbours = np.zeros(chosen.shape)
            neighbours[chosen] = column
            for axis in (0, 1):  # squared correlations of modes one and two apart
                neighbours = neighbours + sum(
                    share * np.roll(neighbours, shift, axis)
                    for share, shift in ((4 / 9, 1), (4 / 9, -1), (1 / 36, 2), (1 / 36, -2))
                )
            covariance.append(2.0 * neighbours[chosen] @ centred)
        return _p_value(centred.T @ excess, np.array(covariance), fitted)


def _last_before_cut_off(mean: Array) -> int:
    """Return the last ring before a cut-off: beyond it there is only leakage of the taper."""
    falls = np.flatnonzero(mean[_RINGS:] < _CUT_OFF * mean[:-_RINGS])
    return int(falls[0]) if falls.size else mean.size


def _score_test(plane: PlaneModes, metric: Array, hurst: float, *, fitted: int) -> float:
    """Return the p value of the harmonics, of which the first `fitted` were fitted."""
    y, x = (plane.wavevectors @ np.linalg.cholesky(metric)).T
    radius = np.hypot(y, x)
    excess, centred = _ring_excess(plane.power, radius, np.arctan2(y, x), plane.weights, hurst)
    # a mode of weight 2 is one complex number, two of weight 1 are the same
    covariance = 2.0 * (plane.weights[:, None] * centred).T @ centred
    return _p_value(centred.T @ (plane.weights * excess), covariance, fitted)


def _ring_excess(
    power: Array, radius: Array, angle: Array, weights: Array, hurst: float
) -> tuple[Array, Array]:
    """Return the modes over the mean of their ring less one, and the harmonics less their ring mean.

    Rings are one wide in `radius`; the power law of exponent `hurst` is divided out first, because the
    lowest rings are as wide as their modes are apart.
    """
    ring = np.unique(np.rint(np.round(radius, 9)).astype(int), return_inverse=True)[1]
    total = np.bincount(ring, weights)
    power = power * (radius / radius.max()) ** (2.0 + 2.0 * hurst)
    excess = power / (np.bincount(ring, weights * power) / total)[ring] - 1.0
    centred = [
        column - (np.bincount(ring, weights * column) / total)[ring]
        for column in harmonics(np.log(radius), angle).T
    ]
    # the ring mean contains the mode itself: half of `total` complex numbers share it
    return excess * np.sqrt(1.0 + 2.0 / total)[ring], np.stack(centred, axis=1)


def _p_value(score: Array, covariance: Array, fitted: int) -> float:
    """Return the chi square p value of a score whose first `fitted` components a fit has made zero."""
    from scipy.special import chdtrc

    if fitted:
        projection = covariance[fitted:, :fitted] @ np.linalg.pinv(covariance[:fitted, :fitted])
        score = score[fitted:] - projection @ score[:fitted]
        covariance = covariance[fitted:, fitted:] - projection @ covariance[:fitted, fitted:]
    return float(chdtrc(score.size, score @ np.linalg.pinv(covariance) @ score))
