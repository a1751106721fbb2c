"""The stages of a study: the table of all, the plan of those that a scene needs, and the memory of each.

The rows of the table stand in an order in which they can run; `_inputs` gives the arguments of their calls,
and `_parts` carries them out. At its peak a stage holds the libraries loaded so far, the surfaces, the maps
that earlier stages keep, and what the call of its public function takes (see `base.resources`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.resources import Plane, bytes_on, map_bytes, require_memory
from fractalcontact.base.tables import screen_width, table
from fractalcontact.base.validation import Problems
from fractalcontact.scenes import _domain_stages, _inputs, _joint_stages, _surface_stages
from fractalcontact.scenes._domain_stages import SIGNATURE
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stage_type import ISLAND_MAP, MAPS, StageType, arguments_of, public_function

if TYPE_CHECKING:
    import xarray as xr

FIGURES = "figures"
PART_SIZE = 1 << 23  # nodes times steps of one part: seconds of work, and maps of at most 64 MB each
_ROWS = (
    *_surface_stages.STAGES,
    *_joint_stages.STAGES,
    *_domain_stages.STAGES,
    StageType(FIGURES, (), "plotting.draw", takes="study"),
)
STAGES: Mapping[str, StageType] = {row.name: row for row in _ROWS}
# the words of [want]; those of its `dimensions` are the names of the estimators
WANTED: Mapping[str, tuple[str, ...]] = {
    name: tuple(word for table, _, word in (row.wanted.partition(".") for row in _ROWS) if table == name)
    for name in ("surfaces", "contact", "joints", "domains")
} | {"keep": MAPS}


@dataclass(frozen=True)
class Stage:
    """One stage of a plan.

    Attributes
    ----------
    name : str
        Group of its result, "joints/closure" for example.
    needs : tuple of str
        Stages that run before it.
    reason : str
        Why the plan has it.
    keep : tuple of str
        Maps that it has to return.
    internal, dropped : tuple of str
        Those of them that the result file does not contain; and of these those that nothing needs once they
        have been read plane by plane.
    stored : bool
        False where the result file does not contain it.
    whole_path : bool
        Whether it reads the maps of all steps at once.
    """

    name: str
    needs: tuple[str, ...]
    reason: str
    keep: tuple[str, ...] = ()
    internal: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    stored: bool = True
    whole_path: bool = False

    @property
    def row(self) -> StageType:
        """Its row in the table of stages."""
        return STAGES[self.name]

    @property
    def reads_map(self) -> bool:
        """Whether it reads a map of the stage it needs."""
        return bool(self.row.reads)

    @property
    def reads_part(self) -> bool:
        """Whether it reads that map plane by plane, so that the map does not have to be kept."""
        return self.reads_map and not self.whole_path

    @property
    def follows(self) -> str:
        """The stage whose parts it reads, each as soon as it is there: that of the map, or the signature."""
        if self.reads_map and SIGNATURE in self.needs:
            return SIGNATURE
        return self.needs[0] if self.reads_part else ""


def section_length(steps: int, nodes: int, *, has_hardness: bool) -> int:
    """Return how many steps of a load path a part holds: all where the state depends on the history."""
    return steps if has_hardness else min(steps, max(1, PART_SIZE // nodes))


def only_describes_surface(scene: Scene) -> bool:
    """Return whether the study presses nothing, and describes the surface alone."""
    of_crack = [name for name in scene.want.joints if STAGES[f"joints/{name}"].takes != "surface"]
    return not (scene.want.contact or scene.want.domains or of_crack)


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
    return Plan(scene.name, stages, _with_members(scene, stages, *_member_memory(scene, stages)))


def stages_of(scene: Scene) -> tuple[Stage, ...]:
    """Return the stages of a scene."""
    reasons = _reasons(scene)
    stages = [
        Stage(
            name,
            _needs(row, reasons, scene),
            reasons[name],
            stored=name != "surfaces" or reasons[name] != "input",
            whole_path=row.whole_path
            or (row.takes == "map" and "total_stress" in _inputs.values_of(scene, row)),
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
                reasons[last] = f"{row.word} needs it"
    if any(STAGES[name].group == "joints" for name in reasons):
        if want.figures and "shear" in _inputs.values_of(scene, STAGES["joints/delta_surface"]):
            reasons.setdefault("joints/delta_surface", "figures are wanted")
        if scene.upper is not None:
            registered = " and registered" if scene.joint.register else ""
            reasons["joints/faces"] = f"an upper face is given{registered}"
    return reasons


def _needs(row: StageType, planned: dict[str, str], scene: Scene) -> tuple[str, ...]:
    """Return the stages that a row needs, as far as the plan has them; a signature only if it is the same."""
    alternatives = (need.split(" or ") for need in row.needs)
    first = (next((name for name in names if name in planned), None) for names in alternatives)
    return tuple(name for name in first if name and (name != SIGNATURE or _has_signature(row, scene)))


def _has_signature(row: StageType, scene: Scene) -> bool:
    """Whether the options of a stage are those of the signature of the study."""
    options, own = (_inputs.stage_options(scene, each) for each in (row, STAGES[SIGNATURE]))
    return all(options.get(key) == own.get(key) for key in STAGES[SIGNATURE].arguments())


# bytes of the libraries that a study has loaded at its start, and of the compiled kernels of a subpackage,
# measured on scenes of 48 x 48 points; so are the compiler (6e7) and matplotlib (9e7) below
STARTED = 1.2e8
KERNELS = {"dimensions": 5.0e7, "contact": 6.0e7, "joints": 6.0e7, "domains": 2.0e7}
PERIODIC = ("spectral", "weierstrass")  # generators of periodic surfaces


def _with_members(
    scene: Scene, stages: Sequence[Stage], peaks: Mapping[str, float], stored: Mapping[str, float]
) -> dict[str, float]:
    """Return the peak memory of each stage with the maps of the other members of an ensemble.

    They stay until they are joined, each group in turn. The arguments are those of `_member_memory`.
    """
    others, joined = int(scene.surface.members or 1) - 1, 0.0
    kept = sum(stored.values())
    result = dict(peaks)
    for name in peaks if others else ():
        own = (others + 1) * stored.get(name, 0.0)
        joined += own
        at_end = _libraries({stage.row.subpackage for stage in stages}) + (others + 1) * kept + joined
        result[name] = max(peaks[name] + others * kept, at_end if own else 0.0)
    return result


def _member_memory(
    scene: Scene, stages: Sequence[Stage], face: xr.DataArray | None = None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the peak memory of each stage for one surface, and the bytes of the maps that the result has.

    Both in bytes; nothing where the surface cannot be made or read.
    """
    generator = scene.surface.generate
    if generator is not None and not arguments_of(f"surfaces.{generator}")[1] <= set(scene.surface.options):
        return {}, {}
    try:
        shape, spacing = _inputs.surface_grid(scene, face)
    except InvalidInput:
        return {}, {}
    surface, block = Plane(shape, generator in PERIODIC), Plane(_inputs.block_shape(scene, shape, spacing))
    resident = 8.0 * surface.cells * (2 if scene.upper is not None else 1)
    loaded: set[str] = set()
    peaks: dict[str, float] = {}
    stored: dict[str, float] = {}
    for stage in stages:
        loaded.add(stage.row.subpackage)
        libraries = _libraries(loaded)
        if stage.name == FIGURES:
            peaks[stage.name] = libraries + resident + 24.0 * surface.cells  # a map and its colours
            continue
        if stage.name == "surfaces":
            peaks[stage.name] = libraries + max(resident, _surface_memory(scene, surface))
            stored[stage.name] = 8.0 * surface.cells if stage.stored else 0.0
            continue
        takes = stage.row.takes
        plane = surface if takes == "surface" or (takes == "map" and scene.is_pressed) else block
        options = _inputs.call_options(scene, stage.row, stage.keep)
        steps, shears = _count(options, LOADS), _count(options, ("shear",))
        section = section_length(steps, int(plane.cells), has_hardness="hardness" in options)
        planes = section if stage.reads_part else steps * shears if stage.reads_map else 1
        call = _with_steps(options, section)
        estimate = public_function(stage.row.function).memory  # type: ignore[attr-defined]
        working = bytes_on(estimate, Plane(plane.shape, plane.periodic, planes), call)
        states = plane.cells * steps * shears
        maps = sum(map(map_bytes, stage.keep)) * states
        peaks[stage.name] = libraries + resident + max(working, 2.0 * maps)
        resident += maps
        stored[stage.name] = maps - sum(map(map_bytes, stage.internal)) * states
    return peaks, stored


def check_memory(
    scene: Scene, stages: Sequence[Stage], workers: int = 0, face: xr.DataArray | None = None
) -> None:
    """Raise `TooLittleMemory` unless the stage that needs most fits, in each of several processes."""
    of_one, stored = _member_memory(scene, stages, face)
    peaks = _with_members(scene, stages, of_one, stored)
    if not peaks:
        return
    name = max(peaks, key=lambda stage: peaks[stage])
    processes = max(1, workers)
    # this process alone has the maps of other members; `STARTED` it has taken already
    needed = peaks[name] + of_one[name] * (processes - 1) - STARTED
    shared = f" in {processes} processes" if processes > 1 else ""
    require_memory("fractalcontact.scenes.run", needed, f"the stage {name}{shared}")


def _libraries(loaded: set[str]) -> float:
    """Return the bytes of the libraries and kernels of these subpackages."""
    names = loaded & set(KERNELS) - ({"contact"} if "joints" in loaded else set())  # joints use the same
    compiled = 6.0e7 + sum(KERNELS[name] for name in names) if names else 0.0  # with the compiler
    return STARTED + compiled + (9.0e7 if "plotting" in loaded else 0.0)


def _surface_memory(scene: Scene, plane: Plane) -> float:
    """Return the bytes of making or reading the surface."""
    table = scene.surface
    if table.generate is None:
        return 24.0 * plane.cells  # bytes while a file is read
    function = public_function(f"surfaces.{table.generate}")
    members = int(_inputs.generator_options(table).get("members") or 1)
    return bytes_on(function.memory, replace(plane, planes=members), {})  # type: ignore[attr-defined]


def _count(options: dict[str, Any], names: Sequence[str]) -> int:
    """Return the number of values of the first of these arguments that is given; 1 without any."""
    given = next((options[name] for name in names if options.get(name) is not None), None)
    return max(1, int(np.size(given))) if given is not None else 1


def _with_steps(options: dict[str, Any], steps: int) -> dict[str, Any]:
    """Return the arguments with one section of the load path, at one shear: those of a part."""
    cut = {name: options[name][:steps] for name in LOADS if isinstance(options.get(name), list)}
    return options | cut | ({"shear": [0.0]} if "shear" in options else {})
