"""Map of the water pressure in a joint, above the diagram of its uplift."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._inputs import extent_of, require_dims, result_of, words
from fractalcontact.plotting._surface import label_axes, plane_of, plane_scale
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

SIZE = (9.0, 3.6)  # inches
LINES: dict[str, dict[str, Any]] = {
    "joint": {"color": _style.BLUE, "ls": "-"},
    "linear": {"ls": "--", "lw": 1.0},
    "bilinear": {"color": _style.RED, "ls": "-.", "lw": 1.0},
}


@_style.checked
def uplift(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw the water pressure in a joint and, beside it, the uplift along the flow with its lines of action.

    The diagrams of guidelines are dashed. A triangle on the axis marks each line of action. Contacts and
    pockets that no water reaches are grey in the map and carry no uplift.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.uplift`, of one gap.
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
        A variable is missing, or the result has several planes.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> gap = fc.surfaces.from_array(np.full((8, 16), 1e-4), 1.0)
    >>> pressure, uplift = fc.plotting.uplift(fc.joints.uplift(gap, upstream_pressure=490e3))
    >>> print(uplift.get_ylabel())
    uplift (kPa)
    """
    result = shown_in(result, units, "uplift")
    data = result_of(result, "uplift", ("fluid_pressure", "uplift_profile", "uplift_x", "uplift_y"), ())
    plane = plane_of(data[["fluid_pressure"]], "uplift", "fluid_pressure")
    profile = data["uplift_profile"].squeeze([d for d in data["uplift_profile"].dims if data.sizes[d] == 1
                                              and d not in ("diagram", "x", "y")])  # fmt: skip
    names = ("uplift_profile", "uplift_x", "uplift_y", "diagram")
    require_dims(data, "uplift", dict.fromkeys(names, "diagram"))
    with Problems("fc.plotting.uplift") as problems:
        problems.require(profile.ndim == 2, "result", "uplift_profile of one gap", profile.dims)
        diagrams = words(data["diagram"])
        are_known = "linear" in diagrams and set(diagrams) <= set(LINES)
        problems.require(are_known, "result.diagram", f"'linear', and others of {', '.join(LINES)}", diagrams)
    left, right = shown = _style.panel_row(axes, 2, SIZE, width_ratios=(1.0, 1.1))
    length, pressure = plane_scale(plane), scale_of(plane)
    extent = extent_of(plane)
    mappable = _maps.field(left, np.asarray(plane.values, float), extent, length, pressure, positive=False)
    _maps.colour_bar(left, mappable, name_of(plane), pressure)
    label_axes(left, plane, length)
    left.set_title(_state(data))
    _draw_diagrams(right, data, profile, extent, length, pressure)
    return shown


def _state(data: Any) -> str:
    """Return shear and normal stress of the joint that is shown, as far as the result has them."""
    shown = {"shear": "shear", "effective_stress": "effective stress", "nominal_pressure": "normal stress"}
    present = [name for name in shown if name in data.variables and data[name].size == 1]
    present = [name for name in present if not (name == "nominal_pressure" and "effective_stress" in present)]
    texts = {name: scale_of(data[name]).text(np.ravel(data[name].values)[0]) for name in present}
    return ", ".join(f"{shown[name]} {text}" for name, text in texts.items() if text != "-")


def _draw_diagrams(ax: Any, data: Any, profile: Any, extent: Any, length: Any, pressure: Any) -> None:
    """Draw the profile of each diagram and mark its line of action on the axis."""
    dim = "x" if "x" in profile.dims else "y"
    start, end = extent[:2] if dim == "x" else extent[2:]
    for name in words(profile["diagram"]):
        style = {"color": _style.ink(), **LINES[name]}
        ax.plot(length(profile[dim].values), pressure(profile.sel(diagram=name).values), label=name, **style)
        place = float(length(float(data[f"uplift_{dim}"].sel(diagram=name))))
        ax.plot([place], [0.0], marker="^", color=style["color"], clip_on=False, ls="", ms=6, zorder=3)
    ax.set_xlim(float(length(start)), float(length(end)))
    ax.set_ylim(bottom=0.0)
    label_axis(ax.xaxis, f"${dim}$", length)
    label_axis(ax.yaxis, "uplift", pressure)
    lines = [line for line in ax.lines if not line.get_label().startswith("_")]
    _style.side_legend(
        ax, [*lines, _style.legend_line("line of action", marker="^", ls="", color=_style.grey())]
    )
