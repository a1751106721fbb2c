"""Number of threads: environment variables, limits, and the bands of a loop."""

import contextvars
import os
import threading

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import resources


@pytest.fixture
def eight_processors(monkeypatch):
    """Pretend that 8 processors are available and no variable is set; return `monkeypatch`."""
    for name in ("FRACTALCONTACT_THREADS", *resources.LIMITS):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)
    return monkeypatch


def test_limit_ends_with_its_block(monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "3")
    assert resources.thread_count() == 3
    with resources.limit(1):
        assert resources.thread_count() == 1
    assert resources.thread_count() == 3


@pytest.mark.parametrize(
    ("environment", "count"),
    [
        ({}, 8),
        ({"OMP_NUM_THREADS": "3"}, 3),
        ({"NUMBA_NUM_THREADS": "2"}, 2),
        ({"OMP_NUM_THREADS": "5", "NUMBA_NUM_THREADS": "4"}, 4),
        ({"OMP_NUM_THREADS": "6,2"}, 6),
        ({"OMP_NUM_THREADS": "100"}, 8),
        ({"OMP_NUM_THREADS": "0"}, 8),
        ({"OMP_NUM_THREADS": "many"}, 8),
        ({"OMP_NUM_THREADS": "1", "FRACTALCONTACT_THREADS": "5"}, 5),
        ({"FRACTALCONTACT_THREADS": ""}, 8),
    ],
)
def test_environment_sets_the_thread_count(eight_processors, environment, count):
    for name, word in environment.items():
        eight_processors.setenv(name, word)
    assert resources.thread_count() == count
    with resources.limit(7):
        assert resources.thread_count() == 7


def test_limits_of_other_libraries_change_no_bit(eight_processors):
    surface = fc.surfaces.spectral((150, 140), 1e-4, hurst=0.7, rms_height=1e-6, rng=1)
    for name in resources.LIMITS:
        eight_processors.setenv(name, "1")
        limited = fc.surfaces.spectral((150, 140), 1e-4, hurst=0.7, rms_height=1e-6, rng=1)
        np.testing.assert_array_equal(limited.values, surface.values)
        eight_processors.delenv(name)


def test_error_of_a_band_is_raised_after_all_bands_ended():
    ended = []

    def work(start, stop):
        if start > 0:
            raise ZeroDivisionError(f"{start} to {stop}")
        ended.append(stop)

    with resources.limit(2), pytest.raises(ZeroDivisionError, match="2 to 4"):
        resources.in_bands(work, 4, 4 * resources.SHARE)
    assert ended == [2]


@pytest.mark.parametrize("available", [0, 3])
def test_bands_run_where_threads_cannot_be_started(monkeypatch, available):
    """On a system that starts only so many threads, which share the work."""
    numbers, starts, start = [], [], threading.Thread.start
    before = threading.active_count()

    def limited(thread):
        starts.append(thread)
        if len(starts) > available:
            raise RuntimeError("can't start new thread")
        start(thread)

    def work(first, last):
        numbers.extend(range(first, last))

    count = 6 + available  # a number of threads that no other test has
    with monkeypatch.context() as patch, resources.limit(count):
        patch.setattr(threading.Thread, "start", limited)
        resources.in_bands(work, 40, 40 * resources.SHARE)
        assert sorted(numbers) == list(range(40))
        assert threading.active_count() == before + available
    numbers.clear()
    with resources.limit(count):
        _call_within(20, resources.in_bands, work, 40, 40 * resources.SHARE)
    assert sorted(numbers) == list(range(40))
    assert threading.active_count() > before


def _call_within(seconds, function, *arguments):
    """Call a function in this context; fail if it does not return."""
    context = contextvars.copy_context()
    thread = threading.Thread(target=context.run, args=(function, *arguments), daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive(), f"no return within {seconds} s"
