"""Arguments of `press`, checked together and turned into a scaled path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import Grid, check_surface
from fractalcontact.contact._path import Path
from fractalcontact.contact._problem import power_of_two
from fractalcontact.contact._setup import Units, length_unit, make_body

Array = np.ndarray[Any, np.dtype[Any]]

CONTROLS = ("closure", "normal_force", "nominal_pressure")
MAPS = ("state", "pressure", "gap", "displacement", "residual_height")
METHODS = ("fast", "elimination")
REACH = 2.0**300  # of forces and closures over their scales, so that no product leaves the range of a double
UNIT_RANGE = (2.0**-900, 2.0**900)
ROUNDING = 1e-12


@dataclass(frozen=True)
class Plan:
    """What `press` was asked for."""

    grid: Grid
    path: Path
    keep: tuple[str, ...]
    heights: Array


def make_plan(call: dict[str, Any], problems: Problems) -> Plan:
    """Check every argument of `press` and scale the problem; problems are noted together."""
    grid = check_surface(call["surface"], problems)
    modulus = problems.number("contact_modulus", call["contact_modulus"], above=0)
    hardness = np.inf if call["hardness"] is None else problems.number("hardness", call["hardness"], above=0)
    tolerance = problems.number("tolerance", call["tolerance"], above=0, below=1)
    method = problems.choice("method", call["method"], METHODS)
    if method == "elimination":
        problems.require(not np.isfinite(hardness), "hardness", "None with method='elimination'", hardness)
    keep = () if call["keep"] is None else problems.choices("keep", call["keep"], MAPS)
    problems.require(
        isinstance(call["progress"], (bool, np.bool_)), "progress", "True or False", call["progress"]
    )
    control = problems.exactly_one(**{name: call[name] for name in CONTROLS})
    given = call[control]
    values = problems.numbers(control, given, at_least=0) if given is not None else np.zeros(1)
    periodic = _boundary(call["boundary"], grid, problems)
    if len(grid.shape) != 2 or problems.found:
        problems.require(True, "surface", "", "")
        return _nothing(grid)
    body = make_body(
        (grid.shape[0], grid.shape[1]),
        (grid.spacing[0], grid.spacing[1]),
        periodic,
        call["influence"],
        call["disc_radius"],
        problems,
    )
    if problems.found:
        return _nothing(grid)
    heights = np.asarray(call["surface"].values, dtype=np.float64)
    gap = heights.max() - heights
    per_area = control == "nominal_pressure"
    if per_area:
        with np.errstate(over="ignore"):
            control, values = "normal_force", values * grid.nominal_area
    length = length_unit((grid.spacing[0], grid.spacing[1]))
    height = float(gap.max())
    if height == 0:  # flat: the step itself is the only height there is
        height = float(values.max()) if control == "closure" else float(values.max()) / modulus / length
    units = Units(length, power_of_two(height), modulus, body.cell_area)
    gap /= units.height
    path = Path(body, units, gap, control, tuple(float(v) for v in values), hardness, tolerance, method)
    name, share = ("nominal_pressure", grid.nominal_area) if per_area else (control, 1.0)
    _range(path, name, share, problems)
    if path.control == "normal_force":
        carried, most = path.hardness * grid.nominal_area, max(path.values)
        expected = f"a force of at most hardness times area, {carried:.6g} N"
        if per_area:
            expected = f"a pressure of at most the hardness, {hardness:.6g} Pa"
        problems.require(most <= carried * (1 + ROUNDING), name, expected, most / share)
    return Plan(grid, path, tuple(keep), heights)


def _boundary(given: Any, grid: Grid, problems: Problems) -> bool:
    """Whether the bodies repeat themselves."""
    wraps = grid.periodic
    if given is None:
        mixed = any(wraps) and not all(wraps)
        problems.require(
            not mixed, "boundary", "'free' where one axis is periodic and the other is not", given
        )
        return all(wraps)
    word = problems.choice("boundary", given, ("free", "periodic"))
    if word == "periodic":
        expected = "periodic axes (attribute `period` of x and y equal to n * spacing), or 'free'"
        problems.require(all(wraps), "boundary", expected, given)
    return bool(word == "periodic")


def _range(path: Path, name: str, share: float, problems: Problems) -> None:
    """Refuse loads out of all proportion to the surface, and units out of a computer's range.

    `name` is the control as it was given, in units of the solver's over `share`.
    """
    units = path.units
    sizes = (units.length, units.height, units.modulus, units.pressure, units.force, units.energy)
    expected = "spacing, heights and modulus whose products a double can hold"
    if not problems.require(
        all(UNIT_RANGE[0] < size < UNIT_RANGE[1] for size in sizes),
        "surface / contact_modulus",
        expected,
        f"scales {sizes}",
    ):
        return
    expected = (
        f"None or between {units.pressure / REACH:.3g} and {units.pressure * REACH:.3g} for this surface"
    )
    cap = path.hardness / units.pressure
    problems.require(1 / REACH < cap < REACH or cap == np.inf, "hardness", expected, path.hardness)
    unit = units.height if path.control == "closure" else units.force
    scale = unit / share
    expected = f"0 or between {scale / REACH:.3g} and {scale * REACH:.3g} for this surface and modulus"
    for value in path.values:
        problems.require(value == 0 or unit / REACH < value < unit * REACH, name, expected, value / share)


def _nothing(grid: Grid) -> Plan:
    from fractalcontact.contact._problem import Body

    body = Body((3, 3), (1.0, 1.0), False, "disc", 0.5)
    path = Path(body, Units(1.0, 1.0, 1.0, 1.0), np.zeros((3, 3)), "closure", (0.0,), np.inf, 1e-8, "fast")
    return Plan(grid, path, (), path.gap)
