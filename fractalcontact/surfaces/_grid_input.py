"""Shape and spacing of a new surface: their checks, their conversion, and the labelled array they make."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import DECADES, plane_coords
from fractalcontact.base.memory import require_memory
from fractalcontact.base.numbers import float_array, is_real, number_of_axes
from fractalcontact.base.validation import GIVEN, Problems

Array = np.ndarray[Any, np.dtype[Any]]

SHORTEST, LONGEST = 10.0**-DECADES, 10.0**DECADES  # m
COPIES = 2  # of the heights: the result and one work array


def check_shape(problems: Problems, shape: Any, *, smallest: int = 3, profile: bool = True) -> bool:
    """Check for (ny, nx), or for the length of a profile where `profile` allows one."""
    sizes = (shape,) if is_real(shape) else shape
    is_sequence = isinstance(sizes, (Sequence, np.ndarray)) and not isinstance(sizes, (str, bytes))
    if not is_sequence or number_of_axes(sizes) != 1 or len(sizes) not in ((1, 2) if profile else (2,)):
        problems.add("shape", "(ny, nx)" + (" or the length of a profile" if profile else ""), shape)
        return False
    valid = [problems.integer("shape", size, at_least=smallest) for size in sizes]
    return all(valid)


def axis_sizes(shape: Any) -> tuple[int, ...]:
    """Return a shape that passed `check_shape` as (ny, nx) or (nx,)."""
    return tuple(int(size) for size in np.atleast_1d(shape))


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


def check_plane(problems: Problems, *, profile: bool = True) -> bool:
    """Check shape and spacing of new surfaces together."""
    shape = problems.given.shape
    valid_shape = check_shape(problems, shape, profile=profile)
    return check_spacing(problems, np.size(shape) if valid_shape else None) and valid_shape


def check_memory(where: str, sizes: Sequence[int]) -> None:
    """Raise `TooLittleMemory` unless heights of these sizes, and a work array like them, may be taken."""
    shape = " x ".join(f"{size:g}" for size in sizes if size != 1)
    needed = COPIES * 8.0 * math.prod(float(size) for size in sizes)
    require_memory(where, needed, f"a shape of {shape} points")


def axis_spacing(spacing: Any, axes: int) -> tuple[float, ...]:
    """Return a spacing that passed `check_spacing` for each axis, y first."""
    return tuple(float(step) for step in np.broadcast_to(float_array(spacing), axes))


def surface_array(
    heights: Any,
    spacing: Sequence[float],
    periodic: Sequence[bool],
    leading: Mapping[str, Any] | None = None,
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
