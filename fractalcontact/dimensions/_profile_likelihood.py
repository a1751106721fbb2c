"""Exact likelihood of a profile: Gaussian increments with their full covariance.

The increments between successive observed points are Gaussian with a covariance that follows from the
variogram, whatever the gaps. A tilt of the profile is a mean proportional to the gaps and is eliminated
(restricted likelihood: Patterson and Thompson 1971, Biometrika 58). Long profiles are cut into chunks of
`CHUNK` points, which are taken as independent; each has its own tilt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions import _mode_blocks
from fractalcontact.dimensions._blur import (
    blurred_estimate,
    chosen_blocks,
    fit_blurred,
    is_seen,
)
from fractalcontact.dimensions._exponent_by_scale import (
    frame_blocks,
    longest_run,
    octaves,
    run_estimate,
)
from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments
from fractalcontact.dimensions._increments import closed_form
from fractalcontact.dimensions._mode_blocks import LOWEST
from fractalcontact.dimensions._quantisation import rounding_note
from fractalcontact.dimensions._records import ASKED, Estimate, joined, undefined
from fractalcontact.dimensions._second_exponent import Explanations, several_exponents
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._whittle import QUANTILE, crossing, minimum

Array = np.ndarray[Any, np.dtype[Any]]

CHUNK = 256
SMALLEST = 8  # observed points
_LOWEST, _HIGHEST = 1e-3, 0.999
_AT_LIMIT = 0.998  # H beyond which the search is repeated among profiles smoother than fractal ones
_SMOOTHEST = 1.9
_TILT = 20.0  # variance of a random tilt that is eliminated, in units of the largest covariance of increments
_LEAST_NOISE, _MOST_NOISE = np.log(1e-5), np.log(100.0)  # logarithms of the noise over the squared increment
_LEAST_POINTS = 64  # of a profile whose blur is looked for
_LONGEST_MODES, _NEIGHBOURS = 16, 8  # longest waves of a profile, and neighbours of a single shorter one
_SINGLE = 0.9  # share of the power beyond the longest that these may hold


def profile_likelihood(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit a profile with its exact likelihood, or with that of its modes where it is blurred."""
    heights, dx = surface.heights[0], surface.spacing[1]
    weak = np.nan, np.nan
    if np.isfinite(heights).all() and heights.size >= _LEAST_POINTS and not surface.finest_scale:
        estimate, weak = _profile_modes(surface, scales, noise, spread)
        if estimate is not None:
            return estimate
    stride = 1 if scales is None else max(1, int(np.ceil(scales[0] / dx * (1 - 1e-9))))
    heights = heights[::stride]
    longest = CHUNK if scales is None else int(scales[1] / (dx * stride) * (1 + 1e-9)) + 1
    chunk = min(longest, CHUNK, int(np.isfinite(heights).sum()))
    if chunk < SMALLEST:
        return undefined(f"{chunk} points, at least {SMALLEST} are needed")
    fit = fit_profile(heights, noise=noise, chunk=chunk)
    window: dict[str, Any] = {
        "scale_min": stride * dx,
        "scale_max": (chunk - 1) * stride * dx,
        "window": "exact likelihood of all increments" if scales is None else ASKED,
    }
    if fit.low > 1.0:
        return Estimate(fit.hurst, ci_low=fit.low, ci_high=fit.high, **window)
    moments = increment_moments([(heights[None], 1)], (heights.size,))
    blocks = heterogeneity(moments, (1.0,), fit.hurst)
    low, high = blocks.widened(fit.hurst, fit.low, fit.high)
    low, high = float(np.fmin(low, weak[0])), float(np.fmax(high, weak[1]))
    noise_note = ""
    if not noise:
        low, high, noise_note = closed_form(moments, (1.0,)).widened_for_noise(low, high)
    rounding = "" if noise else rounding_note(heights[None], fit.standard_error)
    if rounding:
        with_noise = fit_profile(heights, noise=True, chunk=chunk)
        low, high = min(low, with_noise.low), max(high, with_noise.high)
    return Estimate(
        fit.hurst,
        fit.standard_error * blocks.widening,
        low,
        high,
        rms_increment=fit.rms_increment * float(stride) ** -fit.hurst * surface.unit,
        noise_height=float(np.sqrt(fit.noise)) * surface.unit if noise else np.nan,
        note=joined(noise_note, blocks.note, rounding),
        **window,
    )


def _profile_modes(
    surface: Surface, scales: Scales, noise: bool, spread: float | None
) -> tuple[Estimate | None, tuple[float, float]]:
    """Return the estimate of a profile that is no fractional Brownian one, by its modes; None if it is one.

    The second result is an interval that allows for weak blur or noise; NaN where the modes show none.
    """
    heights, dx, none = surface.heights[0], surface.spacing[1], (np.nan, np.nan)
    frame = _mode_blocks.frame((heights.size,), (1.0,))
    modes = _mode_blocks.profile_modes(heights) ** 2
    if (share := _largest_share(modes)) > _SINGLE:
        reason = f"a single wave holds {100.0 * share:.0f} % of the shorter waves: no fractal"
        return undefined(reason), none
    blocks = frame_blocks(frame.mean(modes), frame)
    fit = fit_blurred(modes, frame, noise=noise, spread=spread, chosen=chosen_blocks(frame, surface, scales))
    if fit is not None and is_seen(fit, surface.axes, spread):
        if scales is None and spread is None and not noise:
            several = several_exponents(Explanations(fit, blocks), surface)
            if several is not None:
                return several, none
        amplitude = fit.amplitude * heights.size ** (-2.0 * fit.hurst)
        longest = heights.size * dx if scales is None else scales[1]
        return blurred_estimate(fit, surface, scales, amplitude, longest), none
    record = octaves(blocks)
    run = longest_run(record)
    if scales is None and 0 < run.last - run.first < len(record) and LOWEST < run.fit.hurst < 1.0:
        return run_estimate(run, surface), none
    if fit is None or noise or not (fit.is_good and fit.hurst < 1.0):
        return None, none
    return None, (max(fit.low, 0.0), min(fit.high, 1.0))


def _largest_share(power: Array) -> float:
    """Return the share of the shorter waves of a profile that one of them and its neighbours hold."""
    shorter = power[_LONGEST_MODES:]
    strongest = int(np.argmax(shorter))
    if strongest < _NEIGHBOURS or not shorter[strongest] > 0.0:
        return 0.0
    inside = slice(strongest - _NEIGHBOURS, strongest + _NEIGHBOURS + 1)
    return float(shorter[inside].sum() / shorter.sum())


@dataclass(frozen=True)
class ProfileFit:
    """Estimate of H; the interval is that of the profile likelihood.

    It lies inside (0, 1), unless the whole interval lies beyond 1: the profile is smoother than a fractal.
    """

    hurst: float
    standard_error: float
    low: float
    high: float
    rms_increment: float
    noise: float


def fit_profile(heights: Array, *, noise: bool = False, chunk: int = CHUNK) -> ProfileFit:
    """Fit H, the amplitude and, with `noise`, white noise on the heights.

    Parameters
    ----------
    heights : ndarray, shape (n,)
        At least `SMALLEST` finite values that do not lie on a straight line.
    noise : bool
        Fit white noise too, with a variance up to 100 times the mean square increment.
    chunk : int
        Largest number of points taken together.
    """
    increments = ProfileIncrements(heights, chunk)
    cache: dict[float, tuple[float, float, float]] = {}

    def best(hurst: float) -> tuple[float, float, float]:
        """Return deviance, amplitude and noise for one exponent."""
        hurst = float(hurst)
        if hurst not in cache:
            cache[hurst] = _best_noise(increments, hurst) if noise else (*increments.solve(hurst, 0.0), 0.0)
        return cache[hurst]

    hurst = minimum(lambda h: best(h)[0], _LOWEST, _HIGHEST)
    if hurst > _AT_LIMIT:
        smoother = minimum(lambda h: best(h)[0], 1.0 / _HIGHEST, _SMOOTHEST, 1e-3, points=5)
        if best(smoother)[0] < best(_HIGHEST)[0] - QUANTILE:
            return _smooth_fit(lambda h: best(h)[0], smoother)
    least, amplitude, level = best(hurst)
    low = crossing(lambda h: best(h)[0] - least - QUANTILE, hurst, _LOWEST, 0.0)
    high = crossing(lambda h: best(h)[0] - least - QUANTILE, hurst, _HIGHEST, 1.0)
    return ProfileFit(
        hurst, _standard_error(best, hurst), low, high, float(np.sqrt(amplitude)), float(amplitude * level)
    )


def _smooth_fit(deviance: Callable[[float], float], hurst: float) -> ProfileFit:
    """Return the fit of a profile smoother than a fractal one; its increments do not scale with H."""
    least = deviance(hurst)
    low = crossing(lambda h: deviance(h) - least - QUANTILE, hurst, 1.0 / _HIGHEST, 1.0 / _HIGHEST)
    high = crossing(lambda h: deviance(h) - least - QUANTILE, hurst, _SMOOTHEST, _SMOOTHEST)
    return ProfileFit(hurst, np.nan, low, high, np.nan, np.nan)


def _best_noise(increments: ProfileIncrements, hurst: float) -> tuple[float, float, float]:
    """Return deviance, amplitude and noise at the best noise for one exponent."""
    level = float(
        np.exp(minimum(lambda t: increments.solve(hurst, np.exp(t))[0], _LEAST_NOISE, _MOST_NOISE, 1e-3))
    )
    with_noise, without = increments.solve(hurst, level), increments.solve(hurst, 0.0)
    return (*with_noise, level) if with_noise[0] < without[0] else (*without, 0.0)


def _standard_error(best: Callable[[float], tuple[float, float, float]], hurst: float) -> float:
    """Return the standard error from the second difference of the deviance."""
    step = min(0.02, 0.5 * (hurst - 0.5 * _LOWEST), 0.5 * (1.0 - hurst))
    middle, left, right = (best(h)[0] for h in (hurst, hurst - step, hurst + step))
    curvature = (left - 2.0 * middle + right) / step**2
    return float(np.sqrt(2.0 / curvature)) if curvature > 0 else float("nan")


class ProfileIncrements:
    """Increments of one profile in chunks of equal length.

    Parameters
    ----------
    heights : ndarray, shape (n,)
        NaN where nothing was observed.
    chunk : int
        Largest number of points of a chunk; chunks are equally long.
    """

    def __init__(self, heights: Array, chunk: int = CHUNK) -> None:
        observed = np.flatnonzero(np.isfinite(heights))
        size = observed.size // -(-observed.size // chunk)
        starts = np.arange(0, observed.size - size + 1, size)
        self.positions = observed[starts[:, None] + np.arange(size)]
        self.jumps = np.diff(heights[self.positions], axis=1)
        self.gaps = np.diff(self.positions, axis=1)
        self.is_regular = bool((self.gaps == 1).all())
        self.freedom = self.jumps.size - len(self.jumps)

    def solve(self, hurst: float, noise: float) -> tuple[float, float]:
        """Return the deviance and the mean square of the whitened increments.

        The covariance is that of unit increments over one spacing, plus `noise` on the heights.
        """
        from fractalcontact.base.threads import in_bands
        from fractalcontact.dimensions._kernels import whiten

        columns = np.stack([self.jumps, self.gaps], axis=-1)
        positions = self.positions
        if self.is_regular:
            # one factorisation for all chunks: the jumps of each are a column of its own
            columns = np.concatenate([self.jumps.T, np.ones((self.jumps.shape[1], 1))], axis=1)[None]
            positions = positions[:1]
        covariances = _covariance(positions, hurst, noise)
        log_determinants = np.empty(len(positions))
        work = covariances.size * columns.shape[1]
        in_bands(whiten, len(positions), work, covariances, columns, log_determinants)
        if self.is_regular:
            jumps, gaps = columns[0, :, :-1].T, np.broadcast_to(columns[0, :, -1], self.jumps.shape)
            log_determinants = np.repeat(log_determinants, len(self.jumps))
        else:
            jumps, gaps = columns[..., 0], columns[..., 1]
        tilt = np.sum(gaps * gaps, axis=1)
        squares = np.sum(jumps * jumps, axis=1) - np.sum(jumps * gaps, axis=1) ** 2 / tilt
        amplitude = float(np.sum(squares)) / self.freedom
        deviance = float(np.sum(log_determinants + np.log(tilt)) + self.freedom * np.log(amplitude))
        return deviance, amplitude


def _covariance(positions: Array, hurst: float, noise: float) -> Array:
    """Return the covariance of the increments of each chunk: (chunks, size - 1, size - 1)."""
    distance = np.abs(positions[:, :, None] - positions[:, None, :]).astype(float)
    if hurst < 1.0:
        heights = -0.5 * distance ** (2.0 * hurst)
    else:
        # beyond H = 1 only contrasts without a tilt have a variance: a random tilt, eliminated later,
        # keeps the matrix positive
        tilt = _TILT * distance.max() ** (2.0 * hurst - 2.0)
        heights = 0.5 * (distance ** (2.0 * hurst) - tilt * distance**2) / (hurst - 1.0)
    if noise:
        heights += noise * np.eye(positions.shape[1])
    return np.ascontiguousarray(
        heights[:, 1:, 1:] - heights[:, 1:, :-1] - heights[:, :-1, 1:] + heights[:, :-1, :-1]
    )
