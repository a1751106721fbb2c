"""Selection of methods and tolerances for an error or a run time, from measured curves.

``error = 1e-3`` in a scene bounds the relative error of pressures, and the error of exponents and dimensions;
``budget = 30`` gives the smallest such error within so many seconds. Values set explicitly are never
changed. The errors are those measured on the surfaces and sets of `fractalcontact.accuracy`, the seconds are
those of the machine that measured the curves (`autotune_curves.json`, made by the benchmarks).
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fractalcontact.base.errors import FractalContactWarning
from fractalcontact.scenes._inputs import surface_grid
from fractalcontact.scenes._scene import LOADS, Scene
from fractalcontact.scenes._stages import READ_THE_GAP, STAGES

CURVES_FILE = Path(__file__).with_name("autotune_curves.json")
SAFETY_FACTOR = 3.0  # on the error of the curve: surfaces differ
ERRORS = tuple(float(f"{e:.3g}") for e in np.geomspace(0.3, 1e-12, 70))
MEASURED_EDGE = 128.0  # points along an edge of the surface on which tolerances were measured
GROWTH = 1.15  # exponent of the run time over the number of points
WARM_START = 0.5  # seconds of a step that starts from the step before, relative to the first
PERIODIC = ("spectral", "weierstrass")


@dataclass(frozen=True)
class Curve:
    """Error and run time of one method over its parameter, in the order of growing cost."""

    parameter: tuple[float, ...]
    error: tuple[float, ...]
    seconds: tuple[float, ...]

    def at(self, parameter: float) -> tuple[float, float]:
        """Return error and seconds at a parameter, linear in the logarithms, also beyond the ends."""
        place, knots = np.log(parameter), np.log(self.parameter)
        if knots.size == 1:
            return self.error[0], self.seconds[0]
        right = int(np.clip(np.searchsorted(knots, place), 1, knots.size - 1))
        part = (place - knots[right - 1]) / (knots[right] - knots[right - 1])
        error, seconds = (
            float(np.exp(np.log(row[right - 1]) + part * (np.log(row[right]) - np.log(row[right - 1]))))
            for row in (self.error, self.seconds)
        )
        # beyond the last point no error below the smallest measured one is promised
        return max(error, self.error[-1]) if place > knots[-1] else error, seconds


@cache
def measured_curves() -> Mapping[str, Mapping[str, Curve]]:
    """Return the measured curves: benchmark, then method."""
    entries = json.loads(CURVES_FILE.read_text(encoding="utf-8"))
    return {
        benchmark: {
            name: Curve(*(tuple(curve[key]) for key in ("parameter", "error", "seconds")))
            for name, curve in curves.items()
        }
        for benchmark, curves in entries.items()
    }


@dataclass(frozen=True)
class Option:
    """One value of a key, with the expected error and seconds."""

    value: Any
    error: float
    seconds: float


@dataclass(frozen=True)
class Choice:
    """The selected value of one key of the scene."""

    key: str
    option: Option
    reached: bool

    def __str__(self) -> str:
        """Return key, value and what to expect of it."""
        note = "" if self.reached else ": the smallest error available"
        option = self.option
        return f"{self.key} = {option.value} (error {option.error:.1g}, {option.seconds:.1g} s{note})"


def choose(scene: Scene) -> tuple[Scene, tuple[Choice, ...]]:
    """Return the scene with values for the keys it left open, and what was selected."""
    if "error" not in scene.tables and "budget" not in scene.tables:
        return scene, ()
    open_keys = dict(_open_keys(scene))
    choices: tuple[Choice, ...] = ()
    if not open_keys:
        _warn("error or budget: nothing to select, no wanted result has an open method or tolerance")
    elif "error" in scene.tables:
        choices = _for_error(open_keys, float(scene.tables["error"]))
    else:
        choices = _for_budget(open_keys, float(scene.tables["budget"]))
    tables = {key: _copy(value) for key, value in scene.tables.items()}
    for choice in choices:
        *path, last = choice.key.split(".")
        table = tables
        for word in path:
            table = table.setdefault(word, {})
        table[last] = choice.option.value
    return replace(scene, tables=tables), choices


def _for_error(open_keys: Mapping[str, list[Option]], error: float) -> tuple[Choice, ...]:
    """Return the fastest options within the error; warn of the keys where there is none."""
    choices = _select(open_keys, error)
    beyond = [f"{choice.key} reaches {choice.option.error:.1g}" for choice in choices if not choice.reached]
    if beyond:
        _warn(f"an error of {error:g} is out of reach: {', '.join(beyond)}")
    return choices


def _for_budget(open_keys: Mapping[str, list[Option]], budget: float) -> tuple[Choice, ...]:
    """Return the options of the smallest error within the budget; warn where there are none."""
    choices = _select(open_keys, ERRORS[0])
    fastest = _total_seconds(choices)
    if fastest > budget:
        _warn(f"a budget of {budget:g} s: the wanted results take about {fastest:.2g} s at least")
    for error in ERRORS[1:]:
        finer = _select(open_keys, error)
        if _total_seconds(finer) > budget:
            break
        choices = finer
    return choices


def _total_seconds(choices: tuple[Choice, ...]) -> float:
    return sum(choice.option.seconds for choice in choices)


def _warn(message: str) -> None:
    warnings.warn(message, FractalContactWarning, stacklevel=4)


def _copy(value: Any) -> Any:
    return {key: _copy(item) for key, item in value.items()} if isinstance(value, Mapping) else value


def _select(open_keys: Mapping[str, list[Option]], error: float) -> tuple[Choice, ...]:
    """Return the fastest option of each key within the error; where there is none, the most accurate."""
    choices = []
    for key, options in open_keys.items():
        within = [option for option in options if option.error <= error]
        best = (
            min(within, key=lambda option: option.seconds)
            if within
            else min(options, key=lambda option: option.error)
        )
        choices.append(Choice(key, best, bool(within)))
    return tuple(choices)


def _open_keys(scene: Scene) -> Iterator[tuple[str, list[Option]]]:
    """Yield the keys that the scene leaves open, each with its options."""
    shape = surface_grid(scene)[0]
    edge = float(np.sqrt(np.prod(shape)))
    solvers = list(_solvers(scene, shape))
    for solver in solvers:
        if "tolerance" not in scene.table(solver.table):
            yield f"{solver.table}.tolerance", _tolerances(solver)
    if "default" in scene.want.dimensions:
        others = [name for name in scene.want.dimensions if name != "default"]
        yield (
            "want.dimensions",
            [
                Option([name, *(other for other in others if other != name)], *curve.at(edge))
                for name, curve in measured_curves()["Hurst exponent"].items()
            ],
        )
    own = scene.table("domains").get("box_dimension", {})
    if "box_dimension" in scene.want.domains and "cover" not in own:
        planes = sum(solver.solves for solver in solvers) or 1.0
        curves = measured_curves()["carpet of Sierpinski, cut"]
        options = []
        for cover in ("minimum", "mean"):
            error, seconds = curves[f"box dimension, {cover} cover"].at(edge)
            options.append(Option(cover, error, planes * seconds))
        yield "domains.box_dimension.cover", options


@dataclass(frozen=True)
class _Solver:
    """Solutions of a contact solver that a scene requires: table, benchmark, cold solves, nodes of each."""

    table: str
    benchmark: str
    solves: float
    nodes: float


def _tolerances(solver: _Solver) -> list[Option]:
    (curve,) = measured_curves()[solver.benchmark].values()
    factor = solver.solves * (solver.nodes / MEASURED_EDGE**2) ** GROWTH
    # a tighter tolerance is never credited with a larger error or a shorter run than a looser one
    errors = np.maximum.accumulate(curve.error[::-1])[::-1]
    seconds = np.maximum.accumulate(curve.seconds)
    return [
        Option(tolerance, SAFETY_FACTOR * float(error), factor * second)
        for tolerance, error, second in zip(curve.parameter, errors, seconds, strict=True)
    ]


def _solvers(scene: Scene, shape: tuple[int, int]) -> Iterator[_Solver]:
    hardness = " with a hardness" if scene.material.hardness is not None else ""
    if scene.is_pressed:
        table = scene.table("contact")
        body = table.get("boundary", "periodic" if scene.surface.generate in PERIODIC else "free")
        steps = max((len(value) for value in table.values() if isinstance(value, list)), default=1)
        hard = hardness or (" with a hardness" if "hardness" in table else "")
        condition = hard or (", closure imposed" if "closure" in table else "")
        benchmark = f"rough, {body} body{condition}"
        yield _Solver("contact", benchmark, 1.0 + WARM_START * (steps - 1), float(np.prod(shape)))
    wanted = set(scene.want.joints)
    if (scene.want.domains and not scene.is_pressed) or wanted & set(READ_THE_GAP):
        wanted.add("closure")
    solves = sum(_joint_solves(scene, name) for name in ("closure", "elastic_dilatancy") if name in wanted)
    if solves:
        yield _Solver("joint", f"rough, free body{hardness}", solves, _block_nodes(scene, shape))


def _joint_solves(scene: Scene, name: str) -> float:
    """Return the number of cold solves of a stage of the joint."""
    options = scene.stage_options(STAGES[f"joints/{name}"], ("shear", "direction", *LOADS))
    counts = {key: len(value) if isinstance(value, list) else 1 for key, value in options.items()}
    directions = counts.get("direction", 4) if name == "elastic_dilatancy" else 1
    steps = max([counts[key] for key in LOADS if key in counts] or [1])
    return counts.get("shear", 1) * directions * (1.0 + WARM_START * (steps - 1))


def _block_nodes(scene: Scene, shape: tuple[int, int]) -> float:
    block = scene.joint.block
    if block is None:
        return float(np.prod(shape))
    return float(np.prod(np.broadcast_to(block, 2) / np.asarray(surface_grid(scene)[1])))
