"""A sheared crack that is pressed: its delta-surface between the two bodies, on plain arrays.

    problem = JointProblem(crack, LoadPath("normal_force", (10.0, 100.0)), options, keep=("state",))
    columns = closure_columns(problem, shears, directions)
    columns["interface_closure"]  # of shape (direction, shear, step)
    columns["state"]  # of shape (direction, shear, step, y, x)

Options and load are read once for each call, by its check; every shear goes to `contact.solver` as an array.
The solver is imported when it is first called: a study of rigid faces loads neither it nor the compiler.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.compass import Direction, direction_coords
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.numbers import Array, number_of_entries
from fractalcontact.base.provenance import differing
from fractalcontact.base.schema import CONTACT_MAPS
from fractalcontact.base.signals import track
from fractalcontact.base.study import BORRI_BRUNETTO_1998, joined_references, provenance_of
from fractalcontact.base.validation import Problems, require, word_tuple
from fractalcontact.joints._crack import Crack, block_coords, check_elastic
from fractalcontact.joints._delta_surface import delta_heights

if TYPE_CHECKING:
    from fractalcontact.contact.solver import ContactOptions, LoadPath, Pressed, Sheared, ShearPath

Columns = dict[str, Array]
T = TypeVar("T", "Pressed", "Sheared")

# how the faces of the flat block are loaded, and what that makes of the bulk part of the closure
FLAT_BLOCK = "rigid", "closure of the flat block under the same force and the same influence coefficients"
UNIFORM_PRESSURE = "uniform", "mean displacement of the flat block under the same force, uniformly spread"
BULK = {"flat_block": FLAT_BLOCK, "uniform_pressure": UNIFORM_PRESSURE}
LOADS = ("closure", "normal_force", "nominal_pressure")
CONTACT_OPTIONS = ("influence", "disc_radius", "hardness", "tolerance", "method")
# bytes of a cell: the solver of a free body with the steps before (196), delta-surface and flat block
PRESS_BYTES = 236.0


@dataclass(frozen=True)
class JointProblem:
    """A crack that is pressed at every shear: load, options of the solver, bulk part, and maps to keep.

    With a `factor` only every so many heights of the delta-surface are kept along both axes.
    """

    crack: Crack
    load: LoadPath
    options: ContactOptions
    bulk: str = "flat_block"
    keep: tuple[str, ...] = ()
    factor: int = 1

    @property
    def references(self) -> str:
        """The sources of the closure of a delta-surface and of the solver that presses it."""
        return joined_references(BORRI_BRUNETTO_1998, self.options.references(self.grid))

    @cached_property
    def modulus(self) -> float:
        """E* of the two bodies, Pa."""
        return self.crack.contact_modulus

    @cached_property
    def grid(self) -> Grid:
        """The grid of the delta-surface, with the spacing that `press` would read."""
        flat = xr.DataArray(
            np.broadcast_to(0.0, self.crack.layout.cells), dims=("y", "x"), coords=block_coords(self.crack)
        )
        every = slice(None, None, self.factor)
        return read_grid(flat.isel(y=every, x=every))

    @cached_property
    def block_stiffness(self) -> float:
        """Stiffness of the flat block, N/m; infinite for a periodic one."""
        loaded = BULK[self.bulk][0]
        return fc.contact.solver.block_stiffness(self.grid, self.modulus, self.options, loaded)


def check_problem(problems: Problems, **replaced: Any) -> JointProblem | None:
    """Check load and options of a call, or what replaces them; return the problem if all so far is valid."""
    arguments, crack = vars(problems.given) | replaced, problems.given.crack
    if isinstance(crack, Crack):
        arguments["boundary"] = "periodic" if all(crack.layout.periodic) else "free"
    options = problems.construct(fc.contact.solver.ContactOptions.among, arguments)
    load = problems.construct(fc.contact.solver.LoadPath.among, arguments)
    has_bulk = "bulk" in arguments  # `keep` are then maps of `contact.press`
    if has_bulk:
        problems.choices("keep", among=CONTACT_MAPS, optional=True)
        problems.choice("bulk", among=BULK)
    if arguments.get("pressed") is not None:
        _check_pressed(problems)
    if options is None or not isinstance(crack, Crack):
        return None
    layout = crack.layout
    options.check_grid(Grid(layout.cells, layout.spacing, layout.periodic), problems)
    if load is None:
        return None
    check_elastic(problems, crack)
    options.check_load(load, crack.nominal_area, problems)
    if problems.messages:
        return None
    further = (arguments["bulk"], word_tuple(arguments["keep"])) if has_bulk else ()
    return JointProblem(crack, load, options, *further)


def check_unpressed(problems: Problems, function: Callable[..., object], names: Sequence[str]) -> None:
    """Check that options of a press have the defaults of the function, where nothing is pressed."""
    parameters = inspect.signature(function).parameters
    for name in names:
        value, default = getattr(problems.given, name), parameters[name].default
        unused = value is default or (isinstance(value, type(default)) and value == default)
        if name == "keep":
            unused = value is None or number_of_entries(value) == 0
        problems.require(unused, name, "nothing without a force: rigid faces are not pressed")


class ShearedContact:
    """The heights of a delta-surface (m, on the grid of `problem`), to be pressed along paths of load."""

    def __init__(self, problem: JointProblem, heights: Array, shear: float, towards: Direction) -> None:
        self.problem, self.heights = problem, heights
        self.place = f"at a shear of {shear:g} m towards {towards.name}"
        self.rms_slope = fc.contact.solver.rms_slope(heights, problem.grid)

    @classmethod
    def of_crack(cls, problem: JointProblem, shear: float, towards: Direction) -> ShearedContact:
        """Return that of the crack at a shear."""
        heights = delta_heights(problem.crack, shear, towards)
        return cls(problem, heights[:: problem.factor, :: problem.factor], shear, towards)

    def press(self, load: LoadPath, keep: Sequence[str] = ()) -> Columns:
        """Press along a path of load.

        Returns
        -------
        dict of ndarray
            The scalars of `contact.press`, bulk_closure and interface_closure (m), and the name of the
            solver, shape (step,); maps (step, y, x); rms_slope, a number.
        """
        pressed = self._solve(fc.contact.solver.solve, load, keep=keep)
        columns = pressed.columns | pressed.maps
        columns |= {"rms_slope": np.array(self.rms_slope), "solver": np.array(pressed.solvers)}
        stiffness = self.problem.block_stiffness
        if np.isfinite(stiffness):
            bulk = columns["normal_force"] / stiffness
        else:  # the mean displacement of a periodic body is a rigid motion; the force may be NaN
            bulk = np.zeros_like(columns["closure"])
        return columns | {"bulk_closure": bulk, "interface_closure": columns["closure"] - bulk}

    def shear(self, path: ShearPath, keep: Sequence[str] = ()) -> Sheared:
        """Press by the load, and push the block along a path of tangential force."""
        return self._solve(fc.contact.solver.solve_shear, self.problem.load, path, keep=keep)

    def _solve(self, solve: Callable[..., T], load: LoadPath, *path: ShearPath, keep: Sequence[str]) -> T:
        """Check that a load is in proportion to the heights, and solve; an error names caller and shear."""
        problem = self.problem.grid, self.problem.modulus, self.problem.options, load
        try:
            with Problems("") as problems:
                fc.contact.solver.check_scale(problems, float(np.ptp(self.heights)), *problem)
            return solve(self.heights, *problem, *path, keep=keep)
        except InvalidInput as error:
            lines = [f"{line} ({self.place})" for line in error.problems]
            raise type(error)("", lines) from error


class Spring(NamedTuple):
    """A spring above the block: the rigid dilatancy against it, m, shape (direction, shear), and k A, N/m."""

    dilatancy: Array
    stiffness: float


def closure_columns(
    problem: JointProblem,
    shears: Array,
    directions: Sequence[Direction],
    progress: bool = False,
    *,
    pressed: xr.Dataset | None = None,
    spring: Spring | None = None,
) -> Columns:
    """Press the crack together at every shear along the same path of load, or against a spring.

    What a result of `closure` has `pressed` already is taken from it.

    Returns
    -------
    dict of ndarray
        As `ShearedContact.press`, with direction and shear as first axes.
    """
    by_direction = []
    for i, towards in enumerate(directions):
        rows, at_rest = [], None
        if spring is not None:
            at_rest = ShearedContact.of_crack(problem, 0.0, towards).press(problem.load)
        for j, shear in enumerate(track(shears, progress, f"press, towards {towards.name}", unit="shear")):
            columns = None if pressed is None else _pressed_columns(pressed, shear, towards, problem.load)
            if columns is None:
                contact = ShearedContact.of_crack(problem, float(shear), towards)
                if spring is None or at_rest is None:
                    columns = contact.press(problem.load, problem.keep)
                else:
                    openings = spring.dilatancy[i, j] + at_rest["interface_closure"]
                    columns = press_against_spring(contact, openings, spring.stiffness)
            rows.append(columns)
        by_direction.append(stacked(rows))
    columns = stacked(by_direction)
    fc.contact.solver.warn_steep(
        "fractalcontact.joints: the delta-surface", float(columns["rms_slope"].max())
    )
    return columns


def stacked(rows: Sequence[Columns]) -> Columns:
    """Return the columns of several solutions with a first axis over them."""
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def press_against_spring(contact: ShearedContact, openings: Array, stiffness: float) -> Columns:
    """Press the crack together at one shear against a spring of stiffness k A, N/m.

    The force on the block is N = N0 + k A (delta(N, v) - delta(N0, 0)), and never below zero. For every
    initial force N0 it is bracketed and solved (Brent): the closure grows with the force, so that the
    difference of the two sides changes its sign once. `openings` are those of the rigid faces from
    delta(N0, 0) on, m.
    """
    steps = [
        _press_balanced(contact, float(force), float(opening), stiffness)
        for force, opening in zip(contact.problem.load.values, openings, strict=True)
    ]
    slope = {"rms_slope": steps[0].pop("rms_slope")}
    return slope | {name: np.concatenate([step[name] for step in steps]) for name in steps[0]}


def _press_balanced(
    contact: ShearedContact,
    initial: float,
    opening: float,
    stiffness: float,
    *,
    error: float = 1e-7,  # of the force, relative; 1e-5 takes a tenth less time
    most: int = 60,  # solutions for one force: 189 of them took 6 in the median and 13 at most
) -> Columns:
    """Press under the force that balances the spring; `opening` is that of the rigid faces, m."""
    from scipy.optimize import brentq

    def press(force: float, keep: Sequence[str] = ()) -> Columns:
        return contact.press(replace(contact.problem.load, values=(force,)), keep)

    def excess(force: float) -> float:
        interface_closure = press(force)["interface_closure"][0] if force > 0 else 0.0
        return float(force - initial - stiffness * (opening - interface_closure))

    @cache  # the search asks again for its ends
    def log_excess(log_force: float) -> float:
        return excess(math.exp(log_force))

    if initial + stiffness * opening <= 0:  # the faces sink away from the spring
        return press(0.0, contact.problem.keep)
    at_initial = excess(initial)
    if abs(at_initial) <= error * (initial + stiffness * abs(opening)):
        return press(initial, contact.problem.keep)
    floor = math.log(initial) if initial > 0 and at_initial < 0 else -math.inf
    # from a force of the order that closes the opening: from 1e-3 / eps times it on, rounding of the bulk
    # closure is more than a thousandth of the opening
    area, step = contact.problem.crack.nominal_area, 7.0  # e^7 = 1e3
    closing = math.log(max(initial, contact.problem.modulus * math.sqrt(area) * abs(opening)))
    top = min(math.log(initial - min(at_initial, 0.0)), closing - math.log(math.ulp(1.0)) - step)
    low = high = min(top, closing)
    while high < top and log_excess(high) < 0:
        low, high, step = high, min(high + step, top), 2 * step
    while low > floor and log_excess(low) > 0:
        low, high, step = max(low - step, floor), low, 2 * step
    if low < high:
        expected = f"a spring that the faces can balance ({contact.place})"
        require(log_excess(high) >= 0, "normal_stiffness", expected, stiffness / area)
        # the closure is nearly linear in the logarithm of the force
        low = brentq(log_excess, low, high, xtol=error, maxiter=most)
    return press(math.exp(low), contact.problem.keep)


def _check_pressed(problems: Problems) -> None:
    """Check that `pressed` is a result of `closure` for this crack, pressed in this way."""
    given = problems.given
    expected = "a result of `joints.closure` for the same crack, bulk part and solver"
    entry = provenance_of(given.pressed) if isinstance(given.pressed, xr.Dataset) else {}
    is_closure = entry.get("call") == "fractalcontact.joints.closure"
    if problems.require(is_closure, "pressed", expected) and isinstance(given.crack, Crack):
        wanted = {name: getattr(given, name) for name in ("crack", "bulk", *CONTACT_OPTIONS)}
        others = differing(entry, wanted)
        problems.require(not others, "pressed", expected, f"one with another {', '.join(others)}")
    problems.require(number_of_entries(given.keep) == 0, "pressed", "nothing beside `keep`")


def _pressed_columns(pressed: xr.Dataset, shear: float, towards: Direction, load: LoadPath) -> Columns | None:
    """Return the columns of `ShearedContact.press` from a result of `closure`; None if it lacks a load."""
    names, shears = np.atleast_1d(pressed["direction"].values), pressed["shear"].values
    if towards.name not in names or shear not in shears:
        return None
    place: dict[str, Any] = {"direction": int(np.flatnonzero(names == towards.name)[0])}
    place |= {"shear": int(np.flatnonzero(shears == shear)[0])}
    at_shear = pressed.isel(place, missing_dims="ignore")
    loads = at_shear[load.control].values
    steps = [np.flatnonzero(loads == value) for value in load.values]
    if not all(places.size for places in steps):
        return None
    if "plastic_work" in at_shear and not np.array_equal(loads[: len(steps)], load.values):
        return None  # what yielded depends on the path
    at_load = at_shear.isel(step=[int(places[0]) for places in steps])
    of_steps = [str(name) for name, variable in at_load.variables.items() if variable.dims == ("step",)]
    columns = {name: at_load[name].values for name in of_steps if name != "step"}
    return columns | {"rms_slope": at_load["rms_slope"].values, "solver": np.full(len(steps), "as pressed")}


def closure_dataset(
    problem: JointProblem,
    shears: Array,
    directions: Sequence[Direction],
    progress: bool = False,
    *,
    pressed: xr.Dataset | None = None,
    spring: Spring | None = None,
) -> xr.Dataset:
    """Return the columns of `closure_columns` over (direction, shear, step), and maps over (..., y, x).

    Without a spring the prescribed load is the same at every shear, and a coordinate of `step` alone.
    """
    crack, load = problem.crack, problem.load
    columns = closure_columns(problem, shears, directions, progress, pressed=pressed, spring=spring)
    dims = ("direction", "shear", "step", "y", "x")
    variables: dict[str, Any] = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    solvers = variables.pop("solver")[1]
    coords: dict[str, Any] = {name: variables.pop(name) for name in LOADS}
    if spring is None:
        imposed = ("closure",) if load.control == "closure" else ("normal_force", "nominal_pressure")
        coords |= {name: ("step", columns[name][0, 0]) for name in imposed}
        coords[load.control] = ("step", np.array(load.values))  # as given, without rounding
    coords |= {"shear": ("shear", shears), "step": np.arange(columns["closure"].shape[2])}
    coords |= direction_coords(directions)
    if any(values.ndim > 3 for values in columns.values()):
        every = slice(None, None, problem.factor)
        coords |= {dim: values[every] for dim, values in block_coords(crack).items()}
    result = xr.Dataset(variables, coords).assign(nominal_area=crack.nominal_area)
    result["bulk_closure"].attrs["comment"] = BULK[problem.bulk][1]
    residual = float(np.max(columns["residual"]))
    stated = {"references": problem.references, **problem.options.stated_on(problem.grid)}
    stated["solver"] = fc.contact.solver.solvers_in_words(solvers.ravel().tolist())
    result.attrs.update(stated, achieved_residual=residual)
    return result
