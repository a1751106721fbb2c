"""The JSON Schema of scenes: every scene of the package fits it, and what it refuses `load` refuses."""

import copy
import json
import tomllib
from pathlib import Path

import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.cli import main

jsonschema = pytest.importorskip("jsonschema")

DATASETS = Path(__file__).resolve().parents[2] / "datasets"
SHIPPED = sorted(path.stem for path in DATASETS.glob("*.toml"))
SCHEMA = fc.scenes.json_schema()
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
WRONG = ("no word", -1, 0, 2.5, True, [], [-1.0], ["no word"], {"unknown": 1}, [[1.0]], {"start": 0})


def fits(tables):
    return VALIDATOR.is_valid(tables)


def toml(value):
    """Return a value as TOML, tables inline."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value)


def is_loaded(tables, folder):
    path = folder / "scene.toml"
    path.write_text("".join(f"{key} = {toml(value)}\n" for key, value in tables.items()), encoding="utf-8")
    try:
        fc.scenes.load(path)
    except InvalidInput:
        return False
    return True


def places(tables, path=()):
    """Yield the path of every key of a scene."""
    for key, value in tables.items():
        yield (*path, key)
        if isinstance(value, dict):
            yield from places(value, (*path, key))


def changed(tables, path, *value):
    """Return a copy with another value at a path, or without the key."""
    result = copy.deepcopy(tables)
    table = result
    for key in path[:-1]:
        table = table[key]
    if value:
        table[path[-1]] = value[0]
    else:
        table.pop(path[-1], None)
    return result


def scene(name):
    return tomllib.loads((DATASETS / f"{name}.toml").read_text(encoding="utf-8"))


def test_the_shipped_schema_is_that_of_this_version():
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    shipped = (DATASETS / "fractalcontact.schema.json").read_text(encoding="utf-8")
    # without the difference of two texts of a thousand lines, which hides the command
    is_current = shipped == json.dumps(SCHEMA, indent=1) + "\n"
    command = "import json, fractalcontact as fc; print(json.dumps(fc.scenes.json_schema(), indent=1))"
    assert is_current, f"write it anew: python -c '{command}' > datasets/fractalcontact.schema.json"


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_fit_and_name_the_schema(name):
    text = (DATASETS / f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema ./fractalcontact.schema.json\n")
    VALIDATOR.validate(tomllib.loads(text))


@pytest.mark.parametrize(
    "name",
    [
        "new_scene",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("rigid_sliding", "pressed_surface")),
    ],
)
def test_what_the_schema_refuses_is_refused_by_load(name, tmp_path):
    tables = scene(name)
    assert is_loaded(tables, tmp_path)
    refused = 0
    for path in places(tables):
        table = (*path[:-1], "unknown_key")
        scenes = [changed(tables, path), changed(tables, table, 1)]
        for other in scenes + [changed(tables, path, value) for value in WRONG]:
            if not fits(other):
                refused += 1
                assert not is_loaded(other, tmp_path), (path, other)
    assert refused > 50


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("material", "young"), -1.0),
        (("material", "young"), [1e9, 2e9, 3e9]),
        (("joint", "direction"), "UP"),
        (("joint", "closure", "colour"), "red"),
        (("surface", "generate"), "noise"),
        (("surface", "shape"), 128),
        (("surface",), {"read": "scan.ply", "plane": "surface"}),
        (("want", "joints"), ["closer"]),
        (("error",), 2.0),
        (("want",), {}),
    ],
)
def test_plain_mistakes_are_seen_by_the_schema(path, value):
    assert not fits(changed(scene("new_scene"), path, value))


def test_surface_has_one_direction(tmp_path):
    tables = scene("pressed_surface")
    for value, valid in (("N", True), (30.0, True), (["E", "N"], False)):
        other = changed(tables, ("surface", "direction"), value)
        assert fits(other) == is_loaded(other, tmp_path) == valid


def test_new_and_printed_scenes_fit(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init"]) == 0
    text = Path("scene.toml").read_text(encoding="utf-8")
    named = text.splitlines()[0].removeprefix("#:schema ")
    jsonschema.validate(tomllib.loads(text), json.loads(Path(named).read_text(encoding="utf-8")))
    lower = fc.surfaces.fbm((64, 64), 2e-4, hurst=0.7, rms_increment=1e-5, rng=3)
    fc.save(lower, "lower.nc")
    fc.save(lower + 1e-4, "upper.nc")
    capsys.readouterr()
    young = ["--young", "3e10"]
    for words in (["roughness"], ["contact", *young], ["joint", *young]):
        files = ["lower.nc", "upper.nc"] if words[0] == "joint" else ["lower.nc"]
        assert main([words[0], *files, *words[1:], "--scene"]) == 0
        VALIDATOR.validate(tomllib.loads(capsys.readouterr().out))


def test_every_key_has_a_meaning():
    """An editor shows a sentence for every key of every table."""

    def keys(schema, place):
        for key, value in schema.get("properties", {}).items():
            yield f"{place}.{key}", value
            yield from keys(value, f"{place}.{key}")
        for form in [*schema.get("oneOf", ()), *schema.get("anyOf", ())]:
            yield from keys(form, place)

    without = [place for place, value in keys(SCHEMA, "") if "description" not in value]
    assert not without


def test_a_range_of_directions_fits(tmp_path):
    text = """
[surface]
generate = "fbm"
shape = [32, 32]
spacing = 1e-4
hurst = 0.8
rms_increment = 5e-6
rng = 2
[joint]
block = 1.6e-3
[joint.rigid_dilatancy]
shear = [0.0, 2e-4]
direction = { start = 0.0, stop = 90.0, step = 45.0 }
[want]
joints = ["rigid_dilatancy"]
"""
    (tmp_path / "range.toml").write_text(text)
    jsonschema.validate(tomllib.loads(text), SCHEMA)
    tree = fc.scenes.run(tmp_path / "range.toml", progress=False)
    assert tree["joints/rigid_dilatancy/azimuth"].values.tolist() == [0.0, 45.0, 90.0]
