"""Friction of a joint: the basic friction angle plus the dilatancy angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import drop_unknown_coords
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, float_array

Array = np.ndarray[Any, np.dtype[Any]]

REFERENCES = (
    "Patton, F. D., Multiple modes of shear failure in rock, 1st ISRM Congress, Lisbon (1966); "
    "Goodman, R. E., Introduction to Rock Mechanics, 2nd ed. (1989)"
)
LOCKED = (
    "NaN where the friction angle reaches 90 degrees: the faces are locked and cannot slide without damage"
)
ERROR = "that of the dilatancy"
# a window given as a decimal must not lose a point to rounding, nor one of two equally near points
WINDOW_ROUNDING = 1.0 + 1e-9


def _check(
    problems: Problems, *, dilatancy: Any, basic_friction_angle: Any, smoothing: Any, nominal_pressure: Any
) -> None:
    check_dilatancy(problems, dilatancy, basic_friction_angle, smoothing, nominal_pressure)


@public_result(title="friction of a joint", references=REFERENCES, achieved_error=ERROR, check=_check)
def friction(
    dilatancy: xr.Dataset,
    *,
    basic_friction_angle: float | None = None,
    smoothing: float | None = None,
    nominal_pressure: float | Sequence[float] | None = None,
) -> xr.Dataset:
    """Return friction angle and shear strength of a joint from its dilatancy.

    The dilatancy angle is i = atan(d delta/dv), the friction angle phi = phi_basic + i, and the shear
    strength under the nominal pressure sigma is sigma tan(phi).

    Parameters
    ----------
    dilatancy : Dataset
        From `fractalcontact.joints.dilatancy`, with at least two shears, ascending. The dilatancy under force
        is used if present, otherwise the rigid one.
    basic_friction_angle : float, optional
        Degree, 0 to 90; None: the one stored in `dilatancy`.
    smoothing : float, optional
        Length of shear (m) of a straight fit to the dilatancy around each shear. None: the slope through the
        neighbours. The angle depends on this length: compare only angles of equal `smoothing`.
    nominal_pressure : float or sequence of float, optional
        Pressures sigma (Pa) for the strength of rigid faces; dilatancy under force has its own.

    Returns
    -------
    Dataset
        dilatancy_angle, friction_angle (degree) over (direction, shear[, step]); with forces or pressures
        shear_strength (Pa), NaN with the `reason` where the friction angle reaches 90 degrees and the faces
        lock, negative where the block slides by itself. Over (direction[, step]): peak_friction_angle,
        peak_shear_strength and the shears of both. Also basic_friction_angle and, over shear, smoothing.

    Raises
    ------
    InvalidInput
        `dilatancy` is not the Dataset of `dilatancy`, has fewer than two shears, or an argument is wrong.

    References
    ----------
    Patton (1966), 1st ISRM Congress; Goodman (1989), Introduction to Rock Mechanics; Borri-Brunetto,
    Carpinteri and Chiaia (1998), FRAMCOS-3, section 4.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> slope = np.tan(np.radians(15)) * np.arange(40.0) * np.ones((6, 1))
    >>> surface = fc.surfaces.from_array(slope, 1.0)
    >>> crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    >>> climb = fc.joints.dilatancy(crack, shear=[0, 2, 4, 6], direction="E")
    >>> result = fc.joints.friction(climb, nominal_pressure=1e6)
    >>> result.peak_friction_angle.values.round(3).tolist()
    [45.0]
    >>> (result.peak_shear_strength / 1e6).values.round(3).tolist()
    [[1.0]]
    """
    name, shears = read_dilatancy(dilatancy)
    basic_angle = read_basic_angle(dilatancy, basic_friction_angle)
    heights = drop_unknown_coords(dilatancy[name]).drop_attrs().transpose("shear", ...)
    slopes, lengths = dilatancy_slopes(shears, heights.values.reshape(shears.size, -1), smoothing)
    angle = heights.copy(data=np.degrees(np.arctan(slopes)).reshape(heights.shape))
    angle = angle.transpose(*dilatancy[name].dims)
    result = xr.Dataset({"dilatancy_angle": angle, "friction_angle": angle + basic_angle})
    pressure = drop_unknown_coords(dilatancy["nominal_pressure"]) if name == "dilatancy" else None
    if nominal_pressure is not None:
        values = float_array(nominal_pressure)
        pressure = xr.DataArray(values, dims="step", coords={"step": np.arange(values.size)})
        result = result.assign_coords(nominal_pressure=pressure)
    _add_peaks(result, pressure)
    result["basic_friction_angle"], result["smoothing"] = basic_angle, ("shear", lengths)
    result = result.drop_attrs().assign_attrs(slope_of=name)  # of the shear under the name of a peak
    mark_locked(result, ("shear_strength", "peak_shear_strength", "peak_strength_shear"))
    return result


def _add_peaks(result: xr.Dataset, pressure: xr.DataArray | None) -> None:
    """Add the greatest angle and its shear; with pressures also strength, peak strength and its shear."""
    angle = result["friction_angle"]
    place = angle.fillna(-np.inf).argmax("shear")
    result["peak_friction_angle"] = angle.isel(shear=place).drop_vars("shear")
    result["peak_shear"] = result["shear"].isel(shear=place).drop_vars("shear")
    if pressure is None:
        return
    tangent = angle.copy(data=np.tan(np.radians(angle.where(angle < 90.0).values)))
    strength = (tangent * pressure).transpose(*[dim for dim in angle.dims if dim != "step"], "step")
    peak = strength.max("shear", skipna=False)
    place = strength.fillna(np.inf).argmax("shear")
    result["shear_strength"], result["peak_shear_strength"] = strength, peak
    peak_shear = result["shear"].isel(shear=place).drop_vars("shear")
    result["peak_strength_shear"] = peak_shear.where(peak.notnull())


def mark_locked(result: xr.Dataset, names: Sequence[str]) -> None:
    """Add the reason to the variables that are NaN where the faces lock."""
    for name in names:
        if name in result and bool(np.isnan(result[name].values).any()):
            result[name].attrs["reason"] = LOCKED


def check_dilatancy(
    problems: Problems, dilatancy: Any, basic_friction_angle: Any, smoothing: Any, nominal_pressure: Any
) -> bool:
    """Check the Dataset of `dilatancy` and the options that are common to friction and cyclic shear."""
    problems.number("smoothing", smoothing, above=0, optional=True)
    problems.numbers("nominal_pressure", nominal_pressure, at_least=0, optional=True)
    expected = "the Dataset of fractalcontact.joints.dilatancy"
    if not isinstance(dilatancy, xr.Dataset):
        problems.add("dilatancy", expected, type(dilatancy).__name__)
        return False
    name = _dilatancy_name(dilatancy)
    needed = [name, "shear"] + (["nominal_pressure"] if name == "dilatancy" else [])
    absent = [variable for variable in needed if variable not in dilatancy.variables]
    if absent or "shear" not in dilatancy[name].dims:
        problems.add("dilatancy", expected, f"no {', '.join(absent) or 'dim shear'}")
        return False
    if name == "dilatancy" and nominal_pressure is not None:
        expected = "None where the dilatancy is that under forces"
        problems.add("nominal_pressure", expected, nominal_pressure)
    basic_angle = _basic_angle(dilatancy, basic_friction_angle)
    problems.number("basic_friction_angle", basic_angle, at_least=0, below=90)
    shears = np.asarray(dilatancy["shear"].values, dtype=np.float64)
    ascending = shears.size > 1 and bool((np.diff(shears) > 0).all())
    return problems.require(ascending, "dilatancy.shear", "at least two shears, ascending", shears)


def read_dilatancy(dilatancy: xr.Dataset) -> tuple[str, Array]:
    """Return the name of the dilatancy to use (under force if present, otherwise rigid) and the shears."""
    return _dilatancy_name(dilatancy), np.asarray(dilatancy["shear"].values, dtype=np.float64)


def read_basic_angle(dilatancy: xr.Dataset, basic_friction_angle: float | None) -> float:
    """Return the given basic friction angle, or the one stored with the dilatancy."""
    return float(_basic_angle(dilatancy, basic_friction_angle))


def _dilatancy_name(dilatancy: xr.Dataset) -> str:
    return "dilatancy" if "dilatancy" in dilatancy else "rigid_dilatancy"


def _basic_angle(dilatancy: xr.Dataset, basic_friction_angle: Any) -> Any:
    value = basic_friction_angle
    if basic_friction_angle is None:
        value = dilatancy.get("basic_friction_angle")
    return value.item() if hasattr(value, "item") and getattr(value, "size", 0) == 1 else value


def dilatancy_slopes(shears: Array, curves: Array, smoothing: float | None) -> tuple[Array, Array]:
    """Return the slope of every curve at every shear, and the length of shear over which it was taken.

    Parameters
    ----------
    shears : ndarray, shape (n,)
        Ascending, n >= 2.
    curves : ndarray, shape (n, m)
        One curve in each column.
    smoothing : float, optional
        Width of the window of a straight fit. None: the slope through the neighbours.

    Returns
    -------
    slopes : ndarray, shape (n, m)
    lengths : ndarray, shape (n,)
    """
    if smoothing is None:
        return _neighbour_slopes(shears, curves)
    return _fitted_slopes(shears, curves, float(smoothing))


def _neighbour_slopes(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the slope through the neighbours of every point, and the length between them.

    Of second order inside, also for unequal steps; of first order at the ends.
    """
    ends = np.concatenate([x[:1], x, x[-1:]])
    return np.gradient(y, x, axis=0), ends[2:] - ends[:-2]


def _fitted_slopes(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Return the least-squares slope in a window around every point, and the length of each fit.

    A window without a second point is widened to the nearest one.
    """
    slopes, lengths = np.empty(y.shape), np.empty(x.shape)
    for index, centre in enumerate(x):
        distance = np.abs(x - centre)
        inside = distance <= WINDOW_ROUNDING * max(0.5 * window, np.sort(distance)[1])
        offset = x[inside] - x[inside].mean()
        slopes[index] = offset @ (y[inside] - y[index]) / (offset @ offset)
        lengths[index] = np.ptp(x[inside])
    return slopes, lengths
