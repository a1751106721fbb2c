"""How a joint forgets under shear: the correlation of its faces, the dimension of what is left between."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._reading import result_of, table
from fractalcontact.plotting._units import axis_label, scale_of
from fractalcontact.plotting.sliding import directions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WAYS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


@_style.styled
def correlation(memory: Any, *, ax: Axes | None = None) -> Figure:
    """Draw the correlation of the two faces against shear, and the length where it is lost.

    The vertical lines stand at the decorrelation lengths, the bands beside them are their intervals.

    Parameters
    ----------
    memory : Dataset or node of a DataTree
        From `fractalcontact.joints.decorrelation_length`.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    figure, ax = _style.canvas(ax)
    names = ("correlation", "decorrelation_length", "shear")
    data = result_of(memory, "correlation", names, ("direction", "shear"))
    values = table(data, "correlation", ("direction", "shear"))
    along = scale_of(data["shear"])
    lengths = data.isel(shear=0)
    ends = [table(lengths, f"decorrelation_length{end}", ("direction",)) for end in ("_low", "", "_high")]
    entries = []
    for i, (word, look) in enumerate(directions(data)):
        ax.plot(along(data["shear"].values), values[i], **look)
        low, length, high = (float(end[i]) for end in ends)
        if np.isfinite(length):
            ax.axvline(float(along(length)), color=look["color"], lw=0.7, ls=":")
        if np.isfinite(low) and np.isfinite(high):
            ax.axvspan(float(along(low)), float(along(high)), color=look["color"], alpha=0.12, lw=0)
        entries.append(_style.line_entry(word, **look))
    ax.axhline(0.0, color="0.6", lw=0.6)
    ax.set_xlabel(axis_label(data["shear"], along))
    ax.set_ylabel("correlation of the faces")
    _style.beside(ax, entries, title="block slides")
    _style.beside(ax, [_style.line_entry("decorrelation length", lw=0.7, ls=":")], low=True)
    return figure


@_style.styled
def delta_dimension(dimension: Any, *, ax: Axes | None = None) -> Figure:
    """Draw the dimension of the delta-surface against shear, by each way to measure it.

    Parameters
    ----------
    dimension : Dataset or node of a DataTree
        From `fractalcontact.joints.delta_dimension`.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    figure, ax = _style.canvas(ax)
    data = result_of(dimension, "delta_dimension", (*WAYS, "shear"), ("shear",))
    along = scale_of(data["shear"])
    entries = []
    for i, name in enumerate(WAYS):
        look: dict[str, Any] = {"color": _style.CYCLE[i], "marker": "osD"[i], "ms": 3.5}
        ax.plot(along(data["shear"].values), table(data, name, ("shear",)), **look)
        entries.append(_style.line_entry(name.split("_")[0], **look))
    if data.sizes["shear"] > 1 and float(data["shear"].min()) > 0:
        ax.set_xscale("log")
    ax.set_xlabel(axis_label(data["shear"], along))
    ax.set_ylabel("dimension of the delta-surface")
    _style.beside(ax, entries, title="by its")
    return figure
