"""Reading labelled results: checks, required dims, coordinates and map extents."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.schema import CORE_DIMS
from fractalcontact.base.validation import NONE, Problems, Words, require
from fractalcontact.plotting._units import Quantity, Units, marked, name_of, require_units, scale_of, shown_in

D = TypeVar("D", xr.Dataset, xr.DataArray)
MAPS = ("height", "state", "slip_state", "label")
PATH_DIMS = ("member", "direction", "shear", "step", "axis", "method")


def result_of(
    data: Any, names: Sequence[str], dims: Sequence[str], units: Units | None = None, argument: str = "result"
) -> xr.Dataset:
    """Return a result in which every dim of `dims` exists and no other path dim is left.

    A missing dim is added with length one; another path dim of length one is dropped.

    Parameters
    ----------
    data : Dataset, DataArray, or node of a DataTree
    names : sequence of str
        Variables that must be present.
    dims : sequence of str
        Dims that the figure runs over (`shear`, `step` ...).
    units : mapping of str to str, optional
        Unit of each variable by name.
    argument : str
        Name of the argument, for the message.

    Raises
    ------
    InvalidInput
        A variable is missing, another path dim is longer than one, or a dim is the name of a variable.
    """
    dataset = shown_in(as_dataset(data, argument), units)
    require_variables(dataset, names, argument)
    own = {dim for name in names for dim in dataset[name].dims}
    extra = [dim for dim in dataset.dims if dim in PATH_DIMS and dim not in dims and dim in own]
    with Problems("fc.plotting") as problems:
        expected = "a result or a variable of it"
        problems.require(len(dataset.data_vars) > 0, argument, expected, Words("a coordinate"))
        for dim in (dim for dim in dims if dim in dataset.variables and dim not in dataset.dims):
            over = dataset[dim].dims  # a variable of this name, as the shear of `direct_shear` over points
            problems.require(not over, argument, f"a result over {dim}", f"one with {dim} over {over}")
        with problems.collect():
            dataset = without(dataset, extra, argument)
    return dataset.expand_dims([dim for dim in dims if dim not in dataset.dims])


def without(data: D, dims: Sequence[Hashable], place: str) -> D:
    """Return data without some dims, each of which must have length one."""
    with Problems("fc.plotting") as problems:
        for dim in dims:
            size = data.sizes[dim]
            problems.require(size == 1, place, f"one {dim}; choose with .sel or .isel", size)
    return data.isel(dict.fromkeys(dims, 0))


def by_name(results: Any, units: Units | None) -> dict[str, xr.Dataset]:
    """Return several results by name: a mapping or the children of a node; one alone has no name."""
    if isinstance(results, xr.DataTree) and results.children:
        results = {name: node.to_dataset(inherit=False) for name, node in results.children.items()}
    is_one = not isinstance(results, Mapping) or isinstance(results, xr.Dataset | xr.DataTree)
    datasets = {str(name): as_dataset(each) for name, each in ({"": results} if is_one else results).items()}
    if units is None:
        return datasets
    require_units(datasets.values(), units)
    return {name: marked(dataset, units) for name, dataset in datasets.items()}


def as_dataset(data: Any, argument: str = "result") -> xr.Dataset:
    """Return the valid Dataset of a result, of a tree's node or of a DataArray; (y, x) are its last dims."""
    if isinstance(data, xr.DataTree):
        data = data.to_dataset()
    if isinstance(data, xr.DataArray):
        name = "height" if data.name in (None, "") else data.name
        if name in data.dims:
            data = data.coords.to_dataset()
        elif name in data.coords:
            data = data.coords.to_dataset().drop_indexes(name, errors="ignore").reset_coords([name])
        else:
            data = data.rename(name).to_dataset()
    with Problems("fc.plotting") as problems:
        expected = "a labelled result (Dataset, DataArray or node of a DataTree)"
        if problems.require(isinstance(data, xr.Dataset), argument, expected, type(data).__name__):
            problems.result(argument, data)
            for name in MAPS:
                own = data[name].dims if name in data.variables else CORE_DIMS
                problems.require(set(CORE_DIMS) <= set(own), f"{argument}.{name}", "dims (..., y, x)", own)
    if "shear" in data.dims and "shear" in data.coords and (np.diff(data["shear"].values) < 0).any():
        data = data.sortby("shear")  # each was reached from the mated position: their order is no path
    first = [dim for dim in PATH_DIMS if dim in data.dims]
    result: xr.Dataset = data.transpose(*first, ..., *(dim for dim in CORE_DIMS if dim in data.dims))
    return result


def require_variables(dataset: xr.Dataset, names: Sequence[str], argument: str = "result") -> None:
    """Raise InvalidInput unless the variables are present."""
    with Problems("fc.plotting") as problems:
        present = list(dataset.variables)
        for name in names:
            problems.require(name in present, argument, f"the variable {name!r}", present)


def require_dims(dataset: xr.Dataset, dims: Mapping[str, str]) -> None:
    """Raise InvalidInput unless each of the variables has its dim."""
    with Problems("fc.plotting") as problems:
        for name, dim in dims.items():
            if problems.require(name in dataset.variables, "result", f"the variable {name!r}", NONE):
                own = dataset[name].dims
                problems.require(dim in own, f"result.{name}", f"the dim {dim}", own)


def require_known_dims(dataset: xr.Dataset, dims: Mapping[str, Sequence[str]]) -> None:
    """Raise InvalidInput if one of the variables has another dim than these."""
    with Problems("fc.plotting") as problems:
        for name, allowed in dims.items():
            own = dataset[name].dims
            problems.require(
                set(own) <= set(allowed), f"result.{name}", f"dims out of {', '.join(allowed)}", own
            )


def table(data: xr.Dataset, name: str, dims: Sequence[Hashable]) -> Array:
    """Return a variable as an array with exactly `dims`, repeated along those it does not have."""
    variable = without(data[name], [dim for dim in data[name].dims if dim not in dims], f"result.{name}")
    require(variable.dtype.kind in "biuf", f"result.{name}", "numbers", variable.dtype)
    repeated = {dim: data.sizes.get(dim, 1) for dim in dims if dim not in variable.dims}
    variable = variable.expand_dims(repeated)
    return np.asarray(variable.transpose(*dims).values, dtype=np.float64)


def quantity(
    data: xr.Dataset, name: str, dims: Sequence[Hashable], title: str = "", shown: Any = None
) -> Quantity:
    """Return a variable as `table` does, with its scale and name for an axis.

    `title` replaces the name; `shown` are all values on the axis, where they are more than the variable.
    """
    return Quantity(table(data, name, dims), scale_of(data[name], shown), title or name_of(data[name]))


def words(data: xr.DataArray) -> list[str]:
    """Return the strings of a coordinate, decoded if they were read as bytes."""
    return [v.decode() if isinstance(v, bytes) else str(v) for v in np.atleast_1d(data.values).tolist()]


def extent_of(plane: xr.DataArray | xr.Dataset) -> tuple[float, float, float, float]:
    """Return the left, right, bottom and top edge of a plane in metres, from its cell centres."""
    edges: list[float] = []
    for dim in ("x", "y"):
        n = plane.sizes[dim]
        centres = np.asarray(plane[dim].values, float) if dim in plane.coords else np.arange(n) + 0.5
        if n > 1:
            half = float(centres[-1] - centres[0]) / (n - 1) / 2
        else:
            half = float(plane[dim].attrs.get("period", 1.0) if dim in plane.coords else 1.0) / 2
        edges += [float(centres[0]) - half, float(centres[-1]) + half]
    return edges[0], edges[1], edges[2], edges[3]


def nearest(values: Any, target: float) -> int:
    """Return the index of the value nearest to `target`, ignoring NaN."""
    distance = np.abs(np.asarray(values, dtype=float) - target)
    return int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
