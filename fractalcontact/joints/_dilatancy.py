"""Dilatancy: how far the faces part when they slide, rigid, under a normal force, or against a spring."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

import fractalcontact as fc  # loads `contact` on first use: a study of rigid faces needs no solver
from fractalcontact.base.memory import Plane
from fractalcontact.base.numbers import float_array, number_of_entries
from fractalcontact.base.polynomial import slopes
from fractalcontact.base.progress import track
from fractalcontact.base.references import PAPER
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._closure import (
    Pressing,
    ShearedContact,
    check_pressed,
    check_pressing,
    press_sheared,
    pressing_memory,
    pressing_references,
    warn_steep,
    warn_unconverged,
)
from fractalcontact.joints._compass import COMPASS, Direction, direction_coords, read_directions
from fractalcontact.joints._crack import Block, Crack, Pair, block_coords, check_sliding
from fractalcontact.joints._delta_surface import heights_under, interpolation_errors, missing_heights

Array = np.ndarray[Any, np.dtype[Any]]
Columns = dict[str, Array]

WHERE = "fractalcontact.joints.dilatancy"
FORCE_ERROR = 1e-7  # relative error of the force that balances a spring
RIGID_BYTES = 96.0  # of a cell of the block
MAX_SOLUTIONS = 60  # for one such force


def _check(
    problems: Problems,
    *,
    crack: Any,
    shear: Any,
    direction: Any,
    normal_force: Any,
    normal_stiffness: Any,
    pressed: Any,
    bulk: Any,
    keep: Any,
    **solver: Any,
) -> None:
    check_sliding(problems, crack, shear, direction)
    if normal_force is None:
        unused = {"keep": keep, "normal_stiffness": normal_stiffness, "bulk": bulk, **solver}
        _check_defaults(problems, unused | {"pressed": pressed})
        return
    check_pressed(problems, crack, pressed, keep, bulk, solver)
    one_of = normal_stiffness is None or pressed is None
    problems.require(one_of, "pressed", "nothing beside `normal_stiffness`", pressed)
    problems.number("normal_stiffness", normal_stiffness, above=0, optional=True)
    load = problems.construct(fc.contact.LoadPath, "normal_force", normal_force)
    check_pressing(problems, crack, load, bulk, keep, solver)


def _check_defaults(problems: Problems, options: dict[str, Any]) -> None:
    """Check that the options of a press have their defaults, where nothing is pressed."""
    parameters = inspect.signature(dilatancy).parameters
    for name, value in options.items():
        default = parameters[name].default
        unused = value is default or (isinstance(value, type(default)) and value == default)
        if name == "keep":
            unused = value is None or number_of_entries(value) == 0
        problems.require(unused, name, "nothing without normal_force", value)


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of sliding rigid faces, and of pressing them where a force is given."""
    is_rigid = arguments.get("normal_force") is None
    return RIGID_BYTES * plane.cells if is_rigid else pressing_memory(plane, arguments)


@public_result(title="dilatancy of a crack", references=PAPER, check=_check, memory=_memory)
def dilatancy(
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = COMPASS,
    normal_force: float | Sequence[float] | None = None,
    normal_stiffness: float | None = None,
    pressed: xr.Dataset | None = None,
    bulk: str = "flat_block",
    keep: Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    hardness: float | None = None,
    tolerance: float = 1e-8,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the dilatancy of a crack that slides, rigid or under a normal force.

    A rigid block is lifted to delta_r(v) = max over the block of (lower(x + v) - upper(x)). Under a normal
    force F the interface closes by w_int, and delta(F, v) = delta_r(v) - w_int(F, v). Against a spring the
    force grows with the dilatancy: N = N0 + k A (delta(N, v) - delta(N0, 0)), and never below zero.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Directions of sliding: compass words, or azimuths in degrees (E = 0, anticlockwise).
    normal_force : float or sequence of float, optional
        Normal forces on the block, N; a sequence is a path of load, repeated at every shear. None: only the
        rigid dilatancy, and no contact is solved.
    normal_stiffness : float, optional
        Stiffness k of the spring per nominal area, Pa/m; `normal_force` is then N0. None: constant force.
    pressed : Dataset, optional
        A result of `closure` for the same crack and options: the shears at which it holds all the forces are
        taken from it, the others pressed.
    bulk, keep, influence, disc_radius, hardness, tolerance, method
        As for `closure`; refused without a force.
    progress : bool
        Show a progress bar over the shears.

    Returns
    -------
    Dataset
        rigid_dilatancy (direction, shear), m, relative to its value at v = 0, which is initial_offset;
        mean_slope (direction) of the lower face; plateau_dilatancy, rigid_dilatancy without mean_slope times
        v; interpolation_error, m, see `delta_surface`; basic_friction_angle (degree), nominal_area (m2). With
        forces also, over (direction, shear, step): dilatancy and interface_closure (m), the scalars of
        `press` and the maps in `keep`; over step (with a spring over all): normal_force, nominal_pressure,
        bulk_closure. With a spring normal_stiffness (Pa/m) and initial_force over step.

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, eq. 2 and figure 5.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> x = np.arange(60)
    >>> teeth = np.abs((x + 10) % 20 - 10) * 0.1 * np.ones((6, 1))  # slope 0.1, period 20
    >>> crack = fc.joints.Crack(fc.surfaces.from_array(teeth, 1.0), young=30e9, poisson=0.2, block=(6, 20))
    >>> result = fc.joints.dilatancy(crack, shear=[0, 5, 10, 15], direction="E")
    >>> result.rigid_dilatancy.values.round(6).tolist()
    [[0.0, 0.5, 1.0, 0.5]]
    """
    directions, shears = read_directions(direction), float_array(shear)
    rigid = _rigid_dataset(crack, shears, directions)
    if normal_force is None:
        return rigid
    options = fc.contact.ContactOptions(
        influence=influence, disc_radius=disc_radius, hardness=hardness, tolerance=tolerance, method=method
    )
    load = fc.contact.LoadPath.from_keywords(normal_force=normal_force)
    pressing = Pressing(load, options, bulk, word_tuple(keep), WHERE)
    by_direction = []
    for towards, lifted in zip(directions, rigid["rigid_dilatancy"].values, strict=True):
        if normal_stiffness is None:
            columns = press_sheared(crack, shears, towards, pressing, progress, pressed=pressed)
        else:
            stiffness = normal_stiffness * crack.nominal_area
            columns = press_against_spring(crack, shears, lifted, towards, pressing, stiffness, progress)
        by_direction.append(columns)
        warn_unconverged(columns, shears, towards, WHERE, stacklevel=4)
    warn_steep(by_direction, WHERE, stacklevel=4)
    result = _with_forces(rigid, crack, by_direction, has_spring=normal_stiffness is not None)
    if normal_stiffness is not None:
        result = result.assign(normal_stiffness=float(normal_stiffness))
        result["initial_force"] = "step", float_array(pressing.load.values)
    result["bulk_closure"].attrs["comment"] = pressing.bulk_comment
    residual = float(np.max([columns["residual"].max() for columns in by_direction]))
    return result.assign_attrs(achieved_residual=residual, references=pressing_references(crack, options))


def _rigid_dataset(crack: Crack, shears: Array, directions: Sequence[Direction]) -> xr.Dataset:
    layout = crack.layout
    lower, upper = crack.faces()
    initial = separations(lower, upper, layout, np.zeros(1), (0.0, 1.0))[0]
    lifted = np.stack([_separations(crack, shears, towards) for towards in directions]) - initial
    slope_y, slope_x = mean_slopes(lower, layout)
    mean_slope = np.array([slope_y * towards.unit[0] + slope_x * towards.unit[1] for towards in directions])
    dims = ("direction", "shear")
    return xr.Dataset(
        {
            "rigid_dilatancy": (dims, lifted),
            "plateau_dilatancy": (dims, lifted - mean_slope[:, None] * shears),
            "mean_slope": ("direction", mean_slope),
            "interpolation_error": (dims, interpolation_errors(crack, shears, directions)),
            "initial_offset": initial,
            "basic_friction_angle": crack.basic_friction_angle,
            "nominal_area": crack.nominal_area,
        },
        coords={"shear": ("shear", shears), **direction_coords(directions)},
    )


def _separations(crack: Crack, shears: Array, towards: Direction) -> Array:
    highest = separations(*crack.faces(), crack.layout, shears, towards.unit)
    if not np.isfinite(highest).all():
        raise missing_heights(WHERE, crack, towards, float(shears[~np.isfinite(highest)][0]))
    return highest


def separations(lower: Array, upper: Array, block: Block, shears: Array, unit: Pair) -> Array:
    """Return max over the block of (lower(x + v) - upper(x)) for every shear.

    Parameters
    ----------
    lower : ndarray, shape (ny, nx)
        The whole lower face, m.
    upper : ndarray, shape block.cells
        The face of the block, m.
    block : Block
    shears : ndarray, shape (n,)
        Metres, inside the travel.
    unit : pair of float
        Direction of sliding, (y, x).

    Returns
    -------
    ndarray, shape (n,)
        Metres; NaN where heights are missing in the path.
    """
    difference = np.empty(block.cells)
    highest = np.empty(shears.shape)
    for index, shear in enumerate(shears):
        under = heights_under(lower, block, block.shift(float(shear), unit))
        highest[index] = np.subtract(under, upper, out=difference).max()
    return highest


def mean_slopes(face: Array, block: Block) -> Pair:
    """Return the slopes (y, x) of the mean plane of a face without its gaps; zero where an axis wraps."""
    slope_y, slope_x = slopes(face, block.spacing)
    return 0.0 if block.wraps[0] else slope_y, 0.0 if block.wraps[1] else slope_x


def _with_forces(
    rigid: xr.Dataset, crack: Crack, pressed: Sequence[Columns], *, has_spring: bool
) -> xr.Dataset:
    """Add what was computed under force: scalars over (direction, shear, step), and maps."""
    columns = {name: np.stack([each[name] for each in pressed]) for name in pressed[0]}
    columns["rms_slope"] = columns["rms_slope"][..., 0]
    dims = ("direction", "shear", "step", "y", "x")
    by_force: dict[str, Any] = {}
    for name in ("normal_force", "nominal_pressure", "bulk_closure"):
        values = columns.pop(name)
        # constant forces are the same for every direction and shear
        by_force[name] = (dims[:3], values) if has_spring else ("step", values[0, 0])
    for name in ("contact_area", "run_time"):
        del columns[name]
    variables: dict[str, Any] = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    lifted = rigid["rigid_dilatancy"].values[..., None]
    variables["dilatancy"] = dims[:3], lifted - columns["interface_closure"]
    variables["bulk_closure"] = by_force.pop("bulk_closure")
    coords: dict[str, Any] = {"step": np.arange(columns["closure"].shape[-1]), **by_force}
    if any(values.ndim > 3 for values in columns.values()):
        coords |= block_coords(crack)
    return rigid.assign(variables).assign_coords(coords)


def press_against_spring(
    crack: Crack,
    shears: Array,
    lifted: Array,
    towards: Direction,
    pressing: Pressing,
    stiffness: float,
    progress: bool,
) -> Columns:
    """Press the crack together at every shear against a spring.

    The force on the block is N = N0 + k A (delta(N, v) - delta(N0, 0)), and never below zero. For every
    initial force N0 it is bracketed and solved (Brent): the closure grows with the force, so that the
    difference of the two sides changes its sign once.

    Parameters
    ----------
    lifted : ndarray, shape (shear,)
        Rigid dilatancy, m.
    stiffness : float
        k A, N/m.

    Returns
    -------
    dict of ndarray
        As `press_sheared`; normal_force and all that depends on it differ from shear to shear.
    """
    at_rest = ShearedContact(crack, 0.0, towards, pressing).press(pressing.load)
    initial_dilatancy = -at_rest["interface_closure"]
    results = []
    for shear, lift in zip(
        track(shears, progress, f"press, towards {towards.name}", unit="shear"), lifted, strict=True
    ):
        contact = ShearedContact(crack, float(shear), towards, pressing)
        steps = [
            _press_balanced(contact, float(force), float(lift - initial), stiffness)
            for force, initial in zip(pressing.load.values, initial_dilatancy, strict=True)
        ]
        results.append({name: np.concatenate([step[name] for step in steps]) for name in steps[0]})
    return {name: np.stack([result[name] for result in results]) for name in results[0]}


def _press_balanced(contact: ShearedContact, initial: float, opening: float, stiffness: float) -> Columns:
    """Press under the force that balances the spring; `opening` is that of the rigid faces, m."""
    from scipy.optimize import brentq

    def press(force: float, keep: Sequence[str] = ()) -> Columns:
        return contact.press(fc.contact.LoadPath("normal_force", (force,)), keep)

    def excess(force: float) -> float:
        interface_closure = press(force)["interface_closure"][0] if force > 0 else 0.0
        return float(force - initial - stiffness * (opening - interface_closure))

    if initial + stiffness * opening <= 0:  # the faces sink away from the spring
        return press(0.0, contact.keep)
    at_initial = excess(initial) if initial > 0 else -stiffness * opening
    low, high = (initial, initial - at_initial) if at_initial < 0 else (0.0, initial)
    if abs(at_initial) <= FORCE_ERROR * initial:
        force = initial
    elif low > 0:  # the closure is nearly linear in the logarithm of the force
        ends = np.log(low), np.log(high)
        log_force = brentq(lambda x: excess(np.exp(x)), *ends, xtol=FORCE_ERROR, maxiter=MAX_SOLUTIONS)
        force = np.exp(log_force)
    else:
        force = brentq(excess, low, high, xtol=FORCE_ERROR * high, maxiter=MAX_SOLUTIONS)
    return press(float(force), contact.keep)
