"""What is hardly meant is told, and the plan finds what is wrong with the faces."""

import warnings

import pytest
from study import SOUND, command

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, ScaleWarning
from fractalcontact.scenes import checking, given
from fractalcontact.scenes.checking import preflight

CHANGES = {
    "mean pressure": ("young = 30e9", "young = 30e3"),  # MPa taken for Pa
    "rms slope": ("rms_increment = 4e-6", "rms_increment = 4e-3"),  # mm taken for m
}


def written(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


@pytest.mark.parametrize("word", list(CHANGES))
def test_units_that_are_hardly_meant_are_told_before_anything_runs(tmp_path, word):
    scene = fc.scenes.load(
        written(tmp_path, SOUND.replace(*CHANGES[word]).replace("[1.0, 10.0]", "[1.0, 1e3]"))
    )
    with pytest.warns(ScaleWarning, match=word):
        preflight(scene)


def test_a_closure_deeper_than_the_block_is_told(tmp_path):
    text = SOUND.replace("young = 30e9", "young = 30e3").replace("[1.0, 10.0]", "[1.0, 1e3]")
    with pytest.warns(ScaleWarning) as told:
        fc.scenes.run(written(tmp_path, text), progress=False)
    assert any("is the modulus in Pa" in str(one.message) for one in told)


@pytest.mark.parametrize("name", ["concrete_crack", "rigid_sliding", "pressed_face"])
def test_sound_scenes_are_not_doubted(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        preflight(fc.scenes.load(name))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("hurst = 0.8", "hurst = 1.8", "hurst"),
        ("block = 2.4e-3", "block = 5.0", "block"),
        ("shear = [1e-4, 4e-4]", "shear = [1e-4, 4e-2]", "shear"),
        ("shape = [48, 48]", "shape = [1, 1]", "shape"),
    ],
)
def test_the_plan_finds_what_is_wrong_with_a_face(tmp_path, old, new, word):
    with pytest.raises(InvalidInput, match=word):
        preflight(fc.scenes.load(written(tmp_path, SOUND.replace(old, new))))


def test_the_command_says_so_and_plans_nothing(tmp_path):
    done = command("run", "--plan", written(tmp_path, SOUND.replace("block = 2.4e-3", "block = 5.0")))
    assert done.returncode == 2
    assert "block" in done.stderr
    assert not done.stdout


def test_a_large_face_is_not_made_to_be_checked(tmp_path, monkeypatch):
    monkeypatch.setattr(given, "LARGE", 1000)
    monkeypatch.setattr(checking, "read_surface", None)
    preflight(fc.scenes.load(written(tmp_path, SOUND)))
    with pytest.raises(InvalidInput, match="block"):
        preflight(fc.scenes.load(written(tmp_path, SOUND.replace("block = 2.4e-3", "block = 5.0"))))
