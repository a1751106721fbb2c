"""The set of true contacts: its maps along a path, and its islands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._reading import as_dataset, extent_of, nearest, result_of
from fractalcontact.plotting._units import amount, axis_label, scale_of, units_of
from fractalcontact.plotting.closing import load_text
from fractalcontact.plotting.relief import name_plane, plane_scale

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COLUMNS = 3
PALETTE = 12  # colours of neighbouring islands


@_style.styled
def contact_domains(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    panels: int = 6,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw maps of the contact state: at growing load for one shear, or at growing shear under one force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        Variable `state` with dims (shear, step, y, x), or without shear or step.
    shear : float, optional
        Shear (m) whose path of load is shown; the nearest one is taken.
    normal_force : float, optional
        Force (N) at which the shears are shown; the nearest step is taken.
    panels : int
        Greatest number of maps, evenly spread along the path, its end included.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no state, or both a path of shear and one of load and neither is chosen.

    Notes
    -----
    The number in each title is the fraction of the cells in contact.
    """
    data = result_of(result, "contact_domains", ("state",), ("shear", "step"))
    maps = path_of_maps(data, shear, normal_force, panels)
    columns = min(len(maps), COLUMNS)
    width = _style.WIDTH * columns / COLUMNS
    sheet = _style.sheet(figure, (max(width, 3.0), maps_height(maps, width)))
    axes = sheet.subplots(-(-len(maps) // columns), columns, squeeze=False).ravel()
    yielded = False
    for number, ax in enumerate(axes):
        if number >= len(maps):
            ax.set_axis_off()
            continue
        one = maps[number]
        flags = np.asarray(one["state"].transpose("y", "x").values)
        yielded |= bool((flags > 1).any())
        extent, length = extent_of(one["state"]), plane_scale(one["state"])
        _maps.state(ax, flags, extent, length)
        _maps.framed(ax)
        ax.set_title(map_title(number if len(maps) > 1 else None, one, flags), fontsize=8.5)
        if number == (len(maps) - 1) // columns * columns and "x" in one["state"].coords:
            _maps.ruler(ax, extent, length)
    if yielded:
        _state_key(sheet)
    return _style.root(sheet)


def maps_height(maps: list[xr.Dataset], width: float) -> float:
    """Return the height (inches) of a sheet of maps on paper of the given width."""
    columns = min(len(maps), COLUMNS)
    left, right, bottom, top = extent_of(maps[0]["state"])
    shape = min(max((top - bottom) / (right - left), 0.1), 5.0)
    return 0.2 + -(-len(maps) // columns) * (shape * (width / columns - 0.1) + 0.26)


def path_of_maps(
    data: xr.Dataset, shear: float | None, normal_force: float | None, panels: int
) -> list[xr.Dataset]:
    """Return the single maps to show, along the one path that was chosen."""
    with Problems("fc.plotting.contact_domains") as problems:
        problems.integer("panels", panels, at_least=1)
        if data.sizes["shear"] > 1 and data.sizes["step"] > 1:
            problems.exactly_one(shear=shear, normal_force=normal_force)
        if normal_force is not None:
            problems.require(
                "normal_force" in data.variables, "result", "the variable 'normal_force'", "none"
            )
    if normal_force is not None:
        every = [one.isel(step=nearest_step(one, normal_force)) for one in singles(data, "shear")]
        return [every[i] for i in _style.chosen(len(every), panels)]
    if data.sizes["step"] == 1 and shear is None:
        every = singles(data.isel(step=0), "shear")
        return [every[i] for i in _style.chosen(len(every), panels)]
    row = 0 if shear is None or data.sizes["shear"] == 1 else nearest(data["shear"], shear)
    path = data.isel(shear=row)
    return [path.isel(step=i) for i in loaded_steps(path, panels)]


def singles(data: xr.Dataset, dim: str) -> list[xr.Dataset]:
    """Return the slices of `data` along a dim."""
    return [data.isel({dim: i}) for i in range(data.sizes[dim])]


def nearest_step(path: xr.Dataset, normal_force: float) -> int:
    """Return the step of one path whose force is nearest."""
    force = np.atleast_1d(path["normal_force"].values)
    return nearest(force, normal_force) if force.size == path.sizes["step"] else 0


def loaded_steps(path: xr.Dataset, panels: int) -> list[int]:
    """Return the steps to show of one path: loaded ones, spread evenly over the closure."""
    steps = np.arange(path.sizes["step"])
    if "normal_force" in path.variables and path["normal_force"].dims == ("step",):
        loaded = steps[np.asarray(path["normal_force"].values) > 0]
        steps = loaded if loaded.size else steps
    even = [int(steps[i]) for i in _style.chosen(len(steps), panels)]
    if len(steps) <= panels or "closure" not in path.variables or path["closure"].dims != ("step",):
        return even
    closed = np.asarray(path["closure"].values, dtype=float)[steps]
    if not (np.isfinite(closed).all() and (np.diff(closed) > 0).all()):
        return even
    wanted = np.linspace(closed[0], closed[-1], panels)
    return sorted({int(steps[nearest(closed, w)]) for w in wanted})


def map_title(number: int | None, one: xr.Dataset, flags: Any) -> str:
    """Return letter, shear, load and contact fraction of one map."""
    parts = []
    if "shear" in one.coords:
        parts.append(f"$v$ = {amount(float(one['shear']), units_of(one['shear']))}")
    load = load_text(one)
    if load:
        parts.append(load)
    fraction = float(np.mean(np.asarray(flags) > 0)) if np.size(flags) else 0.0
    parts.append(f"{100 * fraction:.2g} %")
    head = "" if number is None else rf"$\bf{{{_style.letter(number)}}}$  "
    return head + ",  ".join(parts)


@_style.styled
def islands(result: Any, *, figure: Figure | SubFigure | None = None) -> Figure:
    """Draw the islands of a contact domain and how their areas are distributed.

    On the left the map, neighbouring islands in different colours; on the right the number of islands that
    are at least as large as a given area.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands`: label (y, x), and area (m2) over `island`. Of several masks
        the last one with an island is mapped, and each gets a curve.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        The result has no labels.
    """
    data = as_dataset(result, "islands")
    with Problems("fc.plotting.islands") as problems:
        for name in ("label", "area"):
            problems.require(name in data, "result", f"the variable {name!r}", list(data.variables))
    sheet = _style.sheet(figure, (_style.WIDTH, 3.2))
    left, right = sheet.subplots(1, 2, width_ratios=(1, 1.15))
    _island_map(left, data)
    _island_areas(right, data)
    return _style.root(sheet)


def _island_map(ax: Axes, data: xr.Dataset) -> None:
    import matplotlib

    plane = data["label"]
    leading = [dim for dim in plane.dims if dim not in ("y", "x")]
    if leading:
        stacked = plane.stack(mask=leading) if len(leading) > 1 else plane.rename({leading[0]: "mask"})
        filled = np.flatnonzero((stacked > 0).any(("y", "x")).values)
        plane = stacked.isel(mask=int(filled[-1]) if filled.size else -1)
    labels = np.asarray(plane.transpose("y", "x").values).astype(np.int64)
    hues = matplotlib.colormaps[_style.FAMILY_MAP](np.linspace(0, 0.9, PALETTE))[:, :3]
    image = hues[(labels * 5) % PALETTE]  # 5 steps between neighbours in number, which often are neighbours
    image[labels <= 0] = matplotlib.colors.to_rgb(_style.STATE_COLOURS[0])
    length, extent = plane_scale(plane), extent_of(plane)
    _style.dress(ax)
    _maps.show(ax, image, extent, length)
    name_plane(ax, plane, length)
    ax.set_title(f"{np.unique(labels[labels > 0]).size} islands")


def _island_areas(ax: Axes, data: xr.Dataset) -> None:
    _style.dress(ax)
    areas = np.asarray(data["area"].values, dtype=float).ravel()
    scale = scale_of(data["area"])
    ax.set_xlabel(axis_label(data["area"], scale))
    ax.set_ylabel("islands of at least this area")
    if not np.isfinite(areas).any():
        _style.say(ax, "no island")
        return
    groups = _island_groups(data, areas)
    for group, colour in zip(groups, _style.family(len(groups)), strict=True):
        ordered = np.sort(group[np.isfinite(group)])[::-1]
        ax.step(scale(ordered), np.arange(1, ordered.size + 1), where="pre", color=colour,
                marker="." if ordered.size < 40 else None)  # fmt: skip
    _style.log_scale(ax, x=areas, y=np.ones(1))
    _style.plain_ticks(ax)


def _island_groups(data: xr.Dataset, areas: Any) -> list[Any]:
    """Return the areas of the islands of each mask, in the order in which the masks appear."""
    path = [
        str(name)
        for name in ("direction", "shear", "step")
        if name in data.coords and data[name].dims == ("island",)
    ]
    if not path:
        return [areas]
    keys = np.stack([np.unique(data[name].values, return_inverse=True)[1] for name in path], axis=-1)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return [areas[group.ravel() == number] for number in range(first.size)]


def _state_key(sheet: Any) -> None:
    from matplotlib.patches import Patch

    entries = [
        Patch(facecolor=colour, edgecolor=_style.GREY, linewidth=0.4, label=word)
        for colour, word in zip(_style.STATE_COLOURS, ("open", "contact", "yielded"), strict=True)
    ]
    sheet.legend(handles=entries, loc="outside lower left", ncols=3)
