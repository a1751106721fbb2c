"""Cosine modes of a face with missing points: filled, and corrected for the filling without bias.

The gaps are filled by harmonic interpolation after a plane is taken off: a linear operation F. The
expected power of the filled face, diag(C F S F' C') for the covariance S, differs from that of a complete
one by an excess, which is measured with random signs (Hutchinson 1990) and compared with the same product
of the complete lattice, whose mean is known exactly. So the fit stays unbiased for gaps of any shape, and
the same probes give the standard error.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._modes import Array, Lattice, expected_power

PROBES = 6
_SMALL = 1 << 16
_SEED = 20260801


class Filling:
    """Removal of a plane and harmonic interpolation over the missing points, and its transpose.

    Parameters
    ----------
    observed : ndarray of bool, shape (ny, nx)
    steps : (dy, dx)
        Spacings; a neighbour counts by the inverse square of its distance.
    """

    def __init__(self, observed: Array, steps: tuple[float, float]) -> None:
        from scipy.sparse.linalg import splu

        self.observed = observed
        y, x = (np.linspace(-1.0, 1.0, n) for n in observed.shape)
        columns = np.stack(np.broadcast_arrays(1.0, x, y[:, None]))[:, observed]
        self._plane = np.linalg.qr(columns.T)[0]
        inner, self._outer = _laplacian(observed, steps)
        self._solve = splu(inner) if inner.shape[0] else None

    def __call__(self, values: Array) -> Array:
        """Fill a face from its observed points: shape (points,) to (ny, nx)."""
        values = values - self._plane @ (values @ self._plane)
        face = np.zeros(self.observed.shape)
        face[self.observed] = values
        if self._solve is not None:
            face[~self.observed] = self._solve.solve(-(self._outer @ values))
        return face

    def transpose(self, face: Array) -> Array:
        """Apply the transpose: shape (ny, nx) to (points,)."""
        values = face[self.observed]
        if self._solve is not None:
            values = values - self._outer.T @ self._solve.solve(face[~self.observed], "T")
        return np.asarray(values - self._plane @ (values @ self._plane))


def _laplacian(observed: Array, steps: tuple[float, float]) -> tuple[Any, Any]:
    """Return the graph Laplacian of the missing points: among themselves, and to the observed ones."""
    from scipy.sparse import coo_array

    number = (
        np.where(
            observed,
            np.cumsum(observed).reshape(observed.shape),
            np.cumsum(~observed).reshape(observed.shape),
        )
        - 1
    )
    missing, points = int((~observed).sum()), int(observed.sum())
    nearest = min(steps)
    rows, columns, weights, outer = [], [], [], []
    diagonal: Array = np.zeros(missing)
    for axis, step in enumerate(steps):
        strength = (nearest / step) ** 2
        for here, there in (((0, -1), (1, None)), ((1, None), (0, -1))):
            a = tuple(slice(*here) if i == axis else slice(None) for i in (0, 1))
            b = tuple(slice(*there) if i == axis else slice(None) for i in (0, 1))
            hole = ~observed[a]
            row, column, known = number[a][hole], number[b][hole], observed[b][hole]
            np.add.at(diagonal, row, strength)
            rows.append(row)
            columns.append(column)
            weights.append(np.full(row.size, -strength))
            outer.append(known)
    row, column = np.concatenate(rows), np.concatenate(columns)
    weight, known = np.concatenate(weights), np.concatenate(outer)
    own = np.arange(missing)
    inner = coo_array(
        (np.append(weight[~known], diagonal), (np.append(row[~known], own), np.append(column[~known], own))),
        shape=(missing, missing),
    )
    return inner.tocsc(), coo_array(
        (weight[known], (row[known], column[known])), shape=(missing, points)
    ).tocsr()


class GappedModes:
    """The modes of a face with gaps, what is expected of them, and the covariance of their sums.

    Parameters
    ----------
    lattice : Lattice
    observed : ndarray of bool, shape (ny, nx)
    reference : float
        A Hurst exponent near that of the face: the probes are white after division by its expected power,
        which keeps their scatter small for any H.
    """

    def __init__(self, lattice: Lattice, observed: Array, reference: float, probes: int = PROBES) -> None:
        self.lattice, self.observed = lattice, observed
        self.missing = float(np.mean(~observed))
        self.filling = Filling(observed, lattice.steps)
        self._root = 1.0 / np.sqrt(expected_power(lattice, reference))
        rng = np.random.default_rng(_SEED)
        self._signs = [rng.integers(0, 2, self._root.shape) * 2.0 - 1.0 for _ in range(probes)]
        self._sources = []
        for sign in self._signs:
            whole = _from_modes(self._root * sign)
            self._sources.append((self.filling.transpose(whole), whole))

    def power(self, heights: Array) -> Array:
        """Return the squared modes of the filled face."""
        values = heights[self.observed]
        return np.asarray(_modes(self.filling(values - values.mean())) ** 2)

    def excess(self, hurst: float) -> Array:
        """Return what the gaps add to the expected power of the complete face."""
        symbol = _symbol(self.lattice.covariance(hurst))
        excess = np.zeros(self._root.shape)
        for sign, (part, whole) in zip(self._signs, self._sources, strict=True):
            filled = self.filling(_spread(symbol, self._embed(part))[self.observed])
            excess += sign * _modes(filled - _spread(symbol, whole))
        return np.asarray(excess / (len(self._signs) * self._root))

    def white_excess(self) -> Array:
        """Return the excess of the expected power of white noise."""
        pairs = zip(self._signs, self._sources, strict=True)
        excess = sum(sign * _modes(self.filling(part) - whole) for sign, (part, whole) in pairs)
        return np.asarray(excess / (len(self._signs) * self._root))

    def score_covariance(self, weights: Array, hurst: float, noise: float = 0.0) -> Array:
        """Return the covariance of sum(w_k power_k / reference_k) for every row w of `weights`.

        It is 2 tr(w_i K w_j K), with K the covariance of the modes for unit amplitude over the root of
        the reference power.
        """
        symbol = _symbol(self.lattice.covariance(hurst)) + noise
        total = np.zeros((len(weights), len(weights)))
        # one probe is enough here for all but small faces: its scatter falls with the number of modes
        signs = self._signs if self._root.size < _SMALL else self._signs[:1]
        for sign in signs:
            near = self._correlate(symbol, sign)
            left = [w * near for w in weights]
            right = [self._correlate(symbol, w * sign) for w in weights]
            total += [[float(np.sum(a * b)) for b in right] for a in left]
        return np.asarray((total + total.T) / len(signs))

    def reference_power(self) -> Array:
        """Return the power by which the modes of `score_covariance` are divided."""
        return np.asarray(self._root**-2)

    def _correlate(self, symbol: Array, modes: Array) -> Array:
        part = self.filling.transpose(_from_modes(self._root * modes))
        near = _spread(symbol, self._embed(part))[self.observed]
        return np.asarray(self._root * _modes(self.filling(near)))

    def _embed(self, values: Array) -> Array:
        face = np.zeros(self.observed.shape)
        face[self.observed] = values
        return face


def _modes(face: Array) -> Array:
    """Return the orthonormal cosine modes that vary along both axes."""
    ny, nx = face.shape
    return np.asarray(fft.dct(face, 2, (0, 1))[1:, 1:] / (2.0 * np.sqrt(ny * nx)))


def _from_modes(modes: Array) -> Array:
    """Apply the transpose of `_modes`."""
    ny, nx = (n + 1 for n in modes.shape)
    face = np.zeros((ny, nx))
    face[1:, 1:] = modes
    return np.asarray(fft.dct(face, 3, (0, 1)) / (2.0 * np.sqrt(ny * nx)))


def _symbol(covariance: Array) -> Array:
    """Return the spectrum of a covariance laid on the torus of twice the size."""
    ny, nx = covariance.shape
    quarter = fft.dct(np.pad(covariance, ((0, 1), (0, 1))), 1, (0, 1))
    index = np.arange(2 * ny)
    return np.asarray(quarter[np.minimum(index, 2 * ny - index)][:, : nx + 1])


def _spread(symbol: Array, face: Array) -> Array:
    """Multiply a face by the covariance matrix, by way of the torus."""
    ny, nx = face.shape
    modes = fft.rfft2(np.pad(face, ((0, ny), (0, nx))))
    return fft.irfft2(symbol * modes, (2 * ny, 2 * nx))[:ny, :nx]
