"""Stages of the strength of a joint: plan, checks, resume, figures and reproduction."""

import re

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

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
basic_friction_angle = 31.0
hardness = 3e8
[joint]
block = 4.8e-3
nominal_pressure = [2e6, 2e7]
[joint.direct_shear]
path = [6e-4, 0.0]
[joint.shear_curve]
displacement = { start = 0.0, stop = 1e-3, step = 2.5e-4 }
wall_strength = 1e8
[joint.strength_envelope]
wall_strength = 1e8
cohesion = 1e6
[want]
joints = ["direct_shear", "shear_curve", "strength_envelope"]
figures = true
"""


@pytest.fixture
def scene(tmp_path):
    def write(text=SCENE):
        path = tmp_path / "joint.toml"
        path.write_text(text)
        return path

    return write


TABLES = {
    name: table.get("anyOf", [table])[-1].get("properties", {})
    for name, table in fc.scenes.json_schema()["properties"]["joint"]["properties"].items()
}
IN_PASCALS = [
    (stage, key)
    for stage, keys in TABLES.items()
    for key, kind in keys.items()
    if key not in ("closure", "normal_force") and re.search(r"\bPa\b(?!/| s)", kind.get("description", ""))
]


@pytest.mark.parametrize(("stage", "key"), IN_PASCALS)
def test_every_argument_in_pascals_may_have_its_unit(scene, stage, key):
    """As the docstring states it: `PRESSURES` of `scenes/_scene_keys.py` has a word for each."""
    start = SCENE.partition("[joint.")[0]
    texts = (
        f"{start}[joint.{stage}]\n{key} = {value}\n[want]\nsurfaces = ['describe']"
        for value in ("2e6", "'2 MPa'")
    )
    arguments = [fc.scenes.load(scene(text)).tables["joint"][stage] for text in texts]
    assert arguments[0] == arguments[1]


def test_criteria_of_an_ensemble_state_their_assumptions_once(scene, tmp_path):
    text = SCENE.replace("rng = 3", "rng = 3\nmembers = 2").replace('"direct_shear", "shear_curve", ', "")
    tree = fc.scenes.run(scene(text.replace("figures = true", "")), out=tmp_path / "out", progress=False)
    whole = fc.scenes.summary(tree, verbose=True)
    texts = {text for text in tree["joints/strength_envelope/assumption"].values.ravel() if text}
    assert texts
    for text in texts:
        assert " ".join(whole.split()).count(text) == 1


def test_results_are_those_of_the_functions(scene, tmp_path):
    path = scene()
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(path))]
    assert names[-4:-1] == ["joints/direct_shear", "joints/shear_curve", "joints/strength_envelope"]
    tree = fc.scenes.run(path, out=tmp_path / "out", progress=False)
    face = tree["surfaces/height"]
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=4.8e-3, basic_friction_angle=31)
    direct = fc.joints.direct_shear(crack, [6e-4, 0], nominal_pressure=[2e6, 2e7], hardness=3e8)
    stored = tree["joints/direct_shear"]
    for name in ("shear_stress", "dilatancy", "peak_shear_strength", "nominal_pressure"):
        np.testing.assert_array_equal(stored[name], direct[name])
    curve = fc.joints.shear_curve(
        face,
        2.5e-4 * np.arange(5),
        nominal_pressure=[2e6, 2e7],
        wall_strength=1e8,
        residual_friction_angle=31,
    )
    np.testing.assert_allclose(tree["joints/shear_curve/shear_stress"], curve.shear_stress)
    assert tree["joints/strength_envelope"].criterion.values.tolist()[0] == "patton"
    for name in ("strength_envelope.png", "shear_curve.png"):
        assert (tmp_path / "out" / name).is_file()
    summary = fc.scenes.summary(tree)
    assert "strength at the end" in summary
    again = fc.scenes.reproduce(stored.to_dataset())
    np.testing.assert_array_equal(again.shear_stress, stored.shear_stress)


@pytest.mark.parametrize(
    ("path", "end"), [([6e-4, 2e-4], "0.6 mm"), ([-4e-4, -8e-4], "-0.8 mm"), ([4e-4], "400 µm")]
)
def test_end_of_the_first_leg_is_that_of_any_path(path, end):
    """A path may be labelled, and stop on the way; the figure says the same as the table."""
    face = fc.surfaces.fbm((24, 24), 2e-4, hurst=0.7, rms_increment=2e-5, rng=3)
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=2.4e-3, basic_friction_angle=31)
    labelled = xr.DataArray(path, dims="leg")
    test = fc.joints.direct_shear(crack, labelled, nominal_pressure=[1e6, 2e6], hardness=3e8)
    assert "spring" not in fc.scenes.summary(
        xr.DataTree.from_dict({"joints/direct_shear": test}), verbose=True
    )
    stiff = fc.joints.direct_shear(
        crack, labelled, nominal_pressure=[1e6, 2e6], hardness=3e8, normal_stiffness=2e10
    )
    ends = " to ".join(
        f"{end / 1e6:.3g} MPa" for end in (stiff.normal_stress.min(), stiff.normal_stress.max())
    )
    words = " ".join(
        fc.scenes.summary(xr.DataTree.from_dict({"joints/direct_shear": stiff}), verbose=True).split()
    )
    assert f"the spring makes it {ends} on the path" in words
    tree = xr.DataTree.from_dict({"joints/direct_shear": test})
    assert f" {end} " in fc.scenes.summary(tree, verbose=True)
    envelope = fc.joints.strength_envelope(
        face, nominal_pressure=[1e6, 2e6], wall_strength=1e8, basic_friction_angle=31
    )
    axes = fc.plotting.strength_envelope(envelope, tests=test)
    texts = [
        text.get_text().replace("\n", " ")
        for text in axes.figure.findobj(lambda each: hasattr(each, "get_text"))
    ]
    assert any(f"({end})" in text for text in texts)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("path = [6e-4, 0.0]", "", "joint.direct_shear.path: expected a value"),
        ("path = [6e-4, 0.0]", "path = 5e-5", "multiples of 0.0002 m"),
        ("hardness = 3e8", "", "joint.direct_shear.hardness: expected a value"),
        (
            "basic_friction_angle = 31.0",
            "",
            "material.basic_friction_angle: expected a value for shear_curve",
        ),
        ("cohesion = 1e6", "cohesion = -1.0", "cohesion"),
        ("cohesion = 1e6", "direction = ['E', 'N']", "one direction for strength_envelope"),
        ("wall_strength = 1e8\n[joint.s", "wall_strenght = 1e8\n[joint.s", "did you mean 'wall_strength'"),
    ],
)
def test_mistakes_are_reported_before_anything_runs(scene, old, new, message):
    assert old in SCENE
    with pytest.raises(ValueError, match=message):
        fc.scenes.validate(scene(SCENE.replace(old, new, 1)))


def test_datasheet_adds_its_stages_and_writes_page_and_tables(scene, tmp_path):
    text = SCENE.replace(
        'joints = ["direct_shear", "shear_curve", "strength_envelope"]\nfigures = true',
        "datasheet = true\nfigures = true",
    )
    text = text.replace("[joint.direct_shear]", "shear = 2e-4\n[joint.direct_shear]")
    text = text.replace("[want]", "[joint.closure_laws]\nseating_pressure = 3e6\n[want]")
    path = scene(text)
    names = {stage.name for stage in fc.scenes.plan(fc.scenes.load(path))}
    assert {"joints/roughness_coefficient", "joints/closure", "joints/transmissivity"} <= names
    assert "joints/direct_shear" not in names
    tree = fc.scenes.run(path, out=tmp_path / "out", progress=False)
    assert (tmp_path / "out" / "directional_roughness.png").is_file()
    page = (tmp_path / "out" / "datasheet.pdf").read_bytes()
    assert page.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", page)) == 1
    curves = np.genfromtxt(
        tmp_path / "out" / "tables" / "joints_closure_by_shear_step.csv", delimiter=",", names=True
    )
    assert curves.size == tree["joints/closure"].sizes["step"]
    laws = tree["joints/closure_laws"].to_dataset()
    expected = fc.joints.closure_laws(tree["joints/closure"].to_dataset(), seating_pressure=3e6)
    np.testing.assert_array_equal(laws["stiffness"], expected["stiffness"])
    assert float(laws["seating_pressure"]) == 3e6
    assert (tmp_path / "out" / "tables" / "joints_closure_laws_by_shear.csv").is_file()


def test_datasheet_that_fails_leaves_no_incomplete_file(scene, tmp_path, monkeypatch):
    text = SCENE.replace("figures = true", "datasheet = true").replace(
        "[joint.direct_shear]", "shear = 2e-4\n[joint.direct_shear]"
    )

    def full_disk(*arguments, **options):
        tmp_path.joinpath("out", arguments[1].name).write_bytes(b"%PDF")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full_disk)
    with pytest.raises(InvalidInput, match="No space left"):
        fc.scenes.run(scene(text), out=tmp_path / "out", progress=False)
    names = {path.name for path in (tmp_path / "out").iterdir() if path.is_file()}
    assert names == {"result.nc", "report.html"}


RIGID = """
[surface]
generate = "fbm"
shape = [40, 40]
spacing = 2e-4
hurst = 0.8
rms_increment = 3e-5
rng = 3
[joint]
block = 4.8e-3
shear = [0.0, 2e-4, 4e-4]
[joint.self_weight]
shear = [4e-4]
structure_size = [10.0, 100.0]
unit_weight = 24e3
[want]
joints = ["friction", "self_weight"]
"""


def test_laws_of_closure_need_a_closure_and_a_positive_pressure(scene):
    text = SCENE.replace('"direct_shear", "shear_curve", "strength_envelope"', '"closure_laws"')
    text = text.replace("[joint.direct_shear]", "shear = 2e-4\n[joint.direct_shear]")
    names = [stage.name for stage in fc.scenes.plan(fc.scenes.load(scene(text)))]
    assert [name for name in names if "closure" in name] == ["joints/closure", "joints/closure_laws"]
    for value, message in (("-1.0", "seating_pressure: expected"), ("1e5\nclosure = 1e-6", "unknown key")):
        wrong = text.replace("[want]", f"[joint.closure_laws]\nseating_pressure = {value}\n[want]")
        with pytest.raises(ValueError, match=message):
            fc.scenes.validate(scene(wrong))


def test_no_modulus_is_asked_for_where_nothing_elastic_is_wanted(scene, tmp_path):
    tree = fc.scenes.run(scene(RIGID), out=tmp_path / "out", progress=False)
    assert "rigid_dilatancy" in tree["joints"].children
    strength = tree["joints/self_weight/shear_strength"]
    np.testing.assert_allclose(strength.isel(structure_size=1), 10 * strength.isel(structure_size=0))
    assert "of rigid faces" in fc.scenes.summary(tree, verbose=True)


@pytest.mark.parametrize(
    ("want", "material"),
    [
        ('"friction", "elastic_dilatancy"', ""),
        ('"closure"', ""),
        ('"self_weight"', "[material]\nyoung = 3e10\n"),
    ],
)
def test_a_modulus_is_asked_for_where_bodies_deform(scene, want, material):
    text = RIGID.replace('"friction", "self_weight"', want).replace("[joint]", f"{material}[joint]", 1)
    with pytest.raises(ValueError, match=r"material.poisson: expected a value"):
        fc.scenes.validate(scene(text))


def test_incompressible_bodies_are_accepted_everywhere(scene, tmp_path):
    text = SCENE.replace("poisson = 0.2", "poisson = 0.5")
    tree = fc.scenes.run(scene(text), out=tmp_path / "out", progress=False)
    assert np.isfinite(tree["joints/direct_shear/peak_shear_strength"]).all()
