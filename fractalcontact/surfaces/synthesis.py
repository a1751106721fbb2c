"""Periodic self-affine surfaces with cut-offs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.checks import Problems
from fractalcontact.base.rng import RNGLike
from fractalcontact.base.spectra import SelfAffine as SelfAffine
from fractalcontact.surfaces import _arguments
from fractalcontact.surfaces._filtering import BLOCK, Band, filtered_modes

if TYPE_CHECKING:
    import xarray as xr

JACOBS = (
    "Jacobs, Junge and Pastewka, Quantitative characterization of surface topography using spectral "
    "analysis, Surface Topography: Metrology and Properties 5 (2017) 013001"
)


def spectral(
    shape: int | Sequence[int],
    spacing: float | Sequence[float],
    *,
    hurst: float | Sequence[float],
    rms_height: float | None = None,
    rms_slope: float | None = None,
    long_cutoff: float | None = None,
    rolloff: float | None = None,
    short_cutoff: float | None = None,
    normalise: str = "realisation",
    anisotropy_ratio: float = 1.0,
    azimuth: float = 0.0,
    members: int | None = None,
    rng: RNGLike = None,
) -> xr.DataArray:
    """Return a periodic Gaussian surface with a self-affine spectrum between cut-offs.

    The power spectral density C(q) is flat between the wavelengths `long_cutoff` and `rolloff`, falls as
    q^(-2 - 2 hurst) down to `short_cutoff`, and is zero outside. This is another family than `fbm`: its
    increments follow the power law only well inside the band.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile, whose density falls as
        q^(-1 - 2 hurst).
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float, or (y, x)
        Hurst exponent, .01 to 1. Two exponents make a surface that is self-affine with one of them along
        y and the other along x: the density is that of their harmonic mean H in the effective wavenumber
        q0 ((q_x/q0)^(2 H_x/H) + (q_y/q0)^(2 H_y/H))^(1/2), q0 that of the roll-off.
    rms_height, rms_slope : float
        Exactly one: the root mean square height (m), or that of the gradient with both its components,
        which is the sum of |q|^2 C over all modes.
    long_cutoff, rolloff, short_cutoff : float, optional
        Wavelengths in metres, long_cutoff >= rolloff >= short_cutoff. Default: the long cut-off is the
        whole extent (no mode is left out), the roll-off is the long cut-off (no plateau), and there is no
        short cut-off (every mode the grid can carry).
    normalise : {"realisation", "expectation"}
        Whether this very surface has the rms asked for, to rounding, or the mean square over all surfaces.
    anisotropy_ratio, azimuth : float
        Correlations are `anisotropy_ratio` times as long along the azimuth `azimuth` (degree, E = 0,
        anticlockwise) as across it. Lengths along grow by sqrt(anisotropy_ratio) and lengths across shrink by
        it; the cut-offs are those before stretching. Not together with two exponents.
    members : int, optional
        Return this many independent surfaces along a dim `member`, from streams of their own.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7); its record is kept, and `json.loads(surface.attrs["provenance"])["random"]`
        given here makes the same surface again.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres, zero mean, periodic (attribute `period` of x and y).

    Raises
    ------
    InvalidInput
        An argument is out of range, or no mode of the grid lies between the cut-offs.

    Notes
    -----
    Closed forms of this spectrum, its moments, autocorrelation and profiles: `SelfAffine`. The Nyquist
    modes of an even grid carry the full density; they count with |q|^2 in the mean square gradient.
    With two exponents the spectrum has them to its end. Increments show them less well, the smoother axis
    above all, for the short waves across it that belong to them end at the grid: 512 x 512 points of
    (0.5, 0.8) give 0.53 to 0.47 along y over lags of 2 to 32 points, and 0.92 to 0.73 along x.
    Memory: two arrays of n x n numbers.

    References
    ----------
    Jacobs, Junge and Pastewka (2017), Surface Topography: Metrology and Properties 5, 013001.
    """
    with Problems("fractalcontact.surfaces.spectral") as problems:
        sizes = _arguments.plane_shape(problems, shape)
        steps = _arguments.plane_spacing(problems, spacing, len(sizes))
        exponents = _exponents(problems, hurst, len(sizes))
        target = problems.exactly_one(rms_height=rms_height, rms_slope=rms_slope)
        wanted = {"rms_height": rms_height, "rms_slope": rms_slope}[target]
        rms = 1.0 if wanted is None else _arguments.length(problems, target, wanted)
        cutoffs = _cutoffs(problems, sizes, steps, long_cutoff, rolloff, short_cutoff)
        problems.choice("normalise", normalise, ("realisation", "expectation"))
        ratio = problems.number("anisotropy_ratio", anisotropy_ratio, at_least=1e-6, at_most=1e6)
        angle = problems.number("azimuth", azimuth)
        if ratio != 1.0:
            problems.require(
                exponents[0] == exponents[1],
                "anisotropy_ratio",
                "1 with two Hurst exponents",
                anisotropy_ratio,
            )
            problems.require(len(sizes) == 2, "anisotropy_ratio", "1 for a profile", anisotropy_ratio)
        count = None if members is None else problems.integer("members", members, at_least=1)
        unit = _power_of_two(max(steps))
        band = _band(exponents, cutoffs, unit, ratio, math.radians(angle), len(sizes))
        _require_modes(problems, band, sizes, steps, unit)

    plane = (1, *sizes)[-2:]
    expected = normalise == "expectation"
    scaled = ((1.0, *steps)[-2] / unit, steps[-1] / unit)

    def one(stream: np.random.Generator) -> _arguments.Made:
        modes, energy = filtered_modes(
            (plane[0], plane[1]), scaled, band, stream, slope=target == "rms_slope", expected=expected
        )
        heights = fft.irfft2(modes, (plane[0], plane[1]), overwrite=True)
        mean_square = _scale(heights, rms / math.sqrt(energy) * (unit if target == "rms_slope" else 1.0))
        facts = {"achieved_error": _error(math.sqrt(mean_square / energy), target, expected)}
        return heights.reshape(sizes), facts

    return _arguments.make(
        one,
        rng,
        count,
        steps,
        call="spectral",
        parameters={
            "shape": sizes,
            "spacing": steps,
            "hurst": exponents if exponents[0] != exponents[1] else exponents[0],
            target: rms,
            "long_cutoff": long_cutoff,
            "rolloff": rolloff,
            "short_cutoff": short_cutoff,
            "normalise": normalise,
            "anisotropy_ratio": ratio,
            "azimuth": angle,
        },
        title="Self-affine surface from its power spectrum",
        references=JACOBS,
        periodic=True,
    )


def _scale(heights: np.ndarray[Any, np.dtype[Any]], factor: float) -> float:
    """Multiply heights in place, rows that fit into the cache at a time; return their mean square before."""
    squares = np.empty(len(heights))
    rows = max(1, BLOCK // heights.shape[1])
    for start in range(0, len(heights), rows):
        block = heights[start : start + rows]
        np.einsum("ij,ij->i", block, block, out=squares[start : start + rows])
        block *= factor
    return float(squares.sum()) / heights.size


def _error(found: float, target: str, expected: bool) -> str:
    """Return in words how far the rms, found in units of the one asked for, is from it.

    That of the slope is summed over modes.
    """
    words = target.replace("_", " ")
    note = ", by chance: the mean square over all surfaces is as asked" if expected else ""
    if target == "rms_slope":
        return f"that of the {words}{note}" if expected else f"rounding, in the {words}"
    return f"{max(abs(found - 1.0), np.finfo(float).eps):.1e} of the {words}{note}"


def _exponents(problems: Problems, hurst: Any, axes: int) -> tuple[float, float]:
    values = problems.numbers("hurst", hurst, at_least=0.01, at_most=1.0)
    if values.size > axes:
        problems.add("hurst", "one number" + (" or (y, x)" if axes == 2 else ""), hurst)
        return (0.5, 0.5)
    return float(values[0]), float(values[-1])


def _cutoffs(
    problems: Problems,
    sizes: Sequence[int],
    steps: Sequence[float],
    long_cutoff: float | None,
    rolloff: float | None,
    short_cutoff: float | None,
) -> tuple[float, float, float]:
    """Return the three wavelengths in metres; inf and 0 where nothing is cut off."""
    extent = max(n * step for n, step in zip(sizes, steps, strict=True))
    longest = math.inf if long_cutoff is None else _arguments.length(problems, "long_cutoff", long_cutoff)
    corner = min(longest, extent) if rolloff is None else _arguments.length(problems, "rolloff", rolloff)
    shortest = 0.0 if short_cutoff is None else _arguments.length(problems, "short_cutoff", short_cutoff)
    if short_cutoff is not None:
        least = 2.0 * min(steps) * (1.0 - 1e-9)
        problems.require(
            shortest >= least, "short_cutoff", f"at least two spacings, {2 * min(steps):g} m", shortest
        )
    if rolloff is not None:
        problems.require(
            corner <= longest * (1 + 1e-9), "rolloff", f"at most long_cutoff, {longest:g} m", corner
        )
    problems.require(
        shortest <= corner * (1 + 1e-9), "short_cutoff", f"at most the roll-off, {corner:g} m", shortest
    )
    return longest, corner, shortest


def _band(
    exponents: tuple[float, float],
    cutoffs: tuple[float, float, float],
    unit: float,
    anisotropy_ratio: float,
    azimuth: float,
    axes: int,
) -> Band:
    low, corner, high = (2.0 * math.pi / (length / unit) if length > 0 else math.inf for length in cutoffs)
    return Band(exponents, low, corner, high, anisotropy_ratio, azimuth, axes)


def _require_modes(
    problems: Problems, band: Band, sizes: Sequence[int], steps: Sequence[float], unit: float
) -> None:
    """Note a problem unless some mode of the grid lies inside the band."""
    if problems.found:
        return
    waves = [
        2.0 * math.pi / (n * step / unit) * np.arange(n // 2 + 1)
        for n, step in zip(sizes, steps, strict=True)
    ]
    waves_y = waves[0][:, None] if len(sizes) == 2 else np.zeros((1, 1))
    found = any(band.amplitude(row, waves[-1]).any() for row in waves_y)
    problems.require(
        found, "long_cutoff / short_cutoff", "at least one mode of the grid between them", "none"
    )


def _power_of_two(length: float) -> float:
    return math.ldexp(1.0, math.frexp(length)[1])
