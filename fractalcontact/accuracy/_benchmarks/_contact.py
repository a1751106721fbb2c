"""Solvers against Hertz (sphere), Westergaard (wave) and, on rough surfaces, a solution to rounding."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import contact, surfaces
from fractalcontact.accuracy._benchmarks import (
    EXACT,
    TOLERANCE,
    TOLERANCES,
    Array,
    Benchmark,
    Method,
    largest_error,
    value_of,
)

MODULUS, RADIUS, APPROACH = 1e9, 1.0, 1e-4  # Pa, m, m, of the sphere: relative errors are the same for all
# half an octave each; elimination, whose matrices are dense, takes the first six
SIZES = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)


def benchmarks() -> tuple[Benchmark, ...]:
    """Return the benchmarks of the contact solvers."""
    return (_sphere_benchmark(), _wave_benchmark(), *_rough_benchmarks())


def _sphere_benchmark() -> Benchmark:
    solvers: dict[str, tuple[tuple[int, ...], dict[str, Any]]] = {
        "elimination, disc": (SIZES[:6], {"method": "elimination", "influence": "disc"}),
        "elimination, square": (SIZES[:6], {"method": "elimination", "influence": "square"}),
        "fast, disc": (SIZES, {"influence": "disc"}),
        "fast, inscribed disc": (SIZES, {"influence": "disc", "disc_radius": "inscribed"}),
        "fast, disc of equal area": (SIZES, {"influence": "disc", "disc_radius": "equal_area"}),
        "fast, square": (SIZES, {"influence": "square"}),
    }
    pressed: dict[str, Any] = {"contact_modulus": MODULUS, "closure": APPROACH, "keep": ()}
    error = largest_error(4.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * APPROACH**1.5, relative=True)
    methods = tuple(
        Method(name, sizes, _sphere, value_of(contact.press, "normal_force", **pressed, **options), error)
        for name, (sizes, options) in solvers.items()
    )
    return Benchmark("sphere", "relative error of the force", "Hertz: 4/3 E* sqrt(R) d^1.5", methods)


def _sphere(n: float) -> xr.DataArray:
    contact_radius = np.sqrt(RADIUS * APPROACH)
    x = (np.arange(int(n)) + 0.5) / n * 4.0 * contact_radius - 2.0 * contact_radius
    # the approach is measured from the highest node, so the apex must be a node
    x = x - x[int(n) // 2]
    return surfaces.from_array(-(x**2 + x[:, None] ** 2) / (2.0 * RADIUS), 4.0 * contact_radius / n)


def _wave_benchmark() -> Benchmark:
    angle = np.arcsin(np.sqrt(0.5))
    pressure = 0.5 * np.pi * MODULUS  # half of that of full contact, for amplitude and wavelength 1
    solve = value_of(contact.press, "mean_gap", contact_modulus=MODULUS, nominal_pressure=pressure, keep=())
    exact = 2.0 * (0.5 * np.cos(angle) ** 2 + np.sin(angle) ** 2 * np.log(np.sin(angle)))
    return Benchmark(
        "wave",
        "error of the mean gap over the amplitude",
        "Westergaard: the mean gap of a sinusoidal surface",
        (Method("fast, spectral", SIZES, _wave, solve, largest_error(exact)),),
    )


def _wave(n: float) -> xr.DataArray:
    x = np.arange(int(n)) / n
    heights = np.broadcast_to(np.cos(2.0 * np.pi * x), (int(n), int(n)))
    return surfaces.from_array(heights, 1.0 / n, periodic=True)


def _rough_benchmarks() -> tuple[Benchmark, ...]:
    free, periodic = {"influence": "disc", "boundary": "free"}, {"boundary": "periodic"}
    # of the surface of `_rough` .06 to .38 is then in contact, and .003 (periodic) and .014 (free) yields
    yields, closed = {"hardness": 1.5e8}, {"closure": 1e-5}
    solvers: dict[str, dict[str, Any]] = {
        "free body": free,
        "periodic body": periodic,
        "free body with a hardness": free | yields,
        "free body, closure imposed": free | closed,
        "periodic body, closure imposed": periodic | closed,
        "periodic body with a hardness": periodic | yields,
    }
    return tuple(
        Benchmark(
            f"rough, {name}",
            "rms error of the pressures over their rms",
            f"the same surface solved to a tolerance of {EXACT:g}",
            (
                Method(
                    f"fast, {name}",
                    TOLERANCES,
                    lambda tolerance: (float(tolerance), _rough()),
                    partial(_press_rough, options),
                    _pressure_error(options),
                    TOLERANCE,
                ),
            ),
        )
        for name, options in solvers.items()
    )


@lru_cache(maxsize=1)
def _rough() -> xr.DataArray:
    # waves of half the edge to four spacings
    return surfaces.spectral(
        (128, 128), 1e-5, hurst=0.8, rms_slope=0.1, rolloff=64e-5, short_cutoff=4e-5, rng=3
    )


def _press_rough(options: dict[str, Any], problem: tuple[float, xr.DataArray]) -> Array:
    tolerance, surface = problem
    load: dict[str, Any] = {} if "closure" in options else {"nominal_pressure": 2e7}
    pressed = contact.press(
        surface, contact_modulus=MODULUS, tolerance=tolerance, keep=("pressure",), **load | options
    )
    return pressed["pressure"].values[0]  # type: ignore[no-any-return]


def _pressure_error(options: dict[str, Any]) -> Callable[[Any, float], float]:
    @lru_cache(maxsize=1)
    def exact() -> Array:
        return _press_rough(options, (EXACT, _rough()))

    def error(pressure: Array, _: float) -> float:
        return float(np.sqrt(np.mean((pressure - exact()) ** 2) / np.mean(exact() ** 2)))

    return error
