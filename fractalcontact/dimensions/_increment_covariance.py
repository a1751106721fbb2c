"""Exact covariance of mean square increments of fractional Brownian heights on a lattice.

For Gaussian increments the covariance of two mean squares is twice the mean squared covariance of their
increments, summed over all shifts between them with the number of pairs at that shift.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._increment_moments import LAGS

Array = np.ndarray[Any, np.dtype[Any]]

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
                is_complete = is_complete.take(range(reach, n), axis) & is_complete.take(
                    range(n - reach), axis
                )
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
    return (
        np.concatenate([-middle[::-1], [0], middle]).astype(float),
        np.concatenate([width[::-1], [1], width]).astype(float),
    )


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
