"""Pressure in the cells of a flow network: elimination in the order of nested dissection, or multigrid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.errors import MissingExtra
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import Plane
from fractalcontact.joints._flow_network import Held, Network, dissipation, even_gradient

ERROR = 1e-5  # of a result that is returned: elimination has 1e-7 at most, and a recursion loses a digit
UNKNOWN = (
    "NaN where the pressure comes out beyond those at the ends, or the flow beyond its bounds: the openings "
    "differ by more than the precision of the computer resolves"
)
# up to which elimination is faster than multigrid: 384 x 384 of a rough opening took 1.3 and 2.5 s, 512 x 512
# 2.4 and 3.1 s, 700 x 700 5.4 and 4.9 s
DIRECT_CELLS = 300_000


def flow_memory(plane: Plane, _: Mapping[str, Any]) -> float:
    """Return the bytes of the flow through one plane at a time, of one or of more of them.

    Measured for each cell: 1300, 1450 and 1590 by elimination at n = 128, 256 and 512, there 1830 where the
    plane wraps, and 670 by multigrid at n = 600.
    """
    cells = math.prod(plane.shape)
    by_elimination = cells <= DIRECT_CELLS or find_spec("pyamg") is None
    return (1850.0 if by_elimination else 680.0) * cells + 8.0 * (plane.planes - 1) * cells


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
    if cells.size <= 9:  # 4 and 25 took the same time within a fifth
        return [cells.ravel()]
    if cells.shape[0] > cells.shape[1]:
        cells = cells.T
    middle = cells.shape[1] // 2
    return [*_dissected(cells[:, :middle]), *_dissected(cells[:, middle + 1 :]), cells[:, middle]]


def pressures(network: Network, inside: Array, order: Array, held: Held, axis: int) -> tuple[Array, float]:
    """Return the pressure in every cell, zero outside the chosen clusters, and its error.

    No pressure leaves the range of those that are held. The error is the relative residual, by how much the
    solution left that range, or by how much it dissipates more than an even gradient along `axis` (Dirichlet:
    the true pressure dissipates least), whichever is most. `inside` are whole clusters of open cells, and
    `order` all cells as elimination takes them.
    """
    from scipy.sparse import coo_array, diags_array

    number, chosen = np.cumsum(inside) - 1, inside[network.i]
    i, j, conductance = number[network.i[chosen]], number[network.j[chosen]], network.conductance[chosen]
    size = int(inside.sum())
    # conductance of each cell to held pressures, and the pressure that they make together
    to_held, inflow = held.conductance.ravel()[inside], held.inflow.ravel()[inside]
    level = np.divide(inflow, to_held, out=np.zeros_like(inflow), where=to_held > 0)
    outgoing, incoming = np.bincount(i, conductance, size), np.bincount(j, conductance, size)
    diagonal = outgoing + incoming + to_held
    index = np.int32 if size < 2**29 else np.int64  # a cell has four links
    links = coo_array((conductance, (i.astype(index), j.astype(index))), shape=(size, size)).tocsr()
    matrix = (diags_array(diagonal) - links - links.T).tocsr()
    even = even_gradient(network.shape, axis)
    balance = Balance(i, j, conductance, network.jump[chosen], to_held, level)
    scale = _norm(balance.surplus(np.zeros(size))) or 1.0
    p, most = even.ravel()[inside], dissipation(network, even, inside, held)
    if _norm(balance.surplus(p)) > 1e-14 * scale:  # less where all cells are open alike
        unknown = _without_reference_cells(matrix) if network.jump.any() else np.ones(size, bool)
        sequence = number[order[inside[order]]]
        sequence = (np.cumsum(unknown) - 1)[sequence[unknown[sequence]]]
        system = System(matrix[unknown][:, unknown], unknown, balance, most, scale)
        p = _solve(system, p, sequence)
    missed = balance.beyond_range(p)
    p = balance.within_range(p)  # what this moves is part of the error
    error = max(_norm(balance.surplus(p)) / scale, missed)
    pressure = np.zeros(inside.size)
    pressure[inside] = p
    pressure = pressure.reshape(network.shape)
    flow = dissipation(network, pressure, inside, held)
    return pressure, max(error, flow / most - 1.0) if most > 0 else error


class Balance(NamedTuple):
    """Links between cells i and j with their jumps, and conductance and level of held pressures."""

    i: Array
    j: Array
    conductance: Array
    jump: Array
    held: Array
    level: Array

    def surplus(self, p: Array) -> Array:
        """Return what flows into each cell beyond what leaves it.

        It is summed over links, not taken from the matrix: in a sum over the links of one cell the weak ones
        are lost in the rounding of the strong ones, and with them the level of a deep pocket.
        """
        flow = self.conductance * (p[self.i] - p[self.j] + self.jump)
        links = np.bincount(self.j, flow, p.size) - np.bincount(self.i, flow, p.size)
        return np.asarray(links + self.held * (self.level - p))

    def within_range(self, p: Array) -> Array:
        """Return pressures cut to the range of the held ones, between which all others lie."""
        levels = self.level[self.held > 0]
        return np.clip(p, levels.min(), levels.max()) if levels.size else p

    def beyond_range(self, p: Array) -> float:
        """Return by how much a pressure lies beyond those that are held."""
        return float(np.abs(p - self.within_range(p)).max())


class System(NamedTuple):
    """Equations of the unknown pressures, and what is left of them at any pressure.

    `power` is the dissipation at the start, `scale` the norm of what is left where all pressures are zero.
    """

    matrix: Any
    unknown: Array
    balance: Balance
    power: float
    scale: float


def _without_reference_cells(matrix: Any) -> Array:
    """Return all cells but one of each cluster: without fixed ends one cell sets the level of pressure."""
    from scipy.sparse.csgraph import connected_components

    labels = connected_components(matrix, directed=False)[1]
    unknown = np.ones(labels.size, bool)
    unknown[np.unique(labels, return_index=True)[1]] = False
    return unknown


def _solve(system: System, start: Array, order: Array) -> Array:
    """Solve a large system by multigrid where it is installed, a small one by elimination in this order.

    Elimination is refined with what is left of the balance (Wilkinson): its factors lose the level of deep
    pockets to rounding, the balance does not. Return the start where the matrix is singular to rounding.
    """
    from scipy.sparse.linalg import splu

    matrix, count = system.matrix, system.matrix.shape[0]
    if count > DIRECT_CELLS and find_spec("pyamg") is not None:
        p = _conjugate_gradients(system, start, _multigrid(matrix))
        if p is not None:
            return p
    options = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
    try:
        ordered = matrix[order][:, order].tocsc()
        # other sizes of panels and of relaxed supernodes take the same time within a tenth
        factors = splu(ordered, permc_spec="NATURAL", relax=1, panel_size=8, options=options)
    except RuntimeError:  # a pivot of 0: links to a part of the plane are lost in the rounding of its own
        return start
    except MemoryError as error:
        raise MissingExtra(f"the flow through {count} open cells", "pyamg", "flow") from error
    p, last = start, math.inf
    place = np.flatnonzero(system.unknown)[order]
    # 2 to 5 steps in 420 drawn gaps, whose pressures left their range by up to 3e-6 after the first step, and
    # by 2e-16 after the last
    for _ in range(10):
        step = factors.solve(system.balance.surplus(p)[place])
        size = float(np.abs(step).max())
        # rounding, or a matrix that has lost its weak links
        if not np.finfo(np.float64).eps < size < 0.5 * last:
            break
        p, last = p.copy(), size
        p[place] += step
    return p


def _multigrid(matrix: Any) -> Any:
    """Return one V-cycle of smoothed aggregation as an operator.

    Strong connections are the classical ones, so that no aggregate reaches from a wide channel into a narrow
    one beside it. The prolongation is smoothed with local weights, which need no estimate of an eigenvalue.
    The same by `smoothed_aggregation_solver` of pyamg, which fits candidates to every aggregate, takes 1.2 to
    1.6 times as long on 700 x 700 cells.
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
        if size > 400:  # fewer are solved directly in a millisecond
            strong = classical_strength_of_connection(matrix)
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
    system: System,
    start: Array,
    preconditioner: Any,
    *,
    flow_error: float = 1e-12,
    tolerance: float = 1e-6,
    max_iterations: int = 200,
) -> Array | None:
    """Solve A x = b by preconditioned conjugate gradients; None where the tolerance is not reached.

    The dissipation of the flow is `power` - b x at the solution. Before it is reached, the dissipation is too
    high by e A e (e the error of x), which r M r estimates (r the residual, M the preconditioner). Parts that
    only narrow openings join to the rest hardly dissipate: there the range of the pressures tells.

    Parameters
    ----------
    system : System
    start : ndarray
        Pressures of all cells.
    preconditioner : LinearOperator
    flow_error : float
        Relative error of the flow, in the norm of the preconditioner. With 1e-9 pressures behind narrow
        openings were off by up to .02 in four gaps of 192 x 192 cells, with 1e-12 by .002.
    tolerance : float
        Of the relative residual, which must be reached as well, and of the range of the pressures. With 1e-4
        pressures of two rough openings of 300 x 300 cells were off by 1e-4, with 1e-6 by 4e-7, in equal time.
    max_iterations : int
        Then elimination takes over; rough faces of 700 x 700 cells took 11.
    """
    p, b = start.copy(), system.balance.surplus(start)[system.unknown]
    x, r = np.zeros(b.size), b.copy()
    t, previous = np.zeros(b.size), 1.0
    for _ in range(max_iterations):
        z = preconditioner @ r
        r_z = _inner(r, z)
        is_balanced = _norm(r) <= tolerance * system.scale
        flow = max(system.power - _inner(b, x), flow_error * system.power)  # none where no path crosses
        is_balanced &= r_z <= flow_error * flow
        p[system.unknown] = start[system.unknown] + x
        if is_balanced and system.balance.beyond_range(p) <= tolerance:
            return p
        t = z + (r_z / previous) * t
        a_t = system.matrix @ t
        tau = r_z / _inner(t, a_t)
        x += tau * t
        r -= tau * a_t
        previous = r_z
    return None


def _inner(first: Array, second: Array) -> float:
    """Return the inner product of two vectors; the last digits of that of BLAS depend on its threads."""
    return float(np.einsum("i,i->", first, second))


def _norm(vector: Array) -> float:
    return math.sqrt(_inner(vector, vector))
