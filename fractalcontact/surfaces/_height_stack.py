"""Check of measured heights with gaps, their values as a stack of planes or profiles, and results of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims
from fractalcontact.base.labelled import drop_unknown_coords, leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.validation import Problems


def check_stack(problems: Problems, *, smallest: int = 2) -> bool:
    """Check for planes or profiles of heights that may have gaps (NaN) but no infinite values."""
    if not problems.surface("surface", finite=False, smallest=smallest, leading=True, profile=True):
        return False
    infinite = int(np.count_nonzero(np.isinf(problems.given.surface.values)))
    expected = "finite heights, or NaN where missing"
    return problems.require(infinite == 0, "surface", expected, f"{infinite} infinite")


def height_stack(surface: xr.DataArray) -> Array:
    """Return a copy of the heights as float64, shape (planes, ny, nx) or (planes, nx)."""
    values = np.array(surface.values, dtype=np.float64)
    return values.reshape(-1, *values.shape[values.ndim - len(core_dims(surface)) :])


def with_heights(surface: xr.DataArray, heights: Array) -> xr.DataArray:
    """Return a surface with other heights on the same points, without the attributes of its own."""
    result = drop_unknown_coords(surface.copy(data=heights.reshape(surface.shape)).rename("height"))
    result.attrs = {}
    return result


def labelled_rows(surface: xr.DataArray, rows: Sequence[Mapping[str, float]]) -> xr.Dataset:
    """Return the quantities of each plane of a surface, a row each, over its leading dims."""
    leading = surface.dims[: surface.ndim - len(core_dims(surface))]
    sizes = surface.shape[: len(leading)]
    columns = {name: np.array([row[name] for row in rows]).reshape(sizes) for name in rows[0]}
    coords = leading_coords(surface, leading, (*columns, "run_time"))
    return xr.Dataset({name: (leading, values) for name, values in columns.items()}, coords)
