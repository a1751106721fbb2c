"""Shear strength of a joint against the normal stress, by empirical criteria side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import read_direction
from fractalcontact.base.numbers import float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._criteria import (
    POSITIVE,
    STRENGTH,
    STRENGTH_REFERENCES,
    Joint,
    check_measured,
    check_quantities,
    longer_joint,
)
from fractalcontact.joints._directional_roughness import directional_roughness
from fractalcontact.joints._roughness_coefficient import roughness_coefficient as measured_coefficient

WHERE = "fractalcontact.joints.strength_envelope"

MEASURED = ("roughness_coefficient", "asperity_angle")  # arguments that a surface replaces
NO_STRENGTH = "NaN where the angle of a criterion reaches 90 degrees: the surface is too rough for it"
OUTSIDE = "outside the range of the criterion where in_range is False"


def _check(problems: Problems) -> None:
    given = problems.given
    problems.numbers("nominal_pressure", **POSITIVE)
    check_quantities(problems, "wall_strength", "basic_friction_angle")
    if given.criterion is None:
        expected = "heights, or an asperity_angle or roughness_coefficient in their place"
        problems.require(bool(_usable(vars(given))), "surface", expected)
    elif problems.choices("criterion", among=STRENGTH):
        names = word_tuple(given.criterion)
        problems.require(len(names) > 0, "criterion", "at least one", "an empty sequence")
        for name in names:
            for need in _missing(name, vars(given)):
                problems.add(need, f"a value, for criterion {name!r}")
    check_measured(problems, measured_coefficient, directional_roughness)


def _missing(criterion: str, given: Mapping[str, Any]) -> list[str]:
    """Return the arguments that a criterion needs and that are not given."""
    measured = () if given["surface"] is None else MEASURED
    return [need for need in STRENGTH[criterion].needs if given[need] is None and need not in measured]


def _usable(given: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(name for name in STRENGTH if not _missing(name, given))


@public_result(
    title="strength envelope",
    references=STRENGTH_REFERENCES,
    achieved_error="that of the criteria, which are empirical",
    reasons=dict.fromkeys(("shear_strength", "friction_angle"), NO_STRENGTH),
    check=_check,
)
def strength_envelope(
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
        An argument is wrong or missing for a criterion, or the asperity angle and the basic friction angle
        add up to 90 degrees.

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
    pressure = float_array(nominal_pressure)
    given = {
        "surface": surface,
        "wall_strength": wall_strength,
        "basic_friction_angle": basic_friction_angle,
        "residual_friction_angle": residual_friction_angle,
        "roughness_coefficient": roughness_coefficient,
        "asperity_angle": asperity_angle,
        "tensile_strength": tensile_strength,
        "cohesion": cohesion,
        "length": length,
    }
    chosen = _usable(given) if criterion is None else word_tuple(criterion)
    measured = _measured(surface, direction)
    joint = Joint.of(given, measured)
    with Problems(WHERE) as problems:
        total = joint.asperity_angle + joint.basic_friction_angle
        expected = "less than 90 degrees with the basic friction angle"
        problems.require(not total >= 90.0, "asperity_angle", expected, f"{total:g}")
    strengths, ranges = zip(*(STRENGTH[name].strength(pressure, joint) for name in chosen), strict=True)
    measured_notes = measured["roughness_coefficient"].attrs if measured else {}
    dims = ("criterion", "nominal_pressure")
    variables: dict[str, Any] = {
        "shear_strength": (dims, np.array(strengths)),
        "friction_angle": (dims, np.degrees(np.arctan(np.array(strengths) / pressure))),
        "in_range": (dims, np.array(ranges)),
        "assumption": ("criterion", np.array([STRENGTH[name].assumption for name in chosen])),
        "roughness_coefficient": ((), joint.roughness_coefficient, measured_notes),
        "asperity_angle": joint.asperity_angle,
    }
    if length is not None:
        longer = longer_joint(joint.roughness_coefficient, joint.wall_strength, joint.length)
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
    names = ("area_fraction", "shape", "theta_max")
    return {
        "roughness_coefficient": jrc["roughness_coefficient"],
        "asperity_angle": facets["mean_dip"],
    } | {name: facets[name] for name in names}


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
