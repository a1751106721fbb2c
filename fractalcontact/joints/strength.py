"""Friction of a joint: the basic angle plus the angle at which the block climbs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import familiar
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._slopes import fitted_slopes, neighbour_slopes

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.friction"
REFERENCES = (
    "Patton, F. D., Multiple modes of shear failure in rock, 1st ISRM Congress, Lisbon (1966); "
    "Goodman, R. E., Introduction to Rock Mechanics, 2nd ed. (1989)"
)
LOCKED = (
    "NaN where the friction angle reaches 90 degrees: the faces are locked and cannot slide without damage"
)


@accounted("that of the dilatancy")
def friction(
    dilatancy: xr.Dataset,
    *,
    basic_friction_angle: float | None = None,
    smoothing: float | None = None,
    nominal_pressure: float | Sequence[float] | None = None,
) -> xr.Dataset:
    """Return friction angle and shear strength from the dilatancy.

    The dilatancy angle is i = atan(d delta/dv), the friction angle phi = phi_basic + i, and the shear
    strength under the nominal pressure sigma is sigma tan(phi).

    Parameters
    ----------
    dilatancy : Dataset
        As `fractalcontact.joints.dilatancy` gives it, with at least two shears, ascending. The dilatancy
        under force is used where it is there, else the rigid one.
    basic_friction_angle : float, optional
        Degree, 0 to 90; None: the one that `dilatancy` carries.
    smoothing : float, optional
        Length of shear (m) over which a straight line is fitted to the dilatancy around each shear; near the
        ends of the path the window is cut. None: the slope through the two neighbours of each shear. The
        angle depends on this length, as the slope of any fractal curve does, so the length in use is kept
        in the result over `shear`: compare only angles of equal `smoothing`.
    nominal_pressure : float or sequence of float, optional
        Pressures sigma (Pa) for the strength of rigid faces; dilatancy under force carries its own.

    Returns
    -------
    Dataset
        dilatancy_angle, friction_angle (degree) over (direction, shear), and over step where forces were
        given; with forces or pressures also shear_strength (Pa) over (direction, shear, step), NaN with the
        `reason` where the friction angle reaches 90 degrees and the faces lock. It is negative where the
        block would slide down by itself. Over (direction[, step]): peak_friction_angle and peak_shear (where
        it is met); peak_shear_strength and peak_strength_shear, NaN where the faces lock somewhere. Also
        basic_friction_angle and, over shear, smoothing.

    Raises
    ------
    InvalidInput
        The Dataset is of another kind, has fewer than two shears, or an argument is wrong.

    References
    ----------
    Patton (1966), 1st ISRM Congress; Goodman (1989), Introduction to Rock Mechanics; Borri-Brunetto,
    Carpinteri and Chiaia (1998), FRAMCOS-3, section 4.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        name, shears = check_dilatancy(dilatancy, problems)
        basic = 0.0 if problems.found else basic_angle(dilatancy, basic_friction_angle, problems)
        values = check_options(name, smoothing, nominal_pressure, problems)
    heights = familiar(dilatancy[name]).transpose("shear", ...)
    curves = heights.values.reshape(shears.size, -1)
    slopes, lengths = (
        neighbour_slopes(shears, curves)
        if smoothing is None
        else fitted_slopes(shears, curves, float(smoothing))
    )
    angle = heights.copy(data=np.degrees(np.arctan(slopes)).reshape(heights.shape))
    angle = angle.transpose(*dilatancy[name].dims)
    total = angle + basic
    result = xr.Dataset({"dilatancy_angle": angle, "friction_angle": total})
    pressure = familiar(dilatancy["nominal_pressure"]) if name == "dilatancy" else None
    if values is not None:
        pressure = xr.DataArray(values, dims="step", coords={"step": np.arange(values.size)})
        result = result.assign_coords(nominal_pressure=pressure)
    _add_peaks(result, pressure)
    result["basic_friction_angle"], result["smoothing"] = basic, ("shear", lengths)
    parameters = {
        "dilatancy": dilatancy,
        "basic_friction_angle": basic_friction_angle,
        "smoothing": smoothing,
        "nominal_pressure": nominal_pressure,
    }
    result = stamp(
        label(result), WHERE, parameters, title="friction of a joint", references=REFERENCES, slope_of=name
    )
    for variable in ("shear_strength", "peak_shear_strength", "peak_strength_shear"):
        if variable in result and bool(np.isnan(result[variable].values).any()):
            result[variable].attrs["reason"] = LOCKED
    return result


def _add_peaks(result: xr.Dataset, pressure: xr.DataArray | None) -> None:
    """Add the greatest angle along the shear and where it is met; with pressures the same of the strength."""
    total = result["friction_angle"]
    place = total.fillna(-np.inf).argmax("shear")
    result["peak_friction_angle"] = total.isel(shear=place).drop_vars("shear")
    result["peak_shear"] = result["shear"].isel(shear=place).drop_vars("shear")
    if pressure is None:
        return
    tangent = total.copy(data=np.tan(np.radians(total.where(total < 90.0).values)))
    strength = (tangent * pressure).transpose(*[dim for dim in total.dims if dim != "step"], "step")
    peak = strength.max("shear", skipna=False)
    place = strength.fillna(np.inf).argmax("shear")
    result["shear_strength"], result["peak_shear_strength"] = strength, peak
    where = result["shear"].isel(shear=place).drop_vars("shear")
    result["peak_strength_shear"] = where.where(peak.notnull())


def check_dilatancy(dilatancy: Any, problems: Problems) -> tuple[str, np.ndarray]:
    """Return the name of the dilatancy to be used, that under force before the rigid one, and the shears."""
    import xarray as xr

    expected = "the Dataset of fractalcontact.joints.dilatancy"
    if not isinstance(dilatancy, xr.Dataset):
        problems.add("dilatancy", expected, type(dilatancy).__name__)
        return "", np.arange(2.0)
    name = "dilatancy" if "dilatancy" in dilatancy else "rigid_dilatancy"
    needed = [name, "shear"] + (["nominal_pressure"] if name == "dilatancy" else [])
    absent = [word for word in needed if word not in dilatancy.variables]
    if absent or "shear" not in dilatancy[name].dims:
        problems.add("dilatancy", expected, f"no {', '.join(absent) or 'dim shear'}")
        return "", np.arange(2.0)
    shears = np.asarray(dilatancy["shear"].values, dtype=np.float64)
    if shears.size < 2 or not (np.diff(shears) > 0).all():
        problems.add("dilatancy.shear", "at least two shears, ascending", shears)
    return name, shears


def check_options(name: str, smoothing: Any, nominal_pressure: Any, problems: Problems) -> np.ndarray | None:
    """Check the smoothing, and return the pressures that are given for rigid faces."""
    if smoothing is not None:
        problems.number("smoothing", smoothing, above=0)
    if nominal_pressure is None:
        return None
    expected = "None where the dilatancy is that under forces"
    problems.require(name != "dilatancy", "nominal_pressure", expected, nominal_pressure)
    return problems.numbers("nominal_pressure", nominal_pressure, at_least=0)


def basic_angle(dilatancy: xr.Dataset, given: Any, problems: Problems) -> float:
    """Return the basic friction angle that is given, else the one that the dilatancy carries."""
    value: Any = dilatancy.get("basic_friction_angle") if given is None else given
    plain = value.item() if hasattr(value, "item") and getattr(value, "size", 0) == 1 else value
    return problems.number("basic_friction_angle", plain, at_least=0, below=90)
