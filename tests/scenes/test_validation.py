"""Scenes as users write them: other editors, spelling mistakes, values that a late stage refuses."""

import os
import re
import subprocess
import sys

import pytest
from study import SOUND, command, command_here, watch_calls

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.cli import main


@pytest.mark.parametrize(
    ("encoding", "newline"), [("utf-8-sig", "\r\n"), ("utf-8-sig", "\n"), ("utf-8", "\r\n")]
)
def test_scene_with_other_line_ends_is_read(tmp_path, encoding, newline):
    (tmp_path / "study.toml").write_text(SOUND, encoding=encoding, newline=newline)
    (tmp_path / "plain.toml").write_text(SOUND, encoding="utf-8")
    ours, theirs = (fc.scenes.load(tmp_path / f"{name}.toml") for name in ("plain", "study"))
    assert ours.tables == theirs.tables


@pytest.mark.parametrize(
    ("old", "new", "suggestion"),
    [
        ("rigid_dilatancy", "rigid_dilatency", "'rigid_dilatancy'"),
        ('"fbm"', '"fmb"', "'fbm'"),
        ("young", "yuong", "'young'"),
        ("[material]", "[materials]", "'material'"),
    ],
)
def test_misspelt_word_gets_a_suggestion(tmp_path, old, new, suggestion):
    (tmp_path / "study.toml").write_text(SOUND.replace(old, new), encoding="utf-8")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.load(tmp_path / "study.toml")
    assert f"did you mean {suggestion}?" in str(caught.value)


def test_values_in_place_of_tables_are_listed_at_once(tmp_path):
    (tmp_path / "study.toml").write_text("surface = 3\njoint = [1]\nmaterial = 'x'\nwant = 4\n")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.load(tmp_path / "study.toml")
    assert {line.partition(":")[0] for line in caught.value.problems} >= {
        "surface",
        "joint",
        "material",
        "want",
    }


def test_folder_of_another_run_is_refused(tmp_path):
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
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "result.nc"]


def test_invalid_client_is_refused():
    with pytest.raises(InvalidInput, match="client: expected a distributed.Client"):
        fc.scenes.run("pressed_surface", progress=False, client="tcp://there")


def test_accuracy_refuses_an_unwritable_folder_first(tmp_path):
    (tmp_path / "out").write_text("a file")
    done = command_here("accuracy", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "expected a folder" in done.stderr


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        (("contact", "--hurst", "0.5", "--seed", "3"), ["--hurst", "--seed"]),
        (("--members", "8"), ["--members"]),
        (("estimators", "--budget", "3"), ["--budget"]),
    ],
)
def test_accuracy_refuses_options_without_effect(words, refused, capsys):
    assert main(["accuracy", *words]) == 2
    assert re.findall(r"- (--\w+): expected no value", capsys.readouterr().err) == refused


def test_command_reports_file_size_and_peak_memory(tmp_path):
    (tmp_path / "study.toml").write_text(SOUND.replace('"closure", ', ""), encoding="utf-8")
    last = command("run", tmp_path / "study.toml", "-o", tmp_path / "out").stdout.splitlines()[-2]
    size = (tmp_path / "out" / "result.nc").stat().st_size
    printed = re.search(r"result\.nc \((\S+) MB\), report\.html; peak memory (\d+) MB", last)
    assert printed, last
    assert float(printed[1]) == pytest.approx(size / 1e6, rel=0.1)
    assert 50 < int(printed[2]) < 1000


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[joint.decorrelation_length]\nshear = [1e-4, 2e-4]", "joints/decorrelation_length: shear"),
        ("[joint.transmissivity]\naxis = 'z'", "joints/transmissivity: axis"),
        ("[joint.transmissivity]\nperiodic = true", "joints/transmissivity: periodic"),
        ("[joint.closure]\nmethod = 'magic'", "joints/closure: method"),
        ("[joint.elastic_dilatancy]\ntolerance = [0.1, 0.2]", "joint.elastic_dilatancy.tolerance"),
        ("[joint.closure]\nshear = { a = 1 }", "joint.closure.shear"),
        ("[domains.lacunarity]\nbox_sizes = [0]", "domains/lacunarity: box_sizes"),
        ("[domains.box_dimension]\ncover = 'cheap'", "domains/box_dimension: cover"),
        ("[domains.evolution]\ninclude = ['x']", "domains/evolution: include"),
        ("[dimensions]\nscales = [3.0, 1.0]", "dimensions: scales"),
        ("[dimensions]\nmethods = ['spectrum']", "dimensions.methods"),
    ],
)
def test_values_refused_by_a_late_stage_are_reported_first(tmp_path, monkeypatch, table, message):
    want_table = """[want]
joints = ["closure", "elastic_dilatancy", "decorrelation_length", "transmissivity"]
domains = ["lacunarity", "box_dimension", "evolution"]
dimensions = ["default"]
"""
    shears = "shear = [0.0, 1e-4, 4e-4]"
    scene = SOUND.partition("[want]")[0].replace("shear = [1e-4, 4e-4]", shears)
    computed = []
    watch_calls(monkeypatch, computed.append)
    (tmp_path / "study.toml").write_text(f"{scene}\n{table}\n{want_table}", encoding="utf-8")
    with pytest.raises(InvalidInput, match=message):
        fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()
    assert computed == []


@pytest.mark.parametrize("members", ['"x"', "[]", "0", "2.5"])
def test_members_must_be_a_positive_integer(tmp_path, members):
    text = SOUND.replace("rng = 5", f"rng = 5\nmembers = {members}")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match="surface.members"):
        fc.scenes.load(tmp_path / "study.toml")


@pytest.mark.parametrize("shape", ['"x"', "[]", '[1, "a"]', "nan", "[3, 2, 1]", "1e300"])
def test_invalid_shape_is_refused(tmp_path, shape):
    (tmp_path / "study.toml").write_text(SOUND.replace("[48, 48]", shape), encoding="utf-8")
    with pytest.raises(InvalidInput, match="shape"):
        fc.scenes.run(tmp_path / "study.toml", progress=False)


PLAN = """
import sys
import fractalcontact as fc
from fractalcontact.base.process import peak_memory

for scene in sys.argv[1:]:
    print(len(fc.scenes.plan(fc.scenes.validate(scene))), peak_memory())
"""


def test_plan_of_a_large_surface_takes_little_memory(tmp_path):
    """A surface of 2 GiB is not made for the plan, nor anything of its size; that took 7 GB."""
    scene = SOUND.replace("[48, 48]", "[16384, 16384]").replace('"fbm"', '"spectral"')
    scene = scene.replace("rms_increment", "rms_height").replace("block = 2.4e-3", "block = 0.8192")
    want = 'dimensions = ["variogram"]\ndomains = ["islands", "lacunarity"]\n'
    load = "contact_modulus = 1e9\nnominal_pressure = [1e5, 1e6]"
    pressed = scene.partition("[joint]")[0] + f'[contact]\n{load}\n[want]\ncontact = ["press"]\n{want}'
    joint = scene.replace('"rigid_dilatancy"', '"rigid_dilatancy", "transmissivity"') + want
    paths = [tmp_path / "pressed.toml", tmp_path / "joint.toml"]
    for path, text in zip(paths, (pressed, joint), strict=True):
        path.write_text(text, encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", PLAN, *paths], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for line in done.stdout.splitlines():
        stages, peak = map(int, line.split())
        assert stages > 4
        assert peak < 600e6
    assert len(done.stdout.splitlines()) == 2
