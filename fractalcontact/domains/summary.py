"""Every scalar of a contact domain at once."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import contact_edges
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import crossing, labelling
from fractalcontact.domains._masks import assemble, read_mask
from fractalcontact.domains.counting import box_dimension
from fractalcontact.domains.edges import boundary_dimension
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
        `box_dimension_low` and `box_dimension_high`, `dust_dimension`, `dust_spread`, `differs_from_dust`
        (see `box_dimension`); `boundary_dimension` with its interval (see `boundary_dimension`);
        `lacunarity` and `dust_lacunarity` at the `box_size` of 8 cells, or of the shorter side if that is
        less (see `lacunarity`).

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
    boxes = box_dimension(mask, **told)
    edge = boundary_dimension(mask, **told)
    gaps = lacunarity(mask, [min(BOX, *planes.grid.shape)], **told).isel(box_size=0)
    found = labelling.find(planes, connectivity, keep=False)
    crossed = crossing.across(found, planes)
    dy, dx = planes.grid.spacing if planes.grid.known else (np.nan, np.nan)
    sides = contact_edges(planes.cells, planes.grid.periodic) @ np.array([dx, dy])
    scalars = {
        "coverage": planes.coverage,
        "total_perimeter": sides,
        **labelling.summary(found, planes, connectivity),
        "largest_share": crossed["largest_share"],
        **{
            name: boxes[name]
            for name in ("box_dimension", "dust_dimension", "dust_spread", "differs_from_dust")
        },
        "box_dimension_low": boxes["ci_low"],
        "box_dimension_high": boxes["ci_high"],
        "boundary_dimension": edge["boundary_dimension"],
        "boundary_dimension_low": edge["ci_low"],
        "boundary_dimension_high": edge["ci_high"],
        "lacunarity": gaps["lacunarity"],
        "dust_lacunarity": gaps["dust_lacunarity"],
    }
    variables = {name: planes.variable(np.asarray(values).ravel()) for name, values in scalars.items()}
    variables["percolates"] = planes.variable(crossed["percolates"], "axis")
    variables["run_time"] = ((), np.asarray(time.perf_counter() - begin))
    coords = {"axis": ("axis", np.array(crossing.AXES)), "box_size": ((), gaps["box_size"].values)}
    notes = {"percolates": {"long_name": crossing.meaning(connectivity)}}
    for name, source in (("box_dimension", boxes), ("boundary_dimension", edge), ("lacunarity", gaps)):
        if "comment" in source[name].attrs:
            notes[name] = {"comment": source[name].attrs["comment"]}
    dataset = assemble(planes, variables, coords, notes=notes)
    parameters = {"mask": mask, "connectivity": connectivity, "periodic": periodic, "valid": valid}
    return stamp(dataset, "fractalcontact.domains.describe", parameters, title="Description of a set")
