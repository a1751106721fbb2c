"""Friction of a joint: the basic friction angle plus the angle at which the faces climb."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.labelled import drop_unknown_coords
from fractalcontact.base.numbers import ROUNDED, Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import Problems

REFERENCES = (
    "Patton, F. D., Multiple modes of shear failure in rock, 1st ISRM Congress, Lisbon (1966); "
    "Goodman, R. E., Introduction to Rock Mechanics, 2nd ed. (1989)"
)
FORMS = {
    "kinematic": "basic friction angle plus atan(d delta/dv)",
    "energy": "basic friction angle plus atan(d delta/dv + (1/N) dU/dv)",
}

LOCKED = (
    "NaN where the friction angle reaches 90 degrees: the faces are locked and cannot slide without damage"
)
UNRESOLVED = "NaN where the shears do not resolve the distance: a step of shear is longer, or it exceeds them"
PEAKS = ("peak_friction_angle", "peak_shear_strength", "secant_friction_angle", "secant_shear_strength")
PEAK_SHEARS = ("peak_shear", "peak_strength_shear")
NOT_KNOWN = (
    "depends on the distance in a way that is not known: half of it is not resolved, or the faces lock"
)
ENERGIES = ["normal_force", "bulk_closure", "elastic_energy"]
PEAK_SHARE = 0.01  # shear at peak strength over the length of a joint, commonly (Barton and Choubey 1977)


def _check(problems: Problems) -> None:
    given = problems.given
    is_form = problems.choice("form", among=FORMS)
    problems.number("smoothing", above=0, optional=True)
    bounded = problems.number("distance", above=0, optional=True)
    problems.numbers("nominal_pressure", at_least=0, optional=True)
    problems.number("basic_friction_angle", at_least=0, below=90, optional=True)
    if not problems.result("dilatancy"):
        return
    expected = "the Dataset of fractalcontact.joints.dilatancy"
    name = _dilatancy_name(given.dilatancy)
    needed = [name, "shear"] + (["nominal_pressure"] if name == "dilatancy" else [])
    if is_form and given.form == "energy":
        expected_form = "'kinematic' for a dilatancy without forces, and where faces yield"
        is_elastic = name == "dilatancy" and "plastic_work" not in given.dilatancy
        problems.require(is_elastic, "form", expected_form)
        needed += ENERGIES if is_elastic else []
    absent = [variable for variable in needed if variable not in given.dilatancy.variables]
    if absent or "shear" not in given.dilatancy[name].dims:
        problems.add("dilatancy", expected, f"no {', '.join(absent) or 'dim shear'}")
        return
    if name == "dilatancy":
        expected = "None where the dilatancy is that under forces"
        problems.require(given.nominal_pressure is None, "nominal_pressure", expected)
    basic_angle = _basic_angle(given.dilatancy, given.basic_friction_angle)
    problems.number("basic_friction_angle", basic_angle, at_least=0, below=90)
    shears = _shears(given.dilatancy)
    ascending = shears.size > 1 and bool((np.diff(shears) > 0).all())
    if problems.require(ascending, "dilatancy.shear", "at least two shears, ascending", shears):
        reach = float(np.ptp(shears))
        short = not bounded or given.distance is None or float(given.distance) <= reach * ROUNDED
        problems.require(short, "distance", f"at most the {reach:g} m that the shears cover")


@public_result(
    title="friction of a joint",
    references=REFERENCES,
    achieved_error="that of the dilatancy",
    reasons={"shear_strength": LOCKED},
    check=_check,
)
def friction(
    dilatancy: xr.Dataset,
    *,
    basic_friction_angle: float | None = None,
    form: str = "kinematic",
    smoothing: float | None = None,
    distance: float | None = None,
    nominal_pressure: float | Sequence[float] | None = None,
) -> xr.Dataset:
    """Return friction angle and shear strength of a joint from its dilatancy.

    The dilatancy angle is i = atan(d delta/dv), the friction angle phi = phi_basic + i, and the shear
    strength under the nominal pressure sigma is sigma tan(phi). The peak is taken over a stated distance.

    Parameters
    ----------
    dilatancy : Dataset
        From `fractalcontact.joints.dilatancy`, with at least two shears, ascending. The dilatancy under force
        is used if present, otherwise the rigid one.
    basic_friction_angle : float, optional
        Degree, 0 to 90; None: the one stored in `dilatancy`.
    form : {"kinematic", "energy"}
        "energy": i = atan(T/N) with the horizontal force T of faces without friction; for elastic faces.
    smoothing : float, optional
        Length of shear (m) of a straight fit to the dilatancy around each shear. None: the slope through the
        neighbours. The angle depends on this length: compare only angles of equal `smoothing`.
    distance : float, optional
        Shear (m) over which the peak is the mean: the secant from v to v + distance. None: 1 % of the side of
        the block, but at least two steps of shear (median), and at most all of it.
    nominal_pressure : float or sequence of float, optional
        Pressures sigma (Pa) for the strength of rigid faces; dilatancy under force has its own.

    Returns
    -------
    Dataset
        dilatancy_angle, friction_angle (degree) over (direction, shear[, step]), with "energy" also
        frictionless_angle, atan(T/N); with forces or pressures shear_strength (Pa), negative where the block
        slides by itself. Over (direction[, step]): peak_friction_angle, peak_shear_strength, and the shears v
        of both, peak_shear and peak_strength_shear (m); peak_distance (m). secant_friction_angle and
        secant_shear_strength over `distance`: the peaks over this distance halved and doubled, as far as the
        shears resolve. Strengths and peaks are NaN with the `reason` where the faces lock. Also
        basic_friction_angle and, over shear, smoothing.

    Raises
    ------
    InvalidInput
        `dilatancy` is not the Dataset of `dilatancy`, has fewer than two shears, or an argument is wrong.

    Notes
    -----
    The kinematic form is that of the paper. It neglects the elastic energy U stored in the faces while they
    slide: T = N d delta/dv + dU/dv. Mated fractal faces have no peak of their own: it grows as the distance
    gets shorter, and `comment` of the peak states by how much.

    References
    ----------
    Patton (1966), 1st ISRM Congress; Goodman (1989), Introduction to Rock Mechanics; Borri-Brunetto,
    Carpinteri and Chiaia (1998), FRAMCOS-3, section 4; Barton and Choubey (1977), Rock Mechanics 10:1.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> slope = np.tan(np.radians(15)) * np.arange(40.0) * np.ones((6, 1))
    >>> surface = fc.surfaces.from_array(slope, 1.0)
    >>> crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    >>> climb = fc.joints.dilatancy(crack, shear=[0, 2, 4, 6], direction="E")
    >>> result = fc.joints.friction(climb, nominal_pressure=1e6)
    >>> result.peak_friction_angle.values.round(3).tolist(), float(result.peak_distance)
    ([45.0], 4.0)
    >>> (result.peak_shear_strength / 1e6).values.round(3).tolist()
    [[1.0]]
    """
    name, shears = _dilatancy_name(dilatancy), _shears(dilatancy)
    basic_angle = float(_basic_angle(dilatancy, basic_friction_angle))
    curve = drop_unknown_coords(dilatancy[name]).drop_attrs()
    opening = curve.transpose("shear", ...)
    lift = opening.copy(data=work_per_force(dilatancy, opening, form))
    result = xr.Dataset({"dilatancy_angle": _angle(opening, smoothing)})
    if form == "energy":
        result["frictionless_angle"] = _angle(lift, smoothing)
    result["friction_angle"] = _angle(lift, smoothing) + basic_angle
    pressure = None
    if name == "dilatancy":
        pressure = drop_unknown_coords(dilatancy["nominal_pressure"]).drop_attrs()
    if nominal_pressure is not None:
        values = float_array(nominal_pressure)
        pressure = xr.DataArray(values, dims="step", coords={"step": np.arange(values.size)})
        result = result.assign_coords(nominal_pressure=pressure)
    if pressure is not None:
        result["shear_strength"] = _strength(result["friction_angle"], pressure)
    length = default_distance(dilatancy, shears) if distance is None else float(distance)
    secants = _secant_angles(lift, length) + basic_angle
    result = result.assign(_peaks(secants, pressure, length).data_vars)
    _, lengths = dilatancy_slopes(shears, np.zeros((shears.size, 1)), smoothing)
    result["basic_friction_angle"], result["smoothing"] = basic_angle, ("shear", lengths)
    place = curve.dims.index("shear")
    order = (*curve.dims[:place], "distance", *curve.dims[place:])
    result = result.transpose(*order, ..., missing_dims="ignore").assign_attrs(slope_of=name)
    result["friction_angle"].attrs["comment"] = FORMS[form]
    _explain(result, secants)
    return result


def work_per_force(dilatancy: xr.Dataset, opening: xr.DataArray, form: str) -> Array:
    """Return the curve (m) whose slope is T/N, the tangent of the angle at which the faces climb.

    That is the dilatancy, or in the energy form the work of the horizontal force T of faces without friction
    per normal force N, since the first shear. From T dv = N dz + dU, with z the height of the upper body,
    follows d delta + dU/N for a constant N. If N varies (a spring), the flat block alone has the closure w_b
    = N/k and the energy N w_b/2, and N dw_b = d(N w_b/2): both parts of the block are left out.
    """
    curve = np.asarray(opening.values, dtype=np.float64)
    if form == "kinematic":
        return curve
    force, bulk, energy = (
        dilatancy[each].broadcast_like(opening).transpose(*opening.dims).values for each in ENERGIES
    )
    # T/N = d delta/dv + (1/N) d(U - N w_b/2)/dv
    stored = energy - 0.5 * force * bulk
    mean_force = 0.5 * (force[1:] + force[:-1])
    no_work = np.zeros_like(mean_force)  # faces that do not touch store nothing
    steps = np.divide(np.diff(stored, axis=0), mean_force, out=no_work, where=mean_force > 0)
    return np.concatenate([curve[:1], curve[1:] + np.cumsum(steps, axis=0)])


def _angle(lift: xr.DataArray, smoothing: float | None) -> xr.DataArray:
    """Return the angle (degree) of a curve over (shear, ...)."""
    slopes, _ = dilatancy_slopes(_shears(lift), lift.values.reshape(lift.sizes["shear"], -1), smoothing)
    return lift.copy(data=np.degrees(np.arctan(slopes)).reshape(lift.shape))


def _strength(angle: xr.DataArray, pressure: xr.DataArray) -> xr.DataArray:
    tangent = angle.copy(data=np.tan(np.radians(angle.where(angle < 90.0).values)))
    return tangent * pressure


def default_distance(dilatancy: xr.Dataset, shears: Array) -> float:
    """Return the shear over which the peak is taken: 1 % of the side of the block, if the shears allow."""
    side = float(np.nan_to_num(dilatancy["nominal_area"])) ** 0.5 if "nominal_area" in dilatancy else 0.0
    # at least two steps: the peak over half of them is then known as well
    resolved = max(PEAK_SHARE * side, 2.0 * float(np.median(np.diff(shears))))
    return min(resolved, float(np.ptp(shears)))


def _secant_angles(lift: xr.DataArray, length: float) -> xr.DataArray:
    """Return the angle of the secant from every shear v to v + distance, over (distance, shear, ...).

    The distances are `length`, halved and doubled as often as the shears resolve.
    """
    shears = _shears(lift)
    candidates = length * 2.0 ** np.arange(-20, 21)  # a million times: more than any path of shears resolves
    finest, reach = np.diff(shears).min() / ROUNDED, np.ptp(shears) * ROUNDED
    candidates = candidates[(candidates == length) | ((candidates >= finest) & (candidates <= reach))]
    resolved = np.isfinite(secant_slopes(shears, shears, candidates)).any(axis=1)
    distances = candidates[resolved | (candidates == length)]
    angles = np.degrees(np.arctan(secant_slopes(shears, lift.values, distances)))
    return xr.DataArray(angles, {**lift.coords, "distance": distances}, ("distance", *lift.dims))


def secant_slopes(shears: Array, curves: Array, distances: Array) -> Array:
    """Return the slope of every curve from every shear v to v + distance, linear between the shears.

    Parameters
    ----------
    shears : ndarray, shape (n,)
        Ascending.
    curves : ndarray, shape (n, ...)
    distances : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k, n, ...)
        NaN where the curve ends before v + distance, or a step of shear on the way is longer than the
        distance.
    """
    steps = np.diff(shears)
    slopes = np.full((distances.size, *curves.shape), np.nan)
    for k, distance in enumerate(distances):
        if distance * ROUNDED < steps.min():
            continue
        rounding = distance * (ROUNDED - 1.0)
        for i, start in enumerate(shears):
            end = start + distance
            last = int(np.searchsorted(shears, end - rounding))  # the first shear at or beyond the end
            if last == shears.size:
                break
            if steps[i:last].max() <= distance + rounding:
                beyond = (shears[last] - end) / steps[last - 1] * (curves[last] - curves[last - 1])
                slopes[k, i] = (curves[last] - beyond - curves[i]) / distance
    return slopes


def _peaks(secants: xr.DataArray, pressure: xr.DataArray | None, length: float) -> xr.Dataset:
    """Return the greatest secant friction angle and strength of every distance, and those of `length`."""
    locked = (secants >= 90.0).any("shear")
    columns = {"friction_angle": secants}
    if pressure is not None:
        if "shear" in pressure.dims:  # against a spring: the mean over the distance
            pressure = _secant_means(pressure, secants["distance"].values)
        columns["shear_strength"] = _strength(secants, pressure)
    result = xr.Dataset({"peak_distance": length})
    for name, values in columns.items():
        result[f"secant_{name}"] = greatest = values.max("shear").where(~locked)
        place = values.fillna(-np.inf).argmax("shear")
        shear = values["shear"].isel(shear=place).drop_vars("shear").where(greatest.notnull())
        of_peak = "peak_shear" if name == "friction_angle" else "peak_strength_shear"
        for peak, every in ((f"peak_{name}", greatest), (of_peak, shear)):
            result[peak] = every.sel(distance=length).drop_vars("distance")
    return result


def _secant_means(values: xr.DataArray, distances: Array) -> xr.DataArray:
    """Return the mean of values over (..., shear, ...) from every shear v to v + distance."""
    from scipy.integrate import cumulative_trapezoid

    curves, shears = values.transpose("shear", ...), _shears(values)
    integral = cumulative_trapezoid(curves.values, shears, axis=0, initial=0)
    means = secant_slopes(shears, integral, distances)
    return xr.DataArray(means, {"distance": distances}, ("distance", *curves.dims))


def _shears(curve: xr.DataArray | xr.Dataset) -> Array:
    return np.asarray(curve["shear"].values, dtype=np.float64)


def _dependence(secants: xr.DataArray, negligible: float = 1.0) -> str:
    """Return how the peak depends on the distance, from the two shortest that the shears resolve.

    Of a peak whose half distance the shears do not resolve, as before a long first step, nothing is known. A
    change of so many degrees is as good as none, a choice: friction angles are quoted in whole degrees.
    """
    greatest = secants.max("shear").transpose("distance", ...)
    is_resolved = np.isfinite(greatest.values.reshape(greatest.sizes["distance"], -1)).any(axis=1)
    if np.count_nonzero(is_resolved) < 2:
        return NOT_KNOWN
    half, whole = (secants.isel(distance=k, drop=True) for k in np.flatnonzero(is_resolved)[:2])
    place = whole.fillna(-np.inf).argmax("shear")
    peaks = [each.max("shear").where(lambda peak: peak < 90.0) for each in (half, whole)]
    change = float(abs(peaks[1] - peaks[0]).where(half.isel(shear=place).notnull()).max())
    if not np.isfinite(change):
        return NOT_KNOWN
    words = f"{change:.3g} degree when the distance is halved to"
    words += f" {quantity_text(float(secants['distance'][is_resolved][0]), 'm')}"
    if change <= negligible:
        return f"changes by at most {words}"
    limit = (
        "the shears resolve no further halving: no limit is reached; compare only peaks over equal distances"
    )
    return f"changes by up to {words}; {limit}"


def _explain(result: xr.Dataset, secants: xr.DataArray) -> None:
    """State how the peaks depend on the distance, and why values are missing."""
    locked = bool((secants >= 90.0).any())
    unresolved = bool(np.isnan(secants.sel(distance=float(result["peak_distance"])).values).all())
    reason = "; ".join([LOCKED] * locked + [UNRESOLVED] * unresolved)
    for name in (*PEAKS, *PEAK_SHEARS):
        if name in result and name in PEAKS:
            result[name].attrs["comment"] = _dependence(secants)
        if name in result and bool(np.isnan(result[name].values).any()):
            result[name].attrs["reason"] = reason


def _dilatancy_name(dilatancy: xr.Dataset) -> str:
    """Return the name of the dilatancy to use: under force if present, otherwise rigid."""
    return "dilatancy" if "dilatancy" in dilatancy else "rigid_dilatancy"


def _basic_angle(dilatancy: xr.Dataset, basic_friction_angle: float | None) -> Any:
    """Return the given basic friction angle, or the one stored with the dilatancy."""
    if basic_friction_angle is not None:
        return basic_friction_angle
    stored = dilatancy.get("basic_friction_angle")
    return stored.item() if stored is not None and stored.size == 1 else stored


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
    if smoothing is not None:
        return _fitted_slopes(shears, curves, float(smoothing))
    # of second order inside, also for unequal steps; of first order at the ends
    ends = np.concatenate([shears[:1], shears, shears[-1:]])
    return np.gradient(curves, shears, axis=0), ends[2:] - ends[:-2]


def _fitted_slopes(x: Array, y: Array, window: float) -> tuple[Array, Array]:
    """Return the least-squares slope in a window around every point, and the length of each fit.

    A window without a second point is widened to the nearest one.
    """
    slopes, lengths = np.empty(y.shape), np.empty(x.shape)
    for index, centre in enumerate(x):
        distance = np.abs(x - centre)
        inside = distance <= ROUNDED * max(0.5 * window, np.sort(distance)[1])
        offset = x[inside] - x[inside].mean()
        slopes[index] = offset @ (y[inside] - y[index]) / (offset @ offset)
        lengths[index] = np.ptp(x[inside])
    return slopes, lengths
