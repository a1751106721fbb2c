"""Whether all blocks of a surface are equally rough, and how much wider the interval is if they are not.

The interval of a Gaussian family counts every point of the surface. Where a few blocks carry most of the
roughness (worn tops, patches, a step, outliers), the effective number of points is smaller; where the
exponent itself differs between blocks, no single one is correct. Second differences of different blocks are
nearly independent, so the scatter between blocks is tested by chi square.

A step or a scratch is rough along a narrow line only. It adds its power to all waves across it, so that no
exponent of the whole surface is that of the ground. The small blocks of cells that it crosses stand above the
others; the increments of the rest are those of the ground.
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
_EDGE = 8  # of a block, in points
_LEAST_BLOCKS = 8  # along each axis
_FAR, _NEAR = 4.5, 2.0  # deviations above the rest from which a block, and one beside it, is left out
_LINE, _ON_LINE = 5, 2.2  # blocks of a short line, and deviations above the rest of their mean
_LEFT = 0.35  # of the blocks that must be left
_THICK = 0.4  # share of the blocks left out whose neighbours are all left out: more is a patch, no line
# deviations of the mean square across a line from which on it is a seam; 5.3 was the most of 750 exact
# surfaces, H 0.1 to 0.9. More than this share of the lines is no seam
_SEAM, _MOST_SEAMS = 6.0, 0.05
_QUANTILES, _NORMAL_QUANTILES = (0.1, 0.25), (-1.2815515655446004, -0.6744897501960817)


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
    levels_differ : bool
        Whether the blocks are not equally rough.
    """

    widening: float = 1.0
    low: float = np.nan
    high: float = np.nan
    note: str = ""
    levels_differ: bool = False

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
    levels_differ = not is_finite.all() or _chi_square(levels, shares / (level @ covariance @ level)) > limit
    if levels_differ:
        # without variation along one axis, as beside a step, no block has a level: the axes are summed then
        has_levels = bool(np.isfinite(levels).any())
        squared = np.exp(levels - levels.max()) if has_levels else squares[:, ::2].sum(axis=1)
        weight = shares * squared
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
            f"their exponents, {low:.2f} to {high:.2f}"
        )
    return Heterogeneity(widening, low, high, "; ".join(notes), levels_differ)


def _block_covariance(moments: Moments, spacing: tuple[float, ...], hurst: float, blocks: int) -> Array:
    """Return the covariance of the logarithms for one of `blocks` equal blocks of a complete surface."""
    covariance = complete_covariance(hurst, moments.shape, spacing, 2, moments.stride)
    # here the lags along x come first
    kinds = [len(LAGS) * axis + lag for axis in reversed(range(len(spacing))) for lag in (0, 1)]
    return np.asarray(blocks * covariance[np.ix_(kinds, kinds)])


def _chi_square(values: Array, weights: Array) -> float:
    mean = float(np.sum(weights * values) / np.sum(weights))
    return float(np.sum(weights * (values - mean) ** 2))


def step_cells(heights: Array) -> Array | None:
    """Return the cells that steps or scratches cross, (ny, nx) of bool; None if there are none.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        Complete heights.
    """
    down, across = (n // _EDGE for n in heights.shape)
    if min(down, across) < _LEAST_BLOCKS:
        return None
    seams = seam_cells(heights)
    squares = np.zeros(heights.shape)
    for axis in (0, 1):
        bend = np.diff(heights, 2, axis=axis)
        inner = [slice(None), slice(None)]
        inner[axis] = slice(1, -1)
        squares[tuple(inner)] += bend * bend
    parts = [
        plane[: down * _EDGE, : across * _EDGE].reshape(down, _EDGE, across, _EDGE).sum(axis=(1, 3))
        for plane in (np.where(seams, 0.0, squares), ~seams)
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(parts[0] / parts[1])
    logs = np.where(parts[1] > 0, logs, np.median(logs[parts[1] > 0]))
    logs = np.where(np.isfinite(logs), logs, logs[np.isfinite(logs)].min(initial=0.0))
    # the lower blocks tell what the ground is like, however many are crossed
    low, quarter = np.quantile(logs, _QUANTILES)
    deviation = (quarter - low) / (_NORMAL_QUANTILES[1] - _NORMAL_QUANTILES[0])
    middle = quarter - _NORMAL_QUANTILES[1] * deviation
    if not deviation > 0.0:
        return None
    excess = (logs - middle) / deviation
    out = excess > _FAR
    out |= _neighbours(out, any_of=True) & (excess > _NEAR)
    out |= _lines(excess)
    thick = _neighbours(out, any_of=False) & out
    if not (out.any() or seams.any()) or thick.sum() > _THICK * out.sum():
        return None
    rows = np.minimum(np.arange(heights.shape[0]) // _EDGE, down - 1)
    columns = np.minimum(np.arange(heights.shape[1]) // _EDGE, across - 1)
    cells = np.asarray(out[rows[:, None], columns] | seams)
    return None if cells.mean() > 1.0 - _LEFT else cells


def seam_cells(heights: Array) -> Array:
    """Return the cells beside seams between tiles: lines along an axis that neighbours differ across more.

    An offset of each row and of each column is taken out first. `heights` are complete.
    """
    level = heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True)
    cells = np.zeros(heights.shape, dtype=bool)
    for lines, of_lines in ((level, cells), (level.T, cells.T)):
        squares = np.mean(np.diff(lines, axis=0) ** 2, axis=1)
        if not squares.min() > 0.0:
            continue
        logs = np.log(squares)
        low, middle, high = np.quantile(logs, (0.25, 0.5, 0.75))
        is_seam = logs - middle > _SEAM * (high - low) / (-2.0 * _NORMAL_QUANTILES[1])
        if is_seam.mean() > _MOST_SEAMS:
            continue
        for line in np.flatnonzero(is_seam):
            of_lines[max(line + 1 - _EDGE // 2, 0) : line + 1 + _EDGE // 2] = True
    return cells


def _lines(excess: Array) -> Array:
    """Return the blocks of short lines, in any direction, that stand above the rest on average."""
    out = np.zeros(excess.shape, dtype=bool)
    reach = _LINE // 2
    padded = np.pad(excess, reach)
    ny, nx = excess.shape
    for angle in np.arange(8) * np.pi / 8.0:
        steps = [
            (reach + round(k * float(np.sin(angle))), reach + round(k * float(np.cos(angle))))
            for k in range(-reach, reach + 1)
        ]
        total = sum(np.clip(padded[y : y + ny, x : x + nx], -_NEAR, _FAR) for y, x in steps)
        above = total > _LINE * _ON_LINE
        for y, x in steps:
            marked = np.zeros(padded.shape, dtype=bool)
            marked[y : y + ny, x : x + nx] = above
            out |= marked[reach : reach + ny, reach : reach + nx]
    return out & (excess > 0.0)


def _neighbours(blocks: Array, *, any_of: bool) -> Array:
    """Return where any, or all, of the blocks at and around each are set; there are none beyond the edge."""
    padded = np.pad(blocks, 1, constant_values=False)
    shifted = [padded[y : y + blocks.shape[0], x : x + blocks.shape[1]] for y in range(3) for x in range(3)]
    return np.asarray(np.any(shifted, axis=0) if any_of else np.all(shifted, axis=0))
