"""A scene carried out by a process of its own, which then tells what it has loaded, compiled and written.

``python -m fractalcontact.scenes.probing FOLDER`` reads its task in the folder, and leaves its finding there.
"""

from __future__ import annotations

import gc
import importlib
import json
import pickle
import sys
import time
import tracemalloc
from collections.abc import Iterator
from functools import _lru_cache_wrapper
from pathlib import Path
from typing import Any

from fractalcontact.base.memory import leave_dask, most_memory, written

TASK, FOUND = "task.pickle", "found.json"
PARTED = ("scipy", "skimage", "matplotlib")  # libraries whose parts are loaded one by one
OWN = "fractalcontact"


def main(folder: Path) -> None:
    """Do the task of a folder: load libraries, or run a scene, a second time for its arrays if asked to."""
    held = most_memory()
    task = pickle.loads((folder / TASK).read_bytes())
    for name in task["libraries"]:
        importlib.import_module(name)
    found = {}
    if task["scene"] is not None:
        leave_dask()
        found = _run(task["scene"], folder / "first")
    found |= {"libraries": libraries(), "memory": most_memory() - held, "kernels": dict(kernels())}
    if task["traced"]:
        found["array_memory"] = _traced(task["scene"], folder / "second")
    (folder / FOUND).write_text(json.dumps(found), encoding="utf-8")


def libraries() -> list[str]:
    """Return the libraries that are loaded, and of some their parts."""
    names = set()
    loaded = {name for name, module in sys.modules.items() if hasattr(module, "__name__")}
    for name in loaded:
        top, *rest = name.split(".")
        if top in sys.stdlib_module_names or top.startswith("_") or top == OWN:
            continue
        names.add(top)
        if top in PARTED and rest and not rest[0].startswith("_"):
            part = sys.modules.get(f"{top}.{rest[0]}")
            names |= {f"{top}.{rest[0]}"} if hasattr(part, "__path__") else set()
    return sorted(names)


def kernels() -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield the kernels in use: for how many types each stands ready, and how often it was compiled."""
    if "numba" not in sys.modules:
        return
    from numba.core.dispatcher import Dispatcher

    for one in gc.get_objects():
        if isinstance(one, Dispatcher) and one.overloads and one.py_func.__module__.startswith(OWN):
            name = f"{one.py_func.__module__}.{one.py_func.__name__}"
            yield name.removeprefix(f"{OWN}."), (len(one.overloads), sum(one.stats.cache_misses.values()))


def _run(scene: Any, out: Path) -> dict[str, Any]:
    from fractalcontact.scenes.running import run

    before, start = written(), time.process_time()
    tree = run(scene, out=out, progress=False)
    seconds, after = time.process_time() - start, written()
    variables = [
        (str(name), variable)
        for node in tree.subtree
        for name, variable in node.to_dataset(inherit=False).variables.items()
    ]
    seen: set[tuple[str, bytes]] = set()
    repeated = 0
    for name, variable in variables:
        content = (name, variable.values.tobytes())
        repeated += variable.nbytes if content in seen else 0
        seen.add(content)
    return {
        "cpu": seconds,
        "written": None if before is None or after is None else after - before,
        "files": sum(file.stat().st_size for file in out.rglob("*") if file.is_file()),
        "result": sum(variable.nbytes for _, variable in variables),
        "repeated": repeated,
        "stages": {
            name: facts["run_time"] for name, facts in json.loads(tree.attrs["provenance"])["stages"].items()
        },
    }


def _traced(scene: Any, out: Path) -> int:
    """Return the most memory that a run allocates, libraries and kernels being loaded before."""
    from fractalcontact.scenes.running import run

    for one in gc.get_objects():
        if isinstance(one, _lru_cache_wrapper) and str(one.__module__).startswith(OWN):
            one.cache_clear()
    gc.collect()
    tracemalloc.start()
    run(scene, out=out, progress=False)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


if __name__ == "__main__":
    main(Path(sys.argv[1]))
