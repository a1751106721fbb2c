"""An ensemble: the study of every member, joined along the dim `member`.

The surface of a member comes from its own random stream, so that it can be generated wherever its study runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from fractalcontact.base import signals
from fractalcontact.base.progress import track
from fractalcontact.base.schema import encoded, label
from fractalcontact.scenes._checkpoint import PartStore
from fractalcontact.scenes._executor import Workers, run_tasks
from fractalcontact.scenes._inputs import surface_grid
from fractalcontact.scenes._parts import concatenate
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._study import Study

MEMBER = "member"
RAGGED = ("island", "link")  # dims whose length differs from member to member


@dataclass(frozen=True, repr=False)
class MemberResults:
    """Results of some members: their numbers, the joined results, the seconds of each stage."""

    members: list[int]
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
        results = {name: numbered(result, self.member) for name, result in study.groups().items()}
        return MemberResults([self.member], results, study.seconds)

    def _study(self, store: PartStore) -> Study:
        table = {key: value for key, value in self.scene.table("surface").items() if key != "members"}
        tables = {**self.scene.tables, "surface": table | {MEMBER: self.member}}
        return Study(replace(self.scene, tables=tables), store, progress=False, workers=self.workers)


class Ensemble:
    """One run of a scene with an ensemble: the results so far and the time they took."""

    def __init__(self, scene: Scene, store: PartStore, progress: bool, workers: Workers | None) -> None:
        self.scene, self.store, self.progress, self.workers = scene, store, progress, workers
        self.finished = MemberResults([], {}, {})

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
        results = [result for _, result in sorted(bar, key=lambda entry: entry[0])]
        if results:
            self.finished = _joined_members(results)
        done = len(results)
        return [] if done == count else [f"{count - done} of {count} members"]

    def groups(self) -> dict[str, xr.Dataset]:
        """Return the wanted results of the finished members."""
        return self.finished.results

    def preparation(self) -> dict[str, str | float]:
        """Return nothing: the surfaces of an ensemble are generated."""
        return {}

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds that each stage took in this run, all members together."""
        return self.finished.seconds


def _joined_members(results: Sequence[MemberResults]) -> MemberResults:
    """Join the results of members in the order given."""
    if len(results) == 1:
        return results[0]
    names = results[0].results
    return MemberResults(
        [member for result in results for member in result.members],
        {name: _joined([result.results[name] for result in results]) for name in names},
        {name: sum(result.seconds[name] for result in results) for name in results[0].seconds},
    )


def numbered(result: xr.Dataset, member: int) -> xr.Dataset:
    """Return the result of one member with its number as first dim, and beside every row of a ragged dim."""
    # the value of a load may differ from member to member
    loads = [name for name, coord in result.coords.items() if name != "step" and "step" in coord.dims]
    plain = result.drop_dims(RAGGED, errors="ignore").drop_indexes(loads, errors="ignore")
    dataset = plain.reset_coords(loads).expand_dims({MEMBER: [member]})
    dataset = dataset.set_coords(loads).assign_coords({MEMBER: label(dataset[MEMBER])})
    for dim in (dim for dim in RAGGED if dim in result.dims):
        number = xr.DataArray(np.full(result.sizes[dim], member), dims=dim, name=f"{dim}_{MEMBER}")
        dataset = dataset.merge(_rows(result, dim)).assign_coords({number.name: label(number)})
    for name, variable in result.variables.items():
        dataset[name].attrs = dict(variable.attrs)
    return encoded(dataset).assign_attrs(result.attrs)


def _joined(results: list[xr.Dataset]) -> xr.Dataset:
    """Join what all members have: along `member`, and the rows of ragged dims one after the other."""
    shared = set.intersection(*(set(result.variables) for result in results))
    common = [result.drop_vars(set(result.variables) - shared) for result in results]
    joined = concatenate([result.drop_dims(RAGGED, errors="ignore") for result in common], MEMBER)
    for dim in (dim for dim in RAGGED if dim in common[0].dims):
        joined = joined.merge(concatenate([_rows(result, dim) for result in common], dim))
    return joined


def _rows(result: xr.Dataset, dim: str) -> xr.Dataset:
    """Return the variables along a dim, and none of the others."""
    return result.drop_vars([name for name, variable in result.variables.items() if dim not in variable.dims])
