"""Heights that were rounded to steps: a noise that no one asked for, found from the heights alone."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

_SAMPLE, _ROWS = 4096, 16
_SLACK = 0.02  # of a step: how far heights may lie off it, for having changed their unit
_HALF = 0.5


def quantum(heights: Array) -> tuple[float, float]:
    """Return the step of rounded heights, and its part in the mean square second difference; 0 if none.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where missing.

    Notes
    -----
    A few rows are looked at. Rounding to steps q adds a variance of q^2 / 12 that hardly depends from point
    to point while neighbours differ by more than a step or so, hence 6 q^2 / 12 to a second difference.
    """
    every = max(1, heights.shape[0] // _ROWS)
    rows = heights[::every]
    rows = rows[:, : _SAMPLE // min(len(rows), _ROWS)]
    seen = rows[np.isfinite(rows)]
    levels = np.unique(seen)
    if seen.size < 8 or levels.size < 2 or levels.size > _HALF * seen.size:
        return 0.0, 0.0
    gaps = np.diff(levels)
    step = float(gaps[gaps > _SLACK * np.median(gaps)].min())
    places = (levels - levels[0]) / step
    if np.abs(places - np.rint(places)).max() > _SLACK:
        return 0.0, 0.0
    bends = np.diff(rows, 2, axis=1)
    square = float(np.nanmean(bends * bends)) if np.isfinite(bends).any() else 0.0
    return (step, 0.5 * step * step / square) if square > 0.0 else (0.0, 0.0)


def told(share: float, what: str) -> str:
    """Return the note on rounded heights."""
    return (
        f"heights are rounded to steps, which make {100.0 * min(share, 1.0):.2g} % of the mean square second "
        f"difference: the interval also holds {what}"
    )
