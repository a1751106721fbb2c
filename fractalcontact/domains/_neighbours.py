"""What lies near a set: its area grown by a radius, and the mass around its cells; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.grid import Grid
from fractalcontact.domains import _covers, _dust
from fractalcontact.domains._masks import Array


def grown_area(cells: Array, valid: Array | None, grid: Grid, radii: Array) -> Array:
    """Return the area, in cells, within each radius of the set, (radii,); all zero for an empty plane.

    Radii are in edges of a square as large as a cell. A cell whose centre lies at the distance d from that of
    the nearest one of the set counts by r - d + 1/2, at most as a whole, so that the area about a row grows
    as the radius. Beyond a free edge, and where nothing was observed, the area is taken to be the mirror
    image of that on the other side of the nearest cell of the set.
    """
    if not cells.any():
        return np.zeros(radii.size)
    side = np.sqrt(grid.cell_area)
    steps = [spacing / side for spacing in grid.spacing]
    counts = offsets(cells, valid, [int((radii.max() + 0.5) / step) for step in steps], steps, grid.periodic)
    rows, columns = (np.arange(n) * step for n, step in zip(counts.shape, steps, strict=True))
    distance = np.hypot(rows[:, None], columns).ravel()
    return np.asarray((np.clip(radii[:, None] - distance + 0.5, 0.0, 1.0) * counts.ravel()).sum(-1))


def offsets(
    cells: Array,
    valid: Array | None,
    reach: Sequence[int],
    steps: Sequence[float],
    periodic: Sequence[bool],
) -> Array:
    """Count the observed cells by how many rows and columns the nearest cell of the set is away.

    Looks `reach` (rows, columns) far; `steps` are the spacings. Cells without an observed mirror image about
    a nearest cell of the set count twice.
    """
    from fractalcontact.domains._near_kernels import above_and_below, count_offsets

    above, below = np.empty((2, *cells.shape), np.int16 if max(reach) < NARROW else np.int32)
    above_and_below(cells, reach[0], periodic[0], above, below)
    observed = np.broadcast_to(np.uint8(1), cells.shape) if valid is None else valid
    high, wide = ((np.arange(n + 1) * step) ** 2 for n, step in zip(reach, steps, strict=True))
    counts = np.zeros((reach[0] + 1, reach[1] + 1), np.int64)
    count_offsets(above, below, observed, high, wide, periodic[0], periodic[1], counts)
    return counts


NARROW = 2**14  # cells of reach that short numbers hold


def dust_area(cells: float, observed: float, grid: Grid, radii: Array) -> Array:
    """Return the area that a dust of as many cells, far from any edge, grows to; see `grown_area`."""
    side = np.sqrt(grid.cell_area)
    dy, dx = (spacing / side for spacing in grid.spacing)
    reach = radii.max() + 0.5
    rows, columns = (np.arange(-int(reach / step), int(reach / step) + 1) * step for step in (dy, dx))
    around = np.hypot(rows[:, None], columns).ravel()
    steps, counts = np.unique(around[around < reach], return_counts=True)
    # at a distance between two steps the disc holds the cells up to the first of them
    missed = _dust.missed(cells, observed, np.minimum(np.cumsum(counts), observed))
    weight = np.clip(radii[:, None] - steps + 0.5, 0.0, 1.0)
    found = -np.diff(missed, prepend=1.0)
    return np.asarray(observed * (weight * found).sum(-1))


def mean_mass(cells: Array, valid: Array | None, grid: Grid, sizes: Array) -> Array:
    """Return the mean number of cells of the set in the square of each size about one of them; (sizes,).

    Pairs of cells are counted by their distance along y and x, and made up for those that the edges of the
    plane or unobserved cells keep out: pairs of the set over pairs observed. A pair on the outline of a
    square of an even number of cells counts half. NaN for an empty plane.
    """
    mass = int(np.count_nonzero(cells))
    if mass == 0:
        return np.full(sizes.size, np.nan)
    reach = int(sizes.max()) // 2
    observed = np.ones_like(cells) if valid is None else valid
    pairs, seen = (_pairs(plane, grid, reach) for plane in (cells, observed))
    share = np.where(seen > 0, pairs / np.maximum(seen, 1.0), 0.0) * (np.count_nonzero(observed) / mass)
    lags = np.abs(np.arange(-reach, reach + 1))
    weight = np.clip((sizes[:, None] + 1) / 2.0 - lags, 0.0, 1.0)
    return np.asarray(np.einsum("si,ij,sj->s", weight, share, weight))


def _pairs(plane: Array, grid: Grid, reach: int) -> Array:
    """Count pairs of cells up to `reach` apart along y and x, (2 reach + 1, 2 reach + 1)."""
    shape = [
        n if wraps else fft.fast_length(n + reach)
        for n, wraps in zip(plane.shape, grid.periodic, strict=True)
    ]
    padded = np.zeros(shape)
    padded[: plane.shape[0], : plane.shape[1]] = plane
    modes = fft.rfft2(padded)
    pairs = np.rint(fft.irfft2(modes * modes.conj(), (shape[0], shape[1]), overwrite=True))
    lags = np.arange(-reach, reach + 1)
    return np.asarray(pairs[np.ix_(lags % shape[0], lags % shape[1])])


def null_mass(cells: float, observed: float, sizes: Array) -> Array:
    """Return the mean mass about a cell of a dust of as many cells; see `mean_mass`."""
    if cells < 1:
        return np.full(sizes.size, np.nan)
    return np.asarray(1.0 + (sizes.astype(float) ** 2 - 1.0) * (cells - 1.0) / max(observed - 1.0, 1.0))


def fit(scales: Array, curves: Array, sign: float) -> tuple[Array, Array]:
    """Return 0 or 2 plus the slope of each curve (planes, scales), and the half-width of its interval.

    The slope is that of least squares in logarithms, and the half-width 2.5 standard deviations of the local
    slopes. `sign` is 1 for a mass that grows as s^D and -1 for an area that grows as s^(2 - D).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.where(curves > 0, np.log(curves), np.nan)
    if scales.size < 2:
        return np.full(len(curves), np.nan), np.full(len(curves), np.nan)
    slope, spread, _ = _covers.line(np.log(scales / scales[0]), logs)
    return np.asarray((0.0 if sign > 0 else 2.0) + sign * slope), DEVIATIONS * spread + ROUNDING


DEVIATIONS = 2.5  # of the local slopes to either side
ROUNDING = 1e-14  # no interval is narrower


def notes(name: str, known: Array, scales: int, what: str) -> dict[str, dict[str, str]]:
    """Return the meanings of a dimension's companions, and why it is NaN where it is."""
    words = name.replace("_", " ").capitalize().replace("Correlation", "correlation")
    interval = f"interval of the {words} ({DEVIATIONS:g} standard deviations of the local slopes)"
    found = {
        "ci_low": {"long_name": f"lower end of the {interval}"},
        "ci_high": {"long_name": f"upper end of the {interval}"},
        "scale_min": {"units": "1", "long_name": f"smallest {what} of the fit, in cells"},
        "scale_max": {"units": "1", "long_name": f"largest {what} of the fit, in cells"},
        "null_dimension": {"long_name": f"{words} of a random dust of equal coverage"},
    }
    if scales < 2:
        found[name] = {"comment": "NaN: one scale gives no slope"}
    elif not known.all():
        found[name] = {"comment": f"NaN where the set is empty ({int((~known).sum())} planes)"}
    return found
