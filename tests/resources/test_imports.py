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
import json, sys, time
sys.path.insert(0, sys.argv.pop(1))
started = time.process_time()
from fractalcontact.cli import main
code = main(sys.argv[1:])
cpu_time = time.process_time() - started
import probe
print(json.dumps({
    "code": code, "kernels": probe.kernels(), "cpu_time": cpu_time,
    "modules": sorted({name.split(".")[0] for name in sys.modules}),
    "subpackages": sorted({name.split(".")[1] for name in sys.modules if name.startswith("fractalcontact.")}),
}), file=sys.stderr)
"""


def command_report(*words, **environment):
    """Run the command in a process of its own; return what it imported and compiled."""
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(Path(__file__).parent), *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"FRACTALCONTACT_THREADS": "1"} | environment,  # all of it in this one process
    )
    report = json.loads(done.stderr.splitlines()[-1])
    assert report["code"] == 0, done.stderr
    return report


def compilations(report):
    return sum(compiled for _, compiled in report["kernels"].values())


def scene(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


def test_package_and_command_import_nothing_heavy():
    code = "import sys, fractalcontact, fractalcontact.cli; print(sorted(set({heavy!r}) & set(sys.modules)))"
    words = [sys.executable, "-c", code.format(heavy=(*HEAVY, "numpy"))]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == "[]"


def test_list_of_methods_imports_no_scipy():
    assert not set(HEAVY) & set(command_report("methods")["modules"])


def test_info_reads_a_file_without_xarray(tmp_path):
    fc.save(fc.surfaces.fbm((16, 16), 1.0, hurst=0.5, rms_increment=1.0, rng=1), tmp_path / "surface.nc")
    report = command_report("info", tmp_path / "surface.nc")
    assert {"numba", "matplotlib", "skimage", "dask", "xarray", "scipy"} & set(report["modules"]) == set()


SURFACE = SOUND.partition("[material]")[0]
DIMENSION = SURFACE + '[want]\ndimensions = ["default"]\n'
PRESSED = SURFACE + '[contact]\ncontact_modulus = 1e9\nnominal_pressure = 1e5\n[want]\ncontact = ["press"]\n'
PAPER = (
    SOUND.replace('"rigid_dilatancy"]', '"rigid_dilatancy", "elastic_dilatancy", "friction"]')
    + 'dimensions = ["default", "spectrum", "variogram", "cube_counts"]\n'
    + 'domains = ["box_dimension", "lacunarity"]\nkeep = ["state"]\n'
)
WANTED = {
    "rigid": (SOUND.replace('"closure", ', ""), {"surfaces", "joints"}),
    "dimension": (DIMENSION, {"surfaces", "dimensions"}),
    "pressed": (PRESSED, {"surfaces", "contact"}),
    "closure": (SOUND, {"surfaces", "joints", "contact"}),
    "paper": (PAPER, {"surfaces", "dimensions", "joints", "contact", "domains"}),
}
# number of kernels of each subpackage
COMPILED = {
    "rigid": {},
    "dimension": {"dimensions": 6},
    "pressed": {"contact": 8},
    "closure": {"contact": 10},
    "paper": {"dimensions": 7, "domains": 4, "contact": 10},
}


@pytest.mark.parametrize("name", list(WANTED))
def test_only_required_subpackages_and_kernels_are_loaded(tmp_path, name):
    text, subpackages = WANTED[name]
    report = command_report("run", scene(tmp_path, text), "-o", tmp_path / "out", "--quiet")
    assert set(report["subpackages"]) & set(SUBPACKAGES) == subpackages
    assert not {"matplotlib", "skimage", "dask.distributed", "tqdm"} & set(report["modules"])
    kernels = report["kernels"]
    assert Counter(kernel.partition(".")[0] for kernel in kernels) == COMPILED[name], list(kernels)
    assert all(forms == 1 for forms, _ in kernels.values())


def test_second_run_compiles_nothing(tmp_path):
    path = scene(tmp_path, SOUND)
    fc.scenes.run(path, progress=False)  # in this process, which fills the cache of the next one
    assert compilations(command_report("run", path, "-o", tmp_path / "out", "--quiet")) == 0


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
    cold, warm = (
        command_report(*words, "-o", tmp_path / name, NUMBA_CACHE_DIR=cache_folder)
        for name in ("cold", "warm")
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
