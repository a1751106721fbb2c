"""Cosine modes of a surface with gaps: their expected power, and the covariance of their sums.

Gaps are filled by harmonic interpolation after a plane is removed: a linear operation F. The expected power
of the filled surface, diag(C F S F' C') for the covariance S, differs from that of a complete one by an
excess, which is estimated with random signs (Hutchinson 1990) and compared with the same product of the
complete lattice, whose mean is known exactly. So the fit is unbiased for gaps of any shape, and the same
probes give the standard error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._cosine_modes import Lattice, cosine_modes, expected_power, from_modes
from fractalcontact.dimensions._harmonic_interpolation import Filling

Array = np.ndarray[Any, np.dtype[Any]]

PROBES = 6
_SMALL = 1 << 13  # modes up to which the covariance of the score takes all probes
_SEED = 20260801


class GappedModes:
    """Cosine modes of a surface with gaps, their expected power, and the covariance of their sums.

    Parameters
    ----------
    lattice : Lattice
    observed : ndarray of bool, shape (ny, nx)
    reference : float
        A Hurst exponent near that of the surface: the probes are white after division by its expected
        power, which keeps their scatter small for any H.
    probes : int
        Number of random sign patterns.
    filling : Filling, optional
        That of `observed`, if it is at hand.
    """

    def __init__(
        self,
        lattice: Lattice,
        observed: Array,
        reference: float,
        probes: int = PROBES,
        filling: Filling | None = None,
    ) -> None:
        self.lattice, self.observed = lattice, observed
        self.missing = float(np.mean(~observed))
        self.filling = Filling(observed, lattice.spacing) if filling is None else filling
        self._root = 1.0 / np.sqrt(expected_power(lattice, reference))
        rng = np.random.default_rng(_SEED)
        self._signs = [rng.integers(0, 2, self._root.shape) * 2.0 - 1.0 for _ in range(probes)]
        self._sources = []
        for sign in self._signs:
            heights = from_modes(self._root * sign)
            self._sources.append((self.filling.transpose(heights), heights))

    def power(self, heights: Array) -> Array:
        """Return the squared modes of the filled surface."""
        centred = heights - heights[self.observed].mean()
        return np.asarray(cosine_modes(self.filling(centred)) ** 2)

    def excess(self, *hursts: float) -> list[Array]:
        """Return the excess of the expected power over that of the complete surface, at each exponent."""
        symbols = [_symbol(self.lattice.covariance(hurst)) for hurst in hursts]
        excess = [np.zeros(self._root.shape) for _ in hursts]
        for sign, (observed, complete) in zip(self._signs, self._sources, strict=True):
            modes = _padded_modes(complete)  # one transform for all exponents
            whole = [_product(symbol, modes, complete.shape) for symbol in symbols]
            modes = _padded_modes(observed)
            for k, symbol in enumerate(symbols):
                filled = self.filling(_product(symbol, modes, complete.shape))
                excess[k] += sign * cosine_modes(filled - whole[k])
        return [part / (len(self._signs) * self._root) for part in excess]

    def white_excess(self) -> Array:
        """Return the excess of the expected power of white noise."""
        pairs = zip(self._signs, self._sources, strict=True)
        excess = sum(
            sign * cosine_modes(self.filling(observed) - complete) for sign, (observed, complete) in pairs
        )
        return np.asarray(excess / (len(self._signs) * self._root))

    def score_covariance(self, weights: Array, hurst: float, noise: float = 0.0) -> Array:
        """Return the covariance of sum(w_k power_k / reference_k) for every row w of `weights`.

        It is 2 tr(w_i K w_j K), with K the covariance of the modes for unit amplitude over the root of
        the reference power.
        """
        symbol = _symbol(self.lattice.covariance(hurst)) + noise
        total = np.zeros((len(weights), len(weights)))
        # one probe is enough here for all but small surfaces: its scatter falls with the number of modes
        signs = self._signs if self._root.size < _SMALL else self._signs[:1]
        for sign in signs:
            product = self._correlate(symbol, sign)
            left = [w * product for w in weights]
            right = [self._correlate(symbol, w * sign) for w in weights]
            total += [[float(np.sum(a * b)) for b in right] for a in left]
        return np.asarray((total + total.T) / len(signs))

    def reference_power(self) -> Array:
        """Return the power by which the modes of `score_covariance` are divided."""
        return np.asarray(self._root**-2)

    def _correlate(self, symbol: Array, modes: Array) -> Array:
        """Apply the covariance of the modes, scaled by the reference power."""
        values = self.filling.transpose(from_modes(self._root * modes))
        values = _convolved(symbol, values)
        return np.asarray(self._root * cosine_modes(self.filling(values)))


def relative_excess(lattice: Lattice, filling: Filling, hurst: float, probes: int) -> Array:
    """Return what gaps add to the expected power of each mode, over that of the complete surface.

    As `GappedModes.excess` at its reference. Most of the scatter of random signs is that of the points that
    are left out, C M C' for the mask M of missing points: it is replaced by its diagonal, which is known.
    One probe so has the scatter of four to ten.
    """
    root = 1.0 / np.sqrt(expected_power(lattice, hurst))
    quarter = fft.dct(np.pad(lattice.covariance(hurst), ((0, 1), (0, 1))), 1, (0, 1))
    torus = np.empty((2 * lattice.shape[0], lattice.shape[1] + 1), dtype=complex)

    def change(sign: Array) -> Array:
        heights = from_modes(root * sign)
        filled = filling(_quarter_product(quarter, filling.transpose(heights), torus))
        filled -= _quarter_product(quarter, heights, torus)
        return np.asarray(root * cosine_modes(filled))

    return _diagonal(filling.observed, change, probes)


def approximate_excess(power: Array, filling: Filling, probes: int) -> Array:
    """Return `relative_excess` for modes that are independent: a fifth of the work, but wrong at the border.

    `power` is the expected power with that of the modes along one axis (`with_lines`): shape (ny, nx). Near
    the border such a surface is its own mirror image.
    """
    root = 1.0 / np.sqrt(power[1:, 1:])

    def change(sign: Array) -> Array:
        modes = fft.dct(filling.transpose(from_modes(root * sign)), 2, (0, 1))
        modes *= power
        modes /= 4.0 * power.size
        result = cosine_modes(filling(fft.dct(modes, 3, (0, 1))))
        result *= root
        result -= sign
        return result

    return _diagonal(filling.observed, change, probes)


def with_lines(power: Array, spacing: tuple[float, float], hurst: float) -> Array:
    """Add the power of modes along one axis, as the power law extends it from the first mode of the other."""
    shape = tuple(n + 1 for n in power.shape)
    y, x = ((np.arange(1, n) / (n * d)) ** 2 for n, d in zip(shape, spacing, strict=True))
    result = np.zeros(shape)
    result[1:, 1:] = power
    result[1:, 0] = power[:, 0] * (1.0 + x[0] / y) ** (hurst + 1.0)
    result[0, 1:] = power[0] * (1.0 + y[0] / x) ** (hurst + 1.0)
    return result


def relative_white_excess(filling: Filling, probes: int) -> Array:
    """Return what gaps add to the expected power of white noise of unit variance, as `relative_excess`."""

    def change(sign: Array) -> Array:
        heights = from_modes(sign)
        return cosine_modes(filling(filling.transpose(heights)) - heights)

    return _diagonal(filling.observed, change, probes)


def _diagonal(observed: Array, change: Callable[[Array], Array], probes: int) -> Array:
    """Return the mean of sign * change(sign), with the exact diagonal of the points that are left out."""
    shape = tuple(n - 1 for n in observed.shape)
    rng, total = np.random.default_rng(_SEED), np.zeros(shape)
    for _ in range(probes):
        sign = rng.integers(0, 2, shape, dtype=np.int8) * 2.0 - 1.0
        difference = change(sign)
        difference += cosine_modes(np.where(observed, 0.0, from_modes(sign)))  # C M C' sign
        difference *= sign
        total += difference
    total /= probes
    total -= _missing_share(observed)
    return total


def _missing_share(observed: Array) -> Array:
    """Return the diagonal of C M C' from the cosine modes of twice the wavenumber of the mask M."""
    doubled = fft.dct((~observed).astype(float), 2, (0, 1)) / (4.0 * observed.size)
    along_y, along_x = _of_twice_the_mode(doubled[:, :1]), _of_twice_the_mode(doubled[:1].T).T
    share = _of_twice_the_mode(_of_twice_the_mode(doubled).T).T
    share += doubled[0, 0] + along_y
    share += along_x
    return np.asarray(share)


def _of_twice_the_mode(modes: Array) -> Array:
    """Return, for modes 1 to n - 1 of the first axis, that of twice the number: beyond n - 1 its alias."""
    even = modes[2::2]
    middle = np.zeros((1 - len(modes) % 2, *modes.shape[1:]))
    return np.concatenate([even, middle, -even[::-1]])


def _quarter_product(quarter: Array, heights: Array, torus: Array) -> Array:
    """Multiply heights by a covariance matrix, given a quarter of its spectrum; `torus` is room."""
    ny, nx = heights.shape
    modes = fft.rfft2_padded(heights, (2 * ny, 2 * nx), torus)
    modes[: ny + 1] *= quarter
    modes[ny + 1 :] *= quarter[ny - 1 : 0 : -1]
    return fft.irfft2_cropped(modes, (2 * ny, 2 * nx), (ny, nx))


def _symbol(covariance: Array) -> Array:
    """Return the spectrum of a covariance on the torus of twice the size."""
    ny, nx = covariance.shape
    quarter = fft.dct(np.pad(covariance, ((0, 1), (0, 1))), 1, (0, 1))
    index = np.arange(2 * ny)
    return np.asarray(quarter[np.minimum(index, 2 * ny - index)][:, : nx + 1])


def _convolved(symbol: Array, heights: Array) -> Array:
    """Multiply heights by the covariance matrix, by transforms on the torus."""
    return _product(symbol, _padded_modes(heights), heights.shape)


def _padded_modes(heights: Array) -> Array:
    """Transform heights on the torus of twice the size."""
    ny, nx = heights.shape
    return fft.rfft2_padded(heights, (2 * ny, 2 * nx))


def _product(symbol: Array, modes: Array, shape: tuple[int, ...]) -> Array:
    """Multiply transformed heights by the covariance matrix."""
    ny, nx = shape
    return fft.irfft2_cropped(symbol * modes, (2 * ny, 2 * nx), (ny, nx))
