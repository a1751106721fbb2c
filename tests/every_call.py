"""A small call of every public function that computes or reads, made in threads and in processes.

`python every_call.py threads fork` makes the calls one after another, then in three threads at once, then in
a process that is forked afterwards; it prints what differs, as JSON.
"""

import functools
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
from calls import CALLS as ARGUMENTS
from calls import crack, labelled_functions, measured, rough
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


@functools.cache
def study():
    """Return a finished study, for the functions that read one."""
    folder = Path(tempfile.mkdtemp())
    (folder / "small.toml").write_text(SCENE, encoding="utf-8")
    return fc.scenes.run(folder / "small.toml", out=folder, progress=False), folder


def scene():
    return study()[1] / "small.toml"


def opened(folder):
    return fc.open(fc.save(rough(), folder / "opened.nc"))


def run(folder):
    tree = fc.scenes.run(scene(), out=folder / "run", progress=False)
    assert fc.open(folder / "run" / "result.nc").attrs["provenance"] == tree.attrs["provenance"]
    return tree


CALLS = {
    "save": lambda folder: xr.open_dataset(fc.save(rough(), folder / "saved.nc")).load(),
    "open": opened,
    "contact.effective_modulus": lambda _: fc.contact.effective_modulus(1e9, 0.2),
    "contact.effective_poisson": lambda _: fc.contact.effective_poisson(1e9, 0.2),
    "contact.flat_stiffness": lambda _: fc.contact.flat_stiffness((20, 20), 1e-4, contact_modulus=1e9),
    "dimensions.methods": lambda _: fc.dimensions.methods(),
    "joints.Crack": lambda _: crack().faces()[0],
    "scenes.json_schema": lambda _: fc.scenes.json_schema(),
    "scenes.load": lambda _: str(fc.scenes.load(scene()).tables),
    "scenes.validate": lambda _: str(fc.scenes.validate(scene()).tables),
    "scenes.plan": lambda _: str(fc.scenes.plan(fc.scenes.load(scene()))),
    "scenes.report": lambda folder: fc.scenes.report(study()[0], folder / "report.html").name,
    "scenes.reproduce": lambda _: fc.scenes.reproduce(study()[0]["joints/closure"].to_dataset()),
    "scenes.run": run,
    "scenes.summary": lambda _: fc.scenes.summary(study()[0]),
    "scenes.template": lambda folder: fc.scenes.template(
        "roughness", fc.save(rough(), folder / "scan.nc"), folder=folder
    ),
    "scenes.export": lambda folder: str(
        [path.name for path in fc.scenes.export(rough(), folder / "maps", to="tiff", force=True)]
    ),
    "scenes.tables": lambda _: str(sorted(fc.scenes.tables(study()[0]))),
    "accuracy.benchmarks": lambda _: str([b.name for b in fc.accuracy.benchmarks("surfaces")]),
    "accuracy.estimators": lambda _: fc.accuracy.estimators(0.5, 16, "fbm", "increments", members=4, rng=1),
    "accuracy.measure": lambda _: str(sorted(measured().children)),
    "plotting.draw": lambda folder: str(
        sorted(path.name for path in fc.plotting.draw(study()[0], folder / "figures"))
    ),
    "accuracy.summary": lambda _: fc.accuracy.summary(measured())[:20],
}


def names():
    """Return every public function that computes or reads; a new one is in it by itself."""
    found = ["save", "open", "plotting.draw"]
    for subpackage in CALLED:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        found += [name for function in module.__all__ if (name := f"{subpackage}.{function}") not in LEFT_OUT]
    return found


def has_call(name):
    return name in CALLS or (name in ARGUMENTS and name in labelled_functions())


def fingerprint(name, folder):
    """Return a digest of the numbers that a function returns; run times are left out."""
    folder.mkdir(exist_ok=True)
    result = CALLS[name](folder) if name in CALLS else test_labels.result_of(name)
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
    text = repr(result)
    if name == "scenes.summary":
        text = "".join(letter for letter in text if not letter.isdigit() and letter not in " .")
    return hashlib.sha256(text.encode()).hexdigest()


def fingerprints(order=None, expected=None):
    """Return the digest of every function, or the error; those that are as expected are left out."""
    folder, found = Path(tempfile.mkdtemp()), {}
    for name in order or names():
        try:
            found[name] = fingerprint(name, folder)
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
