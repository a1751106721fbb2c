"""Whether all blocks of a surface are equally rough, and how much wider the interval is if they are not.

The interval of a Gaussian family counts every point of the surface. Where a few blocks carry most of the
roughness (worn tops, patches, a step, outliers), the effective number of points is smaller; where the
exponent itself differs between blocks, no single one is correct. Second differences of different blocks are
nearly independent, so the scatter between blocks is tested by chi square.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._increment_covariance import complete_covariance
from fractalcontact.dimensions._increment_moments import LAGS, Moments

Array = np.ndarray[Any, np.dtype[Any]]

_FALSE_ALARM = 1e-4  # probability of a false alarm on a surface of the family
_SHARE = 0.5  # of the increments of a full block that a block must have


@dataclass(frozen=True)
class Heterogeneity:
    """Effect of unequal blocks on an interval.

    Attributes
    ----------
    widening : float
        Factor on the standard error: the root of the number of blocks over the number that would carry as
        much if they were equal. 1 where chance makes them as different.
    low, high : float
        Quartiles of the exponents of the blocks where those differ more than by chance; NaN otherwise.
    note : str
    """

    widening: float = 1.0
    low: float = np.nan
    high: float = np.nan
    note: str = ""

    def widened(self, hurst: float, low: float, high: float) -> tuple[float, float]:
        """Return the interval, widened about the estimate, that holds the exponents of the blocks."""
        low, high = hurst - self.widening * (hurst - low), hurst + self.widening * (high - hurst)
        return float(np.fmin(low, self.low)), float(np.fmax(high, self.high))


def heterogeneity(moments: Moments, spacing: tuple[float, ...], hurst: float) -> Heterogeneity:
    """Compare the blocks of a surface by their second differences over one and two strides.

    Parameters
    ----------
    moments : Moments
        A surface without blocks counts as homogeneous.
    spacing : (dy/dx, 1), or (1,) for a profile
    hurst : float
        Estimate for the whole surface.
    """
    from scipy.special import chdtri

    axes = len(spacing)
    if moments.blocks is None or not 0.0 < hurst < 1.0:
        return Heterogeneity()
    columns = np.array([3, 4, 9, 10][: 2 * axes])
    squares, counts = (values[:, columns] for values in moments.blocks)
    largest = counts.max(axis=0)
    shares = np.min(counts / np.maximum(largest, 1), axis=1)
    covariance = _block_covariance(moments, spacing, hurst, len(shares))
    squares, shares = squares[shares >= _SHARE], shares[shares >= _SHARE]
    if len(squares) < 2 or not largest.all() or not squares[:, ::2].any():
        return Heterogeneity()
    level = np.tile([1.0, 0.0], axes) / axes
    slope = np.tile([-1.0, 1.0], axes) / (axes * 2.0 * np.log(LAGS[1]))
    notes, widening, low, high = [], 1.0, np.nan, np.nan
    with np.errstate(divide="ignore"):
        logs = np.log(squares)
    is_finite = np.isfinite(logs).all(axis=1)
    levels = logs[:, ::2].mean(axis=1)
    limit = float(chdtri(len(logs) - 1, _FALSE_ALARM))
    if not is_finite.all() or _chi_square(levels, shares / (level @ covariance @ level)) > limit:
        weight = shares * np.exp(levels - levels.max())
        widening = max(1.0, float(np.sqrt(weight.size * np.sum(weight**2)) / np.sum(weight)))
        notes.append(
            f"parts of the surface are not equally rough: the interval is {widening:.2f} times as wide as "
            "that of a Gaussian surface"
        )
    exponents = logs[is_finite] @ slope
    inverse = shares[is_finite] / (slope @ covariance @ slope)
    limit = float(chdtri(max(exponents.size - 1, 1), _FALSE_ALARM))
    if exponents.size > 1 and _chi_square(exponents, inverse) > limit:
        low, high = (float(q) for q in np.quantile(exponents, (0.25, 0.75)))
        notes.append(
            "the exponent differs from part to part of the surface: the interval holds the middle half of "
            f"them, {low:.2f} to {high:.2f}"
        )
    return Heterogeneity(widening, low, high, "; ".join(notes))


def _block_covariance(moments: Moments, spacing: tuple[float, ...], hurst: float, blocks: int) -> Array:
    """Return the covariance of the logarithms for one of `blocks` equal blocks of a complete surface."""
    covariance = complete_covariance(hurst, moments.shape, spacing, 2, moments.stride)
    # here the lags along x come first
    kinds = [len(LAGS) * axis + lag for axis in reversed(range(len(spacing))) for lag in (0, 1)]
    return np.asarray(blocks * covariance[np.ix_(kinds, kinds)])


def _chi_square(values: Array, weights: Array) -> float:
    mean = float(np.sum(weights * values) / np.sum(weights))
    return float(np.sum(weights * (values - mean) ** 2))
