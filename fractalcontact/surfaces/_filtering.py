"""Gaussian noise filtered to a self-affine spectrum, arrays only."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.spectra import half_wavenumbers, half_weights

Array = np.ndarray[Any, np.dtype[Any]]
BLOCK = 1 << 15  # modes worked on at a time: they stay in the cache
EDGE = 1e-9  # a mode this near to a cut-off, relatively, is inside


@dataclass(frozen=True)
class Band:
    """A self-affine spectrum with a plateau, up to a factor, of an effective wavenumber.

    Attributes
    ----------
    hurst : tuple of float
        Along y and x.
    low, corner, high : float
        Wavenumbers of the long cut-off, the roll-off and the short cut-off; 0 and inf for none.
    anisotropy_ratio, azimuth : float
        Correlations are `anisotropy_ratio` times as long along the azimuth `azimuth` (radian) as across it.
    axes : int
        1 for a profile: its spectrum falls with 1 + 2 hurst, not 2 + 2 hurst.
    """

    hurst: tuple[float, float]
    low: float
    corner: float
    high: float
    anisotropy_ratio: float = 1.0
    azimuth: float = 0.0
    axes: int = 2

    @property
    def mean_hurst(self) -> float:
        """Harmonic mean of the two exponents."""
        return 2.0 / (1.0 / self.hurst[0] + 1.0 / self.hurst[1])

    def amplitude(self, qy: Array, qx: Array) -> Array:
        """Return the square root of the density at wavenumbers that broadcast; 0 outside the band."""
        square = self._square(qy, qx)
        outside = square == 0.0
        if self.low > 0.0:
            outside |= square < (self.low * (1.0 - EDGE)) ** 2
        if np.isfinite(self.high):
            outside |= square > (self.high * (1.0 + EDGE)) ** 2
        square *= self.corner**-2.0
        np.maximum(square, 1.0, out=square)
        amplitude = np.power(square, -0.5 * (0.5 * self.axes + self.mean_hurst), out=square)
        amplitude[outside] = 0.0
        return amplitude

    def _square(self, qy: Array, qx: Array) -> Array:
        """Return the square of the effective wavenumber."""
        if self.anisotropy_ratio != 1.0:
            cosine, sine = np.cos(self.azimuth), np.sin(self.azimuth)
            along = np.sqrt(self.anisotropy_ratio) * (qx * cosine + qy * sine)
            across = (qy * cosine - qx * sine) / np.sqrt(self.anisotropy_ratio)
            return np.asarray(along**2 + across**2)
        if self.hurst[0] == self.hurst[1]:
            return np.asarray(qy**2 + qx**2)
        mean = self.mean_hurst
        powers = [
            np.abs(q / self.corner) ** (2.0 * own / mean) for own, q in zip(self.hurst, (qy, qx), strict=True)
        ]
        return np.asarray(self.corner**2 * (powers[0] + powers[1]))

    def grid_amplitude(self, qy: Array, qx: Array, nyquist: tuple[float, float]) -> Array:
        """Return `amplitude` with the power of a Nyquist mode averaged over the two waves it stands for."""
        amplitude = self.amplitude(qy, qx)
        if self.anisotropy_ratio == 1.0:
            return amplitude
        mirrored = self.amplitude(-qy, qx)
        doubtful = np.isclose(np.abs(qy), nyquist[0], rtol=1e-9) | np.isclose(qx, nyquist[1], rtol=1e-9)
        return np.where(doubtful, np.sqrt(0.5 * (amplitude**2 + mirrored**2)), amplitude)


def filtered_modes(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    band: Band,
    rng: np.random.Generator,
    *,
    slope: bool,
    expected: bool,
) -> tuple[Array, float]:
    """Draw the modes of one surface on the half-plane, and their energy.

    Parameters
    ----------
    shape, spacing : pairs
        (ny, nx) and (dy, dx); ny = 1 makes a profile.
    band : Band
    rng : Generator
    slope : bool
        The energy is the mean square gradient, else the mean square height.
    expected : bool
        The energy is that expected over all surfaces, else that of these modes.

    Returns
    -------
    modes : ndarray of complex, shape (ny, nx//2 + 1)
        Of a real transform: irfft2 gives heights with this energy.
    energy : float
    """
    ny, nx = shape
    waves_y, waves_x = half_wavenumbers(shape, spacing)
    reach_y, reach_x = _reach(band, waves_y, waves_x)
    nyquist = (np.pi / spacing[0], np.pi / spacing[1])
    modes = np.zeros((ny, waves_x.size), dtype=np.complex128)
    numbers = modes.view(np.float64)
    mirrored = [column for column in ((0, nx // 2) if nx % 2 == 0 else (0,)) if column < reach_x]
    weights = np.repeat(half_weights(nx)[:reach_x], 2)
    weights[[2 * column + part for column in mirrored for part in (0, 1)]] = 0.0  # these are added at the end
    slope_weights = weights * np.repeat(waves_x[:reach_x], 2) ** 2
    across, along = np.zeros(ny), np.zeros(ny)
    own = np.zeros((ny, len(mirrored)))
    scratch = np.empty((max(1, BLOCK // reach_x), 2 * reach_x))
    for rows, doubled in _rows(band, waves_y, waves_x[:reach_x], nyquist, reach_y, len(scratch)):
        own[rows] = doubled[:, [2 * column for column in mirrored]]
        noise = rng.standard_normal(out=scratch[: len(doubled)])
        drawn = np.multiply(noise, doubled, out=numbers[rows, : 2 * reach_x])
        square = np.square(doubled if expected else drawn, out=noise)
        across[rows] = np.einsum("ij,j->i", square, weights)
        if slope:
            along[rows] = np.einsum("ij,j->i", square, slope_weights)
    for place, column in enumerate(mirrored):
        modes[:, column] = _hermitian(modes[:, column])
        line = 2.0 * own[:, place] ** 2 if expected else np.abs(modes[:, column]) ** 2
        across += line
        along += line * waves_x[column] ** 2
    energy = (along + across * waves_y**2).sum() if slope else across.sum()
    return modes, float(energy) / (float(nx) * ny) ** 2


def _rows(
    band: Band, waves_y: Array, waves_x: Array, nyquist: tuple[float, float], reach: int, size: int
) -> Iterator[tuple[slice, Array]]:
    """Yield blocks of rows with their amplitudes, each twice, each block followed by its mirror."""

    def amplitudes(rows: slice) -> Array:
        return np.repeat(band.grid_amplitude(waves_y[rows, None], waves_x, nyquist), 2, axis=1)

    ny = waves_y.size
    for start in range(0, reach, size):
        rows = slice(start, min(start + size, reach))
        doubled = amplitudes(rows)
        yield rows, doubled
        first, last = max(rows.start, 1), min(rows.stop - 1, (ny - 1) // 2)
        if first > last:
            continue
        mirror = slice(ny - last, ny - first + 1)
        if band.anisotropy_ratio == 1.0:
            yield mirror, doubled[first - rows.start : last - rows.start + 1][::-1]
        else:
            yield mirror, amplitudes(mirror)


def _hermitian(column: Array) -> Array:
    """Return a column that is the mirror of its own conjugate, as strong as the one given."""
    return np.asarray((column + np.conj(np.roll(column[::-1], 1))) * np.sqrt(0.5))


def _reach(band: Band, waves_y: Array, waves_x: Array) -> tuple[int, int]:
    """Return how many rows (from either end) and columns can hold modes inside the band."""
    if not np.isfinite(band.high) or band.anisotropy_ratio != 1.0 or band.hurst[0] != band.hurst[1]:
        return waves_y.size // 2 + 1, waves_x.size
    high = band.high * (1.0 + EDGE)
    rows = np.count_nonzero(np.abs(waves_y[: waves_y.size // 2 + 1]) <= high)
    return int(rows), int(np.count_nonzero(waves_x <= high))
