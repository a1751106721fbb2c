"""Alluvial diagram of the islands of a contact domain: how they are born, grow and merge along a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import result_of, table
from fractalcontact.plotting._paths import at_shear, load_of, shear_text
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Units, name_of, number_texts, scale_of

Array = np.ndarray[Any, np.dtype[Any]]
LARGEST = 20  # islands of the last state with a colour of their own: more could not be told apart
BAR = 0.08  # half the width of a bar, over the distance of two states
THIN = 0.01  # of the axis: a bar that is lower has no edge, which would hide it
MOST_LABELS = 8  # of loads below a figure of usual width
BEND = np.linspace(0.0, 1.0, 24)  # along a ribbon: smooth at the size of a printed figure
COLUMNS = ("island_before", "island_after", "common_cells", "cells_before", "cells_after", "link_step")


@dataclass(frozen=True)
class Stack:
    """The islands of one state on top of each other: cells, colour, and lower edge of the bar of each."""

    cells: Array
    colour: Array  # index of the island of the last state that it grows into, LARGEST for all smaller ones
    low: Array

    @classmethod
    def of(cls, cells: Array, colour: Array) -> Stack:
        """Return islands ordered by colour, then by size."""
        order, low = np.lexsort((-cells, colour)), np.zeros(cells.size)
        low[order] = np.cumsum(cells[order]) - cells[order]
        return cls(cells, colour, low)


@figure
def alluvial(
    result: Any, *, shear: float | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw how the islands of a contact domain grow and merge along a load path: an alluvial diagram.

    Each state is a stack of its islands. A ribbon is as wide as the cells that an island shares with one of
    the next state; what no ribbon reaches is new contact. The 20 largest islands of the last state have a
    colour each, and so has every island that grows into one of them: a merge tree. The others are grey.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.lineage`.
    shear : float, optional
        Shear displacement (m) of the load path; the nearest one is taken. Default: the middle one.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> loads = [1e5, 1e6, 1e7]
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=loads, keep=("state",))
    >>> ax = fc.plotting.alluvial(fc.domains.lineage(pressed["state"]))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    normal force $F$ (N) | cells in contact
    """
    data = result_of(result, "alluvial", COLUMNS, ("shear",), units)
    path = at_shear(data, shear)
    with Problems("fc.plotting.alluvial") as problems:
        for name in COLUMNS:
            problems.require(path[name].dims == ("link",), f"result.{name}", "the dim link", path[name].dims)
    if "shear" in path.coords and "link_shear" in path:
        path = path.isel(link=np.flatnonzero(path["link_shear"].values == path["shear"].values))
    of_link = path["link_step"].values
    steps = path["step"].values[1:] if "step" in path.dims else np.unique(of_link)
    links = [path.isel(link=np.flatnonzero(of_link == step)) for step in steps.tolist()]
    ax = _style.axes_or_new(ax, _style.PANEL)
    stacks = _stacks(links)
    from matplotlib.collections import PolyCollection

    colours = np.array([*map(_rgb, _style.sequence_colours(LARGEST)[::-1]), _rgb(_style.tone(0.3))])
    tallest = max((stack.cells.sum() for stack in stacks), default=0)
    for place, stack in enumerate(stacks):
        x = place + BAR * np.array([-1, 1, 1, -1])
        y = stack.low[:, None] + stack.cells[:, None] * np.array([0, 0, 1, 1])
        bars = PolyCollection(_shapes(x, y), facecolors=colours[stack.colour])
        bars.set(edgecolor=_style.tone(0.0), linewidths=np.where(stack.cells > THIN * tallest, 0.4, 0.0))
        ax.add_collection(bars)
    for place, (each, before, after) in enumerate(zip(links, stacks, stacks[1:], strict=False)):
        x = place + BAR + (1 - 2 * BAR) * np.concatenate([BEND, BEND[::-1]])
        edges, colour = _ribbons(each, before, after)
        ax.add_collection(PolyCollection(_shapes(x, edges), facecolors=colours[colour], alpha=0.45, lw=0))
    texts = [str(place) for place in range(len(stacks))]
    name = load_of(path) if "step" in path.dims else ""
    if name:
        scale = scale_of(path[name])
        texts = number_texts(scale, table(path, name, ("step",)), 3)
    ax.set(xlabel=scale.label(name_of(path[name])) if name else "step", ylabel="cells in contact")
    shown = _style.spread_indices(len(stacks), MOST_LABELS)
    ax.set_xticks(shown, [texts[place] for place in shown])
    ax.set_title(shear_text(path, data))
    ax.autoscale_view()
    ax.set_ylim(bottom=0)
    ax.grid(False)
    if not any(stack.cells.size for stack in stacks):
        _style.write_in_empty_axes(ax, "no islands")
    return ax


def _rgb(colour: Any) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


def _shapes(x: Array, y: Array) -> Any:
    """Return the corners of shapes with common places x (corners,) and own heights y (shapes, corners)."""
    return np.stack(np.broadcast_arrays(x, y), -1)


def _stacks(links: list[xr.Dataset]) -> list[Stack]:
    """Return the states from the first to the last; the colours come from the last."""
    if not links:
        return []
    cells = _sizes(links[-1], "after")
    colour = np.minimum(np.argsort(np.argsort(-cells, kind="stable")), LARGEST)
    stacks = [Stack.of(cells, colour)]
    for each in links[::-1]:
        cells = _sizes(each, "before")
        colour = np.full(cells.size, LARGEST)
        heir = np.flatnonzero(each["common_cells"].values > 0)
        heir = heir[
            np.argsort(each["common_cells"].values[heir])
        ]  # the largest overlap comes last, and stays
        before, after = (each[f"island_{side}"].values[heir] - 1 for side in ("before", "after"))
        colour[before] = stacks[0].colour[after]
        stacks.insert(0, Stack.of(cells, colour))
    return stacks


def _sizes(links: xr.Dataset, side: str) -> Array:
    """Return the cells of every island of the state before or after."""
    islands = links[f"island_{side}"].values
    cells = np.zeros(islands.max(initial=0) + 1, np.int64)
    cells[islands] = links[f"cells_{side}"].values
    return cells[1:]


def _ribbons(links: xr.Dataset, before: Stack, after: Stack) -> tuple[Array, Array]:
    """Return the outline of each ribbon, along its lower edge and back on the upper, and its colour."""
    shared = links["common_cells"].values
    shared, number = shared[shared > 0], np.flatnonzero(shared > 0)
    old, new = (links[f"island_{side}"].values[number] - 1 for side in ("before", "after"))
    start = before.low[old] + _stacked(old, after.low[new], shared)
    end = after.low[new] + _stacked(new, before.low[old], shared)
    bend = (1 - np.cos(np.pi * BEND)) / 2
    low = start[:, None] + (end - start)[:, None] * bend
    return np.concatenate([low, (low + shared[:, None])[:, ::-1]], axis=1), after.colour[new]


def _stacked(island: Array, order: Array, width: Array) -> Array:
    """Return the lower edge of each ribbon above that of its island, in the order of their other ends."""
    places = np.lexsort((order, island))
    above = np.cumsum(width[places]) - width[places]
    _, first, ribbon = np.unique(island[places], return_index=True, return_inverse=True)
    low = np.empty(width.size)
    low[places] = above - above[first][ribbon]
    return low
