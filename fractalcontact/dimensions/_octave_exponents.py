"""Hurst exponent octave by octave of wavelength, and the longest run of octaves with one exponent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.memory import Plane
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._exponent_by_scale import (
    Run,
    blocks_of,
    interval_of_run,
    longest_run,
    octaves,
    with_or_without_aliases,
)
from fractalcontact.dimensions._free_edges import LARGE
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._restored_power import MOST_MISSING
from fractalcontact.dimensions._surface_input import Surface, check_surface, is_lazy, read_surfaces

Array = np.ndarray[Any, np.dtype[Any]]

_BYTES, _COMPARED_BYTES = 46.0, 195.0  # of a point, without and with the likelihood
_NAMES = (
    "hurst",
    "ci_low",
    "ci_high",
    "mode_count",
    "in_window",
    "wavelength",
    "window_hurst",
    "window_ci_low",
    "window_ci_high",
    "scale_min",
    "scale_max",
    "run_time",
)


def _check(problems: Problems, *, surface: Any) -> None:
    is_plane = "y" in getattr(surface, "dims", ())
    is_valid = check_surface(problems, surface, smallest=16, gaps=is_plane, squares=True, reserved=_NAMES)
    if is_valid and is_plane and not is_lazy(surface):
        most = float(surface.isnull().mean(["y", "x"]).max())
        problems.require(most <= MOST_MISSING, "surface", "at least half of the heights", f"{1 - most:.0%}")


def _memory(plane: Plane, _: Mapping[str, Any]) -> float:
    points = math.prod(plane.shape)
    return (_COMPARED_BYTES if points <= LARGE else _BYTES) * points


@public_result(
    title="Hurst exponent against scale",
    references="Whittle (1957), J. R. Stat. Soc. B 19",
    check=_check,
    memory=_memory,
)
def scaling(surface: xr.DataArray) -> xr.Dataset:
    """Return the Hurst exponent of every octave of wavelength, and the window that has one exponent.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), of which up to half may be missing, or (..., x) for a profile without
        gaps; at least 16 points along each axis.

    Returns
    -------
    Dataset over `wavelength` (m, the middle of an octave)
        `hurst` of the waves of the octave, with its 95 % interval `ci_low`, `ci_high`, and `mode_count`.
        The exponents are not limited: long waves of white noise have -1 (a profile -0.5), waves as short as
        the blur of an instrument more than 1.
        `in_window` marks the longest run of octaves that one exponent between 0 and 1 fits; `window_hurst`,
        `window_ci_low`, `window_ci_high`, `scale_min` and `scale_max` (m) are its exponent and its ends, NaN
        if there is no such run.

    Raises
    ------
    InvalidInput
        More heights are missing, an axis is not uniform, or an axis has fewer than 16 points.

    Notes
    -----
    Whittle's likelihood of the cosine modes, as in `estimate`. A run is accepted if the likelihood ratio
    against separate exponents and amplitudes of its octaves is below the 99.7 % quantile of chi square.
    Beside other octaves its interval also holds that of the run without the octave there, as a blur ends
    gradually, and, with free edges and up to 2^20 points, that of `estimate`, whose findings (noise, steps,
    levelled rows) are in the attribute `comment`. Waves beyond the sampling are in the model of a surface
    with free edges, as aliases, unless the two shortest octaves have one exponent only without them, as in a
    crop of a periodic surface, and no blur.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> result = fc.dimensions.scaling(surface)
    >>> bool(result.in_window.all()), round(float(result.window_hurst), 1)
    (True, 0.7)
    """
    surfaces = read_surfaces(surface)
    records = [octaves(with_or_without_aliases(blocks_of(single))) for single in surfaces]
    runs = [longest_run(record) for record in records]
    intervals = [interval_of_run(run, record) for run, record in zip(runs, records, strict=True)]
    found = [_beside_likelihood(*each) for each in zip(surfaces, runs, intervals, strict=True)]
    intervals, notes = [each[:2] for each in found], dict.fromkeys(each[2] for each in found if each[2])
    spacing = surfaces[0].spacing[1]
    leading = surface.dims[: surface.ndim - surfaces[0].axes]
    sizes = [surface.sizes[dim] for dim in leading]

    def stacked(values: Sequence[Any], *dims: str) -> tuple[tuple[Any, ...], Array]:
        array = np.asarray(values)
        return (*leading, *dims), array.reshape((*sizes, *array.shape[1:]))

    fits = [[octave.fit for octave in record] for record in records]
    data = {
        "hurst": stacked([[fit.hurst for fit in row] for row in fits], "wavelength"),
        "ci_low": stacked([[fit.low for fit in row] for row in fits], "wavelength"),
        "ci_high": stacked([[fit.high for fit in row] for row in fits], "wavelength"),
        "mode_count": stacked([[round(fit.modes) for fit in row] for row in fits], "wavelength"),
        "in_window": stacked(
            [
                [run.first <= k < run.last for k in range(len(row))]
                for run, row in zip(runs, fits, strict=True)
            ],
            "wavelength",
        ),
        "window_hurst": stacked([run.fit.hurst for run in runs]),
        "window_ci_low": stacked([low for low, _ in intervals]),
        "window_ci_high": stacked([high for _, high in intervals]),
        "scale_min": stacked([run.low * spacing for run in runs]),
        "scale_max": stacked([run.high * spacing for run in runs]),
    }
    middle = np.array([np.sqrt(octave.low * octave.high) for octave in records[0]]) * spacing
    coords = {**leading_coords(surface, leading, _NAMES), "wavelength": middle}
    result = xr.Dataset(data, coords=coords)
    if notes:
        for name in ("hurst", "window_hurst"):
            result[name].attrs["comment"] = "; ".join(notes)
    return result


def _beside_likelihood(surface: Surface, run: Run, interval: tuple[float, float]) -> tuple[float, float, str]:
    """Return the interval of a run that holds that of `estimate` where the waves of both meet, and a note.

    Octaves do not show weak noise, steps, or levelled rows, which `estimate` looks for.
    """
    low, high = interval
    if surface.axes == 1 or any(surface.grid.periodic) or surface.heights.size > LARGE:
        return low, high, ""
    estimate, dx = likelihood(surface, None, False).limited(), surface.spacing[1]
    if estimate.scale_min <= run.high * dx and run.low * dx < estimate.scale_max:
        low, high = float(np.fmin(low, estimate.ci_low)), float(np.fmax(high, estimate.ci_high))
    finding = estimate.note or estimate.reason
    return low, high, f"`estimate` finds: {finding}" if finding else ""
