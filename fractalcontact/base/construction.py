"""Datasets and DataArrays made of parts that fit, many times as fast as by the constructors of xarray.

`xarray.Dataset` compares, aligns and copies whatever it is given: a third of a millisecond for twenty
variables, as long as the analysis of a small mask. With its first array it also imports dask, where that is
installed: a quarter of a second. Here numbers and NumPy arrays become variables as they are.

xarray has no public function for this; no other module uses `Dataset._construct_direct`. Parts of another
kind (dask arrays, labelled arrays, dates, objects) go through the usual constructors, and so does everything
with a version of xarray that has no such function.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import xarray as xr
from xarray.indexes import Index, PandasIndex

DIRECT = getattr(xr.Dataset, "_construct_direct", None)
PLAIN = "biufcU"  # kinds of numbers and words that a variable and its index hold unchanged
Variables = dict[Hashable, xr.Variable]


def make_dataset(
    variables: Mapping[str, Any], coords: Mapping[str, Any], attrs: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Return ``xarray.Dataset(variables, coords, attrs)``.

    Parameters
    ----------
    variables, coords : dict
        By name a number, a tuple (dims, values) or (dims, values, attributes), or an xarray Variable. The
        coordinate of a dim is among `coords`, and may be an array alone.
    attrs : dict, optional
    """
    parts, labels = _parts(variables), _parts(coords, along=True)
    if parts is None or labels is None or any(name in part.dims for name, part in parts.items()):
        return xr.Dataset(variables, coords, attrs)
    if DIRECT is None:
        return xr.Dataset(parts, labels, attrs)
    indexes = _index(labels)
    attrs = None if attrs is None else dict(attrs)
    made: xr.Dataset = DIRECT(parts | labels, set(labels), attrs=attrs, indexes=indexes)
    return made


def make_array(values: Any, dims: Sequence[str], coords: Mapping[str, Any], name: str) -> xr.DataArray:
    """Return ``xarray.DataArray(values, coords, dims, name)``; `coords` as in `make_dataset`."""
    parts, labels = _parts({name: (tuple(dims), values)}), _parts(coords, along=True)
    if parts is None or labels is None:
        return xr.DataArray(values, coords, dims, name)
    lengths = parts[name].sizes
    if any(part.sizes != {dim: lengths.get(dim) for dim in part.dims} for part in labels.values()):
        return xr.DataArray(values, coords, dims, name)  # which raises the error
    indexes = _index(labels)
    return xr.DataArray(parts[name], labels, name=name, indexes=indexes, fastpath=True)


def with_variables(dataset: xr.Dataset, variables: Variables) -> xr.Dataset:
    """Return a Dataset with other variables, but the same coordinates, indexes and attributes."""
    if DIRECT is None:
        made = dataset.drop_vars(set(dataset.data_vars)).assign(variables)
        made.encoding = dict(dataset.encoding)
        return made
    changed: xr.Dataset = DIRECT(
        variables,
        set(dataset.coords),
        attrs=dict(dataset.attrs),
        indexes=dict(dataset.xindexes),
        encoding=dict(dataset.encoding),
    )
    return changed


def _parts(given: Mapping[str, Any], *, along: bool = False) -> Variables | None:
    """Return new variables of what is given, an array alone `along` its own dim; None if one is unusual."""
    parts: Variables = {}
    for name, value in given.items():
        dims = (name,) if along and isinstance(value, np.ndarray) and value.ndim == 1 else ()
        part = _variable(value, dims)
        if part is None or (name in part.dims and part.ndim > 1):
            return None
        parts[name] = part
    return parts


def _variable(value: Any, dims: tuple[str, ...] = ()) -> xr.Variable | None:
    """Return a variable, which is new; None where it is not made of numbers or words."""
    if isinstance(value, xr.Variable):
        return value.copy(deep=False)
    attrs = None
    if isinstance(value, tuple):
        given, value, attrs = (*value, None)[:3]
        dims = (given,) if isinstance(given, str) else tuple(given)
    if not isinstance(value, (np.ndarray, np.generic, int, float, list)):
        return None
    array = np.asarray(value)
    if (type(value) not in (np.ndarray, list) and array.ndim) or array.dtype.kind not in PLAIN:
        return None
    if len(dims) != array.ndim:
        raise ValueError(f"expected {array.ndim} dims of an array of shape {array.shape}, got {dims}")
    return xr.Variable(dims, array, attrs, fastpath=True)


def _index(coords: Variables) -> dict[Hashable, Index]:
    """Make the coordinates of dims index variables, in place, and return their indexes."""
    indexes: dict[Hashable, Index] = {}
    for name, part in coords.items():
        if part.dims != (name,):
            continue
        if isinstance(part, xr.IndexVariable):
            indexes[name] = PandasIndex(part.to_index(), name, part.dtype)
        else:
            indexes[name] = index = PandasIndex(pd.Index(part.values, name=name), name, part.dtype)
            coords.update(index.create_variables({name: part}))
    return indexes


def joined_along(dim: str, datasets: Sequence[xr.Dataset]) -> xr.Dataset | None:
    """Return Datasets joined along a dim; attributes, and the variables that lack the dim, are of the first.

    None where their variables are not alike, or those along the dim are no numbers in memory: `xarray.concat`
    joins these, and takes ten times as long.
    """
    first, every = datasets[0], [dict(dataset.variables) for dataset in datasets]
    if (
        DIRECT is None
        or dim not in every[0]
        or any(variables.keys() != every[0].keys() for variables in every)
    ):
        return None
    joined: Variables = {}
    for name, variable in sorted(every[0].items(), key=lambda entry: entry[0] in first.coords):  # these last
        parts = [variables[name] for variables in every]
        if any(part.dims != variable.dims or part.dtype != variable.dtype for part in parts):
            return None
        if dim not in variable.dims:
            joined[name] = variable.copy(deep=False)
            continue
        arrays = [part.values if isinstance(part, xr.IndexVariable) else part.data for part in parts]
        if variable.dtype.kind not in "biuf" or any(type(array) is not np.ndarray for array in arrays):
            return None
        values = np.concatenate(arrays, axis=variable.dims.index(dim))
        joined[name] = xr.Variable(variable.dims, values, variable.attrs, fastpath=True)
    along: Variables = {dim: joined[dim]}
    indexes = dict(first.xindexes) | _index(along)
    names, attrs = set(first.coords), dict(first.attrs)
    whole: xr.Dataset = DIRECT(
        joined | along, names, attrs=attrs, indexes=indexes, encoding=dict(first.encoding)
    )
    return whole
