"""Closed-form estimate of H from increments over one, two and four points (method "increments").

For a fractional Brownian surface the mean square increment over m points is m^2H times that over one, for
first and for second differences alike. Second differences keep the rate 1/n for every H < 1; first
differences lose less where H is small (Zhu and Stein 2002, J. Agric. Biol. Environ. Stat. 7; Chan and Wood
2000, Ann. Stat. 28). H is the slope of a line through the logarithms, with one level per axis, by
generalised least squares: their exact covariance at a pilot estimate gives the weights, the standard error,
and chi square of the residual. One pass over the heights.

Twelve kinds of increments are measured: along x the first differences over 1, 2 and 4 times the stride, then
the second differences; the same six along y. For Gaussian increments the covariance of two mean squares is
twice the mean squared covariance of their increments, summed over all shifts between them with the number of
pairs there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.dimensions._curve import NO_NOISE, chi_square_z, misfit_reason
from fractalcontact.dimensions._records import (
    CONSTANT,
    SIGNIFICANT,
    Estimate,
    normal_interval,
    plane,
    undefined,
)
from fractalcontact.dimensions._surface_input import Scales, Surface, between

# first differences where the pilot estimate is below, second differences above: their standard errors are
# equal at H = 0.53 on 256 x 256 points and 0.43 on 1024 x 1024
_FIRST_BELOW = 0.45


def increments(surface: Surface, scales: Scales, noise: float | None) -> Estimate:
    """Estimate H of one surface by the closed form, with its interval."""
    stride, asked, scales = 1, scales, surface.resolved(scales)
    if scales is not None:
        stride = max(1, int(np.ceil(scales[0] / max(surface.grid.spacing) * (1 - 1e-9))))
    lags = stride * np.multiply.outer(surface.grid.spacing, LAGS)
    is_inside = between(lags, scales)
    is_inside &= np.count_nonzero(is_inside, axis=1, keepdims=True) > 1
    if scales is not None and not is_inside.any():
        reason = f"two lags m and 2 m spacings are needed between {scales[0]:g} m and {scales[1]:g} m"
        return undefined(reason)
    moments = increment_moments(surface.slabs(REACH * stride), surface.grid.shape, stride)
    first, second = moments.means[[0, 6]], moments.means[[3, 9]]
    if not np.nansum(first) > 0:
        return undefined(CONSTANT)
    shortest = "the shortest lags that the points resolve, which carry nearly all information on H"
    window: dict[str, Any] = {"window": shortest if asked is None else "asked for"}
    window["scale_min"], window["scale_max"] = (float(end) for end in np.sort(lags[is_inside])[[0, -1]])
    rounding = 0.0 if surface.is_lazy else 4.0 * np.spacing(abs(float(surface.raw[0, 0])))
    if not np.nansum(second) > max(1e-22 * np.nansum(first), rounding**2):
        return replace(plane(), **window)
    pilot = _line(replace(moments, observed=None), surface.relative_spacing, 2, 0.5, is_inside)
    if not np.isfinite(pilot.hurst):
        step = stride * surface.spacing[1]
        return undefined(f"increments over at least two of the lags 1, 2 and 4 times {step:g} m are needed")
    order = 1 if pilot.hurst < _FIRST_BELOW else 2
    estimate = replace(_line(moments, surface.relative_spacing, order, pilot.hurst, is_inside), **window)
    # second differences over one lag have 4 - 4^H times the mean square of first differences
    square = first[0] if order == 1 else second[0] / (4.0 - 4.0 ** min(estimate.hurst, 0.999))
    rms = float(np.sqrt(square) * float(stride) ** -estimate.hurst)
    estimate = replace(estimate, rms_increment=rms)
    if any(surface.grid.periodic):
        return estimate.without_interval(
            "a periodic surface is not fractional Brownian, and its shortest increments do not scale with H"
        )
    if noise:
        return estimate.without_interval(NO_NOISE)
    if estimate.misfit > SIGNIFICANT:
        return estimate.without_interval(misfit_reason(estimate))
    parts = _difference_of_parts(moments, surface.relative_spacing, estimate.hurst)
    if parts > SIGNIFICANT:
        return replace(estimate, misfit=parts).without_interval(
            f"parts of the surface are not equally rough (z = {parts:.1f}), as beside a step or a patch: its "
            "points tell less of H than those of a Gaussian surface"
        )
    return estimate


def _line(
    moments: Moments, spacing: tuple[float, ...], order: int, pilot: float, is_inside: Array
) -> Estimate:
    """Fit the line through differences of an order with the weights of a surface of exponent `pilot`.

    `is_inside`: lags that count, shape (axes, 3).
    """
    axes = len(spacing)
    along = [6, 0][2 - axes :]  # y, then x, of the columns of the moments
    means = np.concatenate([moments.means[start + 3 * (order - 1) :][:3] for start in along])
    # logarithms of numbers near one: the unit of height changes no bit
    means = means / power_of_two(float(np.nanmax(means, initial=0.0)))
    usable = np.isfinite(means) & (means > 0) & is_inside.ravel()
    by_axis = usable.reshape(axes, 3)
    by_axis &= np.count_nonzero(by_axis, axis=1, keepdims=True) > 1
    if not usable.any():
        return undefined("")
    levels = np.repeat(np.eye(axes)[:, by_axis.any(axis=1)], 3, axis=0)
    design = np.column_stack([levels, np.tile(2.0 * np.log(LAGS), axes)])[usable]
    if moments.observed is None:
        covariance = complete_covariance(pilot, moments.shape, spacing, order, moments.stride)
    else:
        pairs = gapped_pairs(moments.observed, order, axes, moments.stride)
        pilot = float(np.clip(pilot, NODES[0], NODES[-1]))  # a smooth or a white surface lies outside
        covariance = covariance_of_logs(pilot, spacing, order, pairs, moments.stride)
    inverse = np.linalg.inv(covariance[np.ix_(usable, usable)])
    information = design.T @ inverse @ design
    y = np.log(means[usable])
    coefficients = np.linalg.solve(information, design.T @ inverse @ y)
    residual = y - design @ coefficients
    freedom = y.size - design.shape[1]
    misfit = chi_square_z(float(residual @ inverse @ residual) / freedom, freedom) if freedom else np.nan
    hurst, error = float(coefficients[-1]), float(np.sqrt(np.linalg.inv(information)[-1, -1]))
    low, high = normal_interval(hurst, error)
    return Estimate(hurst, error, low, high, misfit=misfit)


def _difference_of_parts(moments: Moments, spacing: tuple[float, ...], hurst: float) -> float:
    """Return z of the scatter of the logarithms of mean squares between equal blocks of a surface.

    The level of a block is the mean over the lags of its second differences, which are nearly independent
    of those of other blocks: chi square of the levels. NaN for a surface without blocks, infinite beside flat
    ones.
    """
    axes = len(spacing)
    if moments.blocks is None:
        return float("nan")
    columns = np.concatenate([start + np.arange(3, 6) for start in [6, 0][2 - axes :]])
    means, counts = (values[:, columns] for values in moments.blocks)
    shares = np.min(counts / np.maximum(counts.max(axis=0), 1), axis=1)
    is_full = shares > 0.5
    if np.count_nonzero(is_full) < 2:
        return float("nan")
    covariance = len(means) * complete_covariance(hurst, moments.shape, spacing, 2, moments.stride)
    with np.errstate(divide="ignore"):
        levels = np.log(means[is_full]).mean(axis=1)
    if not np.isfinite(levels).all():
        return float("inf")
    weights = shares[is_full] / covariance.mean()
    residual = levels - weights @ levels / weights.sum()
    freedom = levels.size - 1
    return chi_square_z(float(weights @ residual**2) / freedom, freedom)


LAGS = (1, 2, 4)
REACH = 2 * LAGS[-1]  # rows of the next slab that an increment needs, in strides
KINDS = 12
_BLOCKS = 4  # blocks along an axis
_BLOCK_EDGE, _BLOCK_LENGTH = 12, 48  # smallest edge of a block, and length of a block of a profile, strides


@dataclass(frozen=True)
class Moments:
    """Mean squares of the twelve increments.

    Attributes
    ----------
    means, counts : ndarray, shape (12,)
        Mean squares and numbers of increments.
    shape : (ny, nx) or (nx,)
    stride : int
        Shortest lag in points.
    observed : ndarray of bool, shape (ny, nx), or None
        Where heights were observed; None if everywhere.
    blocks : pair of ndarray, shape (blocks, 12), or None
        Mean squares and numbers of equal blocks; None if the surface is too small to be cut.
    """

    means: Array
    counts: Array
    shape: tuple[int, ...]
    stride: int
    observed: Array | None
    blocks: tuple[Array, Array] | None = None


def increment_moments(slabs: Iterable[tuple[Array, int]], shape: tuple[int, ...], stride: int = 1) -> Moments:
    """Collect the mean squares from slabs of rows in one pass.

    Parameters
    ----------
    slabs : iterable of (heights, rows)
        Consecutive rows, each slab with up to `REACH` * `stride` rows of the next; `rows` is how many of
        its rows increments start from. A profile has one row.
    shape : (ny, nx) or (nx,)
    stride : int
        Shortest lag in points.
    """
    from fractalcontact.base.resources import in_bands
    from fractalcontact.dimensions._kernels import gapped_increment_sums, increment_sums

    block_rows, block_columns = _block_edges(shape, stride)
    row_sums, row_counts, masks = [], [], []
    for heights, rows in slabs:
        sums = np.zeros((rows, block_columns.size - 1, KINDS))
        in_bands(increment_sums, rows, KINDS * rows * heights.shape[1], heights, stride, block_columns, sums)
        counts = _complete_counts(heights.shape, rows, block_columns, stride)
        mask = None
        if np.isnan(sums).any():
            # a row without gaps keeps its sum, so that it does not matter which slab it was read with
            gapped, counts = np.zeros(sums.shape), np.zeros(sums.shape, dtype=np.int64)
            place = heights, stride, block_columns
            in_bands(gapped_increment_sums, rows, KINDS * rows * heights.shape[1], *place, gapped, counts)
            sums = np.where(np.isnan(sums), gapped, sums)
            mask = np.isfinite(heights[:rows])
        row_sums.append(sums)
        row_counts.append(counts)
        masks.append(mask)
    sums, counts = np.concatenate(row_sums), np.concatenate(row_counts)
    # added row after row, so that neither slabs nor threads change a bit
    total, number = np.cumsum(np.cumsum(sums, axis=0)[-1], axis=0)[-1], counts.sum(axis=(0, 1))
    blocks = None
    if (block_rows.size - 1) * (block_columns.size - 1) > 1:
        block_sums = np.add.reduceat(sums, block_rows[:-1], axis=0).reshape(-1, KINDS)
        block_counts = np.add.reduceat(counts, block_rows[:-1], axis=0).reshape(-1, KINDS)
        blocks = (_ratio(block_sums, block_counts), block_counts)
    observed = None
    if any(mask is not None for mask in masks):
        nx = shape[-1]
        pairs = zip(masks, row_sums, strict=True)
        seen = [np.ones((len(sums), nx), dtype=bool) if mask is None else mask for mask, sums in pairs]
        observed = np.concatenate(seen)
    return Moments(_ratio(total, number), number, shape, stride, observed, blocks)


def _block_edges(shape: tuple[int, ...], stride: int) -> tuple[Array, Array]:
    """Return the rows and the columns at which a surface is cut into blocks, the last edge included."""
    ny, nx = (1, *shape)[-2:]
    if ny == 1:
        down, across = 1, max(1, min(_BLOCKS**2, nx // (_BLOCK_LENGTH * stride)))
    else:
        down, across = (max(1, min(_BLOCKS, n // (_BLOCK_EDGE * stride))) for n in (ny, nx))
    return tuple(np.arange(k + 1) * n // k for n, k in ((ny, down), (nx, across)))  # type: ignore[return-value]


def _ratio(sums: Array, counts: Array) -> Array:
    return np.asarray(np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0))


def _complete_counts(shape: tuple[int, ...], rows: int, edges: Array, stride: int) -> Array:
    """Count the increments of every row and block of a complete surface: (rows, blocks, 12)."""
    ny, nx = shape
    counts = np.empty((rows, edges.size - 1, KINDS), dtype=np.int64)
    for k, reach in enumerate(stride * lag for lag in (1, 2, 4, 2, 4, 8)):
        counts[..., k] = np.diff(np.minimum(edges, max(nx - reach, 0)))
        counts[..., 6 + k] = np.diff(edges) * (np.arange(rows) + reach < ny)[:, None]
    return counts


NODES = np.linspace(0.02, 0.98, 25)  # Hurst exponents of the table of complete surfaces
_STENCILS = {1: (-1.0, 1.0), 2: (1.0, -2.0, 1.0)}
# shifts summed one by one, and relative width of the blocks of shifts beyond: standard errors are within 5 %
# of those of dense algebra (test_increments.py)
_EXACT, _GROWTH = 12, 0.2
_FAR = 96  # shifts up to which the pattern of missing points matters


class PairCounts:
    """Number of pairs of increments of two kinds at each shift.

    A kind is a lag along an axis: `LAGS` along y, then along x. ``number(kind, other, uy, ux)`` returns the
    counts at shifts (uy, ux).
    """

    def __init__(self, shape: tuple[int, ...], number: Callable[[int, int, Array, Array], Array]) -> None:
        self.shape, self.number = shape, number

    def total(self, kind: int) -> float:
        """Return the number of increments of one kind."""
        return float(self.number(kind, kind, np.zeros(1), np.zeros(1))[0])


def complete_pairs(shape: tuple[int, ...], order: int, stride: int) -> PairCounts:
    """Count the pairs on a complete lattice."""

    def sides(kind: int) -> list[int]:
        axis, lag = kind // len(LAGS), LAGS[kind % len(LAGS)]
        return [max(n - order * lag * stride * (i == axis), 0) for i, n in enumerate(shape)]

    def number(kind: int, other: int, uy: Array, ux: Array) -> Array:
        count: Array = np.ones(1)
        for n, m, u in zip(sides(kind), sides(other), (uy, ux)[-len(shape) :], strict=True):
            count = count * np.maximum(np.minimum(n, m - u) - np.maximum(0.0, -u), 0.0)
        return count

    return PairCounts(shape, number)


def gapped_pairs(observed: Array, order: int, axes: int, stride: int) -> PairCounts:
    """Count the pairs where points are missing, by correlating the masks of the increments.

    `observed` has shape (ny, nx), one row for a profile.
    """
    ny, nx = observed.shape
    far = [min(n, max(_FAR, 16 * stride)) for n in (ny, nx)]
    torus = (fft.fast_length(ny + far[0]) if axes == 2 else 1, fft.fast_length(nx + far[1]))
    complete = complete_pairs(observed.shape[-axes:], order, stride)
    spectra, sizes = [], []
    for axis in range(2 - axes, 2):
        for lag in LAGS:
            is_complete = observed
            for _ in range(order):
                n = is_complete.shape[axis]
                reach = min(lag * stride, n)
                is_near = is_complete.take(range(n - reach), axis)
                is_complete = is_near & is_complete.take(range(reach, n), axis)
            mask = np.zeros(torus)
            mask[: is_complete.shape[0], : is_complete.shape[1]] = is_complete
            spectra.append(fft.rfft2(mask))
            sizes.append(float(is_complete.sum()))
    cache: dict[tuple[int, int], Array] = {}

    def number(kind: int, other: int, uy: Array, ux: Array) -> Array:
        if (kind, other) not in cache:
            cache.clear()
            cache[kind, other] = np.rint(fft.irfft2(np.conj(spectra[kind]) * spectra[other], torus))
        near = (np.abs(uy) < far[0]) & (np.abs(ux) < far[1])
        exact = cache[kind, other][np.where(near, uy, 0).astype(int), np.where(near, ux, 0).astype(int)]
        # at large shifts whether one increment is complete does not depend on the other
        share = sizes[kind] * sizes[other] / max(complete.total(kind) * complete.total(other), 1.0)
        return np.where(near, exact, share * complete.number(kind, other, uy, ux))

    return PairCounts(observed.shape[-axes:], number)


def complete_covariance(
    hurst: float, shape: tuple[int, ...], spacing: tuple[float, ...], order: int, stride: int
) -> Array:
    """Return `covariance_of_logs` of a complete surface, interpolated in a table over `NODES`."""
    table = _table(shape, spacing, order, stride)
    position = np.interp(hurst, NODES, np.arange(NODES.size))
    low = min(int(position), NODES.size - 2)
    return np.asarray(table[low] + (position - low) * (table[low + 1] - table[low]))


@lru_cache(maxsize=32)
def _table(shape: tuple[int, ...], spacing: tuple[float, ...], order: int, stride: int) -> Array:
    """Tabulate the covariance of the logarithms: (nodes, kinds, kinds)."""
    pairs = complete_pairs(shape, order, stride)
    return np.stack([covariance_of_logs(hurst, spacing, order, pairs, stride) for hurst in NODES])


def covariance_of_logs(
    hurst: float, spacing: tuple[float, ...], order: int, pairs: PairCounts, stride: int
) -> Array:
    """Return the covariance of the logarithms of mean square increments of a fractional Brownian surface.

    Parameters
    ----------
    hurst : float
    spacing : (dy/dx, 1), or (1,) for a profile
    order : 1 or 2
        First or second differences.
    pairs : PairCounts
    stride : int
        Shortest lag in points.

    Returns
    -------
    ndarray, shape (kinds, kinds)
        Kinds are the lags along y, then along x; NaN where there is no increment of the kind.
    """
    kinds = [(axis, lag * stride) for axis in range(len(spacing)) for lag in LAGS]
    uy, ux, weight = _shifts(pairs.shape)
    increments = _IncrementCovariance(hurst, spacing, order, uy, ux)
    totals = [pairs.total(k) for k in range(len(kinds))]
    covariance = np.full((len(kinds), len(kinds)), np.nan)
    for k, kind in enumerate(kinds):
        for m, other in enumerate(kinds[k:], k):
            if totals[k] and totals[m]:
                share = pairs.number(k, m, uy, ux) / (totals[k] * totals[m])
                correlation = (
                    increments.covariance(kind, other) / increments.deviation(kind)
                ) / increments.deviation(other)
                covariance[k, m] = covariance[m, k] = 2.0 * np.sum(weight * share * correlation**2)
    return covariance


def _shifts(shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Return shifts in y and x, and how many shifts each stands for."""
    (shifts, widths) = zip(*(_quadrature(n) for n in shape), strict=True)
    if len(shape) == 1:
        return np.zeros_like(shifts[0]), shifts[0], widths[0]
    uy, ux = (u.ravel() for u in np.meshgrid(*shifts, indexing="ij"))
    return uy, ux, np.outer(*widths).ravel()


def _quadrature(n: int) -> tuple[Array, Array]:
    """Return shifts from -n to n, one by one near 0 and in growing blocks beyond, and the block widths."""
    edges = list(range(1, min(_EXACT, n - 1) + 2))
    while edges[-1] < n:
        edges.append(min(n, edges[-1] + max(1, int(_GROWTH * edges[-1]))))
    low, high = np.array(edges[:-1]), np.array(edges[1:])
    middle, width = (low + high - 1) // 2, high - low
    shifts, widths = [*-middle[::-1], 0, *middle], [*width[::-1], 1, *width]
    return np.array(shifts, dtype=float), np.array(widths, dtype=float)


class _IncrementCovariance:
    """Covariances of increments at many shifts, from powers of distances that are computed once."""

    def __init__(self, hurst: float, spacing: tuple[float, ...], order: int, uy: Array, ux: Array) -> None:
        self.hurst, self.spacing, self.order = hurst, spacing, order
        self.y = uy * (spacing[0] if len(spacing) == 2 else 1.0)
        self.x = ux
        self._powers: dict[tuple[float, float], Array] = {}

    def covariance(self, kind: tuple[int, int], other: tuple[int, int]) -> Array:
        """Return the covariance of increment `other` at the shifts with increment `kind` at the origin."""
        total = np.zeros(self.x.shape)
        for i, a in enumerate(_STENCILS[self.order]):
            for j, b in enumerate(_STENCILS[self.order]):
                (py, px), (qy, qx) = self._offset(kind, i), self._offset(other, j)
                total -= 0.5 * a * b * self._power(qy - py, qx - px)
        return total

    def deviation(self, kind: tuple[int, int]) -> float:
        """Return the standard deviation of an increment."""
        factor = 1.0 if self.order == 1 else 4.0 - 4.0**self.hurst
        return float(np.sqrt(factor) * (self.spacing[kind[0]] * kind[1]) ** self.hurst)

    def _offset(self, kind: tuple[int, int], index: int) -> tuple[float, float]:
        along = index * kind[1] * self.spacing[kind[0]]
        return (along, 0.0) if len(self.spacing) == 2 and kind[0] == 0 else (0.0, along)

    def _power(self, dy: float, dx: float) -> Array:
        if (dy, dx) not in self._powers:
            self._powers[dy, dx] = ((self.y + dy) ** 2 + (self.x + dx) ** 2) ** self.hurst
        return self._powers[dy, dx]
