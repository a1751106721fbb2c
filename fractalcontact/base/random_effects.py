"""Mean of measurements that scatter more than their errors say: random effects (meta-analysis).

Every value is x_i = mu + b_i + e_i: the scatter between the measured objects has Var b = tau^2, the known
error within each Var e_i = s_i^2.

References
----------
Paule and Mandel (1982), J. Res. Natl. Bur. Stand. 87, 377: tau^2.
Hartung and Knapp (2001), Stat. Med. 20, 3875; Sidik and Jonkman (2002), Stat. Med. 21, 3153: the interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class RandomEffects:
    """Mean with its interval, scatter between (tau) and mean error within, share of tau^2, and the number."""

    mean: float
    low: float
    high: float
    between: float
    within: float
    heterogeneity: float
    count: int


def random_effects(values: ArrayLike, errors: ArrayLike = 0.0, level: float = 0.95) -> RandomEffects:
    """Return the random-effects mean of values with the standard errors of each, of those that are finite.

    Values without errors have the mean and the interval of Student. One value alone has the interval of its
    error, if it has one.
    """
    from scipy.special import ndtri, stdtrit

    x, s = np.broadcast_arrays(np.asarray(values, dtype=float), np.asarray(errors, dtype=float))
    is_finite = np.isfinite(x) & np.isfinite(s)
    x, variance = x[is_finite], s[is_finite] ** 2
    count = x.size
    if count < 2:
        mean = float(x[0]) if count else np.nan
        half = ndtri(0.5 + level / 2) * np.sqrt(variance[0]) if count and variance[0] > 0 else np.nan
        within = float(s[is_finite].mean()) if count else np.nan
        return RandomEffects(mean, mean - half, mean + half, np.nan, within, np.nan, count)
    tau2, within = _between(x, variance), float(np.sqrt(variance.mean()))
    total = variance + tau2
    if not total.all():  # equal values, some without errors
        return RandomEffects(float(x[0]), float(x[0]), float(x[0]), 0.0, within, 0.0, count)
    weight = 1.0 / total
    mean = float(weight @ x / weight.sum())
    # the q of Hartung and Knapp, at least 1: otherwise values that agree by chance have too short an interval
    q = max(1.0, float(weight @ (x - mean) ** 2) / (count - 1))
    half = float(stdtrit(count - 1, 0.5 + level / 2) * np.sqrt(q / weight.sum()))
    return RandomEffects(
        mean, mean - half, mean + half, float(np.sqrt(tau2)), within, tau2 / (tau2 + within**2), count
    )


def _between(x: np.ndarray, variance: np.ndarray) -> float:
    """Return tau^2, for which the weighted squares about the mean add up to n - 1; 0 if they are less."""
    from scipy.optimize import brentq

    def excess(tau2: float) -> float:
        weight = 1.0 / (variance + tau2)
        return float(weight @ (x - weight @ x / weight.sum()) ** 2) - (x.size - 1)

    spread = float(x.var(ddof=1))
    if spread == 0.0 or (variance.min() > 0 and excess(0.0) <= 0.0):
        return 0.0
    # with tau^2 of n times the variance of the values, their weighted squares add up to less than n - 1
    lowest = 0.0 if variance.min() > 0 else 1e-12 * spread
    highest = x.size * spread
    return float(brentq(excess, lowest, highest, xtol=1e-12 * spread)) if excess(lowest) > 0 else lowest
