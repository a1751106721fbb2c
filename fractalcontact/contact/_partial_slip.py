"""Partial slip of a rough contact under a tangential force: `partial_slip`.

By superposition of normal solutions (Ciavarella 1998; Jaeger 1998). Under a constant normal force P a
tangential force Q that grows from zero gives the traction

    q = mu [p(P) - p(P - Q/mu)],                                                                   (1)

where p(P) is the pressure under the force P: the contact at the force P - Q/mu sticks, the rest slips. With
lambda the ratio of tangential to normal compliance the displacement and the slip are

    delta_t = mu lambda [delta_n(P) - delta_n(P - Q/mu)],                                          (2)
    s = mu lambda gap(P - Q/mu)    inside the contact.                                             (3)

In (3) the gap appears because the surface displacement is closure less gap less initial gap. Where the
surfaces slip, q = mu p(P), so that the energy dissipated is mu p(P) s summed over the contact. After a
reversal the changes of q, delta_t and s are -2 times (1) to (3) for half of the change of the force, and a
loop that has closed is forgotten.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.progress import track
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import OPEN, SLIP, SLIP_MAPS, STICK
from fractalcontact.base.validation import Problems, float_array, word_tuple
from fractalcontact.contact._load_path import Step, scaled_path, solve_path
from fractalcontact.contact._masing_rules import ShearState, shear_states
from fractalcontact.contact._options import ContactOptions, LoadPath, check_scale
from fractalcontact.contact._scaled_problem import sum_by_rows

Array = np.ndarray[Any, np.dtype[Any]]

METHODS = ("superposition", "full")
BELOW_SLIDING = 1e-6  # relative distance from sliding, where the full displacement grows without bound
GREATEST_FRICTION = 1e3
FORCE_ROUNDING = 1e-12  # of the normal force: forces that differ by less share one solution
STIFFNESS_TOLERANCE = (
    1e-4  # of the punch that the sticking contact is; the error of the stiffness is its square
)


def _check(
    problems: Problems,
    *,
    surface: Any,
    contact_modulus: Any,
    poisson: Any,
    friction_coefficient: Any,
    tangential_force: Any,
    azimuth: Any,
    method: Any,
    keep: Any,
    progress: Any,
    closure: Any,
    normal_force: Any,
    nominal_pressure: Any,
    **keywords: Any,
) -> None:
    """Collect what is wrong with a call of `partial_slip`."""
    surface_is_valid = problems.surface("surface", surface)
    problems.number("contact_modulus", contact_modulus, above=0)
    problems.number("poisson", poisson, above=-1, at_most=0.5)
    problems.number("friction_coefficient", friction_coefficient, above=0, at_most=GREATEST_FRICTION)
    problems.numbers("tangential_force", tangential_force)
    problems.number("azimuth", azimuth)
    method_is_valid = problems.choice("method", method, METHODS)
    problems.choices("keep", keep, SLIP_MAPS)
    problems.boolean("progress", progress)
    options = problems.construct(ContactOptions, **keywords)
    load = problems.construct(
        LoadPath.from_keywords,
        closure=closure,
        normal_force=normal_force,
        nominal_pressure=nominal_pressure,
    )
    if load is not None:
        expected = "one number: the normal load is constant while the tangential force changes"
        problems.require(len(load.values) == 1, load.control, expected, f"{len(load.values)} of them")
    if not surface_is_valid or options is None:
        return
    grid = read_grid(surface)
    options.check_grid(grid, problems)
    if method_is_valid and method == "full":
        expected = "'superposition' for free bodies: 'full' is for periodic ones"
        problems.require(options.is_periodic(grid), "method", expected, method)
    if load is None or problems.messages:
        return
    height_range = float(surface.values.max()) - float(surface.values.min())
    check_scale(problems, grid, height_range, float(contact_modulus), None, load)
    if load.control != "closure":
        normal = float(load.solver_values(grid.nominal_area)[1][0])
        check_sliding(problems, float_array(tangential_force), float(friction_coefficient), normal, method)


def check_sliding(problems: Problems, path: Array, friction: float, normal_force: float, method: str) -> bool:
    """Check that no tangential force is beyond that at which the whole contact slides."""
    limit = friction * normal_force
    greatest = float(path[np.argmax(np.abs(path))])
    expected = f"at most friction_coefficient times normal force, {limit:.8g} N, where sliding begins"
    limit *= 1 - BELOW_SLIDING if method == "full" else 1 + FORCE_ROUNDING
    expected += ", and less by 1e-6 with method='full'" if method == "full" else ""
    return problems.require(abs(greatest) <= limit, "tangential_force", expected, greatest)


@public_result(
    title="Partial slip of a rough contact",
    references="Ciavarella (1998), J. Appl. Mech. 65:998; Jaeger (1998), J. Appl. Mech. 65:1019",
    check=_check,
)
def partial_slip(
    surface: xr.DataArray,
    *,
    contact_modulus: float,
    poisson: float,
    friction_coefficient: float,
    tangential_force: float | Sequence[float] | Array,
    closure: float | None = None,
    normal_force: float | None = None,
    nominal_pressure: float | None = None,
    azimuth: float = 0.0,
    method: str = "superposition",
    boundary: str | None = None,
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    tolerance: float = 1e-8,
    keep: Sequence[str] = ("slip_state",),
    progress: bool = False,
) -> xr.Dataset:
    """Shear a pressed rough surface below the force of sliding: where it sticks and where it slips.

    Coulomb friction, |q| <= mu p, under a constant normal load. Theory: page `theory_contact`.

    Parameters
    ----------
    surface : DataArray, dims (y, x)
        Heights in m, as for `press`.
    contact_modulus : float
        E* of the pair in Pa, see `effective_modulus`.
    poisson : float
        Poisson's ratio of both bodies, or of the elastic one where the other is rigid.
    friction_coefficient : float
        mu, above 0.
    tangential_force : float or sequence of float
        Force on the upper body (N) at each step, up and down from zero, positive towards `azimuth`; at most
        mu times the normal force.
    closure, normal_force, nominal_pressure : float
        Exactly one of them, as for `press`: the normal load, under which the force stays constant.
    azimuth : float
        Direction of the tangential force in degrees, anticlockwise from +x.
    method : {"superposition", "full"}
        Ciavarella and Jaeger: one normal solution for each new tangential force. Or, for periodic bodies,
        Coulomb's law at every node with x and y coupled; a step takes the transforms of some ten normal ones.
    boundary, influence, disc_radius, tolerance
        As for `press`.
    keep : sequence out of "slip_state", "traction_x", "traction_y", "slip_x", "slip_y"
        Maps (step, y, x) to return: flags open, stick, slip; traction on the surface (Pa); slip since the
        start of the path (m), 0 where open.
    progress : bool
        Show a progress bar over the normal solutions.

    Returns
    -------
    Dataset over `step`
        Coordinates tangential_force, and closure, normal_force and nominal_pressure of the normal load;
        tangential_displacement, stick_area, slip_area, tangential_stiffness, dissipated_energy, iterations,
        transforms, residual, converged, run_time; the maps; contact_area, nominal_area, contact_modulus,
        poisson, friction_coefficient, disc_radius (for "disc").

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call, such as a tangential force beyond sliding.

    Warns
    -----
    ConvergenceWarning
        A solution stopped before its tolerance was met.

    Notes
    -----
    A node sticks if it has not slipped since the last reversal of the force ("full": in the step). The
    superposition is exact for poisson = 0, otherwise within a few per cent: slip across the force is
    neglected. So is, always, the change of the pressure between dissimilar bodies. A change of the force
    below `tolerance` times the normal force is not resolved. The stiffness is that of a further step in the
    same direction, zero where all slides. Displacements of periodic bodies are without those of the bulk.

    Examples
    --------
    Cattaneo's ball: half of the force of sliding leaves a stick circle of radius a (1/2)^(1/3):

    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> x = 1e-4 * np.arange(-20, 21)
    >>> ball = fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / 2, 1e-4)
    >>> bodies = {"contact_modulus": 1e9, "poisson": 0.2, "friction_coefficient": 0.4}
    >>> slipping = fc.contact.partial_slip(ball, normal_force=3.0, tangential_force=[0.6, -0.6], **bodies)
    >>> round(float(slipping["stick_area"][0] / slipping["contact_area"]), 2), round(0.5 ** (2 / 3), 2)
    (0.63, 0.63)
    """
    options = ContactOptions(boundary, influence, disc_radius, None, tolerance, "fast")
    load = LoadPath.from_keywords(
        closure=closure, normal_force=normal_force, nominal_pressure=nominal_pressure
    )
    grid, forces = read_grid(surface), float_array(tangential_force)
    friction, names = float(friction_coefficient), word_tuple(keep)
    heights = np.asarray(surface.values, dtype=np.float64)
    modulus = float(contact_modulus)

    control, values = load.solver_values(grid.nominal_area)
    pressed = None
    normal = float(values[0])
    if control == "closure":
        pressed = next(solve_path(scaled_path(heights, grid, modulus, options, load)))
        normal = pressed.force
        _check_closure(load, forces, friction, normal, method)
    states = shear_states(forces)
    reduced, numbers = reduced_forces(states, normal, friction)
    steps: Iterator[Step] = iter(() if pressed is None else (pressed,))
    to_solve = tuple(reduced if pressed is None else reduced[1:])
    if to_solve:
        load = LoadPath("normal_force", to_solve)
        steps = chain(steps, solve_path(scaled_path(heights, grid, modulus, options, load)))

    ratio = (2 - float(poisson)) / (2 - 2 * float(poisson))  # lambda: tangential over normal compliance
    unit = unit_vector(float(azimuth))
    wanted = (*names, "traction_x") if method == "full" else names  # where the full method starts from
    superposition = Superposition(states, numbers, friction, ratio, unit, grid.cell_area, wanted)
    for step in track(steps, progress, "partial_slip", total=len(reduced)):
        superposition.add(step)
    columns = superposition.columns()
    maps = {name: superposition.map(name) for name in names}
    if method == "full":
        columns, maps = coulomb_path(superposition, forces, float(poisson), tolerance, columns, names)
    result = _dataset(surface, grid, superposition.normal, columns, maps)
    result = result.assign(
        contact_modulus=modulus, poisson=float(poisson), friction_coefficient=friction
    ).assign_coords(tangential_force=("step", forces), azimuth=float(azimuth))
    _warn(result)
    result.attrs = {
        "method": method,
        "boundary": "periodic" if options.is_periodic(grid) else "free",
        "influence": options.influence_on(grid),
        "achieved_residual": float(np.fmax.reduce(result["residual"].values)),
    }
    return result


def _check_closure(load: LoadPath, forces: Array, friction: float, normal: float, method: str) -> None:
    """Check what is known only when the force under an imposed closure is."""
    with Problems("fractalcontact.contact.partial_slip") as problems:
        expected = "a closure whose force is determined: above the mean plane of a periodic body"
        if problems.require(math.isfinite(normal), "closure", expected, load.values[0]):
            check_sliding(problems, forces, friction, normal, method)


def _dataset(
    surface: xr.DataArray, grid: Grid, normal: Step, columns: dict[str, Array], maps: dict[str, Array]
) -> xr.Dataset:
    """Return the Dataset over all steps."""
    variables: dict[str, Any] = {name: ("step", column) for name, column in columns.items()}
    variables["contact_area"] = np.count_nonzero(normal.contact) * grid.cell_area
    variables["nominal_area"] = grid.nominal_area
    if normal.path.body.influence == "disc":
        variables["disc_radius"] = normal.path.body.radius * normal.path.units.length
    coords: dict[str, Any] = {
        "step": np.arange(columns["residual"].size),
        "closure": normal.closure,
        "normal_force": normal.force,
        "nominal_pressure": normal.force / grid.nominal_area,
    }
    if maps:
        coords |= {dim: surface.coords[dim].variable for dim in ("y", "x")}
        variables |= {name: (("step", "y", "x"), planes) for name, planes in maps.items()}
    return xr.Dataset(variables, coords)


def _warn(result: xr.Dataset) -> None:
    """Warn of the steps that rest on a normal solution that did not converge."""
    failed = np.flatnonzero(~result["converged"].values)
    if failed.size:
        worst = float(np.fmax.reduce(result["residual"].values))
        message = (
            f"fractalcontact.contact.partial_slip: {failed.size} steps not converged, the first of them"
            f" step {failed[0]} (residual up to {worst:.2g})"
        )
        warnings.warn(message, ConvergenceWarning, stacklevel=4)


def reduced_forces(
    states: Sequence[ShearState], normal: float, friction: float
) -> tuple[list[float], dict[float, int]]:
    """Return the normal forces P - L/mu of all branches, falling from P, and the number of each L.

    Forces that differ by rounding share one solution.
    """
    numbers, reduced = {0.0: 0}, [normal]
    for force in sorted({branch.force for state in states for branch in state.branches}):
        value = max(normal - force / friction, 0.0)
        if value <= FORCE_ROUNDING * normal:
            value = 0.0
        if reduced[-1] - value > FORCE_ROUNDING * normal:
            reduced.append(value)
        numbers[force] = len(reduced) - 1
    return reduced, numbers


class Superposition:
    """Sums of normal solutions, which arrive one by one under falling forces, the first under P.

    Only what is summed is kept of a solution, so that a path needs no more memory than its maps.
    """

    def __init__(
        self,
        states: Sequence[ShearState],
        numbers: dict[float, int],
        friction: float,
        ratio: float,
        unit: tuple[float, float],
        cell_area: float,
        names: Sequence[str],
    ) -> None:
        self.states, self.numbers, self.names = states, numbers, names
        self.friction, self.ratio, self.unit, self.cell_area = friction, ratio, unit, cell_area
        self.latest = [numbers[s.branches[-1].force] if s.branches else 0 for s in states]
        used = [{0, *(numbers[b.force] for b in s.branches)} for s in states]
        used = [u | {numbers[force] for _, force in s.closed} for u, s in zip(used, states, strict=True)]
        self.used = [sorted(u) for u in used]
        self.rows: list[dict[str, float]] = []  # of the normal solutions
        self.state_maps: dict[int, Array] = {}
        self.fields: dict[str, Array] = {}

    def add(self, step: Step) -> None:
        """Take the next normal solution."""
        number = len(self.rows)
        if number == 0:
            self.normal, self.contact, self.pressure = step, step.contact, step.pressure
            shape = (len(self.states), *self.pressure.shape)
            kinds = {name[:-2] for name in self.names if name != "slip_state"}
            self.fields = {kind: np.zeros(shape) for kind in sorted(kinds)}
        gap = np.where(self.contact, step.gap, 0.0)
        stick = step.contact & self.contact
        cells = int(np.count_nonzero(stick))
        punch = press_sticking_punch(step) if number in self.latest else None
        solutions = [step.solution] if punch is None else [step.solution, punch.solution]
        self.rows.append(
            {
                "closure": step.closure,
                "work": sum_by_rows(self.pressure * gap),  # of p(P) on the gap of P - L/mu
                "stick_cells": cells,
                "slip_cells": int(np.count_nonzero(self.contact)) - cells,
                "stiffness": 0.0 if punch is None else stiffness_of(punch),
                "residual": step.solution.residual,
                "converged": step.solution.reason == "converged",
                "iterations": sum(solution.iterations for solution in solutions),
                "transforms": sum(solution.transforms for solution in solutions),
                "run_time": step.run_time + (0.0 if punch is None else punch.run_time),
            }
        )
        if "slip_state" in self.names and number in self.latest:
            state = np.where(self.contact, np.int8(SLIP), np.int8(OPEN))
            state[stick] = STICK
            self.state_maps[number] = state
        if not self.fields:
            return
        change = {"traction": np.where(self.contact, self.pressure - step.pressure, 0.0), "slip": gap}
        for row, state_of_row in enumerate(self.states):
            factor = sum(b.sign * b.weight for b in state_of_row.branches if self.numbers[b.force] == number)
            if factor:
                for name, field in self.fields.items():
                    field[row] += factor * change[name]

    def columns(self) -> dict[str, Array]:
        """Return the scalars of all steps."""
        mu, cell = self.friction, self.cell_area
        closure, work = (np.array([row[name] for row in self.rows]) for name in ("closure", "work"))
        columns: dict[str, list[Any]] = {}
        first_use = [min(s for s, used in enumerate(self.used) if n in used) for n in range(len(self.rows))]
        for row, state in enumerate(self.states):
            branches = [(b.sign, b.weight, self.numbers[b.force]) for b in state.branches]
            displacement = sum(sign * weight * (closure[0] - closure[n]) for sign, weight, n in branches)
            dissipated = sum(weight * work[n] for _, weight, n in branches)
            dissipated += sum(weight * work[self.numbers[force]] for weight, force in state.closed)
            latest, used = self.rows[self.latest[row]], [self.rows[n] for n in self.used[row]]
            new = [self.rows[n] for n in self.used[row] if first_use[n] == row]
            values = {
                "tangential_displacement": mu * self.ratio * displacement,  # (2)
                "stick_area": latest["stick_cells"] * cell,
                "slip_area": latest["slip_cells"] * cell,
                "tangential_stiffness": latest["stiffness"] / self.ratio,
                "dissipated_energy": mu * mu * self.ratio * dissipated * cell,
                "residual": max(solution["residual"] for solution in used),
                "converged": all(solution["converged"] for solution in used),
            }
            for name in ("iterations", "transforms", "run_time"):
                values[name] = sum(solution[name] for solution in new)
            for name, value in values.items():
                columns.setdefault(name, []).append(value)
        return {name: np.array(column) for name, column in columns.items()}

    def map(self, name: str) -> Array:
        """Return a map of all steps."""
        if name == "slip_state":
            return np.stack([self.state_maps[number] for number in self.latest])
        factor = self.friction * (1.0 if name.startswith("traction") else self.ratio)  # (1), (3)
        return np.asarray(self.fields[name[:-2]] * factor * self.unit[name.endswith("y")])


def coulomb_path(
    superposition: Superposition,
    forces: Array,
    poisson: float,
    tolerance: float,
    columns: dict[str, Array],
    names: Sequence[str],
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return columns and maps of the full method, each step from the superposition and the slip before it."""
    from fractalcontact.contact import _coulomb

    normal, contact, units = superposition.normal, superposition.contact, superposition.normal.path.units
    mu, unit = superposition.friction, np.array(superposition.unit)
    columns = {name: column.copy() for name, column in columns.items()}
    maps = {name: np.zeros((forces.size, *contact.shape)) for name in names if name != "slip_state"}
    state_maps = np.zeros((forces.size, *contact.shape), dtype=np.int8)
    if not contact.any():
        return columns, maps | {name: state_maps for name in names if name == "slip_state"}
    bound = mu * normal.solution.pressure[contact]
    force = normal.solution.force
    mean_displacement = max(normal.solution.work / force, force * normal.problem.local_compliance)
    scale = mu * mu * superposition.ratio * force * mean_displacement
    operator = _coulomb.TangentialOperator(contact, normal.path.body.spacing, poisson)
    slip, dissipated = np.zeros((2, bound.size)), 0.0
    for row, tangential in enumerate(forces.tolist()):
        start, transforms = perf_counter(), operator.transforms
        guess = superposition.fields["traction"][row][contact] * (mu / units.pressure)
        goal = unit * (tangential / units.force)
        step = _coulomb.coulomb_step(operator, bound, slip, goal, unit[:, None] * guess, scale, tolerance)
        dissipated += float(np.sum(step.q * (step.slip - slip)))
        slip = step.slip
        slips = np.hypot(*step.q) >= bound * (1 - _coulomb.AT_BOUND)
        state_maps[row][contact] = np.where(slips, np.int8(SLIP), np.int8(STICK))
        for name, planes in maps.items():
            values = step.q * units.pressure if name.startswith("traction") else slip * units.height
            planes[row][contact] = values[int(name.endswith("y"))]
        stiffness = math.inf
        if not contact.all() or slips.any():
            stiffness = _coulomb.stiffness(operator, step, bound, unit) * units.force / units.height
        cell = superposition.cell_area
        columns["tangential_displacement"][row] = float(step.displacement @ unit) * units.height
        columns["tangential_stiffness"][row] = stiffness
        columns["slip_area"][row] = np.count_nonzero(slips) * cell
        columns["stick_area"][row] = np.count_nonzero(~slips) * cell
        columns["dissipated_energy"][row] = dissipated * units.energy
        columns["residual"][row] = max(columns["residual"][row], step.residual)
        columns["converged"][row] &= step.converged
        columns["iterations"][row] += step.iterations
        columns["transforms"][row] += operator.transforms - transforms
        columns["run_time"][row] += perf_counter() - start
    return columns, maps | {name: state_maps for name in names if name == "slip_state"}


def press_sticking_punch(step: Step) -> Step | None:
    """Press a punch with the contact of `step` as its base; None where there is no contact.

    The derivative of the force by the closure is the stiffness of that punch, because a node at the edge of
    a contact bears no pressure. Away from the base the gap is more than the punch can close: its closure is
    at most that of `step`, whose stiffness grows with the load.
    """
    if step.force <= 0:
        return None
    depth = 4 * step.solution.closure + 1.0
    path = replace(
        step.path,
        gap=np.where(step.contact, 0.0, depth),
        control="normal_force",
        values=(step.force,),
        tolerance=max(step.path.tolerance, STIFFNESS_TOLERANCE),
    )
    return next(solve_path(path))


def stiffness_of(punch: Step) -> float:
    """Return force over closure, in N/m: infinite in full contact of a periodic body."""
    return punch.force / punch.closure if punch.closure > 0 else math.inf


def unit_vector(azimuth: float) -> tuple[float, float]:
    """Return (cos, sin) of an azimuth in degrees, exact along the axes."""
    turn = azimuth % 360.0
    if turn % 90.0 == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(turn // 90.0) % 4]
    return math.cos(math.radians(turn)), math.sin(math.radians(turn))
