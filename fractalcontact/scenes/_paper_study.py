"""What the 1998 paper states, and the results of a study at the shears and loads that it compares."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.units import number, scale_for
from fractalcontact.scenes._caveats import group_of

Array = np.ndarray[Any, np.dtype[Any]]

# what the paper states
DIMENSION = (2.15, 2.29)  # of the scanned face
PRESSURES = (2.5e6, 25e6, 75e6)  # Pa: 1, 10 and 30 kN on 2 x 2 cm
MIDDLE, PLATEAU, FAR = 4e-4, 8e-4, 8e-3  # m: the shears that it compares
PLATEAU_DILATANCY = 2e-3  # m
COEFFICIENTS = (1.0, 1.4)  # of friction, from Park and Paulay (1975)
FLAT_DIRECTIONS, RISING_DIRECTIONS = ("W", "N"), ("E", "S")

SAME_POINT = 0.01  # relative difference of a load or a shear from that of the paper

WHOLE_BLOCK = "whole_block"  # group of the box counts that several claims share

YES, NO, NOT_TESTED, BY_CONSTRUCTION = "yes", "no", "not tested", "by construction"


class Finding(NamedTuple):
    """The result of a study for one claim, and the verdict."""

    result: str
    verdict: str


class Closure(NamedTuple):
    """Closure laws towards W, or in the only direction: shear > 0, and values over (shear, step)."""

    shear: Array
    pressure: Array
    values: dict[str, Array]

    def up_to(self, greatest: float) -> Array:
        """Return which shears are at most this one."""
        return np.asarray(self.shear <= greatest * (1 + SAME_POINT))

    def at_shear(self, shear: float) -> int | None:
        """Return the index of a shear of the paper."""
        return nearest(self.shear, shear)

    def steps(self) -> list[int] | None:
        """Return the steps of the three pressures of the paper."""
        steps = [nearest(self.pressure, pressure) for pressure in PRESSURES]
        return None if None in steps else steps  # type: ignore[return-value]


def read_closure(tree: xr.DataTree, path: str, *names: str, fewest: int = 2) -> Closure | None:
    """Return a result over shear and step; None where it has too few shears."""
    data = group_of(tree, path)
    if data is None or "step" not in data.dims or data.sizes.get("shear", 1) < fewest:
        return None
    data = towards_west(data)
    data = data.isel(shear=np.flatnonzero(np.asarray(data["shear"].values) > 0))
    values = {
        name: np.asarray(data[name].transpose("shear", "step", ...).values, dtype=float) for name in names
    }
    pressure = np.asarray(data["nominal_pressure"].values, dtype=float)
    pressure = pressure.reshape(-1, pressure.shape[-1])[-1]
    return Closure(np.asarray(data["shear"].values, dtype=float), pressure, values)


def towards_west(data: xr.Dataset) -> xr.Dataset:
    """Return the results of sliding W; of the first direction where W is not among them."""
    if "direction" not in data.dims:
        return data
    names = [str(name) for name in data["direction"].values]
    return data.isel(direction=names.index("W") if "W" in names else 0)


def contact_maps(tree: xr.DataTree) -> xr.DataArray | None:
    """Return the maps of contact over shear > 0 and step; None where the study did not keep them."""
    if read_closure(tree, "joints/closure", "contact_fraction") is None:
        return None
    data = towards_west(tree["joints/closure"].to_dataset())
    if "state" not in data:
        return None
    states = data["state"].transpose("shear", "step", "y", "x")
    return states.isel(shear=np.flatnonzero(np.asarray(states["shear"].values) > 0))


def with_whole_block(tree: xr.DataTree) -> xr.DataTree:
    """Return a study with its domains counted in boxes from one cell to the block, where it kept the maps.

    Several claims are about this dimension over (shear > 0, step).
    """
    states = contact_maps(tree)
    if states is None:
        return tree
    from fractalcontact import domains

    edge = min(states.sizes["y"], states.sizes["x"])
    boxes = domains.box_dimension(states, scales=[size for size in range(1, edge + 1) if edge % size == 0])
    extended = tree.copy(deep=False)
    extended[WHOLE_BLOCK] = xr.DataTree(boxes[["box_dimension", "null_dimension"]])
    return extended


def read_whole_block(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return the dimension counted over the whole block and that of its null, over (shear > 0, step)."""
    boxes = group_of(tree, WHOLE_BLOCK)
    if boxes is None:
        return None
    values = (boxes[name].transpose("shear", "step").values for name in ("box_dimension", "null_dimension"))
    dimension, null = map(np.asarray, values)
    return dimension, null


def read_greatest_load(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return both dimensions at the greatest pressure of the paper, at the shears up to .80 mm."""
    closure, pair = read_closure(tree, "joints/closure", "contact_fraction"), read_whole_block(tree)
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None or pair is None:
        return None
    rows = closure.up_to(PLATEAU)
    return pair[0][rows, steps[-1]], pair[1][rows, steps[-1]]


class Rigid(NamedTuple):
    """Rigid dilatancy of two directions of the paper."""

    names: tuple[str, ...]
    shear: Array
    dilatancy: Array  # direction, shear
    plateau: int  # index of .80 mm
    mean_slope: Array


def read_rigid(tree: xr.DataTree, names: tuple[str, ...]) -> Rigid | None:
    data = group_of(tree, "joints/rigid_dilatancy")
    if data is None or "direction" not in data.dims or "shear" not in data.dims:
        return None
    present = [str(name) for name in data["direction"].values]
    shear = np.asarray(data["shear"].values, dtype=float)
    plateau = nearest(shear, PLATEAU)
    if plateau is None or not set(names) <= set(present):
        return None
    data = data.isel(direction=[present.index(name) for name in names])
    dilatancy = np.asarray(data["rigid_dilatancy"].transpose("direction", "shear").values)
    return Rigid(names, shear, dilatancy, plateau, np.asarray(data["mean_slope"].values))


def finding(result: str, is_true: bool) -> Finding:
    """Return a result with the verdict of a test."""
    return Finding(result, YES if is_true else NO)


def trend(result: str, values: Array, sign: int) -> Finding | None:
    """Return whether all columns of values over shear grow (+1) or fall (-1); None for a single shear."""
    if len(values) < 2:
        return None
    holds = sign * np.diff(values, axis=0) > 0
    change, columns = "grows" if sign > 0 else "falls", values.shape[1]
    over = f" over {columns} pressures" if columns > 1 else ""
    return finding(f"{result}; {change} in {int(holds.sum())} of {holds.size} steps{over}", bool(holds.all()))


def nearest(values: Array, wanted: float) -> int | None:
    """Return the index of a value, None where no value is the wanted one."""
    if not np.size(values):
        return None
    index = int(np.argmin(np.abs(values - wanted)))
    return index if abs(values[index] - wanted) <= SAME_POINT * wanted else None


def listed(values: Iterable[float], form: str = ".3g") -> str:
    """Return values in one form."""
    return ", ".join(f"{value:{form}}" for value in values)


def named(names: Iterable[str], values: Iterable[float], form: str) -> str:
    """Return values in one form, each after its name."""
    return ", ".join(f"{name} {value:{form}}" for name, value in zip(names, values, strict=True))


def span(values: Array) -> str:
    """Return the least and the greatest value, once where both read the same."""
    return " ... ".join(dict.fromkeys(f"{end:.2f}" for end in (np.nanmin(values), np.nanmax(values))))


def quantities(values: Iterable[float], units: str) -> str:
    """Return values with one prefix and unit for all."""
    listed_values = list(values)
    scale = scale_for(units, listed_values)
    return f"{', '.join(number(value) for value in scale(listed_values))} {scale.unit}"
