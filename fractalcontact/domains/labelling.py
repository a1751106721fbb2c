"""Islands of contact: how many, how large, how long their edge, where."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import _labels
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask, together

if TYPE_CHECKING:
    import xarray as xr

SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components); scipy.ndimage.label"
METRIC = ("area", "perimeter", "centroid_x", "centroid_y", "x_min", "x_max", "y_min", "y_max")


def islands(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
    keep: Sequence[str] = ("label",),
) -> xr.Dataset:
    """Islands of a set of cells: their number, their map, and a table of their sizes.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands go on across the edges; by default what the axes say. True is refused on a free axis.
    valid : DataArray of bool, optional
        Cells that were observed; the others are in no island.
    keep : sequence of str
        Maps to keep: ("label",) or (). Without the map a plane is gone through band by band, in little
        memory beyond the mask itself.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `n_islands`; `largest_island` and `mean_island_area` (m2);
        `largest_cells`; `euler_number`, islands less holes; `label`, with (y, x), the number of the island
        at every cell, 0 outside. Over `island`, one entry for each island of every plane: `cells`; `area`
        (m2); `perimeter` (m), along the sides of cells that face open cells inside the extent; `centroid_x`,
        `centroid_y` (m); the bounding box `x_min`, `x_max`, `y_min`, `y_max` (m), on the edges of cells,
        which runs over the edge of a periodic plane where the island does. On that dim stand the
        coordinates `island_label`, the number in the map, and `island_<dim>` for every leading dim.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, `connectivity` is not 1 or 2, or `periodic` is True on a free
        axis.

    Notes
    -----
    Lengths are NaN for a mask without coordinates, and so is the centroid, along a periodic axis, of an
    island that goes round it. The largest and the mean area of an empty plane are NaN too.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.islands") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        maps = problems.choices("keep", keep, ("label",))
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
    found = find(planes, connectivity, keep="label" in maps)
    tables = [measure(labels, planes) for labels in found]
    columns = {name: np.concatenate([one[name] for one in tables]) for name in tables[0]}
    variables = {
        **{name: planes.variable(values) for name, values in summary(found, planes, connectivity).items()},
        **{name: planes.variable(np.array([labels.map for labels in found]), "y", "x") for name in maps},
        **{name: ("island", values) for name, values in columns.items()},
        "run_time": ((), time.perf_counter() - begin),
    }
    counts = [one["cells"].size for one in tables]
    coords = {"island_label": ("island", np.concatenate([np.arange(1, count + 1) for count in counts]))}
    rows = ("island", np.repeat(np.arange(planes.count), counts))
    dataset = assemble(planes, variables, coords, on_plane="label" in maps, notes=_notes(planes), rows=rows)
    parameters = {
        "mask": mask,
        "connectivity": connectivity,
        "periodic": periodic,
        "valid": valid,
        "keep": maps,
    }
    return stamp(
        dataset, "fractalcontact.domains.islands", parameters, title="Islands of a set", references=SOURCE
    )


def summary(found: Sequence[_labels.Labels], planes: Planes, connectivity: int) -> dict[str, Array]:
    """Return the scalars of every plane."""
    sizes = [labels.sizes for labels in found]
    euler = [_labels.euler_number(cells, connectivity, planes.grid.periodic) for cells in planes.cells]
    area = planes.grid.cell_area if planes.grid.known else np.nan
    largest = np.array([cells.max(initial=0) for cells in sizes], np.int64)
    mean = np.array([cells.mean() if cells.size else np.nan for cells in sizes])
    return {
        "n_islands": np.array([cells.size for cells in sizes], np.int64),
        "largest_cells": largest,
        "largest_island": np.where(largest > 0, largest * area, np.nan),
        "mean_island_area": mean * area,
        "euler_number": np.array(euler, np.int64),
    }


def find(planes: Planes, connectivity: int, *, keep: bool = True) -> list[_labels.Labels]:
    """Find the islands of every plane, with or without their map."""
    wraps = planes.grid.periodic
    return together(lambda cells: _labels.label_plane(cells, connectivity, wraps, keep=keep), planes.cells)


def measure(labels: _labels.Labels, planes: Planes) -> dict[str, Array]:
    """Return the table of one plane; lengths are NaN where the mask has no coordinates."""
    origin = [float(planes.plane_coords[dim].values[0]) if planes.grid.known else 0.0 for dim in ("y", "x")]
    measured = _labels.table(labels, planes.grid, origin)
    if planes.grid.known:
        return measured
    return {
        name: np.full(values.shape, np.nan) if name in METRIC else values for name, values in measured.items()
    }


def _notes(planes: Planes) -> dict[str, dict[str, str]]:
    reasons = []
    if not planes.grid.known:
        reasons.append("the mask has no coordinates")
    if np.any(planes.occupied == 0):
        reasons.append("the set is empty")
    comment = {"comment": "NaN where " + " or where ".join(reasons)}
    return {"largest_island": comment, "mean_island_area": comment} if reasons else {}
