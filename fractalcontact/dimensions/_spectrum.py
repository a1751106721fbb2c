"""Power spectral density of a surface, averaged over rings of wavenumbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.power_law import logarithm
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces

Array = np.ndarray[Any, np.dtype[Any]]
_NAMES = {2: "power_spectral_density", 1: "profile_power_spectral_density"}  # by number of axes


def _check(problems: Problems, *, surface: Any, window: Any, tile: Any) -> None:
    reserved = (*_NAMES.values(), "wavenumber", "wavelength", "mode_count", *ALWAYS)
    is_valid = check_surface(problems, surface, smallest=4, gaps=False, squares=True, reserved=reserved)
    if window is not None:
        problems.choice("window", window, ("auto", "hann", "none"))
    if problems.integer("tile", tile, at_least=8, optional=True) and is_valid and tile is not None:
        shortest = min(surface.sizes[dim] for dim in ("y", "x") if dim in surface.dims)
        problems.require(tile <= shortest, "tile", f"at most {shortest}", tile)


@public_result(
    title="Power spectral density of a surface",
    references=METHODS["spectrum"].references,
    achieved_error="relative standard error of each value sqrt(2 / mode_count), where no window mixes the "
    "modes",
    check=_check,
    in_blocks=True,
    memory=36.0,
)
def spectrum(surface: xr.DataArray, *, window: str | None = "auto", tile: int | None = None) -> xr.Dataset:
    """Return the radially averaged power spectral density of a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x) for a profile, without gaps.
    window : "auto", "hann" or None
        Taper of the free axes. "auto" is "hann" on free axes and None on periodic ones. With None, the
        edges of a free surface show as a tail q^-3. A plane is removed first, except where both axes are
        periodic; there only the mean is.
    tile : int, optional
        Average the spectra of square tiles of this edge in points, overlapping by half (Welch 1967): for
        surfaces that do not fit in memory, or for a smoother curve. Default: the whole surface.

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
    surfaces = read_surfaces(surface)
    taper = "none" if window is None else window
    curves = [spectrum_curve(single, taper, tile) for single in surfaces]
    slopes = [_local_slope(curve.scale, curve.value, curve.count) for curve in curves]
    name = _NAMES[surfaces[0].axes]
    wavelength = {"wavelength": ("wavenumber", 2.0 * np.pi / curves[0].scale)}
    return curve_dataset(
        surface, surfaces, "wavenumber", curves, slopes, value=name, count="mode_count", further=wavelength
    )


def spectrum_curve(surface: Surface, window: str, tile: int | None = None) -> Curve:
    """Return the ring averages of the power spectral density of one surface."""
    axes, spacing = surface.axes, surface.grid.spacing
    shape = surface.grid.shape if tile is None else (tile,) * axes
    periodic = surface.grid.periodic if tile is None else (False,) * axes
    tapers = tuple(
        "hann" if window == "hann" or (window == "auto" and not is_periodic) else None
        for is_periodic in periodic
    )
    total: Array | None = None
    number = 0
    for part in _tiles(surface, tile):
        heights = without_trend(part, plane=not all(periodic))
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
    return Curve(q, mean * (surface.unit**2 if tile is None else 1.0), count)


def without_trend(heights: Array, *, plane: bool) -> Array:
    """Return complete heights without their mean, or without the least-squares plane."""
    heights = heights - heights.mean()
    if not plane:
        return heights
    ny, nx = heights.shape
    x, y = np.arange(nx) - 0.5 * (nx - 1), np.arange(ny) - 0.5 * (ny - 1)
    # on a full rectangle the two slopes are independent
    tilt = np.sum(heights.sum(axis=0) * x) / (ny * np.sum(x * x)) * x
    rise = np.sum(heights.sum(axis=1) * y) / (nx * np.sum(y * y)) * y if ny > 1 else np.zeros(1)
    return np.asarray(heights - tilt - rise[:, None])


def _tiles(surface: Surface, tile: int | None) -> Iterator[Array]:
    """Yield the whole surface in scaled heights, or its tiles in metres."""
    if tile is None:
        yield surface.heights
        return
    ny, nx = surface.shape
    edge_y = min(tile, ny)
    for j in range(0, ny - edge_y + 1, max(edge_y // 2, 1)):
        if surface.is_lazy and surface.axes == 2:
            strip = np.asarray(surface.source.isel(y=slice(j, j + edge_y)).values, dtype=np.float64)
        else:
            strip = surface.raw[j : j + edge_y]
        for i in range(0, nx - tile + 1, tile // 2):
            yield strip[:, i : i + tile]


def _local_slope(scale: Array, value: Array, count: Array) -> Array:
    """Return the slope of a line through the points within a factor of sqrt 2, weighted by counts."""
    (x, _), (y, _) = logarithm(scale), logarithm(value)
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


_EXACT_RINGS = 128  # rings whose covariance is summed mode by mode
_LARGEST = 512  # points along an axis up to which the expectation is summed over all lags
_TAPER = (1.0, 4.0 / 9.0, 1.0 / 36.0)  # squared correlation of modes 0, 1 and 2 apart under a Hann window


def expected_spectrum(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> Array:
    """Return the expected ring averages of a fractional Brownian surface under a Hann window, up to a factor.

    The transform of the autocorrelation of the window times the covariance, which is known up to a constant
    that no mode beyond the first feels. For large surfaces the effect of the window, which depends on the
    number of waves in the surface, is taken from a smaller one.
    """
    factor = -(-max(shape) // _LARGEST)
    if abs(spacing[0] / spacing[1] - 1.0) > 1e-6:  # the sum over aliases is that of a square grid
        factor = 1
    small = shape if factor == 1 else (max(shape[0] // factor, 8), max(shape[1] // factor, 8))
    exact = spectra.radial_average(_tapered_power(small, spacing, hurst), small, spacing)[1]
    if factor == 1:
        return exact
    window_effect = exact / _ring_power_law(small, spacing, hurst)
    power = _ring_power_law(shape, spacing, hurst)
    near = min(power.size, window_effect.size // 2)
    power[:near] *= window_effect[:near] / window_effect[near - 1]
    return power


def _ring_power_law(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> Array:
    """Return the ring averages of the aliased power law, up to a factor."""
    y, x = (2.0 * np.pi * np.fft.fftfreq(n) for n in shape)
    x = x[: shape[1] // 2 + 1]
    with np.errstate(divide="ignore"):
        power = spectra.aliased_power_law((y[:, None], x), hurst, images=2)
    power[0, 0] = 0.0
    return spectra.radial_average(power, shape, spacing)[1]


def _tapered_power(shape: tuple[int, int], spacing: tuple[float, float], hurst: float) -> Array:
    """Return the expected power of the modes of a half-plane."""
    ratio, lags, weights = spacing[0] / spacing[1], [], []
    for n in shape:
        taper = spectra.window_weights(n, "hann")
        both = np.correlate(taper, taper, "full")
        # lags 0 ... n - 1, and those n less that have the same phase in every mode
        lags.append(np.stack([np.arange(n), np.arange(n) - n]).astype(float))
        weights.append(np.stack([both[n - 1 :], np.append(0.0, both[: n - 1])]))
    total = np.zeros(shape)
    for y, of_y in zip(lags[0], weights[0], strict=True):
        for x, of_x in zip(lags[1], weights[1], strict=True):
            squares = (y[:, None] * ratio) ** 2 + x**2
            total -= 0.5 * np.outer(of_y, of_x) * squares**hurst
    modes = np.fft.rfft2(total).real
    return np.asarray(np.maximum(modes, 1e-300))


def ring_covariance(
    counts: Array, shape: tuple[int, int], spacing: tuple[float, float], *, is_tapered: bool
) -> Array:
    """Return the covariance of the logarithms of all ring averages; `counts` are their numbers of modes.

    Without a window the modes are independent. Under a Hann window those up to two apart are correlated; far
    rings are so alike that the covariance with their neighbours can be counted as variance.
    """
    counts = np.maximum(np.asarray(counts, dtype=float), 1.0)
    if not is_tapered:
        return np.diag(2.0 / counts)
    total = (2.0 * sum(_TAPER) - _TAPER[0]) ** 2
    result = np.diag(2.0 * total / counts)
    edges = spectra.ring_edges(shape, spacing)
    rings = min(_EXACT_RINGS, edges.size - 1)
    lines = []
    for n, d in zip(shape, spacing, strict=True):
        step = 2.0 * np.pi / (n * d)
        reach = int(edges[rings] / step) + 3
        lines.append(step * np.arange(-reach, reach + 1))
    radius = np.hypot(lines[0][:, None], lines[1])
    ring = np.where(radius > 0.0, np.searchsorted(edges, radius, side="right") - 1, -1)
    held = np.unique(ring[(ring >= 0) & (ring < rings)])  # empty rings have no average
    number = np.full(edges.size + 1, -1)
    number[held] = np.arange(held.size)
    rings = min(held.size, counts.size)
    ring = number[ring]  # -1 at the mean and beyond
    inner = ring[2:-2, 2:-2]
    pairs = np.zeros((held.size**2,))
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            other = ring[2 + dy : ring.shape[0] - 2 + dy, 2 + dx : ring.shape[1] - 2 + dx]
            both = (inner >= 0) & (other >= 0)
            index = inner[both] * held.size + other[both]
            pairs += _TAPER[abs(dy)] * _TAPER[abs(dx)] * np.bincount(index, minlength=pairs.size)
    exact = 2.0 * pairs.reshape(held.size, held.size)[:rings, :rings]
    result[:rings, :rings] = exact / np.outer(counts[:rings], counts[:rings])
    return result
