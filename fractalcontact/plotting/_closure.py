"""Closure laws of a joint under normal load, with the empirical laws that fit them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import nearest, result_of, table
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._paths import PATH, by_shear
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Units

LAW_CONSTANTS = ("closure_length", "reference_pressure", "initial_stiffness", "greatest_closure")
LAWS = {"exponential": _style.DASHED, "hyperbolic": _style.DOTTED}  # line where not preferred


@figure
def closure_laws(
    closure: Any,
    *,
    laws: Any = None,
    shear: float | None = None,
    marked: Sequence[int] = (),
    key: bool = True,
    log: bool = False,
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw normal force against closure, one curve per shear displacement.

    Thin lines show the total closure w, thick lines the interface closure w_int = w - w_b, where w_b is the
    closure of the two bodies. With `laws` points are the interface closures against the nominal pressure, of
    the first loading and beyond; the law that they prefer is a thick line, the other a thin one.

    Parameters
    ----------
    closure : Dataset or node of a DataTree
        From `fractalcontact.joints.closure`: closure, interface_closure (m) and normal_force (N) over
        (shear, step), or over one of them.
    laws : Dataset or node of a DataTree, optional
        From `fractalcontact.joints.closure_laws` of the same closure, also with a seating pressure.
    shear : float, optional
        Shear displacement (m) of the curve with the marked points; the nearest one is taken.
    marked : sequence of int
        Steps to mark A, B, C ... on that curve.
    key : bool
        Add a legend of the shear displacements.
    log : bool
        Logarithmic axes, which show every decade of the load.
    {shared}

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
    if laws is not None:
        return _draw_laws(closure, laws, key, log, units, ax)
    data = result_of(closure, ("closure", "normal_force"), PATH, units, "closure")
    with Problems("fc.plotting") as problems:
        last = data.sizes["step"] - 1
        problems.numbers("marked", marked if len(marked) else 0, at_least=-1, at_most=last, integral=True)
    panel = LinePanel.of(ax, data, "closure", "normal_force", PATH, by_shear(data), x_name="closure")
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


def _draw_laws(closure: Any, laws: Any, key: bool, log: bool, units: Units | None, ax: Axes | None) -> Axes:
    """Draw the steps of each shear and both laws through them."""
    names = ("interface_closure", "nominal_pressure")
    data = result_of(closure, names, PATH, units, "closure")
    fitted = result_of(laws, (*LAW_CONSTANTS, "preferred_law"), ("shear",), argument="laws")
    with Problems("fc.plotting") as problems:
        count, of_laws = data.sizes["shear"], fitted.sizes["shear"]
        problems.require(of_laws == count, "laws", f"{count} shears, as of the closure", of_laws)
    panel = LinePanel.of(ax, data, *names, PATH, by_shear(data))
    points, pressure = panel.x.values, panel.y.values
    if "seated_closure" in fitted:
        points = table(fitted, "seated_closure", PATH)
    seat = float(fitted["seating_pressure"]) if "seating_pressure" in fitted else 0.0
    constants = [table(fitted, name, ("shear",)) for name in LAW_CONSTANTS]
    preferred = table(fitted, "preferred_law", ("shear",)).astype(int)
    panel.curves("steps", x=points, ls="", marker="o", ms=3.5)
    for i, own in enumerate(panel.family.styles):
        shown = pressure[i][np.isfinite(points[i]) & (pressure[i] > seat)]
        if shown.size < 2:
            continue
        p = np.geomspace(shown.min(), shown.max(), 200)
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
