"""What importing the package loads, and that no module hides a public function."""

import importlib
import json
import pkgutil
import subprocess
import sys

import pytest

import fractalcontact

HEAVY = {"numba", "matplotlib", "skimage", "dask", "netCDF4", "xarray", "pandas", "scipy", "pyamg"}
SLOW = {"numba", "matplotlib", "skimage", "dask", "netCDF4"}
# what is done one after the other in one process, and the libraries that none of it loads
DONE = {
    "import fractalcontact, fractalcontact.cli": HEAVY | {"numpy", "tqdm"},
    "import fractalcontact.plotting, fractalcontact.domains": HEAVY,
    "fractalcontact.dimensions.methods()": HEAVY,
    "import fractalcontact.joints": HEAVY,
    "import fractalcontact.base.file_contents": HEAVY,  # of `fractalcontact info`
    "[getattr(surfaces, name) for name in surfaces.__all__ if name != 'from_points']": SLOW
    | {"SurfaceTopography"},
    "fractalcontact.plotting.draw, fractalcontact.plotting.surface": {"numba", "matplotlib"},
    "fractalcontact.domains.box_dimension": SLOW - {"numba"},
}


@pytest.fixture(scope="module")
def loaded():
    """The top modules after each line of `DONE`, in one process."""
    code = (
        "import json, sys\n"
        "import fractalcontact\n"
        "for line in sys.argv[1:]:\n"
        "    exec(line, {'fractalcontact': fractalcontact, 'surfaces': fractalcontact.surfaces})\n"
        "    print(json.dumps([name for name in sys.modules if '.' not in name]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, *DONE], capture_output=True, text=True, check=True)
    return dict(zip(DONE, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("line", DONE)
def test_import_loads_no_heavy_library(loaded, line):
    assert not DONE[line] & set(loaded[line])


def test_no_module_hides_a_public_function():
    for subpackage in (
        "surfaces",
        "dimensions",
        "contact",
        "domains",
        "joints",
        "scenes",
        "accuracy",
        "plotting",
    ):
        package = importlib.import_module(f"fractalcontact.{subpackage}")
        files = {module.name for module in pkgutil.iter_modules(package.__path__)}
        assert not files & set(package.__all__), subpackage
        for name in package.__all__:
            assert not isinstance(getattr(package, name), type(fractalcontact)), f"{subpackage}.{name}"
