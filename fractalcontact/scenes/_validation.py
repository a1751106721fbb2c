"""Validation of a scene together with its surfaces, before anything is computed or written.

The options that the study will use are constructed (`joints.Crack`), and the `validate` of every public
function that it will call is given the arguments of that call. Valid values that suggest a mistake in a unit
give a warning.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import xarray as xr

from fractalcontact.base.errors import FractalContactError, InvalidInput, ScaleWarning, TooLittleMemory, warn
from fractalcontact.base.grid import UNIFORM, distinct, plane_coords, read_grid
from fractalcontact.base.numbers import real_numbers
from fractalcontact.base.resources import require_memory
from fractalcontact.base.schema import label
from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import Problems, Words
from fractalcontact.scenes import _inputs
from fractalcontact.scenes._scene import LOADS, Scene, SurfaceTable
from fractalcontact.scenes._scene_file import check_tables, parse, scans_of
from fractalcontact.scenes._scene_keys import GENERATORS
from fractalcontact.scenes._stage_type import StageType, arguments_of, parameters_of, public_function
from fractalcontact.scenes._stages import STAGES, WANTED, stages_of

if TYPE_CHECKING:
    from fractalcontact.joints import Crack

INPUTS = ("surface", "crack", "mask", "gap", "contact_modulus")  # that earlier tables or stages make


def validate(scene: Scene | str | os.PathLike[str]) -> Scene:
    """Find all problems of a scene before anything is computed or written.

    The surfaces are read or generated for that; a large generated one is replaced by a flat one of its size.
    Of many scans the first one that fits the scene is read.

    Parameters
    ----------
    scene : Scene or path-like

    Returns
    -------
    Scene

    Warns
    -----
    ScaleWarning
        A slope or a pressure is implausible: a value in another unit, for example.

    Raises
    ------
    InvalidInput
        Lists all problems of the tables, the surfaces, the block, the material and the loads together.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> fc.scenes.validate("rigid_sliding").name
    'rigid_sliding'
    """
    return validated(scene)[0]


def validated(scene: Scene | str | os.PathLike[str]) -> tuple[Scene, dict[str, xr.DataArray]]:
    """Return a valid scene, and its faces that were read from files."""
    with Problems("fractalcontact.scenes.validate") as problems:
        expected = "a Scene or the path of a TOML file"
        problems.require(isinstance(scene, (Scene, str, os.PathLike)), "scene", expected, scene)
    scene, problems = check_tables(scene) if isinstance(scene, Scene) else parse(scene)
    if not problems.messages and (scans := scans_of(scene)):
        _require_valid_scan(scans)
        return scene, {}
    with problems:
        if not _is_valid(problems, "material"):
            tables = {key: table for key, table in scene.tables.items() if key != "material"}
            scene = replace(scene, tables=tables)
        if not _is_valid(problems, "want"):
            scene = _with_possible_want(scene)
        surfaces = _validate_surfaces(scene, problems)
        _validate_calls(scene, surfaces, _valid_crack(scene, surfaces, problems), problems)
    warn_of_input(scene, surfaces["surface"])
    return scene, {name: face for name, face in surfaces.items() if "generate" not in scene.table(name)}


def validate_placed(scene: Scene, lower: xr.DataArray, upper: xr.DataArray) -> None:
    """Find all problems of the calls of a joint whose faces have been registered.

    Raises
    ------
    InvalidInput
        The faces overlap on less than the block, for example.
    """
    joint = {**scene.table("joint"), "register": False}
    placed = replace(scene, tables={**scene.tables, "joint": joint})
    surfaces = {"surface": lower, "upper": upper}
    with Problems("fractalcontact.scenes.run") as problems:
        _validate_calls(placed, surfaces, _valid_crack(placed, surfaces, problems), problems)


def _require_valid_scan(scans: Mapping[str, Scene]) -> None:
    """Raise the problems of the first of several scans, unless the scene fits at least one of them."""
    first: FractalContactError | None = None
    for scan in scans.values():
        try:
            validate(scan)
        except FractalContactError as error:
            first = first or error
        else:
            return
    if first is not None:
        raise first


@contextmanager
def _collected(
    problems: Problems, place: str, *tables: str, ignored: Sequence[str] = INPUTS
) -> Iterator[None]:
    """Collect the problems of a call, but for its inputs and for values that the tables were told of.

    An input that could not be made is passed as None, so that the other arguments are checked all the same.
    """
    try:
        yield
    except TooLittleMemory:
        pass  # the plan states it, and `run` refuses it with what the study holds beside the call
    except InvalidInput as error:
        for line in error.problems:
            argument = line.partition(":")[0].partition(".")[0]
            if argument not in ignored and not any(
                f"{table}.{argument}" in problems.arguments for table in tables
            ):
                problems.note(f"{tables[0] or place}.{argument}", f"{place}: {line}")


def _with_possible_want(scene: Scene) -> Scene:
    """Return a scene that wants what its tables are for, in place of words that were refused.

    Otherwise a wrong word would hide the problems of the calls.
    """
    want = {name: [word for word in scene.wanted(name) if word in words] for name, words in WANTED.items()}
    for row in STAGES.values():
        name, _, word = row.table.partition(".")
        if row.table and row.wanted and (word in scene.table(name) if word else name in scene.tables):
            group, _, asked = row.wanted.partition(".")
            want[group].append(asked)
    if "dimensions" in scene.tables:
        want["dimensions"] = ["default"]
    possible = {name: list(dict.fromkeys(words)) for name, words in want.items() if words}
    return replace(scene, tables={**scene.tables, "want": possible})


def _is_valid(problems: Problems, *keys: str) -> bool:
    """Return whether these keys of the scene, with their tables and sub-tables, passed the checks so far."""
    pairs = [(f"{key}.", f"{failed}.") for key in keys for failed in problems.arguments]
    return not any(key.startswith(failed) or failed.startswith(key) for key, failed in pairs)


def _validate_surfaces(scene: Scene, problems: Problems) -> dict[str, xr.DataArray]:
    """Return the valid surfaces of the scene; of an ensemble one."""
    surfaces: dict[str, xr.DataArray] = {}
    for name, table in (("surface", scene.surface), ("upper", scene.upper)):
        if table is None:
            continue
        if generator := _generator(table):
            with _collected(problems, name, name):
                _validate_call(f"surfaces.{generator}", **_inputs.generator_options(table))
        if _is_valid(problems, name) and (name == "surface" or scene.want.joints):
            with problems.collect(f"{name}: "):
                flat = _flat_surface(table)
                lower = surfaces.get("surface")
                made = _inputs.read_surface(table, scene.folder, lower) if flat is None else flat
                # a generator may reach sizes that float64 does not hold
                if problems.surface(name, made, finite=False, smallest=1, leading=True):
                    surfaces[name] = made
    if set(surfaces) == {"surface", "upper"}:
        if scene.joint.register:
            _require_square_cells(surfaces["surface"], problems)
        else:
            require_above(surfaces["upper"], surfaces["surface"], problems)
    return surfaces


def _require_square_cells(lower: xr.DataArray, problems: Problems) -> None:
    """Require cells that a face can be turned on."""
    steps = read_grid(lower).spacing
    expected = "one spacing along x and y, to turn a face; or register = false (--as-scanned)"
    got = Words(" and ".join(quantity_text(step, "m") for step in steps[::-1]))
    problems.require(abs(steps[0] / steps[1] - 1.0) <= UNIFORM, "joint.register", expected, got)


def require_above(upper: xr.DataArray, lower: xr.DataArray, problems: Problems) -> None:
    """Require that the upper face lies above the lower one on average."""
    mean = float((upper - lower).mean())
    expected = "an upper face above the lower one: swap them ([surface] and [upper]), or register them"
    problems.require(not mean < 0, "upper", expected, Words(f"a mean aperture of {quantity_text(mean, 'm')}"))


def _generator(table: SurfaceTable) -> str | None:
    """Return the generator of a table; for an unknown one the first that takes all its arguments."""
    if table.generate is None or table.generate in GENERATORS:
        return table.generate
    keys = {name: arguments_of(f"surfaces.{name}")[0] for name in GENERATORS}
    return next((name for name in GENERATORS if set(table.options) <= set(keys[name])), None)


def _flat_surface(table: SurfaceTable) -> xr.DataArray | None:
    """Return a flat surface in place of a large generated one; None for all others."""
    if table.generate is None:
        return None
    shape = table.options["shape"]
    if math.prod(shape) < 1 << 18:  # points: made twice in little time
        return None
    needed = 24.0 * sum(shape)  # bytes of a coordinate while it is made
    require_memory("surface", needed, f"the coordinates of {shape[0]} x {shape[1]} points")
    coords = plane_coords(shape, np.broadcast_to(table.options["spacing"], 2).tolist(), (False, False))
    # one number in memory, whatever its size
    return label(xr.DataArray(np.broadcast_to(0.0, shape), coords, ("y", "x"), name="height"))


def _valid_crack(scene: Scene, surfaces: dict[str, xr.DataArray], problems: Problems) -> Crack | None:
    """Return the crack of the scene, None without a valid one."""
    joint_presses = bool(scene.want.domains) and not scene.is_pressed
    slides = any(STAGES[f"joints/{name}"].takes != "surface" for name in scene.want.joints)
    if not (slides or joint_presses) or not _is_valid(problems, "material", "joint.block"):
        return None
    if "surface" not in surfaces or (scene.want.joints and scene.upper and "upper" not in surfaces):
        return None
    with problems.collect("joint: "):
        return _inputs.crack_of(scene, surfaces["surface"], surfaces.get("upper"))
    return None


def _validate_calls(
    scene: Scene, surfaces: dict[str, xr.DataArray], crack: Crack | None, problems: Problems
) -> None:
    """Validate every call of the study; zeros replace the result of an earlier stage."""
    surface = surfaces.get("surface")
    # which loads are possible depends on the heights
    is_flat = surface is not None and _flat_surface(scene.surface) is not None
    for stage in stages_of(scene):
        row, subject = stage.row, cast(Any, surface)
        if row.takes in ("file", "result", "study") or (row.takes == "crack" and scene.joint.register):
            continue
        ignored = (*INPUTS, *LOADS) if is_flat and row.presses else INPUTS
        with _collected(problems, stage.name, row.table, row.table.partition(".")[0], ignored=ignored):
            if row.takes == "crack":
                subject = crack
                has_own = "block" in _inputs.own_values(scene, row)
                if crack is not None and has_own and _is_valid(problems, f"{row.table}.block"):
                    subject = _inputs.crack_of(scene, surfaces["surface"], surfaces.get("upper"), row)
            elif row.takes == "map":
                subject = _empty_maps(scene, surface, crack, row)
            _validate_call(row.function, subject, **_inputs.call_options(scene, row, stage.keep))


def _validate_call(name: str, *arguments: Any, **options: Any) -> None:
    """Validate a call that has all arguments it needs; what is missing was noted before."""
    parameters = parameters_of(name)  # an unknown key was noted before
    if "contact_modulus" in parameters:
        options.setdefault("contact_modulus", None)  # of a material that is not valid
    options = {key: value for key, value in options.items() if key in parameters}
    others = list(parameters.values())[len(arguments) :]
    if all(each.name in options for each in others if each.default is each.empty):
        public_function(name).validate(*arguments, **options)  # type: ignore[attr-defined]


def _empty_maps(
    scene: Scene, surface: xr.DataArray | None, crack: Crack | None, row: StageType
) -> xr.DataArray | None:
    """Return maps of zeros on the grid of the contact, that of the surface or of the block.

    States have two steps, and gaps the load path of the closure, whatever its load.
    """
    plane = surface if scene.is_pressed and row.reads == "state" else None
    if plane is None and crack is not None:
        rows, columns = crack.layout.slices
        plane = crack.lower.isel(y=rows, x=columns)
    if plane is None:
        return None
    if row.reads == "state":
        return plane.copy(data=np.broadcast_to(False, plane.shape)).expand_dims(step=2)
    options = _inputs.stage_options(scene, STAGES["joints/closure"])
    path = next((real_numbers(options[key]) for key in LOADS if key in options), None)
    if path is None or path.ndim > 1:  # a problem of the closure, which is listed there
        path = np.zeros(1)
    gap = plane.copy(data=np.broadcast_to(0.0, plane.shape)).expand_dims(step=path.size)
    return gap.assign_coords(nominal_pressure=("step", path.astype(float)))


def _rms_slope(heights: np.ndarray[Any, Any], spacing: Sequence[float]) -> float:
    squares = [
        np.nanmean((np.diff(heights, axis=axis) / spacing[axis]) ** 2)
        for axis in (0, 1)
        if heights.shape[axis] > 1
    ]
    return float(np.sqrt(np.sum(squares)))


def warn_of_input(scene: Scene, surface: xr.DataArray) -> None:
    """Warn of implausible values of a scene and its surface."""
    grid, material = read_grid(surface), scene.material
    slope = _rms_slope(distinct(surface.values), grid.spacing)
    if slope > 3.0:  # cracks, grounds and grinds are below 1
        message = f"surface: an rms slope of {slope:.3g}; are heights and spacing in the same unit?"
        warn(message, ScaleWarning)
    block = grid.extent if scene.joint.block is None else scene.joint.block
    areas = {"contact": grid.nominal_area} if scene.is_pressed else {}
    if material.young is not None and material.poisson is not None:
        names = {"closure", "area_by_resolution", "elastic_dilatancy"}.intersection(scene.want.joints)
        areas |= {f"joints/{name}": float(np.prod(np.broadcast_to(block, 2))) for name in sorted(names)}
    for name, area in areas.items():
        row, loads = STAGES[name], _inputs.values_of(scene, STAGES[name])
        modulus = float(_inputs.stage_options(scene, row).get("contact_modulus", 0.0))
        modulus = modulus or _inputs.contact_modulus(material)
        for key, scale in (("normal_force", area), ("nominal_pressure", 1.0)):
            highest = 0.0 if loads.get(key) is None else float(np.max(loads[key])) / scale
            if highest > 0.3 * modulus:  # strains are no longer small
                message = (
                    f"{row.table}: {key} gives a mean pressure of {highest:.3g} Pa on a contact modulus of "
                    f"{modulus:.3g} Pa; is one of them in another unit?"
                )
                warn(message, ScaleWarning)


def warn_of_result(name: str, result: xr.Dataset) -> None:
    """Warn of implausible values of a closure law."""
    edge = float(result["nominal_area"].max()) ** 0.5
    deepest = float(result["closure"].max()) if "closure" in result else 0.0  # NaN where nothing was solved
    if deepest > 0.5 * edge:  # half-spaces describe closures that are small against the body
        message = f"{name}: a closure of {deepest:.3g} m of a body {edge:.3g} m wide; is the modulus in Pa?"
        warn(message, ScaleWarning)
