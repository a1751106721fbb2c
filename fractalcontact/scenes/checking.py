"""All that is wrong with a scene, found before anything is computed or written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import InvalidInput
from fractalcontact.scenes import doubting
from fractalcontact.scenes.given import crack_options, read_surface, stand_in
from fractalcontact.scenes.planning import stages_of
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints import Crack


def preflight(scene: Scene) -> None:
    """Find all that is wrong with a scene before anything is computed or written.

    Of an ensemble one face is made for that; of a large one none: a flat one of its size stands for it.

    Warns
    -----
    ScaleWarning
        A slope or a pressure is hardly meant.

    Raises
    ------
    InvalidInput
        Lists the problems of the faces, the block, the material and the loads together.
    """
    with Problems(f"scene {scene.name}") as problems:
        faces = {}
        for name in ("surface", "upper"):
            if name in scene.tables and (name == "surface" or scene.wanted("joints")):
                with _gather(problems, name):
                    table = {key: value for key, value in scene.table(name).items() if key != "members"}
                    flat = stand_in(table)
                    faces[name] = read_surface(table, scene.folder) if flat is None else flat
        if (
            not problems.found
            and (scene.wanted("joints") or scene.wanted("domains"))
            and not scene.wanted("contact")
        ):
            _preflight_joint(scene, faces, problems)
    doubting.warn(doubting.of_the_given(scene, faces["surface"]))


def _preflight_joint(scene: Scene, faces: dict[str, xr.DataArray], problems: Problems) -> None:
    from fractalcontact import joints

    crack = None
    with _gather(problems, "joint"):
        crack = joints.Crack(faces["surface"], faces.get("upper"), **crack_options(scene))
    if crack is None:
        return
    for stage in stages_of(scene):
        given = scene.options("joint", stage.name.removeprefix("joints/"), ("shear", "direction"))
        if stage.name.startswith("joints/") and "shear" in given:
            _check_travel(crack, given, stage.name, problems)


def _check_travel(crack: Crack, given: dict[str, Any], place: str, problems: Problems) -> None:
    """Note the shears that would push the block off its face."""
    directions = given.get("direction", ("E", "N", "W", "S") if place.endswith("dilatancy") else "E")
    longest = max(given["shear"]) if isinstance(given["shear"], list) else given["shear"]
    for word in directions if isinstance(directions, (list, tuple)) else [directions]:
        travel = crack.travel(word)
        if longest > travel * (1.0 + 1e-6):
            problems.add(f"{place}: shear", f"at most {travel:g} m towards {word}", longest)


class _gather:
    """Note the problems of an `InvalidInput` raised in the block, and go on."""

    def __init__(self, problems: Problems, place: str) -> None:
        self.problems, self.place = problems, place

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, value: Any, trace: Any) -> bool:
        if not isinstance(value, InvalidInput):
            return False
        lines = [f"{self.place}: {line}" for line in value.problems]
        self.problems.found.extend(line for line in lines if line not in self.problems.found)
        return True
