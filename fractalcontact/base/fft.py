"""Fourier transforms of real planes; no other module calls a transform library.

The library is ducc0 where it is installed (extra `fast`), otherwise scipy. `FRACTALCONTACT_FFT=scipy` selects
scipy. The transforms act on the last two axes (or the last one); the inverse has the factor 1/n. No bit
depends on the number of threads.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands

SMALL = 1 << 16  # elements up to which a transform is a single call of the library: too few for two threads
GROUP = 16  # lines: a multiple of the number that ducc0 transforms together


def library() -> str:
    """Name the transform library in use, "ducc0" or "scipy"."""
    return "ducc0" if _ducc0_installed() and os.environ.get("FRACTALCONTACT_FFT", "") != "scipy" else "scipy"


def fast_length(n: int) -> int:
    """Return the smallest length >= n that transforms fast, of real numbers."""
    if library() == "ducc0":
        return int(_ducc0().good_size(int(n), True))
    return int(_scipy().next_fast_len(int(n), real=True))


def rfft2(plane: Array, out: Array | None = None) -> Array:
    """Transform the last two axes of a real array: (..., ny, nx) to (..., ny, nx//2 + 1)."""
    return _forward(plane, (-2, -1), out)


def irfft2(
    modes: Array, shape: tuple[int, int], out: Array | None = None, *, overwrite: bool = False
) -> Array:
    """Undo `rfft2`; `shape` is (ny, nx) of the real plane. `overwrite` allows the input to be overwritten."""
    return _backward(modes, (-2, -1), shape, out, overwrite)


class PlaneTransform:
    """Transforms of planes of one shape: the library is chosen once, and a small plane takes one call of it.

    `rfft2` and `irfft2` take twice as long for 8 x 8 points, and a third more for 32 x 32.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        size, half = shape[0] * shape[1], shape[0] * (shape[1] // 2 + 1)
        has_ducc0 = library() == "ducc0"
        self._r2c = _ducc0().r2c if has_ducc0 and size <= SMALL else None
        self._c2r = _ducc0().c2r if has_ducc0 and half <= SMALL else None

    def forward(self, plane: Array, out: Array | None = None) -> Array:
        """Return the modes of a plane, in `out` if it is given."""
        if self._r2c is None:
            return _forward(plane, (-2, -1), out)
        return self._r2c(plane, (0, 1), True, 0, out, 1)  # type: ignore[no-any-return]

    def backward(self, modes: Array, out: Array | None = None) -> Array:
        """Return the plane of modes, which are overwritten, in `out` if it is given."""
        if self._c2r is None:
            return _backward(modes, (-2, -1), self.shape, out, overwrite=True)
        return self._c2r(modes, (0, 1), self.shape[1], False, 2, out, 1, True)  # type: ignore[no-any-return]


def rfft(line: Array) -> Array:
    """Transform the last axis of a real array: (..., n) to (..., n//2 + 1)."""
    return _forward(line, (-1,), None)


def irfft(modes: Array, n: int) -> Array:
    """Undo `rfft`; `n` is the length of the real line."""
    return _backward(modes, (-1,), (n,), None, False)


def ifft(modes: Array) -> Array:
    """Undo the complex transform of the last axis."""
    return _along(_complex_lines, modes, -1, np.empty_like(modes), forward=False)


def dct(array: Array, transform_type: int, axes: tuple[int, ...]) -> Array:
    """Return the cosine transform of type 1, 2 or 3 along `axes`, without normalisation.

    Type 2 sums 2 a_j cos(pi k (j + 1/2) / n). Type 1, with n + 1 >= 2 values, is a_0 + (-1)^k a_n plus the
    sum of 2 a_j cos(pi k j / n), the real transform of all 2 n points of an even line. Type 3 is the
    transpose of type 2 up to the factor of its first value.
    """
    if array.size <= SMALL:
        axes = tuple(axis % array.ndim for axis in axes)
        if library() == "ducc0":
            return _ducc0().dct(array, transform_type, axes, nthreads=1)  # type: ignore[no-any-return]
        return _scipy().dctn(array, transform_type, axes=axes)  # type: ignore[no-any-return]
    out = np.empty_like(array)
    for axis in axes:
        array = _along(_cosine_lines, array, axis, out, transform_type=transform_type)
    return array


def rfft2_padded(plane: Array, padded: tuple[int, int], out: Array | None = None) -> Array:
    """Transform a real plane (ny, nx) padded with zeros to (my, mx): to (my, mx//2 + 1), in `out` if given.

    The rows of zeros are not transformed along x.
    """
    ny = plane.shape[0]
    if out is None:
        shape = padded[0], padded[1] // 2 + 1
        out = np.empty(shape, dtype=np.result_type(plane.dtype, np.complex64))
    out[ny:] = 0
    in_bands(_transform_rows, _groups(ny), out.size // 2, plane, padded[1], out)
    return _along(_complex_lines, out, 0, out)


def irfft2_cropped(modes: Array, padded: tuple[int, int], shape: tuple[int, int]) -> Array:
    """Undo `rfft2_padded` and return the corner (ny, nx) of the plane; the modes are overwritten."""
    ny, nx = shape
    _along(_complex_lines, modes, 0, modes, forward=False)
    out = np.empty((ny, nx), dtype=modes.real.dtype)
    in_bands(_undo_rows, _groups(ny), modes.size // 2, modes, padded[1], out)
    return out


def real_parts(modes: Array) -> Array:
    """View complex modes (my, mx) as their real and imaginary parts (my, mx, 2)."""
    return modes.view(modes.real.dtype).reshape(*modes.shape, 2)


def wavenumbers(n: int, spacing: float, *, real: bool = False) -> Array:
    """Return the wavenumbers 2 pi k / (n spacing) of a transform, in rad m-1.

    `real` keeps the non-negative half that `rfft` returns.
    """
    step = 2.0 * np.pi / (n * spacing)
    index = np.arange(n // 2 + 1) if real else np.fft.fftfreq(n, 1.0 / n)
    return np.asarray(index * step)


@cache
def _scipy() -> Any:
    """Return scipy.fft, imported at the first transform: it loads more slowly than numpy."""
    import scipy.fft

    return scipy.fft


@cache
def _ducc0_installed() -> bool:
    return importlib.util.find_spec("ducc0") is not None


def _ducc0() -> Any:
    import ducc0

    return ducc0.fft


def _real_lines(array: Array, axis: int, out: Array) -> None:
    """Transform real lines along an axis into modes."""
    if library() == "ducc0":
        _ducc0().r2c(array, axes=(axis,), out=out, nthreads=1)
    else:
        out[...] = _scipy().rfft(array, axis=axis)


def _real_lines_back(modes: Array, axis: int, out: Array) -> None:
    """Transform modes along an axis into real lines."""
    n = out.shape[axis]
    if library() == "ducc0":
        _ducc0().c2r(modes, axes=(axis,), lastsize=n, forward=False, inorm=2, out=out, nthreads=1)
    else:
        out[...] = _scipy().irfft(modes, n, axis)


def _complex_lines(modes: Array, axis: int, out: Array, *, forward: bool = True) -> None:
    """Transform complex lines along an axis, which may be `out`."""
    if library() == "ducc0":
        _ducc0().c2c(modes, axes=(axis,), forward=forward, inorm=0 if forward else 2, out=out, nthreads=1)
        return
    _in_place(_scipy().fft if forward else _scipy().ifft, modes, out, axis=axis)


def _cosine_lines(array: Array, axis: int, out: Array, *, transform_type: int) -> None:
    """Transform real lines along an axis, which may be `out`, into their cosine modes."""
    if library() == "ducc0":
        _ducc0().dct(array, type=transform_type, axes=(axis,), out=out, nthreads=1)
        return
    _in_place(_scipy().dct, array, out, type=transform_type, axis=axis)


def _in_place(call: Any, array: Array, out: Array, **options: Any) -> None:
    """Call scipy for `out`, which may be the array: in half the time of a new array."""
    if array is not out:
        out[...] = array
    result = call(out, overwrite_x=True, **options)
    if not np.may_share_memory(result, out):
        out[...] = result


def _along(transform: Callable[..., None], array: Array, axis: int, out: Array, **options: Any) -> Array:
    """Transform all lines along one axis into `out`, on the threads of `base.resources`.

    ducc0, and SciPy from 1.18 on, transform lines together in groups and the remaining ones singly, with
    different rounding. Their own threads split the groups, which changes bits with their number; here a
    plane is split between groups only.
    """
    axis %= array.ndim
    if array.ndim > 2 and axis > 0 and array.size > SMALL:
        for plane, result in zip(array, out, strict=True):
            _along(transform, plane, axis - 1, result, **options)
        return out
    if array.ndim != 2 or array.size <= SMALL:
        transform(array, axis, out, **options)
        return out
    lines = array.shape[1 - axis]

    def transform_band(start: int, stop: int) -> None:
        part = _lines(start, stop, lines)
        cut = (part, slice(None)) if axis == 1 else (slice(None), part)
        result = out[cut]
        transform(result if array is out else array[cut], axis, result, **options)

    in_bands(transform_band, _groups(lines), array.size // 2)
    return out


def _groups(lines: int) -> int:
    """Return the number of groups of lines; the last one has the remaining lines too."""
    return max(1, lines // GROUP)


def _lines(start: int, stop: int, lines: int) -> slice:
    """Return the lines of the groups from `start` to `stop`."""
    return slice(start * GROUP, lines if stop >= _groups(lines) else stop * GROUP)


def _chunks(start: int, stop: int, lines: int, line_bytes: int, size: int = 1 << 19) -> Iterator[slice]:
    """Yield the lines of the groups from `start` to `stop`, some groups of so many bytes at a time.

    With ducc0 sizes of 2^14 to 2^22 take the same time within 2 % at 1024 and 2048 points, 2^14 takes 8 %
    longer at 256. With SciPy 2^18 and 2^21 take 5 and 7 % longer at 768 points.
    """
    step = max(1, size // (GROUP * line_bytes))
    for first in range(start, stop, step):
        yield _lines(first, min(first + step, stop), lines)


def _transform_rows(start: int, stop: int, plane: Array, width: int, modes: Array) -> None:
    """Transform groups of rows, padded with zeros to a width."""
    ny, nx = plane.shape
    buffer = np.zeros((0, 0))
    for part in _chunks(start, stop, ny, width * plane.itemsize):
        rows = plane[part]
        if nx < width:
            if len(buffer) < len(rows):
                buffer = np.zeros((len(rows), width), dtype=plane.dtype)
            buffer[: len(rows), :nx] = rows
            rows = buffer[: len(rows)]
        _real_lines(rows, 1, modes[part])


def _undo_rows(start: int, stop: int, modes: Array, width: int, out: Array) -> None:
    """Transform groups of rows back, and crop them.

    Rows a multiple of 4096 bytes apart compete for the same few lines of the first-level cache. ducc0 writes
    16 rows of single precision at a time: at 1024 points or more in a row that takes three times as long.
    """
    ny, nx = out.shape
    conflicts = out.itemsize < np.dtype(np.float64).itemsize and out.strides[0] % 4096 == 0
    buffer = np.empty((0, 0))
    for part in _chunks(start, stop, ny, width * out.itemsize):
        if nx == width and not conflicts:
            _real_lines_back(modes[part], 1, out[part])
            continue
        count = part.stop - part.start
        if len(buffer) < count:
            buffer = np.empty((count, width + 16), dtype=out.dtype)  # rows not so far apart
        rows = buffer[:count, :width]
        _real_lines_back(modes[part], 1, rows)
        out[part] = rows[:, :nx]


def _forward(array: Array, axes: tuple[int, ...], out: Array | None) -> Array:
    if array.size <= SMALL:
        last = tuple(axis + array.ndim for axis in axes)
        if library() == "ducc0":
            return _ducc0().r2c(array, axes=last, out=out, nthreads=1)  # type: ignore[no-any-return]
        return _stored(_scipy().rfftn(array, axes=last), out)
    if out is None:
        shape = (*array.shape[:-1], array.shape[-1] // 2 + 1)
        out = np.empty(shape, dtype=np.result_type(array.dtype, np.complex64))
    _along(_real_lines, array, -1, out)
    return _along(_complex_lines, out, -2, out) if len(axes) == 2 else out


def _backward(
    modes: Array, axes: tuple[int, ...], shape: tuple[int, ...], out: Array | None, overwrite: bool
) -> Array:
    if modes.size <= SMALL:
        last = tuple(axis + modes.ndim for axis in axes)
        if library() == "scipy":
            return _stored(_scipy().irfftn(modes, s=shape, axes=last, overwrite_x=overwrite), out)
        return _ducc0().c2r(  # type: ignore[no-any-return]
            modes,
            axes=last,
            lastsize=shape[-1],
            forward=False,
            inorm=2,
            out=out,
            nthreads=1,
            allow_overwriting_input=overwrite,
        )
    if len(axes) == 2:
        modes = _along(_complex_lines, modes, -2, modes if overwrite else np.empty_like(modes), forward=False)
    if out is None:
        out = np.empty((*modes.shape[:-1], shape[-1]), dtype=modes.real.dtype)
    if modes.ndim == 2:
        in_bands(_undo_rows, _groups(modes.shape[0]), modes.size, modes, shape[-1], out)
        return out
    return _along(_real_lines_back, modes, -1, out)


def _stored(array: Array, out: Array | None) -> Array:
    """Return an array, in `out` if it is given."""
    if out is None:
        return array
    out[...] = array
    return out
