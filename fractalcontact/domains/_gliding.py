"""Lacunarity of planes, by gliding boxes or on one grid; arrays in and out."""

from __future__ import annotations

import numpy as np

from fractalcontact.base import fft
from fractalcontact.domains import _covers
from fractalcontact.domains._masks import Array, Planes, together

MANY = 24  # sizes above which one transform is cheaper than a sum for each
EXACT = 2**63 - 1


def lacunarity(planes: Planes, sizes: Array) -> Array:
    """Return <M^2> / <M>^2 of the mass in the box, shape (planes, sizes); NaN where it is undefined."""
    if planes.valid is None and all(planes.grid.periodic) and sizes.size > MANY:
        return np.array([_from_pairs(cells, sizes) for cells in planes.cells])

    def one(task: tuple[int, int]) -> float:
        plane, size = task
        return _glided(planes, plane, size)

    tasks = [(plane, int(size)) for plane in range(planes.count) for size in sizes]
    return np.array(together(one, tasks)).reshape(planes.count, sizes.size)


def _glided(planes: Planes, plane: int, size: int) -> float:
    from fractalcontact.domains import _gliding_kernels as kernels

    (ny, nx), (wrap_y, wrap_x) = planes.grid.shape, planes.grid.periodic
    rows, across = ny if wrap_y else ny - size + 1, nx if wrap_x else nx - size + 1
    masses = np.zeros(rows, np.int64)
    squares = np.zeros(rows, np.int64 if size**4 * across <= EXACT else np.float64)
    columns, seen = np.zeros((2, nx + size), np.int32)
    valid = planes.valid_of(plane)
    if valid is None:
        kernels.glide(planes.cells[plane], size, across, columns, masses, squares)
        return _ratio(rows * across, masses, squares)
    places = np.zeros(rows, np.int64)
    kernels.glide_observed(planes.cells[plane], valid, size, across, columns, seen, masses, squares, places)
    return _ratio(int(places.sum()), masses, squares)


def _ratio(places: int, masses: Array, squares: Array) -> float:
    """Divide in whole numbers, of any length, so that the result is rounded once."""
    mass = sum(masses.tolist())
    if places == 0 or mass == 0:
        return float("nan")
    if squares.dtype == np.float64:
        return float(places * squares.sum() / float(mass) ** 2)
    return float(places * sum(squares.tolist()) / mass**2)


def _from_pairs(cells: Array, sizes: Array) -> Array:
    """All sizes at once from the numbers of pairs of cells at every distance (Wiener-Khinchin)."""
    from fractalcontact.domains._gliding_kernels import squares_from_pairs

    ny, nx = cells.shape
    mass = int(np.count_nonzero(cells))
    if mass == 0:
        return np.full(sizes.size, np.nan)
    modes = fft.rfft2(cells.astype(np.float64))
    power = (modes.real**2 + modes.imag**2).astype(np.complex128)
    pairs = np.rint(fft.irfft2(power, (ny, nx), overwrite=True))
    largest = int(sizes.max())
    bound = ny * nx * largest**4
    squares = squares_from_pairs(pairs.astype(np.int64 if bound <= EXACT else np.float64), largest)
    return np.array([_whole(ny * nx, squares[size], mass * int(size) ** 2) for size in sizes])


def _whole(places: int, square: np.generic, mass: int) -> float:
    total = square.item()
    return places * total / mass**2 if isinstance(total, int) else places * total / float(mass) ** 2


def dust(coverage: Array, sizes: Array) -> Array:
    """Return the lacunarity of independent cells of coverage p, 1 + (1 - p) / (p r^2); (planes, sizes)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.where(coverage > 0, (1.0 - coverage) / coverage, np.nan)
    return np.asarray(1.0 + excess[:, None] / sizes.astype(float) ** 2)


def on_grid(planes: Planes, sizes: Array) -> Array:
    """Return <M^2> / <M>^2 over the whole, wholly observed boxes of the grid from the first cell."""

    def one(task: tuple[int, int]) -> float:
        plane, size = task
        mass = _whole_boxes(planes.cells[plane], size)
        valid = planes.valid_of(plane)
        if valid is not None:
            mass = mass[_whole_boxes(valid, size) == size * size]
        return _ratio(mass.size, mass.ravel(), mass.ravel() ** 2)

    tasks = [(plane, int(size)) for plane in range(planes.count) for size in sizes]
    return np.array([one(task) for task in tasks]).reshape(planes.count, sizes.size)


def _whole_boxes(cells: Array, size: int) -> Array:
    """Sum over the boxes that lie wholly inside, int64."""
    ny, nx = (n // size * size for n in cells.shape)
    rows = cells[:ny, :nx].reshape(ny // size, size, nx).sum(1, dtype=np.int64)
    return np.asarray(rows.reshape(ny // size, nx // size, size).sum(2))


def normalised(coverage: Array, values: Array) -> Array:
    """Return the lacunarity less 1 over that of single cells less 1; NaN where the set is full or empty."""
    with np.errstate(divide="ignore", invalid="ignore"):
        odds = np.where((coverage > 0) & (coverage < 1), coverage / (1.0 - coverage), np.nan)
    return np.asarray((values - 1.0) * odds[:, None])


def numbers(sizes: Array, values: Array) -> tuple[Array, Array]:
    """Return the slope of ln lacunarity over ln size, and the integral; NaN for one size."""
    if sizes.size < 2:
        return np.full(len(values), np.nan), np.full(len(values), np.nan)
    x, y = np.log(sizes), np.log(values)
    steps = np.diff(x)
    return _covers.line(x, y)[0], np.asarray((0.5 * (y[:, 1:] + y[:, :-1]) * steps).sum(-1))
