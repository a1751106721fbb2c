"""How far a block slides until the faces have forgotten each other."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import check_crack, check_shear, direction_coords, missing
from fractalcontact.joints._directions import Direction, several_directions
from fractalcontact.joints._memory import FORGOTTEN, decorrelation, tile_sums
from fractalcontact.joints.opening import COMPASS

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints.crack import Crack

WHERE = "fractalcontact.joints.decorrelation_length"
MOST = 128  # shears, where none are given
Array = np.ndarray[Any, np.dtype[Any]]


def decorrelation_length(
    crack: Crack,
    *,
    direction: str | float | Sequence[str | float] = COMPASS,
    shear: Sequence[float] | Array | None = None,
) -> xr.Dataset:
    """Return the shear at which the two faces have forgotten each other.

    The rule: the correlation of the facing heights, each from the mean plane of its whole face, has fallen to
    1/e of what it is at no shear. A self-affine face has no such length of its own: the result then grows
    with the face, and tells how far the block must slide on this one.

    Parameters
    ----------
    crack : Crack
    direction : str, float, or a sequence of them
        Directions in which the block slides: compass words, or azimuths in degrees (E = 0, anticlockwise).
    shear : sequence of float, optional
        Shears (m), ascending from 0. None: whole cells up to the greatest travel (half the face where it
        wraps); all of them up to 128, else 128 in geometric steps.

    Returns
    -------
    Dataset
        correlation and structure_function (m2, the variance of the delta-surface) over (direction, shear);
        decorrelation_length (m) over direction, NaN where the faces still remember each other at the
        greatest shear; decorrelation_length_low and _high, its 95 % interval, NaN where the block is less
        than 15 lengths wide, for it is then one sample of few; missing_reason; run_time (s).

    Raises
    ------
    InvalidInput
        The block cannot slide, heights are missing in its path, or an argument is wrong.

    Notes
    -----
    The interval is a jackknife over tiles of the block, and was checked to cover on Gaussian faces with
    exponential, Gaussian and power-law correlation.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 4 (the threshold scale); Künsch (1989),
    Ann. Stat. 17:1217 (jackknife of dependent data).
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        check_crack(crack, problems)
        towards = several_directions(direction, problems)
        if shear is not None:
            shears = check_shear(shear, crack, towards, problems)
            ascending = shears[0] == 0 and shears.size > 1 and bool((np.diff(shears) > 0).all())
            problems.require(ascending, "shear", "at least two shears, ascending from 0", shear)
        elif not problems.found:
            shears = _whole_cells(crack, towards)
            problems.require(
                shears.size > 1,
                "crack",
                "a block smaller than its face, or periodic faces",
                crack.layout.cells,
            )
    begun = time.perf_counter()
    correlations, variances, lengths = [], [], []
    for one in towards:
        sums, variance = _sums(crack, shears, one)
        correlations.append(sums.correlation(np.ones(sums.product.shape[1])))
        variances.append(variance)
        lengths.append(decorrelation(sums, shears, min(crack.block)))
    plane = ("direction", "shear")
    result = xr.Dataset(
        {
            "correlation": (plane, np.stack(correlations)),
            "structure_function": (plane, np.stack(variances)),
            "decorrelation_length": ("direction", [length.value for length in lengths]),
            "decorrelation_length_low": ("direction", [length.low for length in lengths]),
            "decorrelation_length_high": ("direction", [length.high for length in lengths]),
            "missing_reason": ("direction", np.array([length.reason for length in lengths])),
            "run_time": time.perf_counter() - begun,
        },
        coords={"shear": ("shear", shears), **direction_coords(towards)},
    )
    parameters = {"crack": crack.summary(), "direction": [one.name for one in towards], "shear": shear}
    title = "correlation of the faces of a sheared crack"
    return stamp(label(result), WHERE, parameters, title=title, forgotten_at=FORGOTTEN)


def _whole_cells(crack: Crack, towards: Sequence[Direction]) -> Array:
    """Return whole-cell shears up to the least travel of the directions, at most `MOST` besides 0."""
    layout = crack.layout
    step = min(layout.spacing)
    reach = min(layout.travel(one.unit) for one in towards)
    if math.isinf(reach):
        reach = 0.5 * min(n * s for n, s in zip(layout.face, layout.spacing, strict=True))
    cells = math.floor(reach / step * (1.0 + 1e-9))
    if cells <= MOST:
        return np.arange(cells + 1) * step
    return np.concatenate([[0.0], np.unique(np.rint(np.geomspace(1, cells, MOST)))]) * step


def _without_rounding(residual: Array, heights: Array) -> Array:
    """Return the heights from the mean plane; zero where they are no more than the rounding of a plane."""
    rounding = 64.0 * np.finfo(float).eps * float(np.nanmax(np.abs(heights)))
    return residual if float(np.nanmax(np.abs(residual))) > rounding else residual * 0.0


def _sums(crack: Crack, shears: Array, towards: Direction) -> Any:
    from fractalcontact.base.polynomial import detrended

    layout = crack.layout
    order = 0 if any(layout.wraps) else 1
    faces = [crack.lower] if crack.upper is None else [crack.lower, crack.upper]
    heights = [np.asarray(face.values, dtype=np.float64) for face in faces]
    planes = [_without_rounding(detrended(face, order)[0], face) for face in heights]
    sums, variance = tile_sums(planes[0], planes[-1][layout.slices], layout, shears, towards.unit)
    if not np.isfinite(variance).all():
        raise missing(WHERE, crack, towards, float(shears[~np.isfinite(variance)][0]))
    return sums, variance
