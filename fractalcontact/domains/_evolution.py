"""Evolution of a set along a path of load or shear: every measure of each plane, and the changes between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from fractalcontact.base.grid import Grid
from fractalcontact.base.references import joined_references
from fractalcontact.base.results import public_result
from fractalcontact.base.threads import thread_count
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.domains._connected_components import Components, label_planes
from fractalcontact.domains._describe import MEASURES, Measurements, measure_planes, sources
from fractalcontact.domains._lineage import check_path, island_overlaps
from fractalcontact.domains._mask_input import Array, Planes, build_dataset, read_planes

SOURCE = "Hausdorff, Mengenlehre (1927)"  # of the changes
CHANGES = "changes"
WORDS = (CHANGES, *MEASURES)
NEED_ISLANDS = (CHANGES, "islands", "percolation")
LOADS = ("normal_force", "nominal_pressure", "closure")
CHANGE_NAMES = ("births", "deaths", "merges", "splits", "overlap", "hausdorff_distance")
RETURN_NAMES = ("return_step", "hysteresis", "coverage_change")
SAME_LOAD = 1e-6  # of the largest load


def _check(problems: Problems, *, mask: Any, want: Any, connectivity: Any, periodic: Any, valid: Any) -> None:
    if want is not None:
        problems.choices("want", want, WORDS)
    check_path(problems, mask=mask, connectivity=connectivity, periodic=periodic, valid=valid)


@public_result(title="Evolution of a set", check=_check)
def evolution(
    mask: xr.DataArray,
    *,
    want: Sequence[str] | None = None,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """How a set changes along a path: all measures of each plane, and the changes between planes.

    Every plane is compared with the one before it along the last leading dim (the steps of a load path, a
    shear displacement ...); earlier leading dims are separate paths.

    Parameters
    ----------
    mask : DataArray, dims (..., path, y, x)
        Boolean, or integer flags where contact means value > 0.
    want : sequence of str, optional
        What to measure, out of "changes", "islands", "percolation", "box_dimension", "minkowski_dimension",
        "correlation_dimension", "boundary_dimension", "lacunarity"; all by default.
    connectivity, periodic, valid
        See `describe`.

    Returns
    -------
    Dataset
        For "changes": `births`, islands that share no cell with the set before; `deaths`, islands of the set
        before that share none with this one; `merges`, islands that overlap several before; `splits`, islands
        before that overlap several now; `overlap`, common over united area; `hausdorff_distance` (m), the
        largest distance from a cell of one set to the other set. If the path carries a load (`normal_force`,
        `nominal_pressure` or `closure`) that reverses, the set is compared with that at the same load on the
        opposite branch before: `return_step`, its index on the path; `hysteresis`, 1 less common over united
        area; `coverage_change`. Beside `coverage`, the scalars of `describe` and the curves of the functions
        in `want`, over `box_size` (all their sizes, NaN where a curve has no value) or `radius`.

    Raises
    ------
    InvalidInput
        The mask has no leading dim, `want` holds an unknown word, or another argument is not as described.

    Notes
    -----
    Changes are NaN at the first plane of a path. The overlap of two empty planes is NaN, and so is the
    distance from or to an empty one, or on a mask without coordinates.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> cells = np.array([[[1, 0, 0, 1]], [[1, 1, 1, 1]]])
    >>> result = fc.domains.evolution(xr.DataArray(cells, dims=("step", "y", "x")), want=["changes"])
    >>> float(result.merges[1]), float(result.overlap[1])
    (1.0, 0.5)
    """
    wanted = WORDS if want is None else word_tuple(want)
    planes = read_planes(mask, valid=valid, periodic=periodic)
    components: list[Components] = []
    if any(word in wanted for word in NEED_ISLANDS):
        components = label_planes(planes, connectivity, keep=CHANGES in wanted)
    measurements = measure_planes(planes, wanted, components, connectivity)
    if CHANGES in wanted:
        _add_changes(measurements, components)
        _add_returns(measurements)
    result = build_dataset(planes, measurements.variables, measurements.coords, notes=measurements.notes)
    references = joined_references(*([SOURCE] if CHANGES in wanted else []), sources(wanted))
    return result.assign_attrs(references=references)


def _add_changes(measurements: Measurements, components: Sequence[Components]) -> None:
    """Add how every plane differs from the one before it."""
    planes = measurements.planes
    rows = np.full((planes.count, len(CHANGE_NAMES)), np.nan)
    for plane in range(planes.count):
        if plane % planes.shape[-1]:
            rows[plane] = _change(planes, components, plane)
    comment = f"NaN at the first plane along {planes.dims[-1]}, which has none before it"
    measurements.variables.update({name: planes.variable(rows[:, k]) for k, name in enumerate(CHANGE_NAMES)})
    measurements.notes.update({name: {"comment": comment} for name in CHANGE_NAMES})
    has_previous = np.isfinite(rows[:, 0])
    if np.isnan(rows[has_previous, CHANGE_NAMES.index("overlap") :]).any():
        reasons = {"overlap": "both sets are empty", "hausdorff_distance": "a set is empty"}
        if not planes.grid.has_coordinates:
            reasons["hausdorff_distance"] = "the mask has no coordinates"
        for name, reason in reasons.items():
            measurements.notes[name] = {"comment": f"{comment}, and where {reason}"}


def _change(planes: Planes, components: Sequence[Components], plane: int) -> Array:
    before, after = planes.cells[plane - 1], planes.cells[plane]
    distance = hausdorff_distance(before, after, planes.grid) if planes.grid.has_coordinates else np.nan
    events = island_overlaps(components[plane - 1], components[plane]).event_counts
    return np.array([*events, area_overlap(before, after), distance])


def _add_returns(measurements: Measurements) -> None:
    """Add how every plane differs from that at the same load on the opposite branch before, if any."""
    planes = measurements.planes
    coords, path = planes.coords, planes.dims[-1]
    load = next((name for name in LOADS if name in coords and path in coords[name].dims), None)
    if load is None:
        return
    rows = _returns(planes, coords[load])
    measurements.variables.update({name: planes.variable(rows[:, k]) for k, name in enumerate(RETURN_NAMES)})
    reason = f"NaN where the path has not come back to the same {load}, or both sets are empty"
    measurements.notes.update({name: {"comment": reason} for name in RETURN_NAMES})


def _returns(planes: Planes, load: xr.Variable) -> Array:
    """Compare each plane with that at the same load on the opposite branch before, (planes, 3)."""
    shape = [planes.shape[k] if dim in load.dims else 1 for k, dim in enumerate(planes.dims)]
    values = load.transpose(*(dim for dim in planes.dims if dim in load.dims)).values.reshape(shape)
    loads = np.broadcast_to(values, planes.shape).reshape(-1)
    rows = np.full((planes.count, len(RETURN_NAMES)), np.nan)
    length = planes.shape[-1]
    for start in range(0, planes.count, length):
        for step, earlier in enumerate(same_load_steps(loads[start : start + length])):
            if earlier >= 0:
                before, after = planes.cells[start + earlier], planes.cells[start + step]
                change = planes.coverage[start + step] - planes.coverage[start + earlier]
                rows[start + step] = earlier, 1.0 - area_overlap(before, after), change
    return rows


def same_load_steps(loads: Array) -> Array:
    """Return for each step the last one before it, on the opposite branch, with the same load.

    -1 where there is none. Loads are the same if they differ by less than 1e-6 of the largest.
    """
    steps = np.full(loads.size, -1, np.int64)
    branch = np.sign(np.diff(loads))  # from each step to the next: loading or unloading
    limit = SAME_LOAD * np.nanmax(np.abs(loads), initial=0.0)
    for step in range(2, loads.size):
        # a turning point belongs to both branches
        opposite = branch[:step] == -branch[step - 1]
        opposite[1:] |= opposite[:-1]
        same = opposite & (np.abs(loads[:step] - loads[step]) <= limit)
        if branch[step - 1] != 0 and same.any():
            steps[step] = np.flatnonzero(same)[-1]
    return steps


def area_overlap(before: Array, after: Array) -> float:
    """Return the common over the united area; NaN if both are empty."""
    united = int(np.count_nonzero(before | after))
    return int(np.count_nonzero(before & after)) / united if united else float("nan")


def hausdorff_distance(before: Array, after: Array, grid: Grid) -> float:
    """Return the largest distance (m) from a cell of one set to the other set; NaN if one is empty."""
    if not before.any() or not after.any():
        return float("nan")
    return max(_directed_distance(before, after, grid), _directed_distance(after, before, grid))


def _directed_distance(start: Array, goal: Array, grid: Grid) -> float:
    """Largest distance from a cell of `start` to the nearest of `goal`, between centres."""
    outside = (start > 0) & (goal == 0)
    if not outside.any():
        return 0.0
    box = [
        n * spacing if wraps else 0.0
        for n, spacing, wraps in zip(grid.shape, grid.spacing, grid.periodic, strict=True)
    ]
    tree = cKDTree(_positions(_rim(goal, grid.periodic), grid), boxsize=box)
    distance, _ = tree.query(_positions(outside, grid), workers=thread_count())
    return float(distance.max())


def _positions(cells: Array, grid: Grid) -> Array:
    return np.asarray(np.argwhere(cells) * np.array(grid.spacing))


def _rim(cells: Array, periodic: Sequence[bool]) -> Array:
    """Cells of the set with an open neighbour or on a free edge: the nearest one is among them."""
    inner = cells > 0
    rim = np.zeros_like(inner)
    for axis, wraps in enumerate(periodic):
        for step in (1, -1):
            neighbour = np.roll(inner, step, axis)
            if not wraps:
                edge = [slice(None), slice(None)]
                edge[axis] = slice(0, 1) if step == 1 else slice(-1, None)
                neighbour[tuple(edge)] = False
            rim |= inner & ~neighbour
    return rim
