"""Whether all parts of a face are equally rough, and what it means for an interval if they are not.

The interval of a Gaussian family counts every point of the face. Where a few parts carry most of the
roughness (worn tops, patches, a step, outliers), fewer points than that decide; where the exponent itself
differs from part to part, no single one is true. Second differences hardly know of each other from part to
part, so that both are told by how they scatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._increments import Moments, complete_covariance
from fractalcontact.dimensions._pairs import LAGS

Array = np.ndarray[Any, np.dtype[Any]]

_SELDOM = 1e-4  # chance of the alarm on a face of the family
_SHARE = 0.5  # of the increments that a part must have


@dataclass(frozen=True)
class Evenness:
    """What the parts of a face say of its interval.

    Attributes
    ----------
    widening : float
        Factor on the standard error: the root of the number of parts over the number that would carry as
        much if they were alike. 1 where chance makes them as different.
    low, high : float
        Quartiles of the exponents of the parts where those differ more than by chance; NaN otherwise.
    note : str
    """

    widening: float = 1.0
    low: float = np.nan
    high: float = np.nan
    note: str = ""

    def applied(self, hurst: float, low: float, high: float) -> tuple[float, float]:
        """Return the interval widened about the estimate, holding the exponents of the parts."""
        low, high = hurst - self.widening * (hurst - low), hurst + self.widening * (high - hurst)
        return float(np.fmin(low, self.low)), float(np.fmax(high, self.high))


def evenness(moments: Moments, steps: tuple[float, ...], hurst: float) -> Evenness:
    """Compare the parts of a face by their second differences over one and two steps.

    Parameters
    ----------
    moments : Moments
        Of a face with parts; one without them is even.
    steps : (dy/dx, 1), or (1,) for a profile
    hurst : float
        Estimate for the whole face.
    """
    from scipy.special import chdtri

    axes = len(steps)
    if moments.parts is None or not 0.0 < hurst < 1.0:
        return Evenness()
    columns = np.array([3, 4, 9, 10][: 2 * axes])
    squares, counts = (values[:, columns] for values in moments.parts)
    most = counts.max(axis=0)
    shares = np.min(counts / np.maximum(most, 1), axis=1)
    covariance = _covariance(moments, steps, hurst, len(shares))
    squares, shares = squares[shares >= _SHARE], shares[shares >= _SHARE]
    if len(squares) < 2 or not most.all() or not squares[:, ::2].any():
        return Evenness()
    level = np.tile([1.0, 0.0], axes) / axes
    slope = np.tile([-1.0, 1.0], axes) / (axes * 2.0 * np.log(LAGS[1]))
    notes, widening, low, high = [], 1.0, np.nan, np.nan
    with np.errstate(divide="ignore"):
        logs = np.log(squares)
    whole = np.isfinite(logs).all(axis=1)
    levels = logs[:, ::2].mean(axis=1)
    limit = float(chdtri(len(logs) - 1, _SELDOM))
    if not whole.all() or _chi_square(levels, shares / (level @ covariance @ level)) > limit:
        weight = shares * np.exp(levels - levels.max())
        widening = max(1.0, float(np.sqrt(weight.size * np.sum(weight**2)) / np.sum(weight)))
        notes.append(
            f"parts of the face are not equally rough: the interval is {widening:.2f} times as wide as that "
            "of a Gaussian face"
        )
    exponents = logs[whole] @ slope
    inverse = shares[whole] / (slope @ covariance @ slope)
    limit = float(chdtri(max(exponents.size - 1, 1), _SELDOM))
    if exponents.size > 1 and _chi_square(exponents, inverse) > limit:
        low, high = (float(q) for q in np.quantile(exponents, (0.25, 0.75)))
        notes.append(
            "the exponent differs from part to part of the face: the interval holds the middle half of them, "
            f"{low:.2f} to {high:.2f}"
        )
    return Evenness(widening, low, high, "; ".join(notes))


def _covariance(moments: Moments, steps: tuple[float, ...], hurst: float, parts: int) -> Array:
    """Return the covariance of the logarithms for one of so many parts of a complete face."""
    whole = complete_covariance(hurst, moments.shape, steps, 2, moments.step)
    # lags along x come first here
    kinds = [len(LAGS) * axis + lag for axis in reversed(range(len(steps))) for lag in (0, 1)]
    return np.asarray(parts * whole[np.ix_(kinds, kinds)])


def _chi_square(values: Array, weights: Array) -> float:
    mean = float(np.sum(weights * values) / np.sum(weights))
    return float(np.sum(weights * (values - mean) ** 2))
