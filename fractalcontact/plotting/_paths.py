"""Load, shear and direction: which of them a figure shows, and the labels and styles of their curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import direction_text
from fractalcontact.base.numbers import ROUNDED, spread_indices
from fractalcontact.base.study import provenance_of, stated_argument
from fractalcontact.base.validation import NONE, Problems, require
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import Drawing
from fractalcontact.plotting._inputs import as_dataset, nearest, quantity, table, words
from fractalcontact.plotting._line_panel import Family, ordered
from fractalcontact.plotting._units import PLAIN, Quantity, Units, name_of, number_texts, scale_of, shown_in

PATH = ("shear", "step")
LOADS = {"tangential_force": "$Q$", "normal_force": "$F$", "nominal_pressure": "$p$", "closure": "$w$"}


FORCES = ("normal_force", "nominal_pressure")  # every result of a press has both


def load_of(data: xr.Dataset) -> str:
    """Return the name of the variable that holds the load of a step; empty if there is none."""
    return next((name for name in _loads_in_order(data) if name in data.variables), "")


def force_of(data: xr.Dataset) -> str:
    """Return the force or the pressure on the block: what the call prescribed, the force if neither."""
    forces = [name for name in _loads_in_order(data) if name in FORCES]
    return next((name for name in forces if name in data.variables), forces[0])


def _loads_in_order(data: xr.Dataset) -> list[str]:
    """Return the names of loads, of force and pressure the one first that was prescribed.

    A result states it in its provenance; a variable taken out of one has it as an index. Last are those that
    are not known at all steps: of a body that is closed beyond full contact the closure alone is.
    """
    stated = [
        stated_argument(provenance_of(data), FORCES),
        *(name for name in FORCES if name in data.xindexes),
    ]
    prescribed = next(filter(None, stated), FORCES[0])
    names = dict.fromkeys(["tangential_force", prescribed, *LOADS])
    return sorted(names, key=lambda name: name in data.variables and bool(data[name].isnull().any()))


def loads_of(data: xr.Dataset, against: str, dims: tuple[str, str] = PATH) -> Quantity:
    """Return a variable of every shear and step for the x axis; without one of that name the step."""
    if against not in data.variables:
        steps = np.arange(data.sizes["step"], dtype=float)
        values = np.broadcast_to(steps, [data.sizes[dim] for dim in PATH])
        return Quantity(values if dims == PATH else values.T, PLAIN, "step")
    own = data[against].dims
    require(set(own) <= set(PATH), "against", "a variable of every step", own)
    return quantity(data, against, dims)


def path_axis(data: xr.Dataset, against: str | None) -> tuple[tuple[str, str], Quantity, Family]:
    """Return the dims of curves along a path, the variable they are drawn against, and their family.

    Without `against` it is the load of `load_of`, or shear where the result has a single step.
    """
    if against is None:
        by_step = data.sizes["step"] > 1 or "shear" not in data.coords
        against = (load_of(data) or "step") if by_step else "shear"
    by_shears = against == "shear"
    dims = ("step", "shear") if by_shears else PATH
    return dims, loads_of(data, against, dims), by_load(data) if by_shears else by_shear(data)


def by_load(data: xr.Dataset) -> Family:
    """Return the family of the curves of the steps, labelled by their load or by their number."""
    for name in _loads_in_order(data):
        if name in data.variables and data[name].dims in (("step",), ()):
            scale = scale_of(data[name])
            return ordered(number_texts(scale, data[name], 3), name_of(data[name]), scale.unit)
    count = data.sizes.get("step", 1)
    return ordered([str(number) for number in range(count)] if count > 1 else (), "step", count=count)


def by_shear(data: xr.Dataset) -> Family:
    """Return the family of the curves of the shears; of one without a label if there is no shear."""
    if "shear" not in data.coords:
        return ordered((), count=data.sizes.get("shear", 1))
    scale = scale_of(data["shear"])
    return ordered(number_texts(scale, data["shear"], 4), "shear $v$", scale.unit)


def load_text(state: xr.Dataset, path: xr.Dataset) -> str:
    """Return the load of a state, `F = 30 kN`, in the unit of the path; empty if it is not uniform."""
    for name in _loads_in_order(path):
        if name not in state.variables:
            continue
        values = np.atleast_1d(state[name].values).ravel()
        # half a unit of the third digit, the last that the text has, is no difference
        if values.size == 0 or not np.ptp(values) <= 5e-3 * abs(values[0]):
            continue
        scale = scale_of(path[name])
        return f"{LOADS[name]} = {float(scale(values[0])):.3g} {scale.unit}".replace("-", "\N{MINUS SIGN}")
    return ""


def shear_text(state: xr.Dataset, path: xr.Dataset) -> str:
    """Return the shear of a state, for example `v = 0.4 mm`, in the unit of the path."""
    if "shear" not in state.coords or state["shear"].ndim:
        return ""
    scale = scale_of(path["shear"])
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


@dataclass(frozen=True)
class StatePath:
    """States along the load path at one shear (the dim is `step`), or along shear under one load."""

    dim: str
    states: xr.Dataset
    result: xr.Dataset  # all states, by which units are chosen

    @property
    def family(self) -> Family:
        """The family of the curves of the states."""
        return by_load(self.states) if self.dim == "step" else by_shear(self.states)

    @property
    def common(self) -> str:
        """What the states have in common: their shear, or their load."""
        return (shear_text if self.dim == "step" else load_text)(self.states, self.result)

    def text(self, number: int) -> str:
        """Return the load or the shear of one of the states."""
        state = self.states.isel({self.dim: number})
        return (load_text if self.dim == "step" else shear_text)(state, self.result)


def states_along(
    data: xr.Dataset, dim: str, shear: float | None, normal_force: float | None, most: int | None = None
) -> StatePath:
    """Return states along a dim at the nearest shear or force, at most `most` of them."""
    path = at_shear(data, shear) if dim == "step" else at_force(data, normal_force)
    count = path.sizes[dim] if most is None else most
    chosen = loaded_steps(path, count) if dim == "step" else spread_indices(path.sizes[dim], count)
    return StatePath(dim, path.isel({dim: chosen}), data)


def select_path(data: xr.Dataset, shear: float | None, normal_force: float | None, most: int) -> StatePath:
    """Return at most `most` states along the chosen path."""
    with Problems("fc.plotting") as problems:
        if data.sizes["shear"] > 1 and data.sizes["step"] > 1:
            problems.exactly_one(shear=shear, normal_force=normal_force)
        if normal_force is not None:
            problems.require("normal_force" in data.variables, "result", "the variable 'normal_force'", NONE)
    is_along_shear = normal_force is not None or (data.sizes["step"] == 1 and shear is None)
    return states_along(data, "shear" if is_along_shear else "step", shear, normal_force, most)


def middle_shear(data: xr.Dataset) -> float | None:
    """Return the middle one of the shears of a result."""
    shears = np.atleast_1d(data["shear"].values) if "shear" in data.coords else np.empty(0)
    return float(shears[shears.size // 2]) if shears.size else None


def by_decades(figure: Drawing) -> Drawing:
    """Return a drawing with logarithmic axes where linear ones would hide all loads but the largest."""

    def draw(data: xr.Dataset) -> Any:
        force = np.asarray(data["normal_force"].values, float) if "normal_force" in data else np.empty(0)
        return figure(data, log=_style.needs_log_axis(force[force > 0]))

    return draw


def at_end(figure: Drawing, *dims: str) -> Drawing:
    """Return a drawing at the greatest shear, or under the greatest load."""
    return lambda data: figure(data.isel({dim: -1 for dim in dims if dim in data.dims}))


def loaded_steps(path: xr.Dataset, most: int) -> list[int]:
    """Return the steps of one path to show: loaded steps, spread evenly over the closure."""
    steps = np.arange(path.sizes["step"])
    if "normal_force" in path.variables and "step" in path["normal_force"].dims:
        loaded = steps[~(table(path, "normal_force", ("step",)) <= 0)]  # NaN beyond full contact
        steps = loaded if loaded.size else steps
    evenly_numbered = [int(steps[i]) for i in spread_indices(len(steps), most)]
    if len(steps) <= most or "closure" not in path.variables or path["closure"].dims != ("step",):
        return evenly_numbered
    closure = np.asarray(path["closure"].values, dtype=float)[steps]
    if not (np.isfinite(closure).all() and (np.diff(closure) > 0).all()):
        return evenly_numbered
    targets = np.linspace(closure[0], closure[-1], most)
    return sorted({int(steps[nearest(closure, target)]) for target in targets})


NAMES = {"E": "East", "N": "North", "W": "West", "S": "South"}


def select_direction(data: Any, direction: str | float | None, units: Units | None = None) -> xr.Dataset:
    """Return the part of a result that belongs to a direction, a word or an azimuth (None: everything)."""
    dataset = shown_in(as_dataset(data), units)
    if direction is None or "direction" not in dataset.coords:
        return dataset
    names = words(dataset["direction"])
    with Problems("fc.plotting") as problems:
        if isinstance(direction, str):
            problems.choice("direction", direction, names)
            matches = [name == direction for name in names]
        else:
            azimuths = np.atleast_1d(dataset["azimuth"].values if "azimuth" in dataset.coords else np.nan)
            matches = np.isclose((azimuths - direction + 180.0) % 360.0, 180.0).tolist()
            problems.require(any(matches), "direction", f"one of {azimuths.tolist()}", direction)
    return dataset.isel(direction=matches.index(True)) if "direction" in dataset.dims else dataset


def limit_shear(data: xr.Dataset, reach: float | None) -> xr.Dataset:
    """Return the part of a result up to the shear `reach` (None: everything)."""
    if reach is None or "shear" not in data.dims:
        return data
    return data.isel(shear=np.flatnonzero(data["shear"].values <= reach * ROUNDED))


def by_direction(data: xr.Dataset) -> Family:
    """Return the family of the curves of the directions; of one without a label if there is no direction."""
    if "direction" not in data.coords:
        return Family([direction_style("", i) for i in range(data.sizes.get("direction", 1))])
    names = words(data["direction"])
    styles = [direction_style(name, i) for i, name in enumerate(names)]
    return Family(styles, [direction_name(name) for name in names], heading="block slides")


def direction_style(name: str, number: int) -> dict[str, Any]:
    """Return colour and line style: fixed for E, N, W and S, by number for other directions."""
    if name in _style.DIRECTION_COLOURS:
        return {"color": _style.DIRECTION_COLOURS[name], "ls": _style.DIRECTION_LINES[name]}
    colours = [colour for colour in _style.cycle() if colour not in _style.DIRECTION_COLOURS.values()]
    return _style.distinct_style(number, colours)


def direction_name(name: str) -> str:
    """Return the printed name of a direction: `East` for E, `30°` for an azimuth."""
    return NAMES.get(name, direction_text(name))


def evenly_sampled_reach(data: xr.Dataset, jump: float = 4.0) -> float:
    """Return the shear at which the first, evenly sampled part of a curve ends.

    The next one is more than `jump` times as long; a series by octaves is sampled evenly.
    """
    shears = np.sort(np.atleast_1d(data["shear"].values).astype(float))
    jumps = [i for i in range(1, shears.size) if shears[i - 1] > 0 and shears[i] > jump * shears[i - 1]]
    return float(shears[jumps[0] - 1 if jumps else -1])
