"""A spectrum that bends slowly into a plateau of long waves, as (q^2 + q_0^2)^(-1 - H) (K-correlation).

No octave has the exponent of the short waves, but all waves together have it. Palasantzas (1993), Phys. Rev.
B 48, 14472.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._blur_fit import CORRELATION
from fractalcontact.dimensions._exponent_by_scale import Blocks, PowerLaw
from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_FLAT = 1.2  # times the standard error: the likelihood is flatter than a parabola
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
    from scipy.optimize import minimize

    count, wavelength = blocks.count[inside], blocks.wavelength[inside]
    powers, modes = np.log(np.maximum(blocks.power[inside], 1e-300)), float(count.sum())
    if not wavelength.max() > _LEAST_LENGTH:
        return None
    waves = 2.0 * np.pi / wavelength
    corners = -np.log(wavelength.max()), -np.log(_LEAST_LENGTH)

    def evaluate(values: Array) -> tuple[float, Array]:
        """Return the deviance, and the derivatives of the logarithm of the expected power."""
        hurst, corner = values
        logs, slope = (part[inside] for part in blocks.logs(float(hurst)))
        square = (2.0 * np.pi * np.exp(corner) / waves) ** 2
        logs = logs - (1.0 + hurst) * np.log1p(square)
        rest = powers - logs
        level = float(rest.max() + np.log(np.sum(count * np.exp(rest - rest.max())) / modes))
        columns = np.stack(
            [slope - np.log1p(square), -2.0 * (1.0 + hurst) * square / (1.0 + square), np.ones(count.size)]
        )
        return float(np.sum(count * logs) + modes * level), columns

    starts = [
        (hurst, share * corners[0] + (1.0 - share) * corners[1])
        for hurst in (0.3, 0.8)
        for share in (0.3, 0.6)
    ]
    bounds = [(LOWEST, HIGHEST), corners]
    fits = [
        minimize(
            lambda values: evaluate(values)[0],
            start,
            method="Nelder-Mead",
            bounds=bounds,
            options={"xatol": 1e-4, "fatol": 1e-3},
        )
        for start in starts
    ]
    best = min(fits, key=lambda fit: float(fit.fun))
    hurst, corner = (float(value) for value in best.x)
    deviance, columns = evaluate(best.x)
    information = 0.5 * (count * columns) @ columns.T
    if not corners[0] < corner < corners[1] or np.linalg.cond(information) > 1e12:
        return None
    error = _FLAT * NORMAL * float(np.sqrt(CORRELATION * np.linalg.inv(information)[0, 0]))
    law = PowerLaw(hurst, hurst - error, hurst + error, modes, deviance)
    return RollOff(law, float(np.exp(-corner)), deviance + 2.0 * _PARAMETERS)


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
