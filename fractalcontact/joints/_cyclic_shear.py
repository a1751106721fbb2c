"""Cyclic shear: the shear stress along a path of shear that reverses."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_direction, read_direction
from fractalcontact.base.numbers import float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.joints._friction import (
    ERROR,
    FORMS,
    LOCKED_ANGLE,
    REFERENCES,
    check_dilatancy,
    dilatancy_slopes,
    lift_curve,
    mark_locked,
    read_basic_angle,
    read_dilatancy,
)

Array = np.ndarray[Any, np.dtype[Any]]

STRESSES = ("shear_stress", "frictional_work")


def _check(
    problems: Problems,
    *,
    dilatancy: Any,
    path: Any,
    direction: Any,
    nominal_pressure: Any,
    basic_friction_angle: Any,
    form: Any,
    smoothing: Any,
) -> None:
    valid = [
        check_dilatancy(problems, dilatancy, basic_friction_angle, form, smoothing, nominal_pressure),
        problems.numbers("path", path),
        direction is None or check_direction(problems, direction),
    ]
    if valid[1]:
        turning_points = float_array(path)
        moves = turning_points.size > 1 and bool((np.diff(turning_points) != 0).all())
        expected = "at least two positions, each different from the previous one"
        valid.append(problems.require(moves, "path", expected, path))
    if all(valid):
        _check_reach(problems, dilatancy, direction, turning_points)


def _check_reach(problems: Problems, dilatancy: xr.Dataset, direction: Any, turning_points: Array) -> None:
    """Check that the dilatancy covers the path, on both sides where it has negative positions."""
    if not problems.require("azimuth" in dilatancy.variables, "dilatancy", "an azimuth", NONE):
        return
    if "direction" not in dilatancy.dims and dilatancy["azimuth"].ndim:
        dims = dilatancy["azimuth"].dims
        problems.add("dilatancy.azimuth", "one number, or a dim direction", f"dims {dims}")
        return
    name, shears = read_dilatancy(dilatancy)
    if name == "dilatancy":
        dims = dilatancy["nominal_pressure"].dims
        problems.require("step" in dims, "dilatancy.nominal_pressure", "the dim step", f"dims {dims}")
    for sign, azimuth in _side_azimuths(dilatancy, direction, turning_points).items():
        places = _places(dilatancy, azimuth)
        expected = f"the azimuth {azimuth:g}"
        if problems.require(places.size == 1, "dilatancy", expected, _azimuths(dilatancy).tolist()):
            reach = float((sign * turning_points).max())
            covered = reach <= shears[-1] * (1 + 1e-9) and (shears[0] == 0 or reach <= 0)
            problems.require(covered, "path", f"positions from 0 to {shears[-1]:g} m on both sides", reach)
    lowest = float(turning_points.min())
    problems.require(lowest < 0 or lowest >= shears[0], "path", f"at least {shears[0]:g} m", lowest)


@public_result(title="cyclic shear", references=REFERENCES, achieved_error=ERROR, check=_check)
def cyclic_shear(
    dilatancy: xr.Dataset,
    path: Sequence[float] | Array,
    *,
    direction: str | float | None = None,
    nominal_pressure: float | Sequence[float] | None = None,
    basic_friction_angle: float | None = None,
    form: str = "kinematic",
    smoothing: float | None = None,
) -> xr.Dataset:
    """Return the shear stress along a path of shear that reverses.

    The block climbs on the way out and slides down on the way back: with the dilatancy angle i = atan(d
    delta/dv) the friction angle is phi_basic + i out and phi_basic - i back, where the stress has the
    opposite sign. There is no wear: every cycle is like the first one, unlike in a real joint.

    Parameters
    ----------
    dilatancy : Dataset
        From `fractalcontact.joints.dilatancy`, with at least two shears, ascending. For a path with negative
        positions it must contain the opposite direction and the shear 0.
    path : sequence of float
        Positions of the block (m) at which it reverses, from the start on, for example [0, a, -a, 0];
        positive towards `direction`, negative towards the opposite one.
    direction : str or float, optional
        Direction of positive positions; None: the first one of the dilatancy.
    nominal_pressure : float or sequence of float, optional
        Pressures (Pa) for rigid faces; dilatancy under force has its own.
    basic_friction_angle, form, smoothing
        As for `fractalcontact.joints.friction`.

    Returns
    -------
    Dataset over (point[, step])
        Every shear of the dilatancy on the way and the turning points, these twice, once with each sense; so
        is the position 0 where the path crosses it, once with the slope of each side. Variables: shear
        (position, m), slip (m), sense (1 out, -1 back), dilatancy (m), friction_angle (degree); with
        forces or pressures shear_stress (Pa) and frictional_work (J/m2, since the start). NaN with the
        `reason` where the friction angle reaches 90 degrees, and for the work from there on.

    Raises
    ------
    InvalidInput
        `dilatancy` is not the Dataset of `dilatancy` or does not cover the path, or an argument is wrong.

    References
    ----------
    Patton (1966), 1st ISRM Congress; Goodman (1989), Introduction to Rock Mechanics.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> slope = np.tan(np.radians(10)) * np.arange(40.0) * np.ones((6, 1))
    >>> surface = fc.surfaces.from_array(slope, 1.0)
    >>> crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    >>> climb = fc.joints.dilatancy(crack, shear=[0, 2, 4], direction="E")
    >>> cycle = fc.joints.cyclic_shear(climb, [0, 4, 0])
    >>> cycle.friction_angle.values.round(6).tolist()
    [40.0, 40.0, 40.0, 20.0, 20.0, 20.0]
    """
    name, shears = read_dilatancy(dilatancy)
    turning_points = float_array(path)
    curves = dilatancy[[name]].rename({name: "dilatancy"}).drop_attrs()
    curves["lift"] = dilatancy[name].dims, lift_curve(dilatancy, form)
    if name == "dilatancy":
        curves["pressure"] = dilatancy["nominal_pressure"].variable
    elif nominal_pressure is not None:
        curves["pressure"] = "step", float_array(nominal_pressure)
    shear, sense, side = _points_along(turning_points, shears)
    points = xr.DataArray(np.clip(np.abs(shear), *shears[[0, -1]]), dims="point")
    along = {
        sign: _side_curves(curves, dilatancy, azimuth, shears, smoothing).interp(shear=points)
        for sign, azimuth in _side_azimuths(dilatancy, direction, turning_points).items()
    }
    here = along[1].where(xr.DataArray(side > 0, dims="point"), along.get(-1, along[1]))
    basic_angle = read_basic_angle(dilatancy, basic_friction_angle)
    senses = xr.DataArray(sense, dims="point")
    sides = xr.DataArray(side, dims="point")
    angle = basic_angle + senses * sides * np.degrees(np.arctan(here["slope"]))
    result = xr.Dataset({"dilatancy": here["dilatancy"], "friction_angle": angle})
    if "pressure" in here:
        pressure = here["pressure"].broadcast_like(points).transpose("point", "step")
        stress = senses * pressure * np.tan(np.radians(angle.where(angle < LOCKED_ANGLE)))
        result["shear_stress"] = stress.transpose("point", "step")
        result["frictional_work"] = ("point", "step"), _work(shear, result["shear_stress"].values)
        result = result.assign_coords(
            step=np.arange(pressure.sizes["step"]), nominal_pressure=(pressure.dims, pressure.values)
        )
    slip = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(shear)))])
    result = result.assign(shear=("point", shear), slip=("point", slip), sense=("point", sense))
    result = result.assign_coords(point=np.arange(shear.size)).assign(basic_friction_angle=basic_angle)
    result["friction_angle"].attrs["comment"] = FORMS[form]
    mark_locked(result, STRESSES)
    return result.assign_attrs(slope_of=name)


def _side_curves(
    curves: xr.Dataset, dilatancy: xr.Dataset, azimuth: float, shears: Array, smoothing: float | None
) -> xr.Dataset:
    """Return the curves towards an azimuth, with the slope of the lift.

    Each side has its own slope at the position 0: that of `friction` in its direction.
    """
    if "direction" in curves.dims:
        curves = curves.isel(direction=int(_places(dilatancy, azimuth)[0]))
    curves = curves.drop_vars([each for each in curves.coords if each != "shear"])
    lift = curves["lift"].transpose("shear", ...)
    slopes = dilatancy_slopes(shears, lift.values.reshape(shears.size, -1), smoothing)[0]
    return curves.assign(slope=(lift.dims, slopes.reshape(lift.shape))).drop_vars("lift")


def _work(shear: Array, stress: Array) -> Array:
    """Return the work done against the shear stress, over (point, step)."""
    # at a turning point the block does not move while the stress changes its sign
    moved = np.diff(shear)[:, None]
    steps = np.where(moved == 0, 0.0, 0.5 * (stress[1:] + stress[:-1]) * moved)
    return np.concatenate([np.zeros((1, stress.shape[1])), np.cumsum(steps, axis=0)])


def _azimuths(dilatancy: xr.Dataset) -> Array:
    return np.atleast_1d(np.asarray(dilatancy["azimuth"].values, dtype=float))


def _side_azimuths(dilatancy: xr.Dataset, direction: Any, turning_points: Array) -> dict[int, float]:
    """Return the azimuth of positive positions under 1 and, if needed, of negative ones under -1."""
    azimuth = float(_azimuths(dilatancy)[0]) if direction is None else read_direction(direction).azimuth
    sides = {1: azimuth}
    if float(turning_points.min()) < 0:
        sides[-1] = (azimuth + 180.0) % 360.0
    return sides


def _places(dilatancy: xr.Dataset, azimuth: float) -> Array:
    """Return at which places along `direction` the dilatancy has the azimuth."""
    return np.flatnonzero(np.isclose(_azimuths(dilatancy), azimuth, atol=1e-9))


def _points_along(turning_points: Array, shears: Array) -> tuple[Array, Array, Array]:
    """Return the positions along the path, those of the dilatancy included, the sense and the side.

    The side is 1 for positions towards the direction and -1 for those opposite; a leg that crosses 0 has
    this point on both.
    """
    legs, senses, sides = [], [], []
    for first, last in itertools.pairwise(turning_points):
        sense = 1 if last > first else -1
        ends = (first, 0.0, last) if min(first, last) < 0 < max(first, last) else (first, last)
        for start, stop in itertools.pairwise(ends):
            side = -1 if min(start, stop) < 0 else 1
            low, high = sorted((abs(start), abs(stop)))
            inner = shears[(shears > low) & (shears < high)]
            leg = side * np.concatenate([[low], inner, [high]]) + 0.0  # no minus zero
            legs.append(leg if (leg[-1] > leg[0]) == (sense > 0) else leg[::-1])
            senses.append(np.full(leg.size, sense, dtype=np.int8))
            sides.append(np.full(leg.size, side, dtype=np.int8))
    return np.concatenate(legs), np.concatenate(senses), np.concatenate(sides)
