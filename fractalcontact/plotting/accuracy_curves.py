"""What accuracy costs: true error against run time, and how near estimators come to the least error."""

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


@_style.styled
def estimator_errors(bench: Any, *, figure: Figure | SubFigure | None = None) -> Figure:
    """Draw the error over the Cramer-Rao bound, and below it the coverage, against the true exponent.

    A column for each family and size, a curve for each method. No estimator without bias lies below one; an
    honest 95 % interval covers .95, which is drawn with what is left to chance by the number of surfaces.

    Parameters
    ----------
    bench : Dataset
        From `fractalcontact.accuracy.estimators`: error_ratio and interval_coverage over (method, family,
        hurst, size), with the ends of their intervals.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing.
    """
    data = as_dataset(bench, "estimator_errors")
    with Problems("fc.plotting.estimator_errors") as problems:
        for name in ("error_ratio", "interval_coverage"):
            problems.require(name in data, "bench", f"the variable {name!r}", list(data.variables))
    cases = [(family, size) for family in words(data["family"]) for size in data["size"].values]
    sheet = _style.sheet(figure, (2.3 * len(cases) + 1.6, 5.2))
    axes = np.asarray(
        sheet.subplots(2, len(cases), squeeze=False, sharex=True, sharey="row", height_ratios=(2.0, 1.0))
    )
    names = words(data["method"])
    looks: list[dict[str, Any]] = [
        {
            "color": _style.CYCLE[k % len(_style.CYCLE)],
            "marker": MARKERS[k % len(MARKERS)],
            "ls": "-" if k < len(_style.CYCLE) else "--",
        }
        for k in range(len(names))
    ]
    for (upper, lower), (family, size) in zip(axes.T, cases, strict=True):
        one = data.sel(family=family, size=size)
        for ax, quantity in ((upper, "error_ratio"), (lower, "interval_coverage")):
            _style.dress(ax)
            _against_hurst(ax, one, quantity, looks)
        upper.set_yscale("log")
        upper.axhline(1.0, color=_style.BLACK, lw=0.9, ls=":")
        lower.axhline(0.95, color=_style.BLACK, lw=0.9, ls=":")
        _style.plain_ticks(upper)
        upper.set_title(f"{family}, n = {size}")
        lower.set_xlabel("true Hurst exponent")
    axes[0, 0].set_ylabel("rms error / least error")
    axes[1, 0].set_ylabel("coverage")
    entries = [
        _style.line_entry(name.replace("_", " "), **look) for name, look in zip(names, looks, strict=True)
    ]
    _style.beside(axes[0, -1], entries)
    return _style.root(sheet)


def _against_hurst(ax: Axes, one: xr.Dataset, quantity: str, looks: list[dict[str, Any]]) -> None:
    dims = ("method", "hurst")
    hurst = np.asarray(one["hurst"].values, float)
    values = table(one, quantity, dims)
    for row, look in enumerate(looks):
        known = np.isfinite(values[row])
        if not known.any():
            continue
        ax.plot(hurst[known], values[row][known], **look)
        if f"{quantity}_low" in one:
            low, high = (table(one, f"{quantity}_{end}", dims)[row][known] for end in ("low", "high"))
            ax.vlines(hurst[known], low, high, color=look["color"], lw=0.8)
