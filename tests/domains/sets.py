"""Sets whose dimension is known, and masks made of them."""

import numba
import numpy as np
import xarray as xr
from scipy import ndimage

from fractalcontact.base.grid import plane_coords

GENERATORS = {
    "carpet": np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]]),
    "cantor_dust": np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]]),
    "vicsek": np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]]),
    "gasket": np.array([[1, 0], [1, 1]]),
}
DIMENSION = {name: np.log(g.sum()) / np.log(len(g)) for name, g in GENERATORS.items()}
DIMENSION["koch"] = np.log(4) / np.log(3)


def as_mask(cells, spacing=(1e-3, 1e-3), periodic=(False, False), dims=None):
    """Label an array of cells, (..., y, x), as a mask on a plane from the origin."""
    cells = np.asarray(cells) > 0
    dims = dims or ("step", "y", "x")[-cells.ndim :]
    return xr.DataArray(cells, dims=dims, coords=plane_coords(cells.shape[-2:], spacing, periodic))


def ratio_of(name):
    """Return the ratio by which a set of `GENERATORS` repeats itself."""
    return len(GENERATORS[name])


def lattice_set(name, level):
    """Build a self-similar set cell by cell, ratio^level cells a side."""
    cells = np.ones((1, 1), int)
    for _ in range(level):
        cells = np.kron(GENERATORS[name], cells)
    return cells


def random_lattice_set(keep, ratio, level, rng):
    """Build a random self-similar set: `keep` of the ratio^2 parts of every part, drawn anew each time."""
    cells = np.ones((1, 1), bool)
    for _ in range(level):
        n = len(cells)
        rank = rng.random((n, n, ratio * ratio)).argsort(-1).argsort(-1)
        parts = (rank < keep).reshape(n, n, ratio, ratio) & cells[:, :, None, None]
        cells = parts.transpose(0, 2, 1, 3).reshape(n * ratio, n * ratio)
    return cells


def percolating_cluster(n, rng):
    """Return a cluster of site percolation at the threshold that spans most of the plane (D = 91/48)."""
    while True:
        labels, _ = ndimage.label(rng.random((n, n)) < 0.592746)
        cluster = labels == np.bincount(labels.ravel())[1:].argmax() + 1
        if min(np.ptp(places) for places in np.nonzero(cluster)) > 0.9 * n:
            return cluster


@numba.njit
def _grow(cells, rng):
    n = len(cells)
    centre, radius = n // 2, 1.0
    cells[centre, centre] = True
    while radius < n // 2 - 12:
        angle = 2 * np.pi * rng.random()
        y = round(centre + (radius + 3) * np.sin(angle))
        x = round(centre + (radius + 3) * np.cos(angle))
        while True:
            beyond = np.hypot(y - centre, x - centre) - radius
            if beyond > 3 * radius + 20:
                break
            if beyond > 8:  # far away: jump to a circle that does not meet the cluster
                angle = 2 * np.pi * rng.random()
                y += round((beyond - 3) * np.sin(angle))
                x += round((beyond - 3) * np.cos(angle))
                continue
            side = int(4 * rng.random())
            y += (side == 0) - (side == 1)
            x += (side == 2) - (side == 3)
            if min(y, x) < 2 or max(y, x) >= n - 2:
                break
            if cells[y + 1, x] or cells[y - 1, x] or cells[y, x + 1] or cells[y, x - 1]:
                cells[y, x] = True
                radius = max(radius, np.hypot(y - centre, x - centre))
                break


def aggregate(n, rng):
    """Return a cluster of diffusion-limited aggregation on the square lattice (D about 1.71)."""
    cells = np.zeros((n, n), np.bool_)
    _grow(cells, rng)
    return cells


def fractal_percolation(keep, ratio, levels, rng):
    """Return fractal percolation, D = 2 + ln(keep)/ln(ratio): each part of each part is kept with `keep`."""
    while True:
        cells = np.ones((1, 1), bool)
        for _ in range(levels):
            cells = np.kron(cells, np.ones((ratio, ratio), bool))
            cells &= rng.random(cells.shape) < keep
        if cells.sum() > 30:
            return cells


def placed(cells, n, rng):
    """Put a set anywhere into an n x n plane."""
    plane = np.zeros((n, n), bool)
    y, x = (int(rng.integers(0, n - edge + 1)) for edge in cells.shape)
    plane[y : y + cells.shape[0], x : x + cells.shape[1]] = cells
    return plane


def koch_raster(n, rng, level=9):
    """Mark the cells that the Koch curve passes, turned and placed at random."""
    points = np.array([0, 1], complex)
    for _ in range(level):
        third = (points[1:] - points[:-1]) / 3
        peak = points[:-1] + third * (1 + np.exp(1j * np.pi / 3))
        parts = np.stack([points[:-1], points[:-1] + third, peak, points[:-1] + 2 * third], 1)
        points = np.append(parts.ravel(), points[-1])
    points = points * np.exp(2j * np.pi * rng.random())
    width = max(np.ptp(points.real), np.ptp(points.imag))
    points = points * (n * (0.5 + 0.4 * rng.random()) / width)
    points = points - points.real.min() - 1j * points.imag.min()
    points = (
        points
        + rng.random() * (n - 1 - np.ptp(points.real))
        + 1j * rng.random() * (n - 1 - np.ptp(points.imag))
    )
    plane = np.zeros((n, n), bool)
    plane[np.floor(points.imag).astype(int), np.floor(points.real).astype(int)] = True
    return plane


def level_set(n, hurst, coverage, rng, cutoff=0.25):
    """Return the highest part of a band-limited periodic self-affine surface."""
    q = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None])
    amplitude = np.where((q > 0) & (q < cutoff), np.maximum(q, 1 / n) ** (-1 - hurst), 0)
    heights = np.fft.irfft2(amplitude * np.fft.rfft2(rng.standard_normal((n, n))), s=(n, n))
    return heights > np.quantile(heights, 1 - coverage)


def random_null(n, cells, rng):
    """Return complete spatial randomness: so many cells anywhere in an n x n plane."""
    return (rng.permutation(n * n) < cells).reshape(n, n)


def row_path(*rows):
    """Return planes of two equal rows of cells each, from strings; # is a cell of the set."""
    return np.array([[[letter == "#" for letter in row]] * 2 for row in rows])
