"""Whether a set crosses the plane."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.domains import _labels
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask
from fractalcontact.domains.labelling import find

if TYPE_CHECKING:
    import xarray as xr

AXES = ("x", "y")
SOURCE = "Stauffer and Aharony, Introduction to Percolation Theory (1994)"


@accounted("none: counted")
def percolation(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Tell whether an island of the set crosses the plane along x, and along y.

    Along a free axis it crosses if it touches both ends; along a periodic one if it closes on itself around
    the period, in which it may also move along the other axis.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours). A
        set that crosses with 4 neighbours shuts its complement off with 8, across the crossing.
    periodic : bool, optional
        Whether islands go on across the edges; by default what the axes say. True is refused on a free axis.
    valid : DataArray of bool, optional
        Cells that were observed; the others are not in the set.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `coverage`; `largest_share`, the share of the set in its largest
        island (NaN for an empty plane); and over `axis` ("x", "y") too `percolates`.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, `connectivity` is not 1 or 2, or `periodic` is True on a free
        axis.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.percolation") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
    found = across(find(planes, connectivity, keep=False), planes)
    variables = {
        "coverage": planes.variable(planes.coverage),
        "largest_share": planes.variable(found["largest_share"]),
        "percolates": planes.variable(found["percolates"], "axis"),
        "run_time": ((), time.perf_counter() - begin),
    }
    notes = {"percolates": {"long_name": meaning(connectivity)}}
    dataset = assemble(planes, variables, {"axis": ("axis", np.array(AXES))}, notes=notes)
    parameters = {"mask": mask, "connectivity": connectivity, "periodic": periodic, "valid": valid}
    return stamp(
        dataset,
        "fractalcontact.domains.percolation",
        parameters,
        title="Percolation of a set",
        references=SOURCE,
    )


def across(found: Sequence[_labels.Labels], planes: Planes) -> dict[str, Array]:
    """Return the share of the largest island, and whether one crosses along x and along y."""
    largest = np.array([labels.sizes.max(initial=0) for labels in found])
    wraps = planes.grid.periodic
    return {
        "largest_share": np.where(planes.occupied > 0, largest / np.maximum(planes.occupied, 1), np.nan),
        "percolates": np.array([[labels.crosses(axis, wraps[axis]) for axis in (1, 0)] for labels in found]),
    }


def meaning(connectivity: int) -> str:
    """Say what percolates, and by which neighbours."""
    return f"an island of the set crosses the plane along the axis ({4 * connectivity} neighbours)"
