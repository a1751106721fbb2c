"""The fast solver: projected conjugate gradients on the free set, with a gate for new nodes.

The pressure p >= 0 (and p <= cap) makes

    1/2 p K p + p gap                  least among the pressures of a given sum (force control), or
    1/2 p K p + p (gap - closure)      least among all (closure control).

One iteration: weigh (closure and objective), inspect (error inside the free set and outside), select the
free set, precondition its gap, turn the direction, step and cut. What costs time, and what was tried:

- Three pairs of transforms at most: K direction, preconditioner, and K p only where the step was cut;
  otherwise the settlement follows the step, and two pairs do.
- The preconditioner (`_precondition`) makes the inner problem converge by a factor of about five an
  iteration whatever the grid; |q| alone needs three to five times as many iterations, and more as n grows.
- With an inner solver that good, letting nodes in and out in the same iteration swings without end at
  n >= 1024. New nodes are therefore let in only when the error outside exceeds GATE times the error inside
  (proportioning, Dostal and Schoeberl 2005), or when they are few; then the set settles in a few changes.
  GATE from .1 to .8 and FEW from .0003 to .01 give the same count of pairs within a tenth.
- Conjugacy is kept while the set changes by less than SLIGHT; at n = 2048 that saves a sixth of the pairs.
- Leaving a little tension uncut, to spare K p, saves a tenth of the pairs at best and swings at worst: no.
- Taking the last measured length for a step that will be cut, to spare K direction, makes an iteration cost
  two pairs, and needs so many more that cold starts gain nothing and paths take four times as many: no.
- A start on coarser grids (`_nested`) saves up to half of the iterations from n = 1024 on, and it does not
  matter how well the coarse grids are solved; adding the fine detail of the gap to it does not help.
- Should the objective rise all the same, the step is halved until it does not; should there be no progress,
  the iteration goes on without the preconditioner, which makes it that of Polonsky and Keer (1999).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.threads import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._capped import lowest, shifted
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._scaling import Control, Solution, serial_sum

Array = np.ndarray[Any, np.dtype[Any]]

GATE = 0.4  # error outside over error inside from which nodes enter
FEW = 0.003  # share of the set that may always enter
SLIGHT = 0.001  # share of the set that may change without losing the conjugacy
GREATEST_ITERATIONS = 2000
PATIENCE = 40  # iterations without progress
FALL = 1e-3  # of the objective, over the sums it is made of: less is no progress
HALVINGS = 20
CAPPINGS = 50
STRIP = 32  # rows at a time, which stay in the cache


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
    plane: tuple[int, int]
    mask: Array
    sums: Array
    counts: Array
    transforms: int

    def apply(self, x: Array) -> tuple[Array, Array]:
        """Pressure for the gap x on the set in mask, and what each bin adds to it on the set."""
        ...

    def mean_settlement(self) -> float:
        """Sum of the settlement under unit pressure on the set; infinite where the mean needs no help."""
        ...


class Descent:
    """The iteration on one set of nodes in one precision, ready to be run.

    `gap` (ny, nx) is all or a part of the surface, `local` the scale of the error for unit force.
    """

    def __init__(
        self, gap: Array, cap: float, operator: Operator, precondition: Conditioner, local: float, kind: Any
    ) -> None:
        self.gap = np.ascontiguousarray(gap, dtype=kind)
        self.cap, self.kind, self.local = kind(cap), kind, local
        self.operator, self.precondition = operator, precondition

    def solve(self, start: Array, control: Control, tolerance: float, *, certify: bool = True) -> Solution:
        """Iterate from `start` until the residual is at most `tolerance`.

        With `certify` the residual is that of a settlement computed anew from the pressure.
        """
        run = Run(self, start, control)
        del start
        return run.solve(tolerance, certify)


class Run:
    """One run: the arrays of the iteration and its steps.

    p pressure, u settlement, t direction. `spare` holds, in turn, the plane of the preconditioner (a free
    body has a wider one), the settlement under t, and the pressure before a step that was cut: with the gap
    and the modes inside a transform these are all the arrays there are.
    """

    def __init__(self, setting: Descent, start: Array, control: Control) -> None:
        self.gap, self.cap, self.kind, self.local = setting.gap, setting.cap, setting.kind, setting.local
        self.operator, self.pre, self.control = setting.operator, setting.precondition, control
        self.forced = control.total is not None
        self.blocks, self.size = self.pre.bins[0], self.gap.size
        self.sums = np.zeros((self.blocks, 8))
        self.precise = float(np.finfo(self.kind).eps)
        self.begun = self.operator.transforms + self.pre.transforms
        shape = self.gap.shape
        self.p, self.t, self.spare = (np.zeros(shape, dtype=self.kind) for _ in range(3))
        self.wide = None if self.pre.plane == shape else np.zeros(self.pre.plane, dtype=self.kind)
        self.u = self.p
        self.last, self.halved, self.clipped, self.product, self.step = np.inf, 0, False, 0.0, 0.0
        self.plain = False  # without the preconditioner, where it should fail
        np.clip(start, 0, self.cap, out=self.p, casting="same_kind")

    def run(self, function: Any, *arguments: Any) -> Array:
        """Run a pass over all blocks and add up its sums, block after block."""
        in_bands(function, self.blocks, self.size, self.pre.rows, *arguments, self.sums)
        return np.asarray(self.sums.sum(axis=0))

    def over_rows(self, function: Any, *arguments: Any) -> None:
        """Run a pass that sums nothing over all rows."""
        in_bands(function, self.gap.shape[0], self.size, *arguments)

    def solve(self, tolerance: float, certify: bool) -> Solution:
        """Iterate."""
        self.begin()
        best, least, stale, iteration, reason = np.inf, np.inf, 0, 0, "iteration_limit"
        while iteration <= GREATEST_ITERATIONS:
            balance = self.weigh()
            # nodes may change places for ever at one level of the objective: where nothing comes of it, less
            slack = balance.noise if stale < PATIENCE // 4 else -balance.noise
            if self.clipped and balance.objective > self.last + slack and self.halved < HALVINGS:
                self.halve()
                continue
            self.last, self.halved, self.clipped = balance.objective, 0, False
            inner, outer, residual = self.inspect(balance)
            if residual <= tolerance:
                if self.fresh or not certify:
                    reason = "converged"
                    break
                self.refresh()
                continue
            fallen = balance.objective < least - FALL * balance.noise / (8 * self.precise)
            stale = 0 if residual < 0.9 * best or fallen else stale + 1
            best = residual if residual < 0.9 * best else best
            least = balance.objective if fallen else least
            rounded = residual <= balance.floor
            iteration += 1
            if stale <= (PATIENCE // 8 if rounded else PATIENCE) and self.turn(balance, inner, outer):
                self.advance()
            elif rounded or self.plain:
                reason = "rounding" if rounded else "stagnated"
                break
            else:
                self.plain, self.product, stale = True, 0.0, 0
        if not self.fresh and certify:
            self.refresh()
            balance = self.weigh()
            residual = self.inspect(balance)[2]
        spent = self.operator.transforms + self.pre.transforms - self.begun
        return Solution(
            self.p,
            self.u,
            balance.closure,
            balance.force,
            iteration,
            spent,
            residual,
            reason,
            balance.work,
        )

    def begin(self) -> None:
        """Give the first pressure the force that is wanted, or the best multiple under the closure."""
        if self.forced:
            self.restore_force()
            self.refresh()
            return
        self.refresh()
        force, work, height = self.run(_kernels.weigh, self.gap, self.u, self.p, self.cap)[:3]
        factor = (self.control.value * force - height) / work if work > 0 else 0.0
        if factor > 0 and float(self.p.max()) * factor < self.cap:
            self.p *= self.kind(factor)
            self.u *= self.kind(factor)

    def refresh(self) -> None:
        """Settlement of the pressure, anew."""
        self.u = self.p  # lets go of the old one first
        self.u = self.operator.apply(self.p)
        self.fresh = True

    def restore_force(self) -> None:
        """Scale the pressures below the cap until their sum is what is wanted."""
        wanted = self.control.value
        for _ in range(CAPPINGS):
            force = serial_sum(self.p)
            if abs(force - wanted) <= self.precise * wanted:
                return
            below = self.p < self.cap
            bearing = serial_sum(np.where(below, self.p, 0)) if self.cap < np.inf else force
            if bearing <= 0 or force - bearing >= wanted:
                break
            factor = self.kind((wanted - (force - bearing)) / bearing)
            np.multiply(self.p, factor, out=self.p, where=below)
            np.minimum(self.p, self.cap, out=self.p)
            if self.cap == np.inf:
                return
        self.p[...] = self.lowest_nodes()

    def lowest_nodes(self) -> Array:
        """Even pressure of the wanted force on the lowest nodes."""
        level = self.gap if self.u is self.p else self.u + self.gap
        return lowest(level, self.control.value, float(self.cap))

    def weigh(self) -> Balance:
        """Closure, objective and the scale of the error."""
        force, work, height, below, level = self.run(_kernels.weigh, self.gap, self.u, self.p, self.cap)[:5]
        objective = 0.5 * work + height
        if self.forced:
            closure = level / below if below > 0 else self.saturated_closure()
        else:
            closure = self.control.value
            objective -= closure * force
        scale = max(work / force if force > 0 else 0.0, force * self.local)
        noise = 8 * self.precise * (abs(work) + abs(height) + abs(closure) * force)
        floor = 64 * self.precise * abs(closure) / scale if scale > 0 else 0.0
        return Balance(force, work, height, closure, scale, objective, noise, floor)

    def saturated_closure(self) -> float:
        """Least closure at which every loaded node is at the cap; between the two where nodes must swap."""
        loaded, level = self.p > 0, self.u + self.gap
        highest = float(level.max(where=loaded, initial=-np.inf))
        lowest = float(level.min(where=~loaded, initial=np.inf))
        if not loaded.any():
            return 0.0
        return highest if highest <= lowest else 0.5 * (highest + lowest)

    def inspect(self, balance: Balance) -> tuple[Array, Array, float]:
        """Count, sum and square sum of the gap inside the free set and outside, and the residual."""
        sums = self.run(_kernels.inspect, self.gap, self.u, self.p, self.cap, self.kind(balance.closure))
        overlap = float(self.sums[:, 1].max())
        if balance.force <= 0:
            return sums[2:5], sums[5:8], float(overlap > 0)
        return sums[2:5], sums[5:8], (float(sums[0]) / balance.force + overlap) / balance.scale

    def turn(self, balance: Balance, inner: Array, outer: Array) -> bool:
        """Choose the free set, the direction and the length of the step; False where there is none."""
        spread = inner[2] - (inner[1] ** 2 / inner[0] if self.forced and inner[0] else 0.0)
        admit = bool(outer[2] > GATE**2 * max(spread, 0.0) or outer[0] < FEW * inner[0])
        count, gap = (inner + outer)[:2] if admit else inner[:2]
        if count == 0:
            return False
        closure = self.kind(balance.closure)
        pressed, mean, beta = self.conditioned(closure, admit, count, gap)
        taken = (self.kind(mean), self.kind(beta))
        state = (self.gap, self.u, closure, self.t)
        relieved, along = self.run(_kernels.turn, self.pre.mask, pressed, *taken, *state)[:2]
        del pressed
        out = self.release()
        self.spare = self.operator.apply(self.t, out)
        curvature = self.run(_kernels.bend, self.t, self.spare)[0]
        self.step = along / curvature if curvature > 0 and along > 0 else np.inf
        if not self.forced and along > 0 and relieved > 0:
            # full contact of a periodic body costs nothing to relieve: no further than to no force at all
            self.step = min(self.step, 1.01 * balance.force / relieved)
        return self.step < np.inf

    def release(self) -> Array | None:
        """Give the spare array to a transform that writes in place; let go of it otherwise."""
        out, self.spare = (self.spare if fft.writes_in_place() else None), self.t
        return out

    def conditioned(self, closure: Any, admit: bool, count: float, gap: float) -> tuple[Array, float, float]:
        """Return the preconditioned gap of the free set, what is to be taken off it, and beta.

        Taken off is its mean under force control, and less than nothing where the mean must be driven; beta
        is how much of the last direction is kept: none where the set has changed.
        """
        pre, shift = self.pre, self.kind(gap / count if self.forced else 0.0)
        plane = self.spare if self.wide is None else self.wide
        if self.wide is not None:  # the margin of a free body
            plane[self.gap.shape[0] :] = 0
            plane[:, self.gap.shape[1] :] = 0
        state = (self.gap, self.u, self.p, self.cap, closure, admit, shift)
        changes = self.run(_kernels.select, pre.columns, *state, pre.mask, plane, pre.sums, pre.counts)[0]
        plane, extra = (plane, np.zeros_like(pre.sums)) if self.plain else pre.apply(plane)
        if self.wide is None:
            self.spare = plane
        else:
            self.wide = plane
        bodies = (self.gap, self.u, self.t, closure, plane)
        sums = self.run(_kernels.correct, pre.columns, pre.mask, extra, *bodies)
        mean = sums[0] / count if self.forced else -self.uniform(gap)
        before, self.product = self.product, float(sums[1] - mean * gap)
        beta = self.product / before if changes <= SLIGHT * count and before > 0 else 0.0
        # the part of the last direction that is kept must not change the force either
        return plane, mean + (beta * sums[2] / count if self.forced else 0.0), beta

    def uniform(self, gap: float) -> float:
        """Uniform pressure on the free set that would close the summed gap (periodic bodies, else zero).

        Their compliance knows nothing of the mean, whose stiffness grows without bound towards full contact.
        """
        settled = self.pre.mean_settlement()
        return gap / settled if settled > 0 else 0.0

    def advance(self) -> None:
        """Take the step: as it is, and the settlement follows; or cut to the bounds."""
        step = self.kind(self.step)
        clipped, force = self.run(_kernels.survey, self.p, self.t, step, self.cap)[:2]
        self.clipped = clipped > 0
        if self.clipped:
            self.cut(force)
        else:
            self.over_rows(move, self.p, self.t, step)
            self.over_rows(move, self.u, self.spare, step)
            self.fresh = False

    def cut(self, force: float) -> None:
        """Take the step, cut to the bounds, which leaves `force`; the pressure before it stays in `spare`."""
        wanted = self.control.value
        if self.forced and self.cap < np.inf:
            self.share(wanted)
        elif self.forced and not force > 0:
            self.spare[...] = self.lowest_nodes()
        else:
            missed = self.forced and abs(force - wanted) > self.precise * wanted
            factor = self.kind(wanted / force if missed else 1.0)
            self.over_rows(cut, self.p, self.t, self.kind(self.step), factor, self.cap, self.spare)
        self.p, self.spare = self.spare, self.p
        self.refresh()

    def share(self, wanted: float) -> None:
        """Take the step cut to the bounds; under a cap what that takes off the force the free set shares."""
        free = self.pre.mask[: self.gap.shape[0], : self.gap.shape[1]]
        np.copyto(self.spare, self.p)
        values = self.p[free] - self.step * self.t[free].astype(np.float64)
        rest = serial_sum(np.where(free, 0, self.p))
        self.spare[free] = shifted(values, wanted - rest, float(self.cap))

    def halve(self) -> None:
        """Go back half of the last step, because it went too far."""
        self.halved += 1
        self.step /= 2
        self.product = 0.0
        self.p, self.spare = self.spare, self.p
        self.cut(self.run(_kernels.survey, self.p, self.t, self.kind(self.step), self.cap)[1])


def move(start: int, stop: int, x: Array, t: Array, step: Any) -> None:
    """Step along -t, over bands of rows that fit the caches."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop):
            x[part] -= step * t[part]


def cut(start: int, stop: int, p: Array, t: Array, step: Any, factor: Any, cap: Any, new: Array) -> None:
    """Step along -t, cut to 0, times `factor`, cut to the cap."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop):
            band = new[part]
            np.multiply(t[part], step, out=band)
            np.subtract(p[part], band, out=band)
            np.maximum(band, 0, out=band)
            if factor != 1:
                band *= factor
            if cap < np.inf:
                np.minimum(band, cap, out=band)


def strips(first: int, stop: int) -> Iterator[slice]:
    """Rows, a few at a time."""
    for row in range(first, stop, STRIP):
        yield slice(row, min(row + STRIP, stop))
