"""Maps of a surface and of any other field of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import Scale, scale_for
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._inputs import as_dataset, extent_of
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

SIZE = (4.6, 3.8)
POSITIVE = ("pressure", "gap")


@_style.checked
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
        There is no plane to draw, or several.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> heights = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> ax = fc.plotting.surface(heights)
    >>> [each.get_ylabel() for each in ax.figure.axes]
    ['$y$ (mm)', 'height (mm)']
    """
    surface = shown_in(surface, units, "surface")
    plane = plane_of(surface, "surface", "height", "surface")
    outline = None if block is None else _block_extent(block)
    ax = _style.axes_or_new(ax, SIZE)
    length, height = plane_scale(plane), scale_of(plane)
    extent = extent_of(plane)
    mappable = _maps.relief(ax, np.asarray(plane.values, float), extent, length, height, shaded=shaded)
    if outline is not None:
        draw_outline(ax, outline, length)
    _maps.colour_bar(ax, mappable, name_of(plane), height)
    label_axes(ax, plane, length)
    ax.set_title(title)
    return ax


@_style.checked
def field(data: Any, *, title: str = "", units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw a map of one field of a result, for example contact pressure, gap or displacement.

    Parameters
    ----------
    data : DataArray
        Dims (y, x); leading dims of length one are dropped. Zero pressures and gaps are drawn pale.
    title : str
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
        There is no plane to draw, or several.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> heights = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> result = fc.contact.press(heights, contact_modulus=1e9, nominal_pressure=1e6, keep=("pressure",))
    >>> ax = fc.plotting.field(result["pressure"])
    >>> print(ax.figure.axes[1].get_ylabel())
    contact pressure (MPa)
    """
    data = shown_in(data, units, "field")
    plane = plane_of(data, "field", "", "data")
    ax = _style.axes_or_new(ax, SIZE)
    length, shown = plane_scale(plane), scale_of(plane)
    mappable = _maps.field(
        ax, np.asarray(plane.values, float), extent_of(plane), length, shown, positive=plane.name in POSITIVE
    )
    _maps.colour_bar(ax, mappable, name_of(plane), shown)
    label_axes(ax, plane, length)
    ax.set_title(title)
    return ax


def _block_extent(block: xr.DataArray) -> tuple[float, float, float, float]:
    with Problems("fc.plotting.surface") as problems:
        problems.grid("block", block)
    return extent_of(block)


def plane_of(data: Any, where: str, name: str, argument: str = "result") -> xr.DataArray:
    """Return the one plane (y, x) in `data`: the variable `name`, or the only one that there is."""
    dataset = as_dataset(data, where, argument)
    names = list(dataset.data_vars)
    planes = [each for each in names if {"y", "x"} <= set(dataset[each].dims)] or names[:1]
    variable = name if name in names else planes[0] if planes else ""
    with Problems(f"fc.plotting.{where}") as problems:
        if problems.require(bool(variable), argument, "a variable with dims (y, x)", NONE):
            is_one = variable == name or len(planes) == 1
            problems.require(is_one, argument, "one variable with dims (y, x)", planes)
            plane = dataset[variable]
            place = f"{argument}.{variable}"
            problems.require({"y", "x"} <= set(plane.dims), place, "dims (y, x)", plane.dims)
            problems.require(plane.dtype.kind in "biuf", place, "real numbers", f"type {plane.dtype}")
            for dim in plane.dims:
                if dim not in ("y", "x"):
                    size = plane.sizes[dim]
                    problems.require(size == 1, place, f"one {dim}; choose with .sel or .isel", size)
    plane = dataset[variable]
    return plane.squeeze([dim for dim in plane.dims if dim not in ("y", "x")]).transpose("y", "x")


def plane_scale(plane: xr.DataArray) -> Scale:
    """Return the scale of positions: metres with a prefix, or cells for a plane without coordinates."""
    if "x" not in plane.coords:
        return scale_for("cells", 1.0)
    left, right, bottom, top = extent_of(plane)
    return scale_of(plane["x"], (right - left, top - bottom))


def label_axes(ax: Axes, plane: xr.DataArray, length: Scale) -> None:
    """Label the axes of a map."""
    for dim, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
        label_axis(axis, f"${dim}$", length if dim in plane.coords else Scale(1.0, "cells"))


def draw_outline(ax: Axes, extent: tuple[float, float, float, float], length: Scale, **style: Any) -> None:
    """Draw the outline of a block."""
    from matplotlib.patches import Rectangle

    left, right, bottom, top = (float(v) for v in length(extent))
    appearance: dict[str, Any] = {"fill": False, "edgecolor": "white", "linewidth": 1.2} | style
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, **appearance))
