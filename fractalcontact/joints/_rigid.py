"""Rigid dilatancy: how far a rigid block is lifted when it slides. No solver, only differences of heights."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.polynomial import slopes
from fractalcontact.joints._sliding import Block, Pair, heights_under

Array = np.ndarray[Any, np.dtype[Any]]


def separations(lower: Array, upper: Array, block: Block, shears: Array, unit: Pair) -> Array:
    """Return max over the block of (lower(x + v) - upper(x)) for every shear.

    Parameters
    ----------
    lower : ndarray, shape (ny, nx)
        The whole lower face, m.
    upper : ndarray, shape block.cells
        The block's own face, m.
    block : Block
    shears : ndarray, shape (n,)
        Metres, inside the travel.
    unit : pair of float
        Direction of sliding, (y, x).

    Returns
    -------
    ndarray, shape (n,)
        Metres; NaN where heights are missing in the path.
    """
    difference = np.empty(block.cells)
    highest = np.empty(shears.shape)
    for index, shear in enumerate(shears):
        under = heights_under(lower, block, block.shift(float(shear), unit))
        highest[index] = np.subtract(under, upper, out=difference).max()
    return highest


def mean_slopes(face: Array, block: Block) -> Pair:
    """Return the slopes (y, x) of the mean plane of a face; zero along an axis that wraps.

    Missing heights are left out.
    """
    found = slopes(face, block.spacing)
    return tuple(0.0 if wraps else slope for slope, wraps in zip(found, block.wraps, strict=True))  # type: ignore[return-value]
