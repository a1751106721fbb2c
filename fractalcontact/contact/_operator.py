"""The elastic operator: displacement of every node under a pressure on all nodes, u = K p.

The kernels are imported where they run, because options are validated without the compiler.
"""

from __future__ import annotations

from copy import copy
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands

# nodes up to which tables of the modes are kept, also for the next call: a table of such a free body takes
# .26 MB, and up to a seventh of the time of a solution; of 256 x 256 nodes 1.05 MB
SMALL = 128 * 128
SINGLE: Any = np.float32  # type of the preconditioner, and of a first solution of a large surface
KEPT = 32  # small bodies whose tables of each sort are kept, at most 8 MB
NO_WORK: Array = np.empty(0)  # of a filter whose work is not asked for


class ModesMemory:
    """Memory for the modes of one transform, which operators and preconditioner take in turn."""

    def __init__(self) -> None:
        self.memory = np.empty(0, np.complex128)
        self.views: dict[Any, Array] = {}  # by shape and type

    def array(self, shape: tuple[int, int], dtype: Any) -> Array:
        """Return an array for the modes of a real plane."""
        if (shape, dtype) not in self.views:
            self.views[shape, dtype] = self._view(shape, dtype)
        return self.views[shape, dtype]

    def _view(self, shape: tuple[int, int], dtype: Any) -> Array:
        complex_type, size = np.result_type(dtype, np.complex64), shape[0] * (shape[1] // 2 + 1)
        needed = -(-size * complex_type.itemsize // self.memory.itemsize)
        if self.memory.size < needed:
            self.memory = np.empty(needed, np.complex128)
            self.views.clear()
        return self.memory.view(complex_type)[:size].reshape(shape[0], -1)


class Operator:
    """Displacement from pressure, or the inverse; counts its pairs of transforms, half a pair for one way."""

    def __init__(self, plane: tuple[int, int], memory: ModesMemory | None = None, *, is_small: bool) -> None:
        self.plane, self.memory = plane, memory or ModesMemory()  # of the transforms
        self.is_small = is_small  # the displacement comes with the work, in one call
        self.latest: Array = np.empty(0)  # displacement that came with the work of a small one
        self.modes: Any = None  # from one transform to its inverse
        self.transforms = 0.0

    def apply_at_once(self, pressure: Array) -> Array:
        """Return the displacement of a small body, a call for each transform."""
        raise NotImplementedError

    def filter_modes(self, pressure: Array, work: Array) -> None:
        """Set the modes of the displacement, and `work` to the sums over their columns."""
        raise NotImplementedError

    def from_modes(self) -> Array:
        """Return the displacement with the present modes, which are used up."""
        raise NotImplementedError

    def apply(self, pressure: Array) -> Array:
        """Return the displacement under `pressure`."""
        self.transforms += 1
        if self.is_small:
            return self.apply_at_once(pressure)
        self.filter_modes(pressure, NO_WORK)
        return self.from_modes()

    def work(self, pressure: Array) -> float:
        """Return the sum of pressure times displacement, by one transform (Parseval)."""
        if self.is_small:
            self.latest = self.apply(pressure)
            return float(np.sum(pressure * self.latest, dtype=np.float64))
        self.transforms += 0.5
        columns = np.empty(self.plane[1] // 2 + 1)
        self.filter_modes(pressure, columns)
        return sum_of_modes(columns, self.plane)

    def displacement(self) -> Array:
        """Return the displacement under the pressure of the last call, which was of `work`."""
        if self.is_small:
            return self.latest
        self.transforms += 0.5
        return self.from_modes()


class PeriodicOperator(Operator):
    """Periodic body: 2/|q| times the modes of the pressure (Stanley and Kato 1997), without the mean.

    With a stiffness of the mean it is the inverse, |q|/2. A small plane has a table of |q|; a large one needs
    no such further array.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        spacing: tuple[float, float],
        memory: ModesMemory | None = None,
        mean: float = 0.0,
    ) -> None:
        super().__init__(shape, memory, is_small=shape[0] * shape[1] <= SMALL)
        self.spacing = spacing
        self.law = (0.5, False, mean) if mean else (2.0, True, 0.0)  # factor, whether it is 1/|q|, mean
        self.transform = fft.PlaneTransform(shape)

    def apply_at_once(self, pressure: Array) -> Array:
        """Return the displacement from a table of weights."""
        modes = self.transform.forward(pressure, self.memory.array(self.plane, pressure.dtype))
        weights = wavenumber_weights(self.plane, self.spacing, *self.law, pressure.dtype.char)
        parts = modes.view(pressure.dtype)
        np.multiply(parts, weights, out=parts)
        return self.transform.backward(modes)

    def filter_modes(self, pressure: Array, work: Array) -> None:
        """Set the modes of the displacement, and `work` to the sums over their columns."""
        from fractalcontact.contact._kernels import scale_modes

        dtype = pressure.dtype.type
        qy2, qx2 = (part.astype(dtype) for part in squared_wavenumbers(self.plane, self.spacing))
        memory = self.memory.array(self.plane, dtype)
        self.modes = modes = self.transform.forward(pressure, memory)
        factor, invert, mean = self.law
        weights = (qy2, qx2, dtype(factor), invert, dtype(mean), work)
        in_bands(scale_modes, modes.shape[1], modes.size, fft.real_parts(modes), *weights)

    def from_modes(self) -> Array:
        """Return the displacement with the present modes, which are used up."""
        modes, self.modes = self.modes, None
        return self.transform.backward(modes)


class HalfSpaceOperator(Operator):
    """Half-space loaded inside a window: convolution on a plane padded so that nothing wraps around."""

    def __init__(self, table: Array, dtype: Any = np.float64) -> None:
        ny, nx = self.shape = (table.shape[0], table.shape[1])
        plane = padded_length(ny), padded_length(nx)
        super().__init__(plane, is_small=plane[0] * plane[1] <= 4 * SMALL)  # twice the length
        self.symbol = convolution_symbol(table, plane).astype(dtype)
        self.transform = fft.PlaneTransform(plane)
        self.padded: tuple[Array, Array] | None = None  # planes of a small body

    def rounded(self, dtype: Any, memory: ModesMemory) -> HalfSpaceOperator:
        """Return the operator in another precision, or in the same one, with this memory."""
        other = copy(self)
        other.symbol, other.memory = self.symbol.astype(dtype, copy=False), memory
        other.modes, other.padded, other.transforms = None, None, 0.0
        return other

    def apply_at_once(self, pressure: Array) -> Array:
        """Return the displacement from transforms of the whole padded plane."""
        from fractalcontact.contact._kernels import multiply_modes

        if self.padded is None:
            self.padded = np.zeros(self.plane, pressure.dtype), np.empty(self.plane, pressure.dtype)
        (ny, nx), (loaded, moved) = self.shape, self.padded
        loaded[:ny, :nx] = pressure
        modes = self.transform.forward(loaded, self.memory.array(self.plane, pressure.dtype))
        in_bands(multiply_modes, modes.shape[1], modes.size, fft.real_parts(modes), self.symbol, NO_WORK)
        return self.transform.backward(modes, moved)[:ny, :nx].copy()

    def filter_modes(self, pressure: Array, work: Array) -> None:
        """Set the modes of the displacement, and `work` to the sums over their columns."""
        from fractalcontact.contact._kernels import multiply_modes

        memory = self.memory.array(self.plane, pressure.dtype)
        self.modes = modes = fft.rfft2_padded(pressure, self.plane, memory)
        in_bands(multiply_modes, modes.shape[1], modes.size, fft.real_parts(modes), self.symbol, work)

    def from_modes(self) -> Array:
        """Return the displacement with the present modes, which are used up."""
        modes, self.modes = self.modes, None
        return fft.irfft2_cropped(modes, self.plane, self.shape)


class PairSum(Operator):
    """Sums a table of coefficients over the pairs of a few nodes (iy, ix), without any transform.

    A lightly pressed rough body touches at a few dozen nodes scattered over its whole extent. For some ten
    nodes the sum over pairs is cheaper than transforms of planes by two orders of magnitude.
    """

    def __init__(self, table: Array, iy: Array, ix: Array) -> None:
        self.table, self.iy, self.ix = table, iy, ix
        self.all_nodes = np.arange(iy.size)
        super().__init__((1, iy.size), is_small=True)

    def apply(self, pressure: Array) -> Array:
        """Return the sum over all nodes of table[offset] times the pressure, for every node."""
        return self.sum_at(pressure, self.all_nodes)

    def sum_at(self, value: Array, targets: Array) -> Array:
        """Return the sum for the nodes `targets` (indices); zero for the others."""
        from fractalcontact.contact._kernels import pair_sum

        flat = value.reshape(-1)
        sources = np.flatnonzero(flat)
        out = np.zeros_like(flat)
        nodes = (self.iy, self.ix, targets, sources, flat[sources])
        in_bands(pair_sum, targets.size, targets.size * sources.size, self.table, *nodes, out)
        return out.reshape(value.shape)


def squared_wavenumbers(shape: tuple[int, int], spacing: tuple[float, float]) -> tuple[Array, Array]:
    """Return the squared wave numbers of the modes of a plane along y and along x."""
    qy2 = fft.wavenumbers(shape[0], spacing[0]) ** 2
    return qy2, fft.wavenumbers(shape[1], spacing[1], real=True) ** 2


@lru_cache(maxsize=KEPT)
def wavenumber_weights(
    shape: tuple[int, int], spacing: tuple[float, float], factor: float, invert: bool, mean: float, char: str
) -> Array:
    """Return factor |q| or factor / |q| (`mean` for the mean), each twice: for real and imaginary part."""
    dtype = np.dtype(char).type
    qy2, qx2 = (part.astype(dtype) for part in squared_wavenumbers(shape, spacing))
    q = np.sqrt(qy2[:, None] + qx2[None, :])
    q[0, 0] = 1
    weights = dtype(factor) / q if invert else dtype(factor) * q
    weights[0, 0] = mean
    weights = np.repeat(weights, 2, axis=1)
    weights.flags.writeable = False
    return weights


def sum_of_modes(columns: Array, shape: tuple[int, int]) -> float:
    """Return the sum over a plane from those over the columns of its modes (Parseval).

    A column stands for itself and its mirror image; the first one is its own, and so is the last one of an
    even number of points.
    """
    total = 2 * float(columns.sum()) - float(columns[0])
    if shape[1] % 2 == 0:
        total -= float(columns[-1])
    return total / (shape[0] * shape[1])


def padded_length(n: int) -> int:
    """Return the length of a fast transform that holds a linear convolution of n points."""
    return fft.fast_length(2 * n - 1)


def convolution_symbol(table: Array, padded: tuple[int, int], *, odd: bool = False) -> Array:
    """Return the transform of the extension of `table`, which is real; shape (my, mx//2 + 1).

    The extension is even along both axes, or odd along both.
    """
    ny, nx = table.shape
    sign = -1 if odd else 1
    plane = np.zeros(padded, dtype=table.dtype)
    plane[:ny, :nx] = table
    plane[:ny, padded[1] - nx + 1 :] = sign * table[:, :0:-1]
    plane[padded[0] - ny + 1 :] = sign * plane[ny - 1 : 0 : -1]
    return np.ascontiguousarray(fft.rfft2(plane).real)
