"""The peak memory of each stage of a study, estimated before it runs.

At its peak a stage holds the libraries loaded so far, the surfaces, the maps that earlier stages keep, and
what the call of its public function takes (see `base.resources`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.resources import Plane, bytes_on, map_bytes, require_memory
from fractalcontact.scenes._functions import arguments_of, public_function
from fractalcontact.scenes._inputs import block_shape, generator_options, surface_grid
from fractalcontact.scenes._options import call_options
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stages import FIGURES, Stage, section_length

if TYPE_CHECKING:
    import xarray as xr

# bytes of the libraries that a study has loaded at its start, and of the compiled kernels of a subpackage,
# measured on scenes of 48 x 48 points
STARTED = 1.2e8
KERNELS = {"dimensions": 5.0e7, "contact": 6.0e7, "joints": 6.0e7, "domains": 2.0e7}
PERIODIC = ("spectral", "weierstrass")  # generators of periodic surfaces


def stage_memory(scene: Scene, stages: Sequence[Stage], face: xr.DataArray | None = None) -> dict[str, float]:
    """Return the peak memory of each stage in bytes; nothing where the surface cannot be made or read."""
    generator = scene.surface.generate
    if generator is not None and not arguments_of(f"surfaces.{generator}")[1] <= set(scene.surface.options):
        return {}
    try:
        shape, spacing = surface_grid(scene, face)
    except InvalidInput:
        return {}
    surface, block = Plane(shape, generator in PERIODIC), Plane(block_shape(scene, shape, spacing))
    held = 8.0 * surface.cells * (2 if scene.upper is not None else 1)
    loaded: set[str] = set()
    peaks = {}
    for stage in stages:
        loaded.add(stage.row.subpackage)
        libraries = _libraries(loaded)
        if stage.name == FIGURES:
            peaks[stage.name] = libraries + held + 24.0 * surface.cells
            continue
        if stage.name == "surfaces":
            peaks[stage.name] = libraries + max(held, _surface_memory(scene, surface))
            continue
        takes = stage.row.takes
        plane = surface if takes == "surface" or (takes == "map" and scene.is_pressed) else block
        options = call_options(scene, stage.row, stage.keep)
        steps, shears = _count(options, LOADS), _count(options, ("shear",))
        section = section_length(steps, int(plane.cells), has_hardness="hardness" in options)
        planes = section if stage.reads_part else steps * shears if stage.reads_map else 1
        call = _with_steps(options, section)
        estimate = public_function(stage.row.function).memory  # type: ignore[attr-defined]
        working = bytes_on(estimate, Plane(plane.shape, plane.periodic, planes), call)
        maps = sum(map(map_bytes, stage.keep)) * plane.cells * steps * shears
        peaks[stage.name] = libraries + held + max(working, 2.0 * maps)
        held += maps
    return peaks


def check_memory(
    scene: Scene, stages: Sequence[Stage], workers: int = 0, face: xr.DataArray | None = None
) -> None:
    """Raise `TooLittleMemory` unless the stage that needs most fits, in each of several processes."""
    peaks = stage_memory(scene, stages, face)
    if not peaks:
        return
    name = max(peaks, key=lambda stage: peaks[stage])
    processes = max(1, workers)
    needed = peaks[name] * processes - STARTED  # that this process has taken
    shared = f" in {processes} processes" if processes > 1 else ""
    require_memory("fractalcontact.scenes.run", needed, f"the stage {name}{shared}")


def _libraries(loaded: set[str]) -> float:
    """Return the bytes of the libraries and kernels of these subpackages."""
    names = loaded & set(KERNELS) - ({"contact"} if "joints" in loaded else set())  # joints use the same
    compiled = 6.0e7 + sum(KERNELS[name] for name in names) if names else 0.0  # with the compiler
    return STARTED + compiled + (9.0e7 if "plotting" in loaded else 0.0)


def _surface_memory(scene: Scene, plane: Plane) -> float:
    """Return the bytes of making or reading the surface."""
    table = scene.surface
    if table.generate is None:
        return 24.0 * plane.cells  # bytes while a file is read
    function = public_function(f"surfaces.{table.generate}")
    members = int(generator_options(table).get("members") or 1)
    return bytes_on(function.memory, replace(plane, planes=members), {})  # type: ignore[attr-defined]


def _count(options: dict[str, Any], names: Sequence[str]) -> int:
    """Return the number of values of the first of these arguments that is given; 1 without any."""
    given = next((options[name] for name in names if options.get(name) is not None), None)
    return max(1, int(np.size(given))) if given is not None else 1


def _with_steps(options: dict[str, Any], steps: int) -> dict[str, Any]:
    """Return the arguments with one section of the load path, at one shear: those of a part."""
    cut = {name: options[name][:steps] for name in LOADS if isinstance(options.get(name), list)}
    return options | cut | ({"shear": [0.0]} if "shear" in options else {})
