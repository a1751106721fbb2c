"""Empirical closure of rock joints after Barton and Bandis, and hydraulic from mechanical aperture.

They were fitted to laboratory tests and serve to compare a computed joint with. Pressures in Pa, lengths in
m; the published fits are in MPa, mm and micrometres.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fractalcontact.base.validation import Problems

Array = np.ndarray[Any, np.dtype[Any]]

MPA, MM, MICRON = 1e6, 1e-3, 1e-6
LARGEST = 1e100  # products and powers of such numbers do not overflow
# A, B, C, D of Vm = A + B JRC + C (JCS/a)^D, mm and MPa, by cycle of load (Bandis, Lumsden and Barton 1983).
# The third row, the formulas of the aperture and of the stiffness and their ranges are those of the MATLAB
# Reservoir Simulation Toolbox (bartonBandis.m); no text was found to compare the first two rows with.
CLOSURE_FITS = {
    1: (-0.2960, -0.0056, 2.2410, -0.2450),
    2: (-0.1005, -0.0073, 1.0082, -0.2301),
    3: (-0.1032, -0.0074, 1.1350, -0.2510),
}
MODELS = ("barton_bandis", "lognormal", "zimmerman_bodvarsson", "walsh")
NEEDS = {
    "barton_bandis": ("roughness",),
    "lognormal": ("spread",),
    "zimmerman_bodvarsson": ("spread", "contact_fraction"),
    "walsh": ("contact_fraction",),
}
# s/E of the open part up to which its series is used: the next term, 1.9 (s/E)^4, is then 12 % of E^3
GREATEST_VARIATION = 0.5
GREATEST_CONTACT = (
    0.25  # few spots; the next term of the series of (1 - c)/(1 + c), 2 c^2, is then 13 % of E^3
)


class ClosureConstants(NamedTuple):
    """Initial normal stiffness (Pa m-1) and greatest closure (m) of a joint."""

    initial_stiffness: float
    greatest_closure: float


def bandis_aperture(roughness: float, wall_strength: float, compressive_strength: float) -> float:
    """Return the initial mechanical aperture of a joint under no load after Barton and Bandis, in m.

    a = JRC/5 (0.2 UCS/JCS - 0.1) mm.

    Parameters
    ----------
    roughness : float
        Joint roughness coefficient JRC, above 0 to 20.
    wall_strength, compressive_strength : float
        JCS of the walls and UCS of the intact rock, Pa; walls are weathered, so that JCS is at most UCS.

    Returns
    -------
    float
        Aperture, m.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    Notes
    -----
    The fits that use it were made for apertures of 0.1 to 0.6 mm.

    References
    ----------
    Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249; Barton, Bandis and Bakhtar (1985),
    Int. J. Rock Mech. Min. Sci. 22:121.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> apertures = [fc.joints.bandis_aperture(10, 50e6, strength) for strength in (50e6, 100e6)]
    >>> [round(aperture * 1e3, 3) for aperture in apertures]
    [0.2, 0.6]
    """
    with Problems("fractalcontact.joints.bandis_aperture") as problems:
        problems.number("roughness", roughness, above=0, at_most=20)
        problems.number("compressive_strength", compressive_strength, above=0, at_most=LARGEST)
        if (
            problems.number("wall_strength", wall_strength, above=1 / LARGEST, at_most=LARGEST)
            and not problems.messages
        ):
            weakest = bool(float(wall_strength) <= float(compressive_strength))
            problems.require(weakest, "wall_strength", "at most compressive_strength", wall_strength)
    ratio = float(compressive_strength) / float(wall_strength)
    return float(roughness) / 5 * (0.2 * ratio - 0.1) * MM


def bandis_constants(
    roughness: float, wall_strength: float, aperture: float, *, cycle: int = 1
) -> ClosureConstants:
    """Return initial stiffness and greatest closure of a joint after Bandis, by cycle of load.

    Kni = -7.15 + 1.75 JRC + 0.02 JCS/a and Vm = A + B JRC + C (JCS/a)^D, in MPa and mm. In the first cycle A,
    B, C, D are -0.2960, -0.0056, 2.2410, -0.2450; in the second -0.1005, -0.0073, 1.0082, -0.2301; in the
    third -0.1032, -0.0074, 1.1350, -0.2510, taken for the state of rock in place.

    Parameters
    ----------
    roughness, wall_strength : float
        JRC and JCS (Pa).
    aperture : float
        Initial mechanical aperture a, m, see `bandis_aperture`.
    cycle : {1, 2, 3}
        Cycle of load.

    Returns
    -------
    ClosureConstants
        Kni (Pa/m) and Vm (m).

    Raises
    ------
    InvalidInput
        A number is outside its bounds, or the fit gives no positive stiffness or closure for them, or a
        closure of more than the aperture.

    Notes
    -----
    Fitted to joints with JRC of 5 to 15, JCS of 22 to 182 MPa and apertures of 0.1 to 0.6 mm. The constants
    scatter: those of the third cycle by 0.068, 0.0039, 0.33 and 0.10.

    References
    ----------
    Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> constants = fc.joints.bandis_constants(roughness=10, wall_strength=100e6, aperture=0.2e-3)
    >>> round(constants.initial_stiffness / 1e9, 2), round(constants.greatest_closure * 1e3, 3)
    (20.35, 0.137)
    """
    with Problems("fractalcontact.joints.bandis_constants") as problems:
        problems.number("roughness", roughness, at_least=0, at_most=20)
        problems.number("wall_strength", wall_strength, above=1 / LARGEST, at_most=LARGEST)
        problems.number("aperture", aperture, above=0, at_most=LARGEST)
        problems.integer("cycle", cycle, at_least=1, at_most=len(CLOSURE_FITS))
        if not problems.messages:
            jrc = float(roughness)
            stress = (float(wall_strength) / MPA) / (float(aperture) / MM)
            a, b, c, d = CLOSURE_FITS[int(cycle)]
            stiffness = -7.15 + 1.75 * jrc + 0.02 * stress
            closure = a + b * jrc + (c * stress**d if stress > 0 else -1.0)
            problems.require(
                stiffness > 0 and 0 < closure <= float(aperture) / MM,
                "roughness, wall_strength, aperture",
                "values inside the range of the fit",
                f"{stiffness:.3g} MPa/mm and {closure:.3g} mm",
            )
    return ClosureConstants(stiffness * MPA / MM, closure * MM)


def bandis_closure(
    nominal_pressure: float | Array, *, initial_stiffness: float, greatest_closure: float
) -> Array:
    """Return the hyperbolic closure of a rock joint after Bandis, sigma Vm / (Kni Vm + sigma), in m.

    Elastic half-spaces close with the logarithm of the pressure instead. The hyperbola can be fitted to a
    computed elastic closure, but that does not confirm it.

    Parameters
    ----------
    nominal_pressure : float or ndarray
        Normal stress sigma, Pa, at least 0.
    initial_stiffness, greatest_closure : float
        Kni (Pa m-1) and Vm (m), see `bandis_constants`.

    Returns
    -------
    ndarray
        Closure in m, of the shape of `nominal_pressure`.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    References
    ----------
    Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> closure = fc.joints.bandis_closure(2e6, initial_stiffness=20e9, greatest_closure=1e-4)
    >>> round(float(closure) * 1e6, 1)  # half of the greatest closure at sigma = Kni Vm
    50.0
    """
    with Problems("fractalcontact.joints.bandis_closure") as problems:
        problems.numbers("nominal_pressure", nominal_pressure, at_least=0, at_most=LARGEST, any_shape=True)
        problems.number("initial_stiffness", initial_stiffness, above=0, at_most=LARGEST)
        problems.number("greatest_closure", greatest_closure, above=0, at_most=LARGEST)
    kni, vm = float(initial_stiffness), float(greatest_closure)
    pressure = np.asarray(nominal_pressure, dtype=np.float64)
    return np.asarray(pressure * vm / (kni * vm + pressure))


def hydraulic_aperture(
    aperture: float | Array,
    *,
    model: str = "barton_bandis",
    roughness: float | None = None,
    spread: float | Array | None = None,
    contact_fraction: float | Array | None = None,
) -> Array:
    """Return the hydraulic aperture e of a joint from its mechanical aperture E by a published relation.

    For a joint that is known by a few numbers only. Where the gap is known cell by cell, solve the flow:
    `transmissivity`.

    Parameters
    ----------
    aperture : float or ndarray
        Mean mechanical aperture E, m; of "zimmerman_bodvarsson" and "lognormal" that of the open part.
    model : {"barton_bandis", "lognormal", "zimmerman_bodvarsson", "walsh"}
        e = E^2/JRC^2.5 in micrometres, at most E (Barton, Bandis and Bakhtar 1985);
        e = E/sqrt(1 + s^2/E^2), exact in the mean for lognormal apertures (Renshaw 1995);
        e^3 = E^3 (1 - 1.5 s^2/E^2)(1 - 2 c) (Zimmerman and Bodvarsson 1996);
        e^3 = E^3 (1 - c)/(1 + c), plates with few round spots of contact (Walsh 1981).
    roughness : float, optional
        Joint roughness coefficient JRC, above 0 to 20; for "barton_bandis" alone.
    spread : float or ndarray, optional
        Standard deviation s of the aperture of the open part, m; for "lognormal" and "zimmerman_bodvarsson".
    contact_fraction : float or ndarray, optional
        Share c of the area in contact, for "zimmerman_bodvarsson" and "walsh".

    Returns
    -------
    ndarray
        Hydraulic aperture, m, of the shape of the arguments together; its cube over 12 is the transmissivity.

    Raises
    ------
    InvalidInput
        An argument is outside its bounds, does not belong to the model or is missing. Bounds: c up to 0.25
        in both models that take it; s up to E/2 for "zimmerman_bodvarsson", a series, the next term of which
        is then about 12 % of E^3.

    References
    ----------
    Barton, Bandis and Bakhtar (1985), Int. J. Rock Mech. Min. Sci. 22:121; Renshaw (1995), J. Geophys. Res.
    100:24629; Zimmerman and Bodvarsson (1996), Transp. Porous Media 23:1; Walsh (1981), Int. J. Rock Mech.
    Min. Sci. 18:429.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> apertures = fc.joints.hydraulic_aperture([200e-6, 500e-6], roughness=10)
    >>> (apertures * 1e6).round(1).tolist()  # rough plates alike from 10^2.5 = 316 micrometres on
    [126.5, 500.0]
    """
    given = {"roughness": roughness, "spread": spread, "contact_fraction": contact_fraction}
    _check_hydraulic(aperture, model, given)
    mechanical = np.asarray(aperture, dtype=np.float64)
    if model == "barton_bandis":
        assert roughness is not None
        limit = float(roughness) ** 2.5 * MICRON  # at and beyond which e = E
        ratio = np.divide(mechanical, limit, out=np.ones_like(mechanical), where=mechanical < limit)
        return np.asarray(mechanical * ratio)
    variation = np.zeros(()) if spread is None else (np.asarray(spread, dtype=np.float64) / mechanical) ** 2
    closed = np.zeros(()) if contact_fraction is None else np.asarray(contact_fraction, dtype=np.float64)
    if model == "lognormal":
        return np.asarray(mechanical / np.sqrt(1 + variation))
    if model == "walsh":
        return np.asarray(mechanical * np.cbrt((1 - closed) / (1 + closed)))
    return np.asarray(mechanical * np.cbrt((1 - 1.5 * variation) * (1 - 2 * closed)))


def _check_hydraulic(aperture: Any, model: Any, given: dict[str, Any]) -> None:
    """Check the arguments of `hydraulic_aperture`, and that they are those of the model."""
    with Problems("fractalcontact.joints.hydraulic_aperture") as problems:
        positive = problems.numbers("aperture", aperture, above=1 / LARGEST, at_most=LARGEST, any_shape=True)
        is_model = problems.choice("model", model, MODELS)
        for name, value in given.items() if is_model else ():
            if name in NEEDS[model]:
                problems.require(value is not None, name, f"a value for {model!r}", "none")
            else:
                problems.require(value is None, name, f"nothing with {model!r}", value)
        roughness, spread, contact = (given[name] for name in ("roughness", "spread", "contact_fraction"))
        problems.number("roughness", roughness, above=0, at_most=20, optional=True)
        series = is_model and model == "zimmerman_bodvarsson"
        if contact is not None:
            bounds: dict[str, Any] = {"at_least": 0.0, "at_most": GREATEST_CONTACT}
            problems.numbers("contact_fraction", contact, any_shape=True, **bounds)
        has_spread = spread is not None and problems.numbers(
            "spread", spread, at_least=0, at_most=LARGEST, any_shape=True
        )
        if not positive or problems.messages:
            return
        arrays = [
            np.asarray(value, dtype=np.float64) for value in (aperture, spread, contact) if value is not None
        ]
        try:
            np.broadcast_shapes(*(array.shape for array in arrays))
        except ValueError:
            problems.add("aperture", "arrays of one shape, or numbers", [array.shape for array in arrays])
            return
        if has_spread and series:
            ratio = float(
                np.max(np.asarray(spread, dtype=np.float64) / np.asarray(aperture, dtype=np.float64))
            )
            expected = f"at most {GREATEST_VARIATION:g} of the aperture"
            problems.require(ratio <= GREATEST_VARIATION, "spread", expected, f"{ratio:.3g} of it")
