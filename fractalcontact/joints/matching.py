"""Two measured faces brought into mated position."""

from __future__ import annotations

import math
import time
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import ConvergenceWarning, InvalidInput
from fractalcontact.base.grid import UNIFORM, Grid, check_surface
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints._mating import Pose

WHERE = "fractalcontact.joints.register"
SMALLEST = 16  # points along an axis
UNCERTAIN = 1.0  # cells of standard error beyond which a position is hardly one
Array = np.ndarray[Any, np.dtype[Any]]


def register(
    lower: xr.DataArray, upper: xr.DataArray, *, rotation: bool = True, tilt: bool = True
) -> xr.Dataset:
    """Bring the upper of two measured faces into mated position over the lower one.

    The upper face is shifted, turned about the middle of the lower face and tilted until the aperture varies
    as little as it can; then it is read on the grid of the lower face. The mean aperture is left as it was
    measured, for only the measurement knows it.

    Parameters
    ----------
    lower, upper : DataArray, shape (y, x)
        Heights (m) of two facing faces, both up positive and seen from above: scan the upper body from below
        and its face must be mirrored and turned over first. Equal spacing; the extents may differ. Missing
        heights (NaN) are allowed.
    rotation, tilt : bool
        Whether the face may be turned and tilted.

    Returns
    -------
    Dataset
        height (y, x): the upper face in mated position on the grid of `lower`, NaN where it was not seen, to
        be given to `Crack`; aperture (y, x) = height - lower; shift_x, shift_y (m), rotation (degree,
        anticlockwise), tilt_x, tilt_y (slopes): what was done to the upper face; shift_x_error,
        shift_y_error, rotation_error: standard errors from leaving out one tile of 6 x 6 after the other;
        mismatch (m, standard deviation of the aperture), correlation (of the facing heights),
        common_fraction, iterations, converged, run_time (s).

    Raises
    ------
    InvalidInput
        The faces are not on grids of equal spacing, have fewer than 16 points along an axis, lie nowhere
        over each other, or have no relief that could fix their position; or they are turned too far
        for the first guess, more than about 5 degrees.

    Warns
    -----
    ConvergenceWarning
        The position was still moving after the last step, or its standard error exceeds one point: the faces
        may not belong together.

    Notes
    -----
    The first guess is the best correlation over all shifts of whole cells, of the faces without their long
    waves, and allows rotations of a few degrees. Least squares with weights that fall where the faces are
    damaged refine it, on faces smoothed over 4, 2 and 1 cells. Reading the face between its points smooths
    it a little (cubic spline).

    References
    ----------
    Padfield (2012), IEEE Trans. Image Process. 21:2706 (masked correlation).
    """
    from fractalcontact.joints._mating import mate, resampled, sources

    with Problems(WHERE) as problems:
        grid, offset = _check_faces(lower, upper, problems)
        for name, value in (("rotation", rotation), ("tilt", tilt)):
            problems.require(isinstance(value, (bool, np.bool_)), name, "True or False", value)
    begun = time.perf_counter()
    low, up = (np.asarray(face.values, dtype=np.float64) for face in (lower, upper))
    # angles are those of the plane only where its cells are square
    ratio = grid.spacing[0] / grid.spacing[1]
    if rotation and abs(ratio - 1.0) > UNIFORM:
        raise InvalidInput(
            WHERE, [f"rotation: expected False where spacings differ, got a ratio of {ratio:g}"]
        )
    pose = mate(low, up, offset, rotation, tilt)
    if not pose.determined:
        expected = (
            "faces with relief along both axes that lie over each other, turned by a few degrees at most"
        )
        raise InvalidInput(WHERE, [f"lower, upper: expected {expected}, got nothing that fixes the position"])
    moved = resampled(up, sources(pose, low.shape, offset))
    moved += _tilted(pose, np.isfinite(moved - low))
    if not pose.converged:
        warnings.warn(
            f"{WHERE}: not converged after {pose.iterations} steps", ConvergenceWarning, stacklevel=2
        )
    error = max(pose.errors[:2])
    if error > UNCERTAIN:
        warnings.warn(
            f"{WHERE}: position not determined, only to {error:.2g} points: do the faces belong together, "
            "turned by a few degrees at most?",
            ConvergenceWarning,
            stacklevel=2,
        )
    result = _dataset(lower, low, moved, pose, grid).assign(run_time=time.perf_counter() - begun)
    parameters = {"lower": lower, "upper": upper, "rotation": rotation, "tilt": tilt}
    references = "Padfield, D., Masked object registration in the Fourier domain, IEEE TIP 21 (2012)"
    return stamp(label(result), WHERE, parameters, title="two faces in mated position", references=references)


def _tilted(pose: Pose, common: Array) -> Array:
    """Return the plane of the tilt, with mean zero over the common part."""
    y, x = np.indices(common.shape, dtype=float)
    plane = pose.slope[0] * y + pose.slope[1] * x
    return np.asarray(plane - plane[common].mean())


def _dataset(lower: xr.DataArray, low: Array, moved: Array, pose: Pose, grid: Grid) -> xr.Dataset:
    import xarray as xr

    aperture = moved - low
    common = np.isfinite(aperture)
    dy, dx = grid.spacing
    plane = ("y", "x")
    return xr.Dataset(
        {
            "height": (plane, moved),
            "aperture": (plane, aperture),
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


def _check_faces(lower: Any, upper: Any, problems: Problems) -> tuple[Grid, tuple[float, float]]:
    """Return the grid of the lower face, and where the upper one starts on it, in cells."""
    grid = check_surface(lower, problems, "lower", finite=False, smallest=SMALLEST)
    other = check_surface(upper, problems, "upper", finite=False, smallest=SMALLEST)
    if problems.found:
        return grid, (0.0, 0.0)
    starts = []
    for axis, name in enumerate(("y", "x")):
        step, own = grid.spacing[axis], other.spacing[axis]
        if abs(own - step) * other.shape[axis] > UNIFORM * step * 100:
            problems.add(f"upper.{name}", f"the spacing of lower, {step:g} m", f"{own:g} m")
        starts.append(float(upper[name].values[0] - lower[name].values[0]) / step)
    for argument, face in (("lower", lower), ("upper", upper)):
        values = np.asarray(face.values, dtype=np.float64)
        problems.require(not np.isinf(values).any(), argument, "no infinite heights", "some")
        problems.require(bool(np.isfinite(values).any()), argument, "heights", "none")
    return grid, (starts[0], starts[1])
