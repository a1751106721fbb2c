"""Scene files: valid ones are read, and all problems of others are listed at once."""

import re
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from study import SOUND, command, command_here

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, UnreadableFile


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="study.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


def test_valid_scene_is_read_and_planned(write):
    scene = fc.scenes.load(write(SOUND))
    assert scene.name == "study"
    names = [stage.name for stage in fc.scenes.plan(scene)]
    assert names == ["surfaces", "joints/rigid_dilatancy", "joints/closure"]
    assert "closure is wanted" in str(fc.scenes.plan(scene))


def test_domains_are_those_of_the_contact_that_a_scene_describes(write):
    surface = SOUND.partition("[joint]")[0]
    load = "[contact]\ncontact_modulus = 1e9\nnominal_pressure = [1e5, 1e6]\n"
    scene = fc.scenes.load(write(f'{surface}{load}[want]\ndomains = ["islands"]\n'))
    assert [stage.name for stage in fc.scenes.plan(scene)] == ["surfaces", "contact", "domains/islands"]
    both = SOUND.partition("[want]")[0] + f'{load}[want]\ndomains = ["islands"]\n'
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(write(both)))]
    assert names == ["surfaces", "joints/closure", "domains/islands"]


def test_ranges_are_expanded(write):
    text = SOUND.replace("[1e-4, 4e-4]", "{ start = 0.0, stop = 3e-4, step = 1e-4 }")
    scene = fc.scenes.load(write(text.replace("[1.0, 10.0]", "{ first = 1.0, last = 100.0, count = 3 }")))
    assert scene.table("joint")["shear"] == pytest.approx([0, 1e-4, 2e-4, 3e-4])
    assert scene.table("joint")["normal_force"] == pytest.approx([1, 10, 100])


def test_all_problems_are_listed_at_once(write):
    text = SOUND.replace("hurst", "hirst").replace("30e9", "-30e9").replace("poisson = 0.2", "poisson = 0.7")
    text = text.replace('"closure"', '"closing"').replace('"W"', '"Q"').replace("block", "blok")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.load(write(text))
    message = str(caught.value)
    for part in (
        "surface.hirst",
        "did you mean 'hurst'",
        "surface.hurst",
        "material.young",
        "material.poisson",
    ):
        assert part in message
    for part in ("closing", "joint.direction", "'Q'", "joint.blok", "did you mean 'block'"):
        assert part in message


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('generate = "fbm"', 'generate = "magic"', "magic"),
        ('generate = "fbm"', 'generate = "fbm"\nread = "x.npy"', "one of `read`"),
        ("[want]", "[wants]", "did you mean 'want'"),
        ("[material]", "[material]\nyong = 1.0", "did you mean 'young'"),
        ("young = 30e9", "", "material.young"),
        ("shear = [1e-4, 4e-4]", "shear = [-1e-4]", "joint.shear"),
        ("shear = [1e-4, 4e-4]", "shear = 'far'", "joint.shear"),
        ("[1e-4, 4e-4]", "{ start = 1.0, stop = 0.0, step = 0.1 }", "stop >= start"),
        ("[want]", "[want]\nfigures = 'yes'", "want.figures"),
        ("[want]", "[want]\ndimensions = ['guess']", "guess"),
        ("[want]", "[want]\ncontact = ['press']", "exactly one of closure"),
        ('["closure", "rigid_dilatancy"]', '["closure"]\nkeep = ["everything"]', "everything"),
        ("[1e-4, 4e-4]", "{ start = 0.0, stop = 4e-4 }", "joint.shear.step"),
        ("[1e-4, 4e-4]", "{ start = 0.0, stop = inf, step = 1e-4 }", "joint.shear.stop"),
        ("[1e-4, 4e-4]", "{ start = 0.0, stop = 4e-4, step = 1e-15 }", "10.6 entries"),
        ("[1e-4, 4e-4]", "[]", "empty"),
        ("[1.0, 10.0]", "[1.0, 10.0]\nnominal_pressure = [1e5]", "normal_force, nominal_pressure"),
        ('direction = "W"', 'direction = ["W", "E"]', "one direction for closure"),
        ('generate = "fbm"', "read = 3", "surface.read"),
    ],
)
def test_each_problem_is_named(write, old, new, word):
    assert old in SOUND
    with pytest.raises(InvalidInput, match=word):
        fc.scenes.load(write(SOUND.replace(old, new)))


def test_a_stage_with_a_row_for_each_direction_takes_several(write):
    scene = SOUND.replace('direction = "W"', 'direction = ["W", "E"]')
    scene = scene.replace('["closure", "rigid_dilatancy"]', '["decorrelation_length", "rigid_dilatancy"]')
    assert fc.scenes.load(write(scene)).table("joint")["direction"] == ["W", "E"]


def test_unreadable_scene_is_refused(write, tmp_path):
    with pytest.raises(UnreadableFile, match="not a TOML file"):
        fc.scenes.load(write("[surface"))
    with pytest.raises(UnreadableFile, match="concrete_crack"):
        fc.scenes.load(tmp_path / "none.toml")


@pytest.mark.parametrize(
    "name",
    [
        "concrete_crack",
        "concrete_crack_1998",
        "rigid_sliding",
        "jacksboro_fault",
        "freiberg_gneiss",
        "gneiss_datasheet",
    ],
)
def test_shipped_scenes_are_found_by_name_and_valid(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for way in (name, f"{name}.toml", f"datasets/{name}.toml"):
        assert len(fc.scenes.plan(fc.scenes.load(way)))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("block = 2.4e-3", "block = 1.0", ("block",)),
        ("shear = [1e-4, 4e-4]", "shear = [1e-4, 1.0]", ("shear",)),
        ("normal_force = [1.0, 10.0]", "", ("closure, normal_force or nominal_pressure",)),
        ("young = 30e9", "young = -1.0\nfoo = 2", ("material.young", "material.foo")),
        ("block = 2.4e-3", "block = 1.0\nblokk = 2", ("joint.blokk", "block: expected")),
        ("young = 30e9", "yuong = 30e9", ("material.yuong", "did you mean 'young'", "material.young")),
        ("hurst = 0.8", "hirst = 0.8", ("surface.hirst", "surface.hurst")),
        ('generate = "fbm"', 'read = "x.npy"\nspacng = 1', ("surface.spacng", "surface.shape")),
        ("shear = [1e-4, 4e-4]", 'shear = "1e-4"', ("joint.shear",)),
    ],
)
def test_command_refuses_with_code_2_and_writes_nothing(write, tmp_path, old, new, words):
    path = write(SOUND.replace(old, new))
    done = command_here("run", path, "-o", tmp_path / "out")
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "text",
    [
        ".".join(["a"] * 20_000) + " = 1\n",
        "[" + ".".join(["a"] * 20_000) + "]\n",
        "a = {" + " . ".join(["'a'"] * 20_000) + " = 1}\n",
        "a = " + "[" * 20_000 + "]" * 20_000,
        SOUND + "# a comment\n" * 100_000,
    ],
    ids=["key", "header", "inline table", "list", "large"],
)
def test_scene_that_takes_the_parser_minutes_is_refused(write, text):
    """Its time and memory grow with the square of the parts of a key: 38 s and 1.6 GB."""
    path, start = write(text), time.perf_counter()
    with pytest.raises(UnreadableFile, match="not a TOML file"):
        fc.scenes.load(path)
    assert time.perf_counter() - start < 5.0


def test_text_with_many_points_is_read(write):
    title = "e.g. this, " * 50 + "1.5, 2.5, " * 50 + "." * 100
    comment = "# " + "a.b" * 100
    scene = fc.scenes.load(write(SOUND.replace('title = "a small study"', f'title = "{title}"\n{comment}')))
    assert scene.tables["title"] == title


def test_incompressible_material_is_allowed(write):
    assert fc.scenes.validate(write(SOUND.replace("poisson = 0.2", "poisson = 0.5"))).material.poisson == 0.5
    with pytest.raises(InvalidInput, match=r"material.poisson: expected .* <= 0.5"):
        fc.scenes.load(write(SOUND.replace("poisson = 0.2", "poisson = 0.51")))


def test_two_materials_are_those_of_the_crack(write):
    text = SOUND.replace("young = 30e9", "young = [30e9, 60e9]").replace(
        "poisson = 0.2", "poisson = [0.2, 0.3]"
    )
    scene = fc.scenes.load(write(text))
    assert scene.material.young == [30e9, 60e9]
    tree = fc.scenes.run(scene)
    shear, force = [1e-4, 4e-4], [1.0, 10.0]
    face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    crack = fc.joints.Crack(face, young=(30e9, 60e9), poisson=(0.2, 0.3), block=2.4e-3)
    alone = fc.joints.closure(crack, shear=shear, normal_force=force, direction="W")
    found = tree["joints/closure"].to_dataset()
    np.testing.assert_allclose(found.closure.squeeze(), alone.closure.squeeze(), rtol=1e-6)
    with pytest.raises(InvalidInput, match=r"material.young: expected one value, or \[lower, upper\]"):
        fc.scenes.load(write(SOUND.replace("young = 30e9", "young = [1e9, 2e9, 3e9]")))


def test_rigid_faces_need_no_material(write):
    text = SOUND.replace("young = 30e9", "").replace("poisson = 0.2", "")
    rigid = text.replace('"closure"', '"delta_dimension"')
    assert fc.scenes.load(write(rigid)).material.young is None
    with pytest.raises(InvalidInput, match=r"material.young: expected a value"):
        fc.scenes.load(write(text))


def test_problems_of_the_valid_tables_are_listed_with_those_of_the_file(write):
    text = SOUND.replace("block = 2.4e-3", "block = 1.0\nblokk = 2")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.validate(write(text))
    assert [problem.partition(": expected")[0] for problem in caught.value.problems] == [
        "joint.blokk",
        "joint: block",
        "joint: block",
    ]


def test_problem_of_a_table_is_listed_once(write):
    text = SOUND.replace("hurst = 0.8", "hurst = 1.8\nhirst = 1").replace("young = 30e9", "young = -1.0")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.validate(write(text))
    listed = [problem.partition(": expected")[0] for problem in caught.value.problems]
    assert listed == ["surface.hirst", "material.young", "surface: hurst"]


@pytest.mark.parametrize("function", [fc.scenes.run, fc.scenes.validate])
def test_scene_of_a_wrong_type_is_refused(function):
    with pytest.raises(InvalidInput, match="scene: expected a Scene or the path of a TOML file"):
        function({"surface": {"generate": "fbm"}})
    with pytest.raises(InvalidInput, match="path: expected the path of a file"):
        fc.scenes.load({"surface": {}})


def test_unset_variable_and_missing_file_are_named(write, tmp_path):
    for name in ("${NO_SUCH_VARIABLE}/a.npy", "nothing.npy"):
        text = f"[surface]\nread = '{name}'\nspacing = 1e-4\n[want]\nsurfaces = ['describe']\n"
        done = command_here("run", write(text), "-o", tmp_path / "out")
        assert done.returncode == 2
        assert name.removeprefix("${").partition("}")[0] in done.stderr
        if "$" in name:
            assert "set the environment variable NO_SUCH_VARIABLE to the folder" in done.stderr


def test_plan_is_printed_and_nothing_runs(write, tmp_path):
    done = command("run", "--plan", write(SOUND), "-o", tmp_path / "out")
    assert done.returncode == 0
    assert "joints/closure" in done.stdout
    assert not (tmp_path / "out").exists()


def test_load_of_the_joint_may_be_a_closure(write):
    scene = fc.scenes.load(write(SOUND.replace("normal_force = [1.0, 10.0]", "closure = [1e-7, 1e-6]")))
    closure = fc.scenes.run(scene, progress=False)["joints/closure"]
    assert closure["closure"].values == pytest.approx([1e-7, 1e-6])  # prescribed: the same at both shears


def test_press_takes_its_modulus_from_the_material(write):
    text = SOUND[: SOUND.index("[joint]")] + "[contact]\nnormal_force = 1.0\n[want]\ncontact = ['press']\n"
    pressed = fc.scenes.run(fc.scenes.load(write(text)), progress=False)["contact"]
    assert float(pressed["contact_modulus"]) == pytest.approx(30e9 / (2 * (1 - 0.2**2)))


@pytest.mark.parametrize(
    ("word", "tables", "named"),
    [
        ("elimination", "", "joint.block: expected a value for elimination"),
        ("elimination", "[joint.elimination]\nblock = 1.2e-3\nclosure = 1e-6\nmethod = 'fast'", "method"),
        ("elimination", "[joint.elimination]\nblock = -1.0", "joint.elimination.block"),
        (
            "self_weight",
            "",
            "joint.self_weight.structure_size: expected(?s:.*)joint.self_weight.unit_weight: expected",
        ),
        ("self_weight", "[joint.self_weight]\nstructure_size = 0.0\nunit_weight = 1.0", "structure_size"),
        (
            "area_by_resolution",
            "[joint.area_by_resolution]\nclosure = 1e-6",
            "joint.area_by_resolution.closure",
        ),
        (
            "area_by_resolution",
            '[joint.area_by_resolution]\ndirection = ["E", "W"]',
            "one direction for area_by",
        ),
        (
            "area_by_resolution",
            "[joint.area_by_resolution]\nnominal_pressure = 1e6\nnormal_force = 1.0",
            "exactly one of",
        ),
    ],
)
def test_problems_of_the_stages_of_the_paper_are_named(write, word, tables, named):
    text = SOUND.replace("[want]", f"{tables}\n[want]").replace('"closure", "rigid_dilatancy"', f'"{word}"')
    with pytest.raises(InvalidInput, match=named):
        fc.scenes.load(write(text))


@pytest.mark.parametrize(
    ("word", "table", "named"),
    [
        ("elimination", "block = 1.0", "block: expected"),
        ("area_by_resolution", "factors = [1, 7]", "divisors of the 24 x 24 cells"),
        ("self_weight", "structure_size = [2.0, 1.0]\nunit_weight = 1.0", "ascending sizes"),
    ],
)
def test_problems_of_their_calls_are_found_before_anything_runs(write, word, table, named):
    text = SOUND.replace("[want]", f"[joint.{word}]\n{table}\n[want]")
    with pytest.raises(InvalidInput, match=named):
        fc.scenes.validate(write(text.replace('"closure", "rigid_dilatancy"', f'"{word}"')))


def test_scene_in_words():
    """One line for each table; long lists are shown by their ends; a notebook shows a table."""
    scene = fc.scenes.load("concrete_crack")
    lines = repr(scene).splitlines()
    assert lines[0] == "Scene 'concrete_crack'"
    assert "young = 3e+10" in next(line for line in lines if line.startswith("  material"))
    assert "shear = [0, 4e-05 ... 0.004] (101 values)" in repr(scene)
    assert "<td>yield" not in scene._repr_html_()
    assert scene._repr_html_().count("<tr>") == len(scene.tables)


FRAGMENTS = [
    (page.name, textwrap.dedent(block))
    for page in sorted((Path(__file__).resolve().parents[2] / "gallery").glob("*.rst"))
    for block in re.findall(r"\.\. code-block:: toml\n\n((?: +.*\n|\n)+)", page.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize(("page", "text"), FRAGMENTS)
def test_fragments_of_the_documentation_are_valid(write, page, text):
    """A fragment may lack tables; what it has is as the reader of scenes takes it."""
    assert len(FRAGMENTS) >= 2
    whole = text if "[want]" in text else f'{text}\n[want]\nsurfaces = ["height"]\n'
    scene = fc.scenes.load(write(whole))
    assert scene.tables


def test_a_sample_has_no_keys_of_a_file(tmp_path):
    """It has spacing and units of its own: they were accepted and not used."""
    scene = tmp_path / "sample.toml"
    scene.write_text(
        '[surface]\nsample = "concrete_crack"\nspacing = 1e-3\nlevel = 1\n[want]\ndimensions = ["default"]\n'
    )
    with pytest.raises(InvalidInput) as raised:
        fc.scenes.load(scene)
    assert [line.partition(":")[0] for line in raised.value.problems] == ["surface.spacing"]
    assert "belongs to" not in raised.value.problems[0]


def test_key_of_another_table_is_named_first(write):
    text = SOUND.replace("poisson = 0.2", "poisson = 0.2\nJRC = 10.0").replace("young = 30e9", "young = -1.0")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.load(write(text))
    first, second = caught.value.problems
    assert first.startswith("material.JRC: ")
    assert "an unknown key: 'roughness_coefficient' belongs to [joint." in first
    assert second.startswith("material.young: ")


def test_words_of_the_commands_are_understood(tmp_path):
    """Pressures with their unit, directions in words, and psd."""
    text = """
[surface]
generate = "fbm"
shape = [48, 48]
spacing = 2e-4
hurst = 0.8
rms_increment = 1e-6
[material]
young = ["30 GPa", "2e11"]
poisson = 0.2
hardness = "1.5GPa"
[joint]
shear = 0.0
direction = "west"
nominal_pressure = ["0.5 MPa", 2e6]
[want]
joints = ["closure"]
dimensions = ["psd"]
"""
    path = tmp_path / "words.toml"
    path.write_text(text)
    scene = fc.scenes.load(path)
    assert scene.material.young == [30e9, 2e11]
    assert scene.material.hardness == 1.5e9
    assert scene.table("joint")["direction"] == "W"
    assert scene.table("joint")["nominal_pressure"] == [0.5e6, 2e6]
    assert scene.want.dimensions == ("spectrum",)
    path.write_text(text.replace("30 GPa", "30 GN").replace("west", "left"))
    with pytest.raises(InvalidInput, match=r"(?s)young.*30 GN.*left"):
        fc.scenes.load(path)


@pytest.mark.parametrize("word", ["W", "west", "West"])
def test_directions_are_the_words_that_python_takes(tmp_path, word):
    (tmp_path / "study.toml").write_text(SOUND.replace('"W"', f'"{word}"'), encoding="utf-8")
    assert fc.scenes.load(tmp_path / "study.toml").tables["joint"]["direction"] == "W"
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=4e-6, rng=1)
    result = fc.joints.roughness_coefficient(face, direction=word, lag=5e-4)
    assert result["direction"].values.tolist() == ["W"]
