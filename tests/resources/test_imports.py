"""A scene imports, compiles and allocates what its wanted results require, and nothing else."""

import json
import os
import subprocess
import sys
import time
import tracemalloc
from collections import Counter
from pathlib import Path

import pytest
from study import SOUND

import fractalcontact as fc

SHIPPED = Path(__file__).parents[2] / "datasets" / "concrete_crack.nc"
HEAVY = ("numba", "matplotlib", "skimage", "dask", "xarray", "netCDF4", "scipy", "tqdm")
SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints", "accuracy", "plotting")

COMMAND = """
import importlib, json, os, sys, time
sys.path.insert(0, sys.argv[1])
from fractalcontact.base.process import block_dask_import
from fractalcontact.cli import main
for libraries, words in json.loads(sys.argv[2]):
    if libraries:
        block_dask_import()
    for name in libraries:
        importlib.import_module(name)
    if os.fork():
        assert os.wait()[1] == 0, words
        continue
    started = time.process_time()
    code = main(words)
    cpu_time = time.process_time() - started
    import probe
    modules = [name for name in sys.modules if sys.modules[name]]
    print(json.dumps({
        "code": code, "kernels": probe.kernels(), "cpu_time": cpu_time,
        "modules": sorted({name.split(".")[0] for name in modules}),
        "subpackages": sorted({name.split(".")[1] for name in modules if name.startswith("fractalcontact.")}),
    }), file=sys.stderr)
    sys.stderr.flush()
    os._exit(code)
"""


def command_reports(*commands, **environment):
    """Run commands, each in a process of its own; return what it imported and compiled.

    A command is the libraries that are imported before, and are in all later processes too, and its words.
    """
    task = json.dumps([(libraries, list(map(str, words))) for libraries, words in commands])
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(Path(__file__).parent), task],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"FRACTALCONTACT_THREADS": "1"} | environment,  # all of it in this one process
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stderr.splitlines() if line.startswith('{"code"')]


def compilations(report):
    return sum(compiled for _, compiled in report["kernels"].values())


def scene(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


SURFACE = SOUND.partition("[material]")[0]
DIMENSION = SURFACE + '[want]\ndimensions = ["default"]\n'
PRESSED = SURFACE + '[contact]\ncontact_modulus = 1e9\nnominal_pressure = 1e5\n[want]\ncontact = ["press"]\n'
PAPER = (
    SOUND.replace('"rigid_dilatancy"]', '"rigid_dilatancy", "elastic_dilatancy", "friction"]')
    + 'dimensions = ["default", "spectrum", "variogram", "cube_counts"]\n'
    + 'domains = ["box_dimension", "lacunarity"]\nkeep = ["state"]\n'
)
RIGID = SHIPPED.with_name("rigid_sliding.toml").read_text(encoding="utf-8")
RIGID = RIGID.replace(SHIPPED.name, str(SHIPPED)).replace(
    '"rigid_dilatancy"]', '"rigid_dilatancy", "friction"]'
)
WANTED = {
    "rigid": (RIGID, {"surfaces", "joints"}),
    "dimension": (DIMENSION, {"surfaces", "dimensions"}),
    "pressed": (PRESSED, {"surfaces", "contact"}),
    "closure": (SOUND, {"surfaces", "joints", "contact"}),
    "paper": (PAPER, {"surfaces", "dimensions", "joints", "contact", "domains"}),
}
# number of kernels of each subpackage
COMPILED = {
    "rigid": {},
    "dimension": {"dimensions": 3},
    "pressed": {"contact": 8},
    "closure": {"contact": 10},
    "paper": {"dimensions": 4, "domains": 3, "contact": 10},
}


# what every study loads, and what every study with kernels does
ALWAYS, COMPILER = ["xarray", "netCDF4", "jinja2"], ["numba", "scipy.linalg", "scipy.special"]


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """What short commands, the studies of `WANTED` and the last study once more loaded and compiled."""
    folder = tmp_path_factory.mktemp("reports")
    fc.save(fc.surfaces.fbm((16, 16), 1.0, hurst=0.5, rms_increment=1.0, rng=1), folder / "surface.nc")
    commands = {"methods": ([], ["methods"]), "info": ([], ["info", folder / "surface.nc"])}
    for name, (text, _) in WANTED.items():
        libraries = ALWAYS if name == "rigid" else COMPILER
        (folder / name).mkdir()
        commands[name] = libraries, ["run", scene(folder / name, text), "-o", folder / name, "--quiet"]
    commands["again"] = [], [*commands["paper"][1][:3], folder / "again", "--quiet"]
    return dict(zip(commands, command_reports(*commands.values()), strict=True))


def test_list_of_methods_imports_no_scipy(reports):
    assert not set(HEAVY) & set(reports["methods"]["modules"])


def test_info_reads_a_file_without_xarray(reports):
    unneeded = {"numba", "matplotlib", "skimage", "dask", "xarray", "scipy"}
    assert unneeded & set(reports["info"]["modules"]) == set()


@pytest.mark.parametrize("name", list(WANTED))
def test_only_required_subpackages_and_kernels_are_loaded(reports, name):
    report = reports[name]
    assert set(report["subpackages"]) & set(SUBPACKAGES) == WANTED[name][1]
    assert not {"matplotlib", "skimage", "dask.distributed", "tqdm", "pyamg"} & set(report["modules"])
    kernels = report["kernels"]
    assert Counter(kernel.partition(".")[0] for kernel in kernels) == COMPILED[name], list(kernels)
    assert all(forms == 1 for forms, _ in kernels.values())
    assert ("numba" in report["modules"]) == (name != "rigid")


def test_second_run_compiles_nothing(reports):
    assert compilations(reports["again"]) == 0
    assert reports["again"]["kernels"].keys() == reports["paper"]["kernels"].keys()


LONG = """
[surface]
generate = "fbm"
shape = [64, 64]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
[contact]
contact_modulus = 1e9
tolerance = 1e-2
nominal_pressure = { first = 1e5, last = 1e6, count = COUNT }
[want]
contact = ["press"]
domains = ["percolation"]
"""


def test_memory_of_scalar_results_is_independent_of_path_length(tmp_path, monkeypatch):
    monkeypatch.setattr("fractalcontact.scenes._stages.PART_SIZE", 10 * 64 * 64)
    peaks = []
    for count in (10, 20, 160):  # the first loads and compiles
        path = scene(tmp_path, LONG.replace("COUNT", str(count)))
        tracemalloc.start()
        fc.scenes.run(path, progress=False)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the states of 160 steps alone would take 650 kB more
    assert peaks[2] - peaks[1] < 400_000


@pytest.mark.benchmark
def test_cold_cache_fills_in_five_seconds(tmp_path):
    words = ("run", "concrete_crack", "--quiet")
    cache_folder = str(tmp_path / "numba")
    cold, warm = command_reports(
        *(([], [*words, "-o", tmp_path / name]) for name in ("cold", "warm")), NUMBA_CACHE_DIR=cache_folder
    )
    print(f"cold: {compilations(cold)} kernels, {cold['cpu_time']:.1f} s; warm: {warm['cpu_time']:.1f} s")
    assert compilations(warm) == 0
    assert cold["cpu_time"] - warm["cpu_time"] < 5.0


@pytest.mark.benchmark
@pytest.mark.parametrize("words", [("--version",), ("--help",), ("methods",), ("info", SHIPPED)])
def test_command_starts_in_half_a_second(words):
    seconds = []
    for _ in range(5):
        start = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "fractalcontact", *map(str, words)], capture_output=True, check=True
        )
        seconds.append(time.perf_counter() - start)
    assert min(seconds) < 0.5
