"""A spectrum that bends slowly into a plateau of long waves, as (q^2 + q_0^2)^(-1 - H) (K-correlation).

No octave has the exponent of the short waves, but all waves together have it. Palasantzas (1993), Phys. Rev.
B 48, 14472.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._exponent_by_scale import Blocks, PowerLaw, best_scored
from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_PARAMETERS = 3  # exponent, corner and amplitude
_LEAST_LENGTH = 4.0  # spacings: a shorter corner leaves no waves beyond it
_WINDOW = "the waves shorter than the corner of the roll-off"


@dataclass(frozen=True)
class RollOff:
    """The exponent of the short waves, the wavelength of the corner in spacings, the penalised deviance."""

    law: PowerLaw
    length: float
    penalised: float


def fit_rolloff(blocks: Blocks, inside: Array) -> RollOff | None:
    """Fit exponent and corner to some blocks; None where the corner is not among their waves."""
    count, wavelength = blocks.count[inside], blocks.wavelength[inside]
    if not wavelength.max() > _LEAST_LENGTH:
        return None
    low, high = np.array([LOWEST, -np.log(wavelength.max())]), np.array([HIGHEST, -np.log(_LEAST_LENGTH)])

    def model(values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the power, and its derivatives by H and the logarithm of the corner."""
        hurst, corner = values
        logs, slope = (part[inside] for part in blocks.logs(float(hurst)))
        power, square = hurst + 0.5 * blocks.axes, (wavelength * np.exp(corner)) ** 2
        bend = np.log1p(square)
        return logs - power * bend, np.stack([slope - bend, -2.0 * power * square / (1.0 + square)])

    places = [share * low[1] + (1.0 - share) * high[1] for share in (0.3, 0.6)]
    starts = [np.array([hurst, place]) for hurst in (0.3, 0.8) for place in places]
    best = best_scored(model, blocks.power[inside], count, starts, (low, high), np.array([0.2, 0.7]))
    hurst, corner = (float(value) for value in best.values)
    if not (low[1] < corner < high[1] and best.is_regular):
        return None
    error = float(best.half_widths[0])
    law = PowerLaw(hurst, hurst - error, hurst + error, float(count.sum()), best.deviance)
    return RollOff(law, float(np.exp(-corner)), best.deviance + 2.0 * _PARAMETERS)


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
