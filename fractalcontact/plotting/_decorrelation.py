"""Loss of correlation of the two faces of a joint under shear, and the dimension of its delta-surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._directions import direction_styles
from fractalcontact.plotting._inputs import result_of, table
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

DIMENSIONS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


@_style.checked
def correlation(memory: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the correlation of the two faces of a joint against shear displacement.

    Vertical dotted lines show the decorrelation lengths, and bands their intervals.

    Parameters
    ----------
    memory : Dataset or node of a DataTree
        From `fractalcontact.joints.decorrelation_length`.
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
    >>> lower = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=3.2e-3)
    >>> result = fc.joints.decorrelation_length(crack, direction="E")
    >>> ax = fc.plotting.correlation(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (mm) | correlation of the faces
    """
    memory = shown_in(memory, units, "correlation")
    ax = _style.axes_or_new(ax)
    lengths = tuple(f"decorrelation_length{end}" for end in ("_low", "", "_high"))
    names = ("correlation", "shear", *lengths)
    data = result_of(memory, "correlation", names, ("direction", "shear"), "memory")
    values = table(data, "correlation", ("direction", "shear"))
    along = scale_of(data["shear"])
    ends = [table(data.isel(shear=0), name, ("direction",)) for name in lengths]
    entries = []
    for i, (name, style) in enumerate(direction_styles(data)):
        ax.plot(along(data["shear"].values), values[i], label=name or "correlation", **style)
        low, length, high = (float(end[i]) for end in ends)
        if np.isfinite(length):
            ax.axvline(float(along(length)), color=style["color"], lw=0.7, ls=":")
        if np.isfinite(low) and np.isfinite(high):
            ax.axvspan(float(along(low)), float(along(high)), color=style["color"], alpha=0.12, lw=0)
        entries.append(_style.legend_line(name, **style))
    ax.axhline(0.0, color=_style.grey(), lw=0.6)
    label_axis(ax.xaxis, name_of(data["shear"]), along)
    label_axis(ax.yaxis, "correlation of the faces", PLAIN)
    _style.side_legend(ax, entries, title="block slides")
    _style.side_legend(ax, [_style.legend_line("decorrelation\nlength", lw=0.7, ls=":")], low=True)
    return ax


@_style.checked
def delta_dimension(dimension: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the fractal dimension of the delta-surface against shear displacement, one curve per method.

    Parameters
    ----------
    dimension : Dataset or node of a DataTree
        From `fractalcontact.joints.delta_dimension`.
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
    >>> import xarray as xr
    >>> names = ("covering_dimension", "variogram_dimension", "spectrum_dimension")
    >>> result = xr.Dataset({name: ("shear", [2.1, 2.2]) for name in names}, {"shear": [1e-4, 1e-3]})
    >>> ax = fc.plotting.delta_dimension(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (mm) | dimension of the delta-surface
    """
    dimension = shown_in(dimension, units, "delta_dimension")
    ax = _style.axes_or_new(ax)
    data = result_of(dimension, "delta_dimension", (*DIMENSIONS, "shear"), ("shear",), "dimension")
    along = scale_of(data["shear"])
    entries = []
    for i, name in enumerate(DIMENSIONS):
        style: dict[str, Any] = {"color": _style.cycle()[i], "marker": "osD"[i], "ms": 3.5}
        method = name.split("_")[0]
        ax.plot(along(data["shear"].values), table(data, name, ("shear",)), label=method, **style)
        entries.append(_style.legend_line(method, **style))
    if data.sizes["shear"] > 1 and float(data["shear"].min()) > 0:
        ax.set_xscale("log")
    _style.plain_ticks(ax)
    label_axis(ax.xaxis, name_of(data["shear"]), along)
    label_axis(ax.yaxis, "dimension of the delta-surface", PLAIN)
    _style.side_legend(ax, entries, title="method")
    return ax
