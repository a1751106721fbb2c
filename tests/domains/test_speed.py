"""Run times relative to one real transform of the same plane, in one process on one thread."""

import time

import numpy as np
import pytest
import scipy.fft
from domains.sets import as_mask, random_null

import fractalcontact as fc
from fractalcontact.base.resources import limit

pytestmark = pytest.mark.benchmark
N = 2048


def best(call, times=5):
    call()
    seconds = []
    for _ in range(times):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


@pytest.fixture(scope="module")
def transform():
    plane = np.random.default_rng(1).standard_normal((N, N))
    return best(lambda: scipy.fft.rfft2(plane, workers=1))


@pytest.fixture(scope="module")
def mask():
    return as_mask(random_null(N, N * N // 10, np.random.default_rng(2)), periodic=(True, True))


def test_dyadic_box_counts(transform, mask):
    sizes, small = 2 ** np.arange(12), as_mask(np.eye(8, dtype=bool), periodic=(True, True))
    with limit(1):
        fixed_cost = best(lambda: fc.domains.box_counts(small, sizes[:4], cover="aligned"))
        assert (
            best(lambda: fc.domains.box_counts(mask, sizes, cover="aligned")) <= fixed_cost + 0.03 * transform
        )


def test_all_box_sizes_averaged_over_all_offsets(transform, mask):
    with limit(1):
        assert best(lambda: fc.domains.box_counts(mask, periodic=False), 3) <= 6 * transform


def test_lacunarity_at_eleven_sizes(transform, mask):
    with limit(1):
        assert best(lambda: fc.domains.lacunarity(mask, 2 ** np.arange(11)), 3) <= 4 * transform


def test_lacunarity_at_all_sizes_of_a_periodic_plane(transform, mask, monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_FFT", "scipy")
    with limit(1):
        assert best(lambda: fc.domains.lacunarity(mask, np.arange(1, 1025)), 2) <= 30 * transform
