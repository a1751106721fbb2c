"""The closed-form estimator: how increments over 4 and 2 spacings compare with increments over one.

For a fractional Brownian surface the mean square increment over m spacings is m^2H times that over one, for
first and for second differences alike. Second differences keep the rate 1/n for every H < 1; first
differences lose less where H is small (Zhu and Stein 2002, J. Agric. Biol. Environ. Stat. 7; Chan and Wood
2000, Ann. Stat. 28). H is the slope of a line through the logarithms, each axis with a level of its own;
their exact covariance, at a pilot estimate, weighs them and gives the standard error. One pass over the
heights.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from fractalcontact.dimensions._estimates import STRANGE, normal_interval
from fractalcontact.dimensions._pairs import (
    LAGS,
    Overlap,
    complete_overlap,
    covariance_of_logs,
    gapped_overlap,
)

Array = np.ndarray[Any, np.dtype[Any]]

FIRST_BELOW = 0.45  # first differences where the pilot estimate is below, second differences above
PARTS, _WIDE, _LONG = 4, 12, 48  # parts along an axis, their least edge; least length of a part of a profile
REACH = 2 * LAGS[-1]  # rows that a slab borrows from the next, in steps
_UNLIKELY = (np.inf, 10.83, 13.82, 16.27)  # 99.9 % of chi square with 0 to 3 degrees of freedom
_NODES = np.linspace(0.02, 0.98, 25)
_LEAST = 0.02


@dataclass(frozen=True)
class Moments:
    """Mean squares of the twelve increments of `_kernels.increment_sums`, and how many there were.

    `observed` tells where heights were observed, or is None if everywhere; `parts` (parts, 12) are the mean
    squares and the numbers of equal parts of the face, or None if it is too small to be cut.
    """

    means: Array
    counts: Array
    shape: tuple[int, ...]
    step: int
    observed: Array | None
    parts: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class ClosedForm:
    """Estimate of H with its standard error; `increment` is the rms first difference over one x spacing.

    `strain` is the factor by which the lags scatter about the line more than they should (Birge 1932), and 1
    where chance gives as much once in a thousand times. `turn` is how far the curve turns from the line as
    white noise turns it, in standard deviations, and `noisy` the estimate with such noise fitted, and its
    standard error.
    """

    hurst: float
    standard_error: float
    order: int
    increment: float
    strain: float
    turn: float
    noisy: tuple[float, float]

    def quieted(self, low: float, high: float) -> tuple[float, float, str]:
        """Widen an interval to hold that of the fit with noise, where the lags ask for it; with a note."""
        if abs(self.turn) <= STRANGE:
            return low, high, ""
        ends = normal_interval(*self.noisy)
        note = (
            f"the exponent changes with the lag ({self.turn:+.1f} standard deviations of white noise): "
            f"the interval also holds that of increments less such noise, {self.noisy[0]:.2f}"
        )
        return min(low, ends[0]), max(high, ends[1]), note


@dataclass(frozen=True)
class _Line:
    """What a straight line through the logarithms gives; see `ClosedForm`."""

    hurst: float = np.nan
    standard_error: float = np.nan
    strain: float = np.nan
    turn: float = 0.0
    noisy: tuple[float, float] = (np.nan, np.nan)


def moments(slabs: Iterable[tuple[Array, int]], shape: tuple[int, ...], step: int = 1) -> Moments:
    """Collect the mean squares from slabs of rows.

    Parameters
    ----------
    slabs : iterable of (heights, rows)
        Consecutive rows of a face, each slab with up to `REACH` * `step` rows of the next; `rows` is how
        many of its rows increments start from. A profile is a face of one row.
    shape : (ny, nx) or (nx,)
    step : int
        Shortest lag in spacings.
    """
    from fractalcontact.base.threads import in_bands
    from fractalcontact.dimensions._kernels import increment_sums

    bands, edges = _cuts(shape, step)
    rows_of_sums, rows_of_counts, masks = [], [], []
    for heights, rows in slabs:
        sums = np.zeros((rows, edges.size - 1, 12))
        in_bands(increment_sums, rows, 12 * rows * heights.shape[1], heights, step, edges, sums)
        number = _complete_counts(heights.shape, rows, edges, step)
        mask = None
        if np.isnan(sums).any():
            # a row without gaps keeps its sum, so that it does not matter which slab it was read with
            sparse, number = _gapped_sums(heights, rows, edges, step)
            sums = np.where(np.isnan(sums), sparse, sums)
            mask = np.isfinite(heights[:rows])
        rows_of_sums.append(sums)
        rows_of_counts.append(number)
        masks.append(mask)
    sums, numbers = np.concatenate(rows_of_sums), np.concatenate(rows_of_counts)
    # added up one row after the other, so that neither slabs nor threads change a bit
    total, counts = np.cumsum(np.cumsum(sums, axis=0)[-1], axis=0)[-1], numbers.sum(axis=(0, 1))
    parts = None
    if (bands.size - 1) * (edges.size - 1) > 1:
        own = np.add.reduceat(sums, bands[:-1], axis=0).reshape(-1, 12)
        seen = np.add.reduceat(numbers, bands[:-1], axis=0).reshape(-1, 12)
        parts = (_ratio(own, seen), seen)
    observed = None
    if any(mask is not None for mask in masks):
        whole = (np.ones((len(sums), shape[-1]), dtype=bool) for sums in rows_of_sums)
        observed = np.concatenate(
            [one if mask is None else mask for mask, one in zip(masks, whole, strict=True)]
        )
    return Moments(_ratio(total, counts), counts, shape, step, observed, parts)


def _cuts(shape: tuple[int, ...], step: int) -> tuple[Array, Array]:
    """Return the rows and the columns at which a face is cut into equal parts, the last of all included."""
    ny, nx = (1, *shape)[-2:]
    if ny == 1:
        down, across = 1, max(1, min(PARTS**2, nx // (_LONG * step)))
    else:
        down, across = (max(1, min(PARTS, n // (_WIDE * step))) for n in (ny, nx))
    return tuple(np.arange(k + 1) * n // k for n, k in ((ny, down), (nx, across)))  # type: ignore[return-value]


def _ratio(sums: Array, counts: Array) -> Array:
    return np.asarray(np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0))


def closed_form(
    moments: Moments, steps: tuple[float, ...], *, lags: int = 3, error: bool = True
) -> ClosedForm:
    """Estimate H; NaN where the increments vanish.

    Parameters
    ----------
    moments : Moments
    steps : (dy/dx, 1), or (1,) for a profile
    lags : 2 or 3
        How many of the lags are used.
    error : bool
        Where points are missing, False saves the time for the standard error, and weighs as if complete.
    """
    line = _estimate(moments, steps, 2, 0.5, lags, error=False)
    order = 2
    if np.isfinite(line.hurst):
        order = 1 if line.hurst < FIRST_BELOW else 2
        line = _estimate(moments, steps, order, line.hurst, lags, error=error)
    reference = moments.means[0] if order == 1 else moments.means[3] / (4.0 - 4.0 ** min(line.hurst, 0.999))
    increment = float(np.sqrt(reference) * float(moments.step) ** -line.hurst)
    return ClosedForm(line.hurst, line.standard_error, order, increment, line.strain, line.turn, line.noisy)


def _estimate(
    moments: Moments, steps: tuple[float, ...], order: int, near: float, lags: int, *, error: bool
) -> _Line:
    """Fit the line, weighing as for a face of exponent `near`."""
    axes = len(steps)
    columns = np.array(
        [3 * (order - 1) + i + 6 * (axes == 2 and axis == 0) for axis in range(axes) for i in range(3)]
    )
    means = moments.means[columns]
    # logarithms of numbers near one: the unit of height changes no bit
    means = means / np.ldexp(1.0, np.frexp(np.nanmax(means, initial=0.0))[1])
    usable = np.isfinite(means) & (means > 0) & (np.arange(3 * axes) % 3 < lags)
    design = np.zeros((3 * axes, axes + 1))
    for axis in range(axes):
        design[3 * axis : 3 * axis + 3, axis] = 1.0
    design[:, axes] = np.tile(2.0 * np.log(LAGS), axes)
    for axis in range(axes):
        own = slice(3 * axis, 3 * axis + 3)
        usable[own] &= np.count_nonzero(usable[own]) > 1
    if not usable.any():
        return _Line()
    if moments.observed is None or not error:
        covariance = complete_covariance(near, moments.shape, steps, order, moments.step)
    else:
        overlap = gapped_overlap(moments.observed, order, axes, moments.step)
        near = float(np.clip(near, _NODES[0], _NODES[-1]))  # a smooth or a white face has none of its own
        covariance = covariance_of_logs(near, steps, order, overlap, moments.step)
    return _slope(design[usable], np.log(means[usable]), covariance[np.ix_(usable, usable)])


def _slope(design: Array, values: Array, covariance: Array) -> _Line:
    """Fit the line by generalised least squares; the last column of the design is that of H."""
    design = design[:, np.any(design != 0, axis=0)]
    coefficients, inverse, square = _least_squares(design, values, covariance)
    freedom = values.size - design.shape[1]
    strain = np.sqrt(square / freedom) if square > _UNLIKELY[freedom] else 1.0
    hurst, error = float(coefficients[-1]), float(np.sqrt(inverse[-1, -1]))
    if freedom <= design.shape[1] - 2:  # no axis has three lags
        return _Line(hurst, error, float(strain))
    # white noise adds as much to every lag; where H is 0 it is no other than the level
    noise = np.exp(-max(hurst, _LEAST) * design[:, -1])
    coefficients, inverse, _ = _least_squares(np.column_stack([noise, design]), values, covariance)
    turn = float(coefficients[0] / np.sqrt(inverse[0, 0]))
    noisy = float(coefficients[-1]), float(np.sqrt(inverse[-1, -1]))
    return _Line(hurst, error, float(strain), turn, noisy)


def _least_squares(design: Array, values: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Return the coefficients, their covariance, and the square of what is left over."""
    weighted = np.linalg.solve(covariance, design)
    inverse = np.linalg.inv(design.T @ weighted)
    coefficients = inverse @ (weighted.T @ values)
    rest = values - design @ coefficients
    return coefficients, inverse, float(rest @ np.linalg.solve(covariance, rest))


def complete_covariance(
    hurst: float, shape: tuple[int, ...], steps: tuple[float, ...], order: int, step: int
) -> Array:
    """Return the covariance of the logarithms for a complete face; kinds are lags along y, then along x."""
    table = _table(shape, steps, order, step)
    place = np.interp(hurst, _NODES, np.arange(_NODES.size))
    low = min(int(place), _NODES.size - 2)
    return np.asarray(table[low] + (place - low) * (table[low + 1] - table[low]))


@lru_cache(maxsize=32)
def _table(shape: tuple[int, ...], steps: tuple[float, ...], order: int, step: int) -> Array:
    """Tabulate the covariance of the logarithms over `_NODES`: (nodes, kinds, kinds)."""
    overlap: Overlap = complete_overlap(shape, order, step)
    return np.stack([covariance_of_logs(h, steps, order, overlap, step) for h in _NODES])


def _complete_counts(shape: tuple[int, ...], rows: int, edges: Array, step: int) -> Array:
    """Count the increments of every row and part of a complete face: (rows, parts, 12)."""
    ny, nx = shape
    counts = np.empty((rows, edges.size - 1, 12), dtype=np.int64)
    for k, reach in enumerate(step * lag for lag in (1, 2, 4, 2, 4, 8)):
        counts[..., k] = np.diff(np.minimum(edges, max(nx - reach, 0)))
        counts[..., 6 + k] = np.diff(edges) * (np.arange(rows) + reach < ny)[:, None]
    return counts


def _gapped_sums(heights: Array, rows: int, edges: Array, step: int) -> tuple[Array, Array]:
    """Do what `increment_sums` does where some heights are NaN."""
    sums = np.zeros((rows, edges.size - 1, 12))
    counts = np.zeros(sums.shape, dtype=np.int64)
    column = 0
    for axis in (1, 0):
        for order in (1, 2):
            for lag in LAGS:
                reach = lag * step
                if heights.shape[axis] > order * reach:
                    jump = heights
                    for _ in range(order):
                        n = jump.shape[axis]
                        jump = jump.take(range(reach, n), axis) - jump.take(range(n - reach), axis)
                    jump = jump[:rows]
                    for p, (low, high) in enumerate(pairwise(edges)):
                        part = jump[:, low:high]
                        sums[: len(part), p, column] = np.nansum(part * part, axis=1)
                        counts[: len(part), p, column] = np.count_nonzero(~np.isnan(part), axis=1)
                column += 1
    return sums, counts
