"""What a stranger does to a scene and its folder: other editors, slips of the pen, two runs at once."""

import os
import re

import pytest
from study import SOUND, command

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


@pytest.mark.parametrize(
    ("encoding", "newline"), [("utf-8-sig", "\r\n"), ("utf-8-sig", "\n"), ("utf-8", "\r\n")]
)
def test_scenes_of_other_editors_are_read(tmp_path, encoding, newline):
    (tmp_path / "study.toml").write_text(SOUND, encoding=encoding, newline=newline)
    (tmp_path / "plain.toml").write_text(SOUND, encoding="utf-8")
    ours, theirs = (fc.scenes.load(tmp_path / f"{name}.toml") for name in ("plain", "study"))
    assert ours.tables == theirs.tables


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ("rigid_dilatancy", "rigid_dilatency", "'rigid_dilatancy'"),
        ('"fbm"', '"fmb"', "'fbm'"),
        ("young", "yuong", "'young'"),
        ("[material]", "[materials]", "'material'"),
    ],
)
def test_a_slip_of_the_pen_is_met_with_the_word_that_was_meant(tmp_path, old, new, meant):
    (tmp_path / "study.toml").write_text(SOUND.replace(old, new), encoding="utf-8")
    with pytest.raises(InvalidInput) as told:
        fc.scenes.load(tmp_path / "study.toml")
    assert f"did you mean {meant}?" in str(told.value)


def test_all_that_should_be_tables_are_named_at_once(tmp_path):
    (tmp_path / "study.toml").write_text("surface = 3\njoint = [1]\nmaterial = 'x'\nwant = 4\n")
    with pytest.raises(InvalidInput) as told:
        fc.scenes.load(tmp_path / "study.toml")
    assert {line.partition(":")[0] for line in told.value.problems} >= {
        "surface",
        "joint",
        "material",
        "want",
    }


def test_a_folder_in_which_another_run_writes_is_refused(tmp_path):
    fcntl = pytest.importorskip("fcntl")  # of Unix alone
    (tmp_path / "study.toml").write_text(SOUND, encoding="utf-8")
    scene, out = fc.scenes.load(tmp_path / "study.toml"), tmp_path / "out"
    out.mkdir()
    other = os.open(out, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    with pytest.raises(InvalidInput, match="another run"):
        fc.scenes.run(scene, out=out, progress=False)
    assert not list(out.iterdir())
    os.close(other)
    fc.scenes.run(scene, out=out, progress=False)
    assert [path.name for path in out.iterdir()] == ["result.nc"]


def test_what_is_no_client_is_refused():
    with pytest.raises(InvalidInput, match="client: expected a distributed.Client"):
        fc.scenes.run("pressed_face", progress=False, client="tcp://there")


def test_what_cannot_be_written_is_told_before_it_is_measured(tmp_path):
    (tmp_path / "out").write_text("a file")
    done = command("accuracy", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "expected a folder" in done.stderr


def test_the_command_tells_what_it_wrote_and_held(tmp_path):
    (tmp_path / "study.toml").write_text(SOUND.replace('"closure", ', ""), encoding="utf-8")
    last = command("run", tmp_path / "study.toml", "-o", tmp_path / "out").stdout.splitlines()[-1]
    size = (tmp_path / "out" / "result.nc").stat().st_size
    told = re.search(r"result\.nc \((\S+) MB\); at most (\d+) MB of memory", last)
    assert told, last
    assert float(told[1]) == pytest.approx(size / 1e6, rel=0.1)
    assert 50 < int(told[2]) < 1000


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("[joint.decorrelation_length]\nshear = [1e-4, 2e-4]", "joints/decorrelation_length: shear"),
        ("[joint.transmissivity]\naxis = 'z'", "joints/transmissivity: axis"),
        ("[joint.transmissivity]\nperiodic = true", "joints/transmissivity: periodic"),
        ("[joint.closure]\nmethod = 'magic'", "joints/closure: method"),
        ("[joint.elastic_dilatancy]\ntolerance = [0.1, 0.2]", "joint.elastic_dilatancy.tolerance"),
        ("[joint.closure]\nshear = { a = 1 }", "joint.closure.shear"),
        ("[domains.lacunarity]\nbox_sizes = [0]", "domains/lacunarity: box_sizes"),
        ("[domains.box_dimension]\ncover = 'cheap'", "domains/box_dimension: cover"),
        ("[domains.evolution]\nwant = ['x']", "domains/evolution: want"),
        ("[dimensions]\nscales = [3.0, 1.0]", "dimensions: scales"),
        ("[dimensions]\nmethods = ['spectrum']", "dimensions.methods"),
    ],
)
def test_what_a_late_stage_would_refuse_is_told_before_the_first_one_runs(tmp_path, monkeypatch, table, told):
    from fractalcontact.scenes import stages

    wanted = """[want]
joints = ["closure", "elastic_dilatancy", "decorrelation_length", "transmissivity"]
domains = ["lacunarity", "box_dimension", "evolution"]
dimensions = ["default"]
"""
    shears = "shear = [0.0, 1e-4, 4e-4]"
    scene = SOUND.partition("[want]")[0].replace("shear = [1e-4, 4e-4]", shears)
    monkeypatch.setattr(stages, "_call", None)
    (tmp_path / "study.toml").write_text(f"{scene}\n{table}\n{wanted}", encoding="utf-8")
    with pytest.raises(InvalidInput, match=told):
        fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("members", ['"x"', "[]", "0", "2.5"])
def test_members_are_a_whole_number(tmp_path, members):
    text = SOUND.replace("rng = 5", f"rng = 5\nmembers = {members}")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match="surface.members"):
        fc.scenes.load(tmp_path / "study.toml")


@pytest.mark.parametrize("shape", ['"x"', "[]", '[1, "a"]', "nan", "[3, 2, 1]", "1e300"])
def test_a_wrong_shape_is_refused_in_words(tmp_path, shape):
    (tmp_path / "study.toml").write_text(SOUND.replace("[48, 48]", shape), encoding="utf-8")
    with pytest.raises(InvalidInput, match="shape"):
        fc.scenes.run(tmp_path / "study.toml", progress=False)
