"""Partial slip of a joint under a shear force below that of sliding: its shear stiffness and hysteresis."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

import fractalcontact as fc  # loads `contact` on first use
from fractalcontact.base.errors import ConvergenceWarning, InvalidInput, SmallStrainWarning
from fractalcontact.base.progress import track
from fractalcontact.base.references import PAPER
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import SLIP_MAPS
from fractalcontact.base.validation import Problems, float_array, word_tuple
from fractalcontact.joints._closure import Pressing, ShearedContact, check_pressing
from fractalcontact.joints._compass import checked_direction, read_direction
from fractalcontact.joints._crack import Crack, block_coords, check_sliding

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.joints.partial_slip"
METHODS = ("superposition", "full")
LOADS = ("closure", "normal_force", "nominal_pressure")
LOAD_CHANGE = 0.01  # of the normal force, over which the normal stiffness is a difference quotient
ROUNDING = 1e-12
RIGID = "NaN where the interface is rigid: the faces are mated, or all of them touch"
BLOCK_ROUNDING = 1e-3  # relative error of the tangential stiffness, and more
COLUMNS = (
    "tangential_displacement", "tangential_stiffness", "stick_area", "slip_area", "dissipated_energy",
    "iterations", "transforms", "residual", "converged", "run_time",
)  # fmt: skip


def _check(
    problems: Problems,
    *,
    crack: Any,
    shear: Any,
    direction: Any,
    tangential_force: Any,
    friction_coefficient: Any,
    method: Any,
    keep: Any,
    progress: Any,
    closure: Any,
    normal_force: Any,
    nominal_pressure: Any,
    **solver: Any,
) -> None:
    direction = checked_direction(problems, direction)
    check_sliding(problems, crack, shear, direction)
    problems.number("friction_coefficient", friction_coefficient, above=0, optional=True)
    problems.numbers("tangential_force", tangential_force)
    problems.choice("method", method, METHODS)
    problems.choices("keep", keep, SLIP_MAPS)
    problems.boolean("progress", progress)
    load = problems.construct(
        fc.contact.LoadPath.from_keywords,
        closure=closure,
        normal_force=normal_force,
        nominal_pressure=nominal_pressure,
    )
    check_pressing(problems, crack, load, "flat_block", None, solver)
    if load is None:
        return
    expected = "one number: the normal load is constant while the tangential force changes"
    problems.require(len(load.values) == 1, load.control, expected, f"{len(load.values)} of them")
    if problems.messages or load.control == "closure":  # under a closure the force is not known yet
        return
    force = load.values[0] * (crack.nominal_area if load.control == "nominal_pressure" else 1.0)
    limit = _friction(crack, friction_coefficient) * force
    problems.require(limit > 0, "basic_friction_angle", "above 0, or a friction_coefficient", 0.0)
    greatest = float(np.abs(float_array(tangential_force)).max())
    expected = f"at most friction times normal force, {limit:.8g} N, where sliding begins"
    problems.require(greatest <= limit * (1 + ROUNDING), "tangential_force", expected, greatest)


@public_result(title="Partial slip of a joint", references=PAPER, check=_check)
def partial_slip(
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    tangential_force: float | Sequence[float] | Array,
    direction: str | float = "E",
    closure: float | None = None,
    normal_force: float | None = None,
    nominal_pressure: float | None = None,
    friction_coefficient: float | None = None,
    method: str = "superposition",
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    tolerance: float = 1e-8,
    keep: Sequence[str] = (),
    progress: bool = False,
) -> xr.Dataset:
    """Push a pressed crack towards sliding: shear stiffness, hysteresis, and the part that still sticks.

    At every shear displacement, at which the faces have come to rest, the delta-surface is pressed, and a
    tangential force below that of sliding goes through a path: the water load of a dam, or cycles of an
    earthquake. The geometry of the contact is that of the shear; what moves is elastic.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0 (m), each once.
    tangential_force : float or sequence of float
        Shear force on the block (N) at each step, positive towards the direction.
    direction : str or float
        Direction of sliding, and of the force: compass word or azimuth in degrees (E = 0, anticlockwise).
    closure, normal_force, nominal_pressure : float
        Exactly one of them: the constant normal load, as for `closure`.
    friction_coefficient : float, optional
        Local friction mu; None: the tangent of the basic friction angle of the crack.
    method, influence, disc_radius, tolerance
        As for `fractalcontact.contact.partial_slip`.
    keep : sequence of str
        Maps over (shear, step, y, x): "slip_state", "traction_x", "traction_y", "slip_x", "slip_y".
    progress : bool
        Show a progress bar over the shears.

    Returns
    -------
    Dataset over (shear, step)
        tangential_displacement (m), tangential_stiffness (N/m), stick_area, slip_area, dissipated_energy and
        the solver columns of `contact.partial_slip`; shear_stiffness K_s and stiffness_ratio K_s/K_n. Over
        shear: interface_stiffness K_n (Pa/m, at the normal load), sliding_force (N), at which all slides,
        contact_area, closure; stuck_ratio 2 (1 - nu)/(2 - nu), the theory for K_s/K_n before any slip. The
        part of the flat block is subtracted from both stiffnesses, as from the interface closure; they are
        NaN where nothing is left, for mated faces.

    Raises
    ------
    InvalidInput
        The force is beyond sliding, or an argument is wrong.

    References
    ----------
    Ciavarella (1998), J. Appl. Mech. 65:998; Borri-Brunetto, Chiaia and Ciavarella (2001), CMAME 190:6053.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> pushed = fc.joints.partial_slip(crack, shear=2e-4, normal_force=100, tangential_force=[0, 35, 70])
    >>> round(float(pushed["sliding_force"][0]), 1)
    70.0
    """
    towards, forces = read_direction(direction), float_array(tangential_force)
    friction = _friction(crack, friction_coefficient)
    load = fc.contact.LoadPath.from_keywords(
        closure=closure, normal_force=normal_force, nominal_pressure=nominal_pressure
    )
    options = fc.contact.ContactOptions(influence=influence, disc_radius=disc_radius, tolerance=tolerance)
    names, shears = word_tuple(keep), float_array(shear)
    pressing = Pressing(load, options, "flat_block", names, WHERE)
    results = []
    for value in track(shears, progress, "partial_slip", unit="shear"):
        contact = ShearedContact(crack, float(value), towards, pressing)
        results.append(_pushed(crack, contact, load, forces, towards.azimuth, friction, method, names))
    result = xr.concat([each.expand_dims("shear") for each in results], "shear", join="override")
    result = result.set_coords(LOADS)
    poisson = crack.contact_poisson
    result = result.assign(
        nominal_area=crack.nominal_area,
        friction_coefficient=friction,
        poisson=poisson,
        stuck_ratio=2 * (1 - poisson) / (2 - poisson),
    ).assign_coords(shear=("shear", shears), tangential_force=("step", forces), direction=towards.name)
    if names:
        result = result.assign_coords(block_coords(crack))
    for name in ("tangential_stiffness", "shear_stiffness", "interface_stiffness", "stiffness_ratio"):
        finite = np.isfinite(result[name])
        if not finite.all():
            result[name] = result[name].where(finite)
            result[name].attrs["reason"] = RIGID
    _warn(result, shears)
    return result.assign_attrs(method=method, achieved_residual=float(result["residual"].max()))


def _friction(crack: Crack, friction_coefficient: float | None) -> float:
    if friction_coefficient is not None:
        return float(friction_coefficient)
    return math.tan(math.radians(crack.basic_friction_angle))


def _pushed(
    crack: Crack,
    contact: ShearedContact,
    load: fc.contact.LoadPath,
    forces: Array,
    azimuth: float,
    friction: float,
    method: str,
    names: Sequence[str],
) -> xr.Dataset:
    """Return the path of tangential forces at one shear, with the normal stiffness at its load."""
    loads: dict[str, Any] = {load.control: load.values[0]}
    given = {
        key: value for key, value in contact.options.keywords().items() if key not in ("hardness", "method")
    }
    try:
        with warnings.catch_warnings():
            for category in (ConvergenceWarning, SmallStrainWarning):  # one warning follows for all shears
                warnings.simplefilter("ignore", category)
            slipped = fc.contact.partial_slip(
                contact.surface,
                contact_modulus=contact.modulus,
                poisson=crack.contact_poisson,
                friction_coefficient=friction,
                tangential_force=forces,
                azimuth=azimuth,
                method=method,
                keep=names,
                **given,
                **loads,
            )
            normal = float(slipped["normal_force"])
            normal_stiffness = _normal_stiffness(contact, normal, given)
    except InvalidInput as error:
        raise InvalidInput(WHERE, [f"{line} ({contact.place})" for line in error.problems]) from error
    area, block = crack.nominal_area, _block_stiffness(crack, contact, azimuth, method, given)
    shear_stiffness = _without_block(slipped["tangential_stiffness"].values, block) / area
    interface_stiffness = float(_without_block(np.array([normal_stiffness]), contact.stiffness)[0]) / area
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = shear_stiffness / interface_stiffness
    variables: dict[str, Any] = {name: ("step", slipped[name].values) for name in COLUMNS}
    variables |= {name: (("step", "y", "x"), slipped[name].values) for name in names}
    variables |= {
        "shear_stiffness": ("step", shear_stiffness),
        "stiffness_ratio": ("step", ratio),
        "interface_stiffness": interface_stiffness,
        "sliding_force": friction * normal,
        "contact_area": float(slipped["contact_area"]),
    }
    return xr.Dataset(variables | {name: float(slipped[name]) for name in LOADS})


def _block_stiffness(
    crack: Crack, contact: ShearedContact, azimuth: float, method: str, options: dict[str, Any]
) -> float:
    """Return the tangential stiffness of the flat block, all of which sticks, N/m."""
    if method == "superposition" or not math.isfinite(contact.stiffness):
        return contact.stiffness * 2 * (1 - crack.contact_poisson) / (2 - crack.contact_poisson)
    stuck = fc.contact.partial_slip(
        contact.surface * 0.0,
        contact_modulus=contact.modulus,
        poisson=crack.contact_poisson,
        friction_coefficient=1.0,
        normal_force=1.0,
        tangential_force=0.0,
        azimuth=azimuth,
        method=method,
        keep=(),
        **options,
    )
    return float(stuck["tangential_stiffness"][0])


def _normal_stiffness(contact: ShearedContact, normal: float, options: dict[str, Any]) -> float:
    """Return the derivative of the normal force by the closure, N/m."""
    if normal <= 0:
        return 0.0
    pressed = fc.contact.press(
        contact.surface,
        contact_modulus=contact.modulus,
        normal_force=[normal * (1 - LOAD_CHANGE), normal * (1 + LOAD_CHANGE)],
        keep=(),
        **options,
    )
    change = float(np.diff(pressed["closure"].values)[0])
    return 2 * LOAD_CHANGE * normal / change if change > 0 else math.inf


def _without_block(stiffness: Array, block: float) -> Array:
    """Return the stiffness of an interface in series with a block; infinite where that is all there is."""
    with np.errstate(divide="ignore"):
        compliance = 1 / stiffness - 1 / block
        is_block = np.abs(compliance) <= BLOCK_ROUNDING / block
        return np.asarray(np.where(is_block, np.inf, 1 / compliance))


def _warn(result: xr.Dataset, shears: Array) -> None:
    failed = np.argwhere(~result["converged"].values)
    if failed.size:
        row, step = failed[0]
        warnings.warn(
            f"{WHERE}: {len(failed)} steps not converged, the first of them step {step} at a shear of "
            f"{shears[row]:g} m (residual up to {float(result['residual'].max()):.2g})",
            ConvergenceWarning,
            stacklevel=4,
        )
