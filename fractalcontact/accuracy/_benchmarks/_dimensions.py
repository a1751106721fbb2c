"""Estimators of the Hurst exponent on exact fractional Brownian surfaces, clean and with white noise."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import dimensions, surfaces
from fractalcontact.accuracy._benchmarks import HURST, Array, Benchmark, Method

Problem = tuple[xr.DataArray, dict[str, Any]]  # an ensemble of surfaces, options of the estimator

MEMBERS = 12  # the rms error is then known to a fifth, 1/sqrt(2 n)
# an octave each
SIZES = (32, 64, 128, 256, 512)
WINDOW_SIZE = 256  # of the surfaces of `windows`: longest lags of 8 to 128 spacings, an octave each


def benchmarks() -> tuple[Benchmark, ...]:
    """Return the benchmarks of the estimators."""
    error = f"root mean square error of the Hurst exponent over {MEMBERS} surfaces of H = {HURST}"
    exact = "exact fractional Brownian surfaces"
    default = next(iter(dimensions.methods()))
    clean = tuple(_method(name, name, SIZES) for name in dimensions.methods())
    noise = 0.1  # variance over half the variogram at lag 1
    noisy = (
        _method(f"{default}, noise modelled", default, SIZES[:4], noise),
        _method(f"{default}, noise ignored", default, SIZES[:4], noise, {"noise": 0.0}),
    )
    directional = Method("by direction", SIZES[:4], _surfaces, _first_directions, _directional_errors)
    windows = Method(
        "variogram, lags up to 1/parameter of the edge",
        (32, 16, 8, 4, 2),  # the longest lag from 8 spacings to half the edge
        _window,
        partial(_first_exponent, "variogram"),
        lambda _, parameter: _exponents("variogram", *_window(parameter)) - HURST,
        "points along an edge over the longest lag",
    )
    return (
        Benchmark("Hurst exponent", error, exact, clean, equal_parameters=True),
        Benchmark(
            "Hurst exponent under noise",
            error,
            f"exact surfaces and white noise of {noise:.0%} of half the variogram at lag 1",
            noisy,
            equal_parameters=True,
        ),
        Benchmark(
            "Hurst exponent by direction",
            f"{error}, eight directions of each",
            f"{exact}, which have one exponent in all directions",
            (directional,),
            equal_parameters=True,
        ),
        Benchmark("window of scales", error, f"{exact}, {WINDOW_SIZE} x {WINDOW_SIZE}", (windows,)),
    )


def _method(
    name: str,
    estimator: str,
    sizes: tuple[int, ...],
    noise: float = 0.0,
    options: dict[str, Any] | None = None,
) -> Method:
    def prepare(n: float) -> Problem:
        return _surfaces(n, noise), options or {}

    def errors(_: float, n: float) -> Array:
        return _exponents(estimator, *prepare(n)) - HURST

    return Method(name, sizes, prepare, partial(_first_exponent, estimator), errors)


@lru_cache(maxsize=8)  # 35 MB at most, as every size is kept once
def _surfaces(n: float, noise: float = 0.0) -> xr.DataArray:
    size = int(n)
    ensemble = surfaces.fbm((size, size), 1.0, hurst=HURST, rms_increment=1.0, members=MEMBERS, rng=size)
    if noise:
        white = np.random.default_rng(size).normal(size=ensemble.shape)
        ensemble = ensemble + np.sqrt(noise / 2.0) * white
        ensemble = ensemble.assign_attrs(units="m").rename("height")
    return ensemble


def _window(parameter: float) -> Problem:
    return _surfaces(WINDOW_SIZE), {"scales": (1.0, WINDOW_SIZE / parameter)}


def _first_exponent(estimator: str, problem: Problem) -> float:
    """Return the exponent of the first surface, which is timed; the errors are those of all surfaces."""
    ensemble, options = problem
    return float(_exponents(estimator, ensemble.isel(member=0), options)[0])


def _exponents(estimator: str, ensemble: xr.DataArray, options: dict[str, Any]) -> Array:
    return dimensions.estimate(ensemble, [estimator], **options)["hurst"].values.ravel()


def _first_directions(ensemble: xr.DataArray) -> Array:
    """Return the exponents by direction of the first surface, which is timed."""
    return dimensions.directions(ensemble.isel(member=0))["hurst"].values


def _directional_errors(_: Array, n: float) -> Array:
    """Return errors with one row for each surface."""
    return dimensions.directions(_surfaces(n))["hurst"].transpose("member", ...).values - HURST
