"""The set of true contacts: its maps along a path, and its islands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._paths import chosen_path, load_text, load_words, shear_text, shear_words
from fractalcontact.plotting._reading import as_dataset, extent_of, nearest, result_of
from fractalcontact.plotting._units import axis_label, scale_of
from fractalcontact.plotting.relief import name_plane, plane_scale

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COLUMNS = 3
CURVES = 8  # of the distributions of many masks
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
        Greatest number of maps: along the load evenly spread over the closure, its end included.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no state, or both a path of shear and one of load and neither is chosen.
    """
    data = result_of(result, "contact_domains", ("state",), ("shear", "step"))
    path, dim = chosen_path(data, shear, normal_force, panels, "contact_domains")
    count, columns = path.sizes[dim], columns_for(path.sizes[dim])
    width = _style.WIDTH * columns / COLUMNS
    sheet = _style.sheet(figure, (max(width, 3.0), maps_height(path, count, width)))
    axes = sheet.subplots(-(-count // columns), columns, squeeze=False).ravel()
    names = [_name(path.isel({dim: number}), data, dim) for number in range(count)]
    for number, ax in enumerate(axes):
        if number >= count:
            ax.set_axis_off()
            continue
        _state_map(ax, path["state"].isel({dim: number}), number if count > 1 else None, names[number])
    if "x" in path.coords:
        extent, length = extent_of(path["state"]), plane_scale(path["state"])
        _maps.ruler(axes[(count - 1) // columns * columns], extent, length)
    common = shear_text(path, data) if dim == "step" else load_text(path, data)
    if common:
        sheet.suptitle(common, x=0.01, ha="left", fontsize=9)
    if bool((path["state"] > 1).any()):
        _state_key(sheet)
    return _style.root(sheet)


def _state_map(ax: Axes, plane: xr.DataArray, number: int | None, name: str) -> None:
    flags = np.asarray(plane.transpose("y", "x").values)
    _maps.state(ax, flags, extent_of(plane), plane_scale(plane))
    _maps.framed(ax)
    head = "" if number is None else rf"$\bf{{{_style.letter(number)}}}$  "
    touching = 100 * float(np.mean(flags > 0)) if flags.size else 0.0
    percent = f"{touching:.0f}" if touching >= 10 else f"{touching:.2g}"
    ax.set_title(f"{head}{name}{',  ' if name else ''}{percent} % in contact", fontsize=8.5)


def _name(one: xr.Dataset, data: xr.Dataset, dim: str) -> str:
    """Return what tells a map from its neighbours."""
    return load_text(one, data) if dim == "step" else shear_text(one, data)


def columns_for(count: int) -> int:
    """Return the number of columns for a number of maps."""
    return 2 if count == 4 else min(count, COLUMNS)


def maps_height(path: xr.Dataset, count: int, width: float) -> float:
    """Return the height (inches) of a sheet of maps on paper of the given width."""
    columns = columns_for(count)
    left, right, bottom, top = extent_of(path["state"])
    shape = min(max((top - bottom) / (right - left), 0.1), 5.0)
    return 0.5 + -(-count // columns) * (shape * (width / columns - 0.15) + 0.28)


@_style.styled
def islands(result: Any, *, figure: Figure | SubFigure | None = None) -> Figure:
    """Draw the islands of a contact domain and how their areas are distributed.

    On the left the map, neighbouring islands in different colours; on the right the number of islands that
    are at least as large as a given area.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands`: label (y, x), and area (m2) over `island`. Of several masks
        the last one with an island is mapped, and each gets a curve; of more than eight some do.
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
    data = _checked_islands(result, ("label", "area"))
    sheet = _style.sheet(figure, (_style.WIDTH, 3.2))
    left, right = sheet.subplots(1, 2, width_ratios=(1, 1.15))
    island_map(data, ax=left)
    _island_areas(right, data)
    return _style.root(sheet)


@_style.styled
def island_map(result: Any, *, title: str | None = None, ax: Axes | None = None) -> Figure:
    """Draw a map of the islands of a contact domain, neighbouring islands in different colours.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands`: label (y, x). Of several masks the last one with an island is
        mapped.
    title : str, optional
        None: the number of islands.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        The result has no labels.
    """
    import matplotlib

    plane = _last_map(_checked_islands(result, ("label",))["label"])
    labels = np.asarray(plane.values).astype(np.int64)
    hues = matplotlib.colormaps[_style.FAMILY_MAP](np.linspace(0, 0.9, PALETTE))[:, :3]
    image = hues[
        (labels * 5) % PALETTE
    ]  # numbers that follow each other are often neighbours: keep them apart
    image[labels <= 0] = matplotlib.colors.to_rgb(_style.STATE_COLOURS[0])
    figure, ax = _style.canvas(ax, (3.8, 3.8))
    length = plane_scale(plane)
    _maps.show(ax, image, extent_of(plane), length)
    name_plane(ax, plane, length)
    count = np.unique(labels[labels > 0]).size
    ax.set_title(f"{count} island{'' if count == 1 else 's'}" if title is None else title)
    return figure


def _checked_islands(result: Any, names: tuple[str, ...]) -> xr.Dataset:
    data = as_dataset(result, "islands")
    with Problems("fc.plotting.islands") as problems:
        for name in names:
            problems.require(name in data, "result", f"the variable {name!r}", list(data.variables))
    return data


def _last_map(plane: xr.DataArray) -> xr.DataArray:
    """Return the last of several maps that has an island, or the last of all."""
    leading = [dim for dim in plane.dims if dim not in ("y", "x")]
    if leading:
        masks = plane.stack(mask=leading, create_index=False)
        filled = np.flatnonzero((masks > 0).any(("y", "x")).values)
        plane = masks.isel(mask=int(filled[-1]) if filled.size else -1)
    return plane.transpose("y", "x")


def _island_areas(ax: Axes, data: xr.Dataset) -> None:
    _style.dress(ax)
    areas = np.asarray(data["area"].values, dtype=float).ravel()
    scale = scale_of(data["area"])
    ax.set_xlabel(axis_label(data["area"], scale))
    ax.set_ylabel("islands of at least this area")
    if not np.isfinite(areas).any():
        _style.say(ax, "no island")
        return
    title, groups = _island_groups(data, areas)
    groups = [groups[place] for place in _style.chosen(len(groups), CURVES)]
    colours = _style.family(len(groups))
    for (_, group), colour in zip(groups, colours, strict=True):
        ordered = np.sort(group[np.isfinite(group)])[::-1]
        ax.step(scale(ordered), np.arange(1, ordered.size + 1), where="pre", color=colour,
                marker="." if ordered.size < 40 else None)  # fmt: skip
    _style.log_scale(ax, x=areas, y=np.ones(1))
    _style.plain_ticks(ax)
    if title:
        _style.key(ax, title, [name for name, _ in groups], colours)


def _island_groups(data: xr.Dataset, areas: Any) -> tuple[str, list[tuple[str, Any]]]:
    """Return the title of the names of the masks, and for each its name and the areas of its islands.

    Masks along one path of load or of shear are named after it, others are numbered.
    """
    names = [dim for dim in ("member", "direction", "shear", "step") if f"island_{dim}" in data.coords]
    if not names:
        return "", [("", areas)]
    columns = [np.unique(data[f"island_{dim}"].values, return_inverse=True) for dim in names]
    _, group = np.unique(np.stack([inverse for _, inverse in columns], -1), axis=0, return_inverse=True)
    parts = [areas[group.ravel() == number] for number in range(group.max() + 1)]
    title, texts = "", [str(number) for number in range(len(parts))]
    if len(names) == 1 and names[0] in ("shear", "step") and names[0] in data.dims:
        title, every = (shear_words if names[0] == "shear" else load_words)(data)
        places = [nearest(data[names[0]], value) for value in columns[0][0]]
        texts = [every[place] for place in places] if every else texts
    return title, list(zip(texts, parts, strict=True))


def _state_key(sheet: Any) -> None:
    from matplotlib.patches import Patch

    entries = [
        Patch(facecolor=colour, edgecolor=_style.GREY, linewidth=0.4, label=word)
        for colour, word in zip(_style.STATE_COLOURS, ("open", "contact", "yielded"), strict=True)
    ]
    sheet.legend(handles=entries, loc="outside lower left", ncols=3)
