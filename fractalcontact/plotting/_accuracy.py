"""Accuracy: true error against run time and memory, and errors of the estimators of the Hurst exponent."""

from __future__ import annotations

import textwrap
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import as_dataset, require_dims, require_variables, table, words
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

MARKERS = "osD^vP*X<>h"  # their number has no common divisor with that of the colours: 77 different styles
NARROW = 2.0  # costs within this ratio are drawn on an axis of at least its width
PLANE = ("method", "setting")


@_style.checked
def error_against_time(measured: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw true error against run time and peak memory, one row per benchmark and one curve per method.

    Each point is one setting of a method. A filled point is on the Pareto front: no other method of the
    benchmark is clearly better in both error and time.

    Parameters
    ----------
    measured : DataTree or Dataset
        From `fractalcontact.accuracy.measure`, or one of its groups: error, run_time (s), memory (byte) and
        on_pareto_front over (method, setting), benchmark and error_meaning over method.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"run_time": "ms"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> measured = xr.Dataset(
    ...     {
    ...         "error": (("method", "setting"), [[0.1, 0.02]]),
    ...         "run_time": (("method", "setting"), [[0.01, 0.2]]),
    ...         "memory": (("method", "setting"), [[2e6, 8e6]]),
    ...         "on_pareto_front": (("method", "setting"), [[True, True]]),
    ...     },
    ...     coords={
    ...         "method": ["fast"],
    ...         "benchmark": ("method", ["sphere"]),
    ...         "error_meaning": ("method", ["relative error of the force"]),
    ...     },
    ... )
    >>> ((time, memory),) = fc.plotting.error_against_time(measured)
    >>> print(time.get_xlabel(), "|", memory.get_xlabel())
    run time (ms) | peak memory (MB)
    """
    benchmarks = _benchmarks(shown_in(measured, units, "error_against_time"))
    shape = (len(benchmarks), 2)
    shown = _style.panels(axes, shape, (8.6, 2.7 * len(benchmarks)), sharey="row")
    for (left, right), (name, data) in zip(shown, benchmarks.items(), strict=True):
        run_time = table(data, "run_time", PLANE)
        seconds, bytes_shown = scale_of(data["run_time"]), scale_of(data["memory"])
        _error_curves(left, data, seconds(run_time))
        label_axis(left.xaxis, name_of(data["run_time"]), seconds)
        label_axis(left.yaxis, "true error", PLAIN)
        entries = _error_curves(right, data, bytes_shown(table(data, "memory", PLANE)))
        label_axis(right.xaxis, "peak memory", bytes_shown)
        right.tick_params(labelleft=False)
        _style.side_legend(right, entries)
        meaning = textwrap.fill(str(words(data["error_meaning"])[0]), 68)
        left.set_title(f"{name}\n{meaning}", fontsize="small")
    return shown


def _benchmarks(measured: Any) -> dict[str, xr.Dataset]:
    """Return the results of each benchmark by name."""
    if isinstance(measured, xr.DataTree) and measured.children:
        groups = {f"{name}: ": node.to_dataset() for name, node in measured.children.items()}
    else:
        groups = {"": as_dataset(measured, "error_against_time", "measured")}
    needed = ("error", "run_time", "memory", "on_pareto_front", "benchmark", "error_meaning")
    benchmarks = {}
    for prefix, data in groups.items():
        require_variables(data, "error_against_time", needed, "measured")
        names = np.asarray(words(data["benchmark"]))
        for name in dict.fromkeys(names.tolist()):
            benchmarks[f"{prefix}{name}"] = data.isel(method=np.flatnonzero(names == name))
    return benchmarks


def _error_curves(ax: Axes, data: xr.Dataset, cost: Any) -> list[Any]:
    """Draw error against a cost, a curve for each method; return the entries of the legend."""
    errors, on_front = table(data, "error", PLANE), table(data, "on_pareto_front", PLANE).astype(bool)
    entries = []
    for row, name in enumerate(words(data["method"])):
        finite = np.isfinite(errors[row]) & np.isfinite(cost[row])
        best = finite & on_front[row]
        style = _method_style(row)
        label = name.replace("_", " ")
        face = ax.get_facecolor()
        ax.plot(cost[row][finite], errors[row][finite], **style, markerfacecolor=face, label=label)
        ax.plot(cost[row][best], errors[row][best], **style, ls="", label=f"{label}, Pareto front")
        entries.append(_style.legend_line(label, **style))
    _style.log_scale(ax, x=cost, y=errors)
    least, most = np.nanmin(cost), np.nanmax(cost)
    if least > 0 and most < NARROW * least:  # nearly equal costs must not style different
        ax.set_xlim(least / NARROW, most * NARROW)
    _style.plain_ticks(ax)
    return entries


def _method_style(number: int) -> dict[str, Any]:
    colour = _style.cycle()[number % len(_style.cycle())]
    return {"color": colour, "marker": MARKERS[number % len(MARKERS)]}


@_style.checked
def estimator_errors(bench: Any, *, axes: Panels | None = None) -> AxesArray:
    """Draw the rms error over the Cramer-Rao bound and the interval coverage against the true Hurst exponent.

    There is one column per surface family and size, and one curve per method. An unbiased estimator has a
    ratio of at least one. A calibrated 95 % interval has a coverage of 0.95; vertical bars show the
    uncertainty due to the number of surfaces.

    Parameters
    ----------
    bench : Dataset
        From `fractalcontact.accuracy.estimators`: error_ratio and interval_coverage over (method, family,
        hurst, size), with the ends of their intervals.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> dims = ("method", "family", "hurst", "size")
    >>> bench = xr.Dataset(
    ...     {"error_ratio": (dims, [[[[1.1], [1.2]]]]), "interval_coverage": (dims, [[[[0.94], [0.95]]]])},
    ...     coords={"method": ["default"], "family": ["fbm"], "hurst": [0.3, 0.8], "size": [128]},
    ... )
    >>> (upper,), (lower,) = fc.plotting.estimator_errors(bench)
    >>> print(upper.get_title(), "|", lower.get_xlabel())
    fbm, n = 128 | true Hurst exponent
    """
    data = as_dataset(bench, "estimator_errors", "bench")
    require_variables(data, "estimator_errors", ("error_ratio", "interval_coverage"), "bench")
    dims = {dim: dim for dim in ("method", "family", "hurst", "size")}
    require_dims(data, "estimator_errors", dims, "bench")
    with Problems("fc.plotting.estimator_errors") as problems:
        for dim in dims:
            problems.require(data.sizes[dim] > 0, f"bench.{dim}", "at least one entry", NONE)
    families, sizes = words(data["family"]), data["size"].values
    cases = list(product(range(len(families)), range(len(sizes))))
    size = (2.3 * len(cases) + 1.6, 5.2)
    shown = _style.panels(axes, (2, len(cases)), size, sharex=True, sharey="row", height_ratios=(2.0, 1.0))
    styles = {
        name.replace("_", " "): _method_style(number) | {"ls": "-" if number < len(_style.cycle()) else "--"}
        for number, name in enumerate(words(data["method"]))
    }
    for (upper, lower), (i, j) in zip(shown.T, cases, strict=True):
        case = data.isel(family=i, size=j)
        for ax, quantity in ((upper, "error_ratio"), (lower, "interval_coverage")):
            _curves_against_hurst(ax, case, quantity, styles)
        upper.set_yscale("log")
        upper.axhline(1.0, color=_style.ink(), lw=0.9, ls=":")
        lower.axhline(0.95, color=_style.ink(), lw=0.9, ls=":")
        _style.plain_ticks(upper)
        upper.set_title(f"{families[i]}, n = {sizes[j]}")
        label_axis(lower.xaxis, "true Hurst exponent", PLAIN)
    label_axis(shown[0, 0].yaxis, "rms error / Cramér-Rao bound", PLAIN)
    label_axis(shown[1, 0].yaxis, "interval coverage", PLAIN)
    entries = [_style.legend_line(name, **style) for name, style in styles.items()]
    _style.side_legend(shown[0, -1], entries)
    return shown


def _curves_against_hurst(ax: Axes, case: xr.Dataset, quantity: str, styles: dict[str, Any]) -> None:
    dims = ("method", "hurst")
    hurst = np.asarray(case["hurst"].values, float)
    values = table(case, quantity, dims)
    for row, (name, style) in enumerate(styles.items()):
        finite = np.isfinite(values[row])
        if not finite.any():
            continue
        ax.plot(hurst[finite], values[row][finite], **style, label=name)
        ends = [f"{quantity}_{end}" for end in ("low", "high")]
        if set(ends) <= set(case.variables):
            low, high = (table(case, end, dims)[row][finite] for end in ends)
            ax.vlines(hurst[finite], low, high, color=style["color"], lw=0.8, label=f"{name}, interval")
