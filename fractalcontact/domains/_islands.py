"""Islands of contact: their number, their sizes and perimeters, where they lie, and whether one crosses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.resources import Plane
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.domains._connected_components import (
    COLUMNS,
    PLAIN_COLUMNS,
    PROFILE_COLUMNS,
    SHAPE_COLUMNS,
    Components,
    check_connected,
    component_table,
    euler_number,
    label_planes,
)
from fractalcontact.domains._masks import Array, Planes, mask_sides, read_planes

SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components); scipy.ndimage.label"


def _check(problems: Problems) -> None:
    is_profile = len(mask_sides(problems.given.mask)) == 1
    problems.choices("keep", among=("label",))
    columns = PROFILE_COLUMNS if is_profile else (*COLUMNS, *SHAPE_COLUMNS)
    problems.choices("include", among=columns, optional=True)
    check_connected(problems, profiles=True)


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of a call: with its map, labelled at once; otherwise in bands."""
    has_shape = set(word_tuple(arguments.get("include") or ())) & set(SHAPE_COLUMNS)
    has_map = "label" in word_tuple(arguments.get("keep", "label"))
    # allocated at 3000 x 3000 cells: 12.0 with the map (8 of it counted apart), 3.7 without; with shapes, in
    # arrays over the cells of the set, 103 at a coverage of .92, 58 at .50 and 30 at .24
    return (96.0 if has_shape else 6.0 if has_map else 4.0) * plane.cells


@public_result(
    title="Islands of a set", references=SOURCE, achieved_error="exact", check=_check, memory=_memory
)
def islands(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
    keep: str | Sequence[str] = ("label",),
    include: str | Sequence[str] | None = None,
) -> xr.Dataset:
    """Islands of a set of cells: their number, their map, and a table of their sizes.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands continue across the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells; the others are in no island.
    keep : str or sequence of str
        Maps to keep: ("label",) or (). Without the map a plane is labelled band by band, in little memory.
    include : str or sequence of str, optional
        Columns of the table; () for no table. By default all but those of the shape; `cells` and
        `area` alone where a plane has more than 2^22 islands, as the table takes some 200 bytes for each.

    Returns
    -------
    Dataset
        Over the leading dims: `n_islands`; `largest_island`, `mean_island_area` (m2); `largest_cells`;
        `euler_number`, islands less holes; `label` over (y, x), the number of the island, 0 outside. Over
        `island`, for the islands of all planes: `cells`; `area` (m2); `perimeter` (m), along the sides of
        cells towards open cells inside the extent; `centroid_x`, `centroid_y` (m); the bounding box `x_min`,
        `x_max`, `y_min`, `y_max` (m), which extends over the edge of a periodic plane where the island does;
        coordinates `island_label`, the number in the map, and `island_<dim>` for every leading dim. Of the
        shape, where named in `include`, by the definitions of skimage.measure.regionprops: `orientation`
        (degree, from y to the long axis of the ellipse of equal second moments, -90 to 90), its
        `eccentricity`, `solidity`, the share of the cells of the convex hull in the island; and
        `gyration_radius` (m), the rms distance of its cells from its centroid.

    Raises
    ------
    InvalidInput
        The mask, `connectivity`, `keep`, `include`, `periodic` or `valid` is not as described.

    Notes
    -----
    A profile has the variables `largest_length` and `mean_island_length` (m) and the columns `cells`,
    `length` (m), `centroid_x`, `x_min` and `x_max`. Lengths of a mask without coordinates are in
    cells. NaN: the centroid, along a periodic axis, of an island that wraps around it, and its shape; the
    largest and the mean area of an empty plane.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> mask = xr.DataArray(np.eye(5, dtype=bool), dims=("y", "x"))
    >>> int(fc.domains.islands(mask).n_islands)
    5
    >>> int(fc.domains.islands(mask, connectivity=2).n_islands)
    1
    """
    maps = word_tuple(keep)
    planes = read_planes(mask, valid=valid, periodic=periodic)
    every, plain = (COLUMNS, PLAIN_COLUMNS) if planes.rank == 2 else (PROFILE_COLUMNS, PROFILE_COLUMNS[:2])
    columns = every if include is None else word_tuple(include)
    detailed = None if include is None else bool(set(columns) - {*plain, *SHAPE_COLUMNS})
    has_map = "label" in maps or bool(set(columns) & set(SHAPE_COLUMNS))
    components = label_planes(planes, connectivity, keep=has_map, detailed=detailed)
    too_many = include is None and any(plane.details is None for plane in components)
    columns = plain if too_many else columns
    counts = [plane.count if columns else 0 for plane in components]
    scalars = island_scalars(components, planes, connectivity)
    variables = {
        **{name: planes.variable(values) for name, values in scalars.items()},
        **{name: _maps(components, planes) for name in maps},
        **{name: ("island", values) for name, values in _table(components, planes, columns).items()},
    }
    coords: dict[str, Any] = {}
    if columns:
        coords["island_label"] = ("island", _chain([np.arange(1, n + 1, dtype=np.int32) for n in counts]))
    rows = ("island", np.repeat(np.arange(planes.count), counts)) if columns and planes.dims else None
    notes = _notes(planes, too_many=too_many)
    return planes.dataset(variables, coords, on_plane="label" in maps, notes=notes, rows=rows)


def _maps(components: Sequence[Components], planes: Planes) -> tuple[tuple[str, ...], Array]:
    """Return the maps of the islands with their dims."""
    maps = np.array([plane.map for plane in components])
    return planes.variable(maps, "y", "x") if planes.rank == 2 else planes.variable(maps[:, 0], "x")


def island_scalars(components: Sequence[Components], planes: Planes, connectivity: int) -> dict[str, Array]:
    """Return the numbers of every plane: islands, their sizes, and of planes the Euler number."""
    sizes = [plane.sizes for plane in components]
    area = planes.grid.cell_area
    largest = np.array([cells.max(initial=0) for cells in sizes], np.int64)
    mean = np.array([cells.mean() if cells.size else np.nan for cells in sizes])
    scalars = {"n_islands": np.array([cells.size for cells in sizes], np.int64), "largest_cells": largest}
    largest_area, mean_area = np.where(largest > 0, largest * area, np.nan), mean * area
    if planes.rank == 1:
        return scalars | {"largest_length": largest_area, "mean_island_length": mean_area}
    euler = [euler_number(cells, connectivity, planes.grid.periodic) for cells in planes.cells]
    return scalars | {
        "largest_island": largest_area,
        "mean_island_area": mean_area,
        "euler_number": np.array(euler, np.int64),
    }


def _table(components: Sequence[Components], planes: Planes, columns: Sequence[str]) -> dict[str, Array]:
    """Return the table of all planes."""
    if not columns:
        return {}
    axes = planes.plane_coords
    origin = [float(axes[dim].values[0]) if dim in axes else 0.0 for dim in ("y", "x")]
    tables = [component_table(plane, planes.grid, origin, columns) for plane in components]
    return {name: _chain([table.pop(name) for table in tables]) for name in columns}


def _chain(arrays: Sequence[Array]) -> Array:
    """Join arrays end to end, without a copy of a single one."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _notes(planes: Planes, *, too_many: bool) -> dict[str, dict[str, str]]:
    comment = {"comment": "NaN where the set is empty"}
    of_area = ("largest_island", "mean_island_area")
    of_length = ("largest_length", "mean_island_length")
    names = of_area if planes.rank == 2 else of_length
    notes = dict.fromkeys(names, comment) if np.any(planes.occupied == 0) else {}
    if too_many:
        notes["n_islands"] = {"comment": "too many for the full table: name the columns to have them all"}
    return notes


CROSSING_SOURCE = "Stauffer and Aharony, Introduction to Percolation Theory (1994)"


@public_result(
    title="Percolation of a set",
    references=CROSSING_SOURCE,
    achieved_error="exact",
    check=check_connected,
    path_figure="largest_share coverage",
)
def percolation(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Whether an island of the set crosses the plane along x, and along y.

    It crosses along a free axis if it touches both ends, and along a periodic one if it closes on itself
    around the period. It may close after periods of the other axis too: a diagonal band crosses along both.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours). A
        set that crosses with 4 neighbours separates its complement with 8, across the crossing.
    periodic : bool, optional
        Whether islands continue across the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; the others are not in the set.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `coverage`; `largest_share`, the share of the set in its largest
        island (NaN for an empty plane); and over `axis` ("x", "y") too `percolates`.

    Raises
    ------
    InvalidInput
        The mask, `connectivity`, `periodic` or `valid` is not as described.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> rows = np.zeros((6, 6), bool)
    >>> rows[[1, 4]] = True
    >>> fc.domains.percolation(xr.DataArray(rows, dims=("y", "x"))).percolates.values.tolist()
    [True, False]
    """
    planes = read_planes(mask, valid=valid, periodic=periodic)
    return crossings(label_planes(planes, connectivity, keep=False), planes, connectivity)


def crossings(components: Sequence[Components], planes: Planes, connectivity: int) -> xr.Dataset:
    """Return the result of `percolation` for planes and their islands, without labels."""
    largest = np.array([plane.sizes.max(initial=0) for plane in components])
    share = np.where(planes.occupied > 0, largest / np.maximum(planes.occupied, 1), np.nan)
    periodic = planes.grid.periodic
    crosses = [[plane.percolates(axis, periodic[axis]) for axis in (1, 0)] for plane in components]
    variables = {
        "coverage": planes.variable(planes.coverage),
        "largest_share": planes.variable(share),
        "percolates": planes.variable(np.array(crosses), "axis"),
    }
    name = f"an island of the set crosses the plane along the axis ({4 * connectivity} neighbours)"
    coords = {"axis": ("axis", np.array(("x", "y")))}
    return planes.dataset(variables, coords, notes={"percolates": {"long_name": name}})
