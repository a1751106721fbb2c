"""What became of every island from one plane of a path to the next, as a table."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.domains import _lineage
from fractalcontact.domains._masks import Planes, assemble, read_mask
from fractalcontact.domains.labelling import find

if TYPE_CHECKING:
    import xarray as xr

SOURCE = "Borri-Brunetto, Carpinteri and Chiaia, FRAMCOS-3 (1998)"


@accounted("none: counted")
def lineage(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Table of what became of every island: which island of one plane meets which of the next.

    Every plane is compared with the one before it along the last leading dim (the steps of a load path, a
    shear ...); earlier leading dims are paths of their own. Islands are the same where they share cells.

    Parameters
    ----------
    mask : DataArray, dims (..., path, y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands go on across the edges; by default what the axes say. True is refused on a free axis.
    valid : DataArray of bool, optional
        Cells that were observed; the others are in no island.

    Returns
    -------
    Dataset
        Over `link`, one row for each pair of islands that meet, each island that is born and each that dies:
        `island_before` and `island_after`, the numbers of `islands` (0: none); `common_cells`; `event` (int8
        flags): continuation, birth, death, merge (the island after meets several before), split (the island
        before meets several after), or merge_and_split. On that dim stand the coordinates `link_<dim>`, for
        every leading dim, of the later of the two planes.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, has no leading dim, `connectivity` is not 1 or 2, or `periodic`
        is True on a free axis.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.lineage") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        require_path(planes, problems)
    found = find(planes, connectivity)
    later = [plane for plane in range(planes.count) if plane % planes.shape[-1]]
    tables = [_lineage.table(found[plane - 1], found[plane]) for plane in later]
    blank = {name: values[:0] for name, values in _lineage.table(found[0], found[0]).items()}
    columns = {name: np.concatenate([blank[name], *(one[name] for one in tables)]) for name in blank}
    rows = np.repeat(np.array(later, np.int64), [one["event"].size for one in tables])
    variables = {
        **{name: ("link", values) for name, values in columns.items()},
        "run_time": ((), time.perf_counter() - begin),
    }
    dataset = assemble(planes, variables, rows=("link", rows))
    parameters = {"mask": mask, "connectivity": connectivity, "periodic": periodic, "valid": valid}
    return stamp(
        dataset, "fractalcontact.domains.lineage", parameters, title="Lineage of islands", references=SOURCE
    )


def require_path(planes: Planes, problems: Problems) -> None:
    """Note a problem unless the mask has a leading dim to go along."""
    expected = "at least one leading dim to go along, as in (step, y, x)"
    problems.require(len(planes.dims) > 0 or bool(problems.found), "mask.dims", expected, "(y, x)")
