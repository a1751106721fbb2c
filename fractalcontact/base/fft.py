"""Fourier transforms of real planes; no other module calls a transform library.

The library is ducc0 where it is installed (extra `fast`; about twice as fast, and it writes into a given
array), otherwise scipy. `FRACTALCONTACT_FFT=scipy` selects scipy. The transforms act on the last two axes (or
the last one); the inverse has the factor 1/n. No bit depends on the number of threads.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands, thread_count

SMALL = 1 << 16  # elements up to which a transform is a single call of ducc0: too few for two threads
GROUP = 16  # lines: a multiple of the number that ducc0 transforms together


def library() -> str:
    """Name the transform library in use, "ducc0" or "scipy"."""
    return "ducc0" if _ducc0_installed() and os.environ.get("FRACTALCONTACT_FFT", "") != "scipy" else "scipy"


def writes_in_place() -> bool:
    """Return whether `out` saves memory: scipy makes a new array and copies it."""
    return library() == "ducc0"


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
        self.in_place = writes_in_place()
        size, half = shape[0] * shape[1], shape[0] * (shape[1] // 2 + 1)
        self._r2c = _ducc0().r2c if self.in_place and size <= SMALL else None
        self._c2r = _ducc0().c2r if self.in_place and half <= SMALL else None

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
    if library() == "ducc0":
        return _along(_ducc0().c2c, modes, -1, np.empty_like(modes), forward=False, inorm=2)
    return _scipy().ifft(modes, workers=_scipy_threads())  # type: ignore[no-any-return]


def dct(array: Array, transform_type: int, axes: tuple[int, ...]) -> Array:
    """Return the cosine transform of type 1, 2 or 3 along `axes`, without normalisation.

    Type 2 sums 2 a_j cos(pi k (j + 1/2) / n). Type 1, with n + 1 >= 2 values, is a_0 + (-1)^k a_n plus the
    sum of 2 a_j cos(pi k j / n), the real transform of all 2 n points of an even line. Type 3 is the
    transpose of type 2 up to the factor of its first value.
    """
    if library() == "ducc0":
        return _axis_by_axis(_ducc0().dct, array, axes, type=transform_type)
    return _scipy().dctn(array, type=transform_type, axes=axes, workers=_scipy_threads())  # type: ignore[no-any-return]


def rfft2_padded(plane: Array, padded: tuple[int, int], out: Array | None = None) -> Array:
    """Transform a real plane (ny, nx) padded with zeros to (my, mx): to (my, mx//2 + 1).

    The rows of zeros are not transformed along x. `out` is used if the library can write into it.
    """
    if library() == "ducc0":
        ny = plane.shape[0]
        if out is None:
            shape = padded[0], padded[1] // 2 + 1
            out = np.empty(shape, dtype=np.result_type(plane.dtype, np.complex64))
        out[ny:] = 0
        in_bands(_transform_rows, _groups(ny), out.size // 2, plane, padded[1], out)
        return _along(_ducc0().c2c, out, 0, out)
    threads = _scipy_threads()
    modes = _scipy().rfft(plane, n=padded[1], axis=1, workers=threads)
    return _scipy().fft(modes, n=padded[0], axis=0, workers=threads)  # type: ignore[no-any-return]


def irfft2_cropped(
    modes: Array, padded: tuple[int, int], shape: tuple[int, int], out: Array | None = None
) -> Array:
    """Undo `rfft2_padded` and return the corner (ny, nx) of the plane; the modes are overwritten.

    `out` is used if the library can write into it.
    """
    ny, nx = shape
    if library() == "ducc0":
        _along(_ducc0().c2c, modes, 0, modes, forward=False, inorm=2)
        out = np.empty((ny, nx), dtype=modes.real.dtype) if out is None else out
        in_bands(_undo_rows, _groups(ny), modes.size // 2, modes, padded[1], out)
        return out
    threads = _scipy_threads()
    modes = _scipy().ifft(modes, axis=0, workers=threads, overwrite_x=True)[:ny]
    return np.ascontiguousarray(_scipy().irfft(modes, n=padded[1], axis=1, workers=threads)[:, :nx])


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
def _splits_groups() -> bool:
    """Return whether SciPy has the transforms of ducc0 (from 1.18), whose threads change bits (`_along`)."""
    import scipy

    return tuple(map(int, scipy.__version__.split(".")[:2])) >= (1, 18)


def _scipy_threads() -> int:
    return 1 if _splits_groups() else thread_count()


@cache
def _ducc0_installed() -> bool:
    return importlib.util.find_spec("ducc0") is not None


def _ducc0() -> Any:
    import ducc0

    return ducc0.fft


def _along(call: Any, array: Array, axis: int, out: Array, **options: Any) -> Array:
    """Transform all lines along one axis into `out` with ducc0, on the threads of `base.resources`.

    ducc0 transforms lines together in groups and the remaining ones singly, with different rounding. Its own
    threads split the groups, which changes bits with their number; here a plane is split between groups only.
    """
    axis %= array.ndim
    if array.ndim > 2 and axis > 0 and array.size > SMALL:
        for plane, result in zip(array, out, strict=True):
            _along(call, plane, axis - 1, result, **options)
        return out
    if array.ndim != 2 or array.size <= SMALL:
        return call(array, axes=(axis,), out=out, nthreads=1, **options)  # type: ignore[no-any-return]
    lines = array.shape[1 - axis]

    def transform(start: int, stop: int) -> None:
        part = _lines(start, stop, lines)
        cut = (part, slice(None)) if axis == 1 else (slice(None), part)
        call(array[cut], axes=(axis,), out=out[cut], nthreads=1, **options)

    in_bands(transform, _groups(lines), array.size // 2)
    return out


def _groups(lines: int) -> int:
    """Return the number of groups of lines; the last one has the remaining lines too."""
    return max(1, lines // GROUP)


def _lines(start: int, stop: int, lines: int) -> slice:
    """Return the lines of the groups from `start` to `stop`."""
    return slice(start * GROUP, lines if stop >= _groups(lines) else stop * GROUP)


def _chunks(start: int, stop: int, lines: int, line_bytes: int, size: int = 1 << 18) -> Iterator[slice]:
    """Yield the lines of the groups from `start` to `stop`, some groups of so many bytes at a time.

    Sizes of 2^14 to 2^22 take the same time within 2 % at 1024 and 2048 points, 2^14 takes 8 % longer at 256.
    """
    step = max(1, size // (GROUP * line_bytes))
    for first in range(start, stop, step):
        yield _lines(first, min(first + step, stop), lines)


def _transform_rows(start: int, stop: int, plane: Array, width: int, modes: Array) -> None:
    """Transform groups of rows, padded with zeros to a width."""
    (ny, nx), call = plane.shape, _ducc0().r2c
    if nx == width:
        part = _lines(start, stop, ny)
        call(plane[part], axes=(1,), out=modes[part], nthreads=1)
        return
    buffer = np.zeros((0, 0))
    for part in _chunks(start, stop, ny, width * plane.itemsize):
        count = part.stop - part.start
        if len(buffer) < count:
            buffer = np.zeros((count, width), dtype=plane.dtype)
        buffer[:count, :nx] = plane[part]
        call(buffer[:count], axes=(1,), out=modes[part], nthreads=1)


def _undo_rows(start: int, stop: int, modes: Array, width: int, out: Array) -> None:
    """Transform groups of rows back, and crop them.

    Rows a multiple of 4096 bytes apart compete for the same few lines of the first-level cache. ducc0 writes
    16 rows of single precision at a time: at 1024 points or more in a row that takes three times as long.
    """
    (ny, nx), call = out.shape, _ducc0().c2r
    options = {"axes": (1,), "lastsize": width, "forward": False, "inorm": 2, "nthreads": 1}
    conflicts = out.itemsize < np.dtype(np.float64).itemsize and out.strides[0] % 4096 == 0
    if nx == width and not conflicts:
        part = _lines(start, stop, ny)
        call(modes[part], out=out[part], **options)
        return
    buffer = np.empty((0, 0))
    for part in _chunks(start, stop, ny, width * out.itemsize):
        count = part.stop - part.start
        if len(buffer) < count:
            buffer = np.empty((count, width + 16), dtype=out.dtype)  # rows not so far apart
        rows = buffer[:count, :width]
        call(modes[part], out=rows, **options)
        out[part] = rows[:, :nx]


def _axis_by_axis(call: Any, array: Array, axes: tuple[int, ...], **options: Any) -> Array:
    """Transform one axis after the other with ducc0."""
    if array.size <= SMALL:
        axes = tuple(axis % array.ndim for axis in axes)
        return call(array, axes=axes, nthreads=1, **options)  # type: ignore[no-any-return]
    out = np.empty_like(array)
    for axis in axes:
        array = _along(call, array, axis, out, **options)
    return array


def _forward(array: Array, axes: tuple[int, ...], out: Array | None) -> Array:
    if library() == "ducc0":
        if array.size <= SMALL:
            last = tuple(axis + array.ndim for axis in axes)
            return _ducc0().r2c(array, axes=last, out=out, nthreads=1)  # type: ignore[no-any-return]
        if out is None:
            shape = (*array.shape[:-1], array.shape[-1] // 2 + 1)
            out = np.empty(shape, dtype=np.result_type(array.dtype, np.complex64))
        _along(_ducc0().r2c, array, -1, out)
        return _along(_ducc0().c2c, out, -2, out) if len(axes) == 2 else out
    modes = _scipy().rfftn(array, axes=axes, workers=_scipy_threads())
    if out is None:
        return modes  # type: ignore[no-any-return]
    out[...] = modes
    return out


def _backward(
    modes: Array, axes: tuple[int, ...], shape: tuple[int, ...], out: Array | None, overwrite: bool
) -> Array:
    if library() == "ducc0":
        if modes.size <= SMALL:
            return _ducc0().c2r(  # type: ignore[no-any-return]
                modes,
                axes=tuple(axis + modes.ndim for axis in axes),
                lastsize=shape[-1],
                forward=False,
                inorm=2,
                out=out,
                nthreads=1,
                allow_overwriting_input=overwrite,
            )
        if len(axes) == 2:
            work_array = modes if overwrite else np.empty_like(modes)
            modes = _along(_ducc0().c2c, modes, -2, work_array, forward=False, inorm=2)
        if out is None:
            out = np.empty((*modes.shape[:-1], shape[-1]), dtype=modes.real.dtype)
        if modes.ndim == 2:
            in_bands(_undo_rows, _groups(modes.shape[0]), modes.size, modes, shape[-1], out)
            return out
        return _along(_ducc0().c2r, modes, -1, out, lastsize=shape[-1], forward=False, inorm=2)
    plane = _scipy().irfftn(modes, s=shape, axes=axes, workers=_scipy_threads(), overwrite_x=overwrite)
    if out is None:
        return plane  # type: ignore[no-any-return]
    out[...] = plane
    return out
