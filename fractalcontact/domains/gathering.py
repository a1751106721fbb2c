"""What the functions of this room say of a mask, gathered under names that go together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.grid import contact_edges
from fractalcontact.domains import crossing, labelling
from fractalcontact.domains._labels import Labels
from fractalcontact.domains._masks import Array, Planes
from fractalcontact.domains.counting import box_dimension
from fractalcontact.domains.edges import boundary_dimension
from fractalcontact.domains.gliding import lacunarity
from fractalcontact.domains.growing import minkowski_dimension
from fractalcontact.domains.pairing import correlation_dimension

if TYPE_CHECKING:
    import xarray as xr

# parts, each the result of a function, that are renamed where names meet
FUNCTIONS: dict[str, Callable[..., xr.Dataset]] = {
    "box_dimension": box_dimension,
    "minkowski_dimension": minkowski_dimension,
    "correlation_dimension": correlation_dimension,
    "boundary_dimension": boundary_dimension,
    "lacunarity": lacunarity,
}
PARTS = ("islands", "percolation", *FUNCTIONS)
LEFT_OUT = ("run_time", "scale_min", "scale_max")

Variable = tuple[tuple[str, ...], Array]


class Gathered:
    """Variables, coordinates and notes of several results on the same planes."""

    def __init__(self, planes: Planes) -> None:
        self.planes = planes
        self.variables: dict[str, Variable] = {"coverage": planes.variable(planes.coverage)}
        self.coords: dict[str, Any] = {}
        self.notes: dict[str, dict[str, str]] = {}

    def scalars(self) -> dict[str, Variable]:
        """Return the variables that have one value for each plane."""
        return {name: one for name, one in self.variables.items() if one[0] == self.planes.dims}


def measure(
    mask: xr.DataArray,
    planes: Planes,
    wanted: Sequence[str],
    found: Sequence[Labels],
    connectivity: int,
    told: Mapping[str, Any],
) -> Gathered:
    """Measure the wanted parts; `told` are the arguments that every function takes."""
    out = Gathered(planes)
    if "islands" in wanted:
        spacing = planes.grid.spacing if planes.grid.known else (np.nan, np.nan)
        sides = contact_edges(planes.cells, planes.grid.periodic) @ np.array([spacing[1], spacing[0]])
        values = {"total_perimeter": sides, **labelling.summary(found, planes, connectivity)}
        out.variables.update({name: planes.variable(one) for name, one in values.items()})
    if "percolation" in wanted:
        crossed = crossing.across(found, planes)
        out.variables["largest_share"] = planes.variable(crossed["largest_share"])
        out.variables["percolates"] = planes.variable(crossed["percolates"], "axis")
        out.coords["axis"] = ("axis", np.array(crossing.AXES))
        out.notes["percolates"] = {"long_name": crossing.meaning(connectivity)}
    results = {name: FUNCTIONS[name](mask, **told) for name in FUNCTIONS if name in wanted}
    own = [one["box_size"].values for one in results.values() if "box_size" in one.coords]
    sizes = np.unique(np.concatenate([np.empty(0, np.int64), *own]))
    if sizes.size:
        out.coords["box_size"] = ("box_size", sizes)
        out.coords["box_length"] = ("box_size", sizes * planes.side)
    for name, result in results.items():
        _add(out, name, result, sizes)
    return out


def _add(out: Gathered, name: str, result: xr.Dataset, sizes: Array) -> None:
    for key, variable in result.data_vars.items():
        if key in LEFT_OUT:
            continue
        new, dims, values = _renamed(name, str(key)), tuple(map(str, variable.dims)), variable.values
        if "box_size" in dims:
            values = _at(sizes, result["box_size"].values, values)
        out.variables[new] = dims, values
        if "comment" in variable.attrs:
            out.notes[new] = {"comment": variable.attrs["comment"]}
    if "radius" in result.coords:
        out.coords["radius"] = ("radius", result["radius"].values)
        out.coords["radius_length"] = ("radius", result["radius_length"].values)
    if "scale_min" in result and np.isfinite(result["scale_min"]).any():
        low, high = float(result["scale_min"].max()), float(result["scale_max"].max())
        note = out.notes.setdefault(name, {})
        reason = f"{note['comment']}; " if "comment" in note else ""
        note["comment"] = f"{reason}fitted over {low:.3g} to {high:.3g} cells"


def _renamed(name: str, key: str) -> str:
    """Return the name of a variable where those of other functions stand beside it."""
    if key in ("ci_low", "ci_high"):
        return f"{name}_{key.removeprefix('ci_')}"
    kind = name.removesuffix("_dimension")
    if key == "local_slope" or (key == "null_dimension" and kind != "box"):
        return f"{kind}_{key}"
    return key


def _at(sizes: Array, own: Array, values: Array) -> Array:
    """Spread a curve over the sizes of all; NaN where it was not measured."""
    out = np.full((*values.shape[:-1], sizes.size), np.nan)
    out[..., np.searchsorted(sizes, own)] = values
    return out
