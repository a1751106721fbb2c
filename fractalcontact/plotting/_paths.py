"""Load and shear paths: which steps and shears a figure shows, and their labels."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting._inputs import nearest, table
from fractalcontact.plotting._style import spread_indices
from fractalcontact.plotting._units import name_of, scale_of

SAME = 5e-3  # loads with a smaller relative difference count as equal
LOADS = {"normal_force": "$F$", "nominal_pressure": "$p$", "closure": "$w$"}


def load_of(data: xr.Dataset) -> str:
    """Return the name of the variable that holds the load of a step; empty if there is none."""
    return next((name for name in LOADS if name in data.variables), "")


def loads_of(data: xr.Dataset, against: str, where: str) -> Any:
    """Return the loads of every shear and step; raise InvalidInput for a variable that is none of a step."""
    with Problems(f"fc.plotting.{where}") as problems:
        own = data[against].dims
        problems.require(set(own) <= {"shear", "step"}, "against", "a variable of every step", own)
    return table(data, against, ("shear", "step"))


def load_words(data: xr.Dataset) -> tuple[str, list[str]]:
    """Return a legend title and a label for each step: its load, or its number."""
    for name in LOADS:
        if name in data.variables and data[name].dims in (("step",), ()):
            scale = scale_of(data[name])
            return scale.label(name_of(data[name])), _numbers(scale(np.atleast_1d(data[name].values)), 3)
    return "step", [str(number) for number in range(data.sizes.get("step", 1))]


def shear_words(data: xr.Dataset) -> tuple[str, list[str]]:
    """Return a legend title and a label for each shear; empty without a shear coordinate."""
    if "shear" not in data.coords:
        return "", []
    scale = scale_of(data["shear"])
    return scale.label("shear $v$"), _numbers(scale(np.atleast_1d(data["shear"].values)), 4)


def curve_name(what: str, words: tuple[str, list[str]] = ("", []), number: int = 0) -> str:
    """Return the name of a curve: what it shows, and its load or shear out of the words of a legend."""
    title, labels = words
    if not labels:
        return what
    name, _, unit = title.partition(" (")
    return f"{what}, {name} = {labels[number]} {unit.rstrip(')')}".rstrip()


def load_text(state: xr.Dataset, path: xr.Dataset | None = None) -> str:
    """Return the load of a state, `F = 30 kN`, in the unit of the path; empty if it is not uniform."""
    for name, symbol in LOADS.items():
        if name not in state.variables:
            continue
        values = np.atleast_1d(state[name].values).ravel()
        if values.size == 0 or np.ptp(values) > SAME * abs(values[0]):
            continue
        scale = scale_of((state if path is None else path)[name])
        return f"{symbol} = {float(scale(values[0])):.3g} {scale.unit}"
    return ""


def shear_text(state: xr.Dataset, path: xr.Dataset | None = None) -> str:
    """Return the shear of a state, for example `v = 0.4 mm`, in the unit of the path."""
    if "shear" not in state.coords or state["shear"].ndim:
        return ""
    scale = scale_of((state if path is None else path)["shear"])
    return f"$v$ = {float(scale(state['shear'].values)):.4g} {scale.unit}"


def at_force(data: xr.Dataset, normal_force: float | None) -> xr.Dataset:
    """Return, for each shear, the step with the force nearest to `normal_force` (None: the last step)."""
    if normal_force is None or "normal_force" not in data.variables:
        return data.isel(step=-1)
    steps = [nearest(row, normal_force) for row in table(data, "normal_force", ("shear", "step"))]
    return data.isel(step=steps[0] if len(set(steps)) == 1 else xr.DataArray(steps, dims="shear"))


def at_shear(data: xr.Dataset, shear: float | None) -> xr.Dataset:
    """Return the load path at the shear nearest to `shear` (None: the middle one)."""
    middle = data.sizes["shear"] // 2
    return data.isel(
        shear=middle if shear is None or data.sizes["shear"] == 1 else nearest(data["shear"], shear)
    )


def select_path(
    data: xr.Dataset, shear: float | None, normal_force: float | None, most: int, where: str
) -> tuple[xr.Dataset, str]:
    """Return at most `most` states along the chosen path, and the dim of that path."""
    with Problems(f"fc.plotting.{where}") as problems:
        if data.sizes["shear"] > 1 and data.sizes["step"] > 1:
            problems.exactly_one(shear=shear, normal_force=normal_force)
        if normal_force is not None:
            problems.require("normal_force" in data.variables, "result", "the variable 'normal_force'", NONE)
    if normal_force is not None or (data.sizes["step"] == 1 and shear is None):
        return at_force(data, normal_force).isel(shear=spread_indices(data.sizes["shear"], most)), "shear"
    path = at_shear(data, shear)
    return path.isel(step=loaded_steps(path, most)), "step"


def loaded_steps(path: xr.Dataset, most: int) -> list[int]:
    """Return the steps of one path to show: loaded steps, spread evenly over the closure."""
    steps = np.arange(path.sizes["step"])
    if "normal_force" in path.variables and "step" in path["normal_force"].dims:
        loaded = steps[table(path, "normal_force", ("step",)) > 0]
        steps = loaded if loaded.size else steps
    evenly_numbered = [int(steps[i]) for i in spread_indices(len(steps), most)]
    if len(steps) <= most or "closure" not in path.variables or path["closure"].dims != ("step",):
        return evenly_numbered
    closure = np.asarray(path["closure"].values, dtype=float)[steps]
    if not (np.isfinite(closure).all() and (np.diff(closure) > 0).all()):
        return evenly_numbered
    targets = np.linspace(closure[0], closure[-1], most)
    return sorted({int(steps[nearest(closure, target)]) for target in targets})


def _numbers(values: Any, digits: int) -> list[str]:
    return [f"{value:.{digits}g}" for value in values]
