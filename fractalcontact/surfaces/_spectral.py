"""Periodic self-affine surfaces with cut-offs: Gaussian noise filtered to a power spectrum."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.compass import check_direction, read_direction
from fractalcontact.base.numbers import ROUNDED, Array, float_array, power_of_two
from fractalcontact.base.results import public_result
from fractalcontact.base.rng import RNGLike
from fractalcontact.base.schema import HURST_RANGE
from fractalcontact.base.spectra import half_wavenumbers, half_weights
from fractalcontact.base.validation import NONE, Problems, given_option
from fractalcontact.surfaces import _from_array

JACOBS = (
    "Jacobs, Junge and Pastewka, Quantitative characterization of surface topography using spectral "
    "analysis, Surface Topography: Metrology and Properties 5 (2017) 013001"
)

# modes drawn at a time, which bounds the memory; their order depends on it. 2^13 to 2^20 take the same time
# within a tenth for 1024 x 1024 points
BLOCK = 1 << 15
Cutoffs = dict[str, float | None]  # long_cutoff, rolloff and short_cutoff, in m


def _check(problems: Problems) -> None:
    given = problems.given
    valid_plane = _from_array.check_axes(problems)
    axes = np.size(given.shape) if valid_plane else 2
    valid_hurst = problems.numbers("hurst", **{**HURST_RANGE, "at_most": 1.0}) and problems.require(
        np.size(given.hurst) <= axes, "hurst", "one number" + (" or (y, x)" if axes == 2 else "")
    )
    problems.exactly_one(rms_height=given.rms_height, rms_slope=given.rms_slope)
    _from_array.check_length(problems, "rms_height", optional=True)
    _from_array.check_length(problems, "rms_slope", optional=True)
    cutoffs = {name: getattr(given, name) for name in ("long_cutoff", "rolloff", "short_cutoff")}
    valid_cutoffs = [_from_array.check_length(problems, name, optional=True) for name in cutoffs]
    if valid_plane and all(valid_cutoffs):
        _check_order(problems, cutoffs)
    problems.choice("normalise", among=("realisation", "expectation"))
    check_direction(problems)
    # beyond the ratio of extent to spacing of any grid
    if problems.number("anisotropy_ratio", at_least=1e-6, at_most=1e6):
        one_exponent = not valid_hurst or len(set(float_array(given.hurst))) == 1
        isotropic = float(given.anisotropy_ratio) == 1.0
        problems.require(isotropic or one_exponent, "anisotropy_ratio", "1 with two Hurst exponents")
        problems.require(isotropic or axes == 2, "anisotropy_ratio", "1 for a profile")
    _from_array.check_ensemble(problems)
    if not problems.messages:
        sizes = given.members or 1, *np.atleast_1d(given.shape)
        _from_array.check_memory(problems.where, sizes)  # before a look at all the modes
        band = _Band.of(
            given.shape, given.spacing, given.hurst, cutoffs, given.anisotropy_ratio, given.direction
        )
        _check_modes(problems, band, given.shape, given.spacing)


def _check_order(problems: Problems, cutoffs: Cutoffs) -> None:
    """Check that short_cutoff <= rolloff <= long_cutoff and that the grid resolves the short cut-off."""
    given = problems.given
    sizes, steps = _from_array.sizes_and_steps(given.shape, given.spacing)
    longest, corner, shortest = _wavelengths(sizes, steps, cutoffs)
    if given.short_cutoff is not None:
        least = 2.0 * min(steps)
        expected = f"at least two spacings, {least:g} m"
        problems.require(shortest * ROUNDED >= least, "short_cutoff", expected, shortest)
    if given.rolloff is not None:
        expected = f"at most long_cutoff, {longest:g} m"
        problems.require(corner <= longest * ROUNDED, "rolloff", expected, corner)
    expected = f"at most {corner:g} m, where the density begins to fall"
    problems.require(shortest <= corner * ROUNDED, "short_cutoff", expected, shortest)


@public_result(
    title="Self-affine surface from its power spectrum", references=JACOBS, check=_check, memory=17.0
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
    direction: str | float = "E",
    members: int | None = None,
    rng: RNGLike = None,
) -> xr.DataArray:
    """Return a periodic Gaussian surface with a self-affine spectrum between cut-offs.

    The power spectral density C(q) is flat between the wavelengths `long_cutoff` and `rolloff`, falls as
    q^(-2 - 2 hurst) down to `short_cutoff`, and is zero outside. Unlike those of `fbm`, its increments follow
    the power law only well inside the band.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile, with density q^(-1 - 2 hurst).
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float, or (y, x)
        Hurst exponent, 0.01 to 1; two exponents make a surface self-affine with one along each axis.
    rms_height, rms_slope : float
        Exactly one: root mean square height (m), or that of the gradient with both its components.
    long_cutoff, rolloff, short_cutoff : float, optional
        Wavelengths in metres, long_cutoff >= rolloff >= short_cutoff. Default: all modes of the grid, and no
        plateau.
    normalise : {"realisation", "expectation"}
        Whether this surface has the rms value, to rounding, or the expectation over all surfaces.
    anisotropy_ratio : float
        Correlations are `anisotropy_ratio` times as long along `direction` as across it; only with one
        exponent. The cut-offs are those of the isotropic surface.
    direction : str or float
        Compass word, or degrees anticlockwise from E.
    members : int, optional
        Number of independent surfaces, along a dim `member`. Member i is the same for any number of them.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7), or `json.loads(surface.attrs["provenance"])["random"]` of an earlier surface.

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
    `SelfAffine` has the closed forms of this spectrum. See the documentation, "Theory: surfaces".

    References
    ----------
    Jacobs, Junge and Pastewka (2017), Surface Topography: Metrology and Properties 5, 013001.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.spectral((64, 64), 1e-6, hurst=0.8, rms_slope=0.1, rolloff=3.2e-5, rng=1)
    >>> round(float(fc.surfaces.describe(surface).rms_slope), 6)
    0.1
    """
    sizes, steps = _from_array.sizes_and_steps(shape, spacing)
    target, rms = given_option(rms_height=rms_height, rms_slope=rms_slope)
    of_slope, expected = target == "rms_slope", normalise == "expectation"
    unit = power_of_two(max(steps))
    cutoffs = {"long_cutoff": long_cutoff, "rolloff": rolloff, "short_cutoff": short_cutoff}
    band = _Band.of(shape, spacing, hurst, cutoffs, anisotropy_ratio, direction)
    plane, scaled = _plane(shape, spacing)

    def draw_heights(stream: np.random.Generator) -> tuple[Array, dict[str, Any]]:
        modes, energy = _filtered_modes(plane, scaled, band, stream, slope=of_slope, expected=expected)
        heights = fft.irfft2(modes, plane, overwrite=True)
        mean_square = _multiply(heights, float(rms) / math.sqrt(energy) * (unit if of_slope else 1.0))
        error = _achieved_error(math.sqrt(mean_square / energy), target, expected)
        return heights.reshape(sizes), {"achieved_error": error}

    return _from_array.draw_ensemble(draw_heights, steps, members=members, rng=rng, periodic=True)


def _wavelengths(sizes: Sequence[int], steps: Sequence[float], cutoffs: Cutoffs) -> tuple[float, ...]:
    """Return the three wavelengths of the band in metres; inf and 0 where there is no cut-off."""
    extent = max(n * step for n, step in zip(sizes, steps, strict=True))
    longest = math.inf if cutoffs["long_cutoff"] is None else float(cutoffs["long_cutoff"])
    corner = min(longest, extent) if cutoffs["rolloff"] is None else float(cutoffs["rolloff"])
    shortest = 0.0 if cutoffs["short_cutoff"] is None else float(cutoffs["short_cutoff"])
    return longest, corner, shortest


def _plane(shape: Any, spacing: Any) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return the shape (ny, nx), ny = 1 of a profile, and the spacing over the power of two above it."""
    sizes, steps = _from_array.sizes_and_steps(shape, spacing)
    unit = power_of_two(max(steps))
    return ((1, *sizes)[-2], sizes[-1]), ((1.0, *steps)[-2] / unit, steps[-1] / unit)


def _check_modes(problems: Problems, band: _Band, shape: Any, spacing: Any) -> None:
    """Check that some mode of the grid lies inside the band."""
    waves_y, waves_x = half_wavenumbers(*_plane(shape, spacing))
    has_modes = any(band.amplitude(row, waves_x).any() for row in waves_y[:, None])
    expected = "at least one mode of the grid between them"
    problems.require(has_modes, "long_cutoff / short_cutoff", expected, NONE)


def _multiply(heights: Array, factor: float) -> float:
    """Multiply heights in place, in blocks that fit into the cache; return their mean square before."""
    squares = np.empty(len(heights))
    rows = max(1, BLOCK // heights.shape[1])
    for start in range(0, len(heights), rows):
        block = heights[start : start + rows]
        np.einsum("ij,ij->i", block, block, out=squares[start : start + rows])
        block *= factor
    return float(squares.sum()) / heights.size


def _achieved_error(relative_rms: float, target: str, expected: bool) -> str:
    """Describe the error of the rms, from the rms of the heights over the target.

    The rms slope is a sum over modes, so it has only the error of rounding.
    """
    quantity = target.replace("_", " ")
    chance = ", by chance: the expectation over all surfaces is exact" if expected else ""
    if target == "rms_slope":
        return (
            f"sampling error of the {quantity}{chance}" if expected else f"exact to rounding: the {quantity}"
        )
    return f"{max(abs(relative_rms - 1.0), np.finfo(float).eps):.1e} of the {quantity}{chance}"


@dataclass(frozen=True)
class _Band:
    """A self-affine spectrum with a plateau, up to a factor, as a function of an effective wavenumber.

    Attributes
    ----------
    hurst : tuple of float
        Along y and x.
    low, corner, high : float
        Wavenumbers of the long cut-off, the roll-off and the short cut-off; 0 and inf for none.
    anisotropy_ratio, azimuth : float
        Correlations are `anisotropy_ratio` times as long along the azimuth `azimuth` (radian) as across it.
    axes : int
        1 for a profile: its spectrum falls with 1 + 2 hurst, not 2 + 2 hurst.
    """

    hurst: tuple[float, float]
    low: float
    corner: float
    high: float
    anisotropy_ratio: float = 1.0
    azimuth: float = 0.0
    axes: int = 2

    @classmethod
    def of(
        cls,
        shape: Any,
        spacing: Any,
        hurst: Any,
        cutoffs: Cutoffs,
        anisotropy_ratio: float,
        direction: str | float,
    ) -> _Band:
        """Return the band of a surface, with wavenumbers in rad per power of two above the spacing."""
        sizes, steps = _from_array.sizes_and_steps(shape, spacing)
        unit = power_of_two(max(steps))
        low, corner, high = (
            2.0 * math.pi / (length / unit) if length > 0 else math.inf
            for length in _wavelengths(sizes, steps, cutoffs)
        )
        exponents, azimuth = float_array(hurst), math.radians(read_direction(direction).azimuth)
        both = float(exponents[0]), float(exponents[-1])
        return cls(both, low, corner, high, float(anisotropy_ratio), azimuth, len(sizes))

    @property
    def mean_hurst(self) -> float:
        """Harmonic mean of the two exponents."""
        return 2.0 / (1.0 / self.hurst[0] + 1.0 / self.hurst[1])

    def amplitude(self, qy: Array, qx: Array) -> Array:
        """Return the square root of the density at wavenumbers that broadcast; 0 outside the band."""
        square = self._square(qy, qx)
        outside = square == 0.0
        if self.low > 0.0:
            outside |= square < (self.low / ROUNDED) ** 2
        if np.isfinite(self.high):
            outside |= square > (self.high * ROUNDED) ** 2
        square *= self.corner**-2.0
        np.maximum(square, 1.0, out=square)
        amplitude = np.power(square, -0.5 * (0.5 * self.axes + self.mean_hurst), out=square)
        amplitude[outside] = 0.0
        return amplitude

    def _square(self, qy: Array, qx: Array) -> Array:
        """Return the square of the effective wavenumber."""
        if self.anisotropy_ratio != 1.0:
            cosine, sine = np.cos(self.azimuth), np.sin(self.azimuth)
            along = np.sqrt(self.anisotropy_ratio) * (qx * cosine + qy * sine)
            across = (qy * cosine - qx * sine) / np.sqrt(self.anisotropy_ratio)
            return np.asarray(along**2 + across**2)
        if self.hurst[0] == self.hurst[1]:
            return np.asarray(qy**2 + qx**2)
        mean = self.mean_hurst
        powers = [
            np.abs(q / self.corner) ** (2.0 * own / mean) for own, q in zip(self.hurst, (qy, qx), strict=True)
        ]
        return np.asarray(self.corner**2 * (powers[0] + powers[1]))

    def grid_amplitude(self, qy: Array, qx: Array, nyquist: tuple[float, float]) -> Array:
        """Return `amplitude`; a Nyquist mode stands for two waves and has the mean of their powers."""
        amplitude = self.amplitude(qy, qx)
        if self.anisotropy_ratio == 1.0:
            return amplitude
        mirrored = self.amplitude(-qy, qx)
        y_is_last, x_is_last = np.abs(qy) * ROUNDED >= nyquist[0], qx * ROUNDED >= nyquist[1]
        return np.where(y_is_last | x_is_last, np.sqrt(0.5 * (amplitude**2 + mirrored**2)), amplitude)


def _filtered_modes(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    band: _Band,
    rng: np.random.Generator,
    *,
    slope: bool,
    expected: bool,
) -> tuple[Array, float]:
    """Draw the modes of one surface on the half-plane, and their energy.

    Parameters
    ----------
    shape, spacing : pairs
        (ny, nx) and (dy, dx); ny = 1 makes a profile.
    band : _Band
    rng : Generator
    slope : bool
        The energy is the mean square gradient, else the mean square height.
    expected : bool
        The energy is the expectation over all surfaces, else that of these modes.

    Returns
    -------
    modes : ndarray of complex, shape (ny, nx//2 + 1)
        Modes of a real transform: irfft2 gives heights with this energy.
    energy : float
    """
    ny, nx = shape
    waves_y, waves_x = half_wavenumbers(shape, spacing)
    reach_y, reach_x = _reach(band, waves_y, waves_x)
    nyquist = (np.pi / spacing[0], np.pi / spacing[1])
    modes = np.zeros((ny, waves_x.size), dtype=np.complex128)
    numbers = modes.view(np.float64)
    mirrored = [column for column in ((0, nx // 2) if nx % 2 == 0 else (0,)) if column < reach_x]
    weights = np.repeat(half_weights(nx)[:reach_x], 2)
    weights[[2 * column + part for column in mirrored for part in (0, 1)]] = (
        0.0  # self-conjugate columns are added at the end
    )
    slope_weights = weights * np.repeat(waves_x[:reach_x], 2) ** 2
    across, along = np.zeros(ny), np.zeros(ny)
    own = np.zeros((ny, len(mirrored)))
    scratch = np.empty((max(1, BLOCK // reach_x), 2 * reach_x))
    for rows, doubled in _rows(band, waves_y, waves_x[:reach_x], nyquist, reach_y, len(scratch)):
        own[rows] = doubled[:, [2 * column for column in mirrored]]
        noise = rng.standard_normal(out=scratch[: len(doubled)])
        drawn = np.multiply(noise, doubled, out=numbers[rows, : 2 * reach_x])
        square = np.square(doubled if expected else drawn, out=noise)
        across[rows] = np.einsum("ij,j->i", square, weights)
        if slope:
            along[rows] = np.einsum("ij,j->i", square, slope_weights)
    for place, column in enumerate(mirrored):
        modes[:, column] = _hermitian(modes[:, column])
        line = 2.0 * own[:, place] ** 2 if expected else np.abs(modes[:, column]) ** 2
        across += line
        along += line * waves_x[column] ** 2
    energy = (along + across * waves_y**2).sum() if slope else across.sum()
    return modes, float(energy) / (float(nx) * ny) ** 2


def _rows(
    band: _Band, waves_y: Array, waves_x: Array, nyquist: tuple[float, float], reach: int, size: int
) -> Iterator[tuple[slice, Array]]:
    """Yield blocks of rows with their amplitudes, doubled for real and imaginary part, then their mirrors."""

    def amplitudes(rows: slice) -> Array:
        return np.repeat(band.grid_amplitude(waves_y[rows, None], waves_x, nyquist), 2, axis=1)

    ny = waves_y.size
    for start in range(0, reach, size):
        rows = slice(start, min(start + size, reach))
        doubled = amplitudes(rows)
        yield rows, doubled
        first, last = max(rows.start, 1), min(rows.stop - 1, (ny - 1) // 2)
        if first > last:
            continue
        mirror = slice(ny - last, ny - first + 1)
        if band.anisotropy_ratio == 1.0:
            yield mirror, doubled[first - rows.start : last - rows.start + 1][::-1]
        else:
            yield mirror, amplitudes(mirror)


def _hermitian(column: Array) -> Array:
    """Return a column equal to its mirrored conjugate, with the power of the given one."""
    return np.asarray((column + np.conj(np.roll(column[::-1], 1))) * np.sqrt(0.5))


def _reach(band: _Band, waves_y: Array, waves_x: Array) -> tuple[int, int]:
    """Return the number of rows (from either end) and of columns that can have modes inside the band."""
    if not np.isfinite(band.high) or band.anisotropy_ratio != 1.0 or band.hurst[0] != band.hurst[1]:
        return waves_y.size // 2 + 1, waves_x.size
    high = band.high * ROUNDED
    rows = np.count_nonzero(np.abs(waves_y[: waves_y.size // 2 + 1]) <= high)
    return int(rows), int(np.count_nonzero(waves_x <= high))
