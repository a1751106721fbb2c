"""Box counting: the number of boxes that meet a set, and the box dimension with its null."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.scaling import local_slope
from fractalcontact.domains import _covers, _dust
from fractalcontact.domains._masks import Array, Planes, assemble, box_sizes, read_mask

if TYPE_CHECKING:
    import xarray as xr

ROUNDING = 1e-14  # no interval is narrower
SOURCE = (
    "Falconer, Fractal Geometry (1990), ch. 3 (box dimension); Borri-Brunetto, Carpinteri and Chiaia, "
    "FRAMCOS-3 (1998) (of contact domains)"
)


def box_dimension(
    mask: xr.DataArray,
    *,
    scales: Any = None,
    cover: str = "minimum",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Box dimension of a set of cells, with its interval and with the value of a random dust beside it.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    scales : sequence of int, optional
        Edges of the boxes in cells. The dimension is then the least-squares slope of ln N over ln s, all
        sizes alike. By default the sizes are the products of 2 and 3 from one cell to the geometric mean
        of the cell and the extent (at least to 9), and the dimension is the mean of the local slopes over
        the ratio, 2 or 3, at which they are steadiest.
    cover : {"minimum", "mean", "aligned"}
        Which boxes: the fewest over all offsets of the grid, their mean over all offsets, or those of the
        one grid that starts at the first cell. The default call with "minimum" also looks at the mean,
        and where that is the steadier of the two lets it count as much.
    periodic : bool, optional
        Whether boxes go round over the edges; by default what the axes say. True is refused on a free axis.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed. Others are in no set; the counts are divided by the share of the boxes'
        area that was observed.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `box_dimension`; `ci_low` and `ci_high`, two standard deviations
        of the local slopes to either side or, in the default call, as many as Student's t has for so many
        sizes, and a part of what the fewest boxes and their mean differ by (NaN where fewer than two slopes
        speak); `scale_min`, `scale_max` (cells);
        `coverage`;
        `null_dimension`, the same fit to the expected counts of as many cells thrown at random, with the
        standard deviation `null_spread` from dust to dust; `differs_from_random`, whether the mean counts at
        sizes 2 to 4 are out of reach for a dust. Over `box_size` (cells) too, with `box_length` (m, the
        side of a square as large as the box): `box_count`, of whole boxes; `box_measure`, where a box cut
        by the edge of the mask counts by its part inside if the set runs on into the next box, so that a
        full mask has exactly n/s boxes along an axis; `local_slope`, -d ln(box_measure)/d ln(box_size);
        `null_count`. Exactly 0 for one cell, 1 for a row or column that spans the mask, 2 for a full mask.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, its dims are not (..., y, x), a scale is not a whole number of
        cells between 1 and the extent, `cover` is unknown, or `periodic` is True on a free axis.

    Notes
    -----
    An empty plane gives NaN, with the reason in the attributes. A dimension needs a stated window of scales:
    over the full range, the counts of any set measure little but its coverage, which is why the dust's
    value stands beside it. A single island of a few cells is a point at scales above its size.

    The default interval holds the dimension of 98 % of sets in 250 x 250 to 1024 x 1024 cells (with the cover
    "mean" 97 %; in 100 x 100 cells 95 and 91 %): self-similar sets of ratio 2 to 5, fixed and drawn anew at
    every level, placed and turned at random, fractal percolation, spanning clusters of site percolation,
    lines, circles and von Koch curves. It does not where the sampling ends before the cell does, as for too
    short a Levy flight.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.box_dimension") as problems:
        cover = problems.choice("cover", cover, _covers.COVERS)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        sizes = _sizes(scales, planes, cover, problems)
    found = _covers.curve(planes, sizes, cover)
    dimension, half = _fit(planes, sizes, found, cover, chosen=scales is not None)
    null = _null(planes, sizes, chosen=scales is not None)
    known = np.isfinite(dimension)
    variables = {
        "box_dimension": planes.variable(dimension),
        "ci_low": planes.variable(dimension - half),
        "ci_high": planes.variable(dimension + half),
        "scale_min": planes.variable(np.where(known, sizes.min(), np.nan)),
        "scale_max": planes.variable(np.where(known, sizes.max(), np.nan)),
        "coverage": planes.variable(planes.coverage),
        **{name: planes.variable(values) for name, values in null.items() if name != "null_count"},
        "box_count": planes.variable(found.count, "box_size"),
        "box_measure": planes.variable(found.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(sizes, found.measure), "box_size"),
        "null_count": planes.variable(null["null_count"], "box_size"),
        "run_time": ((), time.perf_counter() - begin),
    }
    notes = _notes(known, sizes, chosen=scales is not None)
    dataset = assemble(planes, variables, _size_coords(sizes, planes), notes=notes)
    parameters = {"mask": mask, "scales": scales, "cover": cover, "periodic": periodic, "valid": valid}
    return stamp(
        dataset, "fractalcontact.domains.box_dimension", parameters, title="Box dimension", references=SOURCE
    )


@accounted("none: counted")
def box_counts(
    mask: xr.DataArray,
    sizes: Any = None,
    *,
    cover: str = "mean",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Number of boxes that meet a set, by size, before any fit.

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
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.box_counts") as problems:
        cover = problems.choice("cover", cover, _covers.COVERS)
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        every = np.arange(1, max(1, min(planes.grid.shape) // 2) + 1)
        chosen = _sizes(every if sizes is None else sizes, planes, cover, problems, "sizes")
    found = _covers.curve(planes, chosen, cover)
    variables = {
        "box_count": planes.variable(found.count, "box_size"),
        "box_measure": planes.variable(found.measure, "box_size"),
        "local_slope": planes.variable(0.0 - local_slope(chosen, found.measure), "box_size"),
        "run_time": ((), time.perf_counter() - begin),
    }
    dataset = assemble(planes, variables, _size_coords(chosen, planes))
    parameters = {"mask": mask, "sizes": sizes, "cover": cover, "periodic": periodic, "valid": valid}
    return stamp(
        dataset, "fractalcontact.domains.box_counts", parameters, title="Box counts", references=SOURCE
    )


def _sizes(scales: Any, planes: Planes, cover: str, problems: Problems, argument: str = "scales") -> Array:
    """Sizes as given, or the default ones; the mean needs boxes no longer than half the shorter side."""
    shape = planes.grid.shape
    longest = max(1, min(shape) // 2) if cover == "mean" else 2 * max(shape)
    default = _covers.default_sizes(shape)
    return box_sizes(scales, default[default <= longest], problems, argument, longest=longest)


def _size_coords(sizes: Array, planes: Planes) -> dict[str, Any]:
    return {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}


def _fit(
    planes: Planes, sizes: Array, found: _covers.Curve, cover: str, *, chosen: bool
) -> tuple[Array, Array]:
    """Return the dimension and the half-width of its interval for every plane."""
    if chosen:
        fits = [_covers.regression(sizes, measure) for measure in found.measure]
        pairs = [(fit.dimension, 2.0 * fit.spread) for fit in fits]
    elif cover == "aligned":
        fits = [_covers.steady(sizes, area) for area in found.area]
        pairs = [(fit.dimension, _covers.deviations(sizes) * fit.spread) for fit in fits]
    else:
        other = found
        if 2 * sizes.max() <= min(planes.grid.shape):
            other = _covers.curve(planes, sizes, "mean" if cover == "minimum" else "minimum")
        fewest, mean = (found.area, other.area) if cover == "minimum" else (other.area, found.area)
        pairs = [_covers.estimate(sizes, few, many, cover) for few, many in zip(fewest, mean, strict=True)]
    dimension, half = np.array(pairs, float).reshape(-1, 2).T
    half = half + ROUNDING
    return dimension, half if sizes.size > (2 if chosen else 3) else np.full(half.shape, np.nan)


def _null(planes: Planes, sizes: Array, *, chosen: bool) -> dict[str, Array]:
    """Return the dust's counts, dimension and spread, and whether the set differs from it."""
    small = np.array([size for size in _dust.LOOK if 2 * size <= min(planes.grid.shape)], np.int64)
    both = np.union1d(sizes, small)
    held = [dict(zip(both.tolist(), one, strict=True)) for one in _held(planes, both)]
    mean = _covers.curve(planes, small, "mean").measure if small.size else np.zeros((planes.count, 0))
    counts, rows = [], []
    for plane, (cells, observed) in enumerate(zip(planes.occupied, planes.observed, strict=True)):
        of = held[min(plane, len(held) - 1)]
        boxes = [of[size] for size in sizes.tolist()]
        null = _dust.expected(cells, observed, sizes, boxes)
        fit = _covers.regression(sizes, null) if chosen else _covers.steady(sizes, null * sizes**2)
        known = np.isfinite(fit.dimension)
        deviation = _spread(cells, observed, sizes, boxes, null, fit) if known else np.nan
        looked = [of[size] for size in small.tolist()]
        other = known and _dust.differs(cells, observed, small, mean[plane], looked)
        counts.append(null)
        rows.append((fit.dimension, deviation, other))
    dimension, deviation, other = np.array(rows, float).T
    return {
        "null_count": np.array(counts),
        "null_dimension": dimension,
        "null_spread": deviation,
        "differs_from_random": other.astype(bool),
    }


def _spread(
    cells: int, observed: int, sizes: Array, held: list[_dust.Held], null: Array, fit: _covers.Fit
) -> float:
    """Return the standard deviation of the dust's dimension; of many sizes a few dozen stand for all."""
    if sizes.size > 64:
        places = np.unique(np.searchsorted(sizes, np.geomspace(sizes[0], sizes[-1], 48)))
        sizes, null, held = sizes[places], null[places], [held[place] for place in places]
        fit = _covers.regression(sizes, null)
    return _dust.spread(cells, observed, sizes, held, null, fit.weights)


def _held(planes: Planes, sizes: Array) -> list[list[_dust.Held]]:
    """Return how many observed cells boxes of each size hold, for one plane or for each; see `_dust.Held`.

    Boxes longer than half the shorter side hold as many times more than the longest others as they are
    larger.
    """
    if planes.valid is None:
        cells = float(np.prod(planes.grid.shape))
        return [[(np.array([float(size) ** 2]), np.ones(1), cells / float(size) ** 2) for size in sizes]]
    longest = max(1, min(planes.grid.shape) // 2)
    found = []
    for valid in planes.valid:
        usable = np.unique(np.minimum(sizes, longest)).tolist()
        counts = {size: _covers.observed_in_boxes(valid, size, planes.grid.periodic) for size in usable}
        one = []
        for size in sizes.tolist():
            used = min(size, longest)
            some = np.flatnonzero(counts[used][1:]) + 1
            boxes = counts[used][some]
            total = float(max(boxes.sum(), 1))
            one.append((some * (size / used) ** 2, boxes / total, total / float(size) ** 2))
        found.append(one)
    return found


def _notes(known: Array, sizes: Array, *, chosen: bool) -> dict[str, dict[str, str]]:
    interval = "two standard deviations of the local slopes"
    interval = interval if chosen else "from the spread of the local slopes"
    notes = {
        "ci_low": {"long_name": f"lower end of the interval of the box dimension ({interval})"},
        "ci_high": {"long_name": f"upper end of the interval of the box dimension ({interval})"},
        "scale_min": {"units": "1", "long_name": "smallest box of the fit, in cells"},
        "scale_max": {"units": "1", "long_name": "largest box of the fit, in cells"},
        "local_slope": {"long_name": "local dimension, -d ln(box_measure)/d ln(box_size)"},
    }
    if sizes.size < 2:
        reason = "" if chosen else "; the mask is too narrow"
        notes["box_dimension"] = {"comment": f"NaN: one size of box gives no slope{reason}"}
    elif not known.all():
        notes["box_dimension"] = {"comment": f"NaN where the set is empty ({int((~known).sum())} planes)"}
    return notes
