"""Maps: the face as a shaded relief, and any other field of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._reading import as_dataset, extent_of
from fractalcontact.plotting._units import axis_label, name_of, scale_for, scale_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (4.6, 3.8)
POSITIVE = ("pressure", "gap")


@_style.styled
def face(
    surface: Any, *, block: xr.DataArray | None = None, title: str = "", ax: Axes | None = None
) -> Figure:
    """Draw a face as a shaded relief, lit from the north-west (upper left).

    The colours tell the height. The shading tells the slope, raised until it can be seen: it carries no
    numbers. A few heights far beyond all others are cut, and the colour bar then ends in a point.

    Parameters
    ----------
    surface : DataArray, Dataset or node of a DataTree
        Heights in m, dims (y, x); leading dims of length one are dropped. NaN is drawn grey.
    block : DataArray, optional
        Anything with the x and y (m) of the sliding block; its outline is drawn.
    title : str
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no plane to draw, or several.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> figure = fc.plotting.face(surface)
    """
    plane = plane_of(surface, "face", "height")
    figure, ax = _style.canvas(ax, SIZE)
    length, height = plane_scale(plane), scale_of(plane)
    extent = extent_of(plane)
    mappable = _maps.relief(ax, np.asarray(plane.values, float), extent, length, height)
    if block is not None:
        outline(ax, extent_of(block), length)
    _maps.bar(ax, mappable, axis_label(plane, height))
    name_plane(ax, plane, length)
    ax.set_title(title)
    return figure


@_style.styled
def field(data: Any, *, title: str = "", ax: Axes | None = None) -> Figure:
    """Draw one field of a result: contact pressure, gap, displacement ...

    Parameters
    ----------
    data : DataArray
        Dims (y, x); leading dims of length one are dropped. Pressures and gaps of zero are left pale.
    title : str
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no plane to draw, or several.
    """
    plane = plane_of(data, "field", "")
    figure, ax = _style.canvas(ax, SIZE)
    length, shown = plane_scale(plane), scale_of(plane)
    mappable = _maps.field(
        ax, np.asarray(plane.values, float), extent_of(plane), length, shown, positive=plane.name in POSITIVE
    )
    _maps.bar(ax, mappable, shown.label(name_of(plane)))
    name_plane(ax, plane, length)
    ax.set_title(title)
    return figure


def plane_of(data: Any, where: str, name: str) -> xr.DataArray:
    """Return the one plane (y, x) in `data`: the variable `name`, or the only one."""
    dataset = as_dataset(data, where)
    with Problems(f"fc.plotting.{where}") as problems:
        wanted = name if name in dataset.data_vars else next(iter(dataset.data_vars), "")
        if problems.require(bool(wanted), "result", "a variable with dims (y, x)", "none"):
            plane = dataset[wanted]
            problems.require({"y", "x"} <= set(plane.dims), str(wanted), "dims (y, x)", plane.dims)
            for dim in plane.dims:
                if dim not in ("y", "x"):
                    size = plane.sizes[dim]
                    problems.require(size == 1, str(wanted), f"one {dim}; choose with .sel or .isel", size)
    return plane.squeeze([d for d in plane.dims if d not in ("y", "x")]).transpose("y", "x")


def plane_scale(plane: xr.DataArray) -> Any:
    """Return the scale of positions: metres with a prefix, or cells for a plane without coordinates."""
    if "x" not in plane.coords:
        return scale_for("cells", 1.0)
    left, right, bottom, top = extent_of(plane)
    return scale_for("m", (right - left, top - bottom))


def name_plane(ax: Axes, plane: xr.DataArray, length: Any) -> None:
    """Label the axes of a map."""
    for dim, setter in (("x", ax.set_xlabel), ("y", ax.set_ylabel)):
        setter(length.label(f"${dim}$") if dim in plane.coords else f"${dim}$ (cells)")


def outline(ax: Axes, extent: tuple[float, float, float, float], length: Any, **style: Any) -> None:
    """Draw the outline of a block."""
    from matplotlib.patches import Rectangle

    left, right, bottom, top = (float(v) for v in length(extent))
    look: dict[str, Any] = {"fill": False, "edgecolor": "white", "linewidth": 1.2} | style
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, **look))
