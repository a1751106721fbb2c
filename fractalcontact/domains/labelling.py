"""Islands of contact: how many, how large, how long their edge, where."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.domains import _labels
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask, together

if TYPE_CHECKING:
    import xarray as xr

SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components); scipy.ndimage.label"


@accounted("none: counted")
def islands(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
    keep: Sequence[str] = ("label",),
    table: Sequence[str] | None = None,
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
    table : sequence of str, optional
        Columns of the table, out of those below; () for no table. By default all of them, but `cells` and
        `area` alone where a plane has more than 2^22 islands: the whole table takes some 200 bytes for each.

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
        wanted = _labels.COLUMNS if table is None else problems.choices("table", table, _labels.COLUMNS)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
    detailed = None if table is None else bool(set(wanted) - set(_labels.PLAIN))
    found = find(planes, connectivity, keep="label" in maps, detailed=detailed)
    many = table is None and any(labels.details is None for labels in found)
    wanted = _labels.PLAIN if many else wanted
    counts = [labels.count if wanted else 0 for labels in found]
    variables = {
        **{name: planes.variable(values) for name, values in summary(found, planes, connectivity).items()},
        **{name: planes.variable(np.array([labels.map for labels in found]), "y", "x") for name in maps},
        **{name: ("island", values) for name, values in _table(found, planes, wanted).items()},
        "run_time": ((), time.perf_counter() - begin),
    }
    coords: dict[str, Any] = {}
    if wanted:
        coords["island_label"] = ("island", _chain([np.arange(1, n + 1, dtype=np.int32) for n in counts]))
    rows = ("island", np.repeat(np.arange(planes.count), counts)) if wanted and planes.dims else None
    notes = _notes(planes, many=many)
    dataset = assemble(planes, variables, coords, on_plane="label" in maps, notes=notes, rows=rows)
    parameters = {
        "mask": mask,
        "connectivity": connectivity,
        "periodic": periodic,
        "valid": valid,
        "keep": maps,
        "table": wanted,
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


def find(
    planes: Planes, connectivity: int, *, keep: bool = True, detailed: bool | None = False
) -> list[_labels.Labels]:
    """Find the islands of every plane, with or without their map and the measures for their table."""
    wraps = planes.grid.periodic
    return together(
        lambda cells: _labels.label_plane(cells, connectivity, wraps, keep=keep, detailed=detailed),
        planes.cells,
    )


def _table(found: Sequence[_labels.Labels], planes: Planes, columns: Sequence[str]) -> dict[str, Array]:
    """Return the table of all planes; lengths are NaN where the mask has no coordinates."""
    if not columns:
        return {}
    known = planes.grid.known
    origin = [float(planes.plane_coords[dim].values[0]) if known else 0.0 for dim in ("y", "x")]
    tables = [_labels.table(labels, planes.grid, origin, columns) for labels in found]
    joined = {name: _chain([one.pop(name) for one in tables]) for name in columns}
    if known:
        return joined
    return {
        name: values if name == "cells" else np.full(values.shape, np.nan) for name, values in joined.items()
    }


def _chain(arrays: Sequence[Array]) -> Array:
    """Join arrays end to end, without a copy of a single one."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _notes(planes: Planes, *, many: bool) -> dict[str, dict[str, str]]:
    reasons = []
    if not planes.grid.known:
        reasons.append("the mask has no coordinates")
    if np.any(planes.occupied == 0):
        reasons.append("the set is empty")
    comment = {"comment": "NaN where " + " or where ".join(reasons)}
    notes = {"largest_island": comment, "mean_island_area": comment} if reasons else {}
    if many:
        notes["n_islands"] = {"comment": "too many for the whole table: name the columns to have them all"}
    return notes
