"""New surfaces: checks of shape, spacing and members, the labelled array, and ensembles of random draws."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import rng as streams
from fractalcontact.base.grid import DECADES, plane_coords
from fractalcontact.base.numbers import Array, float_array, is_real, number_of_axes
from fractalcontact.base.resources import require_memory
from fractalcontact.base.validation import GIVEN, Problems

SHORTEST, LONGEST = 10.0**-DECADES, 10.0**DECADES  # m


def check_shape(problems: Problems, shape: Any, *, profile: bool = True) -> bool:
    """Check for (ny, nx), or for the length of a profile where `profile` allows one."""
    sizes = (shape,) if is_real(shape) else shape
    is_sequence = isinstance(sizes, (Sequence, np.ndarray)) and not isinstance(sizes, (str, bytes))
    if not is_sequence or number_of_axes(sizes) != 1 or len(sizes) not in ((1, 2) if profile else (2,)):
        problems.add("shape", "(ny, nx)" + (" or the length of a profile" if profile else ""), shape)
        return False
    valid = [problems.integer("shape", size, at_least=3) for size in sizes]
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


def check_axes(problems: Problems, *, profile: bool = True) -> bool:
    """Check shape and spacing of new surfaces together."""
    shape = problems.given.shape
    valid_shape = check_shape(problems, shape, profile=profile)
    return check_spacing(problems, np.size(shape) if valid_shape else None) and valid_shape


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
    sizes = axis_sizes(shape)
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
