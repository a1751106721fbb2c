"""From a labelled surface to plain arrays in scaled units, one face at a time."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.coords import check_leading
from fractalcontact.base.grid import Grid, check_surface

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.base.checks import Problems

Array = np.ndarray[Any, np.dtype[Any]]
ROUNDING = 1e-12  # of the range of heights
DECADES = 250  # powers of ten of a metre: heights are scaled before anything is done with them
LEAST, MOST = 2.0**-450, 2.0**450  # m: ranges of heights whose squares and fourth powers are numbers
SLAB = 1 << 25  # heights read at a time from a surface that is not in memory


@dataclass
class Face:
    """One face or profile, its heights about a level of their own and in a power of two of a metre.

    Attributes
    ----------
    source : DataArray
        Dims (y, x), or (x,).
    grid : Grid
    """

    source: xr.DataArray
    grid: Grid
    _unit: float = 1.0
    _heights: Array | None = None
    _flat: bool | None = None

    @property
    def heights(self) -> Array:
        """Scaled heights, shape (ny, nx); a profile has one row. NaN where nothing was observed."""
        if self._heights is None:
            raw = self.raw
            low, high = float(raw.min()), float(raw.max())
            if np.isnan(low):
                low, high = float(np.nanmin(raw)), float(np.nanmax(raw))
            self._unit = float(np.ldexp(1.0, np.frexp(high - low)[1])) if high > low else 1.0
            self._heights = raw - low
            self._heights *= 1.0 / self._unit
        return self._heights

    @property
    def unit(self) -> float:
        """The unit of `heights` in m, a power of two."""
        _ = self.heights
        return self._unit

    @property
    def raw(self) -> Array:
        """Heights in m, shape (ny, nx)."""
        return np.asarray(self.source.values, dtype=np.float64).reshape(self.shape)

    @property
    def is_extreme(self) -> bool:
        """Squares of the heights in m would overflow or vanish."""
        return not self.is_lazy and not LEAST <= self.unit <= MOST and not self.is_constant

    def unitless(self) -> Face:
        """Return the same face with its scaled heights taken for metres."""
        return Face(self.source, self.grid, 1.0, self.heights, self._flat)

    @property
    def is_lazy(self) -> bool:
        """The heights are not in memory yet."""
        return self._heights is None and is_lazy(self.source)

    @property
    def axes(self) -> int:
        """2 for a surface, 1 for a profile."""
        return len(self.grid.shape)

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx), with ny = 1 for a profile."""
        return (1, *self.grid.shape)[-2:]  # type: ignore[return-value]

    @property
    def spacing(self) -> tuple[float, float]:
        """(dy, dx) in metres; dy = dx for a profile."""
        return self.grid.spacing[0], self.grid.spacing[-1]

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Which axes wrap; y of a profile does not."""
        return (False, *self.grid.periodic)[-2:]  # type: ignore[return-value]

    @property
    def steps(self) -> tuple[float, ...]:
        """Spacings over that of x."""
        return tuple(step / self.grid.spacing[-1] for step in self.grid.spacing)

    @property
    def plane_steps(self) -> tuple[float, float]:
        """(dy/dx, 1)."""
        return self.spacing[0] / self.spacing[1], 1.0

    @property
    def complete(self) -> bool:
        """No height is missing."""
        return bool(np.isfinite(self.raw.min()))

    @property
    def is_constant(self) -> bool:
        """All observed heights are the same."""
        return bool(np.nanmax(self.raw) == np.nanmin(self.raw))

    @property
    def is_plane(self) -> bool:
        """All observed heights lie on a plane, but for rounding."""
        if self._flat is None:
            heights = self.heights
            # far from zero the numbers themselves are steps
            least = max(ROUNDING, 4.0 * np.spacing(float(np.nanmax(np.abs(self.raw)))) / self.unit)
            # a few rows and columns that bend spare the search for a plane
            bends = [
                np.diff(part, 2) for part in (heights[:: 1 + heights.shape[0] // 16], heights[:, ::64].T)
            ]
            bent = any(np.nanmax(np.abs(bend), initial=0.0) > 1e3 * least for bend in bends)
            self._flat = not bent and self._departure() <= least
        return self._flat

    def _departure(self) -> float:
        """Largest distance from the plane of least squares, in scaled height."""
        seen = np.isfinite(self.heights)
        y, x = (place.astype(float) for place in np.nonzero(seen))
        columns = np.stack([np.ones(x.size), x, y][: 1 + self.axes], axis=1) / max(self.shape)
        q = np.linalg.qr(columns)[0]
        rest = self.heights[seen] - self.heights[seen].mean()
        return float(np.abs(rest - q @ (q.T @ rest)).max())

    @property
    def points(self) -> int:
        """Number of observed heights."""
        return self.raw.size if self.complete else int(np.count_nonzero(np.isfinite(self.raw)))

    def slabs(self, reach: int, unit: float = 1.0) -> Iterator[tuple[Array, int]]:
        """Yield heights with up to `reach` rows beyond a slab's own, and the number of its own.

        They are in m, those in memory over a power of two if one is given.
        """
        if not self.is_lazy or self.axes == 1:
            raw = self.raw if unit == 1.0 else self.raw / unit
            yield np.ascontiguousarray(raw), self.shape[0]
            return
        ny, nx = self.shape
        rows = max(SLAB // nx, 4 * reach, 1)
        for start in range(0, ny, rows):
            part = self.source.isel(y=slice(start, start + rows + reach)).values
            yield np.ascontiguousarray(part, dtype=np.float64), min(rows, ny - start)


def is_lazy(array: xr.DataArray) -> bool:
    """Tell whether the heights are not in memory yet (dask)."""
    return array.chunks is not None


def read_faces(
    surface: Any,
    problems: Problems,
    *,
    smallest: int = 3,
    gaps: bool = True,
    leading: bool = True,
    profile: bool = True,
    squares: bool = False,
    taken: Collection[str] = (),
) -> list[Face]:
    """Check a surface and split it along its leading dims.

    A profile is refused where it is not allowed; `squares` of the heights in m must be numbers; `taken` are
    names of the result, which no dim may bear.

    Returns
    -------
    list of Face
        In the order of the leading dims flattened; empty if something is wrong.
    """
    before = len(problems.found)
    grid = check_surface(
        surface, problems, finite=False, smallest=smallest, leading=leading, profile=profile, decades=DECADES
    )
    check_leading(surface, taken, problems)
    if len(problems.found) > before:
        return []
    if not is_lazy(surface):
        _check_heights(surface.values, grid, problems, gaps)
    if len(problems.found) > before:
        return []
    core = surface.dims[surface.ndim - len(grid.shape) :]
    outer = [dim for dim in surface.dims if dim not in core]
    places = np.ndindex(*(surface.sizes[dim] for dim in outer))
    faces = [Face(surface.isel(dict(zip(outer, place, strict=True))), grid) for place in places]
    if squares and any(face.is_extreme for face in faces):
        expected = f"heights over a range of {LEAST:.0e} m to {MOST:.0e} m, whose squares are numbers"
        problems.add("surface", expected, f"a range of about {max(face.unit for face in faces):.0e} m")
    return faces


def read_scales(problems: Problems, scales: Any, faces: Sequence[Face]) -> tuple[float, float] | None:
    """Check a window of lengths (low, high) in m, which must meet the lengths that the faces have."""
    if scales is None:
        return None
    values = problems.numbers("scales", scales, above=0)
    if values.size != 2 or not values[0] < values[-1]:
        problems.add("scales", "two ascending lengths in metres, (low, high)", scales)
        return None
    if faces:
        least, most = min(faces[0].grid.spacing), max(faces[0].grid.extent)
        inside = values[0] < most and values[1] > least
        expected = f"a window that meets the lengths of the face, {least:g} m to {most:g} m"
        problems.require(inside, "scales", expected, scales)
    return float(values[0]), float(values[1])


def _check_heights(heights: Array, grid: Grid, problems: Problems, gaps: bool) -> None:
    if heights.size == 0:
        problems.add("surface", "at least one face", f"shape {heights.shape}")
        return
    if np.isfinite(heights.min()) and np.isfinite(heights.max()):
        return
    problems.require(
        not np.isinf(heights).any(), "surface", "heights that are finite or NaN", "infinite heights"
    )
    if not gaps:
        problems.finite("surface", heights, remedy="see fractalcontact.surfaces.fill")
    elif not np.isfinite(heights).reshape(-1, int(np.prod(grid.shape))).any(axis=1).all():
        problems.add("surface", "observed heights", "nothing but NaN")
