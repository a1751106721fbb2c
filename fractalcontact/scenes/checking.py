"""All that is wrong with a scene, found before anything is computed or written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems, rehearse
from fractalcontact.base.errors import InvalidInput
from fractalcontact.scenes import doubting
from fractalcontact.scenes.given import (
    PRESSING,
    contact_options,
    crack_options,
    joint_options,
    read_surface,
    stand_in,
    steps,
)
from fractalcontact.scenes.grammar import JOINT_STAGES, public
from fractalcontact.scenes.planning import stages_of
from fractalcontact.scenes.scene import Scene
from fractalcontact.scenes.stages import map_read, measure

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
            not problems.messages
            and (scene.wanted("joints") or scene.wanted("domains"))
            and not scene.wanted("contact")
        ):
            _preflight_joint(scene, faces, problems)
        if not problems.messages:
            _rehearse(scene, faces["surface"], faces.get("upper"), problems)
    doubting.warn(doubting.of_the_given(scene, faces["surface"]))


def _rehearse(scene: Scene, face: xr.DataArray, upper: xr.DataArray | None, problems: Problems) -> None:
    """Call every function that will run as far as its checks; what an earlier stage would give is empty."""
    flat = stand_in(scene.table("surface")) is not None  # what a load may be depends on the heights
    crack = None
    for stage in stages_of(scene):
        room, _, name = stage.name.partition("/")
        with _gather(problems, stage.name):
            if stage.name == "dimensions":
                options = dict(scene.table("dimensions"))
                rehearse(public(room, "estimate"), face, list(scene.wanted("dimensions")), **options)
            elif stage.name == "contact" and not flat:
                rehearse(public(room, "press"), face, keep=stage.keep, **contact_options(scene))
            elif map_read(stage):
                one, gap = measure(stage, scene), _empty_path(scene, face)
                rehearse(public(one.room, one.function), gap if room == "joints" else gap > 0, **one.options)
            elif room == "joints" and name in JOINT_STAGES and name != "friction":
                if scene.registers or (flat and name in PRESSING):
                    continue
                if crack is None:
                    crack = public(room, "Crack")(face, upper, **crack_options(scene))
                options = joint_options(scene, name) | ({"keep": stage.keep} if name == "closure" else {})
                rehearse(public(room, JOINT_STAGES[name]), crack, **options)


def _empty_path(scene: Scene, face: xr.DataArray) -> xr.DataArray:
    """Return zeros over two steps on what is pressed: the face, or the block if there is one."""
    from fractalcontact import surfaces

    whole = bool(scene.wanted("contact")) or "block" not in scene.table("joint")
    spacing = steps(face)
    edges = np.broadcast_to(scene.table("joint").get("block", 0.0), 2)
    cells = face.shape if whole else tuple(np.rint(edges / spacing).astype(int).tolist())
    wraps = [whole and "period" in face[dim].attrs for dim in ("y", "x")]
    return surfaces.from_array(np.zeros(cells), spacing, periodic=wraps).expand_dims(step=2)


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
        self.problems.messages.extend(line for line in lines if line not in self.problems.messages)
        return True
