"""Outliers of a few numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def is_far(values: NDArray[np.float64], limit: float = 3.5) -> NDArray[np.bool_]:
    """Return which of the values lie far from all others: a modified z beyond 3.5; none of a few values.

    z is 0.6745 times the distance from the median over the median distance, which is 0.6745 of a normal
    distribution (Iglewicz and Hoaglin 1993, How to detect and handle outliers).
    """
    is_finite = np.isfinite(values)
    if is_finite.sum() < 5:  # of fewer, one that lies apart may well be half of them
        return np.zeros(values.shape, dtype=bool)
    distance = np.abs(values - np.median(values[is_finite]))
    return np.asarray(is_finite & (0.6745 * distance > limit * np.median(distance[is_finite])))
