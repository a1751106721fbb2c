"""Empirical criteria of rock joints as formulas on arrays, each with its source and its range.

They were fitted to laboratory tests and serve to compare a computed joint with; nothing else in the package
depends on them. Pressures in Pa, lengths in m, angles in degrees. What could be checked against a published
text, and what could not, is listed on page `theory_joints`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.compass import check_direction
from fractalcontact.base.numbers import Array
from fractalcontact.base.validation import Problems

SAMPLE_LENGTH = 0.1  # m: the joint to which JRC and JCS of a laboratory sample refer
LARGEST_JRC = 20.0  # end of the scale of standard profiles (Barton and Choubey 1977)
POSITIVE: dict[str, Any] = {"at_least": 1e-30, "at_most": 1e30}  # ratios and powers do not overflow


def _argument(default: float = math.nan, **bounds: Any) -> Any:
    """Return a field of `Joint` that is an argument, with its bounds."""
    return field(default=default, metadata=bounds)


@dataclass(frozen=True)
class Joint:
    """What a criterion of strength may depend on; NaN where it is not known.

    The fields with bounds are arguments of `strength_envelope`, the others are measured alone.
    """

    wall_strength: float = _argument(**POSITIVE)
    basic_friction_angle: float = _argument(above=0, below=90)
    residual_friction_angle: float = _argument(above=0, below=90)
    roughness_coefficient: float = _argument(at_least=0, at_most=LARGEST_JRC)
    asperity_angle: float = _argument(at_least=0, below=90)
    tensile_strength: float = _argument(**POSITIVE)
    cohesion: float = _argument(**POSITIVE | {"at_least": 0})
    length: float = _argument(SAMPLE_LENGTH, **POSITIVE | {"at_least": SAMPLE_LENGTH})
    area_fraction: float = math.nan  # A0, C and theta_max of `directional_roughness`
    shape: float = math.nan
    theta_max: float = math.nan

    @classmethod
    def of(cls, given: Mapping[str, Any], measured: Mapping[str, Any]) -> Joint:
        """Return the joint by all its arguments, None where they are not given, and by what is measured."""
        values = {name: float(given[name]) for name in ARGUMENTS if given[name] is not None}
        defaults = {
            "tensile_strength": values["wall_strength"] / 10.0,  # of a hard rock (Hoek and Bray 1981)
            "residual_friction_angle": values["basic_friction_angle"],
        }
        return cls(**defaults | {name: value.item() for name, value in measured.items()} | values)


ARGUMENTS: dict[str, Mapping[str, Any]] = {
    entry.name: entry.metadata for entry in fields(Joint) if entry.metadata
}
# of the arguments of the functions around these formulas
BOUNDS = ARGUMENTS | {"aperture": POSITIVE, "compressive_strength": POSITIVE}

# Joint roughness coefficient of profiles


class Regression(NamedTuple):
    """JRC = offset + factor f(Z2) of readings one interval (m) apart; f is log10 without a power."""

    interval: float
    offset: float
    factor: float
    power: float | None

    def coefficient(self, slope: Any) -> Any:
        """Return JRC of a slope Z2 or of several; minus infinity for a slope of 0 under a logarithm."""
        with np.errstate(divide="ignore"):
            return self.offset + self.factor * (np.log10(slope) if self.power is None else slope**self.power)


# Tse and Cruden read the standard profiles every 1.27 mm on prints enlarged 2.5 times in both axes (Li and
# Zhang 2015, Int. J. Rock Mech. Min. Sci. 77:27), which leaves slopes as they are: 0.508 mm on the joint.
# The interval of the first one is the default lag.
REGRESSIONS = {
    "tse_cruden": (Regression(0.508e-3, 32.2, 32.47, None),),
    "yu_vayssade": (
        Regression(0.5e-3, -3.47, 61.79, 1.0),
        Regression(0.25e-3, -4.51, 60.32, 1.0),
        Regression(1e-3, -2.31, 64.22, 1.0),
    ),
    "tatone_grasselli": (Regression(0.5e-3, -10.37, 51.85, 0.60), Regression(1e-3, -6.10, 55.03, 0.74)),
}

# Shear strength

LARGEST_ANGLE = 70.0  # degree: Barton's limit of the total friction angle
# degree: JRC = 3.95 t^0.7 - 7.98 of the dip t = theta_max/(C+1) is 0, the smoothest of the standard profiles
# (Tatone and Grasselli 2010); t is the mean dip where the law of the facets is exact
SMALLEST_DIP = (7.98 / 3.95) ** (1 / 0.7)


def check_quantities(problems: Problems, *required: str, **bounds: dict[str, Any]) -> bool:
    """Check the arguments of the call that have `BOUNDS`, or others here; those required not None."""
    names = [name for name in vars(problems.given) if name in BOUNDS]
    allowed = {name: {**BOUNDS[name], **bounds.get(name, {})} for name in names}
    good = [problems.number(name, **allowed[name], optional=name not in required) for name in names]
    return all(good)


def check_measured(problems: Problems, *measures: Any) -> None:
    """Check the direction, and the surface, if any, by the checks of what is measured on it."""
    options = {"direction": problems.given.direction} if check_direction(problems) else {}
    if problems.given.surface is not None:
        for measure in measures:
            with problems.collect():
                measure.validate(problems.given.surface, **options)


def scaled_roughness(roughness: Any, length: Any) -> Any:
    """Return JRC of a longer joint, JRC0 (L/L0)^(-0.02 JRC0) (Barton and Bandis 1982)."""
    return roughness * (length / SAMPLE_LENGTH) ** (-0.02 * roughness)


def longer_joint(roughness: float, wall_strength: float, length: float) -> tuple[float, float, float]:
    """Return JRC, JCS (Pa) and displacement at the peak (m) of a length (Barton and Bandis 1982).

    JCS = JCS0 (L/L0)^(-0.03 JRC0), and the peak is at L/500 (JRC/L)^0.33. A JRC0 that is negative or not
    known counts as 0.
    """
    of_sample = float(np.fmax(roughness, 0.0))
    scaled = float(scaled_roughness(of_sample, length))
    strength = float(wall_strength * (length / SAMPLE_LENGTH) ** (-0.03 * of_sample))
    return scaled, strength, float(length / 500.0 * (scaled / length) ** 0.33)


def roughness_angle(pressure: Array, roughness: float, wall_strength: float, residual_angle: float) -> Array:
    """Return JRC log10(JCS/sigma): 0 above JCS, and not above 70 degrees with the residual angle."""
    decades = np.clip(np.log10(wall_strength) - np.log10(pressure), 0.0, None)
    return np.asarray(np.minimum(roughness * decades, max(LARGEST_ANGLE - residual_angle, 0.0)))


def mobilised_angle(relative_displacement: float, peak_angle: Array, residual_angle: float) -> Array:
    """Return the mobilised angle of the roughness at a displacement over that of the peak (Barton 1982).

    Up to 0.3 friction alone is mobilised, from 0 on; beyond, the roughness is, over that at the peak.
    """
    if relative_displacement < 0.3:
        return np.full(peak_angle.shape, -residual_angle * (1.0 - relative_displacement / 0.3))
    displacements, mobilised = (0.3, 0.6, 1.0, 2.0, 4.0, 10.0, 100.0), (0.0, 0.75, 1.0, 0.85, 0.7, 0.5, 0.0)
    return peak_angle * float(np.interp(relative_displacement, displacements, mobilised))


def damage_coefficient(pressure: Array, roughness: float, wall_strength: float) -> Array:
    """Return M = 0.7 + JRC/(12 log10(JCS/sigma)), within 1 and 2 (Barton and Choubey 1977)."""
    decades = np.log10(wall_strength) - np.log10(pressure)
    with np.errstate(divide="ignore", invalid="ignore"):
        coefficient = np.where(decades > 0, 0.7 + roughness / (12.0 * decades), 2.0)
    return np.clip(coefficient, 1.0, 2.0)


def barton_shear(
    displacement: Array,
    pressure: Array,
    joint: tuple[float, float, float],
    residual_angle: float,
    damage: float | None,
    stiffness: float,
    steps: int = 200,
) -> dict[str, Array]:
    """Return stresses, angles and dilation by mobilised roughness, shape (displacement, pressure).

    `joint` is that of `longer_joint`, `damage` M, None for that of `damage_coefficient`, `stiffness` that of
    a spring per area, Pa/m. The dilation is the integral of the tangent of its angle over `steps` up to the
    peak, and as many to the end of the mobilised roughness; with four times as many it and stresses
    against a spring of 1e11 Pa/m change by up to 7e-4.
    """
    jrc, jcs, peak = joint

    def angles(place: float, sigma: Array) -> tuple[Array, Array]:
        """Return the angles of friction and dilation (radian) at a displacement under a normal stress."""
        peak_angle = roughness_angle(sigma, jrc, jcs, residual_angle)
        mobilised = mobilised_angle(place / peak, peak_angle, residual_angle)
        by = damage or damage_coefficient(sigma, jrc, jcs)
        return np.radians(residual_angle + mobilised), np.radians(np.clip(mobilised, 0.0, None) / by)

    # steps finer than the displacements in between, whose places do not follow from the last of these
    places = np.concatenate([np.linspace(0.0, 1.0, steps + 1), np.geomspace(1.0, 100.0, steps + 1)]) * peak
    fine = np.union1d(displacement, places[places < displacement[-1]])
    sigma, opening, rise = pressure, np.zeros_like(pressure), angles(0.0, pressure)[1]
    rows, last, before = [], 0.0, rise
    for place in fine:
        start = opening
        for _ in range(2):  # the stress at the end of the step, once corrected
            friction, rise = angles(place, sigma)
            opening = start + 0.5 * (np.tan(rise) + np.tan(before)) * (place - last)
            sigma = pressure + stiffness * opening
        rows.append((sigma * np.tan(friction), sigma, np.degrees(friction), np.degrees(rise), opening))
        last, before = place, rise
    columns = np.array(rows)[np.searchsorted(fine, displacement)].transpose(1, 0, 2)
    names = ("shear_stress", "normal_stress", "friction_angle", "dilatancy_angle", "dilatancy")
    return dict(zip(names, columns, strict=True))


def patton(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength of asperities that are overridden or sheared off, whichever needs less."""
    overridden = pressure * math.tan(math.radians(joint.basic_friction_angle + joint.asperity_angle))
    sheared = joint.cohesion + pressure * math.tan(math.radians(joint.residual_friction_angle))
    return np.minimum(overridden, sheared), ~(pressure > joint.wall_strength)  # which may be unknown


def ladanyi_archambault(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength where a share of the asperities is sheared off, and the rest is overridden.

    tau = (sigma (1 - a)(v + tan phi) + a s_r)/(1 - (1 - a) v tan phi), with the strength s_r of the material
    by the parabola of Fairhurst, a = 1 - (1 - sigma/JCS)^1.5 and v = (1 - sigma/JCS)^4 tan i (1970). Above
    the wall strength the material fails.
    """
    relative = pressure / joint.wall_strength
    remaining = np.clip(1.0 - relative, 0.0, None)
    sheared = 1.0 - remaining**1.5  # a
    dilation = remaining**4.0 * math.tan(math.radians(joint.asperity_angle))  # v
    friction = math.tan(math.radians(joint.basic_friction_angle))
    ratio = joint.wall_strength / joint.tensile_strength  # n
    material = joint.wall_strength * (math.sqrt(1.0 + ratio) - 1.0) / ratio * np.sqrt(1.0 + ratio * relative)
    overridden = pressure * (1.0 - sheared) * (dilation + friction)
    strength = (overridden + sheared * material) / (1.0 - (1.0 - sheared) * dilation * friction)
    return strength, (relative <= 1.0) & (joint.asperity_angle >= SMALLEST_DIP)


def barton_choubey(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_r + JRC log10(JCS/sigma)), limited to 70 degrees; no roughness above JCS."""
    return _barton(pressure, joint, float(np.fmax(joint.roughness_coefficient, 0.0)), joint.wall_strength)


def barton_bandis(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return the strength of Barton and Choubey with JRC and JCS of the length of the joint."""
    jrc, jcs, _ = longer_joint(joint.roughness_coefficient, joint.wall_strength, joint.length)
    return _barton(pressure, joint, jrc, jcs)


def _barton(pressure: Array, joint: Joint, roughness: float, wall_strength: float) -> tuple[Array, Array]:
    residual_angle = joint.residual_friction_angle
    angle = residual_angle + roughness_angle(pressure, roughness, wall_strength, residual_angle)
    inside = in_tested_range(pressure, wall_strength, joint.roughness_coefficient) & (angle < LARGEST_ANGLE)
    return pressure * np.tan(np.radians(angle)), inside


def in_tested_range(pressure: Array, wall_strength: float, roughness: float) -> Array:
    """Return where a stress and a JRC are among those of the tests of Barton and Choubey (1977).

    They were made at 0.01 to 0.3 of the wall strength.
    """
    relative = pressure / wall_strength
    return np.asarray((relative >= 0.01) & (relative <= 0.3) & (0.0 <= roughness <= LARGEST_JRC))


def grasselli_egger(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_r') [1 + exp(-theta_max sigma/(9 A0 C sigma_t))], with a fitted angle phi_r'."""
    facets = joint.area_fraction * joint.shape  # NaN where no facet faces the shear
    decay = joint.theta_max / (9.0 * facets) if facets > 0 else math.inf
    with np.errstate(under="ignore"):
        share = np.exp(-decay * pressure / joint.tensile_strength)
    strength = pressure * math.tan(math.radians(joint.residual_friction_angle)) * (1.0 + share)
    return strength, _by_facets(pressure, joint)


def xia(pressure: Array, joint: Joint) -> tuple[Array, Array]:
    """Return sigma tan(phi_b + 4 A0 t [1 + exp(-t sigma/(9 A0 sigma_t))]), t = theta_max/(C + 1), degree."""
    if joint.area_fraction == 0:
        return pressure * math.tan(math.radians(joint.basic_friction_angle)), _by_facets(pressure, joint)
    metric = joint.theta_max / (joint.shape + 1.0)
    with np.errstate(under="ignore"):
        share = np.exp(-metric / (9.0 * joint.area_fraction) * pressure / joint.tensile_strength)
    angle = joint.basic_friction_angle + 4.0 * joint.area_fraction * metric * (1.0 + share)
    possible = angle < 90.0
    strength = pressure * np.tan(np.radians(np.where(possible, angle, np.nan)))
    # A0 of the joints of Xia et al. is near one half. The factor 4 A0 is 2 there and 20 % off at the bounds;
    # on saw teeth of A0 = .77 the criterion gives 77 degrees where Patton has 35.
    inside = possible & (angle <= LARGEST_ANGLE) & (0.4 <= joint.area_fraction <= 0.6)
    return strength, _by_facets(pressure, joint) & inside


def _by_facets(pressure: Array, joint: Joint) -> Array:
    """Return where a criterion of the facets may be used: rough, and sigma up to the tensile strength."""
    dip = joint.theta_max / (joint.shape + 1.0)  # NaN where no facet faces the shear
    return (pressure <= joint.tensile_strength) & (dip >= SMALLEST_DIP)


class Criterion(NamedTuple):
    """Strength with its range, the arguments of `strength_envelope` that it needs, and what it assumes."""

    strength: Callable[[Array, Joint], tuple[Array, Array]]
    needs: tuple[str, ...]
    assumption: str


STRENGTH = {
    "patton": Criterion(
        patton,
        ("asperity_angle", "cohesion"),
        "asperities of one angle, overridden or sheared off as a whole",
    ),
    "ladanyi_archambault": Criterion(
        ladanyi_archambault,
        ("asperity_angle",),
        "asperities of one angle; the sheared share grows with the normal stress",
    ),
    "barton_choubey": Criterion(
        barton_choubey,
        ("roughness_coefficient",),
        "JRC of 0.1 m profiles; normal stress of 0.01 to 0.3 of the wall strength",
    ),
    "barton_bandis": Criterion(
        barton_bandis,
        ("roughness_coefficient", "length"),
        "as barton_choubey, with JRC and wall strength of the length of the joint",
    ),
    "grasselli_egger": Criterion(
        grasselli_egger,
        ("surface", "residual_friction_angle"),
        "fresh tensile fractures; dips of facets, which depend on the spacing; a fitted residual angle",
    ),
    "xia": Criterion(
        xia, ("surface",), "fresh mated fractures; dips of facets, which depend on the spacing of the surface"
    ),
}
STRENGTH_REFERENCES = (
    "Patton (1966), 1st ISRM Congress 1:509; Ladanyi and Archambault (1970), 11th US Symposium on Rock "
    "Mechanics; Barton and Choubey (1977), Rock Mechanics 10:1; Barton and Bandis (1982), 23rd US Symposium "
    "on Rock Mechanics; Grasselli and Egger (2003), Int. J. Rock Mech. Min. Sci. 40:25; Xia, Tang, Xiao and "
    "Song (2014), Rock Mech. Rock Eng. 47:387"
)

# Closure

# A, B, C, D of Vm = A + B JRC + C (JCS/a)^D, mm and MPa, by cycle of load (Bandis, Lumsden and Barton 1983).
# The third row, the formulas of the aperture and of the stiffness and their ranges are those of the MATLAB
# Reservoir Simulation Toolbox (bartonBandis.m); no text was found to compare the first two rows with.
CLOSURE_FITS = {
    1: (-0.2960, -0.0056, 2.2410, -0.2450),
    2: (-0.1005, -0.0073, 1.0082, -0.2301),
    3: (-0.1032, -0.0074, 1.1350, -0.2510),
}


def bandis_constants(
    roughness_coefficient: float,
    wall_strength: float,
    compressive_strength: float | None,
    aperture: float | None,
    cycle: int,
) -> tuple[float, float, float]:
    """Return aperture a under no load (m), Kni (Pa/m) and Vm (m) of a cycle (Bandis et al. 1983).

    In mm and MPa a = JRC/5 (0.2 UCS/JCS - 0.1), if not given, Kni = -7.15 + 1.75 JRC + 0.02 JCS/a, and Vm as
    above; the last two NaN for a joint that is closed.
    """
    mpa, mm = 1e6, 1e-3
    jrc, jcs = float(roughness_coefficient), float(wall_strength)
    if aperture is None:
        strengths = float(compressive_strength or jcs) / jcs
        aperture = jrc / 5 * (0.2 * strengths - 0.1) * mm
    aperture = float(aperture)
    if not aperture > 0:  # without roughness
        return aperture, math.nan, math.nan
    stiffness = (-7.15 + 1.75 * jrc + 0.02 * (jcs / mpa) / (aperture / mm)) * (mpa / mm)
    a, b, c, d = CLOSURE_FITS[int(cycle)]
    return aperture, stiffness, (a + b * jrc + c * ((jcs / mpa) / (aperture / mm)) ** d) * mm


def hyperbolic_closure(pressure: Array, initial_stiffness: float, greatest_closure: float) -> Array:
    """Return the closure sigma Vm/(Kni Vm + sigma) (Bandis, Lumsden and Barton 1983)."""
    return np.asarray(pressure * greatest_closure / (initial_stiffness * greatest_closure + pressure))


# Hydraulic aperture e of a joint from its mechanical aperture E


def barton_aperture(aperture: Any, roughness_coefficient: Any) -> Any:
    """Return e = E^2/JRC^2.5 in micrometres, at most E (Barton, Bandis and Bakhtar 1985)."""
    return aperture * np.minimum(aperture / (roughness_coefficient**2.5 * 1e-6), 1.0)


def lognormal_aperture(aperture: Any, spread: Any) -> Any:
    """Return e = E/sqrt(1 + s^2/E^2), exact in the mean for lognormal apertures (Renshaw 1995)."""
    return aperture / np.sqrt(1 + (spread / aperture) ** 2)


def zimmerman_bodvarsson_aperture(aperture: Any, spread: Any, contact_fraction: Any) -> Any:
    """Return e with e^3 = E^3 (1 - 1.5 s^2/E^2)(1 - 2 c) (Zimmerman and Bodvarsson 1996)."""
    return aperture * np.cbrt((1 - 1.5 * (spread / aperture) ** 2) * (1 - 2 * contact_fraction))


def walsh_aperture(aperture: Any, contact_fraction: Any) -> Any:
    """Return e with e^3 = E^3 (1 - c)/(1 + c): plates with few round spots of contact (Walsh 1981)."""
    return aperture * np.cbrt((1 - contact_fraction) / (1 + contact_fraction))


class ApertureModel(NamedTuple):
    """Formula of the hydraulic aperture and the arguments it takes beside the mechanical one."""

    formula: Callable[..., Any]
    needs: tuple[str, ...]


HYDRAULIC_APERTURE = {
    "barton_bandis": ApertureModel(barton_aperture, ("roughness_coefficient",)),
    "lognormal": ApertureModel(lognormal_aperture, ("spread",)),
    "zimmerman_bodvarsson": ApertureModel(zimmerman_bodvarsson_aperture, ("spread", "contact_fraction")),
    "walsh": ApertureModel(walsh_aperture, ("contact_fraction",)),
}

# Size effect


def size_factors(ratio: Array, contact_dimension: float, roughness_dimension: float) -> dict[str, Array]:
    """Return the factors of strength, friction and fracture energy (Carpinteri and Paggi 2009)."""
    return {
        "strength_factor": ratio ** (contact_dimension - 2.0),
        "friction_factor": ratio ** (contact_dimension - roughness_dimension),
        "fracture_energy_factor": ratio ** (contact_dimension - 1.0),
    }
