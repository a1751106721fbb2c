"""Figures of many surfaces: the median over the members of an ensemble with a band, and scans at a glance."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.regression import is_far
from fractalcontact.base.study import MEMBER
from fractalcontact.base.validation import require
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import result_of
from fractalcontact.plotting._line_panel import BAND_OPACITY, LinePanel, legs
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units


def reduced_trees(tree: xr.DataTree) -> list[xr.DataTree]:
    """Return the median of every curve over the members, and both ends of the band.

    The band is one standard deviation to either side, if normal. Maps and flags are those of member 0.
    """
    shares = (0.5, 0.16, 0.84)
    return [tree.map_over_datasets(functools.partial(_quantile, share=share)) for share in shares]


def _quantile(dataset: xr.Dataset, share: float) -> xr.Dataset:
    for dim in ("island", "link"):  # rows of all members, one after the other
        if f"{dim}_{MEMBER}" in dataset.coords:
            dataset = dataset.isel({dim: np.flatnonzero(dataset[f"{dim}_{MEMBER}"].values == 0)})
    if MEMBER not in dataset.dims:
        return dataset
    loads = [name for name, coord in dataset.coords.items() if MEMBER in coord.dims and name != MEMBER]
    flat = dataset.reset_coords(loads)
    curves = [name for name, variable in flat.data_vars.items() if _is_curve(variable)]
    # beside ends without a bound, which are infinite, there is no quantile
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        reduced = {name: flat[name].quantile(share, MEMBER, keep_attrs=True) for name in curves}
    first = flat.isel({MEMBER: 0}, drop=True).assign(reduced)
    return first.drop_vars("quantile", errors="ignore").set_coords(loads)


def _is_curve(variable: xr.DataArray) -> bool:
    """Return whether a variable has numbers, not flags, of each member, and is no map."""
    has_numbers = variable.dtype.kind in "fiu" and variable.dtype != np.int8
    return has_numbers and MEMBER in variable.dims and not {"y", "x"} <= set(variable.dims)


def draw_with_band(drawings: Sequence[Callable[[], Any]], members: int) -> Axes:
    """Draw the median, and for every curve the band between the same curves of the two other drawings."""
    figure, *bounds = (_style.figure_of(drawing()) for drawing in drawings)
    panels = zip(figure.axes, *(bound.axes for bound in bounds), strict=False)
    bands = sum(_add_bands(*axes) for axes in panels)
    for bound in bounds:
        bound.clear()
    has_map = any(ax.images or ax.name == "3d" for ax in figure.axes)
    words = [f"curves: median, band: central 68 % of {members} members"] if bands else []
    if has_map:
        words.append(f"maps: member 0 of {members}" if bands else f"member 0 of {members}")
    if not words:
        words = [f"median of {members} members"]
    # the legend of flags stands at the right
    figure.supxlabel("; ".join(words), x=0.01, ha="left", fontsize="small", color=_style.grey())
    return figure.axes[0]


def _add_bands(ax: Axes, low: Axes, high: Axes) -> int:
    """Fill between the curves of two axes, in the colour of the same curve; return how many were filled."""
    count, limits = 0, (ax.get_xlim(), ax.get_ylim())
    lines = [[line for line in each.get_lines() if line.get_transform() == each.transData]
             for each in (ax, low, high)]  # fmt: skip
    # lines of reference, such as that of logarithmic axes, are drawn last, and not in all three drawings
    for line, *bounds in zip(*lines, strict=False):
        if len({str(each.get_label()).split(",")[0] for each in (line, *bounds)}) > 1:
            continue
        (x_low, y_low), (x_high, y_high) = (
            _in_units_of(ax, bound, drawn) for bound, drawn in zip((low, high), bounds, strict=True)
        )
        if x_low.size < 2 or x_low.size != x_high.size:
            continue
        if np.allclose(x_low, x_high, atol=0) and np.allclose(y_low, y_high, atol=0):  # no band to be seen
            continue
        finite = np.isfinite(x_low + y_low + x_high + y_high)
        x, y = np.array([x_low, x_high])[:, finite], np.array([y_low, y_high])[:, finite]
        name = str(line.get_label())
        style = {"color": line.get_color(), "alpha": BAND_OPACITY, "linewidth": 0, "zorder": 0.5}
        style["label"] = name if name.startswith("_") else f"{name}, central 68 %"
        for leg in legs(x[0]):
            outline = (np.concatenate([low[leg], high[leg][::-1]]) for low, high in (x, y))
            ax.fill(*outline, **style)
        limits = _widened(limits[0], x, ax.get_xscale()), _widened(limits[1], y, ax.get_yscale())
        count += 1
    if count:
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
    return count


def _in_units_of(ax: Axes, bound: Axes, line: Any) -> tuple[Any, Any]:
    """Return the points of a curve of other axes in the units of these."""
    ratios = (_factor(b) / _factor(a) for a, b in ((ax.xaxis, bound.xaxis), (ax.yaxis, bound.yaxis)))
    x, y = (ratio * np.asarray(v, dtype=float) for ratio, v in zip(ratios, line.get_data(), strict=True))
    shown = np.broadcast_arrays(x, y)
    return shown[0], shown[1]


def _factor(axis: Any) -> float:
    """Return the size of the unit that an axis shows."""
    return float(getattr(axis, "factor", 1.0))


def _widened(limits: tuple[float, float], values: np.ndarray[Any, Any], scale: str) -> tuple[float, float]:
    """Return the limits of an axis with all values that it can show; those of an inverted axis stay."""
    low, high = limits
    if low > high:
        return limits
    if scale == "log":
        values = values[values > 0]
    return min(low, float(values.min(initial=low))), max(high, float(values.max(initial=high)))


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
MOST_NAMES = 40  # of scans: more do not fit a page
NOT_SHOWN = ("_low", "_high", "_error")  # endings of variables


@figure
def scans(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw the distribution of the main numbers of many scans: dimension, JRC, rms height, contact area.

    Each scan is a row of all panels, in the order of the first number, with one dot, and its interval where
    there is one; the dashed line is the median. At most 40 scans are named. Outliers by the modified z of
    Iglewicz and Hoaglin (beyond 3.5) are red, with their names. A number that is the same for all scans has
    no panel while others differ, and JRC below its scale no dot.
    """
    data = result_of(result, (), (SCAN,), units)
    if JRC in data:
        data = data.assign({JRC: data[JRC].where(data[JRC] >= 0)})
    columns = {str(name): values for name, values in data.data_vars.items() if values.dims == (SCAN,)}
    names = [name for name, values in columns.items() if values.dtype.kind == "f"]
    names = [name for name in names if not name.endswith(NOT_SHOWN) and np.isfinite(data[name]).any()]
    names = sorted(names, key=lambda name: [*FIRST, name].index(name))
    names = [name for name in names if data[name].max() > data[name].min()] or names
    require(SCAN in result.dims and bool(names), "result", "numbers over scan")
    data = data.sortby(names[0]).dropna(SCAN, how="all", subset=names)  # NaN comes last
    scan_names = [str(name) for name in data[SCAN].values]
    are_named = len(scan_names) <= MOST_NAMES
    # inches: a name has letters of .07, and a line of .14
    size = (_style.WIDTH + 0.07 * max(map(len, scan_names)), max(_style.ROW[1], 0.7 + 0.14 * len(scan_names)))
    size = size if are_named else _style.ROW
    shown = _style.panel_row(axes, min(len(names), _style.COLUMNS), size)
    panels = [_draw_distribution(ax, data, name) for ax, name in zip(shown, names, strict=False)]
    for ax in shown:
        ax.set_ylim(-0.7, len(scan_names))  # with the name above the highest
    if are_named:
        shown[0].set_yticks(range(len(scan_names)), scan_names)
    else:
        shown[0].set_ylabel(f"{len(scan_names)} scans, by {panels[0].x.name}")
    entries = {entry.get_label(): entry for panel in panels for entry in panel.entries}
    _style.side_legend(shown[-1], list(entries.values()))
    return shown


def _draw_distribution(ax: Any, data: xr.Dataset, name: str) -> LinePanel:
    """Draw a number of every scan that has it, each in its row."""
    title = FIRST.get(name, str(data[name].attrs.get("long_name", name)).partition(":")[0])
    rank = np.flatnonzero(np.isfinite(data[name].values))
    data = data.isel({SCAN: rank})
    panel = LinePanel(ax, data, name, Quantity(rank, PLAIN, ""), (SCAN,), x_name=title)
    x, far = panel.x.values, is_far(panel.x.values)
    if ends := panel.interval(name):
        lines = {"color": _style.BLUE, "lw": _style.THIN, "alpha": 0.6}
        ax.hlines(rank, *map(panel.x.scale, ends), label="interval", **lines)
        panel.key("interval", **lines)
    dots: dict[str, Any] = {"ls": "", "marker": "o"}
    panel.line("scan", x[~far], rank[~far], ms=3, color=_style.BLUE, **dots)
    panel.line("outlier", x[far], rank[far], key="outlier" if far.any() else "", color=_style.RED, **dots)
    panel.place(float(np.median(x)), key="median", color=_style.grey(), **_style.DASHED)
    for place in np.flatnonzero(far)[: _style.MAX_LEGEND_ENTRIES]:
        shown = panel.x.shown[place]
        is_left = shown < np.mean(ax.get_xlim())
        ax.annotate(
            str(data[SCAN].values[place]), (shown, rank[place]), fontsize="x-small",
            xytext=(0, 3), textcoords="offset points", va="bottom",  # above the interval
            ha="left" if is_left else "right",
        )  # fmt: skip
    ax.set_yticks([])
    ax.locator_params(axis="x", nbins=4)  # more labels would touch in the narrowest panel
    return panel


FIGURES = (StudyFigure("scans", "overview", "status", scans),)
