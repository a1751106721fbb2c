"""Friction angle and shear strength of a joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.plotting import _style
from fractalcontact.plotting._directions import (
    direction_name,
    direction_styles,
    limit_shear,
    select_direction,
)
from fractalcontact.plotting._inputs import as_dataset, result_of, table, words
from fractalcontact.plotting._paths import curve_name, load_words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

LOCKED = 90.0  # degree; the joint cannot slide at a larger friction angle


@_style.checked
def friction(
    result: Any,
    *,
    direction: str | None = None,
    reach: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw friction angle and shear strength against shear displacement, one curve per normal force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.friction`: friction_angle (degree) over (direction, shear, step), with
        shear_strength (Pa) if forces are given; basic_friction_angle (degree) is drawn as a line.
    direction : str, optional
        Direction to draw; required if there are several directions and forces. Without forces each
        direction gets a curve.
    reach : float, optional
        Largest shear displacement (m) to show.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or there are several directions and none is chosen.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3, basic_friction_angle=35.0)
    >>> opening = fc.joints.dilatancy(crack, shear=[0.0, 1e-4, 2e-4, 3e-4])
    >>> (ax,) = fc.plotting.friction(fc.joints.friction(opening))
    >>> print(ax.get_ylabel())
    friction angle (°)
    """
    result = shown_in(result, units, "friction")
    selected = limit_shear(as_dataset(result, "friction"), reach)
    names = ["friction_angle", "shear_strength"] if "shear_strength" in selected else ["friction_angle"]
    by_force = "friction_angle" in selected and "step" in selected["friction_angle"].dims
    over = "step" if by_force else "direction"
    if by_force or direction:
        selected = select_direction(selected, direction, "friction")
    data = result_of(selected, "friction", (*names, "shear"), ("shear", over))
    size = (_style.WIDTH if len(names) > 1 else _style.PANEL[0], 3.1)
    shown = _style.panel_row(axes, len(names), size, sharex=True)
    entries, title = _curve_legend(data, over)
    for ax, name in zip(shown, names, strict=True):
        _draw_curves(ax, data, name, over, entries, title)
    if "basic_friction_angle" in data:
        basic_angle = float(np.asarray(data["basic_friction_angle"].values, dtype=float).ravel()[0])
        style: dict[str, Any] = {"color": _style.ink(), "lw": 0.8, "ls": ":"}
        shown[0].axhline(basic_angle, label="_basic angle", **style)
        entries = [*entries, _style.legend_line("basic angle", **style)]
    remarks = []
    if over == "step" and "direction" in data.coords:
        remarks.append(f"block slides {direction_name(words(data['direction'])[0])}")
    if shown[0].get_ylim()[1] > LOCKED:
        shown[0].set_ylim(top=LOCKED)
        remarks.append(f"locked above {LOCKED:g}°")
    shown[0].set_title(", ".join(remarks))
    if len(names) > 1:
        shown[1].set_title(_slope_lengths(data))
    _style.side_legend(shown[-1], entries, title=title)
    return shown


def _slope_lengths(data: xr.Dataset) -> str:
    """Return over which lengths of shear the slopes of the dilatancy were taken; empty where not stated."""
    lengths = np.atleast_1d(data["smoothing"].values).astype(float) if "smoothing" in data else np.empty(0)
    lengths = lengths[np.isfinite(lengths)]
    ends = [quantity_text(end, "m") for end in (lengths.min(), lengths.max())] if lengths.size else []
    return "slopes over " + " to ".join(dict.fromkeys(ends)) if ends else ""


def _draw_curves(ax: Axes, data: xr.Dataset, name: str, over: str, entries: list[Any], title: str) -> None:
    """Draw one variable against shear, with the line styles of the legend entries."""
    values, shear = table(data, name, ("shear", over)), np.atleast_1d(data["shear"].values).astype(float)
    along, across = scale_of(data["shear"]), scale_of(data[name])
    for j, entry in enumerate(entries):
        what = curve_name(name.replace("_", " "), (title, [each.get_label() for each in entries]), j)
        ax.plot(along(shear), across(values[:, j]), color=entry.get_color(), ls=entry.get_linestyle(),
                marker="o" if shear.size <= _style.MAX_MARKED_POINTS else "", label=what)  # fmt: skip
    if name == "shear_strength" and _style.needs_log_axis(values):
        ax.set_yscale("log")
        _style.plain_ticks(ax)
    label_axis(ax.xaxis, name_of(data["shear"]), along)
    label_axis(ax.yaxis, name_of(data[name]), across)


def _curve_legend(data: xr.Dataset, over: str) -> tuple[list[Any], str]:
    """Return the legend entries of the curves and the title of the legend."""
    if over == "step":
        title, labels = load_words(data)
        colours = _style.sequence_colours(len(labels))
        return [_style.legend_line(t, color=c) for t, c in zip(labels, colours, strict=True)], title
    return [_style.legend_line(name, **style) for name, style in direction_styles(data)], "block slides"
