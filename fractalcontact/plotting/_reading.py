"""Taking from a labelled result what a figure shows, whatever dims it came with."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]


def result_of(data: Any, where: str, names: Sequence[str], dims: Sequence[str]) -> xr.Dataset:
    """Return a result with exactly `dims` ahead of its other dims.

    A dim that is missing is added with length one, a leftover of length one is dropped.

    Parameters
    ----------
    data : Dataset, DataArray, or node of a DataTree
    where : str
        Name of the plotting function, for the message.
    names : sequence of str
        Variables that must be there.
    dims : sequence of str
        Dims that a figure runs over (`shear`, `step` ...).

    Raises
    ------
    InvalidInput
        Something is missing, or a further dim is longer than one.
    """
    dataset = as_dataset(data, where)
    with Problems(f"fc.plotting.{where}") as problems:
        for name in names:
            problems.require(
                name in dataset.variables, "result", f"the variable {name!r}", list(dataset.variables)
            )
        extra = [
            dim
            for dim in dataset.dims
            if dim in PATH_DIMS
            and dim not in dims
            and any(dim in dataset[n].dims for n in names if n in dataset)
        ]
        for dim in extra:
            problems.require(
                dataset.sizes[dim] == 1, "result", f"one {dim}; choose with .sel or .isel", dataset.sizes[dim]
            )
    dataset = dataset.isel(dict.fromkeys(extra, 0))
    return dataset.expand_dims([dim for dim in dims if dim not in dataset.dims])


PATH_DIMS = ("member", "direction", "shear", "step", "axis", "method")


def as_dataset(data: Any, where: str) -> xr.Dataset:
    """Return the Dataset in `data`: itself, that of a tree's node, or of one variable."""
    import xarray as xr

    if isinstance(data, xr.Dataset):
        return data
    if isinstance(data, xr.DataTree):
        return data.to_dataset()
    if isinstance(data, xr.DataArray):
        return data.to_dataset(name="height" if data.name is None else str(data.name))
    with Problems(f"fc.plotting.{where}") as problems:
        problems.add(
            "result", "a labelled result (Dataset, DataArray or node of a DataTree)", type(data).__name__
        )
    raise AssertionError


def table(data: xr.Dataset, name: str, dims: Sequence[Hashable]) -> Array:
    """Return the numbers of a variable with exactly `dims`, repeated along those it does not have."""
    variable = data[name]
    for dim in dims:
        if dim not in variable.dims:
            variable = variable.expand_dims({dim: data.sizes[dim]})
    return np.asarray(variable.transpose(*dims).values, dtype=np.float64)


def words(data: xr.DataArray) -> list[str]:
    """Return the texts of a coordinate, whether they were read as text or as bytes."""
    return [v.decode() if isinstance(v, bytes) else str(v) for v in np.atleast_1d(data.values).tolist()]


def extent_of(plane: xr.DataArray | xr.Dataset) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top edge of a plane in metres, from its cell centres."""
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


def nearest(values: Any, wanted: float) -> int:
    """Return the index of the number nearest to `wanted`, NaN never."""
    distance = np.abs(np.asarray(values, dtype=float) - wanted)
    return int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
