"""Validation of a scene together with its surfaces, before anything is computed or written.

The options that the study will use are constructed (`joints.Crack`), and the `validate` of every public
function that it will call is given the arguments of that call.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import plane_coords
from fractalcontact.base.schema import label
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._inputs import (
    PRESSING,
    contact_options,
    crack_options,
    generator_options,
    joint_options,
    read_surface,
    slip_options,
    spacing_of,
)
from fractalcontact.scenes._parts import map_reader
from fractalcontact.scenes._plan import Stage, stages_of
from fractalcontact.scenes._plausibility import implausible_input, warn
from fractalcontact.scenes._scene import Scene, SurfaceTable
from fractalcontact.scenes._scene_file import parse
from fractalcontact.scenes._stages import JOINT_STAGES, PARTIAL_SLIP, STAGES, public_function

if TYPE_CHECKING:
    from fractalcontact.joints import Crack

LARGE = 1 << 18  # points of a generated surface that is not made twice


def validate(scene: Scene | str | os.PathLike[str]) -> Scene:
    """Find all problems of a scene before anything is computed or written.

    The surfaces are read or generated for that; a large generated one is replaced by a flat one of its size.

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
    with Problems("fractalcontact.scenes.validate") as problems:
        expected = "a Scene or the path of a TOML file"
        problems.require(isinstance(scene, (Scene, str, os.PathLike)), "scene", expected, scene)
    if isinstance(scene, Scene):
        problems = Problems(f"scene {scene.name}")
    else:
        scene, problems = parse(scene)
    with problems:
        surfaces = _validate_surfaces(scene, problems)
        if _is_valid(problems, "want", "material", "joint.block"):
            _validate_crack(scene, surfaces, problems)
        if not problems.messages:
            _validate_calls(scene, surfaces, problems)
    warn(implausible_input(scene, surfaces["surface"]))
    return scene


def _is_valid(problems: Problems, *keys: str) -> bool:
    """Return whether these keys of the scene, with their tables and sub-tables, passed the checks so far."""
    pairs = [(f"{key}.", f"{failed}.") for key in keys for failed in problems.arguments]
    return not any(key.startswith(failed) or failed.startswith(key) for key, failed in pairs)


def _validate_surfaces(scene: Scene, problems: Problems) -> dict[str, xr.DataArray]:
    """Return the valid surfaces of the scene; of an ensemble one."""
    surfaces = {}
    for name, table in (("surface", scene.surface), ("upper", scene.upper)):
        is_read = name == "surface" or (_is_valid(problems, "want") and scene.want.joints)
        if table is not None and is_read and _is_valid(problems, name):
            with problems.collect(f"{name}: "):
                if table.generate is not None:
                    _validate_call(f"surfaces.{table.generate}", **generator_options(table))
                flat = _flat_surface(table)
                surfaces[name] = read_surface(table, scene.folder) if flat is None else flat
    return surfaces


def _flat_surface(table: SurfaceTable) -> xr.DataArray | None:
    """Return a flat surface in place of a large generated one; None for all others."""
    if table.generate is None:
        return None
    shape = table.options["shape"]
    shape = shape if isinstance(shape, list) else [shape] * 2
    if math.prod(shape) < LARGE:
        return None
    return _zeros(shape, np.broadcast_to(table.options["spacing"], 2).tolist())


def _zeros(
    shape: Sequence[int], spacing: Sequence[float], periodic: Sequence[bool] = (False, False)
) -> xr.DataArray:
    """Return a surface of zeros that is one number in memory, whatever its size."""
    coords = plane_coords(shape, spacing, periodic)
    zeros = xr.DataArray(np.broadcast_to(0.0, shape), dims=("y", "x"), coords=coords, name="height")
    return label(zeros)


def _validate_crack(scene: Scene, surfaces: dict[str, xr.DataArray], problems: Problems) -> None:
    """Check the block and the shears, which must not push it off its face."""
    joint_presses = bool(scene.want.domains) and not scene.is_pressed
    slides = any(not STAGES[f"joints/{name}"].takes_surface for name in scene.want.joints)
    if not (slides or joint_presses):
        return
    if "surface" not in surfaces or (scene.want.joints and scene.upper and "upper" not in surfaces):
        return
    with problems.collect("joint: "):
        crack = _crack(scene, surfaces)
        for stage in stages_of(scene) if _is_valid(problems, "joint") else ():
            name = stage.name.partition("/")[2]
            if stage.name.startswith("joints/") and name in JOINT_STAGES:
                options = scene.stage_options(stage.row, ("shear", "direction"))
                if "shear" in options:
                    sliding = _crack(scene, surfaces, name) if name == "elimination" else crack
                    _validate_travel(sliding, options, stage, problems)


def _crack(scene: Scene, surfaces: dict[str, xr.DataArray], name: str = "") -> Crack:
    """Return the crack of the scene, or that of a stage with a block of its own."""
    faces = surfaces["surface"], surfaces.get("upper")
    crack: Crack = public_function("joints.Crack")(*faces, **crack_options(scene, name))
    return crack


def _validate_travel(crack: Crack, options: dict[str, Any], stage: Stage, problems: Problems) -> None:
    default = ("E", "N", "W", "S") if stage.name.endswith("dilatancy") else "E"
    directions = options.get("direction", default)
    longest = float(np.max(options["shear"]))
    for direction in directions if isinstance(directions, (list, tuple)) else [directions]:
        travel = crack.travel(direction)
        if longest > travel * (1.0 + 1e-6):
            problems.add(f"{stage.name}: shear", f"at most {travel:g} m towards {direction}", longest)


def _validate_calls(scene: Scene, surfaces: dict[str, xr.DataArray], problems: Problems) -> None:
    """Validate every call of the study; zeros replace the result of an earlier stage."""
    surface = surfaces["surface"]
    is_flat = _flat_surface(scene.surface) is not None  # which loads are possible depends on the heights
    crack = None
    for stage in stages_of(scene):
        name = stage.name.partition("/")[2]
        with problems.collect(f"{stage.name}: "):
            if stage.name == "dimensions":
                options = dict(scene.table("dimensions"))
                _validate_call(stage.row.function, surface, list(scene.want.dimensions), **options)
            elif stage.name == "contact" and not is_flat:
                _validate_call(stage.row.function, surface, keep=stage.keep, **contact_options(scene))
            elif stage.name == PARTIAL_SLIP and not is_flat:
                _validate_call(stage.row.function, surface, keep=stage.keep, **slip_options(scene))
            elif stage.reads_map:
                reader = map_reader(stage, scene)
                maps = _empty_maps(scene, surface, float if reader.variable == "gap" else bool)
                _validate_call(reader.function, maps, **reader.options)
            elif stage.name.startswith("joints/") and name in JOINT_STAGES and name != "friction":
                if not stage.row.takes_surface and (scene.joint.register or (is_flat and name in PRESSING)):
                    continue
                if stage.row.takes_surface:
                    _validate_call(stage.row.function, surface, **joint_options(scene, name))
                    continue
                if crack is None:
                    crack = _crack(scene, surfaces)
                pressed = _crack(scene, surfaces, name) if name == "elimination" else crack
                options = joint_options(scene, name) | ({"keep": stage.keep} if stage.row.keeps else {})
                _validate_call(stage.row.function, pressed, **options)


def _validate_call(name: str, *arguments: Any, **options: Any) -> None:
    public_function(name).validate(*arguments, **options)  # type: ignore[attr-defined]


def _empty_maps(scene: Scene, surface: xr.DataArray, dtype: type) -> xr.DataArray:
    """Return zeros over two steps on the grid of the contact: that of the surface, or of the block."""
    is_surface = scene.is_pressed or scene.joint.block is None
    spacing = spacing_of(surface)
    edges = np.broadcast_to(0.0 if is_surface else scene.joint.block, 2)
    cells = surface.shape if is_surface else tuple(np.rint(edges / spacing).astype(int).tolist())
    periodic = [is_surface and "period" in surface[dim].attrs for dim in ("y", "x")]
    maps = _zeros(cells, spacing, periodic)
    return maps.copy(data=np.broadcast_to(dtype(0), cells)).expand_dims(step=2)
