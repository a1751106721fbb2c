"""Islands of a contact domain: map, areas, and how they are born, grow and merge along a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array, spread_indices
from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _maps, _paths, _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import as_dataset, require_dims, require_known_dims, result_of, table
from fractalcontact.plotting._line_panel import Family, LinePanel, ordered
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units, name_of, number_texts, scale_of

SEVERAL = ("member", "direction", "shear", "step")


@figure
def islands(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw a map of the islands of a contact domain and the distribution of their areas.

    The left panel shows the islands in twelve colours, of which about one neighbour in 15 has the same. The
    right panel shows the number of islands whose area is at least A, against A.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands` with `keep=("label",)`: label (y, x), and area (m2) over
        `island`. Of several masks the last one with an island is mapped, and each gets a curve (at most
        eight are drawn).
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.kron(np.eye(4), np.ones((2, 2))), 1e-3) > 0
    >>> result = fc.domains.islands(mask, connectivity=1, keep=("label",))
    >>> island_map, areas = fc.plotting.islands(result)
    >>> print(island_map.get_title(), "|", areas.get_xlabel())
    4 islands | island area (mm²)
    """
    data = result_of(result, ("label", "area"), SEVERAL, units)
    require_dims(data, {"area": "island"})
    require_known_dims(data, {"area": ("island", *SEVERAL)})
    left, right = shown = _style.panel_row(axes, 2, width_ratios=(1, 1.15))
    place = _last_map(data["label"])
    _maps.draw_labels(left, data["label"].isel(place).transpose("y", "x"))
    lines = [_maps.count_text(data["label"].isel(place)), ", ".join(_state_texts(data, place))]
    left.set_title("\n".join(filter(None, lines)))
    _draw_areas(right, data)
    return shown


def _last_map(plane: xr.DataArray) -> dict[str, int]:
    """Return the place of the last map that has an island, or of the last map if none has."""
    leading = [str(dim) for dim in plane.dims if dim not in ("y", "x")]
    filled = np.argwhere((plane > 0).any(("y", "x")).values)
    last = filled[-1] if filled.size else [plane.sizes[dim] - 1 for dim in leading]
    return dict(zip(leading, map(int, last), strict=True))


def _state_texts(data: xr.Dataset, place: dict[str, int]) -> list[str]:
    """Return which of several masks one is: its shear and its load, or its number along a dim."""
    state = data.isel(place)
    texts = {"shear": _paths.shear_text(state, data), "step": _paths.load_text(state, data)}
    several = {dim: number for dim, number in place.items() if data.sizes[dim] > 1}
    return [texts.get(dim) or _number_text(state, dim, number) for dim, number in several.items()]


def _number_text(state: xr.Dataset, dim: str, number: int) -> str:
    return f"{dim} {state[dim].item() if dim in state.coords else number}"


def _draw_areas(ax: Axes, data: xr.Dataset) -> None:
    """Draw the number of islands that are at least as large as each, a curve for each mask."""
    areas = np.asarray(data["area"].values, dtype=float).ravel()
    family, groups = _masks_of(data)
    shown = spread_indices(len(groups), _style.MAX_LEGEND_ENTRIES)
    labels = [family.labels[i] for i in shown] if family.labels else ()
    family = ordered(labels, family.name, family.unit, len(shown))
    size = Quantity(areas, scale_of(data["area"]), name_of(data["area"]))
    number_above = Quantity(np.empty(0), PLAIN, "number of islands of at least this area")
    panel = LinePanel(ax, data, size, number_above, family=family)
    for i, number in enumerate(shown):
        group = areas[groups[number]]
        ordered_areas = np.sort(group[np.isfinite(group)])[::-1]
        marker = "." if ordered_areas.size <= _style.MOST_DOTS else ""
        style = family.styles[i] | {"drawstyle": "steps-post", "marker": marker}
        panel.line(family.curve("islands", i), ordered_areas, np.arange(1, ordered_areas.size + 1), **style)
    panel.finish(log="xy", empty="no islands")


def _masks_of(data: xr.Dataset) -> tuple[Family, list[Any]]:
    """Return for each mask the places of its islands, and what distinguishes the masks.

    Masks along one path of load or of shear are labelled by it, others by all that distinguishes them.
    """
    names = [dim for dim in SEVERAL if f"island_{dim}" in data.coords]
    if not names:
        return ordered((), count=1), [slice(None)]
    columns = np.stack([_places(data, dim) for dim in names], -1)
    there = np.flatnonzero((columns >= 0).all(axis=1))
    masks, group = np.unique(columns[there], axis=0, return_inverse=True)
    groups = [there[group.ravel() == number] for number in range(len(masks))]
    if len(names) == 1 and names[0] in ("shear", "step"):
        every = (_paths.by_shear if names[0] == "shear" else _paths.by_load)(data)
        labels = [every.labels[place] for (place,) in masks] if every.labels else ()
        return ordered(labels, every.name, every.unit, len(masks)), groups
    places = [dict(zip(names, map(int, mask), strict=True)) for mask in masks]
    return ordered([", ".join(_state_texts(data, place)) for place in places]), groups


def _places(data: xr.Dataset, dim: str) -> Array:
    """Return for each island its place along a dim of the masks, -1 where its mask was not chosen."""
    places = data[dim].values if dim in data.coords else np.arange(data.sizes[dim])
    is_known = data[f"island_{dim}"].values[:, None] == places
    return np.where(is_known.any(axis=1), is_known.argmax(axis=1), -1)


@figure
def evolution(
    result: Any, *, against: str | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw the number of islands along a path, beside the islands that are born and those that are absorbed.

    A dotted line marks the coalescence: the first state in which more islands are absorbed than born.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.evolution`: n_islands, births and absorbed (or merges) over (shear,
        step), or over one of them.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> loads = [1e5, 1e6, 1e7]
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=loads, keep=("state",))
    >>> left, right = fc.plotting.evolution(fc.domains.evolution(pressed["state"]))
    >>> print(left.get_ylabel(), "|", right.get_ylabel())
    number of islands | islands in a step
    """
    lost = "absorbed" if "absorbed" in as_dataset(result).variables else "merges"
    data = result_of(result, ("n_islands", "births", lost), _paths.PATH, units)
    dims, x, family = _paths.path_axis(data, against)
    shown = _style.panel_row(axes, 2, _style.WIDE_ROW, sharex=True)
    names = (("n_islands", "number of islands"), ("births", "islands in a step"))
    left, right = (LinePanel(ax, data, x, y, dims, family, y_name=name, points=_style.MAX_MARKED_POINTS)
                   for ax, (y, name) in zip(shown, names, strict=True))  # fmt: skip
    left.curves("islands")
    right.curves("births", key="births")
    right.curves(lost, lost, key=lost, **_style.DASHED)
    coalesces = right.values(lost) > right.y.values
    for i in np.flatnonzero(coalesces.any(axis=1)).tolist():
        right.place(x.values[i, np.argmax(coalesces[i])], color=family.styles[i]["color"], **_style.DOTTED)
    if coalesces.any():
        right.key("coalescence", **_style.DOTTED)
    log = "x" if _style.needs_log_axis(x.values) else ""
    left.finish(log=log, zero="y", legend=False)
    right.finish(log=log, zero="y")
    return shown


LARGEST = 20  # islands of the last state with a colour of their own: more could not be told apart
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
    """
    data = result_of(result, COLUMNS, ("shear",), units)
    path = _paths.at_shear(data, shear)
    with Problems("fc.plotting") as problems:
        for name in COLUMNS:
            problems.require(path[name].dims == ("link",), f"result.{name}", "the dim link", path[name].dims)
    if "shear" in path.coords and "link_shear" in path:
        path = path.isel(link=np.flatnonzero(path["link_shear"].values == path["shear"].values))
    of_link = path["link_step"].values
    steps = path["step"].values[1:] if "step" in path.dims else np.unique(of_link)
    links = [path.isel(link=np.flatnonzero(of_link == step)) for step in steps.tolist()]
    ax = _style.axes_or_new(ax, _style.PANEL)
    stacks = _stacks(links)
    _draw_stacks(ax, links, stacks)
    texts = [str(place) for place in range(len(stacks))]
    name = _paths.load_of(path) if "step" in path.dims else ""
    if name:
        scale = scale_of(path[name])
        texts = number_texts(scale, table(path, name, ("step",)), 3)
    ax.set(xlabel=scale.label(name_of(path[name])) if name else "step", ylabel="cells in contact")
    distance = max(1, -(-len(stacks) // _style.MAX_LEGEND_ENTRIES))
    shown = slice((len(stacks) - 1) % distance, None, distance)  # the last one always
    places = range(len(stacks))[shown]  # none without a state before it
    ax.set_xticks(places, [texts[place] for place in places])
    ax.set_title(_paths.shear_text(path, data))
    ax.autoscale_view()
    ax.set_ylim(bottom=0)
    ax.grid(False)
    if not any(stack.cells.size for stack in stacks):
        _style.write_in_empty_axes(ax, "no islands")
    return ax


def _draw_stacks(ax: Axes, links: list[xr.Dataset], stacks: list[Stack], half: float = 0.08) -> None:
    """Draw the bars of all states, of so much half the width over their distance, and the ribbons between."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    named = [*_style.sequence_colours(LARGEST)[::-1], _style.tone(0.3)]
    colours = np.array([to_rgb(colour) for colour in named])
    tallest = max((stack.cells.sum() for stack in stacks), default=0)
    for place, stack in enumerate(stacks):
        x = place + half * np.array([-1, 1, 1, -1])
        y = stack.low[:, None] + stack.cells[:, None] * np.array([0, 0, 1, 1])
        edge = np.where(stack.cells > 0.01 * tallest, 0.4, 0.0)  # which would hide a lower bar
        bars = PolyCollection(_shapes(x, y), facecolors=colours[stack.colour])
        bars.set(edgecolor=_style.tone(0.0), linewidths=edge)
        ax.add_collection(bars)
    for place, (each, before, after) in enumerate(zip(links, stacks, stacks[1:], strict=False)):
        x = place + half + (1 - 2 * half) * np.concatenate([BEND, BEND[::-1]])
        edges, colour = _ribbons(each, before, after)
        ax.add_collection(PolyCollection(_shapes(x, edges), facecolors=colours[colour], alpha=0.45, lw=0))


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
        shared = each["common_cells"].values
        heir = np.flatnonzero(shared > 0)
        heir = heir[np.argsort(shared[heir])]  # the largest overlap comes last, and stays
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


FIGURES = (
    StudyFigure("islands", "domains/islands", "label", islands),
    StudyFigure("evolution", "domains/evolution", "births", evolution),
    StudyFigure("alluvial", "domains/lineage", "common_cells", alluvial),
)
