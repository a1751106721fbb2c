"""Running a scene: validated, studied, drawn, and written as one file.

Of many scans each is an ordinary study in its own folder, and their numbers are stacked along `scan`.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr

from fractalcontact.base import netcdf, signals
from fractalcontact.base.errors import FractalContactError, FractalContactWarning, InvalidInput, warn
from fractalcontact.base.file_contents import read_headers, stage_rows
from fractalcontact.base.files import PARTIAL_RESULT, RESULT, locked, written_whole
from fractalcontact.base.process import calls_in_two_processes
from fractalcontact.base.resources import DRAWING_LOCK, most_workers
from fractalcontact.base.study import provenance_of
from fractalcontact.base.validation import Problems
from fractalcontact.scenes import _result_tree, _results_folder
from fractalcontact.scenes._comparisons import comparisons
from fractalcontact.scenes._executor import Workers, run_tasks, worker_processes, workers_of
from fractalcontact.scenes._export import MAP_DIMS, tables
from fractalcontact.scenes._html_report import page_contents, write_report
from fractalcontact.scenes._inputs import read_surface
from fractalcontact.scenes._result_tables import SCAN
from fractalcontact.scenes._result_tree import Numbers
from fractalcontact.scenes._results_folder import REPORT, SCANS, PartStore, digest_of, folder_of, with_seeds
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._scene_file import scans_of
from fractalcontact.scenes._stages import FIGURES, check_memory, stages_of
from fractalcontact.scenes._study import Study, reason_of, study_ensemble
from fractalcontact.scenes._summary import Summary, datasheet, summary_of
from fractalcontact.scenes._validation import validated, warn_of_result

DIGEST = "study_digest"  # attribute of a finished scan: of its file, its settings and the version
NO_ACCESS = "the worker does not see the folder of the results"


def run(
    scene: Scene | str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    progress: bool = True,
    summary: bool = False,
    verbose: bool = False,
    workers: int = 0,
    client: Any = None,
    force: bool = False,
) -> xr.DataTree:
    """Run a scene and return its results.

    Parameters
    ----------
    scene : Scene or path-like
    out : path-like, optional
        Folder for `result.nc`, `report.html`, the figures and a datasheet; nothing is written without it.
        Finished parts are kept in `out/.stages` until the study is complete: a run that was stopped resumes
        there.
    progress : bool, default True
        Show a bar for stages of several parts.
    summary : bool, default False
        Print the summary at the end, see `fractalcontact.scenes.summary`.
    verbose : bool, default False
        Print all of it.
    workers : int, default 0
        Share the study between so many processes on this machine: at most 8, or 4 for each processor if these
        are more. An ensemble is shared by members, many scans by scan, any other study by the parts of a
        stage. A script needs an ``if __name__ == "__main__"`` guard for it. With 0, a copy of this process
        takes part of the work on surfaces of up to 1024 x 1024 points and of the figures (on Linux, with two
        processors or more).
    client : distributed.Client or concurrent.futures.Executor, optional
        Share it between these workers instead. Each task uses one thread, unless `FRACTALCONTACT_THREADS`
        is set on the worker. Workers need no access to `out`, but for many scans; a scene that reads files
        needs them there.
    force : bool, default False
        Overwrite in `out` the results of another study, and files that this package did not write. Without
        it they are refused.

    Returns
    -------
    DataTree
        Groups named after the subpackages. The root's `provenance` holds the scene, and the run time,
        achieved error and origin of every stage. Of many scans: a row for each in the group `overview`, their
        numbers along `scan`, in the root the means with their intervals; the maps of each in
        the group `scans/NAME` of the file. Without `out` that group holds the whole study of the scan.

    Warns
    -----
    FractalContactWarning
        Some of many scans, or some of their stages, failed: their rows state why.

    Raises
    ------
    InvalidInput
        Lists all problems of the scene, its surfaces and the folder, before anything is computed.
    TooLittleMemory
        A stage needs more memory than this process may take; `plan` states how much.
    Stopped
        A `KeyboardInterrupt`: with `out`, SIGINT or SIGTERM finishes the current part. Finished results are
        written to `partial.nc`, and the same call resumes. A second signal, half a second later or more,
        stops at once.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> last = result["joints/rigid_dilatancy/rigid_dilatancy"].isel(shear=-1)
    >>> print((last.sel(direction=["E", "W"]) * 1e3).round(2).values)  # mm at 10 mm of shear
    [1.15 0.5 ]
    """
    start = time.perf_counter()
    _check(summary, verbose, force, workers, client)
    with worker_processes(workers) as processes:
        scene, faces = validated(scene)
        scans = scans_of(scene)
        whole: Summary | None
        if not scans:
            check_memory(scene, stages_of(scene), workers, faces.get("surface"))
        among = workers_of(processes if client is None else client)
        with _results_folder.results_folder(out, scene, force=force) as folder:
            if scans:
                tree, whole = _run_scans(scene, scans, folder, progress, among, start)
            else:
                with locked(folder), signals.noted(folder is not None) as stop:
                    tree, whole = _run(scene, folder, progress, among, start, stop, faces)
    if summary:
        print((whole or summary_of(tree)).text(verbose=verbose))  # noqa: T201
    return tree


def _run_scans(
    scene: Scene,
    scans: Mapping[str, Scene],
    folder: Path | None,
    progress: bool,
    workers: Workers | None,
    start: float,
) -> tuple[xr.DataTree, Summary]:
    """Return the numbers of all scans, and the summary; without a folder also their maps."""
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            tree, whole = _run_scans(scene, scans, Path(name), progress, workers, start)
            for file in sorted(Path(name).glob(f"{SCANS}/*/{RESULT}")):
                tree[f"{SCANS}/{file.parent.name}"] = netcdf.open(file)
            return tree, whole
    with locked(folder), signals.noted() as stop:
        studied = _study_scans(scans, folder, workers, stop, progress)
        if stop:
            done = f"{len(studied)} of {len(scans)} scans are finished"
            raise signals.Stopped(stop.number, f"{done}; the same run resumes from them")
        reasons = {name: studied[name][0] for name in scans}
        numbers = {name: studied[name][1] for name in scans if studied[name][1]}
        tree = _result_tree.tree_of_scans(scene, reasons, numbers)
        _result_tree.note_run_time(tree, start)
        netcdf.write(tree, folder / RESULT, _maps_of_scans(folder / SCANS, numbers))
        with _beside_the_result():
            frame = next(iter(tables(tree[_result_tree.OVERVIEW].to_dataset()).values()))
            with written_whole(folder / _results_folder.CSV) as temporary:
                frame.to_csv(temporary, index=False)
            is_drawn = scene.want.figures and numbers
            figures = _draw(_result_tree.pictured(tree), folder, progress) if is_drawn else []
            whole = summary_of(tree)
            write_report(tree, folder / REPORT, figures, whole)
        PartStore(folder).clear()  # of marks for workers; each scan has its own parts
        failed = sum(map(bool, reasons.values()))
        if failed:
            message = f"{failed} of {len(scans)} scans failed or are incomplete; the table states why"
            warn(message, FractalContactWarning)
        return tree, whole


def _study_scan(scene: Scene, folder: Path, stop: signals.Stop, digest: str) -> xr.DataTree:
    """Study one scan in a folder of its own; `completeness` of the result states which stages failed and why.

    It is not validated beforehand: what does not fit this scan fails in its stage, and the others go on.
    """
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the report of the scan has them
        face = read_surface(scene.surface, scene.folder)
        check_memory(scene, stages_of(scene), face=face)
        folder.mkdir(exist_ok=True)
        with locked(folder):
            return _run(scene, folder, False, None, start, stop, {"surface": face}, digest)[0]


def _run(
    scene: Scene,
    folder: Path | None,
    progress: bool,
    workers: Workers | None,
    start: float,
    stop: signals.Stop,
    faces: Mapping[str, xr.DataArray],
    digest: str = "",
) -> tuple[xr.DataTree, Summary | None]:
    """Return the results, and the summary where the report computed it; `faces` have been read.

    One of many scans, whose `digest` marks it as finished, goes on without stages that fail.
    """
    store = PartStore(folder)
    scene = with_seeds(scene, store)
    if scene.surface.members is None:
        study = Study(scene, store, progress, workers, goes_on=bool(digest), faces=faces).run(stop)
    else:
        study = study_ensemble(scene, store, progress, workers, stop)
    if stop and scene.want.figures:
        study = replace(study, missing=[*study.missing, FIGURES])
    if study.failures and not study.groups:
        raise InvalidInput("fractalcontact.scenes.run", study.reasons)
    for name in ("contact", "joints/closure"):
        if name in study.groups:
            warn_of_result(name, study.groups[name])
    tree = _result_tree.result_tree(scene, study)
    if not study.missing:
        tree.attrs |= comparisons(tree)
    if digest and not study.failures:
        tree.attrs[DIGEST] = digest
    _result_tree.note_run_time(tree, start)
    if folder is None:
        return tree, None
    if study.missing:
        netcdf.save(tree, folder / PARTIAL_RESULT)
        raise signals.Stopped(
            stop.number, f"finished parts are in {PARTIAL_RESULT}; the same run resumes from them"
        )
    calls = (
        lambda: _save_and_draw(tree, scene, folder, progress),
        lambda: (page_contents(tree), summary_of(tree)),
    )
    # a copy of this process prepares the page meanwhile, .3 s of a study of 6 s
    results: dict[int, Any] = dict(calls_in_two_processes(lambda number: calls[number](), 2))
    figures, (contents, whole) = results[0], results[1]
    with _beside_the_result():
        _result_tree.note_run_time(tree, start)
        whole = replace(whole, stages=stage_rows(tree))  # with the time of the figures
        tree.attrs["caveats"] = "\n".join(whole.caveats) or "none"
        changed = {name: tree.attrs[name] for name in ("provenance", "caveats")}
        netcdf.replace_attributes(folder / RESULT, changed)
        write_report(tree, folder / REPORT, figures, whole, contents)
        if scene.want.datasheet and not study.failures:
            tables(tree, folder / _results_folder.TABLES)
            _draw_datasheet(tree, folder / _results_folder.DATASHEET)
    if not study.failures:
        store.clear()
    return tree, whole


def _save_and_draw(tree: xr.DataTree, scene: Scene, folder: Path, progress: bool) -> list[Path]:
    """Save the results, draw the figures if they are wanted, and return their files."""
    # before figures and report: a disk that fills, or a kill, while they are made loses nothing
    netcdf.save(tree, folder / RESULT)
    (folder / PARTIAL_RESULT).unlink(missing_ok=True)
    with _beside_the_result():
        return _draw(tree, folder, progress) if scene.want.figures else []


def _check(summary: Any, verbose: Any, force: Any, workers: Any, client: Any) -> None:
    with Problems("fractalcontact.scenes.run") as problems:
        for name, flag in (("summary", summary), ("verbose", verbose), ("force", force)):
            problems.boolean(name, flag)
        if problems.integer("workers", workers, at_least=0, at_most=most_workers()) and workers:
            problems.require(client is None, "workers / client", "one of them", "both of them")
        workers_of(client)


def _draw_datasheet(tree: xr.DataTree, target: Path) -> None:
    """Write the page about the joint as PDF."""
    from matplotlib.figure import Figure

    page = Figure()
    with DRAWING_LOCK, written_whole(target) as temporary:
        datasheet(tree, figure=page)
        page.savefig(
            temporary, format="pdf", metadata={"CreationDate": None, "Creator": _results_folder.SOFTWARE}
        )


@contextmanager
def _beside_the_result() -> Iterator[None]:
    """Report an error of the file system in the block, in words that say what is complete."""
    try:
        yield
    except (OSError, InvalidInput) as raised:
        error = raised.__cause__ if isinstance(raised, InvalidInput) else raised
        if not isinstance(error, OSError):
            raise
        expected = f"figures and a report beside {RESULT}, which is complete; the same run makes them"
        got = error.strerror or str(error)
        raise InvalidInput.of("fractalcontact.scenes.run", "out", expected, got) from error


def _draw(tree: xr.DataTree, folder: Path, progress: bool) -> list[Path]:
    """Draw the figures in place of earlier ones, note the time they took, and return their files."""
    from fractalcontact import plotting

    start = time.perf_counter()
    files = plotting.draw(tree, folder, progress=progress)
    _results_folder.remove_old_figures(folder, files)
    entry = provenance_of(tree)
    entry["stages"][FIGURES] = {"run_time": time.perf_counter() - start, "origin": "computed"}
    tree.attrs["provenance"] = json.dumps(entry)
    return files


@dataclass(frozen=True, repr=False)
class _ScanTask:
    """The study of one scan in its folder.

    A finished scan is one file, `scans/NAME/result.nc`. Whatever ends a run, the next one takes the finished
    scans as they are; it repeats those that failed, and those whose file or settings have changed.
    """

    scene: Scene
    folder: Path

    def __call__(self, store: PartStore, stop: signals.Stop) -> tuple[str, Numbers] | None:
        """Return why it or some of its stages failed, and its numbers; None if a stop cut the study short."""
        del store
        if stop:
            return None
        try:
            if not self.folder.parent.is_dir():
                return NO_ACCESS, {}
            digests = Study(self.scene, PartStore(None)).digests
            # of all tables: caveats, figures and a datasheet depend on more than the stages do
            digest = digest_of([digests, self.scene.tables])
            if _is_finished(self.folder, digest):
                return "", _numbers(netcdf.open(self.folder / RESULT))
            for name in (RESULT, REPORT):
                (self.folder / name).unlink(missing_ok=True)
            tree = _study_scan(self.scene, self.folder, stop, digest)
            return str(tree.attrs.get("completeness", "")).removeprefix(_result_tree.PARTIAL), _numbers(tree)
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


def _study_scans(
    scans: Mapping[str, Scene], folder: Path, workers: Workers | None, stop: signals.Stop, progress: bool
) -> dict[str, tuple[str, Numbers]]:
    """Return of every scan why it or some of its stages failed, "" if none, and its numbers.

    Those that a stop has left out are missing.
    """
    place = folder / SCANS
    place.mkdir(exist_ok=True)
    tasks = {name: _ScanTask(scene, place / folder_of(name)) for name, scene in scans.items()}
    # of formats with two bytes for each point, the smallest
    sources = (each.folder / os.path.expandvars(str(each.surface.read)) for each in scans.values())
    points = max((source.stat().st_size // 2 for source in sources if source.is_file()), default=0)
    finished = run_tasks(tasks, PartStore(folder), stop, workers, points=points)
    studied = dict(signals.track(finished, progress, SCANS, unit=SCAN, total=len(tasks)))
    for name, (_, numbers) in studied.items():
        if numbers and not (tasks[name].folder / RESULT).is_file():
            studied[name] = NO_ACCESS, {}
    return studied


def _maps_of_scans(place: Path, names: Iterable[str]) -> Iterator[Numbers]:
    """Yield the groups that have the maps of each scan."""
    for folder in map(folder_of, names):
        groups = {}
        for node in netcdf.open(place / folder / RESULT).subtree:
            maps = [name for name, each in node.data_vars.items() if set(each.dims) >= MAP_DIMS]
            if maps:
                groups[f"/{SCANS}/{folder}{node.path}"] = node.to_dataset(inherit=False)[maps]
        yield groups
