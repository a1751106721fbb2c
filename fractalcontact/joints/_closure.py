"""Closure of a sheared crack: its delta-surface is pressed by a flat, and the bulk part is subtracted."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

import fractalcontact as fc  # loads `contact` on first use: a study of rigid faces needs no solver
from fractalcontact.base.errors import ConvergenceWarning, InvalidInput, SmallStrainWarning
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.memory import Plane, map_bytes
from fractalcontact.base.numbers import float_array, number_of_entries
from fractalcontact.base.progress import track
from fractalcontact.base.provenance import content, plain
from fractalcontact.base.references import PAPER, joined_references
from fractalcontact.base.results import provenance_of, public_result
from fractalcontact.base.schema import CONTACT_MAPS, STEEP, STOP_REASONS
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.joints._compass import Direction, direction_coords, is_single, read_directions
from fractalcontact.joints._crack import Crack, block_coords, check_elastic, check_sliding
from fractalcontact.joints._delta_surface import delta_heights, interpolation_errors

Array = np.ndarray[Any, np.dtype[Any]]
Path = float | Sequence[float] | Array

WHERE = "fractalcontact.joints.closure"
# how the faces of the flat block are loaded, and what that makes of the bulk part of the closure
BULK = {
    "flat_block": (
        "rigid",
        "closure of the flat block under the same force and the same influence coefficients",
    ),
    "uniform_pressure": (
        "uniform",
        "mean displacement of the flat block under the same force, uniformly spread",
    ),
}
LOADS = ("closure", "normal_force", "nominal_pressure")
SCALARS = (
    *LOADS, "contact_area", "contact_fraction", "corrected_contact_fraction", "mean_gap", "elastic_energy",
    "iterations", "residual", "converged", "stop_reason", "run_time",
)  # fmt: skip
UNDETERMINED = (
    "NaN where periodic faces are closed to the mean plane of the delta-surface or beyond: "
    "no force is then determined"
)
BLOCK_BYTES = 40.0  # of a cell: the delta-surface, the flat block and what both are made of
STEPS_SHOWN = 5  # in a warning


def _check(
    problems: Problems,
    *,
    crack: Any,
    shear: Any,
    direction: Any,
    closure: Any,
    normal_force: Any,
    nominal_pressure: Any,
    bulk: Any,
    keep: Any,
    **solver: Any,
) -> None:
    check_sliding(problems, crack, shear, direction)
    load = problems.construct(
        fc.contact.LoadPath.from_keywords,
        closure=closure,
        normal_force=normal_force,
        nominal_pressure=nominal_pressure,
    )
    check_pressing(problems, crack, load, bulk, keep, solver)


def pressing_memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of pressing the block at one shear after the other, with the maps of all of them."""
    pressed = fc.contact.press.memory(plane, arguments)  # type: ignore[operator]
    shears = max(1, int(np.size(arguments["shear"]))) if "shear" in arguments else 1
    steps = max(
        (int(np.size(arguments[name])) for name in LOADS if arguments.get(name) is not None), default=1
    )
    maps = shears * steps * sum(map_bytes(name) for name in word_tuple(arguments.get("keep")))
    return float(pressed) + plane.cells * (BLOCK_BYTES + 2.0 * maps)


@public_result(title="closure of a sheared crack", check=_check, memory=pressing_memory)
def closure(
    crack: Crack,
    *,
    shear: Path,
    direction: str | float | Sequence[str | float] = "E",
    closure: Path | None = None,
    normal_force: Path | None = None,
    nominal_pressure: Path | None = None,
    bulk: str = "flat_block",
    keep: Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    hardness: float | None = None,
    tolerance: float = 1e-8,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the closure of a sheared crack under a path of load.

    The delta-surface of every shear is pressed together along the same path. The closure w counts from first
    touch at that shear; without its bulk part, w_int = w - w_b(F), it is 0 to rounding for mated faces.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Direction of sliding: compass word or azimuth in degrees (E = 0, anticlockwise). A sequence gives the
        result a first dim `direction`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach from first touch (m), force on the block (N), or force over its area
        (Pa). A sequence is a path of load, which may go up and down.
    bulk : {"flat_block", "uniform_pressure"}
        Bulk part w_b: closure of the flat block, or its mean displacement under uniform pressure (about 9 %
        more for a square). Zero for periodic bodies.
    keep : sequence of str
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
    load = fc.contact.LoadPath.from_keywords(
        closure=closure, normal_force=normal_force, nominal_pressure=nominal_pressure
    )
    options = fc.contact.ContactOptions(
        influence=influence, disc_radius=disc_radius, hardness=hardness, tolerance=tolerance, method=method
    )
    pressing = Pressing(load, options, bulk, word_tuple(keep), WHERE)
    pressed = [press_sheared(crack, shears, towards, pressing, progress) for towards in directions]
    for towards, columns in zip(directions, pressed, strict=True):
        warn_unconverged(columns, shears, towards, WHERE, stacklevel=4)
    warn_steep(pressed, WHERE, stacklevel=4)
    result = _dataset(crack, shears, directions, pressed)
    if is_single(direction):
        result = result.isel(direction=0)
    result["bulk_closure"].attrs["comment"] = pressing.bulk_comment
    _explain_undetermined(result)
    residual = float(np.max([columns["residual"].max() for columns in pressed]))
    return result.assign_attrs(achieved_residual=residual, references=pressing_references(crack, options))


def _dataset(
    crack: Crack, shears: Array, directions: Sequence[Direction], pressed: Sequence[dict[str, Array]]
) -> xr.Dataset:
    """Return the columns of all directions over (direction, shear, step), and maps over (..., y, x)."""
    columns = {name: np.stack([each[name] for each in pressed]) for name in pressed[0]}
    columns["rms_slope"] = columns["rms_slope"][..., 0]
    dims = ("direction", "shear", "step", "y", "x")
    variables: dict[str, Any] = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    variables["interpolation_error"] = dims[:2], interpolation_errors(crack, shears, directions)
    coords: dict[str, Any] = {name: variables.pop(name) for name in LOADS}
    coords |= {"shear": ("shear", shears), "step": np.arange(columns["closure"].shape[2])}
    coords |= direction_coords(directions)
    if any(values.ndim > 3 for values in columns.values()):
        coords |= block_coords(crack)
    return xr.Dataset(variables, coords).assign(nominal_area=crack.nominal_area)


def _explain_undetermined(result: xr.Dataset) -> None:
    """Add the reason where an elastic body does not determine the force."""
    if bool((result["stop_reason"] == STOP_REASONS["beyond_full_contact"]).any()):
        for name, variable in result.variables.items():
            is_measured = "step" in variable.dims and variable.dtype.kind == "f"
            if is_measured and bool(np.isnan(variable.values).any()):
                result[name].attrs["reason"] = UNDETERMINED


def warn_unconverged(
    columns: dict[str, Array], shears: Array, towards: Direction, where: str, *, stacklevel: int
) -> None:
    """Warn of the shears and steps at which the solver did not meet its tolerance."""
    failed = np.argwhere(~columns["converged"])
    if failed.size == 0:
        return
    reasons = list(STOP_REASONS)
    shown = "; ".join(
        f"shear {shears[i]:g} m towards {towards.name}, step {j}: {reasons[columns['stop_reason'][i, j]]} "
        f"(residual {columns['residual'][i, j]:.2g})"
        for i, j in failed[:STEPS_SHOWN]
    )
    more = f"; and {len(failed) - STEPS_SHOWN} more" if len(failed) > STEPS_SHOWN else ""
    warnings.warn(f"{where}: not converged: {shown}{more}", ConvergenceWarning, stacklevel=stacklevel)


def warn_steep(pressed: Sequence[dict[str, Array]], where: str, *, stacklevel: int) -> None:
    """Warn once, of all shears and directions, of delta-surfaces beyond small strains."""
    slope = max(float(columns["rms_slope"].max()) for columns in pressed)
    if slope > STEEP:
        warnings.warn(
            f"{where}: the delta-surface has an rms slope of up to {slope:.2g}; beyond {STEEP:g} strains are "
            "not small, and linear elasticity is an approximation",
            SmallStrainWarning,
            stacklevel=stacklevel,
        )


@dataclass(frozen=True)
class Pressing:
    """How a sheared crack is pressed: load, solver options, bulk part, maps to keep, and the caller."""

    load: fc.contact.LoadPath
    options: fc.contact.ContactOptions
    bulk: str
    keep: tuple[str, ...]
    where: str

    @property
    def bulk_comment(self) -> str:
        """What the bulk part of the closure is."""
        return BULK[self.bulk][1]


def check_pressing(
    problems: Problems,
    crack: Any,
    load: fc.contact.LoadPath | None,
    bulk: Any,
    keep: Any,
    solver: dict[str, Any],
) -> None:
    """Check what `Pressing` needs; `load` is None where it has problems of its own."""
    if keep is not None:
        problems.choices("keep", keep, CONTACT_MAPS)
    problems.choice("bulk", bulk, BULK)
    options = problems.construct(fc.contact.ContactOptions, **solver)
    if options is None or not isinstance(crack, Crack):
        return
    layout = crack.layout
    replace(options, boundary=_boundary(crack)).check_grid(
        Grid(layout.cells, layout.spacing, layout.periodic), problems
    )
    if load is not None:
        check_elastic(problems, crack)
        options.check_load(load, crack.nominal_area, problems)


def pressing_references(crack: Crack, options: fc.contact.ContactOptions) -> str:
    """Return the sources of the closure of a delta-surface and of the solver that presses it."""
    layout = crack.layout
    used = replace(options, boundary=_boundary(crack))
    return joined_references(PAPER, used.references(Grid(layout.cells, layout.spacing, layout.periodic)))


def _boundary(crack: Crack) -> str:
    return "periodic" if all(crack.layout.periodic) else "free"


class ShearedContact:
    """The delta-surface of one shear between its two bodies, to be pressed along paths of load.

    With a `factor` only every so many of its heights are kept along both axes.
    """

    def __init__(
        self, crack: Crack, shear: float, towards: Direction, pressing: Pressing, factor: int = 1
    ) -> None:
        self.keep, self.where = pressing.keep, pressing.where
        self.modulus = crack.contact_modulus
        self.place = f"at a shear of {shear:g} m towards {towards.name}"
        self.options = replace(pressing.options, boundary=_boundary(crack))
        heights = delta_heights(crack, shear, towards, self.where)
        surface = xr.DataArray(heights, dims=("y", "x"), coords=block_coords(crack))
        self.surface = surface.isel(y=slice(None, None, factor), x=slice(None, None, factor))
        # the spacing as the solver reads it, so that a flat block is the same to the last bit
        grid = read_grid(self.surface)
        self.stiffness = fc.contact.flat_stiffness(
            (grid.shape[0], grid.shape[1]),
            (grid.spacing[0], grid.spacing[1]),
            contact_modulus=self.modulus,
            boundary=_boundary(crack),
            influence=self.options.influence,
            disc_radius=self.options.disc_radius,
            loading=BULK[pressing.bulk][0],
        )

    def press(self, load: fc.contact.LoadPath, keep: Sequence[str] = ()) -> dict[str, Array]:
        """Press along a path of load.

        Returns
        -------
        dict of ndarray
            The scalars of `contact.press`, and bulk_closure and interface_closure (m), shape (step,); maps
            (step, y, x).
        """
        pressed = self._solve(load, keep)
        scalars = SCALARS if self.options.hardness is None else (*SCALARS, "plastic_work")
        columns = {name: pressed[name].values for name in (*scalars, *keep)}
        columns["rms_slope"] = np.full(pressed.sizes["step"], float(pressed["rms_slope"]))
        # the mean displacement of a periodic body is a rigid motion, whatever the force: no bulk part
        has_bulk = np.isfinite(self.stiffness)
        bulk = columns["normal_force"] / self.stiffness if has_bulk else 0.0 * columns["closure"]
        return columns | {"bulk_closure": bulk, "interface_closure": columns["closure"] - bulk}

    def _solve(self, load: fc.contact.LoadPath, keep: Sequence[str]) -> xr.Dataset:
        try:
            with warnings.catch_warnings():
                # one warning follows for all shears
                for category in (ConvergenceWarning, SmallStrainWarning):
                    warnings.simplefilter("ignore", category)
                return fc.contact.press(
                    self.surface,
                    contact_modulus=self.modulus,
                    keep=keep,
                    **self.options.keywords(),
                    **load.keywords(),
                )
        except InvalidInput as error:
            raise InvalidInput(self.where, [f"{line} ({self.place})" for line in error.problems]) from error


def press_sheared(
    crack: Crack,
    shears: Array,
    towards: Direction,
    pressing: Pressing,
    progress: bool,
    *,
    factor: int = 1,
    pressed: xr.Dataset | None = None,
) -> dict[str, Array]:
    """Press the crack together at every shear along the same path of load, with every `factor`-th height.

    What a result of `closure` has `pressed` already is taken from it.

    Returns
    -------
    dict of ndarray
        As `ShearedContact.press`, with the shear as first axis.
    """
    results = []
    for shear in track(shears, progress, f"press, towards {towards.name}", unit="shear"):
        columns = None if pressed is None else _held_columns(pressed, shear, towards, pressing.load)
        if columns is None:
            contact = ShearedContact(crack, float(shear), towards, pressing, factor)
            columns = contact.press(pressing.load, pressing.keep)
        results.append(columns)
    return {name: np.stack([result[name] for result in results]) for name in results[0]}


def check_pressed(
    problems: Problems, crack: Any, pressed: Any, keep: Any, bulk: Any, solver: dict[str, Any]
) -> None:
    """Check that a result of `closure` is that of this crack, pressed in this way; None passes."""
    if pressed is None or not isinstance(crack, Crack):
        return
    expected = "a result of `joints.closure` for the same crack, bulk part and solver"
    entry = provenance_of(pressed) if isinstance(pressed, xr.Dataset) else {}
    stated, wanted = entry.get("parameters", {}), {"crack": crack, "bulk": bulk, **solver}
    differing = [name for name in wanted if content(stated.get(name)) != content(plain(wanted[name]))]
    is_closure = entry.get("call") == "fractalcontact.joints.closure"
    if problems.require(is_closure, "pressed", expected, pressed):
        problems.require(not differing, "pressed", expected, f"one with another {', '.join(differing)}")
    problems.require(solver.get("hardness") is None, "pressed", "nothing with a hardness", pressed)
    problems.require(number_of_entries(keep) == 0, "pressed", "nothing beside `keep`", pressed)


def _held_columns(
    pressed: xr.Dataset, shear: float, towards: Direction, load: fc.contact.LoadPath
) -> dict[str, Array] | None:
    """Return the columns of `ShearedContact.press` from a result of `closure`; None if it lacks a load."""
    names, shears = np.atleast_1d(pressed["direction"].values), pressed["shear"].values
    if towards.name not in names or shear not in shears:
        return None
    place: dict[str, Any] = {"direction": int(np.flatnonzero(names == towards.name)[0])}
    place |= {"shear": int(np.flatnonzero(shears == shear)[0])}
    at_shear = pressed.isel(place, missing_dims="ignore")
    held = at_shear[load.control].values
    steps = [np.flatnonzero(held == value) for value in load.values]
    if not all(found.size for found in steps):
        return None
    at_load = at_shear.isel(step=[int(found[0]) for found in steps])
    columns = {name: at_load[name].values for name in (*SCALARS, "bulk_closure", "interface_closure")}
    return columns | {"rms_slope": np.full(len(steps), float(at_load["rms_slope"]))}
