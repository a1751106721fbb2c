"""What each stage computes, by calling the rooms.

A stage is one call, or several independent ones (its parts: one shear of a closure law, one direction of a
dilatancy) whose results are joined. Parts may run anywhere and in any order; the joined result is the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.netcdf import as_dataset
from fractalcontact.scenes.given import contact_options, crack_options, joint_options, read_surface
from fractalcontact.scenes.grammar import JOINT_STAGES, LOADS, public, stage_keys
from fractalcontact.scenes.scene import Scene, Table

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints import Crack
    from fractalcontact.scenes.planning import Stage

    Results = Mapping[str, xr.Dataset]

CHUNK = 1 << 23  # nodes times steps of one part: seconds of work, and maps of at most 64 MB each
WHOLE = ("islands", "lineage", "evolution")  # what follows the set along a path reads all maps at once
Part = Callable[[], "xr.Dataset"]


@dataclass(frozen=True)
class Work:
    """The parts of one stage, the dims along which their results are joined, and how many lie along each."""

    parts: tuple[Part, ...]
    along: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()

    def join(self, done: Mapping[int, xr.Dataset]) -> xr.Dataset | None:
        """Return the result of the stage from those of its parts, as far as they reach without a hole."""
        count = next((n for n in range(len(self.parts)) if n not in done), len(self.parts))
        found = [done[n] for n in range(count)]
        for dim, length in zip(reversed(self.along), reversed(self.shape), strict=True):
            rows = [found[k : k + length] for k in range(0, len(found), length)]
            # a row that is not complete is left out, unless it is all there is
            rows = [row for row in rows if len(row) == length] or rows[:1]
            found = [joined(row, dim) for row in rows]
        return found[0] if found else None


@dataclass(frozen=True, repr=False)
class Followed:
    """A part, and the measures of its maps taken before the maps go."""

    part: Part
    measures: tuple[Callable[[xr.Dataset], xr.Dataset], ...] = ()
    dropped: tuple[str, ...] = ()

    def __call__(self) -> tuple[list[xr.Dataset], list[float]]:
        """Return the results and the seconds each took."""
        start = time.perf_counter()
        source = self.part()
        seconds = [time.perf_counter() - start]
        results = []
        for one in self.measures:
            start = time.perf_counter()
            results.append(one(source))
            seconds.append(time.perf_counter() - start)
        return [without(source, self.dropped), *results], seconds


@dataclass(frozen=True, repr=False)
class Given:
    """A part that was computed before."""

    result: xr.Dataset

    def __call__(self) -> xr.Dataset:
        """Return the result."""
        return self.result


@dataclass(frozen=True, repr=False)
class Measure:
    """A function of one map of a part."""

    room: str
    function: str
    variable: str
    options: Mapping[str, Any]

    def __call__(self, source: xr.Dataset) -> xr.Dataset:
        """Return what the function says of the map."""
        return _call(self.room, self.function, source[self.variable], **self.options)


def without(result: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return a result without some of its maps, and without coordinates that then belong to nothing."""
    rest = result.drop_vars(list(names), errors="ignore")
    used = {dim for variable in rest.data_vars.values() for dim in variable.dims}
    return rest.drop_vars([dim for dim in ("y", "x") if dim in rest.coords and dim not in used])


def joined(results: list[xr.Dataset], dim: str) -> xr.Dataset:
    """Join results along a dim; seconds are added up."""
    if len(results) == 1:
        return results[0]
    import xarray as xr

    whole = xr.concat(
        results,
        dim=dim,
        data_vars="minimal",
        coords="minimal",
        compat="override",
        join="override",
        combine_attrs="override",
    )
    if "run_time" in whole and dim not in whole["run_time"].dims:
        whole["run_time"] = results[0]["run_time"].copy(data=sum(one["run_time"].values for one in results))
    if dim == "step":
        attributes = dict(whole["step"].attrs)
        whole = whole.assign_coords(step=("step", np.arange(whole.sizes["step"]), attributes))
    for name, variable in whole.variables.items():
        variable.encoding = dict(results[0].variables[name].encoding)
    return whole


def work(stage: Stage, scene: Scene, results: Results, works: Mapping[str, Work]) -> Work:
    """Return what is to be done for a stage, given the results and the work of those it needs."""
    room, _, name = stage.name.partition("/")
    if reads_part(stage):
        return works[stage.needs[0]]
    if map_read(stage):
        return Work((partial(measure(stage, scene), results[stage.needs[0]]),))
    if room == "surfaces":
        return _surface_work(name, scene, results)
    if room == "dimensions":
        return _dimension_work(name, scene, results)
    if room == "contact":
        return _contact_work(stage, scene, results)
    return _joint_work(name, stage, scene, results)


def map_read(stage: Stage) -> str:
    """Return the map that a stage reads from the one it needs, none for most."""
    if stage.name.startswith("domains/"):
        return "state"
    return "gap" if stage.name == "joints/transmissivity" else ""


def reads_part(stage: Stage) -> bool:
    """Whether a stage reads the maps of the one it needs plane by plane, so that no map need be kept."""
    return bool(map_read(stage)) and stage.name.partition("/")[2] not in WHOLE


def measure(stage: Stage, scene: Scene) -> Measure:
    """Return the function of a map that a stage stands for."""
    room, _, name = stage.name.partition("/")
    table = "joint" if room == "joints" else room
    options = scene.options(table, name, stage_keys(room, name))
    if name == "islands":
        options["keep"] = stage.keep
    return Measure(room, name, map_read(stage), options)


def _surface_work(name: str, scene: Scene, results: Results) -> Work:
    if name == "description":
        return Work((partial(_call, "surfaces", "describe", _height(results)),))
    return Work((partial(_read_face, scene.table("surface"), scene.folder),))


def _read_face(table: Table, folder: Path) -> xr.Dataset:
    return as_dataset(read_surface(table, folder).rename("height"))


def _dimension_work(name: str, scene: Scene, results: Results) -> Work:
    face = _scanned(scene, results)
    if name:
        return Work((partial(_call, "dimensions", name, face),))
    options = dict(scene.table("dimensions"))
    methods = list(scene.wanted("dimensions"))
    return Work((partial(_call, "dimensions", "estimate", face, methods, **options),))


def _scanned(scene: Scene, results: Results) -> xr.DataArray:
    """Return the face with the points that are spikes to a contact: they are part of how rough a scan is."""
    table = scene.table("surface")
    if not table.get("despike"):
        return _height(results)
    return read_surface({**table, "despike": False}, scene.folder)


def _contact_work(stage: Stage, scene: Scene, results: Results) -> Work:
    options, faces = contact_options(scene), results["surfaces"]
    load = next(key for key in LOADS if key in options)
    paths = _chunks(options.pop(load), faces["height"].size, "hardness" in options)
    parts = (partial(_press, faces, options | {load: path}, stage.keep) for path in paths)
    return Work(tuple(parts), ("step",), (len(paths),))


def _press(faces: xr.Dataset, options: dict[str, Any], keep: tuple[str, ...]) -> xr.Dataset:
    return _call("contact", "press", faces["height"], keep=keep, **options)


def _chunks(path: Any, nodes: int, remembers: bool) -> list[Any]:
    """Cut a path of load into parts; a body that yields remembers what was, and its path stays whole."""
    length = max(1, CHUNK // nodes)
    if not isinstance(path, list) or len(path) <= length or remembers:
        return [path]
    return [path[k : k + length] for k in range(0, len(path), length)]


def _joint_work(name: str, stage: Stage, scene: Scene, results: Results) -> Work:
    if name == "faces":
        part = partial(_upper_face, scene.table("upper"), scene.folder, results["surfaces"], scene.registers)
        return Work((part,))
    options = joint_options(scene, name)
    if name == "friction":
        own = scene.table("joint").get(name, {})
        if "nominal_pressure" not in own:  # in [joint] it is the load of the closure
            options.pop("nominal_pressure", None)
        return Work((partial(_call, "joints", name, results[stage.needs[0]], **options),))
    crack = _crack(scene, results)
    if name == "delta_surface" and name not in scene.wanted("joints"):
        options["shear"] = np.max(options["shear"])  # the figures draw the last one
    if name == "closure":
        return _closure_work(crack, options, stage.keep)
    if name == "elastic_dilatancy":
        directions = _several(options.pop("direction", ("E", "N", "W", "S")))
        shears = _several(options.pop("shear"))
        parts = (
            partial(_call, "joints", "dilatancy", crack, direction=[word], shear=[v], **options)
            for word in directions
            for v in shears
        )
        return Work(tuple(parts), ("direction", "shear"), (len(directions), len(shears)))
    return Work((partial(_call, "joints", JOINT_STAGES[name], crack, **options),))


def _closure_work(crack: Crack, options: dict[str, Any], keep: tuple[str, ...]) -> Work:
    load = next(key for key in LOADS if key in options)
    shears, nodes = _several(options.pop("shear")), crack.layout.cells[0] * crack.layout.cells[1]
    paths = _chunks(options.pop(load), nodes, "hardness" in options)
    parts = (
        partial(_call, "joints", "closure", crack, shear=[v], keep=keep, **options, **{load: path})
        for v in shears
        for path in paths
    )
    return Work(tuple(parts), ("shear", "step"), (len(shears), len(paths)))


def _several(given: Any) -> Sequence[Any]:
    return given if isinstance(given, (list, tuple)) else [given]


def _upper_face(table: Table, folder: Path, lower: xr.Dataset, registers: bool) -> xr.Dataset:
    face = read_surface(table, folder)
    if registers:
        return _call("joints", "register", lower["height"], face)
    return as_dataset(face.rename("height"))


def _crack(scene: Scene, results: Results) -> Crack:
    from fractalcontact import joints

    upper = results["joints/faces"]["height"] if "joints/faces" in results else None
    return joints.Crack(results["surfaces"]["height"], upper, **crack_options(scene))


def _height(results: Results) -> xr.DataArray:
    return results["surfaces"]["height"]


def _call(room: str, function: str, *arguments: Any, **options: Any) -> xr.Dataset:
    """Call a public function of a room, by name, so that a part can be sent to another process."""
    import xarray as xr

    result: xr.Dataset | xr.DataArray = public(room, function)(*arguments, **options)
    return as_dataset(result) if isinstance(result, xr.DataArray) else result
