"""Bytes that a process may take: limits of the process and of control groups, and the errors before them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, TooLittleMemory
from fractalcontact.base.resources import Plane, bytes_on, free_memory, require_memory
from fractalcontact.base.results import public_result

MIB = 1 << 20
linux = pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="limits are read on Linux")


def system(root, files):
    """Write a file system with these files and 64 GiB of free memory."""
    for path, text in {"proc/meminfo": f"MemAvailable: {1 << 26} kB\nSwapFree: 0 kB\n", **files}.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(str(text), encoding="ascii")
    return root


def test_free_memory_of_the_machine_counts_swap(tmp_path):
    root = system(tmp_path, {"proc/meminfo": "MemTotal: 9 kB\nMemAvailable:  2048 kB\nSwapFree: 1024 kB\n"})
    assert free_memory(root).size == 3 * MIB


GROUPS = {
    "version 2": {
        "proc/self/cgroup": "0::/job/step\n",
        "sys/fs/cgroup/job/step/memory.max": "max\n",
        "sys/fs/cgroup/job/step/memory.current": f"{10 * MIB}\n",
        "sys/fs/cgroup/job/memory.max": f"{100 * MIB}\n",
        "sys/fs/cgroup/job/memory.current": f"{60 * MIB}\n",
        "sys/fs/cgroup/job/memory.stat": f"anon 1\nactive_file {5 * MIB}\ninactive_file {15 * MIB}\n",
    },
    "version 2 seen from inside a container": {
        "proc/self/cgroup": "0::/a/path/of/the/host\n",
        "sys/fs/cgroup/memory.max": f"{100 * MIB}\n",
        "sys/fs/cgroup/memory.current": f"{40 * MIB}\n",
    },
    "version 1": {
        "proc/self/cgroup": "9:name=systemd:/\n4:cpu,memory:/job\n",
        "sys/fs/cgroup/memory/job/memory.limit_in_bytes": f"{100 * MIB}\n",
        "sys/fs/cgroup/memory/job/memory.usage_in_bytes": f"{60 * MIB}\n",
        "sys/fs/cgroup/memory/job/memory.stat": f"total_active_file {20 * MIB}\nactive_file 7\n",
        "sys/fs/cgroup/memory/memory.limit_in_bytes": "9223372036854771712\n",
        "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{70 * MIB}\n",
    },
}


@pytest.mark.parametrize("name", GROUPS)
def test_limit_of_a_control_group_without_the_pages_of_files(name, tmp_path):
    free = free_memory(system(tmp_path, GROUPS[name]))
    assert free.size == 60 * MIB
    assert "control group" in free.limit


def test_group_beyond_its_limit_leaves_nothing(tmp_path):
    files = GROUPS["version 2"] | {"sys/fs/cgroup/job/memory.current": f"{200 * MIB}\n"}
    assert free_memory(system(tmp_path, files)).size == 0


def test_error_says_how_much_is_there_and_how_much_is_needed():
    require_memory("here", 1e7, "little")
    with pytest.raises(TooLittleMemory, match=r"expected at most .*iB \(.*\), got much: about 8.88e"):
        require_memory("here", 2.0**30 * 8.88e9, "much")
    assert issubclass(TooLittleMemory, InvalidInput)
    assert issubclass(TooLittleMemory, MemoryError)


def test_estimate_of_planes_that_are_worked_on_one_by_one():
    assert bytes_on(10.0, Plane((4, 5)), {}) == 200.0
    assert bytes_on(10.0, Plane((4, 5), planes=3), {}) == 200.0 + 2 * 20 * 8.0


def test_memory_error_inside_a_call_is_told_in_words():
    @public_result(title="t", achieved_error="none")
    def greedy():
        raise MemoryError("unable to allocate 8 EiB")

    with pytest.raises(TooLittleMemory, match="unable to allocate 8 EiB"):
        greedy()


LIMITED = """
import resource, sys
import numpy as np, xarray as xr
import fractalcontact as fc
from fractalcontact.base.errors import TooLittleMemory

n = 3000
flat = np.zeros((n, n))
flat[5, 5] = 1e-6
surface = fc.surfaces.from_array(flat, 1e-4)
crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=0.25)
size = dict(line.split(":", 1) for line in open("/proc/self/status"))["VmSize"]
limit = int(size.split()[0]) * 1024 + (700 << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
calls = {
    "press": lambda: fc.contact.press(surface, contact_modulus=1e9, normal_force=1e-3),
    "estimate": lambda: fc.dimensions.estimate(surface),
    "variogram": lambda: fc.dimensions.variogram(surface),
    "describe": lambda: fc.surfaces.describe(surface),
    "closure": lambda: fc.joints.closure(crack, shear=1e-3, normal_force=1.0),
    "theories": lambda: fc.contact.theories(surface, contact_modulus=1e9, nominal_pressure=1e3),
    "facets": lambda: fc.joints.directional_roughness(surface),
    "register": lambda: fc.joints.register(surface, surface),
    "direct_shear": lambda: fc.joints.direct_shear(crack, 1e-3, nominal_pressure=1e6, hardness=1e9),
    "delta_dimension": lambda: fc.joints.delta_dimension(crack, shear=1e-3),
    "fbm": lambda: fc.surfaces.fbm((n, n), 1e-4, hurst=0.9, rms_increment=1e-6),
    "spectral": lambda: fc.surfaces.spectral((20000, 20000), 1e-4, hurst=0.7, rms_slope=0.1),
    "midpoint": lambda: fc.surfaces.midpoint((20001, 20001), 1e-4, hurst=0.7, rms_increment=1e-6),
    "from_array": lambda: fc.surfaces.from_array(np.broadcast_to(0.0, (40000, 40000)), 1e-4),
}
for name, call in calls.items():
    try:
        call()
        print(name, "ran")
    except TooLittleMemory as error:
        print(name, "refused" if "ulimit -v" in str(error) else error)
peak = dict(line.split(":", 1) for line in open("/proc/self/status"))["VmHWM"]
print("peak", int(peak.split()[0]) // 1024)
"""


@linux
def test_calls_beyond_the_limit_of_the_process_are_refused_before_they_start():
    done = subprocess.run([sys.executable, "-c", LIMITED], capture_output=True, text=True, check=False)
    answers = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    peak = int(answers.pop("peak"))
    assert set(answers.values()) == {"refused"}, (done.stdout, done.stderr)
    assert len(answers) == 14
    assert peak < 650  # MiB: libraries, and two arrays of 72 MB with a work array


SCENE = """
[surface]
generate = "spectral"
shape = [{n}, {n}]
spacing = 1e-4
hurst = 0.7
rms_slope = 0.1
rng = 1
[contact]
contact_modulus = 1e9
nominal_pressure = 1e6
[want]
contact = ["press"]
"""


@linux
def test_scene_beyond_the_limit_is_refused_in_one_line_and_writes_nothing(tmp_path):
    (tmp_path / "large.toml").write_text(SCENE.format(n=5000), encoding="utf-8")
    for limit, reason in ((1500000, "the stage contact: about"), (400000, "to load NumPy, SciPy and Numba")):
        command = f"ulimit -v {limit}; exec {sys.executable} -m fractalcontact run large.toml -o out"
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"PYTHONPATH": str(Path(fc.__file__).parents[1])},
        )
        assert done.returncode == 1
        assert reason in done.stderr
        assert f"ulimit -v {limit}" in done.stderr
        assert "Traceback" not in done.stderr
        assert not (tmp_path / "out" / "result.nc").exists()


def test_lazy_surface_needs_no_memory_for_the_whole_of_it():
    dask = pytest.importorskip("dask.array")
    lazy = xr.DataArray(dask.zeros((10**6, 10**6), chunks=100_000), dims=("y", "x"))
    assert fc.surfaces.from_array(lazy.data, 1e-4).shape == (10**6, 10**6)
    assert np.prod(lazy.shape) * 8 > free_memory().size
    with pytest.raises(TooLittleMemory, match="1000000 x 1000000 points"):  # which loads its surface
        fc.surfaces.level(fc.surfaces.from_array(lazy.data, 1e-4))
