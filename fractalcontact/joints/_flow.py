"""Flow through a gap by the local cubic law: finite volumes on the cells, flow along the last axis.

The flux between two cells meets their half-cells in series, so the face takes the harmonic mean: exact for
layers across or along the flow. Where four cells of different conductivity meet, that mean forces the
flow through the corner and is too low. There it is raised to what the four cells conduct as a periodic
pattern, which is known in closed form (Mortola and Steffe 1985; Craster and Obnosov 2001); of the corners at
the two ends of a face the one that raises it more counts, since the flow gathers there. Layers stay exact,
and so do patterns of single cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.errors import MissingExtra

Array = np.ndarray[Any, np.dtype[Any]]

DIRECT = 300_000  # up to so many unknowns elimination is faster than multigrid
# of the iterative solver: relative error of the flow as its preconditioner sees it, and relative residual
FLOW_ERROR, TOLERANCE = 1e-9, 1e-6
MOST = 200  # iterations
COARSEST = 400  # unknowns


@dataclass(frozen=True)
class Flow:
    """Conductivity of the whole plane (in units of its cells' own), whether a path crosses, residual."""

    conductivity: float
    crosses: bool
    residual: float


@dataclass(frozen=True)
class Network:
    """Links between cells, i to j, and of the first and last column to the ends of the plane.

    `jump` is the fall of pressure, beyond that of its cells, that drives a link: 1 where it closes a period
    along the flow, else 0.
    """

    i: Array
    j: Array
    link: Array
    jump: Array
    inlet: Array
    outlet: Array
    shape: tuple[int, int]


def plane_flow(gap: Array, ratio: float, wraps: tuple[bool, bool]) -> Flow:
    """Return the conductivity (gap cubed) of a plane along its last axis.

    Parameters
    ----------
    gap : ndarray, shape (ny, nx)
        Cells at or below zero are closed.
    ratio : float
        Spacing across the flow over the spacing along it.
    wraps : pair of bool
        Whether the plane repeats across and along the flow. Nothing flows through free sides; free ends are
        held at two pressures, and a plane that repeats along the flow is under a mean gradient.
    """
    largest = float(gap.max())
    if not largest > 0:
        return Flow(0.0, False, 0.0)
    unit = float(np.ldexp(1.0, int(np.frexp(largest)[1])))
    network = _network(np.maximum(gap / unit, 0.0) ** 3, ratio, wraps)
    crossing = winding_cells(network) if wraps[1] else spanning_cells(network)
    if not crossing.any():
        return Flow(0.0, False, 0.0)
    pressure, residual = _pressures(network, crossing)
    ny, nx = network.shape
    conductivity = _dissipation(network, pressure, crossing) * (nx / ny) / ratio
    return Flow(conductivity * unit**3, True, residual)


def _network(cells: Array, ratio: float, wraps: tuple[bool, bool]) -> Network:
    ny, nx = cells.shape
    along, across = _faces(cells, wraps)
    number = np.arange(ny * nx).reshape(ny, nx)
    right = np.roll(number, -1, axis=1)[:, : along.shape[1]]
    below = np.roll(number, -1, axis=0)[: across.shape[0]]
    i = np.concatenate([number[:, : along.shape[1]].ravel(), number[: across.shape[0]].ravel()])
    j = np.concatenate([right.ravel(), below.ravel()])
    link = np.concatenate([(along * ratio).ravel(), (across / ratio).ravel()])
    jump = np.zeros(link.size)
    jump[: along.size] = np.broadcast_to(np.arange(along.shape[1]) == nx - 1, along.shape).ravel()
    flows = link > 0
    ends = np.zeros((ny, 2)) if wraps[1] else 2.0 * ratio * cells[:, [0, -1]]
    return Network(i[flows], j[flows], link[flows], jump[flows], ends[:, 0], ends[:, 1], (ny, nx))


def _faces(cells: Array, wraps: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the conductances of the faces to the next column and to the next row.

    There is one face fewer than columns, or rows, unless that axis wraps.
    """
    ny, nx = cells.shape
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if wraps[0] else "edge")
    padded = np.pad(padded, ((0, 0), (1, 1)), mode="wrap" if wraps[1] else "edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]
    above, beside = _corner_gain(a, b, c, d), _corner_gain(a, d, c, b)
    along = _series(padded[1:-1, 1:-1], padded[1:-1, 2:]) * np.maximum(above[:-1, 1:], above[1:, 1:])
    across = _series(padded[1:-1, 1:-1], padded[2:, 1:-1]) * np.maximum(beside[1:, :-1], beside[1:, 1:])
    return along[:, : nx if wraps[1] else nx - 1], across[: ny if wraps[0] and ny > 1 else ny - 1]


def _series(a: Array, b: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a > 0) & (b > 0), 2.0 * a * b / (a + b), 0.0)


def _corner_gain(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the conductivity of four cells a b / d c along a-b, over that of their two rows apart."""
    with np.errstate(divide="ignore", invalid="ignore"):
        triples = a * b * (c + d) + c * d * (a + b)
        pattern = np.sqrt(triples / (a + b + c + d) * ((a + d) * (b + c)) / ((a + b) * (c + d)))
        gain = pattern / (0.5 * (_series(a, b) + _series(d, c)))
    # rows apart conduct least, so a gain below one is rounding, and none is defined where a row is closed
    return np.where(np.isfinite(gain), np.maximum(gain, 1.0), 1.0)


def _clusters(network: Network, kept: Array) -> Array:
    """Label the cells (4 neighbours) that the kept links join."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = network.shape[0] * network.shape[1]
    pairs = network.i[kept], network.j[kept]
    graph = coo_array((np.ones(pairs[0].size, np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph.tocsr(), directed=False)[1])


def spanning_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that reaches from end to end."""
    labels = _clusters(network, np.ones(network.i.size, bool)).reshape(network.shape)
    both = np.intersect1d(labels[network.inlet > 0, 0], labels[network.outlet > 0, -1])
    return np.isin(labels.ravel(), both)


def winding_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that meets its own image one or more periods on."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    closing = network.jump > 0
    labels = _clusters(network, ~closing)
    tail, head = labels[network.i[closing]], labels[network.j[closing]]
    count = int(labels.max()) + 1
    graph = coo_array((np.ones(tail.size, np.int32), (tail, head)), shape=(count, count)).tocsr()
    group = connected_components(graph, directed=False)[1]
    # count the periods along a tree through each group; a link that disagrees closes a winding loop
    period = np.zeros(count, dtype=np.int64)
    links = set(zip(tail.tolist(), head.tolist(), strict=True))
    for root in np.unique(group[tail], return_index=True)[1]:
        order, parent = breadth_first_order(graph, tail[root], directed=False)
        for node in order[1:]:
            forward = (int(parent[node]), int(node)) in links
            period[node] = period[parent[node]] + (1 if forward else -1)
    winding = group[tail[period[head] - period[tail] != 1]]
    return np.isin(group[labels], winding)


def _pressures(network: Network, crossing: Array) -> tuple[Array, float]:
    """Return the pressure in every cell, which falls by 1 along the plane, and the relative residual."""
    from scipy.sparse import coo_array, diags_array

    ny, nx = network.shape
    number, inside = np.cumsum(crossing) - 1, crossing[network.i]
    i, j, link = number[network.i[inside]], number[network.j[inside]], network.link[inside]
    size = int(crossing.sum())
    ends, inflow = np.zeros((ny, nx)), np.zeros((ny, nx))
    ends[:, 0] += network.inlet
    ends[:, -1] += network.outlet
    inflow[:, 0] = network.inlet
    total = np.bincount(i, link, size) + np.bincount(j, link, size) + ends.ravel()[crossing]
    driven = link * network.jump[inside]
    source = np.bincount(j, driven, size) - np.bincount(i, driven, size) + inflow.ravel()[crossing]
    narrow = np.int32 if size < 2**29 else np.int64  # four links to a cell
    links = coo_array((link, (i.astype(narrow), j.astype(narrow))), shape=(size, size)).tocsr()
    matrix = (diags_array(total) - links - links.T).tocsr()
    p = np.broadcast_to(1.0 - (np.arange(nx) + 0.5) / nx, (ny, nx)).ravel()[crossing]
    scale = float(np.linalg.norm(source)) or 1.0
    rest = source - matrix @ p
    if np.linalg.norm(rest) > 1e-14 * scale:
        free = _ungrounded(matrix) if network.jump.any() else np.ones(size, bool)
        before = _dissipation(network, _on_plane(p, crossing, network.shape), crossing)
        p[free] += _solve(matrix[free][:, free], rest[free], before, TOLERANCE * scale)
        rest = source - matrix @ p
    return _on_plane(p, crossing, network.shape), float(np.linalg.norm(rest)) / scale


def _on_plane(p: Array, crossing: Array, shape: tuple[int, int]) -> Array:
    pressure = np.zeros(crossing.size)
    pressure[crossing] = p
    return pressure.reshape(shape)


def _ungrounded(matrix: Any) -> Array:
    """Return all cells but one of each cluster: where no end holds the pressure, one cell does."""
    from scipy.sparse.csgraph import connected_components

    labels = connected_components(matrix, directed=False)[1]
    free = np.ones(labels.size, bool)
    free[np.unique(labels, return_index=True)[1]] = False
    return free


def _solve(matrix: Any, b: Array, before: float, residual: float) -> Array:
    """Solve by multigrid where it is installed and pays, to an error of the flow, else by elimination.

    `before` is the power that the flow takes before the correction by the solution.
    """
    from scipy.sparse.linalg import splu

    if b.size > DIRECT:
        try:
            preconditioner = _multigrid(matrix)
        except ImportError:
            pass
        else:
            p = _conjugate_gradients(matrix, b, preconditioner, before, residual)
            if p is not None:
                return p
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    try:
        factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options=options)
    except MemoryError as error:
        raise MissingExtra(f"the flow through {b.size} open cells", "pyamg", "flow") from error
    return np.asarray(factors.solve(b))


def _multigrid(matrix: Any) -> Any:
    """Return one V-cycle over smoothed aggregates of cells as an operator.

    Aggregates must not reach from a wide channel into a narrow one beside it. Prolongation is smoothed by
    local weights, which need no estimate of an eigenvalue.
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
    matrix: Any, b: Array, preconditioner: Any, before: float, residual: float
) -> Array | None:
    """Return the solution once the flow and the residual are good enough; None where they never are.

    The power that the flow takes is `before` - b p at the solution, and above it by what is left, e A e,
    which r M r measures.
    """
    p, rest = np.zeros(b.size), b.copy()
    step, last = np.zeros(b.size), 1.0
    for _ in range(MOST):
        moved = preconditioner @ rest
        left = float(rest @ moved)
        if left <= FLOW_ERROR * (before - float(b @ p)) and np.linalg.norm(rest) <= residual:
            return p
        step = moved + (left / last) * step
        pull = matrix @ step
        length = left / float(step @ pull)
        p += length * step
        rest -= length * pull
        last = left
    return None


def _dissipation(network: Network, pressure: Array, crossing: Array) -> float:
    """Return the flow under a unit fall of pressure as the power it takes, whose error is of second order."""
    p = pressure.ravel()
    inside = crossing[network.i]
    fall = p[network.i[inside]] - p[network.j[inside]] + network.jump[inside]
    used = crossing.reshape(network.shape)
    power = network.link[inside] * fall**2
    inlet = network.inlet[used[:, 0]] * (1.0 - pressure[used[:, 0], 0]) ** 2
    outlet = network.outlet[used[:, -1]] * pressure[used[:, -1], -1] ** 2
    return float(power.sum() + inlet.sum() + outlet.sum())
