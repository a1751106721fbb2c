"""A curve over scale, and the labelled Dataset of the curves of one or many surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.construction import make_dataset
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.power_law import local_slope
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

ALWAYS = ("local_slope", "run_time")  # variables of every curve
EXACT_MEAN = "exact to rounding: a mean over all pairs or windows, without its sampling scatter"


@dataclass(frozen=True)
class Curve:
    """A quantity at ascending scales.

    Attributes
    ----------
    scale : ndarray, shape (k,)
        Lengths in m, or wavenumbers in rad/m.
    value, count : ndarray, shape (k,)
        Mean value at each scale, and the number of pairs, modes or windows averaged.
    height_factor : float
        Factor by which the heights were multiplied; NaN where it does not matter.
    edges : ndarray of int, shape (k, 2), optional
        Edges of windows in points along y and x.
    """

    scale: Array
    value: Array
    count: Array
    height_factor: float = np.nan
    edges: Array | None = None


def curve_dataset(
    surface: xr.DataArray,
    surfaces: Sequence[Surface],
    dim: str,
    curves: Sequence[Curve],
    slopes: Sequence[Array],
    *,
    value: str,
    count: str | None = None,
    further: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Stack the curves of all surfaces along the leading dims of the input.

    `value` and `count` are the names of the variables; `slopes` are the local slopes of the curves; `further`
    are coordinates beside that of `dim`.
    """
    leading = surface.dims[: surface.ndim - surfaces[0].axes]
    sizes = [surface.sizes[d] for d in leading]

    def stacked(values: Sequence[Array]) -> tuple[tuple[Any, ...], Array]:
        return (*leading, dim), np.stack(values).reshape(*sizes, -1)

    data: dict[str, Any] = {value: stacked([curve.value for curve in curves])}
    if count is not None:
        data[count] = stacked([curve.count for curve in curves])
    if np.isfinite(curves[0].height_factor):
        data["vertical_scale"] = (leading, np.reshape([curve.height_factor for curve in curves], sizes))
    data["local_slope"] = stacked(slopes)
    coords = {**leading_coords(surface, leading, (*data, dim, "wavelength", *ALWAYS)), dim: curves[0].scale}
    coords |= further or {}
    axes = zip(surface.dims[-surfaces[0].axes :], surfaces[0].grid.periodic, strict=True)
    periodic = " ".join(str(axis) for axis, is_periodic in axes if is_periodic) or "none"
    data["run_time"] = np.nan  # is set at the end; a variable that is added later takes longer
    return make_dataset(data, coords, {"periodic_axes": periodic})


def window_slope(curve: Curve) -> Array:
    """Return the local slope; relative to the first value, a constant curve has slope 0 to the last bit."""
    return local_slope(curve.scale, curve.value / (curve.value[:1] if (curve.value > 0).all() else 1.0))
