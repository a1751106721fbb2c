"""What accuracy costs: true error against run time."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._reading import as_dataset, table, words
from fractalcontact.plotting._units import axis_label, scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COLUMNS = 2
MARKERS = "osD^vP*"


@_style.styled
def error_against_time(measured: Any, *, figure: Figure | SubFigure | None = None) -> Figure:
    """Draw true error against run time, a panel for each part and a curve for each method.

    Further down is more accurate, further to the left is faster; each point is one setting of the method.

    Parameters
    ----------
    measured : DataTree or Dataset
        From `fractalcontact.accuracy.measure`, or one of its groups: error and run_time (s) over
        (method, knob). What the error means is read from the attributes of `error`.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is nothing that was measured.
    """
    parts = _parts(measured)
    columns = min(len(parts), COLUMNS)
    rows = -(-len(parts) // columns)
    sheet = _style.sheet(figure, (4.9 * columns, 3.2 * rows))
    axes = sheet.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(parts) :]:
        ax.set_axis_off()
    for ax, (name, data) in zip(axes, parts.items(), strict=False):
        _style.dress(ax)
        _curves(ax, data)
        meaning = textwrap.fill(str(data["error"].attrs.get("error", "")), 62)
        ax.set_title("\n".join(line for line in (name, meaning) if line), fontsize=8)
    return _style.root(sheet)


def _parts(measured: Any) -> dict[str, xr.Dataset]:
    import xarray as xr

    if isinstance(measured, xr.DataTree) and measured.children:
        found = {name: node.to_dataset() for name, node in measured.children.items()}
    else:
        found = {"": as_dataset(measured, "error_against_time")}
    with Problems("fc.plotting.error_against_time") as problems:
        for data in found.values():
            for name in ("error", "run_time"):
                problems.require(name in data, "measured", f"the variable {name!r}", list(data.variables))
    return found


def _curves(ax: Axes, data: xr.Dataset) -> None:
    dims = ("method", "knob")
    errors, seconds = table(data, "error", dims), table(data, "run_time", dims)
    scale = scale_for("s", seconds)
    entries = []
    for row, name in enumerate(words(data["method"])):
        known = np.isfinite(errors[row]) & np.isfinite(seconds[row])
        look: dict[str, Any] = {
            "color": _style.CYCLE[row % len(_style.CYCLE)],
            "marker": MARKERS[row % len(MARKERS)],
        }
        ax.plot(scale(seconds[row][known]), errors[row][known], **look)
        entries.append(_style.line_entry(name.replace("_", " "), **look))
    _style.log_scale(ax, x=seconds, y=errors)
    _style.plain_ticks(ax)
    ax.set_xlabel(axis_label(data["run_time"], scale))
    ax.set_ylabel("true error")
    _style.beside(ax, entries)
