"""Generators of surfaces against the increments, or the power spectrum, that their surfaces should have."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import surfaces
from fractalcontact.accuracy._benchmarks import HURST, Array, Benchmark, Method

Generator = Callable[..., xr.DataArray]

ROLLOFF, SHORT = 0.5, 4.0  # of the extent; in spacings: two octaves between them at n = 32, seven at 1024


def benchmarks() -> tuple[Benchmark, ...]:
    """Return the benchmarks of the generators."""
    brownian: dict[str, Generator] = {
        "fbm": partial(surfaces.fbm, rms_increment=1.0),
        "midpoint": partial(surfaces.midpoint, rms_increment=1.0),
        "midpoint, with additions": partial(surfaces.midpoint, rms_increment=1.0, additions=True),
        "spectral": partial(surfaces.spectral, rms_height=1.0),
        "weierstrass": partial(surfaces.weierstrass, rms_height=1.0),
    }
    cutoffs: dict[str, Generator] = {
        f"spectral with cut-offs, {word} normalised": partial(_with_cutoffs, normalise=key)
        for word, key in (("each", "realisation"), ("mean", "expectation"))
    }
    return (
        Benchmark(
            "fractional Brownian surface",
            "largest relative error of the mean square increments at lags 1 to n/8, equal at lag 1",
            f"lag^(2 H), H = {HURST}; a finite ensemble of exact surfaces has some 5 %",
            tuple(_method(name, make, _scaled_increments) for name, make in brownian.items()),
            True,
            _largest_deviation_from_first,
        ),
        Benchmark(
            "power spectrum with cut-offs",
            "largest relative error of the mean power in octaves between the cut-offs",
            "q^(-2 - 2 H) below the roll-off; a finite ensemble of exact surfaces has some 5 %",
            tuple(_method(name, make, _scaled_powers) for name, make in cutoffs.items()),
            True,
            _largest_deviation_from_mean,
        ),
    )


def _method(name: str, make: Generator, measure: Callable[[Array], Array]) -> Method:
    """Return a method whose replicates are what `measure` finds on each surface of an ensemble."""

    def solve(n: int) -> xr.DataArray:
        return make((n, n), 1.0, hurst=HURST, rng=0)

    def measured_ensemble(_: Any, parameter: float) -> Array:
        n = int(parameter)
        # the error is that over 2^18 points, or a hundred surfaces; 2^22 points are generated at a time
        count, batch = max(100, (1 << 18) // n**2), max(1, (1 << 22) // n**2)
        rng = np.random.default_rng(1)
        replicates: list[Array] = []
        while len(replicates) < count:
            members = min(batch, count - len(replicates))
            ensemble = make((n, n), 1.0, hurst=HURST, members=members, rng=rng)
            replicates += [measure(heights) for heights in ensemble.values]
        return np.array(replicates)

    return Method(name, (32, 64, 128, 256, 512, 1024), int, solve, measured_ensemble)


def _with_cutoffs(shape: tuple[int, int], spacing: float, **options: Any) -> xr.DataArray:
    band: dict[str, Any] = {"rolloff": ROLLOFF * shape[0] * spacing, "short_cutoff": SHORT * spacing}
    return surfaces.spectral(shape, spacing, rms_height=1.0, **band, **options)


def _scaled_increments(heights: Array) -> Array:
    """Return mean square increments over lag^(2 H), at lags from 1 to n/8."""
    n = len(heights)
    # six lags: half an octave apart at n = 64, one at 512
    lags = np.unique(np.geomspace(1, max(2, n // 8), 6).astype(int))
    squares = [
        np.mean((heights[lag:] - heights[:-lag]) ** 2) + np.mean((heights[:, lag:] - heights[:, :-lag]) ** 2)
        for lag in lags
    ]
    return np.asarray(np.array(squares) / lags ** (2.0 * HURST))


def _largest_deviation_from_first(replicates: Array, axis: int) -> Array:
    mean = replicates.mean(axis=axis)
    return np.asarray(np.abs(mean / mean[..., :1] - 1.0).max(axis=-1))


def _scaled_powers(heights: Array) -> Array:
    """Return the mean of power times q^(2 + 2 H) in octaves between the cut-offs."""
    n = len(heights)
    wave = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n))
    scaled = np.abs(np.fft.rfft2(heights)) ** 2 * np.where(wave > 0, wave, 1.0) ** (2 + 2 * HURST)
    octaves = max(2, int(np.log2(ROLLOFF * n / SHORT)))
    edges = np.geomspace(1.0 / (ROLLOFF * n), 1.0 / SHORT, octaves + 1)
    return np.array([np.mean(scaled[(wave >= low) & (wave < high)]) for low, high in pairwise(edges)])


def _largest_deviation_from_mean(replicates: Array, axis: int) -> Array:
    mean = replicates.mean(axis=axis)
    return np.asarray(np.abs(mean / mean.mean(axis=-1, keepdims=True) - 1.0).max(axis=-1))
