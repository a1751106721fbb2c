"""The plan of a study: the stages that the wanted results need, each with the reason and its peak memory.

At its peak a stage holds the libraries loaded so far, the surfaces, the maps that earlier stages keep, and
what the call of its public function takes (see `base.memory`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.memory import Plane, bytes_on, map_bytes, require_memory
from fractalcontact.base.tables import screen_width, table
from fractalcontact.base.validation import NONE, Problems, Words
from fractalcontact.scenes._functions import arguments_of, public_function
from fractalcontact.scenes._inputs import block_shape, generator_options, surface_grid
from fractalcontact.scenes._options import FROM_MATERIAL, call_options, given_options, loads_of, values_of
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stages import (
    CONTACT_MAPS,
    FIGURES,
    ISLAND_MAP,
    STAGES,
    Stage,
    StageType,
    section_length,
)

if TYPE_CHECKING:
    import xarray as xr

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
            whole_path=row.whole_path or (row.takes == "map" and "total_stress" in values_of(scene, row)),
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
    if want.dimensions:
        reasons["dimensions"] = f"wanted: {', '.join(want.dimensions)}"
    for row in STAGES.values():
        table, _, word = row.wanted.partition(".")
        if word and word in getattr(want, table) and (want.figures or not row.for_figures):
            reasons[row.name] = "figures are wanted" if row.for_figures else f"{word} is wanted"
    # from the last stage to the first, so that what a needed one needs is there too
    for row in reversed(tuple(STAGES.values())):
        for need in row.needs if row.name in reasons and row.takes in ("map", "result") else ():
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
    reads_gap = any(STAGES[f"joints/{word}"].reads == "gap" for word in scene.want.joints)
    if reads_gap and not is_contact and "gap" not in maps:
        maps.append("gap")
    return tuple(maps)


def check_needs(scene: Scene, problems: Problems) -> None:
    """Note what a stage needs and the scene does not give, and loads and directions that are ambiguous."""
    material = set(scene.table("material"))
    for stage in stages_of(scene):
        row, name, reason = stage.row, stage.row.word or stage.name, stage.reason
        if not row.table or row.takes == "file":
            continue
        options = given_options(scene, row)
        for key in row.needed():
            sources, _ = FROM_MATERIAL.get(key, ((), None))
            if key in options or (sources and material >= set(sources)):
                continue
            place = "joint" if key in (*LOADS, "shear", "block") else row.table
            if key.endswith("friction_angle"):
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


# bytes of the libraries and compiled kernels that a study loads, measured on scenes of 48 x 48 points
STARTED = 1.2e8
COMPILER = 6.0e7  # with the first of these subpackages; each adds its kernels
KERNELS = {"dimensions": 5.0e7, "contact": 6.0e7, "joints": 6.0e7, "domains": 2.0e7}
DRAWING = 9.0e7
READ = 24.0  # bytes for each point of a file while it is read
PERIODIC = ("spectral", "weierstrass")  # generators of periodic surfaces


def stage_memory(scene: Scene, stages: Sequence[Stage], face: xr.DataArray | None = None) -> dict[str, float]:
    """Return the peak memory of each stage in bytes; nothing where the surface cannot be made or read."""
    generator = scene.surface.generate
    if generator is not None and not arguments_of(f"surfaces.{generator}")[1] <= set(scene.surface.options):
        return {}
    try:
        shape, spacing = surface_grid(scene, face)
    except InvalidInput:
        return {}
    surface, block = Plane(shape, generator in PERIODIC), Plane(block_shape(scene, shape, spacing))
    held = 8.0 * surface.cells * (2 if scene.upper is not None else 1)
    loaded: set[str] = set()
    peaks = {}
    for stage in stages:
        loaded.add(stage.row.subpackage)
        libraries = _libraries(loaded)
        if stage.name == FIGURES:
            peaks[stage.name] = libraries + held + 24.0 * surface.cells
            continue
        if stage.name == "surfaces":
            peaks[stage.name] = libraries + max(held, _surface_memory(scene, surface))
            continue
        takes = stage.row.takes
        plane = surface if takes == "surface" or (takes == "map" and scene.is_pressed) else block
        options = call_options(scene, stage.row, stage.keep)
        steps, shears = _count(options, LOADS), _count(options, ("shear",))
        section = section_length(steps, int(plane.cells), has_hardness="hardness" in options)
        planes = section if stage.reads_part else steps * shears if stage.reads_map else 1
        call = _with_steps(options, section)
        estimate = public_function(stage.row.function).memory  # type: ignore[attr-defined]
        working = bytes_on(estimate, Plane(plane.shape, plane.periodic, planes), call)
        maps = sum(map(map_bytes, stage.keep)) * plane.cells * steps * shears
        peaks[stage.name] = libraries + held + max(working, 2.0 * maps)
        held += maps
    return peaks


def check_memory(
    scene: Scene, stages: Sequence[Stage], workers: int = 0, face: xr.DataArray | None = None
) -> None:
    """Raise `TooLittleMemory` unless the stage that needs most fits, in each of several processes."""
    peaks = stage_memory(scene, stages, face)
    if not peaks:
        return
    name = max(peaks, key=lambda stage: peaks[stage])
    processes = max(1, workers)
    needed = peaks[name] * processes - STARTED  # that this process has taken
    shared = f" in {processes} processes" if processes > 1 else ""
    require_memory("fractalcontact.scenes.run", needed, f"the stage {name}{shared}")


def _libraries(loaded: set[str]) -> float:
    """Return the bytes of the libraries and kernels of these subpackages."""
    names = loaded & set(KERNELS) - ({"contact"} if "joints" in loaded else set())  # joints use the same
    compiled = COMPILER + sum(KERNELS[name] for name in names) if names else 0.0
    return STARTED + compiled + (DRAWING if "plotting" in loaded else 0.0)


def _surface_memory(scene: Scene, plane: Plane) -> float:
    """Return the bytes of making or reading the surface."""
    table = scene.surface
    if table.generate is None:
        return READ * plane.cells
    function = public_function(f"surfaces.{table.generate}")
    members = int(generator_options(table).get("members") or 1)
    return bytes_on(function.memory, replace(plane, planes=members), {})  # type: ignore[attr-defined]


def _count(options: dict[str, Any], names: Sequence[str]) -> int:
    """Return the number of values of the first of these arguments that is given; 1 without any."""
    given = next((options[name] for name in names if options.get(name) is not None), None)
    return max(1, int(np.size(given))) if given is not None else 1


def _with_steps(options: dict[str, Any], steps: int) -> dict[str, Any]:
    """Return the arguments with one section of the load path, at one shear: those of a part."""
    cut = {name: options[name][:steps] for name in LOADS if isinstance(options.get(name), list)}
    return options | cut | ({"shear": [0.0]} if "shear" in options else {})
