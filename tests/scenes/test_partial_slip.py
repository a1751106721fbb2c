"""The stages of partial slip in a scene: plan, missing input, resumption, report, figures, reproduction."""

import functools

import numpy as np
import pytest
import xarray as xr
from study import SOUND

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

STUDY = (
    SOUND[: SOUND.index("[want]")].replace("poisson = 0.2", "poisson = 0.2\nbasic_friction_angle = 35")
    + """
[joint.partial_slip]
normal_force = 10.0
tangential_force = [0.0, 4.0, -4.0]
[contact]
nominal_pressure = [1e5, 1e6, 1e7]
[contact.partial_slip]
nominal_pressure = 1e6
tangential_force = { start = 0.0, stop = 12.0, step = 4.0 }
method = "full"
[want]
contact = ["press", "partial_slip"]
joints = ["partial_slip"]
"""
)


def write(folder, text):
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slip")
    path = write(folder, STUDY + "figures = true\n")
    return fc.scenes.run(path, out=folder / "out", progress=False), folder


def test_plan_has_what_is_wanted(tmp_path):
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(write(tmp_path, STUDY)))]
    assert names == ["surfaces", "contact", "partial_slip", "joints/partial_slip"]
    only = STUDY.replace('contact = ["press", "partial_slip"]', 'contact = ["partial_slip"]')
    only = only.replace('joints = ["partial_slip"]', "")
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(write(tmp_path, only)))]
    assert names == ["surfaces", "partial_slip"]


def test_domains_are_those_of_the_load_path(tmp_path):
    text = STUDY.replace('contact = ["press", "partial_slip"]', 'contact = ["partial_slip"]')
    names = [
        stage.name
        for stage in fc.scenes.plan(fc.scenes.load(write(tmp_path, text + 'domains = ["lacunarity"]\n')))
    ]
    assert "joints/closure" in names
    assert "contact" not in names


def test_results_are_those_of_the_functions(study):
    tree = study[0]
    slipped, joint = (tree[name].to_dataset() for name in ("partial_slip", "joints/partial_slip"))
    surface = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    friction = np.tan(np.radians(35))
    alone = fc.contact.partial_slip(
        surface,
        contact_modulus=fc.contact.effective_modulus(30e9, 0.2),
        poisson=0.2,
        friction_coefficient=friction,
        nominal_pressure=1e6,
        tangential_force=[0, 4, 8, 12],
        method="full",
    )
    np.testing.assert_array_equal(slipped["tangential_displacement"], alone["tangential_displacement"])
    assert set(slipped.data_vars) == set(alone.data_vars)
    crack = fc.joints.Crack(surface, young=30e9, poisson=0.2, block=2.4e-3, basic_friction_angle=35)
    alone = fc.joints.partial_slip(
        crack, shear=[1e-4, 4e-4], direction="W", normal_force=10.0, tangential_force=[0, 4, -4]
    )
    np.testing.assert_array_equal(joint["shear_stiffness"], alone["shear_stiffness"])
    assert joint["slip_state"].dims == ("shear", "step", "y", "x")


def test_report_and_figures(study):
    tree, folder = study
    text = fc.scenes.summary(tree, verbose=True)
    assert "\npartial slip\nshear " in text
    assert "all slides at" in text
    assert "where nothing slips" in text
    names = {path.stem for path in (folder / "out").glob("*.png")}
    assert {"slip_loops", "slip_domains", "joint_slip_loops", "joint_slip_domains"} <= names
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "tangential" in page


@pytest.mark.parametrize("name", ["partial_slip", "joints/partial_slip"])
def test_group_is_made_again(study, name):
    stored = fc.open(study[1] / "out" / "result.nc")[name].to_dataset()
    again = fc.scenes.reproduce(stored)
    times = [key for key in again.data_vars if "run_time" in key]
    xr.testing.assert_equal(again.drop_vars(times), stored[list(again.data_vars)].drop_vars(times))


def test_finished_parts_are_kept(tmp_path, monkeypatch):
    """The shear that was finished before a failure is not computed again."""
    path, calls, original = write(tmp_path, STUDY), [], fc.joints.partial_slip

    @functools.wraps(original)
    def fails_at_second(*arguments, **options):
        calls.append(options["shear"])
        if len(calls) == 2:
            raise OSError("stopped")
        return original(*arguments, **options)

    monkeypatch.setattr(fc.joints, "partial_slip", fails_at_second)
    with pytest.raises(OSError, match="stopped"):
        fc.scenes.run(path, out=tmp_path / "out", progress=False)
    tree = fc.scenes.run(path, out=tmp_path / "out", progress=False)
    assert calls == [[1e-4], [4e-4], [4e-4]]
    assert tree["joints/partial_slip"].sizes["shear"] == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("tangential_force = [0.0, 4.0, -4.0]", "", "joint.partial_slip.tangential_force"),
        ("tangential_force = [0.0, 4.0, -4.0]", "tangential_force = 9.0", "where sliding begins"),
        ("tangential_force = { start", "tangential_farce = { start", "tangential_force"),
        ("basic_friction_angle = 35", "", "contact.partial_slip.friction_coefficient"),
        ("basic_friction_angle = 35", "hardness = 1e9", "material.hardness: expected no hardness"),
        ("[contact]", "[contact]\nhardness = 1e9", "contact.hardness: expected no hardness"),
        ("nominal_pressure = 1e6\n", "nominal_pressure = 1e6\nclosure = 1e-6\n", "exactly one of"),
        ("normal_force = 10.0", "", "the normal load is constant"),
        ('method = "full"', 'method = "fast"', "method"),
    ],
)
def test_bad_input(tmp_path, old, new, message):
    assert old in STUDY
    with pytest.raises(InvalidInput, match=message):
        fc.scenes.validate(write(tmp_path, STUDY.replace(old, new)))
