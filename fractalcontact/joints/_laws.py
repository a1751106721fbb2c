"""Exponential and hyperbolic closure of one path of load: pressure (Pa) and closure (m) over step."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

LEAST = 3  # points for a law of two parameters


def first_loading(pressure: Array, closure: Array) -> Array:
    """Return the steps with a force, up to the greatest one, at which the force is a new maximum."""
    known = np.isfinite(pressure) & np.isfinite(closure)
    highest = np.maximum.accumulate(np.where(known, pressure, 0.0))
    new = highest > np.concatenate([[0.0], highest[:-1]])
    return np.flatnonzero(new & known)


def exponential(pressure: Array, closure: Array) -> tuple[float, float, float]:
    """Return l, p0 and the rms misfit of w = l ln(p / p0); NaN where there is nothing to fit."""
    steps = first_loading(pressure, closure)
    if steps.size < LEAST or not np.ptp(closure[steps]) > 0:
        return (math.nan,) * 3
    power, w = np.log(pressure[steps]), closure[steps]
    length, offset = np.polyfit(power, w, 1)
    misfit = math.sqrt(np.mean((w - length * power - offset) ** 2))
    return float(length), math.exp(-offset / length), misfit


def hyperbola(pressure: Array, closure: Array) -> tuple[float, float, float]:
    """Return Kni, Vm and the rms misfit of w = p Vm / (Kni Vm + p); NaN where there is nothing to fit.

    The best curve for a given half pressure Kni Vm is a matter of one product; the half pressure itself is
    searched on a logarithmic axis.
    """
    from scipy.optimize import minimize_scalar

    steps = first_loading(pressure, closure)
    if steps.size < LEAST or not np.ptp(closure[steps]) > 0:
        return (math.nan,) * 3
    p, w = pressure[steps] / pressure[steps].max(), closure[steps]

    def curve(half: float) -> tuple[float, Array]:
        shape = p / (half + p)
        greatest = float(shape @ w / (shape @ shape))
        return greatest, w - greatest * shape

    def error(power: float) -> float:
        return float(np.sum(curve(math.exp(power))[1] ** 2))

    grid = np.linspace(math.log(p.min()) - 7.0, 14.0, 85)
    best = int(np.argmin([error(power) for power in grid]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    found = minimize_scalar(error, bounds=around, method="bounded", options={"xatol": 1e-10})
    half = math.exp(found.x)
    greatest, rest = curve(half)
    stiffness = half * float(pressure[steps].max()) / greatest
    straight = best == grid.size - 1  # no bend within the forces
    return stiffness, math.inf if straight else greatest, math.sqrt(np.mean(rest**2))


def stiffness(pressure: Array, closure: Array) -> Array:
    """Return dp/dw at every step, along its branch of the path; NaN where it has no neighbour there."""
    found = np.full(pressure.size, math.nan)
    for branch in branches(pressure):
        steps = branch[(pressure[branch] > 0) & np.isfinite(closure[branch])]
        if steps.size < 2:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.gradient(closure[steps], np.log(pressure[steps]))
            own = np.where((slope > 0) & np.isfinite(slope), pressure[steps] / slope, math.nan)
        found[steps] = np.where(np.isnan(found[steps]), own, found[steps])
    return found


def branches(pressure: Array) -> list[Array]:
    """Return the steps of each rise and fall of the force, with the turning points at both ends."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(pressure)))) + 1
    ends = [0, *turns.tolist(), pressure.size - 1]
    return [np.arange(first, last + 1) for first, last in itertools.pairwise(ends)]
