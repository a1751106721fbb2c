"""The joint under shear: how it opens, and what that does to its strength."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._paths import load_words
from fractalcontact.plotting._reading import as_dataset, nearest, result_of, table, words
from fractalcontact.plotting._units import axis_label, scale_for, scale_of
from fractalcontact.plotting.closing import mark

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

JUMP = 4.0  # ratio of successive shears at which the first part of a curve ends
LOCKED = 90.0  # degree
FEW = 15  # points of a curve that are shown as points


@_style.styled
def rigid_dilatancy(dilatancy: Any, *, ax: Axes | None = None) -> Figure:
    """Draw the dilatancy of rigid faces against shear, one curve for each direction.

    The thin lines through the origin rise with the mean plane of the face.

    Parameters
    ----------
    dilatancy : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy`: rigid_dilatancy (m) over (direction, shear), and mean_slope
        over direction where it is known.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    figure, ax = _style.canvas(ax)
    data = result_of(dilatancy, "rigid_dilatancy", ("rigid_dilatancy", "shear"), ("direction", "shear"))
    opening = table(data, "rigid_dilatancy", ("direction", "shear"))
    shear = np.atleast_1d(data["shear"].values).astype(float)
    across, along = scale_of(data["rigid_dilatancy"]), scale_of(data["shear"])
    entries, looks = [], directions(data)
    dot = "o" if shear.size == 1 else ""
    for i, (word, look) in enumerate(looks):
        ax.plot(along(shear), across(opening[i]), marker=dot, **look)
        entries.append(_style.line_entry(word, **look))
        if "mean_slope" in data:
            slope = float(table(data, "mean_slope", ("direction",))[i])
            end = np.array([0.0, np.nanmax(shear)])
            ax.plot(along(end), across(slope * end), color=look["color"], lw=0.7, ls=":")
    ax.set_xlabel(axis_label(data["shear"], along))
    ax.set_ylabel(axis_label(data["rigid_dilatancy"], across))
    if any(word for word, _ in looks):
        _style.beside(ax, entries, title="block slides")
    if "mean_slope" in data:
        _style.beside(ax, [_style.line_entry("mean slope", lw=0.7, ls=":")], low=True)
    return figure


@_style.styled
def elastic_dilatancy(
    dilatancy: Any,
    *,
    direction: str | None = None,
    reach: float | None = None,
    marked: Sequence[float] = (),
    ax: Axes | None = None,
) -> Figure:
    """Draw the dilatancy under constant normal force against shear, one curve for each force.

    The black curve is that of rigid faces, which no force closes.

    Parameters
    ----------
    dilatancy : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy` with forces: dilatancy (m) over (direction, shear, step),
        rigid_dilatancy (m) over (direction, shear).
    direction : str, optional
        Direction to draw; needed where there are several.
    reach : float, optional
        Greatest shear (m) to show.
    marked : sequence of float
        Shears (m) to be marked A, B, C ... on the curve of the last force.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or there are several directions and none is chosen.
    """
    figure, ax = _style.canvas(ax)
    whole = within(one_direction(dilatancy, direction), reach)
    data = result_of(whole, "elastic_dilatancy", ("dilatancy", "shear"), ("shear", "step"))
    shear = np.atleast_1d(data["shear"].values).astype(float)
    opening = table(data, "dilatancy", ("shear", "step"))
    rigid = table(data, "rigid_dilatancy", ("shear",)) if "rigid_dilatancy" in data else None
    along = scale_of(data["shear"])
    across = scale_for("m", opening if rigid is None else np.append(opening.ravel(), rigid))
    colours = _style.family(opening.shape[1])
    marker = "o" if shear.size <= FEW else ""
    entries = []
    if rigid is not None:
        ax.plot(along(shear), across(rigid), color=_style.BLACK, lw=1.0, marker=marker)
        entries.append(_style.line_entry("0 (rigid)", color=_style.BLACK, lw=1.0))
    for j, colour in enumerate(colours):
        ax.plot(along(shear), across(opening[:, j]), color=colour, marker=marker)
    for number, place in enumerate(marked):
        at = nearest(shear, place)
        if np.isclose(shear[at], place, rtol=1e-6, atol=0.0):
            point = slice(at, at + 1)
            mark(ax, along(shear[point]), across(opening[point, -1]), colours[-1], number)
    title, texts = load_words(data)
    entries += [_style.line_entry(text, color=colour) for text, colour in zip(texts, colours, strict=True)]
    ax.set_xlabel(axis_label(data["shear"], along))
    ax.set_ylabel(across.label(r"dilatancy $\delta$"))
    _style.beside(ax, entries, title=title)
    return figure


@_style.styled
def friction(
    result: Any,
    *,
    direction: str | None = None,
    reach: float | None = None,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw the friction angle and the shear strength against shear, one curve for each force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.friction`: friction_angle (degree) over (direction, shear, step), with
        shear_strength (Pa) where forces are known; basic_friction_angle (degree) is drawn as a line.
    direction : str, optional
        Direction to draw; needed where there are several and forces too. Without forces each direction
        gets a curve.
    reach : float, optional
        Greatest shear (m) to show.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or there are several directions and none is chosen.
    """
    whole = within(as_dataset(result, "friction"), reach)
    shown = ["friction_angle", "shear_strength"] if "shear_strength" in whole else ["friction_angle"]
    by_force = "friction_angle" in whole and "step" in whole["friction_angle"].dims
    over = "step" if by_force else "direction"
    chosen = one_direction(whole, direction) if by_force or direction else whole
    data = result_of(chosen, "friction", (*shown, "shear"), ("shear", over))
    sheet = _style.sheet(figure, (_style.WIDTH if len(shown) > 1 else _style.PANEL[0], 3.1))
    axes = sheet.subplots(1, len(shown), squeeze=False, sharex=True)[0]
    entries, title = _friction_key(data, over)
    for ax, name in zip(axes, shown, strict=True):
        _style.dress(ax)
        curves(ax, data, name, over, entries)
    if "basic_friction_angle" in data:
        level = float(np.asarray(data["basic_friction_angle"].values, dtype=float).ravel()[0])
        axes[0].axhline(level, color=_style.BLACK, lw=0.8, ls=":")
        entries = [*entries, _style.line_entry("basic angle", color=_style.BLACK, lw=0.8, ls=":")]
    told = []
    if over == "step" and "direction" in data.coords:
        told.append(f"block slides {direction_word(words(data['direction'])[0])}")
    if axes[0].get_ylim()[1] > LOCKED:
        axes[0].set_ylim(top=LOCKED)
        told.append(f"locked from {LOCKED:g}° on")
    axes[0].set_title(", ".join(told))
    _style.beside(axes[-1], entries, title=title)
    return _style.root(sheet)


def curves(ax: Axes, data: xr.Dataset, name: str, over: str, entries: list[Any]) -> None:
    """Draw one variable against shear, with the lines of the key's entries."""
    values, shear = table(data, name, ("shear", over)), np.atleast_1d(data["shear"].values).astype(float)
    along, across = scale_of(data["shear"]), scale_of(data[name])
    for j, entry in enumerate(entries):
        ax.plot(along(shear), across(values[:, j]), color=entry.get_color(), ls=entry.get_linestyle(),
                marker="o" if shear.size <= FEW else "")  # fmt: skip
    if name == "shear_strength" and _style.wide(values):
        ax.set_yscale("log")
        _style.plain_ticks(ax)
    ax.set_xlabel(axis_label(data["shear"], along))
    ax.set_ylabel(axis_label(data[name], across))


def _friction_key(data: xr.Dataset, over: str) -> tuple[list[Any], str]:
    if over == "step":
        title, texts = load_words(data)
        colours = _style.family(len(texts))
        return [_style.line_entry(t, color=c) for t, c in zip(texts, colours, strict=True)], title
    return [_style.line_entry(word, **look) for word, look in directions(data)], "block slides"


def within(data: xr.Dataset, reach: float | None) -> xr.Dataset:
    """Return the part of a result up to a shear."""
    if reach is None or "shear" not in data.dims:
        return data
    return data.isel(shear=np.flatnonzero(data["shear"].values <= reach * (1 + 1e-9)))


def one_direction(data: Any, direction: str | None) -> xr.Dataset:
    """Return the part of a result that belongs to a direction."""
    dataset = as_dataset(data, "elastic_dilatancy")
    if direction is None or "direction" not in dataset.coords:
        return dataset
    names = words(dataset["direction"])
    with Problems("fc.plotting") as problems:
        problems.choice("direction", direction, names)
    return dataset.isel(direction=names.index(direction)) if "direction" in dataset.dims else dataset


def directions(data: xr.Dataset) -> list[tuple[str, dict[str, Any]]]:
    """Return word and look of every direction of a result; of one without a name where it has none."""
    names = words(data["direction"]) if "direction" in data.coords else [""]
    return [(direction_word(name), direction_look(name, i)) for i, name in enumerate(names)]


def direction_look(name: str, number: int) -> dict[str, Any]:
    """Return colour and line of a direction: the four winds always look the same, others unlike them."""
    if name in _style.DIRECTION_COLOURS:
        return {"color": _style.DIRECTION_COLOURS[name], "ls": _style.DIRECTION_LINES[name]}
    spare = [colour for colour in _style.CYCLE if colour not in _style.DIRECTION_COLOURS.values()]
    again, place = divmod(number, len(spare))
    return {"color": spare[place], "ls": ("-", "--", "-.", ":")[again % 4]}


def direction_word(name: str) -> str:
    """Return what a direction is called on paper."""
    winds = {"E": "East", "N": "North", "W": "West", "S": "South"}
    return winds.get(name, name if not name or name.isalpha() else f"{name}°")


def first_part(data: xr.Dataset) -> float:
    """Return the shear at which the first, evenly sampled part of a curve ends."""
    shears = np.sort(np.atleast_1d(data["shear"].values).astype(float))
    steep = [i for i in range(1, shears.size) if shears[i - 1] > 0 and shears[i] > JUMP * shears[i - 1]]
    return float(shears[steep[0] - 1 if steep else -1])
