"""What the rooms say, held against what none of them computed: closed forms, brute force, changes of unit.

Each function returns a relative error, 0 where a result is right to the last digit.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

# powers of (length, modulus) in the units of results
_POWERS = {"m": (1, 0), "Pa": (0, 1), "N": (2, 1), "J": (3, 1)}
_NO_RESULT = ("run_time", "iterations", "transforms")


def halfspace_error(surface: xr.DataArray, pressed: xr.Dataset, modulus: float) -> float:
    """Return how far gap, closure and pressure are from the law of two half-spaces.

    At every node gap = top - height - closure + u, u the displacement by the pressures on all cells (Love,
    1929, Phil. Trans. A 228:377, summed directly); gap and pressure are never negative, and one is zero.
    """
    from scipy.signal import fftconvolve

    ny, nx = surface.shape
    dy, dx = (float(surface[dim][1] - surface[dim][0]) for dim in ("y", "x"))
    influence = _love(np.arange(1 - ny, ny)[:, None] * dy, np.arange(1 - nx, nx) * dx, dy, dx) / (
        np.pi * modulus
    )
    below = float(surface.max()) - surface.values
    worst = 0.0
    for step in range(pressed.sizes["step"]):
        one = pressed.isel(step=step)
        pressure, gap, closure = (np.asarray(one[name].values) for name in ("pressure", "gap", "closure"))
        lift = fftconvolve(influence, pressure, mode="valid")
        size = max(float(np.abs(lift).max()), float(np.abs(closure)))
        wrong = np.abs(below - closure + lift - gap).max() / size
        both = float(np.max(np.minimum(gap / size, pressure / pressure.max())))
        worst = max(worst, float(wrong), both, -float(gap.min()) / size, -float(pressure.min()))
    return worst


def _love(y: Array, x: Array, dy: float, dx: float) -> Array:
    """Return pi E* times the displacement at (y, x) by unit pressure on a cell (dy, dx) at the origin."""
    total = np.zeros(np.broadcast_shapes(y.shape, x.shape))
    for sign_y in (1, -1):
        for sign_x in (1, -1):
            b, a = y + sign_y * dy / 2, x + sign_x * dx / 2
            total += sign_y * sign_x * (a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b)))
    return np.asarray(total)


def spread_error(surface: xr.DataArray, described: xr.Dataset) -> float:
    """Return the error of the rms height, against a sum of more digits."""
    heights = surface.values[np.isfinite(surface.values)]
    heights = (heights - heights.min()).astype(np.longdouble)
    exact = float(np.sqrt(np.mean((heights - heights.mean()) ** 2)))
    return abs(float(described["rms_height"]) - exact) / (exact or 1.0)


def sliding_error(surface: xr.DataArray, slid: xr.Dataset, block: tuple[int, int]) -> float:
    """Return the error of the rigid dilatancy of a mated block, one cell to the east, by its definition."""
    heights = surface.values
    y, x = ((n - b) // 2 for n, b in zip(heights.shape, block, strict=True))
    upper = heights[y : y + block[0], x : x + block[1]]
    # both are differences of the same heights: equal to the last bit of the largest of them
    exact = float(np.max(heights[y : y + block[0], x + 1 : x + 1 + block[1]] - upper))
    return abs(float(slid["rigid_dilatancy"].item()) - exact) / max(abs(exact), float(np.ptp(heights)) or 1.0)


def island_error(mask: xr.DataArray, islands: xr.Dataset) -> float:
    """Return the error of the number of islands of a free mask; of one that wraps nothing is known: 0."""
    from scipy import ndimage

    if "period" in mask["x"].attrs:
        return 0.0
    return abs(int(islands["n_islands"]) - int(ndimage.label(mask.values)[1]))


def single_cell_error(mask: xr.DataArray, lacunarity: xr.Dataset) -> float:
    """Return the error of the lacunarity of single cells, which is one over the coverage."""
    found = float(lacunarity["lacunarity"].sel(box_size=1))
    count = int(np.count_nonzero(mask.values))
    return abs(found * count / mask.size - 1.0) if count else float(not np.isnan(found))


def in_other_units(face: xr.DataArray, power: int) -> xr.DataArray:
    """Return a face with all its lengths times a power of two."""
    axes = {}
    for dim in ("y", "x"):
        told = {key: np.ldexp(v, power) if key == "period" else v for key, v in face[dim].attrs.items()}
        axes[dim] = (dim, np.ldexp(face[dim].values, power), told)
    return face.assign_coords(axes).copy(data=np.ldexp(face.values, power))


def unit_error(ours: xr.Dataset, theirs: xr.Dataset, length: int, modulus: int) -> float:
    """Return how much a result depends on units: lengths and moduli were times these powers of two."""
    worst = 0.0
    for name, variable in ours.variables.items():
        if variable.dtype.kind not in "fiub" or name in _NO_RESULT:
            continue
        lengths, moduli = _powers(str(variable.attrs.get("units", "1")))
        ours_there = np.ldexp(variable.values.astype(float), lengths * length + moduli * modulus)
        other = theirs[name].values.astype(float)
        if ours_there.shape != other.shape or (np.isnan(ours_there) != np.isnan(other)).any():
            return np.inf
        size = float(np.max(np.abs(other), initial=0.0, where=~np.isnan(other)))
        differs = float(np.max(np.abs(other - ours_there), initial=0.0, where=~np.isnan(other)))
        worst = max(worst, differs / size if size else differs)
    return worst


def _powers(units: str) -> tuple[int, int]:
    """Return the powers of length and of modulus in a unit."""
    length = modulus = 0
    for word, power in re.findall(r"([A-Za-z]+)(-?\d*)", units):
        base = _POWERS.get(word, (0, 0))
        length, modulus = length + base[0] * int(power or 1), modulus + base[1] * int(power or 1)
    return length, modulus
