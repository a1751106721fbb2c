"""Kernels are kept on disk where there is a place for them, and work where there is none."""

import numpy as np
from numba.core import caching

from fractalcontact.base import jit


def add_up(values):
    total = 0.0
    for value in values:
        total += value
    return total


def test_kernels_run_where_no_folder_can_be_written(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    for decorate in (jit.kernel, jit.sum_kernel, jit.gap_sum_kernel, jit.parallel_kernel):
        decorate(add_up)
    assert jit.kernel(add_up)(np.arange(5.0)) == 10.0


def test_a_full_disk_ends_no_kernel(monkeypatch):
    tried = []

    def full(*arguments):
        tried.append(arguments)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    assert jit.kernel(add_up)(np.arange(6.0)) == 15.0
    assert tried
