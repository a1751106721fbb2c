"""Partial slip of a rough contact under a tangential force: `partial_slip`.

By superposition of normal solutions (`_superposition`), or by Coulomb's law at every node (`_coulomb`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.memory import Plane, map_bytes
from fractalcontact.base.numbers import float_array
from fractalcontact.base.progress import track
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import SLIP_MAPS
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.contact._load_path import Step, scaled_path, solve_path
from fractalcontact.contact._options import ContactOptions, LoadPath, check_scale, is_periodic
from fractalcontact.contact._superposition import (
    FORCE_ROUNDING,
    Superposition,
    reduced_forces,
    shear_states,
    solve_reduced,
)

Array = np.ndarray[Any, np.dtype[Any]]

# bytes of a node at the peak, of a periodic and of a free body: by superposition, and with both directions
NORMAL_BYTES, FULL_BYTES = (126.0, 248.0), (176.0, 320.0)
METHODS = ("superposition", "full")
BELOW_SLIDING = 1e-6  # relative distance from sliding, where the full displacement grows without bound
GREATEST_FRICTION = 1e3
START_TOLERANCE = 1e-2  # of the superposition from which the full method starts


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
    problems.choice("method", method, METHODS)
    problems.choices("keep", keep, SLIP_MAPS)
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


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the normal and the tangential solution, and of the maps."""
    periodic = is_periodic(arguments.get("boundary"), plane.periodic)
    solver = (FULL_BYTES if arguments.get("method") == "full" else NORMAL_BYTES)[0 if periodic else 1]
    maps = sum(map(map_bytes, word_tuple(arguments.get("keep"))))
    return plane.cells * (solver + 2.0 * maps * np.size(arguments.get("tangential_force", 0.0)))


@public_result(
    title="Partial slip of a rough contact",
    references="Ciavarella (1998), J. Appl. Mech. 65:998; Jaeger (1998), J. Appl. Mech. 65:1019",
    check=_check,
    memory=_memory,
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
        Ciavarella and Jaeger: one normal solution for each new tangential force. Or Coulomb's law at every
        node with x and y coupled, from there; a step takes the transforms of some three normal solutions.
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
    same direction, zero where all slides. Displacements of periodic bodies are without those of the bulk: in
    full contact their stiffness has no bound, and is NaN.

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

    path = scaled_path(heights, grid, modulus, options, load)
    is_full = method == "full"
    pressed = next(solve_path(path)) if is_full or path.control == "closure" else None
    normal = path.values[0] if pressed is None else pressed.force
    if path.control == "closure":
        _check_closure(load, forces, friction, normal, method)
    states = shear_states(forces)
    reduced, numbers = reduced_forces(states, normal, friction)
    ratio = (2 - float(poisson)) / (2 - 2 * float(poisson))  # lambda: tangential over normal compliance
    unit = unit_vector(float(azimuth))
    wanted = ("traction_x",) if is_full else names  # where the full method starts from
    superposition = Superposition(
        states, numbers, friction, ratio, unit, grid.cell_area, wanted, stiffness=not is_full
    )
    steps = solve_reduced(path, reduced, pressed, START_TOLERANCE if is_full else tolerance)
    for step in track(steps, progress, "partial_slip", total=len(reduced)):
        superposition.add(step)
    columns = superposition.columns()
    if is_full:
        columns, maps = _solve_fully(superposition, forces, float(poisson), columns, names)
    else:
        maps = {name: superposition.map(name) for name in names}
    result = _dataset(surface, grid, superposition.normal, columns, maps)
    result = result.assign(
        contact_modulus=modulus, poisson=float(poisson), friction_coefficient=friction
    ).assign_coords(tangential_force=("step", forces), azimuth=float(azimuth))
    stiffness = result["tangential_stiffness"]
    result["tangential_stiffness"] = stiffness.where(np.isfinite(stiffness))
    _warn(result)
    result.attrs = {
        "method": method,
        "boundary": "periodic" if options.is_periodic(grid) else "free",
        "influence": options.influence_on(grid),
        "achieved_residual": float(np.fmax.reduce(result["residual"].values)),
    }
    return result


def _solve_fully(
    superposition: Superposition,
    forces: Array,
    poisson: float,
    columns: dict[str, Array],
    names: Sequence[str],
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return columns and maps of the full method, which starts from the superposition at every step."""
    from fractalcontact.contact._coulomb import coulomb_path, empty_maps
    from fractalcontact.contact._tangential_operator import TangentialOperator

    normal, contact = superposition.normal, superposition.contact
    maps = empty_maps(names, (forces.size, *contact.shape))
    if contact.any():
        operator = TangentialOperator(normal.path.body, contact, poisson)
        law = (superposition.friction, np.array(superposition.unit))
        coulomb_path(normal, operator, forces, superposition.traction(), *law, columns, maps)
    return columns, maps


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


def unit_vector(azimuth: float) -> tuple[float, float]:
    """Return (cos, sin) of an azimuth in degrees, exact along the axes."""
    turn = azimuth % 360.0
    if turn % 90.0 == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(turn // 90.0) % 4]
    return math.cos(math.radians(turn)), math.sin(math.radians(turn))
