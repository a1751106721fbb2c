"""Size effect of friction: shear strength of a joint under the weight of the structure above it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import COMPASS
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.power_law import fit_line
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Crack
from fractalcontact.joints._criteria import POSITIVE
from fractalcontact.joints._dilatancy import dilatancy
from fractalcontact.joints._friction import LOCKED, LOCKED_ANGLE

FROM_DILATANCY = ("dilatancy", "residual", "converged", "rms_slope", "basic_friction_angle", "nominal_area")
FROM_RIGID = ("rigid_dilatancy", "basic_friction_angle", "nominal_area")
MEAN_ANGLE = "basic friction angle plus the mean dilatancy angle from zero shear to this one"
RIGID_FACES = "the faces are rigid: the crack has neither young nor poisson, and no load closes it"
NO_EXPONENT = "NaN for a single size, and where a strength is missing or not positive"


def _check(problems: Problems) -> None:
    given = problems.given
    weight = problems.number("unit_weight", **POSITIVE)
    # any shear and force, to check the other arguments as well
    shear = given.shear if problems.numbers("shear", above=0) else 0.0
    force: Any = 1.0
    if problems.numbers("structure_size", **POSITIVE):
        sizes = float_array(given.structure_size)
        ascending = bool((np.diff(sizes) > 0).all())
        problems.require(ascending, "structure_size", "ascending sizes, each once")
        if weight and isinstance(given.crack, Crack):
            force = (float(given.unit_weight) * sizes * given.crack.nominal_area).tolist()
    loads = {} if _is_rigid(given.crack) else {"normal_force": force}
    solver = {name: getattr(given, name) for name in ("influence", "hardness", "tolerance")}
    with problems.collect():
        dilatancy.validate(given.crack, shear=shear, direction=given.direction, **loads, **solver)


@public_result(
    title="shear strength of a joint under self-weight",
    reasons={"shear_strength": LOCKED, "strength_exponent": NO_EXPONENT},
    check=_check,
)
def self_weight(
    crack: Crack,
    *,
    structure_size: float | Sequence[float] | Array,
    unit_weight: float,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = COMPASS,
    influence: str | None = None,
    hardness: float | None = None,
    tolerance: float = 1e-8,
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
    tau = gamma L tan(phi_basic + atan(delta(gamma L, v)/v)): the mean angle over the whole shear. Over a
    shorter shear the angle of fractal faces is larger: compare only strengths over equal shears.

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
    sizes, shears = float_array(structure_size), float_array(shear)
    pressures = float(unit_weight) * sizes
    solver = {"influence": influence, "hardness": hardness, "tolerance": tolerance}
    slid, result = _slid(crack, shears, direction, pressures, solver)
    result = result.assign_coords(structure_size=sizes)
    result = result.assign_coords(nominal_pressure=("structure_size", pressures))
    opening = result["dilatancy"]
    angle = crack.basic_friction_angle + np.degrees(np.arctan(opening.values / shears[:, None]))
    strength = pressures * np.tan(np.radians(np.where(angle < LOCKED_ANGLE, angle, math.nan)))
    result["friction_angle"], result["shear_strength"] = (opening.dims, angle), (opening.dims, strength)
    exponents = [_exponent(sizes, row) for row in strength.reshape(-1, sizes.size)]
    result["strength_exponent"] = opening.dims[:-1], np.reshape(exponents, opening.shape[:-1])
    result["friction_angle"].attrs["comment"] = MEAN_ANGLE
    if _is_rigid(crack):
        result["shear_strength"].attrs["comment"] = RIGID_FACES
    if "residual" in result:
        result.attrs["achieved_residual"] = float(result["residual"].max())
    return result.assign_attrs(references=slid.attrs["references"])


def _is_rigid(crack: Any) -> bool:
    return isinstance(crack, Crack) and crack.young is None and crack.poisson is None


def _slid(
    crack: Crack, shears: Array, direction: Any, pressures: Array, solver: dict[str, Any]
) -> tuple[xr.Dataset, xr.Dataset]:
    """Return the result of `dilatancy` and what is kept of it, over (direction, shear, structure_size)."""
    if _is_rigid(crack):
        slid = dilatancy(crack, shear=shears, direction=direction)
        kept = slid[list(FROM_RIGID)].rename(rigid_dilatancy="dilatancy").drop_attrs()
        repeated = kept["dilatancy"].expand_dims(structure_size=pressures.size, axis=-1).copy()
        return slid, kept.assign(dilatancy=repeated)
    force = (pressures * crack.nominal_area).tolist()
    slid = dilatancy(crack, shear=shears, direction=direction, normal_force=force, **solver)
    kept = slid[list(FROM_DILATANCY)].drop_vars(("step", "normal_force", "nominal_pressure"))
    return slid, kept.drop_attrs().rename(step="structure_size")


def _exponent(sizes: Array, strengths: Array) -> float:
    if sizes.size < 2 or not (strengths > 0).all():  # False for NaN
        return math.nan
    return float(fit_line(sizes, strengths).slope)
