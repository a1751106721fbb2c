"""Power spectra of surfaces: conventions, periodogram, radial average and moments.

Wavenumbers q are in rad m-1. The two-dimensional power spectral density C (m4) of heights z on ny x nx
cells of dy x dx is C(q) = dx dy |Z(q)|^2 / (nx ny), where Z is the sum of z exp(-i q r). The mean square of
the heights is the sum of C over all modes divided by the extent A: the discrete form of the integral of
C dqx dqy / (2 pi)^2. For a profile, C (m3) = dx |Z|^2 / nx and A is its length.

Densities have the half-plane of a real transform; `half_weights` counts each of its columns once (q_x = 0,
and the Nyquist column of an even grid) or twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array


def half_weights(nx: int) -> Array:
    """Return the weight of each half-plane column in a sum over all modes, shape (nx//2 + 1,)."""
    weights = np.full(nx // 2 + 1, 2.0)
    weights[0] = 1.0
    if nx % 2 == 0:
        weights[-1] = 1.0
    return weights


def half_wavenumbers(shape: Sequence[int], spacing: Sequence[float]) -> tuple[Array, ...]:
    """Return the wavenumbers of each axis of the half-plane, y first: shapes (ny,) and (nx//2 + 1,)."""
    last = len(shape) - 1
    pairs = zip(shape, spacing, strict=True)
    return tuple(fft.wavenumbers(n, step, real=axis == last) for axis, (n, step) in enumerate(pairs))


def radial_wavenumber(shape: Sequence[int], spacing: Sequence[float]) -> Array:
    """Return |q| on the half-plane, shape (ny, nx//2 + 1), or (nx//2 + 1,) of a profile."""
    return np.asarray(np.sqrt(_square(half_wavenumbers(shape, spacing))))


def window_weights(n: int, name: str | None) -> Array:
    """Return a window of n points with mean square 1: None (all ones) or "hann"."""
    if name is None:
        return np.ones(n)
    if name != "hann":
        raise ValueError(f"window: expected None or 'hann', got {name!r}")
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    return np.asarray(taper / np.sqrt(np.mean(taper**2)))


def periodogram(
    heights: Array, spacing: Sequence[float], window: str | Sequence[str | None] | None = None
) -> tuple[Array, Array]:
    """Return the power spectral density on the half-plane, and the weights of its columns.

    Parameters
    ----------
    heights : ndarray, shape (..., ny, nx), or (..., nx) with one spacing
        Finite; neither mean nor plane is removed.
    spacing : sequence of float
        (dy, dx) in metres for a plane, (dx,) for a profile.
    window : None, "hann", or one of them for each axis
        Window of the non-periodic axes, with mean square 1.

    Returns
    -------
    psd : ndarray, shape (..., ny, nx//2 + 1) or (..., nx//2 + 1)
        In m4 (plane) or m3 (profile). sum(psd * weights) / extent is the mean square of the heights.
    weights : ndarray, shape (nx//2 + 1,)
    """
    axes = len(spacing)
    shape = heights.shape[-axes:]
    names = (window,) * axes if window is None or isinstance(window, str) else tuple(window)
    if any(name is not None for name in names):
        heights = heights * window_weights(shape[-1], names[-1])
        if axes == 2:
            heights = heights * window_weights(shape[0], names[0])[:, None]
    modes = fft.rfft(heights) if axes == 1 else fft.rfft2(heights)
    psd = modes.real**2
    psd += modes.imag**2
    psd *= np.prod(spacing) / np.prod(shape)
    return psd, half_weights(shape[-1])


def lagged_products(plane: Array, reaches: Sequence[int], periodic: Sequence[bool]) -> Array:
    """Return the sum of products of values (y, x) apart, for each lag up to `reaches` along both axes.

    The shape is (2 reach_y + 1, 2 reach_x + 1), the lag 0 in the middle. Beyond a free edge all is 0.
    """
    shape = [
        n if wraps else fft.fast_length(n + reach)
        for n, reach, wraps in zip(plane.shape, reaches, periodic, strict=True)
    ]
    padded = np.zeros(shape)
    padded[: plane.shape[0], : plane.shape[1]] = plane
    modes = fft.rfft2(padded)
    power = (modes.real**2 + modes.imag**2).astype(np.complex128)
    products = fft.irfft2(power, (shape[0], shape[1]), overwrite=True)
    lags = [np.arange(-reach, reach + 1) % n for reach, n in zip(reaches, shape, strict=True)]
    return np.asarray(products[np.ix_(*lags)])


def ring_edges(shape: Sequence[int], spacing: Sequence[float]) -> Array:
    """Return the edges of the rings of `radial_average`, in rad m-1."""
    finer, step = sorted(2.0 * np.pi / (n * s) for n, s in zip(shape, spacing, strict=True))
    edges = step * (np.arange(int(np.floor(np.pi / max(spacing) / step + 0.5)) + 1) + 0.5)
    # rounding must not make one more: 1e-12 and 1e-6 gave the same edges
    low = finer * (np.arange(int(np.ceil(0.5 * step / finer - 0.5 - 1e-9))) + 0.5)
    return np.concatenate([low, edges])


def radial_average(
    psd: Array, shape: Sequence[int], spacing: Sequence[float], edges: Array | None = None
) -> tuple[Array, Array, Array]:
    """Average a half-plane density over rings of |q|, up to the smaller Nyquist wavenumber.

    Parameters
    ----------
    psd : ndarray, shape (..., ny, nx//2 + 1)
    shape, spacing : pairs
        (ny, nx) and (dy, dx) of the heights.
    edges : ndarray, optional
        Ascending edges of the rings in rad m-1 (a ring includes its lower edge). Default: rings as wide as
        the coarser step of the wavenumbers, centred on its multiples; below the first of them, rings as wide
        as the finer step, so that every mode except the mean is in a ring.

    Returns
    -------
    q : ndarray, shape (k,)
        Mean wavenumber of the modes in each non-empty ring.
    mean : ndarray, shape (..., k)
    counts : ndarray of int64, shape (k,)
        Modes of the full plane in each ring; half of them are independent.
    """
    ny, half = shape[0], shape[0] // 2 + 1
    waves = half_wavenumbers(shape, spacing)
    radius = np.sqrt(_square((waves[0][:half], waves[1]))).ravel()  # rows of -q_y have the same
    nyquist = np.pi / max(spacing)
    edges = ring_edges(shape, spacing) if edges is None else np.asarray(edges, dtype=np.float64)
    rings = edges.size - 1
    # 0 and rings + 1 hold what is in no ring; rounding, as of metres, must not move modes on an edge
    ring = np.searchsorted(edges * (1 - 1e-12), radius, side="right")
    ring[(radius > nyquist * (1 + 1e-12)) | (radius == 0)] = 0

    def sums(weights: Array) -> Array:
        return np.bincount(ring, weights.ravel(), minlength=rings + 2)[1 : rings + 1]

    columns = half_weights(shape[1])
    weights = np.multiply.outer(half_weights(ny), columns).ravel()
    counts = sums(weights)
    filled = counts > 0
    weights *= radius
    q = sums(weights)[filled] / counts[filled]
    means = []
    for plane in psd.reshape(-1, ny, columns.size):
        folded = plane[:half] * columns
        folded[1 : (ny + 1) // 2] += plane[: ny // 2 : -1] * columns
        means.append(sums(folded)[filled] / counts[filled])
    mean = np.reshape(means, (*psd.shape[: -len(shape)], q.size))
    return q, mean, counts[filled].astype(np.int64)


@dataclass(frozen=True)
class Moments:
    """Mean squares of the heights, of their gradient and of their Laplacian.

    For an isotropic surface they are the radial moments of the spectrum, <|q|^n C> for n = 0, 2, 4. The mean
    height is excluded.

    Attributes
    ----------
    height, slope, laplacian : float
        In m2, 1 and m-2.
    axes : int
        2 for a plane, 1 for a profile.
    """

    height: float
    slope: float
    laplacian: float
    axes: int = 2

    @property
    def rms_height(self) -> float:
        """Root mean square height in m."""
        return float(np.sqrt(self.height))

    @property
    def rms_slope(self) -> float:
        """Root mean square of the gradient, both components of a plane."""
        return float(np.sqrt(self.slope))

    @property
    def rms_curvature(self) -> float:
        """Root mean square of the mean curvature (half the Laplacian; of z'' for a profile), in m-1."""
        return float(np.sqrt(self.laplacian)) / self.axes

    @property
    def nayak(self) -> float:
        """Bandwidth parameter m0 m4 / m2^2 of the profiles; NaN for a surface without slope."""
        if not self.slope > 0:
            return float("nan")
        factor = 1.5 if self.axes == 2 else 1.0  # m2 = slope / 2 and m4 = 3/8 laplacian, isotropic
        return factor * (self.height / self.slope) * (self.laplacian / self.slope)


def spectral_moments(psd: Array, shape: Sequence[int], spacing: Sequence[float]) -> Moments:
    """Return the moments of one half-plane density, summed over its modes."""
    extent = float(np.prod([n * s for n, s in zip(shape, spacing, strict=True)]))
    square = _square(half_wavenumbers(shape, spacing))
    density = psd * (half_weights(shape[-1]) / extent)
    density[(0,) * density.ndim] = 0.0
    height = float(density.sum())
    density *= square
    slope = float(density.sum())
    density *= square
    return Moments(height, slope, float(density.sum()), len(shape))


def directional_slopes(psd: Array, shape: Sequence[int], spacing: Sequence[float]) -> tuple[float, ...]:
    """Return the root mean square slope along each axis, y first."""
    extent = float(np.prod([n * s for n, s in zip(shape, spacing, strict=True)]))
    density = psd * (half_weights(shape[-1]) / extent)
    waves = half_wavenumbers(shape, spacing)
    sums = (density,) if len(shape) == 1 else (density.sum(axis=1), density.sum(axis=0))
    return tuple(float(np.sqrt((q**2 * part).sum())) for q, part in zip(waves, sums, strict=True))


def _square(waves: Sequence[Array]) -> Array:
    if len(waves) == 1:
        return np.asarray(waves[0] ** 2)
    return np.asarray(waves[0][:, None] ** 2 + waves[1] ** 2)


def aliased_power_law(
    waves: tuple[Array, Array], hurst: float, images: int = 5, spacing: tuple[float, float] = (1.0, 1.0)
) -> Array:
    """Return the spectral density of a sampled fractional Brownian surface, up to a factor.

    It is the sum of |w + 2 pi k / spacing|^(-2 - 2 hurst) over all integer vectors k, the aliases of w;
    those beyond `images` along either axis are summed as an integral.

    Parameters
    ----------
    waves : (w_y, w_x)
        Wavenumbers in rad per unit length that broadcast against each other; not both zero.
    hurst : float
        Above 0.
    images : int
        3 change the density by up to 2.6 % (cells of 1 by 3, H of .05 to .95), 10 by .7 %, 40 by .8 %.
    spacing : (dy, dx)
    """
    step_y, step_x = (2.0 * np.pi / length for length in spacing)
    offsets = np.arange(-images, images + 1)
    total: Array = np.zeros(1)
    for dy in step_y * offsets:
        for dx in step_x * offsets:
            total = total + ((waves[0] + dy) ** 2 + (waves[1] + dx) ** 2) ** (-1.0 - hurst)
    angle = (np.arange(2000) + 0.5) / 2000 * np.pi  # 200 change the density by 3e-6, 20000 by 1e-8
    sides = np.maximum(np.abs(np.sin(angle)) / step_y, np.abs(np.cos(angle)) / step_x)
    radius = (images + 0.5) / sides
    tail = np.mean(radius ** (-2.0 * hurst)) / (2.0 * hurst) * (2.0 * np.pi) / (step_y * step_x)
    return np.asarray(total + tail)


def aliased_line_power_law(waves: Array, hurst: float) -> Array:
    """Return the spectral density of a sampled fractional Brownian profile, up to a factor.

    The sum of |w + 2 pi k|^(-1 - 2 hurst) over all integers k is one of Hurwitz zeta functions; `waves` are
    in rad per cell, from 0, where it is infinite, to pi.
    """
    from scipy.special import zeta

    p, share = 1.0 + 2.0 * hurst, np.asarray(waves) / (2.0 * np.pi)
    return np.asarray((zeta(p, share) + zeta(p, 1.0 - share)) * (2.0 * np.pi) ** -p)
