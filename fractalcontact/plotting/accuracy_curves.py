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

MARKERS = "osD^vP*X<>h"  # more than there are colours, so that no two of many curves look alike
MEGABYTE = 1e6
NARROW = 2.0  # ratio of costs


@_style.styled
def error_against_time(measured: Any, *, figure: Figure | SubFigure | None = None) -> Figure:
    """Draw true error against run time and against memory: a row for each contest, a curve for each method.

    Further down is nearer to the truth, further to the left is cheaper; each point is one setting of the
    method. A filled one is on the frontier: no other method of the contest came as near in as little time.

    Parameters
    ----------
    measured : DataTree or Dataset
        From `fractalcontact.accuracy.measure`, or one of its groups: error, run_time (s), memory (byte) and
        on_frontier over (method, setting), contest and error_meaning over method.
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
    contests = _contests(measured)
    sheet = _style.sheet(figure, (8.6, 2.7 * len(contests)))
    axes = sheet.subplots(len(contests), 2, squeeze=False, sharey="row")
    for (left, right), (name, data) in zip(axes, contests.items(), strict=True):
        seconds = scale_for("s", table(data, "run_time", PLANE))
        _curves(left, data, seconds(table(data, "run_time", PLANE)))
        left.set_xlabel(axis_label(data["run_time"], seconds))
        left.set_ylabel("true error")
        entries = _curves(right, data, table(data, "memory", PLANE) / MEGABYTE)
        right.set_xlabel("peak memory (MB)")
        right.tick_params(labelleft=False)
        _style.beside(right, entries)
        meaning = textwrap.fill(str(words(data["error_meaning"])[0]), 68)
        left.set_title(f"{name}\n{meaning}", fontsize=8)
    return _style.root(sheet)


PLANE = ("method", "setting")


def _contests(measured: Any) -> dict[str, xr.Dataset]:
    """Return what was measured, contest by contest."""
    import xarray as xr

    if isinstance(measured, xr.DataTree) and measured.children:
        found = {f"{name}: ": node.to_dataset() for name, node in measured.children.items()}
    else:
        found = {"": as_dataset(measured, "error_against_time")}
    with Problems("fc.plotting.error_against_time") as problems:
        for data in found.values():
            for name in ("error", "run_time", "memory", "on_frontier", "contest", "error_meaning"):
                problems.require(
                    name in data.variables, "measured", f"the variable {name!r}", list(data.variables)
                )
    contests = {}
    for part, data in found.items():
        names = np.asarray(words(data["contest"]))
        for name in dict.fromkeys(names.tolist()):
            contests[f"{part}{name}"] = data.isel(method=np.flatnonzero(names == name))
    return contests


def _curves(ax: Axes, data: xr.Dataset, cost: Any) -> list[Any]:
    """Draw error against a cost, a curve for each method; return the entries of the legend."""
    _style.dress(ax)
    errors, best = table(data, "error", PLANE), table(data, "on_frontier", PLANE).astype(bool)
    entries = []
    for row, name in enumerate(words(data["method"])):
        known = np.isfinite(errors[row]) & np.isfinite(cost[row])
        look: dict[str, Any] = {
            "color": _style.CYCLE[row % len(_style.CYCLE)],
            "marker": MARKERS[row % len(MARKERS)],
        }
        ax.plot(cost[row][known], errors[row][known], **look, markerfacecolor="white")
        ax.plot(cost[row][known & best[row]], errors[row][known & best[row]], **look, ls="")
        entries.append(_style.line_entry(name.replace("_", " "), **look))
    _style.log_scale(ax, x=cost, y=errors)
    least, most = np.nanmin(cost), np.nanmax(cost)
    if least > 0 and most < NARROW * least:  # what hardly differs is not drawn as if it did
        ax.set_xlim(least / NARROW, most * NARROW)
    _style.plain_ticks(ax)
    return entries


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
