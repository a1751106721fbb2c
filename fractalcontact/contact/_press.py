"""A rough surface pressed by a flat: the labelled entry to the contact solver."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.base.grid import Grid, contact_edges, read_grid
from fractalcontact.base.progress import track
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import CONTACT, CONTACT_MAPS, OPEN, STOP_REASONS, YIELDED
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.contact._load_path import ScaledPath, Step, solve_path
from fractalcontact.contact._options import CONTROLS, ContactOptions, LoadPath, check_scale
from fractalcontact.contact._scaling import make_units, scaled_body

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.contact.press"
UNDETERMINED = ("normal_force", "nominal_pressure", "elastic_energy", "residual", "pressure", "displacement")
BEYOND = "NaN where a periodic body is closed to its mean plane or beyond: no force is then determined"
PERIMETER = 0.118114160  # (pi - 1 + ln 2)/24, Yastrebov, Anciaux and Molinari (2017)


def _check(
    problems: Problems,
    *,
    surface: Any,
    contact_modulus: Any,
    keep: Any,
    progress: Any,
    closure: Any,
    normal_force: Any,
    nominal_pressure: Any,
    **keywords: Any,
) -> None:
    """Collect what is wrong with a call of `press`."""
    surface_is_valid = problems.surface("surface", surface)
    problems.number("contact_modulus", contact_modulus, above=0)
    if keep is not None:
        problems.choices("keep", keep, CONTACT_MAPS)
    problems.boolean("progress", progress)
    options = problems.construct(ContactOptions, **keywords)
    load = problems.construct(
        LoadPath.from_keywords,
        closure=closure,
        normal_force=normal_force,
        nominal_pressure=nominal_pressure,
    )
    if not surface_is_valid or options is None:
        return
    grid = read_grid(surface)
    options.check_grid(grid, problems)
    if load is None or problems.found:
        return
    height_range = float(surface.values.max()) - float(surface.values.min())
    check_scale(problems, grid, height_range, float(contact_modulus), options.hardness, load)
    options.check_load(load, grid.nominal_area, problems)


@public_result(title="Elastic contact of a rough surface", check=_check)
def press(
    surface: xr.DataArray,
    *,
    contact_modulus: float,
    closure: float | Sequence[float] | Array | None = None,
    normal_force: float | Sequence[float] | Array | None = None,
    nominal_pressure: float | Sequence[float] | Array | None = None,
    boundary: str | None = None,
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    hardness: float | None = None,
    tolerance: float = 1e-8,
    method: str = "fast",
    keep: Sequence[str] = ("state",),
    progress: bool = False,
) -> xr.Dataset:
    """Press a rigid flat down on a rough elastic surface, without friction or adhesion.

    The pair of bodies enters through its contact modulus alone, so the flat may stand for a second elastic
    body and the surface for the composite of two rough faces. The highest point of the surface touches at
    closure 0. In the solution gap >= 0, pressure >= 0 and one of them is zero at every node, with

        gap = (top - height) + settlement - closure.

    Heights count up; closure, settlement and indentation count down, into the surface; pressure is positive
    in compression.

    Parameters
    ----------
    surface : DataArray, dims (y, x)
        Heights in m, up; no NaN. At least 3 points along each axis; the spacings may differ.
    contact_modulus : float
        E* of the pair in Pa, see `effective_modulus`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach of the bodies from first touch (m), force (N), or force over the whole
        extent (Pa). A sequence is a path of load, which may go up and down. Each step starts from the
        solution before it, which changes iterations and not answers beyond the tolerance: an elastic surface
        has no memory.
    boundary : {None, "periodic", "free"}
        None: what the axes of the surface say. A periodic surface may be called free, never the reverse.
    influence : {None, "disc", "square", "spectral"}
        Settlement under the force on a node. "disc": a rigid circular plate (Borri-Brunetto et al. 1998),
        the default for free bodies; "square": uniform pressure on the cell (Love 1929); "spectral":
        2/(E* |q|), for periodic bodies, which have no other.
    disc_radius : {"second_order", "inscribed", "equal_area"} or float
        Radius of the plate, or a length in m. "second_order" makes the error quadratic in the spacing (0.4366
        of it on a square grid); it exists for spacings in a ratio of up to 2.
    hardness : float, optional
        Greatest pressure (Pa). Where it is reached the surface yields: the overlap of the bodies there is
        indentation, which stays. Unloading is elastic, loading back follows it, and yielding goes on where
        it ended; under a growing load the steps in between make no difference. A force of all of hardness
        times area determines the indentation from below only.
    tolerance : float
        Bound on `residual`, the scale-free optimality error: weighted open gap plus greatest overlap over the
        mean settlement (see Notes).
    method : {"fast", "elimination"}
        "fast": conjugate gradients with Fourier transforms; "elimination": the dense active set of the paper,
        for small faces.
    keep : sequence out of "state", "pressure", "gap", "displacement", "residual_height"
        Maps (step, y, x) to return: open, contact or yielded (int8 flags); pressure (Pa); gap (m, zero in
        contact); settlement (m; without its mean for a periodic body); and the heights (m) that the surface
        would have if it were unloaded after the step, lower than at first where it has yielded.
    progress : bool
        Show a bar over the steps.

    Returns
    -------
    Dataset over `step`
        Coordinates closure (m), normal_force (N), nominal_pressure (Pa); contact_area (m2, cells in contact),
        contact_fraction (raw), corrected_contact_fraction (perimeter-corrected), mean_gap (m), elastic_energy
        (J, half of pressure times settlement), with a hardness plastic_work (J, spent on indentation since
        the start of the path), iterations, transforms (pairs), residual, converged, stop_reason (int8 flags:
        converged, rounding, stagnated, iteration_limit, force_missed, beyond_full_contact), run_time (s); the
        maps; and scalars nominal_area (m2), contact_modulus (Pa), disc_radius (m, for "disc").

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call; also a force above hardness times area, and a load more than
        1e90 times larger or smaller than what the heights and the modulus set as its scale.

    Warns
    -----
    ConvergenceWarning
        A step stopped before its tolerance was met, or its force is not determined.

    Notes
    -----
    Under force control the closure is the pressure-weighted mean of gap and settlement, whose error is of
    second order in that of the pressure. For a periodic body the settlement has no mean, and
    closure = top - mean height - mean gap (with a hardness, mean residual height). Such a body cannot be
    closed to its mean plane or beyond: there the force and what hangs on it are NaN, with the reason in their
    attributes, everything is in contact, and the path goes on.

    The energy of the elastic body obeys d(elastic_energy) = normal_force d(closure); with a hardness the work
    of the force is d(elastic_energy) + d(plastic_work).

    A step stops as "converged"; at "rounding", where the tolerance asks for more than the rounding of the
    closure leaves; "stagnated" or at the "iteration_limit", short of the tolerance; with "force_missed",
    where the pressures do not add up to the force; or as "beyond_full_contact".

    The residual is (mean open gap weighted by pressure + greatest overlap) over the mean settlement weighted
    by pressure. It bounds the square of the relative error of the pressure in the energy norm; what that
    means for pressures, areas and closures is measured in the gallery.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3; Polonsky and Keer (1999), Wear 231:206;
    Stanley and Kato (1997), J. Tribol. 119:481; Bugnicourt et al. (2018), Tribol. Int. 121:69; Yastrebov,
    Anciaux and Molinari (2017), Tribol. Int. 114:161 (perimeter correction).
    """
    options = ContactOptions(boundary, influence, disc_radius, hardness, tolerance, method)
    load = LoadPath.from_keywords(
        closure=closure, normal_force=normal_force, nominal_pressure=nominal_pressure
    )
    grid = read_grid(surface)
    heights = np.asarray(surface.values, dtype=np.float64)
    path = _scaled_path(heights, grid, float(contact_modulus), options, load)
    names = word_tuple(keep)
    scalars: list[dict[str, Any]] = []
    maps: dict[str, list[Array]] = {name: [] for name in names}
    steps = solve_path(path)
    for _ in track(path.values, progress, "press"):
        step = next(steps)
        scalars.append(_scalars(step, grid, path.body.periodic))
        for name in names:
            maps[name].append(_map(step, name, heights))
    result = _dataset(surface, grid, path, scalars, maps)
    _explain(result)
    _warn(result)
    result.attrs = {
        "boundary": "periodic" if path.body.periodic else "free",
        "influence": path.body.influence,
        "achieved_residual": float(np.fmax.reduce(result["residual"].values)),
    }
    return result


def _scaled_path(
    heights: Array, grid: Grid, contact_modulus: float, options: ContactOptions, load: LoadPath
) -> ScaledPath:
    """Return the scaled problem with its load path."""
    control, values = load.solver_values(grid.nominal_area)
    spacing = (grid.spacing[0], grid.spacing[1])
    gap = heights.max() - heights
    units = make_units(spacing, float(gap.max()), contact_modulus, control, float(values.max()))
    gap /= units.height
    shape = (grid.shape[0], grid.shape[1])
    periodic, influence = options.is_periodic(grid), options.influence_on(grid)
    body = scaled_body(shape, spacing, periodic, influence, options.disc_radius)
    hardness = np.inf if options.hardness is None else options.hardness
    return ScaledPath(
        body, units, gap, control, tuple(values.tolist()), hardness, options.tolerance, options.method
    )


def _map(step: Step, name: str, heights: Array) -> Array:
    """One map of one step."""
    if name == "state":
        return _state(step)
    if name == "residual_height":
        return np.asarray(heights - step.indentation)
    return np.asarray(getattr(step, name))


def _state(step: Step) -> Array:
    """Flags open, contact, yielded."""
    state = np.where(step.contact, np.int8(CONTACT), np.int8(OPEN))
    state[step.contact & step.yielded] = YIELDED
    return state


def _scalars(step: Step, grid: Grid, periodic: bool) -> dict[str, Any]:
    """Scalars of one step."""
    contact = step.contact
    cells = int(np.count_nonzero(contact))
    edges = int(contact_edges(contact, (periodic, periodic)).sum())
    return {
        "closure": step.closure,
        "normal_force": step.force,
        "nominal_pressure": step.force / grid.nominal_area,
        "contact_area": cells * grid.cell_area,
        "contact_fraction": cells / contact.size,
        "corrected_contact_fraction": (cells - PERIMETER * edges) / contact.size,
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


def _dataset(
    surface: xr.DataArray,
    grid: Grid,
    path: ScaledPath,
    scalars: list[dict[str, Any]],
    maps: dict[str, list[Array]],
) -> xr.Dataset:
    """Return the Dataset over all steps."""
    columns = {name: ("step", np.array([step[name] for step in scalars])) for name in scalars[0]}
    coords: dict[str, Any] = {name: columns.pop(name) for name in CONTROLS}
    coords["step"] = np.arange(len(scalars))
    variables: dict[str, Any] = dict(columns)
    variables["nominal_area"] = grid.nominal_area
    variables["contact_modulus"] = path.units.modulus
    if not np.isfinite(path.hardness):
        del variables["plastic_work"]
    if path.body.influence == "disc":
        variables["disc_radius"] = path.body.radius * path.units.length
    if maps:
        coords |= {dim: surface.coords[dim].variable for dim in ("y", "x")}
        variables |= {name: (("step", "y", "x"), np.stack(planes)) for name, planes in maps.items()}
    return xr.Dataset(variables, coords)


def _explain(result: xr.Dataset) -> None:
    """Give the reason beside what is not determined."""
    beyond = result["stop_reason"] == STOP_REASONS["beyond_full_contact"]
    if beyond.any():
        for name in UNDETERMINED:
            if name in result.variables:
                result[name].attrs["reason"] = BEYOND


def _warn(result: xr.Dataset) -> None:
    """Say which steps did not converge."""
    failed = np.flatnonzero(~result["converged"].values)
    if failed.size:
        words, why = list(STOP_REASONS), result["stop_reason"].values
        reasons = ", ".join(
            f"step {i}: {words[why[i]]} (residual {result['residual'].values[i]:.2g})" for i in failed[:5]
        )
        more = f" and {failed.size - 5} more" if failed.size > 5 else ""
        warnings.warn(f"{WHERE}: not converged: {reasons}{more}", ConvergenceWarning, stacklevel=4)
