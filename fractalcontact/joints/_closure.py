"""Closure of a sheared crack, and of a joint that is not scanned, after Barton and Bandis.

The delta-surface of the crack is pressed by a flat, and the bulk part is subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from fractalcontact.base.compass import is_single, read_directions
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.validation import Problems
from fractalcontact.joints import _criteria
from fractalcontact.joints._crack import Crack, check_sliding
from fractalcontact.joints._criteria import CLOSURE_FITS, POSITIVE, check_quantities
from fractalcontact.joints._delta_surface import interpolation_errors
from fractalcontact.joints._sheared_contact import PRESS_BYTES, JointProblem, check_problem, closure_dataset

Path = float | Sequence[float] | Array

OF_FORCES = ("normal_force", "nominal_pressure", "elastic_energy", "residual", "pressure", "displacement")
UNDETERMINED = (
    "NaN where periodic faces are closed to the mean plane of the delta-surface or beyond: "
    "no force is then determined"
)


def _check(problems: Problems) -> JointProblem | None:
    problems.boolean("progress")
    check_sliding(problems)
    return check_problem(problems)


@public_result(
    title="closure of a sheared crack",
    reasons=dict.fromkeys(OF_FORCES, UNDETERMINED),
    check=_check,
    memory=PRESS_BYTES,
)
@takes_checked  # `problem` is what `_check` returns; it is no argument of the caller
def closure(
    problem: JointProblem,
    /,
    crack: Crack,
    *,
    shear: Path,
    direction: str | float | Sequence[str | float] = "E",
    closure: Path | None = None,
    normal_force: Path | None = None,
    nominal_pressure: Path | None = None,
    bulk: str = "flat_block",
    keep: str | Sequence[str] = ("state",),
    influence: str | None = None,
    disc_radius: str = "second_order",
    hardness: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the closure of a sheared crack under a path of load.

    Two elastic half-spaces approach without tilt, with the delta-surface of every shear between them, along
    the same path. The closure w counts from first touch at that shear, where the rigid dilatancy holds the
    faces apart. Without its bulk part, w_int = w - w_b(F), it is 0 to rounding for mated faces, where `bulk`
    is "flat_block" and no node yields.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Direction of sliding: compass word, or degrees anticlockwise from E. A sequence gives the
        result a first dim `direction`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach from first touch (m), force on the block (N), or force over its area
        (Pa). A sequence is a path of load, which may go up and down.
    bulk : {"flat_block", "uniform_pressure"}
        Bulk part w_b: closure under the same force of the flat block (flat faces of the same extent, which
        touch everywhere), or its mean displacement under uniform pressure (about 9 % more for a square). Zero
        for periodic bodies.
    keep : str or sequence of str
        Maps over (shear, step, y, x): "state", "pressure", "gap", "displacement", "residual_height".
    influence, disc_radius, hardness, tolerance, method
        As for `fractalcontact.contact.press`. With a `hardness` unloading is stiffer than loading.
    progress : bool
        Show a progress bar over the shears.

    Returns
    -------
    Dataset over (shear, step), or (direction, shear, step)
        closure, bulk_closure, interface_closure (m), normal_force (N), nominal_pressure (Pa), the other
        scalars of `press`, the maps in `keep`; nominal_area (m2); over shear interpolation_error (m, rms)
        and the rms_slope of the delta-surface.

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong. A step that
        stops before its tolerance is met gives a ConvergenceWarning.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 4 and figure 3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> result = fc.joints.closure(crack, shear=[0, 2e-4], normal_force=[10, 100])
    >>> (result.interface_closure.values * 1e6).round(1).tolist()  # micrometres
    [[0.0, 0.0], [2.2, 5.2]]
    """
    directions, shears = read_directions(direction), float_array(shear)
    result = closure_dataset(problem, shears, directions, progress)
    result["interpolation_error"] = ("direction", "shear"), interpolation_errors(crack, shears, directions)
    return result.isel(direction=0) if is_single(direction) else result


def _check_bandis(problems: Problems) -> None:
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
    is_inside = stiffness > 0 and 0 < closure <= opening
    names, expected = "roughness_coefficient, wall_strength, aperture", "values inside the range of the fit"
    problems.require(is_inside, names, expected, f"{stiffness / 1e9:.3g} MPa/mm and {closure * 1e3:.3g} mm")


@public_result(
    title="closure of a joint after Bandis",
    references=(
        "Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min. Sci. 20:249; Barton, Bandis and Bakhtar "
        "(1985), Int. J. Rock Mech. Min. Sci. 22:121"
    ),
    achieved_error="that of the fit, whose constants scatter",
    check=_check_bandis,
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
