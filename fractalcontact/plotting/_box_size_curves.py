"""Figures of curves over box size or radius: one panel for increasing load, one for increasing shear."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import Scale
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import table
from fractalcontact.plotting._paths import (
    at_force,
    at_shear,
    curve_name,
    load_text,
    load_words,
    loaded_steps,
    shear_text,
    shear_words,
)
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels

SIZES = ("box_length", "radius_length", "box_size", "radius")
MAX_CURVES = 6  # more curves than this cross the curves of their random nulls illegibly
TOLERANCE = 0.1  # of a local dimension beyond 0 or 2
CELLS = Scale(1.0, "cells")
STEEP = 1.5  # ratio of values above which lacunarity is drawn on a logarithmic axis


def draw_size_curves(
    data: xr.Dataset, shear: float | None, force: float | None, axes: Panels | None, name: str, null_name: str
) -> AxesArray:
    """Draw `name` over box size beside its random null, a panel per path that is longer than one."""
    shown = path_panels(axes, data)
    for dim, ax in shown.items():
        if dim == "step":
            path = at_shear(data, shear)
            path = path.isel(step=loaded_steps(path, MAX_CURVES))
            ax.set_title(shear_text(path, data))
            title, labels = load_words(path)
        else:
            path = at_force(data, force)
            path = path.isel(shear=_style.spread_indices(path.sizes["shear"], MAX_CURVES))
            ax.set_title(load_text(path, data))
            title, labels = shear_words(path)
        colours = _style.sequence_colours(path.sizes[dim])
        names = [curve_name("", (title, labels), i) for i in range(len(colours))]
        _draw_curves(ax, path, dim, colours, names, name, null_name)
        _style.sequence_legend(ax, title, labels, colours)
    if null_name in data:
        note = _style.legend_line("random null,\nequal coverage", **_style.NULL_LINE)
        _style.side_legend(ax, [note], low=True)
    return as_array(shown)


def path_panels(axes: Panels | None, data: xr.Dataset) -> dict[str, Axes]:
    """Return Axes for each path dim that is longer than one (`step` if none is)."""
    dims = [dim for dim in ("step", "shear") if data.sizes[dim] > 1] or ["step"]
    size = (_style.WIDTH + 0.6, 3.1) if len(dims) > 1 else _style.PANEL
    return dict(zip(dims, _style.panel_row(axes, len(dims), size), strict=True))


def as_array(panels: dict[str, Axes]) -> AxesArray:
    """Return the Axes of the panels as an array."""
    return np.array(list(panels.values()), dtype=object)


def _draw_curves(
    ax: Axes,
    path: xr.Dataset,
    dim: str,
    colours: list[Any],
    places: list[str],
    name: str,
    null_name: str,
) -> None:
    over = next(str(last) for last in path[name].dims[::-1] if last not in ("shear", "step"))
    size = next((s for s in SIZES if s in path.variables and path[s].dims == (over,)), over)
    curves = table(path, name, (dim, over))
    null = table(path, null_name, (dim, over)) if null_name in path else None
    boxes = table(path, size, (over,)) if size in path.variables else np.arange(1.0, curves.shape[1] + 1)
    scale = scale_of(path[size]) if size in path.variables else PLAIN
    for i, colour in enumerate(colours):
        dot = "o" if curves.shape[1] == 1 else ""
        ax.plot(scale(boxes), curves[i], color=colour, marker=dot, label=f"contact domain{places[i]}")
        if null is not None:
            ax.plot(scale(boxes), null[i], color=colour, label=f"random null{places[i]}", **_style.NULL_LINE)
    shown = curves[np.isfinite(curves)]
    steep = name == "lacunarity" and shown.size > 0 and shown.max() > STEEP * shown.min()
    _style.log_scale(ax, x=boxes, y=curves if steep else None)
    if name == "local_slope" and shown.size:
        ax.set_ylim(-0.05, 2.05)
        beyond = shown[(shown < -TOLERANCE) | (shown > 2 + TOLERANCE)]
        if beyond.size:  # no dimension in a plane: the slope between counts of a few boxes
            ends = dict.fromkeys(f"{value:.2g}" for value in (beyond.min(), beyond.max()))
            note = f"outside the axes, of few boxes: {' to '.join(ends)}"
            ax.text(1.0, 1.01, note, transform=ax.transAxes, ha="right", color=_style.grey(), size="small")
    _style.plain_ticks(ax)
    size_name = "radius" if over == "radius" else "box size"
    label_axis(ax.xaxis, size_name, scale if size.endswith("_length") else CELLS)
    label_axis(ax.yaxis, "local dimension" if name == "local_slope" else name_of(path[name]), PLAIN)
    if not shown.size:
        _style.write_in_empty_axes(ax, "no contact")
