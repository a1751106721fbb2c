"""What a scene takes - libraries, kernels, memory, bytes, stages - beside the least that it needs."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.base.tables import table
from fractalcontact.scenes.choosing import choose
from fractalcontact.scenes.given import face_grid
from fractalcontact.scenes.needing import least, least_stages
from fractalcontact.scenes.probing import FOUND, TASK
from fractalcontact.scenes.reading import load
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.scenes.footprint"
MB = 1e6


def footprint(scene: Scene | str | os.PathLike[str]) -> xr.Dataset:
    """Measure what a scene loads, compiles, allocates, writes and runs, beside the least that it needs.

    The scene is carried out twice in processes of their own: from an empty cache of compiled kernels, and
    again from the full one. What it needs at the least follows from its wanted words.

    Parameters
    ----------
    scene : Scene or path-like

    Returns
    -------
    Dataset
        Over `library` (of scipy, matplotlib and scikit-image also the parts): library_needed. Over `kernel`:
        kernel_forms, kernel_needed. Over `stage`: run_time (s, of the second run), stage_needed.
        Counts: library_count, kernel_count, stage_count, each with its least; warm_kernel_count, which
        should be 0. compile_time (s): processor time of the first run beyond that of the second.
        Bytes: memory (most held by the second run, above the bare interpreter) and least_memory (of the
        libraries alone); array_memory and least_array_memory (the face and the results); face_memory (the
        heights); written_size, file_size, result_size, repeated_size.

    Raises
    ------
    InvalidInput
        The scene is wrong.
    FractalContactError
        A process that carried it out did not end well.
    """
    import xarray as xr

    scene = scene if isinstance(scene, Scene) else load(scene)
    chosen, _ = choose(scene)
    need = least(chosen)
    with tempfile.TemporaryDirectory(prefix="fractalcontact-") as folder:
        place = Path(folder)
        bare = _apart(place / "bare", {"libraries": need.libraries})
        cold = _apart(place / "cold", {"scene": scene}, place / "kernels")
        warm = _apart(place / "warm", {"scene": scene, "traced": True}, place / "kernels")
    libraries, kernels, stages = warm["libraries"], sorted(cold["kernels"]), list(warm["stages"])
    forms = np.array([cold["kernels"][name][0] for name in kernels], dtype=int)
    kernel_needed = [name.rpartition(".")[0] in need.kernels for name in kernels]
    wanted, bare_names = least_stages(chosen), set(bare["libraries"])
    shape = face_grid(scene)[0]
    face = 8 * shape[0] * shape[1]
    numbers = {
        "library_count": len(libraries),
        "least_library_count": len(bare_names),
        "kernel_count": forms.sum(),
        "least_kernel_count": sum(kernel_needed),
        "warm_kernel_count": sum(compiled for _, compiled in warm["kernels"].values()),
        "stage_count": len(stages),
        "least_stage_count": len(wanted),
        "compile_time": max(0.0, cold["cpu"] - warm["cpu"]),
        "memory": warm["memory"],
        "least_memory": bare["memory"],
        "array_memory": warm["array_memory"],
        "least_array_memory": face + warm["result"],
        "face_memory": face,
        "written_size": np.nan if warm["written"] is None else warm["written"],
        "file_size": warm["files"],
        "result_size": warm["result"],
        "repeated_size": warm["repeated"],
    }
    result = label(
        xr.Dataset(
            {
                "library_needed": ("library", [name in bare_names for name in libraries]),
                "kernel_forms": ("kernel", forms),
                "kernel_needed": ("kernel", kernel_needed),
                "stage_needed": ("stage", [name in wanted for name in stages]),
                "run_time": ("stage", list(warm["stages"].values())),
            }
            | {name: ((), value) for name, value in numbers.items()},
            coords={
                "library": libraries,
                "kernel": np.array(kernels, dtype=str),
                "stage": np.array(stages, dtype=str),
            },
        )
    )
    result["written_size"].attrs["reason"] = "NaN: the system does not tell"
    return stamp(result, WHERE, {"scene": dict(scene.tables)}, title=f"What the scene {scene.name} takes")


def lean_table(found: Mapping[str, xr.Dataset]) -> str:
    """Return one line for each scene, each figure beside the least one, and what is above the least."""
    extra = {name: waste(one) for name, one in found.items()}
    notes = [f"  {name}: not needed: {', '.join(more)}" for name, more in extra.items() if more]
    head = "each beside the least that the wanted results need"
    return "\n".join([head, table(lean_rows(found)), *notes])


def lean_rows(found: Mapping[str, xr.Dataset]) -> list[tuple[str, ...]]:
    """Return the head of the table, and one row for each scene."""
    rows: list[tuple[str, ...]] = [
        ("scene", "libraries", "kernels", "stages", "compiling", "memory", "arrays, faces", "written", "file")
    ]
    return rows + [_row(name, one) for name, one in found.items()]


def waste(found: xr.Dataset) -> list[str]:
    """Return the libraries, kernels and stages that the wanted results do not need."""
    return [
        str(name)
        for dim in ("library", "kernel", "stage")
        for name in found[dim].values[~found[f"{dim}_needed"].values.astype(bool)]
    ] + [
        f"{name} for {forms} types"
        for name, forms in zip(found["kernel"].values, found["kernel_forms"].values, strict=True)
        if forms > 1
    ]


def _row(name: str, found: xr.Dataset) -> tuple[str, ...]:
    one = {str(key): float(value) for key, value in found.data_vars.items() if value.ndim == 0}
    counts = (f"{one[f'{k}_count']:g} / {one[f'least_{k}_count']:g}" for k in ("library", "kernel", "stage"))
    planes = (one[key] / one["face_memory"] for key in ("array_memory", "least_array_memory"))
    return (
        name,
        *counts,
        f"{one['compile_time']:.1f} s / {one['warm_kernel_count']:g} again",
        f"{one['memory'] / MB:.0f} / {one['least_memory'] / MB:.0f} MB",
        " / ".join(f"{plane:.3g}" for plane in planes),
        f"{one['written_size'] / MB:.2g} MB",
        f"{one['file_size'] / MB:.2g} / {one['result_size'] / MB:.2g} MB",
    )


def _apart(folder: Path, task: dict[str, Any], cache: Path | None = None) -> dict[str, Any]:
    """Do a task in a process of its own and return what it found."""
    folder.mkdir()
    whole = {"libraries": (), "scene": None, "traced": False} | task
    (folder / TASK).write_bytes(pickle.dumps(whole))
    environment = dict(os.environ) | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    done = subprocess.run(
        [sys.executable, "-m", "fractalcontact.scenes.probing", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise FractalContactError(f"{WHERE}: the scene was not carried out: {last[0]}")
    found: dict[str, Any] = json.loads((folder / FOUND).read_text(encoding="utf-8"))
    return found
