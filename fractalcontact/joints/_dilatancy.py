"""Dilatancy: how far the faces part when they slide, rigid, under a normal force, or against a spring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.compass import COMPASS, Direction, direction_coords, read_directions
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.regression import slopes
from fractalcontact.base.results import public_result, takes_checked
from fractalcontact.base.schema import DEFAULT_TOLERANCE
from fractalcontact.base.study import BORRI_BRUNETTO_1998
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Crack, check_sliding
from fractalcontact.joints._delta_surface import heights_under, interpolation_errors, missing_heights
from fractalcontact.joints._sheared_contact import (
    CONTACT_OPTIONS,
    PRESS_BYTES,
    JointProblem,
    Spring,
    check_problem,
    check_unpressed,
    closure_dataset,
)


def _check(problems: Problems) -> JointProblem | None:
    given = problems.given
    problems.boolean("progress")
    check_sliding(problems)
    if given.normal_force is None:
        unused = ("normal_stiffness", "pressed", "bulk", "keep", *CONTACT_OPTIONS)
        check_unpressed(problems, dilatancy, unused)
        return None
    one_of = given.normal_stiffness is None or given.pressed is None
    problems.require(one_of, "pressed", "nothing beside `normal_stiffness`")
    problems.number("normal_stiffness", above=0, optional=True)
    return check_problem(problems)


@public_result(title="dilatancy of a crack", references=BORRI_BRUNETTO_1998, check=_check, memory=PRESS_BYTES)
@takes_checked
def dilatancy(
    problem: JointProblem | None,
    /,
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = COMPASS,
    normal_force: float | Sequence[float] | None = None,
    normal_stiffness: float | None = None,
    pressed: xr.Dataset | None = None,
    bulk: str = "flat_block",
    keep: str | Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str = "second_order",
    hardness: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
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
        Directions of sliding: compass words, or degrees anticlockwise from E.
    normal_force : float or sequence of float, optional
        Normal forces on the block, N; a sequence is a path of load, repeated at every shear. None: only the
        rigid dilatancy, and no contact is solved.
    normal_stiffness : float, optional
        Stiffness k of the spring per nominal area, Pa/m; `normal_force` is then N0. None: constant force.
        The dilatancy leaves out the bulk of both bodies, so that 1/k has to include it: 1/k_s + A/k_b, with
        k_s of what loads the block from outside and k_b of `contact.flat_stiffness`.
    pressed : Dataset, optional
        A result of `closure` for the same crack and options: the shears at which it holds all the forces
        (with a hardness: the path of the forces) are taken from it, the others pressed. Not with `keep` or
        `normal_stiffness`.
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
    if problem is None:
        return rigid
    spring = None
    if normal_stiffness is not None:
        spring = Spring(rigid["rigid_dilatancy"].values, normal_stiffness * crack.nominal_area)
    under_force = closure_dataset(problem, shears, directions, progress, pressed=pressed, spring=spring)
    under_force = under_force.reset_coords("closure").drop_vars(("contact_area", "run_time"))
    result = under_force.merge(rigid, compat="override", combine_attrs="override")
    result["dilatancy"] = result["rigid_dilatancy"] - result["interface_closure"]
    if normal_stiffness is None:  # the force, and so the bulk part, is the same at every shear
        result["bulk_closure"] = result["bulk_closure"].isel(direction=0, shear=0, drop=True)
    else:
        result = result.assign(normal_stiffness=float(normal_stiffness))
        result["initial_force"] = "step", float_array(problem.load.values)
    return result


def _rigid_dataset(crack: Crack, shears: Array, directions: Sequence[Direction]) -> xr.Dataset:
    lifted, initial = rigid_dilatancies(crack, shears, directions)
    slope_y, slope_x = slopes(crack.faces()[0], crack.layout.spacing, crack.layout.wraps)
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


def rigid_dilatancies(crack: Crack, shears: Array, directions: Sequence[Direction]) -> tuple[Array, float]:
    """Return the rigid dilatancy, shape (direction, shear), and the separation that it counts from, m."""
    (lower, upper), layout = crack.faces(), crack.layout
    difference = np.empty(layout.cells)  # one array for all of them: of small blocks a new one takes as long

    def highest(shear: float, towards: Direction) -> float:
        under = heights_under(lower, layout, layout.shift(shear, towards.unit))
        height = float(np.subtract(under, upper, out=difference).max())
        if not np.isfinite(height):
            raise missing_heights(crack, towards, shear)
        return height

    initial = highest(0.0, directions[0])
    lifted = [[highest(float(shear), towards) for shear in shears] for towards in directions]
    return np.array(lifted) - initial, initial
