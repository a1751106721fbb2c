"""Mean gap, stiffness and distribution of pressures of a contact, with theories beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.units import Scale
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._closure import draw_theories
from fractalcontact.plotting._inputs import as_dataset, require_dims, result_of, table
from fractalcontact.plotting._paths import curve_name, load_words, loads_of, shear_words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

STIFFNESSES = ("contact_stiffness", "stiffness", "interface_stiffness")
PER_LENGTH = Scale(1e9, "MPa/mm")
THEORY: dict[str, Any] = {"ls": "-.", "lw": 1.0}
MOST_STEPS = 6  # of the distributions in one figure


@_style.checked
def mean_gap(
    result: Any,
    *,
    against: str = "nominal_pressure",
    theory: Any = None,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the mean gap between two surfaces, one curve per shear displacement.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.contact.press` or `fractalcontact.joints.closure`: mean_gap (m) over (shear,
        step), or over one of them.
    against : str
        Variable on the x axis: nominal_pressure, normal_force or closure.
    theory : Dataset, optional
        From `fractalcontact.contact.theories`: dash-dotted curves against nominal_pressure or normal_force.
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
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> ax = fc.plotting.mean_gap(pressed)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    nominal pressure (MPa) | mean gap (µm)
    """
    result = shown_in(result, units, "mean_gap")
    return _draw("mean_gap", result, "mean_gap", against, theory, ax)


@_style.checked
def stiffness(
    result: Any,
    *,
    against: str = "nominal_pressure",
    theory: Any = None,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the normal stiffness per nominal area, one curve per shear displacement.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        With contact_stiffness (from `fractalcontact.contact.press`, ``also="stiffness"``), stiffness (from
        `fractalcontact.joints.closure_laws`) or interface_stiffness (Pa m-1) over (shear, step), or over one
        of them.
    against : str
        Variable on the x axis: nominal_pressure, normal_force or closure.
    theory : Dataset, optional
        From `fractalcontact.contact.theories`: dash-dotted curves against nominal_pressure or normal_force.
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
    >>> surface = fc.surfaces.spectral((32, 32), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)
    >>> loads = {"contact_modulus": 1e9, "nominal_pressure": [1e6, 1e7]}
    >>> pressed = fc.contact.press(surface, also="stiffness", **loads)
    >>> theory = fc.contact.theories(surface, **loads)
    >>> print(fc.plotting.stiffness(pressed, theory=theory).get_ylabel())
    normal stiffness (MPa/mm)
    """
    result = shown_in(result, units, "stiffness")
    data = as_dataset(result, "stiffness")
    name = next((name for name in STIFFNESSES if name in data.variables), None)
    with Problems("fc.plotting.stiffness") as problems:
        problems.require(name is not None, "result", f"one of {', '.join(STIFFNESSES)}", NONE)
    assert name is not None
    return _draw("stiffness", data, name, against, theory, ax)


@_style.checked
def pressure_distribution(
    result: Any, *, theory: Any = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw how the nominal area is distributed over the pressures, one curve per step.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.contact.press` with ``also="pressure_distribution"``.
    theory : Dataset, optional
        From `fractalcontact.contact.theories`: dash-dotted curves of Persson (2001), a Gaussian about the
        nominal pressure less that about its negative.
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
    >>> surface = fc.surfaces.spectral((32, 32), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)
    >>> loads = {"contact_modulus": 1e9, "nominal_pressure": [1e7, 4e7]}
    >>> pressed = fc.contact.press(surface, also="pressure_distribution", **loads)
    >>> ax = fc.plotting.pressure_distribution(pressed)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    pressure (MPa) | nominal area per pressure (1/MPa)
    """
    result = shown_in(result, units, "pressure_distribution")
    ax = _style.axes_or_new(ax)
    names = ("area_share", "maximum_pressure", "pressure_class", "nominal_pressure")
    data = result_of(result, "pressure_distribution", names, ("step",))
    require_dims(data, "pressure_distribution", {"area_share": "pressure_class"})
    with Problems("fc.plotting.pressure_distribution") as problems:
        count = data.sizes["pressure_class"]
        problems.require(count > 0, "result.pressure_class", "at least one entry", NONE)
    data = data.isel(step=_style.spread_indices(data.sizes["step"], MOST_STEPS))
    share = table(data, "area_share", ("step", "pressure_class"))
    greatest = table(data, "maximum_pressure", ("step",))
    nominal = table(data, "nominal_pressure", ("step",))
    classes = np.asarray(data["pressure_class"].values, dtype=np.float64)
    scale = scale_of(data["maximum_pressure"])
    spread = None
    if theory is not None:
        spread = float(
            result_of(theory, "pressure_distribution", ("pressure_spread",), ())["pressure_spread"]
        )
    colours = _style.sequence_colours(len(share))
    words = load_words(data.drop_vars("normal_force", errors="ignore"))
    for i, colour in enumerate(colours):
        if not greatest[i] > 0:
            continue
        pressure, width = scale(classes * greatest[i]), float(scale(greatest[i])) / classes.size
        name = curve_name("this surface", words, i)
        ax.step(pressure, share[i] / width, where="mid", color=colour, lw=1.0, label=name)
        if spread:
            beside = np.linspace(0.0, float(pressure[-1]), 400)
            density = _persson(beside, float(scale(nominal[i])), float(scale(spread)))
            ax.plot(beside, density, color=colour, label=curve_name("Persson", words, i), **THEORY)
    label_axis(ax.xaxis, "pressure", scale)
    label_axis(ax.yaxis, "nominal area per pressure", Scale(1 / scale.factor, f"1/{scale.unit}"))
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    _style.sequence_legend(ax, *words, colours)
    if spread:
        _style.side_legend(ax, [_style.legend_line("Persson", **THEORY)], title="theory", low=True)
    return ax


def _persson(pressure: Any, nominal: float, spread: float) -> Any:
    """Return the density of the pressure after Persson: zero without pressure, for there is no tension."""
    first, image = (np.exp(-0.5 * ((pressure + sign * nominal) / spread) ** 2) for sign in (-1, 1))
    return (first - image) / (spread * np.sqrt(2 * np.pi))


def _draw(where: str, result: Any, name: str, against: str, theory: Any, ax: Axes | None) -> Axes:
    """Draw a variable of every step against its load, on logarithmic axes."""
    ax = _style.axes_or_new(ax)
    data = result_of(result, where, (name, against), ("shear", "step"))
    loads, values = loads_of(data, against, where), table(data, name, ("shear", "step"))
    scale = scale_of(data[against])
    up = PER_LENGTH if name in STIFFNESSES else scale_of(data[name])
    colours, shears = _style.sequence_colours(len(loads)), shear_words(data)
    for i, colour in enumerate(colours):
        marker: dict[str, Any] = {"marker": "o", "ms": 3.0} if np.isfinite(values[i]).sum() <= 30 else {}
        ax.plot(
            scale(loads[i]),
            up(values[i]),
            color=colour,
            label=curve_name("this surface", shears, i),
            **marker,
        )
    _style.log_scale(ax, x=loads, y=values)
    entries = []
    if theory is not None:
        beside = "interface_stiffness" if name in STIFFNESSES else name
        entries = draw_theories(ax, theory, where, beside, against, scale, up)
    _style.plain_ticks(ax)
    label_axis(ax.xaxis, name_of(data[against]), scale)
    label_axis(ax.yaxis, "normal stiffness" if name in STIFFNESSES else name_of(data[name]), up)
    _style.sequence_legend(ax, *shears, colours)
    _style.side_legend(ax, entries, title="theory", low=True)
    return ax
