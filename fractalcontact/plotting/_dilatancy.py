"""A joint under shear: dilatancy, loss of correlation of the faces, dimension of the delta-surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fractalcontact.plotting import _paths, _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import nearest, quantity, result_of, table, words
from fractalcontact.plotting._line_panel import BAND_OPACITY, Family, LinePanel, distinct
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Units


@figure
def dilatancy(
    dilatancy: Any,
    *,
    direction: str | float | None = None,
    reach: float | None = None,
    marked: Sequence[float] = (),
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the dilatancy of a joint against shear displacement.

    Under constant normal force there is one curve per force, and a black one for rigid surfaces. Without
    forces there is one curve per direction for rigid surfaces; thin dotted lines show the rise along the
    mean plane, unless the faces are level.

    Parameters
    ----------
    dilatancy : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy`: rigid_dilatancy (m) over (direction, shear), optionally
        mean_slope over direction; with forces dilatancy (m) over (direction, shear, step).
    direction : str or float, optional
        Direction to draw: a word or degrees anticlockwise from E. Required with forces if there are several.
    marked : sequence of float
        Shear displacements (m) to mark A, B, C ... on the curve of the last force.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> result = fc.joints.dilatancy(crack, shear=[0.0, 2e-4], direction="E", normal_force=[1.0, 10.0])
    >>> ax = fc.plotting.dilatancy(result)
    >>> print(ax.get_ylabel(), "|", len(ax.lines), "curves")
    dilatancy $\delta$ (µm) | 3 curves
    """
    data = _paths.select_direction(dilatancy, direction, units, "dilatancy")
    data = _paths.limit_shear(data, reach)
    if "dilatancy" in data:
        return _of_elastic_bodies(data, marked, ax)
    return _of_rigid_surfaces(data, ax)


def _of_rigid_surfaces(data: Any, ax: Axes | None) -> Axes:
    dims = ("direction", "shear")
    data = result_of(data, ("rigid_dilatancy", "shear"), dims, argument="dilatancy")
    panel = LinePanel.of(ax, data, "shear", "rigid_dilatancy", dims, _paths.by_direction(data))
    panel.curves("rigid dilatancy")
    if "mean_slope" in data:
        ends = np.array([0.0, np.nanmax(panel.x.values)])
        rise = table(data, "mean_slope", dims[:1])[:, None] * ends
        height = np.nanmax(panel.y.values, initial=0.0)
        if np.nanmax(np.abs(rise), initial=0.0) > 0.005 * height:  # less lies on the axis, of a level face
            panel.curves("mean slope", rise, ends, key="mean slope", **_style.DOTTED)
    return panel.finish()


def _of_elastic_bodies(data: Any, marked: Sequence[float], ax: Axes | None) -> Axes:
    data = result_of(data, ("dilatancy", "shear"), ("shear", "step"), argument="dilatancy")
    loads, points, shear = _paths.by_load(data), _style.MAX_MARKED_POINTS, table(data, "shear", ("shear",))
    panel = LinePanel.of(ax, data, "shear", "dilatancy", ("step", "shear"), loads, points=points)
    panel.curves("dilatancy")
    if "rigid_dilatancy" in data:
        style = {"color": _style.ink(), "lw": _style.THIN}
        panel.line("rigid", shear, table(data, "rigid_dilatancy", ("shear",)), **style)
        panel.family = Family([style, *loads.styles], ["0 (rigid)", *loads.labels], loads.name, loads.unit)
    if "direction" in data.coords:
        panel.ax.set_title(f"block slides {_paths.direction_name(words(data['direction'])[0])}")
    for number, target in enumerate(marked):
        index = nearest(shear, target)
        if np.isclose(shear[index], target, rtol=1e-6, atol=0.0):
            panel.mark(shear[[index]], panel.y.values[-1, [index]], loads.styles[-1]["color"], number)
    return panel.finish()


LENGTHS = ("decorrelation_length_low", "decorrelation_length", "decorrelation_length_high")
DIMENSIONS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


@figure
def correlation(memory: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the correlation of the two faces of a joint against shear displacement.

    Vertical dotted lines show the decorrelation lengths, and bands their intervals.

    Parameters
    ----------
    memory : Dataset or node of a DataTree
        From `fractalcontact.joints.decorrelation_length`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=3.2e-3)
    >>> result = fc.joints.decorrelation_length(crack, direction="E")
    >>> ax = fc.plotting.correlation(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (mm) | correlation of the faces
    """
    names, dims = ("correlation", "shear", *LENGTHS), ("direction", "shear")
    data = result_of(memory, names, dims, units, "memory")
    family, name = _paths.by_direction(data), "correlation of the faces"
    panel = LinePanel.of(ax, data, "shear", "correlation", dims, family, y_name=name, points=0)
    panel.curves("")
    ends = [table(data.isel(shear=0), name, ("direction",)) for name in LENGTHS]
    for own, low, length, high in zip(panel.family.styles, *ends, strict=True):
        if np.isfinite(length):
            panel.place(length, color=own["color"], **_style.DOTTED)
        if np.isfinite(low) and np.isfinite(high):
            panel.ax.axvspan(*panel.x.scale([low, high]), color=own["color"], alpha=BAND_OPACITY, lw=0)
    panel.level(0.0, color=_style.grey(), lw=0.6)
    panel.key("decorrelation length", **_style.DOTTED)
    return panel.finish()


@figure
def delta_dimension(dimension: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the fractal dimension of the delta-surface against shear displacement, one curve per method.

    Parameters
    ----------
    dimension : Dataset or node of a DataTree
        From `fractalcontact.joints.delta_dimension`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> names = ("covering_dimension", "variogram_dimension", "spectrum_dimension")
    >>> result = xr.Dataset({name: ("shear", [2.1, 2.2]) for name in names}, {"shear": [1e-4, 1e-3]})
    >>> ax = fc.plotting.delta_dimension(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (mm) | dimension of the delta-surface
    """
    data = result_of(dimension, (*DIMENSIONS, "shear"), ("shear",), units, "dimension")
    shear = quantity(data, "shear", ("shear",))
    values = quantity(data, DIMENSIONS[0], ("shear",), "dimension of the delta-surface")
    methods = distinct([name.split("_")[0] for name in DIMENSIONS], "method")
    panel = LinePanel.of(ax, data, shear, values, ("shear",), methods)
    for name, method, own, marker in zip(DIMENSIONS, methods.labels, methods.styles, "osD", strict=True):
        panel.line(method, shear.values, panel.values(name), marker=marker, ms=3.5, **own)
    return panel.finish(log="x" if float(data["shear"].min()) > 0 else "")
