"""What importing the package loads, and that no module hides a public function."""

import importlib
import pkgutil
import subprocess
import sys

import fractalcontact

HEAVY = ("numba", "matplotlib", "skimage", "dask", "netCDF4", "xarray", "pandas", "scipy")


def test_package_import_loads_no_heavy_library():
    code = f"import sys, fractalcontact; print([m for m in {HEAVY!r} if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


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
