"""Shear stress and dilation of a joint against displacement, after Barton and Bandis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import check_direction, read_direction
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints import _criteria
from fractalcontact.joints._criteria import (
    FITTED_STRESS,
    LARGEST_ANGLE,
    LARGEST_JRC,
    POSITIVE,
    SAMPLE_LENGTH,
    check_quantities,
)
from fractalcontact.joints._roughness_coefficient import roughness_coefficient as measured_coefficient
from fractalcontact.joints._strength_envelope import OUTSIDE

# displacement at the peak over the length, as of JRC = 1e-5: a plane has none of its own
SMALLEST_PEAK = 1e-4
# of the integral of the dilation: with 400 it changes by up to 3e-4, stresses against a spring too
FEWEST_STEPS = 200
SMOOTH = "the surface has no roughness on the scale of standard profiles: JRC is below 0"


def _check(problems: Problems) -> None:
    given = problems.given
    if problems.numbers("displacement", at_least=0, at_most=POSITIVE["at_most"]):
        ascending = bool((np.diff(float_array(given.displacement)) > 0).all())
        problems.require(ascending, "displacement", "ascending values")
    problems.numbers("nominal_pressure", **POSITIVE)
    problems.number("residual_friction_angle", above=0, below=LARGEST_ANGLE)
    check_quantities(problems, "wall_strength", "length")
    check_quantities(problems, "roughness_coefficient", optional=True)
    problems.number("damage_coefficient", at_least=1, at_most=2, optional=True)
    problems.number("normal_stiffness", **POSITIVE, optional=True)
    has_direction = check_direction(problems)
    if given.surface is None:
        expected = "heights, or a roughness_coefficient in their place"
        problems.require(given.roughness_coefficient is not None, "surface", expected, None)
    else:
        with problems.collect():
            measured_coefficient.validate(given.surface, direction=given.direction if has_direction else "E")


@public_result(
    title="Barton-Bandis shear curve",
    references=(
        "Barton (1982), Terra Tek report 82-39; Barton, Bandis and Bakhtar (1985), Int. J. Rock Mech. Min. "
        "Sci. 22:121; Barton and Choubey (1977), Rock Mechanics 10:1"
    ),
    achieved_error="that of the criterion, which is empirical",
    check=_check,
)
def shear_curve(
    surface: xr.DataArray | None,
    displacement: float | Sequence[float] | Array,
    *,
    nominal_pressure: float | Sequence[float],
    wall_strength: float,
    residual_friction_angle: float,
    direction: str | float = "E",
    roughness_coefficient: float | None = None,
    length: float = SAMPLE_LENGTH,
    damage_coefficient: float | None = None,
    normal_stiffness: float | None = None,
) -> xr.Dataset:
    """Return shear stress and dilation against shear displacement by the mobilised roughness of Barton.

    tau = sigma tan(phi_r + JRC_mob log10(JCS/sigma)), where JRC_mob rises to JRC at the displacement of the
    peak and falls beyond it. The empirical counterpart of `direct_shear`.

    Parameters
    ----------
    surface : DataArray, shape (y, x), optional
        Heights of one face, m, of which the JRC is taken. None: a joint that is known by its JRC only.
    displacement : float or sequence of float
        Shear displacements, m, ascending, from 0 on.
    nominal_pressure : float or sequence of float
        Normal stresses at the start, Pa.
    wall_strength : float
        Compressive strength JCS of the walls, Pa.
    residual_friction_angle : float
        phi_r, degree.
    direction : str or float
        Direction in which the block slides: compass word, or degrees anticlockwise from E.
    roughness_coefficient : float, optional
        JRC of 0.1 m, 0 to 20. Default: that of the surface.
    length : float
        Length of the joint, m, at least 0.1, for which JRC, JCS and the peak displacement hold.
    damage_coefficient : float, optional
        M, by which the dilation is less than the angle of the roughness: 1 at low normal stress to 2 at high.
        Default: 0.7 + JRC/(12 log10(JCS/sigma)), within 1 and 2.
    normal_stiffness : float, optional
        Stiffness of a spring on the block per area, Pa/m. Default: constant normal stress.

    Returns
    -------
    Dataset over (shear_displacement, nominal_pressure)
        shear_stress, normal_stress, Pa; friction_angle, dilatancy_angle, degree; dilatancy, m. Over
        nominal_pressure: peak_shear_strength, Pa, and in_range, whether the criterion was made for such
        values. Also peak_displacement, m, and the roughness_coefficient of the length.

    Raises
    ------
    InvalidInput
        An argument is wrong.

    Notes
    -----
    Mobilised over peak JRC is 0, 0.75, 1, 0.85, 0.7, 0.5, 0 at 0.3, 0.6, 1, 2, 4, 10, 100 times the peak
    displacement L/500 (JRC/L)^0.33; before 0.3 friction alone is mobilised, from 0. The friction angle is
    limited to 70 degrees.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 0.5e-3, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> curve = fc.joints.shear_curve(
    ...     surface, [0, 1e-3, 1e-2], nominal_pressure=1e6, wall_strength=1e8, residual_friction_angle=28
    ... )
    >>> curve.friction_angle.values[:, 0].round(1).tolist()
    [0.0, 42.8, 35.5]
    """
    jrc_of_sample = math.nan if roughness_coefficient is None else float(roughness_coefficient)
    if surface is not None and roughness_coefficient is None:
        measured = measured_coefficient(surface, direction=direction)
        jrc_of_sample = measured["roughness_coefficient"].item()
    residual, longer = float(residual_friction_angle), float(length)
    smooth = float(np.fmax(jrc_of_sample, 0.0))
    jrc = float(_criteria.scaled_roughness(smooth, longer))
    jcs = _criteria.scaled_wall_strength(float(wall_strength), smooth, longer)
    peak = max(_criteria.peak_displacement(smooth, longer), SMALLEST_PEAK * longer)
    given, pressures = float_array(displacement), float_array(nominal_pressure)

    def angles(place: float, sigma: Array) -> tuple[Array, Array]:
        """Return the angles of friction and dilation (radian) at a displacement under a normal stress."""
        peak_angle = _criteria.roughness_angle(sigma, jrc, jcs, residual)
        mobilised = _criteria.mobilised_angle(place / peak, peak_angle, residual)
        damage = damage_coefficient or _criteria.damage_coefficient(sigma, jrc, jcs)
        return np.radians(residual + mobilised), np.radians(np.clip(mobilised, 0.0, None) / damage)

    # the dilation is an integral: steps finer than the displacements in between
    fine = np.union1d(given, np.linspace(0.0, given[-1], FEWEST_STEPS + 1))
    stiffness = 0.0 if normal_stiffness is None else float(normal_stiffness)
    sigma, opening, rise = pressures, np.zeros_like(pressures), angles(0.0, pressures)[1]
    rows, last, before = [], 0.0, rise
    for place in fine:
        start = opening
        for _ in range(2):  # the stress at the end of the step, once corrected
            friction, rise = angles(place, sigma)
            opening = start + 0.5 * (np.tan(rise) + np.tan(before)) * (place - last)
            sigma = pressures + stiffness * opening
        rows.append((sigma * np.tan(friction), sigma, np.degrees(friction), np.degrees(rise), opening))
        last, before = place, rise
    columns = np.array(rows)[np.searchsorted(fine, given)].transpose(1, 0, 2)
    names = ("shear_stress", "normal_stress", "friction_angle", "dilatancy_angle", "dilatancy")
    dims, ratio = ("shear_displacement", "nominal_pressure"), pressures / jcs
    inside = (ratio >= FITTED_STRESS[0]) & (ratio <= FITTED_STRESS[1]) & (0 <= jrc_of_sample <= LARGEST_JRC)
    variables: dict[str, Any] = {name: (dims, values) for name, values in zip(names, columns, strict=True)}
    at_peak = np.radians(residual + _criteria.roughness_angle(pressures, jrc, jcs, residual))
    variables["peak_shear_strength"] = "nominal_pressure", pressures * np.tan(at_peak)
    variables |= {"in_range": ("nominal_pressure", inside), "peak_displacement": peak}
    variables["roughness_coefficient"] = jrc
    coords: dict[str, Any] = {"nominal_pressure": pressures, "shear_displacement": given}
    if surface is not None:
        coords["direction"] = read_direction(direction).name
    result = xr.Dataset(variables, coords)
    result["peak_shear_strength"].attrs["long_name"] = "shear strength at the peak, under the first stress"
    if not inside.all():
        result["shear_stress"].attrs["comment"] = OUTSIDE
    if not jrc_of_sample >= 0:
        result["roughness_coefficient"].attrs["comment"] = SMOOTH
    return result
