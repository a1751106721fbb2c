"""Kernels run whether or not their compiled code can be saved."""

import numpy as np
from numba.core import caching

from fractalcontact.base import jit


def add_up(values):
    total = 0.0
    for value in values:
        total += value
    return total


def test_kernels_run_without_a_cache_folder(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    for decorate in (jit.kernel, jit.sum_kernel, jit.gap_sum_kernel, jit.parallel_kernel):
        decorate(add_up)
    assert jit.kernel(add_up)(np.arange(5.0)) == 10.0


def test_kernels_run_on_a_full_disk(monkeypatch):
    tried = []

    def full(*arguments):
        tried.append(arguments)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    assert jit.kernel(add_up)(np.arange(6.0)) == 15.0
    assert tried
