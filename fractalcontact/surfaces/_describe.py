"""Statistics of heights, slopes and curvature."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from fractalcontact.base import spectra
from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.labelled import check_leading
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.base.regression import RANK, scaled_slopes, shifted
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, require
from fractalcontact.surfaces._from_array import check_stack, labelled_rows

NAYAK = "Nayak, Random process model of rough surfaces, Journal of Lubrication Technology 93 (1971) 398-407"

HEIGHT_STATISTICS = (
    "mean_height",
    "rms_height",
    "mean_absolute_height",
    "peak_height",
    "valley_depth",
    "peak_to_valley",
    "skewness",
    "kurtosis",
    "missing_points",
)


def _names(axes: int) -> list[str]:
    """Return the statistics of a surface with so many axes."""
    slopes = [f"{kind}_slope_{dim}" for dim in ("y", "x")[2 - axes :] for kind in ("rms", "mean")]
    of_area = ["developed_area_ratio", "developed_area_excess"]
    return [*HEIGHT_STATISTICS, "rms_slope", "rms_curvature", "nayak_parameter", *slopes, *of_area]


def _check(problems: Problems) -> None:
    surface = problems.given.surface
    if has_blocks(surface):
        problems.surface("surface", finite=False, smallest=3, leading=True, profile=True)
    else:
        check_stack(problems, smallest=3)
    if isinstance(surface, xr.DataArray):
        check_leading(surface, (*_names(len(core_dims(surface))), "run_time"), problems)


@public_result(
    title="Statistics of a surface",
    references=NAYAK,
    achieved_error="exact to rounding, for the points as they are",
    check=_check,
    in_blocks=True,
    memory=116.0,
)
def describe(surface: xr.DataArray) -> xr.Dataset:
    """Return statistics of the heights, slopes and curvature of a surface.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). They are not levelled first. Missing points (NaN)
        are left out, and so are the differences that need them.

    Returns
    -------
    Dataset
        Over the leading dims, if there are any (symbols of ISO 25178-2 in brackets):

        - mean_height (m), and about it rms_height (Sq), mean_absolute_height (Sa), peak_height (Sp),
          valley_depth (Sv), peak_to_valley (Sz); skewness (Ssk), kurtosis (Sku, 3 if Gaussian)
        - rms_slope (Sdq: of the gradient, both components), rms_slope_x, rms_slope_y
        - mean_slope_x, mean_slope_y of the least-squares plane
        - rms_curvature (m-1) of the mean curvature, half the Laplacian (of z'' for a profile)
        - nayak_parameter, m0 m4 / m2^2 of the profiles of an isotropic surface
        - developed_area_ratio, area over that of the plane (length for a profile); developed_area_excess
          (Sdr), the same less one, without loss of digits for small slopes
        - missing_points, run_time

        A statistic that does not exist is NaN and has the reason in its attribute `reason`.

    Raises
    ------
    InvalidInput
        Not a surface in metres on a uniform grid, or infinite heights.

    Notes
    -----
    A complete periodic surface is differentiated by its Fourier modes: its mean square slope is the sum of
    q^2 C. Any other uses differences of neighbours, which reduce the shortest wavelengths a little. The
    developed area is that of triangles between neighbours. ISO 25178-2 levels and filters first; use `level`.
    A dask array is read twice, one row of blocks at a time, and is not differentiated by modes.

    References
    ----------
    ISO 25178-2 (2021), Surface texture: areal, terms, definitions and surface texture parameters.
    Nayak (1971), Random process model of rough surfaces, Journal of Lubrication Technology 93, 398-407.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> heights = np.tile(1e-6 * np.sin(2 * np.pi * np.arange(64) / 64), (64, 1))
    >>> statistics = fc.surfaces.describe(fc.surfaces.from_array(heights, 1e-6, periodic=True))
    >>> print(f"{float(statistics.rms_height):.3e} m, {float(statistics.rms_slope_x):.4f}")
    7.071e-07 m, 0.0694
    """
    grid = read_grid(surface, core_dims(surface))
    if has_blocks(surface):
        places = np.ndindex(*surface.shape[: surface.ndim - len(grid.shape)])
        rows = [_statistics_in_blocks(surface[place], grid.spacing, grid.periodic) for place in places]
    else:
        stack = np.asarray(surface.values, dtype=np.float64).reshape(-1, *grid.shape)
        rows = [_statistics(heights, grid.spacing, grid.periodic) for heights in stack]
    result = labelled_rows(surface, rows, _names(len(grid.shape)))
    by_modes = all(grid.periodic) and not has_blocks(surface) and not result["missing_points"].any()
    result.attrs["derivatives"] = "modes" if by_modes else "differences"
    _explain_missing(result, math.prod(grid.shape))
    return result


def _explain_missing(result: xr.Dataset, size: int) -> None:
    """Set the attribute `reason` of every statistic that is NaN."""
    variables = {name: result.variables[name] for name in result.data_vars}
    undefined = [name for name, variable in variables.items() if np.isnan(variable.values).any()]
    if not undefined:
        return
    empty = bool((variables["missing_points"].values == size).any())
    flat = bool((variables["peak_to_valley"].values == 0).any())
    for name in undefined:
        reason = "no point was observed" if empty else "too few neighbouring points were observed"
        if flat and name in ("skewness", "kurtosis", "nayak_parameter"):
            reason = "all heights of a surface are equal"
        variables[name].attrs["reason"] = reason


def _statistics(heights: Array, spacing: Sequence[float], periodic: Sequence[bool]) -> dict[str, float]:
    """Return the statistics of a plane (ny, nx) or a profile (nx,); NaN where one is undefined.

    A complete periodic plane is differentiated by its Fourier modes; any other by differences of neighbours.
    """
    complete = not np.isnan(heights.min())
    if not complete and np.isnan(heights).all():
        return {"missing_points": heights.size}
    values, reference, scale = shifted(heights)
    observed = values if complete else values[~np.isnan(values)]
    mean, ends = float(observed.mean()), (float(observed.min()), float(observed.max()))
    result = _heights(_powers(observed, mean), observed.size, mean, ends, reference, scale)
    result["missing_points"] = values.size - observed.size
    unit, steps = _scaled_steps(spacing)
    neighbours = _means(_neighbours(values, steps, periodic, scale / unit))
    by_modes = None
    if all(periodic) and complete:
        psd, _ = spectra.periodogram(values, steps)
        moments = spectra.spectral_moments(psd, values.shape, steps)
        by_modes = moments, spectra.directional_slopes(psd, values.shape, steps)
    slopes = scaled_slopes(values, spacing)
    return result | _gradients(neighbours, slopes, result["rms_height"], scale, unit, by_modes)


def _statistics_in_blocks(
    surface: xr.DataArray, spacing: Sequence[float], periodic: Sequence[bool]
) -> dict[str, float]:
    """Return the statistics of a plane or a profile of dask, from one row of blocks at a time."""
    axes, ny, nx = surface.ndim, (1, *surface.shape)[-2], surface.shape[-1]
    low, high, origin, total, size, infinite = math.inf, -math.inf, math.nan, 0.0, 0, 0
    for block, _ in _row_blocks(surface):
        observed = block[~np.isnan(block)]
        infinite += int(np.count_nonzero(np.isinf(observed)))
        low, high = min(low, float(observed.min(initial=low))), max(high, float(observed.max(initial=high)))
        if observed.size and math.isnan(origin):
            origin = float(observed[0])  # for digits of the mean
        total, size = total + float((observed - origin).sum()), size + observed.size
    require(infinite == 0, "surface", "finite heights, or NaN where missing", f"{infinite} infinite")
    if not size:
        return {"missing_points": surface.size}
    scale = power_of_two(high - low)
    mean, (unit, steps) = (total / size + (origin - low)) / scale, _scaled_steps(spacing)
    x, half = np.linspace(-1.0, 1.0, nx), 0.5 * max(ny - 1, 1)
    powers, gram, right, sums = np.zeros(4), np.zeros((3, 3)), np.zeros(3), np.zeros((axes + 2, 2))
    closes, along = axes == 2 and periodic[0], (False, periodic[-1])[2 - axes :]
    before = top = np.empty((0, nx))
    for block, start in _row_blocks(surface):
        block -= low
        block /= scale
        # 2^22 points at a time: their differences take ten times their 34 MB
        for first in range(0, len(block), rows := max(3, (1 << 22) // nx)):
            values = block[first : first + rows]
            is_known = ~np.isnan(values)
            powers += _powers(values[is_known], mean)
            # a slope along y needs the row before, the Laplacian two: what lies in these alone was counted
            joined = np.concatenate([before, values])
            if axes == 1:
                sums += _neighbours(values[0], steps, along, scale / unit)
            else:
                sums += _neighbours(joined, steps, along, scale / unit)
                if len(before):
                    sums -= _neighbours(before, steps, along, scale / unit)
            top = np.concatenate([top, values])[:2]
            before = joined[-2:].copy()
            # least-squares plane of 1, x and y
            filled = np.where(is_known, values, 0.0)
            y = (start + first + np.arange(len(values))) / half - 1.0
            ones, ax, axx = is_known.sum(axis=1), is_known @ x, is_known @ (x * x)
            gram += [
                [ones.sum(), ax.sum(), y @ ones],
                [ax.sum(), axx.sum(), y @ ax],
                [y @ ones, y @ ax, (y * y) @ ones],
            ]
            right += filled.sum(), (filled @ x).sum(), y @ filled.sum(axis=1)
    if closes:  # the last rows and the first ones are neighbours, too
        for rows_of, sign in ((np.concatenate([before, top]), 1), (before, -1), (top, -1)):
            sums += sign * np.array(_neighbours(rows_of, steps, along, scale / unit))
    result = _heights(powers, size, mean, (0.0, (high - low) / scale), low, scale)
    result["missing_points"] = surface.size - size
    gram, right = gram[: axes + 1, : axes + 1], right[: axes + 1]
    is_plane = np.linalg.cond(gram) * RANK < 1.0
    weights = np.linalg.solve(gram, right) if is_plane else np.full(axes + 1, math.nan)
    halves = [0.5 * (n - 1) * step for n, step in zip(surface.shape, spacing, strict=True)]
    slopes = tuple(float(w) / each for w, each in zip(weights[:0:-1], halves, strict=True))
    neighbours = _means([(float(total), int(count)) for total, count in sums])
    return result | _gradients(neighbours, slopes, result["rms_height"], scale, unit)


def _row_blocks(surface: xr.DataArray) -> Iterator[tuple[Array, int]]:
    """Yield the heights of each row of blocks, (rows, nx), and the number of its first row."""
    if surface.ndim == 1:
        yield np.array(surface.values, dtype=np.float64)[None], 0
        return
    lengths = surface.chunks[0]  # type: ignore[index]
    for stop, rows in zip(np.cumsum(lengths), lengths, strict=True):
        yield np.array(surface[stop - rows : stop].values, dtype=np.float64), int(stop - rows)


def _scaled_steps(spacing: Sequence[float]) -> tuple[float, list[float]]:
    """Return the unit of length, a power of two, and the spacing in it."""
    unit = power_of_two(max(spacing))
    return unit, [step / unit for step in spacing]


def _gradients(
    neighbours: Sequence[float],
    mean: tuple[float, ...],
    rms_height: float,
    scale: float,
    unit: float,
    by_modes: tuple[spectra.Moments, tuple[float, ...]] | None = None,
) -> dict[str, float]:
    """Return the statistics of slopes, curvature and area; `mean` are the mean slopes."""
    *squares, laplacian_square, excess = neighbours
    ratio = scale / unit
    if by_modes is None:
        height = (rms_height / scale) ** 2
        moments = spectra.Moments(height, sum(squares), laplacian_square, len(squares))
        along = tuple(math.sqrt(square) for square in squares)
    else:
        moments, along = by_modes
    result = {
        "rms_slope": moments.rms_slope * ratio,
        "rms_curvature": moments.rms_curvature * ratio / unit,
        "nayak_parameter": moments.nayak,
        "developed_area_ratio": 1.0 + excess,
        "developed_area_excess": excess,
    }
    for name, rms, slope in zip(("y", "x")[2 - len(squares) :], along, mean, strict=True):
        result[f"rms_slope_{name}"] = rms * ratio
        result[f"mean_slope_{name}"] = scale * slope
    return result


def _powers(values: Array, mean: float) -> Array:
    """Return the sums of |d|, d^2, d^3 and d^4 of the deviations d from the mean."""
    deviation = values.ravel() - mean
    squares = deviation * deviation  # higher powers as products: numpy takes ten times as long for values**3
    # not `squares @ deviation`, whose last digits depend on the threads of BLAS
    cube, fourth = (float(np.einsum("i,i->", squares, other)) for other in (deviation, squares))
    return np.array([np.abs(deviation).sum(), squares.sum(), cube, fourth])


def _heights(
    powers: Array, size: int, mean: float, ends: tuple[float, float], reference: float, scale: float
) -> dict[str, float]:
    """Return the statistics of the distribution of heights reference + scale * values, from `_powers`."""
    (lowest, highest), (absolute, variance, cube, fourth) = ends, powers / size
    result = {
        "mean_height": reference + scale * mean,
        "rms_height": scale * math.sqrt(variance),
        "mean_absolute_height": scale * absolute,
        "peak_height": scale * (highest - mean),
        "valley_depth": scale * (mean - lowest),
        "peak_to_valley": scale * (highest - lowest),
    }
    if highest > lowest:
        result |= {"skewness": cube / variance**1.5, "kurtosis": fourth / variance**2}
    return result


def _neighbours(
    values: Array, steps: Sequence[float], periodic: Sequence[bool], ratio: float
) -> list[tuple[float, int]]:
    """Return sums over neighbours, and their numbers: squares of the slope along each axis and of the
    Laplacian, and excess of area over plan.

    They are in scaled heights and steps; `ratio` is the unit of height over that of length.
    """
    heights, spacing = np.atleast_2d(values), (1.0, *steps)[-2:]
    wraps = [int(wrap) for wrap in (False, *periodic)[-2:]]
    onward = np.pad(heights, [(0, wrap) for wrap in wraps], mode="wrap")  # each point and the next
    slopes = [np.diff(onward, axis=axis) / step for axis, step in enumerate(spacing)]
    own = slopes[0][:, : heights.shape[1]], slopes[1][: heights.shape[0]]
    squares = [_observed_sum(slope**2) for slope in own[2 - values.ndim :]]
    around = np.pad(heights, [(wrap, wrap) for wrap in wraps], mode="wrap")
    bends = [np.diff(around, 2, axis=axis) / step**2 for axis, step in enumerate(spacing)]
    laplacian = bends[1] if values.ndim == 1 else bends[0][:, 1:-1] + bends[1][1:-1]
    laplacian_square = _observed_sum(laplacian**2)
    along, across = ((ratio * slope) ** 2 for slope in slopes)
    if values.ndim == 1:
        return [*squares, laplacian_square, _observed_sum(_excess(across))]
    # of a cell, the mean over its corners, at each of which two of its edges meet
    corners = (_excess(x + y) for x in (across[:-1], across[1:]) for y in (along[:, :-1], along[:, 1:]))
    return [*squares, laplacian_square, _observed_sum(0.25 * sum(corners, np.zeros(1)))]


def _observed_sum(values: Array) -> tuple[float, int]:
    """Return the sum of the observed values, and their number."""
    observed = values[np.isfinite(values)]
    return float(observed.sum()), observed.size


def _means(sums: Sequence[tuple[float, int]]) -> list[float]:
    """Return the means of sums with their numbers; NaN without any."""
    return [total / count if count else math.nan for total, count in sums]


def _excess(square: Array) -> Array:
    """Return sqrt(1 + square) - 1 without loss of digits for small slopes."""
    return np.asarray(square / (1.0 + np.sqrt(1.0 + square)))
