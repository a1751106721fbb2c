"""Constrained conjugate gradients for elastic contact, after Polonsky and Keer (1999, Wear 231:206).

The pressure with 0 <= p <= p_max minimises

    1/2 p K p + p h                  among the pressures of a given sum (force control), or
    1/2 p K p + p (h - closure)      among all (closure control).

The law of contact, 0 <= p <= p_max, stands in the free set and the projection here, in the passes of
`_kernels` and in `_capped_simplex`; nodes that bear nothing are open in `_load_path.Step`. That no gap closes
away from the window (`_window_solver`) holds for pressures alone, not for adhesion.

Symbols are those of Polonsky and Keer where they have one:

    p      pressure                          h      gap of the undeformed surface at first touch
    u      displacement, u = K p             g      gap, g = u + h - closure
    t      search direction                  r      displacement under t, r = K t
    tau    step length                       z      preconditioned gap (z = g without preconditioner)
    G      sum z g over the free set         beta   share of the last direction that is kept
    I_c    free set: 0 < p < p_max           p_max  hardness, infinite for an elastic surface

One iteration takes these steps; the code cites them by number. What the paper does in the same place is on
the right, in words, where it differs:

    (1)  closure = sum p (u + h) / sum p over p < p_max under        mean of u + h over I_c
         force control; objective 1/2 p u + p h
    (2)  residual: (sum p max(g, 0) / sum p + largest overlap        change of p in the last iteration
         over p < p_max) / scale
    (3)  free set I_c: 0 < p < p_max, and where admitted the nodes   p > 0; overlapping nodes are given the
         outside that violate the conditions                         pressure -tau g at the end of the step
    (4)  under force control z = M (g - mean g) on I_c, less its     z = g - mean g
         mean; under closure control z = M g, on a periodic body
         with the uniform pressure that closes the mean gap
    (5)  G = sum z g; beta = G / G_old while the set hardly          beta = delta G / G_old, delta = 0 after
         changes, else 0                                             nodes overlapped, else 1
    (6)  t = z + beta t on I_c, 0 elsewhere
    (7)  r = K t                                                     less the mean of r over I_c
    (8)  tau = sum t g / sum t r
    (9)  p = p - tau t, projected onto 0 <= p <= p_max, with the     projected onto 0 <= p
         force restored by a factor, under a bound p_max by a shift
    (10) u = u - tau r where nothing was projected, else u = K p     u = K p anew
         anew

Differences from the paper:

- The preconditioner M, closure control, the bound p_max, the rule (3) for new nodes, step (10), which saves a
  transform, and the residual (2), which bounds the error.
- The closure (1) is the mean of u + h weighted by the pressure, where the paper subtracts the plain mean gap
  over I_c. At the solution both are the closure; before it, the weighted mean makes sum p g vanish over
  p < p_max. Under force control the plain mean of g is still subtracted in (4).
- No mean of r is subtracted for (8): under force control t adds up to zero, so that a constant in r does not
  change sum t r.

What was tried:

- An iteration takes two pairs of transforms where the displacement follows the step: the preconditioner and
  K t. Where the step is projected it takes two and a half: the sum t r needs one transform (Parseval), r is
  not needed, and K p is a pair.
- The preconditioner (`_preconditioner`) makes the inner problem converge by a factor of about five an
  iteration whatever the grid. |q| alone needs three to five times as many iterations, and more as n grows.
- With an inner solver that good, letting nodes in and out in the same iteration cycles without end at
  n >= 1024. New nodes are therefore admitted only when the error outside exceeds `admit_ratio` times that
  inside (proportioning, Dostal and Schoeberl 2005, Comput. Optim. Appl. 30:23), or when they are few; then
  the set settles in a few changes. `admit_ratio` from 0.1 to 0.8 and `few` from 0.0003 to 0.01 give the same
  number of transforms within a tenth.
- Conjugacy is kept while the set changes by less than `slight_change`; at n = 2048 that saves a sixth of the
  transforms. (Bugnicourt et al. 2018, Tribol. Lett. 66:29, never restart.)
- Leaving slightly negative pressures unprojected, to save K p, saves a tenth of the transforms at best and
  cycles at worst: rejected.
- Taking the last measured length for a step that will be projected, to save K t, makes an iteration cost two
  pairs, and needs so many more iterations that cold starts gain nothing and paths take four times as many:
  rejected.
- K t in single precision, as the preconditioner is, with u computed anew at the end, saves a tenth of the
  time at a tolerance of 1e-8. At 1e-10 it takes a tenth more transforms, and a body 4000 times longer than
  wide stops at a residual of 3e-4: rejected.
- A start on coarser grids (nested iteration) saves up to a third of the iterations from n = 1024 on, but no
  time: rejected.
- Where the objective rises, the step is halved until it does not.
- Going on without the preconditioner, as Polonsky and Keer, where there is no progress, solved none of 1829
  runs on random and hard problems. On 150 surfaces with spikes that yield it took a fifth more iterations
  than to stop, and to go on with gaps that count from the closure (`_window_solver`): rejected.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._capped_simplex import (
    project_onto_capped_simplex,
    scale_to_force,
    uniform_on_lowest,
)
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._preconditioner import (
    ExtensionPreconditioner,
    FreeSet,
    Preconditioner,
    precision_for,
)
from fractalcontact.contact._problem import Control, Problem, Solution, strips, sum_by_rows

# 206 solutions on rough surfaces took 20 at most at a tolerance of 1e-10, and 3828 runs of the tests,
# which have spikes that yield, 240 at most
MAX_ITERATIONS = 500
RELEASED: Array = np.empty((0, 0))  # stands in for an array whose memory is free for the next one


@dataclass(frozen=True)
class ContactSystem:
    """What `ConstrainedCG` takes, in one precision: gap, bound of the pressure, operator and preconditioner.

    `h` (ny, nx) is the gap of all or a part of the surface; `local_compliance` is that of `Problem`.
    """

    h: Array
    p_max: Any
    operator: Operator
    preconditioner: Preconditioner
    local_compliance: float
    dtype: Any

    def __post_init__(self) -> None:
        """Bring the gap and the bound into the precision of the system."""
        object.__setattr__(self, "h", np.ascontiguousarray(self.h, dtype=self.dtype))
        object.__setattr__(self, "p_max", self.dtype(self.p_max))

    @classmethod
    def on_plane(
        cls,
        problem: Problem,
        dtype: Any,
        local_compliance: float | None = None,
        operator: Operator | None = None,
    ) -> ContactSystem:
        """Return the system of all nodes of a problem; its operator may be given."""
        body = problem.body
        operator = operator or body.operator(dtype)
        preconditioner = ExtensionPreconditioner(body, operator.memory, precision_for(body, dtype))
        scale = problem.local_compliance if local_compliance is None else local_compliance
        return cls(problem.gap, problem.p_max, operator, preconditioner, scale, dtype)


@dataclass
class Evaluation:
    """The objective at the current pressure, with the sums and the closure that come with it."""

    objective: float
    objective_size: float  # sum of the magnitudes of its parts
    force: float  # sum p
    work: float  # sum p u, twice the elastic energy
    closure: float
    scale: float  # of the error, a length
    residual_floor: float  # residual that rounding allows


@dataclass
class GapSums:
    """The gap summed over a set of nodes: their number, sum g, sum g^2."""

    count: float
    g: float
    g2: float

    def __add__(self, other: GapSums) -> GapSums:
        """Return the sums over both sets."""
        return GapSums(self.count + other.count, self.g + other.g, self.g2 + other.g2)


class Progress:
    """Decides when the iteration has stalled."""

    def __init__(self) -> None:
        self.best_residual, self.least_objective = np.inf, np.inf
        self.stalled = 0  # iterations without progress

    def update(self, residual: float, objective: float, least_fall: float) -> None:
        """Record an iteration: progress is a residual a tenth lower, or an objective that falls."""
        # .99 gave the same bits in 819 steps on random and hard surfaces, .5 took 45 % more transforms
        lower = residual < 0.9 * self.best_residual
        fallen = objective < self.least_objective - least_fall
        self.stalled = 0 if lower or fallen else self.stalled + 1
        self.best_residual = residual if lower else self.best_residual
        self.least_objective = objective if fallen else self.least_objective


class ConstrainedCG:
    """One run of the iteration.

    The arrays are h, p, u, t, the modes inside a transform, and one of these three, each of which is let go
    before the next is made: z in (4) to (6), r in (7) to (10) of a step within the bounds, and `last_p`, the
    pressure before a projected step, until the objective has not risen. A solution then takes less than eight
    arrays beyond the heights.
    """

    def __init__(self, system: ContactSystem, control: Control, start: Array) -> None:
        self.h, self.p_max, self.dtype = system.h, system.p_max, system.dtype
        self.local_compliance, self.control = system.local_compliance, control
        self.operator, self.preconditioner = system.operator, system.preconditioner
        self.force_controlled = control.force is not None
        self.epsilon = float(np.finfo(self.dtype).eps)
        self.transforms_before = self.operator.transforms + self.preconditioner.transforms
        self.blocks = self.preconditioner.bin_shape[0]
        self.block_sums = np.zeros((self.blocks, 8))  # as many as `residual_sums` has, the most

        shape = self.h.shape
        self.p = np.zeros(shape, dtype=self.dtype)  # pressure
        self.u = RELEASED  # displacement, see `update_displacement`
        self.t = np.zeros(shape, dtype=self.dtype)  # search direction
        self.last_p: Array | None = None  # before the last step, where that left the bounds and was projected
        plane, dtype = self.preconditioner.plane_shape, self.preconditioner.dtype
        self.free_set = FreeSet.empty(plane, self.preconditioner.bin_shape, dtype)
        self.tau, self.G = 0.0, 0.0
        self.updates = 0  # steps that the displacement has followed since it was computed, u = K p
        self.halvings = 0  # of the last step
        self.last_objective = np.inf
        np.clip(start, 0, self.p_max, out=self.p, casting="same_kind")

    def solve(
        self,
        tolerance: float,
        *,
        certify: bool = True,
        patience: int = 200,  # with 40 two surfaces with spikes that yield stay open
        patience_at_rounding: int = 5,  # with 25 a fifth more transforms on 150 surfaces with spikes
        least_fall: float = 1e-3,  # of the objective, over its size; 1e-4 and 1e-2 changed nothing
    ) -> Solution:
        """Iterate until the residual is at most `tolerance`; with `certify`, for an exact displacement.

        Gives up after `patience` iterations without progress, and after `patience_at_rounding` once the
        residual is that of rounding.
        """
        self.initialise()
        progress, iteration, reason = Progress(), 0, "iteration_limit"
        while True:
            evaluation = self.evaluate()  # (1)
            if self.overshot(evaluation, progress):
                self.backtrack()
                continue
            self.last_objective, self.halvings, self.last_p = evaluation.objective, 0, None
            inside, outside, residual = self.kkt_residual(evaluation)  # (2)
            if residual <= tolerance:
                if not certify or self.displacement_is_exact(evaluation, tolerance):
                    reason = "converged"
                    break
                self.update_displacement()
                continue
            if iteration == MAX_ITERATIONS:  # before a step: closure and residual are those of the pressure
                break
            progress.update(residual, evaluation.objective, least_fall * evaluation.objective_size)
            at_rounding = residual <= evaluation.residual_floor
            iteration += 1
            limit = patience_at_rounding if at_rounding else patience
            if progress.stalled > limit or not self.find_step(evaluation, inside, outside):  # (3) to (8)
                reason = "rounding" if at_rounding else "stagnated"
                break
            self.take_step()  # (9), (10)
        if certify and not self.displacement_is_exact(evaluation, tolerance):
            self.update_displacement()
            evaluation = self.evaluate()
            residual = self.kkt_residual(evaluation)[2]
        return Solution(
            self.p,
            self.u,
            evaluation.closure,
            evaluation.force,
            iteration,
            self.transforms(),
            residual,
            reason,
            evaluation.work,
        )

    def transforms(self) -> int:
        """Return the pairs of transforms of this run so far, a single one as a pair."""
        return ceil(self.operator.transforms + self.preconditioner.transforms - self.transforms_before)

    # start

    def initialise(self) -> None:
        """Give the first pressure the imposed force, or the best multiple under the imposed closure."""
        if self.force_controlled:
            scale_to_force(self.p, self.h, self.p_max, self.control.value, self.epsilon)
            self.update_displacement()
            return
        self.update_displacement()
        force, p_u, p_h = self.pass_sums(_kernels.objective_sums, self.h, self.u, self.p, self.p_max)[:3]
        factor = (self.control.value * force - p_h) / p_u if p_u > 0 else 0.0
        if factor > 0 and float(self.p.max()) * factor < self.p_max:
            self.p *= self.dtype(factor)
            self.u *= self.dtype(factor)

    def update_displacement(self) -> None:
        """Compute u = K p anew (10)."""
        self.u = RELEASED  # frees the old array before the transform takes a new one
        self.u = self.operator.apply(self.p)
        self.updates = 0

    def displacement_is_exact(
        self,
        evaluation: Evaluation,
        tolerance: float,
        *,
        share: float = 0.01,  # .001 and .1 took as many transforms
    ) -> bool:
        """Return whether u = K p, but for what steps have added by rounding: a share of the tolerance."""
        if self.updates == 0:
            return True
        largest = max(float(self.u.max()), -float(self.u.min()))
        # 4 and 1000 took as many transforms within .4 %
        rounding = 64 * self.epsilon * self.updates * largest
        return rounding <= share * tolerance * evaluation.scale

    # objective and error

    def evaluate(self) -> Evaluation:
        """Return closure and objective (1), and the scale of the error."""
        sums = self.pass_sums(_kernels.objective_sums, self.h, self.u, self.p, self.p_max)
        force, p_u, p_h, force_below, p_level_below = sums[:5]  # below: over the nodes with p < p_max
        objective = 0.5 * p_u + p_h
        if self.force_controlled:
            closure = p_level_below / force_below if force_below > 0 else self.saturated_closure()
        else:
            closure = self.control.value
            objective -= closure * force
        displacement = p_u / force if force > 0 else 0.0  # mean over the contact
        scale = max(displacement, force * self.local_compliance)
        size = abs(p_u) + abs(p_h) + abs(closure) * force
        # g is a difference of u, h and the closure; the closure may be near 0, where h counts from it. With 4
        # in place of 64 1 % more transforms, with 1000 the same bits
        floor = 64 * self.epsilon * (abs(closure) + abs(displacement)) / scale if scale > 0 else 0.0
        return Evaluation(objective, size, force, p_u, closure, scale, floor)

    def saturated_closure(self) -> float:
        """Return the closure where every loaded node is at p_max: the greatest level u + h of those nodes.

        Where an open node has a smaller level, return the mean of both; the next step then moves pressure
        from the loaded node to the open one.
        """
        loaded, level = self.p > 0, self.u + self.h
        highest_loaded = float(level.max(where=loaded, initial=-np.inf))
        lowest_open = float(level.min(where=~loaded, initial=np.inf))
        if not loaded.any():
            return 0.0
        return highest_loaded if highest_loaded <= lowest_open else 0.5 * (highest_loaded + lowest_open)

    def kkt_residual(self, evaluation: Evaluation) -> tuple[GapSums, GapSums, float]:
        """Return the gaps that should vanish, inside the free set and outside of it, and the residual (2)."""
        state = (self.h, self.u, self.p, self.p_max, self.dtype(evaluation.closure))
        sums = self.pass_sums(_kernels.residual_sums, *state)
        overlap = float(self.block_sums[:, 1].max())
        inside, outside = GapSums(*sums[2:5]), GapSums(*sums[5:8])
        if evaluation.force <= 0:
            return inside, outside, float(overlap > 0)
        return inside, outside, (float(sums[0]) / evaluation.force + overlap) / evaluation.scale

    # search direction and step length

    def find_step(
        self,
        evaluation: Evaluation,
        inside: GapSums,
        outside: GapSums,
        *,
        admit_ratio: float = 0.4,
        few: float = 0.003,
    ) -> bool:
        """Find direction (3 to 6) and step length (7, 8); False where there is none.

        Nodes are admitted from `admit_ratio` on, of the error outside over that inside, or while they are
        fewer than the share `few` of the free set.
        """
        mean_part = inside.g**2 / inside.count if self.force_controlled and inside.count else 0.0
        spread = max(inside.g2 - mean_part, 0.0)
        admit = bool(outside.g2 > admit_ratio**2 * spread or outside.count < few * inside.count)
        free = inside + outside if admit else inside
        if free.count == 0:
            return False
        closure = self.dtype(evaluation.closure)
        z, *factors = self.preconditioned_residual(closure, admit, free)
        factors, state = [self.dtype(factor) for factor in factors], (self.h, self.u, closure)
        t_sum, t_g = self.pass_sums(
            _kernels.search_direction, self.free_set.mask, z, *factors, *state, self.t
        )[:2]  # (6)
        t_r = self.operator.work(self.t)  # by one transform; that for r is left to a step that needs it (7)
        tau = float(t_g / t_r) if t_r > 0 and t_g > 0 else None  # (8); none where t does not descend
        if not self.force_controlled and t_g > 0 and t_sum > 0:
            # At full contact K t = 0 for uniform t, so tau is unbounded: limit the step to the one that
            # removes the whole force (1 % more, so that it is clipped; .01 and 50 % took as many transforms).
            limit = 1.01 * evaluation.force / t_sum
            tau = limit if tau is None else min(tau, limit)
        if tau is None or not np.isfinite(tau):
            return False
        self.tau = tau
        return True

    def preconditioned_residual(
        self, closure: Any, admit: bool, free: GapSums, *, slight_change: float = 0.001
    ) -> tuple[Array, float, float, float]:
        """Return z in units of its own (3, 4), the unit, the constant to subtract from z, and beta (5).

        The unit keeps z within the range of single precision. The constant is the mean of z under force
        control; under closure control of a periodic body minus the uniform pressure that closes the mean gap.
        `slight_change` is the share of the free set that may change without loss of the conjugacy.
        """
        shift = self.dtype(free.g / free.count if self.force_controlled else 0.0)
        unit = self.dtype(np.sqrt(free.g2 / free.count)) or self.dtype(1)
        bin_columns, free_set = self.preconditioner.bin_columns, self.free_set
        plane = np.empty(self.preconditioner.plane_shape, self.preconditioner.dtype)
        plane[self.h.shape[0] :] = 0  # the margin of a free body
        plane[:, self.h.shape[1] :] = 0
        state = (self.h, self.u, self.p, self.p_max, closure, admit, shift, unit)
        written = (free_set.mask, plane, free_set.bin_sums, free_set.bin_counts)
        changes = self.pass_sums(_kernels.select_free_set, bin_columns, *state, *written)[0]  # (3)
        if changes > 0:
            free_set.weight = None
        z, extra = self.preconditioner.apply(plane, free_set)
        arrays = (self.h, self.u, self.t, closure, z)
        z_sum, z_g, t_sum = self.pass_sums(_kernels.add_bins, bin_columns, free_set.mask, extra, *arrays)[:3]
        mean = unit * z_sum / free.count if self.force_controlled else -self.uniform_pressure(free.g)
        G_old, self.G = self.G, float(unit * z_g - mean * free.g)  # (5), z with its mean taken off
        beta = self.G / G_old if changes <= slight_change * free.count and G_old > 0 else 0.0
        # the part of the last direction that is kept must not change the force either
        constant = mean + (beta * t_sum / free.count if self.force_controlled else 0.0)
        return z, float(unit), constant, beta

    def uniform_pressure(self, g_sum: float) -> float:
        """Return the uniform pressure on the free set that closes the summed gap (periodic bodies, else 0).

        The elastic operator of a periodic body leaves out the mean, whose stiffness grows without bound
        towards full contact.
        """
        displacement = self.preconditioner.summed_displacement(self.free_set)
        return g_sum / displacement if displacement is not None and displacement > 0 else 0.0

    # step

    def take_step(self) -> None:
        """Take the step (9, 10): as it is, with the displacement updated, or projected onto the bounds."""
        tau = self.dtype(self.tau)
        clipped, force = self.pass_sums(_kernels.projected_step_sums, self.p, self.t, tau, self.p_max)[:2]
        if clipped > 0:
            self.project_onto_bounds(force)
            return
        rows, size = self.h.shape[0], self.h.size
        r = self.operator.displacement()  # (7)
        in_bands(subtract_step, rows, size, self.p, self.t, tau)  # p = p - tau t (9)
        in_bands(subtract_step, rows, size, self.u, r, tau)  # u = u - tau r (10)
        self.updates += 1

    def project_onto_bounds(self, force: float) -> None:
        """Take the projected step, whose sum is `force`, and restore the imposed force (9)."""
        imposed, p = self.control.value, np.empty_like(self.p)
        if self.force_controlled and self.p_max < np.inf:  # the free set shares the force that this takes off
            is_free = self.free_set.mask[: self.h.shape[0], : self.h.shape[1]]
            values = self.p[is_free] - self.tau * self.t[is_free].astype(np.float64)
            rest = sum_by_rows(np.where(is_free, 0, self.p))
            p[...] = self.p
            p[is_free] = project_onto_capped_simplex(values, imposed - rest, float(self.p_max))
        elif self.force_controlled and not force > 0:
            p[...] = uniform_on_lowest(self.u + self.h, imposed, float(self.p_max))
        else:
            missed = self.force_controlled and abs(force - imposed) > self.epsilon * imposed
            factor = self.dtype(imposed / force if missed else 1.0)
            step = (self.p, self.t, self.dtype(self.tau), factor, self.p_max, p)
            in_bands(subtract_and_clip, self.h.shape[0], self.h.size, *step)
        self.last_p, self.p = self.p, p
        self.update_displacement()

    def overshot(
        self,
        evaluation: Evaluation,
        progress: Progress,
        *,
        max_halvings: int = 20,  # a factor 1e-6; none in 206 solutions with and without p_max
        stalled: int = 10,  # iterations without progress; with 50 150 surfaces with spikes converge as well
    ) -> bool:
        """Return whether the last projected step has raised the objective and can be halved."""
        if self.last_p is None or self.halvings >= max_halvings:
            return False
        # Near a stall, require a strict decrease; otherwise nodes may enter and leave in a cycle at constant
        # objective.
        rounding = 8 * self.epsilon * evaluation.objective_size  # 1 and 64 took as many transforms (.3 %)
        slack = rounding if progress.stalled < stalled else -rounding
        return evaluation.objective > self.last_objective + slack

    def backtrack(self) -> None:
        """Go back half of the last projected step."""
        assert self.last_p is not None  # only a projected step overshoots
        self.halvings += 1
        self.tau /= 2
        self.G = 0.0
        self.p = self.last_p
        tau = self.dtype(self.tau)
        sums = self.pass_sums(_kernels.projected_step_sums, self.p, self.t, tau, self.p_max)
        self.project_onto_bounds(sums[1])

    # passes

    def pass_sums(self, kernel: Any, *arguments: Any) -> Array:
        """Run a kernel over all blocks and add up its sums, block after block."""
        rows = self.preconditioner.bin_rows
        in_bands(kernel, self.blocks, self.h.size, rows, *arguments, self.block_sums)
        return np.asarray(self.block_sums.sum(axis=0))


def subtract_step(start: int, stop: int, x: Array, t: Array, tau: Any) -> None:
    """Compute x -= tau t, over strips of rows that fit the caches."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop, t.shape[1]):
            x[part] -= tau * t[part]


def subtract_and_clip(
    start: int, stop: int, p: Array, t: Array, tau: Any, factor: Any, p_max: Any, out: Array
) -> None:
    """Compute out = min(factor max(p - tau t, 0), p_max), over strips of rows."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop, t.shape[1]):
            band = out[part]
            np.multiply(t[part], tau, out=band)
            np.subtract(p[part], band, out=band)
            np.maximum(band, 0, out=band)
            if factor != 1:
                band *= factor
            if p_max < np.inf:
                np.minimum(band, p_max, out=band)
