"""Closure of a joint under normal load: closure laws and real contact area."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import nearest, result_of, table, words
from fractalcontact.plotting._paths import curve_name, loads_of, shear_words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.base.units import Scale
    from fractalcontact.plotting._units import Units

RAW_LINE: dict[str, Any] = {"lw": 0.9, "ls": (0, (4, 2))}
LETTER, LETTER_NAME = 14.0, "letter of a marked point"  # points, diameter of the circle
LAW_CONSTANTS = ("closure_length", "reference_pressure", "initial_stiffness", "greatest_closure")
LAWS = ("exponential", "hyperbolic")
LAW_LINES: tuple[Any, ...] = ((0, (4, 2)), (0, (1, 1.5)))  # exponential, hyperbolic
TOTAL_LINE: dict[str, Any] = {"lw": 0.8, "alpha": 0.75}


@_style.checked
def closure_laws(
    closure: Any,
    *,
    shear: float | None = None,
    marked: Sequence[int] = (),
    key: bool = True,
    log: bool = False,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw normal force against closure, one curve per shear displacement.

    Thin lines show the total closure w, thick lines the interface closure w_int = w - w_b, where w_b is the
    closure of the two bodies.

    Parameters
    ----------
    closure : Dataset or node of a DataTree
        From `fractalcontact.joints.closure`: closure, interface_closure (m) and normal_force (N) over
        (shear, step), or over one of them.
    shear : float, optional
        Shear displacement (m) of the curve with the marked points; the nearest one is taken.
    marked : sequence of int
        Steps to mark A, B, C ... on that curve.
    key : bool
        Add a legend of the shear displacements.
    log : bool
        Logarithmic axes, which show every decade of the load.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> result = fc.joints.closure(crack, shear=2e-4, direction="E", normal_force=[1.0, 10.0])
    >>> ax = fc.plotting.closure_laws(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    closure (µm) | normal force $F$ (N)
    """
    closure = shown_in(closure, units, "closure_laws")
    ax = _style.axes_or_new(ax)
    data = result_of(closure, "closure_laws", ("closure", "normal_force"), ("shear", "step"), "closure")
    inner_name = "interface_closure" if "interface_closure" in data else "closure"
    force = table(data, "normal_force", ("shear", "step"))
    total = table(data, "closure", ("shear", "step"))
    inner = table(data, inner_name, ("shear", "step"))
    length, newton = scale_of(data["closure"]), scale_of(data["normal_force"])
    colours, shears = _style.sequence_colours(len(force)), shear_words(data)
    dot = "o" if force.shape[1] == 1 else ""
    for i, colour in enumerate(colours):
        if inner_name != "closure":
            name = curve_name("total closure", shears, i)
            ax.plot(length(total[i]), newton(force[i]), color=colour, marker=dot, label=name, **TOTAL_LINE)
        name = curve_name(inner_name.replace("_", " "), shears, i)
        ax.plot(length(inner[i]), newton(force[i]), color=colour, marker=dot, label=name)
    with Problems("fc.plotting.closure_laws") as problems:
        last = force.shape[1] - 1
        problems.numbers("marked", marked if len(marked) else 0, at_least=-1, at_most=last, integral=True)
    _set_scales(ax, length(total), newton(force), log=log)
    if len(marked) and len(force):
        row = 0 if shear is None or len(force) == 1 else nearest(data["shear"], shear)
        steps = [int(step) for step in marked]
        mark_points(ax, length(inner[row, steps]), newton(force[row, steps]), colours[row])
    label_axis(ax.xaxis, "closure", length)
    label_axis(ax.yaxis, name_of(data["normal_force"]), newton)
    if key:
        _style.sequence_legend(ax, *shears, colours)
    if inner_name != "closure":
        _style.side_legend(
            ax,
            [
                _style.legend_line(r"interface, $w_\mathrm{int}$"),
                _style.legend_line("total, $w$", **TOTAL_LINE),
            ],
            title="closure",
            low=True,
        )
    return ax


@_style.checked
def closure_fits(closure: Any, laws: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the closure against the nominal pressure with both closure laws, one colour per shear.

    Points are the steps of the first loading and beyond; the law that they prefer is a thick line, and laws
    that are not preferred are thin ones, dashed for the exponential, dotted for the hyperbola.

    Parameters
    ----------
    closure : Dataset or node of a DataTree
        From `fractalcontact.joints.closure`: interface_closure (m) and nominal_pressure (Pa) over (shear,
        step), or over one of them.
    laws : Dataset or node of a DataTree
        From `fractalcontact.joints.closure_laws` of the same closure, also with a seating pressure.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or a result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> pressure = [1e6, 2e6, 4e6, 8e6, 1.6e7, 3.2e7]
    >>> closure = fc.joints.closure(crack, shear=[2e-4, 4e-4], nominal_pressure=pressure)
    >>> laws = fc.joints.closure_laws(closure, seating_pressure=1e6)
    >>> ax = fc.plotting.closure_fits(closure, laws)
    >>> ax.get_xlabel(), len(ax.lines)  # for each shear the steps and two laws
    ('nominal pressure (MPa)', 6)
    """
    closure = shown_in(closure, units, "closure_fits")
    ax = _style.axes_or_new(ax)
    names = ("interface_closure", "nominal_pressure")
    data = result_of(closure, "closure_fits", names, ("shear", "step"), "closure")
    fitted = result_of(laws, "closure_fits", (*LAW_CONSTANTS, "preferred_law"), ("shear",), "laws")
    pressure, points = (table(data, name, ("shear", "step")) for name in names[::-1])
    with Problems("fc.plotting.closure_fits") as problems:
        same = fitted.sizes["shear"] == len(points)
        problems.require(same, "laws", f"{len(points)} shears, as of the closure", fitted.sizes["shear"])
    seat = float(fitted["seating_pressure"]) if "seating_pressure" in fitted else 0.0
    if "seated_closure" in fitted:
        points = table(fitted, "seated_closure", ("shear", "step"))
    constants = {name: table(fitted, name, ("shear",)) for name in LAW_CONSTANTS}
    preferred = table(fitted, "preferred_law", ("shear",)).astype(int)
    along, up = scale_of(data["nominal_pressure"]), scale_of(data["interface_closure"])
    colours, shears = _style.sequence_colours(len(points)), shear_words(data)
    for i, colour in enumerate(colours):
        steps = curve_name("steps", shears, i)
        ax.plot(along(pressure[i]), up(points[i]), "o", color=colour, ms=3.5, label=steps)
        shown = pressure[i][np.isfinite(points[i]) & (pressure[i] > seat)]
        if shown.size < 2:
            continue
        p = np.geomspace(shown.min(), shown.max(), 200)
        law = {name: values[i] for name, values in constants.items()}
        with np.errstate(all="ignore"):  # constants of faces that close by rounding alone
            curves = (_exponential(p, law), _hyperbola(p - seat, law))
        for number, (style, curve) in enumerate(zip(LAW_LINES, curves, strict=True), 1):
            line = {"lw": 1.8} if number == preferred[i] else {"lw": 0.9, "ls": style}
            name = curve_name(f"{LAWS[number - 1]} law", shears, i)
            ax.plot(along(p), up(curve), color=colour, label=name, **line)
    _style.log_scale(ax, x=pressure)
    _style.plain_ticks(ax)
    label_axis(ax.xaxis, name_of(data["nominal_pressure"]), along)
    label_axis(ax.yaxis, name_of(data["interface_closure"]), up)
    _style.sequence_legend(ax, *shears, colours)
    entries = [_style.legend_line(f"{name},\nnot preferred", lw=0.9, ls=style)
               for name, style in zip(LAWS, LAW_LINES, strict=True)]  # fmt: skip
    _style.side_legend(ax, [_style.legend_line("preferred", lw=1.8), *entries], title="law", low=True)
    return ax


def _exponential(pressure: Any, law: Mapping[str, float]) -> Any:
    return law["closure_length"] * np.log(pressure / law["reference_pressure"])


def _hyperbola(pressure: Any, law: Mapping[str, float]) -> Any:
    return pressure / (law["initial_stiffness"] + pressure / law["greatest_closure"])


@_style.checked
def contact_area(
    result: Any,
    *,
    against: str = "normal_force",
    theory: Any = None,
    log: bool = False,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the real contact area as a fraction of the nominal area, one curve per shear displacement.

    Solid lines show the area corrected for the perimeter, thin dashed lines the count of cells in contact,
    which is too high because a cell that is partly in contact counts fully.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.closure` or `fractalcontact.contact.press`: contact_fraction,
        corrected_contact_fraction and normal_force (N) over (shear, step), or over one of them.
    against : str
        Variable on the x axis: normal_force, nominal_pressure or closure.
    theory : Dataset, optional
        From `fractalcontact.contact.theories`: dash-dotted curves against normal_force or nominal_pressure.
    log : bool
        Logarithmic axes, which show every decade of the load; a dotted line is proportional to the load.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    References
    ----------
    Yastrebov, Anciaux and Molinari (2017), Journal of the Mechanics and Physics of Solids 107 (correction).

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> ax = fc.plotting.contact_area(result, against="nominal_pressure")
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    nominal pressure (MPa) | real / nominal contact area (%)
    """
    result = shown_in(result, units, "contact_area")
    ax = _style.axes_or_new(ax)
    data = result_of(result, "contact_area", ("contact_fraction", against), ("shear", "step"))
    loads = loads_of(data, against, "contact_area")
    raw = table(data, "contact_fraction", ("shear", "step"))
    scale, percent = scale_of(data[against]), scale_of(data["contact_fraction"])
    corrected = "corrected_contact_fraction" in data
    fraction = table(data, "corrected_contact_fraction", ("shear", "step")) if corrected else raw
    colours, shears = _style.sequence_colours(len(loads)), shear_words(data)
    dot = "o" if loads.shape[1] == 1 else ""
    for i, colour in enumerate(colours):
        if corrected:
            name = curve_name("cell count", shears, i)
            ax.plot(scale(loads[i]), percent(raw[i]), color=colour, marker=dot, label=name, **RAW_LINE)
        name = curve_name("corrected for the perimeter" if corrected else "cell count", shears, i)
        ax.plot(scale(loads[i]), percent(fraction[i]), color=colour, marker=dot, label=name)
    label_axis(ax.xaxis, name_of(data[against]), scale)
    label_axis(ax.yaxis, "real / nominal contact area", percent)
    entries: list[Any] = []
    if theory is not None:
        entries += draw_theories(ax, theory, "contact_area", "contact_fraction", against, scale, percent)
    _set_scales(ax, scale(loads), percent(raw), log=log)
    if log and against != "closure":
        entries += _proportional_line(ax, scale(loads), percent(raw))
    _style.sequence_legend(ax, *shears, colours)
    if corrected:
        lines = [
            _style.legend_line("corrected for\nthe perimeter"),
            _style.legend_line("cell count", **RAW_LINE),
        ]
        entries = lines + entries
    if entries:
        _style.side_legend(ax, entries, title="contact area", low=True)
    return ax


def draw_theories(
    ax: Axes, theory: Any, where: str, name: str, against: str, scale: Scale, up: Scale
) -> list[Any]:
    """Draw a variable of each theory that gives one; return the entries of the legend."""
    data = result_of(theory, where, (name, "theory", against), ("theory", "step"), "theory")
    loads, values = table(data, against, ("step",)), table(data, name, ("theory", "step"))
    entries = []
    colours = _style.cycle()
    for i, word in enumerate(words(data["theory"])):
        if not np.isfinite(values[i]).any():
            continue
        style: dict[str, Any] = {"ls": "-.", "lw": 1.0, "color": colours[(i + 1) % len(colours)]}
        authors = ",\n".join(part.capitalize() for part in word.split("_"))
        ax.plot(scale(loads), up(values[i]), label=authors, **style)
        entries.append(_style.legend_line(authors, **style))
    return entries


def mark_points(ax: Axes, x: Any, y: Any, colour: Any, first: int = 0) -> None:
    """Mark points of a curve with circled letters, beginning with letter number `first`.

    A letter is centred on its point, so that none covers another curve, or above it where another letter is.
    """
    ax.plot(x, y, "o", color=colour, ms=3, zorder=4, clip_on=False)
    to_points = ax.transData + ax.figure.dpi_scale_trans.inverted()
    placed = [tuple(np.array(text.xyann) + 72 * to_points.transform(text.xy)) for text in _letters(ax)]
    for number, (a, b) in enumerate(zip(x, y, strict=True), first):
        if not (np.isfinite(a) and np.isfinite(b)):
            continue
        point, lift = 72 * to_points.transform((a, b)), 0.0
        while any(math.hypot(point[0] - x0, point[1] + lift - y0) < LETTER for x0, y0 in placed):
            lift += LETTER
        placed.append((point[0], point[1] + lift))
        circle = {"boxstyle": "circle,pad=0.25", "fc": ax.get_facecolor(), "ec": colour, "lw": 1.2}
        leader = {"arrowstyle": "-", "color": colour} if lift else None
        text = ax.annotate(_style.letter(number), (a, b), (0.0, lift), textcoords="offset points",
                           size=LETTER / 2, weight="bold", ha="center", va="center_baseline", zorder=5,
                           annotation_clip=False, bbox=circle, arrowprops=leader)  # fmt: skip
        text.set_gid(LETTER_NAME)
        text.set_in_layout(False)


def _letters(ax: Axes) -> list[Any]:
    """Return the letters that are marked on Axes."""
    return [text for text in ax.texts if text.get_gid() == LETTER_NAME]


def _proportional_line(ax: Axes, x: Any, y: Any) -> list[Any]:
    """Draw the line of proportional growth through the middle of the curves; return its legend entry."""
    used = (x > 0) & (y > 0)
    if not used.any():
        return []
    slope = np.exp(np.median(np.log(y[used] / x[used])))
    ends = np.array([x[used].min(), min(x[used].max(), y[used].max() / slope)])  # within the curves
    style: dict[str, Any] = {"ls": ":", "lw": 1.0, "color": _style.grey()}
    name = "proportional\nto the load"
    ax.plot(ends, ends * slope, label=name, **style)
    return [_style.legend_line(name, **style)]


def _set_scales(ax: Axes, x: Any, y: Any, *, log: bool) -> None:
    """Make both axes logarithmic, or start them at zero."""
    if log:
        _style.log_scale(ax, x=x, y=y)
        _style.plain_ticks(ax)
    else:
        _start_at_zero(ax, x, y)


def _start_at_zero(ax: Axes, x: Any, y: Any) -> None:
    """Start an axis at zero if all its values are non-negative and one is positive."""
    for values, axis in ((x, "x"), (y, "y")):
        shown = np.asarray(values, dtype=float)
        shown = shown[np.isfinite(shown)]
        if shown.size and shown.min() >= 0 and shown.max() > 0:
            ax.set_xlim(left=0) if axis == "x" else ax.set_ylim(bottom=0)
