"""Bringing two faces into mated position: shift, rotation and tilt that make them alike.

The upper face is turned by an angle about the centre of the lower one, shifted, and tilted:
moved(p) = upper(q) + slope . p with p = c + R (q - c) + shift, all lengths in cells, (y, x). A first guess
of the shift comes from the masked correlation of the faces without their long waves; Newton steps refine
it, on smoothed faces first. Places where the faces are damaged get little weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

SMOOTHING = (4.0, 2.0, 1.0)  # cells; the last one decides, and hides what lies between the points
OVERLAP = 0.3  # least part of the faces that must lie over each other
STEPS = 40
SMALL = 1e-4  # a step this small, in cells at the edge, ends the iteration
WHOLE = 10  # whole steps; shorter ones after them end a cycle of the weights
SETTLED = 0.01  # so does one that is this small beside the standard errors
TILES = 6  # along each axis, left out one by one for the standard errors
RANK = 1e-9  # relative; below it a shift or turn does not change the match


@dataclass(frozen=True)
class Pose:
    """Shift (cells, y and x), angle (rad, anticlockwise), slope of the upper face (height per cell)."""

    shift: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    errors: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # of shift y, shift x, angle
    iterations: int = 0
    converged: bool = False
    determined: bool = True


def mate(lower: Array, upper: Array, offset: tuple[float, float], rotates: bool, tilts: bool) -> Pose:
    """Return the pose of the upper face.

    Parameters
    ----------
    lower, upper : ndarray, shapes (ny, nx), (my, mx)
        Heights, NaN where missing.
    offset : pair of float
        Place of the first point of `upper` on the grid of `lower`, in cells.
    rotates, tilts : bool
        Whether a rotation and a tilt are looked for.
    """
    # a constant height between the faces, and the unit of height, change no step
    lower, upper = lower - np.nanmean(lower), upper - np.nanmean(upper)
    largest = max(float(np.nanmax(np.abs(face))) for face in (lower, upper))
    if largest == 0:
        return Pose(determined=False)
    unit = math.ldexp(1.0, math.frexp(largest)[1])
    lower, upper = lower / unit, upper / unit
    pose = Pose(shift=coarse_shift(lower, upper, offset))
    widest = min(*lower.shape, *upper.shape) / 16.0
    for width in SMOOTHING:
        # near an edge the mean of fewer heights is noisier, and would draw the edges together
        low, up = (smoothed(face, min(width, widest), 0.95) for face in (lower, upper))
        pose = _refined(pose, low, up, offset, rotates, tilts)
        if not pose.determined:
            break
    return replace(pose, slope=(pose.slope[0] * unit, pose.slope[1] * unit))


def coarse_shift(lower: Array, upper: Array, offset: tuple[float, float]) -> tuple[float, float]:
    """Return the shift of whole cells at which the faces, without their long waves, correlate most."""
    from skimage.registration import phase_cross_correlation

    width = max(min(*lower.shape, *upper.shape) / 16.0, 1.0)
    shape = tuple(max(a, b) for a, b in zip(lower.shape, upper.shape, strict=True))
    planes, masks = [], []
    for face in (lower, upper):
        seen = np.zeros(shape, bool)
        plane = np.zeros(shape)
        inside = tuple(slice(n) for n in face.shape)
        seen[inside] = np.isfinite(face)
        plane[inside] = np.where(np.isfinite(face), face - smoothed(face, width), 0.0)
        planes.append(plane / (math.sqrt(float(np.mean(plane**2))) or 1.0))
        masks.append(seen)
    found = phase_cross_correlation(
        *planes, reference_mask=masks[0], moving_mask=masks[1], overlap_ratio=OVERLAP
    )
    shift = np.asarray(found[0], dtype=float)
    # the correlation counts from the corners of the arrays
    return float(shift[0] - offset[0]), float(shift[1] - offset[1])


def smoothed(face: Array, width: float, least: float = 0.0) -> Array:
    """Return a Gaussian mean over the seen heights; NaN stays where it was.

    Where less than the part `least` of the Gaussian was seen the mean is NaN too.
    """
    from scipy.ndimage import gaussian_filter

    seen = np.isfinite(face)
    weight = gaussian_filter(seen.astype(float), width, mode="constant")
    total = gaussian_filter(np.where(seen, face, 0.0), width, mode="constant")
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(seen & (weight >= least), total / weight, np.nan)


def sources(pose: Pose, shape: tuple[int, ...], offset: tuple[float, float]) -> Array:
    """Return where on `upper` every point of `lower` is read, in cells, shape (2, ny, nx)."""
    y, x = _centred(shape)
    y, x = y - pose.shift[0], x - pose.shift[1]
    cosine, sine = math.cos(pose.angle), math.sin(pose.angle)
    middle = (shape[0] - 1) / 2 - offset[0], (shape[1] - 1) / 2 - offset[1]
    return np.stack([cosine * y - sine * x + middle[0], sine * y + cosine * x + middle[1]])


def resampled(face: Array, places: Array) -> Array:
    """Return heights at fractional places (cubic spline); NaN outside and next to missing heights."""
    from scipy.ndimage import distance_transform_edt, map_coordinates

    missing = ~np.isfinite(face)
    filled = face
    if missing.any():
        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        filled = face[tuple(nearest)]
    values = map_coordinates(filled, places, order=3, mode="nearest")
    blurred = map_coordinates(missing.astype(float), places, order=1, mode="nearest")
    last = np.array(face.shape)[:, None, None] - 1
    outside = ((places < -1e-9) | (places > last + 1e-9)).any(axis=0)
    return np.where(outside | (blurred > 1e-9), np.nan, values)


def _centred(shape: tuple[int, ...]) -> tuple[Array, Array]:
    y, x = np.indices(shape, dtype=float)
    return y - (shape[0] - 1) / 2, x - (shape[1] - 1) / 2


def _refined(
    pose: Pose, lower: Array, upper: Array, offset: tuple[float, float], rotates: bool, tilts: bool
) -> Pose:
    """Newton steps on shift, angle, height and slope; angle and slope only where asked for."""
    gradients = np.gradient(lower), np.gradient(upper)
    edge = max(lower.shape) / 2
    used = [0, 1] + ([2] if rotates else []) + [3] + ([4, 5] if tilts else [])
    before = pose.iterations
    for iteration in range(before + 1, before + STEPS + 1):
        system = _equations(pose, lower, upper, gradients, offset, edge)
        matrix = system.matrices.sum(axis=0)[np.ix_(used, used)]
        if not _determined(matrix):
            return replace(pose, determined=False)
        step = np.zeros(6)
        step[used] = np.linalg.solve(matrix, system.vectors.sum(axis=0)[used])
        step[:3] *= 1.0 if iteration - before <= WHOLE else 0.25
        try:
            errors = _jackknife(system, used)
        except np.linalg.LinAlgError:  # one tile alone fixes the position
            return replace(pose, determined=False)
        settled = np.abs(step[:3]).max() <= max(SMALL, SETTLED * float(np.nanmin(errors)))
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


@dataclass(frozen=True)
class System:
    """Weighted equations of every tile, (tiles, 6, 6) and (tiles, 6).

    `yielding` is by how much less the robust equations resist a change than their weights suggest.
    """

    matrices: Array
    vectors: Array
    yielding: float


def _equations(
    pose: Pose, lower: Array, upper: Array, gradients: Any, offset: tuple[float, float], edge: float
) -> System:
    """Return the equations: what the slopes of the lower face see of the difference of the faces.

    The slopes of the upper face are noisy where the difference is, and would bias it; those of the lower
    face ask, and those of the upper face answer.
    """
    places = sources(pose, lower.shape, offset)
    cosine, sine = math.cos(pose.angle), math.sin(pose.angle)
    gy, gx = (resampled(part, places) for part in gradients[1])
    asking = _columns(pose, gradients[0][0], gradients[0][1], edge)
    answering = _columns(pose, cosine * gy + sine * gx, cosine * gx - sine * gy, edge)
    difference = lower - resampled(upper, places)
    seen = np.isfinite(difference + asking[0] + asking[1] + answering[0] + answering[1])
    asking, answering, target = asking[:, seen], answering[:, seen], difference[seen]
    weights, yielding = _weights(answering, target)
    tile = _tiles(lower.shape)[seen]
    matrices, vectors = np.empty((TILES * TILES, 6, 6)), np.empty((TILES * TILES, 6))
    for i, column in enumerate(asking):
        weighted = column * weights
        vectors[:, i] = np.bincount(tile, weighted * target, TILES * TILES)
        for j, other in enumerate(answering):
            matrices[:, i, j] = np.bincount(tile, weighted * other, TILES * TILES)
    return System(matrices, vectors, yielding)


def _columns(pose: Pose, gy: Array, gx: Array, edge: float) -> Array:
    """Return how a height of the moved face changes with shift y, shift x, turn, height and slope."""
    y, x = _centred(gy.shape)
    turn = (gx * (y - pose.shift[0]) - gy * (x - pose.shift[1])) / edge
    return np.stack([-gy, -gx, turn, np.ones_like(y), y / edge, x / edge])


def _weights(columns: Array, target: Array) -> tuple[Array, float]:
    """Return weights that fall where the faces differ by more than usual (Cauchy), and what they yield."""
    if target.size < columns.shape[0]:
        return np.zeros(target.size), 1.0
    plane = columns[3:]
    flat = target - np.linalg.lstsq(plane.T, target, rcond=None)[0] @ plane
    usual = 1.4826 * float(np.median(np.abs(flat - np.median(flat))))
    if usual == 0:
        return np.ones(target.size), 1.0
    square = (flat / (2.385 * usual)) ** 2
    weights = 1.0 / (1.0 + square)
    return weights, float(np.sum(weights) / np.sum((1.0 - square) * weights**2))


def _tiles(shape: tuple[int, ...]) -> Array:
    rows, columns = (np.arange(n) * TILES // n for n in shape)
    return np.asarray(rows[:, None] * TILES + columns[None, :])


def _determined(matrix: Array) -> bool:
    """Say whether every parameter changes the match."""
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    if not (scale > 0).all():
        return False
    return bool(np.linalg.svd(matrix / np.outer(scale, scale), compute_uv=False)[-1] > RANK)


def _jackknife(system: System, used: list[int]) -> Array:
    """Return the standard errors of shift y, shift x and turn, from leaving out one tile after the other."""
    whole = np.ix_(used, used)
    matrix, vector = system.matrices.sum(axis=0), system.vectors.sum(axis=0)
    estimates = np.array(
        [
            np.linalg.solve((matrix - one)[whole], (vector - part)[used])
            for one, part in zip(system.matrices, system.vectors, strict=True)
            if one.any()
        ]
    )
    errors = np.full(6, np.nan)
    errors[used] = np.sqrt((len(estimates) - 1) * estimates.var(axis=0)) * system.yielding
    return errors[:3]
