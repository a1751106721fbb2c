"""Box dimension from the counts of `_box_covers.py`, beside that of the random null; with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import float_array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks, _random_null, _scaling_fit
from fractalcontact.domains._box_covers import COVERS, Curve, cover_curve
from fractalcontact.domains._connected_components import label_planes
from fractalcontact.domains._masks import Array, Planes

SOURCE = "Falconer, Fractal Geometry (1990), ch. 3 (box dimension)"
# Numbers below are measured on 194 sets of known dimension, 100 to 512 cells a side: 1.000 of the intervals
# hold, their median width is .326.
BYTES = 6.0  # of a cell: the sums of the longest boxes on two threads, 5.1 as measured, and the mask


def _check_box_counts(problems: Problems) -> bool:
    given = problems.given
    problems.choice("cover", among=COVERS)
    has_mask = _masks.check_mask(problems, profiles=True)
    _masks.check_box_sizes(problems, _longest_box(_masks.mask_sides(given.mask), given.cover))
    return has_mask


def _longest_box(shape: Sequence[int], cover: Any) -> int:
    """Return the longest box of a cover: the mean needs boxes of at most half the shorter side."""
    return max(1, min(shape) // 2) if isinstance(cover, str) and cover == "mean" else 2 * max(shape)


def _check_box_dimension(problems: Problems) -> None:
    has_mask, window = _check_box_counts(problems), problems.given.window
    if window is None or (isinstance(window, str) and window == "each"):
        return
    problems.require(problems.given.box_sizes is None, "window", "None beside `box_sizes`")
    if isinstance(window, str):
        problems.choice("window", among=("each",))
    else:
        _masks.check_window(problems, has_mask=has_mask)


@public_result(title="Box dimension", references=SOURCE, check=_check_box_dimension, memory=BYTES)
def box_dimension(
    mask: xr.DataArray,
    *,
    box_sizes: Any = None,
    window: Any = None,
    cover: str = "minimum",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Box dimension of a set of cells, with an interval and the dimension of its random null.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x), or (..., x) for the contact of a profile
        Boolean, or integer flags where contact means value > 0.
    box_sizes : sequence of int, optional
        Edges of the boxes in cells, for a least-squares slope of ln N over ln s. By default the sizes are
        products of 2 and 3 up to a quarter of the shorter side (at least to 9), and the dimension is the
        mean local slope over the ratio of sizes, 2 or 3, at which it varies least.
    window : None, "each" or (low, high)
        Which of the default sizes are used. None: one window for all planes, from the cell to the geometric
        mean of the cell and the extent, or of longer boxes where the local slopes are steadier by far;
        "each": a window of its own for each plane; (low, high): nine sizes between two lengths in metres, for
        a least-squares slope. A window chosen for islands ends where half of the boxes meet them.
    cover : {"minimum", "mean", "aligned"}
        The fewest boxes over all offsets of the grid, their mean over all offsets, or the boxes of the one
        grid that starts at the first cell. The default fit combines the first two.
    periodic : bool, optional
        Whether boxes wrap around the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x), (x) or those of the mask, optional
        Observed cells; counts are divided by the share of the boxes' area that was observed.

    Returns
    -------
    Dataset
        Over the leading dims: `box_dimension`, `ci_low`, `ci_high`; the window, `scale_min`, `scale_max`
        (cells), `window_low`, `window_high` (m); `is_saturated`, where more than half of its largest boxes
        meet a set of islands: the dimension then tells little but the coverage;
        `coverage`; `null_dimension` and `null_spread` of the random null of equal coverage, in counts
        averaged over the offsets unless the cover is "aligned";
        `differs_from_random`; `follows_power_law`, False where the local slopes of the window differ by
        more than 0.15. Over `box_size` (cells; `box_length` in m) too: `box_count`, of whole boxes;
        `box_measure`, where boxes cut by the edge count by their part inside; `local_slope`; `null_count`.

    Raises
    ------
    InvalidInput
        The mask, a size, `window`, `cover`, `periodic` or `valid` is not as described.

    Notes
    -----
    Along a path of load or shear use `signature`. 0 for one cell, 1 for a row or column that spans the mask,
    2 for a full mask (1 of a profile); NaN for an empty one, with the reason in `comment`. Over the full
    range of scales the counts of any set measure little but its coverage: compare with the null. Fit and
    interval: see the documentation, "Theory: contact domains".

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> gasket = np.ones((1, 1), int)
    >>> for _ in range(6):
    ...     gasket = np.kron([[1, 0], [1, 1]], gasket)
    >>> mask = xr.DataArray(gasket, dims=("y", "x"))
    >>> result = fc.domains.box_dimension(mask, box_sizes=[1, 2, 4, 8, 16])
    >>> round(float(result.box_dimension), 4)  # ln 3 / ln 2
    1.585
    """
    planes = _masks.read_planes(mask, valid=valid, periodic=periodic)
    return analyse(planes, box_sizes=box_sizes, window=window, cover=cover)


@public_result(
    title="Box counts", references=SOURCE, achieved_error="exact", check=_check_box_counts, memory=BYTES
)
def box_counts(
    mask: xr.DataArray,
    box_sizes: Any = None,
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
    box_sizes : sequence of int, optional
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
    planes = _masks.read_planes(mask, valid=valid, periodic=periodic)
    every = np.arange(1, max(1, min(planes.sides) // 2) + 1)
    sizes = _masks.read_box_sizes(box_sizes, every)
    curve = cover_curve(planes, sizes, cover)
    variables = {
        "box_count": planes.variable(curve.count, "box_size"),
        "box_measure": planes.variable(curve.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(sizes, curve.measure), "box_size"),
    }
    return planes.dataset(variables, planes.box_coords(sizes))


def analyse(
    planes: Planes, *, box_sizes: Any = None, window: Any = None, cover: str = "minimum"
) -> xr.Dataset:
    """Return the result of `box_dimension` for planes, without labels."""
    shape = planes.sides
    default = _scaling_fit.longer_sizes(shape)
    if window is not None and not isinstance(window, str):
        low, high = float_array(window) / planes.side
        # 5 and 17 sizes moved the dimension of 50 level sets by up to .4 and .6 %
        box_sizes = np.unique(np.rint(np.geomspace(low, high, 9)).clip(1, _longest_box(shape, cover)))
    sizes = _masks.read_box_sizes(box_sizes, default[default <= _longest_box(shape, cover)])
    by_regression = box_sizes is not None
    curve = cover_curve(planes, sizes, cover)
    limits = _unsaturated_counts(planes, sizes, curve)
    fits = _fit(
        planes, sizes, curve, cover, limits, by_regression=by_regression, one_for_all=window != "each"
    )
    dimension, half_width = (
        np.array([getattr(fit, name) for fit in fits]) for name in ("value", "half_width")
    )
    windows = [fit.window for fit in fits]
    null = _null(planes, sizes, windows, cover, by_regression=by_regression)
    steady = np.array([fit.follows_power_law for fit in fits])
    ends = np.array([sizes[window][[0, -1]] for window in windows]) * planes.side
    ends = np.where(np.isfinite(dimension)[:, None], ends, np.nan)
    stops = np.array([window.stop for window in windows])
    variables = {
        **_scaling_fit.dimension_variables(planes, "box_dimension", dimension, half_width, sizes, windows),
        "coverage": planes.variable(planes.coverage),
        "window_low": planes.variable(ends[:, 0]),
        "window_high": planes.variable(ends[:, 1]),
        "is_saturated": planes.variable(stops > limits),
        "follows_power_law": planes.variable(steady),
        **{name: planes.variable(values) for name, values in null.items() if name != "null_count"},
        "box_count": planes.variable(curve.count, "box_size"),
        "box_measure": planes.variable(curve.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(sizes, curve.measure), "box_size"),
        "null_count": planes.variable(null["null_count"], "box_size"),
    }
    notes = _notes(fits, sizes, by_regression=by_regression)
    return planes.dataset(variables, planes.box_coords(sizes), notes=notes)


@dataclass(frozen=True)
class WindowFit:
    """The dimension of one plane, the half-width of its interval, and the sizes that it rests on.

    `slope_low` and `slope_high` are the extreme local slopes of the window.
    """

    value: float
    half_width: float
    window: slice
    slope_low: float
    slope_high: float

    @property
    def follows_power_law(self) -> bool:
        """Whether the local slopes are close to each other; False without any."""
        # .69 of the sets are; within .1 .60, within .2 .70
        return self.slope_high - self.slope_low <= 0.15


def _unsaturated_counts(planes: Planes, sizes: Array, curve: Curve) -> Array:
    """Return for each plane how many of the sizes, from the smallest, leave half of the boxes or more empty.

    Beyond that any set of islands has boxes of slope 2, which scatter least of all. A set of which one island
    holds most of the cells, as a cluster or a carpet, has no gaps between islands, and no limit.
    """
    # the area of a box of a profile is that of a square on it
    length = sizes.astype(float) if planes.rank == 1 else np.ones(sizes.size)
    share = curve.area / (np.maximum(planes.observed, 1)[:, None] * length)
    largest = np.array([plane.sizes.max(initial=0) for plane in label_planes(planes, 2, keep=False)])
    count = np.logical_and.accumulate(share < 0.5, axis=-1).sum(-1)  # .3 has 4 % more error, .7 the same
    return np.asarray(np.where(2 * largest > planes.occupied, sizes.size, count))


def _fit(
    planes: Planes,
    sizes: Array,
    curve: Curve,
    cover: str,
    limits: Array,
    *,
    by_regression: bool,
    one_for_all: bool,
) -> list[WindowFit]:
    """Return the dimension, its interval and its window of sizes for every plane."""
    # of the dimension in a chosen window, which no scatter within one cluster shows: without it .959 of the
    # intervals hold (width .279), with half of it .985 (.301)
    between_clusters = 0.06
    windows, steady, mean = [slice(0, sizes.size)] * planes.count, curve, curve
    if not by_regression:
        other = curve
        if cover != "aligned" and 2 * sizes.max() <= min(planes.sides):
            other = cover_curve(planes, sizes, "mean" if cover == "minimum" else "minimum")
        steady, mean = (other, curve) if cover == "mean" else (curve, other)
        quarters = np.array([_longest_edge(cells) / 4.0 for cells in planes.cells])
        groups = [np.flatnonzero(planes.occupied > 0)] if one_for_all else np.arange(planes.count)[:, None]
        for group in (group for group in groups if group.size):
            window = _scaling_fit.steadiest_window(
                sizes, steady.area[group], quarters[group].min(), planes.sides, limits[group].min()
            )
            windows = [window if k in group else own for k, own in enumerate(windows)]
    fits = []
    for window, area, mean_area, measure in zip(windows, steady.area, mean.area, curve.measure, strict=True):
        used = sizes[window]
        if by_regression:
            fit = _scaling_fit.fit_regression(sizes, measure)
            value, half_width = fit.dimension, 2.0 * fit.spread
        elif cover == "aligned":
            fit = _scaling_fit.fit_steady_ratio(used, area[window])
            value, half_width = fit.dimension, _scaling_fit.deviations_of_95_percent(used) * fit.spread
        else:
            value, half_width = fit_two_covers(used, area[window], mean_area[window], cover)
        slopes = _scaling_fit.ratio_slopes(used, area[window])
        if window.start > 0:
            half_width += _scaling_fit.drift_of(slopes) + between_clusters
        has_spread = used.size > (2 if by_regression else 3)
        local = slopes[1] if slopes[1].size else np.array([np.nan])
        width = half_width + _scaling_fit.ROUNDING if has_spread else np.nan
        fits.append(WindowFit(value, width, window, float(local.min()), float(local.max())))
    return fits


def _longest_edge(cells: Array) -> int:
    """Return the longer side of the rectangle that holds the set, in cells."""
    extents = [np.flatnonzero(cells.any(axis=axis)) for axis in (0, 1)]
    return max((int(places[-1] - places[0]) + 1 if places.size else 0) for places in extents)


def fit_two_covers(sizes: Array, fewest: Array, mean: Array, cover: str) -> tuple[float, float]:
    """Return the dimension and the half-width of its interval, from the areas of both covers.

    The fewest boxes are exact for sets on a lattice; for curves that lie across it their count rises too fast
    towards small sizes. The mean number errs the other way, and less. Where the mean varies less, both have
    the same weight; elsewhere the fewest boxes are weighted by their variance. Slopes that vary little may
    still share an error: the difference of the two covers widens the interval, up to a limit, as the mean
    is far off for sets on a lattice.
    """
    limit = 0.02  # with 0 .985 hold (width .286), with .05 all (.365), without one the width is .610
    first, second = _scaling_fit.fit_steady_ratio(sizes, fewest), _scaling_fit.fit_steady_ratio(sizes, mean)
    if not (np.isfinite(first.dimension) and np.isfinite(second.dimension)):
        return first.dimension if cover == "minimum" else second.dimension, np.nan
    variance = first.spread**2, max(first.spread, second.spread) ** 2
    both, spread = _scaling_fit.weighted_mean((first.dimension, second.dimension), variance)
    difference = abs(first.dimension - second.dimension)
    deviations = _scaling_fit.deviations_of_95_percent(sizes)
    if cover == "minimum":
        return both, deviations * spread + min(difference, limit + 0.5 * spread)
    deviation = float(np.hypot(second.spread, second.dimension - both))
    return second.dimension, deviations * deviation + min(difference, limit + deviation)


def _null(
    planes: Planes, sizes: Array, windows: list[slice], cover: str, *, by_regression: bool
) -> dict[str, Array]:
    """Return counts, dimension and spread of the random null, and whether the set differs from it.

    The null is fitted in the window of its plane, and compared at sizes of 2, 3 and 4 cells.
    """
    small = np.array([size for size in (2, 3, 4) if 2 * size <= min(planes.sides)], np.int64)
    mean = cover_curve(planes, small, "mean").measure if small.size else np.zeros((planes.count, 0))
    largest = (2.0 * max(1, *sizes, *small)) ** planes.rank  # cells of two corners, or more than two boxes
    counts, rows = [], []
    for plane, (cells, observed) in enumerate(zip(planes.occupied, planes.observed, strict=True)):
        if plane == 0 or (planes.valid is not None and plane < len(planes.valid)):
            boxes = _random_null.NullBoxes(planes, plane, sizes, cover)
            small_boxes = _random_null.NullBoxes(planes, plane, small, "mean")
            of_small: dict[int, tuple[Array, Array]] = {}
            of_window: dict[tuple[int, int, int], tuple[Array, float, float]] = {}
        window, k = windows[plane], int(cells)
        same = k, window.start, window.stop
        random_cells = _random_null.RandomCells(cells, observed, largest)
        if same not in of_window:  # planes of as many cells have the same null
            null = boxes.expected_counts(random_cells, sizes)
            fit = _null_fit(boxes, random_cells, null[window], sizes[window], by_regression=by_regression)
            of_window[same] = null, *fit
        null, dimension, deviation = of_window[same]
        is_different = False
        if np.isfinite(dimension):
            if k not in of_small:
                expected = small_boxes.expected_counts(random_cells, small)
                of_small[k] = expected, small_boxes.covariance(random_cells, small)
            is_different = _random_null.differs_from_null(mean[plane], *of_small[k])
        counts.append(null)
        rows.append((dimension, deviation, is_different))
    dimension, deviation, differs = np.array(rows, float).T
    return {
        "null_count": np.array(counts),
        "null_dimension": dimension,
        "null_spread": deviation,
        "differs_from_random": differs.astype(bool),
    }


def _null_fit(
    boxes: _random_null.NullBoxes,
    random_cells: _random_null.RandomCells,
    counts: Array,
    sizes: Array,
    *,
    by_regression: bool,
) -> tuple[float, float]:
    """Return the dimension of the expected counts of a null, and its standard deviation."""
    fit = partial(_null_dimension, sizes, by_regression=by_regression)
    dimension = fit(counts)
    if not np.isfinite(dimension):
        return dimension, np.nan
    knots = _knots(sizes)
    covariance = boxes.covariance(random_cells, sizes[knots])
    return dimension, _random_null.dimension_deviation(fit, sizes, counts, knots, covariance)


def _null_dimension(sizes: Array, counts: Array, *, by_regression: bool) -> float:
    """Return the dimension that the fit finds in counts of boxes of the null."""
    if by_regression:
        return _scaling_fit.fit_regression(sizes, counts).dimension
    return _scaling_fit.fit_steady_ratio(sizes, counts * sizes**2).dimension


def _knots(sizes: Array, *, many: int = 20) -> Array:
    """Return the places of the sizes that carry the covariance: all, or `many` evenly spaced over ln s.

    On six sets of 128 x 128 and 256 x 256 cells and all sizes up to a third, the deviation from 20 was within
    1.2 % of that from all; from 10 it was off by up to 5 %, from 40 by .3 %.
    """
    if sizes.size <= many:
        return np.arange(sizes.size)
    return np.unique(np.searchsorted(sizes, np.geomspace(sizes[0], sizes[-1], many)))


def _notes(fits: list[WindowFit], sizes: Array, *, by_regression: bool) -> dict[str, dict[str, str]]:
    interval = "two standard deviations" if by_regression else "from the spread"
    interval = f"interval of the box dimension ({interval} of the local slopes)"
    notes = {
        **_scaling_fit.interval_notes(interval),
        **_scaling_fit.window_notes("smallest box of the fit", "largest box of the fit"),
        "local_slope": {"long_name": "local dimension, -d ln(box_measure)/d ln(box_size)"},
    }
    empty = sum(np.isnan(fit.value) for fit in fits)
    if sizes.size < 2:
        reason = "" if by_regression else "; the mask is too narrow"
        notes["box_dimension"] = {"comment": f"NaN: one size of box gives no slope{reason}"}
        return notes
    without = [fit for fit in fits if np.isfinite(fit.slope_low) and not fit.follows_power_law]
    comments = [f"NaN where the set is empty ({empty} planes)"] if empty else []
    if without:
        low, high = min(fit.slope_low for fit in without), max(fit.slope_high for fit in without)
        comments.append(
            f"no power law in {len(without)} of {len(fits)} planes: local slopes from {low:.2f} to "
            f"{high:.2f} within the window"
        )
    if comments:
        notes["box_dimension"] = {"comment": "; ".join(comments)}
    return notes
