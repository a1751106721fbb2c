"""Intrinsic circulant embedding of fractional Brownian surfaces (Stein 2002), on plain arrays.

Lengths are divided by the diagonal between the outermost points, so that all distances r are at most 1.
There r^(2H) is the variogram of a stationary field plus that of a random plane. The covariance of the
stationary field is zero beyond r = R and smooth enough to be positive definite. Summed over a torus of side
R + extent it is circulant: Fourier transforms sample it without error.

References: Stein, Journal of Computational and Graphical Statistics 11 (2002) 587-599.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.numbers import ROUNDED, Array

# numbers processed at a time, so that they stay in the processor cache; a surface of 1024 x 1024 points takes
# as long with twice as many, and 2 and 8 % more with a half and a quarter
BLOCK = 1 << 16


@dataclass(frozen=True)
class Stein:
    """Covariance of the stationary field: c0 - r^2H + c2 r^2 up to r = 1, beta (R - r)^3 / r up to R."""

    hurst: float
    radius: float
    c0: float
    c2: float
    beta: float

    @classmethod
    def of(cls, hurst: float) -> Stein:
        """Return the constants for an exponent: R = 1 up to 0.75, where it suffices, and R = 2 above."""
        power = 2.0 * hurst
        if hurst <= 0.75:
            return cls(hurst, 1.0, 1.0 - power / 2.0, power / 2.0, 0.0)
        radius = 2.0
        beta = power * (2.0 - power) / (3.0 * radius * (radius**2 - 1.0))
        c2 = (power - beta * (radius - 1.0) ** 2 * (radius + 2.0)) / 2.0
        return cls(hurst, radius, beta * (radius - 1.0) ** 3 + 1.0 - c2, c2, beta)

    def __call__(self, square: Array) -> Array:
        """Return the covariance at squared distances."""
        covariance = np.zeros_like(square)
        inside = square <= 1.0
        near = square[inside]
        covariance[inside] = self.c0 + self.c2 * near - np.power(near, self.hurst)
        if self.beta > 0.0:
            outside = ~inside
            far = np.sqrt(square[outside])
            covariance[outside] = self.beta * np.maximum(self.radius - far, 0.0) ** 3 / far
        return covariance


@dataclass(frozen=True)
class Embedding:
    """A torus whose random modes give the surface.

    Attributes
    ----------
    shape : tuple of int
        (ny, nx) of the surface; ny = 1 for a profile.
    torus : tuple of int
        Points of the torus along each axis, even (or 1).
    step : tuple of float
        Spacing over the diagonal of the surface.
    amplitude : ndarray, shape (torus_x//2 + 1, torus_y//2 + 1)
        Square root of the eigenvalues on one quadrant, x first; the other quadrants mirror it.
    drift : float
        Standard deviation of the slope of the random plane, per diagonal.
    smallest : float
        Smallest eigenvalue over the largest, before clipping.
    clipped : float
        Fraction of the eigenvalues that rounding left below zero.
    """

    shape: tuple[int, int]
    torus: tuple[int, int]
    step: tuple[float, float]
    amplitude: Array
    drift: float
    smallest: float
    clipped: float


def embed(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> Embedding:
    """Return the embedding of a surface of this shape; ny = 1 makes a profile.

    The last small embedding is cached for the members of an ensemble.
    """
    torus = torus_shape(shape, spacing, hurst)
    is_small = torus[0] * torus[1] <= 1 << 24  # 34 MB of amplitudes
    return (_embed_cached if is_small else _embed)(shape, spacing, hurst)


def _embed(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> Embedding:
    model = Stein.of(hurst)
    step = _diagonal_steps(shape, spacing)
    torus = torus_shape(shape, spacing, hurst)
    covariance = _covariance(model, torus, step)
    axes = tuple(axis for axis, n in enumerate(covariance.shape) if n > 1)
    eigenvalues = fft.dct(covariance, 1, axes)
    largest, smallest = float(eigenvalues.max()), float(eigenvalues.min())
    # what rounding may leave; of 264 tori of 3 to 30000 points an edge, H .01 to .99, none is below 0
    if not smallest >= -1e-14 * largest:
        raise FractalContactError(
            f"fractional Brownian surface: the embedding of shape {shape} with hurst = {hurst:g} is not "
            f"positive definite (smallest over largest eigenvalue {smallest / largest:.2g}): please report it"
        )
    clipped = float(np.count_nonzero(eigenvalues < 0.0) / eigenvalues.size)
    amplitude = np.sqrt(np.maximum(eigenvalues, 0.0, out=eigenvalues), out=eigenvalues)
    amplitude.flags.writeable = False
    drift = float(np.sqrt(2.0 * model.c2))
    return Embedding(shape, torus, step, amplitude, drift, smallest / largest, clipped)


_embed_cached = lru_cache(maxsize=1)(_embed)


def torus_shape(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> tuple[int, int]:
    """Return the number of points of the torus along each axis."""
    step = _diagonal_steps(shape, spacing)
    radius = Stein.of(hurst).radius
    return _side(shape[0], step[0], radius), _side(shape[1], step[1], radius)


def _diagonal_steps(shape: tuple[int, int], spacing: tuple[float, float]) -> tuple[float, float]:
    """Return the spacing over the distance between the outermost points."""
    diagonal = float(np.hypot((shape[0] - 1) * spacing[0], (shape[1] - 1) * spacing[1]))
    return spacing[0] / diagonal, spacing[1] / diagonal


def _side(n: int, step: float, radius: float) -> int:
    """Return an even number of points, fast to transform, that covers the extent and one radius."""
    if n == 1:
        return 1
    needed = int(np.ceil(radius / step / ROUNDED)) + n - 1
    return 2 * fft.fast_length((needed + 1) // 2)


def _covariance(model: Stein, torus: tuple[int, int], step: tuple[float, float]) -> Array:
    """Return the covariance summed over the images of the torus, on the quadrant (x, y) of offsets."""
    y, x = (np.arange(n // 2 + 1) * s for n, s in zip(torus, step, strict=True))
    side_y, side_x = (
        n * s if n > 1 else np.inf for n, s in zip(torus, step, strict=True)
    )  # a profile has no images
    covariance = np.zeros((x.size, y.size))
    rows = max(1, BLOCK // y.size)
    for start in range(0, x.size, rows):
        block = slice(start, min(start + rows, x.size))
        for image_x in (x[block], side_x - x[block]):
            reach_x = np.flatnonzero(image_x < model.radius)
            for image_y in (y, side_y - y):
                reach_y = np.flatnonzero(image_y < model.radius)
                if reach_x.size and reach_y.size:
                    part = (
                        slice(start + reach_x[0], start + reach_x[-1] + 1),
                        slice(reach_y[0], reach_y[-1] + 1),
                    )
                    covariance[part] += model(image_x[reach_x][:, None] ** 2 + image_y[reach_y] ** 2)
    return covariance


def draw(embedding: Embedding, rng: np.random.Generator) -> Array:
    """Return one surface with E[(z(a) - z(b))^2] = 2 r^(2H), r in diagonals, shape (ny, nx)."""
    ny, nx = embedding.shape
    slope_y, slope_x = embedding.drift * rng.standard_normal(2)
    lines = _columns(embedding, rng)
    heights = np.empty((ny, nx))
    rows = max(1, BLOCK // embedding.torus[1])
    for start in range(0, ny, rows):
        block = slice(start, start + rows)
        heights[block] = fft.irfft(lines[block], embedding.torus[1])[:, :nx]
        heights[block] += slope_x * embedding.step[1] * np.arange(nx)
        heights[block] += (slope_y * embedding.step[0] * np.arange(ny)[block])[:, None]
    return heights


def _columns(embedding: Embedding, rng: np.random.Generator) -> Array:
    """Draw the modes, transform them back along y and keep the rows of the surface: (ny, torus_x//2 + 1)."""
    ny = embedding.shape[0]
    torus_y, torus_x = embedding.torus
    width = torus_x // 2 + 1
    lines = np.empty((ny, width), dtype=np.complex128)
    # a pair of normal numbers has mean square 2; the self-conjugate columns keep their real part only
    scale = np.full(width, np.sqrt(0.5 * torus_x * torus_y))
    scale[[0, -1]] *= np.sqrt(2.0)
    half = torus_y // 2 + 1
    rows = max(1, BLOCK // torus_y)
    for start in range(0, width, rows):
        block = slice(start, min(start + rows, width))
        amplitude = embedding.amplitude[block] * scale[block, None]
        modes = rng.standard_normal((amplitude.shape[0], torus_y, 2)).view(np.complex128)[..., 0]
        modes[:, :half] *= amplitude
        modes[:, half:] *= amplitude[:, half - 2 : 0 : -1]
        lines[:, block] = fft.ifft(modes)[:, :ny].T
    lines[:, [0, -1]] = lines[:, [0, -1]].real
    return lines
