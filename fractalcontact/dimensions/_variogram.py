"""Mean height increments against the lag: variogram, madogram and mean square second differences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.grid import read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._curve import ALWAYS, EXACT_MEAN, Curve, curve_dataset
from fractalcontact.dimensions._methods import METHODS
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces

SQUARE, ABSOLUTE, SECOND = 0, 1, 2  # measures of an increment, see `_kernels.pair_sums`
_FEW = 64  # lag vectors up to which direct sums are faster than transforms
_TOGETHER = 1 << 20  # points of profiles that are transformed together
_SEPARATE = 4.5  # spacings up to which every distance is a point of the curve
_NAMES = ("variogram", "madogram", "second_variogram", "lag", "pair_count", *ALWAYS)


def _check(problems: Problems) -> None:
    given = problems.given
    problems.choice("increments", among=("square", "absolute", "second"))
    is_valid = check_surface(problems, reserved=_NAMES)
    if problems.number("max_lag", above=0, optional=True) and is_valid and given.max_lag is not None:
        dims = ("y", "x") if "y" in given.surface.dims else ("x",)
        shortest = min(read_grid(given.surface, dims).spacing)
        expected = f"at least one spacing, {shortest:g} m"
        problems.require(float(given.max_lag) >= shortest * (1 - 1e-9), "max_lag", expected)


@public_result(
    title="Variogram of a surface",
    references=METHODS["variogram"].references,
    achieved_error=EXACT_MEAN,
    check=_check,
    in_blocks=True,
    memory=320.0,
)
def variogram(
    surface: xr.DataArray, *, increments: str = "square", max_lag: float | None = None
) -> xr.Dataset:
    """Return the variogram: half the mean square height increment against the lag; or the madogram.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x) or (..., x); NaN where nothing was observed.
    increments : {"square", "absolute", "second"}
        "absolute": the madogram, half the mean absolute increment, which outliers change less. "second": the
        mean square second difference z(s - h) - 2 z(s) + z(s + h), which a tilt does not change, and whose
        mean converges for every H < 1. Both along rows and columns only.
    max_lag : float, optional
        Largest lag in m, up to the diagonal. Default: half the shorter extent ("absolute": a quarter,
        "second": an eighth); four spacings for a surface that is not in memory.

    Returns
    -------
    Dataset over `lag` (m)
        `variogram` (m2), `madogram` (m) or `second_variogram` (m2); `pair_count`; and `local_slope`, for a
        self-affine surface 2 H, H and 2 H.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or no lag is left.

    Notes
    -----
    Squares: pairs of all directions are pooled. Up to 4.5 spacings each distance is a lag of its own; beyond,
    lags are pooled in rings as wide as the larger spacing. Few lags are summed directly in one pass, many by
    Fourier transforms. Along the axes: about five lags per octave. Pairs wrap around periodic axes, where no
    lag is longer than half the period.

    References
    ----------
    Matheron (1963), Economic Geology 58; with transforms and gaps: Marcotte (1996), Computers and
    Geosciences 22; madogram: Gneiting, Sevcikova and Percival (2012), Statistical Science 27; second
    differences: Chan and Wood (2000), Annals of Statistics 28.

    Examples
    --------
    A plane of slope 0.5 along x: half of (0.5 lag)^2, averaged over both axes.

    >>> import numpy as np, fractalcontact as fc
    >>> plane = fc.surfaces.from_array(np.tile(0.5 * np.arange(16.0), (16, 1)), 1.0)
    >>> curve = fc.dimensions.variogram(plane, max_lag=1.0)
    >>> float(curve.variogram[0])
    0.0625
    >>> fc.dimensions.variogram(plane, increments="absolute", max_lag=1.0).madogram.values
    array([0.125])
    """
    surfaces, longest = read_surfaces(surface), None if max_lag is None else float(max_lag)
    name, measure = {
        "square": ("variogram", _square_increments),
        "absolute": ("madogram", _absolute_increments),
        "second": ("second_variogram", _second_differences),
    }[increments]
    curves = _profile_variograms(surfaces, longest) if increments == "square" else None
    if curves is None:
        curves = [measure(single, longest) for single in surfaces]
    return curve_dataset(
        surface, curves, "lag", name, slope=lambda curve: local_slope(curve.scale, curve.value)
    )


def variogram_curve(surface: Surface, window: tuple[float, float]) -> Curve:
    """Return half the mean square increment of one surface over lags in a window.

    Long lags have few independent pairs: points count as lag^-2 in a fit.
    """
    return replace(_square_increments(surface, window[1]), power=-2.0)


def madogram_curve(surface: Surface, window: tuple[float, float]) -> Curve:
    """Return half the mean absolute increment of one surface over lags in a window."""
    return _absolute_increments(surface, window[1])


def _square_increments(surface: Surface, longest: float | None) -> Curve:
    """Return half the mean square increment of one surface; `longest` in m."""
    lazy, periodic = surface.is_lazy, surface.periodic
    if longest is None:
        longest = 4.0 * max(surface.grid.spacing) if lazy else 0.5 * min(surface.grid.extent)
    longest = min(longest, float(np.linalg.norm(surface.grid.extent)))
    vectors = _half_plane_lags(_largest_steps(surface, longest, 1), surface.spacing, longest)
    width = max(surface.grid.spacing)
    if lazy or len(vectors) <= _FEW:
        return _pooled(surface, vectors, SQUARE, 0.5, width, longest)
    squares, counts = _all_lags(surface.heights, periodic)
    y, x = _lag_vectors(surface.shape, periodic)
    nominal = _nominal_counts(np.stack([y, x], axis=-1), surface.shape, periodic)
    distance = np.hypot(y * surface.spacing[0], x * surface.spacing[1])
    # a lag along y alone is listed with both signs, and so is a lag of half a period
    is_twice = (x == 0) | (periodic[1] & (2 * x == surface.shape[1]))
    weight = np.where(is_twice, 1, 2)
    flat = distance.ravel(), squares.ravel(), (weight * counts).ravel(), (weight * nominal).ravel()
    lag, mean, pairs = _rings(*flat, width, longest)
    return Curve(lag, 0.5 * surface.unit**2 * mean, pairs // 2)


def _profile_variograms(surfaces: Sequence[Surface], longest: float | None) -> list[Curve] | None:
    """Return the variograms of complete profiles, all at once; None for others, and for a few lags.

    One line takes some 20 microseconds, a tenth of `_square_increments`: its lags are those of all lines.
    """
    first = surfaces[0]
    if first.axes == 2 or first.is_lazy:
        return None
    (spacing, periodic), n = (first.spacing[1], first.periodic[1]), first.shape[1]
    longest = min(0.5 * first.grid.extent[0] if longest is None else longest, first.grid.extent[0])
    steps = np.arange(1, _largest_steps(first, longest, 1)[1] + 1)
    lines = np.stack([single.raw[0] for single in surfaces])
    if steps.size <= _FEW or not np.isfinite(lines).all():
        return None
    torus = n if periodic else fft.fast_length(2 * n)
    counts = np.full(steps.size, n) if periodic else n - steps
    pairs = np.where(periodic & (2 * steps == n), counts // 2, counts)  # each is met twice at half a period
    curves, rows = [], max(1, _TOGETHER // torus)
    for start in range(0, len(lines), rows):
        low = lines[start : start + rows].min(axis=1, keepdims=True)
        heights = lines[start : start + rows] - low
        unit = np.ldexp(1.0, np.frexp(heights.max(axis=1, keepdims=True))[1])
        heights /= unit
        heights -= heights.mean(axis=1, keepdims=True)
        padded = np.zeros((len(heights), torus))
        padded[:, :n] = heights
        modes = fft.rfft(padded)
        products = fft.irfft(modes.real**2 + modes.imag**2 + 0j, torus)[:, steps]
        until = np.cumsum(heights * heights, axis=1)
        total = until[:, -1:]
        squares = 2.0 * total if periodic else until[:, n - 1 - steps] + (total - until[:, steps - 1])
        means = np.maximum(squares - 2.0 * products, 0.0) * (0.5 * unit**2) / counts
        curves += [Curve(steps * spacing, mean, pairs) for mean in means]
    return curves


def _absolute_increments(surface: Surface, longest: float | None) -> Curve:
    """Return half the mean absolute increment of one surface; `longest` in m."""
    return _along_axes(surface, longest, ABSOLUTE, 0.5, 0.25)


def _second_differences(surface: Surface, longest: float | None) -> Curve:
    """Return the mean square second difference of one surface; `longest` in m."""
    return _along_axes(surface, longest, SECOND, 1.0, 0.125)


def _along_axes(surface: Surface, longest: float | None, measure: int, factor: float, share: float) -> Curve:
    reach = 2 if measure == SECOND else 1
    if longest is None:
        coarse = max(surface.grid.spacing)
        longest = 4.0 * coarse if surface.is_lazy else max(share * min(surface.grid.extent), coarse)
    longest = min(longest, max(surface.grid.extent))
    vectors = _axis_lags(surface.shape, _largest_steps(surface, longest, reach))
    return _pooled(surface, vectors, measure, factor, min(surface.grid.spacing), longest)


def _largest_steps(surface: Surface, longest: float, reach: int) -> tuple[int, int]:
    """Return the largest steps in y and x: within the surface, or half a period, where lags repeat."""
    y, x = (
        min(
            int(longest / spacing * (1 + 1e-9)),
            n // 2 if is_periodic and not surface.is_lazy else (n - 1) // reach,
        )
        for n, spacing, is_periodic in zip(surface.shape, surface.spacing, surface.periodic, strict=True)
    )
    return y, x


def _pooled(
    surface: Surface, vectors: Array, measure: int, factor: float, width: float, longest: float
) -> Curve:
    """Sum pairs directly and pool the lag vectors of equal length."""
    reach = 2 if measure == SECOND else 1
    periodic = surface.periodic
    if surface.is_lazy:
        periodic = (False, False)  # wrapping would read the far side for every slab
        slabs, columns = surface.slabs(reach * int(vectors[:, 0].max(initial=0))), (0, surface.shape[1])
    else:
        heights, columns = _wrapped(surface.heights, periodic, vectors, reach)
        slabs = iter([(heights, surface.shape[0])])
        factor *= surface.unit ** (1 if measure == ABSOLUTE else 2)  # slabs above are in metres
    mean, counts = mean_increments(slabs, columns, vectors, measure)
    nominal = _nominal_counts(vectors, surface.shape, periodic, reach)
    if reach == 1:  # half a period ahead is half a period back: each pair is met twice along such an axis
        share = 0.5 ** (np.array(periodic) & (2 * np.abs(vectors) == surface.shape)).sum(axis=1)
        counts, nominal = share * counts, share * nominal
    distance = np.hypot(vectors[:, 0] * surface.spacing[0], vectors[:, 1] * surface.spacing[1])
    # along the axes every lag is kept apart
    width = width if measure == SQUARE else longest
    lag, value, pairs = _rings(distance, mean, counts, nominal, width, longest)
    return Curve(lag, factor * value, pairs)


def mean_increments(
    slabs: Iterable[tuple[Array, int]], columns: tuple[int, int], vectors: Array, measure: int
) -> tuple[Array, Array]:
    """Return the mean of an increment for each lag vector, and the number of increments.

    Parameters
    ----------
    slabs : iterable of (heights, rows)
        Consecutive rows, with as many of the next as the lags reach, and how many increments start from.
    columns : pair of int
        First and one past the last column that increments start from.
    vectors : ndarray of int, shape (k, 2)
        Lags in points along y and x.
    measure : int
        `SQUARE`, `ABSOLUTE` or `SECOND`.
    """
    from fractalcontact.base.resources import in_bands
    from fractalcontact.dimensions._kernels import pair_sums

    row_sums, counts = [], np.zeros(len(vectors), dtype=np.int64)
    for heights, rows in slabs:
        sums = np.zeros((rows, len(vectors)))
        number = np.zeros((rows, len(vectors)), dtype=np.int64)
        work = rows * heights.shape[1] * len(vectors)
        in_bands(pair_sums, rows, work, heights, np.array(columns), vectors, measure, sums, number)
        row_sums.append(sums)
        counts += number.sum(axis=0)
    # added row after row, so that neither slabs nor threads change a bit
    total = np.cumsum(np.concatenate(row_sums), axis=0)[-1]
    return np.divide(total, counts, out=np.full(len(vectors), np.nan), where=counts > 0), counts


def _half_plane_lags(largest: tuple[int, int], spacing: tuple[float, float], longest: float) -> Array:
    """Return every lag vector of a half-plane up to a length: shape (k, 2), at most `largest` steps."""
    y, x = np.meshgrid(np.arange(largest[0] + 1), np.arange(-largest[1], largest[1] + 1), indexing="ij")
    half = ((y > 0) | (x > 0)) & (np.hypot(y * spacing[0], x * spacing[1]) <= longest * (1 + 1e-9))
    return np.stack([y[half], x[half]], axis=1)


def _axis_lags(shape: tuple[int, int], largest: tuple[int, int]) -> Array:
    """Return lag vectors along y and x, about five per octave, up to `largest` steps."""
    vectors = []
    for axis in (0, 1):
        octaves = np.arange(0.0, np.log2(max(largest[axis], 1)) + 1e-9, 0.2)
        steps = np.unique(np.rint(2.0**octaves).astype(int))
        steps = steps[steps < shape[axis]]
        vectors.append(np.stack([steps, 0 * steps], axis=1)[:, :: 1 if axis == 0 else -1])
    return np.concatenate(vectors)


def _wrapped(
    heights: Array, periodic: tuple[bool, bool], vectors: Array, reach: int
) -> tuple[Array, tuple[int, int]]:
    """Repeat a periodic surface beyond its edges as far as the lags reach.

    Returns the heights and the range of columns that increments start from; the rows are unchanged.
    """
    far = reach * np.abs(vectors).max(axis=0)
    pad = ((0, int(far[0]) if periodic[0] else 0), (int(far[1]) if periodic[1] else 0,) * 2)
    return np.pad(heights, pad, mode="wrap"), (pad[1][0], pad[1][0] + heights.shape[1])


def _all_lags(heights: Array, periodic: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the mean square increment at every lag of a half-plane, and the number of pairs.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where nothing was observed (Marcotte 1996, Computers and Geosciences 22).

    Returns
    -------
    squares, counts : ndarray, shape (my, mx)
        Lags along y in the order of a transform of my points, lags along x ascending from 0.
    """
    ny, nx = heights.shape
    torus = (ny if periodic[0] else fft.fast_length(2 * ny), nx if periodic[1] else fft.fast_length(2 * nx))
    observed = np.isfinite(heights)
    centred = np.where(observed, heights - heights[observed].mean(), 0.0)
    planes = []
    for plane in (observed.astype(float), centred, centred * centred):
        padded = np.zeros(torus)
        padded[:ny, :nx] = plane
        planes.append(fft.rfft2(padded))
    mask, value, square = planes
    counts = np.rint(fft.irfft2(mask * np.conj(mask), torus))
    cross = np.conj(mask) * square
    pairs = fft.irfft2(cross + np.conj(cross) - 2.0 * (value * np.conj(value)), torus)
    columns = nx // 2 + 1 if periodic[1] else nx
    pairs, counts = pairs[:, :columns], counts[:, :columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(counts > 0, np.maximum(pairs, 0.0) / counts, np.nan), counts.astype(np.int64)


def _lag_vectors(shape: tuple[int, int], periodic: tuple[bool, bool]) -> Array:
    """Return the steps in y and x of the lags of `_all_lags`: shape (2, my, mx)."""
    ny, nx = shape
    my = ny if periodic[0] else fft.fast_length(2 * ny)
    y = np.arange(my)
    y = np.where(y > my // 2, y - my, y)
    x = np.arange(nx // 2 + 1 if periodic[1] else nx)
    return np.stack(np.meshgrid(y, x, indexing="ij"))


def _nominal_counts(
    vectors: Array, shape: tuple[int, int], periodic: tuple[bool, bool], reach: int = 1
) -> Array:
    """Return how many increments a complete surface has for each lag vector (last axis: y, x)."""
    sides = [
        np.full(vectors.shape[:-1], n) if is_periodic else np.maximum(n - reach * np.abs(vectors[..., i]), 0)
        for i, (n, is_periodic) in enumerate(zip(shape, periodic, strict=True))
    ]
    return np.asarray(sides[0] * sides[1])


def _rings(
    distance: Array, value: Array, counts: Array, nominal: Array, width: float, longest: float
) -> tuple[Array, Array, Array]:
    """Average over lag vectors of about equal length, weighted by their pairs.

    Up to `_SEPARATE` times `width` every distance is a ring of its own; beyond, rings are one `width` wide.

    Parameters
    ----------
    distance, value, counts : ndarray, shape (vectors,)
    nominal : ndarray, shape (vectors,)
        Pairs of a complete surface; they define the lag of a ring, so that gaps do not change it.
    width, longest : float
        In the unit of `distance`.

    Returns
    -------
    lag, mean : ndarray, shape (k,)
        The mean is NaN where no pair was observed.
    pairs : ndarray of int64, shape (k,)
    """
    inside = (distance > 0) & (distance <= longest * (1 + 1e-9)) & (nominal > 0)
    distance, counts, nominal = distance[inside], counts[inside], nominal[inside]
    value = np.where(counts > 0, value[inside], 0.0)
    # relative to the width, so that the unit of length changes no bit
    rounded = np.round(distance / width, 9)
    key = np.where(rounded <= _SEPARATE, rounded, np.floor(rounded + 0.5) + 1e-3)
    _, ring = np.unique(key, return_inverse=True)
    pairs = np.bincount(ring, counts)
    total = np.bincount(ring, counts * value)
    mean = np.divide(total, pairs, out=np.full(total.shape, np.nan), where=pairs > 0)
    return np.bincount(ring, nominal * distance) / np.bincount(ring, nominal), mean, pairs.astype(np.int64)
