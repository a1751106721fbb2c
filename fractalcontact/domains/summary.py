"""Every scalar of a contact domain at once."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import gathering, labelling
from fractalcontact.domains._masks import assemble, read_mask
from fractalcontact.domains.gliding import lacunarity

if TYPE_CHECKING:
    import xarray as xr

BOX = 8  # cells; the size at which lacunarity is quoted


def describe(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Every scalar of a set at once, along any leading dims.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether the set goes on across the edges; by default what the axes say. True is refused on a free
        axis.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `coverage`; `total_perimeter` (m), along the sides of cells inside
        the extent; `n_islands`, `largest_cells`, `largest_island`, `mean_island_area` (m2), `largest_share`,
        `euler_number` (see `islands`); `percolates` over `axis` (see `percolation`); `box_dimension` with
        `box_dimension_low` and `box_dimension_high`, `null_dimension`, `null_spread`, `differs_from_random`
        (see `box_dimension`); `minkowski_dimension`, `correlation_dimension` and `boundary_dimension`, each
        with its interval (`_low`, `_high`), the first two with that of a dust (`minkowski_null_dimension`,
        `correlation_null_dimension`); `boundary_sides`; `lacunarity` and `null_lacunarity` at the `box_size`
        of 8 cells, or of the shorter side if that is less, and the whole curve as one number,
        `lacunarity_slope` and `lacunarity_area`, with those of a dust (see `lacunarity`).

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, `connectivity` is not 1 or 2, or `periodic` is True on a free
        axis.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.describe") as problems:
        problems.integer("connectivity", connectivity, at_least=1, at_most=2)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
    told: dict[str, Any] = {"periodic": periodic, "valid": valid}
    found = labelling.find(planes, connectivity, keep=False)
    gathered = gathering.measure(mask, planes, gathering.PARTS, found, connectivity, told)
    size = min(BOX, *planes.grid.shape)
    gaps = lacunarity(mask, [size], **told).isel(box_size=0)
    variables: dict[str, Any] = {
        **gathered.scalars(),
        "percolates": gathered.variables["percolates"],
        **{name: (planes.dims, gaps[name].values) for name in ("lacunarity", "null_lacunarity")},
        "run_time": ((), time.perf_counter() - begin),
    }
    coords = {"axis": gathered.coords["axis"], "box_size": ((), np.int64(size))}
    notes = {name: note for name, note in gathered.notes.items() if name in variables}
    dataset = assemble(planes, variables, coords, notes=notes)
    parameters = {"mask": mask, "connectivity": connectivity, "periodic": periodic, "valid": valid}
    return stamp(dataset, "fractalcontact.domains.describe", parameters, title="Description of a set")
