"""Pressure in the cells of a flow network: elimination in the order of nested dissection, or multigrid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.errors import MissingExtra
from fractalcontact.base.grid import Grid
from fractalcontact.base.memory import Plane
from fractalcontact.joints._flow_network import Held, Network, held_cells, link_network

Array = np.ndarray[Any, np.dtype[Any]]

LARGEST_DIRECT = 300_000  # unknowns up to which elimination is faster than multigrid
FLOW_ERROR = 1e-9  # relative error of the flow, in the norm of the preconditioner, that ends the iteration
RESIDUAL = 1e-6  # relative residual that must be reached as well
MAX_ITERATIONS = 200
COARSEST = 400  # unknowns of the coarsest grid, solved directly
LEAF = 9  # cells of a part that nested dissection leaves as it is
HELD = 1e7  # conductance to a drain or line over that between its cell and the next ones


# bytes of an open cell at the peak: 760, 1430 and 1590 by elimination at n = 128, 256, 512; 320 to 620 by
# multigrid at n = 800, as the allocator reuses its pages or not
DIRECT_BYTES, MULTIGRID_BYTES = 1600.0, 450.0
KEPT_BYTES = 48.0  # of a cell of every plane: its opening, and maps of pressure and flux


def flow_memory(plane: Plane, _: Mapping[str, Any]) -> float:
    """Return the bytes of the flow through one plane after the other, and of what is kept of each."""
    cells = plane.cells / plane.planes
    by_multigrid = cells > LARGEST_DIRECT and find_spec("pyamg") is not None
    return cells * (MULTIGRID_BYTES if by_multigrid else DIRECT_BYTES) + KEPT_BYTES * plane.cells


class Side(NamedTuple):
    """An edge, or a line of cells: the axis that it lies across (0 for y) and its place on it (m)."""

    axis: int
    place: float
    is_edge: bool


class HeldFlow:
    """A plane whose pressure is 1 at the upstream side, 0 at the downstream one, and `drained` at drains."""

    def __init__(self, grid: Grid, sides: tuple[Side, Side], is_drain: Array, drained: float) -> None:
        self.grid, self.sides, self.is_drain, self.drained = grid, sides, is_drain, drained
        self.ratio = grid.spacing[0] / grid.spacing[1]
        crossed = {side.axis for side in sides}
        self.wraps = grid.periodic[0] and 0 not in crossed, grid.periodic[1] and 1 not in crossed
        self.order = nested_dissection(grid.shape, self.wraps)

    def pressure(self, gap: Array) -> tuple[Array, float]:
        """Return the pressure, NaN where no water comes, and the relative residual."""
        dry = np.full(gap.shape, np.nan), 0.0
        largest = float(gap.max())
        if not largest > 0:
            return dry
        cells = np.maximum(gap / largest, 0.0) ** 3
        network = link_network(cells, self.ratio, self.wraps)
        network = replace(network, jump=np.zeros_like(network.jump))  # the pressures are held, not a gradient
        held = self._held(cells)
        wet = held_cells(network, held)
        if not wet.any():
            return dry
        pressure, residual = pressures(network, wet, self.order, held)
        return np.where(wet.reshape(gap.shape), pressure, np.nan), residual

    def _held(self, cells: Array) -> Held:
        fixed = HELD * (self.ratio + 1.0 / self.ratio) * cells
        conductance = fixed * self.is_drain
        inflow, energy = conductance * self.drained, conductance * self.drained**2
        for side, p in zip(self.sides, (1.0, 0.0), strict=True):
            n, half = cells.shape[side.axis], 2.0 * (self.ratio if side.axis == 1 else 1.0 / self.ratio)
            row = min(int(side.place / self.grid.spacing[side.axis]), n - 1)
            line = (slice(None), row) if side.axis == 1 else (row, slice(None))
            added = half * cells[line] if side.is_edge else fixed[line]
            conductance[line] += added
            inflow[line] += p * added
            energy[line] += p**2 * added
        return Held(conductance, inflow, energy)

    @property
    def sense(self) -> float:
        """1 where the flow leaves the upstream side towards rising coordinates, else -1."""
        upstream, downstream = self.sides
        same_axis = downstream.axis == upstream.axis
        beyond = downstream.place if same_axis else 0.5 * self.grid.extent[upstream.axis]
        return 1.0 if beyond > upstream.place else -1.0

    def distances(self, *, both_ends: bool = False) -> Array:
        """Return the distance (m) of rows of cells, or of both ends of the plane, from the upstream side."""
        upstream = self.sides[0]
        spacing, n = self.grid.spacing[upstream.axis], self.grid.shape[upstream.axis]
        places = np.array([0.0, n]) if both_ends else np.arange(n) + 0.5
        return self.sense * (places * spacing - upstream.place)


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


def pressures(network: Network, inside: Array, order: Array, held: Held) -> tuple[Array, float]:
    """Return the pressure in every cell, zero outside the chosen clusters, and the relative residual.

    `inside` are whole clusters of open cells, and `order` all cells as elimination takes them.
    """
    from scipy.sparse import coo_array, diags_array

    ny, nx = network.shape
    number, chosen = np.cumsum(inside) - 1, inside[network.i]
    i, j, conductance = number[network.i[chosen]], number[network.j[chosen]], network.conductance[chosen]
    size = int(inside.sum())
    outgoing, incoming = np.bincount(i, conductance, size), np.bincount(j, conductance, size)
    diagonal = outgoing + incoming + held.conductance.ravel()[inside]
    driven = conductance * network.jump[chosen]
    source = np.bincount(j, driven, size) - np.bincount(i, driven, size) + held.inflow.ravel()[inside]
    index = np.int32 if size < 2**29 else np.int64  # a cell has four links
    links = coo_array((conductance, (i.astype(index), j.astype(index))), shape=(size, size)).tocsr()
    matrix = (diags_array(diagonal) - links - links.T).tocsr()
    p = np.broadcast_to(1.0 - (np.arange(nx) + 0.5) / nx, (ny, nx)).ravel()[inside]
    scale = float(np.linalg.norm(source)) or 1.0
    residual = source - matrix @ p
    if np.linalg.norm(residual) > 1e-14 * scale:
        free = _without_reference_cells(matrix) if network.jump.any() else np.ones(size, bool)
        power = _power(network, _on_plane(p, inside, network.shape).ravel(), inside, held)
        sequence = number[order[inside[order]]]
        sequence = (np.cumsum(free) - 1)[sequence[free[sequence]]]
        p[free] += _solve(matrix[free][:, free], residual[free], sequence, power, RESIDUAL * scale)
        residual = source - matrix @ p
    return _on_plane(p, inside, network.shape), float(np.linalg.norm(residual)) / scale


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


def _power(network: Network, p: Array, inside: Array, held: Held) -> float:
    """Return the dissipation at any pressure, to the precision that the tolerance of the solution needs."""
    chosen = inside[network.i]
    drop = p[network.i[chosen]] - p[network.j[chosen]] + network.jump[chosen]
    ends = held.conductance.ravel() * p**2 - 2.0 * held.inflow.ravel() * p + held.energy.ravel()
    return float((network.conductance[chosen] * drop**2).sum() + ends[inside].sum())
