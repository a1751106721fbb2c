"""Constrained conjugate gradients for elastic contact, after Polonsky and Keer (1999, Wear 231:206).

The pressure with 0 <= p <= p_max minimises

    1/2 p K p + p h                  among the pressures of a given sum (force control), or
    1/2 p K p + p (h - closure)      among all (closure control).

Symbols are those of Polonsky and Keer where they have one:

    p      pressure                          h      gap of the undeformed surface at first touch
    u      displacement, u = K p             g      gap, g = u + h - closure
    t      search direction                  r      displacement under t, r = K t
    tau    step length                       z      preconditioned gap (z = g without preconditioner)
    G      sum z g over the free set         beta   share of the last direction that is kept
    I_c    free set: 0 < p < p_max           p_max  hardness, infinite for an elastic surface

One iteration takes these steps; the code cites them by number:

    (1)  closure = sum p (u + h) / sum p over p < p_max under force control; objective 1/2 p u + p h
    (2)  residual: (sum p max(g, 0) / sum p + largest overlap) / scale
    (3)  free set I_c: 0 < p < p_max, and where admitted the nodes outside that violate the conditions
    (4)  z = M (g - mean g) on I_c, less its mean under force control; z = g - mean g in the paper
    (5)  G = sum z g; beta = G / G_old while the set does not change (delta in the paper), else 0
    (6)  t = z + beta t on I_c, 0 elsewhere
    (7)  r = K t
    (8)  tau = sum t g / sum t r
    (9)  p = p - tau t, projected onto 0 <= p <= p_max, with the force restored by a factor
    (10) u = u - tau r where nothing was projected, else u = K p anew

Differences from the paper: the preconditioner M, the rule (3) for new nodes, closure control, the bound
p_max, step (10), which saves a transform, and a residual that bounds the error. What was tried:

- An iteration takes three pairs of transforms at most: K t, the preconditioner, and K p only where the step
  was projected. Otherwise the displacement follows the step, and two pairs do.
- The preconditioner (`_preconditioner`) makes the inner problem converge by a factor of about five an
  iteration whatever the grid. |q| alone needs three to five times as many iterations, and more as n grows.
- With an inner solver that good, letting nodes in and out in the same iteration cycles without end at
  n >= 1024. New nodes are therefore admitted only when the error outside exceeds ADMIT_RATIO times the error
  inside (proportioning, Dostal and Schoeberl 2005, Comput. Optim. Appl. 30:23), or when they are few; then
  the set settles in a few changes. ADMIT_RATIO from 0.1 to 0.8 and FEW from 0.0003 to 0.01 give the same
  number of transforms within a tenth.
- Conjugacy is kept while the set changes by less than SLIGHT_CHANGE; at n = 2048 that saves a sixth of the
  transforms.
- Leaving slightly negative pressures unprojected, to save K p, saves a tenth of the transforms at best and
  cycles at worst: rejected.
- Taking the last measured length for a step that will be projected, to save K t, makes an iteration cost two
  pairs, and needs so many more iterations that cold starts gain nothing and paths take four times as many:
  rejected.
- A start on coarser grids (`_multigrid_start`) saves up to half of the iterations from n = 1024 on. It does
  not matter how well the coarse grids are solved; adding the fine detail of the gap does not help.
- Where the objective rises, the step is halved until it does not. Where there is no progress, the iteration
  goes on without the preconditioner, which makes it that of Polonsky and Keer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.threads import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._capped_simplex import project_onto_capped_simplex, uniform_on_lowest
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._preconditioner import ExtensionPreconditioner, Preconditioner
from fractalcontact.contact._scaled_problem import Control, Problem, Solution, sum_by_rows

Array = np.ndarray[Any, np.dtype[Any]]

ADMIT_RATIO = 0.4  # error outside over error inside from which nodes are admitted
FEW = 0.003  # share of the free set that is always admitted
SLIGHT_CHANGE = 0.001  # share of the free set that may change without loss of the conjugacy
MAX_ITERATIONS = 2000
PATIENCE = 40  # iterations without progress
SMALLEST_FALL = 1e-3  # of the objective, over the sums it is made of: less is no progress
MAX_HALVINGS = 20
MAX_FORCE_CORRECTIONS = 50
STRIP = 32  # rows at a time, which stay in the cache
RELEASED: Array = np.empty((0, 0))  # stands in for an array whose memory is free for the next one


@dataclass(frozen=True)
class ContactSystem:
    """A contact problem on one set of nodes in one precision: what `ConstrainedCG` solves.

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
    def on_plane(cls, problem: Problem, dtype: Any, local_compliance: float | None = None) -> ContactSystem:
        """Return the system of all nodes of a problem."""
        body = problem.body
        operator = body.operator(dtype)
        # a periodic body shares its wavenumbers, and with them the array of the modes
        preconditioner = ExtensionPreconditioner(body, dtype, getattr(operator, "multiplier", None))
        scale = problem.local_compliance if local_compliance is None else local_compliance
        return cls(problem.gap, problem.p_max, operator, preconditioner, scale, dtype)


@dataclass
class Objective:
    """The objective at the current pressure, with the sums and the closure that come with it."""

    value: float
    rounding: float  # of the value
    force: float  # sum p
    work: float  # sum p u
    closure: float
    scale: float  # of the error, a length
    residual_floor: float  # residual that rounding allows


@dataclass
class SetError:
    """The gap summed over a set of nodes: their number, sum g, sum g^2."""

    count: float
    g: float
    g2: float


class Progress:
    """Decides when the iteration has stalled."""

    def __init__(self) -> None:
        self.best_residual, self.least_objective = np.inf, np.inf
        self.stalled = 0  # iterations without progress

    def update(self, residual: float, objective: float, least_fall: float) -> None:
        """Record an iteration: progress is a residual a tenth lower, or an objective that falls."""
        lower = residual < 0.9 * self.best_residual
        fallen = objective < self.least_objective - least_fall
        self.stalled = 0 if lower or fallen else self.stalled + 1
        self.best_residual = residual if lower else self.best_residual
        self.least_objective = objective if fallen else self.least_objective


class ConstrainedCG:
    """One run of the iteration.

    The arrays are h, p, u, t, the modes inside a transform, and `work_array`, which holds in turn z (a free
    body has a wider plane for it, `wide`), r = K t, and the pressure before a step that was projected. These
    are all the arrays there are, so that a solution takes less than eight arrays beyond the heights.
    """

    def __init__(self, system: ContactSystem, control: Control, start: Array) -> None:
        self.h, self.p_max, self.dtype = system.h, system.p_max, system.dtype
        self.local_compliance, self.control = system.local_compliance, control
        self.operator, self.preconditioner = system.operator, system.preconditioner
        self.force_controlled = control.force is not None
        self.epsilon = float(np.finfo(self.dtype).eps)
        self.transforms_before = self.operator.transforms + self.preconditioner.transforms
        self.blocks = self.preconditioner.bins[0]
        self.block_sums = np.zeros((self.blocks, 8))

        shape = self.h.shape
        self.p = np.zeros(shape, dtype=self.dtype)  # pressure
        self.u = RELEASED  # displacement, see `update_displacement`
        self.t = np.zeros(shape, dtype=self.dtype)  # search direction
        self.work_array = np.zeros(shape, dtype=self.dtype)  # z, r, or the pressure before a projected step
        same_plane = self.preconditioner.plane == shape
        self.wide = None if same_plane else np.zeros(self.preconditioner.plane, dtype=self.dtype)
        self.tau, self.G = 0.0, 0.0
        self.u_is_exact = False  # u = K p to rounding, not updated by steps
        self.projected = False  # the last step left the bounds and was projected
        self.halvings = 0  # of the last step
        self.last_objective = np.inf
        self.preconditioned = True
        np.clip(start, 0, self.p_max, out=self.p, casting="same_kind")

    def solve(self, tolerance: float, *, certify: bool = True) -> Solution:
        """Iterate until the residual is at most `tolerance`; with `certify`, for an exact displacement."""
        self.initialise()
        progress, iteration, reason = Progress(), 0, "iteration_limit"
        while iteration <= MAX_ITERATIONS:
            objective = self.objective()  # (1)
            if self.overshot(objective, progress):
                self.backtrack()
                continue
            self.last_objective, self.halvings, self.projected = objective.value, 0, False
            inside, outside, residual = self.kkt_residual(objective)  # (2)
            if residual <= tolerance:
                if self.u_is_exact or not certify:
                    reason = "converged"
                    break
                self.update_displacement()
                continue
            least_fall = SMALLEST_FALL * objective.rounding / (8 * self.epsilon)
            progress.update(residual, objective.value, least_fall)
            at_rounding = residual <= objective.residual_floor
            iteration += 1
            patience = PATIENCE // 8 if at_rounding else PATIENCE
            if progress.stalled <= patience and self.find_step(objective, inside, outside):  # (3) to (8)
                self.take_step()  # (9), (10)
            elif at_rounding or not self.preconditioned:
                reason = "rounding" if at_rounding else "stagnated"
                break
            else:
                self.preconditioned, self.G, progress.stalled = False, 0.0, 0
        if certify and not self.u_is_exact:
            self.update_displacement()
            objective = self.objective()
            residual = self.kkt_residual(objective)[2]
        transforms = self.operator.transforms + self.preconditioner.transforms - self.transforms_before
        return Solution(
            self.p,
            self.u,
            objective.closure,
            objective.force,
            iteration,
            transforms,
            residual,
            reason,
            objective.work,
        )

    # start

    def initialise(self) -> None:
        """Give the first pressure the imposed force, or the best multiple under the imposed closure."""
        if self.force_controlled:
            self.enforce_force()
            self.update_displacement()
            return
        self.update_displacement()
        force, p_u, p_h = self.pass_sums(_kernels.objective_sums, self.h, self.u, self.p, self.p_max)[:3]
        factor = (self.control.value * force - p_h) / p_u if p_u > 0 else 0.0
        if factor > 0 and float(self.p.max()) * factor < self.p_max:
            self.p *= self.dtype(factor)
            self.u *= self.dtype(factor)

    def enforce_force(self) -> None:
        """Scale the pressures below p_max until their sum is the imposed force."""
        imposed = self.control.value
        for _ in range(MAX_FORCE_CORRECTIONS):
            force = sum_by_rows(self.p)
            if abs(force - imposed) <= self.epsilon * imposed:
                return
            below = self.p < self.p_max
            scalable = sum_by_rows(np.where(below, self.p, 0)) if self.p_max < np.inf else force
            if scalable <= 0 or force - scalable >= imposed:
                break
            factor = self.dtype((imposed - (force - scalable)) / scalable)
            np.multiply(self.p, factor, out=self.p, where=below)
            np.minimum(self.p, self.p_max, out=self.p)
            if self.p_max == np.inf:
                return
        self.p[...] = uniform_on_lowest(self.h, imposed, float(self.p_max))

    def update_displacement(self) -> None:
        """Compute u = K p anew (10)."""
        self.u = RELEASED  # frees the old array before the transform takes a new one
        self.u = self.operator.apply(self.p)
        self.u_is_exact = True

    # objective and error

    def objective(self) -> Objective:
        """Return closure and objective (1), and the scale of the error."""
        sums = self.pass_sums(_kernels.objective_sums, self.h, self.u, self.p, self.p_max)
        force, p_u, p_h, force_below, level = sums[:5]
        value = 0.5 * p_u + p_h
        if self.force_controlled:
            closure = level / force_below if force_below > 0 else self.saturated_closure()
        else:
            closure = self.control.value
            value -= closure * force
        scale = max(p_u / force if force > 0 else 0.0, force * self.local_compliance)
        rounding = 8 * self.epsilon * (abs(p_u) + abs(p_h) + abs(closure) * force)
        floor = 64 * self.epsilon * abs(closure) / scale if scale > 0 else 0.0
        return Objective(value, rounding, force, p_u, closure, scale, floor)

    def saturated_closure(self) -> float:
        """Return the least closure at which every loaded node is at p_max.

        Where an unloaded node is below a loaded one, which must change places: between the two.
        """
        loaded, level = self.p > 0, self.u + self.h
        highest_loaded = float(level.max(where=loaded, initial=-np.inf))
        lowest_open = float(level.min(where=~loaded, initial=np.inf))
        if not loaded.any():
            return 0.0
        return highest_loaded if highest_loaded <= lowest_open else 0.5 * (highest_loaded + lowest_open)

    def kkt_residual(self, objective: Objective) -> tuple[SetError, SetError, float]:
        """Return the error inside the free set and outside of it, and the residual (2)."""
        closure = self.dtype(objective.closure)
        sums = self.pass_sums(_kernels.residual_sums, self.h, self.u, self.p, self.p_max, closure)
        overlap = float(self.block_sums[:, 1].max())
        inside, outside = SetError(*sums[2:5]), SetError(*sums[5:8])
        if objective.force <= 0:
            return inside, outside, float(overlap > 0)
        return inside, outside, (float(sums[0]) / objective.force + overlap) / objective.scale

    # search direction and step length

    def find_step(self, objective: Objective, inside: SetError, outside: SetError) -> bool:
        """Find direction (3 to 6) and step length (7, 8); False where there is none."""
        mean_part = inside.g**2 / inside.count if self.force_controlled and inside.count else 0.0
        spread = max(inside.g2 - mean_part, 0.0)
        admit = bool(outside.g2 > ADMIT_RATIO**2 * spread or outside.count < FEW * inside.count)
        count, g_sum = (inside.count, inside.g)
        if admit:
            count, g_sum = inside.count + outside.count, inside.g + outside.g
        if count == 0:
            return False
        t_sum, t_g = self.search_direction(self.dtype(objective.closure), admit, count, g_sum)
        self.tau = self.step_length(t_g)
        if not self.force_controlled and t_g > 0 and t_sum > 0:
            # full contact of a periodic body costs nothing to relieve: no further than to no force at all
            self.tau = min(self.tau, 1.01 * objective.force / t_sum)
        return self.tau < np.inf

    def search_direction(self, closure: Any, admit: bool, count: float, g_sum: float) -> tuple[float, float]:
        """Set t = z + beta t on the free set (6), with the mean of z taken off; return sum t and sum t g."""
        z, mean, beta = self.preconditioned_residual(closure, admit, count, g_sum)
        mask, factors = self.preconditioner.mask, (self.dtype(mean), self.dtype(beta))
        sums = self.pass_sums(_kernels.search_direction, mask, z, *factors, self.h, self.u, closure, self.t)
        return sums[0], sums[1]

    def preconditioned_residual(
        self, closure: Any, admit: bool, count: float, g_sum: float
    ) -> tuple[Array, float, float]:
        """Return z (3, 4), what is to be taken off it, and beta (5).

        Taken off is its mean under force control, and a negative number where the mean must be driven; beta
        is zero where the set has changed.
        """
        pre, shift = self.preconditioner, self.dtype(g_sum / count if self.force_controlled else 0.0)
        plane = self.work_array if self.wide is None else self.wide
        if self.wide is not None:  # the margin of a free body
            plane[self.h.shape[0] :] = 0
            plane[:, self.h.shape[1] :] = 0
        state = (self.h, self.u, self.p, self.p_max, closure, admit, shift)
        bins = (pre.mask, plane, pre.sums, pre.counts)
        changes = self.pass_sums(_kernels.select_free_set, pre.columns, *state, *bins)[0]  # (3)
        plane, extra = pre.apply(plane) if self.preconditioned else (plane, np.zeros_like(pre.sums))
        if self.wide is None:
            self.work_array = plane
        else:
            self.wide = plane
        arrays = (self.h, self.u, self.t, closure, plane)
        z_sum, z_g, t_sum = self.pass_sums(_kernels.add_bins, pre.columns, pre.mask, extra, *arrays)[:3]
        mean = z_sum / count if self.force_controlled else -self.uniform_pressure(g_sum)
        G_old, self.G = self.G, float(z_g - mean * g_sum)  # (5), z with its mean taken off
        beta = self.G / G_old if changes <= SLIGHT_CHANGE * count and G_old > 0 else 0.0
        # the part of the last direction that is kept must not change the force either
        return plane, mean + (beta * t_sum / count if self.force_controlled else 0.0), beta

    def uniform_pressure(self, g_sum: float) -> float:
        """Return the uniform pressure on the free set that closes the summed gap (periodic bodies, else 0).

        The elastic operator of a periodic body leaves out the mean, whose stiffness grows without bound
        towards full contact.
        """
        displacement = self.preconditioner.mean_displacement()
        return g_sum / displacement if displacement > 0 else 0.0

    def step_length(self, t_g: float) -> float:
        """Compute r = K t (7) and return tau = sum t g / sum t r (8); infinite where t does not descend."""
        out = self.work_array if fft.writes_in_place() else None
        self.work_array = RELEASED
        self.work_array = self.operator.apply(self.t, out)  # r (7)
        t_r = self.pass_sums(_kernels.curvature, self.t, self.work_array)[0]
        return float(t_g / t_r) if t_r > 0 and t_g > 0 else np.inf

    # step

    def take_step(self) -> None:
        """Take the step (9, 10): as it is, with the displacement updated, or projected onto the bounds."""
        tau = self.dtype(self.tau)
        clipped, force = self.pass_sums(_kernels.projected_step_sums, self.p, self.t, tau, self.p_max)[:2]
        self.projected = clipped > 0
        if self.projected:
            self.project_onto_bounds(force)
            return
        rows, size = self.h.shape[0], self.h.size
        in_bands(subtract_step, rows, size, self.p, self.t, tau)  # p = p - tau t (9)
        in_bands(subtract_step, rows, size, self.u, self.work_array, tau)  # u = u - tau r (10)
        self.u_is_exact = False

    def project_onto_bounds(self, force: float) -> None:
        """Take the projected step, whose sum is `force`, and restore the imposed force (9).

        The pressure before the step is kept in `work_array`.
        """
        imposed = self.control.value
        if self.force_controlled and self.p_max < np.inf:
            self.project_onto_capped_simplex(imposed)
        elif self.force_controlled and not force > 0:
            self.work_array[...] = uniform_on_lowest(self.u + self.h, imposed, float(self.p_max))
        else:
            missed = self.force_controlled and abs(force - imposed) > self.epsilon * imposed
            factor = self.dtype(imposed / force if missed else 1.0)
            step = (self.p, self.t, self.dtype(self.tau), factor, self.p_max, self.work_array)
            in_bands(subtract_and_clip, self.h.shape[0], self.h.size, *step)
        self.p, self.work_array = self.work_array, self.p
        self.update_displacement()

    def project_onto_capped_simplex(self, imposed: float) -> None:
        """Take the projected step under a bound p_max; the free set shares the force that this takes off."""
        free = self.preconditioner.mask[: self.h.shape[0], : self.h.shape[1]]
        np.copyto(self.work_array, self.p)
        values = self.p[free] - self.tau * self.t[free].astype(np.float64)
        rest = sum_by_rows(np.where(free, 0, self.p))
        self.work_array[free] = project_onto_capped_simplex(values, imposed - rest, float(self.p_max))

    def overshot(self, objective: Objective, progress: Progress) -> bool:
        """Return whether the last projected step has raised the objective and can be halved."""
        if not self.projected or self.halvings >= MAX_HALVINGS:
            return False
        # nodes may change places without end at one level of the objective: then it must fall
        slack = objective.rounding if progress.stalled < PATIENCE // 4 else -objective.rounding
        return objective.value > self.last_objective + slack

    def backtrack(self) -> None:
        """Go back half of the last projected step."""
        self.halvings += 1
        self.tau /= 2
        self.G = 0.0
        self.p, self.work_array = self.work_array, self.p
        tau = self.dtype(self.tau)
        sums = self.pass_sums(_kernels.projected_step_sums, self.p, self.t, tau, self.p_max)
        self.project_onto_bounds(sums[1])

    # passes

    def pass_sums(self, kernel: Any, *arguments: Any) -> Array:
        """Run a kernel over all blocks and add up its sums, block after block."""
        rows = self.preconditioner.rows
        in_bands(kernel, self.blocks, self.h.size, rows, *arguments, self.block_sums)
        return np.asarray(self.block_sums.sum(axis=0))


def subtract_step(start: int, stop: int, x: Array, t: Array, tau: Any) -> None:
    """Compute x -= tau t, over strips of rows that fit the caches."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop):
            x[part] -= tau * t[part]


def subtract_and_clip(
    start: int, stop: int, p: Array, t: Array, tau: Any, factor: Any, p_max: Any, out: Array
) -> None:
    """Compute out = min(factor max(p - tau t, 0), p_max), over strips of rows."""
    with np.errstate(all="ignore"):  # as the compiled loops
        for part in strips(start, stop):
            band = out[part]
            np.multiply(t[part], tau, out=band)
            np.subtract(p[part], band, out=band)
            np.maximum(band, 0, out=band)
            if factor != 1:
                band *= factor
            if p_max < np.inf:
                np.minimum(band, p_max, out=band)


def strips(first: int, stop: int) -> Iterator[slice]:
    """Yield slices of a few rows."""
    for row in range(first, stop, STRIP):
        yield slice(row, min(row + STRIP, stop))
