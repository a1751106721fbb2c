"""Percolation: whether a set crosses the plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._masks import Array, Planes, read_planes

AXES = ("x", "y")
SOURCE = "Stauffer and Aharony, Introduction to Percolation Theory (1994)"


@public_result(title="Percolation of a set", references=SOURCE, achieved_error="exact", check=check_connected)
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
    values = crossings(label_planes(planes, connectivity, keep=False), planes)
    variables = {
        "coverage": planes.variable(planes.coverage),
        "largest_share": planes.variable(values["largest_share"]),
        "percolates": planes.variable(values["percolates"], "axis"),
    }
    notes = {"percolates": {"long_name": percolation_name(connectivity)}}
    return planes.dataset(variables, {"axis": ("axis", np.array(AXES))}, notes=notes)


def crossings(components: Sequence[Components], planes: Planes) -> dict[str, Array]:
    """Return the share of the largest island, and whether one crosses along x and along y."""
    largest = np.array([plane.sizes.max(initial=0) for plane in components])
    periodic = planes.grid.periodic
    crosses = [[plane.percolates(axis, periodic[axis]) for axis in (1, 0)] for plane in components]
    return {
        "largest_share": np.where(planes.occupied > 0, largest / np.maximum(planes.occupied, 1), np.nan),
        "percolates": np.array(crosses),
    }


def percolation_name(connectivity: int) -> str:
    """Return the long name of `percolates`, with the number of neighbours."""
    return f"an island of the set crosses the plane along the axis ({4 * connectivity} neighbours)"
