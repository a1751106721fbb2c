"""A curve over scale, and the labelled Dataset of the curves of one or many surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.power_law import local_slope
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces

Array = np.ndarray[Any, np.dtype[Any]]

ALWAYS = ("local_slope", "run_time")  # variables of every curve
EXACT_MEAN = "exact to rounding: a mean over all pairs or windows, without its sampling scatter"

PERIODIC = "a periodic surface is not fractional Brownian, for which the covariance of the curve is known"


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
    parts : ndarray, shape (k, ...), optional
        What each point was measured with, such as the edges of windows in points along y and x.
    power : float
        Weight of a point in a fit: scale^power.
    has_wavenumbers : bool
    """

    scale: Array
    value: Array
    count: Array
    height_factor: float = np.nan
    parts: Array | None = None
    power: float = 0.0
    has_wavenumbers: bool = False

    @property
    def length(self) -> Array:
        """Scales in m, wavenumbers as wavelengths."""
        return np.asarray(2.0 * np.pi / self.scale) if self.has_wavenumbers else self.scale

    @property
    def weight(self) -> Array:
        """Weights of the points in a fit."""
        return np.asarray((self.scale / self.scale[0]) ** self.power)

    def part(self, inside: Array) -> Curve:
        """Return some of the points."""
        parts = None if self.parts is None else self.parts[inside]
        return replace(
            self, scale=self.scale[inside], value=self.value[inside], count=self.count[inside], parts=parts
        )


def no_profile(surface: Surface) -> str:
    """Return why the covariance of the curve of a free profile does not hold; empty where it does."""
    if surface.axes == 2:
        return "the covariance of the curve is known for a single profile, not for the rows of a surface"
    return PERIODIC if any(surface.grid.periodic) else ""


def surface_check(*names: str, smallest: int = 3) -> Callable[..., None]:
    """Return the check of a curve that takes a surface only; `names` are the variables of its result."""

    def check(problems: Problems, *, surface: Any) -> None:
        reserved = (*names, "pair_count", *ALWAYS)
        check_surface(problems, surface, smallest=smallest, squares=True, reserved=reserved)

    return check


def curve_dataset(
    surface: xr.DataArray,
    measure: Callable[[Surface], Curve] | Sequence[Curve],
    dim: str,
    value: str,
    *,
    count: str | None = None,
    slope: Callable[[Curve], Array] | None = None,
) -> xr.Dataset:
    """Measure the curves of all surfaces and stack them along the leading dims of the input.

    Parameters
    ----------
    surface : DataArray
    measure : callable or sequence of Curve
        From a `Surface` to its curve, or the curves.
    dim, value, count : str
        Names of the scale, the value and the number of pairs, modes or windows.
    slope : callable, optional
        The local slopes of a curve. Default: `window_slope`.
    """
    surfaces = read_surfaces(surface)
    curves = [measure(single) for single in surfaces] if callable(measure) else measure
    leading = surface.dims[: surface.ndim - surfaces[0].axes]
    sizes = [surface.sizes[d] for d in leading]

    def stacked(values: Sequence[Array]) -> tuple[tuple[Any, ...], Array]:
        return (*leading, dim), np.stack(values).reshape(*sizes, -1)

    data: dict[str, Any] = {value: stacked([curve.value for curve in curves])}
    if count is not None:
        data[count] = stacked([curve.count for curve in curves])
    if np.isfinite(curves[0].height_factor):
        data["vertical_scale"] = (leading, np.reshape([curve.height_factor for curve in curves], sizes))
    data["local_slope"] = stacked([(slope or window_slope)(curve) for curve in curves])
    coords = {**leading_coords(surface, leading, (*data, dim, "wavelength", *ALWAYS)), dim: curves[0].scale}
    if curves[0].has_wavenumbers:
        coords["wavelength"] = (dim, curves[0].length)
    axes = zip(surface.dims[-surfaces[0].axes :], surfaces[0].grid.periodic, strict=True)
    periodic = " ".join(str(axis) for axis, is_periodic in axes if is_periodic) or "none"
    return xr.Dataset(data, coords, {"periodic_axes": periodic})


def window_slope(curve: Curve) -> Array:
    """Return the local slope; relative to the first value, a constant curve has slope 0 to the last bit."""
    return local_slope(curve.scale, curve.value / (curve.value[:1] if (curve.value > 0).all() else 1.0))
