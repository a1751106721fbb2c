"""Scenes for usual questions: what they ask for, and the commands that run them."""

import re
import shutil
import tomllib

import numpy as np
import pytest
from study import command_here

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput
from fractalcontact.cli import main

HURST = 0.7


@pytest.fixture(scope="module")
def faces(tmp_path_factory):
    """Write two mated faces of 64 x 64 points, the upper one 0.1 mm above; return their files."""
    folder = tmp_path_factory.mktemp("faces")
    lower = fc.surfaces.fbm((64, 64), 2e-4, hurst=HURST, rms_increment=1e-5, rng=3)
    return fc.save(lower, folder / "lower.nc"), fc.save(lower + 1e-4, folder / "upper.nc")


@pytest.fixture
def scans(tmp_path, monkeypatch, faces):
    """Work in a folder with copies of the two faces."""
    monkeypatch.chdir(tmp_path)
    for path in faces:
        shutil.copy(path, tmp_path)
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
    assert float(result.hurst) == pytest.approx(float(expected.hurst), abs=1e-6)  # a plane was subtracted
    assert float(result.ci_low) < HURST < float(result.ci_high)
    assert "roughness_coefficient" in tree["joints"].children
    names = {path.name for path in (scans / "scan_roughness").iterdir()}
    assert "report.html" in names
    assert any(name.endswith("surface.png") for name in names)


def test_heights_that_were_read_are_not_read_again(scans, monkeypatch):
    surface, read = fc.surfaces.read("lower.nc"), []
    expected = fc.scenes.template("roughness", "lower.nc")
    monkeypatch.setattr(fc.surfaces, "read", lambda path, **options: read.append(path))
    assert fc.scenes.template("roughness", "lower.nc", surface=surface) == expected
    assert not read
    with pytest.raises(InvalidInput, match="surface: expected"):
        fc.scenes.template("roughness", "lower.nc", surface=np.eye(4))


def test_roughness_of_a_profile(scans, capsys):
    """JRC, Z2 and D of a line of heights are those of the functions; other results are not overwritten."""
    profile = fc.surfaces.fbm(512, 2e-4, hurst=HURST, rms_increment=3e-5, rng=3)
    np.savetxt("line.csv", np.stack([profile.x, profile.values], axis=-1), delimiter=",", header="x,z")
    assert main(["roughness", "line.csv", "--units", "m"]) == 0
    text = capsys.readouterr().out
    result = fc.open(scans / "line_roughness" / "result.nc")
    read = fc.surfaces.level(fc.surfaces.read("line.csv", units="m"))
    expected = fc.joints.roughness_coefficient(read)
    assert result["joints/roughness_coefficient"].to_dataset().profile_slope.equals(expected.profile_slope)
    dimension = fc.dimensions.estimate(read).fractal_dimension
    for name, number in (("JRC", expected.roughness_coefficient), ("Z2", expected.profile_slope)):
        assert name in text
        assert f"{float(number[0]):.{1 if name == 'JRC' else 3}f}" in text
    assert f"{float(dimension[0]):.3f}" in text
    assert main(["report", "line_roughness/result.nc", "--csv", "tables"]) == 0
    assert "surfaces_by_x.csv" in {path.name for path in (scans / "tables").iterdir()}
    assert main(["roughness", "lower.nc", "--quiet", "-o", "other"]) == 0
    assert main(["roughness", "line.csv", "--units", "m", "-o", "other"]) == 2


def test_scan_smaller_than_the_square_of_the_spikes(scans, capsys):
    """Its spikes are not looked for: the run failed at its end, and named a size that nobody gave."""
    fc.save(fc.open("lower.nc").isel(y=slice(4), x=slice(4)), "small.nc")
    for words in (["roughness"], ["contact", "--young", "3GPa"]):
        assert main([words[0], "small.nc", *words[1:], "-o", words[0], "--quiet"]) == 0
        assert "size" not in capsys.readouterr().err


def test_options_of_a_profile_act_on_its_numbers(scans):
    """A bow that `--level 2` removes, and a spike that `--despike` does, are in neither dimension nor Z2."""
    profile = fc.surfaces.fbm(512, 2e-4, hurst=HURST, rms_increment=3e-5, rng=3)
    bent = profile + 2.0 * (profile.x - profile.x.mean()) ** 2
    bent[200] += 3e-3
    np.savetxt("bent.csv", np.stack([bent.x, bent.values], axis=-1), delimiter=",", header="x,z")
    assert main(["roughness", "bent.csv", "--units", "m", "--level", "2", "--despike", "--quiet"]) == 0
    result = fc.open(scans / "bent_roughness" / "result.nc")
    assert result["surfaces"]["height"].isnull().values.nonzero()[0].tolist() == [200]
    straight = fc.surfaces.level(profile.where(bent != bent[200]), 2)
    slope = result["joints/roughness_coefficient"]["profile_slope"].values
    expected = fc.joints.roughness_coefficient(straight).profile_slope.values
    np.testing.assert_allclose(slope, expected, rtol=1e-9)
    fitted = result["dimensions"]["hurst"].values
    np.testing.assert_allclose(fitted, fc.dimensions.estimate(straight).hurst.values, rtol=1e-6)


def test_printed_scene_is_the_one_that_runs(scans, capsys):
    """`--scene` prints the scene and runs nothing; the scene beside the results has the same tables."""
    words = ["contact", "lower.nc", "--young", "3e10", "--spacing", "2e-4"]
    assert main([*words, "--scene"]) == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert not (scans / "lower_contact").exists()
    assert printed["surface"] == {"read": "lower.nc", "spacing": 2e-4, "level": 1}
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
    assert "points that stand out as spikes of a scan: 1 of [upper]; without them" in fc.scenes.summary(
        spiked
    )
    words = " ".join(fc.scenes.summary(spiked, verbose=True).split())
    assert "aperture as given: mean " in words
    assert "a mean aperture of 1 mm" in words
    assert re.search(r"the faces first touch at a mean aperture of \S+ \S+, not 1 mm", words)
    assert "stand out" not in fc.scenes.summary(without)
    assert "upper face: 1 point removed as spikes, 1 point filled in" in fc.scenes.summary(without)
    lifted = [float(tree["joints/closure/mean_gap"][0, 0]) for tree in (spiked, without)]
    assert lifted[0] > 0.8e-3 > 0.1e-3 > lifted[1]
    title = tomllib.loads((scans / "spiked" / "joint.toml").read_text())["title"]
    assert title == "Joint of lower.nc and spiked.nc"


def test_points_on_a_grid_are_levelled_as_the_heights_that_they_are(scans):
    """Points between the cells are gridded on their best plane, and not levelled again."""
    rng, surface = (
        np.random.default_rng(3),
        fc.surfaces.fbm((40, 40), 2e-4, hurst=0.8, rms_increment=1e-5, rng=1),
    )
    fc.save(surface.to_dataset(name="height"), "grid.nc")
    y, x = np.meshgrid(surface.y, surface.x, indexing="ij")
    points = 1e3 * np.stack([x, y, surface.values], axis=-1).reshape(-1, 3)
    np.savetxt("grid.xyz", points, fmt="%.9f")
    np.savetxt("cloud.xyz", points + np.r_[0.06, 0.06, 0.0] * rng.normal(size=points.shape))
    assert "level = 1" in fc.scenes.template("roughness", "grid.nc")
    assert "level = 1" in fc.scenes.template("roughness", "grid.xyz", units="mm")
    assert "level" not in fc.scenes.template("roughness", "cloud.xyz", units="mm")


def test_summary_says_how_a_cloud_was_gridded(scans):
    """Points, cells and tilt are those of the file."""
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0.0, 19.2, (2, 9000))
    np.savetxt("tilted.xyz", np.c_[x, y, np.tan(np.radians(10.0)) * x + 0.02 * rng.normal(size=x.size)])
    assert main(["roughness", "tilted.xyz", "--units", "mm", "--spacing", "2e-4", "--quiet"]) == 0
    text = " ".join(fc.scenes.summary(fc.open("tilted_roughness/result.nc"), verbose=True).split())
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


def test_part_of_a_periodic_surface_is_levelled(scans):
    whole = fc.surfaces.spectral((48, 48), 1e-4, hurst=0.8, rms_height=1e-5, rng=1)
    assert "level" not in tomllib.loads(fc.scenes.template("roughness", "lower.nc", surface=whole))["surface"]
    part = whole.isel(x=slice(None, 24), y=slice(None, 24))
    assert tomllib.loads(fc.scenes.template("roughness", "lower.nc", surface=part))["surface"]["level"] == 1


def test_coarse_surface_has_no_roughness_coefficient(scans):
    lower = fc.open("lower.nc")
    fc.save(fc.surfaces.from_array(1e5 * lower.values, 10.0), "land.nc")
    with pytest.warns(FractalContactWarning, match="JRC is left out: .* 0.508 mm apart, .* 10 m"):
        text = fc.scenes.template("roughness", "land.nc")
    assert "joints" not in tomllib.loads(text)["want"]


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


def test_single_face_is_levelled_and_says_so(scans, capsys):
    """A plane of slope .02 over 12.8 mm: a tilt of 1.15 degree, and 74 µm of the rms height."""
    lower = fc.open("lower.nc")
    tilted = (lower + 0.02 * lower.x).rename("height")
    tilted["x"].attrs.pop("period", None)
    fc.save(tilted, "tilted.nc")
    assert main(["contact", "tilted.nc", "--young", "30 GPa"]) == 0
    out = capsys.readouterr().out
    tilt, before, after = re.search(
        r"tilt (\S+)° removed, Sq (\S+) µm before and (\S+) µm after", out
    ).groups()
    assert float(before) == pytest.approx(1e6 * float(tilted.std()), rel=0.01)
    level = fc.surfaces.level(tilted, 1)
    assert float(after) == pytest.approx(1e6 * float(level.std()), rel=0.01)
    assert 0.5 < float(tilt) < 2.0
    assert "is tilted" not in out
    assert len(out.splitlines()) <= 40
    assert main(["contact", "tilted.nc", "--young", "30e9", "--level", "0", "-o", "kept"]) == 0
    out = capsys.readouterr().out
    assert "levelled" not in out
    assert "the surface is tilted: its mean plane carries" in out


def test_a_periodic_wave_is_not_tilted(scans, capsys):
    """A plane through one period holds 61 % of its variance, and levelling would make its edges free."""
    wave = 1e-6 * np.sin(2 * np.pi * np.arange(64) / 64) * np.ones((64, 1))
    fc.save(fc.surfaces.from_array(wave, 1e-4, periodic=True), "wave.nc")
    assert main(["contact", "wave.nc", "--young", "30e9", "--level", "0"]) == 0
    assert "is tilted" not in capsys.readouterr().out


def test_faces_of_a_joint_are_not_levelled_one_by_one(scans):
    text = fc.scenes.template("joint", "lower.nc", "upper.nc", young=3e10)
    assert "level" not in text
    with pytest.raises(InvalidInput, match="a single face"):
        fc.scenes.template("joint", "lower.nc", "upper.nc", young=3e10, level=1)


def test_scan_on_itself_shows_zeros_and_no_rounding(tmp_path, capsys):
    """Registration moves it by some 1e-19 m, and turns it by 1e-15 degree."""
    face = fc.surfaces.fbm((16, 16), 1e-3, hurst=0.8, rms_increment=3e-5, rng=1)
    fc.save(face, tmp_path / "face.nc")
    command = ["joint", *[str(tmp_path / "face.nc")] * 2, "--young", "30GPa", "-o", str(tmp_path / "out")]
    assert main([*command, "--verbose"]) == 0
    out = capsys.readouterr().out
    assert "aperture in mated position: mean 0 m, smallest 0 m\n" in out
    assert "fm" not in out
    assert "rotation 0 °" in " ".join(out.split())


def test_spikes_of_a_roughness_scan(scans, capsys):
    """Twenty false points: said with D and JRC without them, and gone with --despike."""
    lower = fc.open("lower.nc").load()
    rows, columns = np.random.default_rng(1).integers(2, 62, (2, 20))
    spiked = lower.copy(deep=True)
    spiked.values[rows, columns] += 2e-3
    fc.save(spiked, "spiked.nc")
    jrc = {
        name: float(fc.joints.roughness_coefficient(face, direction="E").roughness_coefficient[0])
        for name, face in (("clean", fc.surfaces.level(lower, 1)), ("spiked", fc.surfaces.level(spiked, 1)))
    }
    assert main(["roughness", "spiked.nc", "--level", "1"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    count = int(re.search(r"spikes of a scan: (\d+) of \[surface\]", out)[1])
    assert 15 <= count <= 20
    without, given = re.search(r"JRC is (.+?), not (\S+), toward E", out).groups()
    assert float(given) == pytest.approx(jrc["spiked"], abs=1)
    assert jrc["clean"] < 0
    assert without == "below 0"
    dimension, with_spikes = re.search(r"D is (\S+), not (\S+),", out).groups()  # of the same estimator
    assert f"{float(re.search(r'default ([0-9.]+)', out)[1]):.2f}" == with_spikes
    assert main(["roughness", "spiked.nc", "--despike", "--level", "1", "-o", "clean"]) == 0
    cleaned = fc.open("clean/result.nc")["dimensions/fractal_dimension"].sel({"method": "default"})
    assert f"{float(cleaned):.2f}" == dimension
    out = " ".join(capsys.readouterr().out.split())
    assert "stand out" not in out
    assert f"{count} points removed as spikes" in out


def test_jrc_below_its_scale_is_said_in_words(scans, capsys):
    """Nearly smooth: the regression gives negative numbers, which no table and no remark shows."""
    smooth = 1e-2 * fc.open("lower.nc").load()
    spiked = smooth.copy(deep=True)
    rows, columns = np.random.default_rng(1).integers(2, 62, (2, 25))
    spiked.values[rows, columns] += 1e-3  # not on a lattice, whose waves are looked for
    fc.save(smooth, "smooth.nc")
    fc.save(spiked, "spiked.nc")
    for name in ("smooth", "spiked"):
        assert main(["roughness", f"{name}.nc", "-o", name]) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert "below 0" in out
        assert not re.search(r"(?<=\s)-\d", out), out
    assert "JRC is below 0, not" in out


def test_swapped_faces_are_refused(scans, capsys):
    assert main(["joint", "upper.nc", "lower.nc", "--young", "3e10", "--as-scanned"]) == 2
    assert "swap" in capsys.readouterr().err
    assert main(["joint", "upper.nc", "lower.nc", "--young", "3e10"]) == 2
    assert "swap" in capsys.readouterr().err


def test_share_of_missing_points_is_said(scans, capsys):
    lower = fc.open("lower.nc")
    fc.save(lower.where((lower.x > 2e-3) | (lower.y > 6.4e-3)), "gaps.nc")
    share = 100 * float(fc.open("gaps.nc").isnull().mean())
    assert main(["roughness", "gaps.nc"]) == 0
    assert f"{share:.3g} % of the points are missing" in capsys.readouterr().out


def test_strength_of_a_joint_with_jcs(scans):
    text = fc.scenes.template(
        "joint", "lower.nc", "upper.nc", young=3e10, basic_friction_angle=30.0, wall_strength=150e6
    )
    scene = tomllib.loads(text)
    assert scene["material"]["basic_friction_angle"] == 30.0
    assert {"strength_envelope", "direct_shear"} <= set(scene["want"]["joints"])
    assert scene["want"]["datasheet"] is True
    assert scene["joint"]["direct_shear"]["hardness"] == 150e6
    (scans / "joint.toml").write_text(text, encoding="utf-8")
    assert "joints/strength_envelope" in [
        stage.name for stage in fc.scenes.plan(fc.scenes.validate("joint.toml"))
    ]


def test_soft_modulus_warns_once(scans, capsys):
    done = command_here("contact", "lower.nc", "--young", "30", "--scene")
    assert done.returncode == 0
    assert done.stderr.count("is it 30 GPa?") == 1
    negative = command_here("contact", "lower.nc", "--young=-3GPa", "--scene")
    assert "young: expected a finite number > 0" in negative.stderr
    assert "is it" not in negative.stderr
    with pytest.raises(SystemExit):
        main(["contact", "lower.nc", "--young", "soft"])
    assert "30 GPa" in capsys.readouterr().err


def test_key_in_the_wrong_table_is_reported_first(scans):
    text = fc.scenes.template("joint", "lower.nc", "upper.nc", young=3e10, basic_friction_angle=30.0)
    text = text.replace("[material]", "[material]\nJCS = 150e6").replace("[want]", "[want]\ndatasheet = true")
    (scans / "joint.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.validate("joint.toml")
    assert caught.value.problems[0].startswith("material.JCS: ")
    assert (
        "'wall_strength' belongs to [joint.shear_curve] or [joint.strength_envelope]"
        in caught.value.problems[0]
    )


def test_spacing_may_have_its_unit(scans, capsys):
    np.savetxt("table.csv", fc.open("lower.nc").values, delimiter=",")
    assert main(["roughness", "table.csv", "--spacing", "0.2mm", "--scene"]) == 0
    assert tomllib.loads(capsys.readouterr().out)["surface"]["spacing"] == pytest.approx(2e-4, rel=1e-12)
    assert main(["roughness", "table.csv", "--scene"]) == 2
    assert "--spacing 0.3mm" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["roughness", "table.csv", "--spacing", "2 Pa"])
    assert "expected a length in metres, or with its unit (0.3 mm), got '2 Pa'" in capsys.readouterr().err


@pytest.mark.parametrize("channel", ["fine", "1"])
def test_channel_is_chosen_by_name_or_number(scans, capsys, channel):
    heights = fc.open("lower.nc").values
    np.savez("two.npz", coarse=10 * heights, fine=heights)
    words = ["roughness", "two.npz", "--spacing", "0.2mm", "--quiet"]
    assert main(words) == 2
    assert "channel: expected one of 'coarse', 'fine'" in capsys.readouterr().err
    assert main([*words, "--channel", channel]) == 0
    stored = fc.open("two_roughness/result.nc")["surfaces"].to_dataset()
    levelled = fc.surfaces.level(fc.surfaces.read("two.npz", spacing=2e-4, channel="fine"))
    np.testing.assert_array_equal(stored["height"].values, levelled.values)


def test_option_of_another_command_shows_the_usage_of_the_command(scans, capsys):
    with pytest.raises(SystemExit) as left:
        main(["joint", "lower.nc", "upper.nc", "--young", "30GPa", "--load", "2MPa"])
    assert left.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("usage: fractalcontact joint ")
    assert "unrecognized arguments: --load 2MPa" in error


@pytest.mark.parametrize("fault", ["tilt", "spikes"])
def test_loads_are_those_of_the_surface_that_is_pressed(scans, fault):
    """The slope of a tilt or of spikes, which the scene removes, made loads up to 35 times greater."""
    rough = fc.surfaces.spectral(
        (64, 64), 1e-5, hurst=0.8, rolloff=3e-4, short_cutoff=4e-5, rms_slope=0.02, rng=1
    )
    clean = fc.surfaces.from_array(rough.values, 1e-5)
    heights = clean.values.copy()
    if fault == "tilt":
        heights += 0.2 * clean.x.values
    else:
        heights[np.arange(4, 60, 8), np.arange(60, 4, -8)] += 1e-4
    fc.save(clean, "clean.nc")
    fc.save(fc.surfaces.from_array(heights, 1e-5), "faulty.nc")
    options = {"young": 70e9, "despike": True}
    loads = [
        tomllib.loads(fc.scenes.template("contact", name, **options))["contact"]["nominal_pressure"]
        for name in ("clean.nc", "faulty.nc")
    ]
    assert loads[1]["last"] == pytest.approx(loads[0]["last"], rel=0.02)


@pytest.mark.parametrize("spacing", [(2.5e-4, 1.7e-4), (2e-4, 3e-4)])
def test_joint_of_faces_with_unequal_spacings(scans, capsys, spacing):
    """Shears are whole cells along x; such a face cannot be turned into mated position."""
    lower = fc.surfaces.fbm((64, 64), spacing, hurst=HURST, rms_increment=1e-5, rng=3)
    fc.save(lower, "oblong.nc")
    fc.save(lower + 1e-3, "above.nc")
    command = [
        "joint",
        "oblong.nc",
        "above.nc",
        "--young",
        "30GPa",
        "--friction-angle",
        "30",
        "--jcs",
        "60MPa",
    ]
    assert main([*command, "--quiet"]) == 2
    assert "joint.register: expected one spacing along x and y" in capsys.readouterr().err
    assert main([*command, "--as-scanned", "--scene"]) == 0
    scene = tomllib.loads(capsys.readouterr().out)
    assert fc.scenes.validate(fc.scenes.Scene("joint", scene, scans)).name == "joint"
    cells = np.array(scene["joint"]["shear"]) / spacing[1]
    np.testing.assert_allclose(cells, np.rint(cells), atol=1e-6)


def test_title_of_scans_in_several_folders_names_the_folder_of_all(tmp_path):
    for name in ("one", "two"):
        (tmp_path / "samples" / name).mkdir(parents=True)
        face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
        fc.save(face, tmp_path / "samples" / name / "scan.nc")
    pattern = str(tmp_path / "samples" / "*" / "scan.nc")
    assert 'title = "Roughness of the scans in samples"' in fc.scenes.template("roughness", pattern)
    (tmp_path / "samples" / "two" / "scan.nc").unlink()
    assert 'title = "Roughness of the scans in one"' in fc.scenes.template("roughness", pattern)
