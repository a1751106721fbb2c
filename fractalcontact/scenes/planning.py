"""From the wanted results to the stages they need, each with the reason why it is there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fractalcontact.base.tables import table
from fractalcontact.scenes.grammar import ISLANDS, LOADS, SOLVED

if TYPE_CHECKING:
    from fractalcontact.scenes.choosing import Choice
    from fractalcontact.scenes.scene import Scene


@dataclass(frozen=True)
class Stage:
    """One piece of work.

    Attributes
    ----------
    name : str
        Group of the result, "joints/closure" for example.
    needs : tuple of str
        Stages that must be there first.
    reason : str
        Why the plan holds this stage.
    keep : tuple of str
        Maps that the stage must give.
    stored : bool
        False for a stage that is only a step towards others.
    """

    name: str
    needs: tuple[str, ...]
    reason: str
    keep: tuple[str, ...] = ()
    stored: bool = True


@dataclass(frozen=True)
class Plan:
    """The stages of a scene in an order in which they can run."""

    scene: str
    stages: tuple[Stage, ...] = field(default=())
    choices: tuple[Choice, ...] = field(default=())

    def __iter__(self) -> Iterator[Stage]:
        """Iterate over the stages in order."""
        return iter(self.stages)

    def __len__(self) -> int:
        """Return the number of stages."""
        return len(self.stages)

    def __str__(self) -> str:
        """Return a table: stage, what it needs, why it is there."""
        rows: list[tuple[str, ...]] = [("stage", "needs", "because")]
        rows += [(s.name + ("" if s.stored else " (not stored)"), ", ".join(s.needs), s.reason) for s in self]
        picked = [f"picked: {choice}" for choice in self.choices]
        return "\n".join([table(rows), *picked])


def plan(scene: Scene) -> Plan:
    """Return the stages that the wanted results of a scene need, and no other.

    With `error` or `budget` in the scene, also the methods and tolerances that are picked for it.

    Parameters
    ----------
    scene : Scene
        From `fractalcontact.scenes.load`.

    Returns
    -------
    Plan
        Prints as a table.
    """
    from fractalcontact.scenes.choosing import choose

    scene, choices = choose(scene)
    return Plan(scene.name, stages_of(scene), choices)


def stages_of(scene: Scene) -> tuple[Stage, ...]:
    """Return the stages of a scene in which nothing is left to be picked."""
    stages: list[Stage] = []
    wanted_surface = scene.wanted("surfaces")
    height_stored = "height" in wanted_surface or scene.figures
    why = "height is wanted" if "height" in wanted_surface else "figures are wanted"
    stages.append(Stage("surfaces", (), why if height_stored else "the given face", stored=height_stored))
    if "describe" in wanted_surface:
        stages.append(Stage("surfaces/description", ("surfaces",), "describe is wanted"))
    stages += _dimension_stages(scene)
    stages += _contact_stages(scene)
    stages += _joint_stages(scene)
    stages += _domain_stages(scene)
    if scene.figures:
        stored = tuple(stage.name for stage in stages if stage.stored)
        stages.append(Stage(FIGURES, stored, "figures are wanted", stored=False))
    return tuple(stages)


FIGURES = "figures"
CURVES = (
    "spectrum",
    "variogram",
    "madogram",
    "second_variogram",
    "cube_counts",
    "roughness_length",
    "variation",
    "covering",
)


def _dimension_stages(scene: Scene) -> list[Stage]:
    methods = scene.wanted("dimensions")
    if not methods:
        return []
    stages = [Stage("dimensions", ("surfaces",), f"wanted: {', '.join(methods)}")]
    if scene.figures:
        stages += [
            Stage(f"dimensions/{name}", ("surfaces",), "figures are wanted")
            for name in methods
            if name in CURVES
        ]
    return stages


def _contact_stages(scene: Scene) -> list[Stage]:
    if not scene.wanted("contact"):
        return []
    keep = _maps(scene, of_contact=True)
    return [Stage("contact", ("surfaces",), "press is wanted", keep=keep)]


def _joint_stages(scene: Scene) -> list[Stage]:
    wanted = list(scene.wanted("joints"))
    reasons = {name: f"{name} is wanted" for name in wanted}
    of_contact = bool(scene.wanted("contact"))
    if scene.wanted("domains") and not of_contact:
        reasons.setdefault("closure", "the contact domains are wanted")
    if "transmissivity" in reasons:
        reasons.setdefault("closure", "the gap is needed by transmissivity")
    if "friction" in reasons and "elastic_dilatancy" not in reasons:
        reasons.setdefault("rigid_dilatancy", "friction needs a dilatancy")
    if scene.figures and reasons:
        reasons.setdefault("delta_surface", "figures are wanted")
    if not reasons:
        return []
    faces: tuple[str, ...] = ("surfaces",)
    stages = []
    if "upper" in scene.tables:
        reason = "an upper face is given" + (" and is to be registered" if scene.registers else "")
        stages.append(Stage("joints/faces", faces, reason))
        faces = ("surfaces", "joints/faces")
    needs = {
        "friction": (f"joints/{'elastic' if 'elastic_dilatancy' in reasons else 'rigid'}_dilatancy",),
        "transmissivity": ("joints/closure",),
    }
    maps = _maps(scene, of_contact=False)
    order = (
        "delta_surface",
        "rigid_dilatancy",
        "closure",
        "elastic_dilatancy",
        "friction",
        "decorrelation_length",
        "transmissivity",
    )
    for name in order:
        if name in reasons:
            keep = maps if name == "closure" else ()
            stages.append(Stage(f"joints/{name}", needs.get(name, faces), reasons[name], keep=keep))
    return stages


def _domain_stages(scene: Scene) -> list[Stage]:
    source = "contact" if scene.wanted("contact") else "joints/closure"
    maps = {"islands": (ISLANDS,)} if ISLANDS in stored_maps(scene) else {}
    return [
        Stage(f"domains/{name}", (source,), f"{name} is wanted", keep=maps.get(name, ()))
        for name in scene.wanted("domains")
    ]


def stored_maps(scene: Scene) -> set[str]:
    """Return the maps that the result holds: those asked for, and those that its figures show."""
    return set(scene.wanted("keep")) | ({"state", ISLANDS} if scene.figures else set())


def _maps(scene: Scene, *, of_contact: bool) -> tuple[str, ...]:
    """Return the maps that a solver stage has to give: those asked for and those that others read."""
    maps = [name for name in scene.wanted("keep") if name in SOLVED]
    domains_of_contact = bool(scene.wanted("contact"))
    reads_state = of_contact == domains_of_contact and bool(scene.wanted("domains"))
    if (reads_state or scene.figures) and "state" not in maps:
        maps.append("state")
    if "transmissivity" in scene.wanted("joints") and not of_contact and "gap" not in maps:
        maps.append("gap")
    return tuple(maps)


def check_loads(scene: Scene, problems: list[str]) -> None:
    """Note which stages of the joint lack their shear or their load, or have more than one."""
    for stage in stages_of(scene):
        room, _, name = stage.name.partition("/")
        if room != "joints":
            continue
        given = scene.options("joint", name, ("shear", *LOADS))
        if name in ("closure", "rigid_dilatancy", "elastic_dilatancy") and "shear" not in given:
            problems.append(f"joint.shear: expected a value for {name} ({stage.reason}), got none")
        if name == "elastic_dilatancy" and "normal_force" not in given:
            problems.append(f"joint.normal_force: expected a value for {name}, got none")
        direction = scene.options("joint", name, ("direction",)).get("direction", "E")
        if name in ("closure", "delta_surface", "decorrelation_length") and isinstance(direction, list):
            problems.append(f"joint.direction: expected one direction for {name}, got {direction}")
        if name == "closure" and len(loads_of(scene)) != 1:
            words = "a closure, normal_force or nominal_pressure"
            found = ", ".join(loads_of(scene)) or "none"
            problems.append(f"joint.closure: expected one of {words} ({stage.reason}), got {found}")


def loads_of(scene: Scene) -> list[str]:
    """Return the loads of the closure laws: those of [joint.closure], else those of [joint]."""
    joint = scene.table("joint")
    table = joint.get("closure")
    own = [key for key in LOADS if key in table] if isinstance(table, dict) else []
    return own or [key for key in LOADS if key in joint and not isinstance(joint[key], dict)]
