"""Registration of two measured faces: the shift, rotation and tilt that bring them into mated position.

The upper face is rotated by an angle about the centre c of the lower one, shifted, and tilted:
moved(p) = upper(q) + slope . p with p = c + R (q - c) + shift, all lengths in cells, (y, x). The first guess
of the shift is the maximum of the masked correlation of the faces without their long waves. Newton steps on
smoothed faces refine it. Places where the faces are damaged get little weight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning, InvalidInput, warn
from fractalcontact.base.grid import UNIFORM, Grid, read_grid
from fractalcontact.base.numbers import Array, power_of_two
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems, Words, require

Pair = tuple[float, float]

WHERE = "fractalcontact.joints.register"
TURNS = ("x", "y")  # about which a body may be turned over


def _check(problems: Problems) -> None:
    given = problems.given
    problems.boolean("rotation")
    problems.boolean("tilt")
    problems.choice("turn_upper", among=TURNS, optional=True)
    valid = [
        problems.surface(name, face, finite=False, smallest=16)  # see the widest smoothing of `find_pose`
        for name, face in (("lower", given.lower), ("upper", given.upper))
    ]
    if not all(valid):
        return
    grid, other = read_grid(given.lower), read_grid(given.upper)
    for axis, name in enumerate(("y", "x")):
        step, step_upper = grid.spacing[axis], other.spacing[axis]
        # along the whole face the places of both may part by 1e-4 of a cell
        if abs(step_upper - step) * other.shape[axis] > UNIFORM * step * 100:
            problems.add(f"upper.{name}", f"the spacing of lower, {step:g} m", f"{step_upper:g} m")
    for argument, face in (("lower", given.lower), ("upper", given.upper)):
        values = np.asarray(face.values, dtype=np.float64)
        problems.require(not np.isinf(values).any(), argument, "no infinite heights", "some")
        problems.require(bool(np.isfinite(values).any()), argument, "heights", NONE)
    ratio = grid.spacing[0] / grid.spacing[1]
    # a rotation in cells is one in the plane only where the cells are square
    square = given.rotation is not True or abs(ratio - 1.0) <= UNIFORM
    problems.require(square, "rotation", "False where spacings differ", f"a ratio of {ratio:g}")


@public_result(
    title="two faces in mated position",
    references="Padfield, D., Masked object registration in the Fourier domain, IEEE TIP 21 (2012)",
    check=_check,
    memory=930.0,
)
def register(
    lower: xr.DataArray,
    upper: xr.DataArray,
    *,
    rotation: bool = True,
    tilt: bool = True,
    turn_upper: str | None = None,
) -> xr.Dataset:
    """Move the upper of two measured faces into mated position over the lower one.

    The upper face is shifted, rotated about the middle of the lower face and tilted until the aperture varies
    least; then it is interpolated to the grid of the lower face. The mean aperture stays as measured.

    Parameters
    ----------
    lower, upper : DataArray, shape (y, x)
        Heights (m) of two facing faces, positive upwards and seen from above, in one frame: the aperture is
        upper - lower. Equal spacing; the extents may differ. Missing heights (NaN) are allowed.
    rotation, tilt : bool
        Whether the face may be rotated and tilted.
    turn_upper : {"x", "y"}, optional
        The upper body was scanned with its face up: turn it over about x or y, that is, reverse the other
        axis and the sign of the heights. Its heights then have a zero of their own.

    Returns
    -------
    Dataset
        height (y, x): the upper face in mated position on the grid of `lower`, NaN where it was not measured,
        the `upper` of a `Crack`; aperture (y, x) = height - lower; shift_x, shift_y (m), rotation (degree,
        anticlockwise), tilt_x, tilt_y (slopes): the motion of the upper face; shift_x_error, shift_y_error,
        rotation_error: jackknife standard errors over 6 x 6 tiles; mismatch (m, standard deviation of the
        aperture), correlation (of the facing heights), common_fraction, iterations, converged, run_time (s).

    Raises
    ------
    InvalidInput
        The faces are not on grids of equal spacing, have fewer than 16 points along an axis, do not overlap,
        have no relief that determines their position, or are rotated by more than about 5 degrees; the upper
        one fits only if turned over, or lies below the lower one.

    Warns
    -----
    ConvergenceWarning
        The position was still moving after the last step, or its standard error exceeds one point.

    References
    ----------
    Padfield (2012), IEEE Trans. Image Process. 21:2706 (masked correlation).

    Examples
    --------
    >>> import fractalcontact as fc
    >>> block = fc.surfaces.fbm((72, 72), 1e-4, hurst=0.8, rms_increment=5e-6, rng=1)
    >>> lower, upper = block[4:68, 4:68], block[4:68, 2:66]  # the upper face lies 2 cells too far east
    >>> upper = upper.assign_coords(x=lower.x)
    >>> mated = fc.joints.register(lower, upper, rotation=False, tilt=False)
    >>> round(float(mated.shift_x) / 1e-4, 2), round(float(mated.correlation), 3)
    (-2.0, 1.0)
    """
    low, up = (np.asarray(face.values, dtype=np.float64) for face in (lower, upper))
    grid = read_grid(lower)
    starts = [
        float(upper[dim].values[0] - lower[dim].values[0]) / step
        for dim, step in zip(("y", "x"), grid.spacing, strict=True)
    ]
    offset = (starts[0], starts[1])
    scanned, up = up, turned_over(up, turn_upper)
    fitted = [0, 1, *([2] if rotation else []), 3, *([4, 5] if tilt else [])]  # see `_columns`
    pose = find_pose(low, up, offset, fitted)
    if not pose.is_certain:
        _refuse_turned_face(low, scanned, turn_upper, offset, fitted)
    expected = "overlapping faces with relief along both axes, turned by a few degrees at most"
    require(pose.determined, "lower, upper", expected, Words("nothing that fixes the position"))
    moved = resample(up, source_places(pose, low.shape, offset))
    y, x = np.indices(low.shape, dtype=float)
    tilt_plane = pose.slope[0] * y + pose.slope[1] * x
    moved += tilt_plane - tilt_plane[np.isfinite(moved - low)].mean()  # none over the common part
    if pose.error > 1.0:
        message = f"{WHERE}: position not determined, only to {pose.error:.2g} points: do the faces belong "
        warn(message + "together, turned by a few degrees at most?", ConvergenceWarning)
    result = _dataset(lower, low, moved, pose, grid)
    if turn_upper is None:
        _refuse_swapped_faces(result)
    return result


def turned_over(face: Array, axis: str | None) -> Array:
    """Return the heights of a body that is turned over about x or y; as they are without an axis."""
    # about x the rows, axis 0 of the array, are reversed
    return face if axis is None else np.asarray(-np.flip(face, TURNS.index(axis)))


def _refuse_turned_face(
    lower: Array, scanned: Array, given: str | None, offset: Pair, fitted: list[int]
) -> None:
    """Raise where the upper face, which does not fit turned over as `given`, fits in another way."""
    for axis in (None, *TURNS):
        turned = turned_over(scanned, axis)
        if axis != given and find_pose(lower, turned, offset, fitted).is_certain:
            remedy = f"with turn_upper={axis!r} (--turn-upper {axis})" if axis else "without turn_upper"
            problem = "upper: expected faces seen from above, got one scanned face up"
            if given is not None:
                problem = f"turn_upper: expected another way to turn the upper body, got {given!r}"
            raise InvalidInput("", [f"{problem}: it fits {remedy}"])


def _refuse_swapped_faces(result: xr.Dataset, overlap: float = 0.5) -> None:
    """Raise where the upper face lies below the lower one, beyond what a tilt lifts it at its edges.

    It does by more than `overlap` mismatches. The faces of a joint that touch have a mean aperture of about
    two of them (1.9 of the gneiss pair), swapped ones minus that, and levelled ones none.
    """
    mean, mismatch = float(result["aperture"].mean()), float(result["mismatch"])
    lift = sum(
        abs(float(result[f"tilt_{dim}"])) * float(np.ptp(result[dim].values)) / 2 for dim in ("x", "y")
    )
    lowest = -overlap * mismatch - lift - UNIFORM * float(np.abs(result["height"]).max())
    expected = (
        "an upper face above the lower one (swap lower and upper; if each was scanned with a zero of its "
        "own, raise upper by the aperture)"
    )
    require(not mean < lowest, "lower, upper", expected, Words(f"a mean aperture of {mean:.3g} m"))


def _dataset(lower: xr.DataArray, low: Array, moved: Array, pose: Pose, grid: Grid) -> xr.Dataset:
    aperture = moved - low
    common = np.isfinite(aperture)
    dy, dx = grid.spacing
    return xr.Dataset(
        {
            "height": (("y", "x"), moved),
            "aperture": (("y", "x"), aperture),
            "shift_x": pose.shift[1] * dx,
            "shift_y": pose.shift[0] * dy,
            "rotation": math.degrees(pose.angle),
            "tilt_x": pose.slope[1] / dx,
            "tilt_y": pose.slope[0] / dy,
            "shift_x_error": pose.errors[1] * dx,
            "shift_y_error": pose.errors[0] * dy,
            "rotation_error": math.degrees(pose.errors[2]),
            "mismatch": float(aperture[common].std()),
            "correlation": float(np.corrcoef(low[common], moved[common])[0, 1]),
            "common_fraction": float(common.mean()),
            "iterations": pose.iterations,
            "converged": pose.converged,
        },
        coords={"y": lower["y"].variable, "x": lower["x"].variable},
    )


@dataclass(frozen=True)
class Pose:
    """Shift (cells, y and x), angle (rad, anticlockwise), slope of the upper face (height per cell)."""

    shift: Pair = (0.0, 0.0)
    angle: float = 0.0
    slope: Pair = (0.0, 0.0)
    errors: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # of shift y, shift x, angle
    iterations: int = 0
    converged: bool = False
    determined: bool = True

    @property
    def error(self) -> float:
        """The greater standard error of the two shifts, cells."""
        return max(self.errors[:2])

    @property
    def is_certain(self) -> bool:
        """Whether the position is known to a point."""
        return self.determined and self.converged and self.error <= 1.0


def find_pose(
    lower: Array, upper: Array, offset: Pair, fitted: list[int], smoothing: Sequence[float] = (4.0, 2.0, 1.0)
) -> Pose:
    """Return the pose of the upper face.

    Parameters
    ----------
    lower, upper : ndarray, shapes (ny, nx), (my, mx)
        Heights, NaN where missing.
    offset : pair of float
        Place of the first point of `upper` on the grid of `lower`, in cells.
    fitted : list of int
        Which of shift y, shift x, angle, height and the two slopes are fitted.
    smoothing : sequence of float
        Widths of the means, in cells, but no more than a 16th of an edge: an eighth and a 32nd found the same
        places. The last one decides, and suppresses what lies between the points.
    """
    # no step depends on a constant height between the faces or on the unit of height
    lower, upper = lower - np.nanmean(lower), upper - np.nanmean(upper)
    largest = max(float(np.nanmax(np.abs(face))) for face in (lower, upper))
    if largest == 0:
        return Pose(determined=False)
    unit = power_of_two(largest)
    lower, upper = lower / unit, upper / unit
    widest = min(*lower.shape, *upper.shape) / 16.0
    pose = Pose(shift=coarse_shift(lower, upper, offset, widest))
    for width in smoothing:
        # near an edge the mean of fewer heights is noisier, and would pull the edges together; with .8 and
        # .99 16 pairs with noise had the same error within 5 %
        low, up = (smooth(face, min(width, widest), 0.95) for face in (lower, upper))
        pose = _refine(pose, low, up, offset, fitted)
        if not pose.determined:
            break
    return replace(pose, slope=(pose.slope[0] * unit, pose.slope[1] * unit))


def coarse_shift(lower: Array, upper: Array, offset: Pair, width: float, overlap: float = 0.3) -> Pair:
    """Return the shift of whole cells at which the faces, without their long waves, correlate most.

    At least the fraction `overlap` of them must do so; .15 and .6 found the same place.
    """
    from skimage.registration import phase_cross_correlation

    shape = tuple(max(a, b) for a, b in zip(lower.shape, upper.shape, strict=True))
    reliefs, masks = [], []
    for face in (lower, upper):
        observed = np.zeros(shape, bool)
        relief = np.zeros(shape)
        inside = tuple(slice(n) for n in face.shape)
        observed[inside] = np.isfinite(face)
        relief[inside] = np.where(np.isfinite(face), face - smooth(face, width), 0.0)
        reliefs.append(relief / (math.sqrt(float(np.mean(relief**2))) or 1.0))
        masks.append(observed)
    correlation = phase_cross_correlation(
        *reliefs, reference_mask=masks[0], moving_mask=masks[1], overlap_ratio=overlap
    )
    shift = np.asarray(correlation[0], dtype=float)
    # the correlation counts from the corners of the arrays
    return float(shift[0] - offset[0]), float(shift[1] - offset[1])


def smooth(face: Array, width: float, smallest_weight: float = 0.0) -> Array:
    """Return a Gaussian mean over the observed heights, NaN where the face is missing.

    It is NaN too where less than `smallest_weight` of the Gaussian was observed.
    """
    from scipy.ndimage import gaussian_filter

    observed = np.isfinite(face)
    weight = gaussian_filter(observed.astype(float), width, mode="constant")
    total = gaussian_filter(np.where(observed, face, 0.0), width, mode="constant")
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(observed & (weight >= smallest_weight), total / weight, np.nan)


def source_places(pose: Pose, shape: tuple[int, ...], offset: Pair) -> Array:
    """Return the place on `upper`, in cells, that lies at every point of `lower`, shape (2, ny, nx)."""
    y, x = _centred_indices(shape)
    y, x = y - pose.shift[0], x - pose.shift[1]
    cosine, sine = math.cos(pose.angle), math.sin(pose.angle)
    middle = (shape[0] - 1) / 2 - offset[0], (shape[1] - 1) / 2 - offset[1]
    return np.stack([cosine * y - sine * x + middle[0], sine * y + cosine * x + middle[1]])


def resample(face: Array, places: Array) -> Array:
    """Return heights at fractional places (cubic spline); NaN outside and next to missing heights."""
    from scipy.ndimage import distance_transform_edt, map_coordinates

    missing = ~np.isfinite(face)
    filled = face
    if missing.any():
        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        filled = face[tuple(nearest)]
    values = map_coordinates(filled, places, order=3, mode="nearest")
    missing_weight = map_coordinates(missing.astype(float), places, order=1, mode="nearest")
    # 1e-9 is rounding: 1e-12 gave the same bits
    last = np.array(face.shape)[:, None, None] - 1
    outside = ((places < -1e-9) | (places > last + 1e-9)).any(axis=0)
    return np.where(outside | (missing_weight > 1e-9), np.nan, values)


def _centred_indices(shape: tuple[int, ...]) -> tuple[Array, Array]:
    y, x = np.indices(shape, dtype=float)
    return y - (shape[0] - 1) / 2, x - (shape[1] - 1) / 2


def _refine(
    pose: Pose,
    lower: Array,
    upper: Array,
    offset: Pair,
    fitted: list[int],
    *,
    max_steps: int = 40,
    full_steps: int = 10,
    small_step: float = 1e-4,
    settled_step: float = 0.01,
) -> Pose:
    """Take Newton steps on the fitted ones of shift, angle, height and slope.

    Parameters
    ----------
    pose : Pose
        Where to start.
    lower, upper : ndarray
        Smoothed heights.
    offset, fitted
        As for `find_pose`.
    max_steps : int
        16 faces, half of them with noise, took 5 to 14 at all widths together.
    full_steps : int
        Of full length; damped ones after them end a cycle of the robust weights: of 120 pairs with noise and
        damage 84 converge, 74 without them. 5 and 20 gave the same.
    small_step : float
        In cells at the edge, that ends the iteration. 2e-4 moved faces with noise of .1 and 1 increment by up
        to .012 of the standard error, 5e-5 by .0007, with one or two iterations more.
    settled_step : float
        Over the standard errors, that ends it as well; .02 moved faces by .004 of the error.
    """
    gradients = np.gradient(lower), np.gradient(upper)
    edge = max(lower.shape) / 2
    first = pose.iterations + 1
    for iteration in range(first, first + max_steps):
        equations = _normal_equations(pose, lower, upper, gradients, offset, edge, fitted)
        solved = _newton_step(*equations, fitted)
        if solved is None:
            return replace(pose, determined=False)
        step, errors = solved
        step[:3] *= 1.0 if iteration - first < full_steps else 0.25  # .125 and .5 converged as well
        settled = np.abs(step[:3]).max() <= max(small_step, settled_step * float(np.nanmin(errors)))
        pose = Pose(
            shift=(pose.shift[0] + step[0], pose.shift[1] + step[1]),
            angle=pose.angle + step[2] / edge,
            slope=(step[4] / edge, step[5] / edge),
            errors=(errors[0], errors[1], errors[2] / edge),
            iterations=iteration,
            converged=bool(settled),
        )
        if settled:
            break
    return pose


def _normal_equations(
    pose: Pose,
    lower: Array,
    upper: Array,
    gradients: Any,
    offset: Pair,
    edge: float,
    fitted: list[int],
    side: int = 6,  # tiles along an edge; the standard errors change by .4 with 4 and by .15 with 9
) -> tuple[Array, Array, float]:
    """Return the equations for the step that brings the difference of the faces to zero, of every tile.

    They are weighted, of shapes (tiles, fitted, fitted) and (tiles, fitted). The last number corrects the
    standard errors for the robust weights, which change with the residuals.

    The gradients of the upper face share the noise of the difference, and least squares on them alone would
    be biased. They form the columns; the gradients of the lower face are the instruments that multiply them.
    """
    places = source_places(pose, lower.shape, offset)
    cosine, sine = math.cos(pose.angle), math.sin(pose.angle)
    gy, gx = (resample(part, places) for part in gradients[1])
    instruments = _columns(pose, gradients[0][0], gradients[0][1], edge)
    columns = _columns(pose, cosine * gy + sine * gx, cosine * gx - sine * gy, edge)
    difference = lower - resample(upper, places)
    observed = np.isfinite(difference + instruments[0] + instruments[1] + columns[0] + columns[1])
    instruments, columns, target = instruments[:, observed], columns[:, observed], difference[observed]
    weights, error_factor = _robust_weights(columns, target)
    rows_of, columns_of = (np.arange(n) * side // n for n in lower.shape)
    tile, tiles = (rows_of[:, None] * side + columns_of)[observed], side * side
    matrices, vectors = np.empty((tiles, len(fitted), len(fitted))), np.empty((tiles, len(fitted)))
    for i, instrument in enumerate(instruments[fitted]):
        weighted = instrument * weights
        vectors[:, i] = np.bincount(tile, weighted * target, tiles)
        for j, column in enumerate(columns[fitted]):
            matrices[:, i, j] = np.bincount(tile, weighted * column, tiles)
    return matrices, vectors, error_factor


def _columns(pose: Pose, gy: Array, gx: Array, edge: float) -> Array:
    """Return the derivatives of the moved heights by shift y, shift x, angle, height and the two slopes."""
    y, x = _centred_indices(gy.shape)
    by_angle = (gx * (y - pose.shift[0]) - gy * (x - pose.shift[1])) / edge
    return np.stack([-gy, -gx, by_angle, np.ones_like(y), y / edge, x / edge])


def _robust_weights(columns: Array, target: Array) -> tuple[Array, float]:
    """Return Cauchy weights, small where the faces differ by more than usual, and their error factor."""
    if target.size < columns.shape[0]:
        return np.zeros(target.size), 1.0
    plane = columns[3:]
    residual = target - np.linalg.lstsq(plane.T, target, rcond=None)[0] @ plane
    # standard deviation of a Gaussian, from its median absolute deviation
    deviation = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
    if deviation == 0:
        return np.ones(target.size), 1.0
    square = (residual / (2.385 * deviation)) ** 2  # 95 % efficient (Holland and Welsch 1977)
    weights = 1.0 / (1.0 + square)
    return weights, float(np.sum(weights) / np.sum((1.0 - square) * weights**2))


def _has_full_rank(matrix: Array, least: float = 1e-9) -> bool:
    """Return whether every parameter changes the match, by more than rounding; the shifts come first.

    The lesser of both shares is .04 on rough faces, 5e-7 on tilted ridges and 7e-17 on level ones.
    """
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    if not (scale > 0).all() or scale[:2].min() < least * scale[:2].max():  # relief along one axis alone
        return False
    return bool(np.linalg.svd(matrix / np.outer(scale, scale), compute_uv=False)[-1] > least)


def _newton_step(
    matrices: Array, vectors: Array, error_factor: float, fitted: list[int]
) -> tuple[Array, Array] | None:
    """Return the step, and standard errors of shift y, shift x and angle from leaving out one tile at a time.

    None where the tiles, or those without one of them, do not determine the position.
    """
    matrix, vector = matrices.sum(axis=0), vectors.sum(axis=0)
    if not _has_full_rank(matrix):
        return None
    observed = matrices.any(axis=(1, 2))
    others = (vector - vectors[observed])[..., None]
    try:
        estimates = np.linalg.solve(matrix - matrices[observed], others)[..., 0]
    except np.linalg.LinAlgError:
        return None
    step, errors = np.zeros(6), np.full(6, np.nan)
    step[fitted] = np.linalg.solve(matrix, vector)
    errors[fitted] = np.sqrt((len(estimates) - 1) * estimates.var(axis=0)) * error_factor
    return step, errors[:3]
