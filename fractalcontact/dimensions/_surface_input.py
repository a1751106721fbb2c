"""Check an input surface and split it into single surfaces with scaled heights."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import Grid, core_dims, read_grid
from fractalcontact.base.labelled import check_leading
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.validation import Problems

Scales = tuple[float, float] | None

ROUNDING = 1e-12  # of the range of heights
NOTABLE_SHARE = 0.1  # of the points, or of their squares: from here on repeated ones, or spikes, matter
MIDDLE = 128  # points to each side of the middle that are inspected for interpolation
LARGEST = 4096  # edge of what is transformed at a time of a surface that is not in memory, 134 MB
SLAB = 1 << 25  # heights read at a time from a surface that is not in memory


@dataclass
class Surface:
    """One surface or profile with its heights above the lowest, in units of a power of two metres.

    Attributes
    ----------
    stack : DataArray
        Dims (..., y, x), or (..., x) for a profile.
    grid : Grid
    index : tuple of int
        The place of this surface along the leading dims.
    """

    stack: xr.DataArray
    grid: Grid
    index: tuple[int, ...] = ()
    _unit: float = 1.0
    _heights: Array | None = None
    _is_plane: bool | None = None

    @property
    def source(self) -> xr.DataArray:
        """Dims (y, x), or (x,) for a profile."""
        return self.stack.isel(dict(zip(self.stack.dims, self.index, strict=False)))

    @property
    def heights(self) -> Array:
        """Scaled heights, shape (ny, nx); ny = 1 for a profile. NaN where nothing was observed."""
        if self._heights is None:
            raw = self.raw
            low = float(np.nanmin(raw))
            self._unit = power_of_two(float(np.nanmax(raw)) - low)
            self._heights = raw - low
            self._heights *= 1.0 / self._unit
        return self._heights

    @property
    def unit(self) -> float:
        """Unit of `heights` in m, a power of two."""
        _ = self.heights
        return self._unit

    @property
    def raw(self) -> Array:
        """Heights in m, shape (ny, nx)."""
        return np.asarray(self.stack.variable.data[self.index], dtype=np.float64).reshape(self.shape)

    def with_heights(self, heights: Array) -> Surface:
        """Return a surface with other scaled heights in the same unit."""
        return Surface(self.stack, self.grid, self.index, self.unit, heights)

    @property
    def is_lazy(self) -> bool:
        """Whether the heights are not in memory yet."""
        return self._heights is None and has_blocks(self.stack)

    @property
    def axes(self) -> int:
        """Number of axes: 2 for a surface, 1 for a profile."""
        return len(self.grid.shape)

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx), with ny = 1 for a profile."""
        return (1, *self.grid.shape)[-2:]  # type: ignore[return-value]

    @property
    def spacing(self) -> tuple[float, float]:
        """(dy, dx) in m; dy = dx for a profile."""
        return self.grid.spacing[0], self.grid.spacing[-1]

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Which of (y, x) are periodic; y of a profile is not."""
        return (False, *self.grid.periodic)[-2:]  # type: ignore[return-value]

    @property
    def finest_scale(self) -> float:
        """Shortest wavelength in m that the points of a gridded surface resolve; 0 if all are measured."""
        scale = float(self.source.coords["finest_scale"]) if "finest_scale" in self.source.coords else 0.0
        return scale if scale > 2.0 * min(self.grid.spacing) else 0.0

    def resolved(self, scales: Scales) -> Scales:
        """Return the window of lengths: as asked for, or without those that gridding has made."""
        if scales is not None or not self.finest_scale:
            return scales
        return self.finest_scale, 4.0 * max(self.grid.extent)

    @property
    def relative_spacing(self) -> tuple[float, ...]:
        """Spacings divided by dx: (dy/dx, 1), or (1,) for a profile."""
        return tuple(spacing / self.grid.spacing[-1] for spacing in self.grid.spacing)

    @property
    def plane_spacing(self) -> tuple[float, float]:
        """(dy/dx, 1), also for a profile."""
        return self.spacing[0] / self.spacing[1], 1.0

    def middle(self) -> Surface:
        """Return the middle of a surface in blocks that is too large for a transform; any other as it is."""
        if not self.is_lazy or math.prod(self.grid.shape) <= LARGEST**2:
            return self
        dims, cuts = core_dims(self.source), middle_slices(self.grid.shape, LARGEST ** (3 - self.axes))
        part = self.source.isel(dict(zip(dims, cuts, strict=True))).load()
        return Surface(part, read_grid(part, dims))

    @property
    def is_complete(self) -> bool:
        """Whether no height is missing."""
        heights = self.raw if self._heights is None else self._heights
        return bool(np.isfinite(heights.min()))

    @property
    def is_constant(self) -> bool:
        """Whether all observed heights are equal."""
        return bool(np.nanmax(self.raw) == np.nanmin(self.raw))

    @property
    def is_plane(self) -> bool:
        """Whether all observed heights lie on a plane, except for rounding."""
        if self._is_plane is None:
            heights = self.heights
            # heights far from zero are rounded to coarser numbers
            rounding = max(ROUNDING, 4.0 * np.spacing(float(np.nanmax(np.abs(self.raw)))) / self.unit)
            # second differences of a few rows and columns mostly make the least-squares plane unnecessary
            bends = [
                np.diff(lines, 2) for lines in (heights[:: 1 + heights.shape[0] // 16], heights[:, ::64].T)
            ]
            is_bent = any(np.nanmax(np.abs(bend), initial=0.0) > 1e3 * rounding for bend in bends)
            self._is_plane = not is_bent and self._distance_from_plane() <= rounding
        return self._is_plane

    @property
    def linear_share(self) -> float:
        """Share of heights in the middle that lie on the straight line through their neighbours, to rounding.

        Linear interpolation makes them: 0.5 % where the cells are as far apart as the points, 12 % at half of
        that. Measured heights have none. Rounded ones do not count: their second differences repeat a few
        values, also once a plane was subtracted.
        """
        share, middle = 0.0, self._middle
        for lines in (middle, middle.T):
            bend = lines[:-2] - 2.0 * lines[1:-1] + lines[2:]
            known = int(np.count_nonzero(np.isfinite(bend)))
            if not known:
                continue
            largest = float(np.nanmax(np.abs(lines)))
            rounding = 8.0 * np.spacing(largest)
            straight = lines[1:-1][np.abs(bend) <= rounding]
            straight = np.rint(straight * (1e9 / largest)) if largest > 0 else straight
            bent = np.rint(bend[np.abs(bend) > rounding] / (8.0 * rounding))
            # distinct heights of measured points; kinks along one edge of an interpolation may be alike
            are_distinct = np.unique(straight).size > (1.0 - NOTABLE_SHARE) * straight.size
            if are_distinct and np.unique(bent).size >= 0.5 * bent.size:
                share = max(share, straight.size / known)
        return share

    @property
    def is_enlarged(self) -> bool:
        """Whether a tenth of the rows or columns in the middle repeat the one before.

        They do so at equal distances there; where heights were rounded, or rows were padded, they do not.
        """
        for lines in (self._middle, self._middle.T):
            starts = np.flatnonzero((lines[1:] != lines[:-1]).any(axis=1))
            if 2 < len(starts) < (1.0 - NOTABLE_SHARE) * (starts[-1] - starts[0]):
                apart = np.abs(starts - np.linspace(starts[0], starts[-1], len(starts))).max()
                if apart <= 1.0:
                    return True
        return False

    @property
    def _middle(self) -> Array:
        return self.raw[tuple(slice(max(0, n // 2 - MIDDLE), n // 2 + MIDDLE) for n in self.shape)]

    def _distance_from_plane(self) -> float:
        """Return the largest distance from the least-squares plane, in scaled height."""
        observed = np.isfinite(self.heights)
        y, x = (index.astype(float) for index in np.nonzero(observed))
        columns = np.stack([np.ones(x.size), x, y][: 1 + self.axes], axis=1) / max(self.shape)
        q = np.linalg.qr(columns)[0]
        heights = self.heights[observed] - self.heights[observed].mean()
        return float(np.abs(heights - q @ (q.T @ heights)).max())

    def slabs(self, overlap: int) -> Iterator[tuple[Array, int]]:
        """Yield slabs of rows in m, each with up to `overlap` rows of the next and the number of its own."""
        if not self.is_lazy or self.axes == 1:
            yield np.ascontiguousarray(self.raw), self.shape[0]
            return
        ny, nx = self.shape
        rows = max(SLAB // nx, 4 * overlap, 1)
        for start in range(0, ny, rows):
            slab = self.source.isel(y=slice(start, start + rows + overlap)).values
            yield np.ascontiguousarray(slab, dtype=np.float64), min(rows, ny - start)


def check_surface(
    problems: Problems,
    *,
    smallest: int = 3,
    gaps: bool = True,
    profile: bool = True,
    reserved: Collection[str] = (),
) -> bool:
    """Check the argument `surface`; `read_surfaces` then splits it.

    Parameters
    ----------
    problems : Problems
    smallest : int
        Smallest number of points along each axis.
    profile : bool
        Allow a profile, dims (..., x), beside planes, dims (..., y, x).
    gaps : bool
        Allow NaN.
    reserved : collection of str
        Names of the result, which no leading dim may have.
    """
    before, surface = len(problems.messages), problems.given.surface
    problems.surface("surface", finite=False, smallest=smallest, leading=True, profile=profile)
    check_leading(surface, reserved, problems)
    if len(problems.messages) > before or has_blocks(surface):
        return len(problems.messages) == before
    _check_heights(problems, surface.values, len(core_dims(surface)), gaps)
    return len(problems.messages) == before


def check_scales(problems: Problems, *, is_valid: bool) -> None:
    """Check a window of lengths (low, high) in m; it must overlap the lengths of a valid `surface`."""
    scales, surface = problems.given.scales, problems.given.surface
    if scales is None or not problems.numbers("scales", above=0):
        return
    values = np.atleast_1d(np.asarray(scales, dtype=np.float64))
    if values.size != 2 or not values[0] < values[-1]:
        problems.add("scales", "two ascending lengths in metres, (low, high)")
    elif is_valid:
        grid = read_grid(surface, core_dims(surface))
        shortest, longest = min(grid.spacing), max(grid.extent)
        overlaps = values[0] < longest and values[1] > shortest
        expected = f"a window that meets the lengths of the surface, {shortest:g} m to {longest:g} m"
        problems.require(bool(overlaps), "scales", expected)


def read_surfaces(surface: xr.DataArray) -> list[Surface]:
    """Split a valid surface along its leading dims; the order is that of these dims flattened."""
    core = core_dims(surface)
    grid = read_grid(surface, core)
    leading = [dim for dim in surface.dims if dim not in core]
    indices = np.ndindex(*(surface.sizes[dim] for dim in leading))
    return [Surface(surface, grid, index) for index in indices]


def read_scales(scales: Any) -> Scales:
    """Return a valid window of lengths as two numbers."""
    return None if scales is None else (float(scales[0]), float(scales[1]))


def between(lengths: Array, scales: Scales) -> Array:
    """Return which lengths lie in a window, its ends included except for rounding; all without a window."""
    if scales is None:
        return np.ones(lengths.shape, dtype=bool)
    return np.asarray((lengths >= scales[0] * (1 - 1e-9)) & (lengths <= scales[1] * (1 + 1e-9)))


def _check_heights(problems: Problems, heights: Array, axes: int, gaps: bool) -> None:
    if heights.size == 0:
        problems.add("surface", "at least one surface", f"shape {heights.shape}")
        return
    # without the repetitions of a broadcast, as of the surface of a scene that is planned
    distinct = heights[tuple(slice(1 if step == 0 else None) for step in heights.strides)]
    if np.isfinite(distinct.min()) and np.isfinite(distinct.max()):
        return
    if not gaps:
        problems.finite("surface", heights, remedy="see fractalcontact.surfaces.fill")
    elif not np.isfinite(heights).any(axis=tuple(range(-axes, 0))).all():
        problems.add("surface", "observed heights", "nothing but NaN")


def middle_slices(shape: Iterable[int], edge: int) -> tuple[slice, ...]:
    """Return the slices of the middle `edge` points along each axis, or of all where there are fewer."""
    return tuple(slice(max(0, n - edge) // 2, (n + edge) // 2) for n in shape)
