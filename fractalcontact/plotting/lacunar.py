"""The contact domain as a lacunar set: its box dimension and its lacunarity, each beside a random dust's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.scaling import local_slope
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
from fractalcontact.plotting._reading import as_dataset, result_of, table
from fractalcontact.plotting._units import axis_label, name_of, scale_for, scale_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

SIZES = ("box_length", "radius_length", "box_size", "radius")
DUST: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.9}
FEW = 15  # points of a curve that are shown as points
KINDS = ("box_dimension", "minkowski_dimension", "correlation_dimension", "boundary_dimension")
CURVES = 6  # of a family whose members cross their own dust
STEEP = 1.5  # ratio of values above which lacunarity is drawn on a logarithmic axis
UNSURE = 0.5  # width of an interval beyond which a point is drawn open


@_style.styled
def box_dimension(
    result: Any, *, normal_force: float | None = None, figure: Figure | SubFigure | None = None
) -> Figure:
    """Draw the box dimension of the contact domain against load, and against shear under one force.

    Other dimensions of the domain are drawn alike. The bands are the intervals, drawn where the curve stands
    alone; a point whose interval is wider than 0.5, or that has none, is open. The broken lines are a random
    dust of equal coverage: the number that contacts scattered without any structure would have.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension`, `minkowski_dimension`, `correlation_dimension` or
        `boundary_dimension` over (shear, step), or over one of them.
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
    kinds = [kind for kind in KINDS if kind in as_dataset(result, "box_dimension")]
    data = result_of(result, "box_dimension", (kinds or KINDS)[:1], ("shear", "step"))
    name = next(kind for kind in KINDS if kind in data)
    sheet, axes = _panels(figure, data)
    colours = _style.family(data.sizes["shear"])
    for ax, dim in axes:
        if dim == "step":
            for i, colour in enumerate(colours):
                _dimension_curve(ax, data.isel(shear=i), name, dim, colour, band=len(colours) == 1)
        else:
            one = at_force(data, normal_force)
            _dimension_curve(ax, one, name, dim, _style.BLACK, band=True)
            ax.set_title(load_text(one, data))
        ax.set_ylim(-0.05, 2.05)
        if not bool(data[name].notnull().any()):
            _style.say(ax, "no contact")
    axes[0][0].set_ylabel(name_of(data[name]))
    last = axes[-1][0]
    if data.sizes["step"] > 1:
        title, texts = shear_words(data)
        _style.key(last, title, texts, colours)
    _style.beside(last, _dimension_notes(data, name), low=data.sizes["step"] > 1)
    return _style.root(sheet)


def _dimension_notes(data: xr.Dataset, name: str) -> list[Any]:
    """Return the entries of the key that tell the kinds of lines and points."""
    from matplotlib.patches import Patch

    notes = [_style.line_entry("contact domain", marker="o")]
    if "ci_low" in data and "ci_high" in data:
        notes.append(Patch(facecolor=_style.GREY, alpha=0.25, lw=0, label="interval"))
        if bool(_unsure(data, name).any()):
            label = f"interval wider\nthan {UNSURE:g}, or none"
            notes.append(_style.line_entry(label, ls="", marker="o", mfc="white"))
    if "null_dimension" in data:
        notes.append(_style.line_entry("random dust of\nequal coverage", **DUST))
    return notes


def _unsure(data: xr.Dataset, name: str) -> xr.DataArray:
    return ~(data["ci_high"] - data["ci_low"] <= UNSURE) & data[name].notnull()


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
    return _families(data, shear, normal_force, figure, "lacunarity", "null_lacunarity")


@_style.styled
def local_slopes(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw the local dimension against the size of the box, at growing load and at growing shear.

    Where the curve is level a power law holds. The broken lines are a random dust of equal coverage. Of more
    than six curves some are drawn.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension`, `box_counts`, `correlation_dimension` or
        `minkowski_dimension` over (shear, step), or without shear or step.
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
    data = result_of(result, "local_slopes", ("local_slope",), ("shear", "step"))
    if "null_count" in data or "null_mass" in data:
        curve, sign = ("null_count", -1.0) if "null_count" in data else ("null_mass", 1.0)
        slope = sign * local_slope(data["box_size"].values, data[curve].values)
        data = data.assign(dust_slope=(data[curve].dims, slope))
    elif "null_fraction" in data:
        slope = 2.0 - local_slope(data["radius"].values, data["null_fraction"].values)
        data = data.assign(dust_slope=(data["null_fraction"].dims, slope))
    return _families(data, shear, normal_force, figure, "local_slope", "dust_slope")


def _families(
    data: xr.Dataset, shear: float | None, force: float | None, figure: Any, name: str, dust: str
) -> Figure:
    """Draw curves over the size of the box, a family at growing load and one at growing shear."""
    sheet, axes = _panels(figure, data)
    for ax, dim in axes:
        if dim == "step":
            path = at_shear(data, shear)
            path = path.isel(step=loaded_steps(path, CURVES))
            ax.set_title(shear_text(path, data))
            title, texts = load_words(path)
        else:
            path = at_force(data, force)
            path = path.isel(shear=_style.chosen(path.sizes["shear"], CURVES))
            ax.set_title(load_text(path, data))
            title, texts = shear_words(path)
        colours = _style.family(path.sizes[dim])
        _curves(ax, path, dim, colours, name, dust)
        _style.key(ax, title, texts, colours)
    if dust in data:
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


def _dimension_curve(ax: Axes, one: xr.Dataset, name: str, dim: str, colour: Any, *, band: bool) -> None:
    load = load_of(one) or ("coverage" if "coverage" in one else dim)
    against = "shear" if dim == "shear" else load
    values = table(one, name, (dim,))
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
    if "null_dimension" in one:
        ax.plot(scale(places), table(one, "null_dimension", (dim,)), color=colour, **DUST)
    wide_axis(ax, places)
    ax.set_xlabel(axis_label(one[against], scale) if known else against)


def _curves(ax: Axes, path: xr.Dataset, dim: str, colours: list[Any], name: str, dust: str) -> None:
    over = next(str(last) for last in path[name].dims[::-1] if last not in ("shear", "step"))
    size = next((known for known in SIZES if known in path.variables and path[known].dims == (over,)), over)
    curves = table(path, name, (dim, over))
    null = table(path, dust, (dim, over)) if dust in path else None
    boxes = table(path, size, (over,)) if size in path.variables else np.arange(1.0, curves.shape[1] + 1)
    scale = scale_of(path[size]) if size in path.variables else scale_for("", 1.0)
    for i, colour in enumerate(colours):
        ax.plot(scale(boxes), curves[i], color=colour, marker="o" if curves.shape[1] == 1 else "")
        if null is not None:
            ax.plot(scale(boxes), null[i], color=colour, **DUST)
    shown = curves[np.isfinite(curves)]
    steep = name == "lacunarity" and shown.size > 0 and shown.max() > STEEP * shown.min()
    _style.log_scale(ax, x=boxes, y=curves if steep else None)
    if name == "local_slope" and shown.size:
        ax.set_ylim(min(-0.05, shown.min() - 0.05), max(2.05, shown.max() + 0.05))
    _style.plain_ticks(ax)
    edge = "radius" if over == "radius" else "edge of the box"
    ax.set_xlabel(scale.label(edge) if size.endswith("_length") else f"{edge} in cells")
    ax.set_ylabel("local dimension" if name == "local_slope" else name_of(path[name]))
    if not shown.size:
        _style.say(ax, "no contact")


def wide_axis(ax: Axes, places: Any) -> None:
    """Make the x axis logarithmic where positive numbers spread widely over it."""
    if _style.wide(places):
        ax.set_xscale("log")
        _style.plain_ticks(ax)
