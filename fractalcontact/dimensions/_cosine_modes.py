"""Cosine modes of a fractional Brownian surface with free edges.

The modes cos(pi k (i + 1/2) / n) of a surface with free edges are almost uncorrelated for every Hurst
exponent, because reflection leaves no jump at the edges. Only modes that vary along both axes are kept: a
plane, a cylinder, an offset of each row or of each column do not change them. The remaining effect of the
edges, and the aliasing of short waves, is in the expected power, which is summed over the lattice and not
approximated (the principle of Sykulski, Olhede, Guillaumin, Lilly and Early 2019, Biometrika 106, with
cosines).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

_SMOOTH = 1.1  # H above which the expected power is summed from differences: no fractal is so smooth
_ELONGATED = 30.0  # ratio of the spacings beyond which the same is done for any H
_NEAR = 24.0  # spacings up to which second differences are taken directly
_DERIVATIVES = 4  # half the highest order of the derivatives beyond


@dataclass(frozen=True)
class Lattice:
    """Squared distances on a lattice in x spacings, and their logarithms for powers of them.

    Attributes
    ----------
    shape : (ny, nx)
    spacing : (dy/dx, 1)
    squares, logs : ndarray, shape (ny, nx)
        Squared distance from the first point over `unit`, and its logarithm (0 at the first point).
    unit : float
        A power of two near a quarter of the squared diagonal, for well-conditioned sums.
    """

    shape: tuple[int, int]
    spacing: tuple[float, float]
    squares: Array
    logs: Array
    unit: float

    @classmethod
    def of(cls, shape: tuple[int, int], spacing: tuple[float, float]) -> Lattice:
        """Tabulate the distances of one lattice."""
        y, x = (np.arange(n) * d for n, d in zip(shape, spacing, strict=True))
        squares = y[:, None] ** 2 + x**2
        unit = 2.0 ** np.frexp(squares[-1, -1] / 8.0)[1]
        squares /= unit
        logs = np.log(squares, out=np.zeros(shape), where=squares > 0)
        return cls(shape, spacing, squares, logs, unit)

    def covariance(self, hurst: float) -> Array:
        """Return the generalised covariance (c r^2 - r^2H) / (1 - H) for 0 < H < 2, r in spacings of x.

        The term in r^2 does not change modes that vary along both axes. It makes the family smooth at H = 1,
        so that a surface smoother than any fractal is recognised.
        """
        excess = hurst - 1.0
        if abs(excess) < 1e-9:
            return np.asarray(self.squares * self.logs * self.unit)
        return np.asarray(self.squares * np.expm1(excess * self.logs) * (self.unit**hurst / excess))


def mode_power(heights: Array) -> Array:
    """Return the squared orthonormal cosine modes that vary along both axes: shape (ny - 1, nx - 1)."""
    ny, nx = heights.shape
    modes = fft.dct(heights - heights.mean(), 2, (-2, -1))[1:, 1:]
    modes *= modes
    modes /= 4.0 * ny * nx
    return modes


def expected_power(lattice: Lattice, hurst: float) -> Array:
    """Return the expectation of `mode_power` under the covariance of `Lattice.covariance`.

    Multiply by half the variance of the increment over one x spacing, times (1 - H), for a surface in
    other units.

    The sums over a covariance cancel beyond double precision where the longest waves of a large and smooth
    surface have 1e16 times the power of the shortest, and where spacings differ a hundredfold. So beyond
    H = `_SMOOTH`, or a ratio of `_ELONGATED`, the cosine modes are written as
    sine modes of the differences over one step along both axes, which is exact:
    sum_i cos(q (i + 1/2)) z_i = -sum_i sin(q i) (z_i - z_(i-1)) / (2 sin(q / 2)).
    """
    is_elongated = max(lattice.spacing) > _ELONGATED * min(lattice.spacing)
    if hurst <= _SMOOTH and not is_elongated:
        return _along(_along(lattice.covariance(hurst), 1), 0)
    if abs(hurst - 1.0) < 1e-6:  # where the differences of r^2H vanish, as does their factor 1 - H
        hurst = 1.0 + 1e-6
    power = _along(_along(_difference_covariance(lattice, hurst), 1, differences=True), 0, differences=True)
    sy, sx = (np.sin(0.5 * np.pi * np.arange(1, n) / n) ** 2 for n in lattice.shape)
    return np.asarray(power / (16.0 * sy[:, None] * sx))


def wavelengths(lattice: Lattice) -> Array:
    """Return the wavelength of every mode, in spacings of x: shape (ny - 1, nx - 1)."""
    ky, kx = (np.arange(1, n) / (2.0 * n * d) for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    return np.asarray(1.0 / np.hypot(ky[:, None], kx))


def wavenumber_ratio(lattice: Lattice) -> Array:
    """Return the wavenumber along y over that along x of every mode: shape (ny - 1, nx - 1)."""
    ky, kx = (np.arange(1, n) / (n * d) for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    return np.asarray(ky[:, None] / kx)


def _along(covariance: Array, axis: int, *, differences: bool = False) -> Array:
    """Sum covariance(i - j) c_k(i) c_k(j) over i, j along one axis, for modes k = 1 to n - 1.

    The sum over pairs of lag u is (n - u) cos(pi k u / n) - sin(pi k u / n) / sin(pi k / n), over n. For the
    n - 1 differences and sine modes it is (n - u) cos(pi k u / n) + sin(pi k u / n) / tan(pi k / n).
    """
    n = covariance.shape[axis]
    shape = [1, 1]
    shape[axis] = -1
    inner = [slice(None)] * 2
    inner[axis] = slice(1, n)
    tapered = np.zeros([m + (i == axis) for i, m in enumerate(covariance.shape)])
    first = [slice(None)] * 2
    first[axis] = slice(0, n)
    tapered[tuple(first)] = covariance * np.arange(n, 0, -1.0).reshape(shape)
    cosine = fft.dct(tapered, 1, (axis,))[tuple(inner)]
    sine = fft.dst(covariance[tuple(inner)], 1, (axis,))
    angle = (np.pi * np.arange(1, n) / n).reshape(shape)
    if differences:
        return np.asarray((cosine + sine / np.tan(angle)) / n)
    return np.asarray((cosine - sine / np.sin(angle)) / n)


def _difference_covariance(lattice: Lattice, hurst: float) -> Array:
    """Return the covariance of the differences of heights over one step along both axes, at every lag.

    It is the second difference along y and x of -r^2H / (1 - H). At long lags, where the differences of r^2H
    cancel, they are summed from its derivatives: the relative error of the cut is 1e-8 at 24 spacings.
    """
    ny, nx = lattice.shape
    y2, x2 = ((np.arange(n) * d) ** 2 for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    squares = y2[:, None] + x2
    squares[0, 0] = 1.0
    share = y2[:, None] / squares
    covariance, term = np.zeros(lattice.shape), np.empty(lattice.shape)
    for order in range(_DERIVATIVES, 1, -1):
        *lower, highest = _derivative(lattice.spacing, hurst, order)
        term.fill(highest)
        for coefficient in reversed(lower):  # in place: `polyval` takes two more arrays of the plane
            term *= share
            term += coefficient
        covariance += term
        covariance /= squares
    covariance /= squares
    covariance *= np.power(squares, hurst, out=term)
    del share, term
    near = [
        min(n, int(_NEAR * max(lattice.spacing) / d) + 1)
        for n, d in zip((ny, nx), lattice.spacing, strict=True)
    ]
    y, x = (np.abs(np.arange(-1, n + 1)) * d for n, d in zip(near, lattice.spacing, strict=True))
    # less what varies along the longer spacing only, which cancels in differences along the shorter one
    long, short = (y[:, None], x) if lattice.spacing[0] > lattice.spacing[1] else (x, y[:, None])
    unit = np.where(long > 0.0, long, 1.0)
    power = unit ** (2 * hurst) * np.expm1(hurst * np.log1p((short / unit) ** 2))
    power = np.where(long > 0.0, power, short ** (2 * hurst))
    covariance[: near[0], : near[1]] = np.diff(np.diff(power, 2, 0), 2, 1)
    return np.asarray(covariance / (hurst - 1.0))


def _derivative(spacing: tuple[float, float], hurst: float, order: int) -> Array:
    """Return the derivatives of r^2H of one order in the second difference along both axes.

    Coefficients of powers of y^2 / r^2; derivatives of order 2p along y and 2q along x, p + q equal to
    `order`, times r^(2 order - 2H), and weighted as in the Taylor series of a second difference.
    """
    total = np.polynomial.Polynomial([0.0])
    along_y = np.polynomial.Polynomial([0.0, 1.0])
    for p in range(1, order):
        q = order - p
        weight = 4.0 * spacing[0] ** (2 * p) * spacing[1] ** (2 * q)
        for i in range(p + 1):
            for j in range(q + 1):
                falling = float(np.prod(hurst - np.arange(2 * order - i - j)))
                ways = factorial(i) * factorial(2 * p - 2 * i) * factorial(j) * factorial(2 * q - 2 * j)
                factor = weight * falling * 4.0 ** (order - i - j) / ways
                total += factor * along_y ** (p - i) * (1.0 - along_y) ** (q - j)
    return np.asarray(total.coef)


def cosine_modes(heights: Array) -> Array:
    """Return the orthonormal cosine modes that vary along both axes."""
    ny, nx = heights.shape
    modes = fft.dct(heights, 2, (0, 1))[1:, 1:]
    modes /= 2.0 * np.sqrt(ny * nx)
    return modes


def from_modes(modes: Array) -> Array:
    """Apply the transpose of `cosine_modes`."""
    ny, nx = (n + 1 for n in modes.shape)
    heights = np.zeros((ny, nx))
    heights[1:, 1:] = modes
    heights = fft.dct(heights, 3, (0, 1))
    heights /= 2.0 * np.sqrt(ny * nx)
    return heights
