"""Flow through a joint by the local cubic law, and the hydraulic aperture of one known by a few numbers.

The flow is solved by finite volumes on the cells of the gap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning, warn
from fractalcontact.base.grid import periodic_axes, read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints import _flow_network
from fractalcontact.joints._criteria import HYDRAULIC_APERTURE, LARGEST_JRC, POSITIVE
from fractalcontact.joints._flow_network import Network
from fractalcontact.joints._network_pressure import ERROR, UNKNOWN, flow_memory, nested_dissection, pressures

REFERENCES = (
    "Zimmerman, R. W. and Bodvarsson, G. S., Hydraulic conductivity of rock fractures, Transport in Porous "
    "Media 23 (1996); Craster, R. V. and Obnosov, Yu. V., Four-phase checkerboard composites, SIAM Journal "
    "on Applied Mathematics 61 (2001)"
)
WHERE = "fractalcontact.joints.transmissivity"
RESULTS = ("axis", "transmissivity", "hydraulic_aperture", "percolates", "residual", "aperture",
           "open_fraction", "narrow_fraction", "overlap_fraction", "flow_conductance", "relative_pressure",
           "flux_x", "flux_y", "run_time")  # fmt: skip
NARROW = "cells open by less than 0.001 of the mean opening (narrow_fraction) count as closed"
AXES = ("y", "x")
MAPS = {"pressure": ("relative_pressure",), "flux": ("flux_x", "flux_y")}  # that can be kept


def _check(problems: Problems) -> None:
    given = problems.given
    if problems.choices("axis", among=("x", "y")):
        problems.require(len(word_tuple(given.axis)) > 0, "axis", "at least one of 'x', 'y'")
    problems.number("viscosity", above=0, optional=True)
    problems.boolean("periodic", optional=True)
    problems.choices("keep", among=MAPS)
    if _flow_network.check_gap(problems, given.gap, RESULTS):
        problems.periodic(read_grid(given.gap), given.periodic)


@public_result(
    title="transmissivity of a joint",
    references=REFERENCES,
    reasons=dict.fromkeys(("transmissivity", "hydraulic_aperture", "flow_conductance"), UNKNOWN),
    check=_check,
    memory=flow_memory,
)
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
    keep : any of "pressure", "flux"
        Maps to return beside the means.

    Returns
    -------
    Dataset over (..., axis)
        transmissivity (m3, hydraulic aperture cubed over 12), hydraulic_aperture (m), percolates (whether an
        open path of cells that share edges crosses, on a periodic axis to its own image; without one both
        are zero), residual (relative, see Notes); over (...): aperture (mean opening, m),
        open_fraction, narrow_fraction, overlap_fraction. With a viscosity also flow_conductance (m3 Pa-1
        s-1), flow per width and pressure gradient. run_time (s). Maps over (..., axis, y, x):
        relative_pressure (1), which falls by 1 along the axis, NaN where nothing flows; flux_x, flux_y (m3),
        flow per width times viscosity over the mean pressure gradient: their mean along the axis is the
        transmissivity.

    Raises
    ------
    InvalidInput
        `gap` is not a plane of finite lengths or is nowhere open nor zero, or an argument is wrong.
    MissingExtra
        The plane is too large for elimination and pyamg (extra `flow`) is not installed.

    Notes
    -----
    Exact for parallel plates and for layers along and across the flow. Elsewhere the error falls with the
    spacing, as its square in smooth openings. Cells open by less than 0.001 of the mean opening count as
    closed (narrow_fraction): they would carry 1e-9 of its flow. Before a flow is returned, it is checked that
    the pressure stays between those at the ends, and the flow between its bounds in series and in parallel;
    the residual is that of the linear system, or what a bound is missed by if that is more.

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
    axes, kept = word_tuple(axis), word_tuple(keep)
    values = np.asarray(gap.values, dtype=np.float64)
    leading = tuple(str(dim) for dim in gap.dims[:-2])
    rounding = 1e-9 * np.abs(values).max(axis=(-2, -1), keepdims=True)  # a smaller overlap is rounding
    (wraps_y, wraps_x), ratio = periodic_axes(periodic, grid), float(grid.spacing[0] / grid.spacing[1])
    wraps = wraps_y, wraps_x
    order = nested_dissection(grid.shape, wraps)
    openings, numbers = values.reshape(-1, *values.shape[-2:]), [AXES.index(name) for name in axes]
    flows = [flow for each in openings for flow in gap_flows(each, ratio, wraps, order, numbers)]
    dims, shape = (*leading, "axis"), (*values.shape[:-2], len(axes))

    def of_flows(name: str) -> Array:
        columns = [getattr(flow, name) for flow in flows]
        return np.reshape(columns, (*shape, *np.shape(columns[0])))

    conductivity = of_flows("conductivity")
    result = xr.Dataset(
        {
            "transmissivity": (dims, conductivity / 12.0),
            "hydraulic_aperture": (dims, np.cbrt(conductivity)),
            "percolates": (dims, of_flows("percolates")),
            "residual": (dims, of_flows("residual")),
            "aperture": (leading, np.maximum(values, 0.0).mean(axis=(-2, -1))),
            "open_fraction": (leading, (values > 0).mean(axis=(-2, -1))),
            "narrow_fraction": (leading, _flow_network.narrow_cells(values).mean(axis=(-2, -1))),
            "overlap_fraction": (leading, (values < -rounding).mean(axis=(-2, -1))),
        },
        coords=leading_coords(gap, leading, taken=RESULTS),
        attrs={"achieved_residual": max(flow.residual for flow in flows)},
    ).assign_coords(axis=np.array(axes))
    if viscosity is not None:
        result["flow_conductance"] = result["transmissivity"] / viscosity
    _warn(result)
    for name in (name for word in kept for name in MAPS[word]):
        result[name] = (*dims, "y", "x"), of_flows(name)
    return result.assign_coords(y=gap["y"].variable, x=gap["x"].variable) if kept else result


def _warn(result: xr.Dataset) -> None:
    """State which cells were closed; warn of flows that are not known."""
    if result["narrow_fraction"].any():
        result["transmissivity"].attrs["comment"] = NARROW
    unknown = int(result["transmissivity"].isnull().sum())
    if not unknown:
        return
    message = f"{WHERE}: {unknown} of {result['transmissivity'].size} flows not known: {UNKNOWN}"
    warn(message, ConvergenceWarning)


class Flow(NamedTuple):
    """Conductivity of the whole plane (gap cubed), whether an open path crosses it, error of the solution.

    `relative_pressure` falls by 1 along the plane, NaN where nothing flows; the fluxes are over 12.
    """

    conductivity: float
    percolates: bool
    residual: float
    relative_pressure: Array
    flux_x: Array
    flux_y: Array


def gap_flows(
    gap: Array, ratio: float, wraps: tuple[bool, bool], order: Array, axes: Sequence[int]
) -> list[Flow]:
    """Return the flow of a plane along axes (0 for y).

    Parameters
    ----------
    gap : ndarray, shape (ny, nx)
        Openings; cells at or below zero are closed.
    ratio : float
        Spacing of y over that of x.
    wraps : pair of bool
        Whether the plane repeats along y and x. Nothing flows through free sides. Free ends have prescribed
        pressures; a plane that repeats along the flow is under a mean pressure gradient.
    order : ndarray
        All cells (flat indices) in the order in which elimination takes them.
    """
    gap = _flow_network.conducting(gap)
    unit = power_of_two(float(gap.max()))
    cells = (gap / unit) ** 3
    network = _flow_network.link_network(cells, ratio, wraps)
    return [_flow_along(axis, network, cells, ratio, order, unit**3, repeats=wraps[axis]) for axis in axes]


def _flow_along(
    axis: int, network: Network, cells: Array, ratio: float, order: Array, unit: float, *, repeats: bool
) -> Flow:
    """Return the flow along an axis; cells are in this unit, and lengths in that of the spacing of x."""
    held, ends = _flow_network.nothing_held(cells.shape), []
    nothing, unknown = np.zeros(cells.shape), np.full(cells.shape, np.nan)
    if repeats:
        network = replace(network, jump=(network.closes & (network.axis == axis)).astype(np.float64))
        inside = _flow_network.winding_cells(network)
    else:
        ends = [_flow_network.edge_conductance(cells, ratio, axis, place) for place in (0, -1)]
        for place, end, level in zip((0, -1), ends, (1.0, 0.0), strict=True):
            held.add(_flow_network.line_of(axis, place), end, level)
        inside = _flow_network.spanning_cells(network, axis, ends)
    if not inside.any():
        return Flow(0.0, False, 0.0, unknown, nothing, nothing)
    pressure, error = pressures(network, inside, order, held, axis)
    flow = _flow_network.dissipation(network, pressure, inside, held)
    least = _flow_network.least_flow(network, axis, inside, ends)
    residual = max(least / flow - 1.0, error)
    if not residual <= ERROR:
        return Flow(math.nan, True, residual, unknown, unknown, unknown)
    spacing = (ratio, 1.0)
    length, width = (cells.shape[each] * spacing[each] for each in (axis, 1 - axis))
    flows = _flow_network.cell_flows(network, pressure, inside, axis, ends)
    flux_y, flux_x = flows * length / 12.0 / np.array(spacing[::-1])[:, None, None] * unit
    pressure = np.where(inside.reshape(cells.shape), pressure, np.nan)
    return Flow(flow * length / width * unit, True, residual, pressure, flux_x, flux_y)


APERTURE_BOUNDS: dict[str, dict[str, Any]] = {
    "aperture": POSITIVE,
    "roughness_coefficient": {"above": 0, "at_most": LARGEST_JRC},
    "spread": {"at_least": 0, "at_most": POSITIVE["at_most"]},
    # few spots: the next term of the series of (1 - c)/(1 + c), 2 c^2, is then 13 % of E^3
    "contact_fraction": {"at_least": 0, "at_most": 0.25},
}


def _check_apertures(problems: Problems) -> dict[str, xr.DataArray]:
    """Return the arguments that are given, labelled."""
    given = problems.given
    others = {name: getattr(given, name) for name in APERTURE_BOUNDS if name != "aperture"}
    for name, bounds in APERTURE_BOUNDS.items():
        any_shape = isinstance(getattr(given, name), xr.DataArray)
        problems.numbers(name, **bounds, optional=name in others, any_shape=any_shape)
    if problems.choice("model", among=HYDRAULIC_APERTURE):
        for name, value in others.items():
            if name in HYDRAULIC_APERTURE[given.model].needs:
                problems.require(value is not None, name, f"a value for {given.model!r}")
            else:
                problems.require(value is None, name, f"nothing with {given.model!r}")
    if problems.messages:
        return {}
    stated = {name: getattr(given, name) for name in APERTURE_BOUNDS}
    arrays = {name: _labelled(value) for name, value in stated.items() if value is not None}
    lengths = {array.size for array in arrays.values() if array.dims == ("point",)}
    is_one_shape = len(lengths) < 2
    problems.require(is_one_shape, "aperture", "arrays of one shape, or numbers", sorted(lengths))
    if is_one_shape and given.model == "zimmerman_bodvarsson":
        variation = float((arrays["spread"] / arrays["aperture"]).max())
        # the next term of the series of s/E, 1.9 (s/E)^4, is then 12 % of E^3
        is_small = variation <= 0.5
        problems.require(is_small, "spread", "at most 0.5 of the aperture", f"{variation:.3g} of it")
    return arrays


@public_result(
    title="hydraulic aperture of a joint",
    references=(
        "Barton, Bandis and Bakhtar (1985), Int. J. Rock Mech. Min. Sci. 22:121; Renshaw (1995), J. Geophys. "
        "Res. 100:24629; Zimmerman and Bodvarsson (1996), Transp. Porous Media 23:1; Walsh (1981), Int. J. "
        "Rock Mech. Min. Sci. 18:429"
    ),
    achieved_error="that of the relation, see page theory_joints",
    check=_check_apertures,
)
@takes_checked
def hydraulic_aperture(
    arrays: dict[str, xr.DataArray],
    /,
    aperture: float | Sequence[float] | Array | xr.DataArray,
    *,
    model: str = "barton_bandis",
    roughness_coefficient: float | None = None,
    spread: float | Sequence[float] | Array | xr.DataArray | None = None,
    contact_fraction: float | Sequence[float] | Array | xr.DataArray | None = None,
) -> xr.Dataset:
    """Return the hydraulic aperture e of a joint from its mechanical aperture E by a published relation.

    For a joint that is known by a few numbers only. Where the gap is known cell by cell, solve the flow:
    `transmissivity`.

    Parameters
    ----------
    aperture : float, sequence of float or DataArray
        Mean mechanical aperture E, m; of "zimmerman_bodvarsson" and "lognormal" that of the open part.
    model : {"barton_bandis", "lognormal", "zimmerman_bodvarsson", "walsh"}
        e = E^2/JRC^2.5 in micrometres, at most E (Barton, Bandis and Bakhtar 1985);
        e = E/sqrt(1 + s^2/E^2), exact in the mean for lognormal apertures (Renshaw 1995);
        e^3 = E^3 (1 - 1.5 s^2/E^2)(1 - 2 c) (Zimmerman and Bodvarsson 1996);
        e^3 = E^3 (1 - c)/(1 + c), plates with few round spots of contact (Walsh 1981).
    roughness_coefficient : float, optional
        Joint roughness coefficient JRC, above 0 to 20; for "barton_bandis" alone.
    spread : float, sequence of float or DataArray, optional
        Standard deviation s of the aperture of the open part, m; for "lognormal" and "zimmerman_bodvarsson".
    contact_fraction : float, sequence of float or DataArray, optional
        Share c of the area in contact, for "zimmerman_bodvarsson" and "walsh".

    Returns
    -------
    Dataset
        hydraulic_aperture, m, and transmissivity, its cube over 12, m3; over the dims of the arguments, or
        `point` of a sequence. Also the aperture.

    Raises
    ------
    InvalidInput
        An argument is outside its bounds, does not belong to the model or is missing. Bounds: c up to 0.25
        in both models that take it; s up to E/2 for "zimmerman_bodvarsson", a series, the next term of which
        is then about 12 % of E^3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.joints.hydraulic_aperture([200e-6, 500e-6], roughness_coefficient=10)
    >>> (result.hydraulic_aperture * 1e6).values.round(1).tolist()  # alike from 10^2.5 = 316 micrometres on
    [126.5, 500.0]
    """
    formula, needs = HYDRAULIC_APERTURE[model]
    hydraulic = formula(*(arrays[name] for name in ("aperture", *needs))).drop_attrs()
    variables = {"hydraulic_aperture": hydraulic, "transmissivity": hydraulic**3 / 12.0}
    return xr.Dataset({"aperture": arrays["aperture"], **variables})


def _labelled(value: Any) -> xr.DataArray:
    """Return a number, a sequence over `point`, or labelled numbers as they are."""
    if isinstance(value, xr.DataArray):
        return value.astype(np.float64)
    values = np.asarray(value, dtype=np.float64)
    return xr.DataArray(values, dims=("point",)[: values.ndim])
