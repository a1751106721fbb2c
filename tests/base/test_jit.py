"""Kernels run without a folder for their compiled code, and Numba is left as it was found."""

import numba
import numpy as np
from numba.core import caching

import fractalcontact as fc
from fractalcontact.base import jit


def add_up(values):
    total = 0.0
    for value in values:
        total += value
    return total


def test_kernels_run_without_a_cache_folder(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    for decorate in (jit.kernel, jit.inner_kernel, jit.sum_kernel, jit.gap_sum_kernel):
        decorate(add_up)
    assert jit.kernel(add_up)(np.arange(5.0)) == 10.0


def test_number_of_threads_of_numba_is_left_alone():
    surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    found = numba.get_num_threads()
    try:
        for count in {1, found}:
            numba.set_num_threads(count)
            fc.dimensions.variogram(surface, increments="absolute")
            fc.dimensions.covering(surface)
            assert numba.get_num_threads() == count
    finally:
        numba.set_num_threads(found)
