"""One study: every stage of the plan, every part of a stage once, taken up where an earlier run stopped."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fractalcontact.base import signals
from fractalcontact.base.progress import track
from fractalcontact.scenes import stages
from fractalcontact.scenes.keeping import Store, digest
from fractalcontact.scenes.planning import FIGURES, Stage, stages_of, stored_maps
from fractalcontact.scenes.scene import Scene
from fractalcontact.scenes.working import carried_out

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, repr=False)
class _Part:
    """A part of a stage with those that read it, and the names under which their results are kept."""

    part: stages.Followed
    keys: tuple[str, ...]

    def __call__(self, store: Store, stop: signals.Stop) -> tuple[list[xr.Dataset], list[float]] | None:
        """Return the results and the seconds each took; once a stop was asked for, nothing is begun."""
        if stop:
            return None
        results, seconds = self.part()
        for key, result in zip(self.keys, results, strict=False):
            store.put(key, result)
        return results, seconds


class Study:
    """One run of a scene with one face: what is done so far, and what that took.

    Attributes
    ----------
    parts : dict
        Results of the finished parts of each stage, by number.
    results : dict
        Those of the finished stages, joined.
    spent : dict
        Seconds that each stage took in this run.
    """

    def __init__(self, scene: Scene, store: Store, progress: bool, client: Any) -> None:
        self.scene, self.store, self.progress, self.client = scene, store, progress, client
        self.plan = stages_of(scene)
        self.parts: dict[str, dict[int, xr.Dataset]] = {}
        self.results: dict[str, xr.Dataset] = {}
        self.spent: dict[str, float] = {}
        self.digests: dict[str, str] = {}
        self.works: dict[str, stages.Work] = {}
        for stage in self.plan:
            self.digests[stage.name] = digest(stage, scene, self.digests, self._dropped(stage))

    def carry_out(self, stop: signals.Stop) -> list[str]:
        """Run the stages in order; return what is missing if a stop was asked for."""
        todo = [stage for stage in self.plan if stage.name != FIGURES]
        for number, stage in enumerate(track(todo, self.progress, self.scene.name, unit="stage")):
            count = self._stage(stage, stop)
            whole = len(self.works[stage.name].parts)
            if stop:
                rest = [other.name for other in todo[number + 1 :]]
                part = [f"{stage.name} ({count} of {whole} parts done)"] if count < whole else []
                return part + rest
        return []

    def _stage(self, stage: Stage, stop: signals.Stop) -> int:
        """Run the parts of a stage that are missing; return how many there are by now."""
        readers = self._readers(stage)
        job = self.works[stage.name] = stages.work(stage, self.scene, self.results, self.works)
        done = self.parts.setdefault(stage.name, {})
        names = [stage.name, *(reader.name for reader in readers)]
        for name in names:
            self._take_kept(name, len(job.parts))
        missing = [n for n in range(len(job.parts)) if any(n not in self.parts[name] for name in names)]
        several = self.progress and len(missing) > 1
        client = self.client if len(missing) > 1 else None
        made = carried_out(self._tasks(stage, job, readers, missing), self.store, stop, client)
        for number, (results, seconds) in track(made, several, stage.name, unit="part", total=len(missing)):
            for name, result, spent in zip(names, results, seconds, strict=True):
                self.parts[name][number] = result
                self.spent[name] = self.spent.get(name, 0.0) + spent
        start = time.perf_counter()
        joined = job.join(done)
        if joined is not None:
            self.results[stage.name] = joined
        self.spent.setdefault(stage.name, 0.0)
        if missing:
            self.spent[stage.name] += time.perf_counter() - start
        return len(done)

    def _take_kept(self, name: str, count: int) -> None:
        """Take what an earlier run kept of a stage."""
        found = self.parts.setdefault(name, {})
        for number in range(count):
            kept = None if number in found else self.store.get(self._key(name, number))
            if kept is not None:
                found[number] = kept

    def _tasks(
        self, stage: Stage, job: stages.Work, readers: list[Stage], missing: list[int]
    ) -> dict[int, _Part]:
        """Return the missing parts of a stage, each with what its readers measure before its maps go."""
        dropped = self._dropped(stage)
        follow = tuple(stages.measure(reader, self.scene) for reader in readers)
        names = [stage.name, *(reader.name for reader in readers)]
        if _sooner_again(stage, self.scene):
            names = []
        tasks = {}
        for number in missing:
            kept = self.parts[stage.name].get(number)
            whole = kept is not None and all(name in kept for name in stage.keep)
            part = stages.Given(kept) if kept is not None and whole else job.parts[number]
            keys = tuple(self._key(name, number) for name in names)
            tasks[number] = _Part(stages.Followed(part, follow, dropped), keys)
        return tasks

    def _readers(self, stage: Stage) -> list[Stage]:
        """Return the stages that read the maps of this one part by part, so that none outlives its part."""
        return [one for one in self.plan if stage.name in one.needs and stages.reads_part(one)]

    def _dropped(self, stage: Stage) -> tuple[str, ...]:
        """Return the maps of a stage that nothing needs once its readers are done with each part."""
        read = {
            stages.map_read(other)
            for other in self.plan
            if stage.name in other.needs and not stages.reads_part(other)
        }
        return tuple(name for name in self._unwanted(stage) if name not in read)

    def _unwanted(self, stage: Stage) -> tuple[str, ...]:
        """Return the maps of a stage that are not for the user."""
        return tuple(name for name in stage.keep if name not in stored_maps(self.scene))

    def _key(self, name: str, number: int) -> str:
        return f"{name.replace('/', '.')}.{self.digests[name]}.{number:03d}"

    def groups(self) -> dict[str, xr.Dataset]:
        """Return what is wanted of the finished stages, without the maps that only other stages read."""
        return {
            stage.name: stages.without(self.results[stage.name], self._unwanted(stage))
            for stage in self.plan
            if stage.stored and stage.name in self.results
        }

    @property
    def seconds(self) -> dict[str, float]:
        """What the finished stages took in this run."""
        return {name: self.spent[name] for name in self.results}


def _sooner_again(stage: Stage, scene: Scene) -> bool:
    """Whether a face is made, or read from its own file, as soon as from a kept one."""
    table = scene.table("surface" if stage.name == "surfaces" else "upper")
    registers = stage.name == "joints/faces" and scene.registers
    is_face = stage.name in ("surfaces", "joints/faces")
    return is_face and not (registers or table.get("despike") or table.get("fill"))
