"""Scenes for usual questions: what they ask for, and the commands that run them."""

import tomllib

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.cli import main

HURST = 0.7


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """Write two mated faces of 96 x 96 points, the upper one 0.1 mm above, and work in their folder."""
    monkeypatch.chdir(tmp_path)
    lower = fc.surfaces.fbm((96, 96), 2e-4, hurst=HURST, rms_increment=1e-5, rng=3)
    fc.save(lower, tmp_path / "lower.nc")
    fc.save(lower + 1e-4, tmp_path / "upper.nc")
    return tmp_path


def test_roughness_of_a_list_of_points(scans):
    """The command reads points, and its result is that of the functions."""
    lower = fc.open("lower.nc")
    y, x = np.meshgrid(lower.y, lower.x, indexing="ij")
    np.savetxt("scan.xyz", 1e3 * np.stack([x, y, lower.values], axis=-1).reshape(-1, 3), fmt="%.9f")
    assert main(["roughness", "scan.xyz", "--units", "mm", "--quiet"]) == 0
    tree = fc.open(scans / "scan_roughness" / "result.nc")
    result = tree["dimensions"].to_dataset().sel({"method": "default"})
    expected = fc.dimensions.estimate(fc.surfaces.read("scan.xyz", units="mm")).sel({"method": "default"})
    assert float(result.hurst) == float(expected.hurst)
    assert float(result.ci_low) < HURST < float(result.ci_high)
    assert "roughness_coefficient" in tree["joints"].children
    assert {"report.html", "surface.png"} <= {path.name for path in (scans / "scan_roughness").iterdir()}


def test_printed_scene_is_the_one_that_runs(scans, capsys):
    """`--scene` prints the scene and runs nothing; the scene beside the results has the same tables."""
    words = ["contact", "lower.nc", "--young", "3e10", "--spacing", "2e-4"]
    assert main([*words, "--scene"]) == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert not (scans / "lower_contact").exists()
    assert printed["surface"] == {"read": "lower.nc", "spacing": 2e-4}
    assert main([*words, "--quiet", "-o", "out"]) == 0
    run = tomllib.loads((scans / "out" / "contact.toml").read_text())
    assert run["surface"].pop("read") == "../lower.nc"
    assert printed["surface"].pop("read") == "lower.nc"
    assert run == printed
    fractions = fc.open(scans / "out" / "result.nc")["contact"].to_dataset()["contact_fraction"]
    assert float(fractions[0]) < 0.01
    assert 0.05 < float(fractions[-1]) < 0.4


def test_joint_of_two_faces(scans):
    assert main(["joint", "lower.nc", "upper.nc", "--young", "3e10", "-o", "out", "--quiet"]) == 0
    joints = fc.open(scans / "out" / "result.nc")["joints"]
    assert {"closure", "rigid_dilatancy", "transmissivity"} <= set(joints.children)
    # mated faces touch everywhere before they slide
    assert float(joints["closure"]["contact_fraction"].isel(shear=0, step=-1)) > 0.9


def test_joint_with_a_spike_as_scanned(scans):
    """One false point holds the faces apart until it is removed; faces as scanned keep their distance."""
    upper = fc.open("upper.nc").load()
    upper[40, 50] -= 1e-3
    fc.save(upper, "spiked.nc")
    command = ["joint", "lower.nc", "spiked.nc", "--young", "3e10", "--quiet", "--as-scanned"]
    assert main([*command, "-o", "spiked"]) == 0
    assert main([*command, "-o", "without", "--despike"]) == 0
    spiked, without = (fc.open(f"{folder}/result.nc") for folder in ("spiked", "without"))
    distance = without["joints/faces/height"] - without["surfaces/height"]
    assert float(distance.mean()) == pytest.approx(1e-4, rel=1e-3)
    assert "probably a spike" in fc.scenes.summary(spiked)
    assert "a mean aperture of 1 mm" in fc.scenes.summary(spiked).replace("\n    ", " ")
    assert "probably a spike" not in fc.scenes.summary(without)
    lifted = [float(tree["joints/closure/mean_gap"][0, 0]) for tree in (spiked, without)]
    assert lifted[0] > 0.8e-3 > 0.1e-3 > lifted[1]
    title = tomllib.loads((scans / "spiked" / "joint.toml").read_text())["title"]
    assert title == "Joint of lower.nc and spiked.nc"


def test_summary_says_how_a_cloud_was_gridded(scans):
    """Points, cells and tilt are those of the file."""
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0.0, 19.2, (2, 9000))
    np.savetxt("tilted.xyz", np.c_[x, y, np.tan(np.radians(10.0)) * x + 0.02 * rng.normal(size=x.size)])
    assert main(["roughness", "tilted.xyz", "--units", "mm", "--spacing", "2e-4", "--quiet"]) == 0
    text = " ".join(fc.scenes.summary(fc.open("tilted_roughness/result.nc")).split())
    assert "gridded from 9000 points" in text
    assert "cells of 200 µm; heights are above the best-fit plane of the points, tilted by 10°" in text
    assert "between the points nothing was measured" in text


def test_joint_of_two_tilted_clouds(scans):
    """The upper cloud is gridded on the plane and the cells of the lower one: its distance stays."""
    rng, side = np.random.default_rng(1), 96 * 0.2
    for name, distance in (("a.xyz", 0.0), ("b.xyz", 0.5)):
        x, y = rng.uniform(0.0, side, (2, 12000))
        np.savetxt(name, np.c_[x, y, 0.3 * x + 0.05 * np.sin(x) + distance], fmt="%.9f")
    text = fc.scenes.template("joint", "a.xyz", "b.xyz", young=3e10, units="mm", spacing=4e-4)
    upper = tomllib.loads(text)["upper"]
    assert upper["plane"] == "surface"
    assert "spacing" not in upper
    (scans / "two.toml").write_text(text.replace("register = true", "register = false"), encoding="utf-8")
    scene = fc.scenes.validate("two.toml")
    tree = fc.scenes.run(scene, progress=False)
    distance = tree["joints/faces/height"] - tree["surfaces/height"]
    assert float(distance.mean()) == pytest.approx(0.5e-3 / np.hypot(1.0, 0.3), rel=0.01)
    assert float(distance.std()) < 1e-5


def test_scan_with_gaps_is_filled_where_it_is_pressed(scans):
    gapped = fc.open("lower.nc")
    fc.save(gapped.where((gapped.x > 1e-3) | (gapped.y > 1e-3)), "gaps.nc")
    assert "fill" not in tomllib.loads(fc.scenes.template("roughness", "gaps.nc"))["surface"]
    assert tomllib.loads(fc.scenes.template("contact", "gaps.nc", young=1e9))["surface"]["fill"] is True


def test_coarse_surface_has_no_roughness_coefficient(scans):
    lower = fc.open("lower.nc")
    fc.save(fc.surfaces.from_array(1e5 * lower.values, 10.0), "land.nc")
    assert "joints" not in tomllib.loads(fc.scenes.template("roughness", "land.nc"))["want"]


def test_new_scene_is_valid_and_is_not_overwritten(scans, capsys):
    assert main(["init"]) == 0
    assert fc.scenes.validate("scene.toml").want.joints == ("closure", "rigid_dilatancy")
    before = (scans / "scene.toml").read_bytes()
    assert main(["init"]) == 2
    assert "a new file" in capsys.readouterr().err
    assert (scans / "scene.toml").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "options", "problem"),
    [
        (("colour", "lower.nc"), {}, "question"),
        (("roughness", "nowhere.nc"), {}, "existing file"),
        (("contact", "lower.nc"), {}, "young"),
        (("contact", "lower.nc"), {"young": -1.0}, "young"),
        (("joint", "lower.nc"), {"young": 1e9}, "upper"),
        (("roughness", "profile.nc"), {}, "a profile"),
    ],
)
def test_wrong_questions(scans, arguments, options, problem):
    fc.save(fc.surfaces.fbm(64, 1e-4, hurst=0.5, rms_increment=1e-6, rng=1), "profile.nc")
    with pytest.raises(InvalidInput, match=problem):
        fc.scenes.template(*arguments, **options)
