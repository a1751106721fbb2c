"""Quantisation of heights: the step to which they were rounded, detected from the heights alone."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

_ROWS, _SAMPLE = 16, 4096  # rows and heights looked at
_TOLERANCE = 0.02  # of a step: distance of heights from whole steps, after a change of unit
_RESOLVED = 0.47  # rms increments over a step from which on the errors of rounding are white noise
_LARGEST_SHARE = 0.5  # of distinct heights among all: more are no rounded heights


def quantisation(heights: Array) -> tuple[float, float]:
    """Return the step of rounded heights, and its share of the mean square second difference.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where missing.

    Returns
    -------
    step, share : float
        0 where heights were not rounded.

    Notes
    -----
    A few rows from all of the surface are inspected. Rounding to steps q adds a variance q^2 / 12, nearly
    independent from point to point while neighbours differ by more than about a step, hence 6 q^2 / 12 to a
    second difference.
    """
    every = max(1, heights.shape[0] // _ROWS)
    rows = heights[::every]
    sample = rows[:, :: -(-rows.size // _SAMPLE)]
    observed = sample[np.isfinite(sample)]
    levels = np.unique(observed)
    if observed.size < 8 or levels.size < 2 or levels.size > _LARGEST_SHARE * observed.size:
        return 0.0, 0.0
    gaps = np.diff(levels)
    step = float(gaps[gaps > _TOLERANCE * np.median(gaps)].min())
    multiples = (levels - levels[0]) / step
    if np.abs(multiples - np.rint(multiples)).max() > _TOLERANCE:
        return 0.0, 0.0
    bends = np.diff(rows, 2, axis=1)
    square = float(np.nanmean(bends * bends)) if np.isfinite(bends).any() else 0.0
    return (step, 0.5 * step * step / square) if square > 0.0 else (0.0, 0.0)


def resolved_lag(heights: Array, step: float) -> int:
    """Return the least lag, a power of two, over which heights differ by half a step of rounding; 0 if none.

    They differ by the root of the mean square less that of the rounding, step^2 / 6.
    """
    lag = 1
    while lag <= heights.shape[1] // 4:
        square = float(np.nanmean((heights[:, lag:] - heights[:, :-lag]) ** 2)) - step * step / 6.0
        if square > (_RESOLVED * step) ** 2:
            return lag
        lag *= 2
    return 0


def quantisation_note(share: float, interval: str) -> str:
    """Return the note on rounded heights; `interval` names what the widened interval holds."""
    return (
        f"heights are rounded to steps, which make {100.0 * min(share, 1.0):.2g} % of the mean square second "
        f"difference: the interval also holds {interval}"
    )


def rounding_note(heights: Array, error: float) -> str:
    """Return a note where the heights were rounded so coarsely that it matters; empty otherwise."""
    share = quantisation(heights)[1]
    return quantisation_note(share, "the exponent of a fit with white noise") if share > 0.5 * error else ""
