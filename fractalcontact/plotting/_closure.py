"""A joint under normal load: closure with the laws that fit it, hydraulic aperture, uplift."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import Problems, require
from fractalcontact.plotting import _maps, _paths, _style
from fractalcontact.plotting._fields import MAPS
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import (
    as_dataset,
    extent_of,
    nearest,
    quantity,
    require_dims,
    result_of,
    table,
    without,
    words,
)
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Quantity, Units, scale_of

LAW_CONSTANTS = ("closure_length", "reference_pressure", "initial_stiffness", "greatest_closure")
LAWS = {"exponential": _style.DASHED, "hyperbolic": _style.DOTTED}  # line where not preferred


@figure
def closure_laws(
    result: Any,
    *,
    laws: Any = None,
    shear: float | None = None,
    marked: Sequence[int] = (),
    key: bool = True,
    log: bool = False,
    against: str | None = None,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the load against closure, one curve per shear displacement.

    It is the normal force, or the nominal pressure where that was prescribed; `against` names another load.

    Thin lines show the total closure w, thick lines the interface closure w_int = w - w_b, where w_b is the
    closure of the two bodies. With `laws` points are the interface closures against the nominal pressure, of
    the first loading and beyond; the law that they prefer is a thick line, the other a thin one.
    """
    if laws is not None:
        require(
            against in (None, "nominal_pressure"), "against", "nominal_pressure, that of the laws", against
        )
        return _draw_laws(result, laws, key, log, units, ax)
    load = against or _paths.force_of(as_dataset(result))
    data = result_of(result, ("closure", load), _paths.PATH, units)
    loads = _paths.loads_of(data, load)
    with Problems("fc.plotting") as problems:
        last = data.sizes["step"] - 1
        problems.numbers("marked", marked if len(marked) else 0, at_least=-1, at_most=last, integral=True)
    panel = LinePanel(ax, data, "closure", loads, _paths.PATH, _paths.by_shear(data), x_name="closure")
    inner = "interface_closure" if "interface_closure" in data else "closure"
    if inner == "interface_closure":
        panel.curves("interface closure", x=inner, key=r"interface, $w_\mathrm{int}$")
        panel.curves("total closure", key="total, $w$", lw=_style.THIN)
    else:
        panel.curves("closure")
    panel.finish(log="xy" if log else "", zero="" if log else "xy", title="closure", legend=key)
    if len(marked) and data.sizes["shear"]:
        row = 0 if shear is None or data.sizes["shear"] == 1 else nearest(data["shear"], shear)
        steps = [int(step) for step in marked]
        points = panel.values(inner)[row, steps], panel.y.values[row, steps]
        panel.mark(*points, panel.family.styles[row]["color"])
    return panel.ax


def _draw_laws(result: Any, laws: Any, key: bool, log: bool, units: Units | None, ax: Axes | None) -> Axes:
    """Draw the steps of each shear and both laws through them."""
    names = ("interface_closure", "nominal_pressure")
    data = result_of(result, names, _paths.PATH, units)
    fitted = result_of(laws, (*LAW_CONSTANTS, "preferred_law"), ("shear",), argument="laws")
    count, of_laws = data.sizes["shear"], fitted.sizes["shear"]
    require(of_laws == count, "laws", f"{count} shears, as of the closure", of_laws)
    panel = LinePanel(ax, data, *names, _paths.PATH, _paths.by_shear(data))
    points, pressure = panel.x.values, panel.y.values
    if "seated_closure" in fitted:
        points = table(fitted, "seated_closure", _paths.PATH)
    seat = float(fitted["seating_pressure"]) if "seating_pressure" in fitted else 0.0
    constants = [table(fitted, name, ("shear",)) for name in LAW_CONSTANTS]
    preferred = table(fitted, "preferred_law", ("shear",)).astype(int)
    panel.curves("steps", x=points, ls="", marker="o", ms=3.5)
    for i, own in enumerate(panel.family.styles):
        shown = pressure[i][np.isfinite(points[i]) & (pressure[i] > seat)]
        if shown.size < 2:
            continue
        p = np.geomspace(shown.min(), shown.max(), 200)  # about 1/72 inch each
        length, reference, stiffness, greatest = (values[i] for values in constants)
        with np.errstate(all="ignore"):  # constants of faces that close by rounding alone
            curves = (length * np.log(p / reference), (p - seat) / (stiffness + (p - seat) / greatest))
        for number, ((name, other), curve) in enumerate(zip(LAWS.items(), curves, strict=True), 1):
            style = own if number == preferred[i] else own | other
            panel.line(panel.family.curve(f"{name} law", i), curve, p, **style)
    panel.key("preferred")
    for name, other in LAWS.items():
        panel.key(f"{name}, not preferred", **other)
    return panel.finish(log="xy" if log else "y", title="law", legend=key)


@figure
def hydraulic_aperture(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the hydraulic aperture against load, one curve per shear displacement and flow direction.

    The aperture is zero where contacts block the flow from side to side. Broad pale lines show the
    mechanical aperture (mean gap) if the result has it.
    """
    data = result_of(result, ("hydraulic_aperture",), (*_paths.PATH, "axis"), units)
    dims, x, family = _paths.path_axis(data, None)
    aperture = quantity(data, "hydraulic_aperture", ("axis", *dims))
    panel = LinePanel(ax, data, x, aperture, dims, family, points=_style.MAX_MARKED_POINTS)
    axes = words(data["axis"]) if "axis" in data.coords else []
    for i, values in enumerate(aperture.values):
        name = f"along {axes[i]}" if axes else "flow"
        panel.curves(name, values, key=name if axes else "", ls=_style.LINES[i % 2])
    if "aperture" in data:
        # three times as broad as a curve and pale, so that it is seen where the hydraulic aperture lies on it
        broad: dict[str, Any] = {"lw": 4.5, "alpha": 0.3, "solid_capstyle": "butt", "zorder": 1.5}
        panel.curves("mean gap", "aperture", key="mean gap", marker="", **broad)
    return panel.finish(log="x" if _style.needs_log_axis(x.values) else "", zero="y", title="flow")


LINES: dict[str, dict[str, Any]] = {
    "joint": {"color": _style.BLUE, "ls": "-"},
    "linear": _style.DASHED,
    "bilinear": {"color": _style.RED} | _style.DASH_DOTTED,
}


@figure
def uplift(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw the water pressure in a joint and, beside it, the uplift along the flow with its lines of action.

    The diagrams of guidelines are dashed. A triangle on the axis marks each line of action. Contacts and
    pockets that no water reaches are grey in the map and carry no uplift.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.uplift`, of one gap.
    {shared}

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> gap = fc.surfaces.from_array(np.full((8, 16), 1e-4), 1.0)
    >>> pressure, uplift = fc.plotting.uplift(fc.joints.uplift(gap, upstream_pressure=490e3))
    >>> print(uplift.get_ylabel())
    uplift (kPa)
    """
    data = result_of(result, ("fluid_pressure", "uplift_profile", "uplift_x", "uplift_y"), (), units)
    plane = _maps.plane_of(data[["fluid_pressure"]], "fluid_pressure")
    profile = data["uplift_profile"]
    others = [dim for dim in profile.dims if dim not in ("diagram", "x", "y")]
    profile = without(profile, others, "result.uplift_profile")
    require(profile.ndim == 2, "result", "uplift_profile of one gap", profile.dims)
    names = ("uplift_profile", "uplift_x", "uplift_y", "diagram")
    require_dims(data, dict.fromkeys(names, "diagram"))
    diagrams = words(data["diagram"])
    are_known = "linear" in diagrams and set(diagrams) <= set(LINES)
    require(are_known, "result.diagram", f"'linear', and others of {', '.join(LINES)}", diagrams)
    left, right = shown = _style.panel_row(axes, 2, _style.WIDE_ROW, width_ratios=(1.0, 1.1))
    _maps.draw_values(left, plane)
    left.set_title(_state(data))
    dim = "x" if "x" in profile.dims else "y"
    length, pressure = _maps.plane_scale(plane), scale_of(plane)
    place = Quantity(profile[dim].values, length, f"${dim}$")
    panel = LinePanel(right, data, place, Quantity(profile.values, pressure, "uplift"), points=0)
    mark: dict[str, Any] = {"marker": "^", "ls": "", "ms": 6, "clip_on": False, "zorder": 3}
    for name in diagrams:
        style = {"color": _style.ink(), **LINES[name]}
        panel.line(name, place.values, profile.sel(diagram=name).values, key=name, **style)
        action = float(data[f"uplift_{dim}"].sel(diagram=name))
        panel.line("_action", [action], [0.0], color=style["color"], **mark)
    panel.key("line of action", marker="^", ls="")
    start, end = extent_of(plane)[:2] if dim == "x" else extent_of(plane)[2:]
    right.set_xlim(float(length(start)), float(length(end)))
    right.set_ylim(bottom=0.0)
    panel.finish()
    return shown


def _state(data: xr.Dataset) -> str:
    """Return shear and normal stress of the joint that is shown, as far as the result has them."""
    shown = {"shear": "shear", "effective_stress": "effective stress", "nominal_pressure": "normal stress"}
    present = [name for name in shown if name in data.variables and data[name].size == 1]
    present = [name for name in present if not (name == "nominal_pressure" and "effective_stress" in present)]
    texts = {name: scale_of(data[name]).text(np.ravel(data[name].values)[0]) for name in present}
    return ", ".join(f"{shown[name]} {text}" for name, text in texts.items() if text != "-")


def _of_joint(data: xr.Dataset) -> Any:
    """Draw the closure laws, with the steps marked whose maps `joint_contact_domains` shows."""
    every = data.expand_dims([dim for dim in ("shear", "step") if dim not in data.dims])
    shear = _paths.middle_shear(data)
    steps = _paths.loaded_steps(_paths.at_shear(every, shear), MAPS) if "state" in data else ()
    return closure_laws(data, shear=shear, marked=steps)


FIGURES = (
    StudyFigure("joint_closure", "joints/closure", "interface_closure", _of_joint),
    StudyFigure("closure_law", "contact", "closure", _paths.by_decades(closure_laws)),
    StudyFigure("hydraulic_aperture", "joints/transmissivity", "hydraulic_aperture", hydraulic_aperture),
    StudyFigure("uplift", "joints/uplift", "uplift_profile", _paths.at_end(uplift, *_paths.PATH)),
)
