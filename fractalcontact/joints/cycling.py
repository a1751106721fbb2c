"""Cyclic shear: the shear stress along a path that goes to and fro."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._directions import one_direction
from fractalcontact.joints._slopes import fitted_slopes, neighbour_slopes
from fractalcontact.joints.strength import LOCKED, REFERENCES, basic_angle, check_dilatancy, check_options

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.cyclic_shear"
Array = np.ndarray[Any, np.dtype[Any]]


@accounted("that of the dilatancy")
def cyclic_shear(
    dilatancy: xr.Dataset,
    path: Sequence[float] | Array,
    *,
    direction: str | float | None = None,
    nominal_pressure: float | Sequence[float] | None = None,
    basic_friction_angle: float | None = None,
    smoothing: float | None = None,
) -> xr.Dataset:
    """Return the shear stress along a path of shear that goes to and fro.

    The block climbs on the way out and slides down on the way back: with the dilatancy angle i = atan(d
    delta/dv) the friction angle is phi_basic + i out and phi_basic - i back, where the stress has the other
    sign. Nothing wears: every cycle is like the first one. A real joint loses its asperities, and with them
    the difference between out and back.

    Parameters
    ----------
    dilatancy : Dataset
        From `fractalcontact.joints.dilatancy`, with at least two shears, ascending. Where the path has
        negative positions it holds the opposite direction too, and the shear 0.
    path : sequence of float
        Positions of the block (m) at which it turns, from the start on, for example [0, a, -a, 0]; positive
        towards `direction`, negative towards the opposite one.
    direction : str or float, optional
        Direction of positive positions; None: the first one of the dilatancy.
    nominal_pressure : float or sequence of float, optional
        Pressures (Pa) for rigid faces; dilatancy under force carries its own.
    basic_friction_angle, smoothing
        As for `fractalcontact.joints.friction`.

    Returns
    -------
    Dataset over (point[, step])
        Every shear of the dilatancy on the way and the turning points, these twice, once with each sense:
        shear (position, m), slip (m), sense (1 out, -1 back), dilatancy (m), friction_angle (degree); with
        forces or pressures shear_stress (Pa) and frictional_work (J/m2, since the start). NaN with the
        `reason` where the friction angle reaches 90 degrees, and for the work from there on.

    Raises
    ------
    InvalidInput
        The Dataset is of another kind or does not reach as far as the path, or an argument is wrong.

    References
    ----------
    Patton (1966), 1st ISRM Congress; Goodman (1989), Introduction to Rock Mechanics.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        name, shears = check_dilatancy(dilatancy, problems)
        places = problems.numbers("path", path)
        moves = places.size > 1 and bool((np.diff(places) != 0).all())
        problems.require(moves, "path", "at least two positions, each other than the one before", path)
        basic = 0.0 if problems.found else basic_angle(dilatancy, basic_friction_angle, problems)
        pressures = check_options(name, smoothing, nominal_pressure, problems)
        if not problems.found:
            there, back = _sides(dilatancy, direction, places, shears, problems)
    position, opening = _joined(there, back, name)
    slopes, _ = (
        neighbour_slopes(position, opening)
        if smoothing is None
        else fitted_slopes(position, opening, float(smoothing))
    )
    pressure = _joined(there, back, "nominal_pressure")[1] if name == "dilatancy" else None
    if pressures is not None:
        pressure = np.broadcast_to(pressures, (position.size, pressures.size))
    shear, sense = _walked(places, position)
    found = _along(shear, sense, position, opening, slopes, basic)
    if pressure is not None:
        found |= _stresses(shear, sense, found["friction_angle"], _read(shear, position, pressure))
    by_step = name == "dilatancy"
    variables = {
        key: (("point", "step"), values) if by_step or values.shape[1] > 1 or key in STRESSES
        else ("point", values[:, 0])
        for key, values in found.items()
    }  # fmt: skip
    slip = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(shear)))])
    result = xr.Dataset(
        variables | {"shear": ("point", shear), "slip": ("point", slip), "sense": ("point", sense)},
        {"point": np.arange(shear.size)},
    )
    if pressure is not None:
        result = result.assign_coords(
            step=np.arange(pressure.shape[1]),
            nominal_pressure=(("point", "step"), _read(shear, position, pressure)),
        )
    result["basic_friction_angle"] = basic
    parameters = {
        "dilatancy": dilatancy,
        "path": places,
        "direction": direction,
        "nominal_pressure": nominal_pressure,
        "basic_friction_angle": basic_friction_angle,
        "smoothing": smoothing,
    }
    result = stamp(
        label(result), WHERE, parameters, title="cyclic shear", references=REFERENCES, slope_of=name
    )
    for key in STRESSES:
        if key in result and bool(np.isnan(result[key].values).any()):
            result[key].attrs["reason"] = LOCKED
    return result


STRESSES = ("shear_stress", "frictional_work")


def _sides(
    dilatancy: xr.Dataset, direction: Any, places: Array, shears: Array, problems: Problems
) -> tuple[xr.Dataset, xr.Dataset | None]:
    """Return the dilatancy towards the direction and, where the path needs it, the opposite way."""
    if "direction" not in dilatancy.dims:
        dilatancy = dilatancy.expand_dims("direction")
    azimuths = np.asarray(dilatancy["azimuth"].values, dtype=float)
    wanted = float(azimuths[0])
    if direction is not None:
        wanted = one_direction(direction, problems).azimuth
    found = {}
    for sign, azimuth in ((1, wanted), (-1, (wanted + 180.0) % 360.0)):
        reach = float((sign * places).max())
        if sign < 0 and reach <= 0:
            continue
        at = np.flatnonzero(np.isclose(azimuths, azimuth, atol=1e-9))
        if not problems.require(at.size == 1, "dilatancy", f"the azimuth {azimuth:g}", azimuths.tolist()):
            continue
        covers = reach <= shears[-1] * (1 + 1e-9) and (shears[0] == 0 or reach <= 0)
        problems.require(covers, "path", f"positions from 0 to {shears[-1]:g} m on both sides", reach)
        found[sign] = dilatancy.isel(direction=int(at[0]))
    low = shears[0] if float(places.min()) >= 0 else 0.0
    problems.require(float(places.min()) >= low or -1 in found, "path", f"at least {low:g} m", places.min())
    return found.get(1, dilatancy), found.get(-1)


def _joined(there: xr.Dataset, back: xr.Dataset | None, name: str) -> tuple[Array, Array]:
    """Return the positions, ascending, and a variable over (position, step)."""
    shears = np.asarray(there["shear"].values, dtype=float)
    sides = [_table(side, name, shears.size) for side in (there, back) if side is not None]
    if back is None:
        return shears, sides[0]
    return np.concatenate([-shears[:0:-1], shears]), np.concatenate([sides[1][:0:-1], sides[0]])


def _table(side: xr.Dataset, name: str, size: int) -> Array:
    variable = side[name]
    if "shear" not in variable.dims:
        return np.broadcast_to(np.atleast_1d(variable.values), (size, variable.size))
    return np.asarray(variable.transpose("shear", ...).values, dtype=float).reshape(size, -1)


def _walked(places: Array, position: Array) -> tuple[Array, Array]:
    """Return the positions along the path, with the known ones on the way, and the sense of sliding."""
    parts, senses = [], []
    for first, last in itertools.pairwise(places):
        low, high = min(first, last), max(first, last)
        inner = position[(position > low) & (position < high)]
        leg = np.concatenate([[low], inner, [high]])
        parts.append(leg if last > first else leg[::-1])
        senses.append(np.full(leg.size, 1 if last > first else -1, dtype=np.int8))
    return np.concatenate(parts), np.concatenate(senses)


def _read(shear: Array, position: Array, table: Array) -> Array:
    """Return a table over (position, ...) at other positions, linear between."""
    return np.stack([np.interp(shear, position, column) for column in table.T], axis=1)


def _along(
    shear: Array, sense: Array, position: Array, opening: Array, slopes: Array, basic: float
) -> dict[str, Array]:
    angle = np.degrees(np.arctan(_read(shear, position, slopes)))
    return {
        "dilatancy": _read(shear, position, opening),
        "friction_angle": basic + sense[:, None] * angle,
    }


def _stresses(shear: Array, sense: Array, angle: Array, pressure: Array) -> dict[str, Array]:
    angle = np.broadcast_to(angle, pressure.shape)
    stress = sense[:, None] * pressure * np.tan(np.radians(np.where(angle < 90.0, angle, np.nan)))
    power = 0.5 * (stress[1:] + stress[:-1]) * np.diff(shear)[:, None]
    # at a turning point the block stands still while the stress changes its sign
    power = np.where(np.diff(shear)[:, None] == 0, 0.0, power)
    work = np.concatenate([np.zeros((1, stress.shape[1])), np.cumsum(power, axis=0)])
    return {"shear_stress": stress, "frictional_work": work}
