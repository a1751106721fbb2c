"""What `press` returns: labels, files, provenance, scalars that are consistent with the maps."""

import json
import warnings

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import SmallStrainWarning

MODULUS = 2e9


def labelled():
    rng = np.random.default_rng(1)
    surface = fc.surfaces.from_array(1e-6 * rng.normal(size=(9, 12)), (1e-4, 2e-4), periodic=True)
    keep = ("state", "pressure", "gap", "displacement")
    return surface, fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e5, 1e6], keep=keep)


def test_labels_and_file_round_trip(tmp_path, compliance):
    surface, result = labelled()
    assert result["pressure"].dims == ("step", "y", "x")
    assert result["state"].dtype == np.int8
    assert result["state"].attrs["flag_meanings"] == "open contact yielded"
    for name in ("closure", "normal_force", "nominal_pressure"):
        assert name in result.coords
        assert result[name].dims == ("step",)
    np.testing.assert_array_equal(result["y"], surface["y"])
    assert result["x"].attrs["period"] == surface["x"].attrs["period"]
    assert (result["run_time"] > 0).all()
    path = fc.save(result, tmp_path / "contact.nc")
    back = fc.open(path)
    np.testing.assert_array_equal(back["pressure"], result["pressure"])
    result.to_netcdf(tmp_path / "flat.nc")
    assert compliance(tmp_path / "flat.nc") == []


def test_provenance():
    _, result = labelled()
    entry = json.loads(result.attrs["provenance"])
    assert entry["call"] == "fractalcontact.contact.press"
    assert entry["boundary"] == "periodic"
    assert entry["influence"] == "spectral"
    assert entry["solver"] == f"whole_plane ({result.sizes['step']} steps)"
    assert entry["achieved_residual"] == float(result["residual"].max())
    assert entry["parameters"]["contact_modulus"] == 1e9


def test_scalars_are_consistent():
    surface, result = labelled()
    area = 9e-4 * 24e-4
    np.testing.assert_allclose(result["normal_force"], result["nominal_pressure"] * area)
    np.testing.assert_allclose(result["contact_area"], result["contact_fraction"] * area)
    np.testing.assert_allclose(result["pressure"].mean(("y", "x")), result["nominal_pressure"], rtol=1e-12)
    np.testing.assert_allclose(result["gap"].mean(("y", "x")), result["mean_gap"])
    top = float(surface.max() - surface.mean())
    np.testing.assert_allclose(result["closure"], top - result["mean_gap"], rtol=1e-8)
    energy = 0.5 * (result["pressure"] * result["displacement"]).sum(("y", "x")) * 2e-8
    np.testing.assert_allclose(result["elastic_energy"], energy, rtol=1e-12)


def test_no_maps_without_keep():
    surface, _ = labelled()
    result = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=1e5, keep=())
    assert set(result.dims) == {"step"}


def test_corrected_area_of_node_and_row():
    heights = np.zeros((8, 8))
    heights[3, 4] = 1.0
    one = fc.contact.press(fc.surfaces.from_array(heights, 1.0), contact_modulus=1.0, closure=1e-3)
    assert float(one["corrected_contact_fraction"][0]) == pytest.approx((1 - 4 * 0.118114160) / 64)
    heights[3] = 1.0
    row = fc.surfaces.from_array(heights, 1.0, periodic=True)
    result = fc.contact.press(row, contact_modulus=1.0, nominal_pressure=1e-6)
    assert float(result["corrected_contact_fraction"][0]) == pytest.approx((8 - 16 * 0.118114160) / 64)


@pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.ConvergenceWarning")
def test_mated_periodic_path_is_written(tmp_path, compliance):
    """Mated faces of zero range touch everywhere; any closure is beyond what a periodic body can do."""
    flat = fc.surfaces.from_array(np.zeros((6, 8)), 1e-4, periodic=True)
    keep = ("state", "pressure", "gap", "displacement", "residual_height")
    result = fc.contact.press(flat, contact_modulus=MODULUS, closure=[0.0, 1e-6], keep=keep)
    np.testing.assert_array_equal(result["normal_force"], [0.0, np.nan])
    np.testing.assert_array_equal(result["stop_reason"], [0, 5])
    np.testing.assert_array_equal(result["contact_fraction"], [0.0, 1.0])
    np.testing.assert_array_equal(result["mean_gap"], [0.0, 0.0])
    assert json.loads(result.attrs["provenance"])["achieved_residual"] == 0.0
    path = fc.save(result, tmp_path / "mated.nc")
    back = fc.open(path)
    assert "mean plane" in back["normal_force"].attrs["reason"]
    np.testing.assert_array_equal(back["normal_force"], result["normal_force"])
    result.to_netcdf(tmp_path / "flat.nc")
    assert compliance(tmp_path / "flat.nc") == []
    beyond = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6)
    assert np.isnan(float(beyond["residual"][0]))
    pressed = fc.contact.press(flat, contact_modulus=MODULUS, normal_force=[0.0, 2.0], keep=keep)
    np.testing.assert_array_equal(pressed["closure"], [0.0, 0.0])


def sine(slope, cells=64):
    """A sine along x whose rms slope is known in closed form for many cells."""
    phase = 2 * np.pi * np.arange(cells) / cells
    amplitude = slope * np.sqrt(2) / (2 * np.pi)
    return fc.surfaces.from_array(np.tile(amplitude * np.sin(phase), (8, 1)), 1 / cells, periodic=True)


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_rms_slope_is_that_of_a_sine(unit):
    surface = sine(0.1) * unit
    surface = surface.assign_coords({d: surface[d] * unit for d in ("y", "x")})
    for dim in ("y", "x"):
        surface[dim].attrs = {"units": "m", "period": surface.sizes[dim] * unit / 64}
    pressed = fc.contact.press(surface, contact_modulus=1.0, nominal_pressure=1e-3)
    assert float(pressed.rms_slope) == pytest.approx(0.1, rel=1e-3)


def test_steep_surfaces_warn_and_flat_ones_do_not():
    with pytest.warns(SmallStrainWarning, match="rms slope of up to 0.4"):
        fc.contact.press(sine(0.4), contact_modulus=1.0, nominal_pressure=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fc.contact.press(sine(0.29), contact_modulus=1.0, nominal_pressure=1e-3)


def test_corrected_area_bears_the_force():
    """No node bears more than the hardness, so that no area below force over hardness can carry the load."""
    surface = fc.surfaces.spectral((96, 96), 1e-6, hurst=0.8, rolloff=4e-5, rms_slope=0.15, rng=3)
    loads = [5e7, 2e8, 5e7, 1e6]
    options = {"contact_modulus": 1.1e11, "nominal_pressure": loads, "hardness": 3e9}
    pressed = fc.contact.press(surface, **options)
    least = np.array(loads) / 3e9
    assert (pressed.corrected_contact_fraction >= least).all()
    assert (pressed.corrected_contact_fraction <= pressed.contact_fraction).all()
    assert pressed.corrected_contact_fraction.values[1] == pytest.approx(
        least[1]
    )  # all nodes yield, or nearly
