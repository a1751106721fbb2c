"""The shipped scenes on measured surfaces, reduced to the time of a test."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.scenes import Scene


def test_land_surface_needs_no_download():
    scene = fc.scenes.load("jacksboro_fault")
    tables = {**scene.tables, "want": {**scene.tables["want"], "figures": False}}
    tree = fc.scenes.run(Scene(scene.name, tables, scene.folder), progress=False)
    assert set(tree.children) == {"surfaces", "dimensions"}
    land = tree["surfaces"]
    # whole metres, between the valley and the ridge
    assert 200 < float(land["height"].min()) < float(land["height"].max()) < 1200
    dimension = tree["dimensions"]["fractal_dimension"]
    assert ((dimension >= 2) & (dimension < 3)).all()


@pytest.fixture(scope="module")
def gneiss(measured):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRACTALCONTACT_DATA", str(measured))
        scene = fc.scenes.load("freiberg_gneiss")
        joint = {
            **scene.tables["joint"],
            "closure": {"shear": [0.0, 3e-3], "normal_force": [1e2, 1e3, 1e4]},
            "rigid_dilatancy": {"shear": [0.0, 3e-3, 7.5e-3]},
            "elastic_dilatancy": {"shear": [0.0, 3e-4, 3e-3], "normal_force": [1e3, 1e4]},
        }
        want = {**scene.tables["want"], "figures": False}
        yield fc.scenes.run(
            Scene("gneiss", {**scene.tables, "joint": joint, "want": want}, scene.folder), progress=False
        )


def test_mated_pair_runs_through_the_whole_study(gneiss):
    assert set(gneiss.children) == {"surfaces", "dimensions", "joints", "domains"}
    closure = gneiss["joints/closure"].to_dataset()
    for name in ("closure", "interface_closure", "contact_fraction", "mean_gap"):
        assert np.isfinite(closure[name]).all(), name
    assert bool(closure["converged"].all())
    assert (closure["closure"].diff("step") > 0).all()
    assert (closure["contact_fraction"].diff("step") >= 0).all()
    flow = gneiss["joints/transmissivity"].to_dataset()
    assert np.isfinite(flow["hydraulic_aperture"]).all()
    assert (flow["hydraulic_aperture"].diff("step") < 0).all()


def test_pair_is_brought_into_mated_position(gneiss):
    faces = gneiss["joints/faces"].to_dataset()
    assert abs(float(faces["shift_x"])) < 1e-3
    opening = (faces["height"] - gneiss["surfaces/height"]).mean()
    # the authors' mean aperture is 0.637 mm
    assert float(opening) == pytest.approx(0.637e-3, rel=0.1)


def test_hurst_exponent_agrees_with_the_published_one(gneiss):
    # of the face as scanned, interpolated from points: its shortest waves tell nothing
    estimate = gneiss["dimensions"].to_dataset().sel({"method": "default"})
    assert abs(float(estimate["hurst"]) - 0.71) < float(estimate["standard_error"]) < 0.2
    assert float(estimate["ci_low"]) < 0.71 < float(estimate["ci_high"])
