"""The plan of a study: the stages that the wanted results need, each with the reason and its peak memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from fractalcontact.base.tables import screen_width, table
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._options import values_of
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._stage_memory import stage_memory
from fractalcontact.scenes._stages import FIGURES, ISLAND_MAP, STAGES, Stage, StageType


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
        if screen_width() < 80:  # characters: too narrow for the column of memory
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
            stored=name != "surfaces" or reasons[name] != "input",
            whole_path=row.whole_path or (row.takes == "map" and "total_stress" in values_of(scene, row)),
        )
        for name, row in STAGES.items()
        if name in reasons
    ]
    stages = [_with_maps(stage, stages, scene) for stage in stages]
    if scene.want.figures:
        stored = tuple(stage.name for stage in stages if stage.stored)
        stages.append(Stage(FIGURES, stored, "figures are wanted", stored=False))
    return tuple(stages)


def _with_maps(stage: Stage, stages: Sequence[Stage], scene: Scene) -> Stage:
    """Return a stage with the maps that it has to return: those to store, and those that other stages read.

    The result file has the maps that are wanted, and those that its figures show.
    """
    stored = {*scene.want.keep, *(("state", "slip_state", ISLAND_MAP) if scene.want.figures else ())}
    readers = [other for other in stages if other.reads_map and stage.name in other.needs]
    read = {reader.row.reads for reader in readers}
    read_whole = {reader.row.reads for reader in readers if not reader.reads_part}
    keep = tuple(name for name in stage.row.keeps if name in stored | read)
    internal = tuple(name for name in keep if name not in stored)
    return replace(
        stage,
        keep=keep,
        internal=internal,
        dropped=tuple(name for name in internal if name not in read_whole),
    )


def _reasons(scene: Scene) -> dict[str, str]:
    """Return the names of the stages that the wanted results need, each with the reason."""
    want = scene.want
    reasons = {"surfaces": "figures are wanted" if want.figures else "input"}
    if want.dimensions:
        reasons["dimensions"] = f"wanted: {', '.join(want.dimensions)}"
    for row in STAGES.values():
        table, _, word = row.wanted.partition(".")
        if word and word in getattr(want, table) and (want.figures or not row.for_figures):
            reasons[row.name] = "figures are wanted" if row.for_figures else f"{word} is wanted"
    # from the last stage to the first, so that what a needed one needs is there too
    for row in reversed(tuple(STAGES.values())):
        for need in row.needs[:1] if row.name in reasons and row.takes in ("map", "result") else ():
            *_, last = names = need.split(" or ")
            if reasons.keys().isdisjoint(names):
                reasons[last] = row.why
    if any(STAGES[name].group == "joints" for name in reasons):
        if want.figures and "shear" in values_of(scene, STAGES["joints/delta_surface"]):
            reasons.setdefault("joints/delta_surface", "figures are wanted")
        if scene.upper is not None:
            registered = " and registered" if scene.joint.register else ""
            reasons["joints/faces"] = f"an upper face is given{registered}"
    return reasons


def _needs(row: StageType, planned: dict[str, str]) -> tuple[str, ...]:
    """Return the stages that a row needs, as far as the plan has them."""
    alternatives = (need.split(" or ") for need in row.needs)
    first = (next((name for name in names if name in planned), None) for names in alternatives)
    return tuple(name for name in first if name is not None)
