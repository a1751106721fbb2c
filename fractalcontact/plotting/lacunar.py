"""The contact domain as a lacunar set: its box dimension and its lacunarity, each beside a random dust's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._reading import nearest, result_of, table
from fractalcontact.plotting._units import axis_label, name_of, scale_for, scale_of
from fractalcontact.plotting.closing import load_text, load_words, shear_entries

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LOADS = ("normal_force", "nominal_pressure", "closure", "coverage")
SIZES = ("box_length", "box_size")
DUST: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.9}
WIDE = 30.0  # ratio of the numbers on an axis beyond which it is logarithmic
FEW = 15  # points of a curve that are shown as points


@_style.styled
def box_dimension(
    result: Any, *, normal_force: float | None = None, figure: Figure | SubFigure | None = None
) -> Figure:
    """Draw the box dimension of the contact domain against load, and against shear under one force.

    The bands are the 95 % intervals. The broken lines are a random dust of equal coverage: the number that
    contacts scattered without any structure would have.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension` over (shear, step), or over one of them.
    normal_force : float, optional
        Force (N) of the panel against shear; the nearest step is taken. None: the last step.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure. There is a panel for each of the dims that is longer than one.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    data = result_of(result, "box_dimension", ("box_dimension",), ("shear", "step"))
    sheet, axes = _panels(figure, data)
    for ax, dim in axes:
        if dim == "step":
            colours = _style.family(data.sizes["shear"])
            for i, colour in enumerate(colours):
                _dimension_curve(ax, data.isel(shear=i), dim, colour)
        else:
            one, colours = at_force(data, normal_force), [_style.BLACK]
            _dimension_curve(ax, one, dim, colours[0])
            ax.set_title(load_text(one))
        ax.set_ylim(-0.05, 2.05)
    axes[0][0].set_ylabel(name_of(data["box_dimension"]))
    notes = [_style.line_entry("contact domain")]
    if "ci_low" in data:
        notes.append(_band_entry("95 % interval"))
    if "dust_dimension" in data:
        notes.append(_style.line_entry("random dust of\nequal coverage", **DUST))
    _keys(axes, data, notes)
    return _style.root(sheet)


@_style.styled
def lacunarity(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw the gliding-box lacunarity against the size of the box, at growing load and at growing shear.

    The broken lines are a random dust of equal coverage.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.lacunarity` over (shear, step, box_size), or without shear or step.
    shear : float, optional
        Shear (m) of the panel of growing load; the nearest one is taken. None: the middle one.
    normal_force : float, optional
        Force (N) of the panel of growing shear; the nearest step is taken. None: the last step.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure. There is a panel for each of the dims that is longer than one.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    data = result_of(result, "lacunarity", ("lacunarity",), ("shear", "step"))
    sheet, axes = _panels(figure, data)
    for ax, dim in axes:
        if dim == "step":
            row = data.sizes["shear"] // 2 if shear is None else nearest(data["shear"], shear)
            path = data.isel(shear=row)
            title, texts = load_words(path, path.sizes["step"])
            ax.set_title(shear_text(path))
        else:
            path = at_force(data, normal_force)
            title, texts = shear_entries(path)
            ax.set_title(load_text(path))
        colours = _style.family(path.sizes[dim])
        _lacunarity_curves(ax, path, dim, colours)
        shown = _style.chosen(len(texts), _style.LONGEST_KEY)
        entries = [_style.line_entry(texts[i], color=colours[i]) for i in shown]
        if ax is axes[-1][0] and "dust_lacunarity" in data:
            entries.append(_style.line_entry("random dust of\nequal coverage", **DUST))
        _style.beside(ax, entries, title=title)
    return _style.root(sheet)


def _panels(figure: Any, data: xr.Dataset) -> tuple[Any, list[tuple[Axes, str]]]:
    """Return the sheet, and an axes for each dim that is longer than one (the load's if none is)."""
    dims = [dim for dim in ("step", "shear") if data.sizes[dim] > 1] or ["step"]
    sheet = _style.sheet(figure, (_style.WIDTH + 0.6, 3.1) if len(dims) > 1 else _style.PANEL)
    axes = list(sheet.subplots(1, len(dims), squeeze=False)[0])
    for ax in axes:
        _style.dress(ax)
    return sheet, list(zip(axes, dims, strict=True))


def _dimension_curve(ax: Axes, one: xr.Dataset, dim: str, colour: Any) -> None:
    against = "shear" if dim == "shear" else next((name for name in LOADS if name in one.variables), dim)
    values = table(one, "box_dimension", (dim,))
    known = against in one.variables
    places = table(one, against, (dim,)) if known else np.arange(values.size, dtype=float)
    scale = scale_of(one[against]) if known else scale_for("", 1.0)
    ax.plot(scale(places), values, color=colour, marker="o" if values.size <= FEW else "")
    if "ci_low" in one and "ci_high" in one:
        low, high = (table(one, name, (dim,)) for name in ("ci_low", "ci_high"))
        ax.fill_between(scale(places), low, high, color=colour, alpha=0.14, lw=0)
    if "dust_dimension" in one:
        ax.plot(scale(places), table(one, "dust_dimension", (dim,)), color=colour, **DUST)
    wide_axis(ax, places)
    ax.set_xlabel(axis_label(one[against], scale) if known else against)


def _lacunarity_curves(ax: Axes, path: xr.Dataset, dim: str, colours: list[Any]) -> None:
    size = next((name for name in SIZES if name in path.variables), "box_size")
    curves = table(path, "lacunarity", (dim, "box_size"))
    dust = table(path, "dust_lacunarity", (dim, "box_size")) if "dust_lacunarity" in path else None
    boxes = (
        table(path, size, ("box_size",)) if size in path.variables else np.arange(1.0, curves.shape[1] + 1)
    )
    scale = scale_of(path[size]) if size in path.variables else scale_for("", 1.0)
    for i, colour in enumerate(colours):
        ax.plot(scale(boxes), curves[i], color=colour, marker="o" if curves.shape[1] == 1 else "")
        if dust is not None:
            ax.plot(scale(boxes), dust[i], color=colour, **DUST)
    _style.log_scale(ax, x=boxes, y=curves)
    _style.plain_ticks(ax)
    ax.set_xlabel(scale.label("edge of the box" if size == "box_length" else "edge of the box in cells"))
    ax.set_ylabel(name_of(path["lacunarity"]))
    if not np.isfinite(curves).any():
        _style.say(ax, "no contact")


def at_force(data: xr.Dataset, normal_force: float | None) -> xr.Dataset:
    """Return, for each shear, the step whose force is nearest to the wanted one (None: the last step)."""
    import xarray as xr

    if normal_force is None or "normal_force" not in data.variables:
        return data.isel(step=-1)
    forces = table(data, "normal_force", ("shear", "step"))
    steps = [nearest(row, normal_force) for row in forces]
    if len(set(steps)) == 1:
        return data.isel(step=steps[0])
    return data.isel(step=xr.DataArray(steps, dims="shear"))


def shear_text(one: xr.Dataset) -> str:
    """Return the shear of one path, `v = 0.4 mm` for example."""
    from fractalcontact.plotting._units import amount, units_of

    if "shear" not in one.coords or one["shear"].ndim:
        return ""
    return f"$v$ = {amount(float(one['shear']), units_of(one['shear']))}"


def wide_axis(ax: Axes, places: Any) -> None:
    """Make the x axis logarithmic where positive numbers spread widely over it."""
    shown = np.asarray(places, dtype=float)
    shown = shown[np.isfinite(shown)]
    if shown.size and shown.min() > 0 and shown.max() > WIDE * shown.min():
        ax.set_xscale("log")
        _style.plain_ticks(ax)


def _keys(axes: list[tuple[Axes, str]], data: xr.Dataset, notes: list[Any]) -> None:
    title, texts = shear_entries(data)
    entries = list(notes)
    if texts and data.sizes["step"] > 1:
        colours = _style.family(len(texts))
        shown = _style.chosen(len(texts), _style.LONGEST_KEY)
        curves = [_style.line_entry(texts[i], color=colours[i]) for i in shown]
        _style.beside(axes[-1][0], curves, title=title)
        _style.beside(axes[-1][0], entries, low=True)
    else:
        _style.beside(axes[-1][0], entries)


def _band_entry(label: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor=_style.GREY, alpha=0.25, lw=0, label=label)
