"""Audit the resources of a scene: libraries, compiled kernels, memory, bytes and stages.

    python tests/resources/audit.py SCENE [SCENE ...] [-o FOLDER]

A scene is the name of a shipped one or a TOML file. Each is run twice in processes of its own, first with an
empty cache of compiled kernels, then with the full one. Every number is printed beside what the wanted
results require: the libraries that the wanted words need, with all that these load by themselves; the kernels
and stages that are needed; no kernel compiled again; the memory of the libraries alone; the surface and the
results, in units of the heights of the surface; the numbers of the result without a file around them. Lines
below the table name what is loaded, compiled or run and not required. With -o, FOLDER/resources.nc holds the
numbers and the names behind the counts.

Audit a scene after any change of imports, of kernels or of the stages of a study.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

import fractalcontact as fc
from fractalcontact.base import fft
from fractalcontact.base.errors import FractalContactError

PROBE = Path(__file__).with_name("probe.py")
TASK, REPORT = "task.pickle", "report.json"
FIGURES = "figures"
MB = 1e6

# variable: units, long name
QUANTITIES = {
    "library": (None, "library loaded, some with their subpackages"),
    "library_required": ("1", "the wanted results require the library"),
    "library_count": ("1", "number of libraries loaded"),
    "required_library_count": ("1", "number of libraries that the wanted results require"),
    "kernel": (None, "compiled kernel"),
    "kernel_required": ("1", "the wanted results require kernels of this subpackage"),
    "kernel_forms": ("1", "number of argument types for which a kernel was compiled"),
    "kernel_count": ("1", "number of compiled forms of kernels"),
    "required_kernel_count": ("1", "number of kernels that the wanted results require at most"),
    "warm_kernel_count": ("1", "number of kernels compiled by the second run"),
    "compile_time": ("s", "processor time of the first run beyond that of the second"),
    "stage": (None, "stage of the scene"),
    "stage_required": ("1", "the wanted results require the stage"),
    "stage_count": ("1", "number of stages run"),
    "required_stage_count": ("1", "number of stages that the wanted results require"),
    "run_time": ("s", "run time of the stage in the second run"),
    "memory": ("byte", "peak memory of the second run above the bare interpreter"),
    "required_memory": ("byte", "peak memory of loading the required libraries"),
    "array_memory": ("byte", "peak memory of arrays and Python objects"),
    "required_array_memory": ("byte", "memory of the surface and of the wanted results"),
    "surface_memory": ("byte", "memory of the heights of the surface"),
    "written_size": (
        "byte",
        "bytes written, also to files removed later; NaN where the system does not count",
    ),
    "file_size": ("byte", "size of the files"),
    "result_size": ("byte", "size of the wanted numbers"),
    "repeated_size": ("byte", "size of the coordinates stored in several groups"),
}

# ---------------------------------------------------------------------------------------------------------
# What the wanted results require: by the words of [want] and by the way the surface is made

FFT = "fft"  # stands for the library that does the transforms
ALWAYS = ("lazy_loader", "numpy", "xarray", "netCDF4", "tabulate", "jinja2")  # the report of a folder
WITH_KERNELS = ("numba", "scipy.linalg")

# group of kernels: subpackage, and how many of them a study compiles at most, from an empty cache
KERNELS = {
    "contact solver": ("contact", 12),
    "increment sums": ("dimensions", 1),
    "posterior": ("dimensions", 13),
    "covering area": ("dimensions", 1),
    "dividers": ("dimensions", 1),
    "minimum cover": ("domains", 1),
    "mean cover": ("domains", 1),
    "distances": ("domains", 2),
    "boundary": ("domains", 2),
    "gliding boxes": ("domains", 3),
    "islands": ("domains", 3),
    "quarters": ("domains", 2),
}
# of modes in double precision, and in single precision for the preconditioner of a periodic body
IN_TWO_PRECISIONS = ("contact._kernels.scale_modes",)
OF_MASKS = tuple(name for name, (subpackage, _) in KERNELS.items() if subpackage == "domains")


@dataclass(frozen=True)
class Requirement:
    """Libraries, and groups of kernels."""

    libraries: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()


_SOLVER = Requirement((FFT, "scipy.special"), ("contact solver",))
_SUMS = Requirement((FFT,), ("increment sums",))
_EXACT = Requirement((FFT, "scipy.ndimage", "scipy.special"), ("posterior",))
_LABELS = ("scipy.ndimage", "scipy.special")
_SPECIAL = ("scipy.special",)

REQUIREMENTS = {
    "generate/fbm": Requirement((FFT,)),
    "generate/spectral": Requirement((FFT,)),
    "sample/jacksboro_fault_dem": Requirement(("matplotlib.cbook",)),
    "prepare/despike": Requirement(_SPECIAL),
    "prepare/fill": Requirement(("scipy.sparse.linalg",)),
    "dimensions/default": _EXACT,
    "dimensions/likelihood": _EXACT,
    "dimensions/increments": _EXACT,
    # the table of methods loads the modules of all curves, and with them the compiler
    "dimensions/spectrum": Requirement((FFT, "numba", "scipy.optimize")),
    "dimensions/higuchi": Requirement((FFT, "numba")),
    "dimensions/detrended_fluctuation": Requirement((FFT, "scipy.optimize"), _SUMS.kernels),
    "dimensions/divider": Requirement((FFT,), ("dividers",)),
    "surfaces/texture": Requirement((FFT, "scipy.ndimage")),
    "dimensions/variogram": _SUMS,
    "dimensions/madogram": _SUMS,
    "dimensions/roughness_length": Requirement((FFT, "scipy.optimize"), _SUMS.kernels),
    "dimensions/cube_counts": Requirement((FFT, "numba")),
    "dimensions/covering": _SUMS,
    "dimensions/variation": Requirement((FFT, "numba")),
    # where maps are kept, a caveat on the size of islands, which go on across periodic edges
    "contact": Requirement((*_SOLVER.libraries, "scipy.ndimage", "scipy.sparse"), _SOLVER.kernels),
    # the registration of scikit-image has scipy's transforms of its own
    "joints/register": Requirement((FFT, "skimage.registration", "scipy.ndimage", "scipy.fft")),
    "joints/delta_dimension": Requirement((FFT,), (*_SUMS.kernels, "covering area")),
    "joints/closure": _SOLVER,
    "joints/elimination": _SOLVER,
    "joints/area_by_resolution": _SOLVER,
    "joints/self_weight": _SOLVER,
    "joints/elastic_dilatancy": _SOLVER,
    "joints/partial_slip": _SOLVER,
    "joints/direct_shear": Requirement((), _SOLVER.kernels),
    # a fit of the facets
    "joints/directional_roughness": Requirement(("scipy.optimize",)),
    "joints/strength_envelope": Requirement(("scipy.optimize",)),
    "partial_slip": _SOLVER,
    "joints/transmissivity": Requirement(("scipy.sparse.linalg", "scipy.sparse.csgraph")),
    "joints/uplift": Requirement(("scipy.sparse.linalg", "scipy.sparse.csgraph")),
    "domains/box_dimension": Requirement(_LABELS, ("minimum cover", "mean cover", "islands")),
    # in the module of the box dimension, which labels islands
    "domains/box_counts": Requirement(_LABELS, ("mean cover",)),
    "domains/box_counts/minimum": Requirement((), ("minimum cover",)),
    "domains/minkowski_dimension": Requirement(_SPECIAL, ("distances",)),
    "domains/correlation_dimension": Requirement((FFT, *_SPECIAL)),
    "domains/generalised_dimensions": Requirement(_SPECIAL),
    "domains/boundary_dimension": Requirement(_SPECIAL, ("boundary",)),
    "domains/lacunarity": Requirement((), ("gliding boxes",)),
    "domains/islands": Requirement(_LABELS, ("islands",)),
    "domains/percolation": Requirement(_LABELS),  # islands that continue across edges take kernels
    "domains/describe": Requirement(_LABELS, OF_MASKS),
    "domains/evolution": Requirement((*_LABELS, "scipy.spatial"), OF_MASKS),
    "domains/signature": Requirement(_LABELS, ("islands", "gliding boxes")),
    "domains/hausdorff_content": Requirement((), ("quarters",)),
    "domains/lineage": Requirement(_LABELS),
    FIGURES: Requirement(("matplotlib.figure", "matplotlib.style", "matplotlib.backends.backend_agg")),
}


def requirements(scene):
    """Return what the wanted results of a scene require."""
    entries = [REQUIREMENTS[word] for word in _words(scene) if word in REQUIREMENTS]
    libraries = dict.fromkeys([*ALWAYS, *(name for entry in entries for name in entry.libraries)])
    kernels = tuple(dict.fromkeys(name for entry in entries for name in entry.kernels))
    if FFT in libraries:
        del libraries[FFT]
        libraries["scipy.fft" if fft.library() == "scipy" else fft.library()] = None
    return Requirement((*libraries, *(WITH_KERNELS if kernels else ())), kernels)


def kernel_limits(requirement):
    """Return how many kernels of each subpackage are required at most."""
    limits = {}
    for subpackage, count in (KERNELS[name] for name in requirement.kernels):
        limits[subpackage] = limits.get(subpackage, 0) + count
    return limits


def required_stages(scene):
    """Return the stages that the wanted words name, and those that these depend on."""
    planned = {stage.name: stage for stage in fc.scenes.plan(scene)}
    required = set()
    pending = [name for name in planned if _is_wanted(name, scene)]
    while pending:
        name = pending.pop()
        if name not in required:
            required.add(name)
            pending += planned[name].needs
    return required


# the stage of a word of `[want]`, where it has another name
NAMED = {
    "surfaces/height": "surfaces",
    "surfaces/describe": "surfaces/description",
    "contact/press": "contact",
    "contact/partial_slip": "partial_slip",
}


def _is_wanted(stage, scene):
    """Whether the words of `[want]` name the stage, or its figures show it."""
    words = {stage: word for word, stage in NAMED.items()}
    subpackage, _, name = words.get(stage, stage).partition("/")
    if stage == FIGURES:
        return True
    return name in scene.wanted(subpackage) if name else bool(scene.wanted(subpackage))


def _words(scene):
    for name in ("surface", "upper"):
        table = scene.table(name)
        yield f"generate/{table.get('generate')}"
        yield f"sample/{table.get('sample')}"
        yield from (f"prepare/{key}" for key in ("despike", "fill") if table.get(key))
    yield from (f"dimensions/{word}" for word in scene.wanted("dimensions"))
    yield from required_stages(scene)
    if "box_counts" in scene.wanted("domains"):
        yield f"domains/box_counts/{scene.table('domains').get('box_counts', {}).get('cover')}"
    if scene.table("joint").get("register", False):
        yield "joints/register"


# ---------------------------------------------------------------------------------------------------------
# The measurement


def audit(scene):
    """Measure what a scene loads, compiles, allocates, writes and runs; return a Dataset (`QUANTITIES`).

    Raises
    ------
    InvalidInput
        The scene is wrong.
    FractalContactError
        A process that ran it did not end well.
    """
    scene = scene if isinstance(scene, fc.scenes.Scene) else fc.scenes.load(scene)
    requirement = requirements(scene)
    with tempfile.TemporaryDirectory(prefix="fractalcontact-") as folder:
        place = Path(folder)
        cold = _in_process(place / "cold", {"scene": scene}, place / "kernels")  # a wrong scene ends here
        bare = _in_process(place / "bare", {"libraries": requirement.libraries})
        warm = _in_process(place / "warm", {"scene": scene, "traced": True}, place / "kernels")
    libraries, kernels, stages = warm["libraries"], sorted(cold["kernels"]), list(warm["stages"])
    forms = np.array([cold["kernels"][name][0] for name in kernels], dtype=int)
    limits = kernel_limits(requirement)
    needed_stages, needed_libraries = required_stages(scene), set(bare["libraries"])
    surface_memory = 8 * int(np.prod(surface_shape(scene)))
    numbers = {
        "library_count": len(libraries),
        "required_library_count": len(needed_libraries),
        "kernel_count": forms.sum(),
        "required_kernel_count": sum(limits.values()),
        "warm_kernel_count": sum(compiled for _, compiled in warm["kernels"].values()),
        "stage_count": len(stages),
        "required_stage_count": len(needed_stages),
        "compile_time": max(0.0, cold["cpu_time"] - warm["cpu_time"]),
        "memory": warm["memory"],
        "required_memory": bare["memory"],
        "array_memory": warm["array_memory"],
        "required_array_memory": surface_memory + warm["result"],
        "surface_memory": surface_memory,
        "written_size": np.nan if warm["written"] is None else warm["written"],
        "file_size": warm["files"],
        "result_size": warm["result"],
        "repeated_size": warm["repeated"],
    }
    result = xr.Dataset(
        {
            "library_required": ("library", [name in needed_libraries for name in libraries]),
            "kernel_forms": ("kernel", forms),
            "kernel_required": ("kernel", [name.partition(".")[0] in limits for name in kernels]),
            "stage_required": ("stage", [name in needed_stages for name in stages]),
            "run_time": ("stage", list(warm["stages"].values())),
        }
        | {name: ((), value) for name, value in numbers.items()},
        coords={
            "library": libraries,
            "kernel": np.array(kernels, dtype=str),
            "stage": np.array(stages, dtype=str),
        },
        attrs={"title": f"Resources of the scene {scene.name}"},
    )
    for name, variable in result.variables.items():
        units, long_name = QUANTITIES[name]
        variable.attrs = {"long_name": long_name} | ({} if units is None else {"units": units})
    return result


def surface_shape(scene):
    """Return the number of points of the surface along y and x."""
    table = scene.table("surface")
    if "generate" in table:
        return tuple(int(n) for n in np.broadcast_to(table["shape"], 2))
    if "sample" in table:
        return fc.surfaces.sample(table["sample"]).shape
    options = {key: table[key] for key in ("spacing", "units", "channel") if key in table}
    return fc.surfaces.read(scene.folder / os.path.expandvars(table["read"]), **options).shape


def _in_process(folder, task, cache=None):
    """Carry out a task of `probe.py` in a process of its own and return its report."""
    folder.mkdir()
    (folder / TASK).write_bytes(pickle.dumps({"libraries": (), "scene": None, "traced": False} | task))
    environment = dict(os.environ) | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    environment["FRACTALCONTACT_THREADS"] = "1"  # no copy of the process takes part of the work
    # the child imports this very package, wherever the command was started
    paths = [str(Path(fc.__file__).parents[1]), environment.get("PYTHONPATH", "")]
    environment["PYTHONPATH"] = os.pathsep.join(path for path in paths if path)
    done = subprocess.run(
        [sys.executable, str(PROBE), str(folder)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise FractalContactError(f"resource audit: the scene did not run: {last[0]}")
    return json.loads((folder / REPORT).read_text(encoding="utf-8"))


# ---------------------------------------------------------------------------------------------------------
# The report


def surplus(resources):
    """Return the libraries, kernels and stages that the wanted results do not require."""
    unneeded = [
        str(name)
        for dim in ("library", "kernel", "stage")
        for name in resources[dim].values[~resources[f"{dim}_required"].values.astype(bool)]
    ]
    unneeded += [
        f"{name} for {forms} types"
        for name, forms in zip(resources["kernel"].values, resources["kernel_forms"].values, strict=True)
        if forms > 1 + (name in IN_TWO_PRECISIONS)
    ]
    count, required = resources["kernel"].size, int(resources["required_kernel_count"])
    return unneeded + ([f"{count - required} more kernels than required"] if count > required else [])


HEAD = (
    "scene",
    "libraries",
    "kernels",
    "stages",
    "compiling",
    "memory",
    "arrays, surfaces",
    "written",
    "file",
)


def table(audits):
    """Return one line for each scene, measured / required, and below it what is not required."""
    rows = [HEAD, *(_row(name, resources) for name, resources in audits.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    unneeded = {name: surplus(resources) for name, resources in audits.items()}
    notes = [f"  {name}: not required: {', '.join(names)}" for name, names in unneeded.items() if names]
    return "\n".join(["measured / required by the wanted results", *lines, *notes])


def _row(name, resources):
    values = {key: float(value) for key, value in resources.data_vars.items() if value.ndim == 0}
    counts = (
        f"{values[f'{kind}_count']:g} / {values[f'required_{kind}_count']:g}"
        for kind in ("library", "kernel", "stage")
    )
    arrays = (values[key] / values["surface_memory"] for key in ("array_memory", "required_array_memory"))
    return (
        name,
        *counts,
        f"{values['compile_time']:.1f} s / {values['warm_kernel_count']:g} again",
        f"{values['memory'] / MB:.0f} / {values['required_memory'] / MB:.0f} MB",
        " / ".join(f"{value:.3g}" for value in arrays),
        f"{values['written_size'] / MB:.2g} MB",
        f"{values['file_size'] / MB:.2g} / {values['result_size'] / MB:.2g} MB",
    )


def main(arguments=None):
    """Run the command; return 0, or 1 if a scene takes what its wanted results do not require."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="name of a shipped scene, or a TOML file")
    parser.add_argument("-o", "--out", type=Path, metavar="FOLDER", help="write FOLDER/resources.nc")
    options = parser.parse_args(arguments)
    loaded = [fc.scenes.load(scene) for scene in options.scenes]
    audits = {scene.name: audit(scene) for scene in loaded}
    print(table(audits))
    if options.out is not None:
        tree = xr.DataTree.from_dict({f"/{name}": resources for name, resources in audits.items()})
        print(f"\nwritten: {fc.save(tree, options.out / 'resources.nc')}")
    return int(any(surplus(resources) for resources in audits.values()))


if __name__ == "__main__":
    raise SystemExit(main())
