"""A power law fitted to the modes of a periodic face, and the band in which it holds.

The modes of a periodic Gaussian face are independent, and the face has no shorter waves than its grid
carries: no window, no aliasing, no edges. What must be found is the band: where the spectrum is cut off,
and where it bends into a plateau.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.spectra import half_wavenumbers, periodogram, radial_wavenumber

Array = np.ndarray[Any, np.dtype[Any]]

_CLIFF = 1e-3  # a fall of the mean power by this factor from one ring to all the next is a cut-off
_NEXT = 4  # rings that must all have fallen: one mode alone may be that weak by chance
_PENALTY = 6.0  # fall of the deviance that a plateau of a surface must bring
_EVERY, _CORNERS = 64, 50  # corners tried: all of the first, then so many, ever farther apart
LEAST_MODES = 12


@dataclass(frozen=True)
class Modes:
    """Power, wavenumber (in steps of the widest axis) and weight of the modes; azimuth (radian)."""

    power: Array
    wavenumber: Array
    weights: Array
    axes: int
    azimuth: Array | None = None

    def inside(self, low: float, high: float) -> Modes:
        """Keep the modes with low <= wavenumber <= high."""
        return self.part((self.wavenumber >= low) & (self.wavenumber <= high))

    def part(self, kept: Array) -> Modes:
        """Keep some of the modes."""
        azimuth = None if self.azimuth is None else self.azimuth[kept]
        return Modes(self.power[kept], self.wavenumber[kept], self.weights[kept], self.axes, azimuth)


def modes(heights: Array, steps: tuple[float, ...]) -> Modes:
    """Return the modes of a periodic face, the mean left out.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx) or (nx,)
    steps : (dy/dx, 1) or (1,)
    """
    power, columns = periodogram(heights - heights.mean(), steps)
    unit = 2.0 * np.pi / max(n * step for n, step in zip(heights.shape, steps, strict=True))
    radius = (radial_wavenumber(heights.shape, steps) / unit).ravel()
    weights = np.broadcast_to(columns, power.shape).ravel()
    waves = half_wavenumbers(heights.shape, steps)
    azimuth = np.arctan2(waves[0][:, None], waves[-1]) if len(steps) == 2 else np.zeros(radius.shape)
    kept = radius > 0
    return Modes(power.ravel()[kept], radius[kept], weights[kept], len(steps), azimuth.ravel()[kept])


def band(modes: Modes) -> tuple[float, float]:
    """Return the lowest and the highest wavenumber of the power law.

    Cut-offs are cliffs between a ring and the few beyond it, and the ring beside a cliff is left out. A
    plateau is what the likelihood of power law with plateau finds; on a surface only if that is much better
    than the power law alone.
    """
    low, high = cut_offs(modes)
    rings, mean, counts = _rings(modes)
    chosen = (rings >= np.floor(low)) & (rings <= np.ceil(high))
    return max(low, _plateau(rings[chosen], mean[chosen], counts[chosen], modes.axes)), high


def cut_offs(modes: Modes) -> tuple[float, float]:
    """Return the wavenumbers between which the cut-offs leave the power law alone."""
    rings, mean, _ = _rings(modes)
    first, last = _cliffs(mean)
    low = -np.inf if first == 0 else float(rings[first]) + 0.5
    high = np.inf if last == mean.size - 1 else float(rings[last]) - 0.5
    return low, high


def _rings(modes: Modes) -> tuple[Array, Array, Array]:
    """Return whole wavenumbers that have modes, their mean power, and how many real numbers each holds."""
    ring = np.rint(modes.wavenumber).astype(int)
    counts = np.bincount(ring, modes.weights)
    total = np.bincount(ring, modes.weights * modes.power)
    rings = np.flatnonzero(counts > 0)
    return rings.astype(float), total[rings] / counts[rings], counts[rings]


def power_law(modes: Modes, hurst: float) -> Array:
    """Return the power for unit amplitude."""
    return np.asarray(modes.wavenumber ** (-modes.axes - 2.0 * hurst))


def _cliffs(mean: Array) -> tuple[int, int]:
    """Return the first and the last ring of the band around the strongest one."""
    top = int(np.argmax(mean))
    return top - _fall(mean[top::-1]), top + _fall(mean[top:])


def _fall(mean: Array) -> int:
    """Return the last ring before a cliff, or the last of all."""
    following = np.concatenate([mean[1:], np.zeros(_NEXT - 1)])
    strongest = np.max([following[k : k + mean.size - 1] for k in range(_NEXT)], axis=0)
    falls = np.flatnonzero(strongest < _CLIFF * mean[:-1])
    return int(falls[0]) if falls.size else mean.size - 1


def _plateau(q: Array, mean: Array, counts: Array, axes: int) -> float:
    """Return the wavenumber above which the power law holds; -inf if it holds from the first ring."""
    best, corner = np.inf, -np.inf
    # a short plateau in the few modes of a profile brings less than the penalty, and bends the line
    penalty = _PENALTY if axes == 2 else 0.0
    last = max(1, int(0.6 * q.size))
    corners = np.arange(min(last, _EVERY))
    if last > _EVERY:
        corners = np.unique(np.append(corners, np.geomspace(_EVERY, last - 1, _CORNERS).astype(int)))
    for i in corners.tolist():
        deviance = _deviance(np.maximum(q, q[i]) / q[i], mean, counts, axes)
        if deviance < best - (penalty if i <= 1 or corner == -np.inf else 0.0):
            best, corner = deviance, (-np.inf if i == 0 else q[i] + 0.5)
    return corner


def _deviance(q: Array, mean: Array, counts: Array, axes: int) -> float:
    """Return the deviance of mean = A q^-s at the best A and s, by scoring on the rings."""
    logs = np.log(q)
    centred = logs - np.sum(counts * logs) / np.sum(counts)
    spread = float(np.sum(counts * centred**2))
    if spread <= 0:
        return np.inf
    slope = axes + 1.0
    for _ in range(50):
        scaled = mean * q**slope
        level = float(np.sum(counts * scaled) / np.sum(counts))
        step = -float(np.sum(counts * centred * (scaled / level - 1.0))) / spread
        slope += float(np.clip(step, -1.0, 1.0))
        if abs(step) < 1e-9:
            break
    scaled = mean * q**slope
    level = float(np.sum(counts * scaled) / np.sum(counts))
    return float(np.sum(counts) * np.log(level) - slope * np.sum(counts * logs))
