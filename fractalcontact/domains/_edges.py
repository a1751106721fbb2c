"""Dimension of a boundary from the short-lag variogram of the indicator; arrays in and out."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from fractalcontact.base.grid import Grid
from fractalcontact.domains._masks import Array

# pairs along the axes and along the diagonals, at one step and at two
OFFSETS = np.array([(0, 1), (1, 0), (0, 2), (2, 0), (1, 1), (1, -1), (2, 2), (2, -2)], np.int64)
ONCE, TWICE = [0, 1, 4, 5], [2, 3, 6, 7]
BLOCKS = 4  # along each axis, for the jackknife
FEWEST = 200  # differing neighbours below which no interval is given
SMOOTH, WIDER = 1.3, 2.0  # below this dimension blocks are not independent: wider by so much for each unit


def count(cells: Array, valid: Array | None, grid: Grid) -> tuple[Array, Array]:
    """Return observed pairs and differing pairs, (blocks, offsets)."""
    from fractalcontact.domains._edge_kernels import switches

    shape = (BLOCKS, BLOCKS, len(OFFSETS))
    pairs, differing = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    observed = np.ones_like(cells) if valid is None else valid
    wrap_y, wrap_x = grid.periodic
    switches(cells, observed, OFFSETS, wrap_y, wrap_x, pairs, differing)
    return pairs.reshape(-1, len(OFFSETS)), differing.reshape(-1, len(OFFSETS))


def shares(pairs: Array, differing: Array) -> Array:
    """Return the share of pairs that differ, for every offset."""
    return np.asarray(differing / np.maximum(pairs, 1))


def exponent(share: Array) -> Array:
    """Return d ln share / d ln lag, the mean over two axial and two diagonal directions.

    Each direction keeps its own level: it is the doubling of the lag that counts, whatever the spacings.
    Directions weigh by the inverse third power of the share at one step: across the tilt of a smooth surface
    the boundary is crossed often, and tells more of the tilt than of its roughness. A direction in which
    nothing is crossed has no say; NaN if that is so in all.
    """
    one, two = share[..., ONCE], share[..., TWICE]
    crossed = one > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.where(crossed, np.log2(two / one), 0.0)
        least = np.min(np.where(crossed, one, np.inf), axis=-1, keepdims=True)
        weights = np.where(crossed, (least / one) ** 3, 0.0)
        return np.asarray((weights * logs).sum(-1) / weights.sum(-1))


def dimension(pairs: Array, differing: Array) -> tuple[float, float]:
    """Return the dimension of the boundary and the half-width of its 95 % interval.

    The interval is from the delete-one-block jackknife, with the degrees of freedom that the blocks' shares
    in the variance leave (Satterthwaite). Two things are added that blocks do not see: the bend of the curve
    where a good part of all pairs differ already, and for smooth boundaries what whole surfaces differ by.
    Both were set on level sets of exact Brownian surfaces.
    """
    share = shares(pairs.sum(0), differing.sum(0))
    raw = float(exponent(share))
    if not np.isfinite(raw):
        return np.nan, np.nan
    used = pairs.sum(-1) > 0
    rest = shares(pairs.sum(0) - pairs, differing.sum(0) - differing)[used]
    left = exponent(rest)
    if differing[:, :2].sum() < FEWEST or left.size < 2 or not np.all(np.isfinite(left)):
        return 2.0 - raw, np.nan
    departure = (left - left.mean()) ** 2
    total = float(departure.sum())
    if total == 0.0:
        return 2.0 - raw, 0.0
    error = np.sqrt((left.size - 1) / left.size * total) * (1.0 + WIDER * max(0.0, SMOOTH - (2.0 - raw)))
    freedom = max(total**2 / float((departure**2).sum()), 1.0)
    bend = raw - 0.5 * float(exponent(1.0 - np.cos(np.pi * np.minimum(share, 0.5))))
    return 2.0 - raw, float(np.hypot(stdtrit(freedom, 0.975) * error, 1.5 * bend))
