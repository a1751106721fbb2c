"""A joint whose faces wear: pressed at a hardness, and moved in balance with its normal force."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.compass import Direction
from fractalcontact.base.numbers import ROUNDED, Array
from fractalcontact.joints._delta_surface import heights_under
from fractalcontact.joints._sheared_contact import Pressing, ShearedContact

WHERE = "fractalcontact.joints.direct_shear"

CRUSHED = "NaN from where the contacts would bear more than the hardness over the whole block"
LOCKED = (
    "NaN from where the block locks: slopes of 90 degrees less the friction angle stop it until they yield, "
    "under a load on which the normal force no longer depends"
)


class State(NamedTuple):
    """The joint under a load: height of the block and closure (m), energies (J), and what is worn off (m)."""

    height: float
    closure: float
    elastic_energy: float
    plastic_work: float
    wear: Array
    contact_fraction: float


class ShearStep(NamedTuple):
    """One step of shear and the state at its end.

    `load` P on the contacts (N) is constant over the step. `rise` d is that of the block over its slip, and
    `wear` w the work of wear with the change of the elastic energy, over load and slip.
    """

    load: float
    rise: float
    wear: float
    state: State

    def forces(self, friction: float) -> tuple[float, float]:
        """Return normal and tangential force (N): N = P (1 - mu d), T = P (d + w + mu)."""
        return self.load * (1.0 - friction * self.rise), self.load * (self.rise + self.wear + friction)


class WornJoint:
    """A crack with the wear of both its faces, which grows as it is pressed."""

    def __init__(self, pressing: Pressing, towards: Direction) -> None:
        crack, options = pressing.crack, pressing.options
        lower, upper = crack.faces()
        self.crack, self.towards, self.pressing = crack, towards, pressing
        # just below the hardness all over; 1 - 1e-6 and 1 - 1e-12 gave the same bits
        self.capacity = float(options.hardness or math.inf) * crack.nominal_area / ROUNDED
        self.lower_wear, self.upper_wear = np.zeros(lower.shape), np.zeros(upper.shape)
        self.residual, self.steepest, self.plastic_work = 0.0, 0.0, 0.0
        self.unconverged = 0
        self.rows: list[dict[str, float]] = []  # what is reported of every position
        self.shear_stiffness, self.reason = math.inf, ""  # elastic, Pa/m; why the test ended before the path

    def contact(self, position: float, *, elastic: bool = False) -> ShearedContact:
        """Return the faces as they are worn now, at a position (m); `elastic`: without a hardness."""
        layout, (lower, upper) = self.crack.layout, self.crack.faces()
        shift = layout.shift(position, self.towards.unit)
        heights = heights_under(lower - self.lower_wear, layout, shift) - (upper + self.upper_wear)
        pressing = self.pressing
        if elastic:
            pressing = replace(pressing, options=replace(pressing.options, hardness=None))
        return ShearedContact(pressing, heights, position, self.towards)

    def press(self, contact: ShearedContact, load: float) -> State:
        """Press a contact of this joint under a load, N."""
        force = replace(self.pressing.load, control="normal_force", values=(load,))
        columns = contact.press(force, ("residual_height",))
        heights = contact.heights
        self.residual = max(self.residual, float(columns["residual"][0]))
        self.steepest = max(self.steepest, float(columns["rms_slope"]))
        self.unconverged += int(not columns["converged"][0])
        closure, energy, share = (
            float(columns[name][0]) for name in ("interface_closure", "elastic_energy", "contact_fraction")
        )
        work = float(columns["plastic_work"][0]) if "plastic_work" in columns else 0.0
        wear = heights - columns["residual_height"][0]
        return State(float(heights.max()) - closure, closure, energy, work, wear, share)

    def wear(self, position: float, state: State) -> None:
        """Wear off what a press at a position wears off, half of it from each face."""
        layout = self.crack.layout
        shift = layout.shift(position, self.towards.unit)
        rows, columns = (
            (layout.start[axis] + int(shift[axis]) + np.arange(layout.cells[axis])) % layout.face_cells[axis]
            for axis in (0, 1)
        )
        self.lower_wear[np.ix_(rows, columns)] += 0.5 * state.wear
        self.upper_wear += 0.5 * state.wear
        self.plastic_work += state.plastic_work

    def faces(self) -> tuple[xr.DataArray, xr.DataArray]:
        """Return the whole lower and upper face as they are worn now."""
        whole = self.crack.lower if self.crack.upper is None else self.crack.upper
        heights = np.array(whole.values, dtype=np.float64)
        heights[self.crack.layout.slices] += self.upper_wear
        return self.crack.lower.copy(data=self.crack.faces()[0] - self.lower_wear), whole.copy(data=heights)

    def report(self, state: State, first: float) -> dict[str, float]:
        """Return what is reported of a state, with the height of the block at the start."""
        volume = float(self.lower_wear.sum() + self.upper_wear.sum()) * math.prod(self.crack.layout.spacing)
        return {
            "dilatancy": state.height - first,
            "wear_depth": volume / self.crack.nominal_area,
            "worn_fraction": float(np.mean(self.upper_wear > 0)),
            "contact_fraction": state.contact_fraction,
            "plastic_work": self.plastic_work,
        }


def shear_stiffness(joint: WornJoint, position: float, load: float, unloaded: float = 0.5) -> float:
    """Return the elastic shear stiffness (Pa/m) in full stick, from the normal stiffness of unloading.

    Contacts that stick have the ratio 2 (1 - nu)/(2 - nu) of tangential to normal stiffness (Mindlin 1949).
    It is that of unloading to a share of the load: a definition, for .25 and .8 changed it by 13 and 44 % on
    a rough crack.
    """
    contact = joint.contact(position)
    closed = [joint.press(contact, part * load).closure for part in (1.0, unloaded)]
    nu, unloading = joint.crack.contact_poisson, closed[0] - closed[1]
    if unloading <= 0:
        return math.inf
    stiffness = (1.0 - unloaded) * load / unloading / joint.crack.nominal_area
    return 2.0 * (1.0 - nu) / (2.0 - nu) * stiffness


def balanced_step(
    joint: WornJoint,
    here: float,
    there: float,
    start: float,
    friction: float,
    normal_force: Callable[[float], float],
    *,
    error: float = 1e-3,
    most: int = 40,
    bracket: float = 0.5,
    reach: float = 40.0,
) -> ShearStep | str:
    """Move the block by one step and wear the faces; the reason if no load on the contacts balances.

    The load P on the contacts is that at which N = P (1 - mu d) is the normal force. The rise d falls as P
    grows, so that there is one such load. Where contacts yield all at once d jumps; the step is then the mean
    of those on both sides that has the normal force.

    Parameters
    ----------
    here, there : float
        Positions, m.
    start : float
        Load of the step before, N.
    friction : float
        Coefficient mu.
    normal_force : callable
        The normal force (N) at a height of the block (m).
    error : float
        Relative, of the load and of the normal force; 1e-4 takes half more time and changes the stresses by
        5e-6.
    most : int
        Loads tried in the bracket, which is then below 1e-6, and 1 - mu d at the solver's error.
    bracket, reach : float
        Steps of the logarithm of the load, and how far it may fall below that of the start; .25 and 1 changed
        the stresses by 9e-6, 20 and 80 not at all.
    """

    def excess(step: ShearStep) -> float:
        return step.forces(friction)[0] / normal_force(step.state.height) - 1.0

    def moved(log_load: float) -> tuple[float, ShearStep]:
        step = _moved(joint, contacts, abs(there - here), math.exp(log_load))
        return excess(step), step

    contacts = joint.contact(here, elastic=True), joint.contact(there)
    limit = math.log(joint.capacity)
    low = high = min(math.log(start), limit)
    lowest = low - reach
    below = above = moved(low)
    while below[0] > 0 and low > lowest:
        high, above = low, below
        low -= bracket
        below = moved(low)
    while above[0] < 0 and high < limit:
        low, below = high, above
        high = min(high + bracket, limit)
        above = moved(high)
    if below[0] > 0 or above[0] < 0:
        return CRUSHED
    for turn in range(most):
        span = above[0] - below[0]
        share = above[0] / span if span > 0 else 0.0
        step: ShearStep = _mean(above[1], below[1], share)
        is_narrow = high - low <= error or min(above[0], -below[0]) <= error
        if is_narrow and abs(excess(step)) <= error:
            joint.wear(there, step.state)
            return step
        middle = high + (0.5 if turn % 2 else share) * (low - high)  # bisection and secant in turn
        value = moved(middle)
        if value[0] < 0:
            low, below = middle, value
        else:
            high, above = middle, value
    return LOCKED


def _mean(first: Any, second: Any, share: float) -> Any:
    """Return the mean of two steps or of two of their numbers, the second with this share."""
    if isinstance(first, (ShearStep, State)):
        return type(first)(*(_mean(one, other, share) for one, other in zip(first, second, strict=True)))
    return first + share * (second - first)


def _moved(
    joint: WornJoint, contacts: tuple[ShearedContact, ShearedContact], slip: float, load: float
) -> ShearStep:
    """Return the step between two positions under a load, which is taken up elastically before it."""
    before, after = (joint.press(contact, load) for contact in contacts)
    energy = after.elastic_energy + after.plastic_work - before.elastic_energy
    return ShearStep(load, (after.height - before.height) / slip, energy / (load * slip), after)
