"""What the makers of surfaces share: their shape and spacing, their members, their labels."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import provenance, rng, schema
from fractalcontact.base.checks import Problems, axes_of
from fractalcontact.base.grid import plane_coords

if TYPE_CHECKING:
    import xarray as xr

LONGEST = 1e100  # m: squares and cubes of it are numbers
Array = np.ndarray[Any, np.dtype[Any]]
Made = tuple[Array, dict[str, Any]]


def plane_shape(
    problems: Problems, shape: Any, *, smallest: int = 3, profile: bool = True
) -> tuple[int, ...]:
    """Return (ny, nx), or (nx,) where a profile is allowed."""
    sizes: Any = (shape,) if isinstance(shape, (int, np.integer)) else shape
    lengths = (1, 2) if profile else (2,)
    if (
        not isinstance(sizes, (Sequence, np.ndarray))
        or isinstance(sizes, str)
        or axes_of(sizes) != 1
        or len(sizes) not in lengths
    ):
        problems.add("shape", "(ny, nx)" + (" or the length of a profile" if profile else ""), shape)
        return (smallest, smallest)
    return tuple(problems.integer("shape", n, at_least=smallest) for n in sizes)


def length(problems: Problems, argument: str, value: Any) -> float:
    """Return a length in metres."""
    return problems.number(argument, value, above=0, at_most=LONGEST)


def plane_spacing(problems: Problems, spacing: Any, axes: int) -> tuple[float, ...]:
    """Return the spacing of each axis, y first, from one length or one for each axis."""
    steps = problems.numbers("spacing", spacing, above=0, at_most=LONGEST)
    if steps.size not in (1, axes):
        problems.add("spacing", "one length in metres" + (" or (y, x)" if axes == 2 else ""), spacing)
        return (1.0,) * axes
    return tuple(float(step) for step in np.broadcast_to(steps, axes))


def heights_of(
    values: Any,
    spacing: Sequence[float],
    periodic: Sequence[bool],
    leading: Mapping[str, Any] | None = None,
) -> xr.DataArray:
    """Return labelled heights; leading dims have the coordinates given, or integers for None."""
    import xarray as xr

    core = ("y", "x")[2 - len(spacing) :]
    names = tuple(leading or {})
    coords: dict[str, Any] = plane_coords(values.shape[len(names) :], spacing, periodic, core)
    for (name, given), size in zip((leading or {}).items(), values.shape, strict=False):
        coords[name] = (name, np.arange(size) if given is None else np.asarray(given))
    return schema.label(xr.DataArray(values, dims=(*names, *core), coords=coords, name="height"))


def make(
    one: Callable[[np.random.Generator], Made],
    stream: rng.RNGLike,
    members: int | None,
    spacing: Sequence[float],
    *,
    call: str,
    parameters: dict[str, Any],
    title: str,
    references: str,
    periodic: bool = False,
) -> xr.DataArray:
    """Make one surface, or `members` of them from streams of their own, with labels and provenance.

    Member i is the same in an ensemble of any size.
    """
    source = rng.generator(stream)
    entropy = rng.record(source)
    start = time.perf_counter()
    if members is None:
        values, facts = one(source)
    else:
        made = [one(child) for child in source.spawn(members)]
        values, facts = np.stack([plane for plane, _ in made]), made[0][1]
    elapsed = time.perf_counter() - start
    leading = None if members is None else {"member": None}
    surface = heights_of(values, spacing, (periodic,) * len(spacing), leading)
    return provenance.stamp(
        surface,
        f"fractalcontact.surfaces.{call}",
        parameters | {"members": members},
        title=title,
        references=references,
        random=entropy,
        run_time=elapsed,
        **facts,
    )
