"""Exponent of the long waves of a surface whose filter has an unknown form.

Interpolation, means of neighbours, medians or a ball that traces the surface are no Gaussian point spread
function. At long waves the logarithm of every smooth, even transfer function is a polynomial of the
wavenumber: its term of the second degree is fitted, and those of the fourth, which are known to be small.
The window ends at waves of four spacings, or where the filter takes about half of the power, or where the
polynomial does not fit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.units import quantity_text
from fractalcontact.dimensions._blur_fit import scatter_of, score_statistic
from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST, Frame, node_weights
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._scored_fit import Scored, best_scored
from fractalcontact.dimensions._transfer_functions import edge_power

Array = np.ndarray[Any, np.dtype[Any]]

# wavelengths at which windows end: in spacings, and in shares of the extent
_SHORTEST, _LONGEST = 4.0, 1.0 / 7.0
_STEP = 1.15  # ratio of successive ends
_FOURTH = 0.2  # standard deviation of the terms of the fourth degree at the end of the window
_MOST_LOST = 0.8  # logarithm of the power that the filter takes at the end of the window
_EDGES = 0.03  # the same from which the jump of the slope at the edges matters
_POOR, _SIXTH = 3.5, 9.0  # z of the scatter and chi square of the sixth degree beyond which none fits
_LONGER = 1.5  # ratio to a shorter window, whose exponent the interval holds with its standard error
_LEAST = 60  # modes of a window
_PRIOR = np.array([0.0, 0.0, _FOURTH**-2, _FOURTH**-2])
_START = np.array([0.5, -0.3, 0.0, 0.0])  # exponent, and terms of the second and fourth degree
_STEPS = np.array([0.2, 0.5, 0.3, 0.3])
_BOUNDS = np.array([LOWEST, -3.0, -1.0, -1.0]), np.array([HIGHEST, 3.0, 1.0, 1.0])
_FAR = 4  # lag over which second differences tell nothing of a filter of neighbours
# what skewness and kurtosis change from it to the next neighbours by a filter, at 128 by 128 points or more,
# and the share by which they change with lag in surfaces that are not Gaussian
_SKEWED, _TAILED, _NOT_GAUSSIAN = 0.3, 0.4, 0.5
_LARGE = 512  # points along an axis of which second differences are taken
_WINDOW = "the waves that a filter of unknown form leaves nearly alone"
_REASON = (
    "a filter that is no Gaussian blur has changed nearly all waves of the surface: estimate the heights as "
    "they were before it"
)


def is_filtered_locally(heights: Array) -> bool:
    """Return whether neighbours differ by a distribution of another form than distant heights.

    A ball rounds summits and leaves valleys sharp, a median removes single heights, and interpolated maps are
    smooth where new points lie between old ones: second differences are then skewed or have long tails at
    the next neighbours only. Linear filters of a Gaussian surface leave it Gaussian.
    """
    middle = heights[tuple(slice(max(0, (n - _LARGE) // 2), (n + _LARGE) // 2) for n in heights.shape)]
    near, far = (_shape_of_bends(middle, lag) for lag in (1, _FAR))
    chance = max(1.0, 128.0 / float(np.sqrt(middle.size)))
    skewed, tailed = (
        limit * chance + (1.0 + _NOT_GAUSSIAN) * abs(value)
        for limit, value in zip((_SKEWED, _TAILED), far, strict=True)
    )
    return bool(abs(near[0]) > skewed or near[1] > tailed)


def _shape_of_bends(heights: Array, lag: int) -> tuple[float, float]:
    """Return skewness and excess kurtosis of the second differences along both axes."""
    bends = np.concatenate(
        [(h[2 * lag :] - 2.0 * h[lag:-lag] + h[: -2 * lag]).ravel() for h in (heights, heights.T)]
    )
    bends = bends[np.isfinite(bends)]
    bends = bends - bends.mean() if bends.size else np.zeros(1)
    square = bends * bends
    variance = float(square.mean())
    if not variance > 0.0:
        return 0.0, 0.0
    skewness = float(np.mean(square * bends)) / variance**1.5
    return skewness, float(np.mean(square * square)) / variance**2 - 3.0


def unfiltered_estimate(means: Array, frame: Frame, allowed: Array, spacing: float) -> Estimate:
    """Return the exponent of the long waves; no interval where a filter has changed nearly all of them.

    `means` are the mean squares of the blocks of `frame`, `allowed` the blocks that may be used, and
    `spacing` that of x in m.
    """
    end, start = 2.0 * np.pi / _SHORTEST, _START
    extent = min(n * d for n, d in zip(frame.shape, frame.spacing, strict=True))
    while end > 2.0 * np.pi / (_LONGEST * extent):
        waves = _Waves(frame, means, allowed & (frame.squares <= end**2), end)
        if waves.count.sum() < _LEAST:
            break
        fit = waves.fit(start)
        if waves.lost(fit) < 2.0 * _MOST_LOST:
            waves.edges = waves.edges_of(fit)
            fit = waves.fit(fit.values)
            if waves.is_good(fit):
                return _estimate(waves, fit, means, spacing)
        start, end = np.append(np.clip(fit.values[0], 0.1, 0.9), _START[1:]), end / _STEP
    return Estimate(np.nan, reason=_REASON, note=_REASON)


class _Waves:
    """Waves up to the wavenumber `end`, and the polynomial in their wavenumber over the end."""

    def __init__(
        self, frame: Frame, means: Array, inside: Array, end: float, edges: Array | float = 0.0
    ) -> None:
        self.frame, self.inside, self.end, self.edges = frame, inside, end, edges
        self.power, self.count, self.logs = means[inside], frame.count[inside], frame.logs[:, inside]
        self.squares = frame.squares[inside] / end**2
        self.across = 4.0 * np.prod([w[inside] / end for w in frame.waves], axis=0) ** 2
        self.terms = np.stack([self.squares, self.squares**2, self.across])

    def model(self, values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the power but for its level, and the derivatives."""
        weights, slopes = node_weights(float(values[0]))
        logs = weights @ self.logs + self.edges + values[1:] @ self.terms
        return logs, np.concatenate([(slopes @ self.logs)[None], self.terms])

    def fit(self, start: Array) -> Scored:
        """Fit the exponent and the polynomial."""
        return best_scored(self.model, self.power, self.count, [start], _BOUNDS, _STEPS, precision=_PRIOR)

    @staticmethod
    def lost(fit: Scored) -> float:
        """Return the logarithm of the power that the filter takes, or adds, at the end of the window."""
        return abs(float(fit.values[1] + fit.values[2]))

    def is_good(self, fit: Scored) -> bool:
        """Return whether the filter takes little power, and the polynomial agrees with the modes."""
        if not (self.lost(fit) < _MOST_LOST and LOWEST < fit.values[0] < HIGHEST and fit.is_regular):
            return False
        logs, columns = self.model(fit.values)
        ratio = self.power * np.exp(-logs)
        residual = ratio / np.average(ratio, weights=self.count) - 1.0
        fitted = np.concatenate([np.ones((1, residual.size)), columns])
        sixth = np.stack([self.squares**3, self.squares * self.across])
        prior = np.diag(np.append(0.0, _PRIOR))
        statistic, _ = score_statistic(fitted, sixth, 0.5 * self.count, residual, prior)
        return scatter_of(residual, self.count) < _POOR and statistic < _SIXTH

    def edges_of(self, fit: Scored) -> Array | float:
        """Return the logarithm of the factor by which the jump of the slope at the edges adds power."""
        second = -float(fit.values[1])
        if second < _EDGES:
            return 0.0
        hurst = float(np.clip(fit.values[0], 0.05, 1.0))
        return np.asarray(np.log1p(edge_power(self.frame, hurst, second / self.end**2)[self.inside]))

    def longer(self, means: Array) -> _Waves:
        """Return those of a shorter window."""
        shorter, inside = self.squares <= _LONGER**-2, self.inside.copy()
        inside[inside] = shorter
        edges = self.edges[shorter] if isinstance(self.edges, np.ndarray) else self.edges
        return _Waves(self.frame, means, inside, self.end / _LONGER, edges)


def _estimate(waves: _Waves, fit: Scored, means: Array, spacing: float) -> Estimate:
    """Return the estimate of a window; its interval holds the exponent of longer waves."""
    hurst, half_width = float(fit.values[0]), float(fit.half_widths[0])
    other = waves.longer(means).fit(fit.values)
    error = float(other.half_widths[0]) / NORMAL if other.is_regular else 1.0
    wavelengths = 2.0 * np.pi / (waves.end * np.sqrt(waves.squares)) * spacing
    shortest = quantity_text(float(wavelengths.min()), "m")
    return Estimate(
        hurst,
        half_width / NORMAL,
        min(hurst - half_width, float(other.values[0]) - error),
        max(hurst + half_width, float(other.values[0]) + error),
        scale_min=float(wavelengths.min()),
        scale_max=float(wavelengths.max()),
        window=_WINDOW,
        note=f"a filter that is no Gaussian blur has changed the shorter waves: {hurst:.2f} is the exponent "
        f"of those from {shortest} on, corrected for what it takes of them",
    )
