"""Correlation dimension: how the mean number of cells of a set around one of them grows with distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.grid import Grid
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.spectra import lagged_products
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._lacunarity import BLOCKS
from fractalcontact.domains._masks import Array, Planes
from fractalcontact.domains._scaling_fit import default_sizes, dimension_variables, fit_notes, fit_power_law

SOURCE = (
    "Grassberger and Procaccia, Physica D 9:189 (1983); Ohser, Math. Operationsforsch. Statist. 14:63 (1983) "
    "(correction for the edge)"
)


def _check(problems: Problems) -> None:
    _masks.check_mask(problems, profiles=True)
    _masks.check_box_sizes(problems, min(_masks.mask_sides(problems.given.mask)))


@public_result(title="Correlation dimension", references=SOURCE, check=_check)
def correlation_dimension(
    mask: xr.DataArray,
    *,
    box_sizes: Any = None,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Correlation dimension of a set of cells, from the pairs of cells at every distance.

    The mean number of cells of the set in a square (of a profile, an interval) of edge s about one of them
    grows as s^D. Pairs are counted by a Fourier transform. Each distance is corrected for the pairs that the
    edges of the plane and unobserved cells leave out.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        Boolean, or integer flags where contact means value > 0.
    box_sizes : sequence of int, optional
        Edges of the squares in cells; by default products of 2 and 3 up to the geometric mean of the cell and
        the extent, at least to 9. A cell on the outline of a square of an even number of cells counts by its
        part inside.
    periodic : bool, optional
        Whether pairs wrap around the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells; only pairs of them count.

    Returns
    -------
    Dataset
        Over the leading dims: `correlation_dimension`, the least-squares slope of ln mass over ln s; `ci_low`
        and `ci_high`, 2.5 standard deviations of the local slopes to either side (NaN for two sizes);
        `scale_min`, `scale_max` (cells); `coverage`; `null_dimension`, of the random null of equal coverage.
        Over `box_size` (cells; `box_length` in m) too: `mean_mass`; `local_slope`; `null_mass`.

    Raises
    ------
    InvalidInput
        The mask, a size, `periodic` or `valid` is not as described.

    Notes
    -----
    0 for one cell, 1 for a row or column that spans the mask, 2 for a full mask (1 of a profile); NaN for an
    empty one, with the reason in `comment`. D_2 of `generalised_dimensions` is the same quantity from boxes
    on one grid. Validation on sets of known dimension: see the documentation, "Theory: contact domains".

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> mask = xr.DataArray(np.arange(64)[:, None] == np.full(64, 20), dims=("y", "x"))
    >>> round(float(fc.domains.correlation_dimension(mask).correlation_dimension), 6)  # a line
    1.0
    """
    return analyse(_masks.read_planes(mask, valid=valid, periodic=periodic), box_sizes=box_sizes)


def analyse(planes: Planes, *, box_sizes: Any = None) -> xr.Dataset:
    """Return the result of `correlation_dimension` for planes, without labels."""
    sizes = _masks.read_box_sizes(box_sizes, default_sizes(planes.sides))
    # one plane at a time: the transform uses the threads
    mass = np.array([mean_mass(planes, k, sizes) for k in range(planes.count)])
    numbers = zip(planes.occupied, planes.observed, strict=True)
    null = np.array([null_mass(cells, observed, sizes**planes.rank) for cells, observed in numbers])
    dimension, half_width = fit_power_law(sizes, mass, 1.0)
    variables = {
        **dimension_variables(planes, "correlation_dimension", dimension, half_width, sizes),
        "coverage": planes.variable(planes.coverage),
        "null_dimension": planes.variable(fit_power_law(sizes, null, 1.0)[0]),
        "mean_mass": planes.variable(mass, "box_size"),
        "local_slope": planes.variable(local_slope(sizes, mass), "box_size"),
        "null_mass": planes.variable(null, "box_size"),
    }
    notes = fit_notes("correlation_dimension", dimension, sizes.size, "square")
    notes["local_slope"] = {"long_name": "local dimension, d ln(mean_mass)/d ln(box_size)"}
    return planes.dataset(variables, planes.box_coords(sizes), notes=notes)


def mean_mass(planes: Planes, plane: int, sizes: Array) -> Array:
    """Return the mean number of cells of the set in the square of each size about one of them; (sizes,).

    Pairs of cells are counted by their distance along y and x. The number at each distance is corrected for
    the pairs that edges or unobserved cells leave out: pairs of the set over pairs observed (Ohser 1983). A
    pair on the outline of a square of an even number of cells counts half. NaN for an empty plane. Pairs of
    a profile have no distance along y.
    """
    mass = int(planes.occupied[plane])
    if mass == 0:
        return np.full(sizes.size, np.nan)
    reach = int(sizes.max()) // 2
    reaches = (reach if planes.rank == 2 else 0, reach)
    pairs, observed_pairs = pairs_and_observed(planes, plane, reaches)
    share = np.where(observed_pairs > 0, pairs / np.maximum(observed_pairs, 1.0), 0.0)
    share = share * (planes.observed[plane] / mass)
    along_y, along_x = (
        np.clip((sizes[:, None] + 1) / 2.0 - np.abs(np.arange(-r, r + 1)), 0.0, 1.0) for r in reaches
    )
    return np.asarray(np.einsum("si,ij,sj->s", along_y, share, along_x))


def pairs_and_observed(planes: Planes, plane: int, reaches: Sequence[int]) -> tuple[Array, Array]:
    """Return how many pairs of cells of the set, and of observed cells, there are at each distance."""
    cells, valid = planes.cells[plane], planes.valid_of(plane)
    pairs = count_pairs(cells, planes.grid, reaches)
    if valid is not None:
        return pairs, count_pairs(valid, planes.grid, reaches)
    along = [
        np.full(2 * reach + 1, float(n)) if wraps else n - np.abs(np.arange(-reach, reach + 1.0))
        for n, wraps, reach in zip(cells.shape, planes.grid.periodic, reaches, strict=True)
    ]
    return pairs, np.multiply.outer(*along)


def pair_correlation_length(planes: Planes, plane: int) -> Array:
    """Return the distance (m) up to which the pair correlation g(r) stays above 2, (1 + blocks,).

    g(r) is the share of pairs of observed cells at the distance r that are both in the set, over the square
    of the coverage, averaged over all directions. It is searched up to a quarter of the extent; NaN if it is
    never above 2. The further values leave out the pairs that begin in one of the blocks of positions.
    """
    grid = planes.grid
    side, farthest = float(np.sqrt(grid.cell_area)), min(grid.extent) / 4.0
    pairs, observed = pairs_and_observed(planes, plane, _reaches(grid, farthest))
    counts = _in_rings(np.array([pairs, observed]), grid)[:, : int(farthest / side) + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        g = counts[0] / counts[1] / planes.coverage[plane] ** 2
    below = np.flatnonzero(g[1:] < 2.0) + 1
    if not below.size or not g[0] >= 2.0 or min(grid.shape) < BLOCKS:
        return np.full(1 + BLOCKS * BLOCKS, np.nan)
    r = int(below[0])
    ends = [np.arange(BLOCKS + 1) * n // BLOCKS for n in grid.shape]
    reaches = _reaches(grid, (r + 1) * side)
    by_lag = [
        _block_pairs(planes, plane, reaches, (y, x))
        for y in map(slice, ends[0], ends[0][1:])
        for x in map(slice, ends[1], ends[1][1:])
    ]
    blocks = _in_rings(np.concatenate(by_lag), grid)[:, [0, r - 1, r]].reshape(-1, 2, 3)
    total = blocks.sum(0)
    left = np.concatenate([total[None], total - blocks])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = left[:, 0] / left[:, 1]
        before, after = (share[:, ring] / share[:, 0] ** 2 for ring in (1, 2))
        return np.asarray(side * (r - 1 + (before - 2.0) / (before - after)))


def _reaches(grid: Grid, farthest: float) -> list[int]:
    """Return the cells along y and x up to a distance."""
    return [int(farthest / spacing) for spacing in grid.spacing]


def _in_rings(pairs: Array, grid: Grid) -> Array:
    """Add up counts over lags (kinds, y, x) by distance in sides of a cell, (kinds, rings)."""
    lags = [np.arange(n) - n // 2 for n in pairs.shape[1:]]
    y, x = (lag * spacing for lag, spacing in zip(lags, grid.spacing, strict=True))
    ring = np.rint(np.hypot(y[:, None], x) / np.sqrt(grid.cell_area)).astype(np.int64).ravel()
    return np.array([np.bincount(ring, kind.ravel()) for kind in pairs])


def _block_pairs(planes: Planes, plane: int, reaches: Sequence[int], block: Sequence[slice]) -> Array:
    """Count pairs of the set, and of observed cells, of which the first lies in a block; by their lag."""
    axes = zip(block, reaches, planes.grid.shape, planes.grid.periodic, strict=True)
    around, inside = [], []
    for own, reach, n, wraps in axes:
        places = np.arange(own.start - reach, own.stop + reach)
        around.append(places % n)
        inside.append(np.ones(places.size) if wraps else (places >= 0) & (places < n))
    window, within = np.ix_(*around), np.multiply.outer(*inside)
    shape = [fft.fast_length(n) for n in within.shape]
    pairs = []
    for cells in (planes.cells[plane], planes.valid_of(plane)):
        if cells is None:
            sides = (np.ones(part.stop - part.start) for part in block)
            along = [np.convolve(part, side, "valid") for part, side in zip(inside, sides, strict=True)]
            pairs.append(np.multiply.outer(*along))
            continue
        padded = np.zeros((2, *shape))
        for target, values in zip(padded, (within * cells[window], cells[tuple(block)]), strict=True):
            target[: values.shape[0], : values.shape[1]] = values
        modes = fft.rfft2(padded)
        both = fft.irfft2(modes[0] * modes[1].conj(), (shape[0], shape[1]), overwrite=True)
        pairs.append(np.rint(both[: 2 * reaches[0] + 1, : 2 * reaches[1] + 1]))
    return np.array(pairs)


def count_pairs(plane: Array, grid: Grid, reaches: Sequence[int]) -> Array:
    """Count pairs of cells up to `reaches` apart along y and x; 2 reach + 1 distances along each."""
    return np.rint(lagged_products(plane, reaches, grid.periodic))


def null_mass(cells: float, observed: float, areas: Array) -> Array:
    """Return the mean mass of the random null in squares of these areas about a cell; see `mean_mass`."""
    if cells < 1:
        return np.full(areas.size, np.nan)
    return np.asarray(1.0 + (areas.astype(float) - 1.0) * (cells - 1.0) / max(observed - 1.0, 1.0))
