"""A sheared crack under load: its delta-surface pressed by a flat, and the bulk part taken out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import grid_of
from fractalcontact.base.progress import track
from fractalcontact.joints._checks import block_coords
from fractalcontact.joints.sliding import delta_plane

if TYPE_CHECKING:
    from fractalcontact.joints._directions import Direction
    from fractalcontact.joints.crack import Crack

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
MAPS = ("state", "pressure", "gap", "displacement")
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

    def parameters(self) -> dict[str, Any]:
        """Return the arguments for the provenance."""
        return {self.control: self.values, "bulk": self.bulk, "keep": self.keep, **self.solver}


def is_nothing(keep: Any) -> bool:
    """Say whether no map is to be kept."""
    return keep is None or (isinstance(keep, Sized) and len(keep) == 0)


def check_load(
    problems: Problems, loads: Mapping[str, Any], bulk: Any, keep: Any, solver: Mapping[str, Any]
) -> Load:
    """Check the path of load; exactly one of `loads` is given. The solver checks its own options."""
    control = problems.exactly_one(**loads) if len(loads) > 1 else next(iter(loads))
    given = loads[control]
    values = np.zeros(1) if given is None else problems.numbers(control, given, at_least=0)
    kept = () if is_nothing(keep) else problems.choices("keep", keep, MAPS)
    return Load(control, values, problems.choice("bulk", bulk, BULK), kept, solver)


def press_sheared(
    crack: Crack, shears: Sequence[float] | Array, towards: Direction, load: Load, where: str, progress: bool
) -> dict[str, Array]:
    """Press the crack together at every shear.

    Returns
    -------
    dict of ndarray
        What `press` gives, and bulk_closure and interface_closure (m), shape (shear, step); maps (shear,
        step, y, x).
    """
    steps = track(shears, progress, f"press, towards {towards.name}", unit="shear")
    results = [_press(crack, float(shear), towards, load, where) for shear in steps]
    return {name: np.stack([result[name] for result in results]) for name in results[0]}


def _press(crack: Crack, shear: float, towards: Direction, load: Load, where: str) -> dict[str, Array]:
    import xarray as xr

    from fractalcontact.contact import flat_stiffness, press

    heights = delta_plane(crack, shear, towards, where)
    surface = xr.DataArray(heights, dims=("y", "x"), coords=block_coords(crack, crack.layout))
    boundary = "periodic" if all(crack.layout.periodic) else "free"
    imposed: dict[str, Any] = {load.control: load.values}
    try:
        pressed = press(
            surface,
            contact_modulus=crack.contact_modulus,
            boundary=boundary,
            keep=load.keep,
            **imposed,
            **load.solver,
        )
    except InvalidInput as error:
        lines = [f"{line} (at a shear of {shear:g} m towards {towards.name})" for line in error.problems]
        raise InvalidInput(where, lines) from error
    with Problems(where) as problems:
        # the spacing as the solver reads it, so that a flat block is the same to the last bit
        spacing = grid_of(surface, problems, "delta-surface").spacing
    stiffness = flat_stiffness(
        crack.layout.cells,
        (spacing[0], spacing[1]),
        contact_modulus=crack.contact_modulus,
        boundary=boundary,
        influence=load.solver["influence"],
        disc_radius=load.solver["disc_radius"],
        settlement=BULK[load.bulk][0],
    )
    found = {name: pressed[name].values for name in (*_MEASURES, *load.keep)}
    found["bulk_closure"] = found["normal_force"] / stiffness
    found["interface_closure"] = found["closure"] - found["bulk_closure"]
    return found
