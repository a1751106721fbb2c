"""Reading a scene file: TOML in, a valid `Scene` out; of many scans a scene for each file."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.files import datasets_folder, files_of, is_pattern
from fractalcontact.base.units import pascals
from fractalcontact.base.validation import NONE, Problems, Words, did_you_mean, reading
from fractalcontact.scenes import _scene_keys
from fractalcontact.scenes._inputs import FROM_MATERIAL, given_options, loads_of
from fractalcontact.scenes._results_folder import folder_of
from fractalcontact.scenes._scene import LOADS, Scene, Table
from fractalcontact.scenes._scene_keys import Keys
from fractalcontact.scenes._stage_type import StageType
from fractalcontact.scenes._stages import STAGES, Stage, stages_of

NOT_IN_KEYS = re.compile(r"[^\w\s.\"'-]")
KEY_PART = re.compile(r"[\w\"']\s*\.")
TOO_DEEP = "tables or lists are nested too deeply: expected a table, its sub-tables and lists in them"
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
    return scene


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


def _is_too_deep(value: Any, levels: int = 8) -> bool:
    """Return whether tables and lists are nested deeper than any scene needs, which has four levels."""
    level = [value]
    for _ in range(levels):
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
    if _is_too_deep(scene.tables):
        raise InvalidInput(problems.where, [TOO_DEEP])
    tables = {key: _in_plain_words(value, key, key, problems) for key, value in scene.tables.items()}
    for key, name in (("lower", "surface"), ("upper", "upper")):  # files of both faces, in one table
        if isinstance(tables.get("joint"), dict) and key in tables["joint"]:
            own = tables.get(name)
            tables[name] = {"read": tables["joint"][key], **(own if isinstance(own, dict) else {})}
            tables["joint"] = {other: tables["joint"][other] for other in tables["joint"] if other != key}
    for name in _scene_keys.TABLES:
        if not isinstance(tables.get(name, {}), dict):
            problems.add(name, "a table", tables[name])
            tables[name] = {}
    scene = replace(scene, tables=tables)
    _check(scene, problems)
    # other problems follow from an unknown key
    problems.messages.sort(key=lambda message: "an unknown key" not in message)
    return scene, problems


def _text(source: Path, size: int = 1 << 20, parts: int = 32) -> str:
    """Return the text of a scene; refuse one that takes the parser minutes or gigabytes.

    It has at most `size` bytes. Time and memory of the parser grow with the square of the parts of a key;
    1 MiB of keys of 8 to 128 parts takes 1.0 to 1.4 s.
    """
    with source.open("rb") as file:
        content = file.read(size + 1)
    if len(content) > size:
        raise ValueError(f"expected at most {size >> 10} KiB, got more")
    text = content.decode("utf-8-sig").replace("\r\n", "\n")
    for number, line in enumerate(text.splitlines(), 1):
        words = NOT_IN_KEYS.split("" if line.lstrip().startswith("#") else line)
        if max(len(KEY_PART.findall(word)) for word in words) > parts:
            raise ValueError(f"expected a key of at most {parts} parts, got more in line {number}")
    return text


def _find(path: Path) -> Path:
    with reading("scene", path):  # a folder on the way may not be searched
        if path.is_file():
            return path
    shipped = datasets_folder() / f"{path.name.removesuffix('.toml')}.toml"
    if path.parent.name in ("", "datasets") and shipped.is_file():
        return shipped
    names = ", ".join(sorted(scene.stem for scene in datasets_folder().glob("*.toml")))
    got = f"{path.name!r}: no such file"
    raise UnreadableFile.of("scene", "path", f"a scene file or one of {names}", got)


def _in_plain_words(value: Any, key: str, place: str, problems: Problems) -> Any:
    """Replace what the commands understand as well ("30 GPa", "west", "psd" for the spectrum), and ranges."""
    if isinstance(value, dict):
        for words in (_scene_keys.EVEN, _scene_keys.LOGARITHMIC):
            if value and set(value) <= set(words):
                return _range(value, words, place, problems)
        return {
            word: _in_plain_words(item, word, f"{place}.{word}", problems) for word, item in value.items()
        }
    if isinstance(value, list):
        return [_in_plain_words(item, key, place, problems) for item in value]
    if not isinstance(value, str):
        return value
    if key in _scene_keys.PRESSURES:
        pressure = pascals(value)
        return value if pressure is None else pressure
    return _scene_keys.SPELLINGS.get(key, {}).get(value, value)


def _range(value: Table, words: tuple[str, ...], key: str, problems: Problems) -> Any:
    """Return the list of {start, stop, step} or {first, last, count} (logarithmic); as it is if not valid."""
    expected = f"a number (a range has {', '.join(words)})"
    checks = [
        problems.number(f"{key}.{word}", value[word])
        if problems.require(word in value, f"{key}.{word}", expected, NONE)
        else False
        for word in words
    ]
    if not all(checks):
        return value
    (low, high, number), most = (float(value[word]) for word in words), _scene_keys.LONGEST_RANGE
    if words is _scene_keys.EVEN:
        valid = number > 0 and high >= low and (high - low) / number < most
        expected = "a range with step > 0, stop >= start and at most 10^6 entries"
    else:
        valid = low > 0 and high > 0 and 1 <= number < most and number == int(number)
        expected = "a logarithmic range with first, last > 0 and an integer count >= 1"
    if not problems.require(valid, key, expected, value):
        return value
    if words is _scene_keys.EVEN:
        return [low + number * index for index in range(round((high - low) / number) + 1)]
    return [float(entry) for entry in np.geomspace(low, high, int(number))]


def _check(scene: Scene, problems: Problems) -> None:
    """Check all tables; the keys of one are looked up, which imports functions, only where there is one."""
    _check_table(
        scene.tables,
        Keys({"title": _scene_keys.TITLE} | dict.fromkeys(_scene_keys.TABLES, _scene_keys.ANYTHING)),
        "",
        problems,
    )
    for name in _scene_keys.TABLES:
        if name == "surface" or (name == "upper" and name in scene.tables):
            _check_surface(scene.table(name), name, problems)
        elif name in scene.tables:
            table = scene.table(name)
            _check_table(table, _scene_keys.keys_of(name, table), name, problems)
    if not scene.table("want"):
        problems.add("want", "a table that names at least one result", NONE)
    if not any(argument.startswith("want") for argument in problems.arguments):
        stages = stages_of(scene)
        _check_material(scene, [stage.row for stage in stages if stage.row.presses], problems)
        for stage in stages:
            if stage.row.table and stage.row.takes != "file":
                _check_arguments(scene, stage, problems)


def _check_surface(table: Table, name: str, problems: Problems) -> None:
    forms = _scene_keys.surface_forms(name)
    sources = [source for source in ("read", "sample", "generate") if source in table]
    form = sources[0] if len(sources) == 1 else ""
    if not form:
        problems.add(name, "one of `read`, `sample` or `generate`", sources or NONE)
    elif form == "generate":
        is_known = problems.choice(f"{name}.generate", table["generate"], _scene_keys.GENERATORS)
        form = table["generate"] if is_known else ""
    if form:
        _check_table(table, forms[form], name, problems)
    else:  # all keys have a meaning that one of the forms gives them
        kinds = {key: kind for each in forms.values() for key, kind in each.kinds.items()}
        checked = {key: value for key, value in table.items() if key in kinds}
        _check_table(checked, Keys(kinds), name, problems)


def _check_table(table: Table, keys: Keys, name: str, problems: Problems) -> None:
    """Check the keys and values of a table, and of the tables of stages in it."""
    for key, value in table.items():
        place = f"{name}.{key}" if name else key
        if isinstance(value, dict) and key in keys.stages:
            _check_table(value, _scene_keys.keys_of_stage(keys.stages[key]), place, problems)
        elif key in keys.kinds:
            keys.kinds[key].check(problems, place, value)
        else:
            hint = did_you_mean(key, (*keys.kinds, *keys.stages)) or _home_of(key, name)
            expected = f"one of the keys {', '.join(keys.kinds) or 'none'}"
            problems.add(place, expected, Words(f"an unknown key{hint}"))
    for key in keys.required:
        source = table.get("generate", "the surface")
        problems.require(key in table, f"{name}.{key}", f"a value for {source}", NONE)


def _check_material(scene: Scene, pressing: Sequence[StageType], problems: Problems) -> None:
    """Check that stages that press have their constants, and no hardness where one refuses it."""
    material = scene.table("material")
    is_elastic = bool({"young", "poisson"} & set(material))
    if any(row.takes == "crack" and (is_elastic or not row.may_be_rigid) for row in pressing):
        for key in ("young", "poisson"):
            problems.require(key in material, f"material.{key}", "a value", NONE)
    shared = {row.table.partition(".")[0] for row in pressing if row.refuses_hardness}
    for name in ["material", *sorted(shared)] if shared else []:
        expected = "no hardness: partial slip is that of elastic bodies"
        problems.require("hardness" not in scene.table(name), f"{name}.hardness", expected, "a value")


def _check_arguments(scene: Scene, stage: Stage, problems: Problems) -> None:
    """Note what a stage needs and the scene does not give, and loads and directions that are ambiguous."""
    row, name, reason = stage.row, stage.row.word or stage.name, stage.reason
    options, material = given_options(scene, row), set(scene.table("material"))
    for key in row.needed():
        sources, _ = FROM_MATERIAL.get(key, ((), None))
        if key in options or (sources and material >= set(sources)):
            continue
        place = "joint" if key in (*LOADS, "shear", "block") else row.table
        if key.endswith("friction_angle"):
            place, key, sources = "material", "basic_friction_angle", ()
        elsewhere = f", or {' and '.join(sources)} in [material]" if sources else ""
        problems.add(f"{place}.{key}", f"a value for {name} ({reason}){elsewhere}", NONE)
    direction = options.get("direction", "E")
    if row.one_direction and isinstance(direction, list):
        problems.add(f"{row.table.partition('.')[0]}.direction", f"one direction for {name}", direction)
    if row.one_load and len(loads := loads_of(scene, row)) != 1:
        *others, last = (key for key in LOADS if key in row.arguments())
        expected = f"exactly one of {', '.join(others)} or {last} for {name} ({reason})"
        problems.add(row.table, expected, Words(", ".join(loads)) or NONE)


def _home_of(key: str, place: str) -> str:
    """Return the other tables that a key belongs to, also one that is written as the symbol of the field."""
    name = SYMBOLS.get(key.lower(), key)
    tables = [row.table for row in STAGES.values() if row.table and name in row.arguments()]
    tables += ["material"] if name in _scene_keys.MATERIAL else []
    homes = [f"[{table}]" for table in tables if table != place]
    if not homes:
        return ""
    return f": {name!r} belongs to {', '.join(homes[:-1])}{' or ' if homes[1:] else ''}{homes[-1]}"


def scans_of(scene: Scene) -> dict[str, Scene]:
    """Return the scene of every scan by its name; empty for a scene of one surface.

    A scan is called as its file, or, of files in several folders, as the path from the folder they share; a
    pair of faces as what the wildcards of both patterns stand for.

    Raises
    ------
    InvalidInput
        No file has such a name, or lower and upper faces do not match; the error lists them.
    """
    reads = {name: scene.table(name)["read"] for name in ("surface", "upper") if "read" in scene.table(name)}
    if not any(isinstance(read, list) or is_pattern(read, scene.folder) for read in reads.values()):
        return {}
    with Problems(f"scene {scene.name}") as problems:
        problems.require("surface" in reads, "surface.read", "a lower face for every upper one", NONE)
    with problems:
        files = {name: _files(read, name, scene.folder, problems) for name, read in reads.items()}
        if len(files) == 2 and all(files.values()):
            _check_pairs(reads, files, problems)
        is_named_by_file = isinstance(reads["surface"], list) or len(files) == 1
        names = _names(list(files["surface"].values())) if is_named_by_file else list(files["surface"])
        twice = sorted({name for name in names if names.count(name) > 1})
        problems.require(not twice, "surface.read", "each file once", Words(f"{', '.join(twice)} again"))
    pairs = zip(*(each.values() for each in files.values()), strict=True)
    tables = [
        {name: {**scene.table(name), "read": file} for name, file in zip(files, pair, strict=True)}
        for pair in pairs
    ]
    return {
        name: replace(scene, name=folder_of(name), tables={**scene.tables, "title": name, **own})
        for name, own in zip(names, tables, strict=True)
    }


def _files(read: Any, place: str, folder: Path, problems: Problems) -> dict[str, str]:
    """Return the files of a pattern by what its wildcards stand for, those of a list by their number."""
    if not is_pattern(read, folder):
        files = read if isinstance(read, list) else [read]
        return {str(number): str(file) for number, file in enumerate(files)}
    matching = files_of(read, folder)
    problems.require(bool(matching), f"{place}.read", "a pattern with files", Words(f"{read!r} without any"))
    return matching


def _check_pairs(
    reads: Mapping[str, Any], files: Mapping[str, Mapping[str, str]], problems: Problems
) -> None:
    """Note the faces that have no other one."""
    lower, upper = files["surface"], files["upper"]
    lonely = [f"{lower[key]} has no upper face" for key in lower if key not in upper]
    lonely += [f"{upper[key]} has no lower face" for key in upper if key not in lower]
    if lonely:
        expected = f"an upper face for every lower one ({reads['surface']} and {reads['upper']})"
        problems.add("upper.read", expected, Words("; ".join(lonely)))


def _names(files: list[str]) -> list[str]:
    """Return the names of files from the folder that they share."""
    parts = [Path(file).parts for file in files]
    same = takewhile(lambda each: len(set(each)) == 1, zip(*(each[:-1] for each in parts), strict=False))
    shared = len(list(same))
    return ["/".join(each[shared:]) for each in parts]
