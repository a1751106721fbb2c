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

CONTROLS = ("closure", "normal_force", "nominal_pressure")
MAPS = ("state", "pressure", "gap", "displacement")
METHODS = ("fast", "elimination")


@dataclass(frozen=True)
class Plan:
    """What `press` was asked for."""

    grid: Grid
    path: Path
    keep: tuple[str, ...]


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
    if control == "nominal_pressure":
        control, values = "normal_force", values * grid.nominal_area
    length = length_unit((grid.spacing[0], grid.spacing[1]))
    height = float(gap.max())
    if height == 0:  # flat: the step itself is the only height there is
        height = float(values.max()) if control == "closure" else float(values.max()) / modulus / length
    units = Units(length, power_of_two(height), modulus, body.cell_area)
    gap /= units.height
    path = Path(body, units, gap, control, tuple(float(v) for v in values), hardness, tolerance, method)
    _limits(path, grid, problems)
    return Plan(grid, path, tuple(keep))


def _boundary(given: Any, grid: Grid, problems: Problems) -> bool:
    """Whether the bodies repeat themselves."""
    wraps = grid.periodic
    if given is None:
        mixed = any(wraps) and not all(wraps)
        problems.require(
            not mixed, "boundary", "'free' where one axis is periodic and the other is not", given
        )
        return all(wraps)
    word = problems.choice("boundary", given, ("periodic", "free"))
    if word == "periodic":
        expected = "periodic axes (attribute `period` of x and y equal to n * spacing), or 'free'"
        problems.require(all(wraps), "boundary", expected, given)
    return bool(word == "periodic")


def _limits(path: Path, grid: Grid, problems: Problems) -> None:
    """Refuse what has no solution: too much force for the hardness, too much closure of a periodic body."""
    most = max(path.values)
    if path.control == "normal_force":
        greatest = path.hardness * grid.nominal_area
        expected = f"a force of at most hardness times area, {greatest:.6g} N"
        problems.require(most <= greatest, "normal_force", expected, most)
    elif path.body.periodic and not np.isfinite(path.hardness):
        depth = float(path.gap.mean()) * path.units.height
        expected = f"a closure below top less mean height, {depth:.6g} m, of a periodic body"
        problems.require(most < depth or most == 0, "closure", expected, most)


def _nothing(grid: Grid) -> Plan:
    from fractalcontact.contact._problem import Body

    body = Body((3, 3), (1.0, 1.0), False, "disc", 0.5)
    path = Path(body, Units(1.0, 1.0, 1.0, 1.0), np.zeros((3, 3)), "closure", (0.0,), np.inf, 1e-8, "fast")
    return Plan(grid, path, ())
