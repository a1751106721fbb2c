"""Results of several studies stacked along one dim: the members of an ensemble, or measured scans."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.schema import encoded, label
from fractalcontact.scenes._parts import concatenate

RAGGED = ("island", "link")  # dims whose length differs from study to study: their rows are listed
BLANK = {"b": False, "U": "", "S": b""}  # by kind of type; of numbers not a number


def stacked(results: Mapping[Any, xr.Dataset], dim: str) -> xr.Dataset:
    """Return results as one along `dim`, whose coordinate are their keys.

    Words and numbers that label a dim are joined. Where scales in metres differ, the dim becomes their
    `..._number`: the values stand one after the other, NaN behind the last, and the scales beside them. Rows
    of `RAGGED` dims are listed, each with its key.
    """
    aligned = _aligned(list(results.values()))
    loads = _own_coords(aligned)
    each = [_numbered(*entry, dim, loads) for entry in zip(aligned, results, strict=True)]
    shared = set.intersection(*(set(result.variables) for result in each))
    common = [result.drop_vars(set(result.variables) - shared) for result in each]
    joined = concatenate([result.drop_dims(RAGGED, errors="ignore") for result in common], dim)
    for rows in (rows for rows in RAGGED if rows in common[0].dims):
        joined = joined.merge(concatenate([_rows(result, rows) for result in common], rows))
    return encoded(joined)


def _aligned(results: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return results whose dims, but for ragged ones, are equally long and have equal coordinates."""
    aligned = list(results)
    for dim in dict.fromkeys(dim for result in results for dim in result.dims if dim not in RAGGED):
        indexes = [result.get_index(dim) for result in aligned if dim in result.dims]
        if all(index.equals(indexes[0]) for index in indexes):
            continue
        if any(index.dtype.kind == "f" for index in indexes):
            aligned = [_by_number(result, dim) for result in aligned]
            dim = f"{dim}_number"
        having = [result for result in aligned if dim in result.dims]
        union = list(dict.fromkeys(value for result in having for value in result.get_index(dim)))
        aligned = [_reindexed(result, dim, union) for result in aligned]
    return aligned


def _by_number(result: xr.Dataset, dim: Hashable) -> xr.Dataset:
    """Return a result over the numbers of the values along a dim; the values are a further coordinate."""
    if dim not in result.dims:
        return result
    number = f"{dim}_number"
    if dim not in result.coords:
        return result.rename_dims({dim: number})
    flat = result.drop_indexes(
        [name for name, coord in result.coords.items() if name in result.xindexes and coord.dims == (dim,)]
    )
    return flat.rename_dims({dim: number}).assign_attrs(result.attrs)


def _reindexed(result: xr.Dataset, dim: Hashable, values: list[Any]) -> xr.Dataset:
    if dim not in result.dims:
        return result
    has_coord = dim in result.coords
    indexed = result if has_coord else result.assign_coords({dim: result.get_index(dim)})
    blank = {
        name: BLANK[variable.dtype.kind]
        for name, variable in result.variables.items()
        if variable.dtype.kind in BLANK and name != dim
    }
    full = indexed.reindex(
        {dim: values},
        fill_value=blank | dict.fromkeys(result.variables.keys() - blank.keys() - {dim}, np.nan),
    )
    return full if has_coord else full.drop_vars([dim])


def _own_coords(results: Sequence[xr.Dataset]) -> set[Hashable]:
    """Return the coordinates that each result has for itself: loads, and all that differ."""
    own = {name for result in results for name, coord in result.coords.items() if "step" in coord.dims}
    for name, first in results[0].coords.items():
        others = (result.coords.get(name) for result in results[1:])
        if first.dims and any(
            other is not None and not first.variable.equals(other.variable) for other in others
        ):
            own.add(name)
    return {name for name in own if name not in (*results[0].dims, *RAGGED)}


def _numbered(result: xr.Dataset, key: Any, dim: str, own: set[Hashable]) -> xr.Dataset:
    """Return a result with its key as first dim, and beside every row of a ragged dim."""
    plain = result.drop_dims(RAGGED, errors="ignore")
    coords = [name for name in plain.coords if name in own]
    plain = plain.drop_indexes(coords, errors="ignore").reset_coords(coords)
    dataset = plain.expand_dims({dim: [key]}).set_coords(coords)
    dataset = dataset.assign_coords({dim: label(dataset[dim])})
    for rows in (rows for rows in RAGGED if rows in result.dims):
        keys = xr.DataArray(np.full(result.sizes[rows], key), dims=rows, name=f"{rows}_{dim}")
        dataset = dataset.merge(_rows(result, rows)).assign_coords({keys.name: label(keys)})
    for name, variable in result.variables.items():
        dataset[name].attrs = dict(variable.attrs)
    return dataset.assign_attrs(result.attrs)


def _rows(result: xr.Dataset, dim: str) -> xr.Dataset:
    """Return the variables along a dim, and none of the others."""
    return result.drop_vars([name for name, variable in result.variables.items() if dim not in variable.dims])
