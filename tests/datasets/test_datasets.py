"""The shipped surfaces are what their scripts make, and have the published properties."""

import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

import fractalcontact as fc
from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.files import datasets_folder


def script(name):
    spec = importlib.util.spec_from_file_location(f"make_{name}", datasets_folder() / f"make_{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shipped_crack(name):
    return fc.surfaces.read(datasets_folder() / f"{name}.nc")


@pytest.mark.parametrize("name", ["concrete_crack", "concrete_crack_1998"])
def test_crack_equals_the_output_of_its_script(name):
    module = script(name)
    shipped, remade = shipped_crack(name), module.crack()
    steps = np.abs(np.rint(shipped.values / module.PRECISION) - np.rint(remade.values / module.PRECISION))
    # another transform library may round a height that lies halfway the other way
    assert steps.max() <= 1
    assert (steps > 0).mean() < 1e-3
    np.testing.assert_allclose(shipped.x, remade.x, rtol=1e-12)


def test_crack_has_the_published_dimension_and_dilatancy():
    face = fc.surfaces.sample("concrete_crack")
    assert face.shape == (512, 512)
    np.testing.assert_allclose(np.diff(face.x), 80e-6)
    assert "period" not in face.x.attrs
    dimension = fc.dimensions.estimate(face, ["default", "spectrum", "variogram", "cube_counts"])[
        "fractal_dimension"
    ]
    assert ((dimension > 2.15) & (dimension < 2.29)).all()
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=0.02)
    assert crack.layout.cells == (250, 250)
    rise = fc.joints.dilatancy(crack, shear=[0.0, 0.8e-3, 1.6e-3, 10e-3])["rigid_dilatancy"]
    assert (rise.isel(shear=0) == 0).all()
    # West and North reach a plateau, East and South climb the mean slope
    assert (
        rise.sel(direction=["W", "N"]).isel(shear=-1) < 1.25 * rise.sel(direction=["W", "N"]).isel(shear=2)
    ).all()
    assert (
        rise.sel(direction=["E", "S"]).isel(shear=-1) > 1.7 * rise.sel(direction=["E", "S"]).isel(shear=2)
    ).all()


def test_crack_of_1998_has_the_dimension_and_dilatancy_of_the_paper():
    path = datasets_folder() / "concrete_crack_1998.nc"
    assert path.stat().st_size < 600_000
    face = shipped_crack("concrete_crack_1998")
    assert face.shape == (512, 512)
    np.testing.assert_allclose(np.diff(face.x), 80e-6)
    np.testing.assert_allclose(face / 2e-6, np.rint(face / 2e-6), atol=1e-6)
    methods = ["default", "spectrum", "variogram", "cube_counts"]
    dimension = fc.dimensions.estimate(face, methods)["fractal_dimension"]
    # the paper gives its range with two digits
    assert ((dimension.round(2) >= 2.15) & (dimension.round(2) <= 2.29)).all()
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=0.02)
    rise = fc.joints.dilatancy(crack, shear=np.arange(10, 126) * 8e-5)["rigid_dilatancy"]
    flat, rising = rise.sel(direction=["W", "N"]), rise.sel(direction=["E", "S"])
    np.testing.assert_allclose(flat.isel(shear=0), 2e-3, rtol=0.1)
    assert (abs(flat / flat.isel(shear=0) - 1) < 0.25).all()
    assert (rising.isel(shear=-1) > 1.35 * rising.isel(shear=0)).all()


@pytest.mark.parametrize("states", ["first and last", pytest.param("all", marks=pytest.mark.slow)])
def test_shipped_study_needs_no_caveat(tmp_path, states):
    """Contacts are resolved at every load and shear, slopes are small, and the dimensions are comparable."""
    scene = fc.scenes.load("concrete_crack")
    scene.tables["want"]["figures"] = False
    if states != "all":
        joint = scene.tables["joint"]
        shear, force = joint["shear"], joint["normal_force"]
        joint |= {"shear": [shear[0], shear[-1]], "normal_force": [force[0], force[-1]]}
        joint["elastic_dilatancy"] = {"shear": [0.0, shear[0], shear[-1]]}
    tree = fc.scenes.run(scene, out=tmp_path / "out", progress=False)
    assert tree.attrs["caveats"] == "none"
    closure = tree["joints/closure"].to_dataset()
    assert float(closure.rms_slope.max()) < 0.3
    for state in closure.state.values.reshape(-1, *closure.state.shape[-2:]):
        labels, count = ndimage.label(state > 0)
        assert np.median(np.bincount(labels.ravel())[1:]) >= 30
    assert count > 30
    assert (closure.contact_fraction.diff("step") > 0).all()
    assert (closure.contact_fraction.isel(step=-1).diff("shear") < 0).all()
    signature = tree["domains/signature"].isel(step=-1)
    assert np.isfinite(signature.domain_dimension).all()
    estimates = tree["dimensions"].to_dataset()
    made = 3 - scene.tables["surface"]["hurst"]
    assert ((3 - estimates.ci_high < made) & (made < 3 - estimates.ci_low)).all()
    text = fc.scenes.summary(tree)
    assert text.count("\n") < 36
    assert "left out" not in text


def test_land_surface_has_the_position_and_heights_of_the_map():
    land = fc.surfaces.sample("jacksboro_fault_dem")
    assert land.shape == (344, 403)
    # length of one degree at 36.6 N: 110.96 km of latitude, 89.5 km of longitude (tables of the ellipsoid)
    np.testing.assert_allclose(float(land.y[1] - land.y[0]), 110.96e3 * 0.00083333, rtol=1e-3)
    np.testing.assert_allclose(float(land.x[1] - land.x[0]), 89.5e3 * 0.00083333, rtol=2e-3)
    from matplotlib import cbook

    with cbook.get_sample_data("jacksboro_fault_dem.npz") as file:
        north = file["elevation"][0]
    np.testing.assert_array_equal(land.isel(y=-1), north)
    assert (land == land.round()).all()


def test_land_surface_has_no_single_exponent():
    """The text of the example `plot_land_surface.py`: smooth at the shortest waves, flat at the longest."""
    land = fc.surfaces.sample("jacksboro_fault_dem")
    default = fc.dimensions.estimate(land).isel(method=0)
    by_octave = fc.dimensions.scaling(land).sortby("wavelength")
    assert float(default.hurst) == pytest.approx(float(by_octave.window_hurst))
    assert default.ci_low <= by_octave.window_ci_low < by_octave.window_ci_high <= default.ci_high
    assert "blur" in str(default.note.values)
    assert "another exponent" in str(default.note.values)
    assert by_octave.ci_low[0] > 1
    longest = by_octave.isel(wavelength=np.isfinite(by_octave.hurst.values)).isel(wavelength=-1)
    assert longest.ci_low < 0 < longest.ci_high


def test_unknown_sample_is_refused():
    with pytest.raises(ValueError, match="concrete_crack"):
        fc.surfaces.sample("moon")


# what the 1998 paper contains, and the stages of a scene that compute it
PAPER = {
    "dimensions": "the dimension of the scanned face",
    "joints/delta_surface": "figure 1b",
    "joints/delta_dimension": "its dimension over the shear",
    "joints/elimination": "successive eliminations of tension points",
    "joints/closure": "figures 3 and 4",
    "joints/area_by_resolution": "the area depends on the discretization",
    "domains/signature": "lacunar contact domains",
    "domains/lacunarity": "lacunar contact domains",
    "joints/rigid_dilatancy": "figure 5a",
    "joints/elastic_dilatancy": "figure 5b",
    "joints/friction": "the friction angle",
    "joints/decorrelation_length": "no more correlations at 8 mm",
    "joints/transmissivity": "leakage",
    "joints/self_weight": "stability due to friction increases with the size",
}


def test_scene_of_1998_has_every_part_of_the_paper():
    stages = {stage.name for stage in fc.scenes.plan(fc.scenes.load("concrete_crack_1998"))}
    assert set(PAPER) <= stages


@pytest.mark.parametrize("name", ["freiberg_gneiss_side_a", "freiberg_gneiss_side_b", "afm_10um_di3"])
def test_measured_sample_states_its_source(name):
    if "FRACTALCONTACT_DATA" not in os.environ:
        pytest.skip("FRACTALCONTACT_DATA is not set")
    surface = fc.surfaces.sample(name)
    assert "MIT" in surface.attrs["provenance"]
    assert "https://github.com/" in surface.attrs["provenance"]
    page = Path(__file__).resolve().parents[2] / "gallery" / "measured_surfaces.rst"
    assert json.loads(surface.attrs["provenance"])["file_sha256"] in page.read_text(encoding="utf-8")


def test_measured_sample_that_is_missing_or_changed(tmp_path, monkeypatch):
    monkeypatch.delenv("FRACTALCONTACT_DATA", raising=False)
    with pytest.raises(UnreadableFile, match=r"FRACTALCONTACT_DATA names; made from .*MIT"):
        fc.surfaces.sample("afm_10um_di3")
    monkeypatch.setenv("FRACTALCONTACT_DATA", str(tmp_path))
    np.save(tmp_path / "afm_10um_di3.npy", np.zeros((4, 4)))
    with pytest.raises(UnreadableFile, match="SHA-256"):
        fc.surfaces.sample("afm_10um_di3")
