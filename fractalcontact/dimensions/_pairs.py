"""How estimates from increments scatter: exact covariances of mean squares on a lattice.

For Gaussian increments the covariance of two mean squares is twice the mean squared covariance of their
increments, summed over all lags with the number of pairs at that lag.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]
LAGS = (1, 2, 4)
_STENCILS = {1: (-1.0, 1.0), 2: (1.0, -2.0, 1.0)}
_EXACT, _GROWTH = 12, 0.2  # lags summed one by one; relative width of the blocks beyond
_FAR = 96  # lags up to which the pattern of missing points matters


class Overlap:
    """How many pairs of increments of two kinds lie at each lag; kinds count lags within axes."""

    def __init__(self, shape: tuple[int, ...], number: Callable[[int, int, Array, Array], Array]) -> None:
        self.shape, self.number = shape, number

    def total(self, kind: int) -> float:
        """Return the number of increments of one kind."""
        return float(self.number(kind, kind, np.zeros(1), np.zeros(1))[0])


def complete_overlap(shape: tuple[int, ...], order: int, step: int) -> Overlap:
    """Count on a complete lattice."""

    def sides(kind: int) -> list[int]:
        axis, lag = kind // len(LAGS), LAGS[kind % len(LAGS)]
        return [max(n - order * lag * step * (i == axis), 0) for i, n in enumerate(shape)]

    def number(one: int, two: int, uy: Array, ux: Array) -> Array:
        count: Array = np.ones(1)
        for n, m, u in zip(sides(one), sides(two), (uy, ux)[-len(shape) :], strict=True):
            count = count * np.maximum(np.minimum(n, m - u) - np.maximum(0.0, -u), 0.0)
        return count

    return Overlap(shape, number)


def gapped_overlap(observed: Array, order: int, axes: int, step: int) -> Overlap:
    """Count where points are missing, by correlating the masks of the increments; a profile has one row."""
    ny, nx = observed.shape
    far = [min(n, max(_FAR, 16 * step)) for n in (ny, nx)]
    torus = (fft.fast_length(ny + far[0]) if axes == 2 else 1, fft.fast_length(nx + far[1]))
    complete = complete_overlap(observed.shape[-axes:], order, step)
    spectra, sizes = [], []
    for axis in range(2 - axes, 2):
        for lag in LAGS:
            whole = observed
            for _ in range(order):
                n = whole.shape[axis]
                reach = min(lag * step, n)
                whole = whole.take(range(reach, n), axis) & whole.take(range(n - reach), axis)
            valid = np.zeros(torus)
            valid[: whole.shape[0], : whole.shape[1]] = whole
            spectra.append(fft.rfft2(valid))
            sizes.append(float(whole.sum()))
    cache: dict[tuple[int, int], Array] = {}

    def number(one: int, two: int, uy: Array, ux: Array) -> Array:
        if (one, two) not in cache:
            cache.clear()
            cache[one, two] = np.rint(fft.irfft2(np.conj(spectra[one]) * spectra[two], torus))
        near = (np.abs(uy) < far[0]) & (np.abs(ux) < far[1])
        exact = cache[one, two][np.where(near, uy, 0).astype(int), np.where(near, ux, 0).astype(int)]
        # far apart, whether one increment is whole says nothing about the other
        share = sizes[one] * sizes[two] / (complete.total(one) * complete.total(two))
        return np.where(near, exact, share * complete.number(one, two, uy, ux))

    return Overlap(observed.shape[-axes:], number)


def covariance_of_logs(
    hurst: float, steps: tuple[float, ...], order: int, overlap: Overlap, step: int
) -> Array:
    """Return the covariance of the logarithms of mean square increments of a fractional Brownian surface.

    Parameters
    ----------
    hurst : float
    steps : (dy/dx, 1), or (1,) for a profile
    order : 1 or 2
        First or second differences.
    overlap : Overlap
    step : int
        Shortest lag in spacings.

    Returns
    -------
    ndarray, shape (kinds, kinds)
        Kinds are the lags along y, then along x; NaN where there is no increment of the kind.
    """
    axes = len(steps)
    kinds = [(axis, lag * step) for axis in range(axes) for lag in LAGS]
    uy, ux, weight = _lags(overlap.shape)
    increments = _Increments(hurst, steps, order, uy, ux)
    totals = [overlap.total(k) for k in range(len(kinds))]
    spread = np.full((len(kinds), len(kinds)), np.nan)
    for k, one in enumerate(kinds):
        for m, two in enumerate(kinds[k:], k):
            if totals[k] and totals[m]:
                share = overlap.number(k, m, uy, ux) / (totals[k] * totals[m])
                squared = (
                    increments.covariance(one, two) / increments.deviation(one)
                ) / increments.deviation(two)
                spread[k, m] = spread[m, k] = 2.0 * np.sum(weight * share * squared**2)
    return spread


def _lags(shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Return lags in y and x, and how many lags each stands for."""
    (lags, widths) = zip(*(_quadrature(n) for n in shape), strict=True)
    if len(shape) == 1:
        return np.zeros_like(lags[0]), lags[0], widths[0]
    uy, ux = (u.ravel() for u in np.meshgrid(*lags, indexing="ij"))
    return uy, ux, np.outer(*widths).ravel()


def _quadrature(n: int) -> tuple[Array, Array]:
    edges = list(range(1, min(_EXACT, n - 1) + 2))
    while edges[-1] < n:
        edges.append(min(n, edges[-1] + max(1, int(_GROWTH * edges[-1]))))
    low, high = np.array(edges[:-1]), np.array(edges[1:])
    middle, width = (low + high - 1) // 2, high - low
    return (
        np.concatenate([-middle[::-1], [0], middle]).astype(float),
        np.concatenate([width[::-1], [1], width]).astype(float),
    )


class _Increments:
    """Covariances of increments at many lags, from powers of distances that are computed once."""

    def __init__(self, hurst: float, steps: tuple[float, ...], order: int, uy: Array, ux: Array) -> None:
        self.hurst, self.steps, self.order = hurst, steps, order
        self.y = uy * (steps[0] if len(steps) == 2 else 1.0)
        self.x = ux
        self._powers: dict[tuple[float, float], Array] = {}

    def covariance(self, one: tuple[int, int], two: tuple[int, int]) -> Array:
        """Return the covariance of increment `two` at the lags with increment `one` at the origin."""
        total = np.zeros(self.x.shape)
        for i, a in enumerate(_STENCILS[self.order]):
            for j, b in enumerate(_STENCILS[self.order]):
                (py, px), (qy, qx) = self._offset(one, i), self._offset(two, j)
                total -= 0.5 * a * b * self._power(qy - py, qx - px)
        return total

    def deviation(self, kind: tuple[int, int]) -> float:
        """Return the standard deviation of one increment."""
        factor = 1.0 if self.order == 1 else 4.0 - 4.0**self.hurst
        return float(np.sqrt(factor) * (self.steps[kind[0]] * kind[1]) ** self.hurst)

    def _offset(self, kind: tuple[int, int], index: int) -> tuple[float, float]:
        along = index * kind[1] * self.steps[kind[0]]
        return (along, 0.0) if len(self.steps) == 2 and kind[0] == 0 else (0.0, along)

    def _power(self, dy: float, dx: float) -> Array:
        if (dy, dx) not in self._powers:
            self._powers[dy, dx] = ((self.y + dy) ** 2 + (self.x + dx) ** 2) ** self.hurst
        return self._powers[dy, dx]
