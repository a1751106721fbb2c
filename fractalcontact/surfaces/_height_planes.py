"""Check of measured heights with gaps, and their values as a stack of planes or profiles."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims
from fractalcontact.base.numbers import Array
from fractalcontact.base.validation import Problems


def check_planes(problems: Problems) -> bool:
    """Check for planes or profiles of heights that may have gaps (NaN) but no infinite values."""
    if not problems.surface("surface", finite=False, smallest=2, leading=True, profile=True):
        return False
    infinite = int(np.count_nonzero(np.isinf(problems.given.surface.values)))
    expected = "finite heights, or NaN where missing"
    return problems.require(infinite == 0, "surface", expected, f"{infinite} infinite")


def height_planes(surface: xr.DataArray) -> Array:
    """Return a copy of the heights as float64, shape (planes, ny, nx) or (planes, nx)."""
    values = np.array(surface.values, dtype=np.float64)
    return values.reshape(-1, *values.shape[values.ndim - len(core_dims(surface)) :])
