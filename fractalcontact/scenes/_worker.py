"""Start of the worker processes: the server that forks them imports this module, and nothing else does.

The workers then share the libraries that every study needs. dask stays out, as in the command itself.
"""

import importlib

from fractalcontact.base.process import block_dask_import

block_dask_import()
for _name in ("netCDF4", "numba", "scipy.fft", "scipy.special", "fractalcontact.scenes._study"):
    importlib.import_module(_name)
