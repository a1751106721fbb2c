"""Estimators of the Hurst exponent on exact fractional Brownian surfaces, clean and with white noise."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

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
    windows = Experiment(
        "variogram, lags to n / knob",
        (32, 16, 8, 4, 2),
        lambda knob: (_faces(256, 0.0), {"scales": (1.0, 256.0 / knob)}),
        partial(_hurst, "variogram"),
        _error,
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
        Contest("window of scales", error, "exact fractional Brownian surfaces, 256 x 256", (windows,)),
    )


def _experiment(
    name: str, method: str, sizes: tuple[int, ...], noise: float, options: dict[str, Any]
) -> Experiment:
    return Experiment(
        name, sizes, lambda n: (_faces(int(n), noise), options), partial(_hurst, method), _error
    )


@lru_cache(maxsize=8)
def _faces(n: int, noise: float) -> xr.DataArray:
    from fractalcontact import surfaces as room

    faces = room.fbm((n, n), 1.0, hurst=HURST, rms_increment=1.0, members=MEMBERS, rng=n)
    if noise:
        faces = faces + np.sqrt(noise / 2.0) * np.random.default_rng(n).normal(size=faces.shape)
        faces = faces.assign_attrs(units="m").rename("height")
    return faces


def _hurst(method: str, case: tuple[xr.DataArray, dict[str, Any]]) -> list[float]:
    """Return the exponent of the first surface; the others are estimated with it."""
    from fractalcontact import dimensions as room

    faces, options = case
    return [float(v) for v in room.estimate(faces, [method], **options)["hurst"].values.ravel()]


def _error(found: list[float], _: float) -> float:
    return float(np.sqrt(np.nanmean((np.asarray(found) - HURST) ** 2)))
