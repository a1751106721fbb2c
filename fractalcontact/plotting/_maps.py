"""The map under all figures of planes: values, flags or labels as colours, with colour bar and scale bar."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import ROUNDED, Array
from fractalcontact.base.units import Scale, quantity_text, scale_for
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import as_dataset, extent_of, without
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Quantity, Units, label_axis, name_of, scale_of, shown_in

STATES = {
    "state": (("open", "contact", "yielded"), _style.STATE_COLOURS),
    "slip_state": (("open", "stick", "slip"), _style.SLIP_COLOURS),
}


def block_means(plane: Array, most: int = 1600) -> Array:
    """Return means over blocks of cells, at most `most` along an edge: a map in a file has 700 points."""
    by, bx = (-(-n // most) for n in plane.shape)
    if by == bx == 1:
        return plane
    ny, nx = plane.shape[0] // by * by, plane.shape[1] // bx * bx
    means: Array = plane[:ny, :nx].reshape(ny // by, by, nx // bx, bx).mean(axis=(1, 3))
    return means


def colour_limits(values: Array, clipped: float, tail: float = 0.25) -> tuple[float, float, str]:
    """Return the ends of a colour scale, and which ends (`neither`, `min`, `max`, `both`) are exceeded.

    Of the values `clipped` per cent at either end are cut, unless they widen the scale by less than `tail`.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0, "neither"
    lowest, highest = float(finite.min()), float(finite.max())
    low, high = (float(v) for v in np.percentile(finite, (clipped, 100 - clipped)))
    low = lowest if low - lowest <= tail * (high - low) else low
    high = highest if highest - high <= tail * (high - low) else high
    if not high > low:
        width = 0.1 * abs(high) or 1.0  # of a plane with one value: any scale whose ticks can be read
        return low - width, high + width, "neither"
    beyond = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    return low, high, beyond[lowest < low, highest > high]


def draw_values(
    ax: Axes,
    plane: xr.DataArray,
    *,
    colours: str = _style.FIELD_MAP,
    positive: bool = False,
    shaded: bool = False,
    missing: str = _style.MISSING,
    name: str = "",
    log: bool = False,
    clipped: float = 0.2,
    readable: bool = False,
) -> None:
    """Draw a plane of numbers with a colour bar and labelled axes.

    With `positive` the colours begin at zero and zero cells are pale; with `shaded` heights are lit from the
    north-west; `missing` is the colour of NaN, `name` replaces that of the plane, and `clipped` is the
    share (%) of the values at either end that may lie outside the colour bar. `readable` leaves out the
    lightest colours, which pale cells would hide.
    """
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm, Normalize, to_rgb

    shown, extent = scale_of(plane), extent_of(plane)
    values = np.asarray(plane.values, dtype=float)
    values = block_means(np.where(values > 0, values, 0.0) if positive else values)
    if positive:
        _, high, beyond = colour_limits(values[values > 0], 1.0)  # their tails are longer
        low, beyond = 0.0, "max" if beyond in ("max", "both") else "neither"
    else:
        low, high, beyond = colour_limits(values, clipped)
    norm = (LogNorm if log and low > 0 else Normalize)(float(shown(low)), float(shown(high)))
    chosen = ListedColormap(_style.sequence_colours(256)) if readable else matplotlib.colormaps[colours]
    mappable = ScalarMappable(norm, chosen)
    is_missing = ~np.isfinite(values)
    filled = np.where(is_missing, low, values)
    image = mappable.to_rgba(shown(filled))[..., :3]
    if shaded:
        spacing = (extent[3] - extent[2]) / filled.shape[0], (extent[1] - extent[0]) / filled.shape[1]
        light = _light(filled, spacing)
        # full light is .9 brighter than none
        image = np.clip(image * (1.0 + 0.9 * (light - light.mean()))[..., None], 0.0, 1.0)
    if positive:
        image[values == 0] = to_rgb(_style.OPEN_COLOUR)
    image[is_missing] = to_rgb(missing)
    draw_image(ax, image, plane)
    label_axes(ax, plane)
    _draw_colour_bar(ax, mappable, beyond, name or name_of(plane), shown)


def draw_heat_map(ax: Axes, x: Quantity, y: Quantity, values: Quantity) -> None:
    """Draw numbers over two quantities as colours, on logarithmic axes where their values are wide."""
    from matplotlib.colors import LogNorm, Normalize

    logs = [_style.needs_log_axis(each.values) for each in (x, y, values)]
    edges = [_edges(each.shown, log) for each, log in zip((x, y), logs, strict=False)]
    shown = np.ma.masked_invalid(values.shown.T)
    ends = (shown.min(), shown.max()) if shown.count() else (1.0, 2.0)
    norm = (LogNorm if logs[2] else Normalize)(*ends)
    mesh = ax.pcolormesh(*edges, shown, norm=norm, cmap=_style.FIELD_MAP)
    mesh.set_rasterized(True)
    for log, setter in zip(logs, (ax.set_xscale, ax.set_yscale), strict=False):
        setter("log" if log else "linear")
    _style.plain_ticks(ax)
    x.label(ax.xaxis)
    y.label(ax.yaxis)
    ax.grid(False)
    ax.set_facecolor(_style.MISSING)
    _draw_colour_bar(ax, mesh, "neither", values.name, values.scale)


def _edges(centres: Array, log: bool) -> Array:
    """Return the edges of cells around their centres, midway between them on the axis."""
    if centres.size < 2:
        return np.array([0.5, 1.5]) * centres if log else np.array([-0.5, 0.5]) + centres
    places = np.log(centres) if log else centres
    middle = (places[1:] + places[:-1]) / 2
    edges = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _light(heights: Array, spacing: tuple[float, float], slope: float = 0.5) -> Array:
    """Return the illumination of each cell, 0 to 1, with slopes scaled to an rms of `slope`."""
    from matplotlib.colors import LightSource

    source = LightSource(azdeg=315, altdeg=45)
    slopes = np.gradient(heights, *spacing) if min(heights.shape) > 1 else np.zeros((2, *heights.shape))
    steep = float(np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2)))
    if not steep > 0 or not np.isfinite(steep):
        return np.ones(heights.shape)
    # row 0 is the south edge, whereas LightSource counts rows from the north
    normal = np.stack([-slopes[1], -slopes[0]], axis=-1) * (slope / steep)
    lit = (normal @ source.direction[:2] + source.direction[2]) / np.sqrt(1 + (normal**2).sum(axis=-1))
    clipped: Array = np.clip(np.asarray(lit), 0.0, 1.0)
    return clipped


def draw_flags(ax: Axes, plane: xr.DataArray) -> None:
    """Draw the flags of a contact (0, 1, 2; or a boolean mask), each in its colour, without ticks."""
    import matplotlib

    _, colours = STATES.get(str(plane.name), STATES["state"])
    palette = np.array([matplotlib.colors.to_rgb(colour) for colour in colours])
    flags = np.asarray(plane.transpose("y", "x").values).astype(np.int64)
    draw_image(ax, palette[np.clip(flags, 0, 2)], plane)
    ax.set_xticks([])
    ax.set_yticks([])
    _style.draw_frame(ax, _style.grey())


def draw_labels(ax: Axes, plane: xr.DataArray, count: int = 12) -> None:
    """Draw the labels of islands in so many colours, most neighbouring islands in different ones."""
    import matplotlib

    labels = np.asarray(plane.values).astype(np.int64)
    hues = matplotlib.colormaps[_style.SEQUENCE_MAP](np.linspace(0, 0.9, count))[:, :3]
    image = hues[(labels * 5) % count]  # consecutive labels are often neighbours and need unlike colours
    image[labels <= 0] = matplotlib.colors.to_rgb(_style.OPEN_COLOUR)
    draw_image(ax, image, plane)
    label_axes(ax, plane)
    ax.set_title(count_text(plane))


def count_text(labels: xr.DataArray) -> str:
    """Return the number of islands of a map of labels in words."""
    islands = np.unique(labels.values[labels.values > 0]).size
    return f"{islands} island{'' if islands == 1 else 's'}"


def draw_image(ax: Axes, image: Array, plane: xr.DataArray) -> None:
    """Draw an RGB image of a plane with its first row at the bottom and equal axes."""
    left, right, bottom, top = (float(v) for v in plane_scale(plane)(extent_of(plane)))
    ax.imshow(image, origin="lower", extent=(left, right, bottom, top), aspect="equal")
    _style.draw_frame(ax)


def _draw_colour_bar(ax: Axes, mappable: Any, beyond: str, name: str, scale: Scale) -> None:
    """Add a narrow colour bar beside the axes."""
    bar: Any = ax.get_figure().colorbar(mappable, ax=ax, extend=beyond, aspect=28, shrink=0.85, pad=0.02)  # type: ignore[union-attr]
    bar.outline.set_linewidth(0.5)
    _style.style_axes(bar.ax)
    bar.ax.grid(False)
    label_axis(bar.ax.yaxis, name, scale)
    _style.plain_ticks(bar.ax)
    bar.ax.tick_params(length=2.5)


def draw_flag_legend(axes: Any, sheet: Any, state: str) -> None:
    """Put the key of the colours of flags below all panels of a figure, or beside the last of those given."""
    from matplotlib.patches import Patch

    entries = [
        Patch(facecolor=colour, edgecolor=_style.grey(), linewidth=0.4, label=word)
        for word, colour in zip(*STATES[state], strict=True)
    ]
    if sheet is None:
        _style.side_legend(axes[-1], entries)
    else:
        sheet.legend(handles=entries, loc="outside lower right", ncols=3)


def draw_scale_bar(ax: Axes, plane: xr.DataArray) -> None:
    """Draw a scale bar of a round length below a map."""
    length, (left, right, *_) = plane_scale(plane), extent_of(plane)
    size = round_length((right - left) / 4)
    start, end, gap = (float(length(place)) for place in (left, left + size, 0.02 * (right - left)))
    transform = ax.get_xaxis_transform()
    ax.plot([start, end], [-0.045, -0.045], color=_style.ink(), lw=1.6, solid_capstyle="butt",
            transform=transform, clip_on=False)  # fmt: skip
    words = quantity_text(size, "m")
    ax.text(end + gap, -0.045, words, transform=transform, va="center", fontsize="small")


def round_length(length: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is no longer than `length`."""
    if not length > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(m for m in (1, 2, 5) if m * power <= length * ROUNDED))


def plane_of(data: Any, name: str, units: Units | None = None, argument: str = "result") -> xr.DataArray:
    """Return the one plane (y, x) in `data`: the variable `name`, or the only one that there is."""
    dataset = shown_in(as_dataset(data, argument), units)
    names = list(dataset.data_vars)
    planes = [each for each in names if {"y", "x"} <= set(dataset[each].dims)] or names[:1]
    variable = name if name in names else planes[0] if planes else ""
    with Problems("fc.plotting") as problems:
        if problems.require(bool(variable), argument, "a variable with dims (y, x)", NONE):
            is_one = variable == name or len(planes) == 1
            problems.require(is_one, argument, "one variable with dims (y, x)", planes)
            plane = dataset[variable]
            place = f"{argument}.{variable}"
            problems.require({"y", "x"} <= set(plane.dims), place, "dims (y, x)", plane.dims)
            problems.require(plane.dtype.kind in "biuf", place, "real numbers", f"type {plane.dtype}")
            with problems.collect():
                plane = without(plane, [dim for dim in plane.dims if dim not in ("y", "x")], place)
    return plane.transpose("y", "x")


def plane_scale(plane: xr.DataArray) -> Scale:
    """Return the scale of positions: metres with a prefix, or cells for a plane without coordinates."""
    if "x" not in plane.coords:
        return scale_for("cells", 1.0)
    left, right, bottom, top = extent_of(plane)
    return scale_of(plane["x"], (right - left, top - bottom))


def label_axes(ax: Axes, plane: xr.DataArray) -> None:
    """Label the axes of a map."""
    for dim, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
        label_axis(axis, f"${dim}$", plane_scale(plane) if dim in plane.coords else Scale(1.0, "cells"))


def draw_outline(ax: Axes, part: xr.DataArray, length: Scale, **style: Any) -> None:
    """Draw the outline of a part of a map, whose positions have the scale `length`."""
    from matplotlib.patches import Rectangle

    left, right, bottom, top = (float(v) for v in length(extent_of(part)))
    appearance: dict[str, Any] = {"fill": False, "edgecolor": "white", "linewidth": 1.2} | style
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, **appearance))
