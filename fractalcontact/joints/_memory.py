"""What facing heights still know of each other: correlation after a shear, and when it is gone.

Heights count from the mean plane of their whole face. Sums are kept for tiles of the block, so that an
interval can be made by leaving tiles out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.joints._sliding import Block, Pair, heights_under

Array = np.ndarray[Any, np.dtype[Any]]

FORGOTTEN = math.exp(-1.0)  # correlation, over that at no shear, at which the faces have forgotten each other
FINE, COARSE = 8, 4  # tiles along an edge of the block
LEAST_LENGTHS = 15.0  # lengths in an edge of the block, below which the interval is not honest
QUANTILE = 2.776  # of Student's t for 4 degrees of freedom: checked to cover 95 % on faces of known length


@dataclass(frozen=True)
class Sums:
    """Sums over every tile, shape (shear, tile): products of facing heights, their squares."""

    product: Array
    lower: Array
    upper: Array

    def correlation(self, kept: Array) -> Array:
        """Return the correlation at every shear from the kept tiles (weights 0 or 1)."""
        product, lower, upper = (part @ kept for part in (self.product, self.lower, self.upper))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(product / np.sqrt(lower * upper))


@dataclass(frozen=True)
class Length:
    """Decorrelation length and its 95 % interval, or why there is none."""

    value: float
    low: float = math.nan
    high: float = math.nan
    reason: str = ""


def tile_sums(lower: Array, upper: Array, block: Block, shears: Array, unit: Pair) -> tuple[Sums, Array]:
    """Return the sums over tiles, and the variance of the delta-surface, at every shear.

    Parameters
    ----------
    lower : ndarray, shape (ny, nx)
        Heights of the whole lower face from its mean plane.
    upper : ndarray, shape block.cells
        Heights of the block's face from the mean plane of the upper face.
    """
    tiles = FINE if min(block.cells) >= FINE else 1
    count = tiles * tiles
    product, squares = np.empty((shears.size, count)), np.empty((shears.size, count))
    variance = np.empty(shears.size)
    for index, shear in enumerate(shears):
        under = heights_under(lower, block, block.shift(float(shear), unit))
        product[index], squares[index] = _over_tiles(under * upper, tiles), _over_tiles(under * under, tiles)
        variance[index] = np.var(under - upper)
    own = np.broadcast_to(_over_tiles(upper * upper, tiles), (shears.size, count))
    return Sums(product, squares, own), variance


def _over_tiles(plane: Array, tiles: int) -> Array:
    for axis in (0, 1):
        starts = np.arange(tiles) * plane.shape[axis] // tiles
        plane = np.add.reduceat(plane, starts, axis=axis)
    return plane.ravel()


def decorrelation(sums: Sums, shears: Array, edge: float) -> Length:
    """Return the shear at which the correlation has fallen to 1/e of that at no shear.

    The interval comes from the spread, in the logarithm, of the length without one tile. The spread with 8
    and with 4 tiles along an edge is extrapolated to few, wide ones, which know least of each other.
    """
    tiles = sums.product.shape[1]
    value = _crossing(sums.correlation(np.ones(tiles)), shears)
    if not np.isfinite(sums.correlation(np.ones(tiles))[0]):
        return Length(math.nan, reason="the faces are planes")
    if math.isnan(value):
        return Length(value, reason="the faces still remember each other at the greatest shear")
    if value < shears[1]:
        return Length(value, reason="no interval: the length is below the first shear")
    if tiles < FINE * FINE:
        return Length(value, reason="no interval: the block has too few cells")
    if edge < LEAST_LENGTHS * value:
        return Length(value, reason=f"no interval: the block is less than {LEAST_LENGTHS:g} lengths wide")
    fine, coarse = (_spread(sums, shears, side) for side in (FINE, COARSE))
    reach = QUANTILE * math.sqrt(max(2.0 * coarse - fine, coarse))
    if not math.isfinite(reach):
        return Length(value, reason="no interval: without a part of the block the faces remember each other")
    return Length(value, value * math.exp(-reach), value * math.exp(reach))


def _spread(sums: Sums, shears: Array, side: int) -> float:
    """Return the jackknife variance of the logarithm of the length, with side * side tiles left out."""
    row = np.arange(FINE) * side // FINE
    group = (row[:, None] * side + row[None, :]).ravel()
    lengths = [
        _crossing(sums.correlation((group != tile).astype(float)), shears) for tile in range(side * side)
    ]
    with np.errstate(invalid="ignore"):
        return float((side * side - 1) * np.var(np.log(lengths)))


def _crossing(correlation: Array, shears: Array) -> float:
    """Return where the correlation first falls to 1/e of its first value, linear between the shears."""
    if not correlation[0] > 0:
        return math.nan
    excess = correlation / correlation[0] - FORGOTTEN
    below = np.flatnonzero(excess <= 0)
    if below.size == 0:
        return math.nan
    k = int(below[0])
    part = excess[k - 1] / (excess[k - 1] - excess[k])
    return float(shears[k - 1] + part * (shears[k] - shears[k - 1]))
