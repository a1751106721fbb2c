"""Transforms give the same bits on any number of threads, whatever the environment says of them."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest

from fractalcontact.base import fft, threads

needs_ducc0 = pytest.mark.skipif(importlib.util.find_spec("ducc0") is None, reason="needs ducc0")

DIGESTS = """
import hashlib, itertools
import numpy as np
from fractalcontact.base import fft

random = np.random.default_rng(7)
SHAPES = (3, 5), (1, 4), (401, 367), (33, 4100), (4100, 33), (2, 360, 370), (70_000,)
for shape, kind in itertools.product(SHAPES, (np.float32, np.float64)):
    plane = random.standard_normal(shape).astype(kind)
    axes = tuple(axis for axis, n in enumerate(shape) if n > 1)
    made = [fft.rfft(plane), fft.irfft(fft.rfft(plane), shape[-1]), fft.ifft(plane + 1j * plane)]
    made += [fft.dct(plane, 1, axes), fft.dct(plane, 2, axes), fft.dct(plane, 3, axes[:1])]
    made += [fft.dst(plane, 1, axes)]
    if len(shape) > 1:
        made += [fft.rfft2(plane), fft.irfft2(fft.rfft2(plane), shape[-2:])]
        made += [fft.irfft2(fft.rfft2(plane), shape[-2:], overwrite=True)]
        into = fft.rfft2(plane, out=np.empty_like(made[-3]))
        made += [into, fft.irfft2(into, shape[-2:], np.empty_like(plane), overwrite=True)]
    if len(shape) == 2:
        padded = tuple(fft.fast_length(2 * n - 1) for n in shape)
        modes = fft.rfft2_padded(plane, padded)
        made += [modes.copy(), fft.irfft2_cropped(modes, padded, shape)]
    assert {one.real.dtype for one in made} == {np.dtype(kind)}
    print(shape, kind.__name__, *(hashlib.md5(one.tobytes()).hexdigest()[:8] for one in made))
"""


@pytest.mark.parametrize("library", [pytest.param("ducc0", marks=needs_ducc0), "scipy"])
def test_no_environment_changes_a_bit(library):
    """The same in processes of their own, where the library's own pool is as large as it is told."""
    told = {name: word for name, word in os.environ.items() if "THREADS" not in name} | {
        "FRACTALCONTACT_FFT": library
    }
    limits = (
        {"FRACTALCONTACT_THREADS": "1"},
        {"FRACTALCONTACT_THREADS": "2"},
        {"FRACTALCONTACT_THREADS": "3", "OMP_NUM_THREADS": "2"},
        {"FRACTALCONTACT_THREADS": "7", "OMP_NUM_THREADS": "1"},
    )
    words = [sys.executable, "-c", DIGESTS]
    runs = [subprocess.Popen(words, env=told | limit, stdout=subprocess.PIPE, text=True) for limit in limits]
    first, *others = [run.communicate()[0].splitlines() for run in runs]
    assert len(first) == 14
    for other in others:
        assert other == first


@needs_ducc0
@pytest.mark.parametrize("shape", [(401, 367), (258, 1031)])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_plane_cut_for_threads_is_the_plane_transformed_whole(shape, kind, monkeypatch):
    """Where ducc0 took other groups of lines on some processor, this tells it apart from our own doing."""
    monkeypatch.setenv("FRACTALCONTACT_FFT", "ducc0")
    plane = np.random.default_rng(3).standard_normal(shape).astype(kind)
    with threads.limit(1):
        whole = fft.rfft2(plane)
    for count in (2, 5, 16, 60):
        with threads.limit(count):
            np.testing.assert_array_equal(fft.rfft2(plane), whole)
    np.testing.assert_allclose(whole, np.fft.rfft2(plane), rtol=0, atol=1e4 * np.finfo(kind).eps)


def test_a_band_that_fails_is_told_once_all_have_ended():
    ended = []

    def work(start, stop):
        if start > 0:
            raise ZeroDivisionError(f"{start} to {stop}")
        ended.append(stop)

    with threads.limit(2), pytest.raises(ZeroDivisionError, match="2 to 4"):
        threads.in_bands(work, 4, 4 * threads.SHARE)
    assert ended == [2]
