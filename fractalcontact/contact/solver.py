"""The contact solver on plain arrays, under `press`, `partial_slip` and the joints.

    options, load = ContactOptions(hardness=2e9), LoadPath("normal_force", (10.0, 20.0))
    pressed = solve(heights, grid, contact_modulus, options, load, keep=("state",))
    pressed.columns["closure"], pressed.maps["state"]  # of shape (step,) and (step, y, x)

Two subpackages call it, so the module is public inside the package; users call `press` and `partial_slip`.
Options and loads validate themselves; `ContactOptions.check_grid`, `check_load` and `check_scale` collect
what does not fit a surface. Beyond that nothing is validated, nothing is labelled, and no warning is given:
every step states whether it converged.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from fractalcontact.base.errors import AnisotropyWarning, SmallStrainWarning, warn
from fractalcontact.base.grid import EXCESS_PER_EDGE, Grid, contact_edges
from fractalcontact.base.numbers import Array, number_of_entries
from fractalcontact.base.resources import require_memory
from fractalcontact.base.schema import CONTACT, OPEN, SLIP_MAPS, STEEP, STOP_REASONS, YIELDED
from fractalcontact.base.signals import track
from fractalcontact.base.validation import Problems
from fractalcontact.contact._flat_block import block_stiffness as block_stiffness
from fractalcontact.contact._load_path import Step, press_punch, scaled_path, solve_path
from fractalcontact.contact._problem import CONTROLS, FORCE_ROUNDING
from fractalcontact.contact._problem import ContactOptions as ContactOptions
from fractalcontact.contact._problem import LoadPath as LoadPath
from fractalcontact.contact._problem import check_scale as check_scale
from fractalcontact.contact._superposition import (
    ACCEPTABLE_ERROR,
    Superposition,
    reduced_forces,
    shear_states,
    solve_reduced,
    superposition_error,
)
from fractalcontact.contact._superposition import METHODS as METHODS
from fractalcontact.contact._superposition import ShearPath as ShearPath

# bytes of a node in contact, as measured, that the full method takes beside the superposition, and 8 for the
# traction from which each step starts
FULL_BYTES = 580.0
PRESSURE_CLASSES = 50  # of a distribution, from 0 to the greatest pressure: enough for a curve of a plot


@dataclass(frozen=True)
class Pressed:
    """A surface pressed along a load path.

    `columns` holds the scalars of the steps, shape (step,), and what has a further axis; `maps` the maps that
    were asked for, shape (step, y, x). `disc_radius` is in m, None for other influence coefficients.
    `solvers` names the solver of each step, see `Solution`.
    """

    columns: dict[str, Array]
    maps: dict[str, Array]
    disc_radius: float | None
    solvers: tuple[str, ...]


def solvers_in_words(solvers: Iterable[str]) -> str:
    """Return the solvers of steps for the provenance, each with the number of its steps."""
    return ", ".join(f"{name} ({number} steps)" for name, number in Counter(solvers).items())


def solve(
    heights: Array,
    grid: Grid,
    contact_modulus: float,
    options: ContactOptions,
    load: LoadPath,
    *,
    keep: Sequence[str] = (),
    include: Sequence[str] = (),
    progress: bool = False,
) -> Pressed:
    """Press a rigid flat down on a surface along a load path.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        Finite heights in m, up positive.
    grid : Grid
    contact_modulus : float
        E* in Pa.
    options : ContactOptions
    load : LoadPath
    keep : sequence of str
        Names of maps, see `MAPS`.
    include : sequence out of "stiffness", "pressure_distribution"
    progress : bool
    """
    path = scaled_path(heights, grid, contact_modulus, options, load)
    rows: list[dict[str, Any]] = []
    solvers: list[str] = []
    maps: dict[str, list[Array]] = {name: [] for name in keep}
    before: Step | None = None
    for step in track(solve_path(path), progress, "press", total=len(path.values)):
        row = _scalars(step, grid)
        if "stiffness" in include:
            stiffness = _stiffness(step, before, grid)
            row |= {"contact_stiffness": stiffness, "relative_conductance": stiffness / contact_modulus}
        if "pressure_distribution" in include:
            row |= _pressure_distribution(step.pressure)
        rows.append(row)
        solvers.append(step.solution.solver)
        for name, planes in maps.items():
            planes.append(np.asarray(MAPS[name](step, heights)))
        before = step
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    stacks = {
        name: planes[0][None] if len(planes) == 1 else np.stack(planes) for name, planes in maps.items()
    }
    return Pressed(columns, stacks, path.disc_radius, tuple(solvers))


def rms_slope(heights: Array, grid: Grid) -> float:
    """Return the root mean square gradient, from the differences of neighbours."""
    square = 0.0
    for axis, (spacing, wraps) in enumerate(zip(grid.spacing, grid.periodic, strict=True)):
        steps = np.diff(
            heights, axis=axis, append=heights.take([0], axis) if wraps else heights.take([], axis)
        )
        largest = float(np.abs(steps).max()) or 1.0  # heights of any unit: no square leaves the range
        square += float(np.mean((steps / largest) ** 2)) * (largest / spacing) ** 2
    return float(np.sqrt(square))


def warn_steep(what: str, slope: float) -> None:
    """Warn of a surface beyond small strains, by its rms slope."""
    if slope > STEEP:
        limits = f"beyond {STEEP:g} strains are not small, and linear elasticity is an approximation"
        message = f"{what} has an rms slope of up to {slope:.2g}; {limits}"
        warn(message, SmallStrainWarning)


def warn_lay(what: str, error: float) -> None:
    """Warn of a contact with a lay that was solved by superposition, by the error of that."""
    if abs(error) > ACCEPTABLE_ERROR:
        message = f"{what} has a lay, and by superposition the displacement is off by about {error:+.0%}, the"
        # at small forces, of three surfaces with a lay: 3.3, 4.6 and 5 times
        message += " dissipated energy by three to five times that: use method='full'"
        warn(message, AnisotropyWarning)


def _state(step: Step) -> Array:
    """Return the flags open, contact, yielded."""
    state = np.where(step.contact, np.int8(CONTACT), np.int8(OPEN))
    state[step.contact & step.yielded] = YIELDED
    return state


# each map of a step, from the step and the heights of the surface
MAPS: dict[str, Callable[[Step, Array], Array]] = {
    "state": lambda step, _: _state(step),
    "pressure": lambda step, _: step.pressure,
    "gap": lambda step, _: step.gap,
    "displacement": lambda step, _: step.displacement,
    "residual_height": lambda step, heights: heights - step.indentation,
}


def _scalars(step: Step, grid: Grid) -> dict[str, Any]:
    """Return the scalars of a step."""
    contact, periodic = step.contact, step.path.body.periodic
    cells = int(np.count_nonzero(contact))
    edges = int(contact_edges(contact, (periodic, periodic)).sum())
    # the share that bears the force; 0 without a hardness
    least = step.force / (step.path.hardness * grid.nominal_area)
    scalars = {
        "closure": step.closure,
        "normal_force": step.force,
        "nominal_pressure": step.force / grid.nominal_area,
        "contact_area": cells * grid.cell_area,
        "contact_fraction": cells / contact.size,
        "corrected_contact_fraction": max((cells - EXCESS_PER_EDGE * edges) / contact.size, least),
        "mean_gap": step.mean_gap,
        "elastic_energy": step.elastic_energy,
        "plastic_work": step.plastic_work,
        "iterations": step.solution.iterations,
        "transforms": step.solution.transforms,
        "residual": step.solution.residual,
        "converged": step.solution.reason == "converged",
        "stop_reason": STOP_REASONS[step.solution.reason],
        "run_time": step.run_time,
    }
    if not np.isfinite(step.path.hardness):
        del scalars["plastic_work"]
    return scalars


def _stiffness(step: Step, before: Step | None, grid: Grid) -> float:
    """Return the derivative of the nominal pressure by the closure, Pa/m; NaN where it has no bound."""
    rise = None if before is None else np.abs(step.solution.pressure - before.solution.pressure)
    stiffness = normal_stiffness(step, rise) / grid.nominal_area
    return stiffness if np.isfinite(stiffness) else np.nan


def normal_stiffness(step: Step, rise: Array | None = None) -> float:
    """Return the derivative of the force by the closure, N/m: 0 without contact, else that of a punch.

    `rise` is that of the pressure from which `press_punch` starts. Infinite in full contact of a periodic
    body, NaN under a force that is not determined.
    """
    punch = press_punch(step, rise)
    return 0.0 * step.force if punch is None else punch.stiffness


def _pressure_distribution(pressure: Array) -> dict[str, Any]:
    """Return the greatest pressure (Pa), and the shares of area and load in each class of pressures.

    The area is that of the whole extent, the open part of which is in no class.
    """
    greatest = float(pressure.max())
    if not greatest > 0:
        none = np.full(PRESSURE_CLASSES, 0.0 if greatest == 0 else np.nan)
        return {"maximum_pressure": greatest, "area_share": none, "load_share": none}
    relative = pressure[pressure > 0] / greatest
    number = np.minimum((relative * PRESSURE_CLASSES).astype(np.int64), PRESSURE_CLASSES - 1)
    area = np.bincount(number, minlength=PRESSURE_CLASSES) / pressure.size
    load = np.bincount(number, relative, minlength=PRESSURE_CLASSES)
    return {"maximum_pressure": greatest, "area_share": area, "load_share": load / load.sum()}


@dataclass(frozen=True)
class Sheared:
    """A pressed surface sheared along a path; `columns`, `maps` and `disc_radius` as in `Pressed`.

    `normal` is the step under the normal load alone.
    """

    normal: Step
    contact_area: float
    method: str
    superposition_error: float
    columns: dict[str, Array]
    maps: dict[str, Array]
    disc_radius: float | None


def solve_shear(
    heights: Array,
    grid: Grid,
    contact_modulus: float,
    options: ContactOptions,
    load: LoadPath,
    shear: ShearPath,
    *,
    keep: Sequence[str] = (),
    progress: bool = False,
    start_tolerance: float = 1e-2,  # 1e-4 took 4 % more transforms
) -> Sheared:
    """Press a surface under a load of one step, and shear it; arguments as for `solve`.

    `start_tolerance` is that of the superposition from which the full method starts.

    Raises
    ------
    InvalidInput
        The force under an imposed closure is not determined, or slides: both are known only here.
    """
    path = scaled_path(heights, grid, contact_modulus, options, load)
    pressed = next(solve_path(path)) if path.control == "closure" else None
    normal = path.values[0] if pressed is None else pressed.force
    if pressed is not None:
        with Problems("fractalcontact.contact.partial_slip") as problems:
            expected = "a closure whose force is determined: above the mean plane of a periodic body"
            if problems.require(math.isfinite(normal), "closure", expected, load.values[0]):
                check_sliding(problems, shear, normal)
    states = shear_states(shear.forces)
    reduced, numbers = reduced_forces(states, normal, shear.friction)
    steps = solve_reduced(path, reduced, pressed, path.tolerance)
    first = next(steps)
    error = superposition_error(first, shear)
    method = shear.method
    if method is None:
        is_suitable = abs(error) <= ACCEPTABLE_ERROR or shear.slides(normal)
        method = "superposition" if is_suitable else "full"
    if method == "full":
        steps = solve_reduced(path, reduced, first, start_tolerance)
        next(steps)  # the first one
    wanted = ("traction_x",) if method == "full" else keep  # where the full method starts from
    superposition = Superposition(
        first, states, numbers, shear, grid.cell_area, wanted, stiffness=method == "superposition"
    )
    for step in track(chain([first], steps), progress, "partial_slip", total=len(reduced)):
        superposition.add(step)
    columns = superposition.columns()
    if method == "full":
        maps = _solve_fully(superposition, columns, keep)
    else:
        maps = {name: superposition.map(name) for name in keep}
    area = np.count_nonzero(first.contact) * grid.cell_area
    return Sheared(first, area, method, error, columns, maps, path.disc_radius)


def _solve_fully(
    superposition: Superposition, columns: dict[str, Array], keep: Sequence[str]
) -> dict[str, Array]:
    """Return the maps of the full method and write its columns; every step starts from the superposition."""
    from fractalcontact.contact._coulomb import coulomb_path
    from fractalcontact.contact._tangential_operator import TangentialOperator

    shear, normal, contact = superposition.shear, superposition.normal, superposition.contact
    shape, nodes = (len(shear.forces), *contact.shape), int(np.count_nonzero(contact))
    require_memory(
        "", (FULL_BYTES + 8.0 * len(shear.forces)) * nodes, f"method='full' on {nodes} nodes in contact"
    )
    maps = {name: np.zeros(shape, np.int8 if name == "slip_state" else np.float64) for name in keep}
    if contact.any():
        operator = TangentialOperator(normal.path.body, contact, shear.poisson)
        law = (shear.friction, np.array(shear.unit))
        coulomb_path(normal, operator, np.array(shear.forces), superposition.traction(), *law, columns, maps)
    return maps


def check_shear(problems: Problems, *, has_friction: bool = False) -> None:
    """Check loads, friction, method and maps of a shear; `has_friction`: the bodies have a coefficient."""
    expected = "one number: the normal load is constant while the tangential force changes"
    for name in CONTROLS:
        count = number_of_entries(getattr(problems.given, name)) or 1
        problems.require(count == 1, name, expected, f"{count} of them")
    # at most beyond that of any pair of bodies
    problems.number("friction_coefficient", above=0, at_most=1e3, optional=has_friction)
    problems.numbers("tangential_force")
    problems.choice("method", among=METHODS, optional=True)
    problems.choices("keep", among=SLIP_MAPS)


def check_sliding(problems: Problems, shear: ShearPath, normal_force: float) -> bool:
    """Check that no tangential force is beyond that at which the whole contact slides."""
    limit = shear.friction * normal_force
    greatest = max(shear.forces, key=abs)
    expected = f"at most friction times normal force, {limit:.8g} N, where sliding begins"
    if shear.method == "full":
        expected += ", and less by 1e-6 with method='full'"
        below = not shear.slides(normal_force)
    else:
        below = abs(greatest) <= limit * (1 + FORCE_ROUNDING)
    return problems.require(below, "tangential_force", expected, greatest)
