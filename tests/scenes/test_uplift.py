"""The stage of the uplift: plan, checks, summary, resume, figures and reproduction."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning

SCENE = """
[surface]
generate = "fbm"
shape = [40, 40]
spacing = 2e-4
hurst = 0.8
rms_increment = 3e-5
rng = 3
[material]
young = 3e10
poisson = 0.2
[joint]
block = 4.8e-3
shear = [2e-4, 6e-4]
[joint.closure]
nominal_pressure = [1e6, 2e6, 4e6]
[joint.uplift]
upstream_pressure = 5e5
drains = [[3e-3, 2e-3]]
[want]
joints = ["uplift"]
figures = true
"""
BALANCED = SCENE.replace("[joint.uplift]", "[joint.uplift]\ntotal_stress = 1.5e6")


@pytest.fixture
def scene(tmp_path):
    def write(text=SCENE):
        path = tmp_path / "dam.toml"
        path.write_text(text)
        return path

    return write


def by_hand(tree, **options):
    crack = fc.joints.Crack(tree["surfaces/height"], young=3e10, poisson=0.2, block=4.8e-3)
    gap = fc.joints.closure(crack, shear=[2e-4, 6e-4], nominal_pressure=[1e6, 2e6, 4e6], keep="gap").gap
    return fc.joints.uplift(gap, upstream_pressure=5e5, drains=[[3e-3, 2e-3]], **options)


@pytest.mark.parametrize(("text", "options"), [(SCENE, {}), (BALANCED, {"total_stress": 1.5e6})])
def test_results_are_those_of_the_function(scene, tmp_path, text, options):
    path = scene(text)
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(path))]
    assert names == ["surfaces", "joints/delta_surface", "joints/closure", "joints/uplift", "figures"]
    tree = fc.scenes.run(path, out=tmp_path / "out", progress=False)
    stored, direct = tree["joints/uplift"], by_hand(tree, **options)
    for name in ("fluid_pressure", "uplift_force", "uplift_arm", "uplift_profile"):
        np.testing.assert_allclose(stored[name], direct[name], rtol=1e-12)
    assert ("effective_stress" in stored) == bool(options)
    assert "gap" not in tree["joints/closure"]
    assert (tmp_path / "out" / "uplift.png").is_file()
    again = fc.scenes.reproduce(stored.to_dataset())
    np.testing.assert_allclose(again.uplift_force, stored.uplift_force, rtol=1e-12)


def test_summary_says_whether_the_diagrams_are_safe(scene, tmp_path):
    tree = fc.scenes.run(scene(BALANCED), progress=False)
    text = " ".join(fc.scenes.summary(tree, verbose=True).split())
    assert "at shear 0.6 mm: the linear diagram is" in text
    forces = tree["joints/uplift/uplift_force"].sel(shear=6e-4)
    less = 1 - float(forces.sel(diagram="joint") / forces.sel(diagram="bilinear"))
    way = "on the safe side" if less > 0 else "NOT on the safe side"
    assert f"the bilinear diagram is {way}: the joint has {abs(100 * less):.1f} %" in text
    changed = tree.copy(deep=True)
    changed["joints/uplift/uplift_force"].loc[{"diagram": "joint"}] *= 10
    text = " ".join(fc.scenes.summary(changed, verbose=True).split())
    assert text.count("is NOT on the safe side") == 4
    assert "% more uplift" in text
    factor = changed["joints/uplift/uplift_force"].max("shear")
    more = 100 * (float((factor.sel(diagram="joint") / factor.drop_sel(diagram="joint")).max()) - 1)
    assert "NOT on the safe side" in fc.scenes.summary(changed)
    assert more > 100
    assert "NOT on the safe side" not in fc.scenes.summary(tree) or less < 0


def test_joint_without_uplift_has_no_line_of_action(scene):
    tree = fc.scenes.run(scene(BALANCED.replace("shear = [2e-4, 6e-4]", "shear = [0.0]")), progress=False)
    text = " ".join(fc.scenes.summary(tree, verbose=True).split())
    assert "the joint has 100.0 % less uplift" in text
    assert "which acts" not in text


@pytest.mark.parametrize(
    ("total", "message"), [("3e7", "ends before the effective stress"), ("1.05e6", "it lifts the joint")]
)
def test_a_balance_that_fails_is_reported(scene, total, message):
    path = scene(BALANCED.replace("1.5e6", total))
    with pytest.warns(ConvergenceWarning):
        tree = fc.scenes.run(path, progress=False)
    assert not tree["joints/uplift/converged"].all()
    text = " ".join(fc.scenes.summary(tree, verbose=True).split())
    assert message in text
    assert "no effective stress on the path of the closure balances" in text
    assert "joints/uplift" in text[text.index("achieved") :]
    assert "not converged" in text[text.index("achieved") :]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("upstream_pressure = 5e5", "", "joint.uplift.upstream_pressure: expected a value for uplift"),
        ("upstream_pressure = 5e5", "upstream_presure = 5e5", "did you mean 'upstream_pressure'"),
        ("[[3e-3, 2e-3]]", "[[3e-1, 2e-3]]", "inside the plane"),
        ("[[3e-3, 2e-3]]", "[[3e-3, 2e-3]]\nupstream = 'WE'", "upstream: expected 'W'"),
        ("[[3e-3, 2e-3]]", "[[3e-3, 2e-3]]\nupstream = ['x', 1.0]", "a line inside the plane"),
        ("[[3e-3, 2e-3]]", "[[3e-3, 2e-3]]\nnormal_stiffness = 1.0", "normal_stiffness"),
    ],
)
def test_mistakes_are_reported_before_anything_runs(scene, old, new, message):
    assert old in SCENE
    with pytest.raises(ValueError, match=message):
        fc.scenes.validate(scene(SCENE.replace(old, new, 1)))


def test_a_falling_load_path_has_no_balance(scene):
    with pytest.raises(ValueError, match="whose nominal_pressure rises"):
        fc.scenes.validate(scene(BALANCED.replace("[1e6, 2e6, 4e6]", "[1e6, 4e6, 2e6]")))


def test_lines_inside_the_block_are_lines_of_its_coordinates(scene):
    """The block of 4.8 mm lies in the middle of the face of 8 mm: its x runs from 1.6 to 6.4 mm."""
    fc.scenes.validate(scene(SCENE.replace("drains", "upstream = ['x', 2e-3]\ndrains")))
    with pytest.raises(ValueError, match="a line inside the plane"):
        fc.scenes.validate(scene(SCENE.replace("drains", "upstream = ['x', 1e-3]\ndrains")))


def test_a_stopped_study_resumes_after_the_uplift(scene, tmp_path, monkeypatch):
    path, out = scene(SCENE), tmp_path / "out"
    whole = fc.scenes.run(path, progress=False)
    monkeypatch.setattr(fc.plotting, "draw", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        fc.scenes.run(path, out=out, progress=False)
    monkeypatch.undo()
    tree = fc.scenes.run(path, out=out, progress=False)
    stages = json.loads(tree.attrs["provenance"])["stages"]
    assert stages["joints/uplift"]["origin"] == "kept from an earlier run"
    np.testing.assert_array_equal(tree["joints/uplift/uplift_force"], whole["joints/uplift/uplift_force"])


def test_the_profile_is_among_the_tables(scene):
    tables = fc.scenes.tables(fc.scenes.run(scene(), progress=False))
    profile = tables["joints_uplift_by_shear_step_diagram_x"]
    assert len(profile) == 2 * 3 * 3 * 24
    assert "uplift_profile (Pa)" in profile


def test_the_summary_has_the_uplift_of_all_diagrams(scene):
    text = fc.scenes.summary(fc.scenes.run(scene(), progress=False), verbose=True)
    for diagram in ("bilinear", "linear"):
        assert f"of the {diagram} diagram" in text
