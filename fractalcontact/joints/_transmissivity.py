"""Flow through a joint by the local cubic law: finite volumes on the cells of the gap.

The flux between two cells passes their half-cells in series, so a link takes the harmonic mean: exact for
layers across or along the flow. Where four cells of different conductivity meet, that mean forces the flow
through the corner and is too low. There it is raised to the closed-form conductivity of the four cells as a
periodic pattern (Mortola and Steffe 1985; Craster and Obnosov 2001). Of the two corners at the ends of a link
the one with the greater gain counts, because the flow gathers there. Layers stay exact, and so do patterns of
single cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import check_leading, leading_coords
from fractalcontact.base.errors import MissingExtra
from fractalcontact.base.grid import periodic_axes, read_grid
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple

Array = np.ndarray[Any, np.dtype[Any]]

REFERENCES = (
    "Zimmerman, R. W. and Bodvarsson, G. S., Hydraulic conductivity of rock fractures, Transport in Porous "
    "Media 23 (1996); Craster, R. V. and Obnosov, Yu. V., Four-phase checkerboard composites, SIAM Journal "
    "on Applied Mathematics 61 (2001)"
)
RESULTS = ("axis", "transmissivity", "hydraulic_aperture", "percolates", "residual", "aperture",
           "open_fraction", "overlap_fraction", "flow_conductance", "run_time")  # fmt: skip
ROUNDING = 1e-9  # relative to the largest opening: a smaller overlap is rounding
LARGEST_DIRECT = 300_000  # unknowns up to which elimination is faster than multigrid
FLOW_ERROR = 1e-9  # relative error of the flow, in the norm of the preconditioner, that ends the iteration
RESIDUAL = 1e-6  # relative residual that must be reached as well
MAX_ITERATIONS = 200
COARSEST = 400  # unknowns of the coarsest grid, solved directly
LEAF = 9  # cells of a part that nested dissection leaves as it is


def _check(problems: Problems, *, gap: Any, axis: Any, viscosity: Any, periodic: Any) -> None:
    if problems.choices("axis", axis, ("x", "y")):
        problems.require(len(word_tuple(axis)) > 0, "axis", "at least one of 'x', 'y'", axis)
    problems.number("viscosity", viscosity, above=0, optional=True)
    problems.boolean("periodic", periodic, optional=True)
    if not problems.surface("gap", gap, leading=True, smallest=1):
        return
    check_leading(gap, RESULTS, problems, "gap")
    problems.periodic("periodic", periodic, read_grid(gap))
    values = np.asarray(gap.values, dtype=np.float64)
    below = int(np.count_nonzero(values.max(axis=(-2, -1)) < 0))
    expected = "an opening, zero in contact (not heights, nor lower - upper)"
    problems.require(below == 0, "gap", expected, f"{below} planes that are below zero everywhere")


@public_result(title="transmissivity of a joint", references=REFERENCES, check=_check)
def transmissivity(
    gap: xr.DataArray,
    *,
    axis: str | Sequence[str] = ("x", "y"),
    viscosity: float | None = None,
    periodic: bool | None = None,
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

    Returns
    -------
    Dataset over (..., axis)
        transmissivity (m3, hydraulic aperture cubed over 12), hydraulic_aperture (m), percolates (whether an
        open path of cells that share edges crosses, on a periodic axis to its own image; without one both
        are zero), residual (relative, of the linear system); over (...): aperture (mean opening, m),
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
    flows = _flows(values.reshape(-1, *values.shape[-2:]), axes, grid.spacing, wraps)
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
    return result


def _flows(planes: Array, axes: Sequence[str], spacing: Any, periodic: Any) -> list[Flow]:
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
            flows.append(plane_flow(oriented, ratio, wraps, orders[axis]))
    return flows


@dataclass(frozen=True)
class Flow:
    """Conductivity of the whole plane (gap cubed), whether an open path crosses it, relative residual."""

    conductivity: float
    percolates: bool
    residual: float


@dataclass(frozen=True)
class Network:
    """Conductances of the links between cells i and j, and of the first and last column to the two ends.

    `jump` is the pressure drop across a link beyond that of its cells: 1 where the link closes a period along
    the flow, else 0.
    """

    i: Array
    j: Array
    conductance: Array
    jump: Array
    inlet: Array
    outlet: Array
    shape: tuple[int, int]


def plane_flow(gap: Array, ratio: float, wraps: tuple[bool, bool], order: Array) -> Flow:
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
    """
    largest = float(gap.max())
    if not largest > 0:
        return Flow(0.0, False, 0.0)
    unit = float(np.ldexp(1.0, int(np.frexp(largest)[1])))
    network = _network(np.maximum(gap / unit, 0.0) ** 3, ratio, wraps)
    percolating = winding_cells(network) if wraps[1] else spanning_cells(network)
    if not percolating.any():
        return Flow(0.0, False, 0.0)
    pressure, residual = _pressures(network, percolating, order)
    ny, nx = network.shape
    conductivity = _dissipation(network, pressure, percolating) * (nx / ny) / ratio
    return Flow(conductivity * unit**3, True, residual)


def nested_dissection(shape: tuple[int, ...], wraps: tuple[bool, bool]) -> Array:
    """Return the cells of a plane in the order of nested dissection (George 1973).

    Both halves come before the line of cells between them, so that elimination fills in little. Along an axis
    that wraps, the first line is taken last: it separates the two ends.
    """
    cells, last = np.arange(np.prod(shape)).reshape(shape), []
    if wraps[0]:
        cells, last = cells[1:], [cells[0]]
    if wraps[1]:
        cells, last = cells[:, 1:], [cells[:, 0], *last]
    return np.concatenate([*_dissected(cells), *last])


def _dissected(cells: Array) -> list[Array]:
    """Return the cells of a part: those of its halves, then those of the line between them."""
    if cells.size <= LEAF:
        return [cells.ravel()]
    if cells.shape[0] > cells.shape[1]:
        cells = cells.T
    middle = cells.shape[1] // 2
    return [*_dissected(cells[:, :middle]), *_dissected(cells[:, middle + 1 :]), cells[:, middle]]


def _network(cells: Array, ratio: float, wraps: tuple[bool, bool]) -> Network:
    ny, nx = cells.shape
    along, across = _link_conductances(cells, wraps)
    number = np.arange(ny * nx).reshape(ny, nx)
    right = np.roll(number, -1, axis=1)[:, : along.shape[1]]
    below = np.roll(number, -1, axis=0)[: across.shape[0]]
    i = np.concatenate([number[:, : along.shape[1]].ravel(), number[: across.shape[0]].ravel()])
    j = np.concatenate([right.ravel(), below.ravel()])
    conductance = np.concatenate([(along * ratio).ravel(), (across / ratio).ravel()])
    jump = np.zeros(conductance.size)
    jump[: along.size] = np.broadcast_to(np.arange(along.shape[1]) == nx - 1, along.shape).ravel()
    is_open = conductance > 0
    ends = np.zeros((ny, 2)) if wraps[1] else 2.0 * ratio * cells[:, [0, -1]]
    i, j, conductance, jump = i[is_open], j[is_open], conductance[is_open], jump[is_open]
    return Network(i, j, conductance, jump, ends[:, 0], ends[:, 1], (ny, nx))


def _link_conductances(cells: Array, wraps: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the conductances of the links to the next column and to the next row.

    There is one link fewer than columns, or rows, unless that axis wraps.
    """
    ny, nx = cells.shape
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if wraps[0] else "edge")
    padded = np.pad(padded, ((0, 0), (1, 1)), mode="wrap" if wraps[1] else "edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]
    gain_x, gain_y = _corner_gain(a, b, c, d), _corner_gain(a, d, c, b)
    along = _series(padded[1:-1, 1:-1], padded[1:-1, 2:]) * np.maximum(gain_x[:-1, 1:], gain_x[1:, 1:])
    across = _series(padded[1:-1, 1:-1], padded[2:, 1:-1]) * np.maximum(gain_y[1:, :-1], gain_y[1:, 1:])
    return along[:, : nx if wraps[1] else nx - 1], across[: ny if wraps[0] and ny > 1 else ny - 1]


def _series(a: Array, b: Array) -> Array:
    """Return the harmonic mean, zero where one of the two is closed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a > 0) & (b > 0), 2.0 * a * b / (a + b), 0.0)


def _corner_gain(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the conductivity along a-b of the periodic pattern a b / d c, over that of its separate rows.

    Craster and Obnosov (2001): the square of the first is (abc + abd + acd + bcd) (a + d)(b + c) over
    (a + b + c + d)(a + b)(c + d).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        triples = a * b * (c + d) + c * d * (a + b)
        pattern = np.sqrt(triples / (a + b + c + d) * ((a + d) * (b + c)) / ((a + b) * (c + d)))
        gain = pattern / (0.5 * (_series(a, b) + _series(d, c)))
    # separate rows conduct least, so a gain below one is rounding; it is undefined where a row is closed
    return np.where(np.isfinite(gain), np.maximum(gain, 1.0), 1.0)


def _clusters(network: Network, chosen: Array) -> Array:
    """Label the clusters of cells (4 neighbours) that the chosen links join."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = network.shape[0] * network.shape[1]
    pairs = network.i[chosen], network.j[chosen]
    graph = coo_array((np.ones(pairs[0].size, np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph.tocsr(), directed=False)[1])


def spanning_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that reaches from end to end."""
    labels = _clusters(network, np.ones(network.i.size, bool)).reshape(network.shape)
    both = np.intersect1d(labels[network.inlet > 0, 0], labels[network.outlet > 0, -1])
    return np.isin(labels.ravel(), both)


def winding_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that meets its own image one or more periods away."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    closing = network.jump > 0
    labels = _clusters(network, ~closing)
    tail, head = labels[network.i[closing]], labels[network.j[closing]]
    count = int(labels.max()) + 1
    graph = coo_array((np.ones(tail.size, np.int32), (tail, head)), shape=(count, count)).tocsr()
    group = connected_components(graph, directed=False)[1]
    # count the periods along a spanning tree of each group; a link that disagrees closes a winding loop
    period = np.zeros(count, dtype=np.int64)
    links = set(zip(tail.tolist(), head.tolist(), strict=True))
    for root in np.unique(group[tail], return_index=True)[1]:
        order, parent = breadth_first_order(graph, tail[root], directed=False)
        for node in order[1:]:
            forward = (int(parent[node]), int(node)) in links
            period[node] = period[parent[node]] + (1 if forward else -1)
    winding = group[tail[period[head] - period[tail] != 1]]
    return np.isin(group[labels], winding)


def _pressures(network: Network, percolating: Array, order: Array) -> tuple[Array, float]:
    """Return the pressure in every cell for a drop of 1 along the plane, and the relative residual."""
    from scipy.sparse import coo_array, diags_array

    ny, nx = network.shape
    number, inside = np.cumsum(percolating) - 1, percolating[network.i]
    i, j, conductance = number[network.i[inside]], number[network.j[inside]], network.conductance[inside]
    size = int(percolating.sum())
    ends, inflow = np.zeros((ny, nx)), np.zeros((ny, nx))
    ends[:, 0] += network.inlet
    ends[:, -1] += network.outlet
    inflow[:, 0] = network.inlet
    outgoing, incoming = np.bincount(i, conductance, size), np.bincount(j, conductance, size)
    diagonal = outgoing + incoming + ends.ravel()[percolating]
    driven = conductance * network.jump[inside]
    source = np.bincount(j, driven, size) - np.bincount(i, driven, size) + inflow.ravel()[percolating]
    index = np.int32 if size < 2**29 else np.int64  # a cell has four links
    links = coo_array((conductance, (i.astype(index), j.astype(index))), shape=(size, size)).tocsr()
    matrix = (diags_array(diagonal) - links - links.T).tocsr()
    p = np.broadcast_to(1.0 - (np.arange(nx) + 0.5) / nx, (ny, nx)).ravel()[percolating]
    scale = float(np.linalg.norm(source)) or 1.0
    residual = source - matrix @ p
    if np.linalg.norm(residual) > 1e-14 * scale:
        free = _without_reference_cells(matrix) if network.jump.any() else np.ones(size, bool)
        power = _dissipation(network, _on_plane(p, percolating, network.shape), percolating)
        sequence = number[order[percolating[order]]]
        sequence = (np.cumsum(free) - 1)[sequence[free[sequence]]]
        p[free] += _solve(matrix[free][:, free], residual[free], sequence, power, RESIDUAL * scale)
        residual = source - matrix @ p
    return _on_plane(p, percolating, network.shape), float(np.linalg.norm(residual)) / scale


def _on_plane(p: Array, percolating: Array, shape: tuple[int, int]) -> Array:
    pressure = np.zeros(percolating.size)
    pressure[percolating] = p
    return pressure.reshape(shape)


def _without_reference_cells(matrix: Any) -> Array:
    """Return all cells but one of each cluster: without fixed ends one cell sets the level of pressure."""
    from scipy.sparse.csgraph import connected_components

    labels = connected_components(matrix, directed=False)[1]
    free = np.ones(labels.size, bool)
    free[np.unique(labels, return_index=True)[1]] = False
    return free


def _solve(matrix: Any, b: Array, order: Array, power: float, residual: float) -> Array:
    """Solve a large system by multigrid where it is installed, a small one by elimination.

    `order` is that of the elimination, `power` the dissipation before the correction by the solution.
    """
    from scipy.sparse.linalg import splu

    if b.size > LARGEST_DIRECT:
        try:
            preconditioner = _multigrid(matrix)
        except ImportError:
            pass
        else:
            p = _conjugate_gradients(matrix, b, preconditioner, power, residual)
            if p is not None:
                return p
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    try:
        ordered = matrix[order][:, order].tocsc()
        factors = splu(ordered, permc_spec="NATURAL", relax=1, panel_size=8, options=options)
    except MemoryError as error:
        raise MissingExtra(f"the flow through {b.size} open cells", "pyamg", "flow") from error
    x = np.empty_like(b)
    x[order] = factors.solve(b[order])
    return x


def _multigrid(matrix: Any) -> Any:
    """Return one V-cycle of smoothed aggregation as an operator.

    Strong connections are the classical ones, so that no aggregate reaches from a wide channel into a narrow
    one beside it. The prolongation is smoothed with local weights, which need no estimate of an eigenvalue.
    """
    from pyamg.aggregation.aggregate import standard_aggregation
    from pyamg.multilevel import MultilevelSolver
    from pyamg.relaxation.smoothing import change_smoothers
    from pyamg.strength import classical_strength_of_connection
    from scipy.sparse import diags_array

    levels: list[Any] = []
    size = 0
    while matrix.shape[0] != size:
        levels.append(MultilevelSolver.Level())
        levels[-1].A, size = matrix, matrix.shape[0]
        if size > COARSEST:
            strong = classical_strength_of_connection(matrix, theta=0.1)
            joined = standard_aggregation(strong)[0].astype(np.float64)
            weights = diags_array(4.0 / 3.0 / abs(matrix).sum(axis=1))
            levels[-1].P = (joined - weights @ (matrix @ joined)).tocsr()
            levels[-1].R = levels[-1].P.T.tocsr()
            matrix = (levels[-1].R @ matrix @ levels[-1].P).tocsr()
    cycle = MultilevelSolver(levels, coarse_solver="splu")
    sweeps = ("gauss_seidel", {"sweep": "symmetric"})
    change_smoothers(cycle, sweeps, sweeps)
    return cycle.aspreconditioner()


def _conjugate_gradients(
    matrix: Any, b: Array, preconditioner: Any, power: float, residual: float
) -> Array | None:
    """Solve A x = b by preconditioned conjugate gradients; None where the tolerance is not reached.

    The dissipation of the flow is `power` - b x at the solution. Before it is reached, the dissipation is too
    high by e A e (e the error of x), which r M r estimates (r the residual, M the preconditioner).
    """
    x, r = np.zeros(b.size), b.copy()
    t, previous = np.zeros(b.size), 1.0
    for _ in range(MAX_ITERATIONS):
        z = preconditioner @ r
        r_z = float(r @ z)
        if r_z <= FLOW_ERROR * (power - float(b @ x)) and np.linalg.norm(r) <= residual:
            return x
        t = z + (r_z / previous) * t
        a_t = matrix @ t
        tau = r_z / float(t @ a_t)
        x += tau * t
        r -= tau * a_t
        previous = r_z
    return None


def _dissipation(network: Network, pressure: Array, percolating: Array) -> float:
    """Return the flow under a unit pressure drop, computed as its dissipation.

    The error of the dissipation is of second order in that of the pressure.
    """
    p = pressure.ravel()
    inside = percolating[network.i]
    drop = p[network.i[inside]] - p[network.j[inside]] + network.jump[inside]
    plane = percolating.reshape(network.shape)
    power = network.conductance[inside] * drop**2
    inlet = network.inlet[plane[:, 0]] * (1.0 - pressure[plane[:, 0], 0]) ** 2
    outlet = network.outlet[plane[:, -1]] * pressure[plane[:, -1], -1] ** 2
    return float(power.sum() + inlet.sum() + outlet.sum())
