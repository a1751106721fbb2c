"""Flow through apertures, and the dilatancy of a wave, against closed forms."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import TOLERANCE, Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

RIPPLE = 0.6  # amplitude of the sinusoidal aperture over its mean
SHEAR = 0.13  # of the wavelength
FACE, YOUNG = 96, 30e9


def contests() -> tuple[Contest, ...]:
    """Return what is measured of flow and dilatancy."""
    sizes = (8, 16, 32, 64, 128, 256, 512)
    across = Experiment("transmissivity, across", sizes, _corrugated, _flow, _flow_error)
    around = Experiment(
        "transmissivity, across, periodic", sizes[:5], partial(_corrugated, periodic=True), _flow, _flow_error
    )
    board = Experiment(
        "transmissivity, checkerboard", (8, 16, 32, 64, 128), _checkerboard, _flow, _board_error
    )
    rigid = Experiment("rigid dilatancy", (16, 32, 64, 128, 256, 512), _wave, _rigid, _rigid_error)
    closure = Experiment(
        "closure of the interface",
        tuple(10.0**-k for k in range(2, 11)),
        _sheared,
        _closure,
        _closure_error,
        TOLERANCE,
    )
    return (
        Contest(
            "sinusoidal aperture, across",
            "relative error of the hydraulic aperture",
            "(1 - e^2)^(5/2) / (1 + e^2/2) for the cube of the aperture across the crests",
            (across, around),
        ),
        Contest(
            "checkerboard",
            "relative error of the hydraulic aperture",
            "sqrt(K1 K2) for the transmissivity, K1/K2 = 10",
            (board,),
        ),
        Contest("sliding wave", "error over the amplitude", "2 A |sin(k v / 2)|", (rigid,)),
        Contest(
            "closure law",
            "relative error of the closure of the interface, three forces",
            "the same joint solved to a tolerance of 1e-13",
            (closure,),
        ),
    )


def _gap(values: Any, spacing: float, periodic: bool = False) -> xr.DataArray:
    from fractalcontact import surfaces as room
    from fractalcontact.base.schema import label

    return label(room.from_array(values, spacing, periodic=periodic).rename("gap"))


def _corrugated(n: float, periodic: bool = False) -> xr.DataArray:
    x = (np.arange(int(n)) + 0.5) / n
    gap = 1e-4 * (1.0 + RIPPLE * np.cos(2.0 * np.pi * x))
    return _gap(np.broadcast_to(gap, (int(n), int(n))), 1.0 / n, periodic)


def _checkerboard(n: float) -> xr.DataArray:
    i, j = np.mgrid[0 : 2 * int(n), 0 : 2 * int(n)] // int(n)
    cubes = np.where((i + j) % 2 == 0, 10.0**0.5, 10.0**-0.5)
    return _gap(1e-4 * cubes ** (1.0 / 3.0), 0.5 / n)


def _flow(gap: xr.DataArray) -> float:
    from fractalcontact import joints as room

    return float(room.transmissivity(gap)["hydraulic_aperture"].sel(axis="x"))


def _flow_error(aperture: float, _: float) -> float:
    exact = ((1.0 - RIPPLE**2) ** 2.5 / (1.0 + RIPPLE**2 / 2.0)) ** (1.0 / 3.0)
    return float(abs(aperture / 1e-4 / exact - 1.0))


def _board_error(aperture: float, _: float) -> float:
    return float(abs(aperture / 1e-4 - 1.0))


def _wave(n: float) -> Any:
    from fractalcontact import joints as room
    from fractalcontact import surfaces

    x = np.arange(int(n)) / n
    face = surfaces.from_array(np.broadcast_to(np.cos(2 * np.pi * x), (8, int(n))), 1.0 / n, periodic=True)
    return room.Crack(face, young=YOUNG, poisson=0.2)


def _rigid(crack: Any) -> float:
    from fractalcontact import joints as room

    return float(room.dilatancy(crack, shear=[SHEAR], direction="E")["rigid_dilatancy"].squeeze())


def _rigid_error(lift: float, _: float) -> float:
    return float(abs(lift - 2.0 * np.sin(np.pi * SHEAR)))


def _sheared(tolerance: float) -> tuple[Any, float]:
    from fractalcontact import joints as room
    from fractalcontact import surfaces

    face = surfaces.fbm((FACE, FACE), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    return room.Crack(face, young=YOUNG, poisson=0.2, block=6.4e-3), float(tolerance)


def _closure(case: tuple[Any, float]) -> np.ndarray[Any, Any]:
    from fractalcontact import joints as room

    crack, tolerance = case
    laws = room.closure(
        crack, shear=[4e-4], direction="E", normal_force=[10.0, 100.0, 1000.0], tolerance=tolerance
    )
    return laws["interface_closure"].values


@lru_cache(maxsize=1)
def _exact_closure() -> np.ndarray[Any, Any]:
    return _closure(_sheared(1e-13))


def _closure_error(found: np.ndarray[Any, Any], _: float) -> float:
    return float(np.abs(found / _exact_closure() - 1.0).max())
