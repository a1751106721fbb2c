"""Maps: of a surface, of any field, of the contact along a path, and of the load of first contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _maps, _paths, _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import as_dataset, extent_of, require_known_dims, result_of, table
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Units, name_of

MAPS = 6  # of contact domains in a figure: two rows of three, each map 2.3 inches wide


@figure
def contact_domains(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    panels: int = MAPS,
    zoom: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw maps of the contact state, or of stick and slip, along a path of load or of shear.

    A further column magnifies a window, framed in the last map of each row, where the most contacts are.
    """
    names = as_dataset(result).variables
    name = "slip_state" if "slip_state" in names else "state"
    data = result_of(result, (name,), _paths.PATH, units)
    require_known_dims(data, {name: (*_paths.PATH, "y", "x")})
    path = _paths.select_path(data, shear, normal_force, panels)
    state = path.states[name].transpose(path.dim, "y", "x")
    count, columns = len(state), _style.number_of_columns(len(state))
    width = _style.WIDTH * columns / _style.COLUMNS
    window = _window(state, zoom, axes, width / columns)
    rows = -(-count // columns)
    has_legend = name == "slip_state" or bool((state > 1).any())
    left, right, bottom, top = extent_of(state)
    ratio = min(max((top - bottom) / (right - left), 0.1), 5.0)  # narrower maps would have no room for words
    height = 0.5 + rows * (ratio * (width / columns - 0.15) + 0.28) + 0.25 * has_legend
    size = (max(width, 3.0), height)
    shape = (rows, columns)
    if window is not None:
        size, shape = (size[0] * (columns + 1) / columns, height), (rows, columns + 1)
    elif _style.are_given(axes):
        shape = (1, count)
    grid = _style.panels(axes, shape, size)
    maps, zooms = (part.ravel() for part in np.split(grid, [shape[1] - (window is not None)], axis=1))
    for unused in maps[count:]:
        unused.remove()
    shown = maps[:count]
    sheet: Any = None if _style.are_given(axes) else shown[0].get_figure()
    head = [path.common] if sheet is None else []  # no room above the panels of others
    # of the 2.3 inches of a map in a row a load and a share of contact take 1.9 in small letters
    fontsize = "medium" if grid.shape[1] == 1 else "small"
    for number, ax in enumerate(shown):
        _maps.draw_flags(ax, state[number])
        letter = rf"$\bf{{{_style.letter(number)}}}$  " if count > 1 else ""
        parts = filter(None, (*head, path.text(number), _share_text(state[number])))
        ax.set_title(letter + ",  ".join(parts), fontsize=fontsize)
    for row, ax in enumerate(zooms):
        last = min((row + 1) * columns, count) - 1
        _magnify(ax, shown[last], state[last], window, _style.letter(last))
    if "x" in state.coords:
        _maps.draw_scale_bar(shown[(count - 1) // columns * columns], state)
    if path.common and sheet is not None:
        sheet.suptitle(path.common, x=0.01, ha="left", fontsize="medium")
    if has_legend:
        _maps.draw_flag_legend(shown, sheet, name)
    return np.concatenate([shown, zooms])


def _share_text(plane: xr.DataArray) -> str:
    """Return the share of the cells in contact, or of the contact that sticks."""
    flags = np.asarray(plane.values)
    touching = flags > 0
    words, share = "in contact", np.mean(touching) if flags.size else 0.0
    if plane.name == "slip_state":
        if not touching.any():
            return "no contact"
        words, share = "sticks", np.mean(flags[touching] == 1)
    percent = 100 * float(share)
    return f"{percent:.0f} % {words}" if percent >= 10 else f"{percent:.2g} % {words}"


def _window(state: xr.DataArray, zoom: float | None, axes: Panels | None, width: float) -> Any:
    """Return the cells (rows, columns) of the window to magnify in maps of so many inches, or None."""
    shape, extent = state.shape[-2:], extent_of(state)
    cell = (extent[1] - extent[0]) / shape[1]
    if zoom is None:
        if _style.are_given(axes):
            return None
        # cells narrower than a typographic point cannot be told apart
        zoom = min(shape) * cell / 6 if 72 * width < shape[1] else 0.0
    size = round(min(zoom, extent[1] - extent[0]) / cell)
    if size < 1 or size >= min(shape):
        return None
    touching = np.asarray(state.values)[-1] > 0
    sums = np.pad(touching.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return slice(int(row), int(row) + size), slice(int(column), int(column) + size)


def _magnify(ax: Any, of: Any, plane: xr.DataArray, window: Any, letter: str) -> None:
    """Draw the window of a map on its own, and frame it in the map."""
    part = plane[window]
    _maps.draw_flags(ax, part)
    _maps.draw_outline(of, part, _maps.plane_scale(plane), edgecolor=_style.RED, linewidth=1.0)
    for spine in ax.spines.values():
        spine.set(color=_style.RED, linewidth=1.0)
    left, right, *_ = extent_of(part)
    size = f",  {quantity_text(right - left, 'm')} wide" if "x" in plane.coords else ""
    ax.set_title(rf"$\bf{{{letter}}}$  magnified{size}", fontsize="small")


POSITIVE = ("pressure", "gap")


@figure
def surface(
    surface: Any,
    *,
    block: xr.DataArray | None = None,
    shaded: bool = False,
    title: str = "",
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a map of heights.

    If a few heights lie far outside the range of all others, the colour bar is cut and ends in a point.

    Parameters
    ----------
    surface : DataArray, Dataset or node of a DataTree
        Heights (m), dims (y, x); leading dims of length one are dropped. NaN is drawn grey.
    block : DataArray, optional
        Any array with the x and y (m) of the sliding block, whose outline is drawn.
    shaded : bool
        Light the surface from the north-west (upper left), its slopes exaggerated to an rms of 0.5. The
        colours are then those of the bar on average only.
    title : str
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> heights = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> ax = fc.plotting.surface(heights)
    >>> [each.get_ylabel() for each in ax.figure.axes]
    ['$y$ (mm)', 'height (mm)']
    """
    plane = _maps.plane_of(surface, "height", units, "surface")
    if block is not None:
        with Problems("fc.plotting") as problems:
            problems.grid("block", block)
    ax = _style.axes_or_new(ax, _style.MAP)
    _maps.draw_values(ax, plane, colours=_style.HEIGHT_MAP, shaded=shaded)
    if block is not None:
        _maps.draw_outline(ax, block, _maps.plane_scale(plane))
    ax.set_title(title)
    return ax


@figure
def field(data: Any, *, title: str | None = None, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw a map of one field of a result: contact pressure, gap, displacement, contact state, islands.

    Parameters
    ----------
    data : DataArray
        Dims (y, x); leading dims of length one are dropped. Zero pressures and gaps are drawn pale, and
        islands (`label`) in twelve colours, of which about one neighbour in 15 has the same.
    title : str, optional
        Default: the number of islands of labels, else none.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> heights = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.press(heights, contact_modulus=1e9, nominal_pressure=1e6, keep=("pressure",))
    >>> ax = fc.plotting.field(result["pressure"])
    >>> print(ax.figure.axes[1].get_ylabel())
    contact pressure (MPa)
    """
    plane = _maps.plane_of(data, "", units, "data")
    ax = _style.axes_or_new(ax, _style.MAP)
    if plane.name == "label":
        _maps.draw_labels(ax, plane)
    elif plane.name in _maps.STATES:
        _maps.draw_flags(ax, plane)
        _maps.label_axes(ax, plane)
        _maps.draw_flag_legend([ax], None, str(plane.name))
    else:
        _maps.draw_values(ax, plane, positive=plane.name in POSITIVE)
    if title is not None:
        ax.set_title(title)
    return ax


@figure
def first_contact(
    result: Any, *, shear: float | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the load at which each cell first comes into contact: the evolution along a load path in one map.

    Cells that never touch are pale. Where sets grow with load, the contact domain at a load is all cells up
    to its colour.
    """
    data = result_of(result, ("state",), _paths.PATH, units)
    require_known_dims(data, {"state": (*_paths.PATH, "y", "x")})
    path = _paths.at_shear(data, shear)
    name = _paths.load_of(path)
    loads = table(path, name, ("step",)) if name else np.arange(path.sizes["step"], dtype=float)
    touching = path["state"].transpose("step", "y", "x").values > 0
    values = np.where(touching.any(axis=0), loads[np.argmax(touching, axis=0)], np.nan)
    coords = {dim: path[dim] for dim in ("y", "x") if dim in path.coords}
    attributes = path[name].attrs if name else {"units": "1"}
    plane = xr.DataArray(values, coords, dims=("y", "x"), name=name or "step", attrs=attributes)
    ax = _style.axes_or_new(ax, _style.MAP)
    title = f"{name_of(plane) if name else 'step'} of first contact"
    log = _style.needs_log_axis(loads[loads > 0])
    _maps.draw_values(ax, plane, missing=_style.OPEN_COLOUR, name=title, log=log, clipped=0.0, readable=True)
    ax.set_title(_paths.shear_text(path, data))
    return ax


def _surface(data: xr.Dataset, delta: xr.Dataset | None = None) -> Any:
    return surface(data, block=None if delta is None or "height" not in delta else delta["height"])


def _delta_surface(data: xr.Dataset) -> Any:
    last = data.isel(shear=-1) if "shear" in data.dims else data
    return surface(last, title=f"delta-surface, {_paths.shear_text(last, last)}".rstrip(", "))


def _along_load(data: xr.Dataset) -> Any:
    return contact_domains(data, shear=_paths.middle_shear(data))


def _along_shear(data: xr.Dataset) -> Any:
    return contact_domains(data, normal_force=float(np.nanmax(data["normal_force"].values)))


_last_domains = _paths.at_end(contact_domains, "shear")
FIGURES = (
    StudyFigure(
        "surface", "surfaces", "height", _surface, ("y", "x"), beside={"delta": "joints/delta_surface"}
    ),
    StudyFigure("delta_surface", "joints/delta_surface", "height", _delta_surface),
    StudyFigure("joint_contact_domains", "joints/closure", "state", _along_load),
    StudyFigure("joint_contact_domains_along_shear", "joints/closure", "state", _along_shear, _paths.PATH),
    StudyFigure("joint_first_contact", "joints/closure", "state", first_contact, ("step",)),
    StudyFigure("contact_domains", "contact", "state", contact_domains),
    StudyFigure("first_contact", "contact", "state", first_contact, ("step",)),
    StudyFigure("slip_domains", "partial_slip", "slip_state", _last_domains),
    StudyFigure("joint_slip_domains", "joints/partial_slip", "slip_state", _last_domains),
)
