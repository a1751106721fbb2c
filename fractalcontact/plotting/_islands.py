"""Islands of a contact domain: their map and the distribution of their areas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._inputs import (
    as_dataset,
    extent_of,
    nearest,
    require_dims,
    require_known_dims,
    require_variables,
)
from fractalcontact.plotting._paths import curve_name, load_words, shear_words
from fractalcontact.plotting._surface import label_axes, plane_scale
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

MAX_CURVES = 8  # of the distributions of many masks
PALETTE = 12  # colours of neighbouring islands


@_style.checked
def islands(result: Any, *, units: Units | None = None, axes: Panels | None = None) -> AxesArray:
    """Draw a map of the islands of a contact domain and the distribution of their areas.

    The left panel shows neighbouring islands in different colours. The right panel shows the number of
    islands whose area is at least A, against A.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands` with `keep=("label",)`: label (y, x), and area (m2) over
        `island`. Of several masks the last one with an island is mapped, and each gets a curve (at most
        eight are drawn).
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
        The result has no labels or no areas.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.kron(np.eye(4), np.ones((2, 2))), 1e-3) > 0
    >>> result = fc.domains.islands(mask, connectivity=1, keep=("label",))
    >>> island_map, areas = fc.plotting.islands(result)
    >>> print(island_map.get_title(), "|", areas.get_xlabel())
    4 islands | island area (mm²)
    """
    result = shown_in(result, units, "islands")
    data = _checked_islands(result, ("label", "area"))
    require_dims(data, "islands", {"area": "island"})
    require_known_dims(data, "islands", {"area": ("island",)})
    left, right = shown = _style.panel_row(axes, 2, (_style.WIDTH, 3.2), width_ratios=(1, 1.15))
    island_map(data, ax=left)
    _island_areas(right, data)
    return shown


@_style.checked
def island_map(
    result: Any, *, title: str | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a map of the islands of a contact domain, neighbouring islands in different colours.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.islands` with `keep=("label",)`: label (y, x). Of several masks the
        last one with an island is mapped.
    title : str, optional
        Default: the number of islands.
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
        The result has no labels.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.kron(np.eye(4), np.ones((2, 2))), 1e-3) > 0
    >>> result = fc.domains.islands(mask, connectivity=2, keep=("label",))
    >>> ax = fc.plotting.island_map(result)
    >>> print(ax.get_title(), "|", ax.get_xlabel())
    1 island | $x$ (mm)
    """
    import matplotlib

    result = shown_in(result, units, "island_map")
    plane = _last_map(_checked_islands(result, ("label",))["label"])
    labels = np.asarray(plane.values).astype(np.int64)
    hues = matplotlib.colormaps[_style.SEQUENCE_MAP](np.linspace(0, 0.9, PALETTE))[:, :3]
    image = hues[(labels * 5) % PALETTE]  # consecutive labels are often neighbours and need unlike colours
    image[labels <= 0] = matplotlib.colors.to_rgb(_style.STATE_COLOURS[0])
    ax = _style.axes_or_new(ax, (3.8, 3.8))
    length = plane_scale(plane)
    _maps.draw_image(ax, image, extent_of(plane), length)
    label_axes(ax, plane, length)
    count = np.unique(labels[labels > 0]).size
    ax.set_title(f"{count} island{'' if count == 1 else 's'}" if title is None else title)
    return ax


def _checked_islands(result: Any, names: tuple[str, ...]) -> xr.Dataset:
    data = as_dataset(result, "islands")
    require_variables(data, "islands", names, "result")
    return data


def _last_map(plane: xr.DataArray) -> xr.DataArray:
    """Return the last map that has an island, or the last map if none has."""
    leading = [dim for dim in plane.dims if dim not in ("y", "x")]
    if leading:
        masks = plane.stack(mask=leading, create_index=False)
        filled = np.flatnonzero((masks > 0).any(("y", "x")).values)
        plane = masks.isel(mask=int(filled[-1]) if filled.size else -1)
    return plane.transpose("y", "x")


def _island_areas(ax: Axes, data: xr.Dataset) -> None:
    areas = np.asarray(data["area"].values, dtype=float).ravel()
    scale = scale_of(data["area"])
    label_axis(ax.xaxis, name_of(data["area"]), scale)
    label_axis(ax.yaxis, "number of islands of at least this area", PLAIN)
    if not np.isfinite(areas).any():
        _style.write_in_empty_axes(ax, "no islands")
        return
    title, groups = _island_groups(data, areas)
    groups = [groups[i] for i in _style.spread_indices(len(groups), MAX_CURVES)]
    colours = _style.sequence_colours(len(groups))
    labels = [label for label, _ in groups] if title else []
    for i, ((_, group), colour) in enumerate(zip(groups, colours, strict=True)):
        ordered = np.sort(group[np.isfinite(group)])[::-1]
        ax.step(scale(ordered), np.arange(1, ordered.size + 1), where="pre", color=colour,
                marker="." if ordered.size < 40 else None,
                label=curve_name("islands", (title, labels), i))  # fmt: skip
    most = max(np.count_nonzero(np.isfinite(group)) for _, group in groups)
    _style.log_scale(ax, x=areas, y=np.arange(1, most + 1))
    _style.plain_ticks(ax)
    if title:
        _style.sequence_legend(ax, title, labels, colours)


def _island_groups(data: xr.Dataset, areas: Any) -> tuple[str, list[tuple[str, Any]]]:
    """Return a legend title, and for each mask its label and the areas of its islands.

    Masks along one path of load or of shear are labelled by it, others are numbered.
    """
    names = [dim for dim in ("member", "direction", "shear", "step") if f"island_{dim}" in data.coords]
    if not names:
        return "", [("", areas)]
    columns = [np.unique(data[f"island_{dim}"].values, return_inverse=True) for dim in names]
    _, group = np.unique(np.stack([inverse for _, inverse in columns], -1), axis=0, return_inverse=True)
    parts = [areas[group.ravel() == number] for number in range(group.max() + 1)]
    title, texts = "", [str(number) for number in range(len(parts))]
    if len(names) == 1 and names[0] in ("shear", "step") and names[0] in data.dims:
        title, labels = (shear_words if names[0] == "shear" else load_words)(data)
        places = [nearest(data[names[0]], value) for value in columns[0][0]]
        texts = [labels[place] for place in places] if labels else texts
    return title, list(zip(texts, parts, strict=True))
