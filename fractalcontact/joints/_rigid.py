"""Rigid dilatancy: how far a rigid block is lifted when it slides. No solver, only differences of heights."""

from __future__ import annotations

from typing import Any

import numpy as np

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
    """Return the slopes (y, x) of the least-squares plane of a face; zero along an axis that wraps.

    Missing heights are left out.
    """
    middle = face[tuple(start + size // 2 for start, size in zip(block.start, block.cells, strict=True))]
    seen = np.isfinite(face)
    heights = np.where(seen, face - middle, 0.0)
    count = seen.sum()
    y = np.where(seen, np.arange(block.face[0])[:, None] - (block.face[0] - 1) / 2, 0.0)
    x = np.where(seen, np.arange(block.face[1])[None, :] - (block.face[1] - 1) / 2, 0.0)
    y -= np.where(seen, y.sum() / count, 0.0)
    x -= np.where(seen, x.sum() / count, 0.0)
    yy, xx, xy = (y * y).sum(), (x * x).sum(), (x * y).sum()
    yz, xz = (y * heights).sum(), (x * heights).sum()
    if any(block.wraps):
        xy = 0.0  # a periodic axis has no slope, and the other is fitted alone
    determinant = xx * yy - xy * xy
    slope_y = 0.0 if block.wraps[0] else (xx * yz - xy * xz) / determinant / block.spacing[0]
    slope_x = 0.0 if block.wraps[1] else (yy * xz - xy * yz) / determinant / block.spacing[1]
    return float(slope_y), float(slope_x)
