"""The contact domain as a lacunar set: its box dimension and its lacunarity, each beside a random dust's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._paths import (
    at_force,
    at_shear,
    load_of,
    load_text,
    load_words,
    loaded_steps,
    shear_text,
    shear_words,
)
from fractalcontact.plotting._reading import result_of, table
from fractalcontact.plotting._units import axis_label, name_of, scale_for, scale_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

SIZES = ("box_length", "box_size")
DUST: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.9}
FEW = 15  # points of a curve that are shown as points
CURVES = 6  # of a family whose members cross their own dust
UNSURE = 0.5  # width of an interval beyond which a point is drawn open


@_style.styled
def box_dimension(
    result: Any, *, normal_force: float | None = None, figure: Figure | SubFigure | None = None
) -> Figure:
    """Draw the box dimension of the contact domain against load, and against shear under one force.

    The bands are the intervals, drawn where the curve stands alone; a point whose interval is wider
    than 0.5, or that has none, is open. The broken lines are a random dust of equal coverage: the number that
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
    colours = _style.family(data.sizes["shear"])
    for ax, dim in axes:
        if dim == "step":
            for i, colour in enumerate(colours):
                _dimension_curve(ax, data.isel(shear=i), dim, colour, band=len(colours) == 1)
        else:
            one = at_force(data, normal_force)
            _dimension_curve(ax, one, dim, _style.BLACK, band=True)
            ax.set_title(load_text(one, data))
        ax.set_ylim(-0.05, 2.05)
    axes[0][0].set_ylabel(name_of(data["box_dimension"]))
    last = axes[-1][0]
    if data.sizes["step"] > 1:
        title, texts = shear_words(data)
        _style.key(last, title, texts, colours)
    _style.beside(last, _dimension_notes(data), low=data.sizes["step"] > 1)
    return _style.root(sheet)


def _dimension_notes(data: xr.Dataset) -> list[Any]:
    """Return the entries of the key that tell the kinds of lines and points."""
    from matplotlib.patches import Patch

    notes = [_style.line_entry("contact domain", marker="o")]
    if "ci_low" in data and "ci_high" in data:
        notes.append(Patch(facecolor=_style.GREY, alpha=0.25, lw=0, label="interval"))
        if bool(_unsure(data).any()):
            label = f"interval wider\nthan {UNSURE:g}, or none"
            notes.append(_style.line_entry(label, ls="", marker="o", mfc="white"))
    if "dust_dimension" in data:
        notes.append(_style.line_entry("random dust of\nequal coverage", **DUST))
    return notes


def _unsure(data: xr.Dataset) -> xr.DataArray:
    return ~(data["ci_high"] - data["ci_low"] <= UNSURE) & data["box_dimension"].notnull()


@_style.styled
def lacunarity(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw the gliding-box lacunarity against the size of the box, at growing load and at growing shear.

    The broken lines are a random dust of equal coverage. Of more than six curves some are drawn.

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
            path = at_shear(data, shear)
            path = path.isel(step=loaded_steps(path, CURVES))
            ax.set_title(shear_text(path, data))
            title, texts = load_words(path)
        else:
            path = at_force(data, normal_force)
            path = path.isel(shear=_style.chosen(path.sizes["shear"], CURVES))
            ax.set_title(load_text(path, data))
            title, texts = shear_words(path)
        colours = _style.family(path.sizes[dim])
        _lacunarity_curves(ax, path, dim, colours)
        _style.key(ax, title, texts, colours)
    if "dust_lacunarity" in data:
        note = _style.line_entry("random dust of\nequal coverage", **DUST)
        _style.beside(axes[-1][0], [note], low=True)
    return _style.root(sheet)


def _panels(figure: Any, data: xr.Dataset) -> tuple[Any, list[tuple[Axes, str]]]:
    """Return the sheet, and an axes for each dim that is longer than one (the load's if none is)."""
    dims = [dim for dim in ("step", "shear") if data.sizes[dim] > 1] or ["step"]
    sheet = _style.sheet(figure, (_style.WIDTH + 0.6, 3.1) if len(dims) > 1 else _style.PANEL)
    axes = list(sheet.subplots(1, len(dims), squeeze=False)[0])
    for ax in axes:
        _style.dress(ax)
    return sheet, list(zip(axes, dims, strict=True))


def _dimension_curve(ax: Axes, one: xr.Dataset, dim: str, colour: Any, *, band: bool) -> None:
    load = load_of(one) or ("coverage" if "coverage" in one else dim)
    against = "shear" if dim == "shear" else load
    values = table(one, "box_dimension", (dim,))
    known = against in one.variables
    places = table(one, against, (dim,)) if known else np.arange(values.size, dtype=float)
    scale = scale_of(one[against]) if known else scale_for("", 1.0)
    sure = np.full(values.shape, True)
    if "ci_low" in one and "ci_high" in one:
        low, high = (table(one, name, (dim,)) for name in ("ci_low", "ci_high"))
        sure = high - low <= UNSURE
        if band:
            ax.fill_between(scale(places), low, high, color=colour, alpha=0.14, lw=0)
    ax.plot(scale(places), values, color=colour)
    if values.size <= FEW:
        ax.plot(scale(places)[sure], values[sure], "o", color=colour)
        ax.plot(scale(places)[~sure], values[~sure], "o", mec=colour, mfc="white")
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


def wide_axis(ax: Axes, places: Any) -> None:
    """Make the x axis logarithmic where positive numbers spread widely over it."""
    if _style.wide(places):
        ax.set_xscale("log")
        _style.plain_ticks(ax)
