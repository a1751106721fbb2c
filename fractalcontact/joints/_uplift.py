"""Uplift: the force of the water in a joint between an upstream and a downstream side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints import _flow_network
from fractalcontact.joints._criteria import POSITIVE
from fractalcontact.joints._flow_network import Held, Network
from fractalcontact.joints._network_pressure import ERROR, UNKNOWN, flow_memory, nested_dissection, pressures

EDGES = {"W": (1, False), "E": (1, True), "S": (0, False), "N": (0, True)}  # axis, is at its far end
OPPOSITE = {"W": "E", "E": "W", "S": "N", "N": "S", "x": "E", "y": "N"}
LARGEST = 1e12  # Pa or m: far beyond water and dams; products do not overflow

FORCES = ("uplift_force", "mean_uplift", "uplift_arm", "uplift_x", "uplift_y", "uplift_profile")
ON_PATH = ("effective_stress", "balance_error")
RESULTS = ("diagram", "fluid_pressure", "wet_fraction", "isolated_fraction", "residual", *FORCES, *ON_PATH,
           "iterations", "converged", "run_time")  # fmt: skip

NO_UPLIFT = "NaN where no water presses on the joint"
OFF_THE_PATH = (
    "NaN where no effective stress on the path of the gap balances the total stress: the path ends too early "
    "(balance_error below 0), or the water lifts the joint at its lowest stress (above 0)"
)


def _check(problems: Problems) -> None:
    given = problems.given
    has_high = problems.number("upstream_pressure", above=0, at_most=LARGEST)
    has_low = problems.number("downstream_pressure", at_least=0, at_most=LARGEST)
    problems.number("drain_pressure", at_least=0, at_most=LARGEST, optional=True)
    problems.number("drain_diameter", at_least=0)
    problems.number("drain_share", at_least=0, at_most=1)
    problems.number("normal_stiffness", at_least=1e3, optional=True)  # Pa/m: softer joints open by metres
    problems.number("total_stress", at_least=POSITIVE["at_least"], at_most=LARGEST, optional=True)
    if has_high and has_low:
        falls = given.downstream_pressure < given.upstream_pressure
        problems.require(falls, "downstream_pressure", "less than upstream_pressure")
    both = given.normal_stiffness is not None and given.total_stress is not None
    problems.require(not both, "total_stress / normal_stiffness", "one of them", "both of them")
    has_gap = _flow_network.check_gap(problems, given.gap, RESULTS)
    gap = given.gap if has_gap else None
    has_sides = _check_side(problems, "upstream", given.upstream, gap)
    if given.downstream is not None:
        has_sides &= _check_side(problems, "downstream", given.downstream, gap)
    has_drains = given.drains is not None and problems.numbers("drains", any_shape=True)
    if not has_gap:
        return
    if has_sides:
        high_side, low_side = _sides(given.upstream, given.downstream, given.gap)
        differ = high_side.axis != low_side.axis or high_side.place != low_side.place
        problems.require(differ, "downstream", "another edge or line than upstream")
    if has_drains:
        _check_drains(problems, given.drains, given.gap)
    if given.total_stress is not None:
        _check_path(problems, given.gap)


def _check_side(problems: Problems, name: str, value: Any, gap: xr.DataArray | None) -> bool:
    expected = "'W', 'E', 'S', 'N', or a line as ('x', its x in m) or ('y', its y in m)"
    if isinstance(value, str):
        return problems.require(value in EDGES, name, expected, value)
    is_pair = isinstance(value, (tuple, list)) and len(value) == 2 and value[0] in ("x", "y")
    if not problems.require(is_pair, name, expected, value):
        return False
    if not problems.number(name, value[1], at_least=-LARGEST, at_most=LARGEST):
        return False
    if gap is None:
        return True
    axis = "yx".index(value[0])
    place, extent = _from_edge(gap, axis, float(value[1])), read_grid(gap).extent[axis]
    return problems.require(0.0 < place < extent, name, "a line inside the plane", value)


def _check_drains(problems: Problems, drains: Any, gap: xr.DataArray) -> None:
    expected = "points (x, y) in m inside the plane"
    points = np.asarray(drains, dtype=np.float64)
    if points.ndim not in (1, 2) or points.shape[-1] != 2 or points.size == 0:
        problems.add("drains", expected, f"an array of shape {points.shape}")
        return
    grid = read_grid(gap)
    for column, axis in ((0, 1), (1, 0)):
        place = _from_edge(gap, axis, points.reshape(-1, 2)[:, column]) / grid.spacing[axis]
        # a point on the edge may be off by its digits
        inside = (place >= -1e-4) & (place <= gap.shape[axis - 2] + 1e-4)
        if not problems.require(bool(inside.all()), "drains", expected, drains):
            return


def _check_path(problems: Problems, gap: xr.DataArray) -> None:
    expected = "a gap over step whose nominal_pressure rises, as `joints.closure` returns it"
    is_path = "step" in gap.dims[:-2] and "nominal_pressure" in gap.coords and gap.sizes["step"] > 1
    got = f"dims {gap.dims}, coordinates {list(gap.coords)}"
    if not problems.require(is_path, "total_stress", expected, got):
        return
    stresses = _path_stresses(gap)
    rises = bool(np.isfinite(stresses).all() and (stresses >= 0).all() and (np.diff(stresses) > 0).all())
    problems.require(rises, "total_stress", expected, stresses.reshape(-1, stresses.shape[-1])[0].tolist())


@public_result(
    title="uplift in a joint",
    references=(
        "US Army Corps of Engineers, Gravity Dam Design, EM 1110-2-2200 (1995); US Bureau of Reclamation, "
        "Design of Gravity Dams (1976)"
    ),
    reasons=dict.fromkeys(("uplift_arm", "uplift_x", "uplift_y"), NO_UPLIFT),
    check=_check,
    memory=flow_memory,
)
def uplift(
    gap: xr.DataArray,
    *,
    upstream_pressure: float,
    downstream_pressure: float = 0.0,
    upstream: str | Sequence[Any] = "W",
    downstream: str | Sequence[Any] | None = None,
    drains: Sequence[Any] | None = None,
    drain_pressure: float | None = None,
    drain_diameter: float = 0.0,
    drain_share: float = 1.0 / 3.0,
    normal_stiffness: float | None = None,
    total_stress: float | None = None,
) -> xr.Dataset:
    """Return the uplift of the water that flows through a joint, beside that of the guidelines for dams.

    The pressure follows the local cubic law. It acts on the open cells that a side or a drain reaches, and is
    compared with the diagrams that guidelines assume on the whole area: linear between the two sides, and
    with drains bilinear, with a share of the difference left at the drains.

    Parameters
    ----------
    gap : DataArray, dims (..., y, x)
        Opening of the joint, m; no NaN. Cells open by less than 0.001 of the mean opening count as contact.
        Nothing flows through edges without a pressure; periodic ones are joined.
    upstream_pressure, downstream_pressure : float
        Water pressure at the two sides, Pa: unit weight times head above the joint.
    upstream, downstream : {"W", "E", "S", "N"} or ("x" or "y", float)
        The two sides: an edge (E is +x), or the line of cells at this x or y (m), beyond which the pressure
        is the same. Default: W, and the edge opposite; of a line E or N.
    drains, drain_pressure, drain_diameter : sequence of (x, y), float, float, optional
        Drains, m. The open cells in a circle of `drain_diameter` (m), or the nearest cell, are held at
        `drain_pressure` (Pa, default `downstream_pressure`). One cell is a drain with a radius of 0.14
        hypot(dx, dy), 0.2 spacings of square cells (Peaceman 1983). A drain in contact has no effect.
    drain_share : float
        Share of the pressure difference at the drains in the bilinear diagram: 1/3 after the USBR.
    normal_stiffness : float, optional
        Pa/m. The pressure opens each open cell by pressure / stiffness, iterated to balance with the flow.
    total_stress : float, optional
        Normal stress of structure and joint together, Pa; not with `normal_stiffness`. `gap` is then a path
        over `step` with the coordinate nominal_pressure, as `closure` returns it: on it the effective stress
        is found that, with the mean uplift, balances the total one.

    Returns
    -------
    Dataset over (...), without `step` if balanced on a path
        fluid_pressure (..., y, x) (Pa, NaN where no water comes). Over (..., diagram), "joint", and between
        parallel sides "linear" and with drains "bilinear": uplift_force (N), mean_uplift (Pa, over the
        nominal area), uplift_arm (m, of its line of action from the upstream side), uplift_x and uplift_y (m,
        the point where it acts), uplift_profile (Pa, means over each row of cells).
        wet_fraction; isolated_fraction (open, without water); residual (relative); converged; run_time (s).
        If iterated iterations; on a path also effective_stress (Pa), balance_error (of the total stress).

    Raises
    ------
    InvalidInput
        `gap` is not an opening or not a path, a drain or line is outside it, or pressures are out of order.
        What does not converge gives a ConvergenceWarning.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> step = np.repeat([[2e-4, 1e-4]], 20, axis=1) * np.ones((4, 1))  # twice as wide upstream
    >>> result = fc.joints.uplift(fc.surfaces.from_array(step, 1.0), upstream_pressure=490.5e3)
    >>> [round(float(f / result.uplift_force.sel(diagram="linear")), 4) for f in result.uplift_force]
    [1.3889, 1.0]
    """
    grid, low = read_grid(gap), float(downstream_pressure)
    drop = upstream_pressure - low
    drained = 0.0 if drain_pressure is None else (drain_pressure - low) / drop
    points = np.asarray([] if drains is None else drains, dtype=np.float64).reshape(-1, 2)  # (x, y)
    sides = _sides(upstream, downstream, gap)
    crossed = {side.axis for side in sides}
    wraps = grid.periodic[0] and 0 not in crossed, grid.periodic[1] and 1 not in crossed
    flow = HeldFlow(grid, wraps, sides, _drain_cells(gap, wraps, points, drain_diameter), drained)
    if total_stress is not None:
        gap = gap.transpose(..., "step", "y", "x")
        paths = np.asarray(gap.values, dtype=np.float64).reshape(-1, *gap.shape[-3:])
        stresses = _path_stresses(gap).reshape(len(paths), -1)
        balance = partial(_balanced, flow=flow, total=float(total_stress), water=(low, drop))
        states = list(map(balance, paths, stresses))
        along = [name for name, coord in gap.coords.items() if "step" in coord.dims]
        gap = gap.isel(step=0).drop_vars(along)
    else:
        soft = None if normal_stiffness is None else (low / normal_stiffness, drop / normal_stiffness)
        gaps = np.asarray(gap.values, dtype=np.float64).reshape(-1, *gap.shape[-2:])
        states = [_opened(opening, flow, soft) for opening in gaps]
    leading = tuple(str(dim) for dim in gap.dims[:-2])
    pressure = np.reshape([low + drop * state.pressure for state in states], gap.shape)
    axis = flow.sides[0].axis
    drain_places = flow.distances(_from_edge(gap, axis, points[:, 1 - axis]))
    knots = _diagrams(flow, (upstream_pressure, low), drain_share, drain_places)
    result = _forces(pressure, flow, knots, leading)
    for axis, name in enumerate(("uplift_y", "uplift_x")):
        result[name] = result[name] - _from_edge(gap, axis, 0.0)
    result["fluid_pressure"] = ((*leading, "y", "x"), pressure)
    result["wet_fraction"] = leading, np.isfinite(pressure).mean(axis=(-2, -1))
    names = ["isolated_fraction", "residual", "converged"]
    names += ["iterations"] if normal_stiffness is not None or total_stress is not None else []
    for name in (*names, *(ON_PATH if total_stress is not None else ())):
        result[name] = leading, np.reshape([getattr(state, name) for state in states], gap.shape[:-2])
    _explain(result)
    coords = leading_coords(gap, leading, taken=RESULTS) | {dim: gap[dim].variable for dim in ("y", "x")}
    residual = max(state.residual for state in states)
    return result.assign_coords(coords).assign_attrs(achieved_residual=residual)


def _explain(result: xr.Dataset) -> None:
    """Give NaN where nothing balances, and say why, and why an iteration did not converge."""
    is_known, reason, unconverged = result["residual"] <= ERROR, UNKNOWN, UNKNOWN
    if is_known.all():
        unconverged = "opening and flow did not come to balance"
        if "effective_stress" in result:
            is_known, reason = result["effective_stress"].notnull(), OFF_THE_PATH
            unconverged = "no effective stress on the path balances the total stress"
    if not result["converged"].all():
        result["converged"].attrs["reason"] = unconverged
    if is_known.all():
        return
    for name in {"effective_stress", "wet_fraction", "isolated_fraction", *FORCES} & set(result):
        shown = is_known | (result["diagram"] != "joint") if name in FORCES else is_known
        result[name] = result[name].where(shown).assign_attrs(reason=reason)


def _from_edge(gap: xr.DataArray, axis: int, position: Any) -> Any:
    """Return the distance (m) of a coordinate from the low edge of the plane."""
    centres = np.asarray(gap["yx"[axis]].values, dtype=np.float64)
    return position - centres[0] + 0.5 * read_grid(gap).spacing[axis]


def _sides(upstream: Any, downstream: Any, gap: xr.DataArray) -> tuple[Side, Side]:
    if downstream is None:
        downstream = OPPOSITE[upstream if isinstance(upstream, str) else upstream[0]]
    return _side(upstream, gap), _side(downstream, gap)


def _side(value: Any, gap: xr.DataArray) -> Side:
    grid = read_grid(gap)
    if isinstance(value, str):
        axis, is_far = EDGES[value]
        return Side(axis, grid.extent[axis] if is_far else 0.0, True)
    axis = "yx".index(value[0])
    spacing = grid.spacing[axis]
    cell = min(int(_from_edge(gap, axis, float(value[1])) / spacing), grid.shape[axis] - 1)
    return Side(axis, (cell + 0.5) * spacing, False)


def _drain_cells(gap: xr.DataArray, wraps: Sequence[bool], points: Array, diameter: float) -> Array:
    """Return which cells are drains: those within the diameter of a point, at least the nearest one."""
    grid = read_grid(gap)
    cells = np.zeros(grid.shape, dtype=bool)
    y, x = (np.asarray(gap[dim].values, dtype=np.float64) for dim in ("y", "x"))
    for point_x, point_y in points:
        away = [np.abs(y - point_y), np.abs(x - point_x)]
        for axis in np.flatnonzero(wraps):  # the shorter way, across the edge or not
            away[axis] = np.minimum(away[axis], grid.extent[axis] - away[axis])
        cells[away[0].argmin(), away[1].argmin()] = True
        if diameter > 0:
            cells |= np.hypot(*np.meshgrid(*away, indexing="ij")) <= diameter / 2.0
    return cells


class Side(NamedTuple):
    """An edge, or a line of cells: the axis that it lies across (0 for y) and its place on it (m)."""

    axis: int
    place: float
    is_edge: bool


class HeldFlow:
    """A plane whose pressure is 1 at the upstream side, 0 at the downstream one, and `drained` at drains."""

    def __init__(
        self, grid: Grid, wraps: tuple[bool, bool], sides: tuple[Side, Side], is_drain: Array, drained: float
    ) -> None:
        self.grid, self.wraps, self.sides = grid, wraps, sides
        self.is_drain, self.drained = is_drain, drained
        self.ratio = grid.spacing[0] / grid.spacing[1]
        self.order = nested_dissection(grid.shape, self.wraps)

    def pressure(self, gap: Array) -> tuple[Array, float]:
        """Return the pressure, NaN where no water comes or beyond the allowed error, and its error."""
        dry = np.full(gap.shape, np.nan), 0.0
        gap = _flow_network.conducting(gap)
        largest = float(gap.max())
        if not largest > 0:
            return dry
        cells = (gap / largest) ** 3
        network = _flow_network.link_network(cells, self.ratio, self.wraps)
        held = self._held(cells)
        wet = _flow_network.held_cells(network, held)
        if not wet.any():
            return dry
        pressure, error = pressures(network, wet, self.order, held, self.sides[0].axis)
        error = max(error, self._missed_flow(network, wet, held, pressure, cells))
        is_known = wet.reshape(gap.shape) & (error <= ERROR)
        return np.where(is_known, pressure, np.nan), error

    def _missed_flow(self, network: Network, wet: Array, held: Held, pressure: Array, cells: Array) -> float:
        """Return by how much the flow from edge to edge falls short of that of the lines of cells alone."""
        axis = self.sides[0].axis
        if axis != self.sides[1].axis or not all(side.is_edge for side in self.sides):
            return 0.0
        ends = [_flow_network.edge_conductance(cells, self.ratio, axis, place) for place in (0, -1)]
        least = _flow_network.least_flow(network, axis, wet, ends)
        return 1.0 - _flow_network.dissipation(network, pressure, wet, held) / least if least > 0 else 0.0

    def _held(self, cells: Array) -> Held:
        held = _flow_network.nothing_held(cells.shape)
        # 1e7 times what is between a cell of a drain or line and the next ones; 1e8 changes 2e-8
        fixed = 1e7 * (self.ratio + 1.0 / self.ratio) * cells
        held.add(self.is_drain, fixed[self.is_drain], self.drained)
        for side, pressure in zip(self.sides, (1.0, 0.0), strict=True):
            row = min(int(side.place / self.grid.spacing[side.axis]), cells.shape[side.axis] - 1)
            line = _flow_network.line_of(side.axis, row)
            at_edge = _flow_network.edge_conductance(cells, self.ratio, side.axis, row)
            held.add(line, at_edge if side.is_edge else fixed[line], pressure)
        return held

    @property
    def sense(self) -> float:
        """1 where the flow leaves the upstream side towards rising coordinates, else -1."""
        upstream, downstream = self.sides
        same_axis = downstream.axis == upstream.axis
        beyond = downstream.place if same_axis else 0.5 * self.grid.extent[upstream.axis]
        return 1.0 if beyond > upstream.place else -1.0

    def distances(self, places: Any) -> Any:
        """Return the distance (m) of places from the low edge of the plane (m) from the upstream side."""
        return self.sense * (places - self.sides[0].place)


class State(NamedTuple):
    """Pressure, 1 upstream and 0 downstream, and how it was found; stresses in Pa."""

    pressure: Array
    residual: float
    isolated_fraction: float
    iterations: int = 0
    converged: bool = True
    effective_stress: float = math.nan
    balance_error: float = math.nan


def _opened(
    gap: Array,
    flow: HeldFlow,
    soft: tuple[float, float] | None,
    *,
    balance: float = 1e-10,
    max_iterations: int = 500,
    relaxation: float = 0.7,
    least_relaxation: float = 0.02,
) -> State:
    """Return the pressure that belongs to the gap it opens.

    Parameters
    ----------
    gap : ndarray, shape (ny, nx)
        Without water, m.
    flow : HeldFlow
    soft : pair of float, optional
        Opening (m) under the downstream pressure and that under the pressure difference; None: none.
    balance : float
        Change of the pressures that ends the iteration: it leaves an error of 5e-12.
    max_iterations : int
        24 rough joints of stiffnesses from 1e8 to 1e11 Pa/m took 41 at most.
    relaxation, least_relaxation : float
        Of the opening, halved where the pressures oscillate: one that closes a bottleneck, say. The least of
        .01, .04 and .3 gave the same forces in as many iterations.
    """
    p, residual = flow.pressure(gap)
    isolated, is_known = _isolated(gap, p), residual <= ERROR
    if soft is None or not is_known:
        return State(p, residual, isolated, converged=is_known)
    opened, last = np.zeros_like(gap), math.inf
    for iteration in range(1, max_iterations + 1):
        wanted = np.where(np.isfinite(p), soft[0] + soft[1] * p, 0.0)
        opened += relaxation * (wanted - opened)
        previous = p
        p, residual = flow.pressure(gap + opened)
        if residual > ERROR:
            break
        change = float(np.nanmax(np.abs(p - previous), initial=0.0))
        if not change > balance:
            return State(p, residual, isolated, iteration)
        if change > last:  # it oscillates
            relaxation = max(0.5 * relaxation, least_relaxation)
        last = change
    return State(p, residual, isolated, iteration, converged=False)


def _isolated(gap: Array, pressure: Array) -> float:
    return float(((_flow_network.conducting(gap) > 0) & np.isnan(pressure)).mean())


def _path_stresses(gap: xr.DataArray) -> Array:
    """Return the effective stress along the path of each gap, shape (..., step)."""
    stress = gap["nominal_pressure"].broadcast_like(gap.isel(y=0, x=0, drop=True)).transpose(..., "step")
    return np.asarray(stress.values, dtype=np.float64)


def _balanced(
    gaps: Array,
    stresses: Array,
    flow: HeldFlow,
    total: float,
    water: tuple[float, float],
    *,
    place_error: float = 1e-9,  # in steps of the path; 1e-7 and 1e-11 found the same place
    balance: float = 1e-4,  # of the total stress: a cell that opens takes up more than the solver's error
) -> State:
    """Return the state on a path of gaps at which effective stress and mean uplift make the total stress.

    Between two steps the gap is linear in the logarithm of the stress, as elastic faces close. `water` is the
    downstream pressure and the pressure difference. The path is searched from its greatest stress down:
    there may be a second balance of a joint that the water holds open.
    """
    from scipy.optimize import brentq

    @cache  # the search asks again for the steps that enclose the balance
    def state(place: float) -> State:
        step = min(int(place), len(stresses) - 2)
        share, (low, high) = place - step, stresses[step : step + 2]
        stress = low * (high / low) ** share if low > 0 else share * high
        gap = gaps[step] + share * (gaps[step + 1] - gaps[step])
        p, residual = flow.pressure(gap)
        uplift = float(np.nan_to_num(water[0] + water[1] * p).mean())
        error = (stress + uplift) / total - 1.0
        balances = abs(error) <= balance and residual <= ERROR
        return State(p, residual, _isolated(gap, p), 0, balances, float(stress), error)

    place = float(len(stresses) - 1)  # as the search states it
    trial = state(place)
    while place > 0 and trial.balance_error > 0:
        place, above = place - 1, trial
        trial = state(place)
    if trial.balance_error <= 0 and place < len(stresses) - 1 and above.balance_error > 0:
        trial = state(brentq(lambda at: state(at).balance_error, place, place + 1, xtol=place_error))
    elif not trial.converged:
        trial = trial._replace(pressure=np.full_like(trial.pressure, np.nan), effective_stress=math.nan)
    return trial._replace(iterations=state.cache_info().currsize)


Knots = dict[str, tuple[Array, Array]]


def _diagrams(flow: HeldFlow, ends: tuple[float, float], share: float, drains: Array) -> Knots:
    """Return distance from the upstream side and pressure at the knots of the diagrams of guidelines.

    The bilinear one breaks at the mean distance of the `drains` (m), not at the middle of their cells.
    """
    (upstream, downstream), (high, low) = flow.sides, ends
    if upstream.axis != downstream.axis:
        return {}
    reach = abs(downstream.place - upstream.place)
    last = np.sort(flow.distances(np.array([0.0, flow.grid.extent[upstream.axis]])))
    knots = {"linear": (np.array([last[0], 0.0, reach, last[1]]), np.array([high, high, low, low]))}
    drain = float(drains.mean()) if drains.size else math.nan
    if 0.0 < drain < reach:
        pressure = np.array([high, high, low + share * (high - low), low, low])
        knots["bilinear"] = np.array([last[0], 0.0, drain, reach, last[1]]), pressure
    return knots


def _cell_means(flow: HeldFlow, place: Array, pressure: Array) -> Array:
    """Return the means over the rows of cells of a pressure that is linear between places (m)."""
    axis = flow.sides[0].axis
    spacing, half = flow.grid.spacing[axis], 0.5 * flow.grid.spacing[axis]
    edges = flow.distances((np.arange(flow.grid.shape[axis]) + 0.5) * spacing)[:, None] + [-half, half]
    # where the pressure breaks inside a row, it is integrated from edge to break to edge
    corners = np.clip(place, *np.split(edges, 2, axis=1))
    at = np.sort(np.concatenate([edges, corners], axis=1), axis=1)
    return np.asarray(np.trapezoid(np.interp(at, place, pressure), at, axis=1) / (2.0 * half))


def _forces(pressure: Array, flow: HeldFlow, knots: Knots, leading: tuple[str, ...]) -> xr.Dataset:
    """Return force, point of action (from the low edges) and profile of the joint and of the diagrams."""
    grid, upstream = flow.grid, flow.sides[0]
    axis, length = upstream.axis, grid.extent[upstream.axis]
    filled = np.nan_to_num(pressure)
    profile, mean = filled.mean(axis=-2 if axis == 1 else -1), filled.mean(axis=(-2, -1))
    centres = [_centre(pressure, 0, grid), _centre(pressure, 1, grid)]
    # of the joint, then of each diagram: mean, arm, y and x
    rows, profiles = [(mean, flow.distances(centres[axis]), *centres)], [profile]
    for place, p in knots.values():
        a, b, step = p[:-1] / p[0], p[1:] / p[0], np.diff(place)
        force = (a + b) / 2.0 * step
        arm = (force * place[:-1] + step**2 * (a + 2.0 * b) / 6.0).sum() / force.sum()
        centre = [0.5 * extent for extent in grid.extent]
        centre[axis] = upstream.place + flow.sense * arm
        row = (p[0] * force.sum() / length, arm, *centre)
        rows.append(tuple(np.full_like(mean, value) for value in row))
        profiles.append(np.broadcast_to(_cell_means(flow, place, p), profile.shape))
    dims, columns = (*leading, "diagram"), np.stack(rows, -1)
    names = ("mean_uplift", "uplift_arm", "uplift_y", "uplift_x")
    variables: dict[str, Any] = {"uplift_force": (dims, columns[0] * grid.nominal_area)}
    variables |= {name: (dims, column) for name, column in zip(names, columns, strict=True)}
    variables["uplift_profile"] = (*dims, "yx"[axis]), np.stack(profiles, -2)
    return xr.Dataset(variables, {"diagram": ["joint", *knots]})


def _centre(pressure: Array, axis: int, grid: Grid) -> Array:
    """Return the distance (m) of the resultant of a pressure, NaN where dry, from the low edge of an axis."""
    profile = np.nan_to_num(pressure).mean(axis=-1 if axis == 0 else -2)
    spacing = grid.spacing[axis]
    mean = profile.mean(axis=-1)
    moment = (profile * (np.arange(profile.shape[-1]) + 0.5) * spacing).mean(axis=-1)
    if profile.shape[-1] > 1:  # the pressure falls inside a cell between wet ones
        slope = np.nan_to_num(np.gradient(pressure, spacing, axis=axis - 2)) * np.isfinite(pressure)
        moment = moment + slope.mean(axis=(-2, -1)) * spacing**2 / 12.0
    return np.asarray(np.divide(moment, mean, out=np.full_like(mean, np.nan), where=mean > 0))
