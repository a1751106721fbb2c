"""A small call of every public function that computes or reads, made in threads and in processes.

`python every_call.py threads fork` makes the calls one after another, then in three threads at once, then in
a process that is forked afterwards; it prints what differs, as JSON.
"""

import hashlib
import importlib
import json
import multiprocessing
import os
import random
import sys
import tempfile
import threading
import traceback
import warnings
from pathlib import Path

import numpy as np
import test_labels
import xarray as xr
from calls import CALLS, measured
from study import SOUND

import fractalcontact as fc
from fractalcontact.base import resources

SCENE = SOUND.replace("[48, 48]", "[24, 24]").replace("2.4e-3", "1e-3")
SCENE += 'dimensions = ["variogram"]\nfigures = true\n'
LIMIT = 240.0  # seconds after which a process counts as hanging
# classes, and a figure (see below)
LEFT_OUT = {
    "accuracy.Benchmark",
    "accuracy.Method",
    "scenes.Scene",
    "scenes.datasheet",
    "surfaces.SelfAffine",
}
# figures draw on the axes of a caller what others have computed, and Matplotlib promises nothing for threads;
# of `plotting` only `draw`, which reads a study and writes files, is called here, and by `scenes.run`
CALLED = [name for name in fc.__all__ if name not in ("plotting", "save", "open")]


def run():
    folder = Path(tempfile.mkdtemp())
    (folder / "small.toml").write_text(SCENE, encoding="utf-8")
    tree = fc.scenes.run(folder / "small.toml", out=folder / "run", progress=False)
    assert fc.open(folder / "run" / "result.nc").attrs["provenance"] == tree.attrs["provenance"]
    return tree


# calls that the table of all tests has not, as they have no arguments or take long, or has to be refused
FURTHER = {
    "dimensions.methods": fc.dimensions.methods,
    "scenes.json_schema": fc.scenes.json_schema,
    "scenes.run": run,
    "accuracy.estimators": lambda: fc.accuracy.estimators(0.5, 16, "fbm", "increments", members=4, rng=1),
    "accuracy.measure": measured,
}


def without_times(text):
    return "".join(letter for letter in text if not letter.isdigit() and letter not in " .")


# what is compared of results that are no data
COMPARED = {
    "save": fc.open,
    "joints.Crack": lambda crack: crack.faces()[0],
    "scenes.load": lambda scene: scene.tables,
    "scenes.validate": lambda scene: scene.tables,
    "scenes.report": lambda path: path.name,
    "scenes.export": lambda paths: [path.name for path in paths],
    "scenes.summary": without_times,
    "scenes.tables": sorted,
    "accuracy.benchmarks": lambda benchmarks: [benchmark.name for benchmark in benchmarks],
    "accuracy.measure": lambda tree: sorted(tree.children),
    "accuracy.summary": without_times,
    "plotting.draw": lambda paths: sorted(path.name for path in paths),
}


def names():
    """Return every public function that computes or reads; a new one is in it by itself."""
    found = ["save", "open", "plotting.draw"]
    for subpackage in CALLED:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        found += [name for function in module.__all__ if (name := f"{subpackage}.{function}") not in LEFT_OUT]
    return found


def has_call(name):
    return name in FURTHER or name in CALLS


def fingerprint(name):
    """Return a digest of the numbers that a function returns; run times are left out."""
    result = FURTHER[name]() if name in FURTHER else test_labels.result_of(name)
    result = COMPARED.get(name, lambda unchanged: unchanged)(result)
    if isinstance(result, xr.DataArray):
        result = result.to_dataset(name="values")
    if isinstance(result, xr.Dataset):
        result = xr.DataTree(result)
    if isinstance(result, xr.DataTree):
        result = [
            (node.path, str(key), variable.values if variable.dtype == object else variable.values.tobytes())
            for node in result.subtree
            for key, variable in node.variables.items()
            if "run_time" not in str(key)
        ]
    if isinstance(result, np.ndarray):
        result = result.tobytes()
    return hashlib.sha256(repr(result).encode()).hexdigest()


def fingerprints(order=None, expected=None):
    """Return the digest of every function, or the error; those that are as expected are left out."""
    found = {}
    for name in order or names():
        try:
            found[name] = fingerprint(name)
        except BaseException:
            found[name] = traceback.format_exc(limit=-3)
    return {name: value for name, value in found.items() if value != (expected or {}).get(name)}


def in_threads(expected):
    """Make all calls in three threads at once, in three orders."""
    differing = [{} for _ in range(3)]
    orders = [names(), names()[::-1], random.Random(1).sample(names(), len(names()))]

    def work(number):
        differing[number] = fingerprints(orders[number], expected)

    running = [threading.Thread(target=work, args=(number,), daemon=True) for number in range(3)]
    for thread in running:
        thread.start()
    for thread in running:
        thread.join(LIMIT)
    hanging = {"threads": "do not end"} if any(thread.is_alive() for thread in running) else {}
    return differing[0] | differing[1] | differing[2] | hanging


def prepare():
    """Run even small loops in bands of three threads."""
    warnings.simplefilter("ignore")
    os.environ["FRACTALCONTACT_THREADS"] = "3"
    resources.SHARE = 256


def send(connection, expected):
    prepare()
    connection.send(fingerprints(expected=expected))


def in_process(method, expected):
    """Make all calls in a process that starts in this way."""
    context = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=send, args=(sender, expected))
    process.start()
    try:
        return receiver.recv() if receiver.poll(LIMIT) else {method: "the process does not end"}
    except EOFError:
        return {method: "the process died"}
    finally:
        process.kill() if process.is_alive() and not receiver.poll(0) else None
        process.join(10)


def main(modes):
    prepare()
    expected, differing = fingerprints(), {}
    differing["one after another"] = {key: text for key, text in expected.items() if len(text) != 64}
    for mode in modes:
        differing[mode] = in_threads(expected) if mode == "threads" else in_process(mode, expected)
    print(json.dumps({mode: entries for mode, entries in differing.items() if entries}), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
