"""Times, on one thread, in the same process as what they are compared with."""

import time

import numpy as np
import pytest
import scipy.fft

import fractalcontact as fc
from fractalcontact.base import threads

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
def face():
    return fc.surfaces.fbm((1024, 1024), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)


def test_closed_form_takes_less_than_a_transform(face):
    """A real transform of the face takes about 10 ms on one core of 2020."""
    with threads.limit(1):
        closed = fastest(lambda: fc.dimensions.estimate(face, "increments"))
        transform = fastest(lambda: scipy.fft.rfft2(face.values, workers=1))
    assert closed < 1.5 * transform
    assert closed < 0.03


def test_likelihood_takes_some_tens_of_transforms(face):
    with threads.limit(1):
        whole = fastest(lambda: fc.dimensions.estimate(face), rounds=3)
        transform = fastest(lambda: scipy.fft.rfft2(face.values, workers=1))
    assert whole < 100 * transform


def test_closed_form_is_linear_in_the_points(face):
    with threads.limit(1):
        small = fastest(lambda: fc.dimensions.estimate(face[:512, :512], "increments"))
        large = fastest(lambda: fc.dimensions.estimate(face, "increments"))
    assert large < 8 * small
    assert np.isfinite(large)
