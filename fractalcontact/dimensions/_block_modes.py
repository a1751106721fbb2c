"""The modes of a large surface with free edges in blocks, complete or with gaps, as they are fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from fractalcontact.dimensions._cosine_modes import (
    GappedModes,
    Lattice,
    expected_power,
    mode_power,
    relative_excess,
    relative_white_excess,
)
from fractalcontact.dimensions._harmonic_interpolation import Filling
from fractalcontact.dimensions._mode_blocks import LOWEST, SMOOTH, block_starts, block_weights, summed
from fractalcontact.dimensions._surface_input import Scales, between
from fractalcontact.dimensions._whittle import CHI_SQUARE, UNEVEN, WhittleFit, fit_from_starts

Array = np.ndarray[Any, np.dtype[Any]]

_SMOOTHEST = 1.1  # exponent up to which the effect of gaps is found
_FAR = 0.03  # change of H beyond which the effect of gaps is found again
_MODERATE = 0.15  # share of missing points up to which one probe is enough
_BORDER = 0.95  # the same for the share of the border that was observed
_STEEP = 0.7  # exponent up to which one probe is enough in any case
_MANY = 0.3  # the same for the standard error of a surface of fewer points


@dataclass(frozen=True)
class BlockGaps:
    """The effect of missing points on the modes of a large surface, block by block.

    Attributes
    ----------
    lattice : Lattice
    filling : Filling
    starts, count : as in `Frame`, for all blocks
    chosen : ndarray of bool
        Blocks that are fitted.
    pilot : float
        An exponent near that of the surface.
    """

    lattice: Lattice
    filling: Filling
    starts: tuple[Array, Array]
    count: Array
    chosen: Array
    pilot: float

    @cached_property
    def missing(self) -> float:
        """Share of missing points."""
        return 1.0 - float(np.mean(self.filling.observed))

    def probes(self, hurst: float) -> int:
        """Return how many random sign patterns scatter by at most a third of the standard error of H.

        One is enough but for large gaps, and gaps at the border, of a smooth surface.
        """
        observed = self.filling.observed
        border = (observed[0], observed[-1], observed[:, 0], observed[:, -1])
        is_large = self.missing > _MODERATE or np.mean(np.concatenate(border)) < _BORDER
        return 2 if is_large and hurst > _STEEP else 1

    def excess(self, hurst: float) -> Array:
        """Return the excess of the expected power over that of the complete surface."""
        return self._mean(relative_excess(self.lattice, self.filling, hurst, self.probes(hurst)))

    @cached_property
    def white(self) -> Array:
        """Excess of the expected power of white noise."""
        return self._mean(relative_white_excess(self.filling, self.probes(self.pilot)))

    def _mean(self, values: Array) -> Array:
        return np.asarray((_sums(values, self.starts) / self.count)[self.chosen])

    def error(self, fit: WhittleFit) -> float:
        """Return the standard error of H by the sandwich formula, see `_cosine_modes.FreeModes.error`."""
        hurst = float(np.clip(fit.hurst, LOWEST, SMOOTH))
        gapped = GappedModes(self.lattice, self.filling.observed, hurst, 1, self.filling)
        reference = gapped.reference_power()
        rows = np.zeros((len(fit.columns), *self.count.shape))
        rows[:, self.chosen] = fit.columns / fit.total
        for axis, starts in enumerate(self.starts):
            rows = np.repeat(rows, np.diff(starts), axis=axis + 1)
        meat = 0.25 * gapped.score_covariance(rows * reference, hurst, fit.noise / fit.amplitude)
        bread = np.linalg.inv(fit.bread)
        square = float((bread @ meat @ bread.T)[1, 1])
        return float(np.sqrt(square)) if square > 0 else float("nan")


@dataclass(frozen=True)
class BlockModes:
    """Modes of a large surface with free edges, block by block (a `_whittle.Modes`).

    Attributes
    ----------
    power, logs, count : ndarray, shape (blocks,)
        Mean square of the modes of a block, mean logarithm of their squares, and their number.
    order, sector : ndarray, shape (blocks,)
        Wavelength in spacings of x, and whether the wave runs steeper along y than along x.
    model : callable
        Hurst exponent to the expected power.
    """

    power: Array
    logs: Array
    count: Array
    order: Array
    sector: Array
    model: Callable[[float], Array]
    gaps: BlockGaps | None = None

    @classmethod
    def of_gapped(
        cls, heights: Array, spacing: tuple[float, float], scales: Scales, pilot: float
    ) -> BlockModes:
        """Fill a surface and collect its modes; `pilot` is an exponent near its own."""
        observed = np.isfinite(heights)
        filling, values = Filling(observed, spacing), heights[observed]
        modes = cls.of(mode_power(filling(values - values.mean())), spacing, None)
        shape = heights.shape[0], heights.shape[1]
        starts = block_starts(shape[0], 1), block_starts(shape[1], 1)
        blocks = starts[0].size - 1, starts[1].size - 1
        chosen = between(modes.order, scales)
        gaps = BlockGaps(
            Lattice.of(shape, spacing),
            filling,
            starts,
            modes.count.reshape(blocks),
            chosen.reshape(blocks),
            float(np.clip(pilot, LOWEST, _SMOOTHEST)),
        )
        return replace(modes.part(chosen), gaps=gaps)

    @classmethod
    def of(cls, power: Array, spacing: tuple[float, float], scales: Scales) -> BlockModes:
        """Collect squared modes, which are overwritten; `scales` is a window of wavelengths in x spacings."""
        ny, nx = (n + 1 for n in power.shape)
        starts = block_starts(ny, 1), block_starts(nx, 1)
        centres = [(s[:-1] + s[1:] - 1) // 2 for s in starts]
        least = 1e-12 * float(power.mean())
        means, logs = (
            _sums(values, starts) for values in (power, np.log(np.maximum(power, least, out=power)))
        )
        count = np.outer(*(np.diff(s) for s in starts)).astype(float)
        along_y, along_x = (np.pi * k / (n * d) for k, n, d in zip(centres, (ny, nx), spacing, strict=True))
        order = 2.0 * np.pi / np.hypot(along_y[:, None], along_x)
        chosen = between(order, scales)
        expected = summed((ny, nx), spacing, [block_weights(n) for n in (ny, nx)])

        @lru_cache(maxsize=8)  # the nodes of the likelihood, which gaps need as well
        def model(hurst: float) -> Array:
            if hurst > SMOOTH:  # sums over the covariance cancel
                lattice = Lattice.of((ny, nx), spacing)
                return np.asarray(expected_power(lattice, hurst)[np.ix_(*(c - 1 for c in centres))][chosen])
            return np.asarray(expected(hurst)[chosen])

        return cls(
            power=(means / count)[chosen],
            logs=(logs / count)[chosen],
            count=count[chosen],
            order=order[chosen],
            sector=(along_y[:, None] > along_x)[chosen],
            model=model,
        )

    @property
    def number(self) -> float:
        """Number of modes."""
        return float(self.count.sum())

    def scatter(self, fit: WhittleFit) -> float:
        """Return z of the flatness; 0 with gaps, whose effect on it is only estimated."""
        if self.gaps is not None:
            return 0.0
        ratio = self.power / fit.total
        mean = float(np.average(ratio, weights=self.count))
        logs = float(np.average(self.logs - np.log(fit.total), weights=self.count)) - np.log(mean)
        return float((logs - CHI_SQUARE[0]) * np.sqrt(self.number / CHI_SQUARE[1]))

    def part(self, chosen: Array) -> BlockModes:
        """Return some of the blocks."""
        model, gaps = self.model, self.gaps
        if gaps is not None:
            of_all = np.zeros_like(gaps.chosen)
            of_all[gaps.chosen] = chosen
            gaps = replace(gaps, chosen=of_all)
        return BlockModes(
            power=self.power[chosen],
            logs=self.logs[chosen],
            count=self.count[chosen],
            order=self.order[chosen],
            sector=self.sector[chosen],
            model=lambda hurst: model(hurst)[chosen],
            gaps=gaps,
        )

    def fit(self, start: float, noise: bool) -> WhittleFit:
        """Fit from a pilot estimate; with noise from two starts, of which the better end is returned.

        What gaps add is a share of the expected power that hardly depends on H. It is found at a pilot
        estimate, and again where the fit is far from that.
        """
        fit = partial(fit_from_starts, self.power, self.model, noise=noise, weights=self.count)
        if self.gaps is None:
            return fit(start)
        white = self.gaps.white if noise else None
        pilot = self.gaps.pilot
        for _ in range(2):
            share = self.gaps.excess(pilot)
            excess = partial(_scaled, self.model, share)
            result = fit(start, gaps=excess, white_excess=white)
            nearest = float(np.clip(result.hurst, LOWEST, _SMOOTHEST))
            if abs(nearest - pilot) < _FAR:
                break
            pilot = nearest
        return result

    def error(self, fit: WhittleFit) -> float:
        """Return the standard error of H, see `_cosine_modes.FreeModes.error`."""
        missing = 0.0 if self.gaps is None else self.gaps.missing
        if self.gaps is not None and missing > _MANY:
            return self.gaps.error(fit)
        correlation = 1.01 + 0.02 * float(np.clip(fit.hurst, 0.0, 1.0))
        return fit.standard_error * correlation / float(np.sqrt(1.0 - missing))

    def is_uneven(self, inside: Array, hurst: float) -> bool:
        """Return whether few waves of some blocks carry more than their share."""
        part = self.part(inside)
        expected = part.model(hurst)
        mean = float(np.average(part.power / expected, weights=part.count))
        logs = float(np.average(part.logs - np.log(expected), weights=part.count)) - np.log(mean)
        return bool((logs - CHI_SQUARE[0]) * np.sqrt(part.number / CHI_SQUARE[1]) < -UNEVEN)


def _scaled(model: Callable[[float], Array], share: Array, hursts: tuple[float, ...]) -> list[Array]:
    """Return a share of the expected power at each exponent."""
    return [share * model(hurst) for hurst in hursts]


def _sums(values: Array, starts: tuple[Array, Array]) -> Array:
    """Sum modes (ny - 1, nx - 1) over blocks."""
    rows = np.add.reduceat(values, starts[0][:-1] - 1, axis=0)
    return np.asarray(np.add.reduceat(rows, starts[1][:-1] - 1, axis=1))
