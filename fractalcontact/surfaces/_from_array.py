"""Heights in an array of the user's own, as a surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import as_array
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import GIVEN, Problems
from fractalcontact.surfaces._new_surface import axis_spacing, check_memory, check_spacing, surface_array


def check_heights(problems: Problems, heights: Any = GIVEN) -> int | None:
    """Check for heights of planes or profiles; return 2 or 1, the axes of a plane, or None if they are wrong.

    A DataArray ends in dims (y, x) or (x,), and its leading dims have names of `base.schema`.
    """
    heights = problems.given.heights if heights is GIVEN else heights
    values = _real_array(heights)
    if values is None:
        problems.add("heights", "an array of real numbers", heights)
        return None
    if not _is_lazy(values):
        check_memory(problems.where, values.shape)
    before = len(problems.messages)
    axes = _plane_axes(heights, values.ndim)
    if isinstance(heights, xr.DataArray):
        core = ("y", "x")[2 - axes :]
        problems.require(
            heights.dims[-axes:] == core, "heights.dims", "(..., y, x) or (..., x)", heights.dims
        )
        for name in heights.dims[:-axes]:
            expected = "leading dims such as 'member', 'shear'"
            problems.require(name in QUANTITIES, "heights.dims", expected, name)
    else:
        expected = "shape (ny, nx), (nx,) or (members, ny, nx)"
        problems.require(values.ndim in (1, 2, 3), "heights", expected, values)
    for name, size in zip(("y", "x")[2 - axes :], values.shape[-axes:] if axes else (), strict=False):
        problems.require(size >= 2, f"heights ({name})", "at least 2 points", size)
    if not _is_lazy(values):
        is_infinite = np.isinf(np.ma.getdata(values))
        if is_infinite.any():
            is_infinite &= ~np.ma.getmaskarray(values)
        infinite = int(np.count_nonzero(is_infinite))
        problems.require(
            infinite == 0, "heights", "finite values, or NaN where missing", f"{infinite} infinite"
        )
    return axes if len(problems.messages) == before else None


def _check(problems: Problems) -> None:
    given = problems.given
    axes = check_heights(problems)
    check_spacing(problems, axes)
    problems.choice("units", among=UNITS)
    flags = as_array(given.periodic)
    valid = flags is not None and flags.dtype == np.bool_ and flags.shape in ((), (axes or 2,))
    expected = "True or False" + (", or (y, x)" if axes != 1 else "")
    problems.require(valid, "periodic", expected)


@public_result(
    title="Surface heights",
    achieved_error="exact: heights as given",
    check=_check,
    in_blocks=True,
    memory=17.0,
)
def from_array(
    heights: Any,
    spacing: float | Sequence[float],
    *,
    periodic: bool | Sequence[bool] = False,
    units: str = "m",
) -> xr.DataArray:
    """Return heights on a uniform grid as a surface.

    Parameters
    ----------
    heights : array-like, shape (ny, nx), (nx,) for a profile, or (members, ny, nx)
        Row 0 has the smallest y: flip an image first (`heights[::-1]`). NaN and masked values are missing
        points. A dask array stays lazy. A DataArray must end in dims (y, x) and keeps its leading dims.
    spacing : float, or (y, x)
        Distance between points, always in metres.
    periodic : bool, or (y, x)
        Whether the surface repeats beyond its edges.
    units : str
        Unit of `heights`: "m", "mm", "um", "nm" ...; the result is in metres.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, float64, the first cell starting at the origin.

    Raises
    ------
    InvalidInput
        The heights are not real numbers or infinite, the spacing is not positive, or the unit is unknown.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.from_array([[1.0, 2.0], [3.0, 5.0]], spacing=1e-6, units="um")
    >>> float(surface.max()), surface.x.values.tolist()
    (5e-06, [5e-07, 1.5e-06])
    """
    surface = labelled_heights(heights, spacing, periodic=periodic, units=units)
    surface.attrs = {"parameters": {"heights": {"shape": list(surface.shape)}}}
    return surface


def labelled_heights(heights: Any, spacing: Any, *, periodic: Any = False, units: str = "m") -> xr.DataArray:
    """Return valid heights (see `check_heights`) as a DataArray in metres."""
    values = _real_array(heights)
    values = values.astype(np.float64)
    if not _is_lazy(values):
        values = np.ma.filled(values, np.nan)
    axes = _plane_axes(heights, values.ndim)
    if isinstance(heights, xr.DataArray):
        leading = {str(dim): heights.coords.get(dim) for dim in heights.dims[:-axes]}
    else:
        leading = {"member": None} if values.ndim == 3 else {}
    flags = tuple(bool(flag) for flag in np.broadcast_to(np.asarray(periodic), axes))
    return surface_array(in_metres(values, units), axis_spacing(spacing, axes), flags, leading)


def _real_array(heights: Any) -> Any:
    """Return a numpy (maybe masked) or dask array of real numbers, None for anything else."""
    values = heights.data if isinstance(heights, xr.DataArray) else heights
    try:
        values = values if _is_lazy(values) else np.ma.asanyarray(values)
    except Exception:  # rows of unequal length, or whatever the conversion of a foreign object raises
        return None
    return values if values.dtype.kind in "fiu" else None


def _plane_axes(heights: Any, dims: int) -> int:
    """Return the number of axes of a plane (2) or profile (1)."""
    if isinstance(heights, xr.DataArray):
        return 2 if "y" in heights.dims else 1
    return min(dims, 2)


def _is_lazy(values: Any) -> bool:
    """Return whether the array is a dask array."""
    return hasattr(values, "dask")
