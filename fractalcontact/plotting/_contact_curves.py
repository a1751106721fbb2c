"""Contact area, pressures, slip loops and any other variable of a path, with theories beside them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import spread_indices
from fractalcontact.base.units import Scale
from fractalcontact.base.validation import require
from fractalcontact.plotting import _paths, _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import as_dataset, quantity, require_dims, result_of, table, words
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._paths import PATH
from fractalcontact.plotting._style import Axes, AxesArray, Panels, needs_log_axis
from fractalcontact.plotting._units import PER_CENT, Quantity, Units, name_of, scale_of

CORRECTED = "corrected for the perimeter"
OF_THEORY = {"contact_stiffness": "interface_stiffness", "stiffness": "interface_stiffness"}


@figure
def contact_area(
    result: Any,
    *,
    against: str | None = None,
    theory: Any = None,
    log: bool = False,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the real contact area as a fraction of the nominal area, one curve per shear displacement.

    Solid lines show the area corrected for the perimeter, thin dashed lines the count of cells in contact,
    which is too high because a cell that is partly in contact counts fully (Yastrebov, Anciaux and Molinari
    2017, Journal of the Mechanics and Physics of Solids 107).
    """
    against = against or _paths.force_of(as_dataset(result))
    data = result_of(result, ("contact_fraction", against), PATH, units)
    loads, shears, name = _paths.loads_of(data, against), _paths.by_shear(data), "real / nominal contact area"
    panel = LinePanel(ax, data, loads, "contact_fraction", PATH, shears, y_name=name)
    if "corrected_contact_fraction" in data:
        panel.curves(CORRECTED, "corrected_contact_fraction", key=CORRECTED)
        panel.curves("cell count", key="cell count", **_style.DASHED)
    else:
        panel.curves("cell count")
    if theory is not None:
        _draw_theories(panel, theory, "contact_fraction", against)
    if log and against != "closure":
        _draw_proportional(panel, panel.x.values, panel.y.values)
    return panel.finish(log="xy" if log else "", zero="" if log else "xy", title="contact area")


def _draw_proportional(panel: LinePanel, x: Any, y: Any) -> None:
    """Draw the line of proportional growth through the middle of the curves."""
    used = (x > 0) & (y > 0)
    if used.any():
        slope = np.exp(np.median(np.log(y[used] / x[used])))
        ends = np.array([x[used].min(), min(x[used].max(), y[used].max() / slope)])  # within the curves
        name = "proportional to the load"
        panel.line(name, ends, ends * slope, key=name, marker="", color=_style.grey(), **_style.DOTTED)


def _draw_theories(panel: LinePanel, theory: Any, name: str, against: str) -> None:
    """Draw a variable of each theory that gives one."""
    data = result_of(theory, (name, "theory", against), ("theory", "step"), argument="theory")
    loads, values = table(data, against, ("step",)), table(data, name, ("theory", "step"))
    colours = _style.cycle()
    for i, word in enumerate(words(data["theory"])):
        if np.isfinite(values[i]).any():
            authors = ", ".join(part.capitalize() for part in word.split("_"))
            colour = colours[(i + 1) % len(colours)]
            panel.line(authors, loads, values[i], key=authors, marker="", color=colour, **_style.DASH_DOTTED)


@figure
def path(
    result: Any,
    variable: str | Sequence[str] | None = None,
    *,
    against: str | None = None,
    theory: Any = None,
    log: bool | None = None,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw any variable of a load or shear path, for example the mean gap, the stiffness or the coverage.

    There is one curve per shear displacement against a load, and one per load against shear. Of a single
    curve the interval is a band, where the result has its ends as `<variable>_low` and `<variable>_high`.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        Any result over (shear, step), or over one of them: from `fractalcontact.contact.press`,
        `fractalcontact.joints.closure`, `fractalcontact.joints.closure_laws`,
        `fractalcontact.domains.evolution`.
    variable : str or sequence of str, optional
        Name of the variable, or of several of one unit, which get a line style each. Default: the name of a
        DataArray, or the variables that the result states in its attribute `path_figure`.
    theory : Dataset, optional
        From `fractalcontact.contact.theories`: dash-dotted curves against nominal_pressure or normal_force.
    log : bool, optional
        Logarithmic axes. Default: each axis where its values differ by more than a factor of 30.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> ax = fc.plotting.path(pressed, "mean_gap", against="nominal_pressure")
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    nominal pressure (MPa) | mean gap (µm)
    """
    if variable is None:
        variable = _own_variables(result)
    names = (variable,) if isinstance(variable, str) else tuple(variable)
    given = () if against is None else (against,)
    data = result_of(result, (*names, *given), PATH, units)
    distinct = dict.fromkeys(data[name].attrs.get("units", "1") for name in names)
    require(len(distinct) == 1, "variable", "variables of one unit", ", ".join(distinct))
    dims, x, family = _paths.path_axis(data, against)
    values = [table(data, name, dims) for name in names]
    title = ", ".join(name_of(data[name]) for name in names)
    y = quantity(data, names[0], dims, title, np.array(values))
    panel = LinePanel(ax, data, x, y, dims, family, points=_style.MOST_DOTS)
    for name, rows, line in zip(names, values, cycle(_style.LINES), strict=False):
        title = name_of(data[name])
        panel.curves(title, rows, ls=line, ms=3.0, key=title if len(names) > 1 else "")
        if len(rows) == 1 and (ends := panel.interval(name)):
            low, high = (end[0] for end in ends)
            panel.band(f"{title}, interval", x.values[0], low, high, family.styles[0]["color"])
    if theory is not None:
        _draw_theories(panel, theory, OF_THEORY.get(names[0], names[0]), against or _paths.load_of(data))
    wide = "".join(
        axis for axis, shown in (("x", x.values), ("y", np.array(values))) if needs_log_axis(shown)
    )
    return panel.finish(log=wide if log is None else "xy" * log, title="" if theory is None else "theory")


def _own_variables(result: Any) -> list[str]:
    """Return the name of a DataArray, or the variables that a result states for its figure."""
    is_one = isinstance(result, xr.DataArray) and result.name is not None
    names = [str(result.name)] if is_one else str(result.attrs.get("path_figure", "")).split()
    variables = ", ".join(map(str, getattr(result, "data_vars", ())))
    require(bool(names), "variable", f"one of {variables}: the result has no standard figure")
    return names


@figure
def pressure_distribution(
    result: Any, *, theory: Any = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw how the nominal area is distributed over the pressures, one curve per step."""
    names = ("area_share", "maximum_pressure", "pressure_class", "nominal_pressure")
    data = result_of(result, names, ("step",), units)
    require_dims(data, {"area_share": "pressure_class"})
    require(data.sizes["pressure_class"] > 0, "result.pressure_class", "at least one entry")
    data = data.isel(step=spread_indices(data.sizes["step"], _style.MOST_CURVES))
    share = table(data, "area_share", ("step", "pressure_class"))
    greatest, nominal = (table(data, name, ("step",)) for name in names[1::2])
    classes = np.asarray(data["pressure_class"].values, dtype=np.float64)
    scale = scale_of(data["maximum_pressure"])
    x = Quantity(classes * greatest[:, None], scale, "pressure")
    per_pressure = Scale(1 / scale.factor, f"1/{scale.unit}")
    y = Quantity(share, per_pressure, "nominal area per pressure")
    spread = None
    if theory is not None:
        spread = float(result_of(theory, ("pressure_spread",), ())["pressure_spread"])
    family = _paths.by_load(data.drop_vars("normal_force", errors="ignore"))
    panel = LinePanel(ax, data, x, y, ("step", "pressure_class"), family, points=0)
    for i in np.flatnonzero(greatest > 0).tolist():
        own, pressure = family.styles[i], x.values[i]
        density = share[i] * classes.size / greatest[i]
        panel.line(family.curve("this surface", i), pressure, density, drawstyle="steps-mid", lw=1.0, **own)
        # such steps begin and end in the middle of a class: the outer halves of the first and the last
        outer = panel.x.scale([[0.0, pressure[-1]], [pressure[0], greatest[i]]])
        panel.ax.hlines(panel.y.scale(density[[0, -1]]), *outer, label="_half classes", lw=1.0, **own)
        if spread:
            beside = np.linspace(0.0, float(pressure[-1]), 400)  # below 1/72 inch each
            theirs = _persson(beside, nominal[i], spread)
            panel.line(family.curve("Persson", i), beside, theirs, **own, **_style.DASH_DOTTED)
    if spread:
        panel.key("Persson", **_style.DASH_DOTTED)
    return panel.finish(zero="xy", title="theory" if spread else "")


def _persson(pressure: Any, nominal: float, spread: float) -> Any:
    """Return the density of the pressure after Persson: zero without pressure, for there is no tension."""
    first, image = (np.exp(-0.5 * ((pressure + sign * nominal) / spread) ** 2) for sign in (-1, 1))
    return (first - image) / (spread * np.sqrt(2 * np.pi))


@figure
def area_by_resolution(
    result: Any, *, shear: float | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the real contact area of a joint against the spacing of its heights, one curve per load.

    Solid lines are the cells in contact, dashed lines the area corrected for their perimeter. The slope of a
    straight line would be 2 less the dimension by area.
    """
    names = ("contact_fraction", "corrected_contact_fraction", "resolution")
    result = result_of(result, names, ("shear", "step", "resolution"), units)
    data, dims = _paths.at_shear(result, shear), ("step", "resolution")
    spacing, loads = quantity(data, "resolution", dims[1:], "spacing"), _paths.by_load(data)
    panel = LinePanel(ax, data, spacing, "contact_fraction", dims, loads)
    panel.curves("cells", key="cells", marker="o")
    style = {"marker": "s", "ms": 3.5} | _style.DASHED
    panel.curves(CORRECTED, "corrected_contact_fraction", key=CORRECTED, **style)
    panel.ax.set_title(_paths.shear_text(data, data))
    panel.finish(log="xy")
    panel.ax.set_xticks(spacing.shown, [f"{value:g}" for value in spacing.shown])
    panel.ax.set_xticks([], minor=True)
    return panel.ax


@figure
def slip_loops(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw tangential force against displacement, and the sticking part of the contact against the force."""
    names = ("tangential_force", "tangential_displacement", "stick_area", "contact_area")
    data = result_of(result, names, PATH, units)
    force, displacement, stuck, contact = (quantity(data, name, PATH) for name in names)
    share = stuck.values / np.where(contact.values > 0, contact.values, np.nan)
    sticking = Quantity(share, PER_CENT, "part of the contact that sticks")
    shown = _style.panel_row(axes, 2)
    for ax, x, y in zip(shown, (displacement, force), (force, sticking), strict=True):
        panel = LinePanel(ax, data, x, y, PATH, _paths.by_shear(data), points=_style.MAX_MARKED_POINTS)
        panel.curves("loading path")
        panel.finish(legend=y is sticking)
    shown[1].set_ylim(0, 105)
    return shown


FIGURES = (
    StudyFigure("joint_contact_area", "joints/closure", "contact_fraction", contact_area),
    StudyFigure("contact_area", "contact", "contact_fraction", _paths.by_decades(contact_area)),
    StudyFigure("area_by_resolution", "joints/area_by_resolution", "resolution", area_by_resolution),
    StudyFigure("slip_loops", "partial_slip", "stick_area", slip_loops),
    StudyFigure("joint_slip_loops", "joints/partial_slip", "stick_area", slip_loops),
)
