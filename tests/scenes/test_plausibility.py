"""Values that suggest a unit mistake are reported, and a plan finds the problems of the surfaces."""

import inspect
import warnings

import pytest
from study import SOUND, command_here

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, ScaleWarning

CHANGES = {
    "mean pressure": ("young = 30e9", "young = 30e3"),  # MPa taken for Pa
    "rms slope": ("rms_increment = 4e-6", "rms_increment = 4e-3"),  # mm taken for m
}


def written(tmp_path, text):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study.toml"


@pytest.mark.parametrize("word", list(CHANGES))
def test_implausible_units_warn_before_anything_runs(tmp_path, word):
    scene = fc.scenes.load(
        written(tmp_path, SOUND.replace(*CHANGES[word]).replace("[1.0, 10.0]", "[1.0, 1e3]"))
    )
    with pytest.warns(ScaleWarning, match=word):
        fc.scenes.validate(scene)


def test_closure_deeper_than_the_block_warns(tmp_path):
    text = SOUND.replace("young = 30e9", "young = 30e3").replace("[1.0, 10.0]", "[1.0, 1e3]")
    with pytest.warns(ScaleWarning) as caught:
        fc.scenes.run(written(tmp_path, text), progress=False)
    assert any("is the modulus in Pa" in str(warning.message) for warning in caught)


@pytest.mark.parametrize("name", ["concrete_crack", "rigid_sliding", "pressed_surface"])
def test_plausible_scenes_do_not_warn(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fc.scenes.validate(fc.scenes.load(name))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("hurst = 0.8", "hurst = 1.8", "hurst"),
        ("block = 2.4e-3", "block = 5.0", "block"),
        ("shear = [1e-4, 4e-4]", "shear = [1e-4, 4e-2]", "shear"),
        ("shape = [48, 48]", "shape = [1, 1]", "shape"),
    ],
)
def test_validation_finds_the_problems_of_a_surface(tmp_path, old, new, word):
    with pytest.raises(InvalidInput, match=word):
        fc.scenes.validate(fc.scenes.load(written(tmp_path, SOUND.replace(old, new))))


def test_command_reports_problems_and_prints_no_plan(tmp_path):
    done = command_here("run", "--plan", written(tmp_path, SOUND.replace("block = 2.4e-3", "block = 5.0")))
    assert done.returncode == 2
    assert "block" in done.stderr
    assert not done.stdout


def test_large_surface_is_not_generated_for_validation(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise AssertionError("the surface is generated")

    fail.validate = fc.surfaces.fbm.validate
    fail.__signature__ = inspect.signature(fc.surfaces.fbm)
    monkeypatch.setattr(fc.surfaces, "fbm", fail)
    large = SOUND.replace("shape = [48, 48]", "shape = [512, 512]")
    fc.scenes.validate(fc.scenes.load(written(tmp_path, large)))
    with pytest.raises(InvalidInput, match="block"):
        fc.scenes.validate(fc.scenes.load(written(tmp_path, large.replace("block = 2.4e-3", "block = 5.0"))))
    with pytest.raises(InvalidInput, match="hurst"):
        fc.scenes.validate(fc.scenes.load(written(tmp_path, large.replace("hurst = 0.8", "hurst = 1.8"))))
