"""Surfaces drawn from a random stream: one of them, or an ensemble with a stream for each member."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import rng as streams
from fractalcontact.base.memory import Estimate, Plane
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._grid_input import axis_sizes, surface_array

Array = np.ndarray[Any, np.dtype[Any]]


def check_ensemble(problems: Problems, members: Any, rng: Any) -> None:
    """Check the number of members and the random stream."""
    problems.integer("members", members, at_least=1, optional=True)
    with problems.collect():
        streams.generator(rng)


def ensemble_memory(arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the members of an ensemble: twice their heights while they are stacked."""
    return 16.0 * math.prod(axis_sizes(arguments["shape"])) * int(arguments["members"] or 0)


def drawing_memory(work: float) -> Estimate:
    """Return the estimate of a generator that takes `work` bytes for each point of a member."""

    def memory(_: Plane, arguments: Mapping[str, Any]) -> float:
        return work * math.prod(axis_sizes(arguments["shape"])) + ensemble_memory(arguments)

    return memory


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
        drawn = [draw(child) for child in stream.spawn(members)]
        heights, entries = np.stack([plane for plane, _ in drawn]), drawn[0][1]
    leading = None if members is None else {"member": None}
    surface = surface_array(heights, spacing, (periodic,) * len(spacing), leading)
    surface.attrs = {"random": record, **entries}
    return surface
