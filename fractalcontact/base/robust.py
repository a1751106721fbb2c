"""Outliers of a few numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LIMIT = 3.5  # of the modified z: Iglewicz and Hoaglin (1993), How to detect and handle outliers
QUARTILE = 0.6745  # quantile 0.75 of the normal distribution, the median of its distances from the median
FEWEST = 5  # values: of fewer, one that lies apart may well be half of them


def is_far(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of the values lie far from all others: a modified z beyond 3.5; none of a few values."""
    is_finite = np.isfinite(values)
    if is_finite.sum() < FEWEST:
        return np.zeros(values.shape, dtype=bool)
    distance = np.abs(values - np.median(values[is_finite]))
    return np.asarray(is_finite & (QUARTILE * distance > LIMIT * np.median(distance[is_finite])))
