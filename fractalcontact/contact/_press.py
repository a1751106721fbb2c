"""Elastic contact of a rough surface with a flat: `press`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import SHARE, Plane, in_bands, limit, thread_count
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import CONTACT_MAPS, DEFAULT_TOLERANCE, STOP_REASONS
from fractalcontact.base.signals import track
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.contact import solver
from fractalcontact.contact._problem import CONTROLS, ContactProblem, check_problem, is_periodic

UNDETERMINED = (
    "normal_force", "nominal_pressure", "elastic_energy", "residual", "pressure", "displacement",
    "maximum_pressure", "area_share", "load_share",
)  # fmt: skip
BEYOND_REASON = "NaN where a periodic body is closed to its mean plane or beyond: no force is then determined"
INCLUDE = ("stiffness", "pressure_distribution")
NO_STIFFNESS = (
    "NaN in complete contact of periodic bodies, which has no bound, and where no force is determined"
)


def _check(problems: Problems) -> ContactProblem | None:
    problems.choices("keep", among=CONTACT_MAPS, optional=True)
    problems.choices("include", among=INCLUDE)
    problem = check_problem(problems, leading=True)
    dims = getattr(problems.given.surface, "dims", ())
    problems.require("step" not in dims, "surface.dims", "no dim step, along which the loads are", dims)
    return problem


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the solver on the planes that are pressed at once."""
    # bytes of a node as measured: the solver with the steps before, indentation, one more solution
    node = 88.0 if is_periodic(arguments.get("boundary"), plane.periodic) else 196.0
    node += 64.0 if arguments.get("hardness") else 0.0
    node += 72.0 if "stiffness" in word_tuple(arguments.get("include")) else 0.0
    return node * plane.cells / plane.planes * min(plane.planes, thread_count())


@public_result(
    title="Elastic contact of a rough surface",
    reasons=dict.fromkeys(("contact_stiffness", "relative_conductance"), NO_STIFFNESS),
    check=_check,
    memory=_memory,
)
@takes_checked
def press(
    problem: ContactProblem,
    /,
    surface: xr.DataArray,
    *,
    contact_modulus: float,
    closure: float | Sequence[float] | Array | None = None,
    normal_force: float | Sequence[float] | Array | None = None,
    nominal_pressure: float | Sequence[float] | Array | None = None,
    boundary: str | None = None,
    influence: str | None = None,
    disc_radius: str = "second_order",
    hardness: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    method: str = "fast",
    keep: str | Sequence[str] = ("state",),
    include: str | Sequence[str] = (),
    progress: bool = False,
) -> xr.Dataset:
    """Press a rigid flat down on a rough elastic surface, without friction or adhesion.

    At every node gap >= 0 and pressure >= 0, and one of them is zero, with gap = (top - height) +
    displacement - closure and top the greatest height. Heights count up, closure and displacement down;
    pressure is positive in compression. Theory and measured accuracy: page `theory_contact`.

    Parameters
    ----------
    surface : DataArray, dims (..., y, x)
        Heights in m, without NaN; at least 3 points along each axis. Each plane is pressed by itself.
    contact_modulus : float
        E* of the pair of bodies in Pa, see `effective_modulus`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach from first touch (m), force (N), or force over the whole extent (Pa). A
        sequence is a load path, which may go up and down.
    boundary : {None, "periodic", "free"}
        None: periodic where both axes are. "free" is always allowed, and needed where one axis alone is.
    influence : {None, "disc", "square", "spectral"}
        Influence coefficients of free bodies: rigid circular plates (the default) or uniform pressure on
        square cells (Love 1929); of periodic bodies: 2/(E* |q|).
    disc_radius : {"second_order", "inscribed", "equal_area"}
        Radius of the plates. "second_order" makes the error quadratic in the spacing.
    hardness : float, optional
        Largest pressure H (Pa). Gap = 0 where 0 < p < H; where p = H the overlap stays as indentation.
    tolerance : float
        Bound on `residual`, the scale-free optimality error.
    method : {"fast", "elimination"}
        Constrained conjugate gradients, or the dense active set of the 1998 paper for small surfaces.
    keep : any of "state", "pressure", "gap", "displacement", "residual_height"
        Maps (step, y, x) to return: flags (yielded: at the hardness); Pa; m; m; heights after unloading (m).
    include : any of "stiffness", "pressure_distribution"
        Further results: stiffness and conductance, from one more solution a step; shares of the pressures.
    progress : bool
        Show a progress bar over the steps.

    Returns
    -------
    Dataset over the leading dims and `step`
        Coordinates closure, normal_force, nominal_pressure; contact_area (m2), contact_fraction,
        corrected_contact_fraction, mean_gap (m), elastic_energy, plastic_work (J; with a hardness),
        iterations, transforms, residual, converged, stop_reason, run_time (s); the maps; nominal_area (m2),
        contact_modulus, rms_slope, disc_radius (m). NaN: a periodic body closed beyond its mean plane.
        "stiffness": contact_stiffness (Pa m-1), dp/dclosure of unloading; over E* relative_conductance (m-1).
        "pressure_distribution": maximum_pressure (Pa); over pressure_class area_share and load_share.

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call, such as a force above hardness times area.

    Warns
    -----
    ConvergenceWarning
        A step stopped before its tolerance was met, or its force is not determined.
    SmallStrainWarning
        The rms slope of the surface is above 0.3: strains, about half of it, are not small.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3 ("elimination"); Polonsky and Keer (1999), Wear
    231:206 ("fast"); Stanley and Kato (1997), J. Tribol. 119:481 (periodic); Love (1929), Phil. Trans. A
    228:377 ("square"); Yastrebov, Anciaux and Molinari (2017), Tribol. Int. 114:161 (corrected area); Barber
    (2003), Proc. R. Soc. A 459:53 (conductance, see page `theory_contact`).

    Examples
    --------
    The force on a ball of radius 1 m, over that of Hertz:

    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> x = 1e-4 * np.arange(-20, 21)
    >>> ball = fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / 2, 1e-4)
    >>> pressed = fc.contact.press(ball, contact_modulus=1e9, closure=2e-6)
    >>> round(float(pressed["normal_force"][0]) / (4 / 3 * 1e9 * 2e-6**1.5), 3)
    1.0
    """
    grid, options = problem.grid, problem.options
    heights = np.asarray(surface.values, dtype=np.float64)
    names, further = word_tuple(keep), word_tuple(include)

    def pressed(plane: Array, progress: bool) -> solver.Pressed:
        return solver.solve(plane, *problem, keep=names, include=further, progress=progress)

    stack = heights.reshape(-1, *grid.shape)
    planes = _pressed_planes(stack, pressed, progress)
    slopes = [solver.rms_slope(plane, grid) for plane in stack]
    result = _dataset(surface, problem, planes, slopes)
    _add_reasons(result)
    solver.warn_steep("fractalcontact.contact.press: the surface", max(slopes))
    # `public_result` moves these attributes into the provenance of the result; it sets `run_time` only where
    # the result has none, and here each step has its own
    residual = float(np.fmax.reduce(result.variables["residual"].values, axis=None))
    solvers = solver.solvers_in_words(name for plane in planes for name in plane.solvers)
    stated = {"references": options.references(grid), **options.stated_on(grid), "solver": solvers}
    result.attrs.update(stated, achieved_residual=residual)
    return result


def _pressed_planes(
    planes: Array,
    pressed: Callable[[Array, bool], solver.Pressed],
    progress: bool,
    *,
    small: int = 512 * 512,  # nodes
    # surfaces for each thread between two steps of the progress bar; 2 and 32 took 1.15 and .86 of the
    # processor time with 64 surfaces of 64 x 64 points, once each
    side_by_side: int = 8,
) -> list[solver.Pressed]:
    """Press all planes: small ones side by side on a thread each, large ones one after the other."""
    if len(planes) == 1:
        return [pressed(planes[0], progress)]
    together = side_by_side * thread_count() if planes[0].size <= small else 1
    results: dict[int, solver.Pressed] = {}

    def press_some(start: int, stop: int, first: int) -> None:
        with limit(1):
            for number in range(first + start, first + stop):
                results[number] = pressed(planes[number], False)

    for first in track(range(0, len(planes), together), progress, "press", unit="group of surfaces"):
        count = min(together, len(planes) - first)
        if count > 1:
            in_bands(press_some, count, count * SHARE, first)
        else:
            results[first] = pressed(planes[first], False)
    return [results[number] for number in range(len(planes))]


def _dataset(
    surface: xr.DataArray,
    problem: ContactProblem,
    planes: Sequence[solver.Pressed],
    slopes: Sequence[float],
) -> xr.Dataset:
    """Return the Dataset over all planes and steps."""
    grid, load = problem.grid, problem.load
    leading, lengths, steps = surface.dims[:-2], surface.shape[:-2], len(load.values)
    variables: dict[str, Any] = {}
    for name in planes[0].columns:
        values = np.stack([plane.columns[name] for plane in planes])
        dims = ("step", "pressure_class")[: values.ndim - 1]
        variables[name] = ((*leading, *dims), values.reshape(*lengths, *values.shape[1:]))
    imposed = ("closure",) if load.control == "closure" else ("normal_force", "nominal_pressure")
    variables |= {name: ("step", planes[0].columns[name]) for name in imposed}
    coords = leading_coords(surface, leading, (*variables, "step"))
    coords |= {name: variables.pop(name) for name in CONTROLS}
    coords[load.control] = ("step", np.array(load.values))  # as given, without rounding
    coords["step"] = np.arange(steps)
    if "area_share" in variables:
        coords["pressure_class"] = (np.arange(solver.PRESSURE_CLASSES) + 0.5) / solver.PRESSURE_CLASSES
    variables["nominal_area"] = grid.nominal_area
    variables["contact_modulus"] = problem.contact_modulus
    variables["rms_slope"] = (leading, np.array(slopes).reshape(lengths))
    if planes[0].disc_radius is not None:
        variables["disc_radius"] = planes[0].disc_radius
    for name in planes[0].maps:
        maps = planes[0].maps[name] if len(planes) == 1 else np.stack([plane.maps[name] for plane in planes])
        variables[name] = ((*leading, "step", "y", "x"), maps.reshape(*lengths, steps, *grid.shape))
    if planes[0].maps:
        coords |= {dim: surface.coords.variables[dim] for dim in ("y", "x")}
    return xr.Dataset(variables, coords)


def _add_reasons(result: xr.Dataset) -> None:
    """Give the reason of NaN beside what is not determined."""
    if (result.variables["stop_reason"].values == STOP_REASONS["beyond_full_contact"]).any():
        for name in UNDETERMINED:
            if name in result.variables:
                result[name].attrs["reason"] = BEYOND_REASON
