"""Minkowski dimension: how the area of a set grows as the set is dilated by a radius (Minkowski sausage)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import Grid
from fractalcontact.base.jit import kernel
from fractalcontact.base.numbers import float_array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._masks import Array, Planes
from fractalcontact.domains._random_null import miss_probability
from fractalcontact.domains._scaling_fit import default_sizes, dimension_variables, fit_notes, fit_power_law

SOURCE = "Falconer, Fractal Geometry (1990), ch. 3 (Minkowski content); Felzenszwalb and Huttenlocher (2012)"


def _check(problems: Problems) -> None:
    _masks.check_mask(problems)
    shape = _masks.plane_shape(problems.given.mask)
    problems.numbers("radii", at_least=0.5, at_most=float(max(shape)), optional=True)


@public_result(title="Minkowski dimension", references=SOURCE, check=_check)
def minkowski_dimension(
    mask: xr.DataArray, *, radii: Any = None, periodic: bool | None = None, valid: xr.DataArray | None = None
) -> xr.Dataset:
    """Minkowski dimension of a set of cells, from the area within a radius of it.

    The area within r of a set of dimension D grows as r^(2 - D). Distances are exact Euclidean distances
    between the centres of cells.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    radii : sequence of float, optional
        Radii in cells (in sides of a square with the area of a cell), at least 1/2. By default half the
        default sizes of `correlation_dimension`: a radius of 1/2 corresponds to a box of one cell.
    periodic : bool, optional
        Whether distances wrap around the edges; by default along periodic axes. True needs periodic axes.
        Beyond a free edge the area is the mirror image of that on the other side of the nearest cell.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; the area elsewhere is completed in the same way.

    Returns
    -------
    Dataset
        Over the leading dims: `minkowski_dimension`, 2 less the least-squares slope of ln area over
        ln radius; `ci_low` and `ci_high`, 2.5 standard deviations of the local slopes to either side (NaN
        for two radii); `scale_min`, `scale_max` (cells); `coverage`; `null_dimension`, of the random null of
        equal coverage far from any edge. Over `radius` (cells; `radius_length` in m) too: `grown_fraction`,
        the area within the radius over that observed; `local_slope`; `null_fraction`.

    Raises
    ------
    InvalidInput
        The mask, a radius, `periodic` or `valid` is not as described.

    Notes
    -----
    1 for a row or column that spans the mask, 2 for a full mask, about 0 for one cell; NaN for an empty one,
    with the reason in `comment`. Bias on rasters and validation: see the documentation,
    "Theory: contact domains".

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> mask = xr.DataArray(np.arange(64)[:, None] == np.full(64, 20), dims=("y", "x"))
    >>> round(float(fc.domains.minkowski_dimension(mask).minkowski_dimension), 6)  # a line
    1.0
    """
    return analyse(_masks.read_planes(mask, valid=valid, periodic=periodic), radii=radii)


def analyse(planes: Planes, *, radii: Any = None) -> xr.Dataset:
    """Return the result of `minkowski_dimension` for planes, without labels."""
    r = default_sizes(planes.grid.shape) / 2.0 if radii is None else np.unique(float_array(radii))
    area = np.array(planes.map(lambda cells, valid: dilated_area(cells, valid, planes.grid, r)))
    numbers = zip(planes.occupied, planes.observed, strict=True)
    null = np.array([null_area(cells, observed, planes.grid, r) for cells, observed in numbers])
    dimension, half_width = fit_power_law(r, area, -1.0)
    observed = np.maximum(planes.observed, 1)[:, None]
    variables = {
        **dimension_variables(planes, "minkowski_dimension", dimension, half_width, r),
        "coverage": planes.variable(planes.coverage),
        "null_dimension": planes.variable(fit_power_law(r, null, -1.0)[0]),
        "grown_fraction": planes.variable(area / observed, "radius"),
        "local_slope": planes.variable(2.0 - local_slope(r, area), "radius"),
        "null_fraction": planes.variable(null / observed, "radius"),
    }
    coords = {"radius": ("radius", r), "radius_length": ("radius", r * planes.side)}
    notes = fit_notes("minkowski_dimension", dimension, r.size, "radius")
    notes["local_slope"] = {"long_name": "local dimension, 2 - d ln(area)/d ln(radius)"}
    return planes.dataset(variables, coords, notes=notes)


def dilated_area(cells: Array, valid: Array | None, grid: Grid, radii: Array) -> Array:
    """Return the area, in cells, within each radius of the set, (radii,); all zero for an empty plane.

    Radii are in edges of a square with the area of a cell. A cell whose centre lies at the distance d from
    that of the nearest one of the set counts by r - d + 1/2, at most fully, so that the area about a row is
    linear in the radius. Beyond a free edge, and where nothing was observed, the area is taken to be the
    mirror image of that on the other side of the nearest cell of the set.
    """
    if not cells.any():
        return np.zeros(radii.size)
    side = np.sqrt(grid.cell_area)
    steps = [spacing / side for spacing in grid.spacing]
    reach = [int((radii.max() + 0.5) / step) for step in steps]
    counts = _count_offsets(cells, valid, reach, steps, grid.periodic)
    rows, columns = (np.arange(n) * step for n, step in zip(counts.shape, steps, strict=True))
    distance = np.hypot(rows[:, None], columns).ravel()
    return np.asarray((np.clip(radii[:, None] - distance + 0.5, 0.0, 1.0) * counts.ravel()).sum(-1))


def _count_offsets(
    cells: Array, valid: Array | None, reach: Sequence[int], steps: Sequence[float], periodic: Sequence[bool]
) -> Array:
    """Count the observed cells by how many rows and columns the nearest cell of the set is away.

    `reach` (rows, columns) is the longest offset, `steps` are the spacings. A cell without an observed mirror
    image about a nearest cell of the set counts twice.
    """
    is_short = max(reach) < np.iinfo(np.int16).max
    above, below = np.empty((2, *cells.shape), np.int16 if is_short else np.int32)
    for distance, is_backward in ((above, False), (below, True)):
        rows_to_set(cells, reach[0], periodic[0], is_backward, distance)
    observed = np.zeros((0, 0), np.uint8) if valid is None else valid
    # in squares of the shorter spacing, rounded: equal distances are then equal in any unit; 4 and 9 decimals
    # gave the same bits
    shorter = min(steps)
    high, wide = (
        np.round((np.arange(n + 1) * (step / shorter)) ** 2, 6) for n, step in zip(reach, steps, strict=True)
    )
    counts = np.zeros((reach[0] + 1, reach[1] + 1), np.int64)
    count_offsets(above, below, observed, high, wide, periodic[0], periodic[1], counts)
    return counts


def null_area(cells: float, observed: float, grid: Grid, radii: Array) -> Array:
    """Return the expected area of the dilated random null, far from any edge; see `dilated_area`."""
    side = np.sqrt(grid.cell_area)
    dy, dx = (spacing / side for spacing in grid.spacing)
    reach = radii.max() + 0.5
    rows, columns = (np.arange(-int(reach / step), int(reach / step) + 1) * step for step in (dy, dx))
    distance = np.hypot(rows[:, None], columns).ravel()
    steps, counts = np.unique(distance[distance < reach], return_counts=True)
    # between two steps of the distance the disc holds the cells up to the first of them
    missed = miss_probability(cells, observed, np.minimum(np.cumsum(counts), observed))
    weight = np.clip(radii[:, None] - steps + 0.5, 0.0, 1.0)
    probability = -np.diff(missed, prepend=1.0)  # that the nearest cell lies at this distance
    return np.asarray(observed * (weight * probability).sum(-1))


@kernel
def rows_to_set(cells: Array, reach: int, wrap: bool, is_backward: bool, distance: Array) -> None:
    """Find the rows up, or backward down, to the nearest cell of the set in each column; reach + 1 beyond.

    `cells` is uint8 (0 or 1), shape (ny, nx); `wrap` marks a periodic y.
    """
    ny, nx = cells.shape
    far = reach + 1
    last = np.empty(nx, distance.dtype)
    for j in range(nx):
        last[j] = far
    for k in range(-reach if wrap else 0, ny):
        i = ny - 1 - k if is_backward else k
        row = cells[i % ny]
        for j in range(nx):
            last[j] = 0 if row[j] else min(last[j] + 1, far)
        if k >= 0:
            for j in range(nx):
                distance[i, j] = last[j]


@kernel
def count_offsets(
    above: Array,
    below: Array,
    valid: Array,
    high: Array,
    wide: Array,
    wrap_y: bool,
    wrap_x: bool,
    counts: Array,
) -> None:
    """Count cells by how many rows and columns the nearest cell of the set is away.

    `above` and `below` are those of `rows_to_set`; `high` and `wide` are the squared distances of so many
    rows and columns, and `counts` (rows, columns) int64 is added to. Columns are searched outwards, until
    none can be as near. Unobserved cells do not count; a cell counts twice if its mirror images about the
    nearest cells of the set all lie outside, or were not observed. `valid` is empty where everything was.
    """
    ny, nx = above.shape
    has_gaps = valid.size > 0
    for i in range(ny):
        for j in range(nx):
            if has_gaps and valid[i, j] == 0:
                continue
            if above[i, j] == 0:
                counts[0, 0] += 1
                continue
            best = np.inf
            rows, columns, has_mirror = 0, 0, False
            for step in range(wide.size):
                if wide[step] > best:
                    break
                for side in (1, -1):
                    other = j + side * step
                    if other < 0 or other >= nx:
                        if not wrap_x:
                            continue
                        other %= nx
                    height = min(above[i, other], below[i, other])
                    if height >= high.size or high[height] + wide[step] > best:
                        continue
                    if high[height] + wide[step] < best:
                        best = high[height] + wide[step]
                        rows, columns, has_mirror = height, step, False
                    x = j + 2 * side * step
                    if has_mirror or not (wrap_x or 0 <= x < nx):
                        continue
                    up, down = i - 2 * height, i + 2 * height
                    if above[i, other] == height and (wrap_y or up >= 0):
                        has_mirror |= not has_gaps or valid[up % ny, x % nx] != 0
                    if below[i, other] == height and (wrap_y or down < ny):
                        has_mirror |= not has_gaps or valid[down % ny, x % nx] != 0
            if best < np.inf:
                counts[rows, columns] += 1 if has_mirror else 2
