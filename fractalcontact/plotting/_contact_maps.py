"""Maps of the contact state along a load or shear path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._inputs import extent_of, require_known_dims, result_of
from fractalcontact.plotting._paths import load_text, select_path, shear_text
from fractalcontact.plotting._surface import draw_outline, plane_scale
from fractalcontact.plotting._units import shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

ZOOM = 1 / 6  # edge of the magnified window over the shorter side
POINTS = 1.0  # of a screen: a map whose cells are narrower is magnified


@_style.checked
def contact_domains(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    panels: int = 6,
    zoom: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw maps of the contact state for increasing load at one shear, or increasing shear at one force.

    A further column magnifies a window, framed in the last map of each row, where the most contacts are.

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
    zoom : float, optional
        Edge (m) of the window, 0 for none. Default: a sixth of the shorter side if the cells of a map are
        narrower than a typographic point, else none; none on given `axes`.
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
        There is no state, or the result has several shears and several steps and neither is chosen.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e5, 1e6])
    >>> maps = fc.plotting.contact_domains(result)
    >>> len(maps)
    2
    """
    result = shown_in(result, units, "contact_domains")
    data = result_of(result, "contact_domains", ("state",), ("shear", "step"))
    require_known_dims(data, "contact_domains", {"state": ("shear", "step", "y", "x")})
    path, dim = select_path(data, shear, normal_force, panels, "contact_domains")
    count, columns = path.sizes[dim], _style.number_of_columns(path.sizes[dim])
    width = _style.WIDTH * columns / _style.COLUMNS
    window = _window(path["state"], zoom, axes, width / columns)
    rows = -(-count // columns)
    size = (max(width, 3.0), maps_height(path, count, width))
    zooms: Any
    if window is None:
        shown, zooms = _style.panels(axes, (rows, columns), size, count=count), []
    else:
        size = (size[0] * (columns + 1) / columns, size[1])
        grid = _style.panels(axes, (rows, columns + 1), size)
        zooms, shown = grid[:, -1], grid[:, :-1].ravel()[:count]
        for unused in grid[:, :-1].ravel()[count:]:
            unused.remove()
    sheet = _style.sheet_of(axes, shown)
    common = shear_text(path, data) if dim == "step" else load_text(path, data)
    for number, ax in enumerate(shown):
        state = path.isel({dim: number})
        name = load_text(state, data) if dim == "step" else shear_text(state, data)
        if sheet is None and common:  # no room above the panels of others
            name = f"{common},  {name}" if name else common
        _state_map(ax, state["state"], number if count > 1 else None, name)
    for row, ax in enumerate(zooms):
        last = min((row + 1) * columns, count) - 1
        _magnify(ax, shown[last], path["state"].isel({dim: last}), window, _style.letter(last))
    if "x" in path.coords:
        extent, length = extent_of(path["state"]), plane_scale(path["state"])
        _maps.scale_bar(shown[(count - 1) // columns * columns], extent, length)
    if common and sheet is not None:
        sheet.suptitle(common, x=0.01, ha="left", fontsize="medium")
    if bool((path["state"] > 1).any()):
        _maps.flag_legend(shown, sheet, ("open", "contact", "yielded"), _style.STATE_COLOURS)
    return np.concatenate([shown, zooms]) if len(zooms) else shown


def _window(state: xr.DataArray, zoom: float | None, axes: Panels | None, width: float) -> Any:
    """Return the cells (rows, columns) of the window to magnify in maps of so many inches, or None."""
    shape, extent = state.shape[-2:], extent_of(state)
    cell = (extent[1] - extent[0]) / shape[1]
    if zoom is None:
        if _style.are_given(axes):
            return None
        zoom = min(shape) * cell * ZOOM if 72 * width < POINTS * shape[1] else 0.0
    size = round(min(zoom, extent[1] - extent[0]) / cell)
    if size < 1 or size >= min(shape):
        return None
    touching = np.asarray(state.transpose(..., "y", "x").values).reshape(-1, *shape)[-1] > 0
    sums = np.pad(touching.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return slice(int(row), int(row) + size), slice(int(column), int(column) + size)


def _magnify(ax: Axes, of: Axes, plane: xr.DataArray, window: Any, letter: str) -> None:
    """Draw the window of a map on its own, and frame it in the map."""
    part = plane.transpose("y", "x")[window]
    length = plane_scale(plane)
    _maps.state(ax, np.asarray(part.values), extent_of(part), length)
    draw_outline(of, extent_of(part), length, edgecolor=_style.RED, linewidth=1.0)
    for spine in ax.spines.values():
        spine.set(color=_style.RED, linewidth=1.0)
    edge = extent_of(part)[1] - extent_of(part)[0]
    size = f",  {quantity_text(edge, 'm')} wide" if "x" in plane.coords else ""
    ax.set_title(rf"$\bf{{{letter}}}$  magnified{size}", fontsize="medium")


def _state_map(ax: Axes, plane: xr.DataArray, number: int | None, name: str) -> None:
    flags = np.asarray(plane.transpose("y", "x").values)
    _maps.state(ax, flags, extent_of(plane), plane_scale(plane))
    head = "" if number is None else rf"$\bf{{{_style.letter(number)}}}$  "
    fraction = 100 * float(np.mean(flags > 0)) if flags.size else 0.0
    percent = f"{fraction:.0f}" if fraction >= 10 else f"{fraction:.2g}"
    ax.set_title(f"{head}{name}{',  ' if name else ''}{percent} % in contact", fontsize="medium")


def maps_height(path: xr.Dataset, count: int, width: float) -> float:
    """Return the height (inches) of a figure of maps with the given width."""
    columns = _style.number_of_columns(count)
    left, right, bottom, top = extent_of(path["state"])
    shape = min(max((top - bottom) / (right - left), 0.1), 5.0)
    return 0.5 + -(-count // columns) * (shape * (width / columns - 0.15) + 0.28)
