"""Reading a scene file: TOML in, a `Scene` with valid keys and values out."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from fractalcontact.base.compass import AZIMUTHS
from fractalcontact.base.compass import WORDS as AZIMUTH_WORDS
from fractalcontact.base.datasets import datasets_folder
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.lengths import UNITS
from fractalcontact.base.units import pascals
from fractalcontact.base.validation import NONE, Problems, Words, did_you_mean
from fractalcontact.scenes._functions import arguments_of
from fractalcontact.scenes._plan import check_needs, stages_of
from fractalcontact.scenes._scene import (
    LOADS,
    MATERIAL_KEYS,
    PLANES,
    WANT_KEYS,
    MaterialTable,
    Scene,
    Table,
)
from fractalcontact.scenes._stages import (
    DOMAIN_STAGES,
    JOINT_STAGES,
    PARTIAL_SLIP,
    STAGES,
    WANTED,
)

GENERATORS = ("fbm", "spectral", "midpoint", "weierstrass")
SAMPLES = (
    "concrete_crack", "jacksboro_fault_dem", "freiberg_gneiss_side_a", "freiberg_gneiss_side_b",
    "afm_10um_di3", "wli_126um_opd1",
)  # fmt: skip
READING = (
    "read", "sample", "channel", "units", "spacing", "first_row", "columns", "plane", "level", "despike",
    "fill",
)  # fmt: skip
SETTINGS = ("title",)
TABLES = ("surface", "upper", "material", "contact", "joint", "dimensions", "domains", "want")
EVEN, LOGARITHMIC = ("start", "stop", "step"), ("first", "last", "count")
LONGEST_RANGE = 1_000_000
LARGEST_FILE = 1 << 20  # bytes
LONGEST_KEY = 32  # parts of a dotted key; the time and the memory of the parser grow with their square
NOT_IN_KEYS = re.compile(r"[^\w\s.\"'-]")
KEY_PART = re.compile(r"[\w\"']\s*\.")
DEEPEST = 8  # levels of tables and lists; a scene has four
TOO_DEEP = "tables or lists are nested too deeply: expected a table, its sub-tables and lists in them"
COMPASS = tuple(AZIMUTHS)

# bounds of the arguments that several stages share: one number, or one or several
ONE_NUMBER: dict[str, dict[str, Any]] = {
    "contact_modulus": {"above": 0.0},
    "tolerance": {"above": 0.0, "below": 1.0},
    "smoothing": {"above": 0.0},
    "distance": {"above": 0.0},
    "viscosity": {"above": 0.0},
    "hardness": {"above": 0.0},
    "unit_weight": {"above": 0.0},
    "seating_pressure": {"above": 0.0},
}
NUMBERS: dict[str, dict[str, Any]] = {
    "block": {"above": 0.0},
    "spacing": {"above": 0.0},
    "shear": {"at_least": 0.0},
    "structure_size": {"above": 0.0},
    **{load: {"at_least": 0.0} for load in LOADS},
}


# keys that people write as the symbol of the field
SYMBOLS = {
    "jcs": "wall_strength",
    "jrc": "roughness_coefficient",
    "phi_b": "basic_friction_angle",
    "phi_r": "residual_friction_angle",
    "e": "young",
    "nu": "poisson",
    "h": "hurst",
}
# arguments in Pa, which may have their unit, and words for others
PRESSURES = (
    "young", "hardness", "yield_pressure", "contact_modulus", "nominal_pressure", "seating_pressure",
    "wall_strength", "tensile_strength", "upstream_pressure", "downstream_pressure", "drain_pressure",
    "total_stress",
)  # fmt: skip
SPELLINGS: dict[str, dict[str, str]] = {"direction": AZIMUTH_WORDS, "dimensions": {"psd": "spectrum"}}
PAIRS = ("young", "poisson")  # one value, or that of each body


def load(path: str | os.PathLike[str]) -> Scene:
    """Read a scene and check all that can be checked without its surfaces.

    Parameters
    ----------
    path : path-like
        A TOML file; where no such file exists, the name of a shipped scene ("concrete_crack").

    Returns
    -------
    Scene

    Raises
    ------
    InvalidInput
        Lists every unknown key, missing table and invalid value.
    UnreadableFile
        There is no such file, or it is not TOML.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> scene = fc.scenes.load("pressed_surface")
    >>> len(scene.table("contact")["nominal_pressure"])  # a range is expanded
    12
    """
    scene, problems = parse(path)
    if problems.messages:
        raise InvalidInput(problems.where, problems.messages)
    return replace(scene, checked=deepcopy(scene.tables))


def parse(path: str | os.PathLike[str]) -> tuple[Scene, Problems]:
    """Read a scene; return it with its problems."""
    with Problems("fractalcontact.scenes.load") as problems:
        problems.path("path", path)
    source = _find(Path(path))
    try:
        tables = tomllib.loads(_text(source))
    except OSError as error:
        raise UnreadableFile(f"scene {source.name}", [f"it cannot be read: {error.strerror}"]) from error
    except RecursionError:
        raise UnreadableFile(f"scene {source.name}", [f"not a TOML file: {TOO_DEEP}"]) from None
    except ValueError as error:  # not TOML or not UTF-8, too large, or a number of more than 4300 digits
        raise UnreadableFile(f"scene {source.name}", [f"not a TOML file: {error}"]) from error
    return check_tables(Scene(source.stem, tables, source.resolve().parent))


def _is_too_deep(value: Any) -> bool:
    """Return whether tables and lists are nested deeper than any scene needs."""
    level = [value]
    for _ in range(DEEPEST):
        inner = [item.values() if isinstance(item, dict) else item for item in level]
        level = [item for items in inner for item in items if isinstance(item, (dict, list))]
        if not level:
            return False
    return True


def check_tables(scene: Scene) -> tuple[Scene, Problems]:
    """Return a scene with its ranges expanded, and the problems of its tables.

    In place of what is no table it has an empty one, so that the problems of the others are listed too.
    """
    problems = Problems(f"scene {scene.name}")
    if scene.checked is not None and scene.checked == scene.tables:
        return scene, problems  # the check loads every function whose arguments the tables may name
    if _is_too_deep(scene.tables):
        raise InvalidInput(problems.where, [TOO_DEEP])
    tables = {key: _in_plain_words(value, key) for key, value in scene.tables.items()}
    tables = {key: _expand_ranges(value, key, problems) for key, value in tables.items()}
    for key, name in (("lower", "surface"), ("upper", "upper")):  # files of both faces, in one table
        if isinstance(tables.get("joint"), dict) and key in tables["joint"]:
            own = tables.get(name)
            tables[name] = {"read": tables["joint"][key], **(own if isinstance(own, dict) else {})}
            tables["joint"] = {other: tables["joint"][other] for other in tables["joint"] if other != key}
    for name in TABLES:
        if not isinstance(tables.get(name, {}), dict):
            problems.add(name, "a table", tables[name])
            tables[name] = {}
    scene = replace(scene, tables=tables)
    _check(scene, problems)
    if not any(argument.startswith("want") for argument in problems.arguments):
        check_needs(scene, problems)
    problems.messages.sort(
        key=lambda message: "an unknown key" not in message
    )  # other problems follow from it
    return scene, problems


def _text(source: Path) -> str:
    """Return the text of a scene; refuse one that takes the parser minutes or gigabytes."""
    with source.open("rb") as file:
        content = file.read(LARGEST_FILE + 1)
    if len(content) > LARGEST_FILE:
        raise ValueError(f"expected at most {LARGEST_FILE >> 10} KiB, got more")
    text = content.decode("utf-8-sig").replace("\r\n", "\n")
    for number, line in enumerate(text.splitlines(), 1):
        words = NOT_IN_KEYS.split("" if line.lstrip().startswith("#") else line)
        if max(len(KEY_PART.findall(word)) for word in words) > LONGEST_KEY:
            raise ValueError(f"expected a key of at most {LONGEST_KEY} parts, got more in line {number}")
    return text


def _find(path: Path) -> Path:
    try:
        if path.is_file():
            return path
    except OSError as error:  # a folder on the way may not be searched
        raise UnreadableFile("scene", [f"path: {path.name!r}: {error.strerror}"]) from error
    shipped = datasets_folder() / f"{path.name.removesuffix('.toml')}.toml"
    if path.parent.name in ("", "datasets") and shipped.is_file():
        return shipped
    names = ", ".join(sorted(scene.stem for scene in datasets_folder().glob("*.toml")))
    raise UnreadableFile(
        "scene", [f"path: expected a scene file or one of {names}, got {path.name!r}: no such file"]
    )


def _in_plain_words(value: Any, key: str) -> Any:
    """Replace what the commands understand as well: "30 GPa", "west", and "psd" for the spectrum."""
    if isinstance(value, dict):
        return {word: _in_plain_words(item, word) for word, item in value.items()}
    if isinstance(value, list):
        return [_in_plain_words(item, key) for item in value]
    if not isinstance(value, str):
        return value
    if key in PRESSURES:
        pressure = pascals(value)
        return value if pressure is None else pressure
    return SPELLINGS.get(key, {}).get(value, value)


def _expand_ranges(value: Any, key: str, problems: Problems) -> Any:
    """Replace the ranges {start, stop, step} and {first, last, count} (logarithmic) by lists."""
    if not isinstance(value, dict):
        return value
    for words in (EVEN, LOGARITHMIC):
        if value and set(value) <= set(words):
            return _range(value, words, key, problems)
    return {word: _expand_ranges(item, f"{key}.{word}", problems) for word, item in value.items()}


def _range(value: Table, words: tuple[str, ...], key: str, problems: Problems) -> Any:
    """Return the list of a range; a range with problems stays as it is."""
    expected = f"a number (a range has {', '.join(words)})"
    checks = [
        problems.number(f"{key}.{word}", value[word])
        if problems.require(word in value, f"{key}.{word}", expected, NONE)
        else False
        for word in words
    ]
    if not all(checks):
        return value
    low, high, number = (float(value[word]) for word in words)
    if words is EVEN:
        valid = number > 0 and high >= low and (high - low) / number < LONGEST_RANGE
        expected = "a range with step > 0, stop >= start and at most 10^6 entries"
        if not problems.require(valid, key, expected, value):
            return value
        return [low + number * index for index in range(round((high - low) / number) + 1)]
    valid = low > 0 and high > 0 and 1 <= number < LONGEST_RANGE and number == int(number)
    expected = "a logarithmic range with first, last > 0 and an integer count >= 1"
    if not problems.require(valid, key, expected, value):
        return value
    return [float(entry) for entry in np.geomspace(low, high, int(number))]


def _check(scene: Scene, problems: Problems) -> None:
    _check_keys(scene.tables, (*SETTINGS, *TABLES), "", problems)
    _check_settings(scene.tables, problems)
    _check_surface(scene.table("surface"), "surface", problems)
    if "upper" in scene.tables:
        _check_surface(scene.table("upper"), "upper", problems)
    _check_material(scene.table("material"), problems)
    if "contact" in scene.tables:
        own = arguments_of("contact.press")[0]
        _check_stages(scene.table("contact"), "contact", own, (PARTIAL_SLIP,), problems)
    if "dimensions" in scene.tables:
        keys = [key for key in arguments_of("dimensions.estimate")[0] if key != "methods"]  # from [want]
        _check_keys(scene.table("dimensions"), keys, "dimensions", problems)
        _check_values(scene.table("dimensions"), "dimensions", problems)
    if "joint" in scene.tables:
        problems.boolean("joint.register", scene.table("joint").get("register", False))
        problems.choice("joint.turn_upper", scene.table("joint").get("turn_upper"), ("x", "y"), optional=True)
        _check_stages(scene.table("joint"), "joint", joint_keys(), JOINT_STAGES, problems)
    if "domains" in scene.tables:
        _check_stages(scene.table("domains"), "domains", (), DOMAIN_STAGES, problems)
    _check_want(scene, problems)


def _check_settings(tables: Table, problems: Problems) -> None:
    title = tables.get("title", "")
    problems.require(isinstance(title, str), "title", "words", title)


def _check_surface(table: Table, name: str, problems: Problems) -> None:
    sources = [source for source in ("read", "sample", "generate") if source in table]
    if len(sources) != 1:
        problems.add(name, "one of `read`, `sample` or `generate`", sources or NONE)
    elif sources == ["generate"]:
        if problems.choice(f"{name}.generate", table["generate"], GENERATORS):
            generator = table["generate"]
            keys, required = arguments_of(f"surfaces.{generator}")
            _check_keys(table, (*keys, "generate", "level"), name, problems)
            for key in sorted(required - set(table)):
                problems.add(f"{name}.{key}", f"a value for {generator}", NONE)
        if "shape" in table:  # one number would make a profile, and studies are of surfaces
            shape = table["shape"]
            is_pair = isinstance(shape, list) and len(shape) == 2
            problems.require(is_pair, f"{name}.shape", "[ny, nx]", shape)
        if "members" in table:
            problems.integer(f"{name}.members", table["members"], at_least=1, at_most=LONGEST_RANGE)
    else:
        _check_keys(table, READING, name, problems)
        problems.choice(f"{name}.units", table.get("units"), UNITS, optional=True)
        if sources == ["read"]:
            reads = table["read"] if isinstance(table["read"], list) else [table["read"]]
            for read in reads:
                problems.path(f"{name}.read", read)
            problems.require(bool(reads), f"{name}.read", "a file, a pattern or a list of files", reads)
            problems.choice(f"{name}.plane", table.get("plane"), PLANES[name], optional=True)
        else:
            problems.choice(f"{name}.sample", table["sample"], SAMPLES)
    for flag in ("despike", "fill"):
        problems.boolean(f"{name}.{flag}", table.get(flag, False))
    problems.integer(f"{name}.level", table.get("level"), at_least=0, optional=True)
    _check_numbers(table, name, problems)


def _check_material(table: Table, problems: Problems) -> None:
    _check_keys(table, MATERIAL_KEYS, "material", problems)
    for entry in fields(MaterialTable):
        if entry.name in table:
            several = entry.name in (*PAIRS, "yield_pressure")
            check = problems.numbers if several else problems.number
            check(f"material.{entry.name}", table[entry.name], **entry.metadata["bounds"])
    for name in PAIRS:
        value = table.get(name)
        if isinstance(value, list):
            expected = "one value, or [lower, upper]"
            problems.require(len(value) in (1, 2), f"material.{name}", expected, value)


def joint_keys() -> tuple[str, ...]:
    """Return the keys of `[joint]`: the block, `register`, `turn_upper`, and the arguments of all stages."""
    stages = (STAGES[f"joints/{name}"] for name in JOINT_STAGES)
    return tuple(
        dict.fromkeys(
            ["block", "register", "turn_upper", *(key for row in stages for key in row.arguments())]
        )
    )


def _check_stages(
    table: Table, name: str, common: tuple[str, ...], stages: tuple[str, ...], problems: Problems
) -> None:
    """Check a table whose sub-tables are the arguments of single stages."""
    own = {key: value for key, value in table.items() if isinstance(value, dict) and key in stages}
    rest = {key: value for key, value in table.items() if key not in own}
    _check_keys(rest, common, name, problems, similar=stages)
    _check_numbers(rest, name, problems)
    _check_values(rest, name, problems)
    subpackage = "joints" if name == "joint" else name
    for stage, options in own.items():
        row = STAGES[stage if name == "contact" else f"{subpackage}/{stage}"]
        _check_keys(options, row.arguments(), f"{name}.{stage}", problems)
        _check_numbers(options, f"{name}.{stage}", problems)


def _check_want(scene: Scene, problems: Problems) -> None:
    table = scene.table("want")
    if not table:
        problems.add("want", "a table that names at least one result", NONE)
    _check_keys(table, WANT_KEYS, "want", problems)
    valid = [
        problems.choices(f"want.{name}", table[name], words)
        for name, words in WANTED.items()
        if name in table
    ]
    if "dimensions" in table:
        from fractalcontact import dimensions  # only here: it imports the estimators

        names = ("default", *dimensions.methods())
        valid.append(problems.choices("want.dimensions", table["dimensions"], names))
    for key in ("figures", "datasheet"):
        problems.boolean(f"want.{key}", table.get(key, False))
    if all(valid):
        _check_needed_tables(scene, problems)


def _check_needed_tables(scene: Scene, problems: Problems) -> None:
    """Check that the material and the load are there where a wanted result needs them."""
    material = scene.table("material")
    # the block falls on rigid faces where the material has no elastic constants
    rigid = set() if {"young", "poisson"} & set(material) else {"joints/self_weight"}
    planned = [stage.row for stage in stages_of(scene) if stage.name not in rigid]
    if any(row.presses and row.takes == "crack" for row in planned):
        for key in ("young", "poisson"):
            problems.require(key in material, f"material.{key}", "a value", NONE)
    slips = PARTIAL_SLIP in (*scene.wanted("contact"), *scene.wanted("joints"))
    if slips:
        expected = "no hardness: partial slip is that of elastic bodies"
        problems.require("hardness" not in material, "material.hardness", expected, "a value")


def _check_numbers(table: Table, name: str, problems: Problems) -> None:
    for key, bounds in ONE_NUMBER.items():
        if key in table:
            problems.number(f"{name}.{key}", table[key], **bounds)
    for key, bounds in NUMBERS.items():
        if key in table:
            problems.numbers(f"{name}.{key}", table[key], **bounds)
    if "direction" in table:
        _check_direction(table["direction"], f"{name}.direction", problems)


def _check_values(table: Table, name: str, problems: Problems) -> None:
    """Check that no argument is a table, which would be taken for that of a stage and left out."""
    for key, value in table.items():
        place = f"{name}.{key}"
        is_told = any(f"{argument}.".startswith(f"{place}.") for argument in problems.arguments)
        if isinstance(value, dict) and not is_told:
            problems.add(place, "a value, not a table", value)


def _check_direction(value: Any, place: str, problems: Problems) -> None:
    for direction in value if isinstance(value, list) else [value]:
        azimuth = isinstance(direction, (int, float)) and not isinstance(direction, bool)
        valid = direction in COMPASS or (azimuth and abs(direction) < 1e9)
        problems.require(valid, place, f"one of {', '.join(COMPASS)}, or an azimuth in degrees", direction)


def _check_keys(
    table: Table, allowed: Iterable[str], name: str, problems: Problems, similar: Iterable[str] = ()
) -> None:
    words = tuple(allowed)
    for key in table:
        if key not in words:
            place = f"{name}.{key}" if name else key
            hint = did_you_mean(key, (*words, *similar)) or _home_of(key)
            got = Words(f"an unknown key{hint}")
            problems.add(place, f"one of the keys {', '.join(words) or 'none'}", got)


def _home_of(key: str) -> str:
    """Return the tables that a key belongs to, also one that is written as the symbol of the field."""
    name = SYMBOLS.get(key.lower(), key)
    homes = [f"[{row.table}]" for row in STAGES.values() if row.table and name in row.arguments()]
    homes += ["[material]"] if name in MATERIAL_KEYS else []
    if not homes:
        return ""
    return f": {name!r} belongs to {', '.join(homes[:-1])}{' or ' if homes[1:] else ''}{homes[-1]}"
