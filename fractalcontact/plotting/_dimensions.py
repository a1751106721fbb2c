"""Scaling curves of a surface with their fits, and the estimated fractal dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import as_dataset, result_of, table, words
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

SCALES = ("lag", "wavenumber", "cube_size", "window_size", "divider", "box_length", "box_size")
# log-log slope of each curve: a H + b d + c, with the Hurst exponent H and d = 3 for a surface, 2 for a
# profile; the first name present in a Dataset is its curve
CURVES = {
    "power_spectral_density": (-2.0, -1.0, 1.0),
    "profile_power_spectral_density": (-2.0, 0.0, -1.0),
    "second_variogram": (2.0, 0.0, 0.0),
    "variogram": (2.0, 0.0, 0.0),
    "madogram": (1.0, 0.0, 0.0),
    "cube_count": (1.0, -1.0, 0.0),
    "roughness": (1.0, 0.0, 0.0),
    "variation": (1.0, 0.0, 0.0),
    "higuchi_length": (1.0, 0.0, -2.0),
    "fluctuation": (1.0, 0.0, 0.0),
    "divider_length": (1.0, 0.0, -1.0),
    "covering_area": (1.0, 0.0, -1.0),
    "covering_length": (1.0, 0.0, -1.0),
}
NARROW = 0.1  # the axis of dimensions is at least this long: nearly equal ones must not look different
CLIPPED = 10  # per cent of the local slopes at either end that may lie outside the axis


@_style.checked
def dimension_curves(
    curves: Any, estimates: Any = None, *, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw scaling curves with their local slopes, and the fitted window and slope.

    Parameters
    ----------
    curves : mapping of str to Dataset, Dataset, or node of a DataTree
        From `fractalcontact.dimensions.spectrum`, `.variogram`, `.cube_counts` ..., by name. The node
        /dimensions of a study holds the curves as children, and the estimates.
    estimates : Dataset, optional
        From `fractalcontact.dimensions.estimate`. For a method of the same name its window (scale_min,
        scale_max, in m) is shaded, and the slope of its exponent is drawn in that window and written.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        There is no curve.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> (upper,), (lower,) = fc.plotting.dimension_curves(fc.dimensions.variogram(surface))
    >>> print(upper.get_ylabel(), "|", lower.get_xlabel())
    variogram (µm²) | lag (mm)
    """
    curves = shown_in(curves, units, "dimension_curves")
    datasets, fits = _curves_in(curves, estimates)
    names = list(datasets)
    columns = _style.number_of_columns(len(names))
    rows = -(-len(names) // columns)
    width = 2.7 * columns + (0.4 if columns > 1 else 1.6)
    shown = _curve_panels(axes, len(names), rows, columns, (width, 3.7 * rows))
    for name, (upper, lower) in zip(names, shown.T, strict=True):
        _draw_curve(upper, lower, name, datasets[name], _fit_of(fits, name))
    return shown


def _curve_panels(
    axes: Panels | None, count: int, rows: int, columns: int, size: tuple[float, float]
) -> AxesArray:
    """Return two rows of Axes: for the curves, and for the local slopes below each of them."""
    if _style.are_given(axes):
        return _style.panels(axes, (2, count), size)
    made = _style.panels(axes, (2 * rows, columns), size, height_ratios=(2.2, 1.0) * rows)
    pairs = made.reshape(rows, 2, columns).transpose(1, 0, 2).reshape(2, rows * columns)
    for unused in pairs[:, count:].ravel():
        unused.remove()
    return pairs[:, :count]


ESTIMATES = ("hurst", "fractal_dimension", "scale_min", "scale_max")


def _curves_in(curves: Any, estimates: Any) -> tuple[dict[str, xr.Dataset], xr.Dataset | None]:
    datasets: dict[str, xr.Dataset] = {}
    if isinstance(curves, xr.DataTree) and curves.children:
        datasets = {name: node.to_dataset(inherit=False) for name, node in curves.children.items()}
        estimates = curves.to_dataset() if estimates is None and curves.has_data else estimates
    elif isinstance(curves, Mapping) and not isinstance(curves, xr.Dataset | xr.DataTree):
        datasets = {
            str(name): as_dataset(curve, "dimension_curves", "curves") for name, curve in curves.items()
        }
    else:
        dataset = as_dataset(curves, "dimension_curves", "curves")
        datasets = {curve_of(dataset)[1]: dataset}
    datasets = {name: curve for name, curve in datasets.items() if curve_of(curve)[1]}
    with Problems("fc.plotting.dimension_curves") as problems:
        problems.require(bool(datasets), "curves", f"a variable out of {', '.join(CURVES)}", NONE)
    if estimates is None:
        return datasets, None
    return datasets, result_of(estimates, "dimension_curves", ESTIMATES, ("method",), "estimates")


def curve_of(curve: xr.Dataset) -> tuple[str, str]:
    """Return the names of scale and quantity of a scaling curve; empty if there is none."""
    for value in CURVES:
        if value in curve.data_vars:
            for scale in SCALES:
                if scale in curve.variables and set(curve[scale].dims) <= set(curve[value].dims):
                    return scale, value
    return "", ""


def _fit_of(estimates: xr.Dataset | None, name: str) -> xr.Dataset | None:
    if estimates is None or "method" not in estimates.dims:
        return None
    methods = words(estimates["method"])
    return estimates.isel(method=methods.index(name)) if name in methods else None


def _draw_curve(upper: Axes, lower: Axes, name: str, curve: xr.Dataset, fit: xr.Dataset | None) -> None:
    scale, value = curve_of(curve)
    curve = result_of(curve, "dimension_curves", (scale, value), (), "curves")
    with Problems("fc.plotting.dimension_curves") as problems:
        problems.require(curve[scale].ndim == 1, "curves", f"{scale} along one dim", curve[scale].dims)
    dim = curve[scale].dims[0]
    x, y = np.asarray(curve[scale].values, float), table(curve, value, (dim,))
    along, across = scale_of(curve[scale]), scale_of(curve[value])
    marker = "." if x.size <= 60 else ""
    upper.plot(along(x), across(y), color=_style.BLUE, marker=marker, lw=1.2, label="curve")
    if "local_slope" in curve:
        slopes = table(curve, "local_slope", (dim,))
        lower.plot(along(x), slopes, color=_style.BLUE, lw=1.0, marker=marker, label="local slope")
        _slope_limits(lower, slopes)
    for ax in (upper, lower):
        _style.log_scale(ax, x=x)
    _style.log_scale(upper, y=y)
    if fit is not None:
        _draw_fit(upper, lower, fit, (scale, value), (x, y), (along, across))
    upper.set_title(name.replace("_", " "))
    label_axis(upper.yaxis, name_of(curve[value]), across)
    upper.tick_params(labelbottom=False)
    lower.set_xlim(upper.get_xlim())
    label_axis(lower.xaxis, name_of(curve[scale]), along)
    label_axis(lower.yaxis, "local slope", PLAIN)
    for ax in (upper, lower):
        _style.plain_ticks(ax)
    if not np.isfinite(y).any():
        _style.write_in_empty_axes(upper, "no curve")


def _slope_limits(ax: Axes, slopes: Any) -> None:
    """Limit the axis so that noise at the ends of a curve does not compress the rest."""
    finite = slopes[np.isfinite(slopes)]
    if finite.size:
        low, high = np.percentile(finite, (CLIPPED, 100 - CLIPPED))
        margin = max(0.4 * (high - low), 0.05)
        ax.set_ylim(low - margin, high + margin)


def _draw_fit(
    upper: Axes,
    lower: Axes,
    fit: xr.Dataset,
    names: tuple[str, str],
    curve: tuple[Any, Any],
    shown: tuple[Any, Any],
) -> None:
    """Shade the window of the fit, draw its slope through the curve, and write its value."""
    window = np.sort([float(fit["scale_min"]), float(fit["scale_max"])])
    if names[0] == "wavenumber":
        window = np.sort(2 * np.pi / window)
    if not np.isfinite(window).all():
        return
    for ax in (upper, lower):
        ax.axvspan(*shown[0](window), color=_style.pale(), alpha=0.55, lw=0, zorder=0)
    x, y = curve
    inside = (x >= window[0] * (1 - 1e-9)) & (x <= window[1] * (1 + 1e-9)) & (x > 0) & (y > 0)
    hurst, dimension = float(fit["hurst"]), float(fit["fractal_dimension"])
    if not inside.any() or not np.isfinite(hurst):
        return
    a, b, c = CURVES[names[1]]
    slope = a * float(fit.get("fitted_hurst", hurst)) + b * (hurst + dimension) + c
    level = np.mean(np.log(y[inside]) - slope * np.log(x[inside]))
    ends = np.array([x[inside].min(), x[inside].max()])
    fitted = shown[1](np.exp(level + slope * np.log(ends)))
    upper.plot(shown[0](ends), fitted, color=_style.RED, lw=1.4, label="fit")
    lower.plot(shown[0](ends), [slope] * 2, color=_style.RED, lw=1.2, label="fit")
    text = f"slope {slope:.2f}\n" + rf"$\Delta$ = {dimension:.2f}"
    right = slope < 0
    upper.text(0.96 if right else 0.04, 0.96, text, transform=upper.transAxes, va="top", color=_style.RED,
               ha="right" if right else "left")  # fmt: skip


@_style.checked
def dimensions(
    estimates: Any,
    *,
    truth: float | None = None,
    band: tuple[float, float] | None = None,
    band_name: str = "for comparison",
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the fractal dimension estimated by each method with its 95 % interval.

    A method without a validated interval is drawn as an open circle. A fit beyond the range of fractals is
    drawn at the limit as a triangle that points out of the range.

    Parameters
    ----------
    estimates : Dataset or node of a DataTree
        From `fractalcontact.dimensions.estimate`: hurst, fractal_dimension, ci_low, ci_high (of the Hurst
        exponent) over `method`.
    truth : float, optional
        True dimension, drawn as a line.
    band : pair of float, optional
        Range of dimensions for comparison, shaded.
    band_name : str
        What the range is, for the legend.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> estimates = fc.dimensions.estimate(surface, ["default", "variogram"])
    >>> ax = fc.plotting.dimensions(estimates, truth=2.2)
    >>> print([label.get_text() for label in ax.get_yticklabels()], "|", ax.get_xlabel())
    ['default', 'variogram'] | fractal dimension $\Delta$
    """
    data = result_of(
        estimates, "dimensions", ("method", "hurst", "fractal_dimension"), ("method",), "estimates"
    )
    from matplotlib.patches import Patch

    names = words(data["method"])
    ax = _style.axes_or_new(ax, (_style.PANEL[0], 1.0 + 0.32 * len(names)))
    value, hurst = table(data, "fractal_dimension", ("method",)), table(data, "hurst", ("method",))
    embedding = value + hurst  # 3 for a surface, 2 for a profile
    missing = np.full(value.shape, np.nan)
    low = embedding - table(data, "ci_high", ("method",)) if "ci_high" in data else missing
    high = embedding - table(data, "ci_low", ("method",)) if "ci_low" in data else missing
    rows = np.arange(len(names))[::-1]
    has_interval = np.isfinite(low) & np.isfinite(high)
    ends = low[has_interval], high[has_interval]
    ax.hlines(rows[has_interval], *ends, color=_style.BLUE, lw=2.2, label="95 % interval")
    fitted = table(data, "fitted_hurst", ("method",)) if "fitted_hurst" in data else hurst
    beyond = (hurst >= 1) | (fitted > 1), (hurst <= 0) | (fitted < 0)
    smooth, rough = (np.isfinite(value) & side for side in beyond)
    inside = ~(smooth | rough)
    hollow: dict[str, Any] = {"ls": "", "mfc": _style.tone(0.0), "mec": _style.BLUE, "ms": 6}
    closed = has_interval & inside
    ax.plot(value[closed], rows[closed], "o", color=_style.BLUE, ms=6, label="estimate")
    bare = ~has_interval & inside
    ax.plot(value[bare], rows[bare], marker="o", label="estimate without interval", **hollow)
    for side, marker in ((smooth, "<"), (rough, ">")):
        ax.plot(value[side], rows[side], marker=marker, label="at the limit: no dimension", **hollow)
    entries = (
        [_style.legend_line("95 % interval", color=_style.BLUE, lw=2.2, marker="o")]
        if has_interval.any()
        else []
    )
    if bare.any():
        entries.append(_style.legend_line("no interval", marker="o", **hollow))
    if not inside.all():
        marker = "<" if smooth.any() else ">"
        entries.append(_style.legend_line("at the limit:\nno dimension", marker=marker, **hollow))
    if band is not None:
        entries.append(Patch(facecolor=_style.pale(), lw=0, label=band_name))
        ax.axvspan(*band, color=_style.pale(), lw=0, zorder=0)
    if truth is not None:
        ax.axvline(truth, color=_style.ink(), lw=0.9, ls=":")
        entries.append(_style.legend_line("true", color=_style.ink(), lw=0.9, ls=":"))
    low_end, high_end = ax.get_xlim()
    wider = max(NARROW - (high_end - low_end), 0.0) / 2
    ax.set_xlim(low_end - wider, high_end + wider)
    ax.set_yticks(rows, [name.replace("_", " ") for name in names])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.grid(False, axis="y")
    ax.locator_params(axis="x", nbins=6)  # more labels, of three decimals, would touch
    label_axis(ax.xaxis, name_of(data["fractal_dimension"]), PLAIN)
    _style.side_legend(ax, entries)
    return ax
