"""Many scans: each is an ordinary study in its own folder, and their numbers are stacked along `scan`.

A finished scan is one file, `scans/NAME/result.nc`. Whatever ends a run, the next one takes the finished
scans as they are; it repeats those that failed, and those whose file or settings have changed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from fractalcontact.base import signals
from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.file_contents import read_headers
from fractalcontact.base.files import RESULT
from fractalcontact.base.netcdf import GrowingFile, groups_over
from fractalcontact.base.netcdf import open as open_result
from fractalcontact.base.schema import label
from fractalcontact.base.signals import track
from fractalcontact.base.study import provenance_of
from fractalcontact.scenes._executor import Workers, run_tasks
from fractalcontact.scenes._export import MAP_DIMS
from fractalcontact.scenes._result_tables import SCAN
from fractalcontact.scenes._result_tree import OVERVIEW, PARTIAL, in_words, main_results
from fractalcontact.scenes._results_folder import REPORT, SCANS, PartStore, digest_of, folder_of
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._study import Study, reason_of, stacked

DIGEST = "study_digest"  # attribute of a finished scan: of its file, its settings and the version
NO_ACCESS = "the worker does not see the folder of the results"
StudyOne = Callable[[Scene, Path, signals.Stop, Mapping[str, str]], xr.DataTree]
Numbers = dict[str, xr.Dataset]


@dataclass(frozen=True, repr=False)
class _ScanTask:
    """The study of one scan in its folder."""

    scene: Scene
    folder: Path
    study: StudyOne

    def __call__(self, store: PartStore, stop: signals.Stop) -> tuple[str, Numbers] | None:
        """Return why it or some of its stages failed, and its numbers; None if a stop cut the study short."""
        del store
        if stop:
            return None
        try:
            if not self.folder.parent.is_dir():
                return NO_ACCESS, {}
            digests = Study(self.scene, PartStore(None)).digests
            digest = digest_of([digests, self.scene.want.figures])
            if _is_finished(self.folder, digest):
                return "", _numbers(open_result(self.folder / RESULT))
            for name in (RESULT, REPORT):
                (self.folder / name).unlink(missing_ok=True)
            tree = self.study(self.scene, self.folder, stop, {DIGEST: digest})
            return str(tree.attrs.get("completeness", "")).removeprefix(PARTIAL), _numbers(tree)
        except signals.Stopped:
            return None
        except Exception as error:  # whatever it is, the other scans go on, and the table states it
            return reason_of(error), {}


def _is_finished(folder: Path, digest: str) -> bool:
    if not (folder / RESULT).is_file() or not (folder / REPORT).is_file():  # the report is written last
        return False
    try:
        return read_headers(folder / RESULT, lambda _: False)["/"].attrs.get(DIGEST) == digest
    except FractalContactError:
        return False


def _numbers(tree: xr.DataTree) -> Numbers:
    """Return the groups of a result without its maps."""
    groups = {node.path.strip("/"): node.to_dataset(inherit=False) for node in tree.subtree}
    return {name: data.drop_dims(MAP_DIMS, errors="ignore") for name, data in groups.items()}


@dataclass
class ScanStudies:
    """The studies of the scans of a scene: why some failed, and their numbers as far as they are finished.

    Attributes
    ----------
    reasons : dict of str to str
        By scan, why it or some of its stages failed; empty where it is finished.
    numbers : dict of str to mapping
        The groups of each scan that has a result; "" is their root.
    """

    scans: Mapping[str, Scene]
    folder: Path
    reasons: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Numbers] = field(default_factory=dict)

    def run(
        self,
        study: StudyOne,
        file: GrowingFile,
        workers: Workers | None,
        stop: signals.Stop,
        *,
        progress: bool,
    ) -> None:
        """Study the scans that are not finished; each failure is a reason.

        The maps of a scan are written to the file of all as soon as those of the scans before it are: this
        process has time for it while workers study the next ones.
        """
        names = list(self.scans)
        (self.folder / SCANS).mkdir(exist_ok=True)
        tasks = {
            name: _ScanTask(scene, self.folder / SCANS / folder_of(name), study)
            for name, scene in self.scans.items()
        }
        # of formats with two bytes for each point, the smallest
        points = max((source.stat().st_size // 2 for source in self._sources()), default=0)
        finished = run_tasks(tasks, PartStore(self.folder), stop, workers, points=points)
        found: dict[str, tuple[str, Numbers]] = {}
        for name, result in track(finished, progress, SCANS, unit=SCAN, total=len(names)):
            found[name] = result
            while len(self.reasons) < len(names) and names[len(self.reasons)] in found:
                self._add(names[len(self.reasons)], *found.pop(names[len(self.reasons)]), file)
        for name in found:  # behind one that a stop left out
            self._add(name, *found[name], file)

    def _add(self, name: str, reason: str, numbers: Numbers, file: GrowingFile) -> None:
        """Note the result of a scan, and write its maps."""
        result = self.folder / SCANS / folder_of(name) / RESULT
        if not numbers or not result.is_file():
            self.reasons[name] = NO_ACCESS if numbers else reason
            return
        if not self.numbers:  # the groups of all scans come before those of each
            paths = (OVERVIEW, *(path for path in numbers if path and numbers[path].data_vars))
            file.add_groups({f"/{path}": xr.Dataset() for path in paths})
        self.reasons[name], self.numbers[name] = reason, numbers
        place = f"/{SCANS}/{result.parent.name}"
        file.add_groups({place + path: maps for path, maps in groups_over(result, MAP_DIMS).items()})

    def _sources(self) -> Iterator[Path]:
        for scene in self.scans.values():
            file = scene.folder / os.path.expandvars(str(scene.surface.read))
            if file.is_file():
                yield file

    @property
    def missing(self) -> int:
        """How many scans a stop has left out."""
        return len(self.scans) - len(self.reasons)

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds that each stage took, all scans together."""
        total: dict[str, float] = {}
        for groups in self.numbers.values():
            for stage, facts in provenance_of(groups[""]).get("stages", {}).items():
                total[stage] = total.get(stage, 0.0) + float(facts["run_time"])
        return total

    def groups(self) -> Numbers:
        """Return the numbers of all scans along `scan`, and the overview."""
        groups = {OVERVIEW: self._overview()}
        for path in dict.fromkeys(path for each in self.numbers.values() for path in each if path):
            having = {name: each[path] for name, each in self.numbers.items() if path in each}
            if any(data.data_vars for data in having.values()):
                groups[path] = stacked(having, SCAN)
        return groups

    def main(self) -> xr.Dataset:
        """Return the main results of all scans, NaN where a scan has none."""
        mains = {name: main_results(groups) for name, groups in self.numbers.items()}
        table = xr.Dataset(coords={SCAN: list(self.reasons)})
        for key in dict.fromkeys(key for main in mains.values() for key in main.data_vars):
            found = {name: main[key] for name, main in mains.items() if key in main}
            values = [float(found.get(name, np.nan)) for name in self.reasons]
            table[key] = (SCAN, values, next(iter(found.values())).attrs)
        return table

    def _overview(self) -> xr.Dataset:
        """Return a row for every scan: what stands for its study, whether it failed, and why."""
        names, roots = list(self.reasons), {name: each[""] for name, each in self.numbers.items()}
        table = in_words(self.main(), with_group=False)
        table["status"] = (
            SCAN,
            [
                "failed" if name not in roots else "incomplete" if self.reasons[name] else "done"
                for name in names
            ],
        )
        table["reason"] = (SCAN, [self.reasons[name] for name in names], {"long_name": "why it failed"})
        caveats = {
            name: str(root.attrs.get("caveats", "none")).replace("none", "") for name, root in roots.items()
        }
        table["caveats"] = (SCAN, [caveats.get(name, "") for name in names])
        return label(table, keep_notes=True)
