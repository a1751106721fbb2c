"""Map of the Hurst exponent: the closed-form estimate in windows that move over the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._increments import increments
from fractalcontact.dimensions._records import Estimate, undefined
from fractalcontact.dimensions._surface_input import (
    Scales,
    check_scales,
    check_surface,
    read_scales,
    read_surfaces,
)
from fractalcontact.dimensions._waves import without_waves

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 16  # points along the edge of a window
FEWEST = 25  # observed points in a window
_ALIKE = 2.0  # mean square of the deviations of windows over their errors: 1 where one exponent holds
_BENT = 2.6  # |z| of the bend of all windows together: one exact surface in a hundred
_FIELDS = ("hurst", "standard_error", "ci_low", "ci_high")


def _check(problems: Problems) -> None:
    given = problems.given
    is_valid = check_surface(problems, smallest=SMALLEST, profile=False, reserved=_FIELDS)
    is_number = problems.number("window", above=0.0)
    problems.number("step", above=0.0, optional=True)
    check_scales(problems, is_valid=is_valid)
    if not (is_valid and is_number):
        return
    grid = read_grid(given.surface)
    least, most = SMALLEST * max(grid.spacing), min(grid.extent)
    expected = f"a length from {least:g} m ({SMALLEST} points) to {most:g} m"
    problems.require(least * (1 - 1e-9) <= given.window <= most * (1 + 1e-9), "window", expected)


@public_result(title="Map of the Hurst exponent", check=_check, in_blocks=True)
def hurst_map(
    surface: xr.DataArray,
    window: float,
    *,
    step: float | None = None,
    scales: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent in square windows that move over a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x); NaN where missing. Of a dask array only one row of windows is in
        memory at a time.
    window : float
        Edge of a window in m, at least 16 points.
    step : float, optional
        Distance between neighbouring windows in m; by default half a window.
    scales : (low, high), optional
        Lags in m between which to fit, as (4, 16) spacings for a blurred surface. Default: the shortest.

    Returns
    -------
    Dataset over the leading dims and (y, x), the centres of the windows in m
        `hurst`, `standard_error`, `ci_low`, `ci_high` of the method "increments" of `estimate`, and
        `fractal_dimension`. NaN where fewer than 25 points of a window were observed, or where heights do
        not vary.

    Raises
    ------
    InvalidInput
        A profile, wrong axes, or a window that does not fit.

    Notes
    -----
    Windows that overlap have correlated errors: compare those at least one window apart. Where the windows
    together have a bent power law, as with blur or noise, there is no interval, and `reason` says so.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((96, 128), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> result = fc.dimensions.hurst_map(surface, 3.2e-3)
    >>> dict(result.hurst.sizes), round(float(result.hurst.mean()), 1)
    ({'y': 5, 'x': 7}, 0.7)
    """
    grid, lags = read_grid(surface), read_scales(scales)
    edges = [max(SMALLEST, round(window / spacing)) for spacing in grid.spacing]
    edges = [min(edge, n) for edge, n in zip(edges, grid.shape, strict=True)]
    length = 0.5 * window if step is None else min(float(step), max(grid.extent))
    steps = [max(1, round(length / spacing)) for spacing in grid.spacing]
    rows, columns = (
        np.arange(0, n - edge + 1, jump) for n, edge, jump in zip(grid.shape, edges, steps, strict=True)
    )
    leading = surface.dims[:-2]
    new = float(np.prod([min(1.0, jump / edge) for jump, edge in zip(steps, edges, strict=True)]))
    records: list[Estimate] = []
    notes: list[str] = []
    for plane in range(int(np.prod(surface.shape[:-2], dtype=int))):
        index = np.unravel_index(plane, surface.shape[:-2])
        single = surface.isel(dict(zip(leading, map(int, index), strict=True)))
        if not has_blocks(single):
            without, found = without_waves(read_surfaces(single)[0])
            if found:
                heights = (without.heights * without.unit).reshape(single.shape)
                single, notes = single.copy(data=heights), [*notes, found]
        of_plane = []
        for row in rows:
            band = single.isel(y=slice(int(row), int(row) + edges[0])).compute()
            parts = (band.isel(x=slice(int(start), int(start) + edges[1])) for start in columns)
            of_plane += [_estimated(part, lags) for part in parts]
        whole = 0.0 if has_blocks(single) else increments(read_surfaces(single)[0], lags, None).misfit
        records += _without_bent(of_plane, new, whole if np.isfinite(whole) else 0.0)
    reasons = "; ".join(dict.fromkeys(record.reason for record in records if record.reason))
    shape = (*surface.shape[:-2], rows.size, columns.size)
    data: dict[str, Any] = {
        name: (surface.dims, np.reshape([getattr(record, name) for record in records], shape))
        for name in _FIELDS
    }
    data["fractal_dimension"] = surface.dims, 3.0 - data["hurst"][1]
    coords = leading_coords(surface, leading, taken=data)
    for dim, starts, edge in zip(("y", "x"), (rows, columns), edges, strict=True):
        place = surface.coords[dim].values if dim in surface.coords else None
        spacing = grid.spacing[0 if dim == "y" else 1]
        first = float(place[0]) if place is not None else 0.5 * spacing
        coords[dim] = dim, first + (starts + 0.5 * (edge - 1)) * spacing
    result = xr.Dataset(data, coords=coords)
    for name in _FIELDS[1:] if reasons else ():
        result[name].attrs["reason"] = reasons
    if notes:
        result["hurst"].attrs["comment"] = "; ".join(dict.fromkeys(notes))
    return result


def _without_bent(records: list[Estimate], new: float, whole: float) -> list[Estimate]:
    """Return the estimates of a surface, without intervals where the power laws of its windows are bent.

    An exponent that differs from place to place bends no power law inside a window. `new` is the share of a
    window that the one before does not have; `whole` is the bend of the whole surface.
    """
    given = [record for record in records if np.isfinite(record.misfit) and record.standard_error > 0.0]
    if not given:
        return records
    bends, exponents, errors = (
        np.array([getattr(record, name) for record in given])
        for name in ("misfit", "hurst", "standard_error")
    )
    z = float(bends.sum() * np.sqrt(new / bends.size))
    scatter = np.mean(np.square((exponents - np.average(exponents, weights=errors**-2.0)) / errors))
    if scatter < _ALIKE:  # then the whole surface has one exponent, whose bend many lags show
        z = max(z, whole)
    if abs(z) <= _BENT:
        return records
    reason = (
        f"the exponent changes with the lag inside the windows ({z:+.1f} standard deviations), as with blur, "
        "noise or marks: see `estimate`, and choose `scales` beyond them"
    )
    return [record if record.reason else record.without_interval(reason) for record in records]


def _estimated(part: xr.DataArray, scales: Scales) -> Estimate:
    """Return the estimate of one window."""
    if np.count_nonzero(np.isfinite(part.values)) < FEWEST:
        return undefined(f"fewer than {FEWEST} points were observed")
    return increments(read_surfaces(part)[0], scales, False).limited()
