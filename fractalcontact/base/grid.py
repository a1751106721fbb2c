"""The plane that surfaces, gaps and masks live on: cell centres, spacing, period, crops.

An axis is uniform; its coordinate holds the centres of the cells, ascending, in metres. The extent is
n * spacing. A periodic axis says so by the attribute `period` of its coordinate, and counts as periodic
only while period = n * spacing, so that a crop is free by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.base.validation import Problems

UNIFORM = 1e-6  # largest departure of a centre from its place, in spacings
DECADES = 100  # lengths between 1e-100 and 1e100 m have squares and cubes that are numbers
Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Grid:
    """Shape (ny, nx), spacing (dy, dx) in metres, and which axes wrap, (y, x).

    A profile has one entry in each. `known` is False for a mask without coordinates: its spacing is one
    cell, and lengths in metres cannot be told.
    """

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    periodic: tuple[bool, ...]
    known: bool = True

    @property
    def extent(self) -> tuple[float, ...]:
        """Edge lengths n * spacing in metres."""
        return tuple(n * s for n, s in zip(self.shape, self.spacing, strict=True))

    @property
    def cell_area(self) -> float:
        """Area of one cell in m2."""
        return float(np.prod(self.spacing))

    @property
    def nominal_area(self) -> float:
        """Area of the whole extent in m2."""
        return float(np.prod(self.extent))


def grid_of(
    array: xr.DataArray, problems: Problems, argument: str, *, dims: Sequence[str] = ("y", "x")
) -> Grid:
    """Read the grid from the coordinates of `dims`, which must be the last dims; note what is wrong."""
    shape = tuple(int(array.sizes[dim]) for dim in dims if dim in array.dims)
    if tuple(array.dims[-len(dims) :]) != tuple(dims):
        problems.add(f"{argument}.dims", f"(..., {', '.join(dims)})", array.dims)
        return Grid((1,) * len(dims), (1.0,) * len(dims), (False,) * len(dims))
    spacing, periodic = [], []
    for dim in dims:
        step, wraps = _axis(array, dim, problems, argument)
        spacing.append(step)
        periodic.append(wraps)
    return Grid(shape, tuple(spacing), tuple(periodic))


def _axis(array: xr.DataArray, dim: str, problems: Problems, argument: str) -> tuple[float, bool]:
    """Return spacing and periodicity of one axis."""
    name = f"{argument}.{dim}"
    if dim not in array.coords:
        problems.add(
            name, "a coordinate of cell centres in metres (see fractalcontact.surfaces.from_array)", "none"
        )
        return 1.0, False
    coordinate = array.coords.variables[dim]
    units = coordinate.attrs.get("units", "m")
    problems.require(units in METRES, f"{name}.units", "'m'", units)
    centres = np.asarray(coordinate.values, dtype=np.float64)
    n = centres.size
    period = coordinate.attrs.get("period")
    if n < 2:
        if period is None:
            problems.add(name, "at least 2 points, or a period", f"{n}")
            return 1.0, False
        return float(period), True
    spacing = float(centres[-1] - centres[0]) / (n - 1)
    if not np.isfinite(spacing) or spacing <= 0:
        problems.add(name, "finite, ascending cell centres", f"{centres[0]:g} ... {centres[-1]:g}")
        return 1.0, False
    if not _within(spacing, DECADES):
        problems.add(name, f"a spacing of {_decades(DECADES)}", f"{spacing:g}")
        return 1.0, False
    departure = np.abs(centres - (centres[0] + spacing * np.arange(n))).max()
    allowed = UNIFORM * spacing + 4.0 * np.spacing(np.abs(centres).max())
    if not departure <= allowed:
        problems.add(
            name, "uniform spacing", f"centres up to {departure / spacing:.3g} spacings off their place"
        )
    wraps = period is not None and abs(float(period) - n * spacing) <= UNIFORM * float(period)
    return spacing, wraps


def core_dims(array: xr.DataArray) -> tuple[str, ...]:
    """Return the dims of one plane or profile of the array: (y, x), or (x,) where there is no y."""
    return ("y", "x") if "y" in array.dims else ("x",)


def read_grid(array: xr.DataArray, dims: Sequence[str] = ("y", "x")) -> Grid:
    """Return the grid of an array whose `dims` passed `Problems.surface` or `Problems.grid`."""
    spacing, periodic = [], []
    for dim in dims:
        coordinate = array.coords.variables[dim]
        centres = np.asarray(coordinate.values, dtype=np.float64)
        n, period = centres.size, coordinate.attrs.get("period")
        if n < 2:  # one point along the axis: its extent is the period
            spacing.append(float(period))
            periodic.append(True)
            continue
        step = float(centres[-1] - centres[0]) / (n - 1)
        spacing.append(step)
        periodic.append(period is not None and abs(float(period) - n * step) <= UNIFORM * float(period))
    return Grid(tuple(int(array.sizes[dim]) for dim in dims), tuple(spacing), tuple(periodic))


def periodic_axes(given: bool | None, grid: Grid, *, whole: bool = False) -> tuple[bool, ...]:
    """Return which axes wrap: as the axes say for None, otherwise as given (see `Problems.periodic`).

    With `whole`, None means periodic only where all axes are.
    """
    if given is None:
        return (all(grid.periodic),) * len(grid.shape) if whole else grid.periodic
    return (bool(given),) * len(grid.shape)


METRES = ("m", "meter", "metre", "meters", "metres")


def resolve_periodic(
    given: Any, grid: Grid, problems: Problems, argument: str, *, whole: bool = False
) -> tuple[bool, ...]:
    """Which axes wrap, from what the axes say and an explicit `given` (None, True or False).

    An explicit value may call a periodic axis free, never the reverse; `True` therefore needs every axis
    to be periodic, except where the array has no coordinates that could say otherwise.
    """
    if given is None:
        return grid.periodic if not whole else (all(grid.periodic),) * len(grid.shape)
    if not isinstance(given, (bool, np.bool_)):
        problems.add(argument, "None, True or False", given)
        return grid.periodic
    if given and grid.known:
        problems.require(
            all(grid.periodic),
            argument,
            "periodic axes (attribute `period` of x and y equal to n * spacing)",
            given,
        )
    return (bool(given),) * len(grid.shape)


def centres(n: int, spacing: float, origin: float = 0.0) -> Array:
    """Return the centres of n cells, the first cell starting at `origin` (m)."""
    return np.asarray(origin + (np.arange(n) + 0.5) * spacing)


def plane_coords(
    shape: Sequence[int], spacing: Sequence[float], periodic: Sequence[bool], dims: Sequence[str] = ("y", "x")
) -> dict[str, xr.DataArray]:
    """Return labelled coordinates for a plane or profile that starts at the origin."""
    import xarray as xr

    coords = {}
    for dim, n, step, wraps in zip(dims, shape, spacing, periodic, strict=True):
        attributes = {"period": float(n * step)} if wraps else {}
        coords[dim] = xr.DataArray(centres(int(n), float(step)), dims=dim, attrs=attributes)
    return coords


def contact_edges(mask: Array, periodic: Sequence[bool] = (False, False)) -> Array:
    """Count the switches between set and open cells along rows and columns.

    Parameters
    ----------
    mask : ndarray of bool, shape (..., ny, nx)
    periodic : pair of bool
        Count the switches across the wrap of y and of x as well.

    Returns
    -------
    ndarray of int64, shape (..., 2)
        Switches met along columns (between neighbours in y) and along rows (neighbours in x). Times the
        spacing of the other axis they give the perimeter.
    """
    mask = np.asarray(mask, dtype=bool)
    counts = []
    for axis, wraps in zip((-2, -1), periodic, strict=True):
        last = [slice(None)] * mask.ndim
        first = [slice(None)] * mask.ndim
        last[axis], first[axis] = slice(1, None), slice(None, -1)
        switches = np.count_nonzero(mask[tuple(last)] != mask[tuple(first)], axis=(-2, -1))
        if wraps and mask.shape[axis] > 1:
            edge = np.take(mask, 0, axis=axis) != np.take(mask, -1, axis=axis)
            switches = switches + np.count_nonzero(edge, axis=-1)
        counts.append(np.asarray(switches, dtype=np.int64))
    return np.stack(counts, axis=-1)


def check_surface(
    surface: Any,
    problems: Problems,
    argument: str = "surface",
    *,
    finite: bool = True,
    smallest: int = 3,
    leading: bool = False,
    profile: bool = False,
    decades: int = DECADES,
) -> Grid:
    """Check heights in metres on a uniform plane and return their grid.

    Parameters
    ----------
    surface : DataArray
        Dims (..., y, x), or (..., x) where `profile` allows one.
    finite : bool
        Refuse NaN and infinite heights.
    smallest : int
        Smallest number of points along each axis.
    leading : bool
        Allow dims before (y, x).
    profile : bool
        Allow a profile, dims (..., x) without y.
    decades : int
        Powers of ten of a metre, up and down, that heights and their range may have.
    """
    import xarray as xr

    if not isinstance(surface, xr.DataArray):
        expected = "a DataArray of heights (see fractalcontact.surfaces.from_array)"
        problems.add(argument, expected, type(surface).__name__)
        return Grid((smallest, smallest), (1.0, 1.0), (False, False))
    dims = ("x",) if profile and "y" not in surface.dims else ("y", "x")
    grid = grid_of(surface, problems, argument, dims=dims)
    if not leading and surface.ndim > len(dims):
        problems.add(f"{argument}.dims", f"({', '.join(dims)}) alone", surface.dims)
    units = surface.attrs.get("units", "m")
    problems.require(units in METRES, f"{argument}.units", "'m'", units)
    if not np.issubdtype(surface.dtype, np.number) or np.issubdtype(surface.dtype, np.complexfloating):
        problems.add(argument, "real numbers", f"type {surface.dtype}")
    else:
        if finite:
            problems.finite(argument, surface.values, remedy="see fractalcontact.surfaces.fill")
        if surface.chunks is None:
            _check_size(surface.values, problems, argument, decades)
    if surface.dims[-len(dims) :] == dims:
        for dim, n in zip(dims, grid.shape, strict=True):
            problems.require(n >= smallest, f"{argument}.{dim}", f"at least {smallest} points", n)
    return grid


def _check_size(heights: Array, problems: Problems, argument: str, decades: int) -> None:
    """Note heights, or a range of them, whose powers no double can hold; what is not finite is left out."""
    if heights.size == 0:
        return
    low, high = float(heights.min()), float(heights.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        there = heights[np.isfinite(heights)]
        low, high = (float(there.min()), float(there.max())) if there.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    for size, what in ((largest, "heights"), (high / 2.0 - low / 2.0, "a range of heights")):
        if size and not _within(size, decades):
            problems.add(argument, f"{what} of 0 or of {_decades(decades)}", f"{size:g} m")
            return


def _within(length: float, decades: int) -> bool:
    return 10.0**-decades <= length <= 10.0**decades


def _decades(decades: int) -> str:
    return f"1e-{decades} to 1e{decades} m"
