"""Islands of a contact domain: their map and the distribution of their areas."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import nearest, require_dims, require_known_dims, result_of
from fractalcontact.plotting._line_panel import Family, LinePanel, ordered
from fractalcontact.plotting._paths import by_load, by_shear
from fractalcontact.plotting._style import Axes, AxesArray, Panels
from fractalcontact.plotting._units import PLAIN, Quantity, Units, name_of, scale_of

MAX_CURVES = 8  # of the distributions of many masks
MOST_DOTS = 39  # of a distribution whose islands are marked
SEVERAL = ("member", "direction", "shear", "step")


@figure
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
    {shared}

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
    data = result_of(result, "islands", ("label", "area"), SEVERAL, units)
    require_dims(data, "islands", {"area": "island"})
    require_known_dims(data, "islands", {"area": ("island", *SEVERAL)})
    left, right = shown = _style.panel_row(axes, 2, (_style.WIDTH, 3.2), width_ratios=(1, 1.15))
    _maps.draw_labels(left, _last_map(data["label"]))
    _draw_areas(right, data)
    return shown


def _last_map(plane: xr.DataArray) -> xr.DataArray:
    """Return the last map that has an island, or the last map if none has."""
    leading = [dim for dim in plane.dims if dim not in ("y", "x")]
    if leading:
        masks = plane.stack(mask=leading, create_index=False)
        filled = np.flatnonzero((masks > 0).any(("y", "x")).values)
        plane = masks.isel(mask=int(filled[-1]) if filled.size else -1)
    return plane.transpose("y", "x")


def _draw_areas(ax: Axes, data: xr.Dataset) -> None:
    """Draw the number of islands that are at least as large as each, a curve for each mask."""
    areas = np.asarray(data["area"].values, dtype=float).ravel()
    family, groups = _masks_of(data)
    shown = _style.spread_indices(len(groups), MAX_CURVES)
    labels = [family.labels[i] for i in shown] if family.labels else ()
    family = ordered(labels, family.name, family.unit, len(shown))
    size = Quantity(areas, scale_of(data["area"]), name_of(data["area"]))
    panel = LinePanel(
        ax, size, Quantity(np.empty(0), PLAIN, "number of islands of at least this area"), family
    )
    for i, number in enumerate(shown):
        group = areas[groups[number]]
        ordered_areas = np.sort(group[np.isfinite(group)])[::-1]
        marker = "." if ordered_areas.size <= MOST_DOTS else ""
        style = family.styles[i] | {"drawstyle": "steps-pre", "marker": marker}
        panel.line(family.curve("islands", i), ordered_areas, np.arange(1, ordered_areas.size + 1), **style)
    panel.finish(log="xy", empty="no islands")


def _masks_of(data: xr.Dataset) -> tuple[Family, list[Any]]:
    """Return for each mask the places of its islands, and what distinguishes the masks.

    Masks along one path of load or of shear are labelled by it, others are not.
    """
    names = [dim for dim in SEVERAL if f"island_{dim}" in data.coords]
    if not names:
        return ordered((), count=1), [slice(None)]
    columns = [np.unique(data[f"island_{dim}"].values, return_inverse=True) for dim in names]
    _, group = np.unique(np.stack([inverse for _, inverse in columns], -1), axis=0, return_inverse=True)
    groups = [np.flatnonzero(group.ravel() == number) for number in range(group.max(initial=-1) + 1)]
    family = ordered((), count=len(groups))
    if len(names) == 1 and names[0] in ("shear", "step") and names[0] in data.coords:
        every = (by_shear if names[0] == "shear" else by_load)(data)
        places = [nearest(data[names[0]], value) for value in columns[0][0]]
        family = ordered([every.labels[place] for place in places], every.name, every.unit)
    return family, groups
