"""Description of a set: the measures of every function of this subpackage, collected in one dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import contact_edges
from fractalcontact.base.results import REASONS, public_result
from fractalcontact.base.study import joined_references
from fractalcontact.base.validation import Problems
from fractalcontact.domains import (
    _boundary,
    _box_counting,
    _correlation,
    _islands,
    _lacunarity,
    _minkowski,
    _signature,
)
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._masks import Array, Planes, read_planes

ANALYSES: dict[str, Any] = {  # modules with a function `analyse` of planes
    "box_dimension": _box_counting,
    "minkowski_dimension": _minkowski,
    "correlation_dimension": _correlation,
    "boundary_dimension": _boundary,
    "lacunarity": _lacunarity,
}
SOURCES = {"islands": _islands.SOURCE, "percolation": _islands.CROSSING_SOURCE}
SOURCES |= {name: module.SOURCE for name, module in ANALYSES.items()}
MEASURES = tuple(SOURCES)
DESCRIBED = ("islands", "percolation", *(name for name in ANALYSES if name != "lacunarity"))  # a curve alone
DESCRIBED_OF_PROFILES = ("islands", "box_dimension", "correlation_dimension")
NOT_COLLECTED = ("scale_min", "scale_max", "run_time", "integral_range")
CURVES = ("box_size", "radius", "side")  # the dims of curves, which `describe` leaves out
OTHER_SIZES = "NaN at sizes of boxes that only the other measures have"


def sources(measures: Sequence[str]) -> str:
    """Return the sources of several measures."""
    return joined_references(*(SOURCES[name] for name in measures))


def _check(problems: Problems) -> None:
    check_connected(problems, profiles=True)


@public_result(title="Description of a set", references=sources(MEASURES), check=_check)
def describe(
    mask: xr.DataArray,
    *,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Describe a set by all scalar measures of this subpackage, along any leading dims.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        Boolean, or integer flags where contact means value > 0.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether the set continues across the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells.

    Returns
    -------
    Dataset
        Over the leading dims: `coverage`; `total_perimeter` (m), along the sides of cells inside the extent;
        `n_islands`, `largest_cells`, `largest_island`, `mean_island_area` (m2), `euler_number` (see
        `islands`); `largest_share` and, over `axis`, `percolates` (see `percolation`); `box_dimension`,
        `null_dimension`, `null_spread`, `differs_from_random` (see `box_dimension`); `minkowski_dimension`,
        `correlation_dimension`, `boundary_dimension`; each dimension with its interval (`_low`, `_high`);
        `minkowski_null_dimension`, `correlation_null_dimension` of the random null; `boundary_sides`; and
        the numbers of `signature`, also over `scale`. Of a profile, what is defined on a line: islands by
        length, box and correlation dimension.

    Raises
    ------
    InvalidInput
        The mask, `connectivity`, `periodic` or `valid` is not as described.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> mask = xr.DataArray(np.indices((32, 32)).sum(0) < 16, dims=("y", "x"))
    >>> result = fc.domains.describe(mask)
    >>> int(result.n_islands), round(float(result.coverage), 3), result.percolates.values.tolist()
    (1, 0.133, [False, False])
    """
    planes = read_planes(mask, valid=valid, periodic=periodic)
    components = label_planes(planes, connectivity, keep=False)
    wanted = DESCRIBED if planes.rank == 2 else DESCRIBED_OF_PROFILES
    results = [measure_planes(planes, wanted, components, connectivity)]
    if planes.rank == 2:
        results.append(_signature.analyse(planes, components))
    result = updated(results)
    return result.drop_dims([dim for dim in CURVES if dim in result.dims])


def updated(results: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return one dataset of several results of the same planes; of variables of one name the last."""
    result, *others = _without_own_names(results)
    for other in others:
        result.update(other)
    return result


def _without_own_names(results: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return results without the coordinates of the mask that are called as a variable of one of them."""
    names = {name for each in results for name in each.data_vars}
    return [each.drop_vars(names & set(each.coords)) for each in results]


def measure_planes(
    planes: Planes, wanted: Sequence[str], components: Sequence[Components], connectivity: int
) -> xr.Dataset:
    """Measure what is wanted out of `MEASURES`; `components` are needed for islands and percolation."""
    values: dict[str, Array] = {"coverage": planes.coverage}
    if "islands" in wanted:
        if planes.rank == 2:
            sides = np.array(planes.grid.spacing[::-1])
            values["total_perimeter"] = contact_edges(planes.cells, planes.grid.periodic) @ sides
        values |= _islands.island_scalars(components, planes, connectivity)
    results = [planes.dataset({name: planes.variable(array) for name, array in values.items()})]
    if "percolation" in wanted:
        results.append(_islands.crossings(components, planes, connectivity))
    analyses = [_renamed(name, module.analyse(planes)) for name, module in ANALYSES.items() if name in wanted]
    sizes = [each["box_size"].values for each in analyses if "box_size" in each.coords]
    if sizes:  # those of every analysis come first, as their lengths would have gaps
        results.append(planes.dataset({}, planes.box_coords(np.unique(np.concatenate(sizes)))))
    results = _without_own_names([*results, *analyses])
    result = xr.merge(results, join="outer", compat="override", combine_attrs="override")
    for name, variable in ((name, each.variables[name]) for each in analyses for name in each.data_vars):
        if variable.sizes.get("box_size", np.inf) < result.sizes.get("box_size", 0):
            own = f"; {REASONS[name]}" if name in REASONS and np.isnan(variable.values).any() else ""
            result.variables[name].attrs["reason"] = OTHER_SIZES + own
    return result


def _renamed(analysis: str, dataset: xr.Dataset) -> xr.Dataset:
    """Return the result of an analysis under names that are unique among all of them.

    Of the attributes of its variables it keeps the comments, and units where these are not the usual ones.
    """
    names = {
        name: _unique_name(analysis, str(name)) for name in dataset.data_vars if name not in NOT_COLLECTED
    }
    result = dataset[list(names)].rename(names)
    for name in result.data_vars:
        attributes = result.variables[name].attrs
        kept = {key: attributes[key] for key in ("comment", "units") if key in attributes}
        result.variables[name].attrs = kept
    scales = [dataset.variables[end].values for end in ("scale_min", "scale_max") if end in dataset]
    if np.isfinite(scales).any():
        low, high = np.nanmax(scales, axis=tuple(range(1, np.ndim(scales))))
        note = result.variables[analysis].attrs
        reason = f"{note['comment']}; " if "comment" in note else ""
        note["comment"] = f"{reason}fitted over {low:.3g} to {high:.3g} cells"
    return result


def _unique_name(analysis: str, name: str) -> str:
    """Return the name of a variable of an analysis beside those of the others."""
    if name in ("ci_low", "ci_high"):
        return f"{analysis}_{name.removeprefix('ci_')}"
    prefix = analysis.removesuffix("_dimension")
    if name == "local_slope" or (name == "null_dimension" and prefix != "box"):
        return f"{prefix}_{name}"
    return name
