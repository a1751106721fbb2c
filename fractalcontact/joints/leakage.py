"""Leakage: how much fluid the open part of a joint lets through."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import check_leading, leading_coords
from fractalcontact.base.grid import check_surface, resolve_periodic
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._flow import Flow, plane_flow

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.transmissivity"
REFERENCES = (
    "Zimmerman, R. W. and Bodvarsson, G. S., Hydraulic conductivity of rock fractures, Transport in Porous "
    "Media 23 (1996); Craster, R. V. and Obnosov, Yu. V., Four-phase checkerboard composites, SIAM Journal "
    "on Applied Mathematics 61 (2001)"
)
ROUNDING = 1e-9  # relative to the largest opening
RESULTS = ("axis", "transmissivity", "hydraulic_aperture", "percolates", "residual", "aperture",
           "open_fraction", "overlap_fraction", "flow_conductance", "run_time")  # fmt: skip
Array = np.ndarray[Any, np.dtype[Any]]


def transmissivity(
    gap: xr.DataArray,
    *,
    axis: str | Sequence[str] = ("x", "y"),
    viscosity: float | None = None,
    periodic: bool | None = None,
) -> xr.Dataset:
    """Return the transmissivity of a joint by the local cubic law (Reynolds' equation).

    The flux per width is -gap^3 / (12 viscosity) grad p. A free plane is held at two pressures at the two
    ends of the flow's axis, and nothing flows through its sides. An axis that is periodic repeats: across the
    flow its two sides are joined, along the flow the plane is under a mean gradient of pressure.

    Parameters
    ----------
    gap : DataArray, dims (..., y, x)
        Local opening of the joint, m, no NaN; cells at or below zero are in contact and closed. For example
        `gap` of `fractalcontact.joints.closure` for every shear and step at once, or upper - lower of two
        measured faces. Where these overlap a little they are taken to touch, and overlap_fraction tells how
        much of the plane that is; a plane below zero everywhere is refused.
    axis : {"x", "y"} or both
        Axis along which the fluid flows.
    viscosity : float, optional
        Dynamic viscosity, Pa s; gives `flow_conductance` as well.
    periodic : bool, optional
        None: what the axes say. False: both axes are free.

    Returns
    -------
    Dataset over (..., axis)
        transmissivity (m3, hydraulic aperture cubed over 12), hydraulic_aperture (m), percolates (an open
        path of cells that share edges crosses, on a periodic axis to its own image; without one both are
        zero), residual (of the linear system, relative; the flow itself is of second order in it, and solved
        to about 1e-8); over (...): aperture (mechanical: mean opening, m),
        open_fraction, overlap_fraction. With a viscosity also flow_conductance (m3 Pa-1 s-1), flow per width
        and pressure gradient. run_time (s).

    Raises
    ------
    InvalidInput
        `gap` is not a plane of finite lengths or is nowhere open nor zero, or an argument is wrong.
    MissingExtra
        The plane is too large for elimination and pyamg (extra `flow`) is not installed.

    Notes
    -----
    Exact for parallel plates and for layers along and across the flow. Elsewhere the error falls with the
    spacing, as its square in smooth openings and more slowly where wide and narrow cells meet at corners.

    References
    ----------
    Zimmerman and Bodvarsson (1996), Transp. Porous Media 23:1; Keller (1964), J. Math. Phys. 5:548; Craster
    and Obnosov (2001), SIAM J. Appl. Math. 61:1839.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        grid = check_surface(gap, problems, "gap", leading=True, smallest=1)
        check_leading(gap, RESULTS, problems, "gap")
        axes = problems.choices("axis", axis, ("x", "y"))
        problems.require(len(axes) > 0, "axis", "at least one of 'x', 'y'", axis)
        wraps = resolve_periodic(periodic, grid, problems, "periodic")
        if viscosity is not None:
            problems.number("viscosity", viscosity, above=0)
        if not problems.found:
            values = np.asarray(gap.values, dtype=np.float64)
            below = int(np.count_nonzero(values.max(axis=(-2, -1)) < 0))
            expected = "an opening, zero in contact (not heights, nor lower - upper)"
            problems.require(below == 0, "gap", expected, f"{below} planes that are below zero everywhere")
    start = time.perf_counter()
    leading = tuple(str(dim) for dim in gap.dims[:-2])
    # what is no more than rounding of the widest opening is no overlap
    slight = -ROUNDING * np.abs(values).max(axis=(-2, -1), keepdims=True)
    flows = _flows(values.reshape(-1, *values.shape[-2:]), axes, grid.spacing, wraps)
    shape = (*values.shape[:-2], len(axes))
    conductivity = np.reshape([flow.conductivity for flow in flows], shape)
    each = (*leading, "axis")
    result = xr.Dataset(
        {
            "transmissivity": (each, conductivity / 12.0),
            "hydraulic_aperture": (each, np.cbrt(conductivity)),
            "percolates": (each, np.reshape([flow.crosses for flow in flows], shape)),
            "residual": (each, np.reshape([flow.residual for flow in flows], shape)),
            "aperture": (leading, np.maximum(values, 0.0).mean(axis=(-2, -1))),
            "open_fraction": (leading, (values > 0).mean(axis=(-2, -1))),
            "overlap_fraction": (leading, (values < slight).mean(axis=(-2, -1))),
        },
        coords=leading_coords(gap, leading, taken=RESULTS),
    ).assign_coords(axis=np.array(axes))
    if viscosity is not None:
        result["flow_conductance"] = result["transmissivity"] / viscosity
    result["run_time"] = time.perf_counter() - start
    residual = max(flow.residual for flow in flows)
    parameters = {"gap": gap, "axis": axes, "viscosity": viscosity, "periodic": periodic}
    title = "transmissivity of a joint"
    return stamp(
        label(result), WHERE, parameters, title=title, references=REFERENCES, achieved_residual=residual
    )


def _flows(planes: Array, axes: Sequence[str], spacing: Any, periodic: Any) -> list[Flow]:
    """Solve every plane along every axis; planes are turned so that the flow runs along the last axis."""
    flows = []
    for plane in planes:
        for axis in axes:
            along = ("y", "x").index(axis)
            turned = np.ascontiguousarray(plane if axis == "x" else plane.T)
            ratio = float(spacing[1 - along] / spacing[along])
            flows.append(plane_flow(turned, ratio, (bool(periodic[1 - along]), bool(periodic[along]))))
    return flows
