"""Partial slip of a rough contact under a tangential force: `partial_slip`.

By superposition of normal solutions (`_superposition`), or by Coulomb's law at every node (`_coulomb`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_direction, read_direction
from fractalcontact.base.grid import Grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.contact import solver
from fractalcontact.contact._problem import ContactProblem, check_problem


def _check(problems: Problems) -> tuple[ContactProblem, solver.ShearPath] | None:
    given = problems.given
    problems.number("poisson", above=-1, at_most=0.5)
    solver.check_shear(problems)
    check_direction(problems)
    problem = check_problem(problems, method="fast")
    if problem is None or problems.messages:
        return None
    friction, poisson = given.friction_coefficient, given.poisson
    path = solver.ShearPath.read(given.tangential_force, given.direction, friction, poisson, given.method)
    if problem.load.control != "closure":
        normal_force = problem.load.solver_values(problem.grid.nominal_area)[1]
        solver.check_sliding(problems, path, float(normal_force[0]))
    return problem, path


@public_result(
    title="Partial slip of a rough contact",
    references="Ciavarella (1998), J. Appl. Mech. 65:998; Jaeger (1998), J. Appl. Mech. 65:1019",
    check=_check,
    memory=320.0,  # of a free body, a fourth in contact; a periodic one takes 176. See `solver.FULL_BYTES`
)
@takes_checked
def partial_slip(
    checked: tuple[ContactProblem, solver.ShearPath],
    /,
    surface: xr.DataArray,
    *,
    contact_modulus: float,
    poisson: float,
    friction_coefficient: float,
    tangential_force: float | Sequence[float] | Array,
    closure: float | None = None,
    normal_force: float | None = None,
    nominal_pressure: float | None = None,
    direction: str | float = "E",
    method: str | None = None,
    boundary: str | None = None,
    influence: str | None = None,
    disc_radius: str = "second_order",
    tolerance: float = DEFAULT_TOLERANCE,
    keep: str | Sequence[str] = ("slip_state",),
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
        Poisson's ratio of both bodies, or of the only elastic one.
    friction_coefficient : float
        mu, above 0.
    tangential_force : float or sequence of float
        Force on the upper body (N) at each step, up and down from zero, positive towards `direction`; at most
        mu times the normal force.
    closure, normal_force, nominal_pressure : float
        Exactly one of them, as for `press`: the normal load, under which the force stays constant.
    direction : str or float
        Direction of the tangential force: compass word, or degrees anticlockwise from E (+x).
    method : {None, "superposition", "full"}
        Ciavarella and Jaeger: one normal solution for each new tangential force. Or Coulomb's law at every
        node with x and y coupled, from there; a step takes the transforms of some three normal solutions.
        None: "full" where the contact has a lay, so that `superposition_error` is above 3 %.
    boundary, influence, disc_radius, tolerance
        As for `press`.
    keep : any of "slip_state", "traction_x", "traction_y", "slip_x", "slip_y"
        Maps (step, y, x) to return: flags open, stick, slip; traction on the surface (Pa); slip since the
        start of the path (m), 0 where open.
    progress : bool
        Show a progress bar over the normal solutions.

    Returns
    -------
    Dataset over `step`
        Coordinates tangential_force, and closure, normal_force and nominal_pressure of the normal load;
        tangential_displacement (m), stick_area, slip_area (m2), tangential_stiffness (N/m), dissipated_energy
        (J), iterations, transforms, residual, converged, run_time; the maps; superposition_error,
        contact_area, nominal_area, contact_modulus, poisson, friction_coefficient, disc_radius ("disc").

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call, such as a tangential force beyond sliding.

    Warns
    -----
    ConvergenceWarning
        A solution stopped before its tolerance was met.
    AnisotropyWarning
        "superposition" was asked for where its error is above 3 %.

    Notes
    -----
    A node sticks if it has not slipped since the last reversal of the force ("full": in the step). The
    superposition is exact for poisson = 0. It leaves out slip across the force and has one compliance for all
    directions: within a few per cent on isotropic surfaces. Under a lay, displacement and dissipated energy
    are up to (2 - nu)/(2 - 2 nu) times the true ones across it, down to 1 - nu/2 times along it. Neither
    method has the change of the pressure between dissimilar bodies. A change of the force below `tolerance`
    times the normal force is not resolved. The stiffness is that of a further step, zero where all slides;
    "full" may give that of a loop that has just closed. Of periodic bodies in full contact it is NaN.

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
    problem, path = checked
    grid, heights = problem.grid, np.asarray(surface.values, dtype=np.float64)
    sheared = solver.solve_shear(heights, *problem, path, keep=word_tuple(keep), progress=progress)
    result = _dataset(surface, grid, sheared).assign(
        contact_modulus=problem.contact_modulus,
        poisson=path.poisson,
        friction_coefficient=path.friction,
        superposition_error=sheared.superposition_error,
    )
    towards = read_direction(direction)
    result = result.assign_coords(
        tangential_force=("step", np.array(path.forces)), direction=towards.name, azimuth=towards.azimuth
    )
    stiffness = result["tangential_stiffness"]
    result["tangential_stiffness"] = stiffness.where(np.isfinite(stiffness))
    if sheared.method == "superposition":
        solver.warn_lay("fractalcontact.contact.partial_slip: the contact", sheared.superposition_error)
    residual = float(np.fmax.reduce(result["residual"].values))
    stated = {"method": sheared.method, **problem.options.stated_on(grid)}
    stated["solver"] = sheared.normal.solution.solver
    result.attrs.update(stated, achieved_residual=residual)
    return result


def _dataset(surface: xr.DataArray, grid: Grid, sheared: solver.Sheared) -> xr.Dataset:
    """Return the Dataset over all steps."""
    variables: dict[str, Any] = {name: ("step", column) for name, column in sheared.columns.items()}
    variables["contact_area"] = sheared.contact_area
    variables["nominal_area"] = grid.nominal_area
    if sheared.disc_radius is not None:
        variables["disc_radius"] = sheared.disc_radius
    coords: dict[str, Any] = {
        "step": np.arange(sheared.columns["residual"].size),
        "closure": sheared.normal.closure,
        "normal_force": sheared.normal.force,
        "nominal_pressure": sheared.normal.force / grid.nominal_area,
    }
    if sheared.maps:
        coords |= {dim: surface.coords[dim].variable for dim in ("y", "x")}
        variables |= {name: (("step", "y", "x"), planes) for name, planes in sheared.maps.items()}
    return xr.Dataset(variables, coords)
