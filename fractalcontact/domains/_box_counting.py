"""Box dimension from the counts of `_box_covers.py`, beside that of the random null; with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import stdtrit

from fractalcontact.base.power_law import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _random_null
from fractalcontact.domains._box_covers import COVERS, Curve, cover_curve
from fractalcontact.domains._mask_input import (
    Array,
    Planes,
    build_dataset,
    check_box_sizes,
    check_mask,
    plane_shape,
    read_box_sizes,
    read_planes,
)
from fractalcontact.domains._scaling_fit import (
    ROUNDING,
    default_sizes,
    dimension_variables,
    fit_line,
    interval_notes,
    window_notes,
)

SOURCE = (
    "Falconer, Fractal Geometry (1990), ch. 3 (box dimension); Borri-Brunetto, Carpinteri and Chiaia, "
    "FRAMCOS-3 (1998) (of contact domains)"
)
RATIOS = (2, 3)  # of the sizes whose local slopes are averaged
TINY = 1e-24  # variance of slopes that differ by rounding alone
COVER_DIFFERENCE = 0.02  # of the dimensions of two covers, up to which it widens the interval as it is
MANY_SIZES, SOME_SIZES = 64, 48  # above so many sizes, some stand for all in the deviation of the null


def _check_box_dimension(
    problems: Problems, *, mask: Any, scales: Any, cover: Any, periodic: Any, valid: Any
) -> None:
    _check_boxes(problems, mask, "scales", scales, cover, periodic, valid)


def _check_box_counts(
    problems: Problems, *, mask: Any, sizes: Any, cover: Any, periodic: Any, valid: Any
) -> None:
    _check_boxes(problems, mask, "sizes", sizes, cover, periodic, valid)


def _check_boxes(
    problems: Problems, mask: Any, argument: str, sizes: Any, cover: Any, periodic: Any, valid: Any
) -> None:
    problems.choice("cover", cover, COVERS)
    check_mask(problems, mask, valid=valid, periodic=periodic)
    shape = plane_shape(mask)
    if shape is not None:
        check_box_sizes(problems, argument, sizes, _longest_box(shape, cover))


def _longest_box(shape: Sequence[int], cover: Any) -> int:
    """Return the longest box of a cover: the mean needs boxes of at most half the shorter side."""
    return max(1, min(shape) // 2) if isinstance(cover, str) and cover == "mean" else 2 * max(shape)


@public_result(title="Box dimension", references=SOURCE, check=_check_box_dimension)
def box_dimension(
    mask: xr.DataArray,
    *,
    scales: Any = None,
    cover: str = "minimum",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Box dimension of a set of cells, with an interval and the dimension of its random null.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    scales : sequence of int, optional
        Edges of the boxes in cells, for a least-squares slope of ln N over ln s. By default the sizes are
        the products of 2 and 3 from 1 to the geometric mean of the cell and the extent (at least to 9). The
        dimension is then the mean local slope over the ratio of sizes, 2 or 3, at which it varies least.
    cover : {"minimum", "mean", "aligned"}
        The fewest boxes over all offsets of the grid, their mean over all offsets, or the boxes of the one
        grid that starts at the first cell. The default fit combines the first two.
    periodic : bool, optional
        Whether boxes wrap around the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; counts are divided by the share of the boxes' area that was observed.

    Returns
    -------
    Dataset
        Over the leading dims: `box_dimension`, `ci_low`, `ci_high`; `scale_min`, `scale_max` (cells);
        `coverage`; `null_dimension` and `null_spread` of the random null of equal coverage;
        `differs_from_random`. Over `box_size` (cells; `box_length` in m) too: `box_count`, of whole boxes;
        `box_measure`, where boxes cut by the edge count by their part inside; `local_slope`; `null_count`.

    Raises
    ------
    InvalidInput
        The mask, a scale, `cover`, `periodic` or `valid` is not as described.

    Notes
    -----
    0 for one cell, 1 for a row or column that spans the mask, 2 for a full mask; NaN for an empty one, with
    the reason in `comment`. Over the full range of scales the counts of any set measure little but its
    coverage: compare with the null. Fit and interval: see the documentation,
    "Theory: contact domains".

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> gasket = np.ones((1, 1), int)
    >>> for _ in range(6):
    ...     gasket = np.kron([[1, 0], [1, 1]], gasket)
    >>> mask = xr.DataArray(gasket, dims=("y", "x"))
    >>> result = fc.domains.box_dimension(mask, scales=[1, 2, 4, 8, 16])
    >>> round(float(result.box_dimension), 4)  # ln 3 / ln 2
    1.585
    """
    return analyse(read_planes(mask, valid=valid, periodic=periodic), scales=scales, cover=cover)


@public_result(title="Box counts", references=SOURCE, achieved_error="exact", check=_check_box_counts)
def box_counts(
    mask: xr.DataArray,
    sizes: Any = None,
    *,
    cover: str = "mean",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Number of boxes that meet a set, by the size of the box.

    Parameters
    ----------
    mask, cover, periodic, valid
        See `box_dimension`.
    sizes : sequence of int, optional
        Edges of the boxes in cells; by default all from 1 to half the shorter side. With the cover "mean"
        all sizes together cost about as much as one.

    Returns
    -------
    Dataset
        `box_count`, `box_measure` and `local_slope` over the leading dims of the mask and `box_size`
        (cells), with `box_length` (m).

    Raises
    ------
    InvalidInput
        As `box_dimension`.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> mask = xr.DataArray(np.ones((8, 8), bool), dims=("y", "x"))
    >>> fc.domains.box_counts(mask, [1, 2, 4], cover="aligned").box_count.values.tolist()
    [64, 16, 4]
    """
    planes = read_planes(mask, valid=valid, periodic=periodic)
    every = np.arange(1, max(1, min(planes.grid.shape) // 2) + 1)
    box_sizes = read_box_sizes(sizes, every)
    curve = cover_curve(planes, box_sizes, cover)
    variables = {
        "box_count": planes.variable(curve.count, "box_size"),
        "box_measure": planes.variable(curve.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(box_sizes, curve.measure), "box_size"),
    }
    return build_dataset(planes, variables, _size_coords(box_sizes, planes))


def analyse(planes: Planes, *, scales: Any = None, cover: str = "minimum") -> xr.Dataset:
    """Return the result of `box_dimension` for planes, without labels."""
    shape = planes.grid.shape
    default = default_sizes(shape)
    sizes = read_box_sizes(scales, default[default <= _longest_box(shape, cover)])
    by_regression = scales is not None
    curve = cover_curve(planes, sizes, cover)
    dimension, half_width = _fit(planes, sizes, curve, cover, by_regression=by_regression)
    null = _null(planes, sizes, by_regression=by_regression)
    variables = {
        **dimension_variables(planes, "box_dimension", dimension, half_width, sizes),
        "coverage": planes.variable(planes.coverage),
        **{name: planes.variable(values) for name, values in null.items() if name != "null_count"},
        "box_count": planes.variable(curve.count, "box_size"),
        "box_measure": planes.variable(curve.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(sizes, curve.measure), "box_size"),
        "null_count": planes.variable(null["null_count"], "box_size"),
    }
    notes = _notes(dimension, sizes, by_regression=by_regression)
    return build_dataset(planes, variables, _size_coords(sizes, planes), notes=notes)


def _size_coords(sizes: Array, planes: Planes) -> dict[str, Any]:
    return {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}


def _fit(
    planes: Planes, sizes: Array, curve: Curve, cover: str, *, by_regression: bool
) -> tuple[Array, Array]:
    """Return the dimension and the half-width of its interval for every plane."""
    if by_regression:
        fits = [fit_regression(sizes, measure) for measure in curve.measure]
        pairs = [(fit.dimension, 2.0 * fit.spread) for fit in fits]
    elif cover == "aligned":
        fits = [fit_steady_ratio(sizes, area) for area in curve.area]
        pairs = [(fit.dimension, deviations_of_95_percent(sizes) * fit.spread) for fit in fits]
    else:
        other = curve
        if 2 * sizes.max() <= min(planes.grid.shape):
            other = cover_curve(planes, sizes, "mean" if cover == "minimum" else "minimum")
        fewest, mean = (curve.area, other.area) if cover == "minimum" else (other.area, curve.area)
        pairs = [
            fit_two_covers(sizes, fewest_area, mean_area, cover)
            for fewest_area, mean_area in zip(fewest, mean, strict=True)
        ]
    dimension, half_width = np.array(pairs, float).reshape(-1, 2).T
    half_width = half_width + ROUNDING
    has_spread = sizes.size > (2 if by_regression else 3)
    return dimension, half_width if has_spread else np.full(half_width.shape, np.nan)


@dataclass(frozen=True)
class Fit:
    """A dimension, the standard deviation of the local slopes it rests on, and d dimension / d ln N."""

    dimension: float
    spread: float
    weights: Array


def fit_regression(sizes: Array, measure: Array) -> Fit:
    """Ordinary least squares of ln N on ln s; the spread is that of the slopes between neighbouring sizes."""
    if sizes.size < 2 or not np.all(measure > 0):
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    slope, spread, weights = fit_line(np.log(sizes), np.log(measure))
    return Fit(0.0 - float(slope), float(spread), -weights)


def fit_steady_ratio(sizes: Array, area: Array) -> Fit:
    """Mean local slope over a fixed ratio of sizes, for the ratio over which it varies least.

    A set built by a fixed ratio has counts that oscillate about their power law with that period in ln s;
    over the ratio itself, and only over it, the local slope does not oscillate. The slopes of each ratio are
    weighted by the inverse square of their variance. `area` is that of the boxes, N s^2, so that integer
    slopes are exact.
    """
    if not np.all(area > 0):
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    index_of = {int(size): index for index, size in enumerate(sizes)}
    slopes, variances, weights = [], [], []
    for ratio in RATIOS:
        pairs = [(i, index_of[ratio * size]) for size, i in index_of.items() if ratio * size in index_of]
        if pairs:
            low, high = np.array(pairs).T
            local = np.log(ratio**2 * area[low] / area[high]) / np.log(ratio)
            slopes.append(float(local.mean()))
            variances.append(float(local.var()))
            weight = np.zeros(sizes.size)
            np.add.at(weight, low, 1.0 / (np.log(ratio) * low.size))
            np.add.at(weight, high, -1.0 / (np.log(ratio) * low.size))
            weights.append(weight)
    if not slopes:
        return Fit(np.nan, np.nan, np.zeros(sizes.size))
    dimension, spread, share = _weighted_mean(slopes, variances)
    return Fit(dimension, spread, share @ np.array(weights))


def _weighted_mean(slopes: Sequence[float], variances: Sequence[float]) -> tuple[float, float, Array]:
    """Average estimates by the inverse square of their variances; return mean, spread and shares."""
    slope, variance = np.array(slopes), np.array(variances)
    relative = (variance + TINY) / (variance + TINY).min()
    share = relative**-2.0
    share = share / share.sum()
    mean = float(slope[0] + share @ (slope - slope[0]))
    return mean, float(np.sqrt(share @ (variance + (slope - mean) ** 2))), share


def deviations_of_95_percent(sizes: Array) -> float:
    """Return how many standard deviations of the local slopes make 95 %: Student's t, of the sizes less 2."""
    return float(stdtrit(max(sizes.size - 2, 1), 0.975))


def fit_two_covers(sizes: Array, fewest: Array, mean: Array, cover: str) -> tuple[float, float]:
    """Return the dimension and the half-width of its interval, from the areas of both covers.

    The fewest boxes are exact for sets on a lattice; for curves that lie across it their count rises too fast
    towards small sizes. The mean number errs the other way, and less. Where the mean varies less, both have
    the same weight; elsewhere the fewest boxes are weighted by their variance. Slopes that vary little may
    still share an error: the difference of the two covers widens the interval, up to a limit, as the mean is
    far off for sets on a lattice. The limit was set on some thousand sets of known dimension.
    """
    first, second = fit_steady_ratio(sizes, fewest), fit_steady_ratio(sizes, mean)
    if not (np.isfinite(first.dimension) and np.isfinite(second.dimension)):
        return first.dimension if cover == "minimum" else second.dimension, np.nan
    variance = first.spread**2, max(first.spread, second.spread) ** 2
    both, spread, _ = _weighted_mean((first.dimension, second.dimension), variance)
    difference = abs(first.dimension - second.dimension)
    deviations = deviations_of_95_percent(sizes)
    if cover == "minimum":
        return both, deviations * spread + min(difference, COVER_DIFFERENCE + 0.5 * spread)
    deviation = float(np.hypot(second.spread, second.dimension - both))
    return second.dimension, deviations * deviation + min(difference, COVER_DIFFERENCE + deviation)


def _null(planes: Planes, sizes: Array, *, by_regression: bool) -> dict[str, Array]:
    """Return counts, dimension and spread of the random null, and whether the set differs from it."""
    shorter = min(planes.grid.shape)
    small = np.array([size for size in _random_null.TESTED_SIZES if 2 * size <= shorter], np.int64)
    contents = _random_null.box_contents(planes, np.union1d(sizes, small))
    mean = cover_curve(planes, small, "mean").measure if small.size else np.zeros((planes.count, 0))
    counts, rows = [], []
    for plane, (cells, observed) in enumerate(zip(planes.occupied, planes.observed, strict=True)):
        by_size = contents[min(plane, len(contents) - 1)]
        boxes = [by_size[size] for size in sizes.tolist()]
        null = _random_null.expected_counts(cells, observed, sizes, boxes)
        fit = fit_regression(sizes, null) if by_regression else fit_steady_ratio(sizes, null * sizes**2)
        has_value = np.isfinite(fit.dimension)
        deviation = _null_deviation(cells, observed, sizes, boxes, null, fit) if has_value else np.nan
        small_boxes = [by_size[size] for size in small.tolist()]
        differs = has_value and _random_null.differs_from_null(
            cells, observed, small, mean[plane], small_boxes
        )
        counts.append(null)
        rows.append((fit.dimension, deviation, differs))
    dimension, deviation, differs = np.array(rows, float).T
    return {
        "null_count": np.array(counts),
        "null_dimension": dimension,
        "null_spread": deviation,
        "differs_from_random": differs.astype(bool),
    }


def _null_deviation(
    cells: int,
    observed: int,
    sizes: Array,
    boxes: list[_random_null.BoxContents],
    null: Array,
    fit: Fit,
) -> float:
    """Return the standard deviation of the null's dimension; of many sizes a few dozen stand for all."""
    if sizes.size > MANY_SIZES:
        places = np.unique(np.searchsorted(sizes, np.geomspace(sizes[0], sizes[-1], SOME_SIZES)))
        sizes, null, boxes = sizes[places], null[places], [boxes[place] for place in places]
        fit = fit_regression(sizes, null)
    return _random_null.fit_deviation(cells, observed, sizes, boxes, null, fit.weights)


def _notes(dimension: Array, sizes: Array, *, by_regression: bool) -> dict[str, dict[str, str]]:
    interval = "two standard deviations" if by_regression else "from the spread"
    interval = f"interval of the box dimension ({interval} of the local slopes)"
    notes = {
        **interval_notes(interval),
        **window_notes("smallest box of the fit", "largest box of the fit"),
        "local_slope": {"long_name": "local dimension, -d ln(box_measure)/d ln(box_size)"},
    }
    if sizes.size < 2:
        reason = "" if by_regression else "; the mask is too narrow"
        notes["box_dimension"] = {"comment": f"NaN: one size of box gives no slope{reason}"}
    elif np.isnan(dimension).any():
        count = int(np.isnan(dimension).sum())
        notes["box_dimension"] = {"comment": f"NaN where the set is empty ({count} planes)"}
    return notes
