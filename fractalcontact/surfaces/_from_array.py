"""Arrays of heights as surfaces: those of the user, new ones, ensembles of random draws, stacks with gaps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import rng as streams
from fractalcontact.base.grid import DECADES, core_dims, plane_coords
from fractalcontact.base.labelled import drop_unknown_coords, leading_coords
from fractalcontact.base.numbers import Array, as_array, float_array, is_real, number_of_axes
from fractalcontact.base.resources import require_memory
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import GIVEN, Problems

SHORTEST, LONGEST = 10.0**-DECADES, 10.0**DECADES  # m


def check_heights(problems: Problems, heights: Any = GIVEN) -> int | None:
    """Check for heights of planes or profiles; return 2 or 1, the axes of a plane, or None if they are wrong.

    A DataArray ends in dims (y, x) or (x,), and its leading dims have names of `base.schema`.
    """
    heights = problems.given.heights if heights is GIVEN else heights
    values = _real_array(heights)
    if values is None:
        problems.add("heights", "an array of real numbers", heights)
        return None
    if not _is_lazy(values):
        check_memory(problems.where, values.shape)
    before = len(problems.messages)
    axes = _plane_axes(heights, values.ndim)
    if isinstance(heights, xr.DataArray):
        core = ("y", "x")[2 - axes :]
        problems.require(
            heights.dims[-axes:] == core, "heights.dims", "(..., y, x) or (..., x)", heights.dims
        )
        for name in heights.dims[:-axes]:
            expected = "leading dims such as 'member', 'shear'"
            problems.require(name in QUANTITIES, "heights.dims", expected, name)
    else:
        expected = "shape (ny, nx), (nx,) or (members, ny, nx)"
        problems.require(values.ndim in (1, 2, 3), "heights", expected, values)
    for name, size in zip(("y", "x")[2 - axes :], values.shape[-axes:] if axes else (), strict=False):
        problems.require(size >= 2, f"heights ({name})", "at least 2 points", size)
    if not _is_lazy(values):
        problems.not_infinite("heights", values, "values")
    return axes if len(problems.messages) == before else None


def _check(problems: Problems) -> None:
    given = problems.given
    axes = check_heights(problems)
    check_spacing(problems, axes)
    problems.choice("units", among=UNITS)
    flags = as_array(given.periodic)
    valid = flags is not None and flags.dtype == np.bool_ and flags.shape in ((), (axes or 2,))
    expected = "True or False" + (", or (y, x)" if axes != 1 else "")
    problems.require(valid, "periodic", expected)


@public_result(
    title="Surface heights",
    achieved_error="exact: heights as given",
    check=_check,
    in_blocks=True,
    memory=17.0,
)
def from_array(
    heights: Any,
    spacing: float | Sequence[float],
    *,
    periodic: bool | Sequence[bool] = False,
    units: str = "m",
) -> xr.DataArray:
    """Return heights on a uniform grid as a surface.

    Parameters
    ----------
    heights : array-like, shape (ny, nx), (nx,) for a profile, or (members, ny, nx)
        Row 0 has the smallest y: flip an image first (`heights[::-1]`). NaN and masked values are missing
        points. A dask array stays lazy. A DataArray must end in dims (y, x) and keeps its leading dims.
    spacing : float, or (y, x)
        Distance between points, always in metres.
    periodic : bool, or (y, x)
        Whether the surface repeats beyond its edges.
    units : str
        Unit of `heights`: "m", "mm", "um", "nm" ...; the result is in metres.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, float64, the first cell starting at the origin.

    Raises
    ------
    InvalidInput
        The heights are not real numbers or infinite, the spacing is not positive, or the unit is unknown.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.from_array([[1.0, 2.0], [3.0, 5.0]], spacing=1e-6, units="um")
    >>> float(surface.max()), surface.x.values.tolist()
    (5e-06, [5e-07, 1.5e-06])
    """
    surface = labelled_heights(heights, spacing, periodic=periodic, units=units)
    surface.attrs = {"parameters": {"heights": {"shape": list(surface.shape)}}}
    return surface


def labelled_heights(heights: Any, spacing: Any, *, periodic: Any = False, units: str = "m") -> xr.DataArray:
    """Return valid heights (see `check_heights`) as a DataArray in metres."""
    values = _real_array(heights)
    values = values.astype(np.float64)
    if not _is_lazy(values):
        values = np.ma.filled(values, np.nan)
    axes = _plane_axes(heights, values.ndim)
    if isinstance(heights, xr.DataArray):
        leading = {str(dim): heights.coords.get(dim) for dim in heights.dims[:-axes]}
    else:
        leading = {"member": None} if values.ndim == 3 else {}
    flags = tuple(bool(flag) for flag in np.broadcast_to(np.asarray(periodic), axes))
    return surface_array(in_metres(values, units), axis_spacing(spacing, axes), flags, leading)


def _real_array(heights: Any) -> Any:
    """Return a numpy (maybe masked) or dask array of real numbers, None for anything else."""
    values = heights.data if isinstance(heights, xr.DataArray) else heights
    try:
        values = values if _is_lazy(values) else np.ma.asanyarray(values)
    except Exception:  # rows of unequal length, or whatever the conversion of a foreign object raises
        return None
    return values if values.dtype.kind in "fiu" else None


def _plane_axes(heights: Any, dims: int) -> int:
    """Return the number of axes of a plane (2) or profile (1)."""
    if isinstance(heights, xr.DataArray):
        return 2 if "y" in heights.dims else 1
    return min(dims, 2)


def _is_lazy(values: Any) -> bool:
    """Return whether the array is a dask array."""
    return hasattr(values, "dask")


def check_length(problems: Problems, argument: str, *, optional: bool = False) -> bool:
    """Check for a length in metres."""
    return problems.number(argument, at_least=SHORTEST, at_most=LONGEST, optional=optional)


def check_spacing(problems: Problems, axes: int | None = None, spacing: Any = GIVEN) -> bool:
    """Check for the spacing in metres: one length, or one for each axis, y first; None allows 1 or 2 axes."""
    spacing = problems.given.spacing if spacing is GIVEN else spacing
    if not problems.numbers("spacing", spacing, at_least=SHORTEST, at_most=LONGEST):
        return False
    expected = "one length in metres" + (" or (y, x)" if axes != 1 else "")
    return problems.require(np.size(spacing) in (1, axes or 2), "spacing", expected, spacing)


def check_axes(problems: Problems, *, profile: bool = True) -> bool:
    """Check shape and spacing of new surfaces together; `profile` allows the length of a profile."""
    shape = problems.given.shape
    sizes = (shape,) if is_real(shape) else shape
    is_sequence = isinstance(sizes, (Sequence, np.ndarray)) and not isinstance(sizes, (str, bytes))
    valid = is_sequence and number_of_axes(sizes) == 1 and len(sizes) in ((1, 2) if profile else (2,))
    if valid:
        are_long = [problems.integer("shape", size, at_least=3) for size in sizes]
        valid = all(are_long)
    else:
        problems.add("shape", "(ny, nx)" + (" or the length of a profile" if profile else ""), shape)
    return check_spacing(problems, np.size(shape) if valid else None) and valid


def check_memory(where: str, sizes: Sequence[int]) -> None:
    """Raise `TooLittleMemory` unless heights of these sizes, and a work array like them, may be taken."""
    shape = " x ".join(f"{size:g}" for size in sizes if size != 1)
    needed = 2 * 8.0 * math.prod(float(size) for size in sizes)  # the heights and one work array
    require_memory(where, needed, f"a shape of {shape} points")


def axis_spacing(spacing: Any, axes: int) -> tuple[float, ...]:
    """Return a spacing that passed `check_spacing` for each axis, y first."""
    return tuple(float(step) for step in np.broadcast_to(float_array(spacing), axes))


def sizes_and_steps(shape: Any, spacing: Any) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return shape and spacing that passed `check_axes`, for each axis, y first."""
    sizes = tuple(int(size) for size in np.atleast_1d(shape))
    return sizes, axis_spacing(spacing, len(sizes))


def surface_array(
    heights: Any, spacing: Sequence[float], periodic: Sequence[bool], leading: Mapping[str, Any] | None = None
) -> xr.DataArray:
    """Return heights (m) as a DataArray `height` whose first cell starts at the origin.

    Parameters
    ----------
    heights : array, shape (..., ny, nx) or (..., nx)
        numpy or dask.
    spacing, periodic : sequences
        One entry for each axis of the plane, y first.
    leading : mapping, optional
        Names and coordinates of the leading dims; None stands for the integers from 0.
    """
    leading = leading or {}
    core = ("y", "x")[2 - len(spacing) :]
    coords: dict[str, Any] = plane_coords(heights.shape[len(leading) :], spacing, periodic, core)
    for (name, values), size in zip(leading.items(), heights.shape, strict=False):
        coords[name] = (name, np.arange(size) if values is None else np.asarray(values))
    return xr.DataArray(heights, coords, (*leading, *core), name="height")


def check_ensemble(problems: Problems) -> None:
    """Check the number of members and the random stream."""
    problems.integer("members", at_least=1, optional=True)
    with problems.collect():
        streams.generator(problems.given.rng)


def draw_ensemble(
    draw: Callable[[np.random.Generator], tuple[Array, dict[str, Any]]],
    spacing: Sequence[float],
    *,
    members: int | None,
    rng: streams.RNGLike,
    periodic: bool = False,
) -> xr.DataArray:
    """Draw one surface, or `members` of them along a dim `member`.

    Parameters
    ----------
    draw : callable
        Takes a stream; returns the heights (ny, nx) or (nx,) and entries of the provenance.
    spacing : sequence of float
        In metres, y first.
    members : int or None
        Member i has the i-th stream spawned from `rng`, so it is the same in an ensemble of any size.
    rng : RNGLike
        Its record before the first draw is kept as the attribute `random`.
    periodic : bool

    Returns
    -------
    DataArray
        With the entries of the (first) draw as attributes.
    """
    stream = streams.generator(rng)
    record = streams.record(stream)
    if members is None:
        heights, entries = draw(stream)
    else:
        drawn = map(draw, stream.spawn(members))
        first, entries = next(drawn)
        heights = np.empty((members, *first.shape))
        heights[0] = first
        for number, (drawn_heights, _) in enumerate(drawn, 1):
            heights[number] = drawn_heights
    leading = None if members is None else {"member": None}
    surface = surface_array(heights, spacing, (periodic,) * len(spacing), leading)
    surface.attrs = {"random": record, **entries}
    return surface


def check_stack(problems: Problems, *, smallest: int = 2, is_one: bool = False) -> bool:
    """Check for planes or profiles, or for one, of heights that may be missing (NaN) but not infinite."""
    if not problems.surface("surface", finite=False, smallest=smallest, leading=not is_one, profile=True):
        return False
    return problems.not_infinite("surface", problems.given.surface.values)


def height_stack(surface: xr.DataArray) -> Array:
    """Return a copy of the heights as float64, shape (planes, ny, nx) or (planes, nx)."""
    values = np.array(surface.values, dtype=np.float64)
    return values.reshape(-1, *values.shape[values.ndim - len(core_dims(surface)) :])


def with_heights(surface: xr.DataArray, heights: Array) -> xr.DataArray:
    """Return a surface with other heights on the same points, without the attributes of its own."""
    result = drop_unknown_coords(surface.copy(data=heights.reshape(surface.shape)).rename("height"))
    result.attrs = {}
    return result


def labelled_rows(
    surface: xr.DataArray, rows: Sequence[Mapping[str, float]], names: Sequence[str]
) -> xr.Dataset:
    """Return the quantities of each plane of a surface, a row each, over its leading dims.

    A quantity that a row has not is NaN.
    """
    leading = surface.dims[: surface.ndim - len(core_dims(surface))]
    sizes = surface.shape[: len(leading)]
    columns = {name: np.array([row.get(name, np.nan) for row in rows]).reshape(sizes) for name in names}
    coords = leading_coords(surface, leading, (*columns, "run_time"))
    return xr.Dataset({name: (leading, values) for name, values in columns.items()}, coords)
