"""JSON Schema of scenes, for editors: made from the tables that check a scene, and from docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping

from fractalcontact.scenes import _scene_keys
from fractalcontact.scenes._functions import public_function
from fractalcontact.scenes._scene_keys import Keys, Schema
from fractalcontact.scenes._stage_type import StageType

DRAFT = "http://json-schema.org/draft-07/schema#"
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
FUNCTIONS = {"contact": "contact.press", "dimensions": "dimensions.estimate"}  # whose arguments a table has
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
        name: _surface(name) if name in ("surface", "upper") else _with_stages(name) for name in PURPOSES
    }
    for name, purpose in PURPOSES.items():
        tables[name]["description"] = purpose
    return {
        "$schema": DRAFT,
        "title": "Scene of fractalcontact",
        **_table(_described({"title": _scene_keys.TITLE.schema}, OWN) | tables, {}),
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


def _ranges() -> list[Schema]:
    even, logarithmic = (
        {word: _scene_keys.number().schema for word in words}
        for words in (_scene_keys.EVEN, _scene_keys.LOGARITHMIC)
    )
    positive = _scene_keys.number(above=0.0).schema
    even |= {"step": positive}
    count = _scene_keys.number(at_least=1, below=_scene_keys.LONGEST_RANGE).schema | {"multipleOf": 1}
    logarithmic |= {"first": positive, "last": positive, "count": count}
    return [_table(words, {}) | {"required": list(words)} for words in (even, logarithmic)]


def _surface(place: str) -> Schema:
    """Return the table of a surface: one form for files, one for samples, one for each generator."""
    tables = []
    for form, keys in _scene_keys.surface_forms(place).items():
        if form in ("read", "sample"):
            texts = parameter_texts("surfaces.read") | OWN
        else:
            texts = parameter_texts(f"surfaces.{form}") | {key: OWN[key] for key in ("generate", "level")}
        tables.append(_of_keys(keys, texts) | {"required": list(keys.required)})
    return {"type": "object", "oneOf": tables}


def _of_keys(keys: Keys, texts: Mapping[str, str]) -> Schema:
    return _table({key: kind.schema for key, kind in keys.kinds.items()}, texts)


def _with_stages(name: str) -> Schema:
    """Return a table with keys of its own and a table for each of its stages."""
    keys = _scene_keys.keys_of(name)
    properties = {key: kind.schema for key, kind in keys.kinds.items()}
    for word, row in keys.stages.items():
        table = _of_keys(
            _scene_keys.keys_of_stage(row), {"block": OWN["block"]} | parameter_texts(row.function)
        )
        table["description"] = f"Arguments of fractalcontact.{row.function}."
        own = properties.get(word)  # [joint.closure] is a stage, closure = 1e-6 a load
        properties[word] = table if own is None else {"anyOf": [*own.get("anyOf", [own]), table]}
    return _table(properties, _texts(name, keys.stages)) | ({"minProperties": 1} if name == "want" else {})


def _texts(name: str, stages: Mapping[str, StageType]) -> dict[str, str]:
    """Return the descriptions of the keys of a table itself."""
    if name in ("material", "want"):
        return OWN
    if name == "joint":  # arguments that several stages share: the first words about each
        shared: dict[str, str] = {}
        for row in stages.values():
            shared = parameter_texts(row.function) | shared
        return shared | {key: OWN[key] for key in ("block", *_scene_keys.OF_JOINT)}
    return parameter_texts(FUNCTIONS[name]) if name in FUNCTIONS else {}


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
