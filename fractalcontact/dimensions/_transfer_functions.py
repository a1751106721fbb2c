"""Expected power of a surface under the transfer function of an instrument.

A Gaussian point spread function of the standard deviation s multiplies the power at the wavenumber q by
exp(-s^2 q^2). Its four forms differ in how short waves are aliased: a blur before the heights are sampled
(`BEFORE`), one that also removes all aliases (`BAND`), a filter of the sampled heights with the Gaussian at
whole points (`FILTER`), or with the Gaussian transfer function itself (`TRANSFER`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.dimensions._mode_blocks import Frame, node_weights

Array = np.ndarray[Any, np.dtype[Any]]

NONE, BEFORE, BAND, FILTER, TRANSFER = "none", "before", "band", "filter", "transfer"
FORMS = {
    NONE: "no blur",
    BEFORE: "a blur before sampling",
    BAND: "a band limit",
    FILTER: "a filter of the sampled heights",
    TRANSFER: "a filter of the sampled heights",
}
_NO_ALIASES = 0.1  # squared spread beyond which far aliases do not matter
_MOST_MEAN = 1.0  # logarithm of a mean over its centre, beyond which nothing of the power is left
_LEAST_LOG = -600.0  # logarithm of the smallest expected power
_LEAST_JUMP = 1e-260  # of the slope at the edges: its smallest power
_STEP = 0.05  # of the exponent, and relative one of the squared spread, between powers of the jump


def in_model(form: str, spread: float, has_noise: bool) -> str:
    """Return the note of an estimate with blur or noise in its model; empty without either."""
    parts = ["white noise"] if has_noise else []
    if form != NONE:
        parts.insert(0, FORMS[form] + (f" with a spread of {spread:.2g} spacings" if spread > 0.0 else ""))
    return f"the surface shows {' and '.join(parts)}, which is in the model" if parts else ""


class Window:
    """Blocks of a window with what the models need of them.

    `edges` is the power of the jump of the slope at the edges, by blocks of the frame: as it depends on the
    exponent and the spread, or in a fixed ratio to that of the blurred surface.
    """

    def __init__(self, frame: Frame, inside: Array, power: Array, edges: Edges | Array | None = None) -> None:
        self.frame, self.inside = frame, inside
        self.count, self.power = frame.count[inside], power[inside]
        self.number = float(self.count.sum())
        self.logs, self.squares = frame.logs[:, inside], frame.squares[inside]
        self.edges = edges.part(inside) if isinstance(edges, Edges) else None
        self.ratio = np.log1p(edges[inside]) if isinstance(edges, np.ndarray) else None
        self._parts: dict[str, Array] = {}

    def part(self, name: str) -> Array:
        """Return the blocks of an array of the frame."""
        if name not in self._parts:
            self._parts[name] = getattr(self.frame, name)[..., self.inside]
        return self._parts[name]

    @cached_property
    def lines(self) -> list[tuple[Array, Array]]:
        """Wavenumbers along each axis, in radian per spacing, and the place of each block among them."""
        pairs = (np.unique(w[self.inside], return_inverse=True) for w in self.frame.waves)
        return [(w * d, index) for (w, index), d in zip(pairs, self.frame.spacing, strict=True)]

    @cached_property
    def widths(self) -> tuple[Array, Array]:
        """Variances of the wavenumber in each block: see `Frame.variances`."""
        plain, weighted = self.frame.variances
        return plain[self.inside], weighted[self.inside]

    def signal(self, form: str, hurst: float, square: float) -> tuple[Array, Array, Array]:
        """Return the expected power without noise, and the derivatives of its logarithm by H and `square`."""
        value, slope = node_weights(hurst)
        logs, by_hurst = plain, plain_hurst = value @ self.logs, slope @ self.logs
        by_square: Array = np.zeros(logs.size)
        if form == TRANSFER:
            logs, by_square = logs - square * self.squares, -self.squares
        elif form == FILTER:
            for log, derivative in self._lattice_filter(square):
                logs, by_square = logs + log, by_square + derivative
        elif form in (BEFORE, BAND):
            density, density_slope = value @ self.part("densities"), slope @ self.part("densities")
            ratio, ratio_hurst, by_square = self._unaliased(form, hurst, square)
            logs, by_hurst = logs + ratio - density, by_hurst + ratio_hurst - density_slope
        if self.ratio is not None and form != NONE:
            logs = logs + self.ratio
        if form != NONE:
            mean, mean_hurst, mean_square = self._mean_in_blocks(hurst, square)
            logs, by_hurst, by_square = logs + mean, by_hurst + mean_hurst, by_square + mean_square
        if self.edges is not None and form != NONE:
            total = np.logaddexp(logs, plain + self.edges.logs(hurst, square))
            share = np.exp(logs - total)
            by_hurst = share * by_hurst + (1.0 - share) * (plain_hurst + self.edges.by_hurst)
            logs, by_square = total, share * by_square + (1.0 - share) * self.edges.by_square
        return np.exp(np.clip(logs, _LEAST_LOG, -_LEAST_LOG)), by_hurst, by_square

    def _mean_in_blocks(self, hurst: float, square: float) -> tuple[Array, Array, Array]:
        """Return the logarithm of the mean of a blurred block over its centre, beyond that of the plain one.

        To second order in the width of the block: the mean of q^(-2 H - axes) exp(-square q^2).
        """
        plain, weighted = self.widths
        slope = 2.0 * (2.0 * hurst + self.frame.axes) * weighted / self.squares - plain
        mean = square * slope + 2.0 * square**2 * weighted
        is_small = mean < _MOST_MEAN
        by_hurst, by_square = 4.0 * square * weighted / self.squares, slope + 4.0 * square * weighted
        return np.minimum(mean, _MOST_MEAN), by_hurst * is_small, by_square * is_small

    def _unaliased(self, form: str, hurst: float, square: float) -> tuple[Array, Array, Array]:
        """Return the logarithm of the spectral density of a blur before sampling, and derivatives."""
        power = hurst + 0.5 * self.frame.axes
        if form == BAND:
            logs = np.log(self.squares)
            return -power * logs - square * self.squares, -logs, -self.squares
        squares, logs = self.part("aliases"), self.part("alias_logs")
        if square > _NO_ALIASES:
            near = self.frame.near
            squares, logs = squares[near], logs[near]
        terms = np.exp(-power * logs - square * squares)
        total, by_hurst, by_square = terms.sum(0), -(terms * logs).sum(0), -(terms * squares).sum(0)
        if square <= _NO_ALIASES:
            tail = self.frame.tail(hurst, square)
            total, by_hurst, by_square = total + tail[0], by_hurst + tail[1], by_square + tail[2]
        total = np.maximum(total, np.exp(_LEAST_LOG))  # 0 for waves that the blur has removed
        return np.log(total), by_hurst / total, by_square / total

    def _lattice_filter(self, square: float) -> Iterator[tuple[Array, Array]]:
        """Yield the logarithm of the squared transfer function along each axis, and its derivative."""
        for (lines, index), spacing in zip(self.lines, self.frame.spacing, strict=True):
            variance = max(square, 1e-3) / spacing**2
            k = np.arange(1, int(4.0 * np.sqrt(variance) + 8.5))
            weights = np.exp(-k * k / (2.0 * variance))
            rates = weights * k * k / (2.0 * variance**2)
            cosines = np.cos(np.outer(lines, k))
            total, total_rate = 1.0 + 2.0 * weights.sum(), 2.0 * rates.sum()
            transfer = (1.0 + 2.0 * cosines @ weights) / total
            rate = (2.0 * cosines @ rates - transfer * total_rate) / total
            transfer = np.where(np.abs(transfer) < 1e-12, 1e-12, transfer)
            yield 2.0 * np.log(np.abs(transfer))[index], (2.0 * rate / transfer / spacing**2)[index]


@dataclass(frozen=True)
class Edges:
    """Power of the jump of the slope at the edges, over that of the surface before the blur, by blocks.

    The logarithm is nearly linear in the exponent and in the squared spread.

    Attributes
    ----------
    hurst, square : float
        Where the power is exact.
    log, by_hurst, by_square : ndarray, shape (blocks,)
        Its logarithm there, and derivatives.
    """

    hurst: float
    square: float
    log: Array
    by_hurst: Array
    by_square: Array

    @classmethod
    def of(cls, frame: Frame, hurst: float, square: float) -> Edges:
        """Return the power near an exponent and a squared spread."""
        step, wider = _STEP, _STEP * square
        here = np.log(_jump(frame, hurst, square))
        by_hurst = (np.log(_jump(frame, hurst + step, square)) - here) / step
        return cls(
            hurst, square, here, by_hurst, (np.log(_jump(frame, hurst, square + wider)) - here) / wider
        )

    def part(self, inside: Array) -> Edges:
        """Return some of the blocks."""
        log, by_hurst, by_square = (a[inside] for a in (self.log, self.by_hurst, self.by_square))
        return Edges(self.hurst, self.square, log, by_hurst, by_square)

    def logs(self, hurst: float, square: float) -> Array:
        """Return the logarithm of the power."""
        change = (hurst - self.hurst) * self.by_hurst + (square - self.square) * self.by_square
        return np.asarray(self.log + change)


def edge_power(frame: Frame, hurst: float, square: float) -> Array:
    """Return the power of the jump of the slope at the edges, over that of the blurred surface."""
    return np.asarray(_jump(frame, hurst, square) * np.exp(np.minimum(square * frame.squares, -_LEAST_LOG)))


def _jump(frame: Frame, hurst: float, square: float) -> Array:
    """Return the power of the jump of the slope at the edges, over that of the surface before the blur.

    Reflected at an edge, heights of slope g have modes of the power 4 <g^2> / (n q^4) along the normal.
    <g^2> of the waves of one wavenumber along the edge is an integral of the spectral density over those
    across it. Waves longer than the blur have the same jump without blur, which is in the table.
    """
    p = np.exp(np.linspace(-6.0, np.log(np.pi), 240))
    power = hurst + 0.5 * frame.axes
    total = np.zeros(frame.squares.size)
    for axis, (n, d) in enumerate(zip(frame.shape, frame.spacing, strict=True)):
        across = frame.waves[axis]
        along, index = (
            np.unique(frame.waves[1 - axis], return_inverse=True) if frame.axes == 2 else (np.zeros(1), 0)
        )
        radius = p**2 + along[:, None] ** 2
        slopes = np.trapezoid(p**2 * radius**-power * np.exp(-square * radius), p, axis=1) / np.pi
        total += 4.0 * slopes[index] / (n * d * across**4) * -np.expm1(-square * across**2)
    return np.asarray(np.maximum(total * frame.squares**power, _LEAST_JUMP))


def plain_power(frame: Frame, hurst: float) -> Array:
    """Return the expected power of the surface before the blur."""
    return np.asarray(np.exp(node_weights(hurst)[0] @ frame.logs))
