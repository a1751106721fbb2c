"""Exact likelihood of a profile: Gaussian increments with their full covariance.

The increments between successive observed points are Gaussian with a covariance that follows from the
variogram, whatever the gaps. A tilt of the profile is a mean proportional to the gaps and is eliminated
(restricted likelihood: Patterson and Thompson 1971, Biometrika 58). Long profiles are cut into chunks of
`CHUNK` points, which are taken as independent; each has its own tilt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _mode_blocks
from fractalcontact.dimensions._blur import (
    CLEAR,
    BlurredFit,
    blurred_estimate,
    chosen_blocks,
    fit_blurred,
    is_seen,
)
from fractalcontact.dimensions._exponent_by_scale import (
    Blocks,
    fit_power_law,
    frame_blocks,
    interval_of_run,
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
from fractalcontact.dimensions._rolloff import fit_rolloff, rolloff_estimate
from fractalcontact.dimensions._second_exponent import (
    ALIKE,
    DECISIVE,
    LEAST_EXPONENT,
    NO_ALIASES,
    Explanations,
    fit_knee,
    fit_two_exponents,
    knee_estimate,
    penalised_deviance,
    two_estimate,
)
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._whittle import QUANTILE, crossing, minimum

Array = np.ndarray[Any, np.dtype[Any]]

CHUNK = 256
SMALLEST = 8  # observed points
_LOWEST, _HIGHEST = 1e-3, 0.999
_AT_LIMIT = 0.998  # H beyond which the search is repeated among profiles smoother than fractal ones
_SMOOTHEST = 1.9
_TOLERANCE = 1e-4  # of the exponent
_TILT = 20.0  # variance of a random tilt that is eliminated, in units of the largest covariance of increments
_LEAST_NOISE, _MOST_NOISE = np.log(1e-5), np.log(100.0)  # logarithms of the noise over the squared increment
_LEAST_POINTS = 64  # of a profile whose blur is looked for
_LONGEST_MODES, _NEIGHBOURS = 16, 8  # longest waves of a profile, and neighbours of a single shorter one
_LEAST_CROSSOVER = 4.0  # spacings: two exponents must share an octave
_OR_ONE = (
    "a single exponent at all scales is not excluded: the exponent is averaged over both fits, and the "
    "interval holds both"
)
_OTHERS = "other explanations are nearly as likely: the interval holds their exponents"
_WIDEST = 0.25  # half-width of the exponent of the rougher of two profiles
_FLAT = -0.5  # exponent of white noise: longer waves are no weaker
_EVEN, _SURE = 13.0, 17.4  # decrease of the penalised deviance with half the weight, and with all of it
_SINGLE = 0.9  # share of the power beyond the longest that these may hold


def profile_likelihood(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Fit a profile with its exact likelihood, or by its modes where it is no fractional Brownian one.

    Where that is not certain, the exponent is the mean of both.
    """
    heights, other, held, gain = surface.heights[0], None, (np.nan, np.nan), np.inf
    if np.isfinite(heights).all() and heights.size >= _LEAST_POINTS and not surface.finest_scale:
        other, held, gain = _profile_modes(surface, scales, noise, spread)
    if other is not None and gain > _SURE:
        return other
    exact = _by_increments(surface, scales, noise, held)
    if other is None or not exact.hurst < 1.0:
        return exact if other is None else other
    share = 1.0 / (1.0 + float(np.exp(0.5 * (gain - _EVEN))))
    return other.averaged(exact, share, _OR_ONE)


def _by_increments(surface: Surface, scales: Scales, noise: bool, held: tuple[float, float]) -> Estimate:
    """Return the estimate of the exact likelihood; its interval also holds `held`, unless that is NaN."""
    heights, dx = surface.heights[0], surface.spacing[1]
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
    low, high = float(np.fmin(low, held[0])), float(np.fmax(high, held[1]))
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
) -> tuple[Estimate | None, tuple[float, float], float]:
    """Return the estimate of a profile that is no fractional Brownian one, by its modes; None if it is one.

    The second result is an interval that the modes do not exclude of a fractional Brownian profile, NaN where
    there is none; the third the decrease of the penalised deviance by the estimate, infinite if it was asked
    for.
    """
    heights, dx, none = surface.heights[0], surface.spacing[1], (np.nan, np.nan)
    frame = _mode_blocks.frame((heights.size,), (1.0,))
    modes = _mode_blocks.profile_modes(heights) ** 2
    if (share := _largest_share(modes)) > _SINGLE:
        reason = f"a single wave holds {100.0 * share:.0f} % of the power of the shorter waves: not a fractal"
        return undefined(reason), none, np.inf
    fit = fit_blurred(modes, frame, noise=noise, spread=spread, chosen=chosen_blocks(frame, surface, scales))
    blurred, is_blurred = None, fit is not None and is_seen(fit, surface.axes, spread)
    if fit is not None and (fit.is_good or is_blurred):
        amplitude = fit.amplitude * heights.size ** (-2.0 * fit.hurst)
        longest = heights.size * dx if scales is None else scales[1]
        blurred = blurred_estimate(fit, surface, scales, amplitude, longest)
    if scales is None and spread is None and not noise:
        return _likeliest(frame_blocks(frame.mean(modes), frame), surface, fit, blurred)
    if is_blurred:
        return blurred, none, np.inf
    if blurred is None or noise or blurred.hurst > 1.0:
        return None, none, 0.0
    return None, (max(blurred.ci_low, 0.0), min(blurred.ci_high, 1.0)), 0.0


def _likeliest(
    blocks: Blocks, surface: Surface, fit: BlurredFit | None, blurred: Estimate | None
) -> tuple[Estimate | None, tuple[float, float], float]:
    """Compare one exponent, blur and noise, and several exponents; return the same as `_profile_modes`.

    The interval holds those of all explanations that are nearly as likely as the likeliest: the modes of a
    profile are few.
    """
    everywhere = np.ones(blocks.count.size, dtype=bool)
    plain = fit_power_law(blocks, everywhere).deviance + 4.0
    ranked = _several(blocks, everywhere, surface)
    if fit is not None and blurred is not None:
        ranked.append((Explanations(fit, blocks, has_aliases=False).reference, blurred))
    ranked.sort(key=lambda pair: pair[0])
    least = min([plain, *(penalised for penalised, _ in ranked)])
    near = [estimate for penalised, estimate in ranked if penalised <= least + ALIKE]
    low = min((each.ci_low for each in near), default=np.nan)
    high = max((each.ci_high for each in near), default=np.nan)
    if plain - least < CLEAR[1]:
        return None, (max(low, 0.0), min(high, 1.0)), 0.0
    return near[0].holding(low, high, _OTHERS if len(near) > 1 else ""), (np.nan, np.nan), plain - least


def _several(blocks: Blocks, everywhere: Array, surface: Surface) -> list[tuple[float, Estimate]]:
    """Return the estimates of roll-offs and second exponents, with their penalised deviances."""
    result = []
    assert blocks.frame is not None
    for part in (blocks, frame_blocks(blocks.power, blocks.frame.unaliased)):
        found, record = [], octaves(part)
        for is_sharp in (False, True):
            rolloff = fit_rolloff(part, everywhere, is_sharp=is_sharp)
            if rolloff is not None and rolloff.law.hurst > LEAST_EXPONENT and rolloff.law.low < 1.0:
                found.append((rolloff.penalised, rolloff_estimate(rolloff, part, surface)))
            # without aliases a sum is like a corner
            has_two = is_sharp or part is blocks
            two = fit_two_exponents(part, everywhere, is_sharp=is_sharp) if has_two else None
            if two is not None and two.rough.hurst > LEAST_EXPONENT and two.crossover > _LEAST_CROSSOVER:
                estimate = two_estimate(two, record[0], part, surface)
                low, high = two.held(_WIDEST)
                found.append((two.penalised, replace(estimate, ci_low=low, ci_high=high)))
        knee = fit_knee(record, everywhere)
        if knee is not None and LOWEST < knee.run.fit.hurst < 1.0 and knee.longer.high > _FLAT:
            found.append((knee.penalised, knee_estimate(knee, record, surface)))
        run = longest_run(record)
        if run.last - run.first > 1 and LOWEST < run.fit.hurst < 1.0:
            low, high = interval_of_run(run, record)
            estimate = replace(run_estimate(run, surface), ci_low=low, ci_high=high)
            found.append((penalised_deviance(record, run, everywhere), estimate))
        if part is not blocks:
            found = [(cost, replace(each, note=joined(each.note, NO_ALIASES))) for cost, each in found]
        result += [(cost + DECISIVE, each) for cost, each in found]
    return result


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

    hurst = minimum(lambda h: best(h)[0], _LOWEST, _HIGHEST, _TOLERANCE, points=9 if noise else 5)
    if hurst > _AT_LIMIT:
        smoother = minimum(lambda h: best(h)[0], 1.0 / _HIGHEST, _SMOOTHEST, 1e-3, points=5)
        if best(smoother)[0] < best(_HIGHEST)[0] - QUANTILE:
            return _smooth_fit(lambda h: best(h)[0], smoother)
    least, amplitude, level = best(hurst)

    def beyond(h: float) -> float:
        """Return the root of the rise of the deviance, which is nearly straight, less that of its limit."""
        return float(np.sqrt(max(best(h)[0] - least, 0.0)) - np.sqrt(QUANTILE))

    low, high = crossing(beyond, hurst, _LOWEST, 0.0), crossing(beyond, hurst, _HIGHEST, 1.0)
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
