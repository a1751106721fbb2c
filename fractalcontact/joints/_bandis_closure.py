"""Closure of a joint that is not scanned, after Barton and Bandis."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints import _criteria
from fractalcontact.joints._criteria import CLOSURE_FITS, POSITIVE, check_quantities


def _check(problems: Problems) -> None:
    given = problems.given
    problems.numbers("nominal_pressure", **POSITIVE | {"at_least": 0})
    check_quantities(problems, "roughness_coefficient", "wall_strength")
    problems.integer("cycle", at_least=1, at_most=len(CLOSURE_FITS))
    if problems.messages:
        return
    if given.compressive_strength is not None:
        weakest = float(given.wall_strength) <= float(given.compressive_strength)
        problems.require(weakest, "wall_strength", "at most compressive_strength")
    joint = {name: value for name, value in vars(given).items() if name != "nominal_pressure"}
    opening, stiffness, closure = _criteria.bandis_constants(**joint)
    problems.require(
        stiffness > 0 and 0 < closure <= opening,
        "roughness_coefficient, wall_strength, aperture",
        "values inside the range of the fit",
        f"{stiffness / 1e9:.3g} MPa/mm and {closure * 1e3:.3g} mm",
    )


@public_result(
    title="closure of a joint after Bandis",
    references=(
        "Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249; Barton, Bandis and Bakhtar "
        "(1985), Int. J. Rock Mech. Min. Sci. 22:121"
    ),
    achieved_error="that of the fit, whose constants scatter",
    check=_check,
)
def bandis_closure(
    nominal_pressure: float | Sequence[float] | Array,
    *,
    roughness_coefficient: float,
    wall_strength: float,
    compressive_strength: float | None = None,
    aperture: float | None = None,
    cycle: int = 1,
) -> xr.Dataset:
    """Return the hyperbolic closure of a rock joint after Barton and Bandis, sigma Vm/(Kni Vm + sigma).

    For a joint that is known by JRC and JCS only. Elastic half-spaces close with the logarithm of the
    pressure instead; that a hyperbola can be fitted to a computed elastic closure does not confirm it.

    Parameters
    ----------
    nominal_pressure : float or sequence of float
        Normal stress sigma, Pa, at least 0.
    roughness_coefficient : float
        JRC, 0 to 20.
    wall_strength : float
        Compressive strength JCS of the walls, Pa.
    compressive_strength : float, optional
        UCS of the intact rock, Pa, at least JCS. Default: that of the walls.
    aperture : float, optional
        Mechanical aperture a under no load, m. Default: JRC/5 (0.2 UCS/JCS - 0.1) mm.
    cycle : {1, 2, 3}
        Cycle of load; the third is taken for the state of rock in place.

    Returns
    -------
    Dataset over nominal_pressure
        closure, m; also aperture, m, initial_stiffness Kni, Pa/m, and greatest_closure Vm, m.

    Raises
    ------
    InvalidInput
        An argument is wrong or missing, or the fit gives no positive stiffness or closure, or a closure of
        more than the aperture.

    Notes
    -----
    Kni = -7.15 + 1.75 JRC + 0.02 JCS/a and Vm = A + B JRC + C (JCS/a)^D, in MPa and mm. In the first cycle A,
    B, C, D are -0.2960, -0.0056, 2.2410, -0.2450; in the second -0.1005, -0.0073, 1.0082, -0.2301; in the
    third -0.1032, -0.0074, 1.1350, -0.2510. Fitted to joints with JRC of 5 to 15, JCS of 22 to 182 MPa and
    apertures of 0.1 to 0.6 mm. The constants scatter: those of the third cycle by 0.068, 0.0039, 0.33, 0.10.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> joint = fc.joints.bandis_closure(
    ...     [1e6, 10e6], roughness_coefficient=10, wall_strength=100e6, compressive_strength=100e6
    ... )
    >>> round(joint.aperture.item() * 1e3, 3), round(joint.greatest_closure.item() * 1e3, 3)
    (0.2, 0.137)
    >>> (joint.closure * 1e6).values.round(1).tolist()
    [36.2, 107.1]
    """
    pressure = float_array(nominal_pressure)
    opening, stiffness, greatest = _criteria.bandis_constants(
        roughness_coefficient, wall_strength, compressive_strength, aperture, cycle
    )
    closures = _criteria.hyperbolic_closure(pressure, stiffness, greatest)
    return xr.Dataset(
        {
            "closure": ("nominal_pressure", closures, {"long_name": "closure from no load"}),
            "aperture": opening,
            "initial_stiffness": stiffness,
            "greatest_closure": greatest,
        },
        {"nominal_pressure": pressure},
    )
