"""Box dimension of a contact domain, and the local slopes it is fitted to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.power_law import local_slope
from fractalcontact.plotting import _style
from fractalcontact.plotting._box_size_curves import as_array, draw_size_curves, path_panels
from fractalcontact.plotting._inputs import as_dataset, require_dims, result_of, table
from fractalcontact.plotting._paths import at_force, curve_name, load_of, load_text, shear_words
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

DIMENSIONS = ("box_dimension", "minkowski_dimension", "correlation_dimension", "boundary_dimension")
WIDE_INTERVAL = 0.5  # width of an interval beyond which a point is drawn open


@_style.checked
def box_dimension(
    result: Any, *, normal_force: float | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    r"""Draw the box dimension of a contact domain against load, and against shear at one force.

    The other dimensions of a domain are drawn in the same way. Dashed lines show the random null: randomly
    placed cells of equal coverage. Bands show the intervals where there is a single curve. A point without
    an interval, or with one wider than 0.5, is open.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension`, `minkowski_dimension`, `correlation_dimension` or
        `boundary_dimension` over (shear, step), or over one of them.
    normal_force : float, optional
        Normal force (N) of the panel against shear; the nearest step is taken. Default: the last step.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. There is one for each of the
        dims that is longer than one. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> (ax,) = fc.plotting.box_dimension(fc.domains.box_dimension(mask))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    coverage (%) | box dimension $\Delta_\sigma$
    """
    result = shown_in(result, units, "box_dimension")
    dataset = as_dataset(result, "box_dimension")
    present = [name for name in DIMENSIONS if name in dataset]
    data = result_of(dataset, "box_dimension", (present or DIMENSIONS)[:1], ("shear", "step"))
    name = present[0]
    shown = path_panels(axes, data)
    colours, shears = _style.sequence_colours(data.sizes["shear"]), shear_words(data)
    for dim, ax in shown.items():
        if dim == "step":
            for i, colour in enumerate(colours):
                place = curve_name("", shears, i)
                _dimension_curve(ax, data.isel(shear=i), name, dim, (colour, place), band=len(colours) == 1)
        else:
            path = at_force(data, normal_force)
            load = load_text(path, data)
            _dimension_curve(ax, path, name, dim, (_style.ink(), f", {load}" if load else ""), band=True)
            ax.set_title(load)
        ax.set_ylim(-0.05, 2.05)
        if not bool(data[name].notnull().any()):
            _style.write_in_empty_axes(ax, "no contact")
    first, *_, last = (*shown.values(), *shown.values())
    label_axis(first.yaxis, name_of(data[name]), PLAIN)
    if data.sizes["step"] > 1:
        _style.sequence_legend(last, *shears, colours)
    _style.side_legend(last, _line_legend(data, name), low=data.sizes["step"] > 1)
    return as_array(shown)


def _line_legend(data: xr.Dataset, name: str) -> list[Any]:
    """Return the legend entries of the line and point styles in use."""
    from matplotlib.patches import Patch

    entries = [_style.legend_line("contact domain", marker="o")]
    if "ci_low" in data and "ci_high" in data:
        entries.append(Patch(facecolor=_style.grey(), alpha=0.25, lw=0, label="interval"))
        uncertain = ~(data["ci_high"] - data["ci_low"] <= WIDE_INTERVAL) & data[name].notnull()
        if bool(uncertain.any()):
            label = f"interval wider than\n{WIDE_INTERVAL:g}, or none"
            entries.append(_style.legend_line(label, ls="", marker="o", mfc=_style.tone(0.0)))
    if "null_dimension" in data:
        entries.append(_style.legend_line("random null,\nequal coverage", **_style.NULL_LINE))
    return entries


def _dimension_curve(
    ax: Axes, path: xr.Dataset, name: str, dim: str, style: tuple[Any, str], *, band: bool
) -> None:
    """Draw one curve in its colour, with its random null, intervals and points, against shear or load."""
    colour, place = style
    load = load_of(path) or ("coverage" if "coverage" in path else dim)
    against = "shear" if dim == "shear" else load
    labelled = against in path.variables
    values = table(path, name, (dim,))
    x = table(path, against, (dim,)) if labelled else np.arange(values.size, dtype=float)
    scale = scale_of(path[against]) if labelled else PLAIN
    certain = np.full(values.shape, True)
    if "ci_low" in path and "ci_high" in path:
        low, high = (table(path, end, (dim,)) for end in ("ci_low", "ci_high"))
        certain = high - low <= WIDE_INTERVAL
        if band:
            ax.fill_between(scale(x), low, high, color=colour, alpha=0.14, lw=0, label=f"interval{place}")
    ax.plot(scale(x), values, color=colour, label=f"contact domain{place}")
    if values.size <= _style.MAX_MARKED_POINTS:
        ax.plot(scale(x)[certain], values[certain], "o", color=colour)
        ax.plot(scale(x)[~certain], values[~certain], "o", mec=colour, mfc=ax.get_facecolor())
    if "null_dimension" in path:
        null = table(path, "null_dimension", (dim,))
        ax.plot(scale(x), null, color=colour, label=f"random null{place}", **_style.NULL_LINE)
    _style.log_x_if_wide(ax, x)
    label_axis(ax.xaxis, name_of(path[against]) if labelled else against, scale)


@_style.checked
def local_slopes(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    """Draw the local dimension against box size, for increasing load and for increasing shear.

    A power law holds where the curve is level. Dashed lines show the random null: randomly placed cells of
    equal coverage. At most six curves are drawn.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.box_dimension`, `box_counts`, `correlation_dimension` or
        `minkowski_dimension` over (shear, step), or without shear or step.
    shear : float, optional
        Shear displacement (m) of the panel of increasing load; the nearest one is taken. Default: the
        middle one.
    normal_force : float, optional
        Normal force (N) of the panel of increasing shear; the nearest step is taken. Default: the last step.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. There is one for each of the
        dims that is longer than one. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> (ax,) = fc.plotting.local_slopes(fc.domains.box_dimension(mask))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    box size (mm) | local dimension
    """
    result = shown_in(result, units, "local_slopes")
    data = result_of(result, "local_slopes", ("local_slope",), ("shear", "step"))
    scale = next((name for name in ("box_size", "radius") if name in data.variables), "box_size")
    nulls = [name for name in ("null_count", "null_mass", "null_fraction") if name in data]
    require_dims(data, "local_slopes", dict.fromkeys(("local_slope", scale, *nulls), scale))
    if "null_count" in data or "null_mass" in data:
        curve, sign = ("null_count", -1.0) if "null_count" in data else ("null_mass", 1.0)
        slope = sign * local_slope(data["box_size"].values, data[curve].values)
        data = data.assign(null_slope=(data[curve].dims, slope))
    elif "null_fraction" in data:
        slope = 2.0 - local_slope(data["radius"].values, data["null_fraction"].values)
        data = data.assign(null_slope=(data["null_fraction"].dims, slope))
    return draw_size_curves(data, shear, normal_force, axes, "local_slope", "null_slope")
