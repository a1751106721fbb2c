"""Run times on one thread, compared with transforms in the same process."""

import time

import numpy as np
import pytest
import scipy.fft

import fractalcontact as fc
from fractalcontact.base import resources

pytestmark = pytest.mark.benchmark


def fastest(function, rounds=7):
    function()
    times = []
    for _ in range(rounds):
        started = time.perf_counter()
        function()
        times.append(time.perf_counter() - started)
    return min(times)


@pytest.fixture(scope="module")
def surface():
    return fc.surfaces.fbm((1024, 1024), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)


def test_closed_form_within_one_transform(surface):
    """A real transform of the surface takes about 10 ms on one core of 2020."""
    with resources.limit(1):
        closed = fastest(lambda: fc.dimensions.estimate(surface, "increments"))
        transform = fastest(lambda: scipy.fft.rfft2(surface.values, workers=1))
    assert closed < 1.5 * transform
    assert closed < 0.03


def test_likelihood_within_100_transforms(surface):
    with resources.limit(1):
        complete = fastest(lambda: fc.dimensions.estimate(surface), rounds=3)
        transform = fastest(lambda: scipy.fft.rfft2(surface.values, workers=1))
    assert complete < 100 * transform


def test_closed_form_is_linear_in_points(surface):
    with resources.limit(1):
        small = fastest(lambda: fc.dimensions.estimate(surface[:512, :512], "increments"))
        large = fastest(lambda: fc.dimensions.estimate(surface, "increments"))
    assert large < 8 * small
    assert np.isfinite(large)


def test_block_gap_within_twice_the_complete_surface(surface):
    complete = surface[:512, :512]
    gapped = complete.copy(deep=True)
    gapped[128:192, 170:234] = np.nan
    with resources.limit(1):
        for part in (complete, gapped):
            fc.dimensions.estimate(part)
        pairs = [
            [fastest(lambda part=part: fc.dimensions.estimate(part), rounds=1) for part in (complete, gapped)]
            for _ in range(5)
        ]
    whole, with_gap = np.median(pairs, axis=0)
    assert with_gap < 2.0 * whole
