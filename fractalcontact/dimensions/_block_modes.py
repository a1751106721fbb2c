"""The modes of a large surface with free edges in blocks, complete or with gaps, as they are fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._cosine_modes import Lattice, expected_power, mode_power
from fractalcontact.dimensions._gapped_modes import (
    GappedModes,
    approximate_excess,
    relative_excess,
    relative_white_excess,
    with_lines,
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
_FINE = 1 << 20  # points from which on modes beside gaps are taken as independent, but for the border
_COARSE = 1 << 18  # points of the lattice on which the effect of gaps near the border is found
_FEWEST = 128  # along its shorter side
_COARSE_PROBES = 2
_SETTLED = 0.25  # share of the highest mode of the coarse lattice from which on the effect falls as 1 / k


@dataclass(frozen=True)
class BlockGaps:
    """The effect of missing points on the modes of a large surface, block by block.

    Attributes
    ----------
    spacing : tuple of float
        (dy / dx, 1)
    filling : Filling
    starts, count : as in `Frame`, for all blocks
    chosen : ndarray of bool
        Blocks that are fitted.
    pilot : float
        An exponent near that of the surface.
    model : callable
        Hurst exponent to the expected power of all blocks of the complete surface.
    """

    spacing: tuple[float, float]
    filling: Filling
    starts: tuple[Array, Array]
    count: Array
    chosen: Array
    pilot: float
    model: Callable[[float], Array]

    @cached_property
    def lattice(self) -> Lattice:
        """Distances on the lattice."""
        return Lattice.of(self.filling.observed.shape, self.spacing)

    @cached_property
    def coarse_shape(self) -> tuple[int, int] | None:
        """Shape of a coarser lattice for the effect of gaps near the border; None if this is small."""
        shape = self.filling.observed.shape
        step = np.sqrt(self.count.sum() / _COARSE)
        if self.count.sum() < _FINE or min(shape) < step * _FEWEST:
            return None
        ny, nx = (fft.fast_length(int(n / step)) for n in shape)
        return ny, nx

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
        """Return the excess of the expected power over that of the complete surface.

        That of a large surface is found for independent modes. They are wrong near the border of the
        surface, and so for gaps there; the difference is found on a coarser lattice. It depends on the number
        of the mode, and not on the size of the surface.
        """
        if self.coarse_shape is None:
            return self._mean(relative_excess(self.lattice, self.filling, hurst, self.probes(hurst)))
        # the fit has its first node there, up to a rounding of its logarithm: the model is at hand
        blocks = self.model(float(np.exp(np.log(hurst)))).reshape(self.count.shape)
        power = with_lines(_in_each_mode(blocks, self.starts), self.spacing, hurst)
        approximate = _means(approximate_excess(power, self.filling, self.probes(hurst)), self.starts)
        return np.asarray((approximate + self._beside_border(self.coarse_shape, hurst))[self.chosen])

    def _beside_border(self, shape: tuple[int, int], hurst: float) -> Array:
        """Return the excess of each block beyond that of independent modes, from a coarser lattice."""
        fine = self.filling.observed
        observed = _coarser(fine, shape)
        if observed.all() or not observed.any():
            return np.zeros(self.count.shape)
        steps = [n / m for n, m in zip(fine.shape, shape, strict=True)]
        spacing = self.spacing[0] * steps[0] / steps[1], 1.0
        lattice, filling = Lattice.of(shape, spacing), Filling(observed, spacing)
        power = with_lines(expected_power(lattice, hurst), spacing, hurst)
        excess = relative_excess(lattice, filling, hurst, _COARSE_PROBES)
        excess -= approximate_excess(power, filling, _COARSE_PROBES)
        starts = block_starts(shape[0], 1), block_starts(shape[1], 1)
        return _extended(_means(excess, starts), starts, self.starts)

    @cached_property
    def white(self) -> Array:
        """Excess of the expected power of white noise."""
        return self._mean(relative_white_excess(self.filling, self.probes(self.pilot)))

    def _mean(self, values: Array) -> Array:
        return np.asarray(_means(values, self.starts)[self.chosen])

    def error(self, fit: WhittleFit) -> float:
        """Return the standard error of H by the sandwich formula, see `_free_edges.FreeModes.error`."""
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
        cls,
        heights: Array,
        spacing: tuple[float, float],
        scales: Scales,
        pilot: float,
        filling: Filling | None = None,
    ) -> BlockModes:
        """Fill a surface and collect its modes; `pilot` is an exponent near its own."""
        observed = np.isfinite(heights)
        filling = Filling(observed, spacing) if filling is None else filling
        modes = cls.of(mode_power(filling(heights - heights[observed].mean())), spacing, None)
        shape = heights.shape[0], heights.shape[1]
        starts = block_starts(shape[0], 1), block_starts(shape[1], 1)
        blocks = starts[0].size - 1, starts[1].size - 1
        chosen = between(modes.order, scales)
        gaps = BlockGaps(
            spacing,
            filling,
            starts,
            modes.count.reshape(blocks),
            chosen.reshape(blocks),
            float(np.clip(pilot, LOWEST, _SMOOTHEST)),
            modes.model,
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
        """Return the standard error of H, see `_free_edges.FreeModes.error`."""
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


def _means(values: Array, starts: tuple[Array, Array]) -> Array:
    """Average modes (ny - 1, nx - 1) over blocks."""
    return np.asarray(_sums(values, starts) / np.outer(*(np.diff(s) for s in starts)))


def _centres(starts: Array) -> Array:
    return (starts[:-1] + starts[1:] - 1) // 2


def _in_each_mode(power: Array, starts: tuple[Array, Array]) -> Array:
    """Interpolate the power of blocks, which is near a power law, at every mode: (ny - 1, nx - 1)."""
    along_y, along_x = (_interpolation(s) for s in starts)
    result = along_y @ (np.log(power) @ along_x.T)
    return np.asarray(np.exp(result, out=result))


def _interpolation(starts: Array) -> Array:
    """Return the weights of the blocks along an axis in linear interpolation by ln k: (modes, blocks)."""
    logs, centres = np.log(np.arange(1, starts[-1])), np.log(_centres(starts))
    below = np.clip(np.searchsorted(centres, logs, "right") - 1, 0, centres.size - 2)
    share = (logs - centres[below]) / np.diff(centres)[below]
    weights = np.zeros((logs.size, centres.size))
    weights[np.arange(logs.size), below] = 1.0 - share
    weights[np.arange(logs.size), below + 1] = share
    return weights


def _coarser(observed: Array, shape: tuple[int, int]) -> Array:
    """Return the points of a coarser lattice of whose cells at least half was observed."""
    first = [np.arange(m) * n // m for n, m in zip(observed.shape, shape, strict=True)]
    rows = np.add.reduceat(observed, first[0], axis=0, dtype=np.int32)
    size = np.outer(*(np.diff(f, append=n) for f, n in zip(first, observed.shape, strict=True)))
    return np.asarray(2 * np.add.reduceat(rows, first[1], axis=1) >= size)


def _extended(values: Array, coarse: tuple[Array, Array], fine: tuple[Array, Array]) -> Array:
    """Return values of the blocks of a coarse lattice for those of a fine one.

    The same modes up to a share of the highest one; beyond, those of fewer waves along the same direction,
    divided by how many times fewer, so that the highest modes meet.
    """
    modes, known = [_centres(s) for s in fine], [_centres(s) for s in coarse]
    steps = [f[-1] / c[-1] for f, c in zip(fine, coarse, strict=True)]
    height = np.maximum(*np.meshgrid(*(k / s[-1] for k, s in zip(modes, fine, strict=True)), indexing="ij"))
    step = float(np.sqrt(steps[0] * steps[1]))
    least = _SETTLED / step
    times = step ** np.clip(np.log(height / least) / np.log(1.0 / least), 0.0, 1.0)
    places = [
        np.interp(k / times, c, np.arange(c.size))
        for k, c in zip((modes[0][:, None], modes[1]), known, strict=True)
    ]
    (y, x), (lower_y, lower_x) = places, (p.astype(int) for p in places)
    share_y, share_x = y - lower_y, x - lower_x
    upper_y, upper_x = (
        np.minimum(i + 1, m - 1) for i, m in zip((lower_y, lower_x), values.shape, strict=True)
    )
    below = (1.0 - share_x) * values[lower_y, lower_x] + share_x * values[lower_y, upper_x]
    above = (1.0 - share_x) * values[upper_y, lower_x] + share_x * values[upper_y, upper_x]
    return np.asarray(((1.0 - share_y) * below + share_y * above) / times)
