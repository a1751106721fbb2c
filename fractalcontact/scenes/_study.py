"""One run of a scene, every stage of its plan and every part once, resumed where it stopped; or an ensemble.

An ensemble is the study of every member, joined along the dim `member`. The surface of a member comes from
its own random stream, so that it can be generated wherever its study runs. Many scans are joined alike.
"""

from __future__ import annotations

import math
import time
from collections.abc import Hashable, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import signals
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import encoded, label
from fractalcontact.base.signals import track
from fractalcontact.base.study import MEMBER
from fractalcontact.scenes import _parts
from fractalcontact.scenes._executor import Workers, run_tasks
from fractalcontact.scenes._inputs import plane_share, surface_grid
from fractalcontact.scenes._parts import StageWork, concatenate
from fractalcontact.scenes._results_folder import PartStore, digest
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._stages import FIGURES, STAGES, Stage, stages_of

_Results = tuple[list[xr.Dataset | Exception], list[float]]


@dataclass(frozen=True, repr=False)
class _PartTask:
    """A part of a stage with the stages that read its result, and the keys under which results are kept.

    Each of the `calls` but the first one takes the result of the part; of that, maps that nothing else needs
    are `dropped` afterwards. What fails has its error as result: the others are kept.
    """

    calls: tuple[_parts.Reader, ...]
    dropped: tuple[str, ...]
    stages: tuple[str, ...]
    keys: tuple[str, ...]

    def __call__(self, store: PartStore, stop: signals.Stop) -> _Results | None:
        """Return the results and the seconds each took; None if a stop was requested before it began."""
        if stop:
            return None
        results: list[xr.Dataset | Exception] = []
        seconds = []
        for call in self.calls:
            start = time.perf_counter()
            results.append(_attempted(call, *results[:1]))
            seconds.append(time.perf_counter() - start)
        if isinstance(results[0], xr.Dataset):
            results[0] = _parts.without(results[0], self.dropped)
        for key, result in zip(self.keys, results, strict=False):
            if isinstance(result, xr.Dataset):
                store.put(key, result)
        return results, seconds


def _attempted(call: _parts.Reader, *source: xr.Dataset | Exception) -> xr.Dataset | Exception:
    """Return the result of a call, or the error that it, or the call before it, ended with."""
    if source and isinstance(source[0], Exception):
        return source[0]
    try:
        return call(*source)
    except Exception as error:
        return error


@dataclass(frozen=True, repr=False)
class StudyResults:
    """What a run came to.

    Attributes
    ----------
    groups : dict
        The wanted results of the finished stages, by group.
    seconds : dict
        Seconds that each stage took in this run, all members together.
    missing : list of str
        What a stop has left out.
    failures : dict of str to str
        Stages that failed, or need one that did, and why.
    preparation : dict
        What was done to the faces, in words, of an ensemble to those of its first member; and how much of the
        heights is a tilt, in each member.
    """

    groups: dict[str, xr.Dataset]
    seconds: dict[str, float]
    missing: list[str] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    preparation: dict[str, Any] = field(default_factory=dict)

    @property
    def reasons(self) -> list[str]:
        """Every reason once, with the stages that failed for it."""
        stages: dict[str, list[str]] = {}
        for stage, reason in self.failures.items():
            stages.setdefault(reason, []).append(stage)
        return [f"{', '.join(names)}: {reason}" for reason, names in stages.items()]


@dataclass
class Study:
    """One run of a scene with one surface: the results so far and the time they took.

    Attributes
    ----------
    faces : mapping
        The faces of `[surface]` and `[upper]` that were read to validate the scene; others are read here.
    parts : dict
        Results of the finished parts of each stage, by number.
    results : dict
        Joined results of the finished stages.
    spent : dict
        Seconds that each stage took in this run.
    failures : dict of str to str
        Stages that failed, or need one that did, and why; empty unless the study `goes_on` without them.
    """

    scene: Scene
    store: PartStore
    progress: bool = False
    workers: Workers | None = None
    goes_on: bool = False
    faces: Mapping[str, xr.DataArray] = field(default_factory=dict)
    parts: dict[str, dict[int, xr.Dataset]] = field(default_factory=dict)
    results: dict[str, xr.Dataset] = field(default_factory=dict)
    spent: dict[str, float] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    works: dict[str, StageWork] = field(default_factory=dict)

    @cached_property
    def plan(self) -> tuple[Stage, ...]:
        """The stages."""
        return stages_of(self.scene)

    @cached_property
    def digests(self) -> dict[str, str]:
        """Digests of all that can change the result of a stage, by its name."""
        digests: dict[str, str] = {}
        for stage in self.plan:
            digests[stage.name] = digest(stage, self.scene, digests)
        return digests

    def run(self, stop: signals.Stop) -> StudyResults:
        """Run all stages, or those before a stop was requested.

        The surfaces come first, so that faces which do not fit are refused before a part is kept. The parts
        of all stages whose needs are met then run side by side, where there are workers or a copy of this
        process.
        """
        stages = [stage for stage in self.plan if stage.name != FIGURES]
        faces = [stage for stage in stages if stage.row.takes == "file"]
        for left in (faces, [stage for stage in stages if stage not in faces]):
            while left and not stop:
                waiting = {stage.name for stage in left}
                ready = [stage for stage in left if waiting.isdisjoint(stage.needs)]
                self._run_stages(ready, stop)
                left = [stage for stage in left if stage not in ready]
        names = [stage.name for stage in stages if stage.name in self.results]
        self.results = {name: self.results[name] for name in names}
        missing = [line for stage in stages for line in self._missing(stage)] if stop else []
        seconds = {name: self.spent[name] for name in self.results}
        return StudyResults(self._groups(), seconds, missing, self.failures, self._preparation())

    def _missing(self, stage: Stage) -> list[str]:
        """Return the name of a stage with missing parts, and how many are there; nothing if it failed."""
        if stage.name in self.failures:
            return []
        done = len(self.parts.get(stage.name, ()))
        total = len(self.works[stage.name].parts) if stage.name in self.works else 0
        if done and total:
            return [f"{stage.name} ({done} of {total} parts done)"] if done < total else []
        return [stage.name]

    def _run_stages(self, stages: list[Stage], stop: signals.Stop) -> None:
        """Run the missing parts of stages that do not need each other, and join them."""
        of_stages: list[dict[tuple[str, int], _PartTask]] = []
        for stage in (stage for stage in stages if not self._lacks(stage)):
            try:
                work = _parts.stage_work(stage, self.scene, self.results, self.works, self.faces)
                self.works[stage.name] = work
                of_stages.append(self._tasks(stage))
            except Exception as error:
                self._fail(stage.name, error)
        # stages in one part first: the short parts of the others then end at the same time in two processes
        tasks = {key: task for own in sorted(of_stages, key=len) for key, task in own.items()}
        several = len(tasks) > 1
        workers = self.workers if several else None
        wide = [(stage.name, 0) for stage in stages if stage.whole_path]  # a thread for each map
        draws = self.store.folder is not None and self.scene.want.figures
        later = _load_plotting if draws else None
        points = int(self.results["surfaces"]["height"].size) if "surfaces" in self.results else 0
        running = run_tasks(tasks, self.store, stop, workers, points=points, wide=wide, meanwhile=later)
        # closed after an error too: parts that a copy of this process has begun are kept
        with closing(running) as finished:
            show = self.progress and several
            bar = track(finished, show, self.scene.name, unit="part", total=len(tasks))
            for key, (results, seconds) in bar:
                for name, result, spent in zip(tasks[key].stages, results, seconds, strict=True):
                    if isinstance(result, Exception):
                        self._fail(name, result)
                    else:
                        self.parts[name][key[1]] = result
                    self.spent[name] = self.spent.get(name, 0.0) + spent
        for stage in (stage for stage in stages if stage.name not in self.failures):
            self.spent.setdefault(stage.name, 0.0)
            joined = self.works[stage.name].join(self.parts[stage.name])
            if joined is not None:
                self.results[stage.name] = joined

    def _lacks(self, stage: Stage) -> bool:
        """Whether a stage has failed, or cannot run because one that it needs has."""
        failed = [name for name in (stage.name, *stage.needs) if name in self.failures]
        if failed:
            self.failures[stage.name] = self.failures[failed[0]]
        return bool(failed)

    def _fail(self, name: str, error: Exception) -> None:
        """Note why a stage failed, if the study goes on without it."""
        if not self.goes_on or STAGES[name].takes == "file":
            raise error
        self.failures[name] = reason_of(error)

    def _tasks(self, stage: Stage) -> dict[tuple[str, int], _PartTask]:
        """Return the missing parts of a stage, each with the stages that follow it."""
        work = self.works[stage.name]
        # the stages that read this one part by part, before its maps are dropped
        readers = [other for other in self.plan if other.follows == stage.name]
        functions = tuple(_parts.reader_of(reader, self.scene, self.results) for reader in readers)
        names = (stage.name, *(reader.name for reader in readers))
        for name in names:
            parts = self.parts.setdefault(name, {})
            for number in set(range(len(work.parts))) - set(parts):
                if (kept := self.store.get(self._key(name, number))) is not None:
                    parts[number] = kept
        kept_names = () if _is_fast_to_repeat(stage, self.scene) else names
        tasks = {}
        for number, part in enumerate(work.parts):
            if all(number in self.parts[name] for name in names):
                continue
            done = self.parts[stage.name].get(number)
            if done is not None and all(name in done for name in stage.keep):
                part = done.copy  # computed by an earlier run
            keys = tuple(self._key(name, number) for name in kept_names)
            tasks[stage.name, number] = _PartTask((part, *functions), stage.dropped, names, keys)
        return tasks

    def _key(self, name: str, number: int) -> str:
        return f"{name.replace('/', '.')}.{self.digests[name]}.{number:03d}"

    def _groups(self) -> dict[str, xr.Dataset]:
        """Return the wanted results of the finished stages, without the maps that only other stages read."""
        return {
            stage.name: _parts.without(self.results[stage.name], stage.internal)
            for stage in self.plan
            if stage.stored and stage.name in self.results
        }

    def _preparation(self) -> dict[str, str | float]:
        """Return what was done to the faces, in words, and how much of the heights is a tilt."""
        if "surfaces" not in self.results:
            return {}
        height, upper = self.results["surfaces"]["height"], self.results.get("joints/faces")
        faces = {"": height} if upper is None else {"lower face: ": height, "upper face: ": upper}
        done = {start: face.attrs.get("preparation") for start, face in faces.items()}
        text = "; ".join(f"{start}{words}" for start, words in done.items() if words)
        facts: dict[str, str | float] = {"preparation": text} if text else {}
        if self.scene.is_pressed and height.ndim == 2:
            facts["plane_share"] = plane_share(height)
        return facts


def reason_of(error: Exception) -> str:
    """Return why something failed, in one line."""
    return (
        "; ".join(error.problems) if isinstance(error, InvalidInput) else f"{type(error).__name__}: {error}"
    )


def _load_plotting() -> None:
    """Import what draws the figures, which takes .25 s."""
    with suppress(ImportError):  # raised again when the figures are drawn, after the results are saved
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401

        from fractalcontact.plotting import draw  # noqa: F401


def _is_fast_to_repeat(stage: Stage, scene: Scene) -> bool:
    """Whether a surface is made again as fast as read from a kept part; validation makes it anyway."""
    return stage.name == "surfaces" or (stage.name == "joints/faces" and not scene.joint.register)


@dataclass(frozen=True, repr=False)
class _MemberTask:
    """The study of one member; with `workers` its parts are shared."""

    scene: Scene
    member: int
    workers: Workers | None = None

    @property
    def digests(self) -> list[str]:
        """The digests of all stages of this member."""
        return list(self._study(PartStore(None)).digests.values())

    def __call__(self, store: PartStore, stop: signals.Stop) -> StudyResults | None:
        """Return the results of the member; None if a stop cut it short."""
        done = None if stop else self._study(store).run(stop)
        return None if done is None or done.missing else done

    def _study(self, store: PartStore) -> Study:
        table = {key: value for key, value in self.scene.table("surface").items() if key != "members"}
        tables = {**self.scene.tables, "surface": table | {MEMBER: self.member}}
        return Study(replace(self.scene, tables=tables), store, workers=self.workers)


def study_ensemble(
    scene: Scene, store: PartStore, progress: bool, workers: Workers | None, stop: signals.Stop
) -> StudyResults:
    """Study all members, or those before a stop was requested; a stage that fails ends the study."""
    count = int(scene.surface.members or 0)
    # with more workers than members, the parts of one member after the other are shared
    share_parts = workers is not None and workers.count > count
    of_parts, of_members = (workers, None) if share_parts else (None, workers)
    tasks = {member: _MemberTask(scene, member, of_parts) for member in range(count)}
    points = math.prod(surface_grid(scene)[0])
    finished = run_tasks(tasks, store, stop, of_members, points=points)
    bar = track(finished, progress, scene.name, unit="member", total=count)
    members = dict(sorted(bar, key=lambda entry: entry[0]))
    names = next(iter(members.values())).groups if members else {}
    groups = {
        name: stacked({member: done.groups[name] for member, done in members.items()}, MEMBER)
        for name in names
    }
    seconds = total_seconds(done.seconds for done in members.values())
    missing = [f"{count - len(members)} of {count} members"] if len(members) < count else []
    facts = _preparation_of_members({member: done.preparation for member, done in members.items()})
    return StudyResults(groups, seconds, missing, preparation=facts)


def _preparation_of_members(facts: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what was done to the faces of the first member, and how much of each member is a tilt."""
    first, own = next(iter(facts.items()), (0, {}))
    words = [f"member {first}: {text}" for text in own.get("preparation", "").split("; ") if text]
    shares = [each["plane_share"] for each in facts.values() if "plane_share" in each]
    attributes = {"preparation": "; ".join(words), "plane_share": shares}
    return {name: fact for name, fact in attributes.items() if fact}


def total_seconds(of_studies: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Return the seconds that each stage took in all studies together."""
    total: dict[str, float] = {}
    for seconds in of_studies:
        total |= {name: total.get(name, 0.0) + spent for name, spent in seconds.items()}
    return total


RAGGED = ("island", "link")  # dims whose length differs from study to study: their rows are listed
BLANK = {"b": False, "U": "", "S": b""}  # by kind of type; of numbers not a number


def stacked(results: Mapping[Any, xr.Dataset], dim: str) -> xr.Dataset:
    """Return results as one along `dim`, whose coordinate are their keys.

    Words and numbers that label a dim are joined. Where scales in metres differ, the dim becomes their
    `..._number`: the values stand one after the other, NaN behind the last, and the scales beside them. Rows
    of `RAGGED` dims are listed, each with its key.
    """
    aligned = _aligned(list(results.values()))
    loads = _own_coords(aligned)
    each = [_numbered(*entry, dim, loads) for entry in zip(aligned, results, strict=True)]
    shared = set.intersection(*(set(result.variables) for result in each))
    common = [result.drop_vars(set(result.variables) - shared) for result in each]
    joined = concatenate([result.drop_dims(RAGGED, errors="ignore") for result in common], dim)
    for rows in (rows for rows in RAGGED if rows in common[0].dims):
        joined = joined.merge(concatenate([_rows(result, rows) for result in common], rows))
    return encoded(joined)


def _aligned(results: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return results whose dims, but for ragged ones, are equally long and have equal coordinates."""
    aligned = list(results)
    for dim in dict.fromkeys(dim for result in results for dim in result.dims if dim not in RAGGED):
        indexes = [result.get_index(dim) for result in aligned if dim in result.dims]
        if all(index.equals(indexes[0]) for index in indexes):
            continue
        if any(index.dtype.kind == "f" for index in indexes):
            aligned = [_by_number(result, dim) for result in aligned]
            dim = f"{dim}_number"
        having = [result for result in aligned if dim in result.dims]
        union = list(dict.fromkeys(value for result in having for value in result.get_index(dim)))
        aligned = [_reindexed(result, dim, union) for result in aligned]
    return aligned


def _by_number(result: xr.Dataset, dim: Hashable) -> xr.Dataset:
    """Return a result over the numbers of the values along a dim; the values are a further coordinate."""
    if dim not in result.dims:
        return result
    labels = [name for name in result.xindexes if result.coords[name].dims == (dim,)]
    return result.drop_indexes(labels).rename_dims({dim: f"{dim}_number"}).assign_attrs(result.attrs)


def _reindexed(result: xr.Dataset, dim: Hashable, values: list[Any]) -> xr.Dataset:
    if dim not in result.dims:
        return result
    has_coord = dim in result.coords
    indexed = result if has_coord else result.assign_coords({dim: result.get_index(dim)})
    kinds = {name: each.dtype.kind for name, each in result.variables.items() if name != dim}
    fill = {name: BLANK.get(kind, np.nan) for name, kind in kinds.items()}
    full = indexed.reindex({dim: values}, fill_value=fill)
    return full if has_coord else full.drop_vars([dim])


def _own_coords(results: Sequence[xr.Dataset]) -> set[Hashable]:
    """Return the coordinates that each result has for itself: loads, and all that differ."""
    own = {name for result in results for name, coord in result.coords.items() if "step" in coord.dims}
    for name, first in results[0].coords.items():
        others = (result.coords[name].variable for result in results[1:] if name in result.coords)
        if first.dims and not all(map(first.variable.equals, others)):
            own.add(name)
    return {name for name in own if name not in (*results[0].dims, *RAGGED)}


def _numbered(result: xr.Dataset, key: Any, dim: str, own: set[Hashable]) -> xr.Dataset:
    """Return a result with its key as first dim, and beside every row of a ragged dim."""
    plain = result.drop_dims(RAGGED, errors="ignore")
    coords = [name for name in plain.coords if name in own]
    plain = plain.drop_indexes(coords, errors="ignore").reset_coords(coords)
    dataset = plain.expand_dims({dim: [key]}).set_coords(coords)
    dataset = dataset.assign_coords({dim: label(dataset[dim])})
    for rows in (rows for rows in RAGGED if rows in result.dims):
        keys = xr.DataArray(np.full(result.sizes[rows], key), dims=rows, name=f"{rows}_{dim}")
        dataset = dataset.merge(_rows(result, rows)).assign_coords({keys.name: label(keys)})
    for name, variable in result.variables.items():
        dataset[name].attrs = dict(variable.attrs)
    return dataset.assign_attrs(result.attrs)


def _rows(result: xr.Dataset, dim: str) -> xr.Dataset:
    """Return the variables along a dim, and none of the others."""
    return result.drop_vars([name for name, variable in result.variables.items() if dim not in variable.dims])
