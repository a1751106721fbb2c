"""Evolution of a contact domain: the load of first contact, and births and losses of islands."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import as_dataset, quantity, require_known_dims, result_of, table
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._paths import PATH, at_shear, load_of, path_axis, shear_text
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Units, name_of


@figure
def first_contact(
    result: Any, *, shear: float | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the load at which each cell first comes into contact: the evolution along a load path in one map.

    Cells that never touch are pale. Where sets grow with load, the contact domain at a load is all cells up
    to its colour.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        Variable `state` with dims (shear, step, y, x), or without shear, and the load of each step: from
        `fractalcontact.contact.press` or `fractalcontact.joints.closure`.
    shear : float, optional
        Shear displacement (m) of the load path; the nearest one is taken. Default: the middle one.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> loads = [1e5, 1e6, 1e7]
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=loads, keep=("state",))
    >>> ax = fc.plotting.first_contact(pressed)
    >>> print(ax.figure.axes[1].get_ylabel())
    normal force $F$ of first contact (N)
    """
    data = result_of(result, "first_contact", ("state",), PATH, units)
    require_known_dims(data, "first_contact", {"state": (*PATH, "y", "x")})
    path = at_shear(data, shear)
    name = load_of(path)
    loads = table(path, name, ("step",)) if name else np.arange(path.sizes["step"], dtype=float)
    touching = path["state"].transpose("step", "y", "x").values > 0
    values = np.where(touching.any(axis=0), loads[np.argmax(touching, axis=0)], np.nan)
    coords = {dim: path[dim] for dim in ("y", "x") if dim in path.coords}
    attributes = path[name].attrs if name else {"units": "1"}
    plane = xr.DataArray(values, coords, dims=("y", "x"), name=name or "step", attrs=attributes)
    ax = _style.axes_or_new(ax, _style.MAP)
    title, log = (
        f"{name_of(plane) if name else 'step'} of first contact",
        _style.needs_log_axis(loads[loads > 0]),
    )
    pale = _style.STATE_COLOURS[0]
    _maps.draw_values(ax, plane, missing=pale, name=title, log=log, clipped=0.0, readable=True)
    ax.set_title(shear_text(path, data))
    return ax


@figure
def lineage(
    result: Any, *, against: str | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw the number of islands along a path, beside the islands that are born and those that are absorbed.

    A dotted line marks the coalescence load: from there on more islands are absorbed than born.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.evolution`: n_islands, births and absorbed (or merges) over (shear,
        step), or over one of them.
    against : str, optional
        Variable on the x axis: nominal_pressure, normal_force, closure or shear. Default: the first of the
        loads that the result has, or shear where it has a single step.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> loads = [1e5, 1e6, 1e7]
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=loads, keep=("state",))
    >>> left, right = fc.plotting.lineage(fc.domains.evolution(pressed["state"]))
    >>> print(left.get_ylabel(), "|", right.get_ylabel())
    number of islands | islands in a step
    """
    lost = "absorbed" if "absorbed" in as_dataset(result, "lineage").variables else "merges"
    data = result_of(result, "lineage", ("n_islands", "births", lost), PATH, units)
    dims, x, family = path_axis(data, against, "lineage")
    shown = _style.panel_row(axes, 2, (_style.WIDTH + 0.6, 3.1), sharex=True)
    counts = quantity(data, "n_islands", dims, "number of islands")
    births, losses = quantity(data, "births", dims, "islands in a step"), table(data, lost, dims)
    left, right = (LinePanel(ax, x, y, family, points=_style.MAX_MARKED_POINTS)
                   for ax, y in zip(shown, (counts, births), strict=True))  # fmt: skip
    left.curves("islands", x.values, counts.values)
    right.curves("births", x.values, births.values, key="births")
    right.curves(lost, x.values, losses, key=lost, **_style.DASHED)
    coalesces = losses > births.values
    for i in np.flatnonzero(coalesces.any(axis=1)).tolist():
        right.place(x.values[i, np.argmax(coalesces[i])], color=family.styles[i]["color"], **_style.DOTTED)
    if coalesces.any():
        right.key("coalescence", **_style.DOTTED)
    log = "x" if _style.needs_log_axis(x.values) else ""
    left.finish(log=log, zero="y", legend=False)
    right.finish(log=log, zero="y")
    return shown
