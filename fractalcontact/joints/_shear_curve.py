"""Shear stress and dilation of a joint against displacement, after Barton and Bandis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import read_direction
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints import _criteria
from fractalcontact.joints._criteria import LARGEST_ANGLE, POSITIVE, SAMPLE_LENGTH
from fractalcontact.joints._roughness_coefficient import roughness_coefficient as measured_coefficient
from fractalcontact.joints._strength_envelope import OUTSIDE

SMOOTH = "the surface has no roughness on the scale of standard profiles: JRC is below 0"


def _check(problems: Problems) -> None:
    given = problems.given
    if problems.numbers("displacement", at_least=0, at_most=POSITIVE["at_most"]):
        ascending = bool((np.diff(float_array(given.displacement)) > 0).all())
        problems.require(ascending, "displacement", "ascending values")
    problems.numbers("nominal_pressure", **POSITIVE)
    required = ("wall_strength", "residual_friction_angle", "length")
    _criteria.check_quantities(problems, *required, residual_friction_angle={"below": LARGEST_ANGLE})
    problems.number("damage_coefficient", at_least=1, at_most=2, optional=True)
    problems.number("normal_stiffness", **POSITIVE, optional=True)
    _criteria.check_measured(problems, measured_coefficient)
    if given.surface is None:
        expected = "heights, or a roughness_coefficient in their place"
        problems.require(given.roughness_coefficient is not None, "surface", expected, None)


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
    jrc, jcs, peak = _criteria.longer_joint(jrc_of_sample, float(wall_strength), float(length))
    peak = max(peak, 1e-4 * float(length))  # as of JRC = 1e-5: a plane has no displacement of its own
    given, pressures = float_array(displacement), float_array(nominal_pressure)
    residual = float(residual_friction_angle)
    stiffness = 0.0 if normal_stiffness is None else float(normal_stiffness)
    columns = _criteria.barton_shear(
        given, pressures, (jrc, jcs, peak), residual, damage_coefficient, stiffness
    )
    inside = _criteria.in_tested_range(pressures, jcs, jrc_of_sample)
    dims = ("shear_displacement", "nominal_pressure")
    variables: dict[str, Any] = {name: (dims, values) for name, values in columns.items()}
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
