"""Estimators of the Hurst exponent on exact fractional Brownian surfaces, clean and with white noise."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

Case = tuple["xr.DataArray", dict[str, Any]]

HURST, MEMBERS = 0.7, 12
NOISE = 0.1  # variance over half the variogram at lag 1
SIZES = (32, 64, 128, 256, 512)


def contests() -> tuple[Contest, ...]:
    """Return what is measured of the estimators."""
    from fractalcontact import dimensions as room

    error = f"root mean square error of the Hurst exponent over {MEMBERS} surfaces of H = {HURST}"
    clean = tuple(_experiment(name, name, SIZES, 0.0, {}) for name in room.methods())
    default = next(iter(room.methods()))
    noisy = (
        _experiment(f"{default}, noise told", default, SIZES[:4], NOISE, {"noise": True}),
        _experiment(f"{default}, noise untold", default, SIZES[:4], NOISE, {}),
    )

    def window(knob: float) -> Case:
        return _faces(256, 0.0), {"scales": (1.0, 256.0 / knob)}

    windows = Experiment(
        "variogram, lags to n / knob",
        (32, 16, 8, 4, 2),
        window,
        partial(_hurst, "variogram"),
        _errors("variogram", window),
        "points along an edge over the longest lag",
    )
    return (
        Contest("Hurst exponent", error, "exact fractional Brownian surfaces", clean, given=True),
        Contest(
            "Hurst exponent under noise",
            error,
            f"exact surfaces and white noise of {NOISE:.0%} of half the variogram at lag 1",
            noisy,
            given=True,
        ),
        Contest(
            "Hurst exponent by direction",
            f"{error}, eight directions of each",
            "exact fractional Brownian surfaces, which have one exponent in all directions",
            (
                Experiment(
                    "by direction", SIZES[:4], lambda n: _faces(int(n), 0.0), _by_direction, _directed_error
                ),
            ),
            given=True,
        ),
        Contest("window of scales", error, "exact fractional Brownian surfaces, 256 x 256", (windows,)),
    )


def _experiment(
    name: str, method: str, sizes: tuple[int, ...], noise: float, options: dict[str, Any]
) -> Experiment:
    def prepare(n: float) -> Case:
        return _faces(int(n), noise), options

    return Experiment(name, sizes, prepare, partial(_hurst, method), _errors(method, prepare))


@lru_cache(maxsize=8)
def _faces(n: int, noise: float) -> xr.DataArray:
    from fractalcontact import surfaces as room

    faces = room.fbm((n, n), 1.0, hurst=HURST, rms_increment=1.0, members=MEMBERS, rng=n)
    if noise:
        faces = faces + np.sqrt(noise / 2.0) * np.random.default_rng(n).normal(size=faces.shape)
        faces = faces.assign_attrs(units="m").rename("height")
    return faces


def _hurst(method: str, case: Case) -> float:
    """Return the exponent of one surface: what is timed."""
    faces, options = case
    return _exponents(method, faces.isel(member=0), options)[0]


def _exponents(method: str, faces: xr.DataArray, options: dict[str, Any]) -> list[float]:
    from fractalcontact import dimensions as room

    return [float(v) for v in room.estimate(faces, [method], **options)["hurst"].values.ravel()]


def _by_direction(faces: xr.DataArray) -> np.ndarray[Any, Any]:
    """Return the exponents of one surface, which is timed."""
    return _directed(faces.isel(member=0))


def _directed(faces: xr.DataArray) -> np.ndarray[Any, Any]:
    from fractalcontact import dimensions as room

    return room.directions(faces)["hurst"].values


def _directed_error(_: Any, knob: float) -> float:
    return float(np.sqrt(np.nanmean((_directed(_faces(int(knob), 0.0)) - HURST) ** 2)))


def _errors(method: str, prepare: Callable[[float], Case]) -> Callable[[float, float], float]:
    """Return the error over all surfaces, of which one was timed."""

    def error(_: float, knob: float) -> float:
        faces, options = prepare(knob)
        return float(np.sqrt(np.nanmean((np.asarray(_exponents(method, faces, options)) - HURST) ** 2)))

    return error
