"""Sliding directions: selection, names and line styles, and the range of shear to show."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import as_dataset, words
from fractalcontact.plotting._line_panel import Family
from fractalcontact.plotting._units import Units, shown_in

JUMP = 4.0  # ratio of successive shears at which the evenly sampled part of a curve ends
NAMES = {"E": "East", "N": "North", "W": "West", "S": "South"}


def select_direction(
    data: Any,
    direction: str | float | None,
    where: str,
    units: Units | None = None,
    argument: str = "result",
) -> xr.Dataset:
    """Return the part of a result that belongs to a direction, a word or an azimuth (None: everything)."""
    dataset = shown_in(as_dataset(data, where, argument), units, where)
    if direction is None or "direction" not in dataset.coords:
        return dataset
    names = words(dataset["direction"])
    with Problems(f"fc.plotting.{where}") as problems:
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
    return data.isel(shear=np.flatnonzero(data["shear"].values <= reach * (1 + 1e-9)))


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
