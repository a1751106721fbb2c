"""Flow through a joint by the local cubic law: finite volumes on the cells of the gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.grid import periodic_axes, read_grid
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._flow_network import (
    Network,
    cell_flows,
    check_gap,
    dissipation,
    held_ends,
    link_network,
    spanning_cells,
    winding_cells,
)
from fractalcontact.joints._network_pressure import flow_memory, nested_dissection, pressures

Array = np.ndarray[Any, np.dtype[Any]]

REFERENCES = (
    "Zimmerman, R. W. and Bodvarsson, G. S., Hydraulic conductivity of rock fractures, Transport in Porous "
    "Media 23 (1996); Craster, R. V. and Obnosov, Yu. V., Four-phase checkerboard composites, SIAM Journal "
    "on Applied Mathematics 61 (2001)"
)
RESULTS = ("axis", "transmissivity", "hydraulic_aperture", "percolates", "residual", "aperture",
           "open_fraction", "overlap_fraction", "flow_conductance", "relative_pressure", "flux_x", "flux_y",
           "run_time")  # fmt: skip
MAPS = {"pressure": ("relative_pressure",), "flux": ("flux_x", "flux_y")}  # that can be kept
ROUNDING = 1e-9  # relative to the largest opening: a smaller overlap is rounding


def _check(problems: Problems, *, gap: Any, axis: Any, viscosity: Any, periodic: Any, keep: Any) -> None:
    if problems.choices("axis", axis, ("x", "y")):
        problems.require(len(word_tuple(axis)) > 0, "axis", "at least one of 'x', 'y'", axis)
    problems.number("viscosity", viscosity, above=0, optional=True)
    problems.boolean("periodic", periodic, optional=True)
    problems.choices("keep", keep, MAPS)
    if check_gap(problems, gap, RESULTS):
        problems.periodic("periodic", periodic, read_grid(gap))


@public_result(title="transmissivity of a joint", references=REFERENCES, check=_check, memory=flow_memory)
def transmissivity(
    gap: xr.DataArray,
    *,
    axis: str | Sequence[str] = ("x", "y"),
    viscosity: float | None = None,
    periodic: bool | None = None,
    keep: str | Sequence[str] = (),
) -> xr.Dataset:
    """Return the transmissivity of a joint by the local cubic law (Reynolds equation).

    The flux per width is -gap^3 / (12 viscosity) grad p. On a free axis the flow runs between two pressures
    at the two ends, and nothing flows through the sides. A periodic axis repeats: across the flow its two
    sides are joined, along the flow the plane is under a mean gradient of pressure.

    Parameters
    ----------
    gap : DataArray, dims (..., y, x)
        Local opening of the joint, m, no NaN; cells at or below zero are in contact and closed. For example
        `gap` of `fractalcontact.joints.closure`, for all shears and steps at once, or upper - lower of two
        measured faces. Overlaps count as contact; a plane below zero everywhere is refused.
    axis : {"x", "y"} or both
        Axis along which the fluid flows.
    viscosity : float, optional
        Dynamic viscosity, Pa s; adds `flow_conductance`.
    periodic : bool, optional
        None: along the periodic axes of `gap`. False: both axes are free.
    keep : {"pressure", "flux"} or both
        Maps to return beside the means.

    Returns
    -------
    Dataset over (..., axis)
        transmissivity (m3, hydraulic aperture cubed over 12), hydraulic_aperture (m), percolates (whether an
        open path of cells that share edges crosses, on a periodic axis to its own image; without one both
        are zero), residual (relative, of the linear system); over (...): aperture (mean opening, m),
        open_fraction, overlap_fraction. With a viscosity also flow_conductance (m3 Pa-1 s-1), flow per width
        and pressure gradient. run_time (s). Maps over (..., axis, y, x): relative_pressure (1), which falls
        by 1 along the axis, NaN where nothing flows; flux_x, flux_y (m3), flow per width times viscosity over
        the mean pressure gradient: their mean along the axis is the transmissivity.

    Raises
    ------
    InvalidInput
        `gap` is not a plane of finite lengths or is nowhere open nor zero, or an argument is wrong.
    MissingExtra
        The plane is too large for elimination and pyamg (extra `flow`) is not installed.

    Notes
    -----
    Exact for parallel plates and for layers along and across the flow. Elsewhere the error falls with the
    spacing, as its square in smooth openings.

    References
    ----------
    Zimmerman and Bodvarsson (1996), Transp. Porous Media 23:1; Keller (1964), J. Math. Phys. 5:548; Craster
    and Obnosov (2001), SIAM J. Appl. Math. 61:1839.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> layers = np.cbrt([[1.0, 1.0, 3.0, 3.0]] * 3)  # conductivities 1 and 3 in series along x
    >>> flow = fc.joints.transmissivity(fc.surfaces.from_array(layers, 1.0))
    >>> [round(float(12 * flow.transmissivity.sel(axis=axis)), 6) for axis in ("x", "y")]
    [1.5, 2.0]
    """
    grid = read_grid(gap)
    axes = word_tuple(axis)
    wraps = periodic_axes(periodic, grid)
    values = np.asarray(gap.values, dtype=np.float64)
    leading = tuple(str(dim) for dim in gap.dims[:-2])
    rounding = ROUNDING * np.abs(values).max(axis=(-2, -1), keepdims=True)
    kept = word_tuple(keep)
    flows = _flows(values.reshape(-1, *values.shape[-2:]), axes, grid.spacing, wraps, bool(kept))
    shape = (*values.shape[:-2], len(axes))
    conductivity = np.reshape([flow.conductivity for flow in flows], shape)
    dims = (*leading, "axis")
    result = xr.Dataset(
        {
            "transmissivity": (dims, conductivity / 12.0),
            "hydraulic_aperture": (dims, np.cbrt(conductivity)),
            "percolates": (dims, np.reshape([flow.percolates for flow in flows], shape)),
            "residual": (dims, np.reshape([flow.residual for flow in flows], shape)),
            "aperture": (leading, np.maximum(values, 0.0).mean(axis=(-2, -1))),
            "open_fraction": (leading, (values > 0).mean(axis=(-2, -1))),
            "overlap_fraction": (leading, (values < -rounding).mean(axis=(-2, -1))),
        },
        coords=leading_coords(gap, leading, taken=RESULTS),
        attrs={"achieved_residual": max(flow.residual for flow in flows)},
    ).assign_coords(axis=np.array(axes))
    if viscosity is not None:
        result["flow_conductance"] = result["transmissivity"] / viscosity
    maps = _maps(flows, axes, (*shape, *values.shape[-2:])) if kept else {}
    for name in (name for word in kept for name in MAPS[word]):
        result[name] = ((*dims, "y", "x"), maps[name])
    return result.assign_coords(y=gap["y"].variable, x=gap["x"].variable) if kept else result


def _maps(flows: list[Flow], axes: Sequence[str], shape: tuple[int, ...]) -> dict[str, Array]:
    """Return the maps of all planes and axes, with the flow along y turned back."""
    planes: dict[str, list[Array]] = {"relative_pressure": [], "flux_x": [], "flux_y": []}
    for number, flow in enumerate(flows):
        pressure, (along, across) = flow.pressure, flow.flux
        if axes[number % len(axes)] == "y":
            pressure, along, across = pressure.T, across.T, along.T
        for name, plane in zip(planes, (pressure, along, across), strict=True):
            planes[name].append(plane)
    return {name: np.reshape(stack, shape) for name, stack in planes.items()}


def _flows(planes: Array, axes: Sequence[str], spacing: Any, periodic: Any, maps: bool) -> list[Flow]:
    """Solve every plane along every axis; planes are transposed so that the flow runs along the last axis."""
    flows, orders = [], {}
    for plane in planes:
        for axis in axes:
            along = ("y", "x").index(axis)
            oriented = np.ascontiguousarray(plane if axis == "x" else plane.T)
            ratio = float(spacing[1 - along] / spacing[along])
            wraps = bool(periodic[1 - along]), bool(periodic[along])
            if axis not in orders:  # the same for every plane
                orders[axis] = nested_dissection(oriented.shape, wraps)
            flows.append(plane_flow(oriented, ratio, wraps, orders[axis], maps=maps))
    return flows


_NO_MAPS = (np.empty(0), np.empty(0))


@dataclass(frozen=True)
class Flow:
    """Conductivity of the whole plane (gap cubed), whether an open path crosses it, relative residual.

    `pressure` falls by 1 along the plane, NaN where nothing flows; `flux` is along and across, over 12.
    """

    conductivity: float
    percolates: bool
    residual: float
    pressure: Array
    flux: Array


def _no_flow(shape: tuple[int, ...]) -> Flow:
    return Flow(0.0, False, 0.0, np.full(shape, np.nan), np.zeros((2, *shape)))


def plane_flow(
    gap: Array, ratio: float, wraps: tuple[bool, bool], order: Array, *, maps: bool = False
) -> Flow:
    """Return the conductivity (gap cubed) of a plane along its last axis.

    Parameters
    ----------
    gap : ndarray, shape (ny, nx)
        Cells at or below zero are closed.
    ratio : float
        Spacing across the flow over the spacing along it.
    wraps : pair of bool
        Whether the plane repeats across and along the flow. Nothing flows through free sides. Free ends have
        prescribed pressures; a plane that repeats along the flow is under a mean pressure gradient.
    order : ndarray
        All cells (flat indices) in the order in which elimination takes them.
    maps : bool
        Return pressure and flux as well.
    """
    largest = float(gap.max())
    if not largest > 0:
        return _no_flow(gap.shape)
    unit = float(np.ldexp(1.0, int(np.frexp(largest)[1])))
    network = link_network(np.maximum(gap / unit, 0.0) ** 3, ratio, wraps)
    inside = winding_cells(network) if wraps[1] else spanning_cells(network)
    if not inside.any():
        return _no_flow(gap.shape)
    pressure, residual = pressures(network, inside, order, held_ends(network))
    ny, nx = network.shape
    conductivity = dissipation(network, pressure, inside) * (nx / ny) / ratio
    if not maps:
        return Flow(conductivity * unit**3, True, residual, *_NO_MAPS)
    flux = _flux(network, pressure, inside, ratio) * unit**3
    pressure = np.where(inside.reshape(network.shape), pressure, np.nan)
    return Flow(conductivity * unit**3, True, residual, pressure, flux)


def _flux(network: Network, pressure: Array, inside: Array, ratio: float) -> Array:
    """Return the flow per width along and across, over that of the mean gradient of pressure, over 12."""
    along, across = cell_flows(network, pressure, inside)
    return np.stack([along / ratio, across]) * (network.shape[1] / 12.0)
