"""An ensemble: the study of every member, joined along the dim `member`.

The surface of a member comes from its own random stream, so that it can be generated wherever its study runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import xarray as xr

from fractalcontact.base import signals
from fractalcontact.base.progress import track
from fractalcontact.scenes._checkpoint import PartStore
from fractalcontact.scenes._executor import Workers, run_tasks
from fractalcontact.scenes._inputs import surface_grid
from fractalcontact.scenes._result_tables import MEMBER
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._stacked_results import stacked
from fractalcontact.scenes._study import Study


@dataclass(frozen=True, repr=False)
class MemberResults:
    """Results of one member by stage, and the seconds of each stage."""

    results: dict[str, xr.Dataset]
    seconds: dict[str, float]


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

    def __call__(self, store: PartStore, stop: signals.Stop) -> MemberResults | None:
        """Return the results of the member; None if a stop cut it short."""
        study = self._study(store)
        if stop or study.run(stop):
            return None
        return MemberResults(study.groups(), study.seconds)

    def _study(self, store: PartStore) -> Study:
        table = {key: value for key, value in self.scene.table("surface").items() if key != "members"}
        tables = {**self.scene.tables, "surface": table | {MEMBER: self.member}}
        return Study(replace(self.scene, tables=tables), store, progress=False, workers=self.workers)


class Ensemble:
    """One run of a scene with an ensemble: the results so far and the time they took."""

    def __init__(self, scene: Scene, store: PartStore, progress: bool, workers: Workers | None) -> None:
        self.scene, self.store, self.progress, self.workers = scene, store, progress, workers
        self.finished: dict[int, MemberResults] = {}

    def run(self, stop: signals.Stop) -> list[str]:
        """Study all members; return what is missing if a stop was requested."""
        count = int(self.scene.surface.members or 0)
        # with more workers than members, the parts of one member after the other are shared
        share_parts = self.workers is not None and self.workers.count > count
        of_parts, of_members = (self.workers, None) if share_parts else (None, self.workers)
        tasks = {member: _MemberTask(self.scene, member, of_parts) for member in range(count)}
        points = math.prod(surface_grid(self.scene)[0])
        finished = run_tasks(tasks, self.store, stop, of_members, points=points)
        bar = track(finished, self.progress, self.scene.name, unit="member", total=count)
        self.finished = dict(sorted(bar, key=lambda entry: entry[0]))
        done = len(self.finished)
        return [] if done == count else [f"{count - done} of {count} members"]

    def groups(self) -> dict[str, xr.Dataset]:
        """Return the wanted results of the finished members."""
        members = {member: each.results for member, each in self.finished.items()}
        names = next(iter(members.values()), {})
        return {
            name: stacked({member: results[name] for member, results in members.items()}, MEMBER)
            for name in names
        }

    @property
    def failures(self) -> dict[str, str]:
        """Return nothing: a stage that fails ends the study."""
        return {}

    def preparation(self) -> dict[str, str | float]:
        """Return nothing: the surfaces of an ensemble are generated."""
        return {}

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds that each stage took in this run, all members together."""
        spent: dict[str, float] = {}
        for each in self.finished.values():
            spent |= {name: spent.get(name, 0.0) + seconds for name, seconds in each.seconds.items()}
        return spent
