"""Surfaces drawn from a random stream: one of them, or an ensemble with a stream for each member."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import rng as streams
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._grid_input import surface_array

Array = np.ndarray[Any, np.dtype[Any]]


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
        for number, (plane, _) in enumerate(drawn, 1):
            heights[number] = plane
    leading = None if members is None else {"member": None}
    surface = surface_array(heights, spacing, (periodic,) * len(spacing), leading)
    surface.attrs = {"random": record, **entries}
    return surface
