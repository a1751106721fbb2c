"""Many scans at a glance: how their dimension, roughness coefficient, rms height ... are distributed."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.regression import is_far
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import result_of
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._style import AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units

SCAN, JRC = "scan", "roughness_coefficient"
FIRST = {
    "fractal_dimension": "fractal dimension D",
    JRC: "JRC",
    "rms_height": "height Sq",
    "contact_fraction": "largest contact area",
    "interface_closure": "largest closure",
    "rigid_dilatancy": "largest rigid dilatancy",
    "peak_shear_strength": "largest peak strength",
}
NOT_SHOWN = ("_low", "_high", "_error")  # endings of variables


@figure
def scans(overview: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw the distribution of the main numbers of many scans: dimension, JRC, rms height, contact area.

    Each panel has one dot for every scan, sorted, with its interval where there is one; the dashed line is
    the median. Outliers by the modified z of Iglewicz and Hoaglin (beyond 3.5) are red, with their names. A
    number that is the same for all scans has no panel while others differ, and JRC below its scale no dot.

    Parameters
    ----------
    overview : Dataset or node of a DataTree
        The group `overview` of a study of many scans, from `fractalcontact.scenes.run`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> names = ["a.sur", "b.sur", "c.sur"]
    >>> height = ("scan", [1e-6, 2e-6, 3e-6], {"units": "m", "long_name": "rms height"})
    >>> overview = xr.Dataset({"rms_height": height}, coords={"scan": names})
    >>> fc.plotting.scans(overview)[0].get_xlabel()
    'height Sq (µm)'
    """
    data = result_of(overview, (), (SCAN,), units, "overview")
    if JRC in data:
        data = data.assign({JRC: data[JRC].where(data[JRC] >= 0)})
    columns = {str(name): values for name, values in data.data_vars.items() if values.dims == (SCAN,)}
    names = [name for name, values in columns.items() if values.dtype.kind == "f"]
    names = [name for name in names if not name.endswith(NOT_SHOWN) and np.isfinite(data[name]).any()]
    names = sorted(names, key=lambda name: [*FIRST, name].index(name))
    names = [name for name in names if data[name].max() > data[name].min()] or names
    with Problems("fc.plotting") as problems:
        problems.require(bool(names), "overview", "numbers over scan", NONE)
    shown = _style.panel_row(axes, min(len(names), _style.COLUMNS), (_style.WIDTH, 3.2))
    for ax, name in zip(shown, names, strict=False):
        _draw_distribution(ax, data, name)
    shown[0].set_ylabel("scans, sorted")
    return shown


def _draw_distribution(ax: Any, data: Any, name: str) -> None:
    title = FIRST.get(name, str(data[name].attrs.get("long_name", name)).partition(":")[0])
    data = data.isel({SCAN: np.argsort(data[name].values)[: int(np.isfinite(data[name]).sum())]})
    rank = np.arange(data.sizes[SCAN])
    panel = LinePanel.of(ax, data, name, Quantity(rank, PLAIN, ""), (SCAN,), x_name=title)
    x, far = panel.x.values, is_far(panel.x.values)
    if ends := panel.interval(name):
        lines = {"color": _style.BLUE, "lw": _style.THIN, "alpha": 0.6, "label": "interval"}
        ax.hlines(rank, *map(panel.x.scale, ends), **lines)
    panel.line("scan", x[~far], rank[~far], ls="", marker="o", ms=3, color=_style.BLUE)
    panel.line("outlier", x[far], rank[far], ls="", marker="o", color=_style.RED)
    panel.place(float(np.median(x)), color=_style.grey(), **_style.DASHED)
    for place in np.flatnonzero(far)[: _style.MAX_LEGEND_ENTRIES]:
        shown = panel.x.shown[place]
        is_left = shown < np.mean(ax.get_xlim())
        ax.annotate(
            str(data[SCAN].values[place]), (shown, rank[place]), fontsize="x-small",
            xytext=(0, 3), textcoords="offset points", va="bottom",  # above the interval
            ha="left" if is_left else "right",
        )  # fmt: skip
    ax.set_yticks([])
    ax.margins(y=0.08)  # of the name of the highest
