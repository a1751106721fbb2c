"""Power spectral density of a surface, averaged over rings of wavenumbers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import detrended, logarithm
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, PERIODIC, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import (
    LARGEST,
    Scales,
    Surface,
    between,
    check_surface,
    read_surfaces,
)

# of the largest power: the square of the rounding of a height, 2^-53, with a margin of 64
_ROUNDING = 2.0**-100
_NAMES = {2: "power_spectral_density", 1: "profile_power_spectral_density"}  # by number of axes


def _check(problems: Problems) -> None:
    given = problems.given
    reserved = (*_NAMES.values(), "wavenumber", "wavelength", "mode_count", *ALWAYS)
    is_valid = check_surface(problems, smallest=4, gaps=False, reserved=reserved)
    if given.taper is not None:
        problems.choice("taper", among=("auto", "hann", "none"))
    if problems.integer("tile", at_least=8, optional=True) and is_valid and given.tile is not None:
        shortest = min(given.surface.sizes[dim] for dim in ("y", "x") if dim in given.surface.dims)
        problems.require(given.tile <= shortest, "tile", f"at most {shortest}")


@public_result(
    title="Power spectral density of a surface",
    references=METHODS["spectrum"].references,
    achieved_error="relative standard error of each value sqrt(2 / mode_count), where no taper mixes the "
    "modes",
    check=_check,
    in_blocks=True,
    memory=36.0,
)
def spectrum(surface: xr.DataArray, *, taper: str | None = "auto", tile: int | None = None) -> xr.Dataset:
    """Return the radially averaged power spectral density of a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x) for a profile, without gaps.
    taper : "auto", "hann" or None
        Of the free axes (a window function). "auto" is "hann" on free axes and None on periodic ones. With
        None, the edges of a free surface show as a tail q^-3. A plane is removed first, level along periodic
        axes.
    tile : int, optional
        Average the spectra of square tiles of this edge in points, overlapping by half (Welch 1967): for
        surfaces that do not fit in memory, or for a smoother curve. Default: the whole surface, of a dask
        array of more than 4096 x 4096 points tiles of 4096.

    Returns
    -------
    Dataset over `wavenumber` (rad m-1)
        `power_spectral_density` (m4), or `profile_power_spectral_density` (m3) of a profile; `mode_count`;
        `local_slope`, fitted over a factor of two in wavenumber; and `wavelength` (m). Rings are as wide as
        the spacing of the wavenumbers and go up to the smaller Nyquist wavenumber.

    Raises
    ------
    InvalidInput
        Heights are missing, an axis is not uniform, or a tile does not fit.

    Notes
    -----
    Convention: C(q) = dx dy |Z(q)|^2 / (nx ny), so that the integral of C over dqx dqy / (2 pi)^2 is the
    mean square height. For a self-affine surface C falls as q^(-2 - 2 H), for a profile as q^(-1 - 2 H).

    References
    ----------
    Jacobs, Junge and Pastewka (2017), Surface Topography: Metrology and Properties 5, 013001.

    Examples
    --------
    The slope of the spectrum gives the Hurst exponent:

    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.spectral((256, 256), 1e-3, hurst=0.7, rms_height=1e-5, rng=1)
    >>> curve = fc.dimensions.spectrum(surface)
    >>> slope = float(curve.local_slope.median())
    >>> round(-(slope + 2) / 2, 1)
    0.7
    """
    name = "none" if taper is None else taper
    shape = read_surfaces(surface)[0].grid.shape
    if tile is None and has_blocks(surface) and math.prod(shape) > LARGEST**2:
        tile = min(LARGEST ** (3 - len(shape)), *shape)
    return curve_dataset(
        surface,
        lambda single: ring_curve(single, name, tile),
        "wavenumber",
        _NAMES[2 if "y" in surface.dims else 1],
        count="mode_count",
        slope=_local_slope,
    ).assign_attrs(parameters={"tile": tile})


def ring_curve(surface: Surface, window: str = "auto", tile: int | None = None) -> Curve:
    """Return the ring averages of the power spectral density of one surface; 0 where they are rounding."""
    axes, spacing = surface.axes, surface.grid.spacing
    shape = surface.grid.shape if tile is None else (tile,) * axes
    periodic = surface.grid.periodic if tile is None else (False,) * axes
    tapered = [window == "hann" or (window == "auto" and not is_periodic) for is_periodic in periodic]
    tapers = tuple("hann" if is_tapered else None for is_tapered in tapered)
    total: Array | None = None
    number = 0
    for part in _tiles(surface, tile):
        heights = detrended(part, 1, (False, *periodic)[-2:])[0]
        power, _ = spectra.periodogram(heights if axes == 2 else heights[0], spacing, tapers)
        total = power if total is None else total + power
        number += 1
    assert total is not None  # a surface has a tile at least
    power = total / number
    if axes == 2:
        q, mean, count = spectra.radial_average(power, shape, spacing)
    else:
        q, mean = spectra.half_wavenumbers(shape, spacing)[0][1:], power[1:]
        count = spectra.half_weights(shape[0])[1:].astype(np.int64)
    mean = np.where(mean > _ROUNDING * mean.max(), mean, 0.0)
    return Curve(q, mean * (surface.unit**2 if tile is None else 1.0), count, has_wavenumbers=True)


def _tiles(surface: Surface, tile: int | None) -> Iterator[Array]:
    """Yield the whole surface in scaled heights, or its tiles in metres."""
    if tile is None:
        yield surface.heights
        return
    ny, nx = surface.shape
    edge_y = min(tile, ny)
    for j in range(0, ny - edge_y + 1, max(edge_y // 2, 1)):
        if surface.is_lazy and surface.axes == 2:
            strip = surface.source.isel(y=slice(j, j + edge_y)).values
        else:
            strip = surface.raw[j : j + edge_y]
        for i in range(0, nx - tile + 1, tile // 2):
            yield np.asarray(strip[:, i : i + tile], dtype=np.float64)


def _local_slope(curve: Curve) -> Array:
    """Return the slope of a line through the points within a factor of sqrt 2, weighted by counts."""
    scale, value, count = curve.scale, curve.value, curve.count
    x, y = logarithm(scale), logarithm(value)
    good = np.isfinite(y)
    weights = np.where(good, count, 0.0)
    y = np.where(good, y, 0.0)
    sums = np.stack([weights, weights * x, weights * y, weights * x * x, weights * x * y])
    sums = np.concatenate([np.zeros((5, 1)), np.cumsum(sums, axis=1)], axis=1)
    low = np.searchsorted(scale, scale / np.sqrt(2.0) * (1 - 1e-9))
    high = np.searchsorted(scale, scale * np.sqrt(2.0) * (1 + 1e-9))
    # the lowest wavenumbers have no neighbour within sqrt 2
    low, high = (
        np.minimum(low, np.arange(x.size) - 1).clip(0),
        np.maximum(high, np.arange(x.size) + 2).clip(max=x.size),
    )
    w, wx, wy, wxx, wxy = sums[:, high] - sums[:, low]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (w * wxy - wx * wy) / (w * wxx - wx * wx)
    return np.where(good & np.isfinite(slope), slope, np.nan)


def band_curve(surface: Surface, window: Scales) -> Curve:
    """Return the mean power in bands of half an octave between two wavelengths.

    `parts` of a band are the numbers of its modes by ring, the wavenumbers of the rings come last: (k + 1,
    rings). Free surfaces leave their power law at the short end first, where most of the modes are: each
    band has the same weight there, and each mode on periodic ones.
    """
    rings = ring_curve(surface)
    rings = rings.part(between(rings.length, window) & (rings.value > 0.0))
    if not rings.scale.size:
        return rings
    octaves = float(np.log2(rings.scale[-1] / rings.scale[0]))
    number = max(2, round(2.0 * octaves))
    band = np.log2(rings.scale / rings.scale[0]) * (number / max(octaves, 1e-9)) + 1e-9
    modes = np.where(np.minimum(band.astype(int), number - 1) == np.arange(number)[:, None], rings.count, 0)
    modes = modes[modes.any(axis=1)]
    count = modes.sum(axis=1)
    parts = np.concatenate([modes / count[:, None], np.broadcast_to(rings.scale, modes.shape)], axis=1)
    power = float(surface.axes) if all(surface.grid.periodic) else 0.0
    scale = np.exp(parts[:, : rings.scale.size] @ np.log(rings.scale))
    value = parts[:, : rings.scale.size] @ rings.value
    return Curve(scale, value, count, parts=parts, power=power, has_wavenumbers=True)


def expected_bands(surface: Surface, curve: Curve, hurst: float) -> Array:
    """Return the mean power expected in bands, up to a factor.

    A periodic surface has the power q^-p, p = 2 H plus the number of axes. The spectrum of a free surface is
    folded by the sampling (`spectra.aliased_power_law`), and seen through the Hann window, whose squared
    transform has the variance (2 pi / L)^2 / 3 along an axis of length L: to second order it adds half of
    that times the second derivative.
    """
    assert curve.parts is not None
    shares, q = np.split(curve.parts, 2, axis=1)
    q = q[0]
    if all(surface.grid.periodic):
        return np.asarray(shares @ q ** (-2.0 * hurst - surface.axes))
    p = 2.0 * hurst + surface.axes
    variance = sum((2.0 * np.pi / length) ** 2 / 3.0 for length in surface.grid.extent)
    if surface.axes == 1:
        power = spectra.aliased_line_power_law(q * surface.grid.spacing[0], hurst)
        return np.asarray(shares @ (power * (1.0 + 0.5 * variance * p * (p + 1.0) / q**2)))
    angle = (np.arange(8) + 0.5) * (np.pi / 16.0)  # the second quarter turn is the same
    waves = q[:, None] * np.sin(angle), q[:, None] * np.cos(angle)
    power = spectra.aliased_power_law(waves, hurst, images=2, spacing=surface.spacing).mean(axis=1)
    return np.asarray(shares @ (power * (1.0 + 0.25 * variance * p * p / q**2)))


def band_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    """Return the covariance of the logarithms of the mean power in bands.

    The power of an independent mode has a relative variance of 1, and each is counted twice, with its
    conjugate. Under a Hann window modes 1 and 2 apart along an axis have squared correlations of 4/9 and
    1/36, so that there are fewer independent ones by a factor of 35/18. Modes on both sides of an edge of a
    band are correlated, too; counted as variance of the bands this makes standard errors too large, by a
    tenth at most.
    """
    is_periodic = all(surface.grid.periodic)
    if any(surface.grid.periodic) and not is_periodic:
        return PERIODIC
    if not is_periodic and curve.length.max() > 0.25 * min(surface.grid.extent):
        return "waves longer than a quarter of a free surface are mixed by its window: see `scales`"
    factor = 1.0 if is_periodic else (35.0 / 18.0) ** surface.axes
    assert curve.parts is not None
    shares, q = np.split(curve.parts, 2, axis=1)
    power = (q[0] / q[0, 0]) ** (-2.0 * hurst - surface.axes)
    return np.diag(2.0 * factor / curve.count * (shares @ power**2) / (shares @ power) ** 2)
