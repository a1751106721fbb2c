"""Decorrelation of two faces: the shear at which the facing heights are no longer correlated.

Heights are measured from the mean plane of their whole face. Sums are kept for tiles of the block, so that an
interval follows from leaving tiles out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.compass import (
    COMPASS,
    Direction,
    check_directions,
    direction_coords,
    read_directions,
)
from fractalcontact.base.numbers import ROUNDED, Array, float_array
from fractalcontact.base.regression import detrended, rounding_of
from fractalcontact.base.results import public_result
from fractalcontact.base.study import BORRI_BRUNETTO_1998
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Block, Crack, Pair, check_crack, check_sliding
from fractalcontact.joints._delta_surface import heights_under, missing_heights
from fractalcontact.joints._sheared_contact import stacked

THRESHOLD = math.exp(-1.0)  # correlation, over that at no shear, that defines the decorrelation length

# tiles along an edge of the block; on eight intervals 6 and 3 changed the width by .66 to 1.9 times, 12 and 4
# by .93 to 1.03, 16 and 8 by .67 to 1.25; coverage was checked with these
FINE, COARSE = 8, 4
# over every tile, shape (shear, tile): products of facing heights, squares of the lower and the upper ones
Sums = tuple[Array, Array, Array]


def _check(problems: Problems) -> None:
    given = problems.given
    if given.shear is not None:
        check_sliding(problems)
        if problems.numbers("shear", at_least=0):
            shears = float_array(given.shear)
            ascending = shears[0] == 0 and shears.size > 1 and bool((np.diff(shears) > 0).all())
            problems.require(ascending, "shear", "at least two shears, ascending from 0")
        return
    valid = [check_crack(problems), check_directions(problems)]
    if all(valid):
        directions = read_directions(given.direction)
        slides = all(_whole_cell_shears(given.crack, towards).size > 1 for towards in directions)
        expected = "a block smaller than its face, or periodic faces"
        problems.require(slides, "crack", expected, given.crack.layout.cells)


@public_result(
    title="correlation of the faces of a sheared crack",
    references=f"{BORRI_BRUNETTO_1998}; Künsch, Ann. Stat. 17:1217 (1989) (jackknife)",
    check=_check,
    memory=50.0,
)
def decorrelation_length(
    crack: Crack,
    *,
    direction: str | float | Sequence[str | float] = COMPASS,
    shear: Sequence[float] | Array | None = None,
) -> xr.Dataset:
    """Return the shear at which the two faces of a crack have decorrelated.

    It is the shear at which the correlation of the facing heights, each from the mean plane of its whole
    face, has fallen to 1/e of that at no shear. A self-affine face has no such length of its own: the result
    then grows with the size of the face, and holds for this face only.

    Parameters
    ----------
    crack : Crack
    direction : str, float, or a sequence of them
        Directions in which the block slides: compass words, or degrees anticlockwise from E.
    shear : sequence of float, optional
        Shears (m), ascending from 0. None: of each direction whole cells up to its travel (half the face
        where it wraps); all of them up to 128, otherwise 128 in geometric steps.

    Returns
    -------
    Dataset
        correlation and structure_function (m2, the variance of the difference of these heights) over
        (direction, shear), NaN beyond the travel of a direction; decorrelation_length (m) over direction, NaN
        where the faces are not correlated at no shear, or still are at the greatest; its 95 % interval
        decorrelation_length_low and _high, NaN where the block is less than 15 lengths wide and holds too few
        independent parts; missing_reason; run_time (s).

    Raises
    ------
    InvalidInput
        The block cannot slide, heights are missing in its path, or an argument is wrong.

    Notes
    -----
    The interval is a jackknife over tiles of the block. Its coverage was checked on Gaussian faces with
    exponential, Gaussian and power-law correlation.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 4 (the threshold scale); Künsch (1989),
    Ann. Stat. 17:1217 (jackknife of dependent data).

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> wave = np.cos(2 * np.pi * np.arange(80) / 80) * np.ones((80, 1))
    >>> surface = fc.surfaces.from_array(wave, 1.0, periodic=True)
    >>> crack = fc.joints.Crack(surface, young=30e9, poisson=0.2)
    >>> result = fc.joints.decorrelation_length(crack, direction="E")
    >>> round(float(result.decorrelation_length[0]), 1)  # 80 / (2 pi) arccos(1/e)
    15.2
    """
    directions = read_directions(direction)
    if shear is None:
        shears_of = [_whole_cell_shears(crack, towards) for towards in directions]
    else:
        shears_of = [float_array(shear)] * len(directions)
    shears = np.unique(np.concatenate(shears_of))
    rows: list[dict[str, Any]] = []
    for towards, own_shears in zip(directions, shears_of, strict=True):
        within = int(np.searchsorted(shears, own_shears[-1])) + 1
        sums, variance = _crack_sums(crack, shears[:within], towards)
        beyond = np.full(shears.size - within, np.nan)
        correlation = tile_correlation(sums, np.ones(sums[0].shape[1]))
        # from its own shears, so that no length depends on the directions beside it
        at = np.searchsorted(shears, own_shears)
        length = estimate_length((sums[0][at], sums[1][at], sums[2][at]), own_shears, min(crack.block))
        curves = {"correlation": correlation, "structure_function": variance}
        rows.append({name: np.append(curve, beyond) for name, curve in curves.items()} | length._asdict())
    result = xr.Dataset(
        {name: (("direction", "shear")[: values.ndim], values) for name, values in stacked(rows).items()},
        coords={"shear": ("shear", shears), **direction_coords(directions)},
        attrs={"correlation_threshold": THRESHOLD},
    )
    missing = zip(directions, (row["missing_reason"] for row in rows), strict=True)
    reasons = [f"{towards.name}: {reason}" for towards, reason in missing if reason]
    for name in ("decorrelation_length", "decorrelation_length_low", "decorrelation_length_high"):
        if reasons and bool(result[name].isnull().any()):
            result[name].attrs["reason"] = f"NaN: {'; '.join(reasons)}"
    return result


def _whole_cell_shears(crack: Crack, towards: Direction, most: int = 128) -> Array:
    """Return 0 and at most so many whole-cell shears up to the travel towards a direction.

    With 64 and 256 of them no length on eight faces of 400 x 400 points changed.
    """
    layout, axis = crack.layout, int(np.argmax(np.abs(towards.unit)))
    step = layout.spacing[axis]
    travel = layout.travel(towards.unit)
    if math.isinf(travel):  # half the face, along the axis that the block moves on most
        travel = 0.5 * layout.face_cells[axis] * step
    cells = math.floor(travel / step * ROUNDED)
    if cells <= most:
        return np.arange(cells + 1) * step
    return np.concatenate([[0.0], np.unique(np.rint(np.geomspace(1, cells, most)))]) * step


def _crack_sums(crack: Crack, shears: Array, towards: Direction) -> tuple[Sums, Array]:
    layout = crack.layout
    faces = [crack.lower] if crack.upper is None else [crack.lower, crack.upper]
    heights = [np.asarray(face.values, dtype=np.float64) for face in faces]
    residuals = [_without_rounding(detrended(face, 1, layout.wraps)[0], face) for face in heights]
    sums, variance = tile_sums(residuals[0], residuals[-1][layout.slices], layout, shears, towards.unit)
    if not np.isfinite(variance).all():
        raise missing_heights(crack, towards, float(shears[~np.isfinite(variance)][0]))
    return sums, variance


def _without_rounding(residual: Array, heights: Array) -> Array:
    """Return the heights from the mean plane, zero where they are only the rounding of a plane."""
    return residual if float(np.nanmax(np.abs(residual))) > rounding_of(heights) else residual * 0.0


def tile_correlation(sums: Sums, weights: Array) -> Array:
    """Return the correlation at every shear from the tiles of weight 1 (the others have weight 0)."""
    product, lower, upper = (part @ weights for part in sums)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(product / np.sqrt(lower * upper))


class Length(NamedTuple):
    """Decorrelation length with its 95 % interval, or the reason why one is missing."""

    decorrelation_length: float
    decorrelation_length_low: float = math.nan
    decorrelation_length_high: float = math.nan
    missing_reason: str = ""


def tile_sums(lower: Array, upper: Array, block: Block, shears: Array, unit: Pair) -> tuple[Sums, Array]:
    """Return the sums over tiles, and the variance of the delta-surface, at every shear.

    Parameters
    ----------
    lower : ndarray, shape (ny, nx)
        Heights of the whole lower face from its mean plane.
    upper : ndarray, shape block.cells
        Heights of the face of the block from the mean plane of the upper face.
    """
    side = FINE if min(block.cells) >= FINE else 1
    shape = shears.size, side * side
    product, squares, variance = np.empty(shape), np.empty(shape), np.empty(shears.size)
    for index, shear in enumerate(shears):
        under = heights_under(lower, block, block.shift(float(shear), unit))
        product[index], squares[index] = _tile_sum(under * upper, side), _tile_sum(under * under, side)
        variance[index] = np.var(under - upper)
    return (product, squares, np.broadcast_to(_tile_sum(upper * upper, side), shape)), variance


def _tile_sum(values: Array, side: int) -> Array:
    for axis in (0, 1):
        starts = np.arange(side) * values.shape[axis] // side
        values = np.add.reduceat(values, starts, axis=axis)
    return values.ravel()


def estimate_length(
    sums: Sums,
    shears: Array,
    edge: float,
    # lengths in an edge: of 40 intervals on faces of exponential correlation 31 hold the length with 8, 34
    # with 11, 39 with 15, 37 with 20
    fewest: float = 15.0,
    quantile: float = 2.776,  # of Student's t for 4 degrees of freedom: covers 95 % on faces of known length
) -> Length:
    """Return the shear at which the correlation has fallen to 1/e of that at no shear, with its interval.

    The interval is the jackknife spread of the logarithm of the length. The variances from 8 and from 4 tiles
    along an edge are extrapolated to fewer, wider tiles, which depend least on each other.
    """
    tiles = sums[0].shape[1]
    correlation = tile_correlation(sums, np.ones(tiles))
    value = _crossing(correlation, shears)
    if not np.isfinite(correlation[0]):
        return Length(math.nan, missing_reason="the faces are planes")
    if correlation[0] <= 0:
        return Length(math.nan, missing_reason="the faces are not correlated at no shear")
    if math.isnan(value):
        return Length(value, missing_reason="the faces are still correlated at the greatest shear")
    if value < shears[1]:
        return Length(value, missing_reason="no interval: the length is below the first shear")
    if tiles < FINE * FINE:
        return Length(value, missing_reason="no interval: the block has too few cells")
    if edge < fewest * value:
        return Length(value, missing_reason=f"no interval: the block is less than {fewest:g} lengths wide")
    fine, coarse = (_jackknife_variance(sums, shears, side) for side in (FINE, COARSE))
    half_width = quantile * math.sqrt(max(2.0 * coarse - fine, coarse))
    if not math.isfinite(half_width):
        return Length(
            value, missing_reason="no interval: without a part of the block the faces stay correlated"
        )
    return Length(value, value * math.exp(-half_width), value * math.exp(half_width))


def _jackknife_variance(sums: Sums, shears: Array, side: int) -> float:
    """Return the jackknife variance of the logarithm of the length, with side * side tiles left out."""
    row = np.arange(FINE) * side // FINE
    group = (row[:, None] * side + row[None, :]).ravel()
    correlations = (tile_correlation(sums, (group != tile).astype(float)) for tile in range(side * side))
    lengths = [_crossing(correlation, shears) for correlation in correlations]
    with np.errstate(invalid="ignore"):
        return float((side * side - 1) * np.var(np.log(lengths)))


def _crossing(correlation: Array, shears: Array) -> float:
    """Return where the correlation first falls to 1/e of its first value, linear between the shears."""
    if not correlation[0] > 0:
        return math.nan
    excess = correlation / correlation[0] - THRESHOLD
    below = np.flatnonzero(excess <= 0)
    if below.size == 0:
        return math.nan
    k = int(below[0])
    part = excess[k - 1] / (excess[k - 1] - excess[k])
    return float(shears[k - 1] + part * (shears[k] - shears[k - 1]))
