"""The arguments of the calls of a study: those that its tables give, then those that its material gives."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.numbers import float_array
from fractalcontact.scenes._functions import parameters_of
from fractalcontact.scenes._scene import LOADS, MaterialTable, Scene

if TYPE_CHECKING:
    from fractalcontact.scenes._stages import StageType


def values_of(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return what the tables of a stage give: its own one, [joint.closure], before the whole one, [joint]."""
    common, own = _tables(scene, row)
    return {key: value for key, value in common.items() if key not in row.own} | own


def given_options(scene: Scene, row: StageType) -> dict[str, Any]:
    """Return the arguments that the tables of a scene give to a stage."""
    values = values_of(scene, row)
    return {key: values[key] for key in (row.arguments() if values else ()) if key in values}


def loads_of(scene: Scene, row: StageType) -> list[str]:
    """Return the loads of a stage: those of its own table, else those of the whole table."""
    common, own = _tables(scene, row)
    allowed = [key for key in LOADS if key in row.arguments()]
    return [key for key in allowed if key in own] or [key for key in allowed if key in common]


def _tables(scene: Scene, row: StageType) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the values of the whole table of a stage, [joint], and its own table, [joint.closure]."""
    name, _, word = row.table.partition(".")
    table = scene.table(name)
    own = table.get(word)
    # a stage may have the name of an argument ([joint.closure]), so sub-tables are not values; the block of
    # a joint is that of its crack, and only one in the table of a stage is an argument
    common = {key: value for key, value in table.items() if not isinstance(value, dict) and key != "block"}
    return common, own if isinstance(own, dict) else {}


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
    needed = row.needed()
    for key in FROM_MATERIAL:
        if key not in options and (key in needed or (key == "hardness" and key in row.arguments())):
            options |= _from_material(scene.material, key)
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
    own = {} if row is None else scene.joint.stages.get(row.word, {})
    options = {
        "young": material.young,
        "poisson": material.poisson,
        "basic_friction_angle": material.basic_friction_angle,
        "block": own.get("block", scene.joint.block),
    }
    return {key: value for key, value in options.items() if value is not None}


def contact_modulus(material: MaterialTable) -> float:
    """Return E* of the pair of bodies, Pa."""
    from fractalcontact.contact import effective_modulus

    return effective_modulus(*_bodies(material))


def _poisson(material: MaterialTable) -> float | None:
    """Return Poisson's ratio; of two materials that of the pair."""
    if isinstance(material.poisson, (int, float)):
        return material.poisson
    if material.young is None:
        return None
    from fractalcontact.contact import effective_poisson

    return effective_poisson(*_bodies(material))


def _bodies(material: MaterialTable) -> tuple[float, float, float, float]:
    """Return young and poisson of the lower body, then of the upper one."""
    young, poisson = (np.broadcast_to(float_array(each), 2) for each in (material.young, material.poisson))
    return float(young[0]), float(poisson[0]), float(young[1]), float(poisson[1])


def _friction_angle(material: MaterialTable) -> float | None:
    return material.basic_friction_angle  # there is no residual one in a scene


def _friction_coefficient(material: MaterialTable) -> float:
    return math.tan(math.radians(float(material.basic_friction_angle or 0.0)))


# arguments that the material gives: the keys they are made from, and how
FROM_MATERIAL: dict[str, tuple[tuple[str, ...], Callable[[MaterialTable], float | None]]] = {
    "contact_modulus": (("young", "poisson"), contact_modulus),
    "poisson": (("poisson",), _poisson),
    "friction_coefficient": (("basic_friction_angle",), _friction_coefficient),
    "residual_friction_angle": (("basic_friction_angle",), _friction_angle),
    "basic_friction_angle": (("basic_friction_angle",), _friction_angle),
    "hardness": (("hardness",), lambda material: material.hardness),
}


def _from_material(material: MaterialTable, argument: str) -> dict[str, float]:
    """Return an argument that the material gives, nothing where it lacks a constant for it."""
    keys, make = FROM_MATERIAL[argument]
    value = make(material) if all(getattr(material, key) is not None for key in keys) else None
    return {} if value is None else {argument: value}
