"""Partial slip of a joint under a shear force below that of sliding: its shear stiffness and hysteresis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.compass import read_direction
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.resources import Plane
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.signals import track
from fractalcontact.base.study import BORRI_BRUNETTO_1998
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._crack import Crack, block_coords, check_sliding
from fractalcontact.joints._sheared_contact import LOADS, JointProblem, ShearedContact, check_problem, stacked

if TYPE_CHECKING:
    from fractalcontact.contact.solver import ShearPath


WHERE = "fractalcontact.joints.partial_slip"
STIFFNESSES = ("tangential_stiffness", "shear_stiffness", "interface_stiffness", "stiffness_ratio")
RIGID = "NaN where the interface is rigid: the faces are mated, or all of them touch"


def _check(problems: Problems) -> tuple[JointProblem, ShearPath] | None:
    given, solver = problems.given, fc.contact.solver
    problems.boolean("progress")
    check_sliding(problems, single=True)
    solver.check_shear(problems, has_friction=True)
    problem = check_problem(problems, method="fast")
    if problem is None:
        return None
    crack, friction = problem.crack, given.friction_coefficient
    if friction is None:
        friction = math.tan(math.radians(crack.basic_friction_angle))
    law = friction, crack.contact_poisson, given.method
    path = solver.ShearPath.read(given.tangential_force, given.direction, *law)
    expected = "above 0, or a friction_coefficient"
    has_friction = problems.require(path.friction > 0, "basic_friction_angle", expected, 0.0)
    if has_friction and problem.load.control != "closure":
        force = float(problem.load.solver_values(crack.nominal_area)[1][0])
        solver.check_sliding(problems, path, force)
    return problem, path


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the block: a free body, delta-surface, and the flat block, all of it in contact."""
    return (650.0 if arguments.get("method") == "full" and not plane.periodic else 360.0) * plane.cells


@public_result(
    title="Partial slip of a joint",
    references=BORRI_BRUNETTO_1998,
    reasons=dict.fromkeys(STIFFNESSES, RIGID),
    check=_check,
    memory=_memory,
)
@takes_checked
def partial_slip(
    checked: tuple[JointProblem, ShearPath],
    /,
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    tangential_force: float | Sequence[float] | Array,
    direction: str | float = "E",
    closure: float | None = None,
    normal_force: float | None = None,
    nominal_pressure: float | None = None,
    friction_coefficient: float | None = None,
    method: str | None = None,
    influence: str | None = None,
    disc_radius: str = "second_order",
    tolerance: float = DEFAULT_TOLERANCE,
    keep: str | Sequence[str] = (),
    progress: bool = False,
) -> xr.Dataset:
    """Push a pressed crack towards sliding: shear stiffness, hysteresis, and the part that still sticks.

    At every shear displacement, at which the faces have come to rest, the delta-surface is pressed, and a
    tangential force below that of sliding goes through a path: the water load of a dam, or cycles of an
    earthquake. The geometry of the contact is that of the shear; what moves is elastic.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0 (m), each once.
    tangential_force : float or sequence of float
        Shear force on the block (N) at each step, positive towards the direction.
    direction : str or float
        Direction of sliding, and of the force: compass word, or degrees anticlockwise from E.
    closure, normal_force, nominal_pressure : float
        Exactly one of them: the constant normal load, as for `closure`.
    friction_coefficient : float, optional
        Local friction mu; None: the tangent of the basic friction angle of the crack.
    method, influence, disc_radius, tolerance
        As for `fractalcontact.contact.partial_slip`; None chooses the method at each shear.
    keep : str or sequence of str
        Maps over (shear, step, y, x): "slip_state", "traction_x", "traction_y", "slip_x", "slip_y".
    progress : bool
        Show a progress bar over the shears.

    Returns
    -------
    Dataset over (shear, step)
        tangential_displacement (m), tangential_stiffness (N/m), stick_area, slip_area, dissipated_energy and
        the solver columns of `contact.partial_slip`; shear_stiffness K_s and stiffness_ratio K_s/K_n. Over
        shear: interface_stiffness K_n (Pa/m, at the normal load), sliding_force (N), at which all slides,
        contact_area, closure, slip_method (flags: the method that was chosen), superposition_error;
        stuck_ratio 2 (1 - nu)/(2 - nu), the theory for K_s/K_n before any slip. The part of the flat block is
        subtracted from both stiffnesses, as from the interface closure; they are NaN where nothing is left,
        for mated faces.

    Raises
    ------
    InvalidInput
        The force is beyond sliding, or an argument is wrong.

    References
    ----------
    Ciavarella (1998), J. Appl. Mech. 65:998; Borri-Brunetto, Chiaia and Ciavarella (2001), CMAME 190:6053.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> pushed = fc.joints.partial_slip(crack, shear=2e-4, normal_force=100, tangential_force=[0, 35, 70])
    >>> round(float(pushed["sliding_force"][0]), 1)
    70.0
    """
    problem, path = checked
    towards, shears, names = read_direction(direction), float_array(shear), word_tuple(keep)
    rows = [
        _pushed(ShearedContact.of_crack(problem, float(value), towards), path, names)
        for value in track(shears, progress, "partial_slip", unit="shear")
    ]
    dims = ("shear", "step", "y", "x")
    columns = stacked(rows)
    variables: dict[str, Any] = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    variables |= {
        "nominal_area": crack.nominal_area,
        "friction_coefficient": path.friction,
        "poisson": path.poisson,
        "stuck_ratio": 2 * (1 - path.poisson) / (2 - path.poisson),
    }
    coords: dict[str, Any] = {name: variables.pop(name) for name in LOADS}
    coords |= {"shear": ("shear", shears), "step": np.arange(len(path.forces))}
    coords |= {"tangential_force": ("step", np.array(path.forces))}
    coords |= {"direction": towards.name, "azimuth": towards.azimuth}
    result = xr.Dataset(variables, coords | (block_coords(crack) if names else {}))
    for name in STIFFNESSES:
        result[name] = result[name].where(np.isfinite(result[name]))
    by_superposition = result["slip_method"] == fc.contact.solver.METHODS.index("superposition")
    errors = result["superposition_error"].where(by_superposition, 0.0).values
    worst = int(np.argmax(np.abs(errors)))
    what = f"{WHERE}: the contact at a shear of {shears[worst]:g} m"
    fc.contact.solver.warn_lay(what, float(errors[worst]))
    return result.assign_attrs(achieved_residual=float(result["residual"].max()))


def _pushed(contact: ShearedContact, path: ShearPath, keep: Sequence[str]) -> dict[str, Any]:
    """Return the path of tangential forces at one shear, with the normal stiffness at its load."""
    problem, solver = contact.problem, fc.contact.solver
    sheared = contact.shear(path, keep)
    area, normal = problem.crack.nominal_area, sheared.normal.force
    block = _block_stiffness(problem, replace(path, method=sheared.method))
    shear_stiffness = _without_block(sheared.columns["tangential_stiffness"], block) / area
    of_normal = np.array(solver.normal_stiffness(sheared.normal))
    interface_stiffness = _without_block(of_normal, problem.block_stiffness) / area
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = shear_stiffness / interface_stiffness
    of_state = {
        "shear_stiffness": shear_stiffness,
        "stiffness_ratio": ratio,
        "interface_stiffness": interface_stiffness,
        "sliding_force": path.friction * normal,
        "contact_area": sheared.contact_area,
        "slip_method": np.int8(solver.METHODS.index(sheared.method)),
        "superposition_error": sheared.superposition_error,
        "closure": sheared.normal.closure,
        "normal_force": normal,
        "nominal_pressure": normal / problem.grid.nominal_area,
    }
    return sheared.columns | sheared.maps | of_state


def _block_stiffness(problem: JointProblem, path: ShearPath) -> float:
    """Return the tangential stiffness of the flat block, all of which sticks, N/m."""
    if path.method == "superposition" or not math.isfinite(problem.block_stiffness):
        return problem.block_stiffness * 2 * (1 - path.poisson) / (2 - path.poisson)
    load = fc.contact.solver.LoadPath("normal_force", (1.0,))
    flat = np.zeros(problem.grid.shape), problem.grid, problem.modulus, problem.options, load
    stuck = fc.contact.solver.solve_shear(*flat, replace(path, forces=(0.0,), friction=1.0))
    return float(stuck.columns["tangential_stiffness"][0])


def _without_block(stiffness: Array, block: float, rounding: float = 1e-3) -> Array:
    """Return the stiffness of an interface in series with a block; infinite where that is all there is.

    The rounding is above the relative error of the tangential stiffness; 1e-4 and 1e-2 gave the same.
    """
    with np.errstate(divide="ignore"):
        compliance = 1 / stiffness - 1 / block
        is_block = np.abs(compliance) <= rounding / block
        return np.asarray(np.where(is_block, np.inf, 1 / compliance))
