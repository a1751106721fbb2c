"""Signature of a contact domain: lengths, dimension over one window, clustering, patches, with intervals.

Everything follows from the share P(s) of positions at which a gliding square of side s meets the set, and
from the moments of its mass (`_lacunarity.py`). All lengths are common to the states of a path, so that
states, and one state on several grids, can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import Grid
from fractalcontact.base.numbers import ROUNDED, float_array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._correlation import pair_correlation_length
from fractalcontact.domains._lacunarity import box_moments, half_width
from fractalcontact.domains._masks import Array, Planes

SOURCE = (
    "Falconer, Fractal Geometry (1990), ch. 3; Chiu, Stoyan, Kendall and Mecke, Stochastic Geometry (2013), "
    "ch. 3 (random spots); Lantuejoul, J. Microsc. 161:387 (1991) (integral range); Kunsch, Ann. Statist. "
    "17:1217 (1989) (block jackknife)"
)
FLAGS = ("measured", "empty", "full", "no_window", "filled", "too_few", "unresolved")  # also in the schema
FINEST = 4  # cells: squares below see the grid (d = 2 up to a cell, whatever the set is)
# below which the realisation, not the domain, sets the slope: over a window of ratio 4 the dimension of 60
# level sets scattered by .13 with 7 islands and .10 with 12, of random discs by .02 with any number
FEWEST_ISLANDS = 30
HALF = np.log(-np.log(0.5))  # P = 1/2 on the scale of ln(-ln(1 - P)), on which P(s) of random spots is smooth
# the four smallest boxes (height, width): their P give coverage, widths of the spots, and their number
SMALLEST = np.array([(1, 1), (1, 2), (2, 1), (2, 2)])
AT_SCALES = ("clustering", "integral_range", "lacunarity_ratio")
LOGARITHMIC = (
    "spot_size",
    "gap_size",
    "pair_correlation_length",
    *AT_SCALES,
)  # whose logarithm has the interval
CHANGES = {
    "gap_size": "gap_size_ratio",
    "domain_dimension": "domain_dimension_change",
    "excess_dimension": "excess_dimension_change",
    "clustering": "clustering_ratio",
    "integral_range": "integral_range_ratio",
}


def _check(problems: Problems) -> None:
    _masks.check_window(problems, has_mask=check_connected(problems))
    _masks.check_along(problems)


@public_result(title="Signature of a contact domain", references=SOURCE, check=_check)
def signature(
    mask: xr.DataArray,
    *,
    window: Any = None,
    along: str | None = None,
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Signature of a contact domain as it evolves: its lengths, box dimension, clustering and lacunarity.

    One window of lengths serves all states of the mask, in metres. Each number has a 95 % interval from the
    jackknife over 16 blocks of positions.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    window : (low, high), optional
        Sides of squares in metres between which the dimension is fitted. By default from the largest spot of
        the path, at least 4 cells, to its smallest gap, at most an eighth of the extent, but at least over a
        ratio of 4.
    along : str, optional
        The leading dim that is the path; by default the last.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether squares wrap around the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; only squares of observed cells count.

    Returns
    -------
    Dataset
        Over the leading dims: `coverage`; `spot_size` (m), 4 coverage over the perimeter per area; `gap_size`
        (m), the square that meets the set at half of its positions; `pair_correlation_length` (m), up to
        which a cell of the set is twice as frequent about another as anywhere; `n_islands`, `median_cells`;
        `domain_dimension`, 2 - d ln P / d ln s over `window_low` to `window_high` (m), with
        `local_dimension_min`, `local_dimension_max` in it; `spots_dimension`, of random spots of equal area,
        widths and number; `excess_dimension` over it; `signature_flag` and `reason`. Over `scale` (m), three
        lengths of the window: `clustering`, P of random spots over P; `integral_range` (m2), the area of one
        independent patch, (lacunarity - 1) coverage s^2; `lacunarity_ratio`, lacunarity - 1 of boxes along x
        over that of boxes along y. Over `side` (m): `hit_fraction` P, `spots_fraction`,
        `local_slope` d(s). With a path: changes from the state before, as differences
        (`_change`) or ratios (`_ratio`). `_low` and `_high` are the ends of intervals.

    Raises
    ------
    InvalidInput
        The mask, the window, `along`, `connectivity`, `periodic` or `valid` is not as described.

    Notes
    -----
    A state is flagged, and its dimension NaN, where it is empty or full, where its gap is less than twice the
    start of the window (filled), where it has fewer than 30 islands (too_few), where the median island has
    fewer than 10 cells (unresolved), or where no window fits into the mask. P(s) is that of squares at any
    place, exact for the union of the cells. Intervals hold for one surface: other realisations may differ
    more in coverage, which the load fixes. That of the pair correlation length needs 10 islands. See the
    documentation, "Theory: contact domains".

    Examples
    --------
    Random discs have no clustering, and no dimension of their own:

    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> cells = np.zeros((256, 256), bool)
    >>> y, x = np.indices((9, 9)) - 4
    >>> for row, column in np.random.default_rng(1).integers(0, 247, (60, 2)):
    ...     cells[row : row + 9, column : column + 9] |= x**2 + y**2 <= 16
    >>> result = fc.domains.signature(xr.DataArray(cells, dims=("y", "x")))
    >>> round(float(result.clustering[1]), 1)
    1.0
    """
    planes = _masks.read_planes(mask, valid=valid, periodic=periodic)
    components = label_planes(planes, connectivity, keep=False)
    return analyse(planes, components, window=window, along=along)


def analyse(
    planes: Planes, components: Sequence[Components], *, window: Any = None, along: str | None = None
) -> xr.Dataset:
    """Return the result of `signature` for planes and their islands, without labels."""
    grid, coverage = planes.grid, planes.coverage
    shortest, extent = max(grid.spacing), min(grid.extent)
    steps = _curve_steps(shortest, extent, grid)
    sides = _sides(steps, grid)
    hit, _ = box_moments(planes, np.concatenate([SMALLEST, steps + 1]))
    spots = RandomSpots.of_hits(hit[..., : len(SMALLEST)])
    hit = hit[..., len(SMALLEST) :]
    spot, gap = spots.size(grid), _gap(sides, hit)
    # P of a point is the coverage; the gap is NaN there, as it is beyond half the extent
    is_gap_below_cell = np.fmax(coverage, hit[:, 0, 0]) >= 0.5

    islands = np.array([plane.count for plane in components], np.int64)
    median = np.array([np.median(plane.sizes) if plane.count else np.nan for plane in components])
    start = np.zeros(planes.count)
    if window is None:
        start = spot[:, 0]
        usable = ~is_gap_below_cell & (islands >= FEWEST_ISLANDS)
        window = common_window(spot[usable, 0], gap[usable, 0], shortest, extent)
    low, high = float_array(window)
    scales = np.geomspace(low, high, 3) if low < high else FINEST * shortest * np.array([1.0, 2.0, 4.0])
    own_gap, start = np.where(is_gap_below_cell, 0.0, gap[:, 0]), np.fmax(low, start)
    flags, reasons = _flags(planes, own_gap, islands, median, start, has_window=bool(np.isfinite(low)))
    in_window, plain = _window_quantities(planes, spots, np.array([low, high]), scales)
    pairs = planes.map(lambda *plane: pair_correlation_length(planes, plane[-1]), range(planes.count))
    quantities = {"spot_size": spot, "gap_size": gap, "pair_correlation_length": np.array(pairs)}
    quantities |= in_window
    # of 100 sets of 3, 5, 10 and 30 discs of random radii the intervals of the others hold the mean in .87 to
    # all, those of this length in .49, .68, .83 and .95, on periodic planes in .55, .68, .91 and all
    quantities["pair_correlation_length"][islands < 10, 1:] = np.nan
    _withhold(quantities, plain, flags)

    variables: dict[str, Any] = {
        "coverage": planes.variable(coverage),
        "n_islands": planes.variable(islands),
        "median_cells": planes.variable(median),
        "signature_flag": planes.variable(flags),
        "reason": planes.variable(reasons),
        "hit_fraction": planes.variable(hit[:, 0], "side"),
        "spots_fraction": planes.variable(spots.hit(steps)[:, 0], "side"),
        "local_slope": planes.variable(2.0 - local_slope(sides, hit[:, 0]), "side"),
        "window_low": ((), low),
        "window_high": ((), high),
    }
    for name, values in plain.items():
        variables[name] = planes.variable(values)
    for name, replicates in quantities.items():
        variables |= _with_interval(planes, name, replicates)
    if planes.dims:
        variables |= _changes(planes, quantities, along or planes.dims[-1])
    coords = {"side": ("side", sides), "scale": ("scale", scales)}
    return planes.dataset(variables, coords, notes=_notes(low, high, grid.length_unit))


def common_window(spots: Array, gaps: Array, shortest: float, extent: float) -> tuple[float, float]:
    """Return the window (m) of states with these spots and gaps; where it does not fit, (nan, nan).

    It ends at an eighth of the extent, but where spots are large one of ratio 4 may reach up to a quarter. A
    state with a gap below twice its own start is filled whatever the window is, and has no say in it.
    """
    least_ratio = 4.0  # between five surfaces D scattered by .041 at a ratio of 2, .031 at 4
    usual_share = 8  # beyond L/8 the block jackknife covers half of the true spread
    last_share = 4  # 2 and 8 gave the same windows of 40 states of pressed surfaces
    own_start = np.maximum(FINEST * shortest, spots)
    open_states = ~(gaps < 2.0 * own_start)  # a gap is NaN beyond half the extent
    low = max(FINEST * shortest, np.max(spots[open_states], initial=0.0))
    smallest_gap = np.nanmin(gaps[open_states], initial=np.inf)
    high = max(least_ratio * low, min(extent / usual_share, smallest_gap))
    return (low, high) if high <= extent / last_share * ROUNDED else (np.nan, np.nan)


@dataclass(frozen=True)
class RandomSpots:
    """Randomly placed spots with the area, the widths and the number of a set (a Boolean model).

    `coverage` is p; `along_y`, `along_x` are the mean widths of the spots times their number, and `number`
    that of spots, all per cell, shape (planes, 1 + blocks).
    """

    coverage: Array
    along_y: Array
    along_x: Array
    number: Array

    @classmethod
    def of_hits(cls, hit: Array) -> RandomSpots:
        """Return the null of sets that meet boxes of the shapes `SMALLEST` with this probability.

        A box of 1 x 2 cells meets the set where one of 1 x 1 does, and one cell ahead of each spot. The
        number follows from Miles' formula for the Euler number (8 neighbours) of a Boolean model,
        chi = (1 - p) (number - pi/4 along_y along_x), for spots that are ellipses on average.
        """
        p, row, column, square = np.moveaxis(hit, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            along_y, along_x = (column - p) / (1.0 - p), (row - p) / (1.0 - p)
            number = (square - row - column + p) / (1.0 - p) + np.pi / 4.0 * along_y * along_x
        return cls(p, along_y, along_x, np.maximum(number, 0.0))

    def hit(self, steps: Array) -> Array:
        """Return the share of squares that meet the spots, (planes, 1 + blocks, squares).

        Steiner's formula for the mean spot, dilated by a square of so many cells along y and x, (squares, 2).
        """
        down, right = steps.T
        along_y, along_x = self.along_y[..., None], self.along_x[..., None]
        grown = along_y * down + along_x * right + self.number[..., None] * down * right
        return np.asarray(1.0 - (1.0 - self.coverage[..., None]) * np.exp(-grown))

    def size(self, grid: Grid) -> Array:
        """Return 4 coverage over perimeter per area (m): the diameter of discs.

        The sides of cells on the boundary are longer than a smooth boundary by 4 / pi on average.
        """
        dy, dx = grid.spacing
        sides = 2.0 * (1.0 - self.coverage) * (self.along_y / dy + self.along_x / dx)
        # NaN of a full set, and where nothing was observed beside the cells of the set
        perimeter = np.where(sides > 0, np.pi / 4.0 * sides, np.nan)
        return np.asarray(np.where(self.coverage > 0, 4.0 * self.coverage / perimeter, np.nan))


def _window_quantities(
    planes: Planes, spots: RandomSpots, window: Array, scales: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return dimension, excess, clustering and lacunarity over the window and at its three scales.

    First those with replicates (planes, 1 + blocks, ...), then the values without an interval.
    """
    grid = planes.grid
    low, high = window if np.isfinite(window).all() else scales[[0, -1]]
    sizes = 9  # in a window of ratio 4 at a ratio of 1.19, so that local slopes still differ
    fitted = np.geomspace(low, high, sizes)
    hits, masses = Bracket.of(np.append(fitted, scales), grid, 1), Bracket.of(scales, grid, 0)
    squares = masses.boxes
    rows, columns = squares.copy(), squares.copy()
    rows[:, 0], columns[:, 1] = 1, 1
    parts = [hits.boxes, squares, rows, columns]
    hit, lacunarity = box_moments(planes, np.concatenate(parts))
    ends = np.cumsum([len(part) for part in parts])[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        missed = np.maximum(1.0 - np.split(hit, ends, axis=-1)[0], np.finfo(float).eps)
        hit = -np.expm1(-np.exp(hits.between(np.log(-np.log(missed)))))
        excess = [
            np.exp(masses.between(np.log(part))) for part in np.split(lacunarity - 1.0, ends, axis=-1)[1:]
        ]
        null = spots.hit(np.append(fitted, scales)[:, None] / np.array(grid.spacing))
        dimension, of_null = (_dimension(fitted, each[..., :sizes]) for each in (hit, null))
        local = 2.0 - np.diff(np.log(hit[:, 0, :sizes]), axis=-1) / np.diff(np.log(fitted))
        replicates = {
            "domain_dimension": dimension,
            "excess_dimension": dimension - of_null,
            "clustering": (null / hit)[..., sizes:],
            "integral_range": excess[0] * spots.coverage[..., None] * scales**2,
            "lacunarity_ratio": excess[1] / excess[2],
        }
    plain = {
        "spots_dimension": of_null[:, 0],
        "local_dimension_min": local.min(-1),
        "local_dimension_max": local.max(-1),
    }
    return replicates, plain


@dataclass(frozen=True)
class Bracket:
    """Boxes of whole cells just below and above squares of given sides, and where these lie between them."""

    boxes: Array  # first those below, then those above, (2 squares, 2)
    weight: Array  # of those above, on a scale of ln s

    @classmethod
    def of(cls, sides: Array, grid: Grid, further: int) -> Bracket:
        """Return the bracket of sides (m), of boxes that hold `further` cells more than their side.

        A square of side s at a random place touches s / spacing + 1 cells along each axis. So P(s) is exact
        for the union of the cells, and converges with the square of the spacing for a set that they sample;
        counted as s / spacing, the gap of a resolved domain was a cell longer on every grid. The mass in a
        box is that of s / spacing cells.
        """
        cells = sides[:, None] / np.array(grid.spacing)
        most = np.array(grid.shape) - further
        below, above = (
            np.clip(part, 1, np.maximum(most, 1)).astype(np.int64)
            for part in (np.floor(cells * ROUNDED), np.ceil(cells / ROUNDED))
        )
        low, high = _sides(below, grid), _sides(above, grid)
        span = np.log(high / low)
        weight = np.where(span > 0, np.log(sides / low) / np.where(span > 0, span, 1.0), 0.0)
        return cls(np.concatenate([below, above]) + further, weight)

    def between(self, values: Array) -> Array:
        """Return values, which are smooth in ln s, at the sides."""
        below, above = np.split(values, 2, axis=-1)
        return np.asarray(np.where(self.weight > 0, below + self.weight * (above - below), below))


def _curve_steps(shortest: float, extent: float, grid: Grid) -> Array:
    """Return the squares of the curves, from a cell to half the extent, in cells along y and x."""
    # with 300 in place of 24, 15 gaps at 256 cells moved by .4 % at most
    sides = np.geomspace(shortest, max(extent / 2.0, shortest), 24)
    # halves, as 1.5 cells of the shorter spacing, are rounded up in any unit of length
    cells = np.rint(sides[:, None] / np.array(grid.spacing) * ROUNDED).astype(np.int64)
    return np.unique(np.clip(cells, 1, np.maximum(np.array(grid.shape) - 1, 1)), axis=0)


def _sides(steps: Array, grid: Grid) -> Array:
    """Return the sides (m) of squares with the area of so many cells along y and x."""
    return np.asarray(np.sqrt(steps.prod(-1) * grid.cell_area))


def _dimension(lengths: Array, hit: Array) -> Array:
    """Return 2 less the least-squares slope of ln P over ln s."""
    x = np.log(lengths) - np.log(lengths).mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(2.0 - np.log(hit) @ x / (x @ x))


def _gap(lengths: Array, hit: Array) -> Array:
    """Return the side (m) from which on P exceeds 1/2; NaN below a cell and beyond half the extent."""
    with np.errstate(divide="ignore", invalid="ignore"):
        y, x = np.log(-np.log1p(-hit)), np.log(lengths)
    reached = y >= HALF
    after = np.where(reached.any(-1), reached.argmax(-1), 0)
    before = np.maximum(after - 1, 0)
    y_before, y_after = (np.take_along_axis(y, k[..., None], -1)[..., 0] for k in (before, after))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.isinf(y_after), 1.0, (HALF - y_before) / (y_after - y_before))
        length = np.exp(x[before] + share * (x[after] - x[before]))
    return np.asarray(np.where(after > 0, length, np.nan))


def _flags(
    planes: Planes, gap: Array, islands: Array, median: Array, start: Array, *, has_window: bool
) -> tuple[Array, Array]:
    """Return the flag of each state, out of `FLAGS`, and the reason in words; a gap below a cell is 0."""
    fewest_cells = 10  # below, clustering grows with the grid (2.6 to 9.4, 256 to 2048)
    coverage, count, unit = planes.coverage, planes.count, planes.grid.length_unit
    tests: list[tuple[Array, list[str]]] = [
        (~(coverage > 0), ["the set is empty"] * count),
        (coverage == 1, ["the set is full"] * count),
        (np.full(count, not has_window), ["the mask is too small for a window of ratio 4"] * count),
        (
            gap < 2.0 * start,
            [
                f"the gap, {f'{g:.3g} {unit}' if g else 'below a cell'}, is less than twice the start of a "
                f"window, {s:.3g} {unit}"
                for g, s in zip(gap, start, strict=True)
            ],
        ),
        (
            islands < FEWEST_ISLANDS,
            [
                f"{number} island{'' if number == 1 else 's'}, fewer than {FEWEST_ISLANDS}"
                for number in islands
            ],
        ),
        (
            median < fewest_cells,
            [
                f"the median island has {cells:g} cell{'' if cells == 1 else 's'}, fewer than {fewest_cells}"
                for cells in median
            ],
        ),
    ]
    flags = [next((flag for flag, (fails, _) in enumerate(tests, 1) if fails[k]), 0) for k in range(count)]
    reasons = [tests[flag - 1][1][k] if flag else "" for k, flag in enumerate(flags)]
    return np.array(flags, np.int8), np.array(reasons, str)


def _withhold(quantities: dict[str, Array], plain: dict[str, Array], flags: Array) -> None:
    """Set to NaN, in place, what the flag of a state does not allow to be given as a number."""
    flagged = flags > 0
    for name in ("domain_dimension", "excess_dimension"):
        quantities[name][flagged] = np.nan
    for values in plain.values():
        values[flagged] = np.nan
    without_scale = np.isin(flags, [FLAGS.index(name) for name in ("empty", "full", "no_window")])
    for name in AT_SCALES:
        quantities[name][without_scale] = np.nan
    quantities["clustering"][flags == FLAGS.index("unresolved")] = np.nan


def _with_interval(planes: Planes, name: str, replicates: Array) -> dict[str, Any]:
    """Return a quantity with the ends of its interval, from its replicates."""
    dims = ("scale",) if replicates.ndim == 3 else ()
    is_ratio = name in LOGARITHMIC or name.endswith("_ratio")
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.log(replicates) if is_ratio else replicates
    width = half_width(values)
    ends = [values[:, 0], values[:, 0] - width, values[:, 0] + width]
    if is_ratio:
        ends = [np.exp(end) for end in ends]
    elif name == "domain_dimension":
        ends = [np.clip(end, 0.0, 2.0) for end in ends]
    names = name, f"{name}_low", f"{name}_high"
    return {each: planes.variable(end, *dims) for each, end in zip(names, ends, strict=True)}


def _changes(planes: Planes, quantities: dict[str, Array], along: str) -> dict[str, Any]:
    """Return the changes from the state before along the path, from the paired jackknife."""
    axis = planes.dims.index(along)
    result: dict[str, Any] = {}
    for name, change in CHANGES.items():
        states = quantities[name].reshape(planes.shape + quantities[name].shape[1:])
        last = planes.shape[axis] - 1
        later, earlier = (np.take(states, np.arange(last) + step, axis) for step in (1, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            difference = later / earlier if change.endswith("_ratio") else later - earlier
        first = np.full_like(np.take(states, [0], axis), np.nan)
        difference = np.concatenate([first, difference], axis).reshape(quantities[name].shape)
        result |= _with_interval(planes, change, difference)
    return result


def _notes(low: float, high: float, unit: str) -> dict[str, dict[str, str]]:
    window = f"over {low:.3g} to {high:.3g} {unit}" if np.isfinite(low) else "without a window"
    return {
        "domain_dimension": {
            "long_name": f"box dimension of the domain {window}",
            "reason": "NaN where signature_flag is not 0: see the variable reason",
        }
    }
