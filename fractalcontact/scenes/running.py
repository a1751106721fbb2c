"""A plan carried out: every part once, kept until the whole is done, resumed where it stopped."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import netcdf, provenance, schema, stopping
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.progress import track
from fractalcontact.scenes import doubting, stages
from fractalcontact.scenes.checking import preflight
from fractalcontact.scenes.choosing import choose
from fractalcontact.scenes.keeping import Store, digest
from fractalcontact.scenes.planning import FIGURES, Stage, stages_of, stored_maps
from fractalcontact.scenes.reading import load
from fractalcontact.scenes.reporting import first_member
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

RESULT, UNFINISHED = "result.nc", "partial.nc"


def run(
    scene: Scene | str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    progress: bool = True,
    client: Any = None,
) -> xr.DataTree:
    """Carry out a scene and return its results.

    Parameters
    ----------
    scene : Scene or path-like
    out : path-like, optional
        Folder for `result.nc` and the figures; nothing is written without it. Finished parts are kept in
        `out/.stages` until the whole is done: a run that was stopped goes on where it was.
    progress : bool
        Show a bar for stages of several parts.
    client : distributed.Client, optional
        Runs the parts of a stage on its workers.

    Returns
    -------
    DataTree
        Groups named after the rooms. The root's `provenance` holds the scene, and the run time, achieved
        error and origin of every stage.

    Raises
    ------
    InvalidInput
        The scene, its faces, or the folder: everything wrong at once, before anything is computed.
    Stopped
        A `KeyboardInterrupt`: with `out`, SIGINT and SIGTERM let the current part finish; what is there by
        then is written to `partial.nc`, which says so, and the same call goes on from it. A second signal,
        half a second later or more, stops at once.
    """
    if client is not None and not callable(getattr(client, "submit", None)):
        told = f"client: expected a distributed.Client or None, got {type(client).__name__}"
        raise InvalidInput("fractalcontact.scenes.run", [told])
    scene = scene if isinstance(scene, Scene) else load(scene)
    preflight(scene)
    folder = None if out is None else writable(out)
    study = _Study(scene, Store(folder), progress, client)
    with _held(folder), stopping.noted(folder is not None) as stop:
        missing = study.carry_out(stop)
        tree = study.assemble(missing)
        if folder is None:
            return tree
        if missing:
            netcdf.save(tree, folder / UNFINISHED)
            told = f"finished parts are in {UNFINISHED}, and the same run goes on from them"
            raise stopping.Stopped(stop.number, told)
        if scene.figures:
            _draw(tree, folder, progress)
        netcdf.save(tree, folder / RESULT)
        (folder / UNFINISHED).unlink(missing_ok=True)
        study.store.clear()
    return tree


def achieved(result: xr.Dataset) -> dict[str, Any]:
    """Return what a result says of its own accuracy: largest residual, whether all steps converged ..."""
    found: dict[str, Any] = {}
    if "residual" in result:
        found["residual"] = float(result["residual"].max())
    if "converged" in result:
        found["converged"] = bool(result["converged"].all())
    if "iterations" in result:
        found["iterations"] = int(result["iterations"].sum())
    if "standard_error" in result:
        errors = [f"{float(v):.4f}" for v in result["standard_error"].values.ravel() if np.isfinite(v)]
        found["standard error of H"] = " ".join(errors) or "none"
    return found


class _Study:
    """One run of a scene: what is done so far, and what that took.

    Attributes
    ----------
    parts : dict
        Results of the finished parts of each stage, by number.
    results : dict
        Those of the finished stages, joined.
    """

    def __init__(self, scene: Scene, store: Store, progress: bool, client: Any) -> None:
        scene, self.choices = choose(scene)
        self.scene, self.store, self.progress, self.client = scene, store, progress, client
        self.plan = stages_of(scene)
        self.parts: dict[str, dict[int, xr.Dataset]] = {}
        self.results: dict[str, xr.Dataset] = {}
        self.seconds: dict[str, float] = {}
        self.digests: dict[str, str] = {}
        self.works: dict[str, stages.Work] = {}
        for stage in self.plan:
            self.digests[stage.name] = digest(stage, scene, self.digests, self._dropped(stage))

    def carry_out(self, stop: stopping.Stop) -> list[str]:
        """Run the stages in order; return what is missing if a stop was asked for."""
        todo = [stage for stage in self.plan if stage.name != FIGURES]
        for number, stage in enumerate(track(todo, self.progress, self.scene.name, unit="stage")):
            count = self._stage(stage, stop)
            whole = len(self.works[stage.name].parts)
            if stop:
                rest = [other.name for other in todo[number + 1 :]]
                part = [f"{stage.name} ({count} of {whole} parts done)"] if count < whole else []
                return part + rest + ([FIGURES] if self.scene.figures else [])
        return []

    def _stage(self, stage: Stage, stop: stopping.Stop) -> int:
        """Run the parts of a stage that are missing; return how many there are by now."""
        readers = self._readers(stage)
        job = self.works[stage.name] = stages.work(stage, self.scene, self.results, self.works)
        done = self.parts.setdefault(stage.name, {})
        names = [stage.name, *(reader.name for reader in readers)]
        for name in names:
            self._take_kept(name, len(job.parts))
        missing = [n for n in range(len(job.parts)) if any(n not in self.parts[name] for name in names)]
        several = self.progress and len(missing) > 1
        made = self._made(stage, job, readers, missing)
        for number, (results, seconds) in track(made, several, stage.name, unit="part", total=len(missing)):
            for name, result in zip(names, results, strict=True):
                self.store.put(self._key(name, number), result)
                self.parts[name][number] = result
            for name, spent in zip(names, seconds, strict=True):
                self.seconds[name] = self.seconds.get(name, 0.0) + spent
            if stop:
                break
        start = time.perf_counter()
        joined = job.join(done)
        if joined is not None:
            self.results[stage.name] = joined
            if stage.name in ("contact", "joints/closure"):
                doubting.warn(
                    doubting.of_the_found(stage.name, joined, float(joined["nominal_area"].max()) ** 0.5)
                )
        self.seconds.setdefault(stage.name, 0.0)
        if missing:
            self.seconds[stage.name] += time.perf_counter() - start
        return len(done)

    def _take_kept(self, name: str, count: int) -> None:
        """Take what an earlier run kept of a stage."""
        found = self.parts.setdefault(name, {})
        for number in range(count):
            kept = None if number in found else self.store.get(self._key(name, number))
            if kept is not None:
                found[number] = kept

    def _made(
        self, stage: Stage, job: stages.Work, readers: list[Stage], missing: list[int]
    ) -> Iterator[tuple[int, tuple[list[xr.Dataset], list[float]]]]:
        """Yield number, results and seconds of the missing parts as they are done, here or on the workers."""
        dropped = self._dropped(stage)
        follow = [stages.measure(reader, self.scene) for reader in readers]
        parts = {}
        for number in missing:
            kept = self.parts[stage.name].get(number)
            whole = kept is not None and all(name in kept for name in stage.keep)
            part = stages.Given(kept) if kept is not None and whole else job.parts[number]
            parts[number] = stages.Followed(part, tuple(follow), dropped)
        if self.client is None or len(missing) < 2:
            yield from ((number, part()) for number, part in parts.items())
            return
        futures = {number: self.client.submit(part, pure=False) for number, part in parts.items()}
        try:
            for number in missing:
                yield number, futures[number].result()
                del futures[number]
        finally:
            for future in futures.values():
                future.cancel()

    def _readers(self, stage: Stage) -> list[Stage]:
        """Return the stages that read the maps of this one part by part, so that none outlives its part."""
        return [one for one in self.plan if stage.name in one.needs and stages.reads_part(one)]

    def _dropped(self, stage: Stage) -> tuple[str, ...]:
        """Return the maps of a stage that nothing needs once its readers are done with each part."""
        stored = stored_maps(self.scene)
        for other in self.plan:
            if stage.name in other.needs and not stages.reads_part(other):
                stored |= {stages.map_read(other)}
        return tuple(name for name in stage.keep if name not in stored)

    def _key(self, name: str, number: int) -> str:
        return f"{name.replace('/', '.')}.{self.digests[name]}.{number:03d}"

    def record(self) -> dict[str, dict[str, Any]]:
        """Return run time, origin and achieved error of every stage so far."""
        return {
            name: {
                "run_time": self.seconds[name],
                "origin": "computed" if self.seconds[name] else "kept from an earlier run",
                **achieved(result),
            }
            for name, result in self.results.items()
        }

    def assemble(self, missing: list[str]) -> xr.DataTree:
        """Return the finished results as a tree that says what it lacks."""
        import xarray as xr

        groups: dict[str, xr.Dataset] = {"/": xr.Dataset()}
        kept_maps = stored_maps(self.scene)
        for stage in self.plan:
            if not stage.stored or stage.name not in self.results:
                continue
            unwanted = [name for name in stage.keep if name not in kept_maps]
            result = stages.without(self.results[stage.name], unwanted)
            if stage.name == "surfaces/description":
                merged = groups.get("/surfaces", xr.Dataset()).assign(result.data_vars)
                merged.attrs = groups["/surfaces"].attrs if "/surfaces" in groups else result.attrs
                groups["/surfaces"] = merged
            else:
                groups[f"/{stage.name}"] = result
        tree = xr.DataTree.from_dict(
            {path: schema.encoded(dataset) for path, dataset in groups.items()}, name=self.scene.name
        )
        root = xr.Dataset()
        provenance.stamp(
            root,
            "fractalcontact.scenes.run",
            {"scene": dict(self.scene.tables)},
            title=str(self.scene.tables.get("title", self.scene.name)),
            stages=self.record(),
        )
        tree.attrs = root.attrs
        if self.choices:
            tree.attrs["picked"] = "; ".join(map(str, self.choices))
        if missing:
            tree.attrs["completeness"] = f"partial: the run was stopped; missing: {', '.join(missing)}"
        return tree


def writable(out: str | os.PathLike[str]) -> Path:
    """Return the output folder, made if need be, cleared of what a killed run left."""
    out = Path(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        netcdf.clear_partial(out)
        if not os.access(out, os.W_OK):
            raise PermissionError(13, "no permission to write")
    except OSError as error:
        raise InvalidInput(
            "fractalcontact run", [f"out: expected a folder to write in, got {out.name!r}: {error.strerror}"]
        ) from error
    return out


@contextmanager
def _held(folder: Path | None) -> Iterator[None]:
    """Hold a folder, so that no other run writes in it; the hold ends with the process, however it ends."""
    try:
        import fcntl
    except ImportError:  # a system without such locks
        folder = None
    if folder is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system that knows no locks
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                told = f"out: expected a folder of its own, got {folder.name!r}: another run is writing in it"
                raise InvalidInput("fractalcontact run", [told]) from None
        yield
    finally:
        os.close(descriptor)


def _draw(tree: xr.DataTree, folder: Path, progress: bool) -> None:
    """Draw the figures and note the time they took."""
    from fractalcontact import plotting

    start = time.perf_counter()
    plotting.draw(first_member(tree), folder, progress=progress)
    entry = json.loads(tree.attrs["provenance"])
    entry["stages"][FIGURES] = {"run_time": time.perf_counter() - start, "origin": "computed"}
    tree.attrs["provenance"] = json.dumps(entry)
