"""Dimension of a boundary from the short-lag variogram of the indicator; arrays in and out."""

from __future__ import annotations

import numpy as np
from scipy import stats

from fractalcontact.base.grid import Grid
from fractalcontact.domains._masks import Array

# pairs along the axes and along the diagonals, at one step and at two
OFFSETS = np.array([(0, 1), (1, 0), (0, 2), (2, 0), (1, 1), (1, -1), (2, 2), (2, -2)], np.int64)
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
    """Return the share of pairs that differ: axes at one step and two, diagonals at one step and two."""
    joined = [values.reshape(*values.shape[:-1], 4, 2).sum(-1) for values in (pairs, differing)]
    return np.asarray(joined[1] / np.maximum(joined[0], 1))


def exponent(share: Array) -> Array:
    """Return d ln share / d ln lag, the mean over four axial and two diagonal directions.

    Each direction keeps its own level: it is the doubling of the lag that counts, whatever the spacings.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log2(share)
    return np.asarray((2.0 * (logs[..., 1] - logs[..., 0]) + logs[..., 3] - logs[..., 2]) / 3.0)


def dimension(pairs: Array, differing: Array) -> tuple[float, float]:
    """Return the dimension of the boundary and the half-width of its 95 % interval.

    The interval is from the delete-one-block jackknife, with the degrees of freedom that the blocks' shares
    in the variance leave (Satterthwaite). Two things are added that blocks do not see: the bend of the curve
    where a good part of all pairs differ already, and for smooth boundaries what whole surfaces differ by.
    Both were set on level sets of exact Brownian surfaces.
    """
    share = shares(pairs.sum(0), differing.sum(0))
    if not np.all(share > 0):
        return np.nan, np.nan
    raw = float(exponent(share))
    used = pairs.sum(-1) > 0
    rest = shares(pairs.sum(0) - pairs, differing.sum(0) - differing)[used]
    if differing[:, :2].sum() < FEWEST or len(rest) < 2 or not np.all(rest > 0):
        return 2.0 - raw, np.nan
    left = exponent(rest)
    departure = (left - left.mean()) ** 2
    total = float(departure.sum())
    if total == 0.0:
        return 2.0 - raw, 0.0
    error = np.sqrt((left.size - 1) / left.size * total) * (1.0 + WIDER * max(0.0, SMOOTH - (2.0 - raw)))
    freedom = max(total**2 / float((departure**2).sum()), 1.0)
    bend = raw - 0.5 * float(exponent(1.0 - np.cos(np.pi * np.minimum(share, 0.5))))
    return 2.0 - raw, float(np.hypot(stats.t.ppf(0.975, freedom) * error, 1.5 * bend))
