"""The folder of a study: files of others are never touched, results of another study stay."""

import hashlib
import tomllib

import numpy as np
import pytest
from PIL import Image
from study import SOUND, command_here

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

RIGID = SOUND.replace(
    'joints = ["closure", "rigid_dilatancy"]', 'joints = ["rigid_dilatancy"]\nfigures = true'
)


def digests(folder):
    return {
        path.name: hashlib.sha256(path.read_bytes()).digest() for path in folder.iterdir() if path.is_file()
    }


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(RIGID, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "name", ["result.nc", "partial.nc", "report.html", "datasheet.pdf", "mine.png", "tables"]
)
def test_files_of_others_are_not_touched(scene, tmp_path, name):
    out = tmp_path / "out"
    out.mkdir()
    if name == "tables":
        (out / name).mkdir()
    elif name == "mine.png":
        Image.new("RGB", (4, 4)).save(out / name)
    else:
        (out / name).write_text("mine")
    before = digests(out)
    with pytest.raises(InvalidInput, match=rf"--force.*{name}"):
        fc.scenes.run(scene, out=out, progress=False)
    assert digests(out) == before
    assert len(list(out.iterdir())) == 1
    if name != "tables":
        fc.scenes.run(scene, out=out, progress=False, force=True)
        assert (out / "result.nc").is_file()


def test_folder_with_other_files_is_used(scene, tmp_path):
    """A name that no study writes is no obstacle: the scan lies beside its results."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    fc.scenes.run(scene, out=out, progress=False)
    assert (out / "notes.txt").read_text() == "mine"


def test_result_of_another_study_is_refused(scene, tmp_path):
    out = tmp_path / "out"
    fc.scenes.run(scene, out=out, progress=False)
    before = digests(out)
    scene.write_text(RIGID.replace("a small study", "another one"), encoding="utf-8")
    done = command_here("run", scene, "-o", out)
    assert done.returncode == 2
    assert "results of another study" in done.stderr
    assert "a small study" in done.stderr
    assert digests(out) == before
    assert command_here("run", scene, "-o", out, "--force", "--quiet").returncode == 0
    assert fc.open(out / "result.nc").attrs["title"] == "another one"


def test_same_study_runs_again_without_its_old_figures(scene, tmp_path):
    out = tmp_path / "out"
    with_map = RIGID.replace('["rigid_dilatancy"]', '["rigid_dilatancy", "delta_dimension"]')
    scene.write_text(with_map, encoding="utf-8")
    fc.scenes.run(scene, out=out, progress=False)
    assert (out / "delta_dimension.png").is_file()
    scene.write_text(RIGID.replace("young = 30e9", "young = 20e9"), encoding="utf-8")
    fc.scenes.run(scene, out=out, progress=False)
    assert not (out / "delta_dimension.png").exists()
    assert list(out.glob("*.png"))


def test_report_overwrites_nothing_but_a_report(scene, tmp_path):
    out = tmp_path / "out"
    fc.scenes.run(scene, out=out, progress=False)
    before = (out / "result.nc").read_bytes()
    (tmp_path / "good.csv").write_text("1,2")
    for target in (out / "result.nc", tmp_path / "good.csv"):
        done = command_here("report", out / "result.nc", "-o", target)
        assert done.returncode == 2
        assert "a report of this package" in done.stderr
    assert (out / "result.nc").read_bytes() == before
    assert (tmp_path / "good.csv").read_text() == "1,2"
    assert command_here("report", out / "result.nc").returncode == 0


def test_refused_commands_leave_no_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    good = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=1e-5, rng=3)
    fc.save(good, "good.nc")
    (tmp_path / "bad.nc").write_bytes((tmp_path / "good.nc").read_bytes()[:2000])
    np.save("stack.npy", np.zeros((3, 8, 8)))
    fc.save(good * np.nan, "nothing.nc")
    before = {path.name for path in tmp_path.iterdir()}
    for words in (
        ("joint", "good.nc", "bad.nc", "--young", "3e10"),
        ("joint", "good.nc", "good.nc", "--young", "3e10", "--as-scanned", "--poisson", "0.9"),
        ("roughness", "stack.npy", "--spacing", "1e-4"),
        ("contact", "nothing.nc", "--young", "3e10"),
        ("roughness", "nothing.nc"),
        ("contact", "good.nc", "--young", "-3"),
    ):
        done = command_here(*words)
        assert done.returncode == 2, (words, done.stderr)
        assert "RuntimeWarning" not in done.stderr, words
        assert {path.name for path in tmp_path.iterdir()} == before, words


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("upper.nc", "lower.nc", "--as-scanned"), "swap"),
        (("upper.nc", "lower.nc"), "swap"),
        (("lower.nc", "plane.nc"), "nothing that fixes the position"),
        (("lower.nc", "upper.nc", "--turn-upper", "x"), "it fits without turn_upper"),
        (("lower.nc", "holes.nc"), "upper inside the block"),
    ],
)
def test_refused_faces_leave_nothing(tmp_path, monkeypatch, words, reason):
    """Both faces are placed and checked before a part of the study is kept, in a new folder or an old one."""
    monkeypatch.chdir(tmp_path)
    lower = fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=1e-5, rng=3)
    holes = lower + 1e-3
    holes[20:23, 20:23] = np.nan
    for name, face in (("lower", lower), ("upper", lower + 1e-3), ("plane", 0 * lower), ("holes", holes)):
        fc.save(face, f"{name}.nc")
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "notes.txt").write_text("mine")
    for out in ("new", "old"):
        done = command_here("joint", *words, "--young", "3e10", "-o", out)
        assert done.returncode == 2, done.stdout
        assert reason in done.stderr
    assert not (tmp_path / "new").exists()
    assert [path.name for path in (tmp_path / "old").iterdir()] == ["notes.txt"]


def test_refused_question_writes_no_scene_into_a_folder_of_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fc.save(fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=1e-5, rng=3), "good.nc")
    folder = tmp_path / "theirs"
    folder.mkdir()
    (folder / "report.html").write_text("<html>mine</html>")
    done = command_here("roughness", "good.nc", "-o", "theirs")
    assert done.returncode == 2
    assert [path.name for path in folder.iterdir()] == ["report.html"]


def test_files_of_others_among_the_kept_parts_stay(scene, tmp_path):
    kept = tmp_path / "out" / ".stages"
    kept.mkdir(parents=True)
    (kept / "notes.txt").write_text("mine")
    fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert [path.name for path in kept.iterdir()] == ["notes.txt"]


def test_edited_scene_of_a_question_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fc.save(fc.surfaces.fbm((48, 48), 2e-4, hurst=0.7, rms_increment=1e-5, rng=3), "scan.nc")
    question = ("roughness", "scan.nc", "-o", "out", "--quiet")
    assert command_here(*question).returncode == 0
    assert command_here(*question, "--level", "0").returncode == 0  # its own, unedited scene
    path = tmp_path / "out" / "roughness.toml"
    assert tomllib.loads(path.read_text())["surface"]["level"] == 0
    edited = path.read_text() + "# mine\n"
    path.write_text(edited)
    done = command_here(*question)
    assert done.returncode == 2
    assert "fractalcontact run" in done.stderr
    assert path.read_text() == edited
    assert command_here(*question, "--force").returncode == 0


def test_run_without_a_folder_takes_the_name_of_the_scene(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = command_here("run", "study.toml")
    assert done.returncode == 0
    assert (tmp_path / "study" / "result.nc").is_file()
    assert len(done.stdout.splitlines()) <= 40
    assert "next: open" in done.stdout.splitlines()[-1]
    whole = command_here("run", "study.toml", "--verbose").stdout
    assert "joints/rigid_dilatancy" in whole  # the stages with their times
    assert "joints/rigid_dilatancy" not in done.stdout
