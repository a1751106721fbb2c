"""Transforms: agreement with numpy, and the same bits for any number of threads."""

import importlib.util
import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.fft

from fractalcontact.base import fft, resources

needs_ducc0 = pytest.mark.skipif(importlib.util.find_spec("ducc0") is None, reason="needs ducc0")

DIGESTS = """
import hashlib, itertools, os, sys
import numpy as np
from fractalcontact.base import fft

random = np.random.default_rng(7)
SHAPES = (3, 5), (1, 4), (263, 257), (25, 2700), (2700, 25), (2, 180, 190), (70_000,)
for library, shape, dtype in itertools.product(sys.argv[1:], SHAPES, (np.float32, np.float64)):
    os.environ["FRACTALCONTACT_FFT"] = library
    assert fft.library() == library
    plane = random.standard_normal(shape).astype(dtype)
    axes = tuple(axis for axis, n in enumerate(shape) if n > 1)
    results = [fft.rfft(plane), fft.irfft(fft.rfft(plane), shape[-1]), fft.ifft(plane + 1j * plane)]
    results += [fft.dct(plane, 1, axes), fft.dct(plane, 2, axes), fft.dct(plane, 3, axes[:1])]
    if len(shape) > 1:
        results += [fft.rfft2(plane), fft.irfft2(fft.rfft2(plane), shape[-2:])]
        results += [fft.irfft2(fft.rfft2(plane), shape[-2:], overwrite=True)]
        into = fft.rfft2(plane, out=np.empty_like(results[-3]))
        results += [into, fft.irfft2(into, shape[-2:], np.empty_like(plane), overwrite=True)]
    if len(shape) == 2:
        padded = tuple(fft.fast_length(2 * n - 1) for n in shape)
        modes = fft.rfft2_padded(plane, padded)
        results += [modes.copy(), fft.irfft2_cropped(modes, padded, shape)]
    assert {array.real.dtype for array in results} == {np.dtype(dtype)}
    digests = [hashlib.md5(array.tobytes()).hexdigest()[:8] for array in results]
    print(library, shape, dtype.__name__, *digests)
"""


def test_thread_settings_change_no_bit():
    """In separate processes, because the thread pool of a library is created once."""
    environment = {name: word for name, word in os.environ.items() if "THREADS" not in name}
    libraries = ["scipy", *(["ducc0"] if importlib.util.find_spec("ducc0") else [])]
    limits = (
        {"FRACTALCONTACT_THREADS": "1", "OMP_NUM_THREADS": "1"},
        {"FRACTALCONTACT_THREADS": "7", "OMP_NUM_THREADS": "2"},
    )
    words = [sys.executable, "-c", DIGESTS, *libraries]
    runs = [
        subprocess.Popen(words, env=environment | limit, stdout=subprocess.PIPE, text=True)
        for limit in limits
    ]
    first, *others = [run.communicate()[0].splitlines() for run in runs]
    assert len(first) == 14 * len(libraries)
    for other in others:
        assert other == first


@pytest.mark.parametrize("library", [pytest.param("ducc0", marks=needs_ducc0), "scipy"])
@pytest.mark.parametrize("shape", [(401, 367), (258, 1031)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_split_plane_equals_whole_plane(library, shape, dtype, monkeypatch):
    """It fails where the library groups lines differently on some processor."""
    monkeypatch.setenv("FRACTALCONTACT_FFT", library)
    plane = np.random.default_rng(3).standard_normal(shape).astype(dtype)
    with resources.limit(1):
        reference = fft.rfft2(plane)
    for count in (2, 5, 16, 60):
        with resources.limit(count):
            np.testing.assert_array_equal(fft.rfft2(plane), reference)
    np.testing.assert_allclose(reference, np.fft.rfft2(plane), rtol=0, atol=1e4 * np.finfo(dtype).eps)


@pytest.mark.parametrize("shape", [(4, 6), (5, 7), (3, 8, 9), (1, 3)])
def test_transforms_agree_with_numpy_and_invert(shape):
    plane = np.random.default_rng(1).normal(size=shape)
    modes = fft.rfft2(plane)
    np.testing.assert_allclose(modes, np.fft.rfft2(plane), atol=1e-13)
    np.testing.assert_allclose(fft.irfft2(modes, shape[-2:]), plane, atol=1e-14)
    np.testing.assert_allclose(fft.rfft(plane), np.fft.rfft(plane), atol=1e-13)
    np.testing.assert_allclose(fft.irfft(fft.rfft(plane), shape[-1]), plane, atol=1e-14)


def test_transforms_write_into_an_array():
    plane = np.random.default_rng(2).normal(size=(6, 8))
    modes, back = np.empty((6, 5), complex), np.empty((6, 8))
    assert fft.rfft2(plane, out=modes) is modes
    assert fft.irfft2(modes, (6, 8), out=back, overwrite=True) is back
    np.testing.assert_allclose(back, plane, atol=1e-14)


def test_library_can_be_selected(monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_FFT", "scipy")
    assert fft.library() == "scipy"
    plane = np.random.default_rng(3).normal(size=(5, 6))
    np.testing.assert_array_equal(fft.rfft2(plane), scipy.fft.rfft2(plane))


def test_wavenumbers_are_radians_per_metre():
    np.testing.assert_allclose(fft.wavenumbers(4, 0.5), 2 * np.pi * np.fft.fftfreq(4, 0.5))
    np.testing.assert_allclose(fft.wavenumbers(5, 0.5, real=True), 2 * np.pi * np.fft.rfftfreq(5, 0.5))


@pytest.mark.parametrize("library", [pytest.param("ducc0", marks=needs_ducc0), "scipy"])
@pytest.mark.parametrize(
    ("shape", "padded"),
    [
        ((5, 8), (5, 8)),
        ((6, 7), (12, 15)),
        ((300, 400), (300, 400)),
        ((70, 1024), (70, 1024)),  # rows of single precision 4096 bytes apart
        ((130, 500), (260, 1024)),
    ],
)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_filter_multiplies_every_mode(monkeypatch, library, shape, padded, dtype):
    monkeypatch.setenv("FRACTALCONTACT_FFT", library)
    plane = np.random.default_rng(3).standard_normal(shape).astype(dtype)
    factors = np.random.default_rng(4).random((padded[0], padded[1] // 2 + 1)).astype(dtype)

    expected = scipy.fft.irfft2(scipy.fft.rfft2(plane.astype(float), s=padded) * factors, s=padded)
    expected = expected[: shape[0], : shape[1]]
    close = {"rtol": 0, "atol": 100 * np.finfo(dtype).eps * np.abs(expected).max()}
    first = fft.irfft2_cropped(fft.rfft2_padded(plane, padded) * factors, padded, shape)
    np.testing.assert_allclose(first, expected, **close)
