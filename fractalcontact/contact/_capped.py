"""Keeping the force where pressures are bounded by the hardness."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

SHIFTS = 200


def lowest(level: Array, wanted: float, cap: float) -> Array:
    """Even pressure on the lowest nodes, as many as can carry what is wanted with some to spare."""
    enough = min(level.size, max(1, int(np.ceil(1.1 * wanted / cap))))
    pressure = np.zeros(level.shape)
    pressure.ravel()[np.argpartition(level.ravel(), enough - 1)[:enough]] = wanted / enough
    return pressure


def shifted(values: Array, wanted: float, cap: float) -> Array:
    """Shift values by one amount so that, cut to 0 .. cap, they add up to what is wanted.

    The sum falls with the shift along straight lines; Newton's method, kept between its bounds, ends after
    a few steps.
    """
    low, high, shift = float(values.min()) - cap, float(values.max()), 0.0
    moved = np.clip(values, 0.0, cap)
    for _ in range(SHIFTS):
        excess = float(np.sum(moved)) - wanted
        low, high = (shift, high) if excess > 0 else (low, shift)
        slack = int(np.count_nonzero((moved > 0) & (moved < cap)))
        better = shift + excess / slack if slack else np.inf
        better = better if low < better < high else 0.5 * (low + high)
        if better == shift or abs(excess) <= 1e-15 * wanted:
            break
        shift = better
        moved = np.clip(values - shift, 0.0, cap)
    # what rounding of the values left is shared in proportion by the nodes inside the bounds
    inside = (moved > 0) & (moved < cap)
    bearing = float(np.sum(moved, where=inside))
    if bearing > 0:
        factor = (wanted - float(np.sum(moved, where=~inside))) / bearing
        moved[inside] = np.clip(moved[inside] * factor, 0.0, cap)
    return np.asarray(moved)
