"""Direct shear test of a joint whose asperities yield: wear is carried along the path of shear."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.compass import Direction, check_direction, read_direction
from fractalcontact.base.errors import ConvergenceWarning, warn
from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.numbers import ROUNDED, Array, float_array, turning_points
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.signals import track
from fractalcontact.base.study import joined_references
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._crack import FILL, Crack, check_crack
from fractalcontact.joints._criteria import POSITIVE
from fractalcontact.joints._delta_surface import heights_under
from fractalcontact.joints._friction import PEAK_SHARE, secant_slopes
from fractalcontact.joints._sheared_contact import PRESS_BYTES, JointProblem, ShearedContact, check_problem

WHERE = "fractalcontact.joints.direct_shear"
FIRST = "NaN before the first step"
CRUSHED = "NaN from where the contacts would bear more than the hardness over the whole block"
LOCKED = (
    "NaN from where the block locks: slopes of 90 degrees less the friction angle stop it until they yield, "
    "under a load on which the normal force no longer depends"
)
MAPS = ("residual_lower", "residual_upper")

PATTON = "Patton (1966), 1st ISRM Congress 1:509 (friction on inclined contacts)"


def _check(problems: Problems) -> tuple[JointProblem | None, list[Array]]:
    """Return how the joint is pressed, and the legs of its path."""
    given, legs = problems.given, []
    problems.boolean("progress")
    problems.number("normal_stiffness", **POSITIVE, optional=True)
    problems.number("shear_stiffness", **POSITIVE, optional=True)
    problems.number("distance", above=0, optional=True)
    problems.choices("keep", among=MAPS, optional=True)
    hardness_is_valid = problems.number("hardness", **POSITIVE)
    has_load = problems.numbers("nominal_pressure", **POSITIVE)
    if has_load and hardness_is_valid:
        greatest = float(float_array(given.nominal_pressure).max())
        bounded = greatest < float(given.hardness)
        has_load = problems.require(bounded, "nominal_pressure", "less than the hardness", greatest)
    check_crack(problems)
    hardness = given.hardness if hardness_is_valid else None  # what is wrong has been noted
    load = given.nominal_pressure if has_load else 0.0
    problem = check_problem(problems, hardness=hardness, nominal_pressure=load)
    path_is_valid = problems.numbers("path", at_least=-POSITIVE["at_most"], at_most=POSITIVE["at_most"])
    if check_direction(problems) and path_is_valid and isinstance(given.crack, Crack):
        legs = _read_path(problems, given.crack, given.path, read_direction(given.direction))
    return problem, legs


def _read_path(problems: Problems, crack: Crack, path: Any, towards: Direction) -> list[Array]:
    """Check a path; return the positions of every leg, cell by cell, with both its ends.

    A stop on the way ends none.
    """
    problems.finite("crack.lower", crack.faces()[0], remedy=FILL)
    step = _cell_step(crack, towards)
    if step is None:
        expected = "one along which the block comes back onto the grid, such as E or N"
        problems.add("direction", expected, towards.name)
        return []
    stops = np.concatenate([[0.0], float_array(path)])
    cells = stops / step
    on_grid = bool((np.abs(cells - np.rint(cells)) <= UNIFORM * np.maximum(np.abs(cells), 1.0)).all())
    expected = f"multiples of {step:g} m, the cells along {towards.name}: wear stays on the grid"
    given = stops[1:].tolist()  # the path begins at 0
    if problems.require(on_grid, "path", expected, given):
        moves = bool((np.diff(np.rint(cells)) != 0).all())
        problems.require(moves, "path", "positions other than the one before, the first not 0", given)
    y, x = towards.unit
    for reach, unit in ((stops.max(), (y, x)), (-stops.min(), (-y, -x))):
        travel = crack.layout.travel(unit)
        expected = f"at most {travel:g} m this way, where the block meets the edge of the face"
        problems.require(bool(reach <= travel + UNIFORM * step), "path", expected, float(reach))
    if problems.messages:
        return []
    nearest = np.rint(cells).astype(np.int64)
    ends = itertools.pairwise(nearest[turning_points(nearest)])
    return [step * np.arange(a, b + np.sign(b - a), np.sign(b - a)) for a, b in ends]


@public_result(
    title="direct shear test",
    achieved_error="that of one step of shear per cell",
    reasons={
        "friction_angle": FIRST,
        "dilatancy_angle": FIRST,
        "shear_stiffness": "NaN where the faces have no compliance of their own",
    },
    check=_check,
    memory=PRESS_BYTES + 48.0,  # and the wear of both faces for each of three normal stresses
)
@takes_checked
def direct_shear(
    checked: tuple[JointProblem, list[Array]],
    /,
    crack: Crack,
    path: float | Sequence[float] | Array,
    *,
    nominal_pressure: float | Sequence[float],
    hardness: float,
    direction: str | float = "E",
    normal_stiffness: float | None = None,
    shear_stiffness: float | None = None,
    distance: float | None = None,
    keep: str | Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str = "second_order",
    tolerance: float = 1e-5,  # 1e-4 changed the stresses of two joints by 7e-7, 1e-7 by 6e-8
    progress: bool = False,
) -> xr.Dataset:
    """Shear a joint whose asperities yield at a hardness, and carry the wear along the path.

    The block moves cell by cell. At every position the faces, as the steps before have left them, are pressed
    together; where the pressure reaches the hardness the overlap is worn off, half of it from each face.

    Parameters
    ----------
    crack : Crack
        Its faces without missing heights, and its basic_friction_angle.
    path : float or sequence of float
        Positions (m, whole cells) at which the block reverses, and at which it ends, after 0: 3e-3, or
        [3e-3, -3e-3, 0]. Those on the way change nothing.
    nominal_pressure : float or sequence of float
        Normal stresses at the start, Pa; each on a fresh joint.
    hardness : float
        Greatest pressure that a contact bears, Pa: between the compressive strength and an indentation
        hardness.
    direction : str or float
        Compass word, or degrees anticlockwise from E, along which whole cells lie.
    normal_stiffness : float, optional
        Stiffness of a spring on the block per area, Pa/m, whose compliance includes the bulk of both bodies,
        as in `dilatancy`. Default: constant normal stress.
    shear_stiffness : float, optional
        Elastic shear stiffness per area, Pa/m. Default: 2 (1 - nu)/(2 - nu) times the normal stiffness of
        unloading after the first step.
    distance : float, optional
        Slip (m) over which peak and residual are means, from one cell to the first leg. Default: 1 % of the
        side, at least two cells.
    keep : any of "residual_lower", "residual_upper"
        Maps to return: heights of the faces after the test, m.
    influence, disc_radius, tolerance
        As for `fractalcontact.contact.press`.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Dataset over (point, nominal_pressure)
        shear (position; where the block starts or reverses twice, before and after the stress changes),
        shear_displacement = position + shear_stress / shear_stiffness (m); shear_stress,
        normal_stress (Pa), friction_angle, dilatancy_angle (degree) of the step that ends there; dilatancy,
        wear_depth (worn volume over area) (m), worn_fraction, contact_fraction, plastic_work (J). Over
        nominal_pressure: peak_shear_strength, peak_friction_angle, residual_shear_strength (end of the first
        leg; all three NaN with the `reason` where the joint does not reach it), shear_stiffness;
        peak_distance.

    Raises
    ------
    InvalidInput
        The path leaves the face or the grid, a pressure is not below the hardness, or an argument is wrong.

    Notes
    -----
    With the load P on the contacts, the rise d of the block and the work w of wear (and elastic energy), both
    per slip and w per P, friction along the motion gives N = P (1 - mu d) and T = P (mu + d + w): Patton's
    tan(phi_b + i) without wear. P is solved for at every step. Worn material is taken out; see page
    `theory_joints`.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-5, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3, basic_friction_angle=30)
    >>> test = fc.joints.direct_shear(crack, 4e-4, nominal_pressure=[1e6, 2e7], hardness=2e8)
    >>> bool(test.peak_friction_angle[0] > test.peak_friction_angle[1] > 30)  # falls with the pressure
    True
    """
    (problem, legs), towards = checked, read_direction(direction)
    step = abs(float(legs[0][1]))  # the first leg begins at 0
    pressures, names = float_array(nominal_pressure), word_tuple(keep)
    area = crack.nominal_area
    spring = 0.0 if normal_stiffness is None else float(normal_stiffness) * area
    joints = [WornJoint(problem, towards) for _ in pressures]
    for joint, pressure in zip(joints, pressures, strict=True):
        _test(joint, legs, float(pressure) * area, spring, progress)
    # within one step the stress does not change
    length = max(PEAK_SHARE * math.sqrt(area), 2 * step) if distance is None else max(float(distance), step)
    result = _dataset(crack, joints, legs, pressures, shear_stiffness, min(length, float(np.ptp(legs[0]))))
    for index, name in enumerate(MAPS):
        if name in names:
            faces = np.stack([joint.faces()[index].values for joint in joints])
            coords = {dim: crack.lower.coords[dim].variable for dim in ("y", "x")}
            result[name] = ("nominal_pressure", "y", "x"), faces
            result = result.assign_coords(coords)
    fc.contact.solver.warn_steep(f"{WHERE}: the delta-surface", max(joint.steepest for joint in joints))
    if failed := sum(joint.unconverged for joint in joints):
        message = f"{WHERE}: the solver did not converge {failed} times; see the achieved residual"
        warn(message, ConvergenceWarning)
    residual = max(joint.residual for joint in joints)
    references = joined_references(PATTON, problem.references)
    return result.assign_attrs(references=references, achieved_residual=residual)


def _cell_step(crack: Crack, towards: Direction, most: int = 8) -> float | None:
    """Return the shortest shear (m), of `most` cells, that moves the block by whole cells; None without.

    Towards NE it takes 3 cells where spacings are as 2 to 3: `most` is the greatest number of such a ratio.
    """
    layout = crack.layout
    axis = int(np.argmax(np.abs(towards.unit)))
    for cells in range(1, most + 1):
        step = cells * layout.spacing[axis] / abs(towards.unit[axis])
        if all(part == math.floor(part) for part in layout.shift(step, towards.unit)):
            return step
    return None


def _test(joint: WornJoint, legs: Sequence[Array], force: float, spring: float, progress: bool) -> None:
    """Shear a joint along the legs, from a normal force (N) on and against a spring (N/m)."""
    friction = math.tan(math.radians(joint.crack.basic_friction_angle))
    state = joint.press(joint.contact(0.0), force)
    joint.wear(0.0, state)
    first, load = state.height, force
    joint.rows.append(joint.report(state, first) | _stresses(joint, force, 0.0, math.nan, 1))

    def normal_force(height: float) -> float:
        # a spring may unload the block entirely; 1e-8 and 1e-4 gave the same
        return max(force + spring * (height - first), 1e-6 * force)

    total = sum(leg.size - 1 for leg in legs)
    pairs = ((pair, i == 0) for leg in legs for i, pair in enumerate(itertools.pairwise(leg)))
    for (here, there), begins in track(pairs, progress, f"shear under {force:g} N", unit="cell", total=total):
        step = balanced_step(joint, here, there, load, friction, normal_force)
        if isinstance(step, str):
            joint.reason = step
            break
        rise = (step.state.height - state.height) / abs(there - here)
        stresses = _stresses(joint, *step.forces(friction), rise, 1 if there > here else -1)
        if begins:  # the stress changes before the block moves
            joint.rows.append(joint.rows[-1] | stresses)
        joint.rows.append(joint.report(step.state, first) | stresses)
        if not math.isfinite(joint.shear_stiffness):
            joint.shear_stiffness = shear_stiffness(joint, there, step.load)
        state, load = step.state, step.load


def _stresses(
    joint: WornJoint, normal: float, tangential: float, rise: float, sense: int
) -> dict[str, float]:
    """Return stresses and angles of a step of this sense; no angles where its rise is NaN, without a step."""
    area = joint.crack.nominal_area
    return {
        "shear_stress": sense * tangential / area,
        "normal_stress": normal / area,
        "friction_angle": math.degrees(math.atan2(tangential, normal)) + 0.0 * rise,
        "dilatancy_angle": math.degrees(math.atan(rise)),
    }


def _dataset(
    crack: Crack,
    joints: Sequence[WornJoint],
    legs: Sequence[Array],
    pressures: Array,
    shear_stiffness: float | None,
    length: float,
) -> xr.Dataset:
    """Return the rows of all tests over (nominal_pressure, point), with peaks and displacements."""
    dims, positions = ("nominal_pressure", "point"), np.concatenate([[0.0], *legs])
    columns = {name: np.full((pressures.size, positions.size), np.nan) for name in joints[0].rows[0]}
    for i, joint in enumerate(joints):
        for name, values in columns.items():
            values[i, : len(joint.rows)] = [row[name] for row in joint.rows]
    own = np.array([joint.shear_stiffness for joint in joints])
    stiffness = own if shear_stiffness is None else np.full(own.shape, float(shear_stiffness))
    finite = np.where(np.isfinite(stiffness), stiffness, np.nan)
    variables: dict[str, Any] = {name: (dims, values) for name, values in columns.items()}
    elastic = np.where(np.isfinite(stiffness)[:, None], columns["shear_stress"] / stiffness[:, None], 0.0)
    variables["shear_displacement"] = dims, positions + elastic
    variables["shear"] = "point", positions
    first = slice(1, 1 + legs[0].size)
    peaks = _peaks(legs[0], {name: values[:, first] for name, values in columns.items()}, length)
    variables |= {name: ("nominal_pressure", values) for name, values in peaks.items()}
    variables |= {"shear_stiffness": ("nominal_pressure", finite), "peak_distance": length}
    variables["basic_friction_angle"] = crack.basic_friction_angle
    result = xr.Dataset(variables, {"nominal_pressure": pressures, "point": np.arange(positions.size)})
    if np.isnan(columns["shear_stress"]).any():
        for name in (*columns, *peaks, "shear_displacement"):
            result[name].attrs["reason"] = "; ".join(sorted({joint.reason for joint in joints} - {""}))
    return result.transpose("point", "nominal_pressure")


def _peaks(positions: Array, columns: dict[str, Array], length: float) -> dict[str, Array]:
    """Return the greatest and the last mean of the shear stress over a length of slip."""
    slip, sense = np.abs(positions), np.sign(positions[-1])
    means = []
    for name, sign in (("shear_stress", sense), ("normal_stress", 1.0)):
        stress = sign * columns[name]
        work = np.zeros_like(stress)
        work[:, 1:] = np.cumsum(stress[:, 1:] * np.diff(slip), axis=1)
        means.append(secant_slopes(slip, work.T, np.array([length]))[0])  # (point, test)
    # where a mean over the length ends on the leg, whatever became of the tests
    is_on_leg = np.isfinite(secant_slopes(slip, slip, np.array([length]))[0])
    # NaN where the test ended on the leg: what the joint would have borne then is not known
    shear, normal = (mean[is_on_leg] for mean in means)
    return {
        "peak_shear_strength": shear.max(axis=0),
        "peak_friction_angle": np.degrees(np.arctan((shear / normal).max(axis=0))),
        "residual_shear_strength": shear[-1],
    }


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

    def __init__(self, problem: JointProblem, towards: Direction) -> None:
        crack, options = problem.crack, problem.options
        lower, upper = crack.faces()
        self.crack, self.towards, self.problem = crack, towards, problem
        # just below the hardness all over; 1 - 1e-6 and 1 - 1e-12 gave the same bits
        self.capacity = float(options.hardness or math.inf) * crack.nominal_area / ROUNDED
        self.lower_wear, self.upper_wear = np.zeros(lower.shape), np.zeros(upper.shape)
        self.residual, self.steepest, self.plastic_work = 0.0, 0.0, 0.0
        self.unconverged = 0
        self.rows: list[dict[str, float]] = []  # what is reported of every position
        self.shear_stiffness, self.reason = math.inf, ""  # elastic, Pa/m; why the test ended before the path

    def shift(self, position: float) -> tuple[int, int]:
        """Return the whole cells (y, x) from the start to a position (m): rounding adds up along the path."""
        y, x = self.crack.layout.shift(position, self.towards.unit)
        return round(y), round(x)

    def contact(self, position: float, *, elastic: bool = False) -> ShearedContact:
        """Return the faces as they are worn now, at a position (m); `elastic`: without a hardness."""
        layout, (lower, upper) = self.crack.layout, self.crack.faces()
        under = heights_under(lower - self.lower_wear, layout, self.shift(position))
        heights = under - (upper + self.upper_wear)
        problem = self.problem
        if elastic:
            problem = replace(problem, options=replace(problem.options, hardness=None))
        return ShearedContact(problem, heights, position, self.towards)

    def press(self, contact: ShearedContact, load: float) -> State:
        """Press a contact of this joint under a load, N."""
        force = replace(self.problem.load, control="normal_force", values=(load,))
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
        shift = self.shift(position)
        rows, columns = (
            (layout.start[axis] + shift[axis] + np.arange(layout.cells[axis])) % layout.face_cells[axis]
            for axis in (0, 1)
        )
        self.lower_wear[np.ix_(rows, columns)] += 0.5 * state.wear
        self.upper_wear += 0.5 * state.wear
        self.plastic_work += state.plastic_work

    def faces(self) -> tuple[xr.DataArray, xr.DataArray]:
        """Return the whole lower and upper face as they are worn now."""
        upper = self.crack.lower if self.crack.upper is None else self.crack.upper
        heights = np.array(upper.values, dtype=np.float64)
        heights[self.crack.layout.slices] += self.upper_wear
        return self.crack.lower.copy(data=self.crack.faces()[0] - self.lower_wear), upper.copy(data=heights)

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
        return type(first)(*(_mean(a, b, share) for a, b in zip(first, second, strict=True)))
    return first + share * (second - first)


def _moved(
    joint: WornJoint, contacts: tuple[ShearedContact, ShearedContact], slip: float, load: float
) -> ShearStep:
    """Return the step between two positions under a load, which is taken up elastically before it."""
    before, after = (joint.press(contact, load) for contact in contacts)
    energy = after.elastic_energy + after.plastic_work - before.elastic_energy
    return ShearStep(load, (after.height - before.height) / slip, energy / (load * slip), after)
