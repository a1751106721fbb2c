"""The fast method along a load path: which nodes each step is solved on, from which start and precision.

A free body touches only where the gap at first touch is less than the closure, for its displacement is
positive everywhere. One of three solvers takes these candidates; `Solution.solver` says which one did:

    whole_plane    a periodic body, or a free one that may touch nearly everywhere: transforms of its plane
    window         more than a few candidates: transforms of the box of the plane that holds them
    node_pairs     a few: sums over pairs of them, without any transform but the last

Under force control the closure is not known beforehand. Solved on too few nodes, the closure comes out too
large; so either no other node lies below it, and the candidates are verified, or the nodes below it are a
sufficient set.

Single precision first saves a tenth to a quarter of the time from n = 512 on, and at n = 256, where the
transforms fit the caches either way, a seventh at most. Each precision compiles all passes of the iteration
once, so that small surfaces, the usual size of a block that is slid, take double precision alone and start in
half the time.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.contact._constrained_cg import ConstrainedCG, ContactSystem
from fractalcontact.contact._operator import KEPT, SINGLE, HalfSpaceOperator, Operator, PairSum
from fractalcontact.contact._preconditioner import NodePreconditioner, stiffness_table
from fractalcontact.contact._problem import Body, Control, Problem, Solution

Window = tuple[slice, slice]

WHOLE_PLANE = (slice(None), slice(None))
# nodes from which single precision first saves a tenth to a quarter of the time; at 384 x 384 it saves less
# than its kernels, which double precision does not share, take to compile (3 s)
SINGLE_FROM = 512 * 512
# candidates for this much more than the expected closure; 1.02 and 1.3 took the same time at light loads
CLOSURE_MARGIN = 1.1


class PastStep(NamedTuple):
    """A step that has been solved: what was imposed, and the scaled solution.

    Pressure p and gap g are in one array, `state` = p - g/c with the compliance c of a node by itself. As
    p g = 0, it is the pressure in contact, and -g/c at an open node, which closes where a line through the
    states of two steps crosses zero. Where a node yields the overlap (g < 0) adds to the largest pressure.
    """

    control: float
    closure: float
    state: Array


class WindowSolver:
    """Solver of one problem, kept along a path."""

    def __init__(self, problem: Problem, tolerance: float) -> None:
        self.problem, self.tolerance = problem, tolerance
        self.past_steps: list[PastStep] = []  # up to two, the last one at the end
        self.iterations, self.transforms = 0, 0  # of the current step
        self._guess: Array | None = None  # of the current step, instead of an extrapolation
        self._operator: Operator | None = None
        self._pair_tables: tuple[Array, Array] | None = None
        self._sorted_gap: Array | None = None
        self._window: tuple[Window, Problem] | None = None
        # of the last window, by precision; free bodies only, whose coefficients take time
        self._systems: dict[Any, ContactSystem] = {}

    def solve(self, control: Control, guess: Array | None = None) -> Solution:
        """Solve one step of the path, from a pressure or from those of the steps before."""
        self.iterations, self.transforms = 0, 0
        self._guess = guess if guess is not None and (guess > 0).any() else None
        if self.problem.body.periodic:
            solution = self.solve_in_window(control, WHOLE_PLANE, self.extrapolated_pressure(control))
        else:
            solution = self.solve_on_nodes(control) or self.solve_on_window(control)
        if solution.reason in ("rounding", "stagnated"):
            solution = self.solve_from_the_closure(control, solution)
        solution = self.remove_rounding_pressure(solution)
        past = PastStep(control.value, solution.closure, self.state_of(solution))
        self.past_steps = [*self.past_steps[-1:], past]
        return replace(solution, iterations=self.iterations, transforms=self.transforms)

    def set_gap(self, gap: Array) -> None:
        """Go on with another gap, where yielded nodes have been lowered."""
        self.problem = replace(self.problem, gap=gap)
        self._sorted_gap, self._window = None, None

    def solve_from_the_closure(self, control: Control, rough: Solution) -> Solution:
        """Go on with gaps that count from the closure; return the better solution.

        A spike that yields, or one far above a plane, is higher than the bodies deform by up to ten orders of
        magnitude, and the gaps of the other nodes, counted from its top, lose as many digits.
        """
        gap = self.problem.gap - rough.closure
        system = ContactSystem.on_plane(
            replace(self.problem, gap=gap), np.float64, self.problem.local_compliance
        )
        shifted = control if control.closure is None else Control(closure=control.closure - rough.closure)
        fine = ConstrainedCG(system, shifted, rough.pressure).solve(self.tolerance)
        self.add_work(fine)
        if not fine.residual < rough.residual:
            return rough
        return replace(fine, closure=fine.closure + rough.closure, solver="whole_plane")

    def remove_rounding_pressure(
        self,
        solution: Solution,
        *,
        share: float = 1e-13,  # of the greatest pressure; 1e-15 and 1e-11 gave the same bits
    ) -> Solution:
        """Unload the open nodes that bear no more than rounding, which an extrapolation may have left."""
        pressure = solution.pressure
        tiny = (pressure > 0) & (pressure <= share * pressure.max(initial=0.0))
        if not tiny.any():
            return solution
        is_open = self.problem.gap + solution.displacement > solution.closure
        return replace(solution, pressure=np.where(tiny & is_open, 0.0, pressure))

    def state_of(self, solution: Solution) -> Array:
        """Return the state of `PastStep`, with the spacing for the compliance of a node by itself.

        On square cells that is 0.89 to 1.15 spacings, by the kind of influence coefficients.
        """
        state = self.problem.gap + solution.displacement
        state -= solution.closure
        state /= -np.sqrt(self.problem.body.spacing[0] * self.problem.body.spacing[1])
        state += solution.pressure
        return state

    def add_work(self, solution: Solution) -> None:
        """Add the iterations and transforms of one of the attempts of a step to its totals."""
        self.iterations += solution.iterations
        self.transforms += solution.transforms

    # where to start from

    def extrapolated_pressure(
        self,
        control: Control,
        *,
        max_steps: float = 2.0,  # of the path; .5: 1.22 times the transforms, 8: .99
    ) -> Array | None:
        """Return the pressure of the state extrapolated from two steps, linear in the log of the control.

        A node that is about to close enters with a pressure. Extrapolating the pressure alone took 1.12 times
        as many transforms on paths on rough surfaces, up to 1.31; ten times the compliance, or a quarter of
        it, takes 1.06. Linear in the control takes 1.12, a parabola through three steps 1.03.
        """
        if self._guess is not None:
            return self._guess
        if not self.past_steps:
            return None
        first, last = self.past_steps[0], self.past_steps[-1]
        if first.control != last.control:
            # how far ahead in the log of the control, the step from `first` to `last` as the unit
            steps = np.log(control.value / last.control) / np.log(last.control / first.control)
            if abs(steps) <= max_steps:
                return np.asarray(np.maximum(last.state + steps * (last.state - first.state), 0.0))
        # one step before, or too far from it: its pressure in proportion to the control
        return np.asarray(np.maximum(last.state, 0.0) * (control.value / last.control))

    def extrapolated_closure(
        self,
        control: Control,
        *,
        least: float = 1e-100,  # scaled: above the gap of the nodes where a surface is flat
    ) -> float | None:
        """Return the closure imposed, or extrapolated as a power of the force."""
        if control.closure is not None:
            return control.closure
        if not self.past_steps:
            if self._guess is None:
                return None
            return max(float(self.problem.gap[self._guess > 0].max()), least)
        first, last = self.past_steps[0], self.past_steps[-1]
        power = 1.0
        if first.control != last.control:
            power = np.log(last.closure / first.closure) / np.log(last.control / first.control)
        return float(last.closure * (control.value / last.control) ** min(max(power, 0.0), 1.0))

    # few nodes

    def solve_on_nodes(
        self,
        control: Control,
        *,
        tolerance: float = 1e-2,  # 1e-3 and .1 took the same time at light loads
    ) -> Solution | None:
        """Solve by sums over pairs; None where there are too many candidates.

        At the residual `tolerance` the closure is accurate enough to verify the candidates.
        """
        few = self.few_nodes
        if np.count_nonzero(self.problem.gap <= self.closure_bound(control)) > few:
            return None
        count = self.first_node_count(control)
        start = self.extrapolated_pressure(control)
        while 0 < count <= few:
            nodes = np.flatnonzero(self.problem.gap.ravel() <= self.sorted_gap()[count - 1])
            if nodes.size > few or not self.can_carry(nodes.size, control):
                break  # many nodes at exactly this gap, or too few to carry the force below p_max
            solution = self.pair_solution(nodes, control, start, tolerance)
            start = self.on_all_nodes(solution.pressure, nodes)
            needed = self.count_below(solution.closure * (1 + tolerance))
            if control.closure is not None or needed <= nodes.size:
                solution = self.pair_solution(nodes, control, start, self.tolerance)
                solution = replace(solution, solver="node_pairs")
                return self.with_displacement(solution, self.on_all_nodes(solution.pressure, nodes))
            count = min(needed, 4 * nodes.size)  # without the limit 1.5 % more transforms
        return None

    @property
    def few_nodes(self) -> int:
        """Return the number of candidates up to which sums over pairs are faster than transforms."""
        along_an_edge = np.sqrt(self.problem.gap.size)
        # 1 and 10 for each node along an edge took the same time on 128 x 128 nodes at light loads;
        # on 512 x 512 nodes three loads took 1.1 times as long with at most 300 or 4000 of them as with 1000
        return min(1000, int(4.5 * along_an_edge))

    def closure_bound(self, control: Control) -> float:
        """Return the closure imposed, or that of a flat disc around the whole extent, a lower bound."""
        if control.force is None:
            return float(control.value)
        body = self.problem.body
        diameter = np.hypot(body.shape[0] * body.spacing[0], body.shape[1] * body.spacing[1])
        return control.value * body.cell_area / float(diameter)

    def can_carry(self, nodes: int, control: Control) -> bool:
        """Return whether so many nodes carry twice the force below the largest pressure."""
        # with 1.01 in place of 2 the same bits in 819 steps, with 10 .5 % more transforms
        return control.force is None or nodes * self.problem.p_max > 2 * control.force

    def first_node_count(
        self,
        control: Control,
        *,
        unknown: int = 256,  # 64 and 512 took the same time at light loads
    ) -> int:
        """Return the number of candidates to begin with; `unknown` of them without a closure to expect."""
        if control.closure is not None:
            return self.count_below(control.closure)
        closure = self.extrapolated_closure(control)
        if closure is None:
            return min(unknown, self.few_nodes // 2, self.problem.gap.size)
        expected = self.count_below(closure * CLOSURE_MARGIN)
        if expected > self.few_nodes and self.past_steps:
            # without this limit 2 % more transforms
            expected = min(expected, 4 * self.count_below(self.past_steps[-1].closure))
        return max(1, expected)

    def sorted_gap(self) -> Array:
        """Return the gaps at first touch, ascending."""
        if self._sorted_gap is None:
            self._sorted_gap = np.sort(self.problem.gap.ravel())
        return self._sorted_gap

    def count_below(self, closure: float) -> int:
        """Return the number of nodes whose gap at first touch is below a closure."""
        return int(np.searchsorted(self.sorted_gap(), closure))

    def pair_solution(
        self, nodes: Array, control: Control, start: Array | None, tolerance: float
    ) -> Solution:
        """Solve on `nodes` (flat indices) alone; arrays are (1, nodes)."""
        if self._pair_tables is None:
            body = self.problem.body
            self._pair_tables = kept_pair_tables(body) if body.is_small else pair_tables(body)
        influence, stiffness = self._pair_tables
        nx = self.problem.body.shape[1]
        iy, ix = nodes // nx, nodes % nx
        gap = self.problem.gap.reshape(1, -1)[:, nodes]
        system = ContactSystem(
            gap,
            self.problem.p_max,
            PairSum(influence, iy, ix),
            NodePreconditioner(stiffness, iy, ix),
            self.problem.local_compliance,
            np.float64,
        )
        first = np.ones(gap.shape) if start is None else start.reshape(1, -1)[:, nodes]
        first = first if first.any() else np.ones(gap.shape)
        solution = ConstrainedCG(system, control, first).solve(tolerance)
        self.add_work(solution)
        return solution

    def on_all_nodes(self, pressure: Array, nodes: Array) -> Array:
        """Return the pressure of some nodes on the whole extent, zero elsewhere."""
        plane = np.zeros(self.problem.body.shape)
        plane.ravel()[nodes] = pressure.ravel()
        return plane

    def with_displacement(self, solution: Solution, pressure: Array) -> Solution:
        """Return a solution with its pressure, and the displacement under it, on the whole extent.

        Nodes that were left out stay open: no influence coefficient is negative, so that the displacement
        under pressure elsewhere only adds to their gap.
        """
        if self._operator is None:
            tables, body = self._pair_tables, self.problem.body
            self._operator = HalfSpaceOperator(tables[0]) if tables and not body.is_small else body.operator()
        self.transforms += 1
        return replace(solution, pressure=pressure, displacement=self._operator.apply(pressure))

    # a window of the plane

    def solve_on_window(self, control: Control) -> Solution:
        """Solve on the window that holds every candidate."""
        start, closure = self.extrapolated_pressure(control), self.extrapolated_closure(control)
        if start is None:
            start, expected = cold_start(self.problem, control)
            closure = expected if closure is None else closure
        window = self.bounding_window(CLOSURE_MARGIN * float(closure or 0.0))
        if not self.can_carry(self.problem.gap[window].size, control):
            window = WHOLE_PLANE
        while True:
            solution = self.solve_in_window(control, window, start)
            if window == WHOLE_PLANE:
                return solution
            outside = np.ones(self.problem.body.shape, dtype=bool)
            outside[window] = False
            pressure = np.zeros(self.problem.body.shape)
            pressure[window] = solution.pressure
            if control.closure is not None or not (self.problem.gap[outside] < solution.closure).any():
                return self.with_displacement(solution, pressure)
            start, window = pressure, self.bounding_window(solution.closure)

    def bounding_window(
        self,
        closure: float,
        *,
        largest: float = 0.75,  # of the extent; .5 and .95 took the same time at light loads
    ) -> Window:
        """Return the box of the nodes whose gap is below `closure`, or the whole plane if not much larger."""
        near = self.problem.gap < closure
        box = []
        for axis, n in enumerate(near.shape):
            rows = np.flatnonzero(near.any(axis=1 - axis))
            first, last = (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, n)
            step = max(1, n // 16)  # coarse: steps of a path share a window; 4 and 64 took as many transforms
            box.append(slice(first // step * step, min(n, -(-last // step) * step)))
        size = (box[0].stop - box[0].start) * (box[1].stop - box[1].start)
        if size > largest * near.size:
            return WHOLE_PLANE
        return box[0], box[1]

    def solve_in_window(
        self,
        control: Control,
        window: Window,
        start: Array | None,
        *,
        single: float = 3e-5,  # residual at which double precision takes over; 1e-6, 3e-4: as many transforms
    ) -> Solution:
        """Solve on a window of the plane, first in single and then in double precision."""
        if start is None:
            start = cold_start(self.problem, control)[0]
        part = self.part_inside(window)
        start = start if window == WHOLE_PLANE else start[window]
        if first_precision(part, control) is SINGLE and self.tolerance < single:
            run = ConstrainedCG(self.system(part, SINGLE), control, start)
            del start  # each array that is kept longer than needed adds to the peak of the memory
            rough = run.solve(single, certify=False)
            self.add_work(rough)
            start = rough.pressure
            del run, rough
        run = ConstrainedCG(self.system(part, np.float64), control, start)
        del start
        solution = run.solve(self.tolerance)
        self.add_work(solution)
        return replace(solution, solver="whole_plane" if window == WHOLE_PLANE else "window")

    def part_inside(self, window: Window) -> Problem:
        """Return the part of the problem inside a window."""
        if self._window is None or self._window[0] != window:
            gap = self.problem.gap[window]
            body = replace(self.problem.body, shape=(gap.shape[0], gap.shape[1]))
            self._window = (window, Problem(body, gap, self.problem.p_max))
            kept = {dtype: system for dtype, system in self._systems.items() if system.h.shape == gap.shape}
            self._systems = {dtype: replace(system, h=gap) for dtype, system in kept.items()}
        return self._window[1]

    def system(self, part: Problem, dtype: Any) -> ContactSystem:
        """Return the system of a window in one precision."""
        if dtype in self._systems:
            return self._systems[dtype]
        operator = None
        if dtype is SINGLE and not part.body.periodic:  # the coefficients are computed once for both
            double = self.system(part, np.float64).operator
            if isinstance(double, HalfSpaceOperator):
                operator = double.rounded(dtype, double.memory)
        system = ContactSystem.on_plane(part, dtype, self.problem.local_compliance, operator)
        if not part.body.periodic:
            self._systems[dtype] = system
        return system


def cold_start(problem: Problem, control: Control) -> tuple[Array, float]:
    """Return a pressure to start from without a step before, and roughly the closure to expect.

    Under an imposed closure the overlap. Under a force the root of the overlap with a plane that cuts off the
    area of a rough contact: the root is the profile of a contact of Hertz. From uniform pressure a solution
    takes a quarter to a half more transforms. A start on coarser grids (nested iteration) saved a tenth of
    the transforms at 256 x 256 nodes and up to a third at 1024 x 1024, but no time (ratios of .92 to 1.14,
    1.00 at 2048 x 2048).
    """
    gap, size = problem.gap, problem.gap.size
    if control.closure is not None:
        return np.maximum(control.closure - gap, 0.0), control.closure
    square = sum(
        float(np.mean(np.square(np.diff(gap, axis=axis) / spacing)))
        for axis, spacing in enumerate(problem.body.spacing)
    )
    # theories: area fraction 1.6 to 2.5 times pressure / (E* rms slope); 1 and 9 took 3 % more transforms
    share = 3.0 * control.value / size / np.sqrt(square) if square > 0 else 1.0
    count = max(1, int(min(share, 1.0) * (size - 1)))
    plane = float(np.partition(gap, count, axis=None)[count])
    pressure = np.sqrt(np.maximum(plane - gap, 0.0))
    return pressure if pressure.any() else np.ones(gap.shape), plane


def pair_tables(body: Body) -> tuple[Array, Array]:
    """Return the coefficients of sums over pairs: of the displacement, and of its inverse."""
    return body.influence_table(), stiffness_table(body)


kept_pair_tables = lru_cache(maxsize=KEPT)(pair_tables)


def first_precision(
    problem: Problem,
    control: Control,
    *,
    largest: float = 1e20,  # scaled pressure and closure: squares stay within the range of single precision
) -> Any:
    """Return the type of a first solution: single precision where it saves time and its range is enough."""
    if problem.gap.size < SINGLE_FROM:
        return np.float64
    load = control.value if control.force is None else control.value / problem.gap.size
    load_fits = 1 / largest < load < largest
    bound_fits = problem.p_max == np.inf or 1 / largest < problem.p_max < largest
    return SINGLE if load_fits and bound_fits else np.float64
