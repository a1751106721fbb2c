"""A spectrum that bends slowly into a plateau of long waves, as (q^2 + q_0^2)^(-1 - H) (K-correlation).

It is that of the Matern covariance. No octave has the exponent of the short waves, but all waves together
have it. Palasantzas (1993), Phys. Rev. B 48, 14472.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._exponent_by_scale import Blocks, PowerLaw, best_scored
from fractalcontact.dimensions._mode_blocks import HIGHEST, LARGEST, LOWEST, Frame, lattice_power
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_PARAMETERS = 3  # exponent, corner and amplitude
_LEAST_LENGTH = 2.5  # spacings: a shorter corner leaves no waves beyond it
_WINDOW = "the waves shorter than the corner of the roll-off"


@dataclass(frozen=True)
class RollOff:
    """The exponent of the short waves, the wavelength of the corner in spacings, the penalised deviance."""

    law: PowerLaw
    length: float
    penalised: float


def fit_rolloff(blocks: Blocks, inside: Array) -> RollOff | None:
    """Fit exponent and corner to some blocks; None where the corner is not among their waves.

    The power over the spectral density, which is that of fractional Brownian heights at first, is in a second
    fit that of the covariance that the first one found: a plateau of long waves has less effect of the edges.
    """
    count, wavelength, frame = blocks.count[inside], blocks.wavelength[inside], blocks.frame
    if frame is None or not wavelength.max() > _LEAST_LENGTH:
        return None
    low, high = np.array([LOWEST, -np.log(wavelength.max())]), np.array([HIGHEST, -np.log(_LEAST_LENGTH)])
    edges: Array | None = None

    def model(values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the power, and its derivatives by H and the logarithm of the corner."""
        hurst, square = float(values[0]), float((2.0 * np.pi * np.exp(values[1])) ** 2)
        logs, slope, by_square = frame.rolled_densities(hurst, square)
        if edges is None:
            plain, plain_slope = blocks.logs(hurst)
            bare, bare_slope, _ = frame.rolled_densities(hurst, 0.0)
            logs, slope = logs + plain - bare, slope + plain_slope - bare_slope
        else:
            logs = logs + edges
        return logs[inside], np.stack([slope, 2.0 * by_square])[:, inside]

    places = [share * low[1] + (1.0 - share) * high[1] for share in (0.3, 0.6)]
    starts = [np.array([hurst, place]) for hurst in (0.3, 0.8) for place in places]
    for _ in range(2):
        best = best_scored(model, blocks.power[inside], count, starts, (low, high), np.array([0.2, 0.7]))
        hurst, corner = (float(value) for value in best.values)
        if not (low[1] < corner < high[1] and best.is_regular):
            return None
        edges, starts = _edges(frame, hurst, float(np.exp(-corner))), [best.values]
        if edges is None:
            break
    error = float(best.half_widths[0])
    law = PowerLaw(hurst, hurst - error, hurst + error, float(count.sum()), best.deviance)
    return RollOff(law, float(np.exp(-corner)), best.deviance + 2.0 * _PARAMETERS)


def _edges(frame: Frame, hurst: float, length: float) -> Array | None:
    """Return the logarithm of the expected power of a surface with a roll-off over its spectral density.

    Its covariance is that of a torus of twice the size. None for a profile, and for a large surface.
    """
    if frame.axes == 1 or min(frame.shape) > LARGEST:
        return None
    y, x = (np.pi * np.arange(n + 1) / (n * d) for n, d in zip(frame.shape, frame.spacing, strict=True))
    square = (2.0 * np.pi / length) ** 2
    logs = [replace(frame, waves=(np.full(x.size, line), x)).rolled_densities(hurst, square)[0] for line in y]
    covariance = fft.dct(np.exp(np.array(logs)), 1, (0, 1))[:-1, :-1] / (4.0 * np.prod(frame.shape))
    power = lattice_power(frame, covariance)
    return np.asarray(np.log(power) - frame.rolled_densities(hurst, square)[0])


def rolloff_estimate(rolloff: RollOff, blocks: Blocks, surface: Surface) -> Estimate:
    """Return the estimate of a surface with a slow roll-off."""
    law, dx = rolloff.law, surface.spacing[1]
    return Estimate(
        law.hurst,
        0.5 * (law.high - law.low) / NORMAL,
        law.low,
        law.high,
        scale_min=float(blocks.wavelength.min()) * dx,
        scale_max=rolloff.length * dx,
        window=_WINDOW,
        note=f"a slow roll-off: the spectrum falls as (q^2 + q_0^2)^(-1 - H) with a corner at waves of "
        f"{rolloff.length * dx:.3g} m",
    )
