"""The memory that `--plan` states, against the peak of the process that runs the scene."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import fractalcontact as fc

FACTOR = 1.5
pytestmark = pytest.mark.skipif(
    not Path("/proc/self/status").is_file(), reason="the peak of a process is read on Linux"
)

RUN = """
import json, sys
from fractalcontact.base.process import block_dask_import, peak_memory
block_dask_import()
from fractalcontact import scenes
scenes.run(sys.argv[1], out=sys.argv[2], progress=False)
peak = peak_memory()
sys.path.insert(0, sys.argv[3])
import probe
print(json.dumps([peak, sum(compiled for _, compiled in probe.kernels().values())]))
"""

SURFACE = """
[surface]
generate = "{family}"
shape = [{n}, {n}]
spacing = 1e-4
hurst = 0.7
{size}
rng = 1
"""
PRESSED = """
[contact]
contact_modulus = 1e9
{more}
nominal_pressure = {loads}
[want]
contact = ["press"]
"""
SPECTRAL = {"family": "spectral", "size": "rms_slope = 0.1"}
FBM = {"family": "fbm", "size": "rms_increment = 1e-5"}
ESTIMATED = '[want]\ndimensions = ["default"]\n'
DOMAINS = 'domains = ["box_dimension", "islands", "lacunarity"]\nkeep = ["state", "pressure"]\n'
JOINT = """
[material]
young = 30e9
poisson = 0.2
[joint]
block = {edge}
shear = [4e-4, 8e-4]
normal_force = {loads}
[want]
joints = ["closure", "elastic_dilatancy"]
domains = ["box_dimension"]
"""


def periodic(n, loads="1e7", **more):
    return SURFACE.format(n=n, **SPECTRAL) + PRESSED.format(loads=loads, more="") + more.get("want", "")


def free(n, loads="1e7"):
    return SURFACE.format(n=n, **SPECTRAL) + PRESSED.format(loads=loads, more='boundary = "free"')


def estimated(n, family=FBM):
    return SURFACE.format(n=n, **family) + ESTIMATED


def joint(n, loads="[10.0, 100.0]"):
    return SURFACE.format(n=n, **FBM) + JOINT.format(edge=n * 1e-4 / 2, loads=loads)


FAST = {
    "press free 256": free(256),
    "domains 128": periodic(128, "[1e6, 1e7]", want=DOMAINS),
}
SLOW = {
    "estimate 256": estimated(256),
    "press periodic 256": periodic(256),
    "press periodic 512": periodic(512),
    "press free 512": free(512),
    "press periodic 1024": periodic(1024),
    "press free 1024": free(1024),
    "press periodic 1024 path": periodic(1024, "[1e6, 3e6, 1e7]"),
    "press periodic 2048": periodic(2048),
    "press free 2048": free(2048),
    "estimate 1024": estimated(1024),
    "estimate 2048": estimated(2048),
    "estimate periodic 2048": estimated(2048, SPECTRAL),
    "domains 1024": periodic(1024, "[1e6, 1e7]", want=DOMAINS),
    "joint 512": joint(512),
    "joint 1024": joint(1024),
}


def answer(*words):
    """Run a scene in a process of its own; return its peak memory, and how many kernels it compiled."""
    command = [sys.executable, "-c", RUN, *words, str(Path(__file__).parent)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def check(scene, tmp_path):
    if "\n" in scene:
        (tmp_path / "scene.toml").write_text(scene, encoding="utf-8")
        scene = str(tmp_path / "scene.toml")
    stated = max(fc.scenes.plan(fc.scenes.load(scene)).memory.values())
    used, compiled = answer(scene, str(tmp_path / "first"))
    if compiled:  # what was not in the cache, which takes memory of its own
        used, compiled = answer(scene, str(tmp_path / "second"))
    assert 1 / FACTOR <= stated / used <= FACTOR, (stated / 1e6, used / 1e6)
    return stated, used


@pytest.mark.parametrize("name", FAST)
def test_stated_memory_of_small_scenes(name, tmp_path):
    check(FAST[name], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_stated_memory_of_large_scenes(name, tmp_path):
    check(SLOW[name], tmp_path)


@pytest.mark.slow
def test_stated_memory_of_the_shipped_study(tmp_path):
    check("concrete_crack", tmp_path)
