"""Maps of stick and slip along a path of tangential force, and its loops of force and displacement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._contact_maps import maps_height
from fractalcontact.plotting._inputs import extent_of, require_known_dims, result_of, table
from fractalcontact.plotting._paths import curve_name, shear_words
from fractalcontact.plotting._surface import plane_scale
from fractalcontact.plotting._units import PER_CENT, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

STATES = ("open", "stick", "slip")


@_style.checked
def slip_domains(
    result: Any,
    *,
    panels: int = 6,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw maps of stick, slip and open along a path of tangential force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.contact.partial_slip`: variable `slip_state` with dims (step, y, x), or without
        step.
    panels : int
        Largest number of maps, spread evenly over the steps.
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
        There is no slip state, or it has another dim than step longer than one.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.partial_slip(
    ...     surface,
    ...     contact_modulus=1e9,
    ...     poisson=0.2,
    ...     friction_coefficient=0.5,
    ...     normal_force=10.0,
    ...     tangential_force=[1.0, 3.0, -3.0],
    ... )
    >>> maps = fc.plotting.slip_domains(result)
    >>> len(maps)
    3
    """
    result = shown_in(result, units, "slip_domains")
    data = result_of(result, "slip_domains", ("slip_state",), ("step",))
    require_known_dims(data, "slip_domains", {"slip_state": ("step", "y", "x")})
    path = data.isel(step=_style.spread_indices(data.sizes["step"], panels))
    count, columns = path.sizes["step"], _style.number_of_columns(path.sizes["step"])
    width = _style.WIDTH * columns / _style.COLUMNS
    height = maps_height(path.rename(slip_state="state"), count, width) + 0.25
    shown = _style.panels(axes, (-(-count // columns), columns), (max(width, 3.0), height), count=count)
    for number, ax in enumerate(shown):
        step = path.isel(step=number)
        plane = step["slip_state"].transpose("y", "x")
        _maps.state(ax, plane.values, extent_of(plane), plane_scale(plane), _style.SLIP_COLOURS)
        head = rf"$\bf{{{_style.letter(number)}}}$  " if count > 1 else ""
        ax.set_title(head + ",  ".join(_title_parts(step, data)), fontsize="medium")
    if "x" in path.coords:
        extent, length = extent_of(path["slip_state"]), plane_scale(path["slip_state"])
        _maps.scale_bar(shown[(count - 1) // columns * columns], extent, length)
    _maps.flag_legend(shown, _style.sheet_of(axes, shown), STATES, _style.SLIP_COLOURS)
    return shown


@_style.checked
def slip_loops(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw tangential force against displacement, and the part of the contact that sticks against the force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.contact.partial_slip` or `fractalcontact.joints.partial_slip`, over step or
        (shear, step).
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
        A variable is missing, or the result has another dim longer than one.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.partial_slip(
    ...     surface,
    ...     contact_modulus=1e9,
    ...     poisson=0.2,
    ...     friction_coefficient=0.5,
    ...     normal_force=10.0,
    ...     tangential_force=[0.0, 3.0, -3.0, 3.0],
    ... )
    >>> print(fc.plotting.slip_loops(result)[0].get_ylabel())
    tangential force $Q$ (N)
    """
    result = shown_in(result, units, "slip_loops")
    needed = ("tangential_force", "tangential_displacement", "stick_area", "contact_area")
    data = result_of(result, "slip_loops", needed, ("shear", "step"))
    force = table(data, "tangential_force", ("shear", "step"))
    displacement = table(data, "tangential_displacement", ("shear", "step"))
    stuck = table(data, "stick_area", ("shear", "step"))
    contact = table(data, "contact_area", ("shear", "step"))
    left, right = shown = _style.panel_row(axes, 2, (_style.WIDTH, 3.1))
    along, up = scale_of(data["tangential_displacement"]), scale_of(data["tangential_force"])
    colours = _style.sequence_colours(len(displacement))
    marker = "o" if displacement.shape[1] <= _style.MAX_MARKED_POINTS else ""
    shears = shear_words(data)
    for row, colour in enumerate(colours):
        name = curve_name("loading path", shears, row)
        line: dict[str, Any] = {"color": colour, "marker": marker, "label": name}
        left.plot(along(displacement[row]), up(force[row]), **line)
        share = stuck[row] / np.where(contact[row] > 0, contact[row], np.nan)
        right.plot(up(force[row]), PER_CENT(share), **line)
    label_axis(left.xaxis, name_of(data["tangential_displacement"]), along)
    label_axis(left.yaxis, name_of(data["tangential_force"]), up)
    label_axis(right.xaxis, name_of(data["tangential_force"]), up)
    label_axis(right.yaxis, "part of the contact that sticks", PER_CENT)
    right.set_ylim(0, 105)
    _style.sequence_legend(right, *shears, colours)
    return shown


def _title_parts(step: xr.Dataset, data: xr.Dataset) -> list[str]:
    """Return the tangential force and the share of the contact that sticks."""
    parts = []
    if "tangential_force" in data.variables:
        scale = scale_of(data["tangential_force"])
        number = f"{float(scale(step['tangential_force'].values)):.3g}".replace("-", "\N{MINUS SIGN}")
        parts.append(f"$Q$ = {number} {scale.unit}")
    flags = step["slip_state"].values
    contact = int(np.count_nonzero(flags > 0))
    if contact:
        share = 100 * np.count_nonzero(flags == 1) / contact
        parts.append(f"{share:.0f} % sticks" if share >= 10 else f"{share:.2g} % sticks")
    else:
        parts.append("no contact")
    return parts
