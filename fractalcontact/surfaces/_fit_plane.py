"""The best-fit plane of a cloud of points, and the rotation into it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import DECADES
from fractalcontact.base.numbers import Array, as_array
from fractalcontact.base.results import public_result
from fractalcontact.base.study import provenance_of
from fractalcontact.base.units import UNITS, in_metres
from fractalcontact.base.validation import NONE, Problems

PLANES = ("fit", "xy")
KEEP_FRAME = ("surfaces.fill", "surfaces.despike")  # functions whose result is in the plane of their surface


def check_points(problems: Problems) -> bool:
    """Check for coordinates of points, shape (n, 3) or (n, 2); rows with a missing number do not count."""
    values = point_array(problems.given.points)
    if values is None or values.ndim != 2 or values.shape[-1] not in (2, 3):
        problems.add("points", "real numbers of shape (n, 3), or (n, 2) for a profile")
        return False
    finite = values[np.isfinite(values).all(axis=1)]
    least = values.shape[1] + 1
    if not problems.require(len(finite) >= least, "points", f"at least {least} points", len(finite) or NONE):
        return False
    size = float(np.abs(finite).max())
    expected = f"coordinates of at most 1e+{DECADES}"
    return problems.require(size <= 10.0**DECADES, "points", expected, size)


def point_array(points: Any) -> Array | None:
    """Return coordinates as float64, masked ones as NaN; None if they are not real numbers."""
    if isinstance(points, xr.Dataset):
        points = points.get("position", np.empty(0))
    if as_array(points) is None:
        return None
    values = np.ma.asanyarray(points)
    if values.dtype.kind not in "fiu":
        return None
    return np.asarray(np.ma.filled(values.astype(np.float64), np.nan))


def finite_points(points: Any, units: str) -> Array:
    """Return valid points in metres without the rows that have a missing coordinate."""
    values = point_array(points)
    assert values is not None  # checked before
    metres = np.asarray(in_metres(values, units))
    return np.asarray(metres[np.isfinite(metres).all(axis=1)])


def check_frame(problems: Problems, axes: int | None = None) -> None:
    """Check for a word, a result of `fit_plane`, or a surface gridded in such a plane."""
    plane = problems.given.plane
    if isinstance(plane, (xr.Dataset, xr.DataArray)):
        frame = frame_of(plane)
        fits = frame is not None and (axes is None or axes == frame[1].size)
        expected = "a result of fractalcontact.surfaces.fit_plane, or a surface gridded above such a plane"
        problems.require(fits, "plane", f"{expected}, for points of as many coordinates")
    else:
        problems.choice("plane", among=PLANES, optional=True)


def frame_of(plane: xr.Dataset | xr.DataArray) -> tuple[Array, Array] | None:
    """Return rotation and centre of a plane, None if it has none."""
    is_fit = isinstance(plane, xr.Dataset) and {"rotation_matrix", "centre"} <= set(plane.data_vars)
    source: Any = plane if is_fit else provenance_of(plane)
    while isinstance(source, dict) and str(source.get("call", "")).endswith(KEEP_FRAME):
        source = source.get("parameters", {}).get("surface", {}).get("provenance", {})
    if isinstance(source, dict) and source.get("plane") == "xy" and isinstance(plane, xr.DataArray):
        axes = plane.ndim + 1
        return np.eye(axes), np.zeros(axes)
    if "rotation_matrix" not in source or "centre" not in source:
        return None
    rotation, centre = (np.asarray(source[name], dtype=np.float64) for name in ("rotation_matrix", "centre"))
    return (rotation, centre) if rotation.shape == (centre.size, centre.size) else None


def _check(problems: Problems) -> None:
    check_points(problems)
    problems.choice("units", among=UNITS)


@public_result(
    title="Best-fit plane of points",
    references="Pearson, On lines and planes of closest fit, Philosophical Magazine 2 (1901) 559-572",
    achieved_error="exact to rounding",
    check=_check,
)
def fit_plane(points: Any, *, units: str = "m") -> xr.Dataset:
    """Fit a plane to points by least squares of their distances from it.

    Parameters
    ----------
    points : array-like, shape (n, 3), or (n, 2) for a profile; or Dataset
        Coordinates, or a result of `read_points`. Rows with a missing one (NaN, masked) are left out.
    units : str
        Unit of the coordinates: "m", "mm", "um" ...

    Returns
    -------
    Dataset
        `rotation_matrix` with dims (plane_axis, point_axis), whose rows are unit vectors along x, y and the
        normal of the plane; `centre` (m), the mean of the points; `rms_height` (m), the root mean square
        distance from the plane; `point_count`. The position in the plane is
        ``rotation_matrix @ (point - centre)``.

    Raises
    ------
    InvalidInput
        Fewer than four points, all on one line, or as thick as they are wide.

    Notes
    -----
    The normal points towards the positive side of the axis nearest to it, and the rotation is the smallest
    that brings this axis there: of a nearly horizontal cloud, x and y stay nearly the same. Heights below
    the plane are negative. Of a wall with a normal along x or y, the rotated z axis lies in the plane.

    References
    ----------
    Pearson (1901), On lines and planes of closest fit, Philosophical Magazine 2.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    >>> wall = np.c_[x.ravel(), 0.75 * x.ravel(), y.ravel()]
    >>> plane = fc.surfaces.fit_plane(wall, units="mm")
    >>> plane.rotation_matrix.sel(plane_axis="normal").values.round(3).tolist()
    [-0.6, 0.8, 0.0]
    """
    values = finite_points(points, units)
    centre, rotation, spread = _plane_of(values)
    names = ("x", "y", "z") if values.shape[1] == 3 else ("x", "z")
    return xr.Dataset(
        {
            "rotation_matrix": (("plane_axis", "point_axis"), rotation),
            "centre": ("point_axis", centre),
            "rms_height": spread,
            "point_count": len(values),
        },
        coords={"plane_axis": [*names[:-1], "normal"], "point_axis": list(names)},
        attrs={} if isinstance(points, xr.Dataset) else {"parameters": {"points": list(np.shape(points))}},
    )


def _plane_of(points: Array) -> tuple[Array, Array, float]:
    """Return centre, rotation, and root mean square distance from the plane (line) of closest fit."""
    offset = points[0]
    centre = offset + (points - offset).mean(axis=0)
    centred = points - centre
    scale = float(np.abs(centred).max()) or 1.0
    centred /= scale
    variances, vectors = np.linalg.eigh(centred.T @ centred / len(points))
    sizes = np.sqrt(np.maximum(variances, 0.0))  # ascending: thickness, (width,) length
    _require_plane(sizes)
    axis = int(np.argmax(np.abs(vectors[:, 0])))
    normal = vectors[:, 0] * np.sign(vectors[axis, 0])
    distances = centred @ normal  # more accurate than the smallest variance
    return centre, _rotation_to(normal, axis), math.sqrt(float(np.mean(distances * distances))) * scale


def _require_plane(sizes: Array) -> None:
    collinear = 1e-7  # width over length of points on a line: rounding leaves 1.3e-8
    thickest = 0.7  # thickness over width; of 300 balls of 100 points 1 % have less than .77
    problem = ""
    if sizes[-1] == 0.0 or (sizes.size == 3 and sizes[1] <= collinear * sizes[-1]):
        problem = "points that span a plane, got points on one line or at one place"
    elif sizes[0] > thickest * sizes[1]:
        problem = (
            f"points about a plane, got a cloud {sizes[0] / sizes[1]:.2g} times as thick as it is wide: "
            "select one face of it first"
        )
    if problem:
        raise InvalidInput("", [f"points: expected {problem}"])


def _rotation_to(normal: Array, axis: int) -> Array:
    """Return the rotation whose last row is the normal, the smallest that turns `axis` into it.

    The other axes follow in their cyclic order, so that it stays a rotation: of a plane across x they are
    y and z.
    """
    n = normal.size
    if n == 2:
        along = np.array([normal[1], -normal[0]])
        return np.stack([along, normal])
    start = np.zeros(3)
    start[axis] = 1.0
    # Rodrigues: turns `start` into the normal about their common perpendicular
    cross, cosine = np.cross(start, normal), float(normal[axis])
    skew = np.array([[0.0, -cross[2], cross[1]], [cross[2], 0.0, -cross[0]], [-cross[1], cross[0], 0.0]])
    turn = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    others = [(axis + 1) % 3, (axis + 2) % 3]
    return np.stack([turn[:, others[0]], turn[:, others[1]], normal])
