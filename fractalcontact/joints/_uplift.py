"""Uplift: the force of the water in a joint between an upstream and a downstream edge."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints._flow_network import (
    Held,
    Network,
    check_gap,
    held_cells,
    held_ends,
    link_network,
    nested_dissection,
    pressures,
)

Array = np.ndarray[Any, np.dtype[Any]]

RESULTS = ("diagram", "fluid_pressure", "uplift_profile", "uplift_force", "mean_uplift", "uplift_arm",
           "wet_fraction", "isolated_fraction", "residual", "run_time")  # fmt: skip
EDGES = ("W", "E", "S", "N")
LARGEST_PRESSURE = 1e12  # Pa
SOFTEST = 1e3  # Pa/m
HELD = 1e7  # conductance to a drain over that between its cell and the next ones
BALANCE = 1e-10  # relative change of the pressures that ends the iteration with the opening
MAX_ITERATIONS = 500
RELAXATION = 0.7  # of the opening; 1 oscillates where the pressure opens the joint several times


def _check(
    problems: Problems,
    *,
    gap: Any,
    upstream_pressure: Any,
    downstream_pressure: Any,
    upstream: Any,
    drains: Any,
    drain_pressure: Any,
    drain_diameter: Any,
    drain_share: Any,
    normal_stiffness: Any,
) -> None:
    high = problems.number("upstream_pressure", upstream_pressure, above=0, at_most=LARGEST_PRESSURE)
    low = problems.number("downstream_pressure", downstream_pressure, at_least=0, at_most=LARGEST_PRESSURE)
    if high and low:
        expected = "less than upstream_pressure"
        problems.require(
            downstream_pressure < upstream_pressure, "downstream_pressure", expected, downstream_pressure
        )
    problems.choice("upstream", upstream, EDGES)
    problems.number("drain_pressure", drain_pressure, at_least=0, at_most=LARGEST_PRESSURE, optional=True)
    problems.number("drain_diameter", drain_diameter, at_least=0)
    problems.number("drain_share", drain_share, at_least=0, at_most=1)
    problems.number("normal_stiffness", normal_stiffness, at_least=SOFTEST, optional=True)
    if check_gap(problems, gap, RESULTS) and drains is not None:
        _check_drains(problems, drains, gap)


def _check_drains(problems: Problems, drains: Any, gap: xr.DataArray) -> None:
    expected = "points (x, y) in m inside the plane"
    try:
        points = np.asarray(drains, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        problems.add("drains", expected, drains)
        return
    if points.ndim not in (1, 2) or points.shape[-1] != 2 or points.size == 0:
        problems.add("drains", expected, f"an array of shape {points.shape}")
        return
    grid = read_grid(gap)
    for column, (dim, spacing) in enumerate(zip("xy", grid.spacing[::-1], strict=True)):
        centres = np.asarray(gap[dim].values, dtype=np.float64)
        place = points.reshape(-1, 2)[:, column]
        inside = (place >= centres[0] - 0.5001 * spacing) & (place <= centres[-1] + 0.5001 * spacing)
        if not problems.require(bool(inside.all()), "drains", expected, drains):
            return


@public_result(
    title="uplift in a joint",
    references="US Army Corps of Engineers, Gravity Dam Design, EM 1110-2-2200 (1995)",
    check=_check,
)
def uplift(
    gap: xr.DataArray,
    *,
    upstream_pressure: float,
    downstream_pressure: float = 0.0,
    upstream: str = "W",
    drains: Sequence[Any] | None = None,
    drain_pressure: float | None = None,
    drain_diameter: float = 0.0,
    drain_share: float = 1.0 / 3.0,
    normal_stiffness: float | None = None,
) -> xr.Dataset:
    """Return the uplift of the water that flows through a joint, beside that of the guidelines for dams.

    The pressure follows the local cubic law, as in `transmissivity`. It acts on the open cells that an edge
    or a drain reaches. It is compared with the diagrams that the guidelines assume on the whole area:
    linear between the edges, and with drains bilinear, with a share of the difference left at the drains.

    Parameters
    ----------
    gap : DataArray, dims (..., y, x)
        Local opening of the joint, m, without water pressure if `normal_stiffness` is given; no NaN. Cells
        at or below zero are in contact. Nothing flows through the sides; periodic sides are joined.
    upstream_pressure, downstream_pressure : float
        Water pressure at the two edges, Pa: unit weight times head above the joint.
    upstream : {"W", "E", "S", "N"}
        The upstream edge (E is +x, N is +y).
    drains : sequence of (x, y), optional
        Positions of drains, m. The open cells within `drain_diameter` (m), or the nearest cell, are held at
        `drain_pressure` (Pa, by default `downstream_pressure`). One cell acts as a drain with a radius of 0.2
        spacings (Peaceman 1978). A drain in contact has no effect.
    drain_share : float
        Share of the pressure difference at the drains in the bilinear diagram.
    normal_stiffness : float, optional
        Stiffness of the joint, Pa/m: the pressure opens each open cell by pressure / stiffness, and flow and
        opening are iterated to balance.

    Returns
    -------
    Dataset over (...)
        fluid_pressure (..., y, x) (Pa, NaN where no water comes from an edge or drain). Over (..., diagram),
        which is "joint", "linear" and with drains "bilinear": uplift_force (N), mean_uplift (force over
        nominal area, Pa), uplift_arm (m, distance of its line of action from the upstream edge) and
        uplift_profile (Pa, force per area, along x or y). wet_fraction; isolated_fraction (open cells that no
        water reaches, counted without pressure); residual (relative, of the linear system). run_time (s).

    Raises
    ------
    InvalidInput
        `gap` is not an opening, a drain is outside it, or a pressure is out of order.

    Notes
    -----
    The effective stress on the joint is the total normal stress minus `mean_uplift`. Pressures are exact for
    layers across the flow.

    References
    ----------
    EM 1110-2-2200 (1995); Peaceman (1978), SPE Journal 18:183.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> step = np.repeat([[2e-4, 1e-4]], 20, axis=1) * np.ones((4, 1))  # twice as wide upstream
    >>> result = fc.joints.uplift(fc.surfaces.from_array(step, 1.0), upstream_pressure=490.5e3)
    >>> [round(float(f / result.uplift_force.sel(diagram="linear")), 4) for f in result.uplift_force]
    [1.3889, 1.0]
    """
    grid, side = read_grid(gap), _Edge(upstream)
    values = np.asarray(gap.values, dtype=np.float64)
    leading = tuple(str(dim) for dim in gap.dims[:-2])
    drop = upstream_pressure - downstream_pressure
    drained = 0.0 if drain_pressure is None else (drain_pressure - downstream_pressure) / drop
    is_drain = side.turn(_drain_cells(gap, grid, drains, drain_diameter))
    spacing = grid.spacing[side.axis], grid.spacing[1 - side.axis]
    wraps = bool(grid.periodic[1 - side.axis]), False
    order = nested_dissection(is_drain.shape, wraps)
    opening = 0.0 if normal_stiffness is None else drop / normal_stiffness
    base = 0.0 if normal_stiffness is None else downstream_pressure / normal_stiffness
    planes, residuals = [], []
    for plane in values.reshape(-1, *values.shape[-2:]):
        turned = side.turn(plane)
        p, residual = _balance(
            turned, is_drain, drained, spacing[1] / spacing[0], wraps, order, (base, opening)
        )
        planes.append(side.turn_back(downstream_pressure + drop * p))
        residuals.append(residual)
    pressure = np.reshape(planes, values.shape)
    knots = _diagrams(grid, side, is_drain, (upstream_pressure, downstream_pressure), drain_share)
    result = _forces(pressure, grid, side, knots, leading)
    outer = values.shape[:-2]
    result["fluid_pressure"] = ((*leading, "y", "x"), pressure)
    wet = np.isfinite(pressure)
    result["wet_fraction"] = (leading, wet.mean(axis=(-2, -1)))
    result["isolated_fraction"] = (leading, ((values > 0) & ~wet).mean(axis=(-2, -1)))
    result["residual"] = (leading, np.reshape(residuals, outer))
    plane_coords = {dim: gap[dim].variable for dim in ("y", "x")}
    return result.assign_coords(leading_coords(gap, leading, taken=RESULTS) | plane_coords).assign_attrs(
        achieved_residual=max(residuals)
    )


class _Edge:
    """The upstream edge: axis of the flow (0 for y), and how a plane is turned to flow along its rows."""

    def __init__(self, name: str) -> None:
        self.axis = 1 if name in ("W", "E") else 0
        self.dim = "yx"[self.axis]
        self.backwards = name in ("E", "N")

    def turn(self, plane: Array) -> Array:
        along = plane if self.axis == 1 else plane.T
        return np.ascontiguousarray(along[:, ::-1] if self.backwards else along)

    def turn_back(self, plane: Array) -> Array:
        along = plane[:, ::-1] if self.backwards else plane
        return along if self.axis == 1 else along.T


def _drain_cells(gap: xr.DataArray, grid: Grid, drains: Any, diameter: float) -> Array:
    """Return which cells are drains: those within the diameter of a point, at least the nearest one."""
    cells = np.zeros(grid.shape, dtype=bool)
    if drains is None:
        return cells
    y, x = (np.asarray(gap[dim].values, dtype=np.float64) for dim in ("y", "x"))
    for point_x, point_y in np.asarray(drains, dtype=np.float64).reshape(-1, 2):
        cells[np.abs(y - point_y).argmin(), np.abs(x - point_x).argmin()] = True
        if diameter > 0:
            cells |= np.hypot(*np.meshgrid(y - point_y, x - point_x, indexing="ij")) <= diameter / 2.0
    return cells


def _balance(
    gap: Array,
    is_drain: Array,
    drained: float,
    ratio: float,
    wraps: tuple[bool, bool],
    order: Array,
    opening: tuple[float, float],
) -> tuple[Array, float]:
    """Return the pressure, 1 upstream and 0 downstream, that belongs to the gap it opens, and the residual.

    `opening` is that of the downstream pressure and that of the pressure difference.
    """
    p, residual = _plane_pressure(gap, is_drain, drained, ratio, wraps, order)
    opened = np.zeros_like(gap)
    for _ in range(MAX_ITERATIONS if opening[1] > 0 else 0):
        wanted = np.where(np.isfinite(p), opening[0] + opening[1] * p, 0.0)
        opened += RELAXATION * (wanted - opened)
        previous = p
        p, residual = _plane_pressure(gap + opened, is_drain, drained, ratio, wraps, order)
        if not np.nanmax(np.abs(p - previous), initial=0.0) > BALANCE:
            break
    return p, residual


def _plane_pressure(
    gap: Array, is_drain: Array, drained: float, ratio: float, wraps: tuple[bool, bool], order: Array
) -> tuple[Array, float]:
    """Return the pressure in a plane, NaN where no water comes, and the relative residual."""
    largest = float(gap.max())
    if not largest > 0:
        return np.full(gap.shape, np.nan), 0.0
    cells = np.maximum(gap / largest, 0.0) ** 3
    network = link_network(cells, ratio, wraps)
    held = _held(network, HELD * (ratio + 1.0 / ratio) * cells * is_drain, drained)
    wet = held_cells(network, held)
    if not wet.any():
        return np.full(gap.shape, np.nan), 0.0
    pressure, residual = pressures(network, wet, order, held)
    return np.where(wet.reshape(gap.shape), pressure, np.nan), residual


def _held(network: Network, conductance: Array, drained: float) -> Held:
    ends = held_ends(network)
    return Held(
        ends.conductance + conductance,
        ends.inflow + conductance * drained,
        ends.energy + conductance * drained**2,
    )


def _diagrams(
    grid: Grid, side: _Edge, is_drain: Array, ends: tuple[float, float], share: float
) -> dict[str, tuple[Array, Array]]:
    """Return distance from the upstream edge and pressure at the knots of the diagrams of guidelines."""
    length = grid.extent[side.axis]
    high, low = ends
    knots = {"linear": (np.array([0.0, length]), np.array([high, low]))}
    if is_drain.any():
        place = (float(np.nonzero(is_drain)[1].mean()) + 0.5) * grid.spacing[side.axis]
        knots["bilinear"] = np.array([0.0, place, length]), np.array([high, low + share * (high - low), low])
    return knots


def _forces(
    pressure: Array, grid: Grid, side: _Edge, knots: dict[str, tuple[Array, Array]], leading: tuple[str, ...]
) -> xr.Dataset:
    """Return force, line of action and profile of the joint and of the diagrams."""
    spacing, length = grid.spacing[side.axis], grid.extent[side.axis]
    profile = np.nan_to_num(pressure).mean(axis=-2 if side.axis == 1 else -1)
    profile = profile[..., ::-1] if side.backwards else profile
    distance = (np.arange(profile.shape[-1]) + 0.5) * spacing
    mean, moment = profile.mean(axis=-1), (profile * distance).mean(axis=-1)
    if profile.shape[-1] > 1:  # the pressure falls inside a cell
        moment = moment + np.gradient(profile, spacing, axis=-1).mean(axis=-1) * spacing**2 / 12.0
    means, moments, profiles = [mean], [moment], [profile]
    for place, p in knots.values():
        a, b = p[:-1], p[1:]
        step = np.diff(place)
        force = (a + b) / 2.0 * step
        means.append(np.full_like(mean, force.sum() / length))
        moments.append(
            np.full_like(mean, (force * place[:-1] + step**2 * (a + 2.0 * b) / 6.0).sum() / length)
        )
        profiles.append(np.broadcast_to(np.interp(distance, place, p), profile.shape))
    mean, moment, shown = np.stack(means, -1), np.stack(moments, -1), np.stack(profiles, -2)
    dims = (*leading, "diagram")
    arm = np.divide(moment, mean, out=np.full_like(mean, np.nan), where=mean > 0)
    return xr.Dataset(
        {
            "uplift_force": (dims, mean * grid.nominal_area),
            "mean_uplift": (dims, mean),
            "uplift_arm": (dims, arm),
            "uplift_profile": ((*dims, side.dim), shown[..., ::-1] if side.backwards else shown),
        },
        coords={"diagram": ["joint", *knots]},
    )
