"""Transforms, random streams, threads, scaling fits, and what importing costs."""

import json
import subprocess
import sys

import numpy as np
import pytest
import scipy.fft
from scipy import stats

from fractalcontact.base import fft, rng, scaling, threads

HEAVY = ("numba", "matplotlib", "skimage", "dask", "netCDF4", "xarray", "pandas", "scipy")


@pytest.mark.parametrize("shape", [(4, 6), (5, 7), (3, 8, 9), (1, 3)])
def test_transforms_agree_with_numpy_and_invert(shape):
    plane = np.random.default_rng(1).normal(size=shape)
    modes = fft.rfft2(plane)
    np.testing.assert_allclose(modes, np.fft.rfft2(plane), atol=1e-13)
    np.testing.assert_allclose(fft.irfft2(modes, shape[-2:]), plane, atol=1e-14)
    np.testing.assert_allclose(fft.rfft(plane), np.fft.rfft(plane), atol=1e-13)
    np.testing.assert_allclose(fft.irfft(fft.rfft(plane), shape[-1]), plane, atol=1e-14)


def test_transforms_write_into_a_buffer():
    plane = np.random.default_rng(2).normal(size=(6, 8))
    modes, back = np.empty((6, 5), complex), np.empty((6, 8))
    assert fft.rfft2(plane, out=modes) is modes
    assert fft.irfft2(modes, (6, 8), out=back, overwrite=True) is back
    np.testing.assert_allclose(back, plane, atol=1e-14)


def test_the_library_can_be_chosen(monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_FFT", "scipy")
    assert fft.library() == "scipy"
    plane = np.random.default_rng(3).normal(size=(5, 6))
    np.testing.assert_array_equal(fft.rfft2(plane), scipy.fft.rfft2(plane))


def test_wavenumbers_are_radians_per_metre():
    np.testing.assert_allclose(fft.wavenumbers(4, 0.5), 2 * np.pi * np.fft.fftfreq(4, 0.5))
    np.testing.assert_allclose(fft.wavenumbers(5, 0.5, real=True), 2 * np.pi * np.fft.rfftfreq(5, 0.5))


def test_threads_are_limited_inside_the_block_only(monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "3")
    assert threads.thread_count() == 3
    with threads.limit(1):
        assert threads.thread_count() == 1
    assert threads.thread_count() == 3


def drawn_from(stream):
    stream.random(7)
    return stream


def with_children(stream):
    stream.spawn(3)
    return stream


STREAMS = {
    "a whole number": lambda: 7,
    "several numbers": lambda: [1, 2, 2**40],
    "entropy of the machine": lambda: None,
    "a child": lambda: np.random.SeedSequence(12345, spawn_key=(7,)),
    "one drawn from": lambda: drawn_from(np.random.default_rng(3)),
    "half a word left": lambda: drawn_from(np.random.Generator(np.random.SFC64(5))),
    "one with children": lambda: with_children(np.random.default_rng(3)),
    "both": lambda: drawn_from(with_children(np.random.default_rng(3))),
    "another kind": lambda: np.random.Generator(np.random.Philox(4)),
    "an old kind, drawn from": lambda: drawn_from(np.random.Generator(np.random.MT19937(4))),
}


@pytest.mark.parametrize("name", STREAMS)
def test_a_stream_can_be_made_again_from_its_record(name):
    stream = rng.generator(STREAMS[name]())
    stream.integers(0, 5, dtype=np.uint8) if name == "half a word left" else None
    record = json.loads(json.dumps(rng.record(stream)))
    again = rng.generator(record)
    np.testing.assert_array_equal(again.random(5), stream.random(5))
    np.testing.assert_array_equal(again.spawn(2)[1].standard_normal(4), stream.spawn(2)[1].standard_normal(4))


def test_what_is_no_stream_is_refused():
    for wrong in (
        "x",
        -1,
        {"bit_generator": "None"},
        {"bit_generator": "PCG64", "entropy": "x", "spawn_key": []},
    ):
        with pytest.raises(ValueError, match="rng: expected"):
            rng.generator(wrong)


def test_a_line_is_fitted_as_scipy_fits_it():
    stream = np.random.default_rng(4)
    scale = np.geomspace(1, 100, 12)
    value = 3 * scale**0.7 * np.exp(0.05 * stream.normal(size=12))
    reference = stats.linregress(np.log(scale), np.log(value))
    line = scaling.fit_line(scale, value)
    np.testing.assert_allclose(
        [line.slope, line.intercept, line.standard_error],
        [reference.slope, reference.intercept, reference.stderr],
    )
    heavy = scaling.fit_line(scale, value, weights=np.where(scale < 10, 1.0, 0.0))
    np.testing.assert_allclose(heavy.slope, stats.linregress(np.log(scale[:6]), np.log(value[:6])).slope)


def test_a_power_law_has_one_local_slope():
    scale = np.geomspace(1e-6, 1e-2, 9)
    np.testing.assert_allclose(
        scaling.local_slope(scale, np.stack([scale**1.5, scale**-2])), [[1.5] * 9, [-2] * 9]
    )
    assert np.isnan(scaling.fit_line(scale[:1], scale[:1]).slope)


@pytest.mark.parametrize("powers", [(-20, 0), (13, -7), (-300, 200)])
def test_no_unit_changes_a_bit_of_a_slope(powers):
    stream = np.random.default_rng(6)
    scale, value = np.sort(stream.random(9)), stream.random((3, 9))
    theirs = [np.ldexp(part, power) for part, power in zip((scale, value), powers, strict=True)]
    np.testing.assert_array_equal(scaling.local_slope(scale, value), scaling.local_slope(*theirs))
    ours, other = scaling.fit_line(scale, value[0]), scaling.fit_line(theirs[0], theirs[1][0])
    assert (ours.slope, ours.standard_error) == (other.slope, other.standard_error)
    assert other.intercept == pytest.approx(
        ours.intercept + (powers[1] - other.slope * powers[0]) * np.log(2.0), rel=1e-9
    )


def test_importing_the_package_loads_nothing_heavy():
    code = f"import sys, fractalcontact; print([m for m in {HEAVY!r} if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_no_submodule_hides_a_public_function():
    import importlib
    import pkgutil

    import fractalcontact

    for room in ("surfaces", "dimensions", "contact", "domains", "joints", "scenes", "accuracy", "plotting"):
        package = importlib.import_module(f"fractalcontact.{room}")
        files = {module.name for module in pkgutil.iter_modules(package.__path__)}
        assert not files & set(package.__all__), room
        for name in package.__all__:
            assert not isinstance(getattr(package, name), type(fractalcontact)), f"{room}.{name}"
