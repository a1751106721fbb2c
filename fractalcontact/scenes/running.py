"""A scene carried out: checked, studied, drawn, and written as one file."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import netcdf, provenance, schema, signals
from fractalcontact.base.errors import InvalidInput
from fractalcontact.scenes import doubting
from fractalcontact.scenes.checking import preflight
from fractalcontact.scenes.choosing import Choice, choose
from fractalcontact.scenes.keeping import Store, seeded
from fractalcontact.scenes.planning import FIGURES
from fractalcontact.scenes.reading import load
from fractalcontact.scenes.reporting import first_member
from fractalcontact.scenes.scene import Scene
from fractalcontact.scenes.studying import Study
from fractalcontact.scenes.sweeping import Sweep

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
        Its workers carry out the study: of an ensemble whole members each, otherwise the parts of a stage.
        Each uses one thread at a time for every thread it was given, unless `FRACTALCONTACT_THREADS` is set
        there. They need not see `out`; a scene that reads files needs them where the workers are.

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
    scene, picked = choose(scene)
    store = Store(folder)
    with _held(folder), signals.noted(folder is not None) as stop:
        scene = seeded(scene, store)
        of_scene = Sweep if "members" in scene.table("surface") else Study
        study: Study | Sweep = of_scene(scene, store, progress, client)
        missing = study.carry_out(stop)
        missing += [FIGURES] if stop and scene.figures else []
        _doubt(study.groups())
        tree = _assembled(scene, study, picked, missing)
        if folder is None:
            return tree
        if missing:
            netcdf.save(tree, folder / UNFINISHED)
            told = f"finished parts are in {UNFINISHED}, and the same run goes on from them"
            raise signals.Stopped(stop.number, told)
        if scene.figures:
            _draw(tree, folder, progress)
        netcdf.save(tree, folder / RESULT)
        (folder / UNFINISHED).unlink(missing_ok=True)
        store.clear()
    return tree


def achieved(result: xr.Dataset) -> dict[str, Any]:
    """Return what a result says of its own accuracy: in numbers, or in words where it has none."""
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
    if "interpolation_error" in result and np.isfinite(result["interpolation_error"]).all():
        found["interpolation error (m)"] = float(result["interpolation_error"].max())
    told = json.loads(result.attrs.get("provenance", "{}")).get("achieved_error")
    return found if found or told is None else {"error": told}


def _assembled(
    scene: Scene, study: Study | Sweep, picked: Sequence[Choice], missing: list[str]
) -> xr.DataTree:
    """Return the finished results as a tree that says what it lacks."""
    import xarray as xr

    found = study.groups()
    groups: dict[str, xr.Dataset] = {"/": xr.Dataset()} | {f"/{name}": one for name, one in found.items()}
    description = groups.pop("/surfaces/description", None)
    if description is not None:
        faces = groups.get("/surfaces", xr.Dataset())
        groups["/surfaces"] = faces.assign(description.data_vars).assign_attrs(
            faces.attrs or description.attrs
        )
    tree = xr.DataTree.from_dict(
        {path: schema.encoded(dataset) for path, dataset in groups.items()}, name=scene.name
    )
    root = xr.Dataset()
    provenance.stamp(
        root,
        "fractalcontact.scenes.run",
        {"scene": dict(scene.tables)},
        title=str(scene.tables.get("title", scene.name)),
        stages={
            name: {
                "run_time": seconds,
                "origin": "computed" if seconds else "kept from an earlier run",
                **(achieved(found[name]) if name in found else {}),
            }
            for name, seconds in study.seconds.items()
        },
    )
    tree.attrs = root.attrs
    if picked:
        tree.attrs["picked"] = "; ".join(map(str, picked))
    if missing:
        tree.attrs["completeness"] = f"partial: the run was stopped; missing: {', '.join(missing)}"
    return tree


def _doubt(groups: Mapping[str, xr.Dataset]) -> None:
    """Warn of closures that are hardly meant."""
    for name in ("contact", "joints/closure"):
        if name in groups:
            edge = float(groups[name]["nominal_area"].max()) ** 0.5
            doubting.warn(doubting.of_the_found(name, groups[name], edge))


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
