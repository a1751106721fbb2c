"""Shear strength of a joint by empirical criteria, and its shear stress against displacement after Barton."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import read_direction
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.validation import Problems, require, word_tuple
from fractalcontact.joints import _criteria
from fractalcontact.joints._roughness import FACET_BYTES, directional_roughness
from fractalcontact.joints._roughness import roughness_coefficient as measured_coefficient

MEASURED = ("roughness_coefficient", "asperity_angle")  # arguments that a surface replaces
NO_STRENGTH = "NaN where the angle of a criterion reaches 90 degrees: the surface is too rough for it"
OUTSIDE = "outside the range of the criterion where in_range is False"
BELOW_VERTICAL = "less than 90 degrees with the basic friction angle"


def _check(problems: Problems) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the arguments and the criteria to compute."""
    given = problems.given
    problems.numbers("nominal_pressure", **_criteria.POSITIVE)
    are_numbers = _criteria.check_quantities(problems, "wall_strength", "basic_friction_angle")
    chosen: tuple[str, ...] = ()
    if given.criterion is None:
        chosen = tuple(name for name in _criteria.STRENGTH if not _missing(name, vars(given)))
        expected = "heights, or an asperity_angle or roughness_coefficient in their place"
        problems.require(bool(chosen), "surface", expected)
    elif problems.choices("criterion", among=_criteria.STRENGTH):
        chosen = word_tuple(given.criterion)
        problems.require(len(chosen) > 0, "criterion", "at least one", "an empty sequence")
        for name in chosen:
            for need in _missing(name, vars(given)):
                problems.add(need, f"a value, for criterion {name!r}")
    if are_numbers and given.asperity_angle is not None and _use_asperities(chosen):
        total = float(given.asperity_angle) + float(given.basic_friction_angle)
        problems.require(total < 90.0, "asperity_angle", BELOW_VERTICAL, total)
    _criteria.check_measured(problems, measured_coefficient, directional_roughness)
    return vars(given), chosen


def _missing(criterion: str, given: Mapping[str, Any]) -> list[str]:
    """Return the arguments that a criterion needs and that are not given."""
    measured = () if given["surface"] is None else MEASURED
    return [
        need for need in _criteria.STRENGTH[criterion].needs if given[need] is None and need not in measured
    ]


def _use_asperities(criteria: Sequence[str]) -> bool:
    """Return whether any of the criteria sees the joint as asperities of one angle."""
    return any("asperity_angle" in _criteria.STRENGTH[name].needs for name in criteria)


@public_result(
    title="strength envelope",
    references=_criteria.STRENGTH_REFERENCES,
    achieved_error="that of the criteria, which are empirical",
    reasons=dict.fromkeys(("shear_strength", "friction_angle"), NO_STRENGTH),
    check=_check,
    memory=FACET_BYTES,
)
@takes_checked
def strength_envelope(
    checked: tuple[dict[str, Any], tuple[str, ...]],
    /,
    surface: xr.DataArray | None = None,
    *,
    nominal_pressure: float | Sequence[float],
    wall_strength: float,
    basic_friction_angle: float,
    criterion: str | Sequence[str] | None = None,
    direction: str | float = "E",
    residual_friction_angle: float | None = None,
    roughness_coefficient: float | None = None,
    asperity_angle: float | None = None,
    tensile_strength: float | None = None,
    cohesion: float | None = None,
    length: float | None = None,
) -> xr.Dataset:
    """Return the peak shear strength of a joint against the normal stress by several empirical criteria.

    The criteria see the joint as a roughness coefficient JRC or as an asperity angle i, and the material as
    a few numbers. Their spread is the range of what practice would say of the joint.

    Parameters
    ----------
    surface : DataArray, shape (y, x), optional
        Heights of one face, m. None: a joint that is known by its JRC or its asperity angle only.
    nominal_pressure : float or sequence of float
        Normal stresses sigma, Pa, above 0.
    wall_strength : float
        Compressive strength JCS of the walls, Pa.
    basic_friction_angle : float
        Degree.
    criterion : str or sequence of str, optional
        Of "patton", "ladanyi_archambault", "barton_choubey", "barton_bandis", "grasselli_egger" and "xia".
        Default: all whose arguments are given.
    direction : str or float
        Direction in which the block slides: compass word, or degrees anticlockwise from E.
    residual_friction_angle : float, optional
        Degree, of weathered or sheared walls. Default: the basic friction angle; "grasselli_egger" needs it.
    roughness_coefficient : float, optional
        JRC of 0.1 m, 0 to 20. Default: that of the surface.
    asperity_angle : float, optional
        i, degree. Default: the mean dip that faces the shear, at the spacing of the surface.
    tensile_strength : float, optional
        Of the material, Pa. Default: a tenth of the wall strength.
    cohesion : float, optional
        Of sheared asperities, Pa; "patton" needs it.
    length : float, optional
        Length of the joint, m, at least 0.1; "barton_bandis" needs it.

    Returns
    -------
    Dataset over (criterion, nominal_pressure)
        shear_strength, Pa; friction_angle, whose tangent is the strength over the normal stress, degree;
        in_range, whether the criterion was made for such values. Over criterion: assumption. Also the
        roughness_coefficient and the asperity_angle in use; with a length scaled_roughness_coefficient,
        scaled_wall_strength (Pa) and peak_displacement (m) after Barton and Bandis.

    Raises
    ------
    InvalidInput
        An argument is wrong or missing for a criterion, or the asperity angle that a criterion needs and the
        basic friction angle add up to 90 degrees or more.

    Notes
    -----
    Patton: the lesser of sigma tan(phi_b + i) and c + sigma tan(phi_r). Ladanyi and Archambault: asperities
    shear off over the share 1 - (1 - sigma/JCS)^1.5 of the area, the rest dilates at the rate
    (1 - sigma/JCS)^4 tan i. Barton and Choubey: sigma tan(phi_r + JRC log10(JCS/sigma)), not above 70
    degrees. Barton and Bandis: the same with JRC and JCS of the length. Grasselli and Egger, Xia: from
    `directional_roughness`, with the equations on page `theory_joints`.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 0.5e-3, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> result = fc.joints.strength_envelope(
    ...     surface, nominal_pressure=[0.5e6, 2e6], wall_strength=60e6, basic_friction_angle=30, cohesion=1e6
    ... )
    >>> result.criterion.values.tolist()
    ['patton', 'ladanyi_archambault', 'barton_choubey', 'xia']
    >>> bool((result.friction_angle.diff("nominal_pressure") <= 1e-9).all())  # the angle falls with stress
    True
    >>> tested = fc.joints.strength_envelope(
    ...     nominal_pressure=1e6, wall_strength=100e6, basic_friction_angle=25, roughness_coefficient=10
    ... )
    >>> round(tested.shear_strength.item() / 1e6, 3)  # 1 MPa times tan(25 + 10 * 2 degrees)
    1.0
    """
    (given, chosen), pressure = checked, float_array(nominal_pressure)
    measured = _measured(surface, direction)
    joint = _criteria.Joint.of(given, measured)
    if _use_asperities(chosen):  # an angle that is given has been checked: this one is measured
        total = joint.asperity_angle + joint.basic_friction_angle
        require(not total >= 90.0, "surface", f"a mean dip of {BELOW_VERTICAL}", round(total, 3))
    strengths, ranges = zip(
        *(_criteria.STRENGTH[name].strength(pressure, joint) for name in chosen), strict=True
    )
    measured_notes = measured["roughness_coefficient"].attrs if measured else {}
    dims = ("criterion", "nominal_pressure")
    variables: dict[str, Any] = {
        "shear_strength": (dims, np.array(strengths)),
        "friction_angle": (dims, np.degrees(np.arctan(np.array(strengths) / pressure))),
        "in_range": (dims, np.array(ranges)),
        "assumption": ("criterion", np.array([_criteria.STRENGTH[name].assumption for name in chosen])),
        "roughness_coefficient": ((), joint.roughness_coefficient, measured_notes),
        "asperity_angle": joint.asperity_angle,
    }
    if length is not None:
        longer = _criteria.longer_joint(joint.roughness_coefficient, joint.wall_strength, joint.length)
        names = ("scaled_roughness_coefficient", "scaled_wall_strength", "peak_displacement")
        variables |= dict(zip(names, longer, strict=True))
    coords: dict[str, Any] = {"criterion": np.array(chosen), "nominal_pressure": pressure}
    if surface is not None:
        coords["direction"] = read_direction(direction).name
    result = xr.Dataset(variables, coords, attrs={"parameters": {"criterion": list(chosen)}})
    _explain(result, surface is not None)
    return result


def _measured(surface: xr.DataArray | None, direction: Any) -> dict[str, xr.DataArray]:
    """Return JRC, mean dip and the facets of a surface; nothing without one."""
    if surface is None:
        return {}
    jrc = measured_coefficient(surface, direction=direction)
    facets = directional_roughness(surface, direction=direction)
    measured = {"roughness_coefficient": jrc["roughness_coefficient"], "asperity_angle": facets["mean_dip"]}
    return measured | {name: facets[name] for name in ("area_fraction", "shape", "theta_max")}


def _explain(result: xr.Dataset, has_surface: bool) -> None:
    """Give the labels of the strength, where it is out of range, and why values are missing."""
    result["shear_strength"].attrs["long_name"] = "peak shear strength"
    result["friction_angle"].attrs["long_name"] = "angle whose tangent is the strength over the normal stress"
    if not result["in_range"].all():
        result["shear_strength"].attrs["comment"] = OUTSIDE
    unknown = (
        "NaN: the profiles are straight lines; taken as 0" if has_surface else "NaN: neither given nor used"
    )
    for name in ("roughness_coefficient", "asperity_angle"):
        if np.isnan(result[name]):
            result[name].attrs["reason"] = unknown


SMOOTH = "the surface has no roughness on the scale of standard profiles: JRC is below 0"


def _check_curve(problems: Problems) -> None:
    given = problems.given
    if problems.numbers("displacement", at_least=0, at_most=_criteria.POSITIVE["at_most"]):
        ascending = bool((np.diff(float_array(given.displacement)) > 0).all())
        problems.require(ascending, "displacement", "ascending values")
    problems.numbers("nominal_pressure", **_criteria.POSITIVE)
    required = ("wall_strength", "residual_friction_angle", "length")
    _criteria.check_quantities(
        problems, *required, residual_friction_angle={"below": _criteria.LARGEST_ANGLE}
    )
    problems.number("damage_coefficient", at_least=1, at_most=2, optional=True)
    problems.number("normal_stiffness", **_criteria.POSITIVE, optional=True)
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
    check=_check_curve,
    memory=50.0,
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
    length: float = _criteria.SAMPLE_LENGTH,
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
