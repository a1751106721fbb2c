"""Dimensions, signature and lacunarity of contact domains: over box size, along load and along shear."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.regression import local_slope
from fractalcontact.base.units import Scale
from fractalcontact.base.validation import require
from fractalcontact.plotting import _maps, _paths, _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import (
    as_dataset,
    quantity,
    require_dims,
    result_of,
    table,
)
from fractalcontact.plotting._line_panel import BAND_OPACITY, Family, LinePanel
from fractalcontact.plotting._paths import PATH, StatePath
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units

SIZES = ("box_length", "radius_length", "side", "box_size", "radius")
IN_CELLS = ("box_size", "radius")
CELLS = Scale(1.0, "cells")  # where a mask has no lengths
SPOTS = "random spots, equal area, number and perimeter"
CELLS_NULL = "random null, equal coverage"
# curve of a random null: its name and dim, and a and b of its local dimension a + b d ln(curve) / d ln(size)
NULLS = {
    "null_count": (CELLS_NULL, "box_size", 0.0, -1.0),
    "null_mass": (CELLS_NULL, "box_size", 0.0, 1.0),
    "null_fraction": (CELLS_NULL, "radius", 2.0, -1.0),
    "spots_fraction": (SPOTS, "side", 2.0, -1.0),
}
ENDS = ("low", "high")  # of an interval
MARKS = {"spot_size": ("spot size", "o"), "gap_size": ("gap size", "s")}


@figure
def signature(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw the local dimension d(s) of contact domains over the box size s, along load and along shear.

    A power law holds where a curve is level. Dashed lines show the random null. On the curves of a signature
    a circle marks the spot size and a square the gap size; they are hollow for a state that has no dimension
    of its own (`signature_flag`), thin bars are their intervals, and the common window of the dimensions is
    shaded; of a single curve the interval of its dimension is, too. At most six curves are drawn.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.signature`, `box_dimension`, `box_counts`, `correlation_dimension` or
        `minkowski_dimension` over (shear, step), or without shear or step.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> (ax,) = fc.plotting.signature(fc.domains.signature(mask))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    box size (mm) | local dimension
    """
    data = result_of(result, ("local_slope",), PATH, units)
    nulls = [name for name in NULLS if name in data]
    over = next((name for name in ("side", *IN_CELLS) if name in data["local_slope"].dims), "box_size")
    require_dims(data, dict.fromkeys(("local_slope", *nulls), over))
    require(data.sizes[over] > 0, f"result.{over}", "at least one entry")
    for name in nulls[:1]:
        _, dim, constant, sign = NULLS[name]
        require_dims(data, {dim: dim})
        slope = constant + sign * local_slope(data[dim].values, data[name].values)
        data = data.assign(null_local_slope=(data[name].dims, slope))
    panels = path_panels(axes, data)
    null = NULLS[nulls[0]][0] if nulls else ""
    names = ("local_slope", "local dimension")
    for panel, path in _size_curves(data, shear, normal_force, panels, names, null):
        _mark_sizes(panel, path.states, path.dim)
        panel.finish(log="x", empty="no contact")
        panel.ax.set_ylim(-0.05, 2.05)
        slopes = panel.y.values[np.isfinite(panel.y.values)]
        beyond = slopes[(slopes < -0.1) | (slopes > 2.1)]  # by more than twice the margin of the axes
        if beyond.size:  # no dimension in a plane: the slope between counts of a few boxes
            ends = dict.fromkeys(f"{value:.2g}" for value in (beyond.min(), beyond.max()))
            note = f"outside the axes, of few boxes: {' to '.join(ends)}"
            place: dict[str, Any] = {"transform": panel.ax.transAxes, "ha": "right", "size": "small"}
            panel.ax.text(1.0, 1.01, note, color=_style.grey(), **place)
            panel.ax.set_title(path.common, pad=16)  # points: above the note
    return panels[1]


def _mark_sizes(panel: LinePanel, path: xr.Dataset, dim: str) -> None:
    """Mark spot and gap size on each curve, and shade the window of the dimensions."""
    measured = np.full(path.sizes[dim], True)
    if "signature_flag" in path:
        measured = table(path, "signature_flag", (dim,)) == 0
    for name, (title, marker) in MARKS.items():
        if name in path:
            places, sizes = np.log(panel.x.values), table(path, name, (dim,))
            for i, own in enumerate(panel.family.styles):
                with np.errstate(invalid="ignore", divide="ignore"):
                    height = np.interp(np.log(sizes[i]), places, panel.y.values[i], np.nan, np.nan)
                point = np.array([sizes[i]]), np.array([height]), measured[[i]]
                panel.flagged(panel.family.curve(title, i), *point, marker=marker, ms=5, **own)
                if {f"{name}_low", f"{name}_high"} <= path.variables.keys():
                    low, high = (panel.x.scale(table(path, f"{name}_{end}", (dim,))[[i]]) for end in ENDS)
                    curve = panel.family.curve(f"{title}, interval", i)
                    panel.ax.hlines([height], low, high, label=curve, lw=_style.THIN, **own)
            panel.key(title, ls="", marker=marker)
    if not measured.all():
        panel.key("no dimension", ls="", marker="o", mfc=_style.tone(0.0))
    ends = [np.unique(path[name].values) for name in ("window_low", "window_high") if name in path]
    window = np.concatenate([end for end in ends if end.size == 1] or [np.empty(0)])  # that all states have
    if window.size == 2 and np.isfinite(window).all():
        panel.ax.axvspan(*panel.x.scale(window), color=_style.pale(), lw=0, zorder=0)
        panel.area_key("window", facecolor=_style.pale())
        name, own = "domain_dimension", panel.family.styles[0]
        if path.sizes[dim] == 1 and {f"{name}_low", f"{name}_high"} <= path.variables.keys():
            lowest, highest = (float(table(path, f"{name}_{end}", (dim,))[0]) for end in ENDS)
            if np.isfinite([lowest, highest]).all():  # of a state that has a dimension
                panel.band("dimension, interval", window, lowest, highest, own["color"], alpha=0.3)
                panel.area_key("dimension, interval", facecolor=own["color"], alpha=0.3)


@figure
def lacunarity(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    maps: bool = False,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    r"""Draw gliding-box lacunarity against box size, for increasing load and for increasing shear.

    Bands show the intervals, dashed lines the random null: randomly placed cells of equal coverage. At most
    six curves are drawn; with `maps` all states are, as colours over load or shear (over the number of the
    state on a path that turns back) and box size.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.lacunarity` over (shear, step, box_size), or without shear or step.
    maps : bool
        Draw heat maps instead of curves.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> result = fc.domains.lacunarity(mask, box_sizes=[1, 2, 4, 8])
    >>> (ax,) = fc.plotting.lacunarity(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    box size (mm) | lacunarity $\Lambda$
    """
    data = result_of(result, ("lacunarity",), PATH, units)
    require_dims(data, {"lacunarity": "box_size"})
    dims, shown = path_panels(axes, data)
    if maps:
        for dim, ax in zip(dims, shown, strict=True):
            path = _paths.states_along(data, dim, shear, normal_force)
            name = "shear" if dim == "shear" else _paths.load_of(path.states)
            own = path.states.expand_dims([d for d in PATH if d != dim])
            along = _paths.loads_of(own, name, PATH if dim == PATH[1] else PATH[::-1])
            places = Quantity(along.values[0], along.scale, along.name)
            steps = np.diff(places.values)
            is_numbered = not (np.all(steps > 0) or np.all(steps < 0))
            if is_numbered:  # cells of a path that turns back would overlap
                places = Quantity(np.arange(1.0 + steps.size), PLAIN, "state, in the order of the path")
            colours = quantity(path.states, "lacunarity", (dim, "box_size"))
            _maps.draw_heat_map(ax, places, sizes_of(path.states, "box_size"), colours)
            if is_numbered:
                ax.xaxis.get_major_locator().set_params(integer=True)
            ax.set_title(path.common)
        return shown
    panels, names = (dims, shown), ("lacunarity", "")
    for panel, _ in _size_curves(data, shear, normal_force, panels, names, CELLS_NULL):
        finite = panel.y.values[np.isfinite(panel.y.values)]
        steep = finite.size > 0 and finite.max() > 1.5 * finite.min()  # else a linear axis has more labels
        panel.finish(log="xy" if steep else "x", empty="no contact")
    return shown


def path_panels(axes: Panels | None, data: xr.Dataset) -> tuple[list[str], AxesArray]:
    """Return the path dims that are longer than one (`step` if none is), and Axes for each of them."""
    dims = [dim for dim in ("step", "shear") if data.sizes[dim] > 1] or ["step"]
    size = _style.WIDE_ROW if len(dims) > 1 else _style.PANEL
    return dims, _style.panel_row(axes, len(dims), size)


def _size_curves(
    data: xr.Dataset,
    shear: float | None,
    force: float | None,
    panels: tuple[list[str], AxesArray],
    names: tuple[str, str],
    null: str,
) -> Iterator[tuple[LinePanel, StatePath]]:
    """Draw a variable over box size, beside its random null, and yield the panels to be finished."""
    (dims, shown), (name, title) = panels, names
    for dim, ax in zip(dims, shown, strict=True):
        path = _paths.states_along(data, dim, shear, force, _style.MOST_CURVES)
        states = path.states
        over = next(str(last) for last in states[name].dims[::-1] if last not in PATH)
        sizes = sizes_of(states, over)
        panel = LinePanel(ax, states, sizes, name, (dim, over), path.family, y_name=title)
        panel.curves("contact domain")
        _draw_interval(panel, name, has_key=ax is shown[-1])
        if f"null_{name}" in states:
            key = null if ax is shown[-1] else ""
            panel.curves("random null", f"null_{name}", key=key, marker="", **_style.DASHED)
        ax.set_title(path.common)
        yield panel, path


def _draw_interval(panel: LinePanel, name: str, *, has_key: bool) -> None:
    """Shade the intervals of the curves of a variable, where the result has them."""
    ends = panel.interval(name)
    if not ends:
        return
    for number, (own, low, high) in enumerate(zip(panel.family.styles, *ends, strict=True)):
        curve = panel.family.curve("interval", number)
        panel.band(curve, panel.x.values, low, high, own["color"])
    if has_key:
        panel.area_key("interval", facecolor=_style.grey(), alpha=BAND_OPACITY)


def sizes_of(data: xr.Dataset, over: str) -> Quantity:
    """Return the box sizes or radii along a dim: lengths, or numbers of cells where there are no lengths."""
    size = next((s for s in SIZES if s in data.variables and data[s].dims == (over,)), over)
    name = "radius" if over == "radius" else "box size"
    if size not in data.variables:
        return Quantity(np.arange(1.0, data.sizes[over] + 1), CELLS, name)
    sizes = quantity(data, size, (over,), name)
    return Quantity(sizes.values, CELLS, name) if size in IN_CELLS else sizes


DIMENSIONS = ("box_dimension", "minkowski_dimension", "correlation_dimension", "boundary_dimension")
INTERVAL = ("ci_low", "ci_high")


@figure
def box_dimension(
    result: Any, *, normal_force: float | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    r"""Draw the box dimension of a contact domain against load, and against shear at one force.

    The other dimensions of a domain are drawn in the same way. Dashed lines show the random null: randomly
    placed cells of equal coverage. Bands show the intervals where there is a single curve. A point without
    an interval, or with one wider than 0.5, is open.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension`, `minkowski_dimension`, `correlation_dimension` or
        `boundary_dimension` over (shear, step), or over one of them.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> (ax,) = fc.plotting.box_dimension(fc.domains.box_dimension(mask))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    coverage (%) | box dimension $\Delta_\sigma$
    """
    dataset = as_dataset(result)
    present = [name for name in DIMENSIONS if name in dataset]
    data = result_of(dataset, (present or DIMENSIONS)[:1], PATH, units)
    (dims, shown), shears = path_panels(axes, data), _paths.by_shear(data)
    # the boundary has none also where there is contact, without an interior
    empty = "no dimension" if present[0] == "boundary_dimension" else "no contact"
    for dim, ax in zip(dims, shown, strict=True):
        if dim == "step":
            panel = _draw_dimension(ax, data, present[0], PATH, shears)
        else:
            path = _paths.at_force(data, normal_force)
            load = _paths.load_text(path, data)
            family = Family([{"color": _style.ink()}], [load] if load else [])
            panel = _draw_dimension(ax, path.expand_dims("step"), present[0], PATH[::-1], family)
            ax.set_title(load)
        if ax is not shown[0]:
            ax.set_ylabel("")
        panel.family = shears if data.sizes["step"] > 1 else Family([])
        log = "x" if _style.needs_log_axis(panel.x.values) else ""
        panel.finish(log=log, legend=ax is shown[-1], empty=empty)
        ax.set_ylim(-0.05, 2.05)
    return shown


def _draw_dimension(
    ax: Axes, path: xr.Dataset, name: str, dims: tuple[str, str], family: Family
) -> LinePanel:
    """Draw one curve for each of the family with its random null, its points and, if alone, its interval."""
    load = "shear" if dims[1] == "shear" else _paths.load_of(path) or "coverage"
    panel = LinePanel(ax, path, _paths.loads_of(path, load, dims), name, dims, family, points=0)
    x, y = panel.x.values, panel.y.values
    reliable, described = np.full(y.shape, True), "interval wider than 0.5, or none"
    panel.key("contact domain", marker="o")
    interval = panel.interval(name)  # of `describe`, whose dimensions have an interval each
    if interval or set(INTERVAL) <= path.variables.keys():
        low, high = interval or map(panel.values, INTERVAL)
        reliable = high - low <= 0.5  # a quarter of the range of dimensions in a plane
        panel.area_key("interval", facecolor=_style.grey(), alpha=0.25)
        if len(y) == 1:
            panel.band(family.curve("interval"), x[0], low[0], high[0], family.styles[0]["color"])
    if "follows_power_law" in path:
        reliable = reliable & (panel.values("follows_power_law") != 0)
        described = "no power law, or wide interval"
    panel.curves("contact domain")
    if y.shape[1] <= _style.MAX_MARKED_POINTS:
        for i, own in enumerate(family.styles):
            panel.flagged("_points", x[i], y[i], reliable[i], **own)
    if not reliable[np.isfinite(y)].all():
        panel.key(described, ls="", marker="o", mfc=_style.tone(0.0))
    if "null_dimension" in path:
        panel.curves("random null", "null_dimension", key=CELLS_NULL, **_style.DASHED)
    return panel


_lacunarity_maps = functools.partial(lacunarity, maps=True)
FIGURES = (
    *(StudyFigure(name, f"domains/{name}", name, box_dimension) for name in DIMENSIONS[:3]),
    StudyFigure("signature", "domains/signature", "local_slope", signature),
    StudyFigure("local_slopes", "domains/box_dimension", "local_slope", signature),
    StudyFigure("lacunarity", "domains/lacunarity", "lacunarity", lacunarity),
    StudyFigure(
        "lacunarity_maps", "domains/lacunarity", "lacunarity", _lacunarity_maps, ("step", "box_size")
    ),
)
