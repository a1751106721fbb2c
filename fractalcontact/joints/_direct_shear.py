"""Direct shear test of a joint whose asperities yield: wear is carried along the path of shear."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import Direction, check_direction, read_direction
from fractalcontact.base.errors import ConvergenceWarning, warn
from fractalcontact.base.grid import UNIFORM
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.signals import track
from fractalcontact.base.study import joined_references
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._crack import FILL, Crack, check_crack
from fractalcontact.joints._criteria import POSITIVE
from fractalcontact.joints._friction import PEAK_SHARE, secant_slopes
from fractalcontact.joints._sheared_contact import Pressing, check_pressing
from fractalcontact.joints._worn_joint import WHERE, WornJoint, balanced_step, shear_stiffness

FIRST = "NaN before the first step"
MAPS = ("residual_lower", "residual_upper")

PATTON = "Patton (1966), 1st ISRM Congress 1:509 (friction on inclined contacts)"


def _check(problems: Problems) -> None:
    given = problems.given
    problems.number("normal_stiffness", **POSITIVE, optional=True)
    problems.number("shear_stiffness", **POSITIVE, optional=True)
    problems.number("distance", above=0, optional=True)
    problems.choices("keep", among=MAPS, optional=True)
    hardness_is_valid = problems.number("hardness", **POSITIVE)
    has_load = problems.numbers("nominal_pressure", **POSITIVE)
    if has_load and hardness_is_valid:
        greatest = float(float_array(given.nominal_pressure).max())
        bounded = greatest < float(given.hardness)
        problems.require(bounded, "nominal_pressure", "less than the hardness", greatest)
    check_crack(problems)
    hardness = given.hardness if hardness_is_valid else None  # what is wrong has been noted
    check_pressing(problems, hardness=hardness, nominal_pressure=given.nominal_pressure if has_load else 0.0)
    path_is_valid = problems.numbers("path", at_least=-POSITIVE["at_most"], at_most=POSITIVE["at_most"])
    if check_direction(problems) and path_is_valid and isinstance(given.crack, Crack):
        _check_path(problems, given.crack, _turning_points(given.path), read_direction(given.direction))


def _check_path(problems: Problems, crack: Crack, turning_points: Array, towards: Direction) -> None:
    problems.finite("crack.lower", crack.faces()[0], remedy=FILL)
    step = _cell_step(crack, towards)
    if step is None:
        expected = "one along which the block comes back onto the grid, such as E or N"
        problems.add("direction", expected, towards.name)
        return
    cells = turning_points / step
    whole = bool((np.abs(cells - np.rint(cells)) <= UNIFORM * np.maximum(np.abs(cells), 1.0)).all())
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
        problems.require(bool(reach <= travel + UNIFORM * step), "path", expected, float(reach))


@public_result(
    title="direct shear test",
    achieved_error="that of one step of shear per cell",
    reasons={
        "friction_angle": FIRST,
        "dilatancy_angle": FIRST,
        "shear_stiffness": "NaN where the faces have no compliance of their own",
    },
    check=_check,
)
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
        Positions (m, whole cells) at which the block reverses or stops, after 0: 3e-3, or [3e-3, -3e-3, 0].
    nominal_pressure : float or sequence of float
        Normal stresses at the start, Pa; each on a fresh joint.
    hardness : float
        Greatest pressure that a contact bears, Pa: between the compressive strength and an indentation
        hardness.
    direction : str or float
        Compass word, or degrees anticlockwise from E, along which whole cells lie.
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
    load = {"nominal_pressure": nominal_pressure}
    pressing = Pressing.read(crack, WHERE, load, influence, disc_radius, hardness, tolerance)
    pressures, names = float_array(nominal_pressure), word_tuple(keep)
    area = crack.nominal_area
    spring = 0.0 if normal_stiffness is None else float(normal_stiffness) * area
    joints = [WornJoint(pressing, towards) for _ in pressures]
    for joint, pressure in zip(joints, pressures, strict=True):
        _test(joint, legs, float(pressure) * area, spring, progress)
    length = max(PEAK_SHARE * math.sqrt(area), 2 * step) if distance is None else float(distance)
    result = _dataset(crack, joints, legs, pressures, shear_stiffness, min(length, float(np.ptp(legs[0]))))
    for name, index in zip(MAPS, (0, 1), strict=True):
        if name in names:
            faces = np.stack([joint.faces()[index].values for joint in joints])
            coords = {dim: crack.lower.coords[dim].variable for dim in ("y", "x")}
            result[name] = ("nominal_pressure", "y", "x"), faces
            result = result.assign_coords(coords)
    residual = max(joint.residual for joint in joints)
    _warn(joints)
    references = joined_references(PATTON, pressing.references)
    return result.assign_attrs(references=references, achieved_residual=residual)


def _warn(joints: Sequence[WornJoint]) -> None:
    """Warn of presses that did not converge, and of slopes beyond small strains."""
    from fractalcontact.contact.solver import warn_steep

    steepest = max(joint.steepest for joint in joints)
    warn_steep(f"{WHERE}: the delta-surface", steepest)
    failed = sum(joint.unconverged for joint in joints)
    if failed:
        message = f"{WHERE}: the solver did not converge {failed} times; see the achieved residual"
        warn(message, ConvergenceWarning)


def _turning_points(path: Any) -> Array:
    return np.concatenate([[0.0], float_array(path)])


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


def _legs(turning_points: Array, step: float) -> list[Array]:
    """Return the positions of every leg, cell by cell, with both its ends."""
    cells = np.rint(turning_points / step).astype(np.int64)
    return [step * np.arange(a, b + np.sign(b - a), np.sign(b - a)) for a, b in itertools.pairwise(cells)]


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
