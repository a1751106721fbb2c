"""Named laws of concrete and rock joints, to compare a computed joint with.

They were fitted to tests and describe; nothing else in the package is built on them. Pressures in Pa,
lengths in m, angles in degrees; the fits themselves are in MPa and mm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.checks import Problems

Array = np.ndarray[Any, np.dtype[Any]]

PARK_PAULAY = {"monolithic": 1.4, "against hardened concrete": 1.0}
"""Friction coefficients of concrete on concrete (Park and Paulay 1975, Reinforced Concrete Structures)."""

MPA, MM = 1e6, 1e-3
GREATEST = 1e100  # of any size: products and powers of such numbers are numbers


class JointConstants(NamedTuple):
    """Roughness coefficient JRC, wall strength JCS (Pa) and shear at peak strength (m) of a joint."""

    roughness: float
    wall_strength: float
    peak_shear: float


class ClosureConstants(NamedTuple):
    """Initial normal stiffness (Pa m-1) and greatest closure (m) of a joint."""

    initial_stiffness: float
    greatest_closure: float


class SizeEffect(NamedTuple):
    """Factors by which shear strength, friction coefficient and fracture energy change with size."""

    strength: float
    friction: float
    fracture_energy: float


def barton_choubey_strength(
    nominal_pressure: float | Array, *, roughness: float, wall_strength: float, residual_angle: float
) -> Array:
    """Return the peak shear strength of a rock joint, sigma tan(phi_r + JRC log10(JCS / sigma)), in Pa.

    Parameters
    ----------
    nominal_pressure : float or ndarray
        Normal stress sigma, Pa, above 0.
    roughness : float
        Joint roughness coefficient JRC, 0 to 20.
    wall_strength : float
        Joint wall compressive strength JCS, Pa.
    residual_angle : float
        Residual friction angle, degree.

    Raises
    ------
    InvalidInput
        A number is outside its bounds, or the angle reaches 90 degrees.

    Notes
    -----
    Fitted to tests at sigma / JCS of about 0.01 to 0.3. Far below, the logarithm grows without bound and the
    strength with it; above JCS it takes the roughness below zero.

    References
    ----------
    Barton and Choubey (1977), Rock Mechanics 10:1.
    """
    with Problems("fractalcontact.joints.barton_choubey_strength") as problems:
        problems.numbers("nominal_pressure", np.ravel(nominal_pressure), above=0, at_most=GREATEST)
        roughness = problems.number("roughness", roughness, at_least=0, at_most=20)
        wall_strength = problems.number("wall_strength", wall_strength, above=0, at_most=GREATEST)
        residual_angle = problems.number("residual_angle", residual_angle, at_least=0, below=90)
        if not problems.found:
            pressure = np.asarray(nominal_pressure, dtype=np.float64)
            angle = residual_angle + roughness * (np.log10(wall_strength) - np.log10(pressure))
            least = wall_strength * 10.0 ** ((residual_angle - 90.0) / roughness) if roughness else 0.0
            expected = f"above {least:.3g} Pa, where the friction angle of the law reaches 90 degrees"
            problems.require(
                bool(((angle > -90.0) & (angle < 90.0)).all()), "nominal_pressure", expected, nominal_pressure
            )
    return np.asarray(pressure * np.tan(np.radians(angle)))


def barton_bandis_scaled(roughness: float, wall_strength: float, length: float) -> JointConstants:
    """Return the constants of a joint of some length from those of a sample of 0.1 m.

    JRC = JRC0 (L/L0)^(-0.02 JRC0), JCS = JCS0 (L/L0)^(-0.03 JRC0), peak shear L/500 (JRC/L)^(1/3).

    Parameters
    ----------
    roughness, wall_strength : float
        JRC and JCS (Pa) of the sample.
    length : float
        Length of the joint, m.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Barton and Bandis (1982), 23rd US Symposium on Rock Mechanics.
    """
    with Problems("fractalcontact.joints.barton_bandis_scaled") as problems:
        roughness = problems.number("roughness", roughness, above=0, at_most=20)
        wall_strength = problems.number("wall_strength", wall_strength, above=0, at_most=GREATEST)
        length = problems.number("length", length, above=0, at_most=GREATEST)
    ratio = length / 0.1
    scaled = roughness * ratio ** (-0.02 * roughness)
    strength = wall_strength * ratio ** (-0.03 * roughness)
    return JointConstants(scaled, strength, length / 500.0 * (scaled / length) ** (1.0 / 3.0))


def bandis_constants(roughness: float, wall_strength: float, aperture: float) -> ClosureConstants:
    """Return initial stiffness and greatest closure of a joint in its first cycle of load.

    Kni = -7.15 + 1.75 JRC + 0.02 JCS/a and Vm = -0.2960 - 0.0056 JRC + 2.2410 (JCS/a)^-0.2450, in MPa and mm.

    Parameters
    ----------
    roughness, wall_strength : float
        JRC and JCS (Pa).
    aperture : float
        Initial mechanical aperture a, m.

    Raises
    ------
    InvalidInput
        A number is outside its bounds, or the fit gives no positive stiffness or closure for them.

    References
    ----------
    Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249.
    """
    with Problems("fractalcontact.joints.bandis_constants") as problems:
        roughness = problems.number("roughness", roughness, at_least=0, at_most=20)
        wall_strength = problems.number("wall_strength", wall_strength, above=0, at_most=GREATEST)
        aperture = problems.number("aperture", aperture, above=0, at_most=GREATEST)
        if not problems.found:
            stress = (wall_strength / MPA) / (aperture / MM)
            stiffness = -7.15 + 1.75 * roughness + 0.02 * stress
            closure = -0.2960 - 0.0056 * roughness + (2.2410 * stress**-0.2450 if stress > 0 else -1.0)
            inside = stiffness > 0 and closure > 0
            got = f"{stiffness:.3g} MPa/mm and {closure:.3g} mm"
            problems.require(
                inside, "roughness, wall_strength, aperture", "values inside the range of the fit", got
            )
    return ClosureConstants(stiffness * MPA / MM, closure * MM)


def bandis_closure(
    nominal_pressure: float | Array, *, initial_stiffness: float, greatest_closure: float
) -> Array:
    """Return the hyperbolic closure sigma Vm / (Kni Vm + sigma) of a joint, in m.

    Elastic half-spaces close by the logarithm of the pressure instead: a fit of this law to a computed
    closure describes it, and proves nothing.

    Parameters
    ----------
    nominal_pressure : float or ndarray
        Normal stress sigma, Pa, at least 0.
    initial_stiffness, greatest_closure : float
        Kni (Pa m-1) and Vm (m), see `bandis_constants`.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249.
    """
    with Problems("fractalcontact.joints.bandis_closure") as problems:
        problems.numbers("nominal_pressure", np.ravel(nominal_pressure), at_least=0, at_most=GREATEST)
        initial_stiffness = problems.number("initial_stiffness", initial_stiffness, above=0, at_most=GREATEST)
        greatest_closure = problems.number("greatest_closure", greatest_closure, above=0, at_most=GREATEST)
    pressure = np.asarray(nominal_pressure, dtype=np.float64)
    return np.asarray(pressure * greatest_closure / (initial_stiffness * greatest_closure + pressure))


def self_weight_strength(length: float | Array, *, unit_weight: float, friction_angle: float) -> Array:
    """Return the shear strength of a joint under the weight of what stands on it, in Pa.

    Similar structures of size L press on their joint with gamma L, so that tau = gamma L tan(phi) grows with
    the size: friction stabilises large structures more than small ones.

    Parameters
    ----------
    length : float or ndarray
        Size L of the structure: the height of material over the joint, m.
    unit_weight : float
        Weight per volume gamma, N/m3; 24e3 for concrete.
    friction_angle : float
        Degree, 0 to 90.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 1.
    """
    with Problems("fractalcontact.joints.self_weight_strength") as problems:
        problems.numbers("length", np.ravel(length), above=0, at_most=GREATEST)
        unit_weight = problems.number("unit_weight", unit_weight, above=0, at_most=GREATEST)
        friction_angle = problems.number("friction_angle", friction_angle, at_least=0, below=90)
    tangent = np.tan(np.radians(friction_angle))
    return np.asarray(unit_weight * np.asarray(length, dtype=np.float64) * tangent)


def size_effect(scale: float, *, contact_dimension: float, roughness_dimension: float = 2.0) -> SizeEffect:
    """Return the change of the strength of a joint when its size grows by a factor.

    With a contact domain of dimension D_s and a rough surface whose resistant section has the dimension D_r:
    shear strength ~ size^(D_s - 2), friction coefficient ~ size^(D_s - D_r), fracture energy
    ~ size^(D_s - 1).

    Parameters
    ----------
    scale : float
        Ratio of the sizes, above 0.
    contact_dimension : float
        D_s, 0 to 2, for example the box dimension of the contact domain at a stated scale.
    roughness_dimension : float
        D_r, contact_dimension to 2.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Carpinteri and Paggi (2009), Chaos, Solitons and Fractals 39:540; Borri-Brunetto, Carpinteri and Chiaia
    (1999), Int. J. Fracture 95:221.
    """
    with Problems("fractalcontact.joints.size_effect") as problems:
        scale = problems.number("scale", scale, above=0, at_least=1 / GREATEST, at_most=GREATEST)
        contact = problems.number("contact_dimension", contact_dimension, at_least=0, at_most=2)
        problems.number("roughness_dimension", roughness_dimension, at_least=contact, at_most=2)
    return SizeEffect(
        scale ** (contact_dimension - 2.0),
        scale ** (contact_dimension - roughness_dimension),
        scale ** (contact_dimension - 1.0),
    )
