"""Map of the Hurst exponent: windows that move over a surface share the blur and the noise of its model.

The model is that of `likelihood`. All windows have modes and bins alike, so that one table holds the expected
powers of all of them.

1. The logarithms of the bins are averaged over the windows. Where the exponent differs from place to place
   their mean has the mean exponent: logarithms of powers are nearly linear in H. The posterior of this mean
   gives the blur, the noise and the bend, with their probabilities.
2. At each combination of them amplitude and exponent of each window are fitted to its difference from the
   mean: what the model does not hold is alike in all windows, and drops out.
3. The variance of the exponent of a window is that of its own modes plus that of the mean due to the
   nuisances. The first is multiplied by chi square per degree of freedom where that is above one, as the
   Particle Data Group does; windows count in the mean by the inverse of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.grid import read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array, nearest_whole
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._diagnosis import resampling, rounding_noise
from fractalcontact.dimensions._gaussian_mixture import Bins, Lattice
from fractalcontact.dimensions._likelihood import NO_MODES, too_few_modes
from fractalcontact.dimensions._mode_bins import (
    LEAST,
    LEAST_BINS,
    Filling,
    bin_numbers,
    clear_modes,
    expected_power,
    gaussian_surfaces,
    log_means,
    make_bins,
)
from fractalcontact.dimensions._mode_fit import FirstFit, ModeFit, first_fit
from fractalcontact.dimensions._records import CONSTANT, Estimate, plane, smooth, undefined
from fractalcontact.dimensions._spectral_posterior import (
    HIGHEST,
    HURST,
    LOWEST,
    NOISE,
    SPREAD,
    Known,
    Posterior,
    mixture_interval,
    posterior,
)
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    between,
    check_scales,
    check_surface,
    middle_slices,
    read_scales,
    read_surfaces,
)
from fractalcontact.dimensions._waves import LARGEST_CROP, without_waves

SMALLEST = 16  # points along the edge of a window
FEWEST = 25  # observed points in a window
_FIELDS = ("hurst", "standard_error", "ci_low", "ci_high")
# u of the exponents between which the logarithms of powers are linear, to .1 %
_EXPONENTS = np.linspace(-3.0, 3.0, 61)


def _check(problems: Problems) -> None:
    given = problems.given
    is_valid = check_surface(problems, smallest=SMALLEST, profile=False, reserved=_FIELDS)
    is_number = problems.number("window", above=0.0)
    problems.number("step", above=0.0, optional=True)
    check_scales(problems, is_valid=is_valid)
    if not (is_valid and is_number):
        return
    grid = read_grid(given.surface)
    least, most = SMALLEST * max(grid.spacing), min(grid.extent)
    expected = f"a length from {least:g} m ({SMALLEST} points) to {most:g} m"
    problems.require(least * (1 - 1e-9) <= given.window <= most * (1 + 1e-9), "window", expected)


@public_result(title="Map of the Hurst exponent", check=_check, in_blocks=True)
def hurst_map(
    surface: xr.DataArray,
    window: float,
    *,
    step: float | None = None,
    scales: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent in square windows that move over a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x); NaN where missing. Of a dask array only one row of windows is in
        memory at a time.
    window : float
        Edge of a window in m, at least 16 points.
    step : float, optional
        Distance between neighbouring windows in m; by default half a window.
    scales : (low, high), optional
        Wavelengths in m of the waves that are fitted, as they are. Default: all that one model describes.

    Returns
    -------
    Dataset over the leading dims and (y, x), the centres of the windows in m
        `hurst`, `standard_error`, `ci_low`, `ci_high` and `fractal_dimension`. NaN where fewer than 25 points
        of a window were observed, or where heights do not vary.

    Raises
    ------
    InvalidInput
        A profile, wrong axes, or a window that does not fit.

    Notes
    -----
    Windows that overlap have correlated errors: compare those at least one window apart. Blur, noise and bend
    of the spectrum are those of the model of `estimate`, the same in all windows; single waves are taken out
    first, but of dask arrays. The interval of a window whose spectrum differs from the others by more than
    its exponent is wider; that of a gridded surface holds what gridding may add, as in `estimate`. Theory:
    page `theory_dimensions`.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((96, 128), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> result = fc.dimensions.hurst_map(surface, 3.2e-3)
    >>> dict(result.hurst.sizes), round(float(result.hurst.mean()), 1)
    ({'y': 5, 'x': 7}, 0.7)
    """
    grid, wavelengths = read_grid(surface), read_scales(scales)
    lines = zip(grid.shape, grid.spacing, strict=True)
    edges = [min(n, max(SMALLEST, int(nearest_whole(window / spacing)))) for n, spacing in lines]
    length = 0.5 * window if step is None else min(float(step), max(grid.extent))
    steps = [max(1, int(nearest_whole(length / spacing))) for spacing in grid.spacing]
    along_axes = zip(grid.shape, edges, steps, strict=True)
    rows, columns = (np.arange(0, n - edge + 1, jump) for n, edge, jump in along_axes)
    windows = _Windows((edges[0], edges[1]), rows, columns, steps)
    leading = surface.dims[:-2]
    records: list[Estimate] = []
    notes: list[str] = []
    for plane_number in range(int(np.prod(surface.shape[:-2], dtype=int))):
        index = np.unravel_index(plane_number, surface.shape[:-2])
        single = surface.isel(dict(zip(leading, map(int, index), strict=True)))
        reason = ""
        if not has_blocks(single):
            read = read_surfaces(single)[0]
            reason = "" if read.finest_scale or scales is not None else resampling(read)
            without, found = without_waves(read)
            if found:
                heights = (without.heights * without.unit).reshape(single.shape)
                single, notes = single.copy(data=heights), [*notes, found]
        of_plane = _estimates(single, windows, wavelengths)
        records += [record.without_interval(reason) for record in of_plane] if reason else of_plane
    reasons = "; ".join(dict.fromkeys(record.reason for record in records if record.reason))
    shape = (*surface.shape[:-2], rows.size, columns.size)
    data: dict[str, Any] = {
        name: (surface.dims, np.reshape([getattr(record, name) for record in records], shape))
        for name in _FIELDS
    }
    data["fractal_dimension"] = surface.dims, 3.0 - data["hurst"][1]
    coords = leading_coords(surface, leading, taken=data)
    for dim, starts, edge in zip(("y", "x"), (rows, columns), edges, strict=True):
        place = surface.coords[dim].values if dim in surface.coords else None
        spacing = grid.spacing[0 if dim == "y" else 1]
        first = float(place[0]) if place is not None else 0.5 * spacing
        coords[dim] = dim, first + (starts + 0.5 * (edge - 1)) * spacing
    result = xr.Dataset(data, coords=coords)
    for name in _FIELDS[1:] if reasons else ():
        result[name].attrs["reason"] = reasons
    missing = "; ".join(dict.fromkeys(record.reason for record in records if np.isnan(record.hurst)))
    for name in ("hurst", "fractal_dimension") if missing else ():
        result[name].attrs["reason"] = missing
    if notes:
        result["hurst"].attrs["comment"] = "; ".join(dict.fromkeys(notes))
    return result


@dataclass(frozen=True)
class _Windows:
    """Edges of the windows in points, their first rows and columns, and the steps between them."""

    edges: tuple[int, int]
    rows: Array
    columns: Array
    steps: list[int]

    @property
    def number(self) -> int:
        return int(self.rows.size * self.columns.size)

    @property
    def new_share(self) -> float:
        """Share of a window that the one before does not have."""
        return math.prod(min(1.0, s / edge) for s, edge in zip(self.steps, self.edges, strict=True))


def _estimates(surface: xr.DataArray, windows: _Windows, scales: Scales) -> list[Estimate]:
    """Return the estimates of the windows of one surface, row by row."""
    middle = _middle(surface)
    is_plane = middle is not None and middle.is_plane
    if middle is not None:
        scales = middle.resolved(scales)
    first = None if middle is None or middle.is_constant or is_plane else first_fit(middle)
    model = None if middle is None or first is None else _Model.of(middle, first, windows.edges, scales)
    rows = [_spectra(model, surface, int(row), windows) for row in windows.rows]
    records = [record for row in rows for record in row[0]]
    chosen = np.flatnonzero([record is None for record in records])
    if middle is None or model is None or chosen.size == 0:
        has_modes = first is not None and bool(first.modes)
        few = undefined(too_few_modes(scales if has_modes else None))
        others = smooth() if has_modes and scales is None else few
        return [record or (plane() if is_plane else others) for record in records]
    mean, share = (np.concatenate([row[k] for row in rows])[chosen] for k in (1, 2))
    degrees = 0.5 * model.lattice.degrees * model.count * share
    levels = log_means(np.maximum(mean, 1e-300), degrees)
    shares, centres, deviations = model.components(*levels, windows.new_share)
    for place, centre, deviation in zip(chosen, centres, deviations, strict=True):
        low, hurst, high, error = mixture_interval(shares, centre, deviation)
        record = Estimate(hurst, error, low, high, scale_min=np.nan if scales is None else scales[0])
        records[place] = record.gridded(middle.finest_scale).limited()
    return [record or undefined(NO_MODES) for record in records]


def _middle(surface: xr.DataArray) -> Surface | None:
    """Return the middle of a surface, or all of one in memory where little of its middle was observed."""
    cuts = dict(zip(surface.dims, middle_slices(surface.shape, LARGEST_CROP), strict=True))
    for part in (surface.isel(cuts).compute(), None if has_blocks(surface) else surface):
        if part is not None and np.count_nonzero(np.isfinite(part.values)) >= FEWEST:
            return read_surfaces(part)[0]
    return None


@dataclass(frozen=True)
class _Model:
    """Modes and bins of all windows, with their expected power.

    Attributes
    ----------
    fit : ModeFit
        Of the surface or its middle.
    unit : float
        Of heights, m.
    known : Known
    lattice : Lattice
        Of a window.
    pilot : ndarray
        Expected power of each mode.
    order, starts, count : ndarray of int
        Flat indices of the modes that count, bin after bin; the first of each bin, and their number.
    bins : Bins
    expected : ndarray
        Mean of the expected powers of a bin.
    """

    fit: ModeFit
    unit: float
    known: Known
    lattice: Lattice
    pilot: Array
    order: Array
    starts: Array
    count: Array
    bins: Bins
    expected: Array

    @classmethod
    def of(cls, middle: Surface, first: FirstFit, edges: tuple[int, int], scales: Scales) -> _Model | None:
        """Prepare the windows of a surface; None where too few of their modes count."""
        fit = first.modes
        if fit is None:
            return None
        known = Known.of(scales is not None).over(1.0, rounding_noise(middle) / first.scale)
        lattice = replace(fit.lattice, shape=edges, periodic=False)
        pilot, clean = (expected_power(lattice, fit.theta, fit.form, edges=edge) for edge in (True, False))
        sharp = np.where(np.arange(fit.theta.size) == SPREAD, 0.0, fit.theta)
        keep = clear_modes(pilot, clean, expected_power(lattice, sharp, fit.form, edges=False))
        keep &= between(2.0 * np.pi / lattice.q * middle.spacing[1], scales)
        if np.count_nonzero(keep) < LEAST * LEAST_BINS:
            return None
        number = bin_numbers(lattice, keep).ravel()
        order = np.argsort(number, kind="stable")[np.count_nonzero(number < 0) :]
        count = np.bincount(number[order])
        unit, starts = first.scale * middle.unit, np.cumsum(count) - count
        bins = make_bins(lattice, pilot, pilot, keep)
        expected = np.bincount(number[order], pilot.ravel()[order]) / count
        return cls(fit, unit, known, lattice, pilot, order, starts, count, bins, expected)

    def means(self, heights: Array, columns: Array, at_once: int = 1 << 20) -> Array:
        """Return the mean power over the pilot of the bins of windows in a row, shape (windows, bins).

        `at_once`: points of windows that are transformed at a time.
        """
        ny, nx = self.lattice.shape
        y, x = (np.arange(n) - 0.5 * (n - 1) for n in (ny, nx))
        expected, means = self.pilot.ravel()[self.order], []
        for some in np.array_split(columns, -(-columns.size * nx * ny // at_once)):
            z = np.stack([heights[:, start : start + nx] for start in some])
            z -= z.mean(axis=(1, 2), keepdims=True)
            z -= (z.sum(axis=2) @ y / (nx * (y @ y)))[:, None, None] * y[:, None]
            z -= (z.sum(axis=1) @ x / (ny * (x @ x)))[:, None, None] * x
            modes = fft.dct(z, 2, (1, 2))[:, 1:, 1:].reshape(some.size, -1)[:, self.order]
            power = np.square(modes) / (4.0 * nx * ny * expected)
            means.append(np.add.reduceat(power, self.starts, axis=1) / self.count)
        return np.concatenate(means)

    def filled_means(self, heights: Array, columns: Array) -> tuple[Array, Array]:
        """Return `means` of a row with gaps, filled and corrected for it, and the information of the modes.

        Gaussian surfaces get the same gaps, as in `filling_ratio`.
        """
        observed = np.isfinite(heights)
        filling = Filling(observed)
        band = replace(self.lattice, shape=heights.shape)
        pilot = expected_power(band, self.fit.theta, self.fit.form)
        before, after = (np.zeros((columns.size, self.count.size)) for _ in range(2))
        for _, complete in gaussian_surfaces(band, pilot):
            before += self.means(complete, columns)
            after += self.means(filling(complete), columns)
        ratio = np.maximum(after / before, 1e-12)
        shares = np.array([observed[:, start : start + self.lattice.shape[1]].mean() for start in columns])
        information = np.square(shares)[:, None] * np.minimum(1.0, ratio)
        return self.means(filling(heights), columns) / ratio, np.maximum(information, 1e-3)

    def components(
        self, level: Array, variance: Array, new_share: float, *, probability: float = 0.99, most: int = 64
    ) -> tuple[Array, Array, Array]:
        """Return shares, and means and deviations of u of each window, for probable nuisances.

        `level` and `variance` are those of the bins of each window, `new_share` that of its points that a
        window does not have in common with the one before. Those that together have the `probability` are
        used, at most `most` of them.
        """
        mean, scatter = _mean_of_windows(level, variance, self.bins.lnq, max(new_share, 1.0 / len(level)))
        bins = replace(self.bins, level=mean, variance=scatter)
        found = posterior(bins, self.known, pilot_spread=float(self.fit.theta[SPREAD]))
        order = np.argsort(-found.share.ravel())
        shares = found.share.ravel()[order]
        number = min(most, 1 + int(np.searchsorted(np.cumsum(shares), probability)))
        weight = 1.0 / np.vstack([scatter, variance])
        each = [_about_mean(bins, found, int(k), level, weight) for k in order[:number]]
        centre, deviation = (np.stack(parts, axis=1) for parts in zip(*each, strict=True))
        return shares[:number] / shares[:number].sum(), centre, deviation


def _spectra(
    model: _Model | None, surface: xr.DataArray, row: int, windows: _Windows
) -> tuple[list[Estimate | None], Array, Array]:
    """Return the records of windows without a fit in a row, the mean powers, and the information of modes."""
    edge_y, edge_x = windows.edges
    heights = surface.isel(y=slice(row, row + edge_y)).compute().values.astype(np.float64)
    records: list[Estimate | None] = [None] * windows.columns.size
    for k, start in enumerate(windows.columns):
        part = heights[:, start : start + edge_x]
        part = part[np.isfinite(part)]
        if part.size < FEWEST:
            records[k] = undefined(f"fewer than {FEWEST} points were observed")
        elif part.min() == part.max():
            records[k] = undefined(CONSTANT)
    if model is None:
        return records, np.zeros(0), np.zeros(0)
    heights = heights / model.unit
    if np.isfinite(heights).all():
        mean = model.means(heights, windows.columns)
        share = np.ones(mean.shape)
    else:
        mean, share = model.filled_means(heights, windows.columns)
    rounding = np.square(4.0 * np.spacing(float(np.nanmax(np.abs(heights), initial=0.0))))
    is_flat = (mean * model.expected) @ model.count < rounding * model.order.size
    for k in np.flatnonzero(is_flat).tolist():
        records[k] = records[k] or plane()
    return records, mean, share


def _mean_of_windows(
    level: Array, variance: Array, lnq: Array, new_share: float, rounds: int = 4
) -> tuple[Array, Array]:
    """Return the mean levels of the bins and their variance; a window counts by its scatter about them.

    Levels and slopes of the windows differ; the rest is chi square.
    """
    factor = np.ones((len(level), 1))
    for _ in range(rounds):
        weight = 1.0 / (factor * variance)
        mean = (weight * level).sum(axis=0) / weight.sum(axis=0)
        square = _fitted(level - mean, 1.0 / variance, np.broadcast_to(lnq, level.shape))[3]
        factor = np.maximum(1.0, square / max(lnq.size - 2, 1))[:, None]
    return mean, 1.0 / (new_share * (1.0 / (factor * variance)).sum(axis=0))


def _about_mean(
    bins: Bins, found: Posterior, component: int, level: Array, weight: Array, steps: int = 8
) -> tuple[Array, Array]:
    """Return mean and deviation of u of each window at the nuisances of one component of the posterior.

    The first row of `weight` is that of the mean of the windows.
    """
    from scipy.special import ndtr

    m, k = np.unravel_index(component, found.share.shape)
    form, theta, discrepancy = found.hypotheses[m].form, found.theta[m, k].copy(), found.discrepancies[k]
    model = bins.log_power(theta[None], form)[0][0]
    weight = weight * discrepancy.inside
    amplitude = float(weight[0] @ (bins.level - model) / weight[0].sum())
    noise = math.exp(amplitude) * theta[NOISE] ** 2 * bins.white
    theta[NOISE] = 0.0
    of_exponents = np.tile(theta, (_EXPONENTS.size, 1))
    of_exponents[:, HURST] = LOWEST + (HIGHEST - LOWEST) * ndtr(_EXPONENTS)
    logs = bins.log_power(of_exponents, form)[0]
    # the mean differs from the model alike in all windows
    target = np.vstack([model + amplitude, level - bins.level + model + amplitude])
    u, a = np.full(len(target), found.centre[m, k]), np.full(len(target), amplitude)
    step, free = _EXPONENTS[1] - _EXPONENTS[0], max(int(discrepancy.inside.sum()) - 2, 1)
    for _ in range(steps):  # Gauss-Newton
        place = np.clip((u - _EXPONENTS[0]) / step, 0.0, _EXPONENTS.size - 1.001)
        below = place.astype(int)
        slope = (logs[below + 1] - logs[below]) / step
        power = np.exp(a[:, None] + logs[below] + (place - below)[:, None] * step * slope)
        total = power + noise
        share = power / total  # of the surface, beside the noise
        first, second, variance, square = _fitted(target - np.log(total), weight, share * slope, share)
        a, u = a + np.clip(first, -1.0, 1.0), np.clip(u + np.clip(second, -0.7, 0.7), *_EXPONENTS[[0, -1]])
    by_nuisances = max(found.scale[m, k] ** 2 - variance[0], 0.0)
    own = variance[1:] * np.maximum(1.0, square[1:] / free)
    return u[1:], np.sqrt(own + by_nuisances)


def _fitted(
    values: Array, weight: Array, column: Array, level: Array | float = 1.0
) -> tuple[Array, Array, Array, Array]:
    """Fit level and column to each row: coefficients, variance of the second one, chi square of the rest."""
    level = np.broadcast_to(level, column.shape)
    pairs = (level, level), (level, column), (column, column)
    aa, ab, bb = ((weight * p * q).sum(axis=1) for p, q in pairs)
    a, b = ((weight * p * values).sum(axis=1) for p in (level, column))
    determinant = np.maximum(aa * bb - ab * ab, 1e-300)
    first, second = (bb * a - ab * b) / determinant, (aa * b - ab * a) / determinant
    square = (weight * values * values).sum(axis=1) - first * a - second * b
    return first, second, aa / determinant, square
