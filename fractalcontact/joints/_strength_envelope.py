"""Shear strength of a joint against the normal stress, by empirical criteria side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._compass import check_direction, read_direction
from fractalcontact.joints._directional_roughness import directional_roughness
from fractalcontact.joints._roughness_coefficient import LARGEST_JRC, SAMPLE_LENGTH, roughness_coefficient
from fractalcontact.joints._strength_criteria import scaled_constants

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.joints.strength_envelope"
SMALLEST, LARGEST = 1e-30, 1e30  # Pa: ratios and powers of such stresses do not overflow
LARGEST_ANGLE = 70.0  # degree: Barton's limit of the total friction angle
FITTED_STRESS = (0.01, 0.3)  # normal stress over wall strength of the tests of Barton and Choubey
SHEARED_POWER, DILATION_POWER = 1.5, 4.0  # K1 and K2 of Ladanyi and Archambault
STRENGTH_RATIO = 10.0  # compressive over tensile strength n of a hard rock (Hoek and Bray)
RIGHT_ANGLE = 90.0  # degree
NO_STRENGTH = "NaN where the angle of a criterion reaches 90 degrees: the surface is too rough for it"
OUTSIDE = "outside the range of the criterion where in_range is False"


class Joint(NamedTuple):
    """Measures of the surface and its material; stresses in Pa, angles in degrees."""

    roughness: float
    asperity_angle: float
    wall_strength: float
    tensile_strength: float
    basic_angle: float
    residual_angle: float
    cohesion: float
    length: float
    area_fraction: float
    shape: float
    theta_max: float


class Criterion(NamedTuple):
    """Strength and range of a criterion, the optional argument it needs, and what it assumes."""

    strength: Callable[[Array, Joint], tuple[Array, Array]]
    needs: str | None
    assumption: str


def _check(
    problems: Problems,
    *,
    surface: Any,
    nominal_pressure: Any,
    wall_strength: Any,
    basic_friction_angle: Any,
    criterion: Any,
    direction: Any,
    residual_friction_angle: Any,
    asperity_angle: Any,
    tensile_strength: Any,
    cohesion: Any,
    length: Any,
) -> None:
    problems.numbers("nominal_pressure", nominal_pressure, at_least=SMALLEST, at_most=LARGEST)
    problems.number("wall_strength", wall_strength, at_least=SMALLEST, at_most=LARGEST)
    problems.number("basic_friction_angle", basic_friction_angle, above=0, below=90)
    problems.number("residual_friction_angle", residual_friction_angle, above=0, below=90, optional=True)
    problems.number("asperity_angle", asperity_angle, at_least=0, below=90, optional=True)
    problems.number("tensile_strength", tensile_strength, at_least=SMALLEST, at_most=LARGEST, optional=True)
    problems.number("cohesion", cohesion, at_least=0, at_most=LARGEST, optional=True)
    problems.number("length", length, at_least=SAMPLE_LENGTH, at_most=LARGEST, optional=True)
    if criterion is not None and problems.choices("criterion", criterion, CRITERIA):
        given = {"cohesion": cohesion, "length": length, "residual_friction_angle": residual_friction_angle}
        problems.require(len(word_tuple(criterion)) > 0, "criterion", "at least one", "an empty sequence")
        for name in word_tuple(criterion):
            needs = CRITERIA[name].needs
            missing = needs is not None and given[needs] is None
            problems.require(not missing, str(needs), f"a value, for criterion {name!r}", None)
    has_direction = check_direction(problems, direction)
    for check, options in (
        (roughness_coefficient.validate, {"direction": direction} if has_direction else {}),
        (directional_roughness.validate, {}),
    ):
        with problems.collect():
            check(surface, **options)


@public_result(
    title="strength envelope",
    references=(
        "Patton (1966), 1st ISRM Congress 1:509; Ladanyi and Archambault (1970), 11th US Symposium on Rock "
        "Mechanics; Barton and Choubey (1977), Rock Mechanics 10:1; Barton and Bandis (1982), 23rd US "
        "Symposium on Rock Mechanics; Grasselli and Egger (2003), Int. J. Rock Mech. Min. Sci. 40:25; Xia, "
        "Tang, Xiao and Song (2014), Rock Mech. Rock Eng. 47:1423"
    ),
    achieved_error="that of the criteria, which are empirical",
    check=_check,
)
def strength_envelope(
    surface: xr.DataArray,
    *,
    nominal_pressure: float | Sequence[float],
    wall_strength: float,
    basic_friction_angle: float,
    criterion: str | Sequence[str] | None = None,
    direction: str | float = "E",
    residual_friction_angle: float | None = None,
    asperity_angle: float | None = None,
    tensile_strength: float | None = None,
    cohesion: float | None = None,
    length: float | None = None,
) -> xr.Dataset:
    """Return the peak shear strength of a joint against the normal stress by several empirical criteria.

    The criteria see the surface as a roughness coefficient JRC or as an asperity angle i, and the material as
    a few numbers. Their spread is the range of what practice would say of the joint.

    Parameters
    ----------
    surface : DataArray, shape (y, x)
        Heights of one face, m.
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
        Direction in which the block slides: compass word, or azimuth in degrees.
    residual_friction_angle : float, optional
        Degree, of weathered or sheared walls. Default: the basic friction angle; "grasselli_egger" needs it.
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
        roughness_coefficient and the asperity_angle in use.

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
    """
    pressure = float_array(nominal_pressure)
    given = {
        None: True,
        "cohesion": cohesion is not None,
        "length": length is not None,
        "residual_friction_angle": residual_friction_angle is not None,
    }
    usable = tuple(name for name, rule in CRITERIA.items() if given[rule.needs])
    chosen = usable if criterion is None else word_tuple(criterion)
    roughness = roughness_coefficient(surface, direction=direction).roughness_coefficient
    facets = directional_roughness(surface, azimuth=read_direction(direction).azimuth).isel(azimuth=0)
    joint = Joint(
        roughness=roughness.item(),
        asperity_angle=float(facets.mean_dip if asperity_angle is None else asperity_angle),
        wall_strength=float(wall_strength),
        tensile_strength=float(
            wall_strength / STRENGTH_RATIO if tensile_strength is None else tensile_strength
        ),
        basic_angle=float(basic_friction_angle),
        residual_angle=float(
            basic_friction_angle if residual_friction_angle is None else residual_friction_angle
        ),
        cohesion=0.0 if cohesion is None else float(cohesion),
        length=SAMPLE_LENGTH if length is None else float(length),
        area_fraction=facets.area_fraction.item(),
        shape=facets["shape"].item(),
        theta_max=facets.theta_max.item(),
    )
    with Problems(WHERE) as problems:
        total = joint.asperity_angle + joint.basic_angle
        problems.require(
            total < 90.0, "asperity_angle", "less than 90 degrees with the basic friction angle", f"{total:g}"
        )
    strengths, ranges = zip(*(CRITERIA[name].strength(pressure, joint) for name in chosen), strict=True)
    dims = ("criterion", "nominal_pressure")
    result = xr.Dataset(
        {
            "shear_strength": (dims, np.array(strengths)),
            "friction_angle": (dims, np.degrees(np.arctan(np.array(strengths) / pressure))),
            "in_range": (dims, np.array(ranges)),
            "assumption": ("criterion", np.array([CRITERIA[name].assumption for name in chosen])),
            "roughness_coefficient": joint.roughness,
            "asperity_angle": joint.asperity_angle,
        },
        coords={
            "criterion": np.array(chosen),
            "nominal_pressure": pressure,
            "direction": read_direction(direction).name,
        },
        attrs={"parameters": {"criterion": list(chosen)}},
    )
    result["shear_strength"].attrs["long_name"] = "peak shear strength"
    result["friction_angle"].attrs["long_name"] = "angle whose tangent is the strength over the normal stress"
    if np.isnan(strengths).any():
        for name in ("shear_strength", "friction_angle"):
            result[name].attrs["reason"] = NO_STRENGTH
    if not np.all(ranges):
        result["shear_strength"].attrs["comment"] = OUTSIDE
    if "comment" in roughness.attrs:
        result["roughness_coefficient"].attrs["comment"] = roughness.attrs["comment"]
    if not np.isfinite(joint.roughness):
        result["roughness_coefficient"].attrs["reason"] = "NaN: the profiles are straight lines; taken as 0"
    return result


def _patton(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength of asperities that are overridden or sheared off, whichever needs less."""
    overridden = pressure * math.tan(math.radians(joint.basic_angle + joint.asperity_angle))
    sheared = joint.cohesion + pressure * math.tan(math.radians(joint.residual_angle))
    return np.minimum(overridden, sheared), np.ones(pressure.shape, dtype=bool)


def _ladanyi_archambault(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength where a share of the asperities is sheared off, and the rest is overridden.

    tau = (sigma (1 - a)(v + tan phi) + a s_r)/(1 - (1 - a) v tan phi), with the strength s_r of the material
    by the parabola of Fairhurst. Above the wall strength the material fails.
    """
    relative = pressure / joint.wall_strength
    remaining = np.clip(1.0 - relative, 0.0, None)
    sheared = 1.0 - remaining**SHEARED_POWER  # a
    dilation = remaining**DILATION_POWER * math.tan(math.radians(joint.asperity_angle))  # v
    friction = math.tan(math.radians(joint.basic_angle))
    ratio = joint.wall_strength / joint.tensile_strength  # n
    material = joint.wall_strength * (math.sqrt(1.0 + ratio) - 1.0) / ratio * np.sqrt(1.0 + ratio * relative)
    overridden = pressure * (1.0 - sheared) * (dilation + friction)
    strength = (overridden + sheared * material) / (1.0 - (1.0 - sheared) * dilation * friction)
    return strength, relative <= 1.0


def _barton_choubey(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_r + JRC log10(JCS/sigma)), limited to 70 degrees; no roughness above JCS."""
    return _barton(pressure, _scale_roughness(joint), joint.wall_strength, joint)


def _barton_bandis(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength of Barton and Choubey with JRC and JCS of the length of the joint."""
    constants = scaled_constants(_scale_roughness(joint), joint.wall_strength, joint.length)
    return _barton(pressure, constants.roughness, constants.wall_strength, joint)


def _scale_roughness(joint: Joint) -> float:
    """Return JRC, 0 for a negative or missing one."""
    return max(joint.roughness, 0.0) if math.isfinite(joint.roughness) else 0.0


def _barton(pressure: Array, roughness: float, wall_strength: float, joint: Joint) -> tuple[Array, Array]:
    decades = np.log10(wall_strength) - np.log10(pressure)
    angle = joint.residual_angle + roughness * np.clip(decades, 0.0, None)
    limit = max(LARGEST_ANGLE, joint.residual_angle)
    low, high = FITTED_STRESS
    inside = (angle <= limit) & (pressure >= low * wall_strength) & (pressure <= high * wall_strength)
    inside &= 0.0 <= joint.roughness <= LARGEST_JRC
    return pressure * np.tan(np.radians(np.minimum(angle, limit))), inside


def _grasselli_egger(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_r') [1 + exp(-theta_max A0 sigma/(9 C sigma_t))], with a fitted angle phi_r'."""
    decay = joint.theta_max * joint.area_fraction / (9.0 * joint.shape) if joint.shape > 0 else math.inf
    with np.errstate(under="ignore"):
        share = np.exp(-decay * pressure / joint.tensile_strength)
    strength = pressure * math.tan(math.radians(joint.residual_angle)) * (1.0 + share)
    return strength, _by_facets(pressure, joint)


def _xia(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_b + 4 A0 t [1 + exp(-t sigma/(9 A0 sigma_t))]), t = theta_max/(C + 1), degree."""
    if joint.area_fraction == 0:
        return pressure * math.tan(math.radians(joint.basic_angle)), _by_facets(pressure, joint)
    metric = joint.theta_max / (joint.shape + 1.0)
    with np.errstate(under="ignore"):
        share = np.exp(-metric / (9.0 * joint.area_fraction) * pressure / joint.tensile_strength)
    angle = joint.basic_angle + 4.0 * joint.area_fraction * metric * (1.0 + share)
    possible = angle < RIGHT_ANGLE
    strength = pressure * np.tan(np.radians(np.where(possible, angle, np.nan)))
    return strength, _by_facets(pressure, joint) & possible


def _by_facets(pressure: Array, joint: Joint) -> Array:
    """Return where a criterion of the facets may be used: rough, and sigma up to the tensile strength."""
    return (pressure <= joint.tensile_strength) & (joint.area_fraction > 0)


CRITERIA = {
    "patton": Criterion(_patton, "cohesion", "asperities of one angle, overridden or sheared off as a whole"),
    "ladanyi_archambault": Criterion(
        _ladanyi_archambault, None, "asperities of one angle; the sheared share grows with the normal stress"
    ),
    "barton_choubey": Criterion(
        _barton_choubey, None, "JRC of 0.1 m profiles; normal stress of 0.01 to 0.3 of the wall strength"
    ),
    "barton_bandis": Criterion(
        _barton_bandis, "length", "as barton_choubey, with JRC and wall strength of the length of the joint"
    ),
    "grasselli_egger": Criterion(
        _grasselli_egger,
        "residual_friction_angle",
        "fresh tensile fractures; dips of facets, which depend on the spacing; a fitted residual angle",
    ),
    "xia": Criterion(
        _xia, None, "fresh mated fractures; dips of facets, which depend on the spacing of the surface"
    ),
}
