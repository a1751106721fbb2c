"""Many scans: each is an ordinary study in its own folder, and their numbers are stacked along `scan`.

A finished scan is one file, `scans/NAME/result.nc`. Whatever ends a run, the next one takes the finished
scans as they are; it repeats those that failed, and those whose file or settings have changed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from fractalcontact.base import signals
from fractalcontact.base.errors import FractalContactError, InvalidInput
from fractalcontact.base.netcdf import open as open_result
from fractalcontact.base.netcdf_header import read_headers
from fractalcontact.base.output_folder import RESULT
from fractalcontact.base.progress import track
from fractalcontact.base.results import provenance_of
from fractalcontact.base.schema import label
from fractalcontact.scenes._checkpoint import PartStore, digest_of
from fractalcontact.scenes._executor import Workers, run_tasks
from fractalcontact.scenes._overview import OVERVIEW, SCANS, folder_of
from fractalcontact.scenes._result_tables import SCAN
from fractalcontact.scenes._results_folder import REPORT
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._stacked_results import stacked
from fractalcontact.scenes._study import Study
from fractalcontact.scenes._tables import MAP_DIMS

DIGEST = "study_digest"  # attribute of a finished scan: of its file, its settings and the version
NO_ACCESS = "the worker does not see the folder of the results"

StudyOne = Callable[[Scene, Path, signals.Stop, Mapping[str, str]], None]


@dataclass(frozen=True, repr=False)
class _ScanTask:
    """The study of one scan in its folder; returns why it failed, empty if it did not."""

    scene: Scene
    folder: Path
    study: StudyOne

    def __call__(self, store: PartStore, stop: signals.Stop) -> str | None:
        """Return the reason; None if a stop cut the study short."""
        del store
        if stop:
            return None
        try:
            if not self.folder.parent.is_dir():
                return NO_ACCESS
            digests = Study(self.scene, PartStore(None), progress=False, workers=None).digests
            digest = digest_of([digests, self.scene.want.figures])
            if not _is_finished(self.folder, digest):
                for name in (RESULT, REPORT):
                    (self.folder / name).unlink(missing_ok=True)
                self.study(self.scene, self.folder, stop, {DIGEST: digest})
        except signals.Stopped:
            return None
        except Exception as error:  # whatever it is, the other scans go on, and the table states it
            if isinstance(error, InvalidInput):
                return "; ".join(error.problems)
            return f"{type(error).__name__}: {error}"
        return ""


def _is_finished(folder: Path, digest: str) -> bool:
    if not (folder / RESULT).is_file() or not (folder / REPORT).is_file():  # the report is written last
        return False
    try:
        return read_headers(folder / RESULT, lambda _: False)["/"].attrs.get(DIGEST) == digest
    except FractalContactError:
        return False


@dataclass
class ScanStudies:
    """The studies of the scans of a scene: why some failed, and their results as far as they are finished.

    Attributes
    ----------
    reasons : dict of str to str
        By scan; empty where it is finished.
    """

    scans: Mapping[str, Scene]
    folder: Path
    reasons: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    numbers: dict[str, xr.Dataset] = field(default_factory=dict)

    def run(self, study: StudyOne, workers: Workers | None, stop: signals.Stop, *, progress: bool) -> None:
        """Study the scans that are not finished; each failure is a reason."""
        names = list(self.scans)
        folders = [self.folder / SCANS / folder_of(name) for name in names]
        (self.folder / SCANS).mkdir(exist_ok=True)
        tasks = {
            number: _ScanTask(self.scans[name], folders[number], study) for number, name in enumerate(names)
        }
        # of formats with two bytes for each point, the smallest
        points = max((file.stat().st_size // 2 for file in self._sources()), default=0)
        finished = run_tasks(tasks, PartStore(self.folder), stop, workers, points=points)
        bar = track(finished, progress, SCANS, unit=SCAN, total=len(names))
        found = dict(sorted(bar, key=lambda entry: entry[0]))
        self.reasons = {
            names[number]: reason or ("" if (folders[number] / RESULT).is_file() else NO_ACCESS)
            for number, reason in found.items()
        }

    def _sources(self) -> Iterator[Path]:
        for scene in self.scans.values():
            file = scene.folder / os.path.expandvars(str(scene.surface.read))
            if file.is_file():
                yield file

    @property
    def missing(self) -> int:
        """How many scans a stop has left out."""
        return len(self.scans) - len(self.reasons)

    def maps(self) -> Iterator[tuple[str, xr.Dataset]]:
        """Yield the maps of every finished scan, and keep its numbers: one scan is in memory at a time."""
        roots: dict[str, xr.Dataset] = {}
        trees: dict[str, dict[str, xr.Dataset]] = {}
        for name in (name for name, reason in self.reasons.items() if not reason):
            tree = open_result(self.folder / SCANS / folder_of(name) / RESULT)
            roots[name], trees[name] = tree.to_dataset(inherit=False), {}
            for stage, facts in provenance_of(roots[name]).get("stages", {}).items():
                self.seconds[stage] = self.seconds.get(stage, 0.0) + float(facts["run_time"])
            for node in tree.subtree:
                data, path = node.to_dataset(inherit=False), node.path.strip("/")
                flat = [key for key, variable in data.data_vars.items() if not set(variable.dims) >= MAP_DIMS]
                maps = data.drop_vars(flat)
                if path and maps.data_vars:
                    yield f"/{SCANS}/{folder_of(name)}/{path}", maps
                if path and data.data_vars:
                    trees[name][path] = data.drop_dims(MAP_DIMS, errors="ignore")
        paths = dict.fromkeys(path for groups in trees.values() for path in groups)
        for path in paths:
            having = {name: groups[path] for name, groups in trees.items() if path in groups}
            if any(data.data_vars for data in having.values()):
                self.numbers[path] = stacked(having, SCAN)
        self.numbers[OVERVIEW] = self._overview(roots)

    def _overview(self, roots: Mapping[str, xr.Dataset]) -> xr.Dataset:
        """Return a row for every scan: what stands for its study, whether it failed, and why."""
        names = list(self.reasons)
        table = xr.Dataset(coords={SCAN: names})
        for key in dict.fromkeys(key for root in roots.values() for key in root.data_vars):
            values = [
                float(roots[name].get(key, float("nan"))) if name in roots else float("nan") for name in names
            ]
            attributes = dict(next(root[key].attrs for root in roots.values() if key in root))
            attributes["long_name"] = attributes["long_name"].partition(", of the group")[0]
            table[key] = (SCAN, values, attributes)
        table["status"] = (SCAN, ["failed" if self.reasons[name] else "done" for name in names])
        table["reason"] = (SCAN, [self.reasons[name] for name in names], {"long_name": "why it failed"})
        caveats = {
            name: str(root.attrs.get("caveats", "none")).replace("none", "") for name, root in roots.items()
        }
        table["caveats"] = (SCAN, [caveats.get(name, "") for name in names])
        return label(table, keep_notes=True)
