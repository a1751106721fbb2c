"""Exact likelihood of a profile: Gaussian increments with their full covariance.

The increments between successive observed points are Gaussian with a covariance that follows from the
variogram, whatever the gaps. A tilt of the profile is a mean proportional to the gaps and is eliminated
(restricted likelihood: Patterson and Thompson 1971, Biometrika 58). Long profiles are cut into chunks of
`CHUNK` points, which are taken as independent; each has its own tilt. Blur and noise change the variogram.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments
from fractalcontact.dimensions._increments import closed_form
from fractalcontact.dimensions._quantisation import rounding_note
from fractalcontact.dimensions._records import ASKED, Estimate, joined, undefined
from fractalcontact.dimensions._surface_input import Scales, Surface
from fractalcontact.dimensions._transfer_functions import BEFORE, FILTER, NONE, in_model
from fractalcontact.dimensions._whittle import QUANTILE, crossing, minimum

Array = np.ndarray[Any, np.dtype[Any]]

CHUNK = 256
SMALLEST = 8  # observed points
_LOWEST, _HIGHEST = 1e-3, 0.999
_SHORT_CHUNK, _LEAST_POINTS, _MOST_POINTS = 64, 64, 2048  # points of a profile with gaps, in blur and noise
_NO_NOISE = 1e-6  # over the squared amplitude: the covariance of blurred increments stays positive
_SEEN, _ALIKE = 9.0, 4.0  # decreases of the penalised deviance: of what is there, and of what may be
_RISE = 4.5  # of the deviance at the ends of an interval
# exponent, logarithms of the noise and of the squared spread: first guesses, limits and first steps
_FIRST = 0.5, np.log(0.05), np.log(0.3)
_LEAST_VALUES = np.array([_LOWEST, np.log(1e-6), np.log(4e-3)])
_MOST_VALUES = np.array([_HIGHEST, np.log(1e2), np.log(60.0)])
_SIMPLEX = np.array([0.1, 1.0, 1.0])
_NO_BLUR = (
    "a known blur is in the model of a profile with gaps for 64 points or more and without `scales`: leave "
    "out `psf`, or `scales`"
)
_AT_LIMIT = 0.998  # H beyond which the search is repeated among profiles smoother than fractal ones
_SMOOTHEST = 1.9
_TOLERANCE = 1e-4  # of the exponent
_NEAR = 6.0  # deviations of the blur of an increment from which its variance is a series
_LARGE, _FEW = 7.0, 0.01  # robust deviations of an increment that is taken out, and share of such ones
_NORMAL_MEDIAN = 1.4826  # deviation over the median of absolute values
_TILT = 20.0  # variance of a random tilt that is eliminated, in units of the largest covariance of increments
_LEAST_NOISE, _MOST_NOISE = np.log(1e-5), np.log(100.0)  # logarithms of the noise over the squared increment


def gapped_profile(surface: Surface, scales: Scales, noise: bool, spread: float | None) -> Estimate:
    """Return the estimate of a profile with gaps; by default its interval holds blur and noise.

    `spread` in spacings is that of a known blur.
    """
    surface, jump_note = without_jumps(surface) if scales is None else (surface, "")
    heights = surface.heights[0]
    heights = heights[: np.searchsorted(np.cumsum(np.isfinite(heights)), _MOST_POINTS)]
    is_fitted = scales is None and np.isfinite(heights).sum() >= _LEAST_POINTS
    increments = ProfileIncrements(heights, _SHORT_CHUNK) if is_fitted else None
    if spread and increments is not None:
        estimate = _with_known_blur(surface, increments, noise, spread)
    else:
        estimate = by_increments(surface, scales, noise, (np.nan, np.nan))
        if spread:
            estimate = estimate.without_interval(_NO_BLUR)
        elif increments is not None and not noise and estimate.hurst > 0.0:
            estimate = _with_blur(surface, increments, estimate, has_blur=spread is None)
    return replace(estimate, note=joined(jump_note, estimate.note))


def _with_known_blur(surface: Surface, increments: ProfileIncrements, noise: bool, spread: float) -> Estimate:
    """Return the estimate beside a blur of known spread, before sampling or of the sampled heights."""
    levels = (True,) if noise else (False, True)
    fits = [
        _fit_blur(increments, has_noise, blur, square=spread**2)
        for blur in (BEFORE, FILTER)
        for has_noise in levels
    ]
    return _likeliest(surface, fits)


def _with_blur(
    surface: Surface, increments: ProfileIncrements, estimate: Estimate, *, has_blur: bool
) -> Estimate:
    """Return the estimate with blur or noise where they are seen; otherwise its interval holds them."""
    none, noisy = (_fit_blur(increments, has_noise, NONE) for has_noise in (False, True))
    others = [noisy]
    if has_blur:
        others += [_fit_blur(increments, has_noise, BEFORE) for has_noise in (False, True)]
    best = min(others, key=lambda fit: fit.penalised)
    if none.penalised - best.penalised < _SEEN:
        for fit in others[:2]:  # noise would raise the exponent, and a blur lower it
            rise = QUANTILE - max(fit.deviance - none.deviance, 0.0)
            if rise > 0.0 and np.isfinite(estimate.ci_low):
                end = fit.end(rise, 1.0 if fit is noisy else -1.0)
                estimate = estimate.holding(min(end, estimate.ci_high), max(end, estimate.ci_low))
        return estimate
    if best.blur != NONE:
        others += [_fit_blur(increments, has_noise, FILTER) for has_noise in (False, True)]
    return _likeliest(surface, others)


def _likeliest(surface: Surface, fits: list[_BlurFit]) -> Estimate:
    """Return the estimate of the likeliest fit; its interval holds those that are nearly as likely."""
    best = min(fits, key=lambda fit: fit.penalised)
    near = [fit for fit in fits if fit.penalised < best.penalised + _ALIKE]
    ends = [(fit.end(_RISE, -1.0), fit.end(_RISE, 1.0)) for fit in near]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    dx, spread = surface.spacing[1], float(np.sqrt(best.square))
    noise_height = np.sqrt(best.amplitude * best.noise) * surface.unit
    return Estimate(
        best.hurst,
        0.25 * (high - low),
        low,
        high,
        scale_min=dx,
        scale_max=(_SHORT_CHUNK - 1) * dx,
        rms_increment=float(np.sqrt(best.amplitude)) * surface.unit,
        noise_height=float(noise_height) if best.has_noise else np.nan,
        blur_spread=spread * dx if best.blur != NONE else np.nan,
        window="exact likelihood of all increments, with blur and noise",
        note=in_model(best.blur, spread, best.has_noise),
    )


def without_jumps(surface: Surface) -> tuple[Surface, str]:
    """Return a profile without few increments that are far too large, as of steps and spikes, and a note."""
    heights = surface.heights[0]
    observed = np.flatnonzero(np.isfinite(heights))
    jumps = np.diff(heights[observed])
    single = np.diff(observed) == 1
    deviation = _NORMAL_MEDIAN * float(np.median(np.abs(jumps[single]))) if single.any() else 0.0
    large = single & (np.abs(jumps) > _LARGE * deviation)
    if not (deviation > 0.0 and large.any() and large.sum() <= max(2.0, _FEW * jumps.size)):
        return surface, ""
    heights = heights.copy()
    heights[observed[1:]] -= np.cumsum(np.where(large, jumps, 0.0))
    note = f"{large.sum()} increments beyond {_LARGE:g} robust deviations were taken out: steps or spikes"
    return surface.with_heights(heights[None]), note


@dataclass(frozen=True)
class _BlurFit:
    """A profile with blur or noise: H, the logarithms of noise and squared spread, and their likelihood.

    `known` is the squared spread where it was given.
    """

    increments: ProfileIncrements
    has_noise: bool
    blur: str
    known: float | None
    values: tuple[float, ...]
    deviance: float
    amplitude: float

    @property
    def penalised(self) -> float:
        """Deviance with Akaike's penalty."""
        return self.deviance + 2.0 * (self.has_noise + (self.blur != NONE and self.known is None))

    @property
    def hurst(self) -> float:
        """Exponent."""
        return self.values[0]

    @property
    def noise(self) -> float:
        """Variance of the noise over the squared amplitude."""
        return float(np.exp(self.values[1])) if self.has_noise else _NO_NOISE * (self.blur != NONE)

    @property
    def square(self) -> float:
        """Squared spread of the blur."""
        return float(np.exp(self.values[2])) if self.blur != NONE else 0.0

    def end(self, rise: float, sign: float) -> float:
        """Return where the deviance at the best other parameters has risen by `rise`, below or above."""
        inside, below, step = self, 0.0, 0.03 * sign
        limit = _LOWEST if sign < 0.0 else _HIGHEST
        while (inside.hurst - limit) * sign < 0.0:
            hurst = float(np.clip(inside.hurst + step, _LOWEST, _HIGHEST))
            outside = _fit_blur(
                self.increments, self.has_noise, self.blur, square=self.known, at=(hurst, *inside.values[1:])
            )
            above = outside.deviance - self.deviance
            if above > rise:
                share = (np.sqrt(rise) - np.sqrt(below)) / (np.sqrt(above) - np.sqrt(below))
                return float(inside.hurst + share * (hurst - inside.hurst))
            inside, below, step = outside, max(above, 0.0), 1.4 * step
        return 0.0 if sign < 0.0 else 1.0


def _fit_blur(
    increments: ProfileIncrements,
    has_noise: bool,
    blur: str,
    *,
    square: float | None = None,
    at: tuple[float, ...] | None = None,
) -> _BlurFit:
    """Fit blur and noise; with a known squared spread, or from `at`, whose exponent is then kept."""
    from scipy.optimize import minimize

    is_blurred = blur != NONE
    free = np.array([at is None, has_noise, is_blurred and square is None])
    values = np.array(_FIRST if at is None else at)
    if square is not None:
        values[2] = np.log(square)

    def solved(values: Array) -> tuple[float, float]:
        """Return deviance and amplitude."""
        noise = float(np.exp(values[1])) if has_noise else _NO_NOISE * is_blurred
        deviance, amplitude = increments.solve(
            float(values[0]), noise, float(np.exp(values[2])) * is_blurred, of_samples=blur == FILTER
        )
        return (deviance, amplitude) if np.isfinite(deviance) else (1e300, np.nan)

    def deviance(chosen: Array) -> float:
        """Return the deviance for some values of the free parameters."""
        trial = values.copy()
        trial[free] = chosen
        return solved(trial)[0]

    if free.any():
        low, high, start = _LEAST_VALUES[free], _MOST_VALUES[free], values[free]
        found = minimize(
            deviance,
            start,
            method="Nelder-Mead",
            bounds=list(zip(low, high, strict=True)),
            options={
                "initial_simplex": np.clip(
                    start + np.vstack([0.0 * start, np.diag(_SIMPLEX[free])]), low, high
                ),
                "xatol": 3e-3,
                "fatol": 0.02,
                "maxfev": 150,
            },
        )
        values[free] = found.x
    return _BlurFit(increments, has_noise, blur, square, tuple(map(float, values)), *solved(values))


def by_increments(surface: Surface, scales: Scales, noise: bool, held: tuple[float, float]) -> Estimate:
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

    def solve(
        self, hurst: float, noise: float, square: float = 0.0, *, of_samples: bool = False
    ) -> tuple[float, float]:
        """Return the deviance and the mean square of the whitened increments.

        The covariance is that of unit increments over one spacing, blurred with the squared spread `square`,
        before sampling or, `of_samples`, by a filter of the heights, plus `noise` on the heights.
        """
        from fractalcontact.base.threads import in_bands
        from fractalcontact.dimensions._kernels import innovations, whiten

        columns = np.stack([self.jumps, self.gaps], axis=-1)
        log_determinants = np.empty(len(self.positions))
        if self.is_regular:
            # one factorisation for all chunks: the jumps of each are a column of its own
            columns = np.concatenate([self.jumps.T, np.ones((self.jumps.shape[1], 1))], axis=1)
            covariances = _covariance(self.positions[:1], hurst, noise, square, of_samples=of_samples)
            if hurst < 1.0:
                innovations(covariances[0, 0].copy(), columns, log_determinants)
            else:
                whiten(0, 1, covariances, columns[None], log_determinants)
            log_determinants[:] = log_determinants[0]
            jumps, gaps = columns[:, :-1].T, np.broadcast_to(columns[:, -1], self.jumps.shape)
        else:
            covariances = _covariance(self.positions, hurst, noise, square, of_samples=of_samples)
            work = covariances.size * columns.shape[1]
            in_bands(whiten, len(self.positions), work, covariances, columns, log_determinants)
            jumps, gaps = columns[..., 0], columns[..., 1]
        tilt = np.sum(gaps * gaps, axis=1)
        squares = np.sum(jumps * jumps, axis=1) - np.sum(jumps * gaps, axis=1) ** 2 / tilt
        amplitude = float(np.sum(squares)) / self.freedom
        deviance = float(np.sum(log_determinants + np.log(tilt)) + self.freedom * np.log(amplitude))
        return deviance, amplitude


def _covariance(
    positions: Array, hurst: float, noise: float, square: float = 0.0, *, of_samples: bool = False
) -> Array:
    """Return the covariance of the increments of each chunk: (chunks, size - 1, size - 1)."""
    distance = np.abs(positions[:, :, None] - positions[:, None, :])
    lags = np.arange(distance.max() + 1.0)
    if square > 0.0:
        variogram = _filtered_variogram if of_samples else _blurred_variogram
        heights = -0.5 * variogram(lags, hurst, square)[distance]
    elif hurst < 1.0:
        heights = (-0.5 * lags ** (2.0 * hurst))[distance]
    else:
        # beyond H = 1 only contrasts without a tilt have a variance: a random tilt, eliminated later,
        # keeps the matrix positive
        tilt = _TILT * lags[-1] ** (2.0 * hurst - 2.0)
        heights = (0.5 * (lags ** (2.0 * hurst) - tilt * lags**2) / (hurst - 1.0))[distance]
    if noise:
        heights += noise * np.eye(positions.shape[1])
    return np.ascontiguousarray(
        heights[:, 1:, 1:] - heights[:, 1:, :-1] - heights[:, :-1, 1:] + heights[:, :-1, :-1]
    )


def _blurred_variogram(lags: Array, hurst: float, square: float) -> Array:
    """Return twice the variogram of blurred heights: the mean of |lag + u|^2H, less that of |u|^2H.

    u is normal, with twice the squared spread as variance; far away the series in 1 / lag^2.
    """
    from scipy.special import gamma, hyp1f1

    p, variance = 2.0 * hurst, 2.0 * square
    scale = (2.0 * variance) ** hurst * gamma(hurst + 0.5) / np.sqrt(np.pi)
    near = lags < _NEAR * np.sqrt(variance)
    ratio = variance / np.where(near, 1.0, lags) ** 2
    third = 1.0 + (p - 4.0) * (p - 5.0) * ratio / 6.0
    series = 1.0 + p * (p - 1.0) * ratio * (0.5 + (p - 2.0) * (p - 3.0) * ratio * third / 8.0)
    exact = scale * hyp1f1(-hurst, 0.5, -(np.where(near, lags, 0.0) ** 2) / (2.0 * variance))
    return np.asarray(np.where(near, exact, lags**p * series) - scale)


def _filtered_variogram(lags: Array, hurst: float, square: float) -> Array:
    """Do what `_blurred_variogram` does for a filter of sampled heights, the Gaussian at whole points."""
    reach = int(5.0 * np.sqrt(square)) + 2
    weights = np.exp(-(np.arange(-reach, reach + 1.0) ** 2) / (2.0 * square))
    weights = np.convolve(weights, weights) / weights.sum() ** 2
    powers = np.abs(np.arange(-2.0 * reach, lags.size + 2.0 * reach)) ** (2.0 * hurst)
    smoothed = np.convolve(powers, weights, "valid")
    return np.asarray(smoothed - smoothed[0])
