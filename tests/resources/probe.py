"""Run a scene in this process and report what the process loaded, compiled, allocated and wrote.

``python tests/resources/probe.py FOLDER`` reads its task in the folder and writes its report there;
`audit.py` starts it. Nothing heavy is imported at the top, because imports are part of what is measured.
"""

from __future__ import annotations

import gc
import importlib
import json
import pickle
import sys
import time
import tracemalloc
from functools import _lru_cache_wrapper
from pathlib import Path

from fractalcontact.base.process import block_dask_import, peak_memory

TASK, REPORT = "task.pickle", "report.json"
PACKAGE = "fractalcontact"
SPLIT = ("scipy", "skimage", "matplotlib")  # libraries whose subpackages are listed one by one


def main(folder):
    """Load libraries or run a scene, as the task states; run it a second time to trace its arrays."""
    block_dask_import()  # as the command does for a study without workers
    before = peak_memory()
    task = pickle.loads((folder / TASK).read_bytes())
    for name in task["libraries"]:
        importlib.import_module(name)
    report = {}
    if task["scene"] is not None:
        report = run_scene(task["scene"], folder / "first")
    report |= {"libraries": libraries(), "memory": peak_memory() - before, "kernels": kernels()}
    if task["traced"]:
        report["array_memory"] = traced_memory(task["scene"], folder / "second")
    (folder / REPORT).write_text(json.dumps(report), encoding="utf-8")


def libraries():
    """Return the third-party libraries that are loaded, those of `SPLIT` with their subpackages."""
    names = set()
    for name in [name for name, module in sys.modules.items() if hasattr(module, "__name__")]:
        top, *rest = name.split(".")
        if top in sys.stdlib_module_names or top.startswith("_") or top == PACKAGE:
            continue
        names.add(top)
        if top in SPLIT and rest and not rest[0].startswith("_"):
            part = f"{top}.{rest[0]}"
            if hasattr(sys.modules.get(part), "__path__"):
                names.add(part)
    return sorted(names)


def kernels():
    """Return for each kernel that Python calls the number of its argument types and of its compilations.

    Kernels that only kernels call are left out: they are compiled by themselves only where nothing is cached.
    """
    if "numba" not in sys.modules:
        return {}
    from numba.core.dispatcher import Dispatcher

    dispatchers = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    return {
        f"{kernel.py_func.__module__}.{kernel.py_func.__name__}".removeprefix(f"{PACKAGE}."): (
            len(kernel.overloads),
            sum(kernel.stats.cache_misses.values()),
        )
        for kernel in dispatchers
        if kernel.overloads
        and kernel.py_func.__module__.startswith(PACKAGE)
        and not kernel.targetoptions.get("no_cpython_wrapper")
    }


def run_scene(scene, out):
    """Run a scene; return times, bytes and stages."""
    from fractalcontact import scenes

    before, start = bytes_written(), time.process_time()
    tree = scenes.run(scene, out=out, progress=False)
    cpu_time, after = time.process_time() - start, bytes_written()
    variables = [
        (str(name), variable)
        for node in tree.subtree
        for name, variable in node.to_dataset(inherit=False).variables.items()
    ]
    seen = set()
    repeated = 0
    for name, variable in variables:
        content = (name, variable.values.tobytes())
        repeated += variable.nbytes if content in seen else 0
        seen.add(content)
    stages = json.loads(tree.attrs["provenance"])["stages"]
    return {
        "cpu_time": cpu_time,
        "written": None if before is None or after is None else after - before,
        "files": sum(file.stat().st_size for file in out.rglob("*") if file.is_file()),
        "result": sum(variable.nbytes for _, variable in variables),
        "repeated": repeated,
        "stages": {name: entry["run_time"] for name, entry in stages.items()},
    }


def bytes_written():
    """Return the bytes that this process has written so far, None where the system does not count them."""
    path = Path("/proc/self/io")
    if not path.is_file():
        return None
    lines = (line.partition(":") for line in path.read_text(encoding="utf-8").splitlines())
    return next((int(value) for key, _, value in lines if key == "wchar"), None)


def traced_memory(scene, out):
    """Return the peak of allocated bytes in another run; libraries and kernels are loaded before it."""
    from fractalcontact import scenes

    for item in gc.get_objects():
        if isinstance(item, _lru_cache_wrapper) and str(item.__module__).startswith(PACKAGE):
            item.cache_clear()
    gc.collect()
    tracemalloc.start()
    scenes.run(scene, out=out, progress=False)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


if __name__ == "__main__":
    main(Path(sys.argv[1]))
