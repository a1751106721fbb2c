"""Maps of the contact state along a load or shear path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._inputs import extent_of, result_of
from fractalcontact.plotting._paths import load_text, select_path, shear_text
from fractalcontact.plotting._surface import plane_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COLUMNS = 3


@_style.styled
def contact_domains(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    panels: int = 6,
    figure: Figure | SubFigure | None = None,
) -> Figure:
    """Draw maps of the contact state for increasing load at one shear, or increasing shear at one force.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        Variable `state` with dims (shear, step, y, x), or without shear or step.
    shear : float, optional
        Shear displacement (m) whose load path is shown; the nearest one is taken.
    normal_force : float, optional
        Normal force (N) at which the shear path is shown; the nearest step is taken.
    panels : int
        Largest number of maps. Along a load path they are spread evenly over the closure.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no state, or the result has several shears and several steps and neither is chosen.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e5, 1e6])
    >>> figure = fc.plotting.contact_domains(result)
    >>> len(figure.axes)
    2
    """
    data = result_of(result, "contact_domains", ("state",), ("shear", "step"))
    path, dim = select_path(data, shear, normal_force, panels, "contact_domains")
    count, columns = path.sizes[dim], number_of_columns(path.sizes[dim])
    width = _style.WIDTH * columns / COLUMNS
    sheet = _style.figure_or_new(figure, (max(width, 3.0), maps_height(path, count, width)))
    axes = sheet.subplots(-(-count // columns), columns, squeeze=False).ravel()
    names = [_map_name(path.isel({dim: number}), data, dim) for number in range(count)]
    for number, ax in enumerate(axes):
        if number >= count:
            ax.set_axis_off()
            continue
        _state_map(ax, path["state"].isel({dim: number}), number if count > 1 else None, names[number])
    if "x" in path.coords:
        extent, length = extent_of(path["state"]), plane_scale(path["state"])
        _maps.scale_bar(axes[(count - 1) // columns * columns], extent, length)
    common = shear_text(path, data) if dim == "step" else load_text(path, data)
    if common:
        sheet.suptitle(common, x=0.01, ha="left", fontsize=9)
    if bool((path["state"] > 1).any()):
        _state_legend(sheet)
    return _style.root_figure(sheet)


def _state_map(ax: Axes, plane: xr.DataArray, number: int | None, name: str) -> None:
    flags = np.asarray(plane.transpose("y", "x").values)
    _maps.state(ax, flags, extent_of(plane), plane_scale(plane))
    _maps.bare_frame(ax)
    head = "" if number is None else rf"$\bf{{{_style.letter(number)}}}$  "
    fraction = 100 * float(np.mean(flags > 0)) if flags.size else 0.0
    percent = f"{fraction:.0f}" if fraction >= 10 else f"{fraction:.2g}"
    ax.set_title(f"{head}{name}{',  ' if name else ''}{percent} % in contact", fontsize=8.5)


def _map_name(state: xr.Dataset, data: xr.Dataset, dim: str) -> str:
    """Return the load or the shear of one map."""
    return load_text(state, data) if dim == "step" else shear_text(state, data)


def number_of_columns(count: int) -> int:
    """Return the number of columns for a number of maps."""
    return 2 if count == 4 else min(count, COLUMNS)


def maps_height(path: xr.Dataset, count: int, width: float) -> float:
    """Return the height (inches) of a figure of maps with the given width."""
    columns = number_of_columns(count)
    left, right, bottom, top = extent_of(path["state"])
    shape = min(max((top - bottom) / (right - left), 0.1), 5.0)
    return 0.5 + -(-count // columns) * (shape * (width / columns - 0.15) + 0.28)


def _state_legend(sheet: Any) -> None:
    from matplotlib.patches import Patch

    entries = [
        Patch(facecolor=colour, edgecolor=_style.GREY, linewidth=0.4, label=word)
        for colour, word in zip(_style.STATE_COLOURS, ("open", "contact", "yielded"), strict=True)
    ]
    sheet.legend(handles=entries, loc="outside lower left", ncols=3)
