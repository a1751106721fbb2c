"""The plan of a study: the stages that the wanted results need, each with the reason why it is there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from fractalcontact.base.tables import screen_width, table
from fractalcontact.base.validation import NONE, Problems, Words
from fractalcontact.scenes._inputs import FROM_MATERIAL
from fractalcontact.scenes._memory import stage_memory
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stage_type import StageType, loads_of, stage_options
from fractalcontact.scenes._stages import (
    CONTACT_MAPS,
    CURVES,
    FIGURES,
    ISLAND_MAP,
    PARTIAL_SLIP,
    READ_THE_GAP,
    STAGES,
    Stage,
)

WITH_MEMORY = 80  # characters of a screen that holds the table with its column of memory


@dataclass(frozen=True)
class Plan:
    """The stages of a scene in an order in which they can run; prints as a table.

    Attributes
    ----------
    scene : str
        Name of the scene.
    stages : tuple of Stage
    memory : mapping
        Estimated peak memory of each stage in bytes, libraries and earlier results included; empty where the
        size of the surface is not known.
    """

    scene: str
    stages: tuple[Stage, ...] = field(default=())
    memory: Mapping[str, float] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Stage]:
        """Iterate over the stages in order."""
        return iter(self.stages)

    def __len__(self) -> int:
        """Return the number of stages."""
        return len(self.stages)

    def __str__(self) -> str:
        """Return a table: stage, stages it needs, reason, and peak memory where the screen is wide enough."""
        rows: list[tuple[str, ...]] = [("stage", "needs", "reason", "peak memory")]
        for stage in self:
            needs = "all stored results" if stage.row.takes == "study" else ", ".join(stage.needs)
            name = stage.name + ("" if stage.stored else " (not stored)")
            peak = f"{self.memory[stage.name] / 1e6:.0f} MB" if stage.name in self.memory else "unknown"
            rows.append((name, needs, stage.reason, peak))
        notes = []
        if screen_width() < WITH_MEMORY:
            rows = [row[:-1] for row in rows]
            largest = max(self.memory, key=lambda name: self.memory[name], default="")
            notes += [f"peak memory: {self.memory[largest] / 1e6:.0f} MB, {largest}"] if largest else []
        return "\n".join([table(rows), *notes])


def plan(scene: Scene) -> Plan:
    """Return the stages that the wanted results of a scene need, and no others.

    Parameters
    ----------
    scene : Scene
        From `fractalcontact.scenes.load`.

    Returns
    -------
    Plan
        Iterates over its stages; prints as a table, with the memory that each stage takes at its peak.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> for stage in fc.scenes.plan(fc.scenes.load("rigid_sliding")):
    ...     print(stage.name, "-", stage.reason)
    surfaces - input
    joints/rigid_dilatancy - rigid_dilatancy is wanted
    """
    with Problems("fractalcontact.scenes.plan") as problems:
        problems.require(isinstance(scene, Scene), "scene", "a Scene, from fractalcontact.scenes.load", scene)
    stages = stages_of(scene)
    return Plan(scene.name, stages, stage_memory(scene, stages))


def stages_of(scene: Scene) -> tuple[Stage, ...]:
    """Return the stages of a scene."""
    reasons = _reasons(scene)
    stages = [
        Stage(
            name,
            _needs(row, reasons),
            reasons[name],
            keep=_kept_maps(scene, row),
            stored=name != "surfaces" or reasons[name] != "input",
            whole_path=row.whole_path or "total_stress" in stage_options(scene, row, ("total_stress",)),
        )
        for name, row in STAGES.items()
        if name in reasons
    ]
    if scene.want.figures:
        stored = tuple(stage.name for stage in stages if stage.stored)
        stages.append(Stage(FIGURES, stored, "figures are wanted", stored=False))
    return tuple(stages)


def _reasons(scene: Scene) -> dict[str, str]:
    """Return the names of the stages that the wanted results need, each with the reason."""
    want = scene.want
    reasons = {"surfaces": "figures are wanted" if want.figures else "input"}
    if "height" in want.surfaces:
        reasons["surfaces"] = "height is wanted"
    if "describe" in want.surfaces:
        reasons["surfaces/description"] = "describe is wanted"
    if "texture" in want.surfaces:
        reasons["surfaces/texture"] = "texture is wanted"
    if want.dimensions:
        reasons["dimensions"] = f"wanted: {', '.join(want.dimensions)}"
        if want.figures:
            curves = [name for name in want.dimensions if name in CURVES]
            reasons |= {f"dimensions/{name}": "figures are wanted" for name in curves}
    if scene.is_pressed:
        reasons["contact"] = "press is wanted"
    if PARTIAL_SLIP in want.contact:
        reasons[PARTIAL_SLIP] = "partial_slip is wanted"
    reasons |= _joint_reasons(scene)
    reasons |= {f"domains/{name}": f"{name} is wanted" for name in want.domains}
    return reasons


def _joint_reasons(scene: Scene) -> dict[str, str]:
    want = scene.want
    reasons = {name: f"{name} is wanted" for name in want.joints}
    if want.domains and not scene.is_pressed:
        reasons.setdefault("closure", "the contact set is analysed")
    for name in READ_THE_GAP:
        if name in reasons:
            reasons.setdefault("closure", f"{name} needs the gap")
    if "closure_laws" in reasons:
        reasons.setdefault("closure", "closure_laws needs it")
    if "friction" in reasons and "elastic_dilatancy" not in reasons:
        reasons.setdefault("rigid_dilatancy", "friction needs a dilatancy")
    if scene.want.figures and reasons and stage_options(scene, STAGES["joints/delta_surface"], ("shear",)):
        reasons.setdefault("delta_surface", "figures are wanted")
    if reasons and scene.upper is not None:
        registered = " and registered" if scene.joint.register else ""
        reasons["faces"] = f"an upper face is given{registered}"
    return {f"joints/{name}": reason for name, reason in reasons.items()}


def _needs(row: StageType, planned: dict[str, str]) -> tuple[str, ...]:
    """Return the stages that a row needs, as far as the plan has them."""
    alternatives = (need.split(" or ") for need in row.needs)
    first = (next((name for name in names if name in planned), None) for names in alternatives)
    return tuple(name for name in first if name is not None)


def stored_maps(scene: Scene) -> set[str]:
    """Return the maps in the result file: those wanted, and those that its figures show."""
    return set(scene.want.keep) | ({"state", "slip_state", ISLAND_MAP} if scene.want.figures else set())


def _kept_maps(scene: Scene, row: StageType) -> tuple[str, ...]:
    """Return the maps that a stage has to return: those wanted and those that other stages read."""
    if row.keeps != CONTACT_MAPS:
        return tuple(name for name in row.keeps if name in stored_maps(scene))
    is_contact = row.name == "contact"
    maps = [name for name in scene.want.keep if name in CONTACT_MAPS]
    reads_state = is_contact == scene.is_pressed and bool(scene.want.domains)
    if (reads_state or scene.want.figures) and "state" not in maps:
        maps.append("state")
    if set(READ_THE_GAP) & set(scene.want.joints) and not is_contact and "gap" not in maps:
        maps.append("gap")
    return tuple(maps)


def check_needs(scene: Scene, problems: Problems) -> None:
    """Note what a stage needs and the scene does not give, and loads and directions that are ambiguous."""
    material = set(scene.table("material"))
    for stage in stages_of(scene):
        row, name, reason = stage.row, stage.row.word or stage.name, stage.reason
        if not row.table or row.takes == "file":
            continue
        options = stage_options(scene, row)
        for key in (*row.needed(), *filter(None, [row.friction_angle])):
            sources = FROM_MATERIAL.get(key, ())
            if key in options or (sources and material >= set(sources)):
                continue
            place = "joint" if key in (*LOADS, "shear", "block") else row.table
            if key == row.friction_angle:
                place, key, sources = "material", "basic_friction_angle", ()
            elsewhere = f", or {' and '.join(sources)} in [material]" if sources else ""
            problems.add(f"{place}.{key}", f"a value for {name} ({reason}){elsewhere}", NONE)
        direction = options.get("direction", "E")
        if row.one_direction and isinstance(direction, list):
            problems.add("joint.direction", f"one direction for {name}", direction)
        if row.one_load and len(loads := loads_of(scene, row)) != 1:
            *others, last = (key for key in LOADS if key in row.arguments())
            expected = f"exactly one of {', '.join(others)} or {last} for {name} ({reason})"
            problems.add(row.table, expected, Words(", ".join(loads)) or NONE)
