"""Curves of one or many faces to one labelled Dataset."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import schema
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.provenance import PAPER, stamp
from fractalcontact.dimensions._faces import Face
from fractalcontact.dimensions._measures import Curve

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]


def stack(
    surface: xr.DataArray,
    faces: Sequence[Face],
    dim: str,
    curves: Sequence[Curve],
    values: dict[str, str],
    counts: dict[str, str],
) -> xr.Dataset:
    """Stack the curves of all faces along the leading dims.

    `values` and `counts` map names of the result to attributes of `Curve`.
    """
    import xarray as xr

    outer = surface.dims[: surface.ndim - faces[0].axes]
    sizes = [surface.sizes[d] for d in outer]
    data = {}
    for name, attribute in {**values, **counts}.items():
        stacked = np.stack([getattr(curve, attribute) for curve in curves])
        data[name] = ((*outer, dim), stacked.reshape(*sizes, -1))
    if np.isfinite(curves[0].factor):
        data["vertical_scale"] = (outer, np.reshape([curve.factor for curve in curves], sizes))
    taken = (*data, dim, "wavelength", "local_slope", "run_time")
    return xr.Dataset(data, coords={**leading_coords(surface, outer, taken), dim: curves[0].scale})


def finish(
    result: xr.Dataset,
    surface: xr.DataArray,
    faces: Sequence[Face],
    name: str,
    slopes: Sequence[Array],
    started: float,
    parameters: dict[str, Any],
    *,
    title: str,
    references: str = PAPER,
) -> xr.Dataset:
    first = next(iter(result.data_vars.values()))
    result["local_slope"] = (first.dims, np.stack(slopes).reshape(first.shape))
    result["run_time"] = time.perf_counter() - started
    result = schema.label(result)
    stamp(
        result,
        f"fractalcontact.dimensions.{name}",
        {"surface": surface, **parameters},
        title=title,
        references=references,
    )
    axes = zip(surface.dims[-faces[0].axes :], faces[0].grid.periodic, strict=True)
    result.attrs["periodic_axes"] = " ".join(str(dim) for dim, wraps in axes if wraps) or "none"
    return result
