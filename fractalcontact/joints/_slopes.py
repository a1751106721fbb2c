"""Slope of a curve on any points, and over which length it was taken."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


def neighbour_slopes(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the slope through the neighbours of every point, and the length between them.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Ascending, n >= 2.
    y : ndarray, shape (n, m)
        Curves, one in each column.

    Returns
    -------
    slopes : ndarray, shape (n, m)
        Of second order inside, also for unequal steps; of first order at the ends.
    lengths : ndarray, shape (n,)
    """
    ends = np.concatenate([x[:1], x, x[-1:]])
    return np.gradient(y, x, axis=0), ends[2:] - ends[:-2]


def fitted_slopes(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Return the least-squares slope of y(x) in a window centred on every point.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Ascending, n >= 2.
    y : ndarray, shape (n, m)
        Curves, one in each column.
    window : float
        Width of the window. Where it holds no second point, the nearest one is taken in.

    Returns
    -------
    slopes : ndarray, shape (n, m)
        Exact for straight lines.
    lengths : ndarray, shape (n,)
        Length between the outermost points of each fit.
    """
    # a width given as a decimal must not lose a neighbour to rounding, nor one of two equally near ones
    more = 1.0 + 1e-9
    slopes, lengths = np.empty(y.shape), np.empty(x.shape)
    for index, centre in enumerate(x):
        distance = np.abs(x - centre)
        inside = distance <= more * max(0.5 * window, np.sort(distance)[1])
        offset = x[inside] - x[inside].mean()
        slopes[index] = offset @ (y[inside] - y[index]) / (offset @ offset)
        lengths[index] = np.ptp(x[inside])
    return slopes, lengths
