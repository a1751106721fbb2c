"""Description of a set: the measures of every function of this subpackage, collected in one dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import contact_edges
from fractalcontact.base.results import REASONS, public_result
from fractalcontact.base.schema import NOTES
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


Variable = tuple[tuple[str, ...], Array]


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
    measurements = measure_planes(planes, wanted, components, connectivity)
    if planes.rank == 2:
        measurements.add_dataset(_signature.analyse(planes, components))
    variables = {
        name: variable
        for name, variable in measurements.variables.items()
        if not set(variable[0]) & set(CURVES)
    }
    coords = {name: values for name, values in measurements.coords.items() if name in ("axis", "scale")}
    notes = {name: note for name, note in measurements.notes.items() if name in variables}
    return planes.dataset(variables, coords, notes=notes)


class Measurements:
    """Variables, coordinates and notes of several analyses of the same planes."""

    def __init__(self, planes: Planes) -> None:
        self.planes = planes
        self.variables: dict[str, Variable] = {"coverage": planes.variable(planes.coverage)}
        self.coords: dict[str, Any] = {}
        self.notes: dict[str, dict[str, str]] = {}

    def add_dataset(self, dataset: xr.Dataset) -> None:
        """Add the variables of a result that has names of its own."""
        for name, variable in dataset.variables.items():
            if name in dataset.coords and name not in self.planes.coords:
                self.coords[str(name)] = variable
            elif name not in dataset.coords and name != "run_time":
                self.variables[str(name)] = tuple(map(str, variable.dims)), variable.values
                notes = {key: variable.attrs[key] for key in NOTES if key in variable.attrs}
                if notes:
                    self.notes[str(name)] = notes


def measure_planes(
    planes: Planes, wanted: Sequence[str], components: Sequence[Components], connectivity: int
) -> Measurements:
    """Measure what is wanted out of `MEASURES`; `components` are needed for islands and percolation."""
    result = Measurements(planes)
    if "islands" in wanted:
        values = _islands.island_scalars(components, planes, connectivity)
        if planes.rank == 2:
            sides = np.array(planes.grid.spacing[::-1])
            perimeter = contact_edges(planes.cells, planes.grid.periodic) @ sides
            values = {"total_perimeter": perimeter, **values}
        result.variables.update({name: planes.variable(array) for name, array in values.items()})
    if "percolation" in wanted:
        result.add_dataset(_islands.crossings(components, planes, connectivity))
    datasets = {name: module.analyse(planes) for name, module in ANALYSES.items() if name in wanted}
    box_sizes = [dataset["box_size"].values for dataset in datasets.values() if "box_size" in dataset.coords]
    all_sizes = np.unique(np.concatenate([np.empty(0, np.int64), *box_sizes]))
    if all_sizes.size:
        result.coords |= planes.box_coords(all_sizes)
    for name, dataset in datasets.items():
        _add_analysis(result, name, dataset, all_sizes)
    return result


def _add_analysis(result: Measurements, name: str, dataset: xr.Dataset, all_sizes: Array) -> None:
    """Add the variables of one analysis, under names that are unique among all of them."""
    for key, variable in dataset.variables.items():
        if key in dataset.coords or key in NOT_COLLECTED:
            continue
        new, dims, values = _unique_name(name, str(key)), tuple(map(str, variable.dims)), variable.values
        if "comment" in variable.attrs:
            result.notes[new] = {"comment": variable.attrs["comment"]}
        if "box_size" in dims and values.shape[-1] < all_sizes.size:
            own = f"; {REASONS[new]}" if new in REASONS and np.isnan(values).any() else ""
            result.notes.setdefault(new, {})["reason"] = OTHER_SIZES + own
            values = _on_sizes(all_sizes, dataset["box_size"].values, values)
        result.variables[new] = dims, values
    if "radius" in dataset.coords:
        result.coords["radius"] = ("radius", dataset["radius"].values)
        result.coords["radius_length"] = ("radius", dataset["radius_length"].values)
    if "scale_min" in dataset and np.isfinite(dataset["scale_min"]).any():
        low, high = float(dataset["scale_min"].max()), float(dataset["scale_max"].max())
        note = result.notes.setdefault(name, {})
        reason = f"{note['comment']}; " if "comment" in note else ""
        note["comment"] = f"{reason}fitted over {low:.3g} to {high:.3g} cells"


def _unique_name(analysis: str, name: str) -> str:
    """Return the name of a variable of an analysis beside those of the others."""
    if name in ("ci_low", "ci_high"):
        return f"{analysis}_{name.removeprefix('ci_')}"
    prefix = analysis.removesuffix("_dimension")
    if name == "local_slope" or (name == "null_dimension" and prefix != "box"):
        return f"{prefix}_{name}"
    return name


def _on_sizes(all_sizes: Array, sizes: Array, values: Array) -> Array:
    """Spread a curve over all sizes; NaN where it was not measured."""
    result = np.full((*values.shape[:-1], all_sizes.size), np.nan)
    result[..., np.searchsorted(all_sizes, sizes)] = values
    return result
