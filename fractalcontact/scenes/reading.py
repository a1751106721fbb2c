"""A scene file in, a checked `Scene` out."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fractalcontact.base.checks import Problems, meant
from fractalcontact.base.datasets import datasets_folder
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.scenes import grammar
from fractalcontact.scenes.planning import check_loads
from fractalcontact.scenes.scene import Scene, Table

COMPASS = ("E", "NE", "N", "NW", "W", "SW", "S", "SE")


def load(path: str | os.PathLike[str]) -> Scene:
    """Read a scene and check all that can be told without its surface.

    Parameters
    ----------
    path : path-like
        A TOML file; where no such file exists, the name of a shipped scene ("concrete_crack").

    Raises
    ------
    InvalidInput
        Lists every unknown key, missing table and impossible value.
    UnreadableFile
        There is no such file, or it is not TOML.
    """
    scene, problems = parse(path)
    if problems:
        raise InvalidInput(f"scene {scene.name}", problems)
    return scene


def parse(path: str | os.PathLike[str]) -> tuple[Scene, list[str]]:
    """Read a scene; return it with the list of what is wrong in it."""
    source = _find(Path(path))
    try:
        tables = tomllib.loads(source.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"scene {source.name}", [f"not a TOML file: {error}"]) from error
    problems = Problems(f"scene {source.stem}")
    tables = {key: _spelled_out(value, key, problems) for key, value in tables.items()}
    scene = Scene(source.stem, tables, source.resolve().parent)
    _check(scene, problems)
    if not problems.messages:
        check_loads(scene, problems.messages)
    return scene, problems.messages


def _find(path: Path) -> Path:
    if path.is_file():
        return path
    shipped = datasets_folder() / f"{path.name.removesuffix('.toml')}.toml"
    if path.parent.name in ("", "datasets") and shipped.is_file():
        return shipped
    names = sorted(p.stem for p in datasets_folder().glob("*.toml"))
    raise UnreadableFile(
        "scene",
        [f"path: expected a scene file or one of {', '.join(names)}, got {path.name!r}: no such file"],
    )


EVEN, LOGARITHMIC = ("start", "stop", "step"), ("first", "last", "count")
LONGEST = 1_000_000  # entries of a range


def _spelled_out(value: Any, key: str, problems: Problems) -> Any:
    """Turn ranges {start, stop, step} or {first, last, count} (log-spaced) into lists."""
    if not isinstance(value, dict):
        return value
    for words in (EVEN, LOGARITHMIC):
        if value and set(value) <= set(words):
            return _range(value, words, key, problems)
    return {word: _spelled_out(item, f"{key}.{word}", problems) for word, item in value.items()}


def _range(value: Table, words: tuple[str, ...], key: str, problems: Problems) -> list[float]:
    before = len(problems.messages)
    for word in words:
        if problems.require(
            word in value, f"{key}.{word}", f"a number (a range has {', '.join(words)})", "none"
        ):
            problems.number(f"{key}.{word}", value[word])
    if len(problems.messages) > before:
        return [0.0]
    if words is EVEN:
        start, stop, step = (float(value[word]) for word in words)
        sound = step > 0 and stop >= start and (stop - start) / step < LONGEST
        if problems.require(
            sound, key, "a range with step > 0, stop >= start and at most 10^6 entries", value
        ):
            return [start + step * number for number in range(round((stop - start) / step) + 1)]
        return [0.0]
    first, last, count = (float(value[word]) for word in words)
    sound = first > 0 and last > 0 and 1 <= count < LONGEST and count == int(count)
    if problems.require(sound, key, "a logarithmic range with first, last > 0 and a whole count >= 1", value):
        return [float(entry) for entry in np.geomspace(first, last, int(count))]
    return [0.0]


def _check(scene: Scene, problems: Problems) -> None:
    _known_keys(scene.tables, grammar.TABLES, "", problems)
    _check_choice(scene, problems)
    no_tables = [name for name in grammar.TABLES[3:] if not isinstance(scene.tables.get(name, {}), dict)]
    for name in no_tables:
        problems.add(name, "a table", scene.tables[name])
    if no_tables:
        return
    _check_surface(scene.table("surface"), "surface", problems)
    if "upper" in scene.tables:
        _check_surface(scene.table("upper"), "upper", problems)
    _known_keys(scene.table("material"), grammar.MATERIAL, "material", problems)
    for name, (room, function) in {
        "contact": ("contact", "press"),
        "dimensions": ("dimensions", "estimate"),
    }.items():
        if name in scene.tables:
            keys = [key for key in grammar.arguments(room, function)[0] if key != "methods"]  # of [want]
            _known_keys(scene.table(name), keys, name, problems)
    if "joint" in scene.tables:
        _check_stages(scene.table("joint"), "joint", grammar.joint_keys(), grammar.JOINT_STAGES, problems)
    if "domains" in scene.tables:
        _check_stages(scene.table("domains"), "domains", (), grammar.DOMAIN_STAGES, problems)
    _check_wanted(scene, problems)
    for name in ("surface", "upper", "material", "contact", "joint"):
        _check_numbers(scene.table(name), name, problems)


def _check_choice(scene: Scene, problems: Problems) -> None:
    given = [key for key in grammar.CHOICE if key in scene.tables]
    if len(given) > 1:
        problems.add("error / budget", "one of them", "both")
    for key in given:
        problems.number(key, scene.tables[key], above=0, below=1 if key == "error" else None)


def _check_surface(table: Table, name: str, problems: Problems) -> None:
    ways = [way for way in ("read", "sample", "generate") if way in table]
    if len(ways) != 1:
        problems.add(name, "one of `read`, `sample` or `generate`", ways or "none")
        return
    if ways == ["generate"]:
        generator = problems.choice(f"{name}.generate", table["generate"], grammar.GENERATORS)
        keys, required = grammar.arguments("surfaces", generator)
        _known_keys(table, (*keys, "generate", "level"), name, problems)
        for key in sorted(required - set(table)):
            problems.add(f"{name}.{key}", f"a value for {generator}", "none")
        if "members" in table:
            problems.integer(f"{name}.members", table["members"], at_least=1)
    else:
        _known_keys(table, grammar.READING, name, problems)
        if ways == ["read"]:
            problems.require(isinstance(table["read"], str), f"{name}.read", "a path", table["read"])
        if ways == ["sample"]:
            problems.choice(f"{name}.sample", table["sample"], grammar.SAMPLES)


def _check_stages(
    table: Table,
    name: str,
    common: tuple[str, ...],
    stages: Mapping[str, str],
    problems: Problems,
) -> None:
    tables = {key: value for key, value in table.items() if isinstance(value, dict) and key in stages}
    _known_keys({k: v for k, v in table.items() if k not in tables}, common, name, problems, also=stages)
    for stage, own in tables.items():
        keys = grammar.stage_keys("joints" if name == "joint" else name, stage)
        _known_keys(own, keys, f"{name}.{stage}", problems)
        _check_numbers(own, f"{name}.{stage}", problems)


def _check_wanted(scene: Scene, problems: Problems) -> None:
    table = scene.table("want")
    if not table:
        problems.add("want", "a table that names at least one result", "none")
    _known_keys(table, (*grammar.WANTED, "dimensions", "figures"), "want", problems)
    for room, words in grammar.WANTED.items():
        problems.choices(f"want.{room}", scene.wanted(room), words)
    if scene.wanted("dimensions"):
        from fractalcontact import dimensions

        problems.choices("want.dimensions", scene.wanted("dimensions"), ("default", *dimensions.methods()))
    if not isinstance(table.get("figures", False), bool):
        problems.add("want.figures", "true or false", table["figures"])
    joints = scene.wanted("joints")
    if joints or (scene.wanted("domains") and not scene.wanted("contact")):
        for key in ("young", "poisson"):
            problems.require(key in scene.table("material"), f"material.{key}", "a value", "none")
    if scene.wanted("contact"):
        given, material = scene.table("contact"), scene.table("material")
        problems.require(
            "contact_modulus" in given or {"young", "poisson"} <= set(material),
            "contact.contact_modulus",
            "a value, or young and poisson in [material]",
            "none",
        )
        problems.require(
            sum(key in given for key in grammar.LOADS) == 1,
            "contact",
            "exactly one of closure, normal_force, nominal_pressure",
            sorted(given) or "none",
        )


def _check_numbers(table: Table, name: str, problems: Problems) -> None:
    for key, (above, at_least, below) in grammar.BOUNDS.items():
        if key not in table or (
            name == "joint" and key in grammar.JOINT_STAGES and isinstance(table[key], dict)
        ):
            continue
        check = problems.number if key in grammar.SINGLE else problems.numbers
        check(f"{name}.{key}", table[key], above=above, at_least=at_least, below=below)
    if "direction" in table:
        given = table["direction"]
        for direction in given if isinstance(given, list) else [given]:
            azimuth = isinstance(direction, (int, float)) and not isinstance(direction, bool)
            valid = direction in COMPASS or (azimuth and abs(direction) < 1e9)
            problems.require(
                valid,
                f"{name}.direction",
                f"one of {', '.join(COMPASS)}, or an azimuth in degrees",
                direction,
            )


def _known_keys(
    table: Table, known: Iterable[str], name: str, problems: Problems, also: Iterable[str] = ()
) -> None:
    words = tuple(known)
    for key in table:
        if key not in words:
            place = f"{name}.{key}" if name else key
            hint = meant(key, (*words, *also))
            problems.add(place, f"one of the keys {', '.join(words) or 'none'}", f"an unknown key{hint}")
