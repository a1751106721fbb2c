"""Run time of the generators relative to their transforms and random numbers, one thread, scipy."""

import json
import statistics
import time

import numpy as np
import pytest
import scipy.fft

import fractalcontact as fc
from fractalcontact.base import resources

pytestmark = pytest.mark.benchmark


def seconds(function):
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def ratio(make, parts, rounds=9):
    """Return the median over rounds of the time of `make` over the sum of the times of `parts`."""
    make()
    return statistics.median(seconds(make) / sum(seconds(part) for part in parts) for _ in range(rounds))


@pytest.fixture(autouse=True)
def one_scipy_thread(monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_FFT", "scipy")
    with resources.limit(1):
        yield


def test_spectral_run_time():
    rng = np.random.default_rng(0)
    modes = scipy.fft.rfft2(rng.standard_normal((2048, 2048)))
    parts = (lambda: scipy.fft.irfft2(modes, workers=1), lambda: rng.standard_normal((2048, 2048)))
    assert (
        ratio(lambda: fc.surfaces.spectral((2048, 2048), 1e-6, hurst=0.8, rms_height=1e-6, rng=1), parts)
        <= 1.3
    )


@pytest.mark.parametrize("hurst", [0.5, 0.9])
def test_fbm_run_time(hurst):
    def make():
        return fc.surfaces.fbm((1024, 1024), 1e-6, hurst=hurst, rms_increment=1e-6, rng=1)

    torus = json.loads(make().attrs["provenance"])["torus"]
    rng = np.random.default_rng(0)
    plane = rng.standard_normal(torus)
    modes = scipy.fft.rfft2(plane)
    parts = (
        lambda: scipy.fft.rfft2(plane, workers=1),
        lambda: scipy.fft.irfft2(modes, s=torus, workers=1),
        lambda: rng.standard_normal(torus),
    )
    assert ratio(make, parts, rounds=5) <= 1.3
