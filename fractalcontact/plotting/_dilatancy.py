"""Dilatancy of a sheared joint: rigid surfaces, and elastic bodies under constant normal force."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._closure import mark_points
from fractalcontact.plotting._directions import direction_styles, limit_shear, select_direction
from fractalcontact.plotting._inputs import nearest, result_of, table
from fractalcontact.plotting._paths import curve_name, load_words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

MEAN_SLOPE_LINE: dict[str, Any] = {"lw": 0.7, "ls": ":"}


@_style.checked
def rigid_dilatancy(dilatancy: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    r"""Draw the dilatancy of rigid surfaces against shear displacement, one curve per direction.

    Thin dotted lines show the rise along the mean plane of the surface.

    Parameters
    ----------
    dilatancy : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy`: rigid_dilatancy (m) over (direction, shear), and optionally
        mean_slope over direction.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> result = fc.joints.dilatancy(crack, shear=[0.0, 2e-4, 4e-4])
    >>> ax = fc.plotting.rigid_dilatancy(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    shear displacement $v$ (µm) | rigid dilatancy $\delta_\mathrm{r}$ (µm)
    """
    dilatancy = shown_in(dilatancy, units, "rigid_dilatancy")
    ax = _style.axes_or_new(ax)
    data = result_of(
        dilatancy, "rigid_dilatancy", ("rigid_dilatancy", "shear"), ("direction", "shear"), "dilatancy"
    )
    opening = table(data, "rigid_dilatancy", ("direction", "shear"))
    shear = np.atleast_1d(data["shear"].values).astype(float)
    across, along = scale_of(data["rigid_dilatancy"]), scale_of(data["shear"])
    entries, styles = [], direction_styles(data)
    dot = "o" if shear.size == 1 else ""
    slopes = table(data, "mean_slope", ("direction",)) if "mean_slope" in data else None
    for i, (name, style) in enumerate(styles):
        ax.plot(along(shear), across(opening[i]), marker=dot, label=name or "rigid dilatancy", **style)
        entries.append(_style.legend_line(name, **style))
        if slopes is not None:
            ends = np.array([0.0, np.nanmax(shear)])
            line = {"color": style["color"], "label": f"mean slope {name}".rstrip(), **MEAN_SLOPE_LINE}
            ax.plot(along(ends), across(slopes[i] * ends), **line)
    label_axis(ax.xaxis, name_of(data["shear"]), along)
    label_axis(ax.yaxis, name_of(data["rigid_dilatancy"]), across)
    if any(name for name, _ in styles):
        _style.side_legend(ax, entries, title="block slides")
    if slopes is not None:
        _style.side_legend(ax, [_style.legend_line("mean slope", **MEAN_SLOPE_LINE)], low=True)
    return ax


@_style.checked
def elastic_dilatancy(
    dilatancy: Any,
    *,
    direction: str | None = None,
    reach: float | None = None,
    marked: Sequence[float] = (),
    units: Units | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw dilatancy under constant normal force against shear displacement, one curve per force.

    The black curve is the dilatancy of rigid surfaces.

    Parameters
    ----------
    dilatancy : Dataset or node of a DataTree
        From `fractalcontact.joints.dilatancy` with forces: dilatancy (m) over (direction, shear, step),
        rigid_dilatancy (m) over (direction, shear).
    direction : str, optional
        Direction to draw; required if there are several.
    reach : float, optional
        Largest shear displacement (m) to show.
    marked : sequence of float
        Shear displacements (m) to mark A, B, C ... on the curve of the last force.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or there are several directions and none is chosen.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> result = fc.joints.dilatancy(crack, shear=[0.0, 2e-4], direction="E", normal_force=[1.0, 10.0])
    >>> ax = fc.plotting.elastic_dilatancy(result)
    >>> print(ax.get_ylabel(), "|", len(ax.lines), "curves")
    dilatancy $\delta$ (µm) | 3 curves
    """
    dilatancy = shown_in(dilatancy, units, "elastic_dilatancy")
    ax = _style.axes_or_new(ax)
    selected = limit_shear(select_direction(dilatancy, direction, "elastic_dilatancy", "dilatancy"), reach)
    data = result_of(selected, "elastic_dilatancy", ("dilatancy", "shear"), ("shear", "step"), "dilatancy")
    shear = np.atleast_1d(data["shear"].values).astype(float)
    opening = table(data, "dilatancy", ("shear", "step"))
    rigid = table(data, "rigid_dilatancy", ("shear",)) if "rigid_dilatancy" in data else None
    along = scale_of(data["shear"])
    across = scale_of(data["dilatancy"], opening if rigid is None else np.append(opening.ravel(), rigid))
    colours = _style.sequence_colours(opening.shape[1])
    marker = "o" if shear.size <= _style.MAX_MARKED_POINTS else ""
    entries = []
    if rigid is not None:
        ax.plot(along(shear), across(rigid), color=_style.ink(), lw=1.0, marker=marker, label="rigid")
        entries.append(_style.legend_line("0 (rigid)", color=_style.ink(), lw=1.0))
    title, labels = load_words(data)
    for j, colour in enumerate(colours):
        name = curve_name("dilatancy", (title, labels), j)
        ax.plot(along(shear), across(opening[:, j]), color=colour, marker=marker, label=name)
    for number, target in enumerate(marked):
        index = nearest(shear, target)
        if np.isclose(shear[index], target, rtol=1e-6, atol=0.0):
            point = slice(index, index + 1)
            mark_points(ax, along(shear[point]), across(opening[point, -1]), colours[-1], number)
    entries += [_style.legend_line(text, color=colour) for text, colour in zip(labels, colours, strict=True)]
    label_axis(ax.xaxis, name_of(data["shear"]), along)
    label_axis(ax.yaxis, r"dilatancy $\delta$", across)
    _style.side_legend(ax, entries, title=title)
    return ax
