"""A rigid study loads neither the contact solver nor the compiler."""

import subprocess
import sys


def test_rigid_study_loads_no_solver():
    code = (
        "import sys, numpy as np, xarray as xr, fractalcontact as fc\n"
        "x = xr.DataArray(np.arange(20.0), dims='x'); y = xr.DataArray(np.arange(20.0), dims='y')\n"
        "z = np.random.default_rng(0).random((20, 20))\n"
        "z = xr.DataArray(z, dims=('y', 'x'), coords={'x': x, 'y': y})\n"
        "crack = fc.joints.Crack(z, young=1.0, poisson=0.2, block=10)\n"
        "fc.joints.friction(fc.joints.dilatancy(crack, shear=[0, 1, 2, 2.5]))\n"
        "heavy = ('numba', 'fractalcontact.contact', 'skimage', 'matplotlib', 'pyamg')\n"
        "assert not [name for name in heavy if name in sys.modules]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_import_of_joints_is_light():
    code = (
        "import sys, fractalcontact.joints\n"
        "heavy = ('numba', 'xarray', 'skimage', 'matplotlib', 'netCDF4', 'dask', 'pyamg')\n"
        "assert not [name for name in heavy if name in sys.modules]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
