"""Roughness of a surface: scaling curves, fractal dimensions, the exponent by scale, facets by direction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import is_within
from fractalcontact.base.validation import require
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import StudyFigure, figure
from fractalcontact.plotting._inputs import by_name, quantity, require_dims, result_of, table, words
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units, scale_of

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
ESTIMATES = ("hurst", "fractal_dimension", "scale_min", "scale_max")


@figure
def dimension_curves(
    result: Any, *, estimates: Any = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw scaling curves with their local slopes, and the fitted window and slope."""
    datasets, fits = _curves_in(result, estimates, units)
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


def _curves_in(
    curves: Any, estimates: Any, units: Units | None
) -> tuple[dict[str, xr.Dataset], xr.Dataset | None]:
    """Return the scaling curves by name, and the estimates."""
    if isinstance(curves, xr.DataTree) and curves.children and curves.has_data and estimates is None:
        estimates = curves.to_dataset()
    named = by_name(curves, units).items()
    datasets = {name or curve_of(curve)[1]: curve for name, curve in named if curve_of(curve)[1]}
    require(bool(datasets), "result", f"a variable out of {', '.join(CURVES)}")
    if estimates is not None:
        estimates = result_of(estimates, ESTIMATES, ("method",), argument="estimates")
    return datasets, estimates


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
    curve = result_of(curve, (scale, value), ())
    require(curve[scale].ndim == 1, "result", f"{scale} along one dim", curve[scale].dims)
    dims = curve[scale].dims
    x, y = quantity(curve, scale, dims), quantity(curve, value, dims)
    y = replace(y, width=28)  # the upper panel has two thirds of the height
    slopes = table(curve, "local_slope", dims) if "local_slope" in curve else np.full(y.values.shape, np.nan)
    style = {"color": _style.BLUE, "marker": "." if x.values.size <= _style.MOST_DOTS else ""}
    above = LinePanel(upper, curve, x, y, dims)
    below = LinePanel(lower, curve, x, Quantity(slopes, PLAIN, "local slope"), dims)
    above.line("curve", x.values, y.values, lw=1.2, **style)
    below.line("local slope", x.values, slopes, lw=1.0, **style)
    _slope_limits(lower, slopes)
    if fit is not None:
        _draw_fit(above, below, fit, (scale, value))
    above.finish(log="xy", empty="no curve")
    lower.set_xscale(upper.get_xscale())
    lower.set_xlim(upper.get_xlim())
    below.finish(log="x", empty="")
    upper.set_title(name.replace("_", " "))
    upper.set_xlabel("")
    upper.tick_params(labelbottom=False)


def _slope_limits(ax: Axes, slopes: Any, clipped: float = 10.0) -> None:
    """Limit the axis so that noise at the ends of a curve does not compress the rest.

    So many per cent of the slopes at either end may lie outside it: of 20 the two lowest and the two highest.
    """
    finite = slopes[np.isfinite(slopes)]
    if finite.size:
        low, high = np.percentile(finite, (clipped, 100 - clipped))
        margin = max(0.4 * (high - low), 0.05)  # an axis of a tenth at least
        ax.set_ylim(low - margin, high + margin)


def _draw_fit(above: LinePanel, below: LinePanel, fit: xr.Dataset, names: tuple[str, str]) -> None:
    """Shade the window of the fit, draw its slope through the curve, and write its value."""
    window = np.sort([float(fit["scale_min"]), float(fit["scale_max"])])
    if names[0] == "wavenumber":
        window = np.sort(2 * np.pi / window)
    if not np.isfinite(window).all():
        return
    for panel in (above, below):
        panel.ax.axvspan(*panel.x.scale(window), color=_style.pale(), alpha=0.55, lw=0, zorder=0)
    x, y = above.x.values, above.y.values
    inside = is_within(x, *window) & (x > 0) & (y > 0)
    hurst, dimension = float(fit["hurst"]), float(fit["fractal_dimension"])
    if not inside.any() or not np.isfinite(hurst):
        return
    a, b, c = CURVES[names[1]]
    slope = a * float(fit.get("fitted_hurst", hurst)) + b * (hurst + dimension) + c
    level = np.mean(np.log(y[inside]) - slope * np.log(x[inside]))
    ends = np.array([x[inside].min(), x[inside].max()])
    style = {"color": _style.RED, "marker": ""}
    above.line("fit", ends, np.exp(level + slope * np.log(ends)), lw=1.4, **style)
    below.line("fit", ends, [slope] * 2, lw=1.2, **style)
    text = f"slope {slope:.2f}\n" + f"$D$ = {dimension:.2f}"
    place, side = (0.96, "right") if slope < 0 else (0.04, "left")
    above.ax.text(place, 0.96, text, transform=above.ax.transAxes, va="top", color=_style.RED, ha=side)


@figure
def dimensions(
    result: Any,
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
    result : Dataset or node of a DataTree
        From `fractalcontact.dimensions.estimate`: hurst, fractal_dimension, ci_low, ci_high (of the Hurst
        exponent) over `method`.
    truth : float, optional
        True dimension, drawn as a line.
    band : pair of float, optional
        Range of dimensions for comparison, shaded.
    band_name : str
        What the range is, for the legend.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> estimates = fc.dimensions.estimate(surface, ["default", "variogram"])
    >>> ax = fc.plotting.dimensions(estimates, truth=2.2)
    >>> print([label.get_text() for label in ax.get_yticklabels()], "|", ax.get_xlabel())
    ['default', 'variogram'] | fractal dimension $D$
    """
    names, dims = ("method", "hurst", "fractal_dimension"), ("method",)
    data = result_of(result, names, dims)
    methods = words(data["method"])
    value, hurst = quantity(data, "fractal_dimension", dims), table(data, "hurst", dims)
    rows = np.arange(len(methods))[::-1]
    size = (_style.PANEL[0], 1.0 + 0.32 * len(methods))
    panel = LinePanel(_style.axes_or_new(ax, size), data, value, Quantity(rows, PLAIN, ""), dims)
    embedding = value.values + hurst  # 3 for a surface, 2 for a profile
    low, high = (
        embedding - (table(data, end, dims) if end in data else np.nan) for end in ("ci_high", "ci_low")
    )
    has_interval = np.isfinite(low) & np.isfinite(high)
    ends = low[has_interval], high[has_interval]
    panel.ax.hlines(rows[has_interval], *ends, color=_style.BLUE, lw=2.2, label="95 % interval")
    if has_interval.any():
        panel.key("95 % interval", color=_style.BLUE, lw=2.2, marker="o")
    fitted = table(data, "fitted_hurst", dims) if "fitted_hurst" in data else hurst
    smooth, rough = (np.isfinite(value.values) & side
                     for side in ((hurst >= 1) | (fitted > 1), (hurst <= 0) | (fitted < 0)))  # fmt: skip
    inside = ~(smooth | rough)
    filled: dict[str, Any] = {"color": _style.BLUE, "ls": "", "ms": 6}
    hollow = filled | {"mfc": _style.tone(0.0)}
    for shown, name, key, marker, style in (
        (inside & has_interval, "estimate", "", "o", filled),
        (inside & ~has_interval, "estimate without interval", "no interval", "o", hollow),
        (smooth, "at the limit: no dimension", "at the limit: no dimension", "<", hollow),
        (rough, "at the limit: no dimension", "at the limit: no dimension", ">", hollow),
    ):
        if shown.any():
            panel.line(name, value.values[shown], rows[shown], key=key, marker=marker, **style)
    if band is not None:
        panel.area_key(band_name, facecolor=_style.pale())
        panel.ax.axvspan(*band, color=_style.pale(), lw=0, zorder=0)
    if truth is not None:
        panel.place(truth, key="true", color=_style.ink(), **_style.DOTTED)
    low_end, high_end = panel.ax.get_xlim()
    # at least .1 long: nearly equal dimensions must not look different
    wider = max(0.1 - (high_end - low_end), 0.0) / 2
    panel.ax.set_xlim(low_end - wider, high_end + wider)
    panel.ax.set_yticks(rows, [name.replace("_", " ") for name in methods])
    panel.ax.set_ylim(-0.6, len(methods) - 0.4)
    panel.ax.grid(False, axis="y")
    panel.ax.locator_params(axis="x", nbins=6)  # more labels, of three decimals, would touch
    return panel.finish(empty="")


WINDOW = ("window_hurst", "window_ci_low", "window_ci_high", "scale_min", "scale_max")


@figure
def scaling(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the Hurst exponent of every octave of wavelength with its interval.

    The band is the exponent of `dimensions.estimate`, as wide as the waves that its model describes and as
    high as its interval. The range of fractals, 0 to 1, lies between the dotted lines.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.dimensions.scaling`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> ax = fc.plotting.scaling(fc.dimensions.scaling(surface))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    wavelength (mm) | Hurst exponent
    """
    dims = ("wavelength",)
    data = result_of(result, ("hurst", "ci_low", "ci_high", *dims, *WINDOW), dims, units)
    panel = LinePanel(ax, data, "wavelength", "hurst", dims, y_name="Hurst exponent", points=0)
    wavelength, hurst = panel.x.values, panel.y.values
    points: dict[str, Any] = {"color": _style.ink(), "marker": "o", "ms": 3.5, "lw": 1.0}
    low, high = map(panel.values, ("ci_low", "ci_high"))
    # of an interval beside its value one end shows
    ends = np.fmin(low, hurst), np.fmax(high, hurst)
    panel.bars("octave, 95 %, interval", wavelength, *ends, color=_style.ink(), lw=1.0)
    panel.line("octave, 95 %", wavelength, hurst, **(points | {"ls": ""}))
    panel.key("octave, 95 %", **points)
    window_hurst, bottom, top, *window = (float(table(data, name, ())) for name in WINDOW)
    if np.isfinite(window_hurst):
        panel.band("one exponent, 95 %", window, bottom, top, _style.BLUE, alpha=0.35)
        panel.line("one exponent", window, 2 * [window_hurst], color=_style.BLUE, lw=1.2)
        panel.area_key("one exponent", facecolor=_style.BLUE, alpha=0.35)
    for limit in (0.0, 1.0):
        panel.level(limit, color=_style.grey(), lw=0.7, ls=":")
    panel.ax.set_xscale("log")
    bottom, top = panel.ax.get_ylim()
    panel.ax.set_ylim(max(bottom, -1.5), min(top, 2.5))  # far beyond 0 and 1 an exponent says no more
    return panel.finish(log="x")


COMPASS = ("E", "45°", "N", "135°", "W", "225°", "S", "315°")
DIRECTIONAL: dict[str, tuple[str, dict[str, Any]]] = {
    "roughness_metric": ("$\\theta^*_{max}/(C+1)$", {"color": _style.BLUE, "ls": "-"}),
    "mean_dip": ("mean dip", {"color": _style.RED} | _style.DASHED),
}


@figure
def directional_roughness(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    r"""Draw the directional roughness over the azimuth of the shear, in polar coordinates.

    The distance from the centre is an angle: the metric theta_max/(C+1), and dashed the mean apparent dip
    that faces the shear. The two coincide where the law of the area holds.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.directional_roughness`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=2e-5, rng=1)
    >>> result = fc.joints.directional_roughness(surface)
    >>> ax = fc.plotting.directional_roughness(result)
    >>> [line.get_label() for line in ax.lines]
    ['$\\theta^*_{max}/(C+1)$', 'mean dip']
    """
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator

    data = result_of(result, tuple(DIRECTIONAL), ("azimuth",), units)
    require_dims(data, dict.fromkeys(DIRECTIONAL, "azimuth"))
    polar: Any = _style.axes_or_new(ax, (_style.PANEL[0], _style.MAP[1]), projection="polar")
    require(polar.name == "polar", "ax", "polar axes (projection='polar')", polar.name)
    azimuth = data["azimuth"].values
    order = np.argsort(azimuth % 360.0)
    if _is_full_circle(azimuth):
        order = np.append(order, order[0])
    angle = scale_of(data[next(iter(DIRECTIONAL))])
    for name, (label, style) in DIRECTIONAL.items():
        polar.plot(np.radians(azimuth[order]), angle(data[name].values[order]), label=label, **style)
    greatest = float(np.nan_to_num([float(angle(data[name].max())) for name in DIRECTIONAL]).max())
    polar.set_ylim(0.0, 1.12 * greatest or 1.0)
    rings = np.asarray(MaxNLocator(4).tick_values(0.0, polar.get_ylim()[1]))  # labels of 4 stay apart
    polar.set_rticks(rings[(rings > 0) & (rings <= polar.get_ylim()[1])])
    polar.set_thetagrids(np.arange(0, 360, 45), COMPASS)
    polar.yaxis.set_major_formatter("{x:g}" + (angle.unit if angle.unit == "°" else f" {angle.unit}"))
    polar.yaxis.units, polar.yaxis.factor = angle.unit, angle.factor
    polar.set_rlabel_position(22.5)
    halo = withStroke(linewidth=2.0, foreground=_style.tone(0.0))  # of labels that cross a line
    for tick_label in polar.get_yticklabels():
        tick_label.set_path_effects([halo])
    _style.side_legend(polar, polar.lines)
    drawn: Axes = polar
    return drawn


def _is_full_circle(azimuth: Any) -> bool:
    """Return whether no gap between neighbouring azimuths is longer than 90 degrees."""
    angles = np.sort(np.asarray(azimuth, dtype=np.float64) % 360.0)
    gaps = np.diff(np.append(angles, angles[0] + 360.0))
    return bool(gaps.max() <= 90.0)


FIGURES = (
    StudyFigure("dimensions", "dimensions", "hurst", dimensions),
    StudyFigure("dimension_curves", "dimensions/*", "a scaling curve", dimension_curves),
    StudyFigure(
        "directional_roughness", "joints/directional_roughness", "roughness_metric", directional_roughness
    ),
)
