"""JSON Schema of scenes, for editors: made from the tables that check a scene, and from docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping

from fractalcontact.scenes import _scene_keys
from fractalcontact.scenes._functions import public_function
from fractalcontact.scenes._scene_keys import TABLES, TITLE, Keys, Kind, Schema
from fractalcontact.scenes._stages import STAGES

DRAFT = "http://json-schema.org/draft-07/schema#"


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
        name: {
            **(_surface(name) if name in ("surface", "upper") else _with_stages(name)),
            "description": text,
        }
        for name, text in TABLES.items()
    }
    return {
        "$schema": DRAFT,
        "title": "Scene of fractalcontact",
        **_table({"title": _described(TITLE, "")} | tables),
        "required": ["want"],
        "anyOf": [{"required": ["surface"]}, {"required": ["joint"]}],
        "definitions": dict(zip(("even_range", "logarithmic_range"), _ranges(), strict=True)),
    }


def _table(properties: Mapping[str, Schema]) -> Schema:
    """Return a table with these keys and no others."""
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _described(kind: Kind, docstring: str) -> Schema:
    """Return the schema of a key with its own description, or else that of the docstring."""
    text = kind.text or docstring
    return ({"description": text} if text else {}) | kind.schema


def _ranges() -> list[Schema]:
    even, logarithmic = (
        {word: _scene_keys.number().schema for word in words}
        for words in (_scene_keys.EVEN, _scene_keys.LOGARITHMIC)
    )
    positive = _scene_keys.number(above=0.0).schema
    even |= {"step": positive}
    count = _scene_keys.number(at_least=1, below=_scene_keys.LONGEST_RANGE).schema | {"multipleOf": 1}
    logarithmic |= {"first": positive, "last": positive, "count": count}
    return [_table(words) | {"required": list(words)} for words in (even, logarithmic)]


def _surface(place: str) -> Schema:
    """Return the table of a surface: one form for files, one for samples, one for each generator."""
    forms = _scene_keys.surface_forms(place)
    functions = {"read": "surfaces.read", "sample": "surfaces.read"}
    tables = [
        _table(_properties(keys, parameter_texts(functions.get(form, f"surfaces.{form}"))))
        | {"required": list(keys.required)}
        for form, keys in forms.items()
    ]
    return {"type": "object", "oneOf": tables}


def _properties(keys: Keys, texts: Mapping[str, str]) -> dict[str, Schema]:
    return {key: _described(kind, texts.get(key, "")) for key, kind in keys.kinds.items()}


def _with_stages(name: str) -> Schema:
    """Return a table with keys of its own and a table for each of its stages."""
    keys = _scene_keys.keys_of(name)
    texts: dict[str, str] = {}
    if name in STAGES:  # the arguments of one function
        texts = parameter_texts(STAGES[name].function)
    elif name == "joint":  # arguments that several stages share: the first words about each
        for row in keys.stages.values():
            texts = parameter_texts(row.function) | texts
    properties = _properties(keys, texts)
    for word, row in keys.stages.items():
        table = _table(_properties(_scene_keys.keys_of_stage(row), parameter_texts(row.function)))
        table["description"] = f"Arguments of fractalcontact.{row.function}."
        if own := properties.get(word):  # [joint.closure] is a stage, closure = 1e-6 a load
            schema = keys.kinds[word].schema
            table = {**own, "anyOf": [*schema.get("anyOf", [schema]), table]}
        properties[word] = table
    return _table(properties) | ({"minProperties": 1} if name == "want" else {})


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
