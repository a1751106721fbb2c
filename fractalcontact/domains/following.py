"""How a set changes along a path of load or shear, measured in every way of this room."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import _labels, _lineage, gathering
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask
from fractalcontact.domains.descending import require_path
from fractalcontact.domains.labelling import find

if TYPE_CHECKING:
    import xarray as xr

SOURCE = "Borri-Brunetto, Carpinteri and Chiaia, FRAMCOS-3 (1998); Hausdorff, Mengenlehre (1927)"
CHANGES = "changes"
LABELLED = (CHANGES, "islands", "percolation")
LOADS = ("normal_force", "nominal_pressure", "closure")
RETURNS = ("return_step", "hysteresis", "coverage_change")
NAMES = ("births", "deaths", "merges", "splits", "overlap", "hausdorff_distance")


def evolution(
    mask: xr.DataArray,
    *,
    want: Sequence[str] | None = None,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """How a set changes along a path: every scalar and curve of this room for each plane, and the changes.

    Every plane is compared with the one before it along the last leading dim (the steps of a load path, a
    shear ...); earlier leading dims are paths of their own.

    Parameters
    ----------
    mask : DataArray, dims (..., path, y, x)
        Boolean, or integer flags where contact means value > 0.
    want : sequence of str, optional
        What to measure, out of "changes", "islands", "percolation", "box_dimension", "minkowski_dimension",
        "correlation_dimension", "boundary_dimension", "lacunarity"; all of it by default.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands and distances go on across the edges; by default what the axes say. True is refused
        on a free axis.
    valid : DataArray of bool, optional
        Cells that were observed; the others are in no island.

    Returns
    -------
    Dataset
        Over the leading dims of the mask, for "changes": `births`, islands that share no cell with the set
        before; `deaths`, islands of the set before that share none with this one; `merges`, islands that
        share cells with several before; `splits`, islands before that share cells with several now;
        `overlap`, common over united area; `hausdorff_distance` (m), the farthest that a cell of one set lies
        from the other, between centres; all NaN at the first plane of a path, which has none before it. Where
        the path carries a load (`normal_force`, `nominal_pressure` or `closure`) that turns round, the set is
        compared with that at the same load on the way before: `return_step`, its place on the path;
        `hysteresis`, 1 less common over united area; `coverage_change`.

        `coverage`, and what else is wanted: the scalars of `describe`, and the curves `box_count`,
        `box_measure`, `null_count`, `box_local_slope`, `mean_mass`, `null_mass`, `correlation_local_slope`,
        `lacunarity`, `null_lacunarity`, `relative_lacunarity`, `normalised_lacunarity` over `box_size`
        (cells; the sizes of all of them, NaN where a curve has no value), `grown_fraction`, `null_fraction`,
        `minkowski_local_slope` over `radius`. `lineage` tells the fate of every single island.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, has no leading dim, `want` holds an unknown word, `connectivity`
        is not 1 or 2, or `periodic` is True on a free axis.

    Notes
    -----
    The overlap of two empty planes is NaN, and so is the distance from or to an empty one, or on a mask
    without coordinates. Two loads are the same if they differ by less than 1e-6 of the largest.
    """
    begin = time.perf_counter()
    words = (CHANGES, *gathering.PARTS)
    with Problems("fractalcontact.domains.evolution") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        wanted = words if want is None else problems.choices("want", want, words)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        require_path(planes, problems)
    labelled = any(part in wanted for part in LABELLED)
    found = find(planes, connectivity, keep=CHANGES in wanted) if labelled else []
    told = {"periodic": periodic, "valid": valid}
    gathered = gathering.measure(mask, planes, wanted, found, connectivity, told)
    if CHANGES in wanted:
        _add_changes(gathered, found)
    variables = {**gathered.variables, "run_time": ((), np.asarray(time.perf_counter() - begin))}
    dataset = assemble(planes, variables, gathered.coords, notes=gathered.notes)
    parameters = {
        "mask": mask,
        "want": wanted,
        "connectivity": connectivity,
        "periodic": periodic,
        "valid": valid,
    }
    return stamp(
        dataset, "fractalcontact.domains.evolution", parameters, title="Evolution of a set", references=SOURCE
    )


def _add_changes(gathered: gathering.Gathered, found: list[_labels.Labels]) -> None:
    planes = gathered.planes
    rows = np.full((planes.count, len(NAMES)), np.nan)
    for plane in range(planes.count):
        if plane % planes.shape[-1]:
            rows[plane] = _compare(planes, found, plane)
    comment = f"NaN at the first plane along {planes.dims[-1]}, which has none before it"
    gathered.variables.update({name: planes.variable(rows[:, k]) for k, name in enumerate(NAMES)})
    gathered.notes.update({name: {"comment": comment} for name in NAMES})
    if np.isnan(rows[np.isfinite(rows[:, 0]), NAMES.index("overlap") :]).any():
        reasons = {"overlap": "both sets are empty", "hausdorff_distance": "a set is empty"}
        if not planes.grid.known:
            reasons["hausdorff_distance"] = "the mask has no coordinates"
        for name, reason in reasons.items():
            gathered.notes[name] = {"comment": f"{comment}, and where {reason}"}
    known = [name for name in LOADS if name in planes.coords and planes.dims[-1] in planes.coords[name].dims]
    for name in known[:1]:
        back = _returns(planes, name)
        gathered.variables.update({key: planes.variable(back[:, k]) for k, key in enumerate(RETURNS)})
        reason = f"NaN where the path has not come back to the same {name}, or both sets are empty"
        gathered.notes.update({key: {"comment": reason} for key in RETURNS})


def _compare(planes: Planes, found: list[_labels.Labels], plane: int) -> Array:
    before, after = planes.cells[plane - 1], planes.cells[plane]
    distance = _lineage.hausdorff(before, after, planes.grid) if planes.grid.known else np.nan
    events = _lineage.meetings(found[plane - 1], found[plane]).counts
    return np.array([*events, _lineage.overlap(before, after), distance])


def _returns(planes: Planes, name: str) -> Array:
    """Compare each plane with that at the same load on the way before, (planes, 3)."""
    load = planes.coords[name]
    places = [planes.shape[k] if dim in load.dims else 1 for k, dim in enumerate(planes.dims)]
    own = load.transpose(*(dim for dim in planes.dims if dim in load.dims)).values.reshape(places)
    values = np.broadcast_to(own, planes.shape)
    rows = np.full((planes.count, len(RETURNS)), np.nan)
    length = planes.shape[-1]
    for start in range(0, planes.count, length):
        for step, back in enumerate(_lineage.same_load(values.reshape(-1)[start : start + length])):
            if back >= 0:
                before, after = planes.cells[start + back], planes.cells[start + step]
                change = planes.coverage[start + step] - planes.coverage[start + back]
                rows[start + step] = back, 1.0 - _lineage.overlap(before, after), change
    return rows
