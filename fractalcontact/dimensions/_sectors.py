"""Sectors of the spectrum of a periodic face: exponent by direction of the waves, and tests of isotropy.

The modes of a periodic Gaussian face are independent. Over the mean of their ring they are exponential
numbers of mean one if the face is isotropic, whatever its spectrum; harmonics of their direction, in level
and in slope, must then vanish but for chance (a score test). A stretch is fitted by likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.spectra import half_wavenumbers, periodogram, window_weights
from fractalcontact.dimensions import _periodic, _rays
from fractalcontact.dimensions._fitting import PeriodicModes
from fractalcontact.dimensions._measures import without_trend

Array = np.ndarray[Any, np.dtype[Any]]

WIDEST = 90.0 / _rays.DIRECTIONS  # half the angle of a sector, degrees
LEAST = 100  # modes, to tell the harmonics of their directions
_LEAST_TAPERED = 600  # the same in the whole plane of a tapered face
_LONGEST, _SHORTEST = 3.5, 6.0  # steps of the wavenumber, and spacings: the waves of a tapered face
_LEAK = 2  # modes on either side that the taper ties to one
_LOBE, _CLIFF = 4, 2e-3  # rings within which the power of a tapered face falls so far only at a cut-off
_DEAD = 1e-20  # of the strongest mode: nothing but rounding
_ROUNDS = 40
_LIMITS = (
    [-0.99, -_rays.STEEPEST, -_rays.STEEPEST],
    [3.0, _rays.STEEPEST, _rays.STEEPEST],
)  # of H and of the parts of the logarithm of a stretch


@dataclass(frozen=True)
class Plane:
    """The modes of a band: power, wavevector (y first, in steps of the widest axis), weight in a sum."""

    power: Array
    waves: Array
    weights: Array
    extent: float

    @classmethod
    def of(cls, heights: Array, steps: tuple[float, float]) -> Plane:
        """Transform a face with spacings `steps` over that of x."""
        power, columns = periodogram(heights - heights.mean(), steps)
        extent = max(n * step for n, step in zip(heights.shape, steps, strict=True))
        qy, qx = half_wavenumbers(heights.shape, steps)
        waves = np.stack(np.broadcast_arrays(qy[:, None], qx), axis=-1).reshape(-1, 2) * extent / (2 * np.pi)
        weights = np.broadcast_to(columns, power.shape).ravel()
        kept = waves.any(axis=1)
        return cls(power.ravel()[kept], waves[kept], weights[kept], extent)

    def inside(self, low: float, high: float) -> Plane:
        """Keep the modes with low <= wavenumber <= high that are more than rounding."""
        radius = np.hypot(*self.waves.T)
        return self._part((radius >= low) & (radius <= high) & (self.power > _DEAD * self.power.max()))

    def sector(self, azimuth: float, half_width: float) -> PeriodicModes:
        """Keep the waves whose direction is within some degrees of an azimuth."""
        angle = np.degrees(np.arctan2(*self.waves.T))
        # an edge belongs to the sector that begins with it
        away = (angle - azimuth + half_width) % 180.0
        return PeriodicModes(self._part(np.round(away, 9) < 2.0 * half_width).modes)

    @property
    def modes(self) -> _periodic.Modes:
        """The same modes by their wavenumber alone."""
        return _periodic.Modes(self.power, np.hypot(*self.waves.T), self.weights, 2)

    def _part(self, kept: Array) -> Plane:
        return Plane(self.power[kept], self.waves[kept], self.weights[kept], self.extent)


def increments(heights: Array, steps: tuple[float, float], azimuths: Array) -> Array:
    """Return the rms increment over one x spacing along each azimuth (degree), from all modes of a face."""
    plane = Plane.of(heights, steps)
    area = float(np.prod([n * step for n, step in zip(heights.shape, steps, strict=True)]))
    found = []
    for azimuth in np.radians(azimuths):
        phase = plane.waves @ np.array([np.sin(azimuth), np.cos(azimuth)]) * (2.0 * np.pi / plane.extent)
        found.append(np.sum(plane.weights * plane.power * (2.0 - 2.0 * np.cos(phase))) / area)
    return np.asarray(np.sqrt(found))


def isotropy(plane: Plane, hurst: float) -> _rays.Isotropy:
    """Test an isotropic spectrum, fit a stretched power law from `hurst` on, and test that one."""
    p_value = _score_test(plane, np.eye(2), hurst, free=0)
    u = v = 0.0
    half = 0.5 * plane.weights
    for _ in range(_ROUNDS):
        form = np.linalg.inv(_rays.matrix(u, v))
        logs = _rays.log_squares(plane.waves, form)
        slopes = _rays.log_square_slopes(plane.waves, -u, -v)
        design = np.stack(
            [np.ones(logs.size), -logs, (1.0 + hurst) * slopes[0], (1.0 + hurst) * slopes[1]], axis=1
        )
        scaled = plane.power * np.exp((1.0 + hurst) * (logs - logs.mean()))
        scaled /= np.sum(half * scaled) / np.sum(half)
        errors = np.linalg.pinv((half[:, None] * design).T @ design)
        step = np.clip(errors @ (design.T @ (half * (scaled - 1.0))), -0.5, 0.5)
        hurst, u, v = np.clip(np.array([hurst, u, v]) + step[1:], *_LIMITS).tolist()
        if np.abs(step[1:]).max() < 1e-7:
            break
    stretched = _score_test(plane, np.linalg.inv(_rays.matrix(u, v)), hurst, free=2)
    return _rays.Isotropy.of(p_value, stretched, hurst, (1.0 + hurst, errors[1, 1]), (u, v), errors[2:, 2:])


@dataclass(frozen=True)
class Tapered:
    """The long waves of a complete face with free edges, under a Hann taper.

    Only waves longer than six spacings and shorter than a third of the extent are compared: shorter ones
    stand for their aliases too, which follow the grid, and longer ones feel the taper.

    Attributes
    ----------
    power : ndarray, shape (my, mx)
        Both signs of the wavevector, in ascending order, and two modes more at either end.
    waves : ndarray, shape (my, mx, 2)
        Wavevectors, y first, over 2 pi.
    low, high : float
        The band.
    """

    power: Array
    waves: Array
    low: float
    high: float

    @classmethod
    def of(
        cls, heights: Array, steps: tuple[float, float], scales: tuple[float, float] = (0.0, np.inf)
    ) -> Tapered:
        """Transform a face; `scales` are wavelengths."""
        ny, nx = heights.shape
        level = without_trend(heights, plane=True)
        level *= window_weights(ny, "hann")[:, None]
        level *= window_weights(nx, "hann")
        extents = [n * step for n, step in zip((ny, nx), steps, strict=True)]
        high = 1.0 / max(_SHORTEST * max(steps), scales[0])
        y, x = (np.arange(-m, m + 1) for m in (int(high * extent * (1 + 1e-9)) + _LEAK for extent in extents))
        half = fft.rfft2(level)[:, : x[-1] + 1][y]
        right = half.real**2 + half.imag**2
        power = np.concatenate([right[::-1, :0:-1], right], axis=1)
        waves = np.stack(np.meshgrid(y / extents[0], x / extents[1], indexing="ij"), axis=-1)
        return cls(power, waves, max(_LONGEST / min(extents), 1.0 / scales[1]), high)

    def test(self, form: Array, hurst: float, *, free: int) -> float:
        """Do the score test; NaN if there are too few waves.

        `form` measures wavevectors; the first `free` harmonics were fitted.
        """
        radius = np.sqrt(_rays.quadratic(self.waves, form))
        narrow = float(np.sqrt(np.linalg.eigvalsh(form)[-1]))
        low, high = self.low * narrow, self.high / narrow
        kept = (radius >= low * (1 - 1e-9)) & (radius <= high * (1 + 1e-9))
        ring = np.rint(np.round(radius * (_LONGEST / low), 9)).astype(int)
        mean = np.bincount(ring[kept], self.power[kept]) / np.maximum(np.bincount(ring[kept]), 1)
        kept &= ring <= _last(mean)
        if np.count_nonzero(kept) < _LEAST_TAPERED:
            return float("nan")
        y, x = (self.waves[kept] @ np.linalg.cholesky(form)).T
        excess, centred = _excess(
            self.power[kept], radius[kept] * (_LONGEST / low), np.arctan2(y, x), np.ones(y.size), hurst
        )
        spread = []
        for one in centred.T:
            near = np.zeros(kept.shape)
            near[kept] = one
            for axis in (0, 1):  # squared correlations of modes one and two apart
                near = near + sum(
                    share * np.roll(near, shift, axis)
                    for share, shift in ((4 / 9, 1), (4 / 9, -1), (1 / 36, 2), (1 / 36, -2))
                )
            spread.append(2.0 * near[kept] @ centred)
        return _chance(centred.T @ excess, np.array(spread), free)


def _last(mean: Array) -> int:
    """Return the last ring before a cut-off: what follows is what the taper lets through."""
    falls = np.flatnonzero(mean[_LOBE:] < _CLIFF * mean[:-_LOBE])
    return int(falls[0]) if falls.size else mean.size


def _score_test(plane: Plane, form: Array, hurst: float, *, free: int) -> float:
    """Return how likely harmonics as large are by chance; the first `free` of them were fitted."""
    y, x = (plane.waves @ np.linalg.cholesky(form)).T
    radius = np.hypot(y, x)
    excess, centred = _excess(plane.power, radius, np.arctan2(y, x), plane.weights, hurst)
    # a mode of weight 2 is one complex number, two of weight 1 are the same
    spread = 2.0 * (plane.weights[:, None] * centred).T @ centred
    return _chance(centred.T @ (plane.weights * excess), spread, free)


def _excess(power: Array, radius: Array, angle: Array, weights: Array, hurst: float) -> tuple[Array, Array]:
    """Return the modes over the mean of their ring, less one, and the harmonics less theirs.

    Rings are one wide in `radius`; the power law of exponent `hurst` is taken out first, for the lowest rings
    are as wide as their modes are apart.
    """
    ring = np.unique(np.rint(np.round(radius, 9)).astype(int), return_inverse=True)[1]
    total = np.bincount(ring, weights)
    power = power * (radius / radius.max()) ** (2.0 + 2.0 * hurst)
    excess = power / (np.bincount(ring, weights * power) / total)[ring] - 1.0
    centred = [
        one - (np.bincount(ring, weights * one) / total)[ring]
        for one in _rays.harmonics(np.log(radius), angle).T
    ]
    # the mean of a ring is its own: half of `total` complex numbers share it
    return excess * np.sqrt(1.0 + 2.0 / total)[ring], np.stack(centred, axis=1)


def _chance(score: Array, spread: Array, free: int) -> float:
    """Return how likely scores as large are by chance; the first `free` of them were made zero by a fit."""
    from scipy.special import chdtrc

    if free:
        rest = spread[free:, :free] @ np.linalg.inv(spread[:free, :free])
        score, spread = score[free:] - rest @ score[:free], spread[free:, free:] - rest @ spread[:free, free:]
    return float(chdtrc(score.size, score @ np.linalg.pinv(spread) @ score))
