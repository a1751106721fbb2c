"""A sheared crack under load: its delta-surface pressed by a flat, and the bulk part taken out."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import ConvergenceWarning, InvalidInput
from fractalcontact.base.grid import grid_of
from fractalcontact.base.progress import track
from fractalcontact.base.schema import STOP_REASONS
from fractalcontact.joints._checks import block_coords, is_nothing
from fractalcontact.joints.crack import Crack
from fractalcontact.joints.sliding import delta_plane

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints._directions import Direction

Array = np.ndarray[Any, np.dtype[Any]]

BULK = {
    "flat_block": (
        "rigid",
        "closure of the flat block under the same force and the same influence coefficients",
    ),
    "uniform_pressure": (
        "uniform",
        "mean settlement of the flat block under the same force, uniformly spread",
    ),
}
MAPS = ("state", "pressure", "gap", "displacement", "residual_height")
METHODS = ("fast", "elimination")
_SHOWN = 5  # steps that a warning names
_MEASURES = (
    "closure", "normal_force", "nominal_pressure", "contact_area", "contact_fraction",
    "corrected_contact_fraction", "mean_gap", "elastic_energy", "iterations", "residual", "converged",
    "stop_reason", "run_time",
)  # fmt: skip


@dataclass(frozen=True)
class Load:
    """A checked path of load: what is imposed, how the bulk is taken out, what is kept, solver options."""

    control: str
    values: Array
    bulk: str
    keep: tuple[str, ...]
    solver: Mapping[str, Any]

    @property
    def bulk_comment(self) -> str:
        """What the bulk part of the closure is."""
        return BULK[self.bulk][1]

    @property
    def measures(self) -> tuple[str, ...]:
        """The scalars of a step that `press` gives."""
        yields = self.solver["hardness"] is not None
        return (*_MEASURES, "plastic_work") if yields else _MEASURES

    def parameters(self) -> dict[str, Any]:
        """Return the arguments for the provenance."""
        return {self.control: self.values, "bulk": self.bulk, "keep": self.keep, **self.solver}


def check_load(
    problems: Problems, crack: Any, loads: Mapping[str, Any], bulk: Any, keep: Any, solver: Mapping[str, Any]
) -> Load:
    """Check the path of load, of which exactly one of `loads` is given, and the options of the solver."""
    control = problems.exactly_one(**loads) if len(loads) > 1 else next(iter(loads))
    given = loads[control]
    values = np.zeros(1) if given is None else problems.numbers(control, given, at_least=0)
    kept = () if is_nothing(keep) else problems.choices("keep", keep, MAPS)
    load = Load(control, values, problems.choice("bulk", bulk, BULK), kept, solver)
    _check_solver(problems, crack, load)
    return load


def _check_solver(problems: Problems, crack: Any, load: Load) -> None:
    from fractalcontact.contact._setup import make_body

    problems.number("tolerance", load.solver["tolerance"], above=0, below=1)
    elimination = problems.choice("method", load.solver["method"], METHODS) == "elimination"
    hardness = load.solver["hardness"]
    if hardness is not None:
        hardness = problems.number("hardness", hardness, above=0)
        problems.require(not elimination, "hardness", "None with method='elimination'", hardness)
    if not isinstance(crack, Crack):
        return
    layout = crack.layout
    options = load.solver["influence"], load.solver["disc_radius"]
    make_body(layout.cells, layout.spacing, all(layout.periodic), *options, problems)
    if hardness is not None and load.control != "closure" and not problems.found:
        pressures = load.values / (crack.nominal_area if load.control == "normal_force" else 1.0)
        greatest = float(pressures.max())
        expected = f"a nominal pressure of at most the hardness, {hardness:g} Pa"
        problems.require(greatest <= hardness * (1 + 1e-12), load.control, expected, f"{greatest:g} Pa")


class Pressing:
    """One delta-surface between its two bodies, ready to be pressed along paths of load."""

    def __init__(self, crack: Crack, shear: float, towards: Direction, load: Load, where: str) -> None:
        import xarray as xr

        from fractalcontact.contact import flat_stiffness

        self.load, self.where, self.modulus = load, where, crack.contact_modulus
        self.place = f"at a shear of {shear:g} m towards {towards.name}"
        self.boundary = "periodic" if all(crack.layout.periodic) else "free"
        heights = delta_plane(crack, shear, towards, where)
        self.surface = xr.DataArray(heights, dims=("y", "x"), coords=block_coords(crack, crack.layout))
        with Problems(where) as problems:
            # the spacing as the solver reads it, so that a flat block is the same to the last bit
            spacing = grid_of(self.surface, problems, "delta-surface").spacing
        self.stiffness = flat_stiffness(
            crack.layout.cells,
            (spacing[0], spacing[1]),
            contact_modulus=self.modulus,
            boundary=self.boundary,
            influence=load.solver["influence"],
            disc_radius=load.solver["disc_radius"],
            loading=BULK[load.bulk][0],
        )

    def along(self, values: Array, keep: Sequence[str] = ()) -> dict[str, Array]:
        """Press along a path of load.

        Returns
        -------
        dict of ndarray
            What `press` gives, and bulk_closure and interface_closure (m), shape (step,); maps (step, y, x).
        """
        pressed = self._pressed(values, keep)
        found = {name: pressed[name].values for name in (*self.load.measures, *keep)}
        # the mean settlement of a periodic body is a rigid motion, whatever the force
        settles = np.isfinite(self.stiffness)
        found["bulk_closure"] = found["normal_force"] / self.stiffness if settles else 0.0 * found["closure"]
        found["interface_closure"] = found["closure"] - found["bulk_closure"]
        return found

    def _pressed(self, values: Array, keep: Sequence[str]) -> xr.Dataset:
        from fractalcontact.contact import press

        imposed: dict[str, Any] = {self.load.control: values}
        options: dict[str, Any] = {"boundary": self.boundary, "keep": keep, **self.load.solver, **imposed}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # told once, for all shears
                return press(self.surface, contact_modulus=self.modulus, **options)
        except InvalidInput as error:
            raise InvalidInput(self.where, [f"{line} ({self.place})" for line in error.problems]) from error


def press_sheared(
    crack: Crack, shears: Sequence[float] | Array, towards: Direction, load: Load, where: str, progress: bool
) -> dict[str, Array]:
    """Press the crack together at every shear along the same path of load.

    Returns
    -------
    dict of ndarray
        As `Pressing.along`, with the shear as first axis.
    """
    steps = track(shears, progress, f"press, towards {towards.name}", unit="shear")
    results = [
        Pressing(crack, float(shear), towards, load, where).along(load.values, load.keep) for shear in steps
    ]
    found = {name: np.stack([result[name] for result in results]) for name in results[0]}
    warn(found, np.asarray(shears), towards, where)
    return found


def warn(found: dict[str, Array], shears: Array, towards: Direction, where: str) -> None:
    """Say at which shears and steps the solver did not meet its tolerance."""
    failed = np.argwhere(~found["converged"])
    if failed.size == 0:
        return
    words = list(STOP_REASONS)
    told = "; ".join(
        f"shear {shears[i]:g} m towards {towards.name}, step {j}: {words[found['stop_reason'][i, j]]} "
        f"(residual {found['residual'][i, j]:.2g})"
        for i, j in failed[:_SHOWN]
    )
    more = f"; and {len(failed) - _SHOWN} more" if len(failed) > _SHOWN else ""
    warnings.warn(f"{where}: not converged: {told}{more}", ConvergenceWarning, stacklevel=4)


def explain(result: xr.Dataset) -> None:
    """Give the reason beside what an elastic body does not determine."""
    if bool((result["stop_reason"] == STOP_REASONS["beyond_full_contact"]).any()):
        for name, variable in result.variables.items():
            if name in result and variable.dtype.kind == "f" and bool(np.isnan(variable.values).any()):
                result[name].attrs["reason"] = (
                    "NaN where periodic faces are closed to the mean plane of the delta-surface or beyond: "
                    "no force is then determined"
                )
