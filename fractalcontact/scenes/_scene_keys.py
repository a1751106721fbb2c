"""The keys of a scene, declared once: `load` checks their values, and editors get the JSON schema of them.

What the keys mean is in the docstrings of the functions that take them.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from fractalcontact.base import compass
from fractalcontact.base.units import PRESSURE, UNITS
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._scene import LOADS, OF_SURFACE, Table
from fractalcontact.scenes._stage_type import StageType, arguments_of, public_function
from fractalcontact.scenes._stages import STAGES, WANTED

Schema = dict[str, Any]

GENERATORS = ("fbm", "spectral", "midpoint", "weierstrass")
SAMPLES = (
    "concrete_crack", "jacksboro_fault_dem", "freiberg_gneiss_side_a", "freiberg_gneiss_side_b",
    "afm_10um_di3", "wli_126um_opd1",
)  # fmt: skip
TABLES = {
    "surface": "The lower face, or the only surface: one of read, sample, generate.",
    "upper": "The upper face of a joint; without it the two faces match.",
    "material": "Both bodies. young and poisson are one value, or [lower, upper].",
    "contact": "A surface pressed by a flat: the arguments of fractalcontact.contact.press.",
    "joint": "Two faces: the block that slides, and arguments that several stages share.",
    "dimensions": "The arguments of fractalcontact.dimensions.estimate.",
    "domains": "The analysis of the set of true contacts, one table for each function.",
    "want": "The wanted results; only what they need is computed.",
}
WANT = {
    "surfaces": "Results about the surface.",
    "dimensions": 'Estimators of fractal dimension: "default" or names of `fractalcontact methods`.',
    "contact": "Results of the surface pressed by a flat.",
    "joints": "Results of the joint.",
    "domains": "Results about the set of true contacts.",
    "keep": "Maps to store.",
    "figures": "Draw figures.",
    "datasheet": "Write datasheet.pdf, one page about a joint, and its curves as CSV files.",
}
EVEN, LOGARITHMIC = ("start", "stop", "step"), ("first", "last", "count")
LONGEST_RANGE = 1_000_000  # entries of a range, members of an ensemble: more are a slip of the pen
# arguments in Pa, which may have their unit, and words for others
PRESSURES = (
    "young", "hardness", "yield_pressure", "contact_modulus", "nominal_pressure", "seating_pressure",
    "wall_strength", "compressive_strength", "tensile_strength", "cohesion", "upstream_pressure",
    "downstream_pressure", "drain_pressure", "total_stress",
)  # fmt: skip
SPELLINGS: dict[str, dict[str, str]] = {"direction": compass.WORDS, "dimensions": {"psd": "spectrum"}}
BOUNDS = {
    "above": "exclusiveMinimum",
    "at_least": "minimum",
    "below": "exclusiveMaximum",
    "at_most": "maximum",
}
WITH_UNIT = {"type": "string", "pattern": PRESSURE.pattern}
RANGES = [{"$ref": "#/definitions/even_range"}, {"$ref": "#/definitions/logarithmic_range"}]


@dataclass(frozen=True)
class Kind:
    """What the value of a key may be: its check, called with problems, place and value, and its schema.

    `text` describes the key, where the docstring of the function that takes the value does not.
    """

    check: Callable[[Problems, str, Any], object]
    schema: Schema = field(default_factory=dict)
    text: str = ""

    def about(self, text: str) -> Kind:
        """Return this kind with the description of a key."""
        return replace(self, text=text)


def _kind(check: Callable[..., object], schema: Schema, *arguments: Any, **options: Any) -> Kind:
    """Return the kind that a method of `Problems`, or a function like one, checks with these arguments."""
    return Kind(lambda problems, place, value: check(problems, place, value, *arguments, **options), schema)


def _bounded(kind: str, bounds: Mapping[str, float]) -> Schema:
    return {"type": kind} | {BOUNDS[name]: bound for name, bound in bounds.items()}


def number(unit: bool = False, **bounds: float) -> Kind:
    """Return the kind of one number inside bounds, with `unit` a pressure that may have its unit."""
    schema = _bounded("number", bounds)
    return _kind(Problems.number, {"anyOf": [schema, WITH_UNIT]} if unit else schema, **bounds)


def _numbers(unit: bool = False, pair: bool = False, **bounds: float) -> Kind:
    """Return the kind of one number, a list or a range of them; with `pair` one for each body at most."""
    one = number(unit, **bounds).schema
    several = {"type": "array", "minItems": 1, "items": one} | ({"maxItems": 2} if pair else {})
    schema = {"anyOf": [*one.get("anyOf", [one]), several, *RANGES]}
    return _kind(_check_pair if pair else Problems.numbers, schema, **bounds)


def _check_pair(problems: Problems, place: str, value: Any, **bounds: Any) -> None:
    problems.numbers(place, value, **bounds)
    fits = not isinstance(value, list) or len(value) in (1, 2)
    problems.require(fits, place, "one value, or [lower, upper]", value)


def _integer(**bounds: int) -> Kind:
    return _kind(Problems.integer, _bounded("integer", bounds), **bounds)


def _choice(words: Iterable[str]) -> Kind:
    allowed = list(words)
    return _kind(Problems.choice, {"enum": allowed}, allowed)


def _choices(words: Iterable[str]) -> Kind:
    """Return the kind of one word or a list of words."""
    allowed = list(words)
    return _kind(Problems.choices, _one_or_several({"enum": allowed}), allowed)


def _one_or_several(one: Schema, **more: int) -> Schema:
    """Return the schema of a value or a list of such values."""
    return {"anyOf": [one, {"type": "array", **more, "items": one}]}


def _check_files(problems: Problems, place: str, value: Any) -> None:
    files = value if isinstance(value, list) else [value]
    for file in files:
        problems.path(place, file)
    problems.require(bool(files), place, "a file, a pattern or a list of files", files)


def _check_value(problems: Problems, place: str, value: Any) -> None:
    """Check that an argument is no table, which would be taken for that of a stage and left out."""
    is_told = any(f"{argument}.".startswith(f"{place}.") for argument in problems.arguments)
    if isinstance(value, dict) and not is_told:
        problems.add(place, "a value, not a table", value)


def _check_shape(problems: Problems, place: str, value: Any) -> None:
    """Check for the shape of a surface: one number would make a profile."""
    problems.require(isinstance(value, list) and len(value) == 2, place, "[ny, nx]", value)


def _unchecked(problems: Problems, place: str, value: Any) -> None:
    """Leave the check to the function that takes the value."""


_AZIMUTH = number(above=-compass.LARGEST_AZIMUTH, below=compass.LARGEST_AZIMUTH).schema
_DIRECTION = {"anyOf": [{"enum": [*compass.AZIMUTHS, *compass.WORDS]}, _AZIMUTH]}
ANYTHING, VALUE = Kind(_unchecked), Kind(_check_value)
FLAG = Kind(Problems.boolean, {"type": "boolean"})
FILES = Kind(_check_files, _one_or_several({"type": "string", "minLength": 1}, minItems=1))
DIRECTION = Kind(compass.check_direction, _DIRECTION)
TITLE = Kind(
    lambda problems, place, value: problems.require(isinstance(value, str), place, "words", value),
    {"type": "string"},
    "Title of the study.",
)
# arguments that several functions share; their other ones are checked by the functions alone
SHARED = {
    **dict.fromkeys(("contact_modulus", "hardness", "seating_pressure"), number(unit=True, above=0.0)),
    **dict.fromkeys(("smoothing", "distance", "viscosity", "unit_weight"), number(above=0.0)),
    "tolerance": number(above=0.0, below=1.0),
    "block": _numbers(above=0.0).about("Edges of the upper block, m."),
    **dict.fromkeys(("spacing", "structure_size"), _numbers(above=0.0)),
    **{key: _numbers(unit=key in PRESSURES, at_least=0.0) for key in ("shear", *LOADS)},
    "direction": Kind(compass.check_directions, {"anyOf": [*_one_or_several(_DIRECTION)["anyOf"], *RANGES]}),
}
LEVEL = _integer(at_least=0).about("Remove the least-squares polynomial of this degree.")
PREPARATION = {
    "level": LEVEL,
    "despike": FLAG.about("Remove points that stand out from all around them; roughness keeps them."),
    "fill": FLAG.about("Fill small gaps with the smoothest surface."),
}
OF_FILES = {
    "channel": ANYTHING,
    "units": _choice(UNITS),
    "spacing": SHARED["spacing"],
    **dict.fromkeys(("first_row", "columns"), ANYTHING),
    "plane": ANYTHING.about(
        'Of points: "fit", "xy"; of [upper] also "surface", the plane and cells of [surface].'
    ),
    **PREPARATION,
}
PLANES = {"surface": ("fit", "xy"), "upper": ("fit", "xy", OF_SURFACE)}
MATERIAL = {
    "young": _numbers(unit=True, pair=True, above=0.0).about("Young's modulus, Pa."),
    "poisson": _numbers(pair=True, above=-1.0, at_most=0.5).about("Poisson's ratio."),
    "basic_friction_angle": number(at_least=0.0, below=90.0).about("Friction angle of smooth faces, degree."),
    "hardness": SHARED["hardness"].about("Largest pressure, Pa; beyond it the bodies yield."),
    "yield_pressure": _numbers(unit=True, above=0.0).about(
        "Pressure that the true pressures are compared with, Pa; changes no result."
    ),
}
OF_JOINT = {
    "register": FLAG.about("Bring two measured faces into mated position first."),
    "turn_upper": _choice(("x", "y")).about(
        "The axis about which an upper body that was scanned face up is turned over."
    ),
    "lower": FILES.about("Files of the lower faces, as read of [surface]."),
    "upper": FILES.about("Files of the upper faces, as read of [upper]; wildcards pair them."),
}


@dataclass(frozen=True)
class Keys:
    """The keys of a table: the kind of each, those that it must have, and the stages with a table in it.

    The docstrings of the `functions` say what the keys mean.
    """

    kinds: Mapping[str, Kind]
    required: tuple[str, ...] = ()
    stages: Mapping[str, StageType] = field(default_factory=dict)
    functions: tuple[str, ...] = ()


def surface_forms(place: str) -> dict[str, Keys]:
    """Return the keys of `[surface]` or `[upper]` by its source: `read`, `sample`, or the generator."""
    plane = {"plane": _choice(PLANES[place]).about(OF_FILES["plane"].text)}
    read = FILES.about(
        "A file, relative to the scene, of every format of fractalcontact.surfaces.read; of many scans a "
        "pattern (scans/*.sur) or a list."
    )
    sample = _choice(SAMPLES).about("A surface that is installed with the package.")
    forms = {
        "read": Keys({"read": read} | OF_FILES | plane, ("read",), functions=("surfaces.read",)),
        "sample": Keys({"sample": sample} | PREPARATION, ("sample",)),
    }
    for name in GENERATORS:
        keys, required = arguments_of(f"surfaces.{name}")
        kinds = {key: SHARED.get(key, ANYTHING) for key in keys}
        kinds["shape"] = Kind(_check_shape, {"type": "array", "minItems": 2, "maxItems": 2})
        if "members" in kinds:
            kinds["members"] = _integer(at_least=1, at_most=LONGEST_RANGE)
        if "direction" in kinds:
            kinds["direction"] = DIRECTION
        text = "A synthetic surface; the other keys are the arguments of this function."
        kinds |= {"generate": Kind(_unchecked, {"const": name}, text), "level": LEVEL}
        forms[name] = Keys(kinds, ("generate", *sorted(required)), functions=(f"surfaces.{name}",))
    return forms


def keys_of(table: str, given: Table | None = None) -> Keys:
    """Return the keys of a table of a scene other than those of the surfaces.

    Of the table that is `given`, the words of a key that it does not have may be left out.
    """
    if table == "material":
        return Keys(MATERIAL)
    if table == "want":
        methods: tuple[str, ...] = ()
        if given is None or "dimensions" in given:
            from fractalcontact import dimensions  # only here: it imports the estimators

            methods = ("default", *dimensions.methods(), *SPELLINGS["dimensions"])
        words = {**WANTED, "dimensions": methods}
        kinds = {key: (_choices(words[key]) if key in words else FLAG).about(WANT[key]) for key in WANT}
        return Keys(kinds)
    rows = {row.table: row for row in STAGES.values() if row.table.partition(".")[0] == table}
    stages = {place.partition(".")[2]: row for place, row in rows.items() if place != table}
    if table == "joint":  # the arguments of its stages may stand in it too
        common = (key for row in stages.values() for key in row.arguments())
        functions = tuple(row.function for row in stages.values())
        return Keys(_arguments(("block", *common)) | OF_JOINT, (), stages, functions)
    if table not in rows:
        return Keys({}, (), stages)
    own = keys_of_stage(rows[table])
    kinds = {key: kind for key, kind in own.kinds.items() if key != "methods"}  # these are in [want]
    return replace(own, kinds=kinds, stages=stages)


def keys_of_stage(row: StageType) -> Keys:
    """Return the keys of the table of a stage, `[joint.closure]` for example."""
    return Keys(_arguments(row.arguments()), functions=(row.function,))


def _arguments(names: Iterable[str]) -> dict[str, Kind]:
    return {name: SHARED.get(name, VALUE) for name in names}


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
    tables = {name: _table_of(keys_of(name)) for name in TABLES if name not in ("surface", "upper")}
    tables["want"]["minProperties"] = 1
    for name in ("surface", "upper"):  # one form for files, one for samples, one for each generator
        tables[name] = {"type": "object", "oneOf": [_table_of(keys) for keys in surface_forms(name).values()]}
    described = {name: {**tables[name], "description": text} for name, text in TABLES.items()}
    return {
        "$schema": DRAFT,
        "title": "Scene of fractalcontact",
        **_table({"title": _described(TITLE, "")} | described),
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
    even, logarithmic = ({word: number().schema for word in words} for words in (EVEN, LOGARITHMIC))
    positive = number(above=0.0).schema
    even |= {"step": positive}
    count = number(at_least=1, below=LONGEST_RANGE).schema | {"multipleOf": 1}
    logarithmic |= {"first": positive, "last": positive, "count": count}
    return [_table(words) | {"required": list(words)} for words in (even, logarithmic)]


def _table_of(keys: Keys) -> Schema:
    """Return a table with keys of its own and a table for each of its stages."""
    texts: dict[str, str] = {}
    for function in keys.functions:  # of arguments that several stages share the first words about each
        texts = parameter_texts(function) | texts
    properties = {key: _described(kind, texts.get(key, "")) for key, kind in keys.kinds.items()}
    for word, row in keys.stages.items():
        table = _table_of(keys_of_stage(row)) | {
            "description": f"Arguments of fractalcontact.{row.function}."
        }
        if own := properties.get(word):  # [joint.closure] is a stage, closure = 1e-6 a load
            schema = keys.kinds[word].schema
            table = {**own, "anyOf": [*schema.get("anyOf", [schema]), table]}
        properties[word] = table
    return _table(properties) | ({"required": list(keys.required)} if keys.required else {})


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
