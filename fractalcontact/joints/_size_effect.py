"""Size effect of a joint: its strength under the weight of the structure above it, and by its dimensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import COMPASS, direction_coords, read_directions
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.regression import fitted_slope
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.study import BORRI_BRUNETTO_1998
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Crack, check_sliding
from fractalcontact.joints._criteria import POSITIVE, size_factors
from fractalcontact.joints._dilatancy import rigid_dilatancies
from fractalcontact.joints._friction import LOCKED
from fractalcontact.joints._sheared_contact import (
    PRESS_BYTES,
    JointProblem,
    ShearedContact,
    check_problem,
    check_unpressed,
    closure_columns,
)

USED_OPTIONS = ("influence", "hardness", "tolerance")
MEAN_ANGLE = "basic friction angle plus the mean dilatancy angle from zero shear to this one"
RIGID_FACES = "the faces are rigid: the crack has neither young nor poisson, and no load closes it"
NO_EXPONENT = "NaN for a single size, and where a strength is missing or not positive"


def _check(problems: Problems) -> JointProblem | None:
    given = problems.given
    weight = problems.number("unit_weight", **POSITIVE)
    check_sliding(problems, has_slid=True)
    force: Any = 1.0  # any, to check the other arguments as well
    if problems.numbers("structure_size", **POSITIVE):
        sizes = float_array(given.structure_size)
        ascending = bool((np.diff(sizes) > 0).all())
        problems.require(ascending, "structure_size", "ascending sizes, each once")
        if weight and isinstance(given.crack, Crack):
            force = (float(given.unit_weight) * sizes * given.crack.nominal_area).tolist()
    if isinstance(given.crack, Crack) and given.crack.young is None and given.crack.poisson is None:
        check_unpressed(problems, self_weight, USED_OPTIONS)
        return None
    return check_problem(problems, normal_force=force)


@public_result(
    title="shear strength of a joint under self-weight",
    reasons={"shear_strength": LOCKED, "strength_exponent": NO_EXPONENT},
    check=_check,
    memory=PRESS_BYTES,
)
@takes_checked
def self_weight(
    problem: JointProblem | None,
    /,
    crack: Crack,
    *,
    structure_size: float | Sequence[float] | Array,
    unit_weight: float,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = COMPASS,
    influence: str | None = None,
    hardness: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
) -> xr.Dataset:
    """Return the shear strength of a joint under the weight of structures of several sizes.

    Similar structures of size L load their joint with the pressure gamma L. With a constant coefficient of
    friction the strength grows as L. Here the friction angle follows from the dilatancy under that pressure,
    which is less the larger the structure, so that the strength grows more slowly.

    Parameters
    ----------
    crack : Crack
        With neither `young` nor `poisson` its faces are rigid: no load closes them.
    structure_size : float or sequence of float
        Sizes L, ascending: the height of material above the joint, m.
    unit_weight : float
        Weight per volume gamma, N/m3; 24e3 for concrete.
    shear : float or sequence of float
        Shears v > 0 from mated position (m) over which the dilatancy angle is the mean; see Notes.
    direction : str, float, or a sequence of them
        Directions of sliding: compass words, or degrees anticlockwise from E.
    influence, hardness, tolerance
        As for `fractalcontact.contact.press`.

    Returns
    -------
    Dataset
        Over (direction, shear, structure_size): dilatancy (m), friction_angle (degree), shear_strength (Pa),
        NaN with the `reason` where the faces lock; residual and converged. strength_exponent over (direction,
        shear): slope of a straight line through ln(shear_strength) over ln(structure_size). nominal_pressure
        (Pa) over structure_size; rms_slope, basic_friction_angle, nominal_area, run_time (s). Rigid faces
        have neither residual, converged nor rms_slope: nothing is pressed.

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong.

    Notes
    -----
    tau = gamma L tan(phi_basic + atan((delta(gamma L, v) - delta(gamma L, 0))/v)): the mean angle over the
    whole shear; mated faces have no delta at 0. Over a shorter shear the angle of fractal faces is larger:
    compare only strengths over equal shears.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 1.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> slope = np.tan(np.radians(15)) * np.arange(40.0) * np.ones((6, 1))
    >>> surface = fc.surfaces.from_array(slope, 1.0)
    >>> crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    >>> result = fc.joints.self_weight(
    ...     crack, structure_size=[10, 100], unit_weight=24e3, shear=4, direction="E"
    ... )
    >>> (
    ...     (result.shear_strength / 1e6).values.round(3).tolist(),
    ...     result.strength_exponent.values.round(3).tolist(),
    ... )
    ([[[0.24, 2.4]]], [[1.0]])
    """
    sizes, shears, directions = float_array(structure_size), float_array(shear), read_directions(direction)
    pressures, dims = float(unit_weight) * sizes, ("direction", "shear", "structure_size")
    lifted, _ = rigid_dilatancies(crack, shears, directions)
    opening = np.repeat(lifted[..., None], sizes.size, axis=-1)
    at_rest: Array = np.zeros(sizes.size)
    variables: dict[str, Any] = {}
    attributes: dict[str, Any] = {"references": BORRI_BRUNETTO_1998}
    if problem is not None:
        columns = closure_columns(problem, shears, directions)
        opening -= columns["interface_closure"]
        unsheared = ShearedContact.of_crack(problem, 0.0, directions[0]).press(problem.load)
        at_rest = -unsheared["interface_closure"]
        for name in ("residual", "converged", "rms_slope"):
            variables[name] = dims[: columns[name].ndim], columns[name]
        attributes = {
            "references": problem.references,
            "achieved_residual": float(max(columns["residual"].max(), unsheared["residual"].max())),
        }
    angle = crack.basic_friction_angle + np.degrees(np.arctan((opening - at_rest) / shears[:, None]))
    strength = pressures * np.tan(np.radians(np.where(angle < 90.0, angle, math.nan)))
    exponents = [
        fitted_slope(sizes, row) if sizes.size > 1 and (row > 0).all() else math.nan  # False for NaN
        for row in strength.reshape(-1, sizes.size)
    ]
    variables |= {
        "dilatancy": (dims, opening),
        "friction_angle": (dims, angle, {"comment": MEAN_ANGLE}),
        "shear_strength": (dims, strength, {"comment": RIGID_FACES} if problem is None else {}),
        "strength_exponent": (dims[:-1], np.reshape(exponents, lifted.shape)),
        "basic_friction_angle": crack.basic_friction_angle,
        "nominal_area": crack.nominal_area,
    }
    coords = {"structure_size": sizes, "nominal_pressure": ("structure_size", pressures)}
    coords |= {"shear": ("shear", shears), **direction_coords(directions)}
    return xr.Dataset(variables, coords, attributes)


def _check_factors(problems: Problems) -> None:
    given = problems.given
    problems.numbers("size_ratio", **POSITIVE)
    is_number = problems.number("contact_dimension", at_least=0, at_most=2)
    lowest = float(given.contact_dimension) if is_number else 0.0
    problems.number("roughness_dimension", at_least=lowest, at_most=2)


@public_result(
    title="size effect of a joint",
    references=(
        "Carpinteri and Paggi (2009), Chaos, Solitons and Fractals 39:540; Borri-Brunetto, Carpinteri and "
        "Chiaia (1999), Int. J. Fracture 95:221"
    ),
    achieved_error="that of the dimensions",
    check=_check_factors,
)
def size_effect(
    size_ratio: float | Sequence[float] | Array, *, contact_dimension: float, roughness_dimension: float = 2.0
) -> xr.Dataset:
    """Return the factors by which the strength of a joint changes with its size.

    With a contact domain of dimension D_s and a rough surface whose resistant section has the dimension D_r:
    shear strength ~ size^(D_s - 2), friction coefficient ~ size^(D_s - D_r), fracture energy
    ~ size^(D_s - 1).

    Parameters
    ----------
    size_ratio : float or sequence of float
        Ratio of the sizes, above 0.
    contact_dimension : float
        D_s, 0 to 2, for example the box dimension of the contact domain over a stated window.
    roughness_dimension : float
        D_r, contact_dimension to 2.

    Returns
    -------
    Dataset over size_ratio
        strength_factor, friction_factor, fracture_energy_factor.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> factors = fc.joints.size_effect(4.0, contact_dimension=1.5)
    >>> factors.strength_factor.item(), factors.fracture_energy_factor.item()
    (0.5, 2.0)
    """
    ratio = float_array(size_ratio)
    factors = size_factors(ratio, float(contact_dimension), float(roughness_dimension))
    return xr.Dataset(
        {name: ("size_ratio", values) for name, values in factors.items()}, {"size_ratio": ratio}
    )
