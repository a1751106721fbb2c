"""Kernels run without a folder for their compiled code, and Numba is left as it was found."""

import ast
from pathlib import Path

import numba
import numpy as np
import pytest
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


def sums_in_arrays(source):
    """Return the sums of `source` that an innermost loop of a sum kernel makes in one element of an array."""
    found = []
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        if not {ast.unparse(each) for each in function.decorator_list} & {"sum_kernel", "gap_sum_kernel"}:
            continue
        loops = [node for node in ast.walk(function) if isinstance(node, ast.For)]
        for loop in loops:
            if any(isinstance(node, ast.For) for part in loop.body for node in ast.walk(part)):
                continue
            moves = {node.id for node in ast.walk(loop.target) if isinstance(node, ast.Name)}
            moves |= {
                name.id
                for node in ast.walk(loop)
                if isinstance(node, ast.Assign)
                for target in node.targets
                for name in ast.walk(target)
                if isinstance(name, ast.Name)
            }
            found += [
                ast.unparse(node)
                for node in ast.walk(loop)
                if isinstance(node, ast.AugAssign)
                and isinstance(node.target, ast.Subscript)
                # an element that stays the same in the loop
                and not moves & {each.id for each in ast.walk(node.target) if isinstance(each, ast.Name)}
            ]
    return found


KERNEL_FILES = [
    path
    for path in Path(fc.__file__).parent.rglob("*.py")
    if "sum_kernel" in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: path.stem)
def test_no_sum_depends_on_the_places_of_arrays(path):
    """A sum in an element of an array is vectorised, in another order, only where the arrays lie apart."""
    assert sums_in_arrays(path.read_text(encoding="utf-8")) == []


def test_a_sum_in_an_array_is_found():
    source = "@sum_kernel\ndef f(x, out):\n    for i in range(3):\n        for j in range(5):\n"
    assert sums_in_arrays(source + "            out[i] += x[j]") == ["out[i] += x[j]"]
    assert sums_in_arrays(source + "            out[j] += x[j]") == []
