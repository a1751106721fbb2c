"""A sheared joint: dilatancy, criteria and tests of strength, shear curves, friction, the effect of size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.numbers import spread_indices
from fractalcontact.base.study import end_of_first_leg
from fractalcontact.base.units import quantity_text
from fractalcontact.plotting import _paths, _style
from fractalcontact.plotting._figure import Drawing, StudyFigure, figure
from fractalcontact.plotting._inputs import nearest, quantity, require_dims, result_of, table, words
from fractalcontact.plotting._line_panel import BAND_OPACITY, Family, LinePanel, distinct, ordered
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Quantity, Units, number_texts, scale_of

# names and markers of the strengths of a test: its last one is residual only after a long path
AT_END = "at the end"
TESTS = {"peak_shear_strength": ("peak", "o"), "residual_shear_strength": (AT_END, "x")}


@figure
def strength_envelope(
    result: Any, *, tests: Any | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    r"""Draw the peak shear strength against the normal stress, one curve per criterion.

    A curve is dotted where its criterion is used out of its range.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.strength_envelope`.
    tests : Dataset or node of a DataTree, optional
        From `fractalcontact.joints.direct_shear`; its strengths, at the peak and at the end of the first
        leg, are drawn as points.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 5e-4, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> result = fc.joints.strength_envelope(
    ...     surface, nominal_pressure=[1e6, 2e6, 4e6], wall_strength=60e6, basic_friction_angle=30
    ... )
    >>> print(fc.plotting.strength_envelope(result).get_ylabel())
    shear strength $\tau$ (MPa)
    """
    names, dims = ("shear_strength", "in_range", "criterion"), ("criterion", "nominal_pressure")
    data = result_of(result, names, dims[:1], units)
    for dim in dims:
        require_dims(data, {"shear_strength": dim, "in_range": dim})
    data = data.sortby("nominal_pressure")
    pressure = quantity(data, "nominal_pressure", dims[1:])
    every = np.append(pressure.values, data["shear_strength"].values)
    strength = quantity(data, "shear_strength", dims, shown=every)
    # one unit on both axes, so that a slope can be read as a friction coefficient
    pressure = Quantity(pressure.values, strength.scale, pressure.name)
    parts = [name.split("_") for name in words(data["criterion"])]
    authors = distinct([" and ".join(part.capitalize() for part in each) for each in parts])
    panel = LinePanel(ax, data, pressure, strength, dims, authors, points=0)
    in_range = panel.values("in_range") > 0
    out = ~in_range  # with the last points in range, from which the dots begin
    out[:, 1:] |= ~in_range[:, :-1]
    out[:, :-1] |= ~in_range[:, 1:]
    panel.curves("", np.where(out, strength.values, np.nan), **_style.DOTTED)
    panel.curves("in range", np.where(in_range, strength.values, np.nan))
    if not in_range.all():
        panel.key("out of range", **_style.DOTTED)
    if tests is not None:
        tested = result_of(tests, (*TESTS, dims[1]), dims[1:], argument="tests")
        end = end_of_first_leg(tested)
        place = f" ({end})" if end else ""
        for name, (kind, marker) in TESTS.items():
            style = {"ls": "", "marker": marker, "color": _style.ink(), "zorder": 3}
            label = f"direct shear, {kind}{place if kind == AT_END else ''}"
            points = table(tested, dims[1], dims[1:]), table(tested, name, dims[1:])
            panel.line(label, *points, key=label, clip_on=False, **style)
    return panel.finish(zero="xy")


SHOWN = ("shear_stress", "dilatancy")
DIMS = ("nominal_pressure", "shear_displacement")


@figure
def shear_curve(
    result: Any, *, beside: Any | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    r"""Draw shear stress and dilatancy against shear displacement, one curve per normal stress."""
    data = [_read(each, units) for each in (result, beside) if each is not None]
    shown = _style.panel_row(axes, 2, sharex=True)
    every = {
        name: np.concatenate([np.ravel(each[name].values) for each in data])
        for name in ("nominal_pressure", "shear_displacement", *SHOWN)
    }
    pressures, places = np.unique(every["nominal_pressure"], return_inverse=True)  # NaN has a place too
    of_each = np.split(places, [data[0].sizes["nominal_pressure"]])
    stress = scale_of(data[0]["nominal_pressure"], pressures)
    family = ordered(number_texts(stress, pressures, 3), "normal stress", stress.unit)
    for ax, name in zip(shown, SHOWN, strict=True):
        x, y = (quantity(data[0], each, data[0][each].dims, shown=every[each])
                for each in ("shear_displacement", name))  # fmt: skip
        panel = LinePanel(ax, data[0], x, y, family=family, points=0)
        for each, own, style in zip(data, of_each, ({}, _style.DASHED), strict=False):
            title = str(each.attrs.get("title", name))
            for i, place in enumerate(own):
                along = each["shear_displacement"].broadcast_like(each[name])
                points = (np.atleast_1d(values[i]) for values in (along.values, each[name].values))
                panel.line(family.curve(title, place), *points, **(family.styles[place] | style))
            if beside is not None:
                panel.key(str(each.attrs.get("title", "")), **style)
        panel.finish(legend=name == SHOWN[-1])
    return shown


def _read(result: Any, units: Units | None) -> xr.Dataset:
    names = (*SHOWN, *DIMS)
    data = result_of(result, names, ("nominal_pressure",), units)
    along = (data["shear_displacement"], data["nominal_pressure"])
    data = data.assign({name: xr.broadcast(data[name], *along)[0] for name in SHOWN})
    return data.transpose("nominal_pressure", ..., missing_dims="ignore")


@figure
def friction(
    result: Any,
    *,
    direction: str | float | None = None,
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
        Direction to draw; required of several with several forces or pressures. Without those each
        direction gets a curve.
    {shared}

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
    selected = _paths.limit_shear(_paths.select_direction(result, None, units), reach)
    names = ["friction_angle", "shear_strength"] if "shear_strength" in selected else ["friction_angle"]
    by_force = "friction_angle" in selected and "step" in selected["friction_angle"].dims
    if "shear_strength" in selected and selected["shear_strength"].sizes.get("step", 1) > 1:
        by_force = True  # rigid faces: one angle, and a strength for each pressure
    over = "step" if by_force else "direction"
    if by_force or direction is not None:
        selected = _paths.select_direction(selected, direction)
    data = result_of(selected, (*names, "shear"), ("shear", over))
    size = _style.ROW if len(names) > 1 else _style.PANEL
    shown = _style.panel_row(axes, len(names), size, sharex=True)
    family, points = (_paths.by_load if by_force else _paths.by_direction)(data), _style.MAX_MARKED_POINTS
    for ax, name in zip(shown, names, strict=True):
        panel = LinePanel(ax, data, "shear", name, (over, "shear"), family, points=points)
        panel.curves(name.replace("_", " "))
        is_wide = name == "shear_strength" and _style.needs_log_axis(panel.y.values)
        if name == "friction_angle" and "basic_friction_angle" in data:
            basic_angle = float(np.ravel(data["basic_friction_angle"].values)[0])
            panel.level(basic_angle, color=_style.ink(), **_style.DOTTED)
        if name == names[-1] and "basic_friction_angle" in data:
            panel.key("basic angle", color=_style.ink(), **_style.DOTTED)
        panel.finish(log="y" if is_wide else "", legend=name == names[-1])
    remarks = []
    if by_force and "direction" in data.coords:
        remarks.append(f"block slides {_paths.direction_name(words(data['direction'])[0])}")
    if shown[0].get_ylim()[1] > 90:  # degree; the joint cannot slide at a larger friction angle
        shown[0].set_ylim(top=90)
        remarks.append("locked above 90°")
    shown[0].set_title(", ".join(remarks))
    if len(names) > 1:
        shown[1].set_title(_slope_lengths(data))
    return shown


def _slope_lengths(data: xr.Dataset) -> str:
    """Return over which lengths of shear the slopes of the dilatancy were taken; empty where not stated."""
    lengths = np.atleast_1d(data["smoothing"].values).astype(float) if "smoothing" in data else np.empty(0)
    lengths = lengths[np.isfinite(lengths)]
    ends = [quantity_text(end, "m") for end in (lengths.min(), lengths.max())] if lengths.size else []
    return "slopes over " + " to ".join(dict.fromkeys(ends)) if ends else ""


@figure
def self_weight(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the shear strength of a joint under self-weight against the size of the structure.

    One colour for each direction of sliding, one line style for each shear, of at most three. A grey line is
    the strength for the basic friction angle alone, which grows as the size. Curves are missing where the
    faces lock.
    """
    names = ("shear_strength", "structure_size", "nominal_pressure", "basic_friction_angle", "shear")
    dims = ("shear", "direction", "structure_size")
    data = result_of(result, names, dims, units)
    data = data.isel(shear=spread_indices(data.sizes["shear"], 3))
    size = quantity(data, "structure_size", ("structure_size",), "size of the structure")
    strength, shears = quantity(data, "shear_strength", dims), _paths.by_shear(data)
    directions = _paths.by_direction(data)
    coloured = replace(directions, styles=[{"color": style["color"]} for style in directions.styles])
    panel = LinePanel(ax, data, size, strength, dims[1:], coloured)
    for i, values in enumerate(strength.values):
        key = shears.labels[i] if shears.labels else ""
        panel.curves(shears.curve("shear strength", i), values, key=key, ls=_style.LINES[i])
    angle = np.radians(table(data, "basic_friction_angle", ()))
    basic = table(data, "nominal_pressure", ("structure_size",)) * np.tan(angle)
    name = "basic angle alone"
    panel.line(name, size.values, basic, key=name, color="0.6", **_style.DASH_DOTTED)
    return panel.finish(log="xy", title=shears.title)


@figure
def dilatancy(
    result: Any,
    *,
    direction: str | float | None = None,
    reach: float | None = None,
    marked: Sequence[float] = (),
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the dilatancy of a joint against shear displacement.

    Under constant normal force there is one curve per force, and a black one for rigid surfaces. Without
    forces there is one curve per direction for rigid surfaces; thin dotted lines show the rise along the
    mean plane, unless the faces are level.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy`: rigid_dilatancy (m) over (direction, shear), optionally
        mean_slope over direction; with forces dilatancy (m) over (direction, shear, step).
    direction : str or float, optional
        Direction to draw: a word or degrees anticlockwise from E. Required with forces if there are several.
    marked : sequence of float
        Shear displacements (m) to mark A, B, C ... on the curve of the last force.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> result = fc.joints.dilatancy(crack, shear=[0.0, 2e-4], direction="E", normal_force=[1.0, 10.0])
    >>> ax = fc.plotting.dilatancy(result)
    >>> print(ax.get_ylabel(), "|", len(ax.lines), "curves")
    dilatancy $\delta$ (µm) | 3 curves
    """
    data = _paths.select_direction(result, direction, units)
    data = _paths.limit_shear(data, reach)
    if "dilatancy" in data:
        return _of_elastic_bodies(data, marked, ax)
    return _of_rigid_surfaces(data, ax)


def _of_rigid_surfaces(data: Any, ax: Axes | None) -> Axes:
    dims = ("direction", "shear")
    data = result_of(data, ("rigid_dilatancy", "shear"), dims)
    panel = LinePanel(ax, data, "shear", "rigid_dilatancy", dims, _paths.by_direction(data))
    panel.curves("rigid dilatancy")
    if "mean_slope" in data:
        ends = np.array([0.0, np.nanmax(panel.x.values)])
        rise = table(data, "mean_slope", dims[:1])[:, None] * ends
        height = np.nanmax(panel.y.values, initial=0.0)
        if np.nanmax(np.abs(rise), initial=0.0) > 0.005 * height:  # less lies on the axis, of a level face
            panel.curves("mean slope", rise, ends, key="mean slope", **_style.DOTTED)
    return panel.finish()


def _of_elastic_bodies(data: Any, marked: Sequence[float], ax: Axes | None) -> Axes:
    data = result_of(data, ("dilatancy", "shear"), ("shear", "step"))
    loads, points, shear = _paths.by_load(data), _style.MAX_MARKED_POINTS, table(data, "shear", ("shear",))
    panel = LinePanel(ax, data, "shear", "dilatancy", ("step", "shear"), loads, points=points)
    panel.curves("dilatancy")
    if "rigid_dilatancy" in data:
        style = {"color": _style.ink(), "lw": _style.THIN}
        panel.line("rigid", shear, table(data, "rigid_dilatancy", ("shear",)), **style)
        rigid = "0 (rigid)" if loads.name != "step" else "rigid"  # steps are numbers, not loads
        panel.family = Family([style, *loads.styles], [rigid, *loads.labels], loads.name, loads.unit)
    if "direction" in data.coords:
        panel.ax.set_title(f"block slides {_paths.direction_name(words(data['direction'])[0])}")
    for number, target in enumerate(marked):
        index = nearest(shear, target)
        if np.isclose(shear[index], target, rtol=UNIFORM, atol=0.0):
            panel.mark(shear[[index]], panel.y.values[-1, [index]], loads.styles[-1]["color"], number)
    return panel.finish()


LENGTHS = ("decorrelation_length_low", "decorrelation_length", "decorrelation_length_high")
DIMENSIONS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


@figure
def decorrelation_length(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the correlation of the two faces of a joint against shear displacement.

    Vertical dotted lines show the decorrelation lengths, and bands their intervals.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.decorrelation_length`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=3.2e-3)
    >>> result = fc.joints.decorrelation_length(crack, direction="E")
    >>> ax = fc.plotting.decorrelation_length(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (mm) | correlation of the faces
    """
    names, dims = ("correlation", "shear", *LENGTHS), ("direction", "shear")
    data = result_of(result, names, dims, units)
    family, name = _paths.by_direction(data), "correlation of the faces"
    panel = LinePanel(ax, data, "shear", "correlation", dims, family, y_name=name, points=0)
    panel.curves("")
    ends = [table(data.isel(shear=0), name, ("direction",)) for name in LENGTHS]
    for own, low, length, high in zip(panel.family.styles, *ends, strict=True):
        if np.isfinite(length):
            panel.place(length, color=own["color"], **_style.DOTTED)
        if np.isfinite(low) and np.isfinite(high):
            panel.ax.axvspan(*panel.x.scale([low, high]), color=own["color"], alpha=BAND_OPACITY, lw=0)
    panel.level(0.0, color=_style.grey(), lw=0.6)
    panel.key("decorrelation length", **_style.DOTTED)
    return panel.finish()


@figure
def delta_dimension(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the fractal dimension of the delta-surface against shear displacement, one curve per method."""
    data = result_of(result, (*DIMENSIONS, "shear"), ("shear",), units)
    shear = quantity(data, "shear", ("shear",))
    values = quantity(data, DIMENSIONS[0], ("shear",), "dimension of the delta-surface")
    methods = distinct([name.split("_")[0] for name in DIMENSIONS], "method")
    panel = LinePanel(ax, data, shear, values, ("shear",), methods)
    for name, method, own, marker in zip(DIMENSIONS, methods.labels, methods.styles, "osD", strict=True):
        panel.line(method, shear.values, panel.values(name), marker=marker, ms=3.5, **own)
    return panel.finish(log="x" if float(data["shear"].min()) > 0 else "")


def _evenly_sampled(figure: Drawing) -> Drawing:
    """Return a drawing of the evenly sampled shears; under forces of one direction, which fits a figure."""

    def draw(data: xr.Dataset) -> Any:
        several = "step" in data.dims and data.sizes.get("direction", 1) > 1
        direction = words(data["direction"])[0] if several else None
        return figure(data, direction=direction, reach=_paths.evenly_sampled_reach(data))

    return draw


SHEAR_TEST, SHEAR_CURVE = "joints/direct_shear", "joints/shear_curve"
FIGURES = (
    StudyFigure("rigid_dilatancy", "joints/rigid_dilatancy", "rigid_dilatancy", dilatancy),
    StudyFigure("joint_dilatancy", "joints/elastic_dilatancy", "dilatancy", _evenly_sampled(dilatancy)),
    StudyFigure("friction", "joints/friction", "friction_angle", _evenly_sampled(friction)),
    StudyFigure("delta_dimension", "joints/delta_dimension", "variogram_dimension", delta_dimension),
    StudyFigure("self_weight", "joints/self_weight", "structure_size", self_weight),
    StudyFigure("decorrelation_length", "joints/decorrelation_length", "correlation", decorrelation_length),
    StudyFigure(
        "strength_envelope",
        "joints/strength_envelope",
        "shear_strength",
        strength_envelope,
        beside={"tests": SHEAR_TEST},
    ),
    # of one file: the first that the study has data for is drawn
    StudyFigure("shear_curve", SHEAR_TEST, "shear_stress", shear_curve, beside={"beside": SHEAR_CURVE}),
    StudyFigure("shear_curve", SHEAR_CURVE, "shear_stress", shear_curve),
)
