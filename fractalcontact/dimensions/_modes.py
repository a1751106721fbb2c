"""Cosine modes of a fractional Brownian surface on a finite lattice, and their exact expected power.

The modes cos(pi k (i + 1/2) / n) of a free face are almost uncorrelated for every Hurst exponent, because
reflection leaves no jump at the edges. Only modes that vary along both axes are kept: a plane, a cylinder,
an offset of each row or of each column add nothing to them. What remains of the edges, and the aliasing
of short waves, is in the expected power, which is summed over the lattice and not approximated
(the principle of Sykulski, Olhede, Guillaumin, Lilly and Early 2019, Biometrika 106, with cosines).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Lattice:
    """Squared distances on a lattice, counted in spacings of x, ready to be raised to any power.

    Attributes
    ----------
    shape : (ny, nx)
    steps : (dy/dx, 1)
    squares, logs : ndarray, shape (ny, nx)
        Squared distance from the first point over `unit`, and its logarithm (0 at the first point).
    unit : float
        A power of two near a quarter of the squared diagonal; it keeps the sums well conditioned.
    """

    shape: tuple[int, int]
    steps: tuple[float, float]
    squares: Array
    logs: Array
    unit: float

    @classmethod
    def of(cls, shape: tuple[int, int], steps: tuple[float, float]) -> Lattice:
        """Tabulate the distances of one lattice."""
        y, x = (np.arange(n) * step for n, step in zip(shape, steps, strict=True))
        squares = y[:, None] ** 2 + x**2
        unit = 2.0 ** np.frexp(squares[-1, -1] / 8.0)[1]
        squares /= unit
        logs = np.log(squares, out=np.zeros(shape), where=squares > 0)
        return cls(shape, steps, squares, logs, unit)

    def covariance(self, hurst: float) -> Array:
        """Return the generalised covariance (c r^2 - r^2H) / (1 - H) for 0 < H < 2, r in spacings of x.

        The term in r^2 is invisible to modes that vary along both axes. It makes the family pass smoothly
        through H = 1, so that a face smoother than any fractal is told apart from a fractal.
        """
        rise = hurst - 1.0
        if abs(rise) < 1e-9:
            return np.asarray(self.squares * self.logs * self.unit)
        return np.asarray(self.squares * np.expm1(rise * self.logs) * (self.unit**hurst / rise))


def power(heights: Array) -> Array:
    """Return the squared orthonormal cosine modes that vary along both axes: shape (ny - 1, nx - 1)."""
    ny, nx = heights.shape
    modes = fft.dct(heights - heights.mean(), 2, (-2, -1))[1:, 1:]
    return np.asarray(modes * modes / (4.0 * ny * nx))


def expected_power(lattice: Lattice, hurst: float) -> Array:
    """Return the expectation of `power` under the covariance of `Lattice.covariance`.

    Multiply by half the variance of the increment over one x spacing, times (1 - H), for a surface in
    other units.
    """
    return _along(_along(lattice.covariance(hurst), 1), 0)


def wavelengths(lattice: Lattice) -> Array:
    """Return the wavelength of every mode, in spacings of x: shape (ny - 1, nx - 1)."""
    ky, kx = (
        np.arange(1, n) / (2.0 * n * step) for n, step in zip(lattice.shape, lattice.steps, strict=True)
    )
    return np.asarray(1.0 / np.hypot(ky[:, None], kx))


def steepness(lattice: Lattice) -> Array:
    """Return the wavenumber along y over that along x of every mode: shape (ny - 1, nx - 1)."""
    ky, kx = (np.arange(1, n) / (n * step) for n, step in zip(lattice.shape, lattice.steps, strict=True))
    return np.asarray(ky[:, None] / kx)


def _along(covariance: Array, axis: int) -> Array:
    """Sum covariance(i - j) c_k(i) c_k(j) over i, j along one axis, for modes k = 1 to n - 1.

    The sum over pairs of lag u is (n - u) cos(pi k u / n) - sin(pi k u / n) / sin(pi k / n), over n.
    """
    n = covariance.shape[axis]
    shape = [1, 1]
    shape[axis] = -1
    inner = [slice(None)] * 2
    inner[axis] = slice(1, n)
    tapered = np.zeros([m + (i == axis) for i, m in enumerate(covariance.shape)])
    whole = [slice(None)] * 2
    whole[axis] = slice(0, n)
    tapered[tuple(whole)] = covariance * np.arange(n, 0, -1.0).reshape(shape)
    cosine = fft.dct(tapered, 1, (axis,))[tuple(inner)]
    sine = fft.dst(covariance[tuple(inner)], 1, (axis,))
    return np.asarray((cosine - sine / np.sin(np.pi * np.arange(1, n) / n).reshape(shape)) / n)
