"""Sliding directions: selection, names and line styles, and the range of shear to show."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import as_dataset, words

JUMP = 4.0  # ratio of successive shears at which the evenly sampled part of a curve ends
NAMES = {"E": "East", "N": "North", "W": "West", "S": "South"}


def select_direction(data: Any, direction: str | None, where: str, argument: str = "result") -> xr.Dataset:
    """Return the part of a result that belongs to a direction (None: everything)."""
    dataset = as_dataset(data, where, argument)
    if direction is None or "direction" not in dataset.coords:
        return dataset
    names = words(dataset["direction"])
    with Problems(f"fc.plotting.{where}") as problems:
        problems.choice("direction", direction, names)
    return dataset.isel(direction=names.index(direction)) if "direction" in dataset.dims else dataset


def limit_shear(data: xr.Dataset, reach: float | None) -> xr.Dataset:
    """Return the part of a result up to the shear `reach` (None: everything)."""
    if reach is None or "shear" not in data.dims:
        return data
    return data.isel(shear=np.flatnonzero(data["shear"].values <= reach * (1 + 1e-9)))


def direction_styles(data: xr.Dataset) -> list[tuple[str, dict[str, Any]]]:
    """Return the name and line style of every direction; one unnamed entry if there is no direction."""
    names = words(data["direction"]) if "direction" in data.coords else [""]
    return [(direction_name(name), direction_style(name, i)) for i, name in enumerate(names)]


def direction_style(name: str, number: int) -> dict[str, Any]:
    """Return colour and line style: fixed for E, N, W and S, by number for other directions."""
    if name in _style.DIRECTION_COLOURS:
        return {"color": _style.DIRECTION_COLOURS[name], "ls": _style.DIRECTION_LINES[name]}
    colours = [colour for colour in _style.cycle() if colour not in _style.DIRECTION_COLOURS.values()]
    cycle, index = divmod(number, len(colours))
    return {"color": colours[index], "ls": ("-", "--", "-.", ":")[cycle % 4]}


def direction_name(name: str) -> str:
    """Return the printed name of a direction: `East` for E, `30°` for an azimuth."""
    return NAMES.get(name, name if not name or name.isalpha() else f"{name}°")


def evenly_sampled_reach(data: xr.Dataset) -> float:
    """Return the shear at which the first, evenly sampled part of a curve ends."""
    shears = np.sort(np.atleast_1d(data["shear"].values).astype(float))
    jumps = [i for i in range(1, shears.size) if shears[i - 1] > 0 and shears[i] > JUMP * shears[i - 1]]
    return float(shears[jumps[0] - 1 if jumps else -1])
