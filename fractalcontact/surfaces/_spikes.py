"""Points of a scan that stand out from all around them, arrays only."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.polynomial import detrended

Array = np.ndarray[Any, np.dtype[Any]]

PASSES = 20
GAUSSIAN = 1.4826  # standard deviation over the median absolute deviation of a Gaussian


def spikes(heights: Array, window: int, threshold: float) -> tuple[Array, float]:
    """Return which points are spikes, and the robust standard deviation of the residual.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where missing.
    window : int
        Odd edge of the square, in cells, whose median a point is compared with.
    threshold : float
        In robust standard deviations.

    Notes
    -----
    What was flagged no longer counts in the medians of the next pass, so that a spike of several points is
    taken from its edge inwards. The scale of the residual is that of the first pass.
    """
    # a slope would make the points beside a missing one stand out
    heights = detrended(heights, 1)[0]
    flagged = np.zeros(heights.shape, dtype=bool)
    kept, usual = heights.copy(), 0.0
    for number in range(PASSES):
        residual = np.abs(heights - _medians(kept, window))
        if number == 0:
            usual = GAUSSIAN * float(np.nanmedian(residual))
        new = (residual > threshold * usual) & ~flagged
        if usual == 0 or not new.any():
            break
        flagged |= new
        kept[flagged] = np.nan
    return flagged, usual


def _medians(heights: Array, window: int) -> Array:
    """Return the median of the square about every point; the face goes on at its edge with its slope."""
    half = window // 2
    padded = np.pad(heights, half, mode="reflect", reflect_type="odd")
    found = np.empty(heights.shape)
    for i in range(heights.shape[0]):  # by rows, which bounds the memory
        band = np.lib.stride_tricks.sliding_window_view(padded[i : i + window], window, axis=1)
        found[i] = _row_medians(np.moveaxis(band, 0, 1).reshape(heights.shape[1], -1))
    return found


def _row_medians(values: Array) -> Array:
    """Return the median of every row, NaN left out; NaN where there is nothing else."""
    ordered = np.sort(values, axis=1)  # NaN last
    count = np.count_nonzero(np.isfinite(ordered), axis=1)
    rows, last = np.arange(len(ordered)), np.maximum(count - 1, 0)
    middle = 0.5 * (ordered[rows, last // 2] + ordered[rows, (last + 1) // 2])
    return np.where(count > 0, middle, np.nan)
