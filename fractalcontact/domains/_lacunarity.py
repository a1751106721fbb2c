"""Lacunarity: how unevenly a set fills the plane, by the size of the box in which its mass is measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.jit import kernel
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains._mask_input import (
    Array,
    Planes,
    build_dataset,
    check_box_sizes,
    check_mask,
    mask_sides,
    parallel_map,
    read_box_sizes,
    read_planes,
)
from fractalcontact.domains._scaling_fit import fit_line

SOURCE = (
    "Allain and Cloitre, Phys. Rev. A 44:3552 (1991); Plotnick et al., Phys. Rev. E 53:5461 (1996) "
    "(gliding box)"
)
MANY_SIZES = 24  # above so many sizes one transform is cheaper than a sum for each
LARGEST_INT64 = 2**63 - 1


def _check(problems: Problems, *, mask: Any, box_sizes: Any, boxes: Any, periodic: Any, valid: Any) -> None:
    problems.choice("boxes", boxes, ("gliding", "fixed"))
    check_mask(problems, mask, valid=valid, periodic=periodic, profiles=True)
    shape = mask_sides(mask)
    check_box_sizes(problems, "box_sizes", box_sizes, min(shape))


@public_result(title="Lacunarity", references=SOURCE, achieved_error="exact to rounding", check=_check)
def lacunarity(
    mask: xr.DataArray,
    box_sizes: Any = None,
    *,
    boxes: str = "gliding",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Lacunarity of a set of cells by gliding boxes, beside that of its random null.

    A box of r x r cells moves over the plane cell by cell; M is the number of cells of the set in it, and the
    lacunarity is <M^2> / <M>^2 over all positions: 1 for an even set, more for a set with gaps at the size of
    the box.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        Boolean, or integer flags where contact means value > 0.
    box_sizes : sequence of int, optional
        Edges of the box in cells; by default the powers of two up to half the shorter side.
    boxes : {"gliding", "fixed"}
        All positions of the box, or those of the one grid that starts at the first cell, on which sets built
        by a fixed rule have the lacunarity (L/r)^(2 - D) exactly.
    periodic : bool, optional
        Whether the box wraps around the edges; by default along periodic axes. True needs periodic axes. On a
        free axis only positions inside the plane count.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells; only boxes of observed cells count.

    Returns
    -------
    Dataset
        Over the leading dims and `box_size` (cells; `box_length` in m): `lacunarity`; `null_lacunarity`,
        1 + (1 - p) / (p r^2), of a profile 1 + (1 - p) / (p r), for independent cells of probability p, the
        coverage; `relative_lacunarity`, the
        ratio of the two; `normalised_lacunarity`, (lacunarity - 1) p / (1 - p). Over the leading dims:
        `coverage`; `lacunarity_slope`, the least-squares slope of ln lacunarity over ln r (D - 2 for a power
        law, D - 1 for a profile); `lacunarity_area`, the integral of ln lacunarity over ln r; both with
        `null_` for the null.

    Raises
    ------
    InvalidInput
        The mask, a size, `boxes`, `periodic` or `valid` is not as described.

    Notes
    -----
    At one cell the lacunarity is 1 / coverage. NaN where the set is empty or no box was fully observed, with
    the reason in `comment`; the normalised one also where the set is full.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> chequerboard = xr.DataArray(np.indices((16, 16)).sum(0) % 2, dims=("y", "x"))
    >>> result = fc.domains.lacunarity(chequerboard, [1, 2, 4], periodic=True)
    >>> result.lacunarity.values.tolist()
    [2.0, 1.0, 1.0]
    """
    planes = read_planes(mask, valid=valid, periodic=periodic)
    return analyse(planes, box_sizes, boxes=boxes)


def analyse(planes: Planes, box_sizes: Any = None, *, boxes: str = "gliding") -> xr.Dataset:
    """Return the result of `lacunarity` for planes, without labels."""
    half = max(1, min(planes.sides) // 2)
    sizes = read_box_sizes(box_sizes, 2 ** np.arange(half.bit_length(), dtype=np.int64))
    if planes.rank == 1:
        values = _row_lacunarity(planes, sizes, boxes)
    else:
        of_planes = gliding_lacunarity if boxes == "gliding" else _fixed_lacunarity
        values = of_planes(planes, sizes)
    null = _null_lacunarity(planes.coverage, sizes, planes.rank)
    slope, area = _slope_and_area(sizes, values)
    null_slope, null_area = _slope_and_area(sizes, null)
    variables = {
        "coverage": planes.variable(planes.coverage),
        "lacunarity": planes.variable(values, "box_size"),
        "null_lacunarity": planes.variable(null, "box_size"),
        "relative_lacunarity": planes.variable(values / null, "box_size"),
        "normalised_lacunarity": planes.variable(_normalised(planes.coverage, values), "box_size"),
        "lacunarity_slope": planes.variable(slope),
        "lacunarity_area": planes.variable(area),
        "null_lacunarity_slope": planes.variable(null_slope),
        "null_lacunarity_area": planes.variable(null_area),
    }
    coords = {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}
    return build_dataset(planes, variables, coords, notes=_notes(planes, values, boxes))


def gliding_lacunarity(planes: Planes, sizes: Array) -> Array:
    """Return <M^2> / <M>^2 of the mass in the box, shape (planes, sizes); NaN where it is undefined."""
    if planes.valid is None and all(planes.grid.periodic) and sizes.size > MANY_SIZES:
        return np.array([_lacunarity_from_pairs(cells, sizes) for cells in planes.cells])
    tasks = [(plane, int(size)) for plane in range(planes.count) for size in sizes]
    values = parallel_map(lambda task: _lacunarity_at_size(planes, *task), tasks, planes.plane_size)
    return np.array(values).reshape(planes.count, sizes.size)


def _lacunarity_at_size(planes: Planes, plane: int, size: int) -> float:
    (ny, nx), (wrap_y, wrap_x) = planes.grid.shape, planes.grid.periodic
    rows, across = ny if wrap_y else ny - size + 1, nx if wrap_x else nx - size + 1
    masses = np.zeros(rows, np.int64)
    squares = np.zeros(rows, np.int64 if size**4 * across <= LARGEST_INT64 else np.float64)
    columns, observed_columns = np.zeros((2, nx + size), np.int32)
    cells, valid = planes.cells[plane], planes.valid_of(plane)
    if valid is None:
        glide(cells, size, across, columns, masses, squares)
        return _moment_ratio(rows * across, masses, squares)
    places = np.zeros(rows, np.int64)
    glide_observed(cells, valid, size, across, columns, observed_columns, masses, squares, places)
    return _moment_ratio(int(places.sum()), masses, squares)


def _moment_ratio(places: int, masses: Array, squares: Array) -> float:
    """Return <M^2> / <M>^2 from integers of any length, so that the result is rounded once."""
    mass = sum(masses.tolist())
    if places == 0 or mass == 0:
        return float("nan")
    if squares.dtype == np.float64:
        return float(places * squares.sum() / float(mass) ** 2)
    return float(places * sum(squares.tolist()) / mass**2)


def _lacunarity_from_pairs(cells: Array, sizes: Array) -> Array:
    """All sizes at once from the numbers of pairs of cells at every distance (Wiener-Khinchin)."""
    ny, nx = cells.shape
    mass = int(np.count_nonzero(cells))
    if mass == 0:
        return np.full(sizes.size, np.nan)
    modes = fft.rfft2(cells.astype(np.float64))
    power = (modes.real**2 + modes.imag**2).astype(np.complex128)
    pairs = np.rint(fft.irfft2(power, (ny, nx), overwrite=True))
    largest = int(sizes.max())
    bound = ny * nx * largest**4
    squares = squares_from_pairs(pairs.astype(np.int64 if bound <= LARGEST_INT64 else np.float64), largest)
    return np.array([_ratio(ny * nx, squares[size].item(), mass * int(size) ** 2) for size in sizes])


def _ratio(places: int, square: float, mass: int) -> float:
    return places * square / mass**2 if isinstance(square, int) else places * square / float(mass) ** 2


def _fixed_lacunarity(planes: Planes, sizes: Array) -> Array:
    """Return <M^2> / <M>^2 over the fully observed boxes inside, of the grid from the first cell."""
    return _from_masses(planes, sizes, _mass_of_boxes)


def _from_masses(planes: Planes, sizes: Array, masses: Callable[[Array, int], Array]) -> Array:
    """Return <M^2> / <M>^2; `masses` sums cells (ny, nx) over the boxes of one size."""

    def at_size(plane: int, size: int) -> float:
        mass, valid = masses(planes.cells[plane], size), planes.valid_of(plane)
        if valid is not None:
            mass = mass[masses(valid, size) == size**planes.rank]
        return _moment_ratio(mass.size, mass.ravel(), mass.ravel() ** 2)

    values = [at_size(plane, size) for plane in range(planes.count) for size in sizes.tolist()]
    return np.array(values).reshape(planes.count, sizes.size)


def _mass_of_boxes(cells: Array, size: int) -> Array:
    """Sum over the boxes that lie inside the plane, int64."""
    ny, nx = (n // size * size for n in cells.shape)
    rows = cells[:ny, :nx].reshape(ny // size, size, nx).sum(1, dtype=np.int64)
    return np.asarray(rows.reshape(ny // size, nx // size, size).sum(2))


def _row_lacunarity(planes: Planes, sizes: Array, boxes: str) -> Array:
    """Return <M^2> / <M>^2 of profiles, over all boxes or those of the grid from the first cell."""
    n, (wraps,) = planes.grid.shape[1], planes.periodic

    def masses(cells: Array, size: int) -> Array:
        ahead = np.pad(cells[0], (0, size - 1 if wraps and boxes == "gliding" else 0), mode="wrap")
        total = np.insert(np.cumsum(ahead, dtype=np.int64), 0, 0)
        mass = total[size:] - total[:-size]
        return mass if boxes == "gliding" else mass[: n - size + 1 : size]

    return _from_masses(planes, sizes, masses)


def _null_lacunarity(coverage: Array, sizes: Array, rank: int) -> Array:
    """Return the lacunarity of independent cells of coverage p, 1 + (1 - p) / (p r^rank); (planes, sizes).

    Its box counts are in `_random_null.py`.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.where(coverage > 0, (1.0 - coverage) / coverage, np.nan)
    return np.asarray(1.0 + excess[:, None] / sizes.astype(float) ** rank)


def _normalised(coverage: Array, values: Array) -> Array:
    """Return the lacunarity less 1 over that of single cells less 1; NaN where the set is full or empty."""
    with np.errstate(divide="ignore", invalid="ignore"):
        odds = np.where((coverage > 0) & (coverage < 1), coverage / (1.0 - coverage), np.nan)
    return np.asarray((values - 1.0) * odds[:, None])


def _slope_and_area(sizes: Array, values: Array) -> tuple[Array, Array]:
    """Return slope and integral of ln lacunarity over ln size; NaN for one size."""
    if sizes.size < 2:
        return np.full(len(values), np.nan), np.full(len(values), np.nan)
    x, y = np.log(sizes), np.log(values)
    steps = np.diff(x)
    return fit_line(x, y)[0], np.asarray((0.5 * (y[:, 1:] + y[:, :-1]) * steps).sum(-1))


def _notes(planes: Planes, values: Array, boxes: str) -> dict[str, dict[str, str]]:
    empty = planes.occupied == 0
    reasons = []
    if empty.any():
        reasons.append(f"the set is empty ({int(empty.sum())} planes)")
    if np.isnan(values[~empty]).any():
        reasons.append("no box was wholly observed, or none of those holds a cell")
    attributes = {"long_name": "lacunarity (fixed grid of boxes)"} if boxes == "fixed" else {}
    if reasons:
        attributes["comment"] = "NaN where " + " or where ".join(reasons)
    notes = {"lacunarity": attributes}
    if (planes.coverage == 1).any():
        notes["normalised_lacunarity"] = {
            "comment": "NaN where the set is full or empty: its normalisation is undefined"
        }
    if values.shape[-1] < 2:
        single = {"comment": "NaN: one size of box gives no curve"}
        notes |= {
            f"{prefix}lacunarity_{name}": single for prefix in ("", "null_") for name in ("slope", "area")
        }
    return notes


@kernel
def glide(mask: Array, size: int, across: int, columns: Array, masses: Array, squares: Array) -> None:
    """Add up the mass in the box and its square along every row of `across` positions.

    `mask` is uint8 (0 or 1), shape (ny, nx). `masses` (int64) and `squares` (int64, or float64 where it
    could overflow) hold one value per row of positions: ny of them, or ny - size + 1 where y is free.
    `columns` (nx + size) int32 is zeros to work in.
    """
    ny, nx = mask.shape
    for i in range(1 - size, masses.size):
        entering = (i + size - 1) % ny
        leaving = i - 1 if i > 0 else 0
        for j in range(nx):
            columns[j] = columns[j] + mask[entering, j] - (i > 0) * mask[leaving, j]
        if i < 0:
            continue
        for j in range(size):  # continue a periodic axis
            columns[nx + j] = columns[j]
        inside, mass, square = 0, 0, squares[i]
        for j in range(size):
            inside += columns[j]
        for j in range(across):
            mass += inside
            square += inside * inside
            inside += columns[j + size] - columns[j]
        masses[i], squares[i] = mass, square


@kernel
def glide_observed(
    mask: Array,
    valid: Array,
    size: int,
    across: int,
    columns: Array,
    observed_columns: Array,
    masses: Array,
    squares: Array,
    places: Array,
) -> None:
    """As `glide`, over the positions where every cell of the box was observed; `places` counts them.

    `observed_columns` (nx + size) int32 is zeros to work in, too.
    """
    ny, nx = mask.shape
    for i in range(1 - size, masses.size):
        entering = (i + size - 1) % ny
        leaving = i - 1 if i > 0 else 0
        for j in range(nx):
            columns[j] = columns[j] + mask[entering, j] - (i > 0) * mask[leaving, j]
            observed_columns[j] = observed_columns[j] + valid[entering, j] - (i > 0) * valid[leaving, j]
        if i < 0:
            continue
        for j in range(size):
            columns[nx + j] = columns[j]
            observed_columns[nx + j] = observed_columns[j]
        inside, observed, square = 0, 0, squares[i]
        for j in range(size):
            inside += columns[j]
            observed += observed_columns[j]
        for j in range(across):
            if observed == size * size:
                places[i] += 1
                masses[i] += inside
                square += inside * inside
            inside += columns[j + size] - columns[j]
            observed += observed_columns[j + size] - observed_columns[j]
        squares[i] = square


@kernel
def squares_from_pairs(pairs: Array, largest: int) -> Array:
    """Sum of squared masses for every size up to `largest` (index 0 is unused), both axes periodic.

    `pairs[u, v]` is the number of pairs of set cells u rows and v columns apart, on the torus. The sum of
    squares is that of (s - |u|)(s - |v|) pairs[u, v] over |u|, |v| < s, so a double sum of double sums.
    """
    ny, nx = pairs.shape
    total = np.zeros(largest + 1, pairs.dtype)
    column = np.zeros(largest, pairs.dtype)  # over |u| <= a, at v = +-b
    within = np.zeros(largest, pairs.dtype)  # over |v| <= b too, and summed over a
    for a in range(largest):
        back = (ny - a) % ny
        running = pairs.dtype.type(0)
        for b in range(largest):
            value = pairs[a % ny, b % nx]
            if b > 0:
                value += pairs[a % ny, nx - b]
            if a > 0:
                value += pairs[back, b % nx]
            if a > 0 and b > 0:
                value += pairs[back, nx - b]
            column[b] += value
            running += column[b]
            within[b] += running
        for b in range(a + 1):
            total[a + 1] += within[b]
    return total
