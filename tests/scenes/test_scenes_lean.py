"""A scene loads, compiles, computes and keeps what its wanted results need, and nothing else."""

import json
import subprocess
import sys
import tracemalloc
from functools import cache
from pathlib import Path

import pytest
from study import SOUND

import fractalcontact as fc
from fractalcontact.scenes import stages

SHIPPED = Path(__file__).parents[2] / "datasets" / "concrete_crack.nc"
HEAVY = ("numba", "matplotlib", "skimage", "dask", "xarray", "netCDF4", "scipy", "tqdm")
ROOMS = ("surfaces", "dimensions", "contact", "domains", "joints", "accuracy", "plotting")

PROBE = """
import json, resource, sys, time
from pathlib import Path
started = time.process_time()
from fractalcontact.cli import main
code = main(sys.argv[1:])
kernels, forms = 0, {}
if "numba" in sys.modules:
    from numba.core.dispatcher import Dispatcher
    import gc
    for one in gc.get_objects():
        if isinstance(one, Dispatcher) and one.py_func.__module__.startswith("fractalcontact"):
            kernels += sum(one.stats.cache_misses.values())
            if one.overloads:
                name = one.py_func.__module__.split(".")[1] + "." + one.py_func.__name__
                forms[name] = len(one.overloads)
print(json.dumps({
    "code": code, "kernels": kernels, "forms": forms, "cpu": time.process_time() - started,
    "modules": sorted({name.split(".")[0] for name in sys.modules}),
    "rooms": sorted({name.split(".")[1] for name in sys.modules if name.startswith("fractalcontact.")}),
    "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
}), file=sys.stderr)
"""


def footprint(*words, **environment):
    """Run the command in a process of its own; return what it loaded, compiled and took."""
    import os

    done = subprocess.run(
        [sys.executable, "-c", PROBE, *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )
    found = json.loads(done.stderr.splitlines()[-1])
    assert found["code"] == 0, done.stderr
    return found


def scene(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


def test_the_package_and_its_command_load_nothing_heavy():
    code = "import sys, fractalcontact, fractalcontact.cli; print(sorted(set({heavy!r}) & set(sys.modules)))"
    words = [sys.executable, "-c", code.format(heavy=(*HEAVY, "numpy"))]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == "[]"


def test_the_list_of_methods_loads_no_scipy():
    assert not set(HEAVY) & set(footprint("methods")["modules"])


def test_the_contents_of_a_file_are_told_without_xarray(tmp_path):
    fc.save(fc.surfaces.fbm((16, 16), 1.0, hurst=0.5, rms_increment=1.0, rng=1), tmp_path / "face.nc")
    found = footprint("info", tmp_path / "face.nc")
    assert {"numba", "matplotlib", "skimage", "dask", "xarray", "scipy"} & set(found["modules"]) == set()


FACE = SOUND.partition("[material]")[0]
DIMENSION = FACE + '[want]\ndimensions = ["default"]\n'
PRESSED = FACE + '[contact]\ncontact_modulus = 1e9\nnominal_pressure = 1e5\n[want]\ncontact = ["press"]\n'


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
SOLVER = {
    *("bend", "collect", "correct", "extend", "inspect", "multiply", "pair_sum", "scale_modes"),
    *("select", "survey", "turn", "weigh"),
}
COMPILED = {
    "rigid": set(),
    "dimension": {"dimensions.increment_sums"},
    "closure": {f"contact.{name}" for name in SOLVER},
    "paper": {"dimensions.increment_sums", "domains.cover", "domains.nearest_ahead", "domains.glide"}
    | {f"contact.{name}" for name in SOLVER},
}


@pytest.fixture(scope="module")
def footprints(tmp_path_factory):
    """Return what each study loaded, each run once for all tests."""

    @cache
    def of(name, number=0):
        folder = tmp_path_factory.mktemp(f"{name}_{number}")
        return footprint("run", scene(folder, WANTED[name][0]), "-o", folder / "out", "--quiet")

    return of


@pytest.mark.parametrize("name", list(WANTED))
def test_only_the_rooms_that_are_needed_are_entered(footprints, name):
    found = footprints(name)
    assert set(found["rooms"]) & set(ROOMS) == WANTED[name][1]
    assert not {"matplotlib", "skimage", "dask.distributed", "tqdm"} & set(found["modules"])


@pytest.mark.parametrize("name", list(COMPILED))
def test_only_these_kernels_are_needed_each_for_one_kind_of_arrays(footprints, name):
    assert footprints(name)["forms"] == dict.fromkeys(COMPILED[name], 1)


def test_a_second_run_compiles_nothing(footprints):
    footprints("closure")
    assert footprints("closure", 1)["kernels"] == 0


def test_the_file_holds_what_was_wanted_and_no_map(tmp_path):
    tree = fc.scenes.run(scene(tmp_path, SOUND), out=tmp_path / "out", progress=False)
    assert {node.path for node in tree.subtree if node.has_data} == {
        "/joints/closure",
        "/joints/rigid_dilatancy",
    }
    assert not any({"y", "x"} & set(node.to_dataset().variables) for node in tree.subtree)
    assert (tmp_path / "out" / "result.nc").stat().st_size < 200_000


def test_the_map_of_the_islands_is_stored_only_where_it_is_kept(tmp_path):
    text = SOUND.replace('joints = ["closure", "rigid_dilatancy"]', 'domains = ["islands"]')
    plain, kept = (
        fc.scenes.run(scene(tmp_path, text + more), progress=False)["domains/islands"].to_dataset()
        for more in ("", 'keep = ["label"]')
    )
    assert not {"label", "y", "x"} & set(plain.variables)
    assert kept["label"].dims == ("shear", "step", "y", "x")
    assert plain["area"].equals(kept["area"])


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


def test_a_scene_of_scalars_needs_no_more_memory_for_a_longer_path(tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "CHUNK", 10 * 64 * 64)
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
def test_a_cold_cache_is_filled_in_five_seconds(tmp_path):
    cold = footprint(
        "run", "concrete_crack", "-o", tmp_path / "cold", "--quiet", NUMBA_CACHE_DIR=str(tmp_path / "numba")
    )
    warm = footprint(
        "run", "concrete_crack", "-o", tmp_path / "warm", "--quiet", NUMBA_CACHE_DIR=str(tmp_path / "numba")
    )
    print(
        f"cold: {cold['kernels']} kernels, {cold['cpu']:.1f} s; warm: {warm['kernels']}, {warm['cpu']:.1f} s"
    )
    assert warm["kernels"] == 0
    assert cold["cpu"] - warm["cpu"] < 5.0


@pytest.mark.benchmark
@pytest.mark.parametrize("words", [("--version",), ("--help",), ("methods",), ("info", SHIPPED)])
def test_the_command_starts_in_half_a_second(words):
    import time

    seconds = []
    for _ in range(5):
        start = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "fractalcontact", *map(str, words)], capture_output=True, check=True
        )
        seconds.append(time.perf_counter() - start)
    assert min(seconds) < 0.5
