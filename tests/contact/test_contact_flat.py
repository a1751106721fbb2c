"""Flat faces, and what `press` says about itself: labels, files, provenance."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

MODULUS = 2e9


@pytest.mark.parametrize("options", [{}, {"influence": "square"}, {"disc_radius": "inscribed"}])
@pytest.mark.parametrize(("shape", "spacing"), [((32, 48), 1e-3), ((33, 20), (1e-3, 7e-4))])
def test_a_flat_face_closes_by_force_over_stiffness(shape, spacing, options):
    flat = fc.surfaces.from_array(np.full(shape, 0.7), spacing)
    forces = [0.0, 1.0, 3e4]
    found = fc.contact.press(flat, contact_modulus=MODULUS, normal_force=forces, keep=("gap",), **options)
    stiffness = fc.contact.flat_stiffness(shape, spacing, contact_modulus=MODULUS, **options)
    np.testing.assert_allclose(found["closure"], np.array(forces) / stiffness, rtol=1e-13)
    assert (found["gap"] == 0).all()
    assert bool(found["converged"].all())
    closed = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6, **options)
    assert float(closed["normal_force"][0]) == pytest.approx(1e-6 * stiffness, rel=1e-15)


def test_the_stiffness_of_a_square_block_and_its_order():
    error = []
    for n in (32, 64, 128):
        stiffness = fc.contact.flat_stiffness((n, n), 1.0 / n, contact_modulus=1.0)
        error.append(stiffness / 1.15230 - 1)
    assert abs(error[-1]) < 5e-3
    assert error[0] / error[1] == pytest.approx(2.0, abs=0.1)  # first order: the edge is singular


def test_uniform_pressure_settles_by_the_mean_of_love():
    stiffness = fc.contact.flat_stiffness((128, 128), 1 / 128, contact_modulus=1.0, loading="uniform")
    assert stiffness == pytest.approx(1 / 0.9464020, rel=2e-4)


def test_a_periodic_flat_has_no_stiffness_of_its_own():
    assert fc.contact.flat_stiffness((8, 8), 1.0, contact_modulus=1.0, boundary="periodic") == np.inf
    flat = fc.surfaces.from_array(np.zeros((8, 8)), 1.0, periodic=True)
    found = fc.contact.press(flat, contact_modulus=1.0, nominal_pressure=0.3, keep=("pressure",))
    assert float(found["closure"][0]) == 0.0
    np.testing.assert_allclose(found["pressure"], 0.3, rtol=1e-14)


def test_a_nearly_flat_face_closes_like_a_flat_one():
    n, stiffness = 64, fc.contact.flat_stiffness((64, 64), 1e-3, contact_modulus=MODULUS)
    heights = 1e-15 * np.random.default_rng(0).random((n, n))
    face = fc.surfaces.from_array(heights, 1e-3)
    found = fc.contact.press(face, contact_modulus=MODULUS, normal_force=1e3)
    assert bool(found["converged"].all())
    assert float(found["closure"][0]) == pytest.approx(1e3 / stiffness, rel=1e-8)


@pytest.mark.parametrize("shape", [5, None, (3,), ((3, 3), (3, 3)), (3.0, 4.0), (2, 3), "ab"])
def test_a_stiffness_wants_the_shape_of_a_plane(shape):
    with pytest.raises(InvalidInput, match="shape"):
        fc.contact.flat_stiffness(shape, 1.0, contact_modulus=1.0)


@pytest.mark.parametrize(("factor", "modulus"), [(1e-95, 1e-200), (1e95, 1e200)])
def test_heights_that_no_product_can_hold_are_refused(factor, modulus):
    face = fc.surfaces.from_array(factor * np.eye(8), 1e-3)
    with pytest.raises(InvalidInput, match="surface / contact_modulus: .* double"):
        fc.contact.press(face, contact_modulus=modulus, closure=0.1 * factor)


def test_what_is_wrong_with_a_stiffness_is_listed():
    with pytest.raises(InvalidInput) as caught:
        fc.contact.flat_stiffness((2, 9, 4), -1.0, contact_modulus=0.0, boundary="open")
    for word in ("shape", "spacing", "contact_modulus", "boundary"):
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("radius", "ratio"), [("equal_area", 1.0), ("second_order", 3.0), (0.8e-3, 1.0), (-1.0, 1.0)]
)
def test_which_plates_are_refused(radius, ratio):
    face = fc.surfaces.from_array(np.eye(8), (1e-3, 1e-3 * ratio))
    if radius == "equal_area":
        assert bool(
            fc.contact.press(face, contact_modulus=1.0, closure=0.1, disc_radius=radius)["converged"].all()
        )
        return
    with pytest.raises(InvalidInput, match="square|disc_radius"):
        fc.contact.press(face, contact_modulus=1.0, closure=0.1, disc_radius=radius)


def labelled():
    rng = np.random.default_rng(1)
    surface = fc.surfaces.from_array(1e-6 * rng.normal(size=(9, 12)), (1e-4, 2e-4), periodic=True)
    keep = ("state", "pressure", "gap", "displacement")
    return surface, fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e5, 1e6], keep=keep)


def test_the_result_is_labelled_and_survives_a_file(tmp_path, compliance):
    surface, found = labelled()
    assert found["pressure"].dims == ("step", "y", "x")
    assert found["state"].dtype == np.int8
    assert found["state"].attrs["flag_meanings"] == "open contact yielded"
    for name in ("closure", "normal_force", "nominal_pressure"):
        assert name in found.coords
        assert found[name].dims == ("step",)
    np.testing.assert_array_equal(found["y"], surface["y"])
    assert found["x"].attrs["period"] == surface["x"].attrs["period"]
    assert (found["run_time"] > 0).all()
    path = fc.save(found, tmp_path / "contact.nc")
    back = fc.open(path)
    np.testing.assert_array_equal(back["pressure"], found["pressure"])
    found.to_netcdf(tmp_path / "flat.nc")
    assert compliance(tmp_path / "flat.nc") == []


def test_the_result_tells_how_it_was_made():
    _, found = labelled()
    entry = json.loads(found.attrs["provenance"])
    assert entry["call"] == "fractalcontact.contact.press"
    assert entry["boundary"] == "periodic"
    assert entry["influence"] == "spectral"
    assert entry["achieved_residual"] == float(found["residual"].max())
    assert entry["parameters"]["contact_modulus"] == 1e9


def test_scalars_hang_together():
    surface, found = labelled()
    area = 9e-4 * 24e-4
    np.testing.assert_allclose(found["normal_force"], found["nominal_pressure"] * area)
    np.testing.assert_allclose(found["contact_area"], found["contact_fraction"] * area)
    np.testing.assert_allclose(found["pressure"].mean(("y", "x")), found["nominal_pressure"], rtol=1e-12)
    np.testing.assert_allclose(found["gap"].mean(("y", "x")), found["mean_gap"])
    top = float(surface.max() - surface.mean())
    np.testing.assert_allclose(found["closure"], top - found["mean_gap"], rtol=1e-8)
    energy = 0.5 * (found["pressure"] * found["displacement"]).sum(("y", "x")) * 2e-8
    np.testing.assert_allclose(found["elastic_energy"], energy, rtol=1e-12)


def test_no_maps_no_plane():
    surface, _ = labelled()
    found = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=1e5, keep=())
    assert set(found.dims) == {"step"}


def test_the_corrected_area_of_one_node_and_of_a_row():
    heights = np.zeros((8, 8))
    heights[3, 4] = 1.0
    one = fc.contact.press(fc.surfaces.from_array(heights, 1.0), contact_modulus=1.0, closure=1e-3)
    assert float(one["corrected_contact_fraction"][0]) == pytest.approx((1 - 4 * 0.118114160) / 64)
    heights[3] = 1.0
    row = fc.surfaces.from_array(heights, 1.0, periodic=True)
    found = fc.contact.press(row, contact_modulus=1.0, nominal_pressure=1e-6)
    assert float(found["corrected_contact_fraction"][0]) == pytest.approx((8 - 16 * 0.118114160) / 64)


def test_mixed_axes_must_be_called_free():
    surface, _ = labelled()
    crop = surface.isel(x=slice(0, 8))
    with pytest.raises(InvalidInput, match="'free'"):
        fc.contact.press(crop, contact_modulus=1e9, nominal_pressure=1e5)
    found = fc.contact.press(crop, contact_modulus=1e9, nominal_pressure=1e5, boundary="free")
    assert json.loads(found.attrs["provenance"])["boundary"] == "free"


def test_bad_faces_are_refused():
    good = np.zeros((5, 5))
    bad = good.copy()
    bad[2, 2] = np.nan
    for heights, word in ((bad, "fill"), (good[:2], "at least 3")):
        with pytest.raises(InvalidInput, match=word):
            fc.contact.press(fc.surfaces.from_array(heights, 1.0), contact_modulus=1.0, closure=0.1)
    with pytest.raises(InvalidInput, match="DataArray"):
        fc.contact.press(good, contact_modulus=1.0, closure=0.1)


@pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.ConvergenceWarning")
def test_a_path_of_mated_periodic_faces_survives_and_is_written(tmp_path, compliance):
    """Mated faces of zero range touch everywhere; any closure is beyond what a periodic body can do."""
    flat = fc.surfaces.from_array(np.zeros((6, 8)), 1e-4, periodic=True)
    keep = ("state", "pressure", "gap", "displacement", "residual_height")
    found = fc.contact.press(flat, contact_modulus=MODULUS, closure=[0.0, 1e-6], keep=keep)
    np.testing.assert_array_equal(found["normal_force"], [0.0, np.nan])
    np.testing.assert_array_equal(found["stop_reason"], [0, 5])
    np.testing.assert_array_equal(found["contact_fraction"], [0.0, 1.0])
    np.testing.assert_array_equal(found["mean_gap"], [0.0, 0.0])
    assert json.loads(found.attrs["provenance"])["achieved_residual"] == 0.0
    path = fc.save(found, tmp_path / "mated.nc")
    back = fc.open(path)
    assert "mean plane" in back["normal_force"].attrs["reason"]
    np.testing.assert_array_equal(back["normal_force"], found["normal_force"])
    found.to_netcdf(tmp_path / "flat.nc")
    assert compliance(tmp_path / "flat.nc") == []
    beyond = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6)
    assert np.isnan(float(beyond["residual"][0]))
    pressed = fc.contact.press(flat, contact_modulus=MODULUS, normal_force=[0.0, 2.0], keep=keep)
    np.testing.assert_array_equal(pressed["closure"], [0.0, 0.0])
