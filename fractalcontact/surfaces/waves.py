"""Weierstrass surfaces: sums of cosines at geometric wavelengths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.rng import RNGLike
from fractalcontact.surfaces import _arguments

if TYPE_CHECKING:
    import xarray as xr

AUSLOOS = (
    "Ausloos and Berman, A multivariate Weierstrass-Mandelbrot function, Proceedings of the Royal Society of "
    "London A 400 (1985) 331-350"
)
Array = np.ndarray[Any, np.dtype[Any]]


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

    The heights are a sum of plane waves: wavelengths L, L/ratio, L/ratio^2 ... from the longer edge L down to
    two of the coarser spacings, amplitudes as wavelength^hurst, `ridges` directions spread evenly over half a
    turn for each wavelength, random phases. With waves of all lengths its variogram would follow r^(2 hurst)
    with ripples of period `ratio` in log r, and its fractal dimension would be 3 - hurst; see the notes.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile, with one wave for each wavelength.
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float
        Hurst exponent, above 0 and below 1.
    rms_height : float
        Root mean square height of this surface about its mean, in metres, to rounding.
    ratio : float
        Ratio of successive wavelengths, above 1.
    ridges : int
        Number of directions of a plane.
    members : int, optional
        Return this many independent surfaces along a dim `member`, from streams of their own.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7) of the phases and of the first direction; its record is kept, and
        `json.loads(surface.attrs["provenance"])["random"]` given here makes the same surface again.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, zero mean, not periodic.

    Raises
    ------
    InvalidInput
        An argument is out of range.

    Notes
    -----
    The waves end at both sides, which a variogram feels: fitted over lags of 2 to 32 spacings on 256 x 256
    points its slope is that of an exponent of .22, .50 and .76 for hurst = .1, .5 and .9, as the sum over the
    waves, amplitude^2 (1 - J0(2 pi r / wavelength)), has it. The amplitudes themselves are exact.

    References
    ----------
    Ausloos and Berman (1985), A multivariate Weierstrass-Mandelbrot function, Proceedings of the Royal
    Society of London A 400, 331-350.
    """
    with Problems("fractalcontact.surfaces.weierstrass") as problems:
        sizes = _arguments.plane_shape(problems, shape)
        steps = _arguments.plane_spacing(problems, spacing, len(sizes))
        exponent = problems.number("hurst", hurst, above=0, below=1)
        rms = _arguments.length(problems, "rms_height", rms_height)
        factor = problems.number("ratio", ratio, above=1)
        directions = problems.integer("ridges", ridges, at_least=1)
        count = None if members is None else problems.integer("members", members, at_least=1)
    extent = max(n * step for n, step in zip(sizes, steps, strict=True))
    waves = 1 + int(math.log(extent / (2.0 * max(steps))) / math.log(factor) * (1.0 + 1e-12))
    directions = directions if len(sizes) == 2 else 1
    axes = [2.0 * math.pi * step / extent * np.arange(n) for n, step in zip(sizes, steps, strict=True)]

    def one(stream: np.random.Generator) -> _arguments.Made:
        heights = _sum_of_waves(axes, factor, exponent, waves, directions, stream)
        heights -= heights.mean()
        heights *= rms / math.sqrt(float(np.mean(heights**2)))
        error = "rounding: the rms height is as asked, and the ripples are those of the waves"
        return heights, {"wavelengths": waves, "achieved_error": error}

    return _arguments.make(
        one,
        rng,
        count,
        steps,
        call="weierstrass",
        parameters={
            "shape": sizes,
            "spacing": steps,
            "hurst": exponent,
            "rms_height": rms,
            "ratio": factor,
            "ridges": directions,
        },
        title="Weierstrass-Mandelbrot surface",
        references=AUSLOOS,
    )


def _sum_of_waves(
    axes: Sequence[Array], ratio: float, hurst: float, waves: int, directions: int, rng: np.random.Generator
) -> Array:
    """Return the sum over wavelengths and directions; `axes` are 2 pi position over the longest."""
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
