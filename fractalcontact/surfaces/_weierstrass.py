"""Weierstrass surfaces: sums of cosines at geometric wavelengths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import ROUNDED, Array
from fractalcontact.base.resources import require_memory
from fractalcontact.base.results import public_result
from fractalcontact.base.rng import RNGLike
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces import _from_array

WHERE = "fractalcontact.surfaces.weierstrass"
AUSLOOS = (
    "Ausloos and Berman, A multivariate Weierstrass-Mandelbrot function, Proceedings of the Royal Society of "
    "London A 400 (1985) 331-350"
)


def _check(problems: Problems) -> None:
    _from_array.check_axes(problems)
    problems.number("hurst", above=0, below=1)
    _from_array.check_length(problems, "rms_height")
    problems.number("ratio", above=1)
    problems.integer("ridges", at_least=1)
    _from_array.check_ensemble(problems)


@public_result(
    title="Weierstrass-Mandelbrot surface",
    references=AUSLOOS,
    achieved_error="exact to rounding: the rms height and the sum of the waves",
    check=_check,
    memory=17.0,
)
def weierstrass(
    shape: int | Sequence[int],
    spacing: float | Sequence[float],
    *,
    hurst: float,
    rms_height: float,
    ratio: float = 1.5,
    ridges: int = 10,
    members: int | None = None,
    rng: RNGLike = None,
) -> xr.DataArray:
    """Return a Weierstrass-Mandelbrot surface (Ausloos and Berman 1985).

    The heights are a sum of plane waves with wavelengths L, L/ratio, L/ratio^2 ... from the longer edge L
    down to two of the coarser spacings, amplitudes wavelength^hurst, `ridges` directions spread evenly over
    180 degrees for each wavelength, and random phases. With waves of all lengths the fractal dimension would
    be 3 - hurst.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile, with one wave for each wavelength.
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float
        Hurst exponent, above 0 and below 1.
    rms_height : float
        Root mean square height of this surface about its mean, in metres.
    ratio : float
        Ratio of successive wavelengths, above 1.
    ridges : int
        Number of directions of a plane.
    members : int, optional
        Number of independent surfaces, along a dim `member`. Member i is the same for any number of them.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7), or `json.loads(surface.attrs["provenance"])["random"]` of an earlier surface.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, zero mean, not periodic.

    Raises
    ------
    InvalidInput
        An argument is out of range, or the waves do not fit into memory.

    Notes
    -----
    The finite range of wavelengths biases the variogram; see the documentation, "Theory: surfaces".

    References
    ----------
    Ausloos and Berman (1985), Proceedings of the Royal Society of London A 400, 331-350.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.weierstrass((64, 64), 1e-3, hurst=0.8, rms_height=2e-4, rng=1)
    >>> round(float(surface.std()), 9)
    0.0002
    """
    sizes, steps = _from_array.sizes_and_steps(shape, spacing)
    extent = max(n * step for n, step in zip(sizes, steps, strict=True))
    wavelengths = 1 + int(math.log(extent / (2.0 * max(steps))) / math.log(float(ratio)) * ROUNDED)
    directions = int(ridges) if len(sizes) == 2 else 1
    # 4.1 to 4.6 numbers of each wave at a place along an axis: with a ratio near 1 far more than heights
    waves, places = wavelengths * directions, sum(sizes)
    require_memory(WHERE, 8.0 * 5.0 * waves * places, f"{waves:g} waves at {places} places along the axes")
    axes = [2.0 * math.pi * step / extent * np.arange(n) for n, step in zip(sizes, steps, strict=True)]

    def draw_heights(stream: np.random.Generator) -> tuple[Array, dict[str, Any]]:
        heights = _sum_of_waves(axes, float(ratio), float(hurst), wavelengths, directions, stream)
        heights -= heights.mean()
        heights *= float(rms_height) / math.sqrt(float(np.mean(heights**2)))
        return heights, {"wavelengths": wavelengths, "parameters": {"ridges": directions}}

    return _from_array.draw_ensemble(draw_heights, steps, members=members, rng=rng)


def _sum_of_waves(
    axes: Sequence[Array], ratio: float, hurst: float, waves: int, directions: int, rng: np.random.Generator
) -> Array:
    """Return the sum over wavelengths and directions; `axes` are 2 pi position / longest wavelength."""
    wavenumber = np.repeat(ratio ** np.arange(waves), directions)
    amplitude = wavenumber**-hurst
    azimuth = np.tile(np.pi * (np.arange(directions) + rng.random()) / directions, waves)
    phase = 2.0 * np.pi * rng.random(wavenumber.size)
    if len(axes) == 1:
        return np.asarray(
            np.einsum("k,ki->i", amplitude, np.cos(np.outer(wavenumber, axes[0]) + phase[:, None]))
        )
    across = np.outer(wavenumber * np.sin(azimuth), axes[0]) + phase[:, None]
    along = np.outer(wavenumber * np.cos(azimuth), axes[1])
    rows = np.concatenate([amplitude[:, None] * np.cos(across), -amplitude[:, None] * np.sin(across)])
    columns = np.concatenate([np.cos(along), np.sin(along)])
    return np.asarray(np.einsum("ki,kj->ij", rows, columns))
