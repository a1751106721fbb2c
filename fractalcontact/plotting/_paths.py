"""Along the paths of shear and load: which curves and maps to show, and what each is called."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting._reading import nearest, table
from fractalcontact.plotting._style import chosen
from fractalcontact.plotting._units import name_of, scale_for, scale_of, units_of

if TYPE_CHECKING:
    import xarray as xr

SMALL = 0.1  # of the unit of a path: a smaller load is told in a unit of its own
SAME = 5e-3  # loads that differ by less, relative to their size, are told as one
LOADS = {"normal_force": "$F$", "nominal_pressure": "$p$", "closure": "$w$"}


def load_of(data: xr.Dataset) -> str:
    """Return the variable that tells the load of a step; empty where there is none."""
    return next((name for name in LOADS if name in data.variables), "")


def load_words(data: xr.Dataset) -> tuple[str, list[str]]:
    """Return the title of a key of steps and a word for each: its load, or its number."""
    for name in LOADS:
        if name in data.variables and data[name].dims in (("step",), ()):
            scale = scale_of(data[name])
            return scale.label(name_of(data[name])), _numbers(scale(np.atleast_1d(data[name].values)), 3)
    return "step", [str(number) for number in range(data.sizes.get("step", 1))]


def shear_words(data: xr.Dataset) -> tuple[str, list[str]]:
    """Return the title of a key of shears and a word for each; none where no shear is known."""
    if "shear" not in data.coords:
        return "", []
    scale = scale_of(data["shear"])
    return scale.label("shear $v$"), _numbers(scale(np.atleast_1d(data["shear"].values)), 4)


def load_text(one: xr.Dataset, whole: xr.Dataset | None = None) -> str:
    """Return the load that a step has for all shears, `F = 30 kN`, in the unit that suits the whole path."""
    for name, symbol in LOADS.items():
        if name not in one.variables:
            continue
        values = np.atleast_1d(one[name].values).ravel()
        if values.size == 0 or np.ptp(values) > SAME * abs(values[0]):
            continue
        scale = scale_of((one if whole is None else whole)[name])
        if abs(float(scale(values[0]))) < SMALL:
            scale = scale_for(units_of(one[name]), values[0])
        return f"{symbol} = {float(scale(values[0])):.3g} {scale.unit}"
    return ""


def shear_text(one: xr.Dataset, whole: xr.Dataset | None = None) -> str:
    """Return the shear of one path, `v = 0.4 mm` for example, in the unit that suits all of them."""
    if "shear" not in one.coords or one["shear"].ndim:
        return ""
    scale = scale_of((one if whole is None else whole)["shear"])
    return f"$v$ = {float(scale(one['shear'].values)):.4g} {scale.unit}"


def at_force(data: xr.Dataset, normal_force: float | None) -> xr.Dataset:
    """Return, for each shear, the step whose force is nearest to the wanted one (None: the last step)."""
    import xarray as xr

    if normal_force is None or "normal_force" not in data.variables:
        return data.isel(step=-1)
    steps = [nearest(row, normal_force) for row in table(data, "normal_force", ("shear", "step"))]
    return data.isel(step=steps[0] if len(set(steps)) == 1 else xr.DataArray(steps, dims="shear"))


def at_shear(data: xr.Dataset, shear: float | None) -> xr.Dataset:
    """Return the path of load at the shear nearest to the wanted one (None: the middle one)."""
    middle = data.sizes["shear"] // 2
    return data.isel(
        shear=middle if shear is None or data.sizes["shear"] == 1 else nearest(data["shear"], shear)
    )


def chosen_path(
    data: xr.Dataset, shear: float | None, normal_force: float | None, most: int, where: str
) -> tuple[xr.Dataset, str]:
    """Return at most `most` single states along the one path that was chosen, and the dim it runs along."""
    with Problems(f"fc.plotting.{where}") as problems:
        problems.integer("panels", most, at_least=1)
        if data.sizes["shear"] > 1 and data.sizes["step"] > 1:
            problems.exactly_one(shear=shear, normal_force=normal_force)
        if normal_force is not None:
            problems.require(
                "normal_force" in data.variables, "result", "the variable 'normal_force'", "none"
            )
    if normal_force is not None or (data.sizes["step"] == 1 and shear is None):
        return at_force(data, normal_force).isel(shear=chosen(data.sizes["shear"], most)), "shear"
    path = at_shear(data, shear)
    return path.isel(step=loaded_steps(path, most)), "step"


def loaded_steps(path: xr.Dataset, most: int) -> list[int]:
    """Return the steps of one path to show: loaded ones, spread evenly over the closure."""
    steps = np.arange(path.sizes["step"])
    if "normal_force" in path.variables and "step" in path["normal_force"].dims:
        loaded = steps[table(path, "normal_force", ("step",)) > 0]
        steps = loaded if loaded.size else steps
    even = [int(steps[i]) for i in chosen(len(steps), most)]
    if len(steps) <= most or "closure" not in path.variables or path["closure"].dims != ("step",):
        return even
    closed = np.asarray(path["closure"].values, dtype=float)[steps]
    if not (np.isfinite(closed).all() and (np.diff(closed) > 0).all()):
        return even
    return sorted(
        {int(steps[nearest(closed, wanted)]) for wanted in np.linspace(closed[0], closed[-1], most)}
    )


def _numbers(values: Any, digits: int) -> list[str]:
    return [f"{value:.{digits}g}" for value in values]
