"""What a scene is given, as the rooms take it: faces, and the arguments that its tables stand for."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.datasets import datasets_folder
from fractalcontact.base.errors import InvalidInput
from fractalcontact.scenes.grammar import LOADS, stage_keys
from fractalcontact.scenes.planning import loads_of
from fractalcontact.scenes.scene import Scene, Table

if TYPE_CHECKING:
    import xarray as xr

VARIABLE = re.compile(r"\$\{?(\w+)\}?")
LARGE = 1 << 18  # nodes of a face that is not made twice
PRESSING = ("closure", "elastic_dilatancy")  # stages of a joint that solve a contact


def read_surface(table: Table, folder: Path) -> xr.DataArray:
    """Return the face that a table of the scene describes; with `member`, that one of its ensemble alone."""
    from fractalcontact import surfaces

    options = {key: value for key, value in table.items() if key not in ("level", "despike", "fill")}
    if "member" in options:
        options["rng"] = np.random.SeedSequence(options["rng"], spawn_key=(options.pop("member"),))
    if "generate" in options:
        generate: Callable[..., xr.DataArray] = getattr(surfaces, options.pop("generate"))
        face = generate(**options)
    elif "sample" in options:
        face = surfaces.sample(options.pop("sample"))
    else:
        face = surfaces.read(locate(options.pop("read"), folder), **options)
    if table.get("despike"):
        face = surfaces.despike(face)
    if table.get("fill"):
        face = surfaces.fill(face)
    if "level" in table:
        face = surfaces.level(face, table["level"])
    return face


def face_grid(scene: Scene) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return shape and spacings (y, x; m) of the face; one that is generated is not made for that."""
    table = scene.table("surface")
    if "generate" in table:
        shape, spacing = np.broadcast_to(table["shape"], 2), np.broadcast_to(table["spacing"], 2)
        return (int(shape[0]), int(shape[1])), (float(spacing[0]), float(spacing[1]))
    face = read_surface(table, scene.folder)
    return (face.sizes["y"], face.sizes["x"]), steps(face)


def steps(face: xr.DataArray) -> tuple[float, float]:
    """Return the spacings (y, x; m) of a face."""
    y, x = (float(face[dim][1] - face[dim][0]) for dim in ("y", "x"))
    return y, x


def locate(path: str, folder: Path) -> Path:
    """Return the file that a scene names.

    Variables of the environment are expanded; a relative path starts at the scene or at the shipped data.

    Raises
    ------
    InvalidInput
        A variable is not set, or there is no such file.
    """
    expanded = os.path.expandvars(path)
    if "$" in expanded:
        unset = " and ".join(word for word in VARIABLE.findall(expanded))
        raise InvalidInput(
            "surface", [f"read: expected {unset} to name a folder, got a variable that is not set"]
        )
    for candidate in (folder / expanded, datasets_folder() / expanded):
        if candidate.is_file():
            return candidate
    raise InvalidInput("surface", [f"read: expected an existing file, got {path!r}"])


def stand_in(table: Table) -> xr.DataArray | None:
    """Return a flat face in place of a large one that is generated."""
    if "generate" not in table:
        return None
    shape = table["shape"] if isinstance(table["shape"], list) else [table["shape"]] * 2
    if not all(isinstance(n, int) for n in shape) or math.prod(shape) < LARGE:
        return None  # one of a wrong shape is refused by its maker
    from fractalcontact import surfaces

    return surfaces.from_array(np.zeros(shape), table["spacing"])


def contact_options(scene: Scene) -> dict[str, Any]:
    """Return the arguments of `press`: those of `[contact]`, and what the material says of the rest."""
    from fractalcontact.contact import effective_modulus

    options, material = dict(scene.table("contact")), scene.table("material")
    if "contact_modulus" not in options:
        options["contact_modulus"] = effective_modulus(material["young"], material["poisson"])
    if "hardness" in material:
        options.setdefault("hardness", material["hardness"])
    return options


def crack_options(scene: Scene) -> dict[str, Any]:
    """Return the arguments of `Crack` but for the faces."""
    material, joint = scene.table("material"), scene.table("joint")
    options = {key: material[key] for key in ("young", "poisson", "basic_friction_angle") if key in material}
    return options | ({"block": joint["block"]} if "block" in joint else {})


def joint_options(scene: Scene, name: str) -> dict[str, Any]:
    """Return the arguments of a stage of the joint but for its crack: a closure has one load."""
    options = scene.options("joint", name, stage_keys("joints", name))
    if name == "closure":
        load = loads_of(scene)[0]
        options = {key: value for key, value in options.items() if key not in LOADS or key == load}
    if name in PRESSING and "hardness" in scene.table("material"):
        options.setdefault("hardness", scene.table("material")["hardness"])
    return options
