"""The fast solver: projected conjugate gradients on the free set, with a gate for new nodes.

The pressure p >= 0 (and p <= cap) makes

    1/2 p K p + p gap                  least among the pressures of a given sum (force control), or
    1/2 p K p + p (gap - closure)      least among all (closure control).

One iteration: weigh (closure and objective), inspect (error inside the free set and outside), select the
free set, precondition its gap, turn the direction, step and clip. What costs time, and what was found:

- Three pairs of transforms at most: K direction, preconditioner, and K p only where the step was clipped;
  otherwise the settlement follows the step, and two pairs do.
- The preconditioner (`_precondition`) makes the inner problem converge by a factor of about five an
  iteration whatever the grid; |q| alone needs three to five times as many iterations, and more as n grows.
- With an inner solver that good, letting nodes in and out in the same iteration swings without end at
  n >= 1024. New nodes are therefore let in only when the error outside exceeds GATE times the error inside
  (proportioning, Dostal and Schoeberl 2005); then the set settles in a few changes. Conjugacy is kept while
  the set stays as it is.
- Should the objective rise all the same, the step is halved until it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fractalcontact.base.jit import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._problem import Control, Solution

Array = np.ndarray[Any, np.dtype[Any]]

GATE = 0.3
FEW = 0.003
GREATEST_ITERATIONS = 2000
PATIENCE = 40  # iterations without progress
HALVINGS = 20
CAPPINGS = 50


@dataclass
class Balance:
    """Sums over the current pressure."""

    force: float  # sum p
    work: float  # sum p u
    height: float  # sum p gap
    closure: float
    scale: float  # of the error, a length
    objective: float
    noise: float  # rounding of the objective
    floor: float  # residual that rounding allows


class Conditioner(Protocol):
    """A preconditioner, with the buffers it reads its set and its gap from."""

    rows: int
    columns: int
    bins: tuple[int, int]
    mask: Array
    x: Array
    sums: Array
    counts: Array
    transforms: int

    def apply(self) -> tuple[Array, Array]:
        """Pressure for the gap in x on the set in mask, and what each bin adds to it on the set."""
        ...

    def mean_settlement(self) -> float:
        """Sum of the settlement under unit pressure on the set; infinite where the mean needs no help."""
        ...


class Descent:
    """Buffers and steps of the iteration, in one precision.

    `gap` (ny, nx) is all or a part of the surface, `local` the scale of the error for unit force.
    """

    def __init__(
        self, gap: Array, cap: float, operator: Operator, precondition: Conditioner, local: float, kind: Any
    ) -> None:
        self.kind = kind
        self.gap = np.ascontiguousarray(gap, dtype=kind)
        self.cap = kind(cap)
        self.operator, self.precondition, self.local = operator, precondition, local
        self.rows, self.columns = precondition.rows, precondition.columns
        self.blocks, self.size = precondition.bins[0], gap.size
        self.p, self.old, self.t, self.r, self.u = (np.zeros(gap.shape, dtype=kind) for _ in range(5))
        self.sums = np.zeros((self.blocks, 8))
        self.precise = float(np.finfo(kind).eps)

    def run(self, function: Any, *arguments: Any) -> Array:
        """Run a pass over all blocks and add up its sums, block after block."""
        in_bands(function, self.blocks, self.size, self.rows, *arguments, self.sums)
        return np.asarray(self.sums.sum(axis=0))

    def solve(self, start: Array, control: Control, tolerance: float, *, certify: bool = True) -> Solution:
        """Iterate from `start` until the residual is at most `tolerance`.

        With `certify` the residual is that of a settlement computed anew from the pressure.
        """
        self.control = control
        self.begin(start)
        best, stale, reason = np.inf, 0, "iteration limit"
        iteration = 0
        for iteration in range(GREATEST_ITERATIONS + 1):
            balance = self.weigh()
            if self.clipped and balance.objective > self.last + balance.noise and self.halved < HALVINGS:
                self.halve(control)
                continue
            self.last, self.halved, self.clipped = balance.objective, 0, False
            inner, outer, residual = self.inspect(balance)
            if residual <= tolerance:
                if self.fresh or not certify:
                    reason = "converged"
                    break
                self.refresh()
                continue
            best, stale = (residual, 0) if residual < 0.9 * best else (best, stale + 1)
            rounded = residual <= balance.floor
            if stale > (PATIENCE // 8 if rounded else PATIENCE) or not self.turn(balance, inner, outer):
                reason = "rounding" if rounded else "stagnated"
                break
            self.advance()
        if not self.fresh and certify:
            self.refresh()
            balance = self.weigh()
            residual = self.inspect(balance)[2]
        return Solution(
            self.p.astype(np.float64),
            self.u.astype(np.float64),
            balance.closure,
            balance.force,
            iteration,
            self.operator.transforms + self.precondition.transforms - self.begun,
            residual,
            reason,
        )

    def begin(self, start: Array) -> None:
        """Take a pressure to start from, with the force that is wanted."""
        self.begun = self.operator.transforms + self.precondition.transforms
        np.clip(start, 0, self.cap, out=self.p, casting="same_kind")
        self.last, self.halved, self.clipped, self.curvature, self.step = np.inf, 0, False, 0.0, 0.0
        if self.control.total is not None:
            sums = self.run(_kernels.rescale, self.p, self.kind(1), self.cap)
            self.restore_force(sums[0], sums[1])
        self.refresh()
        if self.control.closure is not None:
            self.scale_start(self.control.closure)

    def scale_start(self, closure: float) -> None:
        """Scale the first pressure to the best multiple of itself under this closure."""
        force, work, height = self.run(_kernels.weigh, self.gap, self.u, self.p, self.cap)[:3]
        factor = (closure * force - height) / work if work > 0 else 0.0
        if factor > 0 and float(self.p.max()) * factor < self.cap:
            self.p *= self.kind(factor)
            self.u = self.u * self.kind(factor)

    def refresh(self) -> None:
        """Settlement of the pressure, anew."""
        self.u = self.operator.apply(self.p)
        self.fresh = True

    def restore_force(self, force: float, capped: float) -> None:
        """Scale the pressures below the cap until their sum is what is wanted."""
        wanted = float(self.control.total or 0.0)
        for _ in range(CAPPINGS):
            if abs(force - wanted) <= self.precise * wanted:
                return
            if not capped < min(wanted, force):
                break
            factor = self.kind((wanted - capped) / (force - capped))
            force, capped = self.run(_kernels.rescale, self.p, factor, self.cap)[:2]
            if self.cap == np.inf:
                return
        self.p[...] = lowest(self.u + self.gap, wanted, float(self.cap))

    def weigh(self) -> Balance:
        """Closure, objective and the scale of the error."""
        force, work, height, below, level = self.run(_kernels.weigh, self.gap, self.u, self.p, self.cap)[:5]
        if self.control.closure is not None:
            closure = self.control.closure
            objective = 0.5 * work + height - closure * force
        else:
            closure = level / below if below > 0 else self.saturated_closure()
            objective = 0.5 * work + height
        scale = max(work / force if force > 0 else 0.0, force * self.local)
        noise = 8 * self.precise * (abs(work) + abs(height) + abs(closure) * force)
        floor = 64 * self.precise * abs(closure) / scale if scale > 0 else 0.0
        return Balance(force, work, height, closure, scale, objective, noise, floor)

    def saturated_closure(self) -> float:
        """Least closure at which every loaded node is at the cap."""
        loaded = self.p > 0
        return float((self.u[loaded] + self.gap[loaded]).max()) if loaded.any() else 0.0

    def inspect(self, balance: Balance) -> tuple[Array, Array, float]:
        """Count, sum and square sum of the gap inside the free set and outside, and the residual."""
        sums = self.run(_kernels.inspect, self.gap, self.u, self.p, self.cap, self.kind(balance.closure))
        overlap = float(self.sums[:, 1].max())
        if balance.force <= 0:
            return sums[2:5], sums[5:8], float(overlap > 0)
        return sums[2:5], sums[5:8], (float(sums[0]) / balance.force + overlap) / balance.scale

    def turn(self, balance: Balance, inner: Array, outer: Array) -> bool:
        """Choose the free set and the direction; False where there is none."""
        forced = self.control.total is not None
        spread = inner[2] - (inner[1] ** 2 / inner[0] if forced and inner[0] else 0.0)
        admit = bool(outer[2] > GATE**2 * max(spread, 0.0) or outer[0] < FEW * inner[0])
        count, gap = (inner + outer)[:2] if admit else inner[:2]
        if count == 0:
            return False
        shift = gap / count if forced else 0.0
        closure = self.kind(balance.closure)
        pre = self.precondition
        state = (self.gap, self.u, self.p, self.cap, closure, admit, self.kind(shift))
        changes = self.run(_kernels.select, self.columns, *state, pre.mask, pre.x, pre.sums, pre.counts)[0]
        pressed, extra = pre.apply()
        sums = self.run(
            _kernels.correct, self.columns, pre.mask, extra, self.gap, self.u, self.r, closure, pressed
        )
        # what is taken off the direction: its mean, or less than nothing where the mean must be driven
        mean = sums[0] / count if forced else -self.uniform(gap)
        beta = 0.0
        if changes == 0 and self.curvature > 0:
            beta = max(0.0, -(sums[2] - mean * sums[3]) / self.curvature)
        in_bands(
            _kernels.turn, self.blocks, self.size, self.rows, pre.mask, pressed, self.kind(mean), self.kind(beta), self.t
        )
        self.r = self.operator.apply(self.t)
        along, self.curvature = self.run(_kernels.slope, self.gap, self.u, self.t, self.r, closure)[:2]
        self.step = along / self.curvature if self.curvature > 0 and along > 0 else np.inf
        if not forced and along > 0:
            # full contact of a periodic body costs nothing to relieve: no further than to no force at all
            relieved = float(np.sum(np.sum(self.t, axis=1, dtype=np.float64)))
            self.step = min(self.step, 1.01 * balance.force / relieved if relieved > 0 else np.inf)
        return self.step < np.inf

    def uniform(self, gap: float) -> float:
        """Uniform pressure on the free set that would close the summed gap (periodic bodies, else zero).

        Their compliance knows nothing of the mean, whose stiffness grows without bound as the last gap closes.
        """
        settled = self.precondition.mean_settlement()
        return gap / settled if settled > 0 else 0.0

    def advance(self) -> None:
        """Take the step, cut to the bounds."""
        self.p, self.old = self.old, self.p
        step = self.kind(self.step)
        if self.control.total is not None and self.cap < np.inf:
            self.advance_capped(self.control.total)
            return
        clipped, force, capped = self.run(_kernels.advance, self.old, self.t, step, self.cap, self.p)[:3]
        self.clipped = clipped > 0
        if not self.clipped:
            in_bands(_kernels.follow, self.blocks, self.size, self.rows, self.u, self.r, step)
            self.fresh = False
            return
        if self.control.total is not None:
            self.restore_force(force, capped)
        self.refresh()

    def advance_capped(self, wanted: float) -> None:
        """Take the step under a cap, keeping the force: what is cut off is shared by the free set."""
        free = self.precondition.mask[: self.gap.shape[0], : self.gap.shape[1]]
        np.copyto(self.p, self.old)
        values = self.old[free] - self.step * self.t[free].astype(np.float64)
        rest = float(np.sum(np.sum(np.where(free, 0, self.old), axis=1, dtype=np.float64)))
        self.p[free] = shifted(values, wanted - rest, float(self.cap))
        self.clipped = True
        self.refresh()

    def halve(self, control: Control) -> None:
        """Go back half of the last step, because it went too far."""
        self.halved += 1
        self.step /= 2
        self.p, self.old = self.old, self.p
        self.curvature = 0.0
        self.advance()


def lowest(level: Array, wanted: float, cap: float) -> Array:
    """Even pressure on the lowest nodes, as many as can carry what is wanted with some to spare."""
    enough = min(level.size, int(np.ceil(1.1 * wanted / cap)))
    pressure = np.zeros(level.shape)
    pressure.ravel()[np.argpartition(level.ravel(), enough - 1)[:enough]] = wanted / enough
    return pressure


def shifted(values: Array, wanted: float, cap: float) -> Array:
    """Shift values by one amount so that, cut to 0 .. cap, they add up to what is wanted."""
    low, high, shift = float(values.min()) - cap, float(values.max()), 0.0
    for _ in range(200):
        moved = np.clip(values - shift, 0.0, cap)
        excess = float(np.sum(moved)) - wanted
        low, high = (shift, high) if excess > 0 else (low, shift)
        slack = int(np.count_nonzero((moved > 0) & (moved < cap)))
        better = shift + excess / slack if slack else np.inf
        better = better if low < better < high else 0.5 * (low + high)
        if better == shift or abs(excess) <= 1e-15 * wanted:
            break
        shift = better
    return moved
