"""The block on its face: which cells it covers, how far it can travel, what lies under it after a shear.

Shifts are counted in cells, (y, x). A whole shift is a copy and exact. A fractional shift along an axis
that wraps is band-limited (Fourier) and exact for what the grid resolves; along a free axis it is a
quintic spline through the heights, whose error for a wave of wavenumber k falls as (k * spacing)^6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]
Pair = tuple[float, float]

WHOLE = 1e-6  # a shear this close to whole cells, in cells, is a whole shift
_LINES, _SHORTEST, _MARGIN = 256, 40, 2  # of the lines on which the error of a spline is measured
_REACH = 48  # beyond this many cells a height no longer moves a quintic spline (0.43^48 = 3e-18)


@dataclass(frozen=True)
class Block:
    """The sliding block: shape of its face, its own cells, its first cell, spacing (m), wrap; all (y, x)."""

    face: tuple[int, int]
    cells: tuple[int, int]
    start: tuple[int, int]
    spacing: Pair
    wraps: tuple[bool, bool]

    @property
    def edges(self) -> Pair:
        """Edge lengths in metres."""
        return self.cells[0] * self.spacing[0], self.cells[1] * self.spacing[1]

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Say along which axes the block is a whole period."""
        return tuple(  # type: ignore[return-value]
            wraps and n == b for wraps, n, b in zip(self.wraps, self.face, self.cells, strict=True)
        )

    @property
    def slices(self) -> tuple[slice, slice]:
        """The block in its face, before any shear."""
        return tuple(slice(a, a + b) for a, b in zip(self.start, self.cells, strict=True))  # type: ignore[return-value]

    def travel(self, unit: Pair) -> float:
        """Return the greatest shear (m) towards the unit vector (y, x) that keeps the block on its face."""
        longest = math.inf
        for axis, component in enumerate(unit):
            if self.wraps[axis] or component == 0:
                continue
            before = self.start[axis]
            room = self.face[axis] - self.cells[axis] - before if component > 0 else before
            longest = min(longest, room * self.spacing[axis] / abs(component))
        return longest

    def shift(self, shear: float, unit: Pair) -> Pair:
        """Return the shift in cells (y, x); whole within `WHOLE`."""
        return _snapped(shear * unit[0] / self.spacing[0]), _snapped(shear * unit[1] / self.spacing[1])


def is_whole(shift: Pair) -> bool:
    """Say whether a shift needs no interpolation."""
    return all(part == math.floor(part) for part in shift)


def centred(face: tuple[int, int], cells: tuple[int, int]) -> tuple[int, int]:
    """Return the first cell of a block in the middle of its face."""
    return (face[0] - cells[0]) // 2, (face[1] - cells[1]) // 2


def heights_under(face: Array, block: Block, shift: Pair, *, degree: int = 5) -> Array:
    """Return the heights of the face under the block after a shift.

    Parameters
    ----------
    face : ndarray, shape (ny, nx)
        May hold NaN; the result is NaN where it was needed.
    block : Block
    shift : pair of float
        Cells (y, x), inside the travel.
    degree : int
        Degree of the spline along free axes.

    Returns
    -------
    ndarray, shape block.cells
        A view of `face` where nothing had to be computed.
    """
    part = face
    # whole shifts first: they crop, and leave less to interpolate
    for axis in sorted((0, 1), key=lambda a: shift[a] != math.floor(shift[a])):
        part = _move(part, axis, block, shift[axis], degree)
    return part


def _move(part: Array, axis: int, block: Block, shift: float, degree: int) -> Array:
    whole, n, size = math.floor(shift), block.face[axis], block.cells[axis]
    first = block.start[axis] + whole
    fraction = shift - whole
    if fraction and block.wraps[axis]:
        part, fraction = _fourier(part, axis, fraction), 0.0
    if fraction:
        return _spline(part, axis, first + fraction, size, degree)
    if 0 <= first <= n - size:
        cut = slice(first, first + size)
        return part[cut] if axis == 0 else part[:, cut]
    return np.take(part, np.arange(first, first + size) % n, axis=axis)


def _fourier(part: Array, axis: int, fraction: float) -> Array:
    """Shift periodic lines by a fraction of a cell; the ambiguous Nyquist wave keeps its real part."""
    lines = np.ascontiguousarray(np.moveaxis(part, axis, -1))
    n = lines.shape[-1]
    phase = np.exp(1j * fft.wavenumbers(n, 1.0, real=True) * fraction)
    if n % 2 == 0:
        phase[-1] = phase[-1].real
    return np.moveaxis(fft.irfft(fft.rfft(lines) * phase, n), -1, axis)


def spline_error(face: Array, axis: int) -> float:
    """Return the rms error of the spline half way between the points of a face, along one axis.

    Splines through every second and every fourth point are compared with the heights between them; the ratio
    of the two errors tells what one through all points would be: it is 2^H on a self-affine face of Hurst
    exponent H, up to 2^6 on a smooth one. NaN where the face has no long enough line without gaps.
    """
    lines = np.moveaxis(face, axis, -1)
    lines = lines[np.isfinite(lines).all(axis=1)]
    lines = lines[:: max(1, len(lines) // _LINES)]
    if lines.size == 0 or lines.shape[-1] < _SHORTEST:
        return math.nan
    near, far = (_missed(lines, step) for step in (2, 4))
    return near * min(max(near / far, 2.0**-6), 1.0) if far > 0 else near


def _missed(lines: Array, step: int) -> float:
    """Return by how much a spline through every `step`-th point misses the middle ones, in the rms."""
    from scipy.interpolate import make_interp_spline

    nodes, middles = lines[:, ::step], lines[:, step // 2 :: step]
    spline = make_interp_spline(np.arange(nodes.shape[1]), nodes, k=5, axis=1, check_finite=False)
    inside = slice(_MARGIN, min(nodes.shape[1] - 1, middles.shape[1]) - _MARGIN)
    places = np.arange(nodes.shape[1])[inside] + 0.5
    return float(np.sqrt(np.mean((np.asarray(spline(places)) - middles[:, inside]) ** 2)))


def _spline(part: Array, axis: int, first: float, size: int, degree: int) -> Array:
    from scipy.interpolate import make_interp_spline

    low, high = math.floor(first), math.floor(first) + size  # nodes next to the ends of the block
    low, high = _clean_window(part, axis, low, high)
    nodes = np.arange(low, high + 1)
    degree = min(degree, nodes.size - 1 if nodes.size % 2 == 0 else nodes.size - 2)
    values = np.take(part, nodes, axis=axis)
    spline = make_interp_spline(nodes - low, values, k=degree, axis=axis, check_finite=False)
    return np.asarray(spline(first - low + np.arange(size)))


def _clean_window(part: Array, axis: int, low: int, high: int) -> tuple[int, int]:
    """Widen the nodes low..high by the reach of the spline, but not across missing heights."""
    n = part.shape[axis]
    bad = np.flatnonzero(~np.isfinite(part).all(axis=1 - axis))
    before, after = bad[bad < low], bad[bad > high]
    floor = before[-1] + 1 if before.size else 0
    ceiling = after[0] - 1 if after.size else n - 1
    return int(max(floor, low - _REACH)), int(min(ceiling, high + _REACH))


def _snapped(cells: float) -> float:
    nearest = float(math.floor(cells + 0.5))
    return nearest if abs(cells - nearest) <= WHOLE else cells
