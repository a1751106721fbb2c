"""Flow and rigid dilatancy against closed forms; the closure law against a solution to rounding."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import joints, surfaces
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

RIPPLE = 0.6  # amplitude of the sinusoidal aperture over its mean: its cube varies by a factor of 64
APERTURE = 1e-4  # m: any, the error is relative
SHEAR = 0.13  # of the wavelength: at no size whole cells, so that heights are interpolated
YOUNG = 30e9  # Pa, of concrete: the forces of the closure law are in proportion to it


def benchmarks() -> tuple[Benchmark, ...]:
    """Return the benchmarks of flow, dilatancy and closure."""
    sizes = (8, 16, 32, 64, 128, 256, 512)
    aperture = value_of(joints.transmissivity, "hydraulic_aperture", {"axis": "x"})
    dilatancy = value_of(joints.dilatancy, "rigid_dilatancy", shear=[SHEAR], direction="E")
    wrapped = partial(_corrugated, periodic=True)
    exact = APERTURE * ((1.0 - RIPPLE**2) ** 2.5 / (1.0 + RIPPLE**2 / 2.0)) ** (1.0 / 3.0)
    error = largest_error(exact, relative=True)
    across = Method("transmissivity, across", sizes, _corrugated, aperture, error)
    around = Method("transmissivity, across, periodic", sizes[:5], wrapped, aperture, error)
    error = largest_error(APERTURE, relative=True)
    board = Method("transmissivity, checkerboard", sizes[:5], _checkerboard, aperture, error)
    error = largest_error(2.0 * np.sin(np.pi * SHEAR))
    rigid = Method("rigid dilatancy", sizes[1:], _wave_joint, dilatancy, error)
    error = largest_error(lambda _: _exact_closure(), relative=True)
    closure = Method("closure of the interface", TOLERANCES, _sheared_joint, _closure, error, TOLERANCE)
    return (
        Benchmark(
            "sinusoidal aperture, across",
            "relative error of the hydraulic aperture",
            "(1 - e^2)^(5/2) / (1 + e^2/2) for the cube of the aperture across the crests",
            (across, around),
        ),
        Benchmark(
            "checkerboard",
            "relative error of the hydraulic aperture",
            "sqrt(K1 K2) for the transmissivity, K1/K2 = 10",
            (board,),
        ),
        Benchmark("sliding wave", "error over the amplitude", "2 A |sin(k v / 2)|", (rigid,)),
        Benchmark(
            "closure law",
            "relative error of the closure of the interface, three forces",
            f"the same joint solved to a tolerance of {EXACT:g}",
            (closure,),
        ),
    )


def _gap(values: Any, spacing: float, periodic: bool = False) -> xr.DataArray:
    return surfaces.from_array(values, spacing, periodic=periodic).rename("gap")


def _corrugated(n: float, periodic: bool = False) -> xr.DataArray:
    x = (np.arange(int(n)) + 0.5) / n
    gap = APERTURE * (1.0 + RIPPLE * np.cos(2.0 * np.pi * x))
    return _gap(np.broadcast_to(gap, (int(n), int(n))), 1.0 / n, periodic)


def _checkerboard(n: float) -> xr.DataArray:
    i, j = np.mgrid[0 : 2 * int(n), 0 : 2 * int(n)] // int(n)
    cubes = np.where((i + j) % 2 == 0, 10.0**0.5, 10.0**-0.5)
    return _gap(APERTURE * cubes ** (1.0 / 3.0), 0.5 / n)


def _wave_joint(n: float) -> joints.Crack:
    x = np.arange(int(n)) / n
    heights = np.broadcast_to(np.cos(2 * np.pi * x), (8, int(n)))  # 8 equal rows
    return joints.Crack(surfaces.from_array(heights, 1.0 / n, periodic=True), young=YOUNG, poisson=0.2)


def _sheared_joint(tolerance: float) -> tuple[joints.Crack, float]:
    # a block of two thirds of the face, which is sheared by four cells
    surface = surfaces.fbm((96, 96), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    return joints.Crack(surface, young=YOUNG, poisson=0.2, block=6.4e-3), float(tolerance)


def _closure(problem: tuple[joints.Crack, float]) -> Array:
    crack, tolerance = problem
    laws = joints.closure(
        crack, shear=[4e-4], direction="E", normal_force=[10.0, 100.0, 1000.0], tolerance=tolerance
    )
    return laws["interface_closure"].values


@lru_cache(maxsize=1)
def _exact_closure() -> Array:
    return _closure(_sheared_joint(EXACT))
