"""A plan carried out: every stage once, kept until the whole is done, resumed where it stopped."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import netcdf, provenance, schema
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.progress import track
from fractalcontact.scenes import stages
from fractalcontact.scenes.planning import Plan, Stage, plan
from fractalcontact.scenes.reading import load
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

RESULT = "result.nc"
KEPT = ".stages"


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
        Folder for `result.nc` and the figures; nothing is written without it. Finished stages are kept in
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
    """
    scene = scene if isinstance(scene, Scene) else load(scene)
    stages.preflight(scene)
    folder = None if out is None else _folder(Path(out))
    todo = plan(scene)
    store = _Store(None if folder is None else folder / KEPT)
    results: dict[str, xr.Dataset] = {}
    digests: dict[str, str] = {}
    record: dict[str, dict[str, Any]] = {}
    for stage in track(todo.stages, progress, scene.name, unit="stage"):
        start = time.perf_counter()
        digests[stage.name] = _digest(stage, scene, digests)
        results[stage.name], computed = _carry_out(stage, scene, results, digests, store, progress, client)
        record[stage.name] = {
            "run_time": time.perf_counter() - start,
            "origin": "computed" if computed else "kept from an earlier run",
            **achieved(results[stage.name]),
        }
    tree = _assemble(scene, todo, results, record)
    if folder is not None:
        _write(tree, scene, folder, record, progress)
        store.clear()
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


class _Store:
    """Results of finished parts, by digest, in a folder (or nowhere)."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def get(self, key: str) -> xr.Dataset | None:
        if self.folder is None or not (self.folder / f"{key}.nc").is_file():
            return None
        try:
            found: xr.Dataset = netcdf.open(self.folder / f"{key}.nc")
        except InvalidInput:
            return None
        return found

    def put(self, key: str, result: xr.Dataset) -> None:
        if self.folder is not None:
            netcdf.save(result, self.folder / f"{key}.nc")

    def clear(self) -> None:
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def _carry_out(
    stage: Stage,
    scene: Scene,
    results: dict[str, xr.Dataset],
    digests: dict[str, str],
    store: _Store,
    progress: bool,
    client: Any,
) -> tuple[xr.Dataset, bool]:
    """Return the result of a stage, and whether any of it had to be computed."""
    job = stages.work(stage, scene, results)
    keys = [
        f"{stage.name.replace('/', '.')}.{digests[stage.name]}.{number:03d}"
        for number in range(len(job.parts))
    ]
    done = {key: store.get(key) for key in keys}
    missing = [(key, part) for key, part in zip(keys, job.parts, strict=True) if done[key] is None]
    several = progress and len(missing) > 1
    if client is not None and len(missing) > 1:
        futures = [client.submit(part, pure=False) for _, part in missing]
        made = ((key, future.result()) for (key, _), future in zip(missing, futures, strict=True))
    else:
        made = ((key, part()) for key, part in missing)
    for key, result in track(made, several, stage.name, unit="part", total=len(missing)):
        store.put(key, result)
        done[key] = result
    return job.join([result for result in done.values() if result is not None]), bool(missing)


def _digest(stage: Stage, scene: Scene, digests: dict[str, str]) -> str:
    """Return a name for the result: whatever could change it goes in, and nothing else."""
    room, _, name = stage.name.partition("/")
    tables: dict[str, Any] = {"version": provenance.plain(_version()), "keep": stage.keep}
    if room == "surfaces" or name == "faces":
        table = scene.table("upper" if name == "faces" else "surface")
        tables["surface"] = table
        if "read" in table:
            tables["file"] = hashlib.sha256(
                stages.locate(table["read"], scene.folder).read_bytes()
            ).hexdigest()
    if room == "joints":
        tables["material"] = scene.table("material")
        joint = scene.table("joint")
        tables["joint"] = {
            key: joint[key] for key in joint if not isinstance(joint[key], dict) or key == name
        }
    if room == "dimensions":
        tables["dimensions"] = [scene.table("dimensions"), scene.wanted("dimensions")]
    if room == "contact":
        tables["contact"] = stages.contact_options(scene)
    if room == "domains":
        tables["domains"] = scene.table("domains").get(name, {})
    tables["needs"] = [digests[need] for need in stage.needs]
    text = json.dumps([stage.name, tables], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version() -> str:
    import fractalcontact

    return fractalcontact.__version__


def _assemble(
    scene: Scene, todo: Plan, results: dict[str, xr.Dataset], record: dict[str, dict[str, Any]]
) -> xr.DataTree:
    import xarray as xr

    groups: dict[str, xr.Dataset] = {"/": xr.Dataset()}
    kept_maps = set(scene.wanted("keep")) | ({"state"} if scene.figures else set())
    for stage in todo:
        if not stage.stored:
            continue
        result = results[stage.name].drop_vars(
            [name for name in stage.keep if name not in kept_maps], errors="ignore"
        )
        if stage.name == "surfaces/description":
            merged = groups.get("/surfaces", xr.Dataset()).assign(result.data_vars)
            merged.attrs = groups["/surfaces"].attrs if "/surfaces" in groups else result.attrs
            groups["/surfaces"] = merged
        else:
            groups[f"/{stage.name}"] = result
    tree = xr.DataTree.from_dict(
        {path: schema.encoded(dataset) for path, dataset in groups.items()}, name=scene.name
    )
    root = xr.Dataset()
    provenance.stamp(
        root,
        "fractalcontact.scenes.run",
        {"scene": dict(scene.tables)},
        title=str(scene.tables.get("title", scene.name)),
        stages=record,
    )
    tree.attrs = root.attrs
    return tree


def _folder(out: Path) -> Path:
    """Return the output folder, made if need be, cleared of what a killed run left."""
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


def _write(
    tree: xr.DataTree, scene: Scene, folder: Path, record: dict[str, dict[str, Any]], progress: bool
) -> None:
    if scene.figures:
        from fractalcontact import plotting

        start = time.perf_counter()
        plotting.draw(tree, folder, progress=progress)
        record["figures"] = {"run_time": time.perf_counter() - start, "origin": "computed"}
        entry = json.loads(tree.attrs["provenance"])
        tree.attrs["provenance"] = json.dumps(entry | {"stages": provenance.plain(record)})
    netcdf.save(tree, folder / RESULT)
