"""Cyclic shear of teeth, whose stress and work are known."""

import numpy as np
import pytest

import fractalcontact as fc


def test_stress_out_and_back_on_teeth(teeth):
    result = fc.joints.cyclic_shear(teeth, [0, 5e-3, -5.5e-3, 0], nominal_pressure=[1e6, 2e6])
    np.testing.assert_allclose(
        result.shear.values[[0, 5, 6, 11, 12, 18, 19, -1]],
        [0, 5e-3, 5e-3, 0, 0, -5.5e-3, -5.5e-3, 0],
        atol=1e-18,
    )
    up, down = np.tan(np.radians([40, 20]))
    stress = result.shear_stress.values[:, 0]
    np.testing.assert_allclose(stress[:6], 1e6 * up)
    np.testing.assert_allclose(stress[6:12], -1e6 * down)
    np.testing.assert_allclose(stress[12:19], -1e6 * up)
    np.testing.assert_allclose(stress[19:], 1e6 * down)
    np.testing.assert_allclose(result.shear_stress.values[:, 1], 2 * stress)
    assert result.slip[-1] == pytest.approx(21e-3)
    # each flank has its own slope where two of them meet
    closed = 1e6 * (up + down) * 10.5e-3
    assert result.frictional_work.values[-1, 0] == pytest.approx(closed, rel=1e-9)


def test_direction_reverses_the_cycle(teeth):
    there = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6)
    back = fc.joints.cyclic_shear(teeth, [0, -4e-3], direction="W", nominal_pressure=1e6)
    np.testing.assert_allclose(there.shear_stress, -back.shear_stress)
    np.testing.assert_allclose(there.friction_angle, back.friction_angle)


@pytest.fixture(scope="module")
def opening(crack):
    """Dilatancy of a rough joint under two forces, towards East and West."""
    shear = np.arange(6) * 8e-5
    return fc.joints.dilatancy(crack, shear=shear, direction=["E", "W"], normal_force=[100.0, 1e3])


@pytest.mark.parametrize("form", ["kinematic", "energy"])
@pytest.mark.parametrize("smoothing", [None, 1.6e-4])
def test_angle_of_every_shear_is_that_of_friction(opening, form, smoothing):
    options = {"form": form, "smoothing": smoothing}
    angle = fc.joints.friction(opening, **options).friction_angle
    end = float(opening.shear[-1])
    cycle = fc.joints.cyclic_shear(opening, [0.0, end, -end], direction="E", **options)
    np.testing.assert_allclose(cycle.friction_angle[:6], angle.sel(direction="E"))
    np.testing.assert_allclose(cycle.friction_angle[-6:], angle.sel(direction="W"))
    one_sided = fc.joints.cyclic_shear(opening, [0.0, end], direction="E", **options)
    np.testing.assert_allclose(one_sided.friction_angle, cycle.friction_angle[:6])


def test_work_of_the_energy_form_is_lift_plus_stored_energy(opening):
    # without basic friction the work out is N times the lift plus the elastic energy, and a cycle costs none
    end = float(opening.shear[-1])
    cycle = fc.joints.cyclic_shear(opening, [0.0, end, 0.0], form="energy", basic_friction_angle=0)
    out = opening.sel(direction="E")
    work = out.normal_force * out.dilatancy + out.elastic_energy
    expected = (work.isel(shear=-1) - work.isel(shear=0)) / float(opening.nominal_area)
    half = cycle.frictional_work.values[5]
    assert np.isfinite(half).all()
    # at even steps the trapezia of slopes through the neighbours add up to the curve
    np.testing.assert_allclose(half, expected, rtol=1e-9)
    np.testing.assert_allclose(cycle.frictional_work.values[-1], 0.0, atol=1e-12 * np.abs(half).max())


def test_without_pressure_only_angles(teeth):
    result = fc.joints.cyclic_shear(teeth, [1e-3, 4e-3, 2e-3])
    assert "shear_stress" not in result
    np.testing.assert_allclose(result.friction_angle, [40.0] * 4 + [20.0] * 3)


def test_locked_faces_have_no_stress(teeth):
    result = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(result.shear_stress.values[1:]).all()
    assert "90 degrees" in result.shear_stress.attrs["reason"]
    strength = fc.joints.friction(teeth, nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(strength.peak_shear_strength).all()
    assert np.isnan(strength.peak_strength_shear).all()
    assert "90 degrees" in strength.peak_shear_strength.attrs["reason"]


def test_invalid_paths_are_refused(teeth):
    for path, match in (
        ([0.0], "at least two positions"),
        ([0.0, 1e-3, 1e-3], "each different from"),
        ([0.0, 9e-3], "positions from 0 to 0.008 m"),
    ):
        with pytest.raises(ValueError, match=match):
            fc.joints.cyclic_shear(teeth, path)
    with pytest.raises(ValueError, match="the azimuth 180"):
        fc.joints.cyclic_shear(teeth.sel(direction=["E"]), [0.0, 1e-3, -1e-3])
    with pytest.raises(ValueError, match="dilatancy.shear: expected at least two shears, ascending"):
        fc.joints.cyclic_shear(teeth.isel(shear=[2, 1]), [0.0, 1e-3])
