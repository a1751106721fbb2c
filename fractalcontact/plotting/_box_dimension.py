"""Dimensions of a contact domain against load and shear."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import as_dataset, quantity, result_of, table
from fractalcontact.plotting._line_panel import Family, LinePanel
from fractalcontact.plotting._paths import PATH, at_force, by_shear, load_of, load_text, loads_of
from fractalcontact.plotting._size_curves import CELLS_NULL, as_array, path_panels
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import Units

DIMENSIONS = ("box_dimension", "minkowski_dimension", "correlation_dimension", "boundary_dimension")
INTERVAL = ("ci_low", "ci_high")
WIDE_INTERVAL = 0.5  # width of an interval beyond which a point is drawn open


@figure
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
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> (ax,) = fc.plotting.box_dimension(fc.domains.box_dimension(mask))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    coverage (%) | box dimension $\Delta_\sigma$
    """
    dataset = as_dataset(result, "box_dimension")
    present = [name for name in DIMENSIONS if name in dataset]
    data = result_of(dataset, "box_dimension", (present or DIMENSIONS)[:1], PATH, units)
    shown, shears = path_panels(axes, data), by_shear(data)
    first, *_, last = (*shown.values(), *shown.values())
    for dim, ax in shown.items():
        if dim == "step":
            panel = _draw_dimension(ax, data, present[0], PATH, shears)
        else:
            path = at_force(data, normal_force)
            load = load_text(path, data)
            family = Family([{"color": _style.ink()}], [load] if load else [])
            panel = _draw_dimension(ax, path.expand_dims("step"), present[0], PATH[::-1], family)
            ax.set_title(load)
        if ax is not first:
            ax.set_ylabel("")
        panel.family = shears if data.sizes["step"] > 1 else Family([])
        log = "x" if _style.needs_log_axis(panel.x.values) else ""
        panel.finish(log=log, legend=ax is last, empty="no contact")
        ax.set_ylim(-0.05, 2.05)
    return as_array(shown)


def _draw_dimension(
    ax: Axes, path: xr.Dataset, name: str, dims: tuple[str, str], family: Family
) -> LinePanel:
    """Draw one curve for each of the family with its random null, its points and, if alone, its interval."""
    load = "shear" if dims[1] == "shear" else load_of(path) or "coverage"
    x, y = loads_of(path, load, "box_dimension", dims), quantity(path, name, dims)
    panel = LinePanel(ax, x, y, family, points=0)
    reliable, described = np.full(y.values.shape, True), "interval wider than 0.5, or none"
    panel.key("contact domain", marker="o")
    if set(INTERVAL) <= path.variables.keys():
        low, high = (table(path, end, dims) for end in INTERVAL)
        reliable = high - low <= WIDE_INTERVAL
        panel.area_key("interval", facecolor=_style.grey(), alpha=0.25)
        if len(y.values) == 1:
            panel.band(family.curve("interval"), x.values[0], low[0], high[0], family.styles[0]["color"])
    if "follows_power_law" in path:
        reliable = reliable & (table(path, "follows_power_law", dims) != 0)
        described = "no power law, or wide interval"
    panel.curves("contact domain", x.values, y.values)
    if y.values.shape[1] <= _style.MAX_MARKED_POINTS:
        for i, own in enumerate(family.styles):
            panel.flagged("_points", x.values[i], y.values[i], reliable[i], **own)
    if not reliable[np.isfinite(y.values)].all():
        panel.key(described, ls="", marker="o", mfc=_style.tone(0.0))
    if "null_dimension" in path:
        panel.curves(
            "random null", x.values, table(path, "null_dimension", dims), key=CELLS_NULL, **_style.DASHED
        )
    return panel
