"""How a set changes along a path of load or shear."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import _labels, _lineage
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask
from fractalcontact.domains.labelling import find

if TYPE_CHECKING:
    import xarray as xr

SOURCE = "Borri-Brunetto, Carpinteri and Chiaia, FRAMCOS-3 (1998); Hausdorff, Mengenlehre (1927)"
NAMES = ("births", "deaths", "merges", "splits", "overlap", "hausdorff_distance")


def evolution(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Births, deaths, merges and splits of islands along a path, and how far the set has moved.

    Every plane is compared with the one before it along the last leading dim (the steps of a load path, a
    shear ...); earlier leading dims are paths of their own.

    Parameters
    ----------
    mask : DataArray, dims (..., path, y, x)
        Boolean, or integer flags where contact means value > 0.
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
        Over the leading dims of the mask: `births`, islands that share no cell with the set before;
        `deaths`, islands of the set before that share none with this one; `merges`, islands that share
        cells with several before; `splits`, islands before that share cells with several now; `overlap`,
        common over united area; `hausdorff_distance` (m), the farthest that a cell of one set lies from the
        other, between centres. All are NaN at the first plane of a path, which has none before it.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, has no leading dim, `connectivity` is not 1 or 2, or `periodic`
        is True on a free axis.

    Notes
    -----
    The overlap of two empty planes is NaN, and so is the distance from or to an empty one, or on a mask
    without coordinates.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.evolution") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        expected = "at least one leading dim to go along, as in (step, y, x)"
        problems.require(len(planes.dims) > 0 or bool(problems.found), "mask.dims", expected, "(y, x)")
    found = find(planes, connectivity)
    length = planes.shape[-1]
    rows = np.full((planes.count, len(NAMES)), np.nan)
    for plane in range(planes.count):
        if plane % length:
            rows[plane] = _compare(planes, found, plane)
    variables = {
        **{name: planes.variable(rows[:, column]) for column, name in enumerate(NAMES)},
        "run_time": ((), time.perf_counter() - begin),
    }
    comment = f"NaN at the first plane along {planes.dims[-1]}, which has none before it"
    dataset = assemble(planes, variables, notes={name: {"comment": comment} for name in NAMES})
    parameters = {"mask": mask, "connectivity": connectivity, "periodic": periodic, "valid": valid}
    return stamp(
        dataset, "fractalcontact.domains.evolution", parameters, title="Evolution of a set", references=SOURCE
    )


def _compare(planes: Planes, found: list[_labels.Labels], plane: int) -> Array:
    before, after = planes.cells[plane - 1], planes.cells[plane]
    distance = _lineage.hausdorff(before, after, planes.grid) if planes.grid.known else np.nan
    events = _lineage.events(found[plane - 1], found[plane])
    return np.array([*events, _lineage.overlap(before, after), distance])
