"""Start of the worker processes: the server that forks them imports this module, and nothing else does.

The workers then share the libraries that every study needs. dask stays out, as in the command itself. The
linear algebra has one thread in each worker: with more they wait for each other, and an estimate took twice
as long on two processors.
"""

import importlib
import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # read when numpy is imported
    os.environ.setdefault(_name, "1")

from fractalcontact.base.process import block_dask_import  # noqa: E402

block_dask_import()
for _name in ("netCDF4", "numba", "scipy.fft", "scipy.special", "fractalcontact.scenes._study"):
    importlib.import_module(_name)
