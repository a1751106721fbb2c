"""The input of a study: its surfaces, read or generated and prepared, and the arguments of its calls.

Arguments are those that the tables of the scene give, then those that its material gives.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.files import datasets_folder
from fractalcontact.base.grid import read_grid
from fractalcontact.base.numbers import float_array
from fractalcontact.base.regression import slopes
from fractalcontact.base.study import joined_references
from fractalcontact.base.units import quantity_text
from fractalcontact.scenes._scene import LOADS, OF_SURFACE, MaterialTable, Scene, SurfaceTable
from fractalcontact.scenes._stage_type import StageType, parameters_of, public_function

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints import Crack

VARIABLE = re.compile(r"\$\{?(\w+)\}?")


def read_surface(table: SurfaceTable, folder: Path, lower: xr.DataArray | None = None) -> xr.DataArray:
    """Return the surface that a table describes; with `member`, this member of its ensemble alone.

    `lower` is the surface whose plane and cells an upper face with ``plane = "surface"`` takes.
    """
    from fractalcontact import surfaces

    surface: xr.DataArray
    if table.generate is not None:
        surface = public_function(f"surfaces.{table.generate}")(**generator_options(table))
    elif table.sample is not None:
        surface = surfaces.sample(table.sample)
    else:
        options = dict(table.options)
        if options.get("plane") == OF_SURFACE:
            options["plane"] = lower
        surface = surfaces.read(locate(str(table.read), folder), **options)
        if "y" not in surface.dims:
            got = "a profile: see fractalcontact.dimensions.estimate"
            raise InvalidInput.of("surface", "read", "a surface", got)
    source, done = surface.attrs["references"], []
    if table.generate is None and (missing := int(surface.isnull().sum())):
        done.append(f"{100 * missing / surface.size:.3g} % of the points are missing")
    if table.despike:
        surface = surfaces.despike(surface)
        source = joined_references(source, surface.attrs["references"])
        done.append(f"{_points(surface['removed_points'])} removed as spikes")
    if table.fill:
        surface = surfaces.fill(surface)
        source = joined_references(source, surface.attrs["references"])
        done.append(f"{_points(surface['filled_points'])} filled in")
    if table.level is not None:
        tilt = math.degrees(math.atan(math.hypot(*slopes(surface.values, read_grid(surface).spacing))))
        before = float(surface.std())
        surface = surfaces.level(surface, table.level)
        ends = [quantity_text(height, "m") for height in (before, float(surface.std()))]
        if table.level > 0:
            done.append(f"levelled: tilt {tilt:.3g}° removed, Sq {ends[0]} before and {ends[1]} after")
    return surface.assign_attrs(references=source, **({"preparation": ", ".join(done)} if done else {}))


def _points(count: Any) -> str:
    return f"{int(count)} point" + ("s" if int(count) != 1 else "")


def plane_share(surface: xr.DataArray) -> float:
    """Return the part of the mean square height that the mean plane carries, level along periodic axes."""
    total = float(surface.std())
    if not total > 0:
        return 0.0
    grid = read_grid(surface)
    slope_y, slope_x = slopes(surface.values, grid.spacing, grid.periodic)
    plane = slope_y * surface["y"] + slope_x * surface["x"] + 0.0 * surface
    return (float(plane.std()) / total) ** 2


def generator_options(table: SurfaceTable) -> dict[str, Any]:
    """Return the arguments of the generator of a surface, or of one member of an ensemble."""
    options = dict(table.options)
    if table.member is not None:
        options["rng"] = np.random.SeedSequence(options["rng"], spawn_key=(table.member,))
    return options


def surface_grid(scene: Scene, face: xr.DataArray | None = None) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return shape and spacing (y, x; m) of the surface; a generated one is not made for that.

    A surface that has been read is the `face`.
    """
    options = scene.surface.options
    if scene.surface.generate is not None:
        shape, spacing = np.broadcast_to(options["shape"], 2), np.broadcast_to(options["spacing"], 2)
        return (int(shape[0]), int(shape[1])), (float(spacing[0]), float(spacing[1]))
    # its heights do not matter: what is removed from them, or filled, leaves the grid as it is
    as_read = replace(scene.surface, despike=False, fill=False, level=None)
    grid = read_grid(read_surface(as_read, scene.folder) if face is None else face)
    return grid.shape, grid.spacing


def block_shape(scene: Scene, shape: tuple[int, ...], spacing: Sequence[float]) -> tuple[int, ...]:
    """Return the cells (y, x) of the block of a joint: all of the surface where the scene states no block."""
    if scene.joint.block is None:
        return shape
    rows, columns = np.rint(np.broadcast_to(scene.joint.block, 2) / np.asarray(spacing))
    return int(rows), int(columns)


def locate(path: str, folder: Path) -> Path:
    """Return the file that a scene names.

    Environment variables are expanded; a relative path starts at the scene or at the shipped data.

    Raises
    ------
    InvalidInput
        A variable is not set, or there is no such file.
    """
    expanded = os.path.expandvars(path)
    if "$" in expanded:
        unset = " and ".join(VARIABLE.findall(expanded))
        remedy = f"set the environment variable {unset} to the folder that holds the file {Path(path).name}"
        raise InvalidInput("surface", [f"read: {remedy}"])
    beside = Path(os.path.normpath(folder / expanded))  # also where the folder does not exist yet
    for candidate in (beside, datasets_folder() / expanded):
        if candidate.is_file():
            return candidate
    raise InvalidInput.of("surface", "read", "an existing file", repr(path))


def values_of(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return what the tables of a stage give: its own one, [joint.closure], before the whole one, [joint]."""
    common = {key: value for key, value in _common_values(scene, row).items() if key not in row.own}
    return common | own_values(scene, row)


def given_options(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return the arguments that the tables of a scene give to a stage."""
    values = values_of(scene, row)
    return {key: values[key] for key in (row.arguments() if values else ()) if key in values}


def loads_of(scene: Scene, row: StageType) -> list[str]:
    """Return the loads of a stage: those of its own table, else those of the whole table."""
    common, own = _common_values(scene, row), own_values(scene, row)
    allowed = [key for key in LOADS if key in row.arguments()]
    return [key for key in allowed if key in own] or [key for key in allowed if key in common]


def own_values(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return the values of the own table of a stage, [joint.closure]."""
    name, _, word = row.table.partition(".")
    own = scene.table(name).get(word)
    return own if isinstance(own, dict) else {}


def _common_values(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return the values of the whole table of a stage, [joint]."""
    table = scene.table(row.table.partition(".")[0])
    # a stage may have the name of an argument ([joint.closure]), so sub-tables are not values; the block of
    # a joint is that of its crack, and only one in the table of a stage is an argument
    return {key: value for key, value in table.items() if not isinstance(value, dict) and key != "block"}


def stage_options(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return all arguments of the call of a stage but the first one, and the maps that it keeps.

    What the tables do not give comes from the material: arguments without a default, and the hardness.
    """
    if row.takes == "study":
        return {}
    options = given_options(scene, row)
    options.pop("block", None)  # of the crack
    if row.one_load:
        load = loads_of(scene, row)[:1]
        options = {key: value for key, value in options.items() if key not in LOADS or key in load}
    wanted = {*row.needed(), *({"hardness"} & set(row.arguments()))} - set(options)
    for key, (sources, make) in FROM_MATERIAL.items():
        if key in wanted and all(getattr(scene.material, source) is not None for source in sources):
            options[key] = make(scene.material)
    if "methods" in row.arguments():
        options["methods"] = list(scene.want.dimensions)
    return {**options, **row.fixed}


def call_options(scene: Scene, row: StageType, keep: tuple[str, ...]) -> dict[str, Any]:
    """Return all arguments of the call but the first one; `keep` are the maps that it returns."""
    maps = {"keep": keep} if "keep" in parameters_of(row.function) else {}
    return stage_options(scene, row) | maps


def crack_options(scene: Scene, row: StageType | None = None) -> dict[str, Any]:
    """Return the arguments of `Crack` but for the surfaces; a stage may have a block of its own."""
    material = scene.material
    own = {} if row is None else own_values(scene, row)
    options = {
        "young": material.young,
        "poisson": material.poisson,
        "basic_friction_angle": material.basic_friction_angle,
        "block": own.get("block", scene.joint.block),
    }
    return {key: value for key, value in options.items() if value is not None}


def crack_of(
    scene: Scene, lower: xr.DataArray, upper: xr.DataArray | None, row: StageType | None = None
) -> Crack:
    """Return the crack of the scene, or that of a stage with a block of its own."""
    from fractalcontact.joints import Crack

    return Crack(lower, upper, **crack_options(scene, row))


def contact_modulus(material: MaterialTable) -> float:
    """Return E* of the pair of bodies, Pa."""
    from fractalcontact.contact import effective_modulus

    return effective_modulus(*_bodies(material))


def _poisson(material: MaterialTable) -> float:
    """Return Poisson's ratio; of two materials that of the pair."""
    from fractalcontact.contact import effective_poisson

    if isinstance(material.poisson, (int, float)):
        return material.poisson
    return effective_poisson(*_bodies(material))


def _bodies(material: MaterialTable) -> tuple[float, float, float, float]:
    """Return young and poisson of the lower body, then of the upper one."""
    young, poisson = (np.broadcast_to(float_array(each), 2) for each in (material.young, material.poisson))
    return float(young[0]), float(poisson[0]), float(young[1]), float(poisson[1])


# arguments that the material gives: the keys they are made from, and how
FROM_MATERIAL: dict[str, tuple[tuple[str, ...], Callable[[MaterialTable], Any]]] = {
    "contact_modulus": (("young", "poisson"), contact_modulus),
    "poisson": (("poisson",), _poisson),
    "friction_coefficient": (
        ("basic_friction_angle",),
        lambda material: math.tan(math.radians(material.basic_friction_angle or 0.0)),
    ),
    # there is no residual one in a scene
    "residual_friction_angle": (("basic_friction_angle",), attrgetter("basic_friction_angle")),
    "basic_friction_angle": (("basic_friction_angle",), attrgetter("basic_friction_angle")),
    "hardness": (("hardness",), attrgetter("hardness")),
}
