"""The solvers: a sphere (Hertz), a wave (Westergaard), rough faces against a solution to rounding."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import TOLERANCE, Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

MODULUS, RADIUS, APPROACH = 1e9, 1.0, 1e-4  # the sphere of Hertz: Pa, m, m
SIZES = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)
TOLERANCES = tuple(10.0**-k for k in range(2, 11))
ROUGH, PRESSURE, CLOSURE, HARDNESS, TIGHT = 128, 2e7, 1e-5, 1.5e8, 1e-13


def contests() -> tuple[Contest, ...]:
    """Return what is measured of the solvers."""
    ways: dict[str, tuple[tuple[int, ...], dict[str, Any]]] = {
        "elimination, disc": (SIZES[:6], {"method": "elimination", "influence": "disc"}),
        "elimination, square": (SIZES[:6], {"method": "elimination", "influence": "square"}),
        "fast, disc": (SIZES, {"influence": "disc"}),
        "fast, inscribed disc": (SIZES, {"influence": "disc", "disc_radius": "inscribed"}),
        "fast, disc of equal area": (SIZES, {"influence": "disc", "disc_radius": "equal_area"}),
        "fast, square": (SIZES, {"influence": "square"}),
    }
    hertz = tuple(
        Experiment(name, knobs, _sphere, partial(_press_sphere, options), _hertz_error)
        for name, (knobs, options) in ways.items()
    )
    wave = Experiment("fast, spectral", SIZES, _wave, _press_wave, _westergaard_error)
    rough: dict[str, dict[str, Any]] = {
        "fast, free body": {"influence": "disc", "boundary": "free"},
        "fast, periodic body": {"boundary": "periodic"},
        "fast, free body with a hardness": {"influence": "disc", "boundary": "free", "hardness": HARDNESS},
        "fast, free body, closure imposed": {"influence": "disc", "boundary": "free", "closure": CLOSURE},
        "fast, periodic body, closure imposed": {"boundary": "periodic", "closure": CLOSURE},
        "fast, periodic body with a hardness": {"boundary": "periodic", "hardness": HARDNESS},
    }
    return (
        Contest(
            "sphere",
            "relative error of the force",
            "Hertz: 4/3 E* sqrt(R) d^1.5",
            hertz,
        ),
        Contest(
            "wave",
            "error of the mean gap over the amplitude",
            "Westergaard: the mean gap of a sinusoidal face",
            (wave,),
        ),
        *(
            Contest(
                f"rough, {name.removeprefix('fast, ')}",
                "rms error of the pressures over their rms",
                f"the same face solved to a tolerance of {TIGHT:g}",
                (
                    Experiment(
                        name,
                        TOLERANCES,
                        lambda knob: (float(knob), _rough()),
                        partial(_press_rough, options),
                        _against(options),
                        TOLERANCE,
                    ),
                ),
            )
            for name, options in rough.items()
        ),
    )


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


@lru_cache(maxsize=1)
def _rough() -> xr.DataArray:
    from fractalcontact import surfaces as room

    return room.spectral(
        (ROUGH, ROUGH), 1e-5, hurst=0.8, rms_slope=0.1, rolloff=64e-5, short_cutoff=4e-5, rng=3
    )


def _press_rough(options: dict[str, Any], case: tuple[float, xr.DataArray]) -> np.ndarray[Any, Any]:
    from fractalcontact import contact as room

    tolerance, face = case
    load: dict[str, Any] = {} if "closure" in options else {"nominal_pressure": PRESSURE}
    pressed = room.press(
        face,
        contact_modulus=MODULUS,
        tolerance=tolerance,
        keep=("pressure",),
        **load | options,
    )
    return pressed["pressure"].values[0]  # type: ignore[no-any-return]


def _against(options: dict[str, Any]) -> Callable[[Any, float], float]:
    @lru_cache(maxsize=1)
    def exact() -> np.ndarray[Any, Any]:
        return _press_rough(options, (TIGHT, _rough()))

    def error(pressure: np.ndarray[Any, Any], _: float) -> float:
        return float(np.sqrt(np.mean((pressure - exact()) ** 2) / np.mean(exact() ** 2)))

    return error
