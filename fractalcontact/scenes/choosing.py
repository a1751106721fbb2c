"""Methods and tolerances picked for an error, or for a time, from curves that were measured before.

``error = 1e-3`` in a scene is the relative error that pressures may have, and the error that an exponent or a
dimension may have; ``budget = 30`` asks for the least such error that takes so many seconds at most. What the
scene states itself is left as it is. Errors are those seen on the surfaces and sets of
`fractalcontact.accuracy`, seconds those of the machine on which the curves were made.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base.errors import FractalContactWarning
from fractalcontact.scenes.given import face_grid
from fractalcontact.scenes.scene import Scene

MARGIN = 3.0  # asked of the curve, because no two faces are alike
ERRORS = tuple(float(f"{e:.3g}") for e in np.geomspace(0.3, 1e-12, 70))
MEASURED_EDGE = 128.0  # points along an edge of the face on which tolerances were measured
GROWTH = 1.15  # of seconds with the number of points, to that power
WARM = 0.5  # seconds of a step that starts from the one before, over those of the first
PERIODIC = ("spectral", "weierstrass")


@dataclass(frozen=True)
class Option:
    """One way to do a thing: the value of its key, the error and the seconds to expect."""

    value: Any
    error: float
    seconds: float


@dataclass(frozen=True)
class Choice:
    """What was picked for one key of the scene."""

    key: str
    option: Option
    reached: bool

    def __str__(self) -> str:
        """Return the choice in words."""
        note = "" if self.reached else ": the least there is"
        one = self.option
        return f"{self.key} = {one.value} (error {one.error:.1g}, {one.seconds:.1g} s{note})"


def choose(scene: Scene) -> tuple[Scene, tuple[Choice, ...]]:
    """Return the scene with what it left open filled in, and what was picked."""
    if "error" not in scene.tables and "budget" not in scene.tables:
        return scene, ()
    items = dict(_items(scene))
    picked: tuple[Choice, ...] = ()
    if not items:
        _warn(
            "error or budget: nothing is left to be picked, no wanted result has an open method or tolerance"
        )
    elif "error" in scene.tables:
        picked = _for_error(items, float(scene.tables["error"]))
    else:
        picked = _for_budget(items, float(scene.tables["budget"]))
    tables = {key: _copied(value) for key, value in scene.tables.items()}
    for choice in picked:
        *path, last = choice.key.split(".")
        table = tables
        for word in path:
            table = table.setdefault(word, {})
        table[last] = choice.option.value
    return replace(scene, tables=tables), picked


def _for_error(items: Mapping[str, list[Option]], error: float) -> tuple[Choice, ...]:
    """Return the quickest options that keep the error, with a warning that names those that do not."""
    picked = _pick(items, error)
    beyond = [f"{one.key} comes to {one.option.error:.1g}" for one in picked if not one.reached]
    if beyond:
        _warn(f"an error of {error:g} is out of reach: {', '.join(beyond)}")
    return picked


def _for_budget(items: Mapping[str, list[Option]], budget: float) -> tuple[Choice, ...]:
    """Return the options of the least error that keep the budget, with a warning where none do."""
    picked = _pick(items, ERRORS[0])
    least = sum(one.option.seconds for one in picked)
    if least > budget:
        _warn(f"a budget of {budget:g} s: what is wanted takes about {least:.2g} s at the least")
    for error in ERRORS[1:]:
        finer = _pick(items, error)
        if sum(one.option.seconds for one in finer) > budget:
            break
        picked = finer
    return picked


def _warn(told: str) -> None:
    warnings.warn(told, FractalContactWarning, stacklevel=4)


def _copied(value: Any) -> Any:
    return {key: _copied(item) for key, item in value.items()} if isinstance(value, Mapping) else value


def _pick(items: Mapping[str, list[Option]], error: float) -> tuple[Choice, ...]:
    """Return the quickest option of each key that reaches the error, the nearest one where none does."""
    picked = []
    for key, options in items.items():
        enough = [one for one in options if one.error <= error]
        best = min(enough, key=lambda one: one.seconds) if enough else min(options, key=lambda one: one.error)
        picked.append(Choice(key, best, bool(enough)))
    return tuple(picked)


def _items(scene: Scene) -> Iterator[tuple[str, list[Option]]]:
    """Yield the keys that are open, each with its options."""
    from fractalcontact.accuracy.curves import shipped

    curves = shipped()
    shape = _shape(scene)
    edge = float(np.sqrt(np.prod(shape)))
    for table, contest, solves, nodes in _solvers(scene, shape):
        if "tolerance" not in scene.table(table):
            (curve,) = curves[contest].values()
            seconds = solves * (nodes / MEASURED_EDGE**2) ** GROWTH
            worst = np.maximum.accumulate(curve.error[::-1])[::-1]
            yield (
                f"{table}.tolerance",
                [
                    Option(knob, MARGIN * float(error), seconds * one)
                    for knob, error, one in zip(
                        curve.knob, worst, np.maximum.accumulate(curve.seconds), strict=True
                    )
                ],
            )
    if "default" in scene.wanted("dimensions"):
        others = [word for word in scene.wanted("dimensions") if word != "default"]
        yield (
            "want.dimensions",
            [
                Option([name, *(w for w in others if w != name)], *curve.at(edge))
                for name, curve in curves["Hurst exponent"].items()
            ],
        )
    if "box_dimension" in scene.wanted("domains") and "cover" not in scene.table("domains").get(
        "box_dimension", {}
    ):
        planes = sum(solves for _, _, solves, _ in _solvers(scene, shape)) or 1.0
        covers = {
            cover: curves["carpet of Sierpinski, cut"][f"box dimension, {cover} cover"].at(edge)
            for cover in ("minimum", "mean")
        }
        yield (
            "domains.box_dimension.cover",
            [Option(cover, error, planes * seconds) for cover, (error, seconds) in covers.items()],
        )


def _solvers(scene: Scene, shape: tuple[int, int]) -> Iterator[tuple[str, str, float, float]]:
    """Yield table, contest, number of cold solves and nodes of what a solver will do."""
    hard = " with a hardness" if "hardness" in scene.table("material") else ""
    if scene.wanted("contact"):
        table = scene.table("contact")
        generated = scene.table("surface").get("generate") in PERIODIC
        kind = table.get("boundary", "periodic" if generated else "free")
        steps = max((len(value) for value in table.values() if isinstance(value, list)), default=1)
        hard = hard or (" with a hardness" if "hardness" in table else "")
        led = hard or (", closure imposed" if "closure" in table else "")
        yield "contact", f"rough, {kind} body{led}", 1.0 + WARM * (steps - 1), float(np.prod(shape))
    solves = 0.0
    stages = {"closure": ("closure",), "elastic_dilatancy": ("elastic_dilatancy", "friction")}
    wanted = set(scene.wanted("joints"))
    if (scene.wanted("domains") or "transmissivity" in wanted) and not scene.wanted("contact"):
        wanted.add("closure")
    for stage in stages:
        if stage in wanted:
            given = scene.options(
                "joint", stage, ("shear", "direction", "normal_force", "closure", "nominal_pressure")
            )
            counts = {key: len(value) if isinstance(value, list) else 1 for key, value in given.items()}
            directions = counts.get("direction", 4) if stage == "elastic_dilatancy" else 1
            steps = max(
                [counts[key] for key in ("normal_force", "closure", "nominal_pressure") if key in counts]
                or [1]
            )
            solves += counts.get("shear", 1) * directions * (1.0 + WARM * (steps - 1))
    if solves:
        yield "joint", f"rough, free body{hard}", solves, _block_nodes(scene, shape)


def _block_nodes(scene: Scene, shape: tuple[int, int]) -> float:
    block = scene.table("joint").get("block")
    if block is None:
        return float(np.prod(shape))
    return float(np.prod(np.broadcast_to(block, 2) / np.asarray(face_grid(scene)[1])))


def _shape(scene: Scene) -> tuple[int, int]:
    return face_grid(scene)[0]
