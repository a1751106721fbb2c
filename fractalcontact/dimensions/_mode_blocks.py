"""Blocks of cosine modes of neighbouring wavenumbers, and their expected power for every Hurst exponent.

The expected power of the modes of a fractional Brownian surface is smooth, so that modes of nearly the same
wavenumber can be taken together: their mean square and their number hold what the likelihood needs. A fit
then costs the same for every size of the surface. The logarithm of the expected power is tabulated over
Hurst exponents, once for each shape, and interpolated by a polynomial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

LOWEST, HIGHEST = 0.01, 1.2  # range of Hurst exponents
_OFFSET = 0.1  # the table is interpolated in ln(H + offset), which is smoother than in H
_DEGREE = 11  # of the polynomial: the error of the expected power is then below 3e-4
_ANGLES = (np.arange(_DEGREE + 1) + 0.5) * np.pi / (_DEGREE + 1)
_FIRST, _LAST = np.log(LOWEST + _OFFSET), np.log(HIGHEST + _OFFSET)
NODES = np.exp(0.5 * (_FIRST + _LAST) - 0.5 * (_LAST - _FIRST) * np.cos(_ANGLES)) - _OFFSET
SMOOTH = 1.3  # exponent up to which the sums over the covariance are exact enough
_PER = 12  # inverse relative width of a block
LARGEST = 1024  # points along an axis up to which the table is summed over the lattice
_ALIASES = 2  # aliases along each axis that are summed one by one
_LEAST_SQUARE = 1e-30  # of wavenumbers
SLOW, SUDDEN, HIGH_PASS, LEAKY = "slow", "sudden", "high-pass", "leaky high-pass"  # forms of a roll-off
_INVERSE = np.linalg.inv(np.polynomial.chebyshev.chebvander(-np.cos(_ANGLES), _DEGREE))


def node_weights(hurst: float) -> tuple[Array, Array]:
    """Return the weights of the nodes in polynomial interpolation, and their derivatives by H."""
    angle = float(
        np.arccos(np.clip((2.0 * np.log(hurst + _OFFSET) - _FIRST - _LAST) / (_LAST - _FIRST), -1.0, 1.0))
    )
    order = np.arange(_DEGREE + 1)
    sine = np.sin(angle)
    slopes = order * np.sin(order * angle) / sine if sine > 1e-9 else np.cos(angle) ** (order + 1) * order**2
    return np.cos(order * angle) @ _INVERSE, slopes @ _INVERSE * (
        2.0 / ((_LAST - _FIRST) * (hurst + _OFFSET))
    )


@dataclass(frozen=True)
class Frame:
    """Blocks of the modes of one lattice.

    Attributes
    ----------
    shape : tuple of int
        (ny, nx), or (n,) of a profile.
    spacing : tuple of float
        Over that of x.
    starts : tuple of ndarray
        First mode of each block along each axis, counted from 1; the number of points at the end.
    index : tuple of ndarray, shape (blocks,)
        Number of each block along each axis. Where both axes are alike, two mirrored blocks are one.
    count : ndarray, shape (blocks,)
        Modes in each block; beside gaps, so many independent ones as have its information.
    waves : tuple of ndarray, shape (blocks,)
        Wavenumber along each axis at the centre, rad per spacing of x.
    logs : ndarray, shape (nodes, blocks)
        Logarithm of the expected power of fractional Brownian heights.
    images : int
        Aliases along each axis that are summed one by one; 0 if there are no waves beyond the sampling.
    share : ndarray, shape (blocks,), or float
        Information of a mode over that of one of a complete surface.
    """

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    starts: tuple[Array, ...]
    index: tuple[Array, ...]
    count: Array
    waves: tuple[Array, ...]
    logs: Array
    images: int = _ALIASES
    share: Array | float = 1.0

    @property
    def axes(self) -> int:
        """Number of axes: 1 for a profile."""
        return len(self.shape)

    @property
    def modes(self) -> Array:
        """Number of modes in each block."""
        return np.asarray(self.count / self.share)

    @cached_property
    def squares(self) -> Array:
        """Squared wavenumber at the centre of each block."""
        return np.asarray(sum(w * w for w in self.waves))

    @cached_property
    def variances(self) -> tuple[Array, Array]:
        """Variance of the wavenumber in each block, summed over the axes: itself, and times its square."""
        plain, weighted = np.zeros(self.count.size), np.zeros(self.count.size)
        for starts, i, n, d, w in zip(
            self.starts, self.index, self.shape, self.spacing, self.waves, strict=True
        ):
            variance = (np.diff(starts)[i] ** 2 - 1.0) / 12.0 * (np.pi / (n * d)) ** 2
            plain, weighted = plain + variance, weighted + variance * w**2
        return plain, weighted

    @cached_property
    def aliases(self) -> Array:
        """Squared wavenumbers of the blocks and of their nearest aliases: (aliases, blocks)."""
        return alias_squares(self.waves, self.spacing, self.images)

    @cached_property
    def alias_logs(self) -> Array:
        """Logarithms of `aliases`."""
        return np.asarray(np.log(self.aliases))

    @cached_property
    def near(self) -> Array:
        """Indices of the aliases at most one period away along each axis."""
        offsets = np.arange(-self.images, self.images + 1)
        steps = np.abs(np.stack(np.meshgrid(*[offsets] * self.axes, indexing="ij"))).max(axis=0).ravel()
        return np.flatnonzero(steps <= 1)

    @cached_property
    def tail_start(self) -> Array:
        """Wavenumbers, one for each of some azimuths, beyond which aliases are summed as an integral."""
        edge = (2 * self.images + 1) * np.pi
        if self.axes == 1:
            return np.array([edge])
        angle = (np.arange(16) + 0.5) / 16 * np.pi / 2
        return np.asarray(edge / np.maximum(np.sin(angle) * self.spacing[0], np.cos(angle)))

    @cached_property
    def densities(self) -> Array:
        """Logarithm of the aliased spectral density at the nodes: (nodes, blocks)."""
        near = np.exp(-(NODES[:, None, None] + 0.5 * self.axes) * self.alias_logs)
        tails = np.array([self.tail(h, 0.0)[0] for h in NODES])
        return np.asarray(np.log(near.sum(axis=1) + tails[:, None]))

    @cached_property
    def unaliased(self) -> Frame:
        """The same blocks of surfaces that have no waves beyond the sampling, and so no aliases."""
        bare = replace(self, images=0)
        return replace(bare, logs=self.logs - self.densities + bare.densities)

    def tail(self, hurst: float, square: float) -> tuple[float, float, float]:
        """Return the power of far aliases under a Gaussian blur, and its derivatives by H and `square`."""
        if not self.images:
            return 0.0, 0.0, 0.0
        x = np.linspace(0.0, 20.0, 80)
        start = self.tail_start[:, None]
        q = start * np.exp(x)
        measure = self.spacing[0] / (2.0 * np.pi) if self.axes == 2 else 1.0 / np.pi
        if square <= 0.0:
            powers, logs = start[:, 0] ** (-2.0 * hurst), np.log(start[:, 0])
            total = 0.5 * measure * float(np.mean(powers)) / hurst
            change = -0.5 * measure * float(np.mean(powers * (2.0 * logs + 1.0 / hurst))) / hurst
            return total, change, 0.0
        value = measure * q ** (-2.0 * hurst) * np.exp(-square * q * q)
        weights = (value, -2.0 * np.log(q) * value, -q * q * value)
        power, slope, fall = (float(np.mean(np.trapezoid(w, x, axis=1))) for w in weights)
        return power, slope, fall

    def rolled_densities(
        self, hurst: float, square: float, form: str = SLOW, leak: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Return the logarithm of the density (q^2 + square)^(-H - axes / 2), and two derivatives.

        Aliases are included. The derivatives are those by H and by the logarithm of `square`. A `SUDDEN`
        density is that of the larger of q^2 and `square`; a `HIGH_PASS` one is that of sampled heights less
        their Gaussian filter, see `passed`.
        """
        if form in (HIGH_PASS, LEAKY):
            logs, by_hurst, _ = self.rolled_densities(hurst, 0.0)
            passed, by_square, _ = self.passed(square, leak)
            return logs + passed, by_hurst, by_square
        is_sharp = form == SUDDEN
        squares = np.maximum(self.aliases, square) if is_sharp else self.aliases + square
        squares = np.maximum(squares, _LEAST_SQUARE)
        share = np.where(self.aliases < square, 1.0, 0.0) if is_sharp else square / squares
        power = hurst + 0.5 * self.axes
        logs = np.log(squares)
        terms = np.exp(-power * logs)
        total, by_hurst = terms.sum(0), -(terms * logs).sum(0)
        by_square = -power * (terms * share).sum(0)
        if self.images:
            start = self.tail_start**2 + (0.0 if is_sharp else square)
            measure = self.spacing[0] / (2.0 * np.pi) if self.axes == 2 else 1.0 / np.pi
            tails = 0.5 * measure / hurst * start**-hurst
            total = total + tails.mean()
            by_hurst = by_hurst - np.mean(tails * (np.log(start) + 1.0 / hurst))
            by_square = by_square - (0.0 if is_sharp else hurst * square * np.mean(tails / start))
        return np.log(total), by_hurst / total, by_square / total

    def passed(self, square: float, leak: float = 0.0) -> tuple[Array, Array, Array]:
        """Return the logarithm of the squared transfer function (1 - (1 - leak) 2^(-q^2 / square))^2.

        Without a leak it is the Gaussian high-pass filter of ISO 16610-61, its cut-off 2 pi / sqrt(square).
        Also the derivatives by the logarithms of `square` and of `leak`.
        """
        ratio = np.log(2.0) * np.maximum(self.squares, _LEAST_SQUARE) / square
        low = np.exp(-ratio)
        amplitude = -np.expm1(-ratio) + leak * low
        return (
            2.0 * np.log(amplitude),
            2.0 * (leak - 1.0) * low * ratio / amplitude,
            2.0 * leak * low / amplitude,
        )

    def mean(self, values: Array) -> Array:
        """Average the modes of each block: shape (modes along each axis from 1) to (blocks,)."""
        for axis, starts in enumerate(self.starts):
            values = np.add.reduceat(values, starts[:-1] - starts[0], axis=axis)
        total = values[self.index]
        if self.is_mirrored:
            total = total + np.where(self.index[0] == self.index[1], 0.0, values[self.index[::-1]])
        return np.asarray(total / self.modes)

    def weakened(self, share: Array) -> Frame:
        """Return the same blocks with less information; `share` is given for each mode, as in `mean`."""
        of_blocks = self.mean(share)
        return replace(self, count=self.count * of_blocks, share=of_blocks)

    @property
    def is_mirrored(self) -> bool:
        """Whether mirrored blocks are taken together."""
        return _is_mirrored(self.shape, self.spacing)


def alias_squares(waves: tuple[Array, ...], spacing: tuple[float, ...], images: int) -> Array:
    """Return the squared wavenumbers of waves and of their aliases: (aliases, blocks)."""
    offsets = 2.0 * np.pi * np.arange(-images, images + 1)
    lines = [(w + offsets[:, None] / d) ** 2 for w, d in zip(waves, spacing, strict=True)]
    if len(lines) == 1:
        return np.asarray(lines[0])
    return np.asarray((lines[0][:, None] + lines[1]).reshape(-1, lines[0].shape[1]))


@lru_cache(maxsize=8)
def frame(shape: tuple[int, ...], spacing: tuple[float, ...]) -> Frame:
    """Divide the modes of a lattice into blocks and tabulate their expected power."""
    starts = tuple(block_starts(n, 2 if len(shape) == 1 else 1) for n in shape)
    centres = [(s[:-1] + s[1:] - 1) // 2 for s in starts]
    sizes = tuple(c.size for c in centres)
    index = (
        np.triu_indices(sizes[0])
        if _is_mirrored(shape, spacing)
        else np.unravel_index(range(np.prod(sizes)), sizes)
    )
    count = np.prod([np.diff(s)[i] for s, i in zip(starts, index, strict=True)], axis=0).astype(float)
    if _is_mirrored(shape, spacing):
        count[index[0] != index[1]] *= 2.0
    waves = _waves(shape, spacing, [c[i] for c, i in zip(centres, index, strict=True)])
    if len(shape) == 1:
        logs = np.log(_profile_power(shape[0]))[:, centres[0] - 2]
    elif min(shape) <= LARGEST:
        power = _power_at(shape, spacing, centres)[:, index[0], index[1]]
        logs = _logarithm(power, Frame(shape, spacing, starts, index, count, waves, count))
    else:
        logs = (
            _extrapolated(shape, spacing, centres, index)
            + Frame(shape, spacing, starts, index, count, waves, count).densities
        )
    return Frame(shape, spacing, starts, index, count, waves, logs)


def _logarithm(power: Array, frame: Frame) -> Array:
    """Return the logarithm of expected power at the nodes: (nodes, blocks).

    Where spacings differ ten thousandfold, sums over the covariance cancel and may end below zero. The power
    over the spectral density is then taken from the other blocks.
    """
    if power.min() > 0.0:
        return np.asarray(np.log(power))
    ratio = np.log(np.where(power > 0.0, power, np.nan)) - frame.densities
    return np.asarray(np.where(power > 0.0, ratio, np.nanmedian(ratio, axis=1)[:, None]) + frame.densities)


def _extrapolated(shape: tuple[int, ...], spacing: tuple[float, ...], centres: Any, index: Any) -> Array:
    """Return the logarithm of the expected power over the spectral density for a large surface.

    Beyond the first modes they differ by a factor that depends on the number of the mode, and so little on
    the size that a smaller lattice gives it.
    """
    factor = LARGEST / min(shape)
    small = tuple(round(n * factor) for n in shape)
    ends = [np.minimum(c, LARGEST // 2) for c in centres]
    unique = [np.unique(e) for e in ends]
    grid = np.unravel_index(range(unique[0].size * unique[1].size), (unique[0].size, unique[1].size))
    waves = _waves(small, spacing, [u[i] for u, i in zip(unique, grid, strict=True)])
    table = Frame(small, spacing, (), grid, np.empty(0), waves, np.empty(0))
    power = _power_at(small, spacing, unique).reshape(NODES.size, -1)
    ratio = (_logarithm(power, table) - table.densities).reshape(NODES.size, *(u.size for u in unique))
    places = [np.searchsorted(u, e)[i] for u, e, i in zip(unique, ends, index, strict=True)]
    return np.asarray(ratio[:, places[0], places[1]])


def _waves(shape: tuple[int, ...], spacing: tuple[float, ...], modes: Any) -> tuple[Array, ...]:
    """Return the wavenumbers of numbered modes along each axis."""
    return tuple(np.pi * k / (n * d) for k, n, d in zip(modes, shape, spacing, strict=True))


def _is_mirrored(shape: tuple[int, ...], spacing: tuple[float, ...]) -> bool:
    return len(shape) == 2 and shape[0] == shape[1] and spacing[0] == spacing[1]


def block_starts(n: int, first: int) -> Array:
    """Return the first mode of each block along an axis; odd widths have a mode at their centre."""
    starts = [first]
    while starts[-1] < n:
        width = min(max(1, starts[-1] // _PER), n - starts[-1])
        starts.append(starts[-1] + width - (width % 2 == 0))
    return np.array(starts)


def _power_at(shape: tuple[int, ...], spacing: tuple[float, ...], modes: Any) -> Array:
    """Return the expected power of some modes of a surface at the nodes: (nodes, rows, columns)."""
    expected = expected_power_at(shape, spacing, modes)
    return np.stack([expected(hurst) for hurst in NODES])


def expected_power_at(
    shape: tuple[int, ...], spacing: tuple[float, ...], modes: Any
) -> Callable[[float], Array]:
    """Return a function of H: the expected power of the modes of given numbers, (rows, columns)."""
    return summed(shape, spacing, [_weights(n, k) for n, k in zip(shape, modes, strict=True)])


def lattice_power(frame: Frame, covariance: Array) -> Array:
    """Return the expected power of the blocks of a surface from its covariance at the lags (ny, nx)."""
    centres = [(s[:-1] + s[1:] - 1) // 2 for s in frame.starts]
    along_y, along_x = (_weights(n, k) for n, k in zip(frame.shape, centres, strict=True))
    return np.asarray((along_y @ covariance @ along_x.T)[frame.index])


def summed(shape: tuple[int, ...], spacing: tuple[float, ...], weights: Any) -> Callable[[float], Array]:
    """Return a function of H: the sum over the covariance at all lags with weights along y and x."""
    from fractalcontact.dimensions._cosine_modes import Lattice

    lattice = Lattice.of((shape[0], shape[1]), (spacing[0], spacing[1]))
    along_y, along_x = weights
    return lambda hurst: np.asarray(along_y @ lattice.covariance(hurst) @ along_x.T)


def _weights(n: int, modes: Array) -> Array:
    """Return the weight of the covariance at each lag in the power of each mode: (modes, n)."""
    lag = np.arange(n)
    angle = np.pi * modes[:, None] / n
    weights = 2.0 * ((n - lag) * np.cos(angle * lag) - np.sin(angle * lag) / np.sin(angle)) / n
    weights[:, 0] = 1.0
    return np.asarray(weights)


@lru_cache(maxsize=2)
def block_weights(n: int) -> Array:
    """Return the mean of `_weights` over the modes of each block along an axis: (blocks, n).

    With that of the mode at its centre, H of a large surface would be 0.0003 too large.
    """
    starts, lag = block_starts(n, 1), np.arange(n)
    cosines, sines = np.cos(np.pi * np.arange(2 * n) / n), np.sin(np.pi * np.arange(2 * n) / n)
    weights = np.empty((starts.size - 1, n))
    for row, first, last in zip(weights, starts, starts[1:], strict=False):
        modes = np.arange(first, last)
        turns = np.multiply.outer(modes, lag) % (2 * n)
        row[:] = (n - lag) * cosines[turns].sum(axis=0)
        row -= (sines[turns] / sines[modes][:, None]).sum(axis=0)
        row *= 2.0 / (n * modes.size)
    weights[:, 0] = 1.0
    weights.flags.writeable = False  # shared by all calls
    return weights


def _profile_power(n: int) -> Array:
    """Return the expected power of modes 2 to n - 1 of a profile at the nodes, a tilt being removed.

    The tilt is that which the first mode would have; it is taken from the other odd modes, see
    `profile_modes`.
    """
    lag = np.arange(n) / n
    size = 2 * n
    tilt = tilt_modes(n)
    first = np.cos(np.pi * (np.arange(n) + 0.5) / n) * np.sqrt(2.0 / n)
    modes = np.arange(1, n)
    sine = np.sin(np.pi * modes / n)
    table = []
    for hurst in NODES:
        excess = hurst - 1.0
        logs = np.log(np.maximum(lag, 0.5 / n))
        covariance = lag**2 * (np.expm1(2.0 * excess * logs) / excess if abs(excess) > 1e-9 else 2.0 * logs)
        # as in `_cosine_modes._along`
        tapered = np.append(covariance * np.arange(n, 0, -1.0), 0.0)
        power = (
            fft.dct(tapered[None], 1, (1,))[0][1:n] - fft.dst(covariance[None, 1:], 1, (1,))[0] / sine
        ) / n
        symbol = fft.rfft2(np.concatenate([covariance, [0.0], covariance[:0:-1]])[None])
        product = fft.irfft2(symbol * fft.rfft2(np.pad(first, (0, n))[None]), (1, size))[0, :n]
        with_first = fft.dct(product[None], 2, (1,))[0][1:] / np.sqrt(2.0 * n)
        table.append((power + tilt**2 * power[0] - 2.0 * tilt * with_first)[1:])
    return np.asarray(np.stack(table))


def tilt_modes(n: int) -> Array:
    """Return the cosine modes 1 to n - 1 of a tilted line over its first one: zero for even modes."""
    modes = fft.dct((np.arange(n) - 0.5 * (n - 1))[None], 2, (1,))[0][1:]
    return np.asarray(np.where(np.arange(1, n) % 2 == 1, modes / modes[0], 0.0))


def profile_modes(heights: Array) -> Array:
    """Return the cosine modes 2 to n - 1 of a profile, orthonormal, without the tilt of its first mode."""
    n = heights.size
    modes = fft.dct((heights - heights.mean())[None], 2, (1,))[0][1:] / np.sqrt(2.0 * n)
    return np.asarray((modes - tilt_modes(n) * modes[0])[1:])
