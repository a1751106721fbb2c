"""Direct shear test of a joint whose asperities yield: wear is carried along the path of shear."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import xarray as xr

import fractalcontact as fc  # loads `contact` on first use
from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.base.progress import track
from fractalcontact.base.references import joined_references
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, float_array, word_tuple
from fractalcontact.joints._closure import (
    Pressing,
    ShearedContact,
    check_pressing,
    pressing_references,
    warn_steep,
)
from fractalcontact.joints._compass import Direction, check_direction, read_direction
from fractalcontact.joints._crack import FILL, Crack, check_crack
from fractalcontact.joints._friction import PEAK_SHARE, secant_slopes

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.joints.direct_shear"
MAPS = ("residual_lower", "residual_upper")
LARGEST_STEP = 8  # cells along an axis in which the block comes back onto the grid
LOAD_ERROR = 1e-3  # relative error of the load on the contacts
MAX_SOLUTIONS = 40  # for one such load
SMALLEST_FORCE = 1e-6  # of the load of the step before: a spring may unload the block entirely
CAPACITY = 1.0 - 1e-9  # largest load over hardness times area
BRACKET, LOWEST = 0.5, 40.0  # steps of the logarithm of the load, and its range below the capacity
SMALLEST, LARGEST = 1e-30, 1e30  # of stresses and stiffnesses: their ratios do not overflow
UNLOADED = 0.5  # the elastic stiffness is that of unloading to this share of the load
PATTON = "Patton (1966), 1st ISRM Congress 1:509 (friction on inclined contacts)"
CRUSHED = "NaN from where the contacts would bear more than the hardness over the whole block"


def _check(
    problems: Problems,
    *,
    crack: Any,
    path: Any,
    nominal_pressure: Any,
    hardness: Any,
    direction: Any,
    normal_stiffness: Any,
    shear_stiffness: Any,
    distance: Any,
    keep: Any,
    progress: Any,
    **solver: Any,
) -> None:
    problems.boolean("progress", progress)
    bounds: Any = {"at_least": SMALLEST, "at_most": LARGEST}
    problems.number("normal_stiffness", normal_stiffness, **bounds, optional=True)
    problems.number("shear_stiffness", shear_stiffness, **bounds, optional=True)
    problems.number("distance", distance, above=0, optional=True)
    if keep is not None:
        problems.choices("keep", keep, MAPS)
    stresses_are_valid = problems.number("hardness", hardness, **bounds)
    if problems.numbers("nominal_pressure", nominal_pressure, **bounds) and stresses_are_valid:
        greatest = float(float_array(nominal_pressure).max())
        problems.require(greatest < float(hardness), "nominal_pressure", "less than the hardness", greatest)
        if check_crack(problems, crack):
            load = problems.construct(fc.contact.LoadPath, "nominal_pressure", nominal_pressure)
            check_pressing(problems, crack, load, "flat_block", (), {"hardness": hardness, **solver})
    path_is_valid = problems.numbers("path", path, at_least=-LARGEST, at_most=LARGEST)
    if isinstance(crack, Crack) and check_direction(problems, direction) and path_is_valid:
        _check_path(problems, crack, _turning_points(path), read_direction(direction))


def _check_path(problems: Problems, crack: Crack, turning_points: Array, towards: Direction) -> None:
    problems.finite("crack.lower", crack.faces()[0], remedy=FILL)
    step = _cell_step(crack, towards)
    if step is None:
        expected = "one along which the block comes back onto the grid, such as E or N"
        problems.add("direction", expected, towards.name)
        return
    cells = turning_points / step
    whole = bool((np.abs(cells - np.rint(cells)) <= 1e-6 * np.maximum(np.abs(cells), 1.0)).all())
    expected = f"multiples of {step:g} m, the cells along {towards.name}: wear stays on the grid"
    if problems.require(whole, "path", expected, turning_points.tolist()):
        moves = bool((np.diff(np.rint(cells)) != 0).all())
        problems.require(
            moves, "path", "positions other than the one before, the first not 0", turning_points
        )
    y, x = towards.unit
    for reach, unit in ((turning_points.max(), (y, x)), (-turning_points.min(), (-y, -x))):
        travel = crack.layout.travel(unit)
        expected = f"at most {travel:g} m this way, where the block meets the edge of the face"
        problems.require(bool(reach <= travel + 1e-6 * step), "path", expected, float(reach))


@public_result(title="direct shear test", achieved_error="that of one step of shear per cell", check=_check)
def direct_shear(
    crack: Crack,
    path: float | Sequence[float] | Array,
    *,
    nominal_pressure: float | Sequence[float],
    hardness: float,
    direction: str | float = "E",
    normal_stiffness: float | None = None,
    shear_stiffness: float | None = None,
    distance: float | None = None,
    keep: Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    tolerance: float = 1e-5,
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
        Positions (m, whole cells) at which the block reverses or stops, after 0: 3e-3, or [3e-3, -3e-3, 0].
    nominal_pressure : float or sequence of float
        Normal stresses at the start, Pa; each on a fresh joint.
    hardness : float
        Greatest pressure that a contact bears, Pa: between the compressive strength and an indentation
        hardness.
    direction : str or float
        Compass word or azimuth (degree) along which whole cells lie.
    normal_stiffness : float, optional
        Stiffness of a spring on the block per area, Pa/m. Default: constant normal stress.
    shear_stiffness : float, optional
        Elastic shear stiffness per area, Pa/m. Default: 2 (1 - nu)/(2 - nu) times the normal stiffness of
        unloading after the first step.
    distance : float, optional
        Slip (m) over which peak and residual are means. Default: 1 % of the side, at least two cells.
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
        leg), shear_stiffness; peak_distance.

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
    towards = read_direction(direction)
    step = _cell_step(crack, towards)
    assert step is not None
    legs = _legs(_turning_points(path), step)
    options = fc.contact.ContactOptions(
        influence=influence, disc_radius=disc_radius, hardness=hardness, tolerance=tolerance
    )
    pressures, names = float_array(nominal_pressure), word_tuple(keep)
    area = crack.nominal_area
    spring = 0.0 if normal_stiffness is None else float(normal_stiffness) * area
    tests = [
        _test(WornJoint(crack, towards, options), legs, float(pressure) * area, spring, progress)
        for pressure in pressures
    ]
    length = max(PEAK_SHARE * math.sqrt(area), 2 * step) if distance is None else float(distance)
    result = _dataset(crack, tests, legs, pressures, shear_stiffness, min(length, float(np.ptp(legs[0]))))
    for name, index in zip(MAPS, (0, 1), strict=True):
        if name in names:
            planes = np.stack([test.joint.faces()[index].values for test in tests])
            coords = {dim: crack.lower.coords[dim].variable for dim in ("y", "x")}
            result[name] = ("nominal_pressure", "y", "x"), planes
            result = result.assign_coords(coords)
    residual = max(test.joint.residual for test in tests)
    _warn([test.joint for test in tests])
    references = joined_references(PATTON, pressing_references(crack, options))
    return result.assign_attrs(references=references, achieved_residual=residual)


def _warn(joints: Sequence[WornJoint]) -> None:
    """Warn of presses that did not converge, and of slopes beyond small strains."""
    warn_steep([{"rms_slope": np.array([joint.steepest])} for joint in joints], WHERE, stacklevel=5)
    failed = sum(joint.unconverged for joint in joints)
    if failed:
        message = f"{WHERE}: the solver did not converge {failed} times; see the achieved residual"
        warnings.warn(message, ConvergenceWarning, stacklevel=4)


def _turning_points(path: Any) -> Array:
    return np.concatenate([[0.0], float_array(path)])


def _cell_step(crack: Crack, towards: Direction) -> float | None:
    """Return the shortest shear (m) that moves the block by whole cells along both axes; None without."""
    layout = crack.layout
    axis = int(np.argmax(np.abs(towards.unit)))
    for cells in range(1, LARGEST_STEP + 1):
        step = cells * layout.spacing[axis] / abs(towards.unit[axis])
        if all(part == math.floor(part) for part in layout.shift(step, towards.unit)):
            return step
    return None


def _legs(turning_points: Array, step: float) -> list[Array]:
    """Return the positions of every leg, cell by cell, with both its ends."""
    cells = np.rint(turning_points / step).astype(np.int64)
    return [step * np.arange(a, b + np.sign(b - a), np.sign(b - a)) for a, b in itertools.pairwise(cells)]


@dataclass(frozen=True)
class State:
    """The joint under a load: height of the block and closure (m), energies (J), and what is worn off (m)."""

    height: float
    closure: float
    elastic_energy: float
    plastic_work: float
    wear: Array
    contact_fraction: float


@dataclass(frozen=True)
class ShearStep:
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

    def __init__(self, crack: Crack, towards: Direction, options: fc.contact.ContactOptions) -> None:
        lower, upper = crack.faces()
        self.crack, self.towards = crack, towards
        self.capacity = CAPACITY * float(options.hardness or math.inf) * crack.nominal_area
        self.pressing = Pressing(
            fc.contact.LoadPath("normal_force", (0.0,)), options, "flat_block", (), WHERE
        )
        self.elastic = replace(self.pressing, options=replace(options, hardness=None))
        self.lower_wear, self.upper_wear = np.zeros(lower.shape), np.zeros(upper.shape)
        self.residual, self.steepest, self.plastic_work = 0.0, 0.0, 0.0
        self.unconverged = 0

    def contact(self, position: float, *, elastic: bool = False) -> ShearedContact:
        """Return the faces as they are worn now, at a position (m); `elastic`: without a hardness."""
        lower, upper = self.faces()
        worn = replace(self.crack, lower=lower, upper=upper)
        return ShearedContact(worn, position, self.towards, self.elastic if elastic else self.pressing)

    def press(self, contact: ShearedContact, load: float) -> State:
        """Press a contact of this joint under a load, N."""
        columns = contact.press(fc.contact.LoadPath("normal_force", (load,)), ("residual_height",))
        heights = np.asarray(contact.surface.values)
        self.residual = max(self.residual, float(columns["residual"][0]))
        self.steepest = max(self.steepest, float(columns["rms_slope"][0]))
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


@dataclass
class ShearTest:
    """A test of one joint: what is reported of every position, and the elastic shear stiffness, Pa/m."""

    joint: WornJoint
    rows: list[dict[str, float]]
    shear_stiffness: float


def _test(joint: WornJoint, legs: Sequence[Array], force: float, spring: float, progress: bool) -> ShearTest:
    """Shear a joint along the legs, from a normal force (N) on and against a spring (N/m)."""
    friction = math.tan(math.radians(joint.crack.basic_friction_angle))
    state = joint.press(joint.contact(0.0), force)
    joint.wear(0.0, state)
    first, load = state.height, force
    test = ShearTest(
        joint, [joint.report(state, first) | _stresses(joint, force, 0.0, math.nan, 1)], math.inf
    )
    total = sum(leg.size - 1 for leg in legs)
    pairs = ((pair, i == 0) for leg in legs for i, pair in enumerate(itertools.pairwise(leg)))
    for (here, there), begins in track(pairs, progress, f"shear under {force:g} N", unit="cell", total=total):
        step = _balanced(joint, here, there, load, friction, lambda z: force + spring * (z - first))
        if step is None:
            break
        rise = (step.state.height - state.height) / abs(there - here)
        stresses = _stresses(joint, *step.forces(friction), rise, 1 if there > here else -1)
        if begins:  # the stress changes before the block moves
            test.rows.append(test.rows[-1] | stresses)
        test.rows.append(joint.report(step.state, first) | stresses)
        if not math.isfinite(test.shear_stiffness):
            test.shear_stiffness = _shear_stiffness(joint, there, step.load)
        state, load = step.state, step.load
    return test


def _shear_stiffness(joint: WornJoint, position: float, load: float) -> float:
    """Return the elastic shear stiffness (Pa/m) in full stick, from the normal stiffness of unloading.

    Contacts that stick have the ratio 2 (1 - nu)/(2 - nu) of tangential to normal stiffness (Mindlin 1949).
    """
    contact = joint.contact(position)
    closed = [joint.press(contact, part * load).closure for part in (1.0, UNLOADED)]
    nu, unloading = joint.crack.contact_poisson, closed[0] - closed[1]
    if unloading <= 0:
        return math.inf
    stiffness = (1.0 - UNLOADED) * load / unloading / joint.crack.nominal_area
    return 2.0 * (1.0 - nu) / (2.0 - nu) * stiffness


def _balanced(
    joint: WornJoint,
    here: float,
    there: float,
    start: float,
    friction: float,
    normal_force: Callable[[float], float],
) -> ShearStep | None:
    """Move the block by one step and wear the faces; None if no load on the contacts balances.

    The load P on the contacts is that at which N = P (1 - mu d) is the normal force. The rise d falls as P
    grows, so that there is one such load. Where contacts yield all at once d jumps; the step is then the mean
    of those on both sides that has the normal force.
    """

    def excess(log_load: float) -> tuple[float, ShearStep]:
        step = _moved(joint, contacts, abs(there - here), math.exp(log_load))
        wanted = max(normal_force(step.state.height), 0.0)
        return step.forces(friction)[0] / max(wanted, start * SMALLEST_FORCE) - 1.0, step

    contacts = joint.contact(here, elastic=True), joint.contact(there)
    limit = math.log(joint.capacity)
    low = high = min(math.log(start), limit)
    below = above = excess(low)
    while below[0] > 0 and low > limit - LOWEST:
        high, above = low, below
        low -= BRACKET
        below = excess(low)
    while above[0] < 0 and high < limit:
        low, below = high, above
        high = min(high + BRACKET, limit)
        above = excess(high)
    if below[0] > 0 or above[0] < 0:
        return None
    for turn in range(MAX_SOLUTIONS):
        if high - low <= LOAD_ERROR or min(above[0], -below[0]) <= LOAD_ERROR:
            break
        share = 0.5 if turn % 2 else above[0] / (above[0] - below[0])  # bisection and secant in turn
        middle = high + share * (low - high)
        value = excess(middle)
        if value[0] < 0:
            low, below = middle, value
        else:
            high, above = middle, value
    span = above[0] - below[0]
    step = _mean(above[1], below[1], above[0] / span if span > 0 else 0.0)
    joint.wear(there, step.state)
    return step


def _mean(first: ShearStep, second: ShearStep, share: float) -> ShearStep:
    """Return the mean of two steps, the second with this share."""

    def mix(one: Any, two: Any) -> Any:
        if isinstance(one, State):
            return State(*(mix(getattr(one, each.name), getattr(two, each.name)) for each in fields(State)))
        return one + share * (two - one)

    return ShearStep(
        *(mix(getattr(first, each.name), getattr(second, each.name)) for each in fields(ShearStep))
    )


def _moved(
    joint: WornJoint, contacts: tuple[ShearedContact, ShearedContact], slip: float, load: float
) -> ShearStep:
    """Return the step between two positions under a load, which is taken up elastically before it."""
    before, after = (joint.press(contact, load) for contact in contacts)
    energy = after.elastic_energy + after.plastic_work - before.elastic_energy
    return ShearStep(load, (after.height - before.height) / slip, energy / (load * slip), after)


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
    tests: Sequence[ShearTest],
    legs: Sequence[Array],
    pressures: Array,
    shear_stiffness: float | None,
    length: float,
) -> xr.Dataset:
    """Return the rows of all tests over (nominal_pressure, point), with peaks and displacements."""
    dims, positions = ("nominal_pressure", "point"), np.concatenate([[0.0], *legs])
    columns = {name: np.full((pressures.size, positions.size), np.nan) for name in tests[0].rows[0]}
    for i, test in enumerate(tests):
        for name, values in columns.items():
            values[i, : len(test.rows)] = [row[name] for row in test.rows]
    stiffness = np.array(
        [test.shear_stiffness if shear_stiffness is None else shear_stiffness for test in tests]
    )
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
    for name in ("friction_angle", "dilatancy_angle"):
        result[name].attrs["reason"] = "NaN before the first step"
    if np.isnan(columns["shear_stress"]).any():
        for name in (*columns, *peaks, "shear_displacement"):
            result[name].attrs["reason"] = CRUSHED
    if np.isnan(finite).any():
        result["shear_stiffness"].attrs["reason"] = "NaN where the faces have no compliance of their own"
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
    shear, normal = means
    known = np.isfinite(shear)  # not where the window would end beyond the leg, or the joint was crushed
    peak = np.where(known, shear, -np.inf).max(axis=0)
    ratio = np.where(known, shear / normal, -np.inf).max(axis=0)
    last = known.shape[0] - 1 - known[::-1].argmax(axis=0)
    any_known = known.any(axis=0)
    return {
        "peak_shear_strength": np.where(any_known, peak, np.nan),
        "peak_friction_angle": np.where(any_known, np.degrees(np.arctan(ratio)), np.nan),
        "residual_shear_strength": np.where(any_known, shear[last, np.arange(last.size)], np.nan),
    }
