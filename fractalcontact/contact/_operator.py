"""The elastic operator: settlement of every node under a plane of pressure, by Fourier transform."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]


class Operator(Protocol):
    """Settlement from pressure; counts its pairs of transforms."""

    transforms: int

    def apply(self, pressure: Array) -> Array:
        """Return the settlement under `pressure`; both (ny, nx)."""
        ...


class PeriodicOperator:
    """A body that repeats itself: the compliance multiplies the modes of the pressure."""

    def __init__(self, compliance: Array, shape: tuple[int, int]) -> None:
        self.compliance, self.shape = compliance, shape
        self.transforms = 0

    def apply(self, pressure: Array) -> Array:
        """Return the settlement under `pressure`, without its mean."""
        modes = fft.rfft2(pressure)
        modes *= self.compliance
        self.transforms += 1
        return fft.irfft2(modes, self.shape, overwrite=True)


class FreeOperator:
    """A half-space loaded inside a window alone: convolution on a plane padded so that nothing wraps."""

    def __init__(self, table: Array) -> None:
        self.shape = (int(table.shape[0]), int(table.shape[1]))
        self.padded = (padded_length(self.shape[0]), padded_length(self.shape[1]))
        self.symbol = convolution_symbol(table, self.padded)
        self.buffer = np.zeros(self.padded, dtype=table.dtype)
        self.transforms = 0

    def apply(self, pressure: Array) -> Array:
        """Return the settlement under `pressure`."""
        ny, nx = self.shape
        self.buffer[:ny, :nx] = pressure
        modes = fft.rfft2(self.buffer)
        modes *= self.symbol
        self.transforms += 1
        return fft.irfft2(modes, self.padded, overwrite=True)[:ny, :nx]


def padded_length(n: int) -> int:
    """Length of a fast transform that holds a linear convolution of n points."""
    return fft.fast_length(2 * n - 1)


def convolution_symbol(table: Array, padded: tuple[int, int]) -> Array:
    """Transform of the even extension of `table`, which is real; shape (my, mx//2 + 1)."""
    ny, nx = table.shape
    plane = np.zeros(padded, dtype=table.dtype)
    plane[:ny, :nx] = table
    plane[:ny, padded[1] - nx + 1 :] = table[:, :0:-1]
    plane[padded[0] - ny + 1 :] = plane[ny - 1 : 0 : -1]
    return np.ascontiguousarray(fft.rfft2(plane).real)
