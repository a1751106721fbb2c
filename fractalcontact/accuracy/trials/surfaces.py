"""Generators against the increments, or the power spectrum, that their surfaces should have."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]
Make = Callable[..., "xr.DataArray"]

HURST = 0.7
SIZES = (32, 64, 128, 256, 512, 1024)
ROLLOFF, SHORT = 0.5, 4.0  # of the extent; spacings
_POINTS, _FEWEST = 1 << 18, 100  # points, and surfaces, of the ensemble that tells the error


def contests() -> tuple[Contest, ...]:
    """Return what is measured of the generators."""
    brownian = {
        "fbm": _brownian("fbm"),
        "midpoint": _brownian("midpoint"),
        "midpoint, with additions": _brownian("midpoint", additions=True),
        "spectral": _of_height("spectral"),
        "weierstrass": _of_height("weierstrass"),
    }
    cut = {
        f"spectral with cut-offs, {word} normalised": partial(_with_cutoffs, normalise=key)
        for word, key in (("each", "realisation"), ("mean", "expectation"))
    }
    return (
        Contest(
            "fractional Brownian surface",
            "largest relative error of the mean square increments at lags 1 to n/8, set right at lag 1",
            f"lag^(2 H), H = {HURST}; some 5 % is the chance of a finite ensemble",
            tuple(_experiment(name, make, _increments_error) for name, make in brownian.items()),
            given=True,
        ),
        Contest(
            "power spectrum with cut-offs",
            "largest relative error of the mean power in octaves between the cut-offs",
            "q^(-2 - 2 H) below the roll-off; some 5 % is the chance of a finite ensemble",
            tuple(_experiment(name, make, _power_error) for name, make in cut.items()),
            given=True,
        ),
    )


def _experiment(name: str, make: Make, error: Callable[[_Ensemble], float]) -> Experiment:
    return Experiment(
        name,
        SIZES,
        int,
        lambda n: make(n, rng=0),
        lambda _, n: error(_Ensemble(make, int(n))),
    )


class _Ensemble:
    """Surfaces of one size, made one after the other."""

    def __init__(self, make: Make, n: int) -> None:
        self.make, self.n = make, n

    def __iter__(self) -> Iterator[Array]:
        count = max(_FEWEST, _POINTS // self.n**2)
        for stream in np.random.SeedSequence(1).spawn(count):
            yield self.make(self.n, rng=stream).values


def _brownian(name: str, **options: Any) -> Make:
    def make(n: int, **more: Any) -> xr.DataArray:
        from fractalcontact import surfaces as room

        return getattr(room, name)((n, n), 1.0, hurst=HURST, rms_increment=1.0, **options, **more)  # type: ignore[no-any-return]

    return make


def _of_height(name: str) -> Make:
    def make(n: int, **more: Any) -> xr.DataArray:
        from fractalcontact import surfaces as room

        return getattr(room, name)((n, n), 1.0, hurst=HURST, rms_height=1.0, **more)  # type: ignore[no-any-return]

    return make


def _with_cutoffs(n: int, normalise: str, **more: Any) -> xr.DataArray:
    from fractalcontact import surfaces as room

    return room.spectral(
        (n, n),
        1.0,
        hurst=HURST,
        rms_height=1.0,
        rolloff=ROLLOFF * n,
        short_cutoff=SHORT,
        normalise=normalise,
        **more,
    )


def _increments_error(members: _Ensemble) -> float:
    n = members.n
    lags = np.unique(np.geomspace(1, max(2, n // 8), 6).astype(int))
    squares = np.zeros(lags.size)
    for one in members:
        across, along = (
            np.array([np.mean((rows[k:] - rows[:-k]) ** 2) for k in lags]) for rows in (one, one.T)
        )
        squares += across + along
    return float(np.abs(squares / squares[0] / lags ** (2.0 * HURST) - 1.0).max())


def _power_error(members: _Ensemble) -> float:
    n = members.n
    wave = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n))
    power = np.zeros(wave.shape)
    for one in members:
        power += np.abs(np.fft.rfft2(one)) ** 2
    edges = np.geomspace(1.0 / (ROLLOFF * n), 1.0 / SHORT, max(2, int(np.log2(ROLLOFF * n / SHORT))) + 1)
    scaled = np.array(
        [
            np.mean((power * np.where(wave > 0, wave, 1.0) ** (2 + 2 * HURST))[(wave >= low) & (wave < high)])
            for low, high in pairwise(edges)
        ]
    )
    return float(np.abs(scaled / scaled.mean() - 1.0).max())
