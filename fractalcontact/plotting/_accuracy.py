"""Accuracy: true error against run time and memory, and errors of the estimators of the Hurst exponent."""

from __future__ import annotations

import textwrap
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import (
    by_name,
    quantity,
    require_dims,
    require_variables,
    result_of,
    table,
    words,
)
from fractalcontact.plotting._line_panel import Family, LinePanel
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Units

MARKERS = "osD^vP*X<>h"  # their number has no common divisor with that of the colours: 77 different styles
PLANE = ("method", "setting")
MEASURED = ("error", "run_time", "memory", "on_pareto_front", "benchmark", "error_meaning")
COSTS = {"run_time": "", "memory": "peak memory"}  # with their names on axes
CASES = ("method", "family", "hurst", "size")
QUANTITIES = {
    "error_ratio": ("rms error / Cramér-Rao bound", 1.0),
    "interval_coverage": ("interval coverage", 0.95),
}


@figure
def error_against_time(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw true error against run time and peak memory, one row per benchmark and one curve per method.

    Each point is one setting of a method. A filled point is on the Pareto front: no setting of another method
    of the benchmark has a smaller error in a shorter time; where the parameter is the size of the input, none
    of the same size.
    """
    benchmarks = _benchmarks(result, units)
    shape = (len(benchmarks), 2)
    shown = _style.panels(axes, shape, (8.6, 2.7 * len(benchmarks)), sharey="row")
    for row, (name, data) in zip(shown, benchmarks.items(), strict=True):
        methods = _methods(words(data["method"]))
        on_front = table(data, "on_pareto_front", PLANE) > 0
        for ax, (cost, title) in zip(row, COSTS.items(), strict=True):
            x, y = quantity(data, cost, PLANE, title), quantity(data, "error", PLANE, "true error")
            panel = LinePanel(ax, data, x, y, PLANE, methods)
            face = ax.get_facecolor()
            for i, own in enumerate(methods.styles):
                finite = np.isfinite(y.values[i]) & np.isfinite(x.values[i])
                best = finite & on_front[i]
                method = methods.labels[i]
                panel.line(method, x.values[i][finite], y.values[i][finite], **own, markerfacecolor=face)
                panel.line(
                    f"{method}, Pareto front", x.values[i][best], y.values[i][best], **own | {"ls": ""}
                )
            _widen(ax, x.shown)
            panel.finish(log="xy", legend=cost == "memory")
        row[1].set_ylabel("")
        row[1].tick_params(labelleft=False)
        meaning = textwrap.fill(str(words(data["error_meaning"])[0]), 68)
        row[0].set_title(f"{name}\n{meaning}", fontsize="small")
    return shown


def _widen(ax: Axes, costs: Any, ratio: float = 2.0) -> None:
    """Show costs within this ratio on an axis at least as wide: nearly equal ones must not look different."""
    least, most = np.nanmin(costs), np.nanmax(costs)
    if least > 0 and most < ratio * least:
        ax.set_xlim(least / ratio, most * ratio)


def _benchmarks(measured: Any, units: Units | None) -> dict[str, xr.Dataset]:
    """Return the results of each benchmark by name."""
    benchmarks = {}
    for group, data in by_name(measured, units).items():
        require_variables(data, MEASURED)
        names = np.asarray(words(data["benchmark"]))
        for name in dict.fromkeys(names.tolist()):
            benchmarks[f"{group}: {name}" if group else name] = data.isel(
                method=np.flatnonzero(names == name)
            )
    return benchmarks


def _methods(names: list[str]) -> Family:
    """Return a family of curves with a colour and a marker for each method."""
    styles = [_style.distinct_style(i) | {"marker": MARKERS[i % len(MARKERS)]} for i in range(len(names))]
    return Family(styles, [name.replace("_", " ") for name in names])


@figure
def estimator_errors(result: Any, *, axes: Panels | None = None) -> AxesArray:
    """Draw the rms error over the Cramer-Rao bound and the interval coverage against the true Hurst exponent.

    There is one column per surface family and size, and one curve per method. On large surfaces
    an unbiased estimator has a ratio of at least one. A calibrated 95 % interval has a coverage of 0.95;
    vertical bars show the uncertainty due to the number of surfaces.
    """
    data = result_of(result, tuple(QUANTITIES), ("method",))
    require_dims(data, {dim: dim for dim in CASES})
    with Problems("fc.plotting") as problems:
        for dim in CASES:
            problems.require(data.sizes[dim] > 0, f"result.{dim}", "at least one entry", NONE)
    families, sizes = words(data["family"]), data["size"].values
    cases = list(product(range(len(families)), range(len(sizes))))
    size = (2.3 * len(cases) + 1.6, 5.2)
    shown = _style.panels(axes, (2, len(cases)), size, sharex=True, sharey="row", height_ratios=(2.0, 1.0))
    methods = _methods(words(data["method"]))
    for column, (i, j) in zip(shown.T, cases, strict=True):
        case = data.isel(family=i, size=j)
        for ax, (name, (title, ideal)) in zip(column, QUANTITIES.items(), strict=True):
            panel = _draw_against_hurst(ax, case, name, title, methods)
            panel.level(ideal, color=_style.ink(), **_style.DOTTED)
            is_last = name == "error_ratio" and ax is shown[0, -1]
            panel.finish(log="y" if name == "error_ratio" else "", legend=is_last)
            if ax is not shown[list(QUANTITIES).index(name), 0]:
                ax.set_ylabel("")
        column[0].set_xlabel("")
        column[0].set_title(f"{families[i]}, n = {sizes[j]}")
    return shown


def _draw_against_hurst(ax: Axes, case: xr.Dataset, name: str, title: str, methods: Family) -> LinePanel:
    hurst, dims = "true Hurst exponent", ("method", "hurst")
    panel = LinePanel(ax, case, "hurst", name, dims, methods, x_name=hurst, y_name=title)
    ends = panel.interval(name)
    for i, (method, own) in enumerate(zip(methods.labels, methods.styles, strict=True)):
        finite = np.isfinite(panel.y.values[i])
        x = panel.x.values[i, finite]
        if finite.any():
            panel.line(method, x, panel.y.values[i, finite], **own)
            if ends:
                bars = (end[i, finite] for end in ends)
                panel.bars(f"{method}, interval", x, *bars, color=own["color"], lw=_style.THIN)
    return panel
