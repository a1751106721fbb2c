"""Maximum likelihood estimate of a periodic surface or profile: its modes, their band, and a roll-off.

The modes of a periodic Gaussian surface are independent, and it has no shorter waves than its grid carries:
no window, no aliasing, no edges. What must be found is the band of the power law: where the spectrum is cut
off, and where it rolls off into a plateau at long waves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base.spectra import half_wavenumbers, periodogram, radial_wavenumber
from fractalcontact.dimensions import _whittle
from fractalcontact.dimensions._quantisation import rounding_note
from fractalcontact.dimensions._records import ASKED, NORMAL, SIGNIFICANT, Estimate, joined, undefined
from fractalcontact.dimensions._scored_fit import best_scored
from fractalcontact.dimensions._surface_input import Scales, Surface

Array = np.ndarray[Any, np.dtype[Any]]

LEAST_BEYOND = 7  # modes beyond the last corner of a roll-off that is tried
_CUT_OFF = 1e-3  # a fall of the mean power by this factor from one ring to all the next is a cut-off
_NEXT = 4  # rings that must all have fallen: a single mode may be that weak by chance
_PENALTY = 6.0  # decrease of the deviance that a roll-off of a surface must bring
_ALIKE = 4.0  # deviance up to which one form of roll-off may be another
_PER_OCTAVE = 32  # rings of a slow roll-off
_OR_SLOW = "a slow roll-off explains the waves nearly as well: the interval holds its exponent"
_EVERY, _CORNERS = 64, 50  # corners tried: all of the first, then so many at growing distances
_LOWEST, _HIGHEST, _POINTS = -0.4, 1.9, 24  # Hurst exponents searched with a roll-off, and first points
_WINDOW = "all modes of the band: cut-offs and roll-off found from the spectrum"
_FAMILY = "periodic family: power law between cut-offs"
_CUT_OFF_BELOW_NOISE = (
    "a cut-off that is below the noise looks like another exponent: give `scales` inside the power law of a "
    "surface; the modes of a profile are too few"
)


def periodic_likelihood(surface: Surface, scales: Scales, noise: bool) -> Estimate:
    """Fit a power law to the modes of a periodic surface or profile."""
    heights = surface.heights if surface.axes == 2 else surface.heights[0]
    modes = PeriodicModes.of(heights, surface.relative_spacing)
    unit = max(surface.grid.extent)
    has_rolloff = surface.axes == 1 and scales is None and not noise
    if has_rolloff:
        low, high = cut_offs(modes)
    elif scales is None:
        low, high = band(modes)
    else:
        low, high = unit / scales[1], unit / scales[0]
    slow = fit_slow_rolloff(modes, low) if surface.axes == 2 and scales is None and not noise else None
    modes = modes.between(low, high)
    if modes.weights.sum() < _whittle.LEAST_MODES:
        return undefined(
            f"{modes.weights.sum():.0f} modes in the band, at least {_whittle.LEAST_MODES} are needed"
        )
    if has_rolloff:
        modes, fit, estimate = _with_rolloff(modes)
    else:
        fit, estimate = _whittle.fit_interval(modes, 0.5, noise)
    if slow is not None:
        modes, estimate = _with_slow_rolloff(slow, modes, estimate, unit)
    if noise and (surface.axes == 1 or (scales is None and abs(fit.misfit) > SIGNIFICANT)):
        estimate = estimate.without_interval(_CUT_OFF_BELOW_NOISE)
    rounding = "" if noise else rounding_note(surface.heights, estimate.standard_error)
    if rounding:
        with_noise = _whittle.fit_interval(modes, 0.5, True)[1]
        estimate = estimate.holding(with_noise.ci_low, with_noise.ci_high)
    jumps = np.diff(heights, append=heights[..., :1], axis=-1)
    cell = float(np.prod(surface.relative_spacing))
    return replace(
        estimate,
        scale_min=unit / float(modes.wavenumber.max()),
        scale_max=unit / float(modes.wavenumber.min()),
        rms_increment=float(np.sqrt(np.mean(jumps * jumps))) * surface.unit,
        noise_height=float(np.sqrt(max(fit.noise / cell, 0.0))) * surface.unit if noise else np.nan,
        window=_WINDOW if scales is None else ASKED,
        note=joined(_FAMILY, fit.noise_note, estimate.note, rounding),
    )


def _with_rolloff(modes: PeriodicModes) -> tuple[PeriodicModes, _whittle.WhittleFit, Estimate]:
    """Fit a profile with a roll-off at any wavelength; return its modes beyond the corner as well."""
    rolloff = fit_rolloff(modes)
    modes = modes.between(rolloff.corner, np.inf)
    fit, estimate = _whittle.fit_interval(modes, float(np.clip(rolloff.hurst, 0.01, 1.5)), False)
    low, high = rolloff.low, rolloff.high
    if estimate.note:  # the modes do not follow one power law
        low, high = min(low, estimate.ci_low), max(high, estimate.ci_high)
    estimate = replace(
        estimate,
        hurst=rolloff.hurst,
        standard_error=rolloff.standard_error,
        ci_low=low,
        ci_high=high,
    )
    return modes, fit, estimate


def _with_slow_rolloff(
    slow: SlowRolloff, modes: PeriodicModes, estimate: Estimate, unit: float
) -> tuple[PeriodicModes, Estimate]:
    """Return the estimate of a slow roll-off, or hold it in that of a power law that is nearly as likely."""
    law = slow.fit
    if slow.gain < 0.0:
        return modes, estimate.holding(law.low, law.high, _OR_SLOW)
    rolled = Estimate(
        law.hurst,
        law.standard_error,
        law.low,
        law.high,
        note="a slow roll-off: the spectrum falls as (q^2 + q_0^2)^(-1 - H) with a corner at waves of "
        f"{unit / law.corner:.3g} m",
    )
    if slow.gain < _ALIKE:
        rolled = rolled.holding(estimate.ci_low, estimate.ci_high)
    return modes.between(law.corner, np.inf), rolled


@dataclass(frozen=True)
class PeriodicModes:
    """Modes of a periodic surface under a power law (a `_whittle.Modes`).

    Attributes
    ----------
    power : ndarray, shape (modes,)
    wavenumber : ndarray, shape (modes,)
        In units of the lowest along the longest axis.
    weights : ndarray, shape (modes,)
        Real numbers that a mode stands for: 2 for a complex one.
    axes : int
        1 for a profile.
    azimuth : ndarray, shape (modes,), optional
        Direction of the wave, radian.
    """

    power: Array
    wavenumber: Array
    weights: Array
    axes: int
    azimuth: Array | None = None

    @classmethod
    def of(cls, heights: Array, spacing: tuple[float, ...]) -> PeriodicModes:
        """Transform a periodic surface (ny, nx) or profile (nx,); the mean is left out.

        `spacing` is relative, (dy/dx, 1) or (1,).
        """
        power, columns = periodogram(heights - heights.mean(), spacing)
        unit = 2.0 * np.pi / max(n * d for n, d in zip(heights.shape, spacing, strict=True))
        radius = (radial_wavenumber(heights.shape, spacing) / unit).ravel()
        weights = np.broadcast_to(columns, power.shape).ravel()
        q = half_wavenumbers(heights.shape, spacing)
        azimuth = np.arctan2(q[0][:, None], q[-1]) if len(spacing) == 2 else np.zeros(radius.shape)
        varies = radius > 0
        return cls(
            power.ravel()[varies], radius[varies], weights[varies], len(spacing), azimuth.ravel()[varies]
        )

    def between(self, low: float, high: float) -> PeriodicModes:
        """Return the modes with low <= wavenumber <= high, with a margin for rounding."""
        low, high = low * (1 - 1e-9), high * (1 + 1e-9)
        return self.part((self.wavenumber >= low) & (self.wavenumber <= high))

    @property
    def order(self) -> Array:
        """Wavelengths over the longest extent."""
        return np.asarray(1.0 / self.wavenumber)

    @property
    def sector(self) -> Array:
        """Quarter of the half-turn in which the azimuth of the wave lies."""
        if self.azimuth is None:
            return np.zeros(self.power.shape, dtype=int)
        return np.asarray(np.floor(self.azimuth * (4.0 / np.pi)).astype(int) % 4)

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Return z of the flatness of the complex modes."""
        is_complex = self.weights == 2.0
        return _whittle.flatness((self.power / fit.total)[is_complex], _whittle.EXPONENTIAL)

    def part(self, chosen: Array) -> PeriodicModes:
        """Return some of the modes."""
        azimuth = None if self.azimuth is None else self.azimuth[chosen]
        return PeriodicModes(
            self.power[chosen], self.wavenumber[chosen], self.weights[chosen], self.axes, azimuth
        )

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit the power law, and white noise under it."""
        least = self.wavenumber.max() ** (-self.axes - 1.0)
        return _whittle.fit_power(
            self.power,
            lambda hurst: np.asarray(self.wavenumber ** (-self.axes - 2.0 * hurst)),
            start,
            noise=0.01 * float(least) if noise else None,
            weights=self.weights,
        )

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H; the modes are independent."""
        return fit.standard_error


def band(modes: PeriodicModes) -> tuple[float, float]:
    """Return the lowest and the highest wavenumber of the power law.

    Cut-offs are steep falls between a ring and the few beyond it; the ring beside a fall is left out. The
    corner of a roll-off is that of the best power law with a plateau; for a surface only if that is much
    better than the power law alone.
    """
    low, high = cut_offs(modes)
    rings, mean, counts = _rings(modes)
    inside = (rings >= np.floor(low)) & (rings <= np.ceil(high))
    return max(low, _corner(rings[inside], mean[inside], counts[inside], modes.axes)), high


def cut_offs(modes: PeriodicModes) -> tuple[float, float]:
    """Return the wavenumbers between the cut-offs at long and at short waves."""
    rings, mean, _ = _rings(modes)
    strongest = int(np.argmax(mean))
    first = strongest - _last_before_fall(mean[strongest::-1])
    last = strongest + _last_before_fall(mean[strongest:])
    low = -np.inf if first == 0 else float(rings[first]) + 0.5
    high = np.inf if last == mean.size - 1 else float(rings[last]) - 0.5
    return low, high


def _rings(modes: PeriodicModes) -> tuple[Array, Array, Array]:
    """Return the integer wavenumbers that have modes, their mean power, and the weight of each ring."""
    ring = np.rint(modes.wavenumber).astype(int)
    counts = np.bincount(ring, modes.weights)
    total = np.bincount(ring, modes.weights * modes.power)
    rings = np.flatnonzero(counts > 0)
    return rings.astype(float), total[rings] / counts[rings], counts[rings]


def _last_before_fall(mean: Array) -> int:
    """Return the last ring before a cut-off, or the last of all."""
    following = np.concatenate([mean[1:], np.zeros(_NEXT - 1)])
    strongest = np.max([following[k : k + mean.size - 1] for k in range(_NEXT)], axis=0)
    falls = np.flatnonzero(strongest < _CUT_OFF * mean[:-1])
    return int(falls[0]) if falls.size else mean.size - 1


def _corner(q: Array, mean: Array, counts: Array, axes: int) -> float:
    """Return the wavenumber above which the power law holds; -inf if it holds from the first ring."""
    best, corner = np.inf, -np.inf
    # a short plateau in the few modes of a profile brings less than the penalty, and still bends the line
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


@dataclass(frozen=True)
class RolloffFit:
    """Estimate of H; `corner` is the wavenumber from which the power law holds."""

    hurst: float
    standard_error: float
    low: float
    high: float
    corner: float


@dataclass(frozen=True)
class SlowRolloff:
    """A slow roll-off, and the decrease of the deviance against the best sudden one, or none."""

    fit: RolloffFit
    gain: float


def fit_slow_rolloff(modes: PeriodicModes, low: float) -> SlowRolloff | None:
    """Fit amplitude * (q^2 + q_0^2)^(-axes / 2 - H) between the cut-offs; None where it is not likely.

    `low` is the wavenumber from which a power law holds without it, or -inf.
    """
    modes = modes.between(*cut_offs(modes))
    if modes.wavenumber.size < LEAST_BEYOND:
        return None
    ring = np.unique(np.rint(_PER_OCTAVE * np.log2(modes.wavenumber)), return_inverse=True)[1]
    count = np.bincount(ring, modes.weights)
    mean = np.bincount(ring, modes.weights * modes.power) / count
    logs = np.bincount(ring, modes.weights * np.log(modes.wavenumber)) / count
    power = 0.5 * modes.axes

    def model(values: Array) -> tuple[Array, Array]:
        square = np.exp(2.0 * values[1])
        rolled = np.log(np.exp(2.0 * logs) + square)
        return -(power + values[0]) * rolled, np.stack(
            [-rolled, -2.0 * (power + values[0]) * square * np.exp(-rolled)]
        )

    first, last = float(logs.min()), float(logs.max())
    bounds = np.array([_LOWEST, first - 1.0]), np.array([_HIGHEST, last])
    starts = [np.array([hurst, 0.7 * first + 0.3 * last]) for hurst in (0.3, 0.8)]
    best = best_scored(model, mean, count, starts, bounds, np.array([0.2, 0.7]))
    hurst, corner = (float(value) for value in best.values)
    if not (bounds[0][1] < corner < last and best.is_regular and 0.0 < hurst < 1.0):
        return None
    radius = np.exp(logs)
    plain = _deviance(radius, mean, count, modes.axes)
    sudden = plain if low == -np.inf else _deviance(np.maximum(radius, low), mean, count, modes.axes)
    gain = sudden - best.deviance
    if gain < -_ALIKE or plain - best.deviance < _PENALTY:
        return None
    error = float(best.half_widths[0])
    law = RolloffFit(hurst, error / NORMAL, hurst - error, hurst + error, float(np.exp(corner)))
    return SlowRolloff(law, gain)


def fit_rolloff(modes: PeriodicModes) -> RolloffFit:
    """Fit H, amplitude and corner of a roll-off to the modes of a profile between its cut-offs.

    A profile has few modes, and the corner cannot be found from them to within a mode or two. An interval
    that takes the corner as known covers the exponent too seldom (82 to 95 % of the cases, as measured).
    Here the expected power of wavenumber q is

        amplitude * max(q, corner)^(-1 - 2 H),

    and the interval is that of the likelihood at its best amplitude and corner for each H (profile
    likelihood: Cox and Hinkley 1974, Theoretical Statistics, ch. 9).
    """
    likelihood = RolloffLikelihood(modes)

    def deviance(hurst: float) -> float:
        return float(likelihood.deviances(hurst).min())

    hurst = _whittle.minimum(deviance, _LOWEST, _HIGHEST, points=_POINTS)
    least = deviance(hurst)

    def interval(rise: float) -> tuple[float, float]:
        """Return where the deviance has risen by `rise`."""
        low, high = (
            _whittle.crossing(lambda h: deviance(h) - least - rise, hurst, limit, limit)
            for limit in (_LOWEST, _HIGHEST)
        )
        return low, high

    inner, outer = interval(1.0), interval(_whittle.QUANTILE)
    corner = int(np.argmin(likelihood.deviances(hurst)))
    return RolloffFit(hurst, 0.5 * (inner[1] - inner[0]), *outer, float(modes.wavenumber[corner]))


class RolloffLikelihood:
    """Deviance of a power law with a roll-off for all corners at once, by running sums.

    `modes` are those of one profile between its cut-offs, in ascending order.
    """

    def __init__(self, modes: PeriodicModes) -> None:
        self.logs = np.log(modes.wavenumber)
        self.weights = modes.weights
        self.squares = modes.weights * modes.power
        self.total = float(modes.weights.sum())
        self.corners = slice(0, max(1, modes.wavenumber.size - LEAST_BEYOND))
        self.below, self.count = np.cumsum(self.squares), np.cumsum(self.weights)

    def deviances(self, hurst: float) -> Array:
        """Return the deviance at the best amplitude for every corner."""
        logs = (-1.0 - 2.0 * hurst) * self.logs
        expected = np.exp(logs)
        scaled, weighted = self.squares / expected, self.weights * logs
        # up to the corner all modes have the power of the corner
        level, rest = (np.cumsum(part[::-1])[::-1] - part for part in (scaled, weighted))
        amplitude = (self.below / expected + level) / self.total
        return np.asarray((self.total * np.log(amplitude) + self.count * logs + rest)[self.corners])
