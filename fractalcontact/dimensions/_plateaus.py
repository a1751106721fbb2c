"""A power law with a plateau, fitted to the modes of a periodic profile, its corner being unknown.

A profile has few modes, and where its spectrum bends into a plateau cannot be told from them to a mode or
two. An interval that takes the corner for known holds the exponent too seldom (82 to 95 % of the cases, as
measured). Here the expected power of mode q is

    amplitude * max(q, corner)^(-1 - 2 H),

the interval is that of the likelihood at its best amplitude and corner for each H (profile likelihood: Cox
and Hinkley 1974, Theoretical Statistics, ch. 9), and all corners are tried at once by running sums.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._exact import QUANTILE, crossing, minimum
from fractalcontact.dimensions._periodic import Modes

Array = np.ndarray[Any, np.dtype[Any]]

LEAST_BEYOND = 7  # modes beyond the last corner that is tried
_LOW, _HIGH, _POINTS = -0.4, 1.9, 24  # Hurst exponents searched: the data may be of no fractal


@dataclass(frozen=True)
class PlateauFit:
    """Estimate of H; `corner` is the wavenumber from which the power law holds."""

    hurst: float
    standard_error: float
    low: float
    high: float
    corner: float


class Plateaus:
    """The modes of one profile between its cut-offs, in ascending order."""

    def __init__(self, modes: Modes) -> None:
        self.logs = np.log(modes.wavenumber)
        self.wavenumber, self.weights = modes.wavenumber, modes.weights
        self.squares = modes.weights * modes.power
        self.total = float(modes.weights.sum())
        self.corners = slice(0, max(1, modes.wavenumber.size - LEAST_BEYOND))
        self.below, self.count = np.cumsum(self.squares), np.cumsum(self.weights)

    def deviances(self, hurst: float) -> Array:
        """Return the deviance at the best amplitude for every corner."""
        logs = (-1.0 - 2.0 * hurst) * self.logs
        expected = np.exp(logs)
        scaled, weighted = self.squares / expected, self.weights * logs
        # up to the corner all modes have the power of the corner
        level, rest = (np.cumsum(part[::-1])[::-1] - part for part in (scaled, weighted))
        amplitude = (self.below / expected + level) / self.total
        return np.asarray((self.total * np.log(amplitude) + self.count * logs + rest)[self.corners])


def fit(modes: Modes) -> PlateauFit:
    """Fit H, amplitude and corner to the modes of a profile between its cut-offs."""
    plateaus = Plateaus(modes)

    def deviance(hurst: float) -> float:
        return float(plateaus.deviances(hurst).min())

    hurst = minimum(deviance, _LOW, _HIGH, points=_POINTS)
    least = deviance(hurst)

    def ends(rise: float) -> tuple[float, float]:
        """Return where the deviance has risen so far."""
        low, high = (crossing(lambda h: deviance(h) - least - rise, hurst, end, end) for end in (_LOW, _HIGH))
        return low, high

    inner, outer = ends(1.0), ends(QUANTILE)
    corner = int(np.argmin(plateaus.deviances(hurst)))
    return PlateauFit(hurst, 0.5 * (inner[1] - inner[0]), *outer, float(plateaus.wavenumber[corner]))
