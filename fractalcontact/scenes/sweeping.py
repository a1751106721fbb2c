"""An ensemble: the study of every member, all stages of one after the other, joined along `member`.

A member's face comes from a random stream of its own, so that it can be made wherever its study runs. Workers
get the members in batches, each large enough that handing it over takes no time beside it, and smaller
towards the end, so that all workers end together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import signals
from fractalcontact.base.progress import track
from fractalcontact.base.schema import encoded, label
from fractalcontact.scenes import stages
from fractalcontact.scenes.keeping import Store
from fractalcontact.scenes.scene import Scene
from fractalcontact.scenes.studying import Study
from fractalcontact.scenes.working import carried_out

if TYPE_CHECKING:
    import xarray as xr

MEMBER = "member"
LISTS = ("island", "link")  # dims along which each member has as many as it has


@dataclass(frozen=True, repr=False)
class Found:
    """What the studies of some members gave: their numbers, the results joined, the seconds of each stage."""

    members: list[int]
    results: dict[str, xr.Dataset]
    seconds: dict[str, float]


@dataclass(frozen=True, repr=False)
class _Batch:
    """The studies of some members, one after the other; a client carries out the parts of each."""

    scene: Scene
    members: Sequence[int]
    client: Any = None

    @property
    def digests(self) -> list[str]:
        """The names of all stages of these members."""
        studies = [self._study(member, Store(None)) for member in self.members]
        return [digest for study in studies for digest in study.digests.values()]

    def __call__(self, store: Store, stop: signals.Stop) -> Found | None:
        """Return what the members gave that were not cut short by a stop, None if all were."""
        found = []
        for member in self.members:
            study = self._study(member, store)
            if stop or study.carry_out(stop):
                break
            results = {name: numbered(result, member) for name, result in study.groups().items()}
            found.append(Found([member], results, study.seconds))
        return together(found) if found else None

    def _study(self, member: int, store: Store) -> Study:
        table = {key: value for key, value in self.scene.table("surface").items() if key != "members"}
        tables = {**self.scene.tables, "surface": table | {MEMBER: member}}
        return Study(replace(self.scene, tables=tables), store, progress=False, client=self.client)


class Sweep:
    """One run of a scene with an ensemble: what is done so far, and what that took."""

    def __init__(self, scene: Scene, store: Store, progress: bool, client: Any) -> None:
        self.scene, self.store, self.progress, self.client = scene, store, progress, client
        self.found = Found([], {}, {})

    def carry_out(self, stop: signals.Stop) -> list[str]:
        """Study all members; return what is missing if a stop was asked for."""
        count = int(self.scene.table("surface")["members"])
        slots = 0 if self.client is None else sum(self.client.nthreads().values())
        if slots <= count and self.client is not None:
            batches, client = [_Batch(self.scene, batch) for batch in shares(count, slots)], self.client
        else:  # with more workers than members, those get the parts of one member after the other
            batches, client = [_Batch(self.scene, [number], self.client) for number in range(count)], None
        made = carried_out(dict(enumerate(batches)), self.store, stop, client)
        bar = track(made, self.progress, self.scene.name, unit="batch", total=len(batches))
        found = sorted((one for _, one in bar), key=lambda one: one.members)
        if found:
            self.found = together(found)
        done = len(self.found.members)
        return [] if done == count else [f"{count - done} of {count} members"]

    def groups(self) -> dict[str, xr.Dataset]:
        """Return what is wanted of the members that are done."""
        return self.found.results

    @property
    def seconds(self) -> dict[str, float]:
        """What each stage took in this run, all members together."""
        return self.found.seconds


def shares(count: int, workers: int) -> Iterator[range]:
    """Cut the numbers of the members into batches: each time half of what is left, over all workers."""
    start = 0
    while start < count:
        size = max(1, (count - start) // (2 * max(1, workers)))
        yield range(start, start + size)
        start += size


def together(found: Sequence[Found]) -> Found:
    """Join what several batches gave, in the order given."""
    if len(found) == 1:
        return found[0]
    results = {name: _joined([one.results[name] for one in found]) for name in found[0].results}
    seconds = {name: sum(one.seconds[name] for one in found) for name in found[0].seconds}
    return Found([member for one in found for member in one.members], results, seconds)


def numbered(result: xr.Dataset, member: int) -> xr.Dataset:
    """Return the result of one member with its number ahead of the dims, and beside all that is listed."""
    import xarray as xr

    # what a load came to may differ from member to member
    beside = [name for name, coord in result.coords.items() if name != "step" and "step" in coord.dims]
    told = result.drop_dims(LISTS, errors="ignore").reset_coords(beside).expand_dims({MEMBER: [member]})
    told = told.set_coords(beside).assign_coords({MEMBER: label(told[MEMBER])})
    for dim in (dim for dim in LISTS if dim in result.dims):
        whose = xr.DataArray(np.full(result.sizes[dim], member), dims=dim, name=f"{dim}_{MEMBER}")
        told = told.merge(_listed(result, dim)).assign_coords({whose.name: label(whose)})
    for name, variable in result.variables.items():
        told[name].attrs = dict(variable.attrs)
    return encoded(told).assign_attrs(result.attrs)


def _joined(results: list[xr.Dataset]) -> xr.Dataset:
    """Join what all results have: along the members, and lists one behind the other."""
    shared = set.intersection(*(set(one.variables) for one in results))
    common = [one.drop_vars(set(one.variables) - shared) for one in results]
    whole = stages.joined([one.drop_dims(LISTS, errors="ignore") for one in common], MEMBER)
    for dim in (dim for dim in LISTS if dim in common[0].dims):
        whole = whole.merge(stages.joined([_listed(one, dim) for one in common], dim))
    return whole


def _listed(result: xr.Dataset, dim: str) -> xr.Dataset:
    """Return the variables along a list, and none of the others."""
    return result.drop_vars([name for name, variable in result.variables.items() if dim not in variable.dims])
