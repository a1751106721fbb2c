"""Empirical criteria of strength and size effect for concrete and rock joints.

They were fitted to laboratory tests and serve to compare a computed joint with; nothing else in the package
uses them. Pressures in Pa, lengths in m, angles in degrees.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.validation import Problems

Array = np.ndarray[Any, np.dtype[Any]]

PARK_PAULAY = {"monolithic": 1.4, "against hardened concrete": 1.0}
"""Friction coefficients of concrete on concrete (Park and Paulay 1975, Reinforced Concrete Structures)."""

LARGEST = 1e100  # products and powers of such numbers do not overflow


class JointConstants(NamedTuple):
    """Roughness coefficient JRC, wall strength JCS (Pa) and shear at peak strength (m) of a joint."""

    roughness: float
    wall_strength: float
    peak_shear: float


class SizeEffect(NamedTuple):
    """Factors by which shear strength, friction coefficient and fracture energy change with size."""

    strength: float
    friction: float
    fracture_energy: float


def barton_choubey_strength(
    nominal_pressure: float | Array, *, roughness: float, wall_strength: float, residual_angle: float
) -> Array:
    """Return the peak shear strength of a rock joint after Barton and Choubey.

    tau = sigma tan(phi_r + JRC log10(JCS / sigma)), in Pa.

    Parameters
    ----------
    nominal_pressure : float or ndarray
        Normal stress sigma, Pa, above 0.
    roughness : float
        Joint roughness coefficient JRC, 0 to 20.
    wall_strength : float
        Joint wall compressive strength JCS, Pa.
    residual_angle : float
        Residual friction angle phi_r, degree.

    Returns
    -------
    ndarray
        Shear strength tau in Pa, of the shape of `nominal_pressure`.

    Raises
    ------
    InvalidInput
        A number is outside its bounds, or the friction angle reaches 90 degrees.

    Notes
    -----
    Fitted to tests at sigma / JCS of about 0.01 to 0.3. Far below that range the logarithm and the strength
    grow without bound; above JCS the roughness lowers the strength.

    References
    ----------
    Barton and Choubey (1977), Rock Mechanics 10:1.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> strength = fc.joints.barton_choubey_strength(
    ...     1e6, roughness=10, wall_strength=100e6, residual_angle=25
    ... )
    >>> round(float(strength) / 1e6, 3)  # 1 MPa times tan(25 + 10 * 2 degrees)
    1.0
    """
    with Problems("fractalcontact.joints.barton_choubey_strength") as problems:
        problems.numbers("nominal_pressure", nominal_pressure, above=0, at_most=LARGEST, any_shape=True)
        problems.number("roughness", roughness, at_least=0, at_most=20)
        problems.number("wall_strength", wall_strength, above=0, at_most=LARGEST)
        problems.number("residual_angle", residual_angle, at_least=0, below=90)
        if not problems.messages:
            pressure = np.asarray(nominal_pressure, dtype=np.float64)
            jrc, jcs, phi_r = float(roughness), float(wall_strength), float(residual_angle)
            angle = phi_r + jrc * (np.log10(jcs) - np.log10(pressure))
            smallest = jcs * 10.0 ** ((phi_r - 90.0) / jrc) if jrc else 0.0
            problems.require(
                bool(((angle > -90.0) & (angle < 90.0)).all()),
                "nominal_pressure",
                f"above {smallest:.3g} Pa, where the friction angle of the law reaches 90 degrees",
                nominal_pressure,
            )
    return np.asarray(pressure * np.tan(np.radians(angle)))


def barton_bandis_scaled(roughness: float, wall_strength: float, length: float) -> JointConstants:
    """Scale the constants of a 0.1 m sample to a longer joint after Barton and Bandis.

    JRC = JRC0 (L/L0)^(-0.02 JRC0), JCS = JCS0 (L/L0)^(-0.03 JRC0), peak shear L/500 (JRC/L)^0.33.

    Parameters
    ----------
    roughness, wall_strength : float
        JRC and JCS (Pa) of the sample.
    length : float
        Length of the joint, m.

    Returns
    -------
    JointConstants
        JRC, JCS (Pa) and the shear at peak strength (m) of the joint.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Barton and Bandis (1982), 23rd US Symposium on Rock Mechanics.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> constants = fc.joints.barton_bandis_scaled(roughness=10, wall_strength=50e6, length=1.0)
    >>> round(constants.roughness, 2), round(constants.wall_strength / 1e6, 1)
    (6.31, 25.1)
    """
    with Problems("fractalcontact.joints.barton_bandis_scaled") as problems:
        problems.number("roughness", roughness, above=0, at_most=20)
        problems.number("wall_strength", wall_strength, above=0, at_most=LARGEST)
        problems.number("length", length, above=0, at_most=LARGEST)
    return scaled_constants(float(roughness), float(wall_strength), float(length))


def scaled_constants(roughness: float, wall_strength: float, length: float) -> JointConstants:
    """Return `barton_bandis_scaled` of numbers that need no check; a smooth joint slides at once."""
    ratio = length / 0.1
    scaled = roughness * ratio ** (-0.02 * roughness)
    strength = wall_strength * ratio ** (-0.03 * roughness)
    return JointConstants(scaled, strength, length / 500.0 * (scaled / length) ** 0.33)


def self_weight_strength(length: float | Array, *, unit_weight: float, friction_angle: float) -> Array:
    """Return the shear strength of a joint under the weight of the structure above it, in Pa.

    Similar structures of size L load their joint with gamma L, so that tau = gamma L tan(phi) grows with the
    size: friction stabilises large structures more than small ones.

    Parameters
    ----------
    length : float or ndarray
        Size L of the structure: the height of material over the joint, m.
    unit_weight : float
        Weight per volume gamma, N/m3; 24e3 for concrete.
    friction_angle : float
        Degree, 0 to 90.

    Returns
    -------
    ndarray
        Shear strength in Pa, of the shape of `length`.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 1.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> strength = fc.joints.self_weight_strength(10.0, unit_weight=24e3, friction_angle=45)
    >>> round(float(strength) / 1e3)
    240
    """
    with Problems("fractalcontact.joints.self_weight_strength") as problems:
        problems.numbers("length", length, above=0, at_most=LARGEST, any_shape=True)
        problems.number("unit_weight", unit_weight, above=0, at_most=LARGEST)
        problems.number("friction_angle", friction_angle, at_least=0, below=90)
    tangent = np.tan(np.radians(float(friction_angle)))
    return np.asarray(float(unit_weight) * np.asarray(length, dtype=np.float64) * tangent)


def size_effect(scale: float, *, contact_dimension: float, roughness_dimension: float = 2.0) -> SizeEffect:
    """Return the factors by which the strength of a joint changes when its size changes by `scale`.

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

    Returns
    -------
    SizeEffect
        Factors of shear strength, friction coefficient and fracture energy.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Carpinteri and Paggi (2009), Chaos, Solitons and Fractals 39:540; Borri-Brunetto, Carpinteri and Chiaia
    (1999), Int. J. Fracture 95:221.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> factors = fc.joints.size_effect(4.0, contact_dimension=1.5)
    >>> factors.strength, factors.fracture_energy
    (0.5, 2.0)
    """
    with Problems("fractalcontact.joints.size_effect") as problems:
        problems.number("scale", scale, above=0, at_least=1 / LARGEST, at_most=LARGEST)
        is_number = problems.number("contact_dimension", contact_dimension, at_least=0, at_most=2)
        lowest = float(contact_dimension) if is_number else 0.0
        problems.number("roughness_dimension", roughness_dimension, at_least=lowest, at_most=2)
    ratio, d_s, d_r = float(scale), float(contact_dimension), float(roughness_dimension)
    return SizeEffect(ratio ** (d_s - 2.0), ratio ** (d_s - d_r), ratio ** (d_s - 1.0))
