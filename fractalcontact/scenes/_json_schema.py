"""JSON Schema of scenes, for editors: made from the tables that check a scene, and from docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from fractalcontact.base.units import PRESSURE
from fractalcontact.scenes._functions import arguments_of, public_function
from fractalcontact.scenes._scene import PLANES, WANT_KEYS, MaterialTable
from fractalcontact.scenes._scene_file import (
    COMPASS,
    EVEN,
    GENERATORS,
    LOGARITHMIC,
    LONGEST_RANGE,
    NUMBERS,
    ONE_NUMBER,
    PAIRS,
    PRESSURES,
    READING,
    SAMPLES,
    SPELLINGS,
    joint_keys,
)
from fractalcontact.scenes._stages import (
    DOMAIN_STAGES,
    JOINT_STAGES,
    PARTIAL_SLIP,
    STAGES,
    WANTED,
)

Schema = dict[str, Any]

DRAFT = "http://json-schema.org/draft-07/schema#"
FLAG = {"type": "boolean"}
BOUNDS = {
    "above": "exclusiveMinimum",
    "at_least": "minimum",
    "below": "exclusiveMaximum",
    "at_most": "maximum",
}
WITH_UNIT = {"type": "string", "pattern": PRESSURE.pattern}
RANGES = [{"$ref": "#/definitions/even_range"}, {"$ref": "#/definitions/logarithmic_range"}]
FILES = {
    "anyOf": [
        {"type": "string", "minLength": 1},
        {"type": "array", "minItems": 1, "items": {"type": "string", "minLength": 1}},
    ]
}
OF_JOINT = ("block", "register", "turn_upper", "lower", "upper")
PURPOSES = {
    "surface": "The lower face, or the only surface: one of read, sample, generate.",
    "upper": "The upper face of a joint; without it the two faces match.",
    "material": "Both bodies. young and poisson are one value, or [lower, upper].",
    "contact": "A surface pressed by a flat: the arguments of fractalcontact.contact.press.",
    "joint": "Two faces: the block that slides, and arguments that several stages share.",
    "dimensions": "The arguments of fractalcontact.dimensions.estimate.",
    "domains": "The analysis of the set of true contacts, one table for each function.",
    "want": "The wanted results; only what they need is computed.",
}
OWN = {
    "title": "Title of the study.",
    "read": "A file, relative to the scene, of every format of fractalcontact.surfaces.read; of many scans a "
    "pattern (scans/*.sur) or a list.",
    "lower": "Files of the lower faces, as read of [surface].",
    "upper": "Files of the upper faces, as read of [upper]; wildcards pair them.",
    "sample": "A surface that is installed with the package.",
    "generate": "A synthetic surface; the other keys are the arguments of this function.",
    "level": "Remove the least-squares polynomial of this degree.",
    "despike": "Remove points that stand out from all around them; roughness keeps them.",
    "fill": "Fill small gaps with the smoothest surface.",
    "plane": 'Of points: "fit", "xy"; of [upper] also "surface", the plane and cells of [surface].',
    "young": "Young's modulus, Pa.",
    "poisson": "Poisson's ratio.",
    "basic_friction_angle": "Friction angle of smooth faces, degree.",
    "hardness": "Largest pressure, Pa; beyond it the bodies yield.",
    "yield_pressure": "Pressure that the true pressures are compared with, Pa; changes no result.",
    "block": "Edges of the upper block, m.",
    "register": "Bring two measured faces into mated position first.",
    "turn_upper": "The axis about which an upper body that was scanned face up is turned over.",
    "surfaces": "Results about the surface.",
    "dimensions": 'Estimators of fractal dimension: "default" or names of `fractalcontact methods`.',
    "contact": "Results of the surface pressed by a flat.",
    "joints": "Results of the joint.",
    "domains": "Results about the set of true contacts.",
    "keep": "Maps to store.",
    "figures": "Draw figures.",
    "datasheet": "Write datasheet.pdf, one page about a joint, and its curves as CSV files.",
}


def json_schema() -> Schema:
    """Return the JSON Schema of scene files, for completion and checks in an editor.

    Returns
    -------
    dict
        JSON Schema (draft 7). It has every key with its meaning and the values that `load` accepts. What
        depends on other tables or on the surface is checked by `load` and `validate` alone.

    Notes
    -----
    `fractalcontact init` writes it beside the new scene, whose first line names it (``#:schema``) for editors
    with TOML support. The shipped scenes name that of the folder `datasets`.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> schema = fc.scenes.json_schema()
    >>> sorted(schema["properties"])[:5]
    ['contact', 'dimensions', 'domains', 'joint', 'material']
    >>> schema["properties"]["material"]["properties"]["young"]["description"]
    "Young's modulus, Pa."
    """
    tables = {
        "surface": _surface("surface"),
        "upper": _surface("upper"),
        "material": _table(_material(), OWN),
        "contact": _with_stages(
            "contact", arguments_of("contact.press")[0], "contact.press", (PARTIAL_SLIP,)
        ),
        "joint": _with_stages("joint", joint_keys(), "", JOINT_STAGES),
        "dimensions": _arguments("dimensions.estimate", leave_out=("methods",)),
        "domains": _with_stages("domains", (), "", DOMAIN_STAGES),
        "want": _want(),
    }
    for name, purpose in PURPOSES.items():
        tables[name]["description"] = purpose
    settings = {"title": {"type": "string"}}
    return {
        "$schema": DRAFT,
        "title": "Scene of fractalcontact",
        **_table(_described(settings, OWN) | tables, {}),
        "required": ["want"],
        "anyOf": [{"required": ["surface"]}, {"required": ["joint"]}],
        "definitions": dict(zip(("even_range", "logarithmic_range"), _ranges(), strict=True)),
    }


def _table(properties: Mapping[str, Schema], texts: Mapping[str, str]) -> Schema:
    """Return a table with these keys and no others."""
    return {"type": "object", "properties": _described(properties, texts), "additionalProperties": False}


def _described(properties: Mapping[str, Schema], texts: Mapping[str, str]) -> dict[str, Schema]:
    return {
        key: ({"description": texts[key]} if key in texts else {}) | value
        for key, value in properties.items()
    }


def _number(bounds: Mapping[str, float], key: str = "") -> Schema:
    """Return one number; a pressure may have its unit."""
    number = {"type": "number"} | {BOUNDS[name]: bound for name, bound in bounds.items()}
    return {"anyOf": [number, WITH_UNIT]} if key in PRESSURES else number


def _numbers(bounds: Mapping[str, float], most: int | None = None, key: str = "") -> Schema:
    """Return one number, a list of them, or a range."""
    one = _number(bounds, key)
    several = {"type": "array", "minItems": 1, "items": one}
    alternatives = one.get("anyOf", [one])
    return {"anyOf": [*alternatives, several | ({"maxItems": most} if most else {}), *RANGES]}


def _ranges() -> list[Schema]:
    even, logarithmic = ({word: {"type": "number"} for word in words} for words in (EVEN, LOGARITHMIC))
    even |= {"step": _number({"above": 0.0})}
    logarithmic |= {"first": _number({"above": 0.0}), "last": _number({"above": 0.0})}
    logarithmic |= {"count": _number({"at_least": 1, "below": LONGEST_RANGE}) | {"multipleOf": 1}}
    return [_table(words, {}) | {"required": list(words)} for words in (even, logarithmic)]


def _words(allowed: Iterable[str]) -> Schema:
    """Return one word or a list of words."""
    word = {"enum": list(allowed)}
    return {"anyOf": [word, {"type": "array", "items": word}]}


def _value(key: str) -> Schema:
    """Return what `load` accepts for an argument that several functions share; anything for others."""
    if key in ONE_NUMBER:
        return _number(ONE_NUMBER[key], key)
    if key in NUMBERS:
        return _numbers(NUMBERS[key], key=key)
    if key == "direction":
        direction = {
            "anyOf": [{"enum": [*COMPASS, *SPELLINGS["direction"]]}, _number({"above": -1e9, "below": 1e9})]
        }
        return {"anyOf": [direction, {"type": "array", "items": direction}]}
    return {}


def _arguments(function: str, keys: Iterable[str] | None = None, leave_out: Iterable[str] = ()) -> Schema:
    """Return a table with arguments of a public function, described by its docstring."""
    allowed = arguments_of(function)[0] if keys is None else keys
    chosen = [key for key in allowed if key not in leave_out]
    texts = {"block": OWN["block"]} | parameter_texts(function)
    return _table({key: _value(key) for key in chosen}, texts)


def _surface(place: str) -> Schema:
    """Return the table of a surface: one form for files, one for samples, one for each generator."""
    level = {"type": "integer", "minimum": 0}
    common = {key: _value(key) for key in READING if key not in ("read", "sample")}
    common |= {"level": level, "despike": FLAG, "fill": FLAG}
    planes = {"plane": {"enum": list(PLANES[place])}}
    texts = parameter_texts("surfaces.read") | OWN
    forms = [
        _table({"read": FILES} | common | planes, texts) | {"required": ["read"]},
        _table({"sample": {"enum": list(SAMPLES)}} | common, texts) | {"required": ["sample"]},
    ]
    for name in GENERATORS:
        keys, required = arguments_of(f"surfaces.{name}")
        own = {key: _value(key) for key in keys} | {"generate": {"const": name}, "level": level}
        own["shape"] = {"type": "array", "minItems": 2, "maxItems": 2}
        if "members" in own:
            own["members"] = {"type": "integer", "minimum": 1, "maximum": LONGEST_RANGE}
        table = _table(
            own, parameter_texts(f"surfaces.{name}") | {k: texts[k] for k in ("generate", "level")}
        )
        forms.append(table | {"required": ["generate", *sorted(required)]})
    return {"type": "object", "oneOf": forms}


def _material() -> dict[str, Schema]:
    properties = {}
    for entry in fields(MaterialTable):
        bounds = entry.metadata["bounds"]
        is_pair = entry.name in PAIRS
        several = is_pair or entry.name == "yield_pressure"
        properties[entry.name] = (
            _numbers(bounds, 2 if is_pair else None, entry.name) if several else _number(bounds, entry.name)
        )
    return properties


def _with_stages(name: str, common: Iterable[str], function: str, stages: Iterable[str]) -> Schema:
    """Return a table with arguments of its own and a table for each of its stages."""
    texts = parameter_texts(function) if function else _shared_texts(stages)
    properties = {key: _value(key) for key in common}
    if "register" in properties:
        properties |= {"register": FLAG, "turn_upper": {"enum": ["x", "y"]}, "lower": FILES, "upper": FILES}
    subpackage = "joints" if name == "joint" else name
    for word in stages:
        row = STAGES[word if name == "contact" else f"{subpackage}/{word}"]
        table = _arguments(row.function, row.arguments())
        table["description"] = f"Arguments of fractalcontact.{row.function}."
        own = properties.get(word)  # [joint.closure] is a stage, closure = 1e-6 a load
        properties[word] = table if own is None else {"anyOf": [*own.get("anyOf", [own]), table]}
    return _table(properties, texts | {key: OWN[key] for key in OF_JOINT})


def _shared_texts(stages: Iterable[str]) -> dict[str, str]:
    """Return the descriptions of the arguments that the stages of the joint share."""
    texts: dict[str, str] = {}
    for word in stages:
        row = STAGES.get(f"joints/{word}")
        texts = (parameter_texts(row.function) if row else {}) | texts
    return texts


def _want() -> Schema:
    from fractalcontact import dimensions  # only here: it imports the estimators

    words = dict(WANTED) | {"dimensions": ("default", *dimensions.methods(), *SPELLINGS["dimensions"])}
    properties = {key: _words(words[key]) if key in words else FLAG for key in WANT_KEYS}
    return _table(properties, OWN) | {"minProperties": 1}


def parameter_texts(function: str) -> dict[str, str]:
    """Return the first sentence about every parameter in the docstring of a public function."""
    lines = (inspect.getdoc(public_function(function)) or "").splitlines()
    start = lines.index("Parameters") + 2
    texts: dict[str, str] = {}
    names: list[str] = []
    for line, following in zip(lines[start:], [*lines[start + 1 :], ""], strict=True):
        if following.startswith("---"):
            break
        if line and not line.startswith(" "):
            names = line.partition(" :")[0].split(", ")
        else:
            words = line.strip().replace("`", "")
            texts |= {name: f"{texts.get(name, '')} {words}".strip() for name in names}
    return {name: re.split(r"(?<=\.)\s", text, maxsplit=1)[0] for name, text in texts.items() if text}
