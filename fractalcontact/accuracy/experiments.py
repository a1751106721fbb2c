"""What is measured: the methods of each part, their knob, and a truth from outside the code."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

MODULUS, RADIUS, APPROACH = 1e9, 1.0, 1e-4  # the sphere of Hertz: Pa, m, m
HURST, MEMBERS = 0.7, 8
RIPPLE = 0.6  # amplitude of the sinusoidal aperture over its mean


@dataclass(frozen=True)
class Experiment:
    """One method, turned up along its knob.

    Attributes
    ----------
    method : str
    knobs : sequence of float
        Settings in the order of growing cost.
    prepare : callable
        Knob to the input, untimed.
    solve : callable
        Input to the result, timed.
    error : callable
        Result and knob to the true error.
    """

    method: str
    knobs: Sequence[float]
    prepare: Callable[[float], Any]
    solve: Callable[[Any], Any]
    error: Callable[[Any, float], float]


@dataclass(frozen=True)
class Part:
    """The experiments of one room, and what their knob and their error mean."""

    knob: str
    error: str
    truth: str
    experiments: tuple[Experiment, ...]


def surfaces() -> Part:
    """Synthetic surfaces against the variogram they should have."""
    sizes = (32, 64, 128, 256, 512)
    return Part(
        "points along an edge",
        f"relative error of the mean square increments at lags 1 to n/8, mean of {MEMBERS} surfaces",
        "fractional Brownian surface: lag^(2 H); the sampling error of the mean is part of what is seen",
        tuple(
            Experiment(name, sizes, int, partial(_members, make), _variogram_error)
            for name, make in (("fbm", _fbm), ("spectral", _spectral), ("midpoint", _midpoint))
        ),
    )


def dimensions() -> Part:
    """Estimators of the Hurst exponent on exact fractional Brownian surfaces."""
    from fractalcontact import dimensions as room

    sizes = (32, 64, 128, 256)
    return Part(
        "points along an edge",
        f"root mean square error of the Hurst exponent over {MEMBERS} surfaces of H = {HURST}",
        "exact fractional Brownian surfaces of known exponent",
        tuple(
            Experiment(name, sizes, partial(_members, _fbm), partial(_exponents, name), _exponent_error)
            for name in room.methods()
        ),
    )


def contact() -> Part:
    """The solvers on a sphere (Hertz) and on a wave (Westergaard)."""
    sizes = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
    small = sizes[:6]
    ways: tuple[tuple[str, tuple[int, ...], dict[str, Any]], ...] = (
        ("elimination, disc", small, {"method": "elimination", "influence": "disc"}),
        ("fast, disc", sizes, {"influence": "disc"}),
        ("fast, inscribed disc", sizes, {"influence": "disc", "disc_radius": "inscribed"}),
        ("fast, square", sizes, {"influence": "square"}),
    )
    hertz = tuple(
        Experiment(name, knobs, _sphere, partial(_press_sphere, options), _hertz_error)
        for name, knobs, options in ways
    )
    wave = Experiment("fast, spectral (wave)", sizes, _wave, _press_wave, _westergaard_error)
    return Part(
        "points along an edge",
        "relative error of the force (sphere), or of the mean gap over the amplitude (wave)",
        "Hertz: 4/3 E* sqrt(R) d^1.5; Westergaard: the mean gap of a sinusoidal face",
        (*hertz, wave),
    )


def domains() -> Part:
    """Set dimensions of the carpet of Sierpinski, cut so that it does not fit any grid of boxes."""
    sizes = (64, 128, 256, 512)
    return Part(
        "points along an edge",
        "error of the dimension",
        "log 8 / log 3 for the carpet of Sierpinski",
        tuple(
            Experiment(
                f"box dimension, {cover} cover", sizes, _carpet, partial(_box_dimension, cover), _carpet_error
            )
            for cover in ("minimum", "mean")
        ),
    )


def joints() -> Part:
    """Flow across the crests of a sinusoidal aperture."""
    return Part(
        "cells along an edge",
        "relative error of the hydraulic aperture",
        "(1 - e^2)^(5/2) / (1 + e^2/2) for the cube of the aperture across the crests",
        (Experiment("transmissivity", (8, 16, 32, 64, 128, 256), _corrugated, _flow, _flow_error),),
    )


PARTS: Mapping[str, Callable[[], Part]] = {
    "surfaces": surfaces,
    "dimensions": dimensions,
    "contact": contact,
    "domains": domains,
    "joints": joints,
}


def _fbm(n: int, seed: int) -> xr.DataArray:
    from fractalcontact import surfaces as room

    return room.fbm((n, n), 1.0, hurst=HURST, rms_increment=1.0, rng=seed)


def _spectral(n: int, seed: int) -> xr.DataArray:
    from fractalcontact import surfaces as room

    return room.spectral((n, n), 1.0, hurst=HURST, rms_height=1.0, rng=seed)


def _midpoint(n: int, seed: int) -> xr.DataArray:
    from fractalcontact import surfaces as room

    return room.midpoint((n, n), 1.0, hurst=HURST, rms_increment=1.0, rng=seed)


def _members(make: Callable[[int, int], xr.DataArray], n: float) -> list[xr.DataArray]:
    return [make(int(n), seed) for seed in range(MEMBERS)]


def _variogram_error(members: list[xr.DataArray], n: float) -> float:
    lags = np.unique(np.geomspace(1, max(2, n // 8), 6).astype(int))
    squares = np.array(
        [[np.mean((m.values[:, lag:] - m.values[:, :-lag]) ** 2) for lag in lags] for m in members]
    ).mean(axis=0)
    shape = squares / squares[0] / lags ** (2.0 * HURST)
    return float(np.abs(shape - 1.0).max())


def _exponents(method: str, members: list[xr.DataArray]) -> list[float]:
    from fractalcontact import dimensions as room

    return [room.estimate(member, [method])["hurst"].item() for member in members]


def _exponent_error(exponents: list[float], _: float) -> float:
    return float(np.sqrt(np.mean((np.asarray(exponents) - HURST) ** 2)))


def _sphere(n: float) -> xr.DataArray:
    from fractalcontact import surfaces as room

    radius = np.sqrt(RADIUS * APPROACH)
    x = (np.arange(int(n)) + 0.5) / n * 4.0 * radius - 2.0 * radius
    # first touch is at the highest node: the apex must be one
    x = x - x[int(n) // 2]
    return room.from_array(-(x**2 + x[:, None] ** 2) / (2.0 * RADIUS), 4.0 * radius / n)


def _press_sphere(options: dict[str, Any], face: xr.DataArray) -> float:
    from fractalcontact import contact as room

    return float(
        room.press(face, contact_modulus=MODULUS, closure=APPROACH, keep=(), **options)["normal_force"][0]
    )


def _hertz_error(force: float, _: float) -> float:
    return float(abs(force / (4.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * APPROACH**1.5) - 1.0))


def _wave(n: float) -> xr.DataArray:
    from fractalcontact import surfaces as room

    x = np.arange(int(n)) / n
    return room.from_array(np.broadcast_to(np.cos(2.0 * np.pi * x), (int(n), int(n))), 1.0 / n, periodic=True)


def _press_wave(face: xr.DataArray) -> float:
    from fractalcontact import contact as room

    pressure = 0.5 * np.pi * MODULUS  # half of that of full contact, for amplitude and wavelength 1
    return float(room.press(face, contact_modulus=MODULUS, nominal_pressure=pressure, keep=())["mean_gap"][0])


def _westergaard_error(gap: float, _: float) -> float:
    angle = np.arcsin(np.sqrt(0.5))
    exact = 2.0 * (0.5 * np.cos(angle) ** 2 + np.sin(angle) ** 2 * np.log(np.sin(angle)))
    return float(abs(gap - exact))


def _carpet(n: float) -> xr.DataArray:
    import xarray as xr

    mask = np.ones((1, 1), bool)
    while mask.shape[0] < n:
        mask = np.kron(mask, np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)).astype(bool)
    return xr.DataArray(mask[: int(n), : int(n)], dims=("y", "x"))


def _box_dimension(cover: str, mask: xr.DataArray) -> float:
    from fractalcontact import domains as room

    return float(room.box_dimension(mask, cover=cover)["box_dimension"])


def _carpet_error(dimension: float, _: float) -> float:
    return float(abs(dimension - np.log(8) / np.log(3)))


def _corrugated(n: float) -> xr.DataArray:
    from fractalcontact import surfaces as room
    from fractalcontact.base.schema import label

    x = (np.arange(int(n)) + 0.5) / n
    gap = 1e-4 * (1.0 + RIPPLE * np.cos(2.0 * np.pi * x))
    return label(room.from_array(np.broadcast_to(gap, (int(n), int(n))), 1.0 / n).rename("gap"))


def _flow(gap: xr.DataArray) -> float:
    from fractalcontact import joints as room

    return float(room.transmissivity(gap)["hydraulic_aperture"].sel(axis="x"))


def _flow_error(aperture: float, _: float) -> float:
    exact = ((1.0 - RIPPLE**2) ** 2.5 / (1.0 + RIPPLE**2 / 2.0)) ** (1.0 / 3.0)
    return float(abs(aperture / 1e-4 / exact - 1.0))
