"""Maps of a surface and of any other field of a result."""

from __future__ import annotations

from typing import Any

import xarray as xr

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Units

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
    plane = _maps.plane_of(surface, "surface", "height", units, "surface")
    if block is not None:
        with Problems("fc.plotting.surface") as problems:
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
        neighbouring islands (`label`) in different colours.
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
    plane = _maps.plane_of(data, "field", "", units, "data")
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
