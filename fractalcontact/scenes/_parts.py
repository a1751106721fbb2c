"""The work of each stage: one call of a public function, or several independent calls (parts).

A part is one shear of a closure law, one direction of a dilatancy, or one section of a long load path. Parts
may run anywhere and in any order; the joined result is the same.
"""

from __future__ import annotations

import json
import warnings
from collections import ChainMap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import provenance
from fractalcontact.base.errors import SmallStrainWarning
from fractalcontact.base.netcdf import as_dataset
from fractalcontact.base.provenance import with_provenance
from fractalcontact.base.study import provenance_of
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._domain_stages import SIGNATURE
from fractalcontact.scenes._inputs import call_options, crack_of, read_surface, stage_options
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stage_type import CONTACT_MAPS, parameters_of, public_function
from fractalcontact.scenes._stages import STAGES, Stage, only_describes_surface, section_length
from fractalcontact.scenes._validation import require_above, validate_placed

Results = Mapping[str, xr.Dataset]
Part = Callable[[], xr.Dataset]
Reader = Callable[..., xr.Dataset]


@dataclass(frozen=True)
class StageWork:
    """The parts of one stage, the dims along which their results are joined, and the number along each."""

    parts: tuple[Part, ...]
    along: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()

    def join(self, done: Mapping[int, xr.Dataset]) -> xr.Dataset | None:
        """Return the joined results of the parts before the first missing one; None if there are none."""
        count = next((n for n in range(len(self.parts)) if n not in done), len(self.parts))
        results = [done[n] for n in range(count)]
        for dim, length in zip(reversed(self.along), reversed(self.shape), strict=True):
            rows = [results[k : k + length] for k in range(0, len(results), length)]
            # an incomplete row is left out, unless it is the only one
            rows = [row for row in rows if len(row) == length] or rows[:1]
            results = [concatenate(row, dim) for row in rows]
        return results[0] if results else None


def without(result: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return a result without some of its maps, and without x and y if nothing else has them."""
    dropped = [name for name in names if name in result]
    if not dropped:
        return result
    rest = result.drop_vars(dropped)
    entry = provenance_of(rest)
    if "keep" in entry.get("parameters", {}):  # the call that gives what is left
        entry["parameters"]["keep"] = [name for name in entry["parameters"]["keep"] if name not in dropped]
        rest = rest.assign_attrs(provenance=json.dumps(entry))
    used = {dim for variable in rest.data_vars.values() for dim in variable.dims}
    return rest.drop_vars([dim for dim in ("y", "x") if dim in rest.coords and dim not in used])


def concatenate(results: list[xr.Dataset], dim: str) -> xr.Dataset:
    """Join results along a dim; their run times are added, and their provenance is that of the whole."""
    if len(results) == 1:
        return results[0]
    joined = xr.concat(
        results,
        dim=dim,
        data_vars="minimal",
        coords="minimal",
        compat="override",
        join="override",
        combine_attrs="override",
    )
    if "run_time" in joined and dim not in joined["run_time"].dims:
        total = sum(result["run_time"].values for result in results)
        joined["run_time"] = results[0]["run_time"].copy(data=total)
    if dim == "step":
        attributes = dict(joined["step"].attrs)
        joined = joined.assign_coords(step=("step", np.arange(joined.sizes["step"]), attributes))
    entries = [provenance_of(result) for result in results]
    if all(entries):
        joined.attrs["provenance"] = json.dumps(provenance.joined(entries, dim))
    for name, variable in joined.variables.items():
        variable.encoding = dict(results[0].variables[name].encoding)
    return joined


def stage_work(
    stage: Stage,
    scene: Scene,
    results: Results,
    works: Mapping[str, StageWork],
    faces: Mapping[str, xr.DataArray],
) -> StageWork:
    """Return the parts of a stage, from the results and parts of the stages it needs, and the faces read."""
    if stage.follows:
        return works[stage.follows]
    if stage.reads_map:
        return StageWork((partial(map_reader(stage, scene), results[stage.needs[0]]),))
    row = stage.row
    options = call_options(scene, row, stage.keep)
    if stage.name == "surfaces":
        return StageWork((partial(_lower_face, scene, faces.get("surface")),))
    if row.takes == "file":
        return StageWork((partial(_upper_face, scene, _heights(results, "surfaces"), faces.get("upper")),))
    if row.takes == "result":
        return StageWork((partial(call, row.function, results[stage.needs[0]], **options),))
    if row.takes == "surface":
        surface = _prepared(row.subpackage, scene, results)
        return _split(stage, partial(call, row.function, surface), options, surface.size)
    if stage.name == "joints/delta_surface" and row.word not in scene.want.joints:
        options["shear"] = np.max(options["shear"])  # the figures draw the last one
    if "joints/closure" in stage.needs:
        options |= _pressed(scene, results, options)
    upper = _heights(results, "joints/faces") if "joints/faces" in results else None
    crack = crack_of(scene, _heights(results, "surfaces"), upper, row)
    nodes = crack.layout.cells[0] * crack.layout.cells[1]
    return _split(stage, partial(call, row.function, crack), options, nodes)


def map_reader(stage: Stage, scene: Scene) -> Reader:
    """Return the function of a map that a stage stands for; it takes the result that has the map."""
    options = call_options(scene, stage.row, stage.keep)
    return partial(_read_map, stage.row.function, stage.row.reads, options)


def reader_of(stage: Stage, scene: Scene, results: Results) -> Reader:
    """Return the function of a part that a stage stands for, which follows another one.

    What follows the signature reads all maps, and takes the signature, which it would compute again.
    """
    reader = map_reader(stage, scene)
    return partial(reader, results[stage.needs[0]]) if stage.follows == SIGNATURE else reader


def _read_map(
    function: str, variable: str, options: dict[str, Any], source: xr.Dataset, signature: Any = None
) -> xr.Dataset:
    given = {} if signature is None else {"signature": signature}
    return call(function, with_provenance(source, variable), **options, **given)


def _lower_face(scene: Scene, face: xr.DataArray | None) -> xr.Dataset:
    face = read_surface(scene.surface, scene.folder) if face is None else face
    return as_dataset(face.rename("height"))


def _prepared(subpackage: str, scene: Scene, results: Results) -> xr.DataArray:
    """Return the lower face as the functions of a subpackage take it: the roughness without what was filled.

    Spikes are removed for the contact alone: the roughness is that of the surface as it was scanned, unless
    nothing is pressed.
    """
    table = scene.surface
    if subpackage == "surfaces":
        table = replace(table, fill=False)
    if subpackage == "dimensions":
        despike = table.despike and only_describes_surface(scene)
        table = replace(table, despike=despike, fill=table.fill and not despike)
    return _heights(results, "surfaces") if table == scene.surface else read_surface(table, scene.folder)


def _split(stage: Stage, function: Part, options: Mapping[str, Any], nodes: int) -> StageWork:
    """Return the parts of a stage: a call for each value of the arguments that its row splits."""
    pieces = [_pieces(dim, stage.row.function, options, nodes) for dim in stage.row.splits]
    apart = {name for piece in pieces for part in piece for name in part}
    common = {name: value for name, value in options.items() if name not in apart}
    parts = (partial(function, **common, **dict(ChainMap(*part))) for part in product(*pieces))
    return StageWork(tuple(parts), stage.row.splits, tuple(map(len, pieces)))


def _pieces(dim: str, function: str, options: Mapping[str, Any], nodes: int) -> list[dict[str, Any]]:
    """Return the arguments along one dim: one value each, or one section of the path of the load."""
    if dim != "step":
        given = options[dim] if dim in options else parameters_of(function)[dim].default
        return [{dim: [value]} for value in (given if isinstance(given, (list, tuple)) else [given])]
    load = next(key for key in LOADS if key in options)
    path = options[load]
    if not isinstance(path, list):
        return [{load: path}]
    length = section_length(len(path), nodes, has_hardness="hardness" in options)
    return [{load: path[start : start + length]} for start in range(0, len(path), length)]


def _pressed(scene: Scene, results: Results, options: Mapping[str, Any]) -> dict[str, xr.Dataset]:
    """Return the closure as the argument `pressed` of the elastic dilatancy, where both press alike."""
    of_closure = stage_options(scene, STAGES["joints/closure"])
    free = (*LOADS, "shear", "direction", "keep")
    own, other = ({key: of[key] for key in of if key not in free} for of in (options, of_closure))
    alike = own == other and "normal_force" in of_closure
    return {"pressed": without(results["joints/closure"], CONTACT_MAPS)} if alike else {}


def _heights(results: Results, stage: str) -> xr.DataArray:
    return with_provenance(results[stage], "height")


def _upper_face(scene: Scene, lower: xr.DataArray, upper: xr.DataArray | None) -> xr.Dataset:
    upper = read_surface(scene.upper or scene.surface, scene.folder, lower) if upper is None else upper
    if scene.joint.register:
        faces = call("joints.register", lower, upper, turn_upper=scene.joint.turn_upper)
        validate_placed(scene, lower, faces["height"])
    else:
        with Problems("fractalcontact.scenes.run") as problems:
            require_above(upper, lower, problems)
        faces = as_dataset(upper.rename("height"))
    prepared = upper.attrs.get("preparation")
    return faces.assign_attrs(preparation=prepared) if prepared else faces


def call(function: str, *arguments: Any, **options: Any) -> xr.Dataset:
    """Call a public function by name, so that the call can be sent to another process."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SmallStrainWarning)  # the summary says it once for all parts
        result: xr.Dataset | xr.DataArray = public_function(function)(*arguments, **options)
    return as_dataset(result) if isinstance(result, xr.DataArray) else result
